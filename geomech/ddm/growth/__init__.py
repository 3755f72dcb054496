"""Growth of crack networks: steps of tips, curved paths, initiation, junctions."""
