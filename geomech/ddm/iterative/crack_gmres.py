"""Crack equations too large to factor: fast multipole products and GMRES with patches as preconditioner."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..system.contact_rows import Rows
from ..system.influence_matrix import ElementSet
from .boundary_gmres import IteratedBoundary
from .coarse_space import CoarseLevel
from .fast_multipole import Compressed
from .gmres import Patches, gmres, scales

if TYPE_CHECKING:
    from .image_multipole import BelowSurface

#: Crack unknowns from which "auto" iterates. From 1200 on one load is faster so, matrices included; with closing faces
#: from 2000 on. With factors further loads on the same cracks are faster.
CROSSOVER = 2500
#: The same where cracks have grown from some that were factored: factors are bordered with the new elements.
GROWN_CROSSOVER = 4500
#: Crack unknowns up to which "auto" falls back to factors if the iteration fails (1 GB, half a minute).
FACTORABLE = 12000


def is_compressed(solver: str, n_unknowns: int, factored: bool = False) -> bool:
    """Whether ``solver`` ("auto", "dense", "compressed") iterates on ``n_unknowns`` crack unknowns.

    ``factored``: the cracks have grown from some with factors. Raises ValueError.
    """
    if solver not in ("auto", "dense", "compressed"):
        raise ValueError(f'solver: expected "auto", "dense" or "compressed", got {solver!r}')
    many = GROWN_CROSSOVER if factored else CROSSOVER
    return n_unknowns > 0 and (solver == "compressed" or (solver == "auto" and n_unknowns >= many))


class BoundaryResponse:
    """Response of the boundary to moving crack faces, A_ΓΓ⁻¹ A_ΓC, as an operator.

    ``solve(right, transposed)`` applies A_ΓΓ⁻¹, ``influence`` is A_ΓC.
    """

    def __init__(self, solve: Callable[..., np.ndarray], influence: np.ndarray):
        self._solve, self.influence = solve, influence

    def __matmul__(self, w: np.ndarray) -> np.ndarray:
        return self._solve(self.influence @ w)

    def transposed_times(self, v: np.ndarray) -> np.ndarray:
        return self._solve(v, transposed=True) @ self.influence


class Reduced:
    """S = A_CC − A_CΓ A_ΓΓ⁻¹ A_ΓC as an operator."""

    def __init__(self, cracks: Compressed | BelowSurface, on_cracks: np.ndarray, following: BoundaryResponse):
        self.cracks, self._on_cracks, self._following = cracks, on_cracks, following

    def __matmul__(self, w: np.ndarray) -> np.ndarray:
        out = self.cracks @ w
        return out - self._on_cracks @ (self._following @ w) if self._on_cracks.shape[1] else out

    def transposed_times(self, v: np.ndarray) -> np.ndarray:
        """Sᵀ ``v``."""
        out = self.cracks.transposed_times(v)
        return out - self._following.transposed_times(v @ self._on_cracks) if self._on_cracks.shape[1] else out


class Coupled:
    """Equations of boundary and cracks together, boundary first, where both are solved iteratively.

    S by itself would need an iterative solution on the boundary for each of its products.
    """

    def __init__(self, reduced: Reduced, boundary: IteratedBoundary, on_boundary: np.ndarray, on_cracks: np.ndarray):
        self._reduced, self._boundary = reduced, boundary
        self._on_boundary, self._on_cracks = on_boundary, on_cracks
        self.first = boundary.n
        cracks = scales(reduced.cracks.targets)
        self.scale = np.concatenate([boundary.scale, cracks])

    def times(self, v: np.ndarray, transposed: bool = False) -> np.ndarray:
        u, w = v[: self.first], v[self.first :]
        own = self._boundary.times(u, transposed)
        if transposed:
            cracks = self._reduced.cracks.transposed_times(w)
            return np.concatenate([own + w @ self._on_cracks, cracks + u @ self._on_boundary])
        cracks = self._reduced.cracks @ w
        return np.concatenate([own + self._on_boundary @ w, cracks + self._on_cracks @ u])

    def precondition(
        self, v: np.ndarray, of_cracks: Callable[[np.ndarray], np.ndarray], transposed: bool
    ) -> np.ndarray:
        """Preconditioner: the boundary's patches, then the cracks' patches for the remaining right-hand side
        (transposed: in reverse order)."""
        u, w = v[: self.first], v[self.first :]
        if transposed:
            w = of_cracks(w)
            return np.concatenate([self._boundary.precondition(u - w @ self._on_cracks, True), w])
        u = self._boundary.precondition(u)
        return np.concatenate([u, of_cracks(w - self._on_cracks @ u)])


class IterativeCrackSystem:
    """Iterative counterpart of `schur_complement.CrackSystem`; ``matrix`` is S as an operator.

    ``coupled``: the equations together with those of a boundary that is solved iteratively too. ``products`` counts
    products with S. The last solution is the first guess for the next.
    """

    def __init__(
        self,
        matrix: Reduced,
        elements: ElementSet,
        crack: np.ndarray,
        nu: float,
        tol: float,
        coupled: Coupled | None = None,
    ):
        self.matrix, self.n, self._coupled = matrix, elements.n_unknowns, coupled
        self._first = 0 if coupled is None else coupled.first
        self._scale = None if coupled is None else coupled.scale
        self.products = 0
        self._per = elements.per
        self._patches = Patches(elements, crack, nu, tol)
        self._coarse = CoarseLevel(elements, crack, nu, tol)
        self._last: tuple[np.ndarray, np.ndarray] | None = None

    #: Solutions begin with those for open faces (`CrackSystem`).
    by_free_unknowns = False

    def opened(self, right: np.ndarray) -> np.ndarray:
        """Zeros: no inverse is available at no cost."""
        return np.zeros_like(right)

    def constrained(
        self, right: np.ndarray, closed: np.ndarray, fixed: np.ndarray, opened: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """As in `schur_complement.CrackSystem.constrained`. Raises NotSolved."""
        if right.ndim == 2:
            columns = [self.constrained(r, closed, f) for r, f in zip(right.T, fixed.T)]
            return np.column_stack([w for w, _ in columns]), np.column_stack([reaction for _, reaction in columns])
        given = np.where(closed, fixed, 0.0)
        rest = right - self.matrix @ given if given.any() else right
        w = given + self.solve(rest, self._holding(closed))
        reaction = np.zeros_like(right)
        if closed.any():
            reaction[closed] = (right - self.matrix @ w)[closed]
        return w, reaction

    def solve(self, right: np.ndarray, rows: Rows) -> np.ndarray:
        """(n,) jumps that are zero where prescribed and satisfy the other ``rows``. Raises NotSolved."""
        moving = np.flatnonzero(rows.mixed)

        def times(v: np.ndarray) -> np.ndarray:
            out = self.matrix @ v if self._coupled is None else self._coupled.times(v)
            own = out[self._first :]
            own[moving] += rows.mixed[moving] * own[moving + rows.per]
            own -= rows.spring * v[self._first :]
            own[rows.prescribed] = 0.0
            return out

        def of_cracks(v: np.ndarray) -> np.ndarray:
            smooth, rest = self._coarse.split(np.where(rows.prescribed, 0.0, v))
            return smooth + self._patches.solve(rest)

        def precondition(v: np.ndarray) -> np.ndarray:
            return of_cracks(v) if self._coupled is None else self._coupled.precondition(v, of_cracks, False)

        self._patches.change(rows)
        self._coarse.change(rows.prescribed)
        right = np.concatenate([np.zeros(self._first), np.where(rows.prescribed, 0.0, right)])
        found, n = gmres(times, right, precondition, self._guess(right, rows.prescribed), scale=self._scale)
        self.products += n
        self._last = right, found
        return found[self._first :]

    def solve_transposed(self, right: np.ndarray, rows: Rows) -> np.ndarray:
        """(n,) multipliers of the right-hand sides of `solve` in ``right`` ᵀ w; zero where prescribed. Raises
        NotSolved."""
        moving = np.flatnonzero(rows.mixed)

        def times(v: np.ndarray) -> np.ndarray:
            mixed = v.copy()
            own, before = mixed[self._first :], v[self._first :]
            own[moving + rows.per] += rows.mixed[moving] * before[moving]
            if self._coupled is None:
                out = self.matrix.transposed_times(mixed)
            else:
                out = self._coupled.times(mixed, transposed=True)
            out[self._first :] -= rows.spring * before
            out[self._first :][rows.prescribed] = 0.0
            return out

        def of_cracks(v: np.ndarray) -> np.ndarray:
            v = np.where(rows.prescribed, 0.0, v)
            return self._coarse.split_transposed(v, self._patches.solve_transposed(v))

        def precondition(v: np.ndarray) -> np.ndarray:
            return of_cracks(v) if self._coupled is None else self._coupled.precondition(v, of_cracks, True)

        self._patches.change(rows)
        self._coarse.change(rows.prescribed)
        right = np.concatenate([np.zeros(self._first), np.where(rows.prescribed, 0.0, right)])
        found, n = gmres(times, right, precondition, scale=self._scale)
        self.products += n
        return found[self._first :]

    def _guess(self, right: np.ndarray, prescribed: np.ndarray) -> np.ndarray | None:
        """The last solution, scaled by the projection of its right-hand side onto this one."""
        if self._last is None:
            return None
        before, w = self._last
        size = float(before @ before)
        if not size:
            return None
        guess = float(before @ right) / size * w
        guess[self._first :][prescribed] = 0.0
        return guess

    def changed(self, rows: Rows) -> tuple[np.ndarray, Iterated]:
        """As in `schur_complement.CrackSystem.changed`."""
        return np.flatnonzero(~rows.prescribed), Iterated(self, rows)

    def rcond(self, closed: np.ndarray) -> float:
        """Reciprocal condition number of the worst patch; that of the whole system is unknown."""
        return self.rcond_of(self._holding(closed))

    def rcond_of(self, rows: Rows) -> float:
        """As `rcond`, with changed ``rows``."""
        self._patches.change(rows)
        return self._patches.rcond

    def _holding(self, closed: np.ndarray) -> Rows:
        return Rows(closed, np.zeros(self.n), np.zeros(self.n), self._per)


class Iterated:
    """Iterative counterpart of a `Factor` of the equations of ``system`` with changed ``rows``."""

    def __init__(self, system: IterativeCrackSystem, rows: Rows):
        self._system, self._rows = system, rows
        self._free = np.flatnonzero(~rows.prescribed)

    @property
    def rcond(self) -> float:
        return self._system.rcond_of(self._rows)

    def solve(self, right: np.ndarray, transposed: bool = False) -> np.ndarray:
        """Free unknowns for ``right`` (n_free,) or (n_free, k); of the ``transposed`` equations on request."""
        if right.ndim == 2:
            return np.column_stack([self.solve(column, transposed) for column in right.T])
        whole = np.zeros(self._system.n)
        whole[self._free] = right
        solve = self._system.solve_transposed if transposed else self._system.solve
        return solve(whole, self._rows)[self._free]


def compressed(
    cracks: ElementSet,
    crack: np.ndarray,
    solve: Callable[..., np.ndarray],
    on_boundary: np.ndarray,
    on_cracks: np.ndarray,
    nu: float,
    tol: float,
    boundary: IteratedBoundary | None = None,
) -> tuple[BoundaryResponse, IterativeCrackSystem]:
    """A_ΓΓ⁻¹ A_ΓC and the crack system of a body, both as operators.

    ``crack`` (n,) is the crack of every element, ``solve(right, transposed)`` applies A_ΓΓ⁻¹, ``on_boundary`` is A_ΓC
    and ``on_cracks`` is A_CΓ; ``boundary`` replaces the boundary's factors where it is solved iteratively too.
    """
    following = BoundaryResponse(solve, on_boundary)
    own: Compressed | BelowSurface
    if cracks.half_plane is None:
        own = Compressed(cracks, cracks, nu, tol)
    else:
        from .image_multipole import BelowSurface

        own = BelowSurface(cracks, nu, tol)
    matrix = Reduced(own, on_cracks, following)
    coupled = None if boundary is None else Coupled(matrix, boundary, on_boundary, on_cracks)
    return following, IterativeCrackSystem(matrix, cracks, crack, nu, tol, coupled)
