"""One reduced strength tried: do the blocks come to rest where they are, or move on?

Static steps of the length dt leave out of balance what moves the blocks by a dt²/2. Where they stand, the unbalanced
force falls to round-off within a few steps. Where it stays, steps show which way blocks go: they move on if nothing
bars that way, and if what is left of the unbalanced force, as it falls with the way, lasts beyond the displacement that
an equilibrium allows (`displacement_limit`). What these do not tell, as where a corner is about to touch, is followed
with longer steps until it is at rest or has moved too far.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ...model import OPEN, Loads, State
from ..joint_laws.friction_arrest import contact_speeds
from ..results import NotConverged, StepResult
from ..system import BlockSystem
from .displacement_limit import DisplacementLimit

#: Free fall over a step takes a block this part of its size √area: long beside contact vibrations, short for geometry.
_FALL = 0.01
#: An unbalanced force that has not fallen by this factor over so many steps does not fall.
_FALLING, _STEPS = 0.8, 6
#: No trial is called unstable before it has made so many steps.
_LEAST_STEPS = 10
#: A trial whose unbalanced force does not tell goes on with steps this many times as long, so many of them.
_LONGER, _MORE_STEPS = 2.0, 30
#: … and so many once contacts let them grow no longer.
_SHORT_STEPS = 6
#: An unbalanced force that falls with the way is taken to last as far as a straight line says, if that is so many times
#: as far as blocks may move.
_BEYOND = 5.0
#: Blocks are looked ahead for so many times as far as they may move.
_MARGIN = 2.0
#: A contact bars the way if it closes by more than this part of the fastest block's way.
_CLOSES = 1e-3


@dataclass(frozen=True, eq=False)
class Trial:
    """One reduced strength. ``factor`` F; ``stable``; static ``steps`` made; ``unbalanced`` the part of the forces on a
    block that is left to move it, where it is largest; ``drift`` m/s², that block's acceleration; ``displacement``
    (n_blocks, 2) m and ``rotation`` (n_blocks,) rad of the last step; ``moved`` (n_blocks,) m, how far each block has
    come since the search began; ``reason`` in words."""

    factor: float
    stable: bool
    steps: int
    unbalanced: float
    drift: float
    displacement: np.ndarray
    rotation: np.ndarray
    moved: np.ndarray
    reason: str


@dataclass(frozen=True)
class TrialLoads:
    """What a trial stands under and by what it is judged: ``loads`` of ``time`` s; at rest below the part
    ``unbalanced`` of the forces on any block; at most ``max_steps`` static steps of ``time_step`` s (None: by the
    smallest block)."""

    loads: Loads
    time: float
    unbalanced: float
    max_steps: int
    time_step: float | None

    def longest(self, system: BlockSystem) -> float:
        """s, the length of a static step."""
        if self.time_step is not None:
            return float(self.time_step)
        blocks = system.blocks
        size = math.sqrt(float(blocks.areas()[~blocks.fixed].min()))
        pull = max(float(np.hypot(*self.loads.gravity.at(self.time))), 1e-3)
        return math.sqrt(2.0 * _FALL * size / pull)


def stability_trial(
    system: BlockSystem, state: State, under: TrialLoads, factor: float, limit: DisplacementLimit
) -> tuple[Trial, State]:
    """Whether the blocks of ``system``, whose joints have their strength divided by ``factor``, come to rest from
    ``state`` before they have moved farther than the ``limit`` allows; and where they are then, with no velocity."""
    blocks, way = system.blocks, _Way(system, limit)
    longest = dt = under.longest(system)
    ratios: list[float] = []
    told: StepResult | None = None
    result: StepResult | None = None
    stable, reason, more, most = False, f"still moving after {under.max_steps} steps", 0, math.inf
    for _ in range(under.max_steps):
        try:
            result = system.step(state, under.loads, dt, load_time=under.time)
        except NotConverged as failure:
            reason = f"no consistent contacts: {failure}"
            break
        state = result.state
        limit.follow(result)
        ratios.append(result.statistics["unbalanced_ratio"])
        way.follow(result)
        if len(ratios) > 1 and ratios[-1] < under.unbalanced:
            stable = not len(limit.beyond(state))
            reason = f"at rest {'' if stable else 'only '}after {way.of(state)}"
            break
        slow = len(ratios) >= _LEAST_STEPS and ratios[-1] > _FALLING * ratios[-1 - _STEPS]
        if slow and told is None:
            # What moves now tells of the mechanism, with the step's length that all trials have.
            told = result
        if told is not None:
            # Steps that contacts keep short bring blocks nowhere.
            more += 1 if math.isinf(most) else _MORE_STEPS // _SHORT_STEPS
            if more > _MORE_STEPS or len(limit.beyond(state)) or way.goes_on(result, ratios):
                reason = f"moves on after {way.of(state)}"
                break
            # Contacts that found no states in a longer step will hardly do so in the next.
            most = result.dt if result.statistics["step_cuts"] else most
            dt = min(most, _LONGER * result.dt)
            continue
        # A step that was cut took less of the forces' time: go on with its length, and back to the full one by
        # doubling.
        dt = result.dt if result.statistics["step_cuts"] else min(longest, 2.0 * result.dt)
    moved = limit.moved(state.vertices)
    if result is None:
        nothing = np.zeros((blocks.n_blocks, 2))
        return Trial(factor, False, 0, math.nan, math.nan, nothing, nothing[:, 0], moved, reason), state
    shown = result if stable or told is None else told
    a, free = shown.acceleration, ~blocks.fixed
    step = 0.5 * shown.dt**2 * a
    trial = Trial(
        factor, stable, len(ratios), shown.statistics["unbalanced_ratio"], float(_speeds(shown)[free].max()),
        step[:, :2] * free[:, None], step[:, 2] * free, moved, reason,
    )  # fmt: skip
    return trial, replace(state, velocity=np.zeros_like(state.velocity))


def _speeds(result: StepResult) -> np.ndarray:
    """(n_blocks,) m/s², the acceleration of blocks in the step, or that of their rotation by √area if it is more."""
    a, h = result.acceleration, np.sqrt(result.forces.area)
    return np.maximum(np.hypot(a[:, 0], a[:, 1]), h * np.abs(a[:, 2]))


class _Way:
    """How far the blocks of a trial have gone, and how far they will go."""

    def __init__(self, system: BlockSystem, limit: DisplacementLimit) -> None:
        self._system, self._limit = system, limit
        self._free = ~system.blocks.fixed
        self._steps: list[float] = []

    def of(self, state: State) -> str:
        return f"{self._limit.moved(state.vertices)[self._free].max():.2g} m"

    def follow(self, result: StepResult) -> None:
        """Count the way of the fastest block in the step."""
        self._steps.append(0.5 * result.dt**2 * float(_speeds(result)[self._free].max()))

    def goes_on(self, result: StepResult, ratios: list[float]) -> bool:
        """Whether the blocks move beyond all that an equilibrium allows: nothing bars the way that they go, and the
        unbalanced force, as it has fallen over the last steps, lasts beyond it."""
        speed = _speeds(result)
        speed[~self._free] = 0.0
        # Until the first block has gone too far; those that barely move do so last.
        with np.errstate(divide="ignore"):
            reach = _MARGIN * float(np.min(self._limit.farthest() / speed))
        first, last, fastest = ratios[-1 - _STEPS], ratios[-1], float(speed.max())
        if first > last and last / (first - last) * sum(self._steps[-_STEPS:]) < _BEYOND * reach * fastest:
            return False
        return not self._barred(result, reach, fastest)

    def _barred(self, result: StepResult, reach: float, fastest: float) -> bool:
        """Whether a contact that is open would close while blocks go on at their speeds for the time ``reach``."""
        system, state = self._system, result.state
        window = 2.0 * reach * fastest
        found = system.finder.find(state, np.ascontiguousarray(state.vertices), window, lumped=True)
        speed = np.where(self._free[:, None], result.acceleration, 0.0)
        across = contact_speeds(found, found.geometry, speed, result.forces.centroid)[:, 0]
        closes = (found.state == OPEN) & (found.gap_before > 0.0) & (-across > _CLOSES * fastest)
        return bool((found.gap_before < -across * reach)[closes].any())
