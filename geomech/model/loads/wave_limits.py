"""Largest frequency that a time step, block size and damping transmit within a tolerance per wavelength.

In one period a wave of frequency f keeps the part |λ|^(2π/arg λ) e^(−2πξ) of its amplitude. λ is the eigenvalue of the
time scheme's amplification matrix at Ω = 2πf dt (Hughes 1987, chapter 9, for Newmark's scheme; Wood, Bossak &
Zienkiewicz 1981 for theirs). ξ = π f τ + α/(4πf) is the damping ratio of a stress that lags by τ behind the strain, and
of Rayleigh damping α M. A row of blocks of length h, each with uniform strain, on stiff joints is a row of linear finite
elements with consistent mass: 2 sin²(kh/2) = 3θ²/(6 + θ²) with θ = 2πf h/c, and a wave propagates at θ/(kh) > 1 of its
speed c (Belytschko & Mullen 1978). The scheme changes its period by Ω/arg λ. Springs and dashpots between blocks are not included.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from ..problem import DdaSettings, Problem

#: Scheme with which that of a scene is compared: the trapezoidal rule, which preserves all amplitudes. (The α-scheme of
#: `spectral_radius` preserves them too, but with it contacts of a slope under base motion gained energy.)
SECOND_ORDER = (0.25, 0.5)
#: Lowest frequency examined, as a fraction of 1/dt, and number of frequencies.
_LOWEST, _STEPS = 1e-6, 600


class WaveLimits(NamedTuple):
    """Frequencies, Hz, up to which a wave stays within a tolerance per wavelength: by all effects together, and by the
    time ``scheme``, ``damping`` and block ``size`` alone (infinite without a limit)."""

    all: float
    scheme: float
    damping: float
    size: float


def scheme_eigenvalue(omega_dt: float, newmark: tuple[float, float], spectral_radius: float | None) -> complex:
    """The eigenvalue λ of the oscillating mode in a step of an undamped oscillator with ω dt = ``omega_dt``."""
    (beta, gamma), alpha = newmark, 0.0
    if spectral_radius is not None:
        alpha = (spectral_radius - 1) / (spectral_radius + 1)
        beta, gamma = 0.25 * (1 - alpha) ** 2, 0.5 - alpha
    # (u, v dt, a dt²) at the end, on the left, by those at the start; the last line is (1 − α) a₁ + α a₀ = −ω² u₁.
    left = np.array([[1.0, 0.0, -beta], [0.0, 1.0, -gamma], [omega_dt**2, 0.0, 1.0 - alpha]])
    right = np.array([[1.0, 1.0, 0.5 - beta], [0.0, 1.0, 1.0 - gamma], [0.0, 0.0, -alpha]])
    found = np.linalg.eigvals(np.linalg.solve(left, right))
    # The additional mode of the scheme has a real eigenvalue.
    return complex(max(found, key=lambda value: value.imag))


def wave_limits(
    speed: float, size: float, lag: float, mass_damping: float, time_step: float,
    newmark: tuple[float, float], spectral_radius: float | None, tolerance: float = 0.05,
) -> WaveLimits:  # fmt: skip
    """The limits for waves of ``speed``, m/s, in blocks of ``size``, m, whose stress lags by ``lag``, s;
    ``mass_damping`` is Rayleigh's α, 1/s, ``time_step`` in s, ``newmark`` and ``spectral_radius`` as in `DdaSettings`.
    ``tolerance``: admissible relative loss of amplitude, and error of the speed."""
    frequencies = np.geomspace(_LOWEST, 0.5, _STEPS) / time_step
    kept, slow = np.ones((3, _STEPS)), np.ones((3, _STEPS))
    for k, f in enumerate(frequencies.tolist()):
        value = scheme_eigenvalue(2 * math.pi * f * time_step, newmark, spectral_radius)
        turn = math.atan2(value.imag, value.real)
        if turn <= 0:  # no vibration is left
            kept[0, k] = 0.0
            continue
        kept[0, k] = abs(value) ** (2 * math.pi / turn)
        slow[0, k] = turn / (2 * math.pi * f * time_step)
        kept[1, k] = math.exp(-2 * math.pi * (math.pi * f * lag))
        theta = 2 * math.pi * f * size / speed
        # No wave of more than √12 travels; nor do scheme and blocks, of which one slows waves and the other speeds them up,
        # make up for each other.
        slow[2, k] = 0.5 * theta / math.asin(theta * math.sqrt(1.5 / (6 + theta**2))) if theta**2 < 12 else math.inf
    ways = [kept.prod(axis=0) * np.exp(-mass_damping / (2 * frequencies)), *kept]
    speeds = [slow.prod(axis=0), *slow]
    found = []
    for amplitude, ratio in zip(ways, speeds, strict=True):
        off = (amplitude < 1 - tolerance) | (np.abs(ratio - 1) > tolerance)
        # Rayleigh's α M damps low frequencies: the limit is that of the other effects.
        off &= frequencies > mass_damping
        found.append(float(frequencies[np.argmax(off)]) if off.any() else math.inf)
    return WaveLimits(min(found), *found[1:])


def wave_lines(problem: Problem) -> list[str]:
    """The largest frequency of waves that a ``problem`` with base motion or viscous boundaries transmits, in words;
    empty for other problems."""
    settings, blocks = problem.dda, problem.blocks
    shaken = problem.loads.base is not None or problem.loads.viscous_boundaries
    if not shaken or settings.dynamic_factor < 1.0 or problem.endless is not None:
        return []
    areas, worst = blocks.areas(), None
    for k, rock in enumerate(problem.materials):
        here = ~blocks.fixed & (blocks.material == k)
        if not here.any() or rock.rigid or not rock.density:
            continue
        size = math.sqrt(areas[here].max())
        # Shear waves are slower and therefore shorter.
        speed = math.sqrt(rock.shear_modulus / rock.density)
        limits = _limits_of(settings, speed, size, rock.pressure_wave_speed)
        if worst is None or limits.all < worst[0].all:
            worst = limits, size, _limits_of(replace(settings, newmark=SECOND_ORDER), speed, size,
                                             rock.pressure_wave_speed)  # fmt: skip
    if worst is None:
        return []
    limits, size, other = worst
    parts = [("the time scheme", limits.scheme), ("damping", limits.damping), (f"blocks of {size:.3g} m", limits.size)]
    each = ", ".join(f"{name} alone: {_hertz(limit)}" for name, limit in parts)
    lines = [f"amplitude 5 % lower, or speed 5 % off, per wavelength above {_hertz(limits.all)} ({each})"]
    if settings.spectral_radius is None and other.all > 1.5 * limits.all:
        lines.append(f"with dda.newmark = {list(SECOND_ORDER)}: above {_hertz(other.all)}")
    return lines


def _limits_of(settings: DdaSettings, speed: float, size: float, fastest: float) -> WaveLimits:
    """`wave_limits` of shear waves of ``speed``, m/s, with ``settings``; ``fastest``: speed of P-waves, m/s."""
    # The lag by which a square block's lowest vibration has the fraction `damping` of critical (`assemble_blocks`).
    lag = settings.rayleigh_stiffness + 2.0 * settings.damping * size / (math.sqrt(12.0) * fastest)
    return wave_limits(
        speed, size, lag, settings.rayleigh_mass, settings.time_step, settings.newmark, settings.spectral_radius
    )


def _hertz(frequency: float) -> str:
    return "no limit" if math.isinf(frequency) else f"{frequency:.2g} Hz"
