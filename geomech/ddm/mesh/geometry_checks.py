"""Checks of outlines and cracks: outlines bound an area; cracks lie inside it and neither cross nor coincide."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...model import Cracks
from ...model.blocks.polygon import signed_area
from .geometry_prefilter import clearly_valid
from .point_location import inside, outlined

#: Coordinates must resolve a segment to this part of its length: the relative error of K is some fifty times as large
#: (its elements are shorter).
FEWEST_DIGITS = 1e-5
#: Lengths below this part of the extent are zero.
_SMALL = 1e-9
#: Smaller angles of rock between the faces at a kink of a crack, or at its mouth, are refused: grading no longer keeps
#: K accurate there.
SHARPEST_FOLD, SHARPEST_MOUTH = np.radians(10.0), np.radians(3.0)
#: How to give coinciding points one node.
JOIN = "make one node of points that coincide: Cracks.from_polylines(…, join=True)"
#: Beyond this number of pairs (new segments × all segments), bounding boxes are compared first.
_EACH_WITH_ALL = 1_000_000
#: Pairs of boxes compared at a time: memory stays the same for two or ten thousand segments.
_PAIRS_AT_ONCE = 4_000_000


def check_outline(loops: list[np.ndarray], holes: Sequence[np.ndarray] = ()) -> list[np.ndarray]:
    """Check ``loops`` (an outline and its holes, or none) and further ``holes``, which may run either way; float
    arrays.

    Raises ValueError naming the loop: shape, finiteness, repeated vertices, orientation (outline counter-clockwise,
    holes clockwise), crossing edges, holes outside the outline or inside each other.
    """
    out = [_checked(loop, "the outline" if k == 0 else f"hole {k}") for k, loop in enumerate(loops)]
    for k, loop in enumerate(out):
        if k == 0 and signed_area(loop) <= 0:
            raise ValueError("the outline: vertices must run counter-clockwise and enclose an area")
        if k and signed_area(loop) >= 0:
            raise ValueError(f"hole {k}: the vertices of a hole must run clockwise")
    bounded = len(out) > 0
    for k, hole in enumerate(holes, max(len(out), 1)):
        loop = _checked(hole, f"hole {k}")
        area = signed_area(loop)
        if area == 0:
            raise ValueError(f"hole {k}: encloses no area")
        out.append(loop[::-1].copy() if area > 0 else loop)
    if out:
        edges = np.concatenate([np.stack([loop, np.roll(loop, -1, axis=0)], axis=1) for loop in out])
        i, j = _boxes_meet(edges, edges)
        i, j = i[i < j], j[i < j]
        for k in np.flatnonzero(_crossing(edges[i], edges[j]))[:1]:
            i, j = i[k], j[k]
            loop = np.repeat(np.arange(len(out)), [len(loop) for loop in out]) + (0 if bounded else 1)
            one, other = ("the outline" if m == 0 else f"hole {m}" for m in loop[[i, j]])
            what = f"{one} crosses itself: edges {i} and {j}" if one == other else f"{one} and {other} cross"
            raise ValueError(f"{what} near {_near(edges[i])}")
    first_hole = 1 if bounded else 0
    for k, hole in enumerate(out[first_hole:], 1):
        if bounded and not inside(out[:1], hole).all():
            raise ValueError(f"hole {k}: not inside the outline")
        for m, around in enumerate(out[first_hole:], 1):
            if m != k and not inside([around], hole[:1]).all():
                raise ValueError(f"hole {k}: inside hole {m}")
    return out


def _checked(loop: np.ndarray, name: str) -> np.ndarray:
    loop = np.array(loop, dtype=float)
    if loop.ndim != 2 or loop.shape[1] != 2 or len(loop) < 3:
        raise ValueError(f"{name}: expected at least three vertices (n, 2), got shape {loop.shape}")
    if not np.isfinite(loop).all():
        raise ValueError(f"{name}: vertex {int(np.flatnonzero(~np.isfinite(loop).all(axis=1))[0])} is not finite")
    step = np.roll(loop, -1, axis=0) - loop
    short = np.hypot(*step.T) <= _SMALL * np.ptp(loop, axis=0).max()
    if short.any():
        at = int(np.flatnonzero(short)[0])
        raise ValueError(f"{name}: vertices {at} and {(at + 1) % len(loop)} coincide")
    return loop


def check_cracks(cracks: Cracks, edges: np.ndarray, loops: list[np.ndarray], fresh: np.ndarray | None = None) -> None:
    """Check the cracks of a network against each other and against the outline.

    Raises ValueError naming the crack: not finite, zero length, outside the rock, on the boundary without being a
    mouth, crossing the outline or lying along it, crossing, covering or touching another crack without a shared node,
    folding back on itself, or leaving the boundary at too sharp an angle. Only segments that are ``fresh``
    (n_segments,) are compared with the others.
    """
    n = cracks.n_segments
    if n == 0:
        return
    fresh = np.ones(n, bool) if fresh is None else fresh
    if np.count_nonzero(fresh) * (n + len(edges)) <= _EACH_WITH_ALL and clearly_valid(
        np.ascontiguousarray(cracks.nodes, dtype=float),
        np.ascontiguousarray(cracks.segments, dtype=np.int64),
        np.ascontiguousarray(cracks.surface, dtype=bool),
        np.ascontiguousarray(cracks.aperture, dtype=float),
        np.ascontiguousarray(fresh),
        np.ascontiguousarray(edges),
        sum(len(loop) for loop in loops),
        outlined(loops),
    ):
        return

    def name(s):
        k = int(cracks.crack[s])
        return f"{cracks.names[k]!r}" if k < len(cracks.names) else f"crack {k}"

    segments = cracks.nodes[cracks.segments]
    if not np.isfinite(segments).all():
        s = int(np.flatnonzero(~np.isfinite(segments).all(axis=(1, 2)))[0])
        raise ValueError(f"{name(s)}: a crack point is not finite")
    span = np.ptp(np.concatenate([edges.reshape(-1, 2), segments.reshape(-1, 2)]), axis=0).max()
    _check_sizes(cracks, segments, span, name)
    new = np.flatnonzero(fresh)
    if not len(new):
        return
    if len(edges):
        _check_ends(cracks, segments, new, edges, loops, span, name)
        i, j = _boxes_meet(segments[new], edges, _SMALL * span)
        if len(i):
            _check_crossing(cracks, segments, new[i], edges[j], span, name)
        _check_mouths(cracks, new, edges, span, name)
    elif cracks.surface[cracks.segments[new]].any():
        s = new[int(np.argmax(cracks.surface[cracks.segments[new]].any(axis=1)))]
        raise ValueError(f"{name(s)}: has a mouth, but in the infinite plane there is no boundary for it to be on")
    _check_pairs(cracks, segments, new, span, name)
    _check_folds(cracks, new, name)


def _check_sizes(cracks: Cracks, segments: np.ndarray, span: float, name) -> None:
    """Segment lengths must be resolved by the coordinates, apertures not negative."""
    if (cracks.lengths <= 1e-12 * span).any():
        raise ValueError(f"{name(int(np.argmin(cracks.lengths)))}: a crack segment has no length")
    if not (cracks.aperture >= 0).all():
        raise ValueError(f"{name(int(np.argmin(cracks.aperture)))}: an aperture must not be negative")
    digits = np.spacing(np.abs(segments).max(axis=(1, 2))) / cracks.lengths
    if (digits > FEWEST_DIGITS).any():
        s = int(np.argmax(digits))
        x, y = segments[s, 0]
        raise ValueError(
            f"{name(s)}: its segment of {cracks.lengths[s]:.3g} m at ({x:g}, {y:g}) is too short for coordinates this "
            f"large, which resolve {digits[s] * cracks.lengths[s]:.1g} m: measure them from an origin near the rock"
        )


def _check_ends(
    cracks: Cracks, segments: np.ndarray, new: np.ndarray, edges: np.ndarray, loops: list[np.ndarray], span: float, name
) -> None:
    """Ends of the ``new`` (k,) segments: mouths must be on the boundary, other ends in the rock."""
    mouth = cracks.surface[cracks.segments]
    ends = segments[new].reshape(-1, 2)
    distance = _to_segments(ends, edges).reshape(-1, 2)
    rock = inside(loops, ends).reshape(-1, 2)
    for k, s in enumerate(new):
        for e in (0, 1):
            x, y = segments[s, e]
            if mouth[s, e]:
                if distance[k, e] > 1e-7 * span:
                    raise ValueError(f"{name(s)}: its mouth ({x:g}, {y:g}) is {distance[k, e]:.3g} m off the boundary")
            elif distance[k, e] <= _SMALL * span:
                raise ValueError(f"{name(s)}: ({x:g}, {y:g}) lies on the boundary but is not marked as a mouth")
            elif not rock[k, e]:
                raise ValueError(f"{name(s)}: ({x:g}, {y:g}) lies outside the rock")


def _check_crossing(cracks: Cracks, segments: np.ndarray, at: np.ndarray, edges: np.ndarray, span: float, name) -> None:
    """Segments ``at`` (k,), each against one of ``edges`` (k, 2, 2): they may neither cross nor lie along it."""
    one, mouth = segments[at], cracks.surface[cracks.segments]
    for k in np.flatnonzero(_crossing(one, edges)):
        s = at[k]
        # A mouth touches its edge within round-off, which may look like a crossing.
        near = _to_segments(segments[s], edges[k : k + 1])
        if not (mouth[s] & (near <= 1e-7 * span)).any():
            raise ValueError(f"{name(s)}: crosses the outline near {_near(segments[s])}")
    for k in np.flatnonzero(_overlapping(one, edges, span))[:1]:
        raise ValueError(f"{name(at[k])}: lies along the boundary near {_near(one[k])}")


def _check_pairs(cracks: Cracks, segments: np.ndarray, new: np.ndarray, span: float, name) -> None:
    """New segments against all others: none may cross or cover another, nor end on one without a shared node."""
    i, j = _boxes_meet(segments[new], segments, _SMALL * span)
    i = new[i]
    i, j = i[i != j], j[i != j]
    if not len(i):
        return
    one, other = segments[i], segments[j]
    for k in np.flatnonzero(_crossing(one, other))[:1]:
        raise ValueError(
            f"{name(i[k])} and {name(j[k])} cross near {_near(one[k])} without a shared node: draw a point of both where "
            f"they cross, and {JOIN}"
        )
    for k in np.flatnonzero(_overlapping(one, other, span))[:1]:
        raise ValueError(f"{name(i[k])} and {name(j[k])} coincide near {_near(one[k])}")
    shared = (cracks.segments[i][:, :, None] == cracks.segments[j][:, None, :]).any(axis=(1, 2))
    i, j = i[~shared], j[~shared]
    for first, second in ((i, j), (j, i)) if len(i) else ():
        for end in (0, 1):
            touching = _to_pairs(segments[first, end], segments[second]) <= _SMALL * span
            for k in np.flatnonzero(touching)[:1]:
                raise ValueError(_touching(cracks, segments, first[k], end, second[k], span, name))


def _touching(cracks: Cracks, segments: np.ndarray, s: int, end: int, other: int, span: float, name) -> str:
    """Message for an end of segment ``s`` that lies on the segment ``other``."""
    x, y = at = segments[s, end]
    at_end = np.hypot(*(segments[other] - at).T) <= _SMALL * span
    if cracks.crack[s] == cracks.crack[other]:
        comes_back = "ends where it began" if at_end.any() else "comes back to itself"
        message = f"{name(s)}: {comes_back}, at ({x:g}, {y:g}), without a shared node"
    else:
        message = f"{name(s)} and {name(other)} touch at ({x:g}, {y:g}) without a shared node"
    return f"{message}: {JOIN if at_end.any() else f'give {name(other)} a point there too, and {JOIN}'}"


def _check_mouths(cracks: Cracks, new: np.ndarray, edges: np.ndarray, span: float, name) -> None:
    mouths = cracks.surface[cracks.segments[new]]
    for s, e in np.argwhere(mouths) if mouths.any() else ():
        x = cracks.nodes[cracks.segments[new[s], e]]
        way = cracks.nodes[cracks.segments[new[s], 1 - e]] - x
        here = edges[_to_pairs(np.broadcast_to(x, (len(edges), 2)), edges) <= 1e-7 * span]
        # Directions of the two boundary edges at the mouth.
        ahead = (here - x).reshape(-1, 2)
        size = np.hypot(*ahead.T)
        ahead, size = ahead[size > 1e-7 * span], size[size > 1e-7 * span]
        if (ahead @ way > np.cos(SHARPEST_MOUTH) * size * np.hypot(*way)).any():
            raise ValueError(f"{name(new[s])}: leaves the boundary at ({x[0]:g}, {x[1]:g}) at less than 3°")


def _check_folds(cracks: Cracks, new: np.ndarray, name) -> None:
    if not (cracks.valence == 2).any():
        return
    flat = cracks.segments.ravel()
    order = np.argsort(flat, kind="stable")
    first = np.flatnonzero((cracks.valence[flat[order]] == 2) & ~cracks.surface[flat[order]])[::2]
    one, two = order[first], order[first + 1]
    fresh = np.zeros(cracks.n_segments, bool)
    fresh[new] = True
    met = fresh[one // 2] | fresh[two // 2]
    one, two = one[met], two[met]
    node = cracks.nodes[flat[one]]
    # The far end of one segment lies close to the other.
    u, v = cracks.nodes[flat[one ^ 1]] - node, cracks.nodes[flat[two ^ 1]] - node
    folded = np.sum(u * v, axis=1) > np.cos(SHARPEST_FOLD) * np.hypot(*u.T) * np.hypot(*v.T)
    for k in np.flatnonzero(folded)[:1]:
        x, y = node[k]
        first, second = name(one[k] // 2), name(two[k] // 2)
        if first != second:
            raise ValueError(
                f"{first} and {second} meet at ({x:g}, {y:g}) at less than 10°: end one of them before the other, or "
                "draw one crack"
            )
        raise ValueError(f"{first}: folds back on itself at ({x:g}, {y:g}), by more than 170°")


def _to_pairs(points: np.ndarray, segments: np.ndarray) -> np.ndarray:
    """(n,) distance of each of ``points`` (n, 2) from its own segment (n, 2, 2)."""
    a, d = segments[:, 0], segments[:, 1] - segments[:, 0]
    rel = points - a
    s = np.clip(np.sum(rel * d, axis=1) / np.sum(d * d, axis=1), 0.0, 1.0)
    return np.hypot(*(rel - s[:, None] * d).T)


def _near(segment) -> str:
    x, y = segment.mean(axis=0)
    return f"({x:g}, {y:g})"


def _side_of(p, segments):
    d = segments[:, 1] - segments[:, 0]
    rel = p - segments[:, 0]
    return d[:, 0] * rel[:, 1] - d[:, 1] * rel[:, 0]


def _boxes_meet(first: np.ndarray, second: np.ndarray, slack: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Pairs (i, j) of segments whose boxes, widened by ``slack``, overlap; sorted by i, then j."""
    low, high = first.min(axis=1) - slack, first.max(axis=1) + slack
    other_low, other_high = second.min(axis=1), second.max(axis=1)
    rows, columns = [], []
    step = max(1, _PAIRS_AT_ONCE // max(len(second), 1))
    for k in range(0, len(first), step):
        part = slice(k, k + step)
        meet = low[part, None, 0] <= other_high[:, 0]
        meet &= high[part, None, 0] >= other_low[:, 0]
        meet &= low[part, None, 1] <= other_high[:, 1]
        meet &= high[part, None, 1] >= other_low[:, 1]
        i, j = np.nonzero(meet)
        rows.append(i + k)
        columns.append(j)
    if not rows:
        return np.empty(0, int), np.empty(0, int)
    return np.concatenate(rows), np.concatenate(columns)


def _crossing(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(k,) bool: pairs of segments (k, 2, 2) that cross properly: each has the ends of the other on both sides, beyond
    round-off."""
    scale = max(np.abs(one).max(initial=0.0), np.abs(other).max(initial=0.0))
    tol1 = 1e-10 * scale * np.hypot(*(other[:, 1] - other[:, 0]).T)
    tol2 = 1e-10 * scale * np.hypot(*(one[:, 1] - one[:, 0]).T)
    a, b = _side_of(one[:, 0], other), _side_of(one[:, 1], other)
    c, d = _side_of(other[:, 0], one), _side_of(other[:, 1], one)
    across = ((a > tol1) & (b < -tol1)) | ((a < -tol1) & (b > tol1))
    astride = ((c > tol2) & (d < -tol2)) | ((c < -tol2) & (d > tol2))
    return across & astride


def _overlapping(one: np.ndarray, other: np.ndarray, span: float) -> np.ndarray:
    """(k,) bool: collinear pairs of segments (k, 2, 2) that share more than a point."""
    d = one[:, 1] - one[:, 0]
    length = np.hypot(*d.T)
    t = d / length[:, None]
    rel = other - one[:, :1]
    along = np.einsum("nkl,nl->nk", rel, t)
    off = np.abs(rel[..., 1] * t[:, None, 0] - rel[..., 0] * t[:, None, 1])
    common = np.minimum(along.max(axis=1), length) - np.maximum(along.min(axis=1), 0.0)
    return (off.max(axis=1) <= _SMALL * span) & (common > 1e-7 * span)


def _to_segments(points: np.ndarray, segments: np.ndarray) -> np.ndarray:
    """(n,) distance of points from the nearest of ``segments``."""
    a, d = segments[:, 0], segments[:, 1] - segments[:, 0]
    rel = points[:, None] - a
    s = np.clip(np.sum(rel * d, axis=2) / np.sum(d * d, axis=1), 0.0, 1.0)
    return np.hypot(*np.moveaxis(rel - s[..., None] * d, 2, 0)).min(axis=1)


def new_segments(cracks: Cracks, earlier: Cracks) -> np.ndarray:
    """(n_segments,) bool: segments of ``cracks`` that are not, bit for bit, among the ``earlier`` ones."""
    known = {row.tobytes() for row in np.ascontiguousarray(earlier.nodes[earlier.segments])}
    return np.array(
        [row.tobytes() not in known for row in np.ascontiguousarray(cracks.nodes[cracks.segments])], dtype=bool
    )
