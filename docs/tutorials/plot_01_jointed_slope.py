"""
A jointed slope, from an empty Gmsh file
========================================

A slope 20 m high with two joint sets. We draw it in Gmsh from nothing: rock, floor, back, names. Then we make the
mistakes
that most people make first, and see what the program says to each.
"""

# %%
# The model
# ---------
# A ``.geo`` file is text. Open it in Gmsh (``gmsh my_slope.geo``) and the drawing follows every change; values inside
# ``DefineConstant`` stand in the side panel. The rules are few:
#
# - a *physical surface* is a zone of rock, by name;
# - a *physical curve* called ``joint:…`` or ``crack:…`` cuts the rock; any other name marks edges, for loads or joint
#   laws;
# - what is not in a physical group is not read.
#
# Two surfaces: ``rock``, which joints will cut, and ``base``, which holds it from below and from behind. The base
# goes on in
# front of the toe: blocks that come down need a floor to land on. To the left the slope is free.

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import geomech
from geomech.render import sketch
from geomech.scene import SceneError, load_scene

work = Path(tempfile.mkdtemp(prefix="geomech-tutorial-"))  # any folder of yours

(work / "my_slope.geo").write_text("""
DefineConstant[
  height_m = {20, Name "Parameters/height_m"},
  face_angle_deg = {63, Name "Parameters/face_angle_deg"}
];
brink = height_m / Tan(face_angle_deg * Pi / 180);
back = brink + 18;
size = height_m / 8;
// rock: toe, back at the foot, back at the top, brink
Point(1) = {0, 0, 0, size};            Point(2) = {back, 0, 0, size};
Point(3) = {back, height_m, 0, size};  Point(4) = {brink, height_m, 0, size};
Line(1) = {1, 2};  Line(2) = {2, 3};  Line(3) = {3, 4};  Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
// base: floor in front of the toe, below and behind the rock
Point(5) = {-12, 0, 0, size};          Point(6) = {-12, -3, 0, size};
Point(7) = {back + 3, -3, 0, size};    Point(8) = {back + 3, height_m, 0, size};
Line(5) = {1, 5};  Line(6) = {5, 6};  Line(7) = {6, 7};  Line(8) = {7, 8};  Line(9) = {8, 3};
Curve Loop(2) = {5, 6, 7, 8, 9, -2, -1};
Plane Surface(2) = {2};
Physical Surface("rock") = {1};
Physical Surface("base") = {2};
Physical Curve("face") = {4};
""")

# %%
# The scene
# ---------
# Joint sets come by statistics: beds that dip 30° out of the slope, cross joints across them. Sets cut ``rock``
# alone.

SCENE = """
title = "My slope"

[geometry]
model = "my_slope.geo"
parameters = { height_m = 20 }
seed = 3
dead_ends = "trim"
smallest_block_m2 = 0.3

[[geometry.joint_sets]]
name = "beds"
angle_deg = 30
spacing_m = 2.5
zones = ["rock"]

[[geometry.joint_sets]]
name = "cross"
angle_deg = 112
angle_deviation_deg = 4
spacing_m = 3.2
zones = ["rock"]
ends_on = ["beds"]

[materials.rock]
youngs_modulus_pa = 20e9
poissons_ratio = 0.25
density_kg_m3 = 2600

[zones.base]
fixed = true

[joints.default]
friction_angle_deg = 35

[joints.beds]
edges = ["joint:beds"]
friction_angle_deg = 24

[loads]
gravity_m_s2 = [0, -9.81]

[dda]
dynamic_factor = 1.0
time_step_s = 0.01

[run]
end_time_s = 1.5
"""
(work / "my_slope.toml").write_text(SCENE)
scene = load_scene(work / "my_slope.toml")
problem = scene.problem()
print(problem.inventory)
sketch(scene).set_title("as drawn: grey is fixed")

# %%
# Run it
# ------
# ``geomech run my_slope.toml`` writes a run folder. Here we look at the cycles as they come, and write nothing.
# Beds at 30° under 24° of friction: it slides.

for cycle in geomech.cycles(scene):
    pass
