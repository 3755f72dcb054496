"""The two-crack specimens for φ = 0, 30, 60, 90, and the comparison with what was published about them.

`geomech run pipelines/two_cracks` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

from geomech.output import standard_observers
from geomech.pipeline import run
from geomech.scene import load_scene

sys.path.insert(0, str(Path(__file__).parent))
from compare_two_cracks import Watch, report  # noqa: E402


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    names = list(variants) or load_scene(folder).variants
    # All are read before the first one runs: an error in the last should not cost the time of the others.
    scenes = {name: load_scene(folder, overrides, variant=name) for name in names}
    watched = {}
    for name, scene in scenes.items():
        watch = Watch()
        run(scene, Path(out) / name, [*standard_observers(scene, quiet=quiet), watch])
        watched[int(name.removeprefix("phi_"))] = watch
    text = report(watched)
    (Path(out) / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    if not quiet:
        print("\n" + text)
    return 0
