"""Blocks under in-situ stress: at rest from the first step on, and unloaded by what is taken out."""

import itertools
import logging
import re

import numpy as np
import pytest
from block_problems import rectangle

from geomech import dda
from geomech.model import (
    Blocks,
    DdaSettings,
    Excavation,
    History,
    InSituStress,
    JointLaw,
    Loads,
    Material,
    State,
    WaterTable,
)

ROCK = Material("rock", 10e9, 0.25, density=2600.0)
GRAVITY = History.constant([0.0, -9.81])


def ground(bond=True):
    """Five courses of bricks of 1 m between fixed walls."""
    polygons = [rectangle(-1, -1, 7, 0), rectangle(-1, 0, 0, 5), rectangle(6, 0, 7, 5)]
    for row in range(5):
        joints = [0, *np.arange(0.5, 6), 6] if bond and row % 2 else range(7)
        polygons += [rectangle(a, row, b, row + 1) for a, b in itertools.pairwise(joints)]
    return Blocks.from_polygons(polygons, fixed=[True] * 3 + [False] * (len(polygons) - 3))


def system_of(blocks, friction, **settings):
    settings = DdaSettings(max_displacement_ratio=0.05, **settings)
    return dda.BlockSystem(blocks, [ROCK], [JointLaw("joint", friction_angle=friction)], settings=settings)


@pytest.mark.parametrize("friction", [0.0, 0.6])
@pytest.mark.parametrize("k0", [1 / 3, 1.5])
def test_blocks_with_geostatic_stress_do_not_move_in_the_first_step(friction, k0):
    blocks, loads = ground(), Loads(gravity=GRAVITY)
    field = InSituStress.geostatic(5.0, 2600 * 9.81, k0)
    rest = dda.in_situ_state(system_of(blocks, friction), field, loads)
    # The stress is the field's at every block's centroid …
    assert rest.deviation < 1e-6
    assert rest.state.stress[3] == pytest.approx([-k0 * 2600 * 9.81 * 4.5, -2600 * 9.81 * 4.5, 0.0], rel=1e-6, abs=1.0)
    # … and dynamic steps under full gravity leave the blocks where they are: 2 pm in 5 m found, a hundred-thousandth of
    # what they would settle by if gravity were put on them at once.
    dropped = system_of(blocks, friction, dynamic_factor=1.0).step(State.at_rest(blocks), loads, 0.01)
    settling = np.abs(dropped.state.vertices - blocks.vertices).max()
    state = rest.state
    for _ in range(5):
        result = system_of(rest.blocks, friction, dynamic_factor=1.0).step(state, loads, 0.01)
        state = result.state
        assert result.statistics["open_close_iterations"] <= 3
    assert np.abs(state.vertices - rest.blocks.vertices).max() < 2e-5 * settling


def test_water_in_the_joints_takes_its_part_of_the_stress():
    """Total stress under a table two thirds up the ground: contacts carry the effective one, and nothing moves."""
    blocks, water = ground(), WaterTable(np.array([[0.0, 3.2]]))
    loads = Loads(gravity=GRAVITY, water=water)
    rest = dda.in_situ_state(system_of(blocks, 0.6), InSituStress.geostatic(5.0, 2600 * 9.81, 0.8), loads)
    assert rest.deviation < 1e-3 and rest.settled < 1e-3 * 5.0 * 2600 * 9.81 / ROCK.plane_modulus * 5.0
    rows = rest.state.contacts
    floor = (rows["other"] == 0) & (rows["block"] > 2)
    effective = 6.0 * (5.0 * 2600 * 9.81 - 3.2 * 9810.0)
    assert rows["normal_force"][floor].sum() == pytest.approx(effective, rel=1e-3)


@pytest.mark.parametrize(("k0", "slides"), [(0.2, True), (0.9, False)])
def test_joints_that_slide_before_they_bear_the_stress_are_told_of(k0, slides, caplog):
    """A joint at 45° bears σ_n = ½ (1 + K0) σ_v and τ = ½ (1 − K0) σ_v: with tan φ = 0.3, from K0 = 0.54 on. Below it the
    upper block comes down, wedges itself in, and takes the stress that the joint bears."""
    walls = [rectangle(-1, -1, 5, 0), rectangle(-1, 0, 0, 4), rectangle(4, 0, 5, 4)]
    rock = [np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0]]), np.array([[0.0, 0.0], [4.0, 4.0], [0.0, 4.0]])]
    blocks = Blocks.from_polygons(
        [*walls, *rock], fixed=[True] * 3 + [False] * 2, names=["floor", "left", "right", "lower", "upper"]
    )
    with caplog.at_level(logging.WARNING):
        dda.in_situ_state(
            system_of(blocks, np.arctan(0.3)), InSituStress.geostatic(4.0, 2600 * 9.81, k0), Loads(gravity=GRAVITY)
        )
    lines = [record.getMessage() for record in caplog.records if "before they bear it" in record.getMessage()]
    assert len(lines) == slides
    if slides:
        assert "lower on upper" in lines[0]
        share = float(re.search(r"dissipate (\S+) of the elastic energy", lines[0])[1])
        assert 0.01 < share < 2.0


