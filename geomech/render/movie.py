"""Movie of crack growth."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geomech.output.reading import Run

from .fields.even_movie import LAST, write_gif
from .fields.painter import FieldPainter
from .pictures.field import agreeing
from .pictures.look import final_cycle

#: A frame with crack growth stays this much longer than one of loading.
LINGER = 2.0
#: Shortest and longest duration of a frame, relative to the mean, if the run's time advances between frames.
PACES = 0.5, 4.0


def movie(painter: FieldPainter, path: Path, *, frames: int = 48, frames_per_second: float = 10.0) -> Path | None:
    """Draw the growth in the run of ``painter`` as the GIF ``path``; None if there are not two cycles to show.

    It has at most about ``frames`` cycles, those whose stress field belongs to their own cracks, up to the final state.
    """
    shown = moments(painter.run, frames)
    if len(shown) < 2:
        return None
    images = []
    for cycle in shown:
        painter.draw(painter.frames.cycle_time(cycle))
        images.append(painter.image())
    write_gif(path, images, durations(painter.run, shown, frames_per_second))
    return path


def durations(run: Run, shown: list[int], frames_per_second: float) -> list[int]:
    """Duration, ms, of each of the cycles ``shown``.

    It is proportional to the run's time until the next one, between a half and four times the mean; cycles with crack
    growth, perhaps at constant load, get at least `LINGER` times the mean.
    """
    rows = [run.at(cycle) for cycle in shown]
    elapsed = np.abs(np.diff([float(row["time"]) for row in rows]))
    pace = np.ones(len(rows))
    if elapsed.sum() > 0:
        pace[:-1] = np.clip(elapsed / elapsed.mean(), *PACES)
    start = float(run.history["crack_length"][0])
    grown = np.array([float(row["crack_length"]) > start for row in rows])
    pace = np.where(grown, np.maximum(pace, LINGER), pace)
    times = [10 * round(float(100 / frames_per_second * each)) for each in pace]  # a GIF counts hundredths of a second
    times[-1] = max(LAST, times[-1])
    return times


def moments(run: Run, frames: int) -> list[int]:
    """Cycles of a movie, with the first and the last: a third of ``frames`` distributed over the loading, the rest over
    the growth."""
    last = final_cycle(run)
    written = [c for c in run.grids("blocks") if c <= last]
    usable = agreeing(run, written)
    history = run.history
    length = {int(c): float(v) for c, v in zip(history["cycle"], history["crack_length"])}
    grew = set(history["cycle"][history["growing"] > 0].astype(int))
    growth = np.array([c for c in usable if c in grew or length[c] > length[written[0]]], dtype=int)
    loading = np.array([c for c in usable if c not in set(growth.tolist())], dtype=int)

    def spread(cycles: np.ndarray, count: int) -> np.ndarray:
        return cycles[np.unique(np.linspace(0, len(cycles) - 1, min(count, len(cycles))).round().astype(int))]

    # Loading is the same picture in stronger colours: if there is growth to see, a few frames suffice.
    few = frames if not len(growth) else min(frames // 3, max(6, len(growth) // 2))
    chosen = [*spread(loading, few), *spread(growth, frames - min(few, len(loading))), written[0], written[-1]]
    return sorted({int(c) for c in chosen})
