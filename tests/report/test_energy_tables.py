"""The tables of a run's energy: every joule at cracks stands in one row, and what is given is what is taken."""

from __future__ import annotations

import html
import re

import numpy as np
import pytest

from geomech.coupling import cycles
from geomech.model import (
    Blocks,
    Cracks,
    DdaSettings,
    EdgeTraction,
    GrowthSettings,
    History,
    JointLaw,
    Loads,
    Material,
    Problem,
    RunSettings,
)
from geomech.output.tables.motion_state import energy_summary
from geomech.report.energy_tables import BLOCKS, GIVEN, TAKEN, add_energy
from geomech.report.page import Page


@pytest.mark.parametrize("dynamic", [0.0, 1.0])
def test_what_is_given_at_cracks_is_what_is_taken(dynamic):
    """A plate with a rubbing and a pulled crack, of which one grows and parts it."""
    outline = np.array([[-0.5, -1.0], [0.5, -1.0], [0.5, 1.0], [-0.5, 1.0]])
    rate = 1e6 if dynamic == 0.0 else 4e8
    loads = (EdgeTraction(name, History.ramp([0.0, way * rate])) for name, way in (("top", 1.0), ("bottom", -1.0)))
    given = Problem(
        title="plate",
        blocks=Blocks.from_polygons([outline], edge_names=[[["bottom", "", "top", ""]]]),
        cracks=Cracks.from_polylines([np.array([[-0.3, 0.0], [0.3, 0.0]]), np.array([[0.0, 0.4], [0.2, 0.6]])]),
        materials=(Material("rock", 17e9, 0.21, 2200.0, k_ic=1e6),),
        joints=(JointLaw("joint"),),
        face_laws=(JointLaw("rough", friction_angle=0.5, cohesion=1e3, tensile_strength=4e5),),
        loads=Loads(edge_tractions=tuple(loads)),
        dda=DdaSettings(time_step=0.25 if dynamic == 0.0 else 5e-4, dynamic_factor=dynamic, max_displacement_ratio=0.1),
        growth=GrowthSettings(increment=0.1),
        run=RunSettings(end_time=3.0 if dynamic == 0.0 else 1e-2, stop_at=("split",)),
    )
    last = [cycle for cycle in cycles(given) if cycle.statistics][-1]
    energy = energy_summary(last)
    assert energy["fracture_energy"] > 0 and energy["crack_bond_loss"] > 0
    given_at_cracks, taken = (sum(energy.get(name, 0.0) for name in names) for names in (GIVEN, TAKEN))
    # Blocks count their work on cracks by themselves.
    assert given_at_cracks == pytest.approx(taken, rel=1e-5)
    page = Page("a run")
    add_energy(page, energy)
    text = html.unescape(str(page))
    for names in (BLOCKS, GIVEN, TAKEN):
        for name, told in names.items():
            assert (f">{told}<" in text) == bool(energy.get(name)), name
    assert float(re.search(r"blocks and cracks, ([\d.e+-]+) is", text).group(1)) < 0.01
