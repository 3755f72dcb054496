"""VTK's XML files, written directly: unstructured grids (appended raw data, large ones zlib level 1), PVD collections.

The format is VTK's own (VTK XML file formats, "Serial vtkUnstructuredGrid" with appended data). Writing it from NumPy
takes a tenth of the time of ``vtkXMLUnstructuredGridWriter`` on the small files that a run leaves by the thousand, and a
run that writes files need not import VTK.
"""

from __future__ import annotations

import math
import os
import struct
import sys
import time
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from .fields import conform

#: Cell types of the VTK file format.
VERTEX, LINE, TRIANGLE = 1, 3, 5

_TYPE = {"f8": "Float64", "f4": "Float32", "i8": "Int64", "i4": "Int32", "u1": "UInt8"}
_TAIL = b"\n</AppendedData>\n</VTKFile>\n"
#: Grids of up to this many bytes are left as they are: packing them takes longer than all the rest of their writing.
SMALL = 1 << 16
# Arrays are compressed in pieces of this many bytes, so that a reader never needs more than that at a time.
_BLOCK = 1 << 20
_size = struct.Struct("=Q").pack


@dataclass(frozen=True, eq=False)
class Grid:
    """Points and cells with their arrays.

    ``points`` (n, 2) or (n, 3) m; ``connectivity`` point indices, cell after cell; ``offsets`` (n_cells,) one past each
    cell's last index; ``types`` (n_cells,) VTK cell types; ``point_data`` and ``cell_data`` name → array.
    """

    points: np.ndarray
    connectivity: np.ndarray
    offsets: np.ndarray
    types: np.ndarray
    point_data: Mapping[str, np.ndarray] = field(default_factory=dict)
    cell_data: Mapping[str, np.ndarray] = field(default_factory=dict)


def write_grid(path: Path, series: str, grid: Grid, numbers: Mapping[str, float | int]) -> None:
    """Write ``grid`` as the .vtu file ``path`` of ``series``, with ``numbers`` as field data.

    Raises ValueError when an array is not as `geomech.output.fields` declares it."""
    n_points, n_cells = len(grid.points), len(grid.types)
    # Numbers not as text: VTK's parser stops at "nan", which is the load of a scene that has no leading one.
    columns = [
        ("FieldData", name, np.array([value], dtype="=i8" if isinstance(value, (int, np.integer)) else "=f8"), ())
        for name, value in numbers.items()
    ]
    for section, place, count, arrays in (
        ("PointData", "point", n_points, grid.point_data),
        ("CellData", "cell", n_cells, grid.cell_data),
    ):
        for name, (declared, data) in conform(series, place, count, arrays).items():
            columns.append((section, name, data, declared.components))
    columns += [
        ("Points", "Points", with_z(grid.points), ()),
        ("Cells", "connectivity", np.ascontiguousarray(grid.connectivity, dtype="=i8"), ()),
        ("Cells", "offsets", np.ascontiguousarray(grid.offsets, dtype="=i8"), ()),
        ("Cells", "types", np.ascontiguousarray(grid.types, dtype="u1"), ()),
    ]
    compress = sum(data.nbytes for _, _, data, _ in columns) > SMALL
    # The last array comes first: meshio gives arrays new offsets one by one as it reads, in the order of the data, and
    # would take one of those for the offset of a later array, did it not meet that one first.
    columns.reverse()
    packed = [(_compressed if compress else _plain)(data) for _, _, data, _ in columns]
    layout = tuple((section, name, data.dtype.str[1:], data.shape[1:], names) for section, name, data, names in columns)
    _put(path, b"".join([_xml(n_points, n_cells, compress, layout, tuple(map(len, packed))), *packed, _TAIL]))


