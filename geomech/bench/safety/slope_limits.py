"""Limits of rigid blocks, independent of the solver: the linear programme of static admissibility, and limit
equilibrium of one or two sliding blocks.

Faces shared by two blocks carry, at their ends, normal forces N₀, N₁ ≥ 0 and along them one shear force S with

    |S| ≤ (c ℓ + tan φ (N₀ + N₁))/F.

Some set of them balances the loads on every block up to a largest F: with strengths divided by more than that, rigid
blocks have no equilibrium, so that it is an upper bound of the factor of safety (static theorem; for friction, which
dilates less than its angle, the factor may be lower: Drescher & Detournay 1993, Géotechnique 43, 443-456). Forces in N
per metre of thickness, moments about the origin.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np

from ...model import Blocks, Problem

#: Faces coincide within this part of the blocks' extent.
_ON_FACE = 1e-7
#: Largest factor of the search; a slope above it is taken as stable.
FARTHEST = 64.0
#: Number of pieces of an edge for the integration of water pressure.
_PIECES = 2000


@dataclass(frozen=True, eq=False)
class Faces:
    """Faces (m,) between ``block`` and ``other``.

    start, end   (m, 2) along the edge of ``block``
    normal       (m, 2) its outward normal, towards ``other``
    name, law    name of the edge, index of the joint law
    """

    block: np.ndarray
    other: np.ndarray
    start: np.ndarray
    end: np.ndarray
    normal: np.ndarray
    name: list[str]
    law: np.ndarray

    @property
    def length(self) -> np.ndarray:
        return np.hypot(*(self.end - self.start).T)


def shared_faces(problem: Problem) -> Faces:
    """Shared faces at the reference positions: where edges of two blocks coincide; not between fixed blocks."""
    blocks = problem.blocks
    start, end = blocks.vertices, blocks.vertices[blocks.next_vertex]
    along = end - start
    length = np.hypot(*along.T)
    unit = along / length[:, None]
    owner, near = blocks.vertex_block, _ON_FACE * float(np.ptp(start, axis=0).max())
    low, high = np.minimum(start, end) - near, np.maximum(start, end) + near
    order = np.argsort(low[:, 0], kind="stable")
    ascending = low[order, 0]
    found: list[tuple] = []
    for at, i in enumerate(order):
        others = order[at + 1 : np.searchsorted(ascending, high[i, 0], side="right")]
        others = others[(low[others, 1] <= high[i, 1]) & (high[others, 1] >= low[i, 1]) & (owner[others] != owner[i])]
        others = others[~(blocks.fixed[owner[others]] & blocks.fixed[owner[i]])]
        others = others[unit[others] @ unit[i] < -1 + 1e-6]
        for j in others:
            a, b = np.sort([(start[j] - start[i]) @ unit[i], (end[j] - start[i]) @ unit[i]])
            off = [abs(unit[i, 0] * d[1] - unit[i, 1] * d[0]) for d in (start[j] - start[i], end[j] - start[i])]
            a, b = max(a, 0.0), min(b, float(length[i]))
            if max(off) < 10 * near and b - a > 10 * near:
                found.append((i, j, start[i] + a * unit[i], start[i] + b * unit[i]))
    own_edge = np.array([row[0] for row in found], int)
    other_edge = np.array([row[1] for row in found], int)
    names = [[blocks.edge_names[blocks.edge_name[k]] for k in of] for of in (own_edge, other_edge)]
    normal = np.stack([unit[own_edge, 1], -unit[own_edge, 0]], axis=1)
    law = np.array([problem.joint_index(a, b) for a, b in zip(*names)], int)
    ends = [np.array([row[k] for row in found]).reshape(-1, 2) for k in (2, 3)]
    return Faces(owner[own_edge], owner[other_edge], *ends, normal, [a or b for a, b in zip(*names)], law)


def loads_on_blocks(problem: Problem) -> np.ndarray:
    """(n_blocks, 3) force x, y and moment about the origin of weight and water at the scene's end."""
    blocks, loads, time = problem.blocks, problem.loads, problem.run.end_time
    density = np.array([material.density for material in problem.materials])[blocks.material]
    mass, mid = density * blocks.areas(), _centroids(blocks)
    force = mass[:, None] * np.asarray(loads.gravity.at(time))
    out = np.column_stack([force, _cross(mid, force)])
    if loads.water is not None:
        _add_water(out, blocks, loads.water)
    return out


def _centroids(blocks: Blocks) -> np.ndarray:
    start, end = blocks.vertices, blocks.vertices[blocks.next_vertex]
    double = _cross(start, end)
    parts = np.zeros((blocks.n_blocks, 3))
    np.add.at(parts, blocks.vertex_block, np.column_stack([(start + end) * double[:, None] / 3, double]))
    return parts[:, :2] / parts[:, 2:]


