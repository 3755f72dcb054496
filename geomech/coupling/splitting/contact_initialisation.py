"""Initial contact forces, gaps and slip between the parts of a split block, from the tractions on its crack faces.

The last solution of the whole body is in equilibrium, and so is every part of it under the tractions on its own
boundary. Each segment of a new face distributes its traction to the contacts at its two ends by the linear shape
functions. This preserves force and moment, puts no pressure where the faces have none, and violates no Coulomb law that
the tractions satisfy. Open faces give a gap, sliding ones their slip.

Along the last segment, which was intact rock in that solution, the resultant of its normal stress is kept if it is
compressive, with as much shear as the new joint can carry; a tensile one is released. Edges of the parent that a mouth
has divided are treated in the same way, with the external traction. All other contacts keep their forces.

This requires that the parts start in the configuration of the last pass. In statics a block on a thin ligament strains
excessively before it is cut; its parts start in the configuration at the beginning of the load step, without inherited
forces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ... import dda
from ...conventions import normal_of, traction
from ...dda.contact_detection.initial_overlap import REFUSED
from ...dda.joint_laws.bonds import WHOLE
from ...dda.loads.force_records import EDGE_FORCE
from ...model import OPEN, Blocks, Loads, State
from ...model.blocks.block_arrays import STRAIGHT
from ..load_transfer.boundary_tractions import BoundaryLoad
from .block_splitting import Split
from .face_inheritance import from_their_faces

#: Points and nodes closer to a segment than this fraction of its length lie on it.
_ON = 1e-7
#: … and load segments, on the line through the ends of a straight side.
_ON_SIDE = 4 * STRAIGHT
#: Contacts belong to a face if the angle between their normals is less than 4° (cosine): faces may be slightly bent.
_ALIGNED = 0.9975
#: Gauss points on a segment of intact rock.
_IN_ROCK = 12
#: Gauss points on a linearly loaded piece: its moment is a polynomial of degree 3 at most.
_IN_LOAD = 2
#: Largest initial gap or overlap, as a fraction of the size (√area) of the smaller block. Contacts are searched as far
#: as faces are apart, and the search must not reach the opposite sides of the blocks.
_FARTHEST = 0.02
#: Largest opening of faces beyond their given aperture, as a fraction of that size. Parts start where their parent was,
#: and overlap by the inherited gap when they close; on a thin ligament, without inertia, faces may have opened by any
#: amount. Half of the overlap that is refused in a drawing.
_OPENED = 0.5 * REFUSED
#: Vertices of contacts closer together than this fraction of the size of the smaller block are at one corner: far beyond
#: the rounding of corners and what joints slide before a block is cut, and far below the distance of corners.
_SAME_PLACE = 1e-3
#: Largest mean crack strain that counts as small: the strain at failure of rock is a few thousandths.
_SMALL_STRAIN = 0.01
#: Forces smaller than this fraction of the largest are round-off.
_ROUND_OFF = 1e-12


@dataclass(frozen=True, eq=False)
class _Faces:
    """Crack faces of a solved body: traction (normal, shear) at nodes with their tributary length; gap and slip at the
    ends of elements; reference coordinates."""

    nodes: np.ndarray  # (k, 2)
    share: np.ndarray  # (k,) m
    traction: np.ndarray  # (k, 2) Pa
    ends: np.ndarray  # (n, 2, 2) of each element
    width: np.ndarray  # (n, 1) m, apart as given
    opening: np.ndarray  # (n, 2) m
    slip: np.ndarray  # (n, 2) m

    @classmethod
    def of(cls, solution) -> _Faces:
        faces, elements = solution.faces, solution.body.faces
        ends = np.stack([elements.start, elements.end], axis=1)
        along = (ends[:, 1] - ends[:, 0])[:, None]
        length = np.hypot(along[..., 0], along[..., 1])
        at = 2 * np.sum((elements.nodes - ends[:, :1]) * along, axis=2) / length**2 - 1
        # Quadrature weights exact for polynomials through the nodes; positive at Chebyshev and Gauss nodes.
        table = np.polynomial.legendre.legvander(at, at.shape[1] - 1).transpose(0, 2, 1)
        whole = np.zeros((len(at), at.shape[1], 1))
        whole[:, 0] = length
        aperture = solution.body.cracks.aperture[elements.source][:, None]
        # A slot of infinite aperture never closes; its gap is taken as the opening alone.
        aperture = np.where(np.isfinite(aperture), aperture, 0.0)
        return cls(
            elements.nodes.reshape(-1, 2),
            np.linalg.solve(table, whole).ravel(),
            faces.traction[:, 1:-1].reshape(-1, 2),
            ends,
            aperture,
            faces.opening[:, [0, -1]],
            faces.slip[:, [0, -1]],
        )

    def on(self, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """(places from 0 to 1, tributary lengths m, tractions) on the segment from ``a`` to ``b``; None where it was no
        crack in the last solution."""
        here = np.repeat(self._elements_on(a, b), len(self.nodes) // len(self.ends))
        # Elements graded towards a corner at its end may be shorter than the tolerance of the test above.
        if self.share[here].sum() < 0.5 * np.hypot(*(b - a)):
            return None
        return _along(self.nodes[here], a, b)[0], self.share[here], self.traction[here]

    def ends_at(self, a: np.ndarray, b: np.ndarray, most: float) -> tuple[np.ndarray, np.ndarray]:
        """(2,) gap and (2,) slip at the ends of the segment from ``a`` to ``b``, with an opening of at most ``most``
        m."""
        here = self._elements_on(a, b)
        points = self.ends[here].reshape(-1, 2)
        nearest = [int(np.argmin(np.hypot(*(points - end).T))) for end in (a, b)]
        gap = np.maximum(self.width[here] + np.minimum(self.opening[here], most), 0.0)
        return gap.ravel()[nearest], self.slip[here].ravel()[nearest]

    def _elements_on(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """(n,) bool: elements with their midpoint on the segment from ``a`` to ``b``."""
        return _along(self.ends.mean(axis=1), a, b)[1]


def holds_together(state: State, blocks: np.ndarray) -> bool:
    """Whether the crack strains of ``blocks`` (numbers) in ``state`` are small, so that their parts can start there."""
    return bool(np.abs(state.crack_strain[blocks]).max(initial=0.0) <= _SMALL_STRAIN)


def _along(points: np.ndarray, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates (n,) of ``points`` (n, 2) along the segment from ``a`` to ``b``, 0 to 1, and which of them lie on
    it."""
    d = b - a
    square = float(d @ d)
    place = (points - a) @ d / square
    off = np.abs((points - a) @ normal_of(d)) / square
    return place, (off <= _ON) & (place >= -_ON) & (place <= 1 + _ON)


