"""Corners that slide past nodes in the face of another block: as if no node were there."""

from __future__ import annotations

import numpy as np
import pytest

from geomech import dda
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material


def _wall(nodes):
    """A block against a wall, which has ``nodes`` in its face where the block's corners are, as a cut leaves them, or
    none."""
    wall = [[-1.0, 0.0], [0.0, 0.0], [0.0, 0.5], [0.0, 1.5], [0.0, 2.0], [-1.0, 2.0]]
    if not nodes:
        del wall[2:4]
    block = [[0.0, 0.5], [1.0, 0.5], [1.0, 1.5], [0.0, 1.5]]
    return Blocks.from_polygons([np.array(wall), np.array(block)], fixed=[True, False])


def _run(nodes, along, friction_deg=30.0, end=0.4):
    """The budget and the corners (n, 2) of the block pressed on by 20 m/s² and drawn ``along`` the face, (k, 2) s and m/s²,
    on a bed of 0.1 GPa/m: how it moves, (n, 4, 2) m."""
    blocks = _wall(nodes)
    rock = Material("rock", 5e9, 0.25, density=2600.0)
    joint = JointLaw("joint", friction_angle=np.radians(friction_deg), normal_stiffness=1e8, shear_stiffness=5e7)
    times, pulls = np.array(along).T
    gravity = History(times, np.stack([np.interp(times, [0.0, 0.1], [0.0, -20.0]), pulls], axis=1))
    settings = DdaSettings(time_step=2e-3, dynamic_factor=1.0)
    results = []
    loads = Loads(gravity=gravity)
    states = list(dda.run(blocks, [rock], [joint], loads, settings, end, watch=results.append))
    budget = dda.EnergyBudget()
    for result in results:
        budget = budget.after(result.energy)
    return budget, np.array([state.vertices[-4:] - blocks.vertices[-4:] for state in states])


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("along", [
    [(0.0, 0.0), (0.1, 0.0), (0.2, -10.0), (0.4, -10.0)],       # sticks, past the node by 2e-4 of the face
    [(0.0, 0.0), (0.1, 0.0), (0.2, 10.0), (0.4, 10.0)],
    [(0.0, 0.0), (0.1, 0.0), (0.2, -10.0), (0.3, 10.0), (0.4, -10.0)],      # to and fro
    [(0.0, 0.0), (0.1, 0.0), (0.2, -16.0), (0.3, 10.0), (0.4, -16.0)],      # slides besides
])  # fmt: skip
def test_nodes_in_a_face_change_nothing(along):
    budget, moved = _run(True, along)
    plain, without = _run(False, along)
    assert np.abs(moved[..., 1]).max() > 2e-4
    assert moved == pytest.approx(without, abs=1e-9 * np.abs(without).max())
    for name in ("residual", "overlap", "friction", "scheme"):
        assert getattr(budget, name) == pytest.approx(getattr(plain, name), abs=1e-9 * plain.turnover)
    assert abs(budget.residual) < 2e-3 * budget.turnover
