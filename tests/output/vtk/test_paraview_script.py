"""``view.py``: ParaView opens every series of a run, headless too."""

import ast
import os
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
import pyvista

import geomech
from geomech.output.vtk.paraview_script import ViewScript

SPECIMEN = Path(geomech.__file__).parent / "templates" / "specimen.toml"


@pytest.fixture(scope="module")
def specimen(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run") / "specimen"
    changes = {"run.end_time_s": 60.0, "run.stepping": "fixed", "dda.time_step_s": 20.0}
    geomech.run(geomech.load_scene(SPECIMEN, changes), out=folder)
    return folder


@pytest.mark.parametrize("configuration", ["reference", "current"])
def test_the_script_is_python_that_says_which_coordinates_it_draws(configuration, tmp_path):
    ViewScript(configuration).on_start(None, tmp_path)
    text = (tmp_path / "view.py").read_text(encoding="utf-8")
    ast.parse(text)
    # Current coordinates must not be moved a second time.
    assert f"REFERENCE = {configuration == 'reference'}" in text and f"are the {configuration} ones" in text


def test_files_name_the_arrays_that_are_shown_first(specimen):
    for series, active in (("tips", "K_eq"), ("contacts", "normal_force"), ("cracks", "opening")):
        mesh = geomech.open_run(specimen).mesh(series)
        assert mesh.point_data.active_scalars_name == active
    assert geomech.open_run(specimen).mesh("blocks").point_data.active_vectors_name == "displacement"


@pytest.mark.slow
def test_paraview_draws_the_run_and_writes_its_state(specimen, tmp_path):
    if not (shutil.which("pvbatch") and shutil.which("Xvfb")):
        pytest.skip("ParaView's pvbatch and Xvfb are not installed: apt-get install paraview xvfb")
    server = subprocess.Popen(["Xvfb", ":77", "-noreset", "-screen", "0", "1600x1200x24"], stderr=subprocess.DEVNULL)
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"} | {"DISPLAY": ":77"}
    try:
        while not Path("/tmp/.X11-unix/X77").exists() and server.poll() is None:
            time.sleep(0.1)
        done = subprocess.run(
            ["pvbatch", str(specimen / "view.py"), "--picture", "view.png", "--state", "view.pvsm"],
            cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300, check=False,
        )  # fmt: skip
    finally:
        server.terminate()
    assert done.returncode == 0, done.stderr
    assert "ERR|" not in done.stdout + done.stderr
    picture = pyvista.read(tmp_path / "view.png")["PNGImage"]
    assert len(np.unique(picture, axis=0)) > 50
    state = (tmp_path / "view.pvsm").read_text(encoding="utf-8")
    assert all(f'name="{name}"' in state for name in ("blocks", "outlines", "cracks", "tips", "contact forces",
                                                    "interior", "K at the tips", "time bar"))  # fmt: skip
