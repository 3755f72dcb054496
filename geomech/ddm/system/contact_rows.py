"""How contact of crack faces changes the crack equations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Rows:
    """Contact as a change of the equations S w = right. ``prescribed`` (n,) bool: unknowns with a given value and no
    equation; ``mixed`` (n,): at the index of a node's tangential equation, the factor by which its normal equation,
    ``per`` rows later, is added to it (friction); ``spring`` (n,): subtracted from the diagonal."""

    prescribed: np.ndarray
    mixed: np.ndarray
    spring: np.ndarray
    per: int
