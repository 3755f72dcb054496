"""Tips at which a polygon stands for a curved crack.

The last side of a polygon with bends of β deviates at the tip by β/2 from the curve through its points. As for a short
kink, K_I and K_II are then off by 3/2 (β/2) K_II and ½ (β/2) K_I (Cotterell & Rice 1980, first order). A polygon is taken for a
curve where three drawn sides of similar length follow each other at similar angles of no more than 31°; what has grown
has the direction in which it grew.
"""

from __future__ import annotations

import numpy as np

from .crack_arrays import Cracks

#: Angles (rad) between sides that may represent a curve; a circle of twelve sides has 30°.
LEAST_BEND, MOST_BEND = np.radians(0.1), np.radians(31.0)
#: Largest ratio of the lengths of neighbouring chords of a curve, and of neighbouring angles.
LIKE = 2.0
#: Error of K_I over K_II, and of K_II over K_I, per rad of deviation.
ERRORS = 1.5, 0.5


def tip_deviations(cracks: Cracks) -> np.ndarray:
    """(n_tips,) rad: angle between the last side and the curve for which the polygon stands, in the order of
    ``cracks.tips``; 0 where it stands for none."""
    ends: dict[int, list[int]] = {}
    for segment, (a, b) in enumerate(cracks.segments.tolist()):
        ends.setdefault(a, []).append(segment)
        ends.setdefault(b, []).append(segment)
    out = np.zeros(len(cracks.tips))
    for k, tip in enumerate(cracks.tips.tolist()):
        path = _last_nodes(cracks, ends, tip)
        if path is None:
            continue
        sides = np.diff(cracks.nodes[path], axis=0)
        length = np.hypot(*sides.T)
        cross = sides[:-1, 0] * sides[1:, 1] - sides[:-1, 1] * sides[1:, 0]
        bend = np.arctan2(cross, np.sum(sides[:-1] * sides[1:], axis=1))
        small, large = np.sort(np.abs(bend))
        curved = bend[0] * bend[1] > 0 and small > LEAST_BEND and large < min(MOST_BEND, LIKE * small)
        if curved and length.max() < LIKE * length.min():
            out[k] = 0.5 * abs(bend[0])
    return out


def _last_nodes(cracks: Cracks, ends: dict[int, list[int]], tip: int) -> list[int] | None:
    """The last four nodes of the crack that ends at the node ``tip``; None where it has fewer drawn sides or branches."""
    path, before = [tip], -1
    for _ in range(3):
        on = [segment for segment in ends[path[-1]] if segment != before]
        if len(on) != 1 or cracks.birth_cycle[on[0]] != 0:
            return None
        before = on[0]
        a, b = cracks.segments[before].tolist()
        path.append(b if a == path[-1] else a)
    return path
