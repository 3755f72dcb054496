"""Loads on an elastic body: boundary tractions, body forces, remote stress, pressure in cracks and holes, point
loads."""

from __future__ import annotations

from abc import ABCMeta, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...model import History


class OutOfEquilibrium(ValueError):
    """Raised where the loads' resultants do not vanish, so that no static solution exists.

    ``force`` (2,) N/m, ``moment`` N about the centroid, ``relative`` to the sum of the loads' magnitudes.
    """

    def __init__(self, force: np.ndarray, moment: float, relative: float):
        self.force, self.moment, self.relative = force, moment, relative
        super().__init__(
            f"the loads are out of equilibrium: force ({force[0]:.6g}, {force[1]:.6g}) N/m, moment {moment:.6g} N "
            f"about the centroid, {relative:.3g} of the loads' size"
        )


class IntactField(metaclass=ABCMeta):
    """Stress and displacement that further loads cause in a body without cracks, whatever these loads are. Their
    tractions act on its outline."""

    @abstractmethod
    def stress(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) Pa at ``points`` (n, 2)."""

    @abstractmethod
    def displacement(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) m at ``points`` (n, 2)."""

    @abstractmethod
    def scaled(self, factor: float) -> IntactField:
        """The field multiplied by ``factor``."""

    @abstractmethod
    def with_added(self, other: IntactField) -> IntactField:
        """Sum of the two fields."""


