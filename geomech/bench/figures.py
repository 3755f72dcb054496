"""What a benchmark measured, as named numbers: kept in a file, and held against an earlier one.

Errors are compared as they are. Times are compared after division by the time of a yardstick, a fixed piece of work of
every kind that counts here (Python, products of matrices, memory), measured in the same run: a slower machine, or a
busier one, is not a slower solver.
"""

from __future__ import annotations

import json
import math
import os
import platform
import statistics
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..output.tables.summary import installed, write_json

#: Kinds of figures. Less is better of both; `TIME` in seconds, `ERROR` relative.
ERROR, TIME = "error", "time"

#: An error is worse when it is more than so many times what it was …
WORSE = 1.1
#: … and above round-off, which differs among machines and libraries. Errors below `EXACT` may be as large as that.
EXACT = 1e-9
#: A time is longer when it is more than so many times what it was: medians on a machine with other users vary by a
#: third.
LONGER = 1.5

#: Distributions whose versions are told.
PACKAGES = ("geomech", "numpy", "scipy", "numba", "shapely", "gmsh", "vtk", "pyvista", "meshio", "scikit-fem")


@dataclass(frozen=True)
class Point:
    """A point of a work–precision curve: the ``error`` (relative) and ``seconds`` of a ``method`` for a ``problem``, at
    that ``size`` of what is varied."""

    problem: str
    method: str
    size: float
    error: float
    seconds: float


@dataclass(frozen=True)
class Figure:
    """``name`` is one of a kind within its topic; ``value`` is finite and ≥ 0."""

    name: str
    value: float
    kind: str = ERROR


@dataclass(frozen=True)
class Measured:
    """What a topic says (``text``, the table that is printed) and its ``figures``."""

    text: str
    figures: tuple[Figure, ...] = ()

    @classmethod
    def of(
        cls, text: str, *, errors: dict[str, float] | None = None, times: dict[str, float] | None = None
    ) -> Measured:
        """From tables name → relative error and name → seconds; what is not finite is left out."""
        named = [(ERROR, errors or {}), (TIME, times or {})]
        return cls(
            text,
            tuple(
                Figure(name, float(value), kind)
                for kind, table in named
                for name, value in table.items()
                if value is not None and math.isfinite(value)
            ),
        )


def machine() -> dict:
    """Processor, cores, system, versions, load: what a time means."""
    processor = platform.processor() or platform.machine()
    information = Path("/proc/cpuinfo")
    if information.is_file():
        names = [line.split(":", 1)[1].strip() for line in information.read_text().splitlines() if "model name" in line]
        processor = names[0] if names else processor
    return {
        "processor": processor,
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "threads of BLAS": os.environ.get("OPENBLAS_NUM_THREADS", "all"),
        "load average": round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None,
        "versions": installed(PACKAGES),
    }


def said(about: dict) -> str:
    """A line or two on the `machine`."""
    versions = ", ".join(f"{name} {version}" for name, version in about["versions"].items())
    return (
        f"{about['processor']}, {about['cores']} cores (BLAS: {about['threads of BLAS']} threads), "
        f"load average {about['load average']}\n{about['system']}, Python {about['python']}, {versions}"
    )


def stopwatch() -> Callable[[], float]:
    """Starts; what it returns tells the seconds since then, by the clock or of this process's processors, whichever are
    fewer.

    Waiting while other programs have the processor is left out so; work on several threads is still told by the clock.
    Not for what waits for a disk or for a child process.
    """
    clock, processor = time.perf_counter(), time.process_time()
    return lambda: min(time.perf_counter() - clock, time.process_time() - processor)


