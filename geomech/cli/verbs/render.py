"""``geomech render``: pictures, movie and curves of a run."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..runs import open_run
from ..verb import DONE, BadInput, Verbs, add_verb, check_folder

#: Pixels, as for a scene's own render.width_px.
LEAST_WIDTH = 64


def declare(verbs: Verbs) -> None:
    """The verb's arguments."""
    render = add_verb(
        verbs, "render", _render, "draw a run: the last cycle as a picture, its growth as a movie, its curves",
        "geomech render outputs/two_cracks/phi_30 --component yy --no-gif",
    )  # fmt: skip
    render.description = str(render.description) + " What is not said here, the scene's [render] table says."
    render.add_argument("run", type=Path, metavar="RUN", help="run folder")
    render.add_argument("--out", type=Path, metavar="DIR", help="where the pictures go (default RUN/pictures)")
    render.add_argument("--component", metavar="NAME", 
                        help="stress: xx, yy, zz, xy, principal_max, principal_min or von_mises")  # fmt: skip
    render.add_argument("--width", type=int, metavar="PX", help="width of the pictures")
    render.add_argument("--gif", action=argparse.BooleanOptionalAction, default=None, help="draw the movie")


def _render(options: argparse.Namespace) -> int:
    from ...render import draw
    from ...render.pictures.look import COMPONENTS

    if options.component is not None and options.component not in COMPONENTS:
        raise BadInput(f"no stress component {options.component!r}; there are {', '.join(COMPONENTS)}")
    if options.width is not None and options.width < LEAST_WIDTH:
        raise BadInput(f"a width of {options.width} pixels shows nothing; give at least {LEAST_WIDTH}")
    check_folder("--out", options.out)
    run = open_run(options.run)
    wishes = {"component": options.component, "width": options.width, "movie": options.gif}
    for path in draw(run, options.out, **{key: value for key, value in wishes.items() if value is not None}):
        print(path)
    return DONE
