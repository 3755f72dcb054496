"""Run time against error in bending: one block of order p, cells, uniformly strained sub-blocks, finite elements.

A panel is clamped on its left side and loaded by a uniform shear traction on its right. The error is that of its
elastic energy, half the work of the load: for a cantilever of slenderness 8 with zero Poisson's ratio, whose stress is
smooth except at the ends, and for Cook's membrane, whose stress is singular at the upper corner of the clamp. The
reference is finite elements (`geomech.bench.peers.quadratic_quads`) with 66 690 unknowns, for the membrane extrapolated
to four digits. Everything is timed in one run of one process, from given blocks or a given grid to the energy.

A wall under sudden weight shows what an open–close iteration of many blocks costs at orders 2 and 3. Steps of all orders
alternate, so that other work on the machine slows all of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...model import Blocks, DdaSettings, EdgeTraction, History, JointLaw, Loads, Material, State
from ..cost import block_scenes
from ..cost.block_cost import TIME_STEP
from ..figures import Measured, Point, stopwatch
from ..peers import finite_elements

ONE, CELLS, STRAINED, FEM = "one block", "cells", "sub-blocks of first order, glued", "finite elements, Q2 (scikit-fem)"
#: 1/m: a clamp with this stiffness relative to E yields by less than 1e-6 of the panel's displacement; on a stiffer
#: one, round-off in coordinates of 50 m would cause forces.
_CLAMP = 1e6
#: Number of repetitions, of which the shortest counts.
_TIMES = 3
#: Bricks of the wall, in a quick and in a full run, and its steps. Those of order 1 are as many times as many.
_BRICKS, _STEPS, _MORE = (100, 1000), 4, 4
WALL_ORDERS = 1, 2, 3


@dataclass(frozen=True)
class Panel:
    """A panel of ``rock``.

    corners   (4, 2) m counter-clockwise from the lower left
    columns, rows   of the coarsest grid
    traction  Pa, upwards on its right side
    exact     elastic energy, J/m
    """

    corners: np.ndarray
    rock: Material
    columns: int
    rows: int
    traction: float
    exact: float

    def grid(self, n: int) -> list[np.ndarray]:
        """Quadrilaterals (4, 2), ``n`` times as many in each direction as in the coarsest grid."""
        s, t = np.meshgrid(np.linspace(0, 1, n * self.columns + 1), np.linspace(0, 1, n * self.rows + 1), indexing="ij")
        share = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t], axis=-1)
        at = share @ self.corners
        return [
            np.array([at[i, j], at[i + 1, j], at[i + 1, j + 1], at[i, j + 1]])
            for i in range(len(s) - 1)
            for j in range(len(t[0]) - 1)
        ]


PANELS = {
    "cantilever": Panel(
        np.array([[0, 0], [8, 0], [8, 1], [0, 1.0]]), Material("rock", 2e10, 0.0, 2500.0, plane="stress"), 8, 1, -1e5,
        516.8097,
    ),
    "Cook's membrane": Panel(
        np.array([[0, 0], [48, 44], [48, 60], [0, 44.0]]), Material("rock", 1e9, 1 / 3, 2500.0, plane="stress"), 2, 2, 62.5,
        0.0120206,
    ),
}  # fmt: skip


def measure(quick: bool = False) -> Measured:
    """The table; ``quick`` takes two sizes of each."""
    points = list(_points(2 if quick else 4))
    named = [(f"{p.problem}, {p.method}: {p.size:g}", p) for p in points]
    bricks = _BRICKS[not quick]
    costs = wall_iterations(bricks)
    times = {name: p.seconds for name, p in named}
    times |= {f"wall of {bricks} bricks, order {order}: iteration": cost for order, cost in costs.items()}
    text = f"{table(points)}\n{wall_table(bricks, costs)}"
    return Measured.of(text, errors={name: p.error for name, p in named}, times=times)


def wall_iterations(bricks: int, steps: int = _STEPS) -> dict[int, float]:
    """order → CPU seconds of an open–close iteration of a wall of ``bricks`` under sudden weight, all work of the first
    ``steps`` steps included."""
    small = {order: _Wall(100, order) for order in WALL_ORDERS}
    walls = {order: _Wall(bricks, order) for order in WALL_ORDERS}
    for order in WALL_ORDERS:  # compiles
        small[order].step()
        small[order].step()
    for _ in range(steps):
        for order, wall in walls.items():
            for _ in range(_MORE if order == 1 else 1):
                wall.step()
    return {order: wall.seconds / wall.iterations for order, wall in walls.items()}


class _Wall:
    """A wall of about ``bricks`` of this ``order``; ``seconds`` and ``iterations`` of its steps so far."""

    def __init__(self, bricks: int, order: int) -> None:
        from ...dda import BlockSystem

        blocks = block_scenes.wall(bricks)
        if order > 1:
            blocks = replace(blocks, order=np.where(blocks.fixed, 1, order))
        self.system = BlockSystem(
            blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=block_scenes.settings(TIME_STEP)
        )
        self.state, self.seconds, self.iterations = State.at_rest(blocks), 0.0, 0.0

    def step(self) -> None:
        work = self.system.work
        known, spent_on = work.factorisations + work.factorisations_kept, stopwatch()
        result = self.system.step(self.state, block_scenes.WEIGHT)
        self.seconds += spent_on()
        iterations = result.statistics["open_close_iterations"]
        if result.statistics["step_cuts"]:
            # Attempts that were cut count too.
            iterations = max(iterations, work.factorisations + work.factorisations_kept - known)
        self.iterations += iterations
        self.state = result.state


def wall_table(bricks: int, costs: dict[int, float]) -> str:
    """Cost of an iteration of each order, and its ratio to that of order 1."""
    row = "   ".join(f"{order}: {1e3 * cost:.1f} ({cost / costs[1]:.1f})" for order, cost in costs.items())
    return f"open-close iteration of a wall of {bricks} bricks: order: ms (times that of order 1)\n  {row}"


def energy(panel: Panel, n: int, order: int, *, glued: bool = True) -> float:
    """Elastic energy, J/m, of ``panel`` divided into ``n`` times its coarsest grid (0: one block).

    Cells have this ``order``; if not ``glued``, sub-blocks of first order are connected by joints.
    """
    cells = [panel.corners] if n == 0 else panel.grid(n)
    polygons = [panel.corners[[0, 3]][[0, 1, 1, 0]] - [[0, 0], [0, 0], [1, 0], [1, 0]], *cells]
    right = panel.corners[1:3].mean(axis=0)[0]
    names = [
        [["loaded" if np.allclose(ends[:, 0], right) else "" for ends in np.stack([p, np.roll(p, -1, axis=0)], axis=1)]]
        for p in polygons
    ]
    blocks = Blocks.from_polygons(
        polygons, fixed=[True] + [False] * len(cells), order=[1] + [order] * len(cells), edge_names=names
    )
    stiff = _CLAMP * panel.rock.youngs_modulus
    clamp = JointLaw("clamp", 0.5, cohesion=1e15, tensile_strength=1e15, normal_stiffness=stiff, shear_stiffness=stiff)
    if glued and n:
        blocks = replace(blocks, glued=_faces(blocks))
    else:
        clamp = clamp if not n else JointLaw("glue", 0.5, cohesion=1e15, tensile_strength=1e15)
    from ...dda import BlockSystem

    settings = DdaSettings(dynamic_factor=0.0, time_step=1e3, max_displacement_ratio=1.0)
    system = BlockSystem(blocks, [panel.rock], [clamp], settings=settings)
    loads = Loads(edge_tractions=(EdgeTraction("loaded", History.constant((0.0, panel.traction))),))
    return system.step(State.at_rest(blocks), loads).energy.elastic


def _faces(blocks: Blocks) -> np.ndarray:
    """(m, 2) edges of moving blocks that coincide."""
    seen: dict[tuple, int] = {}
    pairs = []
    for v in np.flatnonzero(~blocks.fixed[blocks.vertex_block]).tolist():
        one, two = (tuple(np.round(blocks.vertices[k], 9).tolist()) for k in (v, blocks.next_vertex[v]))
        if (two, one) in seen:
            pairs.append((seen[two, one], v))
        seen[one, two] = v
    return np.array(pairs)


def _points(sizes: int) -> Iterator[Point]:
    """All methods for all panels; each grid is twice as fine as the previous one, for ``sizes`` grids."""
    refined = (1, 2, 4, 8)[:sizes]
    for problem, panel in PANELS.items():
        for order in (1, 2, 3, 5, 8)[: sizes + 1]:
            yield _timed(problem, ONE, order, lambda panel=panel, order=order: energy(panel, 0, order))
        for order in (2, 3, 4):
            for n in refined[: max(1, sizes + 2 - order)]:
                name = f"{CELLS} of order {order}"
                yield _timed(problem, name, n, lambda panel=panel, n=n, order=order: energy(panel, n, order))
        for n in refined:
            yield _timed(problem, STRAINED, n, lambda panel=panel, n=n: energy(panel, n, 1, glued=False))
        if finite_elements.available():
            from ..peers.quadratic_quads import stored_energy

            force = np.array([0.0, panel.traction])
            for n in refined:
                yield _timed(
                    problem, FEM, n,
                    lambda panel=panel, n=n, force=force: stored_energy(
                        panel.corners, n * panel.columns, n * panel.rows, panel.rock, force
                    )[0],
                )  # fmt: skip


def _timed(problem: str, method: str, size: int, run) -> Point:
    """Error and shortest time of ``run``; the first one may compile."""
    found, times = run(), []
    for _ in range(_TIMES):
        spent_on = stopwatch()
        run()
        times.append(spent_on())
    return Point(problem, method, size, abs(found / PANELS[problem].exact - 1), min(times))


def _observed(points: list[Point]) -> str:
    """How fast the error of one method decreases over its last two sizes: as h to an observed order, or, with the order of one
    block, in decimal digits an order."""
    if len(points) < 2:
        return ""
    first, last = points[-2:]
    if last.method == ONE:
        return f"   {math.log10(first.error / last.error) / (last.size - first.size):.2f} digits an order"
    return f"   h^{math.log(first.error / last.error) / math.log(last.size / first.size):.1f}"


def table(points: list[Point]) -> str:
    """Errors and times, method by method, with observed orders."""
    lines = ["energy of bent panels: order of one block, or how often the coarsest grid is refined; relative error, ms"]
    for problem in dict.fromkeys(p.problem for p in points):
        lines.append(problem)
        for method in dict.fromkeys(p.method for p in points if p.problem == problem):
            selected = [p for p in points if (p.problem, p.method) == (problem, method)]
            row = "   ".join(f"{p.size:g}: {p.error:.1e} {1e3 * p.seconds:7.1f}" for p in selected)
            lines.append(f"  {method:<34}{row}{_observed(selected)}")
    if not finite_elements.available():
        lines.append("  (finite elements: pip install 'geomech[bench]')")
    return "\n".join(lines)
