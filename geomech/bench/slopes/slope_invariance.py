"""Random slopes (`random_slopes`) run again under changes that must not affect the result: shorter steps, mirrored,
rotated, shifted, with joints in another order, and with noise on the vertices.

Joints are drawn once (`drawn_slopes`), so that all variants have the same blocks. Over the whole run in steps of dt,
dt/2 and dt/4, the moving fraction of the rock and the work of gravity on it (`moved_mass`) are compared. Over the first
steps, with friction as drawn and without, every block's displacement and the energies are compared with those of the
slope as drawn. Where two static runs both tell of a mechanism, which blocks move is compared, not how far: there is no
equilibrium to move to. A slope is `RIGHT`, `REPORTED` (beyond a bound, with a warning of one of the two compared runs that its
result is unreliable), `REFUSED` (already as drawn, for a named reason), `LONG` (some run was not finished, the others
agree) or `WRONG`.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from ...model import Problem
from ...output.tables.summary import write_json
from ...repeats import NOISE, with_noise
from ..figures import Measured
from .drawn_slopes import (
    Isometry,
    Scene,
    can_be_moved,
    drawn,
    frictionless,
    moved,
    problem_of,
    reordered,
)
from .limited_runs import LONG, REFUSED, REPORTED, RIGHT, VERDICTS, WRONG, CollectedWarnings, Ended, limited
from .moved_mass import BlockDisplacements, moving_from
from .random_slopes import scene_text
from .seed_rows import program, record_of, rows_of_seeds
from .slope_invariants import INVARIANTS

#: Processor time limit of each run of a slope, s.
LIMIT = 30.0
#: Folder of the rows, the JSON and the picture.
FOLDER = Path("outputs/bench_slopes")
#: Divisors of the time step.
DIVISIONS = (1, 2, 4)
#: Number of steps over which variants of the geometry are compared, and the step, s, of those without friction: blocks
#: then fall by some 0.4 mm, relative to which 1e-12 of the extent is below a tenth of the bound.
FIRST, FRICTIONLESS_STEP = 3, 3e-3
#: Works are compared relative to the larger of gravity's work, and its work on this fraction of the rock over the
#: displacement from which rock counts as moving: negligible motion is not magnified.
LEAST_SHARE = 0.01
#: Differences of displacement below this multiple of the noise are those of the vertices themselves. (The noise of its two
#: corners turns a block on its base, and its top goes farther by its height over that base: 18 in slope 30, in which no
#: contact state differs.)
ABOVE_NOISE = 30.0
#: Centroids of a block in two variants are closer to each other than this part of the extent: parts of a block cut by
#: cracks depend on the crack paths, and their distance is compared. Blocks of two step lengths whose areas differ by less are
#: the same.
SAME_BLOCK = 1e-2
#: Steps are the same if they end at times that differ by less, relative to these.
SAME_STEPS = 1e-6
#: m: distance of a shifted slope from its drawn location.
FAR = 1e4

VARIANTS: dict[str, Isometry | None] = {
    "mirror": Isometry.mirrored(),
    "rotation": Isometry.rotated(math.radians(10)),
    "shift": Isometry.shifted((FAR, FAR)),
    "order": None,
    "noise": None,
}


@dataclass(frozen=True)
class Bound:
    """Bound of a quantity, and the scale to which it is relative."""

    bound: float
    meaning: str


BOUNDS = {
    "share, dt": Bound(3e-2, "moved share of the rock in steps of dt and dt/2, off that in steps of dt/4"),
    "work, dt": Bound(3e-2, "the same of the work of gravity on what moves, over the latter"),
    **{
        f"{name}{label}": Bound(bound, f"{meaning}{of}: displacement of any block over the largest, or energy")
        for label, bound, of in ((", friction", 1e-3, ""), (", smooth", 1e-6, ", without friction"))
        for name, meaning in (
            ("mirror", "mirrored"),
            ("rotation", "rotated by 10°"),
            ("shift", f"shifted by {FAR:g} m each way"),
            ("order", "joints listed in another order"),
            ("noise", f"noise of {NOISE:g} of the extent on every vertex"),
        )
    },
}
#: Words of warnings in which a run says that its result is unreliable. (Events end steps at loads that differ between
#: variants by rounding: where unsupported blocks move in them, positions depend on it.)
WARNED = (
    "nothing holds",
    "static steps have dissipated",
    "agree only to",
    "are no more accurate",
    "is not resolved, and friction remembers it",
    "before they bear it",
    "rigid base was not found",
    "did not agree after",
    *sorted({words for invariant in INVARIANTS.values() for words in invariant.reported}),
)
#: The same of results that depend on the time step, not on the place.
WARNED_OF_STEPS = (
    "does not resolve vibrations",
    "bonds broke within steps",
    "begin in motion is known to one step only",
    "(unpaid_toughness in summary.json)",
    "which no block supplied",
    "depends on the load steps",
)
#: What runs say where there is no equilibrium: in statics under the loads, and under the in-situ stress; and where they end,
#: because none is found to begin from.
_NO_EQUILIBRIUM = re.compile(
    "nothing holds .* step after step|under the in-situ stress there is no equilibrium|no equilibrium: .*the run ends"
)
_MODULES = (
    "drawn_slopes", "limited_runs", "moved_mass", "random_slopes", "refusals", "slope_invariance", "slope_invariants",
)  # fmt: skip


@dataclass(frozen=True)
class Invariance:
    """Outcome of a ``seed``.

    moved      fraction of the rock; ``work``: of gravity, J/m, in steps of dt, dt/2 and dt/4 (nan: not finished)
    scatter    by name of a `Bound`
    faults     (without a warning) and ``reported`` (with one), as lines
    left_out   variants that were not compared, and why
    """

    seed: int
    verdict: str
    blocks: int = 0
    threshold: float = 0.0
    moved: tuple[float, ...] = ()
    work: tuple[float, ...] = ()
    scatter: dict[str, float] = field(default_factory=dict)
    faults: tuple[str, ...] = ()
    reported: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    reason: str = ""
    seconds: float = 0.0

    @property
    def scatters_under_noise(self) -> bool:
        return any(name.startswith("noise") and not value <= BOUNDS[name].bound for name, value in self.scatter.items())

    @property
    def worst(self) -> dict[str, float]:
        """For the picture."""
        return self.scatter

    @property
    def why(self) -> str:
        return "; ".join((*self.faults, *self.reported, *self.left_out)[:2])


@dataclass(frozen=True, eq=False)
class _Run:
    """How a run ``ended``, and the final state of the blocks: None if it did not reach its end."""

    ended: Ended
    at: BlockDisplacements | None = None
    energies: np.ndarray | None = None  # J/m: work of gravity; kinetic, elastic, contact energy
    times: tuple[float, ...] = ()  # s: ends of steps

    def warned(self, of_steps: bool) -> bool:
        """Whether a warning says that the result is unreliable, or (``of_steps``) depends on the time step."""
        words = (*WARNED, *WARNED_OF_STEPS) if of_steps else WARNED
        return any(each in line for line in self.ended.warnings for each in words)

    @property
    def has_no_equilibrium(self) -> bool:
        """Whether a run has told that blocks have no equilibrium."""
        return any(_NO_EQUILIBRIUM.search(line) for line in self.ended.warnings)

    @property
    def how(self) -> str:
        what = self.ended.reason or self.ended.message.strip().rpartition("\n")[2]
        return f"{self.ended.verdict}: {what}"


def invariance(seed: int, seconds: float = LIMIT, text: str | None = None) -> Invariance:
    """The slope of a ``seed`` (or of ``text``) in all variants, each run with at most ``seconds`` processor seconds."""
    try:
        scene = drawn(scene_text(seed) if text is None else text)
        first = problem_of(scene)
    except ValueError as error:
        refusal = error
        ended = limited(lambda collected: _raise(refusal), seconds)
        return Invariance(seed, ended.verdict, reason=ended.reason or ended.message.strip())
    compared = _Compared(seed, scene, seconds)
    threshold = moving_from(first)
    compared.steps(first, threshold)
    if compared.refused:
        return compared.outcome(first, threshold)
    dt = first.dda.time_step
    compared.geometry(scene, FIRST * dt, ", friction", threshold)
    compared.geometry(frictionless(scene, FRICTIONLESS_STEP), FIRST * FRICTIONLESS_STEP, ", smooth", threshold)
    return compared.outcome(first, threshold)


class _Compared:
    """The runs of a slope, compared one by one."""

    def __init__(self, seed: int, scene: Scene, seconds: float) -> None:
        self.seed, self.scene, self.seconds = seed, scene, seconds
        self.scatter: dict[str, float] = {}
        self.faults: list[str] = []
        self.reported: list[str] = []
        self.left_out: list[str] = []
        self.moved: list[float] = []
        self.work: list[float] = []
        self.refused = ""
        self.long = False
        self.spent = 0.0

    def steps(self, first: Problem, threshold: float) -> None:
        """The whole run in steps of dt, dt/2 and dt/4."""
        runs = []
        for division in DIVISIONS:
            run = self._run(replace(first, dda=replace(first.dda, time_step=first.dda.time_step / division)))
            if run.ended.verdict == REFUSED and division == DIVISIONS[0]:
                self.refused = run.ended.reason
                return
            runs.append(run)
            self.moved.append(math.nan if run.at is None else run.at.share(threshold))
            self.work.append(math.nan if run.at is None else run.at.work(threshold))
        finest = runs[-1]
        for division, run in zip(DIVISIONS[:-1], runs):
            label = "dt" if division == 1 else f"dt/{division}"
            if not self._both(f"steps of {label}", run, finest):
                continue
            off_share, off_work = _off_moved(run.at, finest.at, threshold)
            self._take("share, dt", off_share, label, run, finest)
            if not (run.has_no_equilibrium and finest.has_no_equilibrium):
                self._take("work, dt", off_work, label, run, finest)

    def geometry(self, scene: Scene, end: float, label: str, threshold: float) -> None:
        """The first steps of ``scene``, until ``end`` s, as drawn and in every variant."""
        base_problem = _until(problem_of(scene), end)
        base = self._run(base_problem)
        for name, by in VARIANTS.items():
            rng = np.random.default_rng([self.seed, len(name)])

            if by is not None and not can_be_moved(scene, by):
                self._leave_out(f"{name}{label}: water lies level")
                continue
            if name == "noise":
                problem = with_noise(base_problem, NOISE, rng)
            else:
                problem = _until(problem_of(reordered(scene, rng) if by is None else moved(scene, by)), end)
            run = self._run(problem)
            if not self._both(f"{name}{label}", base, run):
                continue
            off = _difference(base, run, by or Isometry(), threshold)
            if off is None:
                self._fault(f"{name}{label}: other blocks", base, run)
            else:
                self._take(f"{name}{label}", off, "", base, run)

    def outcome(self, first: Problem, threshold: float) -> Invariance:
        verdict = RIGHT
        if self.refused:
            verdict = REFUSED
        elif self.faults:
            verdict = WRONG
        elif self.reported:
            verdict = REPORTED
        elif self.long:
            verdict = LONG
        return Invariance(
            self.seed, verdict, int((~first.blocks.fixed).sum()), threshold, tuple(self.moved), tuple(self.work),
            self.scatter, tuple(self.faults), tuple(self.reported), tuple(self.left_out), self.refused, self.spent,
        )  # fmt: skip

    def _run(self, problem: Problem) -> _Run:
        from ...coupling import cycles

        last, times = None, [0.0]

        def run(collected: CollectedWarnings) -> Iterator[None]:
            nonlocal last
            for cycle in cycles(problem):
                last = cycle
                if cycle.state.time != times[-1]:
                    times.append(cycle.state.time)
                yield

        ended = limited(run, self.seconds)
        self.spent += ended.seconds
        self.long |= ended.verdict == LONG
        if ended.verdict != RIGHT or last is None:
            return _Run(ended)
        statistics = last.statistics
        energies = [statistics.get(f"{name}_energy", 0.0) for name in ("kinetic", "elastic", "contact")]
        at = BlockDisplacements.of(problem, last.blocks, last.state)
        return _Run(ended, at, np.array([statistics.get("gravity_work", 0.0), *energies]), tuple(times))

    def _both(self, what: str, one: _Run, other: _Run) -> bool:
        """Whether both reached their end; a refusal or an error of only one is recorded."""
        ends = {run.ended.verdict for run in (one, other)}
        if ends == {RIGHT}:
            return True
        if LONG in ends:
            self._leave_out(f"{what}: not finished in {self.seconds:g} s")
        elif WRONG in ends:
            self.faults.append(f"{what}: {(one if one.ended.verdict == WRONG else other).how}")
        elif RIGHT in ends:
            self.reported.append(f"{what}: one {(one if one.ended.verdict == REFUSED else other).how}")
        else:
            self._leave_out(f"{what}: both refused")
        return False

    def _leave_out(self, what: str) -> None:
        self.left_out.append(what)

    def _take(self, name: str, value: float, where: str, *runs: _Run) -> None:
        self.scatter[name] = max(self.scatter.get(name, 0.0), value)
        if not value <= BOUNDS[name].bound:
            what = f"{name} {value:.2g}{f' ({where})' if where else ''}"
            self._fault(what, *runs)

    def _fault(self, what: str, *runs: _Run) -> None:
        of_steps = not _in_the_same_steps(*runs)
        (self.reported if any(run.warned(of_steps) for run in runs) else self.faults).append(what)


def _in_the_same_steps(one: _Run, other: _Run) -> bool:
    """Whether two runs took the same steps. (Whether contacts find their states, or the step is cut, may hang on rounding: 77.)"""
    return len(one.times) == len(other.times) and np.allclose(one.times, other.times, rtol=SAME_STEPS, atol=0.0)


def _raise(error: Exception) -> Iterator[None]:
    raise error
    yield


def _until(problem: Problem, end: float) -> Problem:
    return replace(problem, run=replace(problem.run, end_time=end))


def _off_moved(at: BlockDisplacements, finest: BlockDisplacements, threshold: float) -> tuple[float, float]:
    """Share of the rock that moves off that in the ``finest`` steps, and gravity's work on it, relative to the latter.

    A block at the ``threshold`` moves in one run and not in another by a displacement that hardly differs (52: 0.6 % of it,
    and 11 % of the rock): blocks whose displacement is within the bound of that in the finest run count as in it."""
    moves, there = at.moves(threshold), finest.moves(threshold)
    one, other = _same_blocks(at, finest)
    size, finest_size = np.hypot(*at.displacement[one].T), np.hypot(*finest.displacement[other].T)
    alike = np.abs(size - finest_size) <= BOUNDS["share, dt"].bound * finest_size
    moves[one[alike]] = there[other[alike]]
    share = abs(float(at.mass[moves].sum() / at.mass.sum() - finest.mass[there].sum() / finest.mass.sum()))
    work, finest_work = (
        float(of.mass[m] @ (of.displacement[m] @ of.gravity)) for of, m in ((at, moves), (finest, there))
    )
    return share, abs(work - finest_work) / max(abs(finest_work), LEAST_SHARE * finest.weight() * threshold)


def _same_blocks(one: BlockDisplacements, other: BlockDisplacements) -> tuple[np.ndarray, np.ndarray]:
    """(k,) each: numbers of the blocks that both runs have, nearest to each other with areas that differ by less than
    `SAME_BLOCK`. (Blocks that cracks have cut differ.)"""
    from scipy.spatial import cKDTree

    to_other, to_one = cKDTree(other.centre).query(one.centre)[1], cKDTree(one.centre).query(other.centre)[1]
    mutual = to_one[to_other] == np.arange(len(one.area))
    mutual &= np.abs(other.area[to_other] - one.area) <= SAME_BLOCK * one.area
    at = np.flatnonzero(mutual)
    return at, to_other[at]


def _difference(base: _Run, run: _Run, by: Isometry, threshold: float) -> float | None:
    """The largest of: difference of a block's displacement, beyond that of the vertices, over the largest displacement,
    of its position over the extent, or of an energy, beyond the work of all weight over the noise, over the largest energy;
    None if the blocks are not the same. If neither run has an equilibrium, the share of the rock that moves by more than
    ``threshold`` (m) in one of them only."""
    from scipy.spatial import cKDTree

    one, other = base.at, run.at
    if len(one.area) != len(other.area):
        return None
    extent = float(np.ptp(one.centre, axis=0).max()) + math.sqrt(float(one.area.max()))
    distance, at = cKDTree(by.back(other.centre)).query(one.centre)
    if len(set(at.tolist())) < len(at) or not (distance < SAME_BLOCK * extent).all():
        return None
    if base.has_no_equilibrium and run.has_no_equilibrium:
        return float(one.mass[one.moves(threshold) != other.moves(threshold)[at]].sum() / one.mass.sum())
    back = other.displacement[at] @ by.matrix
    away = max(0.0, np.hypot(*(back - one.displacement).T).max() - ABOVE_NOISE * NOISE * extent)
    lifted = one.weight() * NOISE * extent
    off = away, max(0.0, np.abs(run.energies - base.energies).max() - lifted)
    size = np.hypot(*one.displacement.T).max(), np.abs(base.energies).max()
    shares = [float(each / of) if of > 0 else 0.0 for each, of in zip(off, size)]
    return max(*shares, float(distance.max()) / extent)


def measure_invariance(
    seeds: Sequence[int], seconds: float = LIMIT, folder: Path = FOLDER, workers: int | None = None
) -> Measured:
    """Every one of the ``seeds``, one on each core (``workers``), as text; rows, JSON and a picture are written to
    ``folder``.

    Seeds already run by the same program, according to the rows there, are not run again.
    """
    from ...render.benchmarks.slope_outcomes import draw

    rows = rows_of_seeds(
        seeds, folder / "invariance.jsonl", partial(_row_of_run, seconds), program(_MODULES, f"{seconds:g} s"),
        compile_kernels, workers,
    )  # fmt: skip
    every = [record_of(Invariance, row) for row in rows]
    write_json(folder / "invariance.json", [asdict(each) for each in every])
    picture = draw(
        every, VERDICTS, {name: each.bound for name, each in BOUNDS.items()}, folder / "invariance.png",
        title=f"What {len(every)} random slopes become in other steps, places and orders (their seeds)",
        meaning={
            RIGHT: "the same in all variants", REPORTED: "not the same, and a warning says so",
            REFUSED: "refused as drawn", LONG: "the same as far as finished", WRONG: "not the same, in silence",
        },
    )  # fmt: skip
    places = ", ".join(map(str, (folder / "invariance.json", "invariance.jsonl", picture.name)))
    found = table(every)
    return Measured(f"{found.text}\n{places}", found.figures)


def compile_kernels() -> None:
    """Run slopes that are not measured, so that no measured one has to wait for compilation."""
    from .fuzzed_slopes import LIGHT, watched

    for seed in LIGHT:
        watched(seed, 600.0)


def _row_of_run(seconds: float, seed: int) -> dict:
    return asdict(invariance(seed, seconds))


def table(every: Sequence[Invariance]) -> Measured:
    """One line per seed, the worst of every quantity next to its bound, and the fraction of wrong slopes."""
    lines = [
        "moved: share of the rock that goes farther than 1 mm (in short runs, a tenth of free fall), in steps of dt, "
        "dt/2, dt/4;",
        "scatter: share and gravity work off those of dt/4; the worst of mirror, rotation, shift, order and noise "
        f"over the first {FIRST} steps",
        "seed  verdict  blocks   moved, dt    dt/2    dt/4   work J/m  share,dt   work,dt  geometry    smooth  seconds"
        "  why",
    ]
    for each in every:
        moved_shares = [*each.moved, math.nan, math.nan, math.nan][:3]
        work = each.work[-1] if each.work else math.nan
        worst = [_worst_of(each, lambda name, what=what: name == f"{what}, dt") for what in ("share", "work")]
        worst += [_worst_of(each, lambda name, end=end: name.endswith(end)) for end in (", friction", ", smooth")]
        lines.append(
            f"{each.seed:4d}  {each.verdict:8s}{each.blocks:6d}    "
            + "".join(f"{share:8.4f}" for share in moved_shares)
            + f"{work:11.3g}"
            + "".join(f"{value:10.1e}" for value in worst)
            + f"{each.seconds:9.1f}  {(each.why or each.reason)[:120]}"
        )
    counts = Counter(each.verdict for each in every)
    lines += ["", f"{len(every)} slopes: " + "  ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS)]
    also_scattered = sum(each.verdict == WRONG and each.scatters_under_noise for each in every)
    lines.append(
        f"{also_scattered} of the wrong ones also differ under noise, which `geomech run --repeat noise` reports"
    )
    lines.append("what must not change, worst of the slopes that are right, of all, beyond the bound in, and the bound")
    for name, each in BOUNDS.items():
        values = [one.scatter[name] for one in every if name in one.scatter]
        right = max((one.scatter.get(name, 0.0) for one in every if one.verdict == RIGHT), default=0.0)
        beyond = sum(not value <= each.bound for value in values)
        lines.append(
            f"  {name:18s}{right:9.1e} {max(values, default=0.0):9.1e} {beyond:4d}/{len(values):<4d}{each.bound:9.0e}  "
            f"{each.meaning}"
        )
    return Measured.of(
        "\n".join(lines),
        errors={"share of slopes that do not stay the same, in silence": counts[WRONG] / max(1, len(every))},
    )


def _worst_of(each: Invariance, named: Callable[[str], bool]) -> float:
    return max((value for name, value in each.scatter.items() if named(name)), default=math.nan)
