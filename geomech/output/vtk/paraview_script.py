"""``view.py`` in a run folder: ParaView opens every series of the run, drawn as one would by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from geomech.model import Cycle, Problem

_SCRIPT = '''"""Opens this run in ParaView: `paraview --script=view.py`, or headless `pvbatch view.py --picture view.png --state view.pvsm`.

Written by geomech beside the run's series; change it as you like. Coordinates are the {configuration} ones{warped}.
"""

import argparse
import math
import os
from pathlib import Path

from paraview import simple as pv

HERE = Path(globals().get("__file__", "view.py")).resolve().parent
#: By how much displacements are magnified; 1 is true to scale, None magnifies those too small to be seen.
SCALE = {scale!r}
REFERENCE = {reference}


def series(name):
    """The reader of the series `name`, at its last time; None where the run has not written it."""
    path = HERE / (name + ".pvd")
    if not path.is_file():
        return None
    source = pv.PVDReader(registrationName=name, FileName=str(path))
    source.UpdatePipeline(source.TimestepValues[-1] if len(source.TimestepValues) else 0.0)
    return source


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
        legend.TitleFontSize, legend.LabelFontSize = 14, 12
        legend.Orientation, legend.WindowLocation = "Horizontal", "Lower Center"
    return display


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
    sources = dict((name, moved(series(name), name, scale)) for name in ("interior", "cracks", "tips", "contacts"))
    blocks = moved(rock, "blocks", scale)
    if blocks is not None:
        display = coloured(blocks, view, "POINTS", "displacement", preset="Viridis (matplotlib)")
        display.SetRepresentationType("Surface")
        display.Ambient, display.Diffuse = 1.0, 0.0
        surface = pv.ExtractSurface(registrationName="surface", Input=blocks)
        outlines = pv.FeatureEdges(registrationName="outlines", Input=surface)
        outlines.FeatureEdges = 0
        outlines.ManifoldEdges = 0
        outlines.NonManifoldEdges = 0
        lines = pv.Show(outlines, view)
        lines.ColorArrayName = [None, ""]
        lines.AmbientColor = lines.DiffuseColor = [0.2, 0.2, 0.2]
    interior, cracks, tips, contacts = (sources[name] for name in ("interior", "cracks", "tips", "contacts"))
    if interior is not None:
        shown = coloured(interior, view, "POINTS", "von_mises", bar=False)
        shown.Visibility = 0
    if cracks is not None:
        lines = coloured(cracks, view, "CELLS", "birth_cycle", preset="Inferno (matplotlib)", bar=False)
        lines.LineWidth = 3.0
    if tips is not None:
        points = coloured(tips, view, "POINTS", "K_eq", preset="Inferno (matplotlib)", bar=False)
        points.PointSize = 8.0
    if contacts is not None:
        forces = pv.Glyph(registrationName="contact forces", Input=contacts, GlyphType="Arrow")
        forces.OrientationArray = ["POINTS", "force"]
        forces.ScaleArray = ["POINTS", "force"]
        forces.GlyphMode = "All Points"
        contacts.UpdatePipeline()
        largest = 0.0
        if "force" in contacts.PointData.keys() and contacts.PointData["force"].GetNumberOfTuples():
            largest = max(abs(end) for k in (0, 1) for end in contacts.PointData["force"].GetRange(k))
        bounds = contacts.GetDataInformation().GetBounds()
        if largest > 0.0:
            forces.ScaleFactor = 0.1 * max(bounds[1] - bounds[0], bounds[3] - bounds[2]) / largest
        pv.Show(forces, view).Visibility = 0
    clock = pv.AnnotateTimeFilter(registrationName="time", Input=blocks) if blocks is not None else None
    if clock is not None:
        clock.Format = "t = {{time:.6g}} s" + ("" if scale == 1.0 else ", displacements x %g" % scale)
        label = pv.Show(clock, view)
        label.Color, label.FontSize = [0.1, 0.1, 0.1], 14
    steps = pv.GetAnimationScene()
    steps.UpdateAnimationUsingDataTimeSteps()
    steps.GoToLast()
    for source in [each for each in (blocks, interior, cracks, tips) if each is not None]:
        display = pv.GetDisplayProperties(source, view)
        if display.ColorArrayName[1]:
            display.RescaleTransferFunctionToDataRange(False, True)
    if interior is not None:
        # Stress is singular at crack tips: colours reach a third of its largest value.
        largest = interior.PointData["von_mises"].GetRange(0)[1]
        pv.GetColorTransferFunction("von_mises").RescaleTransferFunction(0.0, largest / 3.0 or 1.0)
    pv.ResetCamera(view)
    view.CameraParallelScale *= 1.2
    pv.Render(view)
    if options.state:
        pv.SaveState(os.path.abspath(options.state))
    if options.picture:
        pv.SaveScreenshot(os.path.abspath(options.picture), view, ImageResolution=[1600, 1000])


main()
'''


class ViewScript:
    """Observer that writes ``view.py``; ``configuration`` is that of the series."""

    def __init__(self, configuration: str = "reference") -> None:
        self.configuration = configuration

    def on_start(self, problem: Problem, folder: Path) -> None:
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

    def on_cycle(self, cycle: Cycle) -> None:
        pass

    def on_end(self, summary: dict[str, Any], error: BaseException | None = None) -> None:
        pass
