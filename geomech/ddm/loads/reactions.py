"""Reactions of the supports of an elastic body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.body_force_fields import Particular

if TYPE_CHECKING:
    from ..interfaces import CrackedBody


@dataclass(frozen=True, eq=False)
class Reactions:
    """Tractions that supports exert on a body, at the nodes of the supported elements, and their resultants.

    support   (n,)          the support of each element
    points    (n, p+1, 2)   m
    traction  (n, p+1, 2)   Pa, x and y, in the supported directions (in the others the applied traction acts)
    force     (n_supports, 2)  N/m
    moment    (n_supports,)    N, about the body's centroid
    """

    support: np.ndarray
    points: np.ndarray
    traction: np.ndarray
    force: np.ndarray
    moment: np.ndarray


def reactions(body: CrackedBody, density: np.ndarray, particular: Particular) -> Reactions:
    """Reactions of ``body`` from the ``density`` (h_unknowns,) of reactions, in local components."""
    n = len(body.supports)
    holds = body._outside.holds
    if holds is None:
        none = np.zeros((0, body.boundary.per, 2))
        return Reactions(np.zeros(0, int), none, none, np.zeros((0, 2)), np.zeros(0))
    s = holds.sources
    # A superposed uniform field is in equilibrium with its own tractions.
    out = -s.normal
    stress = particular.uniform
    carried = np.stack(
        [stress[0] * out[:, 0] + stress[2] * out[:, 1], stress[2] * out[:, 0] + stress[1] * out[:, 1]], axis=1
    )
    local = np.stack([np.sum(carried * s.tangent, axis=1), np.sum(carried * s.normal, axis=1)], axis=1)
    turned = np.einsum("hjc,hc->hj", holds.directions, local) * holds.supported
    local = density.reshape(s.n, 2, s.per) + np.einsum("hjc,hj->hc", holds.directions, turned)[:, :, None]
    traction = local[:, 0, :, None] * s.tangent[:, None] + local[:, 1, :, None] * s.normal[:, None]
    weighted = traction * s.quadrature[:, :, None]
    arm = s.nodes - body.centroid
    force, moment = np.zeros((n, 2)), np.zeros(n)
    np.add.at(force, holds.support, weighted.sum(axis=1))
    np.add.at(moment, holds.support, (arm[..., 0] * weighted[..., 1] - arm[..., 1] * weighted[..., 0]).sum(axis=1))
    return Reactions(holds.support, s.nodes, traction, force, moment)
