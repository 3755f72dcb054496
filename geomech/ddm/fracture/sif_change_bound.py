"""Upper bound of the change of stress intensity factors between two loads, also where crack faces open and close.

Smooth faces with the traction r of a load on closed faces have the jumps w that minimise ½ a(w, w) + ∫ r · w without
overlap, a(w, w) the elastic energy of the jumps. They are the projection of the jumps without contact on a convex set,
in the norm of a, and a projection moves two points no further apart (Kinderlehrer & Stampacchia 1980, ch. I). With A
the matrix of a, Q the quadrature and K = lᵀ w at a tip, between two loads

    |ΔK| ≤ √(lᵀ A⁻¹ l) ‖Δr‖,    ‖Δr‖² = (Q Δr)ᵀ A⁻¹ (Q Δr),

whatever faces change their states. A is the symmetric part of −Q S; as S is collocated, A has slightly negative
directions, in which jumps alternate from node to node. Its diagonal is raised until there are none.

Faces with friction move on from the slip that the last load has left. With a given limit of shear stress the energy
a(w, w)/2 + ∫ r · w and the friction ∫ τ |dw_t| are convex: testing the law of a small step with the step itself gives ‖dw‖ ≤
‖dr‖ (Mielke & Theil 2004, §3). So ‖Δr‖ is the length of the path of the loads from one solution to the other; that the limit
follows the pressure on the faces is within the safety factor for the friction of rock.

‖Δr‖ needs neither S nor the factors of the boundary for a load: it is estimated from products with random directions,
linear in the load (Johnson & Lindenstrauss 1984): with `DIRECTIONS` of them the estimate is below 1/`ESTIMATED` of the
norm with a probability of 1e-7.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..loads.uniform_stress_response import is_simple
from ..loads.unit_load_cache import on_elements

if TYPE_CHECKING:
    from ..interfaces import CrackedBody, SolvedBody
    from ..loads.body_loads import BodyLoad

#: Number of random directions, and factor by which the norm may exceed its estimate.
DIRECTIONS, ESTIMATED = 128, 1.5
#: Safety factor on the norm, for what collocation and the raised diagonal leave: of 432 pairs of loads on the 48 bodies
#: of a section of a trace map one changed K by 2.7 times the bound without it, one by 1.4, all others by less than the
#: bound, most by a tenth of it (`tests/ddm/fracture/test_sif_change_bound.py` compares with solutions).
MARGIN = 4.0
#: First part of the diagonal by which A is raised, and the largest.
RAISED, MOST_RAISED = 1e-3, 0.1
#: Boundary elements whose loads are computed at a time.
_AT_ONCE = 64
#: Distance from an element, relative to the extent, up to which the ends of a load segment lie on its line.
_ON_LINE = 1e-6


def changes_are_bounded(body: CrackedBody) -> bool:
    """Whether jumps of ``body`` change by no more than its loads: no holes, no supports, no cement that breaks."""
    cemented = body.rough and bool((body.laws.strength > 0).any())
    return is_simple(body) and not cemented and bool(len(body.cracks.tips))


class ChangeBound:
    """Bounds for a ``body`` whose `changes_are_bounded`, from its last solution; at first from the body at rest.

    Raises LinAlgError where A is too far from positive.
    """

    def __init__(self, body: CrackedBody) -> None:
        c = body.faces
        self._body = body
        share = np.broadcast_to(c.quadrature[:, None], (c.n, 2, c.per)).ravel()
        factor, scale = _raised(body.crack_system.matrix.dense, share)
        self._tips = _tip_weights(body)
        of_norm = _solved(factor, scale[:, None, None] * self._tips)
        # (n_tips,) largest √(K_I² + K_II²) of jumps with the norm one.
        gram = np.einsum("uti,utj->tij", of_norm, of_norm)
        self._per_norm = MARGIN * ESTIMATED * np.sqrt(np.linalg.eigvalsh(gram)[:, -1])
        directions = np.random.default_rng(0).normal(size=(c.n_unknowns, DIRECTIONS)) / np.sqrt(DIRECTIONS)
        weights = (share * scale)[:, None] * _solved(factor, directions, transposed=True)
        self._take_measures(weights)
        self._before = np.zeros(DIRECTIONS)
        #: (n_tips,) √(K_I² + K_II²) of the last solution, Pa √m.
        self.last_k = np.zeros(len(self._per_norm))
        #: Length of the path of the loads since the solution, for faces with friction.
        self._path = 0.0

    def _take_measures(self, on_faces: np.ndarray) -> None:
        """Products with the directions, ``on_faces`` (n_crack_unknowns, k) in terms of tractions on closed faces, as
        linear functions of tractions on boundary elements, of the six body forces and of uniform stress."""
        body = self._body
        loads, g, c = body._loads, body.boundary, body.faces
        on_boundary = body.reduced_transposed(on_faces)
        # Distance from an element's line, and along it from its start, are products with a point less constants.
        self._along = ((g.end - g.start) / g.length[:, None]).T
        self._across = np.stack([self._along[1], -self._along[0]])
        self._origin = (g.start.T * self._along).sum(axis=0), (g.start.T * self._across).sum(axis=0)
        self._length = g.length
        out = np.empty((g.n, 4, on_faces.shape[1]))
        for first in range(0, g.n, _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            straight = np.stack([g.start[part], g.end[part]], axis=1)
            of = (loads._linear_forces(targets, straight) for targets in (g, c))
            for k, (moved, direct) in enumerate(zip(*of)):
                out[first + k] = direct.T @ on_faces - moved.T @ on_boundary
        # Linear along the element, with the same moments as the function itself.
        mean = out.reshape(g.n, 2, 2, -1) / (0.5 * g.length[:, None, None, None])
        self._at_ends = np.stack([2 * mean[:, 0] - mean[:, 1], 2 * mean[:, 1] - mean[:, 0]], axis=1)
        force = loads._edge_load("force").applied
        n_g = g.n_unknowns
        self._of_force = force[n_g:].T @ on_faces - force[:n_g].T @ on_boundary
        self._of_uniform = np.column_stack([on_elements(c, unit) for unit in np.eye(3)]).T @ on_faces

    def measured(self, load: BodyLoad) -> np.ndarray | None:
        """(`DIRECTIONS`,) products of ``load``: tractions on segments of the outline, body force with gradient, uniform
        stress. None if a segment is not on the outline."""
        out = np.zeros(DIRECTIONS)
        if load.segments is not None and len(load.segments):
            found = self._on_ends(np.asarray(load.segments), np.asarray(load.tractions))
            if found is None:
                return None
            elements, forces = found
            out += np.tensordot(forces, self._at_ends[elements], axes=3)
        force, gradient = np.asarray(load.body_force), np.asarray(load.body_force_gradient)
        force = force + gradient @ (self._body.centroid - load.about)
        out += np.concatenate([force, gradient.ravel()]) @ self._of_force
        if load.remote_stress is not None:
            out += np.asarray(load.remote_stress) @ self._of_uniform
        return out

    def _on_ends(self, segments: np.ndarray, tractions: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Boundary elements (k,) under the ``segments`` (m, 2, 2) with linear ``tractions`` (m, 2, 2), and forces at
        their ends (k, 2, 2), N/m, with which functions linear along an element are integrated exactly."""
        near, points = _ON_LINE * self._body._extent, segments.reshape(-1, 2)
        off = np.abs(points @ self._across - self._origin[1]).reshape(len(segments), 2, -1).max(axis=1)
        at = (points @ self._along - self._origin[0]).reshape(len(segments), 2, -1)
        low, high = np.maximum(at.min(axis=1), 0.0), np.minimum(at.max(axis=1), self._length)
        segment, element = np.nonzero((off <= near) & (high > low))
        low, high = low[segment, element], high[segment, element]
        whole = np.hypot(*(segments[:, 1] - segments[:, 0]).T)
        if np.abs(np.bincount(segment, high - low, len(segments)) - whole).max() > near:
            return None
        begin = at[segment, 0, element]
        span = at[segment, 1, element] - begin
        forces = np.zeros((len(segment), 2, 2))
        for point, weight in ((0.5 - np.sqrt(1 / 12), 0.5), (0.5 + np.sqrt(1 / 12), 0.5)):  # Gauss
            here = low + point * (high - low)
            f, s = ((here - begin) / span)[:, None], here / self._length[element]
            traction = (1 - f) * tractions[segment, 0] + f * tractions[segment, 1]
            shapes = np.stack([1 - s, s], axis=1) * (weight * (high - low))[:, None]
            forces += shapes[:, :, None] * traction[:, None]
        return element, forces

    def refer(self, load: BodyLoad, solution: SolvedBody) -> None:
        """Take the ``solution`` under ``load`` as the one from which changes are bounded."""
        measured = self.measured(load)
        # The path of loads that cannot be measured has no length.
        self._path = 0.0 if measured is not None else np.inf
        if measured is not None:
            self._before = measured
            self.last_k = np.hypot(*np.einsum("uti,u->it", self._tips, solution.jumps))

    def at_most(self, load: BodyLoad) -> np.ndarray:
        """(n_tips,) upper bound of √(K_I² + K_II²) under ``load``, Pa √m; infinite where there is none."""
        return self.last_k + self.change(load)

    def change(self, load: BodyLoad) -> np.ndarray:
        """(n_tips,) the part of `at_most` that is not K of the last solution. With friction ``load`` is the next
        one on the path."""
        measured = self.measured(load)
        if measured is None:
            return np.full(len(self.last_k), np.inf)
        changed = float(np.linalg.norm(measured - self._before))
        if self._body.rough:
            self._before, self._path = measured, self._path + changed
            changed = self._path
        return self._per_norm * changed


