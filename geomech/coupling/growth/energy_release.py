"""What tips release and blocks store: K as it is felt, G over an increment and as a tip turns, and whether a block answers
in proportion to its load."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ...ddm import Solution
    from ..crack_compliance.mean_stress_response import ByMeanStress

#: rad; the series of kinks is good for no larger ones.
_LARGEST_KINK = 2.2
#: Energy around cracks is half of stress times strain to this part of itself where they answer in proportion: to what
#: elements leave of reciprocity.
PROPORTIONAL = 1e-3


class FeltTips:
    """``tips``, and those of blocks that were left out, with the K that the mean stress brings in blocks that feel no
    more, ``hang`` (block → solution); found when something grows."""

    def __init__(self, tips: np.ndarray, hang: dict[int, Solution]) -> None:
        self._tips, self._hang = tips, hang

    def __getstate__(self) -> dict[str, np.ndarray]:
        return {"rows": self.rows}

    @cached_property
    def rows(self) -> np.ndarray:
        """(n_tips,) TIP."""
        there = set(self._tips["block"].tolist())
        left_out = [of.tips for block, of in self._hang.items() if block not in there]
        out = np.concatenate([self._tips, *left_out])
        for first, last in _runs(out["block"]):
            solution = self._hang.get(int(out["block"][first]))
            if solution is not None:
                for name in ("k_i", "k_ii"):
                    out[name][first:last] = solution.tips[name]
        return out


def _runs(number: np.ndarray) -> Iterator[tuple[int, int]]:
    """Where rows of one ``number`` (n,) begin and end; those of a block stand together."""
    marks = [0, *(np.flatnonzero(np.diff(number)) + 1).tolist(), len(number)]
    return pairwise(marks) if len(number) else iter(())


def kink_release(tips: np.ndarray) -> np.ndarray:
    """(n,) k₁² + k₂² at the tips of kinks of no length by the growth angles of ``tips`` (Amestoy & Leblond 1992), of
    those that close k₂² alone."""
    from ...ddm.fracture.criteria import kink_factors

    angle = np.clip(tips["angle"], -_LARGEST_KINK, _LARGEST_KINK)
    k = (kink_factors(angle) @ np.stack([tips["k_i"], tips["k_ii"]], axis=-1)[..., None])[..., 0]
    return np.maximum(k[:, 0], 0.0) ** 2 + k[:, 1] ** 2


def mean_release(before: float, after: float) -> float:
    """G over an increment, by the trapezoidal rule, and as of an exponential where it falls: growth that comes to rest may
    take nearly all of it on the first part of a long one."""
    if not 0 < after < before:
        return 0.5 * (before + after)
    return (before - after) / np.log(before / after)


@dataclass(frozen=True, eq=False)
class Loaded:
    """A block under its mean ``stress``, Pa, and the ``strain`` of its cracks, in its own axes; ``in_proportion``: it
    stores half of their product, as where no face rubs or has closed."""

    stress: np.ndarray
    strain: np.ndarray
    in_proportion: bool

    @classmethod
    def of(cls, block: int, solution: Solution, by_mean_stress: ByMeanStress) -> Loaded:
        stress, strain = by_mean_stress.strained(block, solution)
        product = 0.5 * solution.body.area * float(stress @ strain)
        in_proportion = abs(solution.crack_energy - product) <= PROPORTIONAL * abs(product)
        return cls(stress, strain, in_proportion)
