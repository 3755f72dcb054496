"""The load of the first change of state of a contact or crack face on the way to another load.

As long as all states persist, the `reserve` of each (its distance from the change) is linear in the load. Two passes
before a change therefore predict its load, and a pass just beyond confirms it. Changes that cannot be predicted in this
way (bonds that break together, corners that slide off an edge) are enclosed by bisection.

Changes far apart are found one by one. In rapid succession, as when a wall settles brick by brick, more and more of
them are taken together, which limits the cost to a few dozen additional steps.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...dda import NotConverged
from ...model import Event
from ..coupled_state import CrackedBlocks
from ..cycle_record import event
from ..load_pass import Balance
from ..monitoring.state_changes import Change, Watched

log = logging.getLogger(__name__)

#: Relative tolerance of the time of a change (and of its load, where loads are proportional to time); with more than
#: `MANY` contacts the second one.
FOUND, ROUGHLY, MANY = 1e-6, 1e-3, 100
#: First trial without a prediction, as a fraction of the interval: near the start all states persist.
FIRST_TRIAL = 1 / 64
#: Largest number of trials for one change; it is then reported at the earliest time at which it has been seen.
TRIALS = 12
#: Part of the time until a change, within which others are taken together with it, above which a warning is given.
COARSE = 0.1
#: Bonds are looked for halfway if that is before this fraction of a step to their breaking.
HALFWAY = 0.75
#: A step to a change is short if it is less than this fraction of the longest step. After a short one, changes within
#: `MORE` times (with many contacts `MUCH_MORE` times) the previous interval are taken together, otherwise within
#: `LESS`.
SHORT, MORE, MUCH_MORE, LESS = 1 / 8, 1.5, 3.0, 0.25


class _Search(NamedTuple):
    """A search for the first change: ``way`` 1 for rising, −1 for falling load; times within ``within`` s are the same,
    changes within ``grain`` s of the last one are taken with it; ``approach`` as in `FirstChange.first`."""

    way: int
    within: float
    grain: float
    approach: Callable[[float], float]

    def beyond(self, at: float) -> float:
        """A time just beyond the expected time ``at`` of a change, s."""
        return at + 0.25 * self.way * self.within


class FirstChange:
    """Finds changes of state of "contacts" and "faces" (the ``kinds``), and reports them for any stepping
    (`events`)."""

    def __init__(self, kinds: tuple[str, ...]) -> None:
        self.kinds = tuple(kind for kind in kinds if kind in ("contacts", "faces"))
        #: The pass at the start of the present step, and an earlier one with the same states.
        self._seen: Watched | None = None
        self._older: Watched | None = None
        #: The pass that was reported last.
        self._reported: Watched | None = None
        #: Time at which the next change is expected, s, after a step most of the way there.
        self.expected: float | None = None
        #: Time of the last change, and the interval within which others are taken with the next; s.
        self._last, self._near = 0.0, 0.0
        #: Whether the last pass ended at a change.
        self.reached = False
        #: Whether changes that are taken together over much of the load have been reported.
        self._coarse = False

    def first(
        self, now: CrackedBlocks, found: Balance, solve: Callable[[float], Balance], approach: Callable[[float], float],
        most: float,
    ) -> Balance:  # fmt: skip
        """``found``, or the pass at the first change between the start of the step and ``found``.

        ``solve`` computes the pass at a given time; the returned one was solved last. ``approach`` limits how far one
        step may go towards a time; ``most`` s is the longest step."""
        self.reached = False
        if not self.kinds:
            return found
        start = now.state.time
        high = Watched.of(now, found, self.kinds)
        if high.time == start:
            self._seen, self._older = high, None
            return found
        low = self._before(now, high, solve)
        changes = high.changes(now, low[-1]) if low else []
        if not changes:
            if not low:
                return solve(high.time)
            return found if low[-1] in (self._seen, self._older) else solve(high.time)
        base = low[-1]
        last: Balance | None = found
        within = (FOUND if len(high.key) <= MANY else ROUGHLY) * max(abs(start), abs(high.time))
        search = _Search(1 if high.time > start else -1, within, max(self._near, within), approach)
        way, halved = search.way, False
        for look in range(TRIALS):
            aim, at = self._next_trial(look, search, changes, low, high)
            if aim is None:
                halfway = 0.5 * (low[-1].time + high.time)
                if halved or not _may_break_before(changes, halfway - start, high.time - start):
                    break
                aim, at, halved = halfway, None, True
            try:
                last = solve(aim)
            except NotConverged as failure:
                # The blocks have consistent states farther on: the change is reported there.
                log.debug("no trial at t = %g s: %s", aim, failure)
                last = None
                break
            seen = Watched.of(now, last, self.kinds)
            changed = seen.changes(now, base)
            if changed:
                found, high, changes = last, seen, changed
                # Changes here that have not yet occurred in a pass farther on are not searched for from there.
                low = [each for each in low if way * (high.time - each.time) > 0]
                if not low:
                    break
            elif at is not None and aim != search.beyond(at):
                # No change on most of the way, or within the interval that is taken together.
                self.expected = at
                return last
            else:
                low.append(seen)
        if last is not found:
            found = solve(high.time)
        self._reach(high.time, most, within, MORE if len(high.key) <= MANY else MUCH_MORE)
        return found

    def _next_trial(
        self, look: int, search: _Search, changes: list[Change], low: list[Watched], high: Watched
    ) -> tuple[float | None, float | None]:
        """The next trial time, s (None: the pass ``high`` is the change), and the predicted time of the first of
        ``changes`` (None: no prediction)."""
        way, within, grain = search.way, search.within, search.grain
        if abs(high.time - low[-1].time) <= within:
            return None, None
        at = _first_of(changes, low, high)
        if at is not None and abs(at - high.time) <= within:
            return None, at
        if at is None or way * (at - high.time) > 0 or look % 3 == 2:
            # Something else happens in between, or the interval shrinks from one side only.
            share, at = FIRST_TRIAL if len(low) == 1 else 0.5, None
            aim = low[-1].time + share * (high.time - low[-1].time)
        else:
            aim = search.beyond(at)
        if abs(aim - self._last) < grain and grain > within:
            aim = self._last + way * grain
            if way * (aim - high.time) >= 0:
                return None, at
        if at is not None and (part := search.approach(at)) != at:
            aim = part
        return aim, at

    def _before(self, now: CrackedBlocks, high: Watched, solve: Callable[[float], Balance]) -> list[Watched]:
        """Passes before ``high`` without any change, the last one being that with which states are compared; empty
        where the blocks have no consistent states so close to the start."""
        if self._seen is not None and self._seen.same_faces(high) and self._seen.numbering == high.numbering:
            return [self._seen] if self._older is None else [self._older, self._seen]
        start = now.state.time
        try:
            first = Watched.of(now, solve(start + FIRST_TRIAL * (high.time - start)), self.kinds)
        except NotConverged:
            return []
        if self._reported is None:
            self._reported = first
        return [first]

    def _reach(self, time: float, most: float, within: float, more: float) -> None:
        way = abs(time - self._last)
        if not self._coarse and within < way <= (1 + FOUND) * self._near and way > COARSE * abs(time):
            self._coarse = True
            log.warning(
                "t = %g s: contacts and crack faces change their states in such rapid succession that the changes since t = "
                "%g s, %.2g of the time until then, are taken together, and later ones too. The order in which they slip is "
                "not resolved, and friction remembers it: displacements and crack paths are one of several possible "
                "results. --repeat noise shows by how much they differ",
                time, self._last, way / abs(time),
            )  # fmt: skip
        short = way < SHORT * most
        self._near = max(within, (more if short else LESS) * max(self._near, within))
        self._last, self.expected, self.reached = time, None, True

    def after(self, now: CrackedBlocks, found: Balance) -> None:
        """The load step has ended with the pass ``found``, without growth."""
        if not self.kinds:
            return
        seen, before = Watched.of(now, found, self.kinds), self._seen
        kept = (
            before is not None and not self.reached and before.numbering == seen.numbering and before.same_faces(seen)
        )
        self._older = before if before is not None and kept and not seen.changes(now, before) else None
        self._seen = seen

    def grown(self) -> None:
        """The load step has ended with growth."""
        self._seen = self._older = self.expected = None

    def events(self, now: CrackedBlocks, found: Balance) -> tuple[Event, ...]:
        """Changes of state between the previous pass and ``found``."""
        if not self.kinds:
            return ()
        seen, before = Watched.of(now, found, self.kinds), self._reported
        self._reported = seen
        changes = [] if before is None else seen.changes(now, before)
        return tuple(event(now, change.kind, found.result.state, change.point, change.detail) for change in changes)


def _may_break_before(changes: list[Change], half: float, whole: float) -> bool:
    """Whether bonds break in ``changes`` after a step of ``whole`` s, of which no pass between ``half`` of it and its end is
    known: bonds that break together do so before any of them is expected to, and a pass in between shows it."""
    return abs(half) < HALFWAY * abs(whole) and any(change.kind == "debonding" for change in changes)


def _first_of(changes: list[Change], low: list[Watched], high: Watched) -> float | None:
    """Time of the first of ``changes``, found in the pass ``high``, extrapolated from the last two passes before it;
    None where these do not predict it."""
    if len(low) < 2 or low[-2].time == low[-1].time:
        return None
    times = []
    for change in changes:
        if change.kind == "stick":
            continue
        a, b = (_reserve(change, each, high) for each in low[-2:])
        rate = (b - a) / (low[-1].time - low[-2].time)
        with np.errstate(divide="ignore", invalid="ignore"):
            zero = low[-1].time - b / rate
        ahead = np.isfinite(zero) & ((zero - low[-1].time) * (high.time - low[-1].time) >= 0)
        if ahead.any():
            way = np.abs(zero[ahead] - low[-1].time)
            times.append(float(zero[ahead][way.argmax() if change.last else way.argmin()]))
    return min(times, key=lambda at: abs(at - low[-1].time), default=None)


def _reserve(change: Change, of: Watched, high: Watched) -> np.ndarray:
    """Reserve, in an earlier pass, of the contacts or nodes of ``change``; nan where they did not exist or had changed
    before."""
    rows = change.rows
    none = np.full(len(rows), np.nan)
    if not change.contacts:
        if not of.same_faces(high):
            return none
        return np.where(of.face_state[rows] != high.face_state[rows], of.face_reserve[rows], none)
    if not len(of.key):
        return none
    at = np.minimum(np.searchsorted(of.key, high.key[rows]), len(of.key) - 1)
    there = (of.key[at] == high.key[rows]) & (of.state[at] != high.state[rows])
    return np.where(there, of.reserve[at], none)
