"""Picture of a joint network's statistics: block sizes, directions, trace lengths, and connectivity."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from geomech.output.tables.joint_statistics import network_of
from geomech.shapes.parts import JOINT

from .block_map import INK, SETS, joint_colours

_SOFT = "#4a4e55"


def draw_network_statistics(scene: Any, statistics: dict[str, Any], path: Path | str) -> Path:
    """Draw the joint ``statistics`` of `geomech.output.block_model.block_system` for a loaded scene, as a PNG.

    Block-size curve, rose diagram of directions weighted by length, trace lengths with the specified distributions, and
    Sanderson & Nixon's triangle of nodes.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.4, 9.0), dpi=130)
    colour = joint_colours(scene)
    lines = {joint.name: list(joint.lines) for joint in network_of(scene).joints}
    _block_sizes(figure.add_axes((0.07, 0.565, 0.4, 0.33)), statistics)
    _rose(figure.add_axes((0.56, 0.53, 0.36, 0.37), projection="polar"), lines, colour)
    _lengths(figure.add_axes((0.07, 0.09, 0.4, 0.33)), statistics, lines, colour)
    _triangle(figure.add_axes((0.56, 0.07, 0.38, 0.36)), statistics)
    figure.text(0.035, 0.962, statistics["title"], fontsize=13, color=INK, weight="bold")
    figure.text(0.035, 0.938, f"the joint network of {statistics['summary']}", fontsize=9, color=_SOFT)
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, facecolor="white")
    return path


def _dressed(axes: Any, title: str, x: str, y: str) -> None:
    axes.set_title(title, fontsize=10, color=INK, loc="left", weight="bold")
    axes.set_xlabel(x, fontsize=9, color=INK)
    axes.set_ylabel(y, fontsize=9, color=INK)
    axes.tick_params(labelsize=8, colors=INK)
    axes.grid(which="major", color="#e4e4e4", lw=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _block_sizes(axes: Any, statistics: dict[str, Any]) -> None:
    blocks = statistics["blocks"]
    curve = np.array(blocks["percent_passing_by_size_m"])
    _dressed(axes, "Block sizes", "block size √area, m", "% of the rock in blocks up to this size")
    axes.step(np.append(curve[0, 0], curve[:, 0]), np.append(0, curve[:, 1]), where="post", color=INK, lw=1.8)
    if curve[-1, 0] > 30 * curve[0, 0]:
        from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter

        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.xaxis.set_major_formatter(ScalarFormatter())
        axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_ylim(0, 102)
    left = axes.get_xlim()[0]
    for percent in (10, 50, 90):
        size = blocks[f"d{percent}_m"]
        axes.plot([left, size, size], [percent, percent, 0], color=SETS[0], lw=0.9, ls=(0, (4, 3)))
        axes.annotate(
            f"D{percent} {size:.3g} m", (left, percent), xytext=(5, 3), textcoords="offset points", fontsize=8,
            color=SETS[0],
        )  # fmt: skip
    axes.set_xlim(left=left)


def _rose(axes: Any, lines: dict[str, list[np.ndarray]], colour: dict[str, str]) -> None:
    """Trace length by direction, in sectors of 5°, both ways: traces have no direction sense."""
    from matplotlib.ticker import MaxNLocator

    width = math.radians(5)
    below = np.zeros(36)
    for name, own in lines.items():
        steps = np.concatenate([np.diff(line, axis=0) for line in own]) if own else np.empty((0, 2))
        sector = np.floor(np.mod(np.arctan2(steps[:, 1], steps[:, 0]), math.pi) / width + 1e-9).astype(int) % 36
        length = np.bincount(sector, weights=np.hypot(*steps.T), minlength=36)
        at = (np.arange(36) + 0.5) * width
        for turn in (0.0, math.pi):
            axes.bar(at + turn, length, width=0.94 * width, bottom=below, color=colour[name], lw=0,
                     label=name.removeprefix(JOINT) if turn == 0 else None)  # fmt: skip
        below += length
    axes.set_title("Directions, weighted by trace length", fontsize=10, color=INK, weight="bold", pad=14)
    axes.tick_params(labelsize=8, colors=INK)
    axes.set_rlabel_position(45)
    axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g} m")
    axes.grid(color="#dddddd", lw=0.6)
    axes.spines["polar"].set_color("#c4c7cc")
    axes.legend(frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.08), labelcolor=INK)


