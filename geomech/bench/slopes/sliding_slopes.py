"""Sliding jointed slopes (`sliding_scenes`) in steps of 8 to 0.5 ms: moving mass and work of gravity, compared with the
shortest steps and with the rigid slab above the lowest daylighting bed.

A slope is `RIGHT`, `REPORTED` (beyond a bound, with a warning of the run that its result is unreliable), `REFUSED` for
a named reason, `LONG` (not finished in time) or `WRONG`.
"""

from __future__ import annotations

import math
import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

from ... import dda
from ...model import Joints, Problem
from ...output.tables.summary import write_json
from ..figures import Measured
from .drawn_slopes import problem_of
from .limited_runs import LONG, REFUSED, REPORTED, RIGHT, VERDICTS, WRONG, CollectedWarnings, Ended, limited
from .moved_mass import BlockDisplacements
from .seed_rows import program, record_of, rows_of_seeds
from .sliding_scenes import Slope, random_slope, slab
from .slope_invariance import WARNED

#: s: time steps, the shortest last, and the time of the comparison.
STEPS, END = (8e-3, 4e-3, 2e-3, 1e-3, 0.5e-3), 0.3
#: Largest differences between runs and the rigid slab, as fractions of the rock and of the work of gravity.
BOUND = 3e-2
#: Rock moves if its displacement exceeds this part of the rigid slab's, ½ a t²: weight causes smaller settlements.
OF_SLIDE = 0.1
#: Processor time limit of each run of a slope, s.
LIMIT = 120.0
#: Folder of the rows, the JSON and the picture.
FOLDER = Path("outputs/bench_sliding")
#: Seeds of slopes of 70 to 160 blocks, some ten seconds each; seeds, time steps (s) and duration (s) of a quick run.
SEEDS = (1, 4, 5, 8, 13, 18)
QUICK_SEEDS, QUICK_STEPS, QUICK_END = (1, 13, 18), (8e-3, 4e-3, 2e-3), 0.1
_MODULES = (
    "drawn_slopes", "limited_runs", "moved_mass", "refusals", "sliding_scenes", "sliding_slopes", "slope_invariance",
    "slope_invariants",
)  # fmt: skip


@dataclass(frozen=True)
class Slid:
    """Results of a slope at ``end``, s, with ``steps`` (s).

    moved        fraction of the rock that moved; ``work``: of gravity on it, J/m (nan: not finished)
    iterations   mean number of open–close iterations per step
    slab_share, slab_work   of the rigid slab: nan if no bed daylights, or a block extends through the one that does
    """

    seed: int
    verdict: str
    slope: dict
    blocks: int
    end: float
    steps: tuple[float, ...]
    moved: tuple[float, ...]
    work: tuple[float, ...]
    iterations: tuple[float, ...]
    slab_share: float
    slab_work: float
    faults: tuple[str, ...] = ()
    reported: tuple[str, ...] = ()
    seconds: float = 0.0

    def scatter(self) -> float:
        """Largest relative difference of a work from that in the shortest steps."""
        return max((abs(work / self.work[-1] - 1) for work in self.work[:-1]), default=math.nan)

    def off_slab(self) -> float:
        """Work in the shortest steps over that on the rigid slab, minus 1."""
        return self.work[-1] / self.slab_work - 1


@dataclass(frozen=True)
class _Run:
    ended: Ended
    moved: float = math.nan
    work: float = math.nan
    iterations: float = math.nan

    @property
    def warned(self) -> bool:
        return any(words in line for line in self.ended.warnings for words in WARNED)


