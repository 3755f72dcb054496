"""Polygon integrals against rational values worked out by hand, Shapely, and brute-force subdivision."""

from __future__ import annotations

import numpy as np
import pytest

from geomech import dda
from geomech.dda.kinematics.simplex_integration import fastest_vertex
from geomech.model import Blocks


def moments(blocks: Blocks, shift=(0.0, 0.0)) -> np.ndarray:
    return dda.block_moments(blocks.vertices + np.asarray(shift), blocks.next_vertex, blocks.vertex_start)


def test_rectangle_and_triangle_have_their_textbook_moments():
    blocks = Blocks.from_polygons([np.array([[0, 0], [4, 0], [4, 2], [0, 2.0]]), np.array([[0, 0], [3, 0], [0, 6.0]])])
    # b h, b³h/12, bh³/12, 0; for the right triangle bh/2, b³h/36, bh³/36, −b²h²/72.
    expected = [[8, 2, 1, 4**3 * 2 / 12, 4 * 2**3 / 12, 0], [9, 1, 2, 27 * 6 / 36, 3 * 216 / 36, -9 * 36 / 72]]
    assert moments(blocks) == pytest.approx(np.array(expected), rel=1e-14, abs=1e-14)


def test_the_fastest_vertex_is_that_of_the_unknowns_rates():
    blocks = Blocks.from_polygons([np.array([[0, 0], [4, 0], [4, 2], [0, 2.0]]) + [6.0 * k, k] for k in range(5)])
    m = moments(blocks)
    rates = np.random.default_rng(2).normal(size=(5, 6))
    rates[3] = 0.0
    v = [
        np.linalg.norm(dda.displacement_matrix(vertex, m[b, 1:3]) @ rates[b])
        for b, vertex in zip(blocks.vertex_block, blocks.vertices)
    ]
    found = fastest_vertex(rates, blocks.vertices, blocks.vertex_start, m)
    assert found == pytest.approx(max(v), rel=1e-14)
    assert fastest_vertex(0 * rates, blocks.vertices, blocks.vertex_start, m) == 0.0


def test_a_hole_is_taken_out():
    outer = np.array([[0, 0], [4, 0], [4, 4], [0, 4.0]])
    hole = np.array([[1, 1], [2, 1], [2, 2], [1, 2.0]])
    found = moments(Blocks.from_polygons([[outer, hole]]))[0]
    centre = (16 * 2 - 1.5) / 15
    second = 4**4 / 12 + 16 * (2 - centre) ** 2 - (1 / 12 + (1.5 - centre) ** 2)
    product = 16 * (2 - centre) ** 2 - (1.5 - centre) ** 2
    assert found == pytest.approx([15, centre, centre, second, second, product], rel=1e-13)


def test_digits_survive_far_from_the_origin():
    # A block 10 km away in coordinates with 1e-12 m of round-off: second moments of a 1 m block keep 1e-11.
    blocks = Blocks.from_polygons([np.array([[0, 0], [1, 0.25], [1.25, 1], [0.125, 0.75]])])
    near, far = moments(blocks)[0], moments(blocks, (8192.0, -16384.0))[0]
    assert far[[0, 3, 4, 5]] == pytest.approx(near[[0, 3, 4, 5]], rel=1e-11)


def test_mass_matrix_is_the_integral_of_the_displacement_matrix():
    polygon = np.array([[0, 0], [2, 0.5], [1.5, 2], [0.25, 1.0]])
    row = moments(Blocks.from_polygons([polygon]))[0]
    # Exact quadrature: edge-midpoint rule (degree 2) on the fan of triangles about the centroid.
    total = np.zeros((6, 6))
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        c = row[1:3]
        area = 0.5 * ((a - c)[0] * (b - c)[1] - (a - c)[1] * (b - c)[0])
        t = dda.displacement_matrix(np.array([(a + b) / 2, (b + c) / 2, (c + a) / 2]), c)
        total += area / 3 * np.einsum("pki,pkj->ij", t, t)
    assert dda.mass_matrix(row, 2600.0) == pytest.approx(2600.0 * total, rel=1e-13, abs=1e-9)
