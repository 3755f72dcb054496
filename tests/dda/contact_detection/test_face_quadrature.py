"""Joints with a stiffness resist rotation as an elastic bed does: Winkler's, that cannot pull."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geomech import dda
from geomech.dda.contact_detection.face_quadrature import FacePoints
from geomech.dda.energy_balance import EnergyBudget
from geomech.model import STICK, Blocks, DdaSettings, History, JointLaw, Loads, Material, PointLoad, State

FACE, STIFFNESS, THRUST = 2.0, 1e10, 1e6
BED = JointLaw("bed", 0.5, normal_stiffness=STIFFNESS, shear_stiffness=STIFFNESS)


def rotation_on_a_bed(eccentricity: float, stiffness: float = STIFFNESS) -> float:
    """Turn of a rigid block on an elastic bed under a thrust (rad): M/(k ℓ³/12) within the kern, beyond it the pressure
    is a triangle over c = 3 (ℓ/2 − e), so that k θ c²/2 = N."""
    e = abs(eccentricity)
    if e <= FACE / 6:
        turn = THRUST * e / (stiffness * FACE**3 / 12)
    else:
        turn = 2 * THRUST / (stiffness * (3 * (FACE / 2 - e)) ** 2)
    return -np.copysign(turn, eccentricity)


def on_a_bed(law: JointLaw = BED, turn: float = 0.0, back: bool = False, beside: float = 0.0, **settings):
    """A block of 2 m × 1 m on a fixed one that ends ``beside`` (m) beyond its ends; turned by ``turn`` (rad) and,
    ``back``, numbered the other way."""
    lower = np.array([[-beside, -1], [FACE + beside, -1], [FACE + beside, 0], [-beside, 0]])
    upper = np.array([[0.0, 0], [FACE, 0], [FACE, 1], [0, 1]])
    c, s = np.cos(turn), np.sin(turn)
    polygons, fixed = [p @ np.array([[c, s], [-s, c]]) for p in (lower, upper)], [True, False]
    blocks = Blocks.from_polygons(polygons[::-1] if back else polygons, fixed=fixed[::-1] if back else fixed)
    rock = Material("rock", 1e15, 0.0, density=2600.0)
    return dda.BlockSystem(blocks, [rock], [law], settings=DdaSettings(max_displacement_ratio=0.5, **settings))


def pressed(system: dda.BlockSystem, eccentricity: float, thrust: float = THRUST, steps: int = 3, dt: float = 10.0):
    """The last of a few static steps under ``thrust`` (N) at ``eccentricity`` (m) along the face."""
    upper = int(np.flatnonzero(~system.blocks.fixed)[0])
    edge = system.blocks.vertices[system.blocks.vertex_start[upper] :][:2]
    along = (edge[1] - edge[0]) / FACE
    at, force = edge.mean(axis=0) + eccentricity * along, thrust * np.array([along[1], -along[0]])
    loads = Loads(point_loads=(PointLoad(upper, tuple(at), History.constant(force)),))
    state = State.at_rest(system.blocks)
    for _ in range(steps):
        result = system.step(state, loads, dt)
        state = result.state
    return result, float(state.rotation[upper])


@pytest.mark.parametrize(
    ("turn", "back", "beside"), [(0.0, False, 0.5), (0.6, True, 0.5), (2.0, False, 0.0), (3.0, True, 0.3)]
)
def test_rotation_on_an_elastic_bed_with_and_without_lift_off(verified, turn, back, beside):
    errors, parts = [], []
    for eccentricity in (0.1, -0.3, FACE / 6, 0.5, -0.7, 0.9):
        result, rotation = pressed(on_a_bed(turn=turn, back=back, beside=beside), eccentricity)
        errors.append(rotation / rotation_on_a_bed(eccentricity) - 1)
        rows = result.contacts[result.contacts["length"] > 0]
        # Where the resultant acts, and that the corners' forces are those of the pressure: F = N (1/2 ± e/ℓ).
        share = np.sort(rows["normal_force"]) / THRUST
        assert share == pytest.approx([0.5 - abs(eccentricity) / FACE, 0.5 + abs(eccentricity) / FACE], abs=1e-4)
        gap = np.sort(rows["gap"])
        parts.append(FACE * -gap[0] / (gap[1] - gap[0]) if gap[1] > 0 else FACE)
        if abs(eccentricity) > FACE / 6 + 1e-9:
            assert parts[-1] == pytest.approx(3 * (FACE / 2 - abs(eccentricity)), rel=1e-3)
    print("rotation off by", " ".join(f"{e:.1e}" for e in errors), "; length in contact", np.round(parts, 4))
    verified(
        "joint with a stiffness under an eccentric thrust, within and beyond the kern: rotation",
        np.abs(errors).max(),
        "elastic bed without tension",
    )
    # The part in contact is known to 1e-3 of itself, forces to the square of it; the block has turned by up to 2e-3.
    assert np.abs(errors).max() < 2e-5


@pytest.mark.parametrize("gain", [-0.7, -1.0, -2.0])
def test_parts_that_go_back_and_forth_with_their_neighbours_come_to_rest(gain):
    """The face ends where gain times what it was taken for says: with a gain of −1 it would go to and fro for ever,
    with −2 it would be thrown about. To the hundredth that parts are known to, after half a dozen iterations."""
    rest, n = 0.5, 0
    faces = FacePoints(
        np.array([[0, 1]]), np.zeros((2, 7)), np.ones(1), np.array([[0.0, 0.6]]), np.zeros(1, bool), np.full(1, 0.05),
        np.full(1, 3**-0.5), np.zeros(1, bool), np.ones(1), np.zeros((1, 2)), np.ones(1),
    )  # fmt: skip
    while faces is not None and n < 8:
        last, n = faces, n + 1
        gap = 1e-5 * (faces.place[0] - (rest + gain * (faces.part[0, 1] - rest)))
        faces = faces.better(gap, np.full(2, STICK), np.zeros(2, bool))
    assert faces is None
    assert last.part[0] == pytest.approx([0.0, rest], abs=1e-2)


@pytest.mark.parametrize("eccentricity", [-0.7, 0.1, 0.7])
def test_faces_that_do_not_fit_each_other_press_where_they_meet(eccentricity):
    """A block that stands askew on its bed, by as much as told contacts say that the two faces do not fit: it presses
    and turns as one on a level bed does. (Had its springs the misfit of their corners where they stand, it would hang
    on one, open and in the rock.)"""
    lower, upper = np.array([[-1.0, -1], [3, -1], [3, 0], [-1, 0]]), np.array([[0.0, 0], [FACE, 0], [FACE, 1], [0, 1]])
    askew = 2e-3
    upper = upper + np.array([[0.0, askew]]) * upper[:, :1]
    blocks = Blocks.from_polygons([lower, upper], fixed=[True, False])
    system = dda.BlockSystem(
        blocks, [Material("rock", 1e15, 0.0)], [BED], settings=DdaSettings(max_displacement_ratio=0.5)
    )
    state = State.at_rest(blocks)
    found = system.contacts_near(state)
    some, none = np.flatnonzero(found.geometry[:, 4] > 0), np.zeros(2)
    assert len(some) == 2
    told = dda.InheritedContacts(which=some, normal=np.full(2, 1.0), shear=none, gap=none, slip=none)
    state = system.with_inherited_contacts(state, found, told)
    loads = Loads(
        point_loads=(
            PointLoad(1, (1.0 + eccentricity, askew * (1.0 + eccentricity)), History.constant([0.0, -THRUST])),
        )
    )
    for _ in range(3):
        state = system.step(state, loads, 10.0).state
    # (On the slope forces are off by its square, arms by the thrust's on the way down.)
    assert state.rotation[1] == pytest.approx(rotation_on_a_bed(eccentricity), rel=2e-3)


def test_springs_at_the_corners_would_resist_three_times_as_much():
    _, rotation = pressed(on_a_bed(), 0.1)
    assert rotation == pytest.approx(-12 * THRUST * 0.1 / (STIFFNESS * FACE**3), rel=1e-6)
    # Without a stiffness of its own a joint is held at its corners by penalties: nothing has changed there.
    system = on_a_bed(JointLaw("plain", 0.5), normal_penalty=STIFFNESS, shear_penalty=STIFFNESS)
    _, rotation = pressed(system, 0.1)
    assert rotation == pytest.approx(-THRUST * 0.1 / (2 * STIFFNESS * (FACE / 2) ** 2), rel=1e-6)


def test_a_block_rocks_on_its_bed_at_the_frequency_of_the_springs():
    """ω² = k ℓ³/12 / J about the middle of the base, from half a turn to the next."""
    height, density = 1.0, 2600.0
    # A bond keeps the whole face in contact; along it nothing gives.
    bond = JointLaw("bond", 0.5, 1e12, 1e12, normal_stiffness=STIFFNESS, shear_stiffness=1e4 * STIFFNESS)
    system = on_a_bed(bond, beside=0.5, dynamic_factor=1.0, newmark=(0.25, 0.5), damping=0.0)
    inertia = density * FACE * height * ((FACE**2 + height**2) / 12 + height**2 / 4)
    omega = np.sqrt(STIFFNESS * FACE**3 / 12 / inertia)
    state = State.at_rest(system.blocks)
    velocity = state.velocity.copy()
    velocity[1, [0, 2]] = np.array([-height / 2, 1.0]) * 1e-5 * omega
    state = replace(state, velocity=velocity)
    dt = 2 * np.pi / omega / 100
    turns = []
    for _ in range(110):
        state = system.step(state, Loads(), dt).state
        turns.append(float(state.rotation[1]))
    turns = np.array(turns)
    k = np.flatnonzero(turns[:-1] * turns[1:] < 0)[:2]
    crossing = k + turns[k] / (turns[k] - turns[k + 1])
    found = np.pi / (np.diff(crossing)[0] * dt) / omega
    print(f"frequency of rocking {found:.5f} of the bed's")
    # The trapezoidal rule lengthens the period by (ω dt)²/12 = 3.3e-4.
    assert found == pytest.approx(1 - 3.3e-4, abs=1e-4)


def test_a_block_that_is_dropped_askew_on_a_soft_joint_gains_no_energy():
    """Parts in contact come and go: what is stored on them is told by as much as they change in a step."""
    lost = []
    for dt in (1e-3, 2.5e-4):
        system = on_a_bed(JointLaw("soft", 0.6, normal_stiffness=1e9), beside=0.5, dynamic_factor=1.0, damping=0.0)
        state, budget = State.at_rest(system.blocks), dda.EnergyBudget()
        velocity = state.velocity.copy()
        velocity[1, 1:3] = -0.5, 0.5
        state = replace(state, velocity=velocity)
        while state.time < 0.06 * (1 - 1e-12):
            result = system.step(state, Loads(gravity=History.constant([0.0, -9.81])), dt)
            budget, state = budget.after(result.energy, result.state.time), result.state
        lost.append(-budget.residual / budget.turnover)
    print(f"part of the energy that is out of sight: {lost[0]:.1e}, with a quarter of the step {lost[1]:.1e}")
    assert -1e-4 < lost[1] < 0.01 and lost[1] < 0.3 * lost[0]


def test_the_same_step_again_begins_with_the_parts_that_it_has_ended_with():
    """Passes between blocks and cracks repeat a step: it is not sought again where faces touch."""
    system, push = on_a_bed(), PointLoad(1, (FACE / 2 + 0.7, 1.0), History.constant([0.0, -THRUST]))
    first = system.step(State.at_rest(system.blocks), Loads(point_loads=(push,)), 10.0)
    again = system.step(State.at_rest(system.blocks), Loads(point_loads=(push,)), 10.0, like=first)
    assert first.statistics["open_close_iterations"] > 3
    assert again.statistics["open_close_iterations"] == 1
    assert again.state.rotation == pytest.approx(first.state.rotation, rel=1e-3)


def test_a_face_that_goes_back_and_forth_stands_on_its_corners(monkeypatch):
    """One step's worth of it: the rotation is that of springs k ℓ/2 at the corners, M/(k ℓ³/4)."""
    tried = []

    def restless(self, gap, state, holds):
        tried.append(len(self.ends))
        there = np.array([[0.0, 0.9]]) if len(tried) % 2 else np.array([[0.1, 1.0]])
        return replace(self, part=np.broadcast_to(there, self.part.shape).copy())

    monkeypatch.setattr(FacePoints, "better", restless)
    _, turn = pressed(on_a_bed(beside=0.5), 0.1, steps=1)
    assert tried == [1] * 20
    assert turn == pytest.approx(-THRUST * 0.1 / (STIFFNESS * FACE**3 / 4), rel=1e-5)


