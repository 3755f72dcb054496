"""Outlines that cross themselves are found, others are left alone."""

from __future__ import annotations

import numpy as np
import pytest

from geomech.model import Blocks
from geomech.model.polygon import crossing_edges

STAR = np.array([[np.cos(a), np.sin(a)] for a in np.pi / 2 + 4 * np.pi / 5 * np.arange(5)])


@pytest.mark.parametrize(
    ("loop", "edges"),
    [
        ([[0, 0], [1, 1], [1, 0], [0, 1]], (0, 2)),  # a bow
        (STAR, (0, 2)),  # turns one way only, but twice round
        ([[0, 0], [4, 0], [4, 1], [2, 0], [0, 1]], (0, 2)),  # a corner on an edge
        ([[0, 0], [3, 0], [1, 0], [1, 2]], (0, 1)),  # folded back on itself
        ([[0, 0], [2, 0], [2, 1], [1, 1], [1, 0], [1.5, 0], [1.5, -1], [0, -1]], (0, 3)),  # along another edge
    ],
)
@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_crossing_outlines_are_refused(loop, edges, offset):
    loop = np.asarray(loop, dtype=float) + offset
    assert crossing_edges(loop) == edges
    with pytest.raises(ValueError, match="rock: the edges from vertex"):
        Blocks.from_polygons([loop], names=["rock"])


@pytest.mark.parametrize(
    "loop",
    [
        [[0, 0], [1, 0], [2, 0], [2, 1], [0, 1]],  # a flat node
        [[0, 0], [4, 0], [4, 1], [1, 1], [1, 3], [0, 3]],  # re-entrant
        [[0, 0], [1, 0], [1, 1e-6], [0.5, 2e-6], [0, 1e-6]],  # a sliver
        [[0, 0], [3, 0], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]],  # a U
    ],
)
@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_simple_outlines_pass(loop, turn):
    c, s = np.cos(turn), np.sin(turn)
    loop = np.asarray(loop, dtype=float) @ np.array([[c, s], [-s, c]])
    assert crossing_edges(loop) is None
    assert crossing_edges(loop[::-1]) is None


def test_random_star_shaped_outlines_are_simple():
    rng = np.random.default_rng(3)
    for _ in range(200):
        n = rng.integers(4, 30)
        angle = 2 * np.pi * (np.arange(n) + 0.9 * rng.random(n)) / n
        loop = (0.2 + rng.random(n))[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        assert crossing_edges(loop) is None


def test_a_hole_outside_its_outline_is_refused():
    square = np.array([[0, 0], [4, 0], [4, 4], [0, 4.0]])
    Blocks.from_polygons([[square, 1 + square / 4]])
    with pytest.raises(ValueError, match=r"block 0: a hole reaches out of the outline at \(5, 3\)"):
        Blocks.from_polygons([[square, 3 + square / 2]])
