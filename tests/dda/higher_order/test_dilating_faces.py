"""Joints with dilation between blocks of higher order: a shear box, to and fro."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geomech import dda
from geomech.model import (
    BlockMotion,
    Blocks,
    DdaSettings,
    EdgeTraction,
    History,
    JointLaw,
    Loads,
    Material,
)

DILATION, FRICTION, STIFFNESS = math.radians(10), math.radians(35), 1e10
#: m: the box is moved to and fro twice between +10 and −10 mm, in steps of 1 mm at first.
WAY, TIMES = np.array([0.0, 10e-3, -10e-3, 0.0, 10e-3, -10e-3, 0.0]), [0, 1, 3, 4, 5, 7, 8]


def sheared(order: int, end: float = 8.0, slip: float = math.inf):
    """States and step results of a block of 1 × 0.5 m, pressed by 1 MPa, on a base of three times its width; faces do not
    fit, as the base is longer."""
    joint = JointLaw(
        "joint",
        FRICTION,
        normal_stiffness=STIFFNESS,
        shear_stiffness=STIFFNESS,
        dilation_angle=DILATION,
        dilation_slip=slip,
    )
    blocks = Blocks.from_polygons(
        [np.array([[-1, -0.5], [2, -0.5], [2, 0], [-1, 0]]), np.array([[0, 0], [1, 0], [1, 0.5], [0, 0.5]])],
        fixed=[True, False], edge_names=[[[""] * 4], [["", "", "top", ""]]], order=None if order == 1 else [1, order],
    )  # fmt: skip
    loads = Loads(
        edge_tractions=(EdgeTraction("top", History.constant([0.0, -1e6])),),
        block_motions=(BlockMotion(1, History.table(TIMES, np.stack([WAY, np.zeros(7)], axis=1)), ("u0", "r0")),),
    )
    settings = DdaSettings(max_displacement_ratio=0.5, dynamic_factor=0.0, time_step=0.1)
    results: list[dda.StepResult] = []
    rock = Material("rock", 20e9, 0.25, density=1.0)
    states = list(dda.run(blocks, [rock], [joint], loads, settings, end, watch=results.append))
    return states, results


@pytest.mark.parametrize(
    "order", [1, 2, pytest.param(3, marks=pytest.mark.slow), pytest.param(5, marks=pytest.mark.slow)]
)
def test_a_shear_box_rises_and_comes_back(order):
    """Lift of the slip beyond the elastic one, S/kₛ, times tan ψ: 1e-3; after two cycles none is left. Order 1 the same."""
    states, results = sheared(order)
    lifts = np.array([state.contacts["lift"].max(initial=0.0) for state in states])
    shear = abs(results[9].contacts["shear_force"].sum())
    assert shear == pytest.approx(1e6 * math.tan(FRICTION), rel=1e-6)
    assert lifts[10] == pytest.approx((10e-3 - shear / STIFFNESS) * math.tan(DILATION), rel=1.5e-3)
    assert lifts[-1] < 1e-9
    assert all(result.contacts["normal_force"].sum() == pytest.approx(1e6, rel=1e-6) for result in results)
    assert max(abs(result.energy.residual) for result in results) < 1e-9
    mean = [state.vertices[4:, 1].mean() for state in states]
    assert mean[10] - mean[0] == pytest.approx(1.638e-3, rel=1e-3)  # of order 1, less what the pressure closes


def test_all_points_of_a_face_rise_by_the_same():
    """By the slip of the block; where its stress varies along the face, as elastic slips do."""
    states, _ = sheared(2, end=1.0)
    lift = states[-1].face_points["lift"]
    assert np.ptp(lift) < 0.03 * lift.max() and lift.min() > 0.0


def test_dilation_ends_after_a_slip():
    states, _ = sheared(2, end=1.0, slip=4e-3)
    assert states[-1].contacts["lift"].max() == pytest.approx(4e-3 * math.tan(DILATION), rel=1e-6)


def test_dilation_without_a_stiffness_is_refused():
    blocks = Blocks.from_polygons(
        [np.array([[-1, -0.5], [2, -0.5], [2, 0], [-1, 0]]), np.array([[0, 0], [1, 0], [1, 0.5], [0, 0.5]])],
        fixed=[True, False], order=[1, 2],
    )  # fmt: skip
    with pytest.raises(ValueError, match="needs a stiffness of its own"):
        dda.BlockSystem(blocks, [Material("rock", 2e10, 0.25)], [JointLaw("joint", FRICTION, dilation_angle=DILATION)])
