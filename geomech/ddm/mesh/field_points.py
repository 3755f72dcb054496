"""Points at which a field is asked for, kept off the ends of elements: the discrete solution has no stress there."""

from __future__ import annotations

import numpy as np

from ..kernels import shape_functions
from ..system.influence_matrix import ElementSet

#: Where a field is asked for at an inner end of an element it is taken this part of the element's length away: the
#: small jump of density from element to element acts like a dislocation there. Where the elements go straight on, it is
#: the mean of two points as far ahead and behind, in which that cancels, and with it what the field changes in between.
_NUDGE = 0.02
_NUDGE_STRAIGHT = 0.005
#: Nearer to an end than this part of that distance a point is the end itself; from farther off it is moved on the way
#: it stands, so that of two faces that meet at a kink each is looked at from its own side. A crack tip's own square
#: root is in the elements: there only the tip itself, to round-off, is moved.
_AT_END = 1e-6
_AT_TIP = 1e-12


class ElementEnds:
    """Where elements of a ``boundary`` and of crack ``faces`` end, each place once; ends within ``tol`` (m) meet."""

    def __init__(self, boundary: ElementSet, faces: ElementSet, tol: float):
        sets = (boundary, faces)
        ends = np.concatenate([x for s in sets for x in (s.start, s.end)])
        reach = _NUDGE * np.concatenate([x for s in sets for x in (s.length, s.length)])
        tip = np.concatenate([np.isin(s.kind, kinds) for s in sets for kinds in _TIPS])
        # Places by their first end; ends that meet are equal but for round-off.
        place = np.arange(len(ends))
        one, other, _ = within(ends, ends, np.full(len(ends), tol))
        np.minimum.at(place, one, other)
        first, place = np.unique(place, return_inverse=True)
        self.points = ends[first]
        self.reach = np.full(len(first), np.inf)
        np.minimum.at(self.reach, place, reach)
        tangents = np.concatenate([x for s in sets for x in (s.tangent, s.tangent)])
        ahead = np.zeros((len(first), 2))
        np.add.at(ahead, place, tangents)
        # Two ends meet, of elements that go straight on, to 1e-6 rad.
        self._straight = (np.bincount(place) == 2) & (np.hypot(*ahead.T) > 2 - 1e-13)
        self._ahead = 0.5 * ahead
        self.reach[self._straight] *= _NUDGE_STRAIGHT / _NUDGE
        # The normals there, those of faces apart: they turn with the side.
        normals = [np.concatenate([s.normal, s.normal]) for s in sets]
        self._inward, self._up = np.zeros((2, len(first), 2))
        np.add.at(self._inward, place[: 2 * boundary.n], normals[0])
        np.add.at(self._up, place[2 * boundary.n :], normals[1])
        self._any = np.concatenate(normals)[first]
        meeting = np.bincount(place)
        self.tip = np.bincount(place, tip) == meeting
        self.near = np.where(self.tip, _AT_TIP / _NUDGE, _AT_END) * self.reach

    def aside(self, points: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray]:
        """The ``points`` (n, 2), those too near moved off, from the very end to ``side`` of the elements, and, behind
        them, the second ones of the k that have two; which those are (k,)."""
        who, at, distance = within(points, self.points, np.where(self.tip, self.near, self.reach))
        if not len(who):
            return points, who
        # The nearest, where one point is near several.
        order = np.lexsort((distance, who))
        order = order[np.r_[True, np.diff(who[order]) > 0]]
        who, at, distance = who[order], at[order], distance[order]
        moved = points.copy()
        double, single = self._straight[at], ~self._straight[at]
        # Twice the reach, so that neither comes to stand on the end.
        step = self._ahead[at[double]] * (2 * self.reach[at[double], None])
        moved[who[double]] += step
        second = points[who[double]] - step
        self._move(moved, who[single], at[single], distance[single], side)
        return np.concatenate([moved, second]), who[double]

    def _move(self, points, who, at, distance, side):
        """Points ``who`` to where the ends ``at`` reach, in place."""
        way = points[who] - self.points[at]
        here = distance <= self.near[at]
        rock = self._inward[at] + side * self._up[at]
        # Faces may look away from each other: then one of them will do.
        lost = np.hypot(*rock.T) < 1e-6
        rock[lost] = self._any[at[lost]]
        way[here] = rock[here]
        points[who] = self.points[at] + way * (self.reach[at] / np.hypot(*way.T))[:, None]


#: Kinds with a tip at the start, at the end.
_TIPS = ((shape_functions.TIP_START, shape_functions.TIP_BOTH), (shape_functions.TIP_END, shape_functions.TIP_BOTH))


def within(points: np.ndarray, centres: np.ndarray, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All pairs of a point (n, 2) and a centre (m, 2) no farther apart than its ``reach`` (m,): their numbers and
    distance."""
    sweep = np.argsort(points[:, 0], kind="stable")
    x = points[sweep, 0]
    first = np.searchsorted(x, centres[:, 0] - reach, side="left")
    count = np.searchsorted(x, centres[:, 0] + reach, side="right") - first
    # All pairs of a strip, one centre after the other.
    centre = np.repeat(np.arange(len(centres)), count)
    point = sweep[np.arange(count.sum()) + np.repeat(first - np.cumsum(count) + count, count)]
    distance = np.hypot(*(points[point] - centres[centre]).T)
    found = np.flatnonzero(distance <= reach[centre])
    return point[found], centre[found], distance[found]
