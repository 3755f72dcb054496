"""Imposed motion, moving bases and excavations, exact where they must be."""

import numpy as np
import pytest
from block_problems import rectangle

from geomech import dda
from geomech.model import (
    BaseMotion,
    BlockMotion,
    Blocks,
    Bolt,
    DdaSettings,
    EdgeTraction,
    Excavation,
    History,
    JointLaw,
    Loads,
    Material,
    PointLoad,
    PointMotion,
    State,
    WaterTable,
)

ROCK = Material("rock", 10e9, 0.25, density=2600.0)
GRAVITY = History.constant([0.0, -9.81])
NAMES = ["base", "rock", "platen"]


def press(platen_fixed, penalty=1e14):
    """A block of 2 × 2 m between a fixed base and a platen."""
    blocks = Blocks.from_polygons(
        [rectangle(-1, -1, 1, 0), rectangle(-1, 0, 1, 2), rectangle(-1, 2, 1, 3)], fixed=[True, False, platen_fixed],
        names=NAMES,
    )  # fmt: skip
    settings = DdaSettings(max_displacement_ratio=1.0, normal_penalty=penalty)
    return blocks, dda.BlockSystem(blocks, [ROCK], [JointLaw("smooth")], settings=settings)


def march(system, state, loads, steps, dt):
    for _ in range(steps):
        result = system.step(state, loads, dt)
        state = result.state
    return result


def test_a_fixed_platen_is_driven_and_says_what_it_takes():
    blocks, system = press(platen_fixed=True)
    result = march(
        system, State.at_rest(blocks), Loads(block_motions=(BlockMotion(2, History.ramp([-1e-4]), ("v0",)),)), 5, 1.0
    )
    moved = result.state.vertices - blocks.vertices
    assert moved[8:, 1] == pytest.approx(np.full(4, -5e-4), abs=1e-14)  # round-off of adding to 3 m
    assert moved[8:, 0] == pytest.approx(np.zeros(4), abs=0)
    # Springs of k = 1e14 Pa at both ends of each side take their share: stress −δ / (h/E' + 2/(2k/w)).
    stiffness = ROCK.plane_modulus
    stress = -5e-4 / (2.0 / stiffness + 2 * 2.0 / (2 * 1e14))
    assert result.state.stress[1, 1] == pytest.approx(
        stress, rel=5e-4
    )  # small strain against added-up steps: δ/h = 2.5e-4
    assert result.statistics["reaction_y:platen"] == pytest.approx(2 * result.state.stress[1, 1], rel=5e-4)
    assert result.state.velocity[2, 1] == pytest.approx(-1e-4, rel=1e-14)
    assert result.statistics["unbalanced"] < 1e-9


def test_some_unknowns_of_a_block_are_given_and_the_rest_follow():
    blocks, system = press(platen_fixed=False)
    pressed = Loads(block_motions=(BlockMotion(2, History.ramp([0.0, -1e-4, 0.0])),))
    result = march(system, State.at_rest(blocks), pressed, 5, 1.0)
    centre = blocks.mean_vertices(result.state.vertices) - blocks.mean_vertices(blocks.vertices)
    assert centre[2] == pytest.approx([0.0, -5e-4], abs=1e-14)
    assert result.state.stress[2, 1] == pytest.approx(
        result.state.stress[1, 1] / 2, rel=1e-3
    )  # half of it is free above
    # The reaction is what the block below carries, the platen's own inertia (1e-4 m/s gained in 1 s) aside.
    below = -result.contacts["normal_force"][result.contacts["block"] != 0].sum()
    assert result.forces.reaction[2, 1] == pytest.approx(2 * result.state.stress[1, 1], rel=1e-3)
    assert result.statistics["reaction_y:platen"] == result.forces.reaction[2, 1]
    assert below < 0 and result.statistics["unbalanced"] < 1e-9


