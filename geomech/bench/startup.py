"""Whole-process times of the things a user waits for: imports, `check`, a specimen run to its end, the first run.

Wall time from launch to exit of a fresh Python, medians of repeated runs. The first run compiles the kernels into an
empty cache; all others find them compiled.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from . import loading
from .figures import Measured

PIPELINE = Path("pipelines/two_cracks")

#: What is told by layers: a scene drawn in its file, one drawn in Gmsh, and runs of blocks alone and of cracks.
COMMANDS = {
    "--help": ["--help"],
    "check, drawn in TOML": ["check", str(PIPELINE / "toml.toml")],
    "check, drawn in Gmsh": ["check", str(PIPELINE / "scene.toml")],
    "run, blocks alone (Gmsh)": ["run", "geometry/brick_wall.toml", "--set", "run.end_time_s=0.01"],
    "run, cracks too (TOML)": ["run", str(PIPELINE / "toml.toml"), "--set", "run.end_time_s=2"],
}
#: Runs into an empty cache of kernels.
FIRST_RUNS = {label: command for label, command in COMMANDS.items() if command[0] == "run"}


def measure(quick: bool = False) -> Measured:
    """The table. Runs in the project's folder (it needs ``pipelines/two_cracks``); FileNotFoundError elsewhere."""
    if not PIPELINE.is_dir():
        raise FileNotFoundError(f"{PIPELINE} is not here: run this benchmark from the project's folder")
    repeats = 3 if quick else 7
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        geomech = [sys.executable, "-m", "geomech"]

        def run(phi: int, folder: str) -> list[str]:
            scene = [str(PIPELINE / "scene.toml"), "--variant", f"phi_{phi}"]
            return [*geomech, "run", *scene, "--quiet", "--out", f"{scratch}/{folder}"]

        first = {**os.environ, "NUMBA_CACHE_DIR": str(Path(scratch) / "cache")}
        if not quick:
            rows.append(("first run of a specimen, compiling", _seconds(run(0, "first"), first)))
            _seconds(run(0, "warm-up"))
        python = [sys.executable, "-c"]
        for label, command in (
            ("python, nothing imported", [*python, "pass"]),
            ("import geomech", [*python, "import geomech"]),
            ("import geomech.ddm, first use of a body", [*python, "from geomech.ddm import Body"]),
            ("import geomech.dda, first use of a block system", [*python, "from geomech.dda import BlockSystem"]),
            ("geomech check pipelines/two_cracks", [*geomech, "check", str(PIPELINE)]),
        ):
            rows.append((label, statistics.median(_seconds(command) for _ in range(repeats))))
        # Each into a folder of its own: files that are there already are written over, which is quicker than making them.
        for phi in (0,) if quick else (0, 30, 60, 90):
            times = [_seconds(run(phi, f"phi_{phi}_{k}")) for k in range(3 if phi in (30, 60) else repeats)]
            rows.append((f"specimen φ = {phi}° to coalescence, everything written", statistics.median(times)))
    width = max(len(label) for label, _ in rows)
    lines = [f"whole processes, wall time, median of {repeats} (the first run once)"]
    lines += [f"  {label:<{width}}  {seconds:7.2f} s" for label, seconds in rows]
    lines += ["", *loading.table(COMMANDS)]
    if not quick:
        lines += ["", *loading.kernels(FIRST_RUNS, os.environ)]
    return Measured.of("\n".join(lines), times=dict(rows))


def _seconds(command: list[str], environment: dict[str, str] | None = None) -> float:
    start = time.perf_counter()
    subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.perf_counter() - start
