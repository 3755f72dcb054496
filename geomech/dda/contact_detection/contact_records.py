"""CONTACT rows written, read and inherited in compiled loops, ten times as fast as NumPy field by field."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...compiled import UNCOUNTED, kept
from ...model import CONTACT, OPEN

_jit = kept(fastmath=False, error_model="numpy", nogil=True)


class Names(NamedTuple):
    """Identity of contacts (n,).

    vertex, edge   (n,)
    keys           (n,) vertex·n_vertices + edge
    normal         (n, 2)
    lift           largest magnitude of a lift, m
    gap            lowest gap of a closed contact, or 0, m
    """

    vertex: np.ndarray
    edge: np.ndarray
    keys: np.ndarray
    normal: np.ndarray
    lift: float
    gap: float


@_jit
def names(rows, n_vertices):
    """The `Names` of CONTACT ``rows`` (n,) on blocks of ``n_vertices``."""
    n = len(rows)
    vertex, edge, keys, normal = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.int64), np.empty((n, 2))
    lift = gap = 0.0
    for c in range(n):
        row = rows[c]
        vertex[c], edge[c] = row.vertex, row.edge
        keys[c] = row.vertex * n_vertices + row.edge
        normal[c, 0], normal[c, 1] = row.normal[0], row.normal[1]
        lift = max(lift, abs(row.lift))
        if row.state != OPEN:
            gap = min(gap, row.gap)
    return Names(vertex, edge, keys, normal, lift, gap)


@kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def largest_of_blocks(value, block, other, least):
    """Raise ``least`` (n_blocks,) to the largest ``value`` (n,) of the contacts between ``block`` and ``other`` (n,) of
    each block, in place."""
    for c in range(len(value)):
        for b in (block[c], other[c]):
            if value[c] > least[b]:
                least[b] = value[c]


@_jit
def inherited(rows, parent):
    """History that contacts inherit from their rows ``parent`` (n,) of CONTACT ``rows``; zero where ``parent`` is −1.

    Returns state and bonded (2, n); normal and shear force, slip, wear, lift, stretch and bare (7, n); inset (n,).
    """
    n = len(parent)
    kinds, sizes, inset = np.zeros((2, n), np.int64), np.zeros((7, n)), np.zeros(n, np.bool_)
    for c in range(n):
        if parent[c] < 0:
            continue
        row = rows[parent[c]]
        kinds[0, c], kinds[1, c], inset[c] = row.state, row.bonded, row.inset
        sizes[0, c], sizes[1, c], sizes[2, c], sizes[3, c] = row.normal_force, row.shear_force, row.slip, row.wear
        sizes[4, c], sizes[5, c], sizes[6, c] = row.lift, row.stretch, row.bare
    return kinds, sizes, inset


class Pairing(NamedTuple):
    """Vertex and edge of contacts (n,), their blocks ``block`` and ``other``, the joint ``law``, and whether their
    spring is ``inset`` from the vertex."""

    vertex: np.ndarray
    edge: np.ndarray
    block: np.ndarray
    other: np.ndarray
    law: np.ndarray
    inset: np.ndarray


class StepEnd(NamedTuple):
    """Contacts (n,) at the end of a step: state and bond, gap (m), forces (N), ``slip`` in the step, and the lift that
    it caused (``lifted``, m)."""

    state: np.ndarray
    bonded: np.ndarray
    gap: np.ndarray
    normal_force: np.ndarray
    shear_force: np.ndarray
    slip: np.ndarray
    lifted: np.ndarray


class SlipBefore(NamedTuple):
    """Slip, wear and lift of contacts (n,) at the start of a step, m."""

    slip: np.ndarray
    wear: np.ndarray
    lift: np.ndarray


class ContactShape(NamedTuple):
    """Geometry of contacts (n,): ``acting`` (n, 7) as in `ContactSet.geometry`, tributary ``length`` (m), ``tilt`` of
    the normal relative to the edge's (rad), and normal ``stiffness`` (N/m)."""

    acting: np.ndarray
    length: np.ndarray
    tilt: np.ndarray
    stiffness: np.ndarray


@kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def fill(rows, pairing, end, before, shape):
    """Fill CONTACT ``rows`` (n,) from plain tuples with the fields of `Pairing`, `StepEnd`, `SlipBefore` and
    `ContactShape`."""
    vertex, edge, block, other, law, inset = pairing
    state, bonded, gap, normal_force, shear_force, slip, lifted = end
    slipped, worn, lift = before
    acting, length, tilt, stiffness = shape
    for c in range(len(rows)):
        row = rows[c]
        row.vertex, row.edge, row.block, row.other, row.law = vertex[c], edge[c], block[c], other[c], law[c]
        row.inset, row.state, row.bonded, row.gap = inset[c], state[c], bonded[c], gap[c]
        row.normal_force, row.shear_force = normal_force[c], shear_force[c]
        row.position, row.length = acting[c, 0], length[c]
        row.normal[0], row.normal[1] = acting[c, 1], acting[c, 2]
        row.point[0], row.point[1] = acting[c, 5], acting[c, 6]
        row.slip, row.wear = slipped[c] + slip[c], worn[c] + abs(slip[c])
        # Sliding back reverses the lift of dilation; faces that do not fit each other (negative lift) stay so.
        row.lift = max(lift[c] + lifted[c], min(lift[c], 0.0))
        row.bare = row.stretch = 0.0
        row.tilt, row.stiffness = tilt[c], stiffness[c]


@kept(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _carry(out, rows, vertices, next_vertex):
    for k in range(len(rows)):
        out[k] = rows[k]
        row = out[k]
        vertex, start = row.vertex, row.edge
        end = next_vertex[start]
        along, up = vertices[end, 0] - vertices[start, 0], vertices[end, 1] - vertices[start, 1]
        x, y = vertices[vertex, 0] - vertices[start, 0], vertices[vertex, 1] - vertices[start, 1]
        length = np.hypot(along, up)
        row.point[0], row.point[1] = vertices[vertex, 0], vertices[vertex, 1]
        row.position = (x * along + y * up) / (length * length)
        c, s = np.cos(row.tilt), np.sin(row.tilt)
        row.normal[0], row.normal[1] = (c * up + s * along) / length, (s * up - c * along) / length


def carried(rows: np.ndarray, vertices: np.ndarray, next_vertex: np.ndarray) -> np.ndarray:
    """CONTACT ``rows`` on the geometry ``vertices`` (gap and forces unchanged)."""
    out = np.empty(len(rows), CONTACT)
    _carry(out, rows, vertices, next_vertex)
    return out


def copied(rows: np.ndarray) -> np.ndarray:
    """A copy of contiguous CONTACT ``rows``."""
    return rows.view(np.uint8).copy().view(CONTACT)
