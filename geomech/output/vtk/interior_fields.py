"""Stress and displacement inside cracked rock, on a triangle mesh that is split along crack faces."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from geomech.conventions import rotate_stress
from geomech.model import OPEN, Cracks, Cycle, Material
from geomech.model.blocks.block_motion import Motion

from .block_motion import displacement, rotation
from .grids import principal_stresses, six_components, von_mises
from .triangulate import Triangles
from .vtu import TRIANGLE, Grid

#: A node on a crack face is evaluated this far inside its own side, relative to its shortest triangle edge.
_ASIDE = 1e-5
#: Least number of triangles of a block of higher order, and about the number of all of them together.
_FEWEST, _OF_BENT = 60, 40_000
#: Displacement is adjusted to the block's own within this part of its size (√area) around a contact.
_TIED = 0.25
#: Sharp kinks of cracks, where stress is singular, turn by more than this, rad.
_SHARP = math.radians(20)


class Stopped(Exception):
    """Fields that nobody waits for any longer."""


@dataclass(frozen=True, eq=False)
class _Kept:
    """Mesh of a cracked block.

    points   (n, 2) where its nodes are evaluated
    areas    (n,) area of rock around each node
    centres, owner   (k, 2) centres of the triangles around nodes where stress is singular, and (k,) the node of each
    """

    mesh: Any
    points: np.ndarray
    areas: np.ndarray
    centres: np.ndarray
    owner: np.ndarray


class InteriorMeshes:
    """Meshes of the cracked blocks, kept while their geometry does not change, and the fields of a cycle on them.

    Meshes are found by geometry, because splitting a block renumbers those after it. ``n_triangles`` is about the
    number of triangles of an uncracked block; crack tips are meshed ``tip_ratio`` times finer than the rest. Uncracked
    blocks of a material that has cracked are included (above all parts that a crack has separated), each with its
    uniform strain and stress.
    """

    def __init__(self, n_triangles: int = 2000, tip_ratio: float = 15.0) -> None:
        self.n_triangles, self.tip_ratio = n_triangles, tip_ratio
        self._kept: dict[bytes, _Kept] = {}
        self._cracked_materials: set[int] = set()
        self._triangles = Triangles()
        self._stopped = False

    def stop(self) -> None:
        """Fields being worked on in another thread end before the next block, with `Stopped`, as if they had not begun."""
        self._stopped = True

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"_stopped": False}

    def note_cracked(self, cycle: Cycle) -> None:
        """Note the materials with cracks at ``cycle``, before an earlier cycle is drawn."""
        self._cracked_materials |= {int(cycle.blocks.material[b]) for b in cycle.inside}

    def grid(self, cycle: Cycle, materials: Sequence[Material], motion: Motion, configuration: str) -> Grid:
        """The rock of ``cycle`` as one grid; empty until some block has a crack."""
        blocks = cycle.blocks
        self.note_cracked(cycle)
        whole = np.isin(blocks.material, [*self._cracked_materials]) & ~blocks.fixed
        whole[[*cycle.inside]] = False
        # Blocks whose cracks have no solution yet: before the first step.
        waiting = np.intersect1d(np.flatnonzero(whole), cycle.cracks.block).tolist()
        whole[waiting] = False
        before, self._kept = self._kept, {}
        try:
            parts = [self._block(cycle, b, body, motion, before) for b, body in sorted(cycle.inside.items())]
            parts += [self._waiting_block(cycle, b, motion, before) for b in waiting]
        except Stopped:
            self._kept = before
            raise
        parts += [self._whole_blocks(cycle, whole)] if whole.any() else []
        first = np.cumsum([0, *(len(p["points"]) for p in parts)])

        def joined(name: str, tail: tuple[int, ...] = (), kind: type = float) -> np.ndarray:
            return np.concatenate([p[name] for p in parts]) if parts else np.empty((0, *tail), kind)

        points, moved = joined("points", (2,)), joined("moved", (2,))
        of_parts = [p["triangles"] + start for p, start in zip(parts, first)]
        cells = np.concatenate(of_parts) if of_parts else np.empty((0, 3), int)
        owner_of_point = joined("owner", (), int)
        stress = six_components(joined("stress", (3,)), blocks.material[owner_of_point], materials)
        principal = principal_stresses(stress)
        return Grid(
            points=points if configuration == "reference" else points + moved,
            connectivity=cells.ravel(),
            offsets=np.arange(3, 3 * len(cells) + 1, 3),
            types=np.full(len(cells), TRIANGLE),
            point_data={
                "displacement": moved,
                "stress": stress,
                "principal_stress": principal,
                "von_mises": von_mises(principal),
            },
            cell_data={"block_id": owner_of_point[cells[:, 0]] if len(cells) else np.empty(0, int)},
        )

    def _block(
        self, cycle: Cycle, b: int, body: Any, motion: Motion, before: dict[bytes, _Kept]
    ) -> dict[str, np.ndarray]:
        kept = self._mesh(cycle, b, before)
        gradient = motion.gradient[b]
        turn = float(rotation(gradient))
        n = len(kept.points)
        stress, own = body.fields(np.concatenate([kept.points, kept.centres]))
        # At a tip or sharp corner stress is infinite: the mean of the surrounding triangles is what the mesh resolves.
        count = np.bincount(kept.owner, minlength=n)
        singular = np.flatnonzero(count)
        for k in range(3):
            mean = np.bincount(kept.owner, weights=stress[n:, k], minlength=n)
            stress[singular, k] = mean[singular] / count[singular]
        moved = _placed(
            kept.mesh.points, kept.areas, own[:n], motion.reference_centre[b], motion.centre[b], gradient, turn
        )
        at = _contact_points(cycle, b)
        as_block = displacement(motion, np.full(len(at), b), at)
        reach = _TIED * math.sqrt(kept.areas.sum())
        return {
            "owner": np.full(n, b),
            "points": kept.mesh.points,
            "triangles": kept.mesh.triangles,
            "moved": _tied(kept.mesh.points, moved, at, as_block, reach),
            "stress": rotate_stress(stress[:n], turn),
        }

    def _waiting_block(self, cycle: Cycle, b: int, motion: Motion, before: dict[bytes, _Kept]) -> dict[str, np.ndarray]:
        """A cracked block before its first solution: uniform stress, and the block's own motion."""
        kept = self._mesh(cycle, b, before)
        owner = np.full(len(kept.points), b)
        return {
            "owner": owner,
            "points": kept.mesh.points,
            "triangles": kept.mesh.triangles,
            "moved": displacement(motion, owner, kept.mesh.points),
            "stress": cycle.state.stress[owner],
        }

    def _whole_blocks(self, cycle: Cycle, whole: np.ndarray) -> dict[str, np.ndarray]:
        """Blocks without cracks (``whole``, a mask) have uniform strain and stress: their corners suffice."""
        blocks, state = cycle.blocks, cycle.state
        triangles, owner = self._triangles.of(blocks)
        corners = np.flatnonzero(whole[blocks.vertex_block])
        number = np.full(blocks.n_vertices, -1)
        number[corners] = np.arange(len(corners))
        return {
            "owner": blocks.vertex_block[corners],
            "points": blocks.vertices[corners],
            "triangles": number[triangles[whole[owner]]],
            "moved": (state.vertices - blocks.vertices)[corners],
            "stress": state.stress[blocks.vertex_block[corners]],
        }

    def _mesh(self, cycle: Cycle, b: int, before: dict[bytes, _Kept]) -> _Kept:
        if self._stopped:
            raise Stopped
        loops, cracks = cycle.blocks.loops(b), cycle.cracks.in_block(b)
        key = b"|".join([*(loop.tobytes() for loop in loops), cracks.nodes.tobytes(), cracks.segments.tobytes()])
        kept = before.get(key)
        if kept is None:
            from geomech.shapes.meshing import mesh_interior

            size = math.sqrt(cycle.blocks.areas()[b] / (0.433 * self._triangles_of(cycle, b)))
            mesh = mesh_interior(loops, cracks, size, size / self.tip_ratio)
            look_from = mesh.points + _ASIDE * _local_size(mesh)[:, None] * mesh.side
            kept = _Kept(mesh, look_from, _node_areas(mesh), *_about_singular(mesh, cracks))
        self._kept[key] = kept
        return kept

    def _triangles_of(self, cycle: Cycle, b: int) -> int:
        """Approximate number of triangles of block ``b``: fewer if many blocks bend, whose stress is smooth."""
        if b not in cycle.bent:
            return self.n_triangles
        return max(_FEWEST, min(self.n_triangles, _OF_BENT // len(cycle.bent)))


def _singular_nodes(cracks: Cracks) -> np.ndarray:
    """Nodes of ``cracks`` where elastic stress is unbounded: tips, junctions and sharp kinks."""
    along = cracks.nodes[cracks.segments[:, 1]] - cracks.nodes[cracks.segments[:, 0]]
    along = along / cracks.lengths[:, None]
    out = np.zeros((len(cracks.nodes), 2))
    np.add.at(out, cracks.segments[:, 0], along)
    np.subtract.at(out, cracks.segments[:, 1], along)
    # The two unit vectors out of a node inside a crack add up to a length of 2 sin(turn / 2).
    sharp = (cracks.valence == 2) & (np.hypot(*out.T) > 2 * math.sin(_SHARP / 2))
    singular = sharp | (cracks.valence > 2)
    singular[cracks.tips] = True
    return np.flatnonzero(singular)


def _about_singular(mesh: Any, cracks: Cracks) -> tuple[np.ndarray, np.ndarray]:
    """Centres (k, 2) of the triangles around singular nodes, and the node of each (k,)."""
    at = cracks.nodes[_singular_nodes(cracks)]
    if not len(at):
        return np.empty((0, 2)), np.empty(0, int)
    singular = np.zeros(len(mesh.points), bool)
    reach = 1e-9 * float(np.ptp(mesh.points, axis=0).max())
    # Too few for the import of a tree to pay off.
    for node in at:
        singular |= np.abs(mesh.points - node).max(axis=1) <= reach
    triangle, corner = np.nonzero(singular[mesh.triangles])
    return mesh.points[mesh.triangles[triangle]].mean(axis=1), mesh.triangles[triangle, corner]


def _local_size(mesh: Any) -> np.ndarray:
    """(n,) m: shortest triangle edge at every point."""
    size = np.full(len(mesh.points), np.inf)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        i, j = mesh.triangles[:, a], mesh.triangles[:, b]
        length = np.hypot(*(mesh.points[i] - mesh.points[j]).T)
        np.minimum.at(size, i, length)
        np.minimum.at(size, j, length)
    return np.where(np.isfinite(size), size, 0.0)


def _node_areas(mesh: Any) -> np.ndarray:
    """(n,) m²: a third of the area of the triangles around every point."""
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    u, v = b - a, c - a
    third = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 6
    return np.bincount(mesh.triangles.ravel(), weights=np.repeat(third, 3), minlength=len(mesh.points))


def _contact_points(cycle: Cycle, b: int) -> np.ndarray:
    """(n, 2) m, reference: closed contacts of block ``b``, its own vertices or projections on its edges."""
    contacts, blocks = cycle.state.contacts, cycle.blocks
    closed = contacts[contacts["state"] != OPEN]
    own, other = closed[closed["block"] == b], closed[closed["other"] == b]
    first, share = other["edge"], other["position"][:, None]
    feet = (1 - share) * blocks.vertices[first] + share * blocks.vertices[blocks.next_vertex[first]]
    return np.unique(np.concatenate([blocks.vertices[own["vertex"]], feet]), axis=0)


def _tied(points: np.ndarray, moved: np.ndarray, at: np.ndarray, as_block: np.ndarray, reach: float) -> np.ndarray:
    """``moved`` (n, 2) m at ``points``, adjusted to the block's motion ``as_block`` at the contacts ``at`` (k, 2).

    Beyond ``reach`` (m) of the contacts nothing changes. The neighbour at a contact touches the block, which has one
    strain. The rock inside is also indented by the load, by several times the block's shortening where the load is
    nearly a point: without the adjustment it would be drawn away from its platens. The adjustment is continuous
    (Shepard's weights), so that cracks open and slip as before.
    """
    if not len(at):
        return moved
    nearest = np.array([np.argmin(((points - place) ** 2).sum(axis=1)) for place in at])
    lacks = as_block - moved[nearest]
    square = ((points[:, None] - at) ** 2).sum(axis=2)
    near = np.maximum(0.0, 1.0 - square / reach**2) ** 2
    weights = near / np.maximum(square, (1e-6 * reach) ** 2)
    total = weights.sum(axis=1)
    mean = weights @ lacks / np.maximum(total, np.finfo(float).tiny)[:, None]
    return moved + near.max(axis=1)[:, None] * mean


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

    A body under given tractions determines its displacement up to a rigid motion, so that this part is removed and the
    block's is added; the deformation rotates with the block. The rigid part is that of the affine motion with the best
    fit over the area (``weights``): fitted without the strain, it would pick up a rotation from the strain of an
    asymmetric body.
    """
    share = weights / weights.sum()
    mean_point = share @ points
    arm, mean = points - mean_point, share @ own
    moments = arm.T @ (share[:, None] * arm)
    slope = (own - mean).T @ (share[:, None] * arm) @ np.linalg.inv(moments)
    spin = 0.5 * (slope[1, 0] - slope[0, 1])
    deforming = own - mean - spin * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
    c, s = math.cos(turn), math.sin(turn)
    # cos − 1 = −2 sin²(turn/2) keeps the digits of small rotations.
    less = -2 * math.sin(turn / 2) ** 2
    # The body's centre moves with the block's affine motion; around it, the block rotates.
    shift = (centre_now - centre) + (gradient - np.eye(2)) @ (mean_point - centre)
    return shift + arm @ np.array([[less, -s], [s, less]]).T + deforming @ np.array([[c, -s], [s, c]]).T
