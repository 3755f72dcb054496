"""Cost of the search for a factor of safety: slopes of 200, 1 000 and 3 000 blocks whose beds dip out of the face.

Only the beds' friction matters (`sliding_scenes`): every slab above a daylighting bed slides at F = tan φ/tan β,
whatever cross joints cut it.
"""

from __future__ import annotations

import math
import time
import tomllib
from dataclasses import dataclass

from ...model import Problem
from ..figures import Measured
from ..slopes.drawn_slopes import problem_of
from ..slopes.limited_runs import TimeUp, at_most
from ..slopes.sliding_scenes import BEDS, CROSS, Slope

#: Approximate number of blocks, and processor time, s, allowed for the search.
SIZES = {200: 4.0, 1000: 40.0, 3000: 240.0}
#: Dip of the beds, degrees, and angle of the cross joints: vertical, so that no column of blocks topples.
DIP, UPRIGHT = 27.0, 90.0
#: m², rock of `sliding_scenes`; beds and cross joints have equal spacings.
_AREA = 1980.0
#: Friction angles of the beds and of the cross joints here: the factor is tan 36°/tan 27° = 1.426.
_BEDS, _CROSS = 36.0, 40.0


@dataclass(frozen=True)
class Cost:
    """One search among ``blocks`` movable blocks: processor ``seconds`` (nan: over the limit), ``error`` of the factor,
    ``trials`` and their static ``steps``."""

    blocks: int
    seconds: float
    error: float
    trials: int
    steps: int


def slope_of(blocks: int) -> Problem:
    """The slope cut into about this many ``blocks``."""
    spacing = math.sqrt(_AREA / blocks)
    slope = Slope(DIP, UPRIGHT, 0.0, spacing, spacing, 2.5 * spacing, 0.0)
    text = slope.text(0.01, 1.0)
    for then, now in ((BEDS, _BEDS), (CROSS, _CROSS)):
        text = text.replace(f"friction_angle_deg = {then!r}", f"friction_angle_deg = {now!r}")
    return problem_of(tomllib.loads(text.replace("dynamic_factor = 1.0", "dynamic_factor = 0.0")))


def cost(blocks: int, limit: float) -> Cost:
    """Cost for the slope with about this many ``blocks``, within ``limit`` processor seconds."""
    from ... import dda

    problem = slope_of(blocks)
    expected = math.tan(math.radians(_BEDS)) / math.tan(math.radians(DIP))
    number, began = int((~problem.blocks.fixed).sum()), time.process_time()
    try:
        with at_most(limit):
            found = dda.factor_of_safety(
                problem.blocks, problem.materials, problem.joints, problem.loads, problem.dda,
                joint_index=problem.joint_index, load_time=problem.run.end_time,
            )  # fmt: skip
    except TimeUp:
        return Cost(number, math.nan, math.nan, 0, 0)
    spent = time.process_time() - began
    return Cost(number, spent, abs(found.factor / expected - 1), len(found.trials), sum(t.steps for t in found.trials))


def measure_cost(quick: bool = False) -> Measured:
    """One line per size, each within four times its goal; ``quick``: only the smallest."""
    lines = ["factor of safety of a slope that slides on its beds, processor seconds",
             "  blocks   seconds     goal     error   trials   steps"]  # fmt: skip
    cost(min(SIZES), math.inf)  # compiles
    errors, times = {}, {}
    for size, goal in list(SIZES.items())[: 1 if quick else None]:
        found = cost(size, 4 * goal)
        lines.append(f"{found.blocks:8d}{found.seconds:10.2f}{goal:9.0f}{found.error:10.1e}{found.trials:9d}"
                     f"{found.steps:8d}")  # fmt: skip
        errors[f"factor, {size} blocks"], times[f"search, {size} blocks"] = found.error, found.seconds
    return Measured.of("\n".join(lines), errors=errors, times=times)
