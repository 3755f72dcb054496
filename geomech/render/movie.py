"""The growth of a run as a movie."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geomech.output.reading import Run

from .pictures.field import agreeing
from .pictures.legend import INK, SOFT_INK, crack_colours
from .pictures.look import Look, final_cycle, spanning
from .pictures.picture import IDLE, OLD_CRACK, ROCK_OUTLINE, Painter

#: A frame in which cracks grew stays so much longer than one of loading.
LINGER = 2.0
#: The shortest and the longest time of a frame, over the mean, where the run's time goes on between frames.
PACES = 0.5, 4.0
#: The last frame stays for this long, ms.
LAST = 2500


def movie(run: Run, path: Path, fixed: Look, *, frames: int = 48, frames_per_second: float = 10.0) -> Path | None:
    """Draw the run's growth as the GIF ``path``: at most about ``frames`` cycles, those whose stress field is known
    for their own cracks, up to the one that shows what the run came to. Colours span the stress of all of them. None
    where there are not two cycles to show."""
    from PIL import Image

    shown = moments(run, frames)
    if len(shown) < 2:
        return None
    few = [shown[k] for k in np.unique(np.linspace(0, len(shown) - 1, 6).round().astype(int))]
    fixed = spanning(fixed, run, few)
    palette = _palette(fixed)
    images = []
    with Painter(run, fixed) as painter:
        for cycle in shown:
            painter.draw(cycle)
            image = Image.fromarray(painter.image())
            images.append(image.quantize(palette=palette, dither=Image.Dither.NONE))
    times = durations(run, shown, frames_per_second)
    images[0].save(path, save_all=True, append_images=images[1:], duration=times, loop=0, optimize=False)
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


def _palette(fixed: Look):
    """256 colours for all frames, those that pictures are made of: a GIF of frames with palettes of their own flickers
    and is larger, and one that is found by statistics draws bands where colours are rare."""
    from matplotlib.colors import to_rgb
    from PIL import Image

    rock, cracks = fixed.colours(np.linspace(0, 1, 150))[:, :3], crack_colours()(np.linspace(0, 1, 30))[:, :3]
    named = np.array([to_rgb(c) for c in (INK, SOFT_INK, IDLE, OLD_CRACK, ROCK_OUTLINE)])
    greys = np.repeat(np.linspace(0, 1, 31)[:, None], 3, axis=1)
    # Where a line's edge is smoothed, what is beside it mixes with white (the halo) or with the line's own dark.
    pale = 0.5 + 0.5 * rock[::7]
    dark = 0.5 * rock[::9]
    colours = np.concatenate([rock, cracks, named, greys, pale, dark])[:256]
    palette = Image.new("P", (1, 1))
    palette.putpalette((255 * colours).round().astype(np.uint8).ravel().tolist())
    return palette
