"""
An earthquake
=============

A block on a sliding plane is shaken by El Centro 1940. We compare it with Newmark's sliding block, then put a jointed
mass on the same plane.
"""

# %%
# The scene
# ---------
# ``[loads.base]`` shakes the fixed blocks with a record: time and acceleration in a text file. ``frame = "base"``
# keeps the base at rest and applies minus its acceleration to the blocks, which is equivalent and easier to look at.
# Joints with a given stiffness settle faster than penalty springs.

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import geomech
from geomech.model import History
from geomech.render import sketch
from geomech.scene import load_scene

here = Path.cwd()  # the project's folder, or one below it
project = next(folder for folder in (here, *here.parents) if (folder / "pipelines").is_dir())
record = project / "pipelines" / "jointed_slope" / "el_centro_1940_ns.csv"
work = Path(tempfile.mkdtemp(prefix="geomech-tutorial-"))

SCENE = f"""
title = "A block in an earthquake"

[[geometry.zones]]
name = "mass"
polygon = [[0, 0], [20, 7.2794], [20, 12], [4, 8]]
[[geometry.zones]]
name = "base"
polygon = [[-8, -4], [24, -4], [24, 8.7353], [20, 7.2794], [0, 0], [-8, -2.9118]]

[[geometry.edges]]
name = "joint:plane"
line = [[0, 0], [20, 7.2794]]

[materials.rock]
youngs_modulus_pa = 10e9
poissons_ratio = 0.25
density_kg_m3 = 2500

[zones.base]
fixed = true

[joints.default]
friction_angle_deg = 40
normal_stiffness_pa_per_m = 5e9
shear_stiffness_pa_per_m = 2e9
[joints.plane]
edges = ["joint:plane"]
friction_angle_deg = 28
normal_stiffness_pa_per_m = 5e9
shear_stiffness_pa_per_m = 2e9

[loads]
gravity_m_s2 = [0, -9.81]
[loads.base]
file = "{record}"
direction = [1, 0]
frame = "base"

[dda]
dynamic_factor = 1.0
time_step_s = 0.01
equilibrium = "start"

[run]
end_time_s = 6.0

[[monitors]]
name = "mass"
at = [10, 7]
zone = "mass"
"""
(work / "quake.toml").write_text(SCENE)

# %%
# Newmark's block
# ---------------
# The block slides down the plane of 20° while the base acceleration requires more shear resistance than its friction
# angle of 28° provides. The integration below follows that rule exactly, without elasticity. The yield acceleration is
# :math:`g\tan(28° - 20°) = 0.14\,g`.

shaking = History.from_file(record)
times = np.arange(0, 6.0, 1e-4)
ground = np.array([shaking.at(t)[0] for t in times[::20]])
ground = np.interp(times, times[::20], ground)
dip, friction = np.radians(20), np.tan(np.radians(28))
speed = way = 0.0
newmark = np.zeros(len(times))
for k, a in enumerate(ground):
    # Down the plane (to the left), effective gravity in the frame of the base
    press = 9.81 * np.cos(dip) - a * np.sin(dip)
    drive = 9.81 * np.sin(dip) + a * np.cos(dip)
    rate = drive - friction * press
    speed = max(0.0, speed + 1e-4 * rate) if speed > 0 or rate > 0 else 0.0
    way += 1e-4 * speed
    newmark[k] = way


def slide(scene) -> tuple[np.ndarray, np.ndarray, object]:
    """Times, and the displacement of the monitor down the plane."""
    found = []
    for cycle in geomech.cycles(scene):
        found.append((cycle.state.time, -np.dot(cycle.monitors["mass"], [np.cos(dip), np.sin(dip)])))
    return *np.array(found).T, cycle


time, block, _ = slide(load_scene(work / "quake.toml"))
print(f"the block slides {1e3 * block[-1]:.1f} mm, Newmark's {1e3 * newmark[-1]:.1f} mm")

# %%
# A jointed mass
# --------------
# The mass has two joint sets. It slides as a whole, and its joints open as well.

JOINTS = """
[[geometry.joint_sets]]
name = "steep"
angle_deg = 110
spacing_m = 3.5
zones = ["mass"]
[[geometry.joint_sets]]
name = "flat"
angle_deg = 20
spacing_m = 2.6
zones = ["mass"]
"""
(work / "mass.toml").write_text(
    SCENE.replace(
        "[[geometry.zones]]",
        '[geometry]\nseed = 2\ndead_ends = "trim"\nsmallest_block_m2 = 1.0\n[[geometry.zones]]',
        1,
    )
    + JOINTS
)
time2, blocks, last = slide(load_scene(work / "mass.toml"))

figure, (left, right) = plt.subplots(1, 2, figsize=(11, 3.8), layout="constrained", width_ratios=(1.2, 1))
left.plot(times, 1e3 * newmark, color="0.6", lw=3, label="Newmark's block")
left.plot(time, 1e3 * block, label="one block")
left.plot(time2, 1e3 * blocks, label="a mass of blocks")
shaken = left.twinx()
shaken.plot(times[::20], ground[::20] / 9.81, color="0.85", lw=0.6, zorder=0)
shaken.set_ylabel("base, g")
left.set(xlabel="s", ylabel="down the plane, mm")
left.legend(frameon=False, loc="upper left")
sketch(last, right, magnify=5)
right.set_title("displacements five times")

# %%
# The warning appears before the mass has begun to slide. It concerns 1.5 J/m, whereas friction dissipates 57 000 J/m by
# the end. It also appears at half the step, where the mass slides as far to within 0.2 %.
#
# ``pipelines/jointed_slope`` has a thousand blocks with a hundred cracks on such a plane.
# ``[[loads.viscous_boundaries]]`` lets waves leave through edges; ``baseline = "linear"`` corrects a record so that its
# motion ends at rest.
