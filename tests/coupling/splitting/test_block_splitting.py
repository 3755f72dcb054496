"""Blocks cut by cracks: conservation against polygon integrals done here by triangles, geometry against Shapely."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
import shapely.ops

from geomech.coupling.load_transfer.elastic_bodies import inherited
from geomech.coupling.splitting.block_splitting import split_blocks
from geomech.ddm.crack_contact.face_laws import FaceMemory
from geomech.ddm.growth.tip_advance import advance
from geomech.ddm.system.influence_matrix import ElementSet
from geomech.model import AUTO_ORDER, CONTACT, OPEN, STICK, TIP, Blocks, Cracks, GrowthSettings, State

DENSITY = 2700.0
SQUARE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]])
NAMED = [["base", "right", "load:top", ""]]
HOLE = np.array([[1.5, 1.0], [1.5, 2.0], [2.5, 2.0], [2.5, 1.0]])  # clockwise


def network(nodes, segments, *, crack=None, block=0, surface=(), names=None):
    """A crack network written down node by node."""
    segments = np.asarray(segments)
    n = len(segments)
    crack = np.zeros(n, int) if crack is None else np.asarray(crack)
    mouths = np.zeros(len(nodes), bool)
    mouths[list(surface)] = True
    return Cracks(
        nodes=np.asarray(nodes, dtype=float),
        segments=segments,
        crack=crack,
        block=np.broadcast_to(np.asarray(block), (n,)).copy(),
        birth_cycle=np.arange(n),
        aperture=np.linspace(0, 1e-3, n),
        surface=mouths,
        names=names or tuple(f"flaw{k}" for k in range(crack.max() + 1)),
        law=np.arange(n) % 3,
    )


def moving(blocks, seed=3):
    """A state in full motion: every block under an affine map, with velocity, stress and strain."""
    rng = np.random.default_rng(seed)
    n = blocks.n_blocks
    vertices = np.empty_like(blocks.vertices)
    for b in range(n):
        own = blocks.vertex_block == b
        turn, strain = rng.uniform(-0.3, 0.3), rng.normal(0, 1e-3, (2, 2))
        rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
        vertices[own] = rng.normal(0, 5, 2) + blocks.vertices[own] @ (rotation @ (np.eye(2) + strain)).T
    return State(
        time=2.5,
        vertices=vertices,
        velocity=rng.normal(size=(n, 6)),
        stress=rng.normal(size=(n, 3)) * 1e6,
        rotation=rng.normal(size=n),
        crack_strain=rng.normal(size=(n, 3)) * 1e-4,
        contacts=np.empty(0, CONTACT),
    )


def totals(blocks, state):
    """(mass, momentum x and y, angular momentum about the origin, kinetic energy) of the first-order velocity fields.

    Every block is cut into triangles by Shapely; a quadratic integrand over a triangle is exact from the midpoints of
    its sides (Strang & Fix 1973). The centroid comes from the triangles too.
    """
    sums = np.zeros(5)
    for b in range(blocks.n_blocks):
        loops = blocks.loops(b, state.vertices)
        parts = shapely.get_parts(shapely.constrained_delaunay_triangles(shapely.Polygon(loops[0], loops[1:])))
        corners = np.array([shapely.get_coordinates(t)[:3] for t in parts])
        d, e = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area = np.abs(d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0]) / 2
        centre = area @ corners.mean(axis=1) / area.sum()
        points = (corners + np.roll(corners, -1, axis=1)) / 2
        x, y = np.moveaxis(points - centre, -1, 0)
        u0, v0, r, ex, ey, g = state.velocity[b]
        u, v = u0 - r * y + ex * x + g / 2 * y, v0 + r * x + g / 2 * x + ey * y
        weight = DENSITY * area[:, None] / 3 * np.ones(3)
        spin = points[..., 0] * v - points[..., 1] * u
        sums += [(weight * f).sum() for f in (np.ones_like(u), u, v, spin, (u * u + v * v) / 2)]
    return sums


def assert_conserved(blocks, state, split):
    """Mass, momentum, angular momentum and kinetic energy to round-off; areas, vertices and mouths in order."""
    before, after = totals(blocks, state), totals(split.blocks, split.state)
    scale = np.abs(before).max()
    np.testing.assert_allclose(after, before, rtol=1e-12, atol=1e-13 * scale)
    parts = np.bincount(split.parent, weights=split.blocks.areas(), minlength=blocks.n_blocks)
    np.testing.assert_allclose(parts, blocks.areas(), atol=1e-14 * blocks.areas().max())
    assert (split.blocks.areas() > 0).all()
    assert (np.diff(split.parent) >= 0).all()
    # The children tile the parent.
    for b in range(blocks.n_blocks):
        whole = shapely.Polygon(blocks.loops(b)[0], blocks.loops(b)[1:])
        parts = [split.blocks.loops(c) for c in np.flatnonzero(split.parent == b)]
        parts = [shapely.Polygon(p[0], p[1:]) for p in parts]
        assert all(part.is_valid for part in parts)
        assert shapely.union_all(parts).symmetric_difference(whole).area < 1e-14 * whole.area
    # Old vertices to the last bit, reference and current together.
    old = {(b, r.tobytes()): c.tobytes() for b, r, c in zip(blocks.vertex_block, blocks.vertices, state.vertices)}
    kept = 0
    came_from = split.parent[split.blocks.vertex_block]
    for b, r, c in zip(came_from, split.blocks.vertices, split.state.vertices):
        if (b, r.tobytes()) in old:
            kept += 1
            assert c.tobytes() == old[b, r.tobytes()]
    assert kept >= blocks.n_vertices
    # Cracks lie in their block, their mouths on its boundary.
    cracks = split.cracks
    for s in range(cracks.n_segments):
        loops = split.blocks.loops(int(cracks.block[s]))
        rock = shapely.Polygon(loops[0], loops[1:])
        assert rock.buffer(1e-12).contains(shapely.LineString(cracks.nodes[cracks.segments[s]]))
        for n in cracks.segments[s]:
            on_edge = rock.boundary.distance(shapely.Point(cracks.nodes[n])) < 1e-12
            assert on_edge == cracks.surface[n]


def edge_names_of(blocks, block):
    own = blocks.vertex_block == block
    return [blocks.edge_names[k] for k in blocks.edge_name[own]]


def test_nothing_to_split():
    blocks = Blocks.from_polygons([SQUARE])
    state = State.at_rest(blocks)
    assert split_blocks(blocks, state, Cracks.from_polylines([])) is None
    dangling = network([[2, 0], [2, 1], [1, 2]], [[0, 1], [1, 2]], surface=[0])
    assert split_blocks(blocks, state, dangling) is None


def test_straight_cut_names_and_coordinates():
    blocks = Blocks.from_polygons([SQUARE], edge_names=[NAMED], names=["specimen"], material=[2])
    state = moving(blocks)
    cracks = network([[1.0, 0], [1.5, 1.5], [2, 3]], [[0, 1], [1, 2]], surface=[0, 2])
    split = split_blocks(blocks, state, cracks)
    assert split.parent.tolist() == [0, 0]
    assert split.blocks.names == ("specimen/1", "specimen/2")
    assert split.blocks.material.tolist() == [2, 2]
    assert edge_names_of(split.blocks, 0) == ["base", "crack:flaw0", "crack:flaw0", "load:top", ""]
    assert edge_names_of(split.blocks, 1) == ["right", "load:top", "crack:flaw0", "crack:flaw0", "base"]
    np.testing.assert_array_equal(split.blocks.loops(0)[0], [[0, 0], [1, 0], [1.5, 1.5], [2, 3], [0, 3]])
    assert split.cracks.n_segments == 0 and split.cracks.names == cracks.names
    assert (split.state.crack_strain == 0).all()  # whole blocks again
    np.testing.assert_array_equal(split.state.stress, state.stress[[0, 0]])
    np.testing.assert_array_equal(split.state.rotation, state.rotation[[0, 0]])
    assert_conserved(blocks, state, split)


def test_new_vertices_follow_the_parents_affine_motion():
    blocks = Blocks.from_polygons([SQUARE])
    state = moving(blocks)
    split = split_blocks(blocks, state, network([[1, 0], [2, 3]], [[0, 1]], surface=[0, 1]))
    # (1, 0) is a quarter along the bottom edge, (2, 3) half along the top one: affine maps keep proportions.
    expected = [
        0.75 * state.vertices[0] + 0.25 * state.vertices[1],
        0.5 * (state.vertices[2] + state.vertices[3]),
    ]
    np.testing.assert_allclose(split.state.vertices[[1, 2]], expected, atol=1e-14)


def test_concave_block():
    outline = np.array([[0, 0], [6, 0], [6, 4], [4, 4], [4, 1], [2, 1], [2, 4], [0, 4]], dtype=float)
    blocks = Blocks.from_polygons([outline])
    state = moving(blocks)
    cracks = network([[3, 0], [3, 1], [0, 2.5], [2, 2.7]], [[0, 1], [2, 3]], crack=[0, 1], surface=[0, 1, 2, 3])
    split = split_blocks(blocks, state, cracks)
    assert split.blocks.n_blocks == 3
    assert_conserved(blocks, state, split)


def test_cut_through_a_reentrant_corner_uses_its_vertex():
    outline = np.array([[0, 0], [4, 0], [4, 4], [2, 2], [0, 4]], dtype=float)
    blocks = Blocks.from_polygons([outline])
    state = moving(blocks)
    off = 2 + 4e-16  # a mouth that is the corner but for round-off
    split = split_blocks(blocks, state, network([[2, 0], [2, off]], [[0, 1]], surface=[0, 1]))
    assert split.blocks.n_blocks == 2 and split.blocks.n_vertices == 5 + 3
    assert_conserved(blocks, state, split)


@pytest.mark.parametrize("side", ["one", "both"])
def test_block_with_a_hole(side):
    """From outline to hole once does not divide; on both sides it does, and the hole becomes outline."""
    blocks = Blocks.from_polygons([[SQUARE, HOLE]], edge_names=[[*NAMED, ["hole"] * 4]])
    state = moving(blocks)
    nodes = [[0, 1.5], [1.5, 1.5], [2.5, 1.2], [4, 1.0]]
    segments = [[0, 1]] if side == "one" else [[0, 1], [2, 3]]
    split = split_blocks(blocks, state, network(nodes, segments, surface=range(4)))
    if side == "one":
        assert split is None
        return
    assert split.blocks.n_blocks == 2 and len(split.blocks.loop_start) == 3
    assert edge_names_of(split.blocks, 0).count("hole") == 3 and edge_names_of(split.blocks, 1).count("hole") == 3
    assert_conserved(blocks, state, split)


def test_a_cut_beside_a_hole_leaves_it_in_its_child():
    blocks = Blocks.from_polygons([[SQUARE, HOLE]])
    state = moving(blocks)
    split = split_blocks(blocks, state, network([[1, 0], [1, 3]], [[0, 1]], surface=[0, 1]))
    assert np.diff(split.blocks.block_loop).tolist() == [1, 2]
    assert_conserved(blocks, state, split)


def test_loop_inside_makes_an_island():
    blocks = Blocks.from_polygons([SQUARE], names=["rock"])
    state = moving(blocks)
    loop = network([[1, 1], [3, 1.2], [2, 2]], [[0, 1], [1, 2], [2, 0]])
    split = split_blocks(blocks, state, loop)
    assert np.diff(split.blocks.block_loop).tolist() == [2, 1]
    assert split.blocks.areas()[1] == pytest.approx(0.9, rel=1e-14)
    assert_conserved(blocks, state, split)


@pytest.mark.parametrize(("given", "present"), [(3, None), (AUTO_ORDER, 1), (AUTO_ORDER, 4)])
def test_a_part_with_a_hole_keeps_its_order(given, present):
    """Around an island."""
    blocks = Blocks.from_polygons([SQUARE], names=["rock"], order=[given])
    state = replace(moving(blocks), order=None if present is None else np.array([present]))
    loop = network([[1, 1], [3, 1.2], [2, 2]], [[0, 1], [1, 2], [2, 0]])
    split = split_blocks(blocks, state, loop)
    assert split.blocks.order.tolist() == [given, given]
    assert (None if split.state.order is None else split.state.order.tolist()) == (present and [present, present])


def test_two_cuts_and_a_cross_at_once():
    blocks = Blocks.from_polygons([SQUARE])
    state = moving(blocks)
    nodes = [[2, 0], [2, 1.5], [2, 3], [0, 1.5], [4, 1.5]]
    cracks = network(nodes, [[0, 1], [1, 2], [3, 1], [1, 4]], crack=[0, 0, 1, 1], surface=[0, 2, 3, 4])
    split = split_blocks(blocks, state, cracks)
    assert split.blocks.n_blocks == 4
    np.testing.assert_allclose(split.blocks.areas(), 3.0, rtol=1e-15)
    assert sum(name == "crack:flaw1" for b in range(4) for name in edge_names_of(split.blocks, b)) == 4
    assert_conserved(blocks, state, split)


def test_dangling_cracks_go_to_their_child():
    """A cut with one branch into each side from the same node, a mouth crack that ends inside, and one crack apart."""
    blocks = Blocks.from_polygons([SQUARE])
    state = moving(blocks)
    nodes = [[2, 0], [2, 1.5], [2, 3], [1.2, 1.8], [2.9, 1.1], [0, 0.5], [0.4, 0.6], [3, 2], [3.5, 2.5]]
    segments = [[0, 1], [1, 2], [1, 3], [1, 4], [5, 6], [7, 8]]
    cracks = network(nodes, segments, crack=[0, 0, 1, 2, 3, 4], surface=[0, 2, 5])
    split = split_blocks(blocks, state, cracks)
    after = split.cracks
    assert after.block.tolist() == [0, 1, 0, 1] and after.crack.tolist() == [1, 2, 3, 4]
    assert after.birth_cycle.tolist() == [2, 3, 4, 5]
    np.testing.assert_array_equal(after.aperture, cracks.aperture[2:])
    np.testing.assert_array_equal(after.law, cracks.law[2:])
    assert len(after.nodes) == 8  # the node of the two branches is one for each child now
    assert after.surface.sum() == 3 and len(after.tips) == 5
    np.testing.assert_array_equal(split.state.crack_strain, state.crack_strain[[0, 0]])
    # The mouth of the crack that ends inside is no corner of its block.
    assert split.blocks.n_vertices == 4 + 6
    assert_conserved(blocks, state, split)


def test_work_done_by_friction_is_not_counted_twice():
    """Cracks on both sides of a cut remember what their parent's faces did; the sum of the work stays."""
    blocks = Blocks.from_polygons([SQUARE, SQUARE + 10])
    nodes = [[2, 0], [2, 3], [0.5, 1], [1.5, 1], [3, 2], [3.5, 2.5], [11, 11], [12, 12]]
    cracks = network(nodes, [[0, 1], [2, 3], [4, 5], [6, 7]], crack=[0, 1, 2, 3], block=[0, 0, 0, 1], surface=[0, 1])
    split = split_blocks(blocks, moving(blocks), cracks)
    faces = ElementSet(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, int), np.zeros(0, int), 4, "chebyshev")
    history = {b: replace(FaceMemory.none(faces), work=work) for b, work in ((0, 5.0), (1, 7.0))}
    after = inherited(history, split.parent, split.cracks)
    assert {b: memory.work for b, memory in after.items()} == {0: 5.0, 1: 0.0, 2: 7.0}
    assert all(memory.elements is faces for memory in after.values())


