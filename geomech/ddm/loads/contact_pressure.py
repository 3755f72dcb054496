"""Contact pressures of given force and moment on rigid bases, without tension and penetration.

With nodal pressures p, their compliance M, the free shape −q of the face and the motion z of its base, find

    p ≥ 0,    w = M p − q + Rᵀ z ≥ 0,    p · w = 0,    R p = r,

R p being force and moment on each base. With friction M is not symmetric, but positive: the solution is unique.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

#: Tension and penetration below this part of the largest values are round-off.
_NOTHING = 1e-10
#: Newton's method has failed after this many changes of the contact area without fewer wrong nodes than before.
_PATIENCE = 5
#: Elements of a tableau below this part of the largest in their column are round-off, and no pivots.
_NO_PIVOT = 1e-11


@dataclass(frozen=True, eq=False)
class Resultants:
    """``matrix`` (2 n_bases, n): force, and moment about its start, of each base by unit pressures at the n nodes;
    ``right`` (2 n_bases,): those required. ``first`` (n_bases + 1,): first node of each base, and n."""

    matrix: np.ndarray
    right: np.ndarray
    first: np.ndarray

    @property
    def nodes(self) -> list[slice]:
        """Those of each base."""
        return [slice(a, b) for a, b in pairwise(self.first.tolist())]

    def bracketing(self) -> list[int]:
        """Two nodes of each base whose pressures alone have the resultants required of it, neither in tension unless
        the resultant is beyond the first or last node."""
        found = []
        for k, own in enumerate(self.nodes):
            places = self.matrix[2 * k + 1, own] / self.matrix[2 * k, own]
            at = int(np.searchsorted(places, self.right[2 * k + 1] / self.right[2 * k]))
            at = own.start + min(max(at, 1), len(places) - 1)
            found += [at - 1, at]
        return found


def positive(stiff: np.ndarray, resultants: np.ndarray, least: float) -> np.ndarray:
    """The compliance ``stiff`` (n, n), m²/Pa, with its symmetric part positive definite for pressures without
    ``resultants`` (2 n_bases, n): its eigenvalues relative to squared widths of the nodes are raised to ``least``, 1/Pa."""
    width = resultants[::2].max(axis=0)
    free = np.linalg.qr((resultants / width).T, mode="complete")[0][:, len(resultants) :]
    scaled = free.T @ (stiff / np.outer(width, width)) @ free
    value, vector = np.linalg.eigh(0.5 * (scaled + scaled.T))
    modes = width[:, None] * (free @ vector)
    return stiff + (modes * np.maximum(least - value, 0.0)) @ modes.T


def pressures_on_bases(stiff: np.ndarray, still: np.ndarray, of: Resultants) -> np.ndarray | None:
    """(n,) pressures p by the compliance ``stiff`` M and the shape ``still`` q; None if none have the resultants.

    Newton's method on the contact area; if it cycles, the area is found by complementary pivoting.
    """
    size = np.abs(still).max() + np.abs(stiff).max() * np.abs(of.right).max() / np.abs(of.matrix).max()
    presses, fewest, patience = np.ones(len(still), bool), len(still) + 1, _PATIENCE
    while patience > 0 and all(presses[own].sum() >= 2 for own in of.nodes):
        try:
            pressure, gap = _balanced(stiff, still, of, presses)
        except np.linalg.LinAlgError:
            break
        wrong = presses & (pressure < -_NOTHING * np.abs(pressure).max()) | ~presses & (gap < -_NOTHING * size)
        if not wrong.any():
            return np.maximum(pressure, 0.0)
        patience = _PATIENCE if wrong.sum() < fewest else patience - 1
        fewest = min(fewest, int(wrong.sum()))
        presses ^= wrong
    found = _pivoted(stiff, still, of)
    return None if found is None else np.maximum(_balanced(stiff, still, of, found)[0], 0.0)


def _balanced(
    stiff: np.ndarray, still: np.ndarray, of: Resultants, presses: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) pressures with the resultants at the nodes that press, which have no gap, and (n,) gaps w, m²."""
    on, resultants = np.flatnonzero(presses), of.matrix
    matrix = np.zeros((len(on) + len(of.right),) * 2)
    matrix[: len(on), : len(on)] = stiff[np.ix_(on, on)]
    matrix[: len(on), len(on) :] = resultants[:, on].T
    matrix[len(on) :, : len(on)] = resultants[:, on]
    # Unknowns and equations scaled to similar magnitudes.
    scale = np.concatenate([np.full(len(on), np.sqrt(np.abs(stiff).max())), np.abs(resultants[:, on]).max(axis=1)])
    scale[len(on) :] /= scale[0] or 1.0
    x = np.linalg.solve(matrix / np.outer(scale, scale), np.concatenate([still[on], of.right]) / scale) / scale
    pressure = np.zeros(len(still))
    pressure[on] = x[: len(on)]
    return pressure, stiff @ pressure + resultants.T @ x[len(on) :] - still


