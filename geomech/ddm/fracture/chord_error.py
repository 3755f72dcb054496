"""Error of K where a polygon stands for a curved wall.

A polygon is taken for a curve where two sides of similar length meet others at similar angles of no more than 31°.
Between two such angles, of mean β, the arc deviates from its chord of length L by the sagitta ½ L tan(β/4). A second
body, with each chord halved at the arc and the mouths of cracks moved to the arc, has a quarter of the error; K on both
bodies differs by three quarters of it. A polygon that was meant as a polygon is thus given an error that it does not
have.
"""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...model import Cracks
from ...model.cracks.curved_tips import ERRORS, LEAST_BEND, LIKE, MOST_BEND, tip_deviations
from .tip_factors import factors

if TYPE_CHECKING:
    from ..interfaces import CrackedBody, SolvedBody
    from ..loads.supports import Support

_log = logging.getLogger(__name__)

#: A crack mouth within this fraction of a chord from its midpoint becomes the point where the arc is halved.
NEAR_MIDDLE = 0.2


def chord_errors(solution: SolvedBody) -> np.ndarray:
    """(n_tips, 2) Pa √m: change of K_I and K_II when the chords of curved walls are halved; zeros without curved walls.
    Logs a warning if it cannot be computed."""
    k = factors(solution)
    try:
        body, load = solution.body.with_rounded_walls, solution.load
        if body is None or not len(k):
            return np.zeros_like(k)
        sides = [side for where, value in load.sides for side in _halved_load(solution.body, where, value)]
        other = body.solve(replace(load, sides=sides), None, np.inf, solution.began, False)
    except (ValueError, np.linalg.LinAlgError) as failure:
        _log.warning(
            "the error of stress intensity factors due to chords of curved walls cannot be estimated: %s", failure
        )
        return np.zeros_like(k)
    return np.abs(factors(other) - k)


def chord_errors_at_tips(solution: SolvedBody) -> np.ndarray:
    """(n_tips, 2) Pa √m: error of K_I and K_II because the last chord of a curved crack deviates from the curve."""
    deviation = tip_deviations(solution.body.cracks)[:, None]
    return np.abs(factors(solution))[:, ::-1] * deviation * ERRORS


def with_halved_chords(body: CrackedBody) -> tuple[list[np.ndarray], Cracks, list[Support]] | None:
    """Loops, cracks and supports of ``body`` with each chord of a curved wall halved at the arc and crack mouths moved
    to the arc; None if all walls are straight. Raises ValueError if a crack does not reach the arc."""
    if not any(sagittas(loop).any() for loop in body.loops):
        return None
    loops, cracks = with_arcs_halved(body.loops, body.cracks)
    supports = [replace(one, on=((a[0], a[1]), (b[0], b[1]))) for one, (a, b) in zip(body.supports, _supported(body))]
    return loops, cracks, supports


def sagittas(loop: np.ndarray) -> np.ndarray:
    """(n,) m: sagitta of the arc over each edge of ``loop`` (n, 2), positive to the right; 0 for straight edges."""
    along = np.roll(loop, -1, axis=0) - loop
    before = np.roll(along, 1, axis=0)
    length = np.hypot(*along.T)
    bend = np.arctan2(before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0], np.sum(before * along, axis=1))
    ahead = np.roll(bend, -1)
    small, large = np.minimum(abs(bend), abs(ahead)), np.maximum(abs(bend), abs(ahead))
    curved = (bend * ahead > 0) & (small > LEAST_BEND) & (large < MOST_BEND) & (large < LIKE * small)
    for other in (np.roll(length, 1), np.roll(length, -1)):
        curved &= (length < LIKE * other) & (other < LIKE * length)
    return np.where(curved, np.sign(bend) * 0.5 * length * np.tan((abs(bend) + abs(ahead)) / 8), 0.0)


