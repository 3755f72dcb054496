"""Execution of a sweep: distributes runs, stores rows as they arrive, shows progress; and resumption."""

from __future__ import annotations

import itertools
import json
import logging
import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..interruption import Interruption
from ..output.run_lock import FolderTaken, RunLock
from ..output.tables.summary import versions, write_json
from .cluster import DaskEngine
from .engine import Engine, LocalEngine, program, time_left
from .expressions import ExpressionError, evaluate, margin_of
from .measures import DONE, Job
from .plan import Plan, plan_of, read_plan
from .rare_failures import METHODS, RareProbability
from .results import JOURNAL, PLAN, Journal, counted_by_reason, read_journal, write_tables
from .sampling import correlation_matrix, digest_of, to_values
from .statistics import Probability, picked, probability

log = logging.getLogger(__name__)

#: Tables are rewritten after this many times the duration of writing them, and at most once in this many seconds.
_SHARE, _SELDOM = 50.0, 5.0
_STOPPING = "stopping after the runs in progress; interrupt again to stop at once"
#: Folders of runs.
RUNS, PICTURED = "runs", "pictured"


class CannotResume(ValueError):
    """The sweep cannot be resumed; the message gives the reason."""


class SweepMessages(NamedTuple):
    """Messages during a sweep: ``say`` takes a line; one line per run if ``log``, and progress every ``seconds``."""

    say: Callable[[str], None] | None = None
    log: bool = False
    seconds: float = 10.0


@dataclass(frozen=True, eq=False)
class Sweep:
    """Result of a sweep in ``folder``: its ``plan``, ``rows`` by run, whether it is ``complete``, and the probability
    of ``rare`` failure, if requested."""

    folder: Path
    plan: Plan
    rows: tuple[dict[str, Any], ...]
    complete: bool = True
    rare: RareProbability | None = None
    seconds: float = 0.0
    workers: int = 1
    pictures: Mapping[str, int] = field(default_factory=dict)

    @property
    def probability(self) -> Probability:
        """Probability of failure from the runs as independent samples (not for methods for rare failures: see
        ``rare``)."""
        return probability(self.rows)

    def column(self, name: str) -> np.ndarray:
        """(n,) numbers of a column, nan if a run has none."""
        from .statistics import numbers

        return numbers(self.rows, name)

    def text(self) -> str:
        """Summary for the terminal."""
        lines = [
            f"{len(self.rows)} runs in {self.folder}" + ("" if self.complete else f", of {self._asked}: not complete")
        ]
        lines.append(f"  {self.rare if self.rare is not None else self.probability} ({self.plan.fails})")
        result = self.plan.result
        values = self.column(result)
        values = values[np.isfinite(values)]
        if len(values) and self.rare is None:
            low, median, high = np.quantile(values, (0.05, 0.5, 0.95))
            lines.append(
                f"  {result}: mean {values.mean():.4g}, standard deviation "
                f"{values.std(ddof=1) if len(values) > 1 else 0:.3g}, "
                f"5 % {low:.4g}, median {median:.4g}, 95 % {high:.4g}"
            )
        for each in counted_by_reason(self.rows):
            lines.append(f"  {each['runs']} {each['status']}: {each['reason'][:120]} (run {each['run']})")
        return "\n".join(lines)

    @property
    def _asked(self) -> int:
        return len(self.plan.table)


def read_sweep(folder: Path | str) -> Sweep:
    """The sweep in ``folder``, complete or not. Raises FileNotFoundError, SceneError."""
    folder = Path(folder)
    stored = json.loads((folder / PLAN).read_text(encoding="utf-8"))
    plan = read_plan(stored["plan"])
    rows = read_journal(folder / JOURNAL)
    rare = stored.get("rare")
    if rare:
        values: dict[str, Any] = {
            k: tuple(v) if isinstance(v, list) else math.nan if v is None else v for k, v in rare.items()
        }
        rare = RareProbability(**values)
    return Sweep(
        folder, plan, tuple(rows[n] for n in sorted(rows)), bool(stored.get("complete")), rare or None,
        stored.get("seconds", 0.0), stored.get("workers", 1), stored.get("pictures", {}),
    )  # fmt: skip


