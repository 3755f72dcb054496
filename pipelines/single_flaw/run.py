"""The specimen with one flaw: its wing cracks, compared with closed forms, on one page.

`geomech run pipelines/single_flaw` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

from geomech.study import watched_runs

sys.path.insert(0, str(Path(__file__).parent))
from compare_single_flaw import Wings, report
from page_single_flaw import write_page


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    seen, places = {}, {}
    for name, place, wings, _ in watched_runs(folder, out, Wings, variants or [None], overrides, quiet):
        called = name or "this study's"
        seen[called], places[called] = wings, place
        text = report(wings)
        (place / "comparison.txt").write_text(text + "\n", encoding="utf-8")
        if not quiet:
            print("\n" + text)
    page = write_page(seen, places, Path(out))
    if not quiet:
        print(f"\n{page}")
    return 0
