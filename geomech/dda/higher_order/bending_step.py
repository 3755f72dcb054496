"""Time step of blocks of different orders: `Attempt` with the unknowns of deflection.

They form one system with the first six unknowns of each block (`six_row_system`), integrated by the same scheme in the
frame that rotates with the block,

    2 M/dt² Δq = 2 M q̇/dt + f − K q − θ K Δq − c K Δq/dt + contacts,

where c is the damping of the block's mean strain. Contacts along faces are integration points, each with its own state
(`face_points`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from ...model import OPEN, Loads, State
from ..interfaces import SteppedSystem
from ..kinematics.midpoint_configuration import MidpointConfiguration
from ..loads.bending_actions import BendingActions, DeflectedPoints
from ..loads.bending_dashpots import BendingDashpots
from ..loads.bending_motion import BendingMotion
from ..loads.force_records import BondTractions
from ..loads.load_vectors import generalised
from ..loads.prescribed_motion import MovedBlocks
from ..loads.viscous_boundary import ViscousEdges
from ..open_close.contact_set import ContactSet
from ..open_close.equations import Unsettled
from ..out_of_balance import imbalance
from ..results import CrackResponse, StepResult
from ..time_step import Attempt, StepStart
from .crack_softening import SoftenedBlock, softened_blocks
from .deflected_blocks import DeflectedBlocks, strain_turned_back
from .deflection_basis import n_deflections
from .equations import HigherOrderEquations
from .face_points import FaceContacts
from .glued_cells import Glue, GluedFaces
from .six_row_system import SixRowPattern, fill_own, moved

#: In statics, where blocks have cracks, this multiple of ``max_open_close_iterations`` is tried before the step is
#: shortened: a slope of 49 blocks with 20 cracked ones settles in 60 to 100, and in shorter steps, which the inertia of
#: the blocks makes another problem, not sooner.
_WITH_CRACKS = 5


class BendingSystem(SteppedSystem, Protocol):
    """A system with ``deflected`` blocks; ``glued`` are the faces of its cells, None without, and ``bonded`` (m,) their
    numbers in `Blocks.glued`."""

    deflected: DeflectedBlocks
    glued: GluedFaces | None
    bonded: np.ndarray


class BendingAttempt(Attempt):
    """As `Attempt`, for a system with ``deflected`` blocks; ``found`` are the contacts at corners."""

    equations = HigherOrderEquations
    system: BendingSystem
    found: FaceContacts
    actions: BendingActions | None

    def __init__(self, system: BendingSystem, start: StepStart, dt: float, found: ContactSet, cuts: int) -> None:
        state = start.state
        self.blocks: DeflectedBlocks = system.deflected
        known = self.blocks.at_rest() if state.deflection is None else state.deflection
        self.deflection = np.ascontiguousarray(known[:, 0])
        #: (k,) m, deflection that strains the blocks beyond their mean stress.
        self.strained = self.blocks.elastic_part(state)
        #: (k,) m/s, rates of deflection at the start of the step.
        self.rates = system.settings.dynamic_factor * known[:, 1]
        if system.taken_out is not None:
            gone = system.taken_out[self.blocks.owner]
            self.deflection = np.where(gone, self.deflection - self.strained, self.deflection)
            self.strained, self.rates = np.where(gone, 0.0, self.strained), np.where(gone, 0.0, self.rates)
        super().__init__(system, start, dt, self._on_faces(system, state, start.vertices, found), cuts)

    def _crack_response(self, crack: CrackResponse | None) -> tuple[np.ndarray, np.ndarray]:
        compliance, offset = super()._crack_response(crack)
        bends, state, blocks = self.blocks.bending, self.state, self.blocks
        system = self.system
        self.softened = softened_blocks(crack, state, blocks, system.compliance, self.strained, system.fixed)
        if crack is not None and len(bends):
            # The equations of first order leave the cracks of these blocks as they are.
            compliance, offset = compliance.copy(), offset.copy()
            compliance[bends], offset[bends] = 0.0, state.crack_strain[bends]
        return compliance, offset

    def _on_faces(self, system: BendingSystem, state: State, vertices: np.ndarray, corners: ContactSet) -> FaceContacts:
        """Contacts at ``corners`` and at points along faces, with the contribution of deflection to their gaps."""
        finder = system.finder
        by_length = finder.stiff_laws[corners.law], finder.stiff_along_laws[corners.law]
        found = FaceContacts.along_faces(corners, self.blocks.order, state.face_points, by_length)
        self.touching = self.blocks.touching(found, vertices)
        if not self.deflection.any():
            return replace(found, deflected=np.zeros(len(found)))
        return replace(found, deflected=self._gaps(found.geometry[:, 1:3], found, state.rotation, self.deflection))

    def _gaps(self, normal: np.ndarray, found: ContactSet, angle: np.ndarray, q: np.ndarray) -> np.ndarray:
        """(n,) m: contribution of deflections ``q`` (k,) to the gaps of contacts with the normals ``normal`` (n, 2)."""
        return self.blocks.apart(normal, found, self.touching, angle, q)

    def _actions(self, loads: Loads, end: float) -> BendingActions | None:
        system, state = self.system, self.state
        self.places = DeflectedPoints(system.load_map, self.blocks, state.rotation, self.deflection)
        bent = self.blocks, state.rotation + self.turn
        moved = MovedBlocks(system.blocks, system.fixed, system.taken_out, bent)
        actions = BendingActions.of(moved, loads, state, self.places, self.midpoint, system.free, end)
        if actions is not None:
            actions.bend(*bent)
            actions.rows_of = self._rows
        return actions

    def _assemble(self) -> None:
        super()._assemble()
        system, scheme, blocks, dt = self.system, self.system.scheme, self.blocks, self.dt
        self.angle = self.state.rotation + self.turn
        inertia = 2.0 * self.heavier / (dt * dt) + scheme.mass_damping / dt
        drag = scheme.stiffness_damping + 2.0 * scheme.block_damping * np.sqrt(
            self.density * self.moments[:, 0] / (12.0 * system.stiffness[:, 0, 0])
        )
        size = np.sqrt(self.moments[:, 0])
        # Strains, unknowns on the axes of the start of the step, and deflection are coupled by inertia.
        self.shared = self.density[:, None, None] * blocks.coupling(self.state.rotation) / size[:, None, None]
        self.bending_load = blocks.loads(self.points, self.edges, self.midpoint.vertices, self.angle)
        stored, rates = blocks.stiffness_times(self.strained), blocks.padded(self.rates)
        spin = self.density * self.carried[:, 2] ** 2
        own = self.bending_load - stored
        own += spin[:, None] * (blocks.basis.coupling[:, 0] + blocks.basis.coupling[:, 1])
        by_rate = 2.0 * self.heavier / dt
        own += by_rate * (self.density * blocks.basis.area)[:, None] * rates
        own += by_rate * np.einsum("bej,be->bj", self.shared, size[:, None] * self.carried[:, 3:])
        self.coupled_right = by_rate * np.einsum("bej,bj->be", self.shared, rates)
        self.own_right = own
        faces = system.glued
        self.glue = (
            None
            if faces is None
            else Glue.of(
                faces,
                self.state,
                self.vertices,
                (self.deflection, self.strained),
                self.midpoint,
                self.turn,
                self.softened,
            )
        )
        self._bending = (scheme.weight + drag / dt)[:, None, None] * blocks.stiffness
        self._inertia = inertia * self.shared, inertia * self.density * blocks.basis.area
        for softened in self.softened:
            self._soften(softened, scheme.weight + drag[softened.block] / dt)

    def _soften(self, of: SoftenedBlock, elastic: float) -> None:
        """Replace the elasticity of a block, which acts with the factor ``elastic``, by that with its cracks."""
        b, m, root = of.block, len(of.still) - 3, np.sqrt(self.moments[of.block, 0])
        row, own = self.order[b], self.own_right[b, :m]
        self.matrix[row, 3:, 3:] += elastic * (of.tangent[:3, :3] - self.tangent[b])
        self.right[row, 3:] -= elastic * root * (of.still[:3] - self.stress0[b])
        own -= elastic * of.size * (of.still - of.begun)[3:]
        self.tangent[b], self.stress0[b] = of.tangent[:3, :3], of.still[:3]
        self._bending[b, :m, :m] = elastic * of.tangent[3:, 3:]
        self._inertia[0][b, :, :m] += elastic * (of.size / root) * of.tangent[:3, 3:]

    @property
    def _without_dashpots(self) -> np.ndarray:
        return self.system.fixed | (self.blocks.order > 1)

    def _absorb(self, loads: Loads, load_time: float | None) -> None:
        super()._absorb(loads, load_time)
        self._own_matrices(self._bending, *self._inertia)
        system, self.dashpots = self.system, None
        #: block → matrix of its dashpots and of springs that move its points.
        self.damped: dict[int, np.ndarray] = {}
        if self.actions is not None and isinstance(self.actions.imposed, BendingMotion):
            for equation in self.actions.imposed.spring_equations():
                self._add_own(*equation)
        if self.quiet is None:
            return
        time = self.state.time + 0.5 * self.dt if load_time is None else load_time
        edges = ViscousEdges.of(
            loads.viscous_boundaries, system.blocks, self.midpoint.vertices, time, system.density, system.stiffness,
            system.fixed | (self.blocks.order < 2),
        )  # fmt: skip
        self.dashpots = BendingDashpots.of(edges, self.blocks, self.midpoint, self.angle)
        if self.dashpots is None:
            return
        for b, (matrix, right) in self.dashpots.equations(self.dt).items():
            self._add_own(b, matrix, right)

    def _own_of(self, block: int, own: np.ndarray) -> np.ndarray:
        """The part (6 rows, 6 rows) of the blocks' matrices ``own`` that is that of ``block``."""
        width, at = 6 * int(self.blocks.rows[block]), self.own_at[block]
        return own[at : at + width * width].reshape(width, width)

    def _add_own(self, block: int, matrix: np.ndarray, right: np.ndarray) -> None:
        """Add ``matrix`` (w, w) and ``right`` (w,) to the equations of ``block``."""
        m = n_deflections(int(self.blocks.order[block]))
        self._own_of(block, self.own)[: 6 + m, : 6 + m] += matrix[: 6 + m, : 6 + m]
        self.own_right[block, :m] += right[6 : 6 + m]
        self.matrix[self.order[block]] += matrix[:6, :6]
        self.right[self.order[block]] += right[:6]
        known = self.damped.get(block, 0.0)
        self.damped[block] = known + matrix[: 6 + m, : 6 + m]

    def _own_matrices(self, bending: np.ndarray, shared: np.ndarray, mass: np.ndarray) -> None:
        """The blocks' own matrices, one after the other.

        ``bending`` (n_blocks, m, m) is the stiffness of deflection, ``shared`` (n_blocks, 3, m) its coupling with
        strains, and ``mass`` (n_blocks,) its mass on the diagonal.
        """
        blocks, moving = self.blocks, self.system.moving
        self.own_at, pieces, at = np.full(len(self.order), -1), [], 0
        for order in np.unique(blocks.order[moving]).tolist():
            some = moving[blocks.order[moving] == order]
            m, width = int(n_deflections(order)), 6 * int(blocks.rows[some[0]])
            own = np.zeros((len(some), width, width))
            own[:, :6, :6] = self.matrix[self.order[some]]
            if m:
                own[:, 3:6, 6 : 6 + m] = shared[some, :, :m]
                own[:, 6 : 6 + m, 3:6] = np.swapaxes(shared[some, :, :m], 1, 2)
                own[:, 6 : 6 + m, 6 : 6 + m] = bending[some, :m, :m]
                diagonal, spare = np.arange(6, 6 + m), np.arange(6 + m, width)
                own[:, diagonal, diagonal] += mass[some, None]
                own[:, spare, spare] = own[:, diagonal, diagonal].mean(axis=1, keepdims=True)
            self.own_at[some] = at + np.arange(len(some)) * width * width
            at += own.size
            pieces.append(own.ravel())
        self.own = np.concatenate(pieces) if pieces else np.zeros(0)

    @property
    def _most_iterations(self) -> int:
        most = super()._most_iterations
        return _WITH_CRACKS * most if self.softened and self.system.scheme.static else most

    def _settled(self, pattern, matrix, right, found, gap, vectors, springs, curved):
        try:
            return super()._settled(pattern, matrix, right, found, gap, vectors, springs, curved)
        except Unsettled as failure:
            # Everything outside this step knows contacts by their corners.
            if failure.contact < 0:
                raise
            raise Unsettled(str(failure), found.on_faces.corner_of(failure.contact)) from failure

    def _further_equations(self, pattern, matrix, right, contacts, vectors) -> dict[str, Any]:
        blocks, moving, own = self.blocks, self.system.moving, self.own
        full = np.zeros((pattern.n, 6))
        full[: self.n_free] = right
        full[self.order[moving], 3:6] += self.coupled_right[moving]
        there = blocks.present
        full.ravel()[self._deflection_at(pattern)] = self.own_right[blocks.owner[there], blocks.which[there]]
        if self.actions is not None or self._constrained() is not None:
            # Constraints, prescribed motion and bolts have changed the first six rows and columns.
            own = own.copy()
            for b in moving.tolist():
                self._own_of(b, own)[:6, :6] = matrix[self.order[b]]
        rows, glue = self._rows(contacts, vectors), self.glue
        if self.actions is not None and self.actions.driven:
            glue = self._drive(own, full.ravel(), pattern)
            self.actions.project(contacts.block, contacts.other, rows)
        base = np.empty(pattern.size)
        fill_own(base, pattern.places, pattern.step, (own, self.own_at), pattern.order)
        base[pattern.spare] = np.abs(base).max(initial=1.0)
        if glue is not None:
            glue.push(full.ravel(), pattern, self.system.scheme.weight)
            n_bolts = 0 if self.actions is None else self.actions.n_bolts
            glue.stiffen(base, pattern, len(contacts) + n_bolts, self.system.scheme.weight)
        if self.actions is not None:
            self.actions.add(full.ravel(), base, pattern, len(contacts))
        alone = glue is None and (self.actions is None or not self.actions.n_bolts)
        return {"right": full, "base": base, "rows": rows, "own": (own, self.own_at) if alone else None}

    def _drive(self, own: np.ndarray, right: np.ndarray, pattern: SixRowPattern) -> Glue | None:
        """Impose prescribed motion on the blocks' matrices ``own`` and on ``right`` (6 n,), in place; returns the glue as it
        acts with it."""
        assert self.actions is not None
        #: block → its matrix and right side without what is imposed, contacts, glue and bolts.
        self.undriven: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        for b, driven in self.actions.driven.items():
            w, free = len(driven.known), driven.free
            matrix, at = self._own_of(b, own)[:w, :w], pattern.unknowns_of(b, len(driven.known))
            self.undriven[b] = matrix.copy(), right[at].copy()
            right[at] = free @ (right[at] - matrix @ driven.known)
            stiff = np.abs(np.diag(matrix)).max()
            matrix[:] = free @ matrix @ free + stiff * (np.eye(w) - free)
        if self.glue is None:
            return None
        one, two = (np.tile(owner, 2) for owner in self.glue.faces.owners)
        shift = self.actions.known_motion(one, two, self.glue.vectors)
        vectors = self.glue.vectors.copy()
        self.actions.project(one, two, vectors)
        return replace(
            self.glue, vectors=vectors, before=self.glue.before + self.system.scheme.weight * shift
        )  # fmt: skip

    def _residual_of_driven(self) -> None:
        """Find the forces that impose motion: what the equations of their blocks lack."""
        if self.actions is None or not self.actions.driven:
            return
        found, settled, flat = self.found, self.settled, self.unknowns.ravel()
        sets: list[tuple[np.ndarray, ...]] = [
            (found.block, found.other, self._rows(found, self.vectors), settled.normal_force, settled.shear_force)
        ]
        if self.glue is not None:
            owners = [np.tile(owner, 2) for owner in self.glue.faces.owners]
            elongation = self.glue.before + self.system.scheme.weight * self.glue_change
            sets.append((*owners, self.glue.vectors, *(-self.glue.springs[:, None] * elongation).T))
        sets += self.actions.bolt_pushes()
        for b, driven in self.actions.driven.items():
            w = len(driven.known)
            matrix, right = self.undriven[b]
            left = matrix @ flat[self._six_rows.unknowns_of(b, w)] - right
            for block, other, rows, normal, shear in sets:
                for side, owner in enumerate((block, other)):
                    own = np.flatnonzero(owner == b)
                    left -= normal[own] @ rows[own, 0, side, :w] + shear[own] @ rows[own, 1, side, :w]
            driven.residual = left

    def _deflection_at(self, pattern) -> np.ndarray:
        """(k,) positions of the unknowns of deflection of blocks that are there among all unknowns."""
        there = self.blocks.present
        return pattern.unknown[pattern.at[self.blocks.owner[there]] + 6 + self.blocks.which[there]]

    def _rows(self, found: ContactSet, vectors: np.ndarray) -> np.ndarray:
        """(n, 2, 2, w): direction, side, relative motion per unit of the unknowns of the side's block."""
        blocks, n = self.blocks, len(found)
        out = np.zeros((n, 2, 2, max(blocks.width, 6)))
        out[..., :6] = vectors.reshape(n, 2, 2, 6)
        geometry = self.midpoint.contacts(found.geometry, found.block, found.other, self.along_edges(found))
        normal = geometry[:, 1:3]
        directions = np.stack([normal, np.stack([-normal[:, 1], normal[:, 0]], axis=1)], axis=1)
        for side, (owner, points, sign) in enumerate(
            zip((found.block, found.other), self.touching, (1.0, -1.0), strict=True)
        ):
            matrix = blocks.directions(points, owner, self.angle)
            m = matrix.shape[2]
            out[:, :, side, 6 : 6 + m] = sign * np.einsum("nwa,naj->nwj", directions, matrix, optimize=True)
        return out

    def _update_arcs(self) -> bool:
        """As `Attempt._bent`: whether the step must be solved again with gaps that follow the circular arcs of its
        motion."""
        system, found = self.system, self.found
        if not len(found) or not self.n_free:
            return False
        known = (1e-3 if system.scheme.static else 0.1) * found.precision
        increment = self._increment(self.unknowns)
        if 2.0 * np.abs(increment[:, 2]).max() * system.step_limit < known.min():
            return False
        before, settled = found.arc + np.zeros(len(found)), self.settled
        vertices = self._advanced(increment)[0]
        if not system.scheme.static:
            self._place(increment)
        self._follow(increment, vertices)
        if not (np.abs(self.found.arc - before) > known)[settled.state != OPEN].any():
            self.found = found
            return False
        self.found = self.found.trying_again(settled)
        return True

    def _follow(self, increment: np.ndarray, vertices: np.ndarray) -> None:
        """Let contacts follow the arcs of the motion ``increment`` (n_blocks, 6), with which deflection rotates."""
        super()._follow(increment, vertices)
        found, system, start = self.found, self.system, self.state.rotation
        change = self._deflected_by()
        end = MidpointConfiguration.of(increment, 1.0, self.vertices, system.owner, self.moments)
        normal = end.contacts(found.geometry, found.block, found.other, self.along_edges(found))[:, 1:3]
        acting = self.midpoint.contacts(found.geometry, found.block, found.other, self.along_edges(found))[:, 1:3]
        extra = []
        for turned in (lambda n: n, lambda n: np.stack([-n[:, 1], n[:, 0]], axis=1)):
            gap_change = self._gaps(turned(normal), found, start + increment[:, 2], self.deflection + change)
            gap_change -= self._gaps(turned(found.geometry[:, 1:3]), found, start, self.deflection)
            extra.append(gap_change - self._gaps(turned(acting), found, start + self.turn, change))
        self.found = replace(found, arc=found.arc + extra[0], swing=found.swing + extra[1])

    def glue_traction(self) -> np.ndarray | None:
        """(n, 2) Pa: mean traction of the glued faces at the end of the step; None without any."""
        if self.glue is None or not len(self.glue.faces.block):
            return None
        return self.glue.mean_traction(self.glue_change)

    def _bonds(self) -> BondTractions | None:
        """Tractions between cells in the step."""
        if self.glue is None:
            return None
        edges = np.asarray(self.blocks.blocks.glued)[self.system.bonded]
        traction = self.glue.traction_on_cells(self.system.scheme.weight * self.glue_change)
        return BondTractions(edges, self.glue.faces.face, traction)

    @property
    def _six_rows(self) -> SixRowPattern:
        """The pattern of the equations, of a step with free blocks."""
        assert isinstance(self.pattern, SixRowPattern)
        return self.pattern

    def _deflected_by(self) -> np.ndarray:
        """(k,) m: increment of deflection in the last solution of the step."""
        change = np.zeros(self.blocks.n_unknowns)
        change[self.blocks.present] = self.unknowns.ravel()[self._deflection_at(self.pattern)]
        return change

    def _move(self) -> None:
        change = self.bent_by = self._deflected_by()
        for of in self.softened:
            self.stress0[of.block] += of.shared @ change[self.blocks.basis.of_block(of.block)]
        super()._move()
        self._open_cracks()
        blocks, static = self.blocks, self.system.scheme.static
        # Statics have no rates; dynamics keep those at the end of the step, in the frame of the block.
        self.new_rates = np.zeros_like(change) if static else 2.0 * change / self.dt - self.rates
        mean = blocks.padded(2.0 / self.dt**2 * (change - self.dt * self.rates))
        blocks.acceleration = np.sqrt((mean * mean).sum(axis=1))
        self.largest = max(self.largest, float(blocks.largest(change)[0].max()))
        if self.dashpots is not None:
            self._brake(self.dashpots)
        if self.actions is not None and isinstance(self.actions.imposed, BendingMotion) and not static:
            self.actions.imposed.correct_rates(self.velocity, self.new_rates)
        if self.glue is not None:
            self.glue_change = self.glue.change(self.unknowns.ravel(), self._six_rows)
        if self.n_free:
            found = self.found
            rows = self._rows(found, self.vectors)
            pattern = self._six_rows
            self.slid = moved(
                self.settled.unknowns.ravel(), (found.block, found.other, pattern.order),
                pattern.unknowns, rows,
            )[:, 1].copy()  # fmt: skip
            if self.actions is not None:
                self.slid += self.actions.along
        self._residual_of_driven()
        self.places.take(self.state.rotation + self.increment[:, 2], self.deflection + change)

    def _open_cracks(self) -> None:
        """Crack strain and deflection of cracked blocks at the end of the step."""
        known = self.state.crack_deflection
        self.opened = None if known is None and not self.softened else self.blocks.at_rest()[:, 0]
        if self.opened is not None and known is not None:
            self.opened += known
        for of in self.softened:
            b, own = of.block, self.blocks.basis.of_block(of.block)
            strain = of.crack_strain(self.increment[b, 3:], self.bent_by[own])
            self.new_crack[b] = strain_turned_back(-self.increment[b, 2]) @ strain[:3]
            assert self.opened is not None
            self.opened[own] = of.size * strain[3:]

    @property
    def opened_by(self) -> np.ndarray:
        """(k,) m: change of the deflection due to cracks in the step."""
        if self.opened is None:
            return np.zeros_like(self.deflection)
        return self.opened if self.state.crack_deflection is None else self.opened - self.state.crack_deflection

    def _brake(self, dashpots: BendingDashpots) -> None:
        """Add the forces of ``dashpots`` to the loads of the step."""
        change = self.blocks.padded(self.bent_by)
        unknowns, moving = np.zeros((len(change), 6 + change.shape[1])), self.system.moving
        unknowns[moving, :6] = self.unknowns[self.order[moving]]
        unknowns[:, 6:] = change
        forces = dashpots.point_rows(unknowns, self.dt)
        self.points = np.concatenate([self.points, forces])
        acting = generalised(forces, self.edges[:0], self.midpoint.centroid)
        self.load = self.load + self.midpoint.loads_back(acting)
        self.dashpot_work = dashpots.deflecting_work(forces, change)

    def path(self, after: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        blocks, q, turned = self.blocks, self.deflection, self.state.rotation + self.increment[:, 2]
        finder = self.system.finder
        finder.sag = np.maximum(finder.sag, blocks.largest(q + self.bent_by)[1])
        return (
            blocks.corners(self.vertices, self.state.rotation, q),
            blocks.corners(after, turned, q + self.bent_by),
        )

    def _stop(self, imposed) -> None:
        """Contacts of blocks that bend keep the velocities that the step gives them."""

    def _imbalance(self, right: np.ndarray, load: np.ndarray, largest: float) -> tuple[float, float]:
        found, settled, n = self.found, self.settled, self.n_free
        right = right.copy()
        blocks = self.blocks
        inertia = 2.0 * self.heavier / self.dt**2 + self.system.scheme.mass_damping / self.dt
        bent = inertia * np.einsum("bej,bj->be", self.shared, self.blocks.padded(self.bent_by))
        moving = self.system.moving
        right[self.order[moving], 3:6] += (self.coupled_right - bent)[moving]
        for of in self.softened:
            m = len(of.still) - 3
            coupling = self._inertia[0][of.block, :, :m] - inertia * self.shared[of.block, :, :m]
            right[self.order[of.block], 3:6] -= coupling @ self.bent_by[blocks.basis.of_block(of.block)]
        for b, matrix in self.damped.items():
            own = self.bent_by[self.blocks.basis.of_block(b)]
            right[self.order[b]] -= matrix[:6, 6 : 6 + len(own)] @ own
        matrix, vectors = self.matrix, self.vectors
        for b in {} if self.actions is None else self.actions.driven:
            # The forces that impose motion balance these blocks.
            matrix, vectors = matrix.copy(), vectors.copy()
            matrix[self.order[b]], right[self.order[b]] = 0.0, 0.0
            vectors[found.block == b, :, :6], vectors[found.other == b, :, 6:] = 0.0, 0.0
        if self.glue is not None:
            forces = self.glue.forces(self.system.scheme.weight * self.glue_change, len(self.order))
            balanced = [b for b in moving.tolist() if self.actions is None or b not in self.actions.driven]
            right[self.order[balanced]] += forces[balanced]
        return imbalance(
            (matrix, right), (found.block, found.other, self.order, vectors), settled.unknowns[:n],
            (settled.normal_force, settled.shear_force), self.acceleration, tuple(self._mass), (self.gravity, load),
            largest,
        )  # fmt: skip

    def _energy(self, load: np.ndarray, end_shear: np.ndarray):
        energy = super()._energy(load, end_shear)
        blocks, scheme, state, dt = self.blocks, self.system.scheme, self.state, self.dt
        begun = blocks.at_rest() if state.deflection is None else state.deflection
        density = np.where(self.system.fixed, 0.0, self.density)
        angle, change = state.rotation, self.bent_by
        end = angle + self.increment[:, 2]
        after = blocks.kinetic(self.new_rates, self.velocity[:, 3:], end, density)
        had = blocks.kinetic(begun[:, 1], state.velocity[:, 3:], angle, density)
        kept = blocks.kinetic(self.rates, self.carried[:, 3:], angle, density)
        ends = self.strained + change - self.opened_by
        u0, u1 = blocks.elastic_energy(self.strained), blocks.elastic_energy(ends)
        padded = blocks.padded(change)
        cracked = float((blocks.stiffness_times(0.5 * (self.strained + ends)) * blocks.padded(self.opened_by)).sum())
        worked = float((self.bending_load * padded).sum())
        if self.actions is not None:
            worked += self.actions.deflecting_work(padded)
        if self.dashpots is not None:
            worked += self.dashpot_work
        # Work of inertia with the mean acceleration of the step: of deflection alone, and of its coupling with strains.
        rate = 2.0 / dt**2 * (change - dt * self.rates)
        mean = self.acceleration[:, 3:]
        inertia = float(density @ (blocks.basis.area * (padded * blocks.padded(rate)).sum(axis=1)))
        coupling = blocks.coupling(angle)
        inertia += float(np.einsum("b,be,bej,bj->", density, mean, coupling, padded, optimize=True))
        inertia += float(
            np.einsum("b,be,bej,bj->", density, self.increment[:, 3:], coupling, blocks.padded(rate), optimize=True)
        )
        spun = density * self.carried[:, 2] ** 2
        inertia -= float(
            np.einsum("b,bj,bj->", spun, blocks.basis.coupling[:, 0] + blocks.basis.coupling[:, 1], padded)
        )
        strained = (padded * blocks.stiffness_times(self.strained + scheme.weight * (ends - self.strained))).sum()
        strained = float(strained) - cracked
        drag = scheme.stiffness_damping + 2.0 * scheme.block_damping * np.sqrt(
            self.density * self.moments[:, 0] / (12.0 * self.system.stiffness[:, 0, 0])
        )
        bent = blocks.stiffness_times(ends - self.strained)
        damped = float((drag / dt) @ (bent * padded).sum(axis=1))
        damped += scheme.mass_damping / dt * self._mass_of(change, padded, coupling, density)
        if self.glue is not None:
            u0 += self.glue.energy()
            u1 += self.glue.energy(self.glue_change)
            strained += self.glue.work(self.glue_change, scheme.weight)
        beyond = self._work_beyond_mean(padded)
        worked -= beyond
        lost = inertia - (after - kept) + strained - (u1 - u0) - beyond
        stored = after + u1 - had - u0
        return energy._replace(
            kinetic=energy.kinetic + after,
            elastic=energy.elastic + u1,
            before=energy.before + had + u0,
            load_work=energy.load_work + worked,
            damping=energy.damping + damped,
            scheme=energy.scheme + lost,
            beyond_mean=energy.beyond_mean + beyond,
            carried=energy.carried + had - kept,
            crack_work=energy.crack_work + cracked,
            residual=energy.residual + stored - (worked - damped - lost - cracked - (had - kept)),
        )

    def _work_beyond_mean(self, padded: np.ndarray) -> float:
        """J/m: work of the loads beyond their mean over the step on the deflections ``padded`` (n_blocks, m)."""
        if self.beyond_mean is None:
            return 0.0
        loads = [
            factor * self.blocks.loads(points, edges, self.midpoint.vertices, self.angle)
            for factor, points, edges in self.beyond_mean.parts
        ]
        return float(sum((load * padded).sum() for load in loads))

    def _mass_of(self, change: np.ndarray, padded: np.ndarray, coupling: np.ndarray, density: np.ndarray) -> float:
        """Δuᵀ M Δu of deflection, with its coupling to strains counted twice."""
        own = density @ (self.blocks.basis.area * (padded * padded).sum(axis=1))
        shared = np.einsum("b,be,bej,bj->", density, self.increment[:, 3:], coupling, padded, optimize=True)
        return float(own + 2.0 * shared)

    def result(self) -> StepResult:
        result = super().result()
        deflection = np.stack([self.deflection + self.bent_by, self.new_rates], axis=1)
        memory = self.found.memory(self.settled, self._end_shear(), self._points_at_the_end())
        origin = self.state.deflection_origin
        state = replace(
            result.state, deflection=deflection, face_points=memory, deflection_origin=origin,
            crack_deflection=self.opened,
        )  # fmt: skip
        return replace(result, state=state, forces=replace(result.forces, bonds=self._bonds()))

    def _points_at_the_end(self) -> np.ndarray:
        """(n, 2) m: contact points on the vertices' blocks at the end of the step."""
        blocks = self.system.blocks
        mean = blocks.mean_vertices(self.new_vertices)
        reference, weights = blocks.affine_fit
        arm = self.new_vertices - mean[blocks.vertex_block]
        gradient = np.add.reduceat(arm[:, :, None] * weights[:, None, :], blocks.vertex_start[:-1], axis=0)
        owner, points = self.found.block, self.touching[0]
        return mean[owner] + np.einsum("nab,nb->na", gradient[owner], points - reference[owner])
