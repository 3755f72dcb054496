"""Rock bridges: intact rock between the end of a joint and the next discontinuity ahead."""

from __future__ import annotations

import numpy as np

from ...model import Blocks, Cracks

#: Another end is ahead if its direction deviates by less than this (cosine of 15°): the gap in a joint.
_AHEAD = 0.9659


def rock_bridges(blocks: Blocks, cracks: Cracks) -> np.ndarray:
    """(n, 2, 2) m: from each crack end in the rock to the nearest point ahead in its block: an outline or another crack
    on its line, or another end within 15° of it. Two ends that face each other share one bridge."""
    import shapely

    tips = cracks.tips
    if not len(tips):
        return np.empty((0, 2, 2))
    flat = cracks.segments.ravel()
    place = np.array([int(np.flatnonzero(flat == tip)[0]) for tip in tips])
    segment = place // 2
    at = cracks.nodes[tips]
    along = at - cracks.nodes[cracks.segments[segment, 1 - place % 2]]
    along /= np.hypot(*along.T)[:, None]
    owner = cracks.block[segment]
    used = np.unique(owner)
    shapes = {int(b): shapely.Polygon(blocks.loops(b)[0], blocks.loops(b)[1:]) for b in used}
    lines = shapely.linestrings(cracks.nodes[cracks.segments])
    walls = {b: shapely.union_all([shape.boundary, *lines[cracks.block == b]]) for b, shape in shapes.items()}
    far = 2.0 * np.array([np.hypot(*np.ptp(blocks.loops(int(b))[0], axis=0)) for b in owner])
    # The ray starts from its own crack.
    rays = shapely.linestrings(np.stack([at + 1e-9 * far[:, None] * along, at + far[:, None] * along], axis=1))
    ends = shapely.points(at)
    hits = shapely.intersection(rays, np.array([walls[int(b)] for b in owner]))
    near = shapely.get_coordinates(shapely.shortest_line(ends, hits)).reshape(-1, 2, 2)
    reach = np.hypot(*(near[:, 1] - near[:, 0]).T)
    facing = np.full(len(tips), -1)
    for block in used:
        own = np.flatnonzero(owner == block)
        gap = at[own][None] - at[own][:, None]
        distance = np.hypot(gap[..., 0], gap[..., 1])
        ahead = np.einsum("ijk,ik->ij", gap, along[own]) > _AHEAD * distance
        distance[~ahead | (distance == 0)] = np.inf
        best = np.argmin(distance, axis=1)
        nearer = distance[np.arange(len(own)), best] < reach[own] * (1 + 1e-9)
        facing[own[nearer]] = own[best[nearer]]
    out, seen = [], set()
    for k, other in enumerate(facing.tolist()):
        pair = (min(k, other), max(k, other))
        if other < 0:
            out.append(near[k])
        elif pair not in seen:
            seen.add(pair)
            out.append(np.array([at[k], at[other]]))
    return np.array(out)
