"""Nonlinear joint laws: their tangents at the present forces, and the misfit between a solution and the laws.

Each contact enters the step with linear laws: N = −k (g − κ p), |S| ≤ μ N + c. A curved law (Barton & Bandis' strength,
hyperbolic closure), a law that depends on past slip (softening, mobilised roughness) and dilation are replaced by the
tangent at the normal force and the secant over the slip of the last open–close iteration. The step has converged only
when linear and nonlinear laws give the same forces, so that nothing lags by a step.

Strength and dilation: Barton & Choubey (1977) eqs. 7 and 11; mobilised roughness beyond the peak: Barton, Bandis &
Bakhtar (1985) fig. 4; closure: Bandis, Lumsden & Barton (1983) eq. 8.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from ...model import OPEN, SLIP
from ...model.joints.joint_law import STEEPEST
from ..kinematics.tolerances import NOTHING
from .penalty_springs import JointTable, Springs

if TYPE_CHECKING:
    from ..open_close.contact_set import ContactSet

#: JRC mobilised over its peak, at slips over that of the peak.
_SLIP_OVER_PEAK = np.array([1.0, 2.0, 4.0, 10.0, 25.0, 100.0])
_ROUGHNESS_LEFT = np.array([1.0, 0.85, 0.70, 0.50, 0.40, 0.0])
#: Tolerance between forces and laws, relative to the contact's force. Wear by slip is found by successive substitution,
#: so it is larger than the round-off tolerance of contact states.
_AGREED = 1e-8
#: … for normal forces also relative to the force that the rounding of a gap makes in its spring. (Slip of millimetres is
#: known to some such roundings, and dilation passes them on to the gap: three in a slab on a rough plane.)
_ROUNDED = 4.0


def rough_strength(
    pressure: np.ndarray, jrc: np.ndarray, jcs: np.ndarray, residual_angle: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(strength Pa, its slope over pressure, peak dilation angle rad) of rough joints under ``pressure`` (n,) Pa ≥ 0.

    τ = σ tan(JRC log₁₀(JCS/σ) + φr), the angle at most 70° (σ → 0) and at least φr (σ ≥ JCS); the dilation is half the
    part of the angle that roughness brings.
    """
    with np.errstate(divide="ignore"):
        brought = np.radians(jrc) * np.log10(np.where(pressure > 0, jcs / np.maximum(pressure, 1e-300), np.inf))
    angle = np.clip(residual_angle + brought, residual_angle, STEEPEST)
    bends = (angle > residual_angle) & (angle < STEEPEST)
    slope = np.tan(angle)
    tangent = slope - np.where(bends, np.radians(jrc) / np.log(10.0) * (1.0 + slope * slope), 0.0)
    return pressure * slope, tangent, 0.5 * (angle - residual_angle)


class NonlinearLaws(Protocol):
    """Contacts ``rows`` (k,) of a step whose forces are not linear in their motion within a state.

    ``continued()`` begins a sequence of laws that lead to the actual ones, for iterations that do not converge, and
    ``proceeded()`` continues with the next one of it; both return whether there was any.
    """

    rows: np.ndarray

    def continued(self) -> bool: ...

    def proceeded(self) -> bool: ...

    def lines(
        self, springs: Springs, gap: np.ndarray, found: ContactSet, state: np.ndarray, direction: np.ndarray,
        bonded: np.ndarray, normal_force: np.ndarray, plastic: np.ndarray,
    ) -> tuple[Springs, np.ndarray]: ...  # fmt: skip

    def misfit(
        self, was: Springs, gap_was: np.ndarray, now: Springs, gap_now: np.ndarray, state: np.ndarray,
        forces: np.ndarray, slack: np.ndarray,
    ) -> np.ndarray: ...  # fmt: skip

    def lifted(
        self, springs: Springs, gap: np.ndarray, found: ContactSet, direction: np.ndarray, slip: np.ndarray,
        forces: np.ndarray,
    ) -> np.ndarray: ...  # fmt: skip


