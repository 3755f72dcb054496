"""Every tutorial of the manual runs as the script that it is."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("plot_*.py"))
#: Run by default: the quick ones that ask for nothing but what geomech itself needs.
QUICK = {"plot_07_hydraulic_fracture.py"}


@pytest.mark.parametrize(
    "script",
    [pytest.param(path, marks=() if path.name in QUICK else pytest.mark.slow, id=path.stem) for path in TUTORIALS],
)
def test_a_tutorial_runs(script):
    for library in ("pandas", "xarray"):
        if f"import {library}" in script.read_text(encoding="utf-8") and importlib.util.find_spec(library) is None:
            pytest.skip(f"{library} is not installed")
    around = os.environ | {"MPLBACKEND": "Agg", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, script], cwd=ROOT, env=around, capture_output=True, text=True, timeout=900, check=False
    )
    assert done.returncode == 0, done.stderr


def test_there_are_as_many_as_the_manual_says():
    assert [path.name[5:7] for path in TUTORIALS] == [f"{k:02d}" for k in range(1, len(TUTORIALS) + 1)]
    for path in TUTORIALS:
        title, line = path.read_text(encoding="utf-8").splitlines()[1:3]
        assert set(line) == {"="} and len(line) >= len(title), path.name
