"""Blocks of any shape that fall down a slope and pile up at its foot: what holds in every step of it."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from geomech import dda
from geomech.dda.moments import block_moments
from geomech.dda.overlap import deepest_overlap
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material, State

WEIGHT = Loads(gravity=History.constant([0.0, -9.81]))
DIP = np.radians(35)
#: m: the slope's length, and that of the ground before it.
LENGTH, GROUND = 60.0, 60.0


def turned(points) -> np.ndarray:
    c, s = np.cos(DIP), -np.sin(DIP)
    return np.asarray(points, float) @ np.array([[c, s], [-s, c]])


def avalanche(n: int) -> dda.BlockSystem:
    """``n`` polygons of three to seven corners, half a metre to a metre across, on a slope above level ground that ends
    at a wall."""
    rng = np.random.default_rng(3)
    crest, foot = turned([[-2.0, 0.0], [LENGTH, 0.0]])
    end = foot[0] + GROUND
    ground = [
        turned([[-2, -1], [LENGTH, -1], [LENGTH, 0], [-2, 0]]),
        turned([[-3, -1], [-2, -1], [-2, 12], [-3, 12]]),
        np.array([turned([[LENGTH, -1.0]])[0], [end, foot[1] - 1.0], [end, foot[1]], foot]),
        np.array([[end, foot[1] - 1], [end + 1, foot[1] - 1], [end + 1, crest[1]], [end, crest[1]]]),
    ]
    polygons = []
    for k in range(n):
        corners = rng.integers(3, 8)
        angle = np.sort(2 * np.pi * (np.arange(corners) + 0.6 * rng.random(corners)) / corners)
        radius = 0.45 * rng.uniform(0.7, 1.0)
        centre = np.array([0.5 + k % 20, 0.5 + k // 20])
        polygons.append(turned(centre + radius * np.column_stack([np.cos(angle), np.sin(angle)])))
    return dda.BlockSystem(
        Blocks.from_polygons(ground + polygons, fixed=[True] * 4 + [False] * n),
        [Material("rock", 10e9, 0.25, density=2600.0)], [JointLaw("joint", friction_angle=np.radians(30))],
        settings=DdaSettings(dynamic_factor=1.0, max_displacement_ratio=0.05),
    )  # fmt: skip


@pytest.mark.parametrize(("n", "seconds"), [(25, 0.9), pytest.param(100, 12.0, marks=pytest.mark.slow)])
def test_an_avalanche_makes_no_energy_and_lets_no_block_into_another(n, seconds, caplog):
    system = avalanche(n)
    blocks, free = system.blocks, ~system.blocks.fixed
    areas = blocks.areas()
    size = float(np.sqrt(areas[free].min()))
    state, budget = State.at_rest(blocks), dda.EnergyBudget()
    deepest, overlap, steps, cuts, strained = 0.0, 0.0, 0, 0, 0.0
    with caplog.at_level(logging.WARNING):
        while state.time < seconds:
            result = system.step(state, WEIGHT, 5e-3)
            state, budget = result.state, budget.after(result.energy, result.state.time)
            told = result.statistics
            steps, cuts, deepest = steps + 1, cuts + told["step_cuts"], max(deepest, told["worst_penetration"])
            assert told["unbalanced"] < 1e-6
            if steps % 20 == 0:
                moments = block_moments(state.vertices, blocks.next_vertex, blocks.vertex_start)
                overlap = max(overlap, deepest_overlap(blocks, state.vertices, moments)[3])
                strained = max(strained, float(np.abs(moments[free, 0] / areas[free] - 1).max()))
    print(
        f"{n} blocks, {seconds:g} s, {steps} steps, {cuts} cuts: penetration {deepest / size:.1e}, overlap "
        f"{overlap:.1e} of a block, strain {strained:.1e}; residual {budget.residual / budget.turnover:.1e}, brought "
        f"in by overlap {budget.overlap / budget.turnover:.1e}, moving {budget.last.kinetic / budget.turnover:.1e} of "
        "all energy"
    )
    assert not caplog.records
    # Springs of 40 E' give by v √(m/k), 1e-3 of a block, under an impact at 20 m/s.
    assert deepest < 1e-3 * size and overlap < 1e-3
    assert budget.residual + budget.overlap < 1e-4 * budget.turnover and budget.scheme > 0.0
    middle = blocks.mean_vertices(state.vertices)[free]
    surface = np.where(middle[:, 0] < LENGTH * np.cos(DIP), -np.tan(DIP) * middle[:, 0], -LENGTH * np.sin(DIP))
    assert (middle[:, 1] > surface).all()
