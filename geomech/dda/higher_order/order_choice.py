"""Adaptive order of blocks: an estimate of the work that a higher order would take up, and the choice of new orders.

A block of order p is in equilibrium with its loads and contact forces f in its own unknowns l only. In those of orders
p + 1 and p + 2, h, the residual r = f_h − K_hl q_l − inertia remains. Under it the block, if it were of order p + 2,
would take up the work

    W = ½ rᵀ S⁻¹ r,   S = K_hh − K_hl K_ll⁻¹ K_lh

(a hierarchical error estimate). Bases are orthonormalised degree by degree (`deflection_basis`), so that the basis of
order p is the first part of that of order p + 2, and the Cholesky factor of S gives the part of p + 1 as well. Contacts
yield to deflection, so that W is too large, by a factor of a hundred where friction locks uniformly strained blocks to
each other. For blocks that it would raise, W is therefore computed again on a patch: K includes the springs of their
contacts, and l the first six unknowns of the block and of its neighbours; the neighbours' other contact forces stay. In a
slope the neighbours then move freely, although their own neighbours hold them: W is still two or three times too large.
It bounds that of the whole system, with the six unknowns of all blocks (`_AllBlocks`), which decides.

Cracks soften the block, and their opening and slip deflect it by a part q_c that a block of order p cannot represent
(`CracksInBlock`). Without contacts the block of order p + 2 would take that deflection without any stress, and without
any effect on its lower unknowns; contacts oppose it. With the stiffness K of the cracked block and k of the springs it
moves by x = (K + k)⁻¹ (r + K q_c), and

    W = ½ xᵀ k x + ½ (x − q_c)ᵀ K (x − q_c)

is the energy of the changes of contact forces and of stress: the former W without q_c.

A block is raised while W exceeds a ``target`` part of the energy E of all blocks with automatic order: their elastic
and kinetic energy, that stored in their joints and cracks, and the loss by friction. A block that bends while nothing else happens
is therefore raised; one among hundreds, or one that slides by more than it is strained, is not.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...model import AUTO_ORDER, HIGHEST_ORDER, OPEN, SLIP, STICK, Blocks
from ..kinematics.displacement_matrix import displacement_matrix
from ..kinematics.tolerances import NOTABLE
from .deflected_blocks import DeflectedBlocks
from .deflection_basis import n_deflections
from .face_points import FaceContacts

if TYPE_CHECKING:
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import SuperLU

log = logging.getLogger(__name__)

#: Orders above a block's own whose work is estimated: in beams every other order is zero by symmetry.
_ORDERS_ABOVE = 2
#: The work of blocks whose cracks soften them by the factor 1 + s under uniform stress is estimated on a patch where 1 + 4 s
#: times that of whole rock exceeds the limit: an edge crack softens a block more in bending.
_SOFTER_IN_BENDING = 4.0
#: Increase of the forces on a block, or decrease of the energy, since earlier estimates by which these may be out of date:
#: the work grows with the square of the forces. And number of steps after which they are repeated in any case.
_MORE, _REPEATED = 1.1, 10
#: Unknowns of blocks are constrained by springs of this part of the rock's stiffness, to make matrices regular: small beside
#: the rock, and so large that blocks which move freely as a group are known to 1e-10 of contacts that are a hundred times stiffer.
_REGULARISATION = 1e-6


@dataclass(frozen=True, eq=False)
class CracksInBlock:
    """The cracks of one block with an order of an estimate, with m unknowns of deflection.

    opened   (m,) m: deflection by their present opening and slip
    stored   J/m around them
    softer   largest compliance that they add, over that of the rock, under uniform stress
    tangent  returns the stiffness (3 + m, 3 + m), Pa, of mean strain on current axes and deflection over √A
             (`crack_softening`)
    """

    opened: np.ndarray
    stored: float
    softer: float
    tangent: Callable[[], np.ndarray]

    def beyond(self, stiffness: np.ndarray, own: int, n: int) -> np.ndarray:
        """(n,) m: the deflection that the first ``n`` unknowns represent, less that of the first ``own``; both have the
        forces K q of all, K the ``stiffness`` (m, m)."""
        force = stiffness @ self.opened
        out = np.linalg.solve(stiffness[:n, :n], force[:n])
        if own:
            out[:own] -= np.linalg.solve(stiffness[:own, :own], force[:own])
        return out


#: The cracks (block →) of blocks with automatic order, with the orders of a trial.
CracksAbove = Callable[[DeflectedBlocks], dict[int, CracksInBlock]]


@dataclass(frozen=True, eq=False)
class _Group:
    """Blocks of one order (n,).

    own, next   number of deflections, and number up to the next order
    shared      (n, h, l) K_hl
    inverse     (n, h, h) inverse Cholesky factor of S
    """

    blocks: np.ndarray
    own: int
    next: int
    shared: np.ndarray
    inverse: np.ndarray

    @classmethod
    def of(cls, trial: DeflectedBlocks, blocks: np.ndarray, order: int) -> _Group:
        own, following, all_ = (int(n_deflections(p)) for p in (order, order + 1, order + _ORDERS_ABOVE))
        matrix = trial.stiffness[blocks][:, :all_, :all_]
        low, shared, high = matrix[:, :own, :own], matrix[:, own:, :own], matrix[:, own:, own:]
        left = high - shared @ np.linalg.solve(low, np.swapaxes(shared, 1, 2)) if own else high
        return cls(blocks, own, following - own, shared, np.linalg.inv(np.linalg.cholesky(left)))

    def most(self, force: np.ndarray, deflection: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n, h) N and (n,) J/m: residual forces, and the work that the next two orders would take up in rigid
        contacts.

        ``force`` (n_blocks, m), less inertia, acts on blocks with this ``deflection`` (n_blocks, m).
        """
        own, size = self.own, self.own + self.inverse.shape[1]
        left = force[self.blocks, own:size]
        left = left - np.einsum("bhl,bl->bh", self.shared, deflection[self.blocks, :own])
        share = np.einsum("bij,bj->bi", self.inverse, left)
        return left, 0.5 * (share**2).sum(axis=1)

    def with_cracks(self, most: np.ndarray, trial: DeflectedBlocks, cracks: dict[int, CracksInBlock]) -> np.ndarray:
        """(n,) J/m: the work ``most`` (n,) of whole rock, where blocks have ``cracks`` with an allowance for these: they
        soften the rock, and rigid contacts take all of the deflection by their opening."""
        if not cracks:
            return most
        out = most.copy()
        for k, b in enumerate(self.blocks.tolist()):
            if b in cracks:
                own, m = cracks[b], self.own + self.inverse.shape[1]
                stiffness = trial.stiffness[b, :m, :m]
                beyond = own.beyond(stiffness, self.own, m)
                opened = 0.5 * float(beyond @ stiffness @ beyond)
                softer = np.sqrt((1.0 + _SOFTER_IN_BENDING * own.softer) * most[k])
                out[k] = (softer + np.sqrt(opened)) ** 2
        return out


