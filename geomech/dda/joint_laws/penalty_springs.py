"""Stiffness and strength of each contact: penalty springs or joint stiffness, Coulomb friction, cohesion, tension."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...model import JointLaw

#: Penalty over E' where the settings name none. Shi (1988) advises 10 to 100. The two springs of a face give way by a
#: part 1/(2 · 40) of what the block itself is shortened; brick walls take about as many iterations a step from 1 to 40
#: E', half as many again with 160 and twice as many with 1000. The shear spring is as stiff.
PENALTY_RATIO = 40.0
#: A spring that is stiffer than so many times m/dt², m the mass of the lighter block, swings within the step: what it adds
#: no step resolves, and contacts of rock that an impact shakes open and close by micrometres. Springs "resolved" are no
#: stiffer in motion (a slope of 1 000 blocks at 5 ms: 14 open–close iterations a step become 9), and not softer than this
#: part of E'. (Where contacts take such springs only as they close, and keep them until they open, loaded ones are given
#: no energy, but seven in ten contacts of that slope have not opened after 2 s. Ten slopes that slide take a tenth fewer
#: iterations then and no less time, instead of a third fewer; and of 400 steps of walls struck at 3 to 30 m/s 60 are
#: cut, for 9.)
RESOLVED, SOFTEST = 100.0, 0.5
#: Between unlike blocks the geometric mean of both E' counts, at most this many times the softer. By the stiffer one
#: alone walls of two rocks 1 : 1000 do not settle and 1 : 10⁶ costs five digits; by the softer one alone, steel platens
#: on rock give way twelve times as much as they need.
_MOST_CONTRAST = 32.0
#: A joint's stiffness per area acts on a contact's tributary length, and on no less than this part of the smaller
#: block's size, √area. A corner has no length: were it as stiff as the solver's penalty, blocks that slide or turn from
#: a face onto a corner would begin on it with the penetration of the soft face, a hundred times the force and energy
#: from nowhere, and what comes to lie on a sliver of a face would store its shear force in a spring that is next to
#: none. Faces of slabs up to 100 : 1 are longer than that.
_LEAST_FACE = 0.05


@dataclass(frozen=True, eq=False)
class JointTable:
    """Joint laws as arrays (n_laws,); stiffness nan where the solver's penalty is to be used. Slopes are tangents of
    angles, lengths m, stresses Pa; ``jrc`` 0 where a joint is not rough, ``closure`` inf where its stiffness is
    constant."""

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
            restitution=column(lambda j: j.restitution),
            normal_stiffness=column(lambda j: j.normal_stiffness),
            shear_stiffness=column(lambda j: j.shear_stiffness),
            curved=np.array([not j.straight for j in joints], dtype=bool),
        )


@dataclass(frozen=True, eq=False)
class Springs:
    """Per contact (n,): stiffness N/m and strengths N, all per metre of thickness.

    A contact that slides carries ``friction`` N + ``sliding``, one that sticks up to ``peak`` N + ``hold``, plus
    ``cohesion`` while it is bonded; it is pulled off at ``tension``. ``lift`` is what sliding opens, m per m along the
    edge's direction. ``keeps`` marks those that slip does not wholly rob of cohesion. Laws that are no straight lines
    are here as the tangents at the forces at hand (`CurvedJoints`).
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

    `PENALTY_RATIO` times the E' of both (a block that is fixed or rigid does not give way: the other's, so that a
    platen has the same springs whether it stands or is moved) times the ratio of the face to the
    block's depth behind it where that is above one, ≈ 4 ℓ²/A: the springs of a slab 1000 : 1 would otherwise give way
    by twelve times its own shortening, and so give way by the hundredth that those of a square do.
    """
    hold, hold_other = fixed[block] | rigid[block], fixed[other] | rigid[other]
    neither = hold & hold_other
    hold, hold_other = np.where(neither, fixed[block], hold), np.where(neither, fixed[other], hold_other)
    own = np.where(hold, modulus[other], modulus[block])
    theirs = np.where(hold_other, modulus[block], modulus[other])
    both = np.minimum(np.sqrt(own * theirs), _MOST_CONTRAST * np.minimum(own, theirs))
    larger = np.maximum(np.where(hold, 0.0, area[block]), np.where(hold_other, 0.0, area[other]))
    return PENALTY_RATIO * both * np.maximum(1.0, 4.0 * length * length / larger)


def resolved(stiffness: np.ndarray, block: np.ndarray, other: np.ndarray, mass: np.ndarray, dt: float) -> np.ndarray:
    """(n,) Pa: of the penalty ``stiffness`` (n,) Pa of contacts between ``block`` and ``other`` (n,) as much as steps of
    ``dt`` s resolve; ``mass`` (n_blocks,) kg/m, infinite where fixed. Of all steps of a run alike, however these are cut: a
    force that is a stiffness times a gap must not jump with them."""
    lighter = np.minimum(mass[block], mass[other])
    return np.clip(RESOLVED * lighter / dt**2, SOFTEST / PENALTY_RATIO * stiffness, stiffness)


def least_face(block: np.ndarray, other: np.ndarray, area: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """(n,) m of face that the stiffness of a contact between ``block`` and ``other`` (n,) is that of at least; ``area``
    m² and ``fixed`` (n_blocks,)."""
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
    """Springs of contacts with joint ``law`` (n,) and tributary ``length`` (n,) m, that have not slipped.

    A law's stiffness (Pa/m) times the tributary length, at ``least`` (n,) m (`least_face`), takes the place of the
    penalty (Pa). A lone corner has no tributary length and neither cohesion nor tensile strength.
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
    """Springs and starting gap (n,) m whose forces are those that act over a step of ``dt``: ``weight`` θ times that of
    its end and 1 − θ times that of its start, N = −kₙ (θ g₁ + (1−θ) g₀) − c ġ and S = S₀ − θ kₛ Δs.

    c = ``damping`` · 2 √(kₙ m), ġ the mean over the step, ``mass`` (n,) kg of the lighter free block. What is open at
    the start has no force there, unless ``joined`` (n,) by a bond, and approach counts for the dashpot only from
    touching on: neither acts across an open gap. A step much longer than the contact's period leaves the spring as it
    was. ``arc`` (n,) m as in `ContactSet`: what is added to g₁ though no displacement of the step does.
    """
    if damping == 0.0 and np.all(weight == 1.0):
        return springs, gap + arc
    drag = 2.0 * damping * np.sqrt(springs.normal * mass) / dt
    normal = weight * springs.normal + drag
    start = np.where(joined, gap, np.minimum(gap, 0.0))
    met = springs.normal * (weight * (gap + arc) + (1.0 - weight) * start) + drag * (np.maximum(gap, 0.0) + arc)
    return replace(springs, normal=normal, shear=weight * springs.shear), met / normal


def end_of_step(start: np.ndarray, over: np.ndarray, sticking: np.ndarray, weight: float | np.ndarray) -> np.ndarray:
    """(n,) N shear force at the end of a step from that at its ``start`` and the one that acted ``over`` it; sliding
    contacts keep the latter."""
    return over if np.all(weight == 1.0) else np.where(sticking, start + (over - start) / weight, over)
