"""Longitudinal waves along a row of uniformly strained blocks connected by springs.

A block of length h, cross-section A (per metre of thickness), mass m = ρ A h has the displacement u + e x along the
row: mean displacement u and strain e. Its neighbours act on its faces through springs of stiffness K (N/m, sum over a
joint):

    m ü_k = N_{k+1/2} − N_{k−1/2},    (m h²/12) ë_k = (h/2)(N_{k+1/2} + N_{k−1/2}) − E A h e_k,
    N_{k+1/2} = K (u_{k+1} − u_k − (h/2)(e_{k+1} + e_k))

Derived here; compare the diatomic chain of Brillouin (1946), Wave propagation in periodic structures, ch. 3-4. SI
units.
"""

from __future__ import annotations

import math

import numpy as np


def long_wave_speed(length: float, mass: float, joint: float, axial: float) -> float:
    """Speed (m/s) of waves much longer than a block: h √(k/m), 1/k = 1/K + 1/k_b, ``joint`` K and block stiffness
    ``axial`` k_b = E A/h (N/m). The continuum of the same mass and compliance; √(E/ρ) for stiff joints."""
    return length * math.sqrt(1.0 / (1.0 / joint + 1.0 / axial) / mass)


def dispersion(wave_number: np.ndarray, length: float, mass: float, joint: float, axial: float) -> np.ndarray:
    """(n, 2) angular frequencies (rad/s), acoustic and optical branch, of ``wave_number`` (n,) 1/m.

    With u and e h/2 as unknowns, both ∝ exp(i q h k), the stiffness is [[2K(1−cos qh), −2iK sin qh], [2iK sin qh,
    2K(1+cos qh) + 4 k_b]], Hermitian, over the masses (m, m/3).
    """
    q = np.atleast_1d(np.asarray(wave_number, dtype=float)) * length
    uu = 2.0 * joint * (1.0 - np.cos(q))
    ee = 2.0 * joint * (1.0 + np.cos(q)) + 4.0 * axial
    ue2 = (2.0 * joint * np.sin(q)) ** 2  # |off-diagonal|²
    a, b = uu / mass, 3.0 * ee / mass
    root = np.sqrt((0.5 * (a - b)) ** 2 + 3.0 * ue2 / mass**2)
    upper = 0.5 * (a + b) + root
    # The lower root by the product, exact for long waves.
    lower = np.maximum(0.0, (a * b - 3.0 * ue2 / mass**2) / upper)
    return np.sqrt(np.column_stack([lower, upper]))


def chain_matrices(
    n: int, length: float, mass: float, joint: float, axial: float, fixed_end: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """(mass (2n,), stiffness (2n, 2n)) of a row of ``n`` blocks, unknowns u_1, e_1, u_2, e_2, …; its left end free, its
    right end free or, with ``fixed_end``, joined to a block that does not move."""
    masses = np.tile([mass, mass * length**2 / 12.0], n)
    stiffness = np.zeros((2 * n, 2 * n))
    for k in range(n):
        stiffness[2 * k + 1, 2 * k + 1] += axial * length**2
    for k in range(n if fixed_end else n - 1):
        pull = np.zeros(2 * n)
        pull[2 * k : 2 * k + 2] = -1.0, -0.5 * length
        if k + 1 < n:
            pull[2 * k + 2 : 2 * k + 4] = 1.0, -0.5 * length
        stiffness += joint * np.outer(pull, pull)
    return masses, stiffness


def chain_motion(
    masses: np.ndarray, stiffness: np.ndarray, rate: np.ndarray, time: float, step: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """(displacement (n,), rate (n,)) at ``time`` of a system at zero with ``rate`` (n,), by its normal modes.

    With ``step`` dt each frequency is the one that the trapezoidal rule gives it, tan(ω' dt/2) = ω dt/2.
    """
    root = np.sqrt(masses)
    values, modes = np.linalg.eigh(stiffness / np.outer(root, root))
    omega = np.sqrt(np.maximum(values, 0.0))
    seen = omega if step is None else 2.0 / step * np.arctan(0.5 * omega * step)
    amount = modes.T @ (root * rate)
    still = omega * time < 1e-9
    # Displacement and rate keep the ratio 1/ω of the exact oscillator.
    wave = np.where(still, time, np.sin(seen * time) / np.where(still, 1.0, omega))
    return (modes @ (wave * amount)) / root, (modes @ (np.cos(seen * time) * amount)) / root
