"""A sliding plane with one rock bridge: the multiple of gravity at which it breaks, compared with limit equilibrium and
fracture mechanics.

`geomech run pipelines/planar_slope` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

from geomech.study import watched_runs

sys.path.insert(0, str(Path(__file__).parent))
from compare_planar_slope import BridgedPlane, check, draw, report


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    seen = {each.name: each.watcher for each in watched_runs(folder, out, BridgedPlane, variants, overrides, quiet)}
    draw(seen, Path(out) / "planar_slope.png")
    text = report(seen)
    (Path(out) / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    if not quiet:
        print(f"\n{text}")
    for name, plane in seen.items():
        check(name, plane)
    return 0
