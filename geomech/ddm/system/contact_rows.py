"""How contact of crack faces changes the equations of the crack unknowns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Rows:
    """How contact changes the equations S w = right. Unknowns that are ``prescribed`` (n,) bool are zero and have no
    equation; ``mixed`` (n,) times the equation across a node is added to that along it, ``per`` places before;
    ``spring`` (n,) is taken off the diagonal."""

    prescribed: np.ndarray
    mixed: np.ndarray
    spring: np.ndarray
    per: int