def test_other_blocks_are_left_as_they_are():
    blocks = Blocks.from_polygons(
        [SQUARE - 10, [SQUARE, HOLE], SQUARE + 10], names=["a", "b", "c"], fixed=[True, False, False]
    )
    state = moving(blocks)
    nodes = [[0.5, 0], [0.5, 3], [11, 11], [12, 12], [-9, -9], [-8, -8]]
    cracks = network(nodes, [[0, 1], [2, 3], [4, 5]], crack=[0, 1, 2], block=[1, 2, 0], surface=[0, 1])
    split = split_blocks(blocks, state, cracks)
    assert split.parent.tolist() == [0, 1, 1, 2]
    assert split.blocks.names == ("a", "b/1", "b/2", "c")
    assert split.blocks.fixed.tolist() == [True, False, False, False]
    assert split.cracks.block.tolist() == [3, 0]
    for old, new in ((0, 0), (2, 3)):
        for given, found in zip(blocks.loops(old), split.blocks.loops(new)):
            assert given.tobytes() == found.tobytes()
        np.testing.assert_array_equal(split.state.velocity[new], state.velocity[old])
        np.testing.assert_array_equal(split.state.crack_strain[new], state.crack_strain[old])
    assert_conserved(blocks, state, split)


def test_mean_stress_of_each_part():
    blocks = Blocks.from_polygons([SQUARE])
    state = moving(blocks)
    seen = []

    def stress(loops):
        seen.append(loops)
        return np.array([shapely.Polygon(loops[0]).area, 0.0, 1.0])

    cracks = network([[1, 0], [1, 3]], [[0, 1]], surface=[0, 1])
    split = split_blocks(blocks, state, cracks, {0: stress})
    np.testing.assert_allclose(split.state.stress, [[3, 0, 1], [9, 0, 1]])
    assert len(seen) == 2


