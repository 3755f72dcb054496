"""The folder of compiled kernels, which must be writable.

It is outside the package: next to the sources, kernels would remain after an uninstall, and a leftover package folder
would hide the next installation. The folder contains code that is executed, so one that others can write to is not
used.
"""

from __future__ import annotations

import os
import stat
from functools import cache
from pathlib import Path
from typing import NamedTuple

#: Environment variable with the user's folder.
VARIABLE = "NUMBA_CACHE_DIR"


class Place(NamedTuple):
    """The ``folder``, and the folder that it replaces because that is not writable (``instead_of``; None for the usual
    one)."""

    folder: str
    instead_of: str | None = None


@cache
def kernel_place() -> Place:
    """The folder that the user has set, else one below ~/.cache; a temporary one if that is not writable."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    wanted = os.environ.get(VARIABLE) or os.path.join(home, "geomech", "kernels")
    return Place(wanted) if _writable(wanted) else Place(_temporary(), wanted)


def _writable(folder: str) -> bool:
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)


def _temporary() -> str:
    """A temporary folder that is kept until the machine clears it, if only this user can write to it; else one for this
    process."""
    import atexit
    import shutil
    import tempfile

    user = os.getuid() if hasattr(os, "getuid") else "user"
    folder = os.path.join(tempfile.gettempdir(), f"geomech-kernels-{user}")
    try:
        os.makedirs(folder, mode=0o700, exist_ok=True)
        found = os.lstat(folder)
        if stat.S_ISDIR(found.st_mode) and found.st_uid == user and not found.st_mode & 0o022 and _writable(folder):
            return folder
    except OSError:
        pass
    folder = tempfile.mkdtemp(prefix="geomech-kernels-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


#: File in each folder of kernels that names their source file.
SOURCE = "source.txt"


def prune(folder: Path) -> int:
    """Remove the kernels in ``folder`` whose sources no longer exist; returns the number of folders they were in."""
    import shutil

    removed = 0
    for source_note in folder.glob(f"*/{SOURCE}"):
        try:
            if not Path(source_note.read_text(encoding="utf-8")).exists():
                shutil.rmtree(source_note.parent)
                removed += 1
        except (OSError, ValueError):
            continue
    return removed
