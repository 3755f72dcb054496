"""Upper bound of the factor of safety: the largest F at which any contact forces at all can balance the loads.

Forces N and S of the contacts are statically admissible at the factor F if every block is in equilibrium and

    N ≥ 0,    |S| ≤ (c ℓ + N tan φ)/F.

Whether such forces exist is a linear programme (Livesley 1978, Int. J. Numer. Methods Eng. 12, 1853-1871). No
equilibrium exists above the largest F with admissible forces (static theorem). Friction that dilates by less than its
angle may fail below it (Drescher & Detournay 1993, Géotechnique 43, 443-456): blocks can be wedged against one another
in many ways, and the deformation selects one. The search follows the deformation, so that its factor may lie below this
bound; the difference shows how much depends on the way in which the blocks are wedged.

The loads are those that the contact forces of an equilibrium balance, whatever they come from: weight, water, anchors.
Joints with tensile strength are left out: a face that is bent holds less than the sum of what its ends would hold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...model import JointLaw, State
from ..kinematics.simplex_integration import block_moments
from ..results import contact_resultants
from ..system import BlockSystem

#: The bound is sought between the factor of an equilibrium and this many times that factor.
_FARTHEST = 4.0
#: Loads are balanced to this part of the largest load on a block.
_BALANCED = 1e-6


@dataclass(frozen=True, eq=False)
class AdmissibleForces:
    """The linear programme of the contacts (n,) of blocks at rest.

    matrix    (3 m, 2 n)  sparse: forces x, y and moments on the m free blocks, by N and S of each contact
    loads     (3 m,)      forces and moments that balance the loads, over the largest of them
    friction  (n,)        tan φ
    cohesion  (n,)        c ℓ of the contact's part of its face, in the unit of the loads; 0 once it is lost
    reduced   (n,) bool   whether the strength of the contact is divided by the factor
    """

    matrix: object
    loads: np.ndarray
    friction: np.ndarray
    cohesion: np.ndarray
    reduced: np.ndarray

    @classmethod
    def of(
        cls, system: BlockSystem, state: State, rest: State, joints: Sequence[JointLaw], chosen: Sequence[str]
    ) -> AdmissibleForces | None:
        """Of the blocks of ``system``, in equilibrium in ``state``, on all contacts that touch there or at ``rest``; ``joints`` with their whole strength, of which that of the laws ``chosen`` is divided. None where
        the programme does not hold: rough joints, those that soften, and those with tensile strength."""
        if any(_varies(law) or law.tensile_strength > 0.0 for law in joints):
            return None
        from scipy import sparse

        blocks = system.blocks
        centre = block_moments(state.vertices, blocks.next_vertex, blocks.vertex_start)[:, 1:3]
        near, drawn = system.contacts_near(state), system.contacts_near(rest)
        n_vertices = len(blocks.vertices)
        drawn_on = (drawn.vertex * n_vertices + drawn.edge)[drawn.gap_before <= drawn.precision]
        touches = near.gap_before <= near.precision
        rows = np.flatnonzero(touches | np.isin(near.vertex * n_vertices + near.edge, drawn_on))
        free = ~system.fixed if blocks.constrained is None else ~(system.fixed | blocks.constrained.any(axis=1))
        number = np.where(free, np.cumsum(free) - 1, -1)
        loads = contact_resultants(state.contacts, blocks.n_blocks, centre)[free]
        unit = float(np.abs(loads).max(initial=0.0))
        if not (len(rows) and unit > 0.0):
            return None
        normal, at = near.geometry[rows, 1:3], near.geometry[rows, 5:7]
        along = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
        entries = []
        for of, sign in ((near.block[rows], 1.0), (near.other[rows], -1.0)):
            own = np.flatnonzero(number[of] >= 0)
            arm = (at - centre[of])[own]
            for k, way in enumerate((normal[own], along[own])):
                moment = arm[:, 0] * way[:, 1] - arm[:, 1] * way[:, 0]
                for axis, part in enumerate((way[:, 0], way[:, 1], moment)):
                    entries.append((3 * number[of[own]] + axis, own + k * len(rows), sign * part))
        row, column, value = (np.concatenate(parts) for parts in zip(*entries, strict=True))
        matrix = sparse.csc_matrix((value, (row, column)), (3 * int(free.sum()), 2 * len(rows)))
        law = near.law[rows]
        # Faces that have parted by a hair could hold their cohesion as well.
        length = near.geometry[rows, 4] * ((near.bonded > 0) | touches)[rows]

        def of_laws(name: str) -> np.ndarray:
            return np.array([getattr(each, name) for each in joints], float)[law]

        return cls(
            matrix, loads.ravel() / unit, of_laws("friction"), of_laws("cohesion") * length / unit,
            np.array([each.name in chosen for each in joints])[law],
        )  # fmt: skip

    def balance(self, factor: float) -> bool:
        """Whether admissible forces exist at the ``factor``: pushes along both edges of the friction cone of each
        contact, and what cohesion holds of shear."""
        from scipy import optimize, sparse

        share = np.where(self.reduced, 1.0 / factor, 1.0)
        n = len(share)
        push, shear = self.matrix[:, :n], self.matrix[:, n:]
        friction = sparse.diags(self.friction * share)
        bonded = np.flatnonzero(self.cohesion > 0.0)
        matrix = sparse.hstack([push + shear @ friction, push - shear @ friction, shear[:, bonded]], format="csc")
        hold = (self.cohesion * share)[bonded]
        low, high = np.append(np.zeros(2 * n), -hold), np.append(np.full(2 * n, np.inf), hold)
        found = optimize.linprog(
            np.zeros(len(low)), A_eq=matrix, b_eq=self.loads, bounds=np.stack([low, high], axis=1), method="highs",
            options={"primal_feasibility_tolerance": _BALANCED},
        )  # fmt: skip
        return found.status == 0

    def largest_factor(self, lower: float, tolerance: float) -> float | None:
        """The largest factor with admissible forces, to the relative ``tolerance``, where it is beyond the factor
        ``lower`` of an equilibrium by more than that; inf where they exist at four times that factor. None if it is not
        beyond."""
        high = lower * (1.0 + tolerance)
        if not self.balance(high):
            return None
        step = tolerance
        while self.balance(high):
            lower, step = high, 2.0 * step
            high = lower * (1.0 + step)
            if step > _FARTHEST:
                return float("inf")
        while high > lower * (1.0 + 0.1 * tolerance):
            middle = 0.5 * (lower + high)
            lower, high = (middle, high) if self.balance(middle) else (lower, middle)
        return 0.5 * (lower + high)


def _varies(law: JointLaw) -> bool:
    return (
        law.roughness is not None
        or law.residual_friction_angle is not None
        or law.softening_slip > 0
        or law.residual_cohesion not in (0.0, law.cohesion)
    )
