"""Water pressure on the edges of blocks below a water table."""

from __future__ import annotations

import numpy as np

from ..model import WaterTable
from .force_rows import EDGE_FORCE


def pressed_edges(
    water: WaterTable,
    time: float,
    edges: np.ndarray,
    owner: np.ndarray,
    vertices: np.ndarray,
    next_vertex: np.ndarray,
) -> np.ndarray:
    """EDGE_FORCE rows of the water's pressure on ``edges`` (n,) of the current ``vertices``; ``owner`` (n_vertices,) and
    ``next_vertex`` as in `Blocks`.

    p = γw · depth below the line, linear along every piece of an edge that lies wet and between two of the line's points.
    Around a block under a level table the pieces add up to γw times its wet area (Archimedes) to round-off.
    """
    line_x, line_y = np.asarray(water.points, dtype=float).T
    line_y = line_y + (0.0 if water.level is None else float(water.level.at(time)[0]))
    start = vertices[edges]
    along = vertices[next_vertex[edges]] - start
    low = np.minimum(start[:, 1], start[:, 1] + along[:, 1]) < line_y.max()
    edges, start, along = edges[low], start[low], along[low]
    shares = np.zeros((len(edges), 2))
    shares[:, 1] = 1.0
    if len(line_x) > 1:
        # Where the edge passes a point of the line, the pressure along it has a kink.
        with np.errstate(divide="ignore", invalid="ignore"):
            kinks = np.nan_to_num((line_x - start[:, :1]) / along[:, :1], nan=0.0, posinf=0.0, neginf=0.0)
        shares = np.sort(np.hstack([shares, np.clip(kinks, 0.0, 1.0)]), axis=1)
    row = np.repeat(np.arange(len(edges)), shares.shape[1] - 1)
    s0, s1 = shares[:, :-1].ravel(), shares[:, 1:].ravel()
    keep = s1 > s0
    row, s0, s1 = row[keep], s0[keep], s1[keep]
    depth = []
    for share in (s0, s1):
        x, y = (start[row] + share[:, None] * along[row]).T
        depth.append(np.interp(x, line_x, line_y) - y)
    d0, d1 = depth
    keep = (d0 > 0) | (d1 > 0)
    row, s0, s1, d0, d1 = row[keep], s0[keep], s1[keep], d0[keep], d1[keep]
    with np.errstate(divide="ignore", invalid="ignore"):
        surface = s0 + d0 / (d0 - d1) * (s1 - s0)
    s0, s1 = np.where(d0 < 0, surface, s0), np.where(d1 < 0, surface, s1)
    p0, p1 = water.unit_weight * np.maximum(d0, 0.0), water.unit_weight * np.maximum(d1, 0.0)

    rows = np.zeros(len(row), EDGE_FORCE)
    rows["edge"] = edges[row]
    rows["block"] = owner[rows["edge"]]
    rows["start"] = start[row] + s0[:, None] * along[row]
    rows["end"] = np.where(
        (s1 == 1.0)[:, None], vertices[next_vertex[rows["edge"]]], start[row] + s1[:, None] * along[row]
    )
    # Inward: the edge's direction turned by +90°.
    length = np.hypot(along[row, 0], along[row, 1])
    inward = np.stack([-along[row, 1], along[row, 0]], axis=1) / length[:, None]
    rows["traction"][:, 0], rows["traction"][:, 1] = p0[:, None] * inward, p1[:, None] * inward
    rows["force"] = (0.5 * (p0 + p1) * (s1 - s0) * length)[:, None] * inward
    return rows
