"""A pressurised crack parallel to a free surface: K_I and K_II of the thin-layer limit (Hutchinson & Suo 1992)."""

from __future__ import annotations

import math

import numpy as np

#: Angle between what bends a thin layer off a half-space of the same material and the stress intensities it makes, rad
#: (Hutchinson & Suo 1992, Advances in Applied Mechanics 29; no mismatch).
FILM_ANGLE = math.radians(52.07)


def thin_layer(half_length: float, depth: float, pressure: float) -> np.ndarray:
    """(2,) |K_I|, |K_II| of a crack much longer than it is deep: the layer above is a plate clamped at the tips, where
    the moment pa²/3 makes K = √6 M h^(−3/2) (sin ω, cos ω) (Hutchinson & Suo 1992).

    The clamp yields a little: corrections are of order h/a.
    """
    size = math.sqrt(6) * pressure * half_length**2 / 3 * depth**-1.5
    return size * np.array([math.sin(FILM_ANGLE), math.cos(FILM_ANGLE)])
