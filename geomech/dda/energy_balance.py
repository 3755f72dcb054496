"""Energy balance of a step, and the energy budget of a run.

Every step solves M ā = (weight, loads, centrifugal force) + contacts − elastic and viscous forces. Multiplied by the
displacement d of the step, this is a balance of works. Each work equals a change of stored energy plus a loss:

    kinetic    d·M ā      = ΔT + (loss of the time scheme; none where d = ½ (v + v′) dt, as in Shi's)
    loads      F̄·d        = ½ (F + F′)·d + (θ − ½) ΔF·d (`step_actions`)
    elastic    A σ̄·Δε     = ΔU + ½ A (σ + σ′)·Δe_c (the strain of cracks) + (θ − ½) A Δσ·Δε
    contact   −N̄ Δn − S̄ Δs = ΔΦ + friction + dashpots + crushing + broken bonds + (θ − ½) k Δg² + (θ − ½) ΔS²/kₛ …

Forces are weighted between the start and the end of the step (weight θ at the end; 1 in Shi's scheme, see `newmark`).
The dissipation of the implicit scheme is computed, not inferred, so the balance of each step closes to round-off.
Between two steps the geometry is updated exactly, whereas the step was linear, and the areas of blocks change. The
change of stored energy that this causes is the residual of the budget, of the order of strain and rotation in a step.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..compiled import UNCOUNTED, kept, part
from ..model import OPEN, SLIP
from .kinematics.newmark import BlockMass, SchemeTerms
from .kinematics.tolerances import NOTABLE

log = logging.getLogger(__name__)

#: Energy gain, relative to the energy converted (`EnergyBudget.turnover`), above which a warning is given. Sliding,
#: falling and colliding blocks stay within 3e-4 (most below 1e-5), a specimen strained by half a per cent within 3e-3.
GAIN = NOTABLE


class StepEnergy(NamedTuple):
    """Energies of one step, J/m. Stored energies are those at the end of the step, on the geometry on which it was
    assembled.

    kinetic          T = ½ ∫ρ|u̇|²
    elastic          U = ½ A σ·C⁻¹σ
    contact          Φ of contact springs, normal and shear
    before           T + U + Φ at the start of the step
    gravity_work     work of the weight
    load_work        work of edge tractions, point loads, bolts and prescribed motion
    crack_work       work on the cracks of the blocks: stored, dissipated by friction and released there
    friction         dissipated by sliding, ≥ 0
    damping          dissipated by the viscosity of blocks and in contact dashpots, ≥ 0
    bond             released where cohesion or tensile strength has failed
    scheme           dissipated by the time integration: unresolved vibrations, impacts
    carried          lost because only a part of the velocity is carried over (dynamic factor below 1)
    overlap          created by contacts that close where blocks already overlap
    residual         of the balance within the step: round-off
    impact           dissipated normal to the contact in impacts with a coefficient of restitution (`impacts`); their
                     friction is part of ``friction``
    beyond_mean      work of the loads that the step takes beyond that of their mean, part of ``scheme`` (`step_actions`)
    crushing         dissipated by faces that crush, ≥ 0
    breaking         work that the bonds which break in the step would have done with their forces at its start: when they
                     break within the step is not known
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
    crushing: float = 0.0
    impact: float = 0.0
    beyond_mean: float = 0.0
    breaking: float = 0.0

    @property
    def stored(self) -> float:
        """T + U + Φ at the end of the step."""
        return self.kinetic + self.elastic + self.contact


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _product(first, second, b, c, d, area, xx, yy, xy):
    """∫ u·w over a block with these moments, for two first-order fields with the rigid motions ``first[b]`` and
    ``second[b]`` and the strains c and d."""
    p, q = 0.5 * c[2] - first[b, 2], 0.5 * c[2] + first[b, 2]
    r, s = 0.5 * d[2] - second[b, 2], 0.5 * d[2] + second[b, 2]
    # u = (u0 + εx x + p y, v0 + q x + εy y)
    total = area * (first[b, 0] * second[b, 0] + first[b, 1] * second[b, 1])
    total += (c[0] * d[0] + q * s) * xx + (p * r + c[1] * d[1]) * yy
    total += (c[0] * r + p * d[0] + q * d[1] + c[1] * s) * xy
    return total


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _push(stiffness, gap, limit):
    """Normal force (N) of a contact's spring, linear or with Bandis' hyperbolic closure."""
    return -stiffness * gap / (1.0 + gap / limit)


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _stored(stiffness, gap, limit, bonded):
    """Energy (J/m) of a contact's normal spring; an open contact stores energy only if it is bonded."""
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


