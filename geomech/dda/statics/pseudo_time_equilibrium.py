"""Static equilibrium by pseudo-transient continuation of static steps.

A static step, which carries no velocity over, solves (2M/dt² + K) d = F: the inertia term 2M d/dt² carries the
unbalanced force. With small dt the blocks move little until their contacts have closed; large dt is Newton's method for
statics. dt therefore starts at some transit times of sound through a block and grows from step to step
(pseudo-transient continuation: Mulder & van Leer 1985; Kelley & Keyes 1998), until 2M d/dt² is below the tolerance. Unsupported
blocks keep moving: they have collapsed. Blocks that come to rest only beyond the `displacement_limit`, such as a block
that slides onto a floor, have collapsed as well.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...model import OPEN, Loads, State, counted
from ...model.former_names import gathered_arguments
from ..energy_balance import StepEnergy
from ..joint_laws.penalty_springs import PENALTY_RATIO
from ..kinematics.simplex_integration import block_moments
from ..kinematics.tolerances import NOTHING
from ..results import CrackResponse, NotConverged, StepResult
from ..system import BlockSystem
from .displacement_limit import DisplacementLimit

log = logging.getLogger(__name__)

#: One row per static step.
RELAXATION_STEP = np.dtype(
    [
        ("dt", np.float64),  # s, of pseudo-time
        ("unbalanced", np.float64),  # largest unbalanced force on a block over the mean force on blocks
        ("kinetic_energy", np.float64),  # J/m, of the motion d/dt
        ("displacement", np.float64),  # m, largest of a block's centroid in the step
        ("iterations", np.int64),  # open–close iterations
        ("cuts", np.int64),
    ]
)
#: Length of the first step in transit times of sound through the smallest block. A wall of a thousand bricks takes 103,
#: 69, 65, 51 and 55 open–close iterations for values of 10, 30, 100, 300 and 1000, the last after one cut; in much
#: shorter steps forces change so little that round-off decides contact states.
_FIRST_TRANSITS = 100.0
#: Growth factor of dt per step, and the fraction of the allowed displacement above which dt stays constant.
_GROWTH, _NEARLY = 4.0, 0.3
#: Blocks that have moved by this fraction of their size √area, and are no closer to balance after this number of steps,
#: keep moving; a block in free flight (unbalanced by nearly its weight) may still land. Stable walls and slopes take 3
#: to 15 steps.
_GONE, _IN_VAIN, _FLYING = 0.05, 25, 0.99
#: Inertia stays above this fraction of the contact stiffness, so that unloaded blocks stay in place.
_LEAST_INERTIA = 1e-10
#: Most steps in which blocks without equilibrium are followed, most cuts of them and most open–close iterations beyond one
#: a step, so that this takes about as long as the search for the factor (a single block that slides by its size: 57 steps
#: and 1; 200 blocks: 5 and 60).
_FOLLOWED, CUTS, _ITERATIONS = 60, 2, 50


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """Where static relaxation ended.

    state       at the time it began, with no velocity
    converged   True: the unbalanced force is below the tolerance
    collapsed   True: there is no equilibrium within reach; ``moving``: the blocks that move, the fastest first
    reason      one sentence
    history     RELAXATION_STEP rows, one per step
    moved       (n_blocks,) m, largest displacement of each block's vertices; of blocks drawn apart from all others,
                since they landed
    result      the final StepResult, with contact and other forces (None if no step was made)
    energies    of each static step, J/m; the work of loads that differ from those at the time it began is that of their mean
    """

    state: State
    converged: bool
    collapsed: bool
    moving: tuple[int, ...]
    reason: str
    history: np.ndarray
    moved: np.ndarray
    result: StepResult | None
    energies: tuple[StepEnergy, ...] = ()


@dataclass(frozen=True, eq=False)
class RelaxationLimits:
    """When blocks that find no equilibrium are given up.

    max_steps  largest number of steps
    limit      blocks that move farther than it allows have collapsed; None: a limit from the state at the start
    reach      m: an unbalanced block that has moved this far has collapsed, too. None: a tenth of the extent of the blocks,
               or a twentieth of the block's own size once the unbalanced force no longer decreases. If it is given, no
               other limit applies
    follow     collapsed blocks are followed until they come to rest nearby
    """

    max_steps: int = 400
    limit: DisplacementLimit | None = None
    reach: float | None = None
    follow: bool = True


@gathered_arguments("limits", RelaxationLimits)
def equilibrium(
    system: BlockSystem,
    state: State,
    loads: Loads,
    *,
    load_time: float | None = None,
    tolerance: float = 1e-6,
    crack: CrackResponse | None = None,
    watch: Callable[[StepResult, np.void], None] | None = None,
    limits: RelaxationLimits | None = None,
) -> Equilibrium:
    """Find the equilibrium of the blocks of ``system`` from ``state`` under ``loads`` at ``load_time`` (default:
    state.time).

    ``tolerance`` bounds the unbalanced force on any block over the mean force on blocks; ``limits`` say when the search is
    given up. ``watch`` is called with every step and its RELAXATION_STEP. Raises ValueError for a tolerance that is not
    positive.
    """
    if not tolerance > 0:
        raise ValueError(f"the tolerance of the unbalanced force must be positive, got {tolerance!r}")
    blocks = system.blocks
    static = system if system.scheme.static else system.in_statics()
    time = state.time if load_time is None else load_time
    state = replace(state, velocity=np.zeros_like(state.velocity), acceleration=None)
    free = np.flatnonzero(~blocks.fixed)
    if not len(free):
        nothing = np.zeros(blocks.n_blocks)
        return Equilibrium(state, True, False, (), "nothing moves", np.empty(0, RELAXATION_STEP), nothing, None)
    until = limits or RelaxationLimits()
    relaxation = _Relaxation(static, state, loads, time, until.reach, crack, until.limit)
    return relaxation.run(tolerance, until.max_steps, watch, until.follow)


@dataclass(frozen=True, eq=False)
class Travel:
    """How far blocks without equilibrium go in static steps, which carry no velocity.

    moved    (n_blocks,) m, largest displacement of each block's vertices
    rests    whether they come to rest
    reason   one sentence where they neither come to rest nor go beyond the reach of the search; otherwise empty
    """

    moved: np.ndarray
    rests: bool
    reason: str


def travel(system: BlockSystem, state: State, loads: Loads, load_time: float, reach: float) -> Travel:
    """Follow the blocks of a static ``system`` from ``state`` under the loads at ``load_time`` s until they come to rest
    or one has moved by ``reach`` m."""
    system.limits.warns = False
    relaxation = _Relaxation(system, state, loads, load_time, reach, None, None)
    relaxation.most_cuts, relaxation.most_iterations = CUTS, _ITERATIONS
    end = relaxation.run(NOTHING, _FOLLOWED, None, True)
    way = np.hypot(*(end.state.vertices - state.vertices).T)
    moved = np.maximum.reduceat(way, system.vertex_start[:-1])
    return Travel(moved, end.converged, "" if end.converged or end.collapsed else end.reason)


class _Relaxation:
    """Static steps of ``system`` from ``state`` under the loads at ``time``; arguments as for `equilibrium`."""

    def __init__(
        self, system: BlockSystem, state: State, loads: Loads, time: float, reach: float | None,
        crack: CrackResponse | None, limit: DisplacementLimit | None,
    ) -> None:  # fmt: skip
        blocks = system.blocks
        self.system, self.loads, self.time, self.crack = system, loads, time, crack
        self.state, self.start = state, state.time
        self.limit = limit or DisplacementLimit(system, state, loads, time)
        # A given reach replaces the displacement limit.
        self.limited = reach is None
        self.reach = 0.1 * float(np.hypot(*np.ptp(blocks.vertices, axis=0))) if reach is None else reach
        self.size = np.sqrt(blocks.areas())
        self.travelled = np.zeros(blocks.n_blocks)
        self.history: list[np.void] = []
        self.energies: list[StepEnergy] = []
        self.result: StepResult | None = None
        #: Blocks that have moved beyond the limit, and the last step in which a block was in free flight.
        self.beyond_limit: tuple[int, ...] = ()
        self.last_flight = 0
        #: Numbers of step cuts, and of open–close iterations beyond one a step, after which the relaxation ends.
        self.most_cuts, self.most_iterations = np.inf, np.inf

    def run(
        self, tolerance: float, max_steps: int, watch: Callable[[StepResult, np.void], None] | None, follow: bool
    ) -> Equilibrium:
        """Step until the blocks are at rest, have collapsed, or ``max_steps`` are used up."""
        dt, longest = pseudo_times(self.system)
        for _ in range(max_steps):
            try:
                self.result = result = self.system.step(
                    self.state, self.loads, dt, self.crack, self.time, pseudo_inertia=True
                )
            except NotConverged as failure:
                return self._ended(False, bool(self.beyond_limit), str(failure))
            row, moved = self._take(result)
            if watch is not None:
                watch(result, row)
            self.limit.follow(result)
            if self.limited and not self.beyond_limit:
                self.beyond_limit = tuple(self.limit.beyond(self.state).tolist())
            if row["unbalanced"] <= tolerance:
                return self._at_rest(float(row["unbalanced"]))
            if self.beyond_limit and not follow:
                break
            self.travelled += moved
            if self._takes_too_long():
                return self._ended(False, False, "contacts find their states too slowly to go on")
            statistics = result.statistics
            collapse = self._collapse(statistics["unbalanced_ratio"])
            if collapse:
                return self._ended(False, True, collapse)
            moves_far = statistics["limit_share"] > _NEARLY
            dt = min(result.dt if moves_far else _GROWTH * result.dt, longest)
        if self.beyond_limit:
            farthest = self.limit.moved(self.state.vertices).max()
            return self._ended(False, True, f"no equilibrium: blocks have moved {farthest:.3g} m and go on")
        unbalanced = self.history[-1]["unbalanced"]
        return self._ended(False, False, f"unbalanced force {unbalanced:.2g} after {max_steps} steps")

    def _takes_too_long(self) -> bool:
        cuts, iterations = (sum(int(row[name]) for row in self.history) for name in ("cuts", "iterations"))
        return cuts > self.most_cuts or iterations - len(self.history) > self.most_iterations

    def _take(self, result: StepResult) -> tuple[Any, np.ndarray]:
        """Accept ``result``; returns its RELAXATION_STEP and the displacements (n_blocks,) of the centroids, m."""
        # Pseudo-time is not the time of the loads, which do not change here.
        self.state = replace(result.state, time=self.start)
        moved = np.hypot(*(result.forces.centroid - _centroids(self.system, self.state)).T)
        statistics = result.statistics
        row: Any = np.array(
            (
                result.dt,
                unbalanced_force(self.system, result),
                statistics["kinetic_energy"],
                moved.max(),
                statistics["open_close_iterations"],
                statistics["step_cuts"],
            ),
            RELAXATION_STEP,
        )[()]
        self.history.append(row)
        self.energies.append(result.energy)
        return row, moved

    def _at_rest(self, unbalanced: float) -> Equilibrium:
        """The result for balanced blocks: a collapse if they had to move beyond the limit."""
        if self.beyond_limit:
            far = self.limit.moved(self.state.vertices)[list(self.beyond_limit)].max()
            return self._ended(
                False, True, f"no equilibrium where the blocks are: they come to rest {far:.3g} m farther"
            )
        return self._ended(True, False, f"unbalanced force {unbalanced:.2g} of the mean force")

    def _collapse(self, unbalanced_ratio: float) -> str:
        """The reason why unbalanced blocks have collapsed; "" if they may still come to rest."""
        farthest, n = self.travelled.max(), len(self.history)
        if farthest > self.reach:
            return f"no equilibrium: blocks have moved {farthest:.3g} m and go on"
        if unbalanced_ratio > _FLYING:
            self.last_flight = n
        since = n - _IN_VAIN
        if not self.limited or since <= self.last_flight or not (self.travelled > _GONE * self.size).any():
            return ""
        forces = [float(row["unbalanced"]) for row in self.history]
        if min(forces[since:]) < min(forces[:since]):
            return ""
        return f"no equilibrium: blocks have moved {farthest:.3g} m, and {_IN_VAIN} steps brought no more balance"

    def _ended(self, converged: bool, collapsed: bool, reason: str) -> Equilibrium:
        """The result, with the moving blocks named in its ``reason``."""
        blocks, state, moving = self.system.blocks, self.state, self.beyond_limit
        if not converged and not moving and self.result is not None:
            speed = np.hypot(*self.result.state.velocity[:, :2].T)
            order = np.argsort(-speed, kind="stable")
            moving = tuple(order[speed[order] > 0.1 * speed.max()].tolist())
        if not converged and moving:
            named = ", ".join(repr(blocks.names[b]) for b in moving[:5])
            reason += f"; {named}{' and others' if len(moving) > 5 else ''} move{'s' if len(moving) == 1 else ''}"
        rest = replace(state, time=self.start, velocity=np.zeros_like(state.velocity))
        rows = np.array(self.history, RELAXATION_STEP) if self.history else np.empty(0, RELAXATION_STEP)
        log.info("static equilibrium: %s (%s)", reason, counted(len(rows), "step"))
        moved = self.limit.moved(state.vertices)
        return Equilibrium(rest, converged, collapsed, moving, reason, rows, moved, self.result, tuple(self.energies))


def pseudo_times(system: BlockSystem) -> tuple[float, float]:
    """First and longest step, s; blocks without mass do not count."""
    free = ~system.blocks.fixed & (system.density > 0)
    if not free.any():
        return 1.0, 1.0
    stiffness = np.array([m.plane_modulus for m in system.materials])[np.asarray(system.blocks.material, int)]
    area = system.blocks.areas()
    transit = np.sqrt(area * system.density / stiffness)[free].min()
    lightest = (system.density * area)[free].min()
    return _FIRST_TRANSITS * transit, _inertia_less(float(lightest), float(stiffness.max()))


def settling_time(system: BlockSystem) -> float:
    """Length, s, of a step by operator splitting, whose springs keep light blocks in place without inertia: that of
    `pseudo_times` for the median block."""
    mass = (system.density * system.blocks.areas())[~system.blocks.fixed & (system.density > 0)]
    if not len(mass):
        return 1.0
    return _inertia_less(float(np.median(mass)), max(m.plane_modulus for m in system.materials))


def _inertia_less(mass: float, stiffness: float) -> float:
    """s: the longest step in which the inertia of a ``mass`` kg/m counts among contacts of ``stiffness`` E' Pa."""
    return math.sqrt(2.0 * mass / (_LEAST_INERTIA * PENALTY_RATIO * stiffness))


