"""The load at which the first contact, or crack face, changes its state on the way to another load.

While all states stand, what each of them has in `reserve` falls linearly with the load: two passes before a change tell
where it comes about, and a pass just beyond that shows it. What changes without a warning of that kind (bonds that
break as one, corners that slide off) is enclosed by halves.

Changes far apart are found one by one. In a rush of them, as where a wall settles brick by brick, more and more of them
are taken together, so that it costs no more than some dozen steps more than without.
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

#: A change is found when it is known to this part of the time (and so, where loads are proportional to it, of the
#: load); among more than `MANY` contacts to that one.
FOUND, ROUGHLY, MANY = 1e-6, 1e-3, 100
#: The first look into a way of which nothing is known, as a part of it: near its start all states stand.
FIRST_LOOK = 1 / 64
#: Looks for one change; what has not been found then is told where it is known to have come about.
LOOKS = 12
#: A step to a change is short if it is less than this part of what a step may be. After a short one changes nearer than
#: `MORE` times (of many contacts, `MUCH_MORE`) as much as before are taken together, after others nearer than `LESS`
#: times as much.
SHORT, MORE, MUCH_MORE, LESS = 1 / 8, 1.5, 3.0, 0.25


class _Search(NamedTuple):
    """A search for the first change: ``way`` is 1 where the load rises, −1 where it falls; times nearer than ``within`` s
    are one, changes nearer than ``grain`` s to the last one are taken with it; ``approach`` as of `FirstChange.first`."""

    way: int
    within: float
    grain: float
    approach: Callable[[float], float]

    def beyond(self, at: float) -> float:
        """Just beyond a change that is expected ``at`` a time, s."""
        return at + 0.25 * self.way * self.within


class FirstChange:
    """Where contacts and faces, those of the ``kinds`` "contacts" and "faces", change their states; and what to tell of
    it, whatever the steps (`events`)."""

    def __init__(self, kinds: tuple[str, ...]) -> None:
        self.kinds = tuple(kind for kind in kinds if kind in ("contacts", "faces"))
        #: The pass that the present step begins with, and one before it in the same states.
        self._seen: Watched | None = None
        self._older: Watched | None = None
        #: The pass that was told of last.
        self._told: Watched | None = None
        #: Where the next change is expected, s, once a step has been made most of the way there.
        self.expected: float | None = None
        #: Where the last one was found, and how near to it others are taken with the next; s.
        self._last, self._near = 0.0, 0.0
        #: Whether the last pass ended at a change.
        self.reached = False

    def first(
        self, now: CrackedBlocks, found: Balance, solve: Callable[[float], Balance], approach: Callable[[float], float],
        most: float,
    ) -> Balance:  # fmt: skip
        """``found``, or the pass at the first change on the way there from the start of the step: what ``solve`` finds
        at a time. It is the last one that was solved. ``approach`` says how far to go towards a time in one step,
        ``most`` is how long one may be, s."""
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
        base, last = low[-1], found
        within = (FOUND if len(high.key) <= MANY else ROUGHLY) * max(abs(start), abs(high.time))
        search = _Search(1 if high.time > start else -1, within, max(self._near, within), approach)
        way = search.way
        for look in range(LOOKS):
            aim, at = self._next_look(look, search, changes, low, high)
            if aim is None:
                break
            try:
                last = solve(aim)
            except NotConverged as failure:
                # Blocks have found their states farther on: the change is told there.
                log.debug("no look at t = %g s: %s", aim, failure)
                last = None
                break
            seen = Watched.of(now, last, self.kinds)
            changed = seen.changes(now, base)
            if changed:
                found, high, changes = last, seen, changed
                # What has changed here, and not yet in a pass farther on, is not looked for from there: backwards.
                low = [each for each in low if way * (high.time - each.time) > 0]
                if not low:
                    break
            elif at is not None and aim != search.beyond(at):
                # Most of the way, or all that is taken together, and nothing has changed.
                self.expected = at
                return last
            else:
                low.append(seen)
        if last is not found:
            found = solve(high.time)
        self._reach(high.time, most, within, MORE if len(high.key) <= MANY else MUCH_MORE)
        return found

    def _next_look(
        self, look: int, search: _Search, changes: list[Change], low: list[Watched], high: Watched
    ) -> tuple[float | None, float | None]:
        """Where to look next, s, and where the first of ``changes`` is expected (None: not told); None where the pass
        ``high`` is where it comes about."""
        way, within, grain = search.way, search.within, search.grain
        if abs(high.time - low[-1].time) <= within:
            return None, None
        at = _first_of(changes, low, high)
        if at is not None and abs(at - high.time) <= within:
            return None, at
        if at is None or way * (at - high.time) > 0 or look % 3 == 2:
            # Something happens in between; or what is left shrinks from one side only.
            share, at = FIRST_LOOK if len(low) == 1 else 0.5, None
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
        """Passes before ``high`` in which nothing has changed yet, the last one that with which its states are
        compared; none where blocks find no states so near to the start."""
        if self._seen is not None and self._seen.same_faces(high) and self._seen.numbering == high.numbering:
            return [self._seen] if self._older is None else [self._older, self._seen]
        start = now.state.time
        try:
            first = Watched.of(now, solve(start + FIRST_LOOK * (high.time - start)), self.kinds)
        except NotConverged:
            return []
        if self._told is None:
            self._told = first
        return [first]

    def _reach(self, time: float, most: float, within: float, more: float) -> None:
        short = abs(time - self._last) < SHORT * most
        self._near = max(within, (more if short else LESS) * max(self._near, within))
        self._last, self.expected, self.reached = time, None, True

    def after(self, now: CrackedBlocks, found: Balance) -> None:
        """The load step has ended with the pass ``found``, in which nothing grew."""
        if not self.kinds:
            return
        seen, before = Watched.of(now, found, self.kinds), self._seen
        kept = (
            before is not None and not self.reached and before.numbering == seen.numbering and before.same_faces(seen)
        )
        self._older = before if kept and not seen.changes(now, before) else None
        self._seen = seen

    def grown(self) -> None:
        """The cracks have grown at the end of the load step."""
        self._seen = self._older = self.expected = None

    def events(self, now: CrackedBlocks, found: Balance) -> tuple[Event, ...]:
        """What is another in the pass ``found`` than in the one before it."""
        if not self.kinds:
            return ()
        seen, before = Watched.of(now, found, self.kinds), self._told
        self._told = seen
        changes = [] if before is None else seen.changes(now, before)
        return tuple(event(now, change.kind, found.result.state, change.point, change.detail) for change in changes)


def _first_of(changes: list[Change], low: list[Watched], high: Watched) -> float | None:
    """The time at which the first of ``changes``, found in the pass ``high``, comes about by the last two passes before
    it; None where they do not tell."""
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
    """What the contacts or nodes that ``change`` is about had in reserve in an earlier pass; nan where they were not
    there, or had changed before."""
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
