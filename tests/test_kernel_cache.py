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


def test_an_upgrade_of_what_a_kernel_calls_compiles_it_anew(tmp_path):
    """Numba's own stamp is of the kernel's file only: the old code of what it calls, in another file, would be
    taken."""
    (tmp_path / "pkg").mkdir()
    (tmp_path / "pkg" / "__init__.py").touch()
    (tmp_path / "pkg" / "above.py").write_text(
        "from geomech.compiled import kept\nfrom .below import shifted\n"
        "@kept(nogil=True)\ndef scaled(x):\n    return 2.0 * shifted(x)\n"
    )
    code = "from pkg.above import scaled\nprint(scaled(1.0), sum(scaled.stats.cache_hits.values()))"
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    environment["PYTHONPATH"] = os.pathsep.join([str(tmp_path), str(Path(geomech.__file__).resolve().parents[1])])
    environment["PYTHONDONTWRITEBYTECODE"] = "1"

    def ran(shift: float) -> str:
        below = f"from numba import njit\n@njit\ndef shifted(x):\n    return x + {shift}\n"
        (tmp_path / "pkg" / "below.py").write_text(below)
        return subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment
        ).stdout.strip()

    # A result, and whether it was found compiled.
    assert [ran(1.0), ran(5.0), ran(5.0)] == ["4.0 0", "12.0 0", "12.0 1"]


def test_kernels_that_call_into_other_files_are_stamped_by_those_too():
    import importlib
    import pkgutil

    from numba.core.dispatcher import Dispatcher

    from geomech.compiled import WithCalled, compiled_in

    reaching, kernels, constants = 0, 0, set()
    for package in ("dda", "ddm", "coupling", "model"):
        for module in pkgutil.walk_packages([str(Path(geomech.__file__).parent / package)], f"geomech.{package}."):
            for value in vars(importlib.import_module(module.name)).values():
                if isinstance(value, Dispatcher) and value.__module__ == module.name and value._cache.cache_path:
                    kernels += 1
                    files, taken = compiled_in(value.py_func)
                    constants |= set(taken)
                    if files - {value.py_func.__code__.co_filename}:
                        reaching += 1
                        assert isinstance(value._cache._impl.locator, WithCalled), value
    assert kernels > 20 and reaching > 5
    # Numbers of other files are a part of the stamp by their value.
    assert "geomech.ddm.kernels.WIDTH" in constants
