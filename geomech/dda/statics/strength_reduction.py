"""Factor of safety by strength reduction: how much weaker the joints may be before the blocks go.

tan φ, cohesion and tensile strength of the joints are divided by F (Zienkiewicz, Humpheson & Lewis 1975; Matsui & San
1992), and the blocks are asked for a static equilibrium, each trial beginning where the last one that held came to
rest. The criterion is a force, not a displacement: a static step of length dt leaves out of balance what moves the
blocks by a dt²/2. In a stable trial the unbalanced force falls to round-off within a few steps; in an unstable one it
stays, however often the step is repeated, and for sliding it grows as A − B/F. Two unstable trials thus point at the
factor between them, and few more close in. What falls too slowly to tell, as where a soft anchor has yet to be
stretched, is followed with longer steps, until it is at rest or has moved farther than an equilibrium may
(`displacement_limit`).

Sharp toes in re-entrant corners are rounded (`toes`): what else they would hold is told beside.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...model import GROUND, OPEN, Blocks, DdaSettings, JointLaw, Loads, Material, State
from ..kinematics.simplex_integration import block_moments
from ..loads.bolts import labels
from ..results import NotConverged, StepResult
from ..system import BlockSystem
from .displacement_limit import MOVED, DisplacementLimit
from .pseudo_time_equilibrium import equilibrium
from .sharp_toes import FREE, ROUNDED, SHARP, Toe

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
#: A trial whose unbalanced force does not tell goes on with steps this many times as long, so many of them.
_LONGER, _MORE_STEPS = 4.0, 30
#: What bounds the factor from above is tried again from just below it, if it was begun from farther than so many times
#: the tolerance.
_FROM_AFAR = 3.0
#: Toes bar the way of blocks that come nearer to what they touch by this part of the fastest block's way, and hold
#: what is more than this part of their block's weight.
_BARRED, _BEARS = 1e-3, 1e-3
#: A bolt within this part of its yield force is at it.
_AT_YIELD = 1e-6
#: A bolt that never yields has taken on load when it bears more than its pretension by this part.
_TAKEN = 1e-3
#: The search for a trial that stands, and for one that does not, ends at this factor.
_FARTHEST = 64.0


class NothingToReduce(ValueError):
    """What was asked for has no factor of safety: no such strength, nothing that could fail, a load that statics do not
    know."""


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
class Anchor:
    """A bolt of the loads as it holds at the factor: ``force`` N/m in it, by how much it is stretched (``stretch`` m) since it
    was installed, how far its block has ``moved`` (m) for that, and whether it ``yields``."""

    name: str
    force: float
    stretch: float
    moved: float
    yields: bool


@dataclass(frozen=True, eq=False)
class FactorOfSafety:
    """``factor`` lies between ``lower``, the largest F with an equilibrium that was found, and ``upper``, the smallest
    without (inf: none up to 64); ``trials`` in the order made; ``mechanism``: what moves just above the factor, in
    words, a line a block; ``moving`` those blocks, the fastest first; ``state`` the equilibrium at ``lower``; ``moved``
    (n_blocks,) m, how far blocks have come to it, the initial settlement included; ``anchors`` what bolts hold there.

    ``toes`` bar the way of what moves. Where they are rounded and hold nothing, ``other_factor`` is what it would be
    were their tips sharp; where they hold (``toes_hold``), what it is without them; None where it is not known. ``warnings``
    in words."""

    factor: float
    lower: float
    upper: float
    trials: tuple[Trial, ...]
    moving: tuple[int, ...]
    mechanism: tuple[str, ...]
    state: State
    moved: np.ndarray
    anchors: tuple[Anchor, ...] = ()
    toes: tuple[Toe, ...] = ()
    toes_hold: bool = False
    other_factor: float | None = None
    warnings: tuple[str, ...] = ()

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
        lines += [f"  {line}" for line in self.mechanism]
        for a in self.anchors:
            state = "at its yield force" if a.yields else "not at its yield force"
            lines.append(
                f"  bolt {a.name}: {a.force / 1e3:.4g} kN/m, {state}, stretched by {1e3 * a.stretch:.3g} mm, its block "
                f"has moved {1e3 * a.moved:.3g} mm"
            )
        return "\n".join([*lines, *(f"  warning: {line}" for line in self.warnings)])

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
            "moved_m": dict(zip(blocks.names, self.moved.tolist(), strict=True)),
            "anchors": [vars(a) for a in self.anchors],
            "toes": [
                {
                    "block": blocks.names[t.block],
                    "other": blocks.names[t.other],
                    "at": list(t.at),
                    "stands_off_m": t.stands_off,
                    "force": t.force,
                }
                for t in self.toes
            ],
            "toes_hold": self.toes_hold,
            "factor_without_toes" if self.toes_hold else "factor_with_sharp_toes": self.other_factor,
            "warnings": list(self.warnings),
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
    toes: str = ROUNDED,
    compare_toes: bool = True,
) -> FactorOfSafety:
    """The factor F by which the strength of the joints can be divided before no static equilibrium is left.

    Loads are those of ``load_time`` s, after excavations up to then. ``state`` is where the first trial begins
    (default: blocks at rest). ``reduce`` names the joint laws that are weakened (default: all). The answer is bracketed
    to ``tolerance`` (relative); a trial stands when no block has more than the part ``unbalanced`` of the forces on it
    left to move it. Static steps are ``time_step`` s long (default: free fall over it is a hundredth of the smallest
    block). ``watch`` sees every trial. ``toes`` are "rounded", "sharp" or "free", see `toes`; with ``compare_toes``
    rounded ones whose tips would hold, and others that hold, are told with the factor that it would be otherwise.

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

    def with_strength(factor: float) -> BlockSystem:
        laws = [reduced(law, factor) if law.name in chosen else law for law in joints]
        system = BlockSystem(blocks, materials, laws, joint_index, settings)
        system.finder.toes = toes
        return system

    def otherwise(way: str) -> FactorOfSafety | None:
        """The answer with other toes; None where the blocks do not stand."""
        try:
            return factor_of_safety(
                blocks, materials, joints, loads, settings, joint_index=joint_index, state=state, load_time=load_time,
                reduce=reduce, tolerance=tolerance, unbalanced=unbalanced, time_step=time_step, max_steps=max_steps,
                toes=way, compare_toes=False,
            )  # fmt: skip
        except NotConverged:
            return None

    def _told(found: FactorOfSafety, failed: Trial | None = None) -> FactorOfSafety:
        """With what bolts hold, and what toes do or would."""
        held = found.state
        found = _with_anchors(blocks, loads, found)
        system = with_strength(found.lower)
        if toes == FREE or not compare_toes:
            return found
        holding = _holding(with_strength(found.lower), held, loads, load_time)
        if holding:
            return _held_by_toes(blocks, found, holding, otherwise(FREE))
        bars = () if toes == SHARP or failed is None else _toes(system, held, failed)
        if bars:
            sharp = otherwise(SHARP)
            if sharp is not None and sharp.upper > found.upper * (1.0 + tolerance):
                lines = _of_toes(blocks, bars, sharp, False)
                return replace(found, toes=bars, other_factor=sharp.factor, warnings=(*found.warnings, *lines))
        return found

    def tried(factor: float, start: State) -> tuple[Trial, State]:
        trial, end = _trial(
            with_strength(factor), start, loads, load_time, factor, unbalanced, max_steps, time_step, limit
        )
        trials.append(trial)
        log.info("F = %.5g: %s", factor, trial.reason)
        if watch is not None:
            watch(trial)
        return trial, end

    rest = State.at_rest(blocks) if state is None else state
    begun, limit = _relaxed(with_strength(1.0), loads, rest, load_time)
    trial, held = tried(1.0, begun)
    while not trial.stable:
        if trial.factor <= 1.0 / _FARTHEST:
            sharp = otherwise(SHARP) if toes == ROUNDED and compare_toes and _toes(with_strength(1.0), rest) else None
            if sharp is not None:
                return _held_by_toes(
                    blocks, sharp, _holding(with_strength(sharp.lower), sharp.state, loads, load_time), None
                )
            raise NotConverged(
                f"the blocks do not stand even with joints {_FARTHEST:g} times as strong: {trial.reason}; "
                "what moves is not held by joint strength, or the contacts find no states"
            )
        weak = 0.5 * trial.factor
        begun, limit = _relaxed(with_strength(weak), loads, rest, load_time)
        trial, held = tried(weak, begun)
    lower, began = trial.factor, {t.factor: 0.0 for t in trials}
    while True:
        # What has failed from far below may stand when it is come to by small steps.
        known = {t.factor: t for t in trials if t.stable or t.factor > lower}
        upper = min((factor for factor, t in known.items() if not t.stable), default=math.inf)
        if math.isinf(upper):
            if lower >= _FARTHEST:
                return _told(
                    FactorOfSafety(lower, lower, math.inf, tuple(trials), (), (), held, limit.moved(held.vertices))
                )
            factor = 2.0 * lower
        elif upper > lower * (1.0 + tolerance):
            factor = _next_factor(list(known.values()), lower, upper, tolerance)
        elif began[upper] < lower * (1.0 - _FROM_AFAR * tolerance):
            factor = upper
        else:
            break
        began[factor] = lower
        trial, end = tried(factor, held)
        if trial.stable:
            lower, held = trial.factor, end
    last = known[upper]
    moving = _moving(last)
    factor = _pointed_at(list(known.values()), lower, upper)
    return _told(
        FactorOfSafety(
            factor, lower, upper, tuple(trials), moving, _mechanism(blocks, last, moving), held,
            limit.moved(held.vertices),
        ),
        last,
    )  # fmt: skip


