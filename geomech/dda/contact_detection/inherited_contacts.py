"""Contacts that start a step with prescribed forces, gaps and slip, as new faces inherit them from a crack.

The normal force of a contact is that of its spring, N = kₙ (lift − gap). On a given geometry a prescribed force is
therefore a lift, and a gap that the geometry does not show (faces that do not fit each other) a negative lift.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...model import CONTACT, OPEN, SLIP, STICK
from ..kinematics.tolerances import LITTLE
from .face_quadrature import FacePoints

if TYPE_CHECKING:
    from ..open_close.contact_set import ContactSet

#: Faces of two blocks with a smaller angle between their normals (cosine) have the same misfit.
ALIGNED = 0.99
#: A new contact of faces that were closed before is at most so many times as deep as they were: they move on in the step.
_AS_DEEP = 1.5


@dataclass(frozen=True, eq=False)
class InheritedContacts:
    """Initial forces, gaps and slip of the contacts ``which`` (k,), rows of a `ContactSet`.

    normal  (k,) N, positive in compression; 0: open, unless the contact is bonded (which may carry tension)
    shear   (k,) N, along the edge's direction
    gap     (k,) m, of open contacts
    slip    (k,) m, accumulated sliding along the edge's direction
    """

    which: np.ndarray
    normal: np.ndarray
    shear: np.ndarray
    gap: np.ndarray
    slip: np.ndarray


def inherited_rows(
    found: ContactSet, inherited: InheritedContacts, closure: np.ndarray, on_multiplier: np.ndarray
) -> np.ndarray:
    """CONTACT rows of ``found``, with the forces ``inherited`` on the current geometry.

    ``closure`` (n_laws,) maximum closure of each law, m (infinite: linear); ``on_multiplier`` (n,) bool: contacts whose
    normal force is a multiplier, not a spring force."""
    rows = np.zeros(len(found), CONTACT)
    for name in (
        "vertex", "edge", "block", "other", "law", "state", "bonded", "slip", "wear", "lift", "stretch", "inset", "bare",
    ):  # fmt: skip
        rows[name] = getattr(found, name)
    rows["normal_force"], rows["shear_force"], rows["gap"] = found.normal, found.shear, found.gap
    rows["stiffness"] = found.springs.normal
    g = found.geometry
    rows["position"], rows["normal"], rows["point"], rows["length"] = g[:, 0], g[:, 1:3], g[:, 5:7], g[:, 4]

    at, n = inherited.which, inherited.normal
    closed = (n > 0) | (found.bonded[at] > 0)
    strength = found.springs.peak[at] * n
    # Edges have rotated by strains since the force was computed.
    slides = closed & (found.bonded[at] == 0) & (np.abs(inherited.shear) >= (1 - LITTLE) * strength)
    # A contact that slides without friction has no force that gives its direction.
    slides &= (inherited.shear != 0) | (strength == 0)
    pressed_in = np.where(on_multiplier[at], 0.0, _closed_by(n, found.springs.normal[at], closure[found.law[at]]))
    rows["state"][at] = np.where(closed, np.where(slides, SLIP, STICK), OPEN)
    rows["normal_force"][at] = np.where(closed, n, 0.0)
    rows["shear_force"][at] = np.where(closed, inherited.shear, 0.0)
    rows["gap"][at] = np.where(closed, -pressed_in, inherited.gap)
    rows["lift"][at] = g[at, 3] - rows["gap"][at]
    rows["slip"][at] = inherited.slip
    rows["wear"][at] = np.where(closed, np.maximum(found.wear[at], np.abs(inherited.slip)), found.wear[at])
    rows["stretch"][at], rows["bare"][at] = 0.0, -1.0
    return rows


def at_their_springs(
    rows: np.ndarray, placed: ContactSet, which: np.ndarray, closure: np.ndarray, on_multiplier: np.ndarray
) -> np.ndarray:
    """The ``rows`` of `inherited_rows`, with gaps for faces whose springs stand inside the face (``placed``).

    With these gaps the springs inside the face, not springs at its corners, carry the prescribed resultant and moment
    of the contacts ``which``."""
    n_vertices = int(max(rows["vertex"].max(), rows["edge"].max(), placed.edge.max())) + 1
    keys, placed_keys = rows["vertex"] * n_vertices + rows["edge"], placed.vertex * n_vertices + placed.edge
    order = np.argsort(keys)
    here = order[np.minimum(np.searchsorted(keys[order], placed_keys), len(keys) - 1)]
    points = placed.points
    assert isinstance(points, FacePoints)  # contacts of blocks of higher order are found at corners
    inherited = np.zeros(len(rows), bool)
    inherited[which] = True
    # Where only one end is prescribed, the other keeps its gap.
    ends = points.ends[(inherited[here[points.ends]] & (rows["state"][here[points.ends]] != OPEN)).all(axis=1)]
    force = points.at_points(rows["normal_force"][here])
    gap = points.gap_at_corners(
        np.where(on_multiplier, 0.0, -_closed_by(force, placed.springs.normal, closure[placed.law]))
    )
    at = here[ends]
    out = rows.copy()
    out["gap"][at] = gap[ends]
    out["lift"][at] = points.corners[ends, 3] - gap[ends]
    return out


def _closed_by(force: np.ndarray, stiffness: np.ndarray, closure: np.ndarray) -> np.ndarray:
    """(n,) closure of springs of ``stiffness`` N/m under ``force`` N, m: linear, or hyperbolic with maximum
    ``closure`` m."""
    return force / (stiffness + force / closure)


def misfit_of_new(
    old: np.ndarray, new: np.ndarray, block: np.ndarray, other: np.ndarray, geometry: np.ndarray, least: float
) -> np.ndarray:
    """(n,) m: lifts ≤ 0 of contacts between ``block`` and ``other`` (n,) on ``geometry`` (n, 7); 0 unless ``new`` (n,).

    Faces that do not fit each other overlap by their misfit where they touch. A corner that slides into such a face, or
    past the end of an edge, begins there with the misfit of the nearest of the ``old`` CONTACT rows between the same
    blocks in the same direction, and so without force. Misfits up to ``least``, m, are those of rounding."""
    lift = np.zeros(len(new))
    at = np.flatnonzero(new)
    if not len(at) or not (old["lift"] < -least).any():
        return lift
    first, second = np.minimum(old["block"], old["other"]), np.maximum(old["block"], old["other"])
    n_blocks = int(max(second.max(), block.max(), other.max())) + 1
    key = np.minimum(block, other)[at] * n_blocks + np.maximum(block, other)[at]
    keys = first * n_blocks + second
    at = at[np.isin(key, keys[old["lift"] < -least])]
    for c in at.tolist():
        nearest = _nearest_of_face(old, int(block[c]), int(other[c]), geometry[c])
        if nearest >= 0:
            lift[c] = min(float(old["lift"][nearest]), 0.0)
    return lift


def pressed_before(
    old: np.ndarray, new: np.ndarray, block: np.ndarray, other: np.ndarray, geometry: np.ndarray
) -> np.ndarray:
    """(n,) bool: ``new`` contacts (n,) bool between ``block`` and ``other`` (n,) on ``geometry`` (n, 7) of faces that were
    closed there before, as deep as they are now.

    Where two faces with a stiffness per area slide past a vertex between two edges, one contact takes over the length that
    another had: the faces store the same energy as before, and the new contact begins closed. ``old``: CONTACT rows."""
    out = np.zeros(len(new), bool)
    for c in np.flatnonzero(new).tolist():
        k = _nearest_of_face(old, int(block[c]), int(other[c]), geometry[c])
        if k < 0 or old["state"][k] == OPEN:
            continue
        before, now = old["lift"][k] - old["gap"][k], -geometry[c, 3]
        across, along = old["normal"][k], old["point"][k] - geometry[c, 5:7]
        tilted = abs(across[0] * geometry[c, 2] - across[1] * geometry[c, 1]) * math.hypot(*along)
        out[c] = now <= _AS_DEEP * before + tilted
    return out


def _nearest_of_face(old: np.ndarray, block: int, other: int, geometry: np.ndarray) -> int:
    """Number of the ``old`` CONTACT row between two blocks in the direction of ``geometry`` (7,) that is nearest to it; −1
    for none."""
    one, two = min(block, other), max(block, other)
    pair = (np.minimum(old["block"], old["other"]) == one) & (np.maximum(old["block"], old["other"]) == two)
    pushes = np.where(old["block"] == block, 1.0, -1.0) * (old["normal"] @ geometry[1:3])
    rows = np.flatnonzero(pair & (pushes > ALIGNED))
    if not len(rows):
        return -1
    return int(rows[np.argmin(np.hypot(*(old["point"][rows] - geometry[5:7]).T))])
