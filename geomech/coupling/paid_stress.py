"""What stress parts begin with in motion: as much of their own as there is energy for.

The last solution of the whole body tells the mean stress of every part, unlike the whole's where it was bent. A block
of one strain has stored nothing of that: its parts would begin with more energy than it had. What there is besides its
own is what its cracks have stored, the part of it that the block has been spending. So parts begin with
σ₀ + λ (σ − σ₀), σ₀ the stress of the whole, and the largest λ ≤ 1 with which they store no more than the whole and its
cracks did; what is left is set free as they part. The rest of their stress comes in motion, by the work of the forces
on them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..model import Blocks, State
from .splitting import Split


def paid_stress(
    split: Split, before: Blocks, state: State, compliance: np.ndarray, stored: Mapping[int, float]
) -> Split:
    """``split`` of the blocks ``before`` in ``state`` with the stress of parts that is paid for; ``compliance``
    (n_blocks, 3, 3) of the rock, 1/Pa, and J/m ``stored`` at the cracks, of blocks before."""
    stress = split.state.stress.copy()
    areas = split.blocks.areas(split.state.vertices)
    count = np.bincount(split.parent, minlength=before.n_blocks)
    for block in np.flatnonzero(count > 1).tolist():
        parts = np.flatnonzero(split.parent == block)
        whole, elastic = state.stress[block], compliance[block]
        change = stress[parts] - whole
        square = 0.5 * float(areas[parts] @ np.einsum("ni,ij,nj->n", change, elastic, change))
        linear = float(areas[parts] @ (change @ elastic @ whole))
        stress[parts] = whole + _largest(square, linear, max(stored.get(block, 0.0), 0.0)) * change
    return replace(split, state=replace(split.state, stress=stress))


def _largest(square: float, linear: float, energy: float) -> float:
    """The largest λ up to one with ``square`` λ² + ``linear`` λ ≤ ``energy``, which is not negative."""
    if square + linear <= energy:
        return 1.0
    # Without cancellation where linear > 0.
    root = math.sqrt(linear**2 + 4 * square * energy)
    return 2 * energy / (linear + root) if linear > 0 else (root - linear) / (2 * square)