class StepMotion(NamedTuple):
    """Blocks in a step, (n_blocks, 6) each, in the unknowns u0, v0, r0, εx, εy, γxy.

    increment        displacement in the step, m
    old_velocity     at the end of the last step
    carried          at the start of this step: ``old_velocity`` times the dynamic factor
    velocity         at the end of the step, on the rotated axes
    acceleration     in the scheme's equation of motion
    load             generalised forces of all loads except weight, N and N m
    """

    increment: np.ndarray
    old_velocity: np.ndarray
    carried: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    load: np.ndarray


class StepStress(NamedTuple):
    """Stresses of blocks in a step: σ = ``old_stress`` (n_blocks, 3) Pa at its start, σ′ = ``tangent`` Δε + ``stress0``
    at its end, and the ``stiffness`` and ``compliance`` (n_blocks, 3, 3) of the intact blocks, Pa and 1/Pa."""

    old_stress: np.ndarray
    tangent: np.ndarray
    stress0: np.ndarray
    compliance: np.ndarray
    stiffness: np.ndarray


class ContactStep(NamedTuple):
    """Contacts (n,) in a step.

    was_state, state      at its start and at its end
    was_bonded, bonded    bond state at its start and at its end
    gap0, gap             at its start and at its end, from where the faces meet, m
    arc, lifted           parts of the change of gap due to rotation of the blocks and to dilation or crushing, m
    crushed               irreversible closure by crushing, ≥ 0, which is also in ``lifted``, m
    slip, sliding         plastic slip, and motion along the edge, m
    normal_force          acting over the step, N
    shear_force0, shear_force, end_shear    at its start, acting over it, and at its end, N
    mean_normal, mean_shear                 in statics the means of those at its start and at its end; in motion those acting
    normal                stiffness without dashpot, N/m
    shear                 stiffness in the step (``theta`` times that of the spring), N/m. Both are 0 for multipliers,
                          which store no energy
    theta                 weight of the end of the step
    law                   joint law
    """

    was_state: np.ndarray
    state: np.ndarray
    was_bonded: np.ndarray
    bonded: np.ndarray
    gap0: np.ndarray
    gap: np.ndarray
    arc: np.ndarray
    lifted: np.ndarray
    crushed: np.ndarray
    slip: np.ndarray
    sliding: np.ndarray
    normal_force: np.ndarray
    shear_force0: np.ndarray
    shear_force: np.ndarray
    end_shear: np.ndarray
    mean_normal: np.ndarray
    mean_shear: np.ndarray
    normal: np.ndarray
    shear: np.ndarray
    theta: np.ndarray
    law: np.ndarray


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _rubbing(shear, normal, mean):
    """Mean shear force (N) of the slip of a contact that ends the step with ``shear`` and ``normal``: its strength grows
    with the normal force, whose ``mean`` is given, also where it began to slip within the step."""
    return shear * max(mean, 0.0) / normal if normal > 0.0 else shear


