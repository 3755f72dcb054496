"""What a joint network is like: intensities, trace lengths, angles, block sizes (Dershowitz & Herda 1992)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .parts import Joint


@dataclass(frozen=True)
class SetStatistics:
    """One joint set in a region: ``p20`` traces per m² (by their middles), ``p21`` m of trace per m², ``p10`` traces per m of
    scan-lines across the set, ``mean_length`` m of what lies inside, ``mean_angle`` and ``angle_deviation`` rad."""

    name: str
    traces: int
    p20: float
    p21: float
    p10: float
    mean_length: float
    mean_angle: float
    angle_deviation: float


def set_statistics(joint: Joint, region, scan_lines: int = 200) -> SetStatistics:
    """Statistics of ``joint`` inside ``region``, (n, 2) or a shapely polygon; ``p10`` on equidistant ``scan_lines`` at right angles to its mean
    direction."""
    import shapely

    area = shapely.Polygon(region) if isinstance(region, np.ndarray) else region
    lines = shapely.linestrings([line[[0, -1]] for line in joint.lines]) if joint.lines else np.empty(0, object)
    inside = shapely.intersection(lines, area)
    length = shapely.length(inside)
    kept = length > 0
    ends = np.array([line[[0, -1]] for line in joint.lines]).reshape(-1, 2, 2)[kept]
    along = ends[:, 1] - ends[:, 0]
    # Traces have no sense: their angles are averaged doubled (Mardia 1972).
    double = 2 * np.arctan2(along[:, 1], along[:, 0])
    vector = np.sum(length[kept] * np.exp(1j * double)) if kept.any() else 1.0
    mean = 0.5 * float(np.angle(vector))
    off = 0.5 * np.angle(np.exp(1j * (double - 2 * mean)))
    middle = shapely.points(ends.mean(axis=1)) if kept.any() else np.empty(0, object)
    crossed, run = _scanned(inside[kept], area, mean, scan_lines)
    return SetStatistics(
        name=joint.name,
        traces=int(kept.sum()),
        p20=float(shapely.covers(area, middle).sum()) / area.area,
        p21=float(length.sum()) / area.area,
        p10=crossed / run,
        mean_length=float(length[kept].mean()) if kept.any() else 0.0,
        mean_angle=mean,
        angle_deviation=float(off.std()) if kept.any() else 0.0,
    )


def _scanned(lines: np.ndarray, area, angle: float, n: int) -> tuple[int, float]:
    """How often scan-lines across ``angle`` meet ``lines``, and their length in ``area``, m."""
    import shapely

    low_x, low_y, high_x, high_y = area.bounds
    middle = np.array([0.5 * (low_x + high_x), 0.5 * (low_y + high_y)])
    radius = 0.5 * np.hypot(high_x - low_x, high_y - low_y)
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    at = middle + ((np.arange(n) + 0.5) / n * 2 - 1)[:, None] * radius * along
    scans = shapely.intersection(
        shapely.linestrings(np.stack([at - radius * across, at + radius * across], axis=1)), area
    )
    i, _ = shapely.STRtree(lines).query(scans, predicate="intersects")
    return len(i), max(float(shapely.length(scans).sum()), 1e-300)


def block_sizes(areas: np.ndarray, passing: Sequence[float] = (0.1, 0.25, 0.5, 0.75, 0.9)) -> dict[float, float]:
    """Block size, √area in m, that the part ``passing`` of all rock, by area, is not larger than: the in-situ block size
    distribution (Hudson & Priest 1979)."""
    order = np.sort(np.asarray(areas, dtype=float))
    share = np.cumsum(order) / order.sum()
    return {p: float(np.sqrt(order[min(np.searchsorted(share, p), len(order) - 1)])) for p in passing}
