"""What block systems have done, and what they had no need to do again: counts that go on from system to system."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field


@dataclass(eq=False)
class Work:
    """Counts of work; systems that are given the same one add to it.

    pair_searches, pair_searches_kept     lists of near blocks that were made; that served again, since no vertex had
                                          moved far enough for another pair to come near
    lone_searches                         contacts asked for of a block without another: nothing is looked for
    factorisations, factorisations_kept   of a sparse matrix, whole or in part; solutions with the factors of a matrix
                                          before, from which the present one hardly differs
    pair_search_s, factorisation_s        what those that were made took, s, but for the first, which may have loaded
                                          kernels
    shortened                             how often each (reason, block's name, the other's or "") has shortened a step
    """

    pair_searches: int = 0
    pair_searches_kept: int = 0
    lone_searches: int = 0
    factorisations: int = 0
    factorisations_kept: int = 0
    pair_search_s: float = 0.0
    factorisation_s: float = 0.0
    shortened: Counter[tuple[str, str, str]] = field(default_factory=Counter)
