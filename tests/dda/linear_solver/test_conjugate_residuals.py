"""Conjugate residuals whose directions serve one right side after the other, against dense solutions."""

import numpy as np
import pytest

from geomech.dda.linear_solver.conjugate_residuals import Directions


@pytest.fixture
def matrices():
    """One that is soft in three directions, and an inverse that knows nothing of that."""
    rng = np.random.default_rng(3)
    left, right = (np.linalg.qr(rng.normal(size=(60, 60)))[0] for _ in range(2))
    stiffness = np.array([*rng.uniform(1.0, 1.2, 57), 0.1, 0.2, 0.3])
    return left @ np.diag(stiffness) @ right, right.T @ np.diag(1.0 / np.maximum(stiffness, 1.0)) @ left.T


def solved(matrix, known, right, nearly):
    """The solution to 1e-10 of the right side, with an inverse that is ``nearly`` right, and the directions it took."""
    x, rest = np.zeros(len(right)), right.copy()
    largest, before = known.project(x, rest), known.number
    while largest > 1e-10 * np.abs(right).max():
        direction = nearly @ rest
        largest = known.add(direction, matrix @ direction, x, rest)
        assert np.allclose(rest, right - matrix @ x, rtol=0, atol=1e-11 * np.abs(right).max())
    return x, known.number - before


def test_what_one_right_side_took_the_next_need_not(matrices):
    matrix, nearly = matrices
    rng, known, taken = np.random.default_rng(4), Directions(60, 40), []
    for _ in range(2):
        right = rng.normal(size=60)
        x, number = solved(matrix, known, right, nearly)
        expected = np.linalg.solve(matrix, right)
        assert np.abs(x - expected).max() <= 1e-7 * np.abs(expected).max()
        taken.append(number)
    # One for each stiffness that the inverse takes for another, and one for all others together; then that one.
    assert taken == [4, 1]
    # A multiple of what is known takes none.
    assert solved(matrix, known, 3.0 * right, nearly)[1] == 0


def test_the_oldest_make_room_and_what_leads_nowhere_is_reported(matrices):
    matrix, rng, known = matrices[0], np.random.default_rng(5), Directions(60, 4)
    x, rest = np.zeros(60), rng.normal(size=60)
    for k in range(6):
        before = np.linalg.norm(rest)
        direction = rng.normal(size=60)
        assert np.isfinite(known.add(direction, matrix @ direction, x, rest))
        assert known.number == (k + 1 if k < 4 else k - 3) and np.linalg.norm(rest) <= before
    assert known.add(np.ones(60), np.zeros(60), x, rest) == np.inf
    assert Directions(60, 4).project(np.zeros(60), np.full(60, np.nan)) == np.inf


def test_of_two_that_share_a_room_one_forgets_what_the_other_overwrites(matrices):
    matrix, nearly = matrices
    rng = np.random.default_rng(6)
    first = Directions(60, 40, room=np.empty(2 * 40 * 60 + 3))
    second = Directions(60, 10, first)
    assert np.shares_memory(first._directions, second._directions) and (len(first), len(second)) == (40, 10)
    for _ in range(2):
        for known, other in ((first, second), (second, first)):
            right = rng.normal(size=60)
            x, _ = solved(matrix, known, right, nearly)
            expected = np.linalg.solve(matrix, right)
            assert np.abs(x - expected).max() <= 1e-7 * np.abs(expected).max()
            assert known.number > 0 and other.number == 0
