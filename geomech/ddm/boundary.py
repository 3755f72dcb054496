"""The boundary's side of a body's equations: A_ΓΓ with its rigid motions lifted, and its factors.

Where tractions are given the boundary's displacement is free up to a rigid motion of every loop: these are without stress
and span the null space of A_ΓΓ. With R the motions and Q their mean over the loop, A_ΓΓ + R Qᵀ/extent is regular and
Qᵀu = 0 follows for loads in equilibrium.
"""

from __future__ import annotations

import numpy as np

from .factor import Factor
from .influence import ElementSet, influence, reuse
from .mesh import Mesh


class BoundarySystem:
    """A_ΓΓ of ``mesh.boundary``, what is unchanged since ``previous`` taken over from it.

    elements      the boundary's elements
    matrix        (n, n) traction seen from outside from the displacement (times 2μ) of the boundary
    rigid         (n, 3L) rigid motions of every loop, nodal values
    weights       (3L, n) their mean over the loop
    factor        of ``matrix`` with the rigid motions lifted
    new           (n_elements,) bool: not in ``previous``

    Raises numpy.linalg.LinAlgError when the equations are singular.
    """

    def __init__(self, mesh: Mesh, nu: float, tol: float, extent: float, previous: BoundarySystem | None = None):
        g = mesh.boundary
        self.at_old = at_old = g.found_in(previous.elements if previous else None)
        self.extent = extent
        self.elements = g
        self.unchanged = previous is not None and g.n == previous.elements.n and np.array_equal(at_old, np.arange(g.n))
        if self.unchanged:
            self.elements, self.matrix, self.factor = previous.elements, previous.matrix, previous.factor
            self.rigid, self.weights, self.extent = previous.rigid, previous.weights, previous.extent
            return

        def block(r: np.ndarray, k: np.ndarray) -> np.ndarray:
            return influence(g.take(r), g.take(k), nu, tol)

        self.matrix = reuse(previous.matrix if previous else None, at_old, at_old, g, g, block)
        self.rigid, self.weights = rigid_motions(g, mesh.edge_loop)
        self.factor = Factor(self.matrix + self._lift(), "the boundary equations are singular")

    def _lift(self) -> np.ndarray:
        return self.rigid @ self.weights / self.extent

    def solve(self, right: np.ndarray) -> np.ndarray:
        """A_ΓΓ⁻¹ ``right`` (n,) or (n, k), without rigid motions."""
        return self.factor.solve(np.asfortranarray(right))

    def times(self, u: np.ndarray, lifted: np.ndarray) -> np.ndarray:
        """A_ΓΓ ``u``, and what the lifted rigid motions of ``lifted`` add."""
        return self.matrix @ u + self.rigid @ (self.weights @ lifted) / self.extent


def rigid_motions(g: ElementSet, edge_loop: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3L) rigid motions of every loop in nodal unknowns and (3L, n) their mean over the loop; ``edge_loop`` (m,) the
    loop of every edge."""
    n_loops = int(edge_loop.max()) + 1 if len(edge_loop) else 0
    modes = np.zeros((g.n, 2, g.per, 3 * n_loops))
    weights = np.zeros_like(modes)
    loop_of = edge_loop[g.source] if g.n else np.empty(0, int)
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
