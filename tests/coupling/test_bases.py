"""Cracked blocks on rigid bases: what the coupled run finds is what the crack solver finds with the base held."""

from dataclasses import replace

import numpy as np
import pytest

from geomech import ddm
from geomech.coupling import cycles
from geomech.coupling.coupled_state import CrackedBlocks
from geomech.coupling.load_pass import balanced
from geomech.model import (
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

ROCK = Material("rock", 20e9, 0.25, 2500.0, 1e12)
STRIP = 1e6


def slab(wide: float, route: str, shift: float = 0.0, friction: float = 0.0, way=(0.0, -STRIP)) -> Problem:
    """A block as deep as 1 m on a fixed one, pressed over a quarter of its top, ``shift`` m off its middle; a slot
    stands above its base."""
    half = 0.125 * wide
    slab = [[-wide / 2, 0], [wide / 2, 0], [wide / 2, 1], [shift + half, 1], [shift - half, 1], [-wide / 2, 1]]
    base = [[-wide, -1], [wide, -1], [wide, 0], [-wide, 0]]
    names = [[["", "", "", "load", "", ""]], [["", "", "", ""]]]
    return Problem(
        title="slab",
        blocks=Blocks.from_polygons([np.array(slab), np.array(base)], edge_names=names, fixed=[False, True]),
        cracks=Cracks.from_polylines([np.array([[0.0, 0.15], [0.0, 0.35]])], aperture=np.inf),
        materials=(ROCK,),
        joints=(JointLaw("base", friction_angle=np.arctan(friction)),),
        loads=Loads(edge_tractions=(EdgeTraction("load", History.constant(list(way))),)),
        dda=DdaSettings(time_step=1.0),
        growth=GrowthSettings(increment=1e-2, min_increment=1e-3),
        run=RunSettings(end_time=1.0, boundary_stress=route),
        load_edge="load",
    )


def last(problem: Problem):
    *_, cycle = cycles(problem)
    return cycle.bodies[0], cycle.tips


def base_pressure(solution) -> tuple[np.ndarray, np.ndarray]:
    """Ends (n, 2) along the base and pressure (n, 2) there of what loads the slab from below."""
    load = solution.load
    below = (load.segments[..., 1] == 0).all(axis=1)
    return load.segments[below][..., 0], load.tractions[below][..., 1]


def resultants(x: np.ndarray, p: np.ndarray) -> tuple[float, float]:
    """Force and moment about x = 0."""
    length = np.diff(x, axis=1)[:, 0]
    force = 0.5 * length * p.sum(axis=1)
    first = length * (p[:, 0] * (2 * x[:, 0] + x[:, 1]) + p[:, 1] * (x[:, 0] + 2 * x[:, 1])) / 6
    return float(force.sum()), float(first.sum())


def alone(wide: float, on=0) -> ddm.Solution:
    """The crack solver with the base, or a piece of it, held across: a smooth rigid base that pulls, too."""
    problem = slab(wide, "bases")
    body = ddm.Body([problem.blocks.loops(0)[0]], problem.cracks, ROCK, supports=[ddm.Support(on, hold="normal")])
    return body.solve(ddm.BodyLoad(sides={3: (0.0, -STRIP)}))


@pytest.mark.parametrize("wide", [1.0, 2.0])
def test_blocks_press_on_their_base_as_the_crack_solver_has_it(wide):
    """Where a base that is held neither pulls nor lets go (twice as wide as deep it would pull by 2 % at its ends): K
    to 6e-4 and 1e-4. A linear pressure leaves K 2 and 106 % off."""
    expected = alone(wide).tips["k_i"]
    solution, tips = last(slab(wide, "bases"))
    assert tips["k_i"] == pytest.approx(expected, rel=1e-3)
    # Unless told otherwise, sides that are longer than the block is deep have it.
    by_default = last(slab(wide, RunSettings().boundary_stress))[1]["k_i"].max() / expected.max()
    assert (abs(by_default - 1) < 1e-3) == (wide > 1)
    assert base_pressure(solution)[1].min() >= 0
    linear = last(slab(wide, "contacts"))[1]["k_i"].max() / expected.max()
    assert abs(linear - 1) > 0.02


def test_blocks_in_motion_have_linear_pressure():
    """Unless told otherwise: they land on corners and edges."""
    problem = slab(2.0, "auto")
    moving = replace(problem.dda, dynamic_factor=1.0, time_step=1e-4)
    problem = replace(problem, dda=moving, run=replace(problem.run, end_time=2e-4))
    linear = replace(problem, run=replace(problem.run, boundary_stress="contacts"))
    assert last(problem)[1]["k_i"].tolist() == last(linear)[1]["k_i"].tolist()


@pytest.mark.parametrize(("wide", "part"), [(3.0, (0.92, 0.93, 0.94)), (5.0, (1.06, 1.08, 1.10))])
def test_blocks_that_lift_off_their_base_have_the_pressure_of_the_part_that_presses(wide, part):
    """K as with the right part of the base held, of which K is stationary; a parabola through three parts gives it. To 1e-3; a
    linear pressure leaves it too large by a factor of 4 and more."""
    held = [alone(wide, ((-half, 0.0), (half, 0.0))).tips["k_i"].max() for half in part]
    fitted = np.polynomial.Polynomial.fit(part, held, 2)
    (stationary,) = fitted.deriv().roots()
    assert last(slab(wide, "bases"))[1]["k_i"].max() == pytest.approx(fitted(stationary), rel=1e-3)


def test_soft_joints_spread_the_pressure():
    """A joint between block and base that closes by more than the block deforms leaves the pressure linear; one that closes by
    less than a hundredth of it is no joint."""
    k = {}
    for stiffness in (1e6, 2e10, 1e14):
        problem = slab(2.0, "bases")
        joint = JointLaw("base", friction_angle=0.0, normal_stiffness=stiffness)
        k[stiffness] = last(replace(problem, joints=(joint,)))[1]["k_i"].max()
    linear, rigid = (last(slab(2.0, route))[1]["k_i"].max() for route in ("contacts", "bases"))
    assert k[1e6] == pytest.approx(linear, rel=1e-3) and k[1e14] == pytest.approx(rigid, rel=1e-3)
    assert 1.1 * rigid < k[2e10] < 0.9 * linear


def test_wide_blocks_lift_off_their_base_at_its_ends():
    """Three times as wide as deep, the slab stands on 62 % of its base: on a longer piece, held, the reaction at the
    end pulls, on a shorter one it presses, singular like r^(−½), and K of that piece is the one that is found (2e-3;
    with all of the base held K is 13 % less)."""
    ends = []
    for half in (0.90, 0.95):
        reactions = alone(3.0, ((-half, 0.0), (half, 0.0))).reactions
        ends.append(reactions.traction[..., 1].ravel()[reactions.points[..., 0].argmin()])
    assert ends[0] > 0 > ends[1]
    solution, tips = last(slab(3.0, "bases"))
    assert tips["k_i"] == pytest.approx(alone(3.0, ((-0.93, 0.0), (0.93, 0.0))).tips["k_i"], rel=2e-3)
    x, p = base_pressure(solution)
    # The last piece that presses ends there, to half the length of a piece.
    assert np.abs(x[p.max(axis=1) > 0]).max() == pytest.approx(0.93, abs=0.045)


def test_pressure_below_wide_blocks_is_resolved(caplog):
    """A load off the middle of a slab 4.2 times as wide as deep, which stands on a part of its base: K to 1 % of that with 64
    pieces of pressure; 24 on any face left 7 %. An area of contact that is not found is a warning."""
    tips = last(slab(4.2, "bases", 0.63))[1]
    assert tips["k_i"] == pytest.approx([41908, 27187], rel=0.01)
    assert "contact area" not in caplog.text


@pytest.mark.parametrize(("shift", "friction", "way"), [(0.0, 0, (0, -1)), (0.5, 0, (0, -1)), (0.9, 0.6, (0.3, -1))])
def test_nothing_pulls_and_force_and_moment_are_those_of_the_contacts(shift, friction, way):
    """To round-off, as a linear pressure has them, and with the load in balance; shear goes with the pressure."""
    loads = [
        balanced(CrackedBlocks(slab(3.0, route, shift, friction, np.multiply(way, STRIP))), 1.0, None)
        for route in ("bases", "contacts")
    ]
    (x, p), (x_linear, p_linear) = (base_pressure(found.solutions[0]) for found in loads)
    assert p.min() >= 0 and (p == 0).sum() > 4
    assert resultants(x, p) == pytest.approx(resultants(x_linear, p_linear), rel=1e-6, abs=1e-6 * STRIP)
    assert loads[0].statistics["traction_imbalance"] < 1e-12


def test_cracks_of_which_the_faces_close_are_told_to_the_base():
    """A closed slanted crack beside the slot: what presses changes what closes. K as with the base held, and the face
    stays straight where it presses and is above that elsewhere."""
    problem = slab(2.0, "bases")
    lines = [np.array([[0.0, 0.15], [0.0, 0.35]]), np.array([[0.2, 0.5], [0.4, 0.8]])]
    problem = replace(problem, cracks=Cracks.from_polylines(lines, aperture=[np.inf, 0.0]))
    solution, tips = last(problem)
    body = ddm.Body([problem.blocks.loops(0)[0]], problem.cracks, ROCK, supports=[ddm.Support(0, hold="normal")])
    held = body.solve(ddm.BodyLoad(sides={3: (0.0, -STRIP)}))
    assert solution.closed.any()
    for name in ("k_i", "k_ii"):
        assert tips[name] == pytest.approx(held.tips[name], rel=2e-3, abs=2e-3 * np.abs(tips["k_ii"]).max())
    x, p = base_pressure(solution)
    inside = x[1:-1].mean(axis=1)
    presses = p[1:-1].min(axis=1) > 0
    sunk = solution.displacement(np.column_stack([inside, np.zeros(len(inside))]))[:, 1]
    above = sunk - np.polynomial.Polynomial.fit(inside[presses], sunk[presses], 1)(inside)
    whole = np.ptp(solution.displacement(problem.blocks.vertices[:6])[:, 1])
    assert np.abs(above[presses]).max() < 3e-4 * whole and above.min() > -3e-4 * whole
