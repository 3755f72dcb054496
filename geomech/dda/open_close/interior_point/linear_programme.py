"""Linear programmes with sparse equations and simple bounds, by a primal-dual interior-point method.

    min cᵀ x    subject to    A x = b,    0 ≤ x ≤ u

With the multipliers y of the equations, z of x ≥ 0 and v of the slack w = u − x, Newton's method for

    A x = b,    x + w = u,    Aᵀ y + z − v = c,    x z = μ,    w v = μ

leads to normal equations A Θ Aᵀ Δy = r with Θ = (z/x + v/w)⁻¹, one factorisation for a predictor (μ = 0) and a corrector step
(Mehrotra 1992, SIAM J. Optim. 2, 575-601; Wright 1997, Primal-Dual Interior-Point Methods, chapter 10). The equations of blocks
make A Θ Aᵀ as sparse as the contacts between them: a programme of 3 400 blocks takes seconds, where a general solver, which
does not factorise it, takes a minute.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

import numpy as np

log = logging.getLogger(__name__)

#: Relative gap and residuals of a solution, and the largest number of iterations; programmes of contact forces take 20 to 40.
_SOLVED, _BALANCED, _ITERATIONS = 1e-8, 1e-7, 100
#: Relative increase of the diagonal of the normal equations, which become singular to round-off near a degenerate optimum.
_FIRM = 1e-13
#: A gap so small that the normal equations are singular.
_SINGULAR = 1e-12
#: Part of the way to the boundary that a step goes.
_SHORT_OF = 0.9995


class Unsolved(RuntimeError):
    """The linear programme could not be solved."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """The smallest ``cost`` with the ``unknowns`` (n,); derivatives of the cost with respect to b, ``of_equations`` (m,), and to
    u, ``of_bounds`` (n,), and the multipliers of x ≥ 0, ``of_signs`` (n,)."""

    cost: float
    unknowns: np.ndarray
    of_equations: np.ndarray
    of_bounds: np.ndarray
    of_signs: np.ndarray


def smallest(cost: np.ndarray, matrix: Any, right: np.ndarray, most: np.ndarray) -> Optimum:
    """The optimum for c ``cost`` (n,), A sparse ``matrix`` (m, n), b ``right`` (m,) and u ``most`` (n,), inf where there is no
    bound. A programme so degenerate that its normal equations are singular is solved by `scipy.optimize.linprog`. Raises `Unsolved`."""
    try:
        return _by_interior_points(cost, matrix, right, most)
    except Unsolved as failure:
        log.debug("%s", failure)
    from scipy import optimize

    bounds = np.stack([np.zeros(len(cost)), most], axis=1)
    found = optimize.linprog(cost, A_eq=matrix, b_eq=right, bounds=bounds, method="highs-ipm")
    if found.status != 0:
        raise Unsolved(found.message)
    return Optimum(float(found.fun), found.x, found.eqlin.marginals, found.upper.marginals, found.lower.marginals)


def _by_interior_points(cost: np.ndarray, matrix: Any, right: np.ndarray, most: np.ndarray) -> Optimum:
    """`smallest` by this method."""
    a, at = matrix.tocsr(), matrix.T.tocsr()
    n, bounded = len(cost), np.isfinite(most)
    top = np.where(bounded, most, 1.0)
    # Starting point: all unknowns and multipliers at the size of the data.
    x = np.where(bounded, 0.5 * top, max(1.0, float(np.abs(right).max(initial=0.0))))
    w = np.where(bounded, top - x, 1.0)
    y, z, v = np.zeros(len(right)), np.ones(n), np.where(bounded, 1.0, 0.0)
    sizes = 1.0 + float(np.linalg.norm(right)), 1.0 + float(np.linalg.norm(cost))
    pairs = n + int(bounded.sum())
    for _ in range(_ITERATIONS):
        off, slack, dual = right - a @ x, np.where(bounded, top - x - w, 0.0), cost - at @ y - z + v
        gap = float(x @ z + (w * v)[bounded].sum())
        value = float(cost @ x)
        if (
            np.linalg.norm(off) <= _BALANCED * sizes[0]
            and np.linalg.norm(dual) <= _BALANCED * sizes[1]
            and gap <= _SOLVED * (1.0 + abs(value))
        ):
            return Optimum(value, x, y, -v, z)
        if gap <= _SINGULAR or not np.isfinite(gap):
            break
        newton = _Newton(a, at, (x, w, z, v), (off, slack, dual), bounded)
        dx, dw, _, dz, dv = newton.step(-x * z, np.where(bounded, -w * v, 0.0))
        primal, at_dual = _longest((x, dx), (w, dw)), _longest((z, dz), (v, dv))
        after = float((x + primal * dx) @ (z + at_dual * dz))
        after += float(((w + primal * dw) * (v + at_dual * dv))[bounded].sum())
        aim = (after / gap) ** 3 * gap / pairs
        dx, dw, dy, dz, dv = newton.step(aim - x * z - dx * dz, np.where(bounded, aim - w * v - dw * dv, 0.0))
        primal = min(1.0, _SHORT_OF * _longest((x, dx), (w, dw)))
        at_dual = min(1.0, _SHORT_OF * _longest((z, dz), (v, dv)))
        x, w = x + primal * dx, w + primal * dw
        y, z, v = y + at_dual * dy, z + at_dual * dz, v + at_dual * dv
    raise Unsolved("the interior-point method did not solve the linear programme")


class _Newton:
    """Newton's steps from one point (x, w, z, v) with the residuals (A x, x + w, dual). Raises `Unsolved`."""

    def __init__(self, a: Any, at: Any, point: tuple, residuals: tuple, bounded: np.ndarray) -> None:
        from scipy import sparse
        from scipy.sparse.linalg import splu

        self._a, self._at, self._point, self._residuals, self._bounded = a, at, point, residuals, bounded
        x, w, z, v = point
        self._theta = 1.0 / (z / x + v / w)
        self._normal = a @ sparse.diags(self._theta) @ at
        firm = (self._normal + _FIRM * sparse.diags(self._normal.diagonal())).tocsc()
        try:
            self._factor = splu(
                firm, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
            )
        except RuntimeError as failure:
            raise Unsolved(f"the normal equations are singular: {failure}") from failure

    def step(self, xz: np.ndarray, wv: np.ndarray) -> tuple[np.ndarray, ...]:
        """The steps of x, w, y, z and v that change the products x z by ``xz`` and w v by ``wv`` (n,), to first order."""
        (x, w, z, v), (off, slack, dual), bounded = self._point, self._residuals, self._bounded
        rest = dual - xz / x + np.where(bounded, (wv - v * slack) / w, 0.0)
        missing = off + self._a @ (self._theta * rest)
        dy = self._factor.solve(missing)
        dy += self._factor.solve(missing - self._normal @ dy)
        dx = self._theta * (self._at @ dy - rest)
        dw = np.where(bounded, slack - dx, 0.0)
        return dx, dw, dy, (xz - z * dx) / x, np.where(bounded, (wv - v * dw) / w, 0.0)


def _longest(*pairs: tuple[np.ndarray, np.ndarray]) -> float:
    """The longest step ≤ 1/_SHORT_OF in which no value becomes negative; ``pairs`` of values and their steps (n,)."""
    ratios = [float((value[falls] / -step[falls]).min()) for value, step in pairs if (falls := step < 0.0).any()]
    return min([1.0 / _SHORT_OF, *ratios])
