"""Cost and accuracy of jointed slopes in motion, by size and time step.

Slopes of one family (`sliding_scenes`), with spacings scaled to some 300 to 10 000 blocks, move from rest until the
slab on the lowest daylighting bed has slid by some 13 mm. For each time step: open–close iterations per step, time per
iteration and per simulated second, and the work of gravity on the moving blocks, relative to that in the shortest steps
and to the rigid slab's. For comparison a brick wall of as many blocks, as in `block_cost`: a ratio of two times of one
run does not depend on the machine.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from ... import dda
from ...model import Problem, State
from ...output.tables.summary import write_json
from ..figures import Measured, stopwatch
from ..slopes.drawn_slopes import problem_of
from ..slopes.limited_runs import LONG, RIGHT, CollectedWarnings, limited
from ..slopes.moved_mass import BlockDisplacements
from ..slopes.sliding_scenes import Slab, Slope, slab
from ..slopes.sliding_slopes import OF_SLIDE
from . import block_cost, block_scenes

#: Folder of the picture and the numbers.
FOLDER = Path("outputs/bench_motion")
#: Name of a size → spacing of the beds, m; that of cross joints is `ASPECT` times as large.
SPACINGS = {300: 2.6, 1000: 1.35, 3000: 0.76, 10_000: 0.41}
ASPECT = 1.15
#: s: time steps, the shortest last, and the duration of the motion.
STEPS, END = (10e-3, 5e-3, 2.5e-3, 1.25e-3), 0.1
#: Processor time, s, for all steps of one length of up to a thousand blocks, in a quick and in a full run; more blocks get
#: more in proportion. Of a run that takes longer, the cost is reported without an error. Steps that would take longer,
#: judging by earlier ones, are left out. That of a wall.
LONGEST, WALL = (3.0, 12.0), (0.5, 3.0)


@dataclass(frozen=True)
class Cost:
    """Cost of a slope of ``blocks`` blocks in steps of ``dt`` s.

    steps        taken
    iterations   mean number of open–close iterations per step, including attempts that were cut
    iteration    seconds per iteration (the step over its iterations); ``second``: seconds per simulated second
    moved        fraction of the rock that moved; ``work``: of gravity on it, J/m (nan: the run was not finished)
    off_slab     work over that on the rigid slab, minus 1 (nan if there is none)
    """

    blocks: int
    dt: float
    steps: int
    iterations: float
    iteration: float
    second: float
    moved: float
    work: float
    off_slab: float

    @property
    def finished(self) -> bool:
        return math.isfinite(self.work)


@dataclass(frozen=True)
class Sized:
    """A slope of about ``size`` blocks.

    ``costs`` by decreasing time step, seconds per iteration of a ``wall`` of as many bricks, and why steps are
    ``missing``.
    """

    size: int
    blocks: int
    costs: tuple[Cost, ...]
    wall: float
    missing: tuple[str, ...] = ()

    def errors(self) -> list[float]:
        """Error of the work in each of the costs, relative to the shortest steps; nan for these, and for unfinished
        runs."""
        finished = [cost for cost in self.costs if cost.finished]
        shortest = finished[-1] if finished else None
        return [
            abs(cost.work / shortest.work - 1) if cost.finished and cost is not shortest and shortest.work else math.nan
            for cost in self.costs
        ]


def slope_of(size: int) -> Slope:
    """About ``size`` blocks: one of `SPACINGS`, or scaled from them."""
    spacing = SPACINGS.get(size) or round(SPACINGS[1000] * math.sqrt(1000 / size), 3)
    return Slope(35.0, 70.0, 3.0, spacing, round(ASPECT * spacing, 3))


def measured(size: int, steps: Sequence[float], longest: float, wall: float) -> Sized:
    """A slope in steps of each length (decreasing, s), with at most ``longest`` processor seconds each, and bricks for
    ``wall`` seconds."""
    slope = slope_of(size)
    problem = problem_of(tomllib.loads(slope.text(steps[0], END)))
    rigid = slab(slope, problem)
    blocks = int((~problem.blocks.fixed).sum())
    costs: list[Cost] = []
    missing: list[str] = []
    for dt in steps:
        last = costs[-1] if costs else None
        if last is not None and last.second * END * last.dt / dt > longest:
            missing.append(f"{1e3 * dt:g} ms: would take longer than {longest:g} s")
            continue
        found = _cost(problem, slope, rigid, dt, longest)
        if isinstance(found, str):
            missing.append(f"{1e3 * dt:g} ms: {found}")
        else:
            costs.append(found)
    rows, *_ = block_cost.run(block_scenes.wall(blocks), wall)
    # Patterns and orderings, which a scene computes once, are in the first step.
    regular = rows[1:] or rows
    of_wall = sum(row["seconds"] for row in regular) / sum(row["iterations"] for row in regular)
    return Sized(size, blocks, tuple(costs), of_wall, tuple(missing))


def _cost(problem: Problem, slope: Slope, rigid: Slab | None, dt: float, longest: float) -> Cost | str:
    """Cost of steps of ``dt`` s, or the reason why it is not known."""
    settings = replace(problem.dda, time_step=dt)
    iterations: list[float] = []
    seconds: list[float] = []
    state = None

    def run(collected: CollectedWarnings) -> Iterator[None]:
        nonlocal state
        system = dda.BlockSystem(problem.blocks, problem.materials, problem.joints, problem.joint_index, settings)
        length, now = dda.StepLength(settings), State.at_rest(problem.blocks)
        spent = stopwatch()
        while now.time < END * (1 - 1e-12):
            asked, factored = min(length.dt, END - now.time), system.work.factorisations
            result = system.step(now, problem.loads, asked)
            length.after(result, asked)
            # Attempts that were cut count, which the step does not include.
            counted = result.statistics["open_close_iterations"]
            iterations.append(max(counted, system.work.factorisations - factored))
            seconds.append(spent())
            state = now = result.state
            yield

    ended = limited(run, longest)
    if state is None or not iterations:
        return f"{ended.verdict} in the first step" + f", {ended.reason}" * bool(ended.reason)
    if ended.verdict not in (RIGHT, LONG):
        return f"{ended.verdict} after {len(iterations)} steps, {ended.reason or ended.message.strip()}"
    total, iterations = seconds[-1], iterations[: len(seconds)]
    at = BlockDisplacements.of(problem, problem.blocks, state)
    moved = work = off = math.nan
    if ended.verdict == RIGHT:
        threshold = OF_SLIDE * 0.5 * slope.acceleration * END**2
        moved, work = at.share(threshold), at.work(threshold)
        if rigid is not None and rigid.whole:
            off = work / rigid.work(slope.acceleration, END) - 1
    return Cost(
        len(at.mass), dt, len(iterations), sum(iterations) / len(iterations), total / sum(iterations),
        total / state.time, moved, work, off,
    )  # fmt: skip


def measure(quick: bool = False, blocks: int | None = None) -> Measured:
    """All sizes in all steps that fit in the time limit (``quick``: 300 and 1 000 blocks, down to 2.5 ms).

    Returns the table; writes ``motion.json`` and ``motion.png`` to `FOLDER`. ``blocks``: one more size, larger than the
    others.
    """
    from ...render.benchmarks.motion_cost import draw

    # Compiles, with the smallest slope.
    measured(100, STEPS[:1], 600.0, 0.0)
    sizes = list(SPACINGS)[:2] if quick else list(SPACINGS)
    steps = STEPS[:-1] if quick else STEPS
    every = [
        measured(n, steps, LONGEST[not quick] * max(1.0, n / 1000), WALL[not quick])
        for n in (*sizes, *([blocks] if blocks else []))
    ]
    FOLDER.mkdir(parents=True, exist_ok=True)
    write_json(FOLDER / "motion.json", {"quick": quick, "slopes": [asdict(sized) for sized in every]})
    draw(every, FOLDER / "motion.png")
    return table(every)


def table(every: Sequence[Sized]) -> Measured:
    """One line per size and time step, and figures of errors and times."""
    lines = [
        f"slopes that slide from rest for {END:g} s; work of gravity on the moving blocks, and its difference from that in "
        "the shortest steps and from the rigid slab's;",
        "time of an iteration: the step divided by its open–close iterations, relative to that of a brick wall of as many blocks",
        "  blocks   dt, ms   steps  iterations a step  ms/iteration  of the wall's  s/simulated s  moved"
        "  work off shortest  off slab",
    ]
    errors: dict[str, float] = {}
    times: dict[str, float] = {}
    for sized in every:
        for cost, error in zip(sized.costs, sized.errors()):
            lines.append(
                f"{sized.blocks:8d}{1e3 * cost.dt:9.3g}{cost.steps:8d}{cost.iterations:19.1f}"
                f"{1e3 * cost.iteration:14.2f}{cost.iteration / sized.wall:15.2f}{cost.second:15.3g}"
                f"{cost.moved:7.3f}{error:19.1e}{cost.off_slab:10.3f}"
            )
            name = f"slope of {sized.size}, {1e3 * cost.dt:g} ms"
            times[f"{name}: an iteration"] = cost.iteration
            times[f"{name}: a simulated second"] = cost.second
            errors[f"{name}: work off that in the shortest steps"] = error
            errors[f"{name}: work off the rigid slab's"] = abs(cost.off_slab)
        lines += [f"{sized.blocks:8d}  {why}" for why in sized.missing]
        lines.append(f"{sized.blocks:8d}  wall: {1e3 * sized.wall:.2f} ms/iteration")
    return Measured.of("\n".join(lines), errors=errors, times=times)
