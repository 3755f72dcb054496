"""Initial stress and crack strain of the parts of a moving block that splits.

The last solution of the whole body gives the mean stress σ of each part, which differs from the stress σ₀ of the whole
if the block was bent. A DDA block has uniform strain and has stored no bending energy, so that parts with stress σ
could start with more energy than the whole had. Available besides the energy of the whole is what its cracks have
stored at the block's expense, minus what remains in cracks of the parts. The parts therefore start with σ₀ + λ (σ − σ₀)
and the largest λ ≤ 1 for which they store no more than the whole and its cracks did; the remaining energy is released
by the split. The rest of their stress develops in motion, by the work of the forces on them. Their cracks start with
the strain that corresponds to the initial stress. With the crack strain of the whole, the first step would close cracks
that are now block edges.
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


def initialise_moving_parts(
    now: CrackedBlocks, split: Split, before: Blocks, state: State, stored: Mapping[int, float]
) -> None:
    """Set the initial stress and crack strain of the parts of ``split``, which ``now`` has accepted. ``before``: the
    blocks before the split, in ``state``; ``stored``: energy at the cracks of each, J/m."""
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
    begun = affordable_stress(split, before, state, now.system.compliance, left)
    strain = begun.crack_strain.copy()
    for part in cracked:
        turn, found = float(begun.rotation[part]), answer(part, begun.stress[part])
        limit = now.by_mean_stress.limit(part, now.bodies[part], now.system.compliance[part])
        own = limit.T @ found.crack_strain
        strain[part] = strain_rotation(turn) @ own
        soft = limit.T @ passive(now.bodies[part].compliance(found)) @ limit
        now.response.compliance[part], now.response.offset[part] = crack_response(soft, own, begun.stress[part], turn)
    now.state = replace(begun, crack_strain=strain)


def affordable_stress(
    split: Split, before: Blocks, state: State, compliance: np.ndarray, stored: Mapping[int, float]
) -> State:
    """The state of ``split`` with the stress σ₀ + λ (σ − σ₀) of the parts. ``before``: the blocks before the split, in
    ``state``; ``compliance`` (n_blocks after, 3, 3) of the rock, 1/Pa; ``stored``: J/m at the cracks of blocks before
    the split."""
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
    """The largest λ ≤ 1 with ``square`` λ² + ``linear`` λ ≤ ``energy`` (≥ 0)."""
    if square + linear <= energy:
        return 1.0
    # Without cancellation where linear > 0.
    root = math.sqrt(linear**2 + 4 * square * energy)
    return 2 * energy / (linear + root) if linear > 0 else (root - linear) / (2 * square)
