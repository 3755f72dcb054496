"""One picture of a run: stress in the rock, cracks coloured by when they grew, drawn deformed, without a screen."""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np

from geomech.output.reading import Run

from . import offscreen
from .look import COMPONENTS, CRACK_COLOURS, Look, interior_grid, values

if TYPE_CHECKING:
    import pyvista as pv
    from matplotlib.colors import Colormap

_ROCK_OUTLINE, _INK, _IDLE = "#3b3f46", "#1b1d21", "#e4e4e1"
_OLD_CRACK = "#15161a"


def picture(run: Run, path: Path, fixed: Look, cycle: int) -> Path:
    """Draw ``cycle`` of ``run`` into the PNG ``path``. Raises RenderingUnavailable where no window can be opened."""
    with Painter(run, fixed) as painter:
        painter.draw(cycle)
        painter.save(path)
    return path


class Painter:
    """One off-screen window, drawn into again and again."""

    def __init__(self, run: Run, fixed: Look) -> None:
        offscreen.ready()
        import pyvista as pv

        self.run, self.look = run, fixed
        x0, x1, y0, y1 = fixed.bounds
        w, h = x1 - x0, y1 - y0
        # Pixels: margins, the strip of the title, the strip of the legend; the drawing takes the rest.
        self.unit = fixed.width / 800
        side, top = 24 * self.unit, 74 * self.unit
        legend = (210 if fixed.upright else 96) * self.unit
        if fixed.upright:
            drawing = (fixed.width - legend - 2 * side, None)
            height = min(drawing[0] * h / w, 900 * self.unit)
            self.size = (fixed.width, round(height + top + side))
            self.centre = (side + 0.5 * drawing[0], side + 0.5 * height)
            self.metres_per_pixel = max(w / drawing[0], h / height)
        else:
            drawing = (fixed.width - 2 * side, None)
            height = drawing[0] * h / w
            self.size = (fixed.width, round(height + top + legend))
            self.centre = (0.5 * fixed.width, legend + 0.5 * height)
            self.metres_per_pixel = w / drawing[0]
        self.plotter = pv.Plotter(off_screen=True, window_size=self.size, border=False)
        self.plotter.set_background("white")
        self.plotter.enable_anti_aliasing("msaa", multi_samples=8)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.plotter.close()

    def image(self) -> np.ndarray:
        """(height, width, 3) of 8 bits."""
        return np.array(self.plotter.screenshot(return_img=True))

    def save(self, path: Path) -> None:
        self.plotter.screenshot(str(path))

    def draw(self, cycle: int) -> None:
        # Every actor that is added would draw the window anew.
        self.plotter.suppress_rendering = True
        self.plotter.clear()
        self._rock(cycle)
        self._cracks(cycle)
        self._camera()
        self._words(cycle)
        self.plotter.suppress_rendering = False
        self.plotter.render()

    def _warped(self, grid: pv.UnstructuredGrid, lift: float) -> pv.UnstructuredGrid:
        """``grid`` deformed, ``lift`` pixels above the page."""
        height = lift * self.metres_per_pixel
        grid.points = grid.points + self.look.scale * grid["displacement"] + (0.0, 0.0, height)
        return grid

    def _rock(self, cycle: int) -> None:
        blocks, interior = self._warped(self.run.grid("blocks", cycle), 0.0), interior_grid(self.run, cycle)
        solved = set() if interior is None else set(np.unique(interior["block_id"]).tolist())
        here = np.isin(blocks["block_id"], list(solved))
        # Beside a solved specimen, other materials (platens) only hold it: their stress would take attention off it.
        idle = ~np.isin(blocks["material"], np.unique(blocks["material"][here])) if solved else blocks["fixed"] == 1
        if idle.any():
            self.plotter.add_mesh(blocks.extract_cells(idle), color=_IDLE, lighting=False)
        plain = ~here & ~idle
        if plain.any():
            self._filled(blocks.extract_cells(plain))
        if interior is not None:
            self._filled(self._warped(interior, 1.0))
        # A solved block is outlined as it deforms, crack faces included; the others by their own straight edges.
        self._outlined(blocks.extract_cells(~here))
        if interior is not None:
            self._outlined(interior)

    def _outlined(self, grid: pv.UnstructuredGrid) -> None:
        if not grid.n_cells:
            return
        edges = grid.extract_surface(algorithm="dataset_surface").extract_feature_edges(
            boundary_edges=True, feature_edges=False, non_manifold_edges=False, manifold_edges=False
        )
        edges.points += (0.0, 0.0, 2.0 * self.metres_per_pixel)
        self.plotter.add_mesh(edges, color=_ROCK_OUTLINE, line_width=1.4 * self.unit, lighting=False)

    def _filled(self, grid: pv.UnstructuredGrid) -> None:
        grid["fill"] = values(grid, self.look.component)
        self.plotter.add_mesh(
            grid, scalars="fill", cmap=self.look.colours, clim=self.look.limits, n_colors=256,
            lighting=False, show_scalar_bar=False, copy_mesh=False,
        )  # fmt: skip

    def _cracks(self, cycle: int) -> None:
        try:
            grid = self.run.grid("cracks", cycle)
        except KeyError:
            return
        if not grid.n_cells:
            return
        lines = self._warped(grid, 40.0)
        lines["opening"] = 1e6 * lines["opening"]
        by_birth = self.look.cracks == "birth"
        # What the scene drew has no birth to show: black. Openings are shown on all of a crack.
        old = np.asarray(lines["birth_cycle"]) == 0 if by_birth else np.zeros(lines.n_cells, bool)
        low, high = self.look.crack_limits
        fill = {
            "scalars": "birth_cycle" if by_birth else "opening",
            "cmap": _crack_colours(),
            "clim": (low, high if high > low else low + 1),
            "nan_color": _OLD_CRACK,
        }
        halo = lines.copy()
        halo.points -= (0.0, 0.0, 20.0 * self.metres_per_pixel)
        self.plotter.add_mesh(
            halo, color="white", line_width=7.5 * self.unit, render_lines_as_tubes=True, lighting=False, opacity=0.75
        )
        for part, width, shown in ((~old, 4.0, fill), (old, 4.6, {"color": _OLD_CRACK})):
            if part.any():
                self.plotter.add_mesh(
                    lines.extract_cells(part), line_width=width * self.unit, render_lines_as_tubes=True,
                    lighting=False, show_scalar_bar=False, **shown,
                )  # fmt: skip

    def _camera(self) -> None:
        x0, x1, y0, y1 = self.look.bounds
        # The focal point is the window's middle; the drawing's middle is to land on ``centre``.
        shift_x = (0.5 * self.size[0] - self.centre[0]) * self.metres_per_pixel
        shift_y = (0.5 * self.size[1] - self.centre[1]) * self.metres_per_pixel
        focus = (0.5 * (x0 + x1) + shift_x, 0.5 * (y0 + y1) + shift_y)
        far = 10 * max(x1 - x0, y1 - y0)
        camera = self.plotter.camera
        camera.parallel_projection = True
        camera.focal_point = (*focus, 0.0)
        camera.position = (*focus, far)
        camera.up = (0.0, 1.0, 0.0)
        camera.parallel_scale = 0.5 * self.size[1] * self.metres_per_pixel
        camera.clipping_range = (0.5 * far, 2 * far)

    def _words(self, cycle: int) -> None:
        row = self.run.at(cycle)
        w, h = self.size
        u = self.unit
        said = []
        if np.isfinite(row["load"]):
            said.append(f"load {row['load'] / 1e6:.2f} MPa")
        said += [f"t = {_round(row['time'])} s", f"cycle {int(row['cycle'])}"]
        if self.look.scale not in (0.0, 1.0):
            said.append(f"displacements × {self.look.scale:g}")
        self._text(self.run.title, (24 * u, h - 38 * u), 15)
        self._text("     ".join(said), (24 * u, h - 64 * u), 11, "#4a4e55")
        name = COMPONENTS[self.look.component][2]
        low, high = self.look.limits
        if self.look.upright:
            left = w - 190 * u
            self._bar(self.look.colours, low, high, (left, h - 400 * u, 26 * u, 260 * u))
            self._text(f"{name}, MPa", (left, h - 128 * u), 12)
            self._text("tension positive", (left, h - 428 * u), 9, "#4a4e55")
            below = (left, 60 * u, 26 * u, 150 * u)
        else:
            self._bar(self.look.colours, low, high, (24 * u, 44 * u, 0.45 * w, 18 * u))
            self._text(f"{name}, MPa (tension positive)", (24 * u, 68 * u), 11)
            below = (0.62 * w, 44 * u, 0.3 * w, 18 * u)
        first, last = self.look.crack_limits
        if last > first:
            self._bar(_crack_colours(), first, last, below, whole=self.look.cracks == "birth")
            self._text(CRACK_COLOURS[self.look.cracks], (below[0], below[1] + below[3] + 10 * u), 11)

    def _text(self, text: str, at: tuple[float, float], size: float, colour: str = _INK) -> None:
        # VTK's own fonts have no Greek.
        self.plotter.add_text(text, position=at, font_size=size * self.unit, color=colour, font_file=_font())

    def _bar(
        self, colours: Colormap, low: float, high: float, box: tuple[float, float, float, float], whole: bool = False
    ) -> None:
        """A scalar bar drawn as an actor of its own, since several meshes share it and its labels are to be round."""
        import pyvista as pv
        from vtkmodules.vtkRenderingCore import vtkActor2D, vtkCoordinate, vtkPolyDataMapper2D

        x, y, w, h = box
        upright, n = h > w, 256
        t = np.linspace(0.0, 1.0, n + 1)
        across = np.array([0.0, 1.0])
        gx, gy = np.meshgrid(x + w * across, y + h * t) if upright else np.meshgrid(x + w * t, y + h * across)
        strip = pv.StructuredGrid(gx, gy, np.zeros_like(gx)).extract_surface(algorithm="dataset_surface")
        strip.cell_data["colour"] = (255 * colours(np.linspace(0, 1, n))[:, :3]).astype(np.uint8)
        mapper = vtkPolyDataMapper2D()
        mapper.SetInputData(strip)
        mapper.SetScalarModeToUseCellData()
        place = vtkCoordinate()
        place.SetCoordinateSystemToDisplay()
        mapper.SetTransformCoordinate(place)
        actor = vtkActor2D()
        actor.SetMapper(mapper)
        self.plotter.add_actor(actor, render=False)
        for value in _ticks(low, high, max(2, int(max(w, h) / (45 if upright else 80) / self.unit)), whole):
            f = (value - low) / (high - low)
            beside = (x + w + 10 * self.unit, y + h * f - 8 * self.unit)
            at = beside if upright else (x + w * f - 8 * self.unit, y - 26 * self.unit)
            self._text(_round(value), at, 10)


def _ticks(low: float, high: float, most: int, whole: bool = False) -> list[float]:
    """Round numbers from ``low`` to ``high``, at most about ``most``; ``whole`` ones where asked."""
    least = (high - low) / most
    step = 10.0 ** math.floor(math.log10(least))
    step *= next(m for m in (1, 2, 5, 10) if m * step >= least * (1 - 1e-9))
    if whole:
        step = max(1.0, step)
    return [k * step for k in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


@lru_cache(maxsize=1)
def _crack_colours() -> Colormap:
    """From crimson to orange: apart from every colour that rock is filled with."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("crack", ["#8f0d33", "#d7263d", "#ff7a1a", "#ffb01f"])


@lru_cache(maxsize=1)
def _font() -> str:
    import matplotlib

    return str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf")


def _round(value: float) -> str:
    return f"{value:.6g}".replace("-", "\N{MINUS SIGN}")
