"""Key blocks by block theory in two dimensions: which blocks are removable, and which of them slide or fall.

A block between fixed neighbours can move in a direction s if s·n ≥ 0 for the normals n with which the touching faces
push it. It is removable if there is such an s: its joint pyramid is not empty, and the block is finite (Goodman & Shi
1985, Block theory, chapter 4). The resultant r of its forces decides the mode (their chapter 9): the block falls along
r, or slides along the face whose direction is nearest to r against that face's friction and cohesion, or is pressed
into its neighbours by r.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..joints.joint_law import JointLaw
from ..material import Material
from ..state import OPEN, State
from .block_arrays import Blocks

#: Classes of blocks.
HELD, SAFE, FRICTION, SLIDES, FALLS, FIXED, UNKNOWN = 0, 1, 2, 3, 4, -1, -2
CLASSES = {
    HELD: "held by its neighbours",
    SAFE: "removable, pushed in",
    FRICTION: "removable, held by strength",
    SLIDES: "key block, slides",
    FALLS: "key block, falls",
    FIXED: "fixed, or dug out",
    UNKNOWN: "not known before contacts have been sought",
}

#: One row per block.
KEY_BLOCK = np.dtype(
    [
        ("kind", np.int64),  # HELD, SAFE, FRICTION, SLIDES, FALLS or FIXED
        ("direction", np.float64),  # rad, direction in which it would move; nan where there is none
        ("factor", np.float64),  # shear strength over driving force on its face; nan where it does not slide
        (
            "displacement",
            np.float64,
        ),  # m, of the mean of its vertices, relative to the fixed rock
        ("speed", np.float64),  # m/s, of its centroid, relative to the fixed rock
        ("rank", np.int64),  # 0 the block that has moved farthest; fixed ones last
    ]
)

#: Faces whose normals differ by less than this (rad) are one face.
_ONE_FACE = 0.02
#: An open joint narrower than this fraction of a block's size √area counts as touching.
_NEAR = 1e-3


def key_blocks(
    blocks: Blocks, materials: Sequence[Material], joints: Sequence[JointLaw], state: State, gravity: np.ndarray
) -> np.ndarray:
    """KEY_BLOCK rows of all ``blocks`` in ``state`` under ``gravity`` (2,) m/s², the neighbours of each taken as fixed.

    Corner-to-corner contacts do not restrain a block here.
    """
    joints = joints or (JointLaw("frictionless"),)
    out = np.zeros(blocks.n_blocks, KEY_BLOCK)
    fixed = np.asarray(blocks.fixed, dtype=bool)
    if state.removed is not None:
        fixed = fixed | state.removed
    out["direction"] = out["factor"] = np.nan
    out["kind"][fixed] = FIXED
    _rank(out, blocks, state, fixed)
    area = blocks.areas(state.vertices)
    gravity = np.asarray(gravity, dtype=float)
    pull = np.arctan2(gravity[1], gravity[0]) if gravity.any() else np.nan
    owner, angle, row = _faces(state.contacts, np.sqrt(area))
    touched = np.zeros(blocks.n_blocks, bool)
    touched[owner] = True
    out["kind"][~touched & ~fixed] = SAFE if np.isnan(pull) else FALLS
    out["direction"][~touched & ~fixed] = pull
    for b, start, end, spare in _spares(owner, angle):
        if fixed[b]:
            continue
        # Normals fill the arc from `start` to `end`; directions that leave all faces that from end − 90° to start +
        # 90°.
        low, high = end - 0.5 * np.pi, end - 0.5 * np.pi + max(spare, 0.0)
        kind, way, factor = SAFE, np.nan, np.nan
        if np.isnan(pull):
            way = 0.5 * (low + high)
        elif 0.0 < (pull - low) % (2 * np.pi) < high - low:
            kind, way = FALLS, pull
        else:
            # Along a face against which the resultant presses; between parallel faces both directions are equivalent.
            slides = [(np.cos(pull - w), f, w) for w, f in ((low, end), (high, start)) if np.cos(pull - f) <= 1e-9]
            along, face, slide = max(slides, default=(0.0, 0.0, 0.0))
            if along > 1e-9:
                own = state.contacts[row[(owner == b) & (np.abs(_principal(angle - face)) <= _ONE_FACE)]]
                weight = materials[blocks.material[b]].density * area[b] * np.hypot(*gravity)
                holding, way = _strength(own, joints, max(0.0, -np.cos(pull - face)) * weight), slide
                factor = holding / (along * weight) if weight > 0 else np.nan
                kind = SLIDES if factor < 1.0 else FRICTION
        if kind > out["kind"][b]:
            out["kind"][b], out["direction"][b], out["factor"][b] = kind, _principal(way), factor
    return out


def _principal(angle: Any) -> Any:
    """``angle`` in [−π, π)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def _spares(owner: np.ndarray, angle: np.ndarray) -> Iterator[tuple[int, float, float, float]]:
    """Free half-planes of blocks: block, arc of its face normals from start to end (rad), free angle beyond π (rad).

    A block between parallel faces has two."""
    if len(owner) == 0:
        return
    order = np.lexsort((angle, owner))
    owner, angle = owner[order], angle[order]
    first = np.flatnonzero(np.diff(owner, prepend=-1))
    last = np.append(first[1:], len(owner)) - 1
    after = np.arange(1, len(owner) + 1)
    after[last] = first
    free = np.mod(angle[after] - angle, 2 * np.pi) - np.pi
    free[last] = angle[first] + np.pi - angle[last]
    for k in np.flatnonzero(free >= -_ONE_FACE):
        yield int(owner[k]), float(angle[after[k]]), float(angle[k]), float(free[k])


