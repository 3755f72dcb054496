"""One picture of a run: stress in the rock, cracks coloured by when they grew, drawn deformed, without a screen."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np

from geomech.output.reading import Run
from geomech.output.units import stress_text, stress_unit

from . import offscreen
from .field import COMPONENTS, face_displacements, interior_grid, values
from .legend import SOFT_INK, Legend, crack_colours, rounded
from .look import CRACK_COLOURS, Look, filled_cells
from .walls import Walls, reference

if TYPE_CHECKING:
    import pyvista as pv

ROCK_OUTLINE, IDLE, OLD_CRACK = "#3b3f46", "#e4e4e1", "#15161a"
# Layers above the page, pixels: rock, its outlines, white about cracks, cracks.
_FIELD, _OUTLINES, _HALO, _CRACKS = 1.0, 2.0, 20.0, 40.0
# Drawn so many times larger and then averaged: OpenGL's own multisampling leaves wide lines jagged and takes longer.
_FINER = 2


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

        self.run, self.look, self.walls = run, fixed, Walls.of(run)
        x0, x1, y0, y1 = fixed.bounds
        w, h = x1 - x0, y1 - y0
        # Pixels: margins, the strip of the title, the strip of the legend; the drawing takes the rest.
        width = _FINER * fixed.width
        self.unit = width / 800
        side, top = 24 * self.unit, 74 * self.unit
        legend = (210 if fixed.upright else 96) * self.unit
        if fixed.upright:
            drawing = width - legend - 2 * side
            height = min(drawing * h / w, 900 * self.unit)
            self.size = (width, _FINER * round((height + top + side) / _FINER))
            self.centre = (side + 0.5 * drawing, side + 0.5 * height)
        else:
            drawing = width - 2 * side
            height = drawing * h / w
            self.size = (width, _FINER * round((height + top + legend) / _FINER))
            self.centre = (0.5 * width, legend + 0.5 * height)
        self.metres_per_pixel = max(w / drawing, h / height)
        self.plotter = pv.Plotter(off_screen=True, window_size=self.size, border=False)
        self.plotter.set_background("white")
        self.plotter.disable_anti_aliasing()
        self.legend = Legend(self.plotter, self.unit)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.plotter.close()

    def image(self) -> np.ndarray:
        """(height, width, 3) of 8 bits."""
        fine = np.asarray(self.plotter.screenshot(return_img=True))[..., :3]
        offsets = product(range(_FINER), repeat=2)
        total = sum(fine[i::_FINER, j::_FINER].astype(np.uint16) for i, j in offsets)
        return ((total + _FINER**2 // 2) // _FINER**2).astype(np.uint8)

    def save(self, path: Path) -> None:
        from PIL import Image

        Image.fromarray(self.image()).save(path, optimize=True)

    def draw(self, cycle: int) -> None:
        # Every actor that is added would draw the window anew.
        self.plotter.suppress_rendering = True
        self.plotter.clear()
        interior = interior_grid(self.run, cycle)
        self._cracks(cycle, interior)
        self._rock(cycle, interior)
        self._camera()
        self._words(cycle)
        self.plotter.suppress_rendering = False
        self.plotter.render()

    def _warped(self, grid: pv.UnstructuredGrid, lift: float) -> pv.UnstructuredGrid:
        """``grid`` deformed, ``lift`` pixels above the page; where its points were is kept."""
        grid["reference"] = reference(grid)
        grid.points = self._moved(np.asarray(grid.points), np.asarray(grid["displacement"]), lift)
        return grid

    def _moved(self, points: np.ndarray, displacement: np.ndarray, lift: float) -> np.ndarray:
        return points + self.look.scale * displacement + (0.0, 0.0, lift * self.metres_per_pixel)

    # -- rock ----------------------------------------------------------------------------------------------------

    def _rock(self, cycle: int, interior: pv.UnstructuredGrid | None) -> None:
        blocks = self._warped(self.run.grid("blocks", cycle), 0.0)
        solved = set() if interior is None else set(np.unique(interior["block_id"]).tolist())
        here = np.isin(blocks["block_id"], list(solved))
        idle = ~filled_cells(blocks, self.look.rock) & ~here
        if idle.any():
            self.plotter.add_mesh(blocks.extract_cells(idle), color=IDLE, lighting=False)
        plain = ~here & ~idle
        if plain.any():
            self._filled(blocks.extract_cells(plain))
        if interior is not None:
            self._filled(self._warped(interior, _FIELD))
        # A solved block is outlined as it deforms, crack faces included; the others by their own straight edges.
        self._outlined(blocks.extract_cells(~here), cycle)
        if interior is not None:
            self._outlined(interior, cycle)

    def _outlined(self, grid: pv.UnstructuredGrid, cycle: int) -> None:
        if not grid.n_cells:
            return
        edges = grid.extract_surface(algorithm="dataset_surface").extract_feature_edges(
            boundary_edges=True, feature_edges=False, non_manifold_edges=False, manifold_edges=False
        )
        edges.points += (0.0, 0.0, _OUTLINES * self.metres_per_pixel)
        self.plotter.add_mesh(edges, color=ROCK_OUTLINE, line_width=1.4 * self.unit, lighting=False)
        if self.look.cracks != "birth" or not len(self.walls.cut):
            return
        lines = np.asarray(edges["reference"])[edges.lines.reshape(-1, 3)[:, 1:]]
        edges.cell_data["birth_cycle"] = birth = self.walls.births(lines, cycle)
        if (birth >= 0).any():
            walls = edges.extract_cells(birth >= 0)
            walls.points += (0.0, 0.0, _HALO * self.metres_per_pixel)
            self._crack_lines(walls, np.asarray(walls["birth_cycle"]) == 0)

    def _filled(self, grid: pv.UnstructuredGrid) -> None:
        grid["fill"] = values(grid, self.look.component)
        self.plotter.add_mesh(
            grid, scalars="fill", cmap=self.look.colours, clim=self.look.limits, n_colors=256,
            lighting=False, show_scalar_bar=False, copy_mesh=False,
        )  # fmt: skip

    # -- cracks --------------------------------------------------------------------------------------------------

    def _cracks(self, cycle: int, interior: pv.UnstructuredGrid | None) -> None:
        """Cracks as wide as they are open, and never thinner than a line, on a white halo."""
        try:
            grid = self.run.grid("cracks", cycle)
        except KeyError:
            return
        if not grid.n_cells:
            return
        affine = np.asarray(grid["displacement"])
        upper = lower = affine
        if interior is not None and self.look.scale:
            # The block's own motion where the mesh has no face: a crack that is newer than the field.
            found = face_displacements(interior, grid)
            known = np.isfinite(found[0]).all(axis=1) & np.isfinite(found[1]).all(axis=1)
            upper, lower = (np.where(known[:, None], face, affine) for face in found)
        lines = grid.copy()
        lines["opening"] = 1e6 * lines["opening"]
        by_birth = self.look.cracks == "birth"
        # What the scene drew has no birth to show: black. Openings are shown on all of a crack.
        old = np.asarray(lines["birth_cycle"]) == 0 if by_birth else np.zeros(lines.n_cells, bool)
        at = np.asarray(grid.points)
        for face in (upper, lower):
            halo = lines.copy()
            halo.points = self._moved(at, face, _HALO)
            self.plotter.add_mesh(
                halo,
                color="white",
                line_width=7.5 * self.unit,
                render_lines_as_tubes=True,
                lighting=False,
                opacity=0.75,
            )
        lines.points = self._moved(at, 0.5 * (upper + lower), _CRACKS)
        gaps = self._gaps(lines, self._moved(at, upper, _CRACKS), self._moved(at, lower, _CRACKS))
        self._crack_lines(lines, old, gaps)

    def _crack_lines(self, lines: pv.UnstructuredGrid, old: np.ndarray, gaps: pv.PolyData | None = None) -> None:
        """``lines`` in their colours, with the ``gaps`` between their faces; black where they are ``old``."""
        low, high = self.look.crack_limits
        by_birth = self.look.cracks == "birth"
        fill = {
            "scalars": "birth_cycle" if by_birth else "opening",
            "cmap": crack_colours(),
            "clim": (low, high if high > low else low + 1),
            "nan_color": OLD_CRACK,
            "show_scalar_bar": False,
        }
        for part, width, shown in ((~old, 4.0, fill), (old, 4.6, {"color": OLD_CRACK})):
            if part.any():
                if gaps is not None:
                    self.plotter.add_mesh(gaps.extract_cells(part), lighting=False, **shown)
                self.plotter.add_mesh(
                    lines.extract_cells(part), line_width=width * self.unit, render_lines_as_tubes=True,
                    lighting=False, **shown,
                )  # fmt: skip

    @staticmethod
    def _gaps(lines: pv.UnstructuredGrid, upper: np.ndarray, lower: np.ndarray) -> pv.PolyData:
        """A quadrilateral a line, between its two faces, with the lines' arrays."""
        import pyvista as pv

        a, b = lines.cells.reshape(-1, 3)[:, 1:].T
        n = len(upper)
        gaps = pv.PolyData(
            np.concatenate([upper, lower]),
            np.column_stack([np.full(len(a), 4), a, b, b + n, a + n]).ravel(),
        )
        gaps.cell_data["birth_cycle"] = lines.cell_data["birth_cycle"]
        gaps.point_data["opening"] = np.tile(lines.point_data["opening"], 2)
        return gaps

    # -- page ----------------------------------------------------------------------------------------------------

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
        row, text, bar = self.run.at(cycle), self.legend.text, self.legend.bar
        w, h = self.size
        u = self.unit
        said = []
        if self.run.led and np.isfinite(row["load"]):
            pulled = " in tension" if row["load"] < 0 else ""
            said.append(f"load {stress_text(row['load'])}{pulled}")
        said += [f"t = {rounded(row['time'])} s", f"cycle {int(row['cycle'])}"]
        if self.look.scale not in (0.0, 1.0):
            said.append(f"displacements × {self.look.scale:g}")
        letters = text(self.run.title, (24 * u, h - 38 * u), 15, width=w - 48 * u)
        text("     ".join(said), (24 * u, h - 64 * u), min(11, letters), SOFT_INK, width=w - 48 * u)
        name, limits, beyond = COMPONENTS[self.look.component][2], self.look.limits, self.look.beyond
        unit, size = stress_unit(1e6 * max(map(abs, limits)))
        limits = tuple(1e6 / size * limit for limit in limits)
        grown = self.look.crack_limits[1] > self.look.crack_limits[0]
        if self.look.upright:
            # From the top down: title, bar, note, title, bar; the bars give way where the drawing is not tall.
            left, top = w - 190 * u, h - 100 * u
            spare = top - 24 * u - (150 if grown else 80) * u
            tall = min(260 * u, spare * (0.65 if grown else 1.0))
            low = top - 62 * u - tall
            text(f"{name}, {unit}", (left, top - 28 * u), 12)
            bar(self.look.colours, limits, (left, low, 26 * u, tall), beyond)
            text("tension positive", (left, low - 44 * u), 9, SOFT_INK)
            short = min(150 * u, spare * 0.35)
            below = (left, low - 100 * u - short, 26 * u, short)
        else:
            bar(self.look.colours, limits, (44 * u, 44 * u, 0.45 * w, 18 * u), beyond)
            text(f"{name}, {unit} (tension positive)", (44 * u, 68 * u), 11)
            below = (0.62 * w, 44 * u, 0.3 * w, 18 * u)
        if grown:
            bar(crack_colours(), self.look.crack_limits, below, whole=self.look.cracks == "birth")
            text(CRACK_COLOURS[self.look.cracks], (below[0], below[1] + below[3] + 12 * u), 11)
