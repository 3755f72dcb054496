"""Ground surface of a section and a water table above it: ponds and their depth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

#: Width of a vertical step of the ground, over the section's width: a table must be a function of x.
_STEP = 1e-9


class Pond(NamedTuple):
    """Ponded water from x = ``start`` to ``end``, m, at most ``depth`` m deep."""

    start: float
    end: float
    depth: float


def lowest_over(ground: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The lowest ground at every x as a line (x ascending, y), m.

    ``ground`` (n, 2) m runs from left to right and may have overhangs and vertical faces; at a step the lower side
    counts."""
    x = np.unique(ground[:, 0])
    step = _STEP * (x[-1] - x[0])
    x = x[np.append(True, np.diff(x) > step)]
    a, b = ground[:-1], ground[1:]
    level = np.abs(b[:, 0] - a[:, 0]) > step
    a, b = a[level], b[level]
    low, high = np.minimum(a[:, 0], b[:, 0]), np.maximum(a[:, 0], b[:, 0])
    over = (low <= x[:-1, None] + step) & (high >= x[1:, None] - step)

    def height(at: np.ndarray) -> np.ndarray:
        return a[:, 1] + (at[:, None] - a[:, 0]) / (b[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1])

    lowest = np.argmin(np.where(over, height(0.5 * (x[:-1] + x[1:])), np.inf), axis=1)
    row = np.arange(len(lowest))
    left, right = height(x[:-1])[row, lowest], height(x[1:])[row, lowest]
    xs, ys = [x[0]], [left[0]]
    for k in range(1, len(x)):
        before, after = right[k - 1], left[k] if k < len(left) else right[k - 1]
        at = x[k]
        if before > after:
            xs.append(at - step)
            ys.append(before)
        xs.append(at)
        ys.append(min(before, after))
        if after > before:
            xs.append(at + step)
            ys.append(after)
    return np.array(xs), np.array(ys)


def _together(
    line: tuple[np.ndarray, np.ndarray], ground: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(x, y of the ``line``, y of the ``ground``), m, at all their points and crossings."""
    x = np.unique(np.concatenate([line[0], ground[0]]))
    above = np.interp(x, *line) - np.interp(x, *ground)
    cross = np.flatnonzero(above[:-1] * above[1:] < 0)
    share = above[cross] / (above[cross] - above[cross + 1])
    x = np.sort(np.concatenate([x, x[cross] + share * (x[cross + 1] - x[cross])]))
    return x, np.interp(x, *line), np.interp(x, *ground)


def below_ground(
    line: tuple[np.ndarray, np.ndarray], ground: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """The minimum of ``line`` and ``ground``, both (x ascending, y), as such a line."""
    x, own, cap = _together(line, ground)
    y = np.minimum(own, cap)
    # Points where neither bends, nor the minimum changes sides, are not needed.
    needed = np.ones(len(x), bool)
    if len(x) > 2:
        first, second = np.diff(x)[:-1], np.diff(x)[1:]
        off = (y[1:-1] - y[:-2]) * second - (y[2:] - y[1:-1]) * first
        needed[1:-1] = np.abs(off) > 1e-12 * np.ptp(y) * (first + second)
    return x[needed], y[needed]


def ponds(line: tuple[np.ndarray, np.ndarray], ground: tuple[np.ndarray, np.ndarray]) -> list[Pond]:
    """Ponds: where ``line`` lies above ``ground``, both (x ascending, y), by more than round-off."""
    x, own, cap = _together(line, ground)
    inside = (x >= ground[0][0]) & (x <= ground[0][-1])
    x, deep = x[inside], (own - cap)[inside]
    near = 1e-6 * (ground[0][-1] - ground[0][0])
    wet = np.maximum(deep[:-1], deep[1:]) > 0
    found = []
    for k in np.flatnonzero(wet & ~np.append(False, wet[:-1])):
        last = k + int(np.argmin(np.append(wet[k:], False)))
        depth = float(deep[k : last + 1].max())
        if depth > near:
            found.append(Pond(float(x[k]), float(x[last]), depth))
    return found
