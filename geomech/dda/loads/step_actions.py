"""Prescribed motion and bolts in a time step, whose states are found together with the contact states, and loads of a
step beyond their mean over it.

A scheme takes the loads of one time in a step (its end in statics and in Shi's scheme), whereas the work of a load that
varies is that of its mean, as the work of stress and of contact forces on the straight line from the start to the end of
the step: in statics ½ (F₀ + F₁)·d, in motion F(t₀ + ½ dt)·d. What the scheme takes beyond it belongs to the scheme, like
(θ − ½) A Δσ·Δε, which it balances: a load that grows slowly loses nothing, however many steps it takes. Nothing changes
under constant loads, nor with the trapezoidal rule, which takes the loads of the middle of the step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple, Protocol, Self

import numpy as np

from ...model import BOLT, GROUND, Loads, State
from ..kinematics.midpoint_configuration import MidpointConfiguration
from ..linear_solver.assembly import Links, Pattern
from ..open_close.contact_set import ContactSet
from ..open_close.settled_states import Settled
from ..results import contact_resultants
from .bolts import ROUNDS, BoltSet, check_bolts, labels
from .force_records import POINT_FORCE
from .load_vectors import generalised
from .prescribed_motion import MovedBlocks, Pairs, PrescribedMotion

#: (pattern, matrix, right side, contacts, gaps) → settled contacts.
Settle = Callable[[Pattern, np.ndarray, np.ndarray, ContactSet, np.ndarray], Settled]


class MaterialPoints(Protocol):
    """Where material points of blocks are."""

    def point(self, block: int, at: tuple[float, float], vertices: np.ndarray) -> np.ndarray:
        """As `LoadMap.point`."""
        ...


def effective_gravity(
    loads: Loads, start: float, acting: float, dt: float, static: bool, ahead: float = 0.0
) -> np.ndarray:
    """Effective gravity (2,), m/s²: gravity at the time ``acting`` minus the acceleration of a moving base frame.

    The base acceleration is averaged over ``dt`` from ``start`` + ``ahead`` (s): over the step for ``ahead`` 0, so that
    velocities are exact. In statics it is the value at ``acting``."""
    gravity = loads.gravity.at(acting)
    if loads.base is None or loads.base.frame != "base":
        return gravity
    record = loads.base.acceleration
    if static:
        return gravity - record.at(acting)
    return gravity - (record.integral(start + ahead + dt) - record.integral(start + ahead)) / dt


class LoadRows(Protocol):
    """Gives POINT_FORCE and EDGE_FORCE rows, as `LoadMap.rows`."""

    def rows(
        self, loads: Loads, time: float, vertices: np.ndarray, rotation: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]: ...


class BeyondMean(NamedTuple):
    """Loads that a step takes minus their mean over it.

    gravity   (2,) m/s², effective gravity
    parts     (factor, POINT_FORCE rows, EDGE_FORCE rows): the loads are the sum of these rows times their factors
    """

    gravity: np.ndarray
    parts: list[tuple[float, np.ndarray, np.ndarray]]

    def load(self, centroid: np.ndarray) -> np.ndarray:
        """(n_blocks, 6) generalised forces about ``centroid`` (n_blocks, 2), N and N m."""
        out = np.zeros((len(centroid), 6))
        for factor, points, edges in self.parts:
            out += factor * generalised(points, edges, centroid)
        return out


def beyond_mean(
    loads: Loads, span: tuple[float, float, float], static: bool, taken: tuple[np.ndarray, np.ndarray, np.ndarray],
    rows: LoadRows, at: tuple[np.ndarray, np.ndarray],
) -> BeyondMean | None:  # fmt: skip
    """The loads of a step beyond their mean; None where the step takes the mean.

    ``span``: start of the step, the time whose loads it takes, and its length, s. ``taken``: effective gravity, and the
    POINT_FORCE and EDGE_FORCE rows that act; ``at``: vertices (n_vertices, 2) and rotations (n_blocks,) of these rows."""
    start, acting, dt = span
    times = (start, acting) if static else (start + 0.5 * dt,)
    gravity, points, edges = taken
    mean = np.mean([effective_gravity(loads, start, time, dt, static) for time in times], axis=0)
    parts = []
    if any(time != acting for time in times) and (loads.point_loads or loads.edge_tractions or loads.water is not None):
        parts = [(1.0, points, edges), *((-1.0 / len(times), *rows.rows(loads, time, *at)) for time in times)]
    return BeyondMean(gravity - mean, parts) if parts or (gravity != mean).any() else None


class StepActions:
    """Prescribed motion and bolts of one attempt at a step; methods in the order in which the step calls them."""

    #: What imposes motion.
    motion: type[PrescribedMotion] = PrescribedMotion

    def __init__(
        self, moved: MovedBlocks, loads: Loads, state: State, points: MaterialPoints, midpoint: MidpointConfiguration,
        order: np.ndarray, end: float,
    ) -> None:  # fmt: skip
        self.blocks, self.order, self.loads, self.points = moved.blocks, order, loads, points
        self.moments = midpoint.moments
        vertices = state.vertices

        def point_at(block: int, at: tuple[float, float]) -> np.ndarray:
            return points.point(block, at, vertices)

        self.imposed: PrescribedMotion | None = None
        shaken = loads.base is not None and loads.base.frame == "ground"
        if shaken or loads.block_motions or loads.point_motions:
            self.imposed = self.motion(moved, loads, midpoint, point_at, state.imposed, state.time, end)
        self.bolts: BoltSet | None = None
        self.memory = np.empty(0, BOLT)
        if loads.bolts:
            check_bolts(loads.bolts, moved.blocks.fixed)
            self.bolts, self.memory = BoltSet.of(
                loads.bolts, state.bolts, state.time, point_at, order, midpoint, moved.removed
            )
        #: (n_contacts,) m: contacts' motion along their edges due to the motion of fixed blocks.
        self.along = np.zeros(0)
        self._motion = np.zeros((0 if self.bolts is None else len(self.bolts.number), 2))
        #: Whether contacts are settled together with the limits of bolts (`ForceLimits`).
        self.limits_in_settle = False

    @classmethod
    def of(
        cls, moved: MovedBlocks, loads: Loads, state: State, points: MaterialPoints, midpoint: MidpointConfiguration,
        order: np.ndarray, end: float,
    ) -> Self | None:  # fmt: skip
        """The actions of a step; None where ``loads`` are forces only."""
        shaken = loads.base is not None and loads.base.frame == "ground"
        if not (shaken or loads.block_motions or loads.point_motions or loads.bolts):
            return None
        return cls(moved, loads, state, points, midpoint, order, end)

    @property
    def linked(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Pairs of blocks that bolts link; None without. A bolt to the ground links its block with itself."""
        if self.bolts is None:
            return None
        pairs = self.bolts.pairs
        return pairs.block, np.where(pairs.other == GROUND, pairs.block, pairs.other)

    def constrained(self, constrained: np.ndarray | None) -> np.ndarray | None:
        """The constraints of ``constrained`` (n_blocks, 6) that the step itself imposes: without those of blocks with
        prescribed motion, which impose them together with it."""
        if constrained is None:
            return None
        if self.imposed is not None:
            constrained = self.imposed.without_prescribed(constrained)
        if self.bolts is not None:
            pairs = self.bolts.pairs
            for side, owner in enumerate((pairs.block, pairs.other)):
                movable = owner >= 0
                pairs.vectors[movable, :, 6 * side : 6 * side + 6] *= ~constrained[owner[movable], None]
        return constrained

    def settle(
        self, pattern: Pattern, matrix: np.ndarray, right: np.ndarray, vectors: np.ndarray, acting: np.ndarray,
        found: ContactSet, gap: np.ndarray, settle: Settle,
    ) -> tuple[Settled, np.ndarray]:  # fmt: skip
        """Converged contacts, and the solver's unknowns (n_free, 6) with prescribed ones.

        Changes ``matrix``, ``right`` and ``vectors`` in place to those of the solved equations. Prescribed motion is
        added to the contacts' initial gaps and tangential motion. ``acting`` (n, 7): geometry of the contacts where
        they act. Raises `Unsettled`."""
        if self.bolts is not None:
            self.bolts.stiffen_turning(matrix, self.order, self.moments)
        shift = np.zeros((len(found), 2))
        self.along = shift[:, 1]
        if self.imposed is not None:
            point, normal = acting[:, 5:7], acting[:, 1:3]
            along = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
            contacts = Pairs(
                found.block, found.other, vectors, np.stack([point, point], axis=1), np.stack([normal, along], axis=1),
                1.0, shift,
            )  # fmt: skip
            self.imposed.impose(matrix, right, [contacts, *self._bolted()], self.order)
            self._shift_more(found, vectors, shift)
        if shift.any():
            geometry = found.geometry.copy()
            geometry[:, 3] += shift[:, 0]
            found = replace(found, geometry=geometry, stretch=found.stretch + shift[:, 1])
            gap = gap + shift[:, 0]
        settled = self._with_bolts(pattern, matrix, right, found, gap, settle)
        unknowns = settled.unknowns
        if self.imposed is not None:
            unknowns = self.imposed.recover(unknowns, self.order)
        return settled, unknowns

    def _shift_more(self, found: ContactSet, vectors: np.ndarray, shift: np.ndarray) -> None:
        """Add the motion of the contacts ``found`` due to other prescribed unknowns to ``shift`` (n, 2), in place."""

    def _bolted(self) -> list[Pairs]:
        return [] if self.bolts is None else [self.bolts.pairs]

    def _with_bolts(self, pattern, matrix, right, found, gap, settle: Settle) -> Settled:
        if self.bolts is None:
            return settle(pattern, matrix, right, found, gap)
        if self.limits_in_settle:
            self.bolts.let_elastic()
        for _ in range(ROUNDS):
            own, side, across = self.bolts.assemble(matrix, right, self.order)
            settled = settle(replace(pattern, links=self._links(pattern, across)), own, side, found, gap)
            self._motion = self.bolts.motion(settled.unknowns, self.order)
            if self.bolts.take_states(self._motion) or self.limits_in_settle:
                return settled
        raise self.bolts.unsettled()

    def _links(self, pattern: Pattern, across: np.ndarray) -> Links:
        """Off-diagonal blocks ``across`` (n, 6, 6) between the two ends of every bolt, and their transposes, as
        links."""
        assert self.bolts is not None
        pairs, n = self.bolts.pairs, len(self.bolts.number)
        row, column = self.order[pairs.block], np.where(pairs.other == GROUND, -1, self.order[pairs.other])
        both = np.flatnonzero((row >= 0) & (column >= 0))
        at = len(pattern.upper) - n + both
        a, b = np.arange(6)[:, None], np.arange(6)
        upper = pattern.upper[at, None, None] + a * pattern.stride[row[both], None, None] + b
        lower = pattern.lower[at, None, None] + a * pattern.stride[column[both], None, None] + b
        return Links(
            row=np.concatenate([row[both], column[both]]),
            column=np.concatenate([column[both], row[both]]),
            places=np.concatenate([upper, lower]),
            blocks=np.concatenate([across[both], across[both].transpose(0, 2, 1)]),
        )

    # -- after ---------------------------------------------------------------------------------------------------------

    def bolt_forces(self) -> np.ndarray:
        """(n, 2) forces of the acting bolts, N; with their pairs' vectors they give generalised forces."""
        return np.zeros((0, 2)) if self.bolts is None else self.bolts.forces(self._motion)

    def point_rows(self) -> np.ndarray:
        """POINT_FORCE rows of the acting bolts and, after `acted`, of the forces that move points."""
        rows = [] if self.bolts is None else [self.bolts.point_rows(self.bolt_forces())]
        rows += [] if self.imposed is None else [self.imposed.at_points]
        return np.concatenate(rows) if rows else np.zeros(0, POINT_FORCE)

    @property
    def largest_bolt_force(self) -> float:
        """Largest bolt force, N."""
        return float(np.abs(self.bolt_forces()).max(initial=0.0))

    def with_bolt_forces(self, right: np.ndarray) -> np.ndarray:
        """(n_free, 6) the right side of the solved equations plus the bolts' forces."""
        if self.bolts is None:
            return right
        pairs, push = self.bolts.pairs, np.einsum("nk,nka->na", self.bolt_forces(), self.bolts.pairs.vectors)
        spare = np.vstack([right, np.zeros((1, 6))])
        np.add.at(spare, self.order[pairs.block], push[:, :6])
        np.add.at(spare, np.where(pairs.other == GROUND, -1, self.order[pairs.other]), push[:, 6:])
        return spare[:-1]

    def work_forces(self, reaction: np.ndarray | None, contacts: np.ndarray, centroid: np.ndarray) -> np.ndarray:
        """(n_blocks, 6) forces that do the work of prescribed motion, N and N m: ``reaction`` on moving blocks, the
        opposite of contact forces (CONTACT rows) on fixed ones."""
        out = np.zeros((self.blocks.n_blocks, 6)) if reaction is None else reaction.copy()
        if self.imposed is not None and self.imposed.moving_base:
            driven = self.imposed.increment.any(axis=1)
            out[driven, :3] -= contact_resultants(contacts, self.blocks.n_blocks, centroid)[driven]
        return out

    def acted(
        self, settled: Settled, unknowns: np.ndarray, contacts: np.ndarray, points: np.ndarray, new_vertices: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray | None, dict[str, float]]:
        """(POINT_FORCE rows ``points`` plus those of bolts and point motions; reactions (n_blocks, 6) of block motions,
        N and N m, None without; statistics). Updates the bolts' history. ``contacts``: CONTACT rows."""
        rows, reaction, statistics = [points], None, {}
        if self.imposed is not None:
            pushes = [
                np.stack([settled.normal_force, settled.shear_force], axis=1),
                *([self.bolt_forces()] * len(self._bolted())),
            ]
            reaction, at_points = self.imposed.reactions(unknowns, pushes, self.order)
            rows.append(at_points)
        if self.bolts is not None:
            forces = self.bolt_forces()
            self.bolts.remember(self.memory, self._motion, lambda b, at: self.points.point(b, at, new_vertices))
            rows.append(self.bolts.point_rows(forces))
        if self.loads.bolts:
            for label, row in zip(labels(self.loads.bolts), self.memory, strict=True):
                statistics[f"bolt:{label}"] = float(row["force"])
        all_points = np.concatenate([part.astype(POINT_FORCE, copy=False) for part in rows])
        for k in range(len(self.loads.point_motions)):
            fx, fy = at_points[k]["force"]
            statistics[f"reaction_x:point {k + 1}"], statistics[f"reaction_y:point {k + 1}"] = float(fx), float(fy)
        driven = [motion.block for motion in self.loads.block_motions]
        on_fixed = -contact_resultants(contacts, self.blocks.n_blocks, self.moments[:, 1:3]) if driven else np.zeros(0)
        for b in driven:
            force = reaction[b] if reaction is not None and self.order[b] >= 0 else on_fixed[b]
            for axis, value in zip("xy", force.tolist()):
                statistics[f"reaction_{axis}:{self.blocks.names[b]}"] = value
        return all_points, reaction, statistics
