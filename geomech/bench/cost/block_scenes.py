"""Block systems of any size for timing: a running-bond wall, a slope with two joint sets, a column, a block on an
incline."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ...model import (
    Blocks,
    Cracks,
    DdaSettings,
    DdmSettings,
    GrowthSettings,
    History,
    JointLaw,
    Loads,
    Material,
    Problem,
    RunSettings,
    State,
)

ROCK = Material("rock", 20e9, 0.25, density=2600.0)
FRICTION = math.radians(35)
JOINT = JointLaw("joint", friction_angle=FRICTION)
GRAVITY = 9.81
WEIGHT = Loads(gravity=History.constant((0.0, -GRAVITY)))
#: Static steps (s) that bring blocks to rest: short ones first, in which inertia limits how far contacts influence each
#: other. (A wall of 10 000 bricks takes 25 iterations in them; in a single one of 1 s, hundreds, with cuts.)
CALMING = (3e-3, 0.03, 0.3, 1.0, 1.0)


def wall(n: int) -> Blocks:
    """About ``n`` bricks of 1 × 0.5 m in running bond on a fixed base; the numbers of bricks along the base and in
    height have the ratio 2."""
    columns = max(4, round(math.sqrt(n / 2)))
    polygons = [_rectangle(-1, -1, columns + 1, 0)]
    for course in range(max(1, round(n / (columns + 0.5)))):
        joints = np.arange(columns + 1.0)
        if course % 2:
            joints = np.concatenate([[0.0], joints[:-1] + 0.5, [columns]])
        polygons += [_rectangle(a, 0.5 * course, b, 0.5 * (course + 1)) for a, b in pairwise(joints.tolist())]
    return Blocks.from_polygons(polygons, fixed=[True] + [False] * (len(polygons) - 1))


def with_loose_brick(blocks: Blocks) -> Blocks:
    """The ``blocks`` of a wall, and a brick on top of its centre, the last one."""
    polygons = [blocks.vertices[a:b] for a, b in pairwise(blocks.vertex_start)]
    top, x = blocks.vertices[:, 1].max(), math.floor(0.5 * (blocks.vertices[:, 0].max() - 1)) + 0.3
    polygons.append(_rectangle(x, top, x + 1, top + 0.5))
    return Blocks.from_polygons(polygons, fixed=[*blocks.fixed, False])


def slope(n: int) -> Blocks:
    """About ``n`` blocks of 1 × 1 m of a 60° slope with two joint sets.

    Bedding dips 20° into the rock, with cross joints at right angles from bed to bed; blocks at its foot and back are
    fixed.
    """
    dip, steep = math.radians(20), math.radians(70)
    a, b = np.array([math.cos(dip), -math.sin(dip)]), np.array([math.cos(steep), math.sin(steep)])
    size = math.sqrt(n / 0.95)
    reach = int(2.5 * size)
    i, j = np.meshgrid(np.arange(-reach, reach), np.arange(-reach, reach), indexing="ij")
    corner = (i + 0.5 * (j % 2))[..., None] * a + j[..., None] * b
    x, y = np.moveaxis(corner + 0.5 * (a + b), -1, 0)
    inside = (x < 1.2 * size) & (y > -0.1 * size) & (y < size) & (y < math.tan(math.radians(60)) * x)
    inside &= (x > -0.1 * size) | (y < 0)
    corner, x, y = corner[inside], x[inside], y[inside]
    fixed = (y < -0.1 * size + 1.5) | (x > 1.2 * size - 1.5)
    polygons = [np.array([c, c + a, c + a + b, c + b]) for c in corner]
    return Blocks.from_polygons(polygons, fixed=fixed.tolist())


def column(n: int) -> Blocks:
    """``n`` blocks of 1 × 1 m on top of one another on a fixed one."""
    polygons = [_rectangle(-1, -1, 2, 0), *(_rectangle(0, k, 1, k + 1) for k in range(n))]
    return Blocks.from_polygons(polygons, fixed=[True] + [False] * n)


def incline(angle: float) -> Blocks:
    """A block of 1 × 1 m on a fixed plane that dips to the right at ``angle`` (rad)."""
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    polygons = [_rectangle(-3, -1, 20, 0) @ turn, _rectangle(0, 0, 1, 1) @ turn]
    return Blocks.from_polygons(polygons, fixed=[True, False])


def settings(dt: float, dynamic: bool = True) -> DdaSettings:
    """Settings of the scenes: steps of ``dt`` s, dynamic or static."""
    return DdaSettings(time_step=dt, dynamic_factor=1.0 if dynamic else 0.0)


def at_rest(blocks: Blocks) -> State:
    """The blocks at rest under their weight: they start with the vertical stress of the overburden and relax in static
    steps."""
    from ... import dda

    state = State.at_rest(blocks)
    height = np.array([blocks.area_moments(b)[1][1] for b in range(blocks.n_blocks)])
    stress = np.zeros((blocks.n_blocks, 3))
    stress[:, 1] = -ROCK.density * GRAVITY * (blocks.vertices[:, 1].max() - height)
    stress[np.asarray(blocks.fixed, bool)] = 0.0
    state = replace(state, stress=stress)
    for seconds in CALMING:
        system = dda.BlockSystem(blocks, [ROCK], [JOINT], settings=settings(seconds, dynamic=False))
        state = system.step(state, WEIGHT).state
    return replace(state, velocity=np.zeros_like(state.velocity))


def _rectangle(x0: float, y0: float, x1: float, y1: float) -> np.ndarray:
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], dtype=float)


#: Time step of the wall with cracked bricks, s.
CRACKED_WALL_STEP = 0.01


def cracked_wall(n: int, n_cracked: int) -> Problem:
    """About ``n`` bricks, ``n_cracked`` of them, evenly distributed, with an open slot of 0.2 m at 45° in the
    centre."""
    blocks = wall(n)
    cracked = np.linspace(1, blocks.n_blocks - 1, n_cracked).astype(int)
    reach = np.array([0.07, 0.07])
    centroids = [blocks.area_moments(b)[1] for b in cracked.tolist()]
    return Problem(
        title="a wall with cracked bricks",
        blocks=blocks,
        cracks=Cracks.from_polylines(
            [np.array([centroid - reach, centroid + reach]) for centroid in centroids],
            block=cracked.tolist(),
            aperture=np.inf,
        ),
        materials=(replace(ROCK, k_ic=1e12),),
        joints=(JOINT,),
        loads=WEIGHT,
        dda=settings(CRACKED_WALL_STEP),
        ddm=DdmSettings(),
        growth=GrowthSettings(increment=0.05),
        run=RunSettings(end_time=1.0),
    )
