"""Data of a run for the page of the player: a selection of cycles, curves, tips, joints, events and units."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ..output.fields import HISTORY
from ..output.reading import Run, read_table
from ..output.run_record import PLACES
from .frames import Frames, in_reference
from .packing import Block

#: Largest size of the cycles of one run in a page, bytes.
BUDGET = 8_000_000
#: Largest number of cycles in a page, about the resolution of a slider.
MOST_FRAMES = 400
#: Largest number of points of a curve, about the width of a screen.
MOST_ROWS = 2000
#: Rows of tips and joints that a page holds.
MOST_TIP_ROWS = 60_000
#: Columns of the history that are not shown as curves.
_NUMBERS_OF_THE_SOLVER = ("cycle", "load_step", "growth_pass")


class NothingToPlay(ValueError):
    """The run has not written a cycle yet."""


class Recording:
    """Reads ``run`` for a page: constant data once, cycles one by one.

    Raises NothingToPlay if it has written no blocks, cracks or interior fields.
    """

    def __init__(self, run: Run) -> None:
        self.run = run
        low, high = _bounds(run)
        self.origin = 0.5 * (low + high)
        self.size = np.maximum(high - low, 1e-12)
        self.frames = Frames(run, self.origin)

    def opening(self) -> dict[str, Any]:
        """Constant data: title, places, names."""
        run, scene = self.run, self.run.scene
        return {
            "title": run.title,
            "name": run.folder.resolve().name,
            "origin": self.origin.tolist(),
            "size": self.size.tolist(),
            "materials": list(scene.get("materials", {})),
            "component": scene.get("render", {}).get("component", "yy"),
            **_places(run, self.origin),
        }

    def state(self, scale: float | None = None) -> dict[str, Any]:
        """Data that grow with the run: end, curves, tips, joints, events, and the magnification (default: that of the
        run's pictures)."""
        from ..render.pictures.look import final_cycle

        summary, final = self.run.summary, final_cycle(self.run)
        return {
            "final": final,
            "led": self.run.led,
            "scale": magnification(self.run) if scale is None else scale,
            "end": summary.get("end"),
            "ended": bool(summary),
            "cracks": summary.get("cracks") or _crack_names(self.run),
            "curves": _curves(self.run),
            "tips": _tips(self.run),
            "joints": _joints(self.run),
            "events": _events(self.run, self.origin),
        }

    def cycles(self, every: bool = False) -> list[int]:
        """Cycles whose interior fields were written for their own cracks. ``every``: all cycles, with the last interior
        fields written before."""
        from ..render.pictures.field import agreeing

        written = written_cycles(self.run)
        known = set(self.run.history["cycle"].astype(int).tolist())
        return [number for number in (written if every else agreeing(self.run, written)) if number in known]

    def frame(self, cycle: int) -> dict[str, Any]:
        """The record of one cycle, with time and load."""
        row = self.run.at(cycle)
        record = self.frames.frame(cycle)
        for name in ("time", "load", "strain", "crack_length", "max_k_eq"):
            value = float(row[name])
            record[name] = value if math.isfinite(value) else None
        return record

    def whole(self, budget: int = BUDGET, most: int = MOST_FRAMES) -> dict[str, Any]:
        """The run in one record of about ``budget`` bytes, with as many cycles as fit: first, last, those with events,
        and others evenly distributed (see `evenly`)."""
        cycles = self.cycles()
        chosen = evenly(self.run, cycles, most)
        made = {number: self.frame(number) for number in sample(chosen, 6)}
        fitting = int(budget / self._size(made) * len(made))
        if fitting < len(chosen):
            chosen = evenly(self.run, cycles, max(2, fitting))
        made |= {number: self.frame(number) for number in chosen if number not in made}
        while len(chosen) > 2 and (size := self._size({number: made[number] for number in chosen})) > budget:
            # Each pass drops at least one cycle.
            chosen = evenly(self.run, chosen, max(2, min(len(chosen) - 1, int(len(chosen) * budget / size))))
        frames = [made[number] for number in chosen]
        more = {"of": len(cycles), "ranges": picture_ranges(self.run)}
        return self.opening() | self.state() | _with_own_meshes(frames, self.frames.meshes) | more

    def _size(self, made: dict[int, dict[str, Any]]) -> int:
        """Size of these frames with their meshes, bytes."""
        record = _with_own_meshes(list(made.values()), self.frames.meshes)
        return sum(len(json.dumps(each)) for part in record.values() for each in part)


def _with_own_meshes(frames: list[dict[str, Any]], meshes: list[dict[str, Any]]) -> dict[str, Any]:
    """``frames`` with only the meshes that they use."""
    used = sorted({frame[kind] for frame in frames for kind in ("blocks", "interior") if kind in frame})
    place = {old: new for new, old in enumerate(used)}
    renamed = [
        frame | {kind: place[frame[kind]] for kind in ("blocks", "interior") if kind in frame} for frame in frames
    ]
    return {"frames": renamed, "meshes": [meshes[k] for k in used]}


def written_cycles(run: Run) -> list[int]:
    """Cycles of which blocks or cracks were written."""
    return sorted(run.grids("blocks") or run.grids("cracks"))


def sample(cycles: Sequence[int], n: int) -> list[int]:
    """``n`` of ``cycles``, evenly spaced by their number, including the first and the last."""
    at = np.unique(np.round(np.linspace(0, len(cycles) - 1, n)).astype(int))
    return [cycles[k] for k in at.tolist()]


def evenly(run: Run, cycles: Sequence[int], most: int) -> list[int]:
    """At most ``most`` of ``cycles``, distributed evenly over time, crack growth and number; they include the first,
    the last and the first event of each kind as far as there is room."""
    if len(cycles) <= most:
        return list(cycles)
    rows = run.history[np.isin(run.history["cycle"], cycles)]
    way = np.linspace(0, 1, len(rows))
    for name in ("time", "crack_length"):
        done = np.maximum.accumulate(np.nan_to_num(rows[name]))
        if done[-1] > done[0]:
            way = way + (done - done[0]) / (done[-1] - done[0])
    numbers = np.asarray(cycles)
    first: dict[Any, Any] = {}
    for event in run.events if len(run.events) else ():
        first.setdefault(str(event["kind"]), int(event["cycle"]))
    fixed = {int(numbers[0]), int(numbers[-1])}
    for number in sorted(first.values()):
        at = int(np.searchsorted(numbers, number))
        if at < len(numbers) and len(fixed) < min(most, max(3, most // 2)):
            fixed.add(int(numbers[at]))
    room = max(0, most - len(fixed))
    nearest = np.searchsorted(way, np.linspace(way[0], way[-1], room + 2)[1:-1])
    between = sorted(set(numbers[np.clip(nearest, 0, len(way) - 1)].tolist()) - fixed)
    return sorted(fixed | set(between))


def magnification(run: Run) -> float:
    """The factor by which pictures of the run magnify its displacements."""
    from ..render.fields.painter import suitable_scale

    asked = run.scene.get("render", {}).get("deformation_scale")
    if asked is not None:
        return float(asked)
    return suitable_scale(run) if len(run.history) and run.series("blocks") else 1.0


def picture_ranges(run: Run) -> dict[str, list[float]]:
    """Range, SI units, of the fields in the run's pictures, so that the page starts with the same colours."""
    from ..render.fields.quantity import limits, quantity

    if not run.series("blocks"):
        return {}
    shown = ("displacement", run.scene.get("render", {}).get("component", "yy"))
    return {name: list(limits([run], quantity(run, name))) for name in shown}


def quick_magnification(run: Run, cycle: int) -> float:
    """A round factor that makes the relative motion of points at ``cycle`` visible, to a quarter of the size at which
    pictures begin. (Pictures also avoid blocks drawn inside each other, which takes seconds.)"""
    from ..render.pictures.look import DEFORMATION

    size = spread = 0.0
    for series in ("blocks", "interior"):
        if any(number <= cycle for number in run.grids(series)):
            grid = in_reference(run.grid(series, cycle))
            if grid.n_cells:
                size = max(size, float(np.ptp(np.asarray(grid.points)[:, :2], axis=0).max()))
                spread = max(spread, float(np.ptp(np.asarray(grid["displacement"]), axis=0).max()))
    wanted = 0.25 * DEFORMATION * size / spread if spread > 1e-12 * size else 1.0
    return max(1.0, float(f"{wanted:.1g}"))


def _bounds(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Lower left and upper right corner of the initial model, m."""
    numbers = written_cycles(run)
    places = []
    for series in ("blocks", "cracks", "interior"):
        files = run.grids(series)
        if files and numbers:
            try:
                grid = in_reference(run.grid(series, max(numbers[0], min(files))))
            except KeyError:
                continue
            if grid.n_cells:
                places.append(np.asarray(grid.points)[:, :2])
    if not places:
        raise NothingToPlay(f"{run.folder}: nothing has been written that could be drawn; blocks.pvd lists no cycle")
    points = np.concatenate(places)
    return points.min(axis=0), points.max(axis=0)


def _places(run: Run, origin: np.ndarray) -> dict[str, Any]:
    """Monitors and bolts from ``places.json`` of the run; ends of bolts in the ground are marked."""
    path = run.folder / PLACES
    if path.is_file():
        found = json.loads(path.read_text(encoding="utf-8"))
    else:  # a run of an earlier version
        drawn = {each["name"]: each["at"] for each in run.scene.get("monitors", ()) if each.get("at") is not None}
        found = {"monitors": drawn}
    columns = run.history.dtype.names or ()

    def placed(point: Sequence[float]) -> dict[str, float]:
        return {"x": point[0] - float(origin[0]), "y": point[1] - float(origin[1])}

    return {
        "monitors": [
            {"name": name} | placed(point)
            for name, point in found.get("monitors", {}).items()
            if f"{name}_ux" in columns
        ],
        "bolts": [
            {
                "name": bolt["name"],
                "column": f"bolt:{bolt['name']}",
                "from": placed(bolt["from"]),
                "to": placed(bolt["to"]) | {"ground": bolt["ground"]},
            }
            for bolt in found.get("bolts", ())
        ],
    }


def thinned(n: int, most: int) -> np.ndarray:
    """Rows of a table of ``n`` rows that a curve shows."""
    return np.arange(n) if n <= most else np.unique(np.round(np.linspace(0, n - 1, most)).astype(int))


def _curves(run: Run) -> dict[str, Any]:
    """Columns of ``history.csv`` as curves, without those that are zero or empty throughout."""
    table = run.history[thinned(len(run.history), MOST_ROWS)]
    made = Block()
    made.single("cycle", table["cycle"])
    units = {}
    for name in table.dtype.names:
        values = table[name]
        if name in _NUMBERS_OF_THE_SOLVER or values.dtype.kind != "f":
            continue
        if np.any(np.isfinite(values) & (values != 0)) or name == "time":
            made.single(name, values)
            units[name] = _unit(name)
    return made.record() | {"units": units}


def _unit(name: str) -> str:
    """The SI unit of a column of ``history.csv``; "" for numbers."""
    if name in HISTORY:
        unit = HISTORY[name].partition(",")[0]
        return unit if unit in ("s", "Pa", "m", "Pa √m") else ""
    if name.endswith(("_ux", "_uy", "penetration")):
        return "m"
    if name.endswith(("_energy", "_work", "_loss", "_residual", "_release")) or name in (
        "crack_elastic",
        "crack_friction",
    ):
        return "J/m"
    return "s" if name == "dt" else ""


def _tips(run: Run) -> dict[str, Any] | None:
    """``tips.csv``, for as many cycles as the limit of rows allows."""
    rows = run.tips
    if not len(rows):
        return None
    numbers = np.unique(rows["cycle"])
    most = max(2, int(MOST_TIP_ROWS * len(numbers) / len(rows)))
    rows = rows[np.isin(rows["cycle"], numbers[thinned(len(numbers), most)])]
    made = Block()
    for name in ("cycle", "time", "K_I", "K_II", "K_eq"):
        made.single(name, rows[name])
    for name in ("crack", "end"):
        made.whole(name, rows[name])
    return made.record()


def _joints(run: Run) -> dict[str, Any] | None:
    """``joints.csv``, if the run has written it: one row per joint and cycle."""
    rows = read_table(run.folder / "joints.csv", ("cycle", "time"))
    columns = rows.dtype.names or ()
    if not len(rows) or "joint" not in columns:
        return None
    numbers = np.unique(rows["cycle"])
    most = max(2, int(MOST_TIP_ROWS * len(numbers) / len(rows)))
    rows = rows[np.isin(rows["cycle"], numbers[thinned(len(numbers), most)])]
    names, index = np.unique(rows["joint"], return_inverse=True)
    made = Block()
    made.whole("joint", index)
    for name in ("cycle", "time", "mean_opening", "max_opening", "mean_slip", "max_slip", "normal_force",
                 "shear_force", "mobilised"):  # fmt: skip
        if name in columns:
            made.single(name, rows[name])
    return made.record() | {"names": [str(name) for name in names]}


def _events(run: Run, origin: np.ndarray, most: int = 400) -> list[list[Any]]:
    """[kind, cycle, time, x, y, detail] of the first events."""
    rows: Iterable[Any] = run.events[:most] if len(run.events) else ()
    return [
        [str(e["kind"]), int(e["cycle"]), float(e["time"])]
        + [_number(e[x] - o) for x, o in zip("xy", origin, strict=True)]
        + [str(e["detail"])]
        for e in rows
    ]


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _crack_names(run: Run) -> list[str]:
    """Names of the cracks by number, from ``tips.csv``, if the run has not ended."""
    if not len(run.tips) or "crack_name" not in (run.tips.dtype.names or ()):
        return []
    names: dict[int, str] = {int(k): str(name) for k, name in zip(run.tips["crack"], run.tips["crack_name"])}
    return [names.get(k, "") for k in range(max(names) + 1)]
