"""Initial guess for the crack strain of a static load step, extrapolated from up to six earlier solutions.

While no contact and no crack face changes its state, everything depends linearly on the loads, also the crack strain
beyond S σ. Two earlier solutions give a third whose loads lie on the line through theirs.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .added_compliance import times

#: Number of earlier solutions kept.
KEPT = 6

#: Relative change of S below which it counts as unchanged.
_SAME = 1e-6

#: Relative distance below which loads count as equal, or as lying on a line.
_APART = 1e-9


@dataclass(frozen=True, eq=False)
class Answer:
    """A converged solution: ``loads`` (k,); for n crack ``systems`` their strain and the mean stress of their blocks
    (n, 3), in the blocks' own axes, and S (n, 3, 3)."""

    loads: np.ndarray
    systems: tuple
    strain: np.ndarray
    stress: np.ndarray
    compliance: np.ndarray

    def beyond(self, compliance: np.ndarray) -> np.ndarray:
        """(n, 3) crack strain beyond S σ, with S the ``compliance``."""
        return self.strain - times(compliance, self.stress)

    def is_of(self, systems: tuple) -> np.ndarray:
        """(n,) bool: blocks whose crack system is the given one."""
        return np.array([a is b for a, b in zip(self.systems, systems)], bool)


@dataclass(eq=False)
class LoadExtrapolation:
    """The last solutions of the same ``blocks``, the newest first."""

    blocks: tuple[int, ...] = ()
    answers: list[Answer] = field(default_factory=list)

    def take(self, blocks: tuple[int, ...], answer: Answer) -> None:
        if blocks != self.blocks:
            self.blocks, self.answers = blocks, []
        others = (one for one in self.answers if not np.array_equal(one.loads, answer.loads))
        self.answers = [answer, *others][:KEPT]

    def last(self, blocks: tuple[int, ...]) -> Answer | None:
        return self.answers[0] if self.answers and blocks == self.blocks else None

    def at(
        self, loads: np.ndarray, blocks: tuple[int, ...], systems: tuple, width: int = 3
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Extrapolate to ``loads`` for the crack ``systems`` in ``blocks``.

        Returns where a value is known (n,) bool; the crack strain beyond S σ (n, ``width``), on the line through the nearest
        two solutions that are collinear with ``loads``, or that of the nearest one where they differ in S; and S (n, 3,
        3)."""
        n = len(blocks)
        if self.last(blocks) is None:
            return np.zeros(n, bool), np.zeros((n, width)), np.zeros((n, width, width))
        whole = [one for one in self.answers if one.is_of(systems).all()] or self.answers[:1]
        size = np.abs([loads, *(one.loads for one in whole)]).max(axis=0)
        size[size == 0.0] = 1.0
        near = sorted(whole, key=lambda one: float(np.linalg.norm((one.loads - loads) / size)))
        first = near[0]
        s = first.compliance.copy()
        beyond, known, ahead = first.beyond(s), first.is_of(systems), (loads - first.loads) / size
        for other in near[1:]:
            way = (other.loads - first.loads) / size
            square = float(way @ way)
            if square <= _APART**2:
                continue
            share = float(ahead @ way) / square
            if np.abs(ahead - share * way).max() <= _APART * max(1.0, abs(share)):
                alike = np.abs(other.compliance - s).max(axis=(1, 2)) <= _SAME * np.abs(s).max(axis=(1, 2))
                return known, beyond + np.where(alike[:, None], share * (other.beyond(s) - beyond), 0.0), s
        return known, beyond, s
