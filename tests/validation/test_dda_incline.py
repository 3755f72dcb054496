"""Blocks on an incline: held to the friction angle, sliding, stacked, toppling;
`geomech.reference.blocks.block_on_incline`."""

from __future__ import annotations

import numpy as np
import pytest
from block_problems import GRAVITY, WEIGHT, march, moved, rectangle, settled, system_of, turned
from scipy.integrate import solve_ivp

from geomech.model import JointLaw, Material, State
from geomech.reference.blocks import block_motion
from geomech.reference.blocks import block_on_incline as exact

SLOPE = np.radians(30)
DOWN = -np.array([np.cos(SLOPE), np.sin(SLOPE)])
STEPS = [1e-5, 1e-4, 1e-3, 1e-2, 1e-1]


def block_on_slope(friction_deg: float, **settings):
    base, block = turned(rectangle(-4, -1, 6, 0), SLOPE), turned(rectangle(4, 0, 5, 1), SLOPE)
    return system_of([base, block], np.radians(friction_deg), **settings)


def travel(system, state) -> float:
    return float(moved(system, state)[1] @ DOWN)


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("excess_deg", [1e-4, 0.1, 5.0])
def test_a_block_at_rest_stays_to_the_friction_angle_at_every_step(verified, dt, excess_deg):
    # From static equilibrium: 1e-4° above the incline is 3.5e-6 of tan φ. Nothing moves beyond the round-off of
    # coordinates.
    system = block_on_slope(30 + excess_deg)
    state = settled(system)
    end = march(system, state, WEIGHT, 60 * dt, dt)
    crept = travel(system, end) - travel(system, state)
    print(f"sticking {excess_deg:g}° above the incline, dt = {dt:g} s: {crept:.1e} m in 60 steps")
    verified(
        "from equilibrium, friction 1e-4° to 5° above the incline, dt = 10 µs to 0.1 s: creep in 60 steps",
        crept,
        "statics",
        unit="m",
    )
    assert abs(crept) < 1e-13
    assert np.abs(end.velocity[1]).max() < 1e-10


@pytest.mark.parametrize("dt", STEPS)
def test_a_block_just_steeper_than_its_friction_angle_slides_at_every_step(dt):
    # 0.01° below the incline it must go, as slowly as it should: the stick is not one of the solver's making.
    strong, weak = block_on_slope(31), block_on_slope(29.99)
    state = settled(strong)
    end = march(weak, state, WEIGHT, 60 * dt, dt)
    acceleration = block_motion.incline_acceleration(SLOPE, np.radians(29.99))
    # One corner lets go before the other, and the block starts with parts of its elastic shear of a micrometre.
    slid, way = travel(weak, end) - travel(strong, state), 0.5 * acceleration * end.time**2
    print(f"sliding 0.01° below the incline, dt = {dt:g} s: {slid:.6g} m for {way:.6g} m, off by {slid - way:.1e} m")
    assert slid == pytest.approx(way, rel=1e-3, abs=5e-7)
    # In the shortest steps the way is below those parts; a block that sticks does not move at all.
    assert slid > 0.5 * way


@pytest.mark.parametrize("dt", [pytest.param(STEPS[0], marks=pytest.mark.slow), *STEPS[1:]])
def test_a_block_that_weighs_at_once_sticks_at_every_step(dt):
    # The shock of the weight makes it vibrate, and it creeps while it is light: by parts of its elastic shortening
    # (W/E' = 2.4 µm), a few times, then it must stand. 30 ms are twenty of its periods.
    system = block_on_slope(35)
    end = march(system, State.at_rest(system.blocks), WEIGHT, max(0.03, 20 * dt), dt)
    assert abs(travel(system, end)) < 2e-5
    later = march(system, end, WEIGHT, end.time + max(0.005, 10 * dt), dt)
    print(f"weight at once, dt = {dt:g} s: creeps {travel(system, end):.1e} m before it stands")
    assert abs(travel(system, later) - travel(system, end)) < 2e-7


