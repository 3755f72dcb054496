"""What makes no sense is refused by name where it is given: settings, laws, materials, loads, bolts, lists of blocks."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from geomech import dda
from geomech.model import (
    GROUND,
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
    Roughness,
    State,
    ViscousBoundary,
    WaterTable,
    grouted_bolt,
)
from geomech.model.loads.history import Wave

NAN, INF = math.nan, math.inf
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
ROCK = Material("rock", 5e9, 0.25, density=2600.0)
PUSH = History.constant([1.0, 0.0])
BOLT = {"block": 1, "start": (0.5, 0.5), "other": 0, "end": (0.5, -1.0), "stiffness": 1e8, "name": "anchor"}


def two_blocks(**more) -> Blocks:
    return Blocks.from_polygons([3 * SQUARE - [1, 3], SQUARE], **{"fixed": [True, False], **more})


SETTINGS = {
    "time_step": (0.0, -1.0, NAN, INF),
    "dynamic_factor": (-0.1, 1.1, NAN),
    "newmark": ((NAN, 0.5), (0.25, INF), (0.25, 0.4), (0.25, 0.6), (-1.0, 0.5), (0.5,)),
    "spectral_radius": (-0.1, 1.1, NAN),
    "equilibrium": ("never",),
    "unbalanced_tolerance": (0.0, -1e-6, NAN, INF),
    "damping": (-1.0, NAN, INF),
    "rayleigh_mass": (-1.0, NAN, INF),
    "rayleigh_stiffness": (-1.0, NAN, INF),
    "max_displacement_ratio": (0.0, -1.0, NAN, INF),
    "normal_penalty": (0.0, -1.0, NAN, INF, "1e9"),
    "shear_penalty": (0.0, -1.0, NAN, INF),
    "contact": ("lagrange",),
    "springs": ("soft",),
    "penetration_tolerance": (0.0, -1.0, 2.0, NAN),
    "corner_rounding": (-0.01, 0.3, NAN),
    "order_target": (0.0, -1.0, 1.1, NAN),
    "max_open_close_iterations": (0, -1, 2.5, NAN),
    "max_step_cuts": (-1, 0.5, NAN),
}
LAW = {
    "friction_angle": (-0.1, math.pi / 2, NAN),
    "residual_friction_angle": (-0.1, 0.9, NAN),
    "dilation_angle": (-0.1, 0.9, NAN),
    "cohesion": (-1.0, NAN),
    "tensile_strength": (-1.0, NAN),
    "residual_cohesion": (-1.0, 2e5, NAN),
    "normal_stiffness": (0.0, -1.0, NAN, INF),
    "shear_stiffness": (0.0, -1.0, NAN, INF),
    "softening_slip": (-1.0, NAN, INF),
    "dilation_slip": (0.0, -1.0, NAN),
    "max_closure": (0.0, -1.0, NAN, INF),
    "crushing_strength": (0.0, -1.0, NAN, INF),
    "restitution": (-0.1, 1.1, NAN),
}
ROCKS = {
    "youngs_modulus": (0.0, -1.0, NAN, INF),
    "poissons_ratio": (-1.0, 0.5, NAN),
    "density": (-1.0, NAN, INF),
    "k_ic": (0.0, -1.0, NAN),
    "k_iic": (0.0, -1.0, NAN),
    "tensile_strength": (0.0, -1.0, NAN),
    "cohesion": (0.0, -1.0, NAN),
    "friction_angle": (-0.1, math.pi / 2, NAN),
    "plane": ("", "stretch"),
}
BOLTS = {
    "stiffness": (0.0, -1.0, NAN, INF),
    "pretension": (-1.0, NAN, INF, 2e9),
    "yield_force": (0.0, -5.0, NAN),
    "breaking_strain": (0.0, -1.0, NAN),
    "shear_stiffness": (-1.0, NAN, INF),
    "shear_strength": (0.0, -1.0, NAN),
    "installation": (-1.0, NAN, INF),
    "start": ((NAN, 0.0), (0.0, INF), (0.0, 0.0, 0.0), (0.5, -1.0)),
    "end": ((NAN, 0.0), (0.5, 0.5)),
    "other": (1,),
}


def each(table):
    return [(name, value) for name, values in table.items() for value in values]


@pytest.mark.parametrize(
    ("made", "table", "words"),
    [
        (DdaSettings, SETTINGS, ""),
        (lambda **wrong: JointLaw("bed", **{"friction_angle": 0.5, "cohesion": 1e5, "normal_stiffness": 1e9, **wrong}),
         LAW, "joint 'bed': "),
        (lambda **wrong: Material("stone", **{"youngs_modulus": 1e9, "poissons_ratio": 0.2, "k_ic": 1e6, **wrong}),
         ROCKS, "material 'stone': "),
        (lambda **wrong: Bolt(**{**BOLT, "yield_force": 1e9, **wrong}), BOLTS, "bolt 'anchor': "),
    ],
    ids=["settings", "joint", "material", "bolt"],
)  # fmt: skip
def test_numbers_that_make_no_sense_are_refused_where_they_are_given(made, table, words):
    made()
    for name, value in each(table):
        with pytest.raises(ValueError, match=words or None) as refusal:
            made(**{name: value})
        # The words of the name, in whatever form the message has them.
        told = str(refusal.value).lower()
        stem = {"newmark": "newmark", "k_ic": "fracture toughness", "k_iic": "toughness", "other": "both ends",
                "start": "", "end": ""}.get(name, name)  # fmt: skip
        assert stem in told.replace("'s", "s") or stem.replace("_", " ") in told.replace("'s", "s"), (name, value, told)


def test_the_tables_hold_every_number_there_is():
    no_numbers = {"name", "roughness", "rigid", "automatic_time_step", "block", "compression", "contact_solver"}
    for owner, table in ((DdaSettings, SETTINGS), (JointLaw, LAW), (Material, ROCKS), (Bolt, BOLTS)):
        assert set(owner.__dataclass_fields__) - no_numbers == set(table)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Roughness(10.0, 1e8, reduction=INF), "reduction factor of a rough joint must be positive"),
        (lambda: JointLaw("b", cohesion=INF, softening_slip=0.1), "infinite cohesion"),
        (lambda: PointLoad(1, (NAN, 0.5), PUSH), "point load on block 1 needs two finite coordinates"),
        (lambda: PointLoad(1, (0.5, 0.5), History.constant([1.0])), "point load on block 1 needs a history of two"),
        (lambda: EdgeTraction("top", History.constant([1.0])), "'top' needs a history of two columns"),
        (lambda: ViscousBoundary("base", History.constant([1.0])), "'base' needs a history of two columns"),
        (lambda: Loads(gravity=History.constant([9.81])), "gravity needs a history of two columns"),
        (lambda: PointMotion(1, (INF, 0.0), PUSH), "motion of a point of block 1 needs two finite"),
        (lambda: PointMotion(1, (0, 0), History.constant([1.0]), (NAN, 0.0)), "no direction"),
        (lambda: PointMotion(1, (0.0, 0.0), PUSH, stiffness=INF), "stiffness of a prescribed point motion must be positive"),
        (lambda: WaterTable(np.zeros((1, 2)), level=PUSH), "level of a water table needs a history of one column"),
        (lambda: WaterTable(np.zeros((1, 2)), unit_weight=NAN), "unit weight of water must be positive"),
        (lambda: Excavation(1.0, polygon=[[0, 0], [1, 0], [NAN, 1]]), "point that is not finite"),
        (lambda: History.ramp([NAN]), "rate of a history needs 1 finite"),
        (lambda: History(np.zeros(1), np.zeros((1, 2)), rate=np.zeros(1)), "rate of a history needs 2 finite"),
        (lambda: Wave(np.array([NAN]), 1.0), "sinusoid has an amplitude"),
        (lambda: grouted_bolt(two_blocks(), (0.5, 0.5), (0.5, -1), axial_stiffness=-1.0, active_length=0.5, name="bar"),
         "bolt 'bar': axial_stiffness must be positive"),
        (lambda: grouted_bolt(two_blocks(), (0.5, 0.5), (0.5, -1), axial_stiffness=1e8, active_length=0.0, name="bar"),
         "bolt 'bar': active_length must be positive"),
        (lambda: two_blocks(fixed=[True]), "fixed needs an entry for each of 2 blocks, got 1"),
        (lambda: two_blocks(fixed=[True, False, True]), "fixed needs an entry for each of 2 blocks, got 3"),
        (lambda: two_blocks(material=[0]), "material needs an entry for each of 2 blocks, got 1"),
        (lambda: two_blocks(material=[0, -1]), "material of block 1 must be an index"),
        (lambda: two_blocks(names=["base"]), "names needs an entry for each of 2 blocks, got 1"),
        (lambda: two_blocks(constrained=[[True] * 6]), "constrained needs an entry for each of 2 blocks, got 1"),
        (lambda: two_blocks(constrained=[[True] * 3] * 2), "constrained needs six entries per block"),
        (lambda: two_blocks(edge_names=[[[""] * 4]]), "edge_names needs an entry for each of 2 blocks, got 1"),
        (lambda: two_blocks(edge_names=[[[""] * 4], []]), "block 1: edge_names needs a list for each of 1 loops"),
        (lambda: two_blocks(edge_names=[[[""] * 4], [[""] * 3]]), "block 1: 4 edges but 3 edge names"),
    ],
)  # fmt: skip
def test_what_is_not_as_it_must_be_is_refused_by_name(make, words):
    with pytest.raises(ValueError, match=words):
        make()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Loads(gravity=[0.0, -9.81]), "gravity must be a History .*, got a list"),
        (lambda: EdgeTraction("top", np.zeros(2)), "'top' must be a History"),
        (lambda: PointLoad(1, (0.5, 0.5), 1.0), "point load on block 1 must be a History"),
        (lambda: BlockMotion(1, [0.0, 0.0, 0.0]), "motion of block 1 must be a History"),
        (lambda: PointMotion(1, (0.5, 0.5), [0.0, 0.0]), "motion of a point of block 1 must be a History"),
        (lambda: BaseMotion([0.0, 0.0]), "acceleration of the base must be a History"),
    ],
)
def test_numbers_in_the_place_of_a_history_are_refused_by_name(make, words):
    with pytest.raises(TypeError, match=words):
        make()


def test_an_angle_in_degrees_is_told_to_be_one():
    with pytest.raises(ValueError, match=r"joint 'bed': friction angle .* got 1718.87° \(angles are in radians here\)"):
        JointLaw("bed", friction_angle=30.0)


def stepped(loads: Loads, *, rock: Material = ROCK, dt: float | None = None, **settings) -> State:
    blocks = two_blocks(names=["base", "square"])
    system = dda.BlockSystem(blocks, [rock], [JointLaw("joint", 0.5)], settings=DdaSettings(time_step=1e-3, **settings))
    return system.step(State.at_rest(blocks), loads, dt).state


@pytest.mark.parametrize(
    ("loads", "words"),
    [
        (Loads(point_loads=(PointLoad(5, (0.5, 0.5), PUSH),)), "point load 1 names block 5, but there are 2"),
        (Loads(point_loads=(PointLoad(-1, (0.5, 0.5), PUSH),)), "point load 1 names block -1, but there are 2"),
        (Loads(point_loads=(PointLoad(1, (0.5, 0.5), PUSH), PointLoad(1, (50.0, 0.5), PUSH))),
         r"point load 2 acts on 'square' at \(50, 0.5\), which lies 49 m outside"),
        (Loads(point_motions=(PointMotion(1, (0.5, 1.01), PUSH),)), "motion of point 1 acts on 'square' .* 0.01 m outs"),
        (Loads(point_motions=(PointMotion(2, (0.5, 0.5), PUSH),)), "motion of point 1 names block 2"),
        (Loads(block_motions=(BlockMotion(7, PUSH, ("u0", "v0")),)), "motion of a block names block 7"),
        (Loads(base=BaseMotion(PUSH, blocks=(0, 3))), "motion of the base names block 3"),
        (Loads(base=BaseMotion(PUSH, blocks=(0, 1))), "motion of the base names 'square', which is not fixed"),
        (Loads(viscous_boundaries=(ViscousBoundary("toe"),)), r"edges named 'toe', but no edge has that name"),
        (Loads(bolts=(Bolt(**{**BOLT, "start": (99.0, 99.0)}),)), r"bolt 'anchor' acts on 'square' at \(99, 99\)"),
        (Loads(bolts=(Bolt(**{**BOLT, "end": (0.5, 0.2)}),)),
         r"bolt 'anchor' acts on 'base' at \(0.5, 0.2\), which lies 0.2 m outside"),
        (Loads(bolts=(Bolt(**{**BOLT, "block": 7}),)), "bolt 'anchor' names block 7, but there are 2"),
        (Loads(bolts=(Bolt(**{**BOLT, "other": 7}),)), "bolt 'anchor' names block 7, but there are 2"),
    ],
)  # fmt: skip
def test_a_load_that_its_block_does_not_hold_is_refused_by_name(loads, words):
    with pytest.raises(ValueError, match=words):
        stepped(loads)


def test_loads_that_would_do_nothing_are_refused():
    names = [[["foot"] * 4], [["side"] * 4]]
    blocks = two_blocks(names=["base", "square"], edge_names=names)
    quiet = Loads(viscous_boundaries=(ViscousBoundary("side"), ViscousBoundary("foot")))
    with pytest.raises(ValueError, match="edges named 'foot', but the blocks that have them are fixed"):
        dda.BlockSystem(blocks, [ROCK]).step(State.at_rest(blocks), quiet)
    loose = Blocks.from_polygons([SQUARE])
    with pytest.raises(ValueError, match="ground motion is given, but no block is fixed"):
        dda.BlockSystem(loose, [ROCK]).step(State.at_rest(loose), Loads(base=BaseMotion(PUSH)))


def test_points_on_an_outline_and_in_the_ground_are_no_strays():
    on_corner = (0.3 - (0.3 - 1.0), 1.0)  # round-off beyond it
    stepped(
        Loads(
            gravity=History.constant([0.0, -9.81]),
            point_loads=(PointLoad(1, on_corner, PUSH), PointLoad(1, (1.0 + 1e-9, 0.5), PUSH)),
            bolts=(Bolt(1, (0.5, 1.0), GROUND, (40.0, 60.0), 1e6),),
        )
    )


def test_a_block_without_mass_may_rest_but_not_move_in_time():
    weightless = replace(ROCK, density=0.0, name="foam")
    weight = Loads(gravity=History.constant([0.0, -9.81]))
    with pytest.raises(ValueError, match=r"'square' may move, but its material 'foam' has no density"):
        stepped(weight, rock=weightless, dynamic_factor=1.0)
    assert np.isfinite(stepped(weight, rock=weightless).vertices).all()


@pytest.mark.parametrize("dt", [0.0, -1.0, NAN, INF])
def test_a_step_of_no_length_is_refused(dt):
    with pytest.raises(ValueError, match="time step must be positive"):
        stepped(Loads(), dt=dt)


@pytest.mark.parametrize("end", [-1.0, NAN])
def test_a_run_to_no_time_is_refused(end):
    with pytest.raises(ValueError, match="end_time must not be negative"):
        next(dda.run(two_blocks(), [ROCK], [], Loads(), DdaSettings(), end))


def test_a_state_of_other_blocks():
    """It ended the process: kernels read and write past the ends of its arrays."""
    blocks, others = two_blocks(), Blocks.from_polygons([3 * SQUARE - [1, 3]], fixed=[True])
    system = dda.BlockSystem(blocks, (ROCK,), (JointLaw("joint"),), None, DdaSettings())
    with pytest.raises(ValueError, match="not one of these blocks: its vertices have 4 rows, expected 8"):
        system.step(State.at_rest(others), Loads())
    moved = system.step(State.at_rest(blocks), Loads(gravity=History.constant([0.0, -9.81]))).state
    assert len(moved.contacts)
    contacts = moved.contacts.copy()
    contacts["edge"] += 8
    with pytest.raises(ValueError, match="its contacts are between vertices that do not exist"):
        system.step(replace(moved, contacts=contacts), Loads())
