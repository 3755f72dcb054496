"""``view.pvsm`` in a run folder: a ParaView state that opens all series of the run, drawn as by ``view.py``.

The file is ParaView's own XML (a ``ServerManagerState``: proxies with their properties, and collections that name
them), written without ParaView; properties that are left out take ParaView's defaults.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from .vtu import EMPTY, Grid

#: ColorBrewer's YlGnBu (C. Brewer, colorbrewer2.org), as in the pictures; crimson to orange for cracks.
ROCK = ("ffffd9", "edf8b1", "c7e9b4", "7fcdbb", "41b6c4", "1d91c0", "225ea8", "253494", "081d58")
CRACKS = ("8f0d33", "d7263d", "ff7a1a", "ffb01f")
#: Oldest ParaView version that reads it.
VERSION = "5.10.0"
#: Arrows of the largest force or K have this length, relative to the model.
ARROW = 0.1
_POINTS, _CELLS = "0", "1"


class State:
    """Proxies, numbered in order, and their names in ParaView's collections."""

    def __init__(self) -> None:
        self._lines: list[str] = []
        self._named: dict[str, list[tuple[int, str]]] = {}
        self._last = 1000

    def add(self, group: str, kind: str, name: str = "", collection: str = "", **properties: Any) -> int:
        """Add a proxy ``kind`` of ``group``; returns its number. A property is a value, a list of values, or `Of`
        another proxy."""
        self._last += 1
        # ParaView's servers: 1 data, 16 client, 20 render, 21 data and render.
        servers = {"sources": 1, "filters": 1, "extended_sources": 1, "misc": 16, "animation": 16}.get(group, 21)
        self._lines.append(f'<Proxy group="{group}" type="{kind}" id="{self._last}" servers="{servers}">')
        for key, value in properties.items():
            values = value if isinstance(value, (list, tuple)) else [value]
            self._lines.append(f'<Property name="{key}" id="{self._last}.{key}" number_of_elements="{len(values)}">')
            for k, each in enumerate(values):
                if isinstance(each, Of):
                    self._lines.append(f'<Proxy value="{each.proxy}" output_port="0"/>')
                else:
                    self._lines.append(f'<Element index="{k}" value="{escape(_text(each))}"/>')
            self._lines.append("</Property>")
        self._lines.append("</Proxy>")
        if name:
            self._named.setdefault(collection or group, []).append((self._last, name))
        return self._last

    def text(self) -> str:
        """The file."""
        collections = []
        for collection, items in self._named.items():
            collections.append(f'<ProxyCollection name="{collection}">')
            collections += [f'<Item id="{number}" name="{escape(name)}"/>' for number, name in items]
            collections.append("</ProxyCollection>")
        body = "\n".join([*self._lines, *collections])
        return f'<ParaView>\n<ServerManagerState version="{VERSION}">\n{body}\n</ServerManagerState>\n</ParaView>\n'


class Of:
    """Property value that refers to the proxy with this number."""

    def __init__(self, proxy: int) -> None:
        self.proxy = proxy


def _text(value: Any) -> str:
    return repr(float(value)) if isinstance(value, (float, np.floating)) else str(value)


def view_state(folder: Path, last: Mapping[str, Grid], reference: bool, suffix: str) -> str:
    """State for the run in ``folder``.

    ``last`` are the last grids of the series (name → grid, blocks among them), in reference coordinates or not;
    ``suffix`` is that of the series' files.
    """
    state = State()
    folder = Path(folder).resolve()
    kind = "PVDReader" if suffix == ".pvd" else "VTKHDFReader"
    readers = {name: state.add("sources", kind, name, FileName=str(folder / (name + suffix))) for name in last}
    scale = _magnification(last) if reference else 1.0
    moved = {
        name: state.add("filters", "WarpVector", f"{name} moved", "sources", Input=Of(reader), ScaleFactor=scale,
                        SelectInputVectors=["", "", "", _POINTS, "displacement"])
        for name, reader in readers.items() if reference and "displacement" in last[name].point_data
    }  # fmt: skip
    shown = {name: moved.get(name, reader) for name, reader in readers.items()}
    size = float(np.ptp(last["blocks"].points, axis=0).max())
    drawn = _rock(state, shown, last) + _lines(state, shown, last) + _arrows(state, shown, last, size)
    label = "t = {time:.6g} s" + ("" if scale == 1.0 else f", displacements x {scale:g}")
    clock = state.add("filters", "TimeToTextConvertor", "time", "sources", Input=Of(readers["blocks"]), Format=label)
    drawn.append(state.add("representations", "TextSourceRepresentation", "time shown", Input=Of(clock), Visibility=1,
                           Color=[0.1, 0.1, 0.1], FontSize=9))  # fmt: skip
    bar = state.add("filters", "TimeStepProgressFilter", "time bar", "sources", Input=Of(readers["blocks"]))
    drawn.append(state.add("representations", "ProgressBarSourceRepresentation", "time bar shown", Input=Of(bar),
                           Visibility=1, ProgressBarColor=[0.35, 0.4, 0.45], Position=[0.02, 0.02],
                           Position2=[0.78, 0.02]))  # fmt: skip
    view = _view(state, drawn, last["blocks"])
    keeper = state.add("misc", "TimeKeeper", "TimeKeeper1", "timekeeper", Views=Of(view),
                       TimeSources=[Of(each) for each in (*readers.values(), *moved.values())])  # fmt: skip
    # 2: from one written cycle to the next.
    state.add("animation", "AnimationScene", "AnimationScene1", TimeKeeper=Of(keeper), ViewModules=Of(view), PlayMode=2)
    return state.text()


