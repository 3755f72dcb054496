"""Traces of joints drawn as outlines, between zones or blocks that are separate from the start."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...model import Blocks
from ..parts import JOINT, Joint

#: At a node a trace continues along the edge that turns by less than 5° (its cosine).
_STRAIGHT_ON = 0.9962
#: Largest displacement of a trace by cutting, in tolerances, where near misses follow one another.
_MOVED = 10.0


def joints_between(blocks: Blocks, known: Sequence[Joint], rock, tolerance: float) -> list[Joint]:
    """Joints with the traces of all edges called "joint:NAME" inside ``rock`` (a shapely area) that are not on the
    lines of the ``known`` joint of that name.

    Edges within ``tolerance`` (m) of the rock's rim are not inside.
    """
    import shapely

    rim = shapely.boundary(rock)
    shapely.prepare([rock, rim])
    found = []
    for name in blocks.edge_names:
        if not name.startswith(JOINT):
            continue
        edges = blocks.edges_named(name)
        ends = np.stack([blocks.vertices[edges], blocks.vertices[blocks.next_vertex[edges]]], axis=1)
        midpoint = shapely.points(ends.mean(axis=1))
        new = shapely.contains_properly(rock, midpoint) & ~shapely.dwithin(rim, midpoint, tolerance)
        lines = [shapely.LineString(line) for joint in known if joint.name == name for line in joint.lines]
        if len(lines):
            new[shapely.STRtree(lines).query(midpoint, "dwithin", _MOVED * tolerance)[0]] = False
        if new.any():
            # Both sides of a joint are edges: on a grid they are one.
            lines = shapely.union_all(shapely.linestrings(ends[new]), grid_size=tolerance)
            pieces = [shapely.get_coordinates(part) for part in shapely.get_parts(lines)]
            steps = [piece[k : k + 2] for piece in pieces for k in range(len(piece) - 1)]
            found.append(Joint(name, tuple(_traces(np.array(steps)))))
    return found


def _traces(pieces: np.ndarray) -> list[np.ndarray]:
    """Straight ``pieces`` (n, 2, 2) that meet at their ends as polylines, each as long as it continues straight."""
    nodes, end = np.unique(pieces.reshape(-1, 2), axis=0, return_inverse=True)
    end = end.reshape(-1, 2)
    # Half-piece 2 k + s leaves piece k at its end s; pairs of them continue into one another.
    away = nodes[end[:, ::-1].ravel()] - nodes[end.ravel()]
    away /= np.hypot(*away.T)[:, None]
    partner = np.full(len(away), -1)
    at = end.ravel()
    order = np.argsort(at, kind="stable")
    for own in np.split(order, np.flatnonzero(np.diff(at[order])) + 1):
        cosine = -away[own] @ away[own].T
        np.fill_diagonal(cosine, -1.0)
        while cosine.max() > (_STRAIGHT_ON if len(own) > 2 else -0.5):
            i, j = np.unravel_index(int(np.argmax(cosine)), cosine.shape)
            partner[own[i]], partner[own[j]] = own[j], own[i]
            cosine[[i, j]] = cosine[:, [i, j]] = -1.0
    left = np.ones(len(pieces), bool)
    traces = []
    # Ends first; the rest are closed.
    for half in [*np.flatnonzero(partner < 0).tolist(), *range(len(partner))]:
        if not left[half // 2]:
            continue
        line = [nodes[at[half]]]
        while half >= 0 and left[half // 2]:
            left[half // 2] = False
            line.append(nodes[at[half ^ 1]])
            half = int(partner[half ^ 1])
        traces.append(np.array(line))
    return traces
