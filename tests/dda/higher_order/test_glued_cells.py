"""Cells of one rock: patch test, observed orders of convergence, membranes and holes, and cells that move."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes_of_bending import after, rectangle, turned
from scenes_of_cells import cells_of, columns_and_rows, meshed, moved_corners, stress_in

from geomech.dda import EnergyBudget
from geomech.dda.higher_order import glued_cells
from geomech.model import EdgeTraction, History, JointLaw, Loads, Material, State

CLAMP = JointLaw("clamp", 0.5, cohesion=1e12, tensile_strength=1e12, normal_stiffness=1e15, shear_stiffness=1e15)
SMOOTH = JointLaw("smooth", 0.0, normal_stiffness=1e13, shear_stiffness=1e13)
MOVING = {"dynamic_factor": 1.0, "newmark": (0.25, 0.5), "damping": 0.0, "max_displacement_ratio": 0.1}
#: Four triangles and four quadrilaterals of unlike size about an inner corner that lies off the middle.
UNLIKE = [
    np.array(p, float)
    for p in (
        [[0, 0], [1.3, 0], [1.1, 0.8]], [[1.3, 0], [3, 0], [1.1, 0.8]], [[3, 0], [3, 1.1], [1.1, 0.8]],
        [[0, 0], [1.1, 0.8], [0, 1.4]], [[1.1, 0.8], [3, 1.1], [3, 2], [1.5, 2]], [[1.1, 0.8], [1.5, 2], [0, 2], [0, 1.4]],
    )
]  # fmt: skip


def loaded(*force: float) -> Loads:
    return Loads(edge_tractions=(EdgeTraction("loaded", History.constant(force)),))


@pytest.mark.parametrize("order", [2, [2, 3, 4, 2, 5, 3], 6])
@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_a_uniform_pressure_passes_through_cells_of_any_shape(order, angle):
    """Cells on a smooth floor, in plane strain with Poisson's ratio, under a uniform load: exact but for the load's strain of
    5e-8, by which faces are longer than they were drawn, some times over."""
    system = cells_of(
        UNLIKE,
        order,
        below=[rectangle(-1, -1, 4, 0)],
        joint=SMOOTH,
        loaded=lambda at: abs(at[1] - 2) < 1e-9,
        angle=angle,
    )
    down = turned(np.array([[0.0, -1e3]]), angle)[0]
    result = after(system, loaded(*down), 3)
    expected = -np.outer(down, down) / 1e3
    stress = result.state.stress[1:]
    assert stress == pytest.approx(np.tile([expected[0, 0], expected[1, 1], expected[0, 1]], (6, 1)), abs=1e-3)
    assert np.abs(result.state.deflection[:, 0]).max() < 1e-12
    assert result.statistics["unbalanced"] < 1e-9


def beam(order: int, columns: int, rows: int, **settings):
    """Cantilever of slenderness 8 of cells, without Poisson's ratio: the stored energy (J/m) under an end load."""
    rock = Material("rock", 2e10, 0.0, 2500.0, plane="stress")
    cells = columns_and_rows(np.linspace(0, 8, columns + 1), np.linspace(0, 1, rows + 1))
    system = cells_of(
        cells, order, below=[rectangle(-1, 0, 0, 1)], joint=CLAMP, rock=rock, loaded=lambda at: abs(at[0] - 8) < 1e-9,
        **settings,
    )  # fmt: skip
    result = after(system, loaded(0.0, -1e5), 2)
    tip = np.abs(system.blocks.vertices[:, 0] - 8) < 1e-9
    return -moved_corners(system, result.state)[tip, 1].mean(), result


def test_a_cantilever_of_cells_converges_with_their_size_and_their_order():
    """Timoshenko's deflection, P (L³/3EI + 1.2 L/GA), which a clamp that holds its section lowers by 1e-5 or so. Deflection is
    an integral, and converges by twice the order: 2 p = 4 for p = 2."""
    exact = 1e5 * (8**3 / (3 * 2e10 / 12) + 1.2 * 8 / 1e10)
    error = {size: abs(beam(2, *size)[0] / exact - 1) for size in ((8, 1), (16, 2), (32, 4))}
    assert error[32, 4] < 1e-4
    assert np.log2(error[8, 1] / error[16, 2]) > 2.8
    assert np.log2(error[16, 2] / error[32, 4]) > 3.4
    orders = [abs(beam(order, 8, 1)[0] / exact - 1) for order in (2, 3, 4)]
    assert orders[1] < 0.1 * orders[0]
    assert orders[2] < 5e-5