def _relaxed(system: BlockSystem, loads: Loads, state: State, load_time: float) -> tuple[State, DisplacementLimit]:
    """Where the blocks come to rest from ``state``, at ``load_time``: what is dug out or bolted by then is so in the
    step that follows; ``state`` itself if they do not. And how far they may move from there."""
    limit = DisplacementLimit(system, state, loads, load_time)
    found = equilibrium(system, state, loads, load_time=load_time, max_steps=_RELAXING, limit=limit)
    if found.converged:
        return replace(found.state, time=max(state.time, load_time)), limit
    return state, DisplacementLimit(system, state, loads, load_time)


def _toes(system: BlockSystem, state: State, failed: Trial | None = None) -> tuple[Toe, ...]:
    """The toes of blocks in ``state`` that bar the way of what has ``failed``; all of them without."""
    found = system.contacts_near(state)
    off = system.finder.toes_among(found, state.vertices)
    borne = {(int(row["vertex"]), int(row["edge"])): row for row in state.contacts[state.contacts["state"] != OPEN]}
    centre = None if failed is None else block_moments(state.vertices, system.next, system.vertex_start)[:, 1:3]
    out = []
    for k in np.flatnonzero(off >= 0.0):
        a, b = int(found.block[k]), int(found.other[k])
        at = found.geometry[k, 5:7]
        if failed is not None:
            apart = np.zeros(2)
            for block, sign in ((a, 1.0), (b, -1.0)):
                x, y = at - centre[block]
                apart += sign * (failed.displacement[block] + failed.rotation[block] * np.array([-y, x]))
            fastest = float(np.hypot(*failed.displacement.T).max())
            if not apart @ found.geometry[k, 1:3] < -_BARRED * fastest:
                continue
        row = borne.get((int(found.vertex[k]), int(found.edge[k])))
        force = 0.0 if row is None else float(row["normal_force"])
        out.append(
            Toe(a, b, int(found.vertex[k]), int(found.edge[k]), (float(at[0]), float(at[1])), float(off[k]), force)
        )
    return tuple(out)