def test_sliding_is_right_at_any_step_and_any_penalty(verified):
    # From equilibrium at 35° the friction drops to 15°. Trapezoidal sums of a constant acceleration are exact, so what
    # remains is the elastic shear let go (W/E over the path): no part of it may come from dt or from the penalty.
    rows = []
    acceleration = block_motion.incline_acceleration(SLOPE, np.radians(15))
    for penalty in (1e10, 4e11, 1e13):
        state = settled(block_on_slope(35, normal_penalty=penalty, shear_penalty=penalty))
        system = block_on_slope(15, normal_penalty=penalty, shear_penalty=penalty)
        row = []
        for dt in (2e-2, 2e-3):
            end = march(system, state, WEIGHT, 0.5, dt)
            row.append((travel(system, end) - travel(system, state)) / (0.5 * acceleration * 0.25) - 1)
        rows.append(row)
        print(f"penalty {penalty:8.0e} Pa, error at dt = 20, 2 ms: " + " ".join(f"{e:9.2e}" for e in row))
    errors = np.array(rows)
    verified(
        "friction falls from 35° to 15°, three penalties, dt = 2 and 20 ms: way in 0.5 s",
        np.abs(errors).max(),
        "closed form of a rigid block",
    )
    assert np.abs(errors).max() < 1e-7
    assert np.ptp(errors) < 1e-8


def test_a_block_pushed_up_the_incline_comes_to_rest_and_stays(verified):
    # Up the slope friction and weight both stop it: v²/(2g (sin α + cos α tan φ)); then 35° holds it on 30°. It lands
    # on its elastic shear: a micrometre or a few, 1e-4 of the way, whatever dt.
    expected = 1.0 / (2 * GRAVITY * (np.sin(SLOPE) + np.cos(SLOPE) * np.tan(np.radians(35))))
    errors = []
    for dt in (4e-3, 1e-3, 2.5e-4):
        system = block_on_slope(35, rock=Material("rock", 10e9, 0.0, density=2600.0))
        state = settled(system)
        at = travel(system, state)
        state.velocity[1, :2] = -DOWN
        end = march(system, state, WEIGHT, 0.16, dt)
        errors.append(abs((at - travel(system, end)) / expected - 1))
        # Stopped short, it swings on its elastic shear of a micrometre, and no more.
        later = march(system, end, WEIGHT, 0.2, dt)
        assert abs(travel(system, later) - travel(system, end)) < 2e-6
    print("pushed up, error at dt = 4, 1, 0.25 ms:", " ".join(f"{e:.1e}" for e in errors))
    verified(
        "block pushed up the incline, dt = 0.25 to 4 ms: where it stops", max(errors), "closed form of a rigid block"
    )
    assert max(errors) < 3e-4


def stacked(base_deg, between_deg, youngs_modulus=50e9) -> tuple[np.ndarray, np.ndarray]:
    """Ways down the slope (2,) of a block and of one on top of it in 0.3 s, m, and those of rigid ones."""
    polygons = [
        turned(p, SLOPE) for p in (rectangle(-6, -1, 9, 0), rectangle(4, 0, 7, 1), rectangle(5, 1, 6, 2))
    ]  # fmt: skip
    names = [[["", "", "slope", ""]], [[""] * 4], [[""] * 4]]
    joints = [JointLaw("base", np.radians(base_deg)), JointLaw("between", np.radians(between_deg))]
    system = system_of(
        polygons, joints, names=names, joint_index=lambda a, b: 0 if "slope" in (a, b) else 1,
        rock=Material("rock", youngs_modulus, 0.0, density=2600.0),
    )  # fmt: skip
    end = march(system, State.at_rest(system.blocks), WEIGHT, 0.3, 2e-3)
    expected = exact.stacked_accelerations(SLOPE, np.radians(base_deg), np.radians(between_deg), (3.0, 1.0))
    return moved(system, end)[1:] @ DOWN, 0.5 * 0.3**2 * np.array(expected)


