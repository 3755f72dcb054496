"""A block with cracks: its matrices, made once for a geometry, and its solution under any load.

The total stress in the rock is that of the boundary tractions as Kelvin line forces, of the boundary's own displacement
and of the cracks' opening and slip as displacement jumps, and of a particular field (Somigliana's identity): the plane
outside stays at rest. So the traction seen from *outside* the boundary must vanish,

    A_ΓΓ u + A_ΓC w + g = 0,        A_CΓ u + A_CC w + r = −p n,

u the boundary displacement, w slip and opening. A_ΓΓ is factored once and everything else happens on the Schur
complement S = A_CC − A_CΓ A_ΓΓ⁻¹ A_ΓC of the crack unknowns. The matrices depend on nothing but geometry and ν.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..model import TIP, Cracks, DdmSettings, Material
from ..model.polygon import area_moments
from . import shapes
from .factor import Factor
from .influence import ElementSet, influence, line_forces, project_jumps, reuse
from .loads import BodyLoad, check_equilibrium
from .mesh import Mesh, mesh, outline_edges
from .particular import Particular
from .solution import Solution, settle_faces
from .validity import check_cracks, check_outline

#: A load segment may stand this far off the boundary, in units of the extent; it is put onto it.
_OFF = 1e-6
#: Loads on so many different segments are remembered.
_REMEMBERED = 400
#: Reciprocal condition of S below which contact is not built on its inverse.
_SAFE = 1e-11


class _UnitLoad:
    """What unit loads do, one a column of ``applied``: tractions g on the boundary above r on the cracks.

    Loads that come again are ``answered`` once and then only scaled: (g, r, y, r' = r − A_CΓ y, S⁻¹ r') with y = A_ΓΓ⁻¹ g, of
    which ``eliminated`` is y, the part that outlasts growth. ``segment`` is where tractions act, ``against`` whether they were
    given against the boundary's direction.
    """

    def __init__(self, applied: np.ndarray, segment: np.ndarray | None = None, against: bool = False):
        self.applied, self.segment, self.against = applied, segment, against
        self.eliminated: np.ndarray | None = None
        self.answered: np.ndarray | None = None
        self.used = False


class Body:
    """An elastic body with cracks.

    ``loops``: (n, 2) arrays, the outline counter-clockwise, then holes clockwise; [] is the infinite plane. ``cracks``:
    those of this body. ``previous``: an earlier body of which whatever is unchanged, element by element, is reused:
    growth costs the rows and columns of the new elements. ``counts`` tells what was done. Raises ValueError naming the
    item on geometry that is no body, numpy.linalg.LinAlgError when cracks cut a part off.
    """

    def __init__(
        self,
        loops: list[np.ndarray],
        cracks: Cracks,
        material: Material,
        settings: DdmSettings | None = None,
        previous: Body | None = None,
    ):
        self.material, self.cracks = material, cracks
        self.settings = settings = DdmSettings() if settings is None else settings
        if previous is not None and (previous.settings != settings or previous.nu != material.effective_poissons_ratio):
            previous = None
        self.counts = {"elements": 0, "elements_new": 0, "boundary_assemblies": 0, "boundary_factorisations": 0}
        same = previous is not None and _same_loops(previous.loops, loops)
        self.loops = previous.loops if same else check_outline(loops)
        check_cracks(cracks, outline_edges(self.loops)[0], self.loops, _fresh(cracks, previous if same else None))
        self.mesh: Mesh = mesh(self.loops, cracks, settings)
        self.boundary: ElementSet = self.mesh.boundary
        self.faces: ElementSet = self.mesh.cracks
        if self.loops:
            self.area, self.centroid, self._second = area_moments(self.loops)
            self._reach = float(np.ptp(self.loops[0], axis=0).max())
        else:
            self.area, self.centroid = np.inf, np.zeros(2)
        points = np.concatenate([self.mesh.edges.reshape(-1, 2), cracks.nodes])
        self._extent = float(np.ptp(points, axis=0).max()) if len(points) else 1.0
        self._tol = 8e-16 * float(np.abs(points).max()) if len(points) else 0.0
        self._assemble(previous)

    @property
    def nu(self) -> float:
        return self.material.effective_poissons_ratio

    def _assemble(self, previous: Body | None) -> None:
        nu, tol = self.nu, self._tol
        g, c = self.boundary, self.faces
        old = previous
        g_old = g.found_in(old.boundary if old else None)
        c_old = c.found_in(old.faces if old else None)
        same_boundary = old is not None and g.n == old.boundary.n and np.array_equal(g_old, np.arange(g.n))

        def block(rows, columns):
            return lambda r, k: influence(rows.take(r), columns.take(k), nu, tol)

        self.counts["elements"] = g.n + c.n
        self.counts["elements_new"] = int((g_old < 0).sum() + (c_old < 0).sum())
        if same_boundary:
            self.boundary = g = old.boundary
            self._gg, self._gg_factor = old._gg, old._gg_factor
            self._rigid, self._rigid_weights = old._rigid, old._rigid_weights
        else:
            self._gg = reuse(old._gg if old else None, g_old, g_old, g, g, block(g, g))
            self._rigid, self._rigid_weights = self._rigid_motions()
            # Each loop's rigid motions are without stress: R Qᵀ lifts them out of the null space, and Qᵀu = 0 follows.
            bordered = self._gg + self._rigid @ self._rigid_weights / self._extent
            self._gg_factor = Factor(bordered, "the boundary equations are singular")
            self.counts["boundary_assemblies"] = self.counts["boundary_factorisations"] = int(g.n > 0)
        self._cg = reuse(old._cg if old else None, c_old, g_old, c, g, block(c, g))
        # W = A_ΓΓ⁻¹ A_ΓC and S by the columns and rows of new elements; A_ΓC and A_CC are not kept, as they are cheaper to
        # make again, should the boundary change, than to carry along.
        everything = np.arange(g.n)
        gc = block(g, c)
        self._w = reuse(
            old._w if same_boundary else None,
            everything,
            c_old,
            g,
            c,
            lambda r, k: self._gg_factor.solve(np.asfortranarray(gc(everything, k))),
        )
        cc = block(c, c)

        def schur(r, k):
            return cc(r, k) - self._cg[c.unknowns(r)] @ self._w[:, c.unknowns(k)]

        self._schur = reuse(old._schur if same_boundary else None, c_old, c_old, c, c, schur)
        self._factors: dict[bytes, tuple[np.ndarray, Factor]] = {}
        self._column_at = np.full(c.n_unknowns, -1)
        self._columns = np.empty((c.n_unknowns, 0))
        self._closed_now: tuple[bytes, np.ndarray, Factor] | None = None
        self._segments: dict[bytes, _UnitLoad] = {}
        self._forces: _UnitLoad | None = None
        self._recent: list[bytes] = []
        if same_boundary:
            self._inherit_loads(old, c_old)

    def _rigid_motions(self) -> tuple[np.ndarray, np.ndarray]:
        """(n, 3L) rigid motions of every loop in nodal unknowns and (3L, n) their mean over the loop."""
        g = self.boundary
        n_loops = len(self.loops)
        modes = np.zeros((g.n, 2, g.per, 3 * n_loops))
        weights = np.zeros_like(modes)
        loop_of = self.mesh.edge_loop[g.source] if g.n else np.empty(0, int)
        for k in range(n_loops):
            here = np.flatnonzero(loop_of == k)
            x, ds = g.nodes[here], g.quadrature[here]
            perimeter = ds.sum()
            rel = x - np.einsum("ej,ejc->c", ds, x) / perimeter
            radius = np.sqrt(np.einsum("ej,ejc,ejc->", ds, rel, rel) / perimeter)
            one, zero = np.ones(ds.shape), np.zeros(ds.shape)
            for m, motion in enumerate(((one, zero), (zero, one), (-rel[..., 1] / radius, rel[..., 0] / radius))):
                vector = np.stack(motion, axis=-1)
                for component, axis in enumerate((g.tangent, g.normal)):
                    local = np.einsum("ejc,ec->ej", vector, axis[here])
                    modes[here, component, :, 3 * k + m] = local
                    weights[here, component, :, 3 * k + m] = local * ds / perimeter
        shape = (g.n_unknowns, 3 * n_loops)
        return modes.reshape(shape), np.ascontiguousarray(weights.reshape(shape).T)

    # Right-hand sides ------------------------------------------------------------------------------------------------

    def _on_boundary(self, segment: np.ndarray, number: int) -> tuple[np.ndarray, bool]:
        """``segment`` (2, 2) put onto the edge it lies on, and whether it runs against that edge."""
        edges = self.mesh.edges
        a, d = edges[:, 0], edges[:, 1] - edges[:, 0]
        length = np.hypot(*d.T)
        rel = segment[None] - a[:, None]
        s = np.einsum("ijc,ic->ij", rel, d) / length[:, None] ** 2
        clipped = np.clip(s, 0.0, 1.0)
        foot = a[:, None] + clipped[..., None] * d[:, None]
        off = np.hypot(*np.moveaxis(foot - segment, 2, 0)).max(axis=1)
        at = int(np.argmin(off))
        if off[at] > _OFF * self._extent:
            raise ValueError(f"load segment {number} lies {off[at]:.3g} m off the boundary of the body")
        if abs(s[at, 1] - s[at, 0]) * length[at] <= 1e-14 * self._extent:
            raise ValueError(f"load segment {number} has no length")
        against = bool(s[at, 1] < s[at, 0])
        return (foot[at][::-1] if against else foot[at]), against

    def _linear_forces(self, targets: ElementSet, segments: np.ndarray) -> np.ndarray:
        """(m, n_unknowns, 4) traction from unit (x, y) forces at the start, then at the end of straight segments,
        linear along them; seen from outside the boundary."""
        tol = 2 * _OFF * self._extent
        unit = line_forces(targets, segments[:, 0], segments[:, 1], 1, self.nu, tol, -1.0)
        if targets is self.boundary:
            project_jumps(unit, targets, segments[:, 0], segments[:, 1], self.nu, tol, -1.0)
        d = segments[:, 1] - segments[:, 0]
        t = d / np.hypot(*d.T)[:, None]
        turn = np.stack([t, np.column_stack([-t[:, 1], t[:, 0]])], axis=1)
        by_end = np.stack([unit[..., 0] - unit[..., 1], unit[..., 0] + unit[..., 1]], axis=-1) / 2
        out = np.einsum("nmce,mcx->mnex", by_end, turn)
        return np.ascontiguousarray(out.reshape(len(segments), targets.n_unknowns, 4))

    def _inherit_loads(self, old: Body, c_old: np.ndarray) -> None:
        n_g = self.boundary.n_unknowns
        if old._forces is not None:
            self._forces = self._unit_forces(old._forces.applied[:n_g])
            self._forces.eliminated = old._forces.eliminated
        keys = [key for key in old._recent if key in old._segments]
        if not keys:
            return
        new, kept = np.flatnonzero(c_old < 0), np.flatnonzero(c_old >= 0)
        straight = np.array([old._segments[key].segment for key in keys])
        fresh = self._linear_forces(self.faces.take(new), straight)
        to, fro, at = (
            n_g + x for x in (self.faces.unknowns(kept), old.faces.unknowns(c_old[kept]), self.faces.unknowns(new))
        )
        for key, rows in zip(keys, fresh):
            before = old._segments[key]
            applied = np.empty((n_g + self.faces.n_unknowns, 4))
            applied[:n_g], applied[to], applied[at] = before.applied[:n_g], before.applied[fro], rows
            self._segments[key] = unit = _UnitLoad(applied, before.segment, before.against)
            unit.eliminated = before.eliminated
        self._recent = keys

    def _unit_segments(self, load: BodyLoad) -> list[tuple[_UnitLoad, np.ndarray]]:
        """The load's segments and their (4,) tractions."""
        if load.segments is None or not len(load.segments):
            return []
        if not self.loops:
            raise ValueError("load segments need a body with an outline")
        keys = [segment.tobytes() for segment in load.segments]
        missing = [k for k, key in enumerate(keys) if key not in self._segments]
        if missing:
            if len(self._segments) > _REMEMBERED:
                self._segments.clear()
                return self._unit_segments(load)
            placed = [self._on_boundary(load.segments[k], k) for k in missing]
            straight = np.array([segment for segment, _ in placed])
            parts = (self._linear_forces(targets, straight) for targets in (self.boundary, self.faces))
            for k, (segment, against), *rows in zip(missing, placed, *parts):
                self._segments[keys[k]] = _UnitLoad(np.concatenate(rows), segment, against)
        self._recent = keys
        units = [self._segments[key] for key in keys]
        return [(u, (ends[::-1] if u.against else ends).ravel()) for u, ends in zip(units, load.tractions)]

    def _unit_forces(self, on_boundary: np.ndarray | None = None) -> _UnitLoad:
        """The six body forces b_x, b_y, B_xx, B_xy, B_yx, B_yy of size one; ``on_boundary`` if it is known already."""
        one = np.eye(6)
        units = [Particular(self.centroid, e[:2], e[2:].reshape(2, 2), np.zeros(3), self.material) for e in one]
        densities = np.column_stack([self.edge_densities(unit).ravel() for unit in units])
        a, b = self.mesh.edges[:, 0], self.mesh.edges[:, 1]

        def from_edges(targets: ElementSet) -> np.ndarray:
            forces = line_forces(targets, a, b, 2, self.nu, self._tol, -1.0)
            return forces.reshape(targets.n_unknowns, 6 * len(a)) @ densities

        points = self.faces.nodes.reshape(-1, 2)
        inside = np.column_stack([self._uniform_on_faces(unit.stress_of_force(points)) for unit in units])
        first = from_edges(self.boundary) if on_boundary is None else on_boundary
        return _UnitLoad(np.concatenate([first, from_edges(self.faces) + inside]))

    def _answer(self, units: list[_UnitLoad]) -> None:
        """Work out what the ``units`` come to."""
        n_g = self.boundary.n_unknowns
        fresh = [unit for unit in units if unit.eliminated is None]
        if fresh:
            y = self._gg_factor.solve(np.asfortranarray(np.hstack([unit.applied[:n_g] for unit in fresh])))
            for unit, part in zip(fresh, np.split(y, np.cumsum([u.applied.shape[1] for u in fresh])[:-1], axis=1)):
                unit.eliminated = part
        for unit in units:
            reduced = unit.applied[n_g:] - self._cg @ unit.eliminated
            unit.answered = np.concatenate([unit.applied, unit.eliminated, reduced, self._opened(reduced)])

    def _particular(self, load: BodyLoad) -> Particular:
        force = np.zeros(2) if load.body_force is None else load.body_force
        gradient = np.zeros((2, 2)) if load.body_force_gradient is None else load.body_force_gradient
        if not self.loops and (force.any() or gradient.any()):
            raise ValueError("a body force needs a body with an outline")
        if load.about is not None:
            force = force + gradient @ (self.centroid - load.about)
        uniform = np.zeros(3) if load.remote_stress is None else load.remote_stress
        return Particular(self.centroid, force, gradient, uniform, self.material)

    def edge_densities(self, particular: Particular) -> np.ndarray:
        """(m, 2, 3) monomials of −σ_p n (n outward) along every edge, local components."""
        a, b = self.mesh.edges[:, 0], self.mesh.edges[:, 1]
        d = b - a
        t = d / np.hypot(*d.T)[:, None]
        out = np.column_stack([t[:, 1], -t[:, 0]])
        values = []
        for x in (a, 0.5 * (a + b), b):
            s = particular.stress_of_force(x)
            f = -np.column_stack([s[:, 0] * out[:, 0] + s[:, 2] * out[:, 1], s[:, 2] * out[:, 0] + s[:, 1] * out[:, 1]])
            values.append(np.stack([np.sum(f * t, axis=1), -np.sum(f * out, axis=1)], axis=1))
        lo, mid, hi = values
        return np.stack([mid, 0.5 * (hi - lo), 0.5 * (hi + lo) - mid], axis=2)

    def _uniform_on_faces(self, stress: np.ndarray) -> np.ndarray:
        """(n_unknowns,) traction (along, normal) on the crack nodes of ``stress`` (3,) or (n_nodes, 3)."""
        c = self.faces
        s = np.broadcast_to(stress, (c.n, c.per, 3)) if np.ndim(stress) == 1 else stress.reshape(c.n, c.per, 3)
        t, n = c.tangent[:, None], c.normal[:, None]
        tx = s[..., 0] * n[..., 0] + s[..., 2] * n[..., 1]
        ty = s[..., 2] * n[..., 0] + s[..., 1] * n[..., 1]
        return np.stack([tx * t[..., 0] + ty * t[..., 1], tx * n[..., 0] + ty * n[..., 1]], axis=1).ravel()

    # Solution --------------------------------------------------------------------------------------------------------

    def solve(self, load: BodyLoad, warm: Solution | None = None, equilibrium_tolerance: float = 1e-6) -> Solution:
        """The body under ``load``. ``warm``: a solution of this or an earlier body whose face states are the first guess.

        Raises OutOfEquilibrium when force or moment do not vanish within the tolerance, relative to the loads' size;
        `faces.NotConverged` when the contact of crack faces does not settle.
        """
        particular = self._particular(load)
        if self.loops:
            check_equilibrium(
                load, self._reach, self.area, self.centroid, self._second, particular.force, particular.gradient,
                equilibrium_tolerance,
            )  # fmt: skip
        units = self._unit_segments(load)
        if particular.force.any() or particular.gradient.any():
            if self._forces is None:
                self._forces = self._unit_forces()
            units.append((self._forces, np.concatenate([particular.force, particular.gradient.ravel()])))
        again = [unit for unit, _ in units if unit.used and unit.answered is None]
        if again:
            self._answer(again)
        n_g, n_c = self.boundary.n_unknowns, self.faces.n_unknowns
        n = n_g + n_c
        total, rest = np.zeros(2 * n + n_c), np.zeros(n)
        for unit, size in units:
            unit.used = True
            if unit.answered is None:
                rest += unit.applied @ size
            else:
                total += unit.answered @ size
        if particular.uniform.any():
            rest[n_g:] += self._uniform_on_faces(particular.uniform)
        if rest.any():
            y = self._gg_factor.solve(rest[:n_g])
            reduced = rest[n_g:] - self._cg @ y
            total += np.concatenate([rest, y, reduced, self._opened(reduced)])
        g, r, y, reduced, opened = np.split(total, [n_g, n, n + n_g, 2 * n])
        w, closed, traction, solves = settle_faces(self, reduced, opened, load.crack_pressure, warm)
        return Solution(self, load, particular, y, w, closed, traction, g, r, solves)

    def _free_factor(self, closed: np.ndarray) -> tuple[np.ndarray, Factor]:
        """Free unknowns (indices) and factors of S restricted to them, ``closed`` (n_unknowns,) bool fixed."""
        key = np.packbits(closed).tobytes()
        if key not in self._factors:
            if len(self._factors) >= 8:
                self._factors.pop(next(iter(self._factors)))
            free = np.flatnonzero(~closed)
            matrix = self._schur if len(free) == len(closed) else self._schur[np.ix_(free, free)]
            self._factors[key] = free, Factor(matrix, "cracks cut a part of the body off")
        return self._factors[key]

    @cached_property
    def _open_factor(self) -> Factor | None:
        """Factors of S with all faces open; None when only closed faces hold a part of the body."""
        try:
            factor = Factor(self._schur, "cracks cut a part of the body off")
        except np.linalg.LinAlgError:
            return None
        return factor if factor.rcond > _SAFE else None

    def _opened(self, right: np.ndarray) -> np.ndarray:
        """S⁻¹ ``right``; zeros where it is not to be used (no `_open_factor`)."""
        return np.zeros_like(right) if self._open_factor is None else self._open_factor.solve(np.asfortranarray(right))

    def _inverse_columns(self, unknowns: np.ndarray) -> np.ndarray:
        """(n_unknowns, len(unknowns)) columns of S⁻¹; they outlast the load."""
        missing = unknowns[self._column_at[unknowns] < 0]
        if len(missing):
            right = np.zeros((self.faces.n_unknowns, len(missing)), order="F")
            right[missing, np.arange(len(missing))] = 1.0
            self._column_at[missing] = self._columns.shape[1] + np.arange(len(missing))
            self._columns = np.hstack([self._columns, self._open_factor.solve(right)])
        return self._columns[:, self._column_at[unknowns]]

    def _closed_columns(self, at: np.ndarray) -> tuple[np.ndarray, Factor]:
        """Columns ``at`` of S⁻¹ and the factors of their rows ``at``; mostly the same faces stay closed for long."""
        key = at.tobytes()
        if self._closed_now is None or self._closed_now[0] != key:
            columns = self._inverse_columns(at)
            factor = Factor(columns[at], "closed faces leave a part of the body without hold")
            self._closed_now = key, columns, factor
        return self._closed_now[1:]

    def constrained(
        self, right: np.ndarray, closed: np.ndarray, fixed: np.ndarray, opened: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Jumps w (n,) or (n, k) with w = ``fixed`` where ``closed``, S w = ``right`` elsewhere, and what is missing in
        the closed rows, right − S w. ``opened``: S⁻¹ right, if it is known.

        One factorisation serves all contact states: closing k nodes is a k × k system in columns of S⁻¹. Raises
        LinAlgError when cracks cut a part off and closed faces do not hold it.
        """
        at = np.flatnonzero(closed)
        reaction = np.zeros_like(right)
        if self._open_factor is not None:
            w = self._open_factor.solve(right) if opened is None else opened.copy()
            if len(at):
                columns, factor = self._closed_columns(at)
                reaction[at] = factor.solve(w[at] - fixed[at])
                w -= columns @ reaction[at]
                w[at] = fixed[at]
            return w, reaction
        free, factor = self._free_factor(closed)
        w = np.zeros_like(right)
        w[at] = fixed[at]
        w[free] = factor.solve((right - self._schur @ w)[free])
        reaction[at] = (right - self._schur @ w)[at]
        return w, reaction

    @cached_property
    def tip_elements(self) -> tuple[np.ndarray, ...]:
        """What the tips' rows say of geometry (TIP, factors zero), and of each its element, the element's last node,
        weights (n_tips, p+1) that make nodal values the coefficient of √r, and whether its faces touch unloaded."""
        network, c = self.cracks, self.faces
        n = len(network.tips)
        rows, element, last = np.zeros(n, TIP), np.zeros(n, int), np.zeros(n, int)
        lead, touching = np.zeros((n, c.per)), np.zeros(n, bool)
        at_tip: dict[int, tuple[int, bool]] = {}
        for e in np.flatnonzero(c.kind != shapes.ORDINARY):
            i, j = network.segments[c.source[e]]
            if c.kind[e] in (shapes.TIP_START, shapes.TIP_BOTH):
                at_tip[int(i)] = int(e), False
            if c.kind[e] in (shapes.TIP_END, shapes.TIP_BOTH):
                at_tip[int(j)] = int(e), True
        for k, (row, node) in enumerate(zip(rows, network.tips)):
            e, at_end = at_tip[int(node)]
            segment = c.source[e]
            row["node"], row["crack"], row["block"] = node, network.crack[segment], network.block[segment]
            row["end"], row["point"] = at_end, network.nodes[node]
            row["direction"] = c.tangent[e] if at_end else -c.tangent[e]
            element[k], last[k] = e, -1 if at_end else 0
            lead[k] = shapes.leading(c.family, c.order, int(c.kind[e]), at_end) / np.sqrt(c.length[e])
            touching[k] = network.aperture[segment] == 0
        return rows, element, last, lead, touching

    @cached_property
    def closing(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(n_unknowns,) aperture (2μ, zero for slip), which unknowns can close (bool) and what they are then."""
        c = self.faces
        aperture = np.zeros((c.n, 2, c.per))
        aperture[:, 1] = 2 * self.material.shear_modulus * self.cracks.aperture[c.source, None]
        can_close = np.zeros(aperture.shape, bool)
        can_close[:, 1] = np.isfinite(aperture[:, 1])
        aperture[~can_close] = 0.0
        return aperture.ravel(), can_close.ravel(), -aperture.ravel()

    @cached_property
    def strain_weights(self) -> np.ndarray:
        """(3, n_unknowns) mean strain of the cracks from nodal slip and opening (times 2μ)."""
        c = self.faces
        t, n = c.tangent, c.normal
        out = np.empty((3, c.n, 2, c.per))
        for component, axis in enumerate((t, n)):
            jump = np.stack([n[:, 0] * axis[:, 0], n[:, 1] * axis[:, 1], n[:, 0] * axis[:, 1] + n[:, 1] * axis[:, 0]])
            out[:, :, component] = jump[:, :, None] * c.quadrature
        return out.reshape(3, -1) / (self.area * 2 * self.material.shear_modulus)

    def compliance(self, sol: Solution | None = None) -> np.ndarray:
        """(3, 3) added compliance, 1/Pa: mean crack strain (xx, yy, xy; engineering shear) per uniform boundary stress,
        with the face states of ``sol`` (all open if None); symmetrised. Raises ValueError in the infinite plane."""
        if not self.loops:
            raise ValueError("the mean strain of cracks needs a body with an outline")
        if not self.faces.n:
            return np.zeros((3, 3))
        closed = np.zeros(self.faces.n_unknowns, bool) if sol is None else sol.closed
        right = np.column_stack([-self._uniform_on_faces(unit) for unit in np.eye(3)])
        response = self.strain_weights @ self.constrained(right, closed, np.zeros_like(right))[0]
        return 0.5 * (response + response.T)


def _same_loops(old: list[np.ndarray], new: list[np.ndarray]) -> bool:
    return len(old) == len(new) and all(np.array_equal(a, b) for a, b in zip(old, new))


def _fresh(cracks: Cracks, previous: Body | None) -> np.ndarray | None:
    """(n_segments,) bool: which segments were not in ``previous``."""
    if previous is None:
        return None
    known = {row.tobytes() for row in np.ascontiguousarray(previous.cracks.nodes[previous.cracks.segments])}
    return np.array(
        [row.tobytes() not in known for row in np.ascontiguousarray(cracks.nodes[cracks.segments])], dtype=bool
    )
