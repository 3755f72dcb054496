"""Small scenes of blocks, each with a reference independent of the block solver, for the maps of `stability`.

A scene takes the two values of its cell and returns its `Outcome`; ValueError and NotConverged are refusals.
"""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass, field

import numpy as np

from ... import dda
from ...model import Blocks, DdaSettings, History, JointLaw, Loads, Material, State
from ...reference.blocks import block_motion

GRAVITY = 9.81
WEIGHT = Loads(gravity=History.constant([0.0, -GRAVITY]))


@dataclass(frozen=True)
class Outcome:
    """Outcome of a scene.

    error         in the measure of its map
    penetration   in block sizes
    gain          of mechanical energy, relative to the initial energy
    drift         of energy, the larger of that gain and the residual of the balance, relative to the energy converted
    cuts          of steps
    condition     number, and ``residual`` of the equations; nan: none
    """

    error: float
    penetration: float = math.nan
    gain: float = math.nan
    drift: float = math.nan
    cuts: float = math.nan
    condition: float = math.nan
    residual: float = math.nan


def rectangle(x0: float, y0: float, x1: float, y1: float) -> np.ndarray:
    """(4, 2) corners, counter-clockwise."""
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], dtype=float)


def turned(polygon: np.ndarray, angle: float) -> np.ndarray:
    """``polygon`` rotated about the origin by ``angle``, rad."""
    c, s = math.cos(angle), math.sin(angle)
    return polygon @ np.array([[c, s], [-s, c]])


def system_of(
    polygons, fixed, friction_deg: float, materials=None, material=None, order: int = 1, **settings
) -> dda.BlockSystem:
    """The blocks ``polygons``, of this ``order`` where they are not ``fixed``."""
    orders = None if order == 1 else [1 if held else order for held in fixed]
    blocks = Blocks.from_polygons(polygons, fixed=fixed, material=material, order=orders)
    joint = JointLaw("joint", friction_angle=math.radians(friction_deg))
    rock = Material("rock", 10e9, 0.25, density=2600.0)
    return dda.BlockSystem(blocks, materials or [rock], [joint], settings=DdaSettings(**settings))


@dataclass
class Watch:
    """Worst penetration, energy gain, the run's balance, and cut steps of a moving system."""

    system: dda.BlockSystem
    gain: float = 0.0
    penetration: float = 0.0
    cuts: int = 0
    # Its warnings do not apply to a run of blocks alone.
    budget: dda.EnergyBudget = field(default_factory=lambda: dda.EnergyBudget(warned=math.inf))
    _began: np.ndarray | None = None
    _scale: float = 1.0

    def __call__(self, result: dda.StepResult) -> None:
        statistics = result.statistics
        self.penetration = max(self.penetration, statistics["worst_penetration"])
        self.cuts += int(statistics["step_cuts"])
        self.budget = self.budget.after(result.energy, result.state.time)

    def run(self, state: State, loads: Loads, end: float, dt: float, max_steps: int = 10**6) -> State:
        """Run until ``end`` or for ``max_steps`` steps, recording mechanical energy."""
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
        # Relative to the initial position: far from the origin the sum would lose digits.
        self._began = moments[free, 1:3] if self._began is None else self._began
        potential = -float(weight @ ((moments[free, 1:3] - self._began) @ g))
        size = math.sqrt(float(areas[free].mean()))
        self._scale = float(weight.sum()) * (np.hypot(*g) * size) + statistics["kinetic_energy"] + 1e-300
        parts = ("kinetic_energy", "elastic_energy", "contact_energy")
        return potential + sum(statistics[name] for name in parts)

    def outcome(self, error: float, size: float = 1.0) -> Outcome:
        drift = max(self.gain, abs(self.budget.left_over()))
        return Outcome(float(error), self.penetration / size, self.gain, drift, self.cuts)


