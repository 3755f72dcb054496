"""Stress and displacement inside cracked blocks, on a triangle mesh whose crack faces can part."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from geomech.conventions import rotate_stress
from geomech.model import Cycle, Material
from geomech.model.motion import Motion

from .grids import principal_stresses, six_components, von_mises
from .motion import rotation
from .vtu import TRIANGLE, Grid, with_z

#: A node on a crack face is evaluated this far inside its own side, relative to its shortest triangle edge.
_ASIDE = 1e-3


class InteriorMeshes:
    """Meshes of the cracked blocks, kept while their geometry stands, and the fields of a cycle on them.

    ``n_triangles`` is about how many triangles an uncracked block gets; crack tips are meshed ``tip_ratio`` times
    finer than the rest.
    """

    def __init__(self, n_triangles: int = 2000, tip_ratio: float = 15.0) -> None:
        self.n_triangles, self.tip_ratio = n_triangles, tip_ratio
        self._kept: dict[int, tuple[bytes, Any, np.ndarray, np.ndarray]] = {}

    def grid(self, cycle: Cycle, materials: Sequence[Material], motion: Motion, configuration: str) -> Grid:
        """The blocks of ``cycle.bodies`` as one grid; empty when there are none."""
        parts = [self._block(cycle, b, body, motion) for b, body in sorted(cycle.bodies.items())]
        self._kept = {b: kept for b, kept in self._kept.items() if b in cycle.bodies}
        first = np.cumsum([0, *(len(p["points"]) for p in parts)])

        def joined(name: str, tail: tuple[int, ...]) -> np.ndarray:
            return np.concatenate([p[name] for p in parts]) if parts else np.empty((0, *tail))

        points, moved = joined("points", (2,)), joined("moved", (2,))
        cells = [p["triangles"] + start for p, start in zip(parts, first)]
        cells = np.concatenate(cells) if cells else np.empty((0, 3), int)
        owner_of_point = np.repeat(np.array([*sorted(cycle.bodies)], dtype=int), np.diff(first))
        stress = six_components(joined("stress", (3,)), cycle.blocks.material[owner_of_point], materials)
        principal = principal_stresses(stress)
        return Grid(
            points=points if configuration == "reference" else points + moved,
            connectivity=cells.ravel(),
            offsets=np.arange(3, 3 * len(cells) + 1, 3),
            types=np.full(len(cells), TRIANGLE),
            point_data={
                "displacement": with_z(moved),
                "stress": stress,
                "principal_stress": principal,
                "von_mises": von_mises(principal),
            },
            cell_data={"block_id": owner_of_point[cells[:, 0]] if len(cells) else np.empty(0, int)},
        )

    def _block(self, cycle: Cycle, b: int, body: Any, motion: Motion) -> dict[str, np.ndarray]:
        mesh, look_from, weights = self._mesh(cycle, b)
        gradient = motion.gradient[b]
        turn = float(rotation(gradient))
        stress, own = body.fields(look_from)
        return {
            "points": mesh.points,
            "triangles": mesh.triangles,
            "moved": _placed(mesh.points, weights, own, motion.reference_centre[b], motion.centre[b], gradient, turn),
            "stress": rotate_stress(stress, turn),
        }

    def _mesh(self, cycle: Cycle, b: int) -> tuple[Any, np.ndarray, np.ndarray]:
        loops, cracks = cycle.blocks.loops(b), cycle.cracks.in_block(b)
        key = b"|".join([*(loop.tobytes() for loop in loops), cracks.nodes.tobytes(), cracks.segments.tobytes()])
        kept = self._kept.get(b)
        if kept is None or kept[0] != key:
            from geomech.shapes.meshing import mesh_interior

            size = math.sqrt(cycle.blocks.areas()[b] / (0.433 * self.n_triangles))
            mesh = mesh_interior(loops, cracks, size, size / self.tip_ratio)
            look_from = mesh.points + _ASIDE * _local_size(mesh)[:, None] * mesh.side
            kept = self._kept[b] = (key, mesh, look_from, _node_areas(mesh))
        return kept[1:]


def _local_size(mesh: Any) -> np.ndarray:
    """(n,) m: the shortest triangle edge at every point."""
    size = np.full(len(mesh.points), np.inf)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        i, j = mesh.triangles[:, a], mesh.triangles[:, b]
        length = np.hypot(*(mesh.points[i] - mesh.points[j]).T)
        np.minimum.at(size, i, length)
        np.minimum.at(size, j, length)
    return np.where(np.isfinite(size), size, 0.0)


def _node_areas(mesh: Any) -> np.ndarray:
    """(n,) m²: a third of the triangles around every point."""
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    u, v = b - a, c - a
    third = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 6
    return np.bincount(mesh.triangles.ravel(), weights=np.repeat(third, 3), minlength=len(mesh.points))


def _placed(
    points: np.ndarray,
    weights: np.ndarray,
    own: np.ndarray,
    centre: np.ndarray,
    centre_now: np.ndarray,
    gradient: np.ndarray,
    turn: float,
) -> np.ndarray:
    """The body's ``own`` displacement with its rigid part replaced by the block's.

    A body under given tractions knows its displacement up to a rigid motion, so that part is taken out and the block's
    put in its place; the deformation turns with the block. The rigid part is that of the affine motion which fits best
    over the area (``weights``): fitted without the strain, it would pick up a spin from strain on a lopsided body.
    """
    share = weights / weights.sum()
    middle = share @ points
    arm, mean = points - middle, share @ own
    moments = arm.T @ (share[:, None] * arm)
    slope = (own - mean).T @ (share[:, None] * arm) @ np.linalg.inv(moments)
    spin = 0.5 * (slope[1, 0] - slope[0, 1])
    deforming = own - mean - spin * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
    c, s = math.cos(turn), math.sin(turn)
    # cos − 1 = −2 sin²(turn/2) keeps the digits of small rotations.
    less = -2 * math.sin(turn / 2) ** 2
    # The body's middle goes where the block's affine motion takes it; about it, the block turns.
    shift = (centre_now - centre) + (gradient - np.eye(2)) @ (middle - centre)
    return shift + arm @ np.array([[less, -s], [s, less]]).T + deforming @ np.array([[c, -s], [s, c]]).T
