"""Growth of cracks in one elastic body without blocks: solve, apply the criterion, advance the tips, repeat.

    for step in ddm.propagate([], cracks, rock, ddm.BodyLoad(remote_stress=[0, 1e6, 0]), control="toughness"):
        print(step.load_factor, step.cracks.lengths.sum(), step.tips["k_i"])

Under a fixed load tips advance while K_eq ≥ K_Ic. Under a controlled load each step is solved at the load factor at
which the largest K_eq equals K_Ic: growth is quasi-static whether the factor rises (stable growth) or falls (growth
that would be unstable under a dead load).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..model import TIP, Cracks, Event, GrowthSettings, Material
from ..model.former_names import folded_argument, gathered_arguments, named_argument
from .body import Body, Reuse
from .fracture.f_criterion import apply_criterion, check_criterion
from .growth.cut_off_parts import cutting_segments
from .growth.initiation import NewCrack, add_new_cracks, new_cracks
from .growth.path_correction import Memory, corrected
from .growth.tie_tolerance import reached
from .growth.tip_advance import Growth, advance
from .loads.body_loads import BodyLoad
from .mesh.half_plane import HalfPlane, without_outline
from .solution import Solution

#: Under a controlled load, tips whose K_eq/K_Ic is within this fraction of the largest grow with it: K at a graded kink
#: is accurate to some 1e-3, and both of two symmetric tips should grow.
TOGETHER = 0.01
#: Tolerance of the largest K_eq/K_Ic, which the controlled load brings to one.
PRECISION = 1e-9
#: Tolerance where the search ends at a jump of K_eq (faces that close).
SETTLED = 1e-6
#: Factor by which the load is raised while no tip reaches K_Ic, and largest number of raises.
WIDER, RAISES = 4.0, 12

#: The load at a factor, for the current cracks (pressures per segment depend on them).
Loading = Callable[[float, Cracks], BodyLoad]


@dataclass(frozen=True, eq=False)
class Step:
    """One network under one load, and its growth.

    number       0, 1, 2 …
    load_factor  1 under a fixed load
    cracks       the network solved
    solution     its solution; None in the last step if cracks cut off an unsupported part
    tips         TIP rows with the criterion's ``k_eq`` and the ``angle`` taken; ``grown`` m
    growth       the network after this step and the joins made; None in the last step, if nothing grew
    events       initiation, birth, coalescence, self, daylighting; arrest or split in the last step
    """

    number: int
    load_factor: float
    cracks: Cracks
    solution: Solution | None
    tips: np.ndarray
    growth: Growth | None
    events: tuple[Event, ...]


@named_argument("settings", 5)
@folded_argument("half_plane", "loops", without_outline)
@gathered_arguments("reuse", Reuse)
def propagate(
    loops: Sequence[np.ndarray] | HalfPlane,
    cracks: Cracks,
    material: Material,
    load: BodyLoad | Loading,
    growth: GrowthSettings | None = None,
    *,
    control: str = "load",
    max_steps: int = 200,
    max_factor: float = math.inf,
    **body,
) -> Iterator[Step]:
    """Grow ``cracks`` in the body with outline ``loops`` ([] for the infinite plane, or a `HalfPlane`); yields one `Step`
    per increment.

    ``load``: a `BodyLoad`, which the factor multiplies as a whole, or a function ``load(factor, cracks)`` that returns
    one, so that part of the load (in-situ stress) can stay constant. ``control``: "load" keeps the factor at 1 until no
    tip grows; "toughness" searches in each step, starting from the last factor, for the one at which the largest
    K_eq/K_Ic is one. If K does not increase monotonically with the factor, this need not be the first such factor. The
    run ends with the event "arrest" if nothing grows or the factor would exceed ``max_factor``, "split" if cracks have
    cut off an unsupported part, or after ``max_steps``. ``body``: further arguments of `Body`
    (``settings``, ``holes`` …). Raises ValueError for an
    unknown control or criterion or a material without toughness, and the errors of `Body` and its ``solve``.

    >>> rock = Material("rock", 17e9, 0.21, k_ic=2e6)
    >>> crack = Cracks.from_polylines([np.array([[-5e-3, -5e-3], [5e-3, 5e-3]])], aperture=np.inf)
    >>> load = ddm.BodyLoad(remote_stress=[0.0, -10e6, 0.0])
    >>> steps = ddm.propagate([], crack, rock, load, GrowthSettings(increment=1e-3), control="toughness", max_steps=3)
    >>> [len(step.tips) for step in steps]  # wing cracks at both ends
    [2, 2, 2]
    """
    if control not in ("load", "toughness"):
        raise ValueError(f'control must be "load" or "toughness", got {control!r}')
    growth = GrowthSettings() if growth is None else growth
    check_criterion(growth)
    if not math.isfinite(material.k_ic):
        raise ValueError(
            f"material {material.name!r} has no fracture toughness, so no crack in it can grow: give it k_ic, Pa √m"
        )
    outline = loops if isinstance(loops, HalfPlane) else list(loops)
    run = _Run(outline, material, load, growth, body, control == "toughness", max_factor)
    return run.steps(cracks, max_steps)


class _Run:
    """Input of the run, with body, load factor and solution of the last step."""

    def __init__(
        self, loops: list[np.ndarray] | HalfPlane, material: Material, load: BodyLoad | Loading, growth: GrowthSettings,
        options: dict[str, Any], controlled: bool, max_factor: float,
    ) -> None:  # fmt: skip
        self.loops, self.material, self.load, self.growth = loops, material, load, growth
        self.reuse: Reuse = options.pop("reuse", None) or Reuse()
        self.options = options
        self.controlled, self.max_factor = controlled, max_factor
        #: Value of K_eq/K_Ic from which tips grow.
        self.enough = 1 - SETTLED if controlled else 1.0
        self.factor, self.drive, self.tip_drive = 1.0, 0.0, 0.0
        self.new_cracks: list[NewCrack] = []
        self.body: Body | None = None
        self.solution: Solution | None = None
        self.number = 0
        self.chords: Memory = {}
        #: Last load factor, solution, its history, and tips.
        self._last: tuple[float, Solution, Solution | None, np.ndarray] | None = None

    @property
    def rock(self) -> Body:
        """The body of the present step."""
        assert self.body is not None
        return self.body

    def steps(self, cracks: Cracks, max_steps: int) -> Iterator[Step]:
        from . import NotConverged

        joined = False
        for self.number in range(max_steps):
            try:
                self.body = self._body(cracks, self.body)
                if joined and not self.body.supports and cutting_segments(self.body).any():
                    yield self._split(cracks, "cracks have cut off a part")
                    return
                self.solution, tips = self._settled()
            except (np.linalg.LinAlgError, NotConverged) as failure:
                # A part that has been cut off is loose between closed faces and has no unique equilibrium.
                if not self.number or (isinstance(failure, NotConverged) and not joined):
                    raise
                yield self._split(cracks, str(failure))
                return
            growth, born = self._grow(tips), list[NewCrack]()
            if growth is None:
                growth, born = self._initiate(tips)
            events = self._events(cracks, tips, growth, born)
            yield Step(self.number, self.factor, cracks, self.solution, tips, growth, events)
            if growth is None:
                return
            cracks, joined = growth.cracks, joined or bool(growth.joins)

    def _split(self, cracks: Cracks, detail: str) -> Step:
        lost = self._event("split", cracks.nodes.mean(axis=0), detail)
        return Step(self.number, self.factor, cracks, None, np.empty(0, TIP), None, (lost,))

    def _body(self, cracks: Cracks, previous: Body | None) -> Body:
        # Reuse the body of the trial step if it was accepted.
        same = None if previous is None else previous.reusable_for(previous.given_loops, cracks, self.material)
        if same is not None:
            return same
        return Body(self.loops, cracks, self.material, reuse=self._reuse(previous), **self.options)

    def _reuse(self, previous: Body | None) -> Reuse:
        return Reuse(previous or self.reuse.previous, self.reuse.work)

    # -- load ----------------------------------------------------------------------------------------------------

    def _load_at(self, factor: float, cracks: Cracks) -> BodyLoad:
        if callable(self.load):
            return self.load(factor, cracks)
        return self.load if factor == 1.0 else self.load.scaled(factor)

    def _solve(self, body: Body, factor: float) -> tuple[Solution, np.ndarray]:
        """Solution and tips of a body at a load factor."""
        # Faces with friction continue from the slip of the last step; smooth faces have no memory.
        history = self.solution if body.rough else None
        known = self._known(body, factor, history)
        if known is not None:
            solution, tips = known
        else:
            load = self._load_at(factor, body.cracks)
            solution = body.solve(load, warm=self.solution, history=history)
            if body is self.body:  # it may be a finer one that reaches the target error
                assert isinstance(solution.body, Body)
                self.body = solution.body
            tips = solution.tips.copy()
            tips["angle"], tips["k_eq"] = apply_criterion(solution, self.growth, self.material)
        self._last = factor, solution, history, tips
        return solution, tips.copy()

    def _known(self, body: Body, factor: float, history: Solution | None) -> tuple[Solution, np.ndarray] | None:
        """The last solution, or a multiple of it, if it applies."""
        if self._last is None or self._last[1].body is not body:
            return None
        before, solution, began, tips = self._last
        if factor == before:
            return (solution, tips) if began is history else None
        if callable(self.load) or not before > 0 or not factor > 0 or self.growth.trial_kink or not solution.scales:
            return None
        solution = solution.scaled(self.load if factor == 1.0 else self.load.scaled(factor), factor / before)
        tips = solution.tips.copy()
        tips["angle"], tips["k_eq"] = apply_criterion(solution, self.growth, self.material)
        return solution, tips

    def _drives(self, factor: float) -> tuple[Solution, np.ndarray]:
        """Solution and tips at a load factor; stores the largest K_eq/K_Ic and overstress there."""
        solution, tips = self._solve(self.rock, factor)
        self.factor = factor
        self.tip_drive = float(np.max(tips["k_eq"], initial=0.0)) / self.material.k_ic
        self.new_cracks = new_cracks(solution, self.material, self.growth)
        self.drive = max([self.tip_drive, *(birth.overstress for birth in self.new_cracks[:1])])
        return solution, tips

    def _settled(self) -> tuple[Solution, np.ndarray]:
        """Find the load factor of this step; returns solution and tips there."""
        if not self.controlled:
            return self._drives(1.0)
        found: tuple[Solution, np.ndarray] | None = None

        def settled() -> tuple[Solution, np.ndarray]:
            assert found is not None
            return found

        def excess(factor: float) -> float:
            nonlocal found
            found = self._drives(factor)
            return self.drive - 1 if abs(self.drive - 1) > PRECISION else 0.0

        low = high = None
        factor = min(self.factor or 1.0, self.max_factor)
        for _ in range(2):
            rest = excess(factor)
            low, high = (factor, high) if rest < 0 else (low, factor)
            if abs(rest) <= PRECISION:
                return settled()
            # Exact if everything is proportional to the factor.
            factor = min(factor / self.drive if self.drive > 0 else WIDER * factor, self.max_factor)
        if low is None:
            if excess(0.0) >= 0:
                return settled()  # the constant part of the load already suffices
            low = 0.0
        for _ in range(RAISES):
            if high is not None or low >= self.max_factor:
                break
            factor = min(WIDER * low, self.max_factor)
            low, high = (factor, None) if excess(factor) < 0 else (low, factor)
        if high is None:
            return settled()
        from scipy.optimize import brentq

        factor = brentq(excess, low, high, xtol=1e-15 * high, rtol=1e-13)
        excess(factor)
        return settled()

    # -- growth --------------------------------------------------------------------------------------------------

    def _grow(self, tips: np.ndarray) -> Growth | None:
        if not reached(self.tip_drive, self.enough):
            return None
        drive = self.tip_drive
        body, cycle = self.rock, self.number + 1
        cracks = body.cracks
        threshold = self.material.k_ic * ((1 - TOGETHER) * drive if self.controlled else 1.0)

        def grow() -> Growth:
            return advance(cracks, lambda block: body.limits, tips, self.growth, np.full(len(tips), threshold), cycle)

        def look_ahead(tried: Cracks) -> np.ndarray:
            self.body = after = self._body(tried, self.body)
            return self._solve(after, self.factor)[1]

        growth = corrected(tips, grow, look_ahead, cycle, self.growth.correct, self.chords)
        if growth is None:
            self.body = body
        else:
            tips["grown"] = growth.grown
        return growth

    def _initiate(self, tips: np.ndarray) -> tuple[Growth | None, list[NewCrack]]:
        """New cracks where intact rock fails; only if no tip grows, since growth would relieve the rock."""
        if not self.new_cracks or not reached(self.new_cracks[0].overstress, self.enough):
            return None, []
        body = self.rock
        cracks = add_new_cracks(body.cracks, lambda block: body.limits, self.new_cracks, self.number + 1)
        return Growth(cracks, np.zeros(len(tips)), ()), self.new_cracks

    # -- events --------------------------------------------------------------------------------------------------

    def _events(
        self, cracks: Cracks, tips: np.ndarray, growth: Growth | None, born: Sequence[NewCrack]
    ) -> tuple[Event, ...]:
        if growth is None:
            at = tips["point"][np.argmax(reached(tips["k_eq"], tips["k_eq"].max()))] if len(tips) else np.zeros(2)
            return (self._event("arrest", at, "no tip reaches its toughness"),)
        names = growth.cracks.names[len(cracks.names) :]
        events = [
            self._event("birth", birth.start, f"{name} starts in {birth.kind} ({birth.place})")
            for name, birth in zip(names, born)
        ]
        since = dict(zip(cracks.segments.ravel().tolist(), np.repeat(cracks.birth_cycle, 2).tolist()))
        for tip in tips[growth.grown > 0]:
            if since[int(tip["node"])] == 0:
                events.append(self._event("initiation", tip["point"], f"{cracks.names[tip['crack']]} starts to grow"))
        for join in growth.joins:
            other = cracks.names[join.other_crack] if join.other_crack >= 0 else "the surface"
            events.append(self._event(join.kind, join.point, f"{cracks.names[join.crack]} meets {other}"))
        return tuple(events)

    def _event(self, kind: str, point, detail: str) -> Event:
        return Event(kind, self.number, 0.0, self.factor, (float(point[0]), float(point[1])), detail)