def _rock(state: State, shown: Mapping[str, int], last: Mapping[str, Grid]) -> list[int]:
    """Blocks, coloured by displacement, or plain with the stress inside cracked rock."""
    flat: dict[str, Any] = {"Visibility": 1, "Representation": "Surface", "Ambient": 1, "Diffuse": 0}
    inside = "interior" in shown and "principal_stress" in last["interior"].point_data
    if not inside:
        colours, legend = _colours(state, "displacement", "displacement, m", last["blocks"].point_data, None, ROCK)
        display = state.add("representations", "UnstructuredGridRepresentation", "blocks shown", **flat,
                            Input=Of(shown["blocks"]), LookupTable=Of(colours),
                            ColorArrayName=["", "", "", _POINTS, "displacement"])  # fmt: skip
        return [display, legend]
    # Compression is negative: the last of the principal stresses is the largest compression.
    title = "S3, Pa (tension positive)"
    colours, legend = _colours(state, "principal_stress", title, last["interior"].point_data, 2, ROCK[::-1])
    grey = [0.85, 0.85, 0.83]
    blocks = state.add("representations", "UnstructuredGridRepresentation", "blocks shown", **flat,
                       Input=Of(shown["blocks"]), AmbientColor=grey, DiffuseColor=grey,
                       ColorArrayName=["", "", "", _POINTS, ""])  # fmt: skip
    rock = state.add("representations", "UnstructuredGridRepresentation", "interior shown", **flat,
                     Input=Of(shown["interior"]), LookupTable=Of(colours),
                     ColorArrayName=["", "", "", _POINTS, "principal_stress"])  # fmt: skip
    return [blocks, rock, legend]


def _lines(state: State, shown: Mapping[str, int], last: Mapping[str, Grid]) -> list[int]:
    """Outlines, cracks, tips, bolts and water."""
    looks: dict[str, tuple[float, Sequence[float], tuple[str, str] | None]] = {
        "outlines": (1.0, [0.2, 0.2, 0.2], None),
        "cracks": (3.0, [0.1, 0.1, 0.1], (_CELLS, "birth_cycle")),
        "tips": (6.0, [0.1, 0.1, 0.1], (_POINTS, "K_eq")),
        "bolts": (4.0, [0.1, 0.1, 0.1], (_CELLS, "force")),
        "water": (2.0, [0.18, 0.5, 0.82], None),
    }
    drawn = []
    for name, (width, ink, coloured) in looks.items():
        if name not in shown:
            continue
        look: dict[str, Any] = {"ColorArrayName": ["", "", "", _POINTS, ""]}
        if coloured is not None:
            place, array = coloured
            data = last[name].point_data if place == _POINTS else last[name].cell_data
            colours, _ = _colours(state, array, "", data, None, CRACKS)
            look = {"ColorArrayName": ["", "", "", place, array], "LookupTable": Of(colours)}
        drawn.append(state.add("representations", "UnstructuredGridRepresentation", f"{name} shown", Visibility=1,
                               Representation="Surface", Input=Of(shown[name]), LineWidth=width, PointSize=width,
                               AmbientColor=list(ink), DiffuseColor=list(ink), Ambient=1, Diffuse=0, **look))  # fmt: skip
    return drawn


