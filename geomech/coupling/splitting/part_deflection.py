"""Deflection, its rate and stress in the parts of a split block of higher order.

The displacement of the whole is a complete polynomial, which each part can represent as well (`deflection_basis`): its
rigid motion and mean strain over the part move the vertices, velocity and rotation of the part, the remainder is the
part's deflection. Position, momentum and kinetic energy are those of before, but for squares of the deflection.

Two stresses of a part can be told: that of the whole block as its own unknowns have it, continued into the part, with
the elastic energy of the whole; and that of the last solution of its cracks, which is in equilibrium with the faces that
are free now (`part_mean_stress`). Deflection of which neither the part's stress nor its cracks are the cause is its
origin.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...conventions import rotate_stress
from ...dda.higher_order.deflected_blocks import DeflectedBlocks, rotation_of, strain_turned_back
from ...dda.higher_order.deflection_basis import DeflectionBasis, n_deflections
from ...dda.kinematics.displacement_matrix import displacement_matrix
from ...dda.kinematics.polygon_quadrature import polygon_points
from ...model import Blocks, State
from .block_splitting import Split
from .part_mean_stress import sampled_stress

if TYPE_CHECKING:
    from ...ddm import Solution

#: Names of the arrays of a state that have a row for each unknown of deflection.
_BY_UNKNOWN = ("deflection", "deflection_origin", "crack_deflection")


@dataclass(frozen=True, eq=False)
class PartStress:
    """Generalised stress (3 + m,), Pa (`dda.higher_order.crack_softening`), of a part: of the ``whole`` block in its
    region, and of the last ``solution``; mean stress on current axes."""

    whole: np.ndarray
    solution: np.ndarray


class _Region:
    """Part ``part`` of block ``block``, whose deflection has the basis ``old``, with its own basis ``new``."""

    def __init__(self, old: DeflectionBasis, block: int, new: DeflectionBasis, blocks: Blocks, part: int) -> None:
        self.old, self.block, self.new, self.part = old, block, new, part
        some = slice(int(blocks.vertex_start[part]), int(blocks.vertex_start[part + 1]))
        degree = int(old.order[block] + new.order[part])
        end = blocks.vertices[blocks.next_vertex[some]]
        self.points, self.weights = polygon_points(blocks.vertices[some], end, new.centroid[part], degree)
        self.arm = self.points - new.centroid[part]
        self.width = n_deflections(int(new.order[part]))
        width = n_deflections(int(old.order[block]))
        self._values = old.displacement(self.points, block)[..., :width]
        self._strains = old.strain(self.points, block)[..., :width]

    def parted(self, q: np.ndarray, moves: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Mean motion (6,) over the part, in Shi's unknowns about its centroid, and the deflection (m,) of the part, of the
        field with the deflection ``q`` of the whole. If it ``moves`` the part, the deflection is in the frame that the mean
        rotation turns."""
        weights, area = self.weights, self.weights.sum()
        field, strains = self._values @ q, self._strains @ q
        mean = weights @ strains / area
        x, y = self.arm.T
        field = field - np.column_stack([mean[0] * x + 0.5 * mean[2] * y, mean[1] * y + 0.5 * mean[2] * x])
        shift = weights @ field / area
        turn = float(weights @ (x * field[:, 1] - y * field[:, 0]) / (weights @ (x * x + y * y)))
        rest = field - shift - turn * np.column_stack([-y, x])
        rest = rest @ rotation_of(np.array(turn)) if moves else rest
        own = self.new.displacement(self.points, self.part)[..., : self.width]
        return np.concatenate([shift, [turn], mean]), np.einsum("n,naj,na->j", weights, own, rest) / area


def inherited_deflection(
    split: Split, begun: State, old: DeflectedBlocks, new: DeflectedBlocks, solutions: dict[int, Solution],
    compliance: np.ndarray,
) -> tuple[State, dict[int, PartStress]]:  # fmt: skip
    """The state of ``split`` with the deflections of ``begun``, the state before it, and the stress of each part that
    bends.

    ``old`` and ``new``: the blocks before and after the split; ``solutions`` (block →) of the last pass before it;
    ``compliance`` (n_blocks after, 3, 3) of the rock, 1/Pa."""
    blocks, parent, state = split.blocks, split.parent, split.state
    is_part = np.bincount(parent, minlength=len(old.order))[parent] > 1
    kept = _kept(begun, old, new, parent, is_part)
    vertices, velocity, rotation = state.vertices.copy(), state.velocity.copy(), state.rotation.copy()
    stresses: dict[int, PartStress] = {}
    for part in np.flatnonzero(is_part & (old.order[parent] > 1)).tolist():
        block, own = int(parent[part]), new.basis.of_block(part)
        was = old.basis.of_block(block)
        region = _Region(old.basis, block, new.basis, blocks, part)
        turn, some = rotation_of(begun.rotation[block]), blocks.vertex_block == part
        if begun.deflection is not None:
            moved, kept["deflection"][own, 0] = region.parted(begun.deflection[was, 0], True)
            rate, kept["deflection"][own, 1] = region.parted(begun.deflection[was, 1])
            vertices[some] += displacement_matrix(blocks.vertices[some], new.basis.centroid[part]) @ moved @ turn.T
            rotation[part] += moved[2]
            _add_rate(velocity[part], turn @ moved[:2], rate, float(begun.rotation[block]))
        if new.order[part] > 1:
            stresses[part] = _stress(split, begun, old, new, region, solutions.get(block), compliance[part])
    state = replace(
        state, vertices=vertices, velocity=velocity, rotation=rotation,
        face_points=_face_points(split, begun), **kept,
    )  # fmt: skip
    return state, stresses


