"""Random slopes, jointed and cracked (`random_slopes`), run end to end, with invariants of any scene
(`slope_invariants`) checked in every cycle.

A slope is `RIGHT`; `REPORTED`: an invariant was violated, with a warning of the run; `REFUSED` for one of the
`refusals`; `LONG`: it reached its time limit without a violation; or `WRONG`: an invariant was violated without a
warning, or another error occurred. Times are processor times, so that the verdict does not depend on other programs.
"""

from __future__ import annotations

import statistics
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

from ..figures import Measured
from .limited_runs import LONG, REFUSED, REPORTED, RIGHT, VERDICTS, WRONG, CollectedWarnings, limited
from .random_slopes import scene_text
from .refusals import REASONS
from .seed_rows import program, record_of, rows_of_seeds
from .slope_invariants import INVARIANTS, Invariants

#: Seeds of scenes that take about a second, with cracks and without.
LIGHT = (3, 5, 12, 16, 32, 34)
#: Processor time limit of a slope, s.
LIMIT = 30.0
#: Folder of the rows, the table and the picture of many slopes.
FOLDER = Path("outputs/bench_slopes")
#: Modules here on which a slope's run depends.
_MODULES = ("fuzzed_slopes", "limited_runs", "random_slopes", "slope_invariants", "refusals")


@dataclass(frozen=True)
class Watched:
    """Outcome of a ``seed``.

    ``reason`` is the name of a refusal's reason, ``message`` the error's; ``faults`` (without a warning) and
    ``reported`` (with one) name the cycle; ``worst`` of every invariant's quantity.
    """

    seed: int
    verdict: str
    reason: str = ""
    message: str = ""
    faults: tuple[str, ...] = ()
    reported: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    blocks: int = 0
    tips: int = 0
    cycles: int = 0
    events: dict[str, int] = field(default_factory=dict)
    worst: dict[str, float] = field(default_factory=dict)
    seconds: float = 0.0
    program: str = ""

    @property
    def why(self) -> str:
        """One line about a violation, a refusal, or the events."""
        if self.verdict == WRONG and not self.faults:
            return self.message.strip().splitlines()[-1]
        if self.faults or self.reported:
            return "; ".join((*self.faults, *self.reported)[:2])
        if self.reason:
            return f"{self.reason}: {self.message.strip().splitlines()[0]}"
        return ", ".join(f"{count} {kind}" for kind, count in sorted(self.events.items()))


def watched(seed: int, seconds: float = LIMIT, text: str | None = None) -> Watched:
    """Load and run the scene of a ``seed`` (or ``text``) for at most ``seconds`` processor seconds, checking every
    cycle."""
    from ...coupling import cycles
    from ...scene import load_scene

    invariants = None
    blocks = tips = 0
    events: Counter[str] = Counter()

    def run(collected: CollectedWarnings) -> Iterator[None]:
        nonlocal invariants, blocks, tips
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"slope_{seed}.toml"
            path.write_text(scene_text(seed) if text is None else text, encoding="utf-8")
            problem = load_scene(path).problem()
        invariants = Invariants(problem, lambda: collected.messages)
        for cycle in cycles(problem):
            blocks, tips = cycle.blocks.n_blocks, max(tips, len(cycle.tips))
            events.update(event.kind for event in cycle.events)
            invariants.check(cycle)
            yield
        invariants.end()

    ended = limited(run, seconds)
    verdict = ended.verdict
    faults, reported, worst = (), (), {}
    if invariants is not None:
        faults, reported, worst = tuple(invariants.faults), tuple(invariants.reported), invariants.worst
    if faults:
        verdict = WRONG
    elif reported and verdict == RIGHT:
        verdict = REPORTED
    return Watched(
        seed, verdict, ended.reason, ended.message, faults, reported, ended.warnings, blocks, tips, ended.cycles,
        dict(events), worst, ended.seconds,
    )  # fmt: skip


def measure(quick: bool = False) -> Measured:
    """Outcome of the first forty seeds, each within ten seconds (``quick``: of six light ones), as text."""
    every = [watched(seed, 10.0) for seed in (LIGHT if quick else range(40))]
    return _measured(every)


