"""One step at a time: balance of forces, symmetry, states, cuts, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from block_problems import rectangle, turned

from geomech import dda
from geomech.conventions import rotate_stress
from geomech.model import (
    OPEN,
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
)  # fmt: skip

GRAVITY = History.constant([0.0, -9.81])


def imbalance(system: dda.BlockSystem, before: State, result: dda.StepResult) -> float:
    """Force and moment left over on the free blocks, relative to the largest single contribution."""
    f = result.forces
    n = system.blocks.n_blocks
    total = dda.contact_resultants(result.contacts, n, f.centroid)
    size = [np.abs(total).max()]

    def add(block, at, force):
        arm = at - f.centroid[block]
        row = np.array([force[0], force[1], arm[0] * force[1] - arm[1] * force[0]])
        total[block] += row
        size.append(np.abs(row).max())

    for row in f.points:
        add(row["block"], row["point"], row["force"])
    for row in f.edges:
        add(row["block"], 0.5 * (row["start"] + row["end"]), row["force"])
    # A linear body force field b0 + B x has the resultant A b0 and the moment ∫ (x b_y − y b_x) dA; inertia is that of
    # the block as the step began, turned to where the forces act.
    second = dda.block_moments(before.vertices, system.blocks.next_vertex, system.blocks.vertex_start)[:, 3:]
    second = rotate_stress(second, result.turn)
    b = f.body_force_gradient
    total[:, :2] += f.area[:, None] * f.body_force
    total[:, 2] += second[:, 0] * b[:, 1, 0] + second[:, 2] * (b[:, 1, 1] - b[:, 0, 0]) - second[:, 1] * b[:, 0, 1]
    size.append(np.abs(f.area[:, None] * f.body_force).max())
    return float(np.abs(total[~system.blocks.fixed]).max() / max(size))


@pytest.mark.parametrize("dynamic_factor", [0.0, 1.0])
def test_forces_on_every_block_balance_its_inertia(dynamic_factor):
    # Tilted wall with friction, a point load off centre, a traction and gravity: nothing is symmetric, some contacts
    # slide.
    polygons = [rectangle(-1, -1, 4, 0), rectangle(0, 0, 1, 1), rectangle(1, 0, 2, 1), rectangle(0.4, 1, 1.6, 1.8)]
    blocks = Blocks.from_polygons(
        [turned(p, 0.25) for p in polygons],
        fixed=[True, False, False, False],
        edge_names=[[[""] * 4], [[""] * 4], [[""] * 4], [["", "", "top", ""]]],
    )
    system = dda.BlockSystem(
        blocks,
        [Material("rock", 5e9, 0.2, density=2500.0)],
        [JointLaw("joint", friction_angle=0.3)],
        settings=DdaSettings(time_step=2e-3, dynamic_factor=dynamic_factor, max_displacement_ratio=0.05),
    )
    loads = Loads(
        gravity=GRAVITY,
        edge_tractions=(EdgeTraction("top", History.ramp([1e6, -4e6])),),
        point_loads=(PointLoad(1, tuple(turned(np.array([0.1, 0.8]), 0.25)), History.constant([2e4, -3e4])),),
    )
    state = State.at_rest(blocks)
    states = set()
    for _ in range(20):
        result = system.step(state, loads)
        # Round-off of a solve with penalty over inertia stiffness of up to 1e6: 1e-16 · 1e6, with a margin.
        assert imbalance(system, state, result) < 1e-9
        assert result.statistics["unbalanced"] < 1e-9
        states |= set(result.contacts["state"].tolist())
        state = result.state
    assert {OPEN, SLIP} <= states


def test_sliding_friction_is_the_current_normal_force_times_the_coefficient():
    blocks = Blocks.from_polygons(
        [turned(rectangle(-5, -1, 5, 0), 0.5), turned(rectangle(0, 0, 1, 1), 0.5)], fixed=[True, False]
    )
    system = dda.BlockSystem(
        blocks, [Material("rock", 10e9, 0.25, density=2600.0)], [JointLaw("joint", friction_angle=0.2)],
        settings=DdaSettings(time_step=1e-3, dynamic_factor=1.0, max_displacement_ratio=0.01),
    )  # fmt: skip
    state = State.at_rest(blocks)
    seen = 0
    for _ in range(50):
        state = system.step(state, Loads(gravity=GRAVITY)).state
        rows = state.contacts[state.contacts["state"] == SLIP]
        assert np.abs(rows["shear_force"]) == pytest.approx(np.tan(0.2) * rows["normal_force"], rel=1e-8)
        assert (rows["normal_force"] > 0).all()
        seen += len(rows)
    assert seen > 50


def test_specimen_between_platens_of_its_own_width(platens):
    blocks, materials = platens
    system = dda.BlockSystem(blocks, materials, [JointLaw("greased")], settings=DdaSettings(normal_penalty=200e9))
    loads = Loads(edge_tractions=(EdgeTraction("load:top", History.ramp([0.0, -0.2e6])),))
    state = State.at_rest(blocks)
    stretch = 1.0
    for _ in range(60):
        width = np.ptp(state.vertices[4:8, 0])
        height = np.ptp(state.vertices[4:8, 1])
        result = system.step(state, loads, 1.0)
        state = result.state
        stretch *= np.ptp(state.vertices[4:8, 1]) / height
        force = 0.2e6 * state.time * 0.06
        # Equilibrium is that of the geometry on which it was assembled: exact but for the inertia of the creeping load.
        assert state.stress[1] == pytest.approx([0.0, -force / width, 0.0], rel=1e-8, abs=1e-8 * force / width)
    rows = result.contacts[result.contacts["state"] != OPEN]
    assert len(rows) == 4
    assert rows["normal_force"] == pytest.approx(np.full(4, force / 2), rel=1e-7)
    assert rows["shear_force"] == pytest.approx(np.zeros(4), abs=1e-9 * force)
    assert rows["gap"] == pytest.approx(np.full(4, -force / 2 / 200e9), rel=1e-7)
    # Hooke's law in plane strain for the logarithmic strain, increments of which the steps add up: −σ (1−ν²)/E. The
    # mean stress over a step differs from that at its end by the step's own strain, 1e-5, over 60 steps of growing
    # load.
    strain = state.stress[1, 1] * (1 - 0.21**2) / 17e9
    assert np.log(stretch) == pytest.approx(strain, rel=2e-5)
    # Left and right stay mirror images to the round-off of a 0.14 m drawing.
    assert state.vertices[[4, 7, 8, 11], 0] == pytest.approx(-state.vertices[[5, 6, 9, 10], 0], abs=1e-14)


def test_the_same_specimen_with_friction_stays_symmetric(platens):
    blocks, materials = platens
    system = dda.BlockSystem(
        blocks, materials, [JointLaw("rough", friction_angle=0.4)], settings=DdaSettings(normal_penalty=200e9)
    )
    loads = Loads(edge_tractions=(EdgeTraction("load:top", History.ramp([0.0, -0.2e6])),))
    state = State.at_rest(blocks)
    for _ in range(20):
        result = system.step(state, loads, 1.0)
        state = result.state
    assert result.statistics["unbalanced"] < 1e-10
    assert state.stress[1, 0] < 0  # the platens hold the specimen's bulging back
    shear = {(int(r["vertex"]), int(r["edge"])): r["shear_force"] for r in result.contacts}
    force = 0.2e6 * state.time * 0.06
    # Pairs of corners carry equal and opposite shear; between sliding contacts the body floats sideways on its inertia
    # alone, so forces balance to 37 N/m times a drift below 1 µm, not to round-off.
    assert shear[2, 4] == pytest.approx(-shear[3, 4], abs=1e-8 * force)
    assert shear[9, 6] == pytest.approx(-shear[8, 6], abs=1e-8 * force)
    corners = state.vertices[4:8, 0]
    assert np.ptp([corners[0] + corners[1], corners[2] + corners[3]]) < 1e-9


def test_crack_response_softens_the_block_implicitly(platens):
    # Three times the block's own compliance added: an explicit exchange would diverge. e_c = offset + S σ.
    blocks, materials = platens
    system = dda.BlockSystem(blocks, materials, settings=DdaSettings(normal_penalty=200e9))
    loads = Loads(edge_tractions=(EdgeTraction("load:top", History.constant([0.0, -1e6])),))
    compliance, offset = np.zeros((3, 3, 3)), np.zeros((3, 3))
    compliance[1] = 3 * materials[0].compliance()
    offset[1] = [1e-6, -2e-6, 0.0]
    result = system.step(State.at_rest(blocks), loads, 1.0, crack=dda.CrackResponse(compliance, offset))
    stress = np.array([0.0, -1e6, 0.0])
    expected = 4 * materials[0].compliance() @ stress + offset[1]
    v = result.state.vertices[4:8]
    strain = np.array([np.ptp(v[:, 0]) / 0.06 - 1, np.ptp(v[:, 1]) / 0.12 - 1])
    # 1 MPa put on in one step of 1 s moves the platen's mass by 3e-5 m: inertia of 1e-8 of the load.
    assert result.state.stress[1] == pytest.approx(stress, rel=1e-7, abs=1e-1)
    assert strain == pytest.approx(expected[:2], rel=1e-7)
    assert result.state.crack_strain[1] == pytest.approx(offset[1] + compliance[1] @ stress, rel=1e-7, abs=1e-14)
    # The same response again changes nothing (but the load follows the width, 7e-5, of a strain of 2e-4 over 0.12 m):
    # strain increments are measured from what the cracks already carry.
    again = system.step(result.state, loads, 1.0, crack=dda.CrackResponse(compliance, offset))
    assert again.state.stress[1] == pytest.approx(stress, rel=1e-4, abs=1e2)
    assert np.ptp(again.state.vertices[4:8, 1]) == pytest.approx(np.ptp(v[:, 1]), abs=5e-9)
    # Zeros are an ordinary block, bit for bit.
    zero = dda.CrackResponse(np.zeros((3, 3, 3)), np.zeros((3, 3)))
    a, b = system.step(State.at_rest(blocks), loads, 1.0), system.step(State.at_rest(blocks), loads, 1.0, crack=zero)
    assert np.array_equal(a.state.vertices, b.state.vertices)


def test_a_step_never_changes_the_state_it_starts_from(platens):
    blocks, materials = platens
    system = dda.BlockSystem(blocks, materials, [JointLaw("rough", friction_angle=0.4)])
    loads = Loads(gravity=GRAVITY, edge_tractions=(EdgeTraction("load:top", History.constant([1e5, -1e6])),))
    state = system.step(State.at_rest(blocks), loads, 1.0).state
    names = ("vertices", "velocity", "stress", "rotation", "crack_strain", "contacts")
    before = {name: getattr(state, name).copy() for name in names}
    for name in names:
        getattr(state, name).setflags(write=False)
    system.step(state, loads, 1.0)
    assert all(np.array_equal(before[name], getattr(state, name)) for name in names)


def test_cohesion_holds_until_it_fails_and_is_then_lost():
    # A block on level ground pushed sideways by a growing force: c ℓ + W tan φ, then W tan φ (Coulomb 1785).
    blocks = Blocks.from_polygons([rectangle(-5, -1, 5, 0), rectangle(0, 0, 1, 1)], fixed=[True, False])
    joint = JointLaw("bonded", friction_angle=np.radians(30), cohesion=20e3)
    system = dda.BlockSystem(
        blocks, [Material("rock", 10e9, 0.0, density=2600.0)], [joint], settings=DdaSettings(max_displacement_ratio=0.5)
    )
    # ν = 0: a block that bulges under its weight drags its two contacts apart, and the first would fail early.
    strength = 20e3 + 2600 * 9.81 * np.tan(np.radians(30))
    loads = Loads(gravity=GRAVITY, point_loads=(PointLoad(1, (0.5, 0.0), History.ramp([strength / 100, 0.0])),))
    state = State.at_rest(blocks)
    while state.time < 99:
        state = system.step(state, loads, 1.0).state
    assert set(state.contacts["state"].tolist()) == {STICK} and state.contacts["bonded"].all()
    assert state.contacts["length"] == pytest.approx([0.5, 0.5])
    result = system.step(system.step(state, loads, 1.0).state, loads, 1.0)
    rows = result.contacts
    assert set(rows["state"].tolist()) == {SLIP} and not rows["bonded"].any()
    assert np.abs(rows["shear_force"]).sum() == pytest.approx(2600 * 9.81 * np.tan(np.radians(30)), rel=1e-5)


def test_tensile_strength_holds_a_hanging_block_until_it_fails():
    blocks = Blocks.from_polygons([rectangle(0, 1, 1, 2), rectangle(0, 0, 1, 1)], fixed=[True, False])
    weight = 2600 * 9.81
    settings = DdaSettings(max_displacement_ratio=0.5)
    rock = [Material("rock", 10e9, 0.25, density=2600.0)]
    for strength, holds in ((1.01, True), (0.99, False)):
        joint = JointLaw("glue", cohesion=1e6, tensile_strength=strength * weight)
        result = dda.BlockSystem(blocks, rock, [joint], settings=settings).step(
            State.at_rest(blocks), Loads(gravity=GRAVITY), 1.0
        )
        assert (result.contacts["state"] != OPEN).all() == holds
        if holds:
            assert result.contacts["normal_force"].sum() == pytest.approx(-weight, rel=1e-4)
            assert result.state.stress[1, 1] == pytest.approx(weight / 2, rel=1e-3)


def test_joint_stiffness_replaces_the_penalty():
    blocks = Blocks.from_polygons(
        [rectangle(0, 0, 2, 1), rectangle(0, 1, 2, 2)],
        fixed=[True, False],
        edge_names=[[[""] * 4], [["", "", "top", ""]]],
    )
    joint = JointLaw("soft", normal_stiffness=1e9, shear_stiffness=0.5e9, friction_angle=1.0)
    system = dda.BlockSystem(
        blocks, [Material("rock", 10e12, 0.25)], [joint], settings=DdaSettings(max_displacement_ratio=1.0)
    )
    loads = Loads(edge_tractions=(EdgeTraction("top", History.constant([0.3e5, -1e5])),))
    result = system.step(State.at_rest(blocks), loads, 1.0)
    # Closure p/kₙ; the shear couple tilts the block within the kern, so the mean over both contacts is compared.
    assert -result.contacts["gap"].mean() == pytest.approx(1e5 / 1e9, rel=1e-6)
    drag = result.contacts["shear_force"].sum() / (0.5e9 * 2)
    assert abs(drag) == pytest.approx(0.3e5 / 0.5e9, rel=1e-6)


def test_the_largest_displacement_of_a_step_is_bounded():
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1)])
    system = dda.BlockSystem(
        blocks, [Material("rock", 10e9, 0.25, density=2600.0)],
        settings=DdaSettings(time_step=0.1, dynamic_factor=1.0, max_displacement_ratio=0.02),
    )  # fmt: skip
    state, steps = State.at_rest(blocks), 0
    while state.time < 0.3:
        result = system.step(state, Loads(gravity=GRAVITY), min(0.1, 0.3 - state.time))
        assert result.statistics["max_displacement_ratio"] <= 0.02 * 1.001
        state, steps = result.state, steps + 1
        assert steps < 200
    # However the steps were cut, constant acceleration is integrated exactly: round-off of a hundred additions.
    assert state.vertices[0, 1] == pytest.approx(-0.5 * 9.81 * 0.09, rel=1e-12)


def test_refusals_say_what_is_wrong(platens):
    blocks, materials = platens
    system = dda.BlockSystem(blocks, materials)
    with pytest.raises(ValueError, match=r"no edge has that name.*load:top"):
        system.step(
            State.at_rest(blocks), Loads(edge_tractions=(EdgeTraction("topp", History.constant([0.0, 1.0])),)), 1.0
        )
    with pytest.raises(ValueError, match="positive"):
        system.step(State.at_rest(blocks), Loads(), 0.0)
    with pytest.raises(ValueError, match="material 1"):
        dda.BlockSystem(blocks, materials[:1])
    with pytest.raises(ValueError, match="joint law 3"):
        dda.BlockSystem(blocks, materials, joint_index=lambda a, b: 3).step(State.at_rest(blocks), Loads(), 1.0)
    with pytest.raises(ValueError, match="compliance"):
        dda.CrackResponse(np.zeros((3, 3)), np.zeros((3, 3)))


@pytest.mark.parametrize("factor", [0.0, 1.0])
def test_failure_names_the_reason_the_contact_and_in_motion_a_way_out(factor):
    blocks = Blocks.from_polygons(
        [rectangle(-5, -1, 5, 0), rectangle(0, 0, 1, 1)], fixed=[True, False], names=["ground", "box"]
    )
    settings = DdaSettings(
        max_open_close_iterations=1, max_step_cuts=2, max_displacement_ratio=0.1, dynamic_factor=factor
    )
    system = dda.BlockSystem(
        blocks, [Material("rock", 10e9, 0.25, density=2600.0)], [JointLaw("j", friction_angle=0.1)], settings=settings
    )
    loads = Loads(gravity=GRAVITY, point_loads=(PointLoad(1, (0.5, 0.1), History.constant([1e5, 0.0])),))
    with pytest.raises(dda.NotConverged, match=r"2 cuts.*open-close.*'box' on 'ground'") as refused:
        system.step(State.at_rest(blocks), loads, 1.0)
    assert ('dda.springs = "resolved"' in str(refused.value)) == bool(factor)


def test_a_step_that_is_cut_tells_the_log_why(caplog):
    bricks = [rectangle(i + 0.5 * (j % 2), j, i + 1 + 0.5 * (j % 2), j + 1) for j in range(3) for i in range(4)]
    blocks = Blocks.from_polygons([rectangle(-1, -1, 6, 0), *bricks], fixed=[True] + [False] * len(bricks))
    settings = DdaSettings(time_step=0.01, dynamic_factor=1.0, max_open_close_iterations=2, max_displacement_ratio=10.0)
    system = dda.BlockSystem(
        blocks, [Material("rock", 10e9, 0.25, density=2600.0)], [JointLaw("j", friction_angle=0.5)], settings=settings
    )
    with caplog.at_level("INFO"):
        result = system.step(State.at_rest(blocks), Loads(gravity=GRAVITY))
    cuts = int(result.statistics["step_cuts"])
    assert cuts > 0 and result.dt == 0.01 / 2**cuts
    said = [r.getMessage() for r in caplog.records]
    assert len(said) == 1 and f"cut from 0.01 to {result.dt:.4g} s: contact states did not settle in" in said[0]
    assert "a corner of 'block" in said[0]


def test_an_edge_pair_without_a_law_does_not_touch():
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1), rectangle(0, 1, 1, 2)], fixed=[True, False])
    system = dda.BlockSystem(blocks, [Material("rock", 10e9, 0.25, density=2600.0)], joint_index=lambda a, b: None)
    assert len(system.step(State.at_rest(blocks), Loads(), 1.0).contacts) == 0


def test_run_yields_states_until_the_end_time():
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1)])
    settings = DdaSettings(time_step=0.03, dynamic_factor=1.0, max_displacement_ratio=1.0)
    states = list(
        dda.run(blocks, [Material("rock", 10e9, 0.25, density=2600.0)], [], Loads(gravity=GRAVITY), settings, 0.1)
    )
    assert [s.time for s in states] == pytest.approx([0, 0.03, 0.06, 0.09, 0.1])
    assert states[-1].vertices[0, 1] == pytest.approx(-0.5 * 9.81 * 0.01, rel=1e-12)


def test_statics_under_gravity_need_a_fixed_block():
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1)])
    rock, weight = Material("rock", 10e9, 0.25, density=2600.0), Loads(gravity=History.constant([0.0, -9.81]))
    with pytest.raises(ValueError, match="no block is fixed"):
        list(dda.run(blocks, [rock], [], weight, DdaSettings(), 1.0))
    *_, last = dda.run(blocks, [rock], [], weight, DdaSettings(dynamic_factor=1.0, time_step=0.01), 0.1)
    assert last.vertices[0, 1] == pytest.approx(-0.5 * 9.81 * 0.1**2)
