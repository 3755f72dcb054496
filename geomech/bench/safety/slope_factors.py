"""Random slopes (`factor_scenes`): the factor of `geomech safety`, as drawn, mirrored and rotated, compared with limit
equilibrium and the linear programme of static admissibility (`slope_limits`); and its cost.

A slope is `RIGHT`, `REPORTED` (beyond the bound, with a warning that something other than strength decides), `REFUSED`
for a named reason, `LONG` (not finished in time) or `WRONG`: above or below without a warning.
"""

from __future__ import annotations

import logging
import math
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from ...output.tables.summary import write_json
from ..figures import Measured
from ..slopes.drawn_slopes import Isometry, can_be_moved, moved, problem_of
from ..slopes.limited_runs import (
    LONG,
    REFUSED,
    REPORTED,
    RIGHT,
    VERDICTS,
    WRONG,
    CollectedWarnings,
    TimeUp,
    at_most,
    time_up,
)
from ..slopes.refusals import reason_of
from ..slopes.seed_rows import program, record_of, rows_of_seeds
from .factor_cost import measure_cost
from .factor_scenes import FAMILIES, FactorSlope, random_slope

#: Largest relative difference from the expected factor that counts as right.
BOUND = 1e-2
#: Requested width of the bracket.
TOLERANCE = 2e-3
#: Processor time limit of each search, s.
LIMIT = 60.0
#: Folder of rows and JSON.
FOLDER = Path("outputs/bench_safety")
SEEDS, QUICK_SEEDS = range(100), range(10)
VARIANTS = {
    "drawn": Isometry(), "mirrored": Isometry.mirrored(), "rotated": Isometry.rotated(math.radians(10)),
}  # fmt: skip
_MODULES = ("drawn_slopes", "factor_scenes", "limited_runs", "refusals", "slope_factors", "slope_limits")


@dataclass(frozen=True)
class Searched:
    """One search: the ``factor`` (inf: none up to 64; nan: none found), its ``verdict``, and the ``warnings``."""

    variant: str
    verdict: str
    factor: float
    seconds: float
    warnings: tuple[str, ...] = ()
    message: str = ""

    def off(self, expected: float) -> float:
        return _off(self.factor, expected)


@dataclass(frozen=True)
class Factored:
    """A slope (see `FactorSlope`) with its searches; ``verdict`` is the worst of them."""

    seed: int
    family: str
    toe: str
    traits: tuple[str, ...]
    limit: float
    bound: float
    expected: float
    anchor: float
    verdict: str
    searches: tuple[Searched, ...]

    @property
    def off(self) -> float:
        """Largest difference of a search from the expected factor, with its sign."""
        deviations = [s.off(self.expected) for s in self.searches if not math.isnan(s.factor)]
        return max(deviations, key=abs, default=math.nan)

    @property
    def seconds(self) -> float:
        return sum(search.seconds for search in self.searches)


def _off(factor: float, expected: float) -> float:
    if math.isinf(expected) or math.isinf(factor):
        return 0.0 if factor == expected else math.copysign(math.inf, factor - expected)
    return factor / expected - 1.0


def factored(slope: FactorSlope, seconds: float = LIMIT, variants: Sequence[str] = tuple(VARIANTS)) -> Factored:
    """Searches for the factor of ``slope``, each with at most ``seconds`` processor seconds."""
    searches = tuple(
        _search(slope, name, seconds) for name in variants if can_be_moved(slope.scene, VARIANTS[name])
    )  # fmt: skip
    verdicts = {search.verdict for search in searches}
    worst = next(each for each in (WRONG, LONG, REFUSED, REPORTED, RIGHT) if each in verdicts)
    return Factored(
        slope.seed, slope.family, slope.toe, slope.traits, slope.limit, slope.bound, slope.expected, slope.anchor,
        worst, searches,
    )  # fmt: skip


def _search(slope: FactorSlope, variant: str, seconds: float) -> Searched:
    from ... import dda

    problem = problem_of(moved(slope.scene, VARIANTS[variant]))
    collected, log, began = CollectedWarnings(), logging.getLogger("geomech"), time.process_time()
    log.addHandler(collected)
    verdict, factor, message, result_warnings = WRONG, math.nan, "", ()
    try:
        with at_most(seconds):
            found = dda.factor_of_safety(
                problem.blocks, problem.materials, problem.joints, problem.loads, problem.dda,
                joint_index=problem.joint_index, load_time=problem.run.end_time,
                search=dda.FactorSearch(tolerance=TOLERANCE),
            )  # fmt: skip
        factor = found.factor if math.isfinite(found.upper) else math.inf
        result_warnings = tuple(getattr(found, "warnings", ()))
    except TimeUp as up:
        verdict, message = LONG, str(up)
    except Exception as error:  # any error other than the known ones is a finding
        message = str(error)
        if time_up(error) is not None:
            verdict = LONG
        elif isinstance(error, dda.NotConverged) and reason_of(error):
            verdict = REFUSED
    finally:
        log.removeHandler(collected)
    spent = time.process_time() - began
    warnings = (*result_warnings, *collected.messages)
    if not math.isnan(factor):
        right = abs(_off(factor, slope.expected)) <= BOUND
        verdict = RIGHT if right else REPORTED if warnings else WRONG
    return Searched(variant, verdict, factor, spent, warnings, message)