def test_contacts_follow_their_vertices_and_edges():
    blocks = Blocks.from_polygons([SQUARE, SQUARE + [0.0, 3.0]])
    state = moving(blocks)
    contacts = np.zeros(4, CONTACT)
    # (block, vertex) on (other, edge): lower corners of the upper block on the top edge (3.0 m from x = 4 to x = 0).
    contacts["block"], contacts["other"] = [1, 1, 0, 0], [0, 0, 1, 1]
    contacts["vertex"], contacts["edge"] = [4, 5, 2, 3], [2, 2, 4, 4]
    contacts["position"] = [1.0, 0.0, 1.0, 0.0]
    contacts["state"], contacts["normal_force"] = [STICK, STICK, OPEN, STICK], [1.0, 2.0, 0.0, 4.0]
    state = State(**{**vars(state), "contacts": contacts})
    cracks = network([[1, 0], [1, 3]], [[0, 1]], surface=[0, 1])
    split = split_blocks(blocks, state, cracks)
    after, new = split.state.contacts, split.blocks
    assert len(after) == 4
    np.testing.assert_array_equal(after["normal_force"], contacts["normal_force"])
    before_points = blocks.vertices[contacts["vertex"]]
    np.testing.assert_array_equal(new.vertices[after["vertex"]], before_points)
    np.testing.assert_array_equal(new.vertex_block[after["vertex"]], after["block"])
    np.testing.assert_array_equal(new.vertex_block[after["edge"]], after["other"])
    a, b = new.vertices[after["edge"]], new.vertices[new.next_vertex[after["edge"]]]
    old_a = blocks.vertices[contacts["edge"]]
    old_b = blocks.vertices[blocks.next_vertex[contacts["edge"]]]
    touched = old_a + contacts["position"][:, None] * (old_b - old_a)
    np.testing.assert_allclose(a + after["position"][:, None] * (b - a), touched, atol=1e-14)
    assert after["other"].tolist() == [0, 1, 2, 2]


