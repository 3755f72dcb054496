"""Cost of writing a large run: a wall of 10 000 bricks over 500 cycles, compared with the steps and with other writers.

A run of some steps gives the cost of a step while blocks move; its last cycle is then written as often as in a long
run, with a small motion from one to the next, so that all numbers in the files differ. The share of writing is its
processor time relative to that of a step and writing, as if nothing ran in parallel; the run itself waits for less.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from ...model import Cracks, Cycle, DdmSettings, GrowthSettings, Problem, RunSettings
from ...output.tables.summary import write_json
from ..figures import Measured, stopwatch
from . import block_scenes

#: Folder of the numbers, in the working folder.
FOLDER = Path("outputs/bench_output")
TIME_STEP = 1e-2
#: Goal: share of writing in a run of 10 000 blocks (smaller walls step faster than they are written).
SHARE = 0.1


@dataclass(frozen=True)
class Written:
    """Cost of writing `blocks` over ``cycles`` cycles.

    Waiting time of the run and ``processor`` time of all threads, s per cycle; bytes of files per cycle, and of the
    blocks' file per cell; bytes of arrays (uncompressed) per second until all is on disk, by the clock and of the
    processor.
    """

    blocks: int
    cells: int
    cycles: int
    waited: float
    processor: float
    bytes_a_cycle: float
    bytes_a_cell: float
    rate: float
    processor_rate: float


def wall(n: int, end: float) -> Problem:
    """A dry wall under its weight, from rest."""
    return Problem(
        title="a wall",
        blocks=block_scenes.wall(n),
        cracks=Cracks.from_polylines([]),
        materials=(block_scenes.ROCK,),
        joints=(block_scenes.JOINT,),
        loads=block_scenes.WEIGHT,
        dda=block_scenes.settings(TIME_STEP),
        ddm=DdmSettings(),
        growth=GrowthSettings(),
        run=RunSettings(end_time=end),
    )


def measure(quick: bool = False) -> Measured:
    """The table; writes ``output.json`` and ``output.png`` to `FOLDER`. ``quick``: 500 bricks, 30 cycles."""
    from ...render.benchmarks.bars import draw_bars

    n, cycles, steps = (500, 30, 8) if quick else (10_000, 500, 4)
    problem = wall(n, (steps - 0.5) * TIME_STEP)
    spent, cycle = steps_of(problem)
    found = series(problem, cycle, cycles)
    moving, last = statistics.median(spent), spent[-1]
    share, at_rest = (found.processor / (found.processor + step) for step in (moving, last))
    writers = {name: statistics.median(times) for name, times in _writers(problem, cycle, 3 if quick else 5).items()}
    FOLDER.mkdir(parents=True, exist_ok=True)
    record = {
        "series": asdict(found), "steps_s": spent, "share of a step": share, "share of the last step": at_rest,
        "writers_s": writers, "quick": quick,
    }  # fmt: skip
    write_json(FOLDER / "output.json", record)
    own_time = writers[OURS]
    spent_on = {f"one file of the blocks: {name}": 1e3 * spent for name, spent in writers.items()}
    spent_on |= {"all series, a cycle": 1e3 * found.processor, "a step after sudden weight": 1e3 * moving}
    if not quick:
        draw_bars(
            {"ms": spent_on}, FOLDER / "output.png", "ms (files by the clock, cycles and steps of processor)",
            f"Writing {found.blocks} blocks",
        )  # fmt: skip
    lines = [
        (
            f"{found.blocks} blocks, {found.cells} triangles, {found.cycles} cycles written: "
            f"{found.bytes_a_cycle / 1e6:.2f} MB a cycle"
        ),
        f"  the blocks' series takes {found.bytes_a_cell:.0f} bytes a cell",
        (
            f"  {found.rate / 1e6:.0f} MB of arrays per second until all is on disk, {found.processor_rate / 1e6:.0f} MB "
            "per second of processor time"
        ),
        (
            f"  a cycle takes {1e3 * found.processor:.1f} ms of processor time, the run waits {1e3 * found.waited:.1f} ms "
            "for it"
        ),
        (
            f"share of writing in a run, cycle / (step + cycle), in processor time: {share:.1%} (goal for 10 "
            f"000 blocks: below {SHARE:.0%})"
        ),
        f"  relative to a step of {1e3 * TIME_STEP:g} ms, {moving:.3g} s: median of steps 2 to {steps} after sudden weight",
        f"  relative to the last of these steps, {last:.3g} s: {at_rest:.1%}",
        "one file of the blocks, written by this project and by others",
    ]
    lines += [f"  {name:<32}{1e3 * spent:9.1f} ms  {spent / own_time:6.1f} times" for name, spent in writers.items()]
    return Measured.of(
        "\n".join(lines), times={"a cycle": found.processor} | {f"a file: {k}": v for k, v in writers.items()}
    )


def steps_of(problem: Problem) -> tuple[list[float], Cycle]:
    """Processor seconds of every load step of ``problem`` except the first, without output, and its last cycle."""
    from ...coupling import cycles

    spent, cycle, began = [], None, 0.0
    for cycle in cycles(problem):
        # Compiled kernels and orderings are in the first step.
        if cycle.load_step > 1:
            spent.append(time.process_time() - began)
        began = time.process_time()
    return spent, cycle


def moved_on(cycle: Cycle, count: int) -> Iterator[Cycle]:
    """``count`` cycles after ``cycle``, each with blocks moved along their velocities and larger forces."""
    for k in range(1, count + 1):
        vertices = cycle.state.vertices * (1.0 + 1e-7 * k)
        stress = cycle.state.stress * (1.0 + 1e-3 * k)
        state = replace(cycle.state, time=cycle.state.time + k * TIME_STEP, vertices=vertices, stress=stress)
        yield replace(cycle, number=cycle.number + k, state=state, events=())


def series(problem: Problem, cycle: Cycle, count: int) -> Written:
    """All series of ``count`` cycles like ``cycle``, into a temporary folder (some gigabytes)."""
    from ...output.vtk.series import Series

    with tempfile.TemporaryDirectory() as scratch:
        folder, size, blocks_size = Path(scratch), 0, 0
        observer = Series(interior_every=0)
        observer.on_start(problem, folder)
        began, own = time.perf_counter(), time.process_time()
        for each in moved_on(cycle, count):
            observer.on_cycle(each)
        waited = observer.seconds
        observer.on_end({})
        whole, processor = time.perf_counter() - began, time.process_time() - own
        for file in folder.rglob("*.vtu"):
            size += file.stat().st_size
            blocks_size += file.stat().st_size * file.name.startswith("blocks_")
    cells = int((np.diff(problem.blocks.vertex_start) - 2).sum())
    arrays = sum(
        array.nbytes
        for grid in _grids(problem, cycle)
        for array in (grid.points, grid.connectivity, *grid.point_data.values(), *grid.cell_data.values())
    )
    return Written(
        problem.blocks.n_blocks, cells, count, waited / count, processor / count, size / count,
        blocks_size / count / cells,
        arrays * count / whole, arrays * count / processor,
    )  # fmt: skip


def _grids(problem: Problem, cycle: Cycle) -> list:
    from ...output.vtk import grids
    from ...output.vtk.triangulate import Triangles

    blocks = grids.blocks_grid(cycle, problem.materials, "reference", Triangles(), grids.KeyBlocks(problem))
    return [blocks, grids.contacts_grid(cycle, "reference")]


OURS = "this project"


def _writers(problem: Problem, cycle: Cycle, repeats: int) -> dict[str, list[float]]:
    """{name: seconds per file}; all hold the same arrays, zlib-compressed, in 64-bit numbers."""
    import meshio
    import pyvista

    from ...output.vtk.vtu import TRIANGLE, GridFiles

    grid = _grids(problem, cycle)[0]
    cells = grid.connectivity.reshape(-1, 3)
    points = np.column_stack([grid.points, np.zeros(len(grid.points))])
    files = GridFiles("blocks")

    def with_meshio(path: Path) -> None:
        data = {name: [np.asarray(array)] for name, array in grid.cell_data.items()}
        data = {name: [array[0].astype("u1") if array[0].dtype == bool else array[0]] for name, array in data.items()}
        meshio.Mesh(points, [("triangle", cells)], dict(grid.point_data), data).write(path)

    def with_pyvista(path: Path) -> None:
        mesh = pyvista.UnstructuredGrid({TRIANGLE: cells}, points)
        mesh.point_data.update({name: np.asarray(array) for name, array in grid.point_data.items()})
        mesh.cell_data.update({name: np.asarray(array) for name, array in grid.cell_data.items()})
        mesh.save(path)

    writers: dict[str, Callable[[Path], object]] = {
        OURS: lambda path: files.write(path, grid, {}),
        "meshio": with_meshio,
        "PyVista (VTK's own)": with_pyvista,
    }
    spent: dict[str, list[float]] = {name: [] for name in writers}
    with tempfile.TemporaryDirectory() as folder:
        for k in range(repeats):
            for name, write in writers.items():
                spent_on = stopwatch()
                write(Path(folder) / f"{k}.vtu")
                spent[name].append(spent_on())
    return spent
