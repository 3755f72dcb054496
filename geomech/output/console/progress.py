"""Progress of a run: a bar on a terminal, a line every few seconds elsewhere, and a few lines at the end."""

from __future__ import annotations

import logging
import math
import os
import sys
import textwrap
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from geomech.model import STOPS, Cycle, Problem, counted, duration_text

from ..checkpoints import checkpoint_file
from ..tables.deepest_penetration import limits_line
from ..tables.motion_state import closing, state_text
from ..units import length_text, stress_text
from .at_work import note_output
from .pace import Compiled, Course, Pace, name_of_run

#: Number of warnings shown at the end of a run, and the largest length of each.
SHOWN_WARNINGS, WIDTH = 3, 400


#: For a static run in which blocks keep sliding or rotating.
NO_ANSWER = "since the mechanism the displacements of blocks have no meaning: nothing holds the blocks (events.csv)"


class Warned(logging.Handler):
    """Counts geomech's warnings between its construction and `end`, and keeps the first of each kind."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.count = 0
        self.first: dict[str, str] = {}
        logging.getLogger("geomech").addHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        # Warnings about the scene were shown before the run; how it ended is shown after it.
        if record.name in ("geomech.pipeline", "geomech.output.run_record"):
            return
        self.count += 1
        self.first.setdefault(str(record.msg), record.getMessage())

    def end(self) -> None:
        logging.getLogger("geomech").removeHandler(self)

    def lines(self) -> list[str]:
        if not self.count:
            return []
        shown = [textwrap.shorten(text, WIDTH, placeholder=" …") for text in list(self.first.values())[:SHOWN_WARNINGS]]
        return [f"  {counted(self.count, 'warning')} in run.log" + (", such as" if self.count > len(shown) else ""),
                *(f"    {text}" for text in shown)]  # fmt: skip


class Progress:
    """Observer that reports progress.

    On a terminal it draws a tqdm bar over the scene's time, elsewhere a line from time to time. The time left follows
    from the `Course` of an earlier run of the scene, else from the recent `Pace`: a range where that is uneven. If
    cracks may end a first run by an event there is no estimate. ``quiet`` reports only where a failed run stopped. ``stream`` is stderr by default; ``interval`` s is the least time between
    two lines when not on a terminal, twice that between two with the same percentage.
    """

    def __init__(self, *, quiet: bool = False, stream: TextIO | None = None, interval: float = 5.0) -> None:
        self.quiet, self.stream, self.interval = quiet, stream, interval

    def on_start(self, problem: Problem, folder: Path) -> None:
        self._warnings = Warned()
        self._out = self.stream or sys.stderr
        self._folder, self._end = Path(folder), problem.run.end_time
        self._stops = problem.run.stop_at
        self._last_shown = self._began = time.perf_counter()
        self._percent = -1
        self._last: Cycle | None = None
        self._pace, self._course, self._problem = Pace(), Course(), problem
        self._earlier, self._compiled = Course.found(name_of_run(problem)), Compiled()
        self._whole = True  # from the first cycle on: not resumed
        self._bar = None
        if not self.quiet and self._out is not None and self._out.isatty():
            from tqdm import tqdm

            self._bar = tqdm(
                total=self._end,
                file=self._out,
                desc=problem.title[:40],
                bar_format="{desc}: {percentage:3.0f}%|{bar}| [{elapsed}{postfix}]",
                postfix="starting",
                mininterval=0.1,
                dynamic_ncols=True,
            )
        elif not self.quiet:
            self._say(f"{problem.title}: {problem.inventory} → {folder}")

    def memory(self) -> tuple[int, float] | None:
        return None if self._last is None else (self._last.number, float(self._last.state.time))

    def on_resume(self, problem: Problem, folder: Path, memory: tuple[int, float] | None) -> None:
        self.on_start(problem, folder)
        self._whole = False
        if memory is not None and self._bar is not None:
            self._bar.update(memory[1])
        elif memory is not None and not self.quiet:
            self._say(f"  resumed after cycle {memory[0]}, t = {memory[1]:.4g} s")

    def on_cycle(self, cycle: Cycle) -> None:
        self._last = cycle
        if self.quiet:
            return
        now = time.perf_counter()
        if cycle.state.time > 0:  # from the first load step on: that step may have compiled kernels and does not count
            self._pace.add(now, float(cycle.state.time))
        self._course.add(cycle.number, now - self._began, float(cycle.state.time))
        if self._bar is not None:
            # The text is made only when the bar is drawn.
            if now - self._last_shown >= self._bar.mininterval:
                self._last_shown = now
                # The time left comes first: a narrow terminal cuts off the end.
                postfix = f"{self._left(cycle).removeprefix(', ')}, {_cycle_text(cycle)}"
                self._bar.set_postfix_str(postfix.removeprefix(", "), refresh=False)
                note_output()
            with suppress(OSError):  # the terminal is gone
                self._bar.update(max(0.0, min(cycle.state.time, self._end) - self._bar.n))
        elif now - self._last_shown >= self.interval:
            percent = self._share(cycle)
            if percent == self._percent and now - self._last_shown < 2 * self.interval:
                return
            self._last_shown, self._percent = now, percent
            self._say(f"  {percent:3d} %  {_cycle_text(cycle)}{self._left(cycle)}")

    def on_end(self, summary: dict[str, Any], error: BaseException | None = None) -> None:
        self._warnings.end()
        self._compiled.end()
        if error is None and self._whole and not self._compiled.any:
            self._course.keep(name_of_run(self._problem))
        if self._bar is not None:
            with suppress(OSError):
                self._bar.close()
        if error is not None:
            # The exception says why it stopped, to its handler.
            last = self._last
            where = "before the first cycle" if last is None else f"at {self._share(last)} %, {_cycle_text(last)}"
            self._say(f"stopped {where}\n  results up to this point are in {self._folder}")
            if isinstance(error, (KeyboardInterrupt, OSError)) and checkpoint_file.found(
                self._folder / checkpoint_file.FOLDER
            ):
                self._say(f"  to continue: geomech resume {self._folder}")
        elif not self.quiet:
            self._say("\n".join([*closing_lines(summary, self._folder), *self._warnings.lines()]))

    def _share(self, cycle: Cycle) -> int:
        return round(100 * min(cycle.state.time, self._end) / self._end)

    def _left(self, cycle: Cycle) -> str:
        """Wall time left of the run; empty if it is not known.

        A run with cracks that ends with an event stops long before the end of the scene, at a time known only from an
        earlier run: the text names the event.
        """
        seconds = math.inf if self._earlier is None else self._course.left_as(self._earlier)
        event = f", until {' or '.join(self._stops)}" if self._stops and cycle.cracks.n_cracks else ""
        if 0.5 <= seconds < math.inf:
            return f", about {duration_text(seconds)} left, as in an earlier run{event}"
        if event:
            return event
        least, most = self._pace.time_for(self._end - float(cycle.state.time))
        if not 0.5 <= most < math.inf:
            return ""
        if least == most:
            return f", about {duration_text(most)} left"
        return f", {duration_text(least)} to {duration_text(most)} left"

    def _say(self, text: str) -> None:
        if self._out is None:
            return
        note_output()
        try:
            self._out.write(text + "\n")
            self._out.flush()
        except UnicodeEncodeError:
            self._out.write(text.encode("ascii", "replace").decode() + "\n")
        except (OSError, ValueError):
            # The text cannot be shown: a full disk, a closed stream, a terminal that is gone. The run continues.
            if self._out is sys.stderr:
                sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
            self._out = None


def closing_lines(summary: dict[str, Any], folder: Path) -> list[str]:
    """The lines that end a run: the reason, the loads of events (times, if no load leads), the duration, the folder."""
    lines = [f"{summary.get('title', 'run')}: {summary.get('end', 'done')}"]
    if "not_reached" in summary:
        lines.append(f"  {summary['not_reached']}")
    for kind, first in summary.get("first", {}).items():
        # Without a leading load the load is 0: the scene is driven by time.
        load = first.get("load_pa")
        text = f"  {kind:<13} " + (f"{stress_text(load):>12}" if load else f"t = {first['time_s']:.4g} s")
        text += " in tension" if load and load < 0 else ""
        if load and first.get("load_normalised") is not None:
            text += f"   σ√(πb)/K_Ic = {first['load_normalised']:.3f}"
        count = summary.get("events", {}).get(kind, 1)
        lines.append(text + (f"   (first of {count})" if count > 1 else ""))
    if "cycles" in summary and "key_blocks" in summary:
        lines += closing(summary)
        lines.append(f"  {counted(summary['load_steps'], 'load step')} in {summary.get('wall_s', math.nan):.2f} s")
    elif "cycles" in summary:
        lines.append(
            f"  {counted(summary['load_steps'], 'load step')}, {counted(summary['growing_cycles'], 'cycle')} with "
            f"growth, {length_text(summary['crack_growth_m'])} of new crack in {summary.get('wall_s', math.nan):.2f} s"
        )
    lines += limits_line(summary.get("shortened_steps", []), summary.get("load_steps", 0))
    if "mechanism" in summary.get("first", {}):
        lines.append(f"  {NO_ANSWER}")
    if summary.get("end") in STOPS and summary["end"] != "mechanism":
        lines.append(_way_on(summary, folder))
    return [*lines, f"  {folder}"]


def _way_on(summary: dict[str, Any], folder: Path) -> str:
    """How to continue a run beyond the event that ended it."""
    size = summary.get("checkpoint_not_kept_mb")
    if size is None:
        return f"  to continue beyond it: geomech resume {folder} --set 'run.stop_at=[]'"
    return f"  to continue beyond it: run again with --set output.checkpoint_kept_mb={math.ceil(size)}, then geomech resume"


def _cycle_text(cycle: Cycle) -> str:
    if not cycle.cracks.n_cracks:
        return f"t = {cycle.state.time:.4g} s, {state_text(cycle)}"
    tips = cycle.latest_tips
    growing = int(np.count_nonzero(tips["grown"] > 0))
    # Before a load begins, or without a leading one, the scene is driven by time.
    pulled = " in tension" if cycle.load < 0 else ""
    drive = f"load {stress_text(cycle.load, 3)}{pulled}" if cycle.load else f"t = {cycle.state.time:.4g} s"
    text = f"{drive}, cycle {cycle.number}"
    return text + (f", {growing} of {len(tips)} tips growing" if len(tips) else "")
