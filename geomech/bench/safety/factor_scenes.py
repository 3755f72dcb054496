"""Random slopes with a known factor of safety, one per seed.

Five families, each with or without cohesion, water and anchors, with sharp and with cut toes:

    planar    a block on one plane in front of a vertical tension crack (Hoek & Bray 1981, chapter 7)
    stepped   a block on two parallel planes with a riser between them, which opens
    bilinear  an active block above a passive one, with a vertical joint between them (Jaeger 1971)
    wedge     the same with an inclined joint: the active block is a wedge
    toppling  columns on an inclined base (Goodman & Bray 1976): one that slides, one that an anchor or a bond keeps from
              toppling, rows of them

Lengths in m, angles in degrees until they are used.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...model import Problem
from ..slopes.drawn_slopes import problem_of
from .slope_limits import admissible_factor, sliding_factor

GRAVITY, DENSITY = 9.81, 2600.0
FAMILIES = ("planar", "bilinear", "stepped", "wedge", "toppling")
#: Names of the edges without forces at the limit.
OPEN = ("joint:crack", "joint:riser")
PLANE, BETWEEN = "joint:plane", "joint:between"
#: Limit equilibrium must also satisfy moments to this part; otherwise another slope is drawn.
_AS_GOOD = 1e-3
#: Slopes are drawn until their factor lies between these.
_LEAST, _MOST = 0.7, 6.0


@dataclass(frozen=True)
class FactorSlope:
    """A slope of a ``family`` with its ``scene``.

    limit     factor of safety by limit equilibrium (nan: unknown)
    bound     largest factor according to the linear programme (inf: the blocks never move)
    toe       "free" (the floor lies deep below it), "corner" (it ends in the corner with the floor), "0.1 m below" …
    traits    further features: "cohesion", "water", "anchor", "sharp" …
    anchor    elongation, m, at which its softest anchor yields
    """

    seed: int
    family: str
    scene: dict[str, Any]
    limit: float
    bound: float
    toe: str = "free"
    traits: tuple[str, ...] = ()
    anchor: float = 0.0

    @property
    def expected(self) -> float:
        """Reference factor: that of limit equilibrium, or else of the programme."""
        return self.bound if math.isnan(self.limit) else self.limit


@dataclass
class _Drawn:
    """A slope under construction: polygons and named straight edges, laws, loads."""

    base: list[tuple[float, float]]
    blocks: dict[str, list[tuple[float, float]]]
    edges: list[tuple[str, tuple[float, float], tuple[float, float]]]
    friction: float
    cohesion: float = 0.0
    tension: float = 0.0
    same_law: bool = False
    water: list[tuple[float, float]] = field(default_factory=list)
    bolts: list[dict[str, Any]] = field(default_factory=list)
    planes: tuple[str, ...] = (PLANE,)
    interface: str = ""
    toe: str = "free"
    traits: list[str] = field(default_factory=list)
    limit: float | None = None

    @property
    def planes_drawn(self) -> list[str]:
        return [name for name, _, _ in self.edges if name not in OPEN]

    def scene(self, title: str) -> dict[str, Any]:
        laws: dict[str, Any] = {"default": {"friction_angle_deg": self.friction}}
        if self.cohesion:
            laws["default"] |= {"cohesion_pa": self.cohesion, "tensile_strength_pa": self.tension}
            if len(self.planes_drawn) > 1 or self.bolts:
                # Several faces or bolts share the load: cohesion lost at once would let them fail one by one, below
                # limit equilibrium.
                laws["default"]["residual_cohesion_pa"] = self.cohesion
        drawn = {name for name, _, _ in self.edges}
        if not self.same_law and drawn & set(OPEN):
            laws["open"] = {"friction_angle_deg": 0.0, "edges": sorted(drawn & set(OPEN))}
        loads: dict[str, Any] = {"gravity_m_s2": [0.0, -GRAVITY]}
        if self.water:
            loads["water"] = {"points": [list(point) for point in self.water]}
        if self.bolts:
            loads["bolts"] = self.bolts
        zones = [{"name": "base", "polygon": [list(point) for point in self.base]}]
        zones += [{"name": name, "polygon": [list(at) for at in polygon]} for name, polygon in self.blocks.items()]
        return {
            "title": title,
            "geometry": {
                "dead_ends": "trim", "zones": zones,
                "edges": [{"name": name, "line": [list(a), list(b)]} for name, a, b in self.edges],
            },
            "materials": {"rock": {"youngs_modulus_pa": 20e9, "poissons_ratio": 0.25, "density_kg_m3": DENSITY}},
            "zones": {"base": {"fixed": True}},
            "joints": laws,
            "loads": loads,
            "dda": {"time_step_s": 0.01, "dynamic_factor": 0.0},
            "growth": {"enabled": False},
            "run": {"end_time_s": 1.0},
        }  # fmt: skip


def random_slope(seed: int) -> FactorSlope:
    """The slope of a ``seed``, whose remainder by five selects the family.

    Slopes without a factor between 0.7 and 6, or with one that moments do not admit, are drawn again.
    """
    rng = np.random.default_rng([seed, 20])
    family = FAMILIES[seed % len(FAMILIES)]
    while True:
        drawn = _MAKERS[family](rng)
        found = _with_limits(drawn, seed, family)
        if found is not None:
            return found


def _with_limits(drawn: _Drawn, seed: int, family: str) -> FactorSlope | None:
    scene = drawn.scene(f"Slope {seed}: {family}")
    problem = problem_of(scene)
    bound = admissible_factor(problem, OPEN)
    limit = math.nan
    if drawn.limit is not None:
        limit, bound = drawn.limit, max(bound, drawn.limit)
    elif drawn.planes:
        try:
            limit = sliding_factor(problem, drawn.planes, drawn.interface)
        except ValueError:
            return None
        if limit > bound * (1 + _AS_GOOD):
            # Moments, not forces: it rotates before it slides.
            return None
    if not _LEAST < (bound if math.isnan(limit) else limit) < _MOST:
        return None
    stretch = max(((b["yield_force_n_per_m"] - b.get("pretension_n_per_m", 0.0)) / b["stiffness_n_per_m"]
                   for b in drawn.bolts), default=0.0)  # fmt: skip
    return FactorSlope(seed, family, scene, limit, bound, drawn.toe, tuple(drawn.traits), stretch)


def _frame(rng, toe: str, depth: float) -> list[tuple[float, float]]:
    """The base in front of the toe at (0, 0): its floor, from the left to the toe."""
    floor = {"free": -rng.uniform(8, 14), "corner": 0.0}.get(toe)
    floor = -float(toe.split()[0]) if floor is None else floor
    corners = [(-30.0, min(floor, 0.0) - depth), (-30.0, floor)]
    return corners + ([(0.0, floor)] if floor < 0 else [])


def _toe(rng) -> str:
    return str(rng.choice(["free", "free", "corner", "0.01 m below", "0.1 m below", "0.5 m below"]))


def _planar(rng) -> _Drawn:
    dip, face = rng.uniform(25, 45), rng.uniform(55, 80)
    height, set_back = rng.uniform(10, 25), rng.uniform(0.3, 0.8)
    crest = height / math.tan(math.radians(face))
    behind = height / math.tan(math.radians(dip))
    x = crest + set_back * (behind - crest)
    foot = (x, x * math.tan(math.radians(dip)))
    toe = _toe(rng)
    drawn = _Drawn(
        _base(_frame(rng, toe, 10.0), [(0.0, 0.0), foot, (x, height)]),
        {"block": [(0.0, 0.0), foot, (x, height), (crest, height)]},
        [(PLANE, (0.0, 0.0), foot), (OPEN[0], foot, (x, height))],
        dip + rng.uniform(-4, 12), toe=toe,
    )  # fmt: skip
    _strength(rng, drawn, 2e3 * height)
    if rng.random() < 0.35:
        depth = rng.uniform(0.2, 0.8) * (height - foot[1])
        drawn.water = [(0.0, 0.0), (x, foot[1] + depth)]
        drawn.traits.append("water")
    if rng.random() < 0.35:
        _anchor(rng, drawn, _inside(drawn.blocks["block"]), "block", dip)
    return drawn


def _stepped(rng) -> _Drawn:
    dip, riser, face = rng.uniform(25, 42), rng.uniform(65, 110), rng.uniform(60, 85)
    tangent = math.tan(math.radians(dip))
    first, second, rise = rng.uniform(4, 9), rng.uniform(4, 9), rng.uniform(0.8, 2.5)
    a = (first, first * tangent)
    b = (a[0] + rise / math.tan(math.radians(riser)), a[1] + rise)
    foot = (b[0] + second, b[1] + second * tangent)
    height = foot[1] + rng.uniform(2, 8)
    crest = min(height / math.tan(math.radians(face)), 0.8 * foot[0])
    toe = _toe(rng)
    drawn = _Drawn(
        _base(_frame(rng, toe, 10.0), [(0.0, 0.0), a, b, foot, (foot[0], height)]),
        {"block": [(0.0, 0.0), a, b, foot, (foot[0], height), (crest, height)]},
        [(PLANE, (0.0, 0.0), a), (OPEN[1], a, b), (PLANE, b, foot), (OPEN[0], foot, (foot[0], height))],
        dip + rng.uniform(-4, 12), toe=toe,
    )  # fmt: skip
    _strength(rng, drawn, 2e3 * height)
    if rng.random() < 0.3:
        _anchor(rng, drawn, _inside(drawn.blocks["block"]), "block", dip)
    return drawn


def _two_blocks(rng, lean: float) -> _Drawn:
    flat, steep = rng.uniform(5, 22), rng.uniform(45, 62)
    width = rng.uniform(8, 18)
    kink = (width, width * math.tan(math.radians(flat)))
    height = kink[1] + rng.uniform(6, 14)
    back = (kink[0] + (height - kink[1]) / math.tan(math.radians(steep)), height)
    top = kink[0] + (height - kink[1]) * math.tan(math.radians(lean))
    crest = min(0.6 * kink[0], height / math.tan(math.radians(60)), 0.8 * top)
    sharp = bool(rng.random() < 0.5)
    base = [(0.0, 0.0), kink, back]
    active = [kink, back, (top, height)]
    plane = kink
    if not sharp:
        cut = rng.uniform(0.02, 0.3)
        slope = math.radians(steep)
        plane = (kink[0] + cut * math.cos(slope), kink[1] + cut * math.sin(slope))
        side = math.radians(90 - lean)
        side_end = (kink[0] + cut * math.cos(side), kink[1] + cut * math.sin(side))
        active = [plane, back, (top, height), side_end]
    drawn = _Drawn(
        _base(_frame(rng, "free", 8.0), base),
        {"passive": [(0.0, 0.0), kink, (top, height), (crest, height)], "active": active},
        [(PLANE, (0.0, 0.0), kink), (PLANE, kink, back), (BETWEEN, kink, (top, height))],
        rng.uniform(22, 42), interface=BETWEEN,
    )  # fmt: skip
    if sharp:
        drawn.traits.append("sharp")
    _strength(rng, drawn, 1e3 * height)
    if rng.random() < 0.3:
        _anchor(rng, drawn, _inside(drawn.blocks["passive"]), "passive", flat)
    return drawn


def _toppling(rng) -> _Drawn:
    kind = str(rng.choice(["slides", "anchored", "glued", "row", "row", "row"]))
    dip, width = rng.uniform(18, 35), rng.uniform(0.8, 2.0)
    slope = math.radians(dip)
    along, up = np.array([math.cos(slope), math.sin(slope)]), np.array([-math.sin(slope), math.cos(slope)])

    def at(s: float, n: float) -> tuple[float, float]:
        return tuple((s * along + n * up).tolist())

    number = 1 if kind != "row" else int(rng.integers(3, 9))
    slender = 1.0 / math.tan(slope)
    if kind == "row":
        peak = rng.integers(1, number + 1)
        low, high = rng.uniform(0.3, 0.7) * slender, rng.uniform(1.05, 1.5) * slender
        heights = np.interp(np.arange(number), [0, peak, number + 1], [low, high, 0.4 * slender]) * width
    else:
        share = {"slides": rng.uniform(0.3, 0.85), "anchored": rng.uniform(1.1, 1.6), "glued": rng.uniform(1.05, 1.4)}
        heights = np.array([share[kind] * slender * width])
    blocks = {
        f"column {k + 1}": [at(k * width, 0), at((k + 1) * width, 0), at((k + 1) * width, h), at(k * width, h)]
        for k, h in enumerate(heights)
    }
    far = number * width + 20.0
    feet = [at(k * width, 0) for k in range(number, -1, -1)]
    drawn = _Drawn(
        [at(-3 * width, -25), at(far, -25), at(far, 0), *feet, at(-3 * width, 0)], blocks,
        [(PLANE, at(0, 0), at(number * width, 0))], dip + rng.uniform(3, 16), planes=(), traits=[kind],
    )  # fmt: skip
    height = float(heights[0])
    if kind == "slides":
        drawn.planes = (PLANE,)
        _strength(rng, drawn, 5e3 * height)
    elif kind == "anchored":
        _anchor(rng, drawn, at(0.5 * width, rng.uniform(0.6, 0.9) * height), "column 1", dip, 0.45)
    elif kind == "glued":
        weight = DENSITY * GRAVITY * width * height
        pull = weight * (3 * height * math.sin(slope) / width - math.cos(slope))
        factor = rng.uniform(1.1, 2.5)
        drawn.tension, drawn.cohesion, drawn.friction = factor * pull / width, 1e6, 45.0
        drawn.limit = factor
        drawn.traits.append("cohesion")
    return drawn


def _base(before: list[tuple[float, float]], under: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The base under the blocks, whose lower side is ``under`` from the toe to the crest, and ``before`` the toe."""
    (x, y), low = under[-1], before[0][1]
    return [before[0], (x + 60.0, low), (x + 60.0, y), *under[::-1], *before[:0:-1]]


