"""What the rounding of coordinates makes of contacts: springs are so stiff that they feel the last digits of a gap."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np

log = logging.getLogger(__name__)

#: Coordinates, and gaps between them, are rounded to this part of the largest one.
_ROUNDING = 5e-16
#: What rounding leaves of one step the next goes on from: gaps of so many times the rounding decide nothing in motion
#: where the forces they make are so small a part of the loads about them. (Walls and slopes of 1 000 to 40 000 blocks
#: at rest have a contact in every third to every step that oversteps the rounding, by 1.3 times it at most, and the
#: equations are solved once more for it.)
_WANDERS, _NOTHING = 4.0, 1e-3
#: A block is told whose contacts feel more than this part of its weight.
_FELT = 1e-2


def rounding_of(vertices: np.ndarray) -> float:
    """m: the rounding of ``vertices`` (n, 2) m and of what is between them."""
    return _ROUNDING * float(np.abs(vertices).max())


def undecided_gaps(
    rounding: float, right: np.ndarray, order: np.ndarray, block: np.ndarray, other: np.ndarray, normal: np.ndarray
) -> np.ndarray:
    """(n,) m: gaps that decide nothing about the states in motion of contacts between ``block`` and ``other`` (n,) with
    springs ``normal`` (n,) N/m²: the ``rounding`` (m), and more of it where that is nothing beside what the blocks bear,
    ``right`` (n_free, 6) N/m in their ``order`` (n_blocks,). (A pebble far from the origin would stick by what holds
    a wall's bricks still.)"""
    load = np.append(np.abs(right).max(axis=1, initial=0.0), np.inf)
    least = np.minimum(load[order[block]], load[order[other]])
    return np.clip(_NOTHING * least / np.maximum(normal, 1e-300), rounding, _WANDERS * rounding)


def tell_felt(
    rounding: float, weight: np.ndarray, block: np.ndarray, other: np.ndarray, normal: np.ndarray, names: Sequence[str]
) -> None:
    """Warn of the block, by its name, that is lightest beside what the ``rounding`` makes of the springs of its
    contacts; ``weight`` (n_blocks,) N/m, infinite for fixed blocks. Such a block may stand where it should just
    slide."""
    if not len(block):
        return
    least = np.minimum(weight[block], weight[other])
    share = rounding * normal / np.maximum(least, 1e-300)
    c = int(np.argmax(share))
    if share[c] <= _FELT or least[c] == 0.0:
        return
    light = block[c] if weight[block[c]] <= weight[other[c]] else other[c]
    log.warning(
        "%r weighs %.3g N per metre; the last digits of coordinates, up to %.3g m from the origin, make %.2g of that in "
        "its contact springs, and its friction is known no better: put the origin near, or lower dda.normal_penalty",
        names[light], least[c], rounding / _ROUNDING, share[c],
    )  # fmt: skip
