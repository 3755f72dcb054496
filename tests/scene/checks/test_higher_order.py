"""Blocks of higher order in scenes: what they cannot do yet is refused by name, what they can reaches the files."""

from __future__ import annotations

import numpy as np
import pytest
from small_scenes import PLATE, block

from geomech.model import AUTO_ORDER
from geomech.output import Run
from geomech.pipeline import run
from geomech.resumption import resume
from geomech.scene import SceneError, load_scene

BENDING = block("A block that bends", moving=True) + "[zones.block]\norder = 4\n"


def scene(tmp_path, *more: str, text: str = BENDING):
    path = tmp_path / "scene.toml"
    path.write_text(text + "".join(more), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("[joints.default]\nfriction_angle_deg = 30\nrestitution = 0.4\n", r"\[joints.default\] restitution"),
        ("[joints.default]\nfriction_angle_deg = 30\njrc = 8\njcs_pa = 1e8\n", "softens, dilates or closes"),
    ],
)
def test_what_is_not_supported_is_refused_at_its_key(tmp_path, more, message):
    with pytest.raises(SceneError, match=message) as error:
        load_scene(scene(tmp_path, more))
    assert "zones.block.order" in str(error.value) and "order = 4: " in str(error.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("order = 4", "order = 9", "9"),
        ("order = 4", "order = 1\nmesh_size_m = 0.5", "cells need an order of 2 to 8"),
        ("order = 4", "order = 2\nmesh_size_m = 0.0", "mesh_size_m"),
        ("order = 4", 'order = 2\ncell_joint = "grain"', "needs cells"),
        ("order = 4", 'order = 2\nmesh_size_m = 0.4\ncell_joint = "grain"', r"no \[joints.grain\]"),
        (
            "order = 4",
            'order = 2\nmesh_size_m = 0.4\ncell_joint = "grain"\n[joints.grain]\nfriction_angle_deg = 30',
            "no tensile strength",
        ),
        ("[zones.ground]\nfixed = true", "[zones.ground]\nfixed = true\nmesh_size_m = 0.5", "is not divided"),
        ("order = 4", 'order = "high"', "auto"),
        (
            "order = 4",
            'order = "auto"\n[loads.in_situ]\nsurface_m = 1.0\nunit_weight_n_per_m3 = 2e4\nk0 = 1.0',
            'order = "auto": in-situ',
        ),
        ("[zones.ground]\nfixed = true", "[zones.ground]\nfixed = true\norder = 2", "does not bend"),
        ("dynamic_factor = 1.0", "dynamic_factor = 1.0\nspectral_radius = 0.8", "gamma = 2 beta"),
        ("dynamic_factor = 1.0", 'dynamic_factor = 1.0\ncontact = "augmented"', "stiff penalty springs"),
    ],
)
def test_settings_that_do_not_go_with_it_are_refused(tmp_path, old, new, message):
    assert old in BENDING
    with pytest.raises(SceneError, match=message):
        load_scene(scene(tmp_path, text=BENDING.replace(old, new)))


@pytest.mark.parametrize(
    ("order", "more", "told"), [("4", "", 1), ('"auto"', "", 1), ("1", "", 0), ("3", "\nmesh_size_m = 0.3", 0)]
)
def test_blocks_with_large_holes_are_reported(tmp_path, order, more, told):
    """9.9 % of the area, less than a block with cells or of first order is warned of."""
    text = BENDING.replace("order = 4", f"order = {order}{more}")
    drawn = "rectangle = [1, 0, 2, 1]"
    assert drawn in text
    text = text.replace(drawn, drawn + ", holes = [[[1.4, 0.4], [1.4, 0.7], [1.7, 0.7], [1.7, 0.4]]]")
    found = [w for w in load_scene(scene(tmp_path, text=text)).warnings if "holes of" in w.message]
    assert len(found) == told and all("mesh_size_m" in w.way_out for w in found)


def test_stress_inside_and_bent_outlines_are_written_and_a_run_resumes(tmp_path):
    """A block under its weight: what is written of its inside has the mean stress of the block, and varies. A run that goes
    on from its checkpoint writes what one that was not broken off does."""
    more = '[[monitors]]\nname = "top"\nat = [1.5, 0.9]\n[output]\ncheckpoint_every = 1\n'
    folder = tmp_path / "run"
    run(load_scene(scene(tmp_path, more)), folder)
    results = Run(folder)
    inside, blocks = results.grid("interior", 3), results.grid("blocks", 3)
    stress = np.asarray(inside["stress"])[:, 1]
    mean = np.asarray(blocks["stress"])[np.asarray(blocks["block_id"]) == 1][0, 1]
    assert stress.min() < mean < stress.max() <= 0.02 * -stress.min()
    assert results.grid("outlines", 3).n_cells == 4 + 4 * 12
    moved = results.history["top_uy"]
    assert moved[-1] < 0
    # Resumed at a later end, and run to it at once.
    whole = tmp_path / "whole"
    resume(folder, ("run.end_time_s=0.05",), quiet=True)
    run(load_scene(scene(tmp_path, more), ("run.end_time_s=0.05",)), whole)
    for name in ("history.csv", "contacts.pvd"):
        assert (folder / name).read_bytes() == (whole / name).read_bytes()
    assert np.array_equal(Run(folder).grid("interior", 5)["stress"], Run(whole).grid("interior", 5)["stress"])


