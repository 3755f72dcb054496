"""How much of their strength joints have mobilised in an equilibrium: Σ|S| / Σ (c ℓ + N tan φ) over their contacts.

Strengths are those of the state, divided by the factor it was found at: where a joint slides all along, the share is 1.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from ...model import OPEN, SLIP, Blocks, JointLaw, State
from ...model.joints.joint_law import STEEPEST
from ..joint_laws.reduced_strength import reduced

#: Faces without a name are told by their blocks up to so many pairs, and in one line beyond.
_FEW = 12


@dataclass(frozen=True)
class MobilisedJoint:
    """The faces that one law holds along one ``joint`` (as it was drawn; "A | B": between these blocks; empty: of all
    blocks, where there are many).

    length             m, of its faces
    normal, shear      N/m, sums of the magnitudes over what touches
    strength           N/m, c ℓ + N tan φ of what touches, divided by the factor if it is reduced
    slides, parted     parts of its length that slide, and that do not touch
    reduced            whether its strength was divided by the factor
    """

    joint: str
    law: str
    length: float
    normal: float
    shear: float
    strength: float
    slides: float
    parted: float
    reduced: bool

    @property
    def share(self) -> float:
        """Of its strength; 0 where nothing presses."""
        return self.shear / self.strength if self.strength > 0 else 0.0


def mobilised_joints(
    blocks: Blocks, joints: Sequence[JointLaw], state: State, factor: float, chosen: Collection[str] | None = None
) -> list[MobilisedJoint]:
    """Every joint, the most mobilised one first; ``joints`` as they were before the strength of those ``chosen`` (None:
    of all) was divided by ``factor``."""
    laws = [reduced(law, factor) if chosen is None or law.name in chosen else law for law in joints]
    rows = state.contacts[state.contacts["length"] > 0]
    names = list(zip(_names(blocks, rows), rows["law"].tolist()))
    out = []
    for name, index in sorted(set(names)):
        own = rows[[each == (name, index) for each in names]]
        law = laws[index]
        touching = own[own["state"] != OPEN]
        length = float(own["length"].sum())
        # Open ends of faces that touch elsewhere keep their cohesion (`whole_faces`).
        strength = sum(_strength(law, row) for row in own)
        out.append(
            MobilisedJoint(
                name,
                law.name,
                length,
                float(touching["normal_force"].sum()),
                float(np.abs(touching["shear_force"]).sum()),
                float(strength),
                float(touching["length"][touching["state"] == SLIP].sum()) / length,
                1.0 - float(touching["length"].sum()) / length,
                chosen is None or law.name in chosen,
            )
        )
    return sorted(out, key=lambda each: -each.share)


def _names(blocks: Blocks, rows: np.ndarray) -> list[str]:
    """What the faces of contacts are called: as they were drawn, on either side, else by their two blocks while these
    are few."""
    drawn = [blocks.edge_names[k] for k in blocks.edge_name[rows["edge"]]]
    pairs = [tuple(sorted(pair)) for pair in zip(rows["block"].tolist(), rows["other"].tolist())]
    faces = list(zip(pairs, rows["law"].tolist()))
    named = {face: name for face, name in zip(faces, drawn) if name}
    plain = {pair: " | ".join(blocks.names[k] for k in pair) for face, pair in zip(faces, pairs) if face not in named}
    few = len(plain) <= _FEW
    return [name or named.get(face) or (plain[pair] if few else "") for name, face, pair in zip(drawn, faces, pairs)]


def _strength(law: JointLaw, row: np.void) -> float:
    """What holds the shear of one contact, N/m; of a rough joint after Barton & Choubey (1977)."""
    normal, length = max(float(row["normal_force"]), 0.0), float(row["length"])
    rough = law.roughness
    if rough is not None:
        pressure = max(normal / length, 1e-12 * rough.jcs)
        angle = law.friction_angle + math.radians(rough.jrc_in_place * math.log10(rough.jcs_in_place / pressure))
        return normal * math.tan(min(max(angle, law.friction_angle), STEEPEST)) / rough.reduction
    return (law.cohesion * length if row["bonded"] else 0.0) + normal * law.friction
