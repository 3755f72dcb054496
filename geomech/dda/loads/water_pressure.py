"""Water pressure on edges of blocks below a water table, p = γw · depth."""

from __future__ import annotations

import numpy as np

from ...model import Blocks, WaterTable
from ..kinematics.tolerances import NOTHING
from .force_records import EDGE_FORCE


def wet_pieces(
    blocks: Blocks, edges: np.ndarray, drained: np.ndarray | None, ground: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Wet pieces of ``edges``: (edges (n,), spans (n, 2) from 0 to 1 along them), in reference positions.

    Parts that lie against ``drained`` (n_blocks,) blocks or on the ``ground`` (m, 2) are left out."""
    whole = np.tile([0.0, 1.0], (len(edges), 1))
    against = []
    if drained is not None and drained.any():
        gone = np.flatnonzero(drained[blocks.vertex_block])
        against.append(np.stack([blocks.vertices[gone], blocks.vertices[blocks.next_vertex[gone]]], axis=1))
    if ground is not None:
        against.append(np.stack([ground[:-1], ground[1:]], axis=1))
    if not against:
        return edges, whole
    start = blocks.vertices[edges]
    along = blocks.vertices[blocks.next_vertex[edges]] - start
    square = np.sum(along**2, axis=1)
    near = NOTHING * np.ptp(blocks.vertices, axis=0).max()
    dry: dict[int, list[tuple[float, float]]] = {}
    for ends in np.concatenate(against):
        arm = ends[:, None] - start
        off = np.abs(along[:, 0] * arm[..., 1] - along[:, 1] * arm[..., 0]) / np.sqrt(square)
        share = np.clip(np.sum(arm * along, axis=2) / square, 0.0, 1.0)
        low, high = share.min(axis=0), share.max(axis=0)
        for k in np.flatnonzero((off < near).all(axis=0) & ((high - low) * np.sqrt(square) > near)).tolist():
            dry.setdefault(k, []).append((low[k], high[k]))
    kept, spans = [], []
    for k in range(len(edges)):
        # Gaps of round-off between dry pieces, or at the edge's end, are not wet.
        at, gap = 0.0, near / np.sqrt(square[k]) if k in dry else 0.0
        for low, high in sorted(dry.get(k, [])):
            if low > at + gap:
                kept.append(edges[k])
                spans.append((at, low))
            at = max(at, high)
        if at < 1.0 - gap:
            kept.append(edges[k])
            spans.append((at, 1.0))
    return np.array(kept, dtype=int), np.array(spans).reshape(-1, 2)


def pressed_edges(
    water: WaterTable,
    time: float,
    pieces: tuple[np.ndarray, np.ndarray],
    owner: np.ndarray,
    vertices: np.ndarray,
    next_vertex: np.ndarray,
) -> np.ndarray:
    """EDGE_FORCE rows of the water pressure on ``pieces`` (from `wet_pieces`) of edges at ``time`` s.

    ``vertices`` (n_vertices, 2) current, m; ``owner`` (n_vertices,) block; ``next_vertex`` as in `Blocks`. The pressure
    γw · depth is linear along every wet piece between two points of the table. Around a block under a level table the
    forces add up to γw times its wet area (Archimedes) to round-off.
    """
    line_x, line_y = water.line_at(time)
    edges, spans = pieces
    start = vertices[edges]
    along = vertices[next_vertex[edges]] - start
    low = np.minimum(start[:, 1], start[:, 1] + along[:, 1]) < line_y.max()
    edges, shares, start, along = edges[low], spans[low], start[low], along[low]
    if len(line_x) > 1:
        # Below a point of the line, the pressure along the edge has a kink.
        with np.errstate(divide="ignore", invalid="ignore"):
            kinks = np.nan_to_num((line_x - start[:, :1]) / along[:, :1], nan=0.0, posinf=0.0, neginf=0.0)
        shares = np.sort(np.hstack([shares, np.clip(kinks, shares[:, :1], shares[:, 1:])]), axis=1)
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
    unit_weight = water.unit_weight_at(time)
    p0, p1 = unit_weight * np.maximum(d0, 0.0), unit_weight * np.maximum(d1, 0.0)

    rows = np.zeros(len(row), EDGE_FORCE)
    rows["edge"] = edges[row]
    rows["block"] = owner[rows["edge"]]
    rows["start"] = start[row] + s0[:, None] * along[row]
    rows["end"] = np.where(
        (s1 == 1.0)[:, None], vertices[next_vertex[rows["edge"]]], start[row] + s1[:, None] * along[row]
    )
    # Inward: the edge's direction rotated by +90°.
    length = np.hypot(along[row, 0], along[row, 1])
    inward = np.stack([-along[row, 1], along[row, 0]], axis=1) / length[:, None]
    rows["traction"][:, 0], rows["traction"][:, 1] = p0[:, None] * inward, p1[:, None] * inward
    rows["force"] = (0.5 * (p0 + p1) * (s1 - s0) * length)[:, None] * inward
    return rows
