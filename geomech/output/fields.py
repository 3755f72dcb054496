"""Declaration of every field in output files: name, components, unit, location and meaning.

Writers refuse an array that is not declared here, and a declared one that is missing, so that this table *is* the
format. Stresses are positive in tension; see `geomech.conventions` for the signs of contacts and cracks.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from geomech.conventions import VTK_STRESS
from geomech.model import CHANGES


@dataclass(frozen=True)
class Field:
    """One array of a file. ``place`` is "point" or "cell"; ``components`` are the names that VTK shows, () for a
    scalar."""

    name: str
    place: str
    unit: str
    doc: str
    components: tuple[str, ...] = ()
    dtype: str = "float64"

    @property
    def shape(self) -> tuple[int, ...]:
        """Trailing shape of the array."""
        return (len(self.components),) if self.components else ()


_XYZ = ("X", "Y", "Z")
_DISPLACEMENT = Field("displacement", "point", "m", "current minus reference position", _XYZ)
_STRESS = ("stress", "Pa", "Cauchy stress on current axes; ZZ is ν(XX + YY) in plane strain, 0 in plane stress")
_PRINCIPAL = ("principal_stress", "Pa", "principal stresses of the full tensor, S1 ≥ S2 ≥ S3")
_PRINCIPAL_NAMES = ("S1", "S2", "S3")
_STATE = "0 open, 1 stick, 2 slip"

#: Series name → its fields. The series is written as ``<name>.pvd`` with its files under ``vtk/``. What there is much of,
#: at every corner, contact and node, is in single precision: seven digits, half the bytes. Places and displacements
#: are in double precision, since gaps and openings are small differences of theirs.
SERIES: dict[str, tuple[Field, ...]] = {
    "blocks": (
        _DISPLACEMENT,
        Field("velocity", "point", "m/s", "velocity of the material point", _XYZ, "float32"),
        Field(_STRESS[0], "cell", *_STRESS[1:], VTK_STRESS, "float32"),
        Field(_PRINCIPAL[0], "cell", *_PRINCIPAL[1:], _PRINCIPAL_NAMES, "float32"),
        Field("block_id", "cell", "-", "index of the block", dtype="int32"),
        Field("material", "cell", "-", "index of the block's material", dtype="int32"),
        Field("fixed", "cell", "-", "1 where the block does not move", dtype="int32"),
        Field("removed", "cell", "-", "1 where the block has been excavated", dtype="int32"),
        Field(
            "key_block",
            "cell",
            "-",
            "with fixed neighbours: -2 not known yet, -1 fixed or excavated, 0 locked by them, 1 removable but "
            "pushed in, 2 removable but kept by strength, 3 slides, 4 falls",
            dtype="int32",
        ),
        Field("displacement_rank", "cell", "-", "0 the block that has moved farthest", dtype="int32"),
    ),
    "cracks": (
        _DISPLACEMENT,
        Field(
            "opening",
            "point",
            "m",
            "normal displacement jump, positive in opening; nan: not solved for. Like what follows, of the last solution of "
            "its block (solved_cycle of its tips)",
        ),
        Field("slip", "point", "m", "tangential jump, positive when the upper face moves along the tangent"),
        Field("normal_traction", "point", "Pa", "on the faces, negative in compression"),
        Field("shear_traction", "point", "Pa", "on the faces, along the crack"),
        Field("state", "point", "-", _STATE, dtype="int32"),
        Field("crack_id", "cell", "-", "index of the crack", dtype="int32"),
        Field("block_id", "cell", "-", "index of the block it lies in", dtype="int32"),
        Field("birth_cycle", "cell", "-", "0 for cracks of the scene, else the cycle in which it grew", dtype="int32"),
    ),
    "tips": (
        _DISPLACEMENT,
        Field("K_I", "point", "Pa √m", "mode I stress intensity factor; negative at an open slot that closes"),
        Field("K_II", "point", "Pa √m", "mode II stress intensity factor; positive turns the crack clockwise"),
        Field("K_eq", "point", "Pa √m", "equivalent factor of the growth criterion, grows at K_Ic"),
        Field("growth_angle", "point", "deg", "from the crack's direction to the growth direction, counter-clockwise"),
        Field("growth_direction", "point", "-", "unit vector in the growth direction of the criterion", _XYZ),
        Field("grown", "point", "m", "advance in this cycle"),
        Field("crack_id", "point", "-", "index of the crack; the names are in CRACK_NAMES", dtype="int32"),
        Field("end", "point", "-", "0 the tip at the start of its crack, 1 at its end", dtype="int32"),
        Field("tip_id", "point", "-", "node of the crack network, as in tips.csv", dtype="int32"),
        Field("solved_cycle", "point", "-", "cycle in which K was computed, as in tips.csv", dtype="int32"),
        Field("block_id", "point", "-", "index of the block it lies in", dtype="int32"),
    ),
    "contacts": (
        _DISPLACEMENT,
        Field("force", "point", "N/m", "on the block that owns the vertex", _XYZ, "float32"),
        Field("normal_force", "point", "N/m", "positive in compression", dtype="float32"),
        Field("shear_force", "point", "N/m", "along the touched edge", dtype="float32"),
        Field("gap", "point", "m", "distance of the faces, negative in penetration", dtype="float32"),
        Field("slip", "point", "m", "accumulated sliding", dtype="float32"),
        Field("wear", "point", "m", "accumulated sliding distance, both directions", dtype="float32"),
        Field(
            "lift",
            "point",
            "m",
            "normal displacement due to dilation; negative: irreversible closure of faces that crush, or a misfit of faces",
            dtype="float32",
        ),
        Field("state", "point", "-", _STATE, dtype="int32"),
        Field("length", "point", "m", "tributary length; 0 at lone corners", dtype="float32"),
        Field("joint", "point", "-", "index of the joint law", dtype="int32"),
        Field(
            "bonded",
            "point",
            "-",
            "1 while cohesion and tensile strength hold, 2 after slip that wears cohesion, 3 cracked from the edge of "
            "its face",
            dtype="int32",
        ),
        Field("block_id", "point", "-", "owner of the vertex", dtype="int32"),
        Field("other_block_id", "point", "-", "owner of the edge", dtype="int32"),
    ),
    "interior": (
        Field(
            "displacement",
            "point",
            "m",
            "of the cracked body: block motion plus its own deformation, tied to the block's at contacts",
            _XYZ,
        ),
        Field(_STRESS[0], "point", *_STRESS[1:], VTK_STRESS, "float32"),
        Field(_PRINCIPAL[0], "point", *_PRINCIPAL[1:], _PRINCIPAL_NAMES, "float32"),
        Field("von_mises", "point", "Pa", "√(3 J₂) of the full tensor", dtype="float32"),
        Field("block_id", "cell", "-", "index of the block", dtype="int32"),
    ),
    "outlines": (
        _DISPLACEMENT,
        Field("block_id", "cell", "-", "index of the block whose edge it is", dtype="int32"),
        Field("fixed", "cell", "-", "1 where the block does not move", dtype="int32"),
        Field("removed", "cell", "-", "1 where the block has been excavated", dtype="int32"),
        Field("edge_name", "cell", "-", "index of the edge's name; the names are in EDGE_NAMES", dtype="int32"),
    ),
    "bolts": (
        _DISPLACEMENT,
        Field("force", "cell", "N/m", "along the bolt, positive in tension"),
        Field("shear_force", "cell", "N/m", "across the bolt (dowel action)"),
        Field("yielded", "cell", "m", "elongation by yielding"),
        Field("state", "cell", "-", "0 not installed yet, 1 acts, 2 yields, 3 broken", dtype="int32"),
        Field("bolt_id", "cell", "-", "index of the bolt; the names are in BOLT_NAMES", dtype="int32"),
    ),
    "water": (
        _DISPLACEMENT,
        Field("ponded", "cell", "-", "1 where the line is the surface of a pond, 0 in the rock", dtype="int32"),
    ),
}

#: Attributes that readers show first: series → (section, attributes of its tag).
ACTIVE: dict[str, dict[str, str]] = {
    "blocks": {"PointData": 'Vectors="displacement"', "CellData": 'Scalars="displacement_rank"'},
    "cracks": {"PointData": 'Scalars="opening" Vectors="displacement"', "CellData": 'Scalars="birth_cycle"'},
    "tips": {"PointData": 'Scalars="K_eq" Vectors="displacement"'},
    "contacts": {"PointData": 'Scalars="normal_force" Vectors="force"'},
    "interior": {"PointData": 'Scalars="von_mises" Vectors="displacement"', "CellData": 'Scalars="block_id"'},
    "outlines": {"PointData": 'Vectors="displacement"', "CellData": 'Scalars="block_id"'},
    "bolts": {"PointData": 'Vectors="displacement"', "CellData": 'Scalars="force"'},
    "water": {"PointData": 'Vectors="displacement"', "CellData": 'Scalars="ponded"'},
}

#: Columns with which every ``history.csv`` begins, and their units; the step's statistics and the monitors follow.
HISTORY: dict[str, str] = {
    "cycle": "-",
    "time": "s",
    "load_step": "-",
    "growth_pass": "-",
    "load": "Pa, positive in compression",
    "strain": "-, positive when shortening",
    "crack_length": "m, all cracks",
    "tips": "number of crack tips",
    "growing": "number of tips that grew in this cycle",
    "max_k_eq": "Pa √m, largest over the tips, as in tips.csv",
    "closed_contacts": "number of contacts that carry force",
}

#: Columns of ``tips.csv``: one row per tip and cycle.
TIPS: dict[str, str] = {
    "cycle": "-",
    "time": "s",
    "load": "Pa",
    "crack": "-",
    "end": "0 the tip that grew from the crack's start, 1 from its end",
    "tip": "node of the crack network",
    "x": "m, reference",
    "y": "m, reference",
    "K_I": "Pa √m",
    "K_II": "Pa √m",
    "K_eq": "Pa √m",
    "angle_deg": "°, from the crack's direction, counter-clockwise",
    "grown_m": "m, in this cycle",
    "crack_name": "as in the scene",
    "solved_cycle": "cycle in which K was computed: this one, but in motion with 8 or more cracked blocks up to 50 cycles "
    "earlier where a bound shows that the block's cracks cannot grow",
}

#: Columns of ``joints.csv``: one row per joint and cycle. A joint has the name of its edges, or else that of its law.
JOINTS: dict[str, str] = {
    "cycle": "-",
    "time": "s",
    "joint": "-",
    "contacts": "number",
    "length": "m, of faces in or near contact",
    "open_length": "m",
    "sliding_length": "m",
    "mean_opening": "m, over the length",
    "max_opening": "m",
    "max_penetration": "m",
    "mean_slip": "m, over the length",
    "max_slip": "m",
    "normal_force": "N/m, sum, positive in compression",
    "shear_force": "N/m, sum of magnitudes",
    "mobilised": "shear force over shear strength (friction and cohesion)",
    "bonded_length": "m",
}

#: Columns of ``reactions.csv``: one row per fixed or guided block and cycle: the forces of contacts on it.
REACTIONS: dict[str, str] = {
    "cycle": "-",
    "time": "s",
    "block": "-",
    "force_x": "N/m",
    "force_y": "N/m",
    "moment": "N m/m, about the mean of its reference vertices",
}

#: Columns of ``events.csv``.
EVENTS: dict[str, str] = {
    "kind": f"initiation, coalescence, daylighting, split, arrest, failure …; {', '.join(CHANGES)}",
    "cycle": "-",
    "time": "s",
    "load": "Pa",
    "x": "m",
    "y": "m",
    "detail": "-",
}

#: Files that `geomech build` writes before a run: file name → its fields.
PREPARED: dict[str, tuple[Field, ...]] = {
    "block_system": (
        Field("block_id", "cell", "-", "index of the block", dtype="int32"),
        Field(
            "zone", "cell", "-", "index of the zone it was cut from, in the order of block_system.json", dtype="int32"
        ),
        Field("material", "cell", "-", "index of the block's material", dtype="int32"),
        Field("fixed", "cell", "-", "1 where the block does not move", dtype="int32"),
        Field("area", "cell", "m²", "area of the whole block"),
    ),
    "joint_lines": (
        Field("name_id", "cell", "-", "index of the edge name, crack or -1, in block_system.json", dtype="int32"),
        Field("kind", "cell", "-", "0 edge between blocks or outline, 1 crack, 2 rock bridge", dtype="int32"),
    ),
}

#: (series, place) → name → field.
_DECLARED = {
    (series, place): {f.name: f for f in fields if f.place == place}
    for series, fields in (SERIES | PREPARED).items()
    for place in ("point", "cell")
}


def declared(series: str, place: str, count: int, arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Dictionary of ``arrays``, which must be those of ``series`` at ``place``, with ``count`` rows each.

    Vectors in the plane may leave out their third component. Raises ValueError naming a missing, undeclared or wrongly
    shaped array.
    """
    fields = _DECLARED[series, place]
    if arrays.keys() != fields.keys():
        missing, extra = sorted(fields.keys() - arrays.keys()), sorted(arrays.keys() - fields.keys())
        raise ValueError(f"{series}: {place} arrays missing {missing}, undeclared {extra}")
    for name, array in arrays.items():
        shape = (count, *fields[name].shape)
        if array.shape != shape and not (shape[1:] == (3,) and array.shape == (count, 2)):
            raise ValueError(f"{series}: {name} has shape {array.shape}, declared {shape}")
    return dict(arrays)
