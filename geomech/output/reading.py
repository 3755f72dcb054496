"""Reading of a run folder: summary, histories, events and the grids of any cycle."""

from __future__ import annotations

import csv
import json
import tomllib
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .fields import HISTORY, SERIES, TIPS
from .vtk import vtkhdf
from .vtk.vtkhdf import HdfStep
from .vtk.vtu import EMPTY, read_collection

if TYPE_CHECKING:
    import pyvista

#: Columns that hold text; all others hold numbers, nan where a cell is empty.
_TEXT = ("kind", "detail", "crack_name", "joint", "support")


class Run:
    """A run in ``folder``, read lazily. A run that is still going, or that failed, is read as far as it has come.
    Raises FileNotFoundError if there is no run in ``folder``."""

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)
        self._files: dict[str, dict[int, Path | HdfStep]] = {}
        if not self.folder.is_dir():
            raise FileNotFoundError(f"there is no folder {self.folder}")
        if not (self.folder / "history.csv").is_file():
            raise FileNotFoundError(f"{self.folder} holds no run: history.csv is missing")

    @cached_property
    def summary(self) -> dict[str, Any]:
        """``summary.json``; empty during the run."""
        path = self.folder / "summary.json"
        return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}

    @cached_property
    def scene(self) -> dict[str, Any]:
        """``scene.toml``, the resolved scene; empty if it was not written."""
        path = self.folder / "scene.toml"
        return tomllib.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}

    @cached_property
    def history(self) -> np.ndarray:
        """Structured array, one row per cycle; columns of `fields.HISTORY`, statistics and monitors."""
        return read_table(self.folder / "history.csv", HISTORY)

    @cached_property
    def tips(self) -> np.ndarray:
        """Structured array, one row per tip and cycle; columns of `fields.TIPS`."""
        return read_table(self.folder / "tips.csv", TIPS)

    @cached_property
    def events(self) -> np.ndarray:
        """Structured array, one row per event; columns of `fields.EVENTS`."""
        return read_table(self.folder / "events.csv", ())

    @cached_property
    def led(self) -> bool:
        """Whether a leading edge is loaded at some time: without one the load is 0 throughout."""
        load = self.history["load"]
        return bool(np.any(np.isfinite(load) & (load != 0)))

    @property
    def title(self) -> str:
        return self.summary.get("title") or self.scene.get("title") or self.folder.name

    def series(self, name: str) -> list[tuple[float, Path | HdfStep]]:
        """(time, file) of every written cycle of the series ``name``, or (time, step in its VTKHDF file); empty if it
        was not written. `read_grid` reads either."""
        if name not in SERIES:
            raise KeyError(f"no series {name!r}; there are {', '.join(SERIES)}")
        path, steps = self.folder / f"{name}.pvd", self.folder / (name + vtkhdf.SUFFIX)
        if path.is_file():
            return list(read_collection(path))
        return list(vtkhdf.read_steps(steps)) if steps.is_file() else []

    def grids(self, name: str) -> dict[int, Path | HdfStep]:
        """{cycle number: file (or step)} of the series ``name``, in order."""
        if name not in self._files:
            self._files[name] = {
                file.cycle if isinstance(file, HdfStep) else int(file.stem.rpartition("_")[2]): file
                for _, file in self.series(name)
            }
        return self._files[name]

    def grid(self, name: str, cycle: int) -> pyvista.UnstructuredGrid:
        """The series ``name`` at ``cycle``, or at the last cycle written before it. Raises KeyError if there is
        none."""
        files = self.grids(name)
        before = [number for number in files if number <= cycle]
        if not before:
            raise KeyError(f"{self.folder}: no {name} up to cycle {cycle}")
        return read_grid(files[max(before)])

    def at(self, cycle: int) -> np.void:
        """The row of `history` for ``cycle``."""
        return self.history[np.searchsorted(self.history["cycle"], cycle)]


def read_grid(where: Path | HdfStep) -> pyvista.UnstructuredGrid:
    """A grid of a series as PyVista object; one that was written as empty (`geomech.output.vtk.vtu.nothing`) has no
    points and no cells."""
    import pyvista

    grid = vtkhdf.read_step(where) if isinstance(where, HdfStep) else pyvista.read(where)
    if grid.n_cells == 1 and int(grid.celltypes[0]) == EMPTY:
        return grid.extract_cells(np.empty(0, int))
    return grid


def read_table(path: Path, numeric: Any) -> np.ndarray:
    """A CSV file with a header as a structured array: float columns (nan for empty cells), text for those of names.

    A last line that was cut off by a crash is left out. Missing files have no rows of ``numeric`` columns.
    """
    if not path.is_file():
        return np.empty(0, [(name, float) for name in numeric])
    with open(path, newline="", encoding="utf-8") as file:
        text = file.read()
    complete = text[: text.rfind("\n") + 1]
    header, *rows = list(csv.reader(complete.splitlines()))
    rows = [row for row in rows if len(row) == len(header)]
    columns = {}
    for name, values in zip(header, zip(*rows) if rows else [()] * len(header)):
        columns[name] = np.array(values, dtype=str) if name in _TEXT else np.array([float(v or "nan") for v in values])
    table = np.empty(len(rows), [(name, column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        table[name] = column
    return table
