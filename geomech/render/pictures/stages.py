"""A few pictures that tell a run: its first load, the first event of each kind, its end."""

from __future__ import annotations

from pathlib import Path

from geomech.model import CHANGES
from geomech.output.reading import Run

from .field import agreeing
from .look import final_cycle, look, spanning
from .picture import Painter

#: So many stages stand side by side.
MOST = 4


def stages(run: Run, folder: Path, *, width: int = 560) -> list[tuple[Path, str, int]]:
    """(PNG file in ``folder``, what it shows, cycle) of every stage, in the same colours throughout; [] of a run that
    wrote no blocks. Raises RenderingUnavailable where VTK can open no window."""
    from ..fields.draw import usual_field

    shown = moments(run)
    if not shown:
        return []
    field = usual_field(run)
    if field is not None:
        return _moving(run, folder, field, shown, width)
    asked, last = run.scene.get("render", {}), max(shown)
    fixed = look(
        run,
        last,
        component=asked.get("component", "yy"),
        width=width,
        scale=asked.get("deformation_scale"),
        crack_colour=asked.get("crack_colour", "birth"),
    )
    fixed = spanning(fixed, run, shown)
    folder.mkdir(parents=True, exist_ok=True)
    out = []
    with Painter(run, fixed) as painter:
        for cycle, statistics in shown.items():
            path = folder / f"stage_{cycle:06d}.png"
            painter.draw(cycle)
            painter.save(path)
            out.append((path, statistics, cycle))
    return out


def _moving(run: Run, folder: Path, field: str, shown: dict[int, str], width: int) -> list[tuple[Path, str, int]]:
    """The stages ``shown`` of a run whose blocks move, in one ``field``."""
    from ..fields.painter import FieldPainter, view
    from ..fields.quantity import quantity

    what = quantity(run, field)
    scale = run.scene.get("render", {}).get("deformation_scale")
    painter = FieldPainter(run, what, view(run, what, scale=scale, size=(width, None)))
    folder.mkdir(parents=True, exist_ok=True)
    out = []
    for cycle, told in shown.items():
        painter.draw(painter.frames.cycle_time(cycle))
        out.append((painter.save(folder / f"stage_{cycle:06d}.png"), told, cycle))
    return out


def moments(run: Run) -> dict[int, str]:
    """cycle → what it shows, in order."""
    if not len(run.history):
        return {}
    last = final_cycle(run)
    written = [cycle for cycle in run.grids("blocks") if cycle <= last]
    if not written:
        return {}
    loaded = [cycle for cycle in agreeing(run, written) if cycle > written[0]]
    found = {(loaded or written)[0]: "the first step"}
    end = run.at(last)["time"]
    for event in run.events:
        if (
            event["cycle"] < last
            and event["time"] < end
            and str(event["kind"]) not in (*found.values(), *CHANGES)
            and len(found) < MOST - 1
        ):
            found.setdefault(int(event["cycle"]), str(event["kind"]))
    found[last] = "the end"
    return dict(sorted(found.items()))
