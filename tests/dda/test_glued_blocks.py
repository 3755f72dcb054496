"""Hexagons and Voronoi cells glued together are the rock they were cut from: uniform stress, series of rock and joints,
bending, strength. Held against closed forms and bounds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import Voronoi

from geomech import dda
from geomech.model import Blocks, DdaSettings, EdgeTraction, History, JointLaw, Loads, Material, State

MODULUS, POISSON, DENSITY = 10e9, 0.25, 2500.0
#: Of plane strain.
MODULUS_2D, POISSON_2D = MODULUS / (1 - POISSON**2), POISSON / (1 - POISSON)
GLUE = JointLaw("glue", 0.5, 1e12, 1e12)
STRESS = 1e6


def cells_of(points: np.ndarray, width: float, height: float) -> list[np.ndarray]:
    """Voronoi cells of ``points`` (n, 2) in a rectangle, whose mirror images cut them straight at its sides."""
    size = np.array([width, height])
    images = [points, points * [-1, 1], points * [1, -1], [2 * width, 0] + points * [-1, 1]]
    cut = Voronoi(np.concatenate([*images, [0, 2 * height] + points * [1, -1]]))
    cells = []
    for k in range(len(points)):
        cell = cut.vertices[cut.regions[cut.point_region[k]]]
        cell = cell[np.argsort(np.arctan2(*(cell - cell.mean(axis=0)).T[::-1]))]
        cell = cell[np.hypot(*(cell - np.roll(cell, 1, axis=0)).T) > 1e-9]
        side = np.round(cell / size) * size
        cells.append(np.where(np.abs(cell - side) < 1e-9, side, cell))
    return cells


def voronoi(n: int, width: float, height: float, seed: int = 1, even: int = 0) -> list[np.ndarray]:
    """Cells of ``n`` random points, moved to the cells' centroids ``even`` times."""
    points = np.random.default_rng(seed).uniform(0, 1, (n, 2)) * [width, height]
    for _ in range(even):
        points = np.array([Blocks.from_polygons([c]).area_moments(0)[1] for c in cells_of(points, width, height)])
    return cells_of(points, width, height)


def hexagons(width: float, height: float, rows: int) -> list[np.ndarray]:
    """Hexagons with upright sides in ``rows``, cut through at the rectangle's left and right."""
    deep = height / rows
    wide = width / round(width / (deep * 2 / np.sqrt(3)))
    x, y = np.meshgrid((np.arange(round(width / wide)) + 0.5) * wide, (np.arange(rows) + 0.5) * deep)
    x = x + np.where(np.arange(rows) % 2, -0.25, 0.25)[:, None] * wide
    return cells_of(np.column_stack([x.ravel(), y.ravel()]), width, height)


# -- a specimen in tension or compression --------------------------------------------------------------------------------

#: Of regular hexagons, four rows in a height of 2 m.
WIDTH, HEIGHT = np.sqrt(3.0), 2.0


def specimen(cells: list[np.ndarray], glue: JointLaw = GLUE, **settings) -> dda.BlockSystem:
    """``cells`` of a specimen of `WIDTH` × `HEIGHT` on a smooth floor, its sides named; the glue is that between cells."""

    def name(a, b):
        for at, axis, side in ((0.0, 0, "left"), (WIDTH, 0, "right"), (0.0, 1, "bottom"), (HEIGHT, 1, "top")):
            if a[axis] == b[axis] == at:
                return side
        return ""

    names = [[[name(a, b) for a, b in zip(cell, np.roll(cell, -1, axis=0))]] for cell in cells]
    floor = np.array([[-1.0, -1.0], [WIDTH + 1, -1.0], [WIDTH + 1, 0.0], [-1.0, 0.0]])
    return dda.BlockSystem(
        Blocks.from_polygons([floor, *cells], fixed=[True] + [False] * len(cells), edge_names=[[["", "", "floor", ""]], *names]),
        [Material("rock", MODULUS, POISSON, density=DENSITY)], [glue, JointLaw("smooth", 0.0)],
        joint_index=lambda a, b: 1 if "floor" in (a, b) else 0,
        settings=DdaSettings(**{"max_displacement_ratio": 0.1, **settings}),
    )  # fmt: skip


