"""Rectangles glued face to face bend as a beam does, and lose nothing but their bonds when these break."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from geomech import dda
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material, PointLoad, State

LENGTH, DEPTH, MODULUS, DENSITY = 8.0, 1.0, 10e9, 2500.0
SMALL = 0.01 * 9.81  # a hundredth of its weight: linear


def glued_cantilever(columns: int, rows: int, strength: float = 1e12, **settings) -> dda.BlockSystem:
    xs, ys = np.linspace(0, LENGTH, columns + 1), np.linspace(0, DEPTH, rows + 1)
    polygons = [np.array([[-1.0, -1], [0, -1], [0, 2], [-1, 2]])]
    for i in range(columns):
        polygons += [
            np.array([[xs[i], ys[j]], [xs[i + 1], ys[j]], [xs[i + 1], ys[j + 1]], [xs[i], ys[j + 1]]])
            for j in range(rows)
        ]
    blocks = Blocks.from_polygons(polygons, fixed=[True] + [False] * (len(polygons) - 1))
    law = JointLaw("glue", 0.6, strength, strength)
    return dda.BlockSystem(
        blocks, [Material("rock", MODULUS, 0.0, density=DENSITY)], [law],
        settings=DdaSettings(**{"max_displacement_ratio": 0.1, **settings}),
    )  # fmt: skip


def sag(system: dda.BlockSystem, loads: Loads) -> float:
    found = dda.equilibrium(system, State.at_rest(system.blocks), loads)
    assert found.converged and found.result.contacts["bonded"].all()
    return float(-(found.state.vertices - system.blocks.vertices)[:, 1].min())


def test_a_cantilever_of_bricks_sags_as_timoshenkos(verified):
    load = DENSITY * SMALL * DEPTH
    # Bernoulli's beam and its shear, κ = 5/6, G = E/2.
    beam = load * LENGTH**4 / (8 * MODULUS * DEPTH**3 / 12) + load * LENGTH**2 / (2 * 5 / 6 * 0.5 * MODULUS * DEPTH)
    weight = Loads(gravity=History.constant([0.0, -SMALL]))
    one = [sag(glued_cantilever(n, 1), weight) / beam - 1 for n in (4, 8, 16)]
    more = [sag(glued_cantilever(8 * n, n), weight) / beam - 1 for n in (2, 3, 4)]
    print("sag over a beam's, one brick deep:", np.round(one, 4), "; of 2, 3, 4 courses:", np.round(more, 4))
    verified("cantilever of glued bricks, one deep: sag", one, "Timoshenko's beam", over=("bricks", (4, 8, 16)))
    verified(
        "cantilever of 2, 3, 4 courses of glued bricks: sag (springs give 1/80)",
        np.abs(more).max(),
        "Timoshenko's beam",
    )
    # Held at the corners of their faces these bricks sag 0.016, 0.024 and 0.05 of what they should.
    # Bricks two metres long see the moment at five places only; second order.
    assert one == pytest.approx([0.060, 0.0134, 0.0019], abs=1e-3)
    # Courses leave each other's stretch along their beds free. Springs of 40 E' give 1/80 of what bricks do.
    assert more == pytest.approx([1 / 80] * 3, abs=4e-3)


def bricks_in_bond(columns: int, rows: int, **settings) -> dda.BlockSystem:
    """The cantilever of bricks of which every other course begins and ends with half a one."""
    length, depth = LENGTH / columns, DEPTH / rows
    polygons = [np.array([[-1.0, -1], [0, -1], [0, 2], [-1, 2]])]
    for row in range(rows):
        ends = np.linspace(0, LENGTH, columns + 1)
        if row % 2:
            ends = np.concatenate([[0.0], ends[:-1] + 0.5 * length, [LENGTH]])
        low, high = row * depth, (row + 1) * depth
        polygons += [np.array([[a, low], [b, low], [b, high], [a, high]]) for a, b in pairwise(ends.tolist())]
    blocks = Blocks.from_polygons(polygons, fixed=[True] + [False] * (len(polygons) - 1))
    return dda.BlockSystem(
        blocks, [Material("rock", MODULUS, 0.0, density=DENSITY)], [JointLaw("glue", 0.6, 1e12, 1e12)],
        settings=DdaSettings(max_displacement_ratio=0.1, **settings),
    )  # fmt: skip


def test_bricks_in_bond_are_too_stiff_by_a_part_that_falls_with_their_size():
    """Each holds two others' ends together and cannot bend between them; what is known of it is how much they miss."""
    load = DENSITY * SMALL * DEPTH
    beam = load * LENGTH**4 / (8 * MODULUS * DEPTH**3 / 12) + load * LENGTH**2 / (2 * 5 / 6 * 0.5 * MODULUS * DEPTH)
    weight = Loads(gravity=History.constant([0.0, -SMALL]))
    square = [sag(bricks_in_bond(8 * n, n), weight) / beam for n in (2, 4)]
    long = [sag(bricks_in_bond(4 * n, n), weight) / beam for n in (2, 4)]
    print(
        "sag over a beam's, in 2 and 4 courses: square bricks",
        np.round(square, 3),
        "; twice as long",
        np.round(long, 3),
    )
    assert square == pytest.approx([0.943, 0.984], abs=5e-3) and long == pytest.approx([0.552, 0.746], abs=5e-3)
    # Between first and second order.
    assert 1 - square[1] < 0.5 * (1 - square[0])


