"""The crack network: straight segments inside blocks, as a planar graph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

#: With ``join``, points nearer to each other than this, over the extent of the network, are one node.
SAME_POINT = 1e-9


@dataclass(frozen=True, eq=False)
class Cracks:
    """Cracks as a planar graph in the reference coordinates of their blocks.

        nodes         (n_nodes, 2)      m
        segments      (n_segments, 2)   node indices, start and end; the segments of a crack are consecutive
        crack         (n_segments,)     the crack each segment belongs to, from 0
        block         (n_segments,)     the block it lies in
        birth_cycle   (n_segments,)     0 for what the scene drew, else the cycle in which it grew
        aperture      (n_segments,)     initial aperture, m: 0 is a closed crack, inf a slot that never closes
        surface       (n_nodes,)        True where a node lies on its block's boundary (a crack mouth)
        names         tuple of str      one name per crack
        law           (n_segments,)     index of the law of its faces among the solver's ``face_laws``; default zeros

    A node that ends one segment only and is not on the surface is a *tip*. A node shared by three or more segments,
    or by two cracks, is a junction.
    """

    nodes: np.ndarray
    segments: np.ndarray
    crack: np.ndarray
    block: np.ndarray
    birth_cycle: np.ndarray
    aperture: np.ndarray
    surface: np.ndarray
    names: tuple[str, ...] = ()
    law: np.ndarray = None  # type: ignore[assignment]  # never none once it is made

    def __post_init__(self) -> None:
        if self.law is None:
            object.__setattr__(self, "law", np.zeros(len(self.segments), int))

    @classmethod
    def from_polylines(
        cls,
        polylines: Sequence[np.ndarray],
        *,
        block: Sequence[int] | int = 0,
        aperture: Sequence[float] | float = 0.0,
        names: Sequence[str] | None = None,
        surface: Sequence[tuple[bool, bool]] | None = None,
        law: Sequence[int] | int = 0,
        join: bool = False,
    ) -> Cracks:
        """One crack per polyline (n, 2), m.

        block, aperture, law  of each crack, or one for all
        surface               per crack, which of its two ends is a mouth
        join                  True: coincident points, of one crack or several, become one node, so that cracks meet,
                              cross and branch there. Crossings between points are not noded

        Raises ValueError that names the crack for fewer than two points, non-finite points and zero-length segments.

        >>> cracks = Cracks.from_polylines([np.array([[0, 0], [3, 0], [3, 4]])], names=["kinked"])
        >>> cracks.n_cracks, float(cracks.lengths.sum())
        (1, 7.0)
        """
        n = len(polylines)
        names = tuple(names) if names is not None else tuple(f"crack {k}" for k in range(n))
        blocks = np.broadcast_to(np.asarray(block, dtype=int), (n,))
        apertures = np.broadcast_to(np.asarray(aperture, dtype=float), (n,))
        laws = np.broadcast_to(np.asarray(law, dtype=int), (n,))
        nodes, segments, crack, mouth = [], [], [], []
        first = 0
        for k, line in enumerate(polylines):
            line = np.asarray(line, dtype=float)
            if line.ndim != 2 or line.shape[1] != 2 or len(line) < 2:
                raise ValueError(f"{names[k]}: a crack needs at least two points (x, y), got shape {line.shape}")
            if not np.isfinite(line).all():
                raise ValueError(f"{names[k]}: a crack point is not finite")
            step = np.hypot(*(line[1:] - line[:-1]).T)
            if (step <= 1e-12 * max(step.sum(), np.finfo(float).tiny)).any():
                raise ValueError(f"{names[k]}: a crack segment has no length")
            nodes.append(line)
            at = first + np.arange(len(line) - 1)
            segments.append(np.column_stack([at, at + 1]))
            crack.append(np.full(len(line) - 1, k))
            ends = np.zeros(len(line), bool)
            if surface is not None:
                ends[0], ends[-1] = surface[k]
            mouth.append(ends)
            first += len(line)
        of_crack = np.concatenate(crack) if n else np.empty(0, int)
        if join and n:
            points, pairs, ends = _joined(np.concatenate(nodes), np.concatenate(segments), np.concatenate(mouth))
            for s in np.flatnonzero(pairs[:, 0] == pairs[:, 1])[:1]:
                raise ValueError(f"{names[of_crack[s]]}: a crack segment is too short relative to the network's extent")
            nodes, segments, mouth = [points], [pairs], [ends]
        return cls(
            nodes=np.concatenate(nodes) if n else np.empty((0, 2)),
            segments=np.concatenate(segments) if n else np.empty((0, 2), int),
            crack=of_crack,
            block=blocks[of_crack] if n else np.empty(0, int),
            birth_cycle=np.zeros(len(of_crack), int),
            aperture=apertures[of_crack] if n else np.empty(0),
            surface=np.concatenate(mouth) if n else np.empty(0, bool),
            names=names,
            law=laws[of_crack] if n else np.empty(0, int),
        )

    @property
    def n_segments(self) -> int:
        return len(self.segments)

    @property
    def n_cracks(self) -> int:
        return len(self.names)

    @cached_property
    def lengths(self) -> np.ndarray:
        """(n_segments,) lengths of the segments, m."""
        return np.hypot(*(self.nodes[self.segments[:, 1]] - self.nodes[self.segments[:, 0]]).T)

    @cached_property
    def valence(self) -> np.ndarray:
        """(n_nodes,) number of segments that end at each node."""
        return np.bincount(self.segments.ravel(), minlength=len(self.nodes))

    @cached_property
    def tips(self) -> np.ndarray:
        """(n_tips,) nodes where a crack ends inside the rock, in the order of their segments, start before end."""
        flat = self.segments.ravel()
        return flat[(self.valence[flat] == 1) & ~self.surface[flat]]

    def in_block(self, block: int) -> Cracks:
        """The cracks of one block, with nodes renumbered (crack numbers and names stay those of the whole)."""
        return self.take(np.flatnonzero(self.block == block))

    def take(self, segments: np.ndarray) -> Cracks:
        """A network of only these ``segments`` (indices), unused nodes dropped."""
        used, renumbered = np.unique(self.segments[segments].ravel(), return_inverse=True)
        return Cracks(
            nodes=self.nodes[used],
            segments=renumbered.reshape(-1, 2),
            crack=self.crack[segments],
            block=self.block[segments],
            birth_cycle=self.birth_cycle[segments],
            aperture=self.aperture[segments],
            surface=self.surface[used],
            names=self.names,
            law=self.law[segments],
        )


def _joined(nodes: np.ndarray, segments: np.ndarray, mouth: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Merge coincident nodes into the first of them; the result is a mouth if one of them is."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    extent = float(np.ptp(nodes, axis=0).max())
    one, other = cKDTree(nodes).query_pairs(SAME_POINT * extent, output_type="ndarray").T
    links = coo_array((np.ones(len(one), bool), (one, other)), shape=(len(nodes),) * 2)
    group = connected_components(links, directed=False)[1]
    # Numbered by their first nodes, which stay in order.
    _, first, number = np.unique(group, return_index=True, return_inverse=True)
    order = np.argsort(first)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    of_node = place[number]
    mouths = np.zeros(len(first), bool)
    np.logical_or.at(mouths, of_node, mouth)
    return nodes[first[order]], of_node[segments], mouths
