"""Cells of continuous rock: blocks bonded along their faces by the symmetric interior penalty method.

With the jump [u] = u_a − u_b of displacement on a face between cells a and b, the normal n out of a, and the mean {t} =
½ (σ_a + σ_b) n of their tractions, a face has the energy

    Π = ∫ (½ τ [u]·[u] − {t}·[u]) ds,

and transmits the traction {t} − τ [u]. The exact solution has no jump and the traction σ n, so that the method is
consistent: it converges with the size and the order of cells to the solution of the continuum, and no bond stiffness
has to be chosen. Π is half a sum of squares,

    Π = ½ ∫ (τ [u − {t}/τ]² − {t}²/τ) ds,

the form in which faces are added to the equations: springs of stiffness τ and of −1/τ, at the p + 1 Gauss points of a
face.

Energies stay positive if τ > λ/2, with λ the largest possible ratio of ∫ |σ n|² ds on the bonded faces of a cell to its
∫ σ:ε dA. It is an eigenvalue, computed for each cell; τ is twice the larger λ of both cells.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...compiled import UNCOUNTED, kept
from ...model import JointLaw, State
from ..kinematics.midpoint_configuration import MidpointConfiguration
from ..kinematics.polygon_quadrature import gauss_points
from ..kinematics.tolerances import LITTLE, NOTABLE
from ..open_close.contact_set import ContactSet
from .crack_softening import SoftenedBlock
from .deflected_blocks import DeflectedBlocks, rotation_of, strain_turned_back
from .deflection_basis import n_deflections
from .face_points import Faces
from .six_row_system import SixRowPattern, add_force, add_pair, moved

#: τ over the larger λ of the two cells; above a half is stable. Displacements of a cantilever of cells hardly change
#: from 1 to 10 (`tests/dda/higher_order/test_glued_cells.py`).
PENALTY = 2.0


def traction_of(normal: np.ndarray) -> np.ndarray:
    """(n, 2, 3) M: maps stress (σxx, σyy, σxy) to the normal and shear traction on a face with unit ``normal`` (n,
    2)."""
    x, y = normal[:, 0], normal[:, 1]
    return np.stack(
        [np.stack([x * x, y * y, 2 * x * y], axis=1), np.stack([-x * y, x * y, x * x - y * y], axis=1)], axis=1
    )


def _face_directions(normal: np.ndarray) -> np.ndarray:
    """(n, 2, 2) directions normal to and along faces."""
    return np.stack([normal, np.stack([-normal[:, 1], normal[:, 0]], axis=1)], axis=1)


def _turned(outline: np.ndarray, angle: float) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2, 3 + m) and (n, 2): R and r₀ of an ``outline`` (n, 2, 4 + m) in the axes of a block turned by ``angle``, on fixed
    axes."""
    turned = rotation_of(np.array(angle)) @ outline
    # σ' = Q⁻ᵀ σ, as σ·ε is the same on both axes.
    back = np.linalg.inv(strain_turned_back(np.array(angle))).T
    return np.concatenate([turned[..., :3] @ back, turned[..., 3:-1]], axis=2), turned[..., -1]


