"""
Blocks that bend
================

A lintel on two piers carries a wall. A first-order block strains uniformly and cannot bend; a higher-order block can.
Which order is enough, and how is rock of arbitrary shape modelled? (`Theory <../theory/higher_order.html>`_.)
"""

# %%
# A lintel of one block
# ---------------------
# ``order`` is the order of the displacement polynomial of each block of the zone. ``"auto"`` begins with 1 and raises the
# order of those blocks whose next orders would contain more than a hundredth of the energy (``dda.order_target``). Cracks are
# taken into account: they soften a block, and bend it as they open.

import tempfile
from itertools import pairwise
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection

import geomech
from geomech.scene import load_scene

work = Path(tempfile.mkdtemp(prefix="geomech-tutorial-"))

SCENE = """
title = "Lintel"

[[geometry.zones]]
name = "left_pier"
rectangle = [-0.5, -1.0, 0.0, 0.0]
[[geometry.zones]]
name = "right_pier"
rectangle = [4.0, -1.0, 4.5, 0.0]
[[geometry.zones]]
name = "lintel"
rectangle = [-0.5, 0.0, 4.5, 0.5]
[[geometry.edges]]
name = "load:wall"
line = [[-0.5, 0.5], [4.5, 0.5]]

[materials.stone]
youngs_modulus_pa = 20e9
poissons_ratio = 0.2
density_kg_m3 = 2500
plane = "stress"

[zones.left_pier]
fixed = true
[zones.right_pier]
fixed = true
[zones.lintel]
order = 3

[joints.default]
friction_angle_deg = 0

[loads]
gravity_m_s2 = [0, -9.81]
[[loads.tractions]]
edge = "load:wall"
value_pa = [0, -50e3]

[[monitors]]
name = "mid-span"
at = [2.0, 0.25]

[dda]
time_step_s = 1.0
[growth]
enabled = false
[run]
end_time_s = 2.0
"""
(work / "lintel.toml").write_text(SCENE)

# %%
# In beam theory, a lintel that bears on the inner edges of the piers, with overhangs of half a metre that lift off, sags
# by :math:`q\,l^2\,(5 l^2 - 24 c^2)/384 E I` plus, due to shear, :math:`q\,l^2/8\kappa G A`.

load, span, over, depth, modulus = 50e3 + 2500 * 9.81 * 0.5, 4.0, 0.5, 0.5, 20e9
inertia, shear = depth**3 / 12, modulus / 2.4
beam = load * span**2 * (5 * span**2 - 24 * over**2) / (384 * modulus * inertia)
beam += load * span**2 / (8 * 5 / 6 * shear * depth)


def last(overrides: dict):
    *_, cycle = geomech.cycles(load_scene(work / "lintel.toml", overrides))
    return cycle


heights = np.linspace(0.0, depth, 41)
figure, axes = plt.subplots(figsize=(5.5, 3.4), layout="constrained")
for order in (2, 3, 4, 6, "auto"):
    cycle = last({"zones.lintel.order": order})
    (body,) = cycle.bent.values()
    stress = body.fields(np.column_stack([np.full(41, 2.0), heights]))[0][:, 0]
    found = order if order != "auto" else int(cycle.state.order.max())
    print(f"order {order}: of order {found}, sags by {-1e3 * cycle.monitors['mid-span'][1]:.3f} mm")
    axes.plot(stress / 1e6, heights, label=f"order {order}")
moment = load * (span**2 / 8 - over**2 / 2)
axes.plot(moment * (0.5 * depth - heights) / inertia / 1e6, heights, "k:", label="beam theory")
axes.set(xlabel="horizontal stress at mid-span, MPa", ylabel="m above the piers")
axes.legend(frameon=False, fontsize=8)
print(f"beam theory: {1e3 * beam:.3f} mm")

# %%
# Rock of any shape: cells
# ------------------------
# Polynomials represent the stress near corners and holes poorly, and ``"auto"`` warns of this. ``mesh_size_m`` divides the
# blocks of a zone into cells. These are bonded so that displacements and stresses are transmitted: both smaller cells and
# higher orders converge to the solution. Here the lintel has a notch in its lower face.

NOTCHED = SCENE.replace(
    "rectangle = [-0.5, 0.0, 4.5, 0.5]",
    "polygon = [[-0.5, 0], [1.9, 0], [2.0, 0.2], [2.1, 0], [4.5, 0], [4.5, 0.5], [-0.5, 0.5]]",
)
(work / "lintel.toml").write_text(NOTCHED)
cells = {"zones.lintel.mesh_size_m": 0.15, "zones.lintel.order": 3}
cycle = last(cells)
print(f"{cycle.blocks.n_blocks - 2} cells, sags by {-1e3 * cycle.monitors['mid-span'][1]:.3f} mm")

# %%
# Cells that part
# ---------------
# With ``cell_joint``, faces between cells separate where the stress exceeds the strength of that joint. An increasing load
# shows where, and at which load, the stone breaks.

BREAKING = (
    NOTCHED.replace("value_pa = [0, -50e3]", "times_s = [0, 10]\nvalues_pa = [[0, 0], [0, -200e3]]")
    .replace("end_time_s = 2.0", "end_time_s = 10.0")
    .replace("[joints.default]", "[joints.stone]\ntensile_strength_pa = 5e6\ncohesion_pa = 15e6\nfriction_angle_deg = 35\n[joints.default]")
)  # fmt: skip
(work / "lintel.toml").write_text(BREAKING)
for cycle in geomech.cycles(load_scene(work / "lintel.toml", cells | {"zones.lintel.cell_joint": "stone"})):
    if cycle.state.parted is not None and cycle.state.parted.any():
        break
    whole = cycle
edges = cycle.blocks.glued[cycle.state.parted, 0]
at = 0.5 * (cycle.blocks.vertices[edges] + cycle.blocks.vertices[cycle.blocks.next_vertex[edges]])
print(f"whole under {20 * whole.state.time:.0f} kPa; {len(edges)} faces part under {20 * cycle.state.time:.0f} kPa")

# %%
# Stress in the last step in which the lintel was intact, and the faces that separate in the next, from the notch upwards.

start, vertices = whole.blocks.vertex_start, whole.state.vertices
polygons = [vertices[a:b] for a, b in pairwise(start)]
drawn = PolyCollection(polygons, array=whole.state.stress[:, 0] / 1e6, cmap="RdBu_r", edgecolor="0.6", linewidth=0.3)
drawn.set_clim(-4, 4)
figure, axes = plt.subplots(figsize=(9, 3), layout="constrained")
axes.add_collection(drawn)
axes.plot(*at.T, "k.", ms=4)
axes.set(
    xlim=(0.9, 3.1), ylim=(-0.05, 0.55), aspect="equal", xlabel="m", title="horizontal stress, MPa; faces that part"
)
figure.colorbar(drawn, ax=axes, shrink=0.8)
plt.show()
