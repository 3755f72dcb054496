"""Where the block solver stays right: maps over penalty, time step, contrasts, slivers, offsets, overlaps, speeds, debris.

Every cell is a small scene with a reference that was not computed with it: right (within the bound said), refused with a
reason, reported (beyond the bound, and a warning says so), or wrong. The bounds leave room for true elasticity only.
"""

from __future__ import annotations

import itertools
import json
import logging
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np

from .. import dda
from ..model import Blocks, DdaSettings, History, JointLaw, Loads, Material, State
from ..reference import block_motion

GRAVITY = 9.81
WEIGHT = Loads(gravity=History.constant([0.0, -GRAVITY]))
RIGHT, REPORTED, REFUSED, WRONG = "right", "reported", "refused", "wrong"


@dataclass(frozen=True)
class Outcome:
    """What a scene did: ``error`` in the measure that its map states; ``penetration`` in block sizes; ``gain`` of mechanical
    energy over all there was; ``cuts`` of steps."""

    error: float
    penetration: float = 0.0
    gain: float = 0.0
    cuts: int = 0


@dataclass(frozen=True)
class Cell:
    map: str
    row: str
    column: str
    verdict: str
    error: float
    penetration: float
    gain: float
    cuts: int
    reason: str = ""


@dataclass(frozen=True)
class Map:
    """A grid of scenes: ``scene(row, column)`` for every pair of values; right where its error is below ``bound``."""

    title: str
    measure: str
    row_name: str
    rows: Sequence[float]
    column_name: str
    columns: Sequence[float]
    bound: float
    scene: Callable[[float, float], Outcome]

    def cells(self) -> Iterator[Cell]:
        for row in self.rows:
            for column in self.columns:
                verdict, found, reason = self._judged(row, column)
                yield Cell(self.title, f"{row:g}", f"{column:g}", verdict, **asdict(found), reason=reason)

    def _judged(self, row: float, column: float) -> tuple[str, Outcome, str]:
        heard = _Warnings()
        log = logging.getLogger("geomech")
        log.addHandler(heard)
        try:
            found = self.scene(row, column)
        except (ValueError, dda.NotConverged) as refusal:
            return REFUSED, Outcome(math.nan, math.nan, math.nan), str(refusal)
        finally:
            log.removeHandler(heard)
        if found.error <= self.bound:
            return RIGHT, found, ""
        return (REPORTED, found, heard.first) if heard.first else (WRONG, found, "")