def _add_water(out: np.ndarray, blocks: Blocks, water) -> None:
    start = blocks.vertices
    along = blocks.vertices[blocks.next_vertex] - start
    share = (np.arange(_PIECES) + 0.5) / _PIECES
    inward = np.stack([-along[:, 1], along[:, 0]], axis=1) / _PIECES
    for edge, block in enumerate(blocks.vertex_block):
        at = start[edge] + share[:, None] * along[edge]
        depth = np.interp(at[:, 0], *np.asarray(water.points, float).T) - at[:, 1]
        force = water.unit_weight * np.maximum(depth, 0.0)[:, None] * inward[edge]
        out[block] += [*force.sum(axis=0), _cross(at, force).sum()]


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def admissible_factor(problem: Problem, open_faces: Collection[str] = (), tolerance: float = 1e-5) -> float:
    """Largest F with admissible contact forces (0: none even at 1/64; inf: still at 64).

    ``open_faces``: names of edges without forces, such as tension cracks. Bolts may have any tension up to their yield
    force; with a tensile strength each end of a face may carry half of the whole face's tension.
    """
    programme = _Programme(problem, open_faces)
    low, high = 0.5, 2.0
    while not programme.balances(low):
        if low <= 1.0 / FARTHEST:
            return 0.0
        low, high = 0.5 * low, low
    while programme.balances(high):
        if high >= FARTHEST:
            return math.inf
        low, high = high, 2.0 * high
    while high > low * (1 + tolerance):
        mid = math.sqrt(low * high)
        low, high = (mid, high) if programme.balances(mid) else (low, mid)
    return math.sqrt(low * high)


class _Programme:
    """Equilibrium of all free blocks with N₀, N₁, S of each face and the tension of each bolt."""

    def __init__(self, problem: Problem, open_faces: Collection[str]) -> None:
        from scipy import sparse

        faces = shared_faces(problem)
        keep = np.array([name not in open_faces for name in faces.name], bool)
        blocks, laws = problem.blocks, problem.joints
        self.friction = np.array([math.tan(law.friction_angle) for law in laws])[faces.law[keep]]
        self.hold = np.array([law.cohesion for law in laws])[faces.law[keep]] * faces.length[keep]
        self.pull = 0.5 * np.array([law.tensile_strength for law in laws])[faces.law[keep]] * faces.length[keep]
        free = np.flatnonzero(~blocks.fixed)
        row_of = np.full(blocks.n_blocks, -1)
        row_of[free] = np.arange(len(free))
        tangent = np.stack([-faces.normal[:, 1], faces.normal[:, 0]], axis=1)
        m = int(keep.sum())
        entries: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

        def add(block: np.ndarray, columns: np.ndarray, force: np.ndarray, point: np.ndarray) -> None:
            row = row_of[block]
            known = row >= 0
            parts = np.column_stack([force, _cross(point, force)])[known]
            for k in range(3):
                entries.append((3 * row[known] + k, columns[known], parts[:, k]))

        for sign, of in ((-1.0, faces.block[keep]), (1.0, faces.other[keep])):
            for k, (force, point) in enumerate(
                ((faces.normal, faces.start), (faces.normal, faces.end), (tangent, faces.start))
            ):
                add(of, np.arange(m) + k * m, sign * force[keep], point[keep])
        self.most = [bolt.yield_force for bolt in problem.loads.bolts]
        for k, bolt in enumerate(problem.loads.bolts):
            ends = np.array([bolt.start, bolt.end])
            pull = (ends[1] - ends[0]) / math.dist(*ends)
            for sign, block, point in ((1.0, bolt.block, ends[0]), (-1.0, bolt.other, ends[1])):
                if block >= 0:
                    add(np.array([block]), np.array([3 * m + k]), sign * pull[None], point[None])
        loads = loads_on_blocks(problem)[free]
        self.unit = float(np.abs(loads[:, :2]).max())
        rows, columns, values = (np.concatenate(parts) for parts in zip(*entries))
        shape = (3 * len(free), 3 * m + len(self.most))
        self.matrix = sparse.csr_matrix((values, (rows, columns)), shape)
        self.right = -loads.ravel() / self.unit
        self.m = m

    def balances(self, factor: float) -> bool:
        from scipy import optimize, sparse

        m, n_bolts = self.m, len(self.most)
        eye, friction = sparse.identity(m), sparse.diags(self.friction / factor)
        bolts = sparse.csr_matrix((2 * m, n_bolts))
        cone = sparse.hstack([sparse.vstack([-friction] * 2), sparse.vstack([-friction] * 2),
                              sparse.vstack([eye, -eye]), bolts])  # fmt: skip
        hold = np.tile(self.hold / factor / self.unit, 2)
        pull = np.minimum(self.pull / factor / self.unit, 1e9)
        bounds = [(-low, None) for low in pull.tolist() * 2] + [(None, None)] * m
        bounds += [(0.0, most / self.unit if math.isfinite(most) else None) for most in self.most]
        found = optimize.linprog(
            np.zeros(3 * m + n_bolts), cone.tocsr(), hold, self.matrix, self.right, bounds, method="highs"
        )
        return found.status == 0


