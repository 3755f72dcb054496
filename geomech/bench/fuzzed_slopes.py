"""Random slopes, jointed and cracked (`random_slopes`), run end to end with what must hold of any scene held against
every cycle (`slope_invariants`).

A slope is `RIGHT`; `REPORTED`: something did not hold, and a warning of the run says so; `REFUSED` for one of the
`refusals`; `LONG`: its time was up, and all held until then; or `WRONG`: something did not hold in silence, or another
error came. Seconds are those of the processor, so that the verdict does not depend on what else runs.
"""

from __future__ import annotations

import hashlib
import json
import logging
import multiprocessing
import os
import signal
import statistics
import tempfile
import threading
import time
import traceback
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path

from ..output.summary import write_json
from .figures import Measured
from .random_slopes import scene_text
from .refusals import REASONS, reason_of
from .slope_invariants import INVARIANTS, Invariants

RIGHT, REPORTED, REFUSED, LONG, WRONG = VERDICTS = ("right", "reported", "refused", "long", "wrong")

#: Seeds of scenes that take a second or so, with cracks and without.
LIGHT = (3, 5, 12, 16, 32, 34)
#: Processor seconds that a slope may take.
LIMIT = 30.0
#: Where the rows, the table and the picture of many slopes go.
FOLDER = Path("outputs/bench_slopes")
#: Parts of the house that a slope's run depends on.
PARTS = ("model", "shapes", "scene", "dda", "ddm", "coupling")


@dataclass(frozen=True)
class Watched:
    """What became of a ``seed``: ``reason`` is the name of that of a refusal, ``message`` the error's; ``faults`` (in
    silence) and ``told`` (a warning says so) name the cycle; ``worst`` of every invariant's quantity."""

    seed: int
    verdict: str
    reason: str = ""
    message: str = ""
    faults: tuple[str, ...] = ()
    told: tuple[str, ...] = ()
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
        """A line on what did not hold, why it was refused, or what happened."""
        if self.verdict == WRONG and not self.faults:
            return self.message.strip().splitlines()[-1]
        if self.faults or self.told:
            return "; ".join((*self.faults, *self.told)[:2])
        if self.reason:
            return f"{self.reason}: {self.message.strip().splitlines()[0]}"
        return ", ".join(f"{count} {kind}" for kind, count in sorted(self.events.items()))


class _TimeUp(BaseException):
    """No error of the run's own: nothing may catch it."""


def watched(seed: int, seconds: float = LIMIT, text: str | None = None) -> Watched:
    """Load and run the scene of a ``seed`` (or ``text``) for at most so many processor ``seconds``, every cycle
    checked."""
    from ..coupling import cycles
    from ..scene import load_scene

    heard, log, began = _Heard(), logging.getLogger("geomech"), time.process_time()
    log.addHandler(heard)
    invariants = None
    verdict, reason, message = RIGHT, "", ""
    blocks = tips = number = 0
    events: Counter[str] = Counter()
    try:
        with _at_most(seconds), tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"slope_{seed}.toml"
            path.write_text(scene_text(seed) if text is None else text, encoding="utf-8")
            problem = load_scene(path).problem()
            invariants = Invariants(problem, lambda: heard.said)
            for cycle in cycles(problem):
                number += 1
                blocks, tips = cycle.blocks.n_blocks, max(tips, len(cycle.tips))
                events.update(event.kind for event in cycle.events)
                invariants.check(cycle)
            invariants.end()
    except _TimeUp as up:
        verdict, message = LONG, str(up)
    except Exception as error:  # noqa: BLE001 (any but those known is what is looked for)
        up = _time_up(error)
        if up is not None:
            # It came within a compiled function, which makes another error of it.
            verdict, message = LONG, str(up)
        else:
            reason = reason_of(error, begun=number > 0) or ""
            verdict = REFUSED if reason else WRONG
            message = str(error) if reason else traceback.format_exc(limit=-3)
    finally:
        log.removeHandler(heard)
    faults, told, worst = (), (), {}
    if invariants is not None:
        faults, told, worst = tuple(invariants.faults), tuple(invariants.told), invariants.worst
    if faults:
        verdict = WRONG
    elif told and verdict == RIGHT:
        verdict = REPORTED
    return Watched(
        seed, verdict, reason, message, faults, told, tuple(heard.said), blocks, tips, number, dict(events), worst,
        time.process_time() - began,
    )  # fmt: skip


