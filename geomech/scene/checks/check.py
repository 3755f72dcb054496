"""Input and output of the checks of a scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..errors import Fault
from ..locator import Path

if TYPE_CHECKING:
    from ...model import Blocks, Cracks
    from ..drawing import Drawing
    from ..tables import SceneTables


@dataclass(frozen=True, eq=False)
class Check:
    """Input of the checks (tables, of which faulty sections are None; the data of the file; the drawing), and their
    results."""

    tables: SceneTables
    data: dict[str, Any]
    drawing: Drawing | None
    place: Callable[[Path], str]
    faults: list[Fault]
    warnings: list[Fault]

    @property
    def drawn(self) -> Drawing:
        """The drawing, for checks that follow those of the drawing itself."""
        if self.drawing is None:
            raise ValueError("the scene has no drawing")
        return self.drawing

    @property
    def blocks(self) -> Blocks:
        """The drawn blocks."""
        return self.drawn.assembled()[0]

    @property
    def cracks(self) -> Cracks:
        """The drawn cracks."""
        return self.drawn.assembled()[1]

    def refuse(self, path: Path, message: str, way_out: str) -> None:
        self.faults.append(Fault(self.place(path), message, way_out))

    def warn(self, path: Path, message: str, way_out: str) -> None:
        self.warnings.append(Fault(self.place(path), message, way_out))
