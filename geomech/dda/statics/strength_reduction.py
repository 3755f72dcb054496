"""Factor of safety by strength reduction: the factor F by which the strength of the joints can be divided before
failure.

tan φ, cohesion and tensile strength of the joints are divided by F (Zienkiewicz, Humpheson & Lewis 1975; Matsui & San
1992), and static equilibrium is sought for each trial F, starting from that of the last stable trial. The criterion is
a force, not a displacement: in a static step of length dt an unbalanced force moves a block of mass m by a dt²/2. In a
stable trial it falls to round-off within a few steps; in an unstable one it remains (`stability_trial`), and for
sliding it grows as A − B/F. Two unstable trials thus predict F, and a few more enclose it.

The search starts with trials just below and just above the largest factor at which any contact forces could balance the
loads (`admissible_forces`), where most networks of rigid joints fail. If blocks fail earlier, or later (because new
contacts carry load), further trials follow.

As in limit equilibrium, sharp toes in re-entrant corners are rounded (`sharp_toes`), and a face keeps its whole
cohesion while any part of it is in contact (`whole_faces`). The factors without these assumptions are reported as well,
and so is the largest factor with any admissible contact forces, where F is clearly below it.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from ...model import Blocks, DdaSettings, JointLaw, Loads, Material, State
from ...model.former_names import gathered_arguments, renamed_argument
from ..joint_laws.reduced_strength import reduced
from ..kinematics.tolerances import NOTABLE
from ..open_close.interior_point.linear_programme import Unsolved
from ..results import NotConverged
from ..system import BlockSystem
from .admissible_forces import FARTHEST, AdmissibleForces
from .counted_resistance import (
    as_rigid_blocks,
    bearing_toes,
    hairline_faces,
    parted_faces,
    toes_in_the_way,
    with_admissible_forces,
    with_anchors,
    with_displacements,
    with_laws_left_out,
    with_no_mechanism,
    with_parted_faces,
    with_rigid_blocks,
    with_toes,
)
from .displacement_limit import DisplacementLimit, without_failure
from .pseudo_time_equilibrium import CUTS, RelaxationLimits, Travel, equilibrium, travel
from .safety_answer import FactorOfSafety, mechanism_of, moving_in
from .sharp_toes import FREE, ROUNDED, SHARP
from .stability_trial import Trial, TrialLoads, stability_trial

log = logging.getLogger(__name__)

#: Most relaxation steps before the first trial.
_RELAXING = 100
#: An upper bound is tried again from just below if its trial started farther below than this many tolerances.
_FROM_AFAR = 3.0
#: Factor from step to step in the search for a stable trial near a known factor; and of the first trial below a bound.
_NEARBY, _BELOW = 0.85, 0.95
#: Start of the search for the bound: Newton's method approaches from above, and most slopes fail below this.
_FIRST = 2.0
#: … and with many blocks, whose programmes take longest, from here.
_FIRST_OF_MANY = 1.0
#: Relative increase of F between trials of many blocks, each solved in one step: the same step over a larger increase may
#: find a mechanism where smaller ones find an equilibrium, and the drifts there do not predict the factor.
_STRIDE = 0.02
#: … and with cohesion, joint stiffness or bolts its limit, as it doubles after each stable trial: faces that keep their cohesion
#: depend less on the way.
_LONGEST_STRIDE = 0.08
#: Number of blocks that an error names.
_NAMED = 5
#: Distance of trials from an expected factor, in tolerances; and relative distance of a second failing trial above a
#: bound, so that the drifts of both predict the factor.
_BESIDE, _SECOND = 0.4, 0.01


class NothingToReduce(ValueError):
    """There is no factor of safety: no such strength, nothing that could fail, or a load that statics does not
    support."""


@dataclass(frozen=True)
class FactorSearch:
    """How a factor of safety is searched for.

    state        start of the first trial; None: blocks at rest
    reduce       names of the joint laws to weaken; None: all
    tolerance    F is enclosed to this relative tolerance
    unbalanced   a trial is stable when the unbalanced force on every block is below this fraction of the forces on it
    time_step    s, of the static steps; None: free fall over a hundredth of the smallest block
    max_steps    largest number of steps of a trial
    watch        called with every trial
    toes         "rounded", "sharp" or "free", see `sharp_toes`
    whole_faces  a face keeps its whole cohesion while any part is in contact
    compare      the answer reports the factors without rounding of toes whose tips would hold, without toes that hold,
                 and without faces that have parted at one end
    follow       the answer tells how far the blocks go that fail
    """

    state: State | None = None
    reduce: Sequence[str] | None = None
    tolerance: float = 2e-3
    unbalanced: float = 1e-5
    time_step: float | None = None
    max_steps: int = 200
    watch: Callable[[Trial], None] | None = None
    toes: str = ROUNDED
    whole_faces: bool = True
    compare: bool = True
    follow: bool = True

    def __post_init__(self) -> None:
        if not 0 < self.tolerance < 1:
            raise NothingToReduce(f"the tolerance of the factor must lie between 0 and 1, got {self.tolerance!r}")


def _refuse_unsearchable(blocks: Blocks, joints: Sequence[JointLaw], loads: Loads, chosen: set[str]) -> None:
    """Raise `NothingToReduce` where no factor of the strength of the joints ``chosen`` can be searched for."""
    if not any(_has_strength(law) for law in joints if law.name in chosen):
        raise NothingToReduce("the joints have no friction, cohesion or tensile strength that could be reduced")
    if blocks.glued is not None or (blocks.order is not None and (blocks.order != 1).any()):
        raise NothingToReduce(
            "blocks of higher order ([zones.NAME] order) and cells are not supported in the search for a factor of safety yet: "
            "leave `order` and `mesh_size_m` out"
        )
    crushing = next((law.name for law in joints if law.crushing_strength is not None), None)
    if crushing is not None:
        raise NothingToReduce(
            f"joint {crushing!r} crushes (crushing_strength_pa), which is not supported in the search for a factor of safety: "
            "leave it out, and check the stress of faces afterwards"
        )
    if blocks.fixed.all():
        raise NothingToReduce("all blocks are fixed: none can fail")
    if loads.base is not None and loads.base.frame == "ground":
        raise NothingToReduce(
            "a static search cannot include ground motion: leave out the motion of the base, or give it the frame "
            '"base", in which it is a body force at the time of the search'
        )


@renamed_argument("compare_toes", "compare")
@gathered_arguments("search", FactorSearch)
def factor_of_safety(
    blocks: Blocks,
    materials: Sequence[Material],
    joints: Sequence[JointLaw],
    loads: Loads,
    settings: DdaSettings | None = None,
    *,
    joint_index: Callable[[str, str], int | None] | None = None,
    load_time: float = 0.0,
    search: FactorSearch | None = None,
) -> FactorOfSafety:
    """The factor F by which the strength of the joints can be divided before no static equilibrium is left.

    Loads are those of ``load_time`` s, after excavations up to then; ``search`` says which strengths are reduced, and how
    F is found. Many blocks that stand without the tensile strength and dilation of their joints have the factor without these, and
    a warning (`TrialLoads.simpler`).

    With Coulomb friction the forces of a system are not unique: strengths are reduced step by step from an equilibrium,
    and another path may give a factor that differs by some thousandths where contacts slide and stick again.

    Raises `NothingToReduce` without strength to reduce, without moving blocks, or with a moving ground; `NotConverged`
    when the blocks are unstable even with joints 64 times as strong.

    >>> ground, square = np.array([[-1, -1], [2, -1], [2, 0], [-1, 0]]), np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    >>> blocks = Blocks.from_polygons([ground, square], fixed=[True, False])
    >>> rock, joint = Material("rock", 10e9, 0.25, density=2600.0), JointLaw("joint", np.radians(30))
    >>> loads = Loads(gravity=History.constant([2.0, -9.81]))
    >>> found = dda.factor_of_safety(blocks, [rock], [joint], loads)
    >>> f"{found.factor:.4f}"  # g tan 30° / 2 m/s²
    '2.8319'
    """
    how = search or FactorSearch()
    names = [law.name for law in joints]
    unknown = [name for name in how.reduce or () if name not in names]
    if unknown:
        raise NothingToReduce(
            f"no joint {', '.join(map(repr, unknown))} to reduce; there are {', '.join(map(repr, names))}"
        )
    chosen = set(names if how.reduce is None else how.reduce)
    _refuse_unsearchable(blocks, joints, loads, chosen)
    under = TrialLoads(loads, load_time, how.unbalanced, how.max_steps, how.time_step)
    rest = State.at_rest(blocks) if how.state is None else how.state
    settings = replace(settings or DdaSettings(), dynamic_factor=0.0)

    def answered(laws: Sequence[JointLaw]) -> FactorOfSafety:
        trials = _Search(blocks, materials, laws, joint_index, settings, chosen, under, rest, how.tolerance)
        counted = Counted(how.toes, how.whole_faces)
        if laws is not joints and not trials.aim(counted):
            raise NotConverged("no contact forces are admissible without them")
        if how.compare:
            found, counted = trials.answer(counted, how.watch)
        else:
            found = trials.run(counted, watch=how.watch)
        return trials.with_travel(found, counted) if how.follow else found

    simpler = under.simpler(blocks, joints, settings)
    if simpler is not joints:
        try:
            return with_laws_left_out(answered(simpler), joints)
        except NotConverged as failure:
            log.info("tensile strength and dilation count: %s", failure)
    return answered(joints)


@dataclass(frozen=True)
class Counted:
    """Assumptions of a factor: ``toes`` "rounded", "sharp" or "free" (`sharp_toes`), and whether cohesion counts on
    ``whole_faces`` (`whole_faces`)."""

    toes: str = ROUNDED
    whole_faces: bool = True


@dataclass(frozen=True, eq=False)
class _Search:
    """The search for a factor; arguments as for `factor_of_safety`, ``chosen``: names of the laws to weaken."""

    blocks: Blocks
    materials: Sequence[Material]
    joints: Sequence[JointLaw]
    joint_index: Callable[[str, str], int | None] | None
    settings: DdaSettings
    chosen: Collection[str]
    under: TrialLoads
    rest: State
    tolerance: float
    #: What trials have warned of.
    warned: set[str] = field(default_factory=set)
    #: What `aim` has found.
    aims: dict[Counted, float] = field(default_factory=dict, init=False)

    def system(self, factor: float, counted: Counted) -> BlockSystem:
        """The blocks with joints whose strength is divided by the ``factor``."""
        plastic = self.under.plastic(self.blocks, self.joints, self.settings)
        laws = [
            reduced(law, factor) if law.name in self.chosen else reduced(law, 1.0) if plastic else law
            for law in self.joints
        ]
        system = BlockSystem(self.blocks, self.materials, laws, self.joint_index, self.settings)
        system.plastic, system.warned = plastic, self.warned
        if self.under.at_once(system):
            # A trial is one step, which fails as a whole.
            system.settings = replace(self.settings, max_step_cuts=0)
        system.finder.toes, system.finder.whole_faces = counted.toes, counted.whole_faces
        # Which part of a face with joint stiffness is pressed does not change what it can carry.
        system.finder.at_corners = plastic
        return system

    def answer(self, counted: Counted, watch: Callable[[Trial], None] | None) -> tuple[FactorOfSafety, Counted]:
        """The factor with its bolt forces, and the factors with other assumptions about toes and partly open faces; and
        its own assumptions."""
        try:
            found, counted = self._found(counted, watch)
        except NotConverged:
            if counted.toes != ROUNDED or not toes_in_the_way(self.system(1.0, counted), self.rest):
                raise
            sharp = replace(counted, toes=SHARP)
            found = self.run(sharp)
            return with_toes(self.blocks, found, self._bearing(found, sharp), None, True), sharp
        found = with_anchors(self.blocks, self.under.loads, found)
        if counted.toes != FREE:
            found = self._with_toes(found, counted)
        if not math.isfinite(found.upper):
            return with_no_mechanism(self.blocks, found), counted
        largest = self._admissible_beyond(found, counted)
        if self._cohesive:
            found = self._with_parted_faces(found, counted, largest is not None)
        if self.under.at_once(self.system(1.0, counted)):
            found = with_displacements(self.blocks, found, self.aims.get(counted, 0.0))
        return with_admissible_forces(found, largest), counted

    def with_travel(self, found: FactorOfSafety, counted: Counted) -> FactorOfSafety:
        """The answer ``found`` with the distance that its blocks go, up to the size √area of the fastest."""
        if not found.moving:
            return found
        reach = math.sqrt(abs(float(self.blocks.areas()[found.moving[0]])))

        coarse = replace(self, settings=replace(self.settings, max_step_cuts=min(self.settings.max_step_cuts, CUTS)))

        def followed(toes: str) -> Travel:
            system = coarse.system(found.travels_at, replace(counted, toes=toes))
            return travel(system, found.state, self.under.loads, self.under.time, reach)

        way = followed(counted.toes)
        sharp = None
        if way.rests and counted.toes != SHARP and not found.toes:
            other = followed(SHARP)
            far, short = float(way.moved.max()), float(other.moved.max())
            sharp = short if other.rests and short < far * (1.0 - NOTABLE) else None
        return replace(found, travel=way, sharp_travel=sharp)

    def _found(self, counted: Counted, watch: Callable[[Trial], None] | None) -> tuple[FactorOfSafety, Counted]:
        """The factor and its assumptions: the larger of the factors with cohesion on whole faces and on closed contacts
        only. In theory the first is always the larger. But a face that carries shear by cohesion alone, without
        pressure, may have no consistent state: if open it carries nothing, and if closed it opens."""
        aim, whole = self.aim(counted), counted.whole_faces and self._cohesive
        touching = replace(counted, whole_faces=False)
        try:
            found = self.run(counted, watch=watch, aim=aim)
        except NotConverged:
            if not whole:
                raise
            return self.run(touching, aim=aim), touching
        if not whole or aim <= found.upper * (1.0 + NOTABLE):
            return found, counted
        just_above = found.upper * (1.0 + 2.0 * self.tolerance)
        other = self._otherwise(touching, just_above, just_above)
        return (found, counted) if other is None else (other, touching)

    @property
    def _cohesive(self) -> bool:
        return any(law.cohesion > 0.0 for law in self.joints)

    def aim(self, counted: Counted) -> float:
        """The largest factor with admissible contact forces as drawn, bolts at any force up to yield; 0 if unknown."""
        if counted not in self.aims:
            self.aims[counted] = self._aim(counted)
        return self.aims[counted]

    def _aim(self, counted: Counted) -> float:
        if self.under.loads.excavations:
            return 0.0
        system = self.system(1.0, counted)
        whole = without_failure(system, self.rest, self.under.loads, self.under.time)
        if whole is None:
            return 0.0
        forces = AdmissibleForces.of(system, whole, self.rest, self.joints, self.chosen, self.under.loads.bolts)
        try:
            if forces is None:
                return 0.0
            if self.under.at_once(system):
                return forces.largest_factor(_FIRST_OF_MANY, precise=self.tolerance)
            return forces.largest_factor(_FIRST)
        except Unsolved as failure:
            log.info("the largest factor with admissible contact forces is not known: %s", failure)
            return 0.0

    def _admissible_beyond(self, found: FactorOfSafety, counted: Counted) -> float | None:
        """The largest factor with admissible contact forces; None if it is unknown or hardly larger than that
        ``found``. With many blocks it is that of the blocks as drawn, unless they stand beyond it."""
        if not math.isfinite(found.upper):
            return None
        beyond, system = found.factor * (1.0 + NOTABLE), self.system(found.lower, counted)
        aim = self.aims.get(counted, 0.0)
        if self.under.at_once(system) and aim >= found.lower * (1.0 - NOTABLE):
            # `aim` may be below the bound by the tolerance.
            return aim if aim * (1.0 + self.tolerance) > beyond else None
        forces = AdmissibleForces.of(system, found.state, self.rest, self.joints, self.chosen)
        try:
            if forces is None or not forces.balance(beyond):
                return None
            if beyond < aim < math.inf:
                return forces.largest_factor(aim, self.tolerance)
            return forces.largest_factor(beyond / _NEARBY)
        except Unsolved as failure:
            log.info("whether contact forces are admissible beyond the factor is not known: %s", failure)
            return None

    def _with_toes(self, found: FactorOfSafety, counted: Counted) -> FactorOfSafety:
        bearing = self._bearing(found, counted)
        if bearing:
            return with_toes(self.blocks, found, bearing, self._otherwise(replace(counted, toes=FREE)), True)
        if counted.toes == SHARP or not found.moving:
            return found
        bars = toes_in_the_way(self.system(found.lower, counted), found.state, found.failed)
        if not bars:
            return found
        above = found.upper * (1.0 + 2.0 * self.tolerance)
        sharp = self._otherwise(replace(counted, toes=SHARP), found.lower, above)
        return found if sharp is None else with_toes(self.blocks, found, bars, sharp, False)

    def _bearing(self, found: FactorOfSafety, counted: Counted):
        return bearing_toes(self.system(found.lower, counted), found.state, self.under.loads, self.under.time)

    def _with_parted_faces(self, found: FactorOfSafety, counted: Counted, beyond: bool) -> FactorOfSafety:
        """The answer ``found`` with the factor of rigid blocks, if faces are barely open or forces are admissible
        ``beyond`` the factor, and the factor without the cohesion of open ends."""
        system = self.system(found.lower, counted)
        if system.plastic:
            # Cohesion fades over hairline gaps, and further searches take as long as this one.
            parted = parted_faces(system, found.state)
            return with_parted_faces(self.blocks, found, parted, None) if parted else found
        loose = hairline_faces(system, found.state)
        if loose or beyond:
            rigid = replace(self, materials=[replace(material, rigid=True) for material in self.materials])
            above = found.upper * (1.0 + 2.0 * self.tolerance)
            other = rigid._otherwise(replace(counted, whole_faces=True), found.lower, above)
            if other is not None and any(face.slides(other.failed) for face in loose):
                found = as_rigid_blocks(self.blocks, self.under.loads, found, loose, other)
            elif other is not None:
                found = with_rigid_blocks(found, other)
        parted = parted_faces(system, found.state)
        if not parted:
            return found
        just_below = found.lower * (1.0 - 2.0 * self.tolerance)
        other = self._otherwise(replace(counted, whole_faces=False), just_below, stands=True)
        return found if other is None else with_parted_faces(self.blocks, found, parted, other)

    def _otherwise(
        self, counted: Counted, first: float = 1.0, above: float = math.inf, stands: bool = False
    ) -> FactorOfSafety | None:
        """The answer with other assumptions ``counted``; arguments as for `run`. None where the blocks are unstable, or
        the answer is the same."""
        try:
            return self.run(counted, first, above, stands)
        except (NotConverged, _SameFactor):
            return None

    def run(
        self, counted: Counted, first: float = 1.0, above: float = math.inf, stands: bool = False,
        watch: Callable[[Trial], None] | None = None, aim: float | None = None,
    ) -> FactorOfSafety:  # fmt: skip
        """Enclose the factor, starting with a trial at ``first``, or near ``aim`` (None: from `aim`). Raises `_NoOther`
        if blocks are stable at ``first`` and only a factor below it is of interest (``stands``), or if they are
        unstable at the factor ``above``; `NotConverged` if they are stable at none."""
        near = stands or math.isfinite(above)
        aim = 0.0 if near else self.aim(counted) if aim is None else aim
        bracket = _Bracket(self, counted, watch, aim)
        known = near or 0.0 < aim < FARTHEST
        trial = bracket.begin(first if near or not known else _BELOW * aim)
        if trial.stable and stands:
            raise _SameFactor
        while not trial.stable:
            if first >= above:
                raise _SameFactor
            if trial.factor <= 1.0 / FARTHEST:
                raise NotConverged(
                    f"the blocks are unstable even with joints {FARTHEST:g} times as strong: "
                    f"{self._moving(trial)}{trial.reason}; the motion does not depend on joint strength, or no "
                    "contact states were found"
                )
            trial = bracket.begin((_NEARBY if known else 0.5) * trial.factor)
        if first < above < math.inf and not bracket.tried(above).stable:
            raise _SameFactor
        return bracket.closed(self.tolerance)

    def _moving(self, failed: Trial) -> str:
        """Text that names the blocks that move in a ``failed`` trial, the fastest first."""
        moving = moving_in(failed)
        if not moving:
            return ""
        names = ", ".join(repr(self.blocks.names[b]) for b in moving[:_NAMED])
        return f"{names}{' and others' if len(moving) > _NAMED else ''}: "


class _SameFactor(Exception):
    """With other assumptions, the factor is the same."""


class _Bracket:
    """Trials of a ``search`` that enclose the factor, which is expected at the ``aim`` (0: anywhere)."""

    def __init__(
        self, search: _Search, counted: Counted, watch: Callable[[Trial], None] | None, aim: float = 0.0
    ) -> None:
        self._search, self._counted, self._watch, self._aim = search, counted, watch, aim
        self._limit: Any = None  # DisplacementLimit of the last relaxation
        system = search.system(1.0, counted)
        self._at_once, self.plastic = search.under.at_once(system), system.plastic
        self._state = search.rest
        self.trials: list[Trial] = []
        # For each trial, the factor from whose equilibrium it started.
        self._began: dict[float, float] = {}
        self.lower, self._stride = 0.0, _STRIDE

    def begin(self, factor: float) -> Trial:
        """Try a ``factor`` from the blocks at rest; if they keep moving, from the equilibrium with that factor, found by
        relaxation. Blocks to be excavated or bolted begin with relaxation. (Its steps grow beyond those of a trial. Near
        failure it more often finds nothing: among 1 000 blocks it searched for 16 s where the trial found an equilibrium.)"""
        search = self._search
        loads, time, system = search.under.loads, search.under.time, search.system(factor, self._counted)
        plain = not (loads.excavations or loads.bolts)
        self._state, self._limit = search.rest, DisplacementLimit(system, search.rest, loads, time)
        if plain or self._at_once:
            trial = self.tried(factor)
            if trial.stable or self._at_once:
                return trial
        relaxed = _relaxed(system, search.under, search.rest)
        if relaxed is not None:
            self._state, self._limit = relaxed
        elif plain:
            return trial
        return self.tried(factor)

    def tried(self, factor: float) -> Trial:
        """Try a ``factor`` from the last equilibrium."""
        search = self._search
        system = search.system(factor, self._counted)
        trial, end = stability_trial(system, self._state, search.under, factor, self._limit)
        self.trials.append(trial)
        self._began[factor] = self.lower
        log.info("F = %.5g: %s", factor, trial.reason)
        if self._watch is not None:
            self._watch(trial)
        if trial.stable:
            self.lower, self._state = factor, end
        if self.plastic:
            self._stride = min(2.0 * self._stride, _LONGEST_STRIDE) if trial.stable else _STRIDE
        return trial

    def _known(self) -> list[Trial]:
        # A trial that failed from far below may be stable when approached in small steps; one that failed from no forces at all
        # often is, where cohesion leaves blocks more ways to be wedged.
        last = {t.factor: t for t in self.trials if t.stable or t.factor > self.lower}
        return [t for t in last.values() if t.stable or not self.plastic or self._began[t.factor] > 0.0]

    def closed(self, tolerance: float) -> FactorOfSafety:
        """The answer, once the trials enclose the factor to the ``tolerance``."""
        while True:
            known = self._known()
            upper = min((t.factor for t in known if not t.stable), default=math.inf)
            if math.isinf(upper):
                if self.lower >= FARTHEST:
                    return self._answer(self.lower, None)
                close_trial = _close_to(self._aim, self.lower, tolerance) if math.isfinite(self._aim) else None
                factor = self._beyond_bound(tolerance) if close_trial is None else close_trial
                if self.plastic:
                    factor = min(factor, self.lower * (1.0 + self._stride))
            elif self._expected(upper) and sum(not t.stable for t in known) == 1:
                factor = upper * (1.0 + _SECOND)
            elif upper > self.lower * (1.0 + tolerance):
                factor = _next_factor(known, self.lower, upper, tolerance)
                if self._at_once:
                    factor = min(2.0 * self.lower * upper / (self.lower + upper), self.lower * (1.0 + self._stride))
            elif self._started_far_below(known, upper, tolerance):
                factor = upper
            else:
                failed = next(t for t in known if t.factor == upper)
                return self._answer(_extrapolated_factor(known, self.lower, upper), failed)
            self.tried(factor)

    def _beyond_bound(self, tolerance: float) -> float:
        """The next factor where blocks are stable at the bound: just above, since rigid blocks fail there and others hardly
        later, then ever farther; twice the last one without a bound."""
        if not (self._at_once and 0.0 < self._aim < math.inf):
            return 2.0 * self.lower
        return self.lower + max(2.0 * (self.lower - self._aim), tolerance / (1.0 + tolerance) * self.lower)

    def _expected(self, upper: float) -> bool:
        """Whether blocks that fail at the factor ``upper`` do so as the bound says, and not earlier, where a trial above the
        bound would show another mechanism than at failure."""
        return not self._at_once and 0.0 < self._aim <= upper

    def _started_far_below(self, known: list[Trial], upper: float, tolerance: float) -> bool:
        """Whether the failed trial at ``upper`` started so far below that it might be stable, unless the drift of
        failed trials shows that it is not."""
        if self._began[upper] >= self.lower * (1.0 - _FROM_AFAR * tolerance):
            return False
        return _drift_ends(known, self.lower, upper) is None

    def _answer(self, factor: float, failed: Trial | None) -> FactorOfSafety:
        moving = () if failed is None else moving_in(failed)
        lines = () if failed is None else mechanism_of(self._search.blocks, failed, moving)
        return FactorOfSafety(
            factor, self.lower, math.inf if failed is None else failed.factor, tuple(self.trials), moving, lines,
            self._state, self._limit.moved(self._state.vertices),
        )  # fmt: skip


def _relaxed(system: BlockSystem, under: TrialLoads, state: State) -> tuple[State, DisplacementLimit] | None:
    """Equilibrium by relaxation from ``state``, after excavation and bolting up to the loads' time, and the displacement
    limit from there; None if none is found."""
    limit = DisplacementLimit(system, state, under.loads, under.time)
    found = equilibrium(
        system, state, under.loads, load_time=under.time, limits=RelaxationLimits(_RELAXING, limit, follow=False)
    )
    return (replace(found.state, time=max(state.time, under.time)), limit) if found.converged else None


def _has_strength(law: JointLaw) -> bool:
    return law.friction_angle > 0 or law.cohesion > 0 or law.tensile_strength > 0 or law.roughness is not None


def _extrapolated_factor(trials: Sequence[Trial], lower: float, upper: float) -> float:
    """The factor at which the drift of failed trials vanishes, between ``lower`` and ``upper``; their mean if
    unknown."""
    end = _drift_ends(trials, lower, upper)
    return 2.0 * lower * upper / (lower + upper) if end is None else end


def _drift_ends(trials: Sequence[Trial], lower: float, upper: float) -> float | None:
    """Factor at which the drift of the two weakest failures vanishes, drift = A − B/F; None if not between ``lower``
    and ``upper``."""
    failed = sorted((t for t in trials if not t.stable and math.isfinite(t.drift)), key=lambda t: t.factor)[:2]
    if len(failed) < 2 or not failed[1].drift > failed[0].drift:
        return None
    (x, p), (y, q) = ((1.0 / t.factor, t.drift) for t in failed)
    inverse = x + p * (x - y) / (q - p)
    return 1.0 / inverse if 1.0 / upper < inverse < 1.0 / lower else None


def _next_factor(trials: Sequence[Trial], lower: float, upper: float, tolerance: float) -> float:
    """The next F: close to the predicted factor, on the side that is farther away; the mean without a prediction."""
    harmonic_mean = 2.0 * lower * upper / (lower + upper)
    failed = [t for t in trials if not t.stable and math.isfinite(t.drift)]
    if len(failed) < 2:
        return harmonic_mean
    close_trial = _close_to(_extrapolated_factor(trials, lower, upper), lower, tolerance)
    return close_trial if close_trial is not None and close_trial < upper else harmonic_mean


def _close_to(aim: float, lower: float, tolerance: float) -> float | None:
    """The factor to try near the expected one, ``aim``: just below it or, if blocks are stable nearly up to it, just
    above; None if they are stable beyond it."""
    margin = _BESIDE * tolerance
    if lower < aim * (1.0 - 2.0 * margin):
        return aim * (1.0 - margin)
    return aim * (1.0 + margin) if lower < aim * (1.0 + margin) else None
