"""A rock bridge supports a key block in a tunnel roof, and breaks: compared with statics, fracture mechanics and Newton.

`geomech run pipelines/tunnel_roof` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

from geomech.study import watched_runs

sys.path.insert(0, str(Path(__file__).parent))
from compare_tunnel_roof import Watch, check, draw, report


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    out = Path(out)
    seen = {each.name: each.watcher for each in watched_runs(folder, out, Watch, variants, overrides, quiet)}
    text = report(seen)
    (out / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    draw(seen, out / "fall.png")
    if not quiet:
        print(f"\n{text}")
    check(seen)
    return 0