def pressed(system: dda.BlockSystem) -> tuple[np.ndarray, np.ndarray]:
    """Mean strain (xx, yy) of the specimen, (1/A) ∮ u n ds, and stress (n, 3) of its cells under −`STRESS` along y."""
    loads = Loads(edge_tractions=(EdgeTraction("top", History.constant([0.0, -STRESS])),))
    found = dda.equilibrium(system, State.at_rest(system.blocks), loads)
    rows = found.result.contacts
    assert found.converged and rows["bonded"][(rows["length"] > 0) & (rows["law"] == 0)].all()
    first = system.blocks.vertices
    moved, following = found.state.vertices - first, system.blocks.next_vertex
    own = system.blocks.vertex_block > 0
    strain = []
    for axis, size in ((0, WIDTH), (1, HEIGHT)):
        sides = []
        for at in (0.0, size):
            on = own & (np.abs(first[:, axis] - at) < 1e-9) & (np.abs(first[following, axis] - at) < 1e-9)
            length = np.abs(first[on, 1 - axis] - first[following[on], 1 - axis])
            sides.append(length @ (moved[on, axis] + moved[following[on], axis]) / (2 * length.sum()))
        strain.append((sides[1] - sides[0]) / size)
    return np.array(strain), found.state.stress[1:]


def off(stress: np.ndarray) -> tuple[float, float]:
    """The largest and the mean (square) deviation of cells' ``stress`` from the uniform one."""
    apart = (stress - [0.0, -STRESS, 0.0]) / STRESS
    return float(np.abs(apart).max()), float(np.sqrt((apart**2).mean()))


@pytest.mark.parametrize(
    ("cells", "most", "mean"), [(hexagons(WIDTH, HEIGHT, 4), 0.01, 0.003), (voronoi(40, WIDTH, HEIGHT), 0.06, 0.012)],
    ids=["hexagons", "voronoi"],
)  # fmt: skip
def test_cells_on_stiff_glue_are_the_rock_they_were_cut_from(cells, most, mean):
    """E, ν and a uniform stress. Springs of 40 E' give by 1/80 of what a face's blocks are shortened, and by as much do
    faces of different lengths differ; what is left falls with the springs' compliance."""
    errors = []
    for penalty in (40.0, 400.0):
        stiff = {"normal_penalty": penalty * MODULUS_2D, "shear_penalty": penalty * MODULUS_2D}
        strain, stress = pressed(specimen(cells, **stiff))
        modulus, poisson = -STRESS / strain[1] / MODULUS_2D - 1, -strain[0] / strain[1] / POISSON_2D - 1
        errors.append((modulus, *off(stress)))
        print(f"{penalty:g} E': E off by {modulus:.1e}, nu by {poisson:.1e}, stress at most {errors[-1][1]:.1e}")
        assert -0.7 / penalty < modulus < 0 and abs(poisson) < 1 / penalty
    assert errors[0][1] < most and errors[0][2] < mean
    assert errors[1][2] < 0.4 * errors[0][2]


