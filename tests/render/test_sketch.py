"""The drawing of blocks and cracks in axes of one's own."""

import numpy as np
import pytest

from geomech.model import Blocks, Cracks, State
from geomech.model.state import Cycle
from geomech.render import sketch

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def cycle_of(turn=0.0, removed=None):
    """A fixed block, and beside it one with a hole and a crack, turned by ``turn`` rad about the origin."""
    hole = 0.2 * SQUARE[::-1] + [2.4, 0.4]
    blocks = Blocks.from_polygons([SQUARE, [SQUARE + [2.0, 0.0], hole]], fixed=[True, False])
    cracks = Cracks.from_polylines([np.array([[2.1, 0.2], [2.3, 0.9]])], block=1)
    state = State.at_rest(blocks)
    c, s = np.cos(turn), np.sin(turn)
    moved = blocks.vertices.copy()
    own = blocks.vertex_block == 1
    moved[own] = moved[own] @ np.array([[c, s], [-s, c]])
    state = State(**{**vars(state), "vertices": moved, "removed": removed})
    return Cycle(0, 0, 0, 0.0, np.nan, blocks, state, cracks, np.empty(0))


def drawn(axes):
    outlines, lines = axes.collections
    return outlines.get_paths(), np.array(lines.get_segments())


def test_blocks_cracks_and_holes_are_where_they_are():
    turn = 0.3
    paths, cracks = drawn(sketch(cycle_of(turn)))
    assert len(paths) == 2
    # Two closed loops of four corners.
    assert len(paths[1].vertices) == 10
    c, s = np.cos(turn), np.sin(turn)
    np.testing.assert_allclose(paths[1].vertices[1], [3 * c, 3 * s], atol=1e-12)
    np.testing.assert_allclose(cracks[0], np.array([[2.1, 0.2], [2.3, 0.9]]) @ np.array([[c, s], [-s, c]]), atol=1e-12)


def test_displacements_are_drawn_larger():
    paths, cracks = drawn(sketch(cycle_of(1e-3), magnify=100))
    # To first order in the turn: 100 × 1e-3 × (−y, x).
    np.testing.assert_allclose(paths[1].vertices[1], [3.0, 0.3], atol=2e-4)
    np.testing.assert_allclose(cracks[0][0], [2.1 - 0.02, 0.2 + 0.21], atol=2e-4)


def test_what_is_dug_out_is_not_drawn_and_values_must_fit():
    gone = np.array([False, True])
    axes = sketch(cycle_of(removed=gone), values=[1.0, 2.0], label="m")
    outlines = axes.collections[0]
    assert len(outlines.get_paths()) == 1 and outlines.get_array().tolist() == [1.0]
    with pytest.raises(ValueError, match="2 blocks, but 1 values"):
        sketch(cycle_of(), values=[1.0])
