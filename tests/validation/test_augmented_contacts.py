"""Multipliers in contacts: the same forces and no penetration whatever the penalty, no creep, no energy from
nowhere."""

from __future__ import annotations

import numpy as np
import pytest
from block_problems import rectangle, turned

from geomech import dda
from geomech.model import (
    SLIP,
    STICK,
    Blocks,
    DdaSettings,
    EdgeTraction,
    History,
    JointLaw,
    Loads,
    Material,
    PointLoad,
    State,
)
from geomech.reference.blocks import block_motion as exact

GRAVITY = 9.81
YOUNGS_MODULUS = 10e9
ROCK = Material("rock", YOUNGS_MODULUS, 0.25, density=2600.0)


def augmented(ratio: float | None, **more) -> DdaSettings:
    """``ratio`` of the penalty to Young's modulus."""
    penalty = None if ratio is None else ratio * YOUNGS_MODULUS
    return DdaSettings(**{"contact": "augmented", "normal_penalty": penalty, "max_displacement_ratio": 0.05} | more)


@pytest.mark.parametrize("ratio", [0.1, 1.0, None, 1e4])
def test_a_column_is_shortened_by_its_blocks_alone(ratio):
    n, width, height, load = 8, 1.0, 2.0, 3e6
    polygons = [rectangle(-1, -1, 2, 0)] + [rectangle(0, height * k, width, height * (k + 1)) for k in range(n)]
    names = [[[""] * 4] for _ in range(n)] + [[["", "", "top", ""]]]
    blocks = Blocks.from_polygons(polygons, fixed=[True] + [False] * n, edge_names=names)
    system = dda.BlockSystem(blocks, [ROCK], settings=augmented(ratio, max_displacement_ratio=1.0))
    loads = Loads(
        gravity=History.constant([0, -GRAVITY]), edge_tractions=(EdgeTraction("top", History.constant([0, -load])),)
    )
    result = system.step(State.at_rest(blocks), loads, 1e4)
    weight = 2600.0 * GRAVITY * width * height
    below = load * width + weight * np.arange(n, 0, -1)
    mean = below - weight / 2
    shortening = float((mean * height / (width * ROCK.plane_modulus)).sum())
    top = result.state.vertices[blocks.edges_named("top")[0], 1] - n * height
    # Each joint may gape by the tolerance, 1e-8 of √2 m; it was 8e-3 of the shortening with springs of 40 E alone.
    assert top == pytest.approx(-shortening, abs=n * 1.5e-8)
    contacts = result.contacts[result.contacts["normal_force"] > 0]
    assert np.abs(contacts["gap"]).max() <= 1.5e-8
    assert result.state.stress[1:, 1] == pytest.approx(-mean / width, rel=1e-8)
    # The forces are determinate, so the first multipliers are right.
    assert result.statistics["open_close_iterations"] <= 3


@pytest.mark.parametrize("ratio", [1.0, 100.0])
def test_a_block_that_sticks_does_not_creep(ratio):
    # On 30°, pushed up and down the slope thirty times; rough enough for the upper contact, which carries least, to
    # stick too.
    angle = np.radians(30)
    blocks = Blocks.from_polygons(
        [turned(rectangle(-5, -1, 5, 0), angle), turned(rectangle(0, 0, 1, 1), angle)], fixed=[True, False]
    )
    joint = JointLaw("joint", friction_angle=np.radians(65))
    system = dda.BlockSystem(
        blocks, [Material("rock", YOUNGS_MODULUS, 0.0, density=2600.0)], [joint], settings=augmented(ratio)
    )
    down = -np.array([np.cos(angle), np.sin(angle)])
    weight = 2600.0 * GRAVITY
    base = tuple(turned(np.array([[0.5, 0.0]]), angle)[0])
    push = History(np.arange(0.0, 61.0), np.outer(0.05 * weight * (-1.0) ** np.arange(61), down))
    loads = Loads(gravity=History.constant([0.0, -GRAVITY]), point_loads=(PointLoad(1, base, push),))
    state = State.at_rest(blocks)
    while state.time < 60:
        result = system.step(state, loads, 1.0)
        state = result.state
        assert (result.contacts["state"][result.contacts["normal_force"] > 0] == STICK).all()
        assert np.abs(result.contacts["stretch"]).max() <= 1e-8
    # The elastic block itself bends to and fro; after an even number of pushes it stands where it stood.
    twice = system.step(system.step(state, loads, 1.0).state, loads, 1.0).state
    moved = np.abs(twice.vertices - state.vertices)[4:]
    assert moved.max() < 5e-8
    with_springs = weight * np.sin(angle) / (2 * ratio * YOUNGS_MODULUS)
    print(f"penalty {ratio} E: {moved.max():.1e} m; springs alone would give {with_springs:.1e} m")