@dataclass(eq=False)
class _Borne:
    """The largest ``forces`` (n_blocks,), N, on blocks in estimates so far, their least ``energy``, J/m, and number of
    ``steps`` since the last one."""

    forces: np.ndarray
    energy: float
    steps: int = 0


class OrderChoice:
    """Orders of the ``blocks`` of a system.

    Blocks with `AUTO_ORDER` are raised from 1 until the next two orders would take up less than a ``target`` part of
    the energy of all such blocks. ``fixed`` (n_blocks,), ``elastic`` and ``compliance``
    (n_blocks, 3, 3), Pa and 1/Pa, are those of the undeformed blocks. ``first`` (n_blocks,) are the orders at the start
    of a run, ``judged`` counts estimates.
    """

    def __init__(
        self, blocks: Blocks, fixed: np.ndarray, elastic: np.ndarray, compliance: np.ndarray, target: float,
        points_always: bool = False,
    ) -> None:  # fmt: skip
        self.blocks, self.target, self._points_always = blocks, target, points_always
        self.found = np.zeros(len(fixed), bool) if blocks.order is None else (blocks.order == AUTO_ORDER) & ~fixed
        given = np.ones(len(fixed), int) if blocks.order is None else blocks.order
        self.first = np.where(fixed | self.found, 1, given).astype(np.int64)
        self._fixed, self._elastic, self._compliance = fixed, elastic, compliance
        self._trial: DeflectedBlocks | None = None
        self._groups: list[_Group] = []
        self._reported: set[int] = set()
        self._borne: _Borne | None = None
        self.judged = 0

    def deflected(self, order: np.ndarray) -> DeflectedBlocks | None:
        """The blocks with these orders (n_blocks,); None where all are of first order, none are cells and their faces need
        no points."""
        if not (order > 1).any() and self.blocks.glued is None and not self._points_always:
            return None
        return DeflectedBlocks(self.blocks, self._fixed, self._elastic, order)

    def known(self, attempt) -> bool:
        """Whether estimates of earlier steps still hold in that of ``attempt``: no block bears much more than it did, and
        the energy with which its work is compared has not become much less."""
        found, settled = attempt.found, attempt.settled
        forces, push = np.zeros(len(self.found)), np.hypot(settled.normal_force, settled.shear_force)
        for owner in (found.block, found.other):
            np.add.at(forces, owner, push)
        for rows in (attempt.edges, attempt.points):
            np.add.at(forces, rows["block"], np.hypot(*rows["force"].T))
        forces, energy, before = forces[self.found], self._energy(attempt), self._borne
        if before is None:
            self._borne = _Borne(forces, energy)
            return False
        least = NOTABLE * before.forces.max(initial=0.0)
        same = (forces <= _MORE * np.maximum(before.forces, least)).all() and _MORE * energy >= before.energy
        before.steps += 1
        if same and before.steps < _REPEATED:
            return True
        self._borne = _Borne(np.maximum(forces, before.forces), energy)
        return False

    def raised(
        self, order: np.ndarray, deflected: DeflectedBlocks | None, attempt, cracks: CracksAbove | None = None
    ) -> np.ndarray | None:  # fmt: skip
        """(n_blocks,) orders with which a step must be repeated; None where no block is to be, or can be, raised.

        The step ``attempt`` was made with blocks of these ``order`` (n_blocks,), the ``deflected`` ones if there are
        any. ``cracks`` returns those of blocks that have any.
        """
        energy, before_step = self._energy(attempt), None
        if deflected is not None:
            # What cracks have opened is not strained.
            ended = attempt.strained + attempt.bent_by - attempt.opened_by
            before_step = deflected.padded(ended)
            energy += 0.5 * float((before_step * deflected.stiffness_times(ended))[self.found].sum())
        if not energy > 0.0:
            return None
        self.judged += 1
        trial = self._trial_of(order)
        faces, cracked = _FaceForces.of(trial, attempt), {} if cracks is None else cracks(trial)
        force, deflection = self._forces(trial, faces, attempt), np.zeros_like(trial.basis.coupling[:, 0])
        every: _AllBlocks | None = None
        if before_step is not None:
            width = min(before_step.shape[1], deflection.shape[1])
            deflection[self.found, :width] = before_step[self.found, :width]
        out, limit = order.copy(), self.target * (energy + sum(of.stored for of in cracked.values()))
        for group in self._groups:
            left, most = group.most(force, deflection)
            for k in np.flatnonzero(group.with_cracks(most, trial, cracked) > limit).tolist():
                b = int(group.blocks[k])
                first, both = faces.work(trial, b, group, left[k], cracked.get(b))
                if both > limit:
                    every = every or _AllBlocks.of(faces, trial)
                    first, both = faces.work(trial, b, group, left[k], cracked.get(b), every)
                if both <= limit:
                    continue
                out[b] = min(order[b] + (2 if both - first > limit else 1), HIGHEST_ORDER)
                if order[b] == HIGHEST_ORDER:
                    self._report(b, both / limit * self.target, attempt.time)
        if (out == order).all():
            return None
        names = [f"{self.blocks.names[b]!r} to {out[b]}" for b in np.flatnonzero(out > order).tolist()]
        log.info(
            "t = %g s: orders are raised: %s%s", attempt.time, ", ".join(names[:5]),
            f" and {len(names) - 5} more" if len(names) > 5 else "",
        )  # fmt: skip
        return out

    def _trial_of(self, order: np.ndarray) -> DeflectedBlocks:
        """The blocks with automatic order, with the higher orders that are estimated."""
        order_above = np.where(self.found, order + _ORDERS_ABOVE, 1)
        if self._trial is None or not np.array_equal(self._trial.order, order_above):
            self._trial = DeflectedBlocks(self.blocks, self._fixed, self._elastic, order_above)
            self._groups = [
                _Group.of(self._trial, np.flatnonzero(self.found & (order == p)), p)
                for p in np.unique(order[self.found]).tolist()
            ]
        return self._trial

    def _forces(self, trial: DeflectedBlocks, faces: _FaceForces, attempt) -> np.ndarray:
        """(n_blocks, m) N: loads and contact forces on the deflections of ``trial``, less inertia."""
        angle, density = faces.angle, attempt.density
        points = attempt.points
        if attempt.actions is not None:
            points = np.concatenate([points, attempt.actions.point_rows()])
        out = trial.loads(points, attempt.edges, attempt.midpoint.vertices, angle)
        out -= density[:, None] * np.einsum("bej,be->bj", trial.coupling(angle), attempt.acceleration[:, 3:])
        spun = density * attempt.carried[:, 2] ** 2
        out += spun[:, None] * (trial.basis.coupling[:, 0] + trial.basis.coupling[:, 1])
        force = np.einsum("nw,nwa->na", faces.force, faces.directions)
        for owner, at, sign in zip(faces.owners, faces.points, (1.0, -1.0), strict=True):
            some = self.found[owner] & force.any(axis=1)
            matrix = trial.directions(at[some], owner[some], angle)
            np.add.at(out, owner[some], sign * np.einsum("na,naj->nj", force[some], matrix))
        return out

    def _energy(self, attempt) -> float:
        """J/m: elastic and kinetic energy of blocks with automatic order, energy stored in their contacts and lost
        there."""
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
            "t = %g s: %r has order %d, the highest, and higher orders would contain %.2g of the energy (dda.order_target = %g): %s. "
            "Divide it into cells (zones.NAME.mesh_size_m with an order of 3), draw it as several blocks, or allow a larger share",
            time, self.blocks.names[block], HIGHEST_ORDER, left, self.target, self._why(block),
        )  # fmt: skip

    def _why(self, block: int) -> str:
        """Why polynomials converge slowly in ``block``."""
        own = np.flatnonzero(self.blocks.vertex_block == block)
        at, following = self.blocks.vertices, self.blocks.next_vertex
        before, after = at[own] - at[self.blocks.previous_vertex[own]], at[following[own]] - at[own]
        turns = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        inward = turns < -1e-6 * np.hypot(*before.T) * np.hypot(*after.T)
        if not inward.any():
            return "its stress is concentrated at corners or ends of contacts"
        if len(self.blocks.loops(block)) > 1:
            return "polynomials cannot bend around its hole"
        x, y = at[own[inward]][0]
        return f"stress is singular at its re-entrant corner ({x:.4g}, {y:.4g})"


