"""Records that the compiled kernels of a step's equations take: contacts, their springs, and where blocks stand in the
matrix."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class BlockEquations(NamedTuple):
    """The blocks' own equations, without contacts: ``matrix`` (n, 6, 6) and ``right`` (n, 6)."""

    matrix: np.ndarray
    right: np.ndarray


class ContactMotion(NamedTuple):
    """How contacts (n,) move with the unknowns.

    block, other  (n,)         owners of the vertex and of the edge
    order         (n_blocks,)  number of each block's unknowns, −1 if fixed
    vectors       (n, 2, 12)   as from `assembly.contact_vectors`
    """

    block: np.ndarray
    other: np.ndarray
    order: np.ndarray
    vectors: np.ndarray


class ContactSides(NamedTuple):
    """Contact sides block by block: those of block b are ``side`` from ``start[b]`` to before ``start[b + 1]``, 2 c the
    vertex of contact c and 2 c + 1 its edge."""

    start: np.ndarray
    side: np.ndarray


class MatrixPlaces(NamedTuple):
    """Where the flat matrix holds its 6×6 blocks, as in `assembly.Pattern`: ``begins`` (n + 1,), ``stride`` and
    ``diagonal`` (n,) of the rows of blocks, ``upper`` and ``lower`` (n_contacts,) of the two couplings of a contact."""

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

    state, direction         and sense of sliding
    gap                      as the step begins, m
    normal, shear            stiffness, N/m
    friction, sliding        a sliding contact carries ``friction`` N + ``sliding``
    lift                     dilation, m per m
    shear0                   shear force as the step begins, N
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
