"""Robustness of the solvers: maps over contrasts, slivers, steps and speeds."""
