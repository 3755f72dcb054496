"""Quick drawing with Matplotlib: blocks in their current position and cracks, in given axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from geomech.model import Blocks, Cracks

#: Colours of moving rock, fixed rock, outlines, cracks.
ROCK, FIXED, INK, CRACK = "#eadfca", "#b9bcc2", "#33363b", "#d7263d"


def sketch(
    what: Any,
    axes: Any = None,
    *,
    values: Sequence[float] | None = None,
    label: str = "",
    magnify: float = 1.0,
    cmap: str = "viridis",
) -> Any:
    """Draw the blocks and cracks of ``what`` and return the axes.

    ``what`` is a coupling `Cycle` (current position), a `Problem`, or a loaded scene (as drawn). ``axes`` are those of
    Matplotlib (None: of a new figure); ``values`` (n_blocks,) colour the blocks, with a colour bar labelled ``label``;
    displacements are multiplied by ``magnify``. Raises ValueError if the number of values is not that of blocks.
    """
    from matplotlib.collections import LineCollection, PathCollection
    from matplotlib.path import Path

    source = what.problem() if hasattr(what, "problem") else what
    blocks: Blocks = source.blocks
    cracks: Cracks = source.cracks
    state = getattr(source, "state", None)
    now = blocks.vertices if state is None else blocks.vertices + magnify * (state.vertices - blocks.vertices)
    if axes is None:
        axes = _new_axes(now)
    if values is not None and len(values) != blocks.n_blocks:
        raise ValueError(f"there are {blocks.n_blocks} blocks, but {len(values)} values")
    removed = None if state is None else state.removed
    shown = np.ones(blocks.n_blocks, bool) if removed is None else ~removed
    outlines = [
        Path.make_compound_path(*(Path(now[loop], closed=False) for loop in _loops(blocks, b)))
        for b in np.flatnonzero(shown).tolist()
    ]
    drawn = PathCollection(outlines, edgecolors=INK, linewidths=0.7)
    if values is None:
        drawn.set_facecolor([FIXED if fixed else ROCK for fixed in blocks.fixed[shown]])
    else:
        drawn.set(array=np.asarray(values, dtype=float)[shown], cmap=cmap)
        axes.figure.colorbar(drawn, ax=axes, shrink=0.7, label=label)
    axes.add_collection(drawn)
    if cracks.n_segments:
        nodes = cracks.nodes if state is None else _carried(cracks, what, magnify)
        axes.add_collection(LineCollection(nodes[cracks.segments], colors=CRACK, linewidths=1.6, capstyle="round"))
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set(xlabel="x, m", ylabel="y, m")
    return axes


def _new_axes(points: np.ndarray) -> Any:
    """Axes of a new figure with the proportions of the ``points``."""
    import matplotlib.pyplot as plt

    wide, tall = np.ptp(points, axis=0)
    across = float(np.clip(5.0 * wide / tall, 3.0, 9.0))
    figure, axes = plt.subplots(figsize=(across + 0.8, float(np.clip(across * tall / wide, 2.5, 7.0)) + 0.6))
    figure.set_layout_engine("constrained")
    return axes


def _loops(blocks: Blocks, block: int) -> list[np.ndarray]:
    """Vertex numbers of each loop of a block, closed."""
    left = set(range(blocks.vertex_start[block], blocks.vertex_start[block + 1]))
    loops = []
    while left:
        ring = [min(left)]
        while (after := int(blocks.next_vertex[ring[-1]])) != ring[0]:
            ring.append(after)
        left -= set(ring)
        loops.append(np.array([*ring, ring[0]]))
    return loops


def _carried(cracks: Cracks, cycle: Any, magnify: float) -> np.ndarray:
    """(n_nodes, 2) nodes of the cracks, moved with their blocks."""
    nodes = cracks.nodes.copy()
    for block in np.unique(cracks.block):
        own = np.unique(cracks.segments[cracks.block == block])
        nodes[own] += magnify * (cycle.motion.current(block, cracks.nodes[own]) - cracks.nodes[own])
    return nodes
