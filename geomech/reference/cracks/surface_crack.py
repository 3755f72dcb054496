"""A pressurised crack parallel to a free surface: K_I and K_II of the thin-layer limit (Hutchinson & Suo 1992)."""

from __future__ import annotations

import math

import numpy as np

#: Phase angle ω, rad, of the stress intensity factors due to bending of a thin layer on a half-space of the same
#: material (Hutchinson & Suo 1992, Advances in Applied Mechanics 29; no elastic mismatch).
FILM_ANGLE = math.radians(52.07)


def thin_layer(half_length: float, depth: float, pressure: float) -> np.ndarray:
    """(2,) |K_I|, |K_II| of a crack that is much longer than deep: the layer above it is a plate clamped at the tips,
    where the moment pa²/3 causes K = √6 M h^(−3/2) (sin ω, cos ω) (Hutchinson & Suo 1992).

    The clamp is slightly compliant: corrections are of order h/a.
    """
    size = math.sqrt(6) * pressure * half_length**2 / 3 * depth**-1.5
    return size * np.array([math.sin(FILM_ANGLE), math.cos(FILM_ANGLE)])
