"""Cracked plates by standard finite elements (scikit-fem): quadratic triangles, graded towards the tips and split along
the cracks, quarter-point elements at the tips, K from interaction integrals.

The midside nodes of sides that end at a tip are at a quarter of their length, so that displacements vary with √r in all
directions of the triangle (Barsoum 1976; Henshell & Shaw 1975). K_I and K_II follow from the domain form of the
interaction integral with Williams' fields (Yau, Wang & Corten 1980; Li, Shih & Needleman 1985), over a disc around the
tip; faces of a curved crack contribute.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...model import Cracks
from ..accuracy.crack_problems import ROCK

#: q is one up to this part of the disc's radius, and decreases to zero from there.
PLATEAU = 0.3
#: Polynomials up to this degree are integrated exactly.
ORDER = 4

Field = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Sizes:
    """Lengths of triangle sides, m: away from cracks, at tips, and their growth rate with distance."""

    away: float
    at_tips: float
    slope: float


class Plate:
    """A meshed plate with open cracks.

    ``warp`` maps every node (n, 2) → (n, 2), cracks included: a straight mesh becomes curved.
    """

    def __init__(self, outline: np.ndarray, cracks: Cracks, sizes: Sizes, warp: Field | None = None) -> None:
        from skfem import Basis, ElementTriP2, ElementVector, MeshTri, MeshTri2

        from ...shapes.meshing import mesh_interior

        drawn = mesh_interior([outline], cracks, sizes.away, sizes.at_tips, sizes.slope)
        flat = MeshTri(np.ascontiguousarray(drawn.points.T), np.ascontiguousarray(drawn.triangles.T.astype(np.int64)))
        mesh = MeshTri2.from_mesh(flat)
        # Before the mapping, to find the sides of the outline again.
        self.straight, places, midside_nodes = mesh.doflocs, mesh.doflocs.copy(), mesh.dofs.facet_dofs[0]
        if warp is not None:
            places = np.ascontiguousarray(warp(places.T).T)
        for tip in cracks.nodes[cracks.tips]:
            node = int(np.argmin(np.hypot(*(drawn.points - tip).T)))
            for ends in (mesh.facets, mesh.facets[::-1]):
                at = np.flatnonzero(ends[0] == node)
                places[:, midside_nodes[at]] = 0.75 * places[:, ends[0, at]] + 0.25 * places[:, ends[1, at]]
        self.mesh = MeshTri2(places, mesh.t)
        self.outline, self.curved = outline, warp is not None
        self.basis = Basis(self.mesh, ElementVector(ElementTriP2()), intorder=ORDER)

    @property
    def n_unknowns(self) -> int:
        return self.basis.N

    @cached_property
    def _sides(self) -> np.ndarray:
        """(n,) number of the outline's side on which a facet lies, −1 on cracks, −2 inside; facets as in the mesh."""
        ends = self.straight[:, self.mesh.facets].transpose(2, 1, 0)
        side = np.full(len(ends), -1)
        near = 1e-9 * np.ptp(self.outline)
        for k, (a, b) in enumerate(zip(self.outline, np.roll(self.outline, -1, axis=0))):
            along = (b - a) / np.hypot(*(b - a))
            off = np.abs((ends - a) @ np.array([-along[1], along[0]]))
            side[(off < near).all(axis=1)] = k
        inside = np.ones(len(ends), bool)
        inside[self.mesh.boundary_facets()] = False
        side[inside] = -2
        return side

    def pulled(self, stress: float) -> np.ndarray:
        """Displacements under ``stress`` along y on the outline's first and third sides, without rigid motion."""
        from skfem import condense, solve

        force = sum(
            _pull(self.basis.boundary(np.flatnonzero(self._sides == k)), sign * stress) for k, sign in ((0, -1), (2, 1))
        )
        # Three constraints of a rigid motion: a corner, and the height of another.
        x, y = self.mesh.p[:, : self.basis.nodal_dofs.shape[1]]
        low, right = int(np.argmin(x + y)), int(np.argmax(x - y))
        constrained = np.concatenate([self.basis.nodal_dofs[:, low], self.basis.nodal_dofs[1:, right]])
        return solve(*condense(self._stiffness(), force, D=constrained), solver=symmetric)

    def moved(self, displacement: Field) -> np.ndarray:
        """Displacements if the whole outline moves by ``displacement`` (n, 2) → (n, 2), with unloaded cracks."""
        from skfem import condense, solve

        constrained = self.basis.get_dofs(facets=np.flatnonzero(self._sides >= 0)).flatten()
        u, at = np.zeros(self.basis.N), self.basis.doflocs[:, constrained]
        # Unknowns come in pairs, x before y, at one place.
        given = displacement(at.T)
        along = np.zeros(self.basis.N, np.int64)
        along[self.basis.nodal_dofs[1]], along[self.basis.facet_dofs[1]] = 1, 1
        u[constrained] = given[np.arange(len(constrained)), along[constrained]]
        return solve(*condense(self._stiffness(), np.zeros(len(u)), x=u, D=constrained), solver=symmetric)

    def _stiffness(self):
        from skfem import BilinearForm
        from skfem.helpers import ddot, eye, sym_grad, trace

        mu, nu = ROCK.shear_modulus, ROCK.effective_poissons_ratio
        lame = 2 * mu * nu / (1 - 2 * nu)

        @BilinearForm
        def form(u, v, _):
            e = sym_grad(u)
            return ddot(2 * mu * e + eye(lame * trace(e), 2), sym_grad(v))

        return form.assemble(self.basis)

    def _faces(self, u: np.ndarray) -> _Faces:
        """Displacement gradients on crack faces, at Gauss points along every facet.

        The inverse mapping, which a basis would need, does not exist at quarter points.
        """
        facets = np.flatnonzero(self._sides == -1)
        elements = self.mesh.f2t[0, facets]
        corners = self.mesh.t[:, elements]
        # The facet's ends among the corners of its element, and its third corner.
        first, second = (np.argmax(corners == self.mesh.facets[k, facets], axis=0) for k in (0, 1))
        t, weights = np.polynomial.legendre.leggauss(3)
        t, weights = 0.5 * (t + 1), 0.5 * weights
        share = np.zeros((3, len(facets), len(t)))
        rows = np.arange(len(facets))
        share[first, rows], share[second, rows] = 1 - t, t
        # (6, 2, …) derivatives of shape functions with respect to the first two area coordinates.
        pairs = ((0, 1), (1, 2), (0, 2))
        by = np.zeros((6, 3, len(facets), len(t)))
        for k in range(3):
            by[k, k] = 4 * share[k] - 1
        for k, (i, j) in enumerate(pairs):
            by[3 + k, i], by[3 + k, j] = 4 * share[j], 4 * share[i]
        nodes = self.mesh.dofs.element_dofs[:, elements]
        values = np.stack([4 * share[i] * share[j] for i, j in pairs])
        values = np.concatenate([share * (2 * share - 1), values])
        places = self.mesh.doflocs[:, nodes]
        at = np.einsum("knq,xkn->xnq", values, places)
        slopes = by[:, 1:] - by[:, :1]
        jacobian = np.einsum("kanq,xkn->nqxa", slopes, places)
        dofs = np.concatenate([self.basis.nodal_dofs, self.basis.facet_dofs], axis=1)[:, nodes]
        local = np.einsum("kanq,xkn->nqxa", slopes, u[dofs])
        gradient = np.einsum("nqxa,nqab->xbnq", local, np.linalg.inv(jacobian))
        along = np.einsum("knq,xkn->xnq", by[:, second, rows] - by[:, first, rows], places)
        ds = np.hypot(*along)
        normal = np.stack([along[1], -along[0]]) / ds
        inward = self.mesh.p[:, corners[3 - first - second, rows]] - self.mesh.p[:, self.mesh.facets[0, facets]]
        normal *= -np.sign(np.sum(normal[:, :, 0] * inward, axis=0))[:, None]
        return _Faces(at, gradient, normal, ds * weights)

    def factors(
        self, u: np.ndarray, points: np.ndarray, ways: np.ndarray, radii: np.ndarray, side: Sequence[Field] = ()
    ) -> np.ndarray:
        """(n, 2) K_I, K_II at tips ``points`` (n, 2) with unit directions ``ways`` (n, 2) of advance, from discs of
        ``radii`` (n,).

        For a curved crack ``side``, one function per tip, gives the side on which points lie: positive on the left.
        """
        from skfem import Basis, ElementTriP2

        field, dx = self.basis.interpolate(u).grad, self.basis.dx
        x = np.asarray(self.basis.global_coordinates())
        weight = Basis(self.mesh, ElementTriP2(), quadrature=self.basis.quadrature)
        faces = self._faces(u) if self.curved else None
        out = np.empty((len(points), 2))
        for row, (tip, way, radius) in enumerate(zip(points, ways, radii)):
            turn = np.array([way, [-way[1], way[0]]])
            inside = side[row](x) if self.curved else None
            q = _falling(np.hypot(*(weight.doflocs - tip[:, None])) / radius)
            dq = np.einsum("ac,c...->a...", turn, weight.interpolate(q).grad)
            for mode in (0, 1):
                out[row, mode] = np.sum(np.sum(_flow(field, x, tip, turn, mode, inside)[2] * dq, axis=0) * dx)
                if faces is not None:
                    # A point on a face belongs to the side of its rock.
                    own_side = side[row](faces.at - 0.01 * radius * faces.normal)
                    normal = np.einsum("ab,b...->a...", turn, faces.normal)
                    a, b, flow = _flow(faces.gradient, faces.at, tip, turn, mode, own_side)
                    # The remaining computed traction on a free face would only disturb.
                    through = np.sum((flow - np.einsum("ij...,i...->j...", a, b)) * normal, axis=0)
                    q_here = _falling(np.hypot(*(faces.at - tip[:, None, None])) / radius)
                    out[row, mode] -= np.sum(q_here * through * faces.ds)
        return 0.5 * ROCK.plane_modulus * out


