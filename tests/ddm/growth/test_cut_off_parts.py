"""Cracks that cut a part off: a chip of a wall, or a piece inside the rock."""

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.growth.cut_off_parts import cutting_segments
from geomech.model import Cracks, DdmSettings, Material

ROCK = Material("rock", 40e9, 0.25, 2600.0)
ANGLE = 2 * np.pi * (np.arange(24) + 0.5) / 24
HOLE = np.column_stack([np.cos(ANGLE), np.sin(ANGLE)])
WALL = np.cos(np.pi / 24)


def cutting(*lines, mouths=None, join: bool = False) -> list[bool]:
    cracks = Cracks.from_polylines([np.array(line) for line in lines], surface=mouths, join=join)
    return cutting_segments(ddm.Body([], cracks, ROCK, DdmSettings(), holes=[HOLE])).tolist()


def test_a_chip_of_the_wall():
    assert cutting([(-0.1, WALL), (0.0, WALL + 0.1), (0.1, WALL)], mouths=[(True, True)]) == [True, True]


@pytest.mark.parametrize("end", [(0.1, WALL + 0.03), (0.2, WALL + 0.3)])
def test_a_crack_that_ends_in_the_rock_cuts_nothing_off(end):
    assert cutting([(-0.1, WALL), (0.0, WALL + 0.1), end], mouths=[(True, False)]) == [False, False]


def test_a_piece_inside_the_rock_and_a_branch_of_its_crack():
    corners = [(2.0, 0.0), (3.0, 0.0), (3.0, 1.0), (2.0, 1.0), (2.0, 0.0)]
    assert cutting(corners, [(3.0, 1.0), (3.5, 1.5)], join=True) == [True, True, True, True, False]
