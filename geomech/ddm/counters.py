"""What solving has taken: counts that go on from body to body."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields


@dataclass(eq=False)
class Work:
    """Counts of work; bodies that are given the same one add to it.

    bodies, elements_assembled     geometries, and elements whose influence on others was worked out
    boundary_assemblies, boundary_factorisations     of A_ΓΓ
    crack_factorisations           of the crack unknowns' equations, whole or with nodes held
    crack_borderings               of these factors by what is new, instead
    back_substitutions             right-hand sides solved for with these
    solutions, contact_solves      loads solved for, and passes of the contact of crack faces in them
    compliances                    of cracked bodies, worked out
    solutions_left_out             of bodies whose cracks could not grow, and nobody asked
    solutions_scaled               under an even stress, from those under unit ones
    bodies_kept, solutions_kept, compliances_kept     what was asked for again with nothing changed, and so not done
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
        """The sums of ``parts``: bodies that are made or solved side by side count apart."""
        parts = list(parts)
        return cls(**{each.name: sum(getattr(part, each.name) for part in parts) for each in fields(cls)})
