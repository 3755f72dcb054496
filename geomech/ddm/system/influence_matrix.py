"""Influence matrices between sets of elements, in nodal unknowns, and their reuse when only some elements are new."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np

from ..kernels import full_plane, shape_functions
from ..kernels.full_plane import Elements, Kernel
from ..mesh.half_plane import HalfPlane

#: Element–point pairs (some 30 ns each) that make another thread worthwhile.
PAIRS_PER_THREAD = 8000
#: Number of processors that this process may use.
THREADS = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
_pool: ThreadPoolExecutor | None = None


def _spread(n: int, pairs: int, work: Callable[[int, int], None]) -> None:
    """Run ``work(first, last)`` over range(n), in chunks on several threads if ``pairs`` is large enough."""
    global _pool
    chunks = min(THREADS, pairs // PAIRS_PER_THREAD)
    if chunks < 2:
        work(0, n)
        return
    if _pool is None:
        _pool = ThreadPoolExecutor(THREADS, thread_name_prefix="geomech-ddm")
    bounds = np.linspace(0, n, chunks + 1).astype(int)
    # list() raises the exceptions of the threads.
    list(_pool.map(work, bounds[:-1].tolist(), bounds[1:].tolist()))


@dataclass(frozen=True, eq=False)
class ElementSet:
    """Straight elements of one order and node family.

        start, end   (n, 2)   m
        kind         (n,)     see `shape_functions`
        source       (n,)     the outline edge or crack segment that each lies on
        half_plane            the half-plane that they are in; None in the infinite plane

    Unknowns are ordered by element, component (along the tangent, along the normal to its left) and node, 2(p+1) per
    element; so are the rows of the tractions collocated on them.
    """

    start: np.ndarray
    end: np.ndarray
    kind: np.ndarray
    source: np.ndarray
    order: int
    family: str
    half_plane: HalfPlane | None = None

    @property
    def n(self) -> int:
        return len(self.start)

    @property
    def per(self) -> int:
        """Nodes of an element."""
        return self.order + 1

    @property
    def n_unknowns(self) -> int:
        return 2 * self.per * self.n

    @cached_property
    def length(self) -> np.ndarray:
        return np.hypot(*(self.end - self.start).T)

    @cached_property
    def tangent(self) -> np.ndarray:
        return (self.end - self.start) / self.length[:, None]

    @cached_property
    def normal(self) -> np.ndarray:
        return np.column_stack([-self.tangent[:, 1], self.tangent[:, 0]])

    @cached_property
    def nodes(self) -> np.ndarray:
        """(n, p+1, 2) collocation points."""
        return self.at(shape_functions.nodes(self.family, self.order))

    def at(self, t: np.ndarray) -> np.ndarray:
        """(n, len(t), 2) points at t ∈ [−1, 1] of every element, the ends exactly."""
        s = 0.5 * (1 + np.asarray(t))[None, :, None]
        return (1 - s) * self.start[:, None] + s * self.end[:, None]

    @cached_property
    def keys(self) -> list[Any]:
        """Keys that are equal for bitwise identical elements."""
        rows = np.column_stack([self.start, self.end, self.kind])
        return rows.view(np.dtype((np.void, 8 * rows.shape[1]))).ravel().tolist()

    @cached_property
    def index_of(self) -> dict[bytes, int]:
        return {key: k for k, key in enumerate(self.keys)}

    @cached_property
    def _at_place(self) -> dict[bytes, int]:
        return {key[:-8]: k for k, key in enumerate(self.keys)}

    def found_in(self, other: ElementSet | None) -> np.ndarray:
        """(n,) number in ``other`` of the same element, −1 where there is none."""
        if other is None or (other.order, other.family) != (self.order, self.family):
            return np.full(self.n, -1)
        if other is self:
            return np.arange(self.n)
        return np.array([other.index_of.get(key, -1) for key in self.keys], dtype=int).reshape(self.n)

    def same_place_in(self, other: ElementSet | None, found: np.ndarray) -> np.ndarray:
        """``found`` (n,), the result of `found_in`, completed by elements of ``other`` at the same place but of another
        kind: tractions on them are collocated at the same points."""
        out = found.copy()
        if other is not None and (other.order, other.family) == (self.order, self.family):
            for k in np.flatnonzero(found < 0).tolist():
                out[k] = other._at_place.get(self.keys[k][:-8], -1)
        return out

    @cached_property
    def samples(self) -> tuple[np.ndarray, np.ndarray]:
        """(n, p+3, 2) sample points of each element, its ends and between them its collocation points, and (n, p+1,
        p+3) the shape functions there: nodal values times these are the values at the points."""
        t = np.concatenate([[-1.0], shape_functions.nodes(self.family, self.order), [1.0]])
        table = np.array([shape_functions.at(self.family, self.order, kind, t).T for kind in range(4)])
        return self.at(t), table[self.kind]

    def take(self, which: np.ndarray) -> ElementSet:
        if len(which) == self.n and (which == np.arange(self.n)).all():
            return self
        out = ElementSet(
            self.start[which],
            self.end[which],
            self.kind[which],
            self.source[which],
            self.order,
            self.family,
            self.half_plane,
        )
        # Cached properties are taken along.
        known = vars(self)
        vars(out).update({name: known[name][which] for name in ("length", "tangent", "nodes") if name in known})
        return out

    def unknowns(self, elements: np.ndarray) -> np.ndarray:
        """Indices of the unknowns (and rows) of ``elements``."""
        return unknowns_of(np.asarray(elements), 2 * self.per)

    @cached_property
    def _inverse_weight(self) -> np.ndarray:
        """(n, p+1) reciprocal of the tip weight at the nodes."""
        t = shape_functions.nodes(self.family, self.order)
        table = 1.0 / np.array([shape_functions.weight(kind, t) for kind in range(4)])
        return table[self.kind]

    def densities(self, values: np.ndarray) -> np.ndarray:
        """(n, 2, p+1) monomial coefficients of nodal ``values`` (n_unknowns,)."""
        scaled = values.reshape(self.n, 2, self.per) * self._inverse_weight[:, None, :]
        return np.ascontiguousarray(
            scaled @ shape_functions.to_monomials(self.family, self.order, shape_functions.ORDINARY).T
        )

    @cached_property
    def quadrature(self) -> np.ndarray:
        """(n, p+1) integrals of the nodal shape functions, m."""
        table = np.array([shape_functions.integrals(self.family, self.order, kind) for kind in range(4)])
        return 0.5 * self.length[:, None] * table[self.kind]


def unknowns_of(elements: np.ndarray, width: int) -> np.ndarray:
    """Indices of the unknowns of ``elements`` (k,), ``width`` per element."""
    return (elements[:, None] * width + np.arange(width)).ravel()


@lru_cache
def _to_nodal(family: str, order: int) -> np.ndarray:
    """(4, p+1, p+1) matrices from nodal values to monomial coefficients, one per kind of element."""
    return np.stack([shape_functions.to_monomials(family, order, kind) for kind in range(4)])


class _Points(NamedTuple):
    """Points at which tractions are computed: ``at`` (n per, 2) m, ``per`` of them per element, on lines with the
    ``tangents`` (n per, 2)."""

    at: np.ndarray
    tangents: np.ndarray
    per: int

    @classmethod
    def of(cls, points: np.ndarray, tangents: np.ndarray) -> _Points:
        """The ``points`` (n, per, 2) on elements with ``tangents`` (n, 2)."""
        per = points.shape[1]
        return cls(points.reshape(-1, 2), np.repeat(tangents, per, axis=0), per)


def elements_of(start: np.ndarray, end: np.ndarray, kind: np.ndarray) -> Elements:
    """Elements in the form that the kernels take."""
    return Elements(np.ascontiguousarray(start), np.ascontiguousarray(end), np.ascontiguousarray(kind, dtype=np.int64))


def influence(targets: ElementSet, sources: ElementSet, nu: float, tol: float) -> np.ndarray:
    """(targets.n_unknowns, sources.n_unknowns), column-major: traction on the left side of the targets (tangential,
    normal) at their collocation points, from unit nodal jumps times 2μ. Each entry depends on its two elements alone,
    to the bit."""
    return _between(targets, sources, Kernel(nu, tol, 1.0, False))


def image_influence(targets: ElementSet, sources: ElementSet, nu: float, tol: float) -> np.ndarray:
    """Contribution of the free surface of the half-plane to `influence`."""
    nodal, out = _to_nodal(sources.family, sources.order), np.zeros((sources.n_unknowns, targets.n_unknowns))
    if out.size and targets.half_plane is not None:
        points, elements = _Points.of(targets.nodes, targets.tangent), elements_of(*_ends(sources))
        work = _images(targets.half_plane, points, elements, sources.order, Kernel(nu, tol, 1.0, False), nodal, out)
        _spread(len(points.at), len(points.at) * sources.n, work)
    return out.T


def line_influence(targets: ElementSet, sources: ElementSet, nu: float, tol: float, side: float) -> np.ndarray:
    """As `influence`, from unit nodal line forces (per length) on ordinary ``sources``; points on a source are taken on
    its ``side`` (±1)."""
    return _between(targets, sources, Kernel(nu, tol, side, True))


def _ends(elements: ElementSet) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return elements.start, elements.end, elements.kind


def _between(targets: ElementSet, sources: ElementSet, kernel: Kernel) -> np.ndarray:
    if not targets.n or not sources.n:
        return np.empty((targets.n_unknowns, sources.n_unknowns), order="F")
    points, nodal = _Points.of(targets.nodes, targets.tangent), _to_nodal(sources.family, sources.order)
    return _tractions(points, elements_of(*_ends(sources)), sources.order, kernel, nodal, targets.half_plane)


def line_forces(
    targets: ElementSet, start: np.ndarray, end: np.ndarray, degree: int, nu: float, tol: float, side: float
) -> np.ndarray:
    """(targets.n_unknowns, m, 2, degree+1) traction from line forces t^k along (component 0) and across (component 1)
    straight segments: Kelvin's solution integrated in closed form. Points on a segment are taken on its ``side``
    (±1)."""
    points, kernel = _Points.of(targets.nodes, targets.tangent), Kernel(nu, tol, side, True)
    return _line_forces(points, start, end, degree, kernel, targets.half_plane)


def _line_forces(
    points: _Points, start: np.ndarray, end: np.ndarray, degree: int, kernel: Kernel, half_plane: HalfPlane | None
) -> np.ndarray:
    kind, unit = np.zeros(len(start), np.int64), np.broadcast_to(np.eye(degree + 1), (4, degree + 1, degree + 1))
    unit = np.ascontiguousarray(unit)
    out = _tractions(points, elements_of(start, end, kind), degree, kernel, unit, half_plane)
    return out.reshape(2 * len(points.at), len(start), 2, degree + 1)


#: Distance from an element's end, relative to half its length, within which the end of a line force needs no
#: projection: there the singularities of tractions and of displacement jumps cancel point by point.
_AT_END = 0.01


@lru_cache(maxsize=1)
def _clustered() -> tuple[np.ndarray, np.ndarray]:
    """Points in (0, 1) and weights (that sum to 2) of a quadrature for integrands with logarithms at both ends."""
    x, q = np.polynomial.legendre.leggauss(14)
    # The substitution s²(3 − 2s) makes the integrand smooth there.
    s = 0.5 * (1 + x)
    return s * s * (3 - 2 * s), 3 * s * (1 - s) * q


def project_jumps(unit: np.ndarray, targets: ElementSet, start, end, nu: float, tol: float, side: float) -> None:
    """Replace in ``unit`` (see `line_forces`), in place, the nodal tractions of elements on which a line force ends by
    those of the polynomial with the same moments.

    At the end of a line force the traction jumps and has a logarithm. Sampled at nodes, the jump would move to a node
    and change the load's resultant (error of K_I in one case: 4 %, with moments 0.03 %). With the moments kept, the
    error is confined to the element's surroundings.
    """
    t, n, c, kernel = targets.tangent, targets.normal, 0.5 * targets.length, Kernel(nu, tol, side, True)
    midpoint = 0.5 * (targets.start + targets.end)
    rows = unit.reshape(targets.n, 2, targets.per, *unit.shape[1:])
    clustered, q = _clustered()
    degrees = np.arange(targets.per)
    at_nodes = np.polynomial.legendre.legvander(shape_functions.nodes(targets.family, targets.order), targets.order)
    for m, (a, b) in enumerate(zip(start, end)):
        local = [np.stack([np.sum((p - midpoint) * t, axis=1), np.sum((p - midpoint) * n, axis=1)]) / c for p in (a, b)]
        line = (np.abs(local[0][1]) * c <= 2 * tol) & (np.abs(local[1][1]) * c <= 2 * tol)
        ends = np.stack([local[0][0], local[1][0]])
        near = np.abs(ends) < 1 - _AT_END
        for e in np.flatnonzero(line & near.any(axis=0)):
            cuts = np.unique(np.concatenate([[-1.0, 1.0], ends[near[:, e], e]]))
            u = np.concatenate([lo + (hi - lo) * clustered for lo, hi in pairwise(cuts)])
            w = np.concatenate([(hi - lo) * q for lo, hi in pairwise(cuts)])
            points = (midpoint[e] + c[e] * u[:, None] * t[e])[None]
            at = _Points.of(points, t[e : e + 1])
            values = _line_forces(at, a[None], b[None], unit.shape[3] - 1, kernel, targets.half_plane)
            values = values.reshape(2, len(u), 2, -1)
            legendre = np.polynomial.legendre.legvander(u, targets.order) * w[:, None] * (degrees + 0.5)
            rows[e, :, :, m] = np.einsum("jk,uk,cuxd->cjxd", at_nodes, legendre, values)


def project_total(
    rows: np.ndarray, targets: ElementSet, start, end, density: np.ndarray, nu: float, tol: float, side: float
) -> None:
    """`project_jumps` for the traction ``rows`` (n_unknowns,) of the sum of line forces with monomial ``density`` (m,
    2, p+1), in place. An element inside which one of them ends gets the moments of the sum, in which the singularities
    of adjoining pieces cancel."""
    values = rows.reshape(targets.n, 2, targets.per)
    clustered, q = _clustered()
    ends = np.unique(np.concatenate([start, end]), axis=0)
    at_nodes = np.polynomial.legendre.legvander(shape_functions.nodes(targets.family, targets.order), targets.order)
    for e in range(targets.n):
        c = 0.5 * targets.length[e]
        rel = (ends - 0.5 * (targets.start[e] + targets.end[e])) / c
        along, across = rel @ targets.tangent[e], rel @ targets.normal[e]
        inside = along[(np.abs(across) * c <= 2 * tol) & (np.abs(along) < 1 - _AT_END)]
        if not len(inside):
            continue
        cuts = np.unique(np.concatenate([[-1.0, 1.0], inside]))
        u = np.concatenate([lo + (hi - lo) * clustered for lo, hi in pairwise(cuts)])
        w = np.concatenate([(hi - lo) * q for lo, hi in pairwise(cuts)])
        points = (0.5 * (targets.start[e] + targets.end[e]) + c * u[:, None] * targets.tangent[e])[None]
        at, kernel = _Points.of(points, targets.tangent[e : e + 1]), Kernel(nu, tol, side, True)
        unit = _line_forces(at, start, end, density.shape[2] - 1, kernel, targets.half_plane)
        total = (unit.reshape(2 * len(u), -1) @ density.ravel()).reshape(2, len(u))
        legendre = np.polynomial.legendre.legvander(u, targets.order) * w[:, None] * (np.arange(targets.per) + 0.5)
        values[e] = total @ legendre @ at_nodes.T


def _tractions(
    points: _Points, elements: Elements, order: int, kernel: Kernel, nodal: np.ndarray, half_plane: HalfPlane | None
) -> np.ndarray:
    """(2 n per, 2 (p+1) m) tractions at the ``points``, column-major."""
    n, m = len(points.at), len(elements.start)
    out = np.empty((2 * (order + 1) * m, 2 * n))
    if not out.size:
        return out.T
    at, along = full_plane.lanes_of(points.at), full_plane.lanes_of(points.tangents)
    table, flat = shape_functions.moments(), out.reshape(-1)

    def work(first, last):
        full_plane.tractions(at, along, points.per, first, last, elements, order, kernel, table, nodal, flat)

    if half_plane is not None:
        plane = work
        images = _images(half_plane, points, elements, order, kernel, nodal, out)

        def work(first, last):
            plane(first, last)
            images(first, last)

    _spread(n, n * m, work)
    return out.T


def _images(
    half_plane: HalfPlane, points: _Points, elements: Elements, order: int, kernel: Kernel, nodal: np.ndarray,
    out: np.ndarray,
) -> Callable[[int, int], None]:  # fmt: skip
    """A function (first, last) that adds to ``out`` the tractions due to the free surface at these points."""
    from ..kernels import half_plane_images

    at = full_plane.lanes_of(_mirrored(half_plane.frame(points.at)))
    along = full_plane.lanes_of(half_plane.turned(points.tangents))
    framed = _framed(half_plane, elements)
    table, flat = shape_functions.moments(), out.reshape(-1)

    def work(first, last):
        half_plane_images.tractions(at, along, points.per, first, last, framed, order, kernel, table, nodal, flat)

    return work


def _framed(half_plane: HalfPlane, elements: Elements) -> Elements:
    """The ``elements`` in the frame of the free surface."""
    return elements_of(half_plane.frame(elements.start), half_plane.frame(elements.end), elements.kind)


def _mirrored(in_frame: np.ndarray) -> np.ndarray:
    """(n, 2) mirror images of points in the frame of a free surface; the images of points on the surface lie
    outside."""
    return np.column_stack([in_frame[:, 0], np.abs(in_frame[:, 1])])


def add_fields(
    points: np.ndarray, elements: Elements, density: np.ndarray, kernel: Kernel, stress: np.ndarray, shift: np.ndarray,
    half_plane: HalfPlane | None = None,
) -> None:  # fmt: skip
    """Add the stress (n, 3) and 2μ times the displacement (n, 2) of ``elements`` with monomial ``density`` (m, 2,
    p+1)."""
    if not len(points) or not len(elements.start):
        return
    flat, elements = full_plane.lanes_of(points), elements_of(*elements)
    density = np.ascontiguousarray(density)
    order, table, out = density.shape[2] - 1, shape_functions.moments(), np.zeros((5, len(points)))

    def work(first, last):
        full_plane.fields(flat, first, last, elements, order, density, kernel, table, out)

    _spread(len(points), len(points) * len(elements.start), work)
    stress += out[:3].T
    shift += out[3:].T
    if half_plane is None:
        return
    from ..kernels import half_plane_images

    images = full_plane.lanes_of(_mirrored(half_plane.frame(points)))
    framed, out = _framed(half_plane, elements), np.zeros((5, len(points)))

    def add_images(first, last):
        half_plane_images.fields(images, first, last, framed, order, density, kernel, table, out)

    _spread(len(points), len(points) * len(elements.start), add_images)
    stress += half_plane.stress_of(out[:3].T)
    shift += out[3:].T @ half_plane.turn


def reuse(
    old: np.ndarray | None,
    rows: np.ndarray,
    columns: np.ndarray,
    row_set,
    column_set,
    compute,
    order: Literal["C", "F"] = "F",
) -> np.ndarray:
    """A matrix, parts of which are copied from ``old``: ``rows`` and ``columns`` (per element of ``row_set`` and
    ``column_set``) are the old element numbers or −1; ``compute(row_elements, column_elements)`` computes new blocks.
    ``order``: row-major ("C") or column-major ("F"), as most of it is copied."""
    if old is None or (rows < 0).all() or (columns < 0).all():
        return compute(np.arange(row_set.n), np.arange(column_set.n))
    unchanged = np.array_equal(rows, np.arange(row_set.n)) and np.array_equal(columns, np.arange(column_set.n))
    if unchanged and old.shape == (row_set.n_unknowns, column_set.n_unknowns):
        return old
    kept_r, new_r = np.flatnonzero(rows >= 0), np.flatnonzero(rows < 0)
    new_c = np.flatnonzero(columns < 0)
    out = np.empty((row_set.n_unknowns, column_set.n_unknowns), order=order)
    copy_blocks(old, out, rows, columns, 2 * row_set.per, 2 * column_set.per)
    if len(new_r):
        out[row_set.unknowns(new_r)] = compute(new_r, np.arange(column_set.n))
    if len(new_c):
        out[np.ix_(row_set.unknowns(kept_r), column_set.unknowns(new_c))] = compute(kept_r, new_c)
    return out


def copy_blocks(old: np.ndarray, out: np.ndarray, rows: np.ndarray, columns: np.ndarray, high: int, wide: int) -> None:
    """Copy from ``old`` to ``out`` the blocks ``high`` × ``wide`` whose old numbers ``rows`` and ``columns`` are not
    −1."""
    # Elements mostly keep their order: copying a few slices is several times faster than fancy indexing.
    column_runs = list(_runs(columns))
    for r, was_r, m in _runs(rows):
        for k, was_k, n in column_runs:
            out[r * high : (r + m) * high, k * wide : (k + n) * wide] = old[
                was_r * high : (was_r + m) * high, was_k * wide : (was_k + n) * wide
            ]


def _runs(old_numbers: np.ndarray):
    """(first, first old number, length) of runs of consecutive old numbers."""
    kept = np.flatnonzero(old_numbers >= 0)
    breaks = np.flatnonzero((np.diff(kept) != 1) | (np.diff(old_numbers[kept]) != 1)) + 1
    for run in np.split(kept, breaks):
        if len(run):
            yield int(run[0]), int(old_numbers[run[0]]), len(run)
