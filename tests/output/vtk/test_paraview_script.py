"""``view.py``: ParaView opens every series of a run, headless too."""

import ast
import os
import shutil
import subprocess
from pathlib import Path
from xml.etree import ElementTree

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


def in_paraview(arguments, folder):
    """What Debian's pvbatch says, on a screen of its own. Skips where it is not installed."""
    if not (shutil.which("pvbatch") and shutil.which("Xvfb")):
        pytest.skip("ParaView's pvbatch and Xvfb are not installed: apt-get install paraview xvfb")
    reader, writer = os.pipe()
    command = ["Xvfb", "-displayfd", str(writer), "-noreset", "-screen", "0", "1600x1200x24"]
    server = subprocess.Popen(command, stderr=subprocess.DEVNULL, pass_fds=[writer])
    try:
        display = os.read(reader, 16).decode().strip()  # the first one that is free
        environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"} | {
            "DISPLAY": f":{display}"
        }
        done = subprocess.run(
            ["pvbatch", *arguments],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
    finally:
        server.terminate()
        server.wait()
        os.close(reader)
        os.close(writer)
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


@pytest.mark.slow
def test_paraview_draws_the_run_and_writes_its_state(specimen, tmp_path):
    said = in_paraview([str(specimen / "view.py"), "--picture", "view.png", "--state", "own.pvsm"], tmp_path)
    assert "ERR|" not in said
    picture = pyvista.read(tmp_path / "view.png")["PNGImage"]
    assert len(np.unique(picture, axis=0)) > 50
    state = (tmp_path / "own.pvsm").read_text(encoding="utf-8")
    assert all(f'name="{name}"' in state for name in ("blocks", "outlines", "cracks", "tips", "contact forces",
                                                    "interior", "K at the tips", "time bar"))  # fmt: skip


def test_the_state_opens_every_series_and_refers_to_nothing_that_is_missing(specimen):
    (state,) = ElementTree.parse(specimen / "view.pvsm").getroot()
    proxies = {proxy.get("id"): proxy for proxy in state if proxy.tag == "Proxy"}
    files = {name: proxies[number].find("Property/Element").get("value") for number, name in _items(state, "sources")
             if proxies[number].get("type") == "PVDReader"}  # fmt: skip
    assert files == {path.stem: str(path.resolve()) for path in specimen.glob("*.pvd")}
    referred = [each.get("value") for each in state.iter("Proxy") if each.get("value") is not None]
    assert set(referred) <= set(proxies)
    glyphs = {name for number, name in _items(state, "sources") if proxies[number].get("type") == "Glyph"}
    assert glyphs == {"K at the tips", "contact forces"}
    warped = [name for number, name in _items(state, "sources") if proxies[number].get("type") == "WarpVector"]
    assert "interior moved" in warped and "cracks moved" in warped
    (table,) = [proxies[number] for number, name in _items(state, "lookup_tables") if name.startswith("principal")]
    points = [float(each.get("value")) for each in table.findall("Property[@name='RGBPoints']/Element")][::4]
    stress = geomech.open_run(specimen).mesh("interior")["principal_stress"][:, 2]
    assert points == sorted(points) and points[0] == pytest.approx(np.percentile(stress, 0.7), rel=1e-6)


def _items(state, collection):
    return [(item.get("id"), item.get("name")) for item in state.findall(f"ProxyCollection[@name='{collection}']/Item")]


_LOAD = """
import sys
from paraview import simple as pv
pv.LoadState(sys.argv[1], **({"data_directory": sys.argv[3]} if len(sys.argv) > 3 else {}))
view, scene = pv.GetActiveView(), pv.GetAnimationScene()
view.ViewSize = [1200, 800]
scene.GoToLast()
print("times", len(scene.TimeKeeper.TimestepValues))
pv.SaveScreenshot(sys.argv[2], view)
"""


@pytest.mark.slow
def test_paraview_opens_the_state_also_of_a_folder_that_was_moved(specimen, tmp_path):
    load = tmp_path / "load.py"
    load.write_text(_LOAD)
    state = str(specimen / "view.pvsm")
    pictures = []
    for name in ("here", "moved"):
        arguments = [state, str(tmp_path / f"{name}.png")]
        if name == "moved":
            shutil.copytree(specimen, tmp_path / "elsewhere")
            text = (specimen / "view.pvsm").read_text(encoding="utf-8")
            (tmp_path / "elsewhere" / "view.pvsm").write_text(text.replace(str(specimen.resolve()), "/nowhere"))
            arguments = [str(tmp_path / "elsewhere" / "view.pvsm"), arguments[1], str(tmp_path / "elsewhere")]
        said = in_paraview([str(load), *arguments], tmp_path)
        assert f"times {len(geomech.open_run(specimen).history)}" in said and "ERR|" not in said
        pictures.append(pyvista.read(tmp_path / f"{name}.png")["PNGImage"])
    assert len(np.unique(pictures[0], axis=0)) > 200  # stress in colours, not a plain block
    assert (pictures[0] != pictures[1]).mean() < 0.01
