"""
A specimen with flaws of your own
=================================

Three flaws at positions of your choice, drawn in TOML without Gmsh. One is a slot, one is closed with friction, and one
is cemented.
"""

# %%
# ``[cracks.NAME]`` gives each crack its own ``aperture`` and joint law. The specimen stands on
# one frictionless platen and is loaded by another, which is ``guided`` along y.

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

import geomech
from geomech.output import Observer, standard_observers
from geomech.render import sketch
from geomech.scene import load_scene

work = Path(tempfile.mkdtemp(prefix="geomech-tutorial-"))

(work / "flaws.toml").write_text("""
title = "Three flaws"

[[geometry.zones]]
name = "rock"
rectangle = [-0.03, -0.06, 0.03, 0.06]
[[geometry.zones]]
name = "below"
rectangle = [-0.035, -0.07, 0.035, -0.06]
[[geometry.zones]]
name = "above"
rectangle = [-0.035, 0.06, 0.035, 0.07]

[[geometry.cracks]]
name = "slot"
centre = [-0.004, 0.022]
length_m = 0.012
angle_deg = 40
[[geometry.cracks]]
name = "closed"
centre = [0.008, -0.002]
length_m = 0.012
angle_deg = 50
[[geometry.cracks]]
name = "cemented"
points = [[-0.016, -0.028], [-0.010, -0.022], [-0.006, -0.020]]

[[geometry.edges]]
name = "contact:ends"
line = [[-0.035, -0.06], [0.035, -0.06]]
[[geometry.edges]]
name = "contact:ends"
line = [[-0.035, 0.06], [0.035, 0.06]]
[[geometry.edges]]
name = "load:top"
line = [[-0.03, 0.07], [0.03, 0.07]]

[materials.rock]
youngs_modulus_pa = 17e9
poissons_ratio = 0.21
density_kg_m3 = 2200
k_ic_pa_sqrt_m = 0.8e6
[materials.steel]
youngs_modulus_pa = 200e9
poissons_ratio = 0.3
density_kg_m3 = 7850

[zones.rock]
material = "rock"
[zones.below]
material = "steel"
fixed = true
[zones.above]
material = "steel"
guided = "y"

[joints.default]
friction_angle_deg = 30
[joints.ends]
edges = ["contact:*"]
friction_angle_deg = 0
[joints.cement]
friction_angle_deg = 30
cohesion_pa = 15e6
tensile_strength_pa = 2e6

[cracks.slot]
aperture = "slot"
[cracks.closed]
joint = "default"
[cracks.cemented]
joint = "cement"

[loads]
leading_edge = "load:top"
[[loads.tractions]]
edge = "load:top"
rate_pa_per_s = [0, -0.5e6]

[ddm]
elements_per_crack = 2
elements_per_side = 2

[growth]
increment_m = 1.5e-3

[run]
stepping = "events"
events = ["tips"]
end_time_s = 70
stop_at = ["coalescence", "split"]

[gauge]
from = [0, -0.06]
to = [0, 0.06]
zone = "rock"

[output]
interior_every = 1000
""")

# %%
# Run into a folder, as ``geomech run flaws.toml`` does, and read it back
# ------------------------------------------------------------------------
# An observer is called after every cycle of a run. ``standard_observers`` returns those that write files; ours keeps the
# last cycle so that we can draw it.


class Last(Observer):
    """The last cycle of a run."""

    def on_cycle(self, cycle):
        self.cycle = cycle


scene, last = load_scene(work / "flaws.toml", {"output.interior": False}), Last()
summary = geomech.run(scene, work / "run", [*standard_observers(scene, quiet=True), last])
run = geomech.open_run(work / "run")
print("ended:", summary["end"])
for _, event in run.events.head(6).iterrows():
    print(f"{event['load'] / 1e6:6.2f} MPa  {event['kind']}: {event['detail']}")

# %%
# ``tips.csv`` has one row per tip and cycle. The slot has a negative K_I, but wing cracks grow from it nevertheless. The
# closed flaw has K_I = 0 until its wings open.

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.8), layout="constrained", width_ratios=(1.3, 1))
for crack, name in enumerate(("slot", "closed", "cemented")):
    for end in (0, 1):
        own = run.tips[(run.tips["crack_name"] == name) & (run.tips["end"] == end)]
        left.plot(
            own["load"] / 1e6,
            own["K_eq"] / 1e6,
            label=f"{name}, end {end}",
            color=f"C{crack}",
            ls=("-", "--")[end],
        )
left.set(xlabel="axial stress, MPa", ylabel="K_eq, MPa √m")
left.legend(frameon=False)

sketch(last.cycle, right)
right.set(xlim=(-0.031, 0.031), ylim=(-0.061, 0.061), title=f"{last.cycle.load / 1e6:.1f} MPa")

# %%
# Stress and strain
# -----------------
# The gauge gives the axial strain between its two points. Sliding and opening cracks make the specimen more compliant.

history = run.history
figure, axes = plt.subplots(figsize=(5, 3.4), layout="constrained")
axes.plot(1e3 * history["strain"], history["load"] / 1e6)
axes.set(xlabel="axial strain, 1e-3", ylabel="axial stress, MPa")
strain = history["load"].iloc[-1] * (1 - 0.21**2) / 17e9
print(f"strain at the end {history['strain'].iloc[-1]:.3e}; whole rock would have {strain:.3e}")

# %%
# To change the scene: ``--set geometry.cracks.1.angle_deg=60`` rotates the second flaw (items are numbered from 0); a
# crack with ``aperture = 0.0002`` closes once its faces have approached each other by 0.2 mm.
