"""The pictures of `geomech bench dda` and `geomech bench geometry`: time against the number of blocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

_STYLES = (("#1f6f8b", "o"), ("#588157", "s"), ("#c8553d", "^"), ("#8e6c8a", "D"))


class Measured(Protocol):
    scene: str
    blocks: int
    iteration: float
    search: float


class Cut(Protocol):
    network: str
    blocks: int
    cutting: float


def draw(costs: Sequence[Measured], other: Mapping[int, float], path: Path) -> Path:
    """``costs`` as a curve a scene, dashed for the search of a step; ``other`` is Shi's code, blocks → s."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 5.2), dpi=130, layout="constrained")
    axes = figure.subplots()
    axes.loglog(list(other), [1e3 * s for s in other.values()], color="#c8553d", marker="^", label="Shi's DDA in C")
    for scene, (colour, marker) in zip(dict.fromkeys(c.scene for c in costs), _STYLES):
        mine = [c for c in costs if c.scene == scene]
        n = [c.blocks for c in mine]
        axes.loglog(n, [1e3 * c.iteration for c in mine], color=colour, marker=marker, lw=2, label=scene)
        axes.loglog(
            n, [1e3 * c.search for c in mine], color=colour, ls=":", lw=1.2, label=f"{scene}, contact search of a step"
        )
    first = min(costs, key=lambda c: c.blocks)
    n = [first.blocks, max(c.blocks for c in costs)]
    axes.loglog(n, [1e3 * first.iteration * k / n[0] for k in n], color="#999999", lw=0.8, ls="--", label="linear")
    return _saved(figure, axes, "ms an open–close iteration", path)


def draw_cutting(costs: Sequence[Cut], path: Path) -> Path:
    """Seconds of cutting, a curve a network."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 5.2), dpi=130, layout="constrained")
    axes = figure.subplots()
    for network, (colour, marker) in zip(dict.fromkeys(c.network for c in costs), _STYLES):
        mine = [c for c in costs if c.network == network]
        last = mine[-1]
        label = f"{network}, {last.blocks / last.cutting:,.0f} blocks/s at {last.blocks:,}".replace(",", "\u202f")
        axes.loglog(
            [c.blocks for c in mine], [c.cutting for c in mine], color=colour, marker=marker, lw=2,
            label=label.replace("\u202f", ",", 1),
        )  # fmt: skip
    low, high = min(costs, key=lambda c: c.blocks), max(costs, key=lambda c: c.blocks)
    n = [low.blocks, high.blocks]
    axes.loglog(n, [high.cutting * k / n[1] for k in n], color="#999999", lw=0.8, ls="--", label="linear")
    return _saved(figure, axes, "s of cutting", path)


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
