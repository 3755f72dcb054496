"""Curved crack paths from straight steps: predict, look ahead, bend.

A step along the tangent at its start errs by the turn that the path makes within it. The chord of a smooth path leaves
its start at half the turn between the tangents at its ends, so a step is tried, the criterion is asked where it would
go on, and the step is taken again, bent: second order in the increment. Out of a sharp kink a path starts like
y ∝ x^(3/2) (Amestoy & Leblond 1992), whose chord has two thirds of the turn.

Compression σ along a crack makes this stiff. A step that leaves its line by ω meets a shear of its own of about
σ ω √(πΔa), so that the turn the criterion asks for next falls by more than ω: by (1 + κ) ω, κ ~ |σ| √(πΔa) / K_I. This
is what holds wing cracks to the line of the load (Cotterell & Rice 1980). From κ = 2 on, a single correction throws
back as far as the trial went out, and a crack would go straight on with any K_II. So where the look ahead turns
back against the trial, the condition on the chord is solved, not corrected once: an implicit rule, stable for all κ.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..model import Cracks
from .growth import Growth

#: A step that turns by more than this starts at a kink.
KINK = np.radians(20.0)
SMOOTH_SHARE, KINK_SHARE = 1 / 2, 2 / 3
#: A chord is good when its direction is off its condition by less than this: K_II of about 1 % of K_I.
TOLERANCE = np.radians(1.0)
#: A correction onward by less than this is taken as it is; of a larger one a second look tells whether it overshoots, which it does
#: where the slope of the condition (see `SLOPES`) is below the second figure. Steps of 1 mm along 140 MPa otherwise bend by 17°
#: for 6°, then back, and miss the load that drives them by 14 %.
SMOOTH, GENTLE = np.radians(4.2), -1.5
#: Looks ahead at most. Secants need two or three; what is left then is of the order of the tolerance.
LOOKS = 5
#: Bounds of the slope of the condition: −1 − κ times the share, for no stress along the crack −1. Beyond them two trials
#: lie too close together to tell it.
SLOPES = (-20.0, -0.5)
#: The chord lies between the first trial and the first correction, since the condition falls by at least as much as the
#: chord turns; by this part of their difference it may lie outside (tension along the crack, round-off).
OUTSIDE = 0.2


class Chords:
    """The directions of one growth step's chords, looked for tip by tip: the steps of all tips are tried together.

    With θ the angle of the chord, θ₀ that of the criterion at its start, a(θ) the one that the criterion asks for at
    its end and s the share of the turn, the condition is s (θ − θ₀ + a) = θ − θ₀.
    """

    def __init__(self, tips: np.ndarray) -> None:
        self.start = tips["angle"].copy()
        self.share = np.where(np.abs(self.start) > KINK, KINK_SHARE, SMOOTH_SHARE)
        self.looks = 0
        self.onward = np.zeros(len(tips), bool)
        self.last_angle = np.full(len(tips), np.nan)
        self.last_rest = np.full(len(tips), np.nan)
        self.lowest = np.full(len(tips), -np.inf)
        self.highest = np.full(len(tips), np.inf)

    def bend(self, tips: np.ndarray, grown: np.ndarray, ahead: np.ndarray, cracks: Cracks, cycle: int) -> bool:
        """Better ``tips["angle"]`` of the tips that have ``grown`` (n_tips,); True when no further look is needed.

        ``ahead``: TIP rows of the tried network ``cracks`` with their growth angles; its segments of birth ``cycle``
        are the steps that were tried.
        """
        self.looks += 1
        turns = _turns_ahead(tips, grown, ahead, cracks, cycle)
        angle = tips["angle"].copy()
        rest = self.share * turns - (1 - self.share) * (angle - self.start)
        off = np.abs(rest) > TOLERANCE  # not where there is nothing ahead, nan
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = (rest - self.last_rest) / (angle - self.last_angle)
        slope = np.where(np.isfinite(slope), np.clip(slope, *SLOPES), -1.0)
        known = np.isfinite(rest)
        first = self.looks == 1
        if first:
            # Faces that close make the condition jump; secants must not run away across the jump.
            ends = np.stack([angle - OUTSIDE * rest, angle + (1 + OUTSIDE) * rest])
            self.lowest, self.highest = (
                np.nanmin(ends, axis=0, initial=np.inf),
                np.nanmax(ends, axis=0, initial=-np.inf),
            )
        tips["angle"][known] = np.clip(angle - rest / slope, self.lowest, self.highest)[known]
        # A first look that turns on a little, the way the trial did, needs no second one: the path is smooth.
        onward = rest * self.start >= 0
        unsettled = off & ~(onward & (np.abs(rest) < SMOOTH)) if first else off
        if first:
            self.onward = onward
        elif self.looks == 2:
            # Nor is a large turn stiff for its size alone: then the first correction was right.
            gentle = self.onward & (slope > GENTLE)
            tips["angle"][gentle], unsettled = angle[gentle], unsettled & ~gentle
        self.last_angle, self.last_rest = angle, rest
        return self.looks == LOOKS or not unsettled.any()


def corrected(
    tips: np.ndarray,
    grow: Callable[[], Growth],
    look_ahead: Callable[[Cracks], np.ndarray],
    cycle: int,
    correct: bool = True,
) -> Growth | None:
    """One growth step of all driven tips along chords; None when no tip moves. Sets the angles that were followed.

    ``tips``: TIP rows with the criterion's ``angle`` and ``k_eq``; ``grow()`` advances them as they then stand, in segments
    of birth ``cycle``; ``look_ahead(cracks)`` solves the tried network and returns its TIP rows with their angles. Without
    ``correct`` the criterion's angles are followed as they are.
    """
    growth = grow()
    chords = Chords(tips)
    settled = not correct
    # A step that joins something may cut a piece off, on which there is nothing to solve.
    while not settled and not growth.joins and np.any(growth.grown > 0):
        settled = chords.bend(tips, growth.grown, look_ahead(growth.cracks), growth.cracks, cycle)
        tried, growth = growth, grow()
        stuck = (tried.grown > 0) & (growth.grown == 0)
        if stuck.any():
            # Bent, a step would not leave its tip; the criterion's own direction does.
            tips["angle"][stuck] = chords.start[stuck]
            growth = grow()
    return growth if np.any(growth.grown > 0) or growth.joins else None


def _turns_ahead(tips: np.ndarray, grown: np.ndarray, ahead: np.ndarray, cracks: Cracks, cycle: int) -> np.ndarray:
    """(n_tips,) the angle that the criterion gives at the end of each tip's new segment; nan where there is no tip."""
    turns = np.full(len(tips), np.nan)
    new = np.flatnonzero(cracks.birth_cycle == cycle)
    turn_at = {int(tip["node"]): float(tip["angle"]) for tip in ahead}
    at = cracks.nodes[cracks.segments[new]]  # (n, 2 ends, 2)
    for row in np.flatnonzero(grown > 0):
        starts = np.argwhere((at == tips["point"][row]).all(axis=2))
        if len(starts) == 1:
            segment, end = starts[0]
            turns[row] = turn_at.get(int(cracks.segments[new[segment], 1 - end]), np.nan)
    return turns
