"""Cohesion of whole faces, as in limit equilibrium: c ℓ of a face of length ℓ as long as any part of it is closed, |S|
≤ c ℓ + N tan φ.

A contact at one end of a face has the cohesion of its tributary length, half of the face, which would be lost when this
end opens. A block of uniform strain may be open by a micrometre at one end, where real rock would follow the face. The
cohesion of open ends is therefore assigned to the closed ones. The shear force of a face acts along its line, so that
it does not matter which end carries it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...model import OPEN
from .bonds import on_lines


@dataclass(frozen=True, eq=False)
class WholeFaces:
    """Faces with cohesion among the contacts (n,) of a step.

    face      (n,)     number of the face, −1 for contacts without cohesion or without length
    length    (n,) m   tributary length
    cohesion  (n,) Pa  of the joint law
    """

    face: np.ndarray
    length: np.ndarray
    cohesion: np.ndarray

    @classmethod
    def of(
        cls, block: np.ndarray, other: np.ndarray, geometry: np.ndarray, law: np.ndarray, cohesion: np.ndarray
    ) -> WholeFaces | None:
        """Of contacts between ``block`` and ``other`` (n,), ``geometry`` (n, 7) as in `ContactSet`, with the
        ``cohesion`` (n,) Pa of their ``law`` (n,); None where none has any."""
        some = np.flatnonzero((cohesion > 0.0) & (geometry[:, 4] > 0.0))
        if not len(some):
            return None
        rows, start, _ = on_lines(block, other, geometry, some)
        on_line = np.repeat(np.arange(len(start) - 1), np.diff(start))
        face = np.full(len(block), -1)
        # A face has one law.
        _, face[rows] = np.unique(on_line * (int(law.max()) + 1) + law[rows], return_inverse=True)
        return cls(face, geometry[:, 4].copy(), cohesion)

    def cohesive(self, state: np.ndarray, bonded: np.ndarray) -> np.ndarray:
        """(n,) m: length of face whose cohesion each contact carries in ``state`` with ``bonded`` (n,): closed contacts
        share the bonded length of their face."""
        some = (self.face >= 0) & (bonded > 0)
        face, closed = self.face[some], state[some] != OPEN
        number = int(self.face.max()) + 1
        whole = np.bincount(face, self.length[some], number)
        touching = np.bincount(face, self.length[some] * closed, number)
        share = np.where(touching > 0.0, whole / np.where(touching > 0.0, touching, 1.0), 1.0)
        out = self.length.copy()
        out[some] *= np.where(closed, share[face], touching[face] == 0.0)
        return out

    def touch(self, state: np.ndarray) -> np.ndarray:
        """(n,) bool: contacts on a face that has another contact closed in ``state`` (n,)."""
        known = self.face >= 0
        touches = np.zeros(int(self.face.max()) + 1, bool)
        touches[self.face[known & (state != OPEN)]] = True
        return known & touches[self.face]
