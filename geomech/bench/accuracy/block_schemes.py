"""Run time against error of the block solver's schemes: Shi's, Newmark's, α; springs and multipliers in contacts.

Each problem has a closed form. Everything is timed in one run of one process, the shortest of some repetitions, from
given blocks to the last state.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from ...model import BaseMotion, Blocks, DdaSettings, History, JointLaw, Loads, Material, State
from ...output.tables.summary import write_json
from ...reference.blocks import block_chain
from ...reference.blocks.base_shaking import sliding_block
from ...reference.blocks.block_motion import column_shortening
from ..cost import block_scenes
from ..cost.block_scenes import GRAVITY, ROCK, WEIGHT
from ..figures import Measured, Point, stopwatch

#: Folder of the picture and the numbers, in the working folder.
FOLDER = Path("outputs/bench_schemes")

SHI, TRAPEZOIDAL, ALPHA, AUGMENTED = "Shi's scheme, springs", "Newmark (¼, ½), springs", "α-scheme, ϱ = 0.8, springs", (
    "Shi's scheme, multipliers"
)  # fmt: skip
SCHEMES = {
    SHI: {},
    TRAPEZOIDAL: {"newmark": (0.25, 0.5)},
    ALPHA: {"spectral_radius": 0.8},
    AUGMENTED: {"contact": "augmented"},
}
METHODS = tuple(SCHEMES)


def measure(quick: bool = False) -> Measured:
    """The table; writes ``work_precision.png`` and ``work_precision.json`` to `FOLDER`. ``quick`` takes the two
    coarsest sizes."""
    from ...render.benchmarks.work_precision import draw

    points = list(_points(2 if quick else None))
    FOLDER.mkdir(parents=True, exist_ok=True)
    record = {"points": [asdict(p) for p in points], "quick": quick}
    write_json(FOLDER / "work_precision.json", record)
    if not quick:
        draw(
            points, METHODS, FOLDER / "work_precision.png", (2, 2), lambda p: f"{p.size:g}",
            ("relative error, better to the right", "time, ms"), None,
        )  # fmt: skip
    named = [(f"{p.problem}, {p.method}: {p.size:g}", p) for p in points]
    return Measured.of(
        _table(points),
        errors={name: p.error for name, p in named},
        times={name: p.seconds for name, p in named},
    )


def errors() -> dict[str, float]:
    """Errors of the coarsest sizes, with their names in `measure`'s figures; each scene is run once."""
    return {
        f"{problem}, {method}: {sizes[0]:g}": scene(sizes[0], SCHEMES[method])()
        for problem, (sizes, methods, scene) in PROBLEMS.items()
        for method in methods
    }


def _points(sizes_of_each: int | None) -> Iterator[Point]:
    """The shortest of as many runs as fit in a tenth of a second; the first of a method's coarsest size, which may
    compile, does not count."""
    for problem, (sizes, methods, scene) in PROBLEMS.items():
        for method in methods:
            for size in sizes[:sizes_of_each]:
                run = scene(size, SCHEMES[method])
                times, error = [], run() if size == sizes[0] else math.nan
                while not times or (sum(times) < 0.1 and len(times) < 10):
                    spent_on = stopwatch()
                    error = run()
                    times.append(spent_on())
                yield Point(problem, method, size, max(error, 1e-16), min(times))


def _wave(dt: float, scheme: dict) -> Callable[[], float]:
    """A pulse of about ten blocks' length travels eight blocks along a row of forty, bonded.

    Error of all displacements, relative to the largest.
    """
    n, youngs_modulus, density, joint, end = 40, 10e9, 2600.0, 20e9, 4.8e-3
    rock = Material("rock", youngs_modulus, 0.0, density=density)
    law = JointLaw("bonded", 0.5, 1e9, 1e9, normal_stiffness=joint, shear_stiffness=joint)
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    blocks = Blocks.from_polygons([square + [k, 0.0] for k in range(n)])
    settings = DdaSettings(time_step=dt, dynamic_factor=1.0, damping=0.0, max_displacement_ratio=1.0, **scheme)
    pulse = 1e-3 * np.exp(-(((np.arange(n) - 20) / 4.0) ** 2))
    rate = np.zeros(2 * n)
    rate[::2] = pulse
    exact, _ = block_chain.chain_motion(*block_chain.chain_matrices(n, 1.0, density, joint, youngs_modulus), rate, end)

    def run() -> float:
        state = State.at_rest(blocks)
        state.velocity[:, 0] = pulse
        *_, last = _states(blocks, [rock], [law], Loads(), settings, state, round(end / dt))
        moved = blocks.mean_vertices(last.vertices - blocks.vertices)[:, 0]
        return float(np.abs(moved - exact[::2]).max() / np.abs(exact[::2]).max())

    return run