def test_a_cantilever_of_voronoi_cells_is_a_beam(verified):
    """Cells of order 2 as `mesh_size_m` makes them, two and four over the depth: below 1 % of Timoshenko's deflection."""
    exact, errors, depths = 1e5 * (8**3 / (3 * 2e10 / 12) + 1.2 * 8 / 1e10), [], (2, 4)
    for rows in depths:
        system = meshed(
            [rectangle(0, 0, 8, 1)], 1 / rows, 2, below=rectangle(-1, 0, 0, 1), names=[["", "loaded", "", ""]],
            shape="voronoi", joint=CLAMP, rock=Material("rock", 2e10, 0.0, 2500.0, plane="stress"),
        )  # fmt: skip
        state = after(system, loaded(0.0, -1e5), 2).state
        tip = np.abs(system.blocks.vertices[:, 0] - 8) < 1e-9
        errors.append(float(-moved_corners(system, state)[tip, 1].mean() / exact - 1))
    verified(
        "cantilever of Voronoi cells of order 2, as meshed: deflection", errors, "Timoshenko's beam",
        over=("cells over the depth", depths),
    )  # fmt: skip
    assert abs(errors[1]) < 5e-4 and abs(errors[1]) < 0.5 * abs(errors[0])


def test_no_stiffness_of_glue_has_to_be_chosen(monkeypatch):
    """From half to five times the penalty, deflection of cells of order 3 changes by less than they are off."""
    tips = []
    for penalty in (1.0, 2.0, 10.0):
        monkeypatch.setattr(glued_cells, "PENALTY", penalty)
        tips.append(beam(3, 8, 1)[0])
    assert np.ptp(tips) < 3e-4 * tips[1]


def test_cooks_membrane_by_cells():
    """Cook, Malkus & Plesha's tapered panel, E = 1, ν = 1/3, plane stress, unit shear force on its right side: 23.96 at the
    middle of that side. Here in GPa and m, and with a load of a millionth of what bends it by half its width."""
    panel = np.array([[0, 0], [48, 44], [48, 60], [0, 44.0]])
    rock = Material("rock", 1e9, 1 / 3, 2500.0, plane="stress")
    found = []
    for size, order in ((22.0, 2), (11.0, 2), (11.0, 3)):
        system = meshed(
            [panel], size, order, below=rectangle(-4, -1, 0, 45), names=[["", "loaded", "", ""]], shape="quads",
            joint=CLAMP, rock=rock,
        )  # fmt: skip
        result = after(system, loaded(0.0, 1e3 / 16), 2)
        moved, at = moved_corners(system, result.state), system.blocks.vertices
        right = np.flatnonzero((np.abs(at[:, 0] - 48) < 1e-9) & (np.abs(at[:, 1] - 52) < 1e-9))
        found.append(float(moved[right, 1].mean()) * 1e9 / 1e3)
    assert found[2] == pytest.approx(23.96, rel=0.01)
    error = np.abs(np.array(found) / 23.96 - 1)
    assert error[0] > error[1] > error[2]


