"""``geomech resume``: continue a run from its last checkpoint."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..messages import report_compiling, say
from ..scenes import trust_argument
from ..verb import DONE, BadInput, Verbs, add_verb
from .run import prepare_for_a_run


def declare(verbs: Verbs) -> None:
    """The verb's arguments."""
    resume = add_verb(
        verbs, "resume", _resume, "continue a run from its last checkpoint: interrupted, killed, or to be extended",
        "geomech resume outputs/two_cracks/phi_30\ngeomech resume outputs/slope --set run.end_time_s=20",
    )  # fmt: skip
    resume.description = str(resume.description) + (
        " The results are bit for bit those without the interruption. A run ends its cycle and stores "
        "its state on Ctrl-C or SIGTERM; a second one ends it at once. A run started in the "
        "background by a script ignores Ctrl-C and ends on SIGTERM (`kill`)."
    )
    resume.add_argument("run", type=Path, metavar="RUN", help="run folder")
    resume.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides",
        help="change a key that does not affect the past: run.end_time_s, run.stop_at, output.every … "
        "(may be repeated)",
    )  # fmt: skip
    resume.add_argument("--quiet", action="store_true", help="print nothing but errors")
    trust_argument(resume)


def _resume(options: argparse.Namespace) -> int:
    prepare_for_a_run()
    if not options.quiet:
        report_compiling()
    from ...resumption import Finished, NotResumable, resume

    try:
        resume(options.run, options.overrides, quiet=options.quiet, tell=say)
    except Finished as nothing_left:
        say(f"{options.run}: {nothing_left}")
    except NotResumable as error:
        reason = str(error)
        raise BadInput(reason if str(options.run) in reason else f"{options.run}: {reason}") from error
    return DONE