def with_stress(
    state: State, blocks: DeflectedBlocks, part: int, rock: np.ndarray, stress: np.ndarray, opened: np.ndarray | None
) -> State:
    """``state`` with the generalised ``stress`` (3 + m,) of ``part``, of ``rock`` with the compliance (3 + m, 3 + m), and
    the strain ``opened`` (3 + m,) of its cracks (None: it has none)."""
    own, size = blocks.basis.of_block(part), float(np.sqrt(blocks.basis.area[part]))
    cracked = np.zeros(len(stress)) if opened is None else opened
    known = blocks.at_rest() if state.deflection is None else state.deflection
    origin = blocks.at_rest() if state.deflection_origin is None else state.deflection_origin.copy()
    by_cracks = np.zeros(blocks.n_unknowns) if state.crack_deflection is None else state.crack_deflection.copy()
    mean, strain = state.stress.copy(), state.crack_strain.copy()
    mean[part], strain[part], by_cracks[own] = stress[:3], cracked[:3], size * cracked[3:]
    origin[own, 0] = known[own, 0] - size * (rock[3:, 3:] @ stress[3:] + cracked[3:])
    return replace(
        state, stress=mean, crack_strain=strain, deflection=known, deflection_origin=origin, crack_deflection=by_cracks
    )


def _add_rate(velocity: np.ndarray, shift: np.ndarray, rate: np.ndarray, angle: float) -> None:
    """Add to the ``velocity`` (6,) of a part: what its centroid moves otherwise for being off by ``shift``, m, and the
    mean motion ``rate`` (6,) of the whole's deflection in the frame turned by ``angle``."""
    x, y = shift
    _, _, spin, xx, yy, shear = velocity
    velocity[0] += -spin * y + xx * x + 0.5 * shear * y
    velocity[1] += spin * x + yy * y + 0.5 * shear * x
    velocity[:2] += rotation_of(np.array(angle)) @ rate[:2]
    velocity[2] += rate[2]
    velocity[3:] += strain_turned_back(np.array(-angle)) @ rate[3:]


def _stress(
    split: Split, begun: State, old: DeflectedBlocks, new: DeflectedBlocks, region: _Region,
    solution: Solution | None, compliance: np.ndarray,
) -> PartStress:  # fmt: skip
    """The stresses of the part of a ``region``, whose rock has this ``compliance`` (3, 3)."""
    part, block, width = region.part, region.block, region.width
    angle, area = float(begun.rotation[block]), float(new.basis.area[part])
    mean = compliance @ rotate_stress(begun.stress[block], -angle)
    motion, bent = region.parted(old.elastic_part(begun)[old.basis.of_block(block)])
    stiffness, elastic = new.stiffness[part, :width, :width], new.elastic[part]
    whole = np.concatenate([rotate_stress(elastic @ (mean + motion[3:]), angle), stiffness @ bent / np.sqrt(area)])
    if solution is None:
        return PartStress(whole, whole)
    points, share, stress = sampled_stress(solution, split.blocks.loops(part))
    force = np.einsum("n,nsj,ns->j", share, new.basis.strain(points, part)[..., :width], stress)
    known = rotate_stress(share @ stress / share.sum(), angle)
    return PartStress(whole, np.concatenate([known, force / np.sqrt(area)]))


def _kept(
    begun: State, old: DeflectedBlocks, new: DeflectedBlocks, parent: np.ndarray, is_part: np.ndarray
) -> dict[str, Any]:
    """The arrays of ``begun`` by unknown of deflection, renumbered; zero in parts."""
    out = {}
    for name in _BY_UNKNOWN:
        known = getattr(begun, name)
        if known is None:
            continue
        values = np.zeros((new.n_unknowns, *np.shape(known)[1:]))
        for block in np.flatnonzero(~is_part & (new.order > 1)).tolist():
            values[new.basis.of_block(block)] = known[old.basis.of_block(int(parent[block]))]
        out[name] = values
    return out


def _face_points(split: Split, begun: State) -> np.ndarray | None:
    """FACE_POINT rows, renumbered, of faces whose sides have not been divided. Others continue with the resultants of
    their contacts."""
    if begun.face_points is None:
        return None
    owner, rows = split.blocks.vertex_block, begun.face_points
    vertex = _only_heir(split.vertex_origin, np.ones(len(owner), bool), rows)
    edge = _only_heir(split.edge_origin, (split.edge_span == [0.0, 1.0]).all(axis=1), rows)
    rows = rows.copy()
    for corner, side in (("vertex", "edge"), ("far_vertex", "far_edge")):
        rows[corner], rows[side] = vertex[rows[corner]], edge[rows[side]]
    known = (rows["vertex"] >= 0) & (rows["edge"] >= 0)
    alone = begun.face_points["far_vertex"] < 0
    rows = rows[known & (alone | ((rows["far_vertex"] >= 0) & (rows["far_edge"] >= 0)))]
    rows["block"], rows["other"] = owner[rows["vertex"]], owner[rows["edge"]]
    return rows


def _only_heir(origin: np.ndarray, whole: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """New number of each vertex or edge of before, by the ``origin`` (n,) of those of now: −1 where none of now is
    ``whole`` (n,), or several are; the last entry stands for no vertex."""
    named = (int(rows[name].max(initial=-1)) for name in ("vertex", "edge", "far_vertex", "far_edge"))
    most = max(int(origin.max(initial=-1)), *named)
    out, here = np.full(most + 2, -1), np.flatnonzero(origin >= 0)
    count = np.bincount(origin[here], minlength=most + 2)
    here = here[whole[here] & (count[origin[here]] == 1)]
    out[origin[here]] = here
    return out
