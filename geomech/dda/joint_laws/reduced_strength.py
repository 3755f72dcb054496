"""Joint laws with their strength divided by a factor F, as strength reduction asks for them: tan φ/F, c/F, σₜ/F."""

from __future__ import annotations

import math
from dataclasses import replace

from ...model import JointLaw


def reduced(law: JointLaw, factor: float) -> JointLaw:
    """``law`` with tan φ, cohesion and tensile strength (their residuals too) divided by ``factor``; an angle of
    dilation is kept as long as it is below that of friction.

    A face that yields before others do keeps its cohesion on what it slips until these yield too, unless the law says
    what strength slip leaves: limit equilibrium counts all of it, and which face yields first is a matter of how stiff
    springs share loads."""
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
