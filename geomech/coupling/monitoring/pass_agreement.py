"""Warning about static passes that end before blocks and their cracks agree."""

from __future__ import annotations

import logging

import numpy as np

log = logging.getLogger(__name__)

#: Relative mismatch of crack strain (`load_pass`) in a static pass above which a warning is given: that up to which the passes
#: themselves take blocks and cracks to agree (`load_pass.AGREED`). It is usually below 1e-6; in motion the next step corrects what
#: remains, whereas static friction remembers it. (Random slope 1: 1.1 % in one pass, after which rounding decides what slips.)
DISAGREES = 0.01


class AgreementWatch:
    """Warns of a pass whose assumed and found crack strains differ by more than `DISAGREES`, and again whenever their
    difference has doubled."""

    def __init__(self) -> None:
        self._reported = DISAGREES

    def check(self, names: list[str], mismatch: np.ndarray, time: float) -> None:
        """``mismatch`` (n,) of the cracked blocks ``names`` in a pass at the load of ``time``, s."""
        worst = float(mismatch.max(initial=0.0))
        if not worst > self._reported:
            return
        self._reported = 2.0 * worst
        log.warning(
            "t = %g s: %s and its cracks agree only to %.2g of their strain (compliance_mismatch in history.csv), because "
            "contacts or crack faces change their states back and forth from pass to pass. K there is uncertain by as much, "
            "and displacements and crack paths after it too, since friction depends on what was before: take smaller "
            "load steps, and compare with a run that is repeated (--repeat noise)",
            time,
            names[int(np.argmax(mismatch))],
            worst,
        )