def with_arcs_halved(loops: list[np.ndarray], cracks: Cracks) -> tuple[list[np.ndarray], Cracks]:
    """``loops`` with an additional vertex on each arc and at each crack mouth there, and ``cracks`` extended or
    shortened to end on the arcs. Raises ValueError if nothing would be left of a crack."""
    nodes, out = cracks.nodes.copy(), []
    mouths = np.flatnonzero(cracks.surface & (cracks.valence > 0))
    for loop in loops:
        vertices = []
        for a, b, sagitta in zip(loop, np.roll(loop, -1, axis=0), sagittas(loop)):
            vertices.append(a)
            if sagitta == 0.0:
                continue
            along = b - a
            length = float(np.hypot(*along))
            rel = cracks.nodes[mouths] - a
            at = rel @ along / length**2
            off = np.abs(rel[:, 0] * along[1] - rel[:, 1] * along[0]) / length
            here = mouths[(off <= 1e-7 * length) & (at > 1e-6) & (at < 1 - 1e-6)]
            arc = (
                {}
                if any(abs(f - 0.5) < NEAR_MIDDLE for f in at[np.isin(mouths, here)])
                else {0.5: _middle(a, b, sagitta)}
            )
            for node, f in zip(here, at[np.isin(mouths, here)]):
                nodes[node] = arc[float(f)] = _end_on_arc(cracks, int(node), a, b, sagitta)
            vertices += [arc[f] for f in sorted(arc)]
        out.append(np.array(vertices))
    return out, replace(cracks, nodes=nodes)


def _middle(a: np.ndarray, b: np.ndarray, sagitta: float) -> np.ndarray:
    along = b - a
    return 0.5 * (a + b) + sagitta * np.array([along[1], -along[0]]) / np.hypot(*along)


def _end_on_arc(cracks: Cracks, node: int, a: np.ndarray, b: np.ndarray, sagitta: float) -> np.ndarray:
    """(2,) point where the crack that ends at ``node`` on the chord from ``a`` to ``b`` meets the arc."""
    segment, end = np.argwhere(cracks.segments == node)[0]
    mouth, inner = cracks.nodes[node], cracks.nodes[cracks.segments[segment, 1 - end]]
    half = 0.5 * np.hypot(*(b - a))
    radius = 0.5 * (half**2 / abs(sagitta) + abs(sagitta))
    top = _middle(a, b, sagitta)
    centre = top + radius * (0.5 * (a + b) - top) / abs(sagitta)
    way, rel = (mouth - inner) / np.hypot(*(mouth - inner)), mouth - centre
    ahead, root = -(rel @ way), (rel @ way) ** 2 - (rel @ rel - radius**2)
    if not root >= 0:
        raise ValueError(f"the crack that ends at ({mouth[0]:.6g}, {mouth[1]:.6g}) does not meet the curve")
    step = min(ahead - np.sqrt(root), ahead + np.sqrt(root), key=abs)
    if step < -0.9 * np.hypot(*(mouth - inner)):
        raise ValueError(f"the crack that ends at ({mouth[0]:.6g}, {mouth[1]:.6g}) lies between chord and curve")
    return mouth + step * way


def _halved_load(body: CrackedBody, where, value) -> list[tuple]:
    """The traction ``value`` of the side ``where`` of ``body`` on `Body.with_rounded_walls`, which has other side numbers."""
    if not isinstance(where, (int, np.integer)):
        return [(where, value)]
    parts = 1 + np.concatenate([sagittas(loop) != 0 for loop in body.loops])
    first = int(parts[:where].sum())
    if parts[where] == 1 or callable(value) or np.ndim(value) == 1:
        return [(first + k, value) for k in range(parts[where])]
    mean_value = np.mean(value, axis=0)
    return [(first, np.array([value[0], mean_value])), (first + 1, np.array([mean_value, value[1]]))]


def _supported(body: CrackedBody) -> list:
    return body.support_segments.tolist() if body.supports else []