def kirsch(x: np.ndarray, pressure: float) -> np.ndarray:
    """(n, 3) stress about a hole of radius 1 in a plate that is pressed along y (Kirsch 1898)."""
    r, theta = np.hypot(*x.T), np.arctan2(x[:, 1], x[:, 0])
    double, half = np.cos(2 * theta), -0.5 * pressure
    radial = half * (1 - 1 / r**2) - half * (1 - 4 / r**2 + 3 / r**4) * double
    hoop = half * (1 + 1 / r**2) + half * (1 + 3 / r**4) * double
    shear = half * (1 + 2 / r**2 - 3 / r**4) * np.sin(2 * theta)
    c, s = np.cos(theta), np.sin(theta)
    return np.stack(
        [
            radial * c * c + hoop * s * s - 2 * shear * s * c,
            radial * s * s + hoop * c * c + 2 * shear * s * c,
            (radial - hoop) * s * c + shear * (c * c - s * s),
        ],
        axis=1,
    )


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["triangles", "voronoi"])
def test_stress_about_a_circular_hole_is_kirschs(shape):
    """Cells of order 3 in a plate forty radii wide; the hole is a polygon of 64 sides. At the middles of all cells within
    three radii stress is right to 1 % of its largest, which is thrice the load, and to 0.3 % in the mean."""
    turn = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    hole = np.stack([np.cos(turn), np.sin(turn)], axis=1)[::-1]
    plate = [rectangle(-20, -20, 20, 20), hole]
    system = meshed(
        plate, 5.0, 3, below=rectangle(-21, -21, 21, -20), names=[["", "", "loaded", ""], [""] * 64], joint=SMOOTH,
        shape=shape,
    )  # fmt: skip
    state = after(system, loaded(0.0, -1e6), 2).state
    middle = np.array([system.blocks.area_moments(b)[1] for b in range(system.blocks.n_blocks)])
    near = np.flatnonzero(np.hypot(*middle.T) < 3.0)
    error = np.abs(stress_in(system, state, near, middle[near]) - kirsch(middle[near], 1e6)).max(axis=1)
    print(f"{shape}: {len(middle)} cells, {error.max() / 3e6:.4f} at most, {np.sqrt((error**2).mean()) / 3e6:.4f} rms")
    assert error.max() < 0.01 * 3e6
    assert np.sqrt((error**2).mean()) < 0.003 * 3e6


@pytest.mark.parametrize("order", [2, 3])
def test_cells_that_spin_keep_their_energy(order):
    """50 rad/s, four cells: they turn as one, and a turn of 0.8 rad neither adds nor takes energy."""
    cells = columns_and_rows(np.linspace(0, 2, 3), np.linspace(0, 1, 3))
    system = cells_of(cells, order, **MOVING | {"time_step": 4e-4})
    state, budget, velocity = State.at_rest(system.blocks), EnergyBudget(), np.zeros((4, 6))
    arm = np.array([cell.mean(axis=0) for cell in cells]) - [1.0, 0.5]
    velocity[:, 0], velocity[:, 1], velocity[:, 2] = -50 * arm[:, 1], 50 * arm[:, 0], 50.0
    state = replace(state, velocity=velocity)
    for _ in range(40):
        result = system.step(state, Loads())
        state, budget = result.state, budget.after(result.energy, result.state.time)
    assert state.rotation == pytest.approx(np.full(4, 50.0 * state.time), rel=1e-3)
    assert abs(budget.residual) + abs(budget.scheme) < 2e-5 * budget.turnover


def test_a_beam_of_cells_falls_on_the_floor_as_one():
    """What meets the floor is the faces of cells; they hold together, and no energy comes from nowhere."""
    cells = columns_and_rows(np.linspace(0, 4, 5), np.array([0.02, 0.52]))
    system = cells_of(cells, 2, below=[rectangle(-5, -1, 9, 0)], **MOVING | {"damping": 0.2, "time_step": 1e-3})
    state, budget = State.at_rest(system.blocks), EnergyBudget()
    for _ in range(80):
        result = system.step(state, Loads(gravity=History.constant((0.0, -9.81))))
        state, budget = result.state, budget.after(result.energy, result.state.time)
    assert abs(budget.residual) < 1e-5 * budget.turnover
    corners = moved_corners(system, state)
    joined = [
        np.ptp(corners[np.hypot(*(system.blocks.vertices - at).T) < 1e-9], axis=0) for at in ([1, 0.02], [2, 0.52])
    ]
    assert np.max(joined) < 1e-5
    assert 0.2499 < state.vertices[4:, 1].mean() < 0.27


GRAIN = JointLaw("grain", 0.5, cohesion=4e6, tensile_strength=2e6)
THIN = Material("rock", 2e10, 0.0, 2500.0, plane="stress")


def strained_to(system, force: tuple[float, float], steps: int):
    """The last of so many steps of 5 ms, in which inertia holds what comes loose."""
    state = State.at_rest(system.blocks)
    for _ in range(steps):
        result = system.step(state, loaded(*force))
        state = result.state
    return result


