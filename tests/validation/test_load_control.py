"""Loads that follow the cracks, and platens that are moved: load, displacement and energy at every increment of
growth."""

import numpy as np
import pytest

from geomech import ddm
from geomech.coupling import cycles
from geomech.model import (
    BlockMotion,
    Blocks,
    Cracks,
    DdaSettings,
    EdgeTraction,
    GrowthSettings,
    History,
    JointLaw,
    Loads,
    Material,
    Problem,
    RunSettings,
)
from geomech.reference.cracks.plates import CENTRE_CRACK_PLATE
from geomech.reference.specimens.two_cracks import crack_ends

ROCK = Material("rock", 17e9, 0.21, 2200.0, 1e6)
STIFF = Material("stiff", 200e9, 0.3, 7800.0, rigid=True)
W, RATE = 0.03, 1e-8


def rectangle(x0, y0, x1, y1):
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def pulled(half_height, half_length, increment, control):
    """A plate 2W wide with a crack across its middle, glued between two stiff platens of which the upper is moved
    up."""
    w, h = W, half_height
    polygons = [rectangle(-w, -h, w, h), rectangle(-w, h, w, h + 0.01), rectangle(-w, -h - 0.01, w, -h)]
    names = [[[""] * 4], [["", "", "load:top", ""]], [[""] * 4]]
    up = BlockMotion(1, History.ramp([0.0, RATE, 0.0]))
    return Problem(
        title="pulled",
        blocks=Blocks.from_polygons(polygons, material=[0, 1, 1], fixed=[False, True, True], edge_names=names),
        cracks=Cracks.from_polylines([np.array([[-half_length, 0.0], [half_length, 0.0]])]),
        materials=(ROCK, STIFF),
        joints=(JointLaw("glue", friction_angle=0.5, cohesion=1e12, tensile_strength=1e12),),
        loads=Loads(block_motions=(up,)),
        dda=DdaSettings(time_step=1.0, normal_penalty=1e13, shear_penalty=1e13),
        growth=GrowthSettings(increment=increment),
        run=RunSettings(end_time=1e4, stop_at=("daylighting", "split"), stepping="events", control=control),
        load_edge="load:top",
    )


def k_alone(blocks, cracks):
    """K_I over the tension on the ends, √m, of the crack solver alone."""
    (x0, y0), (x1, y1) = blocks.loops(0)[0].min(axis=0), blocks.loops(0)[0].max(axis=0)
    ends = np.array([[[x1, y1], [x0, y1]], [[x0, y0], [x1, y0]]])
    pull = np.array([[[0.0, 1.0]] * 2, [[0.0, -1.0]] * 2])
    return ddm.Body(blocks.loops(0), cracks, ROCK).solve(ddm.BodyLoad(segments=ends, tractions=pull)).tips["k_i"].max()


def grown(problem):
    """Half-length m, tension Pa and displacement m of the platen in every cycle in which the crack grew, and the load
    step."""
    rows = []
    for cycle in cycles(problem):
        if len(cycle.tips) and cycle.tips["grown"].any():
            rows.append((0.5 * cycle.cracks.lengths.sum(), -cycle.load, RATE * cycle.state.time, cycle.load_step))
    return np.array(rows).T


def released(tension, displacement):
    """Energy, J/m, that the plate has given up between one increment and the next: the triangle between the two lines
    from no load to (displacement, load) of a plate that is linear between them."""
    force = 2 * W * tension
    return 0.5 * (force[:-1] * displacement[1:] - force[1:] * displacement[:-1])


