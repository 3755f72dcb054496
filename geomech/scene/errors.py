"""What is wrong with a scene, all of it at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from .drawing import Drawing
    from .locator import Path
    from .tables import SceneTables


class Fault(NamedTuple):
    """``place``: file, line and dotted key; ``message``: what is wrong; ``way_out``: what to write instead."""

    place: str
    message: str
    way_out: str

    def __str__(self) -> str:
        return f"{self.place}\n    {self.message}" + (f"\n    → {self.way_out}" if self.way_out else "")


class SceneError(ValueError):
    """A scene that cannot be run: ``errors`` is a list of `Fault` (place, message, way out), in file order."""

    def __init__(self, errors: list[Fault]) -> None:
        self.errors = list(errors)
        super().__init__("\n".join(str(error) for error in self.errors))


@dataclass(frozen=True, eq=False)
class Check:
    """What the checks see: tables (a section is None where it is faulty), the names in the file, the drawing."""

    tables: SceneTables
    data: dict[str, Any]
    drawing: Drawing | None
    place: Callable[[Path], str]
    faults: list[Fault]
    warnings: list[Fault]

    def refuse(self, path: Path, message: str, way_out: str) -> None:
        self.faults.append(Fault(self.place(path), message, way_out))

    def warn(self, path: Path, message: str, way_out: str) -> None:
        self.warnings.append(Fault(self.place(path), message, way_out))
