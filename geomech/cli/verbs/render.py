"""``geomech render``: pictures, movie and curves of a run, or any field of one or several."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..runs import open_run
from ..verb import DONE, BadInput, Verbs, add_verb, check_folder

#: Limits of the width in pixels, as for render.width_px in a scene.
LEAST_WIDTH = 64
#: Options that request a picture of one field.
_OF_FIELDS = ("field", "cycle", "time", "range", "scale", "mp4", "compression_positive", "format")


def declare(verbs: Verbs) -> None:
    """The verb's arguments."""
    render = add_verb(
        verbs, "render", _render, "draw a run: pictures of its end, a movie, and curves",
        "geomech render outputs/two_cracks/phi_30 --component yy --no-gif\n"
        "geomech render outputs/my_slope --field slip --time 0.3 --scale 1",
    )  # fmt: skip
    render.description = str(render.description) + (
        " Other settings come from the scene's [render] table. With --field, --cycle, --time, --range, --scale or "
        "--mp4 it draws one field; several runs get the same colours."
    )
    render.add_argument("runs", type=Path, nargs="+", metavar="RUN", help="run folder, or several to compare")
    render.add_argument("--out", type=Path, metavar="DIR", help="where the pictures go (default RUN/pictures)")
    render.add_argument("--component", metavar="NAME", 
                        help="stress: xx, yy, zz, xy, principal_max, principal_min or von_mises")  # fmt: skip
    render.add_argument("--field", metavar="NAME",
                        help="displacement, velocity, slip, opening, force, K, principal, a stress component, or any "
                             "written field such as contacts.gap or velocity.X")  # fmt: skip
    moment = render.add_mutually_exclusive_group()
    moment.add_argument("--cycle", type=int, metavar="N", help="draw this cycle, or the last written one before it")
    moment.add_argument("--time", type=float, metavar="S", help="draw this time, s")
    render.add_argument("--range", type=float, nargs=2, metavar=("LOW", "HIGH"), help="span of the colours, SI units")
    render.add_argument("--scale", type=float, metavar="X", help="factor on displacements; 1 is true to scale")
    render.add_argument("--size", metavar="WxH", help="pixels, such as 1600 or 1600x900")
    render.add_argument("--width", type=int, metavar="PX", help="width of the pictures")
    render.add_argument("--compression-positive", action="store_true", help="stresses with compression positive")
    render.add_argument("--format", choices=("png", "pdf", "svg"), help="format of a field's picture (default png)")
    render.add_argument("--gif", action=argparse.BooleanOptionalAction, default=None, help="draw the movie")
    render.add_argument("--mp4", action="store_true", help="draw the movie as MP4 (needs imageio-ffmpeg)")


def _render(options: argparse.Namespace) -> int:
    from ...render.pictures.field import COMPONENTS

    if options.component is not None and options.component not in COMPONENTS:
        raise BadInput(f"no stress component {options.component!r}; there are {', '.join(COMPONENTS)}")
    size = _size(options)
    check_folder("--out", options.out)
    runs = [open_run(folder) for folder in options.runs]
    of_fields = len(runs) > 1 or any(getattr(options, name) not in (None, False) for name in _OF_FIELDS)
    paths = _fields(runs, options, size) if of_fields else _usual(runs[0], options, size[0])
    for path in paths:
        print(path)
    return DONE


def _size(options: argparse.Namespace) -> tuple[int | None, int | None]:
    """(width, height) in pixels; None if not given."""
    width, height = options.width, None
    if options.size is not None:
        parts = options.size.lower().split("x")
        if len(parts) > 2 or not all(part.isdigit() for part in parts):
            raise BadInput(
                f"--size is a width, such as 1600, or width x height, such as 1600x900; got {options.size!r}"
            )
        width, height = int(parts[0]), int(parts[1]) if len(parts) == 2 else None
    for pixels, what in ((width, "width"), (height, "height")):
        if pixels is not None and pixels < LEAST_WIDTH:
            raise BadInput(f"a {what} of {pixels} pixels is too small; give at least {LEAST_WIDTH}")
    return width, height


def _usual(run, options: argparse.Namespace, width: int | None) -> list[Path]:
    from ...render import draw

    given = {"component": options.component, "width": width, "movie": options.gif}
    return draw(run, options.out, **{key: value for key, value in given.items() if value is not None})


def _fields(runs: list, options: argparse.Namespace, size: tuple[int | None, int | None]) -> list[Path]:
    from ...render.fields.draw import PictureRequest, draw_field, usual_field
    from ...render.fields.even_movie import NoEncoder
    from ...render.fields.quantity import UnknownField

    if options.range is not None and not options.range[0] < options.range[1]:
        raise BadInput(f"--range runs from a lower to a higher value; got {options.range[0]:g} {options.range[1]:g}")
    if options.scale is not None and not 0 <= options.scale < float("inf"):
        raise BadInput(f"--scale is a factor of 0 or more; got {options.scale:g}")
    asked = runs[0].scene.get("render", {})
    try:
        field = options.field or options.component or usual_field(runs[0]) or asked.get("component", "yy")
        request = PictureRequest(
            field=field, cycle=options.cycle, time=options.time, scale=options.scale,
            span=None if options.range is None else tuple(options.range),
            size=(size[0] or asked.get("width_px", 800), size[1]),
            compression_positive=options.compression_positive, suffix=f".{options.format or 'png'}",
            movies=(".gif",) * bool(options.gif) + (".mp4",) * options.mp4,
            frames_per_second=asked.get("frames_per_second", 10.0),
        )  # fmt: skip
        return draw_field(runs, request, options.out)
    except (UnknownField, NoEncoder, ValueError) as error:
        raise BadInput(str(error)) from None
    except KeyError as error:
        raise BadInput(str(error.args[0])) from None
