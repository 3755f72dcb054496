"""What an installation leaves behind, and what it says it needs."""

import importlib.util
import re
import sys
import tomllib
import types
from pathlib import Path

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
