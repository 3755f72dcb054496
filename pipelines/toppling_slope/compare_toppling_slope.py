"""The slope at its limit, compared with the published table, and its failure with less friction."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geomech.reference.slopes import toppling_slope as published

# Three steps of lightness, so that they also differ in grey.
COLOURS = {"slides": "#f2d16b", "topples": "#a63c28", "stands": "#8aa4a0"}
INK, BASE = "#2f3136", "#e6e3dc"

#: Of tan φ: elastic columns, E = 100 GPa, need 0.0011 more than rigid ones; bisection to 2e-4, and creep after 2.5 s.
LIMIT_TOLERANCE = 2.5e-3
#: Coulomb friction does not determine the forces uniquely: with strength reduced step by step, the slope fails some
#: thousandths earlier.
SAFETY_TOLERANCE = 8e-3
#: kN, of 4837 and more. Found: 11, and 15 from an equilibrium found in another way; the lean of the blocks has a
#: similar effect.
FORCE_TOLERANCE = 25

LIMITS = """\
Limits of the comparison
  - The published calculation is limit equilibrium of rigid blocks. Elastic columns lean by their deformation, which
    requires a little more friction: tan φ = 0.790, 0.787, 0.785 for E = 10, 100 and 1000 GPa.
  - Forces are those a quarter of a per cent below the limit, 1.5 s after the friction was reduced: blocks creep, and all
    blocks that must slide do so. Above the limit friction does not determine the forces, which depend on how the slope came
    to rest (by 100 kN and more).
  - The printed heights step down by 6 m above the crest (5 m at the tops and 1 m at the bases), though 5.2 m is printed
    for the tops; weights and forces of the table correspond to 5 m."""


def check(
    limit: float, table: tuple[np.ndarray, np.ndarray, np.ndarray], modes: list[str], safety: tuple[float, float]
) -> None:
    """AssertionError if the published example is missed by more than its tolerance; arguments as for `report`."""
    assert abs(limit - published.LIMIT_FRICTION) < LIMIT_TOLERANCE, "the least friction is not the published one"
    friction, factor = safety
    assert abs(factor * published.LIMIT_FRICTION / friction - 1) < SAFETY_TOLERANCE, (
        "the factor of safety is not that of the published limit"
    )
    for got, known in zip(table, expected(), strict=True):
        assert np.abs(got - known).max() < FORCE_TOLERANCE, "a force is not the published one"
    done = np.array(["", *modes])
    for what, numbers in (
        ("slides", published.SLIDING), ("topples", published.TOPPLING), ("stands", published.STANDING),
    ):  # fmt: skip
        assert set(done[numbers]) == {what}, f"not every block that {what} by the published table does"


def report(
    limit: float,
    table: tuple[np.ndarray, np.ndarray, np.ndarray],
    friction: float,
    modes: list[str],
    safety: tuple[float, float],
) -> str:
    """``table`` = (R, S, P) of the blocks at the limit, ``modes`` of their motion at ``friction``; ``safety``: tan φ of
    a stable slope, and its factor of safety."""
    normal, shear, push = table
    rows = [
        f"least friction that holds the slope: tan φ = {limit:.4f}",
        f"published {published.LIMIT_FRICTION}; limit equilibrium, repeated here: {published.limit_friction():.4f}",
        f"factor of safety at tan φ = {safety[0]:g} by strength reduction: {safety[1]:.3f} "
        + f"(over the published limit: {safety[0] / published.LIMIT_FRICTION:.3f})",
        "",
        "block   height      R published        S published        P published    at tan φ = " + f"{friction:g}",
        "            m      kN        kN       kN        kN       kN        kN",
    ]
    for n in range(16, 0, -1):
        k = n - 1
        rows.append(
            f"{n:5d} {published.HEIGHTS[k]:8.0f} {normal[k]:8.1f} {published.PUBLISHED_R[k]:8.1f} {shear[k]:9.1f} "
            f"{published.PUBLISHED_S[k]:8.1f} {push[k]:9.1f} {published.PUBLISHED_P[k]:8.1f}   {modes[k]}"
        )
    worst = max(np.abs(a - b).max() for a, b in zip(table, expected()))
    rows += [
        "",
        f"largest difference of a force: {worst:.1f} kN of {published.PUBLISHED_R.max():.0f} kN",
        "R, S: normal and shear force on the base; P: push of the block above",
    ]
    return "\n".join([*rows, "", LIMITS])


def expected() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return published.PUBLISHED_R, published.PUBLISHED_S, published.PUBLISHED_P


def draw(
    path: Path,
    table: tuple[np.ndarray, np.ndarray, np.ndarray],
    rest: list[np.ndarray],
    fallen: list[np.ndarray],
    modes: list[str],
    title: str,
) -> None:
    """``rest`` and ``fallen``: outlines of the base and the blocks before and after, in that order."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    figure = Figure(figsize=(11, 7.4), layout="constrained")
    grid = figure.add_gridspec(2, 3, height_ratios=[1.55, 1])
    slope = figure.add_subplot(grid[0, :])
    ground = rest[0].copy()
    ground[:2, 1] -= 300.0  # its lower corners, out of the picture
    slope.fill(*ground.T, color=BASE, zorder=0)
    for outline in rest[1:]:
        slope.fill(*outline.T, fill=False, edgecolor="#9a9a94", lw=0.8, ls=(0, (3, 2)), zorder=1)
    for n, outline in enumerate(fallen[1:]):
        slope.fill(*outline.T, facecolor=COLOURS[modes[n]], edgecolor=INK, lw=0.8, zorder=2)
        slope.text(
            *outline.mean(axis=0),
            str(n + 1),
            ha="center",
            va="center",
            fontsize=7.5,
            zorder=3,
            color="white" if modes[n] == "topples" else INK,
        )
    slope.set_aspect("equal")
    corners = np.concatenate([*rest[1:], *fallen[1:]])
    (left, low), (right, high) = corners.min(axis=0), corners.max(axis=0)
    slope.set(xlim=(left - 22, right + 22), ylim=(low - 8, high + 5), xlabel="m")
    slope.set_title(title, fontsize=10, loc="left")
    shown = [name for name in COLOURS if name in modes]
    handles = [Patch(color=COLOURS[name], label=name) for name in shown]
    handles.append(Patch(fill=False, edgecolor="#9a9a94", ls="--", label="at rest"))
    slope.legend(handles=handles, frameon=False, fontsize=9, loc="upper left")
    slope.spines[["top", "right", "left"]].set_visible(False)
    slope.yaxis.set_visible(False)
    blocks = np.arange(1, 17)
    names = ("normal force on the base, $R$", "shear force on the base, $S$", "push of the block above, $P$")
    for axes, name, got, table_row in zip((figure.add_subplot(grid[1, k]) for k in range(3)), names, table, expected()):
        axes.plot(blocks, table_row / 1e3, "o", ms=6.5, mfc="white", mec=INK, label="Goodman & Bray (1976)")
        axes.plot(blocks, got / 1e3, "-", color="#1f6f8b", lw=1.8, marker=".", ms=5, label="computed")
        axes.set_title(name, fontsize=9)
        axes.set(xlabel="block", xticks=(1, 4, 7, 10, 13, 16), ylim=(0, None))
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=8)
    figure.axes[1].set_ylabel("MN per metre")
    figure.axes[1].legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=150)
