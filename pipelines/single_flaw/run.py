"""The specimen with one flaw: its wing cracks, held against closed forms.

`geomech run pipelines/single_flaw` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

from geomech.output import standard_observers
from geomech.pipeline import run
from geomech.scene import load_scene

sys.path.insert(0, str(Path(__file__).parent))
from compare_single_flaw import Wings, report


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    scenes = {name: load_scene(folder, overrides, variant=name) for name in (list(variants) or [None])}
    for name, scene in scenes.items():
        place = Path(out) / name if name and len(scenes) > 1 else Path(out)
        wings = Wings()
        run(scene, place, [*standard_observers(scene, quiet=quiet), wings])
        text = report(wings)
        (place / "comparison.txt").write_text(text + "\n", encoding="utf-8")
        if not quiet:
            print("\n" + text)
    return 0
