"""World coordinates: location of the scene, and its shift to a local origin and back.

All coordinates of a scene and of the files it names are in one frame, the world's. Computation and output are local:
world coordinates minus origin. Five million metres north, a coordinate has nine digits for the rock instead of sixteen.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ..shapes.parts import extent_of
from .tables import SceneTables

#: An axis is shifted if coordinates exceed the drawing's size by this factor.
FAR = 100.0

#: Location-dependent parts of a scene: "xy" a point or any nesting of points, "y" a level.
PLACES: Mapping[str, Any] = {
    "geometry": {
        "zones": {"rectangle": "xy", "polygon": "xy", "holes": "xy"},
        "cracks": {"points": "xy", "centre": "xy"},
        "edges": {"line": "xy"},
        "joints": {"points": "xy"},
        "joint_sets": {"region": "xy"},
    },
    "loads": {
        "tractions": {"profile": {"start": "xy", "end": "xy"}},
        "forces": {"at": "xy"},
        "point_motions": {"at": "xy"},
        "water": {"points": "xy"},
        "bolts": {"start": "xy", "end": "xy"},
        "excavations": {"polygon": "xy"},
        "in_situ": {"surface_m": "y", "about": "xy"},
    },
    "gauge": {"start": "xy", "to": "xy"},
    "monitors": {"at": "xy"},
}


def local_origin(given: tuple[float, float] | None, drawn: Iterable[np.ndarray]) -> np.ndarray:
    """(2,) world coordinates of the local origin: ``given``, or if that is None a round position at the lower left of the
    ``drawn`` points (arrays (n, 2)), on each axis that is far from 0.
    """
    if given is not None:
        return np.array(given, dtype=float)
    drawn = [np.asarray(points) for points in drawn if len(points)]
    size = extent_of(drawn)
    if size == 0.0 or not math.isfinite(size):
        return np.zeros(2)
    step = 10.0 ** math.floor(math.log10(size))
    low, high = np.min([p.min(axis=0) for p in drawn], axis=0), np.max([p.max(axis=0) for p in drawn], axis=0)
    far = np.maximum(np.abs(low), np.abs(high)) > FAR * size
    return np.where(far, step * np.floor(low / step), 0.0)


def moved(tables: SceneTables, origin: tuple[float, float]) -> SceneTables:
    """``tables`` with all positions minus ``origin``; a faulty section (None) stays so."""
    return _moved(tables, PLACES, origin) if any(origin) else tables


def moved_section(section: Any, name: str, origin: np.ndarray) -> Any:
    """The ``section`` of a scene called ``name``, with its positions minus ``origin``."""
    return _moved(section, PLACES[name], tuple(origin.tolist()))


def _moved(value: Any, places: Any, origin: tuple[float, float]) -> Any:
    if value is None:
        return None
    if places == "y":
        return value - origin[1]
    if places == "xy":
        if isinstance(value[0], tuple) if value else True:
            return tuple(_moved(item, places, origin) for item in value)
        # A pair, or the two corners of a rectangle one after the other.
        return tuple(part - origin[k % 2] for k, part in enumerate(value))
    if isinstance(value, tuple):
        return tuple(_moved(item, places, origin) for item in value)
    return value.model_copy(update={key: _moved(getattr(value, key), own, origin) for key, own in places.items()})
