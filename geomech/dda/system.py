"""A system of blocks in contact, and the step that moves it."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..model import OPEN, STICK, Blocks, DdaSettings, JointLaw, Loads, Material, State
from . import assembly
from .actions import StepActions, felt_gravity
from .augmented import settle_augmented
from .contact_springs import Springs, end_of_step, over_a_step
from .contacts import ContactFinder, ContactSet
from .energy import StepEnergy, sliding, step_energies
from .excavation import Excavations, until_next_event
from .held import balanced, hold, with_rigid_motion
from .imbalance import imbalance
from .loads import AppliedForces, Inertia, LoadMap, generalised
from .moments import block_moments
from .open_close import Settled, Unsettled, settle
from .overlap import refuse_overlap
from .rigid import mean_stress, with_rigid
from .step import CrackResponse, NotConverged, StepResult
from .step_length import StepLength
from .stopping import Stopped, dissipating, stop
from .time_integration import TimeScheme, advance, assemble_blocks, turned
from .told_contacts import ToldContacts, told_rows
from .viscous_boundary import QuietEdges

log = logging.getLogger(__name__)

#: Contacts are sought within this many times the largest displacement of a step: two blocks may approach each other.
_WINDOW = 2.2
#: No step moves a vertex by more than this part of the smallest block's size, √area, whatever the settings allow.
_BLOCK_SHARE = 0.1
#: Gaps below this many times the largest coordinate, its round-off, decide nothing.
_SLACK = 5e-16
#: A step is begun again so many times at most for where faces with a stiffness touch. Few take more than four.
_PLACED = 20
#: Multipliers are not asked to close gaps below this many times that round-off.
_FINEST = 10.0


class BlockSystem:
    """Blocks that move, deform and touch: first-order discontinuous deformation analysis (Shi 1988).

    ``joint_index(edge_name, other_name)`` gives the index in ``joints`` of the law between two edges; None from it
    means that such edges do not touch; without it the first law holds everywhere. Contact springs are
    ``settings.normal_penalty`` and ``shear_penalty`` (Pa), by default both 40 times the E' of the two blocks (`penalties`).

    Raises ValueError when materials or joints are missing or a block has no area.
    """

    def __init__(
        self,
        blocks: Blocks,
        materials: Sequence[Material],
        joints: Sequence[JointLaw] = (),
        joint_index: Callable[[str, str], int | None] | None = None,
        settings: DdaSettings | None = None,
    ) -> None:
        if blocks.n_blocks and int(np.max(blocks.material)) >= len(materials):
            raise ValueError(f"a block names material {int(np.max(blocks.material))}, but there are {len(materials)}")
        self.blocks = blocks
        self.materials = tuple(materials)
        self.joints = tuple(joints) or (JointLaw("frictionless"),)
        self.settings = settings or DdaSettings()
        self.scheme = TimeScheme.of(self.settings)
        self._load_map = LoadMap(blocks)
        self._excavations = Excavations(blocks)

        of = np.asarray(blocks.material, dtype=int)
        self.density = np.array([m.density for m in self.materials])[of]
        self._stiffness = np.ascontiguousarray(np.array([m.stiffness() for m in self.materials])[of])
        self.compliance = np.ascontiguousarray(np.array([m.compliance() for m in self.materials])[of])
        modulus = np.array([m.plane_modulus for m in self.materials])[of]
        rigid = np.array([m.rigid for m in self.materials])[of]
        joint_index = joint_index or (lambda edge_name, other_name: 0)
        self._joint_index = joint_index
        self._finder = ContactFinder(blocks, self.joints, joint_index, self.settings, modulus, rigid)
        self._take_out(None, None)
        rigid = rigid & ~self._fixed
        self._rigid = np.flatnonzero(rigid)
        self.compliance[rigid] = 0.0
        self._held = with_rigid(blocks.held, rigid)
        self._next = np.ascontiguousarray(blocks.next_vertex, np.int64)
        self._start = np.ascontiguousarray(blocks.vertex_start, np.int64)
        self._owner = np.ascontiguousarray(blocks.vertex_block, np.int64)
        self._no_compliance = np.zeros((blocks.n_blocks, 3, 3))
        self._no_offset = np.zeros((blocks.n_blocks, 3))

        vertices = blocks.vertices
        areas = blocks.areas()
        if (areas <= 0).any():
            raise ValueError(f"{blocks.names[int(areas.argmin())]}: the block has no area")
        self._mass = self.density * areas
        self.half_height = 0.5 * float(np.ptp(vertices[:, 1]))
        self._slack = _SLACK * float(np.abs(vertices).max())
        self._limit = min(
            self.settings.max_displacement_ratio * self.half_height, _BLOCK_SHARE * float(np.sqrt(areas.min()))
        )
        self._tolerance = self._allowed_penetration(float(np.sqrt(areas.min())))

    def _allowed_penetration(self, size: float) -> float:
        """m, of the multipliers' mode; 0 where penalty springs hold alone."""
        share = self.settings.penetration_tolerance
        if self.settings.contact == "penalty":
            return 0.0
        if self.settings.contact != "augmented":
            raise ValueError(f'contact is "penalty" or "augmented", not {self.settings.contact!r}')
        if not 0 < share < 1:
            raise ValueError(f"penetration_tolerance must lie between 0 and 1, got {share!r}")
        return max(share * size, _FINEST * self._slack)

    @property
    def slack(self) -> float:
        """The rounding of coordinates, m: less is no motion."""
        return self._slack

    @property
    def allowed_ratio(self) -> float:
        """The largest displacement that a step may bring, in units of half the height."""
        return self._limit / self.half_height

    def in_statics(self) -> BlockSystem:
        """The same blocks with a dynamic factor of zero: steps that carry no velocity."""
        settings = replace(self.settings, dynamic_factor=0.0)
        return BlockSystem(self.blocks, self.materials, self.joints, self._joint_index, settings)

    def removed(self, loads: Loads, time: float) -> np.ndarray | None:
        """(n_blocks,) True for blocks that ``loads`` have taken out by ``time``; None before any is."""
        return self._excavations.removed(loads, time)

    def _take_out(self, removed: np.ndarray | None, drained: np.ndarray | None) -> None:
        """Go on without the blocks ``removed`` (n_blocks,): they keep their place in all arrays, fixed and touching nothing;
        ``drained`` ones took the water with them."""
        self._removed = removed
        fixed = self.blocks.fixed if removed is None else self.blocks.fixed | removed
        self._fixed = np.ascontiguousarray(fixed, dtype=np.bool_)
        self._free = np.where(self._fixed, -1, np.cumsum(~self._fixed) - 1).astype(np.int64)
        self._moving = np.flatnonzero(~self._fixed)
        self._turns = ~self._fixed if self.blocks.held is None else ~(self._fixed | self.blocks.held[:, 2])
        self._sparse: tuple[np.ndarray, assembly.Pattern] | None = None
        self._finder.take_out(removed)
        self._load_map.take_out(removed, drained)

    def step(
        self,
        state: State,
        loads: Loads,
        dt: float | None = None,
        crack: CrackResponse | None = None,
        load_time: float | None = None,
        like: StepResult | None = None,
    ) -> StepResult:
        """Move ``state`` by ``dt`` (default: the settings' time step) under ``loads`` taken at the time that the scheme weighs
        them to (the end of the step in Shi's), or at ``load_time`` however short the step becomes. ``like``: the result of
        the same step with another ``crack``, from whose contact states iterations begin.

        A step whose contact states do not settle, or that moves a vertex too far, is halved or shortened and begun again
        from ``state``, which is never changed; ``result.dt`` says what was done. Raises `NotConverged` after
        ``settings.max_step_cuts`` cuts, and ValueError when blocks overlap before they have moved, or
        when nothing holds them up in statics.
        """
        dt = self.settings.time_step if dt is None else float(dt)
        if not dt > 0:
            raise ValueError(f"a time step must be positive, got {dt!r} s")
        removed = self.removed(loads, state.time)
        if removed is not self._removed:
            self._take_out(removed, self._excavations.drained(loads, state.time))
        if load_time is None:
            dt = until_next_event(loads, state.time, dt)
        vertices = np.ascontiguousarray(state.vertices)
        carried = self.settings.dynamic_factor * state.velocity
        carried[self._fixed] = 0.0
        moments = block_moments(vertices, self._next, self._start)
        if state.time == 0.0 and len(state.contacts) == 0:
            refuse_overlap(self.blocks, vertices, moments)
            self._refuse_unheld(loads, state.time + dt if load_time is None else load_time)
        limit = self._limit
        dt = self._foreseen(vertices, carried, moments, loads, state.time, dt, limit)
        found = self._finder.find(state, vertices, _WINDOW * limit)
        if like is not None:
            found = found.like(like.contacts)
        reason, before, broken = "", np.inf, np.zeros(0, np.int64)
        cuts = 0
        while True:
            try:
                result, largest = self._attempt(
                    state, vertices, carried, moments, loads, dt, crack, found, cuts, load_time
                )
            except Unsettled as failure:
                reason = f"{failure}{self._finder.where(found, failure.contact)}"
                shorter = 0.5 * dt
            else:
                bonded = result.contacts["bonded"]
                lost = (bonded != found.bonded) & found.inset
                unheld = found.relies_on_glue and (bonded < found.bonded).any()
                if unheld or lost.any():
                    # Corners that were left out, and springs that were moved, for the sake of a bond are back before it breaks.
                    broken = np.append(broken, found.vertex[lost] * len(vertices) + found.edge[lost])
                    holds = found.relies_on_glue and not unheld
                    found = self._finder.find(state, vertices, _WINDOW * limit, holds, broken=broken)
                    continue
                if largest <= 1.0001 * limit:
                    self._refuse_crushed(result.state)
                    return result
                reason = f"a vertex moves {largest:.3g} m, the limit is {limit:.3g} m"
                if largest > 0.9 * before:
                    # Static equilibrium under a load that does not shrink with dt: let it move, search far enough.
                    log.info("step at t = %g s: %s, and a shorter step does not help; accepted", state.time, reason)
                    limit = 1.1 * largest
                    found = self._finder.find(state, vertices, _WINDOW * limit, found.relies_on_glue, broken=broken)
                    continue
                before = largest
                shorter = dt * float(min(0.8, max(0.05, 0.95 * limit / largest)))
            cuts += 1
            if cuts > self.settings.max_step_cuts:
                raise NotConverged(
                    f"the block step at t = {state.time:g} s failed after {cuts - 1} cuts (dt = {dt:.3g} s): {reason}"
                )
            log.debug("step at t = %g s cut from %.4g to %.4g s: %s", state.time, dt, shorter, reason)
            dt = shorter

    def contacts_near(self, state: State) -> ContactSet:
        """The contacts that a step from ``state`` would begin with, as CONTACT rows tell of them."""
        return self._finder.find(state, np.ascontiguousarray(state.vertices), _WINDOW * self._limit, lumped=True)

    def told(self, found: ContactSet, forces: ToldContacts) -> np.ndarray:
        """CONTACT rows of ``found``, those that ``forces`` tell of as these say: for a `State` whose next step begins so."""
        if self._tolerance:
            on_multiplier = self._finder.on_penalty(found)[0]
        else:
            on_multiplier = np.zeros(len(found), bool)
        return told_rows(found, forces, self._finder.closure, on_multiplier)

    def _refuse_unheld(self, loads: Loads, time: float) -> None:
        """In statics weight needs something to rest on: what falls for ever has no equilibrium."""
        holds = (
            self._fixed.any() or self.blocks.held is not None or loads.edge_tractions or loads.point_loads
            or loads.block_motions or loads.point_motions or loads.bolts or loads.viscous_boundaries or loads.water
        )  # fmt: skip
        if self.scheme.static and not holds and loads.gravity.at(time).any():
            raise ValueError(
                "no block is fixed, so that under gravity all of them fall and statics finds no equilibrium: fix a block, or "
                "let velocity be carried (dynamic_factor = 1)"
            )

    def _refuse_crushed(self, state: State) -> None:
        area = block_moments(state.vertices, self._next, self._start)[:, 0]
        if not (area > 0).all():
            crushed = int(np.argmin(area > 0))
            name = self.blocks.names[crushed] if self.blocks.names else f"block {crushed}"
            raise NotConverged(
                f"{name!r} is crushed to nothing at t = {state.time:g} s: its loads are beyond its stiffness"
            )

    def _foreseen(self, vertices, carried, moments, loads, time, dt, limit) -> float:
        """``dt`` shortened where the velocity alone would carry a vertex beyond the limit."""
        if not carried.any():
            return dt
        v = carried[self._owner]
        x, y = vertices[:, 0] - moments[self._owner, 1], vertices[:, 1] - moments[self._owner, 2]
        vx = v[:, 0] - v[:, 2] * y + v[:, 3] * x + 0.5 * v[:, 5] * y
        vy = v[:, 1] + v[:, 2] * x + v[:, 4] * y + 0.5 * v[:, 5] * x
        speed = float(np.sqrt(np.max(vx * vx + vy * vy)))
        g = float(np.hypot(*loads.gravity.at(time + dt)))
        # Root of speed dt + g dt²/2 = limit in the form that keeps its digits when g is small.
        return min(dt, float(2.0 * limit / (speed + np.sqrt(speed * speed + 2.0 * g * limit))))

    def _pattern(
        self, block: np.ndarray, other: np.ndarray, moments: np.ndarray, linked: tuple[np.ndarray, np.ndarray] | None
    ) -> assembly.Pattern:
        if linked is not None:
            block, other = np.concatenate([block, linked[0]]), np.concatenate([other, linked[1]])
        if int(self._free.max()) + 1 <= assembly.DENSE_BLOCKS:
            return assembly.dense_pattern(self._free, block, other)
        pairs, pattern = np.stack([block, other]), None
        if self._sparse is not None:
            known, pattern = self._sparse
            if pattern.order is self._free and np.array_equal(known, pairs):
                return pattern
        kept = None if pattern is None else pattern.solver
        pattern = assembly.sparse_pattern(self._free, block, other, moments[:, 1:3], kept)
        self._sparse = pairs, pattern
        return pattern

    def _over_the_step(self, found: ContactSet, dt: float):
        """What acts over a step of the contacts ``found``: springs, starting gaps (n,), how the step's end weighs, curved laws."""
        curved = self._finder.curved(found)
        # Multipliers are forces at the end of the step.
        weight = 1.0 if self._tolerance else self.scheme.weight
        if weight != 1.0 and curved is not None:
            # The lines of a law that is curved are those of the end of the step.
            weight = np.full(len(found), weight)
            weight[curved.rows] = 1.0
        mass = np.where(self._fixed, np.inf, self._mass)
        springs, gap = over_a_step(
            found.springs, np.ascontiguousarray(found.gap), (found.state != OPEN) & (found.bonded > 0),
            np.minimum(mass[found.block], mass[found.other]), weight, self.scheme.block_damping, dt,
        )  # fmt: skip
        return springs, gap, weight, curved

    def _settled(self, pattern, matrix, right, found, gap, vectors, springs, curved) -> Settled:
        def solve(contacts: ContactSet, stiff: Springs, start: np.ndarray) -> Settled:
            most = self.settings.max_open_close_iterations
            return settle(pattern, matrix, right, contacts, vectors, stiff, start, self._slack, most, curved)

        if not self._tolerance or not len(found):
            if found.stretch.any():
                found = replace(found, shear=found.shear - springs.shear * found.stretch)
            return solve(found, springs, gap)
        return settle_augmented(solve, found, springs, gap, self._finder.on_penalty(found), self._tolerance)

    def _stopped(
        self, found, settled, slid, velocity, moments, density, dt, pattern, matrix, vectors, turn, imposed
    ) -> tuple[np.ndarray, float]:
        """``velocity`` without the sliding that friction has stopped in the step, and the energy that this takes (J/m)."""
        mass = np.where(self._fixed, np.inf, self._mass)
        stopped = Stopped.of(found, settled, slid, velocity, moments[:, 1:3], mass, dt, self._slack)
        if stopped is None:
            return velocity, 0.0
        try:
            change = stop(stopped, pattern, matrix, vectors, found, settled, dt)
        except np.linalg.LinAlgError as error:
            raise Unsettled(str(error)) from error
        if imposed is not None:
            change = imposed.free_part(change, pattern.order)
        rates = np.zeros_like(velocity)
        rates[self._moving] = change[pattern.order[self._moving]] * (2.0 / dt)
        rates[:, 2:] /= np.sqrt(moments[:, :1])
        rates, lost = dissipating(turned(rates, turn), velocity, moments, density, self._fixed)
        return velocity + rates, lost

    def _real_springs(self, found: ContactSet, settled: Settled) -> tuple[np.ndarray, np.ndarray]:
        """Contact springs that store energy, normal and shear: what multipliers hold does not."""
        normal, shear = found.springs.normal, settled.springs.shear
        if not self._tolerance:
            return normal, shear
        held = self._finder.on_penalty(found)
        return np.where(held[0], 0.0, normal), np.where(held[1], 0.0, shear)

    def _attempt(
        self, state, vertices, carried, moments, loads, dt, crack, found, cuts, load_time
    ) -> tuple[StepResult, float]:
        scheme = self.scheme
        time = state.time + dt
        acting = state.time + scheme.weight * dt if load_time is None else load_time
        gravity = felt_gravity(loads, state.time, acting, dt, scheme.static, scheme.ahead(state.acceleration, dt))
        points, edges = self._load_map.rows(loads, acting, vertices, state.rotation)
        centroid = np.ascontiguousarray(moments[:, 1:3])
        load = generalised(points, edges, centroid)
        given = crack is not None
        # Mass stays, whatever the strain does to the area.
        density = self._mass / moments[:, 0]
        static = scheme.static
        begun, heavier = scheme.begun(carried, state.acceleration, dt)
        compliance = np.ascontiguousarray(crack.compliance, dtype=float) if given else self._no_compliance
        offset = np.ascontiguousarray(crack.offset, dtype=float) if given else self._no_offset
        stress, crack_strain = np.ascontiguousarray(state.stress), np.ascontiguousarray(state.crack_strain)
        n_free, iterations = len(self._moving), 0
        end = time if load_time is None else load_time
        actions = StepActions.of(
            self.blocks, self._fixed, loads, state, self._load_map, moments, self._free, self._removed, end
        )
        linked = None if actions is None else actions.linked
        pattern = self._pattern(found.block, found.other, moments, linked) if n_free else None
        order = self._free if pattern is None else pattern.order
        matrix, right, tangent, stress0 = assemble_blocks(
            order, moments, density, self._stiffness, self.compliance, begun, stress, crack_strain, given,
            compliance, offset, gravity, load, dt, heavier, scheme.weight, scheme.block_damping, scheme.mass_damping,
            scheme.stiffness_damping, n_free,
        )  # fmt: skip
        quiet = None
        if loads.viscous_boundaries and not static and n_free:
            middle = state.time + 0.5 * dt if load_time is None else load_time
            quiet = QuietEdges.of(
                loads.viscous_boundaries, self.blocks, vertices, middle, self.density, self._stiffness, self._fixed
            )
            quiet.assemble(matrix, right, order, moments, dt)
        held = self._held
        alone = static and self.blocks.n_blocks == 1 and n_free and actions is None
        if alone and balanced(load[0], points, edges, self._mass[0] * gravity, moments[0]):
            held = with_rigid_motion(held)
        if actions is not None:
            held = actions.held(held)
        own = matrix, right
        for _ in range(_PLACED):
            if found.points is not None:
                matrix, right = own[0].copy(), own[1].copy()
            springs, gap, weight, curved = self._over_the_step(found, dt)
            vectors = assembly.contact_vectors(found.block, found.other, found.geometry, order, moments)
            if held is not None and n_free:
                hold(held, matrix, right, vectors, found.block, found.other, order)
            if not n_free:
                zero = np.zeros(len(found))
                settled = Settled(
                    np.zeros((0, 6)), found.state, zero, found.bonded, zero, zero, zero, zero, zero, found.springs, 0
                )
                unknowns = settled.unknowns
            elif actions is None:
                settled = self._settled(pattern, matrix, right, found, gap, vectors, springs, curved)
                unknowns = settled.unknowns
            else:
                solve = partial(self._settled, vectors=vectors, springs=springs, curved=curved)
                settled, unknowns = actions.settle(pattern, matrix, right, vectors, found, gap, solve)
            iterations += settled.iterations
            better = found.misplaced(settled)
            if better is None:
                break
            found = better.trying(found.rows(settled))
        else:
            raise Unsettled("faces do not settle on the part of them that touches")

        increment = np.zeros((self.blocks.n_blocks, 6))
        increment[self._moving] = unknowns[order[self._moving]]
        increment[:, 2:] /= np.sqrt(moments[:, :1])
        imposed = None if actions is None else actions.imposed
        if imposed is not None:
            increment += imposed.increment
        new_vertices, velocity, new_stress, new_crack, largest = advance(
            increment, carried, dt, static, vertices, self._start, moments, tangent, stress0, compliance, offset, given,
            crack_strain, self._turns,
        )  # fmt: skip
        if quiet is not None:
            absorbed = quiet.rows(increment, moments, dt)
            edges = np.concatenate([edges, absorbed])
            load = load + generalised(points[:0], absorbed, centroid)
        acceleration = 2.0 * (increment - carried * dt) / (dt * dt)
        velocity, kept = scheme.corrected(velocity, state.acceleration, acceleration, increment[:, 2], dt)
        if heavier != 1.0:
            acceleration = 2.0 * heavier * (increment - begun * dt) / (dt * dt)
        slid = sliding(vectors, settled.unknowns, order, found.block, found.other)
        if actions is not None and n_free:
            slid += actions.along
        rubbed = 0.0
        if imposed is not None:
            imposed.correct_velocity(velocity)
        if not static and n_free:
            velocity, rubbed = self._stopped(
                found, settled, slid, velocity, moments, density, dt, pattern, matrix, vectors, increment[:, 2], imposed
            )
        rows = found.rows(settled)
        reaction, acting_right, largest_force, acted = None, right, 0.0, {}
        if actions is not None:
            points, reaction, acted = actions.acted(settled, unknowns, rows, points, new_vertices)
            acting_right, largest_force = actions.with_bolt_forces(right), actions.largest_bolt_force
            load = generalised(points, edges, centroid) + actions.work_forces(reaction, rows, centroid)
        end_shear = end_of_step(found.shear, settled.shear_force, settled.state == STICK, weight)
        energy = StepEnergy._make(
            step_energies(
                increment, state.velocity, carried, velocity, acceleration, dt, gravity, load, scheme.weight,
                scheme.block_damping, scheme.mass_damping, scheme.stiffness_damping, density, moments, self._fixed, stress,
                tangent, stress0, self.compliance, self._stiffness, found.state, settled.state, found.bonded, settled.bonded,
                found.gap, settled.gap, settled.lifted, settled.slip, slid, settled.normal_force, found.shear,
                settled.shear_force, end_shear, *self._real_springs(found, settled),
                weight if isinstance(weight, np.ndarray) else np.full(len(found), weight), found.law, self._finder.closure,
            ).tolist()
        )  # fmt: skip
        energy = energy._replace(friction=energy.friction + rubbed, scheme=energy.scheme - rubbed)
        residual, ratio = imbalance(
            matrix, acting_right, vectors, found.block, found.other, order, settled.unknowns, settled.normal_force,
            settled.shear_force, acceleration, density, moments, gravity, load, largest_force,
        )  # fmt: skip

        if len(self._rigid):
            new_stress[self._rigid] = mean_stress(
                self._rigid, rows, load, moments, density, acceleration, carried[:, 2], increment[:, 2]
            )
        if scheme.mass_damping:
            acceleration = acceleration + scheme.mass_damping / dt * increment
        memory = rows
        if scheme.weight != 1.0:
            memory = rows.copy()
            memory["shear_force"] = end_shear
        if self._removed is not None:
            new_stress[self._removed] = 0.0
        inertia = Inertia(density, gravity, acceleration, carried[:, 2], self._fixed)
        forces = AppliedForces(points, edges, centroid, moments[:, 0].copy(), inertia, reaction)
        new_state = State(
            time=time,
            vertices=new_vertices,
            velocity=velocity,
            stress=new_stress,
            rotation=state.rotation + increment[:, 2],
            crack_strain=new_crack,
            contacts=self._finder.carried(new_vertices, memory),
            acceleration=kept,
            bolts=state.bolts if actions is None else actions.memory,
            imposed=state.imposed if imposed is None else imposed.totals,
            removed=self._removed,
        )
        closed = settled.state != OPEN
        statistics = {
            "open_close_iterations": iterations,
            "dt": dt,
            "step_cuts": cuts,
            "kinetic_energy": energy.kinetic,
            "elastic_energy": energy.elastic,
            "contact_energy": energy.contact,
            "worst_penetration": _deepest(closed, found.gap, settled.gap),
            "max_displacement_ratio": largest / self.half_height,
            "unbalanced": residual,
            "unbalanced_ratio": ratio,
            **acted,
        }
        return StepResult(new_state, dt, rows, forces, acceleration, energy, statistics), largest


