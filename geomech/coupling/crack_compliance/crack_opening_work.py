"""Work of static loads in opening the cracks of a body, beyond the work of its mean stress.

Tractions t displace the outline of a cracked body by u_c more than that of the intact one. By Betti's theorem their
work on u_c is ∫ t·u_c ds = ∫ t₀·[u] ds, where t₀ are the tractions that the same loads would cause on closed crack
faces; open cracks store half of it (Clapeyron). The mean stress does the part A σ : ε_c. The rest is the work of loads
that bend, shear or press the block unevenly, on which a block of uniform strain does no work.

If cracks grow while loads change, the energy released along the straight line from the initial to the final state is ½
∫ (τ_a·[u_b] − τ_b·[u_a]) ds with τ = t₀ − t, t the traction on crack faces and each load on each geometry (the area
between the two loading lines; Betti). It is zero where no crack has grown. If a step contains several increments, each
at its own loads, the release along these is the sum over the increments, which differs from that of the straight line.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .added_compliance import stress_rotation

if TYPE_CHECKING:
    from ...ddm import Solution
    from .mean_stress_response import ByMeanStress


def work_on_cracks(before: Solution, after: Solution) -> float:
    """Work on crack opening and slip between two solutions, J/m: ½ (t_a + t_b)·(u_b − u_a). Where cracks have grown in
    between, each load is applied to each geometry."""
    load_a, load_b = before.closed_traction, after.closed_traction
    if before.body.crack_system is after.body.crack_system:
        a_on_b, b_on_a = load_a, load_b
    else:
        a_on_b = after.body.closed_traction(before.load) if after.jumps.size else load_b
        b_on_a = before.body.closed_traction(after.load) if before.jumps.size else load_a
    return 0.5 * (after.work_at_cracks(a_on_b + load_b) - before.work_at_cracks(load_a + b_on_a))


def first_work_on_cracks(stress: np.ndarray, rotation: float, after: Solution) -> float:
    """The same for cracks cut into a block whose stress was uniform before, ``stress`` (3,), Pa, current axes; the
    block is rotated by ``rotation`` rad."""
    load = after.closed_traction
    if np.any(stress):
        load = load + after.body.mean_stress_traction @ (stress_rotation(-rotation) @ stress)
    return 0.5 * after.work_at_cracks(load)


@dataclass(frozen=True, eq=False)
class Loaded:
    """A block with the ``solution`` of its cracks. If it responds to its mean stress alone: ``mean``, that stress in
    its own axes, Pa, and its `ByMeanStress.limit`, and the ``strain`` of its cracks under both. A block of higher order
    has more components than three (`block_stress_field`)."""

    solution: Solution
    mean: tuple[np.ndarray, np.ndarray] | None = None
    strain: np.ndarray | None = None

    @classmethod
    def of(cls, block: int, solution: Solution, by_mean_stress: ByMeanStress) -> Loaded:
        if block not in by_mean_stress:
            return cls(solution)
        return cls(solution, by_mean_stress.stress[block], by_mean_stress.crack_strain(block, solution))

    @property
    def limited(self) -> bool:
        """Whether the softness of the block is limited."""
        return self.mean is not None and not np.array_equal(self.mean[1], np.eye(len(self.mean[1])))

    def same_geometry(self, other: Loaded) -> bool:
        """Whether no crack has grown between the two."""
        return self.solution.body.crack_system is other.solution.body.crack_system

    def responds_as(self, other: Loaded) -> bool:
        """Whether both respond to their mean stress alone, or both to all forces."""
        return (self.mean is None) == (other.mean is None)


def release_between(before: Loaded, after: Loaded) -> float:
    """Energy released by growth on the straight line between two states of a block, J/m, under the loads of the crack
    solver: the reduced loads if its mean stress is limited."""
    a, b = before.solution, after.solution
    if before.mean is None or after.mean is None:
        forward = b.work_at_cracks(b.body.closed_traction(a.load)) if b.jumps.size else 0.0
        back = a.work_at_cracks(a.body.closed_traction(b.load)) if a.jumps.size else 0.0
    else:
        (stress_a, limit_a), (stress_b, limit_b) = before.mean, after.mean
        forward = float(limit_a @ stress_a @ after.strain) * b.body.area
        back = float(limit_b @ stress_b @ before.strain) * a.body.area
    return 0.5 * (forward - back - _at_faces(a, b) + _at_faces(b, a))


def release_of_mean_stress(before: Loaded, after: Loaded) -> float:
    """`release_between` for a block with mean-stress response, including the effect of a change of its softness limit."""
    if before.mean is None or after.mean is None:
        raise ValueError("the block does not respond to its mean stress alone")
    (stress_a, limit_a), (stress_b, limit_b) = before.mean, after.mean
    a, b = before.solution, after.solution
    blocks = float(stress_a @ limit_b.T @ after.strain - stress_b @ limit_a.T @ before.strain) * b.body.area
    return 0.5 * (blocks - _at_faces(a, b) + _at_faces(b, a))


def _at_faces(of: Solution, on: Solution) -> float:
    """J/m, ∫ t·[u] ds of the traction on faces ``of`` one solution on the jumps of the other."""
    from ...ddm.crack_contact.face_laws import traction_carried_over

    traction = of.face_traction
    if not traction.any() or not on.jumps.size:
        return 0.0
    return on.work_at_cracks(traction_carried_over(traction, of.body.faces, on.body.faces))
