"""Pictures, movies and curves of a run, from its folder alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .sketch import sketch

if TYPE_CHECKING:
    from geomech.output import Run

__all__ = ["draw", "sketch"]


def draw(
    run: Run,
    out: Path | str | None = None,
    *,
    component: str | None = None,
    width: int | None = None,
    movie: bool | None = None,
) -> list[Path]:
    """Draw the pictures and curves of ``run`` into ``out`` (default: ``pictures`` in the run folder); returns their
    paths.

    Cracked rock: stress at the end and growth of the cracks, ``specimen.png`` and ``growth.gif``, and stress intensity
    at the tips, ``K.png``. Moving blocks, or no cracks: ``displacement.png`` and ``displacement.gif``, and after an
    earthquake ``slip.png``. Settings that are not given come from the scene's ``[render]`` table, and else are 800
    pixels and a movie; a ``component`` draws stress for any run. `draw_field` draws any other field. Raises ValueError
    for a run without a cycle, KeyError for an unknown stress component.
    """
    from .curves.plots import plots
    from .fields.draw import PictureRequest, draw_end, draw_field, suited, usual_field
    from .movie import movie as draw_movie

    if not len(run.history):
        raise ValueError(
            f"{run.folder}: the run has no cycle yet: continue it (`geomech resume {run.folder}`), then draw it"
        )
    asked = run.scene.get("render", {})
    folder = run.folder / "pictures" if out is None else Path(out)
    if component is None and run.series("blocks") and usual_field(run) is not None:
        return [*_motion(run, folder, asked, width, movie), *plots(run, folder, more=True)]
    painter = suited(run, component or asked.get("component", "yy"), width=width)
    folder.mkdir(parents=True, exist_ok=True)
    paths = [draw_end(painter, folder / "specimen.png")]
    if asked.get("gif", True) if movie is None else movie:
        pace = asked.get("frames_per_second", 10.0)
        made = draw_movie(painter, folder / "growth.gif", frames_per_second=pace)
        paths += [made] if made is not None else []
    if len(run.tips):
        paths += draw_field(
            [run], PictureRequest(field="K", scale=painter.view.scale, size=(painter.view.width, None)), folder
        )
    return [*paths, *plots(run, folder)]


def _motion(run: Run, folder: Path, asked: dict[str, Any], width: int | None, movie: bool | None) -> list[Path]:
    """Pictures of a run whose blocks move: displacement and, after an earthquake, slip of the joints."""
    from .fields.draw import PictureRequest, draw_field

    request = PictureRequest(
        scale=asked.get("deformation_scale"),
        size=(width or asked.get("width_px", 800), None),
        movies=(".gif",) if (asked.get("gif", True) if movie is None else movie) else (),
        frames_per_second=asked.get("frames_per_second", 10.0),
    )
    paths = draw_field([run], request, folder)
    loads = run.scene.get("loads", {})
    if loads.get("base") or loads.get("viscous_boundaries"):
        paths += draw_field([run], replace(request, field="slip", movies=()), folder)
    return paths
