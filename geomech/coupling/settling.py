"""Passes of blocks and cracks at one load brought to agree: Anderson's acceleration of the crack strain handed over."""

from __future__ import annotations

import numpy as np

#: Passes that are looked back on.
DEPTH = 4

#: Differences of residuals that are shorter than this part of the longest say nothing new.
_RANK = 1e-8

#: S whose change is below this part of it is the same.
_SAME = 1e-6

#: Least relaxation factor.
_LEAST = 0.05


class Settling:
    """The next offset of the crack strains, from those tried so far and what came out (Anderson 1965; Walker & Ni
    2011).

    A pass assumes the crack strain offset + S σ and finds another one. Handing back what it found is a fixed-point
    iteration, which gains a factor of three to thirty a pass: contacts whose forces it moves load the cracks otherwise
    than by the blocks' mean stress, which is all that S knows. Here the last `DEPTH` passes are combined so that, were
    the answer linear, their differences from agreement would cancel as far as they can. Where S itself has changed,
    with the states of crack faces, what was before tells nothing for all blocks together; a block whose difference has
    turned about is then relaxed by Aitken's factor (Irons & Tuck 1969), for faces that close at one answer and open at
    the other would go on for ever.
    """

    def __init__(self) -> None:
        self._offsets: list[np.ndarray] = []
        self._residuals: list[np.ndarray] = []
        self._compliance: np.ndarray | None = None
        self._last: tuple[np.ndarray, np.ndarray] | None = None

    def next(self, offset: np.ndarray, residual: np.ndarray, compliance: np.ndarray, size: np.ndarray) -> np.ndarray:
        """(n, 3) the offset to assume. ``offset`` (n, 3) is that of the last pass (told for the present
        ``compliance``), (n, 3, 3), ``residual`` the crack strain found less the one assumed; ``size`` (n,) of the
        blocks' strain weighs them."""
        known = self._compliance
        if known is None or np.abs(known - compliance).max() > _SAME * np.abs(compliance).max():
            self._offsets, self._residuals, self._compliance = [], [], compliance
        self._offsets, self._residuals = self._offsets[-DEPTH:] + [offset], self._residuals[-DEPTH:] + [residual]
        plain = offset + residual
        if len(self._offsets) < 2:
            return offset + self._relaxation(residual)[:, None] * residual
        self._last = residual, np.ones(len(residual))
        weight = 1.0 / size[:, None]
        steps = np.array([residual - earlier for earlier in self._residuals[:-1]])
        moves = np.array([offset - earlier for earlier in self._offsets[:-1]])
        columns = (steps * weight).reshape(len(steps), -1).T
        gain, *_ = np.linalg.lstsq(columns, (residual * weight).ravel(), rcond=_RANK)
        return plain - np.tensordot(gain, moves + steps, axes=1)

    def _relaxation(self, residual: np.ndarray) -> np.ndarray:
        """(n,) Aitken's factor of each block whose ``residual`` (n, 3) has turned about since the last pass, else 1."""
        factor = np.ones(len(residual))
        if self._last is not None:
            before, used = self._last
            change = residual - before
            back = (residual * before).sum(axis=1) < 0
            size = np.where(back, (change**2).sum(axis=1), 1.0)
            factor = np.where(back, np.clip(-used * (before * change).sum(axis=1) / size, _LEAST, 1.0), factor)
        self._last = residual, factor
        return factor
