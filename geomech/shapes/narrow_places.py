"""Places where lines of a drawing nearly touch, and the size of triangles that fit between them."""

from __future__ import annotations

import numpy as np

#: Lines are halved no more often than this to find where they are near others.
_MOST_HALVINGS = 40


def narrow_places(ends: np.ndarray, across: float, largest: float, most: int) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2) points on the lines with the ends ``ends`` (m, 2, 2), m, and (n,) sizes, m: ``across`` times the distance
    from the nearest line that shares no end with theirs, where that is below ``largest``.

    Points on a line are no farther apart than twice their sizes. Where that would take more than ``most`` points, sizes
    are bounded from below, by the smallest of a row of powers of two with which it does not.
    """
    lines, others = _near_pairs(ends, largest / across)
    least = 0.0
    for _ in range(_MOST_HALVINGS):
        points, sizes = _along(ends, lines, others, across, largest, least, most)
        if len(points) <= most:
            return points, sizes
        least = largest / 256 if least == 0.0 else 2.0 * least
    return np.empty((0, 2)), np.empty(0)


def _near_pairs(ends: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """(k,) lines and (k,) others that share no end with them, whose boxes are within ``reach``, m."""
    low, high = ends.min(axis=1) - reach, ends.max(axis=1)
    near = ((low[:, None] <= high) & (low <= high[:, None])).all(axis=2)
    for p in range(2):
        for q in range(2):
            near &= ~(ends[:, None, p] == ends[None, :, q]).all(axis=2)
    lines, others = np.nonzero(near)
    return lines, others


def _along(ends, lines, others, across: float, largest: float, least: float, most: int):
    """`narrow_places` with sizes no smaller than ``least``; given up as more than ``most`` are found."""
    piece, other, number = ends[lines], ends[others], lines
    places, sizes = [np.empty((0, 2))], [np.empty(0)]
    found = 0
    for _ in range(_MOST_HALVINGS):
        if not len(piece):
            break
        # All others of a piece stand in a row, with the piece repeated.
        starts = np.flatnonzero(np.r_[True, (piece[1:] != piece[:-1]).any(axis=(1, 2)) | (number[1:] != number[:-1])])
        size = across * np.minimum.reduceat(_distances(piece, other), starts)
        first, rows = piece[starts], np.diff(np.r_[starts, len(piece)])
        length = np.hypot(*(first[:, 1] - first[:, 0]).T)
        wanted = np.maximum(size, least)
        here = (size < largest) & (length <= 2.0 * wanted)
        places.append(first[here].mean(axis=1))
        sizes.append(wanted[here])
        found += int(here.sum())
        halved = np.repeat((size < largest) & ~here, rows)
        if found + int(((size < largest) & ~here).sum()) > most:
            return np.empty((most + 1, 2)), np.empty(most + 1)
        piece, other, number = piece[halved], other[halved], number[halved]
        midpoint = piece.mean(axis=1)
        halves = [np.stack([piece[:, 0], midpoint], axis=1), np.stack([midpoint, piece[:, 1]], axis=1)]
        order = np.argsort(np.r_[2 * number, 2 * number + 1], kind="stable")
        piece = np.concatenate(halves)[order]
        other, number = np.concatenate([other, other])[order], np.r_[2 * number, 2 * number + 1][order]
    return np.concatenate(places), np.concatenate(sizes)


def _distances(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(k,) m, distances of the lines ``one`` from ``other``, (k, 2, 2) each, which do not cross."""
    ways = [(one[:, 0], other), (one[:, 1], other), (other[:, 0], one), (other[:, 1], one)]
    return np.min([_from_line(point, line) for point, line in ways], axis=0)


def _from_line(point: np.ndarray, line: np.ndarray) -> np.ndarray:
    along, to = line[:, 1] - line[:, 0], point - line[:, 0]
    share = np.clip((to * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-300), 0.0, 1.0)
    return np.hypot(*(to - share[:, None] * along).T)
