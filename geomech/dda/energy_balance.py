"""Where the energy of a step goes, and the budget of a run.

Every step solves M ā = (weight, loads, centrifugal force) + contacts − elastic and viscous forces. Multiplied by the
displacement d of the step, this is a balance of works, and each work is a change of what is stored plus what is lost:

    kinetic    d·M ā      = ΔT + (loss of the time scheme; none where d = ½ (v + v′) dt, as in Shi's)
    elastic    A σ̄·Δε     = ΔU + ½ A (σ + σ′)·Δe_c (the strain of cracks) + (θ − ½) A Δσ·Δε
    contact   −N̄ Δn − S̄ Δs = ΔΦ + friction + dashpots + broken bonds + (θ − ½) k Δg² + (θ − ½) ΔS²/kₛ …

with the forces weighed between the step's start and its end (θ; 1 in Shi's scheme, see `newmark`). What the
implicit scheme damps is computed, not inferred, so that the balance closes to round-off within each step. Between two
steps the geometry is updated exactly where the step was linear, and blocks change their area; what stored energy that
changes is the budget's residual, of the order of the strain and of the turn of blocks in a step.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..compiled import kept, part
from ..model import OPEN, SLIP

log = logging.getLogger(__name__)

#: A gain above this part of the energy that has been turned over is reported. Sliding, falling and colliding blocks
#: stay within 3e-4 (most below 1e-5), a specimen strained by half a per cent within 3e-3.
GAIN = 0.01


class StepEnergy(NamedTuple):
    """Energies of one step, J/m. What is stored is that of the step's end, on the geometry on which it was assembled.

    kinetic          T = ½ ∫ρ|u̇|²
    elastic          U = ½ A σ·C⁻¹σ
    contact          Φ of contact springs, normal and shear
    before           T + U + Φ as the step began
    gravity_work     of the weight
    load_work        of edge tractions and point loads, bolts, and what imposes motion
    crack_work       done on the blocks' cracks: stored, rubbed off and released there
    friction         lost in sliding, ≥ 0
    damping          lost in the blocks' viscosity and in contact dashpots, ≥ 0
    bond             released where cohesion or tensile strength has failed
    scheme           lost to the time integration: vibrations it does not resolve, impacts
    carried          lost because only a part of the velocity is carried over (dynamic factor below 1)
    overlap          brought in by contacts that close where blocks already overlap
    residual         of the balance within the step: round-off
    impact           lost in impacts with a coefficient of restitution, across the contact (`impacts`); their friction
                     is in
                     ``friction``
    """

    kinetic: float
    elastic: float
    contact: float
    before: float
    gravity_work: float
    load_work: float
    crack_work: float
    friction: float
    damping: float
    bond: float
    scheme: float
    carried: float
    overlap: float
    residual: float
    impact: float = 0.0

    @property
    def stored(self) -> float:
        """T + U + Φ at the end of the step."""
        return self.kinetic + self.elastic + self.contact


@part(fastmath=False, error_model="numpy", nogil=True)
def _product(first, second, b, c, d, area, xx, yy, xy):
    """∫ u·w of two first-order fields with unknowns ``first[b]`` and ``second[b]``, whose strains c and d stand apart,
    over a block of these moments."""
    p, q = 0.5 * c[2] - first[b, 2], 0.5 * c[2] + first[b, 2]
    r, s = 0.5 * d[2] - second[b, 2], 0.5 * d[2] + second[b, 2]
    # u = (u0 + εx x + p y, v0 + q x + εy y)
    total = area * (first[b, 0] * second[b, 0] + first[b, 1] * second[b, 1])
    total += (c[0] * d[0] + q * s) * xx + (p * r + c[1] * d[1]) * yy
    total += (c[0] * r + p * d[0] + q * d[1] + c[1] * s) * xy
    return total


@part(fastmath=False, error_model="numpy", nogil=True)
def _push(stiffness, gap, limit):
    """Normal force (N) of a contact's spring, straight or of Bandis' hyperbolic closure."""
    return -stiffness * gap / (1.0 + gap / limit)


@part(fastmath=False, error_model="numpy", nogil=True)
def _stored(stiffness, gap, limit, bonded):
    """Energy (J/m) of a contact's normal spring; apart, only a bonded one has any."""
    if gap > 0.0 and bonded == 0:
        return 0.0
    if limit == np.inf:
        return 0.5 * stiffness * gap * gap
    closed = -gap / limit
    return stiffness * limit * limit * (-closed - np.log1p(-closed))