def sweep(
    scene: str | Path,
    vary: Mapping[str, Any] | None = None,
    *,
    out: str | Path | None = None,
    client: Any = None,
    scheduler: str | None = None,
    workers: int | None = None,
    resume: bool = False,
    **settings: Any,
) -> Sweep:
    """Many runs of ``scene`` (a path), with one row of the table each.

    ``vary``: key of the scene → values, range or distribution (see `geomech.sweep.variables`); ``settings`` are the
    other keys of [sweep]: runs, seeds, sampling, seed, measure, fails, columns, derive, keep …; ``overrides``,
    ``variant`` and ``limit`` as on the command line. Rows are written to the folder ``out`` (default
    outputs/NAME_sweep). Runs are made by ``workers`` processes of this machine (default: one per core), by the cluster
    of a dask.distributed ``client``, or by that of the ``scheduler`` at an address. ``resume``: continue the sweep in
    ``out``.

    Raises SceneError with all errors of the scene and the sweep before any run,
    `geomech.output.run_lock.FolderRefused`, `CannotResume`, `geomech.sweep.cluster.EngineRefused`.
    """
    about = {name: settings.pop(name) for name in ("overrides", "variant", "limit", "overwrite") if name in settings}
    overwrite = about.pop("overwrite", False)
    given = {**({"vary": dict(vary)} if vary else {}), **settings}
    plan = plan_of(scene, given, **about)
    folder = Path(out) if out is not None else default_folder(plan.scene)
    return carry_out_sweep(
        plan, folder, engine_for(plan, folder, workers, scheduler, client), resume=resume, overwrite=overwrite
    )


def default_folder(scene: Path) -> Path:
    """``outputs/NAME_sweep`` below the working folder."""
    name = scene.parent.name if scene.name == "scene.toml" else scene.stem
    return Path("outputs") / f"{name}_sweep"


def engine_for(
    plan: Plan, folder: Path, workers: int | None = None, scheduler: str | None = None, client: Any = None
) -> Engine:
    """The engine selected by the arguments."""
    if client is None and scheduler is None:
        return LocalEngine(workers)
    shared = folder.resolve() if plan.settings["keep"] != "none" else None
    return DaskEngine(scheduler, client, scene=plan.scene, folder=shared)


def carry_out_sweep(
    plan: Plan,
    folder: Path,
    engine: Engine,
    *,
    resume: bool = False,
    overwrite: bool = False,
    messages: SweepMessages | None = None,
) -> Sweep:
    """Make the runs of ``plan`` that are not in ``folder`` yet with ``engine``; returns the sweep, complete or not.

    After a first interrupt no more runs are started and those in progress are completed; a second one ends them and
    raises KeyboardInterrupt. Finished runs are kept.
    """
    with RunLock(folder) as lock:
        if lock.stale and messages and messages.say:
            messages.say(lock.stale)
        _prepare(folder, plan, resume, overwrite)
        with Journal(folder / JOURNAL) as journal, Interruption(_STOPPING, patience=None) as interruption:
            runner = _Runner(plan, folder, journal, engine, interruption, messages or SweepMessages())
            return runner.go()


def _prepare(folder: Path, plan: Plan, resume: bool, overwrite: bool) -> None:
    """Prepare the folder for this sweep. Raises FolderTaken, CannotResume."""
    stored_at = folder / PLAN
    stored = json.loads(stored_at.read_text(encoding="utf-8")) if stored_at.is_file() else None
    table = "" if plan.settings["rare"] else digest_of(plan.table)
    requested = {"plan": plan.as_dict(), "table": table, "program": program(),
            "files": _files(plan)}  # fmt: skip
    if resume:
        if stored is None:
            raise CannotResume(f"{folder} holds no sweep to continue")
        for name, what in (
            ("plan", "what varies or is measured"),
            ("table", "the table of runs"),
            ("files", "the scene"),
            ("program", "geomech"),
        ):
            if stored[name] != requested[name]:
                raise CannotResume(
                    f"{what} has changed since the sweep in {folder} began: start again in another folder "
                    "(--out DIR), or replace it (--overwrite)"
                )
        return
    if stored is not None and not overwrite:
        raise FolderTaken(
            f"{folder} holds a sweep: continue it (--resume), replace it (--overwrite), or name another "
            "folder (--out DIR)"
        )
    for name in (JOURNAL, "runs.csv", "runs.parquet", "times.csv"):
        (folder / name).unlink(missing_ok=True)
    write_json(stored_at, requested | {"versions": versions(), "complete": False})


