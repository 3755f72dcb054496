"""The matrix of blocks and contacts: against sums of outer products, and the same whoever fills its rows."""

import numpy as np
import pytest

from geomech.dda.equation_records import ContactMotion, ContactStiffness
from geomech.dda.linear_solver import assembly

N_BLOCKS, N_CONTACTS = 30, 150


def _system(sparse: bool):
    """A pattern of blocks of which every fourth is fixed, their own matrices, and contacts with random laws."""
    rng = np.random.default_rng(5)
    order = np.where(np.arange(N_BLOCKS) % 4 == 0, -1, np.cumsum(np.arange(N_BLOCKS) % 4 != 0) - 1)
    block = rng.integers(0, N_BLOCKS, N_CONTACTS)
    other = (block + rng.integers(1, 5, N_CONTACTS)) % N_BLOCKS
    points = rng.random((N_BLOCKS, 2))
    pattern = (
        assembly.sparse_pattern(order, block, other, points) if sparse else assembly.dense_pattern(order, block, other)
    )
    vectors = rng.normal(size=(N_CONTACTS, 2, 12))
    laws = rng.random((4, N_CONTACTS))
    # Some contacts are open.
    laws[:2, ::5] = 0.0
    return pattern, rng.normal(size=(pattern.n, 6, 6)), block, other, vectors, laws


def _filled(pattern, matrix, block, other, vectors, laws) -> np.ndarray:
    data = np.full(pattern.size, np.nan)
    contacts = ContactMotion(block, other, pattern.order, vectors)
    assembly.assemble(pattern, data, matrix, contacts, ContactStiffness(*laws))
    return data


def _full(pattern, data: np.ndarray) -> np.ndarray:
    """(6n, 6n) of the flat ``data``."""
    if pattern.solver is None:
        return data.reshape(6 * pattern.n, -1)
    full = np.zeros((6 * pattern.n, 6 * pattern.n))
    for i in range(pattern.n):
        for k in range(pattern.solver.pointer[i], pattern.solver.pointer[i + 1]):
            j = pattern.solver.columns[k]
            full[6 * i : 6 * i + 6, 6 * j : 6 * j + 6] = data[36 * k : 36 * k + 36].reshape(6, 6)
    return full


@pytest.mark.parametrize("sparse", [False, True])
def test_a_matrix_is_the_sum_of_what_blocks_and_contacts_do(sparse):
    pattern, matrix, block, other, vectors, laws = _system(sparse)
    expected = np.zeros((6 * pattern.n, 6 * pattern.n))
    for b in range(pattern.n):
        expected[6 * b : 6 * b + 6, 6 * b : 6 * b + 6] = matrix[b]
    for c in range(N_CONTACTS):
        kn, ks, slope, lift = laws[:, c]
        n, t = vectors[c]
        # −dN = kₙ (n − κ t)·Δu pushes along n + slope t, −dS = kₛ t·Δu along t.
        added = np.outer(kn * (n + slope * t), n - lift * t) + np.outer(ks * t, t)
        unknowns = [6 * i + a if i >= 0 else -1 for i in pattern.order[[block[c], other[c]]] for a in range(6)]
        free = np.flatnonzero(np.array(unknowns) >= 0)
        expected[np.ix_(np.array(unknowns)[free], np.array(unknowns)[free])] += added[np.ix_(free, free)]
    found = _full(pattern, _filled(pattern, matrix, block, other, vectors, laws))
    assert np.abs(found - expected).max() < 1e-14 * np.abs(expected).max()


def test_rows_are_the_same_to_the_bit_when_threads_share_them(monkeypatch):
    system = _system(True)
    alone = _filled(*system)
    monkeypatch.setattr(assembly, "THREADED", 0)
    monkeypatch.setattr(assembly, "SHARE", 3)
    assert np.array_equal(_filled(*system), alone)
