"""Ten en-echelon joints that link to a step path: the loads at which bridges break, and the paths of the cracks through
them.

`geomech run pipelines/step_path_slope` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

from geomech.study import watched_runs

sys.path.insert(0, str(Path(__file__).parent))
from compare_step_path_slope import StepPath, check, draw, report


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    runs = watched_runs(folder, out, StepPath, variants or [None], overrides, quiet)
    seen = {each.name or "scene": each.watcher for each in runs}
    draw(max(seen.values(), key=lambda path: (path.n_joints, path.follows)), Path(out) / "step_path_slope.png")
    text = report(seen)
    (Path(out) / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    if not quiet:
        print(f"\n{text}")
    for name, path in seen.items():
        check(name, path)
    return 0
