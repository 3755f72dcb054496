"""One run of a sweep and its columns of the table.

safety   the factor of safety of `geomech.safety_report`, its mechanism, and the blocks that move at failure
run      the scene run to its end: loads, growth, displacements, and its summary
pause    a sleep, for benchmarks of the engines

A run that ends in an error has a status, "refused" (its scene cannot be drawn or has no solution) or "failed" (the
solvers gave up), and a reason. Masses and volumes are per metre of thickness.
"""

from __future__ import annotations

import base64
import json
import logging
import os
import re
import shutil
import socket
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .expressions import ExpressionError, evaluate

if TYPE_CHECKING:
    from ..model import Problem

DONE, REFUSED, FAILED = "done", "refused", "failed"
#: Columns of every measure that differ from machine to machine.
TIMES = ("seconds", "processor_seconds", "host", "process", "attempts")
#: Quoted names and numbers, which differ between reasons of the same kind.
_OWN = re.compile(r"'[^']*'|(?<![\w])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
#: Class names of errors for scenes without a solution.
_REFUSALS = ("SceneError", "CracksInBlocks", "NothingToReduce")
#: Number of characters kept of a reason, and number of warnings kept of a run.
_REASON, _WARNED = 400, 3


class Job(NamedTuple):
    """A run to be made: its ``number``, the ``scene``'s path, its ``variant``, the ``changes`` "key=value", the
    ``settings`` of [sweep], ``box`` and ``cells`` of the map of moving places (see `Plan`), the ``folder`` for its
    files (None: no files), which runs are kept (``keep``), and whether pictures are drawn. ``program`` is the digest of
    the sources with which the sweep began."""

    number: int
    scene: str
    variant: str | None
    changes: tuple[str, ...]
    settings: Mapping[str, Any]
    box: tuple[float, float, float, float]
    cells: tuple[int, int]
    folder: str | None = None
    keep: str = "none"
    pictures: bool = False
    program: str = ""


def carry_out(job: Job) -> dict[str, Any]:
    """The row of a run: "run", "status", "reason", its columns, and its `TIMES`. Raises interrupts only."""
    clock, processor = time.perf_counter(), time.process_time()
    row: dict[str, Any] = {"run": job.number, "status": DONE, "reason": ""}
    with _collected_warnings() as warnings_seen:
        try:
            row |= _MEASURES[job.settings["measure"]](job)
            row |= _columns(job, row)
        except Exception as error:
            refused = any(kind.__name__ in _REFUSALS for kind in type(error).__mro__)
            row |= {"status": REFUSED if refused else FAILED, "reason": _error_text(error)}
    row["warnings"] = len(warnings_seen)
    row["first_warnings"] = [text[:_REASON] for text in warnings_seen[:_WARNED]]
    row["fails"] = _fails(job, row)
    _keep(job, row)
    for name in ("_parts", "_summary", "_history"):
        row.pop(name, None)
    row |= {
        "seconds": round(time.perf_counter() - clock, 5),
        "processor_seconds": round(time.process_time() - processor, 5),
        "host": socket.gethostname(), "process": os.getpid(),
    }  # fmt: skip
    return row


def kind_of_reason(reason: str) -> str:
    """A ``reason`` without numbers and names, which differ between runs."""
    return _OWN.sub("#", reason.splitlines()[0] if reason else "")


def _error_text(error: Exception) -> str:
    faults = getattr(error, "errors", None)
    if isinstance(faults, list) and faults and hasattr(faults[0], "message"):
        text = f"{faults[0].place}: {faults[0].message}"
    else:
        text = f"{type(error).__name__}: {error}"
    return " ".join(text.split())[:_REASON]


def _columns(job: Job, row: Mapping[str, Any]) -> dict[str, Any]:
    """Columns computed from others."""
    names = {**row.get("_summary", {}), **{key: value for key, value in row.items() if not key.startswith("_")}}
    names["history"] = row.get("_history", {})
    found: dict[str, Any] = {}
    for name, text in job.settings["columns"].items():
        try:
            found[name] = names[name] = evaluate(text, names)
        except ExpressionError as error:
            raise ValueError(f"column {name}: {error}") from error
    return found


def _fails(job: Job, row: dict[str, Any]) -> bool | None:
    """Whether the slope fails; None if the run has no result."""
    if row["status"] != DONE:
        return None
    from .plan import FAILS

    text = job.settings["fails"] or FAILS[job.settings["measure"]]
    try:
        found = evaluate(text, {**row.get("_summary", {}), **row})
    except ExpressionError as error:
        row |= {"status": FAILED, "reason": f"fails: {error}"[:_REASON]}
        return None
    return bool(found)


@contextmanager
def _collected_warnings() -> Iterator[list[str]]:
    """Collects the warnings of geomech in this context."""
    texts: list[str] = []

    class Listening(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            texts.append(record.getMessage())

    handler, logger = Listening(logging.WARNING), logging.getLogger("geomech")
    logger.addHandler(handler)
    before, logger.propagate = logger.propagate, False
    try:
        yield texts
    finally:
        logger.propagate = before
        logger.removeHandler(handler)


# Factor of safety


def _safety(job: Job) -> dict[str, Any]:
    from ..pipeline import safety_report
    from ..scene import load_scene

    settings = job.settings
    scene = load_scene(job.scene, job.changes, job.variant, to_run=False)
    report = safety_report(
        scene, settings["at_s"], along=settings["along"], divide=settings["divide"] or None,
        tolerance=settings["tolerance"], without_cracks=settings["without_cracks"],
        follow=job.folder is not None,
    )  # fmt: skip
    found, problem = report.found, report.problem
    moving = np.array(found.moving, dtype=int)
    bounded = bool(np.isfinite(found.upper))
    row = {
        "factor_of_safety": float(found.factor), "lower": float(found.lower),
        "upper": float(found.upper) if bounded else None, "is_bound": not bounded or bool(report.cracks),
        "mechanism": report.mechanism or "none", "trials": len(found.trials),
        **_of_blocks(problem, moving, job),
    }  # fmt: skip
    for text in found.warnings:
        logging.getLogger("geomech.sweep").warning("%s", text)
    if job.folder is not None:
        place = _own_folder(job)
        (place / "safety.json").write_text(json.dumps(report.as_dict(), indent=1, default=str), encoding="utf-8")
        (place / "safety.txt").write_text(report.text() + "\n", encoding="utf-8")
        if job.pictures:
            report.draw(place / "picture.png")
    return row


def _of_blocks(problem: Problem, moving: np.ndarray, job: Job) -> dict[str, Any]:
    """Number, mass (kg/m) and volume (m³/m) of the blocks ``moving``, and the cells they occupy."""
    blocks = problem.blocks
    areas = np.abs(blocks.areas())
    density = np.array([material.density for material in problem.materials])[blocks.material]
    return {
        "blocks": int(blocks.n_blocks),
        "moving_blocks": len(moving),
        "moved_mass": float((density * areas)[moving].sum()),
        "moved_volume": float(areas[moving].sum()),
        "_places": places_of([blocks.loops(int(b))[0] for b in moving], job.box, job.cells),
    }


def places_of(outlines: list[np.ndarray], box: tuple[float, float, float, float], cells: tuple[int, int]) -> str:
    """Text with one bit per cell of the ``box``: whether its centre is inside one of the ``outlines`` (see
    `moved_cells`)."""
    inside = np.zeros(cells[::-1], bool)
    x = box[0] + (np.arange(cells[0]) + 0.5) * (box[2] - box[0]) / cells[0]
    y = box[1] + (np.arange(cells[1]) + 0.5) * (box[3] - box[1]) / cells[1]
    for outline in outlines:
        own = np.zeros_like(inside)
        for (x0, y0), (x1, y1) in zip(outline, np.roll(outline, -1, axis=0), strict=True):
            rows = np.flatnonzero((y0 > y) != (y1 > y))
            if len(rows):
                at = x0 + (y[rows] - y0) * (x1 - x0) / (y1 - y0)
                own[rows] ^= x[None, :] < at[:, None]
        inside |= own
    return base64.b64encode(np.packbits(inside).tobytes()).decode("ascii")


def moved_cells(text: str, cells: tuple[int, int]) -> np.ndarray:
    """(ny, nx) bool: the cells in a text of `places_of`."""
    bits = np.unpackbits(np.frombuffer(base64.b64decode(text), np.uint8))
    return bits[: cells[0] * cells[1]].reshape(cells[::-1]).astype(bool)


# Runs


class _Watcher:
    """Observer that keeps the first and last cycle of a run, and its history if columns need it."""

    def __init__(self, with_history: bool) -> None:
        self.with_history = with_history
        self.rows: list[dict[str, Any]] = []
        self.last: Any = None

    def on_start(self, problem: Problem, folder: Path) -> None:
        self.problem = problem

    def on_cycle(self, cycle: Any) -> None:
        self.last = cycle
        if self.with_history:
            from ..output.tables.histories import history_row

            self.rows.append(history_row(cycle))

    def on_end(self, summary: dict[str, Any], error: BaseException | None = None) -> None:
        pass


def _run(job: Job) -> dict[str, Any]:
    import tempfile

    from ..output import Summary, standard_observers
    from ..pipeline import run
    from ..scene import load_scene

    scene = load_scene(job.scene, job.changes, job.variant)
    watcher = _Watcher(any("history" in text for text in job.settings["columns"].values()))
    if job.folder is not None:
        place = _own_folder(job)
        summary = run(scene, place, [*standard_observers(scene, quiet=True), watcher], overwrite=True)
    else:
        with tempfile.TemporaryDirectory(prefix="geomech-run-") as temporary:
            summary = run(scene, Path(temporary), [Summary(), watcher], overwrite=True)
    summary = json.loads(json.dumps(summary, default=_plain))
    first, row = summary.get("first", {}), {}
    for kind in ("initiation", "coalescence"):
        row[f"{kind}_load_pa"] = (first.get(kind) or {}).get("load_pa")
    row |= {
        "end": summary.get("end"), "time_s": summary.get("time_s"), "cycles": summary.get("cycles"),
        **{name: summary.get(name) for name in ("peak_load_pa", "crack_growth_m", "crack_length_m")},
        "condition": summary.get("motion", {}).get("condition") or None,
        **_motion(job, watcher.problem, watcher.last),
        "_summary": summary,
        "_history": {name: np.array([entry.get(name, np.nan) for entry in watcher.rows], dtype=float)
                     for name in dict.fromkeys(key for entry in watcher.rows for key in entry)},
    }  # fmt: skip
    if job.pictures and job.folder is not None:
        _draw_end(job, watcher)
    return row


def _motion(job: Job, problem: Problem, last: Any) -> dict[str, Any]:
    """Moving blocks and their displacements; ``run_out_m``: largest displacement of a moving block along x, m."""
    from ..model.blocks.key_blocks import FALLS, SLIDES, key_blocks

    blocks, state = last.blocks, last.state
    moved = blocks.displacements(state.vertices)
    far = np.hypot(moved[:, 0], moved[:, 1])
    size = np.sqrt(np.abs(blocks.areas()))
    moving = np.flatnonzero(~np.asarray(blocks.fixed, bool) & (far > job.settings["moved_share"] * size))
    # Cracks may have divided blocks since the start.
    now = problem if blocks.n_blocks == problem.blocks.n_blocks else _with_blocks(problem, blocks)
    row = _of_blocks(now, moving, job)
    row["largest_displacement_m"] = float(far[~np.asarray(blocks.fixed, bool)].max(initial=0.0))
    row["run_out_m"] = float(np.abs(moved[moving, 0]).max(initial=0.0))
    row["key_blocks"] = None
    if not last.cracks.n_cracks and len(state.contacts):
        rows = key_blocks(blocks, problem.materials, problem.joints, state, problem.loads.gravity.at(state.time))
        row["key_blocks"] = int(np.isin(rows["kind"], (SLIDES, FALLS)).sum())
    return row


def _with_blocks(problem: Problem, blocks: Any) -> Any:
    class Divided(NamedTuple):
        blocks: Any
        materials: Any

    return Divided(blocks, problem.materials)


def _draw_end(job: Job, watcher: _Watcher) -> None:
    from ..render.curves.sweep_figures import draw_moved

    last = watcher.last
    draw_moved(
        last.blocks, last.state.vertices, f"run {job.number}: {watcher.problem.title}", _own_folder(job) / "picture.png"
    )


def _pause(job: Job) -> dict[str, Any]:
    time.sleep(job.settings["pause_s"])
    return {"value": float(job.number)}


_MEASURES = {"safety": _safety, "run": _run, "pause": _pause}


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else str(value)


def _own_folder(job: Job) -> Path:
    assert job.folder is not None
    place = Path(job.folder)
    place.mkdir(parents=True, exist_ok=True)
    return place


def _keep(job: Job, row: Mapping[str, Any]) -> None:
    """Write the provenance of a run into its folder, or remove the folder if it is not to be kept."""
    if job.folder is None:
        return
    wanted = job.keep == "all" or (job.keep == "failed" and (row["fails"] or row["status"] != DONE))
    if not wanted:
        shutil.rmtree(job.folder, ignore_errors=True)
        return
    with suppress(OSError):
        run_record = {"run": job.number, "scene": job.scene, "variant": job.variant, "changes": list(job.changes),
                "status": row["status"], "reason": row["reason"]}  # fmt: skip
        (_own_folder(job) / "sweep_run.json").write_text(json.dumps(run_record, indent=1), encoding="utf-8")
