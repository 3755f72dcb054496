"""Start-up cost of a command: imported modules by layer, heavy libraries, and compiled kernels.

Python reports the time of every import (``-X importtime``); Numba leaves an index file for every function it compiled.
A command is cold if everything must be read from the disk: the files of the packages are removed from the system's
cache before.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

#: Libraries that a command which does not need them must not import.
HEAVY = ("gmsh", "vtkmodules", "pyvista", "matplotlib", "meshio", "shapely", "scipy", "numba", "pydantic", "ezdxf")
#: Layers listed by name in the table; the rest are libraries of Python itself and of others.
LAYERS = ("geomech", "numpy", *HEAVY)

#: In the arguments of a command: the folder of the last run.
RUN = "RUN"

_LINE = re.compile(r"^import time:\s+(\d+) \|\s+\d+ \|\s+(\S+)$", re.MULTILINE)


@dataclass(frozen=True)
class Loaded:
    """``seconds`` of imports by layer (each module's own), and the number of ``modules``."""

    seconds: Mapping[str, float]
    modules: int

    @property
    def heavy(self) -> tuple[str, ...]:
        return tuple(name for name in HEAVY if name in self.seconds)


def loaded(arguments: Sequence[str]) -> Loaded:
    """Imports of ``geomech`` with these ``arguments``. Raises subprocess.CalledProcessError if it fails."""
    command = [sys.executable, "-X", "importtime", "-m", "geomech", *arguments]
    said = subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True).stderr
    seconds: Counter[str] = Counter()
    found = _LINE.findall(said)
    for microseconds, name in found:
        top = name.partition(".")[0]
        seconds[top if top in LAYERS else "others"] += 1e-6 * int(microseconds)
    return Loaded(dict(seconds), len(found))


def compiled(folder: Path) -> dict[str, int]:
    """{package: functions in the kernel cache ``folder``}."""
    counts: Counter[str] = Counter()
    for index in folder.rglob("*.nbi"):
        # Numba names the folder of a source file after the file's own folder.
        counts[index.parent.name.rpartition("_")[0]] += 1
    return dict(sorted(counts.items()))


def table(commands: Mapping[str, Sequence[str]]) -> list[str]:
    """One line per command: seconds by layer, heavy libraries loaded. ``RUN`` stands for a run's folder in later
    commands."""
    lines = ["imports by layer, ms (each module's own time, as measured by Python, which slows imports)"]
    with tempfile.TemporaryDirectory() as scratch:
        for label, arguments in commands.items():
            last = f"{scratch}/{arguments[0]}" if arguments[0] in ("run", "build") else ""
            out = (["--quiet"] * (arguments[0] == "run") + ["--out", last]) if last else []
            found = loaded([*(f"{scratch}/run" if part == RUN else part for part in arguments), *out])
            layers = sorted(found.seconds.items(), key=lambda of: -of[1])
            text = "  ".join(f"{name} {1e3 * spent:.0f}" for name, spent in layers if spent > 1e-3)
            lines.append(f"  {label:<30}{1e3 * sum(found.seconds.values()):6.0f} in {found.modules} modules: {text}")
    return lines


def seconds(command: Sequence[str], environment: Mapping[str, str] | None = None) -> float:
    """Time of ``command`` from launch to exit, by the clock or of the processors (including children), whichever is
    less: waiting for the processor is excluded. Raises subprocess.CalledProcessError if it fails."""
    clock, before = time.perf_counter(), os.times()
    subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    waited, after = time.perf_counter() - clock, os.times()
    own = after.children_user - before.children_user + after.children_system - before.children_system
    # Without children's processor times, the clock is used.
    return min(waited, own) if own > 0 else waited


def put_out_of_memory(names: Sequence[str] = ("geomech", *HEAVY, "numpy", "llvmlite")) -> float | None:
    """Remove the files of packages from the system's cache, unless other programs use them: their size, MB; None if
    that is not possible."""
    if not hasattr(os, "posix_fadvise"):
        return None
    size = 0
    for name in names:
        found = find_spec(name)
        if found is None or found.origin is None:
            continue
        folder = Path(found.origin).parent
        # Shared libraries of wheels are in a folder next to the package.
        for place in (folder, folder.with_name(f"{name}.libs")):
            for path in (
                place.rglob("*") if place.is_dir() and found.submodule_search_locations else [Path(found.origin)]
            ):
                if path.is_file():
                    with path.open("rb") as file:
                        os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
                    size += path.stat().st_size
    return 1e-6 * size


def kernels(scenes: Mapping[str, Sequence[str]], environment: Mapping[str, str]) -> list[str]:
    """One line per scene: the kernels that its run compiles into an empty cache, by package, and `seconds` of that and
    of the next run."""
    lines = ["kernels compiled by a first run (seconds of it, and of the next)"]
    for label, arguments in scenes.items():
        with tempfile.TemporaryDirectory() as cache:
            own, spent = {**environment, "NUMBA_CACHE_DIR": cache}, []
            for k in range(2):
                command = [sys.executable, "-m", "geomech", *arguments, "--quiet", "--out", f"{cache}/run_{k}"]
                spent.append(seconds(command, own))
            counts = compiled(Path(cache))
        text = ", ".join(f"{name} {count}" for name, count in counts.items()) or "none"
        lines.append(f"  {label:<30}{spent[0]:6.1f} s {spent[1]:6.1f} s   {text}")
    return lines