def through_joints(cells: list[np.ndarray], stiffness: tuple[float, float]) -> np.ndarray:
    """Mean strain (xx, yy) that joints of (kₙ, kₛ) Pa/m between ``cells`` add under a uniform −`STRESS` along y:
    (1/A) Σ ℓ sym(n ⊗ J), J their jump."""
    strain = np.zeros((2, 2))
    for cell in cells:
        for a, b in zip(cell, np.roll(cell, -1, axis=0)):
            if any(a[k] == b[k] and a[k] in (0.0, size) for k, size in ((0, WIDTH), (1, HEIGHT))):
                continue
            length = np.hypot(*(b - a))
            normal = np.array([b[1] - a[1], a[0] - b[0]]) / length
            pull = np.array([0.0, -STRESS * normal[1]])
            across = (pull @ normal) * normal
            jump = across / stiffness[0] + (pull - across) / stiffness[1]
            # Every face is seen from both sides.
            strain += 0.5 * length * 0.5 * (np.outer(jump, normal) + np.outer(normal, jump)) / (WIDTH * HEIGHT)
    return np.diag(strain)


@pytest.mark.parametrize("stiffness", [1e11, 1e10])
def test_hexagons_on_joints_are_rock_and_joints_in_series(stiffness):
    """Jumps σ n/k close around every corner of three equal angles: the stress is uniform, and strains add up."""
    cells = hexagons(WIDTH, HEIGHT, 4)
    law = JointLaw("glue", 0.5, 1e12, 1e12, normal_stiffness=stiffness, shear_stiffness=stiffness)
    strain, stress = pressed(specimen(cells, law))
    rock = np.array([POISSON_2D, -1.0]) * STRESS / MODULUS_2D
    joints = through_joints(cells, (stiffness, stiffness))
    missed = strain / (rock + joints) - 1
    print(f"joints give {joints[1] / strain[1]:.2f} of all; strain off by {missed}, stress by {off(stress)[0]:.1e}")
    # Equilibrium is sought to 1e-4 of the largest force.
    assert np.abs(missed).max() < 1e-3 and off(stress)[0] < 2e-3


@pytest.mark.parametrize("stiffness", [(1e11, 1e11), (1e11, 2e10), (1e10, 1e10)])
def test_voronoi_cells_on_joints_give_less_than_in_series_and_more_than_rock(stiffness):
    """A uniform stress is in equilibrium, and so bounds the compliance from above (Reuss), with the work −σ ε̄ A."""
    cells = voronoi(40, WIDTH, HEIGHT, even=3)
    law = JointLaw("glue", 0.5, 1e12, 1e12, normal_stiffness=stiffness[0], shear_stiffness=stiffness[1])
    strain, _ = pressed(specimen(cells, law))
    rock, joints = STRESS / MODULUS_2D, -through_joints(cells, stiffness)[1]
    share = (-strain[1] - rock) / joints
    print(f"joints give {share:.3f} of what they would in series")
    assert 0.6 < share < 1.0


# -- a cantilever ------------------------------------------------------------------------------------------------------

LENGTH, DEPTH = 8.0, 1.0
SMALL = 0.01 * 9.81  # a hundredth of its weight: linear


def cantilever(cells: list[np.ndarray], strength: float = 1e12, **settings) -> dda.BlockSystem:
    wall = np.array([[-1.0, -1.0], [0.0, -1.0], [0.0, DEPTH + 1], [-1.0, DEPTH + 1]])
    return dda.BlockSystem(
        Blocks.from_polygons([wall, *cells], fixed=[True] + [False] * len(cells)),
        [Material("rock", MODULUS, 0.0, density=DENSITY)], [JointLaw("glue", 0.6, strength, strength)],
        settings=DdaSettings(**{"max_displacement_ratio": 0.1, **settings}),
    )  # fmt: skip


def sag(cells: list[np.ndarray]) -> float:
    """Of the end, over that of Timoshenko's beam."""
    load = DENSITY * SMALL * DEPTH
    beam = load * LENGTH**4 / (8 * MODULUS * DEPTH**3 / 12) + load * LENGTH**2 / (2 * 5 / 6 * 0.5 * MODULUS * DEPTH)
    system = cantilever(cells)
    found = dda.equilibrium(system, State.at_rest(system.blocks), Loads(gravity=History.constant([0.0, -SMALL])))
    rows = found.result.contacts
    assert found.converged and rows["bonded"][rows["length"] > 0].all()
    end = np.abs(system.blocks.vertices[:, 0] - LENGTH) < 1e-9
    return float(-(found.state.vertices - system.blocks.vertices)[end, 1].mean() / beam)


