"""Cost of an element–point pair: influence matrices and fields, one thread, near and far pairs, all kinds of
elements."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from ...ddm import HalfPlane
from ...ddm.kernels import shape_functions
from ...ddm.kernels.full_plane import Elements, Kernel
from ...ddm.system import influence_matrix as matrices
from ...ddm.system.influence_matrix import ElementSet, add_fields, influence
from ..figures import Measured

#: Folder of the picture, in the working folder.
FOLDER = Path("outputs/bench_kernels")


def measure(quick: bool = False) -> Measured:
    """The table: ns per pair, CPU time of the fastest of some repeats; writes ``kernels.png`` to `FOLDER`."""
    from ...render.benchmarks.bars import draw_bars

    threads, matrices.THREADS = matrices.THREADS, 1
    try:
        rows = [*_matrices(2 if quick else 9), *_fields(1 if quick else 5)]
    finally:
        matrices.THREADS = threads
    width = max(len(label) for label, _ in rows)
    lines = ["element–point pairs, nodal matrices and fields, one thread, ns of CPU a pair"]
    text = "\n".join(lines + [f"  {label:<{width}}  {ns:6.1f}" for label, ns in rows])
    if not quick:
        draw_bars({"ns": dict(rows)}, FOLDER / "kernels.png", "ns of CPU an element–point pair", "Kernels, one thread")
    return Measured.of(text, times={label: 1e-9 * ns for label, ns in rows})


def _matrices(repeats: int) -> Iterator[tuple[str, float]]:
    kinds = {
        "no tip": shape_functions.ORDINARY,
        "one tip": shape_functions.TIP_START,
        "two tips": shape_functions.TIP_BOTH,
    }
    for spread, where in ((math.inf, "in a ring of 200"), (0.5, "60 across each other")):
        for name, kind in kinds.items():
            yield f"matrix, p = 4, elements with {name} {where}", _matrix(_elements(spread, kind, 4), repeats)
    for order in (2, 8, 10):
        yield (
            f"matrix, p = {order}, ordinary elements in a ring of 200",
            _matrix(_elements(math.inf, 0, order), repeats),
        )
    for order in (2, 4, 8):
        yield (
            f"matrix, p = {order}, the same below a free surface",
            _matrix(_below(_elements(math.inf, 0, order)), repeats),
        )


def _matrix(elements: ElementSet, repeats: int) -> float:
    return _least(lambda: influence(elements, elements, 0.25, 1e-9), repeats) / (elements.n**2 * elements.per)


def _fields(repeats: int) -> Iterator[tuple[str, float]]:
    elements = _elements(math.inf, shape_functions.ORDINARY, 4)
    rng = np.random.default_rng(1)
    density = rng.standard_normal((elements.n, 2, elements.per))
    for force, name in ((False, "jumps"), (True, "line forces")):
        for n in (50, 20000):
            points = 3 * rng.standard_normal((n, 2))
            stress, shift = np.zeros((n, 3)), np.zeros((n, 2))
            sources = Elements(elements.start, elements.end, elements.kind)
            work = partial(add_fields, points, sources, density, Kernel(0.25, 1e-9, 1.0, force), stress, shift)
            yield f"stress and displacement at {n} points from {name}", _least(work, repeats) / (n * elements.n)
        work = partial(work, half_plane=HalfPlane((0.0, 20.0)))
        yield f"the same from {name} below a free surface", _least(work, repeats) / (n * elements.n)


def _elements(spread: float, kind: int, order: int) -> ElementSet:
    if math.isinf(spread):
        n, size = 200, 0.9 * math.pi / 200
        angle = np.linspace(0, 2 * math.pi, n, endpoint=False)
        midpoint, turn = np.column_stack([np.cos(angle), np.sin(angle)]), angle + 0.5 * math.pi
    else:
        rng = np.random.default_rng(2)
        n, size = 60, 0.3
        midpoint, turn = spread * rng.random((n, 2)), 2 * math.pi * rng.random(n)
    half = size * np.column_stack([np.cos(turn), np.sin(turn)])
    return ElementSet(midpoint - half, midpoint + half, np.full(n, kind), np.arange(n), order, "chebyshev")


def _below(elements: ElementSet) -> ElementSet:
    """The same, half a unit below a free surface."""
    return replace(elements, half_plane=HalfPlane((0.0, 1.5)))


def _least(work: Callable[[], object], repeats: int) -> float:
    """CPU time of the fastest run, ns."""
    work()
    times = []
    for _ in range(repeats):
        start = time.thread_time_ns()
        work()
        times.append(time.thread_time_ns() - start)
    return float(min(times))
