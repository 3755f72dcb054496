"""Cracks beside a re-entrant corner of the outline: what the default mesh leaves of K, against the finest meshes.

Finite elements with quarter-point tips (`geomech.bench.peers.quarter_point`, 450 000 unknowns) confirm them: a crack of
0.2 beside a corner of 280° differs by 3.2e-3, 1.8e-3 and 7e-4 as the sides of their triangles at the corner are halved."""

from __future__ import annotations

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.fracture.tip_factors import factors, largest
from geomech.model import Cracks, DdmSettings, Material

ROCK = Material("rock", 20e9, 0.25)
#: Half the elements, twice the order, five more layers: K settles to 1e-4 at acute corners, 1e-5 elsewhere.
FINEST = {"order": 8, "elements_per_crack": 8, "elements_per_side": 8, "grading_layers": 8}
L_SHAPE = np.array([[0, 0], [10, 0], [10, 5], [5, 5], [5, 10], [0, 10]], dtype=float)


def apart(found: ddm.Solution, exact: ddm.Solution) -> float:
    """Largest difference of K, relative to the largest K."""
    return float(np.abs(factors(found) - factors(exact)).max() / largest(factors(exact)))


def body(off: float, length: float, angle_deg: float, **settings) -> ddm.Body:
    """An L whose corner at (5, 5) has a crack ``off`` m away, in the direction ``angle_deg``, across it."""
    angle = np.radians(angle_deg)
    away, along = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    middle = np.array([5.0, 5.0]) + off * away
    crack = Cracks.from_polylines(
        [np.array([middle - 0.5 * length * along, middle + 0.5 * length * along])], aperture=np.inf
    )
    return ddm.Body([L_SHAPE], crack, ROCK, DdmSettings(**settings))


def pulled() -> ddm.BodyLoad:
    """Its upright arm is pulled; at the foot a linear traction holds force and moment."""
    segments = np.array([[[5, 10], [0, 10]], [[0, 0], [10, 0]]], dtype=float)
    return ddm.BodyLoad(segments=segments, tractions=np.array([[[0, 1.0], [0, 1.0]], [[0, -1.25], [0, 0.25]]]))


@pytest.mark.parametrize(
    ("off", "length", "angle_deg"),
    [(0.05, 0.5, 225), (0.5, 0.5, 180), (0.3, 1.0, 180), (1.0, 1.0, 225), (0.3, 0.3, 270), (0.01, 0.05, 200)],
)
def test_k_beside_a_re_entrant_corner(off, length, angle_deg):
    """Three layers at the corner left up to 1.5 %, as many as a crack at any distance got 7e-3 at the smallest."""
    exact = body(off, length, angle_deg, **FINEST).solve(pulled())
    found = body(off, length, angle_deg).solve(pulled())
    assert apart(found, exact) < 5e-4


def notched(angle_deg: float) -> np.ndarray:
    """A square of side 10 with a notch from the middle of its right half to the origin, where ``angle_deg`` of rock
    is left."""
    half = np.radians(180 - 0.5 * angle_deg)
    mouth = np.array([np.cos(half), np.sin(half)])
    mouth *= 5.0 / np.abs(mouth).max()
    corners = [[5.0, 5.0]] if mouth[1] < 5.0 - 1e-9 else []
    above = np.array([mouth, *corners, [-5.0, 5.0]])
    return np.concatenate([[[0.0, 0.0]], above, above[::-1] * [1.0, -1.0]])


def both_loads(outline: np.ndarray) -> dict[str, ddm.BodyLoad]:
    """Tension across the notch, and shear whose moment a linear traction holds."""
    right = outline[np.abs(outline[:, 1] - 5.0) < 1e-9, 0].max()
    segments = np.array([[[right, 5.0], [-5.0, 5.0]], [[-5.0, -5.0], [right, -5.0]]])
    held = 30.0 / (right + 5.0)
    return {
        "tension": ddm.BodyLoad(segments=segments, tractions=np.array([[[0, 1.0]] * 2, [[0, -1.0]] * 2])),
        "shear": ddm.BodyLoad(
            segments=segments, tractions=np.array([[[1.0, held], [1.0, -held]], [[-1.0, -held], [-1.0, held]]])
        ),
    }


