"""Marks on a picture: supports, loads, bolts with their forces, water, monitors, initial ground surface."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .frame import Frames, drawn, reference

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK, FIXED, LOAD, WATER, BOLT, BEFORE = "#1b1d21", "#8d9199", "#5b2a86", "#2f6fb5", "#1b1d21", "#7a7f87"
#: Largest number of labelled bolts or tips, those with the largest values: more would cover the model.
LABELLED = 8


class Marks:
    """Draws the marks of a run on axes; each method returns its legend handles."""

    def __init__(self, frames: Frames, scale: float, size: float) -> None:
        self.frames, self.scale, self.size = frames, scale, size
        self.scene: dict[str, Any] = frames.run.scene
        start = frames.span()[0]
        self._before = _outer(frames.grid("blocks", start))

    def draw(self, axes: Axes, time: float) -> list[Any]:
        """All marks at ``time``; returns the legend handles."""
        now = self.frames.grid("outlines", time)
        keys: list[Any] = []
        if now is not None:
            keys += self._supports(axes, now) + self._ground(axes, now) + self._loads(axes, now)
        return keys + self._bolts(axes, time) + self._water(axes, time) + self._monitors(axes, time)

    def _supports(self, axes: Axes, now: Any) -> list[Any]:
        from matplotlib.collections import LineCollection
        from matplotlib.lines import Line2D

        fixed = np.asarray(now["fixed"]) == 1
        if not fixed.any():
            return []
        lines = drawn(now, self.scale)[now.cells.reshape(-1, 3)[:, 1:]][fixed]
        axes.add_collection(LineCollection(lines, colors=FIXED, linewidths=2.2, zorder=5.5))
        return [Line2D([], [], color=FIXED, lw=2.2, label="fixed")]

    def _ground(self, axes: Axes, now: Any) -> list[Any]:
        """The initial outline, if the rock has moved by more than the width of a line."""
        from matplotlib.collections import LineCollection
        from matplotlib.lines import Line2D

        way = self.scale * np.hypot(*np.asarray(now["displacement"])[:, :2].T)
        if not len(way) or way.max() < 0.004 * self.size:
            return []
        axes.add_collection(
            LineCollection(self._before, colors=BEFORE, linewidths=0.9, linestyles=(0, (4, 3)), zorder=7)
        )
        return [Line2D([], [], color=BEFORE, lw=0.9, ls=(0, (4, 3)), label="outline at the start")]

    def _loads(self, axes: Axes, now: Any) -> list[Any]:
        """Arrows on edges with a traction, and at point forces of the scene."""
        from matplotlib.lines import Line2D

        loads = self.scene.get("loads", {})
        known = bytes(np.asarray(now.field_data["EDGE_NAMES"])).decode().split("\n")
        lines, length, count = drawn(now, self.scale)[now.cells.reshape(-1, 3)[:, 1:]], 0.06 * self.size, 0
        for table in loads.get("tractions", []):
            way = np.asarray(table.get("rate_pa_per_s") or table.get("value_pa") or [0.0, 0.0], float)
            if table.get("edge") not in known or way.shape != (2,) or not way.any():
                continue
            for a, b in lines[np.asarray(now["edge_name"]) == known.index(table["edge"])]:
                count += self._arrows(axes, a, b, way / np.hypot(*way), length)
        for table in loads.get("forces", []):
            way = np.asarray(table.get("rate_n_per_m_s") or table.get("value_n_per_m") or [0.0, 0.0], float)
            if table.get("at") is not None and way.shape == (2,) and way.any():
                at = np.asarray(table["at"], float)
                count += self._arrows(axes, at, at, way / np.hypot(*way), length)
        return [Line2D([], [], color=LOAD, lw=0, marker=r"$\downarrow$", ms=8, label="load")] if count else []

    @staticmethod
    def _arrows(axes: Axes, a: np.ndarray, b: np.ndarray, way: np.ndarray, length: float) -> int:
        n = int(np.clip(round(np.hypot(*(b - a)) / (0.8 * length)), 1, 12))
        out = np.array([(b - a)[1], -(b - a)[0]])
        for share in (np.arange(n) + 0.5) / n:
            at = a + share * (b - a)
            tail, head = (at, at + length * way) if way @ out > 0 else (at - length * way, at)
            axes.annotate("", head, tail, arrowprops={"arrowstyle": "-|>", "color": LOAD, "lw": 1.0}, zorder=8)
        return n

    def _bolts(self, axes: Axes, time: float) -> list[Any]:
        from matplotlib.lines import Line2D

        grid = self.frames.grid("bolts", time)
        if grid is None or not grid.n_cells:
            return []
        lines = drawn(grid, self.scale)[grid.cells.reshape(-1, 3)[:, 1:]]
        force, state = np.asarray(grid["force"]), np.asarray(grid["state"])
        for line, broken in zip(lines, state == 3, strict=True):
            axes.plot(*line.T, color="white", lw=3.2, zorder=8, solid_capstyle="round")
            axes.plot(*line.T, color=BOLT, lw=1.7, ls=":" if broken else "-", zorder=8.1, marker="s", ms=2.6)
        labelled: list[np.ndarray] = []
        for k in np.argsort(-np.abs(force), kind="stable"):
            midpoint = lines[k].mean(axis=0)
            near = [other for other in labelled if np.hypot(*(midpoint - other)) < 0.1 * self.size]
            if near or len(labelled) == LABELLED:
                continue  # labels would overlap
            labelled.append(midpoint)
            axes.annotate(f"{force[k] / 1e3:.3g}".replace("-", "\N{MINUS SIGN}"), midpoint, xytext=(3, 3), textcoords="offset points",
                          fontsize=6.5, color=BOLT, zorder=9, bbox=PAPER)  # fmt: skip
        return [Line2D([], [], color=BOLT, lw=1.7, marker="s", ms=2.6, label="bolts, force in kN/m")]

    def _water(self, axes: Axes, time: float) -> list[Any]:
        from matplotlib.lines import Line2D

        grid = self.frames.grid("water", time)
        if grid is None or not grid.n_cells:
            return []
        line = np.asarray(grid.points)[:, :2]
        axes.plot(*line.T, color=WATER, lw=1.4, ls=(0, (6, 2)), zorder=7.5)
        return [Line2D([], [], color=WATER, lw=1.4, ls=(0, (6, 2)), label="water table")]

    def _monitors(self, axes: Axes, time: float) -> list[Any]:
        from matplotlib.lines import Line2D

        points = [m["at"] for m in self.scene.get("monitors", []) if m.get("at") is not None]
        blocks = self.frames.grid("blocks", time)
        if not points or blocks is None:
            return []
        at = np.array(points, float)
        # A monitor moves with the nearest vertex: the difference is below the width of a line.
        near = np.argmin(((reference(blocks)[None] - at[:, None]) ** 2).sum(axis=2), axis=1)
        at = at + self.scale * np.asarray(blocks["displacement"])[near, :2]
        style: dict[str, Any] = {"marker": "o", "ms": 4.5, "mfc": "white", "mec": INK, "mew": 1.1, "lw": 0}
        axes.plot(*at.T, zorder=9, **style)
        return [Line2D([], [], label="monitors", **style)]


#: Background of a label.
PAPER = {"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.8}


def _outer(blocks: Any) -> list[np.ndarray]:
    """Outlines (n, 2) m of the initial rock as one body, without the seams between blocks."""
    import shapely

    corners = reference(blocks)[blocks.cells.reshape(-1, 4)[:, 1:]]
    near = 1e-5 * float(np.ptp(corners.reshape(-1, 2), axis=0).max())
    rock = shapely.union_all(shapely.buffer(shapely.polygons(corners), near, cap_style="square", join_style="mitre"))
    parts = shapely.get_parts(shapely.buffer(rock, -near, join_style="mitre"))
    return [np.asarray(part.exterior.coords) for part in parts if not part.is_empty]
