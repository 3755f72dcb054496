"""The summary says how far the last K are to be trusted: the worst of all blocks."""

from types import SimpleNamespace

import numpy as np
import pytest

from geomech import ddm
from geomech.model import TIP, Cracks, DdmSettings, Material
from geomech.output.tables.crack_reliability import ESTIMATED_UP_TO, ROUND_OFF, crack_trust

SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1.0]])


def solved(half, **settings):
    crack = Cracks.from_polylines([np.array([[-half, 0.0], [half, 0.0]])], aperture=np.inf)
    body = ddm.Body([SQUARE], crack, Material("rock", 17e9, 0.21, k_ic=1e6), DdmSettings(**settings))
    return body.solve(ddm.BodyLoad(remote_stress=[0, 1e6, 0]))


def cycle(bodies):
    tips = np.concatenate([solution.tips for solution in bodies.values()]).astype(TIP)
    tips["block"] = np.repeat([*bodies], 2)
    tips["k_eq"] = tips["k_i"]
    return SimpleNamespace(bodies=bodies, tips=tips, blocks=SimpleNamespace(names=["base", "left", "right"]))


def test_the_worst_block_is_reported():
    coarse, fine = solved(0.5, order=1, elements_per_side=2), solved(0.3, order=6)
    told = crack_trust(cycle({1: coarse, 2: fine}))
    assert max(coarse.residual, fine.residual) < told["residual"] == ROUND_OFF
    assert told["condition"] == pytest.approx(max(coarse.condition, fine.condition), rel=5e-3)  # three digits
    assert told["k_error_block"] == "left"
    off = abs(coarse.tips["k_i"] / solved(0.5, order=8).tips["k_i"] - 1).max()
    assert 0.5 * off < told["k_error"] < 4 * off


def test_what_has_no_estimate_is_left_out():
    class Unsettled(SimpleNamespace):
        @property
        def tip_errors(self):
            raise ddm.NotConverged("crack faces did not settle")

    fine = solved(0.3, order=6)
    other = Unsettled(residual=1e-3, condition=1e9, tips=fine.tips)
    told = crack_trust(cycle({1: other, 2: fine}))
    assert told["residual"] == 1e-3 and told["condition"] == 1e9
    assert told["k_error_block"] == "right" and told["k_error"] == pytest.approx(
        fine.tip_errors.max() / fine.tips["k_i"].max(), rel=5e-3
    )


def test_of_many_blocks_those_driven_hardest_are_looked_at():
    """Three of eleven, and only of these is the error estimated."""
    fine, asked = solved(0.3, order=6), []

    class Body(SimpleNamespace):
        @property
        def residual(self):
            asked.append(self.number)
            return 1e-3

    def of(number):
        tips = fine.tips.copy()
        tips["k_i"] *= 1 + number % 5
        same = SimpleNamespace(n_unknowns=ESTIMATED_UP_TO + (number == 4))
        return Body(number=number, tips=tips, condition=1e5 * number, body=same, tip_errors=0.01 * tips["k_i"])

    many = cycle({number: of(number) for number in range(11)})
    many.blocks.names = [str(number) for number in range(11)]
    told = crack_trust(many)
    assert asked == [9, 3, 8]  # 4, driven as hard as 9, is too large
    assert told["condition"] == 9e5 and told["k_error_block"] in "938"
