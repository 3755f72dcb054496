"""Counts of the operations of block systems, and of those that reuse made unnecessary; systems may share one object."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field


@dataclass(eq=False)
class Work:
    """Operation counts; systems that share an object add to it.

    pair_searches, pair_searches_kept     neighbour lists computed, and reused because no vertex had moved far enough
                                      another pair to come near
    lone_searches                         contact searches for a single block, which has no neighbours
    factorisations, factorisations_kept   sparse factorisations, complete or partial; and solutions that reused the
                                      of an earlier, nearly equal matrix
    pair_search_s, factorisation_s        s, time of these operations except the first, which may have loaded kernels
    shortened                             number of steps shortened, by (reason, name of the block, of the other or "")
    """

    pair_searches: int = 0
    pair_searches_kept: int = 0
    lone_searches: int = 0
    factorisations: int = 0
    factorisations_kept: int = 0
    pair_search_s: float = 0.0
    factorisation_s: float = 0.0
    shortened: Counter[tuple[str, str, str]] = field(default_factory=Counter)
