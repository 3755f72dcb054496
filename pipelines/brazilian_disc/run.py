"""Cracked Brazilian discs loaded until they split, compared with published stress intensity factors.

`geomech run pipelines/brazilian_disc` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

from geomech.render.curves.paths import crack_paths
from geomech.study import watched_runs

sys.path.insert(0, str(Path(__file__).parent))
from compare_brazilian_disc import Pressed, report

ANGLES = ("opening", "mixed", "shear", "closing")


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    runs = watched_runs(folder, out, Pressed, variants or ANGLES, overrides, quiet)
    discs = {each.name: each.watcher for each in runs}
    text = report(discs)
    (Path(out) / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    grown = {f"{disc.angle_deg:.1f}° from the load": disc for disc in discs.values() if disc.cracks}
    if grown:
        crack_paths(
            {title: {"": disc.cracks} for title, disc in grown.items()},
            Path(out) / "brazilian_disc.png",
            outlines={title: disc.outline for title, disc in grown.items()},
        )
    if not quiet:
        print("\n" + text)
    return 0
