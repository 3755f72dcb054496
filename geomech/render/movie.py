"""The growth of a run as a movie."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geomech.output.reading import Run

from .fields.even_movie import LAST, write_gif
from .fields.painter import FieldPainter
from .pictures.field import agreeing
from .pictures.look import final_cycle

#: A frame in which cracks grew stays so much longer than one of loading.
LINGER = 2.0
#: The shortest and the longest time of a frame, over the mean, where the run's time goes on between frames.
PACES = 0.5, 4.0


def movie(painter: FieldPainter, path: Path, *, frames: int = 48, frames_per_second: float = 10.0) -> Path | None:
    """Draw the growth of the run of ``painter`` as the GIF ``path``: at most about ``frames`` cycles, those whose stress
    field is known for their own cracks, up to the one that shows what the run came to. None where there are not two
    cycles to show."""
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
    """ms for which each of the cycles ``shown`` stands: as the run's time goes by until the next one, between a half
    and four times the mean; cycles in which cracks have grown, at one load perhaps, no less than `LINGER` of it."""
    rows = [run.at(cycle) for cycle in shown]
    gone_by = np.abs(np.diff([float(row["time"]) for row in rows]))
    pace = np.ones(len(rows))
    if gone_by.sum() > 0:
        pace[:-1] = np.clip(gone_by / gone_by.mean(), *PACES)
    start = float(run.history["crack_length"][0])
    grown = np.array([float(row["crack_length"]) > start for row in rows])
    pace = np.where(grown, np.maximum(pace, LINGER), pace)
    times = [10 * round(float(100 / frames_per_second * each)) for each in pace]  # a GIF counts hundredths of a second
    times[-1] = max(LAST, times[-1])
    return times


def moments(run: Run, frames: int) -> list[int]:
    """The cycles a movie shows, first and last always: a third of ``frames`` spread over the loading, the rest over the
    growth."""
    last = final_cycle(run)
    written = [c for c in run.grids("blocks") if c <= last]
    told = agreeing(run, written)
    history = run.history
    length = {int(c): float(v) for c, v in zip(history["cycle"], history["crack_length"])}
    grew = set(history["cycle"][history["growing"] > 0].astype(int))
    growth = np.array([c for c in told if c in grew or length[c] > length[written[0]]], dtype=int)
    loading = np.array([c for c in told if c not in set(growth.tolist())], dtype=int)

    def spread(cycles: np.ndarray, count: int) -> np.ndarray:
        return cycles[np.unique(np.linspace(0, len(cycles) - 1, min(count, len(cycles))).round().astype(int))]

    # Loading is the same picture in ever deeper colours: where there is growth to see, a few frames of it do.
    few = frames if not len(growth) else min(frames // 3, max(6, len(growth) // 2))
    chosen = [*spread(loading, few), *spread(growth, frames - min(few, len(loading))), written[0], written[-1]]
    return sorted({int(c) for c in chosen})