class CurvedJoints:
    """The contacts of a step whose laws, of those in ``table``, are curved."""

    def __init__(self, table: JointTable, found: ContactSet) -> None:
        at = np.flatnonzero(table.curved[found.law])
        self.rows, self.law, self.length = at, found.law[at], found.geometry[at, 4]
        self._cohesive = self.length if found.cohesive is None else found.cohesive[at]
        self._wear, self._slip = found.wear[at], found.slip[at]
        self._table = table

    def continued(self) -> bool:
        return False

    def proceeded(self) -> bool:
        return False

    def lines(
        self,
        springs: Springs,
        gap: np.ndarray,
        found: ContactSet,
        state: np.ndarray,
        direction: np.ndarray,
        bonded: np.ndarray,
        normal_force: np.ndarray,
        plastic: np.ndarray,
    ) -> tuple[Springs, np.ndarray]:
        """``springs`` and starting ``gap`` (n,) with the tangents of the laws at ``normal_force`` N and ``plastic``
        slip m.

        ``springs`` and ``gap`` are those of linear laws and include dashpots, which ``found`` does not.
        """
        t, law, length, at = self._table, self.law, self.length, self.rows
        face = length > 0
        n = np.where(state[at] == OPEN, 0.0, np.maximum(normal_force[at], 0.0))
        p = np.where(state[at] == SLIP, plastic[at], 0.0)
        pressure = np.where(face, n / np.where(face, length, 1.0), np.inf)

        friction, sliding, peak, hold, cohesion = self._strength(pressure, p, n, bonded[at])
        undamped, gap0 = found.springs.normal[at], found.gap[at]
        drag = springs.normal[at] - undamped
        normal, offset = self._closure(undamped, n)
        shear = springs.shear[at]
        by_peak = t.stiff_by_peak[law] & face
        if by_peak.any():
            least = np.maximum(pressure, NOTHING * t.jcs[law])
            strength, _, _ = rough_strength(least, t.jrc[law], t.jcs[law], t.residual_angle[law])
            shear = np.where(by_peak, strength * length / t.peak_slip[law], shear)
        lift = np.where(state[at] == SLIP, self._lift(pressure, p, direction[at]), 0.0)

        stiff = normal + drag
        start = (springs.normal[at] * gap[at] + normal * (gap0 + offset) - undamped * gap0) / stiff
        # Slip is motion minus the elastic part of the shear spring; away from the start, slip alone causes dilation.
        out = lift * direction[at] < 0
        share = np.where(out, lift / shear, 0.0)
        start = start + share * (found.shear[at] - direction[at] * sliding)
        # … and on the way back all motion along the edge, including the prescribed part, which is not in the unknowns.
        start = start - np.where(lift * direction[at] > 0, lift * found.stretch[at], 0.0)
        stiff = stiff / (1.0 - stiff * share * direction[at] * friction)

        new = {
            name: getattr(springs, name).copy()
            for name in ("normal", "shear", "friction", "sliding", "peak", "hold", "cohesion", "lift")
        }
        for name, value in (
            ("normal", stiff), ("shear", shear), ("friction", friction), ("sliding", sliding), ("peak", peak),
            ("hold", hold), ("cohesion", cohesion), ("lift", lift),
        ):  # fmt: skip
            new[name][at] = value
        gap = gap.copy()
        gap[at] = start
        return springs._replace(**new), gap

    def _strength(self, pressure, plastic, n, bonded):
        t, law, length = self._table, self.law, self.length
        # Remaining strength at the start of the step for sticking contacts, at its end for sliding ones.
        left, left_sliding = self._left(self._wear, slides=False), self._left(self._wear + np.abs(plastic), slides=True)
        fall = t.friction[law] - t.residual_friction[law]
        peak, friction = t.residual_friction[law] + fall * left, t.residual_friction[law] + fall * left_sliding
        lost = t.cohesion[law] - t.residual_cohesion[law]
        cohesion = (t.residual_cohesion[law] + lost * left) * self._cohesive
        sliding = np.where(bonded == 2, (t.residual_cohesion[law] + lost * left_sliding) * self._cohesive, 0.0)
        hold = np.zeros(len(law))
        rough = (t.jrc[law] > 0) & (length > 0)
        if rough.any():
            finite = np.where(rough, pressure, 0.0)
            for wear, slope, rest in ((self._wear, peak, hold), (self._wear + np.abs(plastic), friction, sliding)):
                strength, tangent, _ = rough_strength(finite, self._roughness(wear), t.jcs[law], t.residual_angle[law])
                slope[rough] = (tangent / t.reduction[law])[rough]
                rest[rough] = ((strength * length - tangent * n) / t.reduction[law])[rough]
        return friction, sliding, peak, hold, cohesion

    def _left(self, wear, slides: bool) -> np.ndarray:
        """Fraction of the difference between peak and residual strength that remains after ``wear``."""
        d = self._table.softening[self.law]
        at_once = np.where((wear > 0) | slides, 0.0, 1.0)
        return np.where(d > 0, np.clip(1.0 - wear / np.where(d > 0, d, 1.0), 0.0, 1.0), at_once)

    def _roughness(self, wear) -> np.ndarray:
        """JRC mobilised after ``wear`` beyond the peak."""
        t, law = self._table, self.law
        return t.jrc[law] * np.interp(1.0 + wear / t.peak_slip[law], _SLIP_OVER_PEAK, _ROUGHNESS_LEFT)

    def _closure(self, stiffness, n) -> tuple[np.ndarray, np.ndarray]:
        """(tangent N/m, offset m) with N = −k_t (g + offset) near the force ``n``: closure n/(k₀ + n/Vm)."""
        limit = self._table.closure[self.law]
        closed = n / (stiffness + n / limit)
        tangent = stiffness / (1.0 - closed / limit) ** 2
        return tangent, closed - n / tangent

    def _lift(self, pressure, plastic, direction) -> np.ndarray:
        """Dilation, m per m of slip along the edge's direction; negative where a contact slides back to its start."""
        t, law = self._table, self.law
        before, after = self._slip, self._slip + plastic
        mean_shear = 0.5 * (before + after)
        side = np.sign(np.where(mean_shear != 0, mean_shear, np.where(plastic != 0, plastic, -direction)))
        reach, slope = t.dilation_slip[law], t.dilation[law]
        moved = plastic != 0
        gained = np.minimum(np.abs(after), reach) - np.minimum(np.abs(before), reach)
        rate = np.where(moved, gained / np.where(moved, plastic, 1.0), side * (np.abs(before) < reach)) * slope
        rough = (t.jrc[law] > 0) & (self.length > 0)
        if rough.any():
            wear = self._wear + 0.5 * np.abs(plastic)
            _, _, angle = rough_strength(
                np.where(rough, pressure, 0.0), self._roughness(wear), t.jcs[law], t.residual_angle[law]
            )
            rate = np.where(rough, side * np.tan(angle), rate)
        return rate

    def misfit(
        self, was: Springs, gap_was: np.ndarray, now: Springs, gap_now: np.ndarray, state, forces: np.ndarray,
        slack: np.ndarray,
    ) -> np.ndarray:  # fmt: skip
        """(n,) N: misfit between the ``forces`` (n, 4) of `check_states`, found with the previous linear laws, and the
        nonlinear laws; 0 within the tolerance. ``slack`` (n,) m: rounding of gaps."""
        out = np.zeros(len(state))
        at = self.rows
        n, s, gap, slide = forces[at].T
        closed, slips = state[at] != OPEN, state[at] == SLIP
        moved = gap - gap_was[at] + was.lift[at] * slide
        pressed = -now.normal[at] * (gap_now[at] + moved - now.lift[at] * slide)
        strength = now.friction[at] * n + now.sliding[at]
        size = _AGREED * np.maximum(np.abs(n), np.abs(s))
        off = np.where(closed, np.abs(pressed - n), 0.0)
        off = np.where(off > np.maximum(size, _ROUNDED * now.normal[at] * slack[at]), off, 0.0)
        off = np.maximum(off, np.where(slips, np.abs(strength - np.abs(s)), 0.0))
        sprung = np.abs(now.shear[at] - was.shear[at]) * np.abs(slide)
        off = np.maximum(off, np.where(closed & ~slips, sprung, 0.0))
        out[at] = np.where(off > size, off, 0.0)
        return out

    def lifted(
        self, springs: Springs, gap: np.ndarray, found: ContactSet, direction: np.ndarray, slip: np.ndarray,
        forces: np.ndarray,
    ) -> np.ndarray:  # fmt: skip
        """(n,) m: dilation in the step by ``slip`` (n,) m, with the ``forces`` (n, 4) of `check_states`."""
        along = forces[:, 3] + found.stretch
        return springs.lift * np.where(springs.lift * direction < 0, slip, along)
