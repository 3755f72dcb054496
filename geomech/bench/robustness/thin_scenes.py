"""Blocks with thin walls, spikes and teeth that must contain what they enclose, at any step: scenes for `stability`.

The reference is topology: no overlaps, and enclosed blocks stay enclosed. The error of a scene is the largest of: the
deepest overlap over half the wall's thickness (fast impacts compress springs), the fraction of the blocks that escaped,
and the energy created by overlaps over a hundredth of the energy converted; the scene is right if it is below 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ... import dda
from ...dda.contact_detection.initial_overlap import deepest_overlap
from ...dda.step_control.overlap_energy import WARNED, Overlap, OverlapWatch
from ...model import Blocks, DdaSettings, JointLaw, Loads, Material, State
from .stability_scenes import WEIGHT, Outcome, rectangle, turned

#: Largest number of steps of a scene.
MOST = 3000


def _ring(x: float, y: float, half: float, wall: float) -> list[np.ndarray]:
    """A square with a square hole: its centre, half its side and the thickness of its walls, m."""
    inner = half - wall
    return [
        rectangle(x - half, y - half, x + half, y + half),
        rectangle(x - inner, y - inner, x + inner, y + inner)[::-1],
    ]


def _hook(width: float, height: float, wall: float) -> np.ndarray:
    """A C that is open to the right, its lower left corner at the origin."""
    w, a, b = wall, width, height
    return np.array([[0, 0], [a, 0], [a, 2 * w], [a - w, 2 * w], [a - w, w], [w, w], [w, b - w], [a - w, b - w],
                     [a - w, b - 2 * w], [a, b - 2 * w], [a, b], [0, b]])  # fmt: skip


def _comb(teeth: int, tooth: float, length: float, pitch: float) -> np.ndarray:
    """A comb with ``teeth`` teeth on a back, whose thickness is that of a tooth's ``length``."""
    top = []
    for k in range(teeth - 1, -1, -1):
        x = k * pitch
        top += [[x + tooth, 0.0], [x + tooth, length], [x, length], [x, 0.0]]
    width = (teeth - 1) * pitch + tooth
    return np.array([[0.0, -length], [width, -length], *top[:-1], [0.0, 0.0]])


def _cog(x: float, y: float, teeth: int, inner: float, outer: float, turn: float) -> np.ndarray:
    angle = np.arange(2 * teeth) * math.pi / teeth + turn
    radius = np.where(np.arange(2 * teeth) % 2, inner, outer)
    return np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)])


class _Steps(NamedTuple):
    """``end`` of a scene and longest step ``dt``, s, and `DdaSettings.max_displacement_ratio`."""

    end: float
    dt: float
    ratio: float


def _run(
    polygons: Sequence, fixed: Sequence[bool], wall: float, steps: _Steps, *,
    rigid: bool = False, loads: Loads = WEIGHT, moving: Callable[[State], None] | None = None,
    out: Callable[[np.ndarray, Blocks], float] = lambda vertices, blocks: 0.0,
) -> Outcome:  # fmt: skip
    """``moving`` gives the state its velocities, ``out`` returns the fraction of the blocks that have escaped."""
    end, dt, ratio = steps
    blocks = Blocks.from_polygons(polygons, fixed=list(fixed))
    rock = Material("rock", 10e9, 0.25, density=2600.0, rigid=rigid)
    settings = DdaSettings(time_step=dt, dynamic_factor=1.0, max_displacement_ratio=ratio)
    joint = JointLaw("joint", friction_angle=math.radians(30))
    system = dda.BlockSystem(blocks, [rock], [joint], settings=settings)
    state, budget, worst, pressed, cuts = State.at_rest(blocks), dda.EnergyBudget(warned=math.inf), 0.0, 0.0, 0
    overlaps = OverlapWatch()
    if moving is not None:
        moving(state)
    for _ in range(MOST):
        if state.time >= end * (1 - 1e-12):
            break
        result = system.step(state, loads, min(dt, end - state.time))
        state, budget = result.state, budget.after(result.energy, result.state.time)
        overlap = None if result.overlap is None else Overlap(*result.overlap)
        overlaps.check(budget, overlap, blocks.names, state.time)
        moments = dda.block_moments(np.ascontiguousarray(state.vertices), blocks.next_vertex, blocks.vertex_start)
        worst = max(worst, deepest_overlap(blocks, np.ascontiguousarray(state.vertices), moments)[2] / (0.5 * wall))
        pressed = max(pressed, result.statistics["worst_penetration"] / wall)
        cuts += int(result.statistics["step_cuts"])
        worst = max(worst, out(state.vertices, blocks))
    return Outcome(max(worst, budget.by_overlap / WARNED), pressed, drift=abs(budget.left_over()), cuts=cuts)


