"""Cracks in rock that is divided into cells: K, its convergence with the size and the order of cells, growth and energy."""

from __future__ import annotations

import logging
import math
from dataclasses import replace

import numpy as np
import pytest

from geomech import dda, ddm
from geomech.coupling import Coupling, cycles
from geomech.model import History, JointLaw, Material
from geomech.reference.cracks import fracture, plates
from geomech.scene import SceneError, load_scene

PLATE = """
title = "A cracked plate of cells"
[[geometry.zones]]
name = "plate"
rectangle = [{left}, -{half_height}, {right}, {half_height}]
{holes}
[[geometry.cracks]]
name = "crack"
points = {crack}
[[geometry.edges]]
name = "top"
line = [[{left}, {half_height}], [{right}, {half_height}]]
[[geometry.edges]]
name = "bottom"
line = [[{left}, -{half_height}], [{right}, -{half_height}]]
[materials.rock]
youngs_modulus_pa = 20e9
poissons_ratio = 0.25
density_kg_m3 = 2500
k_ic_pa_sqrt_m = {k_ic}
[zones.plate]
order = {order}
mesh_size_m = {size}
{zone}
[[loads.tractions]]
edge = "top"
value_pa = [0, 1e6]
[[loads.tractions]]
edge = "bottom"
value_pa = [0, -1e6]
[dda]
dynamic_factor = {dynamic}
time_step_s = {step}
{dda}
[growth]
increment_m = 0.05
{growth}
[run]
end_time_s = {end}
stop_at = []
[output]
interior = false
"""
EDGE, CENTRE = [[0.0, 0.0], [0.2, 0.0]], [[-0.3, 0.0], [0.3, 0.0]]
SLANTED = [[0.35, -0.05], [0.6, 0.1]]


def plate(tmp_path, crack, order=3, size=0.25, half_height=1.5, sides=(0.0, 1.0), **more):
    """The scene of a plate pulled up and down with 1 MPa."""
    given = {
        "crack": crack, "order": order, "size": size, "half_height": half_height, "left": sides[0], "right": sides[1],
        "holes": "", "k_ic": 1e12, "zone": "", "dynamic": 0.0, "step": 100.0, "end": 100.0, "dda": "", "growth": "",
    }  # fmt: skip
    path = tmp_path / "plate.toml"
    path.write_text(PLATE.format(**(given | more)), encoding="utf-8")
    return load_scene(path).problem()


def found(problem) -> tuple[np.ndarray, np.ndarray, dict]:
    """K_I of the tips at rest, under the stress of their cell, and statistics."""
    run = Coupling(problem)
    *_, last = run.cycles()
    (cell,) = set(last.cracks.block.tolist())
    return last.tips["k_i"], run.now.strain_solutions()[cell].tips["k_i"], last.statistics


def test_an_edge_crack_has_the_k_of_its_closed_form(tmp_path):
    """A fifth of the width, in cells of order 3: 1e-3 with cells of 0.25 m."""
    k, under_stress, told = found(plate(tmp_path, EDGE))
    exact = fracture.EDGE_CRACK[0.2] * 1e6 * math.sqrt(math.pi * 0.2)
    assert k == pytest.approx(exact, rel=2e-3) and under_stress == pytest.approx(exact, rel=3e-3)
    assert told["crack_work"] == pytest.approx(told["crack_elastic"], rel=1e-6)


def test_a_centre_crack_has_the_k_of_its_closed_form(tmp_path):
    k, under_stress, _ = found(plate(tmp_path, CENTRE, sides=(-1.0, 1.0), half_height=3.0, size=0.5))
    exact = plates.centre_crack_strip(0.3) * fracture.griffith(1e6, 0.3)
    assert k == pytest.approx([exact, exact], rel=5e-3) and under_stress == pytest.approx([exact, exact], rel=1e-2)


def solved(problem_cracks, loops, half_height, sides) -> np.ndarray:
    """K_I by the crack solver alone."""
    (left, right), top = sides, half_height
    box = np.array([[left, -top], [right, -top], [right, top], [left, top]])
    pull = np.array([[[0.0, 1e6]] * 2, [[0.0, -1e6]] * 2])
    load = ddm.BodyLoad(segments=np.array([[box[2], box[3]], [box[0], box[1]]]), tractions=pull)
    return ddm.Body([box, *loops], problem_cracks, Material("rock", 20e9, 0.25, 2500.0)).solve(load).tips["k_i"]


def of_solver(problem, loops=(), half_height=1.5, sides=(0.0, 1.0)) -> np.ndarray:
    cracks = replace(problem.cracks, block=np.zeros(problem.cracks.n_segments, int))
    return solved(cracks, loops, half_height, sides)


