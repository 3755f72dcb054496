"""Finite elements of scikit-fem for bending: nine-node quadrilaterals on a mapped grid, clamped on one side."""

from __future__ import annotations

import numpy as np

from ...model import Material


def stored_energy(
    corners: np.ndarray, columns: int, rows: int, rock: Material, traction: np.ndarray
) -> tuple[float, int]:
    """Elastic energy, J/m, of a panel clamped on the left under a uniform ``traction`` (2,) Pa on the right, and its
    unknowns.

    ``corners`` (4, 2) m counter-clockwise from the lower left. The grid lines are those of a transfinite mapping.
    """
    from skfem import (
        Basis,
        BilinearForm,
        ElementQuad2,
        ElementVector,
        FacetBasis,
        LinearForm,
        MeshQuad,
        condense,
        solve,
    )
    from skfem.helpers import ddot, eye, sym_grad, trace

    mesh = MeshQuad.init_tensor(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    left, right = mesh.facets_satisfying(lambda x: x[0] < 1e-9), mesh.facets_satisfying(lambda x: x[0] > 1 - 1e-9)
    s, t = mesh.p
    points = sum(
        np.outer(corner, share)
        for corner, share in zip(corners, ((1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t), strict=True)
    )
    mesh = MeshQuad(points, mesh.t)
    basis = Basis(mesh, ElementVector(ElementQuad2()))
    stiffness = rock.stiffness()
    mu, lame = float(stiffness[2, 2]), float(stiffness[0, 1])

    @BilinearForm
    def form(u, v, _):
        e = sym_grad(u)
        return ddot(2 * mu * e + eye(lame * trace(e), 2), sym_grad(v))

    @LinearForm
    def load(v, _):
        return traction[0] * v[0] + traction[1] * v[1]

    force = load.assemble(FacetBasis(mesh, basis.elem, facets=right))
    moved = solve(*condense(form.assemble(basis), force, D=basis.get_dofs(left)))
    return 0.5 * float(force @ moved), basis.N
