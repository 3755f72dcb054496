"""ParaView series: grids of blocks, cracks, tips and contacts, written as VTU and PVD."""