def test_a_cantilever_of_hexagons_bends_as_a_beam_the_more_of_them_there_are():
    sags = [sag(hexagons(LENGTH, DEPTH, rows)) for rows in (2, 4)]
    print("sag over a beam's, 2 and 4 rows of hexagons:", np.round(sags, 3))
    assert sags == pytest.approx([0.768, 0.910], abs=3e-3)


@pytest.mark.slow
def test_a_cantilever_of_cells_bends_as_a_beam_the_more_of_them_there_are():
    """One strain a cell bends too little, the less the smaller they are: about as the size to the power 1.5, from cells
    that are all alike to any."""
    for name, cells, missed in (
        ("hexagons", lambda rows: hexagons(LENGTH, DEPTH, rows), 0.025),
        ("even cells", lambda rows: voronoi(8 * rows**2, LENGTH, DEPTH, even=8), 0.025),
        ("random cells", lambda rows: voronoi(8 * rows**2, LENGTH, DEPTH), 0.07),
    ):
        sags = np.array([sag(cells(rows)) for rows in (2, 4, 8)])
        print(f"{name}: sag over a beam's, 2, 4 and 8 deep:", np.round(sags, 3))
        assert (np.diff(sags) > 0).all() and 1 - sags[-1] < missed and 1 - sags[2] < 0.45 * (1 - sags[1])


def test_a_cantilever_of_voronoi_cells_of_second_order_is_a_beam(verified):
    """Four cells deep, random and even, continuous across their faces: below 1 %, where uniform strain lacks a tenth."""
    load, bends = DENSITY * SMALL * DEPTH, MODULUS * DEPTH**3 / 12
    beam = load * LENGTH**4 / (8 * bends) + load * LENGTH**2 / (2 * 5 / 6 * 0.5 * MODULUS * DEPTH)
    wall = np.array([[-1.0, -1.0], [0.0, -1.0], [0.0, DEPTH + 1], [-1.0, DEPTH + 1]])
    stiff = JointLaw("clamp", 0.6, 1e12, 1e12, normal_stiffness=1e6 * MODULUS, shear_stiffness=1e6 * MODULUS)
    for name, cells in (("random", voronoi(128, LENGTH, DEPTH)), ("even", voronoi(128, LENGTH, DEPTH, even=8))):
        n = len(cells)
        blocks = Blocks.from_polygons([wall, *cells], fixed=[True] + [False] * n, order=[1] + [2] * n)
        middle = 0.5 * (blocks.vertices + blocks.vertices[blocks.next_vertex])
        own = np.flatnonzero(blocks.vertex_block > 0)
        near = own[np.triu(np.abs(middle[own, None] - middle[None, own]).max(axis=2) < 1e-7, 1).nonzero()[0]]
        other = own[np.triu(np.abs(middle[own, None] - middle[None, own]).max(axis=2) < 1e-7, 1).nonzero()[1]]
        blocks = replace(blocks, glued=np.stack([near, other], axis=1))
        settings = DdaSettings(dynamic_factor=0.0, time_step=1e3, max_displacement_ratio=1.0)
        system = dda.BlockSystem(
            blocks, [Material("rock", MODULUS, 0.0, density=DENSITY, plane="stress")], [stiff], settings=settings
        )
        state = system.step(State.at_rest(blocks), Loads(gravity=History.constant([0.0, -SMALL]))).state
        end = np.abs(blocks.vertices[:, 0] - LENGTH) < 1e-9
        at = system.deflected.corners(state.vertices, state.rotation, state.deflection[:, 0])
        sags = float(-(at - blocks.vertices)[end, 1].mean() / beam)
        print(f"{name}: sag over a beam's {sags:.4f}")
        verified(f"cantilever of {name} Voronoi cells of order 2, four deep: deflection", sags - 1, "Timoshenko's beam")
        assert abs(sags - 1) < 0.01


