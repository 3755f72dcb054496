"""The specimen with one flaw: its wing cracks, held against closed forms, on one page.

`geomech run pipelines/single_flaw` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

from geomech.output import standard_observers
from geomech.pipeline import run
from geomech.scene import load_scene

sys.path.insert(0, str(Path(__file__).parent))
from compare_single_flaw import Wings, report
from page_single_flaw import write_page


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    scenes = {name: load_scene(folder, overrides, variant=name) for name in (list(variants) or [None])}
    seen, places = {}, {}
    for name, scene in scenes.items():
        called = name or "this study's"
        place = places[called] = Path(out) / name if name and len(scenes) > 1 else Path(out)
        wings = seen[called] = Wings()
        run(scene, place, [*standard_observers(scene, quiet=quiet), wings])
        text = report(wings)
        (place / "comparison.txt").write_text(text + "\n", encoding="utf-8")
        if not quiet:
            print("\n" + text)
    page = write_page(seen, places, Path(out))
    if not quiet:
        print(f"\n{page}")
    return 0
