"""Joint laws from their tables, and the errors of tables that do not make a law."""

from __future__ import annotations

import math

from ...model import JointLaw, Roughness
from ...model.numbers import FieldError
from ..checks.check import Check
from ..tables.entries import given
from ..tables.rock import JointTable

#: Keys of a rough joint that need its roughness.
_OF_ROUGHNESS = ("joint_length_m", "sample_length_m", "stiffness_from_peak_slip")
_UNLESS_ROUGH = "leave it out, or leave out jrc and jcs_pa"
#: Field of a law → its key, and the way out where its value does not go with those of other keys.
_KEYS = {
    "cohesion": ("cohesion_pa", _UNLESS_ROUGH),
    "tensile_strength": ("tensile_strength_pa", _UNLESS_ROUGH),
    "residual_friction_angle": ("residual_friction_angle_deg", "make it at most friction_angle_deg"),
    "residual_cohesion": ("residual_cohesion_pa", "make it at most cohesion_pa"),
    "softening_slip": ("softening_slip_m", "leave it out, or give a finite cohesion_pa"),
    "dilation_angle": ("dilation_angle_deg", "make it at most friction_angle_deg"),
    "max_closure": ("max_closure_m", "add normal_stiffness_pa_per_m, the stiffness where closure begins"),
    "crushing_strength": ("crushing_strength_pa", "leave it out, or the other key"),
    "restitution": ("restitution", "leave it out, or leave out normal_stiffness_pa_per_m"),
    "shear_stiffness": ("shear_stiffness_pa_per_m", "leave it out, or stiffness_from_peak_slip"),
    "length": ("joint_length_m", "leave it out: the values of the sample are used then"),
}
#: The same for rough joints, where it differs.
_KEYS_IF_ROUGH = _KEYS | {
    "friction_angle": ("friction_angle_deg", "with jrc it is the residual angle, without roughness"),
    "residual_friction_angle": ("residual_friction_angle_deg", "friction_angle_deg is the residual one"),
    "residual_cohesion": ("residual_cohesion_pa", _UNLESS_ROUGH),
    "softening_slip": ("softening_slip_m", "leave it out: the roughness degrades anyway"),
    "dilation_angle": ("dilation_angle_deg", "leave it out: the roughness causes dilation anyway"),
    "dilation_slip": ("dilation_slip_m", "leave it out: the roughness causes dilation anyway"),
}


def joint_law(name: str, joint: JointTable) -> JointLaw:
    """The law of table ``joint``. Raises ValueError, for values that do not go together `FieldError`."""
    rough = None
    if joint.jrc is not None:
        rough = Roughness(
            joint.jrc,
            given(joint.jcs_pa),
            length=joint.joint_length_m,
            sample_length=joint.sample_length_m,
            from_peak_slip=joint.stiffness_from_peak_slip,
        )
    residual = joint.residual_friction_angle_deg
    return JointLaw(
        name,
        friction_angle=math.radians(joint.friction_angle_deg),
        cohesion=joint.cohesion_pa,
        tensile_strength=joint.tensile_strength_pa,
        normal_stiffness=joint.normal_stiffness_pa_per_m,
        shear_stiffness=joint.shear_stiffness_pa_per_m,
        residual_friction_angle=None if residual is None else math.radians(residual),
        residual_cohesion=joint.residual_cohesion_pa,
        softening_slip=joint.softening_slip_m,
        dilation_angle=math.radians(joint.dilation_angle_deg),
        dilation_slip=math.inf if joint.dilation_slip_m is None else joint.dilation_slip_m,
        roughness=rough,
        max_closure=joint.max_closure_m,
        crushing_strength=joint.crushing_strength_pa,
        restitution=joint.restitution,
    )


def check_joints(c: Check) -> None:
    """Inconsistent values of joints, and laws that crack faces cannot have."""
    laws: dict[str, JointLaw] = {}
    for name, joint in (c.tables.joints or {}).items():
        missing = {"jrc": "jcs_pa", "jcs_pa": "jrc"}
        for key, other in missing.items():
            if getattr(joint, key) is not None and getattr(joint, other) is None:
                c.refuse(("joints", name, key), f"joint {name!r} has {key} but no {other}", f"add {other}")
        # A scene written out with all its defaults is valid as well.
        usual = JointTable()
        idle = [key for key in _OF_ROUGHNESS if joint.jrc is None and getattr(joint, key) != getattr(usual, key)]
        for key in idle:
            c.refuse(("joints", name, key), f"joint {name!r} has {key} but no roughness", "add jrc and jcs_pa")
        if idle or (joint.jrc is None) != (joint.jcs_pa is None):
            continue
        try:
            laws[name] = joint_law(name, joint)
        except ValueError as error:
            field = error.field if isinstance(error, FieldError) else ""
            key, way_out = (_KEYS if joint.jrc is None else _KEYS_IF_ROUGH).get(field, ("", ""))
            c.refuse(("joints", name, key) if key else ("joints", name), str(error), way_out)
    for name, crack in (c.tables.cracks or {}).items():
        law = laws.get(crack.joint or "")
        if law is not None and law.crushing_strength is not None:
            c.refuse(
                ("cracks", name, "joint"),
                f"crack faces cannot follow joint {crack.joint!r}: they do not crush",
                "name a joint without crushing_strength_pa",
            )
        elif law is not None and not law.straight:
            c.refuse(
                ("cracks", name, "joint"),
                f"crack faces cannot follow joint {crack.joint!r}: they support neither residual friction, softening, "
                "dilation, roughness nor hyperbolic closure",
                "name a joint with friction_angle_deg, cohesion_pa, tensile_strength_pa and stiffnesses only",
            )
