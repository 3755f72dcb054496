"""Other solvers of a step's equations, measured next to the direct one of `geomech.dda`: iterative ones, and the direct
solver PARDISO (in Intel's MKL), if installed by ``pip install 'geomech[pardiso]'``.

Sliding friction makes the equations unsymmetric, so that both iterate on the unsymmetric matrix: stabilised biconjugate
gradients (van der Vorst 1992) with the blocks' own 6×6 inverses as preconditioner, and GMRES with two levels of
domains: overlapping ones solved directly in single precision (restricted additive Schwarz; Cai & Sarkis 1999) after a
coarse field of six unknowns, the motion of a first-order block, for every few blocks.

The cost of direct solvers is that of a set of contacts whose springs have all changed: factors and substitutions, with
a given elimination order (which is valid as long as the list of contacts does not change).
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...dda.linear_solver.block_solver import BlockSolver
from ...dda.linear_solver.multifrontal import Factors
from ..figures import stopwatch

#: Relative residuals (norms) at which iterations stop.
TOLERANCES = 1e-2, 1e-4, 1e-7, 1e-10
#: Blocks per domain, layers of neighbours added to it, blocks per coarse field (least time on walls of 10 000 bricks).
DOMAIN, OVERLAP, AGGREGATE = 1000, 2, 30


@dataclass(frozen=True)
class Iterated:
    """One method's solution of a step: iterations, seconds, and error."""

    method: str
    iterations: int
    seconds: float
    residual: float
    solution: np.ndarray


def _rows(solver: BlockSolver) -> np.ndarray:
    """(n_entries,) row of each of the matrix's blocks."""
    return np.repeat(np.arange(solver.n), np.diff(solver.pointer))


def pardiso_available() -> bool:
    """Whether pypardiso, and with it MKL, is installed: ``pip install 'geomech[pardiso]'``."""
    return importlib.util.find_spec("pypardiso") is not None


def refactored(solver: BlockSolver, points: np.ndarray, data: np.ndarray, right: np.ndarray) -> Iterated:
    """As in `geomech.dda` if nothing of an earlier set of contacts can be reused; ``points`` (n, 2) m are the blocks'
    centroids."""
    another = BlockSolver(points, _rows(solver), solver.columns)
    another.factor(data)  # allocates its memory
    spent_on = stopwatch()
    another.factor(data)
    x = another.solve(data, right)
    return _row("direct, all factored again", solver, data, right, x, 1, spent_on())


def pardiso(solver: BlockSolver, data: np.ndarray, right: np.ndarray) -> Iterated:
    """By PARDISO of MKL, for real unsymmetric matrices, on all cores, without the time of its ordering."""
    from pypardiso import PyPardisoSolver
    from scipy.sparse import bsr_matrix

    size = len(right)
    matrix = bsr_matrix((data.reshape(-1, 6, 6), solver.columns, solver.pointer), shape=(size, size)).tocsr()
    method = PyPardisoSolver()
    try:
        method.factorize(matrix)
        spent_on = stopwatch()
        method.set_phase(22)  # numerical factorisation with the earlier ordering
        method._call_pardiso(matrix, right)
        method.set_phase(33)
        x = method._call_pardiso(matrix, right)
        return _row("PARDISO of MKL", solver, data, right, x, 1, spent_on())
    finally:
        method.free_memory(everything=True)


def block_jacobi(
    solver: BlockSolver, data: np.ndarray, right: np.ndarray, tolerance: float = TOLERANCES[-1], most: int = 3000
) -> Iterated:
    """BiCGStab with the diagonal blocks as preconditioner; gives up after ``most`` iterations."""
    from scipy.sparse.linalg import LinearOperator, bicgstab

    spent_on = stopwatch()
    inverse = np.linalg.inv(data.reshape(-1, 6, 6)[_rows(solver) == solver.columns])
    size = len(right)
    matrix = LinearOperator((size, size), matvec=lambda x: solver.multiply(data, x), dtype=float)
    behind = LinearOperator(
        (size, size), matvec=lambda r: np.einsum("nij,nj->ni", inverse, r.reshape(-1, 6)).ravel(), dtype=float
    )
    count = [0]

    def count_iteration(_: np.ndarray) -> None:
        count[0] += 1

    x, _ = bicgstab(matrix, right, rtol=tolerance, maxiter=most, M=behind, callback=count_iteration)
    return _row("block Jacobi", solver, data, right, x, count[0], spent_on())


