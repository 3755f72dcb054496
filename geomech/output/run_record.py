"""Records of a run's origin in its folder: the log, the resolved scene, the locations of monitors and bolts."""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from geomech.model import GROUND, Cycle, Problem, counted

from .observer import Observer
from .units import stress_text
from .unreached import unreached

#: The file with the locations of monitors and bolts.
PLACES = "places.json"

_log = logging.getLogger("geomech.run")


class RunLog:
    """Observer that keeps ``run.log``: everything geomech logs during the run, its events and its end."""

    def on_start(self, problem: Problem, folder: Path) -> None:
        self._problem = problem
        self._last: Cycle | None = None
        self._happened: set[Any] = set()
        self._open(Path(folder), "w")
        _log.info("%s: %s, %s", problem.title, problem.inventory, counted(len(problem.materials), "material"))

    def memory(self) -> list[str]:
        """Kinds of events so far; the log continues at its end."""
        return sorted(self._happened)

    def on_resume(self, problem: Problem, folder: Path, memory: list[str]) -> None:
        self._problem, self._last, self._happened = problem, None, set(memory)
        self._open(Path(folder), "a")
        _log.info("%s: resumed", problem.title)

    def _open(self, folder: Path, mode: str) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._handler = logging.FileHandler(folder / "run.log", mode=mode, encoding="utf-8")
        self._handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)-7s %(name)s: %(message)s"))
        self._handler.setLevel(logging.INFO)
        logger = logging.getLogger("geomech")
        self._level_before = logger.level
        logger.addHandler(self._handler)
        if logger.getEffectiveLevel() > logging.INFO:
            logger.setLevel(logging.INFO)

    def on_cycle(self, cycle: Cycle) -> None:
        self._last = cycle
        for event in cycle.events:
            self._happened.add(event.kind)
            # Without a leading load, the load is 0.
            load = f", load {stress_text(event.load)}" if event.load else ""
            _log.info(
                "cycle %d, t = %g s%s: %s at (%.6g, %.6g) %s",
                event.cycle, event.time, load, event.kind, *event.point, event.detail,
            )  # fmt: skip

    def on_end(self, summary: dict[str, Any], error: BaseException | None = None) -> None:
        if isinstance(error, KeyboardInterrupt):
            _log.warning("interrupted")
        elif error is not None:
            _log.error("the run failed", exc_info=error)
        else:
            missed = unreached(self._problem, self._last, self._happened)
            if missed:
                _log.warning("%s", missed)
            _log.info("ended: %s", summary.get("end", "done"))
        logger = logging.getLogger("geomech")
        logger.removeHandler(self._handler)
        logger.setLevel(self._level_before)
        self._handler.close()


class SceneCopy(Observer):
    """Observer that writes ``scene.toml``, the scene with its variant and overrides applied, before the first cycle.

    ``resolved`` is a mapping like that of a TOML file; absent values (None) are left out, since TOML has no null.
    """

    def __init__(self, resolved: Mapping[str, Any]) -> None:
        self.resolved = resolved

    def on_start(self, problem: Problem, folder: Path) -> None:
        import tomli_w

        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        unfinished = folder / "scene.toml.part"
        unfinished.write_text(tomli_w.dumps(_without_none(self.resolved)), encoding="utf-8")
        os.replace(unfinished, folder / "scene.toml")


class Places(Observer):
    """Observer that writes `PLACES`: reference locations (m) of monitors and bolts, which the scene may take from its
    drawing."""

    def on_start(self, problem: Problem, folder: Path) -> None:
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        places = {
            "monitors": {name: [float(x) for x in point] for name, (_, point) in problem.monitors.items()},
            "bolts": [
                {
                    "name": bolt.name,
                    "from": [float(x) for x in bolt.start],
                    "to": [float(x) for x in bolt.end],
                    "ground": bolt.other == GROUND,
                }
                for bolt in problem.loads.bolts
            ],
        }
        (folder / PLACES).write_text(json.dumps(places, indent=1), encoding="utf-8")

    def memory(self) -> None:
        """Nothing: the locations are those of the reference configuration."""

    def on_resume(self, problem: Problem, folder: Path, memory: None) -> None:
        """The file stays; the model may have lost bolts meanwhile."""
        if not (Path(folder) / PLACES).is_file():
            self.on_start(problem, folder)


def _without_none(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _without_none(item) for key, item in value.items() if item is not None}
    if isinstance(value, (list, tuple)):
        return [_without_none(item) for item in value if item is not None]
    if isinstance(value, Path):
        return str(value)
    return value
