"""Arrays survive packing to the precision that their kind promises."""

from __future__ import annotations

import numpy as np
import pytest
from reading import arrays

from geomech.player.packing import Block


def packed(kind: str, values: np.ndarray) -> np.ndarray:
    block = Block()
    getattr(block, kind)("x", values)
    return arrays(block.record())["x"]


def test_fractions_are_right_to_their_range():
    values = np.random.default_rng(0).normal(3.0, 1e-4, 1000)
    values[17] = np.nan
    found = packed("fraction", values)
    known = np.isfinite(values)
    assert np.array_equal(np.isnan(found), ~known)
    # Half a step of 65 534 over the range.
    assert np.abs(found - values)[known].max() <= 0.51 * np.ptp(values[known]) / 65534
    assert np.array_equal(packed("fraction", np.full(5, 2.5)), np.full(5, 2.5))


def test_halves_are_right_to_themselves_over_nine_orders():
    values = np.concatenate([10.0 ** np.arange(0, 9, 0.1), -(10.0 ** np.arange(0, 9, 0.1)), [0.0, np.nan]])
    found = packed("half", values)
    assert np.isnan(found[-1]) and found[-2] == 0.0
    # Eleven bits for what is within 1e9 of the largest value.
    assert np.abs(found[:-2] / values[:-2] - 1).max() < 5e-4
    assert np.array_equal(packed("half", np.zeros(3)), np.zeros(3))


@pytest.mark.parametrize(("most", "kind"), [(255, "B"), (256, "H"), (65536, "I")])
def test_integers_take_the_bytes_they_need(most, kind):
    block = Block()
    block.whole("x", np.array([0, most]))
    assert block.arrays["x"][0] == kind
    assert arrays(block.record())["x"].tolist() == [0, most]


def test_what_cannot_be_packed_is_refused():
    block = Block()
    with pytest.raises(ValueError, match="x: -1 is below 0"):
        block.whole("x", np.array([-1]))
    block.single("x", np.zeros(2))
    with pytest.raises(ValueError, match="x exists already"):
        block.single("x", np.zeros(2))
    assert arrays(Block().record()) == {}
