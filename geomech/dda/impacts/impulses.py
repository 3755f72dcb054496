"""Impulses of colliding rigid blocks: Newton's restitution normal to the contact, Coulomb friction along it.

Contact i has the relative velocity uᵢ of its vertex and edge, normal to the edge (n, positive when separating) and
along it (t). Impulses p change u = u₀ + W p, W = J M⁻¹ Jᵀ of the blocks' rigid motion, so that

    uₙ ≥ gₙ,   pₙ ≥ 0,   pₙ (uₙ − gₙ) = 0          gₙ = −e uₙ(before) where blocks strike
    |pₜ| ≤ μ pₙ,   pₜ against uₜ − gₜ where it reaches that

(Moreau 1988, *Unilateral contact and dry friction in finite freedom dynamics*). Solved by Gauss and Seidel's sweeps
over the contacts, each projected on its cone (Jourdan, Alart & Jean 1998, non-smooth contact dynamics).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...compiled import kept
from ..kinematics.tolerances import SAME

#: Sweeps end when no relative velocity changes by more than `SAME` of the largest required one, far below the accuracy of
#: coefficients of restitution, or after this number: a struck column of 100 bricks takes 4 000.
_SWEEPS = 20_000


class ImpulseProblem(NamedTuple):
    """Contacts (n,) of rigid blocks and their required relative velocities.

    block, other     (n,)          the vertex's block and the edge's
    normal           (n, 2)        outward of the edge
    arms             (n, 2, 2)     m, from the centroids of both to where they touch
    inverse          (n_blocks, 3) 1/(kg/m), 1/(kg m): of mass, mass, moment of inertia; 0 if fixed
    velocity         (n_blocks, 3) m/s, m/s, rad/s before
    across, along    (n,)          m/s: gₙ and gₜ
    friction         (n,)          μ
    glued            (n,) bool     bilateral: uₙ = gₙ and uₜ = gₜ
    """

    block: np.ndarray
    other: np.ndarray
    normal: np.ndarray
    arms: np.ndarray
    inverse: np.ndarray
    velocity: np.ndarray
    across: np.ndarray
    along: np.ndarray
    friction: np.ndarray
    glued: np.ndarray

    def impulses(self) -> tuple[np.ndarray, np.ndarray]:
        """(n, 2) N s: normal and tangential impulse of each contact, and (n_blocks, 3) the velocities after them."""
        velocity = np.ascontiguousarray(self.velocity, dtype=float).copy()
        impulse = _swept(
            self.block, self.other, self.normal, self.arms, self.inverse, velocity, self.across, self.along,
            self.friction, self.glued, SAME, _SWEEPS,
        )  # fmt: skip
        return impulse, velocity

    def made_by(self, impulse: np.ndarray) -> np.ndarray:
        """(n_blocks, 3) the change of velocity by ``impulse`` (n, 2)."""
        out, n = np.zeros_like(self.velocity), self.normal
        force = impulse[:, :1] * n + impulse[:, 1:] * np.stack([-n[:, 1], n[:, 0]], axis=1)
        for side, (owner, sign) in enumerate(((self.block, 1.0), (self.other, -1.0))):
            arm = self.arms[:, side]
            moment = arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]
            np.add.at(out, owner, sign * np.column_stack([force, moment]))
        return out * self.inverse

    def passed_on(self, which: np.ndarray) -> np.ndarray:
        """(n_blocks, 3) the velocities after the impulses of the contacts ``which`` (n,) alone."""
        per_contact = ("block", "other", "normal", "arms", "across", "along", "friction", "glued")
        return self._replace(**{name: getattr(self, name)[which] for name in per_contact}).impulses()[1]

    def speeds(self, velocity: np.ndarray) -> np.ndarray:
        """(n, 2) m/s: relative velocities of vertices and edges, normal and tangential, for the block velocities
        ``velocity`` (n_blocks, 3)."""
        return self.relative(velocity[self.block], velocity[self.other])

    def relative(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """`speeds` for the velocities ``first`` (n, 3) of the vertices' blocks and ``second`` (n, 3) of the edges'."""
        speed = np.zeros((len(self.block), 2))
        for side, (v, sign) in enumerate(((first, 1.0), (second, -1.0))):
            arm = self.arms[:, side]
            speed[:, 0] += sign * (v[:, 0] - v[:, 2] * arm[:, 1])
            speed[:, 1] += sign * (v[:, 1] + v[:, 2] * arm[:, 0])
        n = self.normal
        return np.stack([(n * speed).sum(axis=1), n[:, 0] * speed[:, 1] - n[:, 1] * speed[:, 0]], axis=1)


@kept(fastmath=False, error_model="numpy", nogil=True)
def _swept(block, other, normal, arms, inverse, velocity, across, along, friction, glued, within, sweeps):
    """(n, 2) impulses; ``velocity`` (n_blocks, 3) becomes that after them, in place. ``arms`` (n, 2, 2) m from both
    blocks' centroids."""
    n = block.shape[0]
    impulse = np.zeros((n, 2))
    # For each contact and direction: change of its own relative velocity by a unit impulse, and moments about both
    # blocks.
    own = np.zeros((n, 2))
    moment = np.zeros((n, 2, 2))
    largest = 0.0
    for c in range(n):
        nx, ny = normal[c, 0], normal[c, 1]
        for way in range(2):
            dx, dy = (nx, ny) if way == 0 else (-ny, nx)
            for side in range(2):
                b = block[c] if side == 0 else other[c]
                m = arms[c, side, 0] * dy - arms[c, side, 1] * dx
                moment[c, way, side] = m
                own[c, way] += dx * dx * inverse[b, 0] + dy * dy * inverse[b, 1] + m * m * inverse[b, 2]
        largest = max(largest, abs(across[c]), abs(along[c]))
    for b in range(velocity.shape[0]):
        largest = max(largest, abs(velocity[b, 0]), abs(velocity[b, 1]))
    for _ in range(sweeps):
        changed = 0.0
        for c in range(n):
            nx, ny, a, b = normal[c, 0], normal[c, 1], block[c], other[c]
            for way in range(2):
                if own[c, way] <= 0.0:
                    continue
                dx, dy = (nx, ny) if way == 0 else (-ny, nx)
                ma, mb = moment[c, way, 0], moment[c, way, 1]
                speed = dx * (velocity[a, 0] - velocity[b, 0]) + dy * (velocity[a, 1] - velocity[b, 1])
                speed += ma * velocity[a, 2] - mb * velocity[b, 2]
                asked = across[c] if way == 0 else along[c]
                new = impulse[c, way] - (speed - asked) / own[c, way]
                if not glued[c]:
                    if way == 0:
                        new = max(0.0, new)
                    else:
                        most = friction[c] * impulse[c, 0]
                        new = min(max(new, -most), most)
                step = new - impulse[c, way]
                if step == 0.0:
                    continue
                impulse[c, way] = new
                changed = max(changed, abs(step) * own[c, way])
                velocity[a, 0] += step * dx * inverse[a, 0]
                velocity[a, 1] += step * dy * inverse[a, 1]
                velocity[a, 2] += step * ma * inverse[a, 2]
                velocity[b, 0] -= step * dx * inverse[b, 0]
                velocity[b, 1] -= step * dy * inverse[b, 1]
                velocity[b, 2] -= step * mb * inverse[b, 2]
        if changed <= within * largest:
            break
    return impulse
