"""Picture of `geomech safety`: motion of blocks at failure, mobilised joints, anchors and toes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from geomech.model import GROUND, Problem

from .block_map import FIXED, INK, LOAD

#: Colours of moving blocks by kind of motion, from light to dark so that they differ in grey prints too, and of stable ones.
KINDS = {"slides": "#f0b429", "topples": "#c06a98", "slides and topples": "#a84300"}
STANDS, SLIDING, TOE = "#efe6d5", "#d7263d", "#0072b2"
#: Length of the longest arrow, relative to the drawing's size.
_ARROW = 0.12


class Moving(Protocol):
    """A block that moves at failure."""

    @property
    def name(self) -> str: ...

    @property
    def kind(self) -> str: ...

    @property
    def displacement(self) -> tuple[float, float]: ...


def draw_mechanism(
    problem: Problem, title: str, moving: Sequence[Moving], sliding: np.ndarray,
    toes: Sequence[tuple[float, float]], anchors: Mapping[str, float], path: Path | str,
) -> Path:  # fmt: skip
    """Draw ``problem`` with the blocks ``moving`` in colour and arrows proportional to their displacement.

    Faces ``sliding`` (n, 2, 2) m are red; ``toes`` (points, m) and bolts with the forces ``anchors`` (N/m by name) are
    marked.
    """
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    blocks = problem.blocks
    low, high = blocks.vertices.min(axis=0), blocks.vertices.max(axis=0)
    kinds = {each.name: each for each in moving}
    keys: list[Any] = []
    figure = Figure(figsize=(9.5, 6.0), dpi=130, layout="constrained")
    axes = figure.subplots()
    outlines = [blocks.loops(b)[0] for b in range(blocks.n_blocks)]
    colours = [
        FIXED if blocks.fixed[b] else KINDS[kinds[name].kind] if name in kinds else STANDS
        for b, name in enumerate(blocks.names)
    ]
    axes.add_collection(PolyCollection(outlines, facecolors=colours, edgecolors=INK, linewidths=0.6))
    for kind, colour in KINDS.items():
        if any(each.kind == kind for each in moving):
            keys.append(Patch(facecolor=colour, edgecolor=INK, lw=0.5, label=kind))
    if len(sliding):
        axes.add_collection(LineCollection(list(sliding), colors=SLIDING, linewidths=2.4, capstyle="round"))
        keys.append(Line2D([], [], color=SLIDING, lw=2.4, label="joint strength fully mobilised"))
    for bolt in problem.loads.bolts:
        ends = np.array([bolt.start, bolt.end])
        axes.plot(*ends.T, color=LOAD, lw=1.8, marker="s" if bolt.other != GROUND else "|", ms=4)
        if bolt.name in anchors:
            axes.annotate(f"{anchors[bolt.name] / 1e3:.4g} kN/m", ends.mean(axis=0), fontsize=8, color=LOAD)
    if problem.loads.bolts:
        keys.append(Line2D([], [], color=LOAD, lw=1.8, label="anchors and their forces"))
    if len(toes):
        axes.plot(*np.array(toes).T, ls="", marker="o", ms=8, mfc="none", mec=TOE, mew=1.8)
        keys.append(Line2D([], [], ls="", marker="o", mfc="none", mec=TOE, mew=1.8, label="toes"))
    size = float(np.ptp(np.concatenate([outlines[b] for b in np.flatnonzero(~blocks.fixed)]), axis=0).max())
    for b, name in enumerate(blocks.names):
        if name in kinds:
            centre, way = outlines[b].mean(axis=0), _ARROW * size * np.array(kinds[name].displacement)
            axes.annotate("", centre + way, centre, arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.3})
    # The moving region fills the picture; the base may extend far.
    seen = np.concatenate([outlines[b] for b in np.flatnonzero(~blocks.fixed)])
    near, far = seen.min(axis=0) - 0.35 * size, seen.max(axis=0) + 0.35 * size
    near, far = np.maximum(near, low - 0.02 * size), np.minimum(far, high + 0.1 * size)
    axes.set(xlim=(near[0], far[0]), ylim=(near[1], far[1]), aspect="equal")
    axes.set_xlabel("m", fontsize=8)
    axes.tick_params(labelsize=8, colors=INK, length=3)
    axes.set_title(title, fontsize=11, loc="left", color=INK)
    if keys:
        figure.legend(handles=keys, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    for side in axes.spines.values():
        side.set_visible(False)
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, facecolor="white")
    return path