@pytest.mark.parametrize(("share", "parts"), [(0.98, False), (1.02, True)])
def test_cells_part_at_the_tension_that_they_bear(share, parts):
    """A bar of two columns of cells on a clamp that holds: its rows part, all at once, between 0.98 and 1.02 of their tensile
    strength; the faces along the bar bear nothing."""
    cells = columns_and_rows(np.linspace(0, 2, 3), np.linspace(0, 3, 4))
    system = cells_of(
        cells, 3, below=[rectangle(-1, -1, 3, 0)], joint=(CLAMP, GRAIN), between="cells", rock=THIN,
        loaded=lambda at: abs(at[1] - 3) < 1e-9, time_step=5e-3,
    )  # fmt: skip
    state = strained_to(system, (0.0, share * 2e6), 3).state
    one, two = system.blocks.vertices[system.blocks.glued[:, 0]], system.blocks.vertices[system.blocks.glued[:, 1]]
    across = np.abs(one[:, 1] - two[:, 1]) < 1e-9
    assert np.array_equal(state.parted, across & parts)


@pytest.mark.parametrize(("share", "parts"), [(0.98, False), (1.02, True)])
def test_voronoi_cells_part_at_the_tension_that_they_bear(share, parts):
    """A bar on a clamp that holds, without Poisson's ratio: the stress is uniform, and the face that looks most along the bar
    parts between 0.98 and 1.02 of its strength."""
    system = meshed(
        [rectangle(0, 0, 2, 3)], 0.5, 2, below=rectangle(-1, -1, 3, 0), names=[["", "", "loaded", ""]], shape="voronoi",
        between="cells", joint=(CLAMP, GRAIN), rock=THIN, time_step=5e-3,
    )  # fmt: skip
    ends = system.blocks.vertices[system.blocks.glued[:, 0]], system.blocks.vertices[system.blocks.glued[:, 1]]
    along = ends[1] - ends[0]
    steepest = float((along[:, 0] ** 2 / (along**2).sum(axis=1)).max())
    state = strained_to(system, (0.0, share * 2e6 / steepest), 3).state
    assert state.parted.any() == parts


@pytest.mark.parametrize(("share", "parts"), [(0.98, False), (1.02, True)])
def test_cells_part_in_shear_and_slide_by_friction(share, parts):
    """A bar that is pressed by P on a smooth floor, its cells divided at 45°: these bear P/2 across and along, and part at P/2 =
    c + P/2 tan φ. What has parted slides, S = N tan φ; a bond does not come back."""
    cells = [
        np.array(p, float)
        for p in ([[0, 0], [1, 0], [1, 2], [0, 1]], [[0, 1], [1, 2], [1, 3], [0, 2]], [[0, 2], [1, 3], [1, 4], [0, 4]])
    ]
    system = cells_of(
        cells, 3, below=[rectangle(-1, -1, 3, 0)], joint=(SMOOTH, GRAIN), between="cells", rock=THIN,
        loaded=lambda at: abs(at[1] - 4) < 1e-9, time_step=1e-2,
    )  # fmt: skip
    # In a fourth step the pieces, which nothing holds, slide off each other.
    result = strained_to(system, (0.0, -share * 2 * 4e6 / (1 - np.tan(0.5))), 3)
    assert (result.state.parted == parts).all()
    between = result.contacts[(result.contacts["other"] > 0) & (result.contacts["normal_force"] > 0)]
    assert (len(between) > 0) == parts
    assert np.abs(between["shear_force"]) == pytest.approx(np.tan(0.5) * between["normal_force"], rel=1e-6)
    assert not between["bonded"].any()


def test_cells_that_have_parted_are_told_by_the_state():
    """Another system goes on from a state in which faces have parted as the first does; a joint without tensile strength
    cannot part cells."""
    cells = columns_and_rows(np.linspace(0, 1, 2), np.linspace(0, 3, 4))

    def built(law: JointLaw):
        return cells_of(
            cells, 2, below=[rectangle(-1, -1, 3, 0)], joint=(CLAMP, law), between="cells", rock=THIN,
            loaded=lambda at: abs(at[1] - 3) < 1e-9, time_step=5e-3,
        )  # fmt: skip

    middle = strained_to(built(GRAIN), (0.0, 2.1e6), 3).state
    assert middle.parted.any()
    one, other = built(GRAIN), built(GRAIN)
    first, second = one.step(middle, loaded(0.0, 2.1e6)).state, other.step(middle, loaded(0.0, 2.1e6)).state
    assert (second.parted >= middle.parted).all()
    assert np.array_equal(first.vertices, second.vertices) and np.array_equal(first.parted, second.parted)
    with pytest.raises(ValueError, match="'grain': it has no tensile strength"):
        built(replace(GRAIN, tensile_strength=0.0))
