"""Energy release at tips and energy stored by blocks: K under the forces that strain the block, G over an increment and
at a kink, and whether the response of a block is proportional to its load."""

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

#: rad; the kink series is accurate up to this angle.
_LARGEST_KINK = 2.2
#: Relative difference between crack energy and half of stress times strain up to which a block counts as proportional:
#: the error of the elements in Betti's theorem.
PROPORTIONAL = 1e-3


class MeanStressTips:
    """``tips``, including those of skipped blocks, with K under the mean stress in blocks with the mean-stress
    response, ``under_mean_stress`` (block → solution). Computed on first use, since it is needed only if something grows."""

    def __init__(self, tips: np.ndarray, under_mean_stress: dict[int, Solution]) -> None:
        self._tips, self._hang = tips, under_mean_stress

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
    """Begin and end of the rows with each ``number`` (n,); equal numbers are adjacent."""
    marks = [0, *(np.flatnonzero(np.diff(number)) + 1).tolist(), len(number)]
    return pairwise(marks) if len(number) else iter(())


def kink_release(tips: np.ndarray) -> np.ndarray:
    """(n,) k₁² + k₂² at infinitesimal kinks in the growth directions of ``tips`` (Amestoy & Leblond 1992); k₂² alone
    for kinks that close."""
    from ...ddm.fracture.criteria import kink_factors

    angle = np.clip(tips["angle"], -_LARGEST_KINK, _LARGEST_KINK)
    k = (kink_factors(angle) @ np.stack([tips["k_i"], tips["k_ii"]], axis=-1)[..., None])[..., 0]
    return np.maximum(k[:, 0], 0.0) ** 2 + k[:, 1] ** 2


def mean_release(before: float, after: float) -> float:
    """Mean G over an increment: trapezoidal rule, or that of an exponential where G falls (growth that arrests may
    release nearly all of it on the first part of a long increment)."""
    if not 0 < after < before:
        return 0.5 * (before + after)
    return (before - after) / np.log(before / after)


@dataclass(frozen=True, eq=False)
class Loaded:
    """A block under its mean ``stress``, Pa, with the ``strain`` of its cracks, in its own axes; ``in_proportion``: it
    stores half of their product, as long as no face slides or has closed."""

    stress: np.ndarray
    strain: np.ndarray
    in_proportion: bool

    @classmethod
    def of(cls, block: int, solution: Solution, by_mean_stress: ByMeanStress) -> Loaded:
        stress, strain = by_mean_stress.strained(block, solution)
        product = 0.5 * solution.body.area * float(stress @ strain)
        in_proportion = abs(solution.crack_energy - product) <= PROPORTIONAL * abs(product)
        return cls(stress, strain, in_proportion)