def test_contact_of_a_divided_vertex_is_dropped(caplog):
    blocks = Blocks.from_polygons([SQUARE, SQUARE + [0.0, 3.0]])
    contacts = np.zeros(1, CONTACT)
    contacts["block"], contacts["vertex"], contacts["other"], contacts["edge"] = 0, 2, 1, 4
    state = State(**{**vars(moving(blocks)), "contacts": contacts})
    with caplog.at_level("INFO"):
        split = split_blocks(blocks, state, network([[0, 0], [4, 3]], [[0, 1]], surface=[0, 1]))
    assert len(split.state.contacts) == 0 and "split between two blocks" in caplog.text
    assert_conserved(blocks, state, split)


def test_slivers_are_merged_along_their_longest_side():
    """Two cuts 1e-9 m apart: the strip between them goes to a neighbour, no area is lost."""
    blocks = Blocks.from_polygons([SQUARE])
    state = moving(blocks)
    gap = 1e-9
    cracks = network([[2, 0], [2, 3], [2 + gap, 0], [2 + gap, 3]], [[0, 1], [2, 3]], crack=[0, 1], surface=[0, 1, 2, 3])
    split = split_blocks(blocks, state, cracks)
    assert split.blocks.n_blocks == 2 and split.cracks.n_segments == 0
    np.testing.assert_allclose(split.blocks.areas(), 6.0, atol=1e-8)
    assert_conserved(blocks, state, split)


