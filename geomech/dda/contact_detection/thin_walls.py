"""Thin walls: rejects contacts of a vertex with the far side of a thin part of a block, −gap > T/2.

Behind the line of an edge lies a whole half-plane, of which the block is only the nearest part. A vertex at the gap g <
0 penetrates the edge by |g| if it lies in the block. Where it lies beyond half the wall's thickness T, measured below
its foot on the edge,

    −g > T / 2,

it has come through the other side, or lies outside beyond it. Of the two faces of a corner it touches the one that it
is in front of. (Two corners that meet have one contact, see `rounded_corners`.) A contact that was closed before, or
that starts behind its line, as on the faces of an open crack that splits its block, is accepted.
"""

from __future__ import annotations

import numpy as np

from ...compiled import UNCOUNTED, kept, part
from ..kinematics.tolerances import NOTHING, SAME
from .entrance_edges import Outlines


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _thickness(vertices, next_vertex, edge, first, last, x, y, nx, ny, least):
    """Thickness of a block below the point (x, y) on its ``edge``, against the outward normal (nx, ny), m, and the edge
    where it ends.

    The block has the vertices from ``first`` to ``last``; hits nearer than ``least`` m are ignored."""
    thick, far = np.inf, -1
    for e in range(first, last):
        if e == edge:
            continue
        f = next_vertex[e]
        dx, dy = vertices[f, 0] - vertices[e, 0], vertices[f, 1] - vertices[e, 1]
        # Outward normal of e is (dy, −dx): the ray leaves the block where it points along it.
        leaving = -(dy * nx - dx * ny)
        if leaving <= 0.0:
            continue
        px, py = vertices[e, 0] - x, vertices[e, 1] - y
        along = (px * ny - py * nx) / (dx * -ny + dy * nx)
        if along < 0.0 or along > 1.0:
            continue
        inward = -((px + along * dx) * nx + (py + along * dy) * ny)
        if least < inward < thick:
            thick, far = inward, e
    return thick, far


@part(fastmath=False, error_model="numpy", nogil=True, **UNCOUNTED)
def _convex(vertices, next_vertex, previous_vertex, i):
    """True if the corner at vertex ``i`` is convex or flat."""
    k, j = previous_vertex[i], next_vertex[i]
    ax, ay = vertices[i, 0] - vertices[k, 0], vertices[i, 1] - vertices[k, 1]
    bx, by = vertices[j, 0] - vertices[i, 0], vertices[j, 1] - vertices[i, 1]
    return ax * by - ay * bx >= -SAME * np.sqrt((ax * ax + ay * ay) * (bx * bx + by * by))


def from_outside(vertex, edge, gap, outlines: Outlines, owner, known, shallow) -> np.ndarray:
    """(n,) bool: False for contacts of ``vertex`` (n,) with ``edge`` (n,) whose vertex is on the far side of a thin
    wall.

    ``gap`` (n,) m; ``owner`` (n_vertices,) blocks; ``known`` (n,) bool:
    contacts that came from outside before; ``shallow`` (n,) m, −1 where no corners meet. Of corners that meet both
    faces are kept, unless the vertex lies in front of one and deeper than ``shallow`` behind the other."""
    keep = np.ones(len(vertex), np.bool_)
    behind = np.flatnonzero(~known & (gap < 0.0))
    vertices, next_vertex = outlines.vertices, outlines.next_vertex
    if len(behind):
        along = vertices[next_vertex[edge[behind]]] - vertices[edge[behind]]
        behind = behind[gap[behind] < -SAME * np.sqrt(along[:, 0] ** 2 + along[:, 1] ** 2)]
    if len(behind):  # seldom: most runs need not compile what follows
        keep[behind] = _from_outside(vertex[behind], edge[behind], gap[behind], *outlines, owner, shallow[behind])
    return keep


@kept(fastmath=False, error_model="numpy", nogil=True)
def _from_outside(vertex, edge, gap, vertices, next_vertex, previous_vertex, start, owner, shallow):
    """As `from_outside`, for contacts whose vertex is behind the line of the edge and that are not known."""
    keep = np.ones(vertex.shape[0], np.bool_)
    for c in range(vertex.shape[0]):
        v, e = vertex[c], edge[c]
        f = next_vertex[e]
        dx, dy = vertices[f, 0] - vertices[e, 0], vertices[f, 1] - vertices[e, 1]
        length = np.sqrt(dx * dx + dy * dy)
        nx, ny = dy / length, -dx / length
        t = ((vertices[v, 0] - vertices[e, 0]) * dx + (vertices[v, 1] - vertices[e, 1]) * dy) / (length * length)
        # Beyond a convex corner the line stands for the corner: behind it there is not this block.
        if t <= 0.0 and _convex(vertices, next_vertex, previous_vertex, e):
            continue
        if t >= 1.0 and _convex(vertices, next_vertex, previous_vertex, f):
            continue
        b = owner[e]
        past = t <= 0.0 or t >= 1.0
        depth = -gap[c]
        if past:
            # In a re-entrant corner it penetrates both faces: its depth is the distance from the corner.
            end = e if t <= 0.0 else f
            x, y = vertices[end, 0], vertices[end, 1]
            nx, ny = x - vertices[v, 0], y - vertices[v, 1]
            depth = np.sqrt(nx * nx + ny * ny)
            nx, ny = nx / depth, ny / depth
        else:
            x, y = vertices[e, 0] + t * dx, vertices[e, 1] + t * dy
        # Hits nearer than `NOTHING` of the depth are the near side itself.
        thick, far = _thickness(vertices, next_vertex, e, start[b], start[b + 1], x, y, nx, ny, NOTHING * depth)
        if shallow[c] >= 0.0 and not past and far >= 0 and (next_vertex[far] == e or next_vertex[e] == far):
            g = next_vertex[far]
            ux, uy = vertices[g, 0] - vertices[far, 0], vertices[g, 1] - vertices[far, 1]
            before = (vertices[v, 0] - vertices[far, 0]) * uy - (vertices[v, 1] - vertices[far, 1]) * ux
            if before <= 0.0 or depth <= shallow[c]:
                continue
        keep[c] = depth <= 0.5 * thick
    return keep