@pytest.mark.parametrize(("base_deg", "between_deg"), [(20, 45), (20, 10), (24, 26), (27, 15), (35, 10), (40, 35)])
def test_stacked_blocks_slide_each_at_its_own_rate(verified, base_deg, between_deg):
    got, (lower, upper) = stacked(base_deg, between_deg)
    print(f"φ {base_deg}° under {between_deg}°: {got[0]:.6f} {got[1]:.6f} m, should be {lower:.6f} {upper:.6f}")
    # Weight put on at once: micrometres of elastic shear and start.
    verified(
        "two stacked blocks, six pairs of friction angles: ways of 0.01 to 0.2 m in 0.3 s",
        np.abs(got - [lower, upper]).max(),
        "rigid blocks",
        unit="m",
    )
    assert got == pytest.approx([lower, upper], abs=1e-5)


@pytest.mark.parametrize(("base_deg", "between_deg"), [(20, 45), (20, 10)])
def test_stacked_blocks_converge_to_rigid_ones(verified, base_deg, between_deg):
    errors = []
    for youngs_modulus in (5e9, 50e9, 500e9):
        got, expected = stacked(base_deg, between_deg, youngs_modulus)
        errors.append(np.abs(got / expected - 1))
    orders = np.log10(np.array(errors[:-1]) / errors[1:])
    print(f"φ {base_deg}° under {between_deg}°, E = 5, 50, 500 GPa: {np.array(errors)}, order in 1/E {orders.round(2)}")
    # What is left is the elastic shear that the weight put on at once makes.
    verified(
        f"two stacked blocks, friction {base_deg}° under {between_deg}°",
        np.array(errors).max(axis=1),
        "rigid blocks",
        over=("Young's modulus, GPa", (5, 50, 500)),
    )
    assert orders == pytest.approx(np.ones((2, 2)), abs=0.02)


def column(slenderness: float, friction: float):
    """A column 1 m high with its lower corner at the origin, stiff enough to start like a rigid one."""
    polygons = [turned(p, SLOPE) for p in (rectangle(-2, -1, 3, 0), rectangle(0, 0, np.tan(slenderness), 1))]
    return system_of(
        polygons, friction, rock=Material("stiff", 1e13, 0.0, density=2600.0), max_displacement_ratio=1.0,
    )  # fmt: skip


def start(slenderness: float, friction: float) -> tuple[float, float]:
    """(toe's acceleration down the slope, angular acceleration) of a column in the first 5 ms, taken in one step, in
    which it tilts by 1e-4 at most: a mean over a longer one, whose forces act in its middle, is another by α dt²."""
    system, dt = column(slenderness, friction), 0.005
    state = system.step(State.at_rest(system.blocks), WEIGHT, dt).state
    toe = (state.vertices - system.blocks.vertices)[4] @ DOWN
    return 2 * toe / state.time**2, 2 * state.rotation[1] / state.time**2


def test_sliding_toppling_map(verified):
    """Every mode of the (δ, φ) map and how fast it starts: 150 columns from slender to squat, slippery to rough."""
    worst = 0.0
    for slenderness in np.radians(np.arange(3, 60, 6.0)):
        for friction in np.radians(np.arange(2.5, 60, 4.0)):
            toe, spin = exact.starting_accelerations(slenderness, friction, SLOPE, 1.0)
            got = start(slenderness, friction)
            worst = max(worst, abs(got[0] - toe) / GRAVITY, abs(got[1] - spin) / GRAVITY)
    print(f"largest difference of starting accelerations over the map: {worst:.1e} g")
    # Elastic shortening, W/E' ≤ 3 nm, over ½ g dt² = 0.12 mm; the rotation of a column b wide is b times more
    # sensitive.
    verified("map of sliding and toppling, 150 columns: accelerations at the start", worst, "rigid body", unit="g")
    assert worst < 2e-5


