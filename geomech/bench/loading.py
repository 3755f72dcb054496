"""What a command loads before it does anything: modules by layer, heavy libraries, and the kernels that it compiles.

Python tells the time of every import (``-X importtime``); Numba leaves an index file for every function it compiled.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

#: Libraries that a command which does not need them must not load.
HEAVY = ("gmsh", "vtkmodules", "pyvista", "matplotlib", "meshio", "shapely", "scipy", "numba", "pydantic", "ezdxf")
#: Layers of the table that are told by name; the rest are libraries of Python itself and of others.
LAYERS = ("geomech", "numpy", *HEAVY)

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
    """What ``geomech`` loads with these ``arguments``. Raises subprocess.CalledProcessError when it fails."""
    command = [sys.executable, "-X", "importtime", "-m", "geomech", *arguments]
    said = subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True).stderr
    seconds: Counter[str] = Counter()
    found = _LINE.findall(said)
    for microseconds, name in found:
        top = name.partition(".")[0]
        seconds[top if top in LAYERS else "others"] += 1e-6 * int(microseconds)
    return Loaded(dict(seconds), len(found))


def compiled(folder: Path) -> dict[str, int]:
    """Package → functions in the kernel cache ``folder``."""
    counts: Counter[str] = Counter()
    for index in folder.rglob("*.nbi"):
        # Numba names the folder of a source file after the file's own folder.
        counts[index.parent.name.rpartition("_")[0]] += 1
    return dict(sorted(counts.items()))


def table(commands: Mapping[str, Sequence[str]]) -> list[str]:
    """A line a command: seconds by layer, heavy libraries loaded."""
    lines = ["imports by layer, ms (each module's own time, told by Python, which slows them)"]
    for label, arguments in commands.items():
        with tempfile.TemporaryDirectory() as folder:
            found = loaded([*arguments, *(["--quiet", "--out", folder] if arguments[0] == "run" else [])])
        layers = sorted(found.seconds.items(), key=lambda of: -of[1])
        told = "  ".join(f"{name} {1e3 * spent:.0f}" for name, spent in layers if spent > 1e-3)
        lines.append(f"  {label:<30}{1e3 * sum(found.seconds.values()):6.0f} in {found.modules} modules: {told}")
    return lines


def kernels(scenes: Mapping[str, Sequence[str]], environment: Mapping[str, str]) -> list[str]:
    """A line a scene: the kernels that its run compiles into an empty cache, by package, and whole wall time of that and of
    the next run."""
    lines = ["kernels compiled by a first run (seconds of it, and of the next)"]
    for label, arguments in scenes.items():
        with tempfile.TemporaryDirectory() as cache:
            own, spent = {**environment, "NUMBA_CACHE_DIR": cache}, []
            for k in range(2):
                command = [sys.executable, "-m", "geomech", *arguments, "--quiet", "--out", f"{cache}/run_{k}"]
                began = time.perf_counter()
                subprocess.run(command, env=own, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                spent.append(time.perf_counter() - began)
            counts = compiled(Path(cache))
        told = ", ".join(f"{name} {count}" for name, count in counts.items()) or "none"
        lines.append(f"  {label:<30}{spent[0]:6.1f} s {spent[1]:6.1f} s   {told}")
    return lines
