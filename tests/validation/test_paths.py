"""Curved crack paths: the place a tip comes to must not depend on the increment."""

from dataclasses import replace
from itertools import pairwise, takewhile

import numpy as np

from geomech.coupling import cycles
from geomech.model import (
    Blocks,
    Cracks,
    EdgeTraction,
    GrowthSettings,
    History,
    JointLaw,
    Loads,
    Material,
    Problem,
    RunSettings,
)

GROWN = 16e-3


def slanted_crack_in_tension() -> Problem:
    """A 20 mm crack at 60° to the horizontal in a 200 mm plate pulled upwards; its wings turn to the horizontal."""
    half = 0.1
    square = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    u = 10e-3 * np.array([np.cos(np.radians(60)), np.sin(np.radians(60))])
    pull = (("load:top", [0.0, 10e6]), ("load:bottom", [0.0, -10e6]))
    return Problem(
        title="slanted crack",
        blocks=Blocks.from_polygons([square], edge_names=[[["load:bottom", "", "load:top", ""]]]),
        cracks=Cracks.from_polylines([np.array([-u, u])], aperture=np.inf),
        materials=(Material("rock", 17e9, 0.21, 2200.0, 1e5),),
        joints=(JointLaw("joint"),),
        loads=Loads(edge_tractions=tuple(EdgeTraction(name, History.constant(t)) for name, t in pull)),
        run=RunSettings(end_time=1.0, stop_at=("daylighting",)),
    )


def tip_after(increment: float, correct: bool) -> np.ndarray:
    """Where the upper tip is after 16 mm of growth in steps of ``increment``."""
    growth = GrowthSettings(increment=increment, min_increment=increment, correct=correct)
    passes = round(GROWN / increment) + 1
    last = [
        c for c in takewhile(lambda c: c.number <= passes, cycles(replace(slanted_crack_in_tension(), growth=growth)))
    ][-1]
    tip = last.tips[last.tips["end"] == 1][0]
    return tip["point"]


def test_a_corrected_path_does_not_depend_on_the_increment(verified):
    """Halving the increment from 8 to 0.5 mm: how far the end of the path moves each time (printed with ``-s``).

    Corrected steps are of second order where a path is smooth and of order 3/2 where it leaves a kink like x^(3/2), as
    both ends do here; uncorrected ones are of first order or worse. Single halvings scatter, since the stress intensity
    factors at graded kinks are right to some 1e-4 only. 0.1 mm for 4 mm steps is half a percent of the path.
    """
    orders, moves = {}, {}
    for correct in (True, False):
        places = [tip_after(increment, correct) for increment in (8e-3, 4e-3, 2e-3, 1e-3, 0.5e-3)]
        moves[correct] = [float(np.hypot(*(a - b))) for a, b in pairwise(places)]
        orders[correct] = np.log2(moves[correct][0] / moves[correct][-1]) / (len(moves[correct]) - 1)
        listed = ", ".join(f"{move:.1e}" for move in moves[correct])
        print(f"corrected {correct}: moves {listed} m, observed order {orders[correct]:.2f}")
    verified(
        "end of a path when the increment is halved, corrected",
        moves[True],
        "itself",
        unit="m",
        over=("increment, mm", (8, 4, 2, 1)),
    )
    assert orders[True] > 1.4
    assert orders[False] < 1.2
    assert moves[True][1] < 1e-4
    assert moves[True][-1] < 0.3 * moves[False][-1]
