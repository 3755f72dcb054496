"""Pressure on rigid bases assumed before it is computed: that of an earlier solution, times a linear function.

The pressure p₀ of a face in an earlier solution becomes p = p₀ (a + b s), s along the face, with the present force and
moment. Bounds of stress intensity factors need no more (`growth_screening`): what a pressure of unknown shape may add to
these is far below the margin of the bounds, unless the shape changes much.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .boundary_tractions import BoundaryLoad

#: Faces are on one line if they are off it by less than this part of their length.
_ON_LINE = 1e-6


def with_earlier_pressure(load: BoundaryLoad, before: BoundaryLoad) -> BoundaryLoad | None:
    """``load`` with the pressures of ``before``, whose bases have been solved for, times linear functions, so that force and
    moment of each base are its own. None if a base of ``load`` was none before, or if no such function gives force and
    moment. (Close to an end the resultant takes pressures that pull, so that more than the true change is found.)"""
    from ...ddm.loads.rigid_bases import resultants_of_hats, times_linear

    others = np.ones(len(load.segments), bool)
    segments, tractions = [], []
    for rows, way, _ in load.bases:
        start, end = load.segments[rows[0], 0], load.segments[rows[-1], 1]
        length = float(np.hypot(*(end - start)))
        along = (end - start) / length
        earlier = next((of for of in before.bases if _on_line(before.segments[of[0]], start, along, length)), None)
        if earlier is None:
            return None
        nodes, shape = _nodal(before, earlier[0], earlier[1], start, along)
        now, linear = _nodal(load, rows, way, start, along)
        pressure = times_linear(shape, nodes / length, resultants_of_hats(nodes), resultants_of_hats(now) @ linear)
        if pressure is None:
            return None
        others[rows] = False
        segments.append(before.segments[earlier[0]])
        tractions.append(np.stack([pressure[:-1], pressure[1:]], axis=1)[:, :, None] * way)
    return replace(
        load, bases=(), segments=np.concatenate([load.segments[others], *segments]),
        tractions=np.concatenate([load.tractions[others], *tractions]),
    )  # fmt: skip


def _on_line(segments: np.ndarray, start: np.ndarray, along: np.ndarray, length: float) -> bool:
    """Whether ``segments`` (m, 2, 2) lie on the line from ``start`` ``along`` (2,) and have its direction."""
    away = (segments[[0, -1], [0, 1]] - start) @ np.array([-along[1], along[0]])
    return bool(np.abs(away).max() < _ON_LINE * length and (segments[-1, 1] - segments[0, 0]) @ along > 0)


def _nodal(
    load: BoundaryLoad, rows: np.ndarray, way: np.ndarray, start: np.ndarray, along: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) places of the nodes of a base ``along`` its line from ``start``, m, and the pressures there, Pa."""
    ends, traction = load.segments[rows], load.tractions[rows]
    places = np.concatenate([ends[:, 0], ends[-1:, 1]])
    return (places - start) @ along, np.concatenate([traction[:, 0], traction[-1:, 1]]) @ way / (way @ way)