def _lengths(axes: Any, statistics: dict[str, Any], lines: dict[str, list[np.ndarray]], colour: dict[str, str]) -> None:
    _dressed(axes, "Trace lengths, as drawn in the section", "length, m", "% of the traces up to this length")
    for entry in statistics["sets"]:
        name = JOINT + entry["name"]
        length = np.sort([float(np.hypot(*np.diff(line, axis=0).T).sum()) for line in lines[name]])
        if not len(length):
            continue
        share = 100 * np.arange(1, len(length) + 1) / len(length)
        axes.step(np.append(length[0], length), np.append(0, share), where="post", color=colour[name], lw=1.8,
                  label=entry["name"])  # fmt: skip
        wanted = entry.get("asked", {}).get("mean_length_m")
        if wanted is not None:
            axes.axvline(wanted, color=colour[name], lw=1.0, ls=(0, (4, 3)), label=f"specified mean, {wanted:.3g} m")
    axes.set_ylim(0, 102)
    axes.set_xlim(left=0)
    axes.legend(frameon=False, fontsize=8, labelcolor=INK, loc="best")


def _triangle(axes: Any, statistics: dict[str, Any]) -> None:
    """Shares of the three kinds of nodes (Manzocchi 2002), with lines of equal connections per branch (Sanderson &
    Nixon 2015)."""
    nodes, topology = statistics["nodes"], statistics["topology"]
    corner = {"I": np.array([0.5, math.sqrt(0.75)]), "Y": np.array([0.0, 0.0]), "X": np.array([1.0, 0.0])}

    def place(i: float, y: float, x: float) -> np.ndarray:
        return (i * corner["I"] + y * corner["Y"] + x * corner["X"]) / (i + y + x)

    axes.plot(*np.array([corner[k] for k in "IYXI"]).T, color=INK, lw=1.2)
    for connections in (0.5, 1.0, 1.5, 1.9):
        # (3 y + 4 x) / ((i + 3 y + 4 x) / 2) = c is a straight line from the side IY to the side IX.
        per_i = connections / (2 - connections)
        ends = np.array([place(1, per_i / 3, 0), place(1, 0, per_i / 4)])
        axes.plot(*ends.T, color="#c4c7cc", lw=0.9)
        axes.annotate(f"{connections:g}", ends[1], xytext=(5, 0), textcoords="offset points", fontsize=8, color=_SOFT)
    for (label, at), (dx, dy) in zip(corner.items(), ((0, 7), (-11, -5), (11, -5))):
        axes.annotate(label, at, xytext=(dx, dy), textcoords="offset points", ha="center", fontsize=10, color=INK)
    total = sum(nodes[k] for k in "IYX")
    if total:
        axes.plot(
            *place(*(nodes[k] for k in "IYX")), marker="o", ms=11, color="#d7263d", mec="white", mew=1.2, zorder=5
        )
    text = f"I {nodes['I']} ends in rock, Y {nodes['Y']} abutments, X {nodes['X']} crossings"
    if topology["connections_per_branch"] is not None:
        text += f"\n{topology['connections_per_branch']:.2f} connections per branch (grey lines)"
    if topology["connections_per_line"] is not None:
        text += f", {topology['connections_per_line']:.3g} per line"
    axes.set_title("Connectivity", fontsize=10, color=INK, loc="left", weight="bold", y=1.03)
    axes.text(0.5, -0.13, text, fontsize=8.5, color=_SOFT, ha="center", va="top")
    axes.set(xlim=(-0.15, 1.15), ylim=(-0.1, 0.95), aspect="equal")
    axes.axis("off")
