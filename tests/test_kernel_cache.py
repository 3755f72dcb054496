"""Compiled kernels must not lie in the package: what pip does not know of, it leaves behind."""

import os
import subprocess
import sys
from pathlib import Path

import geomech


def cache_of(**environment) -> Path:
    code = "import geomech, numba; print(numba.config.CACHE_DIR)"
    clean = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env={**clean, **environment}
    )
    return Path(done.stdout.strip())


def test_kernels_are_kept_outside_the_package(tmp_path):
    package = Path(geomech.__file__).resolve().parent
    assert package not in cache_of().resolve().parents
    assert cache_of(XDG_CACHE_HOME=str(tmp_path)) == tmp_path / "geomech" / "kernels"


def test_the_users_own_choice_stands(tmp_path):
    assert cache_of(NUMBA_CACHE_DIR=str(tmp_path)) == tmp_path


def test_a_place_that_cannot_be_written_is_no_fault(tmp_path):
    # Below a file there can be no folder, not even for root.
    (tmp_path / "file").write_text("")
    code = (
        "import numpy as np\n"
        "from geomech.dda.moments import block_moments\n"
        "print(block_moments(np.array([[0, 0], [1, 0], [1, 1.0]]), np.array([1, 2, 0]), np.array([0, 3]))[0, 0])"
    )
    package = Path(geomech.__file__).resolve().parent
    before = set(package.rglob("*.nb[ci]"))
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "file" / "kernels")}
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True, env=environment)
    # Numba goes back to the folders of the sources.
    for left in set(package.rglob("*.nb[ci]")) - before:
        left.unlink()
    assert (done.returncode, done.stdout.strip()) == (0, "0.5"), done.stderr
