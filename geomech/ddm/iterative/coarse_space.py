"""Coarse level for long cracks: the interaction of a crack's patches, with few elements.

Patches that are solved separately (`gmres.Patches`) pass information along a crack by one patch per iteration. Here
runs of a long crack's elements are replaced by one straight element each, of moderate order, and its equations are
factored. A residual r is split by R, the least-squares polynomial on each coarse element: R r is solved for on the
coarse elements, and the patches solve for the rest of r.
"""

from __future__ import annotations

import numpy as np

from ..kernels import shape_functions
from ..system.dense_lu import Factor
from ..system.influence_matrix import ElementSet, influence

#: Number of elements from which a crack has a coarse level: that of some patches.
LONG = 180
#: Largest number of elements that one coarse element represents, and its order.
RUN, ORDER = 25, 5
#: A run ends where the crack has turned by more than this since it began, rad. Straight elements on curved runs (22° to
#: either side) misled the patches: 500 products instead of 120.
STRAIGHT = np.radians(8.0)
#: Cracks that turn so often that runs would be shorter than this have no coarse level.
SHORTEST = 8


class CoarseLevel:
    """Coarse elements of the long cracks among ``elements``, if any; ``crack`` (n,) is the crack of each element."""

    def __init__(self, elements: ElementSet, crack: np.ndarray, nu: float, tol: float):
        runs = [run for chain in _chains(elements, crack) for run in _long_runs(elements, chain)]
        self.n = len(runs)
        if not runs:
            return
        start = np.array([elements.start[run[0]] for run in runs])
        end = np.array([elements.end[run[-1]] for run in runs])
        tips = np.array([[_begins(elements.kind[run[0]]), _stops(elements.kind[run[-1]])] for run in runs])
        kind = np.select(
            [tips.all(axis=1), tips[:, 0], tips[:, 1]],
            [shape_functions.TIP_BOTH, shape_functions.TIP_START, shape_functions.TIP_END],
            shape_functions.ORDINARY,
        )
        self._coarse = ElementSet(start, end, kind, np.arange(self.n), ORDER, elements.family, elements.half_plane)
        self._matrix = influence(self._coarse, self._coarse, nu, tol)
        self._parts = [_Part(elements, run, int(k)) for run, k in zip(runs, kind)]
        self._prescribed: np.ndarray | None = None

    def change(self, prescribed: np.ndarray) -> None:
        """From now on the unknowns ``prescribed`` (n,) bool are zero; a coarse component is zero if most of its nodes
        are."""
        if not self.n or (self._prescribed is not None and np.array_equal(self._prescribed, prescribed)):
            return
        self._prescribed = prescribed.copy()
        most = np.array([prescribed[part.unknowns].mean(axis=1) > 0.5 for part in self._parts])
        self._free = ~np.repeat(most.ravel(), ORDER + 1)
        self._factor = Factor(
            self._matrix[np.ix_(self._free, self._free)], "coarse elements leave a part unconstrained"
        )

    def split(self, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Approximate S⁻¹ of the smooth part of ``right`` (n,), and the rest of ``right``; zero where unknowns are
        prescribed."""
        if not self.n:
            return np.zeros_like(right), right
        smooth = np.concatenate([(right[part.unknowns] @ part.fit.T).ravel() for part in self._parts])
        smooth[~self._free] = 0.0
        density = np.zeros_like(smooth)
        density[self._free] = self._factor.solve(smooth[self._free])
        rest, out = right.copy(), np.zeros_like(right)
        shape = (self.n, 2, ORDER + 1)
        for part, own, w in zip(self._parts, smooth.reshape(shape), density.reshape(shape)):
            rest[part.unknowns] -= own @ part.at_nodes.T
            out[part.unknowns] = w @ part.density.T
        out[self._prescribed] = rest[self._prescribed] = 0.0
        return out, rest

    def split_transposed(self, smooth: np.ndarray, rest: np.ndarray) -> np.ndarray:
        """Transpose of `split`: (n,) from the multipliers of its two results."""
        if not self.n:
            return rest
        assert self._prescribed is not None
        smooth, out = np.where(self._prescribed, 0.0, smooth), np.where(self._prescribed, 0.0, rest)
        density = np.concatenate([(smooth[part.unknowns] @ part.density).ravel() for part in self._parts])
        own = np.zeros_like(density)
        own[self._free] = self._factor.solve(density[self._free], transposed=True)
        own -= np.concatenate([(out[part.unknowns] @ part.at_nodes).ravel() for part in self._parts])
        own[~self._free] = 0.0
        for part, values in zip(self._parts, own.reshape(self.n, 2, ORDER + 1)):
            out[part.unknowns] += values @ part.fit
        return out


class _Part:
    """One coarse element.

    ``unknowns`` (2, m) are those of the fine elements it represents, by component; ``fit`` (p+1, m) maps values at
    their nodes to its own nodes, ``at_nodes`` (m, p+1) back; ``density`` (m, p+1) is its density at their nodes.
    """

    def __init__(self, elements: ElementSet, run: np.ndarray, kind: int):
        per, length = elements.per, elements.length[run]
        before = np.cumsum(length) - length
        t = shape_functions.nodes(elements.family, elements.order)
        along = (before[:, None] + 0.5 * (1 + t) * length[:, None]).ravel()
        at = 2 * along / length.sum() - 1
        self.unknowns = (run[:, None] * 2 * per + np.arange(per)).ravel()[None] + np.array([[0], [per]])
        own = np.polynomial.legendre.legvander(shape_functions.nodes(elements.family, ORDER), ORDER)
        self.at_nodes = np.polynomial.legendre.legvander(at, ORDER) @ np.linalg.inv(own)
        weight = np.sqrt(np.repeat(length / length.sum() / per, per))
        self.fit = np.linalg.pinv(self.at_nodes * weight[:, None]) * weight
        self.density = shape_functions.at(elements.family, ORDER, kind, at)


def _begins(kind: int) -> bool:
    return kind in (shape_functions.TIP_START, shape_functions.TIP_BOTH)


def _stops(kind: int) -> bool:
    return kind in (shape_functions.TIP_END, shape_functions.TIP_BOTH)


def _chains(elements: ElementSet, crack: np.ndarray):
    """Elements (m,) of long cracks, in chains in which each begins where the last one ends."""
    count = np.bincount(crack) if len(crack) else np.zeros(0, int)
    for k in np.flatnonzero(count >= LONG):
        own = np.flatnonzero(crack == k)
        joined = (elements.end[own[:-1]] == elements.start[own[1:]]).all(axis=1)
        yield from np.split(own, np.flatnonzero(~joined) + 1)


def _long_runs(elements: ElementSet, chain: np.ndarray) -> list[np.ndarray]:
    """``chain`` in pieces of at most `RUN` elements that hardly turn; none where they would be short."""
    runs = list(_runs(elements, chain))
    return runs if len(chain) >= SHORTEST * len(runs) else []


def _runs(elements: ElementSet, chain: np.ndarray):
    way = np.arctan2(elements.tangent[chain, 1], elements.tangent[chain, 0])
    first = 0
    for k in range(1, len(chain) + 1):
        ends = k == len(chain) or k - first >= RUN
        if ends or abs((way[k] - way[first] + np.pi) % (2 * np.pi) - np.pi) > STRAIGHT:
            yield chain[first:k]
            first = k
