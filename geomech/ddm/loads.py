"""Loads on a body: tractions on pieces of its boundary, body forces, remote stress, pressure in the cracks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


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
    """

    segments: np.ndarray | None = None
    tractions: np.ndarray | None = None
    body_force: np.ndarray | None = None
    body_force_gradient: np.ndarray | None = None
    about: np.ndarray | None = None
    remote_stress: np.ndarray | None = None
    crack_pressure: np.ndarray | float = 0.0

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
) -> None:
    """Raise OutOfEquilibrium unless force and moment vanish within ``tolerance`` of the loads' size.

    ``reach`` is the body's extent; ``area``, ``centroid`` and ``second`` (2, 2) its area moments; ``force`` and
    ``gradient`` the body force about the centroid.
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
        relative = max(float(np.hypot(*total)), abs(moment) / reach) / size
        if relative > tolerance:
            raise OutOfEquilibrium(total, moment, relative)


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
