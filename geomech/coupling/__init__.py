"""Coupling of DDA and DDM: boundary tractions from contact forces, crack compliance, growth, splitting, the cycle."""

from .cycle import Coupling, cycles

__all__ = ["Coupling", "cycles"]
