"""Loads on a body: tractions on pieces of its boundary, body forces, remote stress, pressure in the cracks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .boundary import FreeMotions


class OutOfEquilibrium(ValueError):
    """Loads whose resultants do not vanish: no static solution exists.

    ``force`` (2,) N/m, ``moment`` N about the centroid, ``relative`` to the sum of the loads' magnitudes.
    """

    def __init__(self, force: np.ndarray, moment: float, relative: float):
        self.force, self.moment, self.relative = force, moment, relative
        super().__init__(
            f"the loads are out of equilibrium: force ({force[0]:.6g}, {force[1]:.6g}) N/m, moment {moment:.6g} N about "
            f"the centroid, {relative:.3g} of the loads' size"
        )


@dataclass(frozen=True)
class Pressure:
    """Of a fluid: ``value`` Pa at ``about`` (x, y), growing by ``gradient`` Pa/m. Water with its level at y0 is
    ``Pressure(0, (0, -9.81e3), (0, y0))``. Raises ValueError when something is not finite."""

    value: float = 0.0
    gradient: tuple[float, float] = (0.0, 0.0)
    about: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if not np.isfinite([self.value, *self.gradient, *self.about]).all():
            raise ValueError(f"a pressure is not finite: {self}")

    def at(self, points: np.ndarray) -> np.ndarray:
        """(...,) Pa at ``points`` (..., 2)."""
        return self.value + (points - np.asarray(self.about)) @ np.asarray(self.gradient, dtype=float)


@dataclass(frozen=True, eq=False)
class BodyLoad:
    """All parts are optional and add up.

    segments             (m, 2, 2)  straight pieces of the boundary, anywhere on it, directed along it
    tractions            (m, 2, 2)  traction (Pa, x and y) at the start and end of each, linear between
    body_force           (2,)       N/m³ at ``about``
    body_force_gradient  (2, 2)     N/m⁴: b(x) = body_force + gradient (x − about)
    about                (2,)       m; the centroid when left out
    remote_stress        (3,)       Pa: a uniform stress that is there besides; on a finite body the tractions
                                    that carry it act on the boundary in addition to ``tractions``
    crack_pressure       scalar or (n_segments,)  Pa, of a fluid in the cracks, positive when it presses
    hole_pressure        the same in all holes, or of each: a number, Pa, or a `Pressure`
    displacements        for every support of the body what it imposes, m: None (zero), constant (2,), linear (2, 2) from
                         its values at the support's ends, or a function of points (n, 2); components that the
                         support does not hold are ignored
    """

    segments: np.ndarray | None = None
    tractions: np.ndarray | None = None
    body_force: np.ndarray | None = None
    body_force_gradient: np.ndarray | None = None
    about: np.ndarray | None = None
    remote_stress: np.ndarray | None = None
    crack_pressure: np.ndarray | float = 0.0
    hole_pressure: Pressure | Sequence[Pressure | float] | float = 0.0
    displacements: Sequence | None = None

    def hole_pressures(self, n_holes: int) -> list[Pressure]:
        """That of every hole, [] when there is none. Raises ValueError when there are not as many."""
        given = self.hole_pressure
        if np.ndim(given) == 0 and not isinstance(given, Pressure) and given == 0:
            return []
        if isinstance(given, Pressure) or np.ndim(given) == 0:
            given = [given] * n_holes
            if not n_holes:
                raise ValueError("a pressure in holes, but the body has none")
        if len(given) != n_holes:
            raise ValueError(f"{n_holes} holes but {len(given)} pressures")
        return [p if isinstance(p, Pressure) else Pressure(float(p)) for p in given]

    def __post_init__(self) -> None:
        shapes = {
            "segments": (-1, 2, 2),
            "tractions": (-1, 2, 2),
            "body_force": (2,),
            "body_force_gradient": (2, 2),
            "about": (2,),
            "remote_stress": (3,),
        }
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value is None:
                continue
            value = np.ascontiguousarray(value, dtype=float)
            if value.ndim != len(shape) or any(want not in (-1, have) for want, have in zip(shape, value.shape)):
                raise ValueError(f"{name}: expected shape {str(shape).replace('-1', 'm')}, got {value.shape}")
            if not np.isfinite(value).all():
                raise ValueError(f"{name}: not finite")
            object.__setattr__(self, name, value)
        for p in self.hole_pressure if isinstance(self.hole_pressure, Sequence) else [self.hole_pressure]:
            if not isinstance(p, Pressure) and not np.isfinite(p).all():
                raise ValueError("hole_pressure: not finite")
        if not np.isfinite(self.crack_pressure).all():
            raise ValueError("crack_pressure: not finite")
        n = [0 if x is None else len(x) for x in (self.segments, self.tractions)]
        if n[0] != n[1]:
            raise ValueError(f"{n[0]} load segments but {n[1]} tractions")


def check_equilibrium(
    load: BodyLoad,
    reach: float,
    area: float,
    centroid: np.ndarray,
    second: np.ndarray,
    force: np.ndarray,
    gradient: np.ndarray,
    tolerance: float,
    free: FreeMotions | None = None,
) -> None:
    """Raise OutOfEquilibrium unless force and moment vanish within ``tolerance`` of the loads' size.

    ``reach`` is the body's extent; ``area``, ``centroid`` and ``second`` (2, 2) its area moments; ``force`` and
    ``gradient`` the body force about the centroid. With supports only the ``free`` rigid motions count.
    """
    total, moment, size = np.zeros(2), 0.0, 0.0
    if load.segments is not None and len(load.segments):
        total, moment, size = resultants(load.segments, load.tractions, centroid)
    if force.any() or gradient.any():
        total = total + area * force
        turned = gradient @ second
        moment += turned[1, 0] - turned[0, 1]
        size += area * (float(np.hypot(*force)) + float(np.abs(gradient).max()) * reach)
    if size > 0:
        if free is not None:
            total, moment = _unheld(total, moment, centroid, free)
        relative = max(float(np.hypot(*total)), abs(moment) / reach) / size
        if relative > tolerance:
            raise OutOfEquilibrium(total, moment, relative)


def _unheld(total: np.ndarray, moment: float, centroid: np.ndarray, free: FreeMotions) -> tuple[np.ndarray, float]:
    """The part of a force (2,) and a moment about ``centroid`` that does work on the ``free`` rigid motions."""
    arm = free.centre - centroid
    about = moment - (arm[0] * total[1] - arm[1] * total[0])
    work = free.combinations @ (free.combinations.T @ np.array([total[0], total[1], about / free.radius]))
    force, about = work[:2], work[2] * free.radius
    return force, about + arm[0] * force[1] - arm[1] * force[0]


def resultants(segments: np.ndarray, tractions: np.ndarray, about: np.ndarray) -> tuple[np.ndarray, float, float]:
    """(force (2,), moment about ``about``, sum of the sizes of all forces) of linear tractions on ``segments``."""
    if not len(segments):
        return np.zeros(2), 0.0, 0.0
    a, b = segments[:, 0] - about, segments[:, 1] - about
    t_a, t_b = tractions[:, 0], tractions[:, 1]
    length = np.hypot(*(b - a).T)
    forces = length[:, None] * (t_a + t_b) / 2
    # ∫ x × t of two linear functions: Simpson's rule is exact.
    middle, t_middle = (a + b) / 2, (t_a + t_b) / 2

    def cross(p: np.ndarray, q: np.ndarray) -> np.ndarray:
        return p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]

    moments = length / 6 * (cross(a, t_a) + 4 * cross(middle, t_middle) + cross(b, t_b))
    size = float(np.sum(length * (np.hypot(*t_a.T) + np.hypot(*t_b.T)) / 2))
    return forces.sum(axis=0), float(moments.sum()), size
