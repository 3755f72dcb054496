"""Soft contact springs under high load: faces that have gone in deeper than a step may move blocks touch still."""

import numpy as np
import pytest

from geomech import dda
from geomech.model import Blocks, DdaSettings, EdgeTraction, History, JointLaw, Loads, Material


def test_contacts_deeper_than_the_window_of_the_search_are_kept():
    """A block is pressed on a fixed one, slowly, in steps that may move it by 1e-4 of half the height: springs of 1 GPa
    give by 30 times that, force over stiffness and nothing else."""
    rock, rate = Material("rock", 50e9, 0.2, 2500.0), 1e5
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    blocks = Blocks.from_polygons(
        [square, square - [0.0, 1.0]], fixed=[False, True], edge_names=[[["", "", "load", ""]], [[""] * 4]]
    )
    settings = DdaSettings(time_step=1.0, max_displacement_ratio=1e-4, normal_penalty=1e9, shear_penalty=1e9)
    loads = Loads(edge_tractions=(EdgeTraction("load", History.ramp([0.0, -rate])),))
    *_, last = dda.run(blocks, [rock], [JointLaw("smooth")], loads, settings, 60.0)
    pressing = last.contacts[last.contacts["normal_force"] > 0]
    assert -pressing["gap"].min() > 30 * settings.max_displacement_ratio
    # A step of a second leaves 2 M/dt² of the motion out of balance: 2e-6.
    assert pressing["normal_force"].sum() == pytest.approx(60.0 * rate, rel=1e-5)
