"""Fast multipole method for the influence of many elements on many others, without storing the matrix.

The stress of displacement jumps derives from two analytic functions (Kolosov–Muskhelishvili),

    (σxx + σyy)/2 = −Re Φ(z),      (σyy − σxx)/2 + i σxy = −½ conj(z − z0) Φ'(z) + Ψ(z),

with Ψ relative to the centre z0. An element of half length c, tangent e and midpoint z0, with jumps p along and q
normal to it, times 2μ, and with A_k the Cauchy moments of `full_plane`, has

    Φ = f/c Σ (q_k − i p_k) A_k'(ζ),   Ψ = e⁻² [½ (z − z0) Φ' − i f/c Σ p_k A_k'(ζ)],   f = 1/(4π(1−ν)),
    ζ = (z − z0)/(c e).

Both have Laurent series in c/(z − z0) whose coefficients are exactly the moments of the shape functions. The fast
multipole method (Greengard & Rokhlin 1987; for plane elasticity Greengard, Kropinski & Mayo 1996) therefore needs no
block compression and no sampling: series of clusters are shifted up a tree, translated between well separated clusters
and shifted down again, all in batches. Translations between clusters are D B D' with one matrix B of binomials, so that
a product consists mostly of matrix products.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..kernels import shape_functions
from ..system.influence_matrix import ElementSet, influence

#: Clusters are well separated if each further term of the series is at most this part of the one before.
RATE = 0.45
#: Number of elements in the smallest clusters.
LEAF = 12
#: Pairs of clusters translated at a time, so that the batch stays in the cache.
_BATCH = 1024


@dataclass(frozen=True, eq=False)
class Tree:
    """Binary tree of element clusters, each split across its longer side.

    order           (n,)   elements, those of a cluster next to one another
    first, last     (m,)   a cluster's elements are order[first:last]
    child           (m, 2) clusters, −1 for the smallest ones
    levels                 arrays of clusters, the root's first
    centre, radius  (m,)   complex and float: of a circle around the elements
    leaves          (k,)   the smallest clusters, in the order of their elements
    """

    order: np.ndarray
    first: np.ndarray
    last: np.ndarray
    child: np.ndarray
    levels: list[np.ndarray]
    centre: np.ndarray
    radius: np.ndarray
    leaves: np.ndarray

    @classmethod
    def over(cls, elements: ElementSet, size: int = LEAF) -> Tree:
        """The tree of ``elements`` with at most ``size`` of them in a leaf."""
        ends = np.stack([elements.start, elements.end])
        midpoint = ends.mean(axis=0)
        order = np.arange(elements.n)
        first, last, child, level, centre, radius = [0], [elements.n], [], [0], [], []
        k = 0
        while k < len(first):
            here = order[first[k] : last[k]]
            corner, opposite = ends[:, here].min(axis=(0, 1)), ends[:, here].max(axis=(0, 1))
            about = 0.5 * (corner + opposite)
            centre.append(complex(*about))
            radius.append(float(np.hypot(*(ends[:, here] - about).reshape(-1, 2).T).max()))
            if len(here) > size:
                half = len(here) // 2
                axis = int(np.argmax(np.ptp(midpoint[here], axis=0)))
                order[first[k] : last[k]] = here[np.argpartition(midpoint[here, axis], half)]
                child.append((len(first), len(first) + 1))
                level += [level[k] + 1] * 2
                first += [first[k], first[k] + half]
                last += [first[k] + half, last[k]]
            else:
                child.append((-1, -1))
            k += 1
        firsts, children, levels = np.array(first), np.array(child), np.array(level)
        leaves = np.flatnonzero(children[:, 0] < 0)
        return cls(
            order, firsts, np.array(last), children, [np.flatnonzero(levels == i) for i in range(levels.max() + 1)],
            np.array(centre), np.array(radius), leaves[np.argsort(firsts[leaves])],
        )  # fmt: skip

    def elements(self, cluster: int) -> np.ndarray:
        return self.order[self.first[cluster] : self.last[cluster]]


def pairs_of(targets: Tree, sources: Tree) -> tuple[np.ndarray, np.ndarray]:
    """(k, 2) far pairs of clusters (target, source) and (m, 2) near pairs of leaves; together they cover all pairs."""
    far, near = [], []
    t, s = np.zeros(1, int), np.zeros(1, int)
    while len(t):
        apart = np.abs(targets.centre[t] - sources.centre[s])
        r_t, r_s = targets.radius[t], sources.radius[s]
        separate = np.maximum(r_s + RATE * r_t, r_t + RATE * r_s) <= RATE * apart
        far.append(np.column_stack([t, s])[separate])
        t, s = t[~separate], s[~separate]
        t_leaf, s_leaf = targets.child[t, 0] < 0, sources.child[s, 0] < 0
        both = t_leaf & s_leaf
        near.append(np.column_stack([t, s])[both])
        split_t = ~t_leaf & (s_leaf | (targets.radius[t] >= sources.radius[s]))
        split_s = ~both & ~split_t
        t, s = (
            np.concatenate([targets.child[t[split_t]].ravel(), np.repeat(t[split_s], 2)]),
            np.concatenate([np.repeat(s[split_t], 2), sources.child[s[split_s]].ravel()]),
        )
    return _by_target(np.concatenate(far)), _by_target(np.concatenate(near))


def _by_target(pairs: np.ndarray) -> np.ndarray:
    """``pairs`` (k, 2) in the order of their targets."""
    return pairs[np.argsort(pairs[:, 0], kind="stable")]


@lru_cache
def _binomials(n: int) -> np.ndarray:
    """(n, n) binomial coefficients, k over m."""
    return np.array([[float(math.comb(k, m)) for m in range(n)] for k in range(n)])


def _powers(base: np.ndarray, n: int) -> np.ndarray:
    """(..., n) base⁰ … baseⁿ⁻¹."""
    base = np.asarray(base)
    out = np.empty((*base.shape, n), base.dtype)
    out[..., 0] = 1.0
    np.multiply.accumulate(np.broadcast_to(base[..., None], (*base.shape, n - 1)), axis=-1, out=out[..., 1:])
    return out


def _spread(base: np.ndarray, n: int, coefficients: np.ndarray) -> np.ndarray:
    """(..., n, n) with coefficients[k, j] base^(k−j) below the diagonal and zero above."""
    lag = np.subtract.outer(np.arange(n), np.arange(n))
    return np.where(lag >= 0, coefficients * _powers(base, n)[..., np.abs(lag)], 0.0)


def _outer_shift(delta: np.ndarray, ratio: np.ndarray, n: int) -> np.ndarray:
    """(m, n, n) shift of a Laurent series to another centre.

    ``delta`` is the old centre relative to the new one and ``ratio`` the old radius, both in units of the new radius.
    """
    choose = _binomials(n + 1)
    k, j = np.arange(n)[:, None], np.arange(n)[None, :]
    return _spread(delta, n, choose[k + 1, np.maximum(k - j, 0)]) * (ratio[:, None] ** (np.arange(n) + 2))[:, None, :]


class Compressed:
    """`influence` of ``sources`` on ``targets`` as an operator; see there for ``nu``, ``tol`` and the order of
    unknowns.

    ``error``: of a traction, relative to the largest of the far field. ``stored``: bytes, mostly of near blocks.
    """

    def __init__(self, targets: ElementSet, sources: ElementSet, nu: float, tol: float, error: float = 1e-10):
        self.targets, self.sources = targets, sources
        self.shape = (targets.n_unknowns, sources.n_unknowns)
        self.target_tree = Tree.over(targets)
        self.source_tree = self.target_tree if sources is targets else Tree.over(sources)
        self.far, self.near = pairs_of(self.target_tree, self.source_tree)
        # The derivatives need a few more powers than the potential.
        self.terms = math.ceil(math.log(error) / math.log(RATE)) + 6
        self._near_blocks(nu, tol)
        self._from_elements = self._outgoing(nu)
        self._to_elements = self._incoming()
        self._up = self._upward()
        self._down = self._downward()
        self._between = self._across()

    @property
    def stored(self) -> int:
        arrays = [block for _, _, block in self.blocks] + [self._from_elements, self._to_elements, *self._between]
        arrays += [matrix for part in (self._up, self._down) for *_, matrix in part]
        return sum(a.nbytes for a in arrays)

    # Construction ----------------------------------------------------------------------------------------------------

    def _near_blocks(self, nu: float, tol: float) -> None:
        """``blocks``: rows, columns (unknowns) and the dense matrix of every target leaf against all near leaves."""
        self.blocks: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        starts = np.flatnonzero(np.diff(self.near[:, 0])) + 1
        for group in np.split(self.near, starts) if len(self.near) else []:
            rows = np.sort(self.target_tree.elements(group[0, 0]))
            columns = np.sort(np.concatenate([self.source_tree.elements(s) for s in group[:, 1]]))
            matrix = self._near(rows, columns, nu, tol)
            self.blocks.append((self.targets.unknowns(rows), self.sources.unknowns(columns), matrix))

    def _near(self, rows: np.ndarray, columns: np.ndarray, nu: float, tol: float) -> np.ndarray:
        """The matrix between some targets and some sources."""
        return influence(self.targets.take(rows), self.sources.take(columns), nu, tol)

    def _outgoing(self, nu: float) -> np.ndarray:
        """(n, 4P, 2(p+1)) real: series of Φ and Ψ about the centre of the element's leaf from its nodal jumps."""
        s, n, tree = self.sources, self.terms, self.source_tree
        c, e = 0.5 * s.length, s.tangent @ np.array([1.0, 1j])
        midpoint = 0.5 * (s.start + s.end) @ np.array([1.0, 1j])
        j = np.arange(n)
        moments = shape_functions.moments()[:, j[:, None] + np.arange(s.per)] * -(j[:, None] + 1.0)
        nodal = np.einsum(
            "ejk,kn,en->ejn",
            moments[s.kind],
            shape_functions.to_monomials(s.family, s.order, shape_functions.ORDINARY),
            s._inverse_weight,
        )
        lead = (e[:, None] ** (j + 2)) / (4 * np.pi * (1 - nu) * c)[:, None]
        base = lead[:, :, None] * nodal
        phi = np.concatenate([-1j * base, base], axis=2)
        slip = np.concatenate([base, np.zeros_like(base)], axis=2)
        psi = (-0.5 * (j[:, None] + 2.0) * phi - 1j * slip) / (e**2)[:, None, None]
        leaf = _leaf_of(tree)
        centre, radius = tree.centre[leaf], tree.radius[leaf]
        delta = midpoint - centre
        _recentre_outer(phi, psi, -delta, c)
        shift = _outer_shift(delta / radius, c / radius, n)
        out = np.concatenate([shift @ phi, shift @ psi], axis=1)[tree.order]
        return np.ascontiguousarray(np.concatenate([out.real, out.imag], axis=1))

    def _incoming(self) -> np.ndarray:
        """(n, 2(p+1), 4P) real: tractions at the nodes from the leaf's series of Φ and Ψ."""
        t, n, tree = self.targets, self.terms, self.target_tree
        leaf = _leaf_of(tree)
        radius = tree.radius[leaf][:, None]
        off = t.nodes @ np.array([1.0, 1j]) - tree.centre[leaf][:, None]
        powers = _powers(off / radius, n)
        slope = np.zeros_like(powers)
        slope[..., 1:] = powers[..., :-1] * np.arange(1, n)
        turn = (t.tangent @ np.array([1.0, 1j]))[:, None, None] ** 2
        phi = -0.5 * (np.conj(off) / radius)[..., None] * slope * turn
        psi = powers * turn
        along = np.concatenate([phi.imag, psi.imag, phi.real, psi.real], axis=2)
        phi = phi - powers
        across = np.concatenate([phi.real, psi.real, -phi.imag, -psi.imag], axis=2)
        return np.ascontiguousarray(np.concatenate([along, across], axis=1)[tree.order])

    def _upward(self) -> list[tuple[np.ndarray, ...]]:
        """Level by level from the leaves: parents, children, and the matrices that shift the children's series."""
        tree, n = self.source_tree, self.terms
        out: list[tuple[np.ndarray, ...]] = []
        for level in tree.levels[-2::-1]:
            parent = level[tree.child[level, 0] >= 0]
            for k in (0, 1):
                child = tree.child[parent, k]
                delta = tree.centre[child] - tree.centre[parent]
                shift = _outer_shift(delta / tree.radius[parent], tree.radius[child] / tree.radius[parent], n)
                out.append((parent, child, delta, tree.radius[child], shift))
        return out

    def _downward(self) -> list[tuple[np.ndarray, ...]]:
        tree, n = self.target_tree, self.terms
        out: list[tuple[np.ndarray, ...]] = []
        m, k = np.arange(n)[:, None], np.arange(n)[None, :]
        choose = _binomials(n)[k, m]
        for level in tree.levels[:-1]:
            parent = np.repeat(level[tree.child[level, 0] >= 0], 2)
            child = tree.child[parent[::2]].ravel()
            delta = tree.centre[child] - tree.centre[parent]
            grown = np.swapaxes(_spread(delta / tree.radius[parent], n, choose.T), 1, 2)
            ratio = tree.radius[child] / tree.radius[parent]
            shift = grown * _powers(ratio, n)[:, :, None]
            out.append((parent, child, delta, tree.radius[parent], shift))
        return out

    def _across(self) -> tuple[np.ndarray, ...]:
        """R_s/d, −R_t/d and conj(d)/R_s of every far pair, d from source to target, and the binomials j+k+1 over k."""
        t, s = self.far.T
        n = self.terms
        d = self.target_tree.centre[t] - self.source_tree.centre[s]
        before = self.source_tree.radius[s] / d
        after = -self.target_tree.radius[t] / d
        k, j = np.arange(n)[:, None], np.arange(n)[None, :]
        choose = _binomials(2 * n)[k + j + 1, k]
        return before, after, np.conj(d) / self.source_tree.radius[s], np.ascontiguousarray(choose.T)

    # Product ---------------------------------------------------------------------------------------------------------

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        """Tractions (n,) of nodal jumps ``x`` (m,)."""
        out = self._far_field(x) if len(self.far) else np.zeros(self.shape[0])
        for rows, columns, matrix in self.blocks:
            out[rows] += matrix @ x[columns]
        return out

    def _far_field(self, x: np.ndarray) -> np.ndarray:
        n, source, target = self.terms, self.source_tree, self.target_tree
        width = 2 * self.sources.per
        own = np.matmul(self._from_elements, x.reshape(-1, width, 1)[source.order])[..., 0]
        own = np.add.reduceat(own, source.first[source.leaves], axis=0)
        outer = np.zeros((len(source.first), 2, n), complex)
        outer.real[source.leaves] = own[:, : 2 * n].reshape(-1, 2, n)
        outer.imag[source.leaves] = own[:, 2 * n :].reshape(-1, 2, n)
        degree = np.arange(2, n + 1)
        for parent, child, delta, radius, shift in self._up:
            series = outer[child]
            series[:, 1, 1:] -= (0.5 * np.conj(delta) / radius)[:, None] * degree * series[:, 0, :-1]
            outer[parent] += series @ np.swapaxes(shift, 1, 2)
        inner = np.zeros((len(target.first), 2, n), complex)
        self._translate(outer, inner)
        degree = np.arange(1, n)
        for parent, child, delta, radius, shift in self._down:
            series = inner[parent]
            series[:, 1, :-1] -= (0.5 * np.conj(delta) / radius)[:, None] * degree * series[:, 0, 1:]
            inner[child] += series @ np.swapaxes(shift, 1, 2)
        received = inner[_leaf_of(target)[target.order]].reshape(-1, 2 * n)
        received = np.concatenate([received.real, received.imag], axis=1)[..., None]
        out = np.empty((self.targets.n, 2 * self.targets.per))
        out[target.order] = np.matmul(self._to_elements, received)[..., 0]
        return out.ravel()

    def transposed_times(self, y: np.ndarray) -> np.ndarray:
        """(m,) transposed operator on ``y`` (n,): the steps of a product in reverse order, complex factors
        conjugated."""
        out = self._from_far(y) if len(self.far) else np.zeros(self.shape[1])
        for rows, columns, matrix in self.blocks:
            out[columns] += y[rows] @ matrix
        return out

    def _from_far(self, y: np.ndarray) -> np.ndarray:
        n, source, target = self.terms, self.source_tree, self.target_tree
        own = np.matmul(y.reshape(self.targets.n, 1, -1)[target.order], self._to_elements)[:, 0]
        own = np.add.reduceat(own, target.first[target.leaves], axis=0)
        inner = np.zeros((len(target.first), 2, n), complex)
        inner.real[target.leaves] = own[:, : 2 * n].reshape(-1, 2, n)
        inner.imag[target.leaves] = own[:, 2 * n :].reshape(-1, 2, n)
        degree = np.arange(1, n)
        for parent, child, delta, radius, shift in reversed(self._down):
            series = inner[child] @ np.conj(shift)
            series[:, 0, 1:] -= (0.5 * delta / radius)[:, None] * degree * series[:, 1, :-1]
            inner[parent[::2]] += series[::2] + series[1::2]
        outer = np.zeros((len(source.first), 2, n), complex)
        self._translate_back(inner, outer)
        degree = np.arange(2, n + 1)
        for parent, child, delta, radius, shift in reversed(self._up):
            series = outer[parent] @ np.conj(shift)
            series[:, 0, :-1] -= (0.5 * delta / radius)[:, None] * degree * series[:, 1, 1:]
            outer[child] += series
        sent = outer[_leaf_of(source)[source.order]].reshape(-1, 2 * n)
        sent = np.concatenate([sent.real, sent.imag], axis=1)[:, None]
        out = np.empty((self.sources.n, 2 * self.sources.per))
        out[source.order] = np.matmul(sent, self._from_elements)[:, 0]
        return out.ravel()

    def _translate_back(self, inner: np.ndarray, outer: np.ndarray) -> None:
        """`_translate`, transposed."""
        before, after, arm, choose = (np.conj(part) for part in self._between)
        n = self.terms
        degree = np.arange(2, n + 1)
        by_source = np.argsort(self.far[:, 1], kind="stable")
        for first in range(0, len(self.far), _BATCH):
            part = by_source[first : first + _BATCH]
            t, s = self.far[part].T
            moved = inner[t] * _powers(after[part], n)[:, None]
            parts = moved.view(float).reshape(-1, n, 2).swapaxes(1, 2).reshape(-1, n) @ choose.T
            parts = parts.reshape(-1, 2, 2, n)
            series = parts[:, :, 0] + 1j * parts[:, :, 1]
            series *= (before[part, None] ** 2 * _powers(before[part], n))[:, None]
            series[:, 0, :-1] += (0.5 * arm[part])[:, None] * degree * series[:, 1, 1:]
            starts = np.flatnonzero(np.r_[True, np.diff(s) > 0])
            outer[s[starts]] += np.add.reduceat(series, starts, axis=0)

    def _translate(self, outer: np.ndarray, inner: np.ndarray) -> None:
        """Add the ``outer`` series of far clusters to the ``inner`` series about their centres."""
        before, after, arm, choose = self._between
        n = self.terms
        degree = np.arange(2, n + 1)
        for first in range(0, len(self.far), _BATCH):
            part = slice(first, first + _BATCH)
            t, s = self.far[part].T
            series = outer[s]
            series[:, 1, 1:] += (0.5 * arm[part])[:, None] * degree * series[:, 0, :-1]
            series *= (before[part, None] ** 2 * _powers(before[part], n))[:, None]
            moved = (series.view(float).reshape(-1, n, 2).swapaxes(1, 2).reshape(-1, n) @ choose).reshape(-1, 2, 2, n)
            moved = (moved[:, :, 0] + 1j * moved[:, :, 1]) * _powers(after[part], n)[:, None]
            starts = np.flatnonzero(np.r_[True, np.diff(t) > 0])
            inner[t[starts]] += np.add.reduceat(moved, starts, axis=0)


def _leaf_of(tree: Tree) -> np.ndarray:
    """(n,) leaf of every element."""
    leaf = np.empty(len(tree.order), int)
    leaf[tree.order] = np.repeat(tree.leaves, tree.last[tree.leaves] - tree.first[tree.leaves])
    return leaf


def _recentre_outer(phi: np.ndarray, psi: np.ndarray, step: np.ndarray, radius: np.ndarray) -> None:
    """Move the centre of the Laurent series ``psi`` (m, n, k) by ``step`` (m,), in place."""
    degree = np.arange(2, phi.shape[1] + 1)[:, None]
    psi[:, 1:] += (0.5 * np.conj(step) / radius)[:, None, None] * degree * phi[:, :-1]
