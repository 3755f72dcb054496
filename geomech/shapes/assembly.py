"""Assembly of a drawing from any source into the model, in one canonical form."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from ..model import Blocks, Cracks
from ..model.blocks.polygon import crossing_edges, signed_area
from .block_cutting.crack_traces import crack_network
from .parts import NOT_FINITE, EdgeLine, Flaw, ShapeError, Trace, Zone, extent_of, finite, grid_decimals

#: Drawing tolerance relative to the drawing's largest side: crack ends closer than this to an outline, a crack or
#: another end touch it. A tenth of a micrometre on a hand specimen: far below fabrication tolerances, far above the
#: round-off of coordinates.
TOLERANCE = 1e-6


def assemble(
    zones: Sequence[Zone],
    traces: Sequence[Trace] = (),
    edges: Sequence[EdgeLine] = (),
    tolerance: float | None = None,
) -> tuple[Blocks, Cracks]:
    """Blocks (one per zone, in their order) and the crack network of a drawing, with common nodes.

    Canonical form: coordinates have twelve significant digits; outlines run counter-clockwise and holes clockwise, each
    from its lowest (then leftmost) vertex; holes are sorted by that vertex; cracks keep the order and direction in
    which they are drawn. Two drawings of one specimen therefore give the same arrays. Materials and apertures keep
    their defaults. ``tolerance`` in m, default 1e-6 of the drawing's largest side.

    Raises ShapeError with all errors: outlines that cross themselves or enclose nothing, holes outside, zones that
    overlap, edge names that lie on no edge or clash, cracks outside the rock, across an outline or on top of one
    another.
    """
    everything = [loop for zone in zones for loop in zone.loops] + [line for t in traces for line in t.lines]
    drawn = [("zones", "zone", k, zone.name, zone.loops) for k, zone in enumerate(zones)]
    drawn += [("cracks", "crack", k, trace.name, trace.lines) for k, trace in enumerate(traces)]
    drawn += [("edges", "edge", k, line.name, (np.array([line.start, line.end]),)) for k, line in enumerate(edges)]
    flaws = [
        Flaw(part, k, f"{what} {name!r} {NOT_FINITE}", "give finite x and y in m")
        for part, what, k, name, lines in drawn
        if not all(finite(line).all() for line in lines)
    ]
    if flaws:
        raise ShapeError(flaws)
    if tolerance is None:
        tolerance = TOLERANCE * extent_of(everything)
    decimals = grid_decimals(everything)

    polygons, loops, names = [], [], []
    for k, zone in enumerate(zones):
        shape, own_loops, own_names = _canonical(k, zone, decimals, tolerance, flaws)
        polygons.append(shape)
        loops.append(own_loops)
        names.append(own_names)
    _refuse_overlaps(zones, polygons, tolerance, flaws)
    if any(flaw.part == "zones" for flaw in flaws):
        # Cracks and edge names cannot be checked without outlines.
        raise ShapeError(flaws)

    for k, line in enumerate(edges):
        _name_edges(k, line, zones, loops, names, decimals, tolerance, flaws)
    lines = [[np.round(line, decimals) + 0.0 for line in trace.lines] for trace in traces]
    cracks = crack_network(
        [trace.name for trace in traces], lines, [z.name for z in zones], polygons, loops, tolerance, decimals, flaws
    )
    if flaws:
        raise ShapeError(flaws)
    blocks = Blocks.from_polygons(loops, edge_names=names, names=block_names([zone.name for zone in zones]))
    return blocks, cracks


def block_names(zone_names: Sequence[str]) -> list[str]:
    """One name per block: the zone's own, or "zone 1", "zone 2" … for several blocks of a zone."""
    count, names = Counter(zone_names), []
    seen: Counter[str] = Counter()
    for name in zone_names:
        seen[name] += 1
        names.append(name if count[name] == 1 else f"{name} {seen[name]}")
    return names