def test_an_order_that_is_found_reaches_the_run(tmp_path):
    """The only block of a scene stores all there is: it is raised, and what is inside it is written."""
    text = BENDING.replace("order = 4", 'order = "auto"').replace("[dda]", "[dda]\norder_target = 0.02", 1)
    more = "[output]\ncheckpoint_every = 1\n"
    loaded = load_scene(scene(tmp_path, more, text=text))
    problem = loaded.problem()
    assert problem.blocks.order.tolist() == [1, AUTO_ORDER] and problem.dda.order_target == 0.02
    folder, whole = tmp_path / "run", tmp_path / "whole"
    run(loaded, folder)
    resume(folder, ("run.end_time_s=0.05",), quiet=True)
    run(load_scene(scene(tmp_path, more, text=text), ("run.end_time_s=0.05",)), whole)
    assert (folder / "history.csv").read_bytes() == (whole / "history.csv").read_bytes()
    assert np.ptp(np.asarray(Run(folder).grid("interior", 3)["stress"])[:, 1]) > 0


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("shape", ["quads", "triangles"])
def test_a_zone_of_cells_runs_and_resumes(tmp_path, shape):
    """Cells keep the names of the edges they lie on, and a monitor between two of them moves as either; the run goes on from
    its checkpoint as if it had not been broken off."""
    more = '[[monitors]]\nname = "top"\nat = [1.5, 0.5]\n[output]\ncheckpoint_every = 1\n'
    text = BENDING.replace("order = 4", f'order = 2\nmesh_size_m = 0.4\ncells = "{shape}"')
    loaded = load_scene(scene(tmp_path, more, text=text))
    blocks, cells = loaded.blocks, np.arange(1, loaded.blocks.n_blocks)
    assert len(cells) >= 4
    assert blocks.areas()[cells].sum() == pytest.approx(1.0, rel=1e-12)
    assert blocks.names[1] == "block#1" and set(loaded.drawing.zones[1:]) == {"block"}
    folder, whole = tmp_path / "run", tmp_path / "whole"
    run(loaded, folder)
    assert Run(folder).history["top_uy"][-1] < 0
    resume(folder, ("run.end_time_s=0.05",), quiet=True)
    run(load_scene(scene(tmp_path, more, text=text), ("run.end_time_s=0.05",)), whole)
    for name in ("history.csv", "contacts.pvd"):
        assert (folder / name).read_bytes() == (whole / name).read_bytes()


@pytest.mark.parametrize("zone", ["order = 3", "order = 2\nmesh_size_m = 0.4"])
def test_a_scene_begins_under_in_situ_stress(tmp_path, zone):
    """Under the stress of its weight the block stands where it is drawn, and has the stress of its depth inside."""
    more = '[[monitors]]\nname = "top"\nat = [1.5, 1.0]\n'
    field = "[loads.in_situ]\nsurface_m = 1.0\nunit_weight_n_per_m3 = 26487\nk0 = 0.0\n"
    text = BENDING.replace("order = 4", zone)
    loaded = load_scene(scene(tmp_path, more, field, text=text))
    density = loaded.problem().materials[0].density
    loaded = load_scene(scene(tmp_path, more, field.replace("26487", repr(9.81 * density)), text=text))
    run(loaded, tmp_path / "run")
    run(load_scene(scene(tmp_path, more, text=text)), tmp_path / "dropped")
    moved, fallen = (abs(Run(tmp_path / name).history["top_uy"][-1]) for name in ("run", "dropped"))
    assert moved < 1e-3 * fallen
    inside = Run(tmp_path / "run").grid("interior", 3)
    stress = np.asarray(inside["stress"])[:, 1]
    assert stress.min() == pytest.approx(-9.81 * density, rel=1e-2) and abs(stress.max()) < 1e-2 * 9.81 * density


def test_cells_of_a_scene_are_excavated(tmp_path):
    """A polygon takes whole cells by their centroids, and they bear nothing from then on; the run resumes after it."""
    more = "[[loads.excavations]]\ntime_s = 0.02\npolygon = [[0.9, 0.45], [2.1, 0.45], [2.1, 1.1], [0.9, 1.1]]\n"
    text = BENDING.replace("order = 4", 'order = 2\nmesh_size_m = 0.5\ncells = "quads"')
    folder, whole = tmp_path / "run", tmp_path / "whole"
    more += "[output]\ncheckpoint_every = 1\n"
    run(load_scene(scene(tmp_path, more, text=text)), folder)
    resume(folder, ("run.end_time_s=0.05",), quiet=True)
    run(load_scene(scene(tmp_path, more, text=text), ("run.end_time_s=0.05",)), whole)
    assert (folder / "history.csv").read_bytes() == (whole / "history.csv").read_bytes()
    blocks = Run(whole).grid("blocks", 5)
    assert len(np.unique(np.asarray(blocks["block_id"])[np.asarray(blocks["removed"]) == 1])) == 2
    gone = np.unique(np.asarray(blocks["block_id"])[np.asarray(blocks["removed"]) == 1])
    inside = Run(whole).grid("interior", 5)
    taken = np.isin(np.asarray(inside["block_id"]), gone)
    corners = inside.cells.reshape(-1, 4)[:, 1:]
    assert taken.any() and not np.asarray(inside["stress"])[corners[taken]].any()
    assert np.asarray(inside["stress"])[corners[~taken]].any()


