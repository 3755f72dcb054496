"""Results of the borehole, compared with closed forms and an independent solution."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from borehole import ABOVE, FRICTION, GREATER, LESSER, RADIUS, ROCK, WEAK_IN_SHEAR, azimuths, last_network

from geomech.reference.cracks.cracked_hole import factor
from geomech.reference.openings.borehole import breakdown_pressure, breakout_ratio

#: The hoop stress of a polygon of 72 sides has an error of 0.4 %, azimuths one of half a side.
STRESS_TOLERANCE, AZIMUTH_TOLERANCE_DEG = 0.005, 2.5
#: Pressure in the fracture in excess of σ_h: K of grown paths has an error of 1e-3, and the polygon for the wall adds a
#: little.
PRESSURE_TOLERANCE = 0.005


def onset(run: list) -> float:
    """Load factor of the first initiation."""
    return next(step.load_factor for step in run if any(event.kind == "birth" for event in step.events))


def fracture_pressure(length: float) -> float:
    """Pressure, MPa, at which two fractures of ``length`` m along σ_H have K_Ic, with fluid inside, by dislocations."""
    ratio, root = length / RADIUS, math.sqrt(math.pi * length)
    shut = factor(ratio, 2, -np.array([GREATER, LESSER, 0.0])) * root
    per_mpa = factor(ratio, 2, np.zeros(3), 1e6) * root
    return (ROCK.k_ic - shut) / per_mpa


def chips(run: list) -> tuple[float, float]:
    """Width (degrees of the wall) and depth (fraction of the radius) of the first chip; nan without one."""
    cracks = last_network(run)
    own = cracks.crack == 0
    nodes = np.unique(cracks.segments[own])
    mouths = cracks.nodes[nodes[cracks.surface[nodes]]]
    if len(mouths) < 2:
        return math.nan, math.nan
    turn = np.degrees(np.arctan2(mouths[:, 1], mouths[:, 0]))
    return float(np.ptp(turn)), depth(run, 0)


def depth(run: list, crack: int | None = None) -> float:
    """Distance to which cracks, or one of them, extend into the rock, as a fraction of the radius."""
    cracks = last_network(run)
    own = slice(None) if crack is None else cracks.crack == crack
    return float(np.hypot(*cracks.nodes[cracks.segments[own]].reshape(-1, 2).T).max() / RADIUS - 1)


def check(runs: Mapping[str, list]) -> None:
    """AssertionError if a closed form is missed by more than its tolerance."""
    if "breakout" in runs:
        run = runs["breakout"]
        expected = breakout_ratio(GREATER, LESSER, ROCK.cohesion, ROCK.friction_angle)
        assert abs(onset(run) / expected - 1) < STRESS_TOLERANCE, "onset of the breakout is off Kirsch's hoop stress"
        assert np.abs(azimuths(run) - 90).max() < AZIMUTH_TOLERANCE_DEG, "the breakout is off the lesser stress"
    if "shear" in runs:
        run = runs["shear"]
        assert run[-1].events[-1].kind == "arrest", "the shear cracks do not stop"
        assert np.abs(azimuths(run)[:2] - 90).max() < AZIMUTH_TOLERANCE_DEG, (
            "the shear cracks are off the lesser stress"
        )
    if "mud_pressure" in runs:
        run = runs["mud_pressure"]
        expected = breakdown_pressure(GREATER, LESSER, ROCK.tensile_strength) / 1e6
        assert abs(onset(run) / expected - 1) < STRESS_TOLERANCE, "breakdown is off Hubbert & Willis"
        assert np.abs(azimuths(run)).max() < AZIMUTH_TOLERANCE_DEG, "the fracture is not along the greater stress"
        for step in run[3::4]:
            length = float(step.cracks.lengths.sum()) / 2
            allowed = PRESSURE_TOLERANCE * ROCK.k_ic / math.sqrt(math.pi * length) / 1e6
            assert abs(step.load_factor - fracture_pressure(length)) < allowed, (
                "the pressure in the fracture is off that of dislocations"
            )


def report(runs: Mapping[str, list]) -> str:
    """The comparison as text."""
    lines = []
    if "breakout" in runs:
        run = runs["breakout"]
        found = onset(run)
        expected = breakout_ratio(GREATER, LESSER, ROCK.cohesion, ROCK.friction_angle)
        width, deep = chips(run)
        lines += [
            "Breakout, remote stresses rising in proportion",
            (
                f"  onset at {found:.4f} of them; 2c cos φ/(1 − sin φ) over 3σ_H − σ_h: {expected:.4f} "
                f"({100 * (found / expected - 1):+.2f} %)"
            ),
            (
                f"  at {', '.join(f'{a:.1f}°' for a in azimuths(run))} from σ_H (Bell & Gough 1979: 90°, the wall that "
                "faces σ_h)"
            ),
            f"  first chip: {width:.1f}° of the wall, {deep:.3f} radii deep",
            f"  its crack stands at K_Ic down to {min(step.load_factor for step in run):.3f} of the stresses",
        ]
    if "shear" in runs:
        run = runs["shear"]
        drive = [step.tips["k_eq"].max(initial=0.0) / ROCK.k_ic for step in run]
        lines += [
            f"Shear cracks, friction {FRICTION}, K_IIc {WEAK_IN_SHEAR / 1e6} MPa √m, at {ABOVE} of the remote stresses",
            f"  born at {', '.join(f'{a:.1f}°' for a in azimuths(run)[:2])} from σ_H",
            (
                f"  K_eq/K_Ic {drive[1]:.2f} at first, at most {max(drive):.2f}; they stop {depth(run):.3f} radii in "
                "the rock"
            ),
        ]
    if "mud_pressure" in runs:
        run = runs["mud_pressure"]
        found = onset(run)
        expected = breakdown_pressure(GREATER, LESSER, ROCK.tensile_strength) / 1e6
        lines += [
            "Mud pressure rising, remote stresses standing",
            (
                f"  breakdown at {found:.2f} MPa; 3σ_h − σ_H + T (Hubbert & Willis 1957): {expected:.2f} MPa "
                f"({100 * (found / expected - 1):+.2f} %)"
            ),
            f"  at {', '.join(f'{a:.1f}°' for a in azimuths(run))} from σ_H (published: 0°)",
            "  fracture length over radius   pressure, MPa   the same by dislocations    off, %",
        ]
        for step in run[3::4]:
            length = float(step.cracks.lengths.sum()) / 2
            other = fracture_pressure(length)
            off = 100 * (step.load_factor / other - 1)
            lines.append(f"  {length / RADIUS:10.2f} {step.load_factor:23.3f} {other:20.3f} {off:+14.3f}")
    return "\n".join(lines)
