"""``summary.json``: the results of a run in numbers, as the basis of tables."""

from __future__ import annotations

import importlib.metadata
import json
import math
import os
import platform
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from geomech.model import Cycle, Event, Problem

from ..unreached import unreached
from .crack_reliability import crack_trust
from .deepest_penetration import Deepest, step_limits
from .motion_state import energy_summary, key_block_summary, motion_summary
from .skipped_work import skipped

#: Counters of a `Summary`.
_COUNTED = ("_last", "_events", "_peak", "_load_steps", "_growth_passes", "_grown", "_deepest")


class Summary:
    """Observer that counts, and at the end completes the run's ``summary`` and writes ``summary.json``.

    Loads are in Pa, positive in compression; if the problem has cracks and a toughness, their magnitudes are also given as
    |σ|√(πb)/K_Ic, with b half the longest crack of the scene, which makes strengths of different rocks comparable. The peak
    is the load of largest magnitude.
    """

    def on_start(self, problem: Problem, folder: Path) -> None:
        self._begin(problem, folder)
        self._last: Cycle | None = None
        self._events: list[Event] = []
        self._peak, self._load_steps, self._growth_passes, self._grown = 0.0, 0, 0, 0.0
        self._deepest = Deepest()

    def _begin(self, problem: Problem, folder: Path) -> None:
        self._problem, self._path = problem, Path(folder) / "summary.json"
        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._path.unlink(missing_ok=True)
        self._began = time.perf_counter()
        self._scale = normalisation(problem)

    def memory(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in _COUNTED}

    def on_resume(self, problem: Problem, folder: Path, memory: dict[str, Any]) -> None:
        self._begin(problem, folder)
        vars(self).update({name: memory[name] for name in _COUNTED})
        self._events = list(self._events)

    def on_cycle(self, cycle: Cycle) -> None:
        self._last = cycle
        self._deepest.look(cycle)
        self._events += cycle.events
        self._peak = max(self._peak, cycle.load, key=abs)
        self._load_steps = max(self._load_steps, cycle.load_step)
        grown = float(cycle.latest_tips["grown"].sum())
        self._growth_passes += grown > 0
        self._grown += grown

    def on_end(self, summary: dict[str, Any], error: BaseException | None = None) -> None:
        last = self._last
        summary.setdefault("title", self._problem.title)
        summary.setdefault("end", "failed" if error is not None else "end of time")
        if error is not None:
            summary["error"] = f"{type(error).__name__}: {error}"
        summary.setdefault("wall_s", round(time.perf_counter() - self._began, 4))
        seconds = summary.setdefault("seconds", {})
        if last is not None:
            seconds.update({phase: round(value, 4) for phase, value in last.seconds.items()})
        if last is not None and last.work:
            summary["crack_solver"] = last.work
        if last is not None:
            summary["skipped"] = skipped(self._problem, last) | summary.get("skipped", {})
        if last is not None and last.bodies and error is None:
            summary["crack_trust"] = crack_trust(last)
        first: dict[str, dict[str, Any]] = {}
        counts: dict[str, int] = {}
        for event in self._events:
            counts[event.kind] = counts.get(event.kind, 0) + 1
            first.setdefault(event.kind, self._event_row(event))
        summary["first"] = first
        summary["events"] = counts
        if last is not None:
            summary["cycles"] = last.number + 1
            summary["load_steps"] = self._load_steps  # without the initial state, number 0
            summary["growing_cycles"] = int(self._growth_passes)
            summary["time_s"] = float(last.state.time)
            summary["peak_load_pa"] = float(self._peak)
            summary["last_load_pa"] = float(last.load)
            summary["last_strain"] = _finite(last.strain)
            summary["crack_growth_m"] = self._grown
            summary["crack_length_m"] = float(last.cracks.lengths.sum())
            summary["blocks"] = last.blocks.n_blocks
            if self._deepest.summary is not None:
                summary["deepest_penetration"] = self._deepest.summary
            if last.shortened:
                summary["shortened_steps"] = step_limits(last.shortened)
            if last.statistics:
                summary["motion"], summary["energy"] = motion_summary(last), energy_summary(last)
            if not last.cracks.n_cracks and len(last.state.contacts):
                summary["key_blocks"] = key_block_summary(last, self._problem)
            summary["tips"] = len(last.latest_tips)
        if self._scale is not None:
            half_length, toughness = self._scale
            summary["normalisation"] = {"half_length_m": half_length, "k_ic_pa_sqrt_m": toughness}
        summary["cracks"] = list(self._problem.cracks.names)
        if any(self._problem.origin):
            summary["world_origin_m"] = list(self._problem.origin)
        summary["versions"] = versions()
        missed = "" if error is not None else unreached(self._problem, last, counts)
        if missed:
            summary["not_reached"] = missed
        leading = {name: summary[name] for name in ("title", "end", "not_reached") if name in summary}
        write_json(self._path, leading | summary)

    def _event_row(self, event: Event) -> dict[str, Any]:
        row: dict[str, Any] = {
            "load_pa": _finite(event.load),
            "time_s": event.time,
            "cycle": event.cycle,
            "point": list(event.point),
        }
        if self._scale is not None:
            half_length, toughness = self._scale
            row["load_normalised"] = _finite(abs(event.load) * math.sqrt(math.pi * half_length) / toughness)
        if event.detail:
            row["detail"] = event.detail
        return row


def normalisation(problem: Problem) -> tuple[float, float] | None:
    """(b, K_Ic) for the dimensionless load σ√(πb)/K_Ic: half the length of the scene's longest crack, and the toughness
    of its block; None without cracks or with infinite toughness."""
    cracks = problem.cracks
    if not cracks.n_segments:
        return None
    length = np.bincount(cracks.crack, weights=cracks.lengths)
    longest = int(np.argmax(length))
    block = int(cracks.block[np.flatnonzero(cracks.crack == longest)[0]])
    toughness = problem.materials[int(problem.blocks.material[block])].k_ic
    return (0.5 * float(length[longest]), toughness) if math.isfinite(toughness) else None


def versions() -> dict[str, str]:
    """Versions of the software that computed the run."""
    found = {"python": platform.python_version(), "machine": f"{platform.machine()}, {os.cpu_count()} cores"}
    packages = ("geomech", "numpy", "scipy", "numba", "shapely", "gmsh")
    return found | dict.fromkeys(packages, "not installed") | installed(packages)


def installed(packages: Iterable[str]) -> dict[str, str]:
    """Versions of those ``packages`` that are installed."""
    found = {}
    for package in packages:
        with suppress(importlib.metadata.PackageNotFoundError):
            found[package] = importlib.metadata.version(package)
    return found


def write_json(path: Path, value: Any) -> None:
    """Write ``value`` as JSON, atomically; NumPy numbers become plain ones."""
    unfinished = path.with_name(path.name + ".part")
    unfinished.write_text(json.dumps(value, indent=2, default=_plain, ensure_ascii=False) + "\n", encoding="utf-8")
    os.replace(unfinished, path)


def _finite(value: float) -> float | None:
    """JSON has no nan."""
    return float(value) if math.isfinite(value) else None


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    return str(value)