def _outside(x0: float, y0: float, x1: float, y1: float, first: int) -> Callable[[np.ndarray, Blocks], float]:
    """Fraction of the blocks from ``first`` on whose centres are outside a box."""

    def out(vertices: np.ndarray, blocks: Blocks) -> float:
        centre = blocks.mean_vertices(vertices)[first:]
        return float(np.mean((centre < [x0, y0]).any(axis=1) | (centre > [x1, y1]).any(axis=1)))

    return out


def ring(rigid: bool, ratio: float, wall: float, speed: float) -> Outcome:
    """A square of 20 cm that flies back and forth, spinning, in a fixed ring of 2 m."""

    def moving(state: State) -> None:
        state.velocity[1, :3] = speed, 0.37 * speed, 0.5 * speed

    polygons = [_ring(0.0, 0.0, 1.0 + wall, wall), turned(rectangle(-0.1, -0.1, 0.1, 0.1), 0.3)]
    return _run(
        polygons, [True, False], wall, _Steps(5.0 / speed, 0.05, ratio), rigid=rigid, loads=Loads(), moving=moving,
        out=_outside(-1, -1, 1, 1, 1),
    )  # fmt: skip


def nested(ratio: float, wall: float, speed: float) -> Outcome:
    """Three nested rings, the smallest with an initial speed, under gravity."""

    def moving(state: State) -> None:
        state.velocity[2, :3] = speed, 0.5 * speed, speed

    polygons = [_ring(0.0, 0.0, half, wall) for half in (1.5, 1.0, 0.5)]
    return _run(
        polygons, [True, False, False], wall, _Steps(1.0 / max(speed, 1.0), 0.01, ratio), moving=moving,
        out=_outside(-1.5, -1.5, 1.5, 1.5, 1),
    )  # fmt: skip


def chain(ratio: float, wall: float, speed: float) -> Outcome:
    """Three hooks hanging in one another, the lowest pulled down at a given speed."""
    hook = _hook(1.0, 1.0, wall)
    # The second hangs with its upper arm in the first, reversed; the third in the second.
    other = np.array([1.0, 1.0]) - hook + [0.6 - 2 * wall, -0.5]
    polygons = [hook, other, hook + [0.0, -1.0]]

    def moving(state: State) -> None:
        state.velocity[2, 1] = -speed

    def out(vertices: np.ndarray, blocks: Blocks) -> float:
        # Each hangs in the one above: none has fallen by the height of a hook.
        fallen = blocks.mean_vertices(blocks.vertices)[1:, 1] - blocks.mean_vertices(vertices)[1:, 1]
        return float(np.mean(fallen > [1.2, 2.4]))

    return _run(
        polygons, [True, False, False], wall, _Steps(0.5 / max(speed, 1.0), 0.01, ratio), moving=moving, out=out
    )


def combs(ratio: float, tooth: float, speed: float) -> Outcome:
    """A comb that falls between the teeth of another."""
    teeth, length = 6, 0.5
    pitch = 4 * tooth
    below = _comb(teeth, tooth, length, pitch)
    above = np.array([below[:, 0].max() + 1.7 * tooth, 2 * length + 0.1]) - below

    def moving(state: State) -> None:
        state.velocity[1, 1] = -speed

    return _run([below, above], [True, False], tooth, _Steps(1.0 / max(speed, 1.0), 0.01, ratio), moving=moving)