@kept(fastmath=False, error_model="numpy", nogil=True)
def sliding(vectors, unknowns, order, block, other, way=1):
    """(n,) m: motion of every contact along its edge, or across it (``way`` 0), from ``vectors`` (n, 2, 12) and scaled
    ``unknowns`` (n_free, 6)."""
    out = np.zeros(block.shape[0])
    for c in range(out.shape[0]):
        for side in range(2):
            i = order[block[c]] if side == 0 else order[other[c]]
            if i >= 0:
                for a in range(6):
                    out[c] += vectors[c, way, 6 * side + a] * unknowns[i, a]
    return out


@kept(fastmath=False, error_model="numpy", nogil=True)
def step_energies(
    increment,
    old_velocity,
    carried,
    velocity,
    acceleration,
    dt,
    gravity,
    load,
    weight,
    block_damping,
    mass_damping,
    stiffness_damping,
    density,
    moments,
    fixed,
    old_stress,
    tangent,
    stress0,
    compliance,
    stiffness,
    was_state,
    state,
    was_bonded,
    bonded,
    gap0,
    gap,
    arc,
    lifted,
    slip,
    sliding,
    normal_force,
    shear_force0,
    shear_force,
    end_shear,
    normal,
    shear,
    theta,
    law,
    closure,
):
    """The terms of `StepEnergy` in its order but for impacts, (14,).

    Blocks: ``increment``, ``carried``, ``acceleration``, ``load`` (n_blocks, 6) as solved with, ``old_velocity`` and
    ``velocity`` before and after the step, ``old_stress``, ``tangent``, ``stress0`` with σ′ = tangent Δε + stress0;
    ``weight`` θ and dampings of the time scheme. Contacts (n,): states and bonds before and after, gaps from where the
    faces meet, ``arc``, ``lifted``, ``slip`` and motion along the edge (``sliding``) in the step (m); forces that acted
    over the step, and shear forces at its two ends (N); ``normal`` N/m, the spring without dashpot, and ``shear``, that
    of the step (``theta`` times the spring), 0 where a multiplier holds and nothing is stored; ``closure`` (n_laws,) m.
    """
    kinetic = elastic = contact = before = fallen = loads = cracks = 0.0
    friction = viscous = bond = scheme = lost = overlap = 0.0
    now = np.empty(3)
    rate = np.empty(3)
    for b in range(increment.shape[0]):
        area = moments[b, 0]
        u0 = u1 = cracked = mean = quadratic = 0.0
        for k in range(3):
            now[k] = stress0[b, k]
            for m in range(3):
                now[k] += tangent[b, k, m] * increment[b, 3 + m]
                quadratic += increment[b, 3 + k] * tangent[b, k, m] * increment[b, 3 + m]
            mean += ((1.0 - weight) * old_stress[b, k] + weight * stress0[b, k]) * increment[b, 3 + k]
        mean += weight * quadratic
        for k in range(3):
            opened = increment[b, 3 + k]
            for m in range(3):
                u0 += 0.5 * old_stress[b, k] * compliance[b, k, m] * old_stress[b, m]
                u1 += 0.5 * now[k] * compliance[b, k, m] * now[m]
                opened -= compliance[b, k, m] * (now[m] - old_stress[b, m])
            cracked += 0.5 * (old_stress[b, k] + now[k]) * opened
        elastic += area * u1
        before += area * u0
        # A fixed block may be made to move: what drives it works.
        for k in range(6):
            loads += load[b, k] * increment[b, k]
        if fixed[b]:
            continue
        scheme += area * (mean - (u1 - u0) - cracked)
        cracks += area * cracked
        # The new velocity is on turned axes: turned back, it is compared on the step's own.
        c, s = np.cos(increment[b, 2]), np.sin(increment[b, 2])
        ex, ey, g = velocity[b, 3], velocity[b, 4], 0.5 * velocity[b, 5]
        rate[0] = c * c * ex + s * s * ey + 2 * s * c * g
        rate[1] = s * s * ex + c * c * ey - 2 * s * c * g
        rate[2] = 2.0 * ((c * c - s * s) * g - s * c * (ex - ey))
        xx, yy, xy, rho = moments[b, 3], moments[b, 4], moments[b, 5], density[b]
        had = (
            0.5
            * rho
            * _product(old_velocity, old_velocity, b, old_velocity[b, 3:], old_velocity[b, 3:], area, xx, yy, xy)
        )
        kept = 0.5 * rho * _product(carried, carried, b, carried[b, 3:], carried[b, 3:], area, xx, yy, xy)
        work = rho * _product(increment, acceleration, b, increment[b, 3:], acceleration[b, 3:], area, xx, yy, xy)
        moved = rho * _product(increment, increment, b, increment[b, 3:], increment[b, 3:], area, xx, yy, xy)
        # The second moments of the mass as the step ends, (I + ε) S (I + ε): rotation goes on on the strained block.
        fx, fy, h = 1.0 + increment[b, 3], 1.0 + increment[b, 4], 0.5 * increment[b, 5]
        xx1 = fx * fx * xx + 2.0 * fx * h * xy + h * h * yy
        yy1 = h * h * xx + 2.0 * h * fy * xy + fy * fy * yy
        xy1 = fx * h * xx + (fx * fy + h * h) * xy + h * fy * yy
        after = 0.5 * rho * _product(velocity, velocity, b, rate, rate, area, xx1, yy1, xy1)
        # What centrifugal force does on the strains it takes from the rotation.
        spin = (
            rho * carried[b, 2] * carried[b, 2] * (xx * increment[b, 3] + yy * increment[b, 4] + xy * increment[b, 5])
        )
        kinetic += after
        before += had
        lost += had - kept
        scheme += work - spin - (after - kept)
        fallen += density[b] * area * (gravity[0] * increment[b, 0] + gravity[1] * increment[b, 1])
        viscous += mass_damping / dt * moved
        drag = stiffness_damping + 2.0 * block_damping * np.sqrt(density[b] * area / (12.0 * stiffness[b, 0, 0]))
        viscous += drag / dt * area * quadratic
    for i in range(state.shape[0]):
        kn, g0, g1, limit = normal[i], gap0[i], gap[i], closure[law[i]]
        give = theta[i] / shear[i] if shear[i] > 0.0 else 0.0
        phi0 = phi1 = given = rubbed = drag = done = 0.0
        if was_state[i] != OPEN:
            phi0 = _stored(kn, g0, limit, was_bonded[i]) + 0.5 * give * shear_force0[i] * shear_force0[i]
        before += phi0
        if state[i] != OPEN:
            pushed, sheared = normal_force[i], shear_force[i]
            if was_state[i] == OPEN and g0 < 0.0:
                given = _stored(kn, g0, limit, 0)
            phi1 = _stored(kn, g1, limit, bonded[i]) + 0.5 * give * end_shear[i] * end_shear[i]
            # Forces act along the straight motion: what the arc takes from it or adds is the scheme's.
            done = pushed * (g1 - g0 - arc[i] + lifted[i]) + sheared * sliding[i]
            if state[i] == SLIP:
                rubbed = -sheared * (slip[i] if give > 0.0 else sliding[i]) - pushed * lifted[i]
            if kn > 0.0:
                start = g0 if was_state[i] != OPEN and was_bonded[i] > 0 else min(g0, 0.0)
                spring = -theta[i] * _push(kn, g1, limit) - (1.0 - theta[i]) * _push(kn, start, limit)
                drag = -(pushed + spring) * (g1 - g0)
        rest = given - done - (phi1 - phi0) - rubbed - drag
        contact += phi1
        overlap += given
        friction += rubbed
        viscous += drag
        if was_bonded[i] and not bonded[i]:
            bond += rest
        else:
            scheme += rest
    out = np.empty(14)
    out[0], out[1], out[2], out[3] = kinetic, elastic, contact, before
    out[4], out[5], out[6] = fallen, loads, cracks
    out[7], out[8], out[9], out[10], out[11], out[12] = friction, viscous, bond, scheme, lost, overlap
    out[13] = kinetic + elastic + contact - before
    out[13] -= fallen + loads + overlap - cracks - friction - viscous - bond - scheme - lost
    return out


