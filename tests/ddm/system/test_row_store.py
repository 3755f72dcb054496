"""Rows of G kept as a product of two thin matrices."""

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.system import row_store
from geomech.ddm.system.row_store import EXACT, KeptRows, LowRankRows
from geomech.model import Cracks, DdmSettings, Material

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
SETTINGS = DdmSettings(order=4, elements_per_crack=12, elements_per_side=24)


@pytest.fixture(autouse=True)
def few_at_a_time(monkeypatch):
    """Products of the small matrices here."""
    monkeypatch.setattr(row_store, "COMBINED", 8)


def body_with(*cracks, reuse=None):
    lines = [np.array(crack, dtype=float) for crack in cracks]
    rock = Material("rock", 50e9, 0.25)
    return ddm.Body([SQUARE], Cracks.from_polylines(lines), rock, SETTINGS, reuse)


def test_a_product_is_the_rows_to_its_tolerance():
    """Four cracks, one of them close to a side; products with loads, single rows, and the transpose."""
    body = body_with(
        [[-0.5, -0.3], [-0.1, 0.4]], [[0.2, 0.5], [0.6, 0.5]], [[0.1, -0.5], [0.5, -0.2]], [[-0.8, 0.6], [-0.4, 0.97]]
    )
    rows = body.condensation.rows
    product, whole = LowRankRows.of_rows(rows), rows.dense
    assert product is not None
    assert np.linalg.norm(product.dense - whole) < 100 * EXACT * np.linalg.norm(whole)
    load = np.random.default_rng(1).normal(size=(whole.shape[1], 2))
    size = np.abs(whole @ load).max()
    np.testing.assert_allclose(product @ load, whole @ load, atol=1e-8 * size)
    some = np.array([3, 0, 7])
    np.testing.assert_allclose(product.of(some), rows.of(some), atol=1e-8 * np.abs(whole).max())
    on_faces = np.random.default_rng(2).normal(size=len(whole))
    np.testing.assert_allclose(product.T @ on_faces, whole.T @ on_faces, atol=1e-8 * np.abs(whole.T @ on_faces).max())


def test_rows_that_no_product_shortens_stay():
    body = body_with([[-0.2, 0.0], [0.2, 0.0]])
    random = np.random.default_rng(0).normal(size=body.condensation.rows.dense.shape)
    assert LowRankRows.of_rows(KeptRows.whole(random, body.faces)) is None


def test_cracks_grow_from_a_product():
    """K after growth as without it, to 1e-8: rows of old elements come from the product, those of new ones are exact."""
    load = ddm.BodyLoad(sides={0: (0.0, -1e6), 2: (0.0, 1e6)})
    straight = [[-0.4, 0.0], [0.3, 0.1]]
    factors = []
    for product in (False, True):
        body = body_with(straight)
        if product:
            body.condensation._rows = LowRankRows.of_rows(body.condensation.rows)
            assert body.condensation._rows is not None
        tips = body_with([*straight, [0.35, 0.15]], reuse=ddm.Reuse(body)).solve(load).tips
        factors.append(np.concatenate([tips["k_i"], tips["k_ii"]]))
    np.testing.assert_allclose(factors[1], factors[0], atol=1e-8 * np.abs(factors[0]).max())
