"""What parts begin with in motion: as much stress of their own as there is energy for, and their own cracks' strain.

The last solution of the whole body gives the mean stress of every part, unlike the whole's where it was bent. A block
of one strain has stored nothing of that: its parts would begin with more energy than it had. What there is besides its
own is what its cracks have stored, the part of it that the block has been spending, less what those keep that are still
cracks, of a part. So parts begin with σ₀ + λ (σ − σ₀), σ₀ the stress of the whole, and the largest λ ≤ 1 with which
they store no more than the whole and its cracks did; what is left is set free as they part. The rest of their stress
comes in motion, by the work of the forces on them. The cracks of parts begin with the strain that they answer with to
that stress: where they began with that of the whole, their first step would close what is no longer theirs, against it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ...model import Blocks, State
from ..coupled_state import CrackedBlocks
from ..crack_compliance.added_compliance import crack_response, passive, strain_rotation
from .block_splitting import Split


def begin_in_motion(
    now: CrackedBlocks, split: Split, before: Blocks, state: State, stored: Mapping[int, float]
) -> None:
    """Give the parts of ``split``, which ``now`` has taken, what they are to begin with; ``before`` are the blocks that
    were cut, in ``state``, ``stored`` J/m what each had at its cracks."""
    is_part = np.bincount(split.parent, minlength=before.n_blocks)[split.parent] > 1
    cracked = [part for part in np.flatnonzero(is_part).tolist() if part in now.bodies]

    def answer(part: int, stress: np.ndarray):
        now.by_mean_stress.add(part)
        turn, began = float(split.state.rotation[part]), now.history.get(part)
        return now.by_mean_stress.answer(part, now.bodies[part], stress, turn, now.system.compliance[part], began)

    left = dict(stored)
    for part in cracked:
        parent = int(split.parent[part])
        left[parent] = left.get(parent, 0.0) - answer(part, state.stress[parent]).crack_energy
    begun = paid_stress(split, before, state, now.system.compliance, left)
    strain = begun.crack_strain.copy()
    for part in cracked:
        turn, found = float(begun.rotation[part]), answer(part, begun.stress[part])
        limit = now.by_mean_stress.limit(part, now.bodies[part], now.system.compliance[part])
        own = limit.T @ found.crack_strain
        strain[part] = strain_rotation(turn) @ own
        soft = limit.T @ passive(now.bodies[part].compliance(found)) @ limit
        now.response.compliance[part], now.response.offset[part] = crack_response(soft, own, begun.stress[part], turn)
    now.state = replace(begun, crack_strain=strain)


def paid_stress(
    split: Split, before: Blocks, state: State, compliance: np.ndarray, stored: Mapping[int, float]
) -> State:
    """The state of ``split`` of the blocks ``before`` in ``state`` with the stress of parts that is paid for;
    ``compliance`` (n_parts, 3, 3) of the rock, 1/Pa, of blocks after, and J/m ``stored`` at the cracks, of blocks
    before."""
    stress = split.state.stress.copy()
    areas = split.blocks.areas(split.state.vertices)
    count = np.bincount(split.parent, minlength=before.n_blocks)
    for block in np.flatnonzero(count > 1).tolist():
        parts = np.flatnonzero(split.parent == block)
        whole, elastic = state.stress[block], compliance[parts[0]]
        change = stress[parts] - whole
        square = 0.5 * float(areas[parts] @ np.einsum("ni,ij,nj->n", change, elastic, change))
        linear = float(areas[parts] @ (change @ elastic @ whole))
        stress[parts] = whole + _largest(square, linear, max(stored.get(block, 0.0), 0.0)) * change
    return replace(split.state, stress=stress)


def _largest(square: float, linear: float, energy: float) -> float:
    """The largest λ up to one with ``square`` λ² + ``linear`` λ ≤ ``energy``, which is not negative."""
    if square + linear <= energy:
        return 1.0
    # Without cancellation where linear > 0.
    root = math.sqrt(linear**2 + 4 * square * energy)
    return 2 * energy / (linear + root) if linear > 0 else (root - linear) / (2 * square)