class _Warnings(logging.Handler):
    """Keeps the first warning it hears."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.first = ""

    def emit(self, record: logging.LogRecord) -> None:
        self.first = self.first or record.getMessage()


def measure(quick: bool = False) -> str:
    """The maps as text; JSON and a picture go to outputs/stability. ``quick`` takes every other value."""
    from ..render.stability_map import draw

    maps = list(_maps(quick))
    lines, every = [], []
    for grid in maps:
        cells = list(grid.cells())
        every += cells
        lines += [*_table(grid, cells), ""]
    counts = Counter(cell.verdict for cell in every)
    lines.append("  ".join(f"{counts[verdict]} {verdict}" for verdict in (RIGHT, REPORTED, REFUSED, WRONG)))
    folder = Path("outputs/stability")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "stability.json").write_text(json.dumps([asdict(cell) for cell in every], indent=1), encoding="utf-8")
    draw(maps, every, folder / "stability.png")
    lines.append(f"{folder}/stability.json, {folder}/stability.png")
    return "\n".join(lines)


def _table(grid: Map, cells: Sequence[Cell]) -> Iterator[str]:
    yield f"{grid.title}: {grid.measure} (right below {grid.bound:g}); {grid.row_name} down, {grid.column_name} across"
    yield " " * 10 + "".join(f"{value:>11g}" for value in grid.columns)
    for k, row in enumerate(grid.rows):
        mine = cells[k * len(grid.columns) : (k + 1) * len(grid.columns)]
        marks = (
            f"{c.error:.1e}" + ("!" if c.verdict == WRONG else "") if c.verdict != REFUSED else "refused" for c in mine
        )
        yield f"{row:>10g}" + "".join(f"{mark:>11}" for mark in marks)
    for verdict in (REFUSED, REPORTED):
        for reason in sorted({c.reason for c in cells if c.verdict == verdict})[:2]:
            yield f"    {verdict}: {reason}"
    worst = max((c.penetration for c in cells if c.verdict != REFUSED), default=0.0)
    gain = max((c.gain for c in cells if c.verdict != REFUSED), default=0.0)
    yield f"    worst penetration {worst:.1e} of a block, energy gain {gain:.1e}, {sum(c.cuts for c in cells)} steps cut"


def _maps(quick: bool) -> Iterator[Map]:
    def some(*values: float) -> tuple[float, ...]:
        return values[::2] if quick else values

    penalties, steps = some(1, 10, 40, 100, 1e3, 1e4), some(1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1, 10)
    ratios = some(1e-6, 1e-4, 1e-2, 1, 1e2, 1e4, 1e6)
    off = "travel off the rigid block's, over the travel and three elastic shortenings"
    yield Map("sliding, 15° on 30°", off, "penalty / E'", penalties, "dt, s", steps, 5e-2, partial(_incline, 15.0))
    yield Map("sticking, 35° on 30°", off, "penalty / E'", penalties, "dt, s", steps, 1.0, partial(_incline, 35.0))
    load = "contact forces of a column off its weight"
    yield Map("contrast in a column", load, "stiffness", ratios, "density", ratios, 1e-6, _column)
    slivers = some(1, 10, 100, 1000, 1e4)
    yield Map("slivers in a column", load, "aspect", slivers, "0 plate, 1 wedge", (0, 1), 1e-4, _sliver)
    yield Map(
        "size contrast, sliding", off, "small block, m", some(1e-3, 1e-2, 0.1, 1), "dt, s", (1e-3, 1e-2), 1e-2, _small
    )
    yield Map(
        "grid of squares",
        load,
        "blocks a side",
        (2, 4, 6) if quick else (2, 4, 6, 10),
        "0 stacked, 1 in bond",
        (0, 1),
        1e-6,
        _grid,
    )
    starts = (-1e-2, -1e-4, -1e-6, 0, 1e-6, 1e-4, 1e-2)
    yield Map(
        "overlap and gap at the start",
        "rest off the column's height, over the block",
        "gap / size",
        starts,
        "dt, s",
        (1e-3, 1e-2),
        1e-3,
        _start,
    )
    yield Map(
        "far from the origin",
        "travel off the one at the origin",
        "offset, m",
        some(0, 1e3, 1e5, 1e6, 1e7),
        "dt, s",
        (1e-3, 1e-2),
        1e-3,
        _far,
    )
    yield Map(
        "head-on impact",
        "momentum off, energy gained",
        "speed, m/s",
        some(0.1, 1, 10, 100, 1000),
        "dt, s",
        (1e-5, 1e-3),
        1e-6,
        _impact,
    )
    yield Map(
        "debris of spinning blocks",
        "energy gained, or left behind the floor",
        "seconds",
        (2,) if quick else (2, 20),
        "blocks",
        (12,) if quick else (12, 100),
        1e-3,
        _debris,
    )


# -- scenes ------------------------------------------------------------------------------------------------------


def rectangle(x0: float, y0: float, x1: float, y1: float) -> np.ndarray:
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], dtype=float)


def turned(polygon: np.ndarray, angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return polygon @ np.array([[c, s], [-s, c]])


def _system(polygons, fixed, friction_deg: float, materials=None, material=None, **settings) -> dda.BlockSystem:
    blocks = Blocks.from_polygons(polygons, fixed=fixed, material=material)
    joint = JointLaw("joint", friction_angle=math.radians(friction_deg))
    rock = Material("rock", 10e9, 0.25, density=2600.0)
    return dda.BlockSystem(blocks, materials or [rock], [joint], settings=DdaSettings(**settings))


@dataclass
class _Watch:
    """Worst penetration, energy gained, steps cut while a system moves."""

    system: dda.BlockSystem
    gain: float = 0.0
    penetration: float = 0.0
    cuts: int = 0
    _began: np.ndarray | None = None
    _scale: float = 1.0

    def __call__(self, result: dda.StepResult) -> None:
        statistics = result.statistics
        self.penetration = max(self.penetration, statistics["worst_penetration"])
        self.cuts += int(statistics["step_cuts"])

    def run(self, state: State, loads: Loads, end: float, dt: float, max_steps: int = 10**6) -> State:
        """Until ``end`` or for ``max_steps`` steps, mechanical energy watched."""
        before = None
        for _ in range(max_steps):
            if state.time >= end * (1 - 1e-12):
                break
            result = self.system.step(state, loads, dt)
            self(result)
            state = result.state
            energy = self._energy(state, result.statistics, loads)
            if before is not None:
                self.gain = max(self.gain, (energy - before) / self._scale)
                before = min(before, energy)
            else:
                before = energy
        return state

    def _energy(self, state: State, statistics: dict[str, float], loads: Loads) -> float:
        areas = self.system.blocks.areas(state.vertices)
        moments = dda.block_moments(
            np.ascontiguousarray(state.vertices), self.system.blocks.next_vertex, self.system.blocks.vertex_start
        )
        free = ~self.system.blocks.fixed
        weight = (self.system.density * areas)[free]
        g = loads.gravity.at(state.time)
        # From where blocks began: far from the origin the sum would have lost its digits.
        self._began = moments[free, 1:3] if self._began is None else self._began
        potential = -float(weight @ ((moments[free, 1:3] - self._began) @ g))
        size = math.sqrt(float(areas[free].mean()))
        self._scale = float(weight.sum()) * (np.hypot(*g) * size) + statistics["kinetic_energy"] + 1e-300
        parts = ("kinetic_energy", "elastic_energy", "contact_energy")
        return potential + sum(statistics[name] for name in parts)

    def outcome(self, error: float, size: float = 1.0) -> Outcome:
        return Outcome(float(error), self.penetration / size, self.gain, self.cuts)


def _inclined(friction: float, side: float, offset=0.0, **settings):
    slope = math.radians(30)
    length = max(20.0, 20 * side)
    polygons = [rectangle(-length, -length / 20, length, 0), rectangle(0.2 * length, 0, 0.2 * length + side, side)]
    system = _system(
        [turned(p, slope) + offset for p in polygons], [True, False], friction, dynamic_factor=1.0,
        max_displacement_ratio=0.05, **settings,
    )  # fmt: skip
    return system, -np.array([math.cos(slope), math.sin(slope)])


def _slid(system, down, end: float, dt: float, max_steps: int, watch: _Watch) -> tuple[float, float]:
    """(metres slid, seconds)."""
    state = watch.run(State.at_rest(system.blocks), WEIGHT, end, dt, max_steps)
    return float((state.vertices - system.blocks.vertices)[4:].mean(axis=0) @ down), state.time


def _off_travel(system, slid: float, seconds: float, friction: float, side: float) -> float:
    acceleration = block_motion.incline_acceleration(math.radians(30), math.radians(friction))
    exact = 0.5 * acceleration * seconds**2
    rock = system.materials[0]
    shortening = rock.density * GRAVITY * side**2 / rock.plane_modulus
    penalty = system.settings.normal_penalty or 40 * rock.plane_modulus
    sunk = rock.density * GRAVITY * side**2 / penalty
    return abs(slid - exact) / (exact + 3 * (shortening + sunk))


def _incline(friction: float, penalty: float, dt: float) -> Outcome:
    modulus = Material("rock", 10e9, 0.25).plane_modulus
    system, down = _inclined(friction, 1.0, normal_penalty=penalty * modulus)
    watch = _Watch(system)
    slid, seconds = _slid(system, down, 0.5, dt, 1000, watch)
    return watch.outcome(_off_travel(system, slid, seconds, friction, 1.0))


def _small(side: float, dt: float) -> Outcome:
    slope = math.radians(30)
    polygons = [turned(p, slope) for p in (rectangle(-60, -10, 60, 0), rectangle(4, 0, 4 + side, side))]
    system = _system(polygons, [True, False], 15.0, dynamic_factor=1.0)
    watch = _Watch(system)
    slid, seconds = _slid(system, -np.array([math.cos(slope), math.sin(slope)]), 0.5, dt, 1000, watch)
    return watch.outcome(_off_travel(system, slid, seconds, 15.0, side), side)


def _far(offset: float, dt: float) -> Outcome:
    here, down = _inclined(15.0, 1.0)
    there, _ = _inclined(15.0, 1.0, np.array([offset, -offset]))
    watch = _Watch(there)
    near, _ = _slid(here, down, 0.3, dt, 1000, _Watch(here))
    far, _ = _slid(there, down, 0.3, dt, 1000, watch)
    return watch.outcome(abs(far / near - 1))


def _carried(system: dda.BlockSystem, loads: Loads = WEIGHT) -> tuple[np.ndarray, _Watch]:
    """Contact forces and moment on each block in static equilibrium. Raises NotConverged where there is none."""
    watch = _Watch(system)
    rest = dda.equilibrium(
        system, State.at_rest(system.blocks), loads, tolerance=1e-9, watch=lambda result, row: watch(result)
    )
    if not rest.converged:
        raise dda.NotConverged(rest.reason)
    centroid = rest.result.forces.centroid
    return dda.contact_resultants(rest.result.contacts, system.blocks.n_blocks, centroid), watch


def _weights_off(system: dda.BlockSystem, total: np.ndarray, gravity: float = GRAVITY) -> float:
    """Largest difference of a free block's contact forces from its weight, over all the weight."""
    weight = system.density * system.blocks.areas() * gravity
    free = ~system.blocks.fixed
    off = np.hypot(total[free, 0], total[free, 1] - weight[free])
    base = abs(total[~free, 1].sum() + weight[free].sum())
    return float(max(off.max(), base) / weight[free].sum())


