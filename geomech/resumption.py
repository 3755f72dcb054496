"""Resumes a run from its last checkpoint."""

from __future__ import annotations

import itertools
import json
import logging
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from .output.checkpoints import checkpoint_file
from .output.checkpoints.checkpoint_file import FilesChanged, NotResumable
from .output.checkpoints.checkpoint_schedule import digests
from .output.run_lock import RunLock
from .pipeline import CoupledRun, run

log = logging.getLogger(__name__)

#: Keys of a scene that may be changed when a run is resumed: they do not affect the part that has been computed.
ALLOWED = (
    "title", "run.end_time_s", "run.stop_at", "run.repeat", "output.every", "output.interior", "output.interior_every",
    "output.checkpoint_every", "output.checkpoint_kept_mb", "render",
)  # fmt: skip
#: Reasons that do not count as the end of a run.
_BROKEN_OFF = ("interrupted", "failed")


class Finished(NotResumable):
    """The run is complete."""


def resume(
    folder: str | Path,
    overrides: Iterable[str] | Mapping[str, Any] = (),
    observers: Iterable[Any] | None = None,
    *,
    quiet: bool = False,
    tell: Callable[[str], None] = log.warning,
) -> dict[str, Any]:
    """Resume the run in ``folder`` and return its summary. On the same machine with the same number of threads all
    files are bitwise those of an uninterrupted run, except for times of day. Rows and files later than the checkpoint
    are dropped.

    ``overrides``, as for `load_scene`, may change keys in `ALLOWED`. With a later ``run.end_time_s`` a finished run
    continues from before the step that was shortened at its end, as if it had been that long from the beginning. A run
    without a checkpoint begins again. ``observers`` are those of the run, by default the standard ones (``quiet``:
    without output); ``tell`` is called with a message if the run begins again. Raises `Finished` if nothing is left to
    do, `NotResumable` if the run cannot be continued, `geomech.output.run_lock.FolderInUse` while another process uses
    the folder, and SceneError for bad input.

    >>> geomech.resume("outputs/broken_off", {"run.end_time_s": 0.3}, quiet=True)["time_s"]
    0.3
    """
    changes = overrides if isinstance(overrides, Mapping) else tuple(overrides)
    request = _Request(Path(folder), changes, observers, quiet, tell)
    _refuse_other_folders(request.folder)
    with RunLock(request.folder) as lock:
        if lock.stale:
            tell(lock.stale)
        return _resumed(request)


class _Request(NamedTuple):
    """Arguments of `resume`."""

    folder: Path
    overrides: tuple[str, ...] | Mapping[str, Any]
    observers: Iterable[Any] | None
    quiet: bool
    tell: Callable[[str], None]

    def scene(self) -> Any:
        """The run's scene with the overrides."""
        from .scene import load_scene

        return load_scene(self.folder / "scene.toml", self.overrides)

    def watching(self, scene: Any) -> Iterable[Any]:
        """The observers of a run of ``scene``."""
        if self.observers is not None:
            return self.observers
        from .output import standard_observers

        return standard_observers(scene, quiet=self.quiet)


def _resumed(request: _Request) -> dict[str, Any]:
    folder = request.folder
    found = next(checkpoint_file.whole(folder / checkpoint_file.FOLDER), None)
    if found is None:
        return _run_from_start(request)
    header, path = found
    _refuse_other_sources(header, path)
    scene = None if header["scene"] is None else request.scene()
    changes = {} if scene is None else _changes(header, scene.resolved())
    reason = _end_reason(folder)
    if reason is not None:
        _refuse_finished(reason, header, scene)
    stored = checkpoint_file.read(path)
    problem = stored["coupling"].problem
    if scene is not None:
        wanted = scene.problem()
        problem = replace(problem, title=wanted.title, run=wanted.run)
    warnings = [f"{name} was {was!r}, is now {now!r}" for name, (was, now) in changes.items()]
    warnings += _damaged(folder, path) + _other_surroundings(header)
    try:
        return CoupledRun(problem, folder, request.watching(scene), stored).go(warnings)
    except FilesChanged as error:
        raise NotResumable(f"{error}: run it again") from error


def _refuse_other_folders(folder: Path) -> None:
    if not folder.is_dir():
        raise NotResumable(f"there is no run folder {folder}")
    # The log is written before every other file of a run except the scene, which other folders may contain as well.
    if not any((folder / name).exists() for name in ("run.log", "history.csv", checkpoint_file.FOLDER)):
        below = sorted(str(found.parent) for found in folder.glob("*/history.csv"))
        raise NotResumable(
            f"{folder} holds no run: name the folder that `geomech run` wrote"
            + (f"; runs below it: {', '.join(below)}" if below else "")
        )


