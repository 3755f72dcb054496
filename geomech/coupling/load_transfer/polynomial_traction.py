"""Traction along faces of blocks of higher order, from the forces at the integration points of the face.

With Gauss–Lobatto points sᵢ, weights wᵢ and a face of length ℓ, the stress Nᵢ/(ℓ wᵢ) at the points is fitted by a
polynomial of degree p − 3, but at least 1 (p + 2 is the number of points): weighted with wᵢ, so that resultant and moment
are exact. The highest parts of the stress at the points balance what the polynomials of the block cannot represent. They
do not converge, as spurious pressure modes in mixed finite elements. (A slab twice as wide as deep: K is 2 to 5 % off at
p = 7 and 8, and 6 to 12 % with all of it. A linear stress leaves 106 %.)

The polynomial is divided into pieces with linear traction, with its force and moment on each. Where it would pull and the
face is not bonded, there is no traction, and a linear factor on the remainder keeps resultant and moment. A face on which
that is impossible, as on one that tips over its edge, has the traction of a first-order block (`boundary_tractions`).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ...dda.kinematics.polygon_quadrature import gauss_points, lobatto_points
from ...dda.loads.force_records import EDGE_FORCE, BondTractions
from ...model import Blocks

#: Pieces between two neighbouring points.
_DIVIDED = 3
#: Degrees of the stress at the points that are left out, of p + 1.
_LEFT_OUT = 4
#: Part of the largest pressure that is round-off.
_ROUND_OFF = 1e-9
#: Cosine of the angle between the direction of a face and an edge on which it lies.
_ALONG = 0.9975


def without_faces(
    blocks: Blocks, vertices: np.ndarray, contacts: np.ndarray, points: np.ndarray | None, bent: np.ndarray,
    left: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """CONTACT rows ``contacts`` without the faces of the blocks ``bent`` (n_blocks,) bool, and EDGE_FORCE rows with the
    tractions along these, on both blocks. Faces on the blocks ``left`` (n_blocks,) bool are left as they are where they
    are not bonded.

    ``vertices`` (n_vertices, 2) m, where forces act; ``points``: FACE_POINT rows of all faces, None without any."""
    if points is None or not len(points) or not len(contacts):
        return contacts, np.zeros(0, EDGE_FORCE)
    rows = {(v, e): k for k, (v, e) in enumerate(contacts[["vertex", "edge"]].tolist())}
    drop, out = np.zeros(len(contacts), bool), []
    on_face = np.flatnonzero((points["far_vertex"] >= 0) & (bent[points["block"]] | bent[points["other"]]))
    starts = on_face[points["place"][on_face] == 0.0]
    for first in starts.tolist():
        n = int(np.argmax(points["place"][first:] == 1.0)) + 1
        face = points[first : first + n]
        ends = [rows.get((int(face[a][0]), int(face[b][0])), -1) for a, b in _ENDS]
        based = left[face["block"][0]] or left[face["other"][0]]
        if min(ends) < 0 or (based and not (face["bonded"] > 0).all()) or not face["normal_force"].any():
            continue
        pieces = _pieces(face)
        if pieces:
            drop[ends] = True
            out += _edge_forces(blocks, vertices, contacts[ends], pieces)
    return contacts[~drop], np.array(out, EDGE_FORCE) if out else np.zeros(0, EDGE_FORCE)


#: Names of the vertex and the edge at both ends of a face.
_ENDS = ("vertex", "edge"), ("far_vertex", "far_edge")


def _edge_forces(blocks: Blocks, vertices: np.ndarray, ends: np.ndarray, pieces: list) -> list[tuple]:
    """EDGE_FORCE rows of one face with these ``pieces``, whose ``ends`` (2,) are CONTACT rows."""
    normal = ends["normal"][0]
    start, along = ends["point"][0], ends["point"][1] - ends["point"][0]
    along = along - (along @ normal) * normal
    out: list[tuple] = []
    for block, sign in ((int(ends["block"][0]), 1.0), (int(ends["other"][0]), -1.0)):
        edges = _edges_on(blocks, vertices, block, start, along, -sign * normal)
        tangent = np.array([-normal[1], normal[0]])
        for low, high, values in pieces:
            for edge, a, b in edges:
                p, q = max(low, a), min(high, b)
                if q <= p:
                    continue
                at = (np.array([p, q]) - low) / (high - low)
                pressure, shear = (1 - at)[:, None] * values[0] + at[:, None] * values[1], sign / np.hypot(*along)
                traction = shear * (pressure[:, :1] * normal + pressure[:, 1:] * tangent)
                force = 0.5 * (q - p) * np.hypot(*along) * traction.sum(axis=0)
                first, last = _onto(blocks, vertices, edge, start + np.array([[p], [q]]) * along)
                out.append((block, edge, first, last, traction, force))
    return out


def _onto(blocks: Blocks, vertices: np.ndarray, edge: int, points: np.ndarray) -> np.ndarray:
    """The points of the ``edge`` nearest to ``points`` (n, 2): strained edges in contact are apart, and the one ends before
    the other, by what the blocks deflect."""
    start = vertices[edge]
    way = vertices[blocks.next_vertex[edge]] - start
    return start + np.clip((points - start) @ way / (way @ way), 0.0, 1.0)[:, None] * way


def _pieces(face: np.ndarray) -> list[tuple[float, float, np.ndarray]]:
    """Parts (from, to) of a face of length 1 and the linear force (normal, shear) per length at both ends (2, 2); none
    where no pressure of this kind has the resultant and the moment of the points."""
    n = len(face)
    place, weight = lobatto_points(n)
    force = np.stack([face["normal_force"], face["shear_force"]], axis=1)
    table = np.polynomial.legendre.legvander(2 * place - 1, max(1, n - 1 - _LEFT_OUT))
    polynomial = np.linalg.solve(table.T @ (weight[:, None] * table), table.T @ force)
    marks = np.concatenate([np.linspace(a, b, _DIVIDED, endpoint=False) for a, b in pairwise(place)] + [[1.0]])
    pressure = np.polynomial.legendre.legval(2 * marks - 1, polynomial[:, 0])
    if pressure.min() < -_ROUND_OFF * np.abs(pressure).max() and not (face["bonded"] > 0).all():
        return _pressing(marks, np.maximum(pressure, 0.0), force, place)
    at, share = np.polynomial.legendre.leggauss(n // 2 + 2)
    out = []
    for a, b in pairwise(marks.tolist()):
        s = a + 0.5 * (b - a) * (1 + at)
        values = np.polynomial.legendre.legval(2 * s - 1, polynomial).T * (0.5 * (b - a) * share)[:, None]
        out.append((a, b, _linear(values.sum(axis=0), (s - a) @ values, b - a)))
    return out


def _pressing(
    marks: np.ndarray, pressure: np.ndarray, force: np.ndarray, place: np.ndarray
) -> list[tuple[float, float, np.ndarray]]:
    """As `_pieces`, of the ``pressure`` (k,) ≥ 0 at ``marks`` (k,) times a linear function, with the resultant and moment
    of the ``force`` (n, 2) at ``place`` (n,); shear is proportional to it."""
    length = np.diff(marks)
    # Nodal weights of ∫ f ds and ∫ s f ds of a piecewise linear f.
    first, moment = np.zeros(len(marks)), np.zeros(len(marks))
    for k, (a, b) in enumerate(pairwise(marks.tolist())):
        first[k : k + 2] += 0.5 * length[k]
        moment[k : k + 2] += length[k] / 6.0 * np.array([2 * a + b, a + 2 * b])
    shapes = np.stack([pressure, pressure * marks], axis=1)
    wanted = np.array([force[:, 0].sum(), place @ force[:, 0]])
    try:
        factors = np.linalg.solve(np.stack([first @ shapes, moment @ shapes]), wanted)
    except np.linalg.LinAlgError:
        return []
    scaled = shapes @ factors
    if scaled.min() < 0.0:
        return []
    both = np.stack([scaled, force[:, 1].sum() / wanted[0] * scaled], axis=1)
    return [(marks[k], marks[k + 1], both[k : k + 2]) for k in range(len(length)) if both[k : k + 2].any()]


def between_cells(blocks: Blocks, vertices: np.ndarray, bonds: BondTractions | None, cracked: np.ndarray) -> np.ndarray:
    """EDGE_FORCE rows with the tractions ``bonds`` on the glued faces of the ``cracked`` cells (n_blocks,) bool.

    ``vertices`` (n_vertices, 2) m, where forces act."""
    out: list[tuple] = []
    owner = blocks.vertex_block
    faces = [] if bonds is None else np.flatnonzero(cracked[owner[bonds.edges]].any(axis=1)).tolist()
    for face in faces:
        assert bonds is not None
        first, last = np.searchsorted(bonds.face, [face, face + 1])
        pieces = _pieces_between_cells(bonds.traction[first:last])
        for edge, way in zip(bonds.edges[face].tolist(), (1.0, -1.0)):
            if not cracked[owner[edge]]:
                continue
            start, end = vertices[edge], vertices[blocks.next_vertex[edge]]
            for low, high, values in pieces:
                at = np.array([low, high]) if way > 0 else 1.0 - np.array([high, low])
                on = start + at[:, None] * (end - start)
                traction = values if way > 0 else -values[::-1]
                force = 0.5 * (high - low) * np.hypot(*(end - start)) * traction.sum(axis=0)
                out.append((owner[edge], edge, *on, traction, force))
    return np.array(out, EDGE_FORCE) if out else np.zeros(0, EDGE_FORCE)


def _pieces_between_cells(traction: np.ndarray) -> list[tuple[float, float, np.ndarray]]:
    """As `_pieces`, for the ``traction`` (n, 2) at the Gauss points of a glued face: of degree n − 2, that of the stress of
    its cells."""
    n = len(traction)
    place, weight = gauss_points(n)
    table = np.polynomial.legendre.legvander(2 * place - 1, max(1, n - 2))
    polynomial = (2 * np.arange(table.shape[1]) + 1)[:, None] * ((table * weight[:, None]).T @ traction)
    marks = np.linspace(0.0, 1.0, n)
    out = []
    for a, b in pairwise(marks.tolist()):
        s = a + (b - a) * place
        values = np.polynomial.legendre.legval(2 * s - 1, polynomial).T * ((b - a) * weight)[:, None]
        out.append((a, b, _linear(values.sum(axis=0), (s - a) @ values, b - a)))
    return out


def _linear(force: np.ndarray, moment: np.ndarray, length: float) -> np.ndarray:
    """(2, …) values at the ends of the linear distribution over ``length`` with this ``force`` and ``moment`` about its
    beginning."""
    return np.stack([4 * force - 6 * moment / length, 6 * moment / length - 2 * force]) / length


def _edges_on(
    blocks: Blocks, vertices: np.ndarray, block: int, start: np.ndarray, along: np.ndarray, outward: np.ndarray
) -> list[tuple[int, float, float]]:
    """Edges of ``block`` with the ``outward`` normal on the line from ``start`` ``along`` a face, and between which
    coordinates (0 to 1 along the face) each lies; the first and the last reach to the ends of the face."""
    own = np.arange(blocks.vertex_start[block], blocks.vertex_start[block + 1])
    a, b = vertices[own], vertices[blocks.next_vertex[own]]
    way = b - a
    length = np.hypot(*way.T)
    facing = (way @ np.array([-outward[1], outward[0]])) > _ALONG * length
    square = float(along @ along)
    places = np.sort(np.stack([(a - start) @ along, (b - start) @ along]) / square, axis=0)
    away = np.abs((0.5 * (a + b) - start) @ outward)
    near = facing & (places[1] > 0.0) & (places[0] < 1.0) & (away <= 0.05 * np.sqrt(square))
    found = sorted((float(places[0, k]), float(places[1, k]), int(own[k])) for k in np.flatnonzero(near).tolist())
    out = [(edge, low, high) for low, high, edge in found]
    if out:
        out[0] = (out[0][0], -np.inf, out[0][2])
        out[-1] = (out[-1][0], out[-1][1], np.inf)
    return out