def slid(
    slope: Slope, steps: Sequence[float] = STEPS, end: float = END, seconds: float = LIMIT, bound: float = BOUND
) -> Slid:
    """``slope`` from rest until ``end``, s, in ``steps`` of each length (decreasing, s), each run with at most
    ``seconds`` processor seconds."""
    problem = problem_of(tomllib.loads(slope.text(steps[-1], end)))
    rigid = slab(slope, problem)
    comparable = rigid is not None and rigid.whole
    mass = sum(problem.materials[0].density * problem.blocks.areas()[~problem.blocks.fixed])
    slab_share = rigid.mass / mass if comparable else math.nan
    slab_work = rigid.work(slope.acceleration, end) if comparable else math.nan
    threshold = OF_SLIDE * 0.5 * slope.acceleration * end**2
    runs = [_run(problem, dt, threshold, seconds) for dt in steps]
    found = Slid(
        slope.seed, RIGHT, asdict(slope), int((~problem.blocks.fixed).sum()), end, tuple(steps),
        tuple(run.moved for run in runs), tuple(run.work for run in runs), tuple(run.iterations for run in runs),
        float(slab_share), float(slab_work), seconds=sum(run.ended.seconds for run in runs),
    )  # fmt: skip
    faults, reported = _faults(found, runs, bound)
    return replace(found, verdict=_verdict(runs, faults, reported), faults=tuple(faults), reported=tuple(reported))


def _run(problem: Problem, dt: float, threshold: float, seconds: float) -> _Run:
    last, iterations = None, []

    def run(collected: CollectedWarnings) -> Iterator[None]:
        nonlocal last
        settings = replace(problem.dda, time_step=dt)
        states = dda.run(
            problem.blocks, problem.materials, Joints(problem.joints, problem.joint_index), problem.loads, settings,
            problem.run.end_time,
            watch=lambda result: iterations.append(result.statistics["open_close_iterations"]),
        )  # fmt: skip
        for state in states:
            last = state
            yield

    ended = limited(run, seconds)
    if ended.verdict != RIGHT or last is None:
        return _Run(ended)
    at = BlockDisplacements.of(problem, problem.blocks, last)
    return _Run(ended, at.share(threshold), at.work(threshold), sum(iterations) / len(iterations))


def _faults(found: Slid, runs: Sequence[_Run], bound: float) -> tuple[list[str], list[str]]:
    """Violations of the ``bound`` without a warning, and those with one."""
    faults: list[str] = []
    reported: list[str] = []

    def hold(value: float, what: str, *of: _Run) -> None:
        if math.isfinite(value) and value > bound:
            (reported if any(run.warned for run in of) else faults).append(f"{what} {value:.2g}")

    finest = runs[-1]
    for dt, run, share, work in zip(found.steps[:-1], runs, found.moved, found.work):
        hold(abs(share - found.moved[-1]), f"share at {1e3 * dt:g} ms off by", run, finest)
        if found.work[-1]:
            hold(abs(work / found.work[-1] - 1), f"work at {1e3 * dt:g} ms off by", run, finest)
    hold(abs(found.moved[-1] - found.slab_share), "share off the slab's by", finest)
    hold(abs(found.off_slab()) if found.slab_work else math.nan, "work off the slab's by", finest)
    faults += [run.ended.message.strip().splitlines()[-1] for run in runs if run.ended.verdict == WRONG]
    # Refused at one step and not at another: reported, but not the same.
    refused = [run.ended.reason for run in runs if run.ended.verdict == REFUSED]
    if refused and len(refused) < len(runs):
        reported += [f"{len(refused)} of {len(runs)} runs refused: {refused[0]}"]
    return faults, reported


def _verdict(runs: Sequence[_Run], faults: Sequence[str], reported: Sequence[str]) -> str:
    if faults:
        return WRONG
    if all(run.ended.verdict == REFUSED for run in runs):
        return REFUSED
    if reported:
        return REPORTED
    return LONG if any(run.ended.verdict == LONG for run in runs) else RIGHT


def measure(quick: bool = False) -> Measured:
    """Six seeds of few blocks in all steps (``quick``: three, in three steps, for 0.1 s), as text."""
    if quick:
        return table([slid(random_slope(seed), QUICK_STEPS, QUICK_END) for seed in QUICK_SEEDS])
    return measure_many(SEEDS)


