"""Solution of the equations of crack faces in contact with the factors of S for open faces (Woodbury's formula).

Write S x = z. Constrained unknowns have x_h = 0 and give up their equation, whose residual is unknown: z_h = ρ_h. At a
sliding node the normal equation, times the friction factor m, is added to the tangential one: z_t + m z_a = b_t. So z =
b̂ + B ρ and

    x = S⁻¹ b̂ + (S⁻¹ B) ρ,        (S⁻¹ B)_h ρ = −(S⁻¹ b̂)_h,

a system of the size of the constrained unknowns. Columns of S⁻¹ are kept for other states and loads, so that a change
of state takes a factorisation of that size instead of one of all unknowns.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from .dense_lu import Factor

if TYPE_CHECKING:
    from .bordered_factor import BorderedFactor
    from .contact_rows import Rows


class InverseColumns(Protocol):
    """Provides columns of S⁻¹."""

    def inverse_columns(self, unknowns: np.ndarray) -> np.ndarray:
        """(n, len(unknowns)) columns of S⁻¹."""


class ClosedFaceFactor:
    """Solves the equations that ``rows`` (without springs) leave of S. ``open_factor``: factors of S; ``inverse``
    provides columns of S⁻¹. Raises LinAlgError, with the text ``what``, when they are singular."""

    def __init__(
        self,
        rows: Rows,
        open_factor: Factor | BorderedFactor,
        inverse: InverseColumns,
        what: str,
    ):
        self.open, self._inverse = open_factor, inverse
        self._free, self._prescribed = np.flatnonzero(~rows.prescribed), np.flatnonzero(rows.prescribed)
        along = np.flatnonzero(rows.mixed)
        across, mixed = along + rows.per, rows.mixed[along]
        # If the normal equation of a sliding node is kept, it is added on the right-hand side.
        loose = ~rows.prescribed[across]
        self._loose = along[loose], across[loose], mixed[loose]
        at = np.full(len(rows.prescribed), -1)
        at[self._prescribed] = np.arange(len(self._prescribed))
        self._slides = along[~loose], at[across[~loose]], mixed[~loose]
        of, into, factor = self._slides
        needed = np.concatenate([self._prescribed, of])
        columns = inverse.inverse_columns(needed)
        self._response = columns[:, : len(self._prescribed)].copy(order="F")
        self._response[:, into] -= columns[:, len(self._prescribed) :] * factor
        self._small = Factor(self._response[self._prescribed], what)
        self.rcond = min(open_factor.rcond, self._small.rcond)

    def respond(self, opened: np.ndarray, shear: np.ndarray, fixed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Jumps w (n,), with w = ``fixed`` where constrained, and residuals (n,) of the equations given up. ``opened``
        = S⁻¹ right: jumps of open faces; ``shear`` (n,) Pa: a further shear traction on the faces at few nodes.

        As above, with ρ added to ``right``. No solution or product of the size of S is needed."""
        w = opened.copy()
        pushed = np.flatnonzero(shear)
        if len(pushed):
            w += self._inverse.inverse_columns(pushed) @ shear[pushed]
        missing = np.zeros_like(w)
        missing[self._prescribed] = self._small.solve(w[self._prescribed] - fixed[self._prescribed])
        w -= self._response @ missing[self._prescribed]
        w[self._prescribed] = fixed[self._prescribed]
        return w, missing

    def solve(self, right: np.ndarray, transposed: bool = False) -> np.ndarray:
        """Solution (n_free,) or (n_free, k) for ``right``, of the ``transposed`` system if asked."""
        whole = np.zeros((len(self._free) + len(self._prescribed), *right.shape[1:]), order="F")
        whole[self._free] = right
        along, across, mixed = self._loose
        mixed = mixed if right.ndim == 1 else mixed[:, None]
        if not transposed:
            whole[along] -= mixed * whole[across]
            x = self.open.solve(whole)
            x -= self._response @ self._small.solve(x[self._prescribed])
            return x[self._free]
        x = self.open.solve(whole, transposed=True)
        of, into, factor = self._slides
        pull = x[self._prescribed]
        pull[into] -= (factor if right.ndim == 1 else factor[:, None]) * x[of]
        whole[:] = 0.0
        whole[self._prescribed] = self._small.solve(pull, transposed=True)
        x -= self.open.solve(whole, transposed=True)
        x[across] -= mixed * x[along]
        return x[self._free]
