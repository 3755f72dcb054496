"""One run at a time in a folder, and none over the results of another unless that is asked for.

The lock is the system's (flock) on ``run.lock``, so that it goes with its process however that ends; what stands in the
file is for people. File systems without locks are gone by what stands there: a process of this machine that is alive
has the folder, and so has any of another machine.
"""

from __future__ import annotations

import errno
import json
import os
import platform
from collections.abc import Iterable
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any, Self

from geomech.model import counted

from .checkpoints import checkpoint_file

#: In the run folder.
FILE = "run.lock"
#: What a file system says that knows no locks.
_NO_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)


class FolderRefused(RuntimeError):
    """No run may begin in the folder: the message says why, and what to do instead."""


class FolderInUse(FolderRefused):
    """Another run is at work in it."""


class FolderTaken(FolderRefused):
    """It holds the results of a run."""


def refuse_results(folders: Iterable[Path]) -> None:
    """Refuse folders that hold what a run has come to: raises FolderTaken. A run that failed or was killed before its
    first cycle, and left no checkpoint, has come to nothing."""
    for folder in folders:
        found = _results(Path(folder))
        if found is not None:
            raise FolderTaken(
                f"{folder} holds {found}: to run over it say --overwrite, to keep it name another folder (--out DIR), "
                f"to go on with it `geomech resume {folder}`"
            )


def _results(folder: Path) -> str | None:
    with suppress(OSError, ValueError):
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        if isinstance(summary, dict) and summary.get("cycles"):
            return f"a run of {counted(int(summary['cycles']), 'cycle')} ({str(summary.get('end', 'ended'))[:60]})"
    if checkpoint_file.found(folder / checkpoint_file.FOLDER):
        return "a run that was broken off, with a checkpoint"
    return None


class RunLock:
    """While this context lasts no other run begins in ``folder``, which is made. ``stale`` says, once it is entered,
    who has left it without a word; None where nobody has. Raises FolderInUse."""

    def __init__(self, folder: Path) -> None:
        self.folder = Path(folder)
        self.stale: str | None = None
        self._file: int | None = None

    def __enter__(self) -> Self:
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / FILE
        while True:
            handle = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0), 0o666)
            try:
                locked = _locked(handle)
                found = _read(handle)
                if locked is False or (locked is None and found and _alive(found)):
                    raise FolderInUse(f"{self.folder} is in use by {_holder_text(found)}{self._way_out(locked)}")
                # Whoever had it may have removed the file between opening and locking: then it locks nobody out.
                if locked and not _is_still(handle, path):
                    os.close(handle)
                    continue
            except BaseException:
                os.close(handle)
                raise
            break
        self._file = handle
        if found:
            self.stale = f"{self.folder} was left without a word by {_holder_text(found)}, which is gone: taken over"
        text = json.dumps(
            {"process": os.getpid(), "host": platform.node(), "since": f"{datetime.now():%Y-%m-%d %H:%M:%S}"}
        ).encode()
        with suppress(OSError):  # a full disk: the lock holds without it
            os.ftruncate(handle, 0)
            os.pwrite(handle, text, 0)
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            with suppress(OSError):
                (self.folder / FILE).unlink()
            os.close(self._file)
            self._file = None

    def _way_out(self, locked: bool | None) -> str:
        if locked is None:
            return f": wait for it, name another folder, or remove {self.folder / FILE} if it is gone"
        return ": wait for it, end it, or name another folder"


def _locked(handle: int) -> bool | None:
    """Whether the lock is ours now; None where the file system has none."""
    try:
        import fcntl
    except ImportError:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in _NO_LOCKS:
            return None
        if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
            return False
        raise
    return True


def _is_still(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), os.stat(path))
    except FileNotFoundError:
        return False


def _read(handle: int) -> dict[str, Any]:
    """What stands in the file; {} where nothing that makes sense does."""
    try:
        found = json.loads(os.pread(handle, 4096, 0) or b"{}")
    except ValueError:
        return {"process": "?"}
    return found if isinstance(found, dict) else {"process": "?"}


def _holder_text(found: dict[str, Any]) -> str:
    who = f"process {found.get('process', '?')}"
    if found.get("host"):
        who += f" on {found['host']}"
    return who + (f" since {found['since']}" if found.get("since") else "")


def _alive(found: dict[str, Any]) -> bool:
    """Whether the process may be at work; one of another machine may."""
    if found.get("host") != platform.node() or not isinstance(found.get("process"), int):
        return True
    try:
        os.kill(found["process"], 0)
    except ProcessLookupError:
        return False
    except OSError:
        pass
    return True
