"""Cracks beside a re-entrant corner of the outline: what the default mesh leaves of K, against meshes made for an
error."""

from __future__ import annotations

import numpy as np
import pytest

from geomech import ddm
from geomech.model import Cracks, DdmSettings, Material

ROCK = Material("rock", 20e9, 0.25)
L_SHAPE = np.array([[0, 0], [10, 0], [10, 5], [5, 5], [5, 10], [0, 10]], dtype=float)


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
    [(0.05, 0.5, 225), (0.5, 0.5, 180), (0.3, 1.0, 180), (1.0, 1.0, 225), (0.3, 0.3, 270)],
)
def test_k_beside_a_re_entrant_corner(off, length, angle_deg):
    """Three layers at the corner left up to 1.5 %, as `grading.ungraded` says; as many as two thousandths ask for
    leave that.
    (2.6e-3: the constant is the worst measured within 30 %, the reference itself is good to 1e-4.)"""
    exact = body(off, length, angle_deg, target_error=1e-4).solve(pulled()).tips
    found = body(off, length, angle_deg).solve(pulled()).tips
    largest = max(np.abs(exact["k_i"]).max(), np.abs(exact["k_ii"]).max())
    for mode in ("k_i", "k_ii"):
        assert np.abs(found[mode] - exact[mode]).max() < 2.6e-3 * largest


def test_corners_far_from_cracks_stay_as_they_are():
    """Three layers there, as before; six beside a crack; one where settings want none elsewhere."""
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

    assert (layers(far), layers(near), layers(plain)) == (3, 6, 1)
