"""Outlines that cross themselves are found, others are left alone."""

from __future__ import annotations

import numpy as np
import pytest

from geomech.model import Blocks
from geomech.model.blocks.polygon import crossing_edges

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


def turned(loop, seed: int, offset: float = 0.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0, 2 * np.pi)
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(loop, dtype=float) @ np.array([[c, s], [-s, c]]) + offset * rng.uniform(-1, 1, 2)


#: With two edges in one line: what round-off says of their sides changes from one rotation to the next.
IN_ONE_LINE = [
    [[0, 0], [3, 0], [3, 1], [1, 1], [1, 2], [3, 2], [3, 3], [0, 3]],  # a C
    [[0, 0], [5, 0], [5, 3], [4, 3], [4, 1], [3, 1], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]],  # a comb
    [[0, 0], [1, 0.3], [2, 0], [3, 0.3], [4, 0], [4, 2], [0, 2]],  # corners in one line
    [[0, 0], [1, 0], [2, 0], [3, 0], [3, 1], [2, 1], [1, 1], [0, 1]],  # flat nodes
    [[0.1, 0.7], [10.3, 1.9], [10.3, 4.4], [5.7, 3.1], [5.7, 7.7], [10.3, 7.7], [10.3, 9.1], [0.1, 9.1]],
]


@pytest.mark.parametrize("loop", IN_ONE_LINE)
@pytest.mark.parametrize("offset", [0.0, 1e5])
def test_edges_in_one_line_meet_nowhere_at_any_rotation(loop, offset):
    for seed in range(300):
        own = turned(loop, seed, offset)
        assert crossing_edges(own) is None
        assert crossing_edges(own[::-1]) is None


@pytest.mark.parametrize(
    "loop",
    [
        [[0, 0], [1, 1], [1, 0], [0, 1]],  # a bow
        [[0, 0], [4, 0], [4, 1], [2, 0], [0, 1]],  # a corner on an edge
        [[0, 0], [3, 0], [1, 0], [1, 2]],  # folded back on itself
        [[0, 0], [2, 0], [2, 1], [1, 1], [1, 0], [1.5, 0], [1.5, -1], [0, -1]],  # along another edge
        [[0, 0], [4, 0], [4, 2], [2, 0], [2, 3], [0, 3]],  # a corner on the middle of an edge
    ],
)
@pytest.mark.parametrize("offset", [0.0, 1e5])
def test_crossing_outlines_are_refused_at_any_rotation(loop, offset):
    for seed in range(100):
        assert crossing_edges(turned(loop, seed, offset)) is not None


def test_blocks_with_holes_stand_at_any_rotation():
    """A hole whose edges are in line with those of the outline and of another hole, and one that touches the outline at
    a corner."""
    outline = [[0, 0], [6, 0], [6, 2], [4, 2], [4, 4], [6, 4], [6, 6], [0, 6]]
    holes = [[1, 1], [1, 2], [2, 2], [2, 1]], [[1, 4], [1, 5], [2, 5], [2, 4]], [[4, 3], [3, 2.5], [3, 3.5]]
    for seed in range(100):
        blocks = Blocks.from_polygons([[turned(loop, seed, 100.0) for loop in (outline, *holes)]])
        assert blocks.areas()[0] == pytest.approx(32 - 1 - 1 - 0.5, rel=1e-9)


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