def rigid_motion(slenderness: float, friction: float, end: float) -> np.ndarray:
    """(toe's way down the slope, tilt) at the time ``end`` of a rigid column 1 m high that topples from rest and slides
    where its toe does not hold: Newton's equations about the toe, and about the centroid with T = N tan φ."""
    r, mu = 0.5 / np.cos(slenderness), np.tan(friction)
    slides = exact.failure_mode(slenderness, friction, SLOPE) == "sliding and toppling"

    def rates(_, y):
        lean, speed, _, velocity = y
        c, s = np.cos(lean), np.sin(lean)
        if not slides:
            return [speed, 0.75 * GRAVITY / r * np.sin(SLOPE + lean), 0.0, 0.0]
        normal = (GRAVITY * np.cos(SLOPE) - r * speed**2 * c) / (1 + 3 * s * (mu * c + s))
        spin = 3 * normal * (mu * c + s) / r
        return [speed, spin, velocity, GRAVITY * np.sin(SLOPE) - mu * normal - r * (spin * c - speed**2 * s)]

    y = solve_ivp(rates, (0, end), [-slenderness, 0.0, 0.0, 0.0], rtol=1e-11, atol=1e-13).y[:, -1]
    return np.array([y[2], y[0] + slenderness])


@pytest.mark.parametrize(("slenderness_deg", "friction_deg"), [(9, 12), (15, 18.5), (15, 30.5)])
def test_columns_tilt_and_slide_as_rigid_ones_to_second_order(verified, slenderness_deg, friction_deg):
    """A fall of 0.1 s in eight steps and in sixteen: 1° of tilt, and the toe goes 8 mm, 0.8 mm, or holds."""
    slenderness, friction, end = np.radians(slenderness_deg), np.radians(friction_deg), 0.1
    expected, off = rigid_motion(slenderness, friction, end), []
    for dt in (end / 8, end / 16):
        system = column(slenderness, friction)
        state = march(system, State.at_rest(system.blocks), WEIGHT, end, dt)
        toe = (state.vertices - system.blocks.vertices)[4] @ DOWN
        off.append(np.array([toe, state.rotation[1]]) - expected)
        print(f"dt = {1e3 * dt:g} ms: toe off by {off[-1][0]:.1e} m, tilt by {off[-1][1]:.1e} of {expected[1]:.2e}")
    off = np.abs(off)
    print("order", np.log2(off[0] / off[1]).round(2))
    verified(
        f"column of {slenderness_deg:g}° on friction of {friction_deg:g}° that falls for 0.1 s: tilt",
        off[:, 1] / expected[1],
        "equations of a rigid body",
        over=("time step, ms", (12.5, 6.25)),
    )
    assert off[0].max() < 1e-3 * expected[1]
    # Second order, and a fifth of a micrometre of elastic give.
    assert (off[1] < 0.27 * off[0] + 2e-7).all()


@pytest.mark.parametrize(
    ("what", "boundary_deg"),
    [("sliding", 0.0), ("toppling", 0.0), ("turns as it slides", 10.0), ("turns as it slides", 20.0)]
    + [("slides as it topples", d) for d in (5.0, 10.0, 20.0)],
)
def test_boundaries_of_the_map_are_where_they_should_be(verified, what, boundary_deg):
    """Located by bisection. The threshold, 2e-4 g, moves them by 0.01° at most; the rest is elasticity, W/(E' b)."""
    least = 2e-4 * GRAVITY
    d = np.radians(boundary_deg)
    if what == "sliding":
        moves, lo, hi, expected = (lambda f: start(np.radians(45), f)[0] > least), 10, 50, 30.0
    elif what == "toppling":
        moves, lo, hi, expected = (lambda s: start(s, np.radians(40))[1] > least), 10, 50, 30.0
    elif what == "turns as it slides":
        moves, lo, hi, expected = (lambda f: start(d, f)[1] < least), 1, 29, boundary_deg
    else:
        moves, lo, hi = (lambda f: start(d, f)[0] > least), 1, 30
        expected = np.degrees(exact.toe_holds_above(d, SLOPE))
    lo, hi = np.radians(lo), np.radians(hi)
    assert moves(lo)
    assert not moves(hi)
    for _ in range(15):
        middle = 0.5 * (lo + hi)
        lo, hi = (middle, hi) if moves(middle) else (lo, middle)
    found = np.degrees(0.5 * (lo + hi))
    print(f"{what} {boundary_deg:g}: boundary at {found:.4f}°, should be {expected:.4f}°")
    verified(
        "boundaries between sliding, toppling and both, by bisection",
        found - expected,
        "Yagoda-Biran & Hatzor 2013",
        unit="°",
    )
    assert found == pytest.approx(expected, abs=0.02)
