"""Rows of many seeds, one per line of a file: seeds already run by the same program are not run again."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar, cast

_Record = TypeVar("_Record")

#: Parts of the package on which a slope's run depends.
PARTS = ("model", "shapes", "scene", "dda", "ddm", "coupling")


def rows_of_seeds(
    seeds: Sequence[int],
    path: Path,
    work: Callable[[int], dict[str, Any]],
    of: str,
    start: Callable[[], None] | None = None,
    workers: int | None = None,
) -> list[dict[str, Any]]:
    """``work`` of each of the ``seeds``, a row with "seed", in their order; one on each core (``workers``).

    Rows are kept in ``path`` with ``of``, the digest of the program (`program`) and of other inputs. ``start`` runs
    first in each worker, for instance to compile kernels. ``work`` and ``start`` are pickled.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    known = {row["seed"]: row for row in read_rows(path) if row.get("program") == of}
    missing = [seed for seed in seeds if seed not in known]
    if missing:
        # BLAS with a thread on every core in each worker would make the slopes wait for one another.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        spawn = multiprocessing.get_context("spawn")
        cores = workers or len(os.sched_getaffinity(0))
        with ProcessPoolExecutor(cores, spawn, start) as pool, path.open("a") as out:
            for done in as_completed([pool.submit(work, seed) for seed in missing]):
                row = done.result() | {"program": of}
                known[row["seed"]] = row
                out.write(json.dumps(row) + "\n")
                out.flush()
    return [known[seed] for seed in seeds]


def record_of(kind: type[_Record], row: dict[str, Any]) -> _Record:
    """The dataclass ``kind`` with the fields that the ``row`` has of it."""
    names = {field.name for field in fields(cast(Any, kind))}
    return kind(**{name: value for name, value in row.items() if name in names})


def program(modules: Iterable[str], also: str = "") -> str:
    """Digest of the sources on which a slope's run depends, of these ``modules`` of the benchmarks, and of ``also``."""
    package, digest = Path(__file__).parents[2], hashlib.sha256(also.encode())
    here = [path for name in modules for path in sorted((package / "bench").rglob(f"{name}.py"))]
    for path in [*here, *sorted(path for part in PARTS for path in (package / part).rglob("*.py"))]:
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def read_rows(path: Path) -> Iterator[dict[str, Any]]:
    """The rows of a file; incomplete lines are left out."""
    if not path.exists():
        return
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            row = json.loads(line)
        except json.JSONDecodeError:
            continue
        if isinstance(row, dict) and "seed" in row:
            yield row
