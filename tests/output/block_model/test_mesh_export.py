"""Block systems as meshes of other programs, and such meshes as drawings: there and back is the same."""

from pathlib import Path

import meshio
import numpy as np
import pytest

from geomech.cli import BAD_INPUT, main
from geomech.output.block_model.mesh_export import export_blocks
from geomech.scene import load_scene
from geomech.shapes import GmshModelError, read_gmsh_model

SLOPE = Path(__file__).parents[3] / "geometry" / "two_set_slope.toml"
#: Formats keep at least twelve digits of metres.
DIGITS = 1e-9


@pytest.fixture(scope="module")
def slope():
    return load_scene(SLOPE, to_run=False)


def test_an_exported_slope_is_read_as_the_same_blocks(slope, tmp_path):
    problem = slope.problem()
    export_blocks(problem, slope.drawing.zones, tmp_path / "slope.inp")
    drawing = read_gmsh_model(tmp_path / "slope.inp")
    assert sorted(zone.name for zone in drawing.zones) == sorted(slope.drawing.zones)
    areas = sorted(_area(zone.loops) for zone in drawing.zones)
    assert areas == pytest.approx(sorted(problem.blocks.areas()), rel=DIGITS)
    assert sorted(trace.name for trace in drawing.traces) == sorted(problem.cracks.names)
    named = {label for zone in drawing.zones for loop in zone.edge_names for label in loop} - {""}
    assert named == {name for name in problem.blocks.edge_names if name}


def _area(loops) -> float:
    return sum(0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) for x, y in (loop.T for loop in loops))


@pytest.mark.parametrize("suffix", [".vtk", ".vtu"])
def test_integers_of_cells_tell_zones_apart_where_names_are_lost(slope, tmp_path, suffix):
    problem = slope.problem()
    export_blocks(problem, slope.drawing.zones, tmp_path / f"slope{suffix}")
    drawing = read_gmsh_model(tmp_path / f"slope{suffix}")
    assert {zone.name for zone in drawing.zones} == {"zone 0", "zone 1"} and len(drawing.zones) == 20


def test_meshes_of_a_size_fill_the_blocks(slope, tmp_path):
    problem = slope.problem()
    export_blocks(problem, slope.drawing.zones, tmp_path / "fine.vtu", size=2.0)
    mesh = meshio.read(tmp_path / "fine.vtu")
    a, b, c = (mesh.points[mesh.cells_dict["triangle"][:, k], :2] for k in range(3))
    cross = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert 0.5 * abs(cross).sum() == pytest.approx(problem.blocks.areas().sum(), rel=1e-12)
    sides = np.hypot(*(b - a).T)
    assert len(cross) > 300 and 1.0 < np.median(sides) < 3.0


def test_what_cannot_be_written_or_read_is_refused(slope, tmp_path, capsys):
    for words in (["--export", str(tmp_path / "slope.xyz")], ["--mesh-size", "1"], ["--mesh-size", "-1"]):
        assert main(["build", str(SLOPE), "--out", str(tmp_path / "out"), *words]) == BAD_INPUT
        assert words[0] in capsys.readouterr().err
    (tmp_path / "more.inp").write_text("*HEADING\n*NODE\n*INCLUDE, INPUT=/etc/hostname\n")
    with pytest.raises(GmshModelError, match=r"more\.inp:3: \*INCLUDE"):
        read_gmsh_model(tmp_path / "more.inp")
    (tmp_path / "cut.vtk").write_text("# vtk DataFile Version 4.2\nslope\nASCII\nDATASET UNSTRUCTURED_GRID\nPOI")
    with pytest.raises(GmshModelError, match="cannot be read"):
        read_gmsh_model(tmp_path / "cut.vtk")
