"""Rigid blocks: three unknowns, and the mean stress that balances their forces, A σ̄ = Σ sym(F ⊗ x) + ∫ sym(b ⊗ x) dA.

The strains of a rigid block are constrained to zero exactly. The constraint force is the mean stress, the virial of all
forces F and body forces b (weight, inertia, centrifugal force) at arms x from the centroid (Love 1927, §120).
"""

from __future__ import annotations

import numpy as np

from ...conventions import rotate_stress
from .newmark import BlockMass


def with_rigid(constrained: np.ndarray | None, rigid: np.ndarray) -> np.ndarray | None:
    """(n_blocks, 6) bool: the constraints ``constrained`` and the strains of ``rigid`` (n_blocks,) blocks; None: none."""
    if not rigid.any():
        return constrained
    out = np.zeros((len(rigid), 6), bool) if constrained is None else constrained.copy()
    out[rigid, 3:] = True
    return out


def mean_stress(
    blocks: np.ndarray,
    contacts: np.ndarray,
    load: np.ndarray,
    mass: BlockMass,
    acceleration: np.ndarray,
    spin: np.ndarray,
    contact_turn: np.ndarray,
    turn: np.ndarray,
) -> np.ndarray:
    """(n, 3) mean stress of ``blocks`` (n,), Pa, on axes rotated by ``turn`` (n_blocks,) rad.

    ``contacts`` CONTACT rows on a configuration rotated by ``contact_turn`` (n_blocks,) rad, on which the moments of
    ``mass`` are; ``load`` (n_blocks, 6) generalised forces, N and N m; ``acceleration`` (n_blocks, 6); ``spin``
    (n_blocks,) rad/s."""
    density, moments, _ = mass
    n = contacts["normal"]
    force = contacts["normal_force"][:, None] * n
    force += contacts["shear_force"][:, None] * np.stack([-n[:, 1], n[:, 0]], axis=1)
    virial = np.zeros((len(load), 3))
    for owner, sign in (("block", 1.0), ("other", -1.0)):
        own = contacts[owner]
        (x, y), (fx, fy) = (contacts["point"] - moments[own, 1:3]).T, sign * force.T
        for k, part in enumerate((x * fx, y * fy, 0.5 * (y * fx + x * fy))):
            virial[:, k] += np.bincount(own, weights=part, minlength=len(virial))
    virial = rotate_stress(virial, -contact_turn) + load[:, 3:]
    xx, yy, xy = moments[:, 3:6].T
    second = np.stack([xx, yy, xy], axis=1)
    turning = np.stack([-xy, xy, 0.5 * (xx - yy)], axis=1)
    virial += density[:, None] * (spin[:, None] ** 2 * second - acceleration[:, 2:3] * turning)
    return rotate_stress(virial[blocks] / moments[blocks, :1], turn[blocks])
