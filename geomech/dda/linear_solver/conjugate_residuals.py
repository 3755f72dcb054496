"""Solutions of one matrix A by generalised conjugate residuals (Eisenstat, Elman & Schultz 1983), right side after right
side.

Every direction d that was tried is kept with its product A d, these orthonormal; a residual is first brought as low as
the known directions can, then along new ones. In exact arithmetic that is GMRES (Saad & Schultz 1986) without
restarts, and what nearly singular parts of A cost one right side its successors need not pay again.
"""

from __future__ import annotations

import numpy as np

from ...compiled import kept

_jit = kept(fastmath={"reassoc", "contract", "nsz"}, error_model="numpy", nogil=True)


@_jit
def _project(directions, products, x, rest):
    """Go from ``x`` (m,) with the residual ``rest`` (m,) to where it is least along the ``directions`` (k, m); the
    largest entry that is left."""
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


@_jit
def _include(direction, product, directions, products, k, x, rest):
    """Make a new ``direction`` (m,) and its ``product`` number ``k`` of the known ones, and go on along it, as in
    `_project`."""
    for j in range(k):
        known, theirs, share = directions[j], products[j], 0.0
        for i in range(len(rest)):
            share += theirs[i] * product[i]
        for i in range(len(rest)):
            direction[i] -= share * known[i]
            product[i] -= share * theirs[i]
    size = share = 0.0
    for i in range(len(rest)):
        size += product[i] * product[i]
        share += product[i] * rest[i]
    # What has no product leads nowhere: not a number, which whoever asks takes for a failure.
    scale = 1.0 / np.sqrt(size) if size > 0.0 else np.nan
    share *= scale
    mine, its = directions[k], products[k]
    for i in range(len(rest)):
        mine[i], its[i] = scale * direction[i], scale * product[i]
        x[i] += share * mine[i]
        rest[i] -= share * its[i]
    return _largest(rest)


@_jit
def _largest(values):
    """The largest |value|; infinite where one is not a number."""
    largest, right = 0.0, True
    for i in range(len(values)):
        here = abs(values[i])
        right &= here < np.inf
        largest = max(largest, here)
    return largest if right else np.inf


class Directions:
    """Room for ``most`` directions of ``size`` unknowns, of which ``number`` are known, in the first numbers of ``room``
    if some is given; or the first ``most`` of the room of others, ``sharing``: what one of the two adds, the other has
    forgotten."""

    def __init__(self, size: int, most: int, sharing: Directions | None = None, room: np.ndarray | None = None) -> None:
        self._sharing = sharing
        if sharing is None:
            # Memory is taken as directions come.
            room = np.empty(2 * most * size) if room is None else room
            self._directions, self._products = room[: 2 * most * size].reshape(2, most, size)
        else:
            self._directions, self._products = sharing._directions[:most], sharing._products[:most]
            sharing._sharing = self
        self.number = 0

    def __len__(self) -> int:
        return len(self._directions)

    def forget(self) -> None:
        """The matrix is another."""
        self.number = 0

    def project(self, x: np.ndarray, rest: np.ndarray) -> float:
        """Take ``x`` (m,) and its residual ``rest`` (m,) as near as the known directions lead; the largest entry of the
        residual."""
        return _project(self._directions[: self.number], self._products[: self.number], x, rest)

    def add(self, direction: np.ndarray, product: np.ndarray, x: np.ndarray, rest: np.ndarray) -> float:
        """`project` along one more ``direction`` (m,) with the ``product`` A d; both are overwritten. The oldest are
        forgotten where there is no room."""
        if self.number == len(self):
            self.forget()
        if self._sharing is not None:
            self._sharing.forget()
        self.number += 1
        return _include(direction, product, self._directions, self._products, self.number - 1, x, rest)
