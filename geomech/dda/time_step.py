"""One step of a given length: block equations, contact states, motion of the blocks, and energy balance.

If contacts find no consistent states, or blocks move too far, `step_cutting` attempts a shorter step.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..conventions import rotate_stress
from ..model import OPEN, SLIP, STICK, Loads, State
from .contact_detection.contact_records import copied, largest_of_blocks
from .contact_detection.face_quadrature import FacePoints
from .energy_balance import (
    ContactStep,
    StepEnergy,
    StepMotion,
    StepStress,
    sliding,
    step_energies,
)
from .impacts.restitution import Rebound, RigidBlocks, Striking
from .joint_laws.coulomb_return import reserves
from .joint_laws.friction_arrest import Stopped, Unresolved, contact_speeds, dissipating, kinetic_energy, stop
from .joint_laws.penalty_springs import Springs, end_of_step, over_a_step
from .joint_laws.sheared_stick import settle_sheared_sticks
from .kinematics.constraints import balanced, hold, with_rigid_motion
from .kinematics.midpoint_configuration import MidpointConfiguration
from .kinematics.newmark import (
    BlockLoads,
    BlockMass,
    BlockStart,
    CrackTerms,
    Outlines,
    advance,
    assemble_blocks,
    turned,
)
from .kinematics.rigid_blocks import mean_stress
from .kinematics.roundoff import ROUND_OFF, undecided_gaps, warn_of_roundoff
from .kinematics.simplex_integration import block_moments, mass_matrix
from .kinematics.tolerances import LITTLE
from .linear_solver import assembly
from .loads.load_vectors import AppliedForces, Inertia, generalised
from .loads.prescribed_motion import MovedBlocks
from .loads.step_actions import BeyondMean, StepActions, beyond_mean, effective_gravity
from .loads.viscous_boundary import ViscousEdges
from .open_close.augmented_lagrangian import settle_augmented
from .open_close.contact_set import ContactSet
from .open_close.equations import Equations, Unsettled
from .open_close.iteration import settle
from .open_close.settled_states import Settled
from .out_of_balance import imbalance
from .results import CrackResponse, StepResult

if TYPE_CHECKING:
    from .interfaces import SteppedSystem
    from .joint_laws.nonlinear_laws import NonlinearLaws

#: Most repetitions of a step to find the parts of joint faces in contact. Few steps need more than four.
_PLACED = 20
#: Most repetitions to find the ends of faces that carry the cohesion of the whole face.
_SHARED = 8
#: Most repetitions for the gaps of rotating blocks, and accuracy of these relative to the contacts' ``precision`` in
#: dynamics; a hundredth of that in statics, where contacts store little energy, and springs of 40 E' turn an error of the
#: gap into energy (for leaning slabs, at a tenth of the precision, as much in one step as the work of all loads). Operator
#: splitting balances forces less exactly than that.
_BENDS, _KNOWN = 4, 0.1


#: Most corrections of blocks that overlap after an impact because of other impacts.
_LANDINGS = 4


@dataclass(eq=False)
class Impact:
    """Effect of the impacts in a step so far.

    without  (n_blocks, 6)   velocities without impacts
    moved    (n_blocks, 6)   displacements in addition to those of the step
    lost, frictional         J/m dissipated by restitution and by friction
    """

    without: np.ndarray
    moved: np.ndarray
    lost: float = 0.0
    frictional: float = 0.0

    @classmethod
    def none(cls, velocity: np.ndarray) -> Impact:
        return cls(velocity, np.zeros_like(velocity))

    def add(self, rebound: Rebound) -> None:
        self.moved[:, :3] += rebound.moved
        self.lost += rebound.lost
        self.frictional += rebound.frictional


@dataclass(frozen=True, eq=False)
class StepStart:
    """Data common to all attempts at a step.

    state                      at the end of the last step
    vertices  (n_vertices, 2)  its vertices, m
    carried   (n_blocks, 6)    initial velocity of the step
    moments   (n_blocks, 6)    of the blocks (`block_moments`)
    gravity   (2,)             m/s² at the end of the requested step
    loads, crack               loads, and response of cracks; None without
    load_time                  time at which loads are taken, s; None: the time at which the scheme weights them
    rest      (n_blocks, 6)    displacement in a static step about which inertia acts (`pseudo_inertia`); None: zero
    bonds_give                 whether overloaded bonds break if contacts find no states with them
    """

    state: State
    vertices: np.ndarray
    carried: np.ndarray
    moments: np.ndarray
    gravity: np.ndarray
    loads: Loads = field(default_factory=Loads)
    crack: CrackResponse | None = None
    load_time: float | None = None
    rest: np.ndarray | None = None
    bonds_give: bool = False


class Attempt:
    """A step of ``system`` by ``dt`` from ``start`` with the contacts ``found``, after ``cuts`` attempts at longer
    ones. Raises `Unsettled` if contacts find no consistent states."""

    #: Class of the equations from which contact states are found.
    equations: type[Equations] = Equations
    #: Most repetitions for the gaps of rotating blocks, and for the cohesion of whole faces.
    bends, shares = _BENDS, _SHARED

    def __init__(self, system: SteppedSystem, start: StepStart, dt: float, found: ContactSet, cuts: int) -> None:
        self.system, self.state, self.vertices = system, start.state, start.vertices
        self.carried, self.moments, self.rest = start.carried, start.moments, start.rest
        self.dt, self.found, self.cuts, self.bonds_give, scheme = dt, found, cuts, start.bonds_give, system.scheme
        state, moments, crack = start.state, start.moments, start.crack
        self.time = state.time + dt
        # The mass is constant, whereas strain changes the area.
        self.density = system.mass / moments[:, 0]
        self.n_free = len(system.moving)
        compliance, offset = self._crack_response(crack)
        self.cracks = CrackTerms(
            crack is not None, np.ascontiguousarray(state.crack_strain),
            np.ascontiguousarray(compliance, dtype=float), np.ascontiguousarray(offset, dtype=float),
        )  # fmt: skip
        self.stress = np.array(state.stress)
        if system.taken_out is not None:
            # The stored energy of excavated blocks, and of their cracks, is removed in the first step without them.
            self.stress[system.taken_out] = 0.0
            self.cracks = self.cracks.without(system.taken_out)
        self.iterations = 0
        #: (6 n_free,) motion of a static step as found last, with other contact areas or arcs; None before.
        self.earlier: np.ndarray | None = None
        self.earlier_forces: np.ndarray | None = None
        #: J/m, kinetic energy of the mean velocity of a static step, which is not carried over.
        self.dropped = 0.0
        if not scheme.static and found.tried is None and len(found):
            self.found = found.expecting(*self._expected_states())
        self._edges_along: tuple[np.ndarray | None, np.ndarray] = None, np.zeros((0, 2))
        predicted = self._predicted()
        self._place(predicted)
        if scheme.place == 1.0 and predicted is not None:
            # About the end of the step the arc is long, but as accurate as the lever arms.
            self._follow(predicted, self.midpoint.vertices)
        for bends in range(self.bends, -1, -1):
            self._act(start.loads, start.load_time)
            self._assemble()
            self._absorb(start.loads, start.load_time)
            self._settle()
            if not bends or not self._update_arcs():
                break
        self._move()

    def _crack_response(self, crack: CrackResponse | None) -> tuple[np.ndarray, np.ndarray]:
        """Compliance (n_blocks, 3, 3) and offset (n_blocks, 3) of the cracks of first-order blocks."""
        if crack is None:
            return self.system.no_compliance, self.system.no_offset
        return crack.compliance[:, :3, :3], crack.offset[:, :3]

    def _expected_states(self) -> tuple[np.ndarray, np.ndarray]:
        """States and senses of sliding (n,) with which open–close iterations begin: those carried over, except for
        contacts whose blocks separate, meet or slide so fast that preventing it in a step would take more force than
        the largest one on them."""
        found, system = self.found, self.system
        centroid = np.ascontiguousarray(self.moments[:, 1:3])
        apart, along = contact_speeds(found, found.geometry, self.carried, centroid).T
        mass = np.where(system.fixed, np.inf, system.mass)
        largest = np.where(system.fixed, np.inf, 0.0)
        largest_of_blocks(found.normal, found.block, found.other, largest)
        least = np.minimum(mass[found.block], mass[found.other]), np.minimum(largest[found.block], largest[found.other])
        fast, slides = (least[0] * np.abs(speed) / self.dt > least[1] for speed in (apart, along))
        after, loose = found.gap_before + self.dt * apart, found.bonded == 0
        parts = fast & (found.state != OPEN) & loose & (after > 0.0)
        closed = np.where(found.state == OPEN, fast & (after < 0.0), ~parts)
        slides &= closed & loose & ((found.springs.friction > 0.0) | (found.springs.sliding > 0.0))
        state = np.where(slides, SLIP, np.where(closed, np.where(found.state == OPEN, STICK, found.state), OPEN))
        return state, np.where(slides, -np.sign(along), np.where(parts, 0.0, found.direction))

    def _predicted(self) -> np.ndarray | None:
        """(n_blocks, 6) displacement of this step at its initial velocity; None in statics."""
        system = self.system
        if system.scheme.static or not self.n_free:
            return None
        return self.dt * system.scheme.begun(self.carried, self.state.acceleration, self.dt)[0]

    def _place(self, increment: np.ndarray | None) -> None:
        """Let the forces of the step act on the midpoint configuration of ``increment`` (n_blocks, 6)."""
        system = self.system
        self.midpoint = MidpointConfiguration.of(
            increment, system.scheme.place, self.vertices, system.owner, self.moments
        )
        self.turn = np.zeros(len(self.moments)) if self.midpoint.turn is None else self.midpoint.turn

    def _act(self, loads: Loads, load_time: float | None) -> None:
        """Set the forces, prescribed motion and bolts of this step."""
        system, state, scheme, dt, midpoint = self.system, self.state, self.system.scheme, self.dt, self.midpoint
        acting = state.time + scheme.weight * dt if load_time is None else load_time
        self.gravity = effective_gravity(
            loads, state.time, acting, dt, scheme.static, scheme.ahead(state.acceleration, dt)
        )
        self.points, self.edges = system.load_map.rows(loads, acting, midpoint.vertices, state.rotation + self.turn)
        self.load = midpoint.loads_back(generalised(self.points, self.edges, midpoint.centroid))
        self._taken = loads, acting, (self.gravity, self.points, self.edges)
        self.actions = self._actions(loads, self.time if load_time is None else load_time)

    def _actions(self, loads: Loads, end: float) -> StepActions | None:
        """Prescribed motion and bolts of ``loads`` until ``end``, s; None if there are none."""
        system = self.system
        moved = MovedBlocks(system.blocks, system.fixed, system.taken_out)
        return StepActions.of(moved, loads, self.state, system.load_map, self.midpoint, system.free, end)

    def _assemble(self) -> None:
        """Assemble the block equations without contacts."""
        system, scheme, found, dt = self.system, self.system.scheme, self.found, self.dt
        self.begun, self.heavier = scheme.begun(self.carried, self.state.acceleration, dt)
        linked = None if self.actions is None else self.actions.linked
        self.pattern = system.pattern_of(found.block, found.other, self.moments, linked) if self.n_free else None
        self.order = system.free if self.pattern is None else self.pattern.order
        if self.pattern is not None and self.pattern.solver is not None:
            many = self.n_free >= system.settings.contact_solver.single_precision_only
            self.pattern.solver.single_only = many and not scheme.static
        self.matrix, self.right, self.tangent, self.stress0 = assemble_blocks(
            self.order, self.n_free, tuple(self._mass),
            tuple(BlockStart(self.begun, self.stress, system.stiffness, system.compliance)), tuple(self.cracks),
            tuple(BlockLoads(self.gravity, self.load)), tuple(scheme.terms(dt, self.heavier)),
        )  # fmt: skip
        if self.rest is not None:
            self.right += self._inertia_of(self.rest)

    def _inertia_of(self, increment: np.ndarray) -> np.ndarray:
        """(n_free, 6) forces of inertia 2M d/dt² against the ``increment`` (n_blocks, 6) of a static step, in the rows of
        its equations."""
        moving = self.system.moving
        mass = mass_matrix(self.moments[moving], self.density[moving])
        force = 2.0 / self.dt**2 * np.einsum("nab,nb->na", mass, increment[moving])
        force[:, 2:] /= np.sqrt(self.moments[moving, :1])
        out = np.empty_like(force)
        out[self.order[moving]] = force
        return out

    def inertia_and_size(self) -> tuple[np.ndarray, np.ndarray]:
        """(n_blocks,) N each: largest inertia force (moment over √area) on each block in a static step, and sum of the
        magnitudes of all forces on it; 0 on fixed blocks."""
        found, settled, order, moving = self.found, self.settled, self.order, self.system.moving
        counted = self.increment if self.rest is None else self.increment - self.rest
        inertia, size = np.zeros(len(order)), np.zeros(len(order))
        rows = order[moving]
        inertia[moving] = np.abs(self._inertia_of(counted)[rows]).max(axis=1)
        push = np.hypot(settled.normal_force, settled.shear_force)
        for blocks in (found.block, found.other):
            np.add.at(size, blocks, push)
        size[moving] += np.abs(self.right[rows]).max(axis=1)
        return inertia, size

    @property
    def _mass(self) -> BlockMass:
        return BlockMass(self.density, self.moments, self.system.fixed)

    def _absorb(self, loads: Loads, load_time: float | None) -> None:
        """Add the dashpots of viscous boundaries."""
        system, state = self.system, self.state
        self.quiet = None
        if loads.viscous_boundaries and not system.scheme.static and self.n_free:
            time = state.time + 0.5 * self.dt if load_time is None else load_time
            self.quiet = ViscousEdges.of(
                loads.viscous_boundaries, system.blocks, self.midpoint.vertices, time, system.density, system.stiffness,
                self._without_dashpots,
            )  # fmt: skip
            self.quiet.assemble(self.matrix, self.right, self.order, self.midpoint, self.dt)

    @property
    def _without_dashpots(self) -> np.ndarray:
        """(n_blocks,) bool: blocks whose edges have no dashpots in `quiet`."""
        return self.system.fixed

    def _constrained(self) -> np.ndarray | None:
        """(n_blocks, 6) bool: constrained unknowns of this step; None without any."""
        system, actions, constrained = self.system, self.actions, self.system.constrained
        alone = system.scheme.static and system.blocks.n_blocks == 1 and self.n_free and actions is None
        if alone:
            weight = system.mass[0] * self.gravity
            if balanced(self.load[0], self.points, self.edges, weight, self.moments[0]):
                constrained = with_rigid_motion(constrained)
        return constrained if actions is None else actions.constrained(constrained)

    def _settle(self) -> None:
        """Find contact states and unknowns; repeated with other contact areas of faces with a stiffness until these
        agree."""
        actions, found, order, midpoint = self.actions, self._first_contacts(), self.order, self.midpoint
        constrained = self._constrained()
        own, shared = (self.matrix, self.right), 0
        for tries in range(1, 2 * _PLACED + 1):
            if found.points is not None or tries > 1:
                self.matrix, self.right = own[0].copy(), own[1].copy()
            springs, gap, weight, curved = self._over_the_step(found)
            striking = self._striking(found)
            if striking is not None:
                gap = striking.apart(gap, self.system.half_diagonal)
            geometry = midpoint.contacts(found.geometry, found.block, found.other, self.along_edges(found))
            vectors = assembly.contact_vectors(found.block, found.other, geometry, order, midpoint.moments)
            midpoint.turn_back(vectors, found.block, found.other, geometry)
            if found.points is not None:
                found.points.share_shear(vectors, found.block)
            if constrained is not None and self.n_free:
                hold(constrained, self.matrix, self.right, vectors, found.block, found.other, order)
            if not self.n_free:
                zero, self.slack = np.zeros(len(found)), np.full(len(found), self.system.rounding)
                settled = Settled(
                    np.zeros((0, 6)), found.state, zero, found.bonded, zero, zero, zero, zero, zero, found.springs, 0
                )
                unknowns = settled.unknowns
            elif actions is None:
                settled = self._settled(self.pattern, self.matrix, self.right, found, gap, vectors, springs, curved)
                unknowns = settled.unknowns
            else:
                assert self.pattern is not None  # blocks are free
                solve = partial(self._settled, vectors=vectors, springs=springs, curved=curved)
                settled, unknowns = actions.settle(
                    self.pattern, self.matrix, self.right, vectors, geometry, found, gap, solve
                )
            self.iterations += settled.iterations
            if self.system.scheme.static:
                self.earlier = settled.unknowns.ravel()
                self.earlier_forces = np.stack([settled.normal_force, settled.shear_force], axis=1)
            if striking is not None:
                settled = striking.back(settled, self.system.half_diagonal)
            better = found.misplaced(settled)
            if better is None and shared < self.shares:
                sharing = found.sharing_cohesion(settled.state, settled.bonded)
                better, shared = (None if sharing is found else sharing), shared + 1
            if better is None:
                break
            if tries % _PLACED == 0:
                # If contact areas alternate at any step length, these faces are supported at their corners in this
                # step.
                better = found.cornered(better)
            found = better.trying_again(settled)
        else:
            raise Unsettled("the contact areas of faces did not converge")
        self.found, self.settled, self.unknowns = found, settled, unknowns
        self.vectors, self.weight, self.acting, self.striking = vectors, weight, geometry, striking

    def _first_contacts(self) -> ContactSet:
        """The contacts with which the search for their states begins."""
        return self.found

    def _striking(self, found: ContactSet) -> Striking | None:
        """The contacts of ``found`` at which blocks may collide with a coefficient of restitution."""
        restitution = self.system.finder.restitution(found)
        if restitution is None or self.system.scheme.static or not len(found) or not self.n_free:
            return None
        rigid = self.carried.copy()
        rigid[:, 3:] = 0.0
        centroid = np.ascontiguousarray(self.moments[:, 1:3])
        speed = contact_speeds(found, found.geometry, rigid, centroid)
        return Striking.of(found, restitution, speed, float(np.hypot(*self.gravity)) * self.dt)

    def _update_arcs(self) -> bool:
        """Update the gaps of contacts to those of the actual motion, and in dynamics the midpoint configuration; False
        if they are already known accurately enough."""
        system, found, settled = self.system, self.found, self.settled
        if not len(found) or not self.n_free:
            return False
        exact = system.scheme.static and system.reach is None
        known = (LITTLE if exact else _KNOWN) * found.precision
        # A point that rotates by r while it moves by d deviates from its chord by at most r d.
        increment = self._increment(self.unknowns)
        if 2.0 * np.abs(increment[:, 2]).max() * system.step_limit < known.min():
            return False
        vertices = self._advanced(increment)[0]
        straight = settled.gap + settled.lifted + found.lift - found.arc
        if isinstance(found.points, FacePoints):
            straight = found.points.gap_at_corners(straight)
        gap = system.finder.gaps(vertices, self.vertices, found.on_corners)
        arc, before = gap - straight, found.on_corners.arc
        some = (settled.state != OPEN) | (gap < 0.0)
        if not (np.abs(arc - before) > known)[some].any():
            return False
        tried = found.rows(settled)
        if not system.scheme.static:
            self._place(increment)
        self._follow(increment, vertices)
        # In statics bonds are checked with the blocks in place: on the arcs of a block that has flown off, all would
        # seem intact.
        self.found = self.found.trying(tried, without_lost=system.scheme.static)
        return True

    def _follow(self, increment: np.ndarray, vertices: np.ndarray) -> None:
        """Set the arcs of the contacts for the motion ``increment`` (n_blocks, 6) to ``vertices``: the parts of gaps
        and of motion along edges that the equations in the midpoint configuration do not contain."""
        system, found, scaled = self.system, self.found.on_corners, increment.copy()
        if not len(found):
            return
        blocks, all_blocks = (found.block, found.other), np.arange(len(increment))
        scaled[:, 2:] *= np.sqrt(self.moments[:, :1])
        along = self.along_edges(found)
        geometry = self.midpoint.contacts(found.geometry, *blocks, along)
        vectors = assembly.contact_vectors(*blocks, geometry, all_blocks, self.midpoint.moments)
        self.midpoint.turn_back(vectors, *blocks, geometry)
        across, slid = (sliding(vectors, scaled, all_blocks, *blocks, way) for way in (0, 1))
        end = MidpointConfiguration.of(increment, 1.0, self.vertices, system.owner, self.moments)
        travelled = end.contacts(found.geometry, *blocks, along)[:, 0] - found.geometry[:, 0]
        arc = system.finder.gaps(vertices, self.vertices, found) - found.geometry[:, 3] - across
        self.found = self.found.along(arc, travelled * np.hypot(*along.T) - slid)

    def along_edges(self, found: ContactSet) -> np.ndarray:
        """(n, 2) m: the edges of ``found``."""
        edge, along = self._edges_along
        if found.edge is not edge:
            along = self.vertices[self.system.next[found.edge]] - self.vertices[found.edge]
            self._edges_along = found.edge, along
        return along

    def _over_the_step(self, found: ContactSet) -> tuple[Springs, np.ndarray, float | np.ndarray, NonlinearLaws | None]:
        """Contacts ``found`` over the step: springs, starting gaps (n,), weight of the end of the step, nonlinear laws."""
        system = self.system
        curved = system.finder.curved(found)
        # Multipliers are forces at the end of the step.
        weight: float | np.ndarray = 1.0 if system.allowed_penetration else system.scheme.weight
        if curved is not None and weight != 1.0:
            # Tangents of nonlinear laws refer to the end of the step.
            each = np.full(len(found), weight)
            each[curved.rows] = 1.0
            weight = each
        mass = np.where(system.fixed, np.inf, system.mass)
        springs, gap = over_a_step(
            found.springs, np.ascontiguousarray(found.gap_before), (found.state != OPEN) & (found.bonded > 0),
            np.minimum(mass[found.block], mass[found.other]), weight, system.scheme.block_damping, self.dt, found.arc,
        )  # fmt: skip
        return springs, gap, weight, curved

    @property
    def _most_iterations(self) -> int:
        """Open–close iterations after which the step is shortened."""
        return self.system.settings.max_open_close_iterations

    def _settled(self, pattern, matrix, right, found, gap, vectors, springs, curved) -> Settled:
        system = self.system
        # In statics the loads at which contact states change are found to round-off.
        slack = self.slack = (
            np.full(len(found), system.rounding)
            if system.scheme.static
            else undecided_gaps(system.rounding, right, pattern.order, found.block, found.other, springs.normal)
        )
        if ROUND_OFF not in system.warned:
            system.warned.add(ROUND_OFF)
            weight = np.where(system.fixed, np.inf, system.mass * np.hypot(*self.gravity))
            warn_of_roundoff(system.rounding, weight, found.block, found.other, springs.normal, system.finder.names)

        def solve(contacts: ContactSet, stiff: Springs, start: np.ndarray, stretch: np.ndarray) -> Settled:
            def settled(contacts: ContactSet) -> Settled:
                further = self._further_equations(pattern, matrix, right, contacts, vectors)
                equations = self.equations(
                    pattern=pattern, matrix=matrix, found=contacts, vectors=vectors, springs=stiff, gap=start,
                    slack=slack, curved=curved, statics=system.scheme.static, **further,
                )  # fmt: skip
                limits = system.settings
                return settle(
                    equations, self._most_iterations, limits.contact_solver, self.bonds_give
                )  # fmt: skip

            return (
                settle_sheared_sticks(settled, contacts, stiff, start, stretch, curved)
                if stretch.any()
                else settled(contacts)
            )

        found = replace(found, stretch=found.stretch + found.swing)
        if not system.allowed_penetration or not len(found):
            return solve(found, springs, gap, found.stretch)
        return settle_augmented(solve, found, springs, gap, system.finder.on_penalty(found), system.allowed_penetration)

    def _further_equations(self, pattern, matrix, right, contacts, vectors) -> dict[str, Any]:
        """Fields of `equations` that depend on further unknowns; ``right`` (n_free, 6) is the right-hand side of the
        first six."""
        return {
            "right": right, "expected": self._expected_unknowns(), "earlier": self.earlier,
            "earlier_forces": self.earlier_forces, "reach": self.system.reach if self.system.scheme.static else None,
        }  # fmt: skip

    def _expected_unknowns(self) -> np.ndarray | None:
        """(6 n_free,) displacement of this step at its initial velocity, in the unknowns of `assembly`; None in
        statics."""
        if self.system.scheme.static:
            return None
        moving = self.system.moving
        increment = self.dt * self.carried[moving]
        increment[:, 2:] *= np.sqrt(self.moments[moving, :1])
        out = np.empty_like(increment)
        out[self.order[moving]] = increment
        return out.ravel()

    def _increment(self, unknowns: np.ndarray) -> np.ndarray:
        """(n_blocks, 6) displacements of all blocks in the step."""
        system, increment = self.system, np.zeros((self.system.blocks.n_blocks, 6))
        increment[system.moving] = unknowns[self.order[system.moving]]
        increment[:, 2:] /= np.sqrt(self.moments[:, :1])
        if self.actions is not None and self.actions.imposed is not None:
            increment += self.actions.imposed.increment
        return increment

    def _advanced(self, increment: np.ndarray):
        """The result of `advance`."""
        system = self.system
        outlines = Outlines(self.vertices, system.vertex_start, self.moments)
        return advance(
            increment, self.carried, tuple(outlines), self.tangent, self.stress0, tuple(self.cracks), system.turns, self.dt,
            system.scheme.static,
        )  # fmt: skip

    def _move(self) -> None:
        """Move the blocks; compute velocities, stresses and accelerations at the end of the step."""
        scheme, found, dt = self.system.scheme, self.found, self.dt
        carried, actions = self.carried, self.actions
        increment = self._increment(self.unknowns)
        imposed = None if actions is None else actions.imposed
        self.new_vertices, velocity, self.new_stress, self.new_crack, self.largest = self._advanced(increment)
        if self.quiet is not None:
            absorbed = self.quiet.rows(increment, self.midpoint, dt)
            self.edges = np.concatenate([self.edges, absorbed])
            self.load = self.load + self.midpoint.loads_back(
                generalised(self.points[:0], absorbed, self.midpoint.centroid)
            )
        begun = carried * dt if self.rest is None else self.rest
        acceleration = 2.0 * (increment - begun) / (dt * dt)
        before = self._remembered(acceleration)
        velocity, self.kept = scheme.corrected(velocity, before, acceleration, increment[:, 2], dt)
        if self.heavier != 1.0:
            acceleration = 2.0 * self.heavier * (increment - self.begun * dt) / (dt * dt)
        self.slid = sliding(self.vectors, self.settled.unknowns, self.order, found.block, found.other, 1)
        if actions is not None and self.n_free:
            self.slid += actions.along
        self.frictional = 0.0
        if imposed is not None:
            imposed.correct_velocity(velocity)
        self.increment, self.velocity, self.acceleration = increment, velocity, acceleration
        self.impact: Impact | None = None
        if not scheme.static and self.n_free:
            self._stop(imposed)
            if self.striking is not None:
                self._rebound(imposed)

    def path(self, after: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n_vertices, 2) twice, m: corners before the step, and after it, given its vertices ``after``."""
        return self.vertices, after

    def _remembered(self, mean: np.ndarray) -> np.ndarray | None:
        """(n_blocks, 6) initial acceleration of the step, as far as it is still valid; None before there is any.

        If a contact has opened or closed, it includes forces that no longer act, or lacks new ones. The part of a
        spring that the step does not resolve, k dt² > m, is noise that can grow from bounce to bounce. For the blocks
        of such contacts it is replaced by the ``mean`` acceleration of the step, with which no step gains energy.
        """
        before, system = self.state.acceleration, self.system
        if before is None or system.scheme.alpha or not system.scheme.memory:
            return before
        found, closed = self.found, self.settled.state != OPEN
        changed = np.where(closed, (found.state == OPEN) & (found.gap_before >= 0.0), found.state != OPEN)
        stiffness = np.where(closed, found.springs.normal, 0.0) * self.dt**2
        before = before.copy()
        for blocks in (found.block, found.other):
            forgets = blocks[changed | (stiffness > system.mass[blocks])]
            before[forgets] = mean[forgets]
        return before

    def _stop(self, imposed) -> None:
        """Remove unresolved motion from the velocity (`friction_arrest`), and record its energy (J/m)."""
        system, found, velocity = self.system, self.found, self.velocity
        mass = np.where(system.fixed, np.inf, system.mass)
        if not len(found):
            return
        end = MidpointConfiguration.of(self.increment, 1.0, self.vertices, system.owner, self.moments)
        geometry = end.contacts(found.geometry, found.block, found.other, self.along_edges(found))
        speeds = contact_speeds(found, geometry, velocity, end.centroid)
        stopped = Stopped.of(found, self.settled, self.slid, speeds[:, 1], mass, self.dt, system.rounding)
        unresolved = Unresolved.of(found, self.settled, self.slid, speeds, mass, self.dt)
        if stopped is None and unresolved is None:
            return
        assert self.pattern is not None  # blocks that touch are free, or nothing is stopped
        try:
            change, frictional = stop(
                stopped, unresolved, self.pattern, self.matrix, self.vectors, found, self.settled, self.dt
            )  # fmt: skip
        except np.linalg.LinAlgError as error:
            raise Unsettled(str(error)) from error
        if imposed is not None:
            change = imposed.free_part(change, self.order)
        rates = np.zeros_like(velocity)
        rates[system.moving] = change[self.order[system.moving]] * (2.0 / self.dt)
        rates[:, 2:] /= np.sqrt(self.moments[:, :1])
        rates, taken = dissipating(
            turned(rates, self.increment[:, 2]), velocity, self.moments, self.density, system.fixed
        )
        self.velocity, self.frictional = velocity + rates, min(max(frictional, 0.0), taken)

    def _rebound(self, imposed) -> None:
        """Apply the impacts of blocks that collide in the step (`impacts`)."""
        found, striking = self.found, self.striking
        assert striking is not None
        gap = self._gaps_now()
        struck = striking.closed(gap)
        if not struck.any():
            return
        impact = Impact.none(self.velocity)
        blocks = self._rigid_blocks(self.increment, imposed)
        self._strike(impact, striking.rebound(found, self.settled, struck, gap, blocks, self.dt))
        for _ in range(_LANDINGS):
            gap = self._gaps_now()
            struck = striking.closed(gap + self.system.rounding)
            if not struck.any():
                break
            blocks = self._rigid_blocks(self.increment + impact.moved, imposed)
            self._strike(impact, striking.landed(found, self.settled, struck, gap, blocks))
        self.impact = impact

    def _gaps_now(self) -> np.ndarray:
        """(n,) m, gaps of the contacts at the end of the step, from where faces meet."""
        found = self.found.on_corners
        return self.system.finder.gaps(self.new_vertices, self.vertices, found) - found.lift

    def _strike(self, impact: Impact, rebound: Rebound) -> None:
        """Add ``rebound`` to the impacts of the step."""
        impact.add(rebound)
        self.velocity = self.velocity.copy()
        self.velocity[:, :3] = rebound.velocity
        self.new_vertices, _, self.new_stress, self.new_crack, self.largest = self._advanced(
            self.increment + impact.moved
        )

    def _rigid_blocks(self, increment: np.ndarray, imposed) -> RigidBlocks:
        """The blocks as rigid bodies after ``increment`` (n_blocks, 6)."""
        system, moments, found = self.system, self.moments, self.found
        inertia = self.density * (moments[:, 3] + moments[:, 4])
        inverse = 1.0 / np.stack([system.mass, system.mass, inertia], axis=1)
        inverse[system.fixed] = 0.0
        if system.constrained is not None:
            inverse[system.constrained[:, :3]] = 0.0
        if imposed is not None:
            inverse[imposed.driven] = 0.0
        end = MidpointConfiguration.of(increment, 1.0, self.vertices, system.owner, moments)
        geometry = end.contacts(found.geometry, found.block, found.other, self.along_edges(found))
        return RigidBlocks(
            end.centroid, inverse, self.velocity[:, :3], self.carried[:, :3], increment[:, 2], geometry[:, 1:3],
            geometry[:, 5:7],
        )  # fmt: skip

    def result(self) -> StepResult:
        """Results of the step."""
        system, scheme, found, settled = self.system, self.system.scheme, self.found, self.settled
        actions, gravity, midpoint = self.actions, self.gravity, self.midpoint
        acting = self.acting
        if found.points is not None:
            corners = found.on_corners
            acting = midpoint.contacts(found.points.corners, corners.block, corners.other, self.along_edges(corners))
        rows = found.rows(settled, acting)
        reaction, acting_right, largest_force = None, self.right, 0.0
        acted: dict[str, float] = {}
        points, load = self.points, self.load
        if actions is not None:
            points, reaction, acted = actions.acted(settled, self.unknowns, rows, points, self.new_vertices)
            acting_right, largest_force = actions.with_bolt_forces(self.right), actions.largest_bolt_force
            load = midpoint.loads_back(generalised(points, self.edges, midpoint.centroid))
            load = load + actions.work_forces(reaction, rows, midpoint.centroid)
        end_shear = self._end_shear()
        energy = self._energy(load, end_shear)
        residual, ratio = self._imbalance(acting_right, load, largest_force)
        acceleration, beyond = self._acceleration_and_overstress()
        inertia = Inertia(self.density, gravity, acceleration, self.carried[:, 2], system.fixed)
        forces = AppliedForces(
            points, self.edges, midpoint.centroid, self.moments[:, 0].copy(), inertia, reaction, beyond
        )  # fmt: skip
        memory = rows
        if scheme.weight != 1.0 or found.points is not None:
            # Each spring inside a face continues with its own share of the shear force.
            memory = copied(rows)
            memory["shear_force"] = found.shear_of_rows(end_shear)
        new_state = self._new_state(memory, self._new_stresses(rows, load, reaction))
        reserve = reserves(
            settled.state, settled.bonded, settled.normal_force, settled.shear_force, settled.gap, settled.springs,
            self.slack,
        )  # fmt: skip
        statistics = self._statistics(energy, residual, ratio) | acted
        return StepResult(
            new_state, self.dt, rows, forces, acceleration, energy, found.of_rows(reserve), midpoint.vertices, self.turn,
            found.arcs, statistics, self._worst_overlap() if energy.overlap > 0.0 else None,
        )  # fmt: skip

    @property
    def _rotation(self) -> np.ndarray:
        """(n_blocks,) rad, rotation in the step, including that of its impacts."""
        turn = self.increment[:, 2]
        return turn if self.impact is None else turn + self.impact.moved[:, 2]

    def _new_stresses(self, rows: np.ndarray, load: np.ndarray, reaction: np.ndarray | None) -> np.ndarray:
        """(n_blocks, 3) Pa, stress at the end of the step; of rigid blocks the mean stress of the contacts ``rows``,
        ``load`` and ``reaction`` (n_blocks, 6)."""
        system, midpoint, stress = self.system, self.midpoint, self.new_stress
        if len(system.rigid):
            from_outside = load.copy()
            if reaction is not None:
                # The forces that constrain the strains of a rigid block are part of its stress.
                from_outside[:, 3:] -= reaction[:, 3:]
            stress[system.rigid] = mean_stress(
                system.rigid, rows, from_outside, BlockMass(self.density, midpoint.moments, system.fixed),
                self.acceleration, self.carried[:, 2], self.turn, self._rotation,
            )  # fmt: skip
        if system.taken_out is not None:
            stress[system.taken_out] = 0.0
        return stress

    def _acceleration_and_overstress(self) -> tuple[np.ndarray, np.ndarray | None]:
        """(n_blocks, 6) acceleration with mass damping, and (n_blocks, 3) Pa of `TimeScheme.overstress`, None in statics;
        both on the axes of the midpoint."""
        system, scheme, dt, midpoint = self.system, self.system.scheme, self.dt, self.midpoint
        acceleration, beyond = self.acceleration, None
        if scheme.mass_damping:
            acceleration = acceleration + scheme.mass_damping / dt * self.increment
        if not scheme.static:
            beyond = scheme.overstress(
                self.increment[:, 3:], self.tangent, self.stress0 - self.stress, system.stiffness, system.mass, dt
            )
        if midpoint.turn is not None:
            acceleration = turned(acceleration, midpoint.turn)
            beyond = None if beyond is None else rotate_stress(beyond, midpoint.turn)
        return acceleration, beyond

    def _new_state(self, memory: np.ndarray, stress: np.ndarray) -> State:
        """The state at the end of the step, with the CONTACT rows ``memory`` and ``stress`` (n_blocks, 3)."""
        system, state, actions = self.system, self.state, self.actions
        imposed = None if actions is None else actions.imposed
        return State(
            time=self.time,
            vertices=self.new_vertices,
            velocity=self.velocity,
            stress=stress,
            rotation=state.rotation + self._rotation,
            crack_strain=self.new_crack,
            contacts=system.finder.carried(self.new_vertices, memory),
            acceleration=self.kept,
            bolts=state.bolts if actions is None else actions.memory,
            imposed=state.imposed if imposed is None else imposed.totals,
            removed=system.taken_out,
        )

    def _statistics(self, energy: StepEnergy, residual: float, ratio: float) -> dict[str, float]:
        """`StepResult.statistics` of the step, without those of bolts and reactions."""
        settled = self.settled
        return {
            "open_close_iterations": self.iterations,
            "dt": self.dt,
            "step_cuts": self.cuts,
            "kinetic_energy": energy.kinetic + self.dropped,
            "elastic_energy": energy.elastic,
            "contact_energy": energy.contact,
            "worst_penetration": _deepest(settled.state != OPEN, self.found.gap_before, settled.gap),
            "max_displacement_ratio": self.largest / self.system.half_diagonal,
            "unbalanced": residual,
            "unbalanced_ratio": ratio,
        }

    def _end_shear(self) -> np.ndarray:
        """(n,) N shear forces of contacts at the end of the step."""
        settled = self.settled
        return end_of_step(self.found.shear, settled.shear_force, settled.state == STICK, self.weight)

    def _imbalance(self, right: np.ndarray, load: np.ndarray, largest: float) -> tuple[float, float]:
        """The result of `imbalance`."""
        found, settled = self.found, self.settled
        return imbalance(
            (self.matrix, right), (found.block, found.other, self.order, self.vectors), settled.unknowns,
            (settled.normal_force, settled.shear_force), self.acceleration, tuple(self._mass), (self.gravity, load),
            largest,
        )  # fmt: skip

    def _worst_overlap(self) -> tuple[float, int, int, float, float, float]:
        """`overlap_energy.Overlap` of the newly closed contact with the largest spring energy due to overlap."""
        found = self.found
        fresh = (found.state == OPEN) & (self.settled.state != OPEN)
        given = np.where(fresh, 0.5 * found.springs.normal * np.minimum(found.gap_before, 0.0) ** 2, 0.0)
        worst = int(np.argmax(given))
        x, y = found.geometry[worst, 5:7].tolist()
        return float(given[worst]), *found.blocks_of(worst), -float(found.gap_before[worst]), x, y

    def _energy(self, load: np.ndarray, end_shear: np.ndarray) -> StepEnergy:
        """Terms of the energy balance under the generalised ``load``; contacts end the step with ``end_shear`` (n,)."""
        system, scheme, found, settled = self.system, self.system.scheme, self.found, self.settled
        self.beyond_mean = self._beyond_mean()
        weight = self.weight if isinstance(self.weight, np.ndarray) else np.full(len(found), self.weight)
        impact, velocity = self.impact, self.velocity if self.impact is None else self.impact.without
        normal, shear = self._real_springs()
        means = settled.normal_force, settled.shear_force
        if scheme.static:
            means = 0.5 * (found.normal + means[0]), 0.5 * (found.shear + means[1])
        motion = StepMotion(self.increment, self.state.velocity, self.carried, velocity, self.acceleration, load)
        stress = StepStress(self.stress, self.tangent, self.stress0, system.compliance, system.stiffness)
        contacts = ContactStep(
            found.state, settled.state, found.bonded, settled.bonded, found.gap_before, settled.gap,
            found.arc + np.zeros(len(found)), settled.lifted, self._crushed(), settled.slip, self.slid, settled.normal_force,
            found.shear, settled.shear_force, end_shear, *means, normal, shear, weight, found.law,
        )  # fmt: skip
        energies = step_energies(
            tuple(motion), tuple(stress), tuple(self._mass), tuple(scheme.terms(self.dt)), self.gravity, tuple(contacts),
            system.finder.closure,
        )  # fmt: skip
        energy = StepEnergy(*energies.tolist())
        if scheme.static:
            # No velocity is carried over: the work of inertia is lost within the step.
            self.dropped = energy.kinetic
            energy = energy._replace(
                kinetic=0.0, before=energy.before - energy.carried, carried=0.0, scheme=energy.scheme + energy.kinetic
            )
        if impact is not None:
            end = block_moments(self.new_vertices, system.next, system.vertex_start)
            kinetic = kinetic_energy(self.velocity, end, system) - kinetic_energy(velocity, end, system)
            moved = impact.moved[~system.fixed]
            fallen = float(system.mass[~system.fixed] @ (moved[:, :2] @ self.gravity))
            pulled = float((load[~system.fixed] * moved).sum())
            energy = energy._replace(
                kinetic=energy.kinetic + kinetic,
                gravity_work=energy.gravity_work + fallen,
                load_work=energy.load_work + pulled,
                friction=energy.friction + impact.frictional,
                impact=impact.lost,
                # The rest: impulses act at the end of the step, and displacements are straight.
                scheme=energy.scheme + fallen + pulled - kinetic - impact.frictional - impact.lost,
            )
        energy = self._at_mean_loads(energy)
        return energy._replace(
            before=energy.before + found.unbent + found.released,
            bond=energy.bond + found.unbent,
            breaking=self._breaking(),
            friction=energy.friction + self.frictional,
            # Elastic energy released where faces separate is a vibration that no step resolves.
            scheme=energy.scheme - self.frictional + found.released,
        )

    def _crushed(self) -> np.ndarray:
        """(n,) m: irreversible closure of faces that crush in the step."""
        return np.where(np.isfinite(self.found.springs.crushing), 0.0 - self.settled.lifted, 0.0)

    def _breaking(self) -> float:
        """`StepEnergy.breaking` of the step, J/m."""
        found, settled = self.found, self.settled
        lost = (found.bonded > 0) & (settled.bonded == 0)
        works = found.normal * (settled.gap - found.gap_before), found.shear * self.slid
        return float(sum(np.abs(work[lost]).sum() for work in works))

    def _beyond_mean(self) -> BeyondMean | None:
        """The loads that the step takes beyond their mean over it."""
        loads, acting, taken = self._taken
        at = self.midpoint.vertices, self.state.rotation + self.turn
        span = self.state.time, acting, self.dt
        return beyond_mean(loads, span, self.system.scheme.static, taken, self.system.load_map, at)

    def _at_mean_loads(self, energy: StepEnergy) -> StepEnergy:
        """``energy`` with the work of the mean loads of the step; the rest of the work belongs to the scheme."""
        if self.beyond_mean is None:
            return energy
        system, midpoint, free = self.system, self.midpoint, ~self.system.fixed
        fallen = float(system.mass[free] @ (self.increment[free, :2] @ self.beyond_mean.gravity))
        load = midpoint.loads_back(self.beyond_mean.load(midpoint.centroid))
        pulled = float((load * self.increment).sum())
        return energy._replace(
            gravity_work=energy.gravity_work - fallen,
            load_work=energy.load_work - pulled,
            scheme=energy.scheme - fallen - pulled,
            beyond_mean=energy.beyond_mean + fallen + pulled,
        )

    def _real_springs(self) -> tuple[np.ndarray, np.ndarray]:
        """Contact springs that store energy, normal and shear; multipliers store none."""
        normal, shear = self.found.springs.normal, self.settled.springs.shear
        if not self.system.allowed_penetration:
            return normal, shear
        normal_multiplier, shear_multiplier = self.system.finder.on_penalty(self.found)
        return np.where(normal_multiplier, 0.0, normal), np.where(shear_multiplier, 0.0, shear)


def _deepest(closed: np.ndarray, before: np.ndarray, after: np.ndarray) -> float:
    """Largest penetration of ``closed`` contacts at either end of the step, m."""
    return float(max(0.0, -np.minimum(before, after)[closed].min())) if closed.any() else 0.0
