"""Warns of boundary loads that are not in equilibrium, which causes a relative error of the same size in stress
intensity factors."""

from __future__ import annotations

import logging
from collections.abc import Mapping

from ...model import Blocks
from .boundary_tractions import BoundaryLoad

log = logging.getLogger(__name__)

#: Imbalance of force and moment, relative to the forces, that is reported when it exceeds this plus the largest strain:
#: contacts with overlap or gap act off the outline by as much as blocks are strained.
BEYOND = 1e-5


class LoadBalance:
    """The largest imbalance of any block so far. ``reported``: value at the last warning; the next warning follows when
    it has doubled."""

    def __init__(self) -> None:
        self.reported = 0.0
        self.strain = 0.0

    def check(self, loads: Mapping[int, BoundaryLoad], blocks: Blocks, strain: float, time: float) -> None:
        """Warn of the block whose boundary load is furthest from equilibrium, if the imbalance exceeds what the largest
        ``strain`` so far explains. ``loads``: block → load; ``time`` s."""
        self.strain = max(self.strain, strain)
        if not loads:
            return
        b = max(loads, key=lambda block: loads[block].imbalance)
        most = loads[b].imbalance
        if most > max(BEYOND + self.strain, 2.0 * self.reported):
            self.reported = most
            log.warning(
                "t = %g s: the forces on %s are out of balance by %.1e of their size; the stress intensity factors of "
                "its cracks have an error of the same order",
                time, blocks.names[b], most,
            )  # fmt: skip
