"""A system of blocks in contact, and the step that moves it."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..model import OPEN, Blocks, DdaSettings, JointLaw, Loads, Material, State
from .contact_detection.contact_finder import ContactFinder
from .contact_detection.inherited_contacts import InheritedContacts, at_their_springs, inherited_rows
from .contact_detection.initial_overlap import refuse_overlap
from .counters import Work
from .excavation import Excavations, until_next_event
from .higher_order.bending_step import BendingAttempt
from .higher_order.deflected_blocks import DeflectedBlocks
from .higher_order.glued_cells import GluedFaces, KeptCorners
from .higher_order.order_choice import OrderChoice, relaid
from .higher_order.six_row_system import six_row_pattern
from .higher_order.unsupported import refuse_unsupported, refuse_unsupported_loads
from .kinematics.midpoint_configuration import MidpointConfiguration
from .kinematics.newmark import TimeScheme
from .kinematics.rigid_blocks import with_rigid
from .kinematics.roundoff import rounding_of
from .kinematics.simplex_integration import block_moments
from .linear_solver import assembly
from .loads.load_checks import StrayLoads
from .loads.load_vectors import LoadMap
from .open_close.contact_set import ContactSet
from .open_close.equations import Unsettled
from .results import CrackResponse, NotConverged, StepResult
from .step_control.relative_motion import Windows
from .step_control.step_limits import CROSSING, UNSETTLED, StepLimits
from .time_step import Attempt

log = logging.getLogger(__name__)

#: Contacts of one step are sought anew, farther, so often at most; then it is cut.
_FARTHER = 6
#: A step is begun again so often where corners meet in another direction than was expected, …
_REDIRECTED = 3
#: … by more than this angle (cosine).
_OTHER_WAY = 0.95
#: Half the diagonal of the domain: no limit for what blocks that hold together move.
_ANYWHERE = 1.0
#: Multipliers are not asked to close gaps below this many times that round-off.
_FINEST = 10.0


@dataclass(eq=False)
class _Search:
    """What the contacts of a step are sought by, see `ContactFinder.find`."""

    finder: ContactFinder
    state: State
    vertices: np.ndarray
    near: Windows
    motion: np.ndarray | None
    margin: float
    glue_holds: bool = True
    broken: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))

    def find(self) -> ContactSet:
        return self.finder.find(
            self.state, self.vertices, self.near, self.glue_holds, broken=self.broken, motion=self.motion,
            margin=self.margin,
        )  # fmt: skip


class BlockSystem:
    """Blocks that move, deform and touch: first-order discontinuous deformation analysis (Shi 1988).

    ``joint_index(edge_name, other_name)`` gives the index in ``joints`` of the law between two edges; None from it
    means that such edges do not touch; without it the first law holds everywhere. Contact springs are
    ``settings.normal_penalty`` and ``shear_penalty`` (Pa), by default both 40 times the E' of the two blocks
    (`penalties`). ``work`` counts what is done, of systems that share it together.

    What every `Attempt` at a step reads is made once: ``density`` (kg/m³), ``mass`` (kg/m), ``stiffness`` and
    ``compliance`` (3, 3) of each block, ``constrained`` (what is held of its motion), ``rigid`` (indices), the ``finder`` of
    contacts and the ``load_map``; and anew when blocks are ``taken_out``: which ones are ``fixed``, ``moving``
    (indices), which of them ``turns``, and ``free``, the number of a block among those that move, −1 for the others.
    ``allowed_penetration`` (m) is zero where penalty springs hold alone; ``rounding`` (m) is that of coordinates:
    less is no motion; what it makes of blocks' weights is told once.

    Raises ValueError when there are no blocks, materials or joints are missing, a block has no area, or one that moves
    has no mass in a dynamic run.
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
        if not blocks.n_blocks:
            raise ValueError("there are no blocks to move")
        if int(np.max(blocks.material)) >= len(materials):
            raise ValueError(f"a block names material {int(np.max(blocks.material))}, but there are {len(materials)}")
        self.blocks = blocks
        self.materials = tuple(materials)
        self.joints = tuple(joints) or (JointLaw("frictionless"),)
        self.settings = settings or DdaSettings()
        self.scheme = TimeScheme.of(self.settings)
        self.load_map = LoadMap(blocks)
        self._stray_loads = StrayLoads(blocks)
        self._excavations = Excavations(blocks)

        of = np.asarray(blocks.material, dtype=int)
        self.density = np.array([m.density for m in self.materials])[of]
        self.stiffness = np.ascontiguousarray(np.array([m.stiffness() for m in self.materials])[of])
        self.compliance = np.ascontiguousarray(np.array([m.compliance() for m in self.materials])[of])
        modulus = np.array([m.plane_modulus for m in self.materials])[of]
        rigid = np.array([m.rigid for m in self.materials])[of]
        joint_index = joint_index or (lambda edge_name, other_name: 0)
        self._joint_index = joint_index
        areas = blocks.areas()
        self.mass = self.density * areas
        self.finder = ContactFinder(
            blocks, self.joints, joint_index, self.settings, modulus, rigid, self.mass, self.work
        )
        self.deflected: DeflectedBlocks | None = None
        #: What finds orders as the run goes; None where all are given.
        self.order_choice: OrderChoice | None = None
        self._take_out(None, None)
        #: Faces of cells that are glued; None where no blocks are cells.
        self.glued: GluedFaces | None = None
        ordered = blocks.order is not None and (np.asarray(blocks.order) != 1)[~self.fixed].any()
        if ordered or blocks.glued is not None:
            refuse_unsupported(blocks, self.materials, self.joints, self.settings)
            self._choose_orders()
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
        if (areas <= 0).any():
            raise ValueError(f"{blocks.names[int(areas.argmin())]}: the block has no area")
        self._refuse_massless()
        self.half_diagonal = 0.5 * float(np.hypot(*np.ptp(vertices, axis=0)))
        self.rounding, self.roundoff_reported = rounding_of(vertices), False
        self.limits = StepLimits(
            self.finder, self.settings, self.half_diagonal, self.vertex_start, self.next, self.work
        )
        self.allowed_penetration = self._allowed_penetration(float(np.sqrt(areas.min())))

    def _allowed_penetration(self, size: float) -> float:
        """m, of the multipliers' mode; 0 where penalty springs hold alone."""
        share = self.settings.penetration_tolerance
        if self.settings.contact == "penalty":
            return 0.0
        return max(share * size, _FINEST * self.rounding)

    def _refuse_massless(self) -> None:
        """In dynamics a block without mass has no equation of motion."""
        massless = ~self.fixed & (self.density == 0.0)
        if not self.scheme.static and massless.any():
            block = int(massless.argmax())
            material = self.materials[int(self.blocks.material[block])].name
            raise ValueError(
                f"{self.finder.names[block]!r} may move, but its material {material!r} has no density: in dynamics "
                "blocks without mass have no equation of motion"
            )

    def _choose_orders(self) -> None:
        """Blocks have the orders they are given, or those that their choice begins with."""
        choice = OrderChoice(
            self.blocks, self.fixed, self.density, self.stiffness, self.compliance, self.settings.order_target
        )
        self.order_choice = choice if choice.found.any() else None
        self.order = np.zeros(self.blocks.n_blocks, np.int64)
        self._take_orders(choice, choice.first)

    def _take_orders(self, choice: OrderChoice, order: np.ndarray) -> None:
        """Go on with blocks of these ``order`` (n_blocks,)."""
        if np.array_equal(order, self.order):
            return
        self.order, self.deflected, self._sparse = order, choice.deflected(order), None
        self.finder.at_corners = self.deflected is not None
        if self.blocks.glued is not None:
            self.glued = GluedFaces.of(self.deflected)
            self.finder.kept_corners = KeptCorners(self.deflected, self.finder.joined)
        self.finder.deflection, self.finder.sag = np.zeros((2, self.blocks.n_blocks))

    @property
    def step_limit(self) -> float:
        """The largest displacement of a vertex that a step may bring, m."""
        return self.limits.displacement

    def in_statics(self) -> BlockSystem:
        """The same blocks with a dynamic factor of zero: steps that carry no velocity."""
        settings = replace(self.settings, dynamic_factor=0.0)
        out = BlockSystem(self.blocks, self.materials, self.joints, self._joint_index, settings, self.work)
        out.finder.toes, out.finder.whole_faces = self.finder.toes, self.finder.whole_faces
        return out

    def with_joints(self, joints: Sequence[JointLaw]) -> BlockSystem:
        """The same blocks with other laws in the places of those that its joints have, in steps as long as they are asked
        for."""
        settings = replace(self.settings, max_displacement_ratio=_ANYWHERE)
        out = BlockSystem(self.blocks, self.materials, joints, self._joint_index, settings, self.work)
        out.finder.toes, out.finder.whole_faces = self.finder.toes, self.finder.whole_faces
        return out

    def removed(self, loads: Loads, time: float) -> np.ndarray | None:
        """(n_blocks,) True for blocks that ``loads`` have taken out by ``time``; None before any is."""
        return self._excavations.removed(loads, time)

    def _take_out(self, removed: np.ndarray | None, drained: np.ndarray | None) -> None:
        """Go on without the blocks ``removed`` (n_blocks,): they keep their place in all arrays, fixed and touching
        nothing; ``drained`` ones took the water with them."""
        self.taken_out = removed
        fixed = self.blocks.fixed if removed is None else self.blocks.fixed | removed
        self.fixed = np.ascontiguousarray(fixed, dtype=np.bool_)
        self.free = np.where(self.fixed, -1, np.cumsum(~self.fixed) - 1).astype(np.int64)
        self.moving = np.flatnonzero(~self.fixed)
        self.turns = ~self.fixed if self.blocks.constrained is None else ~(self.fixed | self.blocks.constrained[:, 2])
        self._sparse: tuple[np.ndarray, assembly.Pattern] | None = None
        self.finder.take_out(removed)
        self.load_map.take_out(removed, drained)

    def step(
        self,
        state: State,
        loads: Loads,
        dt: float | None = None,
        crack: CrackResponse | None = None,
        load_time: float | None = None,
        like: StepResult | None = None,
    ) -> StepResult:
        """Move ``state`` by ``dt`` (default: the settings' time step) under ``loads`` taken at the time that the scheme
        weighs them to (the end of the step in Shi's), or at ``load_time`` however short the step becomes. ``like``: the
        result of the same step with another ``crack``, from whose contact states iterations begin.

        A step whose contact states do not settle, or that moves a vertex too far, is halved or shortened and begun
        again from ``state``, which is never changed; ``result.dt`` says what was done, and the log why contacts wanted a
        shorter one. Raises `NotConverged` after ``settings.max_step_cuts`` cuts, and ValueError when blocks overlap
        before they have moved, or when nothing holds them up in statics.
        """
        choice = self.order_choice
        if choice is None:
            return self._step(state, loads, dt, crack, load_time, like)[1]
        refuse_unsupported_loads(loads)
        self._take_orders(choice, choice.first if state.order is None else np.asarray(state.order))
        while True:
            attempt, result = self._step(state, loads, dt, crack, load_time, like)
            order = choice.raised(self.order, self.deflected, attempt)
            if order is None:
                return replace(result, state=replace(result.state, order=self.order))
            if state.deflection is not None:
                state = replace(state, deflection=relaid(state.deflection, self.order, order))
            self._take_orders(choice, order)

    def _step(
        self, state: State, loads: Loads, dt: float | None, crack: CrackResponse | None, load_time: float | None,
        like: StepResult | None,
    ) -> tuple[Attempt, StepResult]:  # fmt: skip
        """As `step`, with blocks of the orders that they have."""
        dt = self.settings.time_step if dt is None else float(dt)
        if not 0 < dt < np.inf:
            raise ValueError(f"a time step must be positive, got {dt!r} s")
        # (Kernels are compiled for arrays that can be written to.)
        state = state.writable()
        self._stray_loads.refuse(loads)
        if self.deflected is not None:
            refuse_unsupported_loads(loads)
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
        gravity = loads.gravity.at(state.time + dt)
        dt = self.limits.foreseen(vertices, carried, moments, dt, gravity)
        search = self._search(state, vertices, carried, moments, dt, gravity)
        found = search.find()
        if like is not None:
            found = found.like(like.state.contacts)
            if self.scheme.static and found.tried is not None:
                # (In motion the step's arcs are those that the velocity foresees.)
                found = found.along(*like.arcs)
        reason, before = "", np.inf
        cuts, asked, failed, most, farther, redirected = 0, dt, "", 1.0, 0, 0
        while True:
            # What was tried before makes room first: its factors may be of other contacts than those of this attempt.
            attempt = result = None
            try:
                attempt = (Attempt if self.deflected is None else BendingAttempt)(
                    self, state, vertices, carried, moments, loads, dt, crack, found, cuts, load_time,
                )  # fmt: skip
                result = attempt.result()
            except Unsettled as failure:
                failed = reason = f"{failure}{self.finder.where(found, failure.contact)}"
                shorter, guilty = 0.5 * dt, (UNSETTLED, *found.blocks_of(failure.contact))
            else:
                bonded = result.contacts["bonded"]
                lost = (bonded != found.bonded) & found.inset
                unheld = found.relies_on_glue and (bonded < found.bonded).any()
                if unheld or lost.any():
                    # Corners that were left out, and springs that were moved, for the sake of a bond are back before it
                    # breaks.
                    search.broken = np.append(search.broken, found.vertex[lost] * len(vertices) + found.edge[lost])
                    search.glue_holds = found.relies_on_glue and not unheld
                    found = search.find()
                    continue
                if redirected < _REDIRECTED:
                    # Where corners meet is known once the step's motion is.
                    again = self._with_corners_of(attempt, search, result.contacts["state"])
                    if again is not None:
                        redirected, found = redirected + 1, again
                        continue
                used = self.limits.used(attempt, result)
                reason, guilty = used.reason, (used.why, *used.blocks)
                if used.share <= 1.0001 * most:
                    crossed = self.limits.crossed(attempt, result)
                    if crossed is None and cuts < self.settings.max_step_cuts:
                        crossed = self.limits.pressed_apart(attempt, result)
                    if crossed is None:
                        self._refuse_crushed(result.state)
                        if self.deflected is not None:
                            self.deflected.check_small(result.state)
                        self.limits.warn_of_penetration(result)
                        if failed:
                            log.info("step at t = %g s cut from %.4g to %.4g s: %s", state.time, asked, dt, failed)
                        result.statistics["limit_share"] = used.share
                        return attempt, result
                    wider = search.near.widened(crossed.pairs, crossed.motion, self.blocks.n_blocks)
                    if farther < _FARTHER and wider.reaches_beyond(search.near):
                        # What went in met no contact: with it the step may be as long.
                        search.near, search.motion, farther = wider, attempt.new_vertices - vertices, farther + 1
                        search.glue_holds = found.relies_on_glue
                        found = search.find()
                        continue
                    if cuts >= self.settings.max_step_cuts and not crossed.through:
                        log.warning("step at t = %g s: %s, and no shorter step avoids it", state.time, crossed.reason)
                        result.statistics["limit_share"] = used.share
                        return attempt, result
                    failed = reason = crossed.reason
                    guilty = CROSSING, *crossed.blocks
                    shorter, farther = 0.5 * dt, 0
                elif self.scheme.static and used.share > 0.9 * before:
                    # Static equilibrium under a load that does not shrink with dt: let it move, search far enough.
                    log.info("step at t = %g s: %s, and a shorter step does not help; accepted", state.time, reason)
                    most = 1.1 * used.share
                    search.near = search.near.widened(used.moved.pairs, 1.1 * used.moved.reach, self.blocks.n_blocks)
                    search.glue_holds = found.relies_on_glue
                    found = search.find()
                    continue
                else:
                    before = used.share
                    shorter = dt * min(0.8, max(0.05, 0.95 / used.share))
            cuts += 1
            if cuts > self.settings.max_step_cuts:
                raise NotConverged(
                    f"the block step at t = {state.time:g} s failed after {cuts - 1} cuts (dt = {dt:.3g} s): {reason}"
                    f"{self._way_out}"
                )
            self.limits.shortens(*guilty)
            log.debug("step at t = %g s cut from %.4g to %.4g s: %s", state.time, dt, shorter, reason)
            dt = shorter
            if not self.scheme.static:
                shorter = self._search(state, vertices, carried, moments, dt, gravity)
                search.near, search.motion, search.margin = shorter.near, shorter.motion, shorter.margin
                search.glue_holds = found.relies_on_glue or not len(search.broken)
                found = search.find()

    def _search(self, state, vertices, carried, moments, dt, gravity) -> _Search:
        """How a step of ``dt`` looks for contacts. Two corners may come nearer by their weight than their velocities say;
        what comes nearer still is looked for once the step is known."""
        return _Search(
            self.finder, state, vertices, self._near(state, vertices, carried, moments, dt, gravity),
            self._expected_motion(vertices, carried, moments, dt),
            np.inf if self.scheme.static else dt * dt * float(np.hypot(*gravity)),
        )  # fmt: skip

    def _expected_motion(self, vertices, carried, moments, dt) -> np.ndarray | None:
        """(n_vertices, 2) m: what the velocities ``carried`` make of a step of ``dt``; None where there are none."""
        if not carried.any():
            return None
        return MidpointConfiguration.of(dt * carried, 1.0, vertices, self.owner, moments).vertices - vertices

    def _with_corners_of(self, attempt: Attempt, search: _Search, state: np.ndarray) -> ContactSet | None:
        """The contacts with which the step is to be begun again because corners have met on the way that the ``attempt``
        went, with its contacts in ``state`` (n,), but not where they were expected to; None where all did."""
        found, moved = attempt.found, attempt.new_vertices - attempt.vertices
        if found.lumped is not None:
            found = found.lumped
        pressed = bool(((found.corner >= 0) & (state != OPEN)).any())
        strayed = np.abs(moved if search.motion is None else moved - search.motion).max()
        if not pressed and not strayed > 0.5 * search.margin:
            return None
        search.motion, search.glue_holds = moved, found.relies_on_glue
        again = search.find()
        if pressed and self._redirected(found, again, state):
            return again
        known = np.isin(again.vertex * len(moved) + again.edge, found.vertex * len(moved) + found.edge)
        missed = ~known & (
            self.finder.gaps(attempt.new_vertices, attempt.vertices, again) - again.lift < -again.precision
        )
        return again if missed.any() else None

    def _redirected(self, found: ContactSet, again: ContactSet, state: np.ndarray) -> bool:
        """Whether any pair of rounded corners that presses in ``state`` (n,) of ``found`` meets in another direction in
        ``again``."""
        known = {pair: c for c, pair in enumerate(zip(again.vertex.tolist(), again.edge.tolist(), strict=True))}
        previous = self.blocks.previous_vertex
        for c in np.flatnonzero((found.corner >= 0) & (state != OPEN)):
            v, w = int(found.vertex[c]), int(found.corner[c])
            names = ((v, w, 1), (v, int(previous[w]), 1), (w, v, -1), (w, int(previous[v]), -1))
            ways = [
                way * float(found.geometry[c, 1:3] @ again.geometry[known[v, e], 1:3])
                for v, e, way in names
                if (v, e) in known
            ]
            if max(ways, default=-1.0) < _OTHER_WAY:
                return True
        return False

    def contacts_near(self, state: State) -> ContactSet:
        """The contacts that a step from ``state`` would begin with, as CONTACT rows tell of them."""
        state = state.writable()
        vertices = np.ascontiguousarray(state.vertices)
        return self.finder.find(state, vertices, self._standing(state, vertices), lumped=True)

    def _near(self, state, vertices, carried, moments, dt, gravity) -> Windows:
        """Where a step of ``dt`` looks for contacts."""
        rows = state.contacts
        # What has yet to come nearer presses nowhere.
        lift = float(np.abs(rows["lift"][(rows["state"] != OPEN) | (rows["lift"] > 0.0)]).max(initial=0.0))
        if self.deflected is not None:
            lift += 2.0 * float(self.finder.deflection.max())
        return self.limits.windows(vertices, carried, moments, dt, gravity, lift)

    def _standing(self, state: State, vertices: np.ndarray) -> Windows:
        """Where blocks that stand look for contacts."""
        moments = block_moments(vertices, self.next, self.vertex_start)
        return self._near(state, vertices, np.zeros_like(state.velocity), moments, 0.0, np.zeros(2))

    def inherited_contacts(self, state: State, found: ContactSet, forces: InheritedContacts) -> np.ndarray:
        """CONTACT rows of ``found``, the contacts near ``state``, as ``forces`` say where they tell of one: for a
        `State` whose next step begins so."""

        def on_multiplier(contacts: ContactSet) -> np.ndarray:
            has_multipliers = bool(self.allowed_penetration)
            return self.finder.on_penalty(contacts)[0] if has_multipliers else np.zeros(len(contacts), bool)

        rows = inherited_rows(found, forces, self.finder.closure, on_multiplier(found))
        vertices = np.ascontiguousarray(state.vertices)
        placed = self.finder.find(replace(state, contacts=rows), vertices, self._standing(state, vertices))
        if placed.points is None:
            return rows
        return at_their_springs(rows, placed, forces.which, self.finder.closure, on_multiplier(placed))

    def _refuse_unsupported(self, loads: Loads, time: float) -> None:
        """In statics weight needs something to rest on: what falls for ever has no equilibrium."""
        holds = (
            self.fixed.any() or self.blocks.constrained is not None or loads.edge_tractions or loads.point_loads
            or loads.block_motions or loads.point_motions or loads.bolts or loads.viscous_boundaries or loads.water
        )  # fmt: skip
        if self.scheme.static and not holds and loads.gravity.at(time).any():
            raise ValueError(
                "no block is fixed, so that under gravity all of them fall and statics finds no equilibrium: fix a "
                "block, or let velocity be carried (dynamic_factor = 1)"
            )

    @property
    def _way_out(self) -> str:
        """What may help a run in motion whose steps fail."""
        if self.scheme.static or self.settings.springs == "resolved":
            return ""
        return '; dda.springs = "resolved" may go on, with contacts no stiffer than the time step resolves'

    def _refuse_crushed(self, state: State) -> None:
        area = block_moments(state.vertices, self.next, self.vertex_start)[:, 0]
        if not (area > 0).all():
            crushed = int(np.argmin(area > 0))
            name = self.blocks.names[crushed] if self.blocks.names else f"block {crushed}"
            raise NotConverged(
                f"{name!r} is crushed to nothing at t = {state.time:g} s: its loads are beyond its stiffness"
            )

    def pattern_of(
        self, block: np.ndarray, other: np.ndarray, moments: np.ndarray, linked: tuple[np.ndarray, np.ndarray] | None
    ) -> assembly.Pattern:
        """Where the matrix of blocks that touch, ``block`` with ``other`` (n,), or are ``linked`` by bolts has entries,
        and its solver: kept from step to step while the same blocks do."""
        if linked is not None:
            block, other = np.concatenate([block, linked[0]]), np.concatenate([other, linked[1]])
        if self.glued is not None:
            block, other = np.concatenate([block, self.glued.block]), np.concatenate([other, self.glued.other])
        if self.deflected is not None:
            known = None if self._sparse is None else self._sparse[1]
            pattern = six_row_pattern(self.free, self.deflected.rows, block, other, moments[:, 1:3], known)
            if pattern.solver is not None:
                pattern.solver.work = self.work
            self._sparse = np.zeros((2, 0)), pattern
            return pattern
        if int(self.free.max()) + 1 <= assembly.DENSE_BLOCKS:
            return assembly.dense_pattern(self.free, block, other)
        pairs, pattern = np.stack([block, other]), None
        if self._sparse is not None:
            known, pattern = self._sparse
            if pattern.order is self.free and np.array_equal(known, pairs):
                return pattern
        kept = None if pattern is None else pattern.solver
        pattern = assembly.sparse_pattern(self.free, block, other, moments[:, 1:3], kept)
        pattern.solver.work = self.work
        self._sparse = pairs, pattern
        return pattern
