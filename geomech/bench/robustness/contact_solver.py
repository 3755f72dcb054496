"""Ablation of the contact solver: its methods switched off one by one on the same problems.

The problems are random slopes (blocks only), slopes and walls under sudden weight, dynamic and static, with friction,
cohesion and bonds, arches at their limit thickness, debris, and searches for a factor of safety. A problem has failed
if it ends in an error or exceeds its processor time. Iterations are those of accepted steps; the cost of cuts appears
in their number and in the time.
"""

from __future__ import annotations

import logging
import time
import tomllib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from ... import dda
from ...model import Blocks, ContactSolver, DdaSettings, JointLaw, Joints, Material, State
from ...reference.blocks import masonry
from ..cost import block_scenes
from ..figures import Measured
from ..safety.factor_scenes import random_slope as factor_slope
from ..slopes.drawn_slopes import problem_of
from ..slopes.limited_runs import RIGHT, limited
from ..slopes.random_slopes import scene_text
from ..slopes.sliding_scenes import random_slope as sliding_slope
from . import debris

#: Processor time limit of a problem, s.
LIMIT = 40.0
#: Seeds of random slopes, of sliding slopes and of slopes with a factor of safety.
SLOPES, SLIDING, FACTORS = range(40), (1, 4, 5, 8, 13, 18), range(10)
QUICK_SLOPES, QUICK_SLIDING, QUICK_FACTORS = (3, 5, 12, 16, 32, 34), (13,), (0, 1)


@dataclass
class Count:
    """Cost of a problem: ``iterations`` of each accepted step, ``cuts``, processor ``seconds``; whether it was
    ``solved``."""

    iterations: list[float] = field(default_factory=list)
    cuts: int = 0
    seconds: float = 0.0
    solved: bool = True
    why: str = ""


Run = Callable[[ContactSolver], None]


@dataclass(frozen=True)
class Problem:
    """A problem of a ``group``; ``run`` solves it with given settings of the contact solver."""

    group: str
    name: str
    run: Run


def random_blocks(seed: int, solver: ContactSolver) -> None:
    """The blocks of a random slope, with closed cracks."""
    problem = problem_of(tomllib.loads(scene_text(seed)))
    for _ in dda.run(
        problem.blocks, problem.materials, Joints(problem.joints, problem.joint_index), problem.loads,
        replace(problem.dda, contact_solver=solver), problem.run.end_time,
    ):  # fmt: skip
        pass


def sliding(seed: int, solver: ContactSolver, dt: float = 4e-3, end: float = 0.2) -> None:
    """A slope that slides on its beds."""
    problem = problem_of(tomllib.loads(sliding_slope(seed).text(dt, end)))
    for _ in dda.run(
        problem.blocks, problem.materials, Joints(problem.joints, problem.joint_index), problem.loads,
        replace(problem.dda, contact_solver=solver), end,
    ):  # fmt: skip
        pass


def sudden(blocks: Blocks, steps: int, dt: float, dynamic: bool, law: dict, solver: ContactSolver) -> None:
    """``steps`` steps of ``dt`` s from rest under sudden weight; ``law`` of the joints in addition to friction."""
    joint = JointLaw("joint", **({"friction_angle": block_scenes.FRICTION} | law))
    settings = replace(block_scenes.settings(dt, dynamic), contact_solver=solver)
    system, state = dda.BlockSystem(blocks, [block_scenes.ROCK], [joint], settings=settings), State.at_rest(blocks)
    for _ in range(steps):
        state = system.step(state, block_scenes.WEIGHT).state


def at_rest(blocks: Blocks, law: dict, solver: ContactSolver) -> None:
    """Static equilibrium from scratch."""
    joint = JointLaw("joint", **({"friction_angle": block_scenes.FRICTION} | law))
    settings = replace(block_scenes.settings(1.0, dynamic=False), contact_solver=solver)
    system = dda.BlockSystem(blocks, [block_scenes.ROCK], [joint], settings=settings)
    found = dda.equilibrium(system, State.at_rest(blocks), block_scenes.WEIGHT, limits=dda.RelaxationLimits(60))
    if not found.converged and not found.collapsed:
        raise dda.NotConverged(found.reason)


