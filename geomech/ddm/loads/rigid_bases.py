"""Contact pressure of faces on a straight, rigid base, from the force and moment that they transmit.

A body in equilibrium is loaded on a straight piece of its boundary by a pressure p ≥ 0 of which only the force N and
the moment M are known. The base is rigid, cannot pull and cannot be penetrated, so that the face is straight where it
presses,

    p ≥ 0,    g = δ + θ s − u + p / k ≥ 0,    p g = 0,    ∫ p ds = N,    ∫ p s ds = M,

with u the displacement out of the body, s the coordinate along the face, δ and θ the base's translation and rotation, k the
stiffness of the joint (infinite without one: a very soft one leaves the pressure linear):
as many unknowns as given resultants, so that the body's equilibrium is kept to round-off. p is linear on each piece of
the face, and u is weighted with the same hat functions (a boundary part of Signorini's problem: Kikuchi & Oden 1988,
§6). The compliance of the face comes from the body's factors. If crack faces close meanwhile, it changes, and the
solution is repeated until the pressure does not change. Shear proportional to the pressure (Coulomb) is included.

A solution exists for every resultant that pressures of these pieces can have, and it is unique if the compliance is
positive. Where pieces are shorter than the elements resolve, its computed eigenvalues are zero, with errors of either
sign; a thin elastic layer (`_LAYER`) is added in these modes only. Without it round-off decided which contact area was
found, and whether any.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..body import Body
from ..kernels import shape_functions
from ..system.influence_matrix import ElementSet
from .contact_pressure import Resultants, positive, pressures_on_bases

if TYPE_CHECKING:
    from ..crack_contact.face_laws import FaceMemory
    from ..solution import Solution
    from .body_loads import BodyLoad

#: Pressures have converged when they change by less than this part of the largest.
SETTLED = 1e-9
#: Largest number of solutions of the body; for given states of the crack faces two suffice.
MOST = 12
#: Least compliance in pressures that vary from piece to piece: that of a layer as thick as this fraction of a piece.
_LAYER = 0.05
#: A larger change of pressures that have not converged is a warning: K has errors of this size anyway.
_WARNED = 1e-3
#: Determinant, relative to the entries, below which two shapes of pressure do not give any force and moment.
_SINGULAR = 1e-9
#: An element belongs to a face if it is off its line by less than this part of the body's size.
_OFF = 1e-6
#: Gauss points on the common interval of a hat function and an element.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Base:
    """A face on a base.

    rows          (m,) numbers of the load's segments, in order along the outline
    per_pressure  (2,) traction per unit of pressure
    stiffness     normal stiffness of the joint between face and base, Pa/m
    """

    rows: np.ndarray
    per_pressure: np.ndarray
    stiffness: float = np.inf


def on_bases(
    body: Body,
    load: BodyLoad,
    bases: Sequence[Base],
    warm: Solution | None = None,
    history: Solution | FaceMemory | None = None,
) -> Solution:
    """Solution of ``body`` (without supports) under ``load`` with rigid-base pressures on ``bases``.

    The load's tractions on ``bases`` are used only for their force and moment. Raises what `Body.solve` raises.
    """
    assert load.segments is not None and load.tractions is not None  # bases are some of them
    faces = _Faces(body, load.segments, bases)
    pressure = faces.pressures(load.tractions)
    right = faces.resultants @ pressure
    if warm is not None:
        pressure = faces.earlier(warm.load, pressure, right)
    given = faces.tractions(load.tractions, pressure)
    load = replace(load, tractions=given)
    for _ in range(MOST):
        warm = body.solve(load, warm=warm, history=history)
        if warm.body is not body:  # a finer one meets the target error
            assert isinstance(warm.body, Body)
            return on_bases(warm.body, load, bases, warm, history)
        gives = faces.compliance(warm)
        still = faces.moved(warm) - gives @ pressure
        found = faces.settled(gives, still, right)
        if found is None:
            if "no contact area" not in body.warned_of_bases:
                body.warned_of_bases.add("no contact area")
                _log.warning(
                    "the contact area of a face on its rigid base was not found: its pressure stays linear, and K may be off by "
                    "several per cent or, in a wide block, more: set more elements on the sides (ddm.elements_per_side)"
                )
            return warm
        change = np.abs(found - pressure).max()
        if change <= SETTLED * np.abs(found).max():
            return warm
        pressure = found
        given = faces.tractions(given, pressure)
        load = replace(load, tractions=given)
    largest = np.abs(pressure).max()
    if change > _WARNED * largest and "no agreement" not in body.warned_of_bases:
        body.warned_of_bases.add("no agreement")
        _log.warning(
            "the pressure of a face on its rigid base and the crack faces that close under it did not agree after %d "
            "solutions: the pressure still changes by %.1g of itself, and K by as much",
            MOST,
            change / largest,
        )
    return body.solve(load, warm=warm, history=history)


def resultants_of_hats(places: np.ndarray) -> np.ndarray:
    """(2, n) force and moment about 0 of unit pressures at the nodes at ``places`` (n,), m, linear between these."""
    length, near, far = np.diff(places), places[:-1], places[1:]
    out = np.zeros((2, len(places)))
    # ∫ hat s ds: the centroid is a third of the way from its own node to the other.
    for own, moment in ((slice(None, -1), 2 * near + far), (slice(1, None), near + 2 * far)):
        out[0, own] += 0.5 * length
        out[1, own] += 0.5 * length * moment / 3
    return out


def times_linear(shape: np.ndarray, along: np.ndarray, resultants: np.ndarray, wanted: np.ndarray) -> np.ndarray | None:
    """(n,) nodal pressures ``shape`` (n,) times a linear function of the place ``along`` the face (n,), 0 to 1, so that their
    ``resultants`` (2, n) are the force and moment ``wanted`` (2,); None where such products do not give any."""
    shapes = np.stack([shape, shape * along], axis=1)
    matrix = resultants @ shapes
    if not abs(np.linalg.det(matrix)) > _SINGULAR * np.abs(matrix).max() ** 2:
        return None
    return shapes @ np.linalg.solve(matrix, wanted)


class _Faces:
    """The ``bases`` of a body, the nodes of all their pressures in one array.

    weights     (n, n_boundary_unknowns): ∫ hat · u ds from the nodal displacement (local) of the boundary
    resultants  (2 n_bases, n): force, and moment about its start, of each base
    of_load, of_jumps  (n, n_boundary_unknowns), (n, n_crack_unknowns): ∫ hat · 2μ u ds from tractions on the boundary and from the
                jumps at the cracks. Large bodies give up the factors that either takes
    closure     (n, n): ∫ hat · closure ds of the joint under unit pressures, m²/Pa
    """

    def __init__(self, body: Body, segments: np.ndarray, bases: Sequence[Base]):
        self.body, self.bases, self.segments = body, bases, segments
        self.first = np.cumsum([0, *(len(base.rows) + 1 for base in bases)])
        self._key = b"".join(segments[base.rows].tobytes() for base in bases)
        if self._key not in body.on_bases:
            body.on_bases.clear()
            body.on_bases[self._key] = self._geometry()
        self.weights, self.resultants, self.of_load, self.of_jumps = body.on_bases[self._key]
        self.closure = np.zeros((int(self.first[-1]),) * 2)
        for k, base in enumerate(bases):
            ends = segments[base.rows]
            length = np.hypot(*(ends[:, 1] - ends[:, 0]).T) / base.stiffness
            near = self.first[k] + np.arange(len(length))
            np.add.at(self.closure, (near, near), length / 3)
            np.add.at(self.closure, (near + 1, near + 1), length / 3)
            self.closure[near, near + 1] = self.closure[near + 1, near] = length / 6

    def _geometry(self) -> tuple[np.ndarray, ...]:
        body, g, n = self.body, self.body.boundary, int(self.first[-1])
        weights, resultants = np.zeros((n, g.n_unknowns)), np.zeros((2 * len(self.bases), n))
        for k, base in enumerate(self.bases):
            ends = self.segments[base.rows]
            places = np.concatenate([[0.0], np.cumsum(np.hypot(*(ends[:, 1] - ends[:, 0]).T))])
            own = slice(self.first[k], self.first[k + 1])
            weights[own] = _weights(g, ends[0, 0], ends[-1, 1], places, body._extent)
            resultants[2 * k : 2 * k + 2, own] = resultants_of_hats(places)
        return weights, resultants, *body.boundary_measures(weights)

    def pressures(self, tractions: np.ndarray) -> np.ndarray:
        """(n,) pressure, Pa, at the nodes from ``tractions`` (m, 2, 2) that are continuous from piece to piece."""
        out = []
        for base in self.bases:
            own, way = tractions[base.rows], base.per_pressure
            out += [own[:, 0] @ way / (way @ way), own[-1:, 1] @ way / (way @ way)]
        return np.concatenate(out)

    def earlier(self, load: BodyLoad, pressure: np.ndarray, right: np.ndarray) -> np.ndarray:
        """(n,) first guess: pressures of an earlier ``load`` times linear functions, with the resultants ``right``; ``pressure`` (n,) on
        bases whose pieces it does not have. Contact states of crack faces then change less in the second solution."""
        if load.segments is None or load.tractions is None:
            return pressure
        out, row_of = pressure.copy(), {ends.tobytes(): k for k, ends in enumerate(load.segments)}
        for k, base in enumerate(self.bases):
            ends = self.segments[base.rows]
            first = row_of.get(ends[0].tobytes(), len(row_of))
            before = slice(first, first + len(ends))
            if not np.array_equal(load.segments[before], ends):
                continue
            way = ends[-1, 1] - ends[0, 0]
            inward = np.array([-way[1], way[0]]) / np.hypot(*way)
            own, at = slice(self.first[k], self.first[k + 1]), slice(2 * k, 2 * k + 2)
            shape = np.concatenate([load.tractions[before, 0], load.tractions[before][-1:, 1]]) @ inward
            found = times_linear(shape, np.linspace(0.0, 1.0, len(shape)), self.resultants[at, own], right[at])
            if found is not None:
                out[own] = found
        return out

    def tractions(self, tractions: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """``tractions`` (m, 2, 2) with ``pressure`` (n,) on the bases."""
        out = tractions.copy()
        for k, base in enumerate(self.bases):
            p = pressure[self.first[k] : self.first[k + 1], None] * base.per_pressure
            out[base.rows, 0], out[base.rows, 1] = p[:-1], p[1:]
        return out

    def compliance(self, solution: Solution) -> np.ndarray:
        """(n, n) ∫ hat · u ds of unit pressures, m²/Pa, with the states of the crack faces in ``solution``."""
        body = self.body
        key = self._key + b"states" + solution.face_states.key
        if key not in body.on_bases:
            loads = body.on_bases.get(self._key + b"loads") or self._unit_loads()
            body.on_bases.clear()
            own = self.weights, self.resultants, self.of_load, self.of_jumps
            body.on_bases[self._key], body.on_bases[self._key + b"loads"] = own, loads
            body.on_bases[key] = (self._of_tractions(loads, solution),)
        n = int(self.first[-1])
        way = np.concatenate([np.tile(base.per_pressure, (len(base.rows) + 1, 1)) for base in self.bases])
        (gives,) = body.on_bases[key]
        return gives[:, :n] * way[:, 0] + gives[:, n:] * way[:, 1]

    def _unit_loads(self) -> tuple[np.ndarray, np.ndarray]:
        """Tractions on boundary and closed crack faces (…, 2 n) of unit tractions at the nodes, along x and then along y."""
        n = int(self.first[-1])
        rows = np.concatenate([base.rows for base in self.bases])
        of_nodes = np.zeros((len(rows), 4, 2, n))
        done = 0
        for k, base in enumerate(self.bases):
            m = len(base.rows)
            here, node = done + np.arange(m), self.first[k] + np.arange(m)
            for axis in (0, 1):
                of_nodes[here, axis, axis, node] = of_nodes[here, 2 + axis, axis, node + 1] = 1.0
            done += m
        return self.body.unit_responses(self.segments[rows], of_nodes.reshape(4 * len(rows), 2 * n))

    def _of_tractions(self, loads: tuple[np.ndarray, ...], solution: Solution) -> np.ndarray:
        """(n, 2 n) the compliance for the unit tractions of ``loads``: the ratio of shear to pressure changes from step to step."""
        body, (applied, reduced) = self.body, loads
        moves = self.of_load @ applied + self.of_jumps @ body._jumps_of(-reduced, solution)
        return moves / (2 * body.material.shear_modulus)

    def moved(self, solution: Solution) -> np.ndarray:
        """(n,) ∫ hat · u ds of ``solution``, m²."""
        body, g = self.body, self.body.boundary
        besides = solution._applied.regular(g.nodes.reshape(-1, 2)).reshape(g.nodes.shape)
        local = np.stack([np.einsum("enc,ec->en", besides, axis) for axis in (g.tangent, g.normal)], axis=1)
        moves = self.of_load @ solution._loads.on_boundary + self.of_jumps @ solution.jumps
        return moves / (2 * body.material.shear_modulus) + self.weights @ local.ravel()

    def settled(self, gives: np.ndarray, still: np.ndarray, right: np.ndarray) -> np.ndarray | None:
        """(n,) pressures with the resultants ``right`` without tension or penetration, or None."""
        least = _LAYER / self.body.material.plane_modulus
        stiff = positive(self.closure - gives, self.resultants, least)
        return pressures_on_bases(stiff, still, Resultants(self.resultants, right, self.first))


def _weights(g: ElementSet, start: np.ndarray, end: np.ndarray, places: np.ndarray, extent: float) -> np.ndarray:
    """(len(places), n_unknowns): ∫ hat · u ds over the straight face from ``start`` to ``end``.

    The nodes are at ``places`` (m) from its start; u is the displacement out of the body, from its nodal values (local)
    on ``g``.
    """
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
