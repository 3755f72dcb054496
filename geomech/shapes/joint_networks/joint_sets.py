"""Statistical joint sets: parallel sets with spacing, trace length and gap; Poisson traces, discs cut by the section,
Poisson lines, Voronoi edges; terminations of one set on another. Reproducible from a seed.

Angles are those of the traces in the section, counter-clockwise from x, in radians.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..parts import Joint

LAWS = ("constant", "normal", "uniform", "lognormal", "exponential")

#: Normal and uniform lengths exceed their mean by at most this many standard deviations.
_FARTHEST = 6.0


@dataclass(frozen=True)
class Law:
    """Distribution of a length or an angle: its ``mean`` and standard ``deviation`` (of the quantity itself, also for
    "lognormal"; that of "exponential" is its mean)."""

    mean: float
    deviation: float = 0.0
    law: str = "constant"

    def __post_init__(self) -> None:
        if self.law not in LAWS:
            raise ValueError(f"no law {self.law!r}; there are {', '.join(LAWS)}")
        if not self.deviation >= 0:
            raise ValueError(f"a standard deviation must not be negative, got {self.deviation!r}")
        if self.law in ("lognormal", "exponential") and not self.mean > 0:
            raise ValueError(f"a {self.law} law needs a positive mean, got {self.mean!r}")

    @property
    def spread(self) -> float:
        """Standard deviation of the distribution."""
        return {"constant": 0.0, "exponential": float(self.mean)}.get(self.law, self.deviation)

    @property
    def moments(self) -> tuple[float, float, float]:
        """E[X], E[X²], E[X³]."""
        mean, square = self.mean, self.mean**2 + self.spread**2
        if self.law == "exponential":
            return mean, square, 6 * mean**3
        if self.law == "lognormal":
            return mean, square, mean**3 * (square / mean**2) ** 3
        return mean, square, mean**3 + 3 * mean * self.spread**2

    @property
    def mean_cosine(self) -> float:
        """E[cos(X − mean)] of a normally or uniformly distributed angle, rad."""
        if self.law == "uniform":
            half = math.sqrt(3) * self.deviation
            return math.sin(half) / half if half else 1.0
        return math.exp(-0.5 * self.spread**2)

    def sample(self, rng: np.random.Generator, n: int) -> np.ndarray:
        """(n,) values."""
        if self.law == "exponential":
            return rng.exponential(self.mean, n)
        if self.law == "constant" or self.deviation == 0:
            return np.full(n, float(self.mean))
        if self.law == "normal":
            return rng.normal(self.mean, self.deviation, n)
        if self.law == "uniform":
            half = math.sqrt(3) * self.deviation
            return rng.uniform(self.mean - half, self.mean + half, n)
        square = math.log1p((self.deviation / self.mean) ** 2)
        return rng.lognormal(math.log(self.mean) - 0.5 * square, math.sqrt(square), n)

    def lengths(self, rng: np.random.Generator, n: int) -> np.ndarray:
        """(n,) lengths: values below a hundredth of the mean are drawn again."""
        values = self.sample(rng, n)
        for _ in range(1000):
            bad = values < 0.01 * self.mean
            if not bad.any():
                return values
            values[bad] = self.sample(rng, int(bad.sum()))
        raise ValueError(
            f"a length of mean {self.mean:g} and deviation {self.deviation:g} ({self.law}) is hardly ever positive"
        )

    def met(self, rng: np.random.Generator) -> float:
        """Length that covers a random point on a line of such lengths end to end: its probability is proportional to
        the length itself (Cox 1962, Renewal theory, 5.4)."""
        if self.spread == 0:
            return float(self.mean)
        if self.law == "exponential":
            return float(rng.gamma(2.0, self.mean))
        if self.law == "lognormal":
            square = math.log1p((self.deviation / self.mean) ** 2)
            return float(rng.lognormal(math.log(self.mean) + 0.5 * square, math.sqrt(square)))
        while True:
            length = float(self.lengths(rng, 1)[0])
            if rng.random() * (self.mean + _FARTHEST * self.deviation) < length:
                return length


def apparent_dip(dip: float, dip_direction: float, section: float) -> float:
    """Angle (rad, counter-clockwise) of the trace of a plane in a vertical section whose x axis points to azimuth
    ``section``.

    ``dip`` and azimuths in rad, azimuths clockwise from north: tan α = −tan δ cos(dip direction − section), which falls
    to the right if the plane dips to the right (Priest 1993, Discontinuity analysis, section 2.4).
    """
    if abs(dip - math.pi / 2) < 1e-12:
        return math.pi / 2
    return math.atan(-math.tan(dip) * math.cos(dip_direction - section))


@dataclass(frozen=True)
class FisherAngle:
    """Angles of the traces of planes with Fisher-distributed poles, in a section with its x axis at azimuth
    ``section``.

    The distribution has the constant ``concentration`` around the pole of the mean ``dip`` and ``dip_direction``; rad.
    It replaces a `Law` of the angle. The section cuts a plane with a frequency proportional to the sine of the angle
    between its pole and the section's normal (Terzaghi 1965): planes nearly parallel to the section are rarely seen in
    it.
    """

    dip: float
    dip_direction: float
    section: float
    concentration: float

    @property
    def mean(self) -> float:
        return apparent_dip(self.dip, self.dip_direction, self.section)

    def sample(self, rng: np.random.Generator, n: int) -> np.ndarray:
        """(n,) angles within 90° of the mean."""
        found, wanted = np.empty(0), n
        while len(found) < n:
            off, chance = self._off(rng.random(wanted), rng.uniform(0, 2 * math.pi, wanted))
            found = np.append(found, off[rng.random(wanted) < chance])
            # As many again as the truncated part requires.
            wanted = min(1_000_000, math.ceil(1.2 * (n - len(found)) / max(chance.mean(), 1e-3)) + 16)
        return self.mean + found[:n]

    @property
    def spread(self) -> float:
        """The standard deviation of the angles."""
        off, chance = self._off(*fisher_rule())
        return math.sqrt(float(np.average((off - np.average(off, weights=chance)) ** 2, weights=chance)))

    @property
    def mean_cosine(self) -> float:
        """E[cos(angle − mean)]."""
        off, chance = self._off(*fisher_rule())
        return float(np.average(np.cos(off), weights=chance))

    def _off(self, share: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Deviations of angles from the mean, and the frequency with which such planes are cut."""
        mean = mean_pole(self.dip, self.dip_direction, self.section)
        pole = poles_about(mean, self.concentration, share, turn)
        angle = np.arctan2(pole[:, 1], pole[:, 0]) + 0.5 * math.pi - self.mean
        return 0.5 * np.angle(np.exp(2j * angle)), np.hypot(pole[:, 0], pole[:, 1])