def _canonical(k: int, zone: Zone, decimals: int, tolerance: float, flaws: list[Flaw]):
    """Shapely polygon, loops and edge names of ``zone`` in canonical form; (None, [], []) if there is a flaw."""
    import shapely

    def refuse(message: str, way_out: str):
        flaws.append(Flaw("zones", k, f"zone {zone.name!r}: {message}", way_out))
        return None, [], []

    if not zone.loops:
        return refuse("it has no outline", "draw one, or export the file again")
    found = []
    for number, loop in enumerate(zone.loops):
        what = "the outline" if number == 0 else f"hole {number}"
        loop = np.round(np.asarray(loop, dtype=float), decimals) + 0.0
        label = list(zone.edge_names[number]) if zone.edge_names is not None else [""] * len(loop)
        if len(loop) > 1 and (loop[0] == loop[-1]).all():
            # The repeated first vertex: the edge leaving it would have no length.
            loop, label = loop[:-1], label[: len(loop) - 1]
        if len(loop) < 3:
            return refuse(f"{what} has {len(loop)} corners", "a polygon needs at least three different corners")
        step = np.hypot(*(np.roll(loop, -1, axis=0) - loop).T)
        if (step <= tolerance).any():
            at = int(np.argmin(step))
            return refuse(
                f"corners {at} and {(at + 1) % len(loop)} of {what} coincide at ({loop[at, 0]:g}, {loop[at, 1]:g})",
                "remove one of them",
            )
        ring = shapely.Polygon(loop)
        if ring.convex_hull.area <= tolerance * ring.length:
            return refuse(f"{what} encloses no area", "check its corners")
        if not ring.is_valid:
            reason = shapely.is_valid_reason(ring)
            where = reason[reason.find("[") + 1 : -1].replace(" ", ", ") if "[" in reason else "?"
            return refuse(
                f"{what} crosses or touches itself at ({where})",
                "list the corners in order along the outline, or split the zone in two",
            )
        crossing = crossing_edges(loop)
        if crossing is not None:
            (x, y), (u, v) = loop[list(crossing)].tolist()
            return refuse(
                f"{what} touches itself: its edges from ({x:g}, {y:g}) and from ({u:g}, {v:g}) meet",
                "move them apart, or split the zone in two",
            )
        found.append(_turned(loop, label, counter_clockwise=number == 0))
    if len(found) > 1:
        outline = shapely.Polygon(found[0][0])
        for number, (loop, _) in enumerate(found[1:], 1):
            hole = shapely.Polygon(loop)
            if not outline.covers(hole) or outline.exterior.distance(hole.exterior) <= tolerance:
                return refuse(
                    f"hole {number} is not inside the outline", "move it inside, or draw it as part of the outline"
                )
            for other in range(1, number):
                if hole.distance(shapely.Polygon(found[other][0])) <= tolerance:
                    return refuse(f"holes {other} and {number} touch or overlap", "draw them as one hole")
        found[1:] = sorted(found[1:], key=lambda pair: (pair[0][0, 1], pair[0][0, 0]))
    loops, labels = [pair[0] for pair in found], [pair[1] for pair in found]
    return shapely.Polygon(loops[0], loops[1:]), loops, labels


def _turned(loop: np.ndarray, label: list[str], counter_clockwise: bool) -> tuple[np.ndarray, list[str]]:
    """``loop`` with the canonical orientation, from its lowest, then leftmost vertex; edge names follow their edges."""
    if (signed_area(loop) > 0) != counter_clockwise:
        loop, label = loop[::-1], [*label[-2::-1], label[-1]]
    first = int(np.lexsort((loop[:, 0], loop[:, 1]))[0])
    return np.roll(loop, -first, axis=0), label[first:] + label[:first]


def _refuse_overlaps(zones: Sequence[Zone], polygons: list, tolerance: float, flaws: list[Flaw]) -> None:
    """Record pairs of zones that overlap by more than a sliver of ``tolerance`` along their common boundary."""
    import shapely

    present = [k for k, polygon in enumerate(polygons) if polygon is not None]
    if len(present) < 2:
        return
    shapes = np.array([polygons[k] for k in present])
    first, second = shapely.STRtree(shapes).query(shapes, predicate="intersects")
    keep = first < second
    first, second = first[keep], second[keep]
    common = shapely.intersection(shapes[first], shapes[second])
    thick = shapely.area(common) > tolerance * np.maximum(shapely.length(common), tolerance)
    for a, b, shared in zip(first[thick], second[thick], common[thick]):
        a, b, at = present[a], present[b], shared.representative_point()
        flaws.append(
            Flaw(
                "zones",
                b,
                f"zones {zones[a].name!r} and {zones[b].name!r} overlap near ({at.x:g}, {at.y:g}) "
                f"by {shared.area:.3g} m²",
                "blocks may touch, not overlap: move one, or cut it along the other's outline",
            )
        )


