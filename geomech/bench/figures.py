"""Figures of benchmarks: named numbers, stored in a file and compared with earlier ones.

Errors are compared directly. Times are divided by the time of a yardstick, a fixed piece of work of every relevant kind
(Python, products of matrices, memory), measured in the same run: a slower or busier machine is not a slower solver.
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

#: Kinds of figures, less being better: `TIME` in seconds, `ERROR` relative.
ERROR, TIME = "error", "time"

#: An error is worse if it exceeds the earlier one by this factor …
WORSE = 1.1
#: … and round-off, which differs between machines and libraries. Errors below `EXACT` may rise to that.
EXACT = 1e-9
#: A time is longer if it exceeds the earlier one by this factor: medians on a shared machine vary by a third.
LONGER = 1.5

#: Distributions whose versions are recorded.
PACKAGES = ("geomech", "numpy", "scipy", "numba", "shapely", "gmsh", "vtk", "pyvista", "meshio", "scikit-fem")


@dataclass(frozen=True)
class Point:
    """A point of a work–precision curve: the ``error`` (relative) and ``seconds`` of a ``method`` for a ``problem``, at
    this ``size`` of the varied parameter."""

    problem: str
    method: str
    size: float
    error: float
    seconds: float


@dataclass(frozen=True)
class Figure:
    """``name`` is unique within its topic; ``value`` is finite and ≥ 0."""

    name: str
    value: float
    kind: str = ERROR


@dataclass(frozen=True)
class Measured:
    """Result of a topic: ``text``, the printed table, and its ``figures``."""

    text: str
    figures: tuple[Figure, ...] = ()

    @classmethod
    def of(
        cls, text: str, *, errors: dict[str, float] | None = None, times: dict[str, float] | None = None
    ) -> Measured:
        """From tables name → relative error and name → seconds; non-finite values are left out."""
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
    """Processor, cores, system, versions, load: the context of a time."""
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


def machine_text(about: dict) -> str:
    """One or two lines about the `machine`."""
    versions = ", ".join(f"{name} {version}" for name, version in about["versions"].items())
    return (
        f"{about['processor']}, {about['cores']} cores (BLAS: {about['threads of BLAS']} threads), "
        f"load average {about['load average']}\n{about['system']}, Python {about['python']}, {versions}"
    )


def stopwatch() -> Callable[[], float]:
    """Start a stopwatch; the returned function gives the seconds since then, by the clock or of this process's
    processors, whichever is less.

    This excludes waiting for the processor; work on several threads is still measured by the clock. Not for operations
    that wait for a disk or a child process.
    """
    clock, processor = time.perf_counter(), time.process_time()
    return lambda: min(time.perf_counter() - clock, time.process_time() - processor)


def processor_seconds() -> float:
    """Processor time of this process and its finished children, user and system; of this process only if the system
    does not report more."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def times_text(spent: Mapping[str, Mapping[str, float]]) -> str:
    """Table of the time of every topic, and the total."""
    rows = [(name, took["seconds"], took["of processor"]) for name, took in spent.items()]
    rows.append(("all", sum(row[1] for row in rows), sum(row[2] for row in rows)))
    lines = ["time of the benchmarks                     s   of processor"]
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
    """Write ``topics`` as JSON; ``unit`` is the yardstick's time, ``spent`` the time of the topics."""
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
    """Read a file of `write`.

    Raises FileNotFoundError, and ValueError for another file, or for a run that was ``quick`` if this one is not (or
    vice versa): figures with the same name then have different sizes.
    """
    try:
        record = json.loads(Path(path).read_text(encoding="utf-8"))
    except json.JSONDecodeError as error:
        raise ValueError(f"{path} is not valid JSON ({error}); give a file written by `geomech bench`") from error
    if not isinstance(record, dict) or not {"topics", "yardstick_s"} <= set(record):
        raise ValueError(f"{path} has no benchmark figures; give a file written by `geomech bench`")
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
    """Every figure in both runs, the worst ratios first."""
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
    """The table of figures that became worse or better."""
    lines = [f"compared with {path}: {len(found)} figures"]
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
    lines.append("  the earlier figures were measured on " + ", ".join(map(str, other.values())))
    return "\n".join(lines)


def less_accurate(found: Iterable[Change]) -> list[Change]:
    """The errors that became worse."""
    return [c for c in found if c.kind == ERROR and c.worse]
