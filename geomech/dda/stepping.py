"""Runs of blocks without cracks: steps until an end time, with checks of the energy balance and of strains."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

from ..model import Blocks, DdaSettings, JointLaw, Joints, Loads, Material, Motion, State
from ..model.former_names import folded_argument
from .energy_balance import EnergyBudget
from .excavation import until_next_event
from .kinematics.strain_limits import ElasticRange
from .results import NotConverged, StepResult
from .statics.counted_resistance import warn_of_toes, warn_of_toes_at_rest
from .statics.pseudo_time_equilibrium import Equilibrium, equilibrium
from .step_control.adaptive_time_step import StepLength
from .step_control.overlap_energy import Overlap, OverlapWatch
from .system import BlockSystem

log = logging.getLogger(__name__)


@dataclass(eq=False)
class _Watch:
    """Checks of each step: energy gained without work or created by overlaps, strains beyond the elastic range."""

    blocks: Blocks
    budget: EnergyBudget = field(default_factory=EnergyBudget)
    range: ElasticRange = field(default_factory=ElasticRange)
    overlaps: OverlapWatch = field(default_factory=OverlapWatch)

    def look(self, before: State, result: StepResult) -> None:
        state = result.state
        budget = self.budget.cut() if state.removed is not before.removed else self.budget
        self.budget = budget.after(result.energy, state.time)
        overlap = None if result.overlap is None else Overlap(*result.overlap)
        self.overlaps.check(self.budget, overlap, self.blocks.names, state.time)
        self.range.check(Motion.of(self.blocks, state.vertices), self.blocks, state.time)

    def at_rest(self, before: State, found: Equilibrium, time: float) -> None:
        """Blocks have come to equilibrium under the loads of ``time`` s."""
        excavated = found.state.removed is not before.removed
        self.budget = self.budget.at_rest(found.energies, time, excavated=excavated)


def _indexed(joints: Sequence[JointLaw], index: Callable[[str, str], int | None]) -> Joints:
    return Joints(joints, index)


@folded_argument("joint_index", "joints", _indexed)
def run(
    blocks: Blocks,
    materials: Sequence[Material],
    joints: Sequence[JointLaw] | Joints,
    loads: Loads,
    settings: DdaSettings,
    end_time: float,
    *,
    state: State | None = None,
    watch: Callable[[StepResult], None] | None = None,
) -> Iterator[State]:
    """States of a block system from rest (or from ``state``) until ``end_time``, one per step; step lengths follow from
    `StepLength`. ``joints``: a sequence, whose first law applies to all joints, or `Joints` with the law of each pair
    of edges. ``watch`` is called with every `StepResult`. The run continues with the arrays of the states, so they are
    read-only (`State.writable` makes copies).

    ``settings.equilibrium`` "start" brings the blocks to rest before the first state, "loads" in statics at every load
    too. Logs a warning when energy is gained without work, when a block is strained beyond the elastic range, or when
    viscous boundaries have no effect in statics. Raises `NotConverged` if no step or equilibrium is found or a block is
    strained by more than a quarter, and ValueError for invalid input, before the first step as far as possible.

    >>> ground, square = np.array([[-1, -1], [2, -1], [2, 0], [-1, 0]]), np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    >>> blocks = Blocks.from_polygons([ground, square], fixed=[True, False])
    >>> rock, joint = Material("rock", 10e9, 0.25, density=2600.0), JointLaw("joint", np.radians(30))
    >>> loads = Loads(gravity=History.constant([2.0, -9.81]))
    >>> settings = DdaSettings(time_step=0.01, dynamic_factor=1.0)
    >>> *_, last = dda.run(blocks, [rock], [joint], loads, settings, 0.05)
    >>> f"{last.time:g} s, {len(last.vertices)} vertices"
    '0.05 s, 8 vertices'
    """
    if not end_time >= 0:
        raise ValueError(f"end_time must not be negative, got {end_time!r} s")
    laws, index = (joints.laws, joints.index) if isinstance(joints, Joints) else (joints, None)
    system = BlockSystem(blocks, materials, laws, index, settings)
    if state is None:
        state = State.at_rest(blocks)
    state.refuse_misfit(blocks)
    state = state.writable()
    if system.scheme.static and loads.viscous_boundaries:
        log.warning("viscous boundaries have no effect in a static run")
    watched = _Watch(blocks)
    if settings.equilibrium:
        state = _at_rest(system, state, loads, state.time).state
    yield state.read_only()
    length = StepLength(settings)
    at_every_load = settings.equilibrium == "loads" and system.scheme.static
    while state.time < end_time * (1 - 1e-12):
        dt, load_time = min(length.dt, end_time - state.time), None
        if at_every_load:
            load_time = state.time + until_next_event(loads, state.time, dt)
            found = _at_rest(system, state, loads, load_time)
            watched.at_rest(state, found, load_time)
            state = found.state
        result = system.step(state, loads, dt, load_time=load_time)
        length.after(result, dt)
        watched.look(state, result)
        state = result.state
        seen = state.read_only()
        if watch is not None:
            watch(replace(result, state=seen))
        yield seen
    if not settings.equilibrium:
        warn_of_toes_at_rest(system, state, loads)


def _at_rest(system: BlockSystem, state: State, loads: Loads, load_time: float) -> Equilibrium:
    """Equilibrium from ``state`` under the loads of ``load_time`` s."""
    found = equilibrium(system, state, loads, load_time=load_time, tolerance=system.settings.unbalanced_tolerance)
    if found.collapsed:
        raise NotConverged(f"t = {load_time:g} s: {found.reason}")
    if not found.converged:
        log.warning("t = %g s: %s; continuing from there", load_time, found.reason)
    elif state.time == load_time:
        warn_of_toes(system, state, found.state, loads, load_time)
    return found