@dataclass(frozen=True, eq=False)
class _FaceForces:
    """Contacts (n,) of an attempt as points along faces.

    owners   (n,) twice            blocks of the vertices and of the edges
    directions     (n, 2, 2)             directions normal to and along the face
    force    (n, 2)                N, normal and shear
    springs  (n, 2)                Pa, of closed contacts; zero for others
    points   (n, 2) twice          undeformed, on both blocks
    rigid    (n, 2, 6) twice       normal and tangential motion per unit of the first six unknowns of both blocks
    angle, area, fixed (n_blocks,) rotation, area, and which blocks are fixed
    """

    owners: tuple[np.ndarray, np.ndarray]
    directions: np.ndarray
    force: np.ndarray
    springs: np.ndarray
    points: tuple[np.ndarray, np.ndarray]
    rigid: tuple[np.ndarray, np.ndarray]
    angle: np.ndarray
    area: np.ndarray
    fixed: np.ndarray

    @classmethod
    def of(cls, trial: DeflectedBlocks, attempt) -> _FaceForces:
        """Contacts of ``attempt``, those at corners distributed along faces."""
        found, settled, laws = attempt.found, attempt.settled, attempt.system.finder
        if isinstance(found, FaceContacts):
            normal, shear, state = settled.normal_force, settled.shear_force, settled.state
        else:
            normal, shear = settled.normal_force, settled.shear_force
            if found.points is not None:
                normal, shear = found.points.at_corners(normal), found.points.at_corners(shear)
                found = found.on_corners
            corners = replace(found, normal=normal, shear=shear, state=settled.state, points=None, lumped=None)
            by_length = laws.stiff_laws[found.law], laws.stiff_along_laws[found.law]
            found = FaceContacts.along_faces(corners, trial.order, None, by_length)
            normal, shear, state = found.normal, found.shear, found.state
            # A face that is closed at one end bears the force of that end with all of its points.
            for closed in (SLIP, STICK):
                some = found.on_faces.between((corners.state == closed).astype(float)) > 0.0
                state = np.where((state == OPEN) & some, closed, state)
        owners, midpoint = (found.block, found.other), attempt.midpoint
        geometry = midpoint.contacts(found.geometry, *owners, attempt.along_edges(found))
        across = geometry[:, 1:3]
        directions = np.stack([across, np.stack([-across[:, 1], across[:, 0]], axis=1)], axis=1)
        rigid = tuple(
            np.einsum("nwa,naj->nwj", directions, displacement_matrix(geometry[:, 5:7], midpoint.centroid[owner]))
            for owner in owners
        )
        return cls(
            owners, directions, np.stack([normal, shear], axis=1),
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

    def work(
        self, trial: DeflectedBlocks, block: int, group: _Group, left: np.ndarray, cracks: CracksInBlock | None = None,
        every: _AllBlocks | None = None,
    ) -> tuple[float, float]:  # fmt: skip
        """J/m: work that the next order of ``block`` (of ``group``) would take up, and the next two.

        The residual forces ``left`` (h,) act on a patch, which includes its contacts and neighbours, or on ``every`` block;
        ``cracks`` are those of the block if it has any.
        """
        own, m = group.own, group.own + len(left)
        rock, springs = self._patch(trial, block, m) if every is None else self._whole(trial, block, m, every)
        size = len(rock)
        if cracks is not None:
            # √A times mean strain, and deflection.
            root, tangent = float(np.sqrt(self.area[block])), cracks.tangent()
            strain, bent = slice(m + 3, m + 6), slice(0, m)
            rock[strain, strain] += self.area[block] * (tangent[:3, :3] - trial.elastic[block])
            rock[strain, bent], rock[bent, strain] = root * tangent[:3, 3:], root * tangent[3:, :3]
            rock[bent, bent] = tangent[3:, 3:]
        matrix = rock + springs
        high = np.arange(own, m)
        low = np.concatenate([np.arange(own), np.arange(m, size)])
        if cracks is None:
            shared, rest = matrix[np.ix_(high, low)], matrix[np.ix_(low, low)]
            factor = np.linalg.cholesky(matrix[np.ix_(high, high)] - shared @ np.linalg.solve(rest, shared.T))
            share = np.linalg.solve(factor, left)
            return 0.5 * float(share[: group.next] @ share[: group.next]), 0.5 * float(share @ share)
        found = []
        for n in (own + group.next, m):
            some = np.concatenate([low, np.arange(own, n)])
            opened, force = np.zeros(size), np.zeros(size)
            opened[:n] = cracks.beyond(trial.stiffness[block, :m, :m], own, n)
            force[own:n] = left[: n - own]
            force, opened = force[some], opened[some]
            inside, outside = rock[np.ix_(some, some)], springs[np.ix_(some, some)]
            moved = np.linalg.solve(inside + outside, force + inside @ opened)
            strained = moved - opened
            found.append(0.5 * float(moved @ outside @ moved + strained @ inside @ strained))
        return found[0], found[1]

    def _patch(self, trial: DeflectedBlocks, block: int, m: int) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness (n, n) of the rock, and of the contacts, of a patch around ``block``. Unknowns: ``m`` of deflection,
        those to be estimated last; then six of the block and six of each neighbour."""
        rows, side, motion = self._motion(trial, block, m)
        other = np.where(side == 0, self.owners[1][rows], self.owners[0][rows])
        near = np.unique(other)
        near = near[~self.fixed[near]]
        size = m + 6 + 6 * len(near)
        matrix, moved = np.zeros((size, size)), np.zeros((len(rows), 2, size))
        matrix[: m + 6, : m + 6], moved[..., : m + 6] = self._rock(trial, block, m), motion
        for k, b in enumerate(near.tolist()):
            at = m + 6 + 6 * k + np.arange(6)
            matrix[np.ix_(at, at)] = self._strained(trial, b)
        for c in np.flatnonzero(~self.fixed[other]).tolist():
            first = m + 6 + 6 * int(np.searchsorted(near, other[c]))
            moved[c, :, first : first + 6] -= self.rigid[1 - side[c]][rows[c]]
        return matrix, np.einsum("nwi,nw,nwj->ij", moved, self.springs[rows], moved, optimize=True)

    def _whole(
        self, trial: DeflectedBlocks, block: int, m: int, every: _AllBlocks
    ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        """As `_patch`, of the block's own unknowns: all others, of ``every`` block, follow."""
        rows, side, motion = self._motion(trial, block, m)
        sign = np.where(side == 0, 1.0, -1.0)
        return self._rock(trial, block, m), every.around(block, rows, sign[:, None, None] * motion)

    def _motion(self, trial: DeflectedBlocks, block: int, m: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Closed contacts (k,) of ``block``, its side of them, 0 or 1, and their motion (k, 2, m + 6) with its unknowns."""
        holds = self.springs.any(axis=1)
        sides = [np.flatnonzero((owner == block) & holds) for owner in self.owners]
        motion = np.zeros((sum(map(len, sides)), 2, m + 6))
        start = 0
        for of, rows in enumerate(sides):
            own = motion[start : start + len(rows)]
            bends = trial.directions(self.points[of][rows], np.full(len(rows), block), self.angle)[..., :m]
            own[..., :m] = np.einsum("nwa,naj->nwj", self.directions[rows], bends)
            own[..., m:] = self.rigid[of][rows]
            start += len(rows)
        return np.concatenate(sides), np.repeat([0, 1], [len(rows) for rows in sides]), motion

    def _rock(self, trial: DeflectedBlocks, block: int, m: int) -> np.ndarray:
        """Stiffness (m + 6, m + 6) of the rock of ``block``."""
        out = np.zeros((m + 6, m + 6))
        out[:m, :m], out[m:, m:] = trial.stiffness[block, :m, :m], self._strained(trial, block)
        return out

    def _strained(self, trial: DeflectedBlocks, block: int) -> np.ndarray:
        """Stiffness (6, 6) of the rock of a ``block`` of first order."""
        out, area = np.zeros((6, 6)), self.area[block]
        out[3:, 3:] = area * trial.elastic[block]
        # What is free as a whole is unconstrained, and in equilibrium.
        np.fill_diagonal(
            out, np.diag(out) + _REGULARISATION * trial.elastic[block, 0, 0] * np.array([1, 1, *[area] * 4])
        )
        return out


@dataclass(frozen=True, eq=False)
class _AllBlocks:
    """The first six unknowns of all blocks that are not fixed, n in all, with their k closed contacts.

    first    (n_blocks,)  of the block's unknowns; −1 for fixed ones
    motion   (2 k, n)     of the contacts
    springs  (2 k,)       Pa
    place    (n_contacts,) of each contact among those that are closed
    factor   LU factors of their stiffness
    """

    first: np.ndarray
    motion: csc_array
    springs: np.ndarray
    place: np.ndarray
    factor: SuperLU

    @classmethod
    def of(cls, faces: _FaceForces, trial: DeflectedBlocks) -> _AllBlocks:
        from scipy.sparse import csc_array, diags_array
        from scipy.sparse.linalg import splu

        moving = np.flatnonzero(~faces.fixed)
        first = np.full(len(faces.fixed), -1)
        first[moving] = 6 * np.arange(len(moving))
        closed = np.flatnonzero(faces.springs.any(axis=1))
        place = np.cumsum(faces.springs.any(axis=1)) - 1
        value, row, column = [], [], []
        for owner, rigid, sign in zip(faces.owners, faces.rigid, (1.0, -1.0), strict=True):
            some = closed[~faces.fixed[owner[closed]]]
            shape = len(some), 2, 6
            value.append((sign * rigid[some]).ravel())
            row.append(np.broadcast_to((2 * place[some, None] + [0, 1])[:, :, None], shape).ravel())
            column.append(np.broadcast_to((first[owner[some], None] + np.arange(6))[:, None], shape).ravel())
        entries = np.concatenate(value), (np.concatenate(row), np.concatenate(column))
        motion = csc_array(entries, shape=(2 * len(closed), 6 * len(moving)))
        springs = faces.springs[closed].ravel()
        rock = np.array([faces._strained(trial, b) for b in moving.tolist()])
        at = np.broadcast_to(first[moving, None] + np.arange(6), (len(moving), 6))
        index = np.broadcast_to(at[:, :, None], rock.shape).ravel(), np.broadcast_to(at[:, None], rock.shape).ravel()
        matrix = csc_array((rock.ravel(), index), shape=motion.shape[1:] * 2) + motion.T @ diags_array(springs) @ motion
        factor = splu(
            csc_array(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
        return cls(first, motion, springs, place, factor)

    def around(self, block: int, rows: np.ndarray, motion: np.ndarray) -> np.ndarray:
        """(m, m) stiffness that contacts and all other blocks have for the unknowns of ``block``.

        ``motion`` (k, 2, m) is what it contributes to that of its contacts ``rows`` (k,).
        """
        k, m = len(rows), motion.shape[2]
        own, at = motion.reshape(2 * k, m), (2 * self.place[rows, None] + [0, 1]).ravel()
        pushed = self.springs[at, None] * own
        mine = self.first[block] + np.arange(6)
        sides = np.zeros((self.motion.shape[1], m + 6))
        sides[:, :m] = self.motion[at].T @ pushed
        # The block's own part of the motion of the others is none: it is held.
        sides[mine, :m] = 0.0
        sides[mine, m + np.arange(6)] = 1.0
        moved = self.factor.solve(sides)
        others = moved[:, :m] - moved[:, m:] @ np.linalg.solve(moved[mine, m:], moved[mine, :m])
        return own.T @ pushed - sides[:, :m].T @ others


def extended_deflection(deflection: np.ndarray, before: np.ndarray, order: np.ndarray) -> np.ndarray:
    """(k, …) the ``deflection`` of blocks raised from the orders ``before`` (n_blocks,) to ``order``: new unknowns are
    zero."""
    old, new = n_deflections(before), n_deflections(order)
    start = np.cumsum(new) - new
    kept = np.arange(int(old.sum())) - np.repeat(np.cumsum(old) - old, old) + np.repeat(start, old)
    out = np.zeros((int(new.sum()), *deflection.shape[1:]))
    out[kept] = deflection
    return out
