"""Checks that everything needed for a run is installed; each names what is missing and the command that installs it."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

#: Debian packages of the shared libraries that wheels expect in the system.
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

#: Distributions that runs and pictures import, except gmsh, which has a check of its own.
PACKAGES = ("numpy", "scipy", "numba", "shapely", "pydantic", "tomli-w", "tqdm", "meshio", "vtk", "pyvista", "imageio",
            "matplotlib", "ezdxf")  # fmt: skip


@dataclass(frozen=True)
class Check:
    """``found``: what is installed, or what is wrong; ``remedy``: the command that repairs it, empty if ``good``."""

    name: str
    good: bool
    found: str
    remedy: str = ""


def examine() -> list[Check]:
    """All checks, in the order in which a run needs them. Libraries that could crash the process are loaded in another
    one."""
    checks: list[Callable[[], Check]] = [_python, _packages, _gmsh, _numba, _threads]
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
        remedy = f"{sys.executable} -m pip install {' '.join(missing)}"
        return Check("packages", False, f"missing: {', '.join(missing)}", remedy)
    return Check("packages", True, ", ".join(found))


def _gmsh() -> Check:
    code = "import gmsh; gmsh.initialize(interruptible=False, readConfigFiles=False); print(gmsh.__version__)"
    return check_import("gmsh", code, "pip install gmsh")


def check_import(name: str, code: str, without: str) -> Check:
    """Run ``code`` in a new process. If a shared library is missing, it is named, with all others that are missing."""
    done = _run(code)
    if done.returncode == 0:
        return Check(name, True, done.stdout.strip())
    missing = missing_libraries(done.stderr)
    if missing:
        # The loader stops at the first missing one; ldd lists all, so that one installation is enough.
        missing = list(dict.fromkeys(missing + _also_missing(name)))
        return Check(name, False, f"missing shared libraries: {', '.join(missing)}", apt_line(missing))
    last = (done.stderr.strip().splitlines() or [f"ended with code {done.returncode}"])[-1]
    return Check(name, False, last, without)


def missing_libraries(message: str) -> list[str]:
    """Shared libraries that are missing according to a ``message`` of the loader or of ldd."""
    loader = re.findall(r"(\S+\.so[\d.]*): cannot open shared object file", message)
    ldd = re.findall(r"^\s*(\S+\.so[\d.]*) => not found", message, flags=re.MULTILINE)
    return list(dict.fromkeys([*loader, *ldd]))


def apt_line(libraries: list[str]) -> str:
    """Command that installs ``libraries`` on Debian and Ubuntu."""
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
        listed = subprocess.run(["ldd", *libraries], capture_output=True, text=True, timeout=30, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return []
    return missing_libraries(listed.stdout)


def _numba() -> Check:
    from ..kernel_folder import VARIABLE, kernel_place

    place = kernel_place()
    code = (
        "import tempfile, numba, geomech.compiled as ours\n"
        f"with tempfile.TemporaryFile(dir={place.folder!r}): pass\n"
        "print('numba', numba.__version__ + ('' if ours.OWN_WAY else ' (unknown: kernels kept in its own way)'))"
    )
    done = _run(code)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["?"])[-1]
        return Check("numba cache", False, last, f"export {VARIABLE}=DIR, a folder that this user can write")
    kept = len(list(Path(place.folder).glob("*/*.nbc")))
    found = f"{done.stdout.strip()}, {kept} kernels kept in {place.folder}"
    if place.instead_of is not None:
        found += f", for {place.instead_of} cannot be written: {VARIABLE}=DIR names a folder that stays"
    return Check("numba cache", True, found)


def _threads() -> Check:
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    limits = [f"{name}={os.environ[name]}" for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS") if name in os.environ]
    return Check("threads", True, " ".join([f"{usable} usable cores", *limits]))


def _run(code: str) -> subprocess.CompletedProcess[str]:
    try:
        return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    except subprocess.TimeoutExpired as late:
        return subprocess.CompletedProcess(late.cmd, 1, "", "no answer within 120 s")


#: Blocks that settle and slide, …
SLIDING_BLOCKS = """
[geometry]
dead_ends = "trim"
zones = [{ name = "ground", rectangle = [0, -1, 4, 0] }, { name = "block", rectangle = [1, 0, 3, 1] }]
joints = [{ name = "cut", points = [[1, 0.3], [3, 0.6]] }]
[materials.rock]
youngs_modulus_pa = 1e9
poissons_ratio = 0.2
density_kg_m3 = 2000
[zones.ground]
fixed = true
[joints.default]
friction_angle_deg = 20
[loads]
gravity_m_s2 = [0, -9.81]
[dda]
time_step_s = 0.01
[run]
end_time_s = 0.05
"""
#: … and one with a crack that grows until it is cut in two: together they use the kernels of ordinary scenes.
TORN_PLATE = """
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


def warm() -> None:
    """Compile the kernels of ordinary scenes in advance: small scenes are run, and only their kernels are kept."""
    import tempfile

    from ..output import standard_observers
    from ..pipeline import run
    from ..scene import load_scene

    with tempfile.TemporaryDirectory() as folder:
        for k, text in enumerate((SLIDING_BLOCKS, TORN_PLATE)):
            path = Path(folder) / f"scene_{k}.toml"
            path.write_text(text, encoding="utf-8")
            scene = load_scene(path)
            run(scene, Path(folder) / str(k), standard_observers(scene, quiet=True))
