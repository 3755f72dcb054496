"""K of a pressurised crack below a free surface, compared with an independent solution and with the limits of small and
large depth."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geomech.model import Cracks
from geomech.reference.cracks.crack_arrays import near_surface
from geomech.reference.cracks.surface_crack import thin_layer

#: Smallest depth that the independent solution resolves; its kernels peak like 1/depth².
RESOLVED = 0.05
GRIFFITH = np.sqrt(np.pi)

#: Relative to |K| by dislocations, where the block's size leaves 1e-5; and to the thin layer, where the second-order
#: term left by extrapolation is 0.25 and 0.15 %.
INDEPENDENT_TOLERANCE, LAYER_TOLERANCE = 3e-5, 5e-3
#: K_I in excess of Griffith's, and K_II, at a depth of five half-lengths: both fall with the square of the depth.
DEEP, DEEP_SHEAR = 0.03, 0.004
#: Tolerance of the symmetry of paths, relative to the distance between their ends; increments are 0.15 m.
MIRROR_TOLERANCE = 0.02

LIMITS = """\
Limits of the comparison
  - The half-plane is a block 40 (1 + depth) crack half-lengths wide, free on all sides.
  - K of straight cracks depends on depth/half-length only. The thin layer's error is of first order in it: the first
    two depths extrapolated to zero give the published factors.
  - Paths are those under a constant pressure without the fluid's weight, flow or lag: cracks turn up to the surface as
    sills do (Pollard & Holzhausen 1979), but the computation does not predict when."""


def independent(depths: np.ndarray) -> np.ndarray:
    """(n, 2) K_I, K_II at the right-hand tip by dislocations in the half-plane, for unit pressure and half-length; nan
    if not resolved."""
    out = np.full((len(depths), 2), np.nan)
    for k, depth in enumerate(depths):
        if depth >= RESOLVED:
            ends = np.array([[-1.0, -depth], [1.0, -depth]])
            out[k] = near_surface(ends, 1.0, 129 if depth < 0.1 else 65)[1]
    return out


def shallow_limit(depths: np.ndarray, k: np.ndarray) -> np.ndarray:
    """(2,) ratio of K_I, K_II to those of the thin layer, extrapolated to zero depth from the first two ``depths``."""
    ratio = np.array([np.abs(k[m]) / thin_layer(1.0, depths[m], 1.0) for m in (0, 1)])
    return ratio[0] + (ratio[0] - ratio[1]) * depths[0] / (depths[1] - depths[0])


def check(depths: np.ndarray, k: np.ndarray, paths: dict[float, Cracks]) -> None:
    """AssertionError if K or a path is missed by more than its tolerance."""
    exact = independent(depths)
    off = np.abs(k - exact).max(axis=1) / np.hypot(*exact.T)
    assert np.isfinite(off).sum() == (depths >= RESOLVED).sum(), "K or its independent value is not finite"
    assert np.nanmax(off) < INDEPENDENT_TOLERANCE, "K is off that of dislocations in the half-plane"
    assert np.abs(shallow_limit(depths, k) - 1).max() < LAYER_TOLERANCE, "a shallow crack does not lift a thin plate"
    beyond = k[-2:, 0] / GRIFFITH - 1
    assert 0 < beyond[1] < DEEP, "K of a deep crack depends on the surface"
    fall = beyond[0] / beyond[1] / (depths[-1] / depths[-2]) ** 2
    assert abs(fall - 1) < 0.15, "the influence of the surface does not fall with the square of the depth"
    assert abs(k[-1, 1]) < DEEP_SHEAR * k[-1, 0], "a deep crack shears"
    for depth, cracks in paths.items():
        up = cracks.nodes[cracks.surface & (cracks.valence > 0)]
        assert len(up) == 2 and not len(cracks.tips), (
            f"from depth {depth:g} the crack does not reach the surface on both sides"
        )
        assert np.abs(up[:, 1]).max() < 1e-9, f"from depth {depth:g} the crack does not end at the surface"
        assert abs(up[:, 0].sum()) < MIRROR_TOLERANCE * np.ptp(up[:, 0]), f"from depth {depth:g} it is not symmetric"
        assert np.ptp(up[:, 0]) > 2 * (1 + depth), f"from depth {depth:g} the crack does not lead outwards"


def report(depths: np.ndarray, k: np.ndarray, paths: dict[float, Cracks]) -> str:
    """The comparison as text; ``k`` (n, 2) for unit pressure and half-length."""
    exact = independent(depths)
    rows = [
        "depth    K_I      K_II       relative to dislocations       relative to a thin layer",
        "         (p√πa = 1)",
    ]
    for depth, got, other in zip(depths, k, exact):
        off = np.abs(got - other).max() / np.hypot(*other)
        thin = np.abs(got) / thin_layer(1.0, depth, 1.0)
        difference = f"{off:.1e}" if np.isfinite(off) else "-"
        rows.append(
            f"{depth:5.2f} {got[0] / GRIFFITH:9.4f} {got[1] / GRIFFITH:9.4f}      {difference:>12}     {thin[0]:18.4f} "
            f"{thin[1]:7.4f}"
        )
    limit = shallow_limit(depths, k)
    rows += ["", f"thin layer, extrapolated to no depth: {limit[0]:.4f}, {limit[1]:.4f} of the published K_I, K_II", ""]
    for depth, cracks in paths.items():
        top = cracks.nodes[np.argmax(cracks.nodes[:, 1])]
        rows.append(
            f"from depth {depth:g} the crack comes up {abs(top[0]):.2f} from its middle, {abs(top[1]):.2f} below the "
            "surface"
        )
    return "\n".join([*rows, "", LIMITS])


def draw(path: Path, depths: np.ndarray, k: np.ndarray, paths: dict[float, Cracks]) -> None:
    """K against depth with the limits, and the paths, as one picture."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 7), layout="constrained")
    upper, lower = figure.subplots(2, 1, height_ratios=[2.6, 1])
    fine = np.geomspace(depths[0], depths[-1], 60)
    thin = np.array([thin_layer(1.0, d, 1.0) for d in fine]) / GRIFFITH
    exact = np.abs(independent(depths)) / GRIFFITH
    for mode, colour in ((0, "#1f6f8b"), (1, "#c8553d")):
        name = ("K_I", "K_{II}")[mode]
        upper.loglog(depths, np.abs(k[:, mode]) / GRIFFITH, "-o", ms=4, color=colour, label=f"$|{name}|$")
        upper.loglog(depths, exact[:, mode], "x", ms=8, color="#222222", label="dislocations" if mode else None)
        upper.loglog(fine[fine < 0.6], thin[fine < 0.6, mode], ":", color=colour, label=f"thin layer, $|{name}|$")
    upper.set_title("A pressurised crack below a free surface", fontsize=10)
    upper.axhline(1.0, color="#999999", lw=0.8)
    upper.text(depths[0], 1.08, "Griffith", color="#777777", fontsize=8)
    upper.set(xlabel="depth / half-length", ylabel=r"$|K| / p\sqrt{\pi a}$")
    upper.legend(frameon=False, fontsize=8)
    lower.axhline(0, color="#3d405b", lw=2)
    for (depth, cracks), colour in zip(paths.items(), ("#b08900", "#588157", "#8d6a9f")):
        for a, b in cracks.nodes[cracks.segments]:
            lower.plot([a[0], b[0]], [a[1], b[1]], color=colour, lw=1.8, solid_capstyle="round")
        lower.plot([-1, 1], [-depth, -depth], color=colour, lw=4, alpha=0.35)
    lower.set(xlabel="x / half-length", ylabel="y / half-length", aspect="equal")
    lower.set_title("The way to the surface, pressure held", fontsize=10)
    for axes in (upper, lower):
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=150)
