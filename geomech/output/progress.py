"""What a run shows while it runs: a bar on a terminal, a line every few seconds elsewhere, a few lines at the end."""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from geomech.model import Cycle, Problem


class Progress:
    """Observer for people. On a terminal it draws a tqdm bar over the scene's time; the time left is what the whole
    scene would take, and a scene that stops at an event ends sooner. ``quiet`` leaves only errors.

    ``stream`` defaults to stderr; ``interval`` s is the least time between two lines off a terminal.
    """

    def __init__(self, *, quiet: bool = False, stream: TextIO | None = None, interval: float = 5.0) -> None:
        self.quiet, self.stream, self.interval = quiet, stream, interval

    def on_start(self, problem: Problem, folder: Path) -> None:
        self._out = self.stream or sys.stderr
        self._folder, self._end = Path(folder), problem.run.end_time
        self._said = time.perf_counter()
        self._bar = None
        if not self.quiet and self._out.isatty():
            from tqdm import tqdm

            self._bar = tqdm(
                total=self._end,
                file=self._out,
                desc=problem.title[:40],
                bar_format="{desc}: {percentage:3.0f}%|{bar}| {postfix} [{elapsed}<{remaining}]",
                postfix="starting",
                mininterval=0.1,
                dynamic_ncols=True,
            )
        elif not self.quiet:
            self._say(f"{problem.title}: {problem.blocks.n_blocks} blocks, {problem.cracks.n_cracks} cracks → {folder}")

    def on_cycle(self, cycle: Cycle) -> None:
        if self.quiet:
            return
        now = time.perf_counter()
        if self._bar is not None:
            # The text is made only as often as the bar is drawn.
            if now - self._said >= self._bar.mininterval:
                self._said = now
                self._bar.set_postfix_str(_told(cycle), refresh=False)
            self._bar.update(max(0.0, min(cycle.state.time, self._end) - self._bar.n))
        elif now - self._said >= self.interval:
            self._said = now
            self._say(f"  {100 * cycle.state.time / self._end:3.0f} %  {_told(cycle)}")

    def on_end(self, summary: dict[str, Any], error: BaseException | None = None) -> None:
        if self._bar is not None:
            self._bar.close()
        if error is not None:
            why = "interrupted" if isinstance(error, KeyboardInterrupt) else f"failed: {error or type(error).__name__}"
            self._say(f"{why}\n  what was written until then is in {self._folder}")
        elif not self.quiet:
            self._say("\n".join(closing_lines(summary, self._folder)))

    def _say(self, text: str) -> None:
        self._out.write(text + "\n")
        self._out.flush()


def closing_lines(summary: dict[str, Any], folder: Path) -> list[str]:
    """The few lines that end a run: why it ended, at what loads, how long it took, where the files are."""
    lines = [f"{summary.get('title', 'run')}: {summary.get('end', 'done')}"]
    for kind, first in summary.get("first", {}).items():
        load = first.get("load_pa")
        text = f"  {kind:<13}" + (f" {load / 1e6:8.3f} MPa" if load is not None else "")
        if first.get("load_normalised") is not None:
            text += f"   σ√(πb)/K_Ic = {first['load_normalised']:.3f}"
        count = summary.get("events", {}).get(kind, 1)
        lines.append(text + (f"   (first of {count})" if count > 1 else ""))
    if "cycles" in summary:
        lines.append(
            f"  {summary['load_steps']} load steps, {summary['growing_cycles']} cycles with growth, "
            f"{1e3 * summary['crack_growth_m']:.3g} mm of new crack in {summary.get('wall_s', math.nan):.2f} s"
        )
    return [*lines, f"  {folder}"]


def _told(cycle: Cycle) -> str:
    growing = int(np.count_nonzero(cycle.tips["grown"] > 0))
    text = f"load {cycle.load / 1e6:.2f} MPa, cycle {cycle.number}"
    return text + (f", {growing} of {len(cycle.tips)} tips growing" if len(cycle.tips) else "")
