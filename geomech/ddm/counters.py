"""Counts of the operations that solutions take, summed over bodies."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields


@dataclass(eq=False)
class Work:
    """Operation counts; bodies can share one object and add to it.

    bodies, elements_assembled     geometries, and elements whose influence was computed
    boundary_assemblies, boundary_factorisations     of A_ΓΓ
    crack_factorisations           of the equations of the crack unknowns, whole or with constrained nodes
    crack_borderings               extensions of these factors by new unknowns
    back_substitutions             right-hand sides solved with factors
    solutions, contact_solves      loads solved, and iterations of the contact of crack faces in them
    compliances                    of cracked bodies, computed
    solutions_left_out             of bodies whose cracks could not grow and whose solution was not used
    solutions_scaled               under uniform stress, combined from those under unit stresses
    bodies_kept, solutions_kept, compliances_kept     reused because nothing had changed
    """

    bodies: int = 0
    elements_assembled: int = 0
    boundary_assemblies: int = 0
    boundary_factorisations: int = 0
    crack_factorisations: int = 0
    crack_borderings: int = 0
    back_substitutions: int = 0
    solutions: int = 0
    contact_solves: int = 0
    compliances: int = 0
    solutions_left_out: int = 0
    solutions_scaled: int = 0
    bodies_kept: int = 0
    solutions_kept: int = 0
    compliances_kept: int = 0

    @classmethod
    def total(cls, parts: Iterable[Work]) -> Work:
        """The sum of ``parts``; bodies solved in parallel have separate counts."""
        parts = list(parts)
        return cls(**{each.name: sum(getattr(part, each.name) for part in parts) for each in fields(cls)})
