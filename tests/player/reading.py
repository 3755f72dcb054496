"""Blocks of arrays read back, as the page's script does."""

from __future__ import annotations

import base64
import json
import re
import zlib

import numpy as np

WIDTH = {"q": "<u2", "h": "<f2", "f": "<f4", "B": "u1", "H": "<u2", "I": "<u4"}


def arrays(record: dict) -> dict[str, np.ndarray]:
    """name → values of a packed block."""
    data = zlib.decompress(base64.b64decode(record["data"], validate=True))
    found = {}
    for name, (kind, offset, count, factor, shift) in record["arrays"].items():
        dtype = np.dtype(WIDTH[kind])
        rows = np.frombuffer(data, np.uint8, count * dtype.itemsize, offset).reshape(dtype.itemsize, count)
        numbers = np.ascontiguousarray(rows.T).view(dtype).ravel()
        if kind == "q":
            found[name] = np.where(numbers == 65535, np.nan, numbers * factor + shift)
        else:
            found[name] = numbers.astype(float) * factor if kind == "h" else numbers
    return found


def records_in(page: str) -> list[dict]:
    """The records that a page holds."""
    return json.loads(re.search(r'<script type="application/json" id="geomech-runs">(.*?)</script>', page, re.S)[1])
