"""Blocks strained beyond what linear elasticity can tell."""

from __future__ import annotations

import logging

import numpy as np

from ...model import Blocks, Motion
from ..results import NotConverged

log = logging.getLogger(__name__)

#: Rock is elastic up to strains of some thousandths; a block whose strain reaches this part is told of …
BEYOND = 1e-2
#: … and one that reaches this part ends the run: it is no linear elastic body, and its cracks would be solved for on
#: another body than the one that moves.
REFUSED = 0.25


class ElasticRange:
    """The largest strain of any block so far, ``told`` as it passes `BEYOND`, and again whenever it has doubled."""

    def __init__(self) -> None:
        self.told = 0.5 * BEYOND

    def check(self, motion: Motion, blocks: Blocks, time: float) -> float:
        """The largest strain; logs a warning that names the block, where it is large. Raises `NotConverged` beyond
        `REFUSED`."""
        gradient = motion.gradient
        strain = 0.5 * np.abs(gradient.transpose(0, 2, 1) @ gradient - np.eye(2)).max(axis=(1, 2))
        strain[blocks.fixed] = 0.0
        b = int(np.argmax(strain))
        most, name = float(strain[b]), blocks.names[b] if blocks.names else f"block {b}"
        if most > REFUSED:
            raise NotConverged(
                f"{name} is strained by {100 * most:.3g} % at t = {time:g} s: no linear elastic body. Its loads are "
                "beyond its stiffness, or it hangs by a thread of rock: shorten the time step, or cut it where it hangs"
            )
        if most >= 2.0 * self.told:
            self.told = most
            log.warning(
                "t = %g s: %s is strained by %.3g %%, beyond the elastic range of rock: what it and its cracks do is a "
                "guess",
                time, name, 100 * most,
            )  # fmt: skip
        return most
