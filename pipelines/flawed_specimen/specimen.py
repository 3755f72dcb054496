"""Specimens with many random flaws, and one run of each past its peak load, with crack growth controlling the load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import geomech
from geomech.study import run_ended

#: Numbers of flaws of the specimens of each kind, and number of specimens of each.
NUMBERS, SEEDS = (5, 10, 20), (1, 2, 3)
WIDTH, HEIGHT = 0.060, 0.120  # of the specimen, m
FLAW, GAP, EDGE = 0.010, 0.004, 0.008  # length of a flaw, least distance of two of them, and to the sides, m
FRICTION_DEG = 30.0  # of closed flaws
K_IC, YOUNG = 1e6, 17e9  # Pa √m, Pa
#: A specimen has passed its peak when it carries less than this fraction of it, after cracks have coalesced or reached
#: the surface.
PASSED = 0.85
JOINED = {"coalescence", "daylighting", "split"}

HEAD = """title = "{title}"
[materials.rock]
youngs_modulus_pa = {young}
poissons_ratio = 0.2
density_kg_m3 = 2200
k_ic_pa_sqrt_m = {k_ic}
[materials.steel]
youngs_modulus_pa = 200e9
poissons_ratio = 0.3
density_kg_m3 = 7850
[zones.rock]
material = "rock"
[zones.bottom]
material = "steel"
fixed = true
[zones.top]
material = "steel"
guided = "y"
[joints.platens]                       # greased: no friction
edges = ["contact:*"]
friction_angle_deg = 0.0
[joints.default]
friction_angle_deg = 30.0
[cracks.default]
{faces}
[loads]
leading_edge = "load:top"
[[loads.tractions]]
edge = "load:top"
rate_pa_per_s = [0.0, -1e6]
[ddm]
grading_ratio = 0.1                    # K right to 5e-3 with two thirds of the unknowns that 0.3 takes
[growth]
increment_m = {increment}
[run]
stepping = "events"
control = "toughness"
events = ["tips"]
end_time_s = {end}
stop_at = ["split"]
[gauge]
from = [0.0, {bottom}]
to = [0.0, {top}]
zone = "rock"
"""


@dataclass(frozen=True)
class Course:
    """What one specimen did: load, Pa, and axial strain, cycle by cycle; the load at which its first flaw starts to grow
    and the largest, Pa; flaws that have joined others at the end, whether the peak was ``passed``, and the ``segments``
    (n, 2, 2) of all cracks then, m."""

    load: np.ndarray
    strain: np.ndarray
    first: float
    peak: float
    joined: int
    passed: bool
    segments: np.ndarray


def flaws(number: int, seed: int) -> list[np.ndarray]:
    """(2, 2) ends of ``number`` flaws at random places and at 25° to 65° to the horizontal, in either direction."""
    rng, drawn = np.random.default_rng(seed), []
    while len(drawn) < number:
        angle = np.radians(rng.uniform(25, 65)) * rng.choice([-1, 1])
        half = 0.5 * FLAW * np.array([np.cos(angle), np.sin(angle)])
        centre = np.array(
            [
                rng.uniform(-0.5 * WIDTH + EDGE, 0.5 * WIDTH - EDGE),
                rng.uniform(-0.5 * HEIGHT + 0.012, 0.5 * HEIGHT - 0.012),
            ]
        )
        points = np.linspace(centre - half, centre + half, 21)
        if all(np.hypot(*(points[:, None] - other).transpose(2, 0, 1)).min() > GAP for other in drawn):
            drawn.append(points)
    return [points[[0, -1]] for points in drawn]


def scene(ends: Sequence[np.ndarray], closed: bool, increment: float, end: float) -> str:
    """The scene (TOML) of a specimen with flaws between these ``ends``."""
    x, y, steel = 0.5 * WIDTH, 0.5 * HEIGHT, 0.010
    faces = 'aperture = "slot"'
    if closed:
        faces = f'aperture = "closed"\njoint = "flaws"\n[joints.flaws]\nfriction_angle_deg = {FRICTION_DEG}'
    out = [
        HEAD.format(
            title=f"{len(ends)} {'closed' if closed else 'open'} flaws", young=YOUNG, k_ic=K_IC, faces=faces,
            increment=increment, end=end, bottom=-y, top=y,
        )
    ]  # fmt: skip
    for name, box in {
        "rock": (-x, -y, x, y), "bottom": (-x - 0.005, -y - steel, x + 0.005, -y), "top": (-x - 0.005, y, x + 0.005, y + steel)
    }.items():  # fmt: skip
        out.append(f'[[geometry.zones]]\nname = "{name}"\nrectangle = {list(box)}\n')
    for k, points in enumerate(ends):
        out.append(f'[[geometry.cracks]]\nname = "flaw {k + 1}"\npoints = {np.asarray(points).tolist()}\n')
    for name, line in {
        "contact:bottom": [[-x - 0.005, -y], [x + 0.005, -y]], "contact:top": [[-x - 0.005, y], [x + 0.005, y]],
        "load:top": [[-x, y + steel], [x, y + steel]],
    }.items():  # fmt: skip
        out.append(f'[[geometry.edges]]\nname = "{name}"\nline = {line}\n')
    return "\n".join(out)


def course(
    folder: Path, ends: Sequence[np.ndarray], closed: bool, increment: float = 2e-3, end: float = 100.0, most: int = 400
) -> Course:
    """Run the specimen past its peak, or to ``end`` MPa or ``most`` cycles; its scene is written into ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "scene.toml"
    path.write_text(scene(ends, closed, increment, end), encoding="utf-8")
    load, strain, first, event_kinds, joined, passed = [], [], np.nan, set(), set(), False
    for cycle in geomech.cycles(geomech.load_scene(path)):
        load.append(abs(cycle.load))
        strain.append(abs(cycle.strain))
        for event in cycle.events:
            event_kinds.add(event.kind)
            if event.kind == "initiation" and np.isnan(first):
                first = abs(event.load)
            if event.kind == "coalescence":
                joined.update(event.detail.split(" meets "))
        if (event_kinds & JOINED and load[-1] < PASSED * max(load)) or "split" in event_kinds:
            passed = True
            break
        if cycle.number >= most:
            break
    run_ended()
    segments = cycle.cracks.nodes[cycle.cracks.segments]
    return Course(np.array(load), np.array(strain), first, max(load), len(joined), passed, segments)