def reduced(law: JointLaw, factor: float) -> JointLaw:
    """``law`` with tan φ, cohesion and tensile strength (their residuals too) divided by ``factor``; an angle of
    dilation is kept as long as it is below that of friction.

    A face that yields before others do keeps its cohesion on what it slips until these yield too, unless the law says
    what strength slip leaves: limit equilibrium counts all of it, and which face yields first is a matter of how stiff
    springs share loads."""
    if law.roughness is not None:
        rough = replace(law.roughness, reduction=law.roughness.reduction * factor)
        return replace(law, roughness=rough)

    def angle(of: float | None) -> float | None:
        return None if of is None else math.atan(math.tan(of) / factor)

    friction = angle(law.friction_angle)
    softens = law.residual_friction_angle is not None or law.residual_cohesion > 0 or law.softening_slip > 0
    kept = law.residual_cohesion if softens else law.cohesion
    return replace(
        law,
        friction_angle=friction,
        cohesion=law.cohesion / factor,
        tensile_strength=law.tensile_strength / factor,
        residual_friction_angle=angle(law.residual_friction_angle),
        residual_cohesion=kept / factor,
        dilation_angle=min(law.dilation_angle, friction),
    )


def _anchors(loads: Loads, state: State, moved: np.ndarray) -> tuple[Anchor, ...]:
    """What the bolts of ``loads`` hold in ``state``."""
    out = []
    for bolt, name, row in zip(loads.bolts, labels(loads.bolts), state.bolts, strict=False):
        if not row["installed"] or row["broken"]:
            continue
        force = float(row["force"])
        stretch = (force - bolt.pretension) / bolt.stiffness + float(row["plastic"])
        far = max(float(moved[b]) for b in (bolt.block, bolt.other) if b != GROUND)
        out.append(Anchor(name, force, stretch, far, force >= bolt.yield_force * (1.0 - _AT_YIELD)))
    return tuple(out)


