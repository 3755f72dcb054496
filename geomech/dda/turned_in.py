"""Blocks that have turned into each other in a step, by corners that met nothing as it began.

Which edges a corner may meet is read off the geometry of the step's start (`contact_search`). Where two blocks turn
against each other in the step, other corners come first, round the end of a face or along it: what has gone in there
meets no contact, and a shorter step sees it come. It takes a turn of the angle by which corners that touch face to face
may lean, or of little less: steps in which blocks turn by less are not looked at.
"""

from __future__ import annotations

import numpy as np

from ..model import OPEN
from .near_pairs import boxes
from .overlap import depth_of_pair

#: Blocks that turn against each other by more than this in a step (rad) may meet with other corners than it began with.
_TURN = 0.025
#: Overlaps are looked for beyond this part of the smaller block's size (√area), the radius of corners, …
_DEPTH = 1e-5
#: … and beyond so many times what the contacts of the two are pressed in by: corners that springs hold lie so deep.
_HELD = 2.0


def turned_in(
    vertices: np.ndarray,
    before: np.ndarray,
    next_vertex: np.ndarray,
    vertex_start: np.ndarray,
    turn: np.ndarray,
    pairs: np.ndarray,
    contacts: np.ndarray,
    size: np.ndarray,
) -> tuple[int, int, float] | None:
    """The first two blocks of ``pairs`` (k, 2) found that overlap more at ``vertices`` than they did ``before`` (both
    (n_vertices, 2) m) and than the CONTACT rows ``contacts`` of the step say, and how deep, m; None if none do.

    ``turn`` (n_blocks,) rad in the step, ``size`` (n_blocks,) √area, m.
    """
    pairs = pairs[np.abs(turn[pairs[:, 0]] - turn[pairs[:, 1]]) > _TURN]
    if not len(pairs):
        return None
    now, then = _outlines(vertices, next_vertex, vertex_start), _outlines(before, next_vertex, vertex_start)
    closed = contacts[contacts["state"] != OPEN]
    for a, b in pairs:
        depth = depth_of_pair(*now, a, b)
        least = _DEPTH * min(size[a], size[b])
        if depth <= least:
            continue
        both = ((closed["block"] == a) & (closed["other"] == b)) | ((closed["block"] == b) & (closed["other"] == a))
        pressed = -float((closed["gap"] + closed["lift"])[both].min(initial=0.0))
        if depth > _HELD * pressed + least and depth > depth_of_pair(*then, a, b) + least:
            return int(a), int(b), float(depth)
    return None


def _outlines(vertices: np.ndarray, next_vertex: np.ndarray, vertex_start: np.ndarray):
    """What `depth_of_pair` reads of all blocks."""
    middle = np.add.reduceat(vertices, vertex_start[:-1]) / np.diff(vertex_start)[:, None]
    return vertices, next_vertex, vertex_start, boxes(vertices, vertex_start[:-1]), middle
