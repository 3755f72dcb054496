"""Runs of a study: one scene in several variants, each run into a folder of its own with an observer of its own.

The time left of a study is estimated from the runs that have ended. Runs by `geomech.run`, `watched_runs` and sweeps
are counted automatically, others by `run_ended`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from .output.console.at_work import run_ended

__all__ = ["Watched", "run_ended", "watched_runs"]


class Watched(NamedTuple):
    """A run that has ended: the ``name`` of its variant (None: the scene itself), its ``folder``, the observer that was
    its ``watcher``, and its ``summary``."""

    name: str | None
    folder: Path
    watcher: Any
    summary: dict[str, Any]


def watched_runs(
    study: str | Path,
    out: str | Path,
    watcher: Callable[[], Any],
    variants: Sequence[str | None] = (),
    overrides: Sequence[str] = (),
    quiet: bool = False,
) -> Iterator[Watched]:
    """Run the scene of ``study`` (a folder, or the path of a scene) in each of its ``variants`` (default: all), one
    after another.

    A variant runs into ``out`` / its name, None into ``out``, with all output that the scene's ``[output]`` selects and
    an observer of its own, ``watcher()``. All scenes are read before the first run, so that an error in the last one
    does not cost the time of the others; folders that already hold results are refused at that time too. Raises
    SceneError for bad input, and the exceptions of `geomech.run`.
    """
    from .output import standard_observers
    from .pipeline import refuse_results, run
    from .scene import load_scene

    names = list(variants) or list(load_scene(study).variants)
    scenes = {name: load_scene(study, overrides, variant=name) for name in names}
    refuse_results(Path(out) / (name or "") for name in names)
    for name, scene in scenes.items():
        folder, watching = Path(out) / (name or ""), watcher()
        summary = run(scene, folder, [*standard_observers(scene, quiet=quiet), watching])
        yield Watched(name, folder, watching, summary)
