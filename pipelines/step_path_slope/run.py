"""Ten en-echelon joints linked to a step path: the loads at which bridges break, and the way that cracks take through them.

`geomech run pipelines/step_path_slope` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

from geomech.output import standard_observers
from geomech.pipeline import run
from geomech.scene import load_scene

sys.path.insert(0, str(Path(__file__).parent))
from compare_step_path_slope import StepPath, draw, report


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    scenes = {name: load_scene(folder, overrides, name) for name in list(variants) or [None]}
    seen = {}
    for name, scene in scenes.items():
        called = name or "scene"
        seen[called] = StepPath()
        place = Path(out) / name if name and len(scenes) > 1 else Path(out)
        run(scene, place, [*standard_observers(scene, quiet=quiet), seen[called]])
    draw(max(seen.values(), key=lambda path: (path.n_joints, path.follows)), Path(out) / "step_path_slope.png")
    text = report(seen)
    (Path(out) / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    if not quiet:
        print(f"\n{text}")
    return 0
