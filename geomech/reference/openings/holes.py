"""Stress around a circular hole in an infinite plate (Kirsch 1898; Lamé 1852)."""

from __future__ import annotations

import numpy as np


def kirsch_stress(points: np.ndarray, remote: np.ndarray, radius: float = 1.0, pressure: float = 0.0) -> np.ndarray:
    """(n, 3) stress at ``points`` (n, 2) around a hole centred at the origin under ``remote`` (3,) stress and internal
    ``pressure``.

    Kirsch (1898), as in Jaeger, Cook & Zimmerman (2007), eqs. 8.103–8.105; pressure after Lamé (1852).
    """
    x, y = np.asarray(points, dtype=float).T
    r2 = x * x + y * y
    k, c2, s2 = radius**2 / r2, (x * x - y * y) / r2, 2 * x * y / r2
    mean, half, shear = 0.5 * (remote[0] + remote[1]), 0.5 * (remote[0] - remote[1]), remote[2]
    along, across = half * c2 + shear * s2, shear * c2 - half * s2
    rr = mean * (1 - k) + along * (1 - 4 * k + 3 * k * k) - pressure * k
    tt = mean * (1 + k) - along * (1 + 3 * k * k) + pressure * k
    rt = across * (1 + 2 * k - 3 * k * k)
    isotropic, dev = 0.5 * (rr + tt), 0.5 * (rr - tt)
    return np.column_stack([isotropic + dev * c2 - rt * s2, isotropic - dev * c2 + rt * s2, dev * s2 + rt * c2])
