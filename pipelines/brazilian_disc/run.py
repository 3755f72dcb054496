"""Cracked Brazilian discs, pressed until they split, and what was published of their stress intensity factors.

`geomech run pipelines/brazilian_disc` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

from geomech.output import standard_observers
from geomech.pipeline import run
from geomech.render.paths import crack_paths
from geomech.scene import load_scene

sys.path.insert(0, str(Path(__file__).parent))
from compare_brazilian_disc import Pressed, report

ANGLES = ("opening", "mixed", "shear", "closing")


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    scenes = {name: load_scene(folder, overrides, name) for name in (list(variants) or ANGLES)}
    discs = {}
    for name, scene in scenes.items():
        discs[name] = Pressed()
        run(scene, Path(out) / name, [*standard_observers(scene, quiet=quiet), discs[name]])
    text = report(discs)
    (Path(out) / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    grown = {f"{disc.angle_deg:.1f}° from the load": {"": disc.cracks} for disc in discs.values() if disc.cracks}
    if grown:
        crack_paths(grown, Path(out) / "brazilian_disc.png")
    if not quiet:
        print("\n" + text)
    return 0
