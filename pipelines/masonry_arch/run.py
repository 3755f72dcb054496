"""How thin may a semicircular arch of stone be? The block solver alone, compared with limit analysis and Milankovitch
(1907).

`geomech run pipelines/masonry_arch` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from arch import arch, fall, rest, seen, thinnest
from compare_masonry_arch import check, draw, from_crown, hinges, report

NUMBERS = (6, 9, 12, 16, 25, 40)
VOUSSOIRS, STANDING, FALLING, SECONDS = 24, 0.12, 0.1, 1.3  # of the two arches that are drawn


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    if overrides or variants:
        raise ValueError("this study has no scene to override and no variants: change run.py and arch.py")
    limits = {n: thinnest(n) for n in NUMBERS}
    stands, falls = arch(VOUSSOIRS, STANDING), arch(VOUSSOIRS, FALLING)
    standing = seen(stands, rest(stands).result)
    falling = seen(falls, fall(falls, SECONDS))
    turned = from_crown(hinges(falling), VOUSSOIRS)
    text = report(limits, turned)
    Path(out).mkdir(parents=True, exist_ok=True)
    (Path(out) / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    titles = (f"$t/R$ = {STANDING:.2f} stands", f"$t/R$ = {FALLING:.2f}, {SECONDS:g} s after its centring is struck")
    draw(Path(out) / "masonry_arch.png", limits, standing, falling, titles)
    if not quiet:
        print(text)
    check(limits, turned, VOUSSOIRS)
    return 0
