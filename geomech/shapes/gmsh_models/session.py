"""Gmsh session: loaded on demand, one at a time, always closed; files are opened independently of earlier ones."""

from __future__ import annotations

import ctypes
import os
import signal
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .model_drawing import GmshModelError

# Gmsh has one global state per process.
_LOCK = threading.RLock()
#: Words in the rest of a faulty line.
_LONGEST_REST = 1000


class GmshUnavailable(RuntimeError):
    """Gmsh cannot be loaded on this machine."""


def load_gmsh():
    """The gmsh module. Raises GmshUnavailable with the way out if it or a shared library is missing."""
    try:
        import gmsh
    except ImportError as error:
        raise GmshUnavailable(f"Gmsh is not installed ({error}): `pip install gmsh`, then `geomech doctor`") from error
    except OSError as error:
        raise GmshUnavailable(
            f"Gmsh cannot be loaded, a shared library of the system is missing ({error}): "
            "`geomech doctor` names the packages to install"
        ) from error
    return gmsh


@contextmanager
def gmsh_session(name: str = "geomech") -> Iterator:
    """An empty Gmsh model, silent; a session that the caller has already opened is left as it was."""
    gmsh = load_gmsh()
    with _LOCK:
        opened_here = not gmsh.isInitialized()
        before = None
        if opened_here:
            # Signal handlers work in the main thread only, and a user's ~/.gmshrc must not affect results.
            with _signals_kept():
                gmsh.initialize(interruptible=False, readConfigFiles=False)
        else:
            before = gmsh.model.getCurrent()
        try:
            gmsh.option.setNumber("General.Terminal", 0)
            gmsh.model.add(name)
            yield gmsh
        finally:
            if opened_here:
                gmsh.onelab.clear()
                gmsh.finalize()
            else:
                gmsh.model.remove()
                if before in gmsh.model.list():
                    gmsh.model.setCurrent(before)


@contextmanager
def _signals_kept() -> Iterator[None]:
    """What signals do stays as it was: Gmsh sets SIGTERM back to ending the process, with which a run left no summary. Python
    itself changes handlers in its main thread only."""
    if os.name != "posix":
        yield
        return
    library, numbers = ctypes.CDLL(None), (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    # Larger than struct sigaction anywhere.
    kept = {number: ctypes.create_string_buffer(1024) for number in numbers}
    for number, action in kept.items():
        library.sigaction(int(number), None, action)
    try:
        yield
    finally:
        for number, action in kept.items():
            library.sigaction(int(number), action, None)


def open_model(gmsh, path: Path) -> None:
    """(Re)read the file into the current model."""
    # A new model rather than gmsh.clear(), which would delete other models of the caller's session.
    gmsh.model.remove()
    gmsh.model.add("geomech")
    gmsh.parser.clear()  # DefineConstant keeps the existing value of a variable with that name
    gmsh.logger.start()
    unit = gmsh.option.getString("Geometry.OCCTargetUnit")
    # OpenCASCADE's default, set explicitly because a caller may have chosen another; restored afterwards.
    gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
    try:
        gmsh.merge(str(path))
        gmsh.model.occ.synchronize()
        error = None
    except Exception as raised:
        error = str(raised)
    finally:
        gmsh.option.setString("Geometry.OCCTargetUnit", unit)
    errors = [line[len("Error: ") :] for line in gmsh.logger.get() if line.startswith("Error: ")]
    gmsh.logger.stop()
    if error or errors:
        text = (errors or [error])[0].replace(f"'{path}', ", "")
        _forget_rest(gmsh)
        raise GmshModelError(f"Gmsh cannot read {path}: {text}", "open it in Gmsh and correct it there")


def _forget_rest(gmsh) -> None:
    """Gmsh's parser keeps the rest of a faulty line, and reads it before the next file: feed it empty files, which
    consume one word each, until nothing is left."""
    with tempfile.TemporaryDirectory() as folder:
        empty = Path(folder) / "empty.geo"
        empty.write_text("\n")
        for _ in range(_LONGEST_REST):
            gmsh.logger.start()
            try:
                gmsh.merge(str(empty))
                left = any(line.startswith("Error") for line in gmsh.logger.get())
            except Exception:
                left = True
            gmsh.logger.stop()
            if not left:
                return
