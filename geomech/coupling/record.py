"""What a cycle's record says of the whole scene: its leading load, its axial strain, all crack faces in one table."""

from __future__ import annotations

import numpy as np

from ..conventions import outward_normal_of
from ..model import Blocks, CrackFaces, Cracks, Motion, Problem


def leading_load(problem: Problem, blocks: Blocks, now: float) -> float:
    """Normal component of the traction on the scene's leading edge, Pa, positive in compression; 0 without one."""
    name = problem.load_edge
    edges = blocks.edges_named(name) if name else []
    if not len(edges):
        return 0.0
    along = blocks.vertices[blocks.next_vertex[edges[0]]] - blocks.vertices[edges[0]]
    outward = outward_normal_of(along / np.hypot(*along))
    return sum(
        -float(load.history.at(now) @ outward) for load in problem.loads.edge_tractions if load.edge_name == name
    )


def axial_strain(gauge, motion: Motion) -> float:
    """Shortening of the ``gauge`` (two pairs of block and material point) over its length; nan without one."""
    if gauge is None:
        return float("nan")
    (a, p), (b, q) = gauge
    before = np.hypot(*(np.asarray(q) - np.asarray(p)))
    return float(1 - np.hypot(*(motion.current(b, q) - motion.current(a, p))) / before)


def joined_faces(cracks: Cracks, solutions: dict) -> CrackFaces | None:
    """The faces of all solved bodies (block → solution), segments counted in the whole network."""
    if not solutions:
        return None
    faces = [solution.faces for solution in solutions.values()]
    return CrackFaces(
        segment=np.concatenate(
            [np.flatnonzero(cracks.block == b)[f.segment] for b, f in zip(solutions, faces, strict=True)]
        ),
        **{
            name: np.concatenate([getattr(f, name) for f in faces])
            for name in ("points", "opening", "slip", "traction", "state")
        },
    )