def test_strains_may_be_given_too():
    blocks = Blocks.from_polygons([rectangle(0, 0, 2, 1)], names=["bar"])
    system = dda.BlockSystem(blocks, [ROCK], settings=DdaSettings(max_displacement_ratio=1.0))
    given = BlockMotion(0, History.ramp([1e-6, 0.0, 0.0, 0.0]), ("ex", "u0", "v0", "r0"))
    result = march(system, State.at_rest(blocks), Loads(block_motions=(given,)), 10, 1.0)
    # εy and γ free: uniaxial stress E' ε, logarithmic strain of ten steps to 1e-5.
    assert result.state.stress[0] == pytest.approx([ROCK.plane_modulus * 1e-5, 0, 0], rel=1e-7, abs=1e-3)
    assert result.forces.reaction[0, 3] == pytest.approx(2.0 * ROCK.plane_modulus * 1e-5, rel=1e-4)


@pytest.mark.parametrize("stiffness", [None, 1e12])
def test_points_are_moved_exactly_or_by_springs(stiffness):
    blocks, system = press(platen_fixed=False)
    down = History.ramp([0.0, -1e-4])
    loads = Loads(
        gravity=GRAVITY,
        point_motions=(
            PointMotion(2, (-1.0, 3.0), down, stiffness=stiffness),
            PointMotion(2, (1.0, 3.0), History.ramp([-1e-4]), direction=(0, 1), stiffness=stiffness),
        ),
    )
    result = march(system, State.at_rest(blocks), loads, 5, 1.0)
    moved = result.state.vertices[[10, 11], 1] - blocks.vertices[[10, 11], 1]
    force = np.array([result.statistics["reaction_y:point 2"], result.statistics["reaction_y:point 1"]])
    missing = np.zeros(2) if stiffness is None else -force / stiffness
    assert moved == pytest.approx(-5e-4 + missing, abs=1e-15 if stiffness is None else 1e-12)
    # Statics: what is put on, and the weights, stand on the base.
    on_base = result.contacts["normal_force"][(result.contacts["block"] == 0) | (result.contacts["other"] == 0)].sum()
    weight = 2600 * 9.81 * (blocks.areas()[1:]).sum()
    assert on_base == pytest.approx(weight - force.sum(), rel=1e-6)
    assert result.statistics["unbalanced"] < 1e-9


def test_a_point_goes_round_a_circle():
    # Velocity of a point on a rigidly turning block, one step after another: the other unknowns find their own way, and
    # the displacement that is given is met to the square of a step's turn, which the next step makes good.
    blocks = Blocks.from_polygons([rectangle(-1, -1, 1, 1)])
    system = dda.BlockSystem(blocks, [ROCK], settings=DdaSettings(dynamic_factor=1.0, max_displacement_ratio=1.0))
    t = np.linspace(0.0, 1.0, 401)
    circle = History.table(t, 0.3 * np.stack([np.cos(2 * np.pi * t) - 1, np.sin(2 * np.pi * t)], axis=1))
    state = State.at_rest(blocks)
    loads = Loads(point_motions=(PointMotion(0, (1.0, 1.0), circle), PointMotion(0, (-1.0, -1.0), circle)))
    for _ in range(400):
        state = system.step(state, loads, 0.0025).state
        assert state.vertices[2] - [1.0, 1.0] == pytest.approx(circle.at(state.time), abs=1e-12)
    assert state.vertices == pytest.approx(blocks.vertices, abs=1e-6)


def test_a_held_platen_moves_along_its_guide_only():
    constrained = np.zeros((3, 6), bool)
    constrained[2, [0, 2, 5]] = True
    blocks = Blocks.from_polygons(
        [rectangle(-1, -1, 1, 0), rectangle(-1, 0, 1, 2), rectangle(-1.5, 2, 1, 3)], fixed=[True, False, False],
        constrained=constrained,
        names=NAMES,
    )  # fmt: skip
    system = dda.BlockSystem(blocks, [ROCK], [JointLaw("smooth")], settings=DdaSettings(max_displacement_ratio=1.0))
    loads = Loads(block_motions=(BlockMotion(2, History.ramp([-1e-4]), ("v0",)),))
    result = march(system, State.at_rest(blocks), loads, 3, 1.0)
    assert result.state.rotation[2] == 0.0 and abs(result.state.stress[2, 2]) < 1e-9 * abs(result.state.stress[2, 1])
    centre = blocks.mean_vertices(result.state.vertices) - blocks.mean_vertices(blocks.vertices)
    assert centre[2] == pytest.approx([0.0, -3e-4], abs=1e-14)


