"""Results of a solved body: stress intensity factors, crack faces, fields at any point, mean strain of the cracks."""

from __future__ import annotations

import logging
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..conventions import normal_of
from ..model import OPEN, SLIP, STICK, CrackFaces
from .crack_contact.face_contact import FaceSolution
from .crack_contact.face_laws import FaceStates, Released
from .crack_contact.frictional_contact import stored_by_fillings
from .kernels import shape_functions
from .kernels.body_force_fields import Particular
from .kernels.full_plane import Elements, Kernel
from .loads.load_vectors import Applied, apply
from .loads.reactions import Reactions, reactions
from .loads.uniform_stress_response import work_at_cracks
from .mesh.edge_location import OFF, onto_boundary, sides_for
from .mesh.field_points import ElementEnds
from .mesh.point_location import onto_rock
from .system.boundary_system import outline_centroid
from .system.influence_matrix import add_fields

if TYPE_CHECKING:
    from .interfaces import CrackedBody
    from .loads.body_loads import BodyLoad


#: Residual above which a warning is logged.
WORTH_A_WARNING = 1e-3
_log = logging.getLogger(__name__)


class LoadTractions(NamedTuple):
    """Tractions of a load, Pa: ``on_boundary`` (n_boundary_unknowns,), seen from outside; ``on_faces`` and
    ``on_closed`` (n_crack_unknowns,), where the boundary was at rest, and where it moves with faces closed."""

    on_boundary: np.ndarray
    on_faces: np.ndarray
    on_closed: np.ndarray


