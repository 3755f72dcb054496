"""Computed values compared with published or closed-form ones, as in the README's table "Accuracy", with default
settings unless the row states otherwise."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..figures import Measured
from . import crack_accuracy
from .crack_accuracy import Row, pulled

PIPELINE = Path("pipelines/two_cracks")
#: Folder of the picture, in the working folder.
FOLDER = Path("outputs/bench_accuracy")


def measure(quick: bool = False) -> Measured:
    """The table; writes ``accuracy.png`` to `FOLDER`. ``quick`` draws nothing."""
    from ...render.benchmarks.bars import draw_bars

    found = table()
    errors = {figure.name: figure.value for figure in found.figures}
    if not quick:
        draw_bars(
            {"error": errors}, FOLDER / "accuracy.png", "relative error", "Computed against published or closed form"
        )
    return found


def table() -> Measured:
    """The table. The last rows need ``pipelines/two_cracks`` (run it in the project's folder) and are left out
    elsewhere."""
    rows = [*crack_accuracy.rows(), *_blocks()]
    if PIPELINE.is_dir():
        rows += _coupled()
    width = max(len(row[0]) for row in rows)
    lines = [f"{'case':<{width}}  {'computed':>14}  {'reference':>14}  {'error':>8}  source"]
    errors, subject = {}, ""
    for case, computed, reference, source in rows:
        error = abs(computed / reference - 1) if reference else abs(computed)
        subject = subject if case.startswith("the same") else case.partition(":")[0]
        errors[f"{subject}; {case}" if case.startswith("the same") else case] = error
        lines.append(f"{case:<{width}}  {computed:>14.8g}  {reference:>14.8g}  {error:8.1e}  {source}")
    return Measured.of("\n".join(lines), errors=errors)


def _blocks() -> Iterator[Row]:
    from ... import dda
    from ...model import Blocks, DdaSettings, History, JointLaw, Loads, Material
    from ...reference.blocks import block_motion

    rock = Material("rock", 10e9, 0.25, density=2600.0)
    weight = Loads(gravity=History.constant([0.0, -9.81]))
    settings = DdaSettings(time_step=1e-3, dynamic_factor=1.0, max_displacement_ratio=0.05)
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])

    def travel(polygons, fixed, friction, end):
        blocks = Blocks.from_polygons(polygons, fixed=fixed)
        *_, last = dda.run(blocks, [rock], [JointLaw("joint", friction_angle=friction)], weight, settings, end)
        own = blocks.vertex_block == blocks.n_blocks - 1
        return np.hypot(*(last.vertices - blocks.vertices)[own].mean(axis=0))

    fall = block_motion.free_fall(np.array([0.5]), np.array([0.0, -9.81]), np.zeros(2))[0]
    yield "free fall, dt = 1 ms: metres in 0.5 s", travel([square], [False], 0.0, 0.5), float(np.hypot(*fall)), "g t²/2"
    slope = math.radians(30)
    turn = np.array([[math.cos(slope), math.sin(slope)], [-math.sin(slope), math.cos(slope)]])
    base = np.array([[-20.0, -1.0], [20.0, -1.0], [20.0, 0.0], [-20.0, 0.0]])
    for degrees in (0, 15, 25):
        exact = block_motion.incline_acceleration(slope, math.radians(degrees)) * 0.5**2 / 2
        found = travel([base @ turn, (square + [4, 0]) @ turn], [True, False], math.radians(degrees), 0.5)
        yield f"30° incline, friction {degrees}°, dt = 1 ms: metres in 0.5 s", found, exact, "g (sin α − μ cos α) t²/2"


def _coupled() -> Iterator[Row]:
    from ...coupling import cycles
    from ...ddm import Body
    from ...scene import load_scene

    for phi in (0, 90):
        overrides = ["run.end_time_s=1"]
        problem = load_scene(PIPELINE, overrides, f"phi_{phi}").problem()
        *_, last = cycles(problem)
        rock = problem.materials[problem.blocks.material[0]]
        body = Body(problem.blocks.loops(0), problem.cracks, rock, problem.ddm)
        alone = body.solve(pulled(0.03, 0.06, -last.load))
        at = int(np.argmax(np.abs(last.tips["k_i"] - alone.tips["k_i"])))
        yield (
            f"two_cracks φ = {phi}, coupled: K_I of the worst tip",
            last.tips["k_i"][at],
            alone.tips["k_i"][at],
            "DDM alone",
        )
        if phi == 90:
            yield "the same: axial stress in the block, Pa", last.state.stress[0, 1], -last.load, "load / width"
            strain = last.load / rock.plane_modulus - alone.crack_strain[1]
            yield "the same: axial strain", last.strain, strain, "σ(1−ν²)/E + cracks, DDM alone"
