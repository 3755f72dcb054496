"""Checkpoint files: format, writing and reading.

A checkpoint holds all that the solvers and writers of a run keep, not only blocks, cracks and loads: factors that were
partly updated, the face states with which the next solution starts, meshes. They affect round-off; only with them does
a resumed run continue bit for bit, and storing a run at any moment changes nothing in its results. Solver objects are
stored by the names of their classes and attributes, as plain data (`geomech.plain_data`), so that reading a file from
anyone runs no code. A checkpoint can be used only by the sources that wrote it: its first lines, the format and a JSON
header with a checksum of its own, identify them and are read before anything else.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import io
import json
import os
import platform
import re
import struct
import zlib
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO, cast

from geomech import plain_data

#: Version of the file format; the first was a pickle after a line of JSON.
FORMAT = 5
#: Relative to the run folder.
FOLDER = "checkpoint"
#: Number of checkpoints kept: the last, and one more in case it is damaged.
KEPT = 2

#: First line: file type, CRC-32 and length of the header in the second line.
_FIRST = "geomech checkpoint {format} {crc:08x} {length}\n"
_FIRST_READ = re.compile(rb"geomech checkpoint (\d{1,9}) ([0-9a-f]{8}) (\d{1,12})\n")
#: After the content: its CRC-32 and length.
_TRAILER = struct.Struct("<IQ")
#: Classes that a checkpoint may hold in addition to arrays, numbers, texts and Python's own containers.
_ALLOWED = plain_data.Allowed(
    parts=("geomech.model", "geomech.dda", "geomech.ddm", "geomech.coupling"),
    classes=(
        "geomech.output.tables.deepest_penetration:Deepest", "geomech.output.vtk.grids:CrackLines", "geomech.output.vtk.grids:KeyBlocks",
        "geomech.output.tables.histories:TableEnd", "geomech.output.vtk.interior_fields:InteriorMeshes", "geomech.output.vtk.interior_fields:_Kept",
        "geomech.output.vtk.series:SeriesTime", "geomech.output.vtk.structures:BoltLines", "geomech.output.vtk.triangulate:Triangles",
        "geomech.shapes.meshing:InteriorMesh",
    ),
    methods=("geomech.model.problem:Problem.joint_index",),
)  # fmt: skip
#: Sources that determine what a run does and what a checkpoint holds.
_DECISIVE = ("conventions.py", "model", "dda", "ddm", "coupling", "output")
#: Bytes handed to the disk at a time: enough for its full speed, little beside a run's memory.
_PIECE = 1 << 26
#: Bytes, upper limit of the header's length.
_LONGEST_HEADER = 1 << 24


class NotResumable(RuntimeError):
    """A run cannot be resumed; the message gives the reason and a way out."""


class FilesChanged(ValueError):
    """A file of a run differs from its state at the checkpoint."""


@cache
def identity() -> Mapping[str, Any]:
    """What must be unchanged for a checkpoint to be used, and for the run to continue bit for bit.

    The sources are those at the time of the first call: they may be edited during a run.
    """
    packages = {name: importlib.metadata.version(name) for name in ("numpy", "scipy", "numba")}
    return {"format": FORMAT, "python": platform.python_version(), **packages, "sources": _sources()}


def surroundings() -> dict[str, Any]:
    """Further properties of the machine on which round-off may depend."""
    threads = {name: os.environ.get(name, "") for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
    return {"machine": f"{platform.machine()}, {_processor()}", **threads}


def write(folder: Path, header: dict[str, Any], content: Any) -> Path:
    """Write ``content`` as the checkpoint of cycle ``header["cycle"]`` in ``folder``, atomically.

    Checkpoints older than the previous one are removed. Raises OSError.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"cycle_{header['cycle']:07d}.checkpoint"
    unfinished = path.with_name(path.name + ".part")
    try:
        with open(unfinished, "wb") as file:
            head = json.dumps(header).encode()
            file.write(_FIRST.format(format=FORMAT, crc=zlib.crc32(head), length=len(head)).encode() + head + b"\n")
            summed = _Summed(file)
            plain_data.write(cast(BinaryIO, summed), content, _ALLOWED)
            file.write(_TRAILER.pack(summed.crc, summed.length))
            file.flush()
            os.fsync(file.fileno())
        os.replace(unfinished, path)
    except BaseException:
        unfinished.unlink(missing_ok=True)
        raise
    for old in found(folder)[KEPT:]:
        old.unlink(missing_ok=True)
    return path


