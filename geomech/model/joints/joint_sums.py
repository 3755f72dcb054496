"""Sums of contacts by joint (forces, opening, slip, mobilised strength), and reactions of supports."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..blocks.block_arrays import Blocks
from ..state import OPEN, SLIP, STICK
from .joint_law import JointLaw

#: One row per joint.
JOINT_SUM = np.dtype(
    [
        ("contacts", np.int64),
        ("length", np.float64),  # m, sum of tributary lengths of faces that touch or are near
        ("open_length", np.float64),  # m of it
        ("sliding_length", np.float64),
        ("mean_opening", np.float64),  # m, mean over the length; closed parts count as 0
        ("max_opening", np.float64),
        ("max_penetration", np.float64),
        ("mean_slip", np.float64),  # m, mean of |slip| over the length
        ("max_slip", np.float64),
        ("normal_force", np.float64),  # N/m, sum, positive in compression
        ("shear_force", np.float64),  # N/m, sum of sizes
        ("mobilised", np.float64),  # Σ|S| over the joint's shear strength; 0 where it carries nothing
        ("bonded_length", np.float64),  # m with intact cohesion and tensile strength
    ]
)


def joint_names(blocks: Blocks, contacts: np.ndarray, joints: Sequence[JointLaw]) -> np.ndarray:
    """(n_contacts,) str: name of the joint of every contact.

    The name of the touched edge, else of an edge at the vertex, else of the joint law ("frictionless" without laws)."""
    joints = joints or (JointLaw("frictionless"),)
    edge = np.asarray(blocks.edge_name)
    name = edge[contacts["edge"]]
    for vertex_edge_name in (edge[contacts["vertex"]], edge[blocks.previous_vertex[contacts["vertex"]]]):
        name = np.where(name > 0, name, vertex_edge_name)
    by_law = np.array([law.name for law in joints], dtype=object)
    return np.where(name > 0, np.array(blocks.edge_names, dtype=object)[name], by_law[contacts["law"]])


def joint_sums(blocks: Blocks, contacts: np.ndarray, joints: Sequence[JointLaw]) -> dict[str, np.ndarray]:
    """Name of the joint (`joint_names`) → its JOINT_SUM row; ``contacts`` CONTACT rows of a state."""
    if len(contacts) == 0:
        return {}
    joints = joints or (JointLaw("frictionless"),)
    names, joint = np.unique(joint_names(blocks, contacts, joints).astype(str), return_inverse=True)
    out = np.zeros(len(names), JOINT_SUM)

    def total(values: np.ndarray) -> np.ndarray:
        return np.bincount(joint, values, len(names))

    def largest(values: np.ndarray) -> np.ndarray:
        most = np.zeros(len(names))
        np.maximum.at(most, joint, values)
        return most

    length, state, gap, slip = contacts["length"], contacts["state"], contacts["gap"], np.abs(contacts["slip"])
    is_open = state == OPEN
    apart = np.where(is_open, np.maximum(gap, 0.0), 0.0)
    whole = total(length)
    over = np.where(whole > 0, whole, 1.0)
    out["contacts"] = np.bincount(joint, minlength=len(names))
    out["length"], out["open_length"] = whole, total(length * is_open)
    out["sliding_length"] = total(length * (state == SLIP))
    out["mean_opening"], out["max_opening"] = total(length * apart) / over, largest(apart * (length > 0))
    out["max_penetration"] = largest(np.where(is_open, 0.0, -gap))
    out["mean_slip"], out["max_slip"] = total(length * slip) / over, largest(slip)
    out["normal_force"] = total(contacts["normal_force"])
    out["shear_force"] = total(np.abs(contacts["shear_force"]))
    friction = np.array([law.friction for law in joints])[contacts["law"]]
    cohesion = np.array([law.cohesion for law in joints])[contacts["law"]]
    strength = total(
        (friction * np.maximum(contacts["normal_force"], 0.0) + cohesion * length * (contacts["bonded"] > 0)) * ~is_open
    )
    out["mobilised"] = np.where(strength > 0, out["shear_force"] / np.where(strength > 0, strength, 1.0), 0.0)
    out["bonded_length"] = total(length * (contacts["bonded"] > 0) * (state >= STICK))
    return dict(zip(names.tolist(), out, strict=True))


def reactions(blocks: Blocks, contacts: np.ndarray) -> dict[int, np.ndarray]:
    """Resultant of all contacts on every fixed or guided block: block → (force x, force y, moment).

    N and N m per metre of thickness; the moment is about the mean of the block's reference vertices. The support's
    reaction is the opposite."""
    supports = np.asarray(blocks.fixed, dtype=bool).copy()
    if blocks.constrained is not None:
        supports |= blocks.constrained.any(axis=1)
    out = {int(b): np.zeros(3) for b in np.flatnonzero(supports)}
    about = blocks.mean_vertices(blocks.vertices)
    normal = contacts["normal"]
    along = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    force = contacts["normal_force"][:, None] * normal + contacts["shear_force"][:, None] * along
    for side, sign in (("block", 1.0), ("other", -1.0)):
        for k in np.flatnonzero(supports[contacts[side]] & (contacts["state"] != OPEN)):
            block = int(contacts[side][k])
            (x, y), (fx, fy) = contacts["point"][k] - about[block], sign * force[k]
            out[block] += [fx, fy, x * fy - y * fx]
    return out
