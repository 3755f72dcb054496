"""What a static solution may expect of cracks before any pass, by their answers at other loads.

While no contact and no face changes its state, everything goes in a straight line with the loads: what the strain of
cracks is beyond S σ, too. Two answers tell the third, where its loads are on the line through theirs.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .added_compliance import times

#: Answers that are looked back on.
KEPT = 6

#: S of a block whose change is below this part of it is the same.
_SAME = 1e-6

#: Loads nearer to one another, or to a line, than this part of the largest are the same, or on it.
_APART = 1e-9


@dataclass(frozen=True, eq=False)
class Answer:
    """At ``loads`` (k,) what ``systems`` of cracks (n) answer: their strain and the mean stress of their blocks, (n, 3)
    in the blocks' own axes, and S (n, 3, 3)."""

    loads: np.ndarray
    systems: tuple
    strain: np.ndarray
    stress: np.ndarray
    compliance: np.ndarray

    def beyond(self, compliance: np.ndarray) -> np.ndarray:
        """(n, 3) strain beyond S σ with this S."""
        return self.strain - times(compliance, self.stress)

    def is_of(self, systems: tuple) -> np.ndarray:
        """(n,) bool, whose cracks are these."""
        return np.array([a is b for a, b in zip(self.systems, systems)], bool)


@dataclass(eq=False)
class LoadExtrapolation:
    """The last answers of the same ``blocks``, the newest first."""

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
        self, loads: np.ndarray, blocks: tuple[int, ...], systems: tuple
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where it is known, (n,) bool, of crack ``systems`` in ``blocks``: strain of cracks beyond S σ at ``loads``
        (n, 3), by the line through the nearest two answers with which they are on one line, or by the nearest one where
        S is not that of both; and S (n, 3, 3)."""
        n = len(blocks)
        if self.last(blocks) is None:
            return np.zeros(n, bool), np.zeros((n, 3)), np.zeros((n, 3, 3))
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
