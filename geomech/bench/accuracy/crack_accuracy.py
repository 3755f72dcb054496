"""Stress intensity factors with default settings (or the given order) compared with `geomech.reference`."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ...model import Cracks, DdmSettings
from ...reference.cracks import boundary_collocation, branched, crack_arrays, cracked_hole, fracture, plates
from ...reference.specimens import two_cracks
from .crack_problems import ROCK, rectangle

#: (case, computed, reference, source)
Row = tuple[str, float, float, str]

COMPUTED = "computed independently"
PULL = np.array([0.0, 1.0, 0.0])


def pulled(half_width: float, half_height: float, stress: float = 1.0, bending: float = 0.0):
    """Uniform tension on both ends of a plate, plus a linear one, ``bending`` on the left and −``bending`` on the
    right."""
    from ...ddm import BodyLoad

    a, b, c, d = rectangle(half_width, half_height)
    left, right = np.array([0.0, stress + bending]), np.array([0.0, stress - bending])
    return BodyLoad(segments=np.array([[a, b], [c, d]]), tractions=np.array([[-left, -right], [right, left]]))


def _slots(*lines, **options) -> Cracks:
    return Cracks.from_polylines([np.array(line, dtype=float) for line in lines], aperture=math.inf, **options)


def _tips(loops, cracks: Cracks, load, holes=(), **settings) -> np.ndarray:
    from ...ddm import Body

    return Body(loops, cracks, ROCK, DdmSettings(**settings), holes=holes).solve(load).tips


def rows() -> Iterator[Row]:
    """Case, computed, reference, source."""
    yield from _in_the_plane()
    yield from _in_bodies()


def _in_the_plane() -> Iterator[Row]:
    from ...ddm import BodyLoad

    def k(cracks: Cracks, stress=PULL, name: str = "k_i", **settings):
        return _tips([], cracks, BodyLoad(remote_stress=np.array(stress)), **settings)[name]

    one = _slots([[-1, 0], [1, 0]])
    for order in (2, 4, 8):
        yield f"Griffith crack, order {order}: K_I", k(one, order=order)[0], fracture.griffith(1.0, 1.0), "closed form"
    pair = k(_slots([[-1, 0], [-0.2, 0]], [[0.2, 0], [1, 0]]), order=8)
    inner, outer = fracture.collinear_pair(1.0, 0.2, 1.0)
    yield "collinear pair, order 8: inner K_I", pair[1], inner, "Willmore 1949"
    yield "collinear pair, order 8: outer K_I", pair[0], outer, "Willmore 1949"
    ends = [np.array([[-1.0, 0], [1, 0]]), np.array([[-1.0, 0.25], [1, 0.25]])]
    exact = crack_arrays.straight_cracks(ends, PULL, n=97)[0]
    yield "two parallel cracks, an eighth of their length apart: K_I", k(_slots(*ends))[0], exact[0], COMPUTED
    yield "the same: K_II", k(_slots(*ends), name="k_ii")[0], exact[1], COMPUTED
    angle = math.radians(45)
    kinked = _slots([[-2, 0], [0, 0], [0.2 * math.cos(angle), 0.2 * math.sin(angle)]])
    exact = branched.kinked(2.0, 0.2, angle, PULL)[1]
    yield "crack with a kink of 45°, a tenth as long: K_I", k(kinked)[1], exact[0], COMPUTED
    yield "the same: K_II", k(kinked, name="k_ii")[1], exact[1], COMPUTED
    closed = Cracks.from_polylines([np.array([[-1.0, -1.0], [1.0, 1.0]]) / math.sqrt(2)])
    _, k_ii = fracture.closed(-PULL, math.pi / 4, 1.0)
    yield "closed crack at 45° under compression: K_II", k(closed, -PULL, "k_ii")[0], k_ii, "closed form"
    yield "the same: K_I", k(closed, -PULL)[0], 0.0, "closed form"
    n, length = 96, 0.5
    q = -2 * math.pi * (np.arange(n) + 0.5) / n
    radius = math.sqrt(math.pi / (n / 2 * math.sin(2 * math.pi / n)))
    wall = radius * math.cos(math.pi / n)
    lines = [[[side * wall, 0], [side * (1 + length), 0]] for side in (1, -1)]
    hole = radius * np.column_stack([np.cos(q), np.sin(q)])
    tips = _tips([], _slots(*lines, surface=[(True, False)] * 2), BodyLoad(remote_stress=PULL), holes=[hole])
    found = tips["k_i"][0] / math.sqrt(math.pi * length)
    yield "two cracks from a hole (96-gon), L/R = 0.5: F", found, cracked_hole.factor(length, 2, PULL), COMPUTED


def _in_bodies() -> Iterator[Row]:
    from ...ddm import BodyLoad

    for ratio, height in ((0.5, 3.0), (0.5, 1.0), (0.9, 1.0)):
        tips = _tips([rectangle(1.0, height)], _slots([[-ratio, 0], [ratio, 0]]), pulled(1.0, height))
        factor = tips["k_i"][0] / fracture.griffith(1.0, ratio)
        yield (
            f"centre crack a/W = {ratio}, H/W = {height:g}: F",
            factor,
            plates.CENTRE_CRACK_PLATE[height][ratio],
            COMPUTED,
        )
    u = 0.5 * np.array([math.cos(math.pi / 4), math.sin(math.pi / 4)])
    tips = _tips([rectangle(1.0, 2.0)], _slots([-u, u]), pulled(1.0, 2.0))
    exact = boundary_collocation.centre_crack(0.5, 1.0, 2.0, math.pi / 4)
    yield "slanted centre crack, 45°, a/W = 0.5, H/W = 2: K_I", tips["k_i"][0], exact[0], COMPUTED
    yield "the same: K_II", tips["k_ii"][0], exact[1], COMPUTED
    edge, strip, scale = (
        _slots([[-0.5, 0], [0, 0]], surface=[(True, False)]),
        rectangle(0.5, 1.5),
        fracture.griffith(1.0, 0.5),
    )
    in_tension = _tips([strip], edge, pulled(0.5, 1.5))["k_i"][0] / scale
    yield "edge crack a/W = 0.5: F", in_tension, fracture.EDGE_CRACK[0.5], "Kaya & Erdogan 1987"
    in_bending = _tips([strip], edge, pulled(0.5, 1.5, 0.0, 1.0))["k_i"][0] / scale
    yield "the same in bending: F", in_bending, plates.EDGE_CRACK_BENDING[0.5], "Kaya & Erdogan 1987"
    block, below = rectangle(20.0, 20.0) - [0, 20.0], np.array([[-1.0, -0.2], [1.0, -0.2]])
    tips = _tips([block], _slots(below), BodyLoad(crack_pressure=1.0))
    exact = crack_arrays.near_surface(below, 1.0)[0]
    yield "fluid in a crack, a tenth of its length below a surface: K_I", tips["k_i"][0], exact[0], COMPUTED
    yield "the same: K_II", tips["k_ii"][0], exact[1], COMPUTED
    for phi in two_cracks.OPEN_SLOT_K_I:
        tips = _tips([rectangle(0.03, 0.06)], _slots(*two_cracks.crack_ends(phi)), pulled(0.03, 0.06, -1.0))
        for name, table in (("K_I", two_cracks.OPEN_SLOT_K_I), ("K_II", two_cracks.OPEN_SLOT_K_II)):
            found = tips["k_i" if name == "K_I" else "k_ii"]
            at = int(np.argmax(np.abs(found - table[phi])))
            yield f"two slots, φ = {phi}: {name} of the worst tip", found[at], table[phi][at], COMPUTED