def _name_edges(k, line: EdgeLine, zones, loops, names, decimals: int, tolerance: float, flaws: list[Flaw]) -> None:
    """Give ``line``'s name to every edge on it, with new vertices where it ends inside an edge."""
    ends = np.round([line.start, line.end], decimals) + 0.0
    if np.hypot(*(ends[1] - ends[0])) <= tolerance:
        flaws.append(Flaw("edges", k, f"edge {line.name!r}: its line has no length", "give two different points"))
        return
    if line.zone is not None and line.zone not in {zone.name for zone in zones}:
        flaws.append(
            Flaw(
                "edges",
                k,
                f"edge {line.name!r}: there is no zone {line.zone!r}",
                f"zones are {', '.join(sorted({zone.name for zone in zones}))}",
            )
        )
        return
    hits = 0
    for b, zone in enumerate(zones):
        if line.zone is not None and zone.name != line.zone:
            continue
        for n, loop in enumerate(loops[b]):
            start, stop = _overlaps(loop, ends, tolerance)
            on = np.flatnonzero(stop - start > tolerance)
            hits += len(on)
            for edge in on[::-1]:
                old = names[b][n][edge]
                if old and old != line.name:
                    flaws.append(
                        Flaw(
                            "edges",
                            k,
                            f"edge {line.name!r} lies on an edge of zone {zone.name!r} that is already called {old!r}",
                            "give each edge one name; end one line where the other begins",
                        )
                    )
                    continue
                loop, names[b][n] = _with_piece(
                    loop, names[b][n], edge, start[edge], stop[edge], ends, line.name, tolerance
                )
            loops[b][n] = loop
    if not hits:
        flaws.append(
            Flaw(
                "edges",
                k,
                f"edge {line.name!r}: no block edge lies on the line from ({ends[0, 0]:g}, {ends[0, 1]:g}) to "
                f"({ends[1, 0]:g}, {ends[1, 1]:g})",
                "take both points from the outline of a zone",
            )
        )


def _overlaps(loop: np.ndarray, ends: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Interval on which each edge of ``loop`` runs along the line ``ends``: distances along it (n,), (n,), m; both 0
    for none."""
    along = np.roll(loop, -1, axis=0) - loop
    length = np.hypot(along[:, 0], along[:, 1])
    along = along / length[:, None]
    to = ends[None] - loop[:, None]
    position = np.einsum("nkx,nx->nk", to, along)
    off = to[..., 1] * along[:, None, 0] - to[..., 0] * along[:, None, 1]
    low, high = position.min(axis=1), position.max(axis=1)
    start, stop = np.clip(low, 0, length), np.clip(high, 0, length)
    # Distance of the line from the edge at both ends of the common interval, not at its own ends.
    span = np.where(np.abs(position[:, 1] - position[:, 0]) > tolerance, position[:, 1] - position[:, 0], np.inf)
    slope = (off[:, 1] - off[:, 0]) / span
    near = np.maximum(
        np.abs(off[:, 0] + slope * (start - position[:, 0])), np.abs(off[:, 0] + slope * (stop - position[:, 0]))
    )
    apart = (near > tolerance) | ~np.isfinite(span)
    return np.where(apart, 0.0, start), np.where(apart, 0.0, stop)


def _with_piece(loop, label, edge, start, stop, ends, name, tolerance):
    """``loop`` with the interval from ``start`` to ``stop`` (m along ``edge``) as a separate edge called ``name``."""
    a, b = loop[edge], loop[(edge + 1) % len(loop)]
    length = float(np.hypot(*(b - a)))
    cuts = [s for s in (start, stop) if tolerance < s < length - tolerance]
    points = [_on_edge(a, b, s / length, ends) for s in cuts]
    old = label[edge]
    pieces = ([old] if start > tolerance else []) + [name] + ([old] if stop < length - tolerance else [])
    loop = np.concatenate([loop[: edge + 1], np.reshape(points, (-1, 2)), loop[edge + 1 :]])
    return loop, [*label[:edge], *pieces, *label[edge + 1 :]]


def _on_edge(a: np.ndarray, b: np.ndarray, t: float, ends: np.ndarray) -> np.ndarray:
    """Point at ``t`` of the edge: the line's own end if that lies on the edge to round-off."""
    point = a + t * (b - a)
    nearest = ends[np.argmin(np.hypot(*(ends - point).T))]
    return nearest if np.hypot(*(nearest - point)) <= 1e-11 * (np.abs(point).max() + np.hypot(*(b - a))) else point
