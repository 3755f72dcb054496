"""Blocks of higher order: inertia, stiffness and loads of their deflection.

With the mean strain rates ε̇ and the deflection q of one block (`deflection_basis`), in the frame that rotates with it,

    kinetic energy  ½ ρ (A q̇² + 2 ε̇ᵀ Q G q̇),   elastic energy  ½ qᵀ K q,   work  ∫ tᵀ R P dq ds,

in addition to those of its first six unknowns; G = ∫ (∂u/∂ε)ᵀ P dA, and Q transforms strains to the block's frame.
Weight does no work on deflection. A block that rotates at the angular velocity ω is bent by centrifugal forces, ρ ω²
(G₁ + G₂).
"""

from __future__ import annotations

import logging
from functools import cached_property

import numpy as np

from ...model import HIGHEST_ORDER, Blocks, InSituStress, State
from ..kinematics.polygon_quadrature import gauss_points, polygon_points
from ..open_close.contact_set import ContactSet
from ..results import NotConverged
from .deflection_basis import DeflectionBasis, n_deflections

log = logging.getLogger(__name__)

#: Slope or strain of a block's outline due to deflection, rad: above the first, small-displacement theory is in error
#: by a thousandth and the block is reported; above the second the run ends.
LARGE, TOO_LARGE = 0.05, 0.5


def rotation_of(angle: np.ndarray) -> np.ndarray:
    """(n, 2, 2) rotation matrices of ``angle`` (n,) rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)


def strain_turned_back(angle: np.ndarray) -> np.ndarray:
    """(n, 3, 3) Q: maps strains (εx, εy, γxy) on fixed axes to axes rotated by ``angle`` (n,) rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack(
        [
            np.stack([c * c, s * s, s * c], axis=-1),
            np.stack([s * s, c * c, -s * c], axis=-1),
            np.stack([-2 * s * c, 2 * s * c, c * c - s * s], axis=-1),
        ],
        axis=-2,
    )


