"""The elements at crack tips, and the weights that give stress intensity factors from their nodal values."""

from __future__ import annotations

import numpy as np

from ...model import TIP, Cracks
from ..kernels import shape_functions
from ..system.influence_matrix import ElementSet


def tip_elements(cracks: Cracks, faces: ElementSet) -> tuple[np.ndarray, ...]:
    """The tips as TIP rows (factors zero) and, for each: its element, the last node of that element, weights (n_tips,
    p+1) that give the coefficient of √r from nodal values, and whether its faces touch without load."""
    n = len(cracks.tips)
    rows, element, last = np.zeros(n, TIP), np.zeros(n, int), np.zeros(n, int)
    lead, touching = np.zeros((n, faces.per)), np.zeros(n, bool)
    at_tip: dict[int, tuple[int, bool]] = {}
    for e in np.flatnonzero(faces.kind != shape_functions.ORDINARY).tolist():
        i, j = cracks.segments[faces.source[e]]
        if faces.kind[e] in (shape_functions.TIP_START, shape_functions.TIP_BOTH):
            at_tip[int(i)] = e, False
        if faces.kind[e] in (shape_functions.TIP_END, shape_functions.TIP_BOTH):
            at_tip[int(j)] = e, True
    for k, (row, node) in enumerate(zip(rows, cracks.tips)):
        e, at_end = at_tip[int(node)]
        segment = faces.source[e]
        row["node"], row["crack"], row["block"] = node, cracks.crack[segment], cracks.block[segment]
        row["end"], row["point"] = at_end, cracks.nodes[node]
        row["direction"] = faces.tangent[e] if at_end else -faces.tangent[e]
        element[k], last[k] = e, -1 if at_end else 0
        lead[k] = shape_functions.leading(faces.family, faces.order, int(faces.kind[e]), at_end) / np.sqrt(
            faces.length[e]
        )
        touching[k] = cracks.aperture[segment] == 0
    return rows, element, last, lead, touching
