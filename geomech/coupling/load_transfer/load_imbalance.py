"""Loads of cracked blocks that are not quite in balance: stress intensity factors are as uncertain."""

from __future__ import annotations

import logging
from collections.abc import Mapping

from ...model import Blocks
from .boundary_tractions import BoundaryLoad

log = logging.getLogger(__name__)

#: What is left of force and moment, over their size, is told of beyond this and the strain: contacts that are pressed
#: in, or stand apart, act off the outline by as much as blocks are strained.
BEYOND = 1e-5


class LoadBalance:
    """The largest imbalance of any block so far, ``reported`` as it passes what is allowed, and again whenever it has
    doubled."""

    def __init__(self) -> None:
        self.reported = 0.0
        self.strain = 0.0

    def check(self, loads: Mapping[int, BoundaryLoad], blocks: Blocks, strain: float, time: float) -> None:
        """Log a warning that names the block whose ``loads`` (block →) are worst, if they are off by more than the
        largest ``strain`` so far allows."""
        self.strain = max(self.strain, strain)
        if not loads:
            return
        b = max(loads, key=lambda block: loads[block].imbalance)
        most = loads[b].imbalance
        if most > max(BEYOND + self.strain, 2.0 * self.reported):
            self.reported = most
            log.warning(
                "t = %g s: the forces on %s that its cracks are solved for are out of balance by %.1e of their size; "
                "its stress intensity factors are as uncertain",
                time, blocks.names[b] if blocks.names else f"block {b}", most,
            )  # fmt: skip