class DeflectedBlocks:
    """The ``blocks`` of a system, some of which have an order above 1; ``order`` (n_blocks,) is 1 where they do not
    bend.

    ``rows`` (n_blocks,) of six unknowns each, 0 for ``fixed`` blocks; ``elastic`` (n_blocks, 3, 3) Pa of
    the undeformed blocks. The order is that of the ``blocks`` unless another is given.
    """

    def __init__(self, blocks: Blocks, fixed: np.ndarray, elastic: np.ndarray, order: np.ndarray | None = None) -> None:
        self.blocks = blocks
        self.order = np.where(fixed, 1, np.asarray(blocks.order if order is None else order)).astype(np.int64)
        self.basis = DeflectionBasis.of(blocks.vertices, blocks.next_vertex, blocks.vertex_start, self.order)
        self.rows = np.where(fixed, 0, 1 + -(-n_deflections(self.order) // 6)).astype(np.int64)
        self.bending = np.flatnonzero(self.order > 1)
        self.elastic = elastic
        #: (n_blocks,) m/s²: mean acceleration of deflection in the last step.
        self.acceleration = np.zeros(blocks.n_blocks)
        #: Largest slope of a deflection that has been reported.
        self.reported = 0.0
        #: Length of a contact's row for one block.
        self.width = 6 * int(self.rows.max(initial=1))
        end = blocks.vertices[blocks.next_vertex]
        most = self.basis.coupling.shape[2]
        #: (n_blocks, m, m) K, Pa, padded with zeros.
        self.stiffness = np.zeros((blocks.n_blocks, most, most))
        for b in self.bending.tolist():
            some = slice(blocks.vertex_start[b], blocks.vertex_start[b + 1])
            own = self.basis.stiffness(b, blocks.vertices[some], end[some], elastic[b])
            self.stiffness[b, : len(own), : len(own)] = own
        #: (k,) the block of each unknown, and its number within the block.
        self.owner = np.repeat(np.arange(blocks.n_blocks), np.diff(self.basis.start))
        self.which = np.arange(self.n_unknowns) - self.basis.start[self.owner]
        self._sizes = np.where(fixed, 0, 6 + n_deflections(self.order)).astype(np.int64)
        self.take_out(None)

    @property
    def n_unknowns(self) -> int:
        return self.basis.n_unknowns

    def take_out(self, removed: np.ndarray | None) -> None:
        """Continue without the blocks ``removed`` (n_blocks,): they keep their unknowns in all arrays, but have no
        equations."""
        #: (n_blocks,) number of unknowns of each block; 0 for blocks that are fixed or not there.
        self.sizes = self._sizes if removed is None else np.where(removed, 0, self._sizes)
        #: The unknowns of blocks that are there.
        self.present = np.arange(self.n_unknowns) if removed is None else np.flatnonzero(~removed[self.owner])

    def at_rest(self) -> np.ndarray:
        """(k, 2) zero deflection and rate."""
        return np.zeros((self.n_unknowns, 2))

    def origin(self, state: State) -> np.ndarray:
        """(k, 2) m: deflections of ``state`` at which blocks bear their mean stress alone, and from which displacements
        count."""
        known = state.deflection_origin
        return self.at_rest() if known is None else np.asarray(known)

    def elastic_part(self, state: State) -> np.ndarray:
        """(k,) m: deflections of ``state`` that strain the rock beyond its mean stress: without that at which blocks bear
        this alone, and without that of their cracks."""
        out = self.at_rest()[:, 0] if state.deflection is None else state.deflection[:, 0]
        for part in (
            None if state.deflection_origin is None else state.deflection_origin[:, 0],
            state.crack_deflection,
        ):
            out = out if part is None else out - part
        return out

    def generalised_compliance(self, block: int, compliance: np.ndarray) -> np.ndarray:
        """(3 + m, 3 + m) D⁻¹ of ``block``, 1/Pa, whose mean strain has this ``compliance`` (3, 3)
        (`crack_softening`)."""
        m = n_deflections(int(self.order[block]))
        out = np.zeros((3 + m, 3 + m))
        out[:3, :3], out[3:, 3:] = compliance, self.flexibility[block]
        return out

    @cached_property
    def flexibility(self) -> dict[int, np.ndarray]:
        """block → K⁻¹ (m, m), 1/Pa."""
        sizes = {b: n_deflections(int(self.order[b])) for b in self.bending.tolist()}
        inverse = {b: np.linalg.inv(self.stiffness[b, :m, :m]) for b, m in sizes.items()}
        return {b: 0.5 * (one + one.T) for b, one in inverse.items()}

    def padded(self, values: np.ndarray) -> np.ndarray:
        """(n_blocks, m) the unknowns ``values`` (k,) of all blocks, padded with zeros."""
        out = np.zeros((len(self.order), self.basis.coupling.shape[2]))
        out[self.owner, self.which] = values
        return out

    def material_points(self, vertices: np.ndarray, points: np.ndarray, owner: np.ndarray) -> np.ndarray:
        """(n, 2) undeformed positions of ``points`` (n, 2) of the blocks ``owner`` (n,), m.

        ``vertices`` (n_vertices, 2) are those of the strained, undeflected blocks.
        """
        blocks = self.blocks
        reference, weights = blocks.affine_fit
        mean = blocks.mean_vertices(vertices)
        start = blocks.vertex_start[:-1]
        arm = vertices - mean[blocks.vertex_block]
        gradient = np.add.reduceat(arm[:, :, None] * weights[:, None, :], start, axis=0)
        back = np.linalg.inv(gradient)
        return reference[owner] + np.einsum("nab,nb->na", back[owner], points - mean[owner])

    def touching(self, found: ContactSet, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Two (n, 2) arrays: undeformed positions, on the vertices' blocks and on the edges', of the contacts ``found``
        (n,).

        ``vertices`` (n_vertices, 2) are the strained ones, m.
        """
        geometry = found.geometry
        foot = geometry[:, 5:7] - geometry[:, 3:4] * geometry[:, 1:3]
        return (
            self.material_points(vertices, geometry[:, 5:7], found.block),
            self.material_points(vertices, foot, found.other),
        )

    def gaps(self, found: ContactSet, vertices: np.ndarray, state: State) -> np.ndarray:
        """(n,) m: contribution of the deflections of ``state`` to the gaps of the contacts ``found``, where the blocks have
        the strained ``vertices``."""
        if state.deflection is None or not len(found):
            return np.zeros(len(found))
        touching, normal = self.touching(found, vertices), found.geometry[:, 1:3]
        return self.apart(normal, found, touching, state.rotation, state.deflection[:, 0])

    def apart(
        self, normal: np.ndarray, found: ContactSet, touching: tuple[np.ndarray, np.ndarray], angle: np.ndarray,
        q: np.ndarray,
    ) -> np.ndarray:  # fmt: skip
        """(n,) m: by how much deflections ``q`` (k,) move the blocks of the contacts ``found`` apart along ``normal`` (n, 2),
        rotated by ``angle`` (n_blocks,); ``touching`` as from that function."""
        padded, out = self.padded(q), np.zeros(len(found))
        for owner, points, sign in zip((found.block, found.other), touching, (1.0, -1.0), strict=True):
            matrix = self.directions(points, owner, angle)
            out += sign * np.einsum("na,naj,nj->n", normal, matrix, padded[owner], optimize=True)
        return out

    def directions(self, points: np.ndarray, owner: np.ndarray, angle: np.ndarray) -> np.ndarray:
        """R P (n, 2, m) at undeformed ``points`` (n, 2) of blocks ``owner`` (n,) rotated by ``angle`` (n_blocks,)."""
        return np.einsum("nab,nbj->naj", rotation_of(angle[owner]), self.basis.displacement(points, owner))

    @cached_property
    def _outline(self) -> tuple[np.ndarray, np.ndarray]:
        """P (n, k, 2, m) at k undeformed points of n edges of bending blocks, their ends included, and the blocks
        (n,)."""
        blocks = self.blocks
        some = np.flatnonzero(self.order[blocks.vertex_block] > 1)
        at = np.linspace(0.0, 1.0, HIGHEST_ORDER + 1)
        start, end = blocks.vertices[some], blocks.vertices[blocks.next_vertex[some]]
        points = start[:, None] + at[:, None] * (end - start)[:, None]
        owner = blocks.vertex_block[some]
        matrix = self.basis.displacement(points.reshape(-1, 2), np.repeat(owner, len(at)))
        return matrix.reshape(len(some), len(at), 2, -1), owner

    def largest(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Two (n_blocks,) arrays, m: largest displacement of the outline due to deflections ``q`` (k,), and largest
        distance of an edge from the straight line between its ends."""
        out, sag = np.zeros(len(self.order)), np.zeros(len(self.order))
        if q.any():
            matrix, owner = self._outline
            moved = np.einsum("nkaj,nj->nka", matrix, self.padded(q)[owner])
            np.maximum.at(out, owner, np.hypot(moved[..., 0], moved[..., 1]).max(axis=1))
            at = np.linspace(0.0, 1.0, moved.shape[1])[:, None]
            off = moved - (moved[:, :1] + at * (moved[:, -1:] - moved[:, :1]))
            np.maximum.at(sag, owner, np.hypot(off[..., 0], off[..., 1]).max(axis=1))
        return out, sag

    def corners(self, vertices: np.ndarray, angle: np.ndarray, q: np.ndarray) -> np.ndarray:
        """(n_vertices, 2) m: corners of blocks with deflections ``q`` (k,), from their strained ``vertices``, for
        rotations ``angle`` (n_blocks,)."""
        if not q.any():
            return vertices
        some = np.flatnonzero(self.order[self.blocks.vertex_block] > 1)
        matrix, owner = self._outline
        out = vertices.copy()
        out[some] += np.einsum("nab,nbj,nj->na", rotation_of(angle[owner]), matrix[:, 0], self.padded(q)[owner])
        return out

    @cached_property
    def _slopes(self) -> tuple[np.ndarray, np.ndarray]:
        """∇P (n, 4, m) at the ends and midpoints of all edges of bending blocks, and the blocks (n,)."""
        blocks = self.blocks
        some = np.flatnonzero(self.order[blocks.vertex_block] > 1)
        start, end = blocks.vertices[some], blocks.vertices[blocks.next_vertex[some]]
        owner = np.concatenate([blocks.vertex_block[some]] * 2)
        return self.basis.gradient(np.concatenate([start, 0.5 * (start + end)]), owner), owner

    def check_small(self, state: State) -> None:
        """Check that the deflections of ``state`` are small.

        Logs a warning that names a block where deflection rotates or strains its outline by more than `LARGE`, again
        each time the value has doubled; raises `NotConverged` above `TOO_LARGE`.
        """
        if state.deflection is None or not state.deflection[:, 0].any():
            return
        matrix, owner = self._slopes
        slope = np.abs(np.einsum("ngj,nj->ng", matrix, self.padded(state.deflection[:, 0])[owner])).max(axis=1)
        worst = int(slope.argmax())
        most, name = float(slope[worst]), repr(self.blocks.names[owner[worst]])
        if most > TOO_LARGE:
            raise NotConverged(
                f"{name} is bent by {most:.3g} rad at t = {state.time:g} s, too much for small-displacement "
                "theory: its loads are too large for its stiffness, or it must be drawn as several blocks"
            )
        if most > LARGE and most >= 2.0 * self.reported:
            self.reported = most
            log.warning(
                "t = %g s: %s is bent by %.2g rad; small-displacement theory is in error by about half the "
                "square of that: draw it as several blocks",
                state.time, name, most,
            )  # fmt: skip

    def deflection_of(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """As `largest`, for the deflections of ``state``."""
        return self.largest(self.at_rest()[:, 0] if state.deflection is None else state.deflection[:, 0])

    def loads(self, points: np.ndarray, edges: np.ndarray, vertices: np.ndarray, angle: np.ndarray) -> np.ndarray:
        """(n_blocks, m) generalised forces, N, of POINT_FORCE rows ``points`` and EDGE_FORCE rows ``edges``.

        The blocks have these strained ``vertices`` and are rotated by ``angle`` (n_blocks,).
        """
        out = np.zeros((len(self.order), self.basis.coupling.shape[2]))
        points, edges = points[self.order[points["block"]] > 1], edges[self.order[edges["block"]] > 1]
        if len(points):
            matrix = self.directions(np.ascontiguousarray(points["at"]), points["block"], angle)
            np.add.at(out, points["block"], np.einsum("na,naj->nj", points["force"], matrix))
        if len(edges):
            at, weight = gauss_points((HIGHEST_ORDER + 5) // 2)
            start, along = edges["start"][:, None], (edges["end"] - edges["start"])[:, None]
            where = start + at[:, None] * along
            length = np.hypot(along[..., 0], along[..., 1])
            first, second = edges["traction"][:, :1], edges["traction"][:, 1:]
            force = (first + at[:, None] * (second - first)) * (length * weight)[..., None]
            owner = np.repeat(edges["block"], len(at))
            undeformed = self.material_points(vertices, where.reshape(-1, 2), owner)
            matrix = self.directions(undeformed, owner, angle)
            np.add.at(out, owner, np.einsum("na,naj->nj", force.reshape(-1, 2), matrix))
        return out

    def under(self, stress: InSituStress) -> np.ndarray:
        """(k,) m: deflections that give unrotated blocks the ``stress`` that is left of its mean.

        They solve K q = ∫ ε(P)ᵀ σ dA. The strain of a stress linear in the coordinates is linear and therefore
        compatible: from order 2 on the stress is exact.
        """
        blocks, out = self.blocks, np.zeros(self.n_unknowns)
        end = blocks.vertices[blocks.next_vertex]
        for b in self.bending.tolist():
            some, m = slice(blocks.vertex_start[b], blocks.vertex_start[b + 1]), n_deflections(int(self.order[b]))
            points, weights = polygon_points(
                blocks.vertices[some], end[some], self.basis.centroid[b], int(self.order[b])
            )
            strain = self.basis.strain(points, b)[..., :m]
            beyond = stress.at(points) - stress.at(self.basis.centroid[b])
            force = np.einsum("n,nsj,ns->j", weights, strain, beyond)
            out[self.basis.of_block(b)] = np.linalg.solve(self.stiffness[b, :m, :m], force)
        return out

    def stress_of(self, q: np.ndarray) -> np.ndarray:
        """(n, 3) Pa at the corners of bending blocks due to the deflections ``q`` (k,), in their frames."""
        slope, owner = self._slopes
        corners = len(owner) // 2
        slope, owner = slope[:corners], owner[:corners]
        strain = np.stack([slope[:, 0], slope[:, 3], slope[:, 1] + slope[:, 2]], axis=1)
        return np.einsum("nst,ntj,nj->ns", self.elastic[owner], strain, self.padded(q)[owner])

    def on_basis_of(self, moved: Blocks, q: np.ndarray) -> np.ndarray:
        """(k, …) the deflections ``q`` (k, …) on the basis of the same blocks with other vertices, ``moved``."""
        if not q.any():
            return q
        basis = DeflectionBasis.of(moved.vertices, moved.next_vertex, moved.vertex_start, self.order)
        end, out = moved.vertices[moved.next_vertex], np.zeros_like(q)
        for b in self.bending.tolist():
            some, own = slice(moved.vertex_start[b], moved.vertex_start[b + 1]), basis.of_block(b)
            m = n_deflections(int(self.order[b]))
            points, weights = polygon_points(moved.vertices[some], end[some], basis.centroid[b], 2 * int(self.order[b]))
            was = self.material_points(moved.vertices, points, np.full(len(points), b))
            field = self.basis.displacement(was, b)[..., :m] @ q[own]
            own_basis = basis.displacement(points, b)[..., :m]
            out[own] = np.einsum("n,naj,na...->j...", weights, own_basis, field) / basis.area[b]
        return out

    def kinetic(self, rates: np.ndarray, strain_rates: np.ndarray, angle: np.ndarray, density: np.ndarray) -> float:
        """Kinetic energy, J/m, due to ``rates`` (k,) of deflection, including its coupling with ``strain_rates``
        (n_blocks, 3); blocks are rotated by ``angle`` (n_blocks,) and have this ``density`` (n_blocks,)."""
        q = self.padded(rates)
        shared = np.einsum("bi,bij,bjm,bm->b", strain_rates, self._shared(angle), self.basis.coupling, q, optimize=True)
        return float(density @ (0.5 * self.basis.area * (q * q).sum(axis=1) + shared))

    def elastic_energy(self, q: np.ndarray) -> float:
        """Elastic energy, J/m, of deflections ``q`` (k,)."""
        return 0.5 * float((self.padded(q) * self.stiffness_times(q)).sum())

    def stiffness_times(self, q: np.ndarray) -> np.ndarray:
        """(n_blocks, m) N: K q for deflections ``q`` (k,)."""
        return np.einsum("bij,bj->bi", self.stiffness, self.padded(q))

    def coupling(self, angle: np.ndarray) -> np.ndarray:
        """(n_blocks, 3, m) Qᵀ G of blocks rotated by ``angle`` (n_blocks,), m³."""
        return np.einsum("bij,bjm->bim", self._shared(angle), self.basis.coupling)

    @staticmethod
    def _shared(angle: np.ndarray) -> np.ndarray:
        return np.swapaxes(strain_turned_back(angle), 1, 2)
