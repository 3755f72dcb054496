"""Opening a file in Gmsh as if it were the first, whatever the session has met before; faults in it are errors here."""

from __future__ import annotations

import tempfile
from pathlib import Path

from .model_drawing import GmshModelError

#: Words in the rest of a faulty line.
_LONGEST_REST = 1000


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
    except Exception as raised:  # noqa: BLE001 (Gmsh raises nothing narrower)
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
            except Exception:  # noqa: BLE001 (Gmsh raises nothing narrower)
                left = True
            gmsh.logger.stop()
            if not left:
                return
