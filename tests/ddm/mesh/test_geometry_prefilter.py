"""What is taken as clearly valid is nothing that a close look would refuse."""

import numpy as np
import pytest

from geomech.ddm.mesh import geometry_checks
from geomech.ddm.mesh.elements import outline_edges
from geomech.model import Cracks

SQUARE = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
HOLE = np.array([[4.0, 4.0], [4.0, 6.0], [6.0, 6.0], [6.0, 4.0]])


def random_network(rng, reach, points) -> Cracks:
    """Lines of two to five points, often on a coarse grid, so that they cross, touch, coincide and fold."""
    lines = []
    for _ in range(rng.integers(1, 4)):
        line = rng.uniform(-1, 11, 2) + np.cumsum(rng.normal(size=(rng.integers(2, points), 2)) * reach, axis=0)
        lines.append(np.round(line) if rng.random() < 0.3 else line)
    return Cracks.from_polylines(lines, join=rng.random() < 0.5)


def verdicts(cracks, loops, fresh, monkeypatch) -> tuple[bool, bool]:
    """Whether ``cracks`` are taken as clearly valid, and whether a close look finds nothing."""
    seen = []
    edges = outline_edges(loops)[0]
    plain = geometry_checks.clearly_valid
    with monkeypatch.context() as patch:
        patch.setattr(geometry_checks, "clearly_valid", lambda *given: seen.append(plain(*given)) and False)
        try:
            geometry_checks.check_cracks(cracks, edges, loops, fresh)
        except ValueError:
            return seen[0], False
    return seen[0], True


@pytest.mark.parametrize("loops", [[], [SQUARE], [SQUARE, HOLE]], ids=["plane", "square", "hole"])
def test_nothing_that_would_be_refused_is_taken_as_well(loops, monkeypatch):
    rng, found = np.random.default_rng(3), []
    for reach in (0.3, 1.0, 3.0):
        for _ in range(150):
            try:
                cracks = random_network(rng, reach, 6)
            except ValueError:  # no length
                continue
            # Old segments are well among themselves, else they would not be there.
            fresh = np.ones(cracks.n_segments, bool)
            found.append(verdicts(cracks, loops, fresh, monkeypatch))
    plain, well = np.array(found).T
    assert not (plain & ~well).any()
    # Nor is nearly everything looked at closely: only what comes near something is.
    assert plain.sum() > 0.9 * well.sum() > 30
    assert (~well).sum() > 60


def test_only_new_segments_are_judged(monkeypatch):
    """Two lines that cross are refused when one is new; when both were there they are not compared again."""
    cracks = Cracks.from_polylines([[[1, 1], [3, 3]], [[1, 3], [3, 1]]])
    for fresh, well in (([True, False], False), ([False, True], False), ([False, False], True)):
        assert verdicts(cracks, [SQUARE], np.array(fresh), monkeypatch) == (well, well)


def test_mouths_and_twins_are_looked_at_closely(monkeypatch):
    """A mouth may stand on the boundary and a segment lie upon its own reverse: neither is plain."""
    mouth = Cracks.from_polylines([[[0, 5], [2, 5]]], surface=[(True, False)])
    assert verdicts(mouth, [SQUARE], np.array([True]), monkeypatch) == (False, True)
    twin = Cracks.from_polylines([[[1, 1], [2, 2]], [[2, 2], [1, 1]]], join=True)
    assert verdicts(twin, [SQUARE], np.array([True, True]), monkeypatch) == (False, False)
