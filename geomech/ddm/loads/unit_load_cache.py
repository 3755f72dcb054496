"""Responses to unit loads on a body's boundary and cracks, cached because loads mostly recur and change in size
only."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ...model import Material
from ..kernels.body_force_fields import DepthDependentStress, Particular, edge_densities
from ..mesh.edge_location import OFF, onto_boundary, sides_for
from ..mesh.elements import Mesh
from ..system.influence_matrix import ElementSet, line_forces, project_jumps

if TYPE_CHECKING:
    from ..interfaces import LoadParts
    from .hole_supports import Anchors

#: Number of different segments whose loads are cached; …
_REMEMBERED = 400
#: … above so many numbers in all, only those of the last load. Blocks in motion slide, and most segments never come
#: back: those of 48 blocks of a trace map took 1.6 GB after twenty steps.
_NUMBERS = 500_000
#: A unit load is answered when it is used again; where A_CΓ has more numbers, after so many loads: the responses to its four
#: columns take as long as those to fifty loads.
_WORTH_WAITING, _WAITS = 400_000, 10
#: Number of edges or segments whose forces are computed at a time: those of a large boundary on itself would fill
#: memory.
_AT_ONCE = 256


class UnitLoad:
    """Response to unit loads, one per column of ``applied``: tractions g on the boundary above r on the cracks.

    Loads that recur are answered once and then scaled: ``answered`` holds the traction r' = r − A_CΓ A_ΓΓ⁻¹ g on closed
    faces above S⁻¹ r'. ``segment`` is where tractions act, ``against`` whether they were given against the boundary's
    direction; alternatively ``densities`` (m, 2, 3, columns) act on the m edges of the body.
    """

    def __init__(
        self,
        applied: np.ndarray,
        segment: np.ndarray | None = None,
        against: bool = False,
        densities: np.ndarray | None = None,
    ):
        self.applied, self.segment, self.against, self.densities = applied, segment, against, densities
        self.answered: np.ndarray | None = None
        self.uses = 0
        self.turn = 0

    @property
    def numbers(self) -> int:
        """How many numbers it holds."""
        return self.applied.size + (0 if self.answered is None else self.answered.size)


class Reduction(Protocol):
    """What tractions on the boundary do to closed crack faces, A_CΓ A_ΓΓ⁻¹, in two steps."""

    def first(self, load: np.ndarray) -> np.ndarray:
        """What growth leaves valid, of ``load`` (n,) or (n, k)."""

    def then(self, done: np.ndarray, elements: np.ndarray | None = None) -> np.ndarray:
        """The result, of that step, on all crack elements or on some."""


class Eliminated:
    """The parts that growth leaves valid: the first step ``done`` of the reduction of ``load`` (n,), tractions on the
    boundary, and the result ``on_faces`` (n_elements, width); still to be computed for the elements ``new``."""

    def __init__(self, load: np.ndarray, done: np.ndarray, on_faces: np.ndarray, new: np.ndarray | None = None):
        self.load, self.done, self.on_faces = load, done, on_faces
        self.new = np.empty(0, int) if new is None else new

    def grown(self, was: np.ndarray) -> Eliminated:
        """The same for elements whose earlier numbers are ``was`` (n_elements,), −1 where new."""
        missing = np.zeros(len(self.on_faces) + 1, bool)
        missing[-1] = missing[self.new] = True  # index −1 refers to its end
        at = np.where(missing[was], 0, was)
        on_faces = self.on_faces[at] if len(self.on_faces) else np.empty((len(was), self.on_faces.shape[1]))
        return Eliminated(self.load, self.done, on_faces, np.flatnonzero(missing[was]))

    def complete(self, reduction: Reduction) -> None:
        """Compute missing entries."""
        if len(self.new):
            self.on_faces[self.new] = reduction.then(self.done, self.new).reshape(len(self.new), -1)
            self.new = self.new[:0]


class UnitLoads:
    """Unit loads of a body with elements ``mesh``; see `onto_boundary` for ``extent``, `full_plane` for ``tol``.

    ``outlined``: whether the first loop is an outline; otherwise all loops are holes in the infinite plane. ``anchors``
    are those of supported holes.
    """

    def __init__(
        self,
        mesh: Mesh,
        centroid: np.ndarray,
        material: Material,
        tol: float,
        extent: float,
        outlined: bool,
        anchors: Anchors | None = None,
    ):
        self.mesh, self.boundary, self.faces = mesh, mesh.boundary, mesh.cracks
        self.centroid, self.material, self.nu = centroid, material, material.effective_poissons_ratio
        self.tol, self.extent, self.anchors = tol, extent, anchors
        n_loops = int(mesh.edge_loop.max()) + 1 if len(mesh.edges) else 0
        self.in_plane, self.n_holes = not outlined, n_loops - outlined
        self._segments: dict[bytes, UnitLoad] = {}
        self._on_edges: dict[str | int, UnitLoad] = {}
        self._recent: list[bytes] = []
        self._turn = 0
        self._last: Eliminated | None = None

    def inherit(self, old: UnitLoads, c_old: np.ndarray) -> None:
        """Take over the loads of ``old``, a body with the same boundary; ``c_old`` are the crack elements' earlier
        numbers."""
        n_g = self.boundary.n_unknowns
        if old._last is not None:
            self._last = old._last.grown(c_old)
        new, kept = np.flatnonzero(c_old < 0), np.flatnonzero(c_old >= 0)
        to, fro, at = (
            n_g + x for x in (self.faces.unknowns(kept), old.faces.unknowns(c_old[kept]), self.faces.unknowns(new))
        )
        added = self.faces.take(new)

        def grown(before: UnitLoad, on_new: np.ndarray) -> UnitLoad:
            applied = np.empty((n_g + self.faces.n_unknowns, before.applied.shape[1]))
            applied[:n_g], applied[to], applied[at] = before.applied[:n_g], before.applied[fro], on_new
            unit = UnitLoad(applied, before.segment, before.against, before.densities)
            unit.turn = before.turn
            return unit

        for name, before in old._on_edges.items():
            assert before.densities is not None  # of edges
            self._on_edges[name] = grown(before, self._on_faces(name, added, before.densities))
        keys = [key for key in old._recent if key in old._segments]
        if not keys:
            return
        straight = np.array([old._segments[key].segment for key in keys])
        for key, on_new in zip(keys, self._linear_forces(added, straight)):
            self._segments[key] = grown(old._segments[key], on_new)
        self._recent, self._turn = keys, old._turn

    def of(self, applied: LoadParts) -> list[tuple[UnitLoad, np.ndarray]]:
        """The unit loads that make up ``applied``, without functions and point loads, and their sizes."""
        load, particular = applied.load, applied.particular
        units = self._unit_segments(applied.segments, applied.tractions)
        sizes: dict[str | int, np.ndarray] = {}
        if particular.force.any() or particular.gradient.any():
            sizes["force"] = particular.sizes
        if self.n_holes and particular.uniform.any():
            sizes["remote"] = particular.uniform
        for hole, pressure in enumerate(load.hole_pressures(self.n_holes)):
            size = np.array([pressure.at(self._centre(hole)), *pressure.gradient])
            if size.any():
                sizes[hole] = size
        for name, size in sizes.items():
            if name not in self._on_edges:
                self._on_edges[name] = self._edge_load(name)
            units.append((self._on_edges[name], size))
        return units

    def add(
        self,
        units: list[tuple[UnitLoad, np.ndarray]],
        rest: np.ndarray,
        reduction: Reduction,
        opened: Callable[[np.ndarray], np.ndarray] | None,
        together: bool,
    ) -> tuple[np.ndarray, ...]:
        """g, r, r' and S⁻¹ r' (see `UnitLoad`) of the ``units`` and of ``rest`` (n,), tractions on boundary and
        cracks.

        ``opened`` applies S⁻¹ (None: zeros instead, not asked for); ``together``: each part of a unit load is a load of its own, and where each needs an
        iterative solution, their sum needs only one.
        """
        n_g, n_c = self.boundary.n_unknowns, self.faces.n_unknowns
        n = n_g + n_c
        wait = 1 if self.boundary.n_unknowns * n_c < _WORTH_WAITING else _WAITS
        self._answer([u for u, _ in units if u.uses >= wait and u.answered is None and not together], reduction, opened)
        total = np.zeros(n + 2 * n_c)
        for unit, size in units:
            unit.uses += 1
            if unit.answered is None:
                rest = rest + unit.applied @ size
            else:
                total[:n] += unit.applied @ size
                total[n : n + len(unit.answered)] += unit.answered @ size
        if rest.any():
            if self._last is None or not np.array_equal(self._last.load, rest[:n_g]):
                done = reduction.first(rest[:n_g].copy())
                on_faces = reduction.then(done).reshape(self.faces.n, 2 * self.faces.per)
                self._last = Eliminated(rest[:n_g].copy(), done, on_faces)
            self._last.complete(reduction)
            reduced = rest[n_g:] - self._last.on_faces.ravel()
            total[: n + n_c] += np.concatenate([rest, reduced])
            if opened is not None:
                total[n + n_c :] += opened(reduced)
        return total[:n_g], total[n_g:n], total[n : n + n_c], total[n + n_c :]

    def _answer(
        self, units: list[UnitLoad], reduction: Reduction, opened: Callable[[np.ndarray], np.ndarray] | None
    ) -> None:
        """Compute the responses to the ``units``."""
        if not units:
            return
        ends = np.cumsum([0] + [unit.applied.shape[1] for unit in units])
        n_g, applied = self.boundary.n_unknowns, np.hstack([unit.applied for unit in units])
        reduced = applied[n_g:] - reduction.then(reduction.first(applied[:n_g]))
        responses = reduced if opened is None else np.concatenate([reduced, opened(reduced)])
        for unit, first, end in zip(units, ends, ends[1:]):
            unit.answered = np.ascontiguousarray(responses[:, first:end])

    def answers(self, segments: np.ndarray, mix: np.ndarray, reduction: Reduction) -> tuple[np.ndarray, np.ndarray]:
        """g (n_boundary_unknowns, k) and r' (n_crack_unknowns, k), see `UnitLoad`, of loads ``mix`` (4 m, k) of unit forces on
        ``segments`` (m, 2, 2)."""
        units = [unit for unit, _ in self._unit_segments(segments, np.zeros((len(segments), 2, 2)))]
        # The ends of a segment given against the boundary's direction are swapped.
        order = [[2, 3, 0, 1] if unit.against else [0, 1, 2, 3] for unit in units]
        applied = np.hstack([unit.applied[:, columns] for unit, columns in zip(units, order)]) @ mix
        on_boundary, on_faces = np.split(applied, [self.boundary.n_unknowns])
        return on_boundary, on_faces - reduction.then(reduction.first(on_boundary))

    def _unit_segments(self, segments: np.ndarray, tractions: np.ndarray) -> list[tuple[UnitLoad, np.ndarray]]:
        """The unit loads of the ``segments`` (m, 2, 2) and their (4,) tractions."""
        if not len(segments):
            return []
        edges = sides_for(self.mesh, segments)
        if not len(edges):
            raise ValueError("load segments need a body with an outline, a hole or a free surface")
        keys = [segment.tobytes() for segment in segments]
        missing = [k for k, key in enumerate(keys) if key not in self._segments]
        self._turn += 1
        if missing:
            self._forget()
            missing = [k for k, key in enumerate(keys) if key not in self._segments]
            placed = [onto_boundary(edges, segments[k], f"load segment {k}", self.extent)[:2] for k in missing]
            for first in range(0, len(missing), _AT_ONCE):
                here = placed[first : first + _AT_ONCE]
                straight = np.array([segment for segment, _ in here])
                parts = (self._linear_forces(targets, straight) for targets in (self.boundary, self.faces))
                for k, (segment, against), *rows in zip(missing[first:], here, *parts):
                    self._segments[keys[k]] = UnitLoad(np.concatenate(rows), segment, against)
        self._recent = keys
        units = [self._segments[key] for key in keys]
        for unit in units:
            unit.turn = self._turn
        return [(u, (ends[::-1] if u.against else ends).ravel()) for u, ends in zip(units, tractions)]

    def forget(self) -> None:
        """Remove all segments."""
        self._segments, self._recent = {}, []

    def _forget(self) -> None:
        """Remove segments where too many are cached: those that the last loads do not have, or all."""
        numbers = sum(unit.numbers for unit in self._segments.values())
        if numbers > _NUMBERS:
            last = self._turn - 1
            self._segments = {key: unit for key, unit in self._segments.items() if unit.turn >= last}
        if len(self._segments) > _REMEMBERED:
            self._segments.clear()

    def _linear_forces(self, targets: ElementSet, segments: np.ndarray) -> np.ndarray:
        """(n_unknowns, 4 m) traction from unit forces along x and y at the start, then at the end, of straight
        segments.

        The forces vary linearly along each segment; tractions are those on the outside of the boundary.
        """
        tol = 2 * OFF * self.extent
        unit = line_forces(targets, segments[:, 0], segments[:, 1], 1, self.nu, tol, -1.0)
        if targets is self.boundary:
            project_jumps(unit, targets, segments[:, 0], segments[:, 1], self.nu, tol, -1.0)
        d = segments[:, 1] - segments[:, 0]
        t = d / np.hypot(*d.T)[:, None]
        turn = np.stack([t, np.column_stack([-t[:, 1], t[:, 0]])], axis=1)
        # From unit monomials along and across each segment to unit forces along x and y at its two ends.
        to_ends = np.einsum("de,mcx->mcdex", np.array([[0.5, 0.5], [-0.5, 0.5]]), turn).reshape(-1, 4, 4)
        out = unit.transpose(1, 0, 2, 3).reshape(len(segments), targets.n_unknowns, 4) @ to_ends
        if targets is self.boundary and self.anchors is not None:
            unit = self.anchors.of_forces(segments[:, 0], segments[:, 1], 1)
            by_end = np.stack([unit[..., 0] - unit[..., 1], unit[..., 0] + unit[..., 1]], axis=-1) / 2
            moved = np.einsum("rmce,mcx->mrex", by_end, turn).reshape(len(segments), -1, 4)
            out = out + self.anchors.rows @ moved
        return np.ascontiguousarray(out)

    def _hole(self, number: int) -> np.ndarray:
        """Edges of hole ``number``."""
        return np.flatnonzero(self.mesh.edge_loop == number + (0 if self.in_plane else 1))

    def _centre(self, number: int) -> np.ndarray:
        return self.mesh.edges[self._hole(number), 0].mean(axis=0)

    def _edge_load(self, name: str | int) -> UnitLoad:
        """Densities of loads on whole edges.

        "force": the six body forces b_x, b_y, B_xx, B_xy, B_yx, B_yy, in a half-plane the three slopes; "remote": the
        three uniform stresses of the plane or the body, of which holes remain free; a number: pressure in that hole,
        constant, and growing with x and with y from its centre.
        """
        densities = self._edge_densities(name)
        applied = [self._from_edges(self.boundary, densities), self._on_faces(name, self.faces, densities)]
        if self.anchors is not None:
            unit = self.anchors.of_forces(self.mesh.edges[:, 0], self.mesh.edges[:, 1], 2)
            applied[0] += self.anchors.rows @ np.tensordot(unit, densities, 3)
        return UnitLoad(np.concatenate(applied), densities=densities)

    def _edge_densities(self, name: str | int) -> np.ndarray:
        if not isinstance(name, int):
            out = np.stack([edge_densities(self.mesh.edges, unit) for unit in self._particular(name)], axis=-1)
            if name == "remote" and not self.in_plane:
                out[self.mesh.edge_loop == 0] = 0.0  # the outline carries it
            return out
        a, b = self.mesh.edges[:, 0], self.mesh.edges[:, 1]
        densities = np.zeros((len(a), 2, 3, 3))
        here, centre = self._hole(name), self._centre(name)
        # The normal of an edge points into the rock, as pressure does.
        densities[here, 1, 0, 0] = 1.0
        for k in (0, 1):
            densities[here, 1, 0, k + 1] = 0.5 * (a + b)[here, k] - centre[k]
            densities[here, 1, 1, k + 1] = 0.5 * (b - a)[here, k]
        return densities

    def _particular(self, name: str) -> list[Particular | DepthDependentStress]:
        """Particular fields of unit body forces or of unit remote stresses."""
        none, rock = np.zeros(2), self.faces.half_plane
        if name == "force" and rock is not None:
            return [DepthDependentStress(rock, none, unit, np.zeros(3), self.material) for unit in np.eye(3)]
        if name == "remote":
            return [Particular(self.centroid, none, np.zeros((2, 2)), unit, self.material) for unit in np.eye(3)]
        return [
            Particular(self.centroid, unit[:2], unit[2:].reshape(2, 2), np.zeros(3), self.material)
            for unit in np.eye(6)
        ]

    def _from_edges(self, targets: ElementSet, densities: np.ndarray) -> np.ndarray:
        out = np.zeros((targets.n_unknowns, densities.shape[-1]))
        for first in range(0, len(densities), _AT_ONCE):
            a, b = self.mesh.edges[first : first + _AT_ONCE].swapaxes(0, 1)
            forces = line_forces(targets, a, b, 2, self.nu, self.tol, -1.0)
            own = densities[first : first + _AT_ONCE].reshape(6 * len(a), -1)
            out += forces.reshape(targets.n_unknowns, 6 * len(a)) @ own
        return out

    def _on_faces(self, name: str | int, faces: ElementSet, densities: np.ndarray) -> np.ndarray:
        """Tractions of a load on whole edges on the crack elements ``faces``."""
        out = self._from_edges(faces, densities)
        if not isinstance(name, int):
            points = faces.nodes.reshape(-1, 2)
            out += np.column_stack([on_elements(faces, unit.stress(points)) for unit in self._particular(name)])
        return out


def on_elements(c: ElementSet, stress: np.ndarray) -> np.ndarray:
    """(n_unknowns,) traction (along, normal) at the collocation nodes from ``stress`` (3,) or (n_nodes, 3)."""
    s = np.broadcast_to(stress, (c.n, c.per, 3)) if np.ndim(stress) == 1 else stress.reshape(c.n, c.per, 3)
    t, n = c.tangent[:, None], c.normal[:, None]
    tx = s[..., 0] * n[..., 0] + s[..., 2] * n[..., 1]
    ty = s[..., 2] * n[..., 0] + s[..., 1] * n[..., 1]
    return np.stack([tx * t[..., 0] + ty * t[..., 1], tx * n[..., 0] + ty * n[..., 1]], axis=1).ravel()
