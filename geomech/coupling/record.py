"""What a cycle's record says of the whole scene: its leading load, its axial strain, all crack faces in one table."""

from __future__ import annotations

import math
from dataclasses import fields, replace

import numpy as np

from ..model import Blocks, CrackFaces, Cracks, Motion, Problem


def leading_load(problem: Problem, blocks: Blocks, now: float) -> float:
    """Normal component of the traction on the scene's leading edge, Pa, positive in compression; 0 without one."""
    name = problem.load_edge
    edges = blocks.edges_named(name) if name else []
    if not len(edges):
        return 0.0
    outward = blocks.outward_normals[edges[0]]
    return sum(
        -float(load.history.at(now) @ outward) for load in problem.loads.edge_tractions if load.edge_name == name
    )


def axial_strain(gauge, motion: Motion) -> float:
    """Shortening of the ``gauge`` (two pairs of block and material point) over its length; nan without one."""
    if gauge is None:
        return float("nan")
    (a, p), (b, q) = gauge
    return 1 - math.dist(motion.current(b, q), motion.current(a, p)) / math.dist(q, p)


def joined_faces(cracks: Cracks, solutions: dict) -> CrackFaces | None:
    """The faces of all solved bodies (block → solution), segments counted in the whole network."""
    if not solutions:
        return None
    faces = [
        replace(solution.faces, segment=np.flatnonzero(cracks.block == b)[solution.faces.segment])
        for b, solution in solutions.items()
    ]
    if len(faces) == 1:
        return faces[0]
    return CrackFaces(**{f.name: np.concatenate([getattr(each, f.name) for each in faces]) for f in fields(CrackFaces)})