def _with_anchors(blocks: Blocks, loads: Loads, found: FactorOfSafety) -> FactorOfSafety:
    """The answer ``found`` with what bolts hold in it, and a warning where they hold less than they could or only after
    their blocks have visibly moved."""
    anchors, lines = _anchors(loads, found.state, found.moved), []
    size = np.sqrt(blocks.areas())
    for bolt, anchor in zip((b for b, row in zip(loads.bolts, found.state.bolts, strict=False)
                             if row["installed"] and not row["broken"]), anchors, strict=True):  # fmt: skip
        least = min(float(size[b]) for b in (bolt.block, bolt.other) if b != GROUND)
        if math.isinf(bolt.yield_force) and anchor.force > bolt.pretension * (1.0 + _TAKEN):
            lines.append(
                f"bolt {anchor.name} has no yield force: it counts with the {anchor.force / 1e3:.4g} kN/m that it takes "
                f"while its block moves {1e3 * anchor.moved:.3g} mm"
            )
        elif anchor.moved > MOVED * least and anchor.stretch > 0.0:
            lines.append(
                f"bolt {anchor.name} takes its {anchor.force / 1e3:.4g} kN/m only once its block has moved "
                f"{1e3 * anchor.moved:.3g} mm, {100 * anchor.moved / least:.2g} % of the block's size"
            )
    return replace(found, anchors=anchors, warnings=(*found.warnings, *lines))


def _holding(system: BlockSystem, state: State, loads: Loads, load_time: float) -> tuple[Toe, ...]:
    """The toes that bear forces in ``state``."""
    weight = system.mass * float(np.hypot(*loads.gravity.at(load_time)))
    system.finder.toes = FREE
    return tuple(toe for toe in _toes(system, state) if toe.force > _BEARS * weight[toe.block])


def _held_by_toes(
    blocks: Blocks, found: FactorOfSafety, toes: tuple[Toe, ...], without: FactorOfSafety | None
) -> FactorOfSafety:
    """The answer ``found`` with the ``toes`` that hold in it, and what it would be ``without`` them."""
    other = None if without is None else without.factor
    lines = _of_toes(blocks, toes, without, True)
    return replace(found, toes=toes, toes_hold=True, other_factor=other, warnings=(*found.warnings, *lines))


