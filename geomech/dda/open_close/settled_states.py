"""What the open–close iteration ends with: consistent contact states, forces, gaps and slips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..joint_laws.penalty_springs import Springs


@dataclass(frozen=True, eq=False)
class Settled:
    """A consistent set of contact states and what goes with it; ``unknowns`` (n_free, 6) scaled as in `assembly`.

    ``gap`` is counted from where the faces meet, ``slip`` is what the shear spring did not take up of the motion along
    the edge, ``lifted`` what it added to the lift (all m); ``springs`` those of the final iteration; ``stretch`` what
    multipliers have left of the motion of sticking contacts.
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
