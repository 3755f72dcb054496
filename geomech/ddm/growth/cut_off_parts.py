"""Parts of rock that cracks have cut off.

Cracks and boundaries form a graph, in which each boundary loop is one node. Segments on cycles of it cut rock off. A
part without supports can then move freely while its faces are open: the equations of the open faces are singular, and
round-off decides whether a solver notices.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..mesh.elements import distance_to_segments

if TYPE_CHECKING:
    from ..interfaces import CrackedBody


def cutting_segments(body: CrackedBody) -> np.ndarray:
    """(n_segments,) bool: segments between the cycles of the graph, or on one; none if cracks cut nothing off."""
    cracks, edges = body.cracks, body.mesh.edges
    node = np.arange(len(cracks.nodes))
    for k in np.flatnonzero(cracks.surface & (cracks.valence > 0)):
        # A mouth off all edges is on the surface of a half-plane.
        node[k] = len(node) + (_loop(edges, body.mesh.edge_loop, cracks.nodes[k]) if len(edges) else -1) + 1
    ends = node[cracks.segments]
    kept = np.ones(len(ends), bool)
    while kept.any():
        valence = np.bincount(ends[kept].ravel(), minlength=ends.max() + 1)
        loose_end = kept & (valence[ends] == 1).any(axis=1)
        if not loose_end.any():
            break
        kept &= ~loose_end
    return kept


def _loop(edges: np.ndarray, loop: np.ndarray, point: np.ndarray) -> int:
    """The loop on which ``point`` lies; −1 if it is on none."""
    off = distance_to_segments(point, edges)
    return int(loop[off.argmin()]) if off.min() <= 1e-6 * np.ptp(edges.reshape(-1, 2), axis=0).max() else -1
