"""Time integration of block motion: Newmark's schemes, the α-scheme, damping, and the state after a step.

All forces, contact forces included, act over a step with the weight θ = 2β at its end and 1 − θ at its start. The
unknown d is the displacement over the step (Newmark 1959, with d = v dt + ā dt²/2 and ā = (1−θ) a₀ + θ a₁):

    2M/dt² d = 2M v/dt + F(t₀ + θ dt) − A σ₀ − θ A (σ₁ − σ₀) − D d/dt + contacts
    v₁ = 2 d/dt − v₀ + κ dt (a₀ − ā),   κ = (θ − γ)/θ,   a₁ = (ā − (1−θ) a₀)/θ

β = ½, γ = 1 is Shi's (1988) scheme; β = ¼, γ = ½ is the trapezoidal rule. For γ = 2β, between the two, no acceleration
is stored, and the energy of a step under constant loads changes by −(θ−½) dᵀK d − dᵀD d/dt exactly (K: all linear
springs and the blocks' own stiffness): it never grows. A contact counts at the start of a step only if it was closed
there, and not at all if its weighted force would be tensile. A contact that closes or opens within a step dissipates
energy besides, after the idea of Kane, Repetto, Ortiz & Marsden (1999) that contact forces must act implicitly.

For 2β > γ the acceleration is stored. The part of it that belongs to a contact which has closed, opened, or is stiffer
than the step resolves is removed (`time_step`). In free flight the stored acceleration still exchanges energy with
vibrations when dt changes; for β > γ − ¼ by more than γ dissipates, so that dropped blocks bounce higher than they fell
from (sixty times as high for β = γ = ½). Such choices are refused.

What γ > ½ dissipates (springs, stress, loads that vary) is integrated to first order in dt. Where blocks rotate, forces
act on the midpoint configuration (`midpoint_configuration`): γ = 2β then follows the rotation to second order, for any
γ; other choices leave the error v̇ = a + (γ − 2β) dt ȧ. The α-scheme has second order and dissipation together.

The α-scheme of Wood, Bossak & Zienkiewicz (1981), (1−α) a₁ + α a₀ = M⁻¹ f₁ with all forces f₁ at the end of the step,
dissipates what the step does not resolve and leaves the rest alone. With the constants of Chung & Hulbert (1993), α =
(ϱ−1)/(ϱ+1), γ = ½−α, β = ¼(1−α)², it is of second order, and every |λ| tends to the spectral radius ϱ as ω dt → ∞. It
is the step above with (ā − c a₀)/w in place of ā and θ = 1, w = 1/(1+ϱ), c = 1−w. Contact forces are part of a₀: a
bounce may gain some energy. Damping forces follow the mean velocity d/dt of the step and dissipate dᵀD d/dt > 0 for any
step; that of a block follows the rate of its stress, and dissipates Δσ·Δε per area.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...compiled import UNCOUNTED, kept, part
from ...conventions import rotate_stress
from ...model import DdaSettings

#: Stiffness over E' of the springs that restrain the rigid motion of a massless block; their force is as small.
GROUND_RATIO = 1e-11


class SchemeTerms(NamedTuple):
    """The coefficients of a `TimeScheme` as kernels take them, for a step of ``dt`` s whose inertia is multiplied by
    ``heavier`` (1/w) in the α-scheme."""

    weight: float
    block_damping: float
    mass_damping: float
    stiffness_damping: float
    dt: float
    heavier: float


class BlockMass(NamedTuple):
    """Mass of blocks at the start of a step: ``density`` (n_blocks,) kg/m³, ``moments`` (n_blocks, 6) of the outline
    (`block_moments`), and which blocks are ``fixed`` (n_blocks,)."""

    density: np.ndarray
    moments: np.ndarray
    fixed: np.ndarray


class BlockStart(NamedTuple):
    """State of blocks at the start of a step: ``velocity`` (n_blocks, 6), m/s and 1/s, ``stress`` (n_blocks, 3), Pa;
    and the ``stiffness`` and ``compliance`` (n_blocks, 3, 3) of the intact blocks, Pa and 1/Pa."""

    velocity: np.ndarray
    stress: np.ndarray
    stiffness: np.ndarray
    compliance: np.ndarray


class CrackTerms(NamedTuple):
    """Mean strain of blocks due to cracks: ``strain`` (n_blocks, 3) at the start of a step, and at its end ``offset`` +
    ``compliance`` σ, (n_blocks, 3) and (n_blocks, 3, 3) 1/Pa; the latter are used only if ``given``."""

    given: bool
    strain: np.ndarray
    compliance: np.ndarray
    offset: np.ndarray

    def without(self, blocks: np.ndarray) -> CrackTerms:
        """The same with no cracks in ``blocks`` (n_blocks,) bool."""
        strain, compliance, offset = self.strain.copy(), self.compliance.copy(), self.offset.copy()
        for of in (strain, compliance, offset):
            of[blocks] = 0.0
        return CrackTerms(self.given, strain, compliance, offset)


class BlockLoads(NamedTuple):
    """Effective ``gravity`` (2,) m/s², and generalised forces ``load`` (n_blocks, 6) of all other loads, N and N m."""

    gravity: np.ndarray
    load: np.ndarray


class Outlines(NamedTuple):
    """Blocks as polygons: ``vertices`` (n_vertices, 2) m, those of block b from ``start[b]`` to before ``start[b +
    1]``, and ``moments`` (n_blocks, 6)."""

    vertices: np.ndarray
    start: np.ndarray
    moments: np.ndarray


@dataclass(frozen=True)
class TimeScheme:
    """Coefficients of a time scheme, in the notation of this module.

    weight             θ = 2β (1 in the α-scheme): weight of the forces at the end of a step
    memory             κ = (2β−γ)/(2β): weight of the acceleration at its start
    end                2β, in the α-scheme too
    alpha, recall      True: the α-scheme, with ``recall`` c
    static             True: no velocity is carried, all forces act at the end
    mass_damping, stiffness_damping   Rayleigh's α, 1/s, and β, s
    block_damping      fraction of critical damping of each block's lowest vibration and of its contacts
    """

    weight: float = 1.0
    memory: float = 0.0
    end: float = 1.0
    recall: float = 0.0
    alpha: bool = False
    static: bool = False
    block_damping: float = 0.0
    mass_damping: float = 0.0
    stiffness_damping: float = 0.0

    @property
    def place(self) -> float:
        """Part of the step (0 to 1) whose configuration the forces act on: 1 in the α-scheme."""
        return 1.0 if self.alpha else 0.5

    @property
    def keeps(self) -> bool:
        """True if the scheme stores an acceleration from step to step."""
        return self.alpha or self.memory != 0.0

    @classmethod
    def of(cls, settings: DdaSettings) -> TimeScheme:
        beta, gamma = settings.newmark
        radius = settings.spectral_radius
        if settings.dynamic_factor == 0.0:
            return cls(static=True)
        if radius is not None:
            alpha = (radius - 1) / (radius + 1)
            beta, gamma = 0.25 * (1 - alpha) ** 2, 0.5 - alpha
        return cls(
            weight=2 * beta if radius is None else 1.0,
            end=2 * beta,
            recall=0.0 if radius is None else radius / (1 + radius),
            alpha=radius is not None,
            memory=(2 * beta - gamma) / (2 * beta),
            block_damping=settings.damping,
            mass_damping=settings.rayleigh_mass,
            stiffness_damping=settings.rayleigh_stiffness,
        )

    def terms(self, dt: float, heavier: float = 1.0) -> SchemeTerms:
        """Coefficients for kernels, for a step of ``dt`` s; ``heavier`` as from `begun`."""
        return SchemeTerms(
            self.weight, self.block_damping, self.mass_damping, self.stiffness_damping, dt, heavier
        )  # fmt: skip

    def overstress(
        self,
        strain: np.ndarray,
        tangent: np.ndarray,
        change: np.ndarray,
        stiffness: np.ndarray,
        mass: np.ndarray,
        dt: float,
    ) -> np.ndarray:
        """(n_blocks, 3) stress that the forces of a step balance, minus the stress at its end, Pa.

        The viscous stress, minus the share of the step's start. ``strain`` (n_blocks, 3) increment; ``change``
        (n_blocks, 3) of stress at zero strain increment, Pa; ``tangent``, ``stiffness`` (n_blocks, 3, 3), Pa; ``mass``
        (n_blocks,), kg/m; ``dt`` s."""
        drag = self.stiffness_damping + 2.0 * self.block_damping * np.sqrt(mass / (12.0 * stiffness[:, 0, 0]))
        by_strain = (tangent @ strain[..., None])[..., 0]
        return ((drag / dt)[:, None] - (1.0 - self.weight)) * (change + by_strain)

    def begun(self, carried: np.ndarray, before: np.ndarray | None, dt: float) -> tuple[np.ndarray, float]:
        """Velocity (n_blocks, 6) at the start of a step, and the factor 1/w on inertia.

        ``carried`` (n_blocks, 6) velocity; ``before`` (n_blocks, 6) stored acceleration, None: a step of Shi's
        scheme."""
        if self.recall == 0.0 or before is None:
            return carried, 1.0
        return carried + 0.5 * self.recall * dt * before, 1.0 / (1.0 - self.recall)

    def ahead(self, before: np.ndarray | None, dt: float) -> float:
        """Time shift (s) of forces that are averaged over ``dt``: the α-scheme averages about the end of the step.

        Arguments as for `begun`."""
        return 0.5 * dt if self.alpha and before is not None else 0.0

    def corrected(
        self, velocity: np.ndarray, before: np.ndarray | None, mean: np.ndarray, turn: np.ndarray, dt: float
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """Velocity with the term κ dt (a₀ − ā), and the acceleration a₁ to store (None: the scheme stores none).

        All (n_blocks, 6). ``before`` a₀ (None: ā); ``mean`` ā on the axes of the start; ``turn`` (n_blocks,) rotation
        in the step, rad; ``velocity`` is on the rotated axes already."""
        if not self.keeps:
            return velocity, None
        before = mean if before is None else before
        change = turned(before - mean, turn)
        return velocity + self.memory * dt * change, turned(mean - (1 - self.end) * before, turn) / self.end


def turned(rates: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Rates (n, 6) of the unknowns with strain rates rotated by ``angle`` (n,) rad, with the material."""
    out = rates.copy()
    half = np.array([1.0, 1.0, 0.5])
    out[:, 3:] = rotate_stress(rates[:, 3:] * half, angle) / half
    return out


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _invert(first, second, out):
    """Write the inverse of the sum of two symmetric positive definite (3, 3) matrices to ``out``, by cofactors."""
    a, b, c = first[0, 0] + second[0, 0], first[0, 1] + second[0, 1], first[0, 2] + second[0, 2]
    d, e, f = first[1, 1] + second[1, 1], first[1, 2] + second[1, 2], first[2, 2] + second[2, 2]
    out[0, 0], out[0, 1], out[0, 2] = d * f - e * e, c * e - b * f, b * e - c * d
    out[1, 1], out[1, 2], out[2, 2] = a * f - c * c, b * c - a * e, a * d - b * b
    out[1, 0], out[2, 0], out[2, 1] = out[0, 1], out[0, 2], out[1, 2]
    determinant = a * out[0, 0] + b * out[0, 1] + c * out[0, 2]
    for k in range(3):
        for m in range(3):
            out[k, m] /= determinant


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _tangent(b, stiffness, compliance, crack_given, crack_compliance, out):
    """(3, 3) (C⁻¹ + S)⁻¹ of block ``b``, into ``out[b]``."""
    soft = False
    if crack_given:
        for k in range(3):
            for m in range(3):
                soft = soft or crack_compliance[b, k, m] != 0.0
    if soft:
        _invert(compliance[b], crack_compliance[b], out[b])
    else:
        # Number by number: Numba takes seconds to compile the assignment of one array to another.
        for k in range(3):
            for m in range(3):
                out[b, k, m] = stiffness[b, k, m]


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _unit_mass(moments, mass):
    """(6, 6) the mass matrix of a block of unit density with these ``moments`` (6,), in the unknowns of a step."""
    area, xx, yy, xy = moments[0], moments[3], moments[4], moments[5]
    for k in range(6):
        for m in range(6):
            mass[k, m] = 0.0
    mass[0, 0] = mass[1, 1] = area
    mass[2, 2] = (xx + yy) / area
    mass[3, 3], mass[4, 4], mass[5, 5] = xx / area, yy / area, 0.25 * (xx + yy) / area
    mass[2, 3] = mass[3, 2] = -xy / area
    mass[2, 4] = mass[4, 2] = xy / area
    mass[2, 5] = mass[5, 2] = 0.5 * (xx - yy) / area
    mass[3, 5] = mass[5, 3] = mass[4, 5] = mass[5, 4] = 0.5 * xy / area


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _rotated(c, s, xx, yy, xy):
    """Components of a symmetric tensor rotated by the angle with cosine ``c`` and sine ``s``."""
    return (
        c * c * xx + s * s * yy - 2 * s * c * xy,
        s * s * xx + c * c * yy + 2 * s * c * xy,
        (s * c * (xx - yy) + (c * c - s * s) * xy),
    )