def _refuse_other_sources(header: Mapping[str, Any], path: Path) -> None:
    now = checkpoint_file.identity()
    for name, value in now.items():
        if header.get(name) != value:
            what = {"format": "way of storing runs", "sources": "geomech's sources"}.get(name, name)
            was = "" if name == "sources" else f" ({header.get(name)}, now {value})"
            raise NotResumable(
                f"{path} was written with another {what}{was}: continue it with the version that wrote it, geomech "
                f"{header.get('geomech')}, or run the scene again"
            )


def _changes(header: Mapping[str, Any], resolved: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    """Key → (value at the checkpoint, value now) of all changes of the scene. Raises NotResumable for changes that
    would affect the part already computed."""
    then, now = _flat(header["scene"]), _flat(json.loads(json.dumps(resolved)))
    changes = {
        key: (then.get(key), now.get(key)) for key in dict.fromkeys([*then, *now]) if then.get(key) != now.get(key)
    }
    forbidden = [key for key in changes if not any(key == name or key.startswith(f"{name}.") for name in ALLOWED)]
    if forbidden:
        reason = "; ".join(f"{key} was {changes[key][0]!r}, is now {changes[key][1]!r}" for key in forbidden[:6])
        raise NotResumable(
            f"this would change the part of the run already computed: {reason}. Set it back, or run the changed scene into "
            f"another folder. What may be changed: {', '.join(ALLOWED)}"
        )
    files = digests(resolved)
    for name, digest in header["files"].items():
        if files.get(name) != digest:
            raise NotResumable(f"{name} has changed since the run began: restore it, or run the scene again")
    return changes


def _flat(node: Any, path: str = "") -> dict[str, Any]:
    """Dotted key → value; arrays are values."""
    if isinstance(node, Mapping):
        return {
            key: value
            for name, item in node.items()
            for key, value in _flat(item, f"{path}.{name}" if path else name).items()
        }
    return {path: node}


def _end_reason(folder: Path) -> str | None:
    """The reason for the run's end from its summary; None if it has not ended by itself."""
    path = folder / "summary.json"
    if not path.is_file():
        return None
    end = json.loads(path.read_text(encoding="utf-8")).get("end", "")
    return None if end.startswith(_BROKEN_OFF) else end


def _refuse_finished(end: str, header: Mapping[str, Any], scene: Any) -> None:
    """Raise Finished unless the scene has been changed so that the run continues."""
    settings = None if scene is None else scene.problem().run
    # Steps to events are impossible if nothing holds the blocks.
    no_further = end == "mechanism" and settings is not None and settings.stepping == "events"
    if settings is None or no_further or end in ("collapse", "out of sight"):
        raise Finished(f"the run has ended ({end}): there is nothing left to continue")
    if end == "end of the scene":
        ended = header["scene"]["run"]["end_time_s"]
        if settings.end_time > ended * (1 + 1e-12):
            return
        way_out = f"--set run.end_time_s=… beyond {ended:g}"
    else:
        if end not in settings.stop_at:
            return
        kept = [kind for kind in settings.stop_at if kind != end]
        way_out = f"--set 'run.stop_at={json.dumps(kept)}'"
    raise Finished(f"the run has ended ({end}); to continue it: {way_out}")


def _run_from_start(request: _Request) -> dict[str, Any]:
    folder = request.folder
    end, damaged = _end_reason(folder), _damaged(folder)
    if end is not None and damaged:
        raise Finished(f"the run has ended ({end}), and cannot go on: {'; '.join(damaged)}. Run the scene again")
    if end is not None:
        raise Finished(
            f"the run has ended ({end}), and it has no checkpoint: to continue it, run the scene again, with a larger "
            "output.checkpoint_kept_mb if its checkpoint was too large to keep"
        )
    if not (folder / "scene.toml").is_file():
        raise NotResumable(f"{folder} holds neither a checkpoint nor a scene.toml: run the scene again")
    for message in (
        *damaged,
        f"{folder} holds no {'other checkpoint' if damaged else 'checkpoint yet'}: the run begins again",
    ):
        request.tell(message)
    scene = request.scene()
    return run(scene, folder, request.watching(scene), again=True)


def _damaged(folder: Path, used: Path | None = None) -> list[str]:
    """A warning for each checkpoint that is later than the one used, because it is damaged."""
    later = itertools.takewhile(lambda path: path != used, checkpoint_file.found(folder / checkpoint_file.FOLDER))
    return [f"{path} is damaged, and is not used" for path in later]


def _other_surroundings(header: Mapping[str, Any]) -> list[str]:
    return [
        f"{name} was {header.get(name)!r} and is {value!r}: the last digits may differ from those of an uninterrupted "
        "run"
        for name, value in checkpoint_file.surroundings().items()
        if header.get(name) != value
    ]