def _column(stiffness: float, density: float) -> Outcome:
    light, heavy = (
        Material("below", 10e9, 0.25, density=2600.0),
        Material("above", 10e9 * stiffness, 0.25, density=2600.0 * density),
    )
    polygons = [rectangle(-1, -1, 2, 0), rectangle(0, 0, 1, 1), rectangle(0, 1, 1, 2)]
    system = _system(polygons, [True, False, False], 30.0, [light, heavy], [0, 0, 1])
    # No more weight than strains the softer block by 1e-4.
    gravity = 1e-4 * 10e9 * min(1.0, stiffness) / (2600.0 * max(1.0, density))
    total, watch = _carried(system, Loads(gravity=History.constant([0.0, -gravity])))
    return watch.outcome(_weights_off(system, total, gravity))


def _sliver(aspect: float, wedge: float) -> Outcome:
    h = 1.0 / aspect
    if wedge:
        # Two needles point to point make a level layer.
        middle = [np.array([[0, 0], [1, 0], [1, h]], dtype=float), np.array([[0, 0], [1, h], [0, h]], dtype=float)]
    else:
        middle = [rectangle(0, 0, 1, h)]
    polygons = [rectangle(-1, -1, 2, 0), *middle, rectangle(0, h, 1, 1 + h)]
    system = _system(polygons, [True] + [False] * (len(polygons) - 1), 40.0)
    total, watch = _carried(system)
    return watch.outcome(_weights_off(system, total), h)


