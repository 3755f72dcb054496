"""Cost and accuracy of a step of many blocks: walls and jointed slopes of 100 to 10 000 blocks, more on request.

Steps of 10 ms from rest under sudden weight, as many as fit in some seconds (at least one); the cost of an open–close
iteration (one set of contact states, or one step of the central path) is that of the step over its iterations. Settled
steps continue from where static ones have brought the blocks to rest. In addition: the share of the contact search, the
memory of the process, the exponents of the cost, other solvers of the last equations (time against residual), and
errors relative to closed forms.
"""

from __future__ import annotations

import math
import os
import statistics
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from ...model import Blocks, JointLaw, State
from ...output.tables.summary import write_json
from ..figures import Measured, stopwatch
from ..peers.block_iteration import (
    TOLERANCES,
    Iterated,
    block_jacobi,
    pardiso,
    pardiso_available,
    refactored,
    two_levels,
)
from . import block_scenes
from .block_scenes import FRICTION, GRAVITY, JOINT, ROCK, WEIGHT

#: Folder of the picture and the numbers, in the working folder.
FOLDER = Path("outputs/bench_dda")
TIME_STEP = 0.01
SIZES = (100, 1000, 10_000)
#: Number of blocks up to which the last equations are also solved iteratively (block Jacobi takes minutes beyond), in a
#: quick and in a full run.
ITERATED = 100, 1000
#: Number of blocks up to which other direct solvers are measured, and domains; of larger ones only with the last scene,
#: because each takes a gigabyte.
DIRECTLY = 20_000
#: Residuals to which domains are then iterated: those required by the central path, and by a step.
TO_PATH_AND_STEP = 1e-5, 1e-10
#: CPU time, s, after which no further step is started, in a quick and in a full run. (The first step of 100 000 bricks
#: takes 26 iterations, 110 s of CPU and 3.0 GiB, that of a slope of this size, halved twice, 580 s of CPU and 3.4 GiB.)
LONGEST = 0.5, 6.0
#: Number of settled steps; the first one, which factors, does not count. Largest number of blocks in a quick run: the
#: static steps that bring blocks to rest take as long as those from rest; and of slopes in a full run, walls coming to
#: rest sooner.
SETTLED, SETTLES, SLOPES_SETTLE = 6, 150, 20_000
SCENES = {"wall": block_scenes.wall, "jointed slope": block_scenes.slope}

#: Shi's DDA in C (an optimised public build, measured on a machine of the same kind): {blocks of a similar wall:
#: seconds per open–close iteration}.
SHI = {106: 0.0015, 411: 0.014, 1009: 0.084, 2003: 0.29, 4001: 0.99}
#: Goals on two cores: {blocks of a wall: wall-clock seconds per iteration}; exponent of the cost from 1 000 blocks on;
#: share of the search.
GOALS, EXPONENT, SEARCH = {1000: 6e-3, 10_000: 0.1}, 1.1, 0.25


@dataclass(frozen=True)
class Cost:
    """Cost of a scene.

    CPU seconds of the ``first`` step; medians over ``steps``: CPU seconds of a step, of an iteration, of its solution,
    and of a step's contact search; ``by_the_clock``: seconds per iteration of the quickest step, which several cores
    share; seconds and mean iterations of a ``settled`` step (nan: not measured); peak memory of the process, MB;
    ``factored`` of every factorisation; ``imbalance``: error of weight − inertia = reaction.
    """

    scene: str
    blocks: int
    contacts: int
    steps: int
    iterations: float
    first: float
    step: float
    iteration: float
    by_the_clock: float
    solution: float
    search: float
    settled: float
    settled_iterations: float
    memory: float
    factored: float
    imbalance: float


@dataclass(eq=False)
class Watch:
    """Seconds spent in contact searches and in solutions, and the last equations solved."""

    search: float = 0.0
    solution: float = 0.0
    last: tuple | None = None


@contextmanager
def _watched() -> Iterator[Watch]:
    from ...dda.contact_detection.contact_finder import ContactFinder
    from ...dda.linear_solver.block_solver import BlockSolver

    watch, find = Watch(), ContactFinder.find
    solve, roughly = BlockSolver.solve, BlockSolver.rough_solution
    inside = False

    def timed_find(self, *given, **named):
        spent_on = stopwatch()
        try:
            return find(self, *given, **named)
        finally:
            watch.search += spent_on()

    def timed(work, *given, **named):
        nonlocal inside
        if inside:  # a rough solution may require an exact one
            return work(*given, **named)
        inside, spent_on = True, stopwatch()
        try:
            return work(*given, **named)
        finally:
            inside = False
            watch.solution += spent_on()

    def timed_solve(self, data, right, *within, **force):
        watch.last = self, data, right
        return timed(solve, self, data, right, *within, **force)

    def timed_roughly(self, data):
        solution = timed(roughly, self, data)
        return lambda *given: timed(solution, *given)

    ContactFinder.find, BlockSolver.solve, BlockSolver.rough_solution = timed_find, timed_solve, timed_roughly
    try:
        yield watch
    finally:
        ContactFinder.find, BlockSolver.solve, BlockSolver.rough_solution = find, solve, roughly


