"""From a scene to a run folder: the cycles of the coupling, with observers."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .interruption import Interruption
from .model import Cycle, Problem
from .model.former_names import renamed_argument

if TYPE_CHECKING:
    from . import dda
    from .coupling import Coupling
    from .output import Observer
    from .report.safety_page import SafetyReport
    from .scene import Scene

log = logging.getLogger(__name__)

#: Whether runs may replace existing results in their folders, unless their caller specifies it.
_OVERWRITE: ContextVar[bool] = ContextVar("overwrite", default=False)


@contextmanager
def overwriting(allowed: bool = True) -> Iterator[None]:
    """Context in which runs may replace existing results in their folders."""
    before = _OVERWRITE.set(allowed)
    try:
        yield
    finally:
        _OVERWRITE.reset(before)


def refuse_results(folders: Iterable[Path], *, locked: bool = False) -> None:
    """Refuse folders that already hold results, before the first of several runs begins, unless runs may overwrite
    (`overwriting`). ``locked``: the caller has their lock. Raises `geomech.output.run_lock.FolderTaken`, FolderInUse."""
    from .output import run_lock

    if not _OVERWRITE.get():
        run_lock.refuse_results(folders, locked=locked)


def cycles(scene: Scene | str | Path) -> Iterator[Cycle]:
    """The coupling cycles of ``scene`` (a loaded scene, or a path to one); nothing is written.

    >>> for cycle in geomech.cycles("slope.toml"):
    ...     print(f"{cycle.state.time:.1f} s: {cycle.blocks.n_blocks} blocks, {len(cycle.tips)} crack tips")
    0.0 s: 2 blocks, 0 crack tips
    0.1 s: 2 blocks, 0 crack tips
    0.2 s: 2 blocks, 0 crack tips
    """
    from .coupling import cycles as run_problem

    return run_problem(_loaded(scene).problem())


def run(
    scene: Scene | str | Path,
    out: str | Path | None = None,
    observers: Iterable[Any] | None = None,
    *,
    again: bool = False,
    overwrite: bool | None = None,
) -> dict[str, Any]:
    """Run ``scene`` to its end and return the summary, which ``summary.json`` contains.

    ``out`` is the run folder (default ``outputs/<scene's name>``); ``observers`` are called after every cycle, by
    default the writers that the scene's ``[output]`` table selects. ``again``: the scene is the copy that an earlier
    run left in ``out``. ``overwrite``: results of an earlier run may be replaced (None: as in `overwriting`). However
    the run ends, the files written remain readable and every observer is ended; an exception is raised again. Raises
    SceneError for bad input or if ``out`` is the folder of the scene itself, `geomech.output.run_lock.FolderRefused` if
    it holds the results of a run or another run is using it, and `geomech.dda.NotConverged` if no consistent contact
    state of the blocks is found.

    >>> summary = geomech.run("slope.toml", out="outputs/first", observers=[])
    >>> summary["end"]
    'end of the scene'
    """
    scene = _loaded(scene)
    folder = Path(out) if out is not None else Path("outputs") / scene.name
    if not again:
        _refuse_to_overwrite_scene(scene, folder)
    problem = scene.problem()
    if observers is None:
        from .output import standard_observers

        observers = standard_observers(scene)
    warnings = [str(fault) for fault in scene.warnings]
    if again:  # whoever goes on has the folder already
        return CoupledRun(problem, folder, observers).go(warnings)
    return run_problem(problem, folder, observers, warnings, overwrite=overwrite)


def run_problem(
    problem: Problem,
    folder: Path,
    observers: Iterable[Any],
    warnings: Iterable[str] = (),
    *,
    overwrite: bool | None = None,
) -> dict[str, Any]:
    """As `run`, for a problem built in Python; ``warnings`` about it are logged once the run's log is open."""
    from .output.console.at_work import run_ended
    from .output.run_lock import RunLock

    with overwriting(_OVERWRITE.get() if overwrite is None else overwrite), RunLock(folder) as lock:
        refuse_results([folder], locked=True)
        summary = CoupledRun(problem, folder, observers).go([*warnings, *([lock.stale] if lock.stale else [])])
    run_ended()
    return summary


class CoupledRun:
    """A run of a coupled problem with its observers, stored by the first `Checkpoints` among them.

    It begins at the start of ``problem``, or at ``stored``, the content of a checkpoint (which is used up), with the
    present title and run settings of ``problem``. A first interrupt ends it between two cycles, or within a cycle that
    takes long (`geomech.interruption.PATIENCE`).
    """

    def __init__(
        self, problem: Problem, folder: Path, observers: Iterable[Any], stored: dict[str, Any] | None = None
    ) -> None:
        from .output.checkpoints.checkpoint_schedule import Checkpoints
        from .output.observer import Group

        self.problem, self.folder, self.stored = problem, Path(folder), stored
        self.group = Group([*self._repeats(), *observers])
        self.checkpoints = next((each for each in self.group.observers if isinstance(each, Checkpoints)), None)
        self.interruption = Interruption()
        self.stops_at = (*problem.ends_at, "collapse", *(("out of sight",) if problem.endless is not None else ()))
        self.stopping = [] if stored is None else [kind for kind in stored["stopping"] if kind in self.stops_at]
        self.ended = stored is not None and stored["ended"] and bool(self.stopping)
        self.spent = 0.0 if stored is None else stored["wall_s"]
        #: Whether the last checkpoint is what a run that is to stop or end later goes on from: from before its last
        #: pass, in
        #: which no crack may grow, or before the step that its end cuts.
        self.before_the_last = False

    def go(self, warnings: Iterable[str] = ()) -> dict[str, Any]:
        """Run to the end; returns the summary. ``warnings`` are logged once the log is open."""
        self.began = time.perf_counter()
        summary: dict[str, Any] = {"title": self.problem.title}
        error: BaseException | None = None
        try:
            if self.stored is None:
                self.group.on_start(self.problem, self.folder)
            else:
                self.group.on_resume(self.problem, self.folder, self.stored.pop("observers"))
            for warning in warnings:
                log.warning("%s", warning)
            with self.interruption if self._stores else nullcontext():
                self._cycles()
        except BaseException as failure:
            error = failure
            raise
        finally:
            summary["end"] = _end_reason(self.stopping, error)
            summary["wall_s"] = self._wall_time
            self.group.on_end(summary, error)
        return summary

    def _repeats(self) -> list[Observer]:
        """The observer that repeats the run at its end, before the summary is written."""
        if not self.problem.run.repeat:
            return []
        from .coupling import cycles as run_problem
        from .repeats import Repeats

        return [Repeats(run_problem)]

    @property
    def _wall_time(self) -> float:
        return self.spent + time.perf_counter() - self.began

    @property
    def _stores(self) -> bool:
        return self.checkpoints is not None and self.checkpoints.wanted

    def _cycles(self) -> None:
        from .coupling import Coupling
        from .dda.linear_solver.blas_threads import asked_for, blas_threads

        if self.stored is None:
            coupling = Coupling(self.problem)
            begun = coupling.cycles()
        else:
            coupling = self.stored.pop("coupling")
            coupling.take_run(self.problem)
            begun = coupling.load_steps()
        if self._stores:
            coupling.between = lambda: self._between(coupling)
        if self.ended:
            return
        for cycle in begun:
            self.stopping += [event.kind for event in cycle.events if event.kind in self.stops_at]
            # Fields inside cracked blocks are solved for as they are written: with as many threads as the rest, whose
            # number changes the last digits.
            with blas_threads(asked_for()):
                self.group.on_cycle(cycle)
        self.ended = True
        if self._stores and not self.before_the_last:
            self._store(coupling)

    def _between(self, coupling: Coupling) -> None:
        last = coupling.stops_next or coupling.ends_next
        if coupling.under_way is None or last:
            self.before_the_last = last
        # (Between the passes of the last step there is one already, from before it.)
        due = self.checkpoints is not None and self.checkpoints.due
        if self.interruption.asked:
            self.interruption.wait()
            self.group.on_interrupt()
        if self.interruption.asked or last or (due and not self.before_the_last):
            self._store(coupling)
        if self.interruption.asked:
            raise KeyboardInterrupt

    def _store(self, coupling: Coupling) -> None:
        if self.checkpoints is None:
            return
        content = {
            "coupling": coupling,
            "observers": self.group.memories(),
            "stopping": self.stopping,
            "ended": self.ended,
            "wall_s": self._wall_time,
        }
        self.checkpoints.write(coupling.now.number, coupling.now.state.time, content)


class CracksInBlocks(ValueError):
    """A factor of safety was requested for blocks that may be held together by rock bridges between cracks."""


def cracked_and_free(problem: Problem) -> list[str]:
    """The names of the cracks in blocks that are not fixed."""
    cracks = problem.cracks
    free = ~problem.blocks.fixed[cracks.block]
    return [cracks.names[k] for k in sorted(set(cracks.crack[free].tolist()))]


@renamed_argument("compare_toes", "compare")
def factor_of_safety(
    scene: Scene | str | Path,
    load_time: float | None = None,
    *,
    without_cracks: bool = False,
    along: Sequence[str] | None = None,
    divide: Mapping[str, float] | dda.PartialFactors | None = None,
    **search_options: Any,
) -> dda.FactorOfSafety:
    """`geomech.dda.FactorOfSafety` of the blocks of ``scene``, by strength reduction under the loads at ``load_time`` s
    (default: the scene's end). ``search_options``: fields of `geomech.dda.FactorSearch`, such as tolerance and watch.

    ``along`` names the joint laws, or joints as drawn, whose strength is reduced (default: all). ``divide`` gives
    partial factors on "cohesion", "friction" (tan φ) and "tension", by which the strength of all joints is divided
    first, as design codes require; the factor of safety is additional to them.

    Blocks remain whole. With ``without_cracks`` cracks inside movable blocks are left out, as if rock bridges never
    broke: the result is then an upper bound. Raises `CracksInBlocks` if there are such cracks and ``without_cracks`` is
    not set, SceneError for bad input, `geomech.dda.NothingToReduce` if there is no strength to reduce or a name is
    unknown, and `geomech.dda.NotConverged` if the blocks are unstable whatever the strength of their joints.

    >>> found = geomech.factor_of_safety("slope.toml")
    >>> f"{found.factor:.4f}"  # a block on a plane: tan 35° / tan 30°
    '1.2128'
    """
    return safety_report(
        scene, load_time, without_cracks=without_cracks, along=along, divide=divide, **search_options
    ).found  # fmt: skip


@renamed_argument("compare_toes", "compare")
def safety_report(
    scene: Scene | str | Path,
    load_time: float | None = None,
    *,
    without_cracks: bool = False,
    along: Sequence[str] | None = None,
    divide: Mapping[str, float] | dda.PartialFactors | None = None,
    **search_options: Any,
) -> SafetyReport:
    """`geomech.report.safety_page.SafetyReport` of the same: its ``text()``, ``as_dict()`` and ``draw(path)``; the factor
    itself is ``found``.

    >>> report = geomech.safety_report("slope.toml", divide={"friction": 1.25})
    >>> report.found.factor < 1  # the design does not hold with a partial factor of 1.25
    True
    >>> report.found.mechanism
    ('block: 1.00 of the fastest, towards -150°',)
    """
    from . import dda
    from .report.safety_page import SafetyReport

    problem = _loaded(scene).problem()
    cracks = cracked_and_free(problem)
    if cracks and not without_cracks:
        more = f" and {len(cracks) - 3} more" if len(cracks) > 3 else ""
        raise CracksInBlocks(
            f"no factor of safety: {', '.join(cracks[:3])}{more} lead into blocks that can move, and the rock bridges "
            "there would be treated as unbreakable. `geomech run` breaks them: increase the loads, or divide the "
            "strength of [joints] and the toughness of [materials] by the factor of safety to be verified"
        )
    factors = dda.PartialFactors.of(divide)
    problem, reduced = dda.design_problem(problem, factors, along)
    search = dda.FactorSearch(**({"reduce": reduced} | search_options))
    found = dda.factor_of_safety(
        problem.blocks, problem.materials, problem.joints, problem.loads, problem.dda, joint_index=problem.joint_index,
        load_time=problem.run.end_time if load_time is None else load_time, search=search,
    )  # fmt: skip
    weakened, joints = (None if names is None else list(names) for names in (search.reduce, along))
    return SafetyReport(
        problem, found, weakened, factors, joints, tuple(cracks),
        **({"tolerance": search.tolerance} if "tolerance" in search_options else {}),
    )  # fmt: skip


def _refuse_to_overwrite_scene(scene: Scene, folder: Path) -> None:
    """Refuse a run folder, and with it a new scene.toml, where the scene itself is stored."""
    kept = folder / "scene.toml"
    if kept.exists() and kept.samefile(scene.path):
        from .scene import Fault, SceneError

        way_out = "name another folder: --out DIR on the command line"
        raise SceneError([Fault(str(scene.path), "the run would overwrite its own scene", way_out)])


def _end_reason(stopping: list[str], error: BaseException | None) -> str:
    if isinstance(error, KeyboardInterrupt):
        return "interrupted"
    if error is not None:
        return f"failed: {error}"
    return stopping[0] if stopping else "end of the scene"


def _loaded(scene: Scene | str | Path) -> Scene:
    if isinstance(scene, (str, Path)):
        from .scene import load_scene

        return load_scene(scene)
    return scene
