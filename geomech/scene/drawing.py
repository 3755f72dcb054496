"""The geometry of a scene as blocks and cracks, from a Gmsh model or from the file itself."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import TYPE_CHECKING

import numpy as np

from ..model import Blocks, Cracks
from ..shapes import EdgeLine, Joint, ShapeError, Trace, Zone, assemble, rectangle, straight_crack
from ..shapes.parts import JOINT
from .errors import Fault
from .locator import Path
from .tables.geometry import CrackShape, Geometry

if TYPE_CHECKING:
    from .jointing import Jointed


@dataclass(frozen=True, eq=False)
class Drawing:
    """Blocks and cracks before materials and apertures are given. ``zones`` (n_blocks,) is the
    name of the zone each block belongs to, ``cracks_drawn`` the names of the cracks, ``parameters`` those of a Gmsh
    model, as used, ``choices`` the names of their values where they have such, ``model`` its file, ``joints`` what edges along
    joints are called, whether or not a block has such an edge, ``jointed`` how they cut the rock. ``blocks`` is None
    where the drawing cannot be assembled."""

    zones: tuple[str, ...]
    cracks_drawn: tuple[str, ...]
    blocks: Blocks | None
    cracks: Cracks | None
    parameters: dict[str, float | str] = field(default_factory=dict)
    choices: dict[str, Mapping[str, float]] = field(default_factory=dict)
    model: FilePath | None = None
    joints: tuple[str, ...] = ()
    jointed: Jointed | None = None

    def choices_with_edge(self, name: str) -> str:
        """The choices of one parameter with which the model has edges called ``name``, as a scene says them; empty
        where there are none. The model is read again for each choice: this is for messages."""
        if self.model is None:
            return ""
        from ..shapes import GmshModelError, read_gmsh_model

        for parameter, choices in self.choices.items():
            found = []
            for choice in choices:
                try:
                    other = read_gmsh_model(self.model, {**self.parameters, parameter: choice})
                except GmshModelError:
                    continue
                labels = [zone.edge_names or () for zone in other.zones]
                if any(name in loop for loops in labels for loop in loops):
                    found.append(f'"{choice}"')
            if found:
                return f"{parameter} = {' or '.join(found)}"
        return ""


def draw(
    geometry: Geometry,
    folder: FilePath,
    place: Callable[[Path], str],
    faults: list[Fault],
    warnings: list[Fault],
) -> Drawing | None:
    """Read or make the drawing; what is wrong goes to ``faults``. None where not even its names are known."""
    parameters: dict[str, float | str] = {}
    choices: dict[str, Mapping[str, float]] = {}
    model = None
    drawn_joints: tuple[Joint, ...] = ()
    places: Mapping[tuple[str, int], str] = {}
    if geometry.model is not None:
        # Imported here: a scene drawn in TOML needs no Gmsh.
        from ..shapes import GmshModelError, GmshUnavailable, read_gmsh_model

        source = ("geometry", "model")
        wanted, read = dict(geometry.parameters), None
        while read is None:
            try:
                read = read_gmsh_model(folder / geometry.model, wanted, geometry.chord_tolerance_m)
            except GmshModelError as error:
                at = ("geometry", "parameters", error.parameter) if error.parameter is not None else source
                faults.append(Fault(place(at), error.message, error.way_out))
                if error.parameter not in wanted:
                    return None
                # Without the faulty parameter the names of zones, edges and cracks can still be checked.
                del wanted[error.parameter]
            except GmshUnavailable as error:
                faults.append(Fault(place(source), str(error), "or draw the geometry in the scene, [[geometry.zones]]"))
                return None
        warnings += [Fault(place(source), message, way_out) for message, way_out in read.warnings]
        parameters = {name: entry.value for name, entry in read.parameters.items()}
        choices = {name: entry.choices for name, entry in read.parameters.items() if entry.choices}
        model = folder / geometry.model
        zones, traces, edges, drawn_joints = read.zones, read.traces, (), read.joints
        places = read.places
    else:
        zones = [Zone(z.name, _loops(z)) for z in geometry.zones]
        traces = [Trace(c.name, (_line(c),)) for c in geometry.cracks]
        edges = [EdgeLine(e.name, *e.line, e.zone) for e in geometry.edges]
        seen: dict[str, int] = {}
        for k, trace in enumerate(traces):
            if seen.setdefault(trace.name, k) != k:
                faults.append(
                    Fault(
                        place(("geometry", "cracks", k, "name")),
                        f"there are two cracks called {trace.name!r}",
                        "give each crack a name of its own",
                    )
                )
    names = tuple(zone.name for zone in zones)
    drawn = tuple(trace.name for trace in traces)
    joints: tuple[str, ...] = ()
    cut: Jointed | None = None
    own_joints = len({joint.name for joint in geometry.joints})
    try:
        if geometry.joints or geometry.joint_sets or drawn_joints:
            from .jointing import jointed

            blocks, _ = assemble(zones, (), edges, geometry.tolerance_m)
            cut = jointed(geometry, list(zones), blocks, list(traces), drawn_joints)
            warnings += [Fault(place(("geometry",)), f"mended while cutting: {text}", "") for text in cut.told()]
            names = tuple(names[zone] for zone in cut.cutting.zone)
            joints = tuple(joint.name for joint in cut.joints)
            own = [name.removeprefix(JOINT) for name in joints]
            blocks, cracks, drawn = cut.cutting.blocks, cut.cracks, (*drawn, *own)
        else:
            blocks, cracks = assemble(zones, traces, edges, geometry.tolerance_m)
    except ShapeError as error:
        for flaw in error.flaws:
            at: Path = ("geometry", flaw.part, flaw.index)
            message = flaw.message
            if (
                geometry.model is not None
                and flaw.part != "joint_sets"
                and flaw.index >= own_joints * (flaw.part == "joints")
            ):
                entity = places.get((flaw.part, flaw.index - own_joints * (flaw.part == "joints")))
                at = ("geometry", "model")
                message = f"{FilePath(geometry.model).name}: {f'{entity}: ' if entity else ''}{message}"
            faults.append(Fault(place(at), message, flaw.way_out))
        return Drawing(names, drawn, None, None, parameters, choices, model)
    return Drawing(names, drawn, blocks, cracks, parameters, choices, model, joints, cut)


def _loops(zone) -> tuple[np.ndarray, ...]:
    outline = rectangle(*zone.rectangle) if zone.rectangle is not None else np.array(zone.polygon, dtype=float)
    return tuple(loop.reshape(-1, 2) for loop in (outline, *(np.array(hole, dtype=float) for hole in zone.holes)))


def _line(crack: CrackShape) -> np.ndarray:
    if crack.points is not None:
        return np.array(crack.points, dtype=float).reshape(-1, 2)
    return straight_crack(crack.centre, crack.length_m, math.radians(crack.angle_deg))
