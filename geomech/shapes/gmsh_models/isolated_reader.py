"""Reading of CAD files in a separate process, so that a damaged file cannot crash or block the program.

OpenCASCADE and mesh readers trust their input: a missing line can end the process, a flipped byte keep it busy for
ever; a Gmsh script may loop endlessly. A child process reads the file within `SECONDS` of processor time and `BYTES` of
memory, and returns the result as plain data.
"""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from geomech import plain_data

from ..traces.field_lines import FieldFile, FieldFileError
from .model_drawing import GmshDrawing, GmshModelError
from .script_commands import SCRIPTS
from .session import GmshUnavailable

#: Limit of processor time for one file, s: a hundred times that of a section with thousands of curves.
SECONDS = 60
#: Limit of wall time, in units of `SECONDS`, in case the child waits.
PATIENCE = 10
#: Limit of its memory, bytes.
BYTES = 4 << 30

ALLOWED = plain_data.Allowed(
    classes=(
        "geomech.shapes.curves:Chords", "geomech.shapes.traces.field_lines:FieldFile", "geomech.shapes.traces.field_lines:FieldLine",
        "geomech.shapes.gmsh_models.model_drawing:GmshDrawing", "geomech.shapes.gmsh_models.model_drawing:Parameter",
        "geomech.shapes.parts:Joint", "geomech.shapes.parts:Mark", "geomech.shapes.parts:Trace",
        "geomech.shapes.parts:Zone",
    )
)  # fmt: skip
ERRORS = {"model": GmshModelError, "field": FieldFileError, "gmsh": GmshUnavailable}
#: Program of the child; the job arrives on its standard input.
_CHILD = (
    "import json, sys; job = json.load(sys.stdin); sys.path[:] = job['path']; "
    "from geomech.shapes.gmsh_models.reader_process import serve; serve(job)"
)


def model_apart(path: Path, arguments: Mapping[str, Any]) -> GmshDrawing:
    """`read_gmsh_model` of ``path``, in another process."""
    return _read("model", path, arguments, GmshModelError)


def field_file_apart(path: Path, arguments: Mapping[str, Any]) -> FieldFile:
    """`read_field_file` of ``path``, in another process."""
    return _read("field", path, arguments, FieldFileError)


def _read(kind: str, path: Path, arguments: Mapping[str, Any], error: type[Exception]) -> Any:
    job = {"path": sys.path, "kind": kind, "file": str(path), "arguments": dict(arguments),
           "limits": [SECONDS, BYTES]}  # fmt: skip
    # One thread each for libraries that would reserve memory for as many threads as processors.
    alone = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}
    try:
        done = subprocess.run(
            [sys.executable, "-c", _CHILD], input=json.dumps(job).encode(), capture_output=True, check=False,
            timeout=PATIENCE * SECONDS, env=os.environ | alone, start_new_session=True,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        code, out = -signal.SIGXCPU, b""
    else:
        code, out = done.returncode, done.stdout
    if code == 0:
        try:
            outcome, what = plain_data.read(io.BytesIO(out), ALLOWED)
        except plain_data.Broken:
            outcome, what = "failed", "its reader returned no valid answer"
        if outcome == "read":
            return what
        if outcome in ERRORS:
            raise ERRORS[outcome](*what)
        raise error(f"{path} cannot be read: {what}", "the file is damaged: export it again")
    way_out = "the file is damaged: export it again"
    if path.suffix in SCRIPTS:
        way_out = "look for an endless loop or macro, in Gmsh"
    if code in (-signal.SIGXCPU, -signal.SIGKILL):
        raise error(f"{path} cannot be read within {SECONDS} s of processor time", way_out)
    if b"MemoryError" in done.stderr or b"bad_alloc" in done.stderr:
        raise error(f"{path} cannot be read within {BYTES >> 30} GiB of memory", "export it again with less content")
    name = signal.Signals(-code).name if code < 0 else f"exit code {code}"
    raise error(f"{path} cannot be read: its reader crashed ({name})", way_out)
