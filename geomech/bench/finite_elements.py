"""What is compared with: finite elements (scikit-fem) and a domain integral for K.

The edge crack in the strip on its upper half (the symmetry is free of charge): biquadratic elements on a grid that is
graded geometrically to the tip, direct sparse solution, K = √(E'J) from the domain form of the J-integral (Li, Shih &
Needleman 1985). The specimen on triangles of second degree, graded to the tips and torn along the cracks, K_I and K_II
from the interaction integral (Yau, Wang & Corten 1980). Times are of assembly, solution and the integrals; what
the triangles' mesh takes comes on top and is not counted.
"""

from __future__ import annotations

import importlib.util

import numpy as np

from .crack_problems import ROCK, CrackProblem
from .figures import stopwatch


def available() -> bool:
    """Whether scikit-fem is installed: ``pip install 'geomech[bench]'``."""
    return importlib.util.find_spec("skfem") is not None


def edge_crack(problem: CrackProblem, refinement: int) -> tuple[np.ndarray, int, float]:
    """(1, 2) K_I, K_II (zero by symmetry), the number of unknowns and seconds. Elements shrink to the tip by a factor
    of two in ``refinement`` steps, eight times farther with each refinement."""
    from skfem import Basis, ElementQuad1, ElementQuad2, ElementVector, MeshQuad, condense, solve

    spent_on = stopwatch()
    (width, height), tip = problem.outline[2], problem.polylines[0][1, 0]
    graded = 0.5 ** (np.arange((5 + 3 * refinement) * refinement, -1, -1) / refinement)
    reach = min(tip + width, width - tip)
    line = np.unique(np.concatenate([tip - reach * graded, [tip], tip + reach * graded, [-width, width]]))
    up = np.concatenate([[0.0], reach * graded, np.linspace(reach, height, 1 + 2 * refinement)[1:]])
    mesh = MeshQuad.init_tensor(line, up)
    basis = Basis(mesh, ElementVector(ElementQuad2()), intorder=5)
    force = _pull(basis.boundary(lambda x: np.isclose(x[1], height)), problem.stress[1])
    stiffness = _stiffness(basis)
    ahead = basis.get_dofs(lambda x: np.isclose(x[1], 0.0) & (x[0] > tip - 1e-12)).all("u^2")
    corner = basis.get_dofs(lambda x: np.isclose(x[1], 0.0) & np.isclose(x[0], width)).all("u^1")
    u = solve(*condense(stiffness, force, D=np.concatenate([ahead, corner])))
    weight = Basis(mesh, ElementQuad1(), intorder=5)
    distance = np.max(np.abs(mesh.p - np.array([[tip], [0.0]])), axis=0)
    q = np.clip(2 - 2 * distance / reach, 0, 1)
    j = 2 * _energy_release(basis.interpolate(u), weight.interpolate(q), basis.dx)
    k = np.array([[np.sqrt(ROCK.plane_modulus * j), 0.0]])
    return k, len(u), spent_on()


def specimen(problem: CrackProblem, refinement: int) -> tuple[np.ndarray, int, float]:
    """(n_tips, 2) K_I, K_II, the number of unknowns and seconds; triangles are halved with every ``refinement``."""
    from skfem import Basis, ElementTriP1, ElementTriP2, ElementVector, MeshTri, condense, solve

    from ..shapes.meshing import mesh_interior

    half = 0.5 * float(np.hypot(*np.diff(problem.polylines[0], axis=0)[0]))
    drawn = mesh_interior([problem.outline], problem.cracks, 1.6 * half / 2**refinement, 0.1 * half / 3**refinement)
    spent_on = stopwatch()
    mesh = MeshTri(np.ascontiguousarray(drawn.points.T), np.ascontiguousarray(drawn.triangles.T.astype(np.int64)))
    basis = Basis(mesh, ElementVector(ElementTriP2()), intorder=4)
    height = problem.outline[2, 1]
    force = _pull(basis.boundary(lambda x: np.isclose(x[1], height)), problem.stress[1])
    force += _pull(basis.boundary(lambda x: np.isclose(x[1], -height)), -problem.stress[1])
    # Three numbers of a rigid motion: a corner, and the height of another.
    low = int(np.argmin(mesh.p[0] + mesh.p[1]))
    right = int(np.argmax(mesh.p[0] - mesh.p[1]))
    held = np.concatenate([basis.nodal_dofs[:, low], basis.nodal_dofs[1:, right]])
    u = solve(*condense(_stiffness(basis), force, D=held))
    field = basis.interpolate(u)
    weight = Basis(mesh, ElementTriP1(), intorder=4)
    x = np.asarray(basis.global_coordinates())
    out = []
    for line in problem.polylines:
        for tip, way in ((line[0], line[0] - line[1]), (line[1], line[1] - line[0])):
            way = way / np.hypot(*way)
            turn = np.array([way, [-way[1], way[0]]])
            distance = np.hypot(*(mesh.p - tip[:, None])) / half
            q = weight.interpolate(np.clip(2 - 2.5 * distance, 0, 1))
            local = np.einsum("ab,b...->a...", turn, x - tip[:, None, None])
            out.append([_interaction(field, q, local, turn, mode, basis.dx) for mode in (0, 1)])
    return np.array(out), len(u), spent_on()


