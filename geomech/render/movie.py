"""The growth of a run as a movie."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from geomech.output.reading import Run

from .look import Look
from .picture import Painter


def movie(run: Run, path: Path, fixed: Look, *, frames: int = 48, frames_per_second: float = 10.0) -> Path | None:
    """Draw the run's growth as the GIF ``path``: about ``frames`` cycles, most of them from those in which cracks grew;
    the last one stands still for a while. None where there are not two cycles to show."""
    import imageio.v3 as imageio

    shown = moments(run, frames)
    if len(shown) < 2:
        return None
    with Painter(run, fixed) as painter:
        images = []
        for cycle in shown:
            painter.draw(cycle)
            images.append(painter.image())
    times = [1000 / frames_per_second] * len(images)
    times[-1] = 1800
    imageio.imwrite(path, _palettes(images), extension=".gif", plugin="pillow", duration=times, loop=0)
    return path


def moments(run: Run, frames: int) -> list[int]:
    """The cycles a movie shows: a third of ``frames`` spread over the loading, the rest over the growth; first and
    last always."""
    written = np.array(list(run.grids("blocks")))
    grew = set(run.history["cycle"][run.history["growing"] > 0].astype(int))
    growth = np.array([c for c in written if c in grew], dtype=int)
    # Before growth, cycles with a stress field of their own tell more than those that borrow an older one.
    telling = [c for c in run.grids("interior") if c not in grew]
    loading = np.array(telling if len(telling) > 2 else [c for c in written if c not in grew], dtype=int)

    def spread(cycles: np.ndarray, count: int) -> np.ndarray:
        return cycles[np.unique(np.linspace(0, len(cycles) - 1, min(count, len(cycles))).round().astype(int))]

    few = frames if not len(growth) else max(frames // 3, frames - len(growth))
    chosen = [*spread(loading, few), *spread(growth, frames - min(few, len(loading))), *written[[0, -1]]]
    return sorted({int(c) for c in chosen})


def _palettes(images: Sequence[np.ndarray]) -> list[np.ndarray]:
    """All frames on one palette of 256 colours, taken from the last: a GIF of frames with palettes of their own
    flickers and is larger."""
    from PIL import Image

    palette = Image.fromarray(images[-1]).quantize(256, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    colours = np.array(palette.getpalette()).reshape(-1, 3)
    # Cutting by medians mixes the page with what is nearly white; the page stays white.
    colours[colours.min(axis=1) >= 250] = 255
    palette.putpalette(colours.ravel().tolist())
    return [
        np.asarray(Image.fromarray(image).quantize(palette=palette, dither=Image.Dither.NONE).convert("RGB"))
        for image in images
    ]
