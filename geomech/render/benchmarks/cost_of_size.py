"""Pictures of `geomech bench dda` and `geomech bench geometry`: time against the number of blocks, or against the
residual."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

_STYLES = (("#1f6f8b", "o"), ("#588157", "s"), ("#c8553d", "^"), ("#8e6c8a", "D"), ("#c9a227", "v"))
#: Panels side by side, at most.
_ABREAST = 3


class Measured(Protocol):
    """Cost of a scene with so many blocks."""

    scene: str
    blocks: int
    iteration: float
    search: float


class Cut(Protocol):
    """Cost of cutting rock into so many blocks."""

    network: str
    blocks: int
    cutting: float


def draw(costs: Sequence[Measured], other: Mapping[int, float], path: Path) -> Path:
    """``costs`` as one curve per scene, dashed for the contact search of a step; ``other`` is Shi's code, {blocks:
    s}."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 5.2), dpi=130, layout="constrained")
    axes = figure.subplots()
    axes.loglog(list(other), [1e3 * s for s in other.values()], color="#c8553d", marker="^", label="Shi's DDA in C")
    for scene, (colour, marker) in zip(dict.fromkeys(c.scene for c in costs), _STYLES):
        selected = [c for c in costs if c.scene == scene]
        n = [c.blocks for c in selected]
        axes.loglog(n, [1e3 * c.iteration for c in selected], color=colour, marker=marker, lw=2, label=scene)
        axes.loglog(
            n,
            [1e3 * c.search for c in selected],
            color=colour,
            ls=":",
            lw=1.2,
            label=f"{scene}, contact search of a step",
        )
    first = min(costs, key=lambda c: c.blocks)
    n = [first.blocks, max(c.blocks for c in costs)]
    axes.loglog(n, [1e3 * first.iteration * k / n[0] for k in n], color="#999999", lw=0.8, ls="--", label="linear")
    return _saved(figure, axes, "ms per open–close iteration", path)


def draw_solvers(solutions: Sequence[Mapping[str, Any]], path: Path) -> Path:
    """Time against residual of several solvers of a step's equations, one panel per scene and size.

    ``solutions`` are rows of scene, blocks, method, seconds, residual.
    """
    from matplotlib.figure import Figure

    scenes = list(dict.fromkeys((row["scene"], row["blocks"]) for row in solutions))
    styles = dict(zip(dict.fromkeys(row["method"] for row in solutions), itertools.cycle(_STYLES)))
    rows = -(-len(scenes) // _ABREAST)
    across = -(-len(scenes) // rows)
    figure = Figure(figsize=(0.5 + 3.6 * across, 0.6 + 3.6 * rows), dpi=130, layout="constrained")
    grid = figure.subplots(rows, across, sharex=True, sharey=True, squeeze=False)
    panels = grid.ravel()
    for panel, (scene, blocks) in zip(panels, scenes):
        here = [row for row in solutions if (row["scene"], row["blocks"]) == (scene, blocks)]
        for method, (colour, marker) in styles.items():
            selected = sorted((row for row in here if row["method"] == method), key=lambda row: -row["residual"])
            panel.loglog(
                [row["residual"] for row in selected], [1e3 * row["seconds"] for row in selected], color=colour, marker=marker,
                lw=1.5, label=method,
            )  # fmt: skip
        panel.set_title(f"{scene}, {blocks} blocks", fontsize=10, loc="left")
        panel.grid(which="major", color="#e4e4e4", lw=0.7)
        panel.set_axisbelow(True)
        for side in ("top", "right"):
            panel.spines[side].set_visible(False)
    # The same axis for all panels.
    panels[0].invert_xaxis()
    for panel in panels[len(scenes) :]:
        panel.set_axis_off()
    for panel in grid[:, 0]:
        panel.set_ylabel("solution with set-up, ms")
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=4, frameon=False, fontsize=9
    )
    figure.supxlabel("relative residual, better to the right", fontsize=10)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    return path


def draw_cutting(costs: Sequence[Cut], path: Path) -> Path:
    """Time of cutting, s, one curve per network."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 5.2), dpi=130, layout="constrained")
    axes = figure.subplots()
    for network, (colour, marker) in zip(dict.fromkeys(c.network for c in costs), _STYLES):
        selected = [c for c in costs if c.network == network]
        last = selected[-1]
        label = f"{network}, {last.blocks / last.cutting:,.0f} blocks/s at {last.blocks:,}".replace(",", "\u202f")
        axes.loglog(
            [c.blocks for c in selected], [c.cutting for c in selected], color=colour, marker=marker, lw=2,
            label=label.replace("\u202f", ",", 1),
        )  # fmt: skip
    low, high = min(costs, key=lambda c: c.blocks), max(costs, key=lambda c: c.blocks)
    n = [low.blocks, high.blocks]
    axes.loglog(n, [high.cutting * k / n[1] for k in n], color="#999999", lw=0.8, ls="--", label="linear")
    return _saved(figure, axes, "cutting time, s", path)


def _saved(figure: Any, axes: Any, what: str, path: Path) -> Path:
    axes.set_xlabel("blocks")
    axes.set_ylabel(what)
    axes.grid(which="major", color="#e4e4e4", lw=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.legend(frameon=False, fontsize=9)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    return path
