"""Pictures and a movie of one field, of one run or of several in the same colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from geomech.output.reading import Run

from ...model.former_names import renamed_exports
from ..pictures.field import COMPONENTS
from ..pictures.look import final_cycle
from .even_movie import even_movie
from .frame import Frames, drawn
from .painter import FieldPainter, view
from .quantity import limits, quantity

#: Blocks count as moving if they move by more than this part of the model.
MOVES = 0.03


@dataclass(frozen=True)
class PictureRequest:
    """Specification of a field picture; None: chosen for the run.

    cycle, time   the cycle, or the time (s), to draw; by default the run's final state (`final_cycle`)
    span          (lowest, highest) in the field's SI unit
    scale         factor on displacements
    size          pixels, (width, height or None)
    suffix        format of the picture
    movies        formats of the movies
    """

    field: str = "displacement"
    cycle: int | None = None
    time: float | None = None
    span: tuple[float, float] | None = None
    scale: float | None = None
    size: tuple[int, int | None] = (800, None)
    compression_positive: bool = False
    suffix: str = ".png"
    movies: tuple[str, ...] = ()
    frames_per_second: float = 10.0


def suited(
    run: Run, component: str | None = None, *, width: int | None = None, span: tuple[float, float] | None = None
) -> FieldPainter:
    """Painter of the usual field of the run (`usual_field`), or of a stress ``component``.

    Settings that are not given come from the scene's ``[render]`` table, and else are vertical stress and 800 pixels;
    ``span`` of the colours is in the field's unit (None: from the run). Raises KeyError for an unknown stress component
    or crack colour.
    """
    asked = run.scene.get("render", {})
    field = component or usual_field(run) or asked.get("component", "yy")
    if component is not None and component not in COMPONENTS:
        raise KeyError(f"no stress component {component!r}; there are {', '.join(COMPONENTS)}")
    what = quantity(run, field)
    size = (width or asked.get("width_px", 800), None)
    fixed = view(run, what, scale=asked.get("deformation_scale"), span=span, size=size)
    return FieldPainter(run, what, fixed, asked.get("crack_colour", "birth"))


def draw_end(painter: FieldPainter, path: Path) -> Path:
    """Draw the cycle of the run's final state (`final_cycle`) to ``path``."""
    painter.draw(painter.frames.cycle_time(final_cycle(painter.run)))
    return painter.save(path)


def usual_field(run: Run) -> str | None:
    """The field that characterises a run: displacement if its blocks move or nothing is solved inside; None for stress
    inside cracked rock."""
    if not run.series("interior"):
        return "displacement"
    frames = Frames(run)
    last = frames.grid("blocks", frames.span()[1])
    if last is None:
        return "displacement"
    extent = float(np.ptp(drawn(last, 0.0), axis=0).max())
    return "displacement" if np.abs(np.asarray(last["displacement"])).max() > MOVES * extent else None


def draw_field(runs: Sequence[Run], request: PictureRequest, out: Path | None = None) -> list[Path]:
    """Draw ``request.field`` of ``runs`` with common colours into ``out`` (default: ``pictures`` in each run folder).

    Returns the paths. Raises UnknownField, NoEncoder, KeyError for a cycle or time before the first, and ValueError for
    a run without blocks.
    """
    for run in runs:
        if not run.series("blocks"):
            raise ValueError(f"{run.folder}: the run has written no blocks yet: continue it, then draw it")
    wanted = {run: quantity(run, request.field, compression_positive=request.compression_positive) for run in runs}
    if request.span is None and len(runs) > 1:
        spans = [limits([run], wanted[run]) for run in runs]
        request = replace(request, span=(min(low for low, _ in spans), max(high for _, high in spans)))
    paths = []
    for run in runs:
        folder = run.folder / "pictures" if out is None else out if len(runs) == 1 else out / run.folder.name
        folder.mkdir(parents=True, exist_ok=True)
        fixed = view(run, wanted[run], scale=request.scale, span=request.span, size=request.size)
        painter = FieldPainter(run, wanted[run], fixed, run.scene.get("render", {}).get("crack_colour", "birth"))
        name = request.field.replace("/", "_")
        if request.cycle is not None:
            name += f"_{request.cycle:06d}"
        elif request.time is not None:
            name += f"_{request.time:g}s"
        painter.draw(_time(painter, request))
        paths.append(painter.save(folder / f"{name}{request.suffix}"))
        if request.movies:
            files = [folder / f"{request.field}{suffix}" for suffix in request.movies]
            paths += even_movie(painter, files, frames_per_second=request.frames_per_second)
    return paths


def _time(painter: FieldPainter, request: PictureRequest) -> float:
    first, last = painter.frames.span()
    if request.cycle is not None:
        return painter.frames.cycle_time(request.cycle)
    if request.time is None:
        return painter.frames.cycle_time(final_cycle(painter.run))
    if not first <= request.time <= last * (1 + 1e-9):
        raise KeyError(f"{painter.run.folder} has output from t = {first:g} s to {last:g} s, not at {request.time:g} s")
    return request.time


__getattr__ = renamed_exports(__name__, {"Wish": "PictureRequest"}, globals())
