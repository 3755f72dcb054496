"""Direct shear of joints with a rock bridge: the force that breaks the bridge, and the residual friction.

`geomech run pipelines/joint_shear` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

from geomech.render.curves.studies import against
from geomech.study import watched_runs

sys.path.insert(0, str(Path(__file__).parent))
from compare_joint_shear import Sheared, check, report


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    tests = {each.name: each.watcher for each in watched_runs(folder, out, Sheared, variants, overrides, quiet)}
    text = report(tests)
    (Path(out) / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    curves = {
        f"{name.replace('_', ' ')}: {1e3 * test.bridge:g} mm, {test.normal / 1e6:g} MPa": test.curve.T * [[1e6], [1e-3]]
        for name, test in tests.items()
    }
    against(curves, Path(out) / "joint_shear.png", "way of the box, µm", "shear force, kN/m")
    if not quiet:
        print("\n" + text)
    check(tests)
    return 0