def _rank(out: np.ndarray, blocks: Blocks, state: State, fixed: np.ndarray) -> None:
    moved = blocks.displacements(state.vertices)
    speed = state.velocity[:, :2]
    base = np.asarray(blocks.fixed, dtype=bool)
    if base.any():
        # Under base motion the fixed rock moves as one body, and the blocks on it move with it.
        moved, speed = moved - moved[base].mean(axis=0), speed - speed[base].mean(axis=0)
    out["displacement"] = np.hypot(moved[:, 0], moved[:, 1])
    out["speed"] = np.hypot(speed[:, 0], speed[:, 1])
    order = np.lexsort((-out["speed"], -out["displacement"], fixed))
    out["rank"][order] = np.arange(len(out))


def _faces(contacts: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For both blocks of every touching pair: block, angle of the normal that pushes it (rad), row in ``contacts``."""
    inside = (contacts["length"] > 0) | ((contacts["position"] > 1e-3) & (contacts["position"] < 1 - 1e-3))
    inside |= contacts["normal_force"] > 0
    near = _NEAR * np.minimum(size[contacts["block"]], size[contacts["other"]])
    row = np.flatnonzero(inside & ((contacts["state"] != OPEN) | (contacts["gap"] < near)))
    normal = contacts["normal"][row]
    angle = np.arctan2(normal[:, 1], normal[:, 0])
    back = np.where(angle > 0, angle - np.pi, angle + np.pi)
    return (
        np.concatenate([contacts["block"][row], contacts["other"][row]]),
        np.concatenate([angle, back]),
        np.concatenate([row, row]),
    )


def _strength(rows: np.ndarray, joints: Sequence[JointLaw], press: float) -> float:
    """Shear strength of a face, N: ``press`` times the mean tan φ of its contacts, plus the cohesion of bonded ones."""
    if len(rows) == 0:
        return 0.0
    friction = np.array([joints[k].friction for k in rows["law"]])
    cohesion = np.array([joints[k].cohesion for k in rows["law"]])
    mean = float(np.average(friction, weights=np.maximum(rows["length"], 1e-12)))
    return press * mean + float((cohesion * rows["length"] * (rows["bonded"] > 0)).sum())
