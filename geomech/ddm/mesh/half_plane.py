"""The half-plane: rock bounded by a straight, traction-free surface that needs no elements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...conventions import turned_stress

if TYPE_CHECKING:
    from ...model import Cracks

#: A traction that a load causes at the surface counts as zero below this part of the load.
_BORNE = 1e-9
#: Where a finite piece of the surface is needed, it extends this many extents of the geometry to either side; for a
#: path that is to meet the surface, this many.
_NEAR, _FAR = 2.0, 100.0
#: Points outside the rock by less than this part of the extent count as on the surface.
ON_SURFACE = 1e-7


@dataclass(frozen=True)
class HalfPlane:
    """The rock below a free surface.

    ``point`` (x, y) of the surface, m; ``outward`` the direction out of the rock, of any length. Raises ValueError when
    they are not finite, or the direction has none.
    """

    point: tuple[float, float] = (0.0, 0.0)
    outward: tuple[float, float] = (0.0, 1.0)

    def __post_init__(self) -> None:
        point, way = np.asarray(self.point, dtype=float), np.asarray(self.outward, dtype=float)
        if point.shape != (2,) or way.shape != (2,) or not np.isfinite([*point, *way]).all() or not way.any():
            raise ValueError(f"a half-plane needs a point of its surface and a direction out of the rock, got {self}")
        way = way / np.hypot(*way)
        object.__setattr__(self, "point", tuple(point.tolist()))
        object.__setattr__(self, "outward", tuple(way.tolist()))

    @property
    def turn(self) -> np.ndarray:
        """(2, 2) maps vectors to components along the surface (rock on the right) and along the outward normal."""
        x, y = self.outward
        return np.array([[y, -x], [x, y]])

    def turned(self, vectors: np.ndarray) -> np.ndarray:
        """Components (..., 2) of ``vectors`` (..., 2) along the surface and along the outward normal."""
        return vectors @ self.turn.T

    def frame(self, points: np.ndarray) -> np.ndarray:
        """(..., 2) ``points`` relative to the surface's own point, along the surface and along the outward normal: the
        second component is negative in the rock."""
        return self.turned(points - np.asarray(self.point))

    def images(self, points: np.ndarray, on_surface: float = 0.0) -> np.ndarray:
        """(..., 2) mirror images of ``points`` (..., 2); points within ``on_surface`` (m) of the surface are their own
        images."""
        height = self.frame(points)[..., 1:]
        return points - np.where(np.abs(height) <= on_surface, 0.0, 2 * height) * np.asarray(self.outward)

    def edge(self, points: np.ndarray, extents: float = _NEAR) -> np.ndarray:
        """(1, 2, 2) a piece of the surface, rock on its left, that extends ``extents`` extents beyond ``points`` (n,
        2)."""
        if not len(points):
            points = np.array([self.point])
        along = self.frame(points)[:, 0]
        centre, reach = 0.5 * (along.max() + along.min()), extents * (float(np.ptp(points, axis=0).max()) or 1.0)
        ends = np.array([centre + reach, centre - reach])[:, None] * self.turn[0] + np.asarray(self.point)
        return ends[None]

    def region_above_surface(self, points: np.ndarray) -> np.ndarray:
        """(3, 2) a triangle that covers the region outside the rock near ``points`` (n, 2)."""
        ends = self.edge(points, _FAR)[0]
        return np.concatenate([ends, [ends.mean(axis=0) + np.hypot(*(ends[1] - ends[0])) * np.asarray(self.outward)]])

    def stress_of(self, in_frame: np.ndarray) -> np.ndarray:
        """(..., 3) stress in x and y from that in the surface's frame."""
        (c, s), _ = self.turn
        return turned_stress(in_frame, c, s)

    def check_uniform(self, stress: np.ndarray) -> None:
        """Raise ValueError unless a uniform ``stress`` (3,) leaves the surface free of traction."""
        x, y = self.outward
        pulled = np.array([stress[0] * x + stress[2] * y, stress[2] * x + stress[1] * y])
        if np.hypot(*pulled) > _BORNE * np.abs(stress).max():
            along, out = self.turned(pulled)
            raise ValueError(
                "remote_stress: the surface of the half-plane is free of traction, but this stress has a traction "
                f"({along:g} Pa along it, {out:g} Pa out of it) there; only a stress parallel to the surface is "
                "possible in a half-plane"
            )

    def check_force(self, gradient: np.ndarray) -> None:
        """Raise ValueError if a body force has a ``gradient`` (2, 2)."""
        if gradient.any():
            raise ValueError("body_force_gradient: in a half-plane a body force is uniform")

    def check_inside(self, loops: Sequence[np.ndarray], cracks: Cracks) -> None:
        """Raise ValueError naming the hole among ``loops``, or the crack, that is not inside the rock."""
        nodes = cracks.nodes
        points = np.concatenate([*loops, nodes, np.empty((0, 2))])
        if not len(points):
            return
        near = ON_SURFACE * float(np.ptp(points, axis=0).max())
        for k, loop in enumerate(loops, 1):
            if self.frame(loop)[:, 1].max() >= -near:
                raise ValueError(
                    f"hole {k}: reaches the free surface of the half-plane; draw what is open to it as an outline"
                )
        for node in np.flatnonzero(self.frame(nodes)[:, 1] > near)[:1] if len(nodes) else ():
            k = int(cracks.crack[np.argmax((cracks.segments == node).any(axis=1))])
            name = repr(cracks.names[k]) if k < len(cracks.names) else f"crack {k}"
            x, y = nodes[node]
            raise ValueError(f"{name}: ({x:g}, {y:g}) lies outside the rock, above the surface of the half-plane")


def without_outline(loops: Sequence[np.ndarray] | None, half_plane: HalfPlane) -> HalfPlane:
    """``half_plane`` as the outline of a body that has no other ``loops``. Raises ValueError if it has."""
    if loops is not None and len(loops):
        raise ValueError("half_plane: the body has an outline; a half-plane has none but its surface")
    return half_plane
