"""An edge crack in a half-plane: the free surface in the kernels, or as the outline of a sufficiently large block."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from ...ddm import Body, BodyLoad, HalfPlane, Solution
from ...model import Cracks, DdmSettings
from ...reference.cracks import crack_arrays
from ..accuracy.crack_problems import ROCK

PROBLEM = "edge crack in a half-plane"
IN_KERNELS, AS_BLOCK = "free surface in the kernels, asked for", "block, of so many depths of the crack:"
#: Target digits; sizes of blocks: the relative error of K is about (depth/size)².
DIGITS, SIZES = (2, 4, 6, 8), (10, 40, 160, 640)

#: (method, digits or size, unknowns, error of K, function to time)
Row = tuple[str, int, int, float, Callable[[], Solution]]


def rows() -> Iterator[Row]:
    """K of a crack below a free surface by each method, from coarse to fine."""
    for method, sizes, solve in ((IN_KERNELS, DIGITS, _half_plane), (AS_BLOCK, SIZES, _block)):
        for size in sizes:
            again = partial(solve, size)
            solution = again()
            k = float(solution.tips["k_i"][0])
            error = abs(k / (crack_arrays.EDGE_CRACK_HALF_PLANE * math.sqrt(math.pi)) - 1)
            yield method, size, solution.body.boundary.n_unknowns + solution.body.faces.n_unknowns, error, again


def _crack() -> Cracks:
    return Cracks.from_polylines([np.array([[0.0, 0.0], [0.0, -1.0]])], aperture=math.inf, surface=[(True, False)])


def _half_plane(digits: int) -> Solution:
    body = Body(HalfPlane(), _crack(), ROCK, DdmSettings(target_error=10.0**-digits))
    return body.solve(BodyLoad(remote_stress=np.array([1.0, 0.0, 0.0])))


def _block(size: int) -> Solution:
    a, b, c, d = outline = np.array([[-size, -size], [size, -size], [size, 0.0], [-size, 0.0]], dtype=float)
    pull = np.array([1.0, 0.0])
    load = BodyLoad(np.array([[b, c], [d, a]]), np.array([[pull, pull], [-pull, -pull]]))
    # Ten times smaller than the error due to the size.
    settings = DdmSettings(target_error=min(1e-2, 0.1 / size**2))
    return Body([outline], _crack(), ROCK, settings).solve(load)
