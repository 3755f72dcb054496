"""Courses of geomech's own studies: wall time by cycle, from which the first run on a machine knows the time left.

    python -m docs.generate.courses [PIPELINE …]         # run all, or those named, and rewrite courses.json

Only the shape counts: a run finds how much slower its machine is from its own share of the course.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from geomech.output.console.pace import STUDIES

ROOT = Path(__file__).resolve().parents[2]
#: Where the machine keeps its kernels; the folder of caches is another one here.
KERNELS = os.environ.get("NUMBA_CACHE_DIR") or str(Path("~/.cache/geomech/kernels").expanduser())
#: Rows that a stored course has at most.
ROWS = 60


def courses_of(pipeline: Path) -> dict[str, dict[str, list]]:
    """Course by name of each run of the ``pipeline`` that is long enough to be remembered, with kernels compiled."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "geomech", "run", str(pipeline), "--out", f"{folder}/run"]
        around = os.environ | {"XDG_CACHE_HOME": folder, "NUMBA_CACHE_DIR": KERNELS}
        subprocess.run(command, cwd=ROOT, env=around, check=True)
        files = sorted((Path(folder) / "geomech" / "paces").glob("*.json"))
        return {file.stem: thinned(json.loads(file.read_text(encoding="utf-8"))) for file in files}


def thinned(course: dict[str, list]) -> dict[str, list]:
    """At most `ROWS` rows of the ``course``, its first and last among them, with four digits."""
    n = len(course["cycle"])
    step = max(1, -(-(n - 1) // (ROWS - 1)))
    rows = [*range(0, n - 1, step), n - 1]
    return {
        "cycle": [course["cycle"][row] for row in rows],
        **{name: [float(f"{course[name][row]:.4g}") for row in rows] for name in ("wall", "time")},
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m docs.generate.courses", description=__doc__.splitlines()[0])
    parser.add_argument("pipelines", nargs="*", metavar="PIPELINE", help="names, as two_cracks (default: all)")
    options = parser.parse_args(arguments)
    known = sorted(path.parent for path in (ROOT / "pipelines").glob("*/run.py"))
    chosen = [path for path in known if not options.pipelines or path.name in options.pipelines]
    stored = json.loads(STUDIES.read_text(encoding="utf-8")) if STUDIES.exists() else {}
    for pipeline in chosen:
        stored |= courses_of(pipeline)
        text = ",\n".join(f'"{name}": {json.dumps(stored[name], separators=(",", ":"))}' for name in sorted(stored))
        STUDIES.write_text("{\n" + text + "\n}\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