moved = np.linalg.norm(cycle.motion.centre - cycle.motion.reference_centre, axis=1)
axes = sketch(cycle, values=moved, label="moved, m")
axes.set_title(f"after {cycle.state.time:g} s")

# %%
# Is it right? A rigid slab on a plane at 30° with friction of 24° goes
# :math:`\tfrac12 g (\sin 30° - \cos 30° \tan 24°)\,t^2`.
# The fastest block, once nothing stands in its way, moves like that:

slab = 0.5 * 9.81 * (np.sin(np.radians(30)) - np.cos(np.radians(30)) * np.tan(np.radians(24))) * cycle.state.time**2
print(f"fastest block {moved.max():.2f} m, slab on a plane {slab:.2f} m")

# %%
# The mistakes of the first day
# -----------------------------
# ``geomech check`` reads a scene and its drawing and says every error at once: where, what, and the way out. Nothing
# runs
# before it is content. We make the errors one by one:


def attempt(old: str, new: str, geo=("", "")) -> None:
    """Check the scene with one thing changed, in the scene or in the model."""
    folder = Path(tempfile.mkdtemp())
    (folder / "my_slope.geo").write_text((work / "my_slope.geo").read_text().replace(*geo))
    assert old in SCENE
    (folder / "my_slope.toml").write_text(SCENE.replace(old, new))
    try:
        found = load_scene(folder / "my_slope.toml")
        faults = found.warnings
    except SceneError as error:
        faults = error.errors
    for fault in faults:
        print(f"{fault.message}\n   → {fault.way_out}".replace(str(folder) + "/", ""))


# %%
# **Nothing is fixed.** Everything would fall through the drawing.

attempt("[zones.base]\nfixed = true\n", "")

# %%
# **The base is drawn, but no physical surface.** Then it is not read, and the rock hangs in the air.

attempt("[zones.base]\nfixed = true\n", "", geo=('Physical Surface("base") = {2};', ""))

# %%
# **A name that is misspelt**, in the scene and for a joint. The edges that a set makes are called ``joint:`` and its
# name.

attempt("[zones.base]", "[zones.bse]")
attempt('edges = ["joint:beds"]', 'edges = ["beds"]')

# %%
# **A key without its unit.** Units stand in the key's name, so that nobody has to guess.

attempt("friction_angle_deg = 24", "friction_angle = 24")

# %%
# **GPa where Pa belongs**, and tonnes where kilograms do. These are warnings: such rock may be meant.

attempt("20e9", "20")
attempt("density_kg_m3 = 2600", "density_kg_m3 = 2.6")

# %%
# **Gravity points up.**

attempt("[0, -9.81]", "[0, 9.81]")

# %%
# **A line of the model that refers to one that is not there.** Gmsh says what it could not read.

attempt("title", "title", geo=("Line(7) = {6, 7};", ""))

# %%
# **Joint sets cut the base too**, for no zone is named. That is no error, but hardly meant: blocks of the base are
# fixed
# one by one, and cost time.

cut_too = SCENE.replace('zones = ["rock"]', "")
(work / "cut_too.toml").write_text(cut_too)
print(problem.inventory, "→", load_scene(work / "cut_too.toml").problem().inventory)

# %%
# Mistakes that no check can see
# ------------------------------
# - **A wall where the slope should be free.** If ``base`` goes up in front of the face, nothing comes down. Draw it,
#   look at
#   the grey parts of ``geomech build``.
# - **No floor in front of the toe.** Blocks that come down fall out of the picture, and on.
# - **Sides that hold by friction.** Rock that lies against a fixed back leans on it with the default joint. Give
#   these
#   edges a law of their own if they should be smooth: ``between = [["back", "…"]]``.
# - **A joint set that is not what was meant**: angles count counter-clockwise from x. Beds at +30° dip to the left
#   here, out of the
#   slope; at −30° into it. ``build`` draws them with their names and prints what came out.
#
# Next: ``geomech safety my_slope.toml`` for the factor of safety, and :ref:`rock bridges
# <sphx_glr_gallery_plot_02_rock_bridges.py>`, where joints do not run through.

plt.close("all")