def sliding_factor(problem: Problem, planes: Collection[str], interface: str = "") -> float:
    """Limit equilibrium of one block, or of two across ``interface``, that slide on ``planes`` (names of edges).

    Every bolt has its yield force, other faces have no force; moments are not considered. Each block slides down its
    planes, which are parallel, with a velocity that keeps the interface closed; friction and cohesion are fully
    mobilised against that motion everywhere (Jaeger 1971, Géotechnique 21, 97-134). Raises ValueError if the interface
    would be in tension.
    """
    faces, loads = shared_faces(problem), loads_on_blocks(problem)[:, :2]
    for bolt in problem.loads.bolts:
        pull = bolt.yield_force * (np.array(bolt.end) - bolt.start) / math.dist(bolt.start, bolt.end)
        for sign, block in ((1.0, bolt.block), (-1.0, bolt.other)):
            if block >= 0:
                loads[block] += sign * pull
    free = [int(b) for b in np.flatnonzero(~problem.blocks.fixed)]
    bearing = [_held_on(problem, faces, {block}, planes) for block in free]
    between = None
    if interface:
        between = _held_on(problem, faces, {free[0]}, {interface}, free[1])
        ways = [np.stack(each.way) for each in bearing]
        ratio = (ways[0] @ between.normal) / (ways[1] @ between.normal)
        slip = (ways[0] - ratio * ways[1]) @ between.tangent
        between = between.against(slip)

    def surplus(factor: float) -> tuple[float, np.ndarray]:
        unknown = len(free) + (between is not None)
        matrix, right = np.zeros((2 * len(free), unknown)), np.zeros(2 * len(free))
        for k, (block, on) in enumerate(zip(free, bearing)):
            rows = slice(2 * k, 2 * k + 2)
            matrix[rows, k], fixed = on.forces(factor)
            right[rows] = -loads[block] - fixed
            if between is not None:
                sign = 1.0 if k == 0 else -1.0
                by_normal, fixed = between.forces(factor)
                matrix[rows, -1], right[rows] = sign * by_normal, right[rows] - sign * fixed
        # Normal forces from all equations except that of the last block along its plane; the surplus is that of the
        # latter.
        way = bearing[-1].way
        across = np.array([-way[1], way[0]])
        turn = np.eye(2 * len(free))
        turn[-2:, -2:] = [across, way]
        matrix, right = turn @ matrix, turn @ right
        normal = np.linalg.solve(matrix[:-1], right[:-1])
        return float(matrix[-1] @ normal - right[-1]), normal

    factor = _root(lambda factor: surplus(factor)[0])
    if math.isinf(factor):
        return factor
    normal = surplus(factor)[1]
    if (normal < 0).any():
        raise ValueError("a face of the sliding blocks would be in tension")
    return factor


@dataclass(frozen=True, eq=False)
class _Held:
    """Forces of a face, or of parallel ones, on a block that slides along ``way``: N along ``normal``, and against the
    way (c ℓ + tan φ N)/F."""

    normal: np.ndarray
    way: np.ndarray
    friction: float
    hold: float

    @property
    def tangent(self) -> np.ndarray:
        return np.array([-self.normal[1], self.normal[0]])

    def against(self, slip: float) -> _Held:
        return _Held(self.normal, math.copysign(1.0, slip) * self.tangent, self.friction, self.hold)

    def forces(self, factor: float) -> tuple[np.ndarray, np.ndarray]:
        """Terms proportional to the normal force, and constant terms."""
        return self.normal - self.friction / factor * self.way, -self.hold / factor * self.way


def _held_on(
    problem: Problem, faces: Faces, block: set[int], names: Collection[str], other: int | None = None
) -> _Held:
    named = np.array([name in names for name in faces.name], bool)
    first = named & np.isin(faces.block, list(block))
    second = named & np.isin(faces.other, list(block))
    if other is not None:
        first, second = first & (faces.other == other), second & (faces.block == other)
    rows = np.flatnonzero(first | second)
    if not len(rows):
        raise ValueError(f"no face called {', '.join(names)} holds the block")
    # The force on the block is against its own outward normal.
    normal = (faces.normal * np.where(first, -1.0, 1.0)[:, None])[rows]
    if not (normal @ normal[0] > 1 - 1e-9).all():
        raise ValueError(f"the faces {', '.join(names)} of a block are not parallel")
    law = problem.joints[faces.law[rows[0]]]
    way = np.array([-normal[0, 1], normal[0, 0]])
    way = way if way[1] < 0 else -way
    return _Held(normal[0], way, math.tan(law.friction_angle), law.cohesion * float(faces.length[rows].sum()))


def _root(surplus: Callable[[float], float]) -> float:
    """Largest F at which the ``surplus`` of driving forces changes its sign, by bisection; inf without any."""
    trials = np.geomspace(FARTHEST, 0.02, 400)
    values = [surplus(float(each)) for each in trials]
    for k in range(len(trials) - 1):
        if values[k] * values[k + 1] <= 0:
            high, low, at_low = float(trials[k]), float(trials[k + 1]), values[k + 1]
            while high - low > 1e-12 * high:
                mid = 0.5 * (low + high)
                low, high = (mid, high) if surplus(mid) * at_low > 0 else (low, mid)
            return 0.5 * (low + high)
    return math.inf
