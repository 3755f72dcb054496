"""Problems that distinct element codes publish as their verification, with blocks that bend: waves through an elastic and
through a slipping joint, cyclic shear, and a tunnel that a joint crosses."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scenes_of_bending import after, rectangle, system_of
from scenes_of_cells import cells_of, columns_and_rows, glued, stress_in
from scenes_of_cells import system as system_with
from test_excavation_of_higher_order import ACROSS, ALONG, INNER, OUTER, ROCK, annulus, disc, pressed

from geomech import dda
from geomech.dda.energy_balance import EnergyBudget
from geomech.model import (
    SLIP,
    BlockMotion,
    Blocks,
    EdgeTraction,
    Excavation,
    History,
    InSituStress,
    JointLaw,
    Loads,
    Material,
    PointMotion,
    State,
    ViscousBoundary,
)

DENSITY = 2500.0
MOVING = {"dynamic_factor": 1.0, "newmark": (0.25, 0.5), "damping": 0.0, "max_displacement_ratio": 1.0}


def crossed_bar(length: float, cells: int, order: int, joint: JointLaw, rock: Material, dt: float) -> dda.BlockSystem:
    """A bar 1 m high of glued ``cells``, its ends "left" and "right", with a ``joint`` across its middle."""
    system = cells_of(
        columns_and_rows(np.linspace(0, length, cells + 1), np.linspace(0, 1, 2)), order, rock=rock, **MOVING,
        time_step=dt,
    )  # fmt: skip
    blocks = system.blocks
    middle = 0.5 * (blocks.vertices + blocks.vertices[blocks.next_vertex])
    names = np.where(middle[:, 0] < 1e-9, 1, np.where(middle[:, 0] > length - 1e-9, 2, 0))
    glued = np.asarray(blocks.glued)
    blocks = replace(
        blocks, glued=glued[np.abs(middle[glued[:, 0], 0] - 0.5 * length) > 1e-9], edge_name=names,
        edge_names=("", "left", "right"),
    )  # fmt: skip
    return dda.BlockSystem(blocks, system.materials, [joint], settings=system.settings)


def centres(system: dda.BlockSystem) -> np.ndarray:
    return np.array([system.blocks.area_moments(b)[1] for b in range(system.blocks.n_blocks)])


@pytest.mark.parametrize(
    "ratio", [pytest.param(0.5, marks=pytest.mark.slow), 1.0, pytest.param(2.0, marks=pytest.mark.slow)]
)
def test_an_elastic_joint_passes_part_of_a_harmonic_wave(verified, ratio):
    """A joint of stiffness k passes 1/√(1 + (ω z/2k)²) of the amplitude, z = ρ c (Schoenberg 1980; Pyrak-Nolte, Myer &
    Cook 1990, J. Geophys. Res. 95, 8617-8638). A bar of 60 m, 20 m to half a wave, twelve cells of order 2."""
    rock, speed, frequency, length, cells = Material("rock", 1e10, 0.0, DENSITY, plane="stress"), 2000.0, 50.0, 60.0, 12
    omega = 2 * math.pi * frequency
    stiffness = omega * DENSITY * speed / (2 * ratio)
    joint = JointLaw(
        "joint", 0.5, cohesion=1e12, tensile_strength=1e12, normal_stiffness=stiffness, shear_stiffness=stiffness
    )
    system = crossed_bar(length, cells, 2, joint, rock, 2.5e-4)
    t = np.linspace(0, 0.2, 4001)
    grows = 0.5 - 0.5 * np.cos(np.pi * np.clip(0.5 * t * frequency, 0, 1))
    wave = History(t, np.stack([1e-3 * grows * np.sin(omega * t), 0 * t], axis=1))
    loads = Loads(viscous_boundaries=(ViscousBoundary("left", wave), ViscousBoundary("right")))
    state, times, speeds = State.at_rest(system.blocks), [], []
    while state.time < 0.13:
        state = system.step(state, loads).state
        times.append(state.time)
        speeds.append(1e3 * state.velocity[-1, 0])
    late = np.array(times) > 0.13 - 2 / frequency
    phase = omega * np.array(times)[late]
    amplitude = np.linalg.lstsq(np.stack([np.sin(phase), np.cos(phase)], axis=1), np.array(speeds)[late], rcond=None)[0]
    # A cell moves by the mean of the wave over its length.
    found = float(np.hypot(*amplitude) / np.sinc(length / cells * frequency / speed))
    exact = 1 / math.hypot(1.0, ratio)
    print(f"ω z/2k = {ratio}: passes {found:.5f}, should be {exact:.5f}")
    verified(
        f"wave through an elastic joint, ω z/2k = {ratio:g}: amplitude passed, cells of order 2",
        None,
        "Pyrak-Nolte et al. 1990",
        found=found,
        exact=exact,
    )
    assert found == pytest.approx(exact, rel=1e-3)


def slipping(strength: float, length: float, cells: int, order: int, dt: float, frequency: float = 40.0):
    """Energies over a period, in units of the incident wave's: (passed, sent back) by a joint whose ``strength`` is given
    in units of the stress of a harmonic shear wave; computed and exact; and the budget.

    The joint bears the stress of the wave as far as its strength, and slips by the rest: it passes the sine clipped at
    ±strength, and sends the rest back (Miller 1978, Bull. Seismol. Soc. Am. 68, 1273-1290).
    """
    rock = Material("rock", 1e10, 0.25, DENSITY)
    speed = math.sqrt(rock.youngs_modulus / 2.5 / DENSITY)
    omega, amplitude, pressure = 2 * math.pi * frequency, 1e6, 4e6
    shaken = amplitude / (DENSITY * speed)
    system = crossed_bar(
        length, cells, order, JointLaw("joint", math.atan(strength * amplitude / pressure)), rock, dt
    )  # fmt: skip
    at = centres(system)[:, 0]
    size, end = length / cells, 1.5 * length / speed + 2 / frequency
    t = np.linspace(0, end, 4001)
    wave = History(t, np.stack([0 * t, shaken * np.sin(omega * t)], axis=1))
    press = tuple(
        EdgeTraction(name, History.constant((p, 0.0))) for name, p in (("left", pressure), ("right", -pressure))
    )
    rest = dda.in_situ_state(
        system, InSituStress(np.array([-pressure, 0.0, 0.0])), Loads(edge_tractions=press)
    )  # fmt: skip
    # Top and bottom do not move along the bar from there: the plane strain of a shear wave that runs along it. On as many
    # points as a polynomial has freedoms there.
    held = []
    for cell, x in enumerate(at.tolist()):
        own = system.blocks.vertex_block == cell
        moved = History.constant((float((rest.state.vertices - system.blocks.vertices)[own, 0].mean()),))
        held += [
            PointMotion(cell, (x + 0.5 * size * g, y), moved, direction=(1.0, 0.0))
            for y, number in ((0.0, order), (1.0, order + 1))
            for g in np.polynomial.legendre.leggauss(number)[0].tolist()
        ]
    loads = Loads(
        edge_tractions=press, point_motions=tuple(held),
        viscous_boundaries=(ViscousBoundary("left", wave), ViscousBoundary("right")),
    )  # fmt: skip
    behind, before = int(0.75 * cells), int(0.25 * cells)
    state, budget, rows = rest.state, EnergyBudget(), []
    while state.time < end:
        result = system.step(state, loads)
        state, budget = result.state, budget.after(result.energy, result.state.time)
        rows.append((state.time, *(state.velocity[[behind, before], 1] / shaken)))
    times, passed, met = np.array(rows).T

    def incident(t):
        return np.where(t > 0, np.sin(omega * t), 0.0)

    def clipped(t):
        return np.clip(incident(t), -strength, strength)

    def of_cell(wave, x):
        """Mean of ``wave`` (time it began to run, x) over the cell at ``x``."""
        points, weights = np.polynomial.legendre.leggauss(5)
        return sum(0.5 * w * wave(x + 0.5 * size * p) for p, w in zip(points, weights, strict=True))

    come = of_cell(lambda x: incident(times - x / speed), at[before])
    back = of_cell(lambda x: (lambda s: incident(s) - clipped(s))(times - (length - x) / speed), at[before])
    through = of_cell(lambda x: clipped(times - x / speed), at[behind])

    def energy(of, from_):
        period = (times > from_) & (times <= from_ + 1 / frequency)
        return float(np.trapezoid(of[period] ** 2, times[period]) * 2 * frequency)

    first = at[behind] / speed + 0.5 / frequency
    later = (length - at[before]) / speed + 0.5 / frequency
    return (
        (energy(passed, first), energy(met - come, later)), (energy(through, first), energy(back, later)), budget,
    )  # fmt: skip


def check_slip(state_figure, strength, found, exact, order, share):
    print(
        f"strength {strength}: passed {found[0]:.4f}, should be {exact[0]:.4f}; sent back {found[1]:.4f}, should be "
        f"{exact[1]:.4f}"
    )
    state_figure(
        f"shear wave through a joint that slips at {strength:g} of its stress: energy passed, cells of order {order}",
        found[0] - exact[0],
        "Miller 1978",
    )
    assert found[0] == pytest.approx(exact[0], abs=share)
    assert found[1] == pytest.approx(exact[1], abs=share)


@pytest.mark.slow
def test_a_slipping_joint_passes_a_clipped_shear_wave(verified):
    found, exact, budget = slipping(0.5, 40.0, 20, 2, 4e-4)
    check_slip(verified, 0.5, found, exact, 2, 0.01)
    assert abs(budget.residual) < 1e-4 * budget.turnover
    # Friction takes what is neither passed nor sent back.
    assert budget.friction > 0.3 * (1 - exact[0] - exact[1]) * budget.turnover


@pytest.mark.slow
@pytest.mark.parametrize("strength", [0.1, 0.5, 0.8, 2.0])
def test_strengths_from_a_tenth_of_the_wave_to_twice_as_much(verified, strength):
    found, exact, budget = slipping(strength, 60.0, 16, 3, 1e-4)
    check_slip(verified, strength, found, exact, 3, 0.003)
    assert abs(budget.residual) < 1e-5 * budget.turnover


@pytest.mark.parametrize("order", [2, 3])
def test_cyclic_shear_of_a_joint_is_a_parallelogram(order):
    """A block pressed on a joint and moved to and fro: τ rises by the joint's stiffness, stays at σ tan φ, and a cycle
    takes the area of the loop."""
    press, stiff, friction, reach = 1e6, 1e10, math.radians(30), 3e-4
    law = JointLaw("joint", friction, normal_stiffness=stiff, shear_stiffness=stiff)
    # Stiff rock: what moves is the joint.
    system = system_of(
        [rectangle(-1, -1, 2, 0), rectangle(0, 0, 1, 0.5)], [1, 0], [1, order], joint=law, loaded=(1, 2),
        rock=Material("rock", 1e13, 0.25, DENSITY),
    )  # fmt: skip
    way = np.concatenate([np.linspace(0, 1, 11)[1:], np.linspace(1, -1, 21)[1:], np.linspace(-1, 1, 21)[1:]]) * reach
    times = 10.0 * np.arange(len(way) + 1)
    motion = BlockMotion(1, History(times, np.stack([np.concatenate([[0.0], way]), 0.0 * times], axis=1)), ("u0", "r0"))
    top = EdgeTraction("loaded", History.constant((0.0, -press)))
    loads = Loads(edge_tractions=(top,), block_motions=(motion,))
    pressed_down = after(system, Loads(edge_tractions=(top,)), 1).state
    state, shear, lost = replace(pressed_down, time=0.0), [], []
    for _ in way:
        result = system.step(state, loads)
        state = result.state
        shear.append(result.contacts["shear_force"].sum())
        lost.append(result.energy.friction)
    strength, expected, elastic = press * math.tan(friction), [], 0.0
    for step in np.diff(np.concatenate([[0.0], way])):
        elastic = float(np.clip(elastic + stiff * step, -strength, strength))
        expected.append(elastic)
    assert np.abs(np.abs(shear) - np.abs(expected)).max() < 2e-3 * strength
    assert np.abs(shear).max() == pytest.approx(strength, rel=1e-6)
    loop = 2 * strength * (2 * reach - 2 * strength / stiff)
    assert sum(lost[10:50]) == pytest.approx(loop, rel=2e-3)


def tunnel(friction: float, angle_deg: float, from_wall: bool = False, order: int = 2, sectors: int = 32):
    """A tunnel excavated where a joint runs through its middle at ``angle_deg``, or, ``from_wall``, begins at its walls: rms
    error of stress against rock without a joint, over the largest stress, and the distances, m, of points of the joint
    that have slipped."""
    system, tractions = pressed(disc(sectors, order))
    blocks = system.blocks
    middle = 0.5 * (blocks.vertices + blocks.vertices[blocks.next_vertex])
    glued = np.asarray(blocks.glued)
    at = middle[glued[:, 0]]
    ends = blocks.vertices[glued[:, 0]]
    way = np.array([math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))])
    off = np.abs(at @ [-way[1], way[0]]) + np.abs(ends @ [-way[1], way[0]])
    joint = (off < 1e-9) & (np.hypot(*at.T) > INNER * from_wall)
    assert joint.sum() == 2 * (9 if from_wall else 10)
    system = system_with(
        replace(blocks, glued=glued[~joint]), JointLaw("joint", friction), ROCK
    )  # fmt: skip
    # Pressed unequally, a disc that nothing holds turns, and so do its halves on a joint without friction, each about the
    # point that holds it: the upper one is held at both ends of the joint, where what is excavated moves nothing up or down.
    centre, still = centres(system), History.constant((0.0,))
    top, bottom = centre[:, 1].argmax(), centre[:, 1].argmin()
    points = [(top, (0.0, 16.0), (1.0, 0.0)), (bottom, (0.0, -16.0), (1.0, 0.0))]
    if angle_deg == 0.0:
        above = np.where(centre[:, 1] > 0, centre[:, 0], 0.0)
        points += [(above.argmax(), (16.0, 0.0), (0.0, 1.0)), (above.argmin(), (-16.0, 0.0), (0.0, 1.0))]
    else:
        points.append((top, (0.0, 16.0), (0.0, 1.0)))
    held = tuple(PointMotion(int(block), at, still, direction=direction) for block, at, direction in points)
    outside = Loads(edge_tractions=tractions, point_motions=held)
    rest = dda.in_situ_state(system, InSituStress(np.array([-ALONG, -ACROSS, 0.0])), outside)
    turn = np.linspace(0, 2 * math.pi, 60, endpoint=False)
    polygon = 1.01 * INNER * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    loads = replace(outside, excavations=(Excavation(15.0, polygon=polygon),))
    state, slid = rest.state, []
    for _ in range(4):
        result = system.step(state, loads)
        state, rows = result.state, result.contacts
        slid.append(np.hypot(*rows["point"][rows["state"] == SLIP].T))
    near = np.flatnonzero(~state.removed & (np.hypot(*centre.T) < 3.0))
    error = np.abs(stress_in(system, state, near, centre[near]) - annulus(centre[near])[0]).max(axis=1)
    return float(np.sqrt((error**2).mean())) / (3 * ACROSS - ALONG), np.concatenate(slid)


@pytest.mark.parametrize(
    "from_wall", [pytest.param(False, marks=pytest.mark.slow), pytest.param(True, marks=pytest.mark.slow)]
)
def test_a_joint_along_a_principal_stress_changes_nothing_about_a_tunnel(from_wall):
    """Through the middle of the tunnel a plane of weakness along a principal stress bears no shear: Kirsch's stress, even
    without friction (Brady & Brown 2004, Rock Mechanics for Underground Mining, sec. 7.5)."""
    error, _ = tunnel(0.0, 0.0, from_wall)
    print(f"error of stress {error:.2e}")
    assert error < 0.01


@pytest.mark.parametrize(("tangent", "slips"), [pytest.param(0.38, False, marks=pytest.mark.slow), (0.345, True)])
def test_a_joint_slips_about_a_tunnel_where_kirsch_says(tangent, slips):
    """On a radius at 45° between the principal stresses shear over pressure is (d/m)(1 − s)(1 + 3s)/(1 + s), s = a²/r²,
    with the half difference d and the mean m of the stresses: 1.072 d/m at most, where r = 2.54 a, and d/m far away.
    """
    ratio = (ACROSS - ALONG) / (ACROSS + ALONG)
    s = np.linspace(0, 1, 4001)[1:]
    mobilised = ratio * (1 - s) * (1 + 3 * s) / (1 + s)
    assert mobilised.max() == pytest.approx(1.0718 * ratio, rel=1e-4)
    error, slid = tunnel(math.atan(tangent), 45.0)
    print(f"tan φ {tangent}: error of stress {error:.2e}, slips at {np.unique(slid.round(2))}")
    assert (mobilised.max() > tangent) == slips
    assert bool(len(slid)) == slips
    assert error < 0.01
    if slips:
        inside = INNER / np.sqrt(s[mobilised > tangent])
        assert inside.min() < 2.54 < inside.max() < OUTER
        # Slip reaches the end of the cells' faces in which it begins, and no farther.
        assert inside.min() - 0.7 < slid.min() and slid.max() < inside.max() + 2.0


def test_a_joint_in_continuous_rock_slips_under_load(verified):
    """A joint of half length 1 m in a plate twenty times as long bears τ beyond its friction: the slip of a crack under the
    shear τ − σ tan φ, 4 (1 − ν²) (τ − σ tan φ) √(a² − x²) / E (Pollard & Segall 1987). Its ends are singular."""
    reach, friction, press, shear, errors = 10.0, 0.3, 2e6, 1.5e6, []
    under = np.array([0.0, 0.5, 0.85, 0.955, 1.0])
    ahead = np.concatenate([2 - under[-2::-1], 2 + np.array([1.0, 2.8, 8.0])])
    across = np.array([0.0, 0.045, 0.13, 0.28, 0.55, 1.0, 1.9, 3.5, 6.0, reach])
    x, y = (np.concatenate([-half[:0:-1], half]) for half in (np.concatenate([under, ahead]), across))
    cells = columns_and_rows(x, y)
    ends = {"right": (0, 1), "left": (0, -1), "top": (1, 1), "bottom": (1, -1)}

    def name(at: np.ndarray) -> str:
        return next((side for side, (axis, sign) in ends.items() if abs(at[axis] - sign * reach) < 1e-9), "")

    names = [[[name(at) for at in 0.5 * (cell + np.roll(cell, -1, axis=0))]] for cell in cells]
    exact = 4 * (1 - ROCK.poissons_ratio**2) * (shear - friction * press) / ROCK.youngs_modulus
    for order in (2, 4):
        blocks = glued(Blocks.from_polygons(cells, order=[order] * len(cells), edge_names=names))
        pairs = np.asarray(blocks.glued)
        middle = 0.5 * (blocks.vertices[pairs[:, 0]] + blocks.vertices[blocks.next_vertex[pairs[:, 0]]])
        joint = (np.abs(middle[:, 1]) < 1e-9) & (np.abs(middle[:, 0]) < 1)
        law = JointLaw("joint", math.atan(friction), normal_stiffness=1e14, shear_stiffness=1e14)
        system = system_with(replace(blocks, glued=pairs[~joint]), law, ROCK)
        stress = np.array([[0.0, shear], [shear, -press]])
        loads = Loads(
            edge_tractions=tuple(
                EdgeTraction(side, History.constant(tuple(sign * stress[axis]))) for side, (axis, sign) in ends.items()
            )
        )
        rows = after(system, loads, 2).state.face_points
        at, slip = rows["point"], np.abs(rows["slip"])
        on = (np.abs(at[:, 1]) < 1e-3) & (np.abs(at[:, 0]) < 0.8)
        errors.append(float(np.abs(slip[on] / (exact * np.sqrt(1 - at[on, 0] ** 2)) - 1).max()))
    print(f"slip within 0.8 half lengths off by {errors}")
    verified(
        "joint in a plate that slips under load, cells: slip", errors, "Pollard & Segall 1987", over=("order", (2, 4))
    )
    assert errors[0] < 0.06 and errors[1] < 0.01
