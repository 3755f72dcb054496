"""The thinnest stable arch, its line of thrust and its hinges, compared with limit analysis and Milankovitch (1907)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from arch import Seen

from geomech.reference.blocks import masonry

INK, STONE, BASE, THRUST, HINGE = "#2f3136", "#d8d2c4", "#a9a9a4", "#1f6f8b", "#c8553d"

#: Bisection to 1e-5 and an elastic shortening of 1e-4 of the thickness; for many voussoirs, relative to Milankovitch's
#: ratio.
THICKNESS_TOLERANCE, MILANKOVITCH_TOLERANCE = 3e-4, 2e-4

LIMITS = """\
Limits of the comparison
  - Joints are radial, at equal angles, and too rough to slide (60°); stone does not crush. Gravity acts on the whole
    arch at once, as when a centring is removed.
  - Hinges form at joints only: an arch of few voussoirs can be thinner than one of many. With an odd number the crown's
    hinge is distributed over the two joints of the keystone.
  - Elastic shortening (E = 100 GPa) lowers the line of thrust by 1e-4 of the thickness and increases the required t/R by
    as much."""


def check(thinnest: dict[int, float], hinges: np.ndarray, n: int) -> None:
    """AssertionError if an arch of ``thinnest`` differs from limit analysis, or one of ``n`` voussoirs collapses with
    other ``hinges`` (degrees from the crown) than five: at the crown, at the joints next to Milankovitch's, and at the
    springings."""
    for number, ratio in thinnest.items():
        exact = masonry.thinnest_arch(number)
        assert abs(ratio / exact - 1) < THICKNESS_TOLERANCE, f"{number} voussoirs: off limit analysis"
    many = thinnest[max(thinnest)]
    assert abs(many - masonry.MILANKOVITCH_RATIO) < MILANKOVITCH_TOLERANCE, "many voussoirs: off Milankovitch"
    apart = 180.0 / n
    haunch = apart * round(masonry.MILANKOVITCH_HINGE_DEG / apart)
    five = [0.0, haunch, haunch, 90.0, 90.0]
    assert np.allclose(np.sort(hinges), five) if len(hinges) == 5 else False, "the arch does not fall by five hinges"


def report(thinnest: dict[int, float], hinges: np.ndarray) -> str:
    """``thinnest``: number of voussoirs → t/R found; ``hinges`` degrees from the crown."""
    rows = ["voussoirs   thinnest t/R   limit analysis   difference"]
    for n, ratio in thinnest.items():
        exact = masonry.thinnest_arch(n)
        rows.append(f"{n:9d} {ratio:14.5f} {exact:16.5f} {ratio / exact - 1:12.1e}")
    rows += [
        "",
        f"limit of many, Milankovitch (1907): {masonry.MILANKOVITCH_RATIO}",
        f"haunches of a thinnest arch hinge at {masonry.MILANKOVITCH_HINGE_DEG}° from the crown (Milankovitch)",
        "the falling arch hinges at " + ", ".join(f"{a:.1f}°" for a in hinges) + " from the crown",
    ]
    return "\n".join([*rows, "", LIMITS])


def hinges(seen: Seen) -> np.ndarray:
    """Joints (indices) that have opened by more than a tenth of the largest opening."""
    return np.flatnonzero(np.abs(seen.opening) > 0.1 * np.abs(seen.opening).max())


def from_crown(joints: np.ndarray, n: int) -> np.ndarray:
    """Degrees from the crown of ``joints`` (indices) of an undeformed arch of ``n`` voussoirs."""
    return np.abs(90.0 - 180.0 * joints / n)


def draw(path: Path, thinnest: dict[int, float], standing: Seen, falling: Seen, titles: tuple[str, str]) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 6.6), layout="constrained")
    upper, lower = figure.subfigures(2, 1, height_ratios=[1.25, 1])
    for axes, seen, title in zip(upper.subplots(1, 2, sharey=True), (standing, falling), titles):
        for outline in (seen.outlines[0], seen.outlines[-1]):
            axes.fill(*outline.T, color=BASE)
        for outline in seen.outlines[1:-1]:
            axes.fill(*outline.T, facecolor=STONE, edgecolor=INK, lw=0.7)
        if seen is standing:
            axes.plot(*seen.thrust.T, color=THRUST, lw=2, label="line of thrust")
        else:
            at = hinges(seen)
            # A joint that opens on the outside rotates about its inner corner.
            corner = seen.joints[at, (seen.opening[at] < 0).astype(int)]
            axes.plot(*corner.T, "o", ms=7, mfc="white", mec=HINGE, mew=2, label="hinge")
        axes.set(aspect="equal", title=title)
        axes.title.set_fontsize(10)
        axes.legend(frameon=False, fontsize=9, loc="lower center")
        axes.axis("off")
    axes = lower.subplots()
    number = np.arange(4, 51)
    axes.axhline(masonry.MILANKOVITCH_RATIO, color=HINGE, lw=1.2)
    axes.text(
        50, masonry.MILANKOVITCH_RATIO + 2e-4, "Milankovitch (1907)", color=HINGE, fontsize=9, ha="right", va="bottom"
    )
    exact = np.array([masonry.thinnest_arch(int(n)) for n in number])
    axes.plot(number, exact, ".-", color="#9a9a94", ms=5, lw=0.8, label="limit analysis of rigid voussoirs")
    axes.plot(*zip(*thinnest.items()), "o", ms=7, mfc="none", mec=THRUST, mew=1.8, label="block solver")
    axes.set(xlabel="voussoirs", ylabel="thinnest arch, $t/R$")
    axes.legend(frameon=False, fontsize=9, loc="lower right")
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=150)
