"""A slope of a thousand blocks with a hundred rock bridges under the El Centro record of 1940, compared with Newmark's
sliding block.

`geomech run pipelines/jointed_slope` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

from geomech.study import watched_runs

sys.path.insert(0, str(Path(__file__).parent))
from compare_jointed_slope import Slide, check, draw, report


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    for _, place, slide, summary in watched_runs(folder, out, Slide, variants or [None], overrides, quiet):
        text = report(slide, summary)
        (place / "comparison.txt").write_text(text + "\n", encoding="utf-8")
        draw(slide, place / "jointed_slope.png")
        if not quiet:
            print("\n" + text)
        check(slide)
    return 0