#: Positions of the terms of `StepEnergy` in the sums of a step.
_KINETIC, _ELASTIC, _CONTACT, _BEFORE, _GRAVITY_WORK, _LOAD_WORK, _CRACK_WORK = range(7)
_FRICTION, _DAMPING, _BOND, _SCHEME, _CARRIED, _OVERLAP, _RESIDUAL, _CRUSHING = range(7, 15)


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _strain_energies(b, strain, stress, weight, now):
    """For block ``b``, per area (J/m³): ½ σ·C⁻¹σ before and after the step, the work on its cracks, σ̄·Δε, and Δσ·Δε.
    ``strain`` (3,) is Δε, ``now`` (3,) work space for σ′."""
    u0 = u1 = cracked = mean = quadratic = changed = 0.0
    for k in range(3):
        now[k] = stress.stress0[b, k]
        for m in range(3):
            now[k] += stress.tangent[b, k, m] * strain[m]
            quadratic += strain[k] * stress.tangent[b, k, m] * strain[m]
        mean += ((1.0 - weight) * stress.old_stress[b, k] + weight * stress.stress0[b, k]) * strain[k]
    mean += weight * quadratic
    for k in range(3):
        changed += (now[k] - stress.old_stress[b, k]) * strain[k]
        opened = strain[k]
        for m in range(3):
            u0 += 0.5 * stress.old_stress[b, k] * stress.compliance[b, k, m] * stress.old_stress[b, m]
            u1 += 0.5 * now[k] * stress.compliance[b, k, m] * now[m]
            opened -= stress.compliance[b, k, m] * (now[m] - stress.old_stress[b, m])
        cracked += 0.5 * (stress.old_stress[b, k] + now[k]) * opened
    return u0, u1, cracked, mean, changed


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _kinetic_energies(b, motion, mass, rate):
    """For block ``b`` (J/m): kinetic energy at the end of the last step, at the start and at the end of this one; the
    work of its inertia on the displacement of the step; and ∫ρ|d|², kg m. ``rate`` (3,): work space for strain rates.
    """
    increment, velocity = motion.increment, motion.velocity
    old, carried, acceleration = motion.old_velocity, motion.carried, motion.acceleration
    area, xx, yy, xy = mass.moments[b, 0], mass.moments[b, 3], mass.moments[b, 4], mass.moments[b, 5]
    rho = mass.density[b]
    # The new velocity is on the rotated axes; it is rotated back to those of the step.
    c, s = np.cos(increment[b, 2]), np.sin(increment[b, 2])
    ex, ey, g = velocity[b, 3], velocity[b, 4], 0.5 * velocity[b, 5]
    rate[0] = c * c * ex + s * s * ey + 2 * s * c * g
    rate[1] = s * s * ex + c * c * ey - 2 * s * c * g
    rate[2] = 2.0 * ((c * c - s * s) * g - s * c * (ex - ey))
    had = 0.5 * rho * _product(old, old, b, old[b, 3:], old[b, 3:], area, xx, yy, xy)
    begun = 0.5 * rho * _product(carried, carried, b, carried[b, 3:], carried[b, 3:], area, xx, yy, xy)
    work = rho * _product(increment, acceleration, b, increment[b, 3:], acceleration[b, 3:], area, xx, yy, xy)
    moved = rho * _product(increment, increment, b, increment[b, 3:], increment[b, 3:], area, xx, yy, xy)
    # Second moments of mass at the end of the step, (I + ε) S (I + ε): the strained block continues to rotate.
    fx, fy, h = 1.0 + increment[b, 3], 1.0 + increment[b, 4], 0.5 * increment[b, 5]
    xx1 = fx * fx * xx + 2.0 * fx * h * xy + h * h * yy
    yy1 = h * h * xx + 2.0 * h * fy * xy + fy * fy * yy
    xy1 = fx * h * xx + (fx * fy + h * h) * xy + h * fy * yy
    after = 0.5 * rho * _product(velocity, velocity, b, rate, rate, area, xx1, yy1, xy1)
    return had, begun, after, work, moved


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _add_blocks(out, motion, stress, mass, scheme, gravity, room):
    """Add the terms of blocks to ``out`` (15,); ``room`` (3,) is work space."""
    increment = motion.increment
    kinetic = elastic = before = fallen = loads = cracks = viscous = scheme_loss = lost = 0.0
    for b in range(increment.shape[0]):
        area, rho, strain = mass.moments[b, 0], mass.density[b], increment[b, 3:]
        u0, u1, cracked, mean, changed = _strain_energies(b, strain, stress, scheme.weight, room)
        elastic += area * u1
        before += area * u0
        # The motion of a fixed block may be prescribed: the forces that drive it do work.
        for k in range(6):
            loads += motion.load[b, k] * increment[b, k]
        if mass.fixed[b]:
            continue
        scheme_loss += area * (mean - (u1 - u0) - cracked)
        cracks += area * cracked
        had, begun, after, work, moved = _kinetic_energies(b, motion, mass, room)
        xx, yy, xy = mass.moments[b, 3], mass.moments[b, 4], mass.moments[b, 5]
        # The work of the centrifugal force on the strains.
        spin = rho * motion.carried[b, 2] * motion.carried[b, 2] * (xx * strain[0] + yy * strain[1] + xy * strain[2])
        kinetic += after
        before += had
        lost += had - begun
        scheme_loss += work - spin - (after - begun)
        fallen += rho * area * (gravity[0] * increment[b, 0] + gravity[1] * increment[b, 1])
        viscous += scheme.mass_damping / scheme.dt * moved
        drag = scheme.stiffness_damping
        drag += 2.0 * scheme.block_damping * np.sqrt(rho * area / (12.0 * stress.stiffness[b, 0, 0]))
        viscous += drag / scheme.dt * area * changed
    out[_KINETIC], out[_ELASTIC], out[_BEFORE] = kinetic, elastic, before
    out[_GRAVITY_WORK], out[_LOAD_WORK], out[_CRACK_WORK] = fallen, loads, cracks
    out[_DAMPING], out[_SCHEME], out[_CARRIED] = viscous, scheme_loss, lost


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _add_contacts(out, contacts, closure):
    """Add the terms of contacts to the sums ``out`` (15,); ``closure`` (n_laws,) m: largest closure of a joint's faces."""
    contact = overlap = friction = bond = crushing = 0.0
    before, viscous, scheme_loss = out[_BEFORE], out[_DAMPING], out[_SCHEME]
    for i in range(contacts.state.shape[0]):
        was, state, theta = contacts.was_state[i], contacts.state[i], contacts.theta[i]
        kn, g0, g1, limit = contacts.normal[i], contacts.gap0[i], contacts.gap[i], closure[contacts.law[i]]
        give = theta / contacts.shear[i] if contacts.shear[i] > 0.0 else 0.0
        lost = contacts.was_bonded[i] > 0 and contacts.bonded[i] == 0
        phi0 = phi1 = given = frictional = drag = done = beyond = plastic = 0.0
        if was != OPEN:
            shear0 = contacts.shear_force0[i]
            phi0 = _stored(kn, g0, limit, contacts.was_bonded[i]) + 0.5 * give * shear0 * shear0
        before += phi0
        if state != OPEN:
            pushed, sheared, end = contacts.normal_force[i], contacts.shear_force[i], contacts.end_shear[i]
            if was == OPEN and g0 < 0.0:
                given = _stored(kn, g0, limit, 0)
            phi1 = _stored(kn, g1, limit, contacts.bonded[i]) + 0.5 * give * end * end
            # Forces act along the straight motion: the difference of the work along the arc belongs to the scheme.
            lifted, slid, crushed = contacts.lifted[i], contacts.sliding[i], contacts.crushed[i]
            across = g1 - g0 - contacts.arc[i] + lifted
            done = pushed * across + sheared * slid
            beyond = (pushed - contacts.mean_normal[i]) * across + (sheared - contacts.mean_shear[i]) * slid
            if state == SLIP:
                rubbing = _rubbing(sheared, pushed, contacts.mean_normal[i])
                frictional = -rubbing * (contacts.slip[i] if give > 0.0 else slid) - contacts.mean_normal[i] * (
                    lifted + crushed
                )
            # Faces crush at their limit only.
            plastic = pushed * crushed
            if kn > 0.0:
                start = g0 if was != OPEN and contacts.was_bonded[i] > 0 else min(g0, 0.0)
                spring = -theta * _push(kn, g1, limit) - (1.0 - theta) * _push(kn, start, limit)
                drag = -(pushed + spring) * (g1 - g0)
        rest = given - done - (phi1 - phi0) - frictional - drag - plastic
        contact += phi1
        overlap += given
        friction += frictional
        crushing += plastic
        viscous += drag
        if lost:
            bond += rest + beyond
            scheme_loss -= beyond
        else:
            scheme_loss += rest
    out[_BEFORE], out[_DAMPING], out[_SCHEME] = before, viscous, scheme_loss
    out[_CONTACT], out[_OVERLAP], out[_FRICTION], out[_BOND] = contact, overlap, friction, bond
    out[_CRUSHING] = crushing


