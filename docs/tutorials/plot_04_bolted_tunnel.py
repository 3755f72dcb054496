"""
Bolts and an excavated tunnel
=============================

Rock with three joint sets is at rest under its own weight. A tunnel is excavated during the run. Without support, a key
block falls from the roof; with bolts it stays in place.
"""

# %%
# The scene
# ---------
# The rock inside the tunnel is a separate zone, ``core``, which is removed at 0.02 s: ``[[loads.excavations]]``.
# Bolts are lines; grouted bolts act at every joint they cross. ``time_s`` is the time of an excavation, ``start_s`` the
# time of installation of a bolt.

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import geomech
from geomech.render import sketch
from geomech.scene import load_scene

work = Path(tempfile.mkdtemp(prefix="geomech-tutorial-"))

SCENE = """
title = "A tunnel in jointed rock"

[geometry]
seed = 5
dead_ends = "trim"
smallest_block_m2 = 0.2

[[geometry.zones]]
name = "rock"
polygon = [[0, 0], [20, 0], [20, 14], [0, 14]]
holes = [[[7.5, 3], [12.5, 3], [12.5, 6], [11, 7.4], [9, 7.4], [7.5, 6]]]
[[geometry.zones]]
name = "core"
polygon = [[7.5, 3], [12.5, 3], [12.5, 6], [11, 7.4], [9, 7.4], [7.5, 6]]
[[geometry.zones]]
name = "frame"
polygon = [[-1, -1], [21, -1], [21, 14], [20, 14], [20, 0], [0, 0], [0, 14], [-1, 14]]

[[geometry.joint_sets]]
name = "left"
angle_deg = 72
spacing_m = 2.2
zones = ["rock"]
[[geometry.joint_sets]]
name = "right"
angle_deg = 110
spacing_m = 2.2
zones = ["rock"]

[[geometry.joint_sets]]
name = "flat"
angle_deg = 4
spacing_m = 2.4
zones = ["rock"]

[materials.rock]
youngs_modulus_pa = 10e9
poissons_ratio = 0.25
density_kg_m3 = 2600

[zones.frame]
fixed = true

[joints.default]
friction_angle_deg = 20

[loads]
gravity_m_s2 = [0, -9.81]
[[loads.excavations]]
time_s = 0.02
zones = ["core"]

[dda]
dynamic_factor = 1.0
time_step_s = 0.005
equilibrium = "start"

[run]
end_time_s = 0.4
"""
(work / "tunnel.toml").write_text(SCENE)

BOLTS = """
[[loads.bolts]]
name = "roof %d"
start = [%g, %g]
end = [%g, %g]
axial_stiffness_n = 65e6
active_length_m = 0.5
yield_force_n_per_m = 160e3
start_s = 0.0
"""
bolts = [(9.2 + 0.8 * k, 7.3, 9.2 + 0.8 * k + 1.2 * (k - 1), 11.3) for k in range(3)]
bolts += [(7.8, 6.4, 5.0, 9.4), (12.2, 6.4, 15.0, 9.4)]
with_bolts = SCENE + "".join(BOLTS % (k, *line) for k, line in enumerate(bolts))
(work / "bolted.toml").write_text(with_bolts)

# %%
# Two runs
# --------

figure, both = plt.subplots(1, 2, figsize=(11, 4.6), layout="constrained")
for axes, name in zip(both, ("tunnel", "bolted")):
    scene = load_scene(work / f"{name}.toml")
    for cycle in geomech.cycles(scene):
        pass
    moved = np.linalg.norm(cycle.motion.centre - cycle.motion.reference_centre, axis=1)
    moved[cycle.state.removed] = 0.0
    sketch(cycle, axes, values=moved, label="moved, m", cmap="magma_r")
    axes.set_title(name)
    print(f"{name}: {scene.problem().inventory}; the farthest block has moved {moved.max():.3f} m")
    for x0, y0, x1, y1 in bolts if name == "bolted" else []:
        axes.plot([x0, x1], [y0, y1], color="#0072b2", lw=2)

# %%
# Bolt forces
# -----------
# ``history.csv`` in the run folder has one column of forces for each bolt and joint. In Python they are rows of the
# state:

carried = cycle.state.bolts["force"] / 1e3
print(f"{len(carried)} pieces of bolts between joints carry up to {carried.max():.1f} kN/m; they yield at 160")

# %%
# ``geometry/tunnel.geo`` is a horseshoe tunnel with a fault, whose roof bolts are drawn in the model as lines called
# ``bolt:roof``; the scene in the same folder runs as it is. A liner is a separate zone between rock and air.
# ``[loads.in_situ]`` starts from a given stress with K0 instead of from the weight alone.
