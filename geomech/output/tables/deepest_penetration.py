"""Deepest contact penetration during a run, with its blocks and location; and what shortened the steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from geomech.model import OPEN, Cycle, Shortened


@dataclass(eq=False)
class Deepest:
    """The deepest penetration of any cycle, relative to the smaller block's size √area."""

    share: float = 0.0
    summary: dict[str, Any] | None = None

    def look(self, cycle: Cycle) -> None:
        rows = cycle.state.contacts
        deep = np.where(rows["state"] != OPEN, -rows["gap"], 0.0)
        if not len(deep) or deep.max() <= 0.0:
            return
        size = np.sqrt(cycle.blocks.areas())
        share = deep / np.minimum(size[rows["block"]], size[rows["other"]])
        worst = int(np.argmax(share))
        if share[worst] <= self.share:
            return
        names = [cycle.blocks.names[int(rows[name][worst])] for name in ("block", "other")]
        self.share = float(share[worst])
        self.summary = {
            "depth_m": float(deep[worst]), "over_block_size": self.share, "blocks": names,
            "point": rows["point"][worst].tolist(), "time_s": float(cycle.state.time),
        }  # fmt: skip


def step_limits(shortened: tuple[Shortened, ...]) -> list[dict[str, Any]]:
    """Reasons why steps were shortened, the most frequent first, for ``summary.json``."""
    return [{"why": s.why, "blocks": list(s.blocks), "count": s.count, "way_out": s.way_out} for s in shortened]


def limits_line(limits: list[dict[str, Any]], steps: int) -> list[str]:
    """A closing line for a run in which most steps were shortened."""
    if not limits or limits[0]["count"] <= 0.5 * steps:
        return []
    first = limits[0]
    blocks = " and ".join(map(repr, first["blocks"])) or "no one block"
    return [f"  steps shortened {first['count']} times by {blocks} ({first['why']}): {first['way_out']}"]