def _stiffness(basis):
    from skfem import BilinearForm
    from skfem.helpers import ddot, eye, sym_grad, trace

    mu, nu = ROCK.shear_modulus, ROCK.effective_poissons_ratio
    lame = 2 * mu * nu / (1 - 2 * nu)

    @BilinearForm
    def form(u, v, _):
        e = sym_grad(u)
        return ddot(2 * mu * e + eye(lame * trace(e), 2), sym_grad(v))

    return form.assemble(basis)


def _pull(side, traction: float):
    from skfem import LinearForm

    return LinearForm(lambda v, _: traction * v[1]).assemble(side)


def _stress(gradient: np.ndarray) -> np.ndarray:
    """(2, 2, …) plane strain stress of a displacement gradient ∂u_i/∂x_j."""
    mu, nu = ROCK.shear_modulus, ROCK.effective_poissons_ratio
    strain = 0.5 * (gradient + gradient.swapaxes(0, 1))
    mean = 2 * mu * nu / (1 - 2 * nu) * (gradient[0, 0] + gradient[1, 1])
    return 2 * mu * strain + np.eye(2)[:, :, None, None] * mean


def _energy_release(field, q, dx) -> float:
    """J = ∫ (σ_ij ∂u_i/∂x_1 − W δ_1j) ∂q/∂x_j dA, the crack along x_1, q falling from 1 to 0 away from the tip."""
    gradient, dq = field.grad, q.grad
    stress = _stress(gradient)
    energy = 0.5 * np.einsum("ij...,ij...->...", stress, gradient)
    flow = np.einsum("ij...,i...->j...", stress, gradient[:, 0]) - np.stack([energy, 0 * energy])
    return float(np.sum(np.einsum("j...,j...->...", flow, dq) * dx))


def _interaction(field, q, x, turn, mode: int, dx) -> float:
    """K of ``mode`` 0 or 1: E'/2 times the interaction integral with Williams' field of that mode, in the tip's
    frame."""
    gradient = np.einsum("ac,cd...,bd->ab...", turn, field.grad, turn, optimize=True)
    dq = np.einsum("ac,c...->a...", turn, q.grad)
    other = _williams_gradient(x, mode)
    a, b = _stress(gradient), _stress(other)
    mixed = np.einsum("ij...,ij...->...", a, other)
    flow = np.einsum("ij...,i...->j...", a, other[:, 0]) + np.einsum("ij...,i...->j...", b, gradient[:, 0])
    flow[0] -= mixed
    return float(ROCK.plane_modulus / 2 * np.sum(np.einsum("j...,j...->...", flow, dq) * dx))


def _williams_gradient(x: np.ndarray, mode: int) -> np.ndarray:
    """(2, 2, …) ∂u_i/∂x_j of the singular field with K = 1 (Williams 1957), by the complex potential φ' =
    K/(2√(2πz))."""
    z = x[0] + 1j * x[1]
    kappa, mu = 3 - 4 * ROCK.effective_poissons_ratio, ROCK.shear_modulus
    k = 1.0 if mode == 0 else -1j
    root = np.sqrt(2 * np.pi * z)
    phi, d_phi = k / (2 * root), -k / (4 * z * root)
    # Faces without traction: ψ' = Ω̄ − φ' − zφ'' with Ω = conj(k)/(2√).
    psi = np.conj(k) / (2 * root) - phi - z * d_phi
    # 2μ (u + iv) = κφ − z conj φ' − conj ψ, differentiated by x and by y.
    by_x = kappa * phi - np.conj(phi) - z * np.conj(d_phi) - np.conj(psi)
    by_y = 1j * (kappa * phi - np.conj(phi) + z * np.conj(d_phi) + np.conj(psi))
    return np.stack([np.stack([by_x.real, by_y.real]), np.stack([by_x.imag, by_y.imag])]) / (2 * mu)
