"""From a scene to a run folder: the coupling's cycles, with observers attached."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from .model import Cycle, Problem

log = logging.getLogger(__name__)


def cycles(scene) -> Iterator[Cycle]:
    """The coupling cycles of ``scene`` (a loaded scene, or a path to one); nothing is written."""
    from .coupling import cycles as run_problem

    return run_problem(_loaded(scene).problem())


def run(scene, out: str | Path | None = None, observers: Iterable[Any] | None = None) -> dict[str, Any]:
    """Run ``scene`` to its end and return the summary that ``summary.json`` holds.

    ``out`` is the run folder (default ``outputs/<scene's name>``); ``observers`` are told of every cycle, by default
    the writers that the scene's ``[output]`` table asks for. Whatever ends the run, what was written stays readable
    and every observer is ended; the exception is raised again. Raises SceneError on bad input
    or when ``out`` is where the scene itself is kept, `geomech.dda.NotConverged` when the blocks find no consistent contact state.
    """
    scene = _loaded(scene)
    folder = Path(out) if out is not None else Path("outputs") / scene.name
    _spare(scene, folder)
    problem = scene.problem()
    if observers is None:
        from .output import standard_observers

        observers = standard_observers(scene)
    return run_problem(problem, folder, observers, [str(fault) for fault in scene.warnings])


def run_problem(
    problem: Problem, folder: Path, observers: Iterable[Any], warnings: Iterable[str] = ()
) -> dict[str, Any]:
    """The same for a problem built in Python; ``warnings`` about it are logged once the run's log is open."""
    from .coupling import cycles as coupled
    from .output.observer import Group

    began = time.perf_counter()
    group = Group(observers)
    summary: dict[str, Any] = {"title": problem.title}
    stopping: list[str] = []
    error: BaseException | None = None
    try:
        group.on_start(problem, folder)
        for warning in warnings:
            log.warning("%s", warning)
        for cycle in coupled(problem):
            stopping += [event.kind for event in cycle.events if event.kind in (*problem.run.stop_at, "collapse")]
            group.on_cycle(cycle)
    except BaseException as failure:
        error = failure
        raise
    finally:
        summary["end"] = _end_reason(stopping, error)
        summary["wall_s"] = time.perf_counter() - began
        group.on_end(summary, error)
    return summary


def factor_of_safety(scene, load_time: float | None = None, **wishes):
    """`geomech.dda.FactorOfSafety` of the blocks of ``scene``, by strength reduction under the loads of ``load_time`` s
    (default: the scene's end). ``wishes`` as for `geomech.dda.factor_of_safety`: reduce, tolerance, watch …

    Blocks are whole: cracks inside them are left out. Raises SceneError on bad input, ValueError where there is no strength
    to reduce, `geomech.dda.NotConverged` where the blocks do not stand whatever their joints hold.
    """
    from . import dda

    problem = _loaded(scene).problem()
    return dda.factor_of_safety(
        problem.blocks, problem.materials, problem.joints, problem.loads, problem.dda, joint_index=problem.joint_index,
        load_time=problem.run.end_time if load_time is None else load_time, **wishes,
    )  # fmt: skip


def _spare(scene, folder: Path) -> None:
    """Refuse to put a run, and with it a scene.toml, where the scene itself is kept."""
    kept = folder / "scene.toml"
    if kept.exists() and kept.samefile(scene.path):
        from .scene import Fault, SceneError

        way_out = "name another folder: --out DIR on the command line"
        raise SceneError([Fault(str(scene.path), "the run would write over the scene it is run from", way_out)])


def _end_reason(stopping: list[str], error: BaseException | None) -> str:
    if isinstance(error, KeyboardInterrupt):
        return "interrupted"
    if error is not None:
        return f"failed: {error}"
    return stopping[0] if stopping else "end of the scene"


def _loaded(scene):
    if isinstance(scene, (str, Path)):
        from .scene import load_scene

        return load_scene(scene)
    return scene