def _deepest(closed: np.ndarray, before: np.ndarray, after: np.ndarray) -> float:
    """The deepest that ``closed`` contacts penetrate, m: as the step found them and as it leaves them.

    An open one whose vertex is behind its edge's line has a partner line that is not crossed: nothing penetrates there.
    """
    return float(max(0.0, -np.minimum(before, after)[closed].min())) if closed.any() else 0.0


def run(
    blocks: Blocks,
    materials: Sequence[Material],
    joints: Sequence[JointLaw],
    loads: Loads,
    settings: DdaSettings,
    end_time: float,
    *,
    joint_index: Callable[[str, str], int | None] | None = None,
    state: State | None = None,
    watch: Callable[[StepResult], None] | None = None,
) -> Iterator[State]:
    """States of a block system from rest (or from ``state``) until ``end_time``, one a step; `StepLength` says how long.
    ``watch`` sees every `StepResult`.

    ``for state in dda.run(blocks, [rock], [joint], loads, settings, 1.0): …``
    """
    system = BlockSystem(blocks, materials, joints, joint_index, settings)
    state = State.at_rest(blocks) if state is None else state
    yield state
    length = StepLength(settings)
    while state.time < end_time * (1 - 1e-12):
        dt = min(length.dt, end_time - state.time)
        result = system.step(state, loads, dt)
        length.after(result, dt, system.allowed_ratio)
        if watch is not None:
            watch(result)
        state = result.state
        yield state