def fisher_rule() -> tuple[np.ndarray, np.ndarray]:
    """``share`` and ``turn`` of `poles_about` for means over Fisher's distribution: equal parts of the probability,
    each with as many rotations about the mean."""
    share, turn = (np.arange(400) + 0.5) / 400, (np.arange(64) + 0.5) / 64 * 2 * math.pi
    share, turn = np.meshgrid(share, turn)
    return share.ravel(), turn.ravel()


def parallel_set(
    name: str,
    region: np.ndarray,
    angle: Law | FisherAngle,
    spacing: Law,
    length: Law | None,
    gap: Law | None,
    rng: np.random.Generator,
) -> Joint:
    """Traces along parallel lines over ``region`` (n, 2).

    Lines are ``spacing`` apart, with alternating traces and gaps from a random start; without ``length`` a trace
    extends right through. Each line has its own angle about its intersection with the centre line of the region. The
    persistence is length / (length + gap).
    """
    region_centre, radius = _circle(region)
    across = _unit(angle.mean + 0.5 * math.pi)
    offsets = _renewal(spacing, 2 * radius, rng) - radius
    angles = angle.sample(rng, len(offsets))
    lines: list[np.ndarray] = []
    for offset, turn in zip(offsets, angles):
        along, centre = _unit(turn), region_centre + offset * across
        for a, b in _intervals(length, gap, 2 * radius, rng):
            lines.append(np.array([centre + (a - radius) * along, centre + (b - radius) * along]))
    return Joint(name, tuple(_touching(lines, region)))


