"""
The two-crack specimen of the paper
===================================

Khanizadeh Bahabadi et al. (2023) compute the specimens of Haeri et al. (2014): two slots of 10 mm in a plate of 60 ×
120 mm between platens, crack 2 rotated from crack 1 by φ. This page runs φ = 0 and shows how to decide whether a
result agrees with a published figure.
"""

# %%
# Run
# ---
# ``geomech run pipelines/two_cracks`` runs all four specimens and writes a page that compares every table. Here one of
# them is run from Python, in about two seconds:

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import geomech
from geomech.reference.specimens import two_cracks as published
from geomech.render import sketch
from geomech.scene import load_scene

here = Path.cwd()  # the project's folder, or one below it
project = next(folder for folder in (here, *here.parents) if (folder / "pipelines").is_dir())

scene = load_scene(project / "pipelines" / "two_cracks", variant="phi_0")
loads, factors, events = [], [], []
for cycle in geomech.cycles(scene):
    loads.append(cycle.load / 1e6)
    factors.append(cycle.tips["k_eq"].max(initial=0) / 1e6)
    events += cycle.events
for event in events:
    print(f"{event.load / 1e6:7.2f} MPa  {event.kind}: {event.detail}")

# %%
# Crack paths and loads
# ---------------------
# Steps end at exactly the load at which the next tip reaches its toughness (``run.stepping = "events"``), so K exceeds
# 2 MPa √m by no more than the change over one growth increment.

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.8), layout="constrained", width_ratios=(1.3, 1))
left.plot(loads, factors, ".-")
left.axhline(published.K_IC / 1e6, color="0.6", ls="--", label="toughness")
left.set(xlabel="axial stress, MPa", ylabel="largest K_eq, MPa √m")
left.legend(frameon=False)
sketch(cycle, right)
right.set(title="after coalescence", xlim=(-0.03, 0.03), ylim=(-0.06, 0.06))

# %%
# Comparison with the paper
# -------------------------
# Loads scale with the toughness, so :math:`\sigma\sqrt{\pi b}/K_{Ic}` is the quantity to compare. With the printed
# toughness no such slot can grow below 44.6 MPa, which exceeds the strength of the intact material (28 MPa). The printed
# stresses (2 to 5 MPa) therefore do not follow from it. The crack *paths* can be compared:

first = next(event for event in events if event.kind == "initiation")
last = next(event for event in events if event.kind == "coalescence")
scale = np.sqrt(np.pi * published.HALF_LENGTH) / published.K_IC
print(f"initiation {first.load / 1e6:.2f} MPa, σ√(πb)/K_Ic = {first.load * scale:.2f}")
print(f"coalescence {last.load / 1e6:.1f} MPa, σ√(πb)/K_Ic = {last.load * scale:.1f}")
for source, angles in published.COALESCENCE_ANGLE_DEG.items():
    print(f"line of coalescence, φ = 0, {source}: {angles[0]:.1f}°")

# %%
# K before growth
# ---------------
# The crack solver alone, under a uniform load, with three orders. The coupled specimen at 0.2 MPa agrees to 3e-9.

from geomech import ddm
from geomech.model import DdmSettings

problem = scene.problem()
rock = problem.materials[problem.blocks.material[0]]
side = np.array([[-0.03, -0.06], [0.03, -0.06], [0.03, 0.06], [-0.03, 0.06]])
pressed = ddm.BodyLoad(sides={0: (0.0, 1e6), 2: (0.0, -1e6)})
for order in (2, 4, 6):
    tips = ddm.Body([side], problem.cracks, rock, DdmSettings(order=order)).solve(pressed).tips
    print(f"order {order}: K_I, K_II at 1 MPa = {np.round(tips['k_i'] / 1e6, 6)}, {np.round(tips['k_ii'] / 1e6, 6)}")

# %%
# Other variants: ``--variant closed_0`` has closed faces, ``paper_0`` the paper's elements and Kelvin's solution,
# ``increment_…`` and ``order_…`` other settings. ``geomech report outputs/two_cracks`` shows all of them on one page.
# :doc:`/verification/two_cracks` discusses where the paper's figures are consistent and where they are not.
