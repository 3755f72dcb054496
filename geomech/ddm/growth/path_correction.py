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
(1 − s) κ/(1 + s κ): s = 1 − 1/κ from κ = 2 on leaves 1/κ, and in the limit no shear at the end of a step (backward
Euler). κ falls with √Δa, so that fine steps have half the turn, and second order.

From step to step neither κ nor the path's turn changes much. So where κ is known the first trial has half of the turn
that the last step had between the tangents at its ends: on smooth paths it is off by tenths of a degree. κ then says
how far to correct it, mostly without another look (`Remembered`), and often what was tried is the step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...model import Cracks
from .tie_tolerance import ONE_WAY
from .tip_advance import Growth

#: A step that turns by more than this starts at a kink.
KINK = np.radians(20.0)
SMOOTH_SHARE, KINK_SHARE = 1 / 2, 2 / 3
#: A chord is good when its direction is off its condition by less than this: K_II of about 1 % of K_I.
TOLERANCE = np.radians(1.0)
#: From this κ on, paths are stiff: below, a single correction falls off from step to step.
STIFF = 2.0
#: A correction onward by less than this that nothing says is stiff is taken as it is; of a larger one a second look
#: tells whether it overshoots, which it does from the second figure for κ on. Steps of 1 mm along 140 MPa otherwise
#: bend by 17° for 6°, then back, and miss the load that drives them by 14 %.
SMOOTH, GENTLE = np.radians(4.2), 1.0
#: Looks ahead at most. Secants need two or three; what is left then is of the order of the tolerance.
LOOKS = 5
#: Bounds of the slope −1 − κ of the turn ahead over that of the chord. Beyond them two trials lie too close together to
#: tell it.
SLOPES = (-39.0, 0.0)
#: The largest κ that a first look is believed.
GUESSED = 8.0
#: By this part the slope may have changed since the last step, or since the last look: a correction by it is taken
#: unseen where what it may leave is within the tolerance.
CHANGED = 0.3
#: A trial that would be corrected by less than this is the step: what is left of K_II turns the next one, and spares it
#: the solution of another body. (Wings of the two-crack specimen in increments of 1, ½ and ¼ mm stay within 16, 10 and
#: 3 µm of those corrected down to 0.03°.)
AS_TRIED = np.radians(0.25)
#: A chord that turned on from its last trial by more than this tells the slope there.
TELLING = np.radians(0.5)
#: The chord lies between the first trial and the first correction, since the condition falls by at least as much as the
#: chord turns; by this part of their difference it may lie outside (tension along the crack, round-off).
OUTSIDE = 0.2


class Remembered(NamedTuple):
    """Of a tip's last step: ``kappa`` (nan: not known), the ``angle`` of its chord, the angle last ``tried`` before and
    the one that the criterion asked for at the end of that trial, ``ahead``, and at the start of the step, ``start``."""

    kappa: float
    angle: float
    tried: float
    ahead: float
    start: float

    def kappa_at(self, start: float) -> float:
        """κ now that the criterion asks for ``start`` at the end of the chord."""
        if abs(self.angle - self.tried) > TELLING:
            return -1 - float(np.clip((start - self.ahead) / (self.angle - self.tried), *SLOPES))
        return self.kappa


#: Place of a tip → what its last step has told.
Memory = dict[tuple[float, float], Remembered]


