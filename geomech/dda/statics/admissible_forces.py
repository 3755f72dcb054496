"""Upper bound of the factor of safety: the largest F at which any contact forces at all can balance the loads.

Forces N and S of the contacts are statically admissible at the factor F if every block is in equilibrium and

    N ≥ 0,    |S| ≤ (c ℓ + N tan φ)/F.

The smallest sum of unbalanced forces, U(F), over all such contact forces is a linear programme (Livesley 1978, Int. J.
Numer. Methods Eng. 12, 1853-1871). U is zero up to the largest F with admissible forces; beyond it, the dual solution
gives dU/d(1/F), with which Newton's method finds that F from above in a few programmes. No equilibrium exists above it
(static theorem). With friction that dilates by less than its angle, blocks may fail below it (Drescher & Detournay
1993, Géotechnique 43, 443-456): they can be wedged against one another in many ways, of which the deformation selects
one. The search for a factor starts at this bound and follows the deformation, so its result may be lower; the
difference is a measure of how much depends on the wedging.

The loads are all forces that contact forces balance in an equilibrium: weight, water, anchors. Joints with tensile
strength are not covered: a bent face carries less than the sum of the strengths at its ends.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...model import GROUND, Bolt, JointLaw, State
from ..kinematics.simplex_integration import block_moments
from ..open_close.contact_set import ContactSet
from ..open_close.interior_point.linear_programme import smallest
from ..results import contact_resultants
from ..system import BlockSystem

log = logging.getLogger(__name__)

#: Largest factor, and smallest inverse, of searches.
FARTHEST = 64.0
#: Tolerance of equilibrium, relative to the largest load on a block.
_BALANCED = 1e-6
#: Relative change of F below which Newton's method ends.
_PRECISE = 1e-4
#: Unbalanced forces, relative to the largest load on a block, that may remain at any strength: those of slivers, which have no
#: contacts in the directions of their loads.
_SLIVERS = 1e-2


@dataclass(frozen=True, eq=False)
class AdmissibleForces:
    """The linear programme of the contacts (n,) of blocks at rest.

    matrix    (3 m, 2 n)  sparse: forces x, y and moments over √area on the m free blocks, by N and S of each contact
    loads     (3 m,)      the resultants that balance the loads, in the same rows, relative to the largest load
    friction  (n,)        tan φ
    cohesion  (n,)        c ℓ of the contact's part of its face, in units of the largest load; 0 once it is lost
    reduced   (n,) bool   whether the strength of the contact is divided by the factor
    bolts     (3 m, k)    sparse: forces and moments by the pull of each bolt
    pull      (k, 2)      smallest and largest pull of the bolts in addition to the loads, in units of the largest load
    """

    matrix: Any
    loads: np.ndarray
    friction: np.ndarray
    cohesion: np.ndarray
    reduced: np.ndarray
    bolts: Any
    pull: np.ndarray

    @classmethod
    def of(
        cls, system: BlockSystem, state: State, rest: State, joints: Sequence[JointLaw], chosen: Collection[str],
        bolts: Sequence[Bolt] = (),
    ) -> AdmissibleForces | None:  # fmt: skip
        """The programme for the blocks of ``system``, in equilibrium in ``state``, with all contacts that touch there
        or in the state ``rest``. ``joints``: laws with full strength; the strength of those in ``chosen`` is divided.
        ``bolts`` may pull with any force up to yield; if not given, they keep their forces in ``state``. None if the
        programme does not apply: rough or softening joints, and joints with tensile strength."""
        if any(_varies(law) or law.tensile_strength > 0.0 for law in joints):
            return None
        from scipy import sparse

        rows_of = _Rows.of(system, state)
        loads = contact_resultants(state.contacts, system.blocks.n_blocks, rows_of.centre)
        loads[:, 2] /= rows_of.size
        loads = loads[rows_of.number >= 0].ravel()
        unit = float(np.abs(loads).max(initial=0.0))
        near = system.contacts_near(state)
        rows = _touching(near, system.contacts_near(rest), len(system.blocks.vertices))
        if not (len(rows) and unit > 0.0):
            return None
        normal, at, law = near.geometry[rows, 1:3], near.geometry[rows, 5:7], near.law[rows]
        pair, ends = np.stack([near.block[rows], near.other[rows]], axis=1), np.stack([at, at], axis=1)
        along = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
        # Faces open by less than the precision of coordinates count with their cohesion.
        length = near.geometry[rows, 4] * ((near.bonded > 0) | (near.gap_before <= near.precision))[rows]

        def of_laws(name: str) -> np.ndarray:
            return np.array([getattr(each, name) for each in joints], float)[law]

        pulls, least_and_most = _pulls(rows_of, bolts, state)
        return cls(
            sparse.hstack([rows_of.by(normal, pair, ends), rows_of.by(along, pair, ends)], format="csc"),
            loads / unit, of_laws("friction"), of_laws("cohesion") * length / unit,
            np.array([each.name in chosen for each in joints])[law], pulls, least_and_most / unit,
        )  # fmt: skip

    def unbalanced(self, factor: float) -> tuple[float, float]:
        """U at the ``factor``, in units of the largest load, and dU/d(1/F). The unknowns are forces along both edges of
        the friction cone of each contact, shear carried by cohesion, bolt forces, and the unbalanced remainder. Raises
        `Unsolved`."""
        from scipy import sparse

        share = np.where(self.reduced, 1.0 / factor, 1.0)
        n, m = len(share), len(self.loads)
        push, shear = self.matrix[:, :n], self.matrix[:, n:]
        inclined = shear @ sparse.diags(self.friction * share)
        bonded = np.flatnonzero(self.cohesion > 0.0)
        rest = sparse.identity(m)
        matrix = sparse.hstack(
            [push + inclined, push - inclined, shear[:, bonded], self.bolts, rest, -rest], format="csc"
        )
        hold = (self.cohesion * share)[bonded]
        low = np.concatenate([np.zeros(2 * n), -hold, self.pull[:, 0], np.zeros(2 * m)])
        high = np.concatenate([np.full(2 * n, np.inf), hold, self.pull[:, 1], np.full(2 * m, np.inf)])
        cost = np.append(np.zeros(len(low) - 2 * m), np.ones(2 * m))
        found = smallest(cost, matrix, self.loads - matrix @ low, high - low)
        friction = self.friction * self.reduced * (found.unknowns[:n] - found.unknowns[n : 2 * n])
        slope = -float(found.of_equations @ (shear @ friction))
        bond_rows, own = slice(2 * n, 2 * n + len(bonded)), (self.cohesion * self.reduced)[bonded]
        slope += float(own @ (found.of_bounds - found.of_signs)[bond_rows])
        return found.cost, slope

    def balance(self, factor: float) -> bool:
        """Whether admissible forces exist at the ``factor``. Raises `Unsolved`."""
        return self.unbalanced(factor)[0] <= _BALANCED

    def largest_factor(self, first: float = 1.0, stride: float = 1.0, precise: float = _PRECISE) -> float:
        """The largest factor with admissible forces to the relative accuracy ``precise``, searched from ``first``, and
        upwards from there in steps of the relative length ``stride`` and four times as long each; 0 if there are none
        down to 1/64, inf if there are some at 64. Slivers that no strength holds do not count. Raises `Unsolved`."""
        low, high, factor, step, floor = 0.0, math.inf, first, precise, _BALANCED
        above: tuple[float, float, float] | None = None  # the last factor with a slope, its U and the slope
        while True:
            left, slope = self.unbalanced(factor)
            if floor == _BALANCED < left <= _SLIVERS and -slope * (FARTHEST - 1.0) / factor < left:
                # No strength balances the rest: the bound is that of all other blocks.
                log.info("no strength of the joints balances the rest: %.2g of the largest load", left)
                floor, low = left + _BALANCED, factor
                if above is not None:
                    factor, left, slope = above
            if left <= floor:
                low = factor
                if low >= FARTHEST:
                    return math.inf
                if math.isinf(high):
                    factor, stride = low * (1.0 + stride), 4.0 * stride
                    continue
                # An admissible iterate of Newton's method is only slightly below the bound.
                factor, step = min(low * (1.0 + step), 0.5 * (low + high)), 4.0 * step
                continue
            high, above = factor, (factor, left, slope)
            if high <= 1.0 / FARTHEST:
                return 0.0
            least = max(low, 1.0 / FARTHEST)
            factor = max(1.0 / (1.0 / high - (left - floor) / slope), least) if slope < 0.0 else low
            if high - factor <= precise * high or high - low <= 2.0 * precise * high:
                return factor
            factor = factor if factor > low else 0.5 * (low + high)


@dataclass(frozen=True, eq=False)
class _Rows:
    """Equilibrium equations of the free blocks: ``number`` (n_blocks,), −1 for others; ``centre`` (n_blocks, 2) m and
    ``size`` √area (n_blocks,) m."""

    number: np.ndarray
    centre: np.ndarray
    size: np.ndarray

    @classmethod
    def of(cls, system: BlockSystem, state: State) -> _Rows:
        blocks = system.blocks
        moments = block_moments(state.vertices, blocks.next_vertex, blocks.vertex_start)
        free = ~system.fixed if blocks.constrained is None else ~(system.fixed | blocks.constrained.any(axis=1))
        return cls(np.where(free, np.cumsum(free) - 1, -1), moments[:, 1:3], np.sqrt(moments[:, 0]))

    def by(self, ways: np.ndarray, pair: np.ndarray, points: np.ndarray):
        """Sparse (3 m, n): forces, and moments over √area, of unit forces along ``ways`` (n, 2) on the first block of
        each ``pair`` (n, 2) and opposite ones on the second (GROUND: none), each at its own point of ``points`` (n, 2,
        2) m."""
        from scipy import sparse

        entries = []
        for side, sign in enumerate((1.0, -1.0)):
            own = np.flatnonzero((pair[:, side] != GROUND) & (self.number[pair[:, side]] >= 0))
            on, way = pair[own, side], ways[own]
            arm = (points[own, side] - self.centre[on]) / self.size[on, None]
            moment = arm[:, 0] * way[:, 1] - arm[:, 1] * way[:, 0]
            for axis, part in enumerate((way[:, 0], way[:, 1], moment)):
                entries.append((3 * self.number[on] + axis, own, sign * part))
        row, column, value = (np.concatenate(parts) for parts in zip(*entries, strict=True))
        return sparse.csc_matrix((value, (row, column)), (3 * (int(self.number.max()) + 1), len(ways)))


def _pulls(rows_of: _Rows, bolts: Sequence[Bolt], state: State) -> tuple[Any, np.ndarray]:
    """Sparse (3 m, k) columns of the ``bolts`` that act in ``state``, and the smallest and largest change (k, 2) N/m of
    each bolt's force from its value there."""
    acting = [
        (bolt, row) for bolt, row in zip(bolts, state.bolts, strict=False) if row["installed"] and not row["broken"]
    ]
    ends = np.array([[bolt.start, bolt.end] for bolt, _ in acting], float).reshape(-1, 2, 2)
    axis = ends[:, 1] - ends[:, 0]
    pair = np.array([(bolt.block, bolt.other) for bolt, _ in acting], int).reshape(-1, 2)
    force = np.array([(row["force"], bolt.yield_force) for bolt, row in acting], float).reshape(-1, 2)
    pulls = rows_of.by(axis / np.hypot(axis[:, 0], axis[:, 1])[:, None], pair, ends)
    return pulls, np.stack([-force[:, 0], force[:, 1] - force[:, 0]], axis=1)


def _touching(near: ContactSet, drawn: ContactSet, n_vertices: int) -> np.ndarray:
    """Rows of the contacts ``near`` that touch now or in the initial geometry, ``drawn``."""
    drawn_on = (drawn.vertex * n_vertices + drawn.edge)[drawn.gap_before <= drawn.precision]
    return np.flatnonzero((near.gap_before <= near.precision) | np.isin(near.vertex * n_vertices + near.edge, drawn_on))


def _varies(law: JointLaw) -> bool:
    return (
        law.roughness is not None
        or law.residual_friction_angle is not None
        or law.softening_slip > 0
        or law.residual_cohesion not in (0.0, law.cohesion)
    )
