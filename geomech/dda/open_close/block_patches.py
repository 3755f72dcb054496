"""Contact states of a few blocks among many: open–close iteration on a patch, with prescribed motion of the blocks
around it.

Where Newton's method on the states of all contacts does not converge, the inconsistent contacts are mostly in a few
places, such as a block wedged between its neighbours. Their states are found on the surrounding blocks alone, in small
systems of negligible cost, and the iteration on all contacts continues from there (a nonlinear Schwarz method on
selected patches; Cai & Keyes 2002).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...model import ContactSolver
from ..joint_laws.coulomb_return import ContactStates, moved
from ..linear_solver import assembly
from .equations import Answer, Equations, Unsettled
from .settled_states import Settled


def settled_in_patch(
    equations: Equations, which: np.ndarray, states: ContactStates, answer: Answer, settle: Callable[[Equations], Settled],
    solver: ContactSolver,
) -> tuple[ContactStates | None, float]:  # fmt: skip
    """``states`` in which those of the contacts around ``which`` (n,) bool are replaced by the result of ``settle``,
    with all other blocks moving as in ``answer``; None if it finds none. Also returns the cost in solutions of the
    whole system."""
    pattern, found = equations.pattern, equations.found
    order, n = pattern.order, pattern.n
    if pattern.links is not None or equations.curved is not None:
        return None, 0.0
    ends = order[found.block], order[found.other]
    inside, some, rows = np.zeros(n, bool), which, None
    for _ in range(solver.patch_rings + 1):
        wider = np.append(inside, False)
        for end in ends:
            wider[end[some]] = True
        wider[-1] = False
        if wider.sum() > min(solver.patch_share * n, solver.patch_blocks):
            break
        inside, some = wider[:-1], wider[ends[0]] | wider[ends[1]]
        rows = np.flatnonzero(some)
    if rows is None or not inside.any():
        return None, 0.0
    number = np.append(np.where(inside, np.cumsum(inside) - 1, -1), -1)
    within = number[order]
    around = np.where(within >= 0, -1, order)
    part = found.part(rows)
    vectors = np.ascontiguousarray(equations.vectors[rows])
    springs = answer.springs.of(rows)
    apart, along = moved(answer.unknowns, part.block, part.other, around, vectors).T
    bonded = states.bonded[rows]
    part = replace(
        part, shear=part.shear - springs.shear * along,
        tried=(states.state[rows], states.direction[rows], bonded),
    )  # fmt: skip
    # Bonds do not break here, only when everything else is consistent.
    holds = np.where(bonded > 0, np.inf, 0.0)
    springs = springs._replace(cohesion=springs.cohesion + holds, tension=springs.tension + holds)
    gap = answer.gap[rows] + apart - springs.lift * along
    if pattern.solver is None or inside.sum() <= assembly.DENSE_BLOCKS:
        own = assembly.dense_pattern(within, part.block, part.other)
    else:
        points = np.zeros((len(order), 2))
        points[order >= 0] = pattern.solver.points[order[order >= 0]]
        own = assembly.sparse_pattern(within, part.block, part.other, points)
        if own.solver is not None:
            own.solver.work = pattern.solver.work
    try:
        settled = settle(
            Equations(
                own, equations.matrix[inside], equations.right[inside], part, vectors, springs, gap,
                equations.slack[rows], None, equations.statics,
                None if equations.expected is None else _of(answer.unknowns, inside),
            )
        )  # fmt: skip
    except Unsettled:
        return None, 0.0
    state, direction = states.state.copy(), states.direction.copy()
    state[rows], direction[rows] = settled.state, settled.direction
    return ContactStates(state, direction, states.bonded), settled.iterations * float(inside.sum()) / n


def _of(unknowns: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """(6 k,) unknowns of the blocks ``inside`` (n,) bool, from the ``unknowns`` (6 n,) of all."""
    return unknowns.reshape(-1, 6)[inside].ravel()
