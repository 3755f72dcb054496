"""Limits of block strain: a warning beyond the range of linear elasticity, and the end of the run far beyond it."""

from __future__ import annotations

import logging

import numpy as np

from ...model import Blocks, Motion
from ..results import NotConverged
from .tolerances import NOTABLE

log = logging.getLogger(__name__)

#: Strain beyond which a block is reported: rock is elastic up to strains of some thousandths.
BEYOND = NOTABLE
#: Strain at which the run ends: the block is no linear elastic body any more, and its cracks are solved on the
#: undeformed one.
REFUSED = 0.25


class ElasticRange:
    """Largest strain of any block so far; a warning when it passes `BEYOND`, and each time it has doubled since."""

    def __init__(self) -> None:
        self.reported = 0.5 * BEYOND

    def check(self, motion: Motion, blocks: Blocks, time: float) -> float:
        """Return the largest strain; log a warning that names the block where it is large.

        Raises `NotConverged` beyond `REFUSED`."""
        gradient = motion.gradient
        strain = 0.5 * np.abs(gradient.transpose(0, 2, 1) @ gradient - np.eye(2)).max(axis=(1, 2))
        strain[blocks.fixed] = 0.0
        b = int(np.argmax(strain))
        most, name = float(strain[b]), blocks.names[b]
        if most > REFUSED:
            raise NotConverged(
                f"{name} is strained by {100 * most:.3g} % at t = {time:g} s: beyond linear elasticity. Its loads "
                "are too large for its stiffness, or it hangs by a thin bridge of rock: shorten the time step, or cut "
                "the bridge"
            )
        if most >= 2.0 * self.reported:
            self.reported = most
            log.warning(
                "t = %g s: %s is strained by %.3g %%, beyond the elastic range of rock: its behaviour and "
                "that of its cracks are unreliable",
                time, name, 100 * most,
            )  # fmt: skip
        return most
