"""Contacts that begin a step with forces, gaps and slip told from elsewhere: faces that another model has held till
now.

A contact's normal force is that of its spring, N = kₙ (lift − gap), so a force at a given geometry is a lift, and a gap
that the geometry does not show (faces that do not fit each other) a negative one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..model import CONTACT, OPEN, SLIP, STICK

if TYPE_CHECKING:
    from .contact_set import ContactSet

#: A shear force nearer to its strength than this part of it is tried as sliding: edges have turned by strains since it
#: was known.
_AT_STRENGTH = 1e-3


@dataclass(frozen=True, eq=False)
class ToldContacts:
    """What the contacts ``which`` (k,), rows of a `ContactSet`, begin with.

    normal  (k,) N, positive in compression; 0: open, unless the contact is bonded
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
    pressed_in = np.where(on_multiplier[at], 0.0, n / (found.springs.normal[at] + n / closure[found.law[at]]))
    rows["state"][at] = np.where(closed, np.where(slides, SLIP, STICK), OPEN)
    rows["normal_force"][at] = np.where(closed, n, 0.0)
    rows["shear_force"][at] = np.where(closed, told.shear, 0.0)
    rows["gap"][at] = np.where(closed, -pressed_in, told.gap)
    rows["lift"][at] = g[at, 3] - rows["gap"][at]
    rows["slip"][at] = told.slip
    rows["wear"][at] = np.where(closed, np.maximum(found.wear[at], np.abs(told.slip)), found.wear[at])
    rows["stretch"][at], rows["inset"][at], rows["bare"][at] = 0.0, False, -1.0
    return rows
