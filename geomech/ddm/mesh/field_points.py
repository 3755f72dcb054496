"""Field points moved away from element ends, where the discrete solution has no finite stress."""

from __future__ import annotations

import numpy as np

from ..kernels import shape_functions
from ..system.influence_matrix import ElementSet

#: A field point at an interior element end is moved away by this part of the element's length: the small jump of
#: density between elements acts like a dislocation there. Where the elements continue straight, the field is the mean
#: of two points at that distance on either side, in which the dislocations cancel and so does the field's gradient.
_NUDGE = 0.02
_NUDGE_STRAIGHT = 0.005
#: A point closer to an element end than this part of that distance counts as the end itself; a point farther off is
#: moved along the ray from the end, so that at a kink each face is evaluated on its own side. Tip elements contain the
#: square root: there only the tip itself, to round-off, is moved.
_AT_END = 1e-6
_AT_TIP = 1e-12


class ElementEnds:
    """Distinct end points of the elements of a ``boundary`` and of crack ``faces``; ends within ``tol`` (m) are one."""

    def __init__(self, boundary: ElementSet, faces: ElementSet, tol: float):
        sets = (boundary, faces)
        ends = np.concatenate([x for s in sets for x in (s.start, s.end)])
        reach = _NUDGE * np.concatenate([x for s in sets for x in (s.length, s.length)])
        tip = np.concatenate([np.isin(s.kind, kinds) for s in sets for kinds in _TIPS])
        # Each place is represented by its first end; ends that meet differ by round-off only.
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
        # Two ends meet, of elements that continue straight within 1e-6 rad.
        self._straight = (np.bincount(place) == 2) & (np.hypot(*ahead.T) > 2 - 1e-13)
        self._ahead = 0.5 * ahead
        self.reach[self._straight] *= _NUDGE_STRAIGHT / _NUDGE
        # The normals there, for the two faces separately: they change sign with the side.
        normals = [np.concatenate([s.normal, s.normal]) for s in sets]
        self._inward, self._up = np.zeros((2, len(first), 2))
        np.add.at(self._inward, place[: 2 * boundary.n], normals[0])
        np.add.at(self._up, place[2 * boundary.n :], normals[1])
        self._any = np.concatenate(normals)[first]
        meeting = np.bincount(place)
        self.tip = np.bincount(place, tip) == meeting
        self.near = np.where(self.tip, _AT_TIP / _NUDGE, _AT_END) * self.reach

    def moved_off(self, points: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray]:
        """Move ``points`` (n, 2) that are too close to an end; those at the end itself go to ``side`` of the elements.

        Returns the points, followed by the second points of the k that have two, and the indices (k,) of these.
        """
        row, at, distance = within(points, self.points, np.where(self.tip, self.near, self.reach))
        if not len(row):
            return points, row
        # The nearest end, where several are close.
        order = np.lexsort((distance, row))
        order = order[np.r_[True, np.diff(row[order]) > 0]]
        row, at, distance = row[order], at[order], distance[order]
        moved = points.copy()
        double, single = self._straight[at], ~self._straight[at]
        # Twice the reach, so that neither point lies at the end.
        step = self._ahead[at[double]] * (2 * self.reach[at[double], None])
        moved[row[double]] += step
        second = points[row[double]] - step
        self._move(moved, row[single], at[single], distance[single], side)
        return np.concatenate([moved, second]), row[double]

    def _move(self, points, row, at, distance, side):
        """Move the points ``row`` to the reach of the ends ``at``, in place."""
        way = points[row] - self.points[at]
        here = distance <= self.near[at]
        rock = self._inward[at] + side * self._up[at]
        # The faces' normals may be opposite: then either serves.
        lost = np.hypot(*rock.T) < 1e-6
        rock[lost] = self._any[at[lost]]
        way[here] = rock[here]
        points[row] = self.points[at] + way * (self.reach[at] / np.hypot(*way.T))[:, None]


#: Element kinds with a tip at the start, and at the end.
_TIPS = ((shape_functions.TIP_START, shape_functions.TIP_BOTH), (shape_functions.TIP_END, shape_functions.TIP_BOTH))


def within(points: np.ndarray, centres: np.ndarray, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All pairs of a point (n, 2) and a centre (m, 2) no farther apart than the centre's ``reach`` (m,): both indices
    and the distance."""
    sweep = np.argsort(points[:, 0], kind="stable")
    x = points[sweep, 0]
    first = np.searchsorted(x, centres[:, 0] - reach, side="left")
    count = np.searchsorted(x, centres[:, 0] + reach, side="right") - first
    # All pairs of a strip, centre by centre.
    centre = np.repeat(np.arange(len(centres)), count)
    point = sweep[np.arange(count.sum()) + np.repeat(first - np.cumsum(count) + count, count)]
    distance = np.hypot(*(points[point] - centres[centre]).T)
    found = np.flatnonzero(distance <= reach[centre])
    return point[found], centre[found], distance[found]
