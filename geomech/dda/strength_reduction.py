"""Factor of safety by strength reduction: how much weaker the joints may be before the blocks go.

tan φ, cohesion and tensile strength of the joints are divided by F (Zienkiewicz, Humpheson & Lewis 1975; Matsui & San
1992), and the blocks are asked for a static equilibrium, each trial beginning where the last one that held came to
rest. The criterion is a force, not a displacement: a static step of length dt leaves out of balance what moves the
blocks by a dt²/2. In a stable trial the unbalanced force falls to round-off within a few steps; in an unstable one it
stays, however often the step is repeated, and for sliding it grows as A − B/F. Two unstable trials thus point at the
factor between them, and few more close in.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..model import Blocks, DdaSettings, JointLaw, Loads, Material, State
from .equilibrium import equilibrium
from .step import NotConverged, StepResult
from .system import BlockSystem

log = logging.getLogger(__name__)

#: Free fall over a step takes a block this part of its size √area: long beside contact vibrations, short for geometry.
_FALL = 0.01
#: An unbalanced force that has not fallen by this factor over so many steps does not fall.
_FALLING, _STEPS = 0.8, 6
#: No trial is called unstable before it has made so many steps.
_LEAST_STEPS = 10
#: So many blocks of a mechanism are described; one that turns by more than this (rad) as it goes its own size is said
#: to.
_TOLD, _TURNS = 8, 0.05
#: So many steps of relaxation may go before the first trial.
_RELAXING = 100
#: The search for a trial that stands, and for one that does not, ends at this factor.
_FARTHEST = 64.0


class NothingToReduce(ValueError):
    """What was asked for has no factor of safety: no such strength, nothing that could fail, a load that statics do not
    know."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One reduced strength. ``factor`` F; ``stable``; static ``steps`` made; ``unbalanced`` the part of the forces on a
    block that is left to move it, where it is largest; ``drift`` m/s², that block's acceleration; ``displacement``
    (n_blocks, 2) m and ``rotation`` (n_blocks,) rad of the last step; ``reason`` in words."""

    factor: float
    stable: bool
    steps: int
    unbalanced: float
    drift: float
    displacement: np.ndarray
    rotation: np.ndarray
    reason: str


@dataclass(frozen=True, eq=False)
class FactorOfSafety:
    """``factor`` lies between ``lower``, the largest F with an equilibrium that was found, and ``upper``, the smallest
    without (inf: none up to 64); ``trials`` in the order made; ``mechanism``: what moves just above the factor, in
    words, a line a block; ``moving`` those blocks, the fastest first; ``state`` the equilibrium at ``lower``."""

    factor: float
    lower: float
    upper: float
    trials: tuple[Trial, ...]
    moving: tuple[int, ...]
    mechanism: tuple[str, ...]
    state: State

    def table(self, title: str = "factor of safety") -> str:
        """The trials by F, the factor under its ``title``, and the mechanism, as text."""
        lines = ["       F  equilibrium  steps  unbalanced  drift m/s²"]
        for t in sorted(self.trials, key=lambda t: t.factor):
            answer = "yes" if t.stable else "no"
            lines.append(
                f"{t.factor:8.4f}  {answer:<11}  {t.steps:5d}  {t.unbalanced:10.2e}  {t.drift:10.2e}  {t.reason}"
            )
        found = f"{self.factor:.4f}" if math.isfinite(self.upper) else f"above {self.lower:g}"
        lines.append(f"{title} {found}" + (", moving at failure:" if self.mechanism else ""))
        return "\n".join([*lines, *(f"  {line}" for line in self.mechanism)])

    def as_dict(self, blocks: Blocks) -> dict[str, object]:
        """Plain numbers for a file: the answer, its trials, and how ``blocks`` move at failure, the farthest one
        by 1."""
        failed = min((t for t in self.trials if not t.stable), key=lambda t: t.factor, default=None)
        moving = {}
        if failed is not None and self.moving:
            far = float(np.hypot(*failed.displacement[self.moving[0]]))
            for b in self.moving:
                way, turn = (failed.displacement[b] / far).tolist(), float(failed.rotation[b] / far)
                moving[blocks.names[b]] = {"displacement": way, "rotation_per_m": turn}
        plain = ("factor", "stable", "steps", "unbalanced", "drift", "reason")
        return {
            "factor_of_safety": self.factor,
            "lower": self.lower,
            "upper": self.upper if math.isfinite(self.upper) else None,
            "moving": moving,
            "trials": [{name: getattr(t, name) for name in plain} for t in self.trials],
        }


def factor_of_safety(
    blocks: Blocks,
    materials: Sequence[Material],
    joints: Sequence[JointLaw],
    loads: Loads,
    settings: DdaSettings | None = None,
    *,
    joint_index: Callable[[str, str], int | None] | None = None,
    state: State | None = None,
    load_time: float = 0.0,
    reduce: Sequence[str] | None = None,
    tolerance: float = 2e-3,
    unbalanced: float = 1e-5,
    time_step: float | None = None,
    max_steps: int = 200,
    watch: Callable[[Trial], None] | None = None,
) -> FactorOfSafety:
    """The factor F by which the strength of the joints can be divided before no static equilibrium is left.

    Loads are those of ``load_time`` s, after excavations up to then. ``state`` is where the first trial begins
    (default: blocks at rest). ``reduce`` names the joint laws that are weakened (default: all). The answer is bracketed
    to ``tolerance`` (relative); a trial stands when no block has more than the part ``unbalanced`` of the forces on it
    left to move it. Static steps are ``time_step`` s long (default: free fall over it is a hundredth of the smallest
    block). ``watch`` sees every trial.

    Coulomb friction does not settle the forces of a system uniquely: strengths are reduced step by step from what
    stands, and another way there may find a factor that differs by some thousandths where contacts slide and stick
    again.

    Raises `NothingToReduce` when there is no strength to reduce, nothing that moves, or a ground that does,
    `NotConverged` when the blocks do not stand even with joints 64 times as strong.
    """
    names = [law.name for law in joints]
    unknown = [name for name in reduce or () if name not in names]
    if unknown:
        raise NothingToReduce(
            f"no joint {', '.join(map(repr, unknown))} to reduce; there are {', '.join(map(repr, names))}"
        )
    chosen = set(names if reduce is None else reduce)
    if not any(_has_strength(law) for law in joints if law.name in chosen):
        raise NothingToReduce("the joints have no friction, cohesion or tensile strength that could be reduced")
    if not 0 < tolerance < 1:
        raise NothingToReduce(f"the tolerance of the factor must lie between 0 and 1, got {tolerance!r}")
    if blocks.fixed.all():
        raise NothingToReduce("all blocks are fixed: none could fail")
    if loads.base is not None and loads.base.frame == "ground":
        raise NothingToReduce(
            'statics know no ground that moves: leave the base\'s motion out, or give it the frame "base", in which it '
            "is the"
            " weight's own kind of force, the one of the time that is asked for"
        )
    trials: list[Trial] = []
    settings = replace(settings or DdaSettings(), dynamic_factor=0.0)

    def tried(factor: float, start: State) -> tuple[Trial, State]:
        laws = [reduced(law, factor) if law.name in chosen else law for law in joints]
        system = BlockSystem(blocks, materials, laws, joint_index, settings)
        trial, end = _trial(system, start, loads, load_time, factor, unbalanced, max_steps, time_step)
        trials.append(trial)
        log.info("F = %.5g: %s", factor, trial.reason)
        if watch is not None:
            watch(trial)
        return trial, end

    rest = State.at_rest(blocks) if state is None else state
    trial, held = tried(1.0, _relaxed(blocks, materials, joints, loads, settings, joint_index, rest, load_time))
    while not trial.stable:
        if trial.factor <= 1.0 / _FARTHEST:
            raise NotConverged(
                f"the blocks do not stand even with joints {_FARTHEST:g} times as strong: {trial.reason}; "
                "what moves is not held by joint strength, or the contacts find no states"
            )
        weak = 0.5 * trial.factor
        laws = [reduced(law, weak) if law.name in chosen else law for law in joints]
        trial, held = tried(weak, _relaxed(blocks, materials, laws, loads, settings, joint_index, rest, load_time))
    lower = trial.factor
    upper = min((t.factor for t in trials if not t.stable), default=math.inf)
    while math.isinf(upper):
        if lower >= _FARTHEST:
            return FactorOfSafety(lower, lower, math.inf, tuple(trials), (), (), held)
        trial, end = tried(2.0 * lower, held)
        if trial.stable:
            lower, held = trial.factor, end
        else:
            upper = trial.factor
    while upper > lower * (1.0 + tolerance):
        trial, end = tried(_next_factor(trials, lower, upper, tolerance), held)
        if trial.stable:
            lower, held = trial.factor, end
        else:
            upper = trial.factor
    last = min((t for t in trials if not t.stable), key=lambda t: t.factor)
    moving = _moving(last)
    factor = _pointed_at(trials, lower, upper)
    return FactorOfSafety(factor, lower, upper, tuple(trials), moving, _mechanism(blocks, last, moving), held)


def _relaxed(blocks, materials, joints, loads, settings, joint_index, state: State, load_time: float) -> State:
    """Where the blocks come to rest from ``state``, at ``load_time``: what is dug out or bolted by then is so in the
    step that follows. ``state`` itself if they do not."""
    system = BlockSystem(blocks, materials, joints, joint_index, settings)
    found = equilibrium(system, state, loads, load_time=load_time, max_steps=_RELAXING)
    return replace(found.state, time=max(state.time, load_time)) if found.converged else state


def reduced(law: JointLaw, factor: float) -> JointLaw:
    """``law`` with tan φ, cohesion and tensile strength (their residuals too) divided by ``factor``; an angle of
    dilation is kept as long as it is below that of friction."""
    if law.roughness is not None:
        rough = replace(law.roughness, reduction=law.roughness.reduction * factor)
        return replace(law, roughness=rough)

    def angle(of: float | None) -> float | None:
        return None if of is None else math.atan(math.tan(of) / factor)

    friction = angle(law.friction_angle)
    return replace(
        law,
        friction_angle=friction,
        cohesion=law.cohesion / factor,
        tensile_strength=law.tensile_strength / factor,
        residual_friction_angle=angle(law.residual_friction_angle),
        residual_cohesion=law.residual_cohesion / factor,
        dilation_angle=min(law.dilation_angle, friction),
    )


def _has_strength(law: JointLaw) -> bool:
    return law.friction_angle > 0 or law.cohesion > 0 or law.tensile_strength > 0 or law.roughness is not None


def _trial(
    system: BlockSystem,
    state: State,
    loads: Loads,
    load_time: float,
    factor: float,
    tolerance: float,
    max_steps: int,
    time_step: float | None,
) -> tuple[Trial, State]:
    """Static steps until the unbalanced force has gone or does not go."""
    blocks = system.blocks
    size = math.sqrt(float(blocks.areas()[~blocks.fixed].min()))
    pull = max(float(np.hypot(*loads.gravity.at(load_time))), 1e-3)
    longest = dt = math.sqrt(2.0 * _FALL * size / pull) if time_step is None else float(time_step)
    begin = state.vertices
    ratios: list[float] = []
    result: StepResult | None = None
    stable, reason = False, f"still moving after {max_steps} steps"
    for _ in range(max_steps):
        try:
            result = system.step(state, loads, dt, load_time=load_time)
        except NotConverged as failure:
            reason = f"no consistent contacts: {failure}"
            break
        state = result.state
        # A step that was cut took less of the forces' time: go on with its length, and back to the full one by
        # doubling.
        dt = result.dt if result.statistics["step_cuts"] else min(longest, 2.0 * result.dt)
        ratios.append(result.statistics["unbalanced_ratio"])
        travelled = float(np.hypot(*(state.vertices - begin).T).max())
        if len(ratios) > 1 and ratios[-1] < tolerance:
            stable, reason = True, f"at rest after {travelled:.2g} m"
            break
        if len(ratios) >= _LEAST_STEPS and ratios[-1] > _FALLING * ratios[-1 - _STEPS]:
            reason = f"moves on after {travelled:.2g} m"
            break
    if result is None:
        nothing = np.zeros((blocks.n_blocks, 2))
        return Trial(factor, False, 0, math.nan, math.nan, nothing, nothing[:, 0], reason), state
    a, h = result.acceleration, np.sqrt(result.forces.area)
    free = ~blocks.fixed
    drift = np.maximum(np.hypot(a[:, 0], a[:, 1]), h * np.abs(a[:, 2]))[free].max()
    moved = 0.5 * result.dt**2 * a
    trial = Trial(
        factor, stable, len(ratios), ratios[-1], float(drift), moved[:, :2] * free[:, None], moved[:, 2] * free, reason
    )
    return trial, replace(state, velocity=np.zeros_like(state.velocity))


def _pointed_at(trials: Sequence[Trial], lower: float, upper: float) -> float:
    """Where the drift of the two weakest failures goes to nothing, drift = A − B/F; between ``lower`` and ``upper``."""
    failed = sorted((t for t in trials if not t.stable and math.isfinite(t.drift)), key=lambda t: t.factor)[:2]
    middle = 2.0 * lower * upper / (lower + upper)
    if len(failed) < 2 or not failed[1].drift > failed[0].drift:
        return middle
    (x, p), (y, q) = ((1.0 / t.factor, t.drift) for t in failed)
    inverse = x + p * (x - y) / (q - p)
    return 1.0 / inverse if 1.0 / upper < inverse < 1.0 / lower else middle


def _next_factor(trials: Sequence[Trial], lower: float, upper: float, tolerance: float) -> float:
    """The F to try: just beside where the drift points, on the side that is farther off; the middle when it does not
    point."""
    middle = 2.0 * lower * upper / (lower + upper)
    failed = [t for t in trials if not t.stable and math.isfinite(t.drift)]
    if len(failed) < 2:
        return middle
    aim = _pointed_at(trials, lower, upper)
    margin = 0.4 * tolerance
    below, above = aim * (1.0 - margin), aim * (1.0 + margin)
    if lower < below and not lower > aim * (1.0 - 2.0 * margin):
        return below
    return above if above < upper else middle


def _moving(trial: Trial) -> tuple[int, ...]:
    """The blocks that move by more than a tenth of the farthest, the fastest first."""
    far = np.hypot(*trial.displacement.T)
    order = np.argsort(-far, kind="stable")
    return tuple(order[far[order] > 0.1 * far.max()].tolist()) if far.max() > 0 else ()


def _mechanism(blocks: Blocks, trial: Trial, moving: tuple[int, ...]) -> tuple[str, ...]:
    """A line for each of the fastest blocks."""
    fastest = float(np.hypot(*trial.displacement[list(moving[:1])].T).max()) if moving else 1.0
    lines = []
    for block in moving[:_TOLD]:
        (x, y), turn = trial.displacement[block], trial.rotation[block]
        far = math.hypot(x, y)
        name = blocks.names[block] if blocks.names else f"block {block}"
        # Adding zero makes a plain 0 of −0.
        text = f"{name}: {far / fastest:.2f} of the fastest, towards {round(math.degrees(math.atan2(y, x))) + 0}°"
        size = math.sqrt(abs(float(blocks.areas()[block])))
        if abs(turn) * size > _TURNS * far:
            turned = f"{math.degrees(abs(turn)) * size / far:.0f}° while it goes its own size, √area"
            text += f", turning {'left' if turn > 0 else 'right'} by {turned}"
        lines.append(text)
    if len(moving) > _TOLD:
        lines.append(f"and {len(moving) - _TOLD} more of {blocks.n_blocks} blocks")
    return tuple(lines)
