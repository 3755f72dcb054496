"""Skipped work: the time that each skip saves, and a check that results are the same.

Every row is the same work twice in one process, without and with the skip, the shorter of two times each (one in a
quick run); the difference is the largest relative one of the states' coordinates and stress intensity factors. Modules
are counted in separate processes.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ..model import Blocks, Cracks, Problem, State
from .cost import block_scenes
from .figures import Measured, stopwatch

#: Folder of the picture, in the working folder.
FOLDER = Path("outputs/bench_skips")
SPECIMEN = Path("pipelines/two_cracks/toml.toml")
#: Modules that a scene of blocks must not import, nor one of cracks without interior fields.
CRACK_SOLVER, MESHER, PICTURES = "geomech.ddm.body", "gmsh", "vtkmodules"

#: Results of a run: coordinates and stress intensity factors.
Results = list[np.ndarray]


def measure(quick: bool = False) -> Measured:
    """The table; writes ``skips.png`` to `FOLDER`. Raises AssertionError if results with a skip differ."""
    from ..render.benchmarks.bars import draw_bars

    rows = [*_rows(quick)]
    width = max(len(label) for label, *_ in rows)
    lines = [f"{'what is not done':<{width}}     without      with    times   difference"]
    differences, times = {}, {}
    for label, without, with_it, difference in rows:
        lines.append(
            f"{label:<{width}}  {1e3 * without:8.1f} ms {1e3 * with_it:8.1f} ms {without / with_it:7.1f}   "
            f"{difference:8.1e}"
        )
        differences[label], times[label] = difference, with_it
    worst = max(differences.values())
    # Kept factors are updated by rows and columns, which causes round-off; everything else is equal bit for bit.
    if worst > 1e-9:
        raise AssertionError(f"results with and without a skip differ by {worst:.1e}")
    ways = {"with the skip": [row[2] for row in rows], "without": [row[1] for row in rows]}
    ways = {way: {row[0]: 1e3 * spent for row, spent in zip(rows, times_of)} for way, times_of in ways.items()}
    if not quick:
        draw_bars(ways, FOLDER / "skips.png", "ms", "What is not done, and what doing it would take")
    lines += ["", *_modules()]
    return Measured.of("\n".join(lines), errors=differences, times=times)


def _rows(quick: bool) -> Iterator[tuple[str, float, float, float]]:
    times, cracks, steps = (1, 10, 3) if quick else (2, 20, 5)
    cracked = block_scenes.cracked_wall(40 if quick else 200, cracks)
    cracked = replace(cracked, run=replace(cracked.run, end_time=(steps - 0.5) * block_scenes.CRACKED_WALL_STEP))
    label = (
        f"bodies, factors and compliances of what has not changed: a wall with {cracks} cracked bricks, {steps} steps"
    )
    yield label, *_twice(times, lambda skip: _coupled(replace(cracked, run=replace(cracked.run, skip=skip))))
    if SPECIMEN.exists():
        specimen = _specimen(0.2 if quick else 1.0)
        label = "the same while cracks grow: the two-crack specimen"
        yield label, *_twice(times, lambda skip: _coupled(replace(specimen, run=replace(specimen.run, skip=skip))))
        yield (
            "fields inside the blocks, which were not asked for: the same run, written",
            *_twice(times, lambda skip: _written(specimen, interior=not skip)),
        )
    yield "search for pairs of blocks that have hardly moved: a wall of 1000, 20 searches", *_twice(times, _searches)
    yield "search for contacts of a block that is the only one: 1000 searches", *_twice(times, _lone_searches)
    blocks_alone = replace(cracked, cracks=Cracks.from_polylines([]))
    yield (
        "the coupling, where nothing is cracked: that wall against the block solver alone",
        *_twice(times, lambda skip: _blocks(blocks_alone) if skip else _coupled(blocks_alone)),
    )


def _twice(times: int, run: Callable[[bool], Results]) -> tuple[float, float, float]:
    """Seconds without the skip, with it, and the difference of the results. Everything is run once before."""
    run(True)
    spent: dict[bool, list[float]] = {False: [], True: []}
    found: dict[bool, Results] = {}
    for skip in (False, True) * times:
        spent_on = stopwatch()
        found[skip] = run(skip)
        spent[skip].append(spent_on())
    difference = max(
        (
            float(np.abs(a - b).max() / np.abs(b).max())
            for a, b in zip(found[True], found[False], strict=True)
            if a.size
        ),
        default=0.0,
    )
    return min(spent[False]), min(spent[True]), difference


def _coupled(problem: Problem) -> Results:
    from ..coupling import cycles

    *_, last = cycles(problem)
    factors = np.concatenate([last.tips["k_i"], last.tips["k_ii"]]) if len(last.tips) else np.empty(0)
    return [last.state.vertices, factors]


def _blocks(problem: Problem) -> Results:
    from .. import dda

    states = dda.run(
        problem.blocks, problem.materials, problem.joints, problem.loads, problem.dda, problem.run.end_time
    )
    *_, last = states
    return [last.vertices, np.empty(0)]


def _specimen(part: float) -> Problem:
    """The two-crack specimen, φ = 0, up to this ``part`` of the load at which its cracks coalesce."""
    from ..scene import load_scene

    return load_scene(SPECIMEN, [f"run.end_time_s={1050 * part:g}"], "phi_0").problem()


def _written(problem: Problem, interior: bool) -> Results:
    from ..coupling import cycles
    from ..output.vtk.series import Series

    with TemporaryDirectory() as folder:
        observer = Series(interior_every=5 if interior else 0)
        observer.on_start(problem, Path(folder))
        for last in cycles(problem):
            observer.on_cycle(last)
        observer.on_end({})
    return [last.state.vertices, np.concatenate([last.tips["k_i"], last.tips["k_ii"]])]


def _searches(skip: bool) -> Results:
    """Pairs of blocks that move by a thousandth of the window each time, searched again or kept; each list as a set of
    results."""
    from ..dda.contact_detection import neighbour_search

    blocks = block_scenes.wall(1000)
    window, vertices = 0.01, State.at_rest(blocks).vertices
    kept = neighbour_search.NearPairs(blocks.vertex_start, blocks.fixed)
    box = neighbour_search.boxes(vertices, blocks.vertex_start[:-1])
    near = [
        kept.of(vertices + 1e-5 * k, window) if skip else neighbour_search.near_pairs(box, blocks.fixed, 2.0 * window)
        for k in range(20)
    ]
    return [pairs.astype(float) for pairs in near[-1:]]


def _lone_searches(skip: bool) -> Results:
    """Pairs of a single block: none, whether they are searched for or not."""
    from ..dda.contact_detection import neighbour_search

    blocks = Blocks.from_polygons([np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])])
    vertices, first = State.at_rest(blocks).vertices, blocks.vertex_start
    kept, pairs = neighbour_search.NearPairs(first, blocks.fixed), np.empty((0, 2))
    for _ in range(1000):
        if skip:
            pairs = kept.of(vertices, 0.01)
        else:
            pairs = neighbour_search.near_pairs(neighbour_search.boxes(vertices, first[:-1]), blocks.fixed, 0.02)
    return [np.array([float(len(pairs)) + 1.0]), np.empty(0)]


def _modules() -> list[str]:
    """Imported modules of runs, each in a separate process; AssertionError if one imports what it does not need."""
    from .cost.startup import COMMANDS

    lines = ["modules that a run does not load"]
    for label, unwanted, overrides in (
        ("run, blocks alone (Gmsh)", (CRACK_SOLVER, PICTURES), []),
        ("run, cracks too (TOML)", (MESHER, PICTURES), ["--set", "output.interior=false"]),
    ):
        command = COMMANDS[label]
        scene = Path(command[1])
        if not scene.exists():
            continue
        with TemporaryDirectory() as folder:
            code = (
                "import sys\nfrom geomech.cli import main\n"
                f"main({[*command, *overrides, '--quiet', '--out', folder]!r})\n"
                "print(*sorted(sys.modules))"
            )
            done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        loaded = set(done.stdout.splitlines()[-1].split())
        there = [name for name in unwanted if name in loaded]
        if there:
            raise AssertionError(f"{label} loads {', '.join(there)}")
        lines.append(f"  {label}{' without interior fields' if overrides else ''}: neither {' nor '.join(unwanted)}")
    return lines
