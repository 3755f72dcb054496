"""Scenes of the tests of sweeps."""

from pathlib import Path

import pytest

#: A block on a plane at 30°, before an upright open crack.
PLANE = """
title = "Plane"
[geometry]
zones = [
  { name = "base", polygon = [[-4, -3], [20, -3], [20, 9], [10, 9], [10, 5.7735027], [0, 0], [-4, 0]] },
  { name = "block", polygon = [[0, 0], [10, 5.7735027], [10, 9], [6, 9]] },
]
edges = [{ name = "joint:crack", line = [[10, 5.7735027], [10, 9]] }]
[materials.rock]
youngs_modulus_pa = 20e9
poissons_ratio = 0.25
density_kg_m3 = 2600
[zones.base]
fixed = true
[joints.default]
friction_angle_deg = 35
[joints.open]
friction_angle_deg = 0
edges = ["joint:crack"]
[loads]
gravity_m_s2 = [0.0, -9.81]
[dda]
dynamic_factor = 0.0
time_step_s = 0.01
[run]
end_time_s = 0.02
"""


@pytest.fixture
def plane(tmp_path) -> Path:
    """The scene file of a block on a plane."""
    path = tmp_path / "plane.toml"
    path.write_text(PLANE, encoding="utf-8")
    return path


#: Settings of runs that only wait.
PAUSES = {"vary": {"materials.rock.density_kg_m3": "uniform(2000, 3000)"}, "measure": "pause", "pause_s": 0.0}