@pytest.mark.parametrize("eccentricity", [0.2, -0.4])
def test_rows_tell_of_forces_that_hold_the_block(eccentricity):
    """Springs inside a face that gives and turns: forces at its corners, off the block by what it gives there, are in
    equilibrium with the thrust where they are said to act."""
    system, at = on_a_bed(beside=0.5), np.array([FACE / 2 + eccentricity, 1.0])
    push = PointLoad(1, tuple(at), History.constant([0.3 * THRUST, -THRUST]))
    state = State.at_rest(system.blocks)
    for _ in range(4):
        result = system.step(state, Loads(point_loads=(push,)), 1e4)
        before, state = state, result.state
    turn = state.rotation[1]
    at = before.vertices[4] + np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ at
    x, y, moment = dda.contact_resultants(result.contacts, 2, np.array([at, at]))[1]
    assert [x, y] == pytest.approx([-0.3 * THRUST, THRUST], rel=1e-6)
    assert abs(moment) < 1e-8 * THRUST * FACE


def test_points_that_part_lose_their_shear_and_points_that_come_to_touch_begin_without():
    """A bed sheared by H, rocked until it touches along c, set down again and let go has moved by H/(kₛ ℓ), H/(kₛ c), no
    more, and H/(kₛ c) − H/(kₛ ℓ): every spring that touches has gone along. None of it comes from nowhere (with shear
    carried whole two thirds of ½ H²/(kₛ ℓ) would)."""
    rough = JointLaw("rough", 1.4, normal_stiffness=STIFFNESS, shear_stiffness=STIFFNESS)
    system, shear, farthest = on_a_bed(rough), 2 * THRUST, 0.6
    state, budget = State.at_rest(system.blocks), EnergyBudget()
    moved = []
    eccentric = [0.0, 0.0, *np.linspace(0.1, farthest, 6), *np.linspace(farthest, 0.0, 4), 0.0]
    for number, eccentricity in enumerate(eccentric):
        thrust = PointLoad(1, (FACE / 2 + eccentricity, 0.0), History.constant([0.0, -THRUST]))
        pull = PointLoad(1, (FACE / 2, 0.0), History.constant([shear if number < len(eccentric) - 1 else 0.0, 0.0]))
        result = system.step(state, Loads(point_loads=(thrust, pull)), 10.0)
        state, budget = result.state, budget.after(result.energy)
        moved.append(float((state.vertices[4:6] - system.blocks.vertices[4:6])[:, 0].mean()))
    whole, rocked = shear / (STIFFNESS * FACE), shear / (STIFFNESS * 3 * (FACE / 2 - farthest))
    print("moved", np.round(np.array(moved) / whole, 4), f"residual {budget.residual / (0.5 * shear * whole):.3f}")
    assert moved[1] == pytest.approx(whole, rel=1e-4)
    # The part in contact is known to a hundredth of itself.
    assert moved[7] == pytest.approx(rocked, rel=1e-2)
    assert moved[-2] == pytest.approx(moved[7], rel=1e-3)
    assert moved[-1] == pytest.approx(moved[-2] - whole, rel=1e-3)
    assert abs(budget.residual) < 0.03 * 0.5 * shear * whole