class Solution:
    """A body under a load; results are computed on first use.

    ``jumps`` (n_unknowns,): slip and opening at the collocation nodes of the crack elements, times 2μ; ``closed``:
    closed nodes; ``solves``: iterations of the contact. ``memory`` and ``began``: memory of the faces after and before
    this load (None if all faces are smooth); ``face_load`` (n_unknowns,): traction of the load on closed faces, Pa;
    ``face_traction`` (n_unknowns,): of the solution on the faces, Pa.
    """

    def __init__(
        self,
        body: CrackedBody,
        applied: Applied,
        answer: FaceSolution,
        loads: LoadTractions,
        imposed: np.ndarray,
        edge_density: np.ndarray | None,
    ):
        self.body, self.load, self.solves = body, applied.load, answer.solves
        self.closed, self.memory, self.began = answer.closed, answer.memory, answer.began
        self._applied, self._loads = applied, loads
        self.jumps, self.face_traction = answer.jumps, answer.traction
        self.face_load, self._imposed, self._edge_density = loads.on_faces, imposed, edge_density
        self._tip_errors: np.ndarray | None = None

    @property
    def scales(self) -> bool:
        """Whether all results are proportional to the load: smooth faces that touch without load or never close."""
        return not self.body.rough and not np.any(self.body.closing[0])

    def scaled(self, load: BodyLoad, factor: float) -> Solution:
        """The solution for ``load``, which is ``factor`` (positive) times this one; valid if it `scales`."""
        answer = FaceSolution(factor * self.jumps, factor * self.face_traction, self.closed, 0)
        loads = LoadTractions(*(factor * x for x in self._loads))
        edge_density = None if self._edge_density is None else factor * self._edge_density
        return Solution(self.body, apply(load, self.body), answer, loads, factor * self._imposed, edge_density)

    @cached_property
    def _x(self) -> np.ndarray:
        """(n_unknowns,) boundary unknowns: 2μ times displacement, or reactions where supported."""
        return self.body.boundary_unknowns(self._loads.on_boundary, self.jumps)

    def prepare_fields(self) -> None:
        """Find now what `fields` need if that is found iteratively: the last solution is the first guess of the next, so
        that fields computed beside other solutions would change these within the tolerance."""
        if self.body._outside.iterated:
            _ = self._x

    @cached_property
    def _u(self) -> np.ndarray:
        """(n_unknowns,) 2μ times the displacement of the boundary, without that of the particular field."""
        return self._on_supports[0]

    @cached_property
    def _on_supports(self) -> tuple[np.ndarray, np.ndarray]:
        holds = self.body._outside.holds
        return (self._x, np.zeros(0)) if holds is None else holds.split(self._x, self._imposed)

    @cached_property
    def reactions(self) -> Reactions:
        """Tractions along the supports and their resultants."""
        particular = self._applied.particular
        assert isinstance(particular, Particular)  # a half-plane has no supports
        return reactions(self.body, self._on_supports[1], particular)

    @cached_property
    def states(self) -> np.ndarray:
        """(n_elements, p+1) OPEN, STICK or SLIP at the collocation nodes of the crack elements; closed smooth faces are
        SLIP."""
        c = self.body.faces
        closed = self.closed.reshape(c.n, 2, c.per)[:, 1]
        if self.memory is None:
            return np.where(closed, SLIP, OPEN)
        sticks = self.body.laws.rough & (self.face_states.way == 0)
        return np.where(closed, np.where(sticks.reshape(closed.shape), STICK, SLIP), OPEN)

    @cached_property
    def face_states(self) -> FaceStates:
        """The contact states in the form of the face equations."""
        if self.memory is not None:
            return self.memory.states
        c = self.body.faces
        closed = self.closed.reshape(c.n, 2, c.per)[:, 1].ravel()
        return FaceStates(closed, np.zeros(closed.size, np.int8), np.zeros(closed.size, bool))

    @property
    def frictional_work(self) -> float:
        """J/m dissipated by friction of crack faces since the beginning of the history."""
        return 0.0 if self.memory is None else self.memory.work

    @property
    def dissipated_in_step(self) -> tuple[float, Released]:
        """J/m of this step alone: friction loss of crack faces, and energy released by breaking cement."""
        if self.memory is None or self.began is None:
            return 0.0, Released()
        released = (now - before for now, before in zip(self.memory.released, self.began.released))
        return self.memory.work - self.began.work, Released(*released)

    @cached_property
    def filling_energy(self) -> float:
        """J/m stored in the filling of cracks."""
        if self.memory is None:
            return 0.0
        stored = stored_by_fillings(self.body.laws, self.memory.pressure, self.memory.shear)
        return float(self.body.faces.quadrature.ravel() @ stored) / (2 * self.body.material.shear_modulus)

    @cached_property
    def tips(self) -> np.ndarray:
        """TIP rows in the order of the network's ``tips``, with k_i and k_ii in Pa √m.

        From the leading coefficient of the tip element, D ≈ d√r: K = μ√(2π)/(4(1−ν)) d (Crouch & Starfield 1983).
        K_I is zero if the faces next to the tip are closed, and never negative for a crack without aperture.
        """
        body, c = self.body, self.body.faces
        known, element, last, lead, touching = body.tip_elements
        rows = known.copy()
        if not len(rows):
            return rows
        factor = np.sqrt(2 * np.pi) / (8 * (1 - body.nu))
        slip, opening = factor * np.einsum("tcn,tn->ct", self.jumps.reshape(c.n, 2, c.per)[element], lead)
        shut = touching & ((opening < 0) | self._shut[element, last])
        rows["k_i"], rows["k_ii"] = np.where(shut, 0.0, opening), slip
        return rows

    @property
    def _shut(self) -> np.ndarray:
        """(n_elements, p+1) bool: nodes that are closed without a compliant filling."""
        body, c = self.body, self.body.faces
        closed = self.closed.reshape(c.n, 2, c.per)[:, 1]
        return closed & np.isinf(body.laws.normal).reshape(closed.shape) if body.rough else closed

    @property
    def tip_errors(self) -> np.ndarray:
        """(n_tips, 2) estimated errors of K_I and K_II, Pa √m: those of the target error, or by comparison with a finer
        mesh (`sif_error_estimate`), which takes as long as the solution."""
        if self._tip_errors is None:
            from .fracture.sif_error_estimate import tip_errors

            self._tip_errors = tip_errors(self)
        return self._tip_errors

    @tip_errors.setter
    def tip_errors(self, errors: np.ndarray) -> None:
        self._tip_errors = errors

    @cached_property
    def faces(self) -> CrackFaces:
        """Opening, slip, traction and state at the ends and collocation nodes of each element. Traction at the ends is
        extrapolated linearly from the nodes; state is that of the nearest node."""
        body, c = self.body, self.body.faces
        points, values = c.samples
        jumps = self.jumps.reshape(c.n, 2, c.per) @ values / (2 * body.material.shear_modulus)
        pad = [0, *range(c.per), c.per - 1]
        traction = self.face_traction.reshape(c.n, 2, c.per)[:, :, pad]
        return CrackFaces(
            segment=c.source,
            points=points,
            opening=jumps[:, 1],
            slip=jumps[:, 0],
            traction=traction[:, ::-1].transpose(0, 2, 1),
            state=self.states[:, pad],
        )

    @cached_property
    def reserve(self) -> np.ndarray:
        """(n_elements, p+1) Pa: margin before a node leaves its state in `states`; linear in the load as long as all
        states remain. Open: the stress that closes a crack of the element's length by the gap (inf if the faces never
        meet). Sticking: remaining shear strength, or the pressure if that is less. Otherwise closed: the pressure."""
        laws, faces = self.body.laws, self.faces
        normal, shear = faces.traction[:, 1:-1].transpose(2, 0, 1)
        broken = np.zeros(len(laws.closes), bool) if self.memory is None else self.memory.broken
        shape = normal.shape
        aperture = np.where(laws.closes, laws.aperture / laws.twice_mu, np.inf).reshape(shape)
        stiffness = self.body.material.plane_modulus / self.body.faces.length[:, None]
        lifts = -normal + np.where(laws.cemented(broken), laws.strength, 0.0).reshape(shape)
        left = laws.limit(-normal.ravel(), broken).reshape(shape) - np.abs(shear)
        closed = np.where(self.states == STICK, np.minimum(lifts, left), lifts)
        return np.where(self.states == OPEN, stiffness * (faces.opening[:, 1:-1] + aperture), closed)

    @cached_property
    def crack_strain(self) -> np.ndarray:
        """(3,) mean strain of the cracks, (1/A) Σ ∫ sym(n ⊗ [u]) ds, engineering shear. ValueError without outline."""
        if not self.body.outlined:
            raise ValueError("the mean strain of cracks needs a body with an outline")
        return self.body.strain_weights @ self.jumps

    @cached_property
    def crack_energy(self) -> float:
        """J/m by which crack jumps increase the elastic energy of the body: ½ ∫ (t₀ − t)·[u] ds (Clapeyron), with t₀
        the traction of the loads on closed faces and t that on the faces."""
        body, c = self.body, self.body.faces
        if not self.jumps.size:
            return 0.0
        # t − t₀ = S w. With friction the traction of every node follows from its equation, without a product.
        rough = self.memory is not None
        moved = self.face_traction - self.closed_traction if rough else body.crack_system.matrix @ self.jumps
        change = (moved * self.jumps).reshape(c.n, 2, c.per).sum(axis=1)
        return -0.5 * float(np.sum(c.quadrature * change)) / (2 * body.material.shear_modulus)

    @property
    def closed_traction(self) -> np.ndarray:
        """(n_crack_unknowns,) Pa: t₀ of this load (`Body.closed_traction`)."""
        return self._loads.on_closed

    def work_at_cracks(self, closed: np.ndarray) -> float:
        """J/m, ∫ t₀·[u] ds with t₀ = ``closed`` (n_crack_unknowns,), the traction of some load on closed faces: by
        reciprocity the work of that load on the displacement that the cracks of this solution add to the body."""
        return work_at_cracks(self.body, closed, self.jumps) if self.jumps.size else 0.0

    @cached_property
    def residual(self) -> float:
        """Largest residual traction at the collocation nodes, relative to the largest acting traction (`_acting`). It
        is mostly due to discretised loads that are not exactly in equilibrium. Logs a warning above 1e-3."""
        body = self.body
        on_boundary, on_faces = body.tractions(self._x, self.jumps)
        on_boundary, on_faces = on_boundary + self._loads.on_boundary, on_faces + self.face_load - self.face_traction
        scale = self._acting
        left = max((float(np.abs(x).max()) for x in (on_boundary, on_faces) if x.size), default=0.0)
        residual = left / scale if scale else left
        if residual > WORTH_A_WARNING:
            _log.warning("the equations of the body have a residual of %.1e", residual)
        return residual

    @property
    def _acting(self) -> float:
        """Pa: largest traction of loads at the collocation nodes of boundary and cracks and of fluid and contact on
        crack faces, or the stress 2μ u/L of a prescribed displacement u over the body's extent L."""
        body, imposed = self.body, self._imposed
        on_boundary, on_faces = self._loads.on_boundary, self.face_load
        if imposed.size:
            # The loads include prescribed displacements, whose jump at the supports' ends gives a traction that grows
            # as elements shrink.
            on_boundary = on_boundary - body._outside.known @ imposed
            on_faces = on_faces - body._c_known @ imposed
        sizes = (on_boundary, on_faces, self.face_traction, imposed / body._extent)
        return max((float(np.abs(x).max()) for x in sizes if x.size), default=0.0)

    @cached_property
    def condition(self) -> float:
        """Estimated condition number of the worse of the two matrices, rows scaled to equal size."""
        body = self.body
        cracks = body.crack_system.rcond(self.closed) if not body.rough else body.face_equations.rcond(self.face_states)
        return 1.0 / min(cracks, body._outside.rcond)

    def stress(self, points: np.ndarray, side: float = 1.0) -> np.ndarray:
        """(n, 3) total stress at ``points`` (n, 2), Pa.

        All fields are nan where there is no rock: outside the outline, in holes and above the surface of a half-plane.
        Points within a millionth of the body's extent of a boundary count as rock. On a crack the result is that of the
        upper face (left of its segment), or of the lower face with ``side`` −1. Within a fiftieth of the element's
        length of tips, corners and crack nodes, where the discrete field is singular, the result is that at this
        distance.
        """
        return self._total(points, side)[0]

    def principal_stress(self, points: np.ndarray, side: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """(n, 2) in-plane principal stresses of `stress`, Pa, the larger first, and the angle (n,) from x to its
        direction, rad, in (−π/2, π/2]."""
        xx, yy, xy = self.stress(points, side).T
        mean, radius = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
        return np.column_stack([mean + radius, mean - radius]), 0.5 * np.arctan2(2 * xy, xx - yy)

    def displacement(self, points: np.ndarray, side: float = 1.0) -> np.ndarray:
        """(n, 2) displacement at ``points`` (n, 2), m, on cracks that of the face on ``side``. Mean displacement and
        rotation of the outline are zero as far as supports leave them free. In the infinite plane the uniform strain
        has zero displacement at the origin, in a half-plane at the point that defines the surface."""
        return self.fields(points, side)[1]

    def fields(self, points: np.ndarray, side: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """`stress` and `displacement` at ``points`` (n, 2), in the time of one of them."""
        points = np.asarray(points, dtype=float).reshape(-1, 2)
        stress, displacement = self._total(points, side)
        return stress, displacement - _rigid(self._motion, self.body.centroid, points)

    def _total(self, points: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray]:
        body = self.body
        points = np.ascontiguousarray(points, dtype=float).reshape(-1, 2)
        n = len(points)
        points, out = onto_rock(body.loops, points, OFF * body._extent, body._tol)
        where, double = self._ends.moved_off(points, side)
        stress, shift = np.zeros((len(where), 3)), np.zeros((len(where), 2))
        nu, net = body.nu, sum((p.force for p in self._applied.kelvin), np.zeros(2))

        def add(start, end, kind, density, tol, force, side=1.0):
            elements, kernel = Elements(start, end, kind), Kernel(nu, tol, side, force)
            add_fields(where, elements, density, kernel, stress, shift, body.half_plane)
            if force:
                constant, carried = _kelvin_constant(start, end, density, nu)
                shift[:] += constant
                net[:] += carried

        for elements, values, seen_from in ((body.boundary, self._u, 1.0), (body.faces, self.jumps, side)):
            if elements.n:
                density = elements.densities(values)
                add(elements.start, elements.end, elements.kind, density, body._tol, False, seen_from)
        if body.supports:
            assert body._outside.holds is not None
            sources = body._outside.holds.sources
            add(sources.start, sources.end, sources.kind, sources.densities(self._on_supports[1]), body._tol, True)
        if len(self._applied.segments):
            start, end, density = self._line_forces
            add(start, end, np.zeros(len(start), np.int64), density, 2 * OFF * body._extent, True)
        if self._edge_density is not None:
            edges = body.mesh.edges
            kind = np.zeros(len(edges), np.int64)
            add(edges[:, 0], edges[:, 1], kind, self._edge_density, body._tol, True)
        for part in self._applied.lines:
            add(part.start, part.end, np.zeros(len(part.start), np.int64), part.density, 2 * OFF * body._extent, True)
        if body.outlined:
            # The forces are in equilibrium only up to discretisation error. With logarithms in units of the body's
            # extent the displacement does not depend on the unit of length.
            shift += net * (3 - 4 * nu) * np.log(body._extent) / (4 * np.pi * (1 - nu))
        shift /= 2 * body.material.shear_modulus
        stress, shift = stress + self._applied.stress(where), shift + self._applied.displacement(where)
        above = body.half_plane is not None and body.half_plane.frame(points)[:, 1] > 2 * OFF * body._extent
        for field in (stress, shift):
            field[double] = 0.5 * (field[double] + field[n:])
            field[out] = field[:n][above] = np.nan
        return stress[:n], shift[:n]

    @cached_property
    def _line_forces(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        body = self.body
        start, end, density = [], [], []
        edges = sides_for(body.mesh, self._applied.segments)
        for k, (segment, ends) in enumerate(zip(self._applied.segments, self._applied.tractions)):
            (a, b), against, _ = onto_boundary(edges, segment, f"load segment {k}", body._extent)
            ends = ends[::-1] if against else ends
            t = (b - a) / np.hypot(*(b - a))
            local = ends @ np.column_stack([t, normal_of(t)])
            start.append(a)
            end.append(b)
            density.append(np.stack([local.mean(axis=0), 0.5 * (local[1] - local[0])], axis=1))
        return np.array(start), np.array(end), np.array(density)

    @cached_property
    def _ends(self) -> ElementEnds:
        return ElementEnds(self.body.boundary, self.body.faces, 1e-12 * self.body._extent)

    @cached_property
    def _motion(self) -> np.ndarray:
        """(3,) mean displacement and rotation of the outline about the centroid, as far as supports leave them free;
        subtracted from all displacements."""
        body, g = self.body, self.body.boundary
        if not body.outlined:
            return np.zeros(3)
        here = np.flatnonzero(body.mesh.edge_loop[g.source] == 0)
        u = self._u.reshape(g.n, 2, g.per)[here] / (2 * body.material.shear_modulus)
        x, ds = g.nodes[here], g.quadrature[here]
        total = u[:, 0, :, None] * g.tangent[here, None] + u[:, 1, :, None] * g.normal[here, None]
        total = total + self._applied.regular(x.reshape(-1, 2)).reshape(x.shape)
        perimeter, centroid, radius = outline_centroid(g.take(here))
        mean = np.einsum("ej,ejc->c", ds, total) / perimeter
        rel = x - centroid
        turn = np.einsum("ej,ej->", ds, rel[..., 0] * total[..., 1] - rel[..., 1] * total[..., 0])
        turn /= perimeter * radius**2
        free = body._outside.free_motions
        if free is not None:
            ways = free.combinations
            *mean, turn = ways @ (ways.T @ np.array([*mean, turn * radius]))
            turn /= radius
        arm = body.centroid - centroid
        return np.array([mean[0] - turn * arm[1], mean[1] + turn * arm[0], turn])


def _kelvin_constant(
    start: np.ndarray, end: np.ndarray, density: np.ndarray, nu: float
) -> tuple[np.ndarray, np.ndarray]:
    """(2,) 2μ times the translation by which the line forces of the kernels differ from Kelvin's solution, and (2,) the
    sum of the forces.

    The kernels have −y²/r² instead of Kelvin's x²/r² = 1 − y²/r², which shifts each element's field by a constant along
    the element. The correction brings the plane to rest at infinity.
    """
    whole = 0.5 * density @ shape_functions.moments()[shape_functions.ORDINARY, : density.shape[2]]
    along = end - start
    across = np.column_stack([-along[:, 1], along[:, 0]])
    moved = (along * whole[:, :1]).sum(axis=0)
    return moved / (4 * np.pi * (1 - nu)), moved + (across * whole[:, 1:]).sum(axis=0)


def _rigid(motion: np.ndarray, centre: np.ndarray, points: np.ndarray) -> np.ndarray:
    rel = points - centre
    return np.column_stack([motion[0] - motion[2] * rel[:, 1], motion[1] + motion[2] * rel[:, 0]])
