"""Fate of each trace that cuts rock: the length along which it separates blocks, and traces trimmed away completely."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .noding import Drawn, Graph, Repair


class Parting(NamedTuple):
    """Fate of the joints of one ``name``: the number of ``traces`` that reach into the rock, the number of those that
    are ``cutting`` (completely or in part), and the ``length`` along which they separate blocks, m."""

    name: str
    traces: int
    cutting: int
    length: float


def trace_lengths(graph: Graph, drawn: Drawn, among: np.ndarray) -> np.ndarray:
    """(n_sources,) m: length of each outline edge and each trace in the edges ``among`` (a mask)."""
    span = np.hypot(*(graph.nodes[graph.edges[:, 1]] - graph.nodes[graph.edges[:, 0]]).T)
    return np.bincount(graph.source[among], weights=span[among], minlength=len(drawn.names))


def trimmed_away(drawn: Drawn, reach: np.ndarray, left: np.ndarray) -> list[Repair]:
    """Traces of which ``reach`` (m) lay in the rock and nothing is ``left``."""
    gone = np.flatnonzero((reach > 0) & (left == 0))
    gone = gone[gone >= drawn.n_outlines]
    # Pieces are in the order of their traces; a trace is reported at its middle one.
    median = (np.searchsorted(drawn.source, gone) + np.searchsorted(drawn.source, gone, "right")) // 2
    at = 0.5 * (drawn.start[median] + drawn.end[median])
    return [Repair("trimmed away", x, y, size) for (x, y), size in zip(at.tolist(), reach[gone].tolist(), strict=True)]


def partings(drawn: Drawn, names: Sequence[str], reach: np.ndarray, cutting: np.ndarray) -> tuple[Parting, ...]:
    """For the joints ``names``, of whose traces ``reach`` (m) lie in the rock and ``cutting`` (m) separate blocks."""
    rank = drawn.rank
    return tuple(
        Parting(name, int(((reach > 0) & (rank == place)).sum()), int(((cutting > 0) & (rank == place)).sum()),
                float(cutting[rank == place].sum()))
        for place, name in enumerate(names)
    )  # fmt: skip
