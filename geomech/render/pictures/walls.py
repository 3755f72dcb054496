"""Cracks along which blocks were cut: block faces since then, but drawn as former cracks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from geomech.output.reading import Run

from ..fields.frame import reference

if TYPE_CHECKING:
    import pyvista as pv

#: A point lies on a line if it is nearer than this part of the drawing's extent.
_ON = 1e-9
#: Number of points compared with all lines at a time.
_BATCH = 512


@dataclass(frozen=True, eq=False)
class Walls:
    """Block faces that were cracks, in the reference configuration.

    ends    (n, 2, 2) m
    birth   (n,) cycle in which the crack grew there, 0 for initial cracks
    cut     (n,) cycle that ended with the cut
    """

    ends: np.ndarray
    birth: np.ndarray
    cut: np.ndarray

    @classmethod
    def of(cls, run: Run) -> Walls:
        """Of the whole run, as far as its grids were written."""
        ends, birth, cut = [np.empty((0, 2, 2))], [np.empty(0, int)], [np.empty(0, int)]
        written = np.array(list(run.grids("blocks")), int)
        splits = run.events["cycle"][run.events["kind"] == "split"] if len(run.events) else ()
        for number in np.unique(splits).astype(int).tolist():
            if not (written > number).any() or not (written <= number).any():
                continue
            before = _outline(run.grid("blocks", number))
            after = _outline(run.grid("blocks", int(written[written > number].min())))
            known = set(map(bytes, before))
            new = after[[bytes(line) not in known for line in after]]
            new = new[_holder(new, before) < 0]
            cracks = run.grid("cracks", number)
            lines = reference(cracks)[cracks.cells.reshape(-1, 3)[:, 1:]]
            # A segment contains several lines: the midpoint of a face decides which of them it is on.
            midpoint = new.mean(axis=1, keepdims=True).repeat(2, axis=1)
            holder = _holder(midpoint, lines)
            old = np.append(np.asarray(cracks["birth_cycle"]).astype(int), number)
            ends.append(new)
            birth.append(old[holder])
            cut.append(np.full(len(new), number))
        return cls(np.concatenate(ends), np.concatenate(birth), np.concatenate(cut))

    def births(self, lines: np.ndarray, cycle: int) -> np.ndarray:
        """(m,) cycle in which the face containing each of ``lines`` (m, 2, 2) grew, as of ``cycle``; −1 for none."""
        here = self.cut < cycle
        return np.append(self.birth[here], -1)[_holder(lines, self.ends[here])]


def _outline(blocks: pv.UnstructuredGrid) -> np.ndarray:
    """(n, 2, 2) edges of all blocks in the reference configuration, ends sorted."""
    triangles = blocks.cells.reshape(-1, 4)[:, 1:]
    sides = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    sides, count = np.unique(sides, axis=0, return_counts=True)
    ends = reference(blocks)[sides[count == 1]]
    swap = (ends[:, 0, 0] > ends[:, 1, 0]) | ((ends[:, 0, 0] == ends[:, 1, 0]) & (ends[:, 0, 1] > ends[:, 1, 1]))
    ends[swap] = ends[swap, ::-1]
    return np.ascontiguousarray(ends)


def _holder(lines: np.ndarray, among: np.ndarray) -> np.ndarray:
    """(m,) first row of ``among`` (n, 2, 2) on which both ends of each of ``lines`` (m, 2, 2) lie; −1 for none."""
    found = np.full(len(lines), -1)
    if not len(lines) or not len(among):
        return found
    start, along = among[:, 0], among[:, 1] - among[:, 0]
    length = np.hypot(*along.T)
    near = _ON * float(np.ptp(among.reshape(-1, 2), axis=0).max())
    unit = along / np.maximum(length, 1e-300)[:, None]
    for first in range(0, len(lines), _BATCH):
        arm = lines[first : first + _BATCH, :, None] - start
        position = np.einsum("penx,nx->pen", arm, unit)
        off = np.abs(arm[..., 0] * unit[:, 1] - arm[..., 1] * unit[:, 0])
        on = ((off < near) & (position > -near) & (position < length + near)).all(axis=1)
        found[first : first + _BATCH] = np.where(on.any(axis=1), on.argmax(axis=1), -1)
    return found