@dataclass(frozen=True, eq=False)
class GluedFaces:
    """The bonded faces (m,) of ``cells`` and their Gauss points (n,).

    block, other  (m,)    the cells a and b
    face          (n,)    of each point
    points        (n, 2) twice  undeformed, on a and on b, m
    normal        (n, 2)  undeformed, out of a
    weight        (n,)    m
    penalty       (n,)    τ, Pa/m
    """

    cells: DeflectedBlocks
    block: np.ndarray
    other: np.ndarray
    face: np.ndarray
    points: tuple[np.ndarray, np.ndarray]
    normal: np.ndarray
    weight: np.ndarray
    penalty: np.ndarray

    @classmethod
    def of(cls, cells: DeflectedBlocks) -> GluedFaces:
        """The faces in ``cells.glued``."""
        blocks = cells.blocks
        edge, mate = np.asarray(blocks.glued, np.int64).reshape(-1, 2).T
        block, other = blocks.vertex_block[edge], blocks.vertex_block[mate]
        start = blocks.vertices[edge]
        along = blocks.vertices[blocks.next_vertex[edge]] - start
        count = np.maximum(cells.order[block], cells.order[other]) + 1
        rules = {n: gauss_points(n) for n in np.unique(count).tolist()}
        face = np.repeat(np.arange(len(edge)), count)
        place = np.concatenate([rules[n][0] for n in count.tolist()])
        length = np.hypot(*along.T)
        normal = np.stack([along[:, 1], -along[:, 0]], axis=1) / length[:, None]
        # The corners of both cells coincide, unless in-situ stress has moved the cells to rest.
        far = blocks.vertices[blocks.next_vertex[mate]]
        opposite = far[face] + place[:, None] * (blocks.vertices[mate] - far)[face]
        faces = cls(
            cells, block, other, face, (start[face] + place[:, None] * along[face], opposite), normal[face],
            np.concatenate([rules[n][1] for n in count.tolist()]) * length[face], np.zeros(len(face)),
        )  # fmt: skip
        steepest = faces._steepest()
        faces.penalty[:] = PENALTY * np.maximum(steepest[block], steepest[other])[face]
        return faces

    def kept(self, keep: np.ndarray) -> GluedFaces:
        """The faces for which ``keep`` (m,) is True."""
        number, some = np.cumsum(keep) - 1, keep[self.face]
        return replace(
            self, block=self.block[keep], other=self.other[keep], face=number[self.face[some]],
            points=(self.points[0][some], self.points[1][some]), normal=self.normal[some], weight=self.weight[some], penalty=self.penalty[some],
        )  # fmt: skip

    @property
    def owners(self) -> tuple[np.ndarray, np.ndarray]:
        """Two (n,) arrays: the cells a and b of each point."""
        return self.block[self.face], self.other[self.face]

    def _steepest(self) -> np.ndarray:
        """(n_blocks,) λ, Pa/m; 0 for blocks without bonded faces."""
        from scipy.linalg import eigh

        cells, out = self.cells, np.zeros(len(self.cells.order))
        across = traction_of(self.normal)
        both = np.concatenate(self.owners)
        rows = np.argsort(both, kind="stable")
        first = np.searchsorted(both[rows], np.arange(len(out) + 1))
        for b in np.unique(both).tolist():
            some = rows[first[b] : first[b + 1]] % len(self.face)
            m = int(n_deflections(int(cells.order[b])))
            strain = np.zeros((len(some), 3, 3 + m))
            strain[:, :, :3] = np.eye(3)
            strain[:, :, 3:] = cells.basis.strain(self.points[0][some], b)[..., :m]
            traction = across[some] @ cells.elastic[b] @ strain
            on_faces = np.einsum("n,nwi,nwj->ij", self.weight[some], traction, traction)
            inside = np.zeros((3 + m, 3 + m))
            inside[:3, :3] = cells.basis.area[b] * cells.elastic[b]
            inside[3:, 3:] = cells.stiffness[b, :m, :m]
            out[b] = eigh(on_faces, inside, eigvals_only=True, subset_by_index=[2 + m, 2 + m])[0]
        return out

    def places(self, vertices: np.ndarray, angle: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Two (n, 2) arrays, m: current positions of the points on a and on b.

        ``vertices`` are the strained ones, ``angle`` (n_blocks,) rotations and ``q`` (k,) deflections.
        """
        blocks, padded = self.cells.blocks, self.cells.padded(q)
        mean = blocks.mean_vertices(vertices)
        reference, weights = blocks.affine_fit
        arm = vertices - mean[blocks.vertex_block]
        gradient = np.add.reduceat(arm[:, :, None] * weights[:, None, :], blocks.vertex_start[:-1], axis=0)
        out = []
        for owner, points in zip(self.owners, self.points, strict=True):
            at = mean[owner] + np.einsum("nab,nb->na", gradient[owner], points - reference[owner])
            bent = self.cells.directions(points, owner, angle)
            out.append(at + np.einsum("naj,nj->na", bent, padded[owner]))
        return out[0], out[1]


@dataclass(frozen=True, eq=False)
class Glue:
    """The bonds of cells in one step: 2 n springs, those of τ and those of −1/τ, in normal and shear direction.

    faces    `GluedFaces`
    vectors  (2 n, 2, 2, w)  direction, side, per unit of all unknowns of the side's cell: of u − {t}/τ (m), and {t} (Pa)
    springs  (2 n,)          stiffness times length, and −1/τ times length
    before   (2 n, 2)        elongation at the start of the step
    acting   (n, 2, 2)       directions normal to and along faces, in which they act
    cracked  (2 n, 2)        elongation in the step by cracks that open in cells that do not move
    """

    faces: GluedFaces
    vectors: np.ndarray
    springs: np.ndarray
    before: np.ndarray
    acting: np.ndarray
    cracked: np.ndarray

    @classmethod
    def of(
        cls, faces: GluedFaces, state: State, vertices: np.ndarray, deflections: tuple[np.ndarray, np.ndarray],
        midpoint: MidpointConfiguration, turn: np.ndarray, softened: Sequence[SoftenedBlock] = (),
    ) -> Glue:  # fmt: skip
        """The bonds of cells in ``state`` with these ``deflections``: (k,) all, and (k,) those that strain the cells, of which
        some are ``softened`` by cracks.

        Forces act at the ``midpoint`` configuration, to which cells have rotated by ``turn`` (n_blocks,).
        """
        cells, owners, n = faces.cells, faces.owners, len(faces.face)
        start, angle = state.rotation, state.rotation + turn
        q, strained = deflections
        size, padded = np.sqrt(midpoint.moments[:, 0]), cells.padded(strained)

        def normal(at: np.ndarray) -> np.ndarray:
            return np.einsum("nab,nb->na", rotation_of(0.5 * (at[owners[0]] + at[owners[1]])), faces.normal)

        first, second = faces.places(vertices, start, q)
        begun, acting = normal(start), _face_directions(normal(angle))
        between = 0.5 * (midpoint.points(first, owners[0]) + midpoint.points(second, owners[1]))
        jump, mean = np.zeros((n, 2, 2, max(cells.width, 6))), np.zeros((n, 2, 2, max(cells.width, 6)))
        apart = np.einsum("nwa,na->nw", _face_directions(begun), first - second)
        borne, pulled, opened = np.zeros((3, n, 2))
        for side, (owner, sign) in enumerate(zip(owners, (1.0, -1.0), strict=True)):
            matrix = midpoint.displacement(between, owner)
            matrix[..., 2:] /= size[owner, None, None]
            bent = cells.directions(faces.points[side], owner, angle)
            m = bent.shape[2]
            jump[:, :, side, :6] = sign * acting @ matrix
            jump[:, :, side, 6 : 6 + m] = sign * acting @ bent
            elastic, across = cells.elastic[owner], traction_of(begun)
            turned = np.einsum("nba,nb->na", rotation_of(start[owner]), begun)
            own = traction_of(turned) @ elastic @ cells.basis.strain(faces.points[side], owner)
            mean[:, :, side, 3:6] = 0.5 * across @ elastic / size[owner, None, None]
            mean[:, :, side, 6 : 6 + m] = 0.5 * own
            borne += 0.5 * (
                np.einsum("nws,ns->nw", across, state.stress[owner]) + np.einsum("nwj,nj->nw", own, padded[owner])
            )
            for of in softened:
                at, m = np.flatnonzero(owner == of.block), len(of.begun) - 3
                units = np.concatenate([across[at], of.size * own[at, :, :m] @ cells.flexibility[of.block]], axis=2)
                mean[at, :, side, 3 : 6 + m] = 0.5 * units @ of.tangent / of.size
                pulled[at] += 0.5 * units @ (of.still - of.begun)
                if of.outline is not None:
                    moves, rest = _turned(of.outline.at(faces.points[side][at]), float(start[of.block]))
                    along, more = sign * acting[at], of.still - of.begun
                    jump[at, :, side, 3 : 6 + m] += along @ moves @ of.tangent / of.size
                    opened[at] += np.einsum("nwa,na->nw", along, moves @ more)
                    apart[at] += sign * np.einsum("nwa,na->nw", _face_directions(begun[at]), moves @ of.begun + rest)
        give = 1.0 / faces.penalty
        return cls(
            faces, np.concatenate([jump - give[:, None, None, None] * mean, mean]),
            np.concatenate([faces.penalty, -give]) * np.tile(faces.weight, 2),
            np.concatenate([apart - give[:, None] * borne, borne]), acting,
            np.concatenate([opened - give[:, None] * pulled, pulled]),
        )  # fmt: skip

    def blocks(self, order: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As in `six_row_system.fill`."""
        one, two = self.faces.owners
        return np.tile(one, 2), np.tile(two, 2), order

    def push(self, right: np.ndarray, pattern: SixRowPattern, weight: float) -> None:
        """Add the bond forces at the start of the step, and those of cells that do not move times ``weight``, to ``right``
        (6 n,)."""
        push_springs(
            right,
            self.blocks(pattern.order),
            pattern.unknowns,
            self.vectors,
            self.springs[:, None] * (self.before + weight * self.cracked),
        )

    def stiffen(self, data: np.ndarray, pattern: SixRowPattern, n_contacts: int, weight: float) -> None:
        """Add the bond stiffness, times ``weight``, to the flat matrix ``data``; in ``pattern`` bonded faces follow
        ``n_contacts`` contacts."""
        at = n_contacts + np.tile(self.faces.face, 2)
        stiffen_springs(
            data, pattern.places, pattern.step, at, self.blocks(pattern.order), self.vectors, weight * self.springs
        )

    def change(self, unknowns: np.ndarray, pattern: SixRowPattern) -> np.ndarray:
        """(2 n, 2) elongation of the springs due to all ``unknowns`` (6 n,) of the step."""
        return self.cracked + moved(unknowns, self.blocks(pattern.order), pattern.unknowns, self.vectors)

    def forces(self, change: np.ndarray, n_blocks: int) -> np.ndarray:
        """(n_blocks, 6) N: bond forces on the solver's first six unknowns after the elongation ``change`` (2 n, 2)."""
        out, push = np.zeros((n_blocks, 6)), -self.springs[:, None] * (self.before + change)
        for side, owner in enumerate(self.faces.owners):
            np.add.at(out, np.tile(owner, 2), np.einsum("nw,nwj->nj", push, self.vectors[:, :, side, :6]))
        return out

    def energy(self, change: np.ndarray | float = 0.0) -> float:
        """Energy, J/m, after the elongation ``change`` (2 n, 2)."""
        return 0.5 * float((self.springs[:, None] * (self.before + change) ** 2).sum())

    def work(self, change: np.ndarray, weight: float) -> float:
        """Work, J/m, done against the bonds in a step with the elongation ``change`` (2 n, 2) and forces at this
        ``weight`` of the step."""
        return float((self.springs[:, None] * (self.before + weight * change) * change).sum())

    def traction(self, change: np.ndarray) -> np.ndarray:
        """(n, 2) Pa: tension and shear at the points after the elongation ``change`` (2 n, 2)."""
        n = len(self.faces.face)
        return -self.faces.penalty[:, None] * (self.before + change)[:n]

    def traction_on_cells(self, change: np.ndarray) -> np.ndarray:
        """(n, 2) Pa: `traction` on the cells a, in fixed axes."""
        return np.einsum("nw,nwa->na", self.traction(change), self.acting)

    def mean_traction(self, change: np.ndarray) -> np.ndarray:
        """(m, 2) Pa: mean `traction` on each face."""
        faces, out = self.faces, np.zeros((len(self.faces.block), 2))
        np.add.at(out, faces.face, faces.weight[:, None] * self.traction(change))
        return out / np.bincount(faces.face, faces.weight, len(out))[:, None]


@dataclass(frozen=True, eq=False)
class GlueStrength:
    """Strength of the bonded faces (m,) of cells: ``tension`` and ``cohesion``, Pa, and ``friction`` (tangent);
    infinite for faces that cannot separate."""

    tension: np.ndarray
    cohesion: np.ndarray
    friction: np.ndarray

    @classmethod
    def of(cls, laws: list[JointLaw | None]) -> GlueStrength:
        """Strength of faces with these ``laws``, None for faces that cannot separate. Raises ValueError for a law
        without tensile strength."""
        weak = next((law for law in laws if law is not None and not law.tensile_strength > 0), None)
        if weak is not None:
            raise ValueError(f"cells cannot separate along the joint {weak.name!r}: it has no tensile strength")
        given = [
            (np.inf, np.inf, 0.0) if law is None else (law.tensile_strength, law.cohesion, law.friction) for law in laws
        ]
        tension, cohesion, friction = np.array(given).reshape(-1, 3).T
        with np.errstate(divide="ignore", invalid="ignore"):
            tip = np.where(friction > 0, cohesion / friction, np.inf)
        return cls(np.minimum(tension, tip), cohesion, friction)

    @property
    def any(self) -> bool:
        """Whether any face can separate."""
        return bool(np.isfinite(self.tension).any())

    def parting(self, parted: np.ndarray, left: np.ndarray, mean: np.ndarray) -> np.ndarray | None:
        """(m,) faces that have ``parted`` or do so under the ``mean`` traction (n, 2) of those ``left`` (n,); None if no
        further one does.

        Of the others, those separate whose stress exceeds their strength and is nearly the highest relative to it.
        """
        pull, shear = mean[:, 0], np.abs(mean[:, 1])
        shear_strength = self.cohesion[left] - np.minimum(pull, self.tension[left]) * self.friction[left]
        share = np.maximum(pull / self.tension[left], shear / np.maximum(shear_strength, 1e-300))
        if not len(share) or not share.max() > 1.0:
            return None
        out = parted.copy()
        out[left[share > max(1.0, (1.0 - NOTABLE) * share.max())]] = True
        return out


@dataclass(frozen=True, eq=False)
class KeptCorners:
    """Selects contacts at corners: a cell that meets another block only at a corner where a face of a neighbouring cell
    ends is left out, because rock carries its stress through faces, however it is divided into cells.

    ``joined`` (k,): a · n_blocks + b of cells a < b that meet.
    """

    cells: DeflectedBlocks
    joined: np.ndarray

    def __call__(self, found: ContactSet) -> np.ndarray:
        """(k,) of the contacts ``found`` at corners."""
        from scipy.spatial import cKDTree

        faces, n, area = Faces.of(found, self.cells.order), len(self.cells.order), self.cells.basis.area
        ends, drop = faces.ends.ravel(), np.zeros(len(found), bool)
        if not len(ends):
            return np.arange(len(found))
        size = np.sqrt(np.minimum(area[found.block], area[found.other]))
        both, place = np.stack([found.block, found.other], axis=1), found.geometry[:, 5:7]
        tree = cKDTree(place[ends])
        for c in faces.lone.tolist():
            for e in ends[tree.query_ball_point(place[c], LITTLE * size[c])].tolist():
                for end, other_end in ((0, 0), (0, 1), (1, 0), (1, 1)):
                    a, b = int(both[c, end]), int(both[e, other_end])
                    if both[c, 1 - end] == both[e, 1 - other_end] and _is_in(min(a, b) * n + max(a, b), self.joined):
                        drop[c] = True
        return np.flatnonzero(~drop)


def _is_in(value: int, ascending: np.ndarray) -> bool:
    """Whether ``value`` is one of the ``ascending`` (n,)."""
    at = int(np.searchsorted(ascending, value))
    return at < len(ascending) and int(ascending[at]) == value


_jit = kept(fastmath={"contract"}, error_model="numpy", nogil=True)


@kept(fastmath={"contract"}, error_model="numpy", nogil=True, **UNCOUNTED)
def push_springs(right, blocks, unknowns, vectors, force):
    """Subtract the normal and shear ``force`` (n, 2) of each spring from ``right``."""
    block, other, order = blocks
    unknown, at, size = unknowns
    for c in range(len(block)):
        for side in range(2):
            b = block[c] if side == 0 else other[c]
            if order[b] >= 0:
                add_force(right, unknown, at[b], size[b], vectors[c, :, side], -force[c, 0], -force[c, 1])


@_jit
def stiffen_springs(data, places, step, at, blocks, vectors, springs):
    """Add ``springs`` (n,), of equal normal and shear stiffness, to the flat matrix; ``at`` (n,) are pairs of the
    pattern."""
    where, own_at, upper, lower, size = places
    block, other, order = blocks
    given = np.empty((2, 2, vectors.shape[3]))
    for c in range(len(block)):
        for side in range(2):
            for way in range(2):
                for a in range(vectors.shape[3]):
                    given[side, way, a] = springs[c] * vectors[c, way, side, a]
        i, j, pair = block[c], other[c], at[c]
        one, two = vectors[c, :, 0], vectors[c, :, 1]
        if order[i] >= 0:
            add_pair(data, where, own_at[i], step, size[i], size[i], given[0], one)
        if order[j] >= 0:
            add_pair(data, where, own_at[j], step, size[j], size[j], given[1], two)
        if order[i] >= 0 and order[j] >= 0:
            add_pair(data, where, upper[pair], step, size[i], size[j], given[0], two)
            add_pair(data, where, lower[pair], step, size[j], size[i], given[1], one)
