"""Voronoi cells fill blocks of any shape: side on side, without slivers, with a face at each corner that turns inwards."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from geomech.model import Blocks, Cracks
from geomech.shapes.cells import divided
from geomech.shapes.crack_cells import divided_around
from geomech.shapes.outlines import rectangle


def hole(sides: int, radius: float) -> np.ndarray:
    turn = -np.linspace(0, 2 * np.pi, sides, endpoint=False)
    return radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)


SHAPES = {
    "beam": ([rectangle(0, 0, 8, 1)], 0.25),
    "plate with a hole": ([rectangle(-1, -1.5, 1, 1.5), hole(24, 0.25)], 0.3),
    "L": ([np.array([[0, 0], [1, 0], [1, 0.3], [0.4, 0.3], [0.4, 1.2], [0, 1.2]])], 0.15),
    "notch": ([np.array([[-0.5, 0], [1.9, 0], [2, 0.2], [2.1, 0], [4.5, 0], [4.5, 0.5], [-0.5, 0.5]])], 0.15),
    "slot": ([np.array([[0, 0], [2, 0], [2, 0.98], [0.5, 0.99], [0.5, 1.01], [2, 1.02], [2, 2], [0, 2]])], 0.3),
    "triangle": ([np.array([[0, 0], [1, 0], [0.2, 0.5]])], 0.2),
    "strip": ([rectangle(0, 0, 8, 0.05)], 0.5),
    "larger cell than block": ([rectangle(0, 0, 1, 1)], 3.0),
}


@cache
def cells_in(name: str) -> tuple[Blocks, Blocks]:
    return cells_of(*SHAPES[name])


def cells_of(loops: list[np.ndarray], size: float) -> tuple[Blocks, Blocks]:
    """The block, its edges called by their number, and its cells."""
    names, start = [], 0
    for loop in loops:
        names.append([f"edge {start + k}" for k in range(len(loop))])
        start += len(loop)
    block = Blocks.from_polygons([loops], order=[3], edge_names=[names])
    return block, divided(block, np.array([size]), np.array(["voronoi"]), ["between"])[0]


def turns(polygon: np.ndarray) -> np.ndarray:
    """(n,) rad by which a polygon turns at its corners, negative inwards."""
    ahead = np.roll(polygon, -1, axis=0) - polygon
    angle = np.arctan2(ahead[:, 1], ahead[:, 0])
    return (angle - np.roll(angle, 1) + np.pi) % (2 * np.pi) - np.pi


@pytest.mark.parametrize("name", SHAPES)
def test_cells_fill_a_block_side_on_side(name):
    block, cells = cells_in(name)
    areas = np.array([cells.area_moments(b)[0] for b in range(cells.n_blocks)])
    assert areas.sum() == pytest.approx(block.area_moments(0)[0], rel=1e-12)
    glued = np.asarray(cells.glued)
    one, two = glued.T
    assert len(np.unique(glued)) == glued.size
    assert np.array_equal(cells.vertices[one], cells.vertices[cells.next_vertex[two]])
    # What is not glued is the outline, under its own names.
    length = np.hypot(*(cells.vertices[cells.next_vertex] - cells.vertices).T)
    label = np.array(cells.edge_names)[cells.edge_name]
    assert (label[glued.ravel()] == "between").all()
    edges = np.hypot(*(block.vertices[block.next_vertex] - block.vertices).T)
    for k, edge in enumerate(edges):
        assert length[label == f"edge {k}"].sum() == pytest.approx(edge, rel=1e-9)


@pytest.mark.parametrize("name", SHAPES)
def test_cells_are_well_formed(name):
    """Nearly convex; no short faces but those between corners of the block."""
    block, cells = cells_in(name)
    size_of = np.sqrt([cells.area_moments(b)[0] for b in range(cells.n_blocks)])[cells.vertex_block]
    one, two = np.asarray(cells.glued).T
    size_of[one] = size_of[two] = np.minimum(size_of[one], size_of[two])
    for b in range(cells.n_blocks):
        assert turns(cells.loops(b)[0]).min() > -0.26
    corners = {tuple(x) for x in block.vertices.tolist()}
    for k in np.flatnonzero(np.hypot(*(cells.vertices[cells.next_vertex] - cells.vertices).T) < 0.1 * size_of).tolist():
        assert any(tuple(cells.vertices[end].tolist()) in corners for end in (k, cells.next_vertex[k]))


def test_cells_have_the_size_that_is_asked_for_and_no_common_direction():
    """√3/2 times the square of the mesh size each, as hexagons of that width; the same in every run."""
    _, cells = cells_of([rectangle(0, 0, 10, 10)], 0.5)
    assert 100 / cells.n_blocks == pytest.approx(0.866 * 0.5**2, rel=0.15)
    areas = np.array([cells.area_moments(b)[0] for b in range(cells.n_blocks)])
    assert areas.std() < 0.3 * areas.mean()
    along = (cells.vertices[cells.next_vertex] - cells.vertices)[np.asarray(cells.glued)[:, 0]]
    counts, _ = np.histogram(np.arctan2(along[:, 1], along[:, 0]) % np.pi, 6, (0, np.pi))
    assert counts.min() > 0.6 * counts.mean()
    assert np.array_equal(cells_of([rectangle(0, 0, 10, 10)], 0.5)[1].vertices, cells.vertices)


def test_a_crack_has_a_cell_of_its_own():
    block = Blocks.from_polygons([[rectangle(-1, -1.5, 1, 1.5)]], order=[3])
    line = np.array([[-0.2, 0.0], [0.2, 0.1]])
    cracks = Cracks.from_polylines([line], block=[0])
    cells, _, moved = divided_around(block, cracks, np.array([0.3]), np.array(["voronoi"]), [""], np.array([0.3]))
    own = int(moved.block[0])
    assert cells.area_moments(own)[0] == pytest.approx((np.hypot(0.4, 0.1) + 0.6) * 0.6, rel=1e-9)
    assert sum(cells.area_moments(b)[0] for b in range(cells.n_blocks)) == pytest.approx(6.0, rel=1e-12)
    sides = np.isin(np.asarray(cells.glued), np.arange(*cells.vertex_start[own : own + 2])).any(axis=1)
    assert sides.sum() == cells.vertex_start[own + 1] - cells.vertex_start[own]
