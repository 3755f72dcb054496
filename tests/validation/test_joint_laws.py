"""Joint laws against published values and closed laws: direct shear under constant load and constant stiffness, sliding
that weakens, faces that close."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import replace

import numpy as np
import pytest
from block_problems import rectangle

from geomech import dda
from geomech.dda.joint_laws.nonlinear_laws import rough_strength
from geomech.model import (
    BlockMotion,
    Blocks,
    DdaSettings,
    EdgeTraction,
    History,
    JointLaw,
    Loads,
    Material,
    Roughness,
    State,
)
from geomech.reference.blocks import block_motion, joints

YOUNGS_MODULUS, POISSON = 50e9, 0.25
#: Two penalty springs hold the block on the joint.
PENALTY = 2 * 40 * YOUNGS_MODULUS / (1 - POISSON**2)
ANGLE, RESIDUAL = math.radians(40), math.radians(30)
ROUGH = Roughness(10.0, 50e6)


SEAT = rectangle(-1, -0.5, 2, 0)
#: Pa, on top of the sheared block.
PRESSURE = 1e6


def direct_shear(law: JointLaw, travel=0.02, n=100, wall=None, back=False, seat=SEAT, contact="penalty", seen=None):
    """A 1 m block pressed on a joint by `PRESSURE` and pushed along it by a heavy ram of constant speed, against a
    frictionless ``wall`` (Pa/m) above it if one is given; a second ram pushes it ``back`` by as much in as many steps more. ``seat``
    is the polygon below the joint; ``seen``, a list, gets the joint's contacts.

    Per step: shear and normal force N, slip, wear, lift, gap m; and the mean of the iterations.
    """
    polygons = [seat, rectangle(0, 0, 1, 0.5), rectangle(-0.5, 0.1, 0, 0.4)]
    names = [[["joint"] * len(seat)], [["joint", "side", "top", "side"]], [[""] * 4]]
    laws = [JointLaw("greased"), law]
    held = [[False] * 6, [False, False] + [True] * 4, [False] + [True] * 5]
    fixed = [True, False, False]
    if back:
        polygons.append(rectangle(1.0, 0.1, 1.5, 0.4))
        names.append([[""] * 4])
        held.append(held[2])
        fixed.append(False)
    if wall is not None:
        polygons.append(rectangle(-1, 0.5, 2, 1))
        names.append([["wall", "", "", ""]])
        laws.append(JointLaw("wall", normal_stiffness=wall))
        held.append([False] * 6)
        fixed.append(True)

    def index(a, b):
        return 2 if "wall" in (a, b) else int("joint" in (a, b) and "top" not in (a, b))

    blocks = Blocks.from_polygons(
        polygons, fixed=fixed, edge_names=names, constrained=held, material=[0, 0] + [1 - f for f in fixed[2:]]
    )
    materials = [Material(name, YOUNGS_MODULUS, POISSON, density=d) for name, d in (("light", 1.0), ("ram", 1e12))]
    settings = DdaSettings(
        dynamic_factor=1.0, damping=0.0, max_displacement_ratio=0.5,
        normal_penalty=PENALTY / 2, shear_penalty=PENALTY / 2, contact=contact,
    )  # fmt: skip
    static = dda.BlockSystem(blocks, materials, laws, index, dataclasses.replace(settings, dynamic_factor=0.0))
    system = dda.BlockSystem(blocks, materials, laws, index, settings)
    loads = Loads(edge_tractions=(EdgeTraction("top", History.constant([0.0, -PRESSURE])),))
    state = static.step(static.step(State.at_rest(blocks), loads, 1e3).state, loads, 1e3).state
    state.velocity[:] = 0.0
    state.velocity[2, 0] = travel
    if back:
        state.velocity[3, 0] = travel
    rows, iterations = [], []
    for step in range(2 * n if back else n):
        if step == n:
            state.velocity[:] = 0.0
            state.velocity[2:4, 0] = -travel
        result = system.step(state, loads, 1.0 / n)
        assert result.statistics["step_cuts"] == 0
        state = result.state
        c = result.contacts[(result.contacts["law"] == 1) & (result.contacts["normal_force"] > 0)]
        assert c["lift"].std() < 1e-12
        if seen is not None:
            seen.append(result.contacts[result.contacts["law"] == 1])
        rows.append(
            [abs(c["shear_force"].sum()), c["normal_force"].sum()]
            + [float(np.abs(c[name]).mean()) for name in ("slip", "wear", "lift")]
            + [float(c["gap"].mean())]
        )
        iterations.append(result.statistics["open_close_iterations"])
    return np.array(rows).T, float(np.mean(iterations))


def test_rough_strength_is_the_published_table(verified):
    # Three decimals are printed.
    angle, jrc, jcs = joints.ROUGH_JOINT_EXAMPLE
    pressure, expected, slope, cohesion = joints.ROUGH_JOINT_TABLE.T
    full, n = 1e6 * pressure, len(pressure)
    strength, tangent, _ = rough_strength(full, np.full(n, jrc), np.full(n, jcs), np.full(n, angle))
    # The table's normal stresses are printed to three decimals too: 5e-4 of 0.36 MPa moves the rest by as much again.
    verified(
        "rough joint: strengths of the published table, MPa",
        np.abs(strength / 1e6 - expected).max(),
        "Barton",
        unit="MPa",
    )
    assert strength / 1e6 == pytest.approx(expected, abs=1.5e-3)
    assert tangent == pytest.approx(slope, abs=1.5e-3)
    assert (strength - tangent * full) / 1e6 == pytest.approx(cohesion, abs=1.5e-3)
    h = 1e-3 * full
    either = [rough_strength(p, np.full(n, jrc), np.full(n, jcs), np.full(n, angle))[0] for p in (full - h, full + h)]
    # The first row stands just below the limit of 70°, where the law has a corner.
    assert tangent[1:] == pytest.approx(((either[1] - either[0]) / (2 * h))[1:], rel=1e-5)


def test_rough_strength_is_limited_at_both_ends():
    one = np.ones(3)
    strength, slope, dilation = rough_strength(np.array([0.0, 1.0, 1e9]), 20 * one, 1e8 * one, RESIDUAL * one)
    assert strength[:2] == pytest.approx([0.0, math.tan(math.radians(joints.STEEPEST_ANGLE_DEG))])
    assert strength[2] == pytest.approx(1e9 * math.tan(RESIDUAL)) and dilation[2] == 0
    assert slope == pytest.approx(strength / [1.0, 1.0, 1e9], abs=3.0) and slope[1] == pytest.approx(strength[1])


def test_roughness_of_long_joints():
    # Barton & Bandis (1982): JRC 15, JCS 100 MPa of 0.1 m samples on a joint of 1 m.
    long = Roughness(15.0, 100e6, length=1.0)
    assert long.jrc_in_place == pytest.approx(15 * 10**-0.3)
    assert long.jcs_in_place == pytest.approx(100e6 * 10**-0.45)
    assert long.peak_slip == pytest.approx(1 / 500 * (15 * 10**-0.3) ** 0.33)


@pytest.mark.parametrize("softening", [0.0, 5e-3])
def test_direct_shear_falls_from_peak_to_residual(softening):
    law = JointLaw(
        "weakens", ANGLE, cohesion=1e5, residual_friction_angle=RESIDUAL, residual_cohesion=2e4,
        softening_slip=softening,
    )  # fmt: skip
    (shear, normal, slip, _, _, _), iterations = direct_shear(law)
    left = np.clip(1 - slip / softening, 0, 1) if softening else 0.0
    expected = (math.tan(RESIDUAL) + (math.tan(ANGLE) - math.tan(RESIDUAL)) * left) * normal + 2e4 + 8e4 * left
    # The law holds to what open–close iterations agree to.
    assert shear == pytest.approx(expected, rel=2e-8)
    assert normal == pytest.approx(np.full(len(normal), 1e6), rel=1e-6)
    assert iterations < 2


@pytest.mark.parametrize("wall", [None, 2e9])
def test_direct_shear_with_dilation_up_to_a_critical_slip(wall):
    slope = math.tan(math.radians(10))
    law = JointLaw("dilates", ANGLE, dilation_angle=math.radians(10), dilation_slip=8e-3)
    (shear, normal, slip, _, lift, gap), _ = direct_shear(law, wall=wall)
    assert lift == pytest.approx(slope * np.minimum(slip, 8e-3), rel=1e-7)
    assert shear == pytest.approx(math.tan(ANGLE) * normal, rel=1e-8)
    # The wall is pressed by the lift less the closure of the joint's own springs, N/k. The block's inertia, though
    # light, is a millionth of the load.
    wall = wall or 0.0
    assert normal == pytest.approx((1e6 + wall * lift) / (1 + wall / PENALTY), rel=2e-6)
    assert gap == pytest.approx(-normal / PENALTY, rel=1e-6)


@pytest.mark.parametrize(
    ("seat", "contacts"),
    [
        ([[-1, -0.5], [1.01, -0.5], [1.01, 0], [-1, 0]], 2),
        ([[-1, -0.5], [2, -0.5], [2, 0], [1.005, 0], [1.005, -0.1], [0.5, -0.1], [0.5, 0], [-1, 0]], 4),
    ],
    ids=["over the edge", "over a recess"],
)
def test_contacts_that_follow_one_another_pass_on_what_the_joint_has_become(seat, contacts):
    # The block's corner slides off its seat, and the seat's corner carries it from then on; or onto the far side of a
    # recess, which it has not touched before: as worn and as far lifted (`direct_shear` holds that all contacts are).
    law = JointLaw("worn", ANGLE, residual_friction_angle=RESIDUAL, softening_slip=5e-3, dilation_angle=math.radians(8))
    seen: list[np.ndarray] = []
    (shear, normal, slip, wear, lift, gap), _ = direct_shear(law, seat=np.array(seat, dtype=float), seen=seen)
    assert wear == pytest.approx(slip) and slip[-1] == pytest.approx(0.02, rel=2e-3)
    assert lift == pytest.approx(math.tan(math.radians(8)) * slip, rel=1e-3)
    assert shear[-1] == pytest.approx(math.tan(RESIDUAL) * normal[-1], rel=1e-6)
    assert gap.max() < 0
    # A contact that still hangs free follows a step behind: 2e-4 m of slip.
    facing = seen[-1][seen[-1]["wear"] > 0]
    assert len(facing) == contacts and facing["wear"].min() > wear[-1] - 3e-4
    assert (facing["gap"] < 3e-5).all()


@pytest.mark.parametrize("contact", ["penalty", "augmented"])
def test_shear_to_and_fro(contact):
    # Sliding back, faces sink again by what they rose, and do not regain what they lost.
    law = JointLaw(
        "to and fro", ANGLE, residual_friction_angle=RESIDUAL, softening_slip=5e-3, dilation_angle=math.radians(8),
    )  # fmt: skip
    (shear, normal, slip, wear, lift, gap), _ = direct_shear(law, travel=0.01, n=50, back=True, contact=contact)
    left = np.clip(1 - wear / 5e-3, 0, 1)
    expected = (math.tan(RESIDUAL) + (math.tan(ANGLE) - math.tan(RESIDUAL)) * left) * normal
    sliding = np.diff(wear, prepend=0.0) > 0
    assert sliding.sum() > 95
    assert shear[sliding] == pytest.approx(expected[sliding], rel=2e-8)
    assert (np.diff(wear) >= 0).all() and wear[-1] == pytest.approx(0.02, rel=2e-3)
    # On the way back the lift counts the motion of the shear spring too, S/k of 10⁻⁷ m.
    assert lift == pytest.approx(math.tan(math.radians(8)) * slip, abs=1e-7)
    assert lift[-1] < 1e-2 * lift.max()
    if contact == "augmented":
        # 1e-8 of √area of the rams.
        assert np.abs(gap).max() < 4e-9


def test_what_given_motion_lifts_sinks_again_on_the_way_back():
    """Two cycles of ±10 mm by imposed motion in static steps: the lift is tan ψ |u| throughout, and nothing at u = 0."""
    law = JointLaw("dilates", math.radians(35), dilation_angle=math.radians(10))
    blocks = Blocks.from_polygons(
        [SEAT, rectangle(0, 0, 1, 0.5)], fixed=[True, False], edge_names=[[[""] * 4], [["", "", "top", ""]]]
    )
    rock = Material("rock", 20e9, 0.25, density=2600.0)
    system = dda.BlockSystem(blocks, [rock], [law], settings=DdaSettings(max_displacement_ratio=0.5))
    press = Loads(edge_tractions=(EdgeTraction("top", History.constant([0.0, -1e6])),))
    state, at = system.step(State.at_rest(blocks), press, 1e3).state, 0.0
    for way in 2 * [*np.linspace(2e-3, 10e-3, 5), *np.linspace(8e-3, -10e-3, 10), *np.linspace(-8e-3, 0.0, 5)]:
        push = replace(press, block_motions=(BlockMotion(1, History.ramp([(way - at) / 1e3]), ("u0",)),))
        result = system.step(replace(state, time=0.0, imposed=np.empty(0)), push, 1e3)
        state, at = result.state, way
        rows = result.contacts[result.contacts["length"] > 0]
        assert rows["normal_force"].sum() == pytest.approx(1e6, rel=1e-6)
        # Before it slips the face gives by 13 µm along itself, of which the lift knows nothing on the way out.
        assert rows["lift"] == pytest.approx(math.tan(math.radians(10)) * abs(way), abs=5e-6)


def test_direct_shear_of_a_rough_joint_at_constant_load():
    (shear, normal, slip, _, lift, _), iterations = direct_shear(JointLaw("rough", RESIDUAL, roughness=ROUGH))
    decay = np.interp(1 + slip / ROUGH.peak_slip, [1, 2, 4, 10, 25, 100], [1, 0.85, 0.7, 0.5, 0.4, 0])
    expected = [joints.barton_strength(n, 10 * d, 50e6, RESIDUAL) for n, d in zip(normal, decay, strict=True)]
    assert shear == pytest.approx(np.array(expected), rel=2e-8)
    assert iterations < 5
    # Peak at the first slip, dilation as published: half of what roughness adds to the angle.
    peak = math.tan(0.5 * math.radians(10 * math.log10(50)))
    assert lift[0] / slip[0] == pytest.approx(peak, rel=0.02)


def test_direct_shear_of_a_rough_joint_at_constant_stiffness_converges():
    # Against the integrated law; the lift of a step is taken at the pressure of its end: first order.
    wall, errors = 2e9, []
    stiffness = 1 / (1 / wall + 1 / PENALTY)
    for n in (25, 50, 100):
        (_, _, slip, _, lift, _), _ = direct_shear(JointLaw("rough", RESIDUAL, roughness=ROUGH), wall=wall, n=n)
        exact = joints.lift_at_constant_stiffness(slip, 10.0, 50e6, 1e6, stiffness, ROUGH.peak_slip)
        errors.append(abs(lift[-1] / exact[-1] - 1))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    print(f"lift after 20 mm against a wall: errors {errors}, orders {orders}")
    assert errors[-1] < 5e-3
    assert (orders > 0.8).all()


def test_stiffness_from_the_slip_of_the_peak():
    rough = Roughness(10.0, 50e6, length=1.0, from_peak_slip=True)
    (shear, normal, slip, _, _, _), _ = direct_shear(JointLaw("rough", RESIDUAL, roughness=rough))
    peak = joints.barton_strength(normal[0], rough.jrc_in_place, rough.jcs_in_place, RESIDUAL)
    moved = 0.02 / 100 * np.arange(1, 101)
    sticks = moved < 0.99 * rough.peak_slip
    # The ram loses some of its speed to the penalty spring between it and the block: parts in ten thousand.
    assert shear[sticks] == pytest.approx(peak * moved[sticks] / rough.peak_slip, rel=1e-3)
    assert shear.max() == pytest.approx(peak, rel=0.02)
    assert not slip[sticks].any() and slip[-1] > 0


@pytest.mark.first_by_default(4)
@pytest.mark.parametrize("stiffness", [None, 2e10])
@pytest.mark.parametrize("contact", ["penalty", "augmented"])
@pytest.mark.parametrize("before", [0, 1])
def test_given_motion_shears_a_joint_by_the_stiffness_of_its_pressure(stiffness, contact, before):
    """S = τ_p ℓ x/δ_p of a block that is moved along by x, whether it was pressed on ``before`` or in the same step,
    sliding beyond."""
    rough = Roughness(10.0, 50e6, length=1.0, from_peak_slip=True)
    law = JointLaw("rough", RESIDUAL, roughness=rough, normal_stiffness=stiffness)
    blocks = Blocks.from_polygons(
        [rectangle(-2, -1, 4, 0), rectangle(0, 0, 2, 1)], fixed=[True, False],
        edge_names=[[[""] * 4], [["", "", "top", ""]]],
    )  # fmt: skip
    settings = DdaSettings(max_displacement_ratio=0.1, contact=contact)
    system = dda.BlockSystem(blocks, [Material("rock", 1e13, 0.0)], [law], settings=settings)
    way = np.array([0.0] * (before + 1) + [1e-3, 2e-3, 3e-3, 5e-3])
    loads = Loads(
        edge_tractions=(EdgeTraction("top", History.constant([0.0, -1e6])),),
        block_motions=(
            BlockMotion(1, History(np.arange(len(way)) * 1.0, way[:, None]), ("u0",)),
            BlockMotion(1, History.constant([0.0]), ("r0",)),
        ),
    )
    peak = 2.0 * joints.barton_strength(1e6, rough.jrc_in_place, rough.jcs_in_place, RESIDUAL)
    state, energy = State.at_rest(blocks), dda.EnergyBudget()
    for x in way[1:]:
        result = system.step(state, loads, 1.0)
        state, energy = result.state, energy.after(result.energy)
        borne = abs(float(result.contacts["shear_force"].sum()))
        if x < rough.peak_slip:
            # Shear moves up to a third of the pressure from one end to the other, of which the strength is no straight
            # line.
            assert borne == pytest.approx(peak * x / rough.peak_slip, rel=0.01, abs=1.0)
            assert not result.contacts["slip"].any()
    # The slip that the shear spring does not take up, and the roughness that it wears.
    slip = np.abs(result.contacts["slip"][result.contacts["length"] > 0])
    assert slip == pytest.approx(way[-1] - rough.peak_slip, rel=0.2) and 0.9 * peak < borne < peak
    assert abs(energy.residual) < 1e-3 * energy.turnover


def test_hyperbolic_closure():
    # σ = kₙ δ/(1 − δ/Vm) (Bandis, Lumsden & Barton 1983), at loads up to ten times kₙ Vm.
    law = JointLaw("closes", ANGLE, normal_stiffness=1e10, max_closure=1e-4)
    blocks = Blocks.from_polygons(
        [rectangle(-1, -0.5, 2, 0), rectangle(0, 0, 1, 0.5)], fixed=[True, False],
        edge_names=[[[""] * 4], [["", "", "top", ""]]],
    )  # fmt: skip
    system = dda.BlockSystem(
        blocks, [Material("rock", YOUNGS_MODULUS, 0.0)], [law], settings=DdaSettings(max_displacement_ratio=0.5)
    )
    for pressure in (1e4, 1e6, 1e7):
        loads = Loads(edge_tractions=(EdgeTraction("top", History.constant([0.0, -pressure])),))
        result = system.step(State.at_rest(blocks), loads, 1.0)
        assert -result.contacts["gap"] == pytest.approx(np.full(2, pressure / (1e10 + pressure / 1e-4)), rel=1e-7)
        assert result.statistics["open_close_iterations"] <= 8


def test_plane_failure_with_residual_strength():
    # A slab on 35°: held by its peak while (cA + W cos α tan φ) / (W sin α) > 1 (Hoek & Bray 1981); once broken, it
    # slides at g sin α − g cos α tan φr − cr A/m.
    slope, gravity = math.radians(35), 9.81
    mass = 2600.0 * 10 * 0.1
    turn = np.array([[math.cos(slope), math.sin(slope)], [-math.sin(slope), math.cos(slope)]])
    blocks = Blocks.from_polygons(
        [rectangle(-20, -1, 20, 0) @ turn, rectangle(4, 0, 14, 0.1) @ turn], fixed=[True, False]
    )
    friction, residual = math.radians(32), math.radians(25)
    drive = mass * gravity * math.sin(slope)
    resting = mass * gravity * math.cos(slope) * math.tan(friction)
    fall = Loads(gravity=History.ramp([0.0, -gravity / 100.0]))
    for safety in (1.01, 0.995):
        law = JointLaw(
            "plane", friction, cohesion=(safety * drive - resting) / 10, residual_friction_angle=residual,
            residual_cohesion=20.0,
        )  # fmt: skip
        system = dda.BlockSystem(
            blocks, [Material("rock", 10e9, 0.0, density=2600.0)], [law],
            settings=DdaSettings(dynamic_factor=0.0, max_displacement_ratio=0.05),
        )  # fmt: skip
        state = State.at_rest(blocks)
        while state.time < 100.0 and not state.contacts["wear"].any():
            state = system.step(state, fall, min(1.0, 100.0 - state.time)).state
        assert bool(state.contacts["wear"].any()) == (safety < 1)
    # Cohesion does not grow with the weight: half a percent of safety is five percent of weight.
    assert state.time > 88.0
    moving = dda.BlockSystem(
        blocks, [Material("rock", 10e9, 0.0, density=2600.0)], [law],
        settings=DdaSettings(dynamic_factor=1.0, max_displacement_ratio=0.05),
    )  # fmt: skip
    state.velocity[:] = 0.0
    start, began = state.vertices.copy(), state.time
    held = Loads(gravity=History.constant([0.0, -gravity]))
    while state.time < began + 0.5 - 1e-12:
        state = moving.step(state, held, min(1e-3, began + 0.5 - state.time)).state
    down = (start - state.vertices)[4:].mean(axis=0) @ [math.cos(slope), math.sin(slope)]
    expected = 0.5 * (block_motion.incline_acceleration(slope, residual) - 20.0 * 10 / mass) * 0.25
    # Elastic release of the joint's springs as it breaks: micrometres of a third of a metre.
    assert down == pytest.approx(expected, rel=1e-4)
