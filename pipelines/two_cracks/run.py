"""The two-crack specimens for φ = 0, 30, 60, 90, compared with published results, on one page.

`geomech run pipelines/two_cracks` calls `main`; copy the folder to make a study of your own.
"""

import logging
import sys
from pathlib import Path

from geomech.output import standard_observers
from geomech.pipeline import refuse_results, run
from geomech.scene import load_scene

sys.path.insert(0, str(Path(__file__).parent))
from compare_settings import family, own
from compare_two_cracks import Watch, report
from page_two_cracks import write_page

FEWER_FILES = ("output.every=1000000", "output.interior=false")  # of the many runs that vary a setting


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    # All are read before the first one runs: an error in the last should not cost the time of the others.
    names = list(variants) or [name for name in load_scene(folder).variants if not family(name)]
    scenes = {name: load_scene(folder, [*(FEWER_FILES if family(name) else ()), *overrides], name) for name in names}
    refuse_results(Path(out) / name for name in names)
    watched, failed = {}, 0
    for name, scene in scenes.items():
        watched[name] = Watch()
        try:
            run(scene, Path(out) / name, [*standard_observers(scene, quiet=quiet), watched[name]])
        except Exception:
            del watched[name]
            failed = 1
            logging.getLogger(__name__).exception("%s failed; the others continue", name)
    (Path(out) / "comparison.txt").write_text(text := report(own(watched) or watched) + "\n", encoding="utf-8")
    page = write_page(watched, folder, Path(out), overrides)
    if not quiet:
        print(f"\n{text}\n{page}")
    return failed