class _Heard(logging.Handler):
    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.said: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.said.append(record.getMessage())


def _time_up(error: BaseException | None) -> _TimeUp | None:
    """What ``error`` was made of or followed upon, if that is the end of the time."""
    while error is not None and not isinstance(error, _TimeUp):
        error = error.__cause__ or error.__context__
    return error


@contextmanager
def _at_most(seconds: float) -> Iterator[None]:
    """Raises `_TimeUp`, saying where it was, after so many ``seconds`` of the processor; where there are no timers,
    never."""
    if not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def up(_number, frame) -> None:
        places = [f"{Path(at.filename).stem}.{at.name}" for at in traceback.extract_stack(frame)]
        raise _TimeUp(" > ".join(name for name in places if not name.startswith("_"))[-300:])

    before = signal.signal(signal.SIGPROF, up)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def measure(quick: bool = False) -> Measured:
    """What became of the first forty seeds, each within ten seconds (``quick``: of six that are light), as text."""
    every = [watched(seed, 10.0) for seed in (LIGHT if quick else range(40))]
    return _measured(every)


def measure_many(
    seeds: Sequence[int], seconds: float = LIMIT, folder: Path = FOLDER, workers: int | None = None
) -> Measured:
    """What became of the ``seeds``, one on each core (``workers``), as text; rows, JSON and a picture go to ``folder``.
    Seeds that the same program has run before, as the rows there tell, are not run again."""
    from ..render.slope_outcomes import draw

    program, rows = _program(), folder / "slopes.jsonl"
    folder.mkdir(parents=True, exist_ok=True)
    known = {w.seed: w for w in _read(rows) if w.program == program}
    missing = [seed for seed in seeds if seed not in known]
    if missing:
        # A body a thread on every core would make the slopes wait for one another.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        spawn = multiprocessing.get_context("spawn")
        cores = workers or len(os.sched_getaffinity(0))
        with ProcessPoolExecutor(cores, spawn, _compile) as pool, rows.open("a") as out:
            for done in as_completed([pool.submit(watched, seed, seconds) for seed in missing]):
                found = asdict(done.result()) | {"program": program}
                known[found["seed"]] = Watched(**found)
                out.write(json.dumps(found) + "\n")
                out.flush()
    every = [known[seed] for seed in seeds]
    write_json(folder / "slopes.json", [_row(w) for w in every])
    found = _measured(every)
    picture = draw(every, VERDICTS, {name: each.bound for name, each in INVARIANTS.items()}, folder / "slopes.png")
    places = ", ".join(map(str, (folder / "slopes.json", rows.name, picture.name)))
    return Measured(f"{found.text}\n{places}", found.figures)


def _compile() -> None:
    """Have the kernels ready: what compiling them takes is no slope's."""
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
    """Verdicts, reasons of refusals with what they mean, and the worst of every invariant, as lines."""
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
    """A row of the table on a page: flat."""
    return {
        "seed": w.seed, "verdict": w.verdict, "reason": w.reason, "blocks": w.blocks, "tips": w.tips,
        "cycles": w.cycles,
        "seconds": round(w.seconds, 2), **{name: float(f"{value:.2g}") for name, value in w.worst.items()},
        "what": w.why,
    }  # fmt: skip


def _program() -> str:
    """A digest of the sources that a slope's run depends on."""
    house, digest = Path(__file__).parent.parent, hashlib.sha256()
    here = [
        Path(__file__).with_name(f"{name}.py")
        for name in ("fuzzed_slopes", "random_slopes", "slope_invariants", "refusals")
    ]
    for path in [*here, *sorted(path for part in PARTS for path in (house / part).rglob("*.py"))]:
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def _read(rows: Path) -> Iterable[Watched]:
    if not rows.exists():
        return
    for line in rows.read_text(encoding="utf-8").splitlines():
        try:
            yield Watched(**json.loads(line))
        except (TypeError, json.JSONDecodeError):
            continue  # of another version, or cut off as it was written