# From cycle to cycle the text of a small grid mostly stays the same.
@lru_cache(maxsize=16)
def _xml(n_points: int, n_cells: int, compressed: bool, layout: tuple, sizes: tuple[int, ...]) -> bytes:
    """The file up to its data: ``layout`` (section, name, dtype, trailing shape, component names) of every array and
    ``sizes``, the bytes each takes in the file, both in the order of the data, which is the tags' backwards."""
    tags: dict[str, list[str]] = {name: [] for name in ("FieldData", "PointData", "CellData", "Points", "Cells")}
    at = 0
    for (section, name, dtype, shape, components), size in zip(layout, sizes, strict=True):
        tuples = 'NumberOfTuples="1" ' if section == "FieldData" else ""
        attributes = f'type="{_TYPE[dtype]}" Name={quoteattr(name)} format="appended"'
        attributes += f' NumberOfComponents="{shape[0]}"' if shape else ""
        attributes += "".join(f' ComponentName{k}="{c}"' for k, c in enumerate(components))
        tags[section].append(f'<DataArray {tuples}{attributes} offset="{at}"/>\n')
        at += size
    text = {name: f"<{name}>\n{''.join(reversed(lines))}</{name}>\n" for name, lines in tags.items()}
    order = "LittleEndian" if sys.byteorder == "little" else "BigEndian"
    packing = ' compressor="vtkZLibDataCompressor"' if compressed else ""
    return (
        '<?xml version="1.0"?>\n'
        f'<VTKFile type="UnstructuredGrid" version="1.0" byte_order="{order}" header_type="UInt64"{packing}>\n'
        f"<UnstructuredGrid>\n{text.pop('FieldData')}"
        f'<Piece NumberOfPoints="{n_points}" NumberOfCells="{n_cells}">\n{"".join(text.values())}</Piece>\n'
        '</UnstructuredGrid>\n<AppendedData encoding="raw">\n_'
    ).encode()


def with_z(vectors: np.ndarray) -> np.ndarray:
    """(n, 2) vectors with a zero third component, as VTK wants them; (n, 3) ones are only made contiguous."""
    vectors = np.asarray(vectors, dtype="=f8")
    if vectors.shape[1] == 3:
        return np.ascontiguousarray(vectors)
    out = np.zeros((len(vectors), 3))
    out[:, :2] = vectors
    return out


def _put(path: Path, content: bytes) -> None:
    """A file of ``content``: three system calls, half of what a buffered file object makes."""
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
    try:
        view = memoryview(content)
        while view:
            view = view[os.write(handle, view) :]
    finally:
        os.close(handle)


def _plain(data: np.ndarray) -> bytes:
    """One array as it is, after its size in bytes."""
    return _size(data.nbytes) + data.tobytes()


def _compressed(data: np.ndarray) -> bytes:
    """One compressed array: (number of blocks, block size, size of a partial last block, compressed sizes), data."""
    raw = data.tobytes()
    pieces = [zlib.compress(raw[k : k + _BLOCK], 1) for k in range(0, len(raw), _BLOCK)]
    size = min(len(raw), _BLOCK)
    # "Partial" is zero when the last block is full; a single block is always full.
    partial = len(raw) % size if size else 0
    header = struct.pack(f"={3 + len(pieces)}Q", len(pieces), size, partial, *map(len, pieces))
    return b"".join([header, *pieces])


class Collection:
    """A PVD file: a time series of .vtu files.

    Times are written with ``repr`` so that they read back as the same numbers. The file is only ever replaced as a
    whole (written beside itself, then renamed), so whoever reads it, also after a crash, finds a complete series. It is
    renewed at most every ``interval`` s, since a run of quick steps would spend more time on that than on its files;
    `close` brings it up to date.
    """

    def __init__(self, path: Path, interval: float = 1.0) -> None:
        self.path, self.interval = Path(path), interval
        self._entries: list[str] = []
        self._last = -math.inf
        self._save()

    def add(self, at: float, file: str) -> None:
        """List ``file`` (relative to the PVD's folder) at time ``at``, which must be later than all before it."""
        if not at > self._last:
            raise ValueError(f"{self.path.name}: time {at!r} does not follow {self._last!r}")
        self._last = at
        self._entries.append(f'<DataSet timestep="{float(at)!r}" part="0" file={quoteattr(file)}/>\n')
        if time.monotonic() - self._saved >= self.interval:
            self._save()

    def close(self) -> None:
        """Bring the file up to date."""
        self._save()

    def _save(self) -> None:
        beside = self.path.with_name(self.path.name + ".part")
        head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1"><Collection>\n'
        _put(beside, "".join([head, *self._entries, "</Collection></VTKFile>\n"]).encode())
        os.replace(beside, self.path)
        self._saved = time.monotonic()


def read_collection(path: Path) -> list[tuple[float, Path]]:
    """(time, file) of every entry of the PVD file ``path``, in its order. Raises FileNotFoundError without it."""
    from xml.etree import ElementTree

    path = Path(path)
    entries = ElementTree.parse(path).getroot().iter("DataSet")
    return [(float(e.attrib["timestep"]), path.parent / e.attrib["file"]) for e in entries]