def test_a_mouth_off_the_boundary_is_refused():
    blocks = Blocks.from_polygons([SQUARE], names=["rock"])
    cracks = network([[1, 0.01], [1, 3]], [[0, 1]], surface=[0, 1])
    with pytest.raises(ValueError, match=r"flaw0.*off the boundary of rock"):
        split_blocks(blocks, State.at_rest(blocks), cracks)


@pytest.mark.parametrize("seed", range(20))
def test_random_line_cuts(seed):
    """Random straight cuts, noded by hand: as many pieces as Shapely cuts the polygon into, everything conserved."""
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * math.pi, 12))
    outline = np.column_stack([np.cos(angle), np.sin(angle)]) * rng.uniform(2, 4, (12, 1)) + 50.0
    polygon = shapely.Polygon(outline)
    if not polygon.is_valid:
        pytest.skip("the random outline crosses itself")
    blocks = Blocks.from_polygons([outline])
    state = moving(blocks, seed)
    far = 20 * np.array([np.cos(t := rng.uniform(0, math.pi, 4)), np.sin(t)]).T
    lines = [shapely.LineString([c - f, c + f]) for c, f in zip(rng.uniform(-1, 1, (4, 2)) + 50.0, far)]
    inside = shapely.node(shapely.intersection(shapely.MultiLineString(lines), polygon))
    nodes, segments = {}, []
    for part in shapely.get_parts(inside):
        for a, b in zip(part.coords[:-1], part.coords[1:]):
            segments.append([nodes.setdefault(a, len(nodes)), nodes.setdefault(b, len(nodes))])
    points = np.array(list(nodes))
    mouths = np.flatnonzero(shapely.distance(polygon.boundary, shapely.points(points)) < 1e-12)
    split = split_blocks(blocks, state, network(points, segments, surface=mouths))
    pieces = [polygon]
    for line in lines:
        pieces = [part for piece in pieces for part in shapely.ops.split(piece, line).geoms]
    expected = len(pieces)
    if split is None:
        assert expected == 1
        return
    assert split.blocks.n_blocks == expected
    assert_conserved(blocks, state, split)