@dataclass(eq=False)
class _Inherited:
    """Inherited forces, gaps and slip of the contacts (n,) of a `ContactSet`, in current axes, on the vertex's
    block."""

    force: np.ndarray
    gap: np.ndarray
    slip: np.ndarray
    known: np.ndarray

    @classmethod
    def none(cls, n: int) -> _Inherited:
        return cls(np.zeros((n, 2)), np.full(n, np.inf), np.zeros(n), np.zeros(n, bool))


def contacts_after(
    system: dda.BlockSystem,
    split: Split,
    before: Blocks,
    solutions: dict,
    loads: dict[int, BoundaryLoad],
    acting: Loads,
    contacts: np.ndarray,
) -> State:
    """The state of ``split`` with contacts whose next step starts with the forces at the end of the last one.

    ``system``: block system of the new blocks; ``before``: the blocks before the split; ``solutions`` and boundary
    ``loads`` (block →) of the last pass at ``split.state``; ``acting``: loads on the blocks; ``contacts``: CONTACT rows
    before the split.
    """
    blocks, state = split.blocks, split.state
    near = system.contacts_near(state)
    found = from_their_faces(near, state.contacts, contacts, split.parent)
    parts = np.bincount(split.parent, minlength=before.n_blocks)
    cut = [b for b in np.flatnonzero(parts > 1).tolist() if b in solutions]
    if not len(found) or (found is near and not cut and system.deflected is None):
        return state
    inherited = _Inherited.none(len(found))
    loaded = {load.edge_name for load in acting.edge_tractions}
    wet = np.zeros(0, EDGE_FORCE)
    if cut and acting.water is not None:
        alone = Loads(water=acting.water)
        wet = system.load_map.rows(alone, state.time, np.ascontiguousarray(state.vertices), state.rotation)[1]
    for parent in cut:
        _inherit_along_walls(inherited, found, split, parent, solutions[parent], float(state.rotation[parent]))
        _inherit_along_divided_edges(inherited, found, split, before, parent, loads[parent], loaded, wet)
    is_part = np.isin(split.parent, cut)
    inherited.known |= _turned_away(found, state.contacts, is_part)
    given = _contacts(system, found, inherited, blocks, is_part)
    return system.with_inherited_contacts(state, found, given)