def _files(plan: Plan) -> str:
    """A digest of the scene and the files it reads."""
    import hashlib

    digest = hashlib.sha256(plan.scene.read_bytes())
    from ..scene import load_scene

    geometry = load_scene(plan.scene, plan.overrides, plan.variant, to_run=False).tables.geometry
    for name in [geometry.model, *(entry.file for entry in geometry.traces)]:
        if name:
            digest.update((plan.scene.parent / name).read_bytes())
    return digest.hexdigest()[:16]


class _Runner:
    """A sweep in progress."""

    def __init__(
        self,
        plan: Plan,
        folder: Path,
        journal: Journal,
        engine: Engine,
        interruption: Interruption,
        messages: SweepMessages,
    ) -> None:
        self.plan, self.folder, self.journal, self.engine = plan, folder, journal, engine
        self.interruption, self.messages = interruption, messages
        self.durations: deque[float] = deque(maxlen=2000)
        self.warm: set[tuple[str, int]] = set()
        self.settled = False
        self.began = time.monotonic()
        self.last_report = self.began
        self.written, self.cost = self.began, 0.0
        self.fresh = 0
        self.total = len(plan.table) if not plan.settings["rare"] else 0
        self.notes_shown = 0

    def go(self) -> Sweep:
        rare = None
        with self.engine:
            if self.plan.settings["rare"]:
                rare = self._rare()
            else:
                self._make(range(len(self.plan.table)), self.plan.table)
        complete = rare is not None or (
            not self.plan.settings["rare"] and len(self.journal.rows) >= len(self.plan.table)
        )
        pictures = self._pictures() if complete and not self.interruption.asked else {}
        rows = self._rows()
        write_tables(self.folder, rows)
        stored = json.loads((self.folder / PLAN).read_text(encoding="utf-8"))
        seconds = stored.get("seconds", 0.0) + time.monotonic() - self.began
        found = Sweep(self.folder, self.plan, tuple(rows), complete, rare, seconds, self.engine.workers, pictures)
        answer = {"complete": complete, "seconds": round(seconds, 2), "workers": self.engine.workers,
                  "pictures": pictures,
                  "probability": found.probability._asdict()}  # fmt: skip
        if rare is not None:
            answer["rare"] = {name: _finite(value) for name, value in vars(rare).items()}
        write_json(self.folder / PLAN, stored | answer)
        if self.interruption.asked:
            raise KeyboardInterrupt
        return found

    def _rows(self) -> list[dict[str, Any]]:
        return [self.journal.rows[number] for number in sorted(self.journal.rows)]

    def _job(self, number: int, values: Mapping[str, Any]) -> Job:
        plan, keep = self.plan, self.plan.settings["keep"]
        folder = str(self.folder.resolve() / RUNS / f"{number:06d}") if keep != "none" else None
        return Job(
            number, str(plan.scene), plan.variant, plan.changes(values), plan.settings, plan.box, plan.cells, folder,
            keep, False, program(),
        )  # fmt: skip

    def _make(self, numbers: Iterable[int], table: Sequence[Mapping[str, Any]]) -> None:
        """Make the runs that are not in the journal."""
        values = dict(zip(numbers, table, strict=True))
        missing = [number for number in values if number not in self.journal.rows]
        for row in self.engine.results(self._handed_out(missing, values)):
            number = row["run"]
            row = {"run": number, **values[number], **{k: v for k, v in row.items() if k != "run"}}
            if self.journal.add(row):
                self.fresh += 1
                self._took(row)
            self._show_row(row, values[number])
            if self.interruption.asked:
                self.engine.stop()
            self._write_periodically()

    def _took(self, row: Mapping[str, Any]) -> None:
        """Record the duration of a run; that of a process's first run, which loads and compiles, only until there are
        others."""
        process = row["host"], row["process"]
        if process in self.warm:
            if not self.settled:
                self.durations.clear()
                self.settled = True
            self.durations.append(row["seconds"])
        elif not self.settled:
            self.durations.append(row["seconds"])
        self.warm.add(process)

    def _handed_out(self, numbers: list[int], values: Mapping[int, Mapping[str, Any]]) -> Iterator[Job]:
        for number in numbers:
            if self.interruption.asked:
                return
            yield self._job(number, values[number])

    def _write_periodically(self) -> None:
        now = time.monotonic()
        if now - self.written > max(_SELDOM, _SHARE * self.cost):
            write_tables(self.folder, self._rows())
            self.written, self.cost = time.monotonic(), time.monotonic() - now

    def _show_row(self, row: Mapping[str, Any], values: Mapping[str, Any]) -> None:
        say = self.messages.say
        if say is None:
            return
        for note in self.engine.notes[self.notes_shown :]:
            say(note)
        self.notes_shown = len(self.engine.notes)
        if self.messages.log:
            result = row.get(self.plan.result)
            shown = f"{self.plan.result} {result:.4g}" if isinstance(result, (int, float)) else row["status"]
            say(
                f"run {row['run']}: {shown}, {row['seconds']:.2f} s; "
                + ", ".join(f"{k} = {v}" for k, v in values.items())
            )
        if row["status"] != DONE and self.messages.log:
            say(f"  {row['status']}: {row['reason']}\n  again: {self.plan.how_to_repeat(values)}")
        now = time.monotonic()
        if now - self.last_report >= self.messages.seconds or len(self.journal.rows) == self.total:
            self.last_report = now
            say(self._progress())

    def _progress(self) -> str:
        rows = self.journal.rows.values()
        done, bad = len(self.journal.rows), sum(row["status"] != DONE for row in rows)
        failing = sum(bool(row["fails"]) for row in rows)
        text = f"{done} of {self.total} runs" if self.total else f"{done} runs"
        text += f", {failing} fail" + (f", {bad} without a result" if bad else "")
        if self.total and self.fresh and done < self.total:
            left = time_left(
                self.fresh, self.total - (done - self.fresh), self.durations, self.engine.workers, self.began
            )
            mean = sum(self.durations) / len(self.durations)
            text += f", {_span(left)} left ({mean:.2g} s a run, {self.engine.workers} at a time)"
        return text

    def _rare(self) -> RareProbability | None:
        """The probability of a rare failure; None where it was interrupted."""
        plan, numbers = self.plan, itertools.count()
        variables = plan.random
        pairs = plan.design.correlations
        matrix = correlation_matrix([each.name for each in variables], pairs) if pairs else None
        margin = margin_of(plan.fails)

        def limit_state(points: np.ndarray) -> np.ndarray:
            values = to_values(variables, points, matrix)
            table = [dict(zip((each.name for each in variables), row, strict=True)) for row in values.tolist()]
            own = [next(numbers) for _ in table]
            for number, row in zip(own, table, strict=True):
                # A journal of other samples would belong to another sweep.
                known = self.journal.rows.get(number)
                if known is not None and any(known[name] != value for name, value in row.items()):
                    raise CannotResume(
                        f"run {number} in {self.folder} has other values than this sweep gives it: start again "
                        "(--overwrite)"
                    )
            self._make(own, table)
            if self.interruption.asked:
                raise _Interrupted
            return np.array([_margin(margin, self.journal.rows[number]) for number in own])

        try:
            return METHODS[plan.settings["rare"]](limit_state, len(variables), plan.design.runs, plan.design.seed)
        except _Interrupted:
            return None

    def _pictures(self) -> dict[str, int]:
        """Repeat the typical, the worst and the median run with pictures."""
        if self.plan.settings["measure"] == "pause":
            return {}
        least = self.plan.settings["measure"] == "safety"
        found = picked(self._rows(), self.plan.result, least)
        jobs = {}
        for number in dict.fromkeys(found.values()):
            values = {
                name: self.journal.rows[number][name] for name in self._names() if name in self.journal.rows[number]
            }
            place = self.folder.resolve() / PICTURED / f"{number:06d}"
            if not (place / "picture.png").is_file():
                jobs[number] = self._job(number, values)._replace(folder=str(place), keep="all", pictures=True)
        # On this machine, where the folder is, whichever engine made the runs.
        with LocalEngine(min(len(jobs), self.engine.workers) or 1) as engine:
            for _ in engine.results(jobs.values()):
                pass
        return {
            name: number
            for name, number in found.items()
            if (self.folder / PICTURED / f"{number:06d}" / "picture.png").is_file()
        }

    def _names(self) -> list[str]:
        return [*(each.name for each in self.plan.variables), "seed"]


class _Interrupted(Exception):
    """Runs of a level are missing."""


def _margin(text: str, row: Mapping[str, Any]) -> float:
    if row["status"] != DONE:
        return math.nan
    try:
        return float(evaluate(text, row))
    except ExpressionError:
        return math.nan


def _span(seconds: float) -> str:
    if not math.isfinite(seconds):
        return "an unknown time"
    if seconds < 90:
        return f"{seconds:.0f} s"
    if seconds < 5400:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
