"""Contacts of one block in its own frame, grouped by joint face; single corner contacts kept apart.

Compiled; `boundary_tractions` has the kernel that calls these functions.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .piecewise_traction import FACE_ANGLE, SAME, allocating, jit, line_of, place_along


class Touches(NamedTuple):
    """Contacts of one block, seen from that block; arrays (n,).

    ``own``: the block owns the ``vertex`` (otherwise the ``edge``); (nx, ny) outward normal of the edge, current axes;
    (px, py) point of contact, m, and (fx, fy) force on the block, N/m, in the reference frame of the block; ``acts``:
    the force is not zero; ``gap`` m; ``holds``: the contact may carry tension; ``against``: the other block.
    """

    own: np.ndarray
    vertex: np.ndarray
    edge: np.ndarray
    nx: np.ndarray
    ny: np.ndarray
    px: np.ndarray
    py: np.ndarray
    fx: np.ndarray
    fy: np.ndarray
    acts: np.ndarray
    gap: np.ndarray
    holds: np.ndarray
    against: np.ndarray


@allocating
def touches_of(block, contacts, rows, holding, centre, reference_centre, gradient, c, s):
    """Contacts of ``block``: the CONTACT ``rows`` (n,) of ``contacts``. ``holding``: those that may carry tension. The
    block has moved by the affine `Motion` (``centre``, ``reference_centre``, ``gradient``) and rotated by the angle
    with cosine ``c`` and sine ``s``."""
    n = len(rows)
    own, acts, holds = np.empty(n, np.bool_), np.empty(n, np.bool_), np.empty(n, np.bool_)
    vertex, edge, against = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.int64)
    nx, ny, px, py, fx, fy, gap = (
        np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n),
    )  # fmt: skip
    det = gradient[0, 0] * gradient[1, 1] - gradient[0, 1] * gradient[1, 0]
    for k in range(n):
        row = contacts[rows[k]]
        own[k] = row.block == block
        against[k] = row.other if own[k] else row.block
        vertex[k], edge[k], gap[k], holds[k] = row.vertex, row.edge, row.gap, holding[rows[k]]
        nx[k], ny[k] = row.normal[0], row.normal[1]
        x, y = row.point[0] - centre[0], row.point[1] - centre[1]
        px[k] = reference_centre[0] + (gradient[1, 1] * x - gradient[0, 1] * y) / det
        py[k] = reference_centre[1] + (gradient[0, 0] * y - gradient[1, 0] * x) / det
        push, shear = row.normal_force, row.shear_force
        acts[k] = push != 0 or shear != 0
        if not own[k]:
            push, shear = -push, -shear
        # Shear acts along the edge's direction: its outward normal turned by +90°.
        x, y = push * nx[k] - shear * ny[k], push * ny[k] + shear * nx[k]
        fx[k], fy[k] = c * x + s * y, c * y - s * x
    return Touches(own, vertex, edge, nx, ny, px, py, fx, fy, acts, gap, holds, against)


@jit
def on_outline(of, touches, k):
    """Point of the block on which contact ``k`` acts, reference frame: its own vertex, or the foot of the other block's
    vertex on its edge."""
    if touches.own[k]:
        return of.vertices[touches.vertex[k], 0], of.vertices[touches.vertex[k], 1]
    edge = touches.edge[k]
    x, y = of.vertices[edge, 0], of.vertices[edge, 1]
    ax, ay = of.vertices[of.following[edge], 0] - x, of.vertices[of.following[edge], 1] - y
    place = ((touches.px[k] - x) * ax + (touches.py[k] - y) * ay) / (ax * ax + ay * ay)
    place = min(max(place, 0.0), 1.0)
    return x + place * ax, y + place * ay


@jit
def _touching_edge(of, vertex, nx, ny):
    """The edge at ``vertex`` that faces an edge with outward normal (nx, ny), and the angle between the two edges."""
    best, least = -1, math.inf
    for edge in (vertex, of.before[vertex]):
        following = of.following[edge]
        x, y = of.now[following, 0] - of.now[edge, 0], of.now[following, 1] - of.now[edge, 1]
        # The outward normal of the edge is (y, −x) over its length.
        angle = math.atan2(abs(y * ny + x * nx), x * ny - y * nx)
        if angle < least:
            best, least = edge, angle
    return best, least


@allocating
def faces_and_lone(of, touches):
    """Group contacts into joint faces with at least two distinct points.

    Returns the first edges (k, 2) of the two straight sides of each face, the block's own side first; the face of each
    contact (n,), −1 for none; and the numbers of the single contacts that carry force. Vertices within a straight side,
    as at the end of a named piece of edge, do not divide a face."""
    n = len(touches.own)
    face, lone, sides = np.full(n, -1), np.empty(n, np.int64), np.empty((n, 2), np.int64)
    alone = many = 0
    for k in range(n):
        touching, angle = _touching_edge(of, touches.vertex[k], touches.nx[k], touches.ny[k])
        if angle <= FACE_ANGLE:
            own, facing = (touching, touches.edge[k]) if touches.own[k] else (touches.edge[k], touching)
            own, facing = of.side_start[own], of.side_start[facing]
            for number in range(many):
                if sides[number, 0] == own and sides[number, 1] == facing:
                    face[k] = number
            if face[k] < 0:
                face[k] = many
                sides[many, 0], sides[many, 1] = own, facing
                many += 1
        elif touches.acts[k]:
            lone[alone] = k
            alone += 1
    for number in range(many):
        sx, sy, ax, ay, length = line_of(of, sides[number, 0])
        near, far = math.inf, -math.inf
        for k in range(n):
            if face[k] == number and touches.acts[k]:
                # A corner that has slid past the end of the side presses on that end.
                place = min(max(place_along(touches.px[k], touches.py[k], sx, sy, ax, ay), 0.0), length)
                near, far = min(near, place), max(far, place)
        # Points closer together than round-off count as one.
        if not far - near > SAME * length:
            for k in range(n):
                if face[k] == number:
                    face[k] = -1
                    if touches.acts[k]:
                        lone[alone] = k
                        alone += 1
    return sides[:many], face, lone[:alone]
