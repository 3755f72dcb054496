"""Random benched slopes, jointed and cracked, as scene files, one per seed."""

from __future__ import annotations

import math

import numpy as np


def scene_text(seed: int) -> str:
    """The scene file of a ``seed``: outline, joint sets whose dead ends are cracks, rock, laws, water, in-situ stress,
    shaking, static or dynamic, fixed steps or events."""
    rng = np.random.default_rng(seed)
    face, width, height = _outline(rng)
    base = [
        (-4.0, -2.0),
        (width + 2, -2.0),
        (width + 2, height),
        (width, height),
        (width, 0.0),
        (0.0, 0.0),
        (-4.0, 0.0),
    ]
    sets = _joint_sets(rng, height)
    dynamic, events = bool(rng.random() < 0.4), bool(rng.random() < 0.3)
    law = [f"friction_angle_deg = {rng.uniform(5, 50):.1f}"]
    if rng.random() < 0.4:
        law += [
            f"cohesion_pa = {10 ** rng.uniform(3, 6):.0f}",
            f"tensile_strength_pa = {10 ** rng.uniform(3, 5.5):.0f}",
        ]
    density = rng.uniform(2000, 3000)
    lines = [
        f'title = "Fuzzed slope {seed}"',
        f"[geometry]\nseed = {seed}\nshortest_crack_m = {rng.uniform(0.2, 1.0):.2f}\nsmallest_block_m2 = 0.2",
        f'[[geometry.zones]]\nname = "base"\npolygon = {_points(base)}',
        f'[[geometry.zones]]\nname = "rock"\npolygon = {_points(face)}',
        *sets,
        "[materials.rock]",
        f"youngs_modulus_pa = {10 ** rng.uniform(9, 11):.3e}\npoissons_ratio = {rng.uniform(0.05, 0.4):.2f}",
        f"density_kg_m3 = {density:.0f}\nk_ic_pa_sqrt_m = {10 ** rng.uniform(4.5, 6.5):.3e}",
        "[zones.base]\nfixed = true",
        "[joints.default]\n" + "\n".join(law),
    ]
    if rng.random() < 0.6:
        lines.append('[cracks.default]\njoint = "default"')
    elif rng.random() < 0.3:
        lines.append('[cracks.default]\naperture = "slot"')
    lines.append("[loads]\ngravity_m_s2 = [0.0, -9.81]")
    if not dynamic:
        lines.append("gravity_ramp_s = 3.0")
    if rng.random() < 0.3:
        level = height * rng.uniform(0.2, 0.9)
        lines.append(f"[loads.water]\npoints = {_points([(0.0, 0.2 * level), (width, level)])}")
    if dynamic and rng.random() < 0.5:
        amplitude, frequency = rng.uniform(0.5, 5), rng.uniform(1, 8)
        lines.append(
            f"[loads.base]\nacceleration_m_s2 = [{amplitude:.2f}, {0.3 * amplitude:.2f}]\nfrequency_hz = "
            f"{frequency:.2f}"
        )
    elif not dynamic and rng.random() < 0.3:
        # The stress is in equilibrium with the weight, which acts from the start.
        lines.remove("gravity_ramp_s = 3.0")
        lines.append(
            f"[loads.in_situ]\nsurface_m = {height}\nunit_weight_n_per_m3 = {9.81 * density:.0f}\nk0 = "
            f"{rng.uniform(0.2, 1.5):.2f}"
        )
    dt = 10 ** rng.uniform(-3, -2) if dynamic else 1.0
    lines.append(f"[dda]\ntime_step_s = {dt:.5f}\ndynamic_factor = {int(dynamic)}\nmax_displacement_ratio = 0.01")
    if rng.random() < 0.2:
        lines.append('contact = "augmented"')
    if dynamic and rng.random() < 0.3:
        lines.append('equilibrium = "start"')
    lines += [
        "[ddm]\norder = 3\nelements_per_crack = 2\nelements_per_side = 2",
        f"[growth]\nincrement_m = {rng.uniform(0.3, 1.0):.2f}\nmax_passes = 4",
        f"[run]\nend_time_s = {(8 * dt if dynamic else 3.0):.5f}\nstop_at = []",
    ]
    if events and not dynamic:
        lines.append('stepping = "events"')
    return "\n".join(lines) + "\n"


def _outline(rng) -> tuple[list[tuple[float, float]], float, float]:
    """The rock, counter-clockwise from its toe, with its width and height."""
    corners, x, y = [], 0.0, 0.0
    for _ in range(int(rng.integers(1, 4))):
        rise = rng.uniform(3, 6)
        x, y = x + rise / math.tan(math.radians(rng.uniform(45, 88))), y + rise
        corners.append((x, y))
        x += rng.uniform(1.5, 4)
        corners.append((x, y))
    corners.pop()
    width = x + rng.uniform(2, 6)
    rounded = [(round(a, 3), round(b, 3)) for a, b in reversed(corners)]
    width, height = round(width, 3), rounded[0][1]
    return [(0.0, 0.0), (width, 0.0), (width, height), *rounded], width, height


def _joint_sets(rng, height: float) -> list[str]:
    found = []
    for k in range(int(rng.integers(1, 4))):
        lines = [
            f'[[geometry.joint_sets]]\nname = "set{k}"\nzones = ["rock"]',
            f"angle_deg = {rng.uniform(-80, 90):.1f}\nangle_deviation_deg = {rng.uniform(0, 8):.1f}",
            f"spacing_m = {height * rng.uniform(0.3, 0.8):.2f}\nspacing_deviation_m = 0.3",
        ]
        if rng.random() < 0.6:
            lines.append(
                f"length_m = {height * rng.uniform(0.3, 1.2):.2f}\ngap_m = {height * rng.uniform(0.05, 0.4):.2f}"
            )
        found.append("\n".join(lines))
    return found


def _points(points) -> str:
    return "[" + ", ".join(f"[{x:.3f}, {y:.3f}]" for x, y in points) + "]"