def _shaken(dt: float, scheme: dict) -> Callable[[], float]:
    """A block on an incline of 20°, friction 30°, is shaken horizontally and slips at every swing.

    Error of its displacement at all times, relative to the total.
    """
    slope, friction, end = math.radians(20), math.radians(30), 1.2
    blocks, times = block_scenes.incline(slope), np.linspace(0.0, end, 2401)
    # Towards the upper side of the incline, which is on the left.
    base = 4.0 * np.sin(2 * np.pi * 2.5 * times)
    exact = sliding_block(times, base, slope, friction)
    record = History(times, np.column_stack([-base, np.zeros(len(times))]))
    loads = Loads(gravity=WEIGHT.gravity, base=BaseMotion(record, "base"))
    law, rock = JointLaw("joint", friction_angle=friction), replace(ROCK, poissons_ratio=0.0)
    settings = DdaSettings(time_step=dt, dynamic_factor=1.0, max_displacement_ratio=0.5, **scheme)
    down = np.array([math.cos(slope), -math.sin(slope)])

    def run() -> float:
        from ... import dda

        still = dda.BlockSystem(blocks, [rock], [law], settings=replace(settings, dynamic_factor=0.0))
        rest = dda.equilibrium(still, State.at_rest(blocks), WEIGHT).state
        rest = replace(rest, time=0.0)
        rows = [(s.time, (s.vertices - rest.vertices)[4:].mean(axis=0) @ down) for s in _states(
            blocks, [rock], [law], loads, settings, rest, round(end / dt)
        )]  # fmt: skip
        seen, way = np.array(rows).T
        return float(np.abs(way - np.interp(seen, times, exact)).max() / np.abs(exact).max())

    return run


def _column(penalty: float, scheme: dict) -> Callable[[], float]:
    """Twenty blocks at rest under their own weight: error of the shortening, to which soft springs contribute."""
    n = 20
    blocks = block_scenes.column(n)
    settings = DdaSettings(
        time_step=1.0, max_displacement_ratio=1.0, normal_penalty=penalty * ROCK.youngs_modulus, **scheme
    )
    # On average a block carries the weight above it and half its own.
    carried = ROCK.density * GRAVITY * (np.arange(n) + 0.5)
    exact = column_shortening(carried, 1.0, 1.0, ROCK.plane_modulus, math.inf)

    def run() -> float:
        *_, last = _states(blocks, [ROCK], [JointLaw("smooth")], WEIGHT, settings, State.at_rest(blocks), 2)
        return float(abs((n - last.vertices[:, 1].max()) / exact - 1))

    return run


def _states(blocks, rocks, laws, loads, settings, state: State, steps: int) -> Iterator[State]:
    from ... import dda

    system = dda.BlockSystem(blocks, rocks, laws, settings=settings)
    for _ in range(steps):
        state = system.step(state, loads).state
        yield state


#: Name → sizes, methods, and the scene: (size, settings) → a function that runs it and returns its error.
PROBLEMS = {
    "wave along a row, by time step (s)": (
        (4e-4, 2e-4, 1e-4, 5e-5, 2.5e-5), (SHI, TRAPEZOIDAL, ALPHA), _wave
    ),
    "slip on a shaken incline, by time step (s)": ((8e-3, 4e-3, 2e-3, 1e-3, 5e-4), METHODS, _shaken),
    "column at rest, by penalty (E)": ((1.0, 10.0, 100.0, 1e3, 1e4), (SHI, AUGMENTED), _column),
}  # fmt: skip


def _table(points: list[Point]) -> str:
    lines = ["Schemes of the block solver: error against closed forms, and time"]
    for problem in PROBLEMS:
        lines += ["", problem]
        for method in METHODS:
            curve = [p for p in points if (p.problem, p.method) == (problem, method)]
            for p, before in zip(curve, [None, *curve]):
                order = math.nan if before is None else math.log(before.error / p.error, before.size / p.size)
                order_text = "" if before is None or "step" not in problem else f"   order {order:5.2f}"
                label = "" if before else method
                lines.append(f"  {label:<30}{p.size:>10g}   {p.error:8.1e}   {1e3 * p.seconds:9.2f} ms{order_text}")
    return "\n".join(lines)
