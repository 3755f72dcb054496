"""Pairs of blocks that are near each other, against all pairs; kept ones against ones sought anew."""

import numpy as np
import pytest

from geomech import dda
from geomech.bench.cost.block_scenes import GRAVITY, JOINT, ROCK, WEIGHT, settings, wall
from geomech.dda.contact_detection import neighbour_search as module
from geomech.dda.contact_detection.neighbour_search import NearPairs, boxes, near_pairs
from geomech.model import State


def test_boxes_hold_their_blocks_and_no_more():
    rng = np.random.default_rng(1)
    polygons = [rng.normal(size=(n, 2)) for n in (3, 4, 1, 7)]
    first = np.array([0, 3, 7, 8])
    expected = [[*p.min(axis=0), *p.max(axis=0)] for p in polygons]
    assert np.array_equal(boxes(np.concatenate(polygons), first), expected)


@pytest.mark.parametrize("spread", [1.0, 30.0, 1e4])
def test_pairs_are_those_of_all_boxes(spread):
    rng = np.random.default_rng(int(spread))
    low = spread * rng.random((300, 2)) - 0.3 * spread
    # A few blocks are as large as everything, some have no height.
    size = 0.5 * rng.random((300, 2)) * np.where(np.arange(300) % 50 == 0, 2 * spread, 1.0)[:, None]
    size[::7, 1] = 0.0
    box, fixed, reach = np.hstack([low, low + size]), rng.random(300) < 0.2, 0.1
    i, j = np.triu_indices(300, 1)
    near = ((box[i, :2] <= box[j, 2:] + reach) & (box[j, :2] <= box[i, 2:] + reach)).all(axis=1) & ~(
        fixed[i] & fixed[j]
    )
    assert np.array_equal(near_pairs(box, fixed, reach), np.stack([i, j], axis=1)[near])


def test_pairs_are_sought_again_only_after_enough_motion():
    start = np.array([0, 4, 8])
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    near, window = NearPairs(start, np.zeros(2, bool)), 0.1

    def pairs(x: float) -> int:
        return len(near.of(np.concatenate([square, square + [x, 0.0]]), window))

    assert (pairs(1.24), near.work.pair_searches) == (0, 1)
    # 4 cm nearer, the boxes are still 20 cm apart, as far as pairs were sought.
    assert (pairs(1.2), near.work.pair_searches) == (0, 1)
    assert (pairs(1.15), near.work.pair_searches) == (1, 2)
    assert (pairs(1.11), near.work.pair_searches) == (1, 2)
    window = 0.21
    assert (pairs(1.11), near.work.pair_searches) == (1, 3)


def test_results_are_the_same_with_pairs_kept_and_sought_every_time(monkeypatch):
    def states():
        system = dda.BlockSystem(wall(12), [ROCK], [JOINT], settings=settings(5e-3))
        state = State.at_rest(system.blocks)
        # Thrown upwards and apart, so that pairs come and go.
        state.velocity[1:, 0] = np.linspace(-2.0, 2.0, len(state.velocity) - 1)
        state.velocity[1:, 1] = 0.02 * GRAVITY
        for _ in range(25):
            state = system.step(state, WEIGHT).state
        return system, state

    kept, one = states()
    monkeypatch.setattr(module, "_REACH", 1.0)
    anew, other = states()
    assert kept.work.pair_searches < 0.7 * anew.work.pair_searches
    assert np.array_equal(one.vertices, other.vertices)
    assert np.array_equal(one.contacts, other.contacts)
