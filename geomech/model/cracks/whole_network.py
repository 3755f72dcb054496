"""All cracks of a run, including those along which blocks were split.

Where cracks split a block, the segments between the parts become block faces with the edge name "crack:NAME". Their
reference coordinates are those of the segments, bit for bit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..blocks.block_arrays import Blocks
from ..state import Cycle
from .crack_arrays import Cracks

#: A point lies on a segment when it is nearer than this, over the segment's length.
_ON = 1e-9
_WALL = "crack:"


def whole_network(cycle: Cycle, before: Cracks) -> Cracks:
    """The cracks of ``cycle`` and the block faces that cracks have left, with shared nodes (faces have block −1).

    ``before``: the whole network one cycle earlier. A face has the birth cycle of the segment of ``before`` that it
    lies on; otherwise it grew in that cycle."""
    ends, names = _walls(cycle.blocks)
    if not len(ends):
        return cycle.cracks
    cracks = cycle.cracks
    birth = np.array([_birth(segment, before, cycle.number - 1) for segment in ends])
    crack = np.array([cracks.names.index(name) for name in names])
    lines = np.concatenate([cracks.nodes[cracks.segments], ends])
    nodes, number = np.unique(lines.reshape(-1, 2), axis=0, return_inverse=True)
    surface = np.zeros(len(nodes), bool)
    surface[number.reshape(-1, 2)[: cracks.n_segments]] = cracks.surface[cracks.segments]
    return replace(
        cracks,
        nodes=nodes,
        segments=number.reshape(-1, 2),
        crack=np.concatenate([cracks.crack, crack]),
        block=np.concatenate([cracks.block, np.full(len(ends), -1)]),
        birth_cycle=np.concatenate([cracks.birth_cycle, birth]),
        aperture=np.concatenate([cracks.aperture, np.zeros(len(ends))]),
        law=np.concatenate([cracks.law, np.zeros(len(ends), int)]),
        surface=surface,
    )


def _walls(blocks: Blocks) -> tuple[np.ndarray, list[str]]:
    """(n, 2, 2) ends of the faces that cracks have left, m, each once, and the names of their cracks."""
    found: dict[tuple, str] = {}
    for edge, name in enumerate(blocks.edge_names[k] for k in blocks.edge_name):
        if name.startswith(_WALL):
            pair = blocks.vertices[[edge, blocks.next_vertex[edge]]].tolist()
            found.setdefault(tuple(map(tuple, sorted(pair))), name.removeprefix(_WALL))
    return np.array(list(found), dtype=float).reshape(-1, 2, 2), list(found.values())


def _birth(segment: np.ndarray, before: Cracks, number: int) -> int:
    """Birth cycle of ``segment`` (2, 2): that of the segment of ``before`` that contains it, else ``number``."""
    start, end = before.nodes[before.segments].swapaxes(0, 1)
    along = end - start
    size = np.hypot(*along.T)
    away = segment - start[:, None]  # (n, 2, 2)
    across = np.abs(away[..., 0] * along[:, None, 1] - away[..., 1] * along[:, None, 0]) / size[:, None] ** 2
    share = (away * along[:, None]).sum(axis=2) / size[:, None] ** 2
    on = (across < _ON) & (share > -_ON) & (share < 1 + _ON)
    holds = np.flatnonzero(on.all(axis=1))
    return int(before.birth_cycle[holds[0]]) if len(holds) else number