def _turned_away(found, kept: np.ndarray, is_part: np.ndarray) -> np.ndarray:
    """(n,) bool: corners of parts (n_blocks,) that faced a length of a side before, among the rows ``kept`` from then
    (CONTACT), and act alone in another direction now: at a vertex in a straight side that is cut there, of which the other
    part bears the face. They start without force."""
    if not len(kept):
        return np.zeros(len(found), bool)
    at = {(vertex, edge): row for row, (vertex, edge) in enumerate(zip(kept["vertex"].tolist(), kept["edge"].tolist()))}
    row = np.array([at.get(key, -1) for key in zip(found.vertex.tolist(), found.edge.tolist())], int)
    alone = (row >= 0) & (kept["length"][row] > 0) & (found.geometry[:, 4] == 0)
    turned = np.sum(found.geometry[:, 1:3] * kept["normal"][row], axis=1) <= _ALIGNED
    return alone & turned & (is_part[found.block] | is_part[found.other])


def _contacts(
    system: dda.BlockSystem, found, inherited: _Inherited, blocks: Blocks, is_part: np.ndarray
) -> dda.InheritedContacts:
    """``inherited`` forces resolved along the contacts. Contacts of parts (n_blocks,) without an inherited value keep
    their forces."""
    across = found.geometry[:, 1:3]
    normal = np.sum(inherited.force * across, axis=1)
    shear = np.sum(inherited.force * normal_of(across), axis=1)
    least = _ROUND_OFF * np.abs(inherited.force).max(initial=0.0)
    normal = np.where((normal > least) | ((found.bonded == WHOLE) & (normal < -least)), normal, 0.0)
    rough = np.array([joint.roughness is not None for joint in system.joints])[found.law]
    keeps = ~inherited.known & (found.state != OPEN) & (is_part[found.block] | is_part[found.other])
    normal, shear = np.where(inherited.known, normal, found.normal), np.where(inherited.known, shear, found.shear)
    size = np.sqrt(blocks.areas())
    farthest = _FARTHEST * np.minimum(size[found.block], size[found.other])
    gap = np.minimum(inherited.gap, farthest)
    # A soft joint on a short remaining length cannot carry the force of the whole face.
    normal = np.minimum(normal, found.springs.normal * farthest)
    most = np.where(rough, np.inf, found.springs.peak * np.maximum(normal, 0.0))
    shear = np.where(found.bonded > 0, shear, np.clip(shear, -most, most))
    which = np.flatnonzero(inherited.known | keeps)
    return dda.InheritedContacts(
        which=which,
        normal=normal[which],
        shear=shear[which],
        gap=np.where(inherited.known & np.isfinite(inherited.gap), gap, found.gap)[which],
        slip=np.where(inherited.known, inherited.slip, found.slip)[which],
    )


