"""Helper functions for drawing: rectangles, and cracks by centre, length and angle."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np


def rectangle(x0: float, y0: float, x1: float, y1: float) -> np.ndarray:
    """(4, 2) corners of the rectangle between two opposite corners, counter-clockwise from the lower left."""
    (left, right), (low, high) = sorted((x0, x1)), sorted((y0, y1))
    return np.array([[left, low], [right, low], [right, high], [left, high]], dtype=float)


def straight_crack(centre: Sequence[float], length: float, angle: float) -> np.ndarray:
    """(2, 2) ends of a crack of ``length`` (m) with this ``centre``, at ``angle`` (rad) counter-clockwise from x; it
    runs towards the end to which the angle points."""
    half = 0.5 * length * np.array([math.cos(angle), math.sin(angle)])
    point = np.asarray(centre, dtype=float)
    return np.array([point - half, point + half])
