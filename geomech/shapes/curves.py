"""Chords that approximate curves, and line ends that were drawn on the curves themselves.

A chord deviates from its curve by up to the chord tolerance, a hundred times the drawing tolerance. A line that ends on
the drawn curve would stop in the rock before the chord, or extend beyond it: its end is moved onto the chord.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True, eq=False)
class Chords:
    """Straight pieces from ``start`` to ``end`` (n, 2), m, and the largest distance ``away`` (n,) of the curve from
    each, m."""

    start: np.ndarray
    end: np.ndarray
    away: np.ndarray

    @classmethod
    def none(cls) -> Chords:
        return cls(np.empty((0, 2)), np.empty((0, 2)), np.empty(0))

    @classmethod
    def of(cls, lines: Sequence[np.ndarray], away: Sequence[np.ndarray | float]) -> Chords:
        """Chords of polylines (n, 2); ``away`` of each is one number, or one per piece (n − 1,), 0 where it is
        straight."""
        parts = [
            cls(line[:-1], line[1:], np.broadcast_to(np.asarray(own, dtype=float), len(line) - 1))
            for line, own in zip(lines, away, strict=True)
            if len(line) > 1
        ]
        return cls.joined(parts)

    @classmethod
    def joined(cls, parts: Sequence[Chords]) -> Chords:
        """All of ``parts`` that are not straight."""
        if not parts:
            return cls.none()
        whole = cls(*(np.concatenate([getattr(part, key) for part in parts]) for key in ("start", "end", "away")))
        bent = (whole.away > 0) & (whole.start != whole.end).any(axis=1)
        return cls(whole.start[bent], whole.end[bent], whole.away[bent])

    def moved(self, origin: np.ndarray) -> Chords:
        """Relative to ``origin`` (2,), m."""
        return replace(self, start=self.start - origin, end=self.end - origin)

    def scaled(self, factor: float) -> Chords:
        return Chords(factor * self.start, factor * self.end, factor * self.away)


def ended_on(items: Sequence, chords: Chords) -> list:
    """``items`` (joints or cracks) with line ends within ``away`` of a chord moved onto the nearest one; a line's own
    chords do not count."""
    lines = [line for item in items for line in item.lines]
    feet = _feet(lines, chords)
    if not feet:
        return list(items)
    number = 0
    out = []
    for item in items:
        own = []
        for line in item.lines:
            line = np.array(line, dtype=float)
            for which in (0, -1):
                foot = feet.get((number, which))
                # With both ends at one place no line would be left.
                if foot is not None and (len(line) > 2 or (foot != line[-1 - which]).any()):
                    line[which] = foot
            own.append(line)
            number += 1
        out.append(replace(item, lines=tuple(own)))
    return out


def _feet(lines: Sequence[np.ndarray], chords: Chords) -> dict[tuple[int, int], np.ndarray]:
    """(line, 0 or −1) of every end within reach of chords, and the nearest point (2,) on them."""
    import shapely

    ends = [(k, which) for k, line in enumerate(lines) for which in (0, -1) if len(line) > 1]
    if not len(chords.away) or not ends:
        return {}
    points = np.array([lines[k][which] for k, which in ends], dtype=float)
    tree = shapely.STRtree(shapely.linestrings(np.stack([chords.start, chords.end], axis=1)))
    end, chord = tree.query(shapely.points(points), predicate="dwithin", distance=float(chords.away.max()))
    start, along = chords.start[chord], chords.end[chord] - chords.start[chord]
    arm = points[end] - start
    share = np.einsum("nx,nx->n", arm, along) / np.einsum("nx,nx->n", along, along)
    foot = start + share.clip(0.0, 1.0)[:, None] * along
    away = np.hypot(*(foot - points[end]).T)
    feet: dict[tuple[int, int], np.ndarray] = {}
    for n in np.argsort(away):
        k, key = ends[end[n]][0], ends[end[n]]
        if away[n] > chords.away[chord[n]] or key in feet:
            continue
        if not (_has(lines[k], chords.start[chord[n]]) and _has(lines[k], chords.end[chord[n]])):
            feet[key] = foot[n]
    return feet


def _has(line: np.ndarray, point: np.ndarray) -> bool:
    return bool((line == point).all(axis=1).any())
