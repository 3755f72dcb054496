"""The map of sliding and toppling, compared with the boundaries by statics and dynamics."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geomech.reference.blocks.block_on_incline import MODES, failure_mode, toe_holds_above

COLOURS = dict(zip(MODES, ("#8aa4a0", "#d9a441", "#c8553d", "#8d6a9f")))

#: The threshold of motion, 2e-4 g, and elastic compliance: 0.01° each.
BOUNDARY_TOLERANCE_DEG = 0.02

LIMITS = """\
Limits of the comparison
  - One column on a rough incline, released from rest; its later motion down the incline is not considered.
  - The boundary between toppling and toppling with sliding is dynamic: the toe of a column that starts to rotate carries
    less shear than that of one at rest (Bray & Goodman 1981; Sagaseta 1986). Ashby (1971) drew it at φ = α."""


def expected(kind: str, angle: float, incline: float) -> float:
    """The boundary ``kind`` at ``angle`` (rad)."""
    if kind == "slides":
        return toe_holds_above(angle, incline) if angle < incline else incline
    return angle if kind == "slides and topples" else incline


def check(incline: float, grid: list[tuple[float, float, str]], found: dict[str, np.ndarray]) -> None:
    """AssertionError if the motion of a column of the ``grid`` (δ, φ, mode) differs from the map, or a boundary is off."""
    for slenderness, friction, mode in grid:
        assert mode == failure_mode(slenderness, friction, incline), (
            f"δ = {np.degrees(slenderness):.1f}°, φ = {np.degrees(friction):.1f}°: {mode}"
        )
    assert {mode for *_, mode in grid} == set(MODES), "not every mode was met"
    assert np.degrees(worst(incline, found)) < BOUNDARY_TOLERANCE_DEG, "a boundary of the map is off"


def report(incline: float, found: dict[str, np.ndarray]) -> str:
    """``found``: kind → (n, 2) rad, the angle at which a boundary was searched for and its location."""
    rows = ["boundary                at        found     should be       off   (degrees)"]
    for kind, table in found.items():
        for at, where in np.degrees(table):
            exact = np.degrees(expected(kind, np.radians(at), incline))
            rows.append(
                f"{kind:<20} {'φ' if kind == 'topples' else 'δ'} = {at:4.1f} {where:10.4f} {exact:12.4f} {where - exact:+10.4f}"
            )
    return "\n".join([*rows, "", f"largest difference {np.degrees(worst(incline, found)):.4f}°", "", LIMITS])


def worst(incline: float, found: dict[str, np.ndarray]) -> float:
    return max(abs(where - expected(kind, at, incline)) for kind, table in found.items() for at, where in table)


def draw(path: Path, incline: float, grid: list[tuple[float, float, str]], found: dict[str, np.ndarray]) -> None:
    """``grid``: (δ, φ, mode) of columns that were released."""
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.6, 6.6), layout="constrained")
    axes = figure.subplots()
    fine = np.linspace(0.1, 60, 400)
    expected_mode = np.array(
        [[MODES.index(failure_mode(np.radians(d), np.radians(f), incline)) for d in fine] for f in fine]
    )
    axes.pcolormesh(
        fine, fine, expected_mode, cmap=ListedColormap([COLOURS[m] for m in MODES]), vmin=-0.5, vmax=3.5, alpha=0.28,
        linewidth=0, rasterized=True,
    )  # fmt: skip
    for name, mark in zip(MODES, "os^P", strict=True):  # told apart in a grey print too
        own = np.array([(d, f) for d, f, what in grid if what == name])
        axes.plot(*np.degrees(own).T, mark, ms=4.5, color=COLOURS[name], mec="#2f3136", mew=0.4, label=name)
    along = np.vstack([table[:, ::-1] if kind == "topples" else table for kind, table in found.items()])
    axes.plot(*np.degrees(along).T, "D", ms=6, mfc="white", mec="#2f3136", mew=1.4, label="boundary, by bisection")
    axes.set(xlim=(0, 60), ylim=(0, 60), aspect="equal")
    axes.set(
        xlabel=r"slenderness angle $\delta$, $\tan\delta$ = width/height (degrees)",
        ylabel=r"friction angle $\varphi$ (degrees)",
    )
    axes.set_title(
        f"Columns let go on an incline of {np.degrees(incline):g}°; tints: Yagoda-Biran & Hatzor (2013)", fontsize=10
    )
    axes.legend(fontsize=9, loc="upper right", framealpha=0.95, edgecolor="none")
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=150)
