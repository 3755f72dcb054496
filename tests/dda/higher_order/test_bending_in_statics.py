"""Blocks of order p at rest: patch tests through faces that do not match, beams on supports, one block on another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes_of_bending import ROCK, after, body_of, moved, rectangle, system_of

from geomech.dda import NotConverged, equilibrium
from geomech.model import OPEN, EdgeTraction, History, JointLaw, LinearProfile, Loads, Material, State

#: Joints that give by their area: springs at corners, a number for each corner, cannot pass a patch test.
BY_AREA = JointLaw("joint", 0.6, normal_stiffness=1e12, shear_stiffness=1e12)
WEIGHT = Loads(gravity=History.constant((0.0, -9.81)))


@pytest.mark.parametrize("order", [2, 3, 8])
@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_a_uniform_pressure_passes_through_faces_that_do_not_match(order, angle):
    """A wide block on two narrow ones of unlike width, in plane strain with ν = 0: the stress is that of the load, and no
    block deflects. Round-off of turned coordinates is 1e-13 of it."""
    polygons = [rectangle(-1, -1, 6, 0), rectangle(0, 0, 2, 1), rectangle(2, 0, 5, 1), rectangle(0, 1, 5, 2)]
    rock = Material("rock", 2e10, 0.0, 2500.0)
    system = system_of(
        polygons, [1, 0, 0, 0], [1, order, order, order], joint=BY_AREA, rock=rock, angle=angle, loaded=(3, 2)
    )
    down = np.array([np.sin(angle), -np.cos(angle)])
    result = after(system, Loads(edge_tractions=(EdgeTraction("loaded", History.constant(1e6 * down)),)), 3)
    expected = -1e6 * np.outer(down, down)
    stress = result.state.stress[1:]
    assert stress == pytest.approx(np.tile([expected[0, 0], expected[1, 1], expected[0, 1]], (3, 1)), abs=1e-4)
    assert np.abs(result.state.deflection[:, 0]).max() < 1e-12 * np.abs(system.blocks.vertices).max()


@pytest.mark.parametrize("order", [2, 3, 5])
def test_a_linear_pressure_passes_from_block_to_block(order):
    """σyy = −1 MPa (0.2 + 0.2 x) in both blocks of a column; the joint closes unevenly, by 1 µm, which turns the load's
    frame by a few 1e-7."""
    rock = Material("rock", 2e10, 0.0, 2500.0)
    polygons = [rectangle(-1, -1, 5, 0), rectangle(0, 0, 4, 1), rectangle(0, 1, 4, 2)]
    system = system_of(polygons, [1, 0, 0], [1, order, order], joint=BY_AREA, rock=rock, loaded=(2, 2))
    profile = LinearProfile((0.0, 2.0), (4.0, 2.0), (0.2, 1.0))
    traction = EdgeTraction("loaded", History.constant((0.0, -1e6)), profile=profile)
    state = after(system, Loads(edge_tractions=(traction,)), 3).state
    at = np.array([[0.5, 0.3], [2.0, 0.5], [3.9, 0.9]])
    for block in (1, 2):
        stress = body_of(system, state, block).fields(at + [0.0, block - 1.0])[0]
        assert stress[:, 1] == pytest.approx(-1e6 * (0.2 + 0.2 * at[:, 0]), abs=50.0)
        assert np.abs(stress[:, [0, 2]]).max() < 50.0


def beam_on_two_supports(order: int, joint: JointLaw):
    length, depth = 10.0, 1.0
    polygons = [
        rectangle(-0.4, -1, 0.0, 0), rectangle(length, -1, length + 0.4, 0), rectangle(-0.4, 0, length + 0.4, depth),
    ]  # fmt: skip
    rock = Material("rock", 2e10, 0.0, 2500.0)
    system = system_of(polygons, [1, 1, 0], [1, 1, order], joint=joint, rock=rock)
    return system, after(system, WEIGHT, 4)


def test_a_beam_on_two_supports_bends_under_its_weight():
    """Simply supported on the inner edges of its bearings, with overhangs c = 0.4 m of 10 m that lift off: M at mid-span
    q (L²/8 − c²/2), and Timoshenko's deflection with shear area 5/6. The order of the block raises both to the
    solution."""
    length, depth, over, modulus = 10.0, 1.0, 0.4, 2e10
    load, inertia = 2500 * 9.81 * depth, depth**3 / 12
    moment = load * (length**2 / 8 - over**2 / 2)
    bent = load * length**2 / (384 * modulus * inertia) * (5 * length**2 - 24 * over**2)
    exact = bent + load * length**2 / (8 * (5 / 6) * depth * modulus / 2)
    error = {}
    for order in (2, 4, 8):
        system, result = beam_on_two_supports(order, JointLaw("smooth"))
        # The bearings give by a hundredth of that.
        sunk = moved(system, result.state, 2, [0.0, 0.0])[1]
        error[order] = (sunk - moved(system, result.state, 2, [0.5 * length, 0.5 * depth])[1]) / exact - 1
    stress = body_of(system, result.state, 2).fields(np.array([[5.0, 0.0], [5.0, 1.0]]))[0][:, 0]
    assert stress == pytest.approx([6 * moment, -6 * moment], rel=0.02)
    assert abs(error[8]) < 0.01
    assert abs(error[8]) < 0.5 * abs(error[4]) < 0.2 * abs(error[2])
    # Both overhangs are off their bearings but for the edges.
    rows = result.contacts
    assert (rows["normal_force"] >= 0).all()
    points = result.state.face_points
    assert (points["state"] == OPEN).sum() > len(points) / 2


def test_a_beam_that_is_glued_at_both_ends_bends_as_beam_theory_has_it():
    """Under its weight: q L⁴ / 384 EI and Timoshenko's shear with 5/6, and ± 6 (q L² / 24) / h² at mid-span. Orders 2 and 3
    have no room for it: their deflection is 7 % of that."""
    length, load, modulus = 10.0, 2500 * 9.81, 2e10
    rock = Material("rock", modulus, 0.0, 2500.0, plane="stress")
    glue = JointLaw("glue", 0.5, cohesion=1e12, tensile_strength=1e12, normal_stiffness=1e15, shear_stiffness=1e15)
    exact = load * length**4 / (384 * modulus / 12) + load * length**2 / (8 * (5 / 6) * modulus / 2)
    polygons = [rectangle(-1, 0, 0, 1), rectangle(length, 0, length + 1, 1), rectangle(0, 0, length, 1)]
    for order, error, within in ((4, -0.0145, 1e-4), (6, -0.0019, 0.02), (8, -0.0019, 0.005)):
        system = system_of(polygons, [1, 1, 0], [1, 1, order], joint=glue, rock=rock)
        state = after(system, WEIGHT, 3).state
        assert -moved(system, state, 2, [0.5 * length, 0.5])[1] / exact - 1 == pytest.approx(error, abs=2e-4)
        stress = body_of(system, state, 2).fields(np.array([[5.0, 0.0], [5.0, 1.0]]))[0][:, 0]
        assert stress == pytest.approx(load * length**2 / 4 * np.array([1.0, -1.0]), rel=within)


def test_equilibrium_is_found_where_beams_sag():
    """A slender beam on two bearings sags by 25 mm, 30 times as far as blocks of its size may move that do not bend, and is
    no mechanism; static steps come to rest where the search does."""
    polygons = [rectangle(-0.4, -1, 0, 0), rectangle(20, -1, 20.4, 0), rectangle(-0.4, 0, 20.4, 1)]
    system = system_of(polygons, [1, 1, 0], [1, 1, 5], max_displacement_ratio=0.01)
    found = equilibrium(system, State.at_rest(system.blocks), WEIGHT)
    assert found.converged, found.reason
    stepped = after(system, WEIGHT, 6).state
    sag = moved(system, found.state, 2, [10.0, 0.5])[1]
    assert sag == pytest.approx(-0.0264, rel=0.01)
    assert sag == pytest.approx(moved(system, stepped, 2, [10.0, 0.5])[1], rel=1e-5)


def test_a_cantilever_of_one_block_bends_as_finite_elements_say():
    """Beam of slenderness 8 glued to fixed rock, loaded at its end: Timoshenko's deflection, with a section that cannot
    warp where it is glued. Of order 3 it is 3 % too stiff there, of order 8 0.3 %; of order 1 it cannot bend."""
    length, load = 8.0, 1e6
    rock = Material("rock", 2e10, 0.2, 2500.0, plane="stress")
    glue = JointLaw("glue", 0.5, cohesion=1e12, tensile_strength=1e12, normal_stiffness=1e15, shear_stiffness=1e15)
    exact = load * length**3 / (3 * 2e10 / 12) + 1.2 * load * length / rock.shear_modulus
    deflection = []
    # A tenth of the load, so that the beam does not turn.
    loads = Loads(edge_tractions=(EdgeTraction("loaded", History.constant((0.0, -0.1 * load))),))
    for order in (2, 3, 5, 8):
        polygons = [rectangle(-1, -0.5, 0, 0.5), rectangle(0, -0.5, length, 0.5)]
        system = system_of(polygons, [1, 0], [1, order], joint=glue, rock=rock, loaded=(1, 1))
        state = after(system, loads, 3).state
        deflection.append(-10 * moved(system, state, 1, [length, 0.0])[1])
    error = np.array(deflection) / exact - 1
    assert error == pytest.approx([-0.278, -0.032, -0.009, -0.003], abs=1.5e-3)


def test_deflections_that_are_not_small_are_reported_or_end_the_run(caplog):
    """A beam of slenderness 40 that hangs from fixed rock: its end turns by q L³ / 6EI."""
    length, depth = 20.0, 0.5
    glue = JointLaw("glue", 0.5, cohesion=1e12, tensile_strength=1e12)
    polygons = [rectangle(-1, 0, 0, depth), rectangle(0, 0, length, depth)]
    turn = 2500 * 9.81 * depth * length**3 / (6 * depth**3 / 12)
    for bent, reported in ((0.02, False), (0.12, True)):
        rock = Material("rock", turn / bent, 0.0, 2500.0, plane="stress")
        caplog.clear()
        system = system_of(polygons, [1, 0], [1, 4], joint=glue, rock=rock)
        state = after(system, WEIGHT, 1).state
        assert any("is bent by" in record.message for record in caplog.records) == reported
    with pytest.raises(NotConverged, match="'block 1' is bent by"):
        system.deflected.check_small(replace(state, deflection=20.0 * state.deflection))


@pytest.mark.parametrize("how", ["mirrored", "turned"])
def test_the_answer_does_not_depend_on_how_it_is_drawn(how):
    polygons = [rectangle(-3, -1, 3, 0), rectangle(-1, 0, 0.2, 0.6), rectangle(-1, 0.6, 1.2, 1.0)]
    loads = Loads(gravity=History.constant((0.0, -9.81)))
    drawn = after(system_of(polygons, [1, 0, 0], [1, 3, 4]), loads, 3)
    if how == "mirrored":
        polygons = [(polygon * [-1, 1])[::-1] for polygon in polygons]
        other = after(system_of(polygons, [1, 0, 0], [1, 3, 4]), loads, 3)
    else:
        c, s = np.cos(0.3), np.sin(0.3)
        loads = Loads(gravity=History.constant((9.81 * s, -9.81 * c)))
        other = after(system_of(polygons, [1, 0, 0], [1, 3, 4], angle=0.3), loads, 3)
    assert other.energy.elastic == pytest.approx(drawn.energy.elastic, rel=1e-6)
    assert other.energy.contact == pytest.approx(drawn.energy.contact, rel=1e-6)


@pytest.mark.parametrize("joint", [JointLaw("penalty", 0.6), BY_AREA])
def test_a_vertex_within_a_side_changes_nothing(joint):
    side = np.array([[0, 0], [1.3, 0], [4, 0], [4, 1], [0, 1.0]])
    floor = rectangle(-1, -1, 5, 0)
    plain, split = (
        after(system_of([floor, block], [1, 0], [1, 4], joint=joint), WEIGHT, 3)
        for block in (rectangle(0, 0, 4, 1), side)
    )
    # Penalties follow the length of the face that a corner stands for.
    assert split.energy.elastic == pytest.approx(plain.energy.elastic, rel=1e-5)
    if joint is BY_AREA:
        assert split.energy.contact == pytest.approx(plain.energy.contact, rel=1e-9)
    assert split.contacts["normal_force"].sum() == pytest.approx(4 * 2500 * 9.81, rel=1e-9)


def test_blocks_of_all_orders_stand_in_one_column():
    """Orders 1 to 8, one upon another, in one system: each bears the weight of what is above it."""
    polygons = [rectangle(-1, -1, 2, 0), *(rectangle(0, k, 1, k + 1) for k in range(8))]
    result = after(system_of(polygons, [1] + [0] * 8, [1, *range(1, 9)]), WEIGHT, 3)
    above = ROCK.density * 9.81 * (7.5 - np.arange(8))
    # The weight of 8 m strains the rock, and shortens arms, by 1e-5.
    assert result.state.stress[1:, 1] == pytest.approx(-above, rel=1e-5)
    assert result.statistics["unbalanced"] < 1e-9
