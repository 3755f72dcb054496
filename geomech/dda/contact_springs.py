"""Stiffness and strength of each contact: penalty springs or joint stiffness, Coulomb friction, cohesion, tension."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..model import JointLaw

#: Penalty over the stiffer block's E' where the settings name none. Shi (1988) advises 10 to 100; 40 keeps the
#: penetration of a unit block under its own elastic shortening by a factor of forty. The shear spring is as stiff.
PENALTY_RATIO = 40.0


@dataclass(frozen=True, eq=False)
class JointTable:
    """Joint laws as arrays (n_laws,); stiffness nan where the solver's penalty is to be used. Slopes are tangents of angles,
    lengths m, stresses Pa; ``jrc`` 0 where a joint is not rough, ``closure`` inf where its stiffness is constant."""

    friction: np.ndarray
    residual_friction: np.ndarray
    cohesion: np.ndarray
    residual_cohesion: np.ndarray
    softening: np.ndarray
    tension: np.ndarray
    dilation: np.ndarray
    dilation_slip: np.ndarray
    jrc: np.ndarray
    jcs: np.ndarray
    residual_angle: np.ndarray
    reduction: np.ndarray
    peak_slip: np.ndarray
    stiff_by_peak: np.ndarray
    closure: np.ndarray
    normal_stiffness: np.ndarray
    shear_stiffness: np.ndarray
    curved: np.ndarray

    @classmethod
    def of(cls, joints: Sequence[JointLaw]) -> JointTable:
        def column(get, without: float = np.nan) -> np.ndarray:
            return np.array([without if get(j) is None else get(j) for j in joints], dtype=float)

        def rough(get, without: float) -> np.ndarray:
            return column(lambda j: j.roughness and get(j.roughness), without)

        return cls(
            friction=column(lambda j: j.friction),
            residual_friction=column(lambda j: j.residual_friction),
            cohesion=column(lambda j: j.cohesion),
            residual_cohesion=column(lambda j: j.residual_cohesion),
            softening=column(lambda j: j.softening_slip),
            tension=column(lambda j: j.tensile_strength),
            dilation=np.tan(column(lambda j: j.dilation_angle)),
            dilation_slip=column(lambda j: j.dilation_slip),
            jrc=rough(lambda r: r.jrc_in_place, 0.0),
            jcs=rough(lambda r: r.jcs_in_place, 1.0),
            residual_angle=column(lambda j: j.friction_angle),
            reduction=rough(lambda r: r.reduction, 1.0),
            peak_slip=rough(lambda r: r.peak_slip, np.inf),
            stiff_by_peak=rough(lambda r: r.from_peak_slip, 0.0) > 0,
            closure=column(lambda j: j.max_closure, np.inf),
            normal_stiffness=column(lambda j: j.normal_stiffness),
            shear_stiffness=column(lambda j: j.shear_stiffness),
            curved=np.array([not j.straight for j in joints], dtype=bool),
        )


@dataclass(frozen=True, eq=False)
class Springs:
    """Per contact (n,): stiffness N/m and strengths N, all per metre of thickness.

    A contact that slides carries ``friction`` N + ``sliding``, one that sticks up to ``peak`` N + ``hold``, plus ``cohesion``
    while it is bonded; it is pulled off at ``tension``. ``lift`` is what sliding opens, m per m along the edge's direction.
    ``keeps`` marks those that slip does not wholly rob of cohesion. Laws that are no straight lines are here as the tangents
    at the forces at hand (`CurvedJoints`).
    """

    normal: np.ndarray
    shear: np.ndarray
    friction: np.ndarray
    sliding: np.ndarray
    peak: np.ndarray
    hold: np.ndarray
    cohesion: np.ndarray
    tension: np.ndarray
    lift: np.ndarray
    keeps: np.ndarray


def contact_springs(
    table: JointTable, law: np.ndarray, length: np.ndarray, normal_penalty: np.ndarray, shear_penalty: np.ndarray
) -> Springs:
    """Springs of contacts with joint ``law`` (n,) and tributary ``length`` (n,) m, that have not slipped.

    A law's stiffness (Pa/m) times the tributary length takes the place of the penalty (Pa); a lone corner has no
    tributary length and keeps the penalty, and has neither cohesion nor tensile strength.
    """
    face = length > 0
    kn, ks = table.normal_stiffness[law], table.shear_stiffness[law]
    friction, nothing = table.friction[law], np.zeros(len(law))
    return Springs(
        normal=np.where(face & ~np.isnan(kn), kn * length, normal_penalty),
        shear=np.where(face & ~np.isnan(ks), ks * length, shear_penalty),
        friction=friction,
        sliding=nothing,
        peak=friction,
        hold=nothing,
        cohesion=table.cohesion[law] * length,
        tension=table.tension[law] * length,
        lift=nothing,
        keeps=(table.residual_cohesion[law] > 0) | (table.softening[law] > 0),
    )


def over_a_step(
    springs: Springs,
    gap: np.ndarray,
    joined: np.ndarray,
    mass: np.ndarray,
    weight: float | np.ndarray,
    damping: float,
    dt: float,
) -> tuple[Springs, np.ndarray]:
    """Springs and starting gap (n,) m whose forces are those that act over a step of ``dt``: ``weight`` θ times that of its
    end and 1 − θ times that of its start, N = −kₙ (θ g₁ + (1−θ) g₀) − c ġ and S = S₀ − θ kₛ Δs.

    c = ``damping`` · 2 √(kₙ m), ġ the mean over the step, ``mass`` (n,) kg of the lighter free block. What is open at the
    start has no force there, unless ``joined`` (n,) by a bond, and approach counts for the dashpot only from touching on:
    neither acts across an open gap. A step much longer than the contact's period leaves the spring as it was.
    """
    if damping == 0.0 and np.all(weight == 1.0):
        return springs, gap
    drag = 2.0 * damping * np.sqrt(springs.normal * mass) / dt
    normal = weight * springs.normal + drag
    start = np.where(joined, gap, np.minimum(gap, 0.0))
    met = springs.normal * (weight * gap + (1.0 - weight) * start) + drag * np.maximum(gap, 0.0)
    return replace(springs, normal=normal, shear=weight * springs.shear), met / normal


def end_of_step(start: np.ndarray, over: np.ndarray, sticking: np.ndarray, weight: float | np.ndarray) -> np.ndarray:
    """(n,) N shear force at the end of a step from that at its ``start`` and the one that acted ``over`` it; sliding contacts
    keep the latter."""
    return over if np.all(weight == 1.0) else np.where(sticking, start + (over - start) / weight, over)
