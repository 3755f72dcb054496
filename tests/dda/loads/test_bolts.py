"""Bolts against statics and dynamics: what holds a block, what yields, what a pendulum does."""

import numpy as np
import pytest
from block_problems import rectangle

from geomech import dda
from geomech.model import (
    GROUND,
    Blocks,
    Bolt,
    DdaSettings,
    Excavation,
    History,
    JointLaw,
    Loads,
    Material,
    PointLoad,
    State,
    grouted_bolt,
)

ROCK = Material("rock", 10e9, 0.0, density=2600.0)
GRAVITY = History.constant([0.0, -9.81])
WEIGHT = 2600 * 9.81


def march(system, state, loads, steps, dt):
    for _ in range(steps):
        result = system.step(state, loads, dt)
        state = result.state
    return result


def slope(angle, friction, static=True):
    """A unit block on an incline; also the slope's point (x, y), and the direction down it."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    blocks = Blocks.from_polygons(
        [rectangle(-20, -1, 20, 0) @ turn, rectangle(4, 0, 5, 1) @ turn], fixed=[True, False], names=["slope", "block"]
    )
    settings = DdaSettings(dynamic_factor=0.0 if static else 1.0, max_displacement_ratio=0.1)
    system = dda.BlockSystem(blocks, [ROCK], [JointLaw("joint", friction_angle=friction)], settings=settings)
    return blocks, system, lambda x, y: tuple(np.array([x, y]) @ turn), -np.array([c, s])


def travel(blocks, state, down):
    return float((state.vertices - blocks.vertices)[4:].mean(axis=0) @ down)


def test_a_passive_anchor_takes_what_friction_leaves():
    angle, friction, k = np.radians(35), np.radians(20), 1e7
    blocks, system, at, down = slope(angle, friction)
    loads = Loads(gravity=GRAVITY, bolts=(Bolt(1, at(5.0, 0.5), GROUND, at(8.0, 0.5), k, name="anchor"),))
    result = march(system, State.at_rest(blocks), loads, 20, 1.0)
    missing = WEIGHT * (np.sin(angle) - np.cos(angle) * np.tan(friction))
    # Static steps of 1 s carry no inertia but 2m/dt² · the last step's creep.
    assert result.statistics["bolt:anchor"] == pytest.approx(missing, rel=1e-6)
    assert travel(blocks, result.state, down) == pytest.approx(missing / k, rel=1e-3)  # and the block's own shear
    assert result.statistics["unbalanced"] < 1e-9


@pytest.mark.parametrize("safety", [0.98, 1.02])
def test_pretension_across_the_joint_holds_to_its_factor_of_safety(safety):
    # A tendon at 50° to the slope's normal, T: FoS = tan φ (W cos α + T cos δ) / (W sin α − T sin δ) (Hoek & Bray 1981,
    # ch. 7). Soft, so that its force stays the pretension's however the block moves.
    angle, delta, tension = np.radians(40), np.radians(50), 9000.0
    need = (WEIGHT * np.sin(angle) - tension * np.sin(delta)) / (WEIGHT * np.cos(angle) + tension * np.cos(delta))
    friction = np.arctan(safety * need)
    blocks, system, at, down = slope(angle, friction, static=False)
    end = at(4.5 + 6 * np.sin(delta), 0.5 - 6 * np.cos(delta))
    loads = Loads(gravity=GRAVITY, bolts=(Bolt(1, at(4.5, 0.5), GROUND, end, 1.0, pretension=tension),))
    rest = slope(angle, np.radians(80))[1]
    state = march(rest, State.at_rest(blocks), loads, 5, 1.0).state
    state.velocity[:] = 0.0
    before, start = travel(blocks, state, down), state.time
    state = march(system, state, loads, 40, 5e-3).state
    drive = WEIGHT * np.sin(angle) - tension * np.sin(delta)
    sliding = 0.5 * drive * (1 - safety) / 2600 * (state.time - start) ** 2
    # Holds, or slides with what is missing (its elastic shear springs back by a micrometre, 1 % of the way).
    assert travel(blocks, state, down) - before == pytest.approx(max(sliding, 0.0), rel=0.02, abs=2e-6)


def test_a_bolt_yields_keeps_what_it_yielded_and_unloads_elastically():
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1)], names=["block"])
    constrained = np.zeros((1, 6), bool)
    constrained[0, [0, 2]] = True
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1)], constrained=constrained)
    system = dda.BlockSystem(blocks, [ROCK], settings=DdaSettings(max_displacement_ratio=1.0))
    pull = History.table([0, 10, 20, 40], [[0.0, 0.0], [0.0, -0.9e6], [0.0, 0.0], [0.0, 0.0]])
    k, limit = 1e8, 1e6
    bolts = (
        Bolt(0, (0.5, 0.5), GROUND, (0.5, 2.5), k, yield_force=0.3 * limit, name="weak"),
        Bolt(0, (0.5, 0.5), GROUND, (0.5, 3.5), k, yield_force=limit, name="strong"),
    )
    loads = Loads(bolts=bolts, point_loads=(PointLoad(0, (0.5, 0.5), pull),))
    state, track = State.at_rest(blocks), []
    for _ in range(24):
        result = system.step(state, loads, 1.0)
        state = result.state
        u = state.vertices[:, 1].mean() - 0.5
        track.append([state.time, u, result.statistics["bolt:weak"]])
    time, u, weak = np.array(track).T
    # Elastic until u = 0.3e6/k, then the strong one alone; unloaded, the pair keeps the mismatch of its plastic strain.
    force = np.array([-pull.at(t)[1] for t in time])
    up = time <= 10
    lone = force[up] > 0.6e6
    expected = np.where(lone, (force[up] - 0.3e6) / k, force[up] / (2 * k))
    assert -u[up] == pytest.approx(expected, rel=3e-5)
    assert weak[up] == pytest.approx(np.minimum(force[up] / 2, 0.3e6), rel=1e-4)
    plastic = 0.6e6 / k - 0.3e6 / k
    # Down: both elastic about the yielded state, until the weak one goes slack (a bolt takes no compression).
    down = (time > 10) & (time <= 20)
    both = (force[down] + k * plastic) / (2 * k)
    slack = both < plastic
    expected = np.where(slack, force[down] / k, both)
    # A static step of 1 s holds back 2m/dt² · Δu, 5 N in 1e5.
    assert -u[down] == pytest.approx(expected, rel=3e-5, abs=1e-7)
    assert weak[down] == pytest.approx(np.maximum(k * (both - plastic), 0.0) * ~slack, rel=1e-4, abs=10.0)
    assert state.bolts["plastic"] == pytest.approx([plastic, 0.0], rel=1e-4)


def test_a_yielding_anchor_lets_go_with_its_limit_as_a_brake():
    angle, friction, k = np.radians(35), np.radians(20), 1e8
    missing = WEIGHT * (np.sin(angle) - np.cos(angle) * np.tan(friction))
    blocks, system, at, down = slope(angle, friction, static=False)
    anchor = Bolt(1, at(5.0, 0.5), GROUND, at(8.0, 0.5), k, yield_force=0.5 * missing)
    result = march(system, State.at_rest(blocks), Loads(gravity=GRAVITY, bolts=(anchor,)), 300, 2e-3)
    sliding = 0.5 * 0.5 * missing / 2600 * 0.6**2
    # The elastic start, T/k = 35 µm, gives the slide √(T²/(k m)) more speed at most: 6 mm/s in 0.8 m/s.
    assert travel(blocks, result.state, down) == pytest.approx(sliding, rel=0.01)
    assert result.statistics["bolt:bolt"] == pytest.approx(0.5 * missing, rel=1e-9)


def test_a_bolt_breaks_at_its_strain_and_holds_no_more():
    blocks, system, at, down = slope(np.radians(35), 0.0, static=False)
    anchor = Bolt(1, at(5.0, 0.5), GROUND, at(6.0, 0.5), 1e6, yield_force=1e3, breaking_strain=0.02)
    result = march(system, State.at_rest(blocks), Loads(gravity=GRAVITY, bolts=(anchor,)), 60, 5e-3)
    assert result.state.bolts["broken"][0] and not len(result.forces.points)
    fall = 9.81 * np.sin(np.radians(35))
    assert result.acceleration[1, :2] @ down == pytest.approx(fall, rel=1e-6)


def test_blocks_hang_on_one_another_and_swing_as_a_pendulum():
    blocks = Blocks.from_polygons(
        [rectangle(-1, 3, 2, 4), rectangle(0, 0, 1, 1), rectangle(0, -2, 1, -1)], fixed=[True, False, False]
    )
    bolts = (
        Bolt(0, (0.5, 3), 1, (0.5, 1), 1e8, name="upper"),
        Bolt(1, (0.5, 0.0), 2, (0.5, -1.0), 1e8, name="lower"),
    )
    system = dda.BlockSystem(blocks, [ROCK], settings=DdaSettings(max_displacement_ratio=1.0))
    result = march(system, State.at_rest(blocks), Loads(gravity=GRAVITY, bolts=bolts), 8, 1.0)
    assert result.statistics["bolt:upper"] == pytest.approx(2 * WEIGHT, rel=1e-12)
    assert result.statistics["bolt:lower"] == pytest.approx(WEIGHT, rel=1e-12)
    assert (
        np.abs(result.state.vertices - blocks.vertices)[:, 0].max() < 1e-14
    )  # hanging still, static equilibrium is stable
    assert result.statistics["unbalanced"] < 1e-12
    # A block hung by its centroid swings as a mathematical pendulum (it need not turn): T = 2π√(L/g).
    alone = Blocks.from_polygons([rectangle(-1, 3, 2, 4), rectangle(0, 0, 1, 1)], fixed=[True, False])
    loads = Loads(gravity=GRAVITY, bolts=(Bolt(0, (0.5, 3), 1, (0.5, 0.5), 1e9),))
    rest = dda.BlockSystem(alone, [ROCK], settings=DdaSettings(max_displacement_ratio=1.0))
    state = march(rest, State.at_rest(alone), loads, 5, 1.0).state
    state.velocity[:] = 0.0
    state.velocity[1, 0] = 0.05
    swing = dda.BlockSystem(alone, [ROCK], settings=DdaSettings(max_displacement_ratio=1.0, dynamic_factor=1.0))
    track = []
    while state.time < 5 + 4:
        state = swing.step(state, loads, 5e-3).state
        track.append([state.time - 5, state.vertices[4:, 0].mean() - 0.5])
    t, x = np.array(track).T
    down = np.flatnonzero((x[1:] < 0) & (x[:-1] >= 0))[0]
    back = np.flatnonzero((x[1:] >= 0) & (x[:-1] < 0))[0]
    zeros = [t[i] - x[i] * (t[i + 1] - t[i]) / (x[i + 1] - x[i]) for i in (down, back)]
    assert 2 * (zeros[1] - zeros[0]) == pytest.approx(2 * np.pi * np.sqrt(2.5 / 9.81), rel=1e-3)


def test_a_dowel_resists_across_up_to_its_strength():
    blocks = Blocks.from_polygons([rectangle(-5, -1, 5, 0), rectangle(0, 0, 1, 1)], fixed=[True, False])
    system = dda.BlockSystem(blocks, [ROCK], [JointLaw("smooth")], settings=DdaSettings(max_displacement_ratio=1.0))
    dowel = Bolt(
        1, (0.5, 0.05), 0, (0.5, -0.05), 1e9, shear_stiffness=1e8, shear_strength=5e4, compression=True, name="d"
    )
    push = History.ramp([1e4, 0.0])
    loads = Loads(gravity=GRAVITY, bolts=(dowel,), point_loads=(PointLoad(1, (0.5, 0.0), push),))
    # To 40 kN it holds, elastic; at 50 kN it goes.
    result = march(system, State.at_rest(blocks), loads, 4, 1.0)
    assert abs(result.state.bolts["shear_force"][0]) == pytest.approx(4e4, rel=1e-4)
    assert result.state.vertices[4:6, 0].mean() - 0.5 == pytest.approx(4e4 / 1e8, rel=1e-2)
    result = march(system, result.state, loads, 2, 1.0)
    assert abs(result.state.bolts["shear_force"][0]) == 5e4
    assert result.state.bolts["slid"][0] > 1e-3


def test_bolts_come_at_their_time_and_go_with_their_block():
    blocks = Blocks.from_polygons([rectangle(-1, 3, 2, 4), rectangle(0, 0, 1, 1)], fixed=[True, False])
    bolt = Bolt(0, (0.5, 3), 1, (0.5, 1), 1e8, pretension=WEIGHT, installation=0.0305)
    loads = Loads(gravity=GRAVITY, bolts=(bolt,), excavations=(Excavation(0.05, (1,)),))
    system = dda.BlockSystem(blocks, [ROCK], settings=DdaSettings(max_displacement_ratio=1.0, dynamic_factor=1.0))
    state, forces = State.at_rest(blocks), {}
    while state.time < 0.06:
        result = system.step(state, loads, 0.01)
        state = result.state
        forces[round(state.time, 6)] = result.statistics["bolt:bolt"]
    assert forces[0.0305] == 0.0
    speed = 9.81 * 0.0305
    # It starts at its pretension and takes up the fall: at most as a spring that stops a mass, v √(k m).
    assert WEIGHT < forces[0.0405] < WEIGHT + speed * np.sqrt(1e8 * 2600)
    assert forces[0.06] == 0.0 and state.bolts["broken"][0]


def test_a_grouted_bar_becomes_a_bolt_at_every_joint():
    blocks = Blocks.from_polygons([rectangle(0, k, 2, k + 1) for k in range(4)], fixed=[True, False, False, False])
    bolts = grouted_bolt(blocks, (1.0, 0.5), (1.4, 3.3), axial_stiffness=1e8, active_length=0.2, name="bar")
    assert [(b.block, b.other) for b in bolts] == [(0, 1), (1, 2), (2, 3)]
    assert [b.name for b in bolts] == ["bar/1", "bar/2", "bar/3"]
    assert all(b.stiffness == pytest.approx(5e8) and b.compression for b in bolts)
    assert np.array(bolts[1].start) * 0.5 + np.array(bolts[1].end) * 0.5 == pytest.approx([1.0 + 0.4 * 1.5 / 2.8, 2.0])
    with pytest.raises(ValueError, match="'bar' crosses no joint"):
        grouted_bolt(blocks, (1.0, 0.2), (1.2, 0.8), axial_stiffness=1e8, active_length=0.2, name="bar")


def test_faulty_bolts_are_refused_by_name():
    good = {"block": 1, "start": (2.0, 0.0), "other": 0, "end": (0.0, 1.0), "stiffness": 1e8, "name": "A"}
    for wrong, match in (
        ({"stiffness": 0.0}, "bolt 'A': stiffness must be positive"),
        ({"pretension": 2e5, "yield_force": 1e5}, "bolt 'A': its pretension, 200000 N/m, exceeds its yield force"),
        ({"end": (2.0, 0.0)}, "bolt 'A': both ends are at the same point"),
        ({"other": 1}, "bolt 'A': both ends are in the same block"),
        ({"installation": -1.0}, "bolt 'A': installation must not be negative"),
    ):
        with pytest.raises(ValueError, match=match):
            Bolt(**{**good, **wrong})
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1), rectangle(2, 0, 3, 1)], fixed=[True, True])
    system = dda.BlockSystem(blocks, [ROCK])
    for wrong, match in (({}, "bolt 'A' has no effect"), ({"block": 9}, "bolt 'A' names block 9, but there are 2")):
        with pytest.raises(ValueError, match=match):
            system.step(State.at_rest(blocks), Loads(bolts=(Bolt(**{**good, **wrong}),)), 1.0)


def test_a_bolt_does_not_move_what_is_held():
    constrained = np.zeros((1, 6), bool)
    constrained[0, [0, 2, 3, 4, 5]] = True
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1)], constrained=constrained)
    system = dda.BlockSystem(blocks, [ROCK], settings=DdaSettings(max_displacement_ratio=1.0))
    bolt = Bolt(0, (0.9, 0.2), GROUND, (2.9, 2.2), 1e6, shear_stiffness=1e5)
    loads = Loads(gravity=GRAVITY, bolts=(bolt,))
    result = march(system, State.at_rest(blocks), loads, 6, 1.0)
    moved = result.state.vertices - blocks.vertices
    # Up and down only: k sin²45° + kₛ cos²45° carry the weight (their slope turns with the 46 mm that it comes down).
    assert moved[:, 0] == pytest.approx(np.zeros(4), abs=0) and np.ptp(moved[:, 1]) < 1e-15
    assert moved[0, 1] == pytest.approx(-WEIGHT / (0.5 * (1e6 + 1e5)), rel=0.03)


def test_bolts_in_a_system_that_is_solved_sparse():
    # 70 free blocks are beyond the dense solver: a row hung block by block from a beam, and from one another sideways.
    n = 70
    blocks = Blocks.from_polygons(
        [rectangle(-1, 3, 2 * n, 4), *(rectangle(2 * k, 0, 2 * k + 1, 1) for k in range(n))], fixed=[True] + [False] * n
    )
    bolts = tuple(Bolt(0, (2 * k + 0.5, 3.0), k + 1, (2 * k + 0.5, 1.0), 1e8) for k in range(n))
    bolts += tuple(Bolt(k + 1, (2 * k + 1.0, 0.5), k + 2, (2 * k + 2.0, 0.5), 1e7) for k in range(n - 1))
    system = dda.BlockSystem(blocks, [ROCK], settings=DdaSettings(max_displacement_ratio=1.0))
    result = march(system, State.at_rest(blocks), Loads(gravity=GRAVITY, bolts=bolts), 6, 1.0)
    forces = result.state.bolts["force"]
    assert forces[:n] == pytest.approx(np.full(n, WEIGHT), rel=1e-8)
    assert np.abs(forces[n:]).max() < 1e-3 * WEIGHT
    assert result.statistics["unbalanced"] < 1e-9