def measure(quick: bool = False) -> Measured:
    """A hundred slopes and the cost of 200, 1 000 and 3 000 blocks (``quick``: ten slopes, and 200 blocks)."""
    if quick:
        rows = [factored(random_slope(seed)) for seed in QUICK_SEEDS]
        return _joined(table(rows), measure_cost(quick=True))
    return _joined(measure_many(SEEDS), measure_cost())


def _joined(*parts: Measured) -> Measured:
    return Measured("\n\n".join(part.text for part in parts), tuple(f for part in parts for f in part.figures))


def measure_many(seeds: Sequence[int], folder: Path = FOLDER, workers: int | None = None) -> Measured:
    """Every one of the ``seeds``, one on each core (``workers``), as text; rows and JSON are written to ``folder``.

    Seeds already run by the same program, according to the rows there, are not run again.
    """
    rows = rows_of_seeds(seeds, folder / "safety.jsonl", _row, program(_MODULES, f"{LIMIT:g} s"), None, workers)
    every = [_from_row(row) for row in rows]
    write_json(folder / "safety.json", [asdict(each) for each in every])
    found = table(every)
    return Measured(f"{found.text}\n{folder / 'safety.json'}, safety.jsonl", found.figures)


def _row(seed: int) -> dict:
    return asdict(factored(random_slope(seed)))


def _from_row(row: dict) -> Factored:
    return record_of(Factored, row | {"searches": tuple(record_of(Searched, search) for search in row["searches"])})


def table(every: Sequence[Factored]) -> Measured:
    """One line per slope, the outcome of every family, and the figures."""
    names = list(VARIANTS)
    lines = [
        "factor of safety off limit equilibrium (of rows of columns: off the largest factor with admissible contact "
        "forces), less 1",
        "seed  family    verdict    toe            limit    bound"
        + "".join(f"{name:>10}" for name in names) + "  seconds  has",
    ]  # fmt: skip
    for each in every:
        by_variant = {search.variant: search for search in each.searches}
        deviations = "".join(
            f"{by_variant[name].off(each.expected):10.4f}" if name in by_variant else f"{'-':>10}" for name in names
        )
        why = next((s.message for s in each.searches if s.message), "") or next(
            (w for s in each.searches for w in s.warnings if s.verdict == REPORTED), "")  # fmt: skip
        stretch = f"anchor after {1e3 * each.anchor:.2g} mm" if each.anchor else ""
        has = ", ".join([stretch if trait == "anchor" else trait for trait in each.traits])
        lines.append(
            f"{each.seed:4d}  {each.family:9s} {each.verdict:9s}  {each.toe:12s}{each.limit:8.4f} {each.bound:8.4f}"
            f"{deviations}{each.seconds:9.1f}  {has}{f'; {why[:90]}' if why else ''}"
        )
    lines += ["", f"{'':12}" + "".join(f"{verdict:>10}" for verdict in VERDICTS) + "     above in silence   below"]
    for family in (*FAMILIES, "all"):
        of = [each for each in every if family in (each.family, "all")]
        if of:
            counts = Counter(each.verdict for each in of)
            wrong = [each.off for each in of if each.verdict == WRONG]
            lines.append(f"  {family:10}" + "".join(f"{counts[verdict]:10d}" for verdict in VERDICTS)
                         + f"{sum(off > BOUND for off in wrong):21d}{sum(off < -BOUND for off in wrong):8d}")  # fmt: skip
    counts = Counter(each.verdict for each in every)
    within = [abs(each.off) for each in every if each.verdict == RIGHT and math.isfinite(each.off)]
    unsafe = sum(each.verdict == WRONG and each.off > BOUND for each in every)
    worst = {
        "factor of right slopes off, largest": max(within, default=math.nan),
        "share of slopes wrong": counts[WRONG] / len(every),
        "share of slopes above in silence": unsafe / len(every),
    }
    number = sum(len(each.searches) for each in every)
    times = {"a search among those slopes, mean": sum(each.seconds for each in every) / number}
    lines += [f"  {name:<50}{value:9.2g}" for name, value in (worst | times).items()]
    return Measured.of("\n".join(lines), errors=worst, times=times)
