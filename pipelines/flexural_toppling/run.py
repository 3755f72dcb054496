"""Columns bend over, break at their base and topple: compared with bending theory and a rigid body that turns.

`geomech run pipelines/flexural_toppling` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

from geomech.study import watched_runs

sys.path.insert(0, str(Path(__file__).parent))
from compare_flexural_toppling import Watch, check, report


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    out = Path(out)
    seen = {each.name: each.watcher for each in watched_runs(folder, out, Watch, variants, overrides, quiet)}
    text = report(seen)
    (out / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    if not quiet:
        print(f"\n{text}")
    check(seen)
    return 0
