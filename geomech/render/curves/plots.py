"""Curves of a run: load against strain, stress intensity factors and crack length against load; without load or cracks,
energies and displacements of monitors against time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from geomech.output.reading import Run
from geomech.output.units import largest_of, length_unit

from .crack_curves import crack_length, stress_intensity
from .drive import COLOURS, SAME, drive, first_events, line_of, load_label, load_unit, sense, to_the_end
from .structure_curves import bolt_curves, bolts, joint_curves, joints

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


#: Parts of the energy budget in drawing order, and their names.
_ENERGIES = {
    "elastic_energy": "elastic",
    "contact_energy": "contacts",
    "kinetic_energy": "kinetic",
    "crack_elastic": "around cracks",
    "fracture_energy": "new crack",
    "crack_friction": "crack faces",
    "crack_bond_loss": "cement of cracks",
    "runaway_loss": "unstable crack growth",
    "parting_energy": "blocks parted",
    "friction_loss": "friction",
    "damping_loss": "damping",
    "bond_loss": "broken bonds",
    "crushing_loss": "crushed faces",
    "impact_loss": "impacts",
    "scheme_loss": "time scheme",
    "overlap_energy": "overlaps",
}


def plots(run: Run, folder: Path, *, suffix: str = ".png", more: bool = False) -> list[Path]:
    """Draw the curves for which ``run`` has data into ``folder``; returns their paths.

    ``suffix`` ".svg" gives vector graphics; ``more`` also draws energies, monitors, joints and bolts.
    """
    history, tips = run.history, run.tips
    several = len(history) > 1
    wanted = {
        "stress_strain": (stress_strain, several and run.led and np.isfinite(history["strain"]).sum() > 1),
        "stress_intensity": (stress_intensity, several and len(tips) > 0),
        "crack_length": (crack_length, several and len(tips) > 0),
        "energy": (energies, more and bool(_energy_curves(run))),
        "monitors": (monitors, more and bool(_monitor_curves(run))),
        "joints": (joints, more and bool(joint_curves(run))),
        "bolts": (bolts, more and bool(bolt_curves(run))),
    }
    return [
        _save(curve, run, (folder / name).with_suffix(suffix)) for name, (curve, has_data) in wanted.items() if has_data
    ]


def energies(axes: Axes, run: Run) -> None:
    """Use of the work of loads and gravity against time; curves below a hundredth of the largest are left out."""
    history = to_the_end(run)
    for k, (name, energy) in enumerate(_energy_curves(run).items()):
        axes.plot(history["time"], energy, **line_of(k), lw=1.5, label=name)
    # Legend outside: none of the corners is free.
    axes.legend(frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    axes.set(xlabel="time, s", ylabel="energy, J/m", title=run.title)


def _energy_curves(run: Run) -> dict[str, np.ndarray]:
    history = to_the_end(run)
    # At rest, forces do more work on cracks than blocks with uniform strain account for.
    done = ("load_work", "gravity_work", "uneven_work")
    work = [history[name] for name in done if name in (history.dtype.names or ())]
    curves = {"work done": np.nansum(work, axis=0)} if work else {}
    curves |= {label: history[name] for name, label in _ENERGIES.items() if name in (history.dtype.names or ())}
    largest = max((float(np.nanmax(np.abs(curve), initial=0.0)) for curve in curves.values()), default=0.0)
    return {
        name: curve
        for name, curve in curves.items()
        if np.nanmax(np.abs(curve), initial=0.0) > max(SAME * largest, 0.0)
    }


def monitors(axes: Axes, run: Run) -> None:
    """Displacement of each monitored point against time."""
    history, ways = to_the_end(run), _monitor_curves(run)
    unit, size = length_unit(max(largest_of(way) for way in ways.values()))
    for k, (name, way) in enumerate(ways.items()):
        axes.plot(history["time"], way / size, **line_of(k), lw=1.5, label=name)
    axes.legend(frameon=False, fontsize=8)
    axes.set(xlabel="time, s", ylabel=f"displacement, {unit}", title=run.title)


def _monitor_curves(run: Run) -> dict[str, np.ndarray]:
    history = to_the_end(run)
    columns = history.dtype.names or ()
    names = [name[:-3] for name in columns if name.endswith("_ux") and f"{name[:-3]}_uy" in columns]
    return {name: np.hypot(history[f"{name}_ux"], history[f"{name}_uy"]) for name in names[: len(COLOURS)]}


def stress_strain(axes: Axes, run: Run) -> None:
    """Leading load against axial strain, both positive in compression (in tension if the load is tensile), with
    events."""
    history, sign = to_the_end(run), sense(run)
    axes.plot(sign * 1e3 * history["strain"], drive(run, history), color=COLOURS[0], lw=1.8)
    first_events(axes, run, sign * 1e3 * history["strain"])
    lengthening = ", lengthening positive" if sign < 0 else ""
    axes.set(xlabel=f"axial strain, 10⁻³{lengthening}", ylabel=load_label(run), title=run.title)


def compared(runs: Mapping[str, Run], path: Path) -> Path | None:
    """Draw load against axial strain of ``runs``, by name, in one figure; None if none has both."""
    known = {
        name: run for name, run in runs.items() if (np.isfinite(run.history["load"] + run.history["strain"])).sum() > 1
    }
    if not known:
        return None

    unit, size = max((load_unit(run) for run in known.values()), key=lambda pair: pair[1])

    def curves(axes: Axes, _: Run) -> None:
        for k, (name, run) in enumerate(known.items()):
            history, sign = to_the_end(run), sense(run)
            axes.plot(1e3 * sign * history["strain"], sign * history["load"] / size, **line_of(k), lw=1.4, label=name)
        axes.legend(frameon=False, fontsize=8)
        axes.set(xlabel="axial strain, 10⁻³", ylabel=f"load, {unit}")

    return _save(curves, next(iter(known.values())), path)


def _save(curve, run: Run, path: Path) -> Path:
    figure, save = figure_of((5.6, 3.6), path)
    axes = figure.add_subplot()
    curve(axes, run)
    axes.spines[["top", "right"]].set_visible(False)
    axes.title.set_fontsize(min(10.0, 10.0 * 72 / max(1, len(run.title))))
    return save()


def figure_of(size: tuple[float, float], path: Path) -> tuple[Figure, Callable[[], Path]]:
    """An empty figure of ``size`` (inches), and the function that writes it to ``path``."""
    # The object interface: pyplot would keep figures and may need a display.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, dpi=140, layout="constrained")
    FigureCanvasAgg(figure)

    def save() -> Path:
        figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)
        return path

    return figure, save