def _inclined(friction: float, side: float, offset=0.0, **settings):
    slope = math.radians(30)
    length = max(20.0, 20 * side)
    polygons = [rectangle(-length, -length / 20, length, 0), rectangle(0.2 * length, 0, 0.2 * length + side, side)]
    system = system_of(
        [turned(p, slope) + offset for p in polygons], [True, False], friction, dynamic_factor=1.0,
        max_displacement_ratio=0.05, **settings,
    )  # fmt: skip
    return system, -np.array([math.cos(slope), math.sin(slope)])


def _slid(system, down, end: float, dt: float, max_steps: int, watch: Watch) -> tuple[float, float]:
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


def incline(friction: float, most: int, penalty: float, dt: float, order: int = 1) -> Outcome:
    """Half a second, or ``most`` steps."""
    modulus = Material("rock", 10e9, 0.25).plane_modulus
    system, down = _inclined(friction, 1.0, normal_penalty=penalty * modulus, order=order)
    watch = Watch(system)
    slid, seconds = _slid(system, down, 0.5, dt, most, watch)
    return watch.outcome(_off_travel(system, slid, seconds, friction, 1.0))


def small(most: int, side: float, dt: float) -> Outcome:
    """Displacement of a square of this side that slides down a slope."""
    slope = math.radians(30)
    polygons = [turned(p, slope) for p in (rectangle(-60, -10, 60, 0), rectangle(4, 0, 4 + side, side))]
    system = system_of(polygons, [True, False], 15.0, dynamic_factor=1.0)
    watch = Watch(system)
    slid, seconds = _slid(system, -np.array([math.cos(slope), math.sin(slope)]), 0.5, dt, most, watch)
    return watch.outcome(_off_travel(system, slid, seconds, 15.0, side), side)


def far(most: int, offset: float, dt: float) -> Outcome:
    """The same at this distance from the origin of coordinates, compared with the displacement at the origin."""
    watch, way = _slide_from(offset, dt, most)
    return watch.outcome(abs(way / _slide_from(0.0, dt, most)[1] - 1))


@functools.cache
def _slide_from(offset: float, dt: float, most: int) -> tuple[Watch, float]:
    """Displacement of a block on an incline at this distance from the origin, in 0.3 s or ``most`` steps."""
    system, down = _inclined(15.0, 1.0, np.array([offset, -offset]))
    watch = Watch(system)
    return watch, _slid(system, down, 0.3, dt, most, watch)[0]


def carried(system: dda.BlockSystem, loads: Loads = WEIGHT) -> tuple[np.ndarray, Watch]:
    """Contact forces and moment on each block in static equilibrium. Raises NotConverged if there is none."""
    watch = Watch(system)
    rest = dda.equilibrium(
        system, State.at_rest(system.blocks), loads, tolerance=1e-9, watch=lambda result, row: watch(result)
    )
    if not rest.converged:
        raise dda.NotConverged(rest.reason)
    centroid = rest.result.forces.centroid
    return dda.contact_resultants(rest.result.contacts, system.blocks.n_blocks, centroid), watch


def weights_off(system: dda.BlockSystem, total: np.ndarray, gravity: float = GRAVITY) -> float:
    """Largest difference between a free block's contact forces and its weight, over the total weight."""
    weight = system.density * system.blocks.areas() * gravity
    free = ~system.blocks.fixed
    off = np.hypot(total[free, 0], total[free, 1] - weight[free])
    base = abs(total[~free, 1].sum() + weight[free].sum())
    return float(max(off.max(), base) / weight[free].sum())


def column(stiffness: float, density: float, order: int = 1) -> Outcome:
    """The weight that a column of two different blocks transmits to the ground."""
    light, heavy = (
        Material("below", 10e9, 0.25, density=2600.0),
        Material("above", 10e9 * stiffness, 0.25, density=2600.0 * density),
    )
    polygons = [rectangle(-1, -1, 2, 0), rectangle(0, 0, 1, 1), rectangle(0, 1, 1, 2)]
    system = system_of(polygons, [True, False, False], 30.0, [light, heavy], [0, 0, 1], order)
    # Limited so that the weight strains the softer block by no more than 1e-4.
    gravity = 1e-4 * 10e9 * min(1.0, stiffness) / (2600.0 * max(1.0, density))
    total, watch = carried(system, Loads(gravity=History.constant([0.0, -gravity])))
    return watch.outcome(weights_off(system, total, gravity))


