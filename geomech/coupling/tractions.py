"""Contact forces of a block made into one boundary load of its elastic body, with the same force and moment.

The contacts of one joint face (two edges that lie against each other) are one distribution with the resultant and
moment of its contact forces: linear, or, but for bonds with tensile strength, a triangle where that would pull although
the resultant pushes (`face_pressure`). It ends where
the faces do: a contact that opens takes the pressure back from its place the further the wider it gapes. Shear follows
the pressure, so that it breaks Coulomb's law nowhere unless it breaks it as a whole. A lone vertex pressed into an edge
spreads over a short piece of that edge; a lone force on a block's own corner is resolved along the corner's two edges
and enters there as shear, which keeps both force and moment exactly. What presses beyond the end of an edge acts at
that end, and its moment about it on the whole outline. Tractions change without a jump as contacts come and go.

By the route "bases" faces on blocks that are fixed or guided press as on a rigid base, as their own elasticity has it
(`geomech.ddm.bases`), with the same force and moment; here it is said only where.

Two other routes are there to be compared with: "springs" leaves each contact's force where its spring is, a point force
on the boundary; "kelvin-springs" takes these by Kelvin's solution for the infinite plane, as Khanizadeh Bahabadi et al.
(2023, eqs. 2-4) write.

All of it lives in the block's reference frame: points are mapped back by the block's affine motion, forces turned
back by its rotation. What the forces then leave out of balance is the block's inertia (d'Alembert): it is put on as
a body force, linear in x, so that the elastic problem is in equilibrium to round-off.

What the forces leave out of the block's mean stress, its strain's inertia and viscosity take: in the block solver an
even stress, and an even stress it is here. The mean stress of the load is then the block's own, whose work on the
strain of the cracks is all that the block spends on them. (As a body force, the strain's inertia would load a crack in
the middle by half as much again, with nobody to do that work: cracks that run under waves gained 2 % of the load's
work, and viscous stress that opened them took as much.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..ddm.loads import first_moments, resultants
from ..model import Blocks, Motion
from .compliance import stress_rotation
from .face_load import add_face, add_lone
from .load_pieces import Pieces, add_couple, add_edge_piece, add_point_load
from .touches import faces_and_lone, on_outline, touches_of


@dataclass(frozen=True, eq=False)
class BoundaryLoad:
    """Load of one block's elastic body, reference frame.

    segments (m, 2, 2) pieces of the outline, directed along it; tractions (m, 2, 2) at their two ends, linear between;
    remote_stress (3,) the even stress besides, Pa;
    points and forces (k, 2) what acts at points, None without, ``kelvin`` as in `ddm.BodyLoad`;
    body_force (2,) and body_force_gradient (2, 2): b = body_force + gradient · (x − about), N/m³; ``imbalance`` is the
    resultant that inertia had to balance beyond the solver's own acceleration on the block as it is strained, relative
    to the forces' size; ``bases`` are rows of segments in which pressure is yet to be found, and the traction (2,) with
    a unit of it; ``crack_pressure`` and ``hole_pressure`` Pa, of fluids in endless rock.
    """

    segments: np.ndarray
    tractions: np.ndarray
    body_force: np.ndarray
    body_force_gradient: np.ndarray
    about: np.ndarray
    imbalance: float
    remote_stress: np.ndarray | None = None
    points: np.ndarray | None = None
    forces: np.ndarray | None = None
    kelvin: bool = False
    bases: tuple[tuple[np.ndarray, np.ndarray], ...] = ()
    crack_pressure: float = 0.0
    hole_pressure: float = 0.0


def boundary_load(
    block: int,
    blocks: Blocks,
    vertices: np.ndarray,
    motion: Motion,
    rotation: float,
    contacts: np.ndarray,
    edge_forces: np.ndarray,
    point_forces: np.ndarray,
    density: float = 0.0,
    gravity: np.ndarray | None = None,
    acceleration: np.ndarray | None = None,
    spin: float = 0.0,
    reaction: np.ndarray | None = None,
    route: str = "contacts",
    tensile_strength: Sequence[float] | None = None,
    overstress: np.ndarray | None = None,
    keep_straight: np.ndarray | None = None,
) -> BoundaryLoad:
    """The load of ``block``.

    ``vertices`` and ``motion`` are the geometry on which the forces are in equilibrium; ``contacts`` CONTACT rows on
    that geometry (any block's); ``edge_forces`` and ``point_forces`` EDGE_FORCE and POINT_FORCE rows of this block;
    ``acceleration`` (6,) and ``spin`` (rad/s) the block's own; ``reaction`` (6,) N, N m, what imposes its motion, which
    is spread over the block as its inertia is; ``route``: "contacts", "bases", "springs" or "kelvin-springs";
    ``keep_straight`` (n_blocks,) bool which blocks are bases;
    ``tensile_strength`` of the joint laws, Pa (None: none has any); ``overstress`` (3,) what the forces balance beyond
    the stress of the block, Pa, current axes (None: at rest).
    """
    c, s = math.cos(rotation), math.sin(rotation)
    pieces = Pieces()
    touches = touches_of(block, motion, contacts, c, s, tensile_strength)
    pointed = route in ("springs", "kelvin-springs")
    if pointed:
        pieces.points += [(on_outline(blocks, touch), np.array(touch.force)) for touch in touches]
    faces, lone = ({}, []) if pointed else faces_and_lone(blocks, vertices, touches)
    for (edge, _), touches in faces.items():
        based = route == "bases" and keep_straight is not None and bool(keep_straight[touches[0].against])
        add_face(pieces, blocks, blocks.sides[edge], touches, based)
    for touch in lone:
        add_lone(pieces, blocks, touch, touch.force)
    turn_back = np.array([[c, s], [-s, c]])
    for row in edge_forces:
        add_edge_piece(pieces, blocks, vertices, row, turn_back)
    for row in point_forces:
        add_point_load(pieces, blocks, block, row["at"].copy(), turn_back @ row["force"])
    add_couple(pieces, blocks, block)
    segments, tractions = pieces.arrays()
    inside = pieces.inside()
    load = _balanced(
        block, blocks, motion, segments, tractions, inside, density, gravity, acceleration, spin, turn_back, reaction,
        pieces.stretch(), route == "kelvin-springs", overstress,
    )  # fmt: skip
    return replace(load, bases=tuple((np.array(rows), np.array(way)) for rows, way in pieces.bases))


def _balanced(
    block, blocks, motion, segments, tractions, inside, density, gravity, acceleration, spin, turn_back, reaction,
    left_out, kelvin, overstress,
) -> BoundaryLoad:  # fmt: skip
    area, centroid, second = blocks.area_moments(block)
    (c, s), _ = turn_back.tolist()
    bxx = bxy = byy = 0.0  # the body force's gradient, still symmetric
    carried, turned = np.zeros(2), 0.0
    if density:
        g = np.zeros(2) if gravity is None else np.asarray(gravity, dtype=float)
        ax, ay, angular, exx, eyy, shear = (0.0,) * 6 if acceleration is None else acceleration.tolist()
        bxx = density * (spin**2 - c * c * exx - s * s * eyy - s * c * shear)
        byy = density * (spin**2 - s * s * exx - c * c * eyy + s * c * shear)
        bxy = -density * (s * c * (eyy - exx) + 0.5 * (c * c - s * s) * shear)
        carried, turned = turn_back @ (density * (g - (ax, ay))), density * angular
    held = 0.0
    if reaction is not None:
        carried, held = carried + turn_back @ reaction[:2] / area, float(reaction[2])
    force, _, size = resultants(segments, tractions, centroid)
    spread = first_moments(segments, tractions, centroid)
    if inside is not None:
        force = force + inside[1].sum(axis=0)
        spread = spread + (inside[0] - centroid).T @ inside[1]
        size += float(np.abs(inside[1]).sum())
    symmetric = np.array([[bxx, bxy], [bxy, byy]])
    whole = _with_torque(symmetric, spread, second)
    gradient, remote = whole, None
    if overstress is not None:
        gradient = _with_torque(density * spin**2 * np.eye(2), spread, second)
        even = second @ (whole - gradient).T / area
        remote = np.array([even[0, 0], even[1, 1], 0.5 * (even[0, 1] + even[1, 0])])
        remote -= stress_rotation(-math.atan2(s, c)) @ overstress
    body_force = -force / area
    imbalance = 0.0
    if size > 0:
        # The solver's forces balance on the block as it is strained, where their arms and its inertia are others by as
        # much.
        strain = turn_back @ motion.gradient[block]
        strained = strain @ second @ strain.T
        missed = (
            _turning(strain @ (spread + left_out) + strained @ symmetric) + held - turned * float(np.trace(strained))
        )
        imbalance = (math.hypot(*(body_force - carried)) * area + abs(missed) / math.sqrt(area)) / size
    points, forces = inside or (None, None)
    return BoundaryLoad(segments, tractions, body_force, gradient, centroid, imbalance, remote, points, forces, kelvin)


def _with_torque(symmetric: np.ndarray, spread: np.ndarray, second: np.ndarray) -> np.ndarray:
    """The gradient of a body force, ``symmetric`` but for the angular inertia that leaves no moment beside forces of
    ``spread``."""
    torque = _turning(spread + second @ symmetric) / float(np.trace(second))
    return symmetric + np.array([[0.0, torque], [-torque, 0.0]])


def _turning(spread: np.ndarray) -> float:
    """The moment of forces f at arms r, of which ``spread`` is Σ r ⊗ f."""
    return float(spread[0, 1] - spread[1, 0])
