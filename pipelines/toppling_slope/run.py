"""A slope of sixteen blocks topples and slides: the block solver alone, compared with Goodman & Bray (1976).

`geomech run pipelines/toppling_slope` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from compare_toppling_slope import check, draw, report
from toppling import at_rest, factor_of_safety, forces, last, limit_friction, modes, run, slope, written

FRICTION, SECONDS = 0.65, 3.0  # of the slope that comes down
#: Fraction of the limit at which forces are evaluated: everything that must slide does, so that friction leaves no
#: force undetermined, and inertia is a few ten-thousandths of the weight.
MOBILISED = 0.9975
SAFE = 0.95  # tan φ of a slope whose factor of safety is asked for


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    if overrides or variants:
        raise ValueError("this study has no scene to override and no variants: change run.py and toppling.py")
    rest = at_rest()
    limit = limit_friction(rest)
    table = forces(last(run(slope(MOBILISED * limit), rest, 1.5)))
    falling = slope(FRICTION)
    steps = written(falling, rest, run(falling, rest, SECONDS), Path(out) / "fall")
    early = next(step.state for step in steps if step.state.time >= 0.5 * (1 - 1e-12))
    fallen = last(steps).state
    done = modes(falling, rest, early)
    safety = SAFE, factor_of_safety(SAFE)
    text = report(limit, table, FRICTION, done, safety)
    Path(out).mkdir(parents=True, exist_ok=True)
    (Path(out) / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    outlines = [
        [falling.blocks.loops(b, s.vertices)[0] for b in range(falling.blocks.n_blocks)] for s in (rest, fallen)
    ]
    title = f"tan φ = {FRICTION:g}, {SECONDS:g} s after the friction dropped; it stands from tan φ = {limit:.3f} on"
    draw(Path(out) / "toppling_slope.png", table, *outlines, done, title)
    if not quiet:
        print(text)
    check(limit, table, done, safety)
    return 0