@pytest.mark.slow
@pytest.mark.parametrize("crack", [EDGE, SLANTED])
def test_k_converges_with_the_size_and_order_of_cells(tmp_path, crack):
    """Printed: the error of K, with the observed order in h. What remains is the error of the cell of the crack, of order 8,
    below 5e-3."""
    errors = {}
    for order in (2, 3, 4):
        for size in (0.5, 0.25, 0.125):
            problem = plate(tmp_path, crack, order, size)
            k, under_stress, _ = found(problem)
            exact = of_solver(problem)
            errors[order, size] = float(np.abs(k / exact - 1).max())
            off = float(np.abs(under_stress / exact - 1).max())
            print(f"order {order}, cells of {size} m: K {errors[order, size]:.1e}, of the stress of the cell {off:.1e}")
        rate = math.log2(errors[order, 0.5] / errors[order, 0.125]) / 2
        print(f"order {order}: observed order {rate:.1f} in h")
        assert errors[order, 0.125] < 5e-3 and errors[order, 0.125] < 1.2 * errors[order, 0.5]
    assert errors[4, 0.25] < errors[2, 0.5]


@pytest.mark.parametrize(
    ("cracks", "order"),
    [(1, 2), pytest.param(1, 3, marks=pytest.mark.slow), pytest.param(2, 4, marks=pytest.mark.slow)],
)
def test_cracks_from_a_hole_in_a_plate_of_cells(tmp_path, cracks, order):
    """Each crack has a cell that ends at the hole: K against the crack solver."""
    angle = -2 * math.pi * (np.arange(16) + 0.5) / 16
    hole = 0.2 * np.column_stack([np.cos(angle), np.sin(angle)]) + [1.0, 0.0]
    mouth = float(hole[:, 0].max()) - 1.0
    points = [[[1.0 + way * mouth, 0.0], [1.0 + way * (mouth + 0.15), 0.0]] for way in (1.0, -1.0)[:cracks]]
    crack = f"{points[0]}" + (f'\n[[geometry.cracks]]\nname = "second"\npoints = {points[1]}' if cracks == 2 else "")
    more = {"half_height": 1.5, "sides": (0.0, 2.0)}
    problem = plate(tmp_path, crack, order, 0.25, holes=f"holes = [{hole.tolist()}]", **more)
    cells = set(problem.cracks.block.tolist())
    assert len(cells) == cracks and all(len(problem.blocks.loops(cell)) == 1 for cell in cells)
    *_, last = Coupling(problem).cycles()
    exact = of_solver(problem, [hole], **more)
    print(f"{cracks} cracks from a hole, order {order}: {np.abs(last.tips['k_i'] / exact - 1).max():.1e}")
    assert last.tips["k_i"] == pytest.approx(exact, rel=1e-2)


def test_energy_of_a_cracked_plate_in_motion(tmp_path):
    """Pulled at once: work = kinetic + stored + at the crack, to 3e-5 of it."""
    problem = plate(tmp_path, EDGE, 2, 0.5, dynamic=1.0, step=4e-5, end=8e-4, dda="damping = 0.0")
    told = [cycle.statistics for cycle in cycles(problem) if cycle.number]
    assert max(one["crack_work"] for one in told) > 0.01 * max(one["load_work"] for one in told)
    assert max(abs(one["budget_residual"]) for one in told) < 3e-5


def test_a_closed_crack_slides_in_its_cell(tmp_path):
    """Pressed, with 20° of friction: K_II against the crack solver."""
    problem = plate(tmp_path, [[0.35, -0.15], [0.6, 0.1]], size=0.5)
    laws = (JointLaw("rough", friction_angle=math.radians(20)),)
    shut = replace(problem.cracks, aperture=np.zeros(1), law=np.zeros(1, int))
    tractions = tuple(
        replace(load, history=History.constant([-5.0 * part for part in load.history.at(0.0)]))
        for load in problem.loads.edge_tractions
    )
    problem = replace(problem, cracks=shut, face_laws=laws, loads=replace(problem.loads, edge_tractions=tractions))
    *_, last = Coupling(problem).cycles()
    box = np.array([[0.0, -1.5], [1.0, -1.5], [1.0, 1.5], [0.0, 1.5]])
    alone = replace(shut, block=np.zeros(1, int))
    body = ddm.Body([box], alone, Material("rock", 20e9, 0.25, 2500.0), face_laws=laws)
    push = np.array([[[0.0, -5e6]] * 2, [[0.0, 5e6]] * 2])
    exact = body.solve(ddm.BodyLoad(segments=np.array([[box[2], box[3]], [box[0], box[1]]]), tractions=push))
    assert np.abs(exact.tips["k_ii"]).min() > 1e5
    assert last.tips["k_ii"] == pytest.approx(exact.tips["k_ii"], rel=5e-3) and last.tips["k_i"] == pytest.approx(
        [0, 0]
    )
    assert last.statistics["crack_friction"] > 0.0


