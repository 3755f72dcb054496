"""Cracked blocks that stand, bend, slide and are stacked: what contacts and weight do to K, against the crack solver
alone under loads written down by hand, and against handbook values."""

import numpy as np
import pytest
from block_problems import rectangle

from geomech import ddm
from geomech.coupling import cycles
from geomech.model import (
    Blocks,
    Cracks,
    DdaSettings,
    EdgeTraction,
    History,
    JointLaw,
    Loads,
    Material,
    PointLoad,
    Problem,
    RunSettings,
)

WEIGHT = 2200.0 * 9.81
ROCK = Material("rock", 17e9, 0.21, 2200.0)  # no toughness given: nothing grows
DOWN = Loads(gravity=History.constant([0.0, -9.81]))


def problem(polygons, fixed, lines, block=0, loads=DOWN, friction_deg=30.0, mouth=False, names=None, **dda):
    cracks = Cracks.from_polylines(
        [np.array(line, dtype=float) for line in lines],
        block=block,
        aperture=np.inf,
        surface=[(True, False)] * len(lines) if mouth else None,
    )
    settings = {"time_step": 1.0, "max_displacement_ratio": 1.0, "end": 3.0, **dda}
    end = settings.pop("end")
    return Problem(
        title="blocks",
        blocks=Blocks.from_polygons(polygons, fixed=fixed, edge_names=names),
        cracks=cracks,
        materials=(ROCK,),
        joints=(JointLaw("joint", friction_angle=np.radians(friction_deg)),),
        loads=loads,
        dda=DdaSettings(**settings),
        run=RunSettings(end_time=end),
    )


def on_rock(outline, line, above=0.0, weight=WEIGHT):
    """K of the crack solver alone: a block under its ``weight`` (N/m³) with a uniform pressure on its top, its base held across."""
    cracks = Cracks.from_polylines([np.array(line)], aperture=np.inf)
    body = ddm.Body([outline], cracks, ROCK, supports=[ddm.Support(0, hold="normal")])
    load = ddm.BodyLoad(sides={2: (0.0, -above)}, body_force=np.array([0.0, -weight]), about=outline.mean(axis=0))
    return body.solve(load).tips


def last(given):
    *_, cycle = cycles(given)
    assert cycle.statistics["traction_imbalance"] < 1e-7  # contacts as tractions: in equilibrium with weight, inertia
    return cycle


def weighed(outline, line, below, above=0.0, weight=WEIGHT):
    """K of the crack solver alone: a block under its ``weight`` (N/m³) with uniform pressures on base and top."""
    body = ddm.Body([outline], Cracks.from_polylines([np.array(line)], aperture=np.inf), ROCK)
    up, down = np.array([0.0, below]), np.array([0.0, -above])
    middle = outline.mean(axis=0)
    tractions = [[up, up]] + ([[down, down]] if above else [])
    segments = [outline[:2], outline[2:]][: len(tractions)]
    load = ddm.BodyLoad(
        segments=np.array(segments), tractions=np.array(tractions), body_force=np.array([0.0, -weight]), about=middle
    )
    return body.solve(load).tips


def test_stacked_blocks_carry_their_own_weight_and_that_above():
    """Equal pressure on equal faces of two blocks that deform, to the coupling's 1e-6; below the lower one that of the rigid ground,
    which gives K 1.2 % less than an equal one, to 1e-3."""
    lower, upper, line = rectangle(-0.5, 0, 0.5, 1), rectangle(-0.5, 1, 0.5, 2), [[-0.1, 0.5], [0.1, 0.5]]
    lines = [line, [[-0.1, 1.5], [0.1, 1.5]]]
    cycle = last(problem([lower, upper, rectangle(-1, -1, 1, 0)], [False, False, True], lines, block=[0, 1]))
    below, above = on_rock(lower, line, WEIGHT), weighed(lower, line, WEIGHT)
    assert cycle.tips["k_i"][:2] == pytest.approx(below["k_i"], rel=1e-3)
    assert cycle.tips["k_i"][2:] == pytest.approx(above["k_i"], rel=1e-6)
    assert (cycle.tips["k_i"] < 0).all()


def test_cracked_beam_on_two_blocks_in_four_point_bending():
    """K = σ √(πa) F of a strip in pure bending (Tada, Paris & Irwin 2000, 2.13; 0.2 %), the moment being each load
    times its distance from the middle of its support. Half a per cent more for the finite span between the loads."""
    force, half_crack = 1e5, 0.5
    loads = Loads(point_loads=tuple(PointLoad(0, (x, 1.0), History.ramp([0.0, -force])) for x in (-2.5, 2.5)))
    supports = [rectangle(-4.1, -0.5, -4, 0), rectangle(4, -0.5, 4.1, 0)]
    given = problem(
        [rectangle(-5, 0, 5, 1), *supports], [False, True, True], [[[0, 0], [0, half_crack]]],
        loads=loads, friction_deg=0.0, mouth=True, end=1.0,
    )  # fmt: skip
    cycle = last(given)
    bending = 6 * force * (4.05 - 2.5)
    shape = np.polynomial.Polynomial([1.122, -1.40, 7.33, -13.08, 14.0])(half_crack)
    assert cycle.tips["k_i"] == pytest.approx([bending * np.sqrt(np.pi * half_crack) * shape], rel=0.007)
    assert np.abs(cycle.tips["k_ii"]).max() < 1e-6 * cycle.tips["k_i"].max()


