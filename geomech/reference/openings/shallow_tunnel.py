"""A circular hole below a free surface: closed forms for internal pressure, and a series for any load (Mindlin 1940).

The potentials of the whole plane outside the circle, in powers of 1/(z − z₀) and with the logarithms of the resultant
force on the hole, are continued through the surface (Muskhelishvili 1953, §§ 92–93), so that it is traction-free for
any coefficients. The coefficients are fitted to the tractions on the circle by least squares; the error decreases
geometrically with the number of terms. Radius 1, rock in y < 0, centre of the hole at (0, −depth).
"""

from __future__ import annotations

import math

import numpy as np


def surface_stress(x: np.ndarray, depth: float, pressure: float = 1.0) -> np.ndarray:
    """σ_xx at the surface above a hole with internal ``pressure`` (Jeffery 1920): 4p (d² − 1 − x²)/(d² − 1 + x²)²."""
    q = depth**2 - 1
    return 4 * pressure * (q - np.asarray(x) ** 2) / (q + np.asarray(x) ** 2) ** 2


def wall_stress(angle: np.ndarray, depth: float, pressure: float = 1.0) -> np.ndarray:
    """Hoop stress on the wall of the same hole at ``angle`` from the upward direction, seen from its centre: p (1 + 2
    tan²β), with β the angle, at the surface point above the centre, between the downward direction and the point
    (Jeffery 1920; Timoshenko & Goodier 1951, §66)."""
    return pressure * (1 + 2 * (np.sin(angle) / (depth - np.cos(angle))) ** 2)


def in_situ(points: np.ndarray, weight: float, k0: float, along: float) -> np.ndarray:
    """(n, 3) stress of the intact ground: σ_yy = weight · y, σ_xx = k0 σ_yy + ``along``."""
    y = np.asarray(points)[:, 1]
    return np.column_stack([k0 * weight * y + along, weight * y, 0 * y])


def stress(
    points: np.ndarray,
    depth: float,
    weight: float = 0.0,
    k0: float = 0.0,
    along: float = 0.0,
    pressure: float = 0.0,
    poissons_ratio: float = 0.25,
    terms: int = 60,
) -> np.ndarray:
    """(n, 3) stress at ``points`` (n, 2) around the hole in ground of unit ``weight`` with ``k0`` and a stress
    ``along`` the surface, with ``pressure`` in the hole. It depends on Poisson's ratio because the resultant force on
    the hole is not zero: it is the weight of the excavated ground."""
    angle = 2 * math.pi * (np.arange(6 * terms) + 0.5) / (6 * terms)
    wall = np.column_stack([np.cos(angle), np.sin(angle) - depth])
    turn = (1j * np.exp(1j * angle)) ** 2
    xx, yy, xy = in_situ(wall, weight, k0, along).T
    right = -pressure - ((xx + yy) / 2 + turn * ((yy - xx) / 2 + 1j * xy))
    kappa = 3 - 4 * poissons_ratio
    lift = 1j * weight * math.pi / (2 * math.pi * (1 + kappa))
    known = _fields(wall, depth, [(-lift, kappa * np.conj(lift), 0)])[0]
    right = right - (known[0] + turn * known[1])
    sources = [pair for k in range(1, terms + 1) for c in (1.0, 1j) for pair in ((c, 0.0, k), (0.0, c, k))]
    columns = np.array([half + turn * rest for half, rest in _fields(wall, depth, sources)]).T
    whole = np.concatenate([columns.real, columns.imag])
    size = np.linalg.norm(whole, axis=0)
    found = np.linalg.lstsq(whole / size, np.concatenate([right.real, right.imag]), rcond=1e-15)[0] / size
    parts = _fields(points, depth, [(-lift, kappa * np.conj(lift), 0), *sources])
    half, rest = (sum(c * part[j] for c, part in zip([1.0, *found], parts)) for j in (0, 1))
    return in_situ(points, weight, k0, along) + np.column_stack([half - rest.real, half + rest.real, rest.imag])


def _fields(points: np.ndarray, depth: float, sources: list) -> list[tuple[np.ndarray, np.ndarray]]:
    """Half the trace and (σyy − σxx)/2 + i σxy at ``points`` of φ₀ = a g, ψ₀ = b g, for (a, b, k) in ``sources``, with
    the contribution that makes the surface traction-free; g = (z − z₀)^−k, or log(z − z₀) if k is zero."""
    z = np.asarray(points) @ np.array([1.0, 1j])

    def powers(w: np.ndarray, k: int) -> list[np.ndarray]:
        """g', g'', g'''."""
        if k == 0:
            return [1 / w, -1 / w**2, 2 / w**3]
        return [-k * w ** (-k - 1), k * (k + 1) * w ** (-k - 2), -k * (k + 1) * (k + 2) * w ** (-k - 3)]

    out = []
    for a, b, k in sources:
        d, dd, _ = powers(z + 1j * depth, k)
        e, ee, eee = (np.conj(g) for g in powers(np.conj(z) + 1j * depth, k))
        a_bar, b_bar = np.conj(a), np.conj(b)
        first = -a_bar * e - z * a_bar * ee - b_bar * e
        second = -2 * a_bar * ee - z * a_bar * eee - b_bar * ee
        rest = np.conj(z) * (a * dd + second) + b * d - a_bar * e - first - z * second
        out.append((2 * (a * d + first).real, rest))
    return out
