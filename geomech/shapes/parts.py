"""Parts of a drawing: zones of rock, traces of cracks, names of edges; and their errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np


@dataclass(frozen=True, eq=False)
class Zone:
    """One polygon of rock.

    ``loops`` are (n, 2) arrays without repetition of the first vertex, the outline first, then holes, in either
    orientation. ``edge_names[loop][edge]`` names the edge that leaves each vertex; None: no names yet. Several zones
    with one name are several blocks of one kind.
    """

    name: str
    loops: tuple[np.ndarray, ...]
    edge_names: tuple[tuple[str, ...], ...] | None = None


@dataclass(frozen=True, eq=False)
class Trace:
    """A crack as drawn: ``lines`` are polylines (n, 2), several if the crack branches."""

    name: str
    lines: tuple[np.ndarray, ...]


#: Prefix of the names of block edges along joints.
JOINT = "joint:"


@dataclass(frozen=True, eq=False)
class Joint:
    """Joints of one kind as drawn: ``lines`` are polylines (n, 2) along which rock is cut; ``name`` is that of the
    block edges on both sides, such as "joint:bedding"."""

    name: str
    lines: tuple[np.ndarray, ...]


@dataclass(frozen=True, eq=False)
class Mark:
    """Lines or points of one name that cut nothing: ``name`` is "bolt:NAME", "water", "water:NAME" or "monitor:NAME"
    (each may lack NAME), ``lines`` are (n, 2) arrays, with one row for points."""

    name: str
    lines: tuple[np.ndarray, ...]


@dataclass(frozen=True, eq=False)
class EdgeLine:
    """A name for all block edges on the straight piece from ``start`` to ``end`` (only of ``zone``, if given)."""

    name: str
    start: tuple[float, float]
    end: tuple[float, float]
    zone: str | None = None


def is_mark(name: str) -> bool:
    """Whether lines with this ``name`` are bolts or a water table, which cut nothing."""
    return name.partition(":")[0] in ("bolt", "water")


class Flaw(NamedTuple):
    """One error of a drawing: ``part`` is "zones", "cracks", "joints" or "edges", ``index`` the position in that
    list."""

    part: str
    index: int  # type: ignore[assignment]  # hides tuple.index
    message: str
    way_out: str


class ShapeError(ValueError):
    """All errors of a drawing, as ``flaws``."""

    def __init__(self, flaws: list[Flaw]) -> None:
        self.flaws = list(flaws)
        super().__init__("\n".join(f"{flaw.message}: {flaw.way_out}" for flaw in self.flaws))


#: Largest coordinate of a drawing, m: that of a map in millimetres, as in metres, is below 1e11. Squares and moments of
#: areas stay far from the largest number of double precision.
FARTHEST = 1e12


def finite(points: np.ndarray) -> np.ndarray:
    """(n,) whether ``points`` (n, 2) are numbers within `FARTHEST`."""
    with np.errstate(invalid="ignore"):
        return np.asarray((np.abs(points) <= FARTHEST).all(axis=-1))


#: What is wrong with other points.
NOT_FINITE = f"has a coordinate that is not a finite number of at most {FARTHEST:.0e} m"


def extent_of(arrays) -> float:
    """Largest side of the box around all ``arrays`` (n, 2), m; 0 for none."""
    arrays = [np.asarray(a, dtype=float) for a in arrays if len(a)]
    if not arrays:
        return 0.0
    low = np.min([a.min(axis=0) for a in arrays], axis=0)
    high = np.max([a.max(axis=0) for a in arrays], axis=0)
    return float((high - low).max())


def grid_decimals(arrays) -> int:
    """Number of decimals that keeps twelve significant digits of the largest coordinate.

    All coordinates of a drawing are rounded to that many decimals, once. A cosine from Gmsh and one from Python then
    give the same number, and decimal input (0.03) stays the number that was typed.
    """
    arrays = [np.asarray(a, dtype=float) for a in arrays if len(a)]
    largest = max((float(np.abs(a).max()) for a in arrays), default=1.0)
    return 12 - int(np.ceil(np.log10(largest))) if largest > 0 else 12