def test_eccentric_load_opens_the_far_side():
    """A column pressed outside its core stands on one end of its base and is pulled at the other side: an edge crack
    under P and P e (Tada, Paris & Irwin 2000, 2.10 and 2.13). The column is only two widths high: 3 %."""
    load = Loads(point_loads=(PointLoad(0, (0.3, 2.0), History.ramp([0.0, -1e5])),))
    given = problem(
        [rectangle(-0.5, 0, 0.5, 2), rectangle(-1, -1, 1, 0)], [False, True], [[[-0.5, 1], [-0.3, 1]]],
        loads=load, mouth=True,
    )  # fmt: skip
    a, force = 0.2, 3e5
    pull = np.polynomial.Polynomial([1.12, -0.231, 10.55, -21.72, 30.39])(a)
    bend = np.polynomial.Polynomial([1.122, -1.40, 7.33, -13.08, 14.0])(a)
    expected = force * (6 * 0.3 * bend - pull) * np.sqrt(np.pi * a)
    assert last(given).tips["k_i"] == pytest.approx([expected], rel=0.03)


def test_block_sliding_without_friction_feels_only_the_weight_across_the_slope():
    """Along the slope inertia takes up gravity, both fields uniform: K as at rest under g cos α. The block still rings
    on its contact springs after 0.2 s by 1e-4 of its weight, against which the tolerance is set."""
    slope = np.radians(30.0)
    turn = np.array([[np.cos(slope), -np.sin(slope)], [np.sin(slope), np.cos(slope)]])
    block, line = rectangle(-0.5, 0, 0.5, 1), np.array([[-0.15, 0.5], [0.15, 0.5]])
    given = problem(
        [block @ turn.T, rectangle(-5, -1, 5, 0) @ turn.T], [False, True], [line @ turn.T],
        friction_deg=0.0, time_step=1e-3, dynamic_factor=1.0, max_displacement_ratio=0.05, end=0.2,
    )  # fmt: skip
    cycle = last(given)
    assert cycle.state.velocity[0, :2] @ turn == pytest.approx([-9.81 * np.sin(slope) * 0.2, 0.0], abs=1e-5)
    across = WEIGHT * np.cos(slope)
    expected = on_rock(block, line, weight=across)
    assert cycle.tips["k_i"] == pytest.approx(expected["k_i"], rel=1e-3)
    assert np.abs(cycle.tips["k_ii"] - expected["k_ii"]).max() < 1e-3 * np.abs(expected["k_i"]).max()


def test_crack_from_a_hole():
    """A plate with a round hole (32 corners) and a crack from its side, pulled at its ends: as DDM alone, to the size
    of the strain, 1e-5."""
    around = np.linspace(0, 2 * np.pi, 33)[:-1]
    outline = [rectangle(-1, -2, 1, 2), 0.3 * np.column_stack([np.cos(around), -np.sin(around)])]
    pulls = tuple(EdgeTraction(name, History.ramp([0.0, s * 1e5])) for name, s in (("top", 1), ("bottom", -1)))
    given = problem(
        [outline], [False], [[[0.3, 0], [0.5, 0]]], loads=Loads(edge_tractions=pulls), mouth=True,
        names=[[["bottom", "", "top", ""], [""] * 32]], end=2.0,
    )  # fmt: skip
    pull = np.array([0.0, 2e5])
    ends = np.array([[[-1.0, -2.0], [1.0, -2.0]], [[1.0, 2.0], [-1.0, 2.0]]])
    body = ddm.Body(given.blocks.loops(0), given.cracks, ROCK, given.ddm)
    alone = body.solve(ddm.BodyLoad(segments=ends, tractions=np.array([[-pull, -pull], [pull, pull]]))).tips
    assert last(given).tips["k_i"] == pytest.approx(alone["k_i"], rel=1e-5)


def test_a_vertex_in_the_straight_side_of_a_base_changes_nothing():
    """A block on a wider base, rubbing on it, with vertices in the base's top where the block's corners stand (the ends
    of a named piece, say): the same pressure all along, so the same K as on a base without them; 1e-4 is for the other
    places at which rubbing contacts then stand."""
    block, base = rectangle(-0.5, 0, 0.5, 2), rectangle(-1, -1, 1, 0)
    line = [[-0.1, 0.5], [0.1, 0.7]]
    plain = last(problem([block, base], [False, True], [line]))
    base = np.insert(base, 3, [[0.5, 0.0], [-0.5, 0.0]], axis=0)
    noded = last(problem([block, base], [False, True], [line]))
    assert noded.tips["k_i"] == pytest.approx(plain.tips["k_i"], rel=1e-4)
    assert noded.tips["k_ii"] == pytest.approx(plain.tips["k_ii"], rel=1e-4)


def test_vertices_in_the_cracked_blocks_own_base_change_nothing():
    """The same block with named pieces in its own resting side: one joint face still, one pressure over all of it. The
    tolerance is that of the boundary's elements, which the vertices move."""
    block, base = rectangle(-0.5, 0, 0.5, 2), rectangle(-1, -1, 1, 0)
    line = [[-0.1, 0.5], [0.1, 0.7]]
    plain = last(problem([block, base], [False, True], [line]))
    block = np.insert(block, 1, [[-0.2, 0.0], [0.25, 0.0]], axis=0)
    noded = last(problem([block, base], [False, True], [line]))
    assert noded.tips["k_i"] == pytest.approx(plain.tips["k_i"], rel=1e-3)
    assert noded.tips["k_ii"] == pytest.approx(plain.tips["k_ii"], rel=1e-3)
