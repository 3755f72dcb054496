"""Cohesion of whole faces, as limit equilibrium counts it: c ℓ of a face of the length ℓ for as long as it touches
anywhere, |S| ≤ c ℓ + N tan φ.

A contact at one end of a face holds the cohesion of its tributary length, half of the face. An end that opens would
take that half along. Blocks that strain evenly bear on one end of a face and part by a micrometre at the other, where
rock, which follows the face, would not; the cohesion of the ends that are open then goes to those that are closed. The
shear force of a face acts along its line, so that it does not matter which of its ends bears it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...model import OPEN
from .bonds import on_lines


@dataclass(frozen=True, eq=False)
class WholeFaces:
    """Faces that hold cohesion, among the contacts (n,) of a step.

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
        """(n,) m of its face whose cohesion each contact holds in ``state`` with ``bonded`` (n,): closed ones share
        what is bonded of theirs."""
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
        """(n,) whether the contact is on a face of which another is closed in ``state`` (n,)."""
        known = self.face >= 0
        touches = np.zeros(int(self.face.max()) + 1, bool)
        touches[self.face[known & (state != OPEN)]] = True
        return known & touches[self.face]
