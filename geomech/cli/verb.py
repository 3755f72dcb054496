"""What every verb has: a place in the help, an example, and an exit code at its end."""

from __future__ import annotations

import argparse
from collections.abc import Callable

#: What the verbs of a command line are added to.
Verbs = argparse._SubParsersAction

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 3


class BadInput(ValueError):
    """Something on the command line that cannot be: exit code 2."""


def add_verb(
    verbs: Verbs, name: str, does: Callable[[argparse.Namespace], int], what: str, example: str
) -> argparse.ArgumentParser:
    """The parser of the verb ``name``, in the help as ``what``; ``does`` takes its options and gives an exit code."""
    made = verbs.add_parser(
        name,
        help=what,
        description=what[0].upper() + what[1:] + ".",
        epilog="example:\n" + "\n".join(f"  {line}" for line in example.splitlines()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.set_defaults(verb=does)
    return made
