"""VTK XML files written directly: unstructured grids (appended raw data, large ones zlib level 1), PVD collections.

The format is VTK's own (VTK XML file formats, "Serial vtkUnstructuredGrid" with appended data). Writing it from NumPy
takes a tenth of the time of ``vtkXMLUnstructuredGridWriter`` for the small files that a run writes by the thousand, and
a run need not import VTK.
"""

from __future__ import annotations

import errno
import math
import os
import struct
import sys
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..fields import ACTIVE, PREPARED, SERIES, Field, declared

#: Cell types of the VTK file format.
EMPTY, VERTEX, LINE, TRIANGLE = 0, 1, 3, 5

_TYPE = {"f8": "Float64", "f4": "Float32", "i8": "Int64", "i4": "Int32", "u1": "UInt8"}
_TAIL = b"\n</AppendedData>\n</VTKFile>\n"
#: Grids up to this many bytes are not compressed, which would take longer than all the rest of writing.
SMALL = 1 << 16
# Arrays are compressed in pieces of this many bytes, so that a reader never needs more at a time.
_BLOCK = 1 << 20
_size = struct.Struct("=Q").pack


@dataclass(frozen=True, eq=False)
class Grid:
    """Points and cells with their arrays.

    points         (n, 2) or (n, 3) m, as all vectors
    connectivity   point indices, cell after cell
    offsets        (n_cells,) one past each cell's last index
    types          (n_cells,) VTK cell types
    point_data, cell_data   name → array
    """

    points: np.ndarray
    connectivity: np.ndarray
    offsets: np.ndarray
    types: np.ndarray
    point_data: Mapping[str, np.ndarray] = field(default_factory=dict)
    cell_data: Mapping[str, np.ndarray] = field(default_factory=dict)


def nothing(series: str, at: np.ndarray) -> Grid:
    """A grid of the ``series`` that draws nothing: one cell of VTK's empty type and one point ``at`` (2,) m.

    ParaView drops the arrays of a grid without points, and with them all chosen colours and glyphs. Vectors and
    displacements are 0, other floats nan, integers −1.
    """

    def blank(f: Field) -> np.ndarray:
        fill = -1 if f.dtype.startswith("int") else 0.0 if f.components[:1] == ("X",) else np.nan
        return np.full((1, *f.shape), fill, f.dtype)

    data = {place: {f.name: blank(f) for f in SERIES[series] if f.place == place} for place in ("point", "cell")}
    points = np.asarray(at, dtype=float).reshape(1, 2)
    return Grid(points, np.empty(0, int), np.zeros(1, int), np.array([EMPTY]), data["point"], data["cell"])


def world_origin(problem: Any) -> dict[str, float]:
    """Field data that place a grid in the world: the offset to be added to x and y, m. Empty if it is zero."""
    x, y = problem.origin
    return {"WORLD_X": float(x), "WORLD_Y": float(y)} if x or y else {}


class GridFiles:
    """Writes the grids of one ``series`` as .vtu files.

    From cycle to cycle a small grid mostly keeps its numbers of points and cells: its file is laid out once, and the
    arrays are replaced.
    """

    def __init__(self, series: str) -> None:
        self.series = series
        self._layout: _Layout | None = None

    def write(self, path: Path | str, grid: Grid, numbers: Mapping[str, float | int | bytes]) -> None:
        """Write ``grid`` as the file ``path``, with ``numbers`` (and texts, as bytes of UTF-8) as field data.

        Raises ValueError if an array does not have the form declared in `geomech.output.fields`.
        """
        n_points, n_cells = len(grid.points), len(grid.types)
        data = declared(self.series, "point", n_points, grid.point_data)
        data |= declared(self.series, "cell", n_cells, grid.cell_data)
        # Numbers not as text: VTK's parser stops at "nan", which is the load of a scene without a leading one.
        data |= {name: field_array(value) for name, value in numbers.items()}
        data["Points"], data["connectivity"] = grid.points, grid.connectivity
        data["offsets"], data["types"] = grid.offsets, grid.types
        kinds = tuple([(name, data[name].dtype.str[1:], len(data[name])) for name in numbers])
        key = (n_points, n_cells, len(grid.connectivity), kinds)
        if self._layout is None or self._layout.key != key:
            self._layout = _Layout(self.series, *key)
        _put(path, self._layout.filled(data))


class _Column(NamedTuple):
    """One array of a file: the tag that holds it, its name, type and shape, and its components' names."""

    section: str
    name: str
    dtype: str
    shape: tuple[int, ...]
    components: tuple[str, ...] = ()

    @property
    def nbytes(self) -> int:
        return math.prod(self.shape) * int(self.dtype[1])


