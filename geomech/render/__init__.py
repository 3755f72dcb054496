"""Pictures, movies and curves of a finished run, made from its folder alone."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from geomech.output import Run

__all__ = ["draw"]


def draw(
    run: Run,
    out: Path | str | None = None,
    *,
    component: str | None = None,
    width: int | None = None,
    movie: bool | None = None,
) -> list[Path]:
    """Everything there is to see of ``run``, in the folder ``out`` (default: ``pictures`` in the run folder):
    ``specimen.png``, ``growth.gif`` and the curves. The paths of what was drawn.

    What is not said here the scene's ``[render]`` table says, and where that is silent too, stress yy, 800 pixels and a
    movie. Raises ValueError for a run without a cycle, KeyError for an unknown stress component, RenderingUnavailable
    where VTK can open no window."""
    from .curves.plots import plots
    from .movie import movie as draw_movie
    from .pictures.look import final_cycle, look
    from .pictures.picture import picture

    if not len(run.history):
        raise ValueError(
            f"{run.folder}: the run has no cycle yet: let it go on (`geomech resume {run.folder}`), then draw it"
        )
    asked = run.scene.get("render", {})
    last = final_cycle(run)
    fixed = look(
        run,
        last,
        component=component or asked.get("component", "yy"),
        width=width or asked.get("width_px", 800),
        scale=asked.get("deformation_scale"),
        crack_colour=asked.get("crack_colour", "birth"),
    )
    folder = run.folder / "pictures" if out is None else Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    paths = [picture(run, folder / "specimen.png", fixed, last)]
    if asked.get("gif", True) if movie is None else movie:
        pace = asked.get("frames_per_second", 10.0)
        made = draw_movie(run, folder / "growth.gif", fixed, frames_per_second=pace)
        paths += [made] if made is not None else []
    return [*paths, *plots(run, folder)]
