"""Compact text form of arrays in a page: quantised to drawing accuracy, deflated, base 64.

A block of arrays is one byte string. Each array is stored byte by byte (all first bytes, then all second ones), since
neighbouring numbers mostly differ in their low bytes only; the block is then deflated (zlib). Displacements are 16-bit
fractions of their range, accurate to 1.5e-5 of it. Stresses, whose largest values at crack tips are thousands of times
the usual ones, are 16-bit floating-point numbers with a relative accuracy of 5e-4.
"""

from __future__ import annotations

import base64
import math
import zlib
from typing import Any

import numpy as np

#: Largest integer of a fraction; the next one represents nan.
_STEPS = 65534
#: Largest value stored as a 16-bit floating-point number (their limit is 65504).
_LARGEST_HALF = 6e4


class Block:
    """Arrays that are deflated together. ``arrays`` (name → [kind, offset, count, factor, shift]) tells a reader how to
    decode them: value = factor × number + shift; offsets in bytes, counts in numbers."""

    def __init__(self) -> None:
        self.arrays: dict[str, list[Any]] = {}
        self._parts: list[bytes] = []
        self._size = 0

    def fraction(self, name: str, values: np.ndarray) -> None:
        """``values``, finite or nan, as 16-bit fractions of their range."""
        flat = np.asarray(values, float).ravel()
        known = np.isfinite(flat)
        low, high = (float(flat[known].min()), float(flat[known].max())) if known.any() else (0.0, 0.0)
        step = (high - low) / _STEPS or 1.0
        coded = np.full(len(flat), _STEPS + 1, np.uint16)
        coded[known] = np.rint((flat[known] - low) / step)
        self._add(name, "q", coded, step, low)

    def half(self, name: str, values: np.ndarray) -> None:
        """``values`` as 16-bit floating-point numbers."""
        flat = np.asarray(values, float).ravel()
        known = np.abs(flat[np.isfinite(flat)])
        largest = float(known.max()) if len(known) else 0.0
        unit = largest / _LARGEST_HALF if largest > 0 and math.isfinite(_LARGEST_HALF / largest) else 1.0
        self._add(name, "h", (flat / unit).astype(np.float16), unit)

    def single(self, name: str, values: np.ndarray) -> None:
        """``values`` as 32-bit floating-point numbers."""
        self._add(name, "f", np.asarray(values, np.float32).ravel())

    def whole(self, name: str, values: np.ndarray) -> None:
        """Integers from 0 upwards, with as many bytes as the largest one needs."""
        flat = np.asarray(values).ravel().astype(np.int64)
        if len(flat) and flat.min() < 0:
            raise ValueError(f"{name}: {flat.min()} is below 0")
        most = int(flat.max()) if len(flat) else 0
        kind = "B" if most < 1 << 8 else "H" if most < 1 << 16 else "I"
        self._add(name, kind, flat.astype({"B": np.uint8, "H": np.uint16, "I": np.uint32}[kind]))

    def _add(self, name: str, kind: str, numbers: np.ndarray, factor: float = 1.0, shift: float = 0.0) -> None:
        if name in self.arrays:
            raise ValueError(f"{name} exists already")
        width = numbers.dtype.itemsize
        rows = numbers.astype(numbers.dtype.newbyteorder("<")).view(np.uint8).reshape(-1, width)
        self.arrays[name] = [kind, self._size, len(numbers), factor, shift]
        self._parts.append(np.ascontiguousarray(rows.T).tobytes())
        self._size += numbers.nbytes

    def text(self) -> str:
        """The deflated bytes in base 64."""
        return base64.b64encode(zlib.compress(b"".join(self._parts), 9)).decode("ascii")

    def record(self) -> dict[str, Any]:
        """The block as its reader in the page takes it."""
        return {"arrays": self.arrays, "data": self.text()}