class _Layout:
    """File layout of a grid with so many points, cells and corners, and field data ``numbers`` (name, dtype,
    length)."""

    def __init__(self, series: str, n_points: int, n_cells: int, n_corners: int, numbers: tuple) -> None:
        self.key, self._series = (n_points, n_cells, n_corners, numbers), series
        columns = [_Column("FieldData", name, dtype, (count,)) for name, dtype, count in numbers]
        for section, place, count in (("PointData", "point", n_points), ("CellData", "cell", n_cells)):
            columns += [
                _Column(section, f.name, np.dtype(f.dtype).str[1:], (count, *f.shape), f.components)
                for f in (SERIES | PREPARED)[series]
                if f.place == place
            ]
        columns += [
            _Column("Points", "Points", "f8", (n_points, 3)),
            _Column("Cells", "connectivity", "i8", (n_corners,)),
            _Column("Cells", "offsets", "i8", (n_cells,)),
            _Column("Cells", "types", "u1", (n_cells,)),
        ]
        # The last array comes first: meshio gives arrays new offsets one by one as it reads, in the order of the data,
        # and would take one of those for the offset of a later array if it did not meet that one first.
        self._columns = columns[::-1]
        self._compress = sum(c.nbytes for c in columns) > SMALL
        self._kept: dict[str, tuple[bytes, bytes]] = {}
        if not self._compress:
            self._lay_out()

    def _lay_out(self) -> None:
        sizes = [8 + c.nbytes for c in self._columns]
        head = self._head(sizes)
        self._file = bytearray(head + bytes(sum(sizes)) + _TAIL)
        self._places = []
        at = len(head)
        for column, size in zip(self._columns, sizes, strict=True):
            self._file[at : at + 8] = _size(column.nbytes)
            place = np.frombuffer(self._file, column.dtype, math.prod(column.shape), at + 8).reshape(column.shape)
            self._places.append((column.name, place))
            at += size

    def filled(self, data: Mapping[str, Any]) -> bytes | bytearray:
        """The file with the arrays of ``data``, valid until it is filled again; vectors may lack their zero third
        component."""
        if self._compress:
            arrays = [np.zeros(c.shape, c.dtype) for c in self._columns]
            for column, array in zip(self._columns, arrays, strict=True):
                _fill(array, data[column.name])
            packed = [
                self._packed(column.name, array.tobytes()) for column, array in zip(self._columns, arrays, strict=True)
            ]
            return b"".join([self._head([len(p) for p in packed]), *packed, _TAIL])
        for name, place in self._places:
            _fill(place, data[name])
        return self._file

    def _packed(self, name: str, raw: bytes) -> bytes:
        """The array ``name`` compressed. Much of a grid stays from cycle to cycle (points, cells, numbers of blocks): to
        compare takes a hundredth of the time of compressing again."""
        kept = self._kept.get(name)
        if kept is None or kept[0] != raw:
            kept = self._kept[name] = (raw, _compressed(raw))
        return kept[1]

    def _head(self, sizes: list[int]) -> bytes:
        """The file up to its data; ``sizes``: bytes of each array in the file, in the order of the data, which is the
        reverse of the tags'."""
        tags: dict[str, list[str]] = {name: [] for name in ("FieldData", "PointData", "CellData", "Points", "Cells")}
        at = 0
        for column, size in zip(self._columns, sizes, strict=True):
            tuples = f'NumberOfTuples="{column.shape[0]}" ' if column.section == "FieldData" else ""
            attributes = f'type="{_TYPE[column.dtype]}" Name="{column.name}" format="appended"'
            attributes += f' NumberOfComponents="{column.shape[1]}"' if len(column.shape) > 1 else ""
            attributes += "".join(f' ComponentName{k}="{c}"' for k, c in enumerate(column.components))
            tags[column.section].append(f'<DataArray {tuples}{attributes} offset="{at}"/>\n')
            at += size
        active = {name: f" {assigned}" for name, assigned in ACTIVE.get(self._series, {}).items()}
        text = {
            name: f"<{name}{active.get(name, '')}>\n{''.join(reversed(lines))}</{name}>\n"
            for name, lines in tags.items()
        }
        order = "LittleEndian" if sys.byteorder == "little" else "BigEndian"
        packing = ' compressor="vtkZLibDataCompressor"' if self._compress else ""
        n_points, n_cells = self.key[:2]
        return (
            '<?xml version="1.0"?>\n'
            f'<VTKFile type="UnstructuredGrid" version="1.0" byte_order="{order}" header_type="UInt64"{packing}>\n'
            f"<UnstructuredGrid>\n{text.pop('FieldData')}"
            f'<Piece NumberOfPoints="{n_points}" NumberOfCells="{n_cells}">\n{"".join(text.values())}</Piece>\n'
            '</UnstructuredGrid>\n<AppendedData encoding="raw">\n_'
        ).encode()


