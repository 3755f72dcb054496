"""The work that forces at rest do in opening the cracks of a body: what blocks of one strain cannot know of it.

Tractions t displace the outline of a cracked body by u_c more than that of a whole one. By reciprocity (Betti) their
work on it is ∫ t·u_c ds = ∫ t₀·[u] ds, with t₀ what they bring to closed crack faces, whatever way they are spread; and
½ of it is what a body with open cracks stores by them (Clapeyron). The mean stress does A σ : ε_c of it. The rest is the
work of forces that bend, shear or press the block unevenly.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .added_compliance import stress_rotation

if TYPE_CHECKING:
    from ...ddm import Solution


def work_on_cracks(before: Solution, after: Solution) -> float:
    """J/m done by the mean of the loads of two solutions on what the cracks have opened and slipped from one to the
    other: ½ (t_a + t_b)·(u_b − u_a). Cracks may have grown between them; each load then is laid on each geometry."""
    load_a, load_b = before.closed_traction, after.closed_traction
    if before.body.crack_system is after.body.crack_system:
        a_on_b, b_on_a = load_a, load_b
    else:
        a_on_b = after.body.closed_traction(before.load) if after.jumps.size else load_b
        b_on_a = before.body.closed_traction(after.load) if before.jumps.size else load_a
    return 0.5 * (after.work_at_cracks(a_on_b + load_b) - before.work_at_cracks(load_a + b_on_a))


def first_work_on_cracks(stress: np.ndarray, rotation: float, after: Solution) -> float:
    """The same of cracks that had not been there, in a block whose mean ``stress`` (3,), Pa, current axes, turned by
    ``rotation`` rad, was all there was."""
    load = after.closed_traction
    if np.any(stress):
        from ... import ddm

        load = load + after.body.closed_traction(ddm.BodyLoad(remote_stress=stress_rotation(-rotation) @ stress))
    return 0.5 * after.work_at_cracks(load)