def _centroids(system: BlockSystem, state: State) -> np.ndarray:
    blocks = system.blocks
    return block_moments(state.vertices, blocks.next_vertex, blocks.vertex_start)[:, 1:3]


def rounding_force(system: BlockSystem) -> float:
    """Force in the stiffest contact springs due to the rounding of coordinates, N/m."""
    modulus = max((m.plane_modulus for m in system.materials if not m.rigid), default=0.0)
    return PENALTY_RATIO * modulus * system.rounding


def unbalanced_force(system: BlockSystem, result: StepResult) -> float:
    """Largest unbalanced force (or moment over √area) on a free block in a static step: its inertia 2M d/dt², over the
    mean magnitude of all forces, contact forces and loads, on free blocks; 0 without forces. Contact forces from the
    rounding of coordinates do not count: separated blocks without weight are at rest."""
    free = ~system.blocks.fixed
    f, a = result.forces, result.acceleration
    h2 = f.area
    mass = f.inertia.density * f.area
    # For a rotation the moment of inertia is about m h²/6: the bound suffices.
    out = mass * np.maximum(np.hypot(a[:, 0], a[:, 1]), np.sqrt(h2) / 6 * np.abs(a[:, 2]))
    if system.deflected is not None:
        out = np.maximum(out, mass * system.deflected.acceleration)
    acting = mass * float(np.hypot(*f.inertia.gravity))
    for rows in (f.points, f.edges):
        np.add.at(acting, rows["block"], np.hypot(rows["force"][:, 0], rows["force"][:, 1]))
    closed = result.contacts[result.contacts["state"] != OPEN]
    push = np.hypot(closed["normal_force"], closed["shear_force"])
    for side in ("block", "other"):
        np.add.at(acting, closed[side], push)
    mean = max(float(acting[free].mean()), rounding_force(system))
    return float(out[free].max()) / mean if mean > 0 else 0.0
