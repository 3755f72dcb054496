"""Curves of a run: load against strain, stress intensity factors and crack length against load; where there is no load
or nothing cracks, energies and the monitors' ways against time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from geomech.output.reading import Run

from .look import final_cycle

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: One a curve.
COLOURS = ("#1f6f8b", "#c8553d", "#588157", "#8d6a9f", "#b08900", "#3d405b")
#: Curves nearer than this part of the largest value are one on paper.
_SAME = 0.01


#: Parts of the energy budget in the order they are drawn, and what they are called.
_ENERGIES = {
    "elastic_energy": "elastic",
    "contact_energy": "contacts",
    "kinetic_energy": "kinetic",
    "crack_work": "cracks",
    "friction_loss": "friction",
    "damping_loss": "damping",
    "bond_loss": "broken bonds",
    "scheme_loss": "time scheme",
    "overlap_energy": "overlaps",
}


def plots(run: Run, folder: Path, *, suffix: str = ".png", more: bool = False) -> list[Path]:
    """Draw the curves that ``run`` has data for as files in ``folder``; their paths. ``suffix`` ".svg" draws lines that
    stay sharp; ``more`` draws energies and monitors as well."""
    history, tips = run.history, run.tips
    several = len(history) > 1
    wanted = {
        "stress_strain": (stress_strain, several and run.led and np.isfinite(history["strain"]).sum() > 1),
        "stress_intensity": (stress_intensity, several and len(tips) > 0),
        "crack_length": (crack_length, several and len(tips) > 0),
        "energy": (energies, more and bool(_energy_curves(run))),
        "monitors": (monitors, more and bool(_monitor_curves(run))),
    }
    return [
        _save(curve, run, (folder / name).with_suffix(suffix)) for name, (curve, has_data) in wanted.items() if has_data
    ]


def energies(axes: Axes, run: Run) -> None:
    """What the work of loads and gravity went into, against time: curves below a hundredth of the largest are left
    out."""
    history = _to_the_end(run)
    for k, (name, energy) in enumerate(_energy_curves(run).items()):
        axes.plot(history["time"], energy, color=COLOURS[k % len(COLOURS)], lw=1.5, label=name)
    # Beside the curves: there is no corner that one of them does not reach.
    axes.legend(frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    axes.set(xlabel="time, s", ylabel="energy, J/m", title=run.title)


def _energy_curves(run: Run) -> dict[str, np.ndarray]:
    history = _to_the_end(run)
    work = [history[name] for name in ("load_work", "gravity_work") if name in history.dtype.names]
    curves = {"work done": np.nansum(work, axis=0)} if work else {}
    curves |= {told: history[name] for name, told in _ENERGIES.items() if name in history.dtype.names}
    largest = max((float(np.nanmax(np.abs(curve), initial=0.0)) for curve in curves.values()), default=0.0)
    return {
        name: curve
        for name, curve in curves.items()
        if np.nanmax(np.abs(curve), initial=0.0) > max(_SAME * largest, 0.0)
    }


def monitors(axes: Axes, run: Run) -> None:
    """How far each monitored point has moved, against time."""
    history = _to_the_end(run)
    for k, (name, way) in enumerate(_monitor_curves(run).items()):
        axes.plot(history["time"], 1e3 * way, color=COLOURS[k % len(COLOURS)], lw=1.5, label=name)
    axes.legend(frameon=False, fontsize=8)
    axes.set(xlabel="time, s", ylabel="displacement, mm", title=run.title)


def _monitor_curves(run: Run) -> dict[str, np.ndarray]:
    history = _to_the_end(run)
    names = [
        name[:-3] for name in history.dtype.names if name.endswith("_ux") and f"{name[:-3]}_uy" in history.dtype.names
    ]
    return {name: np.hypot(history[f"{name}_ux"], history[f"{name}_uy"]) for name in names[: len(COLOURS)]}


def stress_strain(axes: Axes, run: Run) -> None:
    """The leading load against axial strain, both positive in compression (in tension, where that is what leads), with
    the run's events."""
    history, sign = _to_the_end(run), _sense(run)
    axes.plot(sign * 1e3 * history["strain"], sign * history["load"] / 1e6, color=COLOURS[0], lw=1.8)
    _first_events(axes, run, sign * 1e3 * history["strain"])
    lengthening = ", lengthening positive" if sign < 0 else ""
    axes.set(xlabel=f"axial strain, 10⁻³{lengthening}", ylabel=_load_label(run), title=run.title)


