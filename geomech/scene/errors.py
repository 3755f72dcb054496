"""What is wrong with a scene, all of it at once."""

from __future__ import annotations

from typing import NamedTuple


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