@kept(fastmath=False, error_model="numpy", nogil=True)
def step_energies(motion, stress, mass, scheme, gravity, contacts, closure):
    """The terms of `StepEnergy` in their order, without impacts, (15,) J/m.

    Plain tuples: ``motion``, ``stress`` and ``mass`` of the blocks (`StepMotion`, `StepStress`, `BlockMass`),
    ``scheme`` (`SchemeTerms`), ``gravity`` (2,) m/s², ``contacts`` (`ContactStep`), and ``closure`` (n_laws,) m, the
    largest closure of joints with Bandis' law, inf for others.
    """
    out = np.zeros(15)
    blocks = StepMotion(*motion), StepStress(*stress), BlockMass(*mass), SchemeTerms(*scheme)
    _add_blocks(out, *blocks, gravity, np.empty(3))
    _add_contacts(out, ContactStep(*contacts), closure)
    work = out[_GRAVITY_WORK] + out[_LOAD_WORK] + out[_OVERLAP]
    losses = out[_FRICTION], out[_DAMPING], out[_BOND], out[_SCHEME], out[_CARRIED] + out[_CRUSHING]
    out[_RESIDUAL] = out[_KINETIC] + out[_ELASTIC] + out[_CONTACT] - out[_BEFORE]
    out[_RESIDUAL] -= work - out[_CRACK_WORK] - losses[0] - losses[1] - losses[2] - losses[3] - losses[4]
    return out