def compared(runs: Mapping[str, Run], path: Path) -> Path | None:
    """Draw load against axial strain of ``runs``, by name, into one file; None where none of them has both."""
    known = {
        name: run for name, run in runs.items() if (np.isfinite(run.history["load"] + run.history["strain"])).sum() > 1
    }
    if not known:
        return None

    def curves(axes: Axes, _: Run) -> None:
        for k, (name, run) in enumerate(known.items()):
            history, sign = _to_the_end(run), _sense(run)
            colour, line = COLOURS[k % len(COLOURS)], ("-", "--", ":")[k // len(COLOURS) % 3]
            axes.plot(
                1e3 * sign * history["strain"], sign * history["load"] / 1e6, color=colour, ls=line, lw=1.4, label=name
            )
        axes.legend(frameon=False, fontsize=8)
        axes.set(xlabel="axial strain, 10⁻³", ylabel="load, MPa")

    return _save(curves, next(iter(known.values())), path)


def stress_intensity(axes: Axes, run: Run) -> None:
    """K_I (full) and K_II (dashed) at every tip against load, or time where nothing leads: growth relieves a tip, the
    load drives it up again. Tips with the same curves share one; the toughness is a line across."""
    curves = _tip_curves(run)
    for k, (label, load, k_i, k_ii) in enumerate(curves):
        colour = COLOURS[k % len(COLOURS)]
        axes.plot(load, k_i, color=colour, lw=1.4, label=label)
        axes.plot(load, k_ii, color=colour, lw=1.0, ls="--")
    axes.plot([], [], color="#555555", lw=1.6, label=r"$K_I$")
    axes.plot([], [], color="#555555", lw=1.3, ls="--", label=r"$K_{II}$")
    axes.axhline(0, color="#999999", lw=0.6)
    toughness = run.summary.get("normalisation", {}).get("k_ic_pa_sqrt_m")
    if toughness:
        axes.axhline(toughness / 1e6, color="#222222", lw=0.9, ls=":", label=r"$K_{Ic}$")
    if len(curves) <= 8:
        axes.legend(frameon=False, fontsize=8)
    low, high = _calm_span(run)
    if toughness and high > low:
        # A crack that runs away leaves all others flat at the bottom, so it leaves the page instead.
        room = 2.0 * max(toughness / 1e6, high, -low)
        bottom, top = axes.get_ylim()
        axes.set_ylim(max(bottom, low - room), min(top, high + room))
    axes.set(xlabel=_drive_label(run), ylabel="stress intensity factor, MPa√m", title=run.title)


def _calm_span(run: Run) -> tuple[float, float]:
    """The least and the largest K_I or K_II, MPa√m, where the load has just gone up and nothing has grown at it."""
    calm = run.history["cycle"][run.history["growth_pass"] == 0]
    tips = run.tips[np.isin(run.tips["cycle"], calm)]
    every = np.concatenate([[0.0], tips["K_I"], tips["K_II"]]) / 1e6
    return float(np.nanmin(every)), float(np.nanmax(every))


def _tip_curves(run: Run) -> list[tuple[str, np.ndarray, np.ndarray, np.ndarray]]:
    """(label, load MPa or time s, K_I, K_II MPa√m) of every tip; one for all tips whose curves lie on one another."""
    tips = run.tips
    near = _SAME * float(np.nanmax(np.abs([tips["K_I"], tips["K_II"]]), initial=0.0))
    groups: list[tuple[list[tuple[int, int]], np.ndarray]] = []
    for crack, end in np.unique(np.stack([tips["crack"], tips["end"]], axis=1), axis=0).astype(int):
        mine = tips[(tips["crack"] == crack) & (tips["end"] == end)]
        for members, known in groups:
            if np.array_equal(known["cycle"], mine["cycle"]) and all(
                np.abs(known[name] - mine[name]).max() <= near for name in ("K_I", "K_II")
            ):
                members.append((crack, end))
                break
        else:
            groups.append(([(crack, end)], mine))
    n = sum(len(members) for members, _ in groups)
    return [
        (_tip_names(run, members, n), _drive(run, mine), mine["K_I"] / 1e6, mine["K_II"] / 1e6)
        for members, mine in groups
    ]


def _tip_names(run: Run, members: list[tuple[int, int]], n_tips: int) -> str:
    if len(members) == n_tips and n_tips > 2:
        return f"all {n_tips} tips"
    names = run.summary.get("cracks", [])
    parts = []
    for crack in dict.fromkeys(crack for crack, _ in members):
        ends = [end for other, end in members if other == crack]
        name = names[crack] if crack < len(names) else f"crack {crack}"
        parts.append(f"{name}, {'both tips' if len(ends) > 1 else ('start', 'end')[ends[0]]}")
    return "; ".join(parts)


def crack_length(axes: Axes, run: Run) -> None:
    """The length of all cracks against load, or time where nothing leads: what grows at one load is a vertical line."""
    history = _to_the_end(run)
    axes.plot(_drive(run, history), 1e3 * history["crack_length"], color=COLOURS[0], lw=1.8)
    _first_events(axes, run, None)
    axes.set(xlabel=_drive_label(run), ylabel="crack length, mm", title=run.title)


def _sense(run: Run) -> float:
    """1 where the leading load presses, −1 where it pulls: its largest value is drawn to the right."""
    load = run.history["load"]
    return -1.0 if np.nanmax(np.abs(load)) > np.nanmax(load) else 1.0


def _drive(run: Run, rows: np.ndarray) -> np.ndarray:
    """What ``rows`` are drawn against: the leading load, MPa, or the time, s, of a run without one."""
    return _sense(run) * rows["load"] / 1e6 if run.led else rows["time"]


def _drive_label(run: Run) -> str:
    return _load_label(run) if run.led else "time, s"


def _load_label(run: Run) -> str:
    return "load in tension, MPa" if _sense(run) < 0 else "load, MPa"


def _to_the_end(run: Run) -> np.ndarray:
    """The history up to what the run came to: not past the cut that ends it, where cracks turn into block faces."""
    return run.history[run.history["cycle"] <= final_cycle(run)]


def _first_events(axes: Axes, run: Run, strain: np.ndarray | None) -> None:
    """Mark the first event of every kind: as a point on the load–strain curve, or as a line at its load (at its time
    where nothing leads). Those that would be drawn over one another share one mark."""
    history = _to_the_end(run)
    if not len(run.events):
        return
    _, first = np.unique(run.events["kind"], return_index=True)
    events = run.events[np.sort(first)]
    # On paper, a hundredth of the axes is the size of a mark.
    size = np.array(
        [1.0 if strain is None else np.nanmax(np.abs(strain)), np.nanmax(np.abs(_drive(run, history)), initial=0.0)]
    )
    marks: dict[tuple[float, float], list[str]] = {}
    for event, drive in zip(events, _drive(run, events), strict=True):
        row = min(np.searchsorted(history["cycle"], event["cycle"]), len(history) - 1)
        at = (0.0 if strain is None else float(strain[row]), float(drive))
        near = [other for other in marks if np.all(np.abs(np.subtract(other, at)) <= 0.01 * size)]
        marks.setdefault(near[0] if near else at, []).append(str(event["kind"]))
    for k, ((x, drive), kinds) in enumerate(marks.items()):
        colour, label = COLOURS[1 + k % (len(COLOURS) - 1)], ", ".join(kinds)
        if strain is None:
            axes.axvline(drive, color=colour, lw=1.0, ls=":", label=label)
        else:
            axes.plot(x, drive, "o", color=colour, ms=5, label=label)
    axes.legend(frameon=False, fontsize=8)


def _save(curve, run: Run, path: Path) -> Path:
    figure, save = figure_of((5.6, 3.6), path)
    axes = figure.add_subplot()
    curve(axes, run)
    axes.spines[["top", "right"]].set_visible(False)
    axes.title.set_fontsize(min(10.0, 10.0 * 72 / max(1, len(run.title))))
    return save()


def figure_of(size: tuple[float, float], path: Path) -> tuple[Figure, Callable[[], Path]]:
    """An empty figure of ``size`` (inches), and what writes it to ``path`` when it is drawn."""
    # The object interface: pyplot would keep figures and may want a display.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, dpi=140, layout="constrained")
    FigureCanvasAgg(figure)

    def save() -> Path:
        figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)
        return path

    return figure, save