def measure(quick: bool = False, blocks: int | None = None) -> Measured:
    """The table; writes ``cost_of_size.png``, ``solvers.png`` and ``cost_of_size.json`` to `FOLDER`.

    ``quick`` stops at 1 000 blocks; ``blocks``: one more size, larger than the others.
    """
    from ...render.benchmarks.cost_of_size import draw, draw_solvers

    run(block_scenes.wall(100), 0.0)  # compiles
    costs: list[Cost] = []
    iterated: list[dict] = []
    sizes = SIZES[:2] if quick else SIZES
    scenes = [(n, name) for n in ((*sizes, blocks) if blocks else sizes) for name in SCENES]
    for n, name in scenes:
        domains = not quick and (n <= DIRECTLY or (n, name) == scenes[-1])
        jacobi = n <= ITERATED[not quick]
        cost, others = _measured(name, SCENES[name](n), LONGEST[not quick], jacobi, domains)
        costs.append(cost)
        for other in others:
            found = {key: getattr(other, key) for key in ("method", "iterations", "seconds", "residual")}
            iterated.append({"scene": name, "blocks": cost.blocks, **found})
    # After all others, because static steps of very many blocks take more memory.
    for k, (n, name) in enumerate(scenes):
        if n <= SETTLES if quick else (name == "wall" or n <= SLOPES_SETTLE):
            at_rest = settled(SCENES[name](n))
            costs[k] = replace(costs[k], settled=at_rest[0], settled_iterations=at_rest[1])
    exponents = {
        f"{name}, {label}": _exponent([c for c in costs if c.scene == name], what)
        for name in SCENES
        for label, what in (("an iteration", "iteration"), ("the first step", "first"), ("a settled step", "settled"))
    }
    found = errors()
    FOLDER.mkdir(parents=True, exist_ok=True)
    written = {
        "costs": [asdict(c) for c in costs], "exponents": exponents, "iterated": iterated, "errors": found,
        "shi_s_per_iteration": SHI, "quick": quick,
    }  # fmt: skip
    write_json(FOLDER / "cost_of_size.json", written)
    draw(costs, SHI, FOLDER / "cost_of_size.png")
    curves = {(row["scene"], row["blocks"]) for row in iterated if row["iterations"] > 1}
    draw_solvers([row for row in iterated if (row["scene"], row["blocks"]) in curves], FOLDER / "solvers.png")
    times = {
        f"{c.scene}, {c.blocks} blocks: {what}": getattr(c, what)
        for c in costs
        for what in ("iteration", "first", "step", "settled")
    }
    return Measured.of(_table(costs, exponents, iterated, found), errors=found, times=times)


def run(blocks: Blocks, longest: float) -> tuple[list[dict], Watch, object, object]:
    """Steps until ``longest`` s of CPU are used: the time of each, the watch, the last result and the system."""
    from ... import dda

    system = dda.BlockSystem(blocks, [ROCK], [JOINT], settings=block_scenes.settings(TIME_STEP))
    state, rows, result = State.at_rest(blocks), [], None
    with _watched() as watch:
        began = time.process_time()
        while not rows or (time.process_time() - began < longest and len(rows) < 40):
            before, factored = (watch.search, watch.solution), system.work.factorisations
            spent_on, clock = stopwatch(), time.perf_counter()
            result = system.step(state, WEIGHT)
            seconds, passed = spent_on(), time.perf_counter() - clock
            state = result.state
            spent, solution = watch.search - before[0], watch.solution - before[1]
            # Correctors solve again with the same factors: iterations are fewer than solutions.
            iterations = result.statistics["open_close_iterations"]
            if result.statistics["step_cuts"]:
                # Attempts that were cut count too.
                iterations = max(iterations, system.work.factorisations - factored)
            rows.append(
                {
                    "seconds": seconds,
                    "iterations": iterations,
                    "iteration": (seconds - spent) / iterations,
                    "by_the_clock": (passed - spent) / iterations,
                    "search": spent,
                    "solution": solution / iterations,
                }
            )
    return rows, watch, result, system