def _tip_weights(body: CrackedBody) -> np.ndarray:
    """(n_crack_unknowns, n_tips, 2) weights of the jumps in K_I and K_II of each tip."""
    _, element, _, lead, _ = body.tip_elements
    c, n = body.faces, len(element)
    out = np.zeros((c.n, 2, c.per, n, 2))
    factor = np.sqrt(2 * np.pi) / (8 * (1 - body.nu))
    for k in range(n):
        out[element[k], 1, :, k, 0] = out[element[k], 0, :, k, 1] = factor * lead[k]
    return out.reshape(c.n_unknowns, n, 2)


def _raised(stiffness: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cholesky factor of A, its diagonal scaled to one and raised, in the lower triangle (n, n), and the scales (n,)."""
    from scipy.linalg import lapack

    energy = np.multiply(stiffness, -0.5 * share[:, None], order="F")
    energy += energy.T.copy()
    diagonal = energy.diagonal().copy()
    if not (diagonal > 0).all():
        raise np.linalg.LinAlgError("jumps at a node have no energy")
    scale = 1.0 / np.sqrt(diagonal)
    energy *= scale
    energy *= scale[:, None]
    raised = 0.0
    while raised <= MOST_RAISED:
        np.fill_diagonal(energy, 1.0 + raised)
        # The factor replaces the lower triangle and the diagonal alone: the upper one still has the matrix.
        energy, info = lapack.dpotrf(energy, lower=True, clean=False, overwrite_a=True)
        if info == 0:
            return energy, scale
        for column in range(len(energy)):
            energy[column:, column] = energy[column, column:]
        raised = max(RAISED, 2 * raised)
    raise np.linalg.LinAlgError("the energy of jumps is not positive")


def _solved(factor: np.ndarray, right: np.ndarray, transposed: bool = False) -> np.ndarray:
    """L⁻¹ ``right`` (n, …), or L⁻ᵀ ``right``."""
    from scipy.linalg import solve_triangular

    flat = right.reshape(len(right), -1)
    return solve_triangular(factor, flat, trans=int(transposed), lower=True).reshape(right.shape)
