"""The boundary equations of a body: A_ΓΓ with its rigid motions removed, and its factors.

The unknowns are the displacements of the boundary, or the reactions where it is supported (see `supports`). Rigid
motions of a loop that its supports leave free cause no stress: they span the null space of A_ΓΓ. Let R be these motions
and Q their mean over the loop. Then A_ΓΓ + R Qᵀ/extent is regular, and for loads in equilibrium its solution satisfies
Qᵀu = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..counters import Work
from ..iterative.boundary_gmres import IteratedBoundary, PrescribedJumps, SupportedBoundaryMatrix
from ..iterative.fast_multipole import Compressed
from ..loads.hole_supports import Anchors
from ..loads.supports import Holds
from ..mesh.elements import Mesh
from .dense_lu import Factor
from .influence_matrix import ElementSet, influence, reuse

#: Once OFTEN bodies have used the same boundary, the inverse is computed, for up to INVERTED unknowns.
OFTEN, INVERTED = 8, 800
#: Above so many unknowns A_ΓΓ is factored in its own memory, not beside a copy: it is computed again (in a third of the time
#: that its factors take) for residuals, and when cracks divide the boundary.
KEPT_BESIDE_FACTORS = 800


@dataclass(eq=False)
class _Kept:
    """The factors of a boundary (None: released), shared by the bodies that have it in turn; ``generation`` of the last."""

    factor: Factor | IteratedBoundary | None = None
    generation: int = 0


class BoundarySystem:
    """A_ΓΓ of ``mesh.boundary``. What has not changed since ``previous`` (with the same supports) is reused.

        elements      the boundary elements
        holds         the supported ones, or None
        matrix        (n, n) traction, seen from outside, from displacement (times 2μ) or reaction of the boundary;
                      an operator if ``iterated``; above `KEPT_BESIDE_FACTORS` unknowns it is computed when asked for
        known         (n, h) the same from the displacement of supported elements
        rigid         (n, k) rigid motions of each loop that no support resists, nodal values
        weights       (k, n) their mean over the loop
        free_motions  those of the whole body; None without supports
        anchors       of supported holes, or None: terms added to the boundary rows of ``matrix`` and of all loads
        factor        of ``matrix`` with the rigid motions removed; `released` ones are computed again when asked for
        rcond         their reciprocal condition
        unchanged     whether everything equals ``previous``
        at_old        (n_elements,) element numbers in ``previous``, −1 where new

    With ``iterated``, the equations are solved iteratively and not factored (`boundary_gmres.is_iterated`). Raises
    numpy.linalg.LinAlgError when they are singular.
    """

    elements: ElementSet
    holds: Holds | None
    extent: float
    known: np.ndarray | PrescribedJumps
    rigid: np.ndarray
    weights: np.ndarray
    free_motions: FreeMotions | None
    anchors: Anchors | None
    rcond: float
    _matrix: np.ndarray | Compressed | SupportedBoundaryMatrix | None
    _kept: _Kept

    def __init__(
        self,
        mesh: Mesh,
        nu: float,
        tol: float,
        extent: float,
        holds: Holds | None = None,
        previous: BoundarySystem | None = None,
        *,
        work: Work,
        iterated: bool = False,
    ):
        g = mesh.boundary
        self.iterated = iterated
        self.nu, self.tol, self.work = nu, tol, work
        self.at_old = at_old = g.found_in(previous.elements if previous else None)
        #: Number of successive bodies that have used this boundary unchanged.
        self.generation, self.unchanged = 0, False
        #: How often released factors have been computed again, and whether they are given up after every use.
        self._again, self.sparing = 0, False
        if (
            previous is not None
            and previous.iterated == self.iterated
            and g.n == previous.elements.n
            and np.array_equal(at_old, np.arange(g.n))
        ):
            self.generation, self.unchanged = previous.generation + 1, True
            self.elements, self.holds, self.extent = previous.elements, previous.holds, previous.extent
            self._matrix, self.known = previous._matrix, previous.known
            previous.kept_factor()
            self._kept, self.rcond = previous._kept, previous.rcond
            self._kept.generation = self.generation
            self.rigid, self.weights, self.free_motions = previous.rigid, previous.weights, previous.free_motions
            self.anchors = previous.anchors
            return
        if previous is not None and previous.sparing:
            previous.release()  # else its factors would take memory beside the new ones
        self._kept = _Kept()
        self.elements, self.holds, self.extent = g, holds, extent
        if self.iterated:
            self.rigid, self.weights = rigid_motions(g, mesh.edge_loop)
            self.known, self.free_motions, self.anchors = np.empty((g.n_unknowns, 0)), None, None
            operator: Compressed | SupportedBoundaryMatrix
            operator = jumps = Compressed(g, g, nu, tol)
            if holds is not None:
                self._constrain_rigid_motions(mesh, holds)
                operator, self.known = SupportedBoundaryMatrix(jumps, holds, nu, tol), PrescribedJumps(jumps, holds)
            self._matrix = operator

            def between(elements: np.ndarray) -> np.ndarray:
                return self.influence_on(g.take(elements), elements)

            self._kept.factor = IteratedBoundary(g, operator, self.rigid, self.weights, extent, nu, tol, between)
            self.rcond = self._kept.factor.rcond
            return
        # With anchored holes, the old matrix contains the anchors' terms besides tractions.
        before = previous._matrix if previous is not None and previous.anchors is None else None
        dense = before if isinstance(before, np.ndarray) else None
        matrix = reuse(dense, at_old, at_old, g, g, lambda r, k: self.influence_on(g.take(r), k))
        self.known = known = np.empty((g.n_unknowns, 0)) if holds is None else holds.known(g, nu, tol)
        self.rigid, self.weights = rigid_motions(g, mesh.edge_loop)
        self.free_motions = self.anchors = None
        if holds is not None:
            anchors = self._constrain_rigid_motions(mesh, holds)
            if anchors is not None:
                self.anchored(matrix, self._anchoring)
                self.anchored(known, anchors.of_jumps(holds.sources))
        self._matrix = matrix if g.n_unknowns <= KEPT_BESIDE_FACTORS else None
        self._kept.factor = factor = self._factored(matrix)
        self.rcond = factor.rcond

    def _factored(self, matrix: np.ndarray) -> Factor:
        """Factors of ``matrix`` without its rigid motions, in its own memory if it is not kept."""
        what = "the boundary equations are singular"
        if self._matrix is not None:
            # Column-major like the matrix: adding arrays of different order takes several times as long.
            return Factor(matrix + (self.weights.T @ self.rigid.T).T / self.extent, what)
        from scipy.linalg.blas import dgemm

        matrix = np.asfortranarray(matrix)
        return Factor(dgemm(1.0 / self.extent, self.rigid, self.weights, 1.0, matrix, overwrite_c=True), what, True)

    @property
    def factor(self) -> Factor | IteratedBoundary:
        """See above."""
        # Read once: the run may release it while fields inside the body are computed beside it.
        factor = self._kept.factor
        if factor is not None:
            return factor
        self._again += 1
        # Asked for once, they need not be kept; fields inside a block, for instance, take them again and again.
        return self._factored(self._whole()) if self._again == 1 or self.sparing else self.kept_factor()

    def kept_factor(self) -> Factor | IteratedBoundary:
        """`factor`, kept from now on if it had been released."""
        factor = self._kept.factor
        if factor is None:
            self._kept.factor = factor = self._factored(self._whole())
        return factor

    def release(self) -> None:
        """Give up factors of a large boundary. Loads need none: what the boundary does to cracks is in A_CΓ A_ΓΓ⁻¹
        (`body`). They stay if another body has the boundary by now."""
        if self._matrix is None and self._kept.generation == self.generation:
            self._kept.factor = None

    @property
    def is_factored(self) -> bool:
        """Whether factors are kept."""
        return self._kept.factor is not None

    @property
    def large(self) -> bool:
        """Whether factors take much more memory than the rest."""
        return not self.iterated and self.elements.n_unknowns > KEPT_BESIDE_FACTORS

    @property
    def matrix(self) -> np.ndarray | Compressed | SupportedBoundaryMatrix:
        """See above."""
        return self._whole() if self._matrix is None else self._matrix

    def _whole(self) -> np.ndarray:
        """A_ΓΓ, computed again."""
        g = self.elements
        out = self.influence_on(g, np.arange(g.n))
        return out if self.anchors is None else self.anchored(out, self._anchoring)

    @property
    def _anchoring(self) -> np.ndarray:
        """Motions of supported holes by the unknowns of the boundary."""
        assert self.anchors is not None and self.holds is not None
        of = self.anchors.of_jumps(self.elements), self.anchors.of_shapes(self.holds.sources)
        return self.holds.mixed(*of)

    def _constrain_rigid_motions(self, mesh: Mesh, holds: Holds) -> Anchors | None:
        """Keep the free rigid motions; anchor holes against the others. Returns the anchors, None without any."""
        g = self.elements
        loop_of = mesh.edge_loop[g.source]
        _, centre, radius = outline_centroid(g.take(np.flatnonzero(loop_of == 0)))
        whole, _ = rigid_motions(g, np.zeros_like(mesh.edge_loop), (centre, radius))
        self.free_motions = FreeMotions(centre, radius, holds.free_motions(whole))
        keep = ~holds.unknowns
        modes, means, anchors = [], [], Anchors(self.nu, self.extent)
        for k in range(int(mesh.edge_loop.max()) + 1):
            motions, weights = self.rigid[:, 3 * k : 3 * k + 3], self.weights[3 * k : 3 * k + 3]
            # The outline moves with the whole body; the motions of a hole's own boundary are free unless a support of
            # that hole resists them.
            free = self.free_motions.combinations if k == 0 else holds.free_motions(motions)
            modes.append(motions @ free)
            means.append(holds.turned((free.T @ weights).T).T * keep)
            if k and free.shape[1] < 3:
                blocked = np.linalg.svd(free.T)[2][free.shape[1] :].T
                _, centroid, size = outline_centroid(g.take(np.flatnonzero(loop_of == k)))
                hole = mesh.edges[mesh.edge_loop == k, 0]
                anchors.add(motions @ blocked / self.extent, blocked, centroid, size, hole)
        self.rigid, self.weights = np.hstack(modes), np.concatenate(means)
        self.anchors = anchors if anchors.number else None
        return self.anchors

    def anchored(self, rows: np.ndarray, motions: np.ndarray) -> np.ndarray:
        """Add to ``rows`` (boundary rows, k), in place, the tractions of the sources that move supported holes by
        ``motions`` (r, k)."""
        assert self.anchors is not None
        rows += self.anchors.rows @ motions
        return rows

    def influence_on(self, targets: ElementSet, elements: np.ndarray) -> np.ndarray:
        """(targets.n_unknowns, …) traction on ``targets`` from the unknowns of the boundary ``elements``."""
        matrix = influence(targets, self.elements.take(elements), self.nu, self.tol)
        return matrix if self.holds is None else self.holds.swapped(targets, elements, matrix, self.nu, self.tol)

    def solve(self, right: np.ndarray, transposed: bool = False, counted: bool = True) -> np.ndarray:
        """A_ΓΓ⁻¹ ``right`` (n,) or (n, k), without rigid motions; A_ΓΓ⁻ᵀ ``right`` if ``transposed``. Solutions for fields
        inside the body, which are computed beside the run at any time, are not ``counted``."""
        if counted:
            self.work.back_substitutions += 1 if right.ndim == 1 else right.shape[1]
        return self.factor.solve(np.asfortranarray(right), transposed)

    def carried(self, rows: np.ndarray) -> np.ndarray:
        """(k, n) ``rows`` A_ΓΓ⁻¹, row-major: the action of tractions on the boundary by its influence ``rows`` (k, n) on
        crack elements."""
        factor = self.factor
        self.work.back_substitutions += len(rows)
        if not isinstance(factor, Factor) or self.generation <= OFTEN or self.elements.n_unknowns > INVERTED:
            return factor.solve(np.asfortranarray(rows.T), transposed=True).T
        return np.matmul(np.ascontiguousarray(rows), factor.inverse)


@dataclass(frozen=True, eq=False)
class FreeMotions:
    """Rigid motions that no support resists: columns of ``combinations`` (3, k) of x, y and the rotation that moves
    points at ``radius`` from ``centre`` (2,) by one."""

    centre: np.ndarray
    radius: float
    combinations: np.ndarray

    def part(self, force: np.ndarray, moment: float, about: np.ndarray) -> tuple[np.ndarray, float]:
        """The part of a ``force`` (2,) and a ``moment`` about the point ``about`` (2,) that does work on these
        motions."""
        arm = self.centre - about
        own = moment - (arm[0] * force[1] - arm[1] * force[0])
        ways = self.combinations
        x, y, turn = ways @ (ways.T @ np.array([force[0], force[1], own / self.radius]))
        return np.array([x, y]), turn * self.radius + arm[0] * y - arm[1] * x


def outline_centroid(g: ElementSet) -> tuple[float, np.ndarray, float]:
    """Total length of ``g``, centroid (2,) of its points and their root mean square distance from it."""
    x, ds = g.nodes, g.quadrature
    perimeter = ds.sum()
    centroid = np.einsum("ej,ejc->c", ds, x) / perimeter
    rel = x - centroid
    return perimeter, centroid, float(np.sqrt(np.einsum("ej,ejc,ejc->", ds, rel, rel) / perimeter))


def rigid_motions(
    g: ElementSet, edge_loop: np.ndarray, about: tuple[np.ndarray, float] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Rigid motions of each loop in nodal unknowns (n, 3L), and their mean over the loop (3L, n). ``edge_loop`` (m,):
    loop of each edge. The rotation is about the centre in ``about`` and moves points at the radius given there by one;
    the default is the loop's own centre and radius."""
    n_loops = int(edge_loop.max()) + 1 if len(edge_loop) else 0
    modes = np.zeros((g.n, 2, g.per, 3 * n_loops))
    weights = np.zeros_like(modes)
    loop_of = edge_loop[g.source] if g.n else np.empty(0, int)
    for k in range(n_loops):
        here = np.flatnonzero(loop_of == k)
        perimeter, centroid, radius = outline_centroid(g.take(here))
        if about is not None:
            centroid, radius = about
        rel, ds = g.nodes[here] - centroid, g.quadrature[here]
        one, zero = np.ones(ds.shape), np.zeros(ds.shape)
        for m, motion in enumerate(((one, zero), (zero, one), (-rel[..., 1] / radius, rel[..., 0] / radius))):
            vector = np.stack(motion, axis=-1)
            for component, axis in enumerate((g.tangent, g.normal)):
                local = np.einsum("ejc,ec->ej", vector, axis[here])
                modes[here, component, :, 3 * k + m] = local
                weights[here, component, :, 3 * k + m] = local * ds / perimeter
    shape = (g.n_unknowns, 3 * n_loops)
    return modes.reshape(shape), np.ascontiguousarray(weights.reshape(shape).T)
