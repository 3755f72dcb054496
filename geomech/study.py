"""The runs of a study: one scene in several variants, each run into a folder of its own and seen by a watcher.

A study tells the time left by the runs that have ended: those of `geomech.run`, `watched_runs` and sweeps count by
themselves, others by `run_ended`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from .output.console.at_work import run_ended

__all__ = ["Watched", "run_ended", "watched_runs"]


class Watched(NamedTuple):
    """One run that has ended: its variant's ``name`` (None: the scene as it stands), the ``folder`` that it has left,
    the observer that was its ``watcher``, and its ``summary``."""

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
    """Run the scene of ``study`` (a folder, or the path of a scene) in each of its ``variants`` (none named: all that
    it has), one by one.

    A variant runs into ``out`` / its name, None into ``out``, with all that the scene's ``[output]`` asks for and an
    observer of its own, ``watcher()``. All scenes are read before the first one runs: an error in the last does not
    cost the time of the others, and neither does a folder that holds results already. Raises SceneError on bad input, and
    what `geomech.run` raises.
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