def test_what_cannot_be_imposed_is_refused_by_name():
    blocks, system = press(platen_fixed=False)
    state, still = State.at_rest(blocks), History.constant([0.0, 0.0])

    def refused(match, **loads):
        with pytest.raises(ValueError, match=match):
            system.step(state, Loads(**loads), 1.0)

    refused("'base' is fixed", block_motions=(BlockMotion(0, still, ("u0", "ex")),))
    refused("point of 'base'.*fixed", point_motions=(PointMotion(0, (0.0, 0.0), still),))
    twice = (PointMotion(2, (1.0, 3.0), still), PointMotion(2, (1.0, 3.0), still))
    refused("'platen': the motions prescribed for it contradict or repeat", point_motions=twice)
    with pytest.raises(ValueError, match=r"2 unknowns of block 1.*1 columns"):
        BlockMotion(1, History.constant([0.0]), ("u0", "v0"))
    with pytest.raises(ValueError, match="different ones of u0, v0"):
        BlockMotion(1, still, ("u0", "w0"))
    with pytest.raises(ValueError, match="two columns"):
        PointMotion(1, (0.0, 0.0), History.constant([0.0]))


# -- moving base -------------------------------------------------------------------------------------------------------


def shaken(frame, record, friction, dt, end, slope=0.0):
    c, s = np.cos(slope), np.sin(slope)
    turn = np.array([[c, s], [-s, c]])
    blocks = Blocks.from_polygons(
        [rectangle(-6, -1, 6, 0) @ turn, rectangle(-0.5, 0, 0.5, 0.25) @ turn], fixed=[True, False]
    )
    joint = JointLaw("joint", friction_angle=np.arctan(friction))
    settings = DdaSettings(dynamic_factor=1.0, max_displacement_ratio=0.1)
    rock = [Material("rock", 10e9, 0.0, density=2600.0)]
    rest = dda.BlockSystem(blocks, rock, [joint], settings=DdaSettings(max_displacement_ratio=0.1))
    state = State.at_rest(blocks)
    for _ in range(3):
        state = rest.step(state, Loads(gravity=GRAVITY), 1e-9).state
    state.velocity[:] = 0.0
    system = dda.BlockSystem(blocks, rock, [joint], settings=settings)
    loads = Loads(gravity=GRAVITY, base=BaseMotion(record, frame))
    while state.time < end * (1 - 1e-9):
        state = system.step(state, loads, min(dt, end - state.time)).state
    moved = blocks.mean_vertices(state.vertices) - blocks.mean_vertices(blocks.vertices)
    return moved[0], (moved[1] - moved[0]) @ [c, s], state


def newmark(record, friction, slope, end, g=9.81, dt=2e-5):
    """Sliding of a rigid block down the ``slope`` on a base with acceleration ``record`` (Newmark 1965), by small
    steps; positive up the slope. Normal force and friction with the base's acceleration in both directions."""
    c, s = np.cos(slope), np.sin(slope)
    x = v = 0.0
    for i in range(round(end / dt)):
        ax, ay = record.at((i + 0.5) * dt)
        along = -(ax * c + (ay + g) * s)
        normal = (ay + g) * c - ax * s
        strength = friction * max(normal, 0.0)
        if v == 0.0 and abs(along) <= strength:
            continue
        drive = along - strength * np.sign(v if v != 0.0 else along)
        after = v + drive * dt
        if v != 0.0 and after * v < 0.0:
            after = 0.0
        x, v = x + 0.5 * (v + after) * dt, after
    return x