def _arrows(state: State, shown: Mapping[str, int], last: Mapping[str, Grid], size: float) -> list[int]:
    """Contact forces and K at the tips as arrows, hidden at first: the longest is a tenth of the model."""
    drawn = []
    for name, title, direction, array in (
        ("tips", "K at the tips", "growth_direction", "K_eq"),
        ("contacts", "contact forces", "force", "force"),
    ):
        if name not in shown:
            continue
        largest = _span(last[name].point_data.get(array), None)[1]
        arrow, turn = state.add("sources", "ArrowSource"), state.add("extended_sources", "Transform2")
        glyph = state.add("filters", "Glyph", title, "sources", Input=Of(shown[name]), Source=Of(arrow),
                          GlyphTransform=Of(turn), GlyphMode=0, ScaleFactor=ARROW * size / largest if largest > 0 else 1.0,
                          OrientationArray=["1", "", "", _POINTS, direction],
                          ScaleArray=["0" if array == "K_eq" else "1", "", "", _POINTS, array])  # fmt: skip
        drawn.append(state.add("representations", "GeometryRepresentation", f"{title} shown", Input=Of(glyph),
                               Visibility=0, ColorArrayName=["", "", "", _POINTS, ""]))  # fmt: skip
    return drawn


def _colours(
    state: State, array: str, title: str, data: Mapping[str, np.ndarray], column: int | None, stops: Sequence[str]
) -> tuple[int, int]:
    """(colours of an ``array``, its legend or 0).

    The range is that of the last cycle without the outermost 0.7 % at either end, because stress at a crack tip is
    singular.
    """
    low, high = _span(data.get(array), column)
    table: list[float] = []
    for value, stop in zip(np.linspace(low, high, len(stops)), stops, strict=True):
        table += [float(value), *(int(stop[k : k + 2], 16) / 255 for k in (0, 2, 4))]
    colours = state.add("lookup_tables", "PVLookupTable", f"{array}.PVLookupTable", RGBPoints=table, ColorSpace=0,
                        AutomaticRescaleRangeMode=-1, VectorMode=int(column is not None),
                        VectorComponent=column or 0)  # fmt: skip
    legend = 0
    if title:
        ink = [0.1, 0.1, 0.1]
        legend = state.add("representations", "ScalarBarWidgetRepresentation", f"{array} legend", "scalar_bars",
                           LookupTable=Of(colours), Title=title, ComponentTitle="", Enabled=1, Visibility=1,
                           TitleColor=ink, LabelColor=ink, TitleFontSize=9, LabelFontSize=8, Orientation=1,
                           AutoOrient=0, WindowLocation=0, Position=[0.8, 0.3], ScalarBarLength=0.45)  # fmt: skip
    return colours, legend


def _span(values: np.ndarray | None, column: int | None) -> tuple[float, float]:
    if values is None or not np.size(values):
        return 0.0, 1.0
    found = np.asarray(values, float)
    if found.ndim > 1:
        found = found[:, column] if column is not None else np.linalg.norm(found, axis=1)
    found = found[np.isfinite(found)]
    if not len(found):
        return 0.0, 1.0
    low, high = np.percentile(found, [0.7, 99.3])
    # A uniform field gets a band around its value; otherwise colours would show round-off.
    centre, half = 0.5 * (low + high), max(0.5 * (high - low), 0.05 * max(abs(low), abs(high)))
    return (float(centre - half), float(centre + half)) if half > 0 else (0.0, 1.0)


def _magnification(last: Mapping[str, Grid]) -> float:
    """Factor that makes the largest displacement 3 % of the model if it is below 0.2 %: 1, 2 or 5 times a power of ten,
    as in ``view.py``."""
    size = float(np.ptp(last["blocks"].points, axis=0).max())
    largest = float(np.abs(last["blocks"].point_data["displacement"]).max(initial=0.0))
    if not 0.0 < largest < 0.002 * size:
        return 1.0
    wanted = 0.03 * size / largest
    power = 10.0 ** math.floor(math.log10(wanted))
    return power * max(digit for digit in (1.0, 2.0, 5.0) if digit * power <= wanted)


def _view(state: State, drawn: Sequence[int], blocks: Grid) -> int:
    """The window: white, seen from the front, with room for the legend on the right."""
    corners = np.asarray(blocks.points)[:, :2]
    low, high = corners.min(axis=0), corners.max(axis=0)
    x, y = 0.5 * (low + high)
    tall = 0.6 * float(np.ptp(corners, axis=0).max())
    x += 0.15 * tall
    return state.add("views", "RenderView", "RenderView1", Representations=[Of(each) for each in drawn if each],
                     UseColorPaletteForBackground=0, Background=[1.0, 1.0, 1.0], InteractionMode=1,
                     OrientationAxesVisibility=0, CameraParallelProjection=1, CameraParallelScale=tall,
                     CameraPosition=[float(x), float(y), 10 * tall], CameraFocalPoint=[float(x), float(y), 0.0],
                     CameraViewUp=[0.0, 1.0, 0.0])  # fmt: skip


def drawable(last: Mapping[str, Grid]) -> bool:
    """Whether there are blocks to draw."""
    blocks = last.get("blocks")
    return blocks is not None and bool(len(blocks.types)) and int(blocks.types[0]) != EMPTY
