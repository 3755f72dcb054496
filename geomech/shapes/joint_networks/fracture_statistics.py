"""Statistics of joint networks: intensities, trace lengths, spacings, persistence, angles, nodes, block sizes
(Dershowitz & Herda 1992)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..parts import Joint

#: Traces are on one line if their distance from it is below this, relative to the region.
_ON_ONE_LINE = 1e-7
#: Spacings of lines are measured where at least this part of the longest chord of the region lies between them.
_LONG_ENOUGH = 0.5


@dataclass(frozen=True)
class SetStatistics:
    """One joint set in a region; nan where there is nothing to measure.

    traces             number of traces that reach into the region
    p10                1/m: traces met by scan-lines across the set
    p20                1/m²: half the number of trace ends inside, per area (Mauldon 1998), unbiased by the window; for
                       endless traces, their midpoints
    p21                m/m²: trace length per area
    mean_length        m: p21 / p20, the mean of whole traces, some of which the window cuts (Mauldon 1998)
    window_length      m: mean of the part inside the region of each trace that reaches into it
    seen_length, seen_length_deviation   m: of the traces with both ends inside
    mean_spacing, spacing_deviation      m: between neighbours along the scan-lines
    mean_angle, angle_deviation          rad: of the traces, weighted by length
    """

    name: str
    traces: int
    p10: float
    p20: float
    p21: float
    mean_length: float
    window_length: float
    seen_length: float
    seen_length_deviation: float
    mean_spacing: float
    spacing_deviation: float
    mean_angle: float
    angle_deviation: float


@dataclass(frozen=True)
class LineStatistics:
    """Lines of the traces of a parallel set: their number, ``mean_spacing`` and ``spacing_deviation`` (m) between
    neighbours, and the fraction of them that is joint, ``persistence``."""

    lines: int
    mean_spacing: float
    spacing_deviation: float
    persistence: float


def set_statistics(joint: Joint, region, scan_lines: int = 200, tolerance: float = 0.0) -> SetStatistics:
    """Statistics of ``joint`` inside ``region``, (n, 2) or a shapely polygon.

    ``p10`` and spacings are measured on equidistant ``scan_lines`` at right angles to its mean direction. Ends within
    ``tolerance`` (m) of the region's rim count as on it.
    """
    import shapely

    area = shapely.Polygon(region) if isinstance(region, np.ndarray) else region
    lines = _shapes(joint)
    inside = shapely.intersection(lines, area)
    length = shapely.length(inside)
    kept = length > 0
    if not kept.any():
        nan = float("nan")
        return SetStatistics(joint.name, 0, 0.0, 0.0, 0.0, *(nan,) * 8)
    ends = np.array([line[[0, -1]] for line in joint.lines])[kept]
    inside, length = inside[kept], length[kept]
    mean, off = mean_direction(ends, length)
    at = shapely.points(ends)
    # An end on the rim is where the region ends, not the trace.
    reach = max(tolerance, _ON_ONE_LINE * float(np.hypot(*np.subtract(area.bounds[2:], area.bounds[:2]))))
    rim = area.boundary
    shapely.prepare(rim)
    free = shapely.covers(area, at) & ~shapely.dwithin(rim, at, reach)
    whole = free.all(axis=1)
    seen = length[whole]
    per_area = float(free.sum()) / 2 / area.area
    if not free.any():
        per_area = float(shapely.covers(area, shapely.points(ends.mean(axis=1))).sum()) / area.area
    crossed, run, between = _scanned(inside, area, mean, scan_lines)
    return SetStatistics(
        name=joint.name,
        traces=int(kept.sum()),
        p10=crossed / run,
        p20=per_area,
        p21=float(length.sum()) / area.area,
        mean_length=float(length.sum()) / area.area / per_area if free.any() else float("nan"),
        window_length=_mean(length),
        seen_length=_mean(seen),
        seen_length_deviation=_deviation(seen),
        mean_spacing=_mean(between),
        spacing_deviation=_deviation(between),
        mean_angle=mean,
        angle_deviation=float(off.std()),
    )


def line_statistics(joint: Joint, region) -> LineStatistics:
    """Statistics of the lines of the straight traces of a parallel set inside ``region``, (n, 2) or a shapely polygon.

    Lines without any trace in the region are missed. Spacings are measured where the region contains at least half as
    much of a line between them as elsewhere.
    """
    import shapely

    area = shapely.Polygon(region) if isinstance(region, np.ndarray) else region
    lines = _shapes(joint)
    length = shapely.length(shapely.intersection(lines, area))
    ends = np.array([line[[0, -1]] for line in joint.lines]).reshape(-1, 2, 2)[length > 0]
    length = length[length > 0]
    if not len(ends):
        return LineStatistics(0, float("nan"), float("nan"), float("nan"))
    mean, off = mean_direction(ends, length)
    low, high = np.reshape(area.bounds, (2, 2))
    centre, size = 0.5 * (low + high), float(np.hypot(*(high - low)))
    along, across = np.array([np.cos(mean), np.sin(mean)]), np.array([-np.sin(mean), np.cos(mean)])
    arm = ends.mean(axis=1) - centre
    at = arm @ across - (arm @ along) * np.tan(off)
    # Position and direction of a line: short pieces cut off at a corner of the region give the latter poorly.
    order = np.argsort(at)
    new = np.diff(at[order], prepend=-np.inf) > _ON_ONE_LINE * size
    number = np.empty(len(at), int)
    number[order] = np.cumsum(new) - 1
    longest = np.lexsort((length, number))[np.searchsorted(np.sort(number), np.arange(number.max() + 1), "right") - 1]
    step = ends[longest, 1] - ends[longest, 0]
    step *= (size / np.hypot(*step.T))[:, None]
    start = ends[longest].mean(axis=1)
    chords = shapely.intersection(shapely.linestrings(np.stack([start - step, start + step], axis=1)), area)
    place = np.sort(at[longest])
    between = np.diff(place)
    # Where only short parts of lines are in the region some are missed, and spacings appear too large.
    halfway = centre + (place[:-1] + 0.5 * between)[:, None] * across
    shown = shapely.length(
        shapely.intersection(
            shapely.linestrings(np.stack([halfway - size * along, halfway + size * along], axis=1)), area
        )
    )
    between = between[shown >= _LONG_ENOUGH * shown.max(initial=0.0)]
    return LineStatistics(
        len(longest), _mean(between), _deviation(between), float(length.sum() / shapely.length(chords).sum())
    )


def mean_direction(ends: np.ndarray, weights: np.ndarray) -> tuple[float, np.ndarray]:
    """Mean angle of traces with ``ends`` (n, 2, 2), rad, and the deviation of each.

    Traces have no direction sense, so that doubled angles are averaged (Mardia 1972).
    """
    along = ends[:, 1] - ends[:, 0]
    double = 2 * np.arctan2(along[:, 1], along[:, 0])
    mean = 0.5 * float(np.angle(np.sum(weights * np.exp(1j * double))))
    return mean, 0.5 * np.angle(np.exp(1j * (double - 2 * mean)))


def _shapes(joint: Joint) -> np.ndarray:
    import shapely

    if not joint.lines:
        return np.empty(0, object)
    count = [len(line) for line in joint.lines]
    return shapely.linestrings(np.concatenate(joint.lines), indices=np.repeat(np.arange(len(count)), count))


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if len(values) else float("nan")


def _deviation(values: np.ndarray) -> float:
    return float(values.std(ddof=1)) if len(values) > 1 else float("nan")


def _scanned(lines: np.ndarray, area, angle: float, n: int) -> tuple[int, float, np.ndarray]:
    """Number of intersections of scan-lines across ``angle`` with ``lines``, length (m) of the scan-lines in ``area``,
    and distances (m) between neighbours on them."""
    import shapely

    low_x, low_y, high_x, high_y = area.bounds
    centre = np.array([0.5 * (low_x + high_x), 0.5 * (low_y + high_y)])
    radius = 0.5 * np.hypot(high_x - low_x, high_y - low_y)
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    at = centre + ((np.arange(n) + 0.5) / n * 2 - 1)[:, None] * radius * along
    scans = shapely.intersection(
        shapely.linestrings(np.stack([at - radius * across, at + radius * across], axis=1)), area
    )
    i, j = shapely.STRtree(lines).query(scans, predicate="intersects")
    place = shapely.get_coordinates(shapely.centroid(shapely.intersection(scans[i], lines[j]))) @ across
    order = np.lexsort((place, i))
    between = np.diff(place[order])[np.diff(i[order]) == 0]
    return len(i), max(float(shapely.length(scans).sum()), 1e-300), between


@dataclass(frozen=True)
class Topology:
    """Topology of a network (Sanderson & Nixon 2015, Journal of Structural Geology 72, 55).

    Nodes: ends in rock ``i_nodes``, abutments ``y_nodes``, crossings ``x_nodes``; ``branches`` (N_I + 3 N_Y + 4 N_X) /
    2 and ``lines`` (N_I + N_Y) / 2; connections ``per_branch`` (3 N_Y + 4 N_X) / N_B, 0 to 2, and ``per_line`` 2 (N_Y +
    N_X) / N_L.
    """

    i_nodes: int
    y_nodes: int
    x_nodes: int

    @classmethod
    def of(cls, nodes: Mapping[str, int]) -> Topology:
        return cls(nodes["I"], nodes["Y"], nodes["X"])

    @property
    def branches(self) -> float:
        return (self.i_nodes + 3 * self.y_nodes + 4 * self.x_nodes) / 2

    @property
    def lines(self) -> float:
        return (self.i_nodes + self.y_nodes) / 2

    @property
    def per_branch(self) -> float:
        return (3 * self.y_nodes + 4 * self.x_nodes) / self.branches if self.branches else float("nan")

    @property
    def per_line(self) -> float:
        return 2 * (self.y_nodes + self.x_nodes) / self.lines if self.lines else float("nan")


def block_sizes(areas: np.ndarray, passing: Sequence[float] = (0.1, 0.25, 0.5, 0.75, 0.9)) -> dict[float, float]:
    """Block size √area (m) that the part ``passing`` of the rock, by area, does not exceed: the in-situ block size
    distribution (Hudson & Priest 1979)."""
    order = np.sort(np.asarray(areas, dtype=float))
    share = np.cumsum(order) / order.sum()
    return {p: float(np.sqrt(order[min(int(np.searchsorted(share, p)), len(order) - 1)])) for p in passing}


def passing_curve(areas: np.ndarray, most: int = 200) -> np.ndarray:
    """(n, 2) block size √area (m), and the percentage of the rock by area in blocks up to that size: the block-size
    curve, at ``most`` evenly selected blocks."""
    order = np.sort(np.asarray(areas, dtype=float))
    percent = 100 * np.cumsum(order) / order.sum()
    at = np.unique(np.linspace(0, len(order) - 1, min(most, len(order))).round().astype(int))
    return np.stack([np.sqrt(order[at]), percent[at]], axis=1)
