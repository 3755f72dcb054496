"""Computed against published or closed-form values: the figures of the README's "How right", with default settings
unless the row says otherwise."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

PIPELINE = Path("pipelines/two_cracks")

#: (case, computed, reference, source)
Row = tuple[str, float, float, str]


def measure(quick: bool = False) -> str:
    """The table; ``quick`` changes nothing, it is quick. The last rows need ``pipelines/two_cracks`` (run it in the
    project's folder) and are left out elsewhere."""
    rows = [*_cracks(), *_blocks()]
    if PIPELINE.is_dir():
        rows += _coupled()
    width = max(len(row[0]) for row in rows)
    lines = [f"{'case':<{width}}  {'computed':>14}  {'reference':>14}  {'error':>8}  source"]
    for case, computed, reference, source in rows:
        error = abs(computed / reference - 1) if reference else abs(computed)
        lines.append(f"{case:<{width}}  {computed:>14.8g}  {reference:>14.8g}  {error:8.1e}  {source}")
    return "\n".join(lines)


def _rectangle(half_width: float, half_height: float) -> np.ndarray:
    w, h = half_width, half_height
    return np.array([[-w, -h], [w, -h], [w, h], [-w, h]])


def _pulled(half_width: float, half_height: float, stress: float = 1.0):
    from ..ddm import BodyLoad

    (a, b), pull = _rectangle(half_width, half_height)[[0, 2]], np.array([0.0, stress])
    c, d = np.array([b[0], a[1]]), np.array([a[0], b[1]])
    return BodyLoad(segments=np.array([[a, c], [b, d]]), tractions=np.array([[-pull, -pull], [pull, pull]]))


def _cracks() -> Iterator[Row]:
    from ..ddm import Body, BodyLoad
    from ..model import Cracks, DdmSettings, Material
    from ..reference import fracture, two_cracks

    rock = Material("rock", 17e9, 0.21)

    def crack(*ends, **options) -> Cracks:
        return Cracks.from_polylines([np.array(pair, dtype=float) for pair in ends], aperture=math.inf, **options)

    tension = BodyLoad(remote_stress=np.array([0.0, 1.0, 0.0]))
    one = crack([[-1, 0], [1, 0]])
    for order in (2, 4, 8):
        k = Body([], one, rock, DdmSettings(order=order)).solve(tension).tips["k_i"][0]
        yield f"Griffith crack, order {order}: K_I", k, fracture.griffith(1.0, 1.0), "closed form"
    pair = crack([[-1, 0], [-0.2, 0]], [[0.2, 0], [1, 0]])
    k = Body([], pair, rock, DdmSettings(order=8)).solve(tension).tips["k_i"]
    inner, outer = fracture.collinear_pair(1.0, 0.2, 1.0)
    yield "collinear pair, order 8: inner K_I", k[1], inner, "Willmore 1949"
    yield "collinear pair, order 8: outer K_I", k[0], outer, "Willmore 1949"
    closed = Cracks.from_polylines([np.array([[-1.0, -1.0], [1.0, 1.0]]) / math.sqrt(2)])
    tips = Body([], closed, rock).solve(BodyLoad(remote_stress=np.array([0.0, -1.0, 0.0]))).tips
    _, k_ii = fracture.closed(np.array([0.0, -1.0, 0.0]), math.pi / 4, 1.0)
    yield "closed crack at 45° under compression: K_II", tips["k_ii"][0], k_ii, "closed form"
    yield "the same: K_I", tips["k_i"][0], 0.0, "closed form"
    for ratio, factor in fracture.CENTRE_CRACK_HALF.items():
        body = Body([_rectangle(1.0, ratio)], crack([[-0.5, 0], [0.5, 0]]), rock)
        k = body.solve(_pulled(1.0, ratio)).tips["k_i"][0] / fracture.griffith(1.0, 0.5)
        yield f"centre crack a/W = 0.5, H/W = {ratio:g}: F", k, factor, "computed independently"
    edge = crack([[-0.5, 0], [0, 0]], surface=[(True, False)])
    k = Body([_rectangle(0.5, 1.5)], edge, rock).solve(_pulled(0.5, 1.5)).tips["k_i"][0] / fracture.griffith(1.0, 0.5)
    yield "edge crack a/W = 0.5: F", k, fracture.EDGE_CRACK[0.5], "Kaya & Erdogan 1987"
    for phi in two_cracks.OPEN_SLOT_K_I:
        slots = crack(*two_cracks.crack_ends(phi))
        tips = Body([_rectangle(0.03, 0.06)], slots, rock).solve(_pulled(0.03, 0.06, -1.0)).tips
        for name, table in (("K_I", two_cracks.OPEN_SLOT_K_I), ("K_II", two_cracks.OPEN_SLOT_K_II)):
            found = tips["k_i" if name == "K_I" else "k_ii"]
            at = int(np.argmax(np.abs(found - table[phi])))
            yield f"two slots, φ = {phi}: {name} of the worst tip", found[at], table[phi][at], "computed independently"


def _blocks() -> Iterator[Row]:
    from .. import dda
    from ..model import Blocks, DdaSettings, History, JointLaw, Loads, Material
    from ..reference import block_motion

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
    from ..coupling import cycles
    from ..ddm import Body
    from ..scene import load_scene

    for phi in (0, 90):
        overrides = ["run.end_time_s=1"]
        problem = load_scene(PIPELINE, overrides, f"phi_{phi}").problem()
        *_, last = cycles(problem)
        rock = problem.materials[problem.blocks.material[0]]
        body = Body(problem.blocks.loops(0), problem.cracks, rock, problem.ddm)
        alone = body.solve(_pulled(0.03, 0.06, -last.load))
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
