"""The boundary's equations where they are too many to factor: multipoles, GMRES, neighbourhoods factored.

Unknown are displacements that enter as jumps, so A_ΓΓ is of the kind that cracks have and the same neighbourhoods
(`iterative.Patches`) make GMRES converge: 38 products at 10 000 unknowns, 53 at 20 000, on a square as on a rough ellipse.
The lifted rigid motions are in the neighbourhoods too; one that holds a whole small hole would be singular without them.
"""

from __future__ import annotations

import numpy as np

from .crack_system import Rows
from .hierarchical import Compressed
from .influence import ElementSet
from .iterative import Patches, gmres

#: Boundary unknowns from which "auto" and "compressed" iterate on them. Matrices and one load take 0.8 s at 4100 (factored
#: 2.7 s) and 1.5 s at 6100 (7.1 s), processor time; another load 0.3 and 0.4 s (0.01 s), so that factors are the better for
#: some fifteen loads at this number.
CROSSOVER = 6000


def is_iterated(solver: str, n_unknowns: int, supports: bool) -> bool:
    """Whether ``solver`` iterates on so many boundary unknowns; held displacements are factored."""
    return solver != "dense" and n_unknowns >= CROSSOVER and not supports


class IteratedBoundary:
    """What stands for a `Factor` of ``matrix``, A_ΓΓ of the ``elements``, with ``rigid`` (n, k) and ``weights`` (k, n) lifted
    as `boundary` has it. ``products`` counts those with the matrix."""

    def __init__(
        self,
        elements: ElementSet,
        matrix: Compressed,
        rigid: np.ndarray,
        weights: np.ndarray,
        extent: float,
        nu: float,
        tol: float,
    ):
        self._matrix, self._rigid, self._weights, self._extent = matrix, rigid, weights, extent
        self.n, self.products = elements.n_unknowns, 0
        self._last: tuple[np.ndarray, np.ndarray] | None = None

        def lift(unknowns: np.ndarray) -> np.ndarray:
            return rigid[unknowns] @ weights[:, unknowns] / extent

        self._patches = Patches(elements, np.zeros(elements.n, int), nu, tol, lift)
        zero = np.zeros(self.n)
        self._patches.change(Rows(np.zeros(self.n, bool), zero, zero, elements.per))

    @property
    def rcond(self) -> float:
        """The worst neighbourhood's: of the whole, none is known."""
        return self._patches.rcond

    def times(self, u: np.ndarray, transposed: bool = False) -> np.ndarray:
        """The lifted A_ΓΓ times ``u`` (n,)."""
        if transposed:
            return self._matrix.transposed_times(u) + (u @ self._rigid) @ self._weights / self._extent
        return self._matrix @ u + self._rigid @ (self._weights @ u) / self._extent

    def roughly(self, right: np.ndarray, transposed: bool = False) -> np.ndarray:
        """Neighbourhoods' answer to ``right`` (n,)."""
        return self._patches.solve_transposed(right) if transposed else self._patches.solve(right)

    def solve(self, right: np.ndarray, transposed: bool = False) -> np.ndarray:
        """Solution for ``right`` (n,) or (n, k), of the ``transposed`` system if asked. Raises NotSolved."""
        if right.ndim == 2:
            out = np.empty_like(right)
            for k, column in enumerate(right.T):
                out[:, k] = self.solve(column, transposed)
            return out
        first = None
        if self._last is not None and not transposed:
            # As much of the last solution as its right-hand side is in this one: a load that comes again costs nothing.
            before, u = self._last
            first = float(before @ right) / float(before @ before) * u
        u, n = gmres(lambda v: self.times(v, transposed), right, lambda v: self.roughly(v, transposed), first)
        self.products += n
        if not transposed and right.any():
            self._last = right.copy(), u
        return u
