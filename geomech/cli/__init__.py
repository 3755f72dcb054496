"""The command line: ``geomech examples | new | check | build | run | resume | safety | sweep | render | view | report |
bench | doctor``.

Exit codes: 0 done, 1 the run failed (its output stays readable), 2 bad input, 3 interrupted (Ctrl-C or SIGTERM). Each
verb is a module: ``declare`` defines its arguments, and heavy imports happen only when the verb is used.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence

from .. import __version__
from .messages import say, say_errors, silence, spell_out
from .scenes import default_folder
from .verb import BAD_INPUT, DONE, FAILED, INTERRUPTED, BadInput
from .verbs import bench, build, check, doctor, render, report, resume, run, safety, starting, sweep

__all__ = ["BAD_INPUT", "DONE", "FAILED", "INTERRUPTED", "default_folder", "main"]

# The matrices of a specimen are small: a second BLAS thread gains nothing and costs tens of times their own time when
# the machine is busy. Set before numpy is loaded; the environment may ask for more.
for _library in ("OPENBLAS", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

#: In the order of the help.
VERBS = (starting, check, build, run, resume, safety, sweep, render, report, bench, doctor)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code. ``arguments`` defaults to those of the process."""
    spell_out()
    options = _parser().parse_args(arguments)
    verb: Callable[[argparse.Namespace], int] = options.verb
    if getattr(options, "trust_models", False):
        # For models read in this process and in its children.
        os.environ["GEOMECH_TRUST_MODELS"] = "1"
    try:
        code = verb(options)
        if sys.stdout is not None:
            sys.stdout.flush()
        return code
    except BrokenPipeError:
        # The reader has stopped reading, as `head` does.
        silence("stdout")
        return DONE
    except KeyboardInterrupt:
        say("interrupted")
        return INTERRUPTED
    except Exception as error:
        if _is_bad_input(error):
            say_errors(error)
            return BAD_INPUT
        if options.debug:
            raise
        if isinstance(error, OSError) and error.filename:
            say(f"geomech: {error.filename}: {(error.strerror or type(error).__name__).lower()}")
            return FAILED
        say(f"geomech: {type(error).__name__}: {error}\n(run it again with --debug before the verb for the traceback)")
        return FAILED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="geomech",
        description="Failure of jointed, cracked rock masses: moving blocks (DDA) coupled with growing cracks (DDM).",
        epilog="exit codes: 0 done, 1 failed run, 2 bad input, 3 interrupted",
    )
    parser.add_argument("--version", action="version", version=f"geomech {__version__}")
    parser.add_argument("--debug", action="store_true", help="show the traceback of a failure")
    verbs = parser.add_subparsers(title="verbs", required=True, metavar="VERB")
    for verb in VERBS:
        verb.declare(verbs)
    return parser


def _is_bad_input(error: Exception) -> bool:
    if isinstance(error, BadInput):
        return True
    # Only packages that have been imported are checked: no other can raise its errors.
    for module, name in (("geomech.scene", "SceneError"), ("geomech.output.run_lock", "FolderRefused")):
        if isinstance(error, getattr(sys.modules.get(module), name, ())):
            return True
    return False