def settled(blocks: Blocks) -> tuple[float, float]:
    """Median seconds of a step of blocks at rest under their weight, and its mean iterations."""
    from ... import dda

    state = block_scenes.at_rest(blocks)
    system = dda.BlockSystem(blocks, [ROCK], [JOINT], settings=block_scenes.settings(TIME_STEP))
    seconds, iterations = [], []
    for _ in range(SETTLED):
        spent = stopwatch()
        result = system.step(state, WEIGHT)
        seconds.append(spent())
        state = result.state
        iterations.append(result.statistics["open_close_iterations"])
    return statistics.median(seconds[1:]), statistics.mean(iterations[1:])


def _measured(name: str, blocks: Blocks, longest: float, jacobi: bool, domains: bool) -> tuple[Cost, list[Iterated]]:
    rows, watch, result, system = run(blocks, longest)
    # Patterns and orderings, which a scene computes once, are in the first step.
    regular = rows[1:] or rows

    def median(key: str) -> float:
        return statistics.median(row[key] for row in regular)

    free = ~np.asarray(blocks.fixed, bool)
    solver, data, right = watch.last
    counts = solver.counts
    n_free = int(free.sum())
    cost = Cost(
        name,
        n_free,
        len(result.contacts),
        len(rows),
        statistics.mean(row["iterations"] for row in rows),
        rows[0]["seconds"],
        median("seconds"),
        median("iteration"),
        min(row["by_the_clock"] for row in regular),
        median("solution"),
        median("search"),
        math.nan,
        math.nan,
        peak_memory(),
        counts["shares"] / max(1, counts["factorisations"]),
        _imbalance(blocks, system, result),
    )
    centroid, area = result.forces.centroid[free], result.forces.area[free]
    x = solver.solve(data, right)
    residual = float(np.linalg.norm(right - solver.multiply(data, x)) / np.linalg.norm(right))
    others = [Iterated("direct", 1, cost.solution, residual, x)]
    if n_free <= DIRECTLY or domains:
        others.append(refactored(solver, centroid, data, right))
        others += [pardiso(solver, data, right)] if pardiso_available() else []
    if jacobi:
        others += [block_jacobi(solver, data, right, tolerance) for tolerance in TOLERANCES]
    for tolerance in TOLERANCES if jacobi else (TO_PATH_AND_STEP if domains else ()):
        others.append(two_levels(solver, centroid, np.sqrt(area), data, right, tolerance))
    return cost, others


def _imbalance(blocks: Blocks, system, result) -> float:
    """Error |Σ m (g + a) − reaction of the fixed blocks| over the weight, vertical."""
    from ...dda.results import contact_resultants

    fixed = np.asarray(blocks.fixed, bool)
    mass = system.density * blocks.areas()
    pushed = contact_resultants(result.contacts, blocks.n_blocks, result.forces.centroid)[fixed, 1].sum()
    acting = (mass * (GRAVITY + result.acceleration[:, 1]))[~fixed].sum()
    return float(abs(acting + pushed) / (GRAVITY * mass[~fixed].sum()))


def peak_memory() -> float:
    """Peak memory of the process, MB; nan if the system does not report it."""
    try:
        import resource
    except ImportError:
        return math.nan
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _exponent(costs: list[Cost], what: str) -> float:
    """Exponent of ``what`` in the number of blocks, by regression from the second size on (or from both of two)."""
    used = [c for c in costs if math.isfinite(getattr(c, what))]
    used = used[1:] if len(used) > 2 else used
    if len(used) < 2:
        return math.nan
    n, seconds = np.log([c.blocks for c in used]), np.log([getattr(c, what) for c in used])
    return float(np.polyfit(n, seconds, 1)[0])