def found(folder: Path) -> list[Path]:
    """The checkpoints in ``folder``, the last one first."""
    return sorted(folder.glob("cycle_[0-9]*.checkpoint"), reverse=True)


def read_header(path: Path) -> dict[str, Any]:
    """The header of the checkpoint ``path``. Raises NotResumable if it is not a complete checkpoint."""
    with open(path, "rb") as file:
        return _read_header(path, file)


def read(path: Path) -> Any:
    """The content of the checkpoint ``path``, written by these sources. Raises NotResumable if it is incomplete."""
    with open(path, "rb") as file:
        header = _read_header(path, file)
        if header["format"] != FORMAT:
            raise NotResumable(
                f"{path} is a checkpoint of format {header['format']}, but this version of geomech reads format {FORMAT}"
            )
        try:
            return plain_data.read(file, _ALLOWED)
        except plain_data.Broken as error:
            raise NotResumable(
                f"{path} does not have the content of a checkpoint ({error}): run the scene again"
            ) from error


def whole(folder: Path) -> Iterator[tuple[dict[str, Any], Path]]:
    """(header, path) of the complete checkpoints in ``folder``, the last one first."""
    for path in found(folder):
        try:
            yield read_header(path), path
        except (NotResumable, OSError):
            continue


def _read_header(path: Path, file: BinaryIO) -> dict[str, Any]:
    """The header; ``file`` is then positioned at the content, whose checksum has been verified.

    Of another format, the header holds only the format.
    """
    damaged = NotResumable(f"{path} is not a complete checkpoint: remove it, and the one before it is used")
    first = file.readline(256)
    if first.startswith(b"{"):
        return {"format": 1}
    found = _FIRST_READ.fullmatch(first)
    if found is None:
        raise damaged
    head = file.read(min(int(found[3]), _LONGEST_HEADER))
    if zlib.crc32(head) != int(found[2], 16) or file.read(1) != b"\n":
        raise damaged
    if int(found[1]) != FORMAT:
        return {"format": int(found[1])}
    start = file.tell()
    length = file.seek(0, os.SEEK_END) - start - _TRAILER.size
    if length < 0:
        raise damaged
    file.seek(start)
    crc, left = 0, length
    while left:
        piece = file.read(min(left, 1 << 22))
        crc, left = zlib.crc32(piece, crc), left - len(piece)
    if _TRAILER.unpack(file.read(_TRAILER.size)) != (crc, length):
        raise damaged
    file.seek(start)
    try:
        return json.loads(head) | {"format": FORMAT}
    except (ValueError, TypeError):
        raise damaged from None


class _Summed(io.RawIOBase):
    """A file that computes the checksum and the length of what is written to it.

    What has been written is handed to the disk piece by piece and dropped from the system's memory: a checkpoint of
    gigabytes would otherwise fill as much of it as the run itself uses.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file, self.crc, self.length, self._in_memory = file, 0, 0, 0

    def write(self, data: Any) -> int:
        whole = memoryview(data)  # (of bytes)
        for first in range(0, len(whole), _PIECE):
            piece = whole[first : first + _PIECE]
            self.crc = zlib.crc32(piece, self.crc)
            self._file.write(piece)
            self._in_memory += len(piece)
            if self._in_memory >= _PIECE:
                self._drop()
        self.length += len(whole)
        return len(whole)

    def _drop(self) -> None:
        self._in_memory = 0
        if hasattr(os, "posix_fadvise"):  # not on every system
            self._file.flush()
            os.fdatasync(self._file.fileno())
            os.posix_fadvise(self._file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def _sources() -> str:
    """Digest of the sources that determine what a run does."""
    house = Path(__file__).parents[2]
    digest = hashlib.sha256()
    for name in _DECISIVE:
        place = house / name
        for path in [place] if place.is_file() else sorted(place.rglob("*.py")):
            digest.update(str(path.relative_to(house)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def _processor() -> str:
    """The processor's name, if the system gives it."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            return next(line.partition(":")[2].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor()
