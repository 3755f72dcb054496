"""A slope of a thousand blocks with a hundred rock bridges, shaken by El Centro 1940, beside Newmark's sliding block.

`geomech run pipelines/jointed_slope` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

from geomech.output import standard_observers
from geomech.pipeline import run
from geomech.scene import load_scene

sys.path.insert(0, str(Path(__file__).parent))
from compare_jointed_slope import Slide, draw, report


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    scenes = {name: load_scene(folder, overrides, variant=name) for name in (list(variants) or [None])}
    for name, scene in scenes.items():
        place = Path(out) / name if name and len(scenes) > 1 else Path(out)
        slide = Slide()
        summary = run(scene, place, [*standard_observers(scene, quiet=quiet), slide])
        text = report(slide, summary)
        (place / "comparison.txt").write_text(text + "\n", encoding="utf-8")
        draw(slide, place / "jointed_slope.png")
        if not quiet:
            print("\n" + text)
    return 0