def _renewal(spacing: Law, extent: float, rng: np.random.Generator) -> np.ndarray:
    """Points ``spacing`` apart from 0 to ``extent``, as on an endless line with a random origin."""
    mean = spacing.mean
    steps = spacing.lengths(rng, int(2 * extent / mean) + 16)
    points = np.cumsum(steps) - _before(spacing, float(steps[0]), rng.random(), rng)
    while points[-1] < extent:
        points = np.concatenate([points, points[-1] + np.cumsum(spacing.lengths(rng, 64))])
    return points[points < extent]


def _before(spacing: Law, step: float, share: float, rng: np.random.Generator) -> float:
    """Part of the first ``step`` before 0, a random point on an endless line.

    The ``share`` of it is right if all steps are equal, and otherwise for most: it is kept with the probability common
    to both distributions (their maximal coupling), so that a seed keeps its network where possible; a separate stream
    decides.
    """
    if spacing.spread == 0:
        return step * share
    aside = rng.spawn(1)[0]
    lengths = spacing.lengths(np.random.default_rng(0), 20_000)

    def ratio(rest: float) -> float:
        """Density of the remainder after 0 on an endless line, P(X > rest) / E[X], over that of a share of any step,
        E[1/X; X > rest]."""
        longer = lengths[lengths > rest]
        return len(longer) / lengths.mean() / float((1 / longer).sum()) if len(longer) else math.inf

    if aside.random() < ratio(step * (1 - share)):
        return step * share
    while True:
        rest = aside.random() * spacing.met(aside)
        if aside.random() < 1 - 1 / ratio(rest):
            return step - rest


def _intervals(
    length: Law | None, gap: Law | None, extent: float, rng: np.random.Generator
) -> list[tuple[float, float]]:
    if length is None or gap is None or gap.mean == 0:
        return [(0.0, extent)]
    period = length.mean + gap.mean
    n = int(2 * extent / period) + 8
    out: list[tuple[float, float]] = []
    # The probability that a random point on an endless line is in a trace is the persistence; its position in the trace
    # is uniform.
    at = period * rng.random()
    if at < length.mean:
        first = (1 - at / length.mean) * length.met(rng)
        out.append((0.0, min(first, extent)))
        start = first + gap.lengths(rng, 1)[0]
    else:
        start = (1 - (at - length.mean) / gap.mean) * gap.met(rng)
    while start < extent:
        for own, between in zip(length.lengths(rng, n), gap.lengths(rng, n)):
            if start >= extent:
                break
            out.append((start, min(start + own, extent)))
            start += own + between
    return out


def poisson_traces(
    name: str, region: np.ndarray, angle: Law | FisherAngle, length: Law, per_area: float, rng: np.random.Generator
) -> Joint:
    """Traces with random centres, ``per_area`` (P20, 1/m²) of them, each with its own angle and length."""
    region_centre, radius = _circle(region)
    reach = radius + 0.5 * (
        length.mean + 4 * length.deviation + (6 * length.mean if length.law == "exponential" else 0.0)
    )
    n = rng.poisson(per_area * (2 * reach) ** 2)
    centre = region_centre + rng.uniform(-reach, reach, (n, 2))
    return Joint(name, tuple(_touching(_centred(centre, angle.sample(rng, n), length.lengths(rng, n)), region)))


class Poles(NamedTuple):
    """Orientation of planes in space, and the section that cuts them.

    Poles have Fisher's distribution with constant ``fisher`` (0: no scatter) about the pole of the mean ``dip`` and
    ``dip_direction``; the vertical ``section`` has its x axis at this azimuth. Angles in rad, azimuths clockwise from
    north.
    """

    dip: float
    dip_direction: float
    fisher: float
    section: float


