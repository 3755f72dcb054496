"""
Runs from Python, results in pandas and xarray
===============================================

We drive a set of runs of one scene from Python and read their tables into data frames.
"""

# %%
# A scene as text, and what varies
# --------------------------------
# ``load_scene(path, changes)`` takes the same keys as ``--set``, with Python values. Here we vary the friction angle of a
# plane at 30°, on which a block slides in real time.

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import xarray as xr

import geomech
from geomech.scene import load_scene

work = Path(tempfile.mkdtemp(prefix="geomech-tutorial-"))
(work / "block.toml").write_text("""
title = "A block on a plane"
[[geometry.zones]]
name = "plane"
polygon = [[-12, -6.9282], [6, 3.4641], [6, -8], [-12, -8]]
[[geometry.zones]]
name = "block"
polygon = [[2, 1.1547], [4, 2.3094], [3, 4.0415], [1, 2.8868]]
[materials.rock]
youngs_modulus_pa = 20e9
poissons_ratio = 0.25
density_kg_m3 = 2600
[zones.plane]
fixed = true
[joints.default]
friction_angle_deg = 20
[loads]
gravity_m_s2 = [0, -9.81]
[dda]
dynamic_factor = 1.0
time_step_s = 0.005
equilibrium = "start"
[[monitors]]
name = "block"
at = [2.5, 2.6]
zone = "block"
[run]
end_time_s = 0.5
""")

rows = []
for friction in (0, 10, 20, 28, 32):
    # At 32° the block is stable; for the others "start" would find no equilibrium, and the run would say so.
    changes = {
        "joints.default.friction_angle_deg": friction,
        "dda.equilibrium": "start" if friction > 30 else "",
    }
    summary = geomech.run(load_scene(work / "block.toml", changes), work / f"friction_{friction}")
    rows.append({"friction": friction, "end": summary["end"]})

# %%
# Histories as data frames
# ------------------------
# ``geomech.open_run`` gives the tables of a run folder: ``history``, ``tips``, ``events``, ``joints``. (Every CSV file
# has one header line and SI units, so ``pandas.read_csv`` and any spreadsheet can read it too.)

frames = {friction: geomech.open_run(work / f"friction_{friction}").history for friction in (0, 10, 20, 28, 32)}
print(
    frames[20][["time", "block_ux", "block_uy", "open_close_iterations", "kinetic_energy"]]
    .tail(3)
    .to_string(index=False)
)

table = pd.DataFrame(rows).set_index("friction")
table["way_m"] = [np.hypot(f["block_ux"].iloc[-1], f["block_uy"].iloc[-1]) for f in frames.values()]
angle = np.radians(30)
table["closed_form_m"] = [
    max(0.0, 0.5 * 9.81 * (np.sin(angle) - np.cos(angle) * np.tan(np.radians(f))) * 0.5**2) for f in table.index
]
print(table.to_string())

figure, axes = plt.subplots(figsize=(6, 3.6), layout="constrained")
for friction, frame in frames.items():
    axes.plot(frame["time"], np.hypot(frame["block_ux"], frame["block_uy"]), label=f"{friction}°")
axes.set(xlabel="s", ylabel="down the plane, m")
axes.legend(frameon=False, title="friction")

# %%
# The set as one array
# --------------------
# With `xarray <https://xarray.dev>`_ (``pip install xarray``) the tables of all runs become one data set with named
# axes: friction and time.

moved = xr.concat(
    [frame.set_index("time")[["block_ux", "block_uy", "kinetic_energy"]].to_xarray() for frame in frames.values()],
    dim=pd.Index(list(frames), name="friction"),
)
print(moved)
print(moved.kinetic_energy.sel(time=[0.1, 0.3, 0.5], method="nearest").to_pandas().round(1).to_string())

# %%
# More than tables
# ----------------
# The same object gives access to the summary, the scene as it was run, and the series as PyVista meshes at any cycle or
# time. In a notebook it displays a summary, and ``run.view()`` plays the run.

run = geomech.open_run(work / "friction_20")
print(run, "·", run.summary["end"], "·", run.series)
mesh = run.mesh("blocks", time=0.25)
print(mesh.array_names)
contacts = pd.Series(run.mesh("contacts", time=0.25).point_data["normal_force"], name="normal force, N/m")
print(contacts.to_string())
print(run.joints.tail(1).T.to_string())

# %%
# Without files
# -------------
# ``geomech.cycles(scene)`` yields each cycle as it is computed: arrays of blocks, contacts, tips. An observer is any
# object with ``on_cycle``; see ``geomech.output.Observer``. Unless an observer writes files, nothing is written.

for cycle in geomech.cycles(load_scene(work / "block.toml", {"dda.equilibrium": ""})):
    pass
print(cycle.statistics.keys())
