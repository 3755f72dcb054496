"""Blocks and cracks drive each other: tractions from contacts, growth, compliance back, splitting, the cycle."""

from .cycle import Coupling, cycles

__all__ = ["Coupling", "cycles"]