def errors() -> dict[str, float]:
    """Relative errors against closed forms.

    Displacement of a sliding block, creep of a sticking one, shortening of a column of twenty blocks under its own
    weight, a wall's reaction at rest.
    """
    from ... import dda

    def states(blocks: Blocks, dt: float, end: float, dynamic: bool = True):
        settings = block_scenes.settings(dt, dynamic)
        return list(dda.run(blocks, [ROCK], [JOINT], WEIGHT, settings, end))

    out = {}
    angle, end = math.radians(50), 0.25
    slid = states(block_scenes.incline(-angle), 1e-3, end)
    way = np.linalg.norm((slid[-1].vertices - slid[0].vertices)[4:].mean(axis=0))
    expected = 0.5 * GRAVITY * (math.sin(angle) - math.tan(FRICTION) * math.cos(angle)) * end**2
    out["block that slides at 50°, way after 0.25 s"] = float(abs(way / expected - 1))
    rest = states(block_scenes.incline(-math.radians(30)), 1e-3, end)
    travelled = np.linalg.norm((rest[-1].vertices - rest[0].vertices)[4:].mean(axis=0))
    out["block that sticks at 30°, creep in 0.25 s over the way it would slide without friction"] = float(
        travelled / (0.5 * GRAVITY * math.sin(math.radians(30)) * end**2)
    )
    blocks = block_scenes.column(20)
    # Without friction, so that every block can expand laterally.
    system = dda.BlockSystem(blocks, [ROCK], [JointLaw("smooth")], settings=block_scenes.settings(1.0, dynamic=False))
    state = State.at_rest(blocks)
    for _ in range(3):
        result = system.step(state, WEIGHT)
        state = result.state
    heights = state.vertices[:, 1].reshape(-1, 4)
    shortening = (1.0 - (heights[1:, 2:].mean(axis=1) - heights[1:, :2].mean(axis=1))).sum()
    expected = ROCK.density * GRAVITY * 20**2 / 2 / ROCK.plane_modulus
    out["column of 20 blocks, own shortening"] = float(abs(shortening / expected - 1))
    out["column of 20 blocks, reaction"] = _imbalance(blocks, system, result)
    return out


def _table(costs: list[Cost], exponents: dict[str, float], iterated: list[dict], errors: dict[str, float]) -> str:
    busy = f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"
    lines = [
        (
            f"steps of {1e3 * TIME_STEP:g} ms from rest under sudden weight; medians, the first step left out; "
            "iterations are"
        ),
        (
            f"factorisations of the step's equations; {len(os.sched_getaffinity(0))} cores, load average of the "
            f"machine {busy}"
        ),
        f"settled: {SETTLED - 1} steps of blocks at rest under their weight",
        f"  {'scene':<13}  blocks  contacts  steps  iterations  first s   s/step  ms/iteration  by the clock  of it solving  "
        "search/step" + "  s/settled step (iterations)  memory  imbalance",
    ]
    lines += [
        f"  {c.scene:<13}{c.blocks:8d}{c.contacts:10d}{c.steps:7d}{c.iterations:12.1f}{c.first:9.3g}"
        f"{c.step:9.3g}{1e3 * c.iteration:14.2f}"
        f"{1e3 * c.by_the_clock:14.2f}{c.solution / c.iteration:15.0%}{c.search / c.step:13.1%}{c.settled:15.3g} ({c.settled_iterations:10.1f})"
        f"{c.memory:6.0f} MB{c.imbalance:11.1e}"
        for c in costs
    ]
    lines += [f"  exponent of {name}: {e:.2f} (goal {EXPONENT})" for name, e in exponents.items() if math.isfinite(e)]
    lines.append(
        f"  largest share of the contact search: {max(c.search / c.step for c in costs):.0%} (goal {SEARCH:.0%})"
    )
    lines += [
        "",
        "an iteration of a wall compared with Shi's DDA in C (measured on a machine of the same kind, cost as n^1.8)",
    ]
    known_n, known_s = np.log(list(SHI)), np.log(list(SHI.values()))
    for c in costs:
        if c.scene == "wall":
            shi_seconds = math.exp(np.interp(math.log(c.blocks), known_n, known_s)) if c.blocks <= max(SHI) else None
            goal = GOALS.get(10 ** round(math.log10(c.blocks)))
            comparison = f"{shi_seconds / c.iteration:8.1f} times as fast" if shi_seconds else "   beyond his memory"
            lines.append(
                f"  {c.blocks:8d} blocks {1e3 * c.iteration:9.2f} ms {comparison}"
                + (f"  (goal {1e3 * goal:g} ms by the clock, here {1e3 * c.by_the_clock:.2f})" if goal else "")
            )
    lines += [
        "",
        "the last equations solved by other methods, including set-up except elimination orders (residual / right side)",
    ]
    lines += [
        f"  {row['scene']:<13}{row['blocks']:8d}  {row['method']:<24}{row['iterations']:6d} iterations"
        f"{1e3 * row['seconds']:10.1f} ms   {row['residual']:.0e}"
        for row in iterated
    ]
    if not pardiso_available():
        lines.append("  PARDISO of MKL is included if it is installed: pip install 'geomech[pardiso]' (a gigabyte)")
    lines += ["", "errors against closed forms"]
    lines += [f"  {name:<88}{value:8.1e}" for name, value in errors.items()]
    return "\n".join(lines)