def field_array(value: float | int | bytes) -> np.ndarray:
    """One value of field data as an array: an integer, a float, or the bytes of a text."""
    if isinstance(value, bytes):
        return np.frombuffer(value, np.uint8)
    return np.array([value], np.int64 if isinstance(value, (int, np.integer)) else np.float64)


def _fill(place: np.ndarray, value: Any) -> None:
    if place.ndim == 2 and value.shape[1] == 2:
        place = place[:, :2]
    place[...] = value


def _put(path: Path | str, content: bytes | bytearray) -> None:
    """Write ``content`` as a file; an existing file is overwritten in place.

    Few system calls, a fraction of what a buffered file object needs. Truncating a file first costs several times as
    much as overwriting it, and deleting and creating thousands of files tens of times (ext4 does not reuse an inode
    that was freed minutes ago, and skips all of these for every new one).
    """
    handle = os.open(path, os.O_WRONLY | os.O_CREAT, 0o666)
    try:
        written = os.write(handle, content)
        while written < len(content):
            written += os.write(handle, memoryview(content)[written:])
        if os.fstat(handle).st_size > written:
            os.ftruncate(handle, written)
    except OSError as error:
        error.filename = str(path)  # the error of a full disk does not name the file
        raise
    finally:
        os.close(handle)


def _compressed(raw: bytes) -> bytes:
    """One compressed array: (number of blocks, block size, size of a partial last block, compressed sizes), data."""
    pieces = [zlib.compress(raw[k : k + _BLOCK], 1) for k in range(0, len(raw), _BLOCK)]
    size = min(len(raw), _BLOCK)
    # "Partial" is zero when the last block is full; a single block is always full.
    partial = len(raw) % size if size else 0
    header = struct.pack(f"={3 + len(pieces)}Q", len(pieces), size, partial, *map(len, pieces))
    return b"".join([header, *pieces])


class Collection:
    """A PVD file: a time series of .vtu files.

    Times are written with ``repr`` so that they read back as the same numbers. An entry and the end of the file
    overwrite the old end in one write: after every cycle, also the last before a crash, a reader finds a complete
    series. The file is created with its first entry: ParaView does not open an empty one. ``entries`` (time, file)
    exist already: the file is rewritten with them.
    """

    def __init__(self, path: Path, entries: Iterable[tuple[float, str]] = ()) -> None:
        self.path = Path(path)
        self.entries = list(entries)
        self._handle: int | None = None
        if self.entries:
            self._begin()
        else:
            self.path.unlink(missing_ok=True)

    def _begin(self) -> int:
        """Write the whole file and open it; returns its handle."""
        unfinished = self.path.with_name(self.path.name + ".part")
        content = "".join([_PVD_HEAD, *(_entry(*each) for each in self.entries), _PVD_END]).encode()
        _put(unfinished, content)
        os.replace(unfinished, self.path)
        self._end = len(content) - len(_PVD_END)
        self._handle = os.open(self.path, os.O_WRONLY)
        return self._handle

    def add(self, at: float, file: str) -> None:
        """Add ``file`` (relative to the PVD's folder) at time ``at``, which must be later than all before it."""
        last = self.entries[-1][0] if self.entries else -math.inf
        if not at > last:
            raise ValueError(f"{self.path.name}: time {at!r} does not follow {last!r}")
        handle = self._begin() if self._handle is None else self._handle
        entry = _entry(at, file).encode()
        content = entry + _PVD_END.encode()
        written = os.pwrite(handle, content, self._end)
        if written < len(content):
            # The disk is full. Space for the previous content exists.
            os.pwrite(handle, _PVD_END.encode(), self._end)
            os.ftruncate(handle, self._end + len(_PVD_END))
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self.path))
        self._end += len(entry)
        self.entries.append((float(at), file))

    def close(self) -> None:
        """Close the file; nothing can be added any more."""
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None


_PVD_HEAD = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1"><Collection>\n'
_PVD_END = "</Collection></VTKFile>\n"


def _entry(at: float, file: str) -> str:
    return f'<DataSet timestep="{float(at)!r}" part="0" file="{escape(file)}"/>\n'


def read_collection(path: Path) -> list[tuple[float, Path]]:
    """(time, file) of every entry of the PVD file ``path``, in its order. Raises FileNotFoundError without it."""
    from xml.etree import ElementTree

    path = Path(path)
    entries = ElementTree.parse(path).getroot().iter("DataSet")
    return [(float(e.attrib["timestep"]), path.parent / e.attrib["file"]) for e in entries]
