"""Lines that were digitised finer than elements are long: elements follow the line, not its vertices, and K stays."""

from __future__ import annotations

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.fracture.tip_factors import factors, largest
from geomech.ddm.mesh.crack_nodes import in_line
from geomech.ddm.mesh.elements import mesh
from geomech.ddm.mesh.grading import CURVED, KINK, Grading
from geomech.model import Cracks, DdmSettings, Material

ROCK = Material("rock", 1.0, 0.25)
PULL = ddm.BodyLoad(remote_stress=[1.0, 0.3, 0.2])
SHEARED = ddm.BodyLoad(remote_stress=[0.0, -1.0, 0.9])
CRACK = Cracks.from_polylines([np.array([[-0.3, -0.1], [0.3, 0.1]])], aperture=np.inf)


def digitised(sides: int, wave: float) -> np.ndarray:
    """A square of edge 2, each edge in so many ``sides`` with vertices off it by up to ``wave``; the same whatever
    ``sides``, of which there are points on one curve."""
    t = np.linspace(0, 1, sides + 1)[:-1]
    off = wave * (np.sin(3 * np.pi * t) + 0.5 * np.sin(7 * np.pi * t))
    edge, loop = np.column_stack([2 * t - 1, off - 1]), []
    for k in range(4):
        c, s = np.cos(0.5 * np.pi * k), np.sin(0.5 * np.pi * k)
        loop.append(edge @ np.array([[c, s], [-s, c]]))
    return np.concatenate(loop)


def test_elements_follow_the_line():
    """Four times as many vertices on one wavy square: one element a side where sides are shorter than elements are, and a few
    at the corners (two a side, 328, where each is taken for beside the next but one)."""
    settings = DdmSettings()
    numbers = [mesh([digitised(sides, 0.02)], CRACK, settings).boundary.n for sides in (10, 40)]
    assert numbers[0] < 80 and numbers[1] < 4 * 40 + 30


def test_a_crack_does_not_take_elements_by_its_vertices():
    """A closed arc of 60° in so many sides (90 elements for 10 sides where each bend is graded)."""
    for sides in (10, 15):
        c = arc(sides)
        assert mesh([], c, DdmSettings()).cracks.n == sides
        # A mesh that is asked to be finer grades bends again: what the estimate of the error is made of.
        assert mesh([], c, DdmSettings(grading_layers=4)).cracks.n > 3 * sides


def arc(sides: int) -> Cracks:
    """A closed crack from (−1, 0) to (1, 0) that turns by 60°."""
    t = np.linspace(-np.pi / 6, np.pi / 6, sides + 1)
    return Cracks.from_polylines([2 * np.stack([np.sin(t), np.cos(t) - np.cos(np.pi / 6)], axis=1)])


def test_what_bends_leave_is_less_than_what_chords_cost():
    """K of the arc with its bends graded and ungraded, beside what the polygon with twice as many sides has: the bends leave a
    tenth of what the chords cost."""
    k, graded, twice = (
        factors(ddm.Body([], crack, ROCK, DdmSettings(grading_layers=layers)).solve(SHEARED))
        for crack, layers in ((arc(10), 2), (arc(10), 6), (arc(20), 2))
    )
    by_chords = np.abs(graded - twice).max()
    assert np.abs(k - graded).max() < 0.15 * by_chords
    assert by_chords > 0.02 * largest(k)


@pytest.mark.parametrize(
    ("bend", "side", "distance"), [(30, 0.1, 0.2), (60, 0.02, 0.1), (60, 0.1, 0.8), (90, 0.02, 0.2)]
)
def test_corners_of_short_sides(bend, side, distance):
    """A notch of two sides in the wall of a plate, ``distance`` from a crack, as graded as `Grading.away_from_cracks`
    wants, beside one with twelve layers: K to 1.5e-3 (of three corners, each to 5e-4)."""
    half = 0.5 * np.radians(bend)
    deep, wide = side * np.sin(half), side * np.cos(half)
    # Short sides beside the notch, too, as digitised ones have.
    right = [[1.0, y] for y in (-4 * wide, -3 * wide, -2 * wide, -wide)] + [[1 - deep, 0.0]]
    right += [[1.0, y] for y in (wide, 2 * wide, 3 * wide, 4 * wide)]
    plate = np.array([[-1, -1], [1, -1], *right, [1, 1], [-1, 1]], dtype=float)
    crack = Cracks.from_polylines([np.array([[1 - distance, -0.2], [1 - distance, 0.2]])], aperture=np.inf)
    exact = factors(ddm.Body([plate], crack, ROCK, DdmSettings(order=8, grading_layers=12)).solve(PULL))
    found = factors(ddm.Body([plate], crack, ROCK).solve(PULL))
    assert np.abs(found - exact).max() < 1.5e-3 * largest(exact)


def test_layers_fall_with_the_distance():
    grading = Grading.of(DdmSettings())
    corner = np.pi + np.radians(60)
    layers = [grading.away_from_cracks(corner, 0.1, off) for off in (0.0, 0.05, 0.1, 0.5, 2.0, np.inf)]
    assert layers == sorted(layers, reverse=True) and layers[0] == layers[2] > 3 and layers[-1] == 0
    assert KINK < CURVED


def test_pieces_in_line():
    """Two slight bends, then one of 50° with a short side beyond, then back: the first three are in line, the fourth behind
    them, the last beside all but those before it."""
    points = np.cumsum([[0, 0], [1, 0], [0.1, 0.01], [1, 0], [0.06, 0.08], [-1, 0]], axis=0)
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    touching = np.eye(5, dtype=bool)
    line = in_line(touching, pieces, np.full(5, 2.0), np.zeros(5, int))
    assert line[:3, :3].all() and not line[:3, 3:].any()
    assert touching[0, 3] and not touching[0, 4]
    # Increments of growth were not digitised.
    assert in_line(np.eye(5, dtype=bool), pieces, np.zeros(5), np.zeros(5, int)) is None
