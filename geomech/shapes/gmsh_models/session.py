"""A Gmsh session: loaded late, one at a time, always closed; and files opened in it as if each were the first."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .model_drawing import GmshModelError

# Gmsh keeps one global state in a process.
_LOCK = threading.RLock()
#: Words in the rest of a faulty line.
_LONGEST_REST = 1000


class GmshUnavailable(RuntimeError):
    """Gmsh cannot be loaded on this machine."""


def load_gmsh():
    """The gmsh module. Raises GmshUnavailable with the way out where it or a shared library it needs is missing."""
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
    """An empty Gmsh model of its own, silent; leaves a session that the caller already has as it was."""
    gmsh = load_gmsh()
    with _LOCK:
        mine = not gmsh.isInitialized()
        before = None
        if mine:
            # Signal handlers work in the main thread only, and a user's ~/.gmshrc must not change a result.
            gmsh.initialize(interruptible=False, readConfigFiles=False)
        else:
            before = gmsh.model.getCurrent()
        try:
            gmsh.option.setNumber("General.Terminal", 0)
            gmsh.model.add(name)
            yield gmsh
        finally:
            if mine:
                gmsh.onelab.clear()
                gmsh.finalize()
            else:
                gmsh.model.remove()
                if before in gmsh.model.list():
                    gmsh.model.setCurrent(before)


def open_model(gmsh, path: Path) -> None:
    """(Re)read the file into the current model."""
    # Anew, and not gmsh.clear(): that would wipe other models of a session the caller has open.
    gmsh.model.remove()
    gmsh.model.add("geomech")
    gmsh.parser.clear()  # DefineConstant keeps what a variable of that name already holds
    gmsh.logger.start()
    unit = gmsh.option.getString("Geometry.OCCTargetUnit")
    # OpenCASCADE's own choice, but it keeps what a caller may have chosen before, and would keep another after.
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
    """Gmsh's parser keeps what follows a fault in its line, and reads that before the next file: give it empty ones,
    which take a word each, until nothing is left."""
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