def _inside(polygon: list[tuple[float, float]]) -> tuple[float, float]:
    return tuple(np.mean(polygon, axis=0).tolist())


def _strength(rng, drawn: _Drawn, cohesion: float) -> None:
    drawn.friction = float(np.clip(drawn.friction, 12, 55))
    if rng.random() < 0.5:
        drawn.cohesion = float(cohesion * rng.uniform(0.2, 1.0))
        drawn.friction = max(12.0, drawn.friction - rng.uniform(0, 10))
        drawn.traits.append("cohesion")
        drawn.same_law = bool(rng.random() < 0.5)
        if drawn.same_law:
            drawn.traits.append("one law")


def _anchor(rng, drawn: _Drawn, start, block: str, dip: float, share: float | None = None) -> None:
    """An anchor from ``start`` into the base behind, 5 to 25° below the horizontal."""
    polygon = np.array(drawn.blocks[block])
    weight = DENSITY * GRAVITY * abs(float(np.sum(
        polygon[:, 0] * np.roll(polygon[:, 1], -1) - polygon[:, 1] * np.roll(polygon[:, 0], -1)))) / 2  # fmt: skip
    down, length = math.radians(rng.uniform(5, 25)), float(np.ptp(polygon[:, 0])) + 15.0
    start = tuple(np.asarray(start, float).tolist())
    end = (start[0] + length * math.cos(down), start[1] - length * math.sin(down))
    strength = float(weight * (share or rng.uniform(0.05, 0.25)))
    tension = float(rng.choice([0.0, 0.5, 0.9])) * strength
    stretch = 10 ** rng.uniform(-4, -1.2)
    drawn.bolts.append(
        {
            "start": list(start), "end": list(end), "stiffness_n_per_m": float((strength - tension) / stretch),
            "pretension_n_per_m": tension, "yield_force_n_per_m": strength,
        }
    )  # fmt: skip
    drawn.traits.append("anchor")


_MAKERS = {
    "planar": _planar,
    "stepped": _stepped,
    "bilinear": lambda rng: _two_blocks(rng, 0.0),
    "wedge": lambda rng: _two_blocks(rng, float(rng.choice([-1.0, 1.0]) * rng.uniform(5, 22))),
    "toppling": _toppling,
}


def problem(slope: FactorSlope) -> Problem:
    """The problem of the scene of ``slope``."""
    return problem_of(slope.scene)
