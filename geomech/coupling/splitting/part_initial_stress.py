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
from types import MappingProxyType

import numpy as np

from ...model import Blocks, State
from ..coupled_state import CrackedBlocks
from ..crack_compliance.added_compliance import crack_response, passive, stress_rotation
from .block_splitting import Split
from .part_deflection import PartStress, with_stress


def initialise_moving_parts(
    now: CrackedBlocks, split: Split, before: Blocks, state: State, stored: Mapping[int, float],
    stresses: Mapping[int, PartStress] = MappingProxyType({}),
) -> None:  # fmt: skip
    """Set the initial stress and crack strain of the parts of ``split``, which ``now`` has accepted. ``before``: the
    blocks before the split, in ``state``; ``stored``: energy at the cracks of each, J/m; ``stresses`` of parts of higher
    order."""
    is_part = np.bincount(split.parent, minlength=before.n_blocks)[split.parent] > 1
    cracked = [part for part in np.flatnonzero(is_part).tolist() if part in now.bodies]
    left = dict(stored)
    for part in cracked:
        parent = int(split.parent[part])
        stress = stresses[part].whole if part in stresses else state.stress[parent]
        left[parent] = left.get(parent, 0.0) - _answer(now, part, stress).crack_energy
    now.state = affordable_stress(split, before, state, now.system.compliance, left)
    taken = _affordable(now, split, stresses, left)
    for part in sorted(set(cracked) | set(taken)):
        _take_stress(now, part, taken.get(part, now.state.stress[part]))


def initialise_parts_at_rest(now: CrackedBlocks, stresses: Mapping[int, PartStress]) -> None:
    """Set the initial stress and crack strain of parts of higher order, in statics: those of the last solution."""
    for part, of in stresses.items():
        _take_stress(now, part, of.solution)


def _answer(now: CrackedBlocks, part: int, stress: np.ndarray):
    """Solution of the cracked ``part`` under its ``stress`` (w,), Pa."""
    now.by_mean_stress.add(part)
    turn, began = float(now.state.rotation[part]), now.history.get(part)
    return now.by_mean_stress.answer(part, now.bodies[part], stress, turn, now.elastic(part), began)


def _take_stress(now: CrackedBlocks, part: int, stress: np.ndarray) -> None:
    """Give ``part`` the ``stress`` (w,), Pa, and its cracks the strain under it."""
    opened = crack_response_under(now, part, stress) if part in now.bodies else None
    if part in now.by_mean_stress.fields or len(stress) > 3:
        assert now.system.deflected is not None
        rock = now.system.deflected.generalised_compliance(part, now.system.compliance[part])
        now.state = with_stress(now.state, now.system.deflected, part, rock, stress, opened)
        return
    strain = now.state.crack_strain.copy()
    strain[part] = opened
    now.state = replace(now.state, crack_strain=strain)


def crack_response_under(now: CrackedBlocks, block: int, stress: np.ndarray) -> np.ndarray:
    """Strain (w,) of the cracks of ``block`` under its ``stress`` (w,), Pa, both on current axes. Sets their response
    there."""
    mean, body, w = now.by_mean_stress, now.bodies[block], len(stress)
    turn, found = float(now.state.rotation[block]), _answer(now, block, stress)
    limit = mean.limit(block, body, now.elastic(block))
    own = limit.T @ mean.crack_strain(block, found)
    soft = limit.T @ passive(mean.compliance(block, body, found), now.elastic(block)) @ limit
    now.response.compliance[block, :w, :w], now.response.offset[block, :w] = crack_response(soft, own, stress, turn)
    return stress_rotation(-turn, w).T @ own


def _affordable(
    now: CrackedBlocks, split: Split, stresses: Mapping[int, PartStress], stored: Mapping[int, float]
) -> dict[int, np.ndarray]:
    """part → stress (3 + m,), Pa, of parts of higher order, as in `affordable_stress`."""
    out: dict[int, np.ndarray] = {}
    deflected = now.system.deflected
    for block in sorted({int(split.parent[part]) for part in stresses}):
        square = linear = 0.0
        parts = [part for part in stresses if split.parent[part] == block]
        for part in parts:
            assert deflected is not None
            rock = deflected.generalised_compliance(part, now.system.compliance[part])
            area, whole = float(deflected.basis.area[part]), stresses[part].whole
            change = stresses[part].solution - whole
            square += 0.5 * area * float(change @ rock @ change)
            linear += area * float(change @ rock @ whole)
        share = _largest(square, linear, max(stored.get(block, 0.0), 0.0))
        out |= {part: of.whole + share * (of.solution - of.whole) for part, of in stresses.items() if part in parts}
    return out


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
