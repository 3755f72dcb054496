"""Outlines, bolts, water and names of the made-up run, held against what the scene draws."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic_run as made

from geomech.model import Blocks, State
from geomech.output import Series
from geomech.output.reading import Run, read_grid
from geomech.output.vtk.structures import BoltLines
from geomech.output.vtk.vtu import read_collection

pv = pytest.importorskip("pyvista")


def last(folder, name):
    return read_grid(read_collection(folder / f"{name}.pvd")[-1][1])


def text(grid, array):
    return bytes(np.asarray(grid.field_data[array])).decode().split("\n")


def test_outlines_are_the_edges_of_the_polygons_and_of_their_holes(run_folder):
    mesh, blocks = last(run_folder, "outlines"), made.blocks()
    length = mesh.compute_cell_sizes(area=False, volume=False)["Length"]
    for b in range(blocks.n_blocks):
        rings = [loop - np.roll(loop, -1, axis=0) for loop in blocks.loops(b)]
        perimeter = sum(np.hypot(*ring.T).sum() for ring in rings)
        assert length[mesh["block_id"] == b].sum() == pytest.approx(perimeter, rel=1e-12)
    assert text(mesh, "EDGE_NAMES") == list(blocks.edge_names)
    assert np.array_equal(mesh["displacement"], last(run_folder, "blocks")["displacement"])


def test_a_bolt_moves_with_its_blocks_and_tells_its_force(run_folder):
    mesh, load = last(run_folder, "bolts"), 3 * made.RATE
    moved = mesh["displacement"][:, :2]
    expected = made.placement(np.array([made.BAR.end]), load, 0.0) - made.BAR.end
    assert np.allclose(moved, [[0.0, 0.0], expected[0]], rtol=1e-9, atol=1e-15)
    assert mesh["force"] == pytest.approx([1e-3 * load]) and mesh["state"].tolist() == [1]
    assert text(mesh, "BOLT_NAMES") == ["bar"]
    first = read_grid(read_collection(run_folder / "bolts.pvd")[0][1])
    assert first["force"].tolist() == [0.0] and first["state"].tolist() == [0]


def test_a_bolt_is_found_again_when_its_block_is_cut():
    whole = made.cycle(1, 1, 0, 0)
    lines = BoltLines([made.BAR])
    lines.grid(whole, whole.motion, "reference")
    parts = Blocks.from_polygons(
        [whole.blocks.loops(0), *made.halves(), whole.blocks.loops(2)], fixed=[True, *[False] * 3]
    )
    vertices = parts.vertices.copy()
    vertices[parts.vertex_block == 2] += [1e-3, 2e-3]  # the right half, which holds the far end
    cut = replace(whole, blocks=parts, state=replace(State.at_rest(parts), vertices=vertices))
    moved = lines.grid(cut, cut.motion, "reference").point_data["displacement"]
    assert np.allclose(moved, [[0.0, 0.0], [1e-3, 2e-3]], rtol=0, atol=1e-12)


def test_the_water_table_stands_in_space_over_the_width_of_the_model(run_folder):
    mesh = last(run_folder, "water")
    x, y = mesh.points[:, :2].T
    assert (x.min(), x.max()) == (-0.03, 0.03)
    assert np.allclose(y, 0.05 + 0.03 * x, rtol=0, atol=1e-12)
    assert not mesh["displacement"].any() and set(mesh["ponded"].tolist()) == {0}


def test_tips_tell_their_crack_their_end_and_their_name(run_folder):
    mesh, tips = last(run_folder, "tips"), made.cycles()[-1].tips
    assert mesh["tip_id"].tolist() == tips["node"].tolist() and mesh["end"].tolist() == [0, 1]
    assert text(mesh, "CRACK_NAMES") == ["flaw"] and text(last(run_folder, "cracks"), "CRACK_NAMES") == ["flaw"]


def test_all_series_span_the_same_time(run_folder):
    spans = {name: [t for t, _ in Run(run_folder).series(name)] for name in ("blocks", "interior", "tips", "bolts")}
    assert {(times[0], times[-1]) for times in spans.values()} == {(0.0, spans["blocks"][-1])}


def test_the_interior_before_the_first_step_is_rock_at_rest(tmp_path):
    """Nothing is solved at the first cycle; the crack is there all the same, closed, in rock without stress."""
    start = replace(made.cycle(0, 0, 0, 0), bodies={})
    series = Series(interior_every=1)
    series.on_start(made.problem(), tmp_path)
    for cycle in (start, made.cycle(1, 1, 0, 0)):
        series.on_cycle(cycle)
    series.on_end({})
    first, second = (read_grid(file) for _, file in read_collection(tmp_path / "interior.pvd"))
    assert np.array_equal(first.points, second.points)
    assert not first["von_mises"].any() and second["von_mises"].any()


def test_rock_inside_meets_what_presses_on_it(tmp_path):
    """A body dented by far more than its block is shortened: where contacts press it is as the block, in between the
    jump across its crack is the same, and far from both it is as it was."""
    from geomech.output.vtk.interior_fields import InteriorMeshes

    class Dented(made.UniformBody):
        def displacement(self, points):
            dent = 1e-4 * np.exp(-np.hypot(*(points - [-0.03, -0.06]).T) / 0.01)
            torn = np.where(points[:, 1] > points[:, 0], 1e-6, -1e-6)
            return super().displacement(points) + np.stack([torn, dent], axis=1)

    cycle = replace(made.cycle(1, 300, 0, 0), bodies={1: Dented(300 * made.RATE)})
    free = replace(cycle, state=replace(cycle.state, contacts=cycle.state.contacts[:0]))
    tied, loose = (
        InteriorMeshes().grid(each, [made.ROCK, made.STEEL], each.motion, "reference") for each in (cycle, free)
    )
    moved, was = (grid.point_data["displacement"] for grid in (tied, loose))
    start = cycle.blocks.vertex_start[1]
    for vertex in (start, start + 1):
        corner = np.argmin(np.hypot(*(tied.points - cycle.blocks.vertices[vertex]).T))
        block = (cycle.state.vertices - cycle.blocks.vertices)[vertex]
        assert np.allclose(moved[corner], block, rtol=0, atol=1e-9)
    assert np.abs(was - moved).max() > 3e-5
    far = np.hypot(*(tied.points - [0.0, 0.03]).T) < 0.03
    assert np.array_equal(moved[far], was[far])
    assert np.array_equal(tied.point_data["stress"], loose.point_data["stress"])
