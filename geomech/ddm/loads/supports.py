"""Supports: pieces of the boundary on which displacement is prescribed instead of traction, in one direction or both.

On a supported element the known displacement moves to the right-hand side, and the reaction becomes the unknown: a
Kelvin line force with the shape functions that displacement has elsewhere. Each support constrains one or both of a
pair of directions on every element, so that rollers may be inclined to the edge they are on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..mesh.edge_location import onto_boundary
from ..system.influence_matrix import ElementSet, influence, line_influence

#: A rigid motion counts as prevented if supports leave less than this part of it.
_PREVENTED = 1e-9
#: Graded layers at the end of a support in addition to the settings': inside an edge, where reactions vary like r^(−½),
#: and at a corner. At order 4 these leave 1e-5 and 2e-6 in K_I of a crack in the block; without them 6e-4 and 2e-5.
INSIDE_LAYERS, CORNER_LAYERS = 8, 4
_KINDS = ("both", "normal", "tangent", "x", "y")


@dataclass(frozen=True)
class Support:
    """A supported piece of a body's boundary.

    on     the number of an edge (the outline's first, then the holes'), or a straight piece of the boundary ((x, y),
           (x, y)), m
    hold   "both" (pinned), "normal" (a roller: free to slide along the edge), "tangent", "x", "y", or a direction (x,
           y)
    name   used in messages

    The displacement is zero unless `BodyLoad.displacements` prescribes it. Raises ValueError naming the support.
    """

    on: int | tuple[tuple[float, float], tuple[float, float]]
    hold: str | tuple[float, float] = "both"
    name: str = ""

    def __post_init__(self) -> None:
        called = f"support {self.name!r}" if self.name else "a support"
        if not isinstance(self.on, (int, np.integer)):
            piece = np.asarray(self.on, dtype=float)
            if piece.shape != (2, 2):
                raise ValueError(f"{called}: expected an edge number or a segment (2, 2), got shape {piece.shape}")
            if not np.isfinite(piece).all():
                raise ValueError(f"{called}: not finite")
            object.__setattr__(self, "on", tuple(map(tuple, piece.tolist())))
        if isinstance(self.hold, str):
            if self.hold not in _KINDS:
                raise ValueError(f"{called}: hold must be one of {', '.join(_KINDS)} or a direction, got {self.hold!r}")
            return
        way = np.asarray(self.hold, dtype=float)
        if way.shape != (2,) or not np.isfinite(way).all() or not np.hypot(*way) > 0:
            raise ValueError(
                f"{called}: a supported direction is two numbers that are not both zero, got {self.hold!r}"
            )
        object.__setattr__(self, "hold", tuple((way / np.hypot(*way)).tolist()))


def place(supports: Sequence[Support], edges: np.ndarray, extent: float) -> np.ndarray:
    """(k, 2, 2) location of the ``supports``, each along the one of ``edges`` (m, 2, 2) on which it lies.

    Raises ValueError naming the support: no such edge, off the boundary, no length, overlap.
    """
    out = np.empty((len(supports), 2, 2))
    on = np.empty(len(supports), int)
    for k, support in enumerate(supports):
        if not isinstance(support, Support):
            raise TypeError(f"support {k}: expected a Support, got {support!r}")
        name = called(supports, k)
        if isinstance(support.on, tuple):
            out[k], _, on[k] = onto_boundary(edges, np.array(support.on), name, extent)
        else:
            if not 0 <= support.on < len(edges):
                raise ValueError(f"{name}: there is no edge {support.on}, the body has {len(edges)}")
            out[k], on[k] = edges[support.on], support.on
        for m in range(k):
            if on[m] == on[k]:
                d = edges[on[k], 1] - edges[on[k], 0]
                spans = np.sort((out[[m, k]] - edges[on[k], 0]) @ d / (d @ d), axis=1)
                if (spans[:, 1].min() - spans[:, 0].max()) * np.hypot(*d) > 1e-9 * extent:
                    raise ValueError(f"{called(supports, m)} and {name} overlap")
    return out


def marks(
    supports: Sequence[Support], placed: np.ndarray, loops: Sequence[np.ndarray], layers: int
) -> list[tuple[np.ndarray, int]]:
    """Boundary points that must be nodes, with their graded layers: the ends of the ``placed`` supports on ``loops``.

    Reactions are singular like r^(−½) at an end inside an edge. At a corner they are singular between a pinned and a
    free edge, but not at a right angle between a roller and a free edge (mirrored, the corner vanishes) or between two
    supported edges.
    """
    tiny = 1e-9 * np.ptp(loops[0], axis=0).max()
    before = np.concatenate([np.roll(loop, 1, axis=0) for loop in loops])
    after = np.concatenate([np.roll(loop, -1, axis=0) for loop in loops])
    corners = np.concatenate(loops)
    out, ends = [], placed.reshape(-1, 2)
    for k, end in enumerate(ends):
        more = INSIDE_LAYERS
        corner = np.hypot(*(corners - end).T) <= tiny
        if corner.any():
            at = int(np.argmax(corner))
            u, v = after[at] - corners[at], before[at] - corners[at]
            turn = np.arctan2(u[0] * v[1] - u[1] * v[0], u @ v) % (2 * np.pi)
            others = np.delete(ends, k, axis=0)
            met = (np.hypot(*(others - end).T) <= tiny).any()
            rolls = supports[k // 2].hold != "both" and turn < 0.55 * np.pi
            if met or rolls:
                continue
            more = CORNER_LAYERS
        out.append((end, layers + more if layers else 0))
    return out


def called(supports: Sequence[Support], k: int) -> str:
    """Name of support ``k`` in messages."""
    return f"support {supports[k].name!r}" if supports[k].name else f"support {k}"


class Holds:
    """Supported elements of a boundary and their supported directions.

    elements    (h,)      numbers of supported elements
    support     (h,)      the support of each
    directions  (h, 2, 2) two unit vectors, local (along, normal) components
    held        (h, 2)    bool, in which of the two the element is supported
    sources     the supported elements

    Unknown reactions are multiplied by their element's length, so that their columns have the magnitude of those of
    displacements.
    """

    def __init__(self, boundary: ElementSet, supports: Sequence[Support], placed: np.ndarray, extent: float):
        self.boundary = boundary
        of = np.full(boundary.n, -1)
        midpoint = 0.5 * (boundary.start + boundary.end)
        for k, (a, b) in enumerate(placed):
            d = b - a
            rel = midpoint - a
            s = rel @ d / (d @ d)
            off = np.abs(rel[:, 0] * d[1] - rel[:, 1] * d[0]) / np.hypot(*d)
            along = np.abs(boundary.tangent @ d) > 0.999 * np.hypot(*d)
            of[(s > 0) & (s < 1) & (off <= 1e-6 * extent) & along] = k
        self.elements = np.flatnonzero(of >= 0)
        self.support = of[self.elements]
        self.sources = boundary.take(self.elements)
        self.number = np.full(boundary.n, -1)
        self.number[self.elements] = np.arange(len(self.elements))
        self.directions = np.tile(np.eye(2), (len(self.elements), 1, 1))
        self.supported = np.zeros((len(self.elements), 2), bool)
        axes = {"x": (1.0, 0.0), "y": (0.0, 1.0)}
        for k, support in enumerate(supports):
            here = self.support == k
            if support.hold in ("both", "normal", "tangent"):
                self.supported[here] = (support.hold != "normal", support.hold != "tangent")
                continue
            direction = np.array(axes[support.hold] if isinstance(support.hold, str) else support.hold)
            along, across = self.sources.tangent[here] @ direction, self.sources.normal[here] @ direction
            self.directions[here] = np.stack(
                [np.stack([along, across], axis=1), np.stack([-across, along], axis=1)], axis=1
            )
            self.supported[here] = (True, False)

    @property
    def unknowns(self) -> np.ndarray:
        """(n_unknowns,) bool: which unknowns of the boundary are reactions."""
        b = self.boundary
        out = np.zeros((b.n, 2, b.per), bool)
        out[self.elements] = self.supported[:, :, None]
        return out.ravel()

    def turned(self, local: np.ndarray) -> np.ndarray:
        """``local`` values (n_unknowns, …) of the boundary in the supported elements' own directions."""
        return self._turn(local, self.directions)

    def local(self, turned: np.ndarray) -> np.ndarray:
        """The inverse of `turned`."""
        return self._turn(turned, self.directions.transpose(0, 2, 1))

    def _turn(self, values: np.ndarray, by: np.ndarray) -> np.ndarray:
        b = self.boundary
        out = values.reshape(b.n, 2, b.per, -1).copy()
        out[self.elements] = np.einsum("hjc,hcn...->hjn...", by, out[self.elements])
        return out.reshape(values.shape)

    def swapped(
        self, targets: ElementSet, elements: np.ndarray, matrix: np.ndarray, nu: float, tol: float
    ) -> np.ndarray:
        """The columns ``matrix`` of displacement jumps on boundary ``elements``, with reaction columns where
        supported."""
        at = self.number[elements]
        which = np.flatnonzero(at >= 0)
        if not len(which) or not len(matrix):
            return matrix
        force = line_influence(targets, self.sources.take(at[which]), nu, tol, -1.0)
        self._swap(matrix, force, which, at[which])
        return matrix

    def mixed(self, jumps: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Columns (r, n_unknowns) of unit ``jumps`` on the boundary, with those of unit ``forces`` (r, h_unknowns)
        where supported."""
        out = np.asfortranarray(jumps).copy(order="F")
        self._swap(out, np.asfortranarray(forces), self.elements, np.arange(len(self.elements)))
        return out

    def _swap(self, matrix: np.ndarray, force: np.ndarray, which: np.ndarray, at: np.ndarray) -> None:
        # Column by column, in memory order.
        rows, per = len(matrix), self.boundary.per
        columns = matrix.T.reshape(-1, 2, per, rows)
        force = force.T.reshape(len(which), 2, per, rows) / self.sources.length[at][:, None, None, None]
        pair = np.einsum("hjc,fhcnr->fhjnr", self.directions[at], np.stack([columns[which], force]))
        columns[which] = np.where(self.supported[at][:, :, None, None], pair[1], pair[0])

    def known(self, targets: ElementSet, nu: float, tol: float) -> np.ndarray:
        """(targets.n_unknowns, h_unknowns) traction on ``targets`` from displacement of the supported elements, local."""
        return influence(targets, self.sources, nu, tol)

    def imposed(self, displacement: np.ndarray) -> np.ndarray:
        """(h_unknowns,) the prescribed part of ``displacement`` (h, p+1, 2) at the supported elements' nodes, local
        components."""
        s = self.sources
        local = np.stack([np.einsum("hnc,hc->hn", displacement, axis) for axis in (s.tangent, s.normal)], axis=1)
        turned = np.einsum("hjc,hcn->hjn", self.directions, local) * self.supported[:, :, None]
        return np.einsum("hjc,hjn->hcn", self.directions, turned).ravel()

    def split(self, x: np.ndarray, imposed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Split unknowns ``x`` (n_unknowns,) into displacement of the whole boundary, local, and reactions
        (h_unknowns,)."""
        b = self.boundary
        rows = x.reshape(b.n, 2, b.per)
        supported_rows, free = rows[self.elements], rows.copy()
        free[self.elements] = np.einsum("hjc,hjn->hcn", self.directions, supported_rows * ~self.supported[:, :, None])
        free[self.elements] += imposed.reshape(supported_rows.shape)
        reaction = np.einsum("hjc,hjn->hcn", self.directions, supported_rows * self.supported[:, :, None])
        reaction /= self.sources.length[:, None, None]
        return free.ravel(), reaction.ravel()

    def joined(self, displacement: np.ndarray, reactions: np.ndarray) -> np.ndarray:
        """(n_unknowns,) transpose of `split`: from ``reactions`` where the boundary is supported, else from
        ``displacement``."""
        b = self.boundary
        out = self.turned(displacement).reshape(b.n, 2, b.per)
        own = np.einsum("hjc,hcn->hjn", self.directions, reactions.reshape(-1, 2, b.per))
        own /= self.sources.length[:, None, None]
        out[self.elements] = np.where(self.supported[:, :, None], own, out[self.elements])
        return out.ravel()

    def free_motions(self, modes: np.ndarray) -> np.ndarray:
        """(3, k) combinations of the rigid ``modes`` (n_unknowns, 3), local, that no support resists."""
        supported = self.turned(modes)[self.unknowns]
        # Each row is weighted by the root of the length it represents, so that the measure does not depend on the mesh.
        b = self.boundary
        share = np.broadcast_to(b.quadrature[:, None, :], (b.n, 2, b.per)).ravel()[self.unknowns]
        _, size, ways = np.linalg.svd(np.sqrt(np.abs(share) / b.length.sum())[:, None] * supported)
        size = np.concatenate([size, np.zeros(3 - len(size))])
        return ways[size <= _PREVENTED].T


def values_at(
    value: np.ndarray | Callable[[np.ndarray], np.ndarray] | None, segment: np.ndarray, points: np.ndarray, name: str
) -> np.ndarray:
    """(n, 2) values at ``points`` (n, 2) of a constant (2,), a pair (2, 2) linear along ``segment``, or a function.

    None is zero. Raises ValueError with ``name``.
    """
    if value is None:
        return np.zeros((len(points), 2))
    if callable(value):
        out = np.asarray(value(points), dtype=float)
        if out.shape != points.shape:
            raise ValueError(f"{name}: the function returned shape {out.shape} for points {points.shape}")
    else:
        ends = np.asarray(value, dtype=float)
        if ends.shape not in ((2,), (2, 2)):
            raise ValueError(f"{name}: expected (2,), (2, 2) or a function, got shape {ends.shape}")
        d = segment[1] - segment[0]
        s = ((points - segment[0]) @ d / (d @ d))[:, None]
        out = np.broadcast_to(ends, points.shape) if ends.ndim == 1 else (1 - s) * ends[0] + s * ends[1]
    if not np.isfinite(out).all():
        raise ValueError(f"{name}: not finite")
    return out
