"""Round-off of coordinates and the contact forces it causes: springs are so stiff that the last digits of a gap
count."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np

from .tolerances import NOTABLE, NOTHING

log = logging.getLogger(__name__)

#: Round-off of coordinates and gaps over the largest coordinate.
_ROUNDING = 5e-16
#: In dynamic steps, gaps below this many times the round-off do not decide contact states, where their forces are
#: nothing beside the loads nearby. (In walls and slopes of 1 000 to 40 000 blocks at rest, one step in one to three has a
#: contact that exceeds the round-off, by 1.3 times it at most, and costs one more solution.) Of a sliver the force of the
#: round-off alone may be more: a contact that is let pull by it moves the sliver by a millionth of its free fall.
_WANDERS = 4.0


def rounding_of(vertices: np.ndarray) -> float:
    """Round-off of the coordinates of ``vertices`` (n, 2) and of gaps between them, m."""
    return _ROUNDING * float(np.abs(vertices).max())


#: What `warn_of_roundoff` warns of, once.
ROUND_OFF = "round-off"


def undecided_gaps(
    rounding: float, right: np.ndarray, order: np.ndarray, block: np.ndarray, other: np.ndarray, normal: np.ndarray
) -> np.ndarray:
    """(n,) gaps that do not decide contact states in dynamic steps, m.

    A multiple of the ``rounding`` (m), or the gap whose force is negligible compared with the loads of the blocks, if that
    is less: within a step, starting gaps are given numbers, whose round-off decides nothing by itself. Contacts between
    ``block`` and ``other`` (n,) have springs ``normal`` (n,) N/m²; ``right`` (n_free, 6) are the blocks' loads, N/m, in
    their ``order`` (n_blocks,). The round-off alone would make a pebble far from the origin stick."""
    load = np.append(np.abs(right).max(axis=1, initial=0.0), np.inf)
    least = np.minimum(load[order[block]], load[order[other]])
    return np.minimum(NOTHING * least / np.maximum(normal, 1e-300), _WANDERS * rounding)


def warn_of_roundoff(
    rounding: float, weight: np.ndarray, block: np.ndarray, other: np.ndarray, normal: np.ndarray, names: Sequence[str]
) -> None:
    """Warn of the block whose weight is smallest relative to the contact forces that ``rounding`` (m) causes.

    ``weight`` (n_blocks,) N/m, infinite for fixed blocks; ``normal`` (n,) N/m² of the contacts between ``block`` and
    ``other`` (n,). Such a block may stick where it should just slide."""
    if not len(block):
        return
    least = np.minimum(weight[block], weight[other])
    share = rounding * normal / np.maximum(least, 1e-300)
    c = int(np.argmax(share))
    if share[c] <= NOTABLE or least[c] == 0.0:
        return
    light = block[c] if weight[block[c]] <= weight[other[c]] else other[c]
    log.warning(
        "%r weighs %.3g N/m; round-off of coordinates up to %.3g m from the origin changes its contact forces by %.2g of "
        "that, and its friction, and bonds that it breaks first, are no more accurate: put the origin near, lower "
        "dda.normal_penalty, or merge such blocks (geometry.smallest_block_m2)",
        names[light], least[c], rounding / _ROUNDING, share[c],
    )  # fmt: skip