def arch(share: float, dynamic: bool, solver: ContactSolver, n: int = 25, radius: float = 10.0) -> None:
    """A semicircular arch of ``share`` times the least stable thickness (Milankovitch 1907)."""
    ratio = share * masonry.thinnest_arch(n)
    inner, outer = radius * (1 - 0.5 * ratio), radius * (1 + 0.5 * ratio)
    springings = [np.array([[a, -1.0], [b, -1], [b, 0], [a, 0]]) for a, b in ((inner, outer), (-outer, -inner))]
    blocks = Blocks.from_polygons(springings + masonry.voussoirs(n, ratio, radius), fixed=[True] * 2 + [False] * n)
    settings = DdaSettings(time_step=0.01, dynamic_factor=float(dynamic), contact_solver=solver)
    stone = Material("stone", 1e11, 0.2, density=2500.0)
    system = dda.BlockSystem(blocks, [stone], [JointLaw("joints", friction_angle=np.radians(60))], settings=settings)
    if not dynamic:
        dda.equilibrium(system, State.at_rest(blocks), block_scenes.WEIGHT)
        return
    state = State.at_rest(blocks)
    for _ in range(40):
        state = system.step(state, block_scenes.WEIGHT).state


def falling(scene: str, solver: ContactSolver, n: int = 25, seconds: float = 0.6) -> None:
    """An avalanche or a drum (`geomech.bench.robustness.debris`)."""
    system, loads = debris.SCENES[scene](n)
    system.settings = replace(system.settings, contact_solver=solver)
    debris.follow(system, loads, seconds)


def factor(seed: int, solver: ContactSolver) -> None:
    """The factor of safety of a random slope."""
    problem = problem_of(factor_slope(seed).scene)
    dda.factor_of_safety(
        problem.blocks, problem.materials, problem.joints, problem.loads, replace(problem.dda, contact_solver=solver),
        joint_index=problem.joint_index, load_time=problem.run.end_time, search=dda.FactorSearch(compare=False),
    )  # fmt: skip


def problems(quick: bool = False) -> list[Problem]:
    """All problems; ``quick``: a tenth of them."""
    wall, slope = block_scenes.wall, block_scenes.slope
    of = []

    def add(group: str, name: str, run: Run) -> None:
        of.append(Problem(group, name, run))

    for seed in QUICK_SLOPES if quick else SLOPES:
        add("random slopes", f"seed {seed}", partial(random_blocks, seed))
    for seed in QUICK_SLIDING if quick else SLIDING:
        add("sliding slopes", f"seed {seed}", partial(sliding, seed))
    sizes = (200,) if quick else (200, 1000)
    for n in sizes:
        for degrees in (20.0, 35.0):
            law = {"friction_angle": np.radians(degrees)}
            add("weight in motion", f"wall of {n}, {degrees:g}°", partial(sudden, wall(n), 5, 0.01, True, law))
            add("weight in motion", f"slope of {n}, {degrees:g}°", partial(sudden, slope(n), 5, 0.01, True, law))
            add("weight in statics", f"wall of {n}, {degrees:g}°", partial(sudden, wall(n), 2, 0.01, False, law))
            add("weight in statics", f"slope of {n}, {degrees:g}°", partial(sudden, slope(n), 2, 0.01, False, law))
    glue = {"cohesion": 20e3}
    add("bonds", "cohesion", partial(sudden, slope(100 if quick else 200), 1, 0.01, False, glue))
    add(
        "bonds",
        "tension",
        partial(sudden, slope(100 if quick else 150), 1, 0.01, False, glue | {"tensile_strength": 10e3}),
    )
    add(
        "bonds",
        "in motion",
        partial(sudden, slope(100 if quick else 200), 5, 0.01, True, glue | {"tensile_strength": 10e3}),
    )
    for n in sizes:
        add("equilibrium", f"wall of {n}", partial(at_rest, wall(n), {}))
        add("equilibrium", f"slope of {n}", partial(at_rest, slope(n), {}))
    for share in (0.97, 1.03):
        for dynamic in (False, True):
            add("arches", f"{share:g} of the limit{', in motion' if dynamic else ''}", partial(arch, share, dynamic))
    for scene in debris.SCENES:
        add("debris", scene, partial(falling, scene))
    for seed in QUICK_FACTORS if quick else FACTORS:
        add("strength reduction", f"seed {seed}", partial(factor, seed))
    return of