@kept(fastmath=False, error_model="numpy", nogil=True)
def assemble_blocks(order, n, mass, start, cracks, loads, scheme):
    """The blocks' own equations: (matrix (n, 6, 6), right side (n, 6), tangent (n_blocks, 3, 3), stress0 (n_blocks, 3)).
    ``order`` (n_blocks,) as in `assembly.Pattern`; plain tuples of ``mass`` (`BlockMass`), ``start`` (`BlockStart`), ``cracks``
    (`CrackTerms`), ``loads`` (`BlockLoads`), ``scheme`` (`SchemeTerms`).

    - inertia and elasticity as in this module's equation, with the velocity of the ``start``, the factor ``heavier`` 1/w
      and the ``weight`` θ. The stress is σ₁ = (C⁻¹ + S)⁻¹ (Δε + C⁻¹σ − offset + crack strain), with the added compliance S of
      cracks. For Δε = 0 it is σ, unless cracks have grown or their faces have opened or closed; that change acts over
      the step with weight θ;
    - body force ∫ Tᵀρg, and for the strain unknowns the centrifugal terms ρω²∫xx, ρω²∫yy, ρω²∫xy;
    - generalised forces of all other loads;
    - damping: a viscous stress ∝ Δσ/dt that gives a block's lowest vibration (taken as that of a square, ω² =
      12 C₁₁/(ρ h²)) the fraction ``block_damping`` of critical damping, and Rayleigh damping. Δσ is the change of the
      stress itself: with the tangent times Δε, where crack faces open or close, the force would depend on the side
      from which the step is sought, and there might be no step whose faces agree with its tangent.
    """
    density, moments, _ = mass
    carried, stress, stiffness, compliance = start
    weight, block_damping, mass_damping, stiffness_damping, dt, heavier = scheme
    crack_given, crack_strain, crack_compliance, crack_offset = cracks
    gravity, load = loads
    inertia = 2.0 * heavier / (dt * dt) + mass_damping / dt
    n_blocks = order.shape[0]
    matrix = np.zeros((n, 6, 6))
    right = np.zeros((n, 6))
    tangent = np.empty((n_blocks, 3, 3))
    stress0 = np.empty((n_blocks, 3))
    strain = np.empty(3)
    unit_mass = np.empty((6, 6))
    for b in range(n_blocks):
        _tangent(b, stiffness, compliance, crack_given, crack_compliance, tangent)
        for k in range(3):
            strain[k] = crack_strain[b, k] - crack_offset[b, k] if crack_given else 0.0
            for m in range(3):
                strain[k] += compliance[b, k, m] * stress[b, m]
        for k in range(3):
            stress0[b, k] = 0.0
            for m in range(3):
                stress0[b, k] += tangent[b, k, m] * strain[m]
        row = order[b]
        if row < 0:
            continue
        area, xx, yy, xy = moments[b, 0], moments[b, 3], moments[b, 4], moments[b, 5]
        h = np.sqrt(area)
        rho = density[b]
        _unit_mass(moments[b], unit_mass)
        for k in range(6):
            for m in range(6):
                matrix[row, k, m] = inertia * rho * unit_mass[k, m]
                right[row, k] += 2.0 * heavier * rho * unit_mass[k, m] * (carried[b, m] * (1.0 if m < 2 else h)) / dt
        if rho == 0.0:
            for k in range(3):
                matrix[row, k, k] += GROUND_RATIO * stiffness[b, 0, 0]
        drag = stiffness_damping + 2.0 * block_damping * np.sqrt(rho * area / (12.0 * stiffness[b, 0, 0]))
        elastic = weight + drag / dt
        for k in range(3):
            for m in range(3):
                matrix[row, 3 + k, 3 + m] += elastic * tangent[b, k, m]
            right[row, 3 + k] -= area * ((1.0 - elastic) * stress[b, k] + elastic * stress0[b, k]) / h
        right[row, 0] += rho * area * gravity[0] + load[b, 0]
        right[row, 1] += rho * area * gravity[1] + load[b, 1]
        spin = rho * carried[b, 2] * carried[b, 2]
        right[row, 2] += load[b, 2] / h
        right[row, 3] += (load[b, 3] + spin * xx) / h
        right[row, 4] += (load[b, 4] + spin * yy) / h
        right[row, 5] += (load[b, 5] + spin * xy) / h
    return matrix, right, tangent, stress0