def _pivoted(stiff: np.ndarray, still: np.ndarray, of: Resultants) -> np.ndarray | None:
    """(n,) nodes that press, or None without a solution.

    Two pressures of each base, p_B, follow from the others, p_B = b − T p_N, and the motion of the base from their
    gaps. The remainder is a monotone linear complementarity problem,

        (w_N, p_B) = [[H, Tᵀ], [−T, 0]] (p_N, w_B) + (h, b).
    """
    n, kept = len(still), of.bracketing()
    others = np.setdiff1d(np.arange(n), kept)
    compliance = np.abs(np.diag(stiff)).mean()
    pressure = np.abs(of.right[::2]).max() / of.matrix[::2].sum(axis=1).max()
    stiff, still = stiff / compliance, still / (compliance * pressure)
    t = np.linalg.solve(of.matrix[:, kept], of.matrix[:, others])
    b = np.linalg.solve(of.matrix[:, kept], of.right) / pressure
    change, first = np.zeros((n, len(others))), np.zeros(n)
    change[others, np.arange(len(others))], change[kept] = 1.0, -t
    first[kept] = b
    answer = complementary_basis(
        np.block([[change.T @ stiff @ change, t.T], [-t, np.zeros((len(kept),) * 2)]]),
        np.concatenate([change.T @ (stiff @ first - still), b]),
    )
    if answer is None:
        return None
    presses = np.zeros(n, bool)
    presses[others], presses[kept] = answer[: len(others)], ~answer[len(others) :]
    for own in of.nodes:
        if presses[own].sum() < 2:
            # The resultant is that of a single node.
            presses[[k for k in kept if own.start <= k < own.stop]] = True
    return presses


def complementary_basis(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray | None:
    """(n,) bool: which x are not zero in x ≥ 0, y = ``matrix`` x + ``vector`` ≥ 0, x · y = 0; for positive semidefinite
    matrices None means that there is no x with y ≥ 0.

    Complementary pivoting (Lemke 1965; Cottle, Pang & Stone 1992, §4.4)."""
    n = len(vector)
    if vector.min(initial=0.0) >= 0:
        return np.zeros(n, bool)
    # Columns: y, x, the artificial variable, the right-hand side.
    table = np.hstack([np.eye(n), -matrix, -np.ones((n, 1)), vector[:, None]])
    basis, row, enters = np.arange(n), int(np.argmin(vector)), 2 * n
    for _ in range(50 * n):
        table[row] /= table[row, enters]
        table -= np.outer(np.where(np.arange(n) == row, 0.0, table[:, enters]), table[row])
        leaves, basis[row] = basis[row], enters
        if leaves == 2 * n:
            return np.isin(np.arange(n, 2 * n), basis)
        enters = leaves + n if leaves < n else leaves - n
        column = table[:, enters]
        allowed = np.flatnonzero(column > _NO_PIVOT * np.abs(column).max())
        if not len(allowed):
            return None
        ratios = table[allowed, -1] / column[allowed]
        ties = allowed[ratios <= ratios.min() + 1e-13 * max(1.0, abs(ratios.min()))]
        artificial = ties[basis[ties] == 2 * n]
        row = int(artificial[0] if len(artificial) else ties[np.argmax(column[ties])])
    return None
