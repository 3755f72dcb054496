"""The rock formed by all blocks together: its outline without the seams between them, and its ground surface."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...model import Blocks

#: Edges of neighbours coincide to round-off, which leaves slits in a plain union: gaps narrower than this part of the
#: rock's largest side are closed.
SEAM = 1e-8


def rock_of(blocks: Blocks, chosen: Iterable[int] | None = None):
    """Area, a shapely (multi)polygon, of ``blocks`` (the ``chosen`` ones, default all) together."""
    import shapely

    numbers = range(blocks.n_blocks) if chosen is None else chosen
    polygons = np.array([shapely.Polygon(own[0], own[1:]) for own in map(blocks.loops, numbers)], dtype=object)
    if not len(polygons):
        return shapely.Polygon()
    low, high = blocks.vertices.min(axis=0), blocks.vertices.max(axis=0)
    seam = SEAM * float((high - low).max())
    # Buffered outwards and inwards by the same distance, with sharp corners: the result is exact to round-off.
    return shapely.union_all(shapely.buffer(polygons, seam, join_style="mitre")).buffer(-seam, join_style="mitre")


def ground_of(blocks: Blocks) -> np.ndarray:
    """(n, 2) m: outline of the largest piece of rock from its upper left corner over its top to the upper right one,
    overhangs and vertical faces included."""
    import shapely

    rock = max(shapely.get_parts(rock_of(blocks)), key=lambda part: part.area)
    ring = shapely.get_coordinates(shapely.orient_polygons(rock).exterior)[:-1]
    low, high = ring.min(axis=0), ring.max(axis=0)
    near = 10 * SEAM * float((high - low).max())
    left, right = np.flatnonzero(ring[:, 0] <= low[0] + near), np.flatnonzero(ring[:, 0] >= high[0] - near)
    first, last = left[np.argmax(ring[left, 1])], right[np.argmax(ring[right, 1])]
    # The exterior turns counter-clockwise: over the top it runs from right to left.
    n = (first - last) % len(ring) + 1
    return np.roll(ring, -last, axis=0)[:n][::-1].copy()
