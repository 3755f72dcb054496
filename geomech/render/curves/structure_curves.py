"""Curves of joints and bolts against time: slip and forces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from geomech.output.fields import JOINTS
from geomech.output.reading import Run, read_grid, read_table
from geomech.output.units import largest_of, length_unit

from .drive import COLOURS, line_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def joint_curves(run: Run) -> dict[str, np.ndarray]:
    """joint → (n, 2) of time, s, and mean slip, m: those with the largest slip, as many as there are colours."""
    table = read_table(run.folder / "joints.csv", JOINTS)
    if not len(table):
        return {}
    found = {}
    for name in dict.fromkeys(table["joint"].tolist()):
        rows = table[table["joint"] == name]
        found[str(name).removeprefix("joint:") or "joints"] = np.stack(
            [rows["time"], np.abs(rows["mean_slip"])], axis=1
        )
    order = sorted(found, key=lambda name: -largest_of(found[name][:, 1]))[: len(COLOURS)]
    return {name: found[name] for name in order if len(found[name]) > 1 and largest_of(found[name][:, 1]) > 0}


def bolt_curves(run: Run) -> dict[str, np.ndarray]:
    """bolt → (n, 2) of time, s, and force, N/m: those with the largest force, as many as there are colours."""
    rows, names = [], []
    for time, file in run.series("bolts"):
        grid = read_grid(file)
        rows.append([time, *np.asarray(grid["force"])])
        names = bytes(np.asarray(grid.field_data["BOLT_NAMES"])).decode().split("\n")
    if len(rows) < 2:
        return {}
    table = np.array(rows)
    order = np.argsort(-np.abs(table[:, 1:]).max(axis=0), kind="stable")[: len(COLOURS)]
    return {names[k]: table[:, [0, k + 1]] for k in order if np.abs(table[:, k + 1]).max() > 0}


def joints(axes: Axes, run: Run) -> None:
    """Mean slip of the joints against time."""
    curves = joint_curves(run)
    unit, size = length_unit(max(largest_of(curve[:, 1]) for curve in curves.values()))
    _draw(axes, run, curves, f"mean slip, {unit}", size)


def bolts(axes: Axes, run: Run) -> None:
    """Forces of the bolts against time, tension positive."""
    _draw(axes, run, bolt_curves(run), "bolt force, kN/m", 1e3)


def _draw(axes: Axes, run: Run, curves: dict[str, np.ndarray], label: str, size: float) -> None:
    for k, (name, curve) in enumerate(curves.items()):
        axes.plot(curve[:, 0], curve[:, 1] / size, **line_of(k), lw=1.5, label=name)
    axes.legend(frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    axes.set(xlabel="time, s", ylabel=label, title=run.title)