def measure_many(
    seeds: Sequence[int], seconds: float = LIMIT, folder: Path = FOLDER, workers: int | None = None
) -> Measured:
    """Outcome of the ``seeds``, one on each core (``workers``), as text; rows, JSON and a picture are written to
    ``folder``.

    Seeds already run by the same program, according to the rows there, are not run again.
    """
    from ...render.benchmarks.slope_outcomes import draw

    rows = folder / "slopes.jsonl"
    found_rows = rows_of_seeds(seeds, rows, partial(_row_of_run, seconds), program(_MODULES), _compile, workers)
    every = [record_of(Watched, row) for row in found_rows]
    found = _measured(every)
    picture = draw(every, VERDICTS, {name: each.bound for name, each in INVARIANTS.items()}, folder / "slopes.png")
    places = ", ".join(map(str, (folder / "slopes.json", rows.name, picture.name)))
    return Measured(f"{found.text}\n{places}", found.figures)


def _row_of_run(seconds: float, seed: int) -> dict:
    return asdict(watched(seed, seconds))


def _compile() -> None:
    """Compile the kernels beforehand: their compile time does not belong to a slope."""
    for seed in LIGHT:
        watched(seed, 600.0)


def _measured(every: Sequence[Watched]) -> Measured:
    counts = Counter(w.verdict for w in every)
    lines = ["seed  verdict  blocks   tips cycles  overlap   energy   seconds  what happened, or why not"]
    for w in every:
        lines.append(
            f"{w.seed:4d}  {w.verdict:8s}{w.blocks:6d} {w.tips:6d} {w.cycles:6d}  {w.worst.get('overlap', 0):7.0e}  "
            f"{w.worst.get('energy', 0):7.0e} {w.seconds:9.1f}  {w.why[:160]}"
        )
    lines += ["", *outcome(every)]
    return Measured.of("\n".join(lines), errors={"share of slopes wrong": counts[WRONG] / len(every)})


def outcome(every: Sequence[Watched]) -> Iterator[str]:
    """Verdicts, reasons of refusals with their meaning, and the worst of every invariant, as lines."""
    counts, reasons = Counter(w.verdict for w in every), Counter(w.reason for w in every if w.verdict == REFUSED)
    yield f"{len(every)} slopes: " + "  ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS)
    for reason in REASONS:
        if reasons[reason.name]:
            yield f"  {reasons[reason.name]:4d} refused, {reason.name}: {reason.meaning}"
    yield "what must hold, worst of the slopes that are right, of all, and the bound"
    for name, invariant in INVARIANTS.items():
        right = max((w.worst.get(name, 0.0) for w in every if w.verdict in (RIGHT, LONG)), default=0.0)
        most = max((w.worst.get(name, 0.0) for w in every), default=0.0)
        yield f"  {name:10s}{right:9.1e} {most:9.1e} {invariant.bound:9.0e}  {invariant.meaning}"
    close = sum(w.worst.get("energy", 0.0) <= 1e-3 for w in every)
    yield f"energy is accounted for within 1e-3 in {close} of {len(every)}"
    seconds = [w.seconds for w in every]
    total = Counter[str]()
    for w in every:
        total.update(w.events)
    happened = ", ".join(f"{count} {kind}" for kind, count in sorted(total.items()))
    yield (
        f"{sum(w.cycles for w in every)} cycles; {happened or 'nothing happened'}; "
        f"{statistics.median(seconds):.1f} s in the median, {sum(seconds):.0f} s in all"
    )


def _row(w: Watched) -> dict:
    """A row of the table on a page, without nesting."""
    return {
        "seed": w.seed, "verdict": w.verdict, "reason": w.reason, "blocks": w.blocks, "tips": w.tips,
        "cycles": w.cycles,
        "seconds": round(w.seconds, 2), **{name: float(f"{value:.2g}") for name, value in w.worst.items()},
        "what": w.why,
    }  # fmt: skip