def test_a_given_tensor_with_gradients():
    field = InSituStress(np.array([-2e6, -1e6, 0.3e6]), np.array([[0.0, 1e4], [0.0, 2.5e4], [1e3, 0.0]]), (1.0, 2.0))
    assert field.at(np.array([3.0, 1.0])) == pytest.approx([-2e6 - 1e4, -1e6 - 2.5e4, 0.3e6 + 2e3])
    with pytest.raises(ValueError, match="in-situ stress must be"):
        InSituStress(np.array([1.0, 2.0]))
    with pytest.raises(ValueError, match="K0"):
        InSituStress.geostatic(0.0, 2.6e4, -0.5)


def test_taking_the_upper_courses_out_unloads_what_is_below():
    # Joints in line and smooth, so that each column stands for itself. Vertically the weight goes; sideways, confined,
    # the stress follows by ν/(1−ν) of that (Poisson), so that K0 rises: what is left remembers its depth.
    blocks, nu, k0 = ground(bond=False), ROCK.poissons_ratio, 0.8
    loads = Loads(gravity=GRAVITY, excavations=(Excavation(0.5, polygon=rectangle(0, 2, 6, 6)),))
    stiff = {"normal_penalty": 1e14, "shear_penalty": 1e14}
    rest = dda.in_situ_state(system_of(blocks, 0.0, **stiff), InSituStress.geostatic(5.0, 2600 * 9.81, k0), loads)
    system, state = system_of(rest.blocks, 0.0, **stiff), rest.state
    before = state.stress.copy()
    for _ in range(6):
        state = system.step(state, loads, 0.5).state
    weight = 2600 * 9.81
    assert before[3] == pytest.approx([-k0 * 4.5 * weight, -4.5 * weight, 0], rel=1e-5, abs=1)
    assert state.stress[3, 1] == pytest.approx(-1.5 * weight, rel=1e-4)
    # The contact springs, 1e14 Pa beside E' = 1.07e10, give way by 2e-4.
    assert state.stress[3:9, 0] - before[3:9, 0] == pytest.approx(np.full(6, nu / (1 - nu) * 3 * weight), rel=1e-3)
    assert (state.vertices - rest.blocks.vertices)[rest.blocks.vertex_block == 3, 1].max() > 0  # it heaves


def test_what_cannot_rest_is_said():
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1), rectangle(0, 2, 1, 3)], fixed=[True, False], names=["a", "b"])
    with pytest.raises(dda.NoInSituEquilibrium, match=r"do not come to rest.*'b'"):
        dda.in_situ_state(
            system_of(blocks, 0.5), InSituStress(np.zeros(3)), Loads(gravity=History.constant([1.0, 0.0]))
        )


@pytest.mark.parametrize("contact", ["penalty", "augmented"])
def test_blocks_that_nothing_presses_on_come_apart_and_are_at_rest(contact):
    """A stress without the weight that would bear it, and nothing at the sides: blocks part, and the forces left are
    what contacts make of rounding, 1e-10 of those that the stress would be (1 MPa on 1 m); no share of them is a force
    out of balance."""
    polygons = [rectangle(-1, -1, 4, 0)] + [rectangle(x, y, x + 1, y + 1) for x in range(3) for y in range(2)]
    blocks = Blocks.from_polygons(polygons, fixed=[True] + [False] * 6)
    field = InSituStress(np.array([-1e6, -0.5e6, 0.1e6]))
    rest = dda.in_situ_state(system_of(blocks, 0.6, contact=contact), field, Loads())
    assert np.abs(rest.state.stress[1:]).max() < 1e-3 and rest.deviation == pytest.approx(1.0)
    # Each has let go of its strain, σ/E' of its size, and no more.
    assert rest.settled < 3 * 1e6 / ROCK.plane_modulus * 3


def test_a_force_out_of_balance_is_told_beside_the_smallest_weight():
    """Rounding is no excuse where there are forces: light blocks, a gram each, find an equilibrium in which the
    floor bears them all (the walls are smooth; the springs' rounding is a tenth of a block's weight)."""
    light = Material("light", 10e9, 0.25, density=1e-3)
    blocks = ground()
    found = dda.equilibrium(
        dda.BlockSystem(blocks, [light], [JointLaw("smooth")], settings=DdaSettings(time_step=1.0)),
        State.at_rest(blocks), Loads(gravity=GRAVITY), tolerance=1e-6,
    )  # fmt: skip
    assert found.converged
    floor = np.flatnonzero((found.result.contacts["block"] == 0) | (found.result.contacts["other"] == 0))
    assert found.result.contacts["normal_force"][floor].sum() == pytest.approx(30 * 1e-3 * 9.81, rel=1e-3)
