"""Static, sliding or toppling columns on an incline: the whole map, compared with Yagoda-Biran & Hatzor (2013).

`geomech run pipelines/sliding_toppling_map` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from columns import INCLINE, mode, slides_below, topples_above, topples_below
from compare_sliding_toppling_map import check, draw, report

SLENDERNESS = np.radians(np.arange(1.5, 60.0, 3.0))
FRICTION = np.radians(np.arange(1.5, 60.0, 3.0))


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    if overrides or variants:
        raise ValueError("this study has no scene to override and no variants: change run.py and columns.py")
    grid = [(delta, phi, mode(delta, phi)) for delta in SLENDERNESS for phi in FRICTION]
    searches = {
        "slides": (slides_below, (4, 8, 12, 16, 20, 24, 28, 36, 44, 52)),
        "slides and topples": (topples_above, (4, 8, 12, 16, 20, 24, 28)),
        "topples": (topples_below, (36, 44, 52)),
    }
    found = {
        kind: np.array([(at, search(at)) for at in np.radians(angles)]) for kind, (search, angles) in searches.items()
    }
    text = report(INCLINE, found)
    Path(out).mkdir(parents=True, exist_ok=True)
    (Path(out) / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    draw(Path(out) / "sliding_toppling_map.png", INCLINE, grid, found)
    if not quiet:
        print(text)
    check(INCLINE, grid, found)
    return 0