def test_the_base_moves_as_its_record_says():
    record = History.sinusoid([3.0, -1.0], 2.0, end=1.0)
    moved, _, state = shaken("ground", record, 2.0, 2e-3, 0.7)
    assert moved == pytest.approx(record.double_integral(0.7), abs=1e-14)
    assert state.velocity[0, :2] == pytest.approx(record.integral(0.7), abs=1e-15)
    # Stuck to it, the block goes with it.
    assert state.velocity[1, :2] == pytest.approx(record.integral(0.7), abs=5e-4)


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("slope_deg", [0.0, 15.0])
def test_sliding_on_a_shaken_base_is_newmarks_and_the_same_from_ground_and_base(slope_deg):
    record, friction, slope = History.sinusoid([4.0, 0.0], 1.5, end=0.5 / 1.5), 0.3, np.radians(slope_deg)
    expected = newmark(record, friction, slope, 0.8)
    slides = [shaken(frame, record, friction, 2e-3, 0.8, slope)[1] for frame in ("ground", "base")]
    # Starts and stops of the slide fall inside steps of the block solver (2 ms) and of the reference (20 µs): 2e-4 of
    # 15 mm found.
    assert abs(expected) > 0.01
    assert slides == pytest.approx([expected, expected], rel=5e-4)


# -- excavation --------------------------------------------------------------------------------------------------------


def test_what_stood_on_a_support_falls_freely_when_it_is_taken_out():
    blocks = Blocks.from_polygons(
        [rectangle(-2, -1, 2, 0), rectangle(0, 0, 1, 1), rectangle(0, 1, 1, 2)], fixed=[True, False, False],
        names=["ground", "support", "top"],
    )  # fmt: skip
    joint = [JointLaw("joint", friction_angle=0.5)]
    rest = dda.BlockSystem(blocks, [ROCK], joint, settings=DdaSettings(max_displacement_ratio=1.0))
    state = march(rest, State.at_rest(blocks), Loads(gravity=GRAVITY), 4, 0.01).state
    state.velocity[:] = 0.0
    before = state.vertices[8:, 1].mean()
    system = dda.BlockSystem(
        blocks, [ROCK], joint, settings=DdaSettings(dynamic_factor=1.0, max_displacement_ratio=1.0)
    )
    loads = Loads(gravity=GRAVITY, excavations=(Excavation(0.105, (1,)),))
    times = []
    while state.time < 0.3 - 1e-12:
        state = system.step(state, loads, min(0.01, 0.3 - state.time)).state
        times.append(state.time)
    assert any(t == pytest.approx(0.105, abs=1e-15) for t in times)  # no step passes the excavation
    # Constant acceleration is integrated exactly; the elastic rebound of what stood at rest is internal.
    assert state.vertices[8:, 1].mean() - before == pytest.approx(-0.5 * 9.81 * 0.195**2, abs=1e-9)
    assert state.removed.tolist() == [False, True, False] and not state.stress[1].any()
    assert not len(state.contacts)


def test_excavation_by_polygon_takes_loads_with_it_and_unloads_the_rest():
    # A column of three blocks under a load on the top one: without it, the others carry their weight again.
    blocks = Blocks.from_polygons(
        [rectangle(-2, -1, 3, 0), *(rectangle(0, k, 1, k + 1) for k in range(3))], fixed=[True, False, False, False],
        edge_names=[[[""] * 4]] * 3 + [[["", "", "load", ""]]],
    )  # fmt: skip
    system = dda.BlockSystem(
        blocks, [ROCK], [JointLaw("joint", friction_angle=0.5)], settings=DdaSettings(max_displacement_ratio=1.0)
    )
    loads = Loads(
        gravity=GRAVITY,
        edge_tractions=(EdgeTraction("load", History.constant([0.0, -1e6])),),
        point_loads=(PointLoad(3, (0.5, 2.5), History.constant([0.0, -1e5])),),
        water=WaterTable(np.array([[0.0, 0.0]])),
        excavations=(Excavation(2.0, polygon=rectangle(-1, 2, 2, 4)),),
    )
    weight = 2600 * 9.81
    state = march(system, State.at_rest(blocks), loads, 2, 1.0).state
    assert state.stress[1, 1] == pytest.approx(-(1e6 + 1e5 + 2.5 * weight), rel=1e-3)
    result = march(system, state, loads, 4, 1.0)
    assert result.state.stress[1:, 1] == pytest.approx([-1.5 * weight, -0.5 * weight, 0.0], rel=1e-3)
    assert not (result.forces.edges["block"] == 3).any() and not len(result.forces.points)
    assert result.statistics["unbalanced"] < 1e-9