def cogs(ratio: float, spin: float, teeth: float) -> Outcome:
    """A cog thrown at another, both with sharp teeth."""
    n = int(teeth)
    # The tips of the second start in gaps of the first, or above its tips.
    polygons = [_cog(0.0, 0.0, n, 0.8, 1.0, 0.0), _cog(0.0, 2.02, n, 0.8, 1.0, 0.1 - 0.5 * math.pi)]

    def moving(state: State) -> None:
        state.velocity[1, 2] = spin

    return _run(
        polygons, [True, False], 2 * math.pi / n * 0.1, _Steps(2.0 / max(spin, 2.0), 0.01, ratio), moving=moving
    )


def sticks(ratio: float, wall: float, speed: float) -> Outcome:
    """Eight sticks of 1 m that fall on one another, obliquely, between two posts."""
    polygons = [rectangle(-1.0, -0.5, 1.0, 0.0)]
    for k in range(8):
        polygons.append(turned(rectangle(-0.5, 0.0, 0.5, wall), 0.05 * (-1) ** k) + [0.02 * k, 0.1 * (k + 1)])

    def moving(state: State) -> None:
        state.velocity[1:, 1] = -speed

    def out(vertices: np.ndarray, blocks: Blocks) -> float:
        centre = blocks.mean_vertices(vertices)[1:]
        return float(np.mean((centre[:, 1] < 0.0) & (np.abs(centre[:, 0]) < 1.0)))

    return _run(
        polygons, [True] + 8 * [False], wall, _Steps(1.0 / max(speed, 1.0), 0.01, ratio), moving=moving, out=out
    )


def box_of_debris(ratio: float, wall: float, speed: float) -> Outcome:
    """A thin-walled box filled with rubble that falls on a corner of the ground."""
    rng = np.random.default_rng(5)
    polygons = [np.array([[-2.0, -1.0], [2.0, -1.0], [0.0, 0.0]])]
    polygons.append([loop + [0.3, 1.05 + wall] for loop in _ring(0.0, 0.0, 1.0 + wall, wall)])
    for k in range(12):
        angle = np.sort(2 * math.pi * (np.arange(5) + 0.6 * rng.random(5)) / 5)
        centre = np.array([-0.45 + 0.5 * (k % 4), 0.35 + 0.5 * (k // 4)])
        polygons.append(centre + 0.22 * np.column_stack([np.cos(angle), np.sin(angle)]))

    def moving(state: State) -> None:
        state.velocity[1:, 1] = -speed

    def out(vertices: np.ndarray, blocks: Blocks) -> float:
        start = blocks.vertex_start
        corners = vertices[start[1] : start[1] + 4]
        along = np.roll(corners, -1, axis=0) - corners
        to = blocks.mean_vertices(vertices)[2:, None, :] - corners
        return float(np.mean((along[:, 0] * to[..., 1] - along[:, 1] * to[..., 0] < 0).any(axis=1)))

    return _run(
        polygons, [True] + 13 * [False], wall, _Steps(0.5 / max(speed, 1.0), 0.01, ratio), moving=moving, out=out
    )


def spike(rigid: bool, wall: float, speed: float) -> Outcome:
    """A square thrown across a fixed spike, ``wall`` m thick at its foot and 1 m high."""

    def moving(state: State) -> None:
        state.velocity[1, 0] = speed

    polygons = [np.array([[-0.5 * wall, 0.0], [0.5 * wall, 0.0], [0.0, 1.0]]), rectangle(-0.9, 0.3, -0.5, 0.7)]
    return _run(
        polygons, [True, False], wall, _Steps(2.0 / speed, 0.05, 0.1), rigid=rigid, loads=Loads(), moving=moving,
        out=lambda vertices, blocks: float(blocks.mean_vertices(vertices)[1, 0] > 0.0),
    )  # fmt: skip
