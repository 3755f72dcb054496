"""Pictures, movies and curves of a finished run, made from its folder alone."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from geomech.output import Run

__all__ = ["draw"]


def draw(
    run: Run, out: Path | str | None = None, *, component: str = "yy", width: int = 800, movie: bool = True
) -> list[Path]:
    """Everything there is to see of ``run``, in the folder ``out`` (default: ``pictures`` in the run folder):
    ``specimen.png``, ``growth.gif`` and the curves. The paths of what was drawn.

    Raises ValueError for a run without a cycle, KeyError for an unknown stress component, RenderingUnavailable where VTK can open no window."""
    from .picture import movie as draw_movie
    from .picture import picture
    from .plots import plots

    if not len(run.history):
        raise ValueError(f"{run.folder}: the run has no cycle yet")
    folder = run.folder / "pictures" if out is None else Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    paths = [picture(run, folder / "specimen.png", component=component, width=width)]
    if movie:
        made = draw_movie(run, folder / "growth.gif", component=component, width=width)
        paths += [made] if made is not None else []
    return [*paths, *plots(run, folder)]
