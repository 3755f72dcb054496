"""States of a few contacts found together: where one goes round with its neighbours while all others stand.

With the states of all other contacts as they are, a step is linear, and what a few contacts do to each other is a small
matrix W: y = y₀ + W f, their motions y along normal and edge under their forces f = (N, S = α − β). Of each is asked

    w = g + y_n − κ y_t + N/kₙ,   N w = 0,      s = y_t + (S − S₀)/kₛ,   α (λ + s) = β (λ − s) = 0,
                                                                         λ (μN + c − α − β) = 0,

all of N, w, α, β, λ, λ ± s and the strength left ≥ 0: the linear complementarity problem of rigid bodies with friction
in a step (Stewart & Trinkle 1996), which Lemke's (1965) way of pivoting solves wherever W is positive (Anitescu & Potra
1997: its matrix is then copositive, and the way does not end in a ray). Contact by contact none of the states may fit:
one that sticks is sheared too hard, slides, is pressed harder by its neighbour for that, and would slide back. Others
that slide nearby, whose friction follows what presses them, may leave no answer but with their own states.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...compiled import kept
from ...model import OPEN, SLIP, STICK
from ..joint_laws import coulomb_return
from ..joint_laws.penalty_springs import Springs
from ..linear_solver import assembly
from .contact_set import ContactSet

#: Residual of the motions under unit forces, relative to these.
_WITHIN = 1e-10
#: Pivots at most, for each unknown. A dozen contacts take two.
_PIVOTS = 20
#: Ways that are tried, from as many directions: one of them may end in a ray though another does not.
_WAYS = 4
#: Strength that is as good as none, in parts of the largest force.
_HELD = 1e-9
#: Part of a column below which its entries are round-off.
_ROUND_OFF = 1e-11


def settled_together(
    which: np.ndarray,
    state: np.ndarray,
    direction: np.ndarray,
    pattern: assembly.Pattern,
    matrix: np.ndarray,
    right: np.ndarray,
    found: ContactSet,
    vectors: np.ndarray,
    springs: Springs,
    gap: np.ndarray,
    room: Callable[[], np.ndarray] | None = None,
) -> tuple[np.ndarray, np.ndarray] | None:
    """``state`` and ``direction`` (n,) with those of the contacts ``which`` (n,) bool, none of them bonded, that fit
    each other while all others stand; None where none are found. The rest as for `settle`, ``room`` as for
    `CentralPath`. Raises numpy.linalg.LinAlgError."""
    state, direction = np.where(which, OPEN, state), np.where(which, 0.0, direction)
    rows = np.flatnonzero(which)
    if not len(rows):
        return None
    data, side = np.empty(pattern.size) if room is None else room(), np.empty(6 * pattern.n)
    assembly.assemble_contacts(
        pattern, data, side, matrix, right, pattern.upper, pattern.lower, found.block, found.other, pattern.order,
        vectors, state, direction, gap, springs.normal, springs.shear, springs.friction, springs.sliding, springs.lift,
        found.shear,
    )  # fmt: skip
    solve = _solution_of(pattern, data)
    at = found.block[rows], found.other[rows], pattern.order, np.ascontiguousarray(vectors[rows])
    lift, k = springs.lift[rows], len(rows)

    def motions(unknowns: np.ndarray) -> np.ndarray:
        """(2 k,) m: what parts the contacts, and what moves them along."""
        moved = coulomb_return.moved(unknowns, *at)
        return np.concatenate([moved[:, 0] - lift * moved[:, 1], moved[:, 1]])

    given = motions(solve(side))
    answers = np.empty((2 * k, 2 * k))
    for column in range(2 * k):
        answers[:, column] = motions(solve(_unit_force(6 * pattern.n, *at, column % k, column // k)))
    slides = found.state[rows] == SLIP
    friction = np.where(slides, springs.friction[rows], springs.peak[rows])
    firm = np.where(slides, springs.sliding[rows], springs.hold[rows])
    kn, ks = springs.normal[rows], springs.shear[rows]
    given[:k] += gap[rows]
    given[k:] -= found.shear[rows] / ks
    answers[np.arange(2 * k), np.arange(2 * k)] += 1.0 / np.concatenate([kn, ks])
    fitting = states_that_fit(given, answers, kn, friction, firm)
    if fitting is None:
        return None
    state[rows], direction[rows] = fitting
    return state, direction


def states_that_fit(
    given: np.ndarray, answers: np.ndarray, kn: np.ndarray, friction: np.ndarray, firm: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """State and direction (k,) of contacts with strengths ``friction`` N + ``firm`` (k,), that fit each other; None
    where none are found. (What is open is taken to keep its ``firm`` part.) ``given`` (2 k,) m: gaps, then motion along
    less that of S₀, without their forces; ``answers`` (2 k, 2 k) m/N to unit forces along normals, then edges, what
    springs give, by 1/``kn`` and 1/kₛ, included."""
    basic = _solved(*_complementarity(given, answers, kn, friction, firm))
    if basic is None:
        return None
    pressed, ahead, back, moves = basic.reshape(4, len(kn))
    rough = (friction > 0.0) | (firm > 0.0)
    # Shared between both ways, the force is that of one that does not move.
    way = np.where(pressed & rough & moves, ahead.astype(float) - back, 0.0)
    return np.where(pressed, np.where((way != 0.0) | ~rough, SLIP, STICK), OPEN), way


def clusters(which: np.ndarray, found: ContactSet, order: np.ndarray) -> list[np.ndarray]:
    """The contacts ``which`` (n,) bool in sets (n,) bool that have no free block in common; ``order`` (n_blocks,) −1
    for fixed blocks."""
    rows = np.flatnonzero(which)
    pairs = np.stack([found.block[rows], found.other[rows]])
    pairs = np.where(order[pairs] < 0, pairs[::-1], pairs)
    _, at = np.unique(pairs, return_inverse=True)
    first, second = at.reshape(2, -1)
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(rows)), (first, second)), (at.max() + 1,) * 2)
    _, label = connected_components(graph, directed=False)
    out = []
    for one in np.unique(label[first]):
        out.append(np.zeros(len(which), bool))
        out[-1][rows[label[first] == one]] = True
    return out


def with_neighbours(which: np.ndarray, state: np.ndarray, bonded: np.ndarray, found: ContactSet, order: np.ndarray):
    """(n,) bool: the contacts ``which`` (n,), and others without a bond that slide on the same free blocks."""
    at = np.zeros(len(order), bool)
    for block in (found.block, found.other):
        at[block[which]] = True
    at &= order >= 0
    return which | ((at[found.block] | at[found.other]) & (state == SLIP) & (bonded == 0))


def _solution_of(pattern: assembly.Pattern, data: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """What solves with the matrix of ``data``. Raises numpy.linalg.LinAlgError."""
    pattern.add_links(data)
    if pattern.solver is not None:
        return lambda right: pattern.solver.solve(data, right, _WITHIN)
    from scipy.linalg.lapack import dgetrf, dgetrs

    factors, pivots, info = dgetrf(data.reshape(6 * pattern.n, -1))
    if info != 0:
        raise np.linalg.LinAlgError(f"the step's matrix is singular (unknown {info - 1})")
    return lambda right: dgetrs(factors, pivots, right)[0]


@kept(fastmath=False, error_model="numpy", nogil=True)
def _unit_force(size, block, other, order, vectors, contact, axis):
    """(size,) the generalised force of 1 N of a contact along its normal (``axis`` 0) or its edge (1)."""
    out = np.zeros(size)
    for side in range(2):
        i = order[block[contact]] if side == 0 else order[other[contact]]
        if i >= 0:
            out[6 * i : 6 * i + 6] += vectors[contact, axis, 6 * side : 6 * side + 6]
    return out


def _complementarity(given, answers, kn, friction, firm) -> tuple[np.ndarray, np.ndarray]:
    """q (4 k,) and M (4 k, 4 k) of w = q + M z, of z = (N, α, β, λ), in units of a force and of what it presses springs
    in by; arguments as for `states_that_fit`."""
    k = len(kn)
    force = max(float(np.abs(given[:k] * kn).max()), float(firm.max()), 1e-300)
    depth = force / float(kn.mean())
    given, answers = given / depth, answers * (force / depth)
    one, none = np.eye(k), np.zeros((k, k))
    gap, along = np.hsplit(answers[:k], 2), np.hsplit(answers[k:], 2)
    m = np.block(
        [
            [gap[0], gap[1], -gap[1], none],
            [along[0], along[1], -along[1], one],
            [-along[0], -along[1], along[1], one],
            [np.diag(friction), -one, -one, none],
        ]
    )
    # A little that all hold: ways come to no end among rows that tie at nothing.
    held = firm / force + _HELD * (1.0 + np.arange(k) / k)
    return np.concatenate([given[:k], given[k:], -given[k:], held]), m


def _solved(q: np.ndarray, m: np.ndarray) -> np.ndarray | None:
    """(n,) True where z is basic in a solution of w = q + M z, z·w = 0, both ≥ 0; None where none is found."""
    n = len(q)
    # Other ways: the same rows in other units.
    units = 0.2 + 1.8 * np.modf(np.outer(np.arange(_WAYS), np.arange(1, n + 1)) * 0.6180339887498949)[0]
    units[0] = 1.0
    for unit in units:
        basis, done = _pivoted(q / unit, m / unit[:, None], _PIVOTS * n, _ROUND_OFF)
        if done:
            out = np.zeros(n, bool)
            out[basis[basis >= n] - n] = True
            return out
    return None


@kept(fastmath=False, error_model="numpy", nogil=True)
def _pivoted(q, m, most, round_off):
    """Lemke's pivots: the basic variables (n,), w as 0 … n − 1, z from n on, and whether the artificial one has left.
    Of rows that tie, the one whose artificial leaves, else the one of the largest pivot."""
    n = q.shape[0]
    basis = np.arange(n)
    row = 0
    for i in range(n):
        if q[i] < q[row]:
            row = i
    if n == 0 or q[row] >= 0.0:
        return basis, True
    artificial = 2 * n
    table = np.zeros((n, 2 * n + 2))
    for i in range(n):
        table[i, i] = 1.0
        for j in range(n):
            table[i, n + j] = -m[i, j]
        table[i, artificial] = -1.0
        table[i, artificial + 1] = q[i]
    entering = artificial
    for _ in range(most):
        pivot = table[row, entering]
        for j in range(2 * n + 2):
            table[row, j] /= pivot
        for i in range(n):
            share = table[i, entering]
            if i != row and share != 0.0:
                for j in range(2 * n + 2):
                    table[i, j] -= share * table[row, j]
                table[i, entering] = 0.0
        leaving, basis[row] = basis[row], entering
        if leaving == artificial:
            return basis, True
        entering = leaving + n if leaving < n else leaving - n
        least, size = np.inf, 0.0
        for i in range(n):
            size = max(size, abs(table[i, entering]))
        for i in range(n):
            if table[i, entering] > round_off * size:
                least = min(least, max(table[i, artificial + 1], 0.0) / table[i, entering])
        if least == np.inf:
            return basis, False
        row, best = -1, 0.0
        for i in range(n):
            if not table[i, entering] > round_off * size:
                continue
            if max(table[i, artificial + 1], 0.0) / table[i, entering] <= least * (1.0 + 1e-12) + 1e-300:
                if basis[i] == artificial:
                    row = i
                    break
                if table[i, entering] > best:
                    row, best = i, table[i, entering]
    return basis, False
