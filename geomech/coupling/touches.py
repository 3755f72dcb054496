"""What touches a block: contacts as it feels them, gathered into joint faces and those that stand alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..model import Blocks, Motion
from .load_pieces import FACE_ANGLE, SAME, line_of, place_along


class Touch(NamedTuple):
    """A contact as one of its blocks feels it. There are few, so they are plain numbers.

    ``own``: the block owns the vertex, not the edge; ``normal`` of the edge, current axes; ``point`` and the ``force``
    on the block in its reference frame; ``acts``: it carries force; ``gap`` m; ``holds``: it may pull; ``against``: the
    other block.
    """

    own: bool
    vertex: int
    edge: int
    normal: list[float]
    point: list[float]
    force: tuple[float, float]
    acts: bool
    gap: float
    holds: bool
    against: int


def touches_of(
    block: int, motion: Motion, contacts: np.ndarray, c: float, s: float, tensile_strength: Sequence[float] | None
) -> list[Touch]:
    """What touches ``block``, which has turned by the angle of cosine ``c`` and sine ``s``."""
    rows = contacts[(contacts["block"] == block) | (contacts["other"] == block)]
    holding = np.zeros(len(rows), bool)
    if tensile_strength is not None:
        holding = (rows["bonded"] == 1) & (np.asarray(tensile_strength)[rows["law"]] > 0)
    names = ("block", "other", "vertex", "edge", "normal", "normal_force", "shear_force", "gap")
    columns = (rows[name].tolist() for name in names)
    touches = []
    for owner, other, vertex, edge, normal, push, shear, gap, point, holds in zip(
        *columns, motion.reference(block, rows["point"]).tolist(), holding.tolist(), strict=True
    ):
        own = owner == block
        if not own:
            push, shear = -push, -shear
        # Shear acts along the edge's direction: its outward normal turned by +90°.
        x, y = push * normal[0] - shear * normal[1], push * normal[1] + shear * normal[0]
        acts = push != 0 or shear != 0
        force, against = (c * x + s * y, c * y - s * x), other if own else owner
        touches.append(Touch(own, vertex, edge, normal, point, force, acts, gap, holds, against))
    return touches


def on_outline(blocks: Blocks, touch: Touch) -> np.ndarray:
    """Where a contact's spring stands on the block, reference frame: its vertex, or the foot of the other's on its
    edge."""
    start = blocks.vertices[touch.edge]
    if touch.own:
        return blocks.vertices[touch.vertex]
    side = blocks.vertices[blocks.next_vertex[touch.edge]] - start
    return start + float(np.clip((np.array(touch.point) - start) @ side / (side @ side), 0.0, 1.0)) * side


def _touching_edge(blocks: Blocks, vertices: np.ndarray, vertex: int, normal: list[float]) -> tuple[int, float]:
    """Which of the two edges at ``vertex`` lies against an edge with outward ``normal``, and the angle between."""
    best = (-1, math.inf)
    nx, ny = normal
    for edge in (vertex, int(blocks.previous_vertex[vertex])):
        (x0, y0), (x1, y1) = vertices[edge].tolist(), vertices[blocks.next_vertex[edge]].tolist()
        x, y = x1 - x0, y1 - y0
        # The outward normal of the edge is (y, −x) over its length.
        angle = math.atan2(abs(y * ny + x * nx), x * ny - y * nx)
        if angle < best[1]:
            best = (edge, angle)
    return best


def faces_and_lone(
    blocks: Blocks, vertices: np.ndarray, touches: list[Touch]
) -> tuple[dict[tuple[int, int], list[Touch]], list[Touch]]:
    """What touches a block as joint faces with at least two distinct points, (first edge of the own straight side,
    first edge of the other's) → contacts, and the contacts left alone. A vertex in a straight side, as the end of a
    named piece, does not part what touches it into faces of their own."""
    found: dict[tuple[int, int], list[Touch]] = {}
    lone = []
    for touch in touches:
        touching, angle = _touching_edge(blocks, vertices, touch.vertex, touch.normal)
        if angle <= FACE_ANGLE:
            own, facing = (touching, touch.edge) if touch.own else (touch.edge, touching)
            found.setdefault((blocks.side_start[own], blocks.side_start[facing]), []).append(touch)
        elif touch.acts:
            lone.append(touch)
    faces = {}
    for face, members in found.items():
        start, _, along, length = line_of(blocks, blocks.sides[face[0]])
        acting = [touch for touch in members if touch.acts]
        # A corner that has slid past an end of the side presses on that end.
        places = [min(max(place_along(touch.point, start, along), 0.0), length) for touch in acting]
        # Points apart by no more than round-off are one.
        if acting and max(places) - min(places) > SAME * length:
            faces[face] = members
        else:
            lone += acting
    return faces, lone
