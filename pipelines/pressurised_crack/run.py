"""A crack under fluid pressure below a free surface: K against depth, and the path by which it turns towards the
surface.

`geomech run pipelines/pressurised_crack` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

import numpy as np

from geomech import ddm
from geomech.model import Cracks, DdmSettings, GrowthSettings, Material

sys.path.insert(0, str(Path(__file__).parent))
from compare_pressurised_crack import check, draw, report

DEPTHS = np.array([0.03, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0])  # in half-lengths of the crack
ROCK = Material("rock", youngs_modulus=30e9, poissons_ratio=0.25, k_ic=1e6)


def crack_below(depth: float) -> tuple[list[np.ndarray], Cracks]:
    """A block large enough to stand for the half-plane, with a crack of half-length 1 m parallel to its top."""
    size = 20.0 * (1.0 + depth)
    block = np.array([[-size, -2 * size], [size, -2 * size], [size, 0], [-size, 0]])
    return [block], Cracks.from_polylines([np.array([[-1, -depth], [1, -depth]])], aperture=np.inf)


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    fluid, fine, growth = ddm.BodyLoad(crack_pressure=1e6), DdmSettings(order=6), GrowthSettings(increment=0.15)
    tips = [ddm.Body(*crack_below(depth), ROCK, fine).solve(fluid).tips for depth in DEPTHS]
    k = np.array([[tip["k_i"][1], tip["k_ii"][1]] for tip in tips]) / 1e6
    paths = {depth: list(ddm.propagate(*crack_below(depth), ROCK, fluid, growth))[-1].cracks for depth in (0.5, 1.0)}
    text = report(DEPTHS, k, paths)
    Path(out).mkdir(parents=True, exist_ok=True)
    (Path(out) / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    draw(Path(out) / "pressurised_crack.png", DEPTHS, k, paths)
    if not quiet:
        print(text)
    check(DEPTHS, k, paths)
    return 0
