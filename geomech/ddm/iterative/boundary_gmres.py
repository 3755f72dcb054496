"""Boundary equations too large to factor: fast multipole products, GMRES, factored patches as preconditioner.

The unknowns are displacements, which enter as jumps, so that A_ΓΓ has the structure of crack equations and the same
patches (`gmres.Patches`) make GMRES converge: 38 products at 10 000 unknowns, 53 at 20 000, on a square and on a rough
ellipse. The patches include the deflated rigid motions; a patch that contains a whole small hole would otherwise be
singular. On supported parts of the boundary the unknowns are reactions, i.e. line forces; they are few compared with
the boundary, and their columns stay dense.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..loads.supports import Holds
from ..system.contact_rows import Rows
from ..system.influence_matrix import ElementSet, line_influence
from .fast_multipole import Compressed
from .gmres import Patches, gmres, scales

#: Boundary unknowns from which "auto" and "compressed" iterate on them. Matrices and one load take 0.7 s at 4000
#: (factored 2.5 s) and 1.5 s at 6100 (7.1 s), processor time, with uniform elements, and 2.8 s at 6000 (6.3 s) on an
#: outline of eight corners with a hole of twelve, graded to 1e-8 of the longest element; each further load takes 0.2,
#: 0.4 and 1.6 s (0.01 s). Factoring therefore pays off from some fifteen loads on at this size, and from three on the
#: graded outline.
CROSSOVER = 6000
#: Elements join a patch if their distance from it is at most this many times their own length: on uniform outlines as
#: few products as with all near elements (24 at 4000 unknowns; 30 with a value of 4).
NEAR = 12.0
#: Largest number of entries of the dense reaction columns with which a supported boundary is solved iteratively (1 GB).
MOST_REACTIONS = 128_000_000


def is_iterated(solver: str, n_unknowns: int, holds: Holds | None = None, holes_supported: bool = False) -> bool:
    """Whether ``solver`` iterates on the boundary unknowns.

    ``n_unknowns`` is their number, ``holds`` describes the supported ones; with a supported hole (`hole_supports`) the
    boundary is factored.
    """
    if solver == "dense" or n_unknowns < CROSSOVER or holes_supported:
        return False
    return holds is None or n_unknowns * holds.sources.n_unknowns <= MOST_REACTIONS


class SupportedBoundaryMatrix:
    """A_ΓΓ of a partly supported boundary: the operator ``jumps`` on all of it, and the dense columns of reactions."""

    def __init__(self, jumps: Compressed, holds: Holds, nu: float, tol: float):
        self._jumps, self._holds = jumps, holds
        self._reactions = line_influence(holds.boundary, holds.sources, nu, tol, -1.0)
        self._nothing = np.zeros(holds.sources.n_unknowns)

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        displacement, reactions = self._holds.split(x, self._nothing)
        return self._jumps @ displacement + self._reactions @ reactions

    def transposed_times(self, v: np.ndarray) -> np.ndarray:
        """A_ΓΓᵀ ``v``."""
        return self._holds.joined(self._jumps.transposed_times(v), v @ self._reactions)


class PrescribedJumps:
    """Traction on the boundary from prescribed displacement, as an operator on its values (h_unknowns,)."""

    def __init__(self, jumps: Compressed, holds: Holds):
        self._jumps, self._places, self._n = jumps, holds.boundary.unknowns(holds.elements), holds.boundary.n_unknowns

    def __matmul__(self, imposed: np.ndarray) -> np.ndarray:
        if not imposed.any():
            return np.zeros(self._n)
        whole = np.zeros(self._n)
        whole[self._places] = imposed
        return self._jumps @ whole


class IteratedBoundary:
    """Iterative counterpart of a `Factor` of ``matrix``, A_ΓΓ of the ``elements``.

    ``rigid`` (n, k) and ``weights`` (k, n) deflate rigid motions as in `boundary_system`; ``between(elements)`` is the
    matrix between some of the elements. ``products`` counts products with the matrix.
    """

    def __init__(
        self,
        elements: ElementSet,
        matrix: Compressed | SupportedBoundaryMatrix,
        rigid: np.ndarray,
        weights: np.ndarray,
        extent: float,
        nu: float,
        tol: float,
        between: Callable[[np.ndarray], np.ndarray],
    ):
        self._matrix, self._rigid, self._weights, self._extent = matrix, rigid, weights, extent
        self.n, self.products = elements.n_unknowns, 0
        # Elements at corners and at support ends are far shorter than others: unscaled, round-off in their equations
        # exceeds the residual of all the rest (8.9e-9 where the shortest is 1e-8 of the longest).
        self.scale = scales(elements)
        self._last: tuple[np.ndarray, np.ndarray] | None = None

        def regularised(numbers: np.ndarray) -> np.ndarray:
            unknowns = elements.unknowns(numbers)
            return between(numbers) + rigid[unknowns] @ weights[:, unknowns] / extent

        self._patches = Patches(elements, np.zeros(elements.n, int), nu, tol, regularised, NEAR)
        zero = np.zeros(self.n)
        self._patches.change(Rows(np.zeros(self.n, bool), zero, zero, elements.per))

    @property
    def rcond(self) -> float:
        """The worst patch's; that of the whole system is unknown."""
        return self._patches.rcond

    def times(self, u: np.ndarray, transposed: bool = False) -> np.ndarray:
        """The deflated A_ΓΓ times ``u`` (n,)."""
        if transposed:
            return self._matrix.transposed_times(u) + (u @ self._rigid) @ self._weights / self._extent
        return self._matrix @ u + self._rigid @ (self._weights @ u) / self._extent

    def precondition(self, right: np.ndarray, transposed: bool = False) -> np.ndarray:
        """Preconditioner: the patches' solution for ``right`` (n,)."""
        return self._patches.solve_transposed(right) if transposed else self._patches.solve(right)

    def solve(self, right: np.ndarray, transposed: bool = False) -> np.ndarray:
        """Solution for ``right`` (n,) or (n, k); of the ``transposed`` system on request. Raises NotSolved."""
        if right.ndim == 2:
            out = np.empty_like(right)
            for k, column in enumerate(right.T):
                out[:, k] = self.solve(column, transposed)
            return out
        first = None
        if self._last is not None and not transposed:
            # First guess: the last solution times the projection onto its right-hand side, so that a repeated load is
            # free.
            before, u = self._last
            first = float(before @ right) / float(before @ before) * u
        u, n = gmres(
            lambda v: self.times(v, transposed),
            right,
            lambda v: self.precondition(v, transposed),
            first,
            scale=self.scale,
        )
        self.products += n
        if not transposed and right.any():
            self._last = right.copy(), u
        return u
