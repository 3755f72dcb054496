"""Result of the open–close iteration: consistent contact states, forces, gaps and slips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..joint_laws.penalty_springs import Springs


@dataclass(frozen=True, eq=False)
class Settled:
    """A consistent set of contact states and its solution; ``unknowns`` (n_free, 6) scaled as in `assembly`.

    In m: ``gap`` including dilation; ``slip``: motion along the edge minus the elastic motion of the shear spring;
    ``lifted``: dilation by it; ``stretch``: motion of sticking contacts that multipliers have not removed yet.
    ``springs``: those of the final iteration.
    """

    unknowns: np.ndarray
    state: np.ndarray
    direction: np.ndarray
    bonded: np.ndarray
    normal_force: np.ndarray
    shear_force: np.ndarray
    gap: np.ndarray
    slip: np.ndarray
    lifted: np.ndarray
    springs: Springs
    iterations: int
    stretch: np.ndarray | float = 0.0
