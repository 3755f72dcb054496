"""Words and colour bars on a picture, placed in pixels from its lower left corner."""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pyvista as pv
    from matplotlib.colors import Colormap

INK, SOFT_INK = "#1b1d21", "#4a4e55"
#: Width of a letter in pixels for each unit of size, for fitting words to a width.
_LETTER = 1.08


class Legend:
    """Writes on ``plotter``; ``unit`` pixels stand for one of a picture 800 wide."""

    def __init__(self, plotter: pv.Plotter, unit: float) -> None:
        self.plotter, self.unit = plotter, unit

    def text(
        self, text: str, at: tuple[float, float], size: float, colour: str = INK, width: float | None = None
    ) -> float:
        """``text`` from ``at`` on, smaller where it would be longer than ``width``; the size it got."""
        if width is not None and text:
            size = min(size, width / (_LETTER * len(text) * self.unit))
        # VTK's own fonts have no Greek.
        self.plotter.add_text(text, position=at, font_size=size * self.unit, color=colour, font_file=_font())
        return size

    def bar(
        self,
        colours: Colormap,
        limits: tuple[float, float],
        box: tuple[float, float, float, float],
        beyond: tuple[bool, bool] = (False, False),
        whole: bool = False,
    ) -> None:
        """A colour bar over ``limits`` in ``box`` (x, y, width, height), upright if it is taller than wide, pointed at
        an end that there is something ``beyond``; its labels are round, ``whole`` ones where asked."""
        import pyvista as pv
        from vtkmodules.vtkRenderingCore import vtkActor2D, vtkCoordinate, vtkPolyDataMapper2D

        (x, y, w, h), (low, high) = box, limits
        upright, n = h > w, 256
        long, across = max(w, h), min(w, h)
        # Along the bar and across it; the points are as long as the bar is broad, less a bit.
        strip = [[(k / n * long, 0.0), ((k + 1) / n * long, 0.0), ((k + 1) / n * long, across), (k / n * long, across)]
                 for k in range(n)]  # fmt: skip
        at = list(np.linspace(0, 1, n))
        for end, sign, there in ((0.0, -1, beyond[0]), (long, 1, beyond[1])):
            if there:
                strip.append([(end, 0.0), (end + 0.7 * sign * across, 0.5 * across), (end, across), (end, across)])
                at.append(0.0 if sign < 0 else 1.0)
        corners = np.array(strip)
        corners = (corners[..., ::-1] if upright else corners) + (x, y)
        points = np.concatenate([corners.reshape(-1, 2), np.zeros((4 * len(at), 1))], axis=1)
        faces = np.column_stack([np.full(len(at), 4), np.arange(4 * len(at)).reshape(-1, 4)])
        mesh = pv.PolyData(points, faces.ravel())
        mesh.cell_data["colour"] = (255 * colours(np.array(at))[:, :3]).round().astype(np.uint8)
        mapper = vtkPolyDataMapper2D()
        mapper.SetInputData(mesh)
        mapper.SetScalarModeToUseCellData()
        place = vtkCoordinate()
        place.SetCoordinateSystemToDisplay()
        mapper.SetTransformCoordinate(place)
        actor = vtkActor2D()
        actor.SetMapper(mapper)
        self.plotter.add_actor(actor, render=False)
        for value in ticks(low, high, max(2, int(long / (40 if upright else 80) / self.unit)), whole):
            f = (value - low) / (high - low)
            beside = (x + w + 10 * self.unit, y + h * f - 8 * self.unit)
            self.text(rounded(value), beside if upright else (x + w * f - 8 * self.unit, y - 26 * self.unit), 10)


def ticks(low: float, high: float, most: int, whole: bool = False) -> list[float]:
    """Round numbers from ``low`` to ``high``, at most about ``most``; ``whole`` ones where asked."""
    least = (high - low) / most
    step = 10.0 ** math.floor(math.log10(least))
    enough = next(m for m in (1, 2, 5, 10) if m * step >= least * (1 - 1e-9))
    # One number is no scale: a finer step where only one of the round ones lies between.
    finer = {10: 5, 5: 2, 2: 1, 1: 0.5}[enough]
    step *= enough if math.floor(high / (enough * step)) > math.ceil(low / (enough * step)) else finer
    if whole:
        step = max(1.0, step)
    return [k * step for k in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


def rounded(value: float) -> str:
    """``value`` in six digits with a true minus."""
    return f"{value:.6g}".replace("-", "\N{MINUS SIGN}")


@lru_cache(maxsize=1)
def crack_colours() -> Colormap:
    """From crimson to orange: apart from every colour that rock is filled with."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("crack", ["#8f0d33", "#d7263d", "#ff7a1a", "#ffb01f"])


@lru_cache(maxsize=1)
def _font() -> str:
    import matplotlib

    return str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf")