@pytest.mark.parametrize("seed", range(8))
def test_growing_cracks_fragment_a_block(seed):
    """Cracks that wander through a block with a hole until little grows: after every split mass and momenta are the
    same, the pieces tile the block, and each piece can be cut on."""
    rng = np.random.default_rng(seed)
    outline = np.array([[0, 0], [10, 0], [10, 8], [6, 8], [5, 5], [4, 8], [0, 8.0]])
    hole = np.array([[4, 2], [6, 2], [6, 3], [4, 3.0]])
    blocks = Blocks.from_polygons([[outline, hole]])
    state = moving(blocks, seed)
    start = totals(blocks, state)
    lines = [[[0, 4], [1, 4.2]], [[2, 1], [3, 1.5]], [[8, 2], [8.5, 3]], [[7, 6], [8, 6.5]], [[2, 6], [2.5, 5]]]
    cracks = Cracks.from_polylines(lines, surface=[(k == 0, False) for k in range(5)])
    settings = GrowthSettings(increment=0.5, min_increment=0.1, join_distance=0.5)
    splits = 0
    for cycle in range(1, 60):
        tips = np.zeros(len(cracks.tips), TIP)
        tips["node"] = cracks.tips
        for tip in tips:
            row = int(np.argwhere(cracks.segments == tip["node"])[0, 0])
            far = cracks.segments[row].sum() - tip["node"]
            tip["crack"], tip["block"] = cracks.crack[row], cracks.block[row]
            tip["direction"] = (out := cracks.nodes[tip["node"]] - cracks.nodes[far]) / np.hypot(*out)
        tips["k_eq"], tips["angle"] = rng.uniform(0.5, 2, len(tips)), rng.normal(0, 0.3, len(tips)).clip(-1, 1)
        growth = advance(cracks, blocks.loops, tips, settings, np.ones(len(tips)), cycle)
        cracks = growth.cracks
        split = split_blocks(blocks, state, cracks)
        if split is not None:
            assert growth.joins, "a block fell apart though nothing joined"
            assert_conserved(blocks, state, split)
            blocks, state, cracks = split.blocks, split.state, split.cracks
            splits += 1
            assert split_blocks(blocks, state, cracks) is None
    assert splits >= 2
    np.testing.assert_allclose(totals(blocks, state), start, rtol=1e-11, atol=1e-12 * np.abs(start).max())


@pytest.mark.parametrize("off", [1e-15, 1e-12, -1e-12, 1e-9, -1e-9])
def test_a_mouth_a_hair_off_a_vertex_is_at_the_vertex(off):
    """No part gets an edge of that length, which no elastic body could have."""
    blocks = Blocks.from_polygons([SQUARE])
    end = SQUARE[2] * np.array([1.0, 1.0])
    cracks = network([[off, 0.0], end + [0.0, off]], [[0, 1]], surface=[0, 1])
    split = split_blocks(blocks, moving(blocks), cracks)
    assert [len(split.blocks.loops(b)[0]) for b in range(2)] == [3, 3]
