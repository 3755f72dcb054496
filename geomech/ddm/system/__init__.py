"""Influence matrices, the boundary's system, and the Schur complement on the crack unknowns."""
