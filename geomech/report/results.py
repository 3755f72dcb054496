"""A finished run in Python: tables as pandas DataFrames, series as PyVista meshes, pictures, a page in a notebook."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..output import Run
from ..output.reading import read_table

if TYPE_CHECKING:
    import pandas
    import pyvista

    from ..player.widget import RunPlayer

#: Entries of the summary shown in a notebook, if the run has them.
_SHOWN = ("end", "time_s", "peak_load_pa", "wall_s")


def open_run(folder: str | Path) -> RunResults:
    """The run in ``folder``, as far as it has come; it may still be running or have failed.

    Raises FileNotFoundError if there is none, naming the runs below the folder, if any.

    >>> results = geomech.open_run("outputs/slope")
    >>> results.history[["time", "open_close_iterations"]].shape
    (3, 2)
    >>> sorted(results.series)[:2]
    ['blocks', 'contacts']
    >>> results.mesh("blocks", time=0.2).point_data["displacement"].shape
    (8, 3)
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileNotFoundError(f"there is no folder {folder}")
    if not (folder / "history.csv").is_file():
        below = sorted(str(path.parent) for path in folder.glob("*/history.csv"))
        raise FileNotFoundError(
            f"{folder} holds no run"
            + (f"; there are runs in {', '.join(below)}" if below else ": history.csv is missing")
        )
    return RunResults(Run(folder))


class RunResults:
    """Results of a run in its folder, read lazily; units as in the files (SI)."""

    def __init__(self, run: Run) -> None:
        self._run = run

    def __repr__(self) -> str:
        return f"<run {self.title!r} in {self.folder}: {len(self._run.history)} cycles>"

    @property
    def folder(self) -> Path:
        """The run's folder."""
        return self._run.folder

    @property
    def title(self) -> str:
        """The scene's title, or the folder's name."""
        return self._run.title

    @property
    def summary(self) -> dict[str, Any]:
        """``summary.json``; empty during the run."""
        return self._run.summary

    @property
    def scene(self) -> dict[str, Any]:
        """The resolved scene, with all defaults filled in."""
        return self._run.scene

    @cached_property
    def history(self) -> pandas.DataFrame:
        """One row per cycle: time (s), load (Pa), energies (J/m), displacements of monitors (m), …"""
        return _frame(self._run.history)

    @cached_property
    def tips(self) -> pandas.DataFrame:
        """One row per crack tip and cycle: K_I, K_II, K_eq (Pa √m), location (m), growth (m)."""
        return _frame(self._run.tips)

    @cached_property
    def events(self) -> pandas.DataFrame:
        """One row per event: kind, cycle, time (s), load (Pa), location (m), detail."""
        return _frame(self._run.events)

    @cached_property
    def joints(self) -> pandas.DataFrame:
        """One row per joint and cycle, if the run has written ``joints.csv``: lengths, openings and slips (m), forces
        (N/m)."""
        return _frame(read_table(self.folder / "joints.csv", ("cycle", "time")))

    @property
    def series(self) -> list[str]:
        """The written ParaView series, by name."""
        from ..output.fields import SERIES

        return [name for name in SERIES if self._run.series(name)]

    def mesh(self, series: str = "blocks", cycle: int | None = None, time: float | None = None) -> pyvista.DataSet:
        """A ``series`` as a PyVista mesh at a ``cycle`` or ``time`` (s), or at the last one written before it.

        Without either, the end of the run. Raises KeyError for a series that was not written and a time before its
        first cycle.
        """
        if series not in self.series:
            raise KeyError(f"{self.folder} has no series {series!r}; it has {', '.join(self.series) or 'none'}")
        if cycle is not None and time is not None:
            raise ValueError("give a cycle or a time, not both")
        if cycle is None:
            written = self._run.history
            upto = np.inf if time is None else time * (1 + 1e-12)
            known = written["cycle"][written["time"] <= upto]
            if not len(known):
                raise KeyError(f"{self.folder}: nothing was written up to t = {time:g} s")
            cycle = int(known[-1])
        return self._run.grid(series, cycle)

    def plot(self, out: str | Path | None = None, **options: Any) -> list[Path]:
        """Draw the usual pictures, movie and curves into ``out`` (default: ``pictures`` in the run folder); returns
        their paths.

        ``options`` as of `geomech.render.draw`: component, width, movie.
        """
        from ..render import draw

        return draw(self._run, out, **options)

    def view(self, *others: RunResults, height: int = 860, megabytes: float = 4.0) -> RunPlayer:
        """The run as a notebook plays it, cycle by cycle, ``others`` beside it with one range of colours; as far as it has
        come. Raises ValueError where nothing was written that could be drawn.

        >>> geomech.open_run("outputs/two_cracks/phi_30").view()      # doctest: +SKIP
        """
        from ..player.widget import RunPlayer

        return RunPlayer([self._run, *(other._run for other in others)], height, megabytes)

    def _repr_html_(self) -> str:
        rows = [("folder", str(self.folder)), ("cycles", str(len(self._run.history)))]
        rows += [(key, str(self.summary[key])) for key in _SHOWN if self.summary.get(key) is not None]
        events = self._run.events
        if len(events):
            kinds, counts = np.unique(events["kind"], return_counts=True)
            rows.append(("events", ", ".join(f"{n} × {kind}" for kind, n in zip(kinds, counts, strict=True))))
        table = "".join(f"<tr><th>{html.escape(a)}</th><td>{html.escape(b)}</td></tr>" for a, b in rows)
        return f"<h4>{html.escape(self.title)}</h4><table>{table}</table>{_shown(self._pictures())}"

    def _pictures(self) -> Sequence[Path]:
        drawn = (self.folder / "pictures" / name for name in ("specimen.png", "displacement.png"))
        return [path for path in drawn if path.is_file()][:1]


def _shown(pictures: Sequence[Path]) -> str:
    coded = [base64.b64encode(path.read_bytes()).decode() for path in pictures]
    return "".join(f'<img style="max-width:30em" src="data:image/png;base64,{text}">' for text in coded)


def _frame(table: np.ndarray) -> pandas.DataFrame:
    try:
        import pandas
    except ImportError as error:
        raise ImportError(
            "tables are pandas DataFrames: `pip install pandas`; without it use `geomech.output.Run(folder)`, which "
            "has NumPy arrays"
        ) from error
    frame = pandas.DataFrame(table)
    for name in ("cycle", "crack", "end", "tip", "load_step", "growth_pass"):
        if name in frame and frame[name].notna().all() and frame[name].dtype.kind == "f":
            frame[name] = frame[name].astype(int)
    return frame
