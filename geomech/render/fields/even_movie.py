"""Movie of a field, uniform in time: every frame stands for the same part of the run's time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .painter import FieldPainter

#: Duration of the last frame of a GIF, ms.
LAST = 2500


class NoEncoder(RuntimeError):
    """MP4 needs an encoder that is not installed; the message names it."""


def even_movie(
    painter: FieldPainter, paths: list[Path], *, frames: int = 48, frames_per_second: float = 10.0
) -> list[Path]:
    """Draw the whole run with ``painter`` into every one of ``paths``, .gif or .mp4. Raises NoEncoder for an MP4
    without imageio-ffmpeg."""
    first, last = painter.frames.span()
    if not last > first:
        return []
    images = []
    for time in np.linspace(first, last, frames):
        painter.draw(float(time))
        images.append(painter.image())
    for path in paths:
        if path.suffix == ".mp4":
            _mp4(path, images, frames_per_second)
        else:
            stay = [10 * round(100 / frames_per_second)] * (len(images) - 1) + [LAST]
            write_gif(path, images, stay)
    return paths


def write_gif(path: Path, images: list[np.ndarray], durations: list[int]) -> None:
    """Write ``images`` (height, width, 3) of 8 bits as the GIF ``path``, each shown for its duration, ms."""
    from PIL import Image

    # One palette for all frames, otherwise they would flicker: from the first, the middle and the last.
    shown = [images[0], images[len(images) // 2], images[-1]]
    found = Image.fromarray(np.concatenate(shown)).quantize(256, dither=Image.Dither.NONE).getpalette()
    colours = np.array(found).reshape(-1, 3)
    colours[(colours >= 243).all(axis=1)] = 255  # paper stays white
    palette = Image.new("P", (1, 1))
    palette.putpalette(colours.ravel().tolist())
    frames = [Image.fromarray(image).quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=durations, loop=0, optimize=False)


def _mp4(path: Path, images: list[np.ndarray], frames_per_second: float) -> None:
    import imageio

    try:
        import imageio_ffmpeg  # noqa: F401
    except ModuleNotFoundError:
        raise NoEncoder("an MP4 needs imageio-ffmpeg, which is not installed: pip install 'geomech[movie]'") from None
    tall, wide = (size - size % 2 for size in images[0].shape[:2])  # H.264 requires even sizes
    with imageio.get_writer(path, fps=frames_per_second, codec="libx264", quality=8, macro_block_size=2) as writer:
        for image in images:
            writer.append_data(image[:tall, :wide])
        for _ in range(round(frames_per_second)):
            writer.append_data(images[-1][:tall, :wide])
