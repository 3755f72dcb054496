"""The elements of a mirrored body are the mirrored elements, in whatever sense its edges run."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from geomech.ddm.mesh.elements import mesh
from geomech.model import Cracks, DdmSettings

SIDE = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 8.0], [0.0, 8.0]])


@pytest.mark.parametrize(
    "mouths", [(3.0,), (3.0, 3.4), (2.45, 3.1, 4.9), (2.5, 5.2, 5.25)], ids=["one", "two", "three", "near nodes"]
)
@pytest.mark.parametrize(
    "settings", [DdmSettings(elements_per_side=2), DdmSettings(elements_per_side=3, grading_layers=4)]
)
def test_cracks_that_begin_side_by_side_on_one_edge(mouths, settings):
    lines = [np.array([[x, 0.0], [x + 0.3, 1.5]]) for x in mouths]
    own, other = (
        mesh(
            [loop],
            Cracks.from_polylines([line * way for line in lines], surface=[(True, False)] * len(lines)),
            settings,
        )
        for loop, way in ((SIDE, (1.0, 1.0)), ((SIDE * (-1.0, 1.0))[::-1], (-1.0, 1.0)))
    )
    for plain, mirrored in ((own.boundary, other.boundary), (own.cracks, other.cracks)):
        assert plain.n == mirrored.n
        middle = 0.5 * (mirrored.start + mirrored.end) * (-1.0, 1.0)
        assert cKDTree(middle).query(0.5 * (plain.start + plain.end))[0].max() < 1e-9
    # Every mouth is a node, and the elements make up the outline.
    ends = np.concatenate([own.boundary.start, own.boundary.end])
    assert all(np.hypot(*(ends - (x, 0.0)).T).min() < 1e-12 for x in mouths)
    assert np.hypot(*(own.boundary.end - own.boundary.start).T).sum() == pytest.approx(36.0, rel=1e-12)