@pytest.mark.parametrize("ratio", [1.0, 40.0])
def test_sliding_is_that_of_coulomb(ratio):
    angle, friction = np.radians(30), np.radians(15)
    blocks = Blocks.from_polygons(
        [turned(rectangle(-20, -1, 20, 0), angle), turned(rectangle(4, 0, 5, 1), angle)], fixed=[True, False]
    )
    system = dda.BlockSystem(
        blocks, [ROCK], [JointLaw("joint", friction_angle=friction)], settings=augmented(ratio, dynamic_factor=1.0)
    )
    state, loads = State.at_rest(blocks), Loads(gravity=History.constant([0.0, -GRAVITY]))
    while state.time < 0.5 - 1e-12:
        result = system.step(state, loads, min(2e-3, 0.5 - state.time))
        state = result.state
    rows = result.contacts[result.contacts["state"] == SLIP]
    assert np.abs(rows["shear_force"]) == pytest.approx(np.tan(friction) * rows["normal_force"], rel=1e-9)
    moved = (state.vertices - blocks.vertices)[4:].mean(axis=0) @ -np.array([np.cos(angle), np.sin(angle)])
    # As with springs: the block's own elastic shortening remains.
    assert moved == pytest.approx(0.5 * exact.incline_acceleration(angle, friction) * 0.25, rel=1e-5)


@pytest.mark.parametrize("ratio", [1.0, None])
@pytest.mark.parametrize("dt", [1e-3, 1e-4])
def test_impact_keeps_momentum_and_gains_no_energy(dt, ratio):
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1), rectangle(1.01, 0.1, 3.01, 0.9)])
    rock = Material("rock", YOUNGS_MODULUS, 0.25, density=2500.0)
    system = dda.BlockSystem(
        blocks, [rock], [JointLaw("rough", friction_angle=0.5)],
        settings=augmented(ratio, dynamic_factor=1.0, max_displacement_ratio=1.0),
    )  # fmt: skip
    state = State.at_rest(blocks)
    state.velocity[0, :2], state.velocity[1, :2] = [4.0, 0.5], [-1.0, 0.0]
    mass = 2500.0 * blocks.areas()
    momentum = mass @ state.velocity[:, :2]
    start = 0.5 * np.sum(mass[:, None] * state.velocity[:, :2] ** 2)
    moving, touched = [start], False
    while state.time < 8e-3 - 1e-12:
        result = system.step(state, Loads(), min(dt, 8e-3 - state.time))
        state = result.state
        moving.append(result.statistics["kinetic_energy"] + result.statistics["elastic_energy"])
        touched = touched or (result.contacts["normal_force"] > 0).any()
    assert touched and not (result.contacts["normal_force"] > 0).any()
    assert mass @ state.velocity[:, :2] == pytest.approx(momentum, rel=1e-9)
    _, least = exact.plastic_impact_bounds((mass[0], mass[1]), (4.0, -1.0))
    print(
        f"dt {dt} penalty {ratio} E: {moving[-1] / start:.3f} of the energy is left, plastic impact leaves "
        f"{least / start:.3f}"
    )
    assert 0.999 * least < moving[-1] and max(moving) <= start * (1 + 1e-9)


def test_refusals():
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1)])
    for settings, message in (
        (lambda: DdaSettings(contact="mortar"), "'penalty' or 'augmented'"),
        (lambda: augmented(None, penetration_tolerance=0.0), "penetration_tolerance"),
    ):
        with pytest.raises(ValueError, match=message):
            dda.BlockSystem(blocks, [ROCK], settings=settings())