@dataclass(frozen=True)
class Pressure:
    """Fluid pressure: ``value`` Pa at ``about`` (x, y), growing by ``gradient`` Pa/m.

    Water with its level at y0 is ``Pressure(0, (0, -9.81e3), (0, y0))``. Raises ValueError if a number is not finite.
    """

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
    """Loads on a body. All parts are optional and are superposed.

    segments             (m, 2, 2)  straight pieces of the boundary, directed along it
    tractions            (m, 2, 2)  traction (Pa, x and y) at the start and end of each, linear in between
    body_force           (2,)       N/m³ at ``about``; in a half-plane, where stress then grows with depth, everywhere
    body_force_gradient  (2, 2)     N/m⁴: b(x) = body_force + gradient (x − about)
    about                (2,)       m; by default the centroid
    k0                   in a half-plane, ratio of the stress along the surface to the stress normal to it that the
                         body force causes; by default ν/(1−ν), rock that is confined laterally
    remote_stress        (3,)       Pa: a uniform stress in addition. On a finite body the tractions in equilibrium
                                    with it act on the outline, in addition to ``tractions``; holes are free of them.
                                    In a half-plane it must be parallel to the surface
    crack_pressure       scalar or (n_segments,)  Pa, of a fluid in the cracks, positive in compression; or a
                         `Pressure`, or a function of points (n, 2) to (n,)
    hole_pressure        the same in all holes, or a list with a number (Pa) or a `Pressure` for each
    displacements        for every support of the body the prescribed displacement, m: None (zero), constant (2,),
                         linear (2, 2) from its values at the support's ends, or a function of points (n, 2);
                         components in directions that the support leaves free are ignored
    sides                {where: traction}: the number of an edge or a straight piece ((x, y), (x, y)), to a traction
                         (Pa, x and y) that is constant (2,), linear (2, 2) from its values at the ends, or a function
                         of points (n, 2) to (n, 2)
    points, forces       (k, 2) m and N/m: point loads inside the rock or on its boundary. They are singular, except
                         on holes and where the plane beyond the boundary contains rock: there they are distributed
                         over a hundredth of the extent
    intact               field of further loads in the body without cracks (`IntactField`): cracks open by its stress as
                         they do by a `remote_stress`, in a body with an outline and without holes
    kelvin               True: point loads on the boundary also are Kelvin's solution for the infinite plane. The rock
                         beyond the boundary then carries part of them, about half on an edge, three quarters at a
                         right-angled corner: no element's displacement is singular enough to correct that

    Raises ValueError naming the part that is not finite or has the wrong shape.
    """

    segments: np.ndarray | None = None
    tractions: np.ndarray | None = None
    body_force: np.ndarray | None = None
    body_force_gradient: np.ndarray | None = None
    about: np.ndarray | None = None
    k0: float | None = None
    remote_stress: np.ndarray | None = None
    crack_pressure: np.ndarray | float = 0.0
    hole_pressure: Pressure | Sequence[Pressure | float] | float = 0.0
    displacements: Sequence | None = None
    sides: Mapping | Sequence[tuple] = ()
    points: np.ndarray | None = None
    forces: np.ndarray | None = None
    kelvin: bool = False
    intact: IntactField | None = None

    def scaled(self, factor: float) -> BodyLoad:
        """The load multiplied by ``factor``."""
        changed = {
            name: _times(getattr(self, name), factor)
            for name in ("tractions", "body_force", "body_force_gradient", "remote_stress", "crack_pressure", "forces")
        }
        displacements, holes = self.displacements, self.hole_pressure
        if displacements is not None:
            displacements = [_times(value, factor) for value in displacements]
        if isinstance(holes, (Sequence, np.ndarray)):
            holes = [_times(p, factor) for p in holes]
        else:
            holes = _times(holes, factor)
        sides = [(where, _times(value, factor)) for where, value in self.sides]
        intact = None if self.intact is None else self.intact.scaled(factor)
        return replace(self, **changed, displacements=displacements, hole_pressure=holes, sides=sides, intact=intact)

    def with_added(self, other: BodyLoad) -> BodyLoad:
        """Sum of the two loads. Raises ValueError if body forces are given about different points, or if point loads
        are Kelvin's in only one of them."""
        if self.kelvin != other.kelvin and self.points is not None and other.points is not None:
            raise ValueError("cannot add loads of which only one has kelvin = True for point loads on the boundary")
        summed = {
            name: _plus(getattr(self, name), getattr(other, name))
            for name in ("body_force", "body_force_gradient", "remote_stress", "crack_pressure")
        }
        graded = [load for load in (self, other) if load.body_force_gradient is not None]
        if len(graded) == 2 and not _equal(self.about, other.about):
            raise ValueError("body forces given about different points cannot be added")
        about = graded[0].about if graded else None
        heavy = [load for load in (self, other) if load.body_force is not None]
        if len(heavy) == 2 and self.k0 != other.k0:
            raise ValueError("body forces with different k0 cannot be added")
        k0 = heavy[0].k0 if heavy else None
        holes = [self.hole_pressure, other.hole_pressure]
        lists = [list(p) for p in holes if isinstance(p, (Sequence, np.ndarray))]
        if lists:
            n = len(lists[0])
            pair = [list(p) if isinstance(p, (Sequence, np.ndarray)) else [p] * n for p in holes]
            pressure = [_plus(p, q) for p, q in zip(*pair, strict=True)]
        else:
            pressure = _plus(*holes)
        own, others = self.displacements, other.displacements
        if own is None or others is None:
            displacements = own if others is None else others
        else:
            displacements = [_plus(a, b) for a, b in zip(own, others, strict=True)]
        return BodyLoad(
            segments=_joined(self.segments, other.segments),
            tractions=_joined(self.tractions, other.tractions),
            points=_joined(self.points, other.points),
            forces=_joined(self.forces, other.forces),
            **summed,
            about=about,
            k0=k0,
            hole_pressure=pressure,
            displacements=displacements,
            sides=(*self.sides, *other.sides),
            kelvin=self.kelvin or other.kelvin,
            intact=_sum_of_fields(self.intact, other.intact),
        )

    def hole_pressures(self, n_holes: int) -> list[Pressure]:
        """Pressure in each hole, [] if there is none. Raises ValueError if their number does not match."""
        given = self.hole_pressure
        if isinstance(given, Sequence) or (isinstance(given, np.ndarray) and given.ndim):
            each = list(given)
        elif not isinstance(given, Pressure) and given == 0:
            return []
        elif not n_holes:
            raise ValueError("a pressure in holes is given, but the body has none")
        else:
            each = [given] * n_holes
        if len(each) != n_holes:
            raise ValueError(f"{n_holes} holes but {len(each)} pressures")
        return [p if isinstance(p, Pressure) else Pressure(float(p)) for p in each]

    def face_pressure(self, points: np.ndarray, segment: np.ndarray, n_segments: int) -> np.ndarray | float:
        """(n, m) Pa at ``points`` (n, m, 2) on crack elements of ``segment`` (n,), or an array that broadcasts to it.
        Raises ValueError."""
        p = self.crack_pressure
        if isinstance(p, Pressure):
            return p.at(points)
        if callable(p):
            out = np.asarray(p(points.reshape(-1, 2)), dtype=float)
            if out.size != points[..., 0].size or not np.isfinite(out).all():
                raise ValueError("crack_pressure: the function must give a finite number for every point")
            return out.reshape(points.shape[:-1])
        if np.ndim(p) == 0:
            return float(p)
        if np.shape(p) != (n_segments,):
            raise ValueError(f"crack_pressure: {n_segments} crack segments but shape {np.shape(p)}")
        return np.asarray(p, dtype=float)[segment][:, None]

    def __post_init__(self) -> None:
        shapes = {
            "segments": (-1, 2, 2),
            "tractions": (-1, 2, 2),
            "body_force": (2,),
            "body_force_gradient": (2, 2),
            "about": (2,),
            "remote_stress": (3,),
            "points": (-1, 2),
            "forces": (-1, 2),
        }
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value is None:
                continue
            value = np.ascontiguousarray(value, dtype=float)
            if value.ndim != len(shape) or value.shape != (
                *(value.shape[:1] if shape[0] < 0 else shape[:1]),
                *shape[1:],
            ):
                raise ValueError(f"{name}: expected shape {str(shape).replace('-1', 'm')}, got {value.shape}")
            if not np.isfinite(value).all():
                raise ValueError(f"{name}: not finite")
            object.__setattr__(self, name, value)
        for p in self.hole_pressure if isinstance(self.hole_pressure, Sequence) else [self.hole_pressure]:
            if not isinstance(p, Pressure) and not np.isfinite(p).all():
                raise ValueError("hole_pressure: not finite")
        in_cracks = self.crack_pressure
        if not callable(in_cracks) and not isinstance(in_cracks, Pressure) and not np.isfinite(in_cracks).all():
            raise ValueError("crack_pressure: not finite")
        n = [0 if x is None else len(x) for x in (self.segments, self.tractions)]
        if n[0] != n[1]:
            raise ValueError(f"{n[0]} load segments but {n[1]} tractions")
        n = [0 if x is None else len(x) for x in (self.points, self.forces)]
        if n[0] != n[1]:
            raise ValueError(f"{n[0]} loaded points but {n[1]} forces")
        pairs = self.sides.items() if isinstance(self.sides, Mapping) else self.sides
        object.__setattr__(self, "sides", tuple(_side(where, value) for where, value in pairs))


