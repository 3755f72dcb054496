"""Faces that stand on a straight, rigid base: how they press, from force and moment of what they bear.

A body in equilibrium is loaded on a straight piece of its boundary by a pressure p ≥ 0 of which only force N and moment
M are known. A rigid base that can neither pull nor be entered leaves the face straight where it presses,

    p ≥ 0,    g = δ + θ s − u ≥ 0,    p g = 0,    ∫ p ds = N,    ∫ p s ds = M,

u the displacement out of the body, s the place along the face, δ and θ how the base stands: as many unknowns as known
resultants, so that what the rest of the body is in equilibrium with is kept to round-off. p is linear on each of the
pieces of the face, u is weighted with the same hats (a boundary part of Signorini's problem: Kikuchi & Oden 1988, §6).
How a unit of pressure moves the face comes from the body's kept factors; faces of cracks that close meanwhile change
it, and all is done again until the pressure stays. Shear that goes with the pressure (Coulomb) goes with it here.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..kernels import shape_functions
from ..system.influence_matrix import ElementSet

if TYPE_CHECKING:
    from ..body import Body
    from ..crack_contact.face_laws import FaceMemory
    from ..solution import Solution
    from .body_loads import BodyLoad

#: Pressures are found when they change by less than this part of the largest.
SETTLED = 1e-9
#: … in so many solutions of the body; for one state of the cracks' faces it takes two.
MOST = 12
#: Changes of what presses where, in one search.
_CHANGES = 200
#: Pulls and entries below this part of what there is are round-off.
_NOTHING = 1e-10
#: An element belongs to a face that it is off by less than this part of the body's size.
_OFF = 1e-6
#: Points of Gauss on what hats and elements share.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Base:
    """A face on a base: ``rows`` (m,) of the load's segments, one after the other along the outline, and the traction
    (2,) that goes with a unit of pressure."""

    rows: np.ndarray
    per_pressure: np.ndarray


def on_bases(
    body: Body,
    load: BodyLoad,
    bases: Sequence[Base],
    warm: Solution | None = None,
    history: Solution | FaceMemory | None = None,
) -> Solution:
    """The solution of ``body`` (without supports) under ``load``, whose tractions on ``bases`` say no more than force
    and moment: they are replaced by what a rigid base makes of them. Raises what `Body.solve` does."""
    faces = _Faces(body, load.segments, bases)
    pressure = faces.pressures(load.tractions)
    right = faces.resultants @ pressure
    for _ in range(MOST):
        warm = body.solve(load, warm=warm, history=history)
        if warm.body is not body:  # a finer one meets the target error
            return on_bases(warm.body, load, bases, warm, history)
        gives = faces.compliance(warm)
        still = faces.moved(warm) - gives @ pressure
        found = faces.settled(gives, still, right)
        if found is None:
            _log.debug("no state of a face on its base was found: it presses as it did")
            return warm
        change = np.abs(found - pressure).max()
        if change <= SETTLED * np.abs(found).max():
            return warm
        pressure = found
        load = replace(load, tractions=faces.tractions(load.tractions, pressure))
    _log.debug("pressures on bases still change by %.1e", change)
    return body.solve(load, warm=warm, history=history)


class _Faces:
    """The ``bases`` of a body, all nodes of their pressures in one row.

    weights     (n, n_boundary_unknowns): ∫ hat · u ds from the nodal displacement (local) of the boundary
    resultants  (2 n_bases, n): force and moment about its start of each base
    """

    def __init__(self, body: Body, segments: np.ndarray, bases: Sequence[Base]):
        self.body, self.bases, self.segments = body, bases, segments
        self.first = np.cumsum([0, *(len(base.rows) + 1 for base in bases)])
        self._key = b"".join(segments[base.rows].tobytes() for base in bases)
        if self._key not in body.on_bases:
            body.on_bases.clear()
            body.on_bases[self._key] = self._geometry()
        self.weights, self.resultants = body.on_bases[self._key]

    def _geometry(self) -> tuple[np.ndarray, np.ndarray]:
        body, g, n = self.body, self.body.boundary, int(self.first[-1])
        weights, resultants = np.zeros((n, g.n_unknowns)), np.zeros((2 * len(self.bases), n))
        for k, base in enumerate(self.bases):
            ends = self.segments[base.rows]
            places = np.concatenate([[0.0], np.cumsum(np.hypot(*(ends[:, 1] - ends[:, 0]).T))])
            own = slice(self.first[k], self.first[k + 1])
            weights[own] = _weights(g, ends[0, 0], ends[-1, 1], places, body._extent)
            length = np.diff(places)
            for i, j, near in ((0, 1, places[:-1]), (1, 0, places[1:])):
                at = self.first[k] + i + np.arange(len(length))
                resultants[2 * k, at] += 0.5 * length
                # ∫ hat s ds: a third of the way from its own node to the other.
                far = places[j : j + len(length)]
                resultants[2 * k + 1, at] += 0.5 * length * (2 * near + far) / 3
        return weights, resultants

    def pressures(self, tractions: np.ndarray) -> np.ndarray:
        """(n,) Pa at the nodes, of ``tractions`` (m, 2, 2) that go on from piece to piece."""
        out = []
        for base in self.bases:
            own, way = tractions[base.rows], base.per_pressure
            out += [own[:, 0] @ way / (way @ way), own[-1:, 1] @ way / (way @ way)]
        return np.concatenate(out)

    def tractions(self, tractions: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """``tractions`` (m, 2, 2) with ``pressure`` (n,) on the bases."""
        out = tractions.copy()
        for k, base in enumerate(self.bases):
            p = pressure[self.first[k] : self.first[k + 1], None] * base.per_pressure
            out[base.rows, 0], out[base.rows, 1] = p[:-1], p[1:]
        return out

    def compliance(self, solution: Solution) -> np.ndarray:
        """(n, n) ∫ hat · u ds of unit pressures, m²/Pa, while the cracks' faces keep the states of ``solution``."""
        body = self.body
        key = self._key + b"states" + solution.face_states.key
        if key not in body.on_bases:
            body.on_bases.clear()
            body.on_bases[self._key], body.on_bases[key] = (self.weights, self.resultants), self._of_tractions(solution)
        n = int(self.first[-1])
        way = np.concatenate([np.tile(base.per_pressure, (len(base.rows) + 1, 1)) for base in self.bases])
        return body.on_bases[key][:, :n] * way[:, 0] + body.on_bases[key][:, n:] * way[:, 1]

    def _of_tractions(self, solution: Solution) -> np.ndarray:
        """(n, 2 n) the same of unit tractions at the nodes, along x and then along y: shear changes its share of the
        pressure from step to step."""
        body, n = self.body, int(self.first[-1])
        rows = np.concatenate([base.rows for base in self.bases])
        y, reduced = body.unit_answers(self.segments[rows])
        of_nodes = np.zeros((len(rows), 4, 2, n))
        done = 0
        for k, base in enumerate(self.bases):
            m = len(base.rows)
            here, node = done + np.arange(m), self.first[k] + np.arange(m)
            for axis in (0, 1):
                of_nodes[here, axis, axis, node] = of_nodes[here, 2 + axis, axis, node + 1] = 1.0
            done += m
        mix = of_nodes.reshape(4 * len(rows), 2 * n)
        moves = -(y @ mix)
        if body.faces.n:
            moves -= body._w @ body._jumps_of(-(reduced @ mix), solution)
        return self.weights @ moves / (2 * body.material.shear_modulus)

    def moved(self, solution: Solution) -> np.ndarray:
        """(n,) ∫ hat · u ds of all of ``solution``, m²."""
        body, g = self.body, self.body.boundary
        besides = solution._applied.regular(g.nodes.reshape(-1, 2)).reshape(g.nodes.shape)
        local = np.stack([np.einsum("enc,ec->en", besides, axis) for axis in (g.tangent, g.normal)], axis=1)
        return self.weights @ (solution._u / (2 * body.material.shear_modulus) + local.ravel())

    def settled(self, gives: np.ndarray, still: np.ndarray, right: np.ndarray) -> np.ndarray | None:
        """(n,) the pressures under which nothing pulls and nothing enters its base: Newton's method for what presses
        where, one node at a time once it does not get on; None where even that ends nowhere."""
        n, resultants = len(still), self.resultants
        size = np.abs(still).max() + np.abs(gives).max() * np.abs(right).max() / np.abs(resultants).max()
        presses, fewest, patience = np.ones(n, bool), n + 1, 5
        for _ in range(_CHANGES):
            on = np.flatnonzero(presses)
            matrix = np.zeros((len(on) + len(right),) * 2)
            matrix[: len(on), : len(on)] = gives[np.ix_(on, on)]
            matrix[: len(on), len(on) :] = -resultants[:, on].T
            matrix[len(on) :, : len(on)] = resultants[:, on]
            # Unknowns and equations of one size each.
            scale = np.concatenate(
                [np.full(len(on), np.sqrt(np.abs(gives).max())), np.abs(resultants[:, on]).max(axis=1)]
            )
            scale[len(on) :] /= scale[0] or 1.0
            known = np.concatenate([-still[on], right])
            try:
                x = np.linalg.solve(matrix / np.outer(scale, scale), known / scale) / scale
            except np.linalg.LinAlgError:
                return None
            pressure = np.zeros(n)
            pressure[on] = x[: len(on)]
            gap = resultants.T @ x[len(on) :] - gives @ pressure - still
            wrong = presses & (pressure < -_NOTHING * np.abs(pressure).max()) | ~presses & (gap < -_NOTHING * size)
            if not wrong.any():
                pressure[pressure < 0] = 0.0
                return pressure
            if wrong.sum() < fewest:
                fewest, patience = int(wrong.sum()), 5
            else:
                patience -= 1
            if patience <= 0:
                wrong = np.arange(n) == np.flatnonzero(wrong)[-1]
            presses ^= wrong
            if any(presses[a:b].sum() < 2 for a, b in zip(self.first[:-1], self.first[1:])):
                return None
        return None