@dataclass(frozen=True)
class EnergyBudget:
    """Energies of a run, J/m: what its steps did, added up. ``budget = budget.after(result.energy,
    result.state.time)``.

    work       weight and loads
    losses     friction, damping, bonds, impacts, time scheme, carried velocity, cracks
    overlap    brought in by blocks that overlapped, and of that ``drawn`` in the first step, as blocks were drawn
    start      stored as the first step began
    stored     stored now
    split      stored energy that has changed because blocks were cut or dug out (`cut`)
    released   of the time scheme's losses, what was less than none while cracks grew at one load: set free by growth
    residual   stored + losses − work − overlap − split − start: what updating the geometry between steps has added (>
               0) or taken away, and round-off
    """

    steps: int = 0
    last: StepEnergy | None = None
    start: float = 0.0
    totals: np.ndarray = field(default_factory=lambda: np.zeros(len(StepEnergy._fields)))
    split: float = 0.0
    residual: float = 0.0
    turnover: float = 0.0
    is_cut: bool = False
    warned: float = GAIN
    drawn: float = 0.0
    released: float = 0.0

    def after(self, step: StepEnergy, time: float = float("nan"), *, growing: bool = False) -> EnergyBudget:
        """The budget with one more step; logs a warning, naming ``time``, when energy has come from nowhere. In a step
        in which cracks are ``growing`` without motion, at one load, it comes from them."""
        first = self.last is None
        totals = self.totals + step
        start = step.before if first else self.start
        jump = 0.0 if first else step.before - self.last.stored
        split = self.split + (jump if self.is_cut else 0.0)
        residual = self.residual + (0.0 if self.is_cut else jump) + step.residual
        work = abs(float(totals[_SUMS["gravity_work"]])) + abs(float(totals[_SUMS["load_work"]]))
        turnover = max(self.turnover, step.stored, step.before, work)
        warned = self.warned
        released = self.released + (max(0.0, -step.scheme) if growing else 0.0)
        # A scheme that loses less than nothing gives.
        gain = residual - min(0.0, float(totals[_SUMS["scheme"]]) + released)
        if gain > warned * turnover:
            log.warning(
                "t = %g s: the blocks have gained %.3g J/m without work, %.2g of all energy turned over: shorten the "
                "time step",
                time, gain, gain / turnover,
            )  # fmt: skip
            warned = 2.0 * gain / turnover
        drawn = step.overlap if first else self.drawn
        return EnergyBudget(
            self.steps + 1, step, start, totals, split, residual, turnover, False, warned, drawn, released
        )

    def cut(self) -> EnergyBudget:
        """The same as the next step finds blocks cut or dug out: what that changes is no residual."""
        return EnergyBudget(
            self.steps, self.last, self.start, self.totals, self.split, self.residual, self.turnover,
            self.last is not None, self.warned, self.drawn, self.released,
        )  # fmt: skip

    def __getattr__(self, name: str) -> float:
        # The sums go by the names of `StepEnergy`; what is stored is no sum.
        if name in _SUMS:
            return float(self.totals[_SUMS[name]])
        raise AttributeError(name)

    @property
    def work(self) -> float:
        return self.gravity_work + self.load_work

    @property
    def by_overlap(self) -> float:
        """What overlaps have brought in that were not drawn, as a part of all energy turned over."""
        brought = self.overlap - self.drawn
        return brought / self.turnover if brought > 0.0 else 0.0

    @property
    def losses(self) -> float:
        return float(self.totals[_LOSSES].sum())

    def left_over(self, at_cracks: float = 0.0, more_work: float = 0.0) -> float:
        """The residual as a part of all energy turned over; ``at_cracks`` J/m of the work on them are not accounted for
        there, ``more_work`` has been done on them by weight and loads than the blocks know."""
        turnover = max(self.turnover, abs(self.work + more_work))
        return (self.residual - at_cracks) / turnover if turnover else 0.0

    def statistics(self) -> dict[str, float]:
        """The columns of a history, J/m."""
        sums = self.totals.tolist()
        out = {column: sums[_SUMS[name]] for column, name in _COLUMNS.items()}
        out["split_energy"] = self.split
        out["energy_residual"] = self.residual
        out["growth_release"] = self.released
        return out


#: Sums of a run: where they stand in `StepEnergy`; and the columns of a history that they make.
_SUMS = {name: at for at, name in enumerate(StepEnergy._fields) if at >= StepEnergy._fields.index("gravity_work")}
del _SUMS["residual"]
_COLUMNS = {
    "gravity_work": "gravity_work",
    "load_work": "load_work",
    "crack_work": "crack_work",
    "friction_loss": "friction",
    "damping_loss": "damping",
    "bond_loss": "bond",
    "impact_loss": "impact",
    "scheme_loss": "scheme",
    "carried_loss": "carried",
    "overlap_energy": "overlap",
}
_LOSSES = [_SUMS[name] for name in ("crack_work", "friction", "damping", "bond", "impact", "scheme", "carried")]