def processor_seconds() -> float:
    """Of this process and of its children that have ended, user and system; of this process alone where the system
    tells no more."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def times_text(spent: Mapping[str, Mapping[str, float]]) -> str:
    """The table of what every topic took, and all of them."""
    rows = [(name, took["seconds"], took["of processor"]) for name, took in spent.items()]
    rows.append(("all", sum(row[1] for row in rows), sum(row[2] for row in rows)))
    lines = ["what the benchmarks themselves took        s   of processor"]
    return "\n".join(lines + [f"  {name:<34}{seconds:8.1f}{own:15.1f}" for name, seconds, own in rows])


def yardstick(repeats: int = 7) -> float:
    """Seconds of a fixed piece of work, the median of ``repeats``."""
    rng = np.random.default_rng(0)
    square, long = rng.standard_normal((300, 300)), rng.standard_normal(1_000_000)
    spent = []
    for _ in range(repeats):
        spent_on = stopwatch()
        (square @ square).sum()
        np.sort(long)
        sum(k * k for k in range(300_000))
        spent.append(spent_on())
    return statistics.median(spent)


def write(
    path: Path,
    topics: dict[str, Measured],
    *,
    quick: bool,
    unit: float,
    spent: Mapping[str, Mapping[str, float]] | None = None,
) -> Path:
    """``topics`` as JSON; ``unit`` is the yardstick's time, ``spent`` what the topics took."""
    path.parent.mkdir(parents=True, exist_ok=True)
    record = {
        "machine": machine(),
        "quick": quick,
        "yardstick_s": unit,
        "spent": spent or {},
        "topics": {
            name: {kind: {f.name: f.value for f in found.figures if f.kind == kind} for kind in (ERROR, TIME)}
            for name, found in topics.items()
        },
    }
    write_json(path, record)
    return path


def read(path: Path, *, quick: bool | None = None) -> dict:
    """What `write` wrote. Raises FileNotFoundError, and ValueError for a file of something else, or of a run that was
    ``quick`` where this one is not (or the other way round): figures of the same name are then of other sizes."""
    try:
        record = json.loads(Path(path).read_text(encoding="utf-8"))
    except json.JSONDecodeError as error:
        raise ValueError(f"{path} is no JSON ({error}); give a file that `geomech bench` wrote") from error
    if not isinstance(record, dict) or not {"topics", "yardstick_s"} <= set(record):
        raise ValueError(f"{path} holds no figures of a benchmark; give a file that `geomech bench` wrote")
    if quick is not None and bool(record.get("quick")) != quick:
        this, other = ("this run is quick", "was not") if quick else ("this run is not quick", "was")
        raise ValueError(f"{this}, that of {path} {other}: compare quick with quick, and full with full")
    return record


@dataclass(frozen=True)
class Change:
    """A figure then and now; ``ratio`` is now over then, times in units of the yardstick."""

    topic: str
    name: str
    kind: str
    before: float
    now: float
    ratio: float

    @property
    def worse(self) -> bool:
        if self.kind == TIME:
            return self.ratio > LONGER
        return self.now > EXACT and self.now > WORSE * self.before

    @property
    def better(self) -> bool:
        if self.kind == TIME:
            return self.ratio < 1 / LONGER
        return self.before > EXACT and self.now < self.before / WORSE


def changes(before: dict, topics: dict[str, Measured], unit: float) -> list[Change]:
    """Every figure that is in both, those that got worse most first."""
    out = []
    for topic, found in topics.items():
        known = before["topics"].get(topic, {})
        for figure in found.figures:
            then = known.get(figure.kind, {}).get(figure.name)
            if then is None:
                continue
            scale = before["yardstick_s"] / unit if figure.kind == TIME else 1.0
            ratio = figure.value * scale / then if then > 0 else math.inf if figure.value > 0 else 1.0
            out.append(Change(topic, figure.name, figure.kind, then, figure.value, ratio))
    return sorted(out, key=lambda c: (not c.worse, c.kind, -c.ratio))


def compared(found: Sequence[Change], before: dict, path: Path) -> str:
    """The table of what got worse or better."""
    lines = [f"held against {path}: {len(found)} figures"]
    for title, rows in (
        ("less accurate", [c for c in found if c.worse and c.kind == ERROR]),
        (
            f"slower (over {LONGER:g} times, in units of the yardstick)",
            [c for c in found if c.worse and c.kind == TIME],
        ),
        ("more accurate", [c for c in found if c.better and c.kind == ERROR]),
        ("quicker", [c for c in found if c.better and c.kind == TIME]),
    ):
        lines.append(f"  {title}: {len(rows) or 'nothing'}")
        lines += [f"    {c.topic:<10} {c.name}: {c.before:.3g} → {c.now:.3g} ({c.ratio:.2f} times)" for c in rows]
    other = {k: v for k, v in before["machine"].items() if k in ("processor", "python")}
    lines.append("  that was on " + ", ".join(map(str, other.values())))
    return "\n".join(lines)


def less_accurate(found: Iterable[Change]) -> list[Change]:
    """The errors that got worse."""
    return [c for c in found if c.kind == ERROR and c.worse]
