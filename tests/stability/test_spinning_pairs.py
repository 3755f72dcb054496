"""Blocks that spin as they hit, in steps in which they turn far: none is inside another by more than contacts give."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapely

from geomech import dda
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material, State

ROCK = Material("rock", 10e9, 0.25, density=2600.0)
#: Seeds whose blocks have gone into each other by up to 5 cm in one step.
ONCE_WRONG = {"square": (38, 47, 111, 119, 206, 424, 681), "polygon": (31, 78, 120, 334, 367, 410, 497)}


def drawn(rng: np.random.Generator, shape: str) -> np.ndarray:
    """A square of 1 m or a polygon of three to seven corners, as large, turned at random."""
    if shape == "square":
        corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    else:
        n = rng.integers(3, 8)
        angle = np.sort(2 * np.pi * (np.arange(n) + 0.6 * rng.random(n)) / n)
        corners = 0.6 * np.column_stack([np.cos(angle), np.sin(angle)])
    c, s = np.cos(turn := rng.uniform(0, 2 * np.pi)), np.sin(turn)
    return corners @ np.array([[c, s], [-s, c]])


def pair(seed: int, shape: str) -> tuple[dda.BlockSystem, State]:
    """Two blocks a little apart that fly at each other and spin."""
    rng = np.random.default_rng(seed)
    one, other = drawn(rng, shape), drawn(rng, shape)
    way = rng.uniform(0, 2 * np.pi)
    along = np.array([np.cos(way), np.sin(way)])
    low, high = 0.0, 3.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        apart = shapely.Polygon(one).distance(shapely.Polygon(other + middle * along)) > 0
        low, high = (low, middle) if apart else (middle, high)
    blocks = Blocks.from_polygons([one, other + (high + rng.choice([1e-6, 1e-3, 1e-2, 0.05])) * along])
    system = dda.BlockSystem(
        blocks, [ROCK], [JointLaw("joint", friction_angle=rng.choice([0.0, 0.5, 0.9]))],
        settings=DdaSettings(dynamic_factor=1.0, max_displacement_ratio=0.2),
    )  # fmt: skip
    state = State.at_rest(blocks)
    state.velocity[:, 2] = rng.uniform(-12.0, 12.0, 2)
    state.velocity[0, :2] = rng.uniform(0, 3) * along
    state.velocity[1, :2] = -rng.uniform(0, 3) * along
    state.velocity[:, :2] += rng.uniform(-1, 1, (2, 2))
    return system, state


def trough(seed: int, n: int = 9) -> tuple[dda.BlockSystem, State]:
    """Polygons that fall spinning into a trough with walls that lean."""
    rng = np.random.default_rng(seed)
    rim = np.array([[-5.5, 8.0], [-2.5, 0.0], [2.5, 0.0], [5.5, 8.0]])
    walls = [np.array([a, b, b + [0.0, -1.0], a + [0.0, -1.0]])[::-1] for a, b in itertools.pairwise(rim)]
    centres = np.column_stack([np.tile([-1.4, 0.0, 1.4], n)[:n], 1.5 + 1.4 * (np.arange(n) // 3)])
    blocks = Blocks.from_polygons(
        walls + [drawn(rng, "polygon") + centre for centre in centres], fixed=[True] * 3 + [False] * n
    )
    system = dda.BlockSystem(
        blocks, [ROCK], [JointLaw("joint", friction_angle=0.5)],
        settings=DdaSettings(dynamic_factor=1.0, max_displacement_ratio=0.2),
    )  # fmt: skip
    state = State.at_rest(blocks)
    state.velocity[3:, 2] = rng.uniform(-12.0, 12.0, n)
    return system, state


def largest_overlap(blocks: Blocks, vertices: np.ndarray) -> float:
    """m², the largest area that two blocks share."""
    shapes = [shapely.Polygon(vertices[a:b]) for a, b in itertools.pairwise(blocks.vertex_start)]
    tree = shapely.STRtree(shapes)
    first, second = tree.query(shapes)
    apart = (first < second) & ~(blocks.fixed[first] & blocks.fixed[second])
    areas = [shapes[a].intersection(shapes[b]).area for a, b in zip(first[apart], second[apart], strict=True)]
    return max(areas, default=0.0)


def deepest(system: dda.BlockSystem, state: State, loads: Loads, steps: int) -> float:
    """The largest area that blocks share after a step, over what springs pressed in as deep as the step tells share along
    two metres of face and corners round off. No step brings energy in."""
    worst = 0.0
    for _ in range(steps):
        result = system.step(state, loads, 1e-2)
        state, energy = result.state, result.energy
        told = result.statistics["worst_penetration"]
        worst = max(worst, largest_overlap(system.blocks, state.vertices) / (1e-5 + 2 * told))
        assert energy.stored < (energy.before + energy.gravity_work) * (1 + 1e-3)
    return worst


@pytest.mark.parametrize("shape", ["square", "polygon"])
def test_two_blocks_that_turn_into_each_other_are_seen_to(shape):
    for seed in ONCE_WRONG[shape]:
        system, state = pair(seed, shape)
        assert deepest(system, state, Loads(), 3) < 1.0, seed


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["square", "polygon"])
def test_any_two_blocks_that_hit_and_spin_stay_apart(shape):
    for seed in range(1000):
        system, state = pair(seed, shape)
        assert deepest(system, state, Loads(), 20) < 1.0, seed


@pytest.mark.slow
def test_debris_that_falls_spinning_into_a_trough_stays_apart():
    weight = Loads(gravity=History.constant([0.0, -9.81]))
    for seed in range(12):
        system, state = trough(seed)
        assert deepest(system, state, weight, 150) < 1.0, seed
