"""Results of a run: ParaView series, histories, a summary, a log; and how to read them back.

Everything here observes the cycles of a run (`Observer`) and knows the solvers only through `geomech.model.Cycle`.
"""

from __future__ import annotations

from typing import Any

from .checkpoints.checkpoint_schedule import KEPT_MB, Checkpoints
from .console.progress import Progress
from .observer import Group, Observer
from .reading import Run
from .run_folder import RunFolder
from .run_record import Places, RunLog, SceneCopy
from .tables.histories import Histories
from .tables.joint_histories import JointHistories
from .tables.summary import Summary
from .vtk.paraview_script import ViewScript
from .vtk.series import Series

__all__ = [
    "Checkpoints",
    "Group",
    "Histories",
    "JointHistories",
    "Observer",
    "Places",
    "Progress",
    "Run",
    "RunFolder",
    "RunLog",
    "SceneCopy",
    "Series",
    "Summary",
    "ViewScript",
    "standard_observers",
]


def standard_observers(scene: Any = None, *, quiet: bool = False) -> list[Observer]:
    """The observers of an ordinary run.

    ``scene`` (a loaded scene, or None for the defaults) gives its ``output`` table (``every``, ``joints``,
    ``interior_fields``, ``interior_every``, ``configuration``, ``checkpoint_every``, ``checkpoint_kept_mb``,
    ``format``) and its ``resolved()`` form.
    """
    output = getattr(scene, "output", None)
    resolved = None if scene is None else scene.resolved()
    watchers: list[Observer] = []
    if resolved is not None:
        # Before the folder is cleared: a run that fails here can be started again.
        watchers.append(SceneCopy(resolved))
    watchers += [RunFolder(), RunLog(), Places()]
    configuration = getattr(output, "configuration", "reference")
    series = Series(
        every=getattr(output, "every", 1),
        interior_every=getattr(output, "interior_every", 5) if getattr(output, "interior", True) else 0,
        configuration=configuration,
        format=getattr(output, "format", "vtu"),
    )
    return [
        *watchers,
        Histories(),
        *([JointHistories()] if _joints_wanted(scene) else []),
        series,
        ViewScript(configuration, series),
        Checkpoints(
            every=getattr(output, "checkpoint_every", None),
            scene=resolved,
            kept_mb=getattr(output, "checkpoint_kept_mb", KEPT_MB),
        ),
        Summary(),  # after the writers, whose times it includes
        Progress(quiet=quiet),
    ]


def _joints_wanted(scene: Any) -> bool:
    """Whether sums by joint are written: as the scene says; otherwise unless cracks make the blocks a specimen in a
    press."""
    wanted = getattr(getattr(scene, "output", None), "joints", None)
    return wanted if wanted is not None else scene is not None and not scene.cracks.n_cracks