def two_levels(
    solver: BlockSolver,
    points: np.ndarray,
    sizes: np.ndarray,
    data: np.ndarray,
    right: np.ndarray,
    tolerance: float = TOLERANCES[-1],
) -> Iterated:
    """GMRES with domains and coarse fields as preconditioner; ``points`` (n, 2) and ``sizes`` (n,) m are the blocks'
    centroids and √area."""
    spent_on = stopwatch()
    n, rows, columns = solver.n, _rows(solver), solver.columns
    blocks = data.reshape(-1, 6, 6)
    domains = []
    for members in _divided(points, DOMAIN):
        inside = np.zeros(n, bool)
        inside[members] = True
        core = inside.copy()
        for _ in range(OVERLAP):
            inside[columns[inside[rows]]] = True
        wide = np.flatnonzero(inside)
        number = np.cumsum(inside) - 1
        here = np.flatnonzero(inside[rows] & inside[columns])
        factors = Factors(points[wide], number[rows[here]], number[columns[here]], np.float32)
        factors.factor(blocks[here].ravel())
        domains.append((wide, core[wide], factors))
    fields, of, coarse = _coarse(points, sizes, rows, columns, blocks)

    def behind(r: np.ndarray) -> np.ndarray:
        given = r.reshape(-1, 6)
        z = np.zeros_like(given)
        for wide, core, factors in domains:
            z[wide[core]] = factors.substitute(given[wide].ravel()).reshape(-1, 6)[core]
        rest = (r - solver.multiply(data, z.ravel())).reshape(-1, 6)
        total = np.zeros((of.max() + 1, 6))
        np.add.at(total, of, np.einsum("nab,na->nb", fields, rest))
        return (z + np.einsum("nab,nb->na", fields, coarse.substitute(total.ravel()).reshape(-1, 6)[of])).ravel()

    x, iterations = _flexible_gmres(lambda x: solver.multiply(data, x), behind, right, tolerance)
    return _row("two levels of domains", solver, data, right, x, iterations, spent_on())


def _flexible_gmres(
    matrix: Callable, behind: Callable, right: np.ndarray, tolerance: float, most: int = 100
) -> tuple[np.ndarray, int]:
    """Solution and iterations of flexible GMRES (Saad 1993): the preconditioner ``behind`` need not be linear to
    round-off, as in single precision."""
    size = float(np.linalg.norm(right))
    basis, directions = [right / size], []
    hessenberg, first = np.zeros((most + 1, most)), np.zeros(most + 1)
    first[0] = size
    for k in range(most):
        directions.append(behind(basis[-1]))
        v = matrix(directions[-1])
        for i, q in enumerate(basis):
            hessenberg[i, k] = q @ v
            v -= hessenberg[i, k] * q
        hessenberg[k + 1, k] = np.linalg.norm(v)
        y = np.linalg.lstsq(hessenberg[: k + 2, : k + 1], first[: k + 2], rcond=None)[0]
        if np.linalg.norm(first[: k + 2] - hessenberg[: k + 2, : k + 1] @ y) <= tolerance * size:
            break
        basis.append(v / hessenberg[k + 1, k])
    return np.column_stack(directions) @ y, len(directions)


def _row(method: str, solver: BlockSolver, data, right, x, iterations: int, seconds: float) -> Iterated:
    rest = float(np.linalg.norm(right - solver.multiply(data, x)) / np.linalg.norm(right))
    return Iterated(method, iterations, seconds, rest, x)


def _divided(points: np.ndarray, most: int) -> list[np.ndarray]:
    """Blocks divided recursively until no part has more than ``most``."""
    out, work = [], [np.arange(len(points))]
    while work:
        blocks = work.pop()
        if len(blocks) <= most:
            out.append(blocks)
            continue
        along = points[blocks][:, int(np.argmax(np.ptp(points[blocks], axis=0)))]
        half = np.argpartition(along, len(blocks) // 2)
        work += [blocks[half[: len(blocks) // 2]], blocks[half[len(blocks) // 2 :]]]
    return out


def _coarse(points, sizes, rows, columns, blocks) -> tuple[np.ndarray, np.ndarray, Factors]:
    """(n, 6, 6) the blocks' unknowns in terms of each field's, the field of each block, and the factored equations of
    the fields."""
    of = np.empty(len(points), np.int64)
    groups = _divided(points, AGGREGATE)
    for k, group in enumerate(groups):
        of[group] = k
    centre = np.array([points[group].mean(axis=0) for group in groups])
    width = np.array([np.sqrt((sizes[group] ** 2).sum()) for group in groups])
    x, y = ((points - centre[of]) / width[of, None]).T
    fields = np.zeros((len(points), 6, 6))
    fields[:, 0, 0] = fields[:, 1, 1] = 1.0
    fields[:, 0, 2], fields[:, 1, 2] = -y, x
    fields[:, 0, 3], fields[:, 1, 4] = x, y
    fields[:, 0, 5], fields[:, 1, 5] = 0.5 * y, 0.5 * x
    for k in range(2, 6):
        fields[:, k, k] = sizes / width[of]
    keys, at = np.unique(of[rows] * len(groups) + of[columns], return_inverse=True)
    matrix = np.zeros((len(keys), 6, 6))
    np.add.at(matrix, at, np.swapaxes(fields[rows], 1, 2) @ blocks @ fields[columns])
    factors = Factors(centre, keys // len(groups), keys % len(groups))
    factors.factor(matrix.ravel())
    return fields, of, factors
