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
    """Joint laws as arrays (n_laws,); stiffness nan where the solver's penalty is to be used."""

    friction: np.ndarray
    cohesion: np.ndarray
    tension: np.ndarray
    normal_stiffness: np.ndarray
    shear_stiffness: np.ndarray

    @classmethod
    def of(cls, joints: Sequence[JointLaw]) -> JointTable:
        def column(get) -> np.ndarray:
            return np.array([np.nan if get(j) is None else get(j) for j in joints], dtype=float)

        return cls(
            friction=column(lambda j: j.friction),
            cohesion=column(lambda j: j.cohesion),
            tension=column(lambda j: j.tensile_strength),
            normal_stiffness=column(lambda j: j.normal_stiffness),
            shear_stiffness=column(lambda j: j.shear_stiffness),
        )


@dataclass(frozen=True, eq=False)
class Springs:
    """Per contact (n,): stiffness N/m and strengths N, all per metre of thickness; ``friction`` is tan φ."""

    normal: np.ndarray
    shear: np.ndarray
    friction: np.ndarray
    cohesion: np.ndarray
    tension: np.ndarray


def contact_springs(
    table: JointTable, law: np.ndarray, length: np.ndarray, normal_penalty: np.ndarray, shear_penalty: np.ndarray
) -> Springs:
    """Springs of contacts with joint ``law`` (n,) and tributary ``length`` (n,) m.

    A law's stiffness (Pa/m) times the tributary length takes the place of the penalty (Pa); a lone corner has no
    tributary length and keeps the penalty, and has neither cohesion nor tensile strength.
    """
    face = length > 0
    kn, ks = table.normal_stiffness[law], table.shear_stiffness[law]
    return Springs(
        normal=np.where(face & ~np.isnan(kn), kn * length, normal_penalty),
        shear=np.where(face & ~np.isnan(ks), ks * length, shear_penalty),
        friction=table.friction[law],
        cohesion=table.cohesion[law] * length,
        tension=table.tension[law] * length,
    )


def with_dashpots(
    springs: Springs, gap: np.ndarray, mass: np.ndarray, damping: float, dt: float
) -> tuple[Springs, np.ndarray]:
    """Springs and starting gap (n,) m under which N = −kₙ g − c ġ, with ``damping`` = c / (2 √(kₙ m)) and ġ the mean over a
    step of ``dt``; ``mass`` (n,) kg of the lighter free block.

    The approach counts only from touching on, so that the dashpot does not act across an open gap. A step much longer than
    the contact's period leaves the spring as it was.
    """
    if damping == 0.0:
        return springs, gap
    drag = 2.0 * damping * np.sqrt(springs.normal * mass) / dt
    stiffer = springs.normal + drag
    return replace(springs, normal=stiffer), gap - drag / stiffer * np.minimum(gap, 0.0)
