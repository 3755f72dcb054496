"""Changes of the crack equations by contact of the crack faces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Rows:
    """Contact as a change of the equations S w = right. ``prescribed`` (n,) bool: unknowns with a given value and no
    equation; ``mixed`` (n,): factor with which the equation across a node is added to that along it, ``per`` places
    before; ``spring`` (n,): subtracted from the diagonal."""

    prescribed: np.ndarray
    mixed: np.ndarray
    spring: np.ndarray
    per: int