def _grid(side: float, bond: float) -> Outcome:
    n = int(side)
    squares = []
    for row in range(n):
        # In bond, every other course ends in halves: a brick that overhangs by half is about to topple.
        ends = [0, *np.arange(0.5, n), n] if bond and row % 2 else range(n + 1)
        squares += [rectangle(left, row, right, row + 1) for left, right in itertools.pairwise(ends)]
    polygons = [rectangle(-1, -1, n + 1, 0), *squares]
    system = _system(polygons, [True] + [False] * len(squares), 35.0)
    total, watch = _carried(system)
    return watch.outcome(_weights_off(system, total))


def _start(gap: float, dt: float) -> Outcome:
    polygons = [rectangle(-1, -1, 2, 0), rectangle(0, gap, 1, 1 + gap)]
    system = _system(polygons, [True, False], 30.0, dynamic_factor=1.0, max_displacement_ratio=0.05)
    watch = _Watch(system)
    state = watch.run(State.at_rest(system.blocks), WEIGHT, 1.0, dt, 2000)
    height = float(state.vertices[4:, 1].mean()) - 0.5
    return watch.outcome(abs(height))


def _impact(speed: float, dt: float) -> Outcome:
    polygons = [rectangle(0, 0, 1, 1), rectangle(1.001, 0, 2.001, 1)]
    system = _system(polygons, [False, False], 30.0, dynamic_factor=1.0, max_displacement_ratio=0.05)
    state = State.at_rest(system.blocks)
    state.velocity[0, 0], state.velocity[1, 0] = speed, -0.5 * speed
    watch = _Watch(system)
    end = watch.run(state, Loads(), 0.01 / speed + 20 * dt, dt, 3000)
    mass = system.density * system.blocks.areas()
    momentum = abs(mass @ (end.velocity[:, 0] - state.velocity[:, 0])) / (mass @ np.abs(state.velocity[:, 0]))
    return watch.outcome(max(momentum, watch.gain))


def _debris(seconds: float, count: float) -> Outcome:
    """Random polygons dropped spinning into a trough."""
    rng = np.random.default_rng(7)
    width = 2.0 * math.ceil(math.sqrt(count))
    polygons = [
        rectangle(-1, -1, width + 1, 0),
        rectangle(-1, 0, 0, 3 * width),
        rectangle(width, 0, width + 1, 3 * width),
    ]
    per_row = int(width / 2)
    for k in range(int(count)):
        corners = rng.integers(3, 8)
        angle = np.sort(2 * math.pi * (np.arange(corners) + 0.6 * rng.random(corners)) / corners)
        centre = np.array([1.0 + 2.0 * (k % per_row), 1.2 + 2.0 * (k // per_row)])
        polygons.append(centre + 0.85 * np.column_stack([np.cos(angle), np.sin(angle)]))
    system = _system(polygons, [True] * 3 + [False] * int(count), 30.0, dynamic_factor=1.0, max_displacement_ratio=0.05)
    state = State.at_rest(system.blocks)
    state.velocity[3:, 2] = rng.uniform(-10, 10, int(count))
    watch = _Watch(system)
    end = watch.run(state, WEIGHT, seconds, 5e-3)
    middle = system.blocks.mean_vertices(end.vertices)[3:]
    lost = float(np.mean((middle[:, 1] < 0) | (middle[:, 0] < 0) | (middle[:, 0] > width)))
    return watch.outcome(max(lost, watch.gain))
