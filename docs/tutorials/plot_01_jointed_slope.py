"""
A jointed slope, from an empty folder
=====================================

A slope 20 m high with two joint sets: drawn in Gmsh from nothing, checked, built, run, and its factor of safety found.
It takes a quarter of an hour, most of it reading. You need geomech :doc:`installed </start/install>`, a terminal and a
text editor. The second half makes the mistakes that most people make first, and shows what the program says to each.

Begin in an empty folder, with the environment active in which geomech is installed:

.. code-block:: sh

   mkdir my_slope && cd my_slope
"""

# %%
# 1. Draw the slope
# -----------------
# A Gmsh model is a text file. Save these lines as ``my_slope.geo`` in your folder:

MODEL = """
DefineConstant[
  height_m = {20, Name "Parameters/height_m"},
  face_angle_deg = {63, Name "Parameters/face_angle_deg"}
];
crest = height_m / Tan(face_angle_deg * Pi / 180);
back = crest + 18;
size = height_m / 8;

// The rock: toe, foot of the back, top of the back, crest
Point(1) = {0, 0, 0, size};            Point(2) = {back, 0, 0, size};
Point(3) = {back, height_m, 0, size};  Point(4) = {crest, height_m, 0, size};
Line(1) = {1, 2};  Line(2) = {2, 3};  Line(3) = {3, 4};  Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};

// The base: a floor in front of the toe, below the rock and behind it
Point(5) = {-12, 0, 0, size};          Point(6) = {-12, -3, 0, size};
Point(7) = {back + 3, -3, 0, size};    Point(8) = {back + 3, height_m, 0, size};
Line(5) = {1, 5};  Line(6) = {5, 6};  Line(7) = {6, 7};  Line(8) = {7, 8};  Line(9) = {8, 3};
Curve Loop(2) = {5, 6, 7, 8, 9, -2, -1};
Plane Surface(2) = {2};

Physical Surface("rock") = {1};
Physical Surface("base") = {2};
"""

# %%
# To see it, open it in Gmsh, which came with geomech: ``gmsh my_slope.geo``. The drawing follows every change of the
# file (press ``0`` in Gmsh to reload it). Values in ``DefineConstant`` stand in the panel on the left. You can also draw
# by mouse there (*Geometry → Elementary entities → Add*): Gmsh appends what you draw to the file.
#
# .. image:: /pictures/gmsh_my_slope.png
#    :alt: The slope in Gmsh's window, with its two parameters in the panel on the left
#
# Four rules connect a drawing to a scene:
#
# - A *physical surface* is a zone of rock, called by its name.
# - A *physical curve* called ``joint:NAME`` cuts the rock, and one called ``crack:NAME`` is a crack. Any other name marks
#   edges, for loads and joint laws.
# - What is in no physical group is not read.
# - ``base`` will be fixed. It supports the rock from below and from behind, and it goes on in front of the toe, because
#   blocks that come down need a floor to land on. The face of the slope is free: nothing is drawn there.
#
# 2. Write the scene
# ------------------
# The scene says what the drawing does not: joints, materials, loads, time. Save it as ``my_slope.toml`` beside the
# model. All values are in SI units and the unit stands in the name of the key.

SCENE = """
title = "My slope"

[geometry]
model = "my_slope.geo"
parameters = { height_m = 20 }
seed = 3                       # other seeds draw other joints by the same statistics
dead_ends = "trim"             # cut off the ends of joints that stop inside the rock
smallest_block_m2 = 0.3        # merge smaller blocks with a neighbour

[[geometry.joint_sets]]        # beds that dip out of the slope: angles count counter-clockwise from x
name = "beds"
angle_deg = 30
spacing_m = 2.5
zones = ["rock"]

[[geometry.joint_sets]]        # cross joints, nearly perpendicular to the beds
name = "cross"
angle_deg = 112
angle_deviation_deg = 4
spacing_m = 3.2
zones = ["rock"]

[materials.rock]
youngs_modulus_pa = 20e9
poissons_ratio = 0.25
density_kg_m3 = 2600

[zones.base]
fixed = true

[joints.default]               # all joints that no other law names
friction_angle_deg = 35

[joints.beds]
edges = ["joint:beds"]         # the edges that a joint set makes are called joint:NAME
friction_angle_deg = 24

[loads]
gravity_m_s2 = [0, -9.81]

[dda]
dynamic_factor = 1.0           # 1: motion in real time; 0: statics
time_step_s = 0.01

[run]
end_time_s = 1.5
"""

# %%
# The code below is only there to make this page: it saves both files in a temporary folder and types the commands for
# you.

import contextlib
import shlex
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import geomech
from geomech.cli import main
from geomech.render import sketch
from geomech.scene import SceneError, load_scene

work = Path(tempfile.mkdtemp(prefix="geomech-tutorial-"))
(work / "my_slope.geo").write_text(MODEL)
(work / "my_slope.toml").write_text(SCENE)


def terminal(command: str) -> None:
    """Run a geomech command here, as a terminal would."""
    with contextlib.chdir(work):
        main(shlex.split(command)[1:])


# %%
# 3. Check and build
# ------------------
# ``check`` reads the scene and its drawing and reports every error at once, with its line and the way out. Nothing runs
# before it is content.

terminal("geomech check my_slope.toml")

# %%
# It also warns of four slivers that it merged with their neighbours, because ``smallest_block_m2`` asked for it.
# ``build`` cuts the rock into blocks and draws them. It prints for each joint set what was asked for and what came out.

terminal("geomech build my_slope.toml --picture shown/blocks.png")