def _turned(vectors: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return vectors @ np.array([[c, s], [-s, c]])


def _inherit_along_walls(inherited: _Inherited, found, split: Split, parent: int, solution, rotation: float) -> None:
    """Give the tractions, gaps and slip on the faces that divide ``parent`` to the contacts between its parts."""
    blocks = split.blocks
    faces, size = _Faces.of(solution), np.sqrt(blocks.areas())
    points, following, owner = blocks.vertices, blocks.next_vertex, blocks.vertex_block
    own = np.flatnonzero((split.edge_origin < 0) & (split.parent[owner] == parent))
    edge_of = {(*points[e].tolist(), *points[following[e]].tolist()): int(e) for e in own}
    between: dict[tuple[frozenset[int], tuple[float, ...]], list[int]] = {}
    for row in np.flatnonzero((split.parent[found.block] == parent) & (split.parent[found.other] == parent)).tolist():
        at = tuple(points[found.vertex[row]].tolist())
        between.setdefault((frozenset((int(found.block[row]), int(found.other[row]))), at), []).append(row)
    for (ax, ay, bx, by), edge in edge_of.items():
        facing = edge_of.get((bx, by, ax, ay), -1)
        if facing < edge:
            continue  # once per pair
        a, b = np.array([ax, ay]), np.array([bx, by])
        # The owner's rock is on the left of its edge: the upper face.
        upper, pair = int(owner[edge]), frozenset((int(owner[edge]), int(owner[facing])))
        normal = normal_of((b - a) / np.hypot(*(b - a)))
        known = faces.on(a, b)
        if known is None:
            place, share, stress = _in_rock(solution, a, b, normal)
            gap, slip = np.zeros(2), np.zeros(2)
        else:
            place, share, stress = known
            gap, slip = faces.ends_at(a, b, _OPENED * float(min(size[part] for part in pair)))
        along = -normal_of(normal)
        force = -share[:, None] * (stress[:, :1] * normal + stress[:, 1:] * along)
        weight = np.clip(np.stack([1 - place, place]), 0.0, 1.0)
        force, along, across = _turned(weight @ force, rotation), _turned(along, rotation), _turned(normal, rotation)
        for end, at in enumerate(((ax, ay), (bx, by))):
            row = _contact_at(between.get((pair, at), ()), found, across, (edge, facing))
            if row < 0:
                continue
            sign = 1.0 if found.block[row] == upper else -1.0
            inherited.force[row] += sign * force[end]
            inherited.known[row] = True
            if gap[end] < inherited.gap[row]:
                inherited.gap[row] = gap[end]
                inherited.slip[row] = sign * slip[end] * float(along @ normal_of(found.geometry[row, 1:3]))


def _in_rock(solution, a: np.ndarray, b: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places, tributary lengths and tractions on a segment that was intact rock in the last solution: the resultant, if
    it is compressive, distributed over the compressed part. Bent rock whose tension is released keeps only the
    compression in equilibrium."""
    gauss, weight = np.polynomial.legendre.leggauss(_IN_ROCK)
    place, share = 0.5 * (gauss + 1), 0.5 * weight * np.hypot(*(b - a))
    vector = traction(solution.stress(a + place[:, None] * (b - a)), normal)
    pressure = np.maximum(-vector @ normal, 0.0)
    resultant = share @ np.column_stack([vector @ normal, vector @ -normal_of(normal)])
    if resultant[0] >= 0:
        return place, share, np.zeros((len(place), 2))
    return place, share, pressure[:, None] / (share @ pressure) * resultant


def _contact_at(rows, found, across: np.ndarray, edges: tuple[int, int]) -> int:
    """The contact of ``rows`` that transfers the normal force of a face with direction ``across``; −1: none."""
    best, where = (_ALIGNED, False), -1
    for row in rows:
        cosine = abs(float(found.geometry[row, 1:3] @ across))
        fit = (round(cosine, 9), int(found.edge[row]) in edges)
        if fit > best:
            best, where = fit, row
    return where


def _inherit_along_divided_edges(
    inherited: _Inherited,
    found,
    split: Split,
    before: Blocks,
    parent: int,
    load: BoundaryLoad,
    loaded: set[str],
    wet: np.ndarray,
) -> None:
    """Give the external traction on divided edges of ``parent``, and on edges at a duplicated vertex, to the contacts
    of its parts. Water pressure (EDGE_FORCE rows ``wet``) is subtracted. Where contacts and an edge ``load`` share a
    side the traction cannot be attributed, and nothing is inherited. Contacts that acted alone keep their forces."""
    blocks, owner = split.blocks, split.blocks.vertex_block
    old_vertices = np.bincount(split.vertex_origin[split.vertex_origin >= 0], minlength=before.n_vertices)
    twice = old_vertices > 1
    here = (split.parent[owner] == parent) & (split.edge_origin >= 0)
    origin = np.maximum(split.edge_origin, 0)
    partial = np.any(split.edge_span != [0.0, 1.0], axis=1)
    divided = here & (partial | twice[origin] | twice[before.next_vertex[origin]])
    rotation = float(split.state.rotation[parent])
    # A contact on an edge may act on the next edge of the same straight side.
    for side in sorted({blocks.side_start[edge] for edge in np.flatnonzero(divided).tolist()}):
        edges = np.array(blocks.sides[side][:-1])
        names = before.edge_name[split.edge_origin[edges]]
        if any(before.edge_names[name] in loaded for name in names.tolist()):
            continue
        rows = _contacts_on(found, split, blocks.sides[side])
        rows = rows[~_acted_alone(found, rows, split, load)]
        if not len(rows):
            continue
        ends = blocks.sides[side][0], blocks.sides[side][-1]
        at = np.clip(_along(found.geometry[rows, 5:7], *split.state.vertices[list(ends)])[0], 0.0, 1.0)
        neighbour = np.where(found.block[rows] == owner[side], found.other[rows], found.block[rows])
        place, force = _loads_on(load, *blocks.vertices[list(ends)])
        lumped = _turned(_shares(at, neighbour, place) @ force, rotation)
        place, force = _water_on(wet[np.isin(wet["edge"], edges)], *split.state.vertices[list(ends)])
        if len(place):
            lumped -= _shares(at, neighbour, place) @ force
        sign = np.where(found.block[rows] == owner[side], 1.0, -1.0)
        inherited.force[rows] += sign[:, None] * lumped
        inherited.slip[rows] = found.slip[rows]
        inherited.known[rows] = True


def _acted_alone(found, rows: np.ndarray, split: Split, load: BoundaryLoad) -> np.ndarray:
    """(n,) bool: contacts ``rows`` (n,) that acted alone on the whole block under ``load``: on a corner, which a force
    loads by shear along both edges, so that the traction on one side does not show it, or on a short piece of an edge.

    Where two corners meet, either may be the vertex of their contact: place and direction tell which one it was."""
    alone = np.zeros(len(rows), bool)
    if load.single is None:
        return alone
    pair = np.stack([split.parent[found.block[rows]], split.parent[found.other[rows]]])
    place, size = split.state.vertices, np.sqrt(split.blocks.areas())
    near = _SAME_PLACE * np.minimum(size[found.block[rows]], size[found.other[rows]])
    for one in load.single:
        (a, b), (c, d) = pair, (one["block"], one["other"])
        same, swapped = (a == c) & (b == d), (a == d) & (b == c)
        aligned = np.where(same, 1.0, -1.0) * (found.geometry[rows, 1:3] @ one["normal"]) > _ALIGNED
        at = place[np.argmax(split.vertex_origin == one["vertex"])]
        alone |= (same | swapped) & aligned & (np.hypot(*(place[found.vertex[rows]] - at).T) <= near)
    return alone


def _water_on(wet: np.ndarray, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places (k,) from 0 to 1 between ``a`` and ``b``, and the forces (k, 2) N/m there of the EDGE_FORCE rows ``wet``;
    current coordinates."""
    gauss, weight = np.polynomial.legendre.leggauss(_IN_LOAD)
    t = 0.5 * (gauss + 1)[:, None, None]
    point = (1 - t) * wet["start"] + t * wet["end"]
    length = np.hypot(*(wet["end"] - wet["start"]).T)[:, None]
    force = 0.5 * weight[:, None, None] * length * ((1 - t) * wet["traction"][:, 0] + t * wet["traction"][:, 1])
    return np.clip(_along(point.reshape(-1, 2), a, b)[0], 0.0, 1.0), force.reshape(-1, 2)


def _shares(at: np.ndarray, neighbour: np.ndarray, place: np.ndarray) -> np.ndarray:
    """(n, k) shares of the contacts ``at`` (n,), with the blocks ``neighbour`` (n,), in forces at ``place`` (k,) on an
    edge, by the linear shape functions. A force goes to the contacts of the neighbour whose contacts enclose its place;
    where two do, to those that extend further."""
    out = np.zeros((len(at), len(place)))
    groups = [np.flatnonzero(neighbour == b) for b in np.unique(neighbour).tolist()]
    reach = np.array([[at[rows].min(), at[rows].max()] for rows in groups])
    beyond = np.maximum(np.maximum(reach[:, :1] - place, place - reach[:, 1:]), 0.0)
    width = np.broadcast_to((reach[:, 0] - reach[:, 1])[:, None], beyond.shape)
    nearest = np.lexsort((width, beyond), axis=0)[0]
    for number, rows in enumerate(groups):
        own = np.flatnonzero(nearest == number)
        stops, which = np.unique(np.round(at[rows], 9), return_inverse=True)
        # Contacts at the same place share its force.
        share = 1.0 / np.bincount(which)[which]
        for k, row in enumerate(rows.tolist()):
            hat = (np.arange(len(stops)) == which[k]).astype(float)
            out[row, own] = share[k] * np.interp(place[own], stops, hat)
    return out


def _contacts_on(found, split: Split, side: list[int]) -> np.ndarray:
    """Contacts on the straight ``side`` of a part (the vertices along it), except with other parts of the same
    parent."""
    blocks, vertices = split.blocks, split.state.vertices
    block = int(blocks.vertex_block[side[0]])
    others = split.parent != split.parent[block]
    along = vertices[side[-1]] - vertices[side[0]]
    outward = -normal_of(along) / np.hypot(*along)
    facing = found.geometry[:, 1:3] @ outward
    touched = np.isin(found.edge, side[:-1]) & others[found.block] & (facing > _ALIGNED)
    touching = (found.block == block) & others[found.other] & (facing < -_ALIGNED)
    touching &= np.isin(found.vertex, side)
    # An open corner that faces no length of the side may be millimetres away from it.
    apart = (found.state == OPEN) & (found.geometry[:, 4] == 0)
    return np.flatnonzero((touched | touching) & ~apart)


def _loads_on(load: BoundaryLoad, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places (k,) from 0 to 1 on the edge from ``a`` to ``b``, reference coordinates, and the forces (k, 2) N/m of
    ``load`` there, without those of contacts that act alone."""
    gauss, weight = np.polynomial.legendre.leggauss(_IN_LOAD)
    places, forces = [np.zeros(0)], [np.zeros((0, 2))]
    length = float(np.hypot(*(b - a)))
    alone = slice(*load.of_single)
    segments, tractions = (np.delete(each, alone, axis=0) for each in (load.segments, load.tractions))
    for segment, ends in zip(segments, tractions):
        (s0, s1), _ = _along(segment, a, b)
        off = np.abs((segment - a) @ normal_of(b - a)) / length**2
        if off.max() > _ON_SIDE or s1 == s0:
            continue
        first, last = (np.clip((limit - s0) / (s1 - s0), 0.0, 1.0) for limit in (0.0, 1.0))
        t = first + (last - first) * 0.5 * (gauss + 1)
        share = 0.5 * weight * (last - first) * (s1 - s0) * length
        places.append(s0 + t * (s1 - s0))
        forces.append(np.abs(share)[:, None] * ((1 - t)[:, None] * ends[0] + t[:, None] * ends[1]))
    if load.points is not None and load.forces is not None and len(load.points):
        place, here = _along(load.points, a, b)
        places.append(place[here])
        forces.append(load.forces[here])
    return np.concatenate(places), np.concatenate(forces)
