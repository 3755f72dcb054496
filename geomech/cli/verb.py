"""Common parts of all verbs: entry in the help, example, exit code."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from pathlib import Path

#: The object to which the verbs of a command line are added.
Verbs = argparse._SubParsersAction

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 3


class BadInput(ValueError):
    """An error in the command line: exit code 2."""


def check_writable(option: str, path: Path | None) -> None:
    """Check before any work that the file ``path`` can be written.

    Raises BadInput if it is a folder or may not be written, or if its parent is a file.
    """
    if path is None:
        return
    if path.is_dir():
        raise BadInput(f"{option}: {path} is a folder; give a file in it, as {path / 'NAME'}")
    _check_place(option, path)


def check_folder(option: str, path: Path | None) -> None:
    """The same for a folder."""
    if path is not None:
        if path.exists() and not path.is_dir():
            raise BadInput(f"{option}: {path} is a file, not a folder")
        _check_place(option, path)


def _check_place(option: str, path: Path) -> None:
    there = next(place for place in (path.absolute(), *path.absolute().parents) if place.exists())
    if there != path.absolute() and not there.is_dir():
        raise BadInput(f"{option}: {there} is a file and not a directory that {path} could be in")
    if not os.access(there, os.W_OK):
        raise BadInput(f"{option}: {path} cannot be written")


def add_verb(
    verbs: Verbs, name: str, does: Callable[[argparse.Namespace], int], what: str, example: str
) -> argparse.ArgumentParser:
    """Parser of the verb ``name``, listed in the help as ``what``; ``does`` takes its options and returns an exit
    code."""
    made = verbs.add_parser(
        name,
        help=what,
        description=what[0].upper() + what[1:] + ".",
        epilog="example:\n" + "\n".join(f"  {line}" for line in example.splitlines()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.set_defaults(verb=does)
    return made
