"""What acts on blocks, as rows: forces at points, and tractions on pieces of edges."""

from __future__ import annotations

import numpy as np

#: One row a point force: where it acts (current coordinates, m), the material point (reference coordinates), N.
POINT_FORCE = np.dtype([("block", np.int64), ("point", np.float64, 2), ("at", np.float64, 2), ("force", np.float64, 2)])

#: One row a loaded piece of an edge: its ends (current coordinates, m), the traction at its start and at its end, per
#: current length and linear between (Pa), and the total force (N).
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
