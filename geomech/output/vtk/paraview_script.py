"""``view.py`` in a run folder: opens every series of the run in ParaView, with suitable colours."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from geomech.model import Problem

from ..observer import Observer
from .paraview_state import drawable, view_state
from .series import Series

_SCRIPT = '''"""Opens this run in ParaView: `paraview --script=view.py`, File > Load State, or without a screen
`pvbatch view.py --picture view.png --state view.pvsm`.

Written by geomech into the run folder; change it as you like. Where a point is now = points + REFERENCE x
displacement: coordinates are the {configuration} ones{warped}.
"""

import argparse
import math
import os
from pathlib import Path

from paraview import simple as pv

HERE = Path(globals().get("__file__", "view.py")).resolve().parent
#: Magnification of displacements; 1 is true to scale, None magnifies those too small to be visible.
SCALE = {scale!r}
REFERENCE = {reference}


def series(name):
    """The reader of the series `name`, at its last time; None where the run has not written it."""
    listed, one = HERE / (name + ".pvd"), HERE / (name + ".vtkhdf")
    if listed.is_file():
        source = pv.PVDReader(registrationName=name, FileName=str(listed))
    elif one.is_file():
        source = pv.OpenDataFile(str(one), registrationName=name)
    else:
        return None
    source.UpdatePipeline(source.TimestepValues[-1] if len(source.TimestepValues) else 0.0)
    return source


def span(source, place, array, component=None):
    """The range of an array without the outermost 0.7 % at either end: stress at a crack tip is singular."""
    import numpy as np
    from vtkmodules.util.numpy_support import vtk_to_numpy

    data = pv.servermanager.Fetch(source)
    held = (data.GetPointData() if place == "POINTS" else data.GetCellData()).GetArray(array)
    if held is None or not held.GetNumberOfTuples():
        return 0.0, 1.0
    values = vtk_to_numpy(held)
    if values.ndim > 1:
        values = np.linalg.norm(values, axis=1) if component is None else values[:, component]
    values = values[np.isfinite(values)]
    if not len(values):
        return 0.0, 1.0
    low, high = np.percentile(values, [0.7, 99.3])
    # A uniform field gets a band about its value, or colours would show round-off.
    band = max(0.5 * (high - low), 0.05 * max(abs(low), abs(high)), 1e-30)
    return float(0.5 * (low + high) - band), float(0.5 * (low + high) + band)


def names(source, array):
    """The names that a file holds in its field data, one a line."""
    data = pv.servermanager.Fetch(source).GetFieldData().GetArray(array)
    return [] if data is None else bytes(int(data.GetValue(k)) for k in range(data.GetNumberOfTuples())).decode().split("\\n")


def named(array, known):
    """Colours of `array`, a number each, with the names that stand for them."""
    colours = pv.GetColorTransferFunction(array)
    colours.Annotations = [text for k, name in enumerate(known) for text in (str(k), name)]


def magnification(blocks):
    """What makes the largest displacement 3 % of the model where it is below 0.2 %: 1, 2 or 5 times a power of ten."""
    if SCALE is not None or blocks is None:
        return 1.0 if SCALE is None else SCALE
    bounds = blocks.GetDataInformation().GetBounds()
    size = max(bounds[1] - bounds[0], bounds[3] - bounds[2])
    largest = max(abs(end) for k in (0, 1) for end in blocks.PointData["displacement"].GetRange(k))
    if not 0.0 < largest < 0.002 * size:
        return 1.0
    wanted = 0.03 * size / largest
    power = 10.0 ** math.floor(math.log10(wanted))
    return power * max(digit for digit in (1.0, 2.0, 5.0) if digit * power <= wanted)


def moved(source, name, scale):
    """`source` where its displacement, magnified, has moved it."""
    if source is None or not REFERENCE or "displacement" not in source.PointData.keys():
        return source
    warp = pv.WarpByVector(registrationName=name + " moved", Input=source)
    warp.Vectors = ["POINTS", "displacement"]
    warp.ScaleFactor = scale
    return warp


def coloured(source, view, place, array, preset="Cool to Warm", bar=True):
    """`source` shown in `view`, coloured by `array`."""
    display = pv.Show(source, view)
    data = source.CellData if place == "CELLS" else source.PointData
    if array not in data.keys() or data[array].GetNumberOfTuples() == 0:
        return display
    pv.ColorBy(display, (place, array))
    colours = pv.GetColorTransferFunction(array)
    colours.ApplyPreset(preset, True)
    display.SetScalarBarVisibility(view, bar)
    if bar:
        legend = pv.GetScalarBar(colours, view)
        legend.TitleColor = legend.LabelColor = [0.1, 0.1, 0.1]
        legend.TitleFontSize, legend.LabelFontSize = 9, 8
        legend.Orientation, legend.WindowLocation = "Vertical", "Any Location"
        legend.Position, legend.ScalarBarLength = [0.82, 0.3], 0.45
    return display


def arrows(source, view, name, direction, size, rock):
    """Arrows of `size` along `direction` at the points of `source`: the longest is a tenth of the model."""
    glyph = pv.Glyph(registrationName=name, Input=source, GlyphType="Arrow")
    glyph.OrientationArray = ["POINTS", direction]
    glyph.ScaleArray = ["POINTS", size]
    glyph.GlyphMode = "All Points"
    largest = span(source, "POINTS", size)[1]
    bounds = rock.GetDataInformation().GetBounds()
    size = max(bounds[1] - bounds[0], bounds[3] - bounds[2])
    glyph.ScaleFactor = 0.1 * size / largest if largest > 1e-20 else 1.0  # nothing acts
    return pv.Show(glyph, view)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--picture", help="write a picture of the last cycle here")
    parser.add_argument("--state", help="write a ParaView state that opens all of this here")
    options, _ = parser.parse_known_args()
    pv._DisableFirstRenderCameraReset()
    view = pv.GetActiveViewOrCreate("RenderView")
    if hasattr(view, "UseColorPaletteForBackground"):
        view.UseColorPaletteForBackground = 0
    view.Background = [1.0, 1.0, 1.0]
    view.InteractionMode = "2D"
    view.OrientationAxesVisibility = 0

    rock = series("blocks")
    scale = magnification(rock)
    known = ("outlines", "interior", "cracks", "tips", "contacts", "bolts", "water")
    sources = dict((name, moved(series(name), name, scale)) for name in known)
    outlines, interior, cracks, tips, contacts, bolts, water = (sources[name] for name in known)
    blocks = moved(rock, "blocks", scale)
    if blocks is not None:
        display = coloured(blocks, view, "POINTS", "displacement", preset="Viridis (matplotlib)", bar=interior is None)
        display.SetRepresentationType("Surface")
        display.Ambient, display.Diffuse = 1.0, 0.0
    if interior is not None:
        # Compression is negative: the last of the principal stresses is the largest compression.
        shown = coloured(interior, view, "POINTS", "principal_stress", preset="Viridis (matplotlib)")
        pv.ColorBy(shown, ("POINTS", "principal_stress", "S3"))
        legend = pv.GetScalarBar(pv.GetColorTransferFunction("principal_stress"), view)
        legend.Title, legend.ComponentTitle = "S3, Pa (tension positive)", ""
        shown.Ambient, shown.Diffuse = 1.0, 0.0
        pv.ColorBy(display, None)
        display.AmbientColor = display.DiffuseColor = [0.85, 0.85, 0.83]
    if outlines is not None:
        lines = pv.Show(outlines, view)
        lines.ColorArrayName = [None, ""]
        lines.AmbientColor = lines.DiffuseColor = [0.2, 0.2, 0.2]
    if cracks is not None:
        lines = coloured(cracks, view, "CELLS", "birth_cycle", preset="Inferno (matplotlib)", bar=False)
        lines.LineWidth = 3.0
    if tips is not None:
        named("crack_id", names(tips, "CRACK_NAMES"))
        points = coloured(tips, view, "POINTS", "K_eq", preset="Inferno (matplotlib)", bar=False)
        points.PointSize = 6.0
        arrows(tips, view, "K at the tips", "growth_direction", "K_eq", rock).Visibility = 0
    if contacts is not None:
        arrows(contacts, view, "contact forces", "force", "force", rock).Visibility = 0
    if bolts is not None:
        shown = coloured(bolts, view, "CELLS", "force", preset="Cividis", bar=False)
        shown.LineWidth = 4.0
    if water is not None:
        shown = pv.Show(water, view)
        shown.ColorArrayName = [None, ""]
        shown.AmbientColor = shown.DiffuseColor = [0.18, 0.5, 0.82]
        shown.LineWidth = 2.0
    clock = pv.AnnotateTimeFilter(registrationName="time", Input=blocks) if blocks is not None else None
    if clock is not None:
        clock.Format = "t = {{time:.6g}} s" + ("" if scale == 1.0 else ", displacements x %g" % scale)
        label = pv.Show(clock, view)
        label.Color, label.FontSize = [0.1, 0.1, 0.1], 9
        bar = pv.Show(pv.TimeStepProgressBar(registrationName="time bar", Input=blocks), view)
        bar.ProgressBarColor = [0.35, 0.4, 0.45]
        bar.Position, bar.Position2 = [0.02, 0.02], [0.78, 0.02]
    steps = pv.GetAnimationScene()
    steps.UpdateAnimationUsingDataTimeSteps()
    steps.GoToLast()
    for source, place, array in (
        (blocks, "POINTS", "displacement"), (cracks, "CELLS", "birth_cycle"), (tips, "POINTS", "K_eq"),
        (bolts, "CELLS", "force"),
    ):
        if source is not None:
            pv.GetColorTransferFunction(array).RescaleTransferFunction(*span(source, place, array))
    if interior is not None:
        pv.GetColorTransferFunction("principal_stress").RescaleTransferFunction(
            *span(interior, "POINTS", "principal_stress", 2)
        )
    pv.ResetCamera(view)
    # Room on the right for the legend.
    view.CameraParallelScale *= 1.25
    for point in ("CameraPosition", "CameraFocalPoint"):
        at = list(getattr(view, point))
        at[0] += 0.15 * view.CameraParallelScale
        setattr(view, point, at)
    pv.Render(view)
    if options.state:
        pv.SaveState(os.path.abspath(options.state))
    if options.picture:
        pv.SaveScreenshot(os.path.abspath(options.picture), view, ImageResolution=[1600, 1000])


main()
'''


class ViewScript(Observer):
    """Observer that writes ``view.py`` and, at the end, the state ``view.pvsm``, which open the written ``series``;
    ``configuration`` is that of the series."""

    def __init__(self, configuration: str = "reference", series: Series | None = None) -> None:
        self.configuration, self.series = configuration, series

    def on_start(self, problem: Problem, folder: Path) -> None:
        self._folder = Path(folder)
        reference = self.configuration == "reference"
        warped = ", moved by their displacement" if reference else " already, which warping would move once more"
        text = _SCRIPT.format(
            configuration=self.configuration, warped=warped, reference=reference, scale=None if reference else 1.0
        )
        (Path(folder) / "view.py").write_text(text, encoding="utf-8")

    def memory(self) -> None:
        return None

    def on_resume(self, problem: Problem, folder: Path, memory: None) -> None:
        self.on_start(problem, folder)

    def on_end(self, summary: dict[str, Any], error: BaseException | None = None) -> None:
        if self.series is None or not drawable(self.series.last):
            return
        suffix = ".pvd" if self.series.format == "vtu" else ".vtkhdf"
        text = view_state(self._folder, self.series.last, self.configuration == "reference", suffix)
        (self._folder / "view.pvsm").write_text(text, encoding="utf-8")
