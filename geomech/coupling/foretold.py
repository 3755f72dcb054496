"""What a static solution may expect of cracks before any pass, by their answers at other loads.

While no contact and no face changes its state, everything goes in a straight line with the loads, and loads with time:
what the strain of cracks is beyond S σ, too. Two answers tell the third.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .compliance import times

#: Answers that are looked back on.
KEPT = 6

#: S of a block whose change is below this part of it is the same.
_SAME = 1e-6

#: Times nearer than this part of the later one are one.
_APART = 1e-9


@dataclass(frozen=True, eq=False)
class Answer:
    """At ``time``, s, what ``systems`` of cracks (n) answer: their strain and the mean stress of their blocks, (n, 3)
    in the blocks' own axes, and S (n, 3, 3)."""

    time: float
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
class Foretold:
    """The last answers of the same ``blocks``, the newest first."""

    blocks: tuple[int, ...] = ()
    answers: list[Answer] = field(default_factory=list)

    def take(self, blocks: tuple[int, ...], answer: Answer) -> None:
        if blocks != self.blocks:
            self.blocks, self.answers = blocks, []
        self.answers = [answer, *(one for one in self.answers if one.time != answer.time)][:KEPT]

    def last(self, blocks: tuple[int, ...]) -> Answer | None:
        return self.answers[0] if self.answers and blocks == self.blocks else None

    def at(self, time: float, blocks: tuple[int, ...], systems: tuple) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where it is known, (n,) bool, of crack ``systems`` in ``blocks``: strain of cracks beyond S σ at ``time``
        (n, 3), by the line through the answers at the two nearest times, or by the nearest one where S is not that of
        both; and S (n, 3, 3)."""
        n = len(blocks)
        if self.last(blocks) is None:
            return np.zeros(n, bool), np.zeros((n, 3)), np.zeros((n, 3, 3))
        whole = [one for one in self.answers if one.is_of(systems).all()]
        near = sorted(whole or self.answers[:1], key=lambda one: abs(one.time - time))
        first = near[0]
        s = first.compliance.copy()
        beyond = first.beyond(s)
        for other in near[1:]:
            way = other.time - first.time
            if abs(way) > _APART * max(abs(other.time), abs(first.time)):
                alike = np.abs(other.compliance - s).max(axis=(1, 2)) <= _SAME * np.abs(s).max(axis=(1, 2))
                slope = (other.beyond(s) - beyond) / way
                return first.is_of(systems), beyond + np.where(alike[:, None], (time - first.time) * slope, 0.0), s
        return first.is_of(systems), beyond, s
