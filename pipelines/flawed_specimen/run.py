"""Effect of the number of flaws on the strength of a specimen: random specimens with more and more flaws, open or
closed with friction, loaded past their peak with crack growth controlling the load, compared with a closed form and
published experiments.

`geomech run pipelines/flawed_specimen` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import numpy as np
import specimen
from compare_flawed_specimen import check, draw, report, worst_angle
from specimen import FLAW, FRICTION_DEG, course, flaws

VARIANTS = {"closed": True, "open": False}


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    if overrides:
        raise ValueError("this study has no scene to override: change run.py and specimen.py")
    out = Path(out)
    angle = np.radians(worst_angle(FRICTION_DEG))
    half = 0.5 * FLAW * np.array([np.cos(angle), np.sin(angle)])
    alone = course(out / "one", [np.array([-half, half])], True, most=12)
    runs = {}
    for name in variants or VARIANTS:
        for number in specimen.NUMBERS:
            runs[VARIANTS[name], number] = []
            for seed in specimen.SEEDS:
                found = course(out / f"{name}_{number}_{seed}", flaws(number, seed), VARIANTS[name])
                runs[VARIANTS[name], number].append(found)
                if not quiet:
                    print(f"{number} {name} flaws, seed {seed}: peak {1e-6 * found.peak:.1f} MPa", flush=True)
    text = report(alone, runs)
    (out / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    draw(out / "flawed_specimen.png", runs)
    if not quiet:
        print(text)
    check(alone, runs)
    return 0
