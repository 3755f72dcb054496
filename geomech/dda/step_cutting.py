"""Attempts at one step, with another contact search or a shorter step, until one is accepted.

A step whose contact states do not converge is halved. A step in which blocks move beyond the limits (`step_limits`) is
shortened in proportion. If a corner has entered or passed through a block without a contact, contacts are first
searched within a larger distance. In statics, where loads do not decrease with the step length, a violation of the
limits that a shorter step does not reduce is accepted.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NoReturn, Protocol

import numpy as np

from ..model import OPEN, State
from .contact_detection.contact_finder import ContactFinder
from .higher_order.bending_step import BendingAttempt
from .interfaces import SteppedSystem
from .kinematics.midpoint_configuration import MidpointConfiguration
from .kinematics.simplex_integration import block_moments
from .open_close.contact_set import ContactSet
from .open_close.equations import Unsettled
from .open_close.static_splitting import KeepsMoving
from .results import NotConverged, StepResult, Unsupported
from .step_control.pseudo_inertia import balanced_attempt
from .step_control.relative_motion import Windows
from .step_control.step_limits import CROSSING, UNSETTLED, Crossed, StepLimits, Used
from .time_step import Attempt, StepStart

log = logging.getLogger(__name__)

#: Most extensions of the search distance in one step; then the step is cut.
_FARTHER = 6
#: Most repetitions of a step because corners meet that were not expected to.
_REPEATED = 3
#: Shortest step in motion relative to the time step asked for: cut further, time stands still.
_SHORTEST = 1e-9
#: Additional search distance of corners beyond the motion due to weight, in units of √area of the smallest block:
#: elastic motion of blocks at rest in a step.
_BESIDES = 1e-6
#: Largest displacement towards the equilibrium of soft bolts in a static step, relative to the largest displacement
#: allowed in a step.
_REACH = 0.25


class Deflection(Protocol):
    """Blocks of higher order: raises `NotConverged` for a ``state`` in which they bend too far."""

    def check_small(self, state: State) -> None: ...


class LimitedSystem(SteppedSystem, Protocol):
    """A system whose steps have limits; ``deflected`` are its blocks of higher order, None if there are none;
    ``of_first_order``: the same blocks with uniform strain, None where there are no others."""

    limits: StepLimits

    @property
    def deflected(self) -> Deflection | None: ...

    @property
    def of_first_order(self) -> LimitedSystem | None: ...


@dataclass(eq=False)
class _Search:
    """Arguments of the contact search in a step, see `ContactFinder.find`."""

    finder: ContactFinder
    state: State
    vertices: np.ndarray
    near: Windows
    motion: np.ndarray | None
    margin: float
    glue_holds: bool = True
    broken: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))

    def find(self) -> ContactSet:
        return self.finder.find(
            self.state, self.vertices, self.near, self.glue_holds, broken=self.broken, motion=self.motion,
            margin=self.margin,
        )  # fmt: skip


def _in_the_order_of(found: ContactSet, rows: np.ndarray) -> np.ndarray:
    """CONTACT ``rows`` in the order of the contacts ``found``; those that are not among the rows are open."""
    out = np.zeros(len(found), rows.dtype)
    out["vertex"], out["edge"], out["state"], out["bonded"] = found.vertex, found.edge, OPEN, found.bonded
    at = {key: row for row, key in enumerate(zip(rows["vertex"].tolist(), rows["edge"].tolist()))}
    for k, key in enumerate(zip(found.vertex.tolist(), found.edge.tolist())):
        if key in at:
            out[k] = rows[at[key]]
    return out


def windows_of(system: LimitedSystem, start: StepStart, dt: float) -> Windows:
    """Search distances for contacts in a step of ``dt`` from ``start``."""
    rows = start.state.contacts
    # Pairs that meet only closer than the geometry shows (negative lift) and are open do not press.
    lift = float(np.abs(rows["lift"][(rows["state"] != OPEN) | (rows["lift"] > 0.0)]).max(initial=0.0))
    if system.deflected is not None:
        lift += 2.0 * float(system.finder.deflection.max())
    return system.limits.windows(start.vertices, start.carried, start.moments, dt, start.gravity, lift)


class StepCutting:
    """Attempts at a step of ``system`` from ``start`` by at most ``dt``. ``like``: the result of the same step with
    other cracks, whose contact states are the first guess; ``pseudo_inertia`` as in `BlockSystem.step`."""

    #: Class of attempts at steps of first-order blocks.
    attempts: type[Attempt] = Attempt
    #: Whether corner contacts that bonds join are left out at first (`ContactFinder.find`).
    glue_holds = True
    #: Level at which the log reports that blocks have entered each other in a step of any length.
    level_of_crossings = logging.WARNING

    def __init__(
        self, system: LimitedSystem, start: StepStart, dt: float, like: StepResult | None, pseudo_inertia: bool = True
    ) -> None:
        self.balances = system.scheme.static and system.deflected is None and not pseudo_inertia
        self.system, self.start = system, start
        self.dt = self.asked = system.limits.predicted(start.vertices, start.carried, start.moments, dt, start.gravity)
        self.search = self._search()
        self.found = self.search.find()
        if like is not None:
            self.found = self.found.like(like.state.contacts)
            if system.scheme.static and self.found.tried is not None:
                # (In dynamics the arcs are predicted from the velocity.)
                self.found = self.found.along(*like.arcs)
        self.cuts, self.extensions, self.repeated = 0, 0, 0
        #: Whether states of first order have been tried at this length of the step.
        self.proposed = False
        #: Reason of the last failed attempt, and of the last one that shortened the step.
        self.reason = self.failed = ""
        #: Allowed ratio of motion to its limit, and that of the last attempt.
        self.allowed_share, self.last_share = 1.0, np.inf

    def accepted_step(self) -> tuple[Attempt, StepResult]:
        """The first accepted attempt, and its result. Raises `NotConverged` after ``settings.max_step_cuts`` cuts."""
        while True:
            # Each attempt is freed before the next one: its factors may belong to other contacts.
            accepted = self._attempt()
            if accepted is not None:
                return accepted

    def _with_states_of_first_order(self) -> bool:
        """Whether the step of blocks of higher order is tried again, once at each length, from the contact states that the
        same blocks have at first order."""
        first = self.system.of_first_order
        if first is None or self.proposed:
            return False
        self.proposed = True
        start, state = self.start, self.start.state
        crack = None if start.crack is None else start.crack.of_mean_strain()
        state = replace(
            state, deflection=None, deflection_origin=None, crack_deflection=None, face_points=None, order=None
        )
        start = replace(start, state=state, crack=crack)
        try:
            found = StepCutting(first, start, self.dt, None).found
            rows = Attempt(first, start, self.dt, found, self.cuts).result().contacts
        except (Unsettled, KeepsMoving):
            return False
        again = self.found.trying(_in_the_order_of(self.found, rows))
        tried, self.found = again is not self.found, again
        return tried

    def _attempt(self) -> tuple[Attempt, StepResult] | None:
        """One attempt and its result; None if it was not accepted."""
        system, found = self.system, self.found
        make: Callable[..., Attempt] = self.attempts if system.deflected is None else BendingAttempt
        if self.balances:
            reach = _REACH * system.limits.displacement * self.dt / self.asked
            make = partial(balanced_attempt, reach=reach)
        try:
            attempt = make(system, self.start, self.dt, found, self.cuts)
            result = attempt.result()
        except KeepsMoving as failure:
            raise self._unsupported(failure) from failure
        except Unsettled as failure:
            if self._with_states_of_first_order():
                return None
            self.failed = self.reason = f"{failure}{system.finder.where(found, failure.contact)}"
            self._cut(0.5 * self.dt, UNSETTLED, *found.blocks_of(failure.contact))
            return None
        if self._bonds_missed(result) or self._corners_missed(attempt):
            return None
        used = system.limits.used(attempt, result)
        self.reason = used.reason
        if used.share <= 1.0001 * self.allowed_share:
            return (attempt, result) if self._accepts(attempt, result, used) else None
        if system.scheme.static and used.share > 0.9 * self.last_share:
            self._allow(used)
        else:
            self.last_share = used.share
            self._cut(self.dt * min(0.8, max(0.05, 0.95 / used.share)), used.why, *used.blocks)
        return None

    def _unsupported(self, failure: KeepsMoving) -> Unsupported:
        """The error for blocks that keep moving."""
        moving, size = failure.order >= 0, np.sqrt(self.start.moments[:, 0])
        motion, unbalanced = np.zeros((2, len(moving), 3))
        motion[moving] = failure.motion[failure.order[moving], :3]
        unbalanced[moving] = failure.unbalanced[failure.order[moving], :3]
        motion[:, 2] /= size
        unbalanced[:, 2] *= size
        return Unsupported(f"{failure}", motion, unbalanced)

    def _bonds_missed(self, result: StepResult) -> bool:
        """Whether a bond has broken that corner contacts or springs at corners had been omitted for: these must act
        before it breaks, so the search is repeated with them."""
        found, search, bonded = self.found, self.search, result.contacts["bonded"]
        lost = (bonded != found.bonded) & found.inset
        corners_needed = found.relies_on_glue and (bonded < found.bonded).any()
        if not (corners_needed or lost.any()):
            return False
        broken = found.vertex[lost] * len(self.start.vertices) + found.edge[lost]
        search.broken = np.append(search.broken, broken)
        search.glue_holds = bool(found.relies_on_glue and not corners_needed)
        self.found = search.find()
        return True

    def _corners_missed(self, attempt: Attempt) -> bool:
        """Whether corners have met that were not expected to, so that the step is repeated with these contacts. Where
        they meet is known once the motion of the step is."""
        if self.repeated >= _REPEATED:
            return False
        again = self._with_corners_of(attempt)
        if again is None:
            return False
        self.repeated, self.found = self.repeated + 1, again
        return True

    def _accepts(self, attempt: Attempt, result: StepResult, used: Used) -> bool:
        """Whether an attempt within its limits is accepted: nothing has entered or passed through a block."""
        system, state = self.system, self.start.state
        crossed = system.limits.crossed(attempt, result)
        if crossed is None and self.cuts < system.settings.max_step_cuts:
            crossed = self._pressed_apart(attempt, result)
        if crossed is None:
            self._refuse_crushed(result.state)
            if system.deflected is not None:
                system.deflected.check_small(result.state)
            system.limits.warn_of_penetration(result)
            if self.failed:
                log.info(
                    "step at t = %g s cut from %.4g to %.4g s: %s", state.time, self.asked, self.dt, self.failed
                )  # fmt: skip
            result.statistics["limit_share"] = used.share
            return True
        if self._extend_search(attempt, crossed):
            return False
        if self.cuts >= system.settings.max_step_cuts and not crossed.through:
            level = self.level_of_crossings
            log.log(level, "step at t = %g s: %s, and no shorter step avoids it", state.time, crossed.reason)
            result.statistics["limit_share"] = used.share
            return True
        self.failed = self.reason = crossed.reason
        self.extensions = 0
        self._cut(0.5 * self.dt, CROSSING, *crossed.blocks)
        return False

    def _pressed_apart(self, attempt: Attempt, result: StepResult) -> Crossed | None:
        """The result of `StepLimits.pressed_apart` if a shorter step may avoid it: where blocks lie within the smallest
        search distance, it finds the same contact as deep."""
        crossed = self.system.limits.pressed_apart(attempt, result)
        if crossed is None or result.overlap is None:
            return None
        deep, n = result.overlap[3], self.system.blocks.n_blocks
        smallest = windows_of(self.system, self.start, 0.0).reach_of(*crossed.blocks, n)
        return crossed if smallest < deep < self.search.near.reach_of(*crossed.blocks, n) else None

    def _extend_search(self, attempt: Attempt, crossed: Crossed) -> bool:
        """Whether contacts are found within a larger distance; the step is then repeated with its length unchanged."""
        search = self.search
        wider = search.near.widened(crossed.pairs, crossed.motion, self.system.blocks.n_blocks)
        if self.extensions >= self._most_extensions(crossed) or not wider.reaches_beyond(search.near):
            return False
        search.near, search.motion = wider, attempt.new_vertices - self.start.vertices
        search.glue_holds = self.found.relies_on_glue
        self.extensions, self.found = self.extensions + 1, search.find()
        return True

    def _most_extensions(self, crossed: Crossed) -> int:
        """Most extensions of the search distance in a step in which blocks have ``crossed``."""
        return _FARTHER

    def _allow(self, used: Used) -> None:
        """Accept, in statics, motion under a load that does not decrease with the step, and search contacts far enough
        for it."""
        search = self.search
        log.info(
            "step at t = %g s accepted: %s, which a shorter step does not reduce", self.start.state.time, used.reason
        )  # fmt: skip
        self.allowed_share = 1.1 * used.share
        search.near = search.near.widened(used.moved.pairs, 1.1 * used.moved.reach, self.system.blocks.n_blocks)
        search.glue_holds = self.found.relies_on_glue
        self.found = search.find()

    def _cut(self, shorter: float, why: str, *blocks: int) -> None:
        """Repeat with the length ``shorter``; ``blocks`` are those that required it, for the reason ``why``."""
        system = self.system
        self.cuts += 1
        if not system.scheme.static and shorter < _SHORTEST * system.settings.time_step:
            self._refuse()
        if self.cuts > system.settings.max_step_cuts:
            if not (
                system.scheme.static and why == UNSETTLED and not self.start.bonds_give and self.found.bonded.any()
            ):
                self._refuse()
            # If bonds break only when all other contacts are consistent, no step may be short enough.
            self.start, self.cuts, shorter = replace(self.start, bonds_give=True), 0, self.asked
        system.limits.shortens(why, *blocks)
        log.debug("step at t = %g s cut from %.4g to %.4g s: %s", self.start.state.time, self.dt, shorter, self.reason)
        self.dt, self.proposed = shorter, False
        if not system.scheme.static:
            search, again = self.search, self._search()
            search.near, search.motion, search.margin = again.near, again.motion, again.margin
            search.glue_holds = self.found.relies_on_glue or not len(search.broken)
            self.found = search.find()

    def _refuse(self) -> NoReturn:
        static, way_out = self.system.scheme.static, ""
        if not static and self.system.settings.springs != "resolved":
            way_out = (
                '; dda.springs = "resolved" may continue, with contact springs no stiffer than the time step resolves'
            )
        raise NotConverged(
            f"the block step at t = {self.start.state.time:g} s failed after {self.cuts - 1} cuts "
            f"(dt = {self.dt:.3g} s): {self.reason}{way_out}"
        )

    def _refuse_crushed(self, state: State) -> None:
        system = self.system
        area = block_moments(state.vertices, system.next, system.vertex_start)[:, 0]
        if not (area > 0).all():
            name = system.blocks.names[int(np.argmin(area > 0))]
            raise NotConverged(
                f"{name!r} is compressed to zero area at t = {state.time:g} s: its loads are too large for its stiffness"
            )

    def _search(self) -> _Search:
        """Contact search of a step of the present length. Corners may approach by their weight beyond the motion due to
        their velocities; anything that comes closer is searched once the motion of the step is known."""
        system, start, dt = self.system, self.start, self.dt
        margin = np.inf
        if not system.scheme.static:
            margin = dt * dt * float(np.hypot(*start.gravity)) + _BESIDES * math.sqrt(start.moments[:, 0].min())
        return _Search(
            system.finder, start.state, start.vertices, windows_of(system, start, dt), self._expected_motion(), margin,
            glue_holds=self.glue_holds,
        )  # fmt: skip

    def _expected_motion(self) -> np.ndarray | None:
        """(n_vertices, 2) m: motion of the step at its initial velocities; None if these are zero."""
        start = self.start
        if not start.carried.any():
            return None
        increment = self.dt * start.carried
        end = MidpointConfiguration.of(increment, 1.0, start.vertices, self.system.owner, start.moments)
        return end.vertices - start.vertices

    def _with_corners_of(self, attempt: Attempt) -> ContactSet | None:
        """The contacts with which the step is repeated because corners have met in the ``attempt`` that are not among
        its contacts; None if there are none."""
        system, search = self.system, self.search
        found, moved = attempt.found, attempt.new_vertices - attempt.vertices
        found = found.on_corners
        off = np.abs(moved if search.motion is None else moved - search.motion).max(axis=1)
        deviating = np.zeros(system.blocks.n_blocks, bool)
        deviating[system.owner[off > 0.5 * search.margin]] = True
        if not deviating.any():
            return None
        search.motion, search.glue_holds = moved, found.relies_on_glue
        # Only these pairs may meet otherwise; all pairs are searched again if one of them does.
        near = search.near
        some = deviating[near.pairs].any(axis=1)
        doubtful = replace(search, near=Windows(near.pairs[some], near.reach[some])).find()
        if not self._more_meet(attempt, found, doubtful):
            return None
        again = search.find()
        return again if self._more_meet(attempt, found, again) else None

    def _more_meet(self, attempt: Attempt, found: ContactSet, again: ContactSet) -> bool:
        """Whether contacts ``again``, found with the motion of the ``attempt``, have closed in it that ``found`` lacks."""
        again = again.on_corners
        finder, n = self.system.finder, len(attempt.vertices)
        known = np.isin(again.vertex * n + again.edge, found.vertex * n + found.edge)
        gap = finder.gaps(attempt.new_vertices, attempt.vertices, again) - again.lift
        return bool((~known & (gap < -again.precision)).any())
