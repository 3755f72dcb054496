"""Stiffness and strength of each contact: penalty springs or joint stiffness, Coulomb friction, cohesion, tension."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...model import JointLaw

#: Default penalty over E', for normal and shear springs. Shi (1988) recommends 10 to 100. At 40 the two springs of a
#: face deform by 1/80 of the shortening of the block. Brick walls take about the same number of iterations per step
#: from 1 to 40 E', 1.5 times as many with 160 and twice as many with 1000.
PENALTY_RATIO = 40.0
#: Springs "resolved": largest stiffness in motion, in units of m/dt² with m the mass of the lighter block, and
#: smallest, relative to E'. Stiffer springs oscillate within the step, which does not resolve them, and after an impact
#: contacts open and close by micrometres. (A slope of 1 000 blocks at 5 ms: 9 open–close iterations per step instead of
#: 14. Without the change of loaded springs, if contacts take the stiffness as they close and keep it until they open, no
#: energy is added. But 70 % of that slope's contacts have not opened after 2 s; ten sliding slopes take 9 % fewer
#: iterations instead of 30 %; and in walls struck at 3 to 30 m/s, 60 cuts in 400 steps instead of 9.)
RESOLVED, SOFTEST = 100.0, 0.5
#: Between blocks of different E' the geometric mean is used, limited to this multiple of the smaller one. With the
#: larger E' alone, walls of two rocks with a ratio of 1000 do not converge, and a ratio of 10⁶ costs five digits; with
#: the smaller alone, steel platens on rock deform twelve times more than necessary.
_MOST_CONTRAST = 32.0
#: Smallest length for the stiffness of a joint (Pa/m times tributary length), relative to the smaller block's size
#: √area. A corner has no tributary length. With the penalty stiffness, a block that slides or turns from a soft face
#: onto a corner would start with the penetration of the face: a hundred times the force, and energy from nothing. On a
#: very short face, shear would be stored in a spring of almost no stiffness. Faces of slabs up to 100 : 1 are longer
#: than this.
_LEAST_FACE = 0.05


@dataclass(frozen=True, eq=False)
class JointTable:
    """Joint laws as arrays (n_laws,). Stiffness is nan where the penalty is used, ``jrc`` 0 where a joint is not rough,
    ``closure`` inf where stiffness is constant, ``crushing`` inf where faces do not crush. Friction and dilation are tangents of angles, lengths m, stresses
    Pa."""

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
    crushing: np.ndarray
    restitution: np.ndarray
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
            crushing=column(lambda j: j.crushing_strength, np.inf),
            restitution=column(lambda j: j.restitution),
            normal_stiffness=column(lambda j: j.normal_stiffness),
            shear_stiffness=column(lambda j: j.shear_stiffness),
            curved=np.array([not j.straight for j in joints], dtype=bool),
        )


class Springs(NamedTuple):
    """Per contact (n,): stiffness N/m and strengths N, all per metre of thickness.

    A sliding contact carries ``friction`` N + ``sliding``, a sticking one up to ``peak`` N + ``hold``, plus
    ``cohesion`` while it is bonded; it opens at the tensile force ``tension``. ``lift``: dilation, m per m of slip
    along the edge's direction. ``keeps``: contacts that keep some cohesion after slip. ``crushing``: largest normal
    force, infinite without limit (`crushing`). Nonlinear laws are represented
    by their tangents at the present forces (`CurvedJoints`).
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
    crushing: np.ndarray

    def of(self, contacts: np.ndarray) -> Springs:
        """The springs of some ``contacts``, their numbers (k,) or (n,) bool."""
        return Springs(*(each[contacts] for each in self))


def penalties(
    block: np.ndarray,
    other: np.ndarray,
    length: np.ndarray,
    modulus: np.ndarray,
    area: np.ndarray,
    fixed: np.ndarray,
    rigid: np.ndarray,
) -> np.ndarray:
    """(n,) Pa: penalty stiffness of contacts with tributary ``length`` (n,) m between ``block`` and ``other`` (n,); E'
    ``modulus`` Pa, ``area`` m², ``fixed`` and ``rigid`` (n_blocks,).

    `PENALTY_RATIO` times the combined E' of both blocks (if one is fixed or rigid, that of the other, so that a platen
    has the same springs whether it is fixed or moving), times the ratio of the face length to the block's depth behind
    it, ≈ 4 ℓ²/A, where that is above one. Without this factor the springs of a slab 1000 : 1 would deform by twelve
    times its own shortening; with it, by a hundredth, as for a square.
    """
    hold, hold_other = fixed[block] | rigid[block], fixed[other] | rigid[other]
    neither = hold & hold_other
    hold, hold_other = np.where(neither, fixed[block], hold), np.where(neither, fixed[other], hold_other)
    of_block = np.where(hold, modulus[other], modulus[block])
    of_other = np.where(hold_other, modulus[block], modulus[other])
    both = np.minimum(np.sqrt(of_block * of_other), _MOST_CONTRAST * np.minimum(of_block, of_other))
    larger = np.maximum(np.where(hold, 0.0, area[block]), np.where(hold_other, 0.0, area[other]))
    return PENALTY_RATIO * both * np.maximum(1.0, 4.0 * length * length / larger)


