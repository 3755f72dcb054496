"""Bodies that drift in a static run because nothing gives their place: no friction, no support, in one direction.

The closed contacts of a body, a block or the cells of one rock, resist its rigid motion d = (u₀, v₀, r₀ √A) about its centroid
with J d per unit of their stiffness, J = Σ rows of normals, and of tangents where joints have friction or hold. Where
Jᵀ J has no rank, the body is in equilibrium anywhere along that motion, and what is left of the residual of each step moves
it, by F dt²/2M.
"""

from __future__ import annotations

import logging

import numpy as np

from ... import dda
from ...model import OPEN, RESTS
from ..coupled_state import CrackedBlocks
from .mechanism import BALANCED, loads_are_steady

log = logging.getLogger(__name__)

#: Jᵀ J has no rank below this part of its largest eigenvalue: normals that differ by less than 3e-5 rad are parallel.
_NO_RANK = 1e-9

#: Out of balance by more than this part of the forces, a body moves under a force, not by rounding (`Mechanism`).
_IN_BALANCE = 10 * BALANCED

#: A motion whose displacement is below this part of its rotation (times the body's size) is a rotation.
_TURNS = 1e-6


class FreeMotion:
    """Warns once where blocks in equilibrium drift along a motion that nothing resists."""

    def __init__(self) -> None:
        self.reported = False

    def check(self, now: CrackedBlocks, result: dda.StepResult) -> None:
        """After a load step, if it changed no load."""
        time = result.state.time
        if self.reported or not float(result.statistics["unbalanced_ratio"]) <= _IN_BALANCE:
            return
        if not loads_are_steady(now.problem.loads, time - result.dt, time):
            return
        moved = result.dt * result.state.velocity[:, :2]
        size = np.hypot(*moved.T)
        size[now.blocks.fixed] = 0.0
        fastest = int(np.argmax(size))
        whole = float(np.hypot(*(result.state.vertices - now.blocks.vertices).T).max())
        if not size[fastest] > RESTS * whole:
            return
        way = _free_way(now, result, fastest)
        if way is None:
            return
        length = float(np.hypot(*way))
        drift = float(abs(moved[fastest] @ way) / length) if length >= _TURNS else float(size[fastest])
        if not drift > RESTS * whole:
            return
        self.reported = True
        along = "in rotation" if length < _TURNS else "along ({:.3g}, {:.3g})".format(*(way / length))
        log.warning(
            "t = %g s: nothing keeps %s in place %s: its contacts have no friction in that direction, and "
            "it drifts by rounding, %.2g m in this step. Its place there has no meaning: hold a point of it "
            "([[loads.point_motions]]), guide its zone, or give its joints friction",
            result.state.time, now.blocks.names[fastest], along, drift,
        )  # fmt: skip


def _free_way(now: CrackedBlocks, result: dda.StepResult, block: int) -> np.ndarray | None:
    """(2,) displacement of the body of ``block`` in the motion that nothing resists; None: everything is resisted."""
    blocks, loads, laws = now.blocks, now.problem.loads, now.problem.joints
    body = _body_of(now, block)
    held = blocks.fixed.copy()
    if blocks.constrained is not None:
        held |= blocks.constrained.any(axis=1)
    if held[body].any() or loads.bolts or loads.point_motions or loads.block_motions or loads.viscous_boundaries:
        return None
    rows = result.contacts[result.contacts["state"] != OPEN]
    rows = rows[body[rows["block"]] != body[rows["other"]]]
    if not len(rows):
        return None
    holds = np.array([law.friction > 0.0 for law in laws])[rows["law"]] | (rows["bonded"] > 0)
    corners = np.flatnonzero(body[blocks.vertex_block])
    centre = result.state.vertices[corners].mean(axis=0)
    size = float(np.sqrt(blocks.areas()[body].sum()))
    normal, arm = rows["normal"], (rows["point"] - centre) / size
    tangent = np.stack([-normal[:, 1], normal[:, 0]], axis=1)[holds]
    arms = np.concatenate([arm, arm[holds]])
    ways = np.concatenate([normal, tangent])
    jacobian = np.column_stack([ways, arms[:, 0] * ways[:, 1] - arms[:, 1] * ways[:, 0]])
    values, vectors = np.linalg.eigh(jacobian.T @ jacobian)
    return vectors[:2, 0] if values[0] <= _NO_RANK * values[-1] else None


def _body_of(now: CrackedBlocks, block: int) -> np.ndarray:
    """(n_blocks,) bool: ``block`` and the cells that are bonded to it."""
    n, pairs = now.blocks.n_blocks, now.blocks.vertex_block[now.bonds]
    if not len(pairs):
        return np.arange(n) == block
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    joined = coo_array((np.ones(len(pairs)), pairs.T), shape=(n, n))
    number = connected_components(joined, directed=False)[1]
    return number == number[block]
