"""Loads applied to a given body: particular fields and line forces on its boundary."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.body_force_fields import DepthDependentStress, Particular
from ..kernels.point_forces import KelvinLoad, MelanLoad, WedgeLoad
from ..kernels.traction_fields import LineForces, approximate, pieces
from ..mesh.edge_location import OFF, onto_boundary, sides_for
from ..system.influence_matrix import ElementSet
from .body_loads import BodyLoad, IntactField, OutOfEquilibrium, resultants
from .unit_load_cache import on_elements

if TYPE_CHECKING:
    from ..interfaces import CrackedBody
    from .hole_supports import Anchors

#: Where a point load cannot be singular it is distributed over this part of the body's extent.
SPREAD = 0.01


@dataclass(eq=False)
class Applied:
    """``load`` on a body.

    particular   field of the body force and the uniform stress
    segments, tractions  (m, 2, 2) linear tractions: the load's own, those of sides, and distributed point loads
    functions    tractions given as functions
    kelvin       point loads inside the rock, or all of them with ``load.kelvin``
    wedges       point loads on its boundary
    left_over    minus the tractions of the wedges' fields on the boundary
    """

    load: BodyLoad
    particular: Particular | DepthDependentStress
    segments: np.ndarray
    tractions: np.ndarray
    functions: LineForces | None = None
    kelvin: list[KelvinLoad] = field(default_factory=list)
    wedges: list[WedgeLoad] = field(default_factory=list)
    left_over: LineForces | None = None

    @property
    def plain(self) -> bool:
        """Whether the load consists of linear tractions and the particular field only."""
        return self.functions is None and not self.kelvin and not self.wedges

    @property
    def lines(self) -> list[LineForces]:
        """Line forces other than the segments."""
        return [part for part in (self.functions, self.left_over) if part is not None]

    def on(
        self, targets: ElementSet, on_boundary: bool, nu: float, tol: float, anchors: Anchors | None = None
    ) -> np.ndarray:
        """(n_unknowns,) traction at the collocation nodes of ``targets`` from all parts that are not `plain`;
        ``anchors`` are those of supported holes."""
        out = np.zeros(targets.n_unknowns)
        points = targets.nodes.reshape(-1, 2)
        # On the boundary the line forces stand for the wedges' own traction.
        for p in (*self.kelvin, *(() if on_boundary else self.wedges)):
            out += on_elements(targets, p.stress(points))
        for part in self.lines:
            out += part.on(targets, on_boundary, nu, tol)
        if anchors is not None:
            for part in self.lines:
                unit = anchors.of_forces(part.start, part.end, part.density.shape[2] - 1)
                out += anchors.rows @ np.tensordot(unit, part.density, 3)
            for p in self.kelvin:
                out += anchors.rows @ anchors.of_points(p.point[None], p.force[None])
        return out

    def stress(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) stress, Pa, of all parts except line forces."""
        points_of: list[KelvinLoad | WedgeLoad] = [*self.kelvin, *self.wedges]
        out = self.particular.stress(points) + sum(p.stress(points) for p in points_of)
        return out if self.load.intact is None else out + self.load.intact.stress(points)

    def displacement(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) displacement, m, of all parts except line forces."""
        return self.regular(points) + sum(p.displacement(points) for p in self.kelvin)

    def regular(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) displacement, m, that is not contained in the boundary's unknowns."""
        out = self.particular.displacement(points) + sum(p.displacement(points) for p in self.wedges)
        return out if self.load.intact is None else out + self.load.intact.displacement(points)


def apply(load: BodyLoad, body: CrackedBody) -> Applied:
    """``load`` applied to ``body``. Raises ValueError naming the part that does not fit the body."""
    if load.intact is not None and not body.outlined:
        raise ValueError("intact: the field of a body without cracks is for bodies with an outline")
    none = np.empty((0, 2, 2))
    out = Applied(
        load,
        _particular(load, body),
        none if load.segments is None else load.segments,
        none if load.tractions is None else load.tractions,
    )
    functions = []
    if load.intact is not None and len(body.loops) > 1:
        functions.append(_free_walls(load.intact, body))
        out.particular = _balancing(out.particular, functions[0], body)
        out.functions = functions[0]
    if not load.sides and load.points is None:
        return out
    segments, tractions = [out.segments], [out.tractions]
    edges, boundary = body.mesh.edges, body.boundary
    for number, (where, value) in enumerate(load.sides):
        name = f"side {where}" if isinstance(where, int) else f"side load {number}"
        if not len(edges) and (body.half_plane is None or isinstance(where, int)):
            raise ValueError(f"{name}: the body has no boundary")
        if isinstance(where, int):
            if not 0 <= where < len(edges):
                raise ValueError(f"{name}: there is no such edge, the body has {len(edges)}")
            segment, edge = edges[where], where
        else:
            segment = np.array(where)
            segment, against, edge = onto_boundary(sides_for(body.mesh, segment), segment, name, body._extent)
            value = value[::-1] if against and not callable(value) and value.ndim == 2 else value
        if callable(value):
            # A free surface has no elements that could be divided at the load.
            start, end = pieces(boundary, edge, segment) if edge < len(edges) else (segment[:1], segment[1:])
            functions.append(approximate(value, start, end, name))
        else:
            segments.append(segment[None])
            tractions.append(np.broadcast_to(value, (2, 2))[None])
    if load.points is not None and load.forces is not None:
        for k, (point, force) in enumerate(zip(load.points, load.forces)):
            _point(out, body, k, point, force, segments, tractions)
    out.segments, out.tractions = np.concatenate(segments), np.concatenate(tractions)
    out.functions = LineForces.join(functions)
    out.left_over = LineForces.join([_left_over(wedge, body) for wedge in out.wedges])
    return out


