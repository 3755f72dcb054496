"""Direct shear of joints with a rock bridge: what it takes to break the bridge, and what friction leaves.

`geomech run pipelines/joint_shear` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

from geomech.output import standard_observers
from geomech.pipeline import run
from geomech.render.studies import against
from geomech.scene import load_scene

sys.path.insert(0, str(Path(__file__).parent))
from compare_joint_shear import Sheared, report


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    names = list(variants) or list(load_scene(folder).variants)
    scenes = {name: load_scene(folder, overrides, name) for name in names}
    tests = {}
    for name, scene in scenes.items():
        tests[name] = Sheared()
        run(scene, Path(out) / name, [*standard_observers(scene, quiet=quiet), tests[name]])
    text = report(tests)
    (Path(out) / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    curves = {name: test.curve.T * [[1e6], [1e-3]] for name, test in tests.items()}
    against(curves, Path(out) / "joint_shear.png", "way of the box, µm", "shear force, kN/m")
    if not quiet:
        print("\n" + text)
    return 0
