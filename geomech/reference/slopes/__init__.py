"""Limit equilibrium and fracture mechanics of slopes."""
