"""Contacts that begin a step with forces, gaps and slip told from elsewhere: faces that another model has held till
now.

A contact's normal force is that of its spring, N = kₙ (lift − gap), so a force at a given geometry is a lift, and a gap
that the geometry does not show (faces that do not fit each other) a negative one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...model import CONTACT, OPEN, SLIP, STICK

if TYPE_CHECKING:
    from ..open_close.contact_set import ContactSet

#: A shear force nearer to its strength than this part of it is tried as sliding: edges have turned by strains since it
#: was known.
_AT_STRENGTH = 1e-3


@dataclass(frozen=True, eq=False)
class ToldContacts:
    """What the contacts ``which`` (k,), rows of a `ContactSet`, begin with.

    normal  (k,) N, positive in compression; 0: open, unless the contact is bonded, which may be pulled
    shear   (k,) N, along the edge's direction
    gap     (k,) m, of those that are open
    slip    (k,) m, sliding so far, along the edge's direction
    """

    which: np.ndarray
    normal: np.ndarray
    shear: np.ndarray
    gap: np.ndarray
    slip: np.ndarray


def told_rows(found: ContactSet, told: ToldContacts, closure: np.ndarray, on_multiplier: np.ndarray) -> np.ndarray:
    """CONTACT rows of ``found``, those that are ``told`` of with these forces on the geometry as it is; ``closure``
    (n_laws,) m that each law tends to (infinite: straight), ``on_multiplier`` (n,) contacts whose normal force no
    spring keeps."""
    rows = np.zeros(len(found), CONTACT)
    for name in (
        "vertex", "edge", "block", "other", "law", "state", "bonded", "slip", "wear", "lift", "stretch", "inset", "bare",
    ):  # fmt: skip
        rows[name] = getattr(found, name)
    rows["normal_force"], rows["shear_force"], rows["gap"] = found.normal, found.shear, found.gap
    g = found.geometry
    rows["position"], rows["normal"], rows["point"], rows["length"] = g[:, 0], g[:, 1:3], g[:, 5:7], g[:, 4]

    at, n = told.which, told.normal
    closed = (n > 0) | (found.bonded[at] > 0)
    strength = found.springs.peak[at] * n
    slides = closed & (found.bonded[at] == 0) & (np.abs(told.shear) >= (1 - _AT_STRENGTH) * strength)
    # What slides without friction has no force to tell which way.
    slides &= (told.shear != 0) | (strength == 0)
    pressed_in = np.where(on_multiplier[at], 0.0, _closed_by(n, found.springs.normal[at], closure[found.law[at]]))
    rows["state"][at] = np.where(closed, np.where(slides, SLIP, STICK), OPEN)
    rows["normal_force"][at] = np.where(closed, n, 0.0)
    rows["shear_force"][at] = np.where(closed, told.shear, 0.0)
    rows["gap"][at] = np.where(closed, -pressed_in, told.gap)
    rows["lift"][at] = g[at, 3] - rows["gap"][at]
    rows["slip"][at] = told.slip
    rows["wear"][at] = np.where(closed, np.maximum(found.wear[at], np.abs(told.slip)), found.wear[at])
    rows["stretch"][at], rows["bare"][at] = 0.0, -1.0
    return rows


def at_their_springs(
    rows: np.ndarray, placed: ContactSet, which: np.ndarray, closure: np.ndarray, on_multiplier: np.ndarray
) -> np.ndarray:
    """The ``rows`` of `told_rows`, those ``which`` are told of in faces whose springs stand inside them (``placed``)
    with the gaps at which these springs, and not ones at the corners, bear the resultant and the moment told."""
    n_vertices = int(max(rows["vertex"].max(), rows["edge"].max(), placed.edge.max())) + 1
    keys, theirs = rows["vertex"] * n_vertices + rows["edge"], placed.vertex * n_vertices + placed.edge
    order = np.argsort(keys)
    here = order[np.minimum(np.searchsorted(keys[order], theirs), len(keys) - 1)]
    points = placed.points
    told = np.zeros(len(rows), bool)
    told[which] = True
    # Where only one end is told of, the other keeps the gap that it had.
    ends = points.ends[(told[here[points.ends]] & (rows["state"][here[points.ends]] != OPEN)).all(axis=1)]
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
    """(n,) m by which springs of ``stiffness`` N/m are closed under ``force`` N, straight or hyperbolic to
    ``closure``."""
    return force / (stiffness + force / closure)
