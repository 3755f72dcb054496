"""The Python that people guess: what `geomech` shows, overrides with Python values, runs opened as tables and meshes."""

import ast
import pydoc
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import geomech
from geomech.scene import SceneError

ROOT = Path(__file__).parents[1]
TUNNEL = ROOT / "geometry" / "tunnel.toml"


def test_the_citation_names_this_version():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {geomech.__version__}\n" in citation


def test_completion_help_and_type_checkers_show_the_same():
    stub = ast.parse((ROOT / "geomech" / "__init__.pyi").read_text(encoding="utf-8"))
    named = {alias.asname for node in stub.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert named | {"__version__"} == set(geomech.__all__) == set(dir(geomech))
    shown = pydoc.render_doc(geomech, renderer=pydoc.plaintext)
    assert all(name in shown for name in geomech._PUBLIC) and "__getattr__" not in shown


def test_an_import_loads_nothing_heavy():
    code = "import sys, geomech; dir(geomech); print(sorted({'numpy', 'numba', 'pandas', 'vtk'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stdout.strip() == "[]"


def test_overrides_are_python_values():
    changes = {
        "dda.time_step_s": np.float64(0.003), "geometry.seed": np.int64(5), "loads.gravity_m_s2": np.array([0.0, -5.0]),
        "zones.frame": {"fixed": True}, "joints.default.friction_angle_deg": 30,
    }  # fmt: skip
    scene = geomech.load_scene(TUNNEL, changes)
    tables = scene.tables
    assert tables.dda.time_step_s == 0.003 and tables.geometry.seed == 5
    assert tables.loads.gravity_m_s2 == (0.0, -5.0) and tables.joints["default"].friction_angle_deg == 30.0
    same = geomech.load_scene(TUNNEL, ["dda.time_step_s=0.003"])
    assert same.tables.dda == tables.dda


def test_overrides_that_cannot_be_are_told_all_at_once():
    with pytest.raises(SceneError) as refused:
        geomech.load_scene(TUNNEL, {"dda.time_step_s": object(), "dda.nothing": 1, "growth.enabled": False})
    assert len(refused.value.errors) == 2 and "is not possible in a scene" in str(refused.value)
    with pytest.raises(SceneError, match="is a single string"):
        geomech.load_scene(TUNNEL, "dda.time_step_s=1")


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run") / "specimen"
    scene = ROOT / "geomech" / "templates" / "specimen.toml"
    changes = {"run.end_time_s": 60.0, "run.stepping": "fixed", "dda.time_step_s": 20.0}
    geomech.run(geomech.load_scene(scene, changes), out=folder)
    return geomech.open_run(folder)


def test_an_opened_run_has_tables_and_meshes(opened):
    assert opened.history["cycle"].dtype.kind == "i" and opened.history["time"].iloc[-1] == 60.0
    assert set(opened.tips["crack_name"]) == {"flaw"} and (opened.tips["K_eq"] >= 0).all()
    assert opened.summary["title"] == opened.title == "My specimen" and "flaw" in str(opened.scene)
    assert {"blocks", "cracks", "tips"} <= set(opened.series)
    early, late = opened.mesh("blocks", time=20.0), opened.mesh("blocks")
    assert early.n_points == late.n_points and not np.array_equal(early["displacement"], late["displacement"])
    assert np.array_equal(opened.mesh("blocks", cycle=int(opened.history["cycle"].iloc[-1])).points, late.points)
    page = opened._repr_html_()
    assert "My specimen" in page and str(opened.folder) in page and repr(opened).startswith("<run 'My specimen'")


def test_what_a_run_has_not_got_is_said(opened, tmp_path):
    with pytest.raises(KeyError, match="it has blocks"):
        opened.mesh("bolts_of_air")
    with pytest.raises(KeyError, match="nothing was written up to"):
        opened.mesh(time=-1.0)
    with pytest.raises(ValueError, match="not both"):
        opened.mesh(cycle=1, time=1.0)
    with pytest.raises(FileNotFoundError, match=f"there are runs in {opened.folder}"):
        geomech.open_run(opened.folder.parent)
    with pytest.raises(FileNotFoundError, match=r"history.csv is missing"):
        geomech.open_run(tmp_path)
