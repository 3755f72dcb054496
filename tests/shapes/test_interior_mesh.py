"""Interior meshes: area, conformity, faces that part, sizes at tips."""

import time

import numpy as np
import pytest

from geomech.model import Cracks
from geomech.shapes import Trace, Zone, assemble, mesh_interior, rectangle, straight_crack
from geomech.shapes.narrow_places import narrow_places

SQUARE = rectangle(0.0, 0.0, 1.0, 1.0)


def meshed(lines, holes=(), size=0.08, tip_size=0.01):
    traces = [Trace(str(k), (np.array(line, dtype=float),)) for k, line in enumerate(lines)]
    blocks, cracks = assemble([Zone("rock", (SQUARE, *holes))], traces)
    return blocks, cracks, mesh_interior(blocks.loops(0), cracks, size, tip_size)


def areas(mesh):
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def boundary_edges(mesh):
    """Edges of one triangle only, as point pairs."""
    edges = np.sort(mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    found, count = np.unique(edges, axis=0, return_counts=True)
    assert count.max() <= 2
    return found[count == 1]


CASES = {
    "whole": [],
    "inner": [[[0.3, 0.4], [0.7, 0.6]]],
    "kinked": [[[0.2, 0.5], [0.5, 0.5], [0.6, 0.8]]],
    "mouth": [[[1.0, 0.5], [0.6, 0.5]]],
    "corner mouth": [[[0.0, 0.0], [0.4, 0.3]]],
    "crossing": [[[0.2, 0.5], [0.8, 0.5]], [[0.5, 0.2], [0.5, 0.8]]],
    "tee": [[[0.2, 0.5], [0.8, 0.5]], [[0.4, 0.5], [0.4, 0.8]]],
    "two": [straight_crack((0.5, 0.6), 0.2, 0.8), straight_crack((0.5, 0.4), 0.2, 2.4)],
}


@pytest.mark.parametrize("name", CASES)
def test_area_conformity_and_faces(name):
    _, cracks, mesh = meshed(CASES[name])
    # The triangles tile the block: its area, to round-off of some thousand terms; none is turned over.
    assert areas(mesh).min() > 0
    assert areas(mesh).sum() == pytest.approx(1.0, abs=1e-12)
    # The free edges are the outline once and each crack twice, once a face.
    edges = boundary_edges(mesh)
    length = np.hypot(*(mesh.points[edges[:, 0]] - mesh.points[edges[:, 1]]).T).sum()
    assert length == pytest.approx(4.0 + 2 * cracks.lengths.sum(), abs=1e-9)


def copies(mesh, point):
    return np.flatnonzero(np.hypot(*(mesh.points - point).T) < 1e-9)


def test_nodes_at_tips_mouths_and_junctions():
    _, _, mesh = meshed(CASES["crossing"])
    assert len(copies(mesh, [0.5, 0.5])) == 4
    assert [len(copies(mesh, tip)) for tip in ([0.2, 0.5], [0.8, 0.5], [0.5, 0.2], [0.5, 0.8])] == [1, 1, 1, 1]
    _, _, mesh = meshed(CASES["tee"])
    assert len(copies(mesh, [0.4, 0.5])) == 3
    _, _, mesh = meshed(CASES["mouth"])
    assert len(copies(mesh, [1.0, 0.5])) == 2 and len(copies(mesh, [0.6, 0.5])) == 1
    _, _, mesh = meshed(CASES["kinked"])
    assert len(copies(mesh, [0.5, 0.5])) == 2


def test_side_points_into_the_nodes_own_triangles():
    for name in ("inner", "kinked", "mouth", "crossing", "tee", "corner mouth"):
        _, _, mesh = meshed(CASES[name])
        on = np.flatnonzero(mesh.side.any(axis=1))
        assert len(on) > 10
        assert np.hypot(*mesh.side[on].T) == pytest.approx(np.ones(len(on)), abs=1e-12)
        a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
        for node in on:
            # A small step along `side` lands in a triangle that has this very node.
            own = (mesh.triangles == node).any(axis=1)
            reach = np.sqrt(2 * areas(mesh)[own].min())
            p = mesh.points[node] + 1e-3 * reach * mesh.side[node]
            inside = [
                ((q - o)[own, 0] * (p - o[own])[:, 1] - (q - o)[own, 1] * (p - o[own])[:, 0]) > -1e-15
                for o, q in ((a, b), (b, c), (c, a))
            ]
            assert np.logical_and.reduce(inside).any(), (name, mesh.points[node])


def test_straight_crack_has_one_node_a_side():
    _, _cracks, mesh = meshed(CASES["inner"])
    normal = np.array([-0.2, 0.4]) / np.hypot(0.2, 0.4)
    on = np.flatnonzero(mesh.side.any(axis=1))
    upper = mesh.side[on] @ normal > 0
    assert upper.sum() == (~upper).sum() == len(on) / 2
    assert np.allclose(np.abs(mesh.side[on] @ normal), 1.0, atol=1e-9)


def test_sizes_shrink_to_the_tips():
    _, _, mesh = meshed(CASES["inner"], size=0.1, tip_size=0.005)
    edges = mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    length = np.hypot(*(mesh.points[edges[:, 0]] - mesh.points[edges[:, 1]]).T)
    (tip,) = copies(mesh, [0.3, 0.4])
    # Gmsh keeps sizes within a factor of about two.
    assert 0.0025 < length[(edges == tip).any(axis=1)].mean() < 0.01
    assert 0.05 < length[(mesh.points[edges[:, 0]] < 0.15).all(axis=1)].mean() < 0.2


def test_a_crack_right_through_parts_the_mesh():
    # No scene may draw it, but growth can leave it for a moment.
    crack = Cracks.from_polylines([np.array([[0.0, 0.4], [1.0, 0.6]])], surface=[(True, True)])
    mesh = mesh_interior([SQUARE], crack, 0.1, 0.1)
    assert areas(mesh).sum() == pytest.approx(1.0, abs=1e-12)
    assert len(copies(mesh, [0.0, 0.4])) == len(copies(mesh, [1.0, 0.6])) == 2
    edges = boundary_edges(mesh)
    length = np.hypot(*(mesh.points[edges[:, 0]] - mesh.points[edges[:, 1]]).T).sum()
    assert length == pytest.approx(4.0 + 2 * np.hypot(1.0, 0.2), abs=1e-9)


def test_holes_stay_empty_and_may_carry_mouths():
    hole = rectangle(0.4, 0.4, 0.6, 0.6)
    _, _cracks, mesh = meshed([[[0.6, 0.5], [0.8, 0.5]]], holes=(hole,))
    assert areas(mesh).sum() == pytest.approx(1 - 0.04, abs=1e-12)
    assert len(copies(mesh, [0.6, 0.5])) == 2


def test_random_networks():
    rng = np.random.default_rng(11)
    for _ in range(5):
        lines = [straight_crack(rng.uniform(0.25, 0.75, 2), 0.3, rng.uniform(0, np.pi)) for _ in range(6)]
        _, cracks, mesh = meshed(lines)
        assert areas(mesh).min() > 0 and areas(mesh).sum() == pytest.approx(1.0, abs=1e-12)
        edges = boundary_edges(mesh)
        length = np.hypot(*(mesh.points[edges[:, 0]] - mesh.points[edges[:, 1]]).T).sum()
        assert length == pytest.approx(4.0 + 2 * cracks.lengths.sum(), abs=1e-9)
        for tip in cracks.nodes[cracks.tips]:
            assert len(copies(mesh, tip)) == 1


def test_grown_wings_of_many_short_steps():
    """Paths as growth leaves them: steps from a hundredth to a tenth of the crack, bending at random."""
    rng = np.random.default_rng(5)
    for _ in range(5):
        ends = straight_crack((0.5, 0.5), 0.1, rng.uniform(0, np.pi))
        wings, angles = ([ends[0]], [ends[1]]), rng.uniform(0, 2 * np.pi, 2)
        for _ in range(20):
            for wing, angle in zip(wings, angles, strict=True):
                wing.append(wing[-1] + 10 ** rng.uniform(-3, -2) * np.array([np.cos(angle), np.sin(angle)]))
            angles += rng.normal(0, 0.15, 2)
        _, cracks, mesh = meshed([np.array(wings[0][::-1] + wings[1])])
        assert areas(mesh).min() > 0 and areas(mesh).sum() == pytest.approx(1.0, abs=1e-12)
        edges = boundary_edges(mesh)
        length = np.hypot(*(mesh.points[edges[:, 0]] - mesh.points[edges[:, 1]]).T).sum()
        assert length == pytest.approx(4.0 + 2 * cracks.lengths.sum(), abs=1e-9)


def test_default_sizes_are_a_few_thousand_triangles_and_quick():
    outline = rectangle(-0.03, -0.06, 0.03, 0.06)
    lines = [Trace(n, (straight_crack((0, y), 0.01, np.pi / 4),)) for n, y in (("a", 0.01), ("b", -0.01))]
    blocks, cracks = assemble([Zone("rock", (outline,))], lines)
    mesh_interior(blocks.loops(0), cracks)
    began = time.process_time()
    mesh = mesh_interior(blocks.loops(0), cracks)
    assert 1500 < len(mesh.triangles) < 6000
    # Measured 0.04 s of processor time, which others on the machine lengthen less than the clock's; the bound leaves
    # them room.
    assert time.process_time() - began < 0.6


def test_bad_sizes():
    with pytest.raises(ValueError, match="must be positive"):
        meshed([], size=0.0)


def test_flat_triangles_between_near_cracks_are_told_with_their_place(caplog):
    """Two parallel cracks 2e-6 apart over 0.4: to fit between them would take half a million triangles."""
    near = 2e-6
    with caplog.at_level("INFO", logger="geomech"):
        _, _, mesh = meshed([[[0.3, 0.5], [0.7, 0.5]], [[0.3, 0.5 + near], [0.7, 0.5 + near]]])
    angle, place = mesh.flattest()
    assert angle < np.radians(1.0) and 0.25 < place[0] < 0.75 and abs(place[1] - 0.5) < 0.01
    (line,) = [record.getMessage() for record in caplog.records]
    assert f"{np.degrees(angle):.2g} degrees" in line and f"({place[0]:.6g}, {place[1]:.6g})" in line
    caplog.clear()
    with caplog.at_level("INFO", logger="geomech"):
        _, _, mesh = meshed([[[0.3, 0.5], [0.7, 0.5]]])
    assert mesh.flattest()[0] > np.radians(10.0) and not caplog.records


def near_cracks(rng, kind: str) -> list:
    """Two lines, or a line and the outline, at a distance of 1e-5 to 1e-2, in any direction."""
    gap, turn = 10 ** rng.uniform(-5, -2), rng.uniform(0, np.pi)
    along = np.array([np.cos(turn), np.sin(turn)])
    across = np.array([-along[1], along[0]])
    middle, length = rng.uniform(0.4, 0.6, 2), rng.uniform(0.2, 0.4)
    first = [middle - 0.5 * length * along, middle + 0.5 * length * along]
    if kind == "parallel":
        gap = max(gap, length / 4000)
        return [first, [middle - 0.3 * length * along + gap * across, middle + 0.6 * length * along + gap * across]]
    if kind == "in line":
        ahead = first[1] + gap * along
        return [first, [ahead, ahead + 0.1 * along]]
    if kind == "tip at a side":
        way = np.array([np.cos(turn + 1), np.sin(turn + 1)])
        return [first, [middle + gap * way, middle + length * way]]
    return [[[0.3, gap], [0.5, rng.uniform(1, 5) * gap]]]


@pytest.mark.first_by_default(2)
@pytest.mark.parametrize("kind", ["parallel", "in line", "tip at a side", "beside the outline"])
def test_no_flat_triangles_between_near_cracks(kind):
    """Angles were as small as 0.02 degrees. Triangles between cracks follow their distance down to a four-thousandth of
    the way over which they run beside each other, and to the tolerance of drawings at their tips."""
    rng = np.random.default_rng(8)
    for _ in range(12):
        lines = near_cracks(rng, kind)
        _, cracks, mesh = meshed(lines, size=0.0215, tip_size=0.0215 / 15)
        assert mesh.flattest()[0] > np.radians(1.0), lines
        assert areas(mesh).min() > 0 and areas(mesh).sum() == pytest.approx(1.0, abs=1e-12)
        assert len(mesh.triangles) < 20_000
        edges = boundary_edges(mesh)
        length = np.hypot(*(mesh.points[edges[:, 0]] - mesh.points[edges[:, 1]]).T).sum()
        assert length == pytest.approx(4.0 + 2 * cracks.lengths.sum(), abs=1e-9)


def test_narrow_places_have_the_size_of_their_distance():
    """A tip above the middle of a line; lines that meet are no narrow place."""
    lines = np.array([[[0.0, 0.0], [1.0, 0.0]], [[0.5, 0.01], [0.5, 1.0]], [[1.0, 0.0], [1.0, 0.001]]])
    points, sizes = narrow_places(lines, 10.0, 0.2, 1000)
    distance = np.where(points[:, 1] == 0.0, np.hypot(points[:, 0] - 0.5, 0.01), points[:, 1])
    assert len(points) >= 3 and np.all(sizes < 0.2) and sizes.min() == pytest.approx(0.1, rel=0.1)
    assert np.all(sizes <= 10.0 * distance * (1 + 1e-12)) and np.abs(points[:, 0] - 0.5).max() < 0.1
    # Nothing near, nothing to do; many places are bounded in number.
    assert not len(narrow_places(lines[:1], 10.0, 0.2, 1000)[0])
    close = np.array([[[0.0, 0.0], [1.0, 0.0]], [[0.0, 1e-6], [1.0, 1e-6]]])
    points, sizes = narrow_places(close, 10.0, 0.2, 100)
    assert 20 < len(points) <= 100 and np.ptp(sizes) == 0.0
