"""Schedule of checkpoints, and their information about the origin of a run."""

from __future__ import annotations

import hashlib
import logging
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from geomech import __version__, plain_data
from geomech.model import Cycle, Problem
from geomech.shapes.gmsh_models.script_commands import SCRIPTS as MODELS
from geomech.shapes.gmsh_models.script_commands import files_read

from . import checkpoint_file

log = logging.getLogger(__name__)

#: Unless the scene says otherwise, a checkpoint follows the previous one after at least this many seconds …
INTERVAL = 30.0
#: … and late enough that checkpoints take less than this part of the run's time.
SHARE = 0.02
#: Checkpoints of a finished run are kept up to this size, MB: factors of a specimen with grown cracks take a hundred.
KEPT_MB = 16.0
#: Scene keys that name files.
_NAMING_FILES = ("model", "file")


class Checkpoints:
    """Observer that decides when a checkpoint is `due`; the driver of the cycles then calls `write` between two cycles.

    ``every`` is the number of cycles between two, 0 for none at all; None leaves it to `INTERVAL` and `SHARE`.
    ``scene`` is the resolved scene, which a resumed run must still have. ``kept_mb``: larger checkpoints of a finished
    run are removed. A checkpoint that cannot be written is reported in the log, and the run continues.
    """

    def __init__(
        self, *, every: int | None = None, scene: Mapping[str, Any] | None = None, kept_mb: float = KEPT_MB
    ) -> None:
        if every is not None and every < 0:
            raise ValueError(f"checkpoint_every is a number of cycles, or 0 for no checkpoints; got {every}")
        self.every, self.scene = every, None if scene is None else dict(scene)
        self.kept_mb = kept_mb
        self.seconds = 0.0

    def on_start(self, problem: Problem, folder: Path) -> None:
        if self.wanted:
            checkpoint_file.identity()
        self.on_resume(problem, folder, digests(self.scene or {}))

    def memory(self) -> dict[str, str]:
        return self._files

    def on_resume(self, problem: Problem, folder: Path, memory: dict[str, str]) -> None:
        self._folder, self._files = Path(folder) / checkpoint_file.FOLDER, memory
        self._cycles, self._interval, self._last = 0, INTERVAL, time.monotonic()

    def on_cycle(self, cycle: Cycle) -> None:
        self._cycles += 1

    @property
    def wanted(self) -> bool:
        """Whether checkpoints are written at all."""
        return self.every != 0

    @property
    def due(self) -> bool:
        if self.every is not None:
            return 0 < self.every <= self._cycles
        return time.monotonic() - self._last >= self._interval

    def write(self, cycle: int, now: float, content: Any) -> bool:
        """Store ``content``, from which the run continues after ``cycle`` at the time ``now`` (s); returns whether it
        succeeded."""
        began = time.monotonic()
        header = {
            **checkpoint_file.identity(), **checkpoint_file.surroundings(), "geomech": __version__, "cycle": cycle, "time_s": now,
            "scene": self.scene, "files": self._files,
        }  # fmt: skip
        try:
            checkpoint_file.write(self._folder, header, content)
        except (OSError, plain_data.NotPlain) as error:
            why = getattr(error, "strerror", None) or error
            log.warning("checkpoint of cycle %d could not be written: %s; the previous one is kept", cycle, why)
            written = False
        else:
            written = True
        self._cycles, self._last = 0, time.monotonic()
        self._interval = max(INTERVAL, (self._last - began) / SHARE)
        self.seconds += self._last - began
        return written

    def on_end(self, summary: dict[str, Any], error: BaseException | None = None) -> None:
        summary.setdefault("seconds", {})["writing checkpoints"] = round(self.seconds, 4)
        if error is None and self.wanted:
            self._remove_large(summary)

    def _remove_large(self, summary: dict[str, Any]) -> None:
        stored = checkpoint_file.found(self._folder)
        size = max((path.stat().st_size for path in stored), default=0) / 1e6
        if size <= self.kept_mb:
            return
        for path in stored:
            path.unlink()
        summary["checkpoint_not_kept_mb"] = round(size, 1)
        log.info("the final checkpoint, %.0f MB, is not kept: output.checkpoint_kept_mb is %g", size, self.kept_mb)


def digests(scene: Mapping[str, Any]) -> dict[str, str]:
    """{file: SHA-256} of every file that the resolved ``scene`` names, and of those that its models include."""
    names = set(_files(scene))
    for name in tuple(names):
        if Path(name).suffix.lower() in MODELS:
            names |= {str(path) for path in files_read(Path(name))}
    return {name: hashlib.sha256(Path(name).read_bytes()).hexdigest() for name in sorted(names)}


def _files(node: Any) -> Iterator[str]:
    if isinstance(node, Mapping):
        for key, value in node.items():
            if key in _NAMING_FILES and isinstance(value, str) and Path(value).is_file():
                yield value
            else:
                yield from _files(value)
    elif isinstance(node, (list, tuple)):
        for item in node:
            yield from _files(item)