@dataclass(frozen=True)
class EnergyBudget:
    """Energies of a run, J/m: sums over its steps. ``budget = budget.after(result.energy, result.state.time)``.

    work       of weight and loads
    losses     friction, damping, bonds, crushing, impacts, time scheme, velocity not carried over, cracks
    overlap    created by overlapping blocks; ``drawn``: the part created in the first step, by overlaps in the drawing
    start      stored at the start of the first step
    stored     stored now
    split      change of stored energy due to splitting or excavation of blocks (`cut`)
    released   energy released by growth at constant load: negative losses of the time scheme while cracks grew, with the
               loads at the end of each step
    residual   stored + losses − work − overlap − split − start: energy added (> 0) or removed by updating the geometry
               between steps, and round-off
    turnover   energy converted: |gravity_work| + |load_work|, or the largest energy stored, whichever is larger
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
        """The budget with one more step; logs a warning with the ``time`` when blocks have gained energy without work.
        In a step in which cracks are ``growing`` at constant load in statics, such energy is released by the cracks."""
        first = self.last is None
        totals = self.totals + step
        start = step.before if first else self.start
        jump = 0.0 if self.last is None else step.before - self.last.stored
        split = self.split + (jump if self.is_cut else 0.0)
        residual = self.residual + (0.0 if self.is_cut else jump) + step.residual
        work = abs(float(totals[_SUMS["gravity_work"]])) + abs(float(totals[_SUMS["load_work"]]))
        turnover = max(self.turnover, step.stored, step.before, work)
        warned = self.warned
        released = self.released + (max(0.0, -step.scheme - step.beyond_mean) if growing else 0.0)
        # A negative loss of the scheme is a gain. Where contacts open or close within a static step, the work of its loads
        # lies between that of their mean and that of the loads at its end.
        gain = residual - min(0.0, float(totals[_SUMS["scheme"]] + totals[_SUMS["beyond_mean"]]) + released)
        if gain > warned * turnover:
            log.warning(
                "t = %g s: the blocks have gained %.3g J/m without work, %.2g of all converted energy: shorten the "
                "time step",
                time, gain, gain / turnover,
            )  # fmt: skip
            warned = 2.0 * gain / turnover
        drawn = step.overlap if first else self.drawn
        return EnergyBudget(
            self.steps + 1, step, start, totals, split, residual, turnover, False, warned, drawn, released
        )

    def at_rest(self, steps: Sequence[StepEnergy], time: float, *, excavated: bool = False) -> EnergyBudget:
        """The budget after the static ``steps`` by which blocks came to equilibrium under the loads of ``time`` s;
        ``excavated``: the first of them was without blocks that had been there before."""
        budget = self.cut() if excavated else self
        for step in steps:
            budget = budget.after(step, time)
        return budget

    def cut(self) -> EnergyBudget:
        """The budget before a step in which blocks are newly split or excavated: the change of stored energy is no
        residual."""
        return EnergyBudget(
            self.steps, self.last, self.start, self.totals, self.split, self.residual, self.turnover,
            self.last is not None, self.warned, self.drawn, self.released,
        )  # fmt: skip

    def __getattr__(self, name: str) -> float:
        # Sums have the names of `StepEnergy`; stored energies are not sums.
        if name in _SUMS:
            return float(self.totals[_SUMS[name]])
        raise AttributeError(name)

    @property
    def work(self) -> float:
        return self.gravity_work + self.load_work

    @property
    def by_overlap(self) -> float:
        """Energy created by overlaps other than drawn ones, relative to the energy converted."""
        brought = self.overlap - self.drawn
        return brought / self.turnover if brought > 0.0 else 0.0

    @property
    def losses(self) -> float:
        return float(self.totals[_LOSSES].sum())

    def left_over(self, at_cracks: float = 0.0, more_work: float = 0.0) -> float:
        """The residual relative to the energy converted. ``at_cracks`` J/m of the work on cracks are not accounted for
        in their own balance; ``more_work`` has been done on them by weight and loads beyond the work on the blocks."""
        turnover = max(self.turnover, abs(self.work + more_work))
        return (self.residual - at_cracks) / turnover if turnover else 0.0

    def statistics(self) -> dict[str, float]:
        """Columns of the history, J/m."""
        sums = self.totals.tolist()
        out = {column: sums[_SUMS[name]] for column, name in _COLUMNS.items()}
        out["split_energy"] = self.split
        out["energy_residual"] = self.residual
        out["growth_release"] = self.released
        return out


#: Sums of a run, with their positions in `StepEnergy`; and the history columns that they give.
_SUMS = {name: at for at, name in enumerate(StepEnergy._fields) if at >= StepEnergy._fields.index("gravity_work")}
del _SUMS["residual"]
_COLUMNS = {
    "gravity_work": "gravity_work",
    "load_work": "load_work",
    "crack_work": "crack_work",
    "friction_loss": "friction",
    "damping_loss": "damping",
    "bond_loss": "bond",
    "crushing_loss": "crushing",
    "impact_loss": "impact",
    "scheme_loss": "scheme",
    "carried_loss": "carried",
    "overlap_energy": "overlap",
}
_LOSSES = [
    _SUMS[name] for name in ("crack_work", "friction", "damping", "bond", "crushing", "impact", "scheme", "carried")
]
