"""Curved crack paths from straight steps: predict, look ahead, bend.

A step along the tangent at its start errs by the turn that the path makes within it. The chord of a smooth path leaves
its start at half the turn between the tangents at its ends, so a step is tried, the criterion is asked where it would
go on, and the step is taken again, bent: second order in the increment. Out of a sharp kink a path starts like
y ∝ x^(3/2) (Amestoy & Leblond 1992), whose chord has two thirds of the turn.

Compression σ along a crack makes this stiff. A step that leaves its line by ω meets a shear of its own of about
σ ω √(πΔa), so that the turn the criterion asks for next falls by more than ω: by (1 + κ) ω, κ ~ |σ| √(πΔa) / K_I. This
is what holds wing cracks to the line of the load (Cotterell & Rice 1980). From κ = 2 on, a single correction throws
back as far as the trial went out, and a crack would go straight on with any K_II. So the condition on the chord is
solved, not corrected once, where the look ahead says that it is stiff.

A chord that has half of the turn is the trapezoidal rule: stable for all κ, but what one step leaves over comes back in
the next with the other sign, κ/(2 + κ) of it, and stiff paths zigzag for long. With the share s of the turn it is
(1 − s) κ/(1 + s κ): s = 1 − 1/κ from κ = 2 on leaves 1/κ, and in the limit no shear at the end of a step (backward Euler).
κ falls with √Δa, so that fine steps have half the turn, and second order.
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
#: From this κ on, paths are stiff: below, a single correction falls off from step to step.
STIFF = 2.0
#: A correction onward by less than this that nothing says is stiff is taken as it is; of a larger one a second look tells
#: whether it overshoots, which it does from the second figure for κ on. Steps of 1 mm along 140 MPa otherwise bend by 17°
#: for 6°, then back, and miss the load that drives them by 14 %.
SMOOTH, GENTLE = np.radians(4.2), 1.0
#: Looks ahead at most. Secants need two or three; what is left then is of the order of the tolerance.
LOOKS = 5
#: Bounds of the slope −1 − κ of the turn ahead over that of the chord. Beyond them two trials lie too close together to tell it.
SLOPES = (-39.0, 0.0)
#: The largest κ that a first look is believed.
GUESSED = 8.0
#: The chord lies between the first trial and the first correction, since the condition falls by at least as much as the
#: chord turns; by this part of their difference it may lie outside (tension along the crack, round-off).
OUTSIDE = 0.2


class Chords:
    """The directions of one growth step's chords, looked for tip by tip: the steps of all tips are tried together.

    With θ the angle of the chord, θ₀ that of the criterion at its start, a(θ) the one that the criterion asks for at
    its end and s the share of the turn, the condition is s (θ − θ₀ + a) = θ − θ₀, and a falls by 1 + κ times what θ turns.
    """

    def __init__(self, tips: np.ndarray) -> None:
        self.start = tips["angle"].copy()
        self.share = np.where(np.abs(self.start) > KINK, KINK_SHARE, SMOOTH_SHARE)
        self.looks = 0
        self.onward = np.zeros(len(tips), bool)
        self.whole = self.start
        self.last_angle = np.full(len(tips), np.nan)
        self.last_turns = np.full(len(tips), np.nan)
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
        first = self.looks == 1
        kappa = self._first_guess(turns) if first else self._secant(turns, angle)
        share = np.maximum(self.share, 1 - 1 / np.maximum(kappa, 1.0))
        rest = share * turns - (1 - share) * (angle - self.start)
        off = np.abs(rest) > TOLERANCE  # not where there is nothing ahead, nan
        known = np.isfinite(rest)
        if first:
            # Faces that close make the condition jump; secants must not run away across the jump.
            ends = np.stack([angle - OUTSIDE * rest, angle + (1 + OUTSIDE) * rest])
            self.lowest, self.highest = (
                np.nanmin(ends, axis=0, initial=np.inf),
                np.nanmax(ends, axis=0, initial=-np.inf),
            )
        tips["angle"][known] = np.clip(angle + rest / (1 + share * kappa), self.lowest, self.highest)[known]
        if first:
            # A first look that turns on a little, the way the trial did, needs no second one: the path is smooth.
            self.onward = rest * self.start >= 0
            self.whole = angle + self.share * turns
            unsettled = off & ~(self.onward & (np.abs(rest) < SMOOTH) & (kappa < STIFF))
        elif self.looks == 2:
            # Nor is a large turn stiff for its size alone: then the first correction was right, the whole of it.
            gentle = self.onward & (kappa < GENTLE)
            tips["angle"][gentle], unsettled = self.whole[gentle], off & ~gentle
        else:
            unsettled = off
        self.last_angle, self.last_turns = angle, turns
        return self.looks == LOOKS or not unsettled.any()

    def _first_guess(self, turns: np.ndarray) -> np.ndarray:
        """κ by the turn ahead of a trial along the tangent: on a smooth path, from half a turn before the tip, it is 2 + κ
        times that; of a zigzag about a straight line −κ times. 0 where that is not stiff; kinks do not tell."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = turns / self.start
        kappa = np.minimum(np.where(ratio > 0, ratio - 2, -ratio), GUESSED)
        return np.where((kappa >= STIFF) & (np.abs(self.start) <= KINK), kappa, 0.0)

    def _secant(self, turns: np.ndarray, angle: np.ndarray) -> np.ndarray:
        """κ by the last two looks."""
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = (turns - self.last_turns) / (angle - self.last_angle)
        return np.where(np.isfinite(slope), -1 - np.clip(slope, *SLOPES), 0.0)


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
