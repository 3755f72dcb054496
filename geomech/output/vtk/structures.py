"""Grids other than the rock itself: outlines of blocks, bolts with their forces, the water table.

Outlines are the edges of the polygons, without triangle sides; a bolt is one line between its ends, which move with
their blocks.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geomech.model import GROUND, Blocks, Bolt, Cycle, Problem
from geomech.model.blocks.block_motion import Motion
from geomech.model.blocks.polygon import winding_number
from geomech.model.loads.ground import lowest_over, ponds
from geomech.shapes.block_cutting.rock_outline import ground_of

from .block_motion import displacement
from .vtu import LINE, Grid

#: States of a bolt in the files.
NOT_INSTALLED, ACTS, YIELDS, BROKEN = 0, 1, 2, 3

#: Number of pieces in which a bent edge is drawn.
_PIECES = 12


def _lines(points: np.ndarray, pairs: np.ndarray, moved: np.ndarray, cell_data: dict[str, np.ndarray]) -> Grid:
    return Grid(
        points=points,
        connectivity=pairs.ravel(),
        offsets=np.arange(2, 2 * len(pairs) + 1, 2),
        types=np.full(len(pairs), LINE),
        point_data={"displacement": moved},
        cell_data=cell_data,
    )


def outlines_grid(cycle: Cycle, configuration: str) -> Grid:
    """Every edge of every block, holes included, as a line between two vertices of the block."""
    blocks, state = cycle.blocks, cycle.state
    block, edge = blocks.vertex_block, np.arange(blocks.n_vertices)
    removed = np.zeros(blocks.n_blocks, bool) if state.removed is None else state.removed
    pairs = np.stack([edge, blocks.next_vertex], axis=1)
    points, moved = blocks.vertices, cycle.moved
    placed = cycle.placed
    if cycle.bent:
        pairs, edge, more, more_moved = _bent_edges(cycle, pairs)
        points, moved = np.concatenate([points, more]), np.concatenate([moved, more_moved])
        placed = points + moved
    return _lines(
        points if configuration == "reference" else placed,
        pairs,
        moved,
        {
            "block_id": block[edge], "fixed": blocks.fixed[block[edge]], "removed": removed[block[edge]],
            "edge_name": blocks.edge_name[edge],
        },
    )  # fmt: skip


def _bent_edges(cycle: Cycle, pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The edges ``pairs`` (n, 2), those of blocks of higher order divided into `_PIECES` pieces each.

    Returns lines (k, 2), the edge of each (k,), and the points added after the vertices (m, 2) with their displacements
    (m, 2).
    """
    blocks, n = cycle.blocks, cycle.blocks.n_vertices
    bends = np.isin(blocks.vertex_block, [*cycle.bent])
    some = np.flatnonzero(bends)
    at = np.arange(1, _PIECES)[:, None] / _PIECES
    start, end = blocks.vertices[pairs[some, 0]], blocks.vertices[pairs[some, 1]]
    more = (start[:, None] + at * (end - start)[:, None]).reshape(-1, 2)
    owner = np.repeat(blocks.vertex_block[some], _PIECES - 1)
    moved = displacement(cycle.motion, owner, more)
    for block, body in cycle.bent.items():
        own = owner == block
        moved[own] += body.deflection(more[own])
    inside = n + np.arange(len(more)).reshape(len(some), -1)
    chain = np.concatenate([pairs[some, :1], inside, pairs[some, 1:]], axis=1)
    lines = np.stack([chain[:, :-1], chain[:, 1:]], axis=2).reshape(-1, 2)
    edge = np.concatenate([np.flatnonzero(~bends), np.repeat(some, _PIECES)])
    return np.concatenate([pairs[~bends], lines]), edge, more, moved


class BoltLines:
    """The bolts of a run as lines. Their ends are located again when blocks are cut, which renumbers the parts."""

    def __init__(self, bolts: Sequence[Bolt]) -> None:
        self._bolts = tuple(bolts)
        self._count = -1
        self._holder = np.empty((0, 2), int)

    def grid(self, cycle: Cycle, motion: Motion, configuration: str) -> Grid:
        """The bolts at ``cycle`` with their forces; before the first step these are zero."""
        if cycle.blocks.n_blocks != self._count:
            self._holder = np.array([self._blocks_of(bolt, cycle.blocks) for bolt in self._bolts]).reshape(-1, 2)
            self._count = cycle.blocks.n_blocks
        ends = np.array([[bolt.start, bolt.end] for bolt in self._bolts], float).reshape(-1, 2)
        holder = self._holder.ravel()
        moved = np.zeros_like(ends)
        moves = holder != GROUND
        moved[moves] = displacement(motion, holder[moves], ends[moves])
        memory = cycle.state.bolts
        n = len(self._bolts)
        if len(memory) == n:
            force, shear, plastic = memory["force"], memory["shear_force"], memory["plastic"]
            state = np.where(memory["installed"], np.where(plastic != 0, YIELDS, ACTS), NOT_INSTALLED)
            state = np.where(memory["broken"], BROKEN, state)
        else:
            force = shear = plastic = np.zeros(n)
            state = np.zeros(n, int)
        return _lines(
            ends if configuration == "reference" else ends + moved,
            np.arange(2 * n).reshape(-1, 2),
            moved,
            {"force": force, "shear_force": shear, "yielded": plastic, "state": state, "bolt_id": np.arange(n)},
        )

    def _blocks_of(self, bolt: Bolt, blocks: Blocks) -> list[int]:
        """Blocks at the ends of ``bolt``; GROUND for an end in the ground."""
        if self._count < 0:  # the blocks are those of the scene
            return [bolt.block, bolt.other]
        other = GROUND if bolt.other == GROUND else _holding(blocks, bolt.end)
        return [_holding(blocks, bolt.start), other]


def _holding(blocks: Blocks, point: tuple[float, float]) -> int:
    """The block whose reference outline contains ``point`` (m), or else the one with the nearest vertex."""
    at = np.asarray(point, float)
    for b in range(blocks.n_blocks):
        own = blocks.vertices[blocks.vertex_start[b] : blocks.vertex_start[b + 1]]
        near = (own.min(axis=0) <= at).all() and (at <= own.max(axis=0)).all()
        if near and winding_number(blocks.loops(b), at) > 0.25:  # 0.5 on an edge
            return b
    return int(blocks.vertex_block[np.argmin(np.hypot(*(blocks.vertices - at).T))])


class WaterLine:
    """The water table over the width of the model."""

    def __init__(self, problem: Problem) -> None:
        self._water = problem.loads.water
        self._low, self._high = problem.blocks.vertices[:, 0].min(), problem.blocks.vertices[:, 0].max()
        self._ground = None if self._water is None else lowest_over(ground_of(problem.blocks))

    def grid(self, time: float) -> Grid:
        """The table at ``time`` s; it is fixed in space, so that its displacement is zero."""
        assert self._water is not None and self._ground is not None, "a scene without water has no water table"
        line = self._water.line_at(time)
        found = ponds(line, self._ground)
        ends = [x for pond in found for x in (pond.start, pond.end)]
        x = np.unique(np.concatenate([[self._low, self._high], line[0], ends]))
        x = x[(x >= self._low) & (x <= self._high)]
        points = np.stack([x, np.interp(x, *line)], axis=1)
        midpoint = 0.5 * (x[1:] + x[:-1])
        wet = np.zeros(len(midpoint), int)
        for pond in found:
            wet[(midpoint > pond.start) & (midpoint < pond.end)] = 1
        n = np.arange(len(midpoint))
        return _lines(points, np.stack([n, n + 1], axis=1), np.zeros_like(points), {"ponded": wet})
