"""A sliding plane with one rock bridge: the multiple of gravity at which it breaks, against limit equilibrium and fracture mechanics.

`geomech run pipelines/planar_slope` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

from geomech.output import standard_observers
from geomech.pipeline import run
from geomech.scene import load_scene

sys.path.insert(0, str(Path(__file__).parent))
from compare_planar_slope import BridgedPlane, draw, report


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    scenes = {name: load_scene(folder, overrides, name) for name in list(variants) or load_scene(folder).variants}
    seen = {}
    for name, scene in scenes.items():
        seen[name] = BridgedPlane()
        run(scene, Path(out) / name, [*standard_observers(scene, quiet=quiet), seen[name]])
    draw(seen, Path(out) / "planar_slope.png")
    text = report(seen)
    (Path(out) / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    if not quiet:
        print(f"\n{text}")
    return 0
