"""A field to draw: its name, its unit, and its values on the grids of a run."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from geomech.output.fields import SERIES
from geomech.output.reading import Run

from ..pictures.field import COMPONENTS

if TYPE_CHECKING:
    import pyvista as pv

#: Stress components by name → (array, column, label); von Mises stress as written.
STRESSES = {**COMPONENTS, "von_mises": ("von_mises", None, "von Mises stress")}
#: Fields with a name of their own → (series, array, column, label). Vectors are drawn by magnitude.
NAMED = {
    "displacement": (("interior", "blocks"), "displacement", None, "displacement"),
    "velocity": (("blocks",), "velocity", None, "velocity"),
    "slip": (("contacts", "cracks"), "slip", None, "slip"),
    "opening": (("contacts", "cracks"), "opening", None, "opening"),
    "force": (("contacts",), "force", None, "contact force"),
    "K": (("tips",), "K_eq", None, "K_eq"),
    "principal": (("interior", "blocks"), "principal_stress", 2, "σ₃ and directions"),
}
#: An end of a range that is closer to zero than this part of the other end is set to zero.
NEARLY = 0.03
#: Share of values, %, cut off at either end of the colours for fields with a few extreme values.
CLIPPED = 0.7
_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


class UnknownField(KeyError):
    """A field that the run has not written; the message names the existing ones."""

    def __str__(self) -> str:
        return str(self.args[0])


@dataclass(frozen=True)
class Quantity:
    """A field that can be drawn.

    series   those that hold the ``array``
    column   of it, None for the magnitude
    turned   −1 if compression is shown positive
    """

    name: str
    series: tuple[str, ...]
    array: str
    column: int | None
    label: str
    unit: str
    turned: int = 1

    @property
    def stress(self) -> bool:
        """Whether it is a stress, with a sign convention and singular points."""
        return self.unit == "Pa" and "traction" not in self.array

    @property
    def clipped(self) -> bool:
        """Whether a few values may be extreme: stress at crack tips, slip and gaps at single corners."""
        return self.stress or (self.series[:1] == ("contacts",) and self.name != "force")

    @property
    def title(self) -> str:
        """Legend text without the unit."""
        if not self.stress or self.array == "von_mises":
            return self.label
        return self.label + (", compression positive" if self.turned < 0 else ", tension positive")

    def values(self, name: str, grid: pv.UnstructuredGrid) -> tuple[np.ndarray, bool]:
        """(values, whether per point rather than per cell) on a ``grid`` of the series ``name``."""
        if self.array == "opening" and name == "contacts":
            return np.maximum(np.asarray(grid.point_data["gap"], float), 0.0), True
        if self.array == "von_mises" and self.array not in grid.point_data:
            s1, s2, s3 = np.asarray(grid.cell_data["principal_stress"], float).T
            return np.sqrt(0.5 * ((s1 - s2) ** 2 + (s2 - s3) ** 2 + (s3 - s1) ** 2)), False
        at_points = self.array in grid.point_data
        values = np.asarray((grid.point_data if at_points else grid.cell_data)[self.array], float)
        if self.array == "slip":
            values = np.abs(values)
        if values.ndim > 1:
            values = np.hypot(*values[:, :2].T) if self.column is None else values[:, self.column]
        return (self.turned * values if self.stress and self.array != "von_mises" else values), at_points


def quantity(run: Run, name: str, *, compression_positive: bool = False) -> Quantity:
    """The field ``name`` of ``run``: one of `NAMED` or `STRESSES`, or any written array such as "velocity",
    "velocity.X" or "contacts.gap". Raises UnknownField with the existing ones."""
    written = [series for series in SERIES if run.series(series)]
    turned = -1 if compression_positive else 1
    if name in STRESSES:
        array, column, label = STRESSES[name]
        series: tuple[str, ...] = tuple(each for each in ("interior", "blocks") if each in written)
        return Quantity(name, series, array, column, label, "Pa", turned)
    if name in NAMED:
        wanted, array, column, label = NAMED[name]
        series = tuple(each for each in wanted if each in written)
        if not series or (name == "K" and not len(run.tips)):
            raise _unknown(run, name, written)
        units = {"displacement": "m", "slip": "m", "opening": "m", "velocity": "m/s", "force": "N/m"}
        unit = units.get(name, "Pa √m" if name == "K" else "Pa")
        return Quantity(name, series, array, column, label, unit, turned)
    series_name, _, rest = name.rpartition(".") if name.count(".") == 2 else ("", "", name)
    parts = rest.split(".")
    if not series_name and parts[0] in SERIES:
        series_name, parts = parts[0], parts[1:]
    for each in [series_name] if series_name else written:
        if each not in written:
            break
        for field in SERIES[each]:
            if parts and field.name == parts[0]:
                column = field.components.index(parts[1]) if len(parts) > 1 and parts[1] in field.components else None
                if len(parts) > 1 and column is None:
                    raise UnknownField(f"{field.name} has the components {', '.join(field.components) or 'none'}")
                if len(field.components) > 3 and column is None:
                    raise UnknownField(
                        f"{field.name} is a tensor: name a component, as {field.name}.{field.components[0]}"
                    )
                label = ".".join(parts).replace("_", " ")
                return Quantity(name, (each,), field.name, column, label, field.unit, turned)
    raise _unknown(run, name, written)


def _unknown(run: Run, name: str, written: list[str]) -> UnknownField:
    known = [*NAMED, *STRESSES]
    arrays = [f"{series}.{field.name}" for series in written for field in SERIES[series]]
    return UnknownField(f"{run.folder} has no field {name!r}; there are {', '.join(known)}; and {', '.join(arrays)}")


def limits(runs: Iterable[Run], what: Quantity, cycles: int = 6) -> tuple[float, float]:
    """Range of ``what`` over all ``runs``, in its own unit, from up to ``cycles`` of their cycles.

    Of stresses, and of contact fields other than forces, the outermost 0.7 % at either end is cut off: of the rock's
    area in those cycles, or of the number of contacts. An end near zero is set to zero.
    """
    found = [_sampled(run, what, cycles) for run in runs]
    values, weights = (np.concatenate(part) if part else np.empty(0) for part in zip(*found))
    if not len(values):
        return 0.0, 1.0
    order = np.argsort(values)
    values, weights = values[order], weights[order]
    low, high = float(values[0]), float(values[-1])
    if what.clipped:
        share = (np.cumsum(weights) - 0.5 * weights) / weights.sum() * 100
        low, high = (float(end) for end in np.interp([CLIPPED, 100 - CLIPPED], share, values))
    if high - low <= 1e-6 * max(abs(low), abs(high)):
        half = max(0.05 * abs(high), 1e-30)
        return (low - half, high + half) if low or high else (0.0, 1.0)
    if low > 0 and (low < 0.5 * high or not what.stress):
        low = 0.0
    if high < 0 and high > 0.5 * low:
        high = 0.0
    if low < 0 < high:
        low, high = (low if -low >= NEARLY * high else 0.0), (high if high >= NEARLY * -low else 0.0)
    return low, high


def _sampled(run: Run, what: Quantity, cycles: int) -> tuple[np.ndarray, np.ndarray]:
    """(values, weights) of ``what`` in up to ``cycles`` cycles of each series; weights are triangle areas for rock,
    else 1."""
    if what.name == "K":  # the table has every cycle, and any of them may have the largest value
        found = run.tips["K_eq"][np.isfinite(run.tips["K_eq"])]
        return found, np.ones(len(found))
    values, weights = [np.empty(0)], [np.empty(0)]
    for name in what.series:
        written = list(run.grids(name))
        rows = np.unique(np.linspace(0, len(written) - 1, min(cycles, len(written))).round().astype(int))
        for cycle in (written[k] for k in rows):
            grid = run.grid(name, cycle)
            if not grid.n_points or (what.stress and name == "blocks" and "interior" in what.series):
                continue  # the platens of a specimen
            own, at_points = what.values(name, grid)
            weight = np.ones(len(own))
            if what.clipped and name in ("blocks", "interior"):
                triangles = grid.cells.reshape(-1, 4)[:, 1:]
                own = own[triangles].mean(axis=1) if at_points else own
                weight = _areas(np.asarray(grid.points)[:, :2][triangles])
            finite = np.isfinite(own)
            values.append(own[finite])
            weights.append(weight[finite])
    return np.concatenate(values), np.concatenate(weights)


def _areas(corners: np.ndarray) -> np.ndarray:
    """(n,) m² of triangles (n, 3, 2)."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def readable(unit: str, largest: float) -> tuple[str, float]:
    """(unit with prefix, its size) in which the ``largest`` value is between 1 and 1000."""
    if unit in ("-", "deg", "m²") or not np.isfinite(largest) or largest == 0:
        return ("" if unit == "-" else unit), 1.0
    known = [pair for pair in _PREFIXES if not (unit.startswith("m") and pair[0] > 1)]
    size, letter = next((pair for pair in known if abs(largest) >= pair[0]), known[-1])
    return letter + unit, size
