"""Blocks that overlap as they are drawn are named, however they do it; blocks that touch are not."""

from __future__ import annotations

import pytest
from block_problems import rectangle

from geomech.dda.contact_detection.initial_overlap import refuse_overlap
from geomech.dda.kinematics.simplex_integration import block_moments
from geomech.model import Blocks


def look(*polygons):
    blocks = Blocks.from_polygons(polygons, names=[f"b{k}" for k in range(len(polygons))])
    refuse_overlap(blocks, blocks.vertices, block_moments(blocks.vertices, blocks.next_vertex, blocks.vertex_start))


@pytest.mark.parametrize(
    "other",
    [
        rectangle(0.9, 0.9, 2, 2),  # corner in corner
        rectangle(0.2, 0.2, 0.4, 0.4),  # one within the other
        rectangle(0, 0, 1, 1),  # drawn twice
        rectangle(-1, 0.4, 2, 0.6),  # crossed bars
        rectangle(0.5, 0, 1.5, 1),  # shifted along: corners on each other's sides
    ],
)
def test_overlap_is_refused_by_name(other):
    with pytest.raises(ValueError, match="'b0' and 'b1' overlap by"):
        look(rectangle(0, 0, 1, 1), other)


def test_touching_blocks_and_blocks_in_holes_pass(caplog):
    ring = [rectangle(0, 0, 3, 3), rectangle(1, 1, 2, 2)]
    look([rectangle(0, 0, 1, 1)], [rectangle(1, 0, 2, 1)], [rectangle(0, 1, 2, 2)])
    look(ring, [rectangle(1, 1, 2, 2)])
    # Round-off of coordinates far away is no overlap.
    look([rectangle(0, 0, 0.1, 0.1) + 1e6], [rectangle(0.1, 0, 0.3, 0.1) + 1e6])
    assert not caplog.records


def test_a_small_overlap_is_reported(caplog):
    look(rectangle(0, 0, 1, 1), rectangle(0, 1 - 1e-4, 1, 2))
    assert "overlap by 0.0001 m" in caplog.text