def discs(
    name: str, region: np.ndarray, poles: Poles, diameter: Law, per_volume_area: float, rng: np.random.Generator
) -> Joint:
    """Randomly located discs in space, ``per_volume_area`` (P32, m²/m³) of them, cut by the section of ``poles``
    (Baecher, Lanney & Einstein 1977)."""
    region_centre, radius = _circle(region)
    largest = diameter.mean + 5 * diameter.deviation + (8 * diameter.mean if diameter.law == "exponential" else 0.0)
    reach = radius + 0.5 * largest
    mean_area = 0.25 * math.pi * float(np.mean(diameter.lengths(np.random.default_rng(0), 20000) ** 2))
    n = rng.poisson(per_volume_area / mean_area * (2 * reach) ** 2 * largest)
    radii = 0.5 * diameter.lengths(rng, n)
    centre = np.column_stack([rng.uniform(-reach, reach, (n, 2)), rng.uniform(-0.5 * largest, 0.5 * largest, n)])
    pole = mean_pole(poles.dip, poles.dip_direction, poles.section)
    if poles.fisher > 0:
        pole = poles_about(pole, poles.fisher, rng.random(n), rng.uniform(0, 2 * math.pi, n))
    else:
        pole = np.tile(pole, (n, 1))
    # The section is z = 0: a disc is cut along the line in its plane, as far as its rim extends.
    flat = np.hypot(pole[:, 0], pole[:, 1])
    cut = (flat > 1e-12) & (np.abs(centre[:, 2]) < radii * flat)
    radii, centre, pole, flat = radii[cut], centre[cut], pole[cut], flat[cut]
    normal = pole[:, :2] / flat[:, None]
    foot = centre[:, :2] + (centre[:, 2] * pole[:, 2] / flat)[:, None] * normal
    half = np.sqrt(radii**2 - (centre[:, 2] / flat) ** 2)
    along = np.column_stack([-normal[:, 1], normal[:, 0]])
    lines = np.stack([foot - half[:, None] * along, foot + half[:, None] * along], axis=1) + region_centre
    return Joint(name, tuple(_touching(lines, region)))


def poisson_lines(
    name: str, region: np.ndarray, angle: Law | FisherAngle | None, per_area_length: float, rng: np.random.Generator
) -> Joint:
    """Endless lines, ``per_area_length`` (P21, m/m²) of them, with ``angle`` or, without it, random directions (Miles
    1964).

    The number of lines that meet a circle of radius R is Poisson with mean 2 R P21, their distances from its centre
    uniform.
    """
    region_centre, radius = _circle(region)
    n = rng.poisson(2 * radius * per_area_length)
    turn = rng.uniform(0, math.pi, n) if angle is None else angle.sample(rng, n)
    across = np.column_stack([-np.sin(turn), np.cos(turn)])
    centre = region_centre + rng.uniform(-radius, radius, n)[:, None] * across
    return Joint(name, tuple(_touching(_centred(centre, turn, np.full(n, 2 * radius)), region)))


def voronoi(name: str, region: np.ndarray, cell_area: float, rng: np.random.Generator) -> Joint:
    """Edges of the Voronoi cells of random points, one per ``cell_area`` m²."""
    from scipy.spatial import Voronoi

    region_centre, radius = _circle(region)
    reach = radius + 4 * math.sqrt(cell_area)
    n = rng.poisson((2 * reach) ** 2 / cell_area)
    cells = Voronoi(rng.uniform(-reach, reach, (n, 2)))
    ridges = np.array(cells.ridge_vertices)
    # Infinite ridges belong to points at the outer rim, far from the region.
    ridges = ridges[(ridges >= 0).all(axis=1)]
    return Joint(name, tuple(_touching(region_centre + cells.vertices[ridges], region)))


