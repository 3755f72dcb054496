"""Generalised conjugate residuals for one matrix A and several right-hand sides (Eisenstat, Elman & Schultz 1983).

Every search direction d is kept with its product A d, the products orthonormal. A residual is first minimised along the
known directions, then along new ones. In exact arithmetic this is GMRES (Saad & Schultz 1986) without restarts, and
directions found for one right-hand side, as those of nearly singular parts of A, serve the next.
"""

from __future__ import annotations

import numpy as np

from ...compiled import UNCOUNTED, kept, part

_FUSED = {"reassoc", "contract", "nsz"}


@kept(fastmath=_FUSED, error_model="numpy", nogil=True)
def _project(directions, products, x, rest):
    """Minimise the residual ``rest`` (m,) of ``x`` (m,) along the ``directions`` (k, m), in place; returns its largest
    entry."""
    shares = np.empty(len(directions))
    for k in range(len(directions)):
        product, share = products[k], 0.0
        for i in range(len(rest)):
            share += product[i] * rest[i]
        shares[k] = share
    for k in range(len(directions)):
        direction, product, share = directions[k], products[k], shares[k]
        for i in range(len(rest)):
            x[i] += share * direction[i]
            rest[i] -= share * product[i]
    return _largest(rest)


@kept(fastmath=_FUSED, error_model="numpy", nogil=True, **UNCOUNTED)
def _include(direction, product, directions, products, k, x, rest):
    """Add a new ``direction`` (m,) and its ``product`` as number ``k`` of the known ones, and minimise along it as in
    `_project`."""
    for j in range(k):
        known, known_product, share = directions[j], products[j], 0.0
        for i in range(len(rest)):
            share += known_product[i] * product[i]
        for i in range(len(rest)):
            direction[i] -= share * known[i]
            product[i] -= share * known_product[i]
    size = share = 0.0
    for i in range(len(rest)):
        size += product[i] * product[i]
        share += product[i] * rest[i]
    # A direction with zero product is useless: NaN, which the caller takes as a failure.
    scale = 1.0 / np.sqrt(size) if size > 0.0 else np.nan
    share *= scale
    unit, unit_product = directions[k], products[k]
    for i in range(len(rest)):
        unit[i], unit_product[i] = scale * direction[i], scale * product[i]
        x[i] += share * unit[i]
        rest[i] -= share * unit_product[i]
    return _largest(rest)


@part(fastmath=_FUSED, error_model="numpy", nogil=True, **UNCOUNTED)
def _largest(values):
    """The largest |value|; infinite where one is not a number."""
    largest, right = 0.0, True
    for i in range(len(values)):
        here = abs(values[i])
        right &= here < np.inf
        largest = max(largest, here)
    return largest if right else np.inf


class Directions:
    """Memory for ``most`` directions of ``size`` unknowns, of which ``number`` are known; in ``room`` if given, or in
    the memory of other directions, ``sharing``: adding to one of the two then invalidates the other."""

    def __init__(self, size: int, most: int, sharing: Directions | None = None, room: np.ndarray | None = None) -> None:
        self._sharing = sharing
        if sharing is None:
            # Memory pages are allocated only as directions are added.
            room = np.empty(2 * most * size) if room is None else room
            pair = room[: 2 * most * size].reshape(2, most, size)
            self._directions: np.ndarray = pair[0]
            self._products: np.ndarray = pair[1]
        else:
            self._directions, self._products = sharing._directions[:most], sharing._products[:most]
            sharing._sharing = self
        self.number = 0

    def __len__(self) -> int:
        return len(self._directions)

    def forget(self) -> None:
        """Drop all directions: the matrix has changed."""
        self.number = 0

    def project(self, x: np.ndarray, rest: np.ndarray) -> float:
        """Minimise the residual ``rest`` (m,) of ``x`` (m,) along the known directions; returns its largest entry."""
        return _project(self._directions[: self.number], self._products[: self.number], x, rest)

    def add(self, direction: np.ndarray, product: np.ndarray, x: np.ndarray, rest: np.ndarray) -> float:
        """`project` along one more ``direction`` (m,) with the ``product`` A d; both are overwritten. The oldest
        directions are dropped if there is no room."""
        if self.number == len(self):
            self.forget()
        if self._sharing is not None:
            self._sharing.forget()
        self.number += 1
        return _include(direction, product, self._directions, self._products, self.number - 1, x, rest)
