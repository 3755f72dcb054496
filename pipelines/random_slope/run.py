"""Random slopes: the probability of failure of a planar slope compared with the exact and the published one, a rare
failure, and a slope with two random joint sets.

`geomech run pipelines/random_slope` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

from geomech.report import write_sweep_page
from geomech.sweep.engine import LocalEngine
from geomech.sweep.execution import SweepMessages, carry_out_sweep
from geomech.sweep.plan import plan_of

sys.path.insert(0, str(Path(__file__).parent))
from compare_random_slope import STUDIES, check, draw, report


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    """``variants`` are names of studies; ``overrides`` of `sweep` change how they are sampled, for example runs=64."""
    unknown = [name for name in variants if name not in STUDIES]
    if unknown:
        raise ValueError(f"no study {', '.join(unknown)}; there are {', '.join(STUDIES)}")
    given = {}
    for text in overrides:
        key, _, value = text.partition("=")
        given[key.removeprefix("sweep.")] = int(value) if value.isdecimal() else value
    found = {}
    for name in variants or STUDIES:
        scene, table = (
            (folder / "two_sets.toml", None)
            if name == "two_sets"
            else (folder / "planar.toml", folder / f"{name}.toml")
        )
        own = {key: value for key, value in given.items() if (key == "seeds") == (name == "two_sets")}
        plan = plan_of(scene, own, table=table)
        messages = SweepMessages(None if quiet else lambda text: print(text, flush=True), seconds=30.0)
        found[name] = carry_out_sweep(plan, Path(out) / name, LocalEngine(), overwrite=True, messages=messages)
        write_sweep_page(Path(out) / name)
    text = report(found)
    (Path(out) / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    draw(found, Path(out) / "random_slope.png")
    if not quiet:
        print(text)
    check(found)
    return 0