def resolved(stiffness: np.ndarray, block: np.ndarray, other: np.ndarray, mass: np.ndarray, dt: float) -> np.ndarray:
    """(n,) Pa: penalty ``stiffness`` (n,) Pa of contacts between ``block`` and ``other`` (n,), limited to what steps of
    ``dt`` s resolve; ``mass`` (n_blocks,) kg/m, infinite where fixed. ``dt`` is the same for all steps of a run, even
    if they are cut: forces, stiffness times gap, must not jump."""
    lighter = np.minimum(mass[block], mass[other])
    return np.clip(RESOLVED * lighter / dt**2, SOFTEST / PENALTY_RATIO * stiffness, stiffness)


def least_face(block: np.ndarray, other: np.ndarray, area: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """(n,) m: smallest length for the stiffness of a contact between ``block`` and ``other`` (n,); ``area`` m² and
    ``fixed`` (n_blocks,)."""
    free = np.where(fixed, np.inf, area)
    smaller = np.minimum(free[block], free[other])
    return _LEAST_FACE * np.sqrt(np.where(np.isfinite(smaller), smaller, np.minimum(area[block], area[other])))


def contact_springs(
    table: JointTable,
    law: np.ndarray,
    length: np.ndarray,
    least: np.ndarray,
    normal_penalty: np.ndarray,
    shear_penalty: np.ndarray,
) -> Springs:
    """Springs of contacts with joint ``law`` (n,) and tributary ``length`` (n,) m before slip.

    If a law has a stiffness (Pa/m), that times the tributary length, or times ``least`` (n,) m (`least_face`) if
    longer, replaces the penalty (Pa). A single corner has no tributary length: neither cohesion nor tensile strength, and
    no limit of its normal force.
    """
    bearing = np.maximum(length, least)
    kn, ks = table.normal_stiffness[law], table.shear_stiffness[law]
    friction, nothing = table.friction[law], np.zeros(len(law))
    return Springs(
        normal=np.where(np.isnan(kn), normal_penalty, kn * bearing),
        shear=np.where(np.isnan(ks), shear_penalty, ks * bearing),
        friction=friction,
        sliding=nothing,
        peak=friction,
        hold=nothing,
        cohesion=table.cohesion[law] * length,
        tension=table.tension[law] * length,
        lift=nothing,
        keeps=(table.residual_cohesion[law] > 0) | (table.softening[law] > 0),
        crushing=np.where(length > 0.0, table.crushing[law] * np.where(length > 0.0, length, 1.0), np.inf),
    )


def over_a_step(
    springs: Springs,
    gap: np.ndarray,
    joined: np.ndarray,
    mass: np.ndarray,
    weight: float | np.ndarray,
    damping: float,
    dt: float,
    arc: np.ndarray | float = 0.0,
) -> tuple[Springs, np.ndarray]:
    """Springs and starting gap (n,) m for the forces that act over a step of ``dt``: ``weight`` θ times the force at
    its end plus 1 − θ times that at its start, N = −kₙ (θ g₁ + (1−θ) g₀) − c ġ and S = S₀ − θ kₛ Δs.

    c = ``damping`` · 2 √(kₙ m), ġ the mean rate over the step, ``mass`` (n,) kg of the lighter free block. A contact
    that is open at the start has no force there, unless it is ``joined`` (n,) by a bond, and its dashpot acts only
    after closure. In a step much longer than the period of the contact the spring is unchanged. ``arc`` (n,) m as in
    `ContactSet`: a contribution to g₁ that is not linear in the displacement.
    """
    if damping == 0.0 and np.all(weight == 1.0):
        return springs, gap + arc
    drag = 2.0 * damping * np.sqrt(springs.normal * mass) / dt
    normal = weight * springs.normal + drag
    start = np.where(joined, gap, np.minimum(gap, 0.0))
    met = springs.normal * (weight * (gap + arc) + (1.0 - weight) * start) + drag * (np.maximum(gap, 0.0) + arc)
    return springs._replace(normal=normal, shear=weight * springs.shear), met / normal


def end_of_step(start: np.ndarray, over: np.ndarray, sticking: np.ndarray, weight: float | np.ndarray) -> np.ndarray:
    """(n,) N: shear force at the end of a step, from that at its ``start`` and the one that acted ``over`` it; for
    sliding contacts the latter."""
    return over if np.all(weight == 1.0) else np.where(sticking, start + (over - start) / weight, over)
