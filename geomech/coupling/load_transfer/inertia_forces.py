"""Body forces that balance the boundary loads of a block: its inertia (d'Alembert), linear in x.

b(x) = b₀ + G (x − x_c) with ∫ b dA = −Σ f and ∫ r × b dA = −Σ r × f, so that the elastic problem is in equilibrium to
round-off.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .piecewise_traction import Found


class BlockShape(NamedTuple):
    """Blocks in the reference configuration: ``area`` (n,) m², ``centroid`` (n, 2) m, ``second`` moments of area (n, 2,
    2) m⁴ about it."""

    area: np.ndarray
    centroid: np.ndarray
    second: np.ndarray


@dataclass(frozen=True, eq=False)
class BlockInertia:
    """Rotation of blocks (n,) and the forces that their inertia balances.

    ``rotation`` (n,) rad, ``density`` (n,) kg/m³, ``acceleration`` (n, 6; None: zero), ``spin`` (n,) rad/s, ``gravity``
    (2,) m/s² (None: zero); ``reaction`` (n, 6) N, N m: forces that impose a motion, distributed over the block like its
    inertia; ``overstress`` (n, 3) Pa: what the forces balance beyond the stress of the block (inertia of strain and
    viscosity), current axes (None: at rest).
    """

    rotation: np.ndarray
    density: np.ndarray
    spin: np.ndarray
    gravity: np.ndarray | None = None
    acceleration: np.ndarray | None = None
    reaction: np.ndarray | None = None
    overstress: np.ndarray | None = None

    def only(self, rows: np.ndarray) -> BlockInertia:
        """The inertia of the blocks in these ``rows``."""
        own = (None if of is None else of[rows] for of in (self.acceleration, self.reaction, self.overstress))
        return BlockInertia(self.rotation[rows], self.density[rows], self.spin[rows], self.gravity, *own)


def balanced(
    found: Found, ends: np.ndarray, shape: BlockShape, inertia: BlockInertia, turn: np.ndarray, left_out: np.ndarray,
    strained: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Body force (n, 2) at the centroids of blocks, its gradient (n, 2, 2), the uniform stress (n, 3) that stands for
    the inertia of their strain (where there is an overstress), and the remaining imbalance relative to the forces (n,).

    ``found``: pieces and points of all blocks; ``ends`` (n + 1, 3): their number before each block; ``turn`` (n, 2):
    cosine and sine of the rotations; ``left_out`` (n, 2, 2): Σ r ⊗ f that the pieces do not reproduce; ``strained`` (n,
    2, 2): displacement gradient of the blocks."""
    area, centroid, second = shape
    density, spin = np.asarray(inertia.density, dtype=float), np.asarray(inertia.spin, dtype=float)
    gravity = np.zeros(2) if inertia.gravity is None else np.asarray(inertia.gravity, dtype=float)
    zeros = np.zeros((len(area), 6))
    acceleration = zeros if inertia.acceleration is None else inertia.acceleration
    reaction = zeros if inertia.reaction is None else inertia.reaction
    c, s = turn.T
    a_x, a_y, angular, e_xx, e_yy, shear = acceleration.T
    b_xx = density * (spin**2 - c * c * e_xx - s * s * e_yy - s * c * shear)
    b_yy = density * (spin**2 - s * s * e_xx - c * c * e_yy + s * c * shear)
    b_xy = -density * (s * c * (e_yy - e_xx) + 0.5 * (c * c - s * s) * shear)
    symmetric = _matrices(b_xx, b_xy, b_xy, b_yy)  # the body force's gradient, but for what turns
    turn_back = _matrices(c, s, -s, c)
    carried = density[:, None] * (gravity - np.stack([a_x, a_y], axis=1)) + reaction[:, :2] / area[:, None]
    carried = (turn_back @ carried[..., None])[..., 0]
    force, size, spread = _resultants(found.pieces, found.inside, ends, centroid)
    gradient = whole = _with_torque(symmetric, spread, second)
    even = np.zeros((len(area), 3))
    if inertia.overstress is not None:
        centrifugal = (density * spin**2)[:, None, None] * np.eye(2)
        gradient = _with_torque(centrifugal, spread, second)
        left = second @ (whole - gradient).transpose(0, 2, 1) / area[:, None, None]
        even = np.stack([left[:, 0, 0], left[:, 1, 1], 0.5 * (left[:, 0, 1] + left[:, 1, 0])], axis=1)
    body_force = -force / area[:, None]
    # The solver's forces balance on the strained block, whose lever arms and inertia differ by the strain.
    strain = turn_back @ strained
    moments = strain @ second @ strain.transpose(0, 2, 1)
    missed = _turning(strain @ (spread + left_out) + moments @ symmetric) + reaction[:, 2]
    missed -= density * angular * _trace(moments)
    off = np.hypot(*(body_force - carried).T) * area + np.abs(missed) / np.sqrt(area)
    return body_force, gradient, even, np.where(size > 0, off / np.where(size > 0, size, 1.0), 0.0)


