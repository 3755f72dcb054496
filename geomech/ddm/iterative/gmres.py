"""GMRES with factored patches, for crack or boundary equations that are too large to factor.

Most of a crack network's stiffness is within cracks and between neighbours. The elements are divided into patches; each
is solved exactly together with the rest of the cracks that it cuts, and only its own unknowns are kept (restricted
additive Schwarz, Cai & Sarkis 1999). The remaining error is smooth: 15 to 40 products for networks of any size. Cracks
cut by many patches also get a few coarse elements (`coarse_space`), which couple their ends.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..system.contact_rows import Rows
from ..system.dense_lu import Factor
from ..system.influence_matrix import ElementSet, influence
from .fast_multipole import Tree

#: Elements of a patch. Larger ones cost more to factor than they save in products.
PATCH = 60
#: Of the cracks that a patch cuts, elements nearer to its centre than this many of its radii join it.
REACH = 1.5
#: Relative residual of a solution. Contact distinguishes closed from open at 1e-10.
TOLERANCE = 1e-11
#: Accepted residual where round-off stops the convergence.
ENOUGH = 1e-9


class NotSolved(np.linalg.LinAlgError):
    """An iterative solution did not reach its tolerance, for instance where cracks separate a part from the body."""


def gmres(
    times: Callable[[np.ndarray], np.ndarray],
    right: np.ndarray,
    precondition: Callable[[np.ndarray], np.ndarray],
    first: np.ndarray | None = None,
    tolerance: float = TOLERANCE,
    restart: int = 250,
    limit: int = 1000,
    scale: np.ndarray | None = None,
) -> tuple[np.ndarray, int]:
    """x with |right − A x| ≤ ``tolerance`` |right|, and the number of products ``times``, from the guess ``first``.

    Equations are weighted by ``scale`` (n,), if given. Preconditioned from the right (Saad & Schultz 1986), so that the
    true residual decreases. Raises NotSolved.
    """
    if scale is not None:
        return gmres(
            lambda v: scale * times(v),
            scale * right,
            lambda v: precondition(v / scale),
            first,
            tolerance,
            restart,
            limit,
        )
    size = float(np.linalg.norm(right))
    if size == 0.0:
        return np.zeros_like(right), 0
    x, rest, products = np.zeros_like(right), right, 0
    if first is not None and first.any():
        x, rest, products = first.copy(), right - times(first), 1
    left = float(np.linalg.norm(rest))
    while left > tolerance * size:
        # The residual that follows from the recurrence falls below the true one.
        change, n = _cycle(times, precondition, rest, left, 0.1 * tolerance * size, restart)
        x = x + change
        rest = right - times(x)
        products += n + 1
        before, left = left, float(np.linalg.norm(rest))
        if left > 0.5 * before or products > limit:
            if left <= ENOUGH * size:
                break
            raise NotSolved(
                f"the iterative solution of the crack equations stopped at a residual of {left / size:.1e} after "
                f"{products} products; do cracks separate a part from the body?"
            )
    return x, products


def _cycle(times, precondition, rest: np.ndarray, left: float, goal: float, longest: int) -> tuple[np.ndarray, int]:
    """Change of x within one Krylov space of ``rest``, whose norm is ``left``, and the number of products."""
    basis = [rest / left]
    triangle = np.zeros((longest, longest))
    turns = np.zeros((longest, 2))
    target = np.zeros(longest + 1)
    target[0] = left
    k = 0
    while k < longest and abs(target[k]) > goal:
        v = times(precondition(basis[k]))
        column = np.zeros(k + 2)
        # Orthogonalised twice; once would lose orthogonality in the last digits of the residual.
        for _ in range(2):
            for i, u in enumerate(basis):
                h = u @ v
                v -= h * u
                column[i] += h
        column[k + 1] = np.linalg.norm(v)
        if column[k + 1] > 0:
            v /= column[k + 1]
        basis.append(v)
        for i in range(k):
            (c, s), (a, b) = turns[i], column[i : i + 2]
            column[i : i + 2] = c * a + s * b, c * b - s * a
        length = float(np.hypot(*column[k:]))
        if length == 0.0:
            break
        turns[k] = column[k:] / length
        triangle[: k + 1, k] = column[: k + 1]
        triangle[k, k] = length
        target[k + 1], target[k] = -turns[k, 1] * target[k], turns[k, 0] * target[k]
        k += 1
    if k == 0:
        return np.zeros_like(rest), 1
    y = np.linalg.solve(triangle[:k, :k], target[:k])
    return precondition(sum(a * u for a, u in zip(y, basis))), k


def scales(elements: ElementSet) -> np.ndarray:
    """(n_unknowns,) row scales where element lengths differ much.

    Tractions are proportional to 1/length: unscaled, those of the shortest elements alone would decide the convergence.
    """
    return np.repeat(elements.length / elements.length.max(), 2 * elements.per) if elements.n else np.zeros(0)


class Patches:
    """Additive Schwarz preconditioner; ``crack`` (n,) is the crack of every element.

    ``between(elements)`` is the matrix between some of them where it is not their influence alone. An element joins a
    patch only if its distance from it is at most ``lengths`` times its own length: elements graded towards another
    corner hardly matter here and are too many to factor again.
    """

    def __init__(
        self,
        elements: ElementSet,
        crack: np.ndarray,
        nu: float,
        tol: float,
        between: Callable[[np.ndarray], np.ndarray] | None = None,
        lengths: float = np.inf,
    ):
        self._elements, self._nu, self._tol = elements, nu, tol
        self._between = self._influence if between is None else between
        tree = Tree.over(elements, PATCH)
        midpoint = 0.5 * (elements.start + elements.end) @ np.array([1.0, 1j])
        at = np.argsort(crack, kind="stable")
        first = np.searchsorted(crack[at], np.arange(int(crack.max()) + 2))
        self._patches: list[tuple[np.ndarray, np.ndarray]] = []
        for leaf in tree.leaves:
            own = tree.elements(leaf)
            cut = np.concatenate([at[first[k] : first[k + 1]] for k in np.unique(crack[own])])
            near = cut[np.abs(midpoint[cut] - tree.centre[leaf]) <= REACH * tree.radius[leaf]]
            if np.isfinite(lengths):
                away = np.abs(midpoint[near][:, None] - midpoint[own]).min(axis=1)
                near = near[away <= lengths * elements.length[near]]
            whole = np.union1d(own, near)
            self._patches.append((whole, elements.unknowns(np.sort(own))))
        #: For each patch, once `change` has set the equations.
        self._factors: dict[int, tuple[bytes, np.ndarray, np.ndarray, np.ndarray, Factor]] = {}

    def change(self, rows: Rows) -> None:
        """Use the equations ``rows`` from now on; only patches whose equations differ are factored."""
        for k, (elements, own) in enumerate(self._patches):
            unknowns = self._elements.unknowns(elements)
            prescribed, mixed, spring = rows.prescribed[unknowns], rows.mixed[unknowns], rows.spring[unknowns]
            key = prescribed.tobytes() + mixed.tobytes() + spring.tobytes()
            known = self._factors.get(k)
            if known is not None and known[0] == key:
                continue
            matrix = self._between(elements)
            moving = np.flatnonzero(mixed)
            matrix[moving] += mixed[moving, None] * matrix[moving + rows.per]
            matrix -= np.diag(spring)
            if prescribed.any():
                matrix = matrix[np.ix_(~prescribed, ~prescribed)]
            free = unknowns[~prescribed]
            kept = np.flatnonzero(np.isin(free, own))
            self._factors[k] = key, free, kept, free[kept], Factor(matrix, "cracks separate a part from the body")

    def _influence(self, elements: np.ndarray) -> np.ndarray:
        part = self._elements.take(elements)
        return influence(part, part, self._nu, self._tol)

    @property
    def rcond(self) -> float:
        """The worst patch's."""
        return min(factor.rcond for *_, factor in self._factors.values())

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Approximate S⁻¹ ``right`` (n,); zero where unknowns are prescribed."""
        out = np.zeros_like(right)
        for _, free, kept, to, factor in self._factors.values():
            out[to] = factor.solve(right[free])[kept]
        return out

    def solve_transposed(self, right: np.ndarray) -> np.ndarray:
        """Transpose of `solve`."""
        out = np.zeros_like(right)
        for _, free, kept, to, factor in self._factors.values():
            own = np.zeros(len(free))
            own[kept] = right[to]
            out[free] += factor.solve(own, transposed=True)
        return out
