"""
A rising water table
====================

A block rests on a plane, with a tension crack behind it. As the water level in both rises, the factor of safety falls:
at which level does it reach 1? In a second run the water rises with time until the block slides.
"""

# %%
# The scene
# ---------
# Water pressure acts on the faces of all joints below the water table, ``[loads.water]``. Here the table is horizontal
# behind the crack, and the plane drains at the toe. The plane continues below the toe, so that nothing blocks sliding
# there. A table above the ground would be a lake; ``follows_ground`` cuts it off at the ground.

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import geomech
from geomech.render import sketch
from geomech.scene import load_scene

work = Path(tempfile.mkdtemp(prefix="geomech-tutorial-"))

SCENE = """
title = "Water behind a block"

[[geometry.zones]]
name = "block"
polygon = [[0, 0], [20, 10], [20, 22], [6, 22]]
[[geometry.zones]]
name = "base"
polygon = [[0, 0], [-10, -5], [-10, -9], [34, -9], [34, 22], [20, 22], [20, 10]]

[[geometry.edges]]
name = "joint:plane"
line = [[0, 0], [20, 10]]
[[geometry.edges]]
name = "joint:crack"
line = [[20, 10], [20, 22]]

[materials.rock]
youngs_modulus_pa = 10e9
poissons_ratio = 0.25
density_kg_m3 = 2600

[zones.base]
fixed = true

[joints.default]
friction_angle_deg = 0
[joints.plane]
edges = ["joint:plane"]
friction_angle_deg = 32
cohesion_pa = 20e3

[loads]
gravity_m_s2 = [0, -9.81]
[loads.water]
points = [[0, 0], [20, 10], [34, 10]]
follows_ground = true

[dda]
time_step_s = 0.02
dynamic_factor = 1.0
equilibrium = "start"

[run]
end_time_s = 3.0
"""
(work / "water.toml").write_text(SCENE)

# %%
# Factor of safety and water level
# --------------------------------
# The table is a line from the toe to the level in the crack. On the command line, ``geomech safety water.toml --set …``
# does the same.


def table(level: float) -> dict:
    return {"loads.water.points": [[0, 0], [20, 10 + level], [34, 10 + level]]}


levels = np.array([0.0, 4.0, 8.0, 11.0])
found = [geomech.factor_of_safety(load_scene(work / "water.toml", table(level))).factor for level in levels]

# %%
# We compare with limit equilibrium (Hoek & Bray 1981, chapter 7): water thrust :math:`V = \tfrac12\gamma_w z^2` in the
# crack and uplift :math:`U` on the plane. The table is a straight line here, so the pressure along the plane increases
# linearly from the toe to :math:`\gamma_w z`.

dip, length = np.arctan2(10, 20), np.hypot(20, 10)
weight = (
    2600
    * 9.81
    * 0.5
    * abs(np.dot([0, 20, 20, 6], np.roll([0, 10, 22, 22], -1)) - np.dot([0, 10, 22, 22], np.roll([0, 20, 20, 6], -1)))
)
thrust, uplift = 0.5 * 9810 * levels**2, 0.5 * 9810 * levels * length
normal = weight * np.cos(dip) - uplift - thrust * np.sin(dip)
hoek = (20e3 * length + normal * np.tan(np.radians(32))) / (weight * np.sin(dip) + thrust * np.cos(dip))
for level, computed, closed_form in zip(levels, found, hoek):
    print(f"{level:4.0f} m in the crack: factor {computed:.3f}, limit equilibrium {closed_form:.3f}")

figure, axes = plt.subplots(figsize=(5.5, 3.4), layout="constrained")
axes.plot(levels, hoek, "-", color="0.6", label="limit equilibrium")
axes.plot(levels, found, "o", label="geomech safety")
axes.axhline(1, color="0.8", ls=":")
axes.set(xlabel="water in the crack, m", ylabel="factor of safety")
axes.legend(frameon=False)

# %%
# Water that rises during the run
# -------------------------------
# ``levels_m`` raises the whole table with time. The block begins at rest (``equilibrium = "start"``) and starts to slide
# when its factor reaches 1.

rising = load_scene(
    work / "water.toml",
    {
        "joints.plane.cohesion_pa": 0.0,
        "joints.plane.friction_angle_deg": 29.0,
        "loads.water.level_times_s": [0.0, 2.0],
        "loads.water.levels_m": [0.0, 10.0],
    },
)
path = []
for cycle in geomech.cycles(rising):
    way = cycle.motion.centre[0] - cycle.motion.reference_centre[0]
    path.append((cycle.state.time, np.hypot(*way)))
time, way = np.array(path).T
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.4), layout="constrained", width_ratios=(1, 1.2))
left.plot(time, way)
left.set(xlabel="s; the table rises by 5 m/s until 2 s", ylabel="the block has moved, m")
sketch(cycle, right)
right.set_title(f"t = {cycle.state.time:g} s")

# %%
# Note that water presses on every edge below the table. A table drawn through the air in front of the face
# is therefore a lake that presses *on* the slope and supports it. ``geomech check`` warns of this, and ``geomech build``
# draws the lake.
