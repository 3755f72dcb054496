"""The two-crack specimens for φ = 0, 30, 60, 90, and the comparison with what was published about them.

`geomech run pipelines/two_cracks` calls `main`; copy the folder to make a study of your own.
"""

import logging
import sys
from pathlib import Path

from geomech.output import standard_observers
from geomech.pipeline import run
from geomech.scene import load_scene

sys.path.insert(0, str(Path(__file__).parent))
from compare_two_cracks import Watch, report


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    # All are read before the first one runs: an error in the last should not cost the time of the others.
    names = list(variants) or load_scene(folder).variants
    scenes = {name: load_scene(folder, overrides, variant=name) for name in names}
    watched, failed = {}, 0
    for name, scene in scenes.items():
        watch = Watch()
        try:
            run(scene, Path(out) / name, [*standard_observers(scene, quiet=quiet), watch])
        except Exception:
            failed = 1
            logging.getLogger(__name__).exception("%s failed; the others go on", name)
        else:
            watched[name] = watch
    text = report(watched)
    Path(out).mkdir(parents=True, exist_ok=True)
    (Path(out) / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    if not quiet:
        print("\n" + text)
    return failed