# %%
# Look at this picture before every first run. Hatched is what is fixed. Are the joints the ones you meant? Do the beds
# dip out of the slope? Is the face free?
#
# 4. Run
# ------
# The first run on a machine compiles the solvers, which takes about a minute. After that this run takes a few seconds.

terminal("geomech run my_slope.toml")

# %%
# The beds dip at 30° and have 24° of friction, so the slope slides. ``geomech render outputs/my_slope`` draws the end
# and a film of the motion; ``outputs/my_slope/blocks.pvd`` opens in :doc:`ParaView </start/paraview>`.

terminal("geomech render outputs/my_slope --no-gif")
(work / "outputs/my_slope/pictures/displacement.png").rename(work / "shown/end.png")

# %%
# Is it right? On a plane at 30° with 24° of friction a rigid slab moves by
# :math:`\tfrac12 g (\sin 30° - \cos 30° \tan 24°)\,t^2`. Most of the rock should move like that. Blocks at the face
# move farther, because they also topple.

last = geomech.open_run(work / "outputs/my_slope").mesh("blocks", time=1.5)
moved = np.sort(np.linalg.norm(last.point_data["displacement"], axis=1))
slab = 0.5 * 9.81 * (np.sin(np.radians(30)) - np.cos(np.radians(30)) * np.tan(np.radians(24))) * 1.5**2
print(
    f"a rigid slab moves {slab:.2f} m; the upper quarter of all corners moves {moved[-len(moved) // 4]:.2f} m or more"
)

# %%
# 5. How safe is it?
# ------------------
# ``safety`` divides the strength of all joints by a factor until no equilibrium is left.

terminal("geomech safety my_slope.toml")

# %%
# A slab on its bed alone would have :math:`\tan 24°/\tan 30° = 0.77`. The blocks at the face topple over the cross
# joints, and that makes it lower. With 35° on the beds as well:

terminal("geomech safety my_slope.toml --set joints.beds.friction_angle_deg=35 --picture shown/mechanism.png")

# %%
# That is the whole way: draw, check, build, run, look, find the factor. Any key can be changed for one run with
# ``--set``, and ``geomech check my_slope.toml --keys`` lists all of them.
#
# The mistakes of the first day
# -----------------------------
# We make them one by one and let ``check`` answer:


def attempt(old: str, new: str, geo=("", "")) -> None:
    """Check the scene with one thing changed, in the scene or in the model."""
    folder = Path(tempfile.mkdtemp())
    (folder / "my_slope.geo").write_text(MODEL.replace(*geo))
    assert old in SCENE
    (folder / "my_slope.toml").write_text(SCENE.replace(old, new))
    try:
        faults = load_scene(folder / "my_slope.toml").warnings
    except SceneError as error:
        faults = error.errors
    for fault in faults:
        if "sliver" not in fault.message:
            print(f"{fault.message}\n   → {fault.way_out}".replace(str(folder) + "/", ""))


# %%
# **Nothing is fixed.** Everything would fall.

attempt("[zones.base]\nfixed = true\n", "")

# %%
# **The base is drawn, but is no physical surface.** Then it is not read, and the rock hangs in the air.

attempt("[zones.base]\nfixed = true\n", "", geo=('Physical Surface("base") = {2};', ""))

# %%
# **A misspelt name**, of a zone and of a joint:

attempt("[zones.base]", "[zones.bse]")
attempt('edges = ["joint:beds"]', 'edges = ["beds"]')

# %%
# **A key without its unit:**

attempt("friction_angle_deg = 24", "friction_angle = 24")

# %%
# **GPa instead of Pa**, and tonnes instead of kilograms. These are warnings, since such rock may be meant.

attempt("20e9", "20")
attempt("density_kg_m3 = 2600", "density_kg_m3 = 2.6")

# %%
# **Gravity that points up:**

attempt("[0, -9.81]", "[0, 9.81]")

# %%
# **A line of the model that refers to one that does not exist.** Gmsh says what it could not read.

attempt("title", "title", geo=("Line(7) = {6, 7};", ""))

# %%
# **Joint sets that cut the base too**, because they name no zone. That is no error, but it is hardly meant: the base
# falls into blocks that are fixed one by one and cost time.

(work / "cut_too.toml").write_text(SCENE.replace('zones = ["rock"]', ""))
print(load_scene(work / "my_slope.toml").problem().inventory)
print(load_scene(work / "cut_too.toml").problem().inventory)

# %%
# Mistakes that no check can see
# ------------------------------
# - **A wall in front of the face.** If ``base`` goes up there, nothing comes down.
# - **No floor in front of the toe.** Blocks that come down fall out of the picture and go on falling.
# - **Friction at the back.** Rock that lies against a fixed back leans on it with the default joint law. If the back
#   should be smooth, name its edges in the model (``Physical Curve("back") = {2};``) and give them a law:
#   ``edges = ["back"]``.
# - **Beds that dip the wrong way.** Angles count counter-clockwise from x. In this drawing, whose face looks to the
#   left, beds at +30° dip out of the slope and beds at −30° dip into it:

(work / "into.toml").write_text(SCENE.replace("angle_deg = 30", "angle_deg = -30").replace("112", "68"))
figure, (left, right) = plt.subplots(1, 2, figsize=(11, 3.6), layout="constrained")
sketch(load_scene(work / "my_slope.toml"), left).set_title("angle_deg = 30: out of the slope")
sketch(load_scene(work / "into.toml"), right).set_title("angle_deg = −30: into the slope")

# %%
# Next: :ref:`rock bridges <sphx_glr_gallery_plot_02_rock_bridges.py>`, where joints do not run through.
