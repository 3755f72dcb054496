"""Specimen with two cracks (Haeri et al. 2014): published values, and independently computed stress intensity factors.

Haeri, Shahriar, Fatehi Marji, Moarefvand (2014), "On the strength and crack propagation process of the pre-cracked
rock-like specimens under uniaxial compression", Strength of Materials 46, 140-152, tested and computed it; Khanizadeh
Bahabadi, Yarahmadi Bafghi, Fatehi Marji, Shahami, Abdollahipour (2023), "Coupling discontinuous deformation analysis
and displacement discontinuity method for simulating failure mechanism in geomaterials", Journal of Mining and
Environment, doi 10.22044/jme.2023.13538.2502, computed it again with DDA and DDM coupled (here: KB 2023).

Angles φ (degrees) are counted from crack 1, which stands at 45° to the horizontal; crack 1 is the upper one of two on
the specimen's axis, 20 mm apart, each 10 mm long.
"""

from __future__ import annotations

import numpy as np

#: The four specimens.
PHI_DEG = (0, 30, 60, 90)

#: KB 2023, Table 1 and §3.1: E, ν, uniaxial strength, toughness, load rate.
YOUNGS_MODULUS, POISSONS_RATIO, UNIAXIAL_STRENGTH, K_IC, LOAD_RATE = 17e9, 0.21, 28e6, 2e6, 0.2e6

#: Half the length of a crack, m.
HALF_LENGTH = 5e-3

#: KB 2023, Table 3: angle of the line of coalescence, degrees from the horizontal as slopes of fitted lines (φ = 90
#: was fitted with the axes exchanged: degrees from the vertical).
COALESCENCE_ANGLE_DEG = {
    "experiment": {0: -66.01, 30: 22.03, 60: -77.51, 90: 1.02},
    "KB 2023, DDA-DDM": {0: -69.17, 30: -69.08, 60: -68.03, 90: 0.25},
    "Haeri 2014, DDM": {0: -63.72, 30: -65.89, 60: -69.68, 90: -0.33},
}

#: KB 2023, Table 3: the experiment's lines as printed, y = slope · x + intercept, m from the specimen's lower left
#: corner.
COALESCENCE_LINE = {0: (-2.2476, 0.1397), 30: (0.4046, 0.0545), 60: (-4.5152, 0.1693), 90: (0.0178, 0.0294)}

#: The specimen's centre in those coordinates, m.
CENTRE = (0.030, 0.060)

#: Slope of the line from crack 1's lower tip to crack 2's nearer tip in the same reading; pure geometry.
TIP_TO_TIP_ANGLE_DEG = {0: -61.3, 30: -67.4, 60: -79.1, 90: 0.0}

#: KB 2023, Table 4: K_I and K_II of tips 1-4 in the first step of growth, MPa √m (magnitudes, as printed).
TABLE_4_K_I = {
    0: (0.7446, 0.653886, 0.676481, 0.70628),
    30: (0.78038, 0.710145, 0.0, 0.0),
    60: (1.12938, 1.04679, 0.0, 0.0),
    90: (0.72371, 0.64487, 0.816449, 0.726444),
}
TABLE_4_K_II = {
    0: (0.754628, 0.643411, 0.613789, 0.67096),
    30: (0.75525, 0.675427, 0.717474, 0.655737),
    60: (1.06537, 0.929959, 0.723031, 0.664009),
    90: (0.712308, 0.565902, 0.794558, 0.631245),
}

#: KB 2023, text to Figure 15: ranges of stress over the four specimens, MPa, computed and measured.
INITIATION_STRESS_MPA = {"KB 2023, computed": (2.24, 5.23), "experiment": (6.8, 12.7)}
COALESCENCE_STRESS_MPA = {"KB 2023, computed": (13.2, 16.8), "experiment": (17.8, 20.3)}

#: K/σ, MPa √m per MPa of compression, open slots before growth; computed with elements of order 8, converged to the
#: digits shown. Tips of crack 1 (lower left, upper right), then of crack 2 (from its −u to its +u end, u at 45° + φ).
OPEN_SLOT_K_I = {
    0: (-0.062592, -0.065498, -0.065498, -0.062592),
    90: (-0.059253, -0.061952, -0.061952, -0.059253),
}
OPEN_SLOT_K_II = {
    0: (-0.058550, -0.060707, -0.060707, -0.058550),
    90: (-0.060251, -0.060131, 0.060131, 0.060251),
}


def line_beside_centre(slope: float, intercept: float, exchanged: bool = False) -> tuple[float, float]:
    """(degrees from the horizontal, distance m from the specimen's centre) of the line y = slope · x + intercept or,
    with the axes ``exchanged``, x = slope · y + intercept."""
    (x, y), angle = CENTRE, float(np.degrees(np.arctan(slope)))
    if exchanged:
        (x, y), angle = (y, x), (90.0 - angle if slope > 0 else -90.0 - angle)
    return angle, float(abs(slope * x + intercept - y) / np.hypot(1.0, slope))


def crack_ends(phi_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Ends of crack 1 and crack 2, each (2, 2) from the −u to the +u end, m, with the origin at the specimen's centre."""

    def crack(centre_y: float, angle_deg: float) -> np.ndarray:
        u = HALF_LENGTH * np.array([np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))])
        return np.array([-u, u]) + [0.0, centre_y]

    return crack(10e-3, 45.0), crack(-10e-3, 45.0 + phi_deg)


def normalised_load(stress: float, k_ic: float = K_IC) -> float:
    """σ √(πb) / K_Ic: the load in units of the crack's own toughness, b half the crack's length."""
    return stress * np.sqrt(np.pi * HALF_LENGTH) / k_ic
