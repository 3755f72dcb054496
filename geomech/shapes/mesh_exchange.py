"""Meshes of other programs (Abaqus, Nastran, Medit, SU2, VTK) as Gmsh meshes, through meshio.

A set of triangles or quadrilaterals is a zone, a set of line elements a joint, a crack or an edge, as physical groups
of Gmsh are. A set called "block:…" separates blocks of one zone. Without sets, integer cell data ("zone", "material", a
reference or a tag) distinguish zones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .gmsh_models.model_drawing import GmshModelError

#: Formats that meshio reads and writes without further packages, by suffix.
SUFFIXES = (".inp", ".bdf", ".nas", ".mesh", ".su2", ".vtk", ".vtu")
#: Prefix of sets that are one block of a zone.
BLOCK = "block:"
#: Cell data that distinguish zones if no set does, in order of preference.
_ZONE_DATA = ("zone", "material", "gmsh:physical", "medit:ref", "su2:tag", "nastran:ref", "cell_tags", "block_id")
_LINES = {"line": 2, "line3": 2}
_FACES = {"triangle": 3, "triangle6": 3, "quad": 4, "quad8": 4, "quad9": 4}


class PhysicalMesh(NamedTuple):
    """A mesh with named groups: ``points`` (n, 2); ``lines`` and ``faces`` are rows (name, entity, node, node, …), with
    names as indices of ``line_names`` and ``face_names``, nodes as indices of ``points``."""

    points: np.ndarray
    line_names: Sequence[str]
    face_names: Sequence[str]
    lines: Sequence[Sequence[int]]
    faces: Sequence[Sequence[int]]


def msh_text(mesh: PhysicalMesh) -> str:
    """``mesh`` in Gmsh's format 2.2; a face of three nodes is a triangle, of four a quadrilateral."""
    first = len(mesh.line_names) + 1
    groups = [f'1 {k} "{name}"' for k, name in enumerate(mesh.line_names, 1)]
    groups += [f'2 {k} "{name}"' for k, name in enumerate(mesh.face_names, first)]
    rows = [f"{k} {x!r} {y!r} 0" for k, (x, y) in enumerate(mesh.points.tolist(), 1)]
    elements = [f"1 2 {name + 1} {entity} {a + 1} {b + 1}" for name, entity, a, b in mesh.lines]
    for name, entity, *nodes in mesh.faces:
        kind = 2 if len(nodes) == 3 else 3
        elements.append(f"{kind} 2 {first + name} {entity} " + " ".join(str(node + 1) for node in nodes))
    text = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat"]
    text += ["$PhysicalNames", str(len(groups)), *groups, "$EndPhysicalNames"]
    text += ["$Nodes", str(len(rows)), *rows, "$EndNodes", "$Elements", str(len(elements))]
    text += [f"{k} {element}" for k, element in enumerate(elements, 1)]
    return "\n".join([*text, "$EndElements", ""])


def as_gmsh_mesh(path: Path, folder: Path) -> Path:
    """``path``, a mesh in a format of `SUFFIXES`, written into ``folder`` as a Gmsh mesh. Raises GmshModelError for
    files that meshio cannot read and for meshes without plane faces."""
    import meshio

    try:
        mesh = meshio.read(path)
    except (Exception, SystemExit) as error:  # meshio's readers raise many kinds of exceptions for damaged files
        raise GmshModelError(
            f"{path} cannot be read: {type(error).__name__}: {error}", "export it again, or save it as .msh"
        ) from error
    out = folder / (path.stem + ".msh")
    out.write_text(msh_text(_with_groups(mesh, path)), encoding="utf-8")
    return out


def _with_groups(mesh, path: Path) -> PhysicalMesh:
    names_of = _sets(mesh)
    line_names, face_names = _Names(), _Names()
    lines, faces = [], []
    entities: dict[Any, Any] = {}
    for k, cells in enumerate(mesh.cells):
        if cells.type in _LINES:
            for i, nodes in enumerate(cells.data[:, :2].tolist()):
                lines += [(line_names[name], 1 + line_names[name], *nodes) for name in names_of[k][i]]
        elif cells.type in _FACES:
            for i, nodes in enumerate(cells.data[:, : _FACES[cells.type]].tolist()):
                block = next((name for name in names_of[k][i] if name.startswith(BLOCK)), "")
                zones = [name for name in names_of[k][i] if not name.startswith(BLOCK)]
                if len(zones) > 1:
                    raise GmshModelError(
                        f"{path.name}: an element is in the sets {zones[0]!r} and {zones[1]!r}",
                        f'leave each element in one set; blocks of one zone are distinguished by sets "{BLOCK}NAME"',
                    )
                zone = zones[0] if zones else "rock"
                entity = entities.setdefault((zone, block), len(entities) + 1)
                faces.append((face_names[zone], entity, *nodes))
    if not faces:
        kinds = ", ".join(sorted({cells.type for cells in mesh.cells})) or "nothing"
        raise GmshModelError(
            f"{path.name} has no triangles or quadrilaterals, but {kinds}", "export the faces of the section"
        )
    points = np.asarray(mesh.points, dtype=float)
    if points.shape[1] > 2 and np.ptp(points[:, 2]) > 1e-9 * np.ptp(points, axis=0).max():
        raise GmshModelError(f"{path.name}: its nodes do not lie in a plane z = constant", "export a plane section")
    return PhysicalMesh(points[:, :2], tuple(line_names), tuple(face_names), lines, faces)


class _Names(dict):
    """Numbers of names, in the order of first use."""

    def __missing__(self, name: str) -> int:
        self[name] = len(self)
        return self[name]


def _sets(mesh) -> list[list[list[str]]]:
    """Names of the sets of every element of every cell block; if no face is in a set, the integers that distinguish
    zones."""
    found: list[list[list[str]]] = [[[] for _ in cells.data] for cells in mesh.cells]
    for name, by_block in mesh.cell_sets.items():
        if name.startswith("gmsh:"):
            continue
        for k, elements in enumerate(by_block):
            for i in [] if elements is None else np.asarray(elements, int).tolist():
                found[k][i].append(name)
    faces = [k for k, cells in enumerate(mesh.cells) if cells.type in _FACES]
    if any(names for k in faces for names in found[k]):
        return found
    data = next((key for key in _ZONE_DATA if key in mesh.cell_data), None)
    called: Mapping[int, str] = {int(tag[0]): name for name, tag in mesh.field_data.items()}
    for k in range(len(mesh.cells)) if data else ():
        for i, value in enumerate(np.asarray(mesh.cell_data[data][k]).ravel().astype(int).tolist()):
            is_face = mesh.cells[k].type in _FACES
            if is_face or value in called:
                found[k][i].append(called.get(value, f"zone {value}"))
    return found
