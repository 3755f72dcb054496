"""What `geomech build` leaves: the same blocks in every file, statistics that add up, bridges where the rock is
whole."""

import json

import numpy as np
import pytest

from geomech.cli import main
from geomech.model import Blocks, Cracks
from geomech.scene import load_scene
from geomech.shapes import read_gmsh_model
from geomech.shapes.joint_networks.rock_bridges import rock_bridges

SCENE = """
title = "ledge"
[geometry]
[[geometry.zones]]
name = "rock"
rectangle = [0, 0, 10, 6]
[[geometry.zones]]
name = "base"
rectangle = [0, -1, 10, 0]
[[geometry.edges]]
name = "top"
line = [[0, 6], [10, 6]]
[[geometry.joints]]
name = "bed"
points = [[0, 2], [10, 2]]
[[geometry.joint_sets]]
name = "steep"
angle_deg = 90
spacing_m = 2.5
length_m = 1.5
gap_m = 1.0
region = [[0, 0], [10, 0], [10, 6], [0, 6]]
[materials.rock]
youngs_modulus_pa = 20e9
poissons_ratio = 0.25
density_kg_m3 = 2600
k_ic_pa_sqrt_m = 1e6
[zones.base]
fixed = true
[joints.default]
friction_angle_deg = 30
[loads]
gravity_m_s2 = [0, -9.81]
[[loads.tractions]]
edge = "top"
value_pa = [0, -1e5]
[run]
end_time_s = 1
"""


@pytest.fixture
def built(tmp_path, capsys):
    path = tmp_path / "ledge.toml"
    path.write_text(SCENE)
    assert main(["build", str(path), "--out", str(tmp_path / "build")]) == 0
    return load_scene(path).problem(), tmp_path / "build", capsys.readouterr().out


def test_every_file_holds_the_blocks(built):
    problem, folder, said = built
    told = json.loads((folder / "block_system.json").read_text())
    assert told["blocks"]["number"] == problem.blocks.n_blocks and told["area_m2"] == pytest.approx(70, rel=1e-12)
    assert sum(zone["blocks"] for zone in told["blocks"]["zones"]) == problem.blocks.n_blocks
    bed, steep = told["sets"]
    # One joint of 10 m in 60 m²; the second set as long as it was asked to be.
    assert bed["name"] == "bed" and bed["p21_per_m"] == pytest.approx(10 / 60, rel=1e-12)
    assert steep["asked"]["spacing_m"] == 2.5 and 0 < steep["p21_per_m"] <= 0.6 / 2.5 * 1.5
    # Asked and got stand under the same keys, in the file and in what is printed.
    assert set(steep["asked"]) <= set(steep) and steep["asked"]["persistence"] == pytest.approx(0.6)
    assert steep["persistence"] == pytest.approx(0.6, abs=0.15) and steep["mean_angle_deg"] == pytest.approx(90)
    assert "steep     asked" in said and "bed       got" in said
    sizes, topology = told["blocks"], told["topology"]
    assert sizes["d10_m"] <= sizes["d50_m"] <= sizes["d90_m"] and sizes["percent_passing_by_size_m"][-1][1] == 100
    assert topology["branches"] == (told["nodes"]["I"] + 3 * told["nodes"]["Y"] + 4 * told["nodes"]["X"]) / 2
    assert (folder / "joint_statistics.png").stat().st_size > 10_000
    assert told["cracks"]["number"] == problem.cracks.n_cracks > 0
    assert "P21" in said and (folder / "blocks.png").stat().st_size > 10_000
    import pyvista

    grid = pyvista.read(folder / "block_system.vtu").compute_cell_sizes(length=False, volume=False)
    each = np.bincount(grid["block_id"], grid["Area"])
    assert each == pytest.approx(problem.blocks.areas(), rel=1e-9)
    lines = pyvista.read(folder / "joint_lines.vtu")
    assert (lines["kind"] == 0).sum() == problem.blocks.n_vertices
    assert (lines["kind"] == 2).sum() == told["rock_bridges"]["number"]


def test_the_mesh_read_as_a_model_gives_the_same_blocks(built):
    problem, folder, _ = built
    drawing = read_gmsh_model(folder / "block_system.msh")
    assert drawing.warnings == () and drawing.joints == ()
    again = Blocks.from_polygons(
        [zone.loops for zone in drawing.zones], edge_names=[z.edge_names for z in drawing.zones]
    )
    assert again.areas() == pytest.approx(problem.blocks.areas(), rel=1e-12)
    for name in ("joint:bed", "top"):
        assert len(again.edges_named(name)) == len(problem.blocks.edges_named(name)) > 0
    assert [trace.name for trace in drawing.traces] == list(problem.cracks.names)


def test_bridges_run_from_end_to_end_and_to_what_is_ahead():
    square = Blocks.from_polygons([np.array([[0.0, 0], [10, 0], [10, 10], [0, 10]])])
    cracks = Cracks.from_polylines(
        # Two on a line, 2 m apart; one from the wall that would meet the first; each outer end meets the wall.
        [np.array([[1.0, 5], [3, 5]]), np.array([[5.0, 5.1], [8, 5.1]]), np.array([[2.0, 0], [2, 4]])],
        surface=[(False, False), (False, False), (True, False)],
    )
    bridges = rock_bridges(square, cracks)
    length = sorted(np.hypot(*(bridges[:, 1] - bridges[:, 0]).T))
    assert length == pytest.approx(sorted([1.0, np.hypot(2, 0.1), 2.0, 1.0]), rel=1e-12)
    assert rock_bridges(square, Cracks.from_polylines([])).shape == (0, 2, 2)


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("points", ["[[0, 9], [10, 9]]", "[[0, -0.5], [10, -0.5]]"], ids=["outside", "in fixed rock"])
def test_one_drawn_joint_that_cuts_nothing_that_moves_is_drawn_all_the_same(tmp_path, capsys, points):
    """Its angle in the rock is none, which the picture's legend has to say."""
    path = tmp_path / "ledge.toml"
    head, _, tail = SCENE.partition("[[geometry.joint_sets]]")
    path.write_text(head.replace("[[0, 2], [10, 2]]", points) + tail[tail.index("[materials.rock]") :])
    assert main(["build", str(path), "--out", str(tmp_path / "build")]) == 0
    (bed,) = json.loads((tmp_path / "build" / "block_system.json").read_text())["sets"]
    assert bed["mean_angle_deg"] is None and bed["p21_per_m"] == 0
    assert (tmp_path / "build" / "blocks.png").stat().st_size > 10_000
    assert "bed       got" in capsys.readouterr().out
