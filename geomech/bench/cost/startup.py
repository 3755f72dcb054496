"""Whole-process times of what a user waits for: imports, `check`, a specimen run to its end, the first run.

From launch to exit of a new Python process, medians of repeated runs (`import_cost.seconds`). The first run compiles
the kernels into an empty cache; all others find them compiled. A cold start is measured by the clock.
"""

from __future__ import annotations

import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from ..figures import Measured
from . import import_cost

PIPELINE = Path("pipelines/two_cracks")

#: Commands listed by layers: a scene drawn in its file, one drawn in Gmsh, runs of blocks and of cracks, and their
#: evaluation. In a quick run only the first and the run of cracks.
COMMANDS = {
    "--help": ["--help"],
    "check, drawn in TOML": ["check", str(PIPELINE / "toml.toml")],
    "check, drawn in Gmsh": ["check", str(PIPELINE / "scene.toml")],
    "run, blocks alone (Gmsh)": ["run", "geometry/brick_wall.toml", "--set", "run.end_time_s=0.01"],
    "run, cracks too (TOML)": ["run", str(PIPELINE / "toml.toml"), "--set", "run.end_time_s=2"],
    "build": ["build", "geometry/two_set_slope.toml"],
    "safety": ["safety", "geometry/planar_slope.toml", "--quiet"],
    "report of that run": ["report", import_cost.RUN],
    "render of that run": ["render", import_cost.RUN],
    "resume of that run": ["resume", import_cost.RUN, "--set", "run.end_time_s=3", "--quiet"],
    "doctor": ["doctor"],
}
QUICK = ("--help", "run, cracks too (TOML)")
#: Runs with an empty kernel cache, in addition to the specimen's.
FIRST_RUNS = {label: command for label, command in COMMANDS.items() if label == "run, blocks alone (Gmsh)"}


def measure(quick: bool = False) -> Measured:
    """The table. Must run in the project's folder (it needs ``pipelines/two_cracks``); FileNotFoundError elsewhere."""
    if not PIPELINE.is_dir():
        raise FileNotFoundError(f"{PIPELINE} is not here: run this benchmark from the project's folder")
    repeats = 1 if quick else 5
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        geomech = [sys.executable, "-m", "geomech"]

        def run(phi: int, folder: str) -> list[str]:
            scene = [str(PIPELINE / "scene.toml"), "--variant", f"phi_{phi}"]
            return [*geomech, "run", *scene, "--quiet", "--out", f"{scratch}/{folder}"]

        first = {**os.environ, "NUMBA_CACHE_DIR": str(Path(scratch) / "cache")}
        of_specimen = {}
        if not quick:
            rows.append(("first run of a specimen, compiling", import_cost.seconds(run(0, "first"), first)))
            of_specimen = import_cost.compiled(Path(scratch) / "cache")
            import_cost.seconds(run(0, "warm-up"))
        python = [sys.executable, "-c"]
        for label, command in (
            ("python, nothing imported", [*python, "pass"]),
            ("import geomech", [*python, "import geomech"]),
            ("import geomech.ddm, first use of a body", [*python, "from geomech.ddm import Body"]),
            ("import geomech.dda, first use of a block system", [*python, "from geomech.dda import BlockSystem"]),
            ("geomech check pipelines/two_cracks", [*geomech, "check", str(PIPELINE)]),
        ):
            rows.append((label, statistics.median(import_cost.seconds(command) for _ in range(repeats))))
        if not quick:
            cold = [_cold([*geomech, "check", str(PIPELINE)]) for _ in range(3)]
            rows.append(("the same, cold: libraries read from the disk, by the clock", statistics.median(cold)))
        # Each into a folder of its own: overwriting existing files is faster than creating them.
        for phi in (90,) if quick else (0, 30, 60, 90):
            count = 1 if quick else 3 if phi in (0, 90) else 2
            times = [import_cost.seconds(run(phi, f"phi_{phi}_{k}")) for k in range(count)]
            rows.append((f"specimen φ = {phi}° to coalescence, everything written", statistics.median(times)))
    width = max(len(label) for label, _ in rows)
    lines = [
        f"whole processes, medians of {repeats} runs (some of fewer): wall time or processor time, whichever is less"
    ]
    lines += [f"  {label:<{width}}  {seconds:7.2f} s" for label, seconds in rows if math.isfinite(seconds)]
    lines += ["", *import_cost.table({label: COMMANDS[label] for label in (QUICK if quick else COMMANDS)})]
    if not quick:
        lines += ["", *import_cost.kernels(FIRST_RUNS, os.environ)]
        lines.append(f"  {'the specimen of above':<45}{', '.join(f'{name} {n}' for name, n in of_specimen.items())}")
    return Measured.of("\n".join(lines), times=dict(rows))


def _cold(command: list[str]) -> float:
    """Seconds by the clock; nan if the system's cache cannot be cleared."""
    if import_cost.put_out_of_memory() is None:
        return math.nan
    start = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.perf_counter() - start
