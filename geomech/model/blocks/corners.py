"""Over which lengths the corners of blocks are rounded."""

from __future__ import annotations

import numpy as np

from .block_arrays import Blocks

#: The rounding length takes no more than this part of the shortest edge at a corner.
LARGEST_SHARE = 0.25


def corner_lengths(blocks: Blocks, share: float) -> tuple[np.ndarray, np.ndarray]:
    """(n_vertices,) m twice: the rounding length of every corner of ``blocks``, ``share`` times the block's size
    (√area), and the longest that fits beside its shorter edge."""
    edges = np.hypot(*(blocks.vertices[blocks.next_vertex] - blocks.vertices).T)
    longest = LARGEST_SHARE * np.minimum(edges, edges[blocks.previous_vertex])
    return share * np.sqrt(blocks.areas())[blocks.vertex_block], longest
