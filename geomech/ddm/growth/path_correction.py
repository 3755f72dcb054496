"""Curved crack paths from straight steps: trial step, criterion at its end, corrected step.

A step along the tangent at its start errs by the turn of the path within it. The chord of a smooth path deviates from
the tangent at its start by half the turn between the tangents at its ends. So a trial step is made, the criterion is
evaluated at its end, and the step is repeated in a corrected direction: second order in the increment. From a sharp
kink a path starts as y ∝ x^(3/2) (Amestoy & Leblond 1992), whose chord has two thirds of the turn.

Compression σ along a crack makes this stiff. A step at an angle ω to the path has a shear of its own of about σ ω
√(πΔa), so that the turn given by the criterion at its end falls by (1 + κ) ω, κ ~ |σ| √(πΔa) / K_I. This effect keeps
wing cracks in the direction of the load (Cotterell & Rice 1980). From κ = 2 on, a single correction overshoots by as
much as the trial was off, and a crack would run straight on for any K_II. There the condition for the chord is solved
by a secant iteration.

The share s = 1/2 of the turn is the trapezoidal rule: stable for all κ, but the error of one step returns in the next
with the other sign and the factor κ/(2 + κ), so that stiff paths zigzag. In general the factor is (1 − s) κ/(1 + s κ).
From κ = 2 on, s = 1 − 1/κ leaves 1/κ, and in the limit no shear at the end of a step (backward Euler). κ falls with
√Δa, so that fine steps have s = 1/2 and second order.

κ and the turn of the path change little from step to step. Where κ is known the first trial therefore has half of the
last step's turn between the tangents at its ends; on smooth paths it is off by tenths of a degree. κ then gives the
correction, mostly without another solution (`Remembered`), and often the trial is the step.
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
#: Tolerance of the chord's direction: K_II of about 1 % of K_I.
TOLERANCE = np.radians(1.0)
#: κ from which paths are stiff: below, the error of a single correction decays from step to step.
STIFF = 2.0
#: Largest further turn that is corrected without a second trial unless it is known to be stiff. For a larger one the
#: second trial shows whether it overshoots: κ above the second number. (Steps of 1 mm under 140 MPa would otherwise
#: bend by 17° instead of 6°, then back, and miss the driving load by 14 %.)
SMOOTH, GENTLE = np.radians(4.2), 1.0
#: Largest number of trials. The secant iteration needs two or three to come within the tolerance.
TRIALS = 5
#: Bounds of the slope −1 − κ of the turn at the end against that of the chord; beyond them two trials are too close
#: together to determine it.
SLOPES = (-39.0, 0.0)
#: Largest κ accepted from a single trial.
GUESSED = 8.0
#: Possible relative change of the slope since the last step or trial: a correction with it is accepted without a trial
#: where the resulting error is within the tolerance.
CHANGED = 0.3
#: A trial whose correction would be smaller than this is the step: its K_II turns the next one, and another body need
#: not be solved. (Wings of the two-crack specimen in increments of 1, ½ and ¼ mm stay within 16, 10 and 3 µm of those
#: corrected to 0.03°.)
ACCEPTED_TURN = np.radians(0.25)
#: Smallest difference in angle between two trials from which the slope is computed.
DISTINCT_TRIALS = np.radians(0.5)
#: The chord lies between the first trial and the first correction, since the condition falls at least as fast as the
#: chord turns; it may lie outside by this fraction of their difference (tension along the crack, round-off).
OUTSIDE = 0.2


class Remembered(NamedTuple):
    """Last step of a tip: ``kappa`` (nan: unknown), ``angle`` of its chord, angle ``tried`` last before that, the
    angles of the criterion at the end of that trial (``ahead``) and at the start of the step (``start``)."""

    kappa: float
    angle: float
    tried: float
    ahead: float
    start: float

    def kappa_at(self, start: float) -> float:
        """κ, given the angle ``start`` of the criterion at the end of the chord."""
        if abs(self.angle - self.tried) > DISTINCT_TRIALS:
            return -1 - float(np.clip((start - self.ahead) / (self.angle - self.tried), *SLOPES))
        return self.kappa


#: Position of a tip → its last step.
Memory = dict[tuple[float, float], Remembered]


class Chords:
    """Directions of the chords of one growth step; the steps of all tips are tried together.

    With θ the angle of the chord, θ₀ that of the criterion at its start, a(θ) that of the criterion at its end and s
    the share of the turn, the condition is s (θ − θ₀ + a) = θ − θ₀, and a falls by (1 + κ) Δθ.
    """

    def __init__(self, tips: np.ndarray, memory: Memory | None = None) -> None:
        self.start = tips["angle"].copy()
        #: κ of the last step, nan where unknown, …
        self.kappa = np.full(len(tips), np.nan)
        #: … and the first trial chords.
        self.first = self.start.copy()
        known = memory or {}
        for row, point in enumerate(tips["point"].tolist() if known else ()):
            last, start = known.get(tuple(point)), float(self.start[row])
            if last is not None and abs(start) <= KINK:
                self.kappa[row] = last.kappa_at(start)
                # Without κ the trial must be along the tangent, since it is evaluated as such.
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
        """Improve ``tips["angle"]`` of the tips that have ``grown`` (n_tips,); True when no further trial is needed.

        ``ahead``: TIP rows of the trial network ``cracks`` with their growth angles; its segments of birth ``cycle``
        are the trial steps.
        """
        self.looks += 1
        turns = _turns_ahead(tips, grown, ahead, cracks, cycle)
        angle = tips["angle"].copy()
        first = self.looks == 1
        known = np.isfinite(self.kappa)
        kappa, determined = (
            (np.where(known, self.kappa, self._first_guess(turns)), known) if first else self._secant(turns, angle)
        )
        share = np.maximum(self.share, 1 - 1 / np.maximum(kappa, 1.0))
        rest = share * turns - (1 - share) * (angle - self.start)
        off = np.abs(rest) > TOLERANCE  # False for nan: nothing ahead
        seen = np.isfinite(rest)
        if first:
            # Closing faces make the condition discontinuous; secants must not diverge across the jump.
            ends = np.stack([angle - OUTSIDE * rest, angle + (1 + OUTSIDE) * rest])
            self.lowest, self.highest = (
                np.nanmin(ends, axis=0, initial=np.inf),
                np.nanmax(ends, axis=0, initial=-np.inf),
            )
        left = np.abs(rest) * share * CHANGED * np.maximum(1 + kappa, 1.0) / (1 + share * kappa)
        tips["angle"][seen] = np.clip(angle + rest / (1 + share * kappa), self.lowest, self.highest)[seen]
        if first:
            # A small further turn in the direction of the trial needs no second one: the path is smooth.
            straight = np.abs(self.start) < ONE_WAY
            self.onward = (straight | (rest * self.start >= 0)) & seen & ~known
            self.whole = angle + self.share * turns
            smooth = self.onward & (np.abs(rest) < SMOOTH) & (kappa < STIFF)
            unsettled = off & ~np.where(known, left <= TOLERANCE, smooth)
            # That determines κ: the next trial has half a turn, which suits trials without correction (`ACCEPTED_TURN`). A
            # straight path does not determine κ.
            determined = known | (smooth & ~(straight & (np.abs(turns) < ONE_WAY)))
        else:
            unsettled = off & (left > TOLERANCE)
            if self.looks == 2:
                # A large turn need not be stiff: then the whole first correction was right.
                gentle = self.onward & (kappa < GENTLE)
                tips["angle"][gentle], unsettled = self.whole[gentle], unsettled & ~gentle
        self.last_angle, self.last_turns = angle, turns
        self.kappa = np.where(determined, kappa, np.nan)
        if (np.abs(tips["angle"] - angle)[seen] <= ACCEPTED_TURN).all():
            tips["angle"] = angle
            return True
        return self.looks == TRIALS or not unsettled.any()

    def remember(self, memory: Memory, tips: np.ndarray, growth: Growth, cycle: int) -> None:
        """Store in ``memory``, by their ends, the data of the accepted steps."""
        ends = _new_ends(tips, growth.grown, growth.cracks, cycle)
        rows = np.stack([self.kappa, tips["angle"], self.last_angle, self.last_turns, self.start], axis=1).tolist()
        for point, end, step in zip(tips["point"].tolist(), ends, rows):
            if end >= 0:
                memory.pop(tuple(point), None)
                memory[tuple(growth.cracks.nodes[end].tolist())] = Remembered(*step)

    def _first_guess(self, turns: np.ndarray) -> np.ndarray:
        """κ from the turn at the end of a trial along the tangent: on a smooth path it is 2 + κ times the half turn
        before the tip; on a zigzag about a straight line −κ times. 0 where that is not stiff; kinks and straight paths
        do not determine it."""
        turns = np.where(np.maximum(np.abs(turns), np.abs(self.start)) < ONE_WAY, np.nan, turns)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = turns / self.start
        kappa = np.minimum(np.where(ratio > 0, ratio - 2, -ratio), GUESSED)
        return np.where((kappa >= STIFF) & (np.abs(self.start) <= KINK), kappa, 0.0)

    def _secant(self, turns: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """κ (n_tips,) from the last two trials, and whether it is known. Where the trials are too close together κ is
        unchanged, or 0 if it was unknown."""
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = (turns - self.last_turns) / (angle - self.last_angle)
        known = np.isfinite(self.kappa)
        informative = np.isfinite(slope) & (np.abs(angle - self.last_angle) > np.where(known, DISTINCT_TRIALS, ONE_WAY))
        return np.where(
            informative, -1 - np.clip(slope, *SLOPES), np.where(known, self.kappa, 0.0)
        ), known | informative


def corrected(
    tips: np.ndarray,
    grow: Callable[[], Growth],
    look_ahead: Callable[[Cracks], np.ndarray],
    cycle: int,
    correct: bool = True,
    memory: Memory | None = None,
) -> Growth | None:
    """One growth step of all driven tips along chords; None when no tip moves. Sets the final angles.

    ``tips``: TIP rows with the criterion's ``angle`` and ``k_eq``; ``grow()`` advances them in their present
    directions, by segments of birth ``cycle``; ``look_ahead(cracks)`` solves the trial network and returns its TIP rows
    with their angles. Without ``correct`` the criterion's angles are used unchanged. ``memory``: data of the last
    steps, updated.
    """
    chords = Chords(tips, memory)
    if correct:
        tips["angle"] = chords.first
    growth = grow()
    settled = not correct
    # A step that joins something may cut off a piece, on which there is nothing to solve.
    while not settled and not growth.joins and np.any(growth.grown > 0):
        angle = tips["angle"].copy()
        settled = chords.bend(tips, growth.grown, look_ahead(growth.cracks), growth.cracks, cycle)
        if np.array_equal(angle, tips["angle"]):
            break  # the trial step is accepted
        tried, growth = growth, grow()
        stuck = (tried.grown > 0) & (growth.grown == 0)
        if stuck.any():
            # A corrected step would not leave its tip; the criterion's own direction does.
            tips["angle"][stuck] = chords.start[stuck]
            growth = grow()
    if memory is not None and correct:
        chords.remember(memory, tips, growth, cycle)
    return growth if np.any(growth.grown > 0) or growth.joins else None


def _turns_ahead(tips: np.ndarray, grown: np.ndarray, ahead: np.ndarray, cracks: Cracks, cycle: int) -> np.ndarray:
    """(n_tips,) angle of the criterion at the end of each tip's new segment; nan where there is no tip."""
    turn_at = {int(tip["node"]): float(tip["angle"]) for tip in ahead}
    return np.array([turn_at.get(node, np.nan) for node in _new_ends(tips, grown, cracks, cycle)])


def _new_ends(tips: np.ndarray, grown: np.ndarray, cracks: Cracks, cycle: int) -> list[int]:
    """The end nodes of the tips' new segments, of birth ``cycle``; −1 where there is none."""
    ends = [-1] * len(tips)
    new = np.flatnonzero(cracks.birth_cycle == cycle)
    at = cracks.nodes[cracks.segments[new]]  # (n, 2 ends, 2)
    for row in np.flatnonzero(grown > 0):
        starts = np.argwhere((at == tips["point"][row]).all(axis=2))
        if len(starts) == 1:
            segment, end = starts[0]
            ends[row] = int(cracks.segments[new[segment], 1 - end])
    return ends