def _resultants(
    pieces: np.ndarray, inside: np.ndarray, ends: np.ndarray, about: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Resultants (n, 2) of the forces on blocks, the sums of their magnitudes (n,), and ∫ r ⊗ t ds (n, 2, 2) with arms
    r from ``about`` (n, 2)."""
    n = len(about)
    owner, at = (np.repeat(np.arange(n), np.diff(ends[:, k])) for k in (0, 1))
    a, b, p, q = pieces.reshape(-1, 4, 2).transpose(1, 0, 2)
    a, b = a - about[owner], b - about[owner]
    length = np.hypot(*(b - a).T)[:, None]
    sizes = 0.5 * length[:, 0] * (np.hypot(*p.T) + np.hypot(*q.T))
    # ∫ x t ds of two linear functions on a length L is L/6 Σ x_i t_j, with terms of the same end counted twice.
    ends_of = (2 * a + b)[:, :, None] * p[:, None] + (a + 2 * b)[:, :, None] * q[:, None]
    points, forces = inside[:, :2] - about[at], inside[:, 2:]
    force = _sums(0.5 * length * (p + q), owner, n) + _sums(forces, at, n)
    size = _sums(sizes[:, None], owner, n) + _sums(np.abs(forces).sum(axis=1)[:, None], at, n)
    spread = _sums((length[:, :, None] / 6 * ends_of).reshape(-1, 4), owner, n)
    spread += _sums((points[:, :, None] * forces[:, None]).reshape(-1, 4), at, n)
    return force, size[:, 0], spread.reshape(n, 2, 2)


def _sums(rows: np.ndarray, owner: np.ndarray, n: int) -> np.ndarray:
    """(n, k) sums of the ``rows`` (m, k) by ``owner`` (m,)."""
    # (bincount of an empty array returns integers.)
    return np.stack([np.bincount(owner, weights=column, minlength=n).astype(float) for column in rows.T], axis=1)


def _with_torque(symmetric: np.ndarray, spread: np.ndarray, second: np.ndarray) -> np.ndarray:
    """``symmetric`` gradients of body forces plus the angular inertia that balances the moment of ``spread``."""
    torque = _turning(spread + second @ symmetric) / _trace(second)
    none = np.zeros_like(torque)
    return symmetric + _matrices(none, torque, -torque, none)


def _turning(spread: np.ndarray) -> np.ndarray:
    """Moments Σ r × f, from ``spread`` (n, 2, 2) = Σ r ⊗ f."""
    return spread[:, 0, 1] - spread[:, 1, 0]


def _trace(matrices: np.ndarray) -> np.ndarray:
    return matrices[:, 0, 0] + matrices[:, 1, 1]


def _matrices(xx: np.ndarray, xy: np.ndarray, yx: np.ndarray, yy: np.ndarray) -> np.ndarray:
    """(n, 2, 2) of their components (n,)."""
    return np.stack([np.stack([xx, xy], axis=-1), np.stack([yx, yy], axis=-1)], axis=-2)
