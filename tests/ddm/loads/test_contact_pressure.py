"""Contact pressures of given force and moment: always found, unique, and not up to round-off."""

from itertools import pairwise

import numpy as np
import pytest

from geomech.ddm.loads import contact_pressure
from geomech.ddm.loads.contact_pressure import Resultants, complementary_basis, positive, pressures_on_bases


def faces(lengths, pieces: int = 12) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Node places (n,) of all faces, resultants (2 n_bases, n) and first nodes."""
    first = (pieces + 1) * np.arange(len(lengths) + 1)
    places, resultants = np.zeros(first[-1]), np.zeros((2 * len(lengths), first[-1]))
    for k, length in enumerate(lengths):
        own = np.sin(0.5 * np.pi * np.arange(pieces + 1) / pieces) ** 2 * length
        places[first[k] : first[k + 1]] = own
        piece = np.diff(own)
        for i, near, far in ((0, own[:-1], own[1:]), (1, own[1:], own[:-1])):
            at = first[k] + i + np.arange(pieces)
            resultants[2 * k, at] += 0.5 * piece
            resultants[2 * k + 1, at] += 0.5 * piece * (2 * near + far) / 3
    return places, resultants, first


def compliance(resultants: np.ndarray, seed: int, friction: float = 0.0) -> np.ndarray:
    """Positive, with an antisymmetric part as friction causes it."""
    rng, n = np.random.default_rng(seed), resultants.shape[1]
    width = resultants[::2].max(axis=0)
    root, skew = rng.normal(size=(n, n)), rng.normal(size=(n, n))
    return np.outer(width, width) * (root @ root.T / n + friction * (skew - skew.T))


@pytest.mark.parametrize("seed", range(8))
def test_pressures_are_found_wherever_their_resultant_is(seed):
    """On one and two faces, from one end to the other, with friction: complementarity to round-off."""
    rng = np.random.default_rng(seed)
    _, resultants, first = faces([1.0, 2.5][: 1 + seed % 2])
    stiff = compliance(resultants, seed, 0.3)
    for arm in (0.02, 0.2, 0.5, 0.9, 0.98):
        ends = [resultants[2 * k + 1, a:b] / resultants[2 * k, a:b] for k, (a, b) in enumerate(pairwise(first))]
        right = np.array([[1.0, e[0] + arm * (e[-1] - e[0])] for e in ends]).ravel() * 1e6
        still = rng.normal(size=len(stiff)) * np.abs(stiff).max() * 1e6
        found = pressures_on_bases(stiff, still, Resultants(resultants, right, first))
        assert found is not None and found.min() >= 0
        assert resultants @ found == pytest.approx(right, rel=1e-9)
        # The motion of the bases by the nodes that press; no gap is negative, and none is open where they press.
        on = found > 1e-9 * found.max()
        free = stiff @ found - still
        motion = np.linalg.lstsq(resultants[:, on].T, -free[on], rcond=None)[0]
        gap = free + resultants.T @ motion
        assert gap.min() > -1e-8 * np.abs(free).max() and np.abs(gap[on]).max() < 1e-8 * np.abs(free).max()


def test_newton_and_pivoting_find_the_same(monkeypatch):
    _, resultants, first = faces([1.0, 3.0])
    for seed in range(10):
        stiff = compliance(resultants, seed, 0.2)
        still = np.random.default_rng(seed).normal(size=len(stiff)) * np.abs(stiff).max()
        of = Resultants(resultants, np.array([1.0, 0.3, 1.0, 1.9]), first)
        by_newton = pressures_on_bases(stiff, still, of)
        with monkeypatch.context() as patch:
            patch.setattr(contact_pressure, "_PATIENCE", 0)
            by_pivoting = pressures_on_bases(stiff, still, of)
        assert by_pivoting == pytest.approx(by_newton, rel=1e-9, abs=1e-9 * by_newton.max())


def test_round_off_decides_nothing_where_pieces_are_shorter_than_elements():
    """The face deforms as a polynomial of degree 4, and errors of 1e-6 give its other compliances any sign. Without a
    layer other nodes press with each of them, and pressures differ by their own size."""
    places, resultants, first = faces([1.0], 24)
    width = resultants[0]
    smooth = np.polynomial.legendre.legvander(2 * places - 1, 4) * width[:, None]
    still = -(smooth @ [0, 0, 0.4, 0.16, 0])
    differ = {}
    for layer in (0.05, 0.0):
        found = []
        for seed in range(6):
            noise = np.random.default_rng(seed).normal(size=(25, 25)) * np.outer(width, width)
            stiff = smooth @ np.diag([9, 9, 2, 1, 0.5]) @ smooth.T + 1e-6 * noise
            stiff = positive(stiff, resultants, layer) if layer else stiff
            found.append(pressures_on_bases(stiff, still, Resultants(resultants, np.array([1.0, 0.5]), first)))
        differ[layer] = np.ptp(found, axis=0).max() / np.max(found)
    assert differ[0.05] < 1e-3 < 0.5 < differ[0.0]


def test_without_a_solution_there_is_none():
    assert complementary_basis(np.zeros((2, 2)), np.array([1.0, -1.0])) is None
    assert complementary_basis(np.eye(2), np.array([1.0, -1.0])).tolist() == [False, True]
    _, resultants, first = faces([1.0])
    beyond = Resultants(resultants, np.array([1.0, 1.2]), first)
    assert pressures_on_bases(compliance(resultants, 0), np.zeros(13), beyond) is None