def sliver(aspect: float, wedge: float, order: int = 1) -> Outcome:
    """The weight of slender blocks, or needles point to point (``wedge``)."""
    h = 1.0 / aspect
    if wedge:
        # Two needles point to point make a level layer.
        between = [np.array([[0, 0], [1, 0], [1, h]], dtype=float), np.array([[0, 0], [1, h], [0, h]], dtype=float)]
    else:
        between = [rectangle(0, 0, 1, h)]
    polygons = [rectangle(-1, -1, 2, 0), *between, rectangle(0, h, 1, 1 + h)]
    system = system_of(polygons, [True] + [False] * (len(polygons) - 1), 40.0, order=order)
    total, watch = carried(system)
    return watch.outcome(weights_off(system, total), h)


def grid_of_squares(side: float, bond: float) -> Outcome:
    """The weight of a wall of squares, in running bond if ``bond``."""
    n = int(side)
    squares = []
    for row in range(n):
        # In running bond every second course ends in halves: a brick that overhangs by half is about to topple.
        ends = [0, *np.arange(0.5, n), n] if bond and row % 2 else range(n + 1)
        squares += [rectangle(left, row, right, row + 1) for left, right in itertools.pairwise(ends)]
    polygons = [rectangle(-1, -1, n + 1, 0), *squares]
    system = system_of(polygons, [True] + [False] * len(squares), 35.0)
    total, watch = carried(system)
    return watch.outcome(weights_off(system, total))


def start(most: int, gap: float, dt: float) -> Outcome:
    """A block released above the ground with this gap."""
    polygons = [rectangle(-1, -1, 2, 0), rectangle(0, gap, 1, 1 + gap)]
    system = system_of(polygons, [True, False], 30.0, dynamic_factor=1.0, max_displacement_ratio=0.05)
    watch = Watch(system)
    state = watch.run(State.at_rest(system.blocks), WEIGHT, 1.0, dt, most)
    height = float(state.vertices[4:, 1].mean()) - 0.5
    return watch.outcome(abs(height))


def impact(speed: float, dt: float) -> Outcome:
    """Two blocks that collide at this speed: momentum and energy."""
    polygons = [rectangle(0, 0, 1, 1), rectangle(1.001, 0, 2.001, 1)]
    system = system_of(polygons, [False, False], 30.0, dynamic_factor=1.0, max_displacement_ratio=0.05)
    state = State.at_rest(system.blocks)
    state.velocity[0, 0], state.velocity[1, 0] = speed, -0.5 * speed
    watch = Watch(system)
    # They meet after 7e-4/speed seconds, and separate a millisecond later.
    end = watch.run(state, Loads(), 0.01 / speed + 20 * dt, dt, 1000)
    mass = system.density * system.blocks.areas()
    momentum = abs(mass @ (end.velocity[:, 0] - state.velocity[:, 0])) / (mass @ np.abs(state.velocity[:, 0]))
    return watch.outcome(max(momentum, watch.gain))


def debris(seconds: float, count: float) -> Outcome:
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
    system = system_of(
        polygons, [True] * 3 + [False] * int(count), 30.0, dynamic_factor=1.0, max_displacement_ratio=0.05
    )
    state = State.at_rest(system.blocks)
    state.velocity[3:, 2] = rng.uniform(-10, 10, int(count))
    watch = Watch(system)
    end = watch.run(state, WEIGHT, seconds, 5e-3)
    centres = system.blocks.mean_vertices(end.vertices)[3:]
    lost = float(np.mean((centres[:, 1] < 0) | (centres[:, 0] < 0) | (centres[:, 0] > width)))
    return watch.outcome(max(lost, watch.gain))
