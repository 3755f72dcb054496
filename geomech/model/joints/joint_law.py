"""Strength and stiffness of joints: Coulomb friction, cohesion, tension; softening, dilation, roughness, closure,
crushing."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NoReturn

from ..numbers import FieldError, Number, refuse_numbers

#: Largest total friction angle of a rough joint at low normal stress (Barton & Choubey 1977), rad.
STEEPEST = math.radians(70.0)


@dataclass(frozen=True)
class Roughness:
    """Rough, unfilled joint of Barton and Bandis: τ = σ tan(JRC log₁₀(JCS/σ) + φr).

    jrc               joint roughness coefficient, 0 to 20, of a sample of ``sample_length`` m
    jcs               compressive strength of the joint's wall, Pa, of the same sample
    length            length of the joint's blocks in place, m, to which both are corrected; None: no correction
    from_peak_slip    the shear stiffness is the peak strength over the slip of the peak, at the present normal stress
                      (Barton & Choubey 1977); otherwise the law's stiffness or the solver's springs hold up to the peak
    reduction         divisor of the strength, peak and residual (a trial factor of safety); dilation is not divided

    Sources: Barton & Choubey (1977), Rock Mechanics 10, 1-54 (strength, 70° limit, stiffness); Barton & Bandis (1982),
    23rd US Symp. Rock Mech. (size, slip of the peak); Barton, Bandis & Bakhtar (1985), Int. J. Rock Mech. 22, 121-140
    (mobilised roughness beyond the peak).
    """

    jrc: float
    jcs: float
    length: float | None = None
    sample_length: float = 0.1
    from_peak_slip: bool = False
    reduction: float = 1.0

    def __post_init__(self) -> None:
        if not 0 < self.jrc <= 20:
            raise ValueError(f"joint roughness coefficient must lie in (0, 20], got {self.jrc!r}")
        if not (self.jcs > 0 and math.isfinite(self.jcs)):
            raise ValueError(f"compressive strength of a joint's wall must be positive, got {self.jcs!r} Pa")
        if not 0 < self.reduction < math.inf:
            raise ValueError(
                f"the reduction factor of a rough joint must be positive and finite, got {self.reduction!r}"
            )
        for what, value in (("length", self.length), ("sample_length", self.sample_length)):
            if value is not None and not (value > 0 and math.isfinite(value)):
                raise ValueError(f"{what} of a rough joint must be positive, got {value!r} m")
        if self.length is not None and self.length < self.sample_length:
            why = f"must be at least its sample's, {self.sample_length:g} m, got {self.length!r} m"
            raise FieldError("length", f"length of a rough joint {why}")

    @property
    def _scale(self) -> float:
        return 1.0 if self.length is None else self.length / self.sample_length

    @property
    def jrc_in_place(self) -> float:
        """JRCₙ = JRC₀ (Lₙ/L₀)^(−0.02 JRC₀)."""
        return self.jrc * self._scale ** (-0.02 * self.jrc)

    @property
    def jcs_in_place(self) -> float:
        """JCSₙ = JCS₀ (Lₙ/L₀)^(−0.03 JRC₀), Pa."""
        return self.jcs * self._scale ** (-0.03 * self.jrc)

    @property
    def peak_slip(self) -> float:
        """δ = (Lₙ/500) (JRCₙ/Lₙ)^0.33, m: the slip at which the strength is reached."""
        length = self.sample_length if self.length is None else self.length
        return length / 500.0 * (self.jrc_in_place / length) ** 0.33


@dataclass(frozen=True)
class Joints:
    """Joint ``laws``, and which of them acts between two edges: ``index(name, name)`` of the law, None where the edges never
    touch; without ``index`` the first acts everywhere."""

    laws: Sequence[JointLaw]
    index: Callable[[str, str], int | None] | None = None


@dataclass(frozen=True)
class JointLaw:
    """Strength and stiffness of a joint. Strengths are Pa, times a contact's tributary length; angles rad.

    A contact sticks up to |τ| = c + σ tan φ. A bonded face fails as a whole: in tension at its extreme fibre, in
    shear at c ℓ + N tan φ.

    friction_angle, cohesion    peak values, before slip; with ``roughness`` the angle is the residual φr
    tensile_strength            lost, as the peak cohesion is, at the first tensile or shear failure
    residual_friction_angle, residual_cohesion   after slip (angle None: as before)
    softening_slip              m of slip over which tan φ and cohesion fall linearly to their residuals; 0: at once
    dilation_angle              ψ: sliding opens the faces by tan ψ times the slip, up to ``dilation_slip`` m from the
                                start
    roughness                   strength curve of Barton and Bandis with its own dilation and decay; None: straight
    normal_stiffness, shear_stiffness   Pa/m; None: the solver's penalty springs. A face with a normal stiffness resists
                                rotation as an elastic bed without tension does
    max_closure                 m: hyperbolic closure σ = kₙ δ/(1 − δ/Vm) of Bandis, Lumsden & Barton (1983), Int. J.
                                Rock Mech. 20, 249-268, with ``normal_stiffness`` the initial one; None: straight
    crushing_strength           Pa: largest normal stress; faces that bear it close further without more stress, and what
                                closes so does not open again; None: no limit
    restitution                 e of Newton's impact law v′ = −e v across the faces of blocks that strike each other, from
                                0 to 1; None: what springs and time integration leave of the speed

    Raises ValueError that names the joint.

    >>> JointLaw("bedding", friction_angle=np.radians(25), cohesion=20e3, tensile_strength=5e3).cohesion
    20000.0
    """

    name: str
    friction_angle: float = 0.0
    cohesion: float = 0.0
    tensile_strength: float = 0.0
    normal_stiffness: float | None = None
    shear_stiffness: float | None = None
    residual_friction_angle: float | None = None
    residual_cohesion: float = 0.0
    softening_slip: float = 0.0
    dilation_angle: float = 0.0
    dilation_slip: float = math.inf
    roughness: Roughness | None = None
    max_closure: float | None = None
    crushing_strength: float | None = None
    restitution: float | None = None

    def __post_init__(self) -> None:
        angles = ("friction_angle", "residual_friction_angle", "dilation_angle")
        for what in angles:
            value = getattr(self, what)
            if value is not None and not 0 <= value < math.pi / 2:
                radians = " (angles are in radians here)" if value > 1.6 else ""
                self._refuse(
                    what, f"{what.replace('_', ' ')} must lie in [0°, 90°), got {math.degrees(value):g}°{radians}"
                )
        refuse_numbers(self, _NUMBERS, f"joint {self.name!r}")
        if math.isinf(self.cohesion) and self.softening_slip:
            self._refuse("softening_slip", "an infinite cohesion does not fall over a softening_slip")
        if self.residual_friction_angle is not None and self.residual_friction_angle > self.friction_angle:
            self._refuse(
                "residual_friction_angle",
                f"the residual friction angle ({math.degrees(self.residual_friction_angle):g}°) is above the peak "
                f"({math.degrees(self.friction_angle):g}°)",
            )
        if self.residual_cohesion > self.cohesion:
            self._refuse(
                "residual_cohesion",
                f"the residual cohesion ({self.residual_cohesion:g} Pa) is above the peak ({self.cohesion:g} Pa)",
            )
        if self.dilation_angle > self.friction_angle:
            self._refuse(
                "dilation_angle",
                f"the dilation angle ({math.degrees(self.dilation_angle):g}°) is above the friction angle "
                f"({math.degrees(self.friction_angle):g}°): sliding would yield work",
            )
        if self.max_closure is not None and self.normal_stiffness is None:
            self._refuse("max_closure", "max_closure needs a normal_stiffness, the initial one")
        if self.restitution is not None and self.normal_stiffness is not None:
            why = "restitution does not go with a normal_stiffness, whose spring gives an impact its rebound"
            self._refuse("restitution", why)
        self._check_crushing()
        self._check_roughness()

    def _check_crushing(self) -> None:
        if self.crushing_strength is None:
            return
        if not self.straight:
            why = "does not go with softening, dilation, roughness or max_closure: give a linear law with it"
            self._refuse("crushing_strength", f"crushing_strength {why}")
        if self.restitution is not None:
            why = "crushing_strength does not go with restitution: crushing determines the rebound"
            self._refuse("crushing_strength", why)

    def _check_roughness(self) -> None:
        if self.roughness is not None:
            plain = JointLaw.__dataclass_fields__
            for what in (
                "cohesion", "tensile_strength", "residual_friction_angle", "residual_cohesion", "softening_slip",
                "dilation_angle", "dilation_slip",
            ):  # fmt: skip
                if getattr(self, what) != plain[what].default:
                    self._refuse(what, f"{what} does not go with roughness, which has its own")
            if self.roughness.from_peak_slip and self.shear_stiffness is not None:
                why = "shear_stiffness is given, and is to follow from the slip of the peak as well"
                self._refuse("shear_stiffness", why)
            if self.friction_angle >= STEEPEST:
                self._refuse("friction_angle", "the residual friction angle of a rough joint must be below 70°")

    def _refuse(self, field: str, why: str) -> NoReturn:
        raise FieldError(field, f"joint {self.name!r}: {why}")

    @property
    def friction(self) -> float:
        """tan φ before slip (peak); of a rough joint tan φr over its strength reduction."""
        return math.tan(self.friction_angle) / (1.0 if self.roughness is None else self.roughness.reduction)

    @property
    def residual_friction(self) -> float:
        """tan φ after slip."""
        return self.friction if self.residual_friction_angle is None else math.tan(self.residual_friction_angle)

    @property
    def straight(self) -> bool:
        """True for one straight Coulomb line with constant stiffness: no softening, dilation, roughness or closure.
        (Faces may crush.)"""
        return (
            self.residual_friction == self.friction
            and not self.residual_cohesion
            and not (self.softening_slip and self.cohesion)
            and not self.dilation_angle
            and self.roughness is None
            and self.max_closure is None
        )


#: Admissible numbers of `JointLaw`, without its angles.
_NUMBERS = {
    "cohesion": Number(unit="Pa", infinite=True),
    "tensile_strength": Number(unit="Pa", infinite=True),
    "residual_cohesion": Number(unit="Pa", infinite=True),
    "normal_stiffness": Number(closed=False, unit="Pa/m", optional=True),
    "shear_stiffness": Number(closed=False, unit="Pa/m", optional=True),
    "softening_slip": Number(unit="m"),
    "dilation_slip": Number(closed=False, unit="m", infinite=True),
    "max_closure": Number(closed=False, unit="m", optional=True),
    "crushing_strength": Number(closed=False, unit="Pa", optional=True),
    "restitution": Number(most=1.0, optional=True),
}