def _particular(load: BodyLoad, body: CrackedBody) -> Particular | DepthDependentStress:
    force = np.zeros(2) if load.body_force is None else load.body_force
    gradient = np.zeros((2, 2)) if load.body_force_gradient is None else load.body_force_gradient
    uniform = np.zeros(3) if load.remote_stress is None else load.remote_stress
    if body.half_plane is not None:
        body.half_plane.check_uniform(uniform)
        body.half_plane.check_force(gradient)
        return DepthDependentStress.of(body.half_plane, force, load.k0, uniform, body.material)
    if load.k0 is not None:
        raise ValueError("k0: stress that grows with depth is possible in a half-plane only")
    if not body.outlined and (force.any() or gradient.any()):
        raise ValueError("a body force needs a body with an outline")
    if load.about is not None:
        force = force + gradient @ (body.centroid - load.about)
    return Particular(body.centroid, force, gradient, uniform, body.material)


def _free_walls(field: IntactField, body: CrackedBody) -> LineForces:
    """Tractions on the walls of holes that cancel those of ``field``, which is that of a body without holes."""
    parts = []
    for edge in np.flatnonzero(body.mesh.edge_loop > 0).tolist():
        way = body.mesh.edges[edge, 1] - body.mesh.edges[edge, 0]
        # Holes are clockwise: the rock is on the left of an edge, and its outward normal on the right.
        x, y = way[1] / np.hypot(*way), -way[0] / np.hypot(*way)

        def freeing(points: np.ndarray, x: float = x, y: float = y) -> np.ndarray:
            xx, yy, xy = field.stress(points).T
            return -np.column_stack([xx * x + xy * y, xy * x + yy * y])

        parts.append(approximate(freeing, *pieces(body.boundary, edge), "intact"))
    joined = LineForces.join(parts)
    assert joined is not None
    return joined


def _balancing(particular: Particular | DepthDependentStress, walls: LineForces, body: CrackedBody) -> Particular:
    """``particular`` with a body force that balances the tractions on ``walls``: uniform, and growing as in a rotation.
    A polynomial stress field of finite order is in equilibrium in the mean only, and not across a hole."""
    assert isinstance(particular, Particular)  # there is an outline
    force, moment, _ = walls.resultants(body.centroid)
    turn = -moment / np.trace(body._second)
    return replace(
        particular, force=particular.force - force / body.area,
        gradient=particular.gradient + turn * np.array([[0.0, -1.0], [1.0, 0.0]]),
    )  # fmt: skip


def _point(out: Applied, body: CrackedBody, k: int, point, force, segments: list, tractions: list) -> None:
    """Add point load ``k`` as the kind of load that its location requires."""
    from ..mesh.point_location import inside

    edges, loop, rock = body.mesh.edges, body.mesh.edge_loop, body.half_plane
    if rock is not None:
        height = rock.frame(point)[1]
        if abs(height) <= OFF * body._extent:
            at = point - height * np.asarray(rock.outward)
            out.wedges.append(WedgeLoad(at, force, -np.asarray(rock.outward), 0.5 * np.pi, body.material))
            return
    if len(edges):
        a, d = edges[:, 0], edges[:, 1] - edges[:, 0]
        s = np.clip(np.sum((point - a) * d, axis=1) / np.sum(d * d, axis=1), 0.0, 1.0)
        off = np.hypot(*(a + s[:, None] * d - point).T)
        edge = int(np.argmin(off))
    if not len(edges) or off[edge] > OFF * body._extent:
        if not inside(body.limits, point[None])[0] or (rock is not None and height > 0):
            raise ValueError(f"point load {k} at ({point[0]:g}, {point[1]:g}) is not on the body")
        out.kelvin.append(_kelvin(body, point, force))
        return
    length = np.hypot(*d[edge])
    # At a corner: `edge` becomes the one that starts there.
    if s[edge] * length <= OFF * body._extent or (1 - s[edge]) * length <= OFF * body._extent:
        if s[edge] > 0.5:
            edge = int(np.flatnonzero(np.all(edges[:, 0] == edges[edge, 1], axis=1))[0])
        before = int(np.flatnonzero(np.all(edges[:, 1] == edges[edge, 0], axis=1))[0])
        corner, at = True, edges[edge, 0]
    else:
        before, corner, at = edge, False, a[edge] + s[edge] * d[edge]
    if out.load.kelvin:
        # Not at a corner, where no element's node is near; along an edge a node may be near, and would take the whole
        # load.
        core = 0.0 if corner else min(SPREAD * body._extent, s[edge] * length, (1 - s[edge]) * length)
        out.kelvin.append(_kelvin(body, at, force, 0.5 * core))
        return
    out_way = d[edge] / np.hypot(*d[edge])
    back = -d[before] / np.hypot(*d[before])
    opening = np.arctan2(out_way[0] * back[1] - out_way[1] * back[0], out_way @ back) % (2 * np.pi) if corner else np.pi
    turn = 0.5 * opening
    axis = np.array(
        [out_way[0] * np.cos(turn) - out_way[1] * np.sin(turn), out_way[1] * np.cos(turn) + out_way[0] * np.sin(turn)]
    )
    if body.outlined and loop[edge] == 0 and not _meets(edges, at, -axis, {edge, before}, body._extent):
        out.wedges.append(WedgeLoad(at, force, axis, turn, body.material))
        return
    # Displacement would have a branch cut inside the rock. Distributed, the force keeps its line of action.
    room = (1 - s[edge]) * length if not corner else length
    width = min(SPREAD * body._extent, room if corner else min(room, s[edge] * length))
    if corner:
        segments.append(np.stack([at, at + width * out_way])[None])
        tractions.append(np.stack([4 * force, -2 * force])[None] / width)
    else:
        segments.append(np.stack([at - 0.5 * width * out_way, at + 0.5 * width * out_way])[None])
        tractions.append(np.stack([force, force])[None] / width)


