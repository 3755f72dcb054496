"""A run folder at the start of a run: without what an earlier run in it has left and this one may not write over."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from geomech.model import Cycle, Problem

from .checkpoints import checkpoint_file

#: Files of a run, by the names that it gives them. Files of series are written over, and those left are deleted at the
#: end.
_OWN = (
    "history.csv", "tips.csv", "events.csv", "joints.csv", "reactions.csv", "summary.json", "places.json", "view.pvsm", "*.csv.part", "*.pvd.part",
    "*.json.part", "*.toml.part", f"{checkpoint_file.FOLDER}/cycle_[0-9]*.checkpoint", f"{checkpoint_file.FOLDER}/*.part",
)  # fmt: skip


class RunFolder:
    """Observer that clears the folder of an earlier run's histories, summary and checkpoints before the others
    begin."""

    def on_start(self, problem: Problem, folder: Path) -> None:
        _clear(Path(folder), _OWN)

    def memory(self) -> None:
        """Nothing: a resumed run goes on with the files that are there."""

    def on_resume(self, problem: Problem, folder: Path, memory: None) -> None:
        _clear(Path(folder), tuple(name for name in _OWN if name.endswith(".part")))

    def on_cycle(self, cycle: Cycle) -> None:
        pass

    def on_end(self, summary: dict[str, Any], error: BaseException | None = None) -> None:
        pass


def _clear(folder: Path, patterns: tuple[str, ...]) -> None:
    for pattern in patterns:
        for path in folder.glob(pattern):
            path.unlink()
