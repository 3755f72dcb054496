"""Work of static loads in opening the cracks of a body, beyond the work of its mean stress.

Tractions t displace the outline of a cracked body by u_c more than that of the intact one. By Betti's theorem their
work on it is ∫ t·u_c ds = ∫ t₀·[u] ds, where t₀ are the tractions that the same loads would cause on closed crack
faces; half of it is stored by open cracks (Clapeyron). The mean stress does the part A σ : ε_c. The rest is the work of
loads that bend, shear or press the block unevenly, which a block of uniform strain does not know.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .added_compliance import stress_rotation

if TYPE_CHECKING:
    from ...ddm import Solution


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
    """The same for cracks cut into a block whose only stress was the mean ``stress`` (3,), Pa, current axes; the block
    is rotated by ``rotation`` rad."""
    load = after.closed_traction
    if np.any(stress):
        from ... import ddm

        load = load + after.body.closed_traction(ddm.BodyLoad(remote_stress=stress_rotation(-rotation) @ stress))
    return 0.5 * after.work_at_cracks(load)
