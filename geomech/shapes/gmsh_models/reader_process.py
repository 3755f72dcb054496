"""Child process of `isolated_reader`: reads one file within limits of time and memory, and returns the drawing."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from geomech import plain_data

from ..traces.field_lines import FieldFileError
from ..traces.trace_tables import read_field_file
from .isolated_reader import ALLOWED
from .model_drawing import GmshModelError
from .model_files import read_here
from .session import GmshUnavailable, load_gmsh


def serve(job: Mapping[str, Any]) -> None:
    """In the child: read the file of ``job`` within its limits and write the result to the standard output."""
    import resource

    # Output of libraries must not get into the answer.
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    if job["kind"] == "model":
        with suppress(GmshUnavailable):  # reported on use; imported here, before the memory limit
            load_gmsh()
    seconds, memory = job["limits"]
    for limit, value in ((resource.RLIMIT_CPU, seconds), (resource.RLIMIT_AS, memory), (resource.RLIMIT_CORE, 0)):
        hard = resource.getrlimit(limit)[1]
        resource.setrlimit(limit, (value if hard == resource.RLIM_INFINITY else min(value, hard), hard))
    with out:
        plain_data.write(out, _answer(job), ALLOWED)


def _answer(job: Mapping[str, Any]) -> tuple[str, Any]:
    readers: dict[str, Callable[..., Any]] = {"model": read_here, "field": read_field_file}
    read = readers[job["kind"]]
    try:
        return "read", read(Path(job["file"]), **job["arguments"])
    except GmshModelError as error:
        return "model", (error.message, error.way_out, error.parameter)
    except FieldFileError as error:
        return "field", (error.message, error.way_out)
    except GmshUnavailable as error:
        return "gmsh", (str(error),)
    except MemoryError:
        raise
    except Exception as error:
        return "failed", f"{type(error).__name__}: {error}"
