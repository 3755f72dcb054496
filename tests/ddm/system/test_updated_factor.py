"""Factors of faces in contact made from those of other states."""

from types import SimpleNamespace

import numpy as np
import pytest

from geomech.ddm.system.bordered_factor import WholeMatrix
from geomech.ddm.system.contact_rows import Rows
from geomech.ddm.system.dense_lu import Factor
from geomech.ddm.system.updated_factor import BaseOf, ContactBase
from geomech.output.checkpoints import checkpoint_file

PER, N_ELEMENTS = 3, 20


def rows(stuck: list[int], sliding: list[int]) -> Rows:
    """Closed faces: nodes that are ``stuck`` and others that are ``sliding``."""
    n = 2 * PER * N_ELEMENTS
    along = np.arange(n).reshape(N_ELEMENTS, 2, PER)[:, 0].ravel()
    across = along + PER
    prescribed, mixed = np.zeros(n, bool), np.zeros(n)
    prescribed[along[stuck]] = prescribed[across[stuck]] = True
    mixed[along[sliding]] = 0.4
    return Rows(prescribed, mixed, np.zeros(n), PER)


def equations(matrix: np.ndarray, of: Rows) -> np.ndarray:
    own, slides = matrix.copy(), np.flatnonzero(of.mixed)
    own[slides] += of.mixed[slides, None] * matrix[slides + PER]
    free = np.flatnonzero(~of.prescribed)
    return own[np.ix_(free, free)]


@pytest.mark.parametrize("transposed", [False, True])
def test_a_changed_state_is_solved_and_goes_through_a_checkpoint(transposed, tmp_path):
    rng = np.random.default_rng(0)
    n = 2 * PER * N_ELEMENTS
    matrix = rng.normal(size=(n, n)) + 8 * np.eye(n)
    before, after = rows([0, 6, 12, 18], [1, 7, 13]), rows([0, 6, 12, 20], [1, 7, 14])
    at = np.full(n, -1)
    free = np.flatnonzero(~before.prescribed)
    at[free] = np.arange(len(free))
    base = ContactBase(Factor(equations(matrix, before), "base"), before.mixed[free])
    of = BaseOf(base, WholeMatrix(SimpleNamespace(n_unknowns=n), matrix), at, PER)
    border = of.border(after)
    assert min(len(border.new), len(border.removed), len(border.changed)) > 0
    own = equations(matrix, after)
    right = rng.normal(size=(len(own), 2))
    expected = np.linalg.solve(own.T if transposed else own, right)
    factor = of.changed(after, border, "changed")
    np.testing.assert_allclose(factor.solve(right, transposed), expected, atol=1e-10)
    # As a part of a state that a run keeps.
    again = checkpoint_file.read(checkpoint_file.write(tmp_path, {"cycle": 1}, factor))
    assert np.array_equal(again.solve(right, transposed), factor.solve(right, transposed))
