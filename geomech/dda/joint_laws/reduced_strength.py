"""Joint laws with strength divided by a factor F, for strength reduction: tan φ/F, c/F, σₜ/F."""

from __future__ import annotations

import math
from dataclasses import replace

from ...model import JointLaw


def reduced(law: JointLaw, factor: float) -> JointLaw:
    """``law`` with tan φ, cohesion and tensile strength (residual values included) divided by ``factor``; the dilation
    angle is kept as long as it is below the friction angle.

    Unless the law gives a residual strength, a face that yields before others keeps its cohesion while it slips, as in
    limit equilibrium: which face yields first depends only on how springs share the load."""
    if law.roughness is not None:
        rough = replace(law.roughness, reduction=law.roughness.reduction * factor)
        return replace(law, roughness=rough)

    def angle(of: float) -> float:
        return math.atan(math.tan(of) / factor)

    friction, residual = angle(law.friction_angle), law.residual_friction_angle
    softens = law.residual_friction_angle is not None or law.residual_cohesion > 0 or law.softening_slip > 0
    kept = law.residual_cohesion if softens else law.cohesion
    return replace(
        law,
        friction_angle=friction,
        cohesion=law.cohesion / factor,
        tensile_strength=law.tensile_strength / factor,
        residual_friction_angle=None if residual is None else angle(residual),
        residual_cohesion=kept / factor,
        dilation_angle=min(law.dilation_angle, friction),
    )