@pytest.mark.slow
def test_a_crack_grows_through_its_cell_in_motion(tmp_path):
    """Pulled at once: the crack runs through and divides its cell. Energies of growth, waves and parts add up."""
    more = {"dynamic": 1.0, "step": 2e-5, "end": 3e-3, "dda": "damping = 0.0", "zone": "crack_margin_m = 0.85"}
    problem = plate(tmp_path, EDGE, 2, 0.5, k_ic=4e5, **more)
    told = []
    for cycle in cycles(problem):
        told.append(cycle.statistics)
        if cycle.blocks.n_blocks > problem.blocks.n_blocks:
            break
    assert cycle.blocks.n_blocks == problem.blocks.n_blocks + 1
    assert told[-2]["fracture_energy"] > 0.5 * told[-2]["toughness_energy"]
    assert max(abs(one["budget_residual"]) for one in told[1:]) < 2e-3


@pytest.mark.slow
def test_a_crack_grows_through_the_cell_around_it_and_divides_it(tmp_path):
    """K at each length is that of the closed form; the parts keep the faces to their neighbours."""
    problem = plate(tmp_path, EDGE, k_ic=1e6, zone="crack_margin_m = 0.85", step=1.0, end=1.0)
    seen = {}
    for cycle in cycles(problem):
        if len(cycle.tips):
            seen[round(float(cycle.tips["point"][0, 0]), 9)] = float(cycle.tips["k_i"][0])
        if cycle.blocks.n_blocks > problem.blocks.n_blocks:
            break
    for ratio in (0.2, 0.3, 0.4, 0.5, 0.6, 0.7):
        exact = fracture.EDGE_CRACK[ratio] * 1e6 * math.sqrt(math.pi * ratio)
        assert seen[ratio] == pytest.approx(exact, rel=3e-3)
    before, after = np.asarray(problem.blocks.glued), np.asarray(cycle.blocks.glued)
    assert cycle.blocks.n_blocks == problem.blocks.n_blocks + 1 and len(after) == len(before)
    ends = [
        [blocks.vertices[pairs], blocks.vertices[blocks.next_vertex[pairs[:, ::-1]]]]
        for blocks, pairs in ((problem.blocks, before), (cycle.blocks, after))
    ]
    for start, end in ends:
        np.testing.assert_allclose(start, end, atol=1e-12)


def test_a_crack_that_would_leave_its_cell_is_named(tmp_path):
    problem = plate(tmp_path, EDGE, 2, 0.5, k_ic=1e6, zone="crack_margin_m = 0.1", step=1.0, end=1.0)
    with pytest.raises(dda.NotConverged, match=r"crack has grown through its cell.*crack_margin_m"):
        list(cycles(problem))


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"growth": 'initiation = "surface"'}, "cracks that begin"),
        ({"zone": "crack_margin_m = -1.0"}, "crack_margin_m"),
    ],
)
def test_what_cells_do_not_support_is_refused(tmp_path, more, message):
    with pytest.raises(SceneError, match=message):
        plate(tmp_path, EDGE, **more)


@pytest.mark.parametrize("seed", range(4))
def test_cells_around_any_cracks_fill_the_rock(tmp_path, seed, caplog):
    """Of random cracks, some from the outline: cells tile the plate, faces fit, and each crack is inside one cell."""
    caplog.set_level(logging.ERROR)
    rng = np.random.default_rng(seed)
    start = rng.uniform([0.1, -1.2], [0.9, 1.2])
    crack = [start.tolist(), (start + 0.15 * rng.normal(size=2)).clip([0.05, -1.4], [0.95, 1.4]).tolist()]
    if seed % 2:
        crack[0][0] = 0.0
    problem = plate(tmp_path, crack, 2, float(rng.uniform(0.15, 0.5)))
    blocks, cracks = problem.blocks, problem.cracks
    assert blocks.areas().sum() == pytest.approx(3.0, rel=1e-12) and blocks.areas().min() > 1e-4
    assert len(set(cracks.block.tolist())) == 1 and np.count_nonzero(blocks.order == 8) == 1
    assert cracks.surface.sum() == seed % 2
    edge, mate = np.asarray(blocks.glued).T
    np.testing.assert_allclose(blocks.vertices[edge], blocks.vertices[blocks.next_vertex[mate]], atol=1e-12)
    sides = np.hypot(*(blocks.vertices[blocks.next_vertex[edge]] - blocks.vertices[edge]).T)
    outer = 8.0 - sum(np.hypot(*(blocks.vertices[blocks.next_vertex[v]] - blocks.vertices[v])) for v in
                      np.setdiff1d(np.arange(len(blocks.vertices)), np.concatenate([edge, mate])).tolist())  # fmt: skip
    assert outer == pytest.approx(0.0, abs=1e-9) and sides.min() > 0.01
