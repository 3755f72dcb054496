"""
Rock bridges that fail
======================

A block rests on a plane that is a joint except for one bridge of intact rock. Its weight is raised, as in a
centrifuge, until the bridge breaks. At what load does it break, and what does limit equilibrium say?
"""

# %%
# The scene
# ---------
# The plane is drawn as a *crack* in two pieces, with a joint law on its faces; the gap between the pieces is the bridge.
# Before the bridge breaks, slope and ground are one cracked block. Afterwards there are two, and the upper one slides.
# The model is ``geometry/bridged_slope.geo``: a slope of 30 m after Hoek & Bray (1981) with a tension crack behind the
# crest.
#
# Three choices matter:
#
# - ``criterion = "f"``: the bridge is sheared, so it may break in shear, against its own toughness
#   ``k_iic_pa_sqrt_m``;
# - ``stepping = "events"``: a step ends at exactly the load at which a tip reaches its toughness;
# - gravity increases by one g per second, so that time equals the multiple of gravity.

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import geomech
from geomech.render import sketch
from geomech.scene import load_scene

here = Path.cwd()  # the project's folder, or one below it
project = next(folder for folder in (here, *here.parents) if (folder / "geometry").is_dir())
work = Path(tempfile.mkdtemp(prefix="geomech-tutorial-"))

SCENE = f"""
title = "A sliding plane with one rock bridge"

[geometry]
model = "{project}/geometry/bridged_slope.geo"
parameters = {{ bridge_m = 0.6, bridge_at = 0.3 }}

[materials.rock]
youngs_modulus_pa = 20e9
poissons_ratio = 0.25
density_kg_m3 = 2600
k_ic_pa_sqrt_m = 3.0e6
k_iic_pa_sqrt_m = 2.4e6

[zones.base]
fixed = true

[joints.default]
friction_angle_deg = 45

[joints.plane]
friction_angle_deg = 25
cohesion_pa = 10e3

[cracks.plane]
joint = "plane"

[cracks.tension]
aperture = "slot"

[loads]
gravity_m_s2 = [0.0, -98.1]
gravity_ramp_s = 10.0

[dda]
time_step_s = 1.0

[growth]
criterion = "f"
increment_m = 0.12

[run]
stepping = "events"
end_time_s = 10.0
stop_at = ["split"]
"""
(work / "bridge.toml").write_text(SCENE)
scene = load_scene(work / "bridge.toml")
axes = sketch(scene)
axes.set(ylim=(-12, 33), title="red: cracks; the gap is the bridge")

# %%
# Run
# ---

history = []
for cycle in geomech.cycles(scene):
    history.append((cycle.state.time, cycle.tips["k_i"].max(initial=0), np.abs(cycle.tips["k_ii"]).max(initial=0)))
    for event in cycle.events:
        print(f"{event.time:.4f} g  {event.kind}: {event.detail}")
failure = cycle.state.time

# %%
# Limit equilibrium with a bridge
# -------------------------------
# A block of weight :math:`W` on a plane at angle :math:`d` slides when :math:`W\sin d` exceeds :math:`W\cos
# d\tan\varphi + c\,\ell` plus the resistance of the bridge. Two deep cracks with a ligament of width :math:`2b` between
# them, sheared by a force :math:`Q`, have :math:`K_{II} = Q/\sqrt{\pi b}` (Tada, Paris & Irwin). The bridge therefore
# resists :math:`K_{IIc}\sqrt{\pi b}`. ``geomech/reference/slopes/rock_bridges.py`` has this formula with its sources.

height, dip, crest = 30.0, np.radians(35), 6.0
brink = height / np.tan(np.radians(60))
plane = (brink + crest) / np.cos(dip)
area = 0.5 * height * brink + crest * height - 0.5 * (brink + crest) ** 2 * np.tan(dip)
weight = 2600 * 9.81 * area
bridge = 2.4e6 * np.sqrt(np.pi * 0.3)
holds = 10e3 * (plane - 0.6) + bridge
drive = weight * (np.sin(dip) - np.cos(dip) * np.tan(np.radians(25)))
limit = holds / drive
print(f"failure at {failure:.3f} g, limit equilibrium with the bridge {limit:.3f} g ({failure / limit - 1:+.1%})")

# %%
# Without the bridge, the same slope would slide at

print(f"{10e3 * plane / drive:.2f} g: the bridge of 0.6 m carries the rest.")

# %%
# Stress intensity factors, and the final state
# ---------------------------------------------

time, k_i, k_ii = np.array(history).T
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
left.plot(time, k_ii / 1e6, "o-", label="largest |K_II|")
left.plot(time, k_i / 1e6, "s-", label="largest K_I")
left.axhline(2.4, color="0.6", ls="--", label="K_IIc")
left.set(xlabel="gravity, g", ylabel="MPa √m")
left.legend(frameon=False)
sketch(cycle, right)
right.set(ylim=(-12, 33), title="two blocks now")

# %%
# ``pipelines/planar_slope`` does this for bridges of 0.15 to 1.2 m, and for one that can fail in tension only.
# ``pipelines/step_path_slope`` follows ten en-échelon joints while the load drops, with ``control = "toughness"``.
