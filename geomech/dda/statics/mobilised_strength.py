"""Mobilised fraction of joint strength in an equilibrium: Σ|S| / Σ (c ℓ + N tan φ) over the contacts of a joint.

Strengths are divided by the factor of that equilibrium: the fraction is 1 where a joint slides over its whole length.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from ...model import OPEN, SLIP, Blocks, JointLaw, State
from ...model.joints.joint_law import STEEPEST
from ..joint_laws.reduced_strength import reduced

#: Largest number of block pairs whose unnamed faces are listed separately; more are summed in one line.
_FEW = 12


@dataclass(frozen=True)
class MobilisedJoint:
    """The faces that one law holds along one ``joint`` (as it was drawn; "A | B": between these blocks; empty: of all
    blocks, where there are many).

    length             m, of its faces
    normal, shear      N/m, sums of magnitudes over closed contacts
    strength           N/m, c ℓ + N tan φ of closed contacts, divided by the factor if it is reduced
    slides, parted     fractions of its length that slide, and that are open
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
        """Mobilised fraction of its strength; 0 without strength."""
        return self.shear / self.strength if self.strength > 0 else 0.0


def mobilised_joints(
    blocks: Blocks, joints: Sequence[JointLaw], state: State, factor: float, chosen: Collection[str] | None = None
) -> list[MobilisedJoint]:
    """All joints, the most mobilised first. ``joints``: laws before the strength of those in ``chosen`` (None: all) was
    divided by ``factor``."""
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
    """Names of the faces of contacts: the edge name on either side, otherwise the two blocks if these are few."""
    drawn = [blocks.edge_names[k] for k in blocks.edge_name[rows["edge"]]]
    pairs = [tuple(sorted(pair)) for pair in zip(rows["block"].tolist(), rows["other"].tolist())]
    faces = list(zip(pairs, rows["law"].tolist()))
    named = {face: name for face, name in zip(faces, drawn) if name}
    plain = {pair: " | ".join(blocks.names[k] for k in pair) for face, pair in zip(faces, pairs) if face not in named}
    few = len(plain) <= _FEW
    return [name or named.get(face) or (plain[pair] if few else "") for name, face, pair in zip(drawn, faces, pairs)]


def _strength(law: JointLaw, row: np.void) -> float:
    """Shear strength of one contact, N/m; of a rough joint after Barton & Choubey (1977)."""
    normal, length = max(float(row["normal_force"]), 0.0), float(row["length"])
    rough = law.roughness
    if rough is not None:
        pressure = max(normal / length, 1e-12 * rough.jcs)
        angle = law.friction_angle + math.radians(rough.jrc_in_place * math.log10(rough.jcs_in_place / pressure))
        return normal * math.tan(min(max(angle, law.friction_angle), STEEPEST)) / rough.reduction
    return (law.cohesion * length if row["bonded"] else 0.0) + normal * law.friction
