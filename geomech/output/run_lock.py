"""Run lock: one run at a time in a folder, and none over the results of another unless asked for.

The lock is the system's (flock) on ``run.lock``, so that it ends with its process in any case; the content of the file
is for people. On file systems without locks the content decides: a live process of this machine, or any process of
another machine, has the folder.
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
#: Errors of file systems that do not support locks.
_NO_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)


class FolderRefused(RuntimeError):
    """No run may begin in the folder: the message gives the reason and a way out."""


class FolderInUse(FolderRefused):
    """Another run uses the folder."""


class FolderTaken(FolderRefused):
    """The folder holds the results of a run."""


def refuse_results(folders: Iterable[Path], *, locked: bool = False) -> None:
    """Refuse folders that hold results: raises FolderTaken, or FolderInUse while another run writes them (``locked``:
    the caller has the lock). A run that failed or was killed before its first cycle, and left no checkpoint, has none."""
    for folder in map(Path, folders):
        found = _results(folder)
        if found is not None:
            if not locked:
                _refuse_in_use(folder)
            raise FolderTaken(
                f"{folder} holds {found}: to replace it use --overwrite, to keep it name another folder (--out DIR), "
                f"to continue it `geomech resume {folder}`"
            )


def _results(folder: Path) -> str | None:
    with suppress(OSError, ValueError):
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        if isinstance(summary, dict) and summary.get("cycles"):
            return f"a run of {counted(int(summary['cycles']), 'cycle')} ({str(summary.get('end', 'ended'))[:60]})"
    if checkpoint_file.found(folder / checkpoint_file.FOLDER):
        return "an interrupted run with a checkpoint"
    return None


def _refuse_in_use(folder: Path) -> None:
    """Raise FolderInUse if a run has the folder."""
    try:
        handle = os.open(folder / FILE, os.O_RDWR | getattr(os, "O_CLOEXEC", 0))
    except OSError:
        return
    try:
        _lock(folder, handle)
    finally:
        os.close(handle)


class RunLock:
    """Context in which no other run begins in ``folder``, which is created.

    After entering, ``stale`` is a message about a run that left the folder without ending properly, or None. Raises
    FolderInUse.
    """

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
                locked, found = _lock(self.folder, handle)
                # The previous owner may have removed the file between opening and locking: then it locks nobody out.
                if locked and not _is_still(handle, path):
                    os.close(handle)
                    continue
            except BaseException:
                os.close(handle)
                raise
            break
        self._file = handle
        if found:
            self.stale = f"{self.folder} was left without being closed by {_holder_text(found)}, which no longer runs: taken over"
        text = json.dumps(
            {"process": os.getpid(), "host": platform.node(), "since": f"{datetime.now():%Y-%m-%d %H:%M:%S}"}
        ).encode()
        with suppress(OSError):  # a full disk: the lock works without content
            os.ftruncate(handle, 0)
            os.pwrite(handle, text, 0)
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            with suppress(OSError):
                (self.folder / FILE).unlink()
            os.close(self._file)
            self._file = None


def _lock(folder: Path, handle: int) -> tuple[bool | None, dict[str, Any]]:
    """Lock the open file of ``folder``: whether it is locked, as `_locked`, and its content. Raises FolderInUse."""
    locked = _locked(handle)
    found = _read(handle)
    if locked is False or (locked is None and found and _alive(found)):
        way_out = ": wait for it, end it, or name another folder"
        if locked is None:
            way_out = f": wait for it, name another folder, or remove {folder / FILE} if it is gone"
        raise FolderInUse(f"{folder} is in use by {_holder_text(found)}{way_out}")
    return locked, found


def _locked(handle: int) -> bool | None:
    """Whether we now hold the lock; None if the file system has no locks."""
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
    """Content of the file; {} if it cannot be read."""
    try:
        found = json.loads(os.pread(handle, 4096, 0) or b"{}")
    except ValueError:
        return {"process": "?"}
    return found if isinstance(found, dict) else {"process": "?"}


def _holder_text(found: dict[str, Any]) -> str:
    holder = f"process {found.get('process', '?')}"
    if found.get("host"):
        holder += f" on {found['host']}"
    return holder + (f" since {found['since']}" if found.get("since") else "")


def _alive(found: dict[str, Any]) -> bool:
    """Whether the process may be running; one of another machine may."""
    if found.get("host") != platform.node() or not isinstance(found.get("process"), int):
        return True
    try:
        os.kill(found["process"], 0)
    except ProcessLookupError:
        return False
    except OSError:
        pass
    return True
