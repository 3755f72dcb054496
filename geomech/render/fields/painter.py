"""One picture of any field of a run, drawn with Matplotlib: rock, field, cracks, marks, scale bar, legend."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geomech.output.reading import Run
from geomech.output.units import length_unit, stress_text

from ..pictures.look import CRACK_COLOURS, final_cycle, magnification, rock_colours, two_signed
from .crack_lines import CrackLines
from .frame import Frames, drawn
from .marks import LABELLED, PAPER, Marks
from .quantity import Quantity, limits, readable

if TYPE_CHECKING:
    import pyvista as pv
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

ROCK, STANDS, INK, SOFT = "#efe9dd", "#dcdcd8", "#33363b", "#5a5f66"
#: Page, inches: its width, and the margins around the model.
PAGE, LEFT, RIGHT, TOP, BOTTOM, ROW = 4.8, 0.52, 1.15, 0.52, 0.5, 0.15
#: Least and largest height of the model, inches.
SHORTEST, TALLEST = 1.3, 5.5
#: Length of the largest force, and of principal stresses, relative to the model.
_ARROW, _CROSS = 0.09, 0.03
#: Number of crosses of principal stress across the model.
_CROSSES = 26


@dataclass(frozen=True)
class View:
    """Constant settings of all frames.

    The range of the field in its own unit, (x0, x1, y0, y1) m as drawn, the factor on displacements, the picture's
    width and, if given, height in pixels.
    """

    limits: tuple[float, float]
    bounds: tuple[float, float, float, float]
    scale: float
    width: int = 800
    height: int | None = None


def view(
    run: Run,
    what: Quantity,
    *,
    scale: float | None = None,
    span: tuple[float, float] | None = None,
    size: tuple[int, int | None] = (800, None),
) -> View:
    """The view for ``what`` over the whole ``run``; ``scale``, ``span`` and ``size`` are as given, or chosen.

    The chosen scale makes displacements visible without overlap of blocks.
    """
    scale = suitable_scale(run) if scale is None else scale
    frames = Frames(run)
    start, end = frames.span()
    end = min(end, frames.cycle_time(final_cycle(run)))
    first, final = frames.grid("blocks", start), frames.grid("blocks", end)
    centre = frames.grid("blocks", 0.5 * (start + end))
    points = np.concatenate([drawn(grid, scale) for grid in (first, centre, final)])
    (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
    return View(limits([run], what) if span is None else span, (x0, x1, y0, y1), scale, *size)


def suitable_scale(run: Run) -> float:
    """Factor that makes the final displacements visible without overlap of blocks; 1 if the run was written in its
    current configuration."""
    frames = Frames(run)
    end = frames.cycle_time(final_cycle(run))
    blocks, interior = frames.grid("blocks", end), frames.grid("interior", end)
    assert blocks is not None  # every run writes its blocks
    if not int(blocks.field_data["REFERENCE"][0]):
        return 1.0
    shown = [grid for grid in (blocks, interior) if grid is not None and grid.n_cells]
    return magnification(shown, float(np.ptp(drawn(blocks, 0.0), axis=0).max()))


class FieldPainter:
    """Draws ``what`` of a run at any time, in the ``view`` that its pictures share.

    For a stress, cracks are also coloured, by ``cracks``: "birth" or "opening".
    """

    def __init__(self, run: Run, what: Quantity, fixed: View, cracks: str = "birth") -> None:
        self.run, self.what, self.view = run, what, fixed
        self.frames = Frames(run)
        self.cracks = CrackLines(self.frames, fixed.scale, cracks if what.stress else None)
        x0, x1, y0, y1 = fixed.bounds
        self.size = max(x1 - x0, y1 - y0)
        self.marks = Marks(self.frames, fixed.scale, self.size)
        unit, self.unit_size = readable(what.unit, max(abs(end) for end in fixed.limits))
        self.unit = unit

    #: The page of the last drawing.
    figure: Figure
    canvas: FigureCanvasAgg

    # -- frames --------------------------------------------------------------------------------------------------

    def draw(self, time: float) -> None:
        """Draw the run at ``time`` (s) of its series, interpolated between written cycles."""
        axes, bar, strip = self._page()
        self.cycle = self._last_cycle(time)
        blocks, interior = self.frames.grid("blocks", time), self.frames.grid("interior", time)
        interior = interior if interior is not None and interior.n_cells else None
        assert blocks is not None  # every run writes its blocks
        self._rock(axes, blocks, interior)
        shown = self._field(axes, blocks, interior, time)
        self._lines(axes, blocks, interior, time)
        keys = self.marks.draw(axes, time)
        self._bars(bar, shown)
        self._words(axes, strip, keys, time)

    def image(self) -> np.ndarray:
        """(height, width, 3) of 8 bits."""
        self.canvas.draw()
        return np.asarray(self.canvas.buffer_rgba())[..., :3].copy()

    def save(self, path: Path) -> Path:
        """Write the last drawing; the suffix gives the format: .png, .pdf or .svg."""
        self.figure.savefig(path, dpi=self.figure.dpi, facecolor="white")
        return path

    # -- page ----------------------------------------------------------------------------------------------------

    def _page(self) -> tuple[Axes, Axes, Axes]:
        """A new page: axes of the model, of its legend, and of the strip below them."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        x0, x1, y0, y1 = self.view.bounds
        pad = 0.07 * self.size
        low, high = np.array([x0 - pad, y0 - pad]), np.array([x1 + pad, y1 + pad])
        wide, tall = high - low
        across = PAGE - LEFT - RIGHT
        strip = 2 * ROW + 0.05
        up = float(np.clip(across * tall / wide, SHORTEST, TALLEST))
        if self.view.height is not None:
            up = max(0.5, PAGE * self.view.height / self.view.width - TOP - BOTTOM - strip)
        page = up + TOP + BOTTOM + strip
        page = round(page * self.view.width / PAGE) * PAGE / self.view.width  # whole pixels
        figure = Figure(figsize=(PAGE, page), dpi=self.view.width / PAGE, facecolor="white")
        self.figure, self.canvas = figure, FigureCanvasAgg(figure)
        axes = figure.add_axes((LEFT / PAGE, (BOTTOM + strip) / page, across / PAGE, up / page))
        bar = figure.add_axes(((PAGE - RIGHT + 0.14) / PAGE, (BOTTOM + strip) / page, 0.13 / PAGE, up / page))
        legend = figure.add_axes((0, 0, 1, strip / page))
        legend.set_axis_off()
        # Equal scales in both directions: the shorter one shows more than the model.
        metres = max(wide / across, tall / up)
        for name, k, inches in (("xlim", 0, across), ("ylim", 1, up)):
            centre = 0.5 * (low[k] + high[k])
            axes.set(**{name: (centre - 0.5 * metres * inches, centre + 0.5 * metres * inches)})
        axes.tick_params(labelsize=7, colors=SOFT, length=2.5, width=0.6)
        for side, spine in axes.spines.items():
            spine.set_visible(side in ("left", "bottom"))
            spine.set_color("#b9bcc2")
            spine.set_linewidth(0.6)
        return axes, bar, legend

    def _bars(self, axes: Axes, shown: Any) -> None:
        """Legend of the field and, below it, of the cracks if they have several colours."""
        from matplotlib.cm import ScalarMappable

        left, low, wide, tall = axes.get_position().bounds
        inches = tall * self.figure.get_size_inches()[1]
        share = 1.0
        if self.cracks.legend and self.cracks.colour is not None:
            share = 0.62
            below = self.figure.add_axes((left, low, wide, 0.3 * tall))
            bar = self.figure.colorbar(ScalarMappable(**self.cracks.style()), cax=below)
            self._fine(bar, CRACK_COLOURS[self.cracks.colour], 0.3 * inches)
            if self.cracks.colour == "birth":
                bar.ax.yaxis.set_major_locator(_whole_numbers())
            axes.set_position((left, low + (1 - share) * tall, wide, share * tall))
        if shown is None:
            axes.set_axis_off()
            return
        extend = "both" if self.what.stress else "max" if self.what.clipped else "neither"
        bar = self.figure.colorbar(shown, cax=axes, extend=extend, extendfrac=0.03)
        name = f"{self.what.title}, {self.unit}" if self.unit else self.what.title
        self._fine(bar, name, share * inches)

    @staticmethod
    def _fine(bar: Any, name: str, inches: float) -> None:
        """Ticks and labels of a legend ``inches`` tall, with long names on several lines."""
        bar.ax.tick_params(labelsize=7, colors=SOFT, length=2.5, width=0.6)
        bar.outline.set_linewidth(0.4)
        bar.set_label(_folded(name, int(inches / _LETTER)), fontsize=7.5, color=INK)

    def _words(self, axes: Axes, strip: Axes, keys: list[Any], time: float) -> None:
        figure = self.figure
        height = figure.get_size_inches()[1]
        title = self.run.title
        figure.text(0.1 / PAGE, 1 - 0.2 / height, title, fontsize=min(9.5, 9.5 * 62 / max(len(title), 1)), color=INK,
                    weight="bold", va="center")  # fmt: skip
        figure.text(0.1 / PAGE, 1 - 0.38 / height, self._caption(time), fontsize=7.5, color=SOFT, va="center")
        x0, x1 = axes.get_xlim()
        length = _round_length(0.22 * (x1 - x0))
        # The scale bar is below the axis, where nothing else is drawn.
        at = axes.get_xaxis_transform()
        y = -0.36 / (axes.get_position().height * height)
        axes.plot([x1 - length, x1], [y, y], color=INK, lw=2.0, transform=at, clip_on=False, solid_capstyle="butt")
        axes.text(x1 - length - 0.01 * (x1 - x0), y, _length(length), transform=at, ha="right", va="center", fontsize=7,
                  color=INK)  # fmt: skip
        unit, size = length_unit(max(map(abs, self.view.bounds)))
        for axis, name in ((axes.xaxis, "x"), (axes.yaxis, "y")):
            axis.set_major_formatter(lambda value, _: f"{value / size:.6g}".replace("-", "\N{MINUS SIGN}"))
            axis.set_label_text(f"{name}, {unit}", fontsize=7, color=SOFT)
            axis.labelpad = 1
        axes.xaxis.set_label_coords(0.05, 0.6 * y)
        if keys:
            strip.legend(handles=keys, loc="center", ncols=min(len(keys), 3), frameon=False, fontsize=7, labelcolor=INK,
                         handlelength=1.8, columnspacing=1.4, borderpad=0, labelspacing=0.3)  # fmt: skip

    def _caption(self, time: float) -> str:
        row = self.run.at(self.cycle)
        caption = [f"t = {time:.5g} s"]
        if self.run.led and np.isfinite(row["load"]):
            caption.append(f"load {stress_text(row['load'])}" + (" in tension" if row["load"] < 0 else ""))
        if abs(self.frames.cycle_time(self.cycle) - time) <= 1e-9 * max(1.0, abs(time)):
            caption.append(f"cycle {self.cycle}")
        if self.view.scale not in (0.0, 1.0):
            caption.append(f"displacements × {self.view.scale:g}")
        return "    ".join(caption)

    def _last_cycle(self, time: float) -> int:
        """The last cycle whose blocks were written up to ``time`` (s)."""
        times = [at for at, _ in self.run.series("blocks")]
        k = max(0, int(np.searchsorted(times, time * (1 + 1e-12), side="right")) - 1)
        return list(self.run.grids("blocks"))[k]

    # -- what is drawn -------------------------------------------------------------------------------------------

    def _style(self) -> dict[str, Any]:
        from matplotlib.colors import Normalize

        low, high = (end / self.unit_size for end in self.view.limits)
        return {"cmap": rock_colours(low, high), "norm": Normalize(low, high)}

    def _rock(self, axes: Axes, blocks: pv.UnstructuredGrid, interior: pv.UnstructuredGrid | None) -> None:
        from matplotlib.collections import PolyCollection

        here = _there(blocks, interior)
        corners = drawn(blocks, self.view.scale)[blocks.cells.reshape(-1, 4)[:, 1:]][here]
        colours = np.where(np.asarray(blocks["fixed"])[here] == 1, STANDS, ROCK)
        axes.add_collection(PolyCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.6, zorder=1))
        if interior is not None:
            corners = drawn(interior, self.view.scale)[interior.cells.reshape(-1, 4)[:, 1:]]
            axes.add_collection(PolyCollection(corners, facecolors=ROCK, edgecolors=ROCK, linewidths=0.6, zorder=1))

    def _field(self, axes: Axes, blocks: pv.UnstructuredGrid, interior: pv.UnstructuredGrid | None, time: float) -> Any:
        shown = None
        for name in reversed(self.what.series):
            grid = blocks if name == "blocks" else interior if name == "interior" else self.frames.grid(name, time)
            if grid is None or not grid.n_cells:
                continue
            values, at_points = self.what.values(name, grid)
            values = values / self.unit_size
            if name in ("blocks", "interior"):
                use = _there(blocks, interior) if name == "blocks" else np.ones(grid.n_cells, bool)
                if name == "blocks" and self.what.stress and interior is not None:
                    continue  # the uniform stress of platens would distract from the specimen's
                if name == "blocks":
                    free = use & (np.asarray(grid["fixed"]) == 0)
                    use = free if free.any() or interior is not None else use
                shown = self._area(axes, grid, values, at_points, use) or shown
                if self.what.name == "principal":
                    self._crosses(axes, grid, use)
            elif self.what.name == "force":
                shown = self._arrows(axes, grid, values)
            elif grid.celltypes[0] == _LINE:
                shown = self._coloured_lines(axes, grid, values, at_points)
            else:
                shown = self._points(axes, grid, values, name)
        return shown

    def _area(self, axes: Axes, grid: pv.UnstructuredGrid, values: np.ndarray, at_points: bool, use: np.ndarray) -> Any:
        from matplotlib.collections import PolyCollection

        if not use.any():
            return None
        points, triangles = drawn(grid, self.view.scale), grid.cells.reshape(-1, 4)[:, 1:][use]
        if at_points:
            if two_signed(*self.view.limits) and values[triangles].min() < 0 < values[triangles].max():
                # In a grey print red and blue look alike: the line between them shows the sign.
                axes.tricontour(*points.T, triangles, values, levels=[0.0], colors=SOFT, linewidths=0.5, zorder=2.5)
            return axes.tripcolor(*points.T, triangles, values, shading="gouraud", zorder=2, rasterized=True,
                                  **self._style())  # fmt: skip
        area = PolyCollection(points[triangles], array=values[use], edgecolors="face", linewidths=0.2, zorder=2,
                              **self._style())  # fmt: skip
        return axes.add_collection(area)

    def _crosses(self, axes: Axes, grid: pv.UnstructuredGrid, use: np.ndarray) -> None:
        """Short lines along the in-plane principal stresses, with proportional length; tension in red."""
        from matplotlib.collections import LineCollection

        triangles = grid.cells.reshape(-1, 4)[:, 1:]
        centre = drawn(grid, self.view.scale)[triangles].mean(axis=1)
        data = grid.cell_data if "stress" in grid.cell_data else None
        stress = np.asarray(
            grid.cell_data["stress"] if data is not None else np.asarray(grid["stress"])[triangles].mean(axis=1)
        )
        low = centre.min(axis=0)
        place = np.floor((centre - low) / (self.size / _CROSSES)).astype(int)
        rows = np.flatnonzero(use)
        _, first = np.unique(place[rows], axis=0, return_index=True)
        rows = rows[first]
        xx, yy, xy = stress[rows][:, 0], stress[rows][:, 1], stress[rows][:, 3]
        turn = 0.5 * np.arctan2(2 * xy, xx - yy)
        mean, half = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
        largest = np.percentile(np.abs(np.concatenate([mean + half, mean - half])), 95) or 1.0
        for value, angle in ((mean + half, turn), (mean - half, turn + 0.5 * np.pi)):
            arm = 0.5 * _CROSS * self.size * np.clip(np.abs(value) / largest, 0, 1.3)[:, None]
            arm = arm * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            lines = np.stack([centre[rows] - arm, centre[rows] + arm], axis=1)
            colours = np.where(value > 0, "#c1121f", "#15161a")
            axes.add_collection(LineCollection([*lines], colors=colours, linewidths=0.8, zorder=4))

    def _arrows(self, axes: Axes, grid: pv.UnstructuredGrid, values: np.ndarray) -> Any:
        """Forces at contacts as lines, their width and colour by magnitude."""
        from matplotlib.collections import LineCollection

        force = np.asarray(grid["force"], float)[:, :2]
        acts = values > 1e-3 * (self.view.limits[1] / self.unit_size)
        centre = drawn(grid, self.view.scale)[acts]
        share = values[acts] * self.unit_size / (self.view.limits[1] or 1.0)
        arm = (
            0.5
            * _ARROW
            * self.size
            * (share / np.maximum(values[acts] * self.unit_size, 1e-300))[:, None]
            * force[acts]
        )
        order = np.argsort(share)
        lines = LineCollection([*np.stack([centre - arm, centre + arm], axis=1)[order]], array=values[acts][order],
                               linewidths=0.7 + 1.6 * share[order], zorder=4, capstyle="round", **self._style())  # fmt: skip
        return axes.add_collection(lines)

    def _coloured_lines(self, axes: Axes, grid: pv.UnstructuredGrid, values: np.ndarray, at_points: bool) -> Any:
        from matplotlib.collections import LineCollection

        ends = grid.cells.reshape(-1, 3)[:, 1:]
        lines = drawn(grid, self.view.scale)[ends]
        axes.add_collection(LineCollection([*lines], colors="white", linewidths=4.2, zorder=5.8, capstyle="round"))
        values = values[ends].mean(axis=1) if at_points else values
        drawn_lines = LineCollection(lines, array=values, linewidths=2.6, zorder=6.2, capstyle="round", **self._style())
        return axes.add_collection(drawn_lines)

    def _points(self, axes: Axes, grid: pv.UnstructuredGrid, values: np.ndarray, name: str) -> Any:
        """Contacts and tips as dots; zero values are left out, so that the others are visible."""
        keep = np.isfinite(values) & (
            np.abs(values) > (1e-3 * self.view.limits[1] / self.unit_size if name == "contacts" else -1)
        )
        order = np.flatnonzero(keep)[np.argsort(np.abs(values[keep]))]
        if self.what.name == "K":
            self._label(axes, drawn(grid, self.view.scale), values, order[::-1])
        size = 34 if name == "tips" else float(np.clip(2e4 / max(len(values), 1), 3, 22))
        x, y = drawn(grid, self.view.scale)[order].T
        return axes.scatter(x, y, c=values[order], s=size, zorder=6.5,
                            edgecolors=INK if name == "tips" else "none", linewidths=0.6, **self._style())  # fmt: skip

    def _label(self, axes: Axes, at: np.ndarray, values: np.ndarray, order: np.ndarray) -> None:
        """Values at the points ``at``, in ``order``, as far as their labels do not overlap."""
        labelled: list[np.ndarray] = []
        for k in order:
            if len(labelled) < LABELLED and all(np.hypot(*(at[k] - other)) > 0.06 * self.size for other in labelled):
                labelled.append(at[k])
                axes.annotate(f"{values[k]:.3g}", at[k], xytext=(5, 3), textcoords="offset points", fontsize=7, color=INK,
                              zorder=9, bbox=PAPER)  # fmt: skip

    def _lines(
        self, axes: Axes, blocks: pv.UnstructuredGrid, interior: pv.UnstructuredGrid | None, time: float
    ) -> None:
        """Outlines of the blocks, thinner if there are many, and cracks."""
        from matplotlib.collections import LineCollection

        many = int(np.asarray(blocks["block_id"]).max()) + 1
        thin = float(np.clip(1.0 / (max(many, 10) / 10) ** 0.3, 0.2, 1.0))
        here = _there(blocks, interior)
        for grid, use in ((blocks, here), (interior, None)):
            if grid is not None:
                edges = _edges(grid, use)
                lines = drawn(grid, self.view.scale)[edges]
                axes.add_collection(LineCollection(lines, colors=INK, linewidths=thin, zorder=5, capstyle="round"))
                self.cracks.draw_walls(axes, grid, edges, self.cycle)
        self.cracks.draw(axes, time, interior)


