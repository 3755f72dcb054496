"""T-junctions: contacts of flat vertices inside a common face, whose stiffness is assigned to the contacts at its ends.

Where a joint ends on a block's side, cutting leaves a flat vertex in it. First-order blocks keep their sides straight,
so that the two ends of a face determine its pressure, wherever vertices lie between them. At first such a vertex
coincides with the corner of another block. When the blocks slide, the corner moves on and the vertex stays behind in
the face. If contacts of both shared the stiffness by tributary length, the vertex would have all of it before and
almost none after, with a force that stretches the remaining spring, while the corner would suddenly be pressed in. (In
a wall one such vertex created half of the energy converted.) This concerns stiffness per area times length alone:
penalty springs do not depend on the length.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...compiled import kept
from ...model import OPEN
from ..joint_laws.bonds import WITHOUT_GAPS
from ..kinematics.tolerances import ONE_FACE_COS, ONE_FACE_SIN


class NodesInFaces(NamedTuple):
    """Contacts (k,) of flat vertices inside faces.

    node        (k,)    rows of the table
    neighbours  (k, 2)  rows of the contacts on either side, which take their stiffness
    share       (k, 2)  of the stiffness that each neighbour takes, by the lever rule
    """

    node: np.ndarray
    neighbours: np.ndarray
    share: np.ndarray

    def left(self, carried: np.ndarray) -> np.ndarray:
        """(n,) ``carried`` (n,), tributary lengths or forces of all contacts, with the nodes' share moved to their
        neighbours."""
        return _left(carried, self.node, self.neighbours, self.share)

    def continued(self, parent: np.ndarray, state: np.ndarray) -> np.ndarray:
        """(n,) rows of the last step that contacts continue: ``parent`` (n,), −1 for new ones.

        A contact that is new, or was open, next to a node whose contact was closed continues that one. ``state``: of
        the last step's rows."""
        return _continued(parent, state, self.node, self.neighbours)


@kept(fastmath=False, error_model="numpy", nogil=True)
def _left(carried, node, neighbours, share):
    out = carried.copy()
    for k in range(node.shape[0]):
        # In this order: a node between passes on what it has received.
        for side in range(2):
            out[neighbours[k, side]] += share[k, side] * out[node[k]]
        out[node[k]] = 0.0
    return out


@kept(fastmath=False, error_model="numpy", nogil=True)
def _continued(parent, state, node, neighbours):
    out = parent.copy()
    for k in range(node.shape[0]):
        before = parent[node[k]]
        if before < 0 or state[before] == OPEN:
            continue
        for end in neighbours[k]:
            if out[end] < 0 or state[out[end]] == OPEN:
                out[end] = before
    return out


def nodes_in_faces(
    vertex: np.ndarray,
    edge: np.ndarray,
    owner: np.ndarray,
    flat: np.ndarray,
    geometry: np.ndarray,
    law: np.ndarray,
    by_length: np.ndarray,
) -> NodesInFaces | None:
    """T-junctions among contacts (n,) of ``vertex`` and ``edge``, ordered by pairs of blocks; None without any.

    ``owner`` and ``flat`` (n_vertices,): block, and `Blocks.in_side`; ``geometry`` (n, 7) and ``law`` (n,) as in
    `ContactSet`; ``by_length`` (n,) bool: contacts whose stiffness is proportional to their length."""
    candidate = flat[vertex] & by_length & (geometry[:, 4] > 0)
    if not candidate.any():
        return None
    node, neighbours, share = _between(candidate, vertex, edge, owner, geometry, law)
    return NodesInFaces(node, neighbours, share) if len(node) else None


@kept(fastmath=False, error_model="numpy", nogil=True)
def _between(candidate, vertex, edge, owner, geometry, law):
    n = vertex.shape[0]
    out = np.zeros(n, np.bool_)
    length = geometry[:, 4].copy()
    node = np.empty(n, np.int64)
    neighbours = np.empty((n, 2), np.int64)
    share = np.empty((n, 2))
    count = first = 0
    for r in range(n):
        a, b = owner[vertex[r]], owner[edge[r]]
        while not (
            (owner[vertex[first]] == a and owner[edge[first]] == b)
            or (owner[vertex[first]] == b and owner[edge[first]] == a)
        ):
            first += 1
        if not candidate[r]:
            continue
        nx, ny = geometry[r, 1], geometry[r, 2]
        before, after = -np.inf, np.inf
        low = high = -1
        for q in range(first, n):
            one, two = owner[vertex[q]], owner[edge[q]]
            if not ((one == a and two == b) or (one == b and two == a)):
                break
            if q == r or out[q] or law[q] != law[r] or length[q] <= 0.0:
                continue
            if abs(nx * geometry[q, 1] + ny * geometry[q, 2]) < ONE_FACE_COS:
                continue
            dx, dy = geometry[q, 5] - geometry[r, 5], geometry[q, 6] - geometry[r, 6]
            along, off = dy * nx - dx * ny, dx * nx + dy * ny
            if abs(off) > ONE_FACE_SIN * abs(along) + abs(geometry[r, 3]) + abs(geometry[q, 3]):
                continue
            if along < 0.0 and along > before:
                before, low = along, q
            elif along > 0.0 and along < after:
                after, high = along, q
        # A node's tributary length is half the distance between its neighbours; otherwise the face has a gap.
        if low < 0 or high < 0 or abs(length[r] - 0.5 * (after - before)) > WITHOUT_GAPS * (after - before):
            continue
        out[r] = True
        node[count] = r
        neighbours[count, 0], neighbours[count, 1] = low, high
        share[count, 0], share[count, 1] = after / (after - before), -before / (after - before)
        length[low] += share[count, 0] * length[r]
        length[high] += share[count, 1] * length[r]
        count += 1
    return node[:count], neighbours[:count], share[:count]
