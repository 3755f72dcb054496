"""Rough joints: a published table of Barton's strength, and direct shear at constant stiffness by integration."""

from __future__ import annotations

import math

import numpy as np

#: Basic friction angle (rad), JRC and JCS (Pa) of the example in `ROUGH_JOINT_TABLE`.
ROUGH_JOINT_EXAMPLE = (math.radians(29.0), 16.9, 96e6)

#: Normal stress, shear strength (MPa), its slope, and the cohesion of its tangent (MPa): Hoek, Practical Rock
#: Engineering (2007), chapter "Shear strength of discontinuities", the spreadsheet of instantaneous cohesion and
#: friction angle. Quoted; every figure agrees with Barton's equation to the digits printed.
ROUGH_JOINT_TABLE = np.array(
    [
        [0.360, 0.989, 1.652, 0.394],
        [0.720, 1.538, 1.423, 0.513],
        [1.440, 2.476, 1.213, 0.730],
        [2.880, 4.073, 1.030, 1.107],
        [5.759, 6.779, 0.872, 1.760],
        [11.518, 11.344, 0.733, 2.907],
        [23.036, 18.973, 0.609, 4.953],
        [46.073, 31.533, 0.496, 8.666],
    ]
)

#: Largest total friction angle of a rough joint at low normal stress, degrees (Barton & Choubey 1977).
STEEPEST_ANGLE_DEG = 70.0


def barton_strength(pressure: float, jrc: float, jcs: float, residual_angle: float) -> float:
    """τ = σ tan(JRC log₁₀(JCS/σ) + φr), Pa: Barton & Choubey (1977) eq. 7, below its limit of 70°."""
    return pressure * math.tan(math.radians(jrc * math.log10(jcs / pressure)) + residual_angle)


def lift_at_constant_stiffness(
    slip: np.ndarray, jrc: float, jcs: float, pressure: float, stiffness: float, peak_slip: float
) -> np.ndarray:
    """(n,) m: dilation of a rough joint that slides by ``slip`` (n,) m beyond its peak against a wall of ``stiffness``
    Pa/m, from the initial ``pressure`` Pa on.

    dv/ds = tan(½ JRC_mob log₁₀(JCS/σ)), σ = σ₀ + K v (Barton & Choubey 1977 eq. 11; decay of JRC by Barton, Bandis &
    Bakhtar 1985), integrated by a Runge–Kutta method of order 8.
    """
    from scipy.integrate import solve_ivp

    def rate(s, v):
        mobilised = jrc * np.interp(1 + s / peak_slip, [1, 2, 4, 10, 25, 100], [1, 0.85, 0.7, 0.5, 0.4, 0])
        return np.tan(np.radians(0.5 * mobilised * np.log10(jcs / (pressure + stiffness * v))))

    run = solve_ivp(rate, (0.0, float(slip[-1])), [0.0], "DOP853", t_eval=slip, rtol=1e-10, atol=1e-14, max_step=2e-4)
    return run.y[0]
