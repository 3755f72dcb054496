"""Records of applied forces: POINT_FORCE rows, and EDGE_FORCE rows (linear tractions on pieces of edges)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: One row per point force: position (current coordinates, m), material point (reference coordinates, m), force (N).
POINT_FORCE = np.dtype([("block", np.int64), ("point", np.float64, 2), ("at", np.float64, 2), ("force", np.float64, 2)])

#: One row per loaded piece of an edge: its ends (current coordinates, m), tractions at start and end, linear between,
#: per current length (Pa), and the total force (N).
EDGE_FORCE = np.dtype(
    [
        ("block", np.int64),
        ("edge", np.int64),
        ("start", np.float64, 2),
        ("end", np.float64, 2),
        ("traction", np.float64, (2, 2)),
        ("force", np.float64, 2),
    ]
)


@dataclass(frozen=True, eq=False)
class BondTractions:
    """Tractions between cells of continuous rock, in the configuration in which they act.

    edges     (m, 2)  the edges of cells a and b along each face, in opposite directions
    face      (n,)    the face of each Gauss point, in the order of the points along the edge of a
    traction  (n, 2)  Pa, on a; that on b is opposite
    """

    edges: np.ndarray
    face: np.ndarray
    traction: np.ndarray
