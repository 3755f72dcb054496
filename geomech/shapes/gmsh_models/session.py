"""A Gmsh session: loaded late, one at a time, always closed."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

# Gmsh keeps one global state in a process.
_LOCK = threading.RLock()


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
