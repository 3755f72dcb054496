"""Polygonal blocks as flat arrays: vertices, loops, edges, and quantities derived from them."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...conventions import outward_normal_of
from ..former_names import renamed_argument
from .polygon import (
    area_moments,
    convex_and_simple,
    crossing_edges,
    crossing_loops,
    distance_to_edges,
    point_in_both,
    roundoff_of,
    signed_area,
    winding_number,
)

#: Value of `Blocks.order`: determined during the run.
AUTO_ORDER = 0
#: The highest order of a block.
HIGHEST_ORDER = 8
#: Edges are collinear when the tangent of the angle between them is below this.
STRAIGHT = 1e-6


@dataclass(frozen=True, eq=False)
class Blocks:
    """A system of polygonal blocks in their reference positions.

    Vertices of all blocks stand in one array, loop after loop, block after block; the first loop of a block is its
    outline (counter-clockwise), any further ones are holes (clockwise). *Edge i* is the edge that leaves vertex i
    towards the next vertex of its loop, so per-edge arrays have n_vertices rows.

        vertices      (n_vertices, 2)   reference coordinates, m
        loop_start    (n_loops + 1,)    first vertex of each loop
        block_loop    (n_blocks + 1,)   first loop of each block
        material      (n_blocks,)       index into the scene's materials
        fixed         (n_blocks,)       True: the block does not move
        held          (n_blocks, 6)     True: that unknown (u0, v0, r0, εx, εy, γxy) of the block is constrained to
                                        zero, as for a guided platen; None: no moving block is constrained
        order         (n_blocks,)       p of the complete polynomial that is a block's displacement, 1 to 8, or `AUTO_ORDER`:
                                        found as the run goes; None: all are of first order
        glued         (n_faces, 2)      edges of two blocks along each other, end to end, that are cells of one rock: displacement
                                        and stress pass through them as if they were not there. Faces whose edges have names part at the
                                        strength of their joint law, others hold. None: no blocks are cells
        edge_name     (n_vertices,)     index into ``edge_names`` (0: the empty name, unnamed)
        edge_names    tuple of str      e.g. ("", "load:top", "joint:set1")
        names         tuple of str      one name per block, for messages and files: "block 0", … if not given
    """

    vertices: np.ndarray
    loop_start: np.ndarray
    block_loop: np.ndarray
    material: np.ndarray
    fixed: np.ndarray
    edge_name: np.ndarray
    edge_names: tuple[str, ...] = ("",)
    names: tuple[str, ...] = ()
    constrained: np.ndarray | None = None
    order: np.ndarray | None = None
    glued: np.ndarray | None = None

    def __post_init__(self) -> None:
        if not self.names:
            object.__setattr__(self, "names", tuple(f"block {b}" for b in range(self.n_blocks)))

    @classmethod
    @renamed_argument("held", "constrained")
    def from_polygons(
        cls,
        polygons: Sequence[Sequence[np.ndarray]],
        *,
        material: Sequence[int] | None = None,
        fixed: Sequence[bool] | None = None,
        constrained: Sequence[Sequence[bool]] | None = None,
        edge_names: Sequence[Sequence[Sequence[str]]] | None = None,
        names: Sequence[str] | None = None,
        order: Sequence[int] | None = None,
        held: Sequence[Sequence[bool]] | None = None,
    ) -> Blocks:
        """Build from ``polygons[block][loop]`` = (n, 2) vertices, m, without repeating the first.

        A bare (n, 2) array is a block without holes. ``edge_names[block][loop][edge]`` names edges. Outlines are made
        counter-clockwise, holes clockwise.

        Raises ValueError that names the block for loops of fewer than three vertices, repeated vertices, non-finite
        coordinates, crossing edges, zero area, and holes that leave the outline or overlap; and for lists whose length
        is not the number of blocks.

        >>> blocks = Blocks.from_polygons([np.array([[0, 0], [2, 0], [2, 1], [0, 1]])])
        >>> blocks.n_blocks, float(blocks.areas()[0])
        (1, 2.0)
        """
        n_blocks = len(polygons)
        given = {"material": material, "fixed": fixed, "constrained": constrained, "edge_names": edge_names, "names": names,
                 "order": order}  # fmt: skip
        _refuse_lengths(n_blocks, given)
        names = tuple(names or (f"block {b}" for b in range(n_blocks)))
        loops, block_loop = [], [0]
        for block in polygons:
            bare = isinstance(block, np.ndarray) or np.ndim(block[0][0]) == 0
            loops += [np.asarray(loop, dtype=float) for loop in ([block] if bare else block)]
            block_loop.append(len(loops))
        owner = np.repeat(np.arange(n_blocks), np.diff(block_loop))
        outer = np.zeros(len(loops), bool)
        outer[block_loop[:-1]] = True
        if edge_names is not None:
            _refuse_loops(edge_names, block_loop, names)
        labels = None if edge_names is None else [list(label) for block in edge_names for label in block]
        for k, loop in enumerate(loops):
            _refuse_shape(loop, None if labels is None else labels[k], names[owner[k]])
        loop_start = np.concatenate([[0], np.cumsum([len(loop) for loop in loops])]).astype(int)
        if loops:
            with np.errstate(invalid="ignore"):
                simple, turns_left = convex_and_simple(np.concatenate(loops), loop_start)
            for k in np.flatnonzero(~simple).tolist():
                _refuse_invalid_outline(loops[k], names[owner[k]])
            for k in np.flatnonzero(~outer).tolist():
                _refuse_hole_outside(loops[block_loop[owner[k]]], loops[k], names[owner[k]])
            for b in np.flatnonzero(np.diff(block_loop) > 2).tolist():
                _refuse_shared(loops[block_loop[b] + 1 : block_loop[b + 1]], names[b])
            for k in np.flatnonzero(turns_left != outer).tolist():
                loops[k] = loops[k][::-1]
                if labels is not None:
                    # Reversed, the edge that left vertex i arrives at it, so the labels shift by one.
                    labels[k] = [*labels[k][-2::-1], labels[k][-1]]
        known: dict[str, int] = {"": 0}
        edge_name = np.zeros(loop_start[-1], int)
        if labels is not None:
            edge_name[:] = [known.setdefault(name, len(known)) for label in labels for name in label]
        return cls(
            vertices=np.concatenate(loops) if loops else np.empty((0, 2)),
            loop_start=loop_start,
            block_loop=np.array(block_loop),
            material=np.zeros(n_blocks, int) if material is None else np.asarray(material, dtype=int),
            fixed=np.zeros(n_blocks, bool) if fixed is None else np.asarray(fixed, dtype=bool),
            edge_name=edge_name,
            edge_names=tuple(known),
            names=names,
            constrained=np.asarray(constrained, dtype=bool)
            if constrained is not None and np.any(constrained)
            else None,
            order=None if order is None else np.asarray(order, dtype=int),
        )

    @property
    def held(self) -> np.ndarray | None:
        """Former name of ``constrained``."""
        warnings.warn("Blocks.held is now Blocks.constrained", DeprecationWarning, stacklevel=2)
        return self.constrained

    @property
    def n_blocks(self) -> int:
        return len(self.block_loop) - 1

    @property
    def n_vertices(self) -> int:
        return len(self.vertices)

    @cached_property
    def next_vertex(self) -> np.ndarray:
        """(n_vertices,) the vertex at the far end of each edge."""
        following = np.arange(1, self.n_vertices + 1)
        following[self.loop_start[1:] - 1] = self.loop_start[:-1]
        return following

    @cached_property
    def previous_vertex(self) -> np.ndarray:
        """(n_vertices,) the vertex before each vertex of its loop."""
        before = np.empty(self.n_vertices, int)
        before[self.next_vertex] = np.arange(self.n_vertices)
        return before

    @cached_property
    def vertex_start(self) -> np.ndarray:
        """(n_blocks + 1,) first vertex of each block."""
        return self.loop_start[self.block_loop]

    @cached_property
    def vertex_block(self) -> np.ndarray:
        """(n_vertices,) the block that owns each vertex (and the edge that leaves it)."""
        return np.repeat(np.arange(self.n_blocks), np.diff(self.vertex_start))

    def loops(self, block: int, vertices: np.ndarray | None = None) -> list[np.ndarray]:
        """The loops of ``block`` as (n, 2) arrays, taken from ``vertices`` (default: the reference ones)."""
        vertices = self.vertices if vertices is None else vertices
        first, last = self.block_loop[block], self.block_loop[block + 1]
        return [vertices[self.loop_start[k] : self.loop_start[k + 1]] for k in range(first, last)]

    def edges_named(self, name: str) -> np.ndarray:
        """Indices of the edges called ``name``; may be empty."""
        return self._edges_by_name.get(name, np.empty(0, int))

    def edges_that_exist(self, name: str, what: str) -> np.ndarray:
        """As `edges_named`; raises ValueError that begins with ``what`` if there are none."""
        edges = self.edges_named(name)
        if len(edges) == 0:
            known = ", ".join(repr(n) for n in self.edge_names if n) or "none"
            raise ValueError(f"{what}, but no edge has that name (names: {known})")
        return edges

    @cached_property
    def _edges_by_name(self) -> dict[str, np.ndarray]:
        return {name: np.flatnonzero(self.edge_name == k) for k, name in enumerate(self.edge_names)}

    @cached_property
    def outward_normals(self) -> np.ndarray:
        """(n_vertices, 2) unit normals of the edges, out of the rock."""
        along = self.vertices[self.next_vertex] - self.vertices
        return outward_normal_of(along / np.hypot(along[:, 0], along[:, 1])[:, None])

    def mean_vertices(self, vertices: np.ndarray) -> np.ndarray:
        """(n_blocks, 2) mean of each block's ``vertices``, m."""
        # Relative to each block's first vertex, to keep digits far from the origin.
        start = self.vertex_start[:-1]
        first = vertices[start]
        return first + np.add.reduceat(vertices - first[self.vertex_block], start, axis=0) / self._vertex_count

    def displacements(self, vertices: np.ndarray) -> np.ndarray:
        """(n_blocks, 2) m, displacement of the mean of each block's vertices from the reference coordinates to
        ``vertices``."""
        return self.mean_vertices(vertices) - self.mean_vertices(self.vertices)

    @cached_property
    def _vertex_count(self) -> np.ndarray:
        return np.diff(self.vertex_start)[:, None]

    @cached_property
    def affine_fit(self) -> tuple[np.ndarray, np.ndarray]:
        """(n_blocks, 2) mean of each block's reference vertices, m, and weights w (n_vertices, 2), 1/m.

        The affine motion that fits current vertices x in the least-squares sense has the gradient Σ (x − mean x) ⊗
        w."""
        centre, start = self.mean_vertices(self.vertices), self.vertex_start[:-1]
        arm = self.vertices - centre[self.vertex_block]
        moments = np.add.reduceat(arm[:, :, None] * arm[:, None, :], start, axis=0)
        return centre, np.einsum("ij,ijk->ik", arm, np.linalg.inv(moments)[self.vertex_block])

    @cached_property
    def in_side(self) -> np.ndarray:
        """(n_vertices,) bool: vertices inside a straight side, where the edges before and after are collinear.

        The uniform strain of a block keeps straight sides straight."""
        along = self.vertices[self.next_vertex] - self.vertices
        before = along[self.previous_vertex]
        ahead = before[:, 0] * along[:, 0] + before[:, 1] * along[:, 1]
        turn = before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0]
        return (ahead > 0) & (np.abs(turn) <= STRAIGHT * ahead)

    @cached_property
    def side_start(self) -> list[int]:
        """(n_vertices,) the first edge of the straight side that each edge is part of."""
        is_straight, previous = self.in_side.tolist(), self.previous_vertex.tolist()
        first = [-1] * self.n_vertices
        for edge in range(self.n_vertices):
            chain = [edge]
            while first[chain[-1]] < 0 and is_straight[chain[-1]]:
                chain.append(previous[chain[-1]])
            start = max(first[chain[-1]], -1)
            for k in chain:
                first[k] = chain[-1] if start < 0 else start
        return first

    @cached_property
    def sides(self) -> dict[int, list[int]]:
        """First edge of each straight side → the vertices along it, both ends included."""
        following = self.next_vertex.tolist()
        sides = {}
        for start in sorted(set(self.side_start)):
            side = [start, following[start]]
            while self.side_start[side[-1]] == start:
                side.append(following[side[-1]])
            sides[start] = side
        return sides

    @cached_property
    def side_chains(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """`side_start` and `sides` as arrays.

        (n_vertices,) first edge of each edge's side; (n_vertices,) twice, for such a first edge, where its vertices
        begin and end in the last array; (n,) the vertices of all sides, side after side."""
        lengths = {start: len(side) for start, side in self.sides.items()}
        counts = np.array([lengths.get(edge, 0) for edge in range(self.n_vertices)], dtype=np.int64)
        last = np.cumsum(counts)
        chain = np.array([vertex for start in sorted(self.sides) for vertex in self.sides[start]], dtype=np.int64)
        return np.array(self.side_start, dtype=np.int64), last - counts, last, chain

    @cached_property
    def _area_moments(self) -> dict[int, tuple[float, np.ndarray, np.ndarray]]:
        return {}

    def area_moments(self, block: int) -> tuple[float, np.ndarray, np.ndarray]:
        """(area, centroid (2,), second moments about it (2, 2)) of the reference polygon of ``block``."""
        if block not in self._area_moments:
            self._area_moments[block] = area_moments(self.loops(block))
        return self._area_moments[block]

    def areas(self, vertices: np.ndarray | None = None) -> np.ndarray:
        """(n_blocks,) areas without holes, m²."""
        v = self.vertices if vertices is None else vertices
        # The shoelace sum relative to each block's first vertex keeps its digits far from the origin.
        own = v - v[self.vertex_start[:-1]][self.vertex_block]
        w = own[self.next_vertex]
        return 0.5 * np.bincount(
            self.vertex_block, weights=own[:, 0] * w[:, 1] - own[:, 1] * w[:, 0], minlength=self.n_blocks
        )

    def with_vertices(self, vertices: np.ndarray) -> Blocks:
        """The same blocks with other reference coordinates."""
        return replace(self, vertices=np.asarray(vertices, dtype=float))


def _refuse_lengths(n_blocks: int, given: dict[str, Sequence | None]) -> None:
    for what, entries in given.items():
        if entries is not None and len(entries) != n_blocks:
            raise ValueError(f"{what} needs an entry for each of {n_blocks} blocks, got {len(entries)}")
    constrained = given["constrained"]
    if constrained is not None and np.shape(constrained) != (n_blocks, 6) and n_blocks:
        raise ValueError(
            f"constrained needs six entries per block (u0, v0, r0, εx, εy, γxy), got an array of shape "
            f"{np.shape(constrained)}"
        )
    material = given["material"]
    if material is not None and n_blocks:
        wrong = np.flatnonzero((np.asarray(material) < 0) | (np.asarray(material) != np.asarray(material, dtype=int)))
        if len(wrong):
            raise ValueError(f"material of block {wrong[0]} must be an index from 0 on, got {material[wrong[0]]!r}")


def _refuse_loops(edge_names: Sequence[Sequence[Sequence[str]]], block_loop: list[int], names: Sequence[str]) -> None:
    for b, name in enumerate(names):
        loops = block_loop[b + 1] - block_loop[b]
        if len(edge_names[b]) != loops:
            raise ValueError(f"{name}: edge_names needs a list for each of {loops} loops, got {len(edge_names[b])}")


def _refuse_shape(loop: np.ndarray, label: list[str] | None, name: str) -> None:
    if loop.ndim != 2 or loop.shape[1] != 2 or len(loop) < 3:
        raise ValueError(f"{name}: an outline needs at least three vertices (x, y), got an array of shape {loop.shape}")
    if label is not None and len(label) != len(loop):
        raise ValueError(f"{name}: {len(loop)} edges but {len(label)} edge names")


def _refuse_invalid_outline(loop: np.ndarray, name: str) -> None:
    if not np.isfinite(loop).all():
        raise ValueError(
            f"{name}: vertex {int(np.flatnonzero(~np.isfinite(loop).all(axis=1))[0])} is not a finite point"
        )
    span = np.ptp(loop, axis=0).max()
    step = np.roll(loop, -1, axis=0) - loop
    short = np.hypot(step[:, 0], step[:, 1]) <= 1e-12 * span
    if short.any():
        at = int(np.flatnonzero(short)[0])
        raise ValueError(
            f"{name}: vertices {at} and {(at + 1) % len(loop)} coincide at ({loop[at, 0]:g}, {loop[at, 1]:g})"
        )
    if np.abs(np.linalg.svd(loop - loop.mean(axis=0), compute_uv=False)[1]) <= 1e-14 * span:
        raise ValueError(f"{name}: the outline encloses no area")
    crossing = crossing_edges(loop)
    if crossing is not None:
        i, j = crossing
        raise ValueError(
            f"{name}: the edges from vertex {i} ({loop[i, 0]:g}, {loop[i, 1]:g}) and from vertex {j} "
            f"({loop[j, 0]:g}, {loop[j, 1]:g}) of the outline cross or touch"
        )
    if abs(signed_area(loop)) <= 1e-14 * span**2:
        raise ValueError(f"{name}: the outline encloses no area")


def _refuse_hole_outside(outline: np.ndarray, hole: np.ndarray, name: str) -> None:
    near, following = roundoff_of(outline, hole), np.roll(outline, -1, axis=0)
    for x, y in hole:
        # At a corner where it touches the outline, a hole is checked against the outline's angle there; at an edge,
        # against either side.
        at = np.array([x, y])
        if abs(winding_number([outline], at)) < 1e-6 and distance_to_edges(at, outline, following) > near:
            raise ValueError(f"{name}: a hole reaches out of the outline at ({x:g}, {y:g})")
    crossing = crossing_loops(outline, hole)
    if crossing is not None:
        raise ValueError(f"{name}: a hole reaches out of the outline at ({crossing[0]:g}, {crossing[1]:g})")
    # Between corners where it touches the outline an edge may lie along it: there is no rock beside it then.
    along = np.roll(hole, -1, axis=0) - hole
    outwards = np.stack([along[:, 1], -along[:, 0]], axis=1) * np.sign(signed_area(hole))
    for point in hole + 0.5 * along + 1e-6 * outwards:
        if abs(winding_number([outline], point)) < 0.5:
            raise ValueError(
                f"{name}: an edge of a hole lies along the outline at ({point[0]:.6g}, {point[1]:.6g}): draw the "
                "outline around the opening"
            )


def _refuse_shared(holes: list[np.ndarray], name: str) -> None:
    """Raise ValueError for overlapping holes: their common area would be subtracted twice."""
    low, high = (np.array([extreme(hole, axis=0) for hole in holes]) for extreme in (np.min, np.max))
    for k, hole in enumerate(holes):
        near = ((low[:k] <= high[k]) & (high[:k] >= low[k])).all(axis=1)
        for m in np.flatnonzero(near):
            shared = crossing_loops(hole, holes[m])
            shared = point_in_both(hole, holes[m]) if shared is None else shared
            if shared is not None:
                raise ValueError(
                    f"{name}: holes {m + 1} and {k + 1} overlap at ({shared[0]:g}, {shared[1]:g}): draw them as one "
                    "hole"
                )
