"""Clears a run folder at the start of a run of those files of an earlier run that are not overwritten."""

from __future__ import annotations

from pathlib import Path

from geomech.model import Problem

from .checkpoints import checkpoint_file
from .observer import Observer

#: Names of a run's files. Files of series are overwritten, and the remaining ones are deleted at the end.
_OWN = (
    "history.csv", "tips.csv", "events.csv", "joints.csv", "reactions.csv", "summary.json", "places.json", "view.pvsm", "*.csv.part", "*.pvd.part",
    "*.json.part", "*.toml.part", f"{checkpoint_file.FOLDER}/cycle_[0-9]*.checkpoint", f"{checkpoint_file.FOLDER}/*.part",
)  # fmt: skip


class RunFolder(Observer):
    """Observer that removes the histories, summary and checkpoints of an earlier run before the others begin."""

    def on_start(self, problem: Problem, folder: Path) -> None:
        _clear(Path(folder), _OWN)

    def memory(self) -> None:
        """Nothing: a resumed run continues with the existing files."""

    def on_resume(self, problem: Problem, folder: Path, memory: None) -> None:
        _clear(Path(folder), tuple(name for name in _OWN if name.endswith(".part")))


def _clear(folder: Path, patterns: tuple[str, ...]) -> None:
    for pattern in patterns:
        for path in folder.glob(pattern):
            path.unlink()
