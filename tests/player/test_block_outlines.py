"""Outlines from triangles, and the lines that stand for joints."""

from __future__ import annotations

import itertools

import numpy as np

from geomech.player.block_outlines import free_edges, joint_faces, outlines


def area(points: np.ndarray) -> float:
    x, y = points.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def test_a_square_with_a_hole_has_two_outlines():
    import shapely

    outer, hole = [(0, 0), (4, 0), (4, 4), (0, 4)], [(1, 1), (1, 3), (3, 3), (3, 1)]
    points = np.array(outer + hole, float)
    parts = shapely.constrained_delaunay_triangles(shapely.Polygon(outer, [hole])).geoms
    index = {tuple(p): k for k, p in enumerate(points.tolist())}
    triangles = np.array(
        [[index[p] for p in shapely.geometry.polygon.orient(part).exterior.coords[:3]] for part in parts]
    )
    corners, starts = outlines(triangles)
    areas = sorted(area(points[corners[a:b]]) for a, b in itertools.pairwise(starts))
    assert areas == [-4.0, 16.0]
    assert len(free_edges(triangles)) == 8


def test_a_joint_is_drawn_along_one_of_its_blocks():
    # Block 0 with both its corners on block 1, and one corner of block 1 between them; a lone corner of block 2.
    points = np.array([[0.0, 0.0], [2.0, 0.0], [1.0, 1e-6], [5.0, 5.0]])
    owner, other = np.array([0, 0, 1, 2]), np.array([1, 1, 0, 3])
    assert joint_faces(points, owner, other).tolist() == [[0, 1]]


def test_where_each_block_has_one_corner_they_are_joined():
    points = np.array([[1.0, 0.0], [0.0, 0.0]])
    found = joint_faces(points, np.array([0, 1]), np.array([1, 0]))
    assert sorted(found[0].tolist()) == [0, 1]
    assert joint_faces(np.empty((0, 2)), np.empty(0, int), np.empty(0, int)).shape == (0, 2)