def _times(value, factor: float):
    """``factor`` times an array, a pressure or a function; None stays None."""
    if value is None:
        return None
    if callable(value):
        return lambda points: factor * np.asarray(value(points), dtype=float)
    if isinstance(value, Pressure):
        return Pressure(factor * value.value, tuple(factor * np.asarray(value.gradient, dtype=float)), value.about)
    return factor * np.asarray(value, dtype=float)


def _plus(a, b):
    """Sum of two arrays, pressures, functions or None (zero)."""
    if a is None or b is None:
        return b if a is None else a
    if not callable(a) and not callable(b):
        if isinstance(a, Pressure) or isinstance(b, Pressure):
            a, b = (p if isinstance(p, Pressure) else Pressure(_number(p)) for p in (a, b))
            slope = np.asarray(a.gradient, dtype=float) + b.gradient
            return Pressure(float(a.value + b.at(np.asarray(a.about, dtype=float))), tuple(slope), a.about)
        return np.asarray(a, dtype=float) + np.asarray(b, dtype=float)

    def part(value, points: np.ndarray):
        if callable(value):
            return np.asarray(value(points), dtype=float)
        return value.at(points) if isinstance(value, Pressure) else value

    for value in (a, b):
        if not callable(value) and not isinstance(value, Pressure) and np.shape(value) not in ((), (2,)):
            raise ValueError("a list of values cannot be added to a function of position")
    return lambda points: part(a, points) + part(b, points)