# -- strength ----------------------------------------------------------------------------------------------------------


def first_to_break(cells: list[np.ndarray], penalty: float, parts: tuple[float, ...]) -> list[bool]:
    """Whether all glue holds at these parts of the pull σ n_y² = σ_t on the face that looks most along it."""
    strength = 2e6
    steepest = 0.0
    for cell in cells:
        a, b = cell, np.roll(cell, -1, axis=0)
        inside = ~((a[:, 1] == b[:, 1]) & np.isin(a[:, 1], (0.0, HEIGHT)))
        along = (b - a)[inside] / np.hypot(*(b - a)[inside].T)[:, None]
        steepest = max(steepest, float((along[:, 0] ** 2).max()))
    stiff = {"normal_penalty": penalty * MODULUS_2D, "shear_penalty": penalty * MODULUS_2D}
    glue = JointLaw("glue", 0.5, 1e12, strength)
    system = specimen(cells, glue, **stiff)
    # Pulled at both ends, without the floor.
    free = dda.BlockSystem(
        system.blocks, system.materials, [glue], lambda a, b: None if "floor" in (a, b) else 0, system.settings
    )

    def holds(pull: float) -> bool:
        ends = tuple(
            EdgeTraction(name, History.constant([0.0, sign * pull])) for name, sign in (("top", 1), ("bottom", -1))
        )
        rows = free.step(State.at_rest(system.blocks), Loads(edge_tractions=ends), 0.1).contacts
        return bool((rows["bonded"][rows["length"] > 0] == 1).all())

    return [holds(part * strength / steepest) for part in parts]


def test_hexagons_break_at_the_strength_of_their_glue():
    # Springs of 40 E' let faces of different lengths bear 1.3 % more or less than their share.
    assert first_to_break(hexagons(WIDTH, HEIGHT, 4), 40.0, (0.98, 1.01)) == [True, False]


def test_voronoi_cells_hold_until_the_strength_of_their_glue():
    """As stiff on a short face as on a long one the springs would bear many times the stress of the rock there: random
    cells would break at less than a fifth of what they hold."""
    assert first_to_break(voronoi(40, WIDTH, HEIGHT, even=3), 40.0, (0.84,)) == [True]
    assert first_to_break(voronoi(40, WIDTH, HEIGHT, even=3), 400.0, (0.98,)) == [True]
    assert first_to_break(voronoi(40, WIDTH, HEIGHT), 40.0, (0.7,)) == [True]


@pytest.mark.slow
def test_voronoi_cells_break_at_the_strength_of_their_glue():
    assert first_to_break(voronoi(40, WIDTH, HEIGHT, even=3), 400.0, (0.98, 1.01)) == [True, False]


def test_a_cantilever_of_cells_breaks_and_falls_with_its_energy():
    """A tenth of what its root needs: bonds break, and give no more than the weight has put in."""
    system = cantilever(
        voronoi(16, LENGTH, DEPTH, even=8), 0.1 * 3 * DENSITY * 9.81 * LENGTH**2 / DEPTH, dynamic_factor=1.0
    )
    weight = Loads(gravity=History.constant([0.0, -9.81]))
    state, budget = State.at_rest(system.blocks), dda.EnergyBudget()
    for _ in range(30):
        result = system.step(state, weight, 2e-3)
        budget, state = budget.after(result.energy, result.state.time), result.state
        assert result.energy.kinetic < budget.gravity_work + 1e-9
    lost = int((result.contacts["bonded"] == 0).sum())
    print("contacts without bond", lost, "; residual", budget.residual / budget.turnover)
    assert lost > 0 and abs(budget.residual) < 1e-3 * budget.turnover
