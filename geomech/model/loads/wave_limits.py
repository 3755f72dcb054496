"""Up to which frequency a time step, blocks of a size and damping keep a wave within a tolerance per wavelength.

A wave of frequency f loses in a period 1 − |λ|^(2π/arg λ) e^(−2πξ), where λ is the eigenvalue of the time scheme's
amplification matrix at Ω = 2πf dt (Hughes 1987, chapter 9, for Newmark's scheme; Wood, Bossak & Zienkiewicz 1981 for
theirs), and ξ = π f τ + α/(4πf) is that of a stress that lags by τ behind the strain, and of Rayleigh damping α M. In a row
of blocks of length h, each of one strain and a rigid motion, the wave of wave number k runs at sin(kh/2)/(kh/2) of its
speed, and the scheme changes its period by Ω/arg λ. What springs and dashpots between blocks take besides is left out.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from ..problem import DdaSettings, Problem

#: The scheme that is named beside the one that a scene has: the trapezoidal rule, which keeps all amplitudes. (The α-scheme
#: of `spectral_radius` keeps them as well, but contacts of a shaken slope gained energy by it.)
SECOND_ORDER = (0.25, 0.5)
#: Frequencies are sought from this part of 1/dt on, in so many steps.
_LOWEST, _STEPS = 1e-6, 600


class WaveLimits(NamedTuple):
    """Frequencies, Hz, up to which a wave stays within a tolerance per wavelength: by all together, and by the time
    ``scheme``, ``damping`` and block ``size`` alone (infinite where nothing limits it)."""

    all: float
    scheme: float
    damping: float
    size: float


def scheme_eigenvalue(omega_dt: float, newmark: tuple[float, float], spectral_radius: float | None) -> complex:
    """The eigenvalue λ of the vibrating mode in a step of an undamped oscillator with ω dt = ``omega_dt``."""
    (beta, gamma), alpha = newmark, 0.0
    if spectral_radius is not None:
        alpha = (spectral_radius - 1) / (spectral_radius + 1)
        beta, gamma = 0.25 * (1 - alpha) ** 2, 0.5 - alpha
    # (u, v dt, a dt²) at the end, on the left, by those at the start; the last line is (1 − α) a₁ + α a₀ = −ω² u₁.
    left = np.array([[1.0, 0.0, -beta], [0.0, 1.0, -gamma], [omega_dt**2, 0.0, 1.0 - alpha]])
    right = np.array([[1.0, 1.0, 0.5 - beta], [0.0, 1.0, 1.0 - gamma], [0.0, 0.0, -alpha]])
    found = np.linalg.eigvals(np.linalg.solve(left, right))
    # The mode that the scheme adds has a real eigenvalue.
    return complex(max(found, key=lambda value: value.imag))


def wave_limits(
    speed: float, size: float, lag: float, mass_damping: float, time_step: float,
    newmark: tuple[float, float], spectral_radius: float | None, tolerance: float = 0.05,
) -> WaveLimits:  # fmt: skip
    """The limits for waves of ``speed``, m/s, in blocks of ``size``, m, whose stress lags by ``lag``, s; ``mass_damping``
    is Rayleigh's α, 1/s, ``time_step`` in s, ``newmark`` and ``spectral_radius`` as in `DdaSettings`. ``tolerance``: part
    of the amplitude that may be lost, and by which the speed may be off."""
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
        half = math.pi * f * size / speed
        slow[2, k] = math.sin(half) / half if half < math.pi else 0.0
    ways = [kept.prod(axis=0) * np.exp(-mass_damping / (2 * frequencies)), *kept]
    speeds = [slow.prod(axis=0), *slow]
    found = []
    for amplitude, ratio in zip(ways, speeds, strict=True):
        off = (amplitude < 1 - tolerance) | (np.abs(ratio - 1) > tolerance)
        # Rayleigh's α M eats slow waves: the limit is where the others begin to.
        off &= frequencies > mass_damping
        found.append(float(frequencies[np.argmax(off)]) if off.any() else math.inf)
    return WaveLimits(*found)


def wave_lines(problem: Problem) -> list[str]:
    """Up to which frequency waves come through a ``problem`` whose ground moves or whose edges absorb them; none of others."""
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
        # Shear waves are the slower, and so the shorter ones.
        speed = math.sqrt(rock.shear_modulus / rock.density)
        limits = _limits_of(settings, speed, size, rock.pressure_wave_speed)
        if worst is None or limits.all < worst[0].all:
            worst = limits, size, _limits_of(replace(settings, newmark=SECOND_ORDER), speed, size,
                                             rock.pressure_wave_speed)  # fmt: skip
    if worst is None:
        return []
    limits, size, other = worst
    parts = [("the time scheme", limits.scheme), ("damping", limits.damping), (f"blocks of {size:.3g} m", limits.size)]
    each = ", ".join(f"{name} alone {_hertz(limit)}" for name, limit in parts)
    lines = [f"lose 5 % and run 5 % off in a wavelength from {_hertz(limits.all)} on ({each})"]
    if settings.spectral_radius is None and other.all > 1.5 * limits.all:
        lines.append(f"dda.newmark = {list(SECOND_ORDER)} in its place: from {_hertz(other.all)} on")
    return lines


def _limits_of(settings: DdaSettings, speed: float, size: float, fastest: float) -> WaveLimits:
    """`wave_limits` of shear waves of ``speed``, m/s, with ``settings``; ``fastest``: speed of P-waves, m/s."""
    # The lag by which a square block's lowest vibration has the fraction `damping` of critical (`assemble_blocks`).
    lag = settings.rayleigh_stiffness + 2.0 * settings.damping * size / (math.sqrt(12.0) * fastest)
    return wave_limits(
        speed, size, lag, settings.rayleigh_mass, settings.time_step, settings.newmark, settings.spectral_radius
    )


def _hertz(frequency: float) -> str:
    return "never" if math.isinf(frequency) else f"{frequency:.2g} Hz"
