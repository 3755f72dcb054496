"""Stress intensity factors as linear functionals of the loads, while crack faces stay as they are.

K is a weighted sum of jumps, K = lᵀw, and the jumps depend linearly on the traction g of the loads on the boundary, r
on the cracks, and the fluid pressure p. With M the equations of the faces (`frictional_contact`), M w = N (p n − r +
A_CΓ A_ΓΓ⁻¹ g) + …,

    K = yᵀ (p n − r) + hᵀ g + K₀,     Mᵀ z = l,  y = Nᵀ z,  A_ΓΓᵀ h = A_CΓᵀ y.

One transposed solution per factor, with existing equations, replaces a solution for every load. K₀ is due to slip,
springs and cohesion that remain without load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..crack_contact.face_laws import FaceStates

if TYPE_CHECKING:
    from ..interfaces import CrackedBody, SolvedBody
    from ..loads.body_loads import BodyLoad
    from ..loads.unit_load_cache import UnitLoad

#: Number of unit loads whose values are kept.
_KEPT = 400


class TipFunctionals:
    """K_I and K_II of all tips of ``body`` with the face states of ``solution`` (all faces open if None).

    on_boundary  (n_boundary_unknowns, 2 n_tips): h, columns K_I of all tips, then K_II
    on_faces     (n_crack_unknowns, 2 n_tips): y
    constant     (2 n_tips,): K₀, Pa √m

    Where the crack unknowns are solved iteratively, so are these, by the transposed equations.
    """

    def __init__(self, body: CrackedBody, solution: SolvedBody | None = None):
        self.body = body
        c, equations = body.faces, body.face_equations
        n_nodes = c.n * c.per
        states = FaceStates.open(n_nodes) if solution is None else solution.face_states
        began = None if solution is None else solution.began
        memory = body.initial_memory if began is None else began
        _, element, last, lead, touching = body.tip_elements
        n = len(element)
        factor = np.sqrt(2 * np.pi) / (8 * (1 - body.nu))
        by_node = np.zeros((c.n, 2, c.per, 2, n))
        for k in range(n):
            by_node[element[k], 1, :, 0, k] = by_node[element[k], 0, :, 1, k] = factor * lead[k]
        weights = by_node.reshape(c.n_unknowns, 2 * n)
        self.on_faces = equations.adjoint(weights, states)
        self.on_boundary = body.reduced_transposed(self.on_faces)
        at_rest, _ = equations.solve(np.zeros(c.n_unknowns), states, memory)
        self.constant = weights.T @ at_rest
        rigid = np.isinf(body.laws.normal).reshape(c.n, c.per)[element, last]
        self._shut = touching & rigid & states.closed.reshape(c.n, c.per)[element, last]
        self._touching = touching
        self._known: dict[int, tuple[UnitLoad, np.ndarray]] = {}

    def __call__(self, load: BodyLoad) -> np.ndarray:
        """(n_tips, 2) K_I and K_II under ``load``, Pa √m: those of a solution, as long as the face states do not
        change. Raises ValueError for loads that the body does not support (equilibrium is not checked)."""
        body = self.body
        _, units, rest, _ = body.decompose(load)
        k = self.constant + self.on_faces.T @ self._fluid(load)
        if rest.any():
            n_g = len(self.on_boundary)
            k = k + self.on_boundary.T @ rest[:n_g] - self.on_faces.T @ rest[n_g:]
        for unit, size in units:
            k = k + self._of(unit) @ size
        k_i, k_ii = np.split(k, 2)
        # As in `Solution.tips`: closed faces cannot close a tip further.
        return np.stack([np.where(self._shut | (self._touching & (k_i < 0)), 0.0, k_i), k_ii], axis=1)

    def bound(self, load: BodyLoad, growth: float = 1.0) -> np.ndarray:
        """(n_tips, 2) upper bounds of |K_I| and |K_II|, Pa √m, under any load at the places of ``load`` whose tractions
        and forces nowhere exceed ``growth`` times its largest, with any sign and distribution."""
        body = self.body
        _, units, rest, _ = body.decompose(load)
        fluid = self._fluid(load)
        k = np.abs(self.constant) + growth * (np.abs(self.on_faces.T) @ np.abs(fluid))
        if rest.any():
            n_g = len(self.on_boundary)
            k = k + growth * (
                np.abs(self.on_boundary.T) @ np.abs(rest[:n_g]) + np.abs(self.on_faces.T) @ np.abs(rest[n_g:])
            )
        largest = max((np.abs(size).max() for unit, size in units if unit.segment is not None), default=0.0)
        for unit, size in units:
            most = np.abs(size) if unit.segment is None else np.full(len(size), largest)
            k = k + growth * (np.abs(self._of(unit)) @ most)
        return np.stack(np.split(k, 2), axis=1)

    def _of(self, unit: UnitLoad) -> np.ndarray:
        """(2 n_tips, m) K per unit size of each of the unit's loads."""
        known = self._known.get(id(unit))
        if known is None or known[0] is not unit:
            if len(self._known) >= _KEPT:
                self._known.clear()
            n_g = len(self.on_boundary)
            value = self.on_boundary.T @ unit.applied[:n_g] - self.on_faces.T @ unit.applied[n_g:]
            # The unit load is kept as well, or its id might be reused.
            known = self._known[id(unit)] = unit, value
        return known[1]

    def _fluid(self, load: BodyLoad) -> np.ndarray:
        body, c = self.body, self.body.faces
        out = np.zeros((c.n, 2, c.per))
        out[:, 1] = -load.face_pressure(c.nodes, c.source, body.cracks.n_segments)
        return out.ravel()