def _kelvin(body: CrackedBody, point: np.ndarray, force: np.ndarray, core: float = 0.0) -> KelvinLoad:
    if body.half_plane is None:
        return KelvinLoad(point, force, body.material, core=core)
    return MelanLoad(point, force, body.material, core=core, half_plane=body.half_plane)


def _meets(edges: np.ndarray, origin: np.ndarray, way: np.ndarray, own: set[int], extent: float) -> bool:
    """Whether a ray meets any of ``edges`` other than ``own``."""
    rest = np.delete(np.arange(len(edges)), list(own))
    side = (edges[rest] - origin) @ np.array([-way[1], way[0]])
    ahead = (edges[rest] - origin) @ way
    across = side[:, 0] * side[:, 1] <= 0
    return bool((across & (ahead.max(axis=1) > 1e-9 * extent)).any())


def _left_over(wedge: WedgeLoad, body: CrackedBody) -> LineForces | None:
    """Minus the tractions of the ``wedge``'s field on the boundary, away from the wedge's own sides."""
    edges, parts = body.mesh.edges, []
    for edge in range(len(edges)):
        d = edges[edge, 1] - edges[edge, 0]
        t = d / np.hypot(*d)
        rel = edges[edge] - wedge.point
        if np.abs(rel @ np.array([-t[1], t[0]])).max() <= 1e-9 * body._extent + 2 * body._tol:
            continue
        out = np.array([t[1], -t[0]])

        def traction(points: np.ndarray, out: np.ndarray = out) -> np.ndarray:
            s = wedge.stress(points)
            return -np.column_stack([s[:, 0] * out[0] + s[:, 2] * out[1], s[:, 2] * out[0] + s[:, 1] * out[1]])

        parts.append(approximate(traction, *pieces(body.boundary, edge), "a point load"))
    return LineForces.join(parts)


def check_equilibrium(applied: Applied, body: CrackedBody, tolerance: float) -> None:
    """Raise OutOfEquilibrium unless force and moment vanish within ``tolerance`` of the loads' magnitude.

    With supports, only the components that no support resists are checked.
    """
    force, gradient = applied.particular.force, applied.particular.gradient
    total, moment, size = np.zeros(2), 0.0, 0.0

    def add(push: np.ndarray, turn: float, much: float) -> None:
        nonlocal total, moment, size
        total, moment, size = total + push, moment + turn, size + much

    if len(applied.segments):
        add(*resultants(applied.segments, applied.tractions, body.centroid))
    if force.any() or gradient.any():
        turned = gradient @ body._second
        strength = float(np.hypot(*force)) + float(np.abs(gradient).max()) * body._reach
        add(body.area * force, turned[1, 0] - turned[0, 1], body.area * strength)
    for k, pressure in enumerate(applied.load.hole_pressures(len(body.loops) - 1)):
        way = np.asarray(pressure.gradient, dtype=float)
        area, centre = body.hole_moments[k]
        arm = centre - body.centroid
        add(area * way, area * (arm[0] * way[1] - arm[1] * way[0]), abs(pressure.at(centre)) * np.sqrt(area))
    at_points: list[KelvinLoad | WedgeLoad] = [*applied.kelvin, *applied.wedges]
    for p in at_points:
        arm = p.point - body.centroid
        add(p.force, arm[0] * p.force[1] - arm[1] * p.force[0], float(np.hypot(*p.force)))
    if applied.functions is not None:
        add(*applied.functions.resultants(body.centroid))
    if size > 0:
        free = body._outside.free_motions
        if free is not None:
            total, moment = free.part(total, moment, body.centroid)
        relative = max(float(np.hypot(*total)), abs(moment) / body._reach) / size
        if relative > tolerance:
            raise OutOfEquilibrium(total, moment, relative)
