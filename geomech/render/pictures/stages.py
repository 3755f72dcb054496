"""Pictures of a run's stages: its first load, the first event of each kind, its end."""

from __future__ import annotations

from pathlib import Path

from geomech.model import CHANGES
from geomech.output.reading import Run

from .field import agreeing
from .look import final_cycle

#: Largest number of stages side by side.
MOST = 4


def stages(run: Run, folder: Path, *, width: int = 560) -> list[tuple[Path, str, int]]:
    """(PNG file in ``folder``, description, cycle) of every stage, in common colours; [] for a run without blocks."""
    from ..fields.draw import suited

    shown = moments(run)
    if not shown:
        return []
    painter = suited(run, width=width)
    folder.mkdir(parents=True, exist_ok=True)
    out = []
    for cycle, caption in shown.items():
        painter.draw(painter.frames.cycle_time(cycle))
        out.append((painter.save(folder / f"stage_{cycle:06d}.png"), caption, cycle))
    return out


def moments(run: Run) -> dict[int, str]:
    """cycle → description, in order."""
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
