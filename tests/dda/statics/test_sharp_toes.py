"""Toes: which corners bar a block's way along a face, and by how much they stand off once rounded."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geomech import dda
from geomech.dda.statics.sharp_toes import FREE, ROUNDED, SHARP
from geomech.model import Blocks, DdaSettings, JointLaw, Material, State


def system_of(polygons, toes: str, rounding: float = 0.01) -> dda.BlockSystem:
    blocks = Blocks.from_polygons(
        [np.asarray(p, float) for p in polygons], fixed=[True] + [False] * (len(polygons) - 1)
    )
    system = dda.BlockSystem(
        blocks, [Material("rock", 10e9, 0.25, density=2600.0)], [JointLaw("joint", 0.5)],
        settings=DdaSettings(corner_rounding=rounding),
    )  # fmt: skip
    system.finder.toes = toes
    return system


def lifts(system: dda.BlockSystem) -> np.ndarray:
    return system.contacts_near(State.at_rest(system.blocks)).lift


#: A block on a plane at 35° that ends in a level floor; its face rises at 60° from the toe.
SLOPE = [
    [(-8, 0), (-8, -4), (20, -4), (20, 8 * math.tan(math.radians(35))), (8, 8 * math.tan(math.radians(35))), (0, 0)],
    [(0, 0), (8, 8 * math.tan(math.radians(35))), (5, 5 * math.tan(math.radians(60)))],
]


def test_the_circle_that_rounds_a_toe_stands_off_the_floor():
    """A circle that touches both edges at ρ from the tip has its lowest point ρ (b·n/cos α − tan α) above the tip: here
    by its centre and radius."""
    system = system_of(SLOPE, ROUNDED)
    found = lifts(system)
    assert (found != 0.0).sum() == 1
    rho = float(system.finder.rounding[system.blocks.vertex_start[1]])
    assert rho == pytest.approx(0.01 * math.sqrt(system.blocks.areas()[1]))
    half, middle = math.radians(12.5), math.radians(47.5)
    radius, centre = rho * math.tan(half), rho / math.cos(half)
    assert found.min() == pytest.approx(-(centre * math.sin(middle) - radius), rel=1e-9)


@pytest.mark.parametrize(("toes", "rounding", "expected"), [(SHARP, 0.01, 0.0), (ROUNDED, 0.0, 0.0), (FREE, 0.0, 0.02)])
def test_toes_hold_where_they_are_sharp_and_never_where_they_are_free(toes, rounding, expected):
    system = system_of(SLOPE, toes, rounding)
    assert lifts(system).min() == pytest.approx(-expected * math.sqrt(system.blocks.areas()[1]))


def test_faces_and_corners_of_walls_are_no_toes():
    """Corners of bricks that lie on faces, in bond and in stacks, and the foot of a column that leans on a wall."""
    wall = [[(-1, -1), (5, -1), (5, 0), (-1, 0)]]
    for course in range(3):
        shift = 0.5 * (course % 2)
        wall += [[(x + shift, course), (x + 1 + shift, course), (x + 1 + shift, course + 1), (x + shift, course + 1)]
                 for x in range(3)]  # fmt: skip
    stack = wall[:1] + [[(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)] for x in range(3) for y in range(3)]
    notch = [[(-2, -1), (4, -1), (4, 0), (0, 0), (0, 3), (-2, 3)], [(0, 0), (1, 0), (1, 2), (0, 2)]]
    for polygons in (wall, stack, notch):
        assert not lifts(system_of(polygons, ROUNDED)).any()
        assert not lifts(system_of(polygons, FREE)).any()
