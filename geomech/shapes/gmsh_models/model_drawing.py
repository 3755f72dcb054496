"""Content of a Gmsh model or mesh, and errors of one that cannot be read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from ..curves import Chords
from ..parts import Joint, Mark, Trace, Zone

#: Prefix of physical curves that are cracks; all other names belong to edges of blocks.
CRACK = "crack:"


class GmshModelError(ValueError):
    """A model that cannot be read. ``parameter`` is the name of the faulty parameter, or None."""

    def __init__(self, message: str, way_out: str, parameter: str | None = None) -> None:
        super().__init__(f"{message}: {way_out}")
        self.message, self.way_out, self.parameter = message, way_out, parameter


@dataclass(frozen=True)
class Parameter:
    """A DefineConstant that the model shows in Gmsh's side panel: its path there, value, range and choices."""

    path: str
    value: float | str
    minimum: float | None = None
    maximum: float | None = None
    choices: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class GmshDrawing:
    """Content of a model.

    zones        with named edges; ``traces`` of cracks; ``joints``
    parameters   by short name, as used
    warnings     (message, way out) for everything that is drawn and left out
    places       entities of ("zones" | "cracks" | "joints" | "marks", index)
    marks        bolts, water tables and monitor points
    chords       approximations of its curves
    """

    zones: tuple[Zone, ...]
    traces: tuple[Trace, ...]
    parameters: dict[str, Parameter]
    warnings: tuple[tuple[str, str], ...] = ()
    joints: tuple[Joint, ...] = ()
    places: Mapping[tuple[str, int], str] = field(default_factory=dict)
    marks: tuple[Mark, ...] = ()
    chords: Chords = field(default_factory=Chords.none)


def scaled(found: GmshDrawing, factor: float) -> GmshDrawing:
    """The drawing with all lengths multiplied by ``factor``."""

    def lines(item):
        return replace(item, lines=tuple(factor * line for line in item.lines))

    return replace(
        found,
        zones=tuple(replace(zone, loops=tuple(factor * loop for loop in zone.loops)) for zone in found.zones),
        traces=tuple(map(lines, found.traces)),
        joints=tuple(map(lines, found.joints)),
        marks=tuple(map(lines, found.marks)),
        chords=found.chords.scaled(factor),
    )
