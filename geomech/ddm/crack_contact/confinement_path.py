"""Contact states of crack faces, found by gradually removing a confining pressure.

Under sufficient confining pressure all faces are closed and stick. With an additional pressure z d the laws of the
faces are

    gap ≥ 0,   λ_n + z d ≥ 0,   |λ_t| ≤ c + (λ_n + z d) tan φ,

and their solution is piecewise linear in z. From z = 1, where the starting states satisfy all laws, z is lowered until
one node reaches a limit. That node changes its state, and z continues in the direction in which the node obeys the law
of its new state, which may be upwards. z = 0 is the solution for the load. This is Lemke's method (1965) for the linear
complementarity problem, which Klarbring (1986) uses for friction. Newton's method takes a handful of solutions but may
cycle if the discrete compliance is not a P-matrix, as in thin wedges of rock and under strong friction. The path takes
one solution for each state change and ends there too. It fails only where no solution with less confinement exists
nearby (a "ray").
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .face_equations import FaceProblem, FaceValues
from .face_laws import FaceStates
from .state_responses import StateResponses

#: Additional confining pressure at the start, relative to the largest stress, and its variation from node to node: with
#: equal values, nodes of symmetric cracks would reach their limits simultaneously.
_SPARE, _UNEVEN = 1e-2, 0.2
#: Friction coefficient below which cohesion is added in place of pressure.
_LITTLE_FRICTION = 0.05
#: Largest confinement z (the start has 1), and most changes of state per node.
_LARGEST, _CHANGES = 2.0, 8
#: Rate of change below which a margin counts as constant (round-off).
_FLAT = 1e-13
#: Margins of a node against: loss or onset of contact, slip along the tangent, slip against it, reversal of slip, and a
#: change of cement between tension and compression.
_CONTACT, _SLIP_ALONG, _SLIP_AGAINST, _RETURN, _CEMENT = range(5)


class PathEnd(NamedTuple):
    """``states`` at the end of the path, and the ``confinement`` z there: 0 where the path has reached the load."""

    states: FaceStates
    confinement: float


def confinement_path(problem: FaceProblem, states: FaceStates, disputed: np.ndarray) -> PathEnd:
    """Contact states of ``problem`` by decreasing confinement. ``states``: first guess, and ``disputed`` (n_nodes,)
    bool, the nodes to be confined at first; more are added until all others satisfy their laws."""
    path = _Path(problem)
    start = path.begin(states, disputed)
    end = path.follow(start)
    if end.confinement > 0.0 and not path.everywhere:
        # Confining all faces gives a different path.
        everything = path.begin(states, np.ones(len(disputed), bool))
        other = path.follow(everything)
        return other if other.confinement < end.confinement else end
    return end


class _Path:
    def __init__(self, problem: FaceProblem):
        self._problem = problem
        self._cemented = problem.laws.cemented(problem.memory.broken)
        self._cohesion = problem.laws.cohesive_strength(problem.memory.broken) / problem.stress
        #: Whether all faces that can close were confined.
        self.everywhere = False

    def begin(self, states: FaceStates, disputed: np.ndarray) -> FaceStates:
        """Confine the ``disputed`` nodes, and neighbours that do not obey their laws."""
        problem, laws = self._problem, self._problem.laws
        # Faces with an aperture can close but start open.
        can = (laws.closes & (laws.aperture == 0.0)) | self._cemented | (laws.closes & states.closed)
        disputed = disputed & can
        while True:
            start = FaceStates(
                states.closed | disputed,
                np.where(disputed, 0, states.way).astype(np.int8),
                states.pulled & ~disputed,
            )
            values = problem.solve(start)
            start = FaceStates(
                start.closed, start.way, np.where(disputed & self._cemented, values.pressure < 0, start.pulled)
            )
            wrong = (self._margins(start, values, self._cohesion).min(axis=0) < 0.0) & ~disputed
            more = wrong & (laws.closes | self._cemented)
            if not more.any():
                break
            disputed = disputed | more
        self.everywhere = bool(disputed[can].all())
        self._confine(disputed, values)
        return start

    def _confine(self, disputed: np.ndarray, values: FaceValues) -> None:
        """Pressure and cohesion that close the ``disputed`` nodes and let them stick."""
        laws, stress = self._problem.laws, self._problem.stress
        n = len(disputed)
        spare = _SPARE * (1.0 + _UNEVEN * (np.arange(n) * 0.6180339887498949 % 1.0))
        by_pressure = disputed & ~self._cemented
        grips = by_pressure & laws.rough & (laws.friction >= _LITTLE_FRICTION)
        over = np.abs(values.shear) - self._cohesion
        steep = np.where(grips, laws.friction, 1.0)
        needed = np.where(grips, np.maximum(over / steep, 0.0), 0.0) - values.pressure
        pressure = np.where(by_pressure, np.maximum(needed, 0.0) + spare, 0.0)
        friction = np.where(self._cemented, laws.friction * np.maximum(values.pressure, 0.0), 0.0)
        strong = disputed & laws.rough & ~grips
        self._more_cohesion = np.where(strong, np.maximum(over - friction, 0.0) + spare, 0.0) * stress
        self._right = self._problem.right.copy()
        self._right[laws.across] += pressure * stress

    def _margins(self, states: FaceStates, values: FaceValues, cohesion: np.ndarray) -> np.ndarray:
        """(5, n_nodes) margins by which nodes satisfy their laws; infinite where a law does not apply."""
        laws = self._problem.laws
        rough = states.closed & laws.rough
        limit = cohesion + np.where(states.pulled, 0.0, laws.friction * values.pressure)
        stuck = rough & (states.way == 0)
        out = np.full((5, len(limit)), np.inf)
        open_ = np.where(laws.closes, values.gap, np.inf)
        out[_CONTACT] = np.where(states.closed, np.where(self._cemented, np.inf, values.pressure), open_)
        out[_SLIP_ALONG] = np.where(stuck, limit - values.shear, np.inf)
        out[_SLIP_AGAINST] = np.where(stuck, limit + values.shear, np.inf)
        out[_RETURN] = np.where(states.way != 0, states.way * values.slip, np.inf)
        pressed = np.where(states.pulled, -values.pressure, values.pressure)
        out[_CEMENT] = np.where(rough & self._cemented, pressed, np.inf)
        return out

    def follow(self, states: FaceStates) -> PathEnd:
        """Lower the confinement from 1 to 0."""
        problem, n = self._problem, len(states.closed)
        none = np.zeros_like(self._more_cohesion)
        # The problem, and the confined one.
        both = StateResponses(
            problem, np.stack([problem.right, self._right], axis=1), np.stack([none, self._more_cohesion], axis=1)
        )
        z, direction = 1.0, -1.0
        entered: tuple[int, int] | None = None
        least = PathEnd(states, z)
        for _ in range(_CHANGES * n):
            w, reaction = both.solve(states)
            bare, confined = (problem.values(states, w[:, k], reaction[:, k]) for k in (0, 1))
            at_zero = self._margins(states, bare, self._cohesion)
            at_one = self._margins(states, confined, self._cohesion + self._more_cohesion / problem.stress)
            concerned = np.isfinite(at_zero)
            rate = np.where(concerned, at_one, 0.0) - np.where(concerned, at_zero, 0.0)
            if entered is not None:
                if abs(rate[entered]) < _FLAT:
                    return least
                direction = float(np.sign(rate[entered]))
            left = np.maximum(np.where(concerned, at_zero, np.inf) + z * rate, 0.0)
            falls = direction * rate < -_FLAT
            reach = np.where(falls, left / np.where(falls, -direction * rate, 1.0), np.inf)
            if entered is not None:
                reach[entered] = np.inf
            law, node = divmod(int(reach.argmin()), n)
            step = float(reach[law, node])
            if direction < 0.0 and step >= z:
                return PathEnd(states, 0.0)
            if not z + direction * step < _LARGEST:
                return least
            z += direction * step
            slip = (1.0 - z) * bare.slip[node] + z * confined.slip[node]
            states, entered = self._changed(states, law, node, slip)
            if z < least.confinement:
                least = PathEnd(states, z)
        return least

    def _changed(self, states: FaceStates, law: int, node: int, slip: float) -> tuple[FaceStates, tuple[int, int]]:
        """The states after ``node`` has reached the limit of a ``law``, and the margin that must grow from there."""
        closed, way, pulled = states.closed.copy(), states.way.copy(), states.pulled.copy()
        if law == _CONTACT:
            closed[node] = not closed[node]
            # Faces that close while slipping continue to slip.
            way[node] = np.sign(slip) if closed[node] and self._problem.laws.rough[node] else 0
            grows = _CONTACT
        elif law == _RETURN:
            grows = _SLIP_ALONG if way[node] > 0 else _SLIP_AGAINST
            way[node] = 0
        elif law == _CEMENT:
            pulled[node] = not pulled[node]
            grows = _CEMENT
        else:
            way[node] = 1 if law == _SLIP_ALONG else -1
            grows = _RETURN
        return FaceStates(closed, way, pulled), (grows, node)