class Chords:
    """The directions of one growth step's chords, looked for tip by tip: the steps of all tips are tried together.

    With θ the angle of the chord, θ₀ that of the criterion at its start, a(θ) the one that the criterion asks for at
    its end and s the share of the turn, the condition is s (θ − θ₀ + a) = θ − θ₀, and a falls by 1 + κ times what θ
    turns.
    """

    def __init__(self, tips: np.ndarray, memory: Memory | None = None) -> None:
        self.start = tips["angle"].copy()
        #: κ by the last step, nan where it is not known, …
        self.kappa = np.full(len(tips), np.nan)
        #: … and the chords to begin with.
        self.first = self.start.copy()
        for row, point in enumerate(tips["point"].tolist() if memory else ()):
            last, start = memory.get(tuple(point)), float(self.start[row])
            if last is not None and abs(start) <= KINK:
                self.kappa[row] = last.kappa_at(start)
                # Without κ a first look is judged as one along the tangent: no other trial can be.
                if np.isfinite(self.kappa[row]) and max(abs(last.angle), abs(last.start)) <= KINK:
                    self.first[row] = start + SMOOTH_SHARE * (start - last.start + last.angle)
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
        known = np.isfinite(self.kappa)
        kappa, told = (
            (np.where(known, self.kappa, self._first_guess(turns)), known) if first else self._secant(turns, angle)
        )
        share = np.maximum(self.share, 1 - 1 / np.maximum(kappa, 1.0))
        rest = share * turns - (1 - share) * (angle - self.start)
        off = np.abs(rest) > TOLERANCE  # not where there is nothing ahead, nan
        seen = np.isfinite(rest)
        if first:
            # Faces that close make the condition jump; secants must not run away across the jump.
            ends = np.stack([angle - OUTSIDE * rest, angle + (1 + OUTSIDE) * rest])
            self.lowest, self.highest = (
                np.nanmin(ends, axis=0, initial=np.inf),
                np.nanmax(ends, axis=0, initial=-np.inf),
            )
        left = np.abs(rest) * share * CHANGED * np.maximum(1 + kappa, 1.0) / (1 + share * kappa)
        tips["angle"][seen] = np.clip(angle + rest / (1 + share * kappa), self.lowest, self.highest)[seen]
        if first:
            # A first look that turns on a little, the way the trial did, needs no second one: the path is smooth.
            straight = np.abs(self.start) < ONE_WAY
            self.onward = (straight | (rest * self.start >= 0)) & seen & ~known
            self.whole = angle + self.share * turns
            smooth = self.onward & (np.abs(rest) < SMOOTH) & (kappa < STIFF)
            unsettled = off & ~np.where(known, left <= TOLERANCE, smooth)
            # … and says so: the next trial has half a turn, which is right where no trial is corrected (`AS_TRIED`).
            # A path that goes straight on tells nothing.
            told = known | (smooth & ~(straight & (np.abs(turns) < ONE_WAY)))
        else:
            unsettled = off & (left > TOLERANCE)
            if self.looks == 2:
                # Nor is a large turn stiff for its size alone: then the first correction was right, the whole of it.
                gentle = self.onward & (kappa < GENTLE)
                tips["angle"][gentle], unsettled = self.whole[gentle], unsettled & ~gentle
        self.last_angle, self.last_turns = angle, turns
        self.kappa = np.where(told, kappa, np.nan)
        if (np.abs(tips["angle"] - angle)[seen] <= AS_TRIED).all():
            tips["angle"] = angle
            return True
        return self.looks == LOOKS or not unsettled.any()

    def remember(self, memory: Memory, tips: np.ndarray, growth: Growth, cycle: int) -> None:
        """Keep in ``memory`` what the steps that were taken have told, at their ends."""
        ends = _new_ends(tips, growth.grown, growth.cracks, cycle)
        told = np.stack([self.kappa, tips["angle"], self.last_angle, self.last_turns, self.start], axis=1).tolist()
        for point, end, step in zip(tips["point"].tolist(), ends, told):
            if end >= 0:
                memory.pop(tuple(point), None)
                memory[tuple(growth.cracks.nodes[end].tolist())] = Remembered(*step)

    def _first_guess(self, turns: np.ndarray) -> np.ndarray:
        """κ by the turn ahead of a trial along the tangent: on a smooth path, from half a turn before the tip, it is 2
        + κ times that; of a zigzag about a straight line −κ times. 0 where that is not stiff; kinks do not tell, nor
        does a path that goes straight on."""
        turns = np.where(np.maximum(np.abs(turns), np.abs(self.start)) < ONE_WAY, np.nan, turns)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = turns / self.start
        kappa = np.minimum(np.where(ratio > 0, ratio - 2, -ratio), GUESSED)
        return np.where((kappa >= STIFF) & (np.abs(self.start) <= KINK), kappa, 0.0)

    def _secant(self, turns: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """κ by the last two looks, and whether (n_tips,) it is known; as it was where they are too near to one another
        to tell, and 0 where it was not known."""
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = (turns - self.last_turns) / (angle - self.last_angle)
        known = np.isfinite(self.kappa)
        tells = np.isfinite(slope) & (np.abs(angle - self.last_angle) > np.where(known, TELLING, ONE_WAY))
        return np.where(tells, -1 - np.clip(slope, *SLOPES), np.where(known, self.kappa, 0.0)), known | tells


def corrected(
    tips: np.ndarray,
    grow: Callable[[], Growth],
    look_ahead: Callable[[Cracks], np.ndarray],
    cycle: int,
    correct: bool = True,
    memory: Memory | None = None,
) -> Growth | None:
    """One growth step of all driven tips along chords; None when no tip moves. Sets the angles that were followed.

    ``tips``: TIP rows with the criterion's ``angle`` and ``k_eq``; ``grow()`` advances them as they then stand, in
    segments of birth ``cycle``; ``look_ahead(cracks)`` solves the tried network and returns its TIP rows with their
    angles. Without ``correct`` the criterion's angles are followed as they are. ``memory``: of the last steps, brought
    up to date.
    """
    chords = Chords(tips, memory)
    if correct:
        tips["angle"] = chords.first
    growth = grow()
    settled = not correct
    # A step that joins something may cut a piece off, on which there is nothing to solve.
    while not settled and not growth.joins and np.any(growth.grown > 0):
        angle = tips["angle"].copy()
        settled = chords.bend(tips, growth.grown, look_ahead(growth.cracks), growth.cracks, cycle)
        if np.array_equal(angle, tips["angle"]):
            break  # as it was tried
        tried, growth = growth, grow()
        stuck = (tried.grown > 0) & (growth.grown == 0)
        if stuck.any():
            # Bent, a step would not leave its tip; the criterion's own direction does.
            tips["angle"][stuck] = chords.start[stuck]
            growth = grow()
    if memory is not None and correct:
        chords.remember(memory, tips, growth, cycle)
    return growth if np.any(growth.grown > 0) or growth.joins else None


def _turns_ahead(tips: np.ndarray, grown: np.ndarray, ahead: np.ndarray, cracks: Cracks, cycle: int) -> np.ndarray:
    """(n_tips,) the angle that the criterion gives at the end of each tip's new segment; nan where there is no tip."""
    turn_at = {int(tip["node"]): float(tip["angle"]) for tip in ahead}
    return np.array([turn_at.get(node, np.nan) for node in _new_ends(tips, grown, cracks, cycle)])


def _new_ends(tips: np.ndarray, grown: np.ndarray, cracks: Cracks, cycle: int) -> list[int]:
    """The nodes in which the tips' new segments end, of birth ``cycle``; −1 where there is none."""
    ends = [-1] * len(tips)
    new = np.flatnonzero(cracks.birth_cycle == cycle)
    at = cracks.nodes[cracks.segments[new]]  # (n, 2 ends, 2)
    for row in np.flatnonzero(grown > 0):
        starts = np.argwhere((at == tips["point"][row]).all(axis=2))
        if len(starts) == 1:
            segment, end = starts[0]
            ends[row] = int(cracks.segments[new[segment], 1 - end])
    return ends