@pytest.mark.other_machines
def test_the_load_that_follows_a_crack_across_a_tall_plate():
    """At every increment σ = K_Ic/(F √(πa)), with F by boundary collocation; elements of order 4 keep 2e-5 of K. The
    load falls all the way, and the platen goes back: under a displacement that only rises the crack would run
    through."""
    length, tension, displacement, _ = grown(pulled(3 * W, 0.1 * W, 0.2 * W, "toughness"))
    ratio, factor = np.array(list(CENTRE_CRACK_PLATE[3.0].items())).T
    expected = ROCK.k_ic / (factor * np.sqrt(np.pi * ratio * W))
    assert length[: len(ratio)] == pytest.approx(ratio * W)
    assert tension[: len(ratio)] == pytest.approx(expected, rel=5e-5)
    assert (np.diff(tension) < 0).all() and (np.diff(displacement[ratio < 0.8]) < 0).all()


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("increment", [2e-3, 1e-3])
def test_a_load_that_follows_the_crack_releases_its_fracture_energy(increment):
    """A short plate: the displacement falls (snap-back), then rises. Work less stored energy is K_Ic²/E' a metre of
    crack at each of two tips, of second order in the increment (0.86 % and 0.21 % are found); K is that of the crack
    solver alone."""
    problem = pulled(0.02, 8e-3, increment, "toughness")
    length, tension, displacement, _ = grown(problem)
    early = length < 24e-3
    energy = 2 * ROCK.k_ic**2 / ROCK.plane_modulus * np.diff(length[early])
    off = np.abs(released(tension[early], displacement[early]) / energy - 1).max()
    assert off < 0.01 * (increment / 2e-3) ** 2
    fall = np.diff(displacement[early])
    assert (fall[:2] < 0).all() and (fall[-3:] > 0).all()
    for a, sigma in list(zip(length, tension))[:: len(length) // 3]:
        straight = Cracks.from_polylines([np.array([[-a, 0.0], [a, 0.0]])])
        assert sigma * k_alone(problem.blocks, straight) == pytest.approx(ROCK.k_ic, rel=1e-5)


def test_a_platen_that_is_moved_makes_the_crack_run_stop_and_go_on():
    """The same plate under a displacement that only rises. The crack runs at one displacement, past where a load that
    follows it would have come back to that displacement, and stops; from then on it grows a step at a time, at the same
    loads and displacements as under the load that follows it."""
    increment = 2e-3
    follow = grown(pulled(0.02, 8e-3, increment, "toughness"))
    length, tension, displacement, step = grown(pulled(0.02, 8e-3, increment, "load"))
    burst = step == step[0]
    assert np.ptp(displacement[burst]) == 0 and tension[burst][0] == pytest.approx(follow[1][0], rel=1e-6)
    # It stops at the first length that needs more displacement than it has: from there on its energy release is too
    # small.
    first_stable = np.flatnonzero((follow[2] > follow[2][0]) & (follow[0] > follow[0][0]))[0]
    stopped = length[~burst][0]
    assert stopped == pytest.approx(follow[0][first_stable], abs=1e-9)
    stable = (~burst) & (length < 27e-3)
    assert stable.sum() > 3 and (np.diff(tension[stable]) < 0).all() and (np.diff(displacement[stable]) > 0).all()
    same = np.searchsorted(follow[0], length[stable] - 1e-9)
    assert tension[stable] == pytest.approx(follow[1][same], rel=2e-5)
    assert displacement[stable] == pytest.approx(follow[2][same], rel=2e-5)


def test_the_coupled_run_grows_cracks_as_the_crack_solver_alone():
    """Two cracks under compression, load and path of `ddm.propagate` with control "toughness": four increments, the
    load going up and down. Loads agree to what the search leaves (1e-6), paths to what that moves them by."""
    w, h = 0.03, 0.06
    ends = (("load:top", -0.2e6), ("load:bottom", 0.2e6))
    growth = GrowthSettings(increment=2e-3)
    problem = Problem(
        title="specimen",
        blocks=Blocks.from_polygons([rectangle(-w, -h, w, h)], edge_names=[[["load:bottom", "", "load:top", ""]]]),
        cracks=Cracks.from_polylines(list(crack_ends(0.0)), aperture=np.inf),
        materials=(ROCK,),
        joints=(),
        loads=Loads(edge_tractions=tuple(EdgeTraction(name, History.ramp([0.0, rate])) for name, rate in ends)),
        growth=growth,
        run=RunSettings(end_time=1e4, stop_at=(), stepping="events", control="toughness"),
        load_edge="load:top",
    )
    found = []
    for cycle in cycles(problem):
        if len(cycle.tips) and cycle.tips["grown"].any():
            found.append(cycle)
        if len(found) == 4:
            break
    top, bottom = np.array([[w, h], [-w, h]]), np.array([[-w, -h], [w, -h]])
    press = np.array([[[0.0, -1.0]] * 2, [[0.0, 1.0]] * 2])
    load = ddm.BodyLoad(segments=np.array([top, bottom]), tractions=press)
    alone = list(
        ddm.propagate(problem.blocks.loops(0), problem.cracks, ROCK, load, growth, control="toughness", max_steps=4)
    )
    loads = np.array([[cycle.load, step.load_factor] for cycle, step in zip(found, alone, strict=True)])
    assert (np.diff(loads[:, 0]) < 0).any() and (np.diff(loads[:, 0]) > 0).any()
    assert loads[:, 0] == pytest.approx(loads[:, 1], rel=2e-6)
    np.testing.assert_allclose(found[-1].cracks.nodes, alone[-1].cracks.nodes, atol=1e-6 * growth.increment)
