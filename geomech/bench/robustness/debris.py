"""Falling, spinning and piling blocks of any shape, for any duration: an avalanche, and a rotating drum.

There is no closed form; the invariants of every step are checked: no overlap of blocks, constant areas of blocks, and
energy from weight and the rotation of the drum only.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ... import dda
from ...dda.contact_detection.initial_overlap import deepest_overlap
from ...dda.kinematics.simplex_integration import block_moments
from ...model import BlockMotion, Blocks, DdaSettings, History, JointLaw, Loads, Material, State
from ..figures import Measured

WEIGHT = History.constant([0.0, -9.81])
#: Avalanche: inclination, rad; m, lengths of the slope and of the ground in front of it.
DIP, LENGTH, GROUND = np.radians(35), 60.0, 60.0
#: rad/s: rotation of the drum.
SPIN = 0.3
#: Longest step, s; overlaps are checked every so many steps.
STEP, LOOKED_FOR = 1e-2, 20


def _polygon(rng: np.random.Generator) -> np.ndarray:
    """A polygon of three to seven corners around the origin, half a metre to a metre across."""
    corners = rng.integers(3, 8)
    angle = np.sort(2 * np.pi * (np.arange(corners) + 0.6 * rng.random(corners)) / corners)
    return 0.45 * rng.uniform(0.7, 1.0) * np.column_stack([np.cos(angle), np.sin(angle)])


def _system(polygons: list, n: int) -> dda.BlockSystem:
    """The last ``n`` of ``polygons`` are free."""
    fixed = [True] * (len(polygons) - n) + [False] * n
    return dda.BlockSystem(
        Blocks.from_polygons(polygons, fixed=fixed), [Material("rock", 10e9, 0.25, density=2600.0)],
        [JointLaw("joint", friction_angle=np.radians(30))],
        settings=DdaSettings(dynamic_factor=1.0, max_displacement_ratio=0.05),
    )  # fmt: skip


def _dipping(points) -> np.ndarray:
    c, s = np.cos(DIP), -np.sin(DIP)
    return np.asarray(points, float) @ np.array([[c, s], [-s, c]])


def avalanche(n: int) -> tuple[dda.BlockSystem, Loads]:
    """``n`` blocks on a slope above level ground that ends at a wall."""
    rng = np.random.default_rng(3)
    crest, foot = _dipping([[-2.0, 0.0], [LENGTH, 0.0]])
    end = foot[0] + GROUND
    ground = [
        _dipping([[-2, -1], [LENGTH, -1], [LENGTH, 0], [-2, 0]]),
        _dipping([[-3, -1], [-2, -1], [-2, 12], [-3, 12]]),
        np.array([_dipping([[LENGTH, -1.0]])[0], [end, foot[1] - 1.0], [end, foot[1]], foot]),
        np.array([[end, foot[1] - 1], [end + 1, foot[1] - 1], [end + 1, crest[1]], [end, crest[1]]]),
    ]
    blocks = [_dipping(_polygon(rng) + [0.5 + k % 20, 0.5 + k // 20]) for k in range(n)]
    return _system(ground + blocks, n), Loads(gravity=WEIGHT)


def drum(n: int, sides: int = 36) -> tuple[dda.BlockSystem, Loads]:
    """``n`` blocks in a ring of ``sides`` sides that rotates about its axis, the origin; they fill a third of it."""
    rng = np.random.default_rng(5)
    radius = 0.75 + 0.66 * np.sqrt(n)
    angle = 2 * np.pi * np.arange(sides) / sides
    rim = np.column_stack([np.cos(angle), np.sin(angle)])
    grid = np.arange(-np.floor(radius), radius)
    reach = radius * np.cos(np.pi / sides)
    spots = [[x, y] for y in grid for x in grid if np.hypot(abs(x) + 0.5, abs(y) + 0.5) < reach]
    ring = [(radius + 0.5) * rim, radius * rim[::-1]]
    turn = BlockMotion(0, History.constant([0.0, 0.0, SPIN]), kind="velocity")
    return _system([ring] + [[_polygon(rng) + spot] for spot in spots[:n]], n), Loads(
        gravity=WEIGHT, block_motions=(turn,)
    )


@dataclass
class Followed:
    """Results of a run: the last ``state``, the energy ``budget``, the deepest contact and overlap over √area of the
    smallest block, the largest relative change of a block's area, the largest residual of the equations, and the
    numbers of steps and cuts."""

    state: State
    budget: dda.EnergyBudget
    penetration: float = 0.0
    overlap: float = 0.0
    strain: float = 0.0
    unbalanced: float = 0.0
    steps: int = 0
    cuts: int = 0

    @property
    def gained(self) -> float:
        """Energy created by updating the geometry and by overlaps, relative to the energy converted."""
        return max(0.0, self.budget.residual + self.budget.overlap) / self.budget.turnover


def follow(system: dda.BlockSystem, loads: Loads, seconds: float) -> Followed:
    """A run from rest. Raises `NotConverged` as steps do."""
    blocks, free = system.blocks, ~system.blocks.fixed
    areas = blocks.areas()
    size = float(np.sqrt(areas[free].min()))
    seen = Followed(State.at_rest(blocks), dda.EnergyBudget())
    while seen.state.time < seconds * (1 - 1e-12):
        result = system.step(seen.state, loads, min(STEP, seconds - seen.state.time))
        found = result.statistics
        seen.state, seen.budget = result.state, seen.budget.after(result.energy, result.state.time)
        seen.steps, seen.cuts = seen.steps + 1, seen.cuts + int(found["step_cuts"])
        seen.penetration = max(seen.penetration, found["worst_penetration"] / size)
        seen.unbalanced = max(seen.unbalanced, found["unbalanced"])
        if seen.steps % LOOKED_FOR == 0:
            moments = block_moments(seen.state.vertices, blocks.next_vertex, blocks.vertex_start)
            seen.overlap = max(seen.overlap, deepest_overlap(blocks, seen.state.vertices, moments)[3])
            seen.strain = max(seen.strain, float(np.abs(moments[free, 0] / areas[free] - 1).max()))
    return seen


SCENES: dict[str, Callable[[int], tuple[dda.BlockSystem, Loads]]] = {"avalanche": avalanche, "drum": drum}


def measure(quick: bool = False, seconds: float | None = None) -> Measured:
    """A hundred blocks in each scene for 1.5 s, or ``seconds``; ``quick``: 25 for 0.6 s."""
    n, seconds = (25, seconds or 0.6) if quick else (100, seconds or 1.5)
    lines = [
        f"{n} blocks for {seconds:g} s".ljust(22)
        + "steps (cut)    penetration  overlap    strain   from nowhere    moving  processor"
    ]
    errors = {}
    for name, scene in SCENES.items():
        began = time.process_time()
        seen = follow(*scene(n), seconds)
        spent = time.process_time() - began
        moving = seen.budget.last.kinetic / seen.budget.turnover
        lines.append(
            f"{name:<20} {seen.steps:>7} ({seen.cuts:>4}) {seen.penetration:>14.1e} {seen.overlap:>8.1e} "
            f"{seen.strain:>9.1e} {seen.gained:>14.1e} {moving:>9.1e} {spent:>8.0f} s"
        )
        errors[f"{name}: overlap over block"] = seen.overlap
    lines.append("penetration and overlap over √area of the smallest block; energies over all energy converted")
    return Measured.of("\n".join(lines), errors=errors)
