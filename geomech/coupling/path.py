"""Curved crack paths from straight steps: predict, look ahead, bend.

A step taken along the tangent at its start errs by the turn that the path makes within it, and zigzags about a path
that it overshoots. The chord of a smooth path leaves its start at half the turn, so once the step has been tried and
the criterion asked where it would go on, the step is taken again bent by half of that: second order in the increment.
Out of a sharp kink a path starts like y ∝ x^(3/2) (Amestoy & Leblond 1992), whose chord has two thirds of the turn.
"""

from __future__ import annotations

import numpy as np

from ..model import Cracks

#: A step that turns by more than this starts at a kink.
KINK = np.radians(20.0)
SMOOTH_SHARE, KINK_SHARE = 1 / 2, 2 / 3


def bend_paths(tips: np.ndarray, grown: np.ndarray, ahead: np.ndarray, cracks: Cracks, cycle: int) -> None:
    """Set ``tips["angle"]`` of the tips that have ``grown`` (n_tips,) to that of their chords.

    ``ahead``: TIP rows of the predicted network ``cracks`` with their growth angles; its segments of birth ``cycle``
    are the steps that were tried.
    """
    new = np.flatnonzero(cracks.birth_cycle == cycle)
    turn_at = {int(tip["node"]): float(tip["angle"]) for tip in ahead}
    for row in np.flatnonzero(grown > 0):
        at = cracks.nodes[cracks.segments[new]]  # (n, 2 ends, 2)
        starts = np.argwhere((at == tips["point"][row]).all(axis=2))
        if len(starts) != 1:
            continue
        segment, end = starts[0]
        turn = turn_at.get(int(cracks.segments[new[segment], 1 - end]))
        if turn is not None:
            share = KINK_SHARE if abs(tips["angle"][row]) > KINK else SMOOTH_SHARE
            tips["angle"][row] += share * turn