def terminated(joint: Joint, on: Sequence[Joint], share: float, rng: np.random.Generator) -> Joint:
    """``joint`` with the fraction ``share`` of its traces terminated where they first meet a trace of ``on``, on either
    side of their midpoint."""
    import shapely

    walls = shapely.linestrings([piece for other in on for line in other.lines for piece in _pairs(line)])
    tree = shapely.STRtree(walls)
    lines = []
    for line, ends in zip(joint.lines, rng.random(len(joint.lines)) < share):
        if ends and len(line) == 2:
            line = _between(line, walls[tree.query(shapely.linestrings(line), predicate="intersects")])
        lines.append(line)
    return Joint(joint.name, tuple(lines))


def _between(line: np.ndarray, walls: np.ndarray) -> np.ndarray:
    import shapely

    length = float(np.hypot(*(line[1] - line[0])))
    at = shapely.get_coordinates(shapely.intersection(shapely.linestrings(line), walls))
    t = (at - line[0]) @ (line[1] - line[0]) / length**2
    low, high = max(t[t < 0.5], default=0.0), min(t[t >= 0.5], default=1.0)
    return np.array([line[0] + low * (line[1] - line[0]), line[0] + high * (line[1] - line[0])])


def _circle(region: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre and radius of a circle around ``region``."""
    region_centre = 0.5 * (region.min(axis=0) + region.max(axis=0))
    return region_centre, float(np.hypot(*(region - region_centre).T).max())


def _unit(angle: float) -> np.ndarray:
    return np.array([math.cos(angle), math.sin(angle)])


def _centred(centre: np.ndarray, angle: np.ndarray, length: np.ndarray) -> np.ndarray:
    half = 0.5 * length[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return np.stack([centre - half, centre + half], axis=1)


def _pairs(line: np.ndarray) -> list[np.ndarray]:
    return list(np.stack([line[:-1], line[1:]], axis=1))


def _touching(lines: Sequence[np.ndarray] | np.ndarray, region: np.ndarray) -> list[np.ndarray]:
    """Parts of straight ``lines``, (n, 2, 2), inside ``region``."""
    import shapely

    if not len(lines):
        return []
    lines = np.asarray(lines)
    beyond = (lines.max(axis=1) < region.min(axis=0)) | (lines.min(axis=1) > region.max(axis=0))
    lines = lines[~beyond.any(axis=1)]
    area = shapely.Polygon(region)
    shapely.prepare(area)
    shapes = shapely.linestrings(lines)
    inside = shapely.covers(area, shapes)
    out = list(lines[inside])
    parts = shapely.get_parts(shapely.intersection(shapes[~inside], area))
    parts = parts[(shapely.get_type_id(parts) == shapely.GeometryType.LINESTRING) & (shapely.length(parts) > 0)]
    points, owner = shapely.get_coordinates(parts, return_index=True)
    return out + np.split(points, np.flatnonzero(np.diff(owner)) + 1) if len(parts) else out


def mean_pole(dip: float, dip_direction: float, section: float) -> np.ndarray:
    """Upward unit normal in the section's axes: x along it, y up, z horizontally across."""
    to = dip_direction - section
    return np.array([math.sin(dip) * math.cos(to), math.cos(dip), math.sin(dip) * math.sin(to)])


def poles_about(mean: np.ndarray, concentration: float, share: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """(n, 3) unit vectors around ``mean`` with Fisher's distribution (1953), by inversion (Priest 1993, 3.6).

    ``share`` is the part of all vectors that is closer to the mean, ``turn`` (rad) the rotation about it. All equal for
    ``concentration`` 0.
    """
    if concentration == 0:
        return np.tile(mean, (len(share), 1))
    cosine = 1 + np.log1p(-share * -math.expm1(-2 * concentration)) / concentration
    sine = np.sqrt(np.maximum(0.0, 1 - cosine**2))
    aside = np.cross(mean, [0.0, 0.0, 1.0] if abs(mean[2]) < 0.9 else [1.0, 0.0, 0.0])
    aside /= np.linalg.norm(aside)
    other = np.cross(mean, aside)
    return cosine[:, None] * mean + sine[:, None] * (np.cos(turn)[:, None] * aside + np.sin(turn)[:, None] * other)
