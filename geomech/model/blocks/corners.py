"""Rounding lengths of block corners."""

from __future__ import annotations

import numpy as np

from .block_arrays import Blocks

#: Largest rounding length over the shorter edge at a corner.
LARGEST_SHARE = 0.25


def corner_lengths(blocks: Blocks, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Rounding length of every corner, and the longest that its shorter edge allows: (n_vertices,) m each.

    The rounding length is ``share`` times the block's size √area."""
    edges = np.hypot(*(blocks.vertices[blocks.next_vertex] - blocks.vertices).T)
    longest = LARGEST_SHARE * np.minimum(edges, edges[blocks.previous_vertex])
    return share * np.sqrt(blocks.areas())[blocks.vertex_block], longest
