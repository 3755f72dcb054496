"""Records taken by the compiled kernels for the equations of a step: contacts, springs, and block positions in the
matrix."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class BlockEquations(NamedTuple):
    """The blocks' own equations, without contacts: ``matrix`` (n, 6, 6) and ``right`` (n, 6)."""

    matrix: np.ndarray
    right: np.ndarray


class ContactMotion(NamedTuple):
    """Relative motion of contacts (n,) in terms of the unknowns.

    block, other  (n,)         owners of the vertex and of the edge
    order         (n_blocks,)  number of each block's unknowns, −1 if fixed
    vectors       (n, 2, 12)   from `assembly.contact_vectors`
    """

    block: np.ndarray
    other: np.ndarray
    order: np.ndarray
    vectors: np.ndarray


class ContactSides(NamedTuple):
    """Contact sides by block: those of block b are ``side`` from ``start[b]`` to before ``start[b + 1]``; 2 c is the
    vertex of contact c and 2 c + 1 its edge."""

    start: np.ndarray
    side: np.ndarray


class MatrixPlaces(NamedTuple):
    """Locations of the 6×6 blocks in the flat matrix, as in `assembly.Pattern`: ``begins`` (n + 1,), ``stride`` and
    ``diagonal`` (n,) of the block rows, ``upper`` and ``lower`` (n_contacts,) of the two couplings of a contact."""

    begins: np.ndarray
    stride: np.ndarray
    diagonal: np.ndarray
    upper: np.ndarray
    lower: np.ndarray


class ContactStiffness(NamedTuple):
    """Tangents of contacts (n,): dN = −``normal`` (n − κ t)·Δu with κ the ``lift``, dS = −``shear`` t·Δu + ``slope`` dN;
    stiffness in N/m."""

    normal: np.ndarray
    shear: np.ndarray
    slope: np.ndarray
    lift: np.ndarray


class SpringsInStates(NamedTuple):
    """Contacts (n,) in given states, and their springs (`penalty_springs.Springs`).

    state, direction         contact state, and sense of sliding
    gap                      at the start of the step, m
    normal, shear            stiffness, N/m
    friction, sliding        a sliding contact carries ``friction`` N + ``sliding``
    lift                     dilation, m per m
    shear0                   shear force at the start of the step, N
    """

    state: np.ndarray
    direction: np.ndarray
    gap: np.ndarray
    normal: np.ndarray
    shear: np.ndarray
    friction: np.ndarray
    sliding: np.ndarray
    lift: np.ndarray
    shear0: np.ndarray
