"""From a scene to a run folder: the coupling's cycles, with observers attached."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from .model import Cycle


def cycles(scene) -> Iterator[Cycle]:
    """The coupling cycles of ``scene`` (a loaded scene, or a path to one), nothing written."""
    from .coupling import cycles as run_problem

    return run_problem(_loaded(scene).problem())


def _loaded(scene):
    if isinstance(scene, (str, Path)):
        from .scene import load_scene

        return load_scene(scene)
    return scene
