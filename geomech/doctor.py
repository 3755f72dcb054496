"""Is everything here that a run needs? Each check names what is missing and the one line that mends it."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass

#: Debian packages of the shared libraries that the wheels leave to the system.
DEBIAN = {
    "libGLU.so.1": "libglu1-mesa",
    "libGL.so.1": "libgl1",
    "libEGL.so.1": "libegl1",
    "libOpenGL.so.0": "libopengl0",
    "libOSMesa.so.8": "libosmesa6",
    "libXcursor.so.1": "libxcursor1",
    "libXft.so.2": "libxft2",
    "libXinerama.so.1": "libxinerama1",
    "libXrender.so.1": "libxrender1",
    "libXfixes.so.3": "libxfixes3",
    "libXext.so.6": "libxext6",
    "libX11.so.6": "libx11-6",
    "libSM.so.6": "libsm6",
    "libICE.so.6": "libice6",
    "libfontconfig.so.1": "libfontconfig1",
    "libfreetype.so.6": "libfreetype6",
    "libgomp.so.1": "libgomp1",
}

#: Distributions that runs and pictures import, gmsh apart, which has a check of its own.
PACKAGES = ("numpy", "scipy", "numba", "shapely", "pydantic", "tomli-w", "tqdm", "meshio", "vtk", "pyvista", "imageio",
            "matplotlib", "ezdxf")  # fmt: skip


@dataclass(frozen=True)
class Check:
    """``found`` is what is there or what is wrong; ``mend`` the way out, empty when ``good``."""

    name: str
    good: bool
    found: str
    mend: str = ""


def examine() -> list[Check]:
    """All checks, in the order a run meets them. Libraries that could take the process down load in another one."""
    checks: list[Callable[[], Check]] = [_python, _packages, _gmsh, _numba, _rendering, _threads]
    return [check() for check in checks]


def _python() -> Check:
    good = sys.version_info >= (3, 11)
    return Check("python", good, platform.python_version(), "" if good else "geomech needs Python 3.11 or newer")


def _packages() -> Check:
    found, missing = [], []
    for package in PACKAGES:
        try:
            found.append(f"{package} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            missing.append(package)
    if missing:
        mend = f"{sys.executable} -m pip install {' '.join(missing)}"
        return Check("packages", False, f"missing: {', '.join(missing)}", mend)
    return Check("packages", True, ", ".join(found))


def _gmsh() -> Check:
    code = "import gmsh; gmsh.initialize(interruptible=False, readConfigFiles=False); print(gmsh.__version__)"
    return check_import("gmsh", code, "pip install gmsh")


def check_import(name: str, code: str, without: str) -> Check:
    """Run ``code`` in a new process. Where a shared library is missing, name it and all others that are."""
    done = _run(code)
    if done.returncode == 0:
        return Check(name, True, done.stdout.strip())
    missing = missing_libraries(done.stderr)
    if missing:
        # The loader stops at the first one; ldd tells the rest, so that one install is enough.
        missing = list(dict.fromkeys(missing + _also_missing(name)))
        return Check(name, False, f"missing shared libraries: {', '.join(missing)}", apt_line(missing))
    last = (done.stderr.strip().splitlines() or [f"ended with code {done.returncode}"])[-1]
    return Check(name, False, last, without)


def missing_libraries(message: str) -> list[str]:
    """Shared libraries that a loader's or ldd's ``message`` says it cannot find."""
    loader = re.findall(r"(\S+\.so[\d.]*): cannot open shared object file", message)
    ldd = re.findall(r"^\s*(\S+\.so[\d.]*) => not found", message, flags=re.MULTILINE)
    return list(dict.fromkeys([*loader, *ldd]))


def apt_line(libraries: list[str]) -> str:
    """The line that installs ``libraries`` on Debian and Ubuntu."""
    known = [DEBIAN[library] for library in libraries if library in DEBIAN]
    unknown = [library for library in libraries if library not in DEBIAN]
    line = f"apt-get install -y {' '.join(dict.fromkeys(known))}" if known else ""
    search = f"find the packages of {', '.join(unknown)} with: apt-file search NAME" if unknown else ""
    return "; ".join(filter(None, [line, search]))


def _also_missing(package: str) -> list[str]:
    try:
        files = importlib.metadata.files(package) or []
    except importlib.metadata.PackageNotFoundError:
        return []
    libraries = [str(file.locate()) for file in files if re.search(r"\.so[\d.]*$", file.name)]
    if not libraries:
        return []
    try:
        told = subprocess.run(["ldd", *libraries], capture_output=True, text=True, timeout=30, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return []
    return missing_libraries(told.stdout)


def _numba() -> Check:
    # Compiled kernels are kept beside their modules or in NUMBA_CACHE_DIR; there, this user must be able to write.
    code = (
        "import importlib.util, pathlib, tempfile, numba\n"
        "place = numba.config.CACHE_DIR or str(pathlib.Path(importlib.util.find_spec('geomech').origin).parent)\n"
        "with tempfile.TemporaryFile(dir=place): pass\n"
        "print('numba', numba.__version__ + ', kernels kept in', place)"
    )
    done = _run(code)
    if done.returncode == 0:
        return Check("numba cache", True, done.stdout.strip())
    last = (done.stderr.strip().splitlines() or ["?"])[-1]
    return Check("numba cache", False, last, "export NUMBA_CACHE_DIR=$HOME/.cache/geomech")


def _rendering() -> Check:
    from .render.offscreen import APT_LINE, usable_window

    window = usable_window()
    if window is None:
        return Check("rendering", False, "no off-screen window: no pictures, all else works", APT_LINE)
    return Check("rendering", True, window)


def _threads() -> Check:
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    limits = [f"{name}={os.environ[name]}" for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS") if name in os.environ]
    return Check("threads", True, " ".join([f"{usable} usable cores", *limits]))


def _run(code: str) -> subprocess.CompletedProcess[str]:
    try:
        return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    except subprocess.TimeoutExpired as late:
        return subprocess.CompletedProcess(late.cmd, 1, "", "no answer within 120 s")
