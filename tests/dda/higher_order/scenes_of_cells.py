"""Systems of cells: rectangles in columns and rows, and what Gmsh makes of a polygon."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scenes_of_bending import rectangle, turned

from geomech import dda
from geomech.dda.higher_order.bent_body import bent_bodies
from geomech.model import Blocks, DdaSettings, JointLaw, Material, Motion, State
from geomech.shapes.cells import divided


def columns_and_rows(x: np.ndarray, y: np.ndarray) -> list[np.ndarray]:
    return [rectangle(x[i], y[j], x[i + 1], y[j + 1]) for i in range(len(x) - 1) for j in range(len(y) - 1)]


def glued(blocks: Blocks) -> Blocks:
    """``blocks`` glued wherever the edges of two that move coincide."""
    seen, pairs = {}, []
    for v in np.flatnonzero(~blocks.fixed[blocks.vertex_block]).tolist():
        ends = [tuple(np.round(blocks.vertices[k], 9).tolist()) for k in (v, blocks.next_vertex[v])]
        if (ends[1], ends[0]) in seen:
            pairs.append((seen[ends[1], ends[0]], v))
        seen[ends[0], ends[1]] = v
    return replace(blocks, glued=np.array(pairs))


def cells_of(cells, order, *, below=(), joint=None, rock=None, loaded=None, angle=0.0, between="", **settings):
    """The system of ``cells`` above the fixed blocks ``below``; sides of which ``loaded`` (middle) → bool are called "loaded",
    all other sides of cells ``between``."""
    polygons = [*below, *cells]
    sides = [0.5 * (polygon + np.roll(polygon, -1, axis=0)) for polygon in polygons]
    other = [""] * len(below) + [between] * len(cells)
    names = [
        [["loaded" if loaded is not None and loaded(at) else name for at in side]]
        for side, name in zip(sides, other, strict=True)
    ]
    fixed = [True] * len(below) + [False] * len(cells)
    order = [*[1] * len(below), *np.broadcast_to(order, len(cells)).tolist()]
    blocks = Blocks.from_polygons([turned(p, angle) for p in polygons], fixed=fixed, order=order, edge_names=names)
    return system(glued(blocks), joint, rock, **settings)


def system(blocks: Blocks, joint=None, rock: Material | None = None, **settings) -> dda.BlockSystem:
    """Of these ``blocks``; ``joint`` is the law of all contacts, or a pair: that of unnamed edges, and that of named ones."""
    if isinstance(joint, tuple):
        given = {"dynamic_factor": 0.0, "time_step": 10.0, "max_displacement_ratio": 1.0} | settings
        return dda.BlockSystem(
            blocks, [rock or Material("rock", 2e10, 0.25, 2500.0)], joint,
            lambda one, two: int(one == two != ""), settings=DdaSettings(**given),
        )  # fmt: skip
    given = {"dynamic_factor": 0.0, "time_step": 10.0, "max_displacement_ratio": 1.0} | settings
    rock, joint = rock or Material("rock", 2e10, 0.25, 2500.0), joint or JointLaw("joint", 0.6)
    return dda.BlockSystem(blocks, [rock], [joint], settings=DdaSettings(**given))


def meshed(polygon, size: float, order: int, *, below, names, shape="triangles", between="", **more) -> dda.BlockSystem:
    """One ``polygon`` (loops), its edges called ``names``, divided into cells, sides ``between`` them, above the fixed block ``below``."""
    blocks = Blocks.from_polygons(
        [[below], polygon], fixed=[True, False], order=[1, order], edge_names=[[[""] * len(below)], names]
    )
    return system(divided(blocks, np.array([np.nan, size]), np.array(["", shape]), ["", between])[0], **more)


def moved_corners(of: dda.BlockSystem, state: State) -> np.ndarray:
    """(n_vertices, 2) m by which corners have moved, with what their cells deflect."""
    return of.deflected.corners(state.vertices, state.rotation, state.deflection[:, 0]) - of.blocks.vertices


def stress_in(of: dda.BlockSystem, state: State, cells: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n, 3) Pa at a point of each of the ``cells`` (n,)."""
    bodies = bent_bodies(of.deflected, state, Motion.of(of.blocks, state.vertices))
    return np.array([bodies[b].fields(x[None])[0][0] for b, x in zip(cells.tolist(), points, strict=True)])
