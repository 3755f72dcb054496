"""Cells glued to one another: opposite corners at a point need no contact of their own until the glue breaks."""

from __future__ import annotations

import numpy as np
import pytest

from geomech import dda
from geomech.dda.kinematics.simplex_integration import block_moments
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material, State

WEIGHT = Loads(gravity=History.constant([0.0, -9.81]))
LENGTH, DEPTH, MODULUS, DENSITY = 4.0, 1.0, 10e9, 2500.0


def crossed_cells(columns: int, rows: int, friction_deg: float, strength: float, penalty: float) -> dda.BlockSystem:
    """A cantilever of cells cut along both diagonals, glued together and to a wall."""
    xs, ys = np.linspace(0, LENGTH, columns + 1), np.linspace(0, DEPTH, rows + 1)
    polygons = [np.array([[-1.0, -1.0], [0.0, -1.0], [0.0, 2.0], [-1.0, 2.0]])]
    for i in range(columns):
        for j in range(rows):
            corners = np.array([[xs[i], ys[j]], [xs[i + 1], ys[j]], [xs[i + 1], ys[j + 1]], [xs[i], ys[j + 1]]])
            polygons += [np.array([corners[k], corners[(k + 1) % 4], corners.mean(axis=0)]) for k in range(4)]
    blocks = Blocks.from_polygons(polygons, fixed=[True] + [False] * (len(polygons) - 1))
    glue = JointLaw("glue", friction_angle=np.radians(friction_deg), cohesion=strength, tensile_strength=strength)
    return dda.BlockSystem(
        blocks, [Material("rock", MODULUS, 0.0, density=DENSITY)], [glue],
        settings=DdaSettings(
            max_displacement_ratio=0.1, normal_penalty=penalty * MODULUS, shear_penalty=penalty * MODULUS
        ),
    )  # fmt: skip


@pytest.mark.parametrize("penalty", [40.0, 400.0])
@pytest.mark.parametrize("friction_deg", [0.0, 60.0])
def test_glued_cells_settle_whatever_the_friction_in_the_glue(friction_deg, penalty):
    load = DENSITY * 9.81 * DEPTH
    # Bernoulli's beam and its shear, κ = 5/6, G = E/2.
    tip = load * LENGTH**4 / (8 * MODULUS * DEPTH**3 / 12) + load * LENGTH**2 / (2 * 5 / 6 * 0.5 * MODULUS * DEPTH)
    sags = []
    for columns, rows in ((4, 1), (8, 2), (16, 4)):
        system = crossed_cells(columns, rows, friction_deg, 1e12, penalty)
        found = dda.equilibrium(system, State.at_rest(system.blocks), WEIGHT)
        assert found.converged and found.result.contacts["bonded"].all()
        assert found.history["iterations"].max() <= 3
        sags.append(-(found.state.vertices - system.blocks.vertices)[:, 1].min() / tip)
    print(f"φ {friction_deg:g}°, springs {penalty:g} E: sag over that of a beam {np.round(sags, 3)}")
    # Triangles of constant strain: they bend too little by a part that falls as the square of their size.
    assert sags[0] < sags[1] < sags[2]
    assert sags[2] == pytest.approx(1.0, abs=0.06)
    assert 1 - sags[2] < 0.5 * (1 - sags[1])


def test_corners_press_on_one_another_once_the_glue_has_failed():
    # A tenth of what the cantilever's root needs: it breaks off and falls, and no block is inside another.
    system = crossed_cells(4, 1, 60.0, 0.1 * 3 * DENSITY * 9.81 * LENGTH**2 / DEPTH, 40.0)
    state, lost = State.at_rest(system.blocks), 0
    for _ in range(12):
        result = system.step(state, WEIGHT, 5e-3)
        lost = int((result.contacts["bonded"] == 0).sum())
        assert result.statistics["worst_penetration"] < 1e-4
        state = result.state
    assert lost > 0
    moments = block_moments(state.vertices, system.blocks.next_vertex, system.blocks.vertex_start)
    assert (moments[:, 0] > 0).all()
