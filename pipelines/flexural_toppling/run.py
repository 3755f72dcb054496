"""Columns bend over, break at their base and topple: held against bending theory and a rigid body that turns.

`geomech run pipelines/flexural_toppling` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

from geomech.output import standard_observers
from geomech.pipeline import run
from geomech.scene import load_scene

sys.path.insert(0, str(Path(__file__).parent))
from compare_flexural_toppling import Watch, check, report


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    names = list(variants) or list(load_scene(folder).variants)
    scenes = {name: load_scene(folder, overrides, variant=name) for name in names}
    seen, out = {}, Path(out)
    for name, scene in scenes.items():
        seen[name] = Watch()
        run(scene, out / name, [*standard_observers(scene, quiet=quiet), seen[name]])
    text = report(seen)
    (out / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    if not quiet:
        print(f"\n{text}")
    check(seen)
    return 0