def _of_toes(blocks: Blocks, toes: tuple[Toe, ...], other: FactorOfSafety | None, hold: bool) -> tuple[str, ...]:
    """What toes hold or would, in words; ``other`` is the answer without them or with sharp tips."""

    def factor(of: FactorOfSafety) -> str:
        return f"{of.factor:.4f}" if math.isfinite(of.upper) else f"above {of.lower:g}"

    lines = []
    for toe in toes[:_TOLD]:
        a, b = (blocks.names[k] if blocks.names else f"block {k}" for k in (toe.block, toe.other))
        where = f"the toe of {a!r} touches {b!r} at x = {_metres(toe.at[0])}, y = {_metres(toe.at[1])} m"
        if hold:
            without = "the blocks do not stand" if other is None else f"the factor is {factor(other)}"
            lines.append(f"{where} and holds {toe.force / 1e3:.4g} kN/m; without it {without}")
        else:
            lines.append(
                f"{where}; rounded, it stands off by {toe.stands_off:.3g} m and holds nothing before it has moved as far. "
                f"A sharp tip would hold: factor {factor(other)}, which is not to be relied on"
            )
    return tuple(lines)


def _metres(value: float) -> str:
    """To the millimetre; adding zero makes a plain 0 of −0."""
    return f"{round(value, 3) + 0.0:.7g}"


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
    limit: DisplacementLimit,
) -> tuple[Trial, State]:
    """Static steps until the unbalanced force has gone or does not go, and where that does not tell, until blocks have
    moved farther than the ``limit`` allows."""
    blocks = system.blocks
    size = math.sqrt(float(blocks.areas()[~blocks.fixed].min()))
    pull = max(float(np.hypot(*loads.gravity.at(load_time))), 1e-3)
    longest = dt = math.sqrt(2.0 * _FALL * size / pull) if time_step is None else float(time_step)
    ratios: list[float] = []
    told: StepResult | None = None
    result: StepResult | None = None
    stable, reason, more = False, f"still moving after {max_steps} steps", 0

    def way(state: State) -> str:
        return f"{limit.moved(state.vertices)[~blocks.fixed].max():.2g} m"

    for _ in range(max_steps):
        try:
            result = system.step(state, loads, dt, load_time=load_time)
        except NotConverged as failure:
            reason = f"no consistent contacts: {failure}"
            break
        state = result.state
        limit.follow(result)
        ratios.append(result.statistics["unbalanced_ratio"])
        at_rest, beyond = len(ratios) > 1 and ratios[-1] < tolerance, len(limit.beyond(state)) > 0
        if at_rest:
            stable, reason = not beyond, f"at rest {'only ' if beyond else ''}after {way(state)}"
            break
        slow = len(ratios) >= _LEAST_STEPS and ratios[-1] > _FALLING * ratios[-1 - _STEPS]
        if slow and told is None:
            # What moves now tells of the mechanism, with the step's length that all trials have.
            told = result
        if told is not None:
            more += 1
            if beyond or more > _MORE_STEPS:
                reason = f"moves on after {way(state)}"
                break
            dt = _LONGER * result.dt
            continue
        # A step that was cut took less of the forces' time: go on with its length, and back to the full one by
        # doubling.
        dt = result.dt if result.statistics["step_cuts"] else min(longest, 2.0 * result.dt)
    moved = limit.moved(state.vertices)
    if result is None:
        nothing = np.zeros((blocks.n_blocks, 2))
        return Trial(factor, False, 0, math.nan, math.nan, nothing, nothing[:, 0], moved, reason), state
    shown = result if stable or told is None else told
    a, h = shown.acceleration, np.sqrt(shown.forces.area)
    free = ~blocks.fixed
    drift = np.maximum(np.hypot(a[:, 0], a[:, 1]), h * np.abs(a[:, 2]))[free].max()
    step = 0.5 * shown.dt**2 * a
    trial = Trial(
        factor, stable, len(ratios), shown.statistics["unbalanced_ratio"], float(drift), step[:, :2] * free[:, None],
        step[:, 2] * free, moved, reason,
    )  # fmt: skip
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
