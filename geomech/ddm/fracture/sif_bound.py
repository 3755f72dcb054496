"""Upper bound of stress intensity factors under loads of known size and unknown distribution.

While faces stay open, K is linear in the load, K = ∮ h · t ds + …, with h (x) the weight function (Bueckner 1970): here
K of a force at x together with the body force, linear in the distance from the centroid, that keeps the body in
equilibrium. Tractions t of given ∫ |t| ds therefore cause at most the largest |h| of the outline, wherever they act.
The uniform stress and the symmetric part of the gradient of the body force are taken exactly.

h is smooth along a boundary element. It is represented by the linear function with the same two moments, from the two
loads linear on the element; its larger end value counts.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ...model import Material
from ..loads.uniform_stress_response import scales
from ..loads.unit_load_cache import on_elements
from .criteria import CRITERIA
from .weight_functions import TipFunctionals

if TYPE_CHECKING:
    from ..body import Body
    from ..loads.body_loads import BodyLoad

#: Safety factor on h (the exact maximum is 0.98 to 1.02 times that of the linear function in
#: `tests/ddm/fracture/test_sif_bound.py`).
MARGIN = 1.25


def is_bounded(body: Body) -> bool:
    """Whether K of ``body`` is linear in any load: open frictionless faces, no holes, no supports."""
    return scales(body) and bool(len(body.cracks.tips)) and not body.closing[1].any()


class TipBound:
    """Bounds for a ``body`` that `is_bounded`.

    largest  (n_tips,) largest K of a unit force on the outline, Pa √m
    force    (n_tips, 2, 4) K_I and K_II of a unit gradient of the body force, xx, xy, yx, yy
    uniform  (n_tips, 2, 3) of a unit uniform stress
    """

    def __init__(self, body: Body) -> None:
        known = TipFunctionals(body)
        n_g, n = len(known.on_boundary), known.on_boundary.shape[1] // 2
        outline = np.flatnonzero(body.mesh.edge_loop[body.boundary.source] == 0)
        start, end = body.boundary.start[outline], body.boundary.end[outline]
        length = np.hypot(*(end - start).T)
        loads = body._loads
        on_both = [loads._linear_forces(part, np.stack([start, end], axis=1)) for part in (body.boundary, body.faces)]
        force = loads._edge_load("force").applied
        to_force = (known.on_boundary.T @ force[:n_g] - known.on_faces.T @ force[n_g:]).reshape(2, n, 6)
        k = np.einsum("ut,sue->tse", known.on_boundary, on_both[0]) - np.einsum(
            "ut,sue->tse", known.on_faces, on_both[1]
        )
        # Weighted means of h under the two linear loads, and end values of the linear function with these.
        means = k.reshape(2, n, len(outline), 2, 2) / (0.5 * length[:, None, None])
        ends = np.stack([2 * means[..., 0, :] - means[..., 1, :], 2 * means[..., 1, :] - means[..., 0, :]], axis=-2)
        at = np.stack([start, end], axis=1) - body.centroid
        turn = np.stack([-at[..., 1], at[..., 0]], axis=-1) / np.trace(body._second)  # of unit forces
        ends -= to_force[:, :, None, None, :2] / body.area
        ends += (to_force[:, :, 3] - to_force[:, :, 4])[:, :, None, None, None] * turn
        self.largest = MARGIN * np.sqrt((ends**2).sum(axis=(0, -1))).max(axis=(1, 2))
        self.force = to_force[:, :, 2:].transpose(1, 0, 2)
        unit = np.column_stack([-on_elements(body.faces, of) for of in np.eye(3)])
        self.uniform = (known.on_faces.T @ unit).reshape(2, n, 3).transpose(1, 0, 2)

    def at_most(self, load: BodyLoad) -> np.ndarray:
        """(n_tips,) upper bound of √(K_I² + K_II²) under ``load``, Pa √m: tractions on segments of the outline, body
        force with gradient, and uniform stress, in equilibrium."""
        assert load.segments is not None and load.tractions is not None and load.body_force_gradient is not None
        along = load.segments[:, 1] - load.segments[:, 0]
        size = 0.5 * float(np.hypot(*along.T) @ np.hypot(load.tractions[..., 0], load.tractions[..., 1]).sum(axis=1))
        gradient = load.body_force_gradient
        k = self.force @ (0.5 * (gradient + gradient.T)).ravel()
        if load.remote_stress is not None:
            k = k + self.uniform @ load.remote_stress
        return self.largest * size + np.hypot(k[:, 0], k[:, 1])


@lru_cache(maxsize=64)
def largest_k_eq_per_k(criterion: str, material: Material) -> float:
    """Largest K_eq of the ``criterion`` in ``material`` for √(K_I² + K_II²) = 1; K_eq is proportional to both."""
    angle = np.linspace(-np.pi, np.pi, 721)
    _, k_eq = CRITERIA[criterion](np.cos(angle), np.sin(angle), material)
    # Half a degree from the maximum the value is lower by less than this.
    return 1.01 * float(k_eq.max())
