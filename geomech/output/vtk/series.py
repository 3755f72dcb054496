"""ParaView series of a run, readable after every cycle: which cycles are written, with which fields."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from geomech.model import CHANGES, Cycle, Problem, Skip

from ..background_jobs import BackgroundJobs
from ..checkpoints.checkpoint_file import FilesChanged
from ..tables.skipped_work import skip_summary
from . import grids
from .interior_fields import InteriorMeshes, Stopped
from .structures import BoltLines, WaterLine, outlines_grid
from .triangulate import Triangles
from .vtkhdf import HdfStore
from .vtu import Grid, nothing, world_origin
from .vtu_store import VtuStore

#: Values of `output.format`.
FORMATS: dict[str, type[VtuStore] | type[HdfStore]] = {"vtu": VtuStore, "vtkhdf": HdfStore}

#: Growth passes share the time of their load step; each is written this fraction of a step later than the one before.
PASS_OFFSET = 1e-6

#: Interior fields are more expensive than all other output; without crack growth they are less frequent by this factor.
QUIET = 10


#: State of a `Series` in addition to the list of what it has written.
_REMEMBERED = (
    "_triangles", "_lines", "_meshes", "_keys", "_bolts", "_time", "_pending", "_first", "_last_interior",
    "_segments_then", "seconds", "_cycles", "_cracked", "_interior_seconds", "_series_seconds", "_left",
)  # fmt: skip

#: Grids with more bytes of fields than these take longer to pack (some 20 ms per MB) than to pass to another thread.
LARGE = 1 << 19


class Series:
    """Observer that writes ``blocks``, ``outlines``, ``cracks``, ``tips``, ``contacts`` and ``interior``, and if the
    scene has them ``bolts`` and ``water``. All extend from the first cycle to the last.

    ``every`` is the number of cycles between written ones; cycles in which a tip grew or an event happened, the first
    and the last are always written. ``interior_every`` is the number of cycles between interior fields while cracks
    grow; otherwise they are less frequent by a factor `QUIET`, because they mostly scale with the load. They are also
    written with the first load, with every event, before and after blocks are cut and at the end; 0 leaves them out. Where
    cycles are `sparing`, they take long: they are less frequent by `QUIET` once more, and not written with events.
    ``format`` is "vtu" (one file per cycle, PVD lists) or "vtkhdf" (one file per series). Raises ValueError for an
    unknown ``configuration`` or ``format``.
    """

    def __init__(
        self, *, every: int = 1, interior_every: int = 5, configuration: str = "reference", format: str = "vtu"
    ) -> None:
        if configuration not in grids.CONFIGURATIONS:
            raise ValueError(f"configuration must be one of {grids.CONFIGURATIONS}, got {configuration!r}")
        if format not in FORMATS:
            raise ValueError(f"format must be one of {tuple(FORMATS)}, got {format!r}")
        if every < 1 or interior_every < 0:
            raise ValueError("every must be at least 1, and interior_every at least 0")
        self.every, self.interior_every, self.configuration = every, interior_every, configuration
        self.format, self.seconds = format, 0.0
        #: The last grid of each series, for pictures at the end.
        self.last: dict[str, Grid] = {}

    def on_start(self, problem: Problem, folder: Path) -> None:
        self._triangles, self._lines, self._meshes = Triangles(), grids.CrackLines(), InteriorMeshes()
        self._keys = grids.KeyBlocks(problem)
        self._bolts = BoltLines(problem.loads.bolts)
        self._time = SeriesTime()
        self._pending: tuple[Cycle, float, bool] | None = None
        self._first: tuple[Cycle, float] | None = None
        self._last_interior, self._segments_then = -1, 0
        #: Cycles, with their times, whose interior an interrupted run has left to the one that resumes it.
        self._left: list[tuple[Cycle, float]] = []
        self._cycles = self._cracked = 0
        self._interior_seconds = self._series_seconds = 0.0
        self._open(problem, Path(folder), {})

    def on_interrupt(self) -> None:
        """Leave interior fields that take long to the run that is resumed."""
        if self._pending is not None and self._pending[0].sparing:
            self._meshes.stop()

    def memory(self) -> dict[str, Any]:
        self._background.wait()
        return {"listed": self._store.listed(), **{name: getattr(self, name) for name in _REMEMBERED}}

    def on_resume(self, problem: Problem, folder: Path, memory: dict[str, Any]) -> None:
        """Continue with the files that were listed at the checkpoint; later ones are deleted. Raises FilesChanged if
        one is missing."""
        listed = memory["listed"]
        vars(self).update({name: memory[name] for name in _REMEMBERED})
        missing = FORMATS[self.format].missing(Path(folder), listed)
        if missing:
            raise FilesChanged(f"{len(missing)} files of its series are missing in {folder}, the first is {missing[0]}")
        self._open(problem, Path(folder), listed, resumed=True)
        left, self._left = self._left, []
        for cycle, at in left:
            self._background.do(self._interior, cycle, at)

    def _open(
        self, problem: Problem, folder: Path, listed: dict[str, list[tuple[float, str]]], resumed: bool = False
    ) -> None:
        self._materials, self._world = problem.materials, world_origin(problem)
        self._water = WaterLine(problem) if problem.loads.water is not None else None
        self._bolt_names = _names([bolt.name for bolt in problem.loads.bolts])
        inside = bool(self.interior_every or listed.get("interior"))
        names = ["blocks", "outlines", "cracks", "tips", "contacts"] + ["interior"] * inside
        names += ["bolts"] * bool(problem.loads.bolts) + ["water"] * (self._water is not None)
        self._names = names
        self._store = FORMATS[self.format](folder, names, listed, resumed=resumed)
        self._background, self._large = BackgroundJobs(), set[str]()

    def on_cycle(self, cycle: Cycle) -> None:
        began = time.perf_counter()
        self._cycles += 1
        self._cracked += cycle.has_fields
        if (
            self._pending is not None
            and cycle.blocks.n_blocks != self._pending[0].blocks.n_blocks
            and not cycle.sparing
        ):
            self._write_last_interior()  # of the rock while it was whole
        # Every cycle gets a time, written or not, so that times do not depend on which cycles are left out.
        at = self._time.of(cycle)
        if self._pending is None and cycle.number == 0:
            self._first = (cycle, at)
        happened = bool(cycle.events) or bool((cycle.latest_tips["grown"] > 0).any())
        wanted = cycle.number == 0 or cycle.number % self.every == 0 or happened
        if wanted:
            self._write(cycle, at)
        if self._interior_wanted(cycle):
            self._write_interior(cycle, at)
        self._pending = (cycle, at, wanted)
        self.seconds += time.perf_counter() - began

    def on_end(self, summary: dict[str, Any], error: BaseException | None = None) -> None:
        began = time.perf_counter()
        if self._pending is not None:
            cycle, at, written = self._pending
            if not written:
                self._write(cycle, at)
            if cycle.sparing and isinstance(error, KeyboardInterrupt):
                self.on_interrupt()  # also of a run that is aborted within a cycle
            else:
                self._write_last_interior()
        try:
            self._background.close()
        finally:
            self._store.close()
        self.seconds += time.perf_counter() - began
        summary.setdefault("seconds", {})["writing series"] = round(self.seconds, 4)
        summary.setdefault("skipped", {}).update(
            {name: skip_summary(name, skip) for name, skip in self._skips().items() if skip.kept > 0}
        )

    def _skips(self) -> dict[str, Skip]:
        """What was not written, relative to what was.

        The first interior fields, for which Gmsh is loaded, are not timed, and those before the first load cost
        nothing.
        """
        inside, all_of = max(0, self._store.count("interior") - 1), self._store.count("blocks")
        return {
            "interior fields": Skip(self._cracked - inside, inside - 1, self._interior_seconds),
            "series": Skip(self._cycles - all_of, all_of, self._series_seconds),
        }

    def _interior_wanted(self, cycle: Cycle) -> bool:
        if not self.interior_every or cycle.number == 0 or not (cycle.has_fields or self._last_interior >= 0):
            return False
        cut = self._pending is not None and cycle.blocks.n_blocks != self._pending[0].blocks.n_blocks
        if self._last_interior < 0:
            return True
        if not cycle.sparing and (cut or any(event.kind not in CHANGES for event in cycle.events)):
            return True
        grew = cycle.cracks.n_segments != self._segments_then
        rarer = (1 if grew else QUIET) * (QUIET if cycle.sparing else 1)
        return cycle.number - self._last_interior >= self.interior_every * rarer

    def _write(self, cycle: Cycle, at: float) -> None:
        began, motion, shape = time.perf_counter(), cycle.motion, self.configuration
        self._save("blocks", cycle, at, grids.blocks_grid(cycle, self._materials, shape, self._triangles, self._keys))
        self._save("outlines", cycle, at, outlines_grid(cycle, shape))
        self._save("cracks", cycle, at, grids.cracks_grid(cycle, motion, shape, self._lines))
        self._save("tips", cycle, at, grids.tips_grid(cycle, motion, shape))
        self._save("contacts", cycle, at, grids.contacts_grid(cycle, shape))
        if "bolts" in self._names:
            self._save("bolts", cycle, at, self._bolts.grid(cycle, motion, shape))
        if self._water is not None:
            self._save("water", cycle, at, self._water.grid(float(cycle.state.time)))
        self._series_seconds += time.perf_counter() - began

    def _write_last_interior(self) -> None:
        """The interior of the last cycle, unless it is written or there is none."""
        assert self._pending is not None  # written after the first cycle
        cycle, at, _ = self._pending
        begun = cycle.has_fields or self._last_interior >= 0
        if self.interior_every and begun and cycle.number != self._last_interior:
            self._write_interior(cycle, at)

    def _write_interior(self, cycle: Cycle, at: float) -> None:
        for body in cycle.bodies.values():  # solved now, not beside the next pass
            body.prepare_fields()
        if self._first is not None and self._last_interior < 0 and self._first[0] is not cycle:
            # From the start on, so that all series of the run span the same time.
            self._meshes.note_cracked(cycle)
            self._background.do(self._interior, *self._first)
        self._first = None
        self._background.do(self._interior, cycle, at)
        self._last_interior, self._segments_then = cycle.number, cycle.cracks.n_segments

    def _interior(self, cycle: Cycle, at: float) -> None:
        began = time.perf_counter()
        try:
            grid = self._meshes.grid(cycle, self._materials, cycle.motion, self.configuration)
        except Stopped:
            self._left.append((cycle, at))
            return
        timed = self._store.count("interior") > 1
        self._put("interior", cycle, at, grid)
        self._interior_seconds += (time.perf_counter() - began) if timed else 0.0

    def _save(self, name: str, cycle: Cycle, at: float, grid: Grid) -> None:
        """Small grids are written at once, large ones in the background, so that the run need not wait for packing.

        A series that has been large stays in the background, so that its files are listed in order.
        """
        if name in self._large or _size(grid) > LARGE:
            self._large.add(name)
            self._background.do(self._put, name, cycle, at, grid)
        else:
            self._put(name, cycle, at, grid)

    def _put(self, name: str, cycle: Cycle, at: float, grid: Grid) -> None:
        numbers: dict[str, float | int | bytes] = {
            "CYCLE": cycle.number,
            "TIME": float(cycle.state.time),
            "LOAD": float(cycle.load),
            "REFERENCE": int(self.configuration == "reference"),  # 1: coordinates are reference coordinates
            **self._world,
        }
        if name in ("cracks", "tips"):
            numbers["CRACK_NAMES"] = _names(cycle.cracks.names)
        elif name == "outlines":
            numbers["EDGE_NAMES"] = _names(cycle.blocks.edge_names)
        elif name == "bolts":
            numbers["BOLT_NAMES"] = self._bolt_names
        if not len(grid.types):
            vertices = cycle.blocks.vertices if self.configuration == "reference" else cycle.state.vertices
            grid = nothing(name, vertices[0])
        self._store.put(name, cycle.number, at, grid, numbers)
        self.last[name] = grid


def _names(names: Iterable[str]) -> bytes:
    """Names as field data: UTF-8, one per line, in the order of their numbers."""
    return "\n".join(names).encode()


def _size(grid: Grid) -> int:
    """Number of bytes of its fields."""
    return sum(array.nbytes for fields in (grid.point_data, grid.cell_data) for array in fields.values())


class SeriesTime:
    """Strictly increasing times for a PVD: the cycle's time, plus `PASS_OFFSET` load steps for each growth pass."""

    def __init__(self) -> None:
        self._last = -float("inf")
        self._physical = -float("inf")
        self._step = 1.0

    def of(self, cycle: Cycle) -> float:
        """The time to list ``cycle`` under; to be called once per cycle, in order."""
        now = float(cycle.state.time)
        advance = now - self._physical
        if 0 < advance < float("inf"):
            self._step = advance
        self._physical = now
        at = now + cycle.growth_pass * PASS_OFFSET * self._step
        if not at > self._last:
            at = max(self._last + PASS_OFFSET * self._step, math.nextafter(self._last, math.inf))
        self._last = at
        return at
