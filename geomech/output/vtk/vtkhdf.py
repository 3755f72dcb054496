"""Series of a run in one file each, ``blocks.vtkhdf`` and so on: VTK's HDF5 format with time steps.

Every file is a temporal unstructured grid (VTK file formats, "VTKHDF", version 2.2). Arrays that have not changed since
the last step, points and cells included, are not stored again: a step refers to their location. (One file of all series
would be a composite data set, of which readers do not get the later steps: VTK 9.7 reads back only the first step of
what its own writer has written.) Needs h5py (``pip install 'geomech[hdf]'``) and ParaView 5.13 or newer.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..fields import SERIES, declared
from .vtu import Grid, field_array

if TYPE_CHECKING:
    import h5py
    import pyvista

#: Suffix of a series' file in the run folder.
SUFFIX = ".vtkhdf"
#: Steps are buffered until this many bytes, or seconds since the last write.
_BATCH, _WAIT = 1 << 23, 10.0
#: Rows per chunk: small enough for a few points, large enough that compression pays off.
_CHUNK = 1 << 12
_VERSION = (2, 2)
_MESH = ("Points", "Connectivity", "Offsets", "Types")
_COUNTS = ("NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds")


def library() -> Any:
    """The h5py module; raises ValueError with instructions if it is not installed."""
    try:
        import h5py
    except ModuleNotFoundError:
        raise ValueError(
            "output.format = \"vtkhdf\" needs h5py, which is not installed: pip install 'geomech[hdf]'"
        ) from None
    return h5py


@dataclass
class _Steps:
    """Steps of one series: their times, s, and the start of each in its datasets."""

    times: list[float] = field(default_factory=list)
    cycles: list[int] = field(default_factory=list)
    offsets: dict[str, list[int]] = field(default_factory=dict)
    sizes: dict[str, int] = field(default_factory=dict)

    def add(self, key: str, offset: int) -> None:
        self.offsets.setdefault(key, []).append(offset)


class HdfStore:
    """Writes the grids of ``names`` into one file each in ``folder``, after what is ``listed`` (empty: from the start).

    A file that was cut off during a write may be lost, unlike .vtu files. Raises ValueError without h5py.
    """

    def __init__(self, folder: Path, names: Sequence[str], listed: Mapping[str, Any], *, resumed: bool = False) -> None:
        self._h5py = library()
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        for name in SERIES:
            (folder / f"{name}.pvd").unlink(missing_ok=True)
            if not resumed or name not in listed:
                (folder / (name + SUFFIX)).unlink(missing_ok=True)
            for path in (folder / "vtk").glob(f"{name}_[0-9]*.vtu"):
                path.unlink()
        self._steps = {name: _Steps(**listed[name]) if name in listed else _Steps() for name in names}
        self._last: dict[str, dict[str, np.ndarray]] = {name: {} for name in names}
        self._kept: dict[str, dict[str, list[np.ndarray]]] = {name: {} for name in names}
        self._bytes, self._lock = 0, threading.Lock()
        for name in listed:  # written after the checkpoint
            with self._open(name, "r+") as file:
                for key, size in self._steps[name].sizes.items():
                    file[f"VTKHDF/{key}"].resize(size, axis=0)
        self._flushed = time.monotonic()

    @staticmethod
    def missing(folder: Path, listed: Mapping[str, Any]) -> list[str]:
        """Files that are listed but do not exist."""
        return [name + SUFFIX for name in listed if not (folder / (name + SUFFIX)).is_file()]

    def _open(self, name: str, mode: str) -> h5py.File:
        return self._h5py.File(self._folder / (name + SUFFIX), mode, locking=False)

    def listed(self) -> dict[str, Any]:
        """What has been written, by series, as plain data; all of it is then in the file."""
        self._flush()
        return {
            name: {
                "times": list(s.times),
                "cycles": list(s.cycles),
                "offsets": {key: list(offsets) for key, offsets in s.offsets.items()},
                "sizes": dict(s.sizes),
            }
            for name, s in self._steps.items()
            if s.times
        }

    def count(self, name: str) -> int:
        """Number of written cycles of the series ``name``; 0 if it is not written."""
        return len(self._steps[name].times) if name in self._steps else 0

    def put(self, name: str, cycle: int, at: float, grid: Grid, numbers: Mapping[str, float | int | bytes]) -> None:
        """Write ``grid`` as the series ``name`` at ``cycle`` and the time ``at`` (s), with ``numbers`` as field
        data."""
        with self._lock:
            steps = self._steps[name]
            self._add_mesh(name, grid)
            for place, count, arrays in (
                ("point", len(grid.points), grid.point_data),
                ("cell", len(grid.types), grid.cell_data),
            ):
                declared_arrays = declared(name, place, count, arrays)
                for f in SERIES[name]:
                    if f.place == place:
                        array = np.zeros((count, *f.shape), f.dtype)
                        value = np.asarray(declared_arrays[f.name])
                        array[(..., slice(value.shape[1])) if array.ndim == 2 else ...] = value
                        self._add(name, f"{place.capitalize()}Data/{f.name}", array)
            for key, number in numbers.items():
                self._add(name, f"FieldData/{key}", field_array(number))
                steps.add(f"FieldSizes/{key}", len(field_array(number)))
            steps.times.append(float(at))
            steps.cycles.append(int(cycle))
        if self._bytes > _BATCH or time.monotonic() - self._flushed > _WAIT:
            self._flush()

    def _add_mesh(self, name: str, grid: Grid) -> None:
        """Points and cells, and the part that they form; stored again only if any of them has changed."""
        points = np.zeros((len(grid.points), 3))
        points[:, : grid.points.shape[1]] = grid.points
        mesh: dict[str, np.ndarray] = {
            "Points": points,
            "Connectivity": np.asarray(grid.connectivity, np.int64),
            "Offsets": np.concatenate([[0], grid.offsets]).astype(np.int64),
            "Types": np.asarray(grid.types, np.uint8),
        }
        steps, last = self._steps[name], self._last[name]
        if all(key in last and np.array_equal(last[key], array) for key, array in mesh.items()):
            for key in (*_MESH, "Part"):
                steps.add(key, steps.offsets[key][-1])
            return
        for key, array in mesh.items():
            self._add(name, key, array, always=True)
        steps.add("Part", steps.sizes.get("NumberOfPoints", 0))
        for key, count in zip(_COUNTS, (len(points), len(grid.types), len(mesh["Connectivity"])), strict=True):
            self._append(name, key, np.array([count], np.int64))

    def _add(self, name: str, key: str, array: np.ndarray, *, always: bool = False) -> None:
        steps, last = self._steps[name], self._last[name]
        before = last.get(key)
        if not always and before is not None and np.array_equal(before, array, equal_nan=array.dtype.kind == "f"):
            steps.add(key, steps.offsets[key][-1])
            return
        steps.add(key, self._append(name, key, array))
        last[key] = array

    def _append(self, name: str, key: str, array: np.ndarray) -> int:
        """Append ``array`` to a dataset; returns its start there."""
        sizes = self._steps[name].sizes
        begin = sizes.get(key, 0)
        sizes[key] = begin + len(array)
        self._kept[name].setdefault(key, []).append(array)
        self._bytes += array.nbytes
        return begin

    def _flush(self) -> None:
        """Write the buffered steps, and update the lists of steps."""
        with self._lock:
            for name, kept in self._kept.items():
                if not kept and not self._steps[name].times:
                    continue
                with self._open(name, "a") as file:
                    if "VTKHDF" not in file:
                        root = file.create_group("VTKHDF")
                        root.attrs["Version"] = _VERSION
                        root.attrs.create("Type", b"UnstructuredGrid", dtype="S16")
                    for key, arrays in kept.items():
                        _extend(file["VTKHDF"], key, np.concatenate(arrays))
                    _list_steps(file["VTKHDF"], self._steps[name])
            self._kept = {name: {} for name in self._kept}
            self._bytes, self._flushed = 0, time.monotonic()

    def close(self) -> None:
        """Write what is left."""
        self._flush()


def _extend(root: h5py.Group, place: str, array: np.ndarray) -> None:
    if place not in root:
        chunks = (min(_CHUNK, max(16, len(array))), *array.shape[1:])
        root.create_dataset(
            place, data=array, maxshape=(None, *array.shape[1:]), chunks=chunks, compression=1, shuffle=True
        )
        return
    data = root[place]
    begin = len(data)
    data.resize(begin + len(array), axis=0)
    data[begin:] = array


def _list_steps(group: h5py.Group, steps: _Steps) -> None:
    """The group ``Steps`` of a series: where each of its ``steps`` begins in the datasets."""
    if "Steps" in group:
        del group["Steps"]
    listed = group.create_group("Steps")
    n = len(steps.times)
    listed.attrs["NSteps"] = n
    listed["Values"] = np.array(steps.times)
    listed["NumberOfParts"] = np.ones(n, np.int64)
    listed["PartOffsets"] = np.array(steps.offsets["Part"], np.int64)
    for key, own in (("PointOffsets", "Points"), ("CellOffsets", "Types"), ("ConnectivityIdOffsets", "Connectivity")):
        listed[key] = np.array(steps.offsets[own], np.int64)
    for key, offsets in steps.offsets.items():
        section, _, name = key.partition("/")
        if section in ("PointData", "CellData", "FieldData"):
            listed[f"{section}Offsets/{name}"] = np.array(offsets, np.int64)
        elif section == "FieldSizes":
            listed[f"FieldDataSizes/{name}"] = np.stack([np.ones(n, np.int64), offsets], axis=1)


@dataclass(frozen=True)
class HdfStep:
    """One step of a series in its VTKHDF file, for `read_step`."""

    path: Path
    step: int
    cycle: int


def read_steps(path: Path) -> list[tuple[float, HdfStep]]:
    """(time, step) of every cycle in the file ``path``."""
    with library().File(path, "r", locking=False) as file:
        group = file["VTKHDF"]
        times = group["Steps/Values"][:]
        cycles = group["FieldData/CYCLE"][:][group["Steps/FieldDataOffsets/CYCLE"][:]]
    return [(float(times[k]), HdfStep(path, k, int(cycles[k]))) for k in range(len(times))]


def read_step(where: HdfStep) -> pyvista.UnstructuredGrid:
    """The grid of one step."""
    import pyvista

    with library().File(where.path, "r", locking=False) as file:
        group = file["VTKHDF"]
        steps, k = group["Steps"], where.step
        part = int(steps["PartOffsets"][k])
        n_points, n_cells, n_ids = (int(group[key][part]) for key in _COUNTS)
        at = int(steps["PointOffsets"][k])
        points = group["Points"][at : at + n_points]
        at = int(steps["CellOffsets"][k])
        types = group["Types"][at : at + n_cells]
        # Every part before this one has one offset more than it has cells.
        offsets = group["Offsets"][at + part : at + part + n_cells + 1]
        at = int(steps["ConnectivityIdOffsets"][k])
        connectivity = group["Connectivity"][at : at + n_ids]
        sizes = np.diff(offsets)
        cells = np.insert(connectivity, offsets[:-1], sizes)
        grid = pyvista.UnstructuredGrid(cells, types, points)
        for section, data, count in (
            ("PointData", grid.point_data, n_points),
            ("CellData", grid.cell_data, n_cells),
        ):
            for key, values in group.get(section, {}).items():
                at = int(steps[f"{section}Offsets/{key}"][k])
                data[key] = values[at : at + count]
        for key, values in group["FieldData"].items():
            at, size = int(steps[f"FieldDataOffsets/{key}"][k]), int(steps[f"FieldDataSizes/{key}"][k, 1])
            grid.field_data[key] = values[at : at + size]
    return grid