def test_bricks_in_bond_bend_as_a_beam_does_the_more_of_them_there_are(verified):
    """A brick has one strain, so that a bed holds its ends together where a beam would shear between them: an error of
    the second order in its size, no fault of the bond. Of stiff glue; common springs, 40 E', give 1/80 of a brick's own
    stretch besides."""
    load = DENSITY * SMALL * DEPTH
    beam = load * LENGTH**4 / (8 * MODULUS * DEPTH**3 / 12) + load * LENGTH**2 / (2 * 5 / 6 * 0.5 * MODULUS * DEPTH)
    weight = Loads(gravity=History.constant([0.0, -SMALL]))
    stiff = {"normal_penalty": 4000 * MODULUS, "shear_penalty": 4000 * MODULUS}
    missed = np.array([1 - sag(bricks_in_bond(8 * n, n, **stiff), weight) / beam for n in (4, 8, 16)])
    orders = np.log2(missed[:-1] / missed[1:])
    print("sag missed in 4, 8, 16 courses:", np.round(missed, 4), "; orders", np.round(orders, 2))
    verified("square bricks in bond, stiff glue: sag", missed, "Timoshenko's beam", over=("courses", (4, 8, 16)))
    assert 0 < missed[-1] < 0.006 and orders[0] > 1.25 and orders[1] > 1.75


def test_pure_bending_turns_as_curvature_says(verified):
    """θ = M x/(E I) under a couple on the end, no matter how many bricks."""
    moment = 1e3
    # A pair of forces, half of the depth apart.
    force = moment / (0.5 * DEPTH)
    for columns in (2, 5):
        system = glued_cantilever(columns, 1)
        loads = Loads(
            point_loads=tuple(
                PointLoad(columns, (LENGTH, y * DEPTH), History.constant([sign * force, 0.0]))
                for y, sign in ((0.75, 1.0), (0.25, -1.0))
            )
        )
        found = dda.equilibrium(system, State.at_rest(system.blocks), loads)
        middle = LENGTH * (1 - 0.5 / columns)
        turn = found.state.rotation[-1] / (-12 * moment * middle / (MODULUS * DEPTH**3)) - 1
        print(f"{columns} bricks: rotation off by {turn:.1e}")
        verified(f"couple on a beam of {columns} bricks: rotation", turn, "M x / (E I)")
        # To what equilibrium is sought, a part 1e-4 of the largest force.
        assert abs(turn) < 1e-4


def test_a_cantilever_that_breaks_falls_and_is_not_thrown():
    strength = 0.5 * 3 * DENSITY * 9.81 * LENGTH**2 / DEPTH
    system = glued_cantilever(8, 1, strength, dynamic_factor=1.0)
    weight = Loads(gravity=History.constant([0.0, -9.81]))
    state, budget, lost = State.at_rest(system.blocks), dda.EnergyBudget(), []
    for _ in range(150):
        result = system.step(state, weight, 2e-3)
        budget, state = budget.after(result.energy, result.state.time), result.state
        bonds = result.contacts[result.contacts["length"] > 0]
        lost.append(int((bonds["bonded"] == 0).sum()))
        # Bonds that break give back no more than the weight has put in.
        assert result.energy.kinetic < budget.gravity_work + 1e-9
    print("bonds lost", lost[-1], "; residual", budget.residual / budget.turnover, "; bond energy", budget.bond)
    assert lost[-1] > 0 and abs(budget.residual) < 1e-3 * budget.turnover


@pytest.mark.parametrize("damping", [0.0, 0.4])
def test_bonds_that_break_release_what_bending_had_stored_and_keep_no_force_of_dashpots(damping):
    system = glued_cantilever(4, 1, 1e6, dynamic_factor=1.0, damping=damping)
    weight = Loads(gravity=History.constant([0.0, -9.81]))
    state, budget, jumps, bonds = State.at_rest(system.blocks), dda.EnergyBudget(), [], []
    for _ in range(30):
        before = budget.last
        result = system.step(state, weight, 5e-4)
        budget, state = budget.after(result.energy, result.state.time), result.state
        jumps.append(0.0 if before is None else result.energy.before - before.stored)
        bonds.append(result.energy.bond)
        assert abs(result.energy.residual) < 1e-9 * budget.turnover
    print("largest jump", np.abs(jumps).max(), "of", budget.turnover, "; of bonds", max(bonds), "J/m")
    # Unbooked, what bent blocks release would be a jump of a tenth of all energy.
    assert max(bonds) > 0.05 * budget.turnover
    assert np.abs(jumps).max() < 1e-4 * budget.turnover
