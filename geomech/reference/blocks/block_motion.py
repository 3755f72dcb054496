"""Closed forms for moving blocks: fall, sliding, rotation, vibration, and columns at rest."""

from __future__ import annotations

import math

import numpy as np


def free_fall(time: np.ndarray, gravity: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Displacement (..., 2) m of a body thrown with ``velocity`` (2,) m/s under ``gravity`` (2,) m/s²: v t + g t²/2.

    Galileo (1638), Discorsi, fourth day.
    """
    t = np.asarray(time, dtype=float)[..., None]
    return t * np.asarray(velocity) + 0.5 * t**2 * np.asarray(gravity)


def incline_acceleration(incline: float, friction_angle: float, gravity: float = 9.81) -> float:
    """Acceleration (m/s²) down an ``incline`` (rad) of a block from rest: g (sin α − cos α tan φ), 0 while φ ≥ α.

    Coulomb (1785); used for DDA by MacLaughlin & Sitar (1995) and by MacLaughlin & Doolin (2006), who review it.
    """
    if friction_angle >= incline:
        return 0.0
    return gravity * (math.sin(incline) - math.cos(incline) * math.tan(friction_angle))


def stopping_distance(speed: float, friction_angle: float, gravity: float = 9.81) -> float:
    """Sliding distance of a block with the initial ``speed`` on level ground, v²/(2 g tan φ), m (work of Coulomb
    friction)."""
    return speed**2 / (2 * gravity * math.tan(friction_angle))


def shi_amplification(omega_dt: float) -> np.ndarray:
    """Amplification matrix (2, 2) of Shi's (1988) time step for (x, v dt) of an undamped oscillator, Ω = ω dt.

    d = v dt + a dt²/2 and v' = v + a dt with a = −ω²(x + d): Newmark's (1959) scheme with β = ½, γ = 1. Its
    determinant, the squared modulus of the complex pair for Ω < 4, is 1/(1 + Ω²/2).
    """
    o = omega_dt**2
    return np.array([[2.0, 2.0], [-2.0 * o, 2.0 - o]]) / (2.0 + o)


def newmark_amplification(omega_dt: float, beta: float, gamma: float) -> np.ndarray:
    """Amplification matrix (3, 3) of Newmark's (1959) scheme for (x, v dt, a dt²) of an undamped oscillator, Ω = ω dt.

    x₁ = x + v dt + ((½−β) a + β a₁) dt², v₁ = v + ((1−γ) a + γ a₁) dt, a₁ = −ω² x₁ (Hughes 1987, §9.1).
    """
    new = np.array([[1.0, 0.0, -beta], [0.0, 1.0, -gamma], [omega_dt**2, 0.0, 1.0]])
    old = np.array([[1.0, 1.0, 0.5 - beta], [0.0, 1.0, 1.0 - gamma], [0.0, 0.0, 0.0]])
    return np.linalg.solve(new, old)


def bossak_amplification(omega_dt: float, radius: float) -> np.ndarray:
    """Amplification matrix (3, 3) of the α-scheme of Wood, Bossak & Zienkiewicz (1981) for (x, v dt, a dt²), Ω = ω dt.

    Newmark's displacement and velocity with (1−α) a₁ + α a = −ω² x₁; α = (ϱ−1)/(ϱ+1), γ = ½−α, β = ¼(1−α)² give it the
    ``radius`` ϱ as Ω → ∞ (Chung & Hulbert 1993).
    """
    alpha = (radius - 1) / (radius + 1)
    beta, gamma = 0.25 * (1 - alpha) ** 2, 0.5 - alpha
    new = np.array([[1.0, 0.0, -beta], [0.0, 1.0, -gamma], [omega_dt**2, 0.0, 1.0 - alpha]])
    old = np.array([[1.0, 1.0, 0.5 - beta], [0.0, 1.0, 1.0 - gamma], [0.0, 0.0, -alpha]])
    return np.linalg.solve(new, old)


def apparent_oscillation(amplification: np.ndarray) -> tuple[float, float]:
    """Numerical damping (fraction of critical) and frequency · dt of an undamped oscillator, from a scheme's
    ``amplification`` matrix.

    From its complex pair λ = exp(−ξ̄ω̄dt ± iω̄_d dt) with ω̄_d = ω̄ √(1−ξ̄²) (Hughes 1987, §9.1).
    """
    pair = np.linalg.eigvals(amplification)
    largest = complex(pair[np.argmax(pair.imag)])
    decay, turn = -math.log(abs(largest)), math.atan2(largest.imag, largest.real)
    return decay / math.hypot(decay, turn), turn


def square_block_frequency(side: float, youngs_modulus: float, density: float) -> float:
    """ω (rad/s) of the stretching of a free first-order square block with ν = 0: ω² = E A/(ρ ∫x²) = 12 E/(ρ w²)."""
    return math.sqrt(12 * youngs_modulus / density) / side


def spinning_square_stress(side: float, density: float, spin: float) -> float:
    """Mean normal stress (Pa, both directions) of a square spinning at ``spin`` rad/s: ρω²w²/12.

    The virial of the centrifugal force, (1/A) ∫ ρω²x² dA; exact for any linear elastic square.
    """
    return density * spin**2 * side**2 / 12


def column_shortening(
    load: np.ndarray, height: float, width: float, plane_modulus: float, contact_stiffness: float
) -> float:
    """Shortening (m) of a column of equal blocks by Hooke's law, and of the contacts under the blocks: Σ F h/(w E') + Σ
    F/(2 p).

    Block k carries the mean force ``load[k]`` (N/m); the contact under it carries ``load[k]`` as well, if the load acts
    at its end. E' is the plane modulus E/(1−ν²), for free lateral expansion in plane strain; each joint has two springs
    p.
    """
    load = np.asarray(load, dtype=float)
    return float(np.sum(load * height / (width * plane_modulus)) + np.sum(load) / (2 * contact_stiffness))


def plastic_impact_bounds(masses: tuple[float, float], speeds: tuple[float, float]) -> tuple[float, float]:
    """Total momentum and smallest kinetic energy of two bodies after a head-on impact; the latter is that of a plastic
    impact (Newton 1687)."""
    m, v = np.asarray(masses), np.asarray(speeds)
    momentum = float(m @ v)
    return momentum, momentum**2 / (2 * float(m.sum()))