class _Faces(NamedTuple):
    """Gauss points on crack faces: position (2, …), displacement gradient (2, 2, …), normal out of the rock, length."""

    at: np.ndarray
    gradient: np.ndarray
    normal: np.ndarray
    ds: np.ndarray


def symmetric(matrix, right: np.ndarray) -> np.ndarray:
    """Solve a sparse symmetric system with SuperLU with a symmetric ordering: half the time of its default."""
    from scipy.sparse.linalg import splu

    return splu(
        matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    ).solve(right)


def _pull(side, traction: float):
    from skfem import LinearForm

    return LinearForm(lambda v, _: traction * v[1]).assemble(side)


def _falling(r: np.ndarray) -> np.ndarray:
    """q at ``r`` radii of its disc: one around the tip, then smoothly down to zero at the rim."""
    s = np.clip((r - PLATEAU) / (1 - PLATEAU), 0, 1)
    return 1 - s * s * (3 - 2 * s)


def _flow(gradient, x, tip, turn, mode: int, left: np.ndarray | None) -> np.ndarray:
    """(2, …) σ_ij ∂v_i/∂x_1 + τ_ij ∂u_i/∂x_1 − σ_ik ∂v_i/∂x_k δ_1j in the tip's frame, v and τ Williams' of
    ``mode``."""
    gradient = np.einsum("ac,cd...,bd->ab...", turn, gradient, turn, optimize=True)
    local = np.einsum("ab,b...->a...", turn, x - tip[:, None, None])
    sign = 1.0
    if left is not None:
        # Behind the tip, between the crack and its tangent, the field of the crack's side is continued.
        other = (local[0] < 0) & (left * local[1] < 0)
        sign = np.where(other, -1.0, 1.0)
    other = _williams_gradient(local, mode, sign)
    a, b = stress_of(gradient), stress_of(other)
    flow = np.einsum("ij...,i...->j...", a, other[:, 0]) + np.einsum("ij...,i...->j...", b, gradient[:, 0])
    flow[0] -= np.einsum("ij...,ij...->...", a, other)
    return a, other[:, 0], flow