def beside(way: str, length: float, distance: float) -> np.ndarray:
    """A crack on the side away from the notch, its tip, its side or its slanted end ``distance`` from the corner."""
    ahead, up = np.array([-1.0, 0.0]), np.array([0.0, 1.0])
    if way == "side":
        return distance * ahead + 0.5 * length * np.array([-up, up])
    along = {"tip": np.array([-np.cos(0.3), np.sin(0.3)]), "slanted": np.array([-np.cos(1.0), np.sin(1.0)])}[way]
    return distance * ahead + np.array([np.zeros(2), length * along])


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("way", ["tip", "side", "slanted"])
@pytest.mark.parametrize("angle_deg", [350, 200, 240, 270, 300])
def test_corners_of_any_angle_and_cracks_at_any_distance(angle_deg, way):
    """Errors were 4e-3, 2e-2, 1e-2, 3e-3 and 1e-4 at these angles. They are 1e-3 at most now, which comes from the other
    corners where it is more than 5e-4, and the estimate is no less than half of any that matters."""
    outline = notched(angle_deg)
    for length, distance in ((0.05, 0.001), (0.05, 0.05), (1.0, 0.02), (1.0, 0.2), (1.0, 1.0)):
        crack = Cracks.from_polylines([beside(way, length, distance)], aperture=np.inf)
        mine, finest = (ddm.Body([outline], crack, ROCK, DdmSettings(**given)) for given in ({}, FINEST))
        for load in both_loads(outline).values():
            found = mine.solve(load)
            error = apart(found, finest.solve(load))
            assert error < 1e-3, (length, distance)
            assert found.tip_errors.max() / largest(factors(found)) > 0.5 * error - 2e-5, (length, distance)


@pytest.mark.first_by_default(3)
@pytest.mark.parametrize(("angle_deg", "share"), [(240, 0.1), (270, 0.1), (300, 0.1), (300, 0.8), (350, 0.1)])
def test_cracks_that_begin_at_the_corner(angle_deg, share):
    """The crack leaves two wedges of rock, one of them still re-entrant: 3 layers left errors of 4e-2."""
    outline = notched(angle_deg)
    way = np.radians(180 - 0.5 * angle_deg + share * angle_deg)
    for length in (0.05, 1.0):
        points = np.array([[0.0, 0.0], [length * np.cos(way), length * np.sin(way)]])
        crack = Cracks.from_polylines([points], aperture=np.inf, surface=[(True, False)])
        mine, finest = (ddm.Body([outline], crack, ROCK, DdmSettings(**given)) for given in ({}, FINEST))
        for load in both_loads(outline).values():
            found = mine.solve(load)
            error = apart(found, finest.solve(load))
            assert error < 2e-3
            assert found.tip_errors.max() / largest(factors(found)) > 0.5 * error


def test_layers_end_where_coordinates_are_rounded():
    """The same body 1 000 km from the origin: deeper layers would be shorter than its coordinates tell apart."""
    away = np.array([6e5, 8e5])
    crack = Cracks.from_polylines([np.array([[4.8, 4.9], [4.6, 4.6]]) + away], aperture=np.inf)
    near = Cracks.from_polylines([np.array([[4.8, 4.9], [4.6, 4.6]])], aperture=np.inf)
    load = pulled()
    moved = ddm.BodyLoad(segments=np.asarray(load.segments) + away, tractions=load.tractions)
    far = ddm.Body([L_SHAPE + away], crack, ROCK).solve(moved, equilibrium_tolerance=1e-6)
    assert apart(far, ddm.Body([L_SHAPE], near, ROCK).solve(load)) < 5e-3


def test_corners_far_from_cracks_stay_as_they_are():
    """Three layers there, as before; nine beside a crack; one where settings want none elsewhere."""
    crack = Cracks.from_polylines([np.array([[0.5, 8.5], [1.5, 9.0]])], aperture=np.inf)
    far, near, plain = (
        ddm.Body([L_SHAPE], crack, ROCK, DdmSettings()),
        body(1.0, 1.0, 225),
        body(1.0, 1.0, 225, grading_layers=0),
    )

    def layers(of: ddm.Body) -> int:
        """Elements shrink by 0.3 towards the corner, the last two are alike."""
        at = (of.boundary.end == [5.0, 5.0]).all(axis=1)
        return round(np.log(of.boundary.length[at][0] / 1.25) / np.log(0.3))

    assert (layers(far), layers(near), layers(plain)) == (3, 9, 1)
