"""Quasi-Newton (Anderson) acceleration of the iteration between block motion and crack strain at one load.

A pass assumes the crack strain offset + S σ and finds another one. The plain fixed-point iteration gains a factor of 3
to 30 a pass: contacts redistribute their forces, which S (the response to mean stress) does not contain. Here the
changes of offset and residual in earlier passes are combined so that, for a linear response, the residual is reduced as
far as they allow (Anderson 1965; Walker & Ni 2011). Changes from earlier solutions are used as well, as far as newer
ones do not already span them (Degroote, Bathe & Vierendeels 2009).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

#: Passes of the present solution that are used.
DEPTH = 4

#: Changes from earlier solutions that are used.
OLDER = 12

#: Relative part of a change that must be linearly independent of newer ones: within one solution, and for earlier ones,
#: which growth and slip have made inexact.
_RANK, _RANK_OLDER = 1e-8, 3e-2

#: Relative change of S below which it counts as unchanged.
_SAME = 1e-6

#: Least relaxation factor.
_LEAST = 0.05


def strain_weights(width: int) -> np.ndarray:
    """(width,) factors of the components of a strain (γxy is the third; of higher order: deflections behind it) with
    which the sum of their squares is ε : ε, the same in all axes. Passes then do not depend on the axes of the scene."""
    weights = np.ones(width)
    weights[2] = np.sqrt(0.5)
    return weights


def strain_size(strain: np.ndarray) -> np.ndarray:
    """(n,) √(ε : ε) of every strain (n, 3), or (n, 3 + m) with deflections."""
    return np.sqrt(((strain * strain_weights(strain.shape[1])) ** 2).sum(axis=1))


class QuasiNewton:
    """Computes the next offset of the crack strains from earlier offsets and residuals.

    Where S has changed with the states of crack faces, the history is dropped. A block whose residual has changed its
    sign is then relaxed by Aitken's factor (Irons & Tuck 1969); faces that close for one response and open for the
    other would otherwise oscillate for ever.
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
        #: Largest relative residual of the last pass, if changes of earlier solutions were used in it.
        self._led: float | None = None

    def begin(self, blocks: tuple[int, ...]) -> None:
        """Start another solution, for these cracked ``blocks``."""
        self._older = (self._changes() + self._older)[:OLDER] if blocks == self._blocks else []
        self._blocks = blocks
        self._start()

    def forget(self) -> None:
        """Drop all earlier passes: the blocks respond differently from now on."""
        self._older = []
        self._start()

    def _changes(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """The changes from each pass to the next, the newest first."""
        tried = list(zip(self._offsets, self._residuals))
        return [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(tried)][::-1]

    def next(self, offset: np.ndarray, residual: np.ndarray, compliance: np.ndarray, size: np.ndarray) -> np.ndarray:
        """(n, 3) the offset to assume next.

        ``offset`` (n, 3) of the last pass, converted to the present ``compliance`` (n, 3, 3); ``residual`` (n, 3):
        crack strain found minus assumed; ``size`` (n,): strain of each block, as a weight."""
        known = self._compliance
        if known is None or np.abs(known - compliance).max() > _SAME * np.abs(compliance).max():
            self._offsets, self._residuals, self._compliance = [], [], compliance
        self._offsets, self._residuals = self._offsets[-DEPTH:] + [offset], self._residuals[-DEPTH:] + [residual]
        weight = strain_weights(residual.shape[1]) / size[:, None]
        worst = float((strain_size(residual) / size).max())
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
        """(n, 3) Σ γ (Δoffset + Δresidual), with γ from least squares of Σ γ Δresidual = ``residual``."""
        own = self._changes()
        left = (residual * weight).ravel()
        basis: list[tuple[np.ndarray, np.ndarray]] = []
        correction = np.zeros_like(residual)
        for k, (moved, changed) in enumerate(own + self._older):
            # Gram-Schmidt: the part of this change that newer ones do not span, with the offsets that belong to it.
            new, full = (changed * weight).ravel(), moved + changed
            length = float(np.linalg.norm(new))
            for direction, combined in basis:
                part = float(direction @ new)
                new, full = new - part * direction, full - part * combined
            rest = float(np.linalg.norm(new))
            if rest <= (_RANK if k < len(own) else _RANK_OLDER) * length:
                continue
            new, full = new / rest, full / rest
            basis.append((new, full))
            correction += float(new @ left) * full
        return correction

    def _relaxation(self, residual: np.ndarray) -> np.ndarray:
        """(n,) Aitken's factor of each block whose ``residual`` (n, 3) has changed its sign since the last pass, else
        1."""
        factor, square = np.ones(len(residual)), strain_weights(residual.shape[1]) ** 2
        if self._last is not None:
            before, used = self._last
            change = residual - before
            back = (square * residual * before).sum(axis=1) < 0
            size = np.where(back, (square * change**2).sum(axis=1), 1.0)
            factor = np.where(back, np.clip(-used * (square * before * change).sum(axis=1) / size, _LEAST, 1.0), factor)
        self._last = residual, factor
        return factor