def measure_many(
    seeds: Sequence[int], seconds: float = LIMIT, folder: Path = FOLDER, workers: int | None = None,
    steps: Sequence[float] = STEPS, end: float = END,
) -> Measured:  # fmt: skip
    """Every one of the ``seeds``, one on each core (``workers``), as text; rows, JSON and a picture are written to
    ``folder``.

    Seeds already run by the same program, according to the rows there, are not run again.
    """
    from ...render.benchmarks.sliding_slopes import draw

    also = f"{seconds:g} s, {[float(dt) for dt in steps]}, {end:g} s"
    rows = rows_of_seeds(
        seeds, folder / "sliding.jsonl", partial(_row_of_run, tuple(steps), end, seconds), program(_MODULES, also),
        compile_kernels, workers,
    )  # fmt: skip
    every = [record_of(Slid, row) for row in rows]
    write_json(folder / "sliding.json", [asdict(each) for each in every])
    picture = draw(every, BOUND, folder / "sliding.png")
    found = table(every)
    return Measured(f"{found.text}\n{folder / 'sliding.json'}, sliding.jsonl, {picture.name}", found.figures)


def compile_kernels() -> None:
    """Run a slope that is not measured, so that no measured one has to wait for compilation."""
    slid(random_slope(18), (8e-3,), 0.024)


def _row_of_run(steps: tuple[float, ...], end: float, seconds: float, seed: int) -> dict:
    return asdict(slid(random_slope(seed), steps, end, seconds))


def table(every: Sequence[Slid]) -> Measured:
    """One line per slope: the works of gravity relative to that in the shortest steps, and to the rigid slab's."""
    steps = every[0].steps
    lines = [
        f"work of gravity on what has moved by {every[0].end:g} s, at dt over that at {1e3 * steps[-1]:g} ms, less 1; "
        "share of the rock that has moved;",
        "and both against the rigid slab above the lowest bed that daylights (nan: a block reaches through it)",
        "seed  verdict   blocks   dip "
        + "".join(f"{f'{1e3 * dt:g} ms':>9}" for dt in steps[:-1])
        + "    work J/m    moved     slab  off slab  iterations a step  seconds  why",
    ]
    for each in every:
        off = "".join(f"{work / each.work[-1] - 1 if each.work[-1] else math.nan:9.3f}" for work in each.work[:-1])
        lines.append(
            f"{each.seed:4d}  {each.verdict:8s}{each.blocks:8d}{each.slope['dip']:6.1f} {off}{each.work[-1]:12.4g}"
            f"{each.moved[-1]:9.4f}{each.slab_share:9.4f}{each.off_slab():10.3f}"
            f"  {'/'.join(f'{mean:.0f}' for mean in each.iterations):>17}{each.seconds:9.1f}  "
            f"{'; '.join((*each.faults, *each.reported)[:2])[:110]}"
        )
    counts = Counter(each.verdict for each in every)
    scatters = [each.scatter() for each in every if each.work[-1]]
    slabs = [abs(each.off_slab()) for each in every if math.isfinite(each.off_slab())]
    worst = {
        "work in steps of any length off the shortest, largest": max(filter(math.isfinite, scatters), default=math.nan),
        "work off the rigid slab's, largest": max(slabs, default=math.nan),
        "share of slopes wrong": counts[WRONG] / len(every),
    }
    lines += ["", f"{len(every)} slopes: " + "  ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS)]
    lines += [f"  {name:<60}{value:9.1e}" for name, value in worst.items()]
    lines.append(f"  within {BOUND:g}: {sum(s <= BOUND for s in scatters)} of {len(scatters)} in all steps, "
                 f"{sum(s <= BOUND for s in slabs)} of {len(slabs)} of the rigid slab")  # fmt: skip
    return Measured.of("\n".join(lines), errors=worst)