def test_a_bolted_block_on_a_shaken_base_runs_and_resumes(tmp_path):
    more = """[[loads.bolts]]
name = "tie"
start = [1.5, 0.8]
end = [1.5, -0.5]
stiffness_n_per_m = 1e7
pretension_n_per_m = 1e4
[loads.base]
frame = "ground"
acceleration_m_s2 = [1.0, 0.0]
frequency_hz = 5.0
[output]
checkpoint_every = 1
"""
    folder, whole = tmp_path / "run", tmp_path / "whole"
    run(load_scene(scene(tmp_path, more)), folder)
    resume(folder, ("run.end_time_s=0.05",), quiet=True)
    run(load_scene(scene(tmp_path, more), ("run.end_time_s=0.05",)), whole)
    assert (folder / "history.csv").read_bytes() == (whole / "history.csv").read_bytes()


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("zone", ["order = 3", "order = 2\nmesh_size_m = 0.5"])
def test_a_zone_that_bends_is_driven_and_resumes(tmp_path, zone):
    more = """[[loads.point_motions]]
at = [1.5, 1.0]
axes = "y"
velocity_m_per_s = [0, -1e-4]
[output]
checkpoint_every = 1
"""
    text, folder, whole = BENDING.replace("order = 4", zone), tmp_path / "run", tmp_path / "whole"
    run(load_scene(scene(tmp_path, more, text=text)), folder)
    resume(folder, ("run.end_time_s=0.05",), quiet=True)
    run(load_scene(scene(tmp_path, more, text=text), ("run.end_time_s=0.05",)), whole)
    assert (folder / "history.csv").read_bytes() == (whole / "history.csv").read_bytes()
    motion = more.replace("point_motions", "motions").replace("at = [1.5, 1.0]", 'zone = "block"')
    run(load_scene(scene(tmp_path, motion, text=text)), tmp_path / "zone")
    blocks = Run(tmp_path / "zone").grid("blocks", 3)
    assert np.asarray(blocks["displacement"])[:, 1].min() < -2e-6


def test_cells_have_the_joint_by_which_they_part(tmp_path):
    text = BENDING.replace("order = 4", 'order = 2\nmesh_size_m = 0.6\ncell_joint = "grain"')
    more = "[joints.grain]\nfriction_angle_deg = 30\ntensile_strength_pa = 1e6\ncohesion_pa = 2e6\n"
    problem = load_scene(scene(tmp_path, more, text=text)).problem()
    edge, mate = problem.blocks.glued[0]
    names = [problem.blocks.edge_names[problem.blocks.edge_name[v]] for v in (edge, mate)]
    assert names == ["cells:block", "cells:block"]
    assert problem.joints[problem.joint_index(*names)].name == "grain"


CRACKED = BENDING.replace(
    "[materials", 'cracks = [{ name = "flaw", points = [[1.5, 0.0], [1.5, 0.3]] }]\n[materials', 1
).replace("density_kg_m3 = 2000", "density_kg_m3 = 2000\nk_ic_pa_sqrt_m = 1e3")


def test_cracks_that_begin_are_refused_in_cells(tmp_path):
    cells = "order = 4\nmesh_size_m = 0.4"
    begin = BENDING.replace("order = 4", cells) + '[growth]\ninitiation = "surface"\n'
    with pytest.raises(SceneError, match="are not supported in cells") as error:
        load_scene(scene(tmp_path, text=begin))
    assert "zones.block.order" in str(error.value)
    assert load_scene(scene(tmp_path, text=CRACKED.replace("order = 4", cells))).problem().cracks.n_segments == 1


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("order", ["3", '"auto"', "3\nmesh_size_m = 0.5\ncrack_margin_m = 0.4"])
def test_a_cracked_block_of_higher_order_resumes_to_the_bit(tmp_path, order):
    """A plate of order 3, or of an automatic one, that is pulled until its crack has cut it in two, and the same from a checkpoint on the way."""
    text = PLATE + f"\n[zones.rock]\norder = {order}\n"
    path = scene(tmp_path, text=text)
    whole, part = tmp_path / "whole", tmp_path / "part"
    told = run(load_scene(path), whole)
    assert told["crack_growth_m"] > 0.0 and told["blocks"] == 2
    end = load_scene(path).problem().run.end_time
    run(load_scene(path, {"run.end_time_s": 0.3 * end}), part)
    resume(part, {"run.end_time_s": end})
    assert (part / "history.csv").read_bytes() == (whole / "history.csv").read_bytes()