@contextmanager
def _counted(count: Count) -> Iterator[None]:
    """Count all steps of block systems."""
    step = dda.BlockSystem.step

    def counted(self, *given, **named):
        result = step(self, *given, **named)
        count.iterations.append(result.statistics["open_close_iterations"])
        count.cuts += int(result.statistics["step_cuts"])
        return result

    dda.BlockSystem.step = counted
    try:
        yield
    finally:
        dda.BlockSystem.step = step


def counted(problem: Problem, solver: ContactSolver, seconds: float = LIMIT) -> Count:
    """Cost of ``problem`` with the settings ``solver``, within ``seconds`` processor seconds."""
    count, log = Count(), logging.getLogger("geomech")

    def run(_messages) -> Iterator[None]:
        problem.run(solver)
        yield

    level = log.level
    log.setLevel(logging.ERROR)
    began = time.process_time()
    try:
        with _counted(count):
            ended = limited(run, seconds)
    finally:
        log.setLevel(level)
    count.seconds, count.solved = time.process_time() - began, ended.verdict == RIGHT
    count.why = ended.message.strip().splitlines()[-1] if ended.message.strip() else ""
    return count


#: Settings to be compared with the present ones: methods switched off, and parameters.
SWITCHED: dict[str, dict[str, Any]] = {
    "as it is": {},
    "no central path": {"central_path": False},
    "no patches": {"patches": False},
    "no operator splitting": {"splitting": False},
    "no more iterations where few are wrong": {"newton_tries_if_few": 1},
    "no correctors of the path": {"path_correctors": 0},
    "contacts never centred again": {"path_recentred": 0},
    "loads of a contact's own blocks": {"path_load_rings": 0},
    "path from ε of the forces at hand": {"path_start": 1.0},
    "many bonds one by one": {"bonds_in_order": 10**9},
}


def compared(
    switched: dict[str, dict[str, Any]], of: Sequence[Problem], seconds: float = LIMIT
) -> dict[str, list[Count]]:
    """Cost of each problem with each of the settings ``switched``."""
    return {name: [counted(each, ContactSolver(**given), seconds) for each in of] for name, given in switched.items()}


def table(found: dict[str, list[Count]], of: Sequence[Problem]) -> str:
    """One row for each of the settings over all problems, then those of the first by group."""
    head = (
        f"{'':44}{'unsolved':>9}{'steps':>7}{'cuts':>6}{'iterations':>11}{'median':>8}{'95 %':>6}{'worst':>7}{'s':>8}"
    )
    lines = [head]
    lines += [_row(name, counts) for name, counts in found.items()]
    first, counts = next(iter(found.items()))
    lines += ["", f"{first}, by groups"]
    for group in dict.fromkeys(each.group for each in of):
        lines.append(_row(group, [count for each, count in zip(of, counts, strict=True) if each.group == group]))
    for name, counts in found.items():
        failed = [(each, count) for each, count in zip(of, counts, strict=True) if not count.solved]
        lines += [f"  {name}: {each.group}, {each.name}: {count.why[:120]}" for each, count in failed]
    return "\n".join(lines)


def _row(name: str, counts: Sequence[Count]) -> str:
    taken = np.array([number for count in counts for number in count.iterations] or [0.0])
    unsolved, cuts = sum(not count.solved for count in counts), sum(count.cuts for count in counts)
    return (
        f"{name:44}{unsolved:9}{len(taken):7}{cuts:6}{taken.sum():11.0f}{np.median(taken):8.0f}"
        f"{np.quantile(taken, 0.95):6.0f}{taken.max():7.0f}{sum(count.seconds for count in counts):8.1f}"
    )


def measure(quick: bool = False) -> Measured:
    """All problems with each of `SWITCHED` (``quick``: a tenth of them, with the defaults and without patches)."""
    of = problems(quick)
    for each in of[:3]:
        counted(each, ContactSolver())  # compiles
    names = ("as it is", "no patches") if quick else tuple(SWITCHED)
    found = compared({name: SWITCHED[name] for name in names}, of)
    now = found["as it is"]
    return Measured.of(
        table(found, of),
        errors={"share of problems unsolved": sum(not count.solved for count in now) / len(now)},
        times={"contact solver": sum(count.seconds for count in now)},
    )
