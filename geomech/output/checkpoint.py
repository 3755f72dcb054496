"""Checkpoints: all that a run goes on from, in one file; how it is written, and read back.

A checkpoint holds whatever the run's solvers and writers keep, not only blocks, cracks and loads: factors that were
renewed in part, face states that the next solution is tried with, meshes. They decide about round-off, so that a run
goes on bit for bit only with them, and keeping them lets a run be stored at any moment without changing a bit of what
it does afterwards. What they are is the solvers' own business; hence a pickle (of arrays, as good as binary), in which
every object stands once and arrays that share memory go on sharing it. It is of use to the sources that wrote it alone:
its first line, plain JSON, says which, and is read before anything else. As any pickle it can run code: resume only
what you trust.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import io
import json
import os
import pickle
import platform
import struct
import zlib
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

#: Counts the ways in which this file has been written.
FORMAT = 1
#: Below the run folder.
FOLDER = "checkpoint"
#: So many checkpoints are kept: the last, and one more should that be damaged.
KEPT = 2

#: Behind the pickle: its CRC-32 and its length.
_TRAILER = struct.Struct("<IQ")
#: Sources that decide what a run does and what a checkpoint holds.
_DECISIVE = ("conventions.py", "model", "dda", "ddm", "coupling", "output")


class NotResumable(RuntimeError):
    """A run cannot be gone on with: the message says why, and what to do instead."""


class FilesChanged(ValueError):
    """A file of a run is not what it was at the checkpoint."""


@cache
def identity() -> Mapping[str, Any]:
    """What must be the same for a checkpoint to be of use, and for the run to go on bit for bit. Sources are those of
    the time when it was asked for first: they may be edited while a run lasts."""
    packages = {name: importlib.metadata.version(name) for name in ("numpy", "scipy", "numba")}
    return {"format": FORMAT, "python": platform.python_version(), **packages, "sources": _sources()}


def surroundings() -> dict[str, Any]:
    """What rounding may depend on besides."""
    threads = {name: os.environ.get(name, "") for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
    return {"machine": f"{platform.machine()}, {_processor()}", **threads}


def write(folder: Path, header: dict[str, Any], content: Any) -> Path:
    """``content`` as the checkpoint of cycle ``header["cycle"]`` in ``folder``, whole or not at all; older ones than
    the one before are removed. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"cycle_{header['cycle']:07d}.checkpoint"
    beside = path.with_name(path.name + ".part")
    try:
        with open(beside, "wb") as file:
            file.write(json.dumps(header).encode() + b"\n")
            summed = _Summed(file)
            _Pickler(summed, protocol=5).dump(content)
            file.write(_TRAILER.pack(summed.crc, summed.length))
            file.flush()
            os.fsync(file.fileno())
        os.replace(beside, path)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise
    for old in found(folder)[KEPT:]:
        old.unlink(missing_ok=True)
    return path


def found(folder: Path) -> list[Path]:
    """The checkpoints in ``folder``, the last one first."""
    return sorted(folder.glob("cycle_[0-9]*.checkpoint"), reverse=True)


def read_header(path: Path) -> dict[str, Any]:
    """The first line of the checkpoint ``path``. Raises NotResumable where it is none, or not whole."""
    with open(path, "rb") as file:
        return _read_header(path, file)


def read(path: Path) -> Any:
    """The content of the checkpoint ``path``, which these sources wrote. Raises NotResumable where it is not whole."""
    with open(path, "rb") as file:
        _read_header(path, file)
        return pickle.load(file)


def whole(folder: Path) -> Iterator[tuple[dict[str, Any], Path]]:
    """(header, path) of the checkpoints in ``folder`` that are whole, the last one first."""
    for path in found(folder):
        try:
            yield read_header(path), path
        except (NotResumable, OSError):
            continue


def _read_header(path: Path, file: BinaryIO) -> dict[str, Any]:
    """The first line; ``file`` then stands at the pickle, whose sum is right."""
    damaged = NotResumable(f"{path} is no whole checkpoint: remove it, and the one before it is taken")
    line = file.readline(1 << 24)
    try:
        header = json.loads(line)
    except ValueError:
        raise damaged from None
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
    return header


class _Summed(io.RawIOBase):
    """A file that knows the sum and the length of what was written to it."""

    def __init__(self, file: BinaryIO) -> None:
        self._file, self.crc, self.length = file, 0, 0

    def write(self, data: Any) -> int:
        self.crc = zlib.crc32(data, self.crc)
        self.length += memoryview(data).nbytes
        return self._file.write(data)


class _Pickler(pickle.Pickler):
    """Stores views of arrays as views: they go on sharing memory, and are laid out as they were. Strides decide which
    of BLAS' ways a product is taken by, and so about its last bits."""

    def reducer_override(self, value: Any) -> Any:
        if type(value) is np.ndarray and type(value.base) is np.ndarray and not value.dtype.hasobject:
            base = value.base
            (low, high), (first, last) = np.lib.array_utils.byte_bounds(value), np.lib.array_utils.byte_bounds(base)
            if first <= low and high <= last and (base.flags.c_contiguous or base.flags.f_contiguous):
                start = value.__array_interface__["data"][0] - first
                return _view, (base, value.dtype, value.shape, value.strides, start, value.flags.writeable)
        return NotImplemented


def _view(base: np.ndarray, dtype, shape, strides, start: int, writeable: bool) -> np.ndarray:
    memory = base.reshape(-1, order="A").view(np.uint8) if base.size else np.empty(0, np.uint8)
    view = np.ndarray(shape, dtype, memory, start, strides)
    view.flags.writeable = writeable and view.flags.writeable
    return view


def _sources() -> str:
    """A digest of the sources that decide what a run does."""
    house = Path(__file__).parent.parent
    digest = hashlib.sha256()
    for name in _DECISIVE:
        place = house / name
        for path in [place] if place.is_file() else sorted(place.rglob("*.py")):
            digest.update(str(path.relative_to(house)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def _processor() -> str:
    """The processor's own name, where the system tells."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            return next(line.partition(":")[2].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor()
