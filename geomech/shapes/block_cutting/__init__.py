"""Cutting of rock into blocks by joint traces: noding, faces of the planar graph, dead ends."""
