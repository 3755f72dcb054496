"""Closed-form statistics of joint networks: Fisher distribution, traces of discs on a plane, Poisson lines."""

from __future__ import annotations

import numpy as np


def fisher_mean_resultant(concentration: float) -> float:
    """Length of the mean of unit vectors with Fisher's distribution, coth κ − 1/κ (Fisher 1953, Proc. R. Soc. A 217,
    295)."""
    return 1.0 / np.tanh(concentration) - 1.0 / concentration


def trace_length_of_discs(length: np.ndarray, diameter: float) -> np.ndarray:
    """Fraction of traces not longer than ``length`` m in a plane section of randomly located discs of one ``diameter``
    m: 1 − √(1 − (l/D)²) (Warburton 1980, Int. J. Rock Mech. Min. Sci. 17, 33: density l / (D √(D² − l²)))."""
    return 1.0 - np.sqrt(1.0 - np.clip(np.asarray(length, dtype=float) / diameter, 0.0, 1.0) ** 2)


def trace_length_moments(diameter_moments: tuple[float, float, float]) -> tuple[float, float]:
    """(mean m, mean square m²) of the traces of discs with E[D], E[D²], E[D³] = ``diameter_moments``: π/4 E[D²]/E[D]
    and 2/3 E[D³]/E[D], because larger discs are intersected more often (Warburton 1980)."""
    first, second, third = diameter_moments
    return 0.25 * np.pi * second / first, 2.0 / 3.0 * third / first


def cells_of_poisson_lines(length_per_area: float) -> dict[str, float]:
    """Means of the cells between Poisson lines of all directions, P21 = τ: area π/τ² m², perimeter 2π/τ m, sides 4
    (Miles 1964, Proc. Natl. Acad. Sci. 52, 901; Santaló 1976)."""
    return {"area": np.pi / length_per_area**2, "perimeter": 2 * np.pi / length_per_area, "sides": 4.0}


def scan_line_spacing(distance: np.ndarray, per_length: float) -> np.ndarray:
    """Fraction of spacings along a scan-line not larger than ``distance`` m for randomly placed traces: exponential
    (Priest & Hudson 1976, Int. J. Rock Mech. Min. Sci. 13, 135)."""
    return 1.0 - np.exp(-per_length * np.asarray(distance, dtype=float))
