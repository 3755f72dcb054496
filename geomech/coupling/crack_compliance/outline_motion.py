"""Displacement of the outline of a cracked block of higher order beyond its polynomials.

Cracks that open under the stress Σ of a block displace its outline by u'(Σ), of which its polynomials represent the part
with the generalised strain e_c. The faces of a cell to the others of its rock move by the remainder as well,

    r(Σ) = u'(Σ) − u(e_c(Σ)) = R Σ + r₀,

without its mean translation and rotation: then the displacement across a face is that of cracked rock, and the error of
what it transmits is that of its stress alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ...ddm.system.displacement_jumps import on_boundary

if TYPE_CHECKING:
    from ...ddm import Body, Solution
    from .block_stress_field import BlockStressField

#: Sets of points of which values are kept: those of the two sides of a block's faces.
_KEPT = 4


@dataclass(eq=False)
class OutlineMotion:
    """The remainder r of the ``body`` of a block with the stress field ``of_block``, in the block's axes.

    unknowns  (n_boundary_unknowns, 4 + m)  u', times 2μ, per unit of Σ, and beyond that
    softness  (3 + m, 4 + m)                e_c, likewise
    """

    of_block: BlockStressField
    body: Body
    unknowns: np.ndarray
    softness: np.ndarray
    rigid: np.ndarray = field(init=False)
    _known: dict[bytes, np.ndarray] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        boundary = self.body.boundary
        nodes, weights = boundary.nodes.reshape(-1, 2), np.sqrt(boundary.quadrature.ravel())
        rigid, moved = self._rigid_at(nodes), self._with_rotation(nodes)
        n = len(nodes)
        self.rigid = np.linalg.lstsq(
            (rigid * weights[:, None, None]).reshape(2 * n, 3), (moved * weights[:, None, None]).reshape(2 * n, -1)
        )[0]

    @classmethod
    def of(
        cls, field: BlockStressField, body: Body, solution: Solution, stress: np.ndarray, limit: np.ndarray
    ) -> OutlineMotion:
        """Of the cracks in the face states of the ``solution`` under the generalised ``stress`` (3 + m,), Pa; ``limit``
        (3 + m, 3 + m) as in `mean_stress_response`."""
        jumps = body.jumps_under(field.traction(body), solution) @ limit
        free = np.zeros((body.boundary.n_unknowns, len(stress)))
        unknowns = body.boundary_unknowns(free, jumps)
        beyond = body.boundary_unknowns(free[:, 0], solution.jumps) - unknowns @ stress
        softness = field.crack_strain(body, np.column_stack([jumps, solution.jumps - jumps @ stress]))
        return cls(field, body, np.column_stack([unknowns, beyond]), softness)

    def at(self, points: np.ndarray) -> np.ndarray:
        """(n, 2, 4 + m) R and r₀, m/Pa and m, at undeformed ``points`` (n, 2) of the outline."""
        key = points.tobytes()
        if key not in self._known:
            if len(self._known) > _KEPT:
                self._known.clear()
            self._known[key] = self._with_rotation(points) - self._rigid_at(points) @ self.rigid
        return self._known[key]

    def _with_rotation(self, points: np.ndarray) -> np.ndarray:
        moved = on_boundary(self.body.boundary, self.unknowns, points) / (2 * self.body.material.shear_modulus)
        return moved - self.of_block.displacement_of(points) @ self.softness

    def _rigid_at(self, points: np.ndarray) -> np.ndarray:
        """(n, 2, 3) displacement of unit translations and rotation."""
        x, y = (points - self.body.centroid).T
        one, none = np.ones_like(x), np.zeros_like(x)
        return np.stack([np.stack([one, none, -y], axis=1), np.stack([none, one, x], axis=1)], axis=1)

    def __getstate__(self) -> dict:
        return vars(self) | {"_known": {}}
