"""
A jointed slope, from an empty folder
=====================================

We draw a slope 20 m high with two joint sets in Gmsh, check it, build it, run it and find its factor of safety.
This takes a quarter of an hour, most of it reading. You need geomech :doc:`installed </start/install>`, a terminal and a
text editor. The second half shows common beginners' mistakes and how the program reports each of them.

Start in an empty folder, with geomech's environment activated:

.. code-block:: sh

   mkdir my_slope && cd my_slope
"""

# %%
# 1. Draw the slope
# -----------------
# A Gmsh model is a text file. Save these lines as ``my_slope.geo`` in your folder (the button in the corner of the box
# copies them):
#
# .. literalinclude:: /tutorials/my_slope.geo
#    :language: c
#
# To see it, open it in Gmsh, which was installed with geomech: ``gmsh my_slope.geo``. After a change of the file, press
# ``0`` in Gmsh to reload it. Values in ``DefineConstant`` appear in the panel on the left. You can also draw with the
# mouse (*Geometry → Elementary entities → Add*): Gmsh appends what you draw to the file.
#
# .. image:: /pictures/gmsh_my_slope.png
#    :alt: The slope in Gmsh's window, with its two parameters in the panel on the left
#
# Four rules connect a drawing to a scene:
#
# - A *physical surface* is a zone of rock, called by its name.
# - A *physical curve* called ``joint:NAME`` cuts the rock, and one called ``crack:NAME`` is a crack. Any other name marks
#   edges, for loads and joint laws.
# - Anything outside all physical groups is ignored.
# - ``base`` will be fixed. It supports the rock from below and from behind, and it extends in front of the toe, because
#   falling blocks need a floor to land on. The face of the slope is free: nothing is drawn there.
#
# 2. Write the scene
# ------------------
# The scene adds what the drawing does not contain: joints, materials, loads, time. Save it as ``my_slope.toml`` beside
# the model. All values are in SI units, and the unit is part of the key's name.
#
# .. literalinclude:: /tutorials/my_slope.toml
#    :language: toml
#
# The code below is only needed to make this page: it copies both files into a temporary folder and runs the commands
# there. In your terminal, type the text inside ``terminal("…")``.

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

here = Path.cwd()  # the project's folder, or one below it
files = next(path for folder in (here, *here.parents) if (path := folder / "docs/tutorials/my_slope.toml").is_file())
MODEL, SCENE = files.with_suffix(".geo").read_text(), files.read_text()
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
# ``check`` reads the scene and its drawing and reports all errors at once, each with its line and a remedy. Nothing can
# run until it finds no more errors.

terminal("geomech check my_slope.toml")

# %%
# It also warns that it merged four slivers with their neighbours, as ``smallest_block_m2`` asks.
# ``build`` cuts the rock into blocks and draws them. For each joint set it prints the requested and the obtained values.

terminal("geomech build my_slope.toml --picture shown/blocks.png")

# %%
# Look at this picture before every first run. Fixed blocks are hatched. Are the joints the ones you meant? Do the beds
# dip out of the slope? Is the face free?
#
# 4. Run
# ------
# The first run on a machine compiles the solvers, which takes about 20 s. After that this run takes a few seconds.

terminal("geomech run my_slope.toml")

# %%
# The beds dip at 30° and have a friction angle of 24°, so the slope slides. ``geomech render outputs/my_slope`` draws the
# final state and a film of the motion; ``outputs/my_slope/blocks.pvd`` opens in :doc:`ParaView </start/paraview>`.

terminal("geomech render outputs/my_slope --no-gif")
(work / "outputs/my_slope/pictures/displacement.png").rename(work / "shown/end.png")

# %%
# Is this correct? On a plane at 30° with 24° of friction, a rigid slab moves by
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
# ``safety`` divides the strength of all joints by an increasing factor until no equilibrium exists.

terminal("geomech safety my_slope.toml")

# %%
# A single slab on its bed would have :math:`\tan 24°/\tan 30° = 0.77`. The blocks at the face topple over the cross
# joints, which lowers the factor. With 35° on the beds as well:

terminal("geomech safety my_slope.toml --set joints.beds.friction_angle_deg=35 --picture shown/mechanism.png")

# %%
# That is the complete procedure: draw, check, build, run, look at the results, find the factor. Any key can be changed
# for one run with ``--set``, and ``geomech check my_slope.toml --keys`` lists all keys.
#
# Beginners' mistakes
# -------------------
# We make them one by one and let ``check`` report them:


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
# **The base is drawn, but is not a physical surface.** Then it is not read, and the rock has no support.

attempt("[zones.base]\nfixed = true\n", "", geo=('Physical Surface("base") = {2};', ""))

# %%
# **A misspelt name**, of a zone and of a joint:

attempt("[zones.base]", "[zones.bse]")
attempt('edges = ["joint:beds"]', 'edges = ["beds"]')

# %%
# **A key without its unit:**

attempt("friction_angle_deg = 24", "friction_angle = 24")

# %%
# **GPa instead of Pa**, and tonnes instead of kilograms. These give warnings only, since such values may be intended.

attempt("20e9", "20")
attempt("density_kg_m3 = 2600", "density_kg_m3 = 2.6")

# %%
# **Gravity pointing upwards:**

attempt("[0, -9.81]", "[0, 9.81]")

# %%
# **A line loop of the model that refers to a missing line.** Gmsh reports what it could not read.

attempt("title", "title", geo=("Line(7) = {6, 7};", ""))

# %%
# **Joint sets that also cut the base**, because they name no zone. This is not an error, but rarely intended: the base
# is divided into many fixed blocks, which cost time.

(work / "cut_too.toml").write_text(SCENE.replace('zones = ["rock"]', ""))
print(load_scene(work / "my_slope.toml").problem().inventory)
print(load_scene(work / "cut_too.toml").problem().inventory)

# %%
# Mistakes that no check can detect
# ---------------------------------
# - **A wall in front of the face.** If ``base`` extends upwards there, nothing can come down.
# - **No floor in front of the toe.** Falling blocks leave the picture and keep falling.
# - **Friction at the back.** The contact between the rock and a fixed back has the default joint law. If the back
#   should be smooth, name its edges in the model (``Physical Curve("back") = {2};``) and give them a law:
#   ``edges = ["back"]``.
# - **Beds that dip the wrong way.** Angles are measured counter-clockwise from x. In this drawing, whose face looks to
#   the left, beds at +30° dip out of the slope and beds at −30° dip into it:

(work / "into.toml").write_text(SCENE.replace("angle_deg = 30", "angle_deg = -30").replace("112", "68"))
figure, (left, right) = plt.subplots(1, 2, figsize=(11, 3.6), layout="constrained")
sketch(load_scene(work / "my_slope.toml"), left).set_title("angle_deg = 30: out of the slope")
sketch(load_scene(work / "into.toml"), right).set_title("angle_deg = −30: into the slope")

# %%
# Next: :ref:`rock bridges <sphx_glr_gallery_plot_02_rock_bridges.py>`, where joints are not persistent.
