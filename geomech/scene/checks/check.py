"""What the checks of a scene see, and where they say what is wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..errors import Fault
from ..locator import Path

if TYPE_CHECKING:
    from ..drawing import Drawing
    from ..tables import SceneTables


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