def _sum_of_fields(a: IntactField | None, b: IntactField | None) -> IntactField | None:
    if a is None or b is None:
        return b if a is None else a
    return a.with_added(b)


def _number(p) -> float:
    if np.ndim(p):
        raise ValueError("a linear pressure cannot be added to a list with one pressure per crack")
    return float(p)


def _equal(a: np.ndarray | None, b: np.ndarray | None) -> bool:
    return a is b or (a is not None and b is not None and np.array_equal(a, b))


def _joined(a: np.ndarray | None, b: np.ndarray | None) -> np.ndarray | None:
    if a is None or b is None:
        return b if a is None else a
    return np.concatenate([a, b])


def _side(where, value) -> tuple:
    """A pair of `BodyLoad.sides`, checked: an int or (2, 2) as tuples, a function or an array."""
    name = f"side {where}"
    if not isinstance(where, (int, np.integer)):
        piece = np.asarray(where, dtype=float)
        if piece.shape != (2, 2) or not np.isfinite(piece).all():
            raise ValueError(f"{name}: expected an edge's number or the two ends of a piece of the boundary")
        where = tuple(map(tuple, piece.tolist()))
    else:
        where = int(where)
    if not callable(value):
        value = np.array(value, dtype=float)
        if value.shape not in ((2,), (2, 2)):
            raise ValueError(f"{name}: expected a traction (2,), (2, 2) or a function, got shape {value.shape}")
        if not np.isfinite(value).all():
            raise ValueError(f"{name}: its traction is not finite")
    return where, value


def resultants(segments: np.ndarray, tractions: np.ndarray, about: np.ndarray) -> tuple[np.ndarray, float, float]:
    """(force (2,), moment about ``about``, sum of force magnitudes) of linear tractions on ``segments``."""
    if not len(segments):
        return np.zeros(2), 0.0, 0.0
    arms, forces = _arms_and_forces(segments, tractions, about)
    moment = float((arms[..., 0] * forces[..., 1] - arms[..., 1] * forces[..., 0]).sum())
    return 3 * forces.sum(axis=(0, 1)), moment, 3 * float(np.hypot(forces[..., 0], forces[..., 1]).sum())


def first_moments(segments: np.ndarray, tractions: np.ndarray, about: np.ndarray) -> np.ndarray:
    """(2, 2) ∫ r ⊗ t ds of linear ``tractions`` on ``segments``, with r from ``about``, N m."""
    arms, forces = _arms_and_forces(segments, tractions, about)
    return arms.reshape(-1, 2).T @ forces.reshape(-1, 2)


def _arms_and_forces(segments: np.ndarray, tractions: np.ndarray, about: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two (m, 2, 2) arrays with Σ arms · forces = ∫ x t ds.

    For two linear functions along a length L the integral is L/6 Σ x_i t_j, terms with i = j counted twice.
    """
    ends = segments - about
    along = ends[:, 1] - ends[:, 0]
    forces = (np.hypot(along[:, 0], along[:, 1]) / 6)[:, None, None] * tractions
    return ends + ends.sum(axis=1, keepdims=True), forces


@dataclass(frozen=True, eq=False)
class LoadHistory:
    """Loads that vary with time: ``parts`` are pairs of a `BodyLoad` and a factor.

    A factor is a number, a function of time (s), or a `model.History` of one component.
    """

    parts: Sequence[tuple[BodyLoad, float | Callable[[float], float] | History]]

    def at(self, time: float) -> BodyLoad:
        """The load at ``time`` (s)."""
        out: BodyLoad | None = None
        for load, factor in self.parts:
            if isinstance(factor, History):
                factor = factor.at(time)[0]
            part = load.scaled(float(factor(time) if callable(factor) else factor))
            out = part if out is None else out.with_added(part)
        return BodyLoad() if out is None else out
