"""Blocks in motion against closed forms (`geomech.reference.blocks.block_motion`)."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from block_problems import march, rectangle, turned

from geomech import dda
from geomech.model import Blocks, DdaSettings, EdgeTraction, History, JointLaw, Loads, Material, State
from geomech.reference.blocks import block_motion as exact

GRAVITY = 9.81


def incline(
    angle: float, friction: float, *, speed: float = 0.0, ratio: float = 0.05, damping: float = 0.05, poisson=0.25,
    youngs_modulus: float = 10e9,
):  # fmt: skip
    """A unit block on a long fixed incline: system, state with ``speed`` down the slope, slope direction."""
    blocks = Blocks.from_polygons(
        [turned(rectangle(-20, -1, 20, 0), angle), turned(rectangle(4, 0, 5, 1), angle)], fixed=[True, False]
    )
    system = dda.BlockSystem(
        blocks, [Material("rock", youngs_modulus, poisson, density=2600.0)],
        [JointLaw("joint", friction_angle=friction)],
        settings=DdaSettings(dynamic_factor=1.0, max_displacement_ratio=ratio, damping=damping),
    )  # fmt: skip
    down = -np.array([np.cos(angle), np.sin(angle)])
    state = State.at_rest(blocks)
    state.velocity[1, :2] = speed * down
    return system, state, down


def travel(system, state, down) -> float:
    return float((state.vertices - system.blocks.vertices)[4:].mean(axis=0) @ down)


WEIGHT = Loads(gravity=History.constant([0.0, -GRAVITY]))


@pytest.mark.parametrize("dt", [0.02, 0.0037])
def test_projectile_is_exact_at_any_step(verified, dt):
    # d = v dt + g dt²/2 is exact for constant acceleration: only the round-off of adding 100 m coordinates remains.
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 2)])
    settings = DdaSettings(dynamic_factor=1.0, max_displacement_ratio=10.0)
    system = dda.BlockSystem(blocks, [Material("rock", 10e9, 0.25, density=2600.0)], settings=settings)
    state = State.at_rest(blocks)
    state.velocity[0, :2] = [3.0, 7.0]
    state = march(system, state, WEIGHT, 1.3, dt)
    expected = exact.free_fall(np.array([1.3]), np.array([0, -GRAVITY]), np.array([3.0, 7.0]))
    error = np.abs(state.vertices - blocks.vertices - expected).max() / np.abs(expected).max()
    print(f"projectile, dt {dt}: {error:.1e}")
    verified("projectile, dt = 3.7 and 20 ms", error, "closed form")
    assert state.vertices - blocks.vertices == pytest.approx(np.repeat(expected, 4, axis=0), rel=1e-12, abs=1e-12)
    assert state.velocity[0, :2] == pytest.approx([3.0, 7.0 - GRAVITY * 1.3], rel=1e-11)


def test_frictionless_incline(verified):
    # Exact but for the spring under the block: sliding is uncoupled from it, so round-off over penalty (1e-10) remains.
    system, state, down = incline(np.radians(30), 0.0)
    end = march(system, state, WEIGHT, 0.5, 1e-3)
    expected = 0.5 * exact.incline_acceleration(np.radians(30), 0.0) * 0.5**2
    print(f"incline without friction: {travel(system, end, down) / expected - 1:.1e}")
    verified(
        "block on an incline of 30° without friction, dt = 1 ms: way in 0.5 s",
        travel(system, end, down) / expected - 1,
        "closed form",
    )
    assert travel(system, end, down) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("friction_deg", [5.0, 15.0, 25.0])
def test_incline_with_friction(verified, friction_deg):
    # Weight put on at once makes the block's own vibration start the slide: its share is the elastic shortening,
    # W/E' ≈ 1 µm, of half a metre of travel, and it does not depend on dt.
    system, state, down = incline(np.radians(30), np.radians(friction_deg))
    end = march(system, state, WEIGHT, 0.5, 1e-3)
    expected = 0.5 * exact.incline_acceleration(np.radians(30), np.radians(friction_deg)) * 0.5**2
    print(f"incline, friction {friction_deg}°: {travel(system, end, down) / expected - 1:.1e}")
    verified(
        f"block on an incline of 30°, friction {friction_deg:g}°, dt = 1 ms: way in 0.5 s",
        travel(system, end, down) / expected - 1,
        "closed form of a rigid block",
    )
    assert travel(system, end, down) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("dt", [8e-3, 1e-3])
def test_friction_on_an_incline_converges_to_the_rigid_block(verified, dt):
    # What is left beside the closed form is the block's elastic shortening: first order in 1/E, the same at every dt.
    slope, friction = np.radians(30), np.radians(15)
    expected = 0.5 * exact.incline_acceleration(slope, friction) * 0.5**2
    errors = []
    for youngs_modulus in (1e9, 10e9, 100e9):
        system, state, down = incline(slope, friction, youngs_modulus=youngs_modulus)
        errors.append(abs(travel(system, march(system, state, WEIGHT, 0.5, dt), down) / expected - 1))
    orders = np.log10(np.array(errors[:-1]) / errors[1:])
    print(f"incline, dt {dt}, E = 1, 10, 100 GPa: {np.array(errors)}, order in 1/E {orders.round(3)}")
    verified(
        f"the same, friction 15°, dt = {1e3 * dt:g} ms",
        errors,
        "closed form of a rigid block",
        over=("Young's modulus, GPa", (1, 10, 100)),
    )
    assert orders == pytest.approx([1.0, 1.0], abs=0.02)
    assert errors[1] < 1e-6


@pytest.mark.parametrize("dt", [0.1, 0.01, 1e-3, 5e-4])
def test_a_block_flatter_than_its_friction_angle_sticks_when_its_weight_is_put_on_at_once(dt):
    system, state, down = incline(np.radians(30), np.radians(35))
    end = march(system, state, WEIGHT, 60 * dt, dt)
    print(f"35° on an incline of 30°, weight at once, dt = {dt:g} s: creeps {travel(system, end, down):.1e} m")
    # Not a millionth of the 0.5 m and more that it would slide without friction within a second, and at rest.
    assert abs(travel(system, end, down)) < 2e-6
    assert np.abs(end.velocity[1]).max() < 1e-3


@pytest.mark.parametrize("dt", [1e-2, 1e-3, 1e-4, 1e-5])
def test_a_block_that_carries_its_weight_sticks_at_every_step(dt):
    # Static equilibrium first, then dynamic steps: nothing may move it, whatever the step resolves of its vibrations.
    system, state, down = incline(np.radians(30), np.radians(35))
    rest = dda.BlockSystem(
        system.blocks, system.materials, system.joints, settings=DdaSettings(max_displacement_ratio=0.05)
    )
    for _ in range(5):
        state = rest.step(state, WEIGHT, 1.0).state
    before = travel(system, state, down)
    state.velocity[:] = 0.0
    end = march(system, state, WEIGHT, 200 * dt, dt)
    print(f"35° on an incline of 30°, from rest, dt = {dt:g} s: creeps {travel(system, end, down) - before:.1e} m")
    assert travel(system, end, down) == pytest.approx(before, abs=1e-10)
    assert np.abs(end.velocity[1]).max() < 1e-6


def test_friction_stops_a_pushed_block_where_it_should(verified):
    """Every step is exact but that in which it stops: of what it would go there, ½ μ g dt² at most, it goes a part."""
    braking, errors = GRAVITY * np.tan(np.radians(30)), []
    for dt in (16e-3, 8e-3, 4e-3):
        n, off = round(0.1 / dt), []
        for part in (0.1, 0.35, 0.6, 0.85):  # of a step, at which it stops
            speed = braking * dt * (n + part)
            system, state, _ = incline(0.0, np.radians(30), speed=speed, poisson=0.0, youngs_modulus=1e12, ratio=1.0)
            end = march(system, state, WEIGHT, (n + 4) * dt, dt)
            distance = travel(system, end, np.array([-1.0, 0.0]))
            off.append(abs(distance - exact.stopping_distance(speed, np.radians(30))))
        errors.append(max(off))
        assert errors[-1] < 0.2 * 0.5 * braking * dt**2
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    print(f"stopping distance, dt 16, 8, 4 ms: {np.array(errors)} m, order {orders.round(2)}")
    verified(
        "block that friction stops: distance, m", errors, "closed form", unit="m", over=("time step, ms", (16, 8, 4))
    )
    assert orders == pytest.approx([2.0, 2.0], abs=0.05)


def test_time_integration_is_newmarks_with_the_amplification_that_shi_has():
    # A free square that breathes along x (ν = 0 uncouples y): strain and rate advance by Shi's matrix, step after step.
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1)])
    settings = DdaSettings(dynamic_factor=1.0, damping=0.0, max_displacement_ratio=1.0)
    system = dda.BlockSystem(blocks, [Material("rock", 10e9, 0.0, density=2600.0)], settings=settings)
    omega = exact.square_block_frequency(1.0, 10e9, 2600.0)
    for omega_dt in (0.1, 1.0, 3.0, 10.0):
        dt = omega_dt / omega
        state = State.at_rest(blocks)
        state.velocity[0, 3] = 1e-8 * omega
        x = np.array([0.0, 1e-8 * omega_dt])
        step = exact.shi_amplification(omega_dt)
        assert np.linalg.det(step) == pytest.approx(1 / (1 + omega_dt**2 / 2), rel=1e-13)
        for _ in range(10):
            state = system.step(state, Loads(), dt).state
            x = step @ x
            # The block stretches by 1e-8, and its moments with it.
            assert [state.stress[0, 0] / 10e9, state.velocity[0, 3] * dt] == pytest.approx(x, rel=1e-6, abs=1e-14)


def test_damping_is_the_fraction_of_critical_that_it_says(verified):
    # Well resolved, successive peaks of a free vibration fall by exp(−2πξ/√(1−ξ²)), the step's own dissipation aside.
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1)])
    omega = exact.square_block_frequency(1.0, 10e9, 2600.0)
    n = 500
    fall = {}
    for damping in (0.0, 0.05):
        settings = DdaSettings(dynamic_factor=1.0, damping=damping, max_displacement_ratio=1.0)
        system = dda.BlockSystem(blocks, [Material("rock", 10e9, 0.0, density=2600.0)], settings=settings)
        state = State.at_rest(blocks)
        state.velocity[0, 3] = 1e-8 * omega
        rates = []
        for _ in range(int(2.5 * n)):
            state = system.step(state, Loads(), 2 * np.pi / omega / n).state
            rates.append(state.velocity[0, 3])
        fall[damping] = max(rates[3 * n // 2 :]) / max(rates[n // 2 : 3 * n // 2])
    print(f"decay: {fall[0.05] / fall[0.0] / np.exp(-2 * np.pi * 0.05 / np.sqrt(1 - 0.05**2)) - 1:.1e}")
    # Peaks are sampled n times a cycle, and dissipations add up to second order, (Ω ξ)² with Ω = 2π/n.
    verified(
        "decay of a vibration, 5 % of critical damping",
        fall[0.05] / fall[0.0] / np.exp(-2 * np.pi * 0.05 / np.sqrt(1 - 0.05**2)) - 1,
        "closed form",
    )
    assert fall[0.05] / fall[0.0] == pytest.approx(np.exp(-2 * np.pi * 0.05 / np.sqrt(1 - 0.05**2)), rel=5e-4)


def test_a_spinning_block_keeps_its_area_through_ten_turns(verified):
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1)])
    settings = DdaSettings(dynamic_factor=1.0, max_displacement_ratio=10.0)
    # Stiff, so that what the centrifugal force stretches (ρω²w²/12 over E, 4e-14) is below the tolerance.
    system = dda.BlockSystem(blocks, [Material("rock", 1e17, 0.0, density=1000.0)], settings=settings)
    spin = 2 * np.pi
    state = State.at_rest(blocks)
    state.velocity[0, 2] = spin
    state = march(system, state, Loads(), 10.0, 0.05)
    # Its moment of inertia grows by twice that stretch, and its angular momentum stays.
    slower = 2 * exact.spinning_square_stress(1.0, 1000.0, spin) / 1e17
    assert state.rotation[0] == pytest.approx(20 * np.pi * (1 - slower), rel=1e-12)
    print(f"spinning ten turns: area {blocks.areas(state.vertices)[0] - 1:.1e}")
    verified("block that spins ten turns: area", blocks.areas(state.vertices)[0] - 1, "conserved")
    assert blocks.areas(state.vertices)[0] == pytest.approx(1.0, abs=1e-10)
    assert state.vertices == pytest.approx(blocks.vertices, abs=1e-10)


def test_a_spinning_block_is_stretched_by_its_own_rotation(verified):
    blocks = Blocks.from_polygons([rectangle(0, 0, 2, 2)])
    settings = DdaSettings(dynamic_factor=1.0, damping=0.7, max_displacement_ratio=10.0)
    system = dda.BlockSystem(blocks, [Material("rock", 10e9, 0.25, density=2600.0)], settings=settings)
    state = State.at_rest(blocks)
    state.velocity[0, 2] = 10.0
    state = march(system, state, Loads(), 0.02, 2e-5)
    expected = exact.spinning_square_stress(2.0, 2600.0, 10.0)
    print(f"stretched by its rotation: {np.abs(state.stress[0, :2] / expected - 1).max():.1e}")
    verified("stress of a spinning square", np.abs(state.stress[0, :2] / expected - 1).max(), "closed form")
    assert state.stress[0] == pytest.approx([expected, expected, 0.0], rel=1e-4, abs=1e-4 * expected)


def test_column_shortens_under_its_weight_and_a_load(verified):
    n, width, height, load = 8, 1.0, 2.0, 3e6
    polygons = [rectangle(-1, -1, 2, 0)] + [rectangle(0, height * k, width, height * (k + 1)) for k in range(n)]
    names = [[[""] * 4] for _ in range(n)] + [[["", "", "top", ""]]]
    blocks = Blocks.from_polygons(polygons, fixed=[True] + [False] * n, edge_names=names)
    rock = Material("rock", 10e9, 0.25, density=2600.0)
    system = dda.BlockSystem(blocks, [rock], settings=DdaSettings(normal_penalty=4e11, max_displacement_ratio=1.0))
    loads = Loads(
        gravity=History.constant([0, -GRAVITY]), edge_tractions=(EdgeTraction("top", History.constant([0, -load])),)
    )
    result = system.step(State.at_rest(blocks), loads, 1e4)
    weight = 2600.0 * GRAVITY * width * height
    below = load * width + weight * np.arange(n, 0, -1)  # force under block k
    mean = below - weight / 2  # a first-order block feels the mean of its two ends
    shortening = exact.column_shortening(mean, height, width, rock.plane_modulus, 4e11) + np.sum(below - mean) / 8e11
    # Equilibrium is on the undeformed geometry (one step from rest): linear elasticity, to round-off of the solve.
    top = result.state.vertices[blocks.edges_named("top")[0], 1] - n * height
    print(f"column: shortening {np.abs(top / -shortening - 1).max():.1e}")
    verified("column of blocks under its weight and a load: shortening", np.abs(top / -shortening - 1).max(), "statics")
    assert top == pytest.approx(-shortening, rel=1e-8)
    assert result.state.stress[1:, 1] == pytest.approx(-mean / width, rel=1e-8)
    assert result.state.stress[1:, 0] == pytest.approx(np.zeros(n), abs=1e-8 * load)


def test_two_stacked_blocks_slide_together_when_only_the_lower_joint_is_weak():
    angle = np.radians(30)
    blocks = Blocks.from_polygons(
        [turned(rectangle(*box), angle) for box in ((-20, -1, 20, 0), (4, 0, 6, 1), (4.5, 1, 5.5, 2))],
        fixed=[True, False, False],
        edge_names=[[["", "", "slope", ""]], [[""] * 4], [[""] * 4]],
    )  # fmt: skip
    joints = [JointLaw("weak", friction_angle=np.radians(20)), JointLaw("strong", friction_angle=np.radians(45))]
    system = dda.BlockSystem(
        blocks, [Material("rock", 10e9, 0.25, density=2600.0)], joints,
        joint_index=lambda a, b: 0 if "slope" in (a, b) else 1,
        settings=DdaSettings(dynamic_factor=1.0, max_displacement_ratio=0.05),
    )  # fmt: skip
    state = march(system, State.at_rest(blocks), WEIGHT, 0.4, 1e-3)
    moved = (state.vertices - blocks.vertices) @ -np.array([np.cos(angle), np.sin(angle)])
    expected = 0.5 * exact.incline_acceleration(angle, np.radians(20)) * 0.4**2
    print(
        f"two stacked blocks: {moved[4:8].mean() / expected - 1:.1e}, apart {moved[8:].mean() - moved[4:8].mean():.1e} m"
    )
    # Elastic shear of the pair as the weight comes on: a few µm of 0.23 m.
    assert moved[4:8].mean() == pytest.approx(expected, rel=1e-4)
    assert moved[8:].mean() == pytest.approx(moved[4:8].mean(), abs=1e-5)


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("dt", [1e-3, 1e-5])
def test_head_on_impact_keeps_momentum_and_gains_no_energy(dt):
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1), rectangle(1.01, 0.1, 3.01, 0.9)])
    settings = DdaSettings(dynamic_factor=1.0, max_displacement_ratio=1.0)
    rock = Material("rock", 10e9, 0.25, density=2500.0)
    system = dda.BlockSystem(blocks, [rock], [JointLaw("rough", friction_angle=0.5)], settings=settings)
    state = State.at_rest(blocks)
    state.velocity[0, :2], state.velocity[1, :2] = [4.0, 0.5], [-1.0, 0.0]
    mass = 2500.0 * blocks.areas()
    momentum = mass @ state.velocity[:, :2]
    start = 0.5 * np.sum(mass[:, None] * state.velocity[:, :2] ** 2)
    energies, touched = [start], []

    def watch(result):
        s = result.statistics
        energies.append(s["kinetic_energy"] + s["elastic_energy"] + s["contact_energy"])
        touched.append(bool((result.contacts["normal_force"] > 0).any()))

    state = march(system, state, Loads(), 8e-3, dt, watch)
    assert any(touched) and not touched[-1]
    # Both blocks feel the same force at the same point: momentum is kept to the round-off of the penalty forces.
    assert mass @ state.velocity[:, :2] == pytest.approx(momentum, rel=1e-9)
    _, least = exact.plastic_impact_bounds((mass[0], mass[1]), (4.0, -1.0))
    off = np.abs(mass @ state.velocity[:, :2] - momentum).max() / np.abs(momentum).max()
    print(
        f"head-on impact, dt = {dt:g} s: momentum {off:.1e}, energy {energies[-1] / start:.4f} of the start (plastic impact: "
        f"{least / start:.4f}), at most {max(energies) / start:.9f}"
    )
    assert 0.999 * least < energies[-1] <= start
    assert max(energies) <= start * (1 + 1e-9)


def test_a_wall_comes_to_rest_and_carries_its_weight():
    polygons = [rectangle(-1, -0.5, 7, 0)]
    for row in range(5):
        joints = [0, *np.arange(0.5, 6), 6] if row % 2 else range(7)  # half bricks close every other course
        polygons += [rectangle(a, 0.5 * row, b, 0.5 * row + 0.5) for a, b in itertools.pairwise(joints)]
    blocks = Blocks.from_polygons(polygons, fixed=[True] + [False] * (len(polygons) - 1))
    settings = DdaSettings(time_step=0.01, dynamic_factor=1.0, max_displacement_ratio=0.01)
    system = dda.BlockSystem(
        blocks, [Material("rock", 10e9, 0.25, density=2600.0)], [JointLaw("joint", friction_angle=np.radians(35))],
        settings=settings,
    )  # fmt: skip
    kinetic = []
    state = march(
        system, State.at_rest(blocks), WEIGHT, 2.0, 0.01, lambda r: kinetic.append(r.statistics["kinetic_energy"])
    )
    rows = state.contacts[state.contacts["other"] == 0]
    weight = 2600.0 * GRAVITY * 6 * 2.5
    carried = rows["normal_force"].sum() / weight - 1
    print(
        f"wall at rest: weight carried {carried:+.1e}, kinetic energy {kinetic[-1] / max(kinetic):.1e} of the largest"
    )
    assert rows["normal_force"].sum() == pytest.approx(weight, rel=1e-3)
    assert kinetic[-1] < 1e-3 * max(kinetic)
    assert max(kinetic[100:]) <= max(kinetic[:100])
    assert np.abs(state.vertices - blocks.vertices).max() < 2e-4