_LINE = 3
#: Width of a letter in a legend, inches.
_LETTER = 0.055


def _there(blocks: pv.UnstructuredGrid, interior: pv.UnstructuredGrid | None) -> np.ndarray:
    """(n_cells,) True for triangles of existing blocks that are not drawn by the interior."""
    there = np.asarray(blocks["removed"]) == 0
    return there if interior is None else there & ~np.isin(blocks["block_id"], np.unique(interior["block_id"]))


def _edges(grid: pv.UnstructuredGrid, use: np.ndarray | None) -> np.ndarray:
    """(n, 2) point indices of the edges that belong to one triangle only."""
    triangles = grid.cells.reshape(-1, 4)[:, 1:]
    triangles = triangles if use is None else triangles[use]
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    found, count = np.unique(edges, axis=0, return_counts=True)
    return found[count == 1]


def _folded(text: str, most: int) -> str:
    """``text`` on lines of ``most`` letters, or of one longer word."""
    return "\n".join(textwrap.wrap(text, max(most, 1), break_long_words=False, break_on_hyphens=False))


def _whole_numbers() -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(nbins=4, integer=True)


def _round_length(about: float) -> float:
    power = 10.0 ** np.floor(np.log10(about))
    return float(power * max(digit for digit in (1, 2, 5) if digit * power <= about * (1 + 1e-9)))


def _length(metres: float) -> str:
    return f"{metres:g} m" if metres >= 1 else f"{1e2 * metres:g} cm" if metres >= 0.05 else f"{1e3 * metres:g} mm"
