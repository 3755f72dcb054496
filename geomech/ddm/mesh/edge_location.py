"""Locates a straight piece that the user names on the boundary of a body."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .elements import Mesh

#: Largest distance of such a segment from the boundary, relative to the extent; within it the segment is projected.
OFF = 1e-6


def sides_for(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """(m, 2, 2) the edges of ``mesh`` and, in a half-plane, a piece of its surface that extends beyond all of
    ``points`` (..., 2)."""
    rock = mesh.cracks.half_plane
    if rock is None:
        return mesh.edges
    points = np.concatenate([x.reshape(-1, 2) for x in (mesh.edges, mesh.cracks.start, mesh.cracks.end, points)])
    return np.concatenate([mesh.edges, rock.edge(points)])


def onto_boundary(edges: np.ndarray, segment: np.ndarray, name: str, extent: float) -> tuple[np.ndarray, bool, int]:
    """Project ``segment`` (2, 2) onto that of ``edges`` (m, 2, 2) on which it lies.

    Returns the projected segment, whether it runs against the edge's direction, and the edge's number. Raises
    ValueError with ``name`` when the distance exceeds `OFF` times ``extent`` or the segment has no length.
    """
    a, d = edges[:, 0], edges[:, 1] - edges[:, 0]
    length = np.hypot(*d.T)
    rel = segment[None] - a[:, None]
    s = np.einsum("ijc,ic->ij", rel, d) / length[:, None] ** 2
    clipped = np.clip(s, 0.0, 1.0)
    foot = a[:, None] + clipped[..., None] * d[:, None]
    off = np.hypot(*np.moveaxis(foot - segment, 2, 0)).max(axis=1)
    at = int(np.argmin(off))
    if off[at] > OFF * extent:
        raise ValueError(f"{name} lies {off[at]:.3g} m off the boundary of the body")
    if abs(s[at, 1] - s[at, 0]) * length[at] <= 1e-14 * extent:
        raise ValueError(f"{name} has no length")
    against = bool(s[at, 1] < s[at, 0])
    return (foot[at][::-1] if against else foot[at]), against, at
