"""A system of blocks in contact and its time step."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from ..model import OPEN, Blocks, DdaSettings, JointLaw, Loads, Material, State
from .contact_detection.contact_finder import ContactFinder
from .contact_detection.inherited_contacts import InheritedContacts, at_their_springs, inherited_rows
from .contact_detection.initial_overlap import refuse_overlap
from .counters import Work
from .excavation import Excavations, until_next_event
from .higher_order.bending_step import BendingAttempt
from .higher_order.deflected_blocks import DeflectedBlocks
from .higher_order.face_points import at_their_points, without_remembered
from .higher_order.glued_cells import GluedFaces, GlueStrength, KeptCorners
from .higher_order.order_choice import CracksAbove, OrderChoice, extended_deflection
from .higher_order.six_row_system import SixRowPattern, six_row_pattern
from .higher_order.unsupported import refuse_unsupported
from .kinematics.newmark import TimeScheme
from .kinematics.rigid_blocks import with_rigid
from .kinematics.roundoff import rounding_of
from .kinematics.simplex_integration import block_moments
from .linear_solver import assembly
from .loads.load_checks import LoadChecks
from .loads.load_vectors import LoadMap
from .open_close.contact_set import ContactSet
from .open_close.static_splitting import is_straight
from .results import CrackResponse, StepResult
from .step_control.relative_motion import Windows
from .step_control.step_limits import StepLimits
from .step_control.trial_step import TrialCutting
from .step_cutting import StepCutting, windows_of
from .time_step import Attempt, StepStart

log = logging.getLogger(__name__)

#: Displacement limit, in units of half the diagonal of the domain, that is never reached by blocks at rest.
_ANYWHERE = 1.0
#: Smallest penetration tolerance of multipliers, in units of the round-off of coordinates.
_FINEST = 10.0


class BlockSystem:
    """Blocks that move, deform and touch: first-order discontinuous deformation analysis (Shi 1988).

    ``joint_index(edge_name, other_name)`` gives the index in ``joints`` of the law between two edges, or None if such
    edges do not touch; without it the first law applies everywhere. Contact springs are ``settings.normal_penalty`` and
    ``shear_penalty`` (Pa), by default both 40 times the E' of the two blocks (`penalties`). ``work`` counts operations
    over all systems that share it.

    Arrays used by every `Attempt` are computed once: ``density`` (kg/m³), ``mass`` (kg/m), ``stiffness`` and
    ``compliance`` (3, 3) of each block, ``constrained`` (its constrained unknowns), ``rigid`` (indices), the ``finder``
    of contacts and the ``load_map``. After an excavation the following are updated: ``fixed``, ``moving`` (indices),
    ``turns`` (blocks that can rotate), and ``free``, the number of a block among the moving ones, −1 for others.
    ``allowed_penetration`` (m) is zero if only penalty springs act. ``rounding`` (m) is the round-off of coordinates; a
    warning is logged once if its contact forces are large relative to a block's weight.

    Raises ValueError if there are no blocks, if materials or joints are missing, if a block has no area, or if a moving
    block has no mass in a dynamic run.
    """

    def __init__(
        self,
        blocks: Blocks,
        materials: Sequence[Material],
        joints: Sequence[JointLaw] = (),
        joint_index: Callable[[str, str], int | None] | None = None,
        settings: DdaSettings | None = None,
        work: Work | None = None,
    ) -> None:
        self.work = work or Work()
        areas = _areas(blocks, len(materials))
        self.blocks = blocks
        self.materials = tuple(materials)
        self.joints = tuple(joints) or (JointLaw("frictionless"),)
        self.settings = settings or DdaSettings()
        self.scheme = TimeScheme.of(self.settings)
        self.load_map = LoadMap(blocks)
        self._stray_loads = LoadChecks(blocks)
        self._excavations = Excavations(blocks)

        of = np.asarray(blocks.material, dtype=int)
        self.density = np.array([m.density for m in self.materials])[of]
        self.stiffness = np.ascontiguousarray(np.array([m.stiffness() for m in self.materials])[of])
        self.compliance = np.ascontiguousarray(np.array([m.compliance() for m in self.materials])[of])
        modulus = np.array([m.plane_modulus for m in self.materials])[of]
        rigid = np.array([m.rigid for m in self.materials])[of]
        joint_index = joint_index or (lambda edge_name, other_name: 0)
        self._joint_index = joint_index
        self.mass = self.density * areas
        self.finder = ContactFinder(
            blocks, self.joints, joint_index, self.settings, modulus, rigid, self.mass, self.work
        )
        self.deflected: DeflectedBlocks | None = None
        #: Bonded faces of cells; None if there are no cells. ``bonded`` (m,): their numbers in `Blocks.glued`.
        self.glued: GluedFaces | None = None
        #: Choice of orders during the run; None if all are given.
        self.order_choice: OrderChoice | None = None
        #: Whether a step is repeated until its orders suffice; if not, `orders_after` returns those it needs.
        self.raises_orders = True
        self._last: Attempt | None = None
        #: Pairs of blocks (2, n) and pattern of the last sparse equations; None before the first ones.
        self._sparse: tuple[np.ndarray, assembly.Pattern] | None = None
        #: (n_faces,) bonded faces that have separated; None without cells.
        self._parted: np.ndarray | None = None
        self._take_out(None, None)
        ordered = blocks.order is not None and (np.asarray(blocks.order) != 1)[~self.fixed].any()
        if ordered or blocks.glued is not None or self._crushes:
            refuse_unsupported(blocks, self.materials, self.joints, self.settings)
            self._choose_orders()
        #: Strength of the bonded faces; None if they cannot separate.
        self.glue_strength: GlueStrength | None = None
        if blocks.glued is not None and (strength := self._glue_strength()).any:
            self.glue_strength = strength
        rigid = rigid & ~self.fixed
        self.rigid = np.flatnonzero(rigid)
        self.compliance[rigid] = 0.0
        self.constrained = with_rigid(blocks.constrained, rigid)
        self.next = np.ascontiguousarray(blocks.next_vertex, np.int64)
        self.vertex_start = np.ascontiguousarray(blocks.vertex_start, np.int64)
        self.owner = np.ascontiguousarray(blocks.vertex_block, np.int64)
        self.no_compliance = np.zeros((blocks.n_blocks, 3, 3))
        self.no_offset = np.zeros((blocks.n_blocks, 3))

        vertices = blocks.vertices
        self._refuse_massless()
        self.half_diagonal = 0.5 * float(np.hypot(*np.ptp(vertices, axis=0)))
        self.rounding = rounding_of(vertices)
        #: What has been warned of already; systems of the same blocks share it.
        self.warned: set[str] = set()
        #: (n_blocks,) m: static steps are solved by operator splitting, which gives blocks up that move beyond this; None:
        #: they are not.
        self.reach: np.ndarray | None = None
        #: Whether such steps are solved by operator splitting from the start (`step_control.trial_step`).
        self.plastic = False
        self.limits = StepLimits(
            self.finder, self.settings, self.half_diagonal, self.vertex_start, self.next, self.work
        )
        self.allowed_penetration = self._allowed_penetration(float(np.sqrt(areas.min())))

    def _allowed_penetration(self, size: float) -> float:
        """m: tolerance of multipliers; 0 with penalty springs only."""
        share = self.settings.penetration_tolerance
        if self.settings.contact == "penalty":
            return 0.0
        return max(share * size, _FINEST * self.rounding)

    def _refuse_massless(self) -> None:
        """Refuse moving blocks without mass in dynamics."""
        massless = ~self.fixed & (self.density == 0.0)
        if not self.scheme.static and massless.any():
            block = int(massless.argmax())
            material = self.materials[int(self.blocks.material[block])].name
            raise ValueError(
                f"{self.finder.names[block]!r} may move, but its material {material!r} has no density: in dynamics "
                "blocks without mass have no equation of motion"
            )

    @property
    def _crushes(self) -> bool:
        """Whether faces crush, at integration points as those of blocks of higher order have."""
        return any(law.crushing_strength is not None for law in self.joints)

    def _choose_orders(self) -> None:
        """Set the orders of blocks: those given, or the first of their choice."""
        choice = OrderChoice(
            self.blocks, self.fixed, self.stiffness, self.compliance, self.settings.order_target, self._crushes
        )
        self.order_choice = choice if choice.found.any() else None
        self.order = np.zeros(self.blocks.n_blocks, np.int64)
        self._take_orders(choice, choice.first)

    def _take_orders(self, choice: OrderChoice, order: np.ndarray) -> None:
        """Continue with blocks of these orders (n_blocks,)."""
        if np.array_equal(order, self.order):
            return
        self.order, self.deflected, self._sparse = order, choice.deflected(order), None
        if self.deflected is not None:
            self.deflected.take_out(self.taken_out)
        self.finder.at_corners = self.deflected is not None
        if self.blocks.glued is not None:
            assert self.deflected is not None  # cells are blocks of higher order
            self._all_glued, self._parted = GluedFaces.of(self.deflected), None
            self._part(np.zeros(len(self.blocks.glued), bool))

    def _glue_strength(self) -> GlueStrength:
        """Strength of bonded faces of cells, from the joint law of faces whose edges have names."""
        edge, mate = np.asarray(self.blocks.glued).T
        law, named = (
            self.finder.laws_of(edge, mate),
            (self.blocks.edge_name[edge] > 0) & (self.blocks.edge_name[mate] > 0),
        )
        return GlueStrength.of(
            [self.joints[k] if k >= 0 and has else None for k, has in zip(law.tolist(), named.tolist(), strict=True)]
        )

    def _part(self, parted: np.ndarray) -> None:
        """Continue with the bonded faces that have not ``parted`` (n_faces,)."""
        if self._parted is not None and np.array_equal(parted, self._parted):
            return
        assert self.deflected is not None
        self._parted = parted
        self._bond()
        self.finder.part(self.blocks, parted)
        self.finder.kept_corners = KeptCorners(self.deflected, self.finder.joined)
        self.finder.deflection, self.finder.sag = np.zeros((2, self.blocks.n_blocks))

    def _bond(self) -> None:
        """Continue with the bonds of cells that have neither separated nor been excavated."""
        assert self._parted is not None  # of a system with cells
        holds, every = ~self._parted, self._all_glued
        if self.taken_out is not None:
            holds = holds & ~self.taken_out[every.block] & ~self.taken_out[every.other]
        self._sparse, self.bonded, self.glued = None, np.flatnonzero(holds), every.kept(holds)

    @property
    def splits_statics(self) -> bool:
        """Whether operator splitting (`open_close.static_splitting`) can solve static steps of these blocks, and they are
        many."""
        plain = self.deflected is None and not self.allowed_penetration
        return (
            plain
            and len(self.moving) >= self.settings.contact_solver.static_splitting
            and all(is_straight(law) for law in self.joints)
        )

    @property
    def step_limit(self) -> float:
        """Largest displacement of a vertex allowed in a step, m."""
        return self.limits.displacement

    def in_statics(self) -> BlockSystem:
        """The same blocks with a dynamic factor of zero: no velocity is carried over."""
        settings = replace(self.settings, dynamic_factor=0.0)
        out = BlockSystem(self.blocks, self.materials, self.joints, self._joint_index, settings, self.work)
        out.finder.toes, out.finder.whole_faces = self.finder.toes, self.finder.whole_faces
        out.warned = self.warned
        return out

    @cached_property
    def of_first_order(self) -> BlockSystem | None:
        """The same blocks with uniform strain; None where there are none of higher order, or cells, which need their
        order."""
        if self.deflected is None or self.blocks.glued is not None or self._crushes:
            return None
        blocks = replace(self.blocks, order=None)
        return BlockSystem(blocks, self.materials, self.joints, self._joint_index, self.settings, self.work)

    def with_joints(self, joints: Sequence[JointLaw]) -> BlockSystem:
        """The same blocks with other joint laws, in the order of ``joints``, and steps without displacement limit."""
        settings = replace(self.settings, max_displacement_ratio=_ANYWHERE)
        out = BlockSystem(self.blocks, self.materials, joints, self._joint_index, settings, self.work)
        out.finder.toes, out.finder.whole_faces = self.finder.toes, self.finder.whole_faces
        out.warned = self.warned
        return out

    def removed(self, loads: Loads, time: float) -> np.ndarray | None:
        """(n_blocks,) bool: blocks excavated by ``loads`` until ``time``; None if there are none."""
        return self._excavations.removed(loads, time)

    def _take_out(self, removed: np.ndarray | None, drained: np.ndarray | None) -> None:
        """Continue without the blocks ``removed`` (n_blocks,): they keep their rows in all arrays, fixed and without
        contacts. The space of ``drained`` blocks contains no water."""
        self.taken_out = removed
        fixed = self.blocks.fixed if removed is None else self.blocks.fixed | removed
        self.fixed = np.ascontiguousarray(fixed, dtype=np.bool_)
        self.free = np.where(self.fixed, -1, np.cumsum(~self.fixed) - 1).astype(np.int64)
        self.moving = np.flatnonzero(~self.fixed)
        self.turns = ~self.fixed if self.blocks.constrained is None else ~(self.fixed | self.blocks.constrained[:, 2])
        self._sparse = None
        self.finder.take_out(removed)
        self.load_map.take_out(removed, drained)
        if self.deflected is not None:
            self.deflected.take_out(removed)
        if self.glued is not None:
            self._bond()

    def step(
        self,
        state: State,
        loads: Loads,
        dt: float | None = None,
        crack: CrackResponse | None = None,
        load_time: float | None = None,
        like: StepResult | None = None,
        pseudo_inertia: bool = False,
    ) -> StepResult:
        """Move ``state`` by ``dt`` (default: the settings' time step) under ``loads``. The loads are those of the time
        at which the scheme weights them (the end of the step in Shi's), or of ``load_time``, however short the step
        becomes. ``like``: the result of the same step with another ``crack``, whose contact states are the first guess.
        In statics, supported blocks bear their loads without inertia, unless ``pseudo_inertia`` is True, with which all
        blocks move more gradually.

        A step without consistent contact states is halved, one that exceeds a motion limit is shortened, and it is
        repeated from ``state``, which is never modified. ``result.dt`` is the length of the accepted step; the log
        gives the reason for cuts. Raises `NotConverged` after ``settings.max_step_cuts`` cuts, and ValueError if blocks
        overlap initially, if nothing supports them in statics, or if ``state`` does not belong to these blocks.
        """
        choice, strength = self.order_choice, self.glue_strength
        if choice is None and strength is None:
            return self._step(state, loads, dt, crack, load_time, like, pseudo_inertia)[1]
        self.follow(state)
        while True:
            attempt, result = self._step(state, loads, dt, crack, load_time, like, pseudo_inertia)
            self._last = None if choice is None or self.raises_orders else attempt
            raises = choice is not None and self.raises_orders
            order = choice.raised(self.order, self.deflected, attempt) if raises and choice is not None else None
            if choice is not None and order is not None:
                state = self.with_orders(state, order)
                continue
            parted, before = None, self._parted
            mean = attempt.glue_traction() if isinstance(attempt, BendingAttempt) else None
            if strength is not None and before is not None and mean is not None:
                parted = strength.parting(before, self.bonded, mean)
            if parted is None or before is None:
                known = None if strength is None else self._parted
                return replace(
                    result, state=replace(result.state, order=None if choice is None else self.order, parted=known)
                )
            log.info("t = %g s: %d faces between cells separate", attempt.time, int(parted.sum() - before.sum()))
            self._part(parted)

    def with_orders(self, state: State, order: np.ndarray) -> State:
        """``state`` of blocks that are raised to these orders (n_blocks,), with which the system continues: new unknowns of
        deflection are zero. In motion the contacts of raised blocks keep their resultants: with their gaps alone, the
        springs of more points would store more energy."""
        before = self.order_of(state)
        known = {name: getattr(state, name) for name in ("deflection", "deflection_origin", "crack_deflection")}
        more: dict[str, Any] = {
            name: extended_deflection(of, before, order) for name, of in known.items() if of is not None
        }
        state, raised = replace(state, order=order, **more), order > before
        self.follow(state)
        if self.scheme.static or not len(state.contacts) or not raised.any():
            return state
        memory = state.face_points
        if memory is not None:
            state = replace(state, face_points=memory[~(raised[memory["block"]] | raised[memory["other"]])])
        found = self.contacts_near(state)
        which = np.flatnonzero((found.state != OPEN) & (raised[found.block] | raised[found.other]))
        forces = InheritedContacts(
            which, found.normal[which], found.shear[which], found.gap[which], found.slip[which]
        )  # fmt: skip
        return self.with_inherited_contacts(state, found, forces)

    def order_of(self, state: State) -> np.ndarray:
        """(n_blocks,) the orders that blocks have in ``state``."""
        if self.order_choice is None:
            return self.order if self.deflected is not None else np.ones(self.blocks.n_blocks, np.int64)
        return self.order_choice.first if state.order is None else np.asarray(state.order)

    def orders_after(self, cracks: CracksAbove | None = None, changed: bool = True) -> np.ndarray | None:
        """(n_blocks,) orders with which the last step must be repeated; None if its orders suffice. ``cracks``: see
        `OrderChoice.raised`; unless they have ``changed``, estimates of earlier steps are relied on. For a system that does
        not repeat steps itself (``raises_orders``)."""
        attempt, self._last = self._last, None
        if self.order_choice is None or attempt is None:
            return None
        if self.order_choice.known(attempt) and not changed:
            return None
        return self.order_choice.raised(self.order, self.deflected, attempt, cracks)

    def follow(self, state: State) -> None:
        """Continue with the orders that blocks have in ``state``, and with the glue that holds in it."""
        choice, strength = self.order_choice, self.glue_strength
        if choice is not None:
            self._take_orders(choice, self.order_of(state))
        if strength is not None:
            self._part(np.zeros(len(strength.tension), bool) if state.parted is None else np.asarray(state.parted))

    def _refuse_state_of_others(self, state: State) -> None:
        blocks = self.blocks
        for name, rows in (
            ("vertices", len(blocks.vertices)),
            ("velocity", blocks.n_blocks),
            ("stress", blocks.n_blocks),
        ):
            found = len(getattr(state, name))
            if found != rows:
                raise ValueError(f"the state is not one of these blocks: its {name} have {found} rows, expected {rows}")
        contacts = state.contacts
        if len(contacts) and max(contacts["vertex"].max(), contacts["edge"].max()) >= len(blocks.vertices):
            raise ValueError(
                "the state is not one of these blocks: its contacts are between vertices that do not exist"
            )

    def _step(
        self, state: State, loads: Loads, dt: float | None, crack: CrackResponse | None, load_time: float | None,
        like: StepResult | None, pseudo_inertia: bool,
    ) -> tuple[Attempt, StepResult]:  # fmt: skip
        """As `step`, with the present orders of the blocks."""
        dt = self.settings.time_step if dt is None else float(dt)
        if not 0 < dt < np.inf:
            raise ValueError(f"a time step must be positive, got {dt!r} s")
        self._refuse_state_of_others(state)
        # (Kernels are compiled for writable arrays.)
        state = state.writable()
        self._stray_loads.refuse(loads)
        if self.deflected is not None:
            self.finder.deflection, self.finder.sag = self.deflected.deflection_of(state)
        removed = self.removed(loads, state.time)
        if removed is not self.taken_out:
            self._take_out(removed, self._excavations.drained(loads, state.time))
        if load_time is None:
            dt = until_next_event(loads, state.time, dt)
        vertices = np.ascontiguousarray(state.vertices)
        carried = self.settings.dynamic_factor * state.velocity
        carried[self.fixed] = 0.0
        moments = block_moments(vertices, self.next, self.vertex_start)
        if state.time == 0.0 and len(state.contacts) == 0:
            refuse_overlap(self.blocks, vertices, moments)
            self._excavations.refuse(loads)
            self._refuse_unsupported(loads, state.time + dt if load_time is None else load_time)
        start = StepStart(state, vertices, carried, moments, loads.gravity.at(state.time + dt), loads, crack, load_time)
        in_trial = self.scheme.static and self.plastic and self.reach is not None
        cutting = TrialCutting if in_trial else StepCutting
        return cutting(self, start, dt, like, pseudo_inertia).accepted_step()

    def contacts_near(self, state: State) -> ContactSet:
        """The contacts at the start of a step from ``state``."""
        state = state.writable()
        vertices = np.ascontiguousarray(state.vertices)
        return self.finder.find(state, vertices, self._standing(state, vertices), lumped=True)

    def _standing(self, state: State, vertices: np.ndarray) -> Windows:
        """Windows of the contact search for blocks at rest."""
        moments = block_moments(vertices, self.next, self.vertex_start)
        start = StepStart(state, vertices, np.zeros_like(state.velocity), moments, np.zeros(2))
        return windows_of(self, start, 0.0)

    def with_inherited_contacts(self, state: State, found: ContactSet, forces: InheritedContacts) -> State:
        """``state`` with the contacts ``found`` near it and the inherited ``forces``, from which the next step starts."""

        def on_multiplier(contacts: ContactSet) -> np.ndarray:
            has_multipliers = bool(self.allowed_penetration)
            return self.finder.on_penalty(contacts)[0] if has_multipliers else np.zeros(len(contacts), bool)

        closure = self.finder.closure
        if self.deflected is not None:
            forces = without_remembered(forces, found, state.face_points)
        rows = inherited_rows(found, forces, closure, on_multiplier(found))
        if self.deflected is not None:
            stiff = self.finder.stiff_laws[found.law], self.finder.stiff_along_laws[found.law]
            rows, points = at_their_points(rows, found, forces.which, self.deflected, state, stiff)
            known = [] if state.face_points is None else [state.face_points]
            return replace(state, contacts=rows, face_points=np.concatenate([*known, points]))
        vertices = np.ascontiguousarray(state.vertices)
        placed = self.finder.find(replace(state, contacts=rows), vertices, self._standing(state, vertices))
        if placed.points is not None:
            rows = at_their_springs(rows, placed, forces.which, closure, on_multiplier(placed))
        return replace(state, contacts=rows)

    def _refuse_unsupported(self, loads: Loads, time: float) -> None:
        """Refuse a static run under gravity without any fixed block."""
        holds = (
            self.fixed.any() or self.blocks.constrained is not None or loads.edge_tractions or loads.point_loads
            or loads.block_motions or loads.point_motions or loads.bolts or loads.viscous_boundaries or loads.water
        )  # fmt: skip
        if self.scheme.static and not holds and loads.gravity.at(time).any():
            raise ValueError(
                "no block is fixed: under gravity all of them fall, and there is no static equilibrium; fix a block, "
                "or run in time (dynamic_factor = 1)"
            )

    def pattern_of(
        self, block: np.ndarray, other: np.ndarray, moments: np.ndarray, linked: tuple[np.ndarray, np.ndarray] | None
    ) -> assembly.Pattern:
        """Sparsity pattern of the matrix for contacts between ``block`` and ``other`` (n,) and blocks ``linked`` by
        bolts, with its solver; reused as long as the pairs of blocks do not change."""
        if linked is not None:
            block, other = np.concatenate([block, linked[0]]), np.concatenate([other, linked[1]])
        if self.glued is not None:
            block, other = np.concatenate([block, self.glued.block]), np.concatenate([other, self.glued.other])
        if self.deflected is not None:
            known = None if self._sparse is None else self._sparse[1]
            assert known is None or isinstance(known, SixRowPattern)
            rows = six_row_pattern(self.free, self.deflected.sizes, block, other, moments[:, 1:3], known)
            if rows.solver is not None:
                rows.solver.work = self.work
            self._sparse = np.zeros((2, 0)), rows
            return rows
        if int(self.free.max()) + 1 <= assembly.DENSE_BLOCKS:
            return assembly.dense_pattern(self.free, block, other)
        pairs, kept = np.stack([block, other]), None
        if self._sparse is not None:
            before, last = self._sparse
            if last.order is self.free and np.array_equal(before, pairs):
                return last
            kept = last.solver
        pattern = assembly.sparse_pattern(self.free, block, other, moments[:, 1:3], kept)
        assert pattern.solver is not None
        pattern.solver.work = self.work
        self._sparse = pairs, pattern
        return pattern


def _areas(blocks: Blocks, n_materials: int) -> np.ndarray:
    """(n_blocks,) m²: areas of the blocks. Raises ValueError if there are no blocks, a material is missing, or a block has no
    area."""
    if not blocks.n_blocks:
        raise ValueError("there are no blocks to move")
    if int(np.max(blocks.material)) >= n_materials:
        raise ValueError(f"a block has material {int(np.max(blocks.material))}, but there are {n_materials}")
    areas = blocks.areas()
    if (areas <= 0).any():
        raise ValueError(f"{blocks.names[int(areas.argmin())]}: the block has no area")
    return areas
