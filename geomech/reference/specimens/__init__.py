"""Specimens of the literature, with their published values."""
