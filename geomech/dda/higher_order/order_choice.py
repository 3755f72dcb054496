"""The order of each block, found as the run goes: an estimate of what a higher order would take up, and who is raised.

A block of order p is in equilibrium with its loads and contact forces f in its own unknowns only. In those of the orders
p + 1 and p + 2, h, forces are left over, r = f_h − K_hl q_l − inertia. With these forces on it, the block would take up
the work

    W = ½ rᵀ S⁻¹ r,   S = K_hh − K_hl K_ll⁻¹ K_lh,

if it were of order p + 2 (a hierarchical error estimate). Since bases are orthonormalised degree by degree
(`deflection_basis`), that of order p is the beginning of that of order p + 2, and Cholesky's factor of S gives the part
of p + 1 as well. Contacts yield to deflection, so that this is too much, by a hundred times where friction locks uniformly
strained blocks to each other. Of blocks that it would raise, W is therefore found again on a patch: K takes in the springs
of their contacts, and l the six first unknowns of the block and of those that it touches; what these bear from others stays.

A block is raised while W is more than a ``target`` part of the energy E of all blocks whose order is found: what they store
and move with, what their joints store, and what friction has taken of them. So a block that bends while nothing else
happens is raised, and one among hundreds, or that slides on joints by more than it strains, is left.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

import numpy as np

from ...model import AUTO_ORDER, OPEN, STICK, Blocks
from ..kinematics.displacement_matrix import displacement_matrix
from .deflected_blocks import DeflectedBlocks
from .deflection_basis import HIGHEST, n_deflections
from .face_points import FaceContacts

log = logging.getLogger(__name__)

#: Orders above a block's own whose work is estimated: of beams, every other one is at rest by symmetry.
_AHEAD = 2
#: Unknowns of a patch are held by this part of its rock's stiffness, for its matrix to be regular.
_HELD = 1e-9


@dataclass(frozen=True, eq=False)
class _Group:
    """Blocks of one order (n,), how many deflections they have, how many up to the next order; K_hl (n, h, l), and the
    inverse of Cholesky's factor of S (n, h, h)."""

    blocks: np.ndarray
    own: int
    next: int
    shared: np.ndarray
    inverse: np.ndarray

    @classmethod
    def of(cls, trial: DeflectedBlocks, blocks: np.ndarray, order: int) -> _Group:
        own, following, all_ = (int(n_deflections(p)) for p in (order, order + 1, order + _AHEAD))
        matrix = trial.stiffness[blocks][:, :all_, :all_]
        low, shared, high = matrix[:, :own, :own], matrix[:, own:, :own], matrix[:, own:, own:]
        left = high - shared @ np.linalg.solve(low, np.swapaxes(shared, 1, 2)) if own else high
        return cls(blocks, own, following - own, shared, np.linalg.inv(np.linalg.cholesky(left)))

    def most(self, force: np.ndarray, deflection: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n, h) N and (n,) J/m: what is left over of ``force`` (n_blocks, m), less inertia, on blocks with this
        ``deflection`` (n_blocks, m), and the work that the next two orders would take up if contacts did not yield."""
        own, size = self.own, self.own + self.inverse.shape[1]
        left = force[self.blocks, own:size]
        left = left - np.einsum("bhl,bl->bh", self.shared, deflection[self.blocks, :own])
        share = np.einsum("bij,bj->bi", self.inverse, left)
        return left, 0.5 * (share**2).sum(axis=1)


class OrderChoice:
    """The orders of the ``blocks`` of a system, those of `AUTO_ORDER` from 1 upwards until the next two would take up less
    than a ``target`` part of the energy of all such blocks; ``fixed`` (n_blocks,), ``density`` (n_blocks,) kg/m³, ``elastic``
    and ``compliance`` (n_blocks, 3, 3), Pa and 1/Pa, of the undeformed blocks.

    ``first`` (n_blocks,) are the orders that a run begins with, ``judged`` counts estimates."""

    def __init__(
        self, blocks: Blocks, fixed: np.ndarray, density: np.ndarray, elastic: np.ndarray, compliance: np.ndarray,
        target: float,
    ) -> None:  # fmt: skip
        self.blocks, self.target = blocks, target
        self.found = np.zeros(len(fixed), bool) if blocks.order is None else (blocks.order == AUTO_ORDER) & ~fixed
        given = np.ones(len(fixed), int) if blocks.order is None else blocks.order
        self.first = np.where(fixed | self.found, 1, given).astype(np.int64)
        self._fixed, self._density, self._elastic, self._compliance = fixed, density, elastic, compliance
        self._trial: DeflectedBlocks | None = None
        self._groups: list[_Group] = []
        self._reported: set[int] = set()
        self.judged = 0

    def deflected(self, order: np.ndarray) -> DeflectedBlocks | None:
        """The blocks with these orders (n_blocks,); None where all are of the first and none are cells."""
        if not (order > 1).any() and self.blocks.glued is None:
            return None
        return DeflectedBlocks(self.blocks, self._fixed, self._density, self._elastic, order)

    def raised(self, order: np.ndarray, deflected: DeflectedBlocks | None, attempt) -> np.ndarray | None:
        """(n_blocks,) the orders with which a step is to be done again that blocks of these ``order`` (n_blocks,), the
        ``deflected`` ones if any are, have ``attempt``-ed; None where they are as high as is asked for, or can be."""
        energy, held = self._energy(attempt), None
        if deflected is not None:
            ended = attempt.deflection + attempt.bent_by
            held = deflected.padded(ended)
            energy += 0.5 * float((held * deflected.stiffness_times(ended))[self.found].sum())
        if not energy > 0.0:
            return None
        self.judged += 1
        trial = self._trial_of(order)
        faces = _FaceForces.of(trial, attempt)
        force, deflection = self._forces(trial, faces, attempt), np.zeros_like(trial.basis.coupling[:, 0])
        if held is not None:
            width = min(held.shape[1], deflection.shape[1])
            deflection[self.found, :width] = held[self.found, :width]
        out, limit = order.copy(), self.target * energy
        for group in self._groups:
            left, most = group.most(force, deflection)
            for k in np.flatnonzero(most > limit).tolist():
                b = int(group.blocks[k])
                first, both = faces.work(trial, b, group, left[k])
                if both <= limit:
                    continue
                out[b] = min(order[b] + (2 if both - first > limit else 1), HIGHEST)
                if order[b] == HIGHEST:
                    self._report(b, both / energy, attempt.time)
        if (out == order).all():
            return None
        names = [f"{self.blocks.names[b]!r} to {out[b]}" for b in np.flatnonzero(out > order).tolist()]
        log.info(
            "t = %g s: orders are raised, of %s%s", attempt.time, ", ".join(names[:5]),
            f" and {len(names) - 5} more" if len(names) > 5 else "",
        )  # fmt: skip
        return out

    def _trial_of(self, order: np.ndarray) -> DeflectedBlocks:
        """The blocks whose order is found with those above it that are estimated."""
        asked = np.where(self.found, order + _AHEAD, 1)
        if self._trial is None or not np.array_equal(self._trial.order, asked):
            self._trial = DeflectedBlocks(self.blocks, self._fixed, self._density, self._elastic, asked)
            self._groups = [
                _Group.of(self._trial, np.flatnonzero(self.found & (order == p)), p)
                for p in np.unique(order[self.found]).tolist()
            ]
        return self._trial

    def _forces(self, trial: DeflectedBlocks, faces: _FaceForces, attempt) -> np.ndarray:
        """(n_blocks, m) N: loads and contact forces on the deflections of ``trial``, less inertia."""
        angle, density = faces.angle, attempt.density
        out = trial.loads(attempt.points, attempt.edges, attempt.midpoint.vertices, angle)
        out -= density[:, None] * np.einsum("bej,be->bj", trial.coupling(angle), attempt.acceleration[:, 3:])
        spun = density * attempt.carried[:, 2] ** 2
        out += spun[:, None] * (trial.basis.coupling[:, 0] + trial.basis.coupling[:, 1])
        force = np.einsum("nw,nwa->na", faces.force, faces.ways)
        for owner, at, sign in zip(faces.owners, faces.points, (1.0, -1.0), strict=True):
            some = self.found[owner] & force.any(axis=1)
            matrix = trial.directions(at[some], owner[some], angle)
            np.add.at(out, owner[some], sign * np.einsum("na,naj->nj", force[some], matrix))
        return out

    def _energy(self, attempt) -> float:
        """J/m: what blocks whose order is found store and move with, and what their contacts store and have taken."""
        found, settled, some = attempt.found, attempt.settled, self.found
        stress, velocity, moments = attempt.new_stress[some], attempt.velocity[some], attempt.moments[some]
        mass = attempt.density[some] * moments[:, 0]
        energy = 0.5 * float(moments[:, 0] @ np.einsum("ba,bac,bc->b", stress, self._compliance[some], stress))
        energy += 0.5 * float(mass @ (velocity[:, :2] ** 2).sum(axis=1))
        energy += 0.5 * float(attempt.density[some] @ (moments[:, 3:5].sum(axis=1) * velocity[:, 2] ** 2))
        closed = (settled.state != OPEN) & (some[found.block] | some[found.other])
        normal, shear = settled.normal_force[closed], np.abs(settled.shear_force[closed])
        springs, slid = settled.springs, found.wear[closed] + np.abs(settled.slip[closed])
        energy += 0.5 * float((normal**2 / springs.normal[closed]).sum())
        return energy + float((shear * (0.5 * shear / springs.shear[closed] + slid)).sum())

    def _report(self, block: int, left: float, time: float) -> None:
        """Log a warning, once, that names a ``block`` whose highest order leaves this part of the work."""
        if block in self._reported:
            return
        self._reported.add(block)
        log.warning(
            "t = %g s: %r has order %d, the highest, and more would take up %.2g of the energy (dda.order_target = %g): %s. "
            "Draw it as several blocks, or allow a larger part",
            time, self.blocks.names[block], HIGHEST, left, self.target, self._why(block),
        )  # fmt: skip

    def _why(self, block: int) -> str:
        """What makes polynomials converge slowly in ``block``."""
        own = np.flatnonzero(self.blocks.vertex_block == block)
        at, following = self.blocks.vertices, self.blocks.next_vertex
        before, after = at[own] - at[self.blocks.previous_vertex[own]], at[following[own]] - at[own]
        turns = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        inward = turns < -1e-6 * np.hypot(*before.T) * np.hypot(*after.T)
        if not inward.any():
            return "its stress is concentrated at corners or ends of contacts"
        x, y = at[own[inward]][0]
        return f"stress is singular at its re-entrant corner ({x:.4g}, {y:.4g})"


@dataclass(frozen=True, eq=False)
class _FaceForces:
    """The contacts (n,) of an attempt as points along faces.

    owners   (n,) twice            blocks of the vertices and of the edges
    ways     (n, 2, 2)             across and along the face
    force    (n, 2)                N, normal and shear
    springs  (n, 2)                Pa, of those that hold; zeros of others
    points   (n, 2) twice          undeformed, of both blocks
    rigid    (n, 2, 6) twice       motion across and along per unit of the six first unknowns of both blocks
    angle, area, fixed (n_blocks,) rotation, area and which blocks do not move
    """

    owners: tuple[np.ndarray, np.ndarray]
    ways: np.ndarray
    force: np.ndarray
    springs: np.ndarray
    points: tuple[np.ndarray, np.ndarray]
    rigid: tuple[np.ndarray, np.ndarray]
    angle: np.ndarray
    area: np.ndarray
    fixed: np.ndarray

    @classmethod
    def of(cls, trial: DeflectedBlocks, attempt) -> _FaceForces:
        """The contacts of an ``attempt``, those at corners spread along faces."""
        found, settled, laws = attempt.found, attempt.settled, attempt.system.finder
        if isinstance(found, FaceContacts):
            normal, shear, state = settled.normal_force, settled.shear_force, settled.state
        else:
            normal, shear = settled.normal_force, settled.shear_force
            if found.points is not None:
                normal, shear = found.points.at_corners(normal), found.points.at_corners(shear)
                found = found.lumped
            corners = replace(found, normal=normal, shear=shear, state=settled.state, points=None, lumped=None)
            by_length = laws.stiff_laws[found.law], laws.stiff_along_laws[found.law]
            found = FaceContacts.along_faces(corners, trial.order, None, by_length)
            normal, shear, state = found.normal, found.shear, found.state
        owners, midpoint = (found.block, found.other), attempt.midpoint
        geometry = midpoint.contacts(found.geometry, *owners, attempt.along_edges(found))
        across = geometry[:, 1:3]
        ways = np.stack([across, np.stack([-across[:, 1], across[:, 0]], axis=1)], axis=1)
        rigid = tuple(
            np.einsum("nwa,naj->nwj", ways, displacement_matrix(geometry[:, 5:7], midpoint.centroid[owner]))
            for owner in owners
        )
        return cls(
            owners, ways, np.stack([normal, shear], axis=1),
            np.stack(
                [
                    np.where(state != OPEN, found.springs.normal, 0.0),
                    np.where(state == STICK, found.springs.shear, 0.0),
                ],
                axis=1,
            ),
            trial.touching(found, attempt.vertices), rigid, attempt.state.rotation + attempt.turn,
            attempt.moments[:, 0], attempt.system.fixed,
        )  # fmt: skip

    def work(self, trial: DeflectedBlocks, block: int, group: _Group, left: np.ndarray) -> tuple[float, float]:
        """J/m that the next order of a ``block`` of the ``group`` would take up, and the next two, of the forces ``left``
        (h,) on a patch, with its contacts and those that it touches."""
        own, m = group.own, group.own + len(left)
        holds = self.springs.any(axis=1)
        sides = [np.flatnonzero((owner == block) & holds) for owner in self.owners]
        others = [self.owners[1 - side][rows] for side, rows in enumerate(sides)]
        near = np.unique(np.concatenate(others))
        near = near[~self.fixed[near]]
        # The unknowns: deflection, those estimated last; then six of the block and six of each that it touches.
        size = m + 6 + 6 * len(near)
        matrix = np.zeros((size, size))
        matrix[:m, :m] = trial.stiffness[block, :m, :m]
        for k, b in enumerate((block, *near.tolist())):
            at, stiff = m + 6 * k + np.arange(6), trial.elastic[b]
            matrix[np.ix_(at[3:], at[3:])] = self.area[b] * stiff
            # Nothing holds a patch that is free as a whole, and nothing pushes it.
            matrix[at, at] += _HELD * stiff[0, 0] * np.where(np.arange(6) < 2, 1.0, self.area[b])
        for side, rows, other in zip((0, 1), sides, others, strict=True):
            motion = np.zeros((len(rows), 2, size))
            bends = trial.directions(self.points[side][rows], np.full(len(rows), block), self.angle)[..., :m]
            motion[..., :m] = np.einsum("nwa,naj->nwj", self.ways[rows], bends)
            motion[..., m : m + 6] = self.rigid[side][rows]
            for c in np.flatnonzero(~self.fixed[other]).tolist():
                first = m + 6 + 6 * int(np.searchsorted(near, other[c]))
                motion[c, :, first : first + 6] -= self.rigid[1 - side][rows[c]]
            matrix += np.einsum("nwi,nw,nwj->ij", motion, self.springs[rows], motion, optimize=True)
        high = np.arange(own, m)
        low = np.concatenate([np.arange(own), np.arange(m, size)])
        shared, rest = matrix[np.ix_(high, low)], matrix[np.ix_(low, low)]
        factor = np.linalg.cholesky(matrix[np.ix_(high, high)] - shared @ np.linalg.solve(rest, shared.T))
        share = np.linalg.solve(factor, left)
        return 0.5 * float(share[: group.next] @ share[: group.next]), 0.5 * float(share @ share)


def relaid(deflection: np.ndarray, before: np.ndarray, order: np.ndarray) -> np.ndarray:
    """(k, 2) the ``deflection`` of blocks whose orders were ``before`` (n_blocks,) and are ``order`` now, no lower: what is
    new is at rest."""
    old, new = n_deflections(before), n_deflections(order)
    start = np.cumsum(new) - new
    kept = np.arange(int(old.sum())) - np.repeat(np.cumsum(old) - old, old) + np.repeat(start, old)
    out = np.zeros((int(new.sum()), 2))
    out[kept] = deflection
    return out
