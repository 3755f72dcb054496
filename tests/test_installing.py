"""What an installation leaves behind, and what it says it needs."""

import importlib.util
import os
import re
import subprocess
import sys
import tomllib
import types
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def test_no_build_folder_is_read_or_left(tmp_path, monkeypatch):
    """Modules that the sources no longer have would be installed from it."""
    monkeypatch.chdir(tmp_path)
    stale = tmp_path / "build" / "lib" / "geomech" / "gone.py"
    stale.parent.mkdir(parents=True)
    stale.touch()

    def build_wheel(folder, settings, metadata):
        assert not stale.exists()
        stale.parent.mkdir(parents=True)
        return f"{folder}.whl"

    setuptools = types.ModuleType("setuptools")
    setuptools.build_meta = types.ModuleType("setuptools.build_meta")
    setuptools.build_meta.build_wheel = build_wheel
    monkeypatch.setitem(sys.modules, "setuptools", setuptools)
    monkeypatch.setitem(sys.modules, "setuptools.build_meta", setuptools.build_meta)
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]
    (folder,) = settings["backend-path"]
    found = importlib.util.spec_from_file_location("backend", ROOT / folder / f"{settings['build-backend']}.py")
    backend = importlib.util.module_from_spec(found)
    found.loader.exec_module(backend)
    assert backend.build_wheel("dist") == "dist.whl"
    assert not (tmp_path / "build").exists()


def test_the_line_of_the_readme_works_without_sudo():
    """Root in a container has none."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert re.findall(r"(?<!command -v )\bsudo\b", text) == []
    assert "$(command -v sudo) apt-get install" in text


SPECIMEN = """
[geometry]
zones = [{ name = "rock", rectangle = [-0.03, -0.06, 0.03, 0.06] }]
cracks = [{ name = "flaw", points = [[-0.005, 0.0], [0.005, 0.002]] }]
edges = [
    { name = "load:top", line = [[-0.03, 0.06], [0.03, 0.06]] },
    { name = "load:bottom", line = [[-0.03, -0.06], [0.03, -0.06]] },
]
[materials.rock]
youngs_modulus_pa = 17e9
poissons_ratio = 0.21
density_kg_m3 = 2200
k_ic_pa_sqrt_m = 1e6
[[loads.tractions]]
edge = "load:top"
rate_pa_per_s = [0.0, 0.05e6]
[[loads.tractions]]
edge = "load:bottom"
rate_pa_per_s = [0.0, -0.05e6]
[dda]
time_step_s = 10.0
max_displacement_ratio = 1.0
[growth]
increment_m = 6e-3
[run]
end_time_s = 400.0
stop_at = ["split"]
"""


@pytest.mark.slow
def test_the_lowest_versions_that_are_said_to_do_run_draw_and_read(tmp_path):
    """An environment with exactly the lower bounds of pyproject.toml: a specimen run to its end, drawn and reported, a
    Gmsh model and a DXF drawing read. It takes a quarter of an hour, most of it compiling."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lowest = [bound.replace(">=", "==") for bound in project["dependencies"]]
    assert all(re.fullmatch(r"[a-z0-9-]+==[0-9.]+", bound) for bound in lowest)
    venv.create(tmp_path / "low", with_pip=True)
    python = tmp_path / "low" / "bin" / "python"
    got = subprocess.run([python, "-m", "pip", "install", "-q", *lowest], check=False, capture_output=True, text=True)
    if got.returncode and re.search("connection|resolution|network|timed out", got.stderr, re.IGNORECASE):
        pytest.skip("no package registry can be reached")
    assert got.returncode == 0, got.stderr
    (tmp_path / "scene.toml").write_text(SPECIMEN)
    around = os.environ | {"PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    for arguments in (
        ("run", tmp_path / "scene.toml", "--out", tmp_path / "run"),
        ("render", tmp_path / "run"),
        ("report", tmp_path / "run"),
        ("check", ROOT / "geometry" / "tunnel.toml"),
        ("build", ROOT / "geometry" / "traced_slope.toml", "--out", tmp_path / "build"),
    ):
        done = subprocess.run(
            [python, "-m", "geomech", *arguments], check=False, capture_output=True, text=True, env=around
        )
        assert done.returncode == 0, (arguments, done.stderr)