@kept(fastmath=False, error_model="numpy", nogil=True)
def advance(increment, carried, outlines, tangent, stress0, cracks, turns, dt, static):
    """The state after a step from its displacement ``increment`` (n_blocks, 6) about the old centroids and the velocity
    ``carried`` (n_blocks, 6) with which it began; ``outlines`` (`Outlines`), ``cracks`` (`CrackTerms`).

    Vertices follow x' = c + d₀ + R(r)(I + ε)(x − c) with the exact rotation R, so that a spinning block does not swell.
    Stress, strain rates and crack strain are rotated by the same R; before, the stress is ``tangent`` Δε + ``stress0``.
    Velocity is 2d/dt − v, or the mean rate d/dt in a ``static`` step. Where ``turns`` (n_blocks,) is True, the angular
    velocity is corrected so that a block which strains as it spins conserves angular momentum.

    Returns vertices (n_vertices, 2) m, velocity (n_blocks, 6), stress (n_blocks, 3) Pa, crack strain (n_blocks, 3),
    largest vertex displacement m.
    """
    n_blocks = increment.shape[0]
    vertices, vertex_start, moments = outlines
    crack_given, crack_strain, compliance, offset = cracks
    new_vertices = np.empty_like(vertices)
    velocity = np.empty((n_blocks, 6))
    new_stress = np.empty((n_blocks, 3))
    new_crack = np.empty((n_blocks, 3))
    largest = 0.0
    tensor = np.empty(3)
    for b in range(n_blocks):
        r = increment[b, 2]
        c, s = np.cos(r), np.sin(r)
        ex, ey, g = increment[b, 3], increment[b, 4], 0.5 * increment[b, 5]
        # R(I+ε) − I, formed without cancellation: cos r − 1 = −2 sin²(r/2).
        h = np.sin(0.5 * r)
        cm = -2.0 * h * h
        axx, axy = cm + c * ex - s * g, -s + c * g - s * ey
        ayx, ayy = s + s * ex + c * g, cm + s * g + c * ey
        for i in range(vertex_start[b], vertex_start[b + 1]):
            x, y = vertices[i, 0] - moments[b, 1], vertices[i, 1] - moments[b, 2]
            ux = increment[b, 0] + axx * x + axy * y
            uy = increment[b, 1] + ayx * x + ayy * y
            new_vertices[i, 0] = vertices[i, 0] + ux
            new_vertices[i, 1] = vertices[i, 1] + uy
            largest = max(largest, ux * ux + uy * uy)
        for k in range(6):
            if static:
                velocity[b, k] = increment[b, k] / dt
            else:
                velocity[b, k] = 2.0 * increment[b, k] / dt - carried[b, k]
        # Engineering shear rate: halve, rotate, double.
        a, d, e = velocity[b, 3], velocity[b, 4], 0.5 * velocity[b, 5]
        spin, xx, yy, xy = velocity[b, 2], moments[b, 3], moments[b, 4], moments[b, 5]
        momentum = (xx + yy) * spin + xy * (d - a) + (xx - yy) * e
        velocity[b, 3], velocity[b, 4], turned_shear = _rotated(c, s, a, d, e)
        velocity[b, 5] = 2.0 * turned_shear
        if turns[b] and not static:
            # Second moments of the mass, F S Fᵀ with F = R(I + ε).
            fxx, fyy = 1.0 + axx, 1.0 + ayy
            sxx = fxx * fxx * xx + 2.0 * fxx * axy * xy + axy * axy * yy
            syy = ayx * ayx * xx + 2.0 * ayx * fyy * xy + fyy * fyy * yy
            sxy = fxx * ayx * xx + (fxx * fyy + axy * ayx) * xy + axy * fyy * yy
            own = sxy * (velocity[b, 4] - velocity[b, 3]) + 0.5 * (sxx - syy) * velocity[b, 5]
            velocity[b, 2] = (momentum - own) / (sxx + syy)
        for k in range(3):
            tensor[k] = stress0[b, k]
            for m in range(3):
                tensor[k] += tangent[b, k, m] * increment[b, 3 + m]
        a, d, e = tensor[0], tensor[1], tensor[2]
        new_stress[b, 0], new_stress[b, 1], turned_shear = _rotated(c, s, a, d, e)
        new_stress[b, 2] = turned_shear
        for k in range(3):
            if crack_given:
                tensor[k] = offset[b, k] + compliance[b, k, 0] * a + compliance[b, k, 1] * d + compliance[b, k, 2] * e
            else:
                tensor[k] = crack_strain[b, k]
        a, d, e = tensor[0], tensor[1], 0.5 * tensor[2]
        new_crack[b, 0], new_crack[b, 1], turned_shear = _rotated(c, s, a, d, e)
        new_crack[b, 2] = 2.0 * turned_shear
    return new_vertices, velocity, new_stress, new_crack, np.sqrt(largest)
