"""Signs, frames, component order and units of the whole package; ``tests/test_conventions.py`` tests them.

Units
    SI throughout: m, kg, s, N, Pa; the third dimension is 1 m thick, so a force is N per metre of thickness.
    Stress intensity factors are in Pa √m. Angles are degrees in scene files and in names that end in ``_deg``,
    radians everywhere else.

Frame
    x to the right, y up, angles counter-clockwise from x. Polygons run counter-clockwise (rock on the left hand of
    every edge), holes clockwise (rock again on the left). The outward normal of an edge with unit tangent (tx, ty) is
    therefore (ty, −tx).

Stress and strain
    Tension is positive. In-plane components are ordered (xx, yy, xy); strain uses the engineering shear
    γxy = ∂u/∂y + ∂v/∂x. Files carry six components in VTK's order, `VTK_STRESS`. Plane strain unless a material says
    ``plane = "stress"``.

Cracks
    The normal of a crack (or of any directed segment) is its tangent turned by +90°, `normal_of`; the face on the
    side the normal points to is the upper face ("+"). *Opening* is n·(u⁺ − u⁻): positive when the faces part.
    *Slip* is t·(u⁺ − u⁻): positive when the upper face moves along the tangent. At every tip the local frame looks
    out of the crack: K_I > 0 opens the tip, K_II > 0 when the face on the left of the direction of advance moves
    *forward* relative to the right face (with Williams' fields this is τ_xy > 0 straight ahead), and a positive K_II
    turns the crack clockwise (a negative growth angle).

Contacts
    A contact is a vertex of one block against an edge of another. Its gap is positive when they are apart. Forces are
    those that act *on the block that owns the vertex*; a normal force is positive in compression (the contact
    pushes); a shear force is positive along the edge's direction.
"""

from __future__ import annotations

import numpy as np

#: Order of stress components in every file that is written. (In arrays with a trailing axis of three: xx, yy, xy.)
VTK_STRESS = ("XX", "YY", "ZZ", "XY", "YZ", "XZ")


def normal_of(tangent: np.ndarray) -> np.ndarray:
    """The crack normal: ``tangent`` (..., 2) turned by +90°."""
    tangent = np.asarray(tangent, dtype=float)
    normal = np.empty_like(tangent)
    normal[..., 0], normal[..., 1] = -tangent[..., 1], tangent[..., 0]
    return normal


def outward_normal_of(tangent: np.ndarray) -> np.ndarray:
    """The outward normal of a block's edge (rock on the left): ``tangent`` (..., 2) turned by −90°."""
    return -normal_of(tangent)


def traction(stress: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """σ·n of in-plane ``stress`` (..., 3) on planes of unit ``normal`` (..., 2): (..., 2), Pa."""
    stress, normal = np.asarray(stress, dtype=float), np.asarray(normal, dtype=float)
    return np.stack(
        [
            stress[..., 0] * normal[..., 0] + stress[..., 2] * normal[..., 1],
            stress[..., 2] * normal[..., 0] + stress[..., 1] * normal[..., 1],
        ],
        axis=-1,
    )


def rotate_stress(stress: np.ndarray, angle: np.ndarray | float) -> np.ndarray:
    """Rotate ``stress`` (..., 3) with its material by ``angle`` (rad): R σ Rᵀ."""
    return turned_stress(np.asarray(stress, dtype=float), np.cos(angle), np.sin(angle))


def turned_stress(stress: np.ndarray, c: np.ndarray | float, s: np.ndarray | float) -> np.ndarray:
    """R σ Rᵀ of ``stress`` (..., 3) by the rotation with cosine ``c`` and sine ``s``, as `rotate_stress`."""
    xx, yy, xy = stress[..., 0], stress[..., 1], stress[..., 2]
    return np.stack(
        [
            c * c * xx + s * s * yy - 2 * s * c * xy,
            s * s * xx + c * c * yy + 2 * s * c * xy,
            s * c * (xx - yy) + (c * c - s * s) * xy,
        ],
        axis=-1,
    )
