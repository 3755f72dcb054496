"""Passes of blocks and cracks at one load brought to agree: a quasi-Newton method that learns from every pass."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

#: Passes of one solution that are looked back on.
DEPTH = 4

#: Changes from pass to pass of earlier solutions that are.
OLDER = 12

#: Changes of residuals of which less than this part is new say nothing new: in one solution, and of earlier ones, of
#: which cracks that have grown and contacts that have slipped leave no more than so much true.
_RANK, _RANK_OLDER = 1e-8, 3e-2

#: S whose change is below this part of it is the same.
_SAME = 1e-6

#: Least relaxation factor.
_LEAST = 0.05


class Settling:
    """The next offset of the crack strains, from those tried so far and what came out.

    A pass assumes the crack strain offset + S σ and finds another one. Handing back what it found is a fixed-point
    iteration, which gains a factor of three to thirty a pass: contacts whose forces it moves load the cracks otherwise
    than by the blocks' mean stress, which is all that S knows. Here changes from pass to pass are combined so that,
    were the answer linear, what is left of the difference from agreement would cancel as far as it can (Anderson 1965;
    Walker & Ni 2011). What blocks in contact do to cracks is nearly the same at another load, and beside it at grown
    cracks: the changes that earlier solutions have seen count, too, the newest first, and older ones by what they tell
    that newer ones have not (Degroote, Bathe & Vierendeels 2009). Where they do not help they are forgotten.

    Where S itself has changed, with the states of crack faces, what was before tells nothing for all blocks together;
    a block whose difference has turned about is then relaxed by Aitken's factor (Irons & Tuck 1969), for faces that
    close at one answer and open at the other would go on for ever.
    """

    def __init__(self) -> None:
        self._blocks: tuple[int, ...] = ()
        #: Changes (of the offset, of the residual) of earlier solutions, each (n, 3), the newest first.
        self._older: list[tuple[np.ndarray, np.ndarray]] = []
        self._start()

    def _start(self) -> None:
        self._offsets: list[np.ndarray] = []
        self._residuals: list[np.ndarray] = []
        self._compliance: np.ndarray | None = None
        self._last: tuple[np.ndarray, np.ndarray] | None = None
        #: Largest residual of the last pass, relative, where earlier solutions led to the present one.
        self._led: float | None = None

    def begin(self, blocks: tuple[int, ...]) -> None:
        """Passes of another solution, of the cracked ``blocks``, follow."""
        self._older = (self._changes() + self._older)[:OLDER] if blocks == self._blocks else []
        self._blocks = blocks
        self._start()

    def forget(self) -> None:
        """What earlier passes have shown is of no use: blocks answer otherwise from now on."""
        self._older = []
        self._start()

    def _changes(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """From each pass to the next, the newest first."""
        tried = list(zip(self._offsets, self._residuals))
        return [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(tried)][::-1]

    def next(self, offset: np.ndarray, residual: np.ndarray, compliance: np.ndarray, size: np.ndarray) -> np.ndarray:
        """(n, 3) the offset to assume. ``offset`` (n, 3) is that of the last pass (told for the present
        ``compliance``), (n, 3, 3), ``residual`` the crack strain found less the one assumed; ``size`` (n,) of the
        blocks' strain weighs them."""
        known = self._compliance
        if known is None or np.abs(known - compliance).max() > _SAME * np.abs(compliance).max():
            self._offsets, self._residuals, self._compliance = [], [], compliance
        self._offsets, self._residuals = self._offsets[-DEPTH:] + [offset], self._residuals[-DEPTH:] + [residual]
        weight = 1.0 / size[:, None]
        worst = float(np.abs(residual * weight).max())
        if self._led is not None and worst > self._led:
            self._older = []
        self._led = None
        relaxation = self._relaxation(residual)
        if len(self._offsets) < 2 and (not self._older or (relaxation < 1.0).any()):
            return offset + relaxation[:, None] * residual
        self._last = residual, np.ones(len(residual))
        self._led = worst if self._older else None
        return offset + residual - self._correction(residual, weight)

    def _correction(self, residual: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """(n, 3) Σ γ (Δoffset + Δresidual) with Σ γ Δresidual as near to the ``residual`` as can be."""
        own = self._changes()
        left = (residual * weight).ravel()
        ways: list[tuple[np.ndarray, np.ndarray]] = []
        correction = np.zeros_like(residual)
        for k, (moved, changed) in enumerate(own + self._older):
            # By Gram and Schmidt: what of this change newer ones have not told, and what it moved for it.
            new, full = (changed * weight).ravel(), moved + changed
            length = float(np.linalg.norm(new))
            for way, went in ways:
                part = float(way @ new)
                new, full = new - part * way, full - part * went
            rest = float(np.linalg.norm(new))
            if rest <= (_RANK if k < len(own) else _RANK_OLDER) * length:
                continue
            new, full = new / rest, full / rest
            ways.append((new, full))
            correction += float(new @ left) * full
        return correction

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