def _weights(g: ElementSet, start: np.ndarray, end: np.ndarray, places: np.ndarray, extent: float) -> np.ndarray:
    """(len(places), n_unknowns): ∫ hat · u ds over the straight face from ``start`` to ``end`` with nodes at ``places``
    m from its start, u the displacement out of the body from its nodal values (local) on ``g``."""
    out = np.zeros((len(places), g.n, 2, g.per))
    way = (end - start) / places[-1]
    a, b = (g.start - start) @ way, (g.end - start) @ way
    off = np.abs((g.start - start) @ [-way[1], way[0]]) + np.abs((g.end - start) @ [-way[1], way[0]])
    on = (off <= _OFF * extent) & (np.minimum(b, places[-1]) - np.maximum(a, 0.0) > _OFF * _OFF * extent)
    for e in np.flatnonzero(on).tolist():
        low, high = max(a[e], 0.0), min(b[e], places[-1])
        inner = places[(places > low) & (places < high)]
        marks = np.concatenate([[low], inner, [high]])
        for x, y in zip(marks[:-1].tolist(), marks[1:].tolist()):
            s = 0.5 * (x + y) + 0.5 * (y - x) * _POINTS
            t = 2 * (s - a[e]) / (b[e] - a[e]) - 1
            values = shape_functions.at(g.family, g.order, int(g.kind[e]), t) * (0.5 * (y - x) * _WEIGHTS)[:, None]
            k = min(int(np.searchsorted(places, 0.5 * (x + y))), len(places) - 1)
            share = (s - places[k - 1]) / (places[k] - places[k - 1])
            # The normal of the boundary points into the rock.
            out[k - 1, e, 1] -= (1 - share) @ values
            out[k, e, 1] -= share @ values
    return out.reshape(len(places), -1)
