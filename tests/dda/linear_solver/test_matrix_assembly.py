"""Matrices of blocks and contacts."""

from __future__ import annotations

import numpy as np
import pytest
from numba.core.errors import TypingError

from geomech.dda.equation_records import ContactMotion, ContactStiffness
from geomech.dda.linear_solver import assembly


def test_stiffness_stored_by_columns_is_refused():
    """Kernels read numbers one after the other: every second one would be that of another direction."""
    order, block, other = np.arange(2), np.array([0, 0]), np.array([1, 1])
    pattern = assembly.dense_pattern(order, block, other)
    contacts = ContactMotion(block, other, order, np.ones((2, 2, 12)))
    rho, none, own = np.array([[1.0, 2.0], [3.0, 4.0]]), np.zeros(2), np.zeros((2, 6, 6))
    data = np.empty(pattern.size)
    assembly.assemble(pattern, data, own, contacts, ContactStiffness(rho[0], rho[1], none, none))
    assert data[pattern.diagonal[0]] == 10.0
    by_columns = np.asfortranarray(rho)
    with pytest.raises(TypingError, match="pass it by ascontiguousarray"):
        assembly.assemble(pattern, data, own, contacts, ContactStiffness(by_columns[0], by_columns[1], none, none))