def test_an_excavation_that_takes_nothing_is_refused():
    blocks, system = press(platen_fixed=True)
    with pytest.raises(ValueError, match="no block's centre lies in the polygon of the excavation at 0 s"):
        system.step(State.at_rest(blocks), Loads(excavations=(Excavation(0.0, polygon=rectangle(5, 5, 6, 6)),)), 1.0)
    with pytest.raises(ValueError, match="removes block 7, but there are 3"):
        system.step(State.at_rest(blocks), Loads(excavations=(Excavation(0.0, (7,)),)), 1.0)
    with pytest.raises(ValueError, match="names no blocks"):
        Excavation(1.0)


# -- together with the rest --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_platen_drives_contacts_that_do_not_penetrate(friction):
    blocks, _ = press(platen_fixed=True)
    settings = DdaSettings(max_displacement_ratio=1.0, contact="augmented")
    system = dda.BlockSystem(blocks, [ROCK], [JointLaw("joint", friction_angle=friction)], settings=settings)
    driven = Loads(block_motions=(BlockMotion(2, History.ramp([2e-5, -1e-4]), ("u0", "v0")),))
    result = march(system, State.at_rest(blocks), driven, 5, 1.0)
    stress, strain = result.state.stress[1], -5e-4 / 2
    if friction == 0.0:
        expected = np.array([0.0, ROCK.plane_modulus * strain, 0.0])
    else:
        # Stuck to both: no strain along x, shear u/h.
        m, nu = ROCK.stiffness(), 5e-4 / 5 / 2
        expected = m @ np.array([0.0, strain, nu])
    # Nothing is lost to springs; five steps add up the strain of a block that gets shorter by 2.5e-4 (Coulomb aside).
    assert stress == pytest.approx(expected, rel=5e-4, abs=1.0)
    assert result.statistics["reaction_y:platen"] == pytest.approx(2 * stress[1], rel=5e-4)


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("newmark", [(0.5, 1.0), (0.25, 0.5)])
def test_the_work_of_a_shaken_base_and_of_a_yielding_bolt_closes_the_energy_budget(newmark):
    blocks = Blocks.from_polygons(
        [rectangle(-6, -1, 6, 0), rectangle(0, 0, 1, 1), rectangle(0, 1, 1, 2)], fixed=[True, False, False]
    )
    settings = DdaSettings(max_displacement_ratio=0.1, dynamic_factor=1.0, newmark=newmark)
    system = dda.BlockSystem(blocks, [ROCK], [JointLaw("joint", friction_angle=0.3)], settings=settings)
    loads = Loads(
        gravity=GRAVITY,
        base=BaseMotion(History.sinusoid([4.0, 1.0], 3.0)),
        bolts=(Bolt(1, (0.5, 0.5), 2, (0.5, 1.5), 1e8, pretension=1e4, yield_force=2e4),),
    )
    state, budget = State.at_rest(blocks), dda.EnergyBudget()
    for _ in range(150):
        result = system.step(state, loads, 2e-3)
        state, budget = result.state, budget.after(result.energy, result.state.time)
    assert budget.friction > 10.0 and abs(budget.load_work) > 100.0
    # Between steps the geometry is updated exactly where the step was linear; elastic strains here are 1e-6.
    assert abs(budget.residual) < 1e-6 * abs(budget.load_work)
