"""
A section traced in DXF or GeoJSON
==================================

A road cut was mapped: joints as lines on layers, in world coordinates, with ends that fall short or overshoot. We read
the drawing, look at the repairs, run it, and export the blocks to a GIS.
"""

# %%
# What the layers mean
# --------------------
# ``geometry/traced_slope.toml`` names the layers of ``traced_slope.dxf``: zones, joints, bolts, the water table,
# monitoring points. Arcs, splines, blocks and the units of the drawing are supported. Coordinates are easting and
# height; the run itself uses an origin near the rock.

import json
import tempfile
from pathlib import Path

import numpy as np

import geomech
from geomech.output.block_model.block_system import write_block_system
from geomech.render import sketch
from geomech.scene import load_scene

here = Path.cwd()  # the project's folder, or one below it
project = next(folder for folder in (here, *here.parents) if (folder / "geometry").is_dir())
work = Path(tempfile.mkdtemp(prefix="geomech-tutorial-"))

scene = load_scene(project / "geometry" / "traced_slope.toml")
print(scene.problem().inventory)
for warning in scene.warnings:
    print("·", warning.message)

# %%
# What ``geomech build`` writes
# -----------------------------

written = write_block_system(scene, work / "build")
print(*written["lines"], sep="\n")
print(sorted(path.name for path in (work / "build").iterdir()))
blocks = json.loads((work / "build" / "block_system.geojson").read_text())
print(len(blocks["features"]), "features;", blocks["features"][0]["properties"])

# %%
# Run
# ---
# One second of motion under its own weight, with water and anchors.

for cycle in geomech.cycles(load_scene(project / "geometry" / "traced_slope.toml", {"run.end_time_s": 0.3})):
    pass
moved = np.linalg.norm(cycle.motion.centre - cycle.motion.reference_centre, axis=1)
axes = sketch(cycle, values=1e3 * moved, label="moved, mm")
axes.set_title(f"after {cycle.state.time:g} s")

# %%
# The same from GeoJSON or CSV
# ----------------------------
# One property of each line names its set; ``set_property`` tells which property that is. A polygon called
# ``zone:rock`` is the rock.

features = [
    ("zone:rock", "Polygon", [[[0, 0], [20, 0], [20, 12], [6, 12], [0, 0]]]),
    ("zone:base", "Polygon", [[[-4, -2], [22, -2], [22, 12], [20, 12], [20, 0], [0, 0], [-4, 0], [-4, -2]]]),
    ("joint:bed", "LineString", [[1.4, 3.0], [20, 9.5]]),
    ("joint:bed", "LineString", [[3.1, 6.1], [19.98, 11.6]]),
    ("joint:cross", "LineString", [[9.0, 5.7], [8.2, 8.0]]),
    ("joint:cross", "LineString", [[13.0, 7.1], [12.1, 9.2]]),
]
text = {
    "type": "FeatureCollection",
    "features": [
        {"type": "Feature", "properties": {"set": name}, "geometry": {"type": kind, "coordinates": points}}
        for name, kind, points in features
    ],
}
(work / "cut.geojson").write_text(json.dumps(text))
(work / "cut.toml").write_text("""
title = "From GeoJSON"
[geometry]
dead_ends = "trim"
tolerance_m = 0.15
[[geometry.traces]]
file = "cut.geojson"
[materials.rock]
youngs_modulus_pa = 10e9
poissons_ratio = 0.25
density_kg_m3 = 2600
[zones.base]
fixed = true
[joints.default]
friction_angle_deg = 32
[loads]
gravity_m_s2 = [0, -9.81]
[run]
end_time_s = 1
""")
cut = load_scene(work / "cut.toml")
print(cut.problem().inventory)
for warning in cut.warnings:
    print("·", warning.message)
sketch(cut)

# %%
# Ends that miss each other by less than ``tolerance_m`` are joined and reported with their position. Read that list
# before you trust the blocks: it shows where the tracing was faulty.
