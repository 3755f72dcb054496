"""One trial of strength reduction: do the blocks come to rest, or do they keep moving?

In static steps of length dt an unbalanced acceleration a moves a block by a dt²/2. In a stable trial the unbalanced
force falls to round-off within a few steps. If it remains, the steps show the direction of motion. The trial is
unstable if no contact closes in that direction and the unbalanced force, extrapolated along the motion, lasts beyond
the displacement that an equilibrium allows (`displacement_limit`). Undecided cases, such as a corner about to touch,
are continued with longer steps until the blocks are at rest or have moved too far.

Systems of many blocks are solved in one long step instead, by operator splitting (`open_close.static_splitting`), which
follows blocks that keep moving until they have moved too far. The drift is then the acceleration of their motion φ under
the unbalanced forces U, Σ U·φ / Σ m φ².
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...model import OPEN, Blocks, DdaSettings, JointLaw, Loads, State
from ..joint_laws.friction_arrest import contact_speeds
from ..joint_laws.reduced_strength import reduced
from ..kinematics.tolerances import LITTLE
from ..open_close.plastic_splitting import is_plastic, is_stronger
from ..open_close.static_splitting import is_straight
from ..results import NotConverged, StepResult, Unsupported
from ..system import BlockSystem
from .displacement_limit import DisplacementLimit
from .pseudo_time_equilibrium import pseudo_times, settling_time

#: Free fall in one step, as a fraction of a block's size √area: long against contact vibrations, small for the
#: geometry.
_FALL = 0.01
#: An unbalanced force that has not fallen by this factor in so many steps does not fall.
_FALLING, _STEPS = 0.8, 6
#: Fewest steps before a trial is called unstable.
_LEAST_STEPS = 10
#: An undecided trial continues with steps longer by this factor, up to this number of them.
_LONGER, _MORE_STEPS = 2.0, 30
#: … or up to this number once contacts prevent longer ones.
_SHORT_STEPS = 6
#: An unbalanced force that falls along the motion is extrapolated linearly; it lasts too long if it lasts this many
#: times as far as blocks may move.
_BEYOND = 5.0
#: The motion is extrapolated to this many times the distance that blocks may move.
_MARGIN = 2.0
#: Most long steps of a trial of many blocks.
_LONG_STEPS = 6


@dataclass(frozen=True, eq=False)
class Trial:
    """Result for one reduced strength: ``factor`` F; ``stable``; number of static ``steps``; ``unbalanced``: largest
    unbalanced force over the forces on its block; ``drift``: acceleration of that block, m/s²; ``displacement``
    (n_blocks, 2) m and ``rotation`` (n_blocks,) rad of the last step; ``moved`` (n_blocks,) m: displacement of each
    block since the beginning of the search; ``reason`` in words."""

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
    """Loads and criteria of a trial: ``loads`` at ``time`` s; at rest when the unbalanced force on every block is below
    the fraction ``unbalanced``; at most ``max_steps`` static steps of ``time_step`` s (None: from the smallest
    block)."""

    loads: Loads
    time: float
    unbalanced: float
    max_steps: int
    time_step: float | None

    def longest(self, system: BlockSystem) -> float:
        """Length of a static step, s."""
        if self.time_step is not None:
            return float(self.time_step)
        blocks = system.blocks
        size = math.sqrt(float(blocks.areas()[~blocks.fixed].min()))
        pull = max(float(np.hypot(*self.loads.gravity.at(self.time))), 1e-3)
        return math.sqrt(2.0 * _FALL * size / pull)

    def plastic(self, blocks: Blocks, joints: Sequence[JointLaw], settings: DdaSettings) -> bool:
        """Whether trials of these ``blocks`` are solved by operator splitting as with cohesion, joint stiffness or bolts: there are
        many, or very many with friction alone (and not so many that `static_splitting` does), and their ``joints`` keep what
        strength they have."""
        n, solver = int((~blocks.fixed).sum()), settings.contact_solver
        more = bool(self.loads.bolts) or any(is_stronger(law) for law in joints)
        alone = solver.plastic_splitting_alone <= n < solver.static_splitting
        many = n >= solver.plastic_splitting if more else alone
        plain = settings.contact == "penalty" and not self.loads.excavations
        return many and plain and all(is_plastic(reduced(law, 1.0)) for law in joints)

    def simpler(self, blocks: Blocks, joints: Sequence[JointLaw], settings: DdaSettings) -> Sequence[JointLaw]:
        """The laws ``joints`` without tensile strength and dilation where many ``blocks`` are solved by splitting with these only:
        faces lose their tensile strength one after the other, and dilation wedges blocks in states that Newton's method does not
        find. The same ``joints`` otherwise."""
        if not any(law.tensile_strength > 0.0 or law.dilation_angle > 0.0 for law in joints):
            return joints
        plain = [replace(law, tensile_strength=0.0, dilation_angle=0.0) for law in joints]
        large = int((~blocks.fixed).sum()) >= settings.contact_solver.static_splitting
        alone = large and not self.loads.excavations and all(is_straight(law) for law in plain)
        return plain if alone or self.plastic(blocks, plain, settings) else joints

    def at_once(self, system: BlockSystem) -> bool:
        """Whether a trial of this ``system`` is solved in a few long steps, by operator splitting."""
        return system.plastic or (system.splits_statics and not self.loads.bolts and not self.loads.excavations)


def stability_trial(
    system: BlockSystem, state: State, under: TrialLoads, factor: float, limit: DisplacementLimit
) -> tuple[Trial, State]:
    """Whether the blocks of ``system``, with joint strengths divided by ``factor``, come to rest from ``state`` within
    the displacement ``limit``; and their final state, without velocity."""
    if under.at_once(system):
        return _at_once(system, state, under, factor, limit)
    blocks, way = system.blocks, _Way(system, limit)
    longest = dt = under.longest(system)
    ratios: list[float] = []
    mechanism: StepResult | None = None
    result: StepResult | None = None
    stable, reason, more, most = False, f"still moving after {under.max_steps} steps", 0, math.inf
    for _ in range(under.max_steps):
        try:
            result = system.step(state, under.loads, dt, load_time=under.time, pseudo_inertia=True)
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
        if slow and mechanism is None:
            # The motion now shows the mechanism, with the step length of all trials.
            mechanism = result
        if mechanism is not None:
            # Steps kept short by contacts do not move the blocks far.
            more += 1 if math.isinf(most) else _MORE_STEPS // _SHORT_STEPS
            if more > _MORE_STEPS or len(limit.beyond(state)) or way.goes_on(result, ratios):
                reason = f"keeps moving after {way.of(state)}"
                break
            # If contacts found no states in a longer step, they hardly will in the next.
            most = result.dt if result.statistics["step_cuts"] else most
            dt = min(most, _LONGER * result.dt)
            continue
        # A step that was cut covered less of the time of the loads: continue with its length, and double it up to the
        # full one.
        dt = result.dt if result.statistics["step_cuts"] else min(longest, 2.0 * result.dt)
    moved = limit.moved(state.vertices)
    if result is None:
        nothing = np.zeros((blocks.n_blocks, 2))
        return Trial(factor, False, 0, math.nan, math.nan, nothing, nothing[:, 0], moved, reason), state
    shown = result if stable or mechanism is None else mechanism
    a, free = shown.acceleration, ~blocks.fixed
    step = 0.5 * shown.dt**2 * a
    trial = Trial(
        factor, stable, len(ratios), shown.statistics["unbalanced_ratio"], float(_speeds(shown)[free].max()),
        step[:, :2] * free[:, None], step[:, 2] * free, moved, reason,
    )  # fmt: skip
    return trial, replace(state, velocity=np.zeros_like(state.velocity))


def _at_once(
    system: BlockSystem, state: State, under: TrialLoads, factor: float, limit: DisplacementLimit
) -> tuple[Trial, State]:
    """`stability_trial` in a few long steps, by operator splitting."""
    blocks, way = system.blocks, _Way(system, limit)
    dt = settling_time(system) if system.plastic else pseudo_times(system)[1]
    system.reach = _MARGIN * limit.farthest()
    nothing, drift, ratio, stable = np.zeros((blocks.n_blocks, 3)), math.nan, math.nan, False
    motion, steps, reason = nothing, 0, f"still moving after {_LONG_STEPS} steps"
    for steps in range(1, _LONG_STEPS + 1):
        try:
            result = system.step(state, under.loads, dt, load_time=under.time, pseudo_inertia=True)
        except Unsupported as failure:
            motion, drift, ratio = _mechanism(system, failure)
            reason = f"{failure}"
            break
        except NotConverged as failure:
            reason = f"no consistent contacts: {failure}"
            break
        state, ratio, motion = result.state, result.statistics["unbalanced_ratio"], result.acceleration[:, :3]
        limit.follow(result)
        drift = float(_speeds(result)[~blocks.fixed].max())
        too_far = len(limit.beyond(state)) > 0
        if too_far or (steps > 1 and ratio < under.unbalanced):
            stable = not too_far
            reason = f"{'keeps moving' if too_far else 'at rest'} after {way.of(state)}"
            break
    motion = motion * ~blocks.fixed[:, None]
    moved = limit.moved(state.vertices)
    trial = Trial(factor, stable, steps, ratio, drift, motion[:, :2], motion[:, 2], moved, reason)
    return trial, replace(state, velocity=np.zeros_like(state.velocity))


def _mechanism(system: BlockSystem, failure: Unsupported) -> tuple[np.ndarray, float, float]:
    """The motion (n_blocks, 3) of unsupported blocks, 1 m for the fastest; its acceleration, m/s²; and the largest
    unbalanced force over the weight or mass of its block times 1 m/s²."""
    motion, force, area = failure.motion, failure.unbalanced, system.blocks.areas()
    motion = motion / max(float(np.hypot(motion[:, 0], motion[:, 1]).max()), 1e-300)
    inertia = system.mass * area / 6.0
    mass = float((system.mass * (motion[:, 0] ** 2 + motion[:, 1] ** 2) + inertia * motion[:, 2] ** 2).sum())
    drift = float((force * motion).sum()) / mass
    return motion, drift, float((np.hypot(force[:, 0], force[:, 1]) / system.mass)[~system.blocks.fixed].max())


def _speeds(result: StepResult) -> np.ndarray:
    """(n_blocks,) m/s²: acceleration of the blocks in the step, or angular acceleration times √area if that is
    larger."""
    a, h = result.acceleration, np.sqrt(result.forces.area)
    return np.maximum(np.hypot(a[:, 0], a[:, 1]), h * np.abs(a[:, 2]))


class _Way:
    """Displacement of the blocks in a trial, and its extrapolation."""

    def __init__(self, system: BlockSystem, limit: DisplacementLimit) -> None:
        self._system, self._limit = system, limit
        self._free = ~system.blocks.fixed
        self._steps: list[float] = []

    def of(self, state: State) -> str:
        return f"{self._limit.moved(state.vertices)[self._free].max():.2g} m"

    def follow(self, result: StepResult) -> None:
        """Add the displacement of the fastest block in the step."""
        self._steps.append(0.5 * result.dt**2 * float(_speeds(result)[self._free].max()))

    def goes_on(self, result: StepResult, ratios: list[float]) -> bool:
        """Whether the blocks will move beyond what an equilibrium allows: no contact stops them, and the unbalanced
        force, extrapolated from the last steps, lasts longer."""
        speed = _speeds(result)
        speed[~self._free] = 0.0
        # Until the first block has moved too far; slow ones reach that last.
        with np.errstate(divide="ignore"):
            reach = _MARGIN * float(np.min(self._limit.farthest() / speed))
        first, last, fastest = ratios[-1 - _STEPS], ratios[-1], float(speed.max())
        if first > last and last / (first - last) * sum(self._steps[-_STEPS:]) < _BEYOND * reach * fastest:
            return False
        return not self._barred(result, reach, fastest)

    def _barred(self, result: StepResult, reach: float, fastest: float) -> bool:
        """Whether an open contact would close if the blocks continued at their speeds for the time ``reach``."""
        system, state = self._system, result.state
        window = 2.0 * reach * fastest
        found = system.finder.find(state, np.ascontiguousarray(state.vertices), window, lumped=True)
        speed = np.where(self._free[:, None], result.acceleration, 0.0)
        across = contact_speeds(found, found.geometry, speed, result.forces.centroid)[:, 0]
        closes = (found.state == OPEN) & (found.gap_before > 0.0) & (-across > LITTLE * fastest)
        return bool((found.gap_before < -across * reach)[closes].any())