def stress_of(gradient: np.ndarray) -> np.ndarray:
    """(2, 2, …) plane strain stress of a displacement gradient ∂u_i/∂x_j."""
    mu, nu = ROCK.shear_modulus, ROCK.effective_poissons_ratio
    strain = 0.5 * (gradient + gradient.swapaxes(0, 1))
    mean = 2 * mu * nu / (1 - 2 * nu) * (gradient[0, 0] + gradient[1, 1])
    return 2 * mu * strain + np.eye(2)[:, :, None, None] * mean


def _williams_gradient(x: np.ndarray, mode: int, sign: np.ndarray | float) -> np.ndarray:
    """(2, 2, …) ∂u_i/∂x_j of the singular field with K = 1 (Williams 1957), by the complex potential φ' =
    K/(2√(2πz)); ``sign`` −1 where the root is the one beyond its cut."""
    z = x[0] + 1j * x[1]
    kappa, mu = 3 - 4 * ROCK.effective_poissons_ratio, ROCK.shear_modulus
    k = 1.0 if mode == 0 else -1j
    root = sign * np.sqrt(2 * np.pi * z)
    phi, d_phi = k / (2 * root), -k / (4 * z * root)
    # Faces without traction: ψ' = Ω̄ − φ' − zφ'' with Ω = conj(k)/(2√).
    psi = np.conj(k) / (2 * root) - phi - z * d_phi
    # 2μ (u + iv) = κφ − z conj φ' − conj ψ, differentiated by x and by y.
    by_x = kappa * phi - np.conj(phi) - z * np.conj(d_phi) - np.conj(psi)
    by_y = 1j * (kappa * phi - np.conj(phi) + z * np.conj(d_phi) + np.conj(psi))
    return np.stack([np.stack([by_x.real, by_y.real]), np.stack([by_x.imag, by_y.imag])]) / (2 * mu)
