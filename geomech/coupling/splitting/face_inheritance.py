"""New corners in a joint face inherit the state of the joint.

When a block is cut while it rests on a neighbour, its parts get new corners within their common face. Their contacts
are new, but the joint is not: bonding, wear, slip and dilation exist between the old corners as much as at them.
Without this the new corners would be unbonded, and a face cut in two would lose half of its cohesion and tensile
strength although no force has broken it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...dda.kinematics.tolerances import ONE_FACE_COS, ONE_FACE_SIN

if TYPE_CHECKING:
    from ...dda.open_close.contact_set import ContactSet

#: A corner farther beyond the old contacts of a face than this fraction of its length does not belong to it.
_BEYOND = 1e-3
#: Joint state of a contact.
_MEMORY = ("bonded", "wear", "slip", "lift", "inset")


def from_their_faces(found: ContactSet, kept: np.ndarray, old: np.ndarray, parent: np.ndarray) -> ContactSet:
    """Contacts ``found`` after a split; new ones in a face of their ``parent`` (n_blocks,) blocks get the state of the
    nearest contact that this face had.

    ``old``: CONTACT rows before the split; ``kept``: those that still exist, with their new numbers.
    """
    faces = old[old["length"] > 0]
    parts = np.bincount(parent)[parent] > 1
    new = (parts[found.block] | parts[found.other]) & (parent[found.block] != parent[found.other])
    new &= (found.geometry[:, 4] > 0) & ~np.isin(_key(found.vertex, found.edge), _key(kept["vertex"], kept["edge"]))
    rows_after, of = [], []
    for row in np.flatnonzero(new).tolist():
        nearest = _nearest(found, row, faces, parent)
        if nearest >= 0:
            rows_after.append(row)
            of.append(nearest)
    if not rows_after:
        return found
    memory = {name: getattr(found, name).copy() for name in _MEMORY}
    for name in _MEMORY:
        memory[name][rows_after] = faces[name][of]
    # (Slip along the edge is the same seen from the other block, whose edge has the opposite direction.)
    return replace(found, **memory)


def _key(vertex: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """(n,) one number for each pair."""
    return (vertex.astype(np.int64) << 32) + edge


def _nearest(found: ContactSet, row: int, faces: np.ndarray, parent: np.ndarray) -> int:
    """The old contact among ``faces`` nearest to the corner of ``row`` in the same face; −1 if there is none."""
    a, b = parent[found.block[row]], parent[found.other[row]]
    same, swapped = ((faces["block"] == x) & (faces["other"] == y) for x, y in ((a, b), (b, a)))
    sense = np.where(same, 1.0, -1.0)
    normal, point = found.geometry[row, 1:3], found.geometry[row, 5:7]
    apart = faces["point"] - point
    distance = np.hypot(*apart.T)
    on_line = (same | swapped) & (sense * (faces["normal"] @ normal) > ONE_FACE_COS)
    on_line &= np.abs(apart @ normal) <= ONE_FACE_SIN * np.maximum(distance, faces["length"])
    at = np.flatnonzero(on_line)
    if not len(at):
        return -1
    along = apart[at] @ np.array([-normal[1], normal[0]])
    beyond = _BEYOND * float(faces["length"][at].sum())
    if along.min() > beyond or along.max() < -beyond:
        return -1
    return int(at[np.argmin(distance[at])])
