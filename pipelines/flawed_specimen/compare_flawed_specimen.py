"""Effect of many flaws on a specimen, compared with a closed form and with experiments."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from specimen import FLAW, FRICTION_DEG, HEIGHT, K_IC, WIDTH, Course

LENGTH = math.sqrt(math.pi * 0.5 * FLAW)
#: The finite width of a specimen, six flaws, lowers the first load of one flaw by 1 to 2 %; wings are assessed on the
#: discretised flaw.
FIRST_TOLERANCE = 0.04

LIMITS = """\
Limits of the comparison
  - Plane strain, flaws through the thickness, greased platens. The rock has a toughness but no other strength, so that the
    load of specimens without coalescence rises without limit. Only wing cracks grow (maximum tangential stress); shear
    cracks between flaws, which experiments also show, are not modelled, and loads are therefore higher.
  - Loads are in units of K_Ic / √(πa), with a half the length of a flaw.
  - Wong, Chau, Tang & Lin (2001, Int. J. Rock Mech. Min. Sci. 38, 909) compressed rock-like specimens with three parallel
    frictional flaws and found that strength depends not on the number of flaws but on the number of those that coalesce.
    Here strength falls with the number of flaws, by more than its scatter among specimens with the same number; two or
    three flaws have coalesced once the peak has passed."""


def ashby_hallam(friction_deg: float) -> float:
    """σ √(πa)/K_Ic at which wings start from a closed flaw at its worst angle under uniaxial compression, √3 / (√(1 + μ²) − μ)
    (Ashby & Hallam 1986, Acta Metall. 34, 497; as in Ashby & Sammis 1990, Pure Appl. Geophys. 133, 489, eq. 2)."""
    mu = math.tan(math.radians(friction_deg))
    return math.sqrt(3.0) / (math.sqrt(1 + mu * mu) - mu)


def worst_angle(friction_deg: float) -> float:
    """Degrees from the horizontal at which a closed flaw slides first under a vertical load: 45° + φ/2."""
    return 45.0 + 0.5 * friction_deg


def scaled(load: float) -> float:
    """``load``, Pa, in units of K_Ic/√(πa)."""
    return load * LENGTH / K_IC


def check(alone: Course, runs: Mapping[tuple[bool, int], list[Course]]) -> None:
    """AssertionError if the closed form is missed, if a specimen's first wing starts after its peak, or if a specimen
    without a peak is counted."""
    expected = ashby_hallam(FRICTION_DEG)
    assert abs(scaled(alone.first) / expected - 1) < FIRST_TOLERANCE, "one closed flaw starts off Ashby & Hallam's load"
    for (closed, number), courses in runs.items():
        for course in courses:
            assert course.first <= course.peak, f"{number} flaws start to grow beyond the peak"
            assert not course.passed or course.joined or course.load[-1] < course.peak, f"{number} flaws: no peak"
            if closed:
                # Whatever its neighbours, no flaw starts at less than half of that load.
                assert scaled(course.first) > 0.5 * expected, f"{number} closed flaws start too early"


def report(alone: Course, runs: Mapping[tuple[bool, int], list[Course]]) -> str:
    rows = [
        f"one closed flaw at {worst_angle(FRICTION_DEG):.0f}°: wings start at {scaled(alone.first):.3f} K_Ic/√(πa), "
        f"Ashby & Hallam (1986) {ashby_hallam(FRICTION_DEG):.3f}",
        "",
        "flaws            first wing        peak load    flaws that joined   (mean, least to most; K_Ic/√(πa))",
    ]
    for (closed, number), courses in runs.items():
        first, peak = ([scaled(getattr(c, name)) for c in courses] for name in ("first", "peak"))
        beyond = sum(not c.passed for c in courses)
        rows.append(
            f"{number:3d} {'closed' if closed else 'open':7s} {np.mean(first):6.2f} ({min(first):.2f} to {max(first):.2f})  "
            f"{np.mean(peak):6.2f} ({min(peak):.2f} to {max(peak):.2f})   {', '.join(str(c.joined) for c in courses)}"
            + (f"   ({beyond} without a peak so far)" if beyond else "")
        )
    return "\n".join([*rows, "", LIMITS])


def draw(path: Path, runs: Mapping[tuple[bool, int], list[Course]]) -> None:
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    figure = Figure(figsize=(3.2 * len(runs) + 1, 6.4), layout="constrained")
    axes = figure.subplots(2, len(runs), squeeze=False)
    for (upper, lower), ((closed, number), courses) in zip(axes.T, runs.items()):
        for course in courses:
            upper.plot(1e3 * course.strain, 1e-6 * course.load, lw=1)
        upper.set(
            title=f"{number} {'closed' if closed else 'open'} flaws", xlabel="axial strain, 10⁻³", ylabel="load, MPa"
        )
        lower.add_patch(
            Rectangle((-500 * WIDTH, -500 * HEIGHT), 1e3 * WIDTH, 1e3 * HEIGHT, facecolor="0.93", edgecolor="0.3")
        )
        for start, end in 1e3 * courses[0].segments:
            lower.plot(*zip(start, end), color="firebrick", lw=1.2, solid_capstyle="round")
        lower.set(aspect="equal", xlim=(-31, 31), ylim=(-61, 61))
        lower.axis("off")
    figure.savefig(path, dpi=120)
