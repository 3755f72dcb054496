"""Grids of a cycle with points, cells and fields: blocks, cracks, tips and contacts.

One rule holds for all files of a run: current position = points + REFERENCE × displacement. With ``configuration``
"reference" (REFERENCE = 1 in the field data) files hold reference coordinates, to be warped by displacement; with
"current" (REFERENCE = 0) they hold current coordinates, which warping would displace twice.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geomech.conventions import normal_of
from geomech.model import TIP, Blocks, CrackFaces, Cracks, Cycle, Material, Problem, State
from geomech.model.blocks.block_motion import Motion
from geomech.model.blocks.key_blocks import UNKNOWN, key_blocks

from .block_motion import carried, displacement, vertex_velocity
from .triangulate import Triangles
from .vtu import LINE, TRIANGLE, VERTEX, Grid

CONFIGURATIONS = ("reference", "current")

#: Key blocks are determined again when a block has rotated by the inverse of this, rad.
_TURNS_SEEN = 50.0


class KeyBlocks:
    """Key blocks of a run, kept while the same contacts are closed: block theory depends on directions only."""

    def __init__(self, problem: Problem) -> None:
        self._materials, self._joints, self._gravity = problem.materials, problem.joints, problem.loads.gravity
        self._key: bytes | None = None
        self._kind = np.empty(0, np.int64)

    def kind(self, cycle: Cycle) -> np.ndarray:
        """(n_blocks,) class of every block (`geomech.model.blocks.key_blocks`)."""
        contacts, state = cycle.state.contacts, cycle.state
        if cycle.number == 0 and len(contacts) == 0:
            return np.full(cycle.blocks.n_blocks, UNKNOWN)
        turned = np.round(state.rotation * _TURNS_SEEN).astype(np.int64)
        key = contacts["edge"].tobytes() + contacts["vertex"].tobytes() + contacts["state"].tobytes() + turned.tobytes()
        if key != self._key:
            self._key = key
            gravity = self._gravity.at(state.time)
            self._kind = key_blocks(cycle.blocks, self._materials, self._joints, state, gravity)["kind"]
        return self._kind


def blocks_grid(
    cycle: Cycle, materials: Sequence[Material], configuration: str, triangles: Triangles, keys: KeyBlocks
) -> Grid:
    """Every block as triangles on its own vertices, so that Warp By Vector opens the joints and Feature Edges draws the
    outlines."""
    blocks, state = cycle.blocks, cycle.state
    cells, owner = triangles.of(blocks)
    stress = six_components(state.stress, blocks.material, materials)
    return Grid(
        points=blocks.vertices if configuration == "reference" else cycle.placed,
        connectivity=cells.ravel(),
        offsets=np.arange(3, 3 * len(cells) + 1, 3),
        types=np.full(len(cells), TRIANGLE),
        point_data={
            "displacement": cycle.moved,
            "velocity": vertex_velocity(blocks, state),
        },
        cell_data={
            "stress": stress[owner],
            "principal_stress": principal_stresses(stress)[owner],
            "block_id": owner,
            "material": blocks.material[owner],
            "fixed": blocks.fixed[owner],
            "removed": np.zeros(len(owner), bool) if state.removed is None else state.removed[owner],
            "key_block": keys.kind(cycle)[owner],
            "displacement_rank": _rank(blocks, state)[owner],
        },
    )


def _rank(blocks: Blocks, state: State) -> np.ndarray:
    """(n_blocks,) 0 for the block that has moved farthest, and so on."""
    moved = blocks.displacements(state.vertices)
    rank = np.empty(blocks.n_blocks, int)
    rank[np.argsort(-np.einsum("ij,ij->i", moved, moved), kind="stable")] = np.arange(blocks.n_blocks)
    return rank


class CrackLines:
    """Elements of a crack network as lines between their sampling points, kept while the network does not change.

    They are followed by segments without a solution (``unsolved``), from end to end. Elements do not share points,
    because opening and slip are discontinuous between them.
    """

    def __init__(self) -> None:
        self._cracks: Cracks | None = None
        self._segment = np.empty(0, int)

    def update(self, cracks: Cracks, faces: CrackFaces | None) -> None:
        """Set the lines to those of ``cracks``, as far as they are sampled in ``faces``."""
        segment = np.empty(0, int) if faces is None else faces.segment
        if cracks is self._cracks and np.array_equal(segment, self._segment):
            return
        self._cracks, self._segment = cracks, segment
        solved = np.zeros(cracks.n_segments, bool)
        solved[segment] = True
        self.unsolved = np.flatnonzero(~solved)
        per = 0 if faces is None else faces.opening.shape[1]
        sizes = np.concatenate([np.full(len(segment), per), np.full(len(self.unsolved), 2)]).astype(int)
        of_point = np.repeat(np.concatenate([segment, self.unsolved]), sizes)
        start = np.delete(np.arange(len(of_point)), np.cumsum(sizes) - 1)
        of_line = of_point[start]
        ends = cracks.nodes[cracks.segments[self.unsolved]].reshape(-1, 2)
        self.points = ends if faces is None else np.concatenate([faces.points.reshape(-1, 2), ends])
        self.block = cracks.block[of_point]
        self.connectivity = np.stack([start, start + 1], axis=1).ravel()
        self.offsets = np.arange(2, 2 * len(start) + 1, 2)
        self.types = np.full(len(start), LINE)
        self.cell_data = {
            "crack_id": cracks.crack[of_line],
            "block_id": cracks.block[of_line],
            "birth_cycle": cracks.birth_cycle[of_line],
        }


def cracks_grid(cycle: Cycle, motion: Motion, configuration: str, lines: CrackLines) -> Grid:
    """The crack network. Segments without a solution have nan; at the start, the zeros of rock at rest."""
    faces = cycle.latest_faces
    lines.update(cycle.cracks, faces)
    rest = np.full(2 * len(lines.unsolved), 0.0 if cycle.number == 0 else np.nan)

    def along(solved: np.ndarray | None, rest: np.ndarray = rest) -> np.ndarray:
        if solved is None:
            return rest
        return np.concatenate([solved.ravel(), rest]) if len(rest) else solved.ravel()

    moved = displacement(motion, lines.block, lines.points)
    return Grid(
        points=lines.points if configuration == "reference" else lines.points + moved,
        connectivity=lines.connectivity,
        offsets=lines.offsets,
        types=lines.types,
        point_data={
            "displacement": moved,
            "opening": along(None if faces is None else faces.opening),
            "slip": along(None if faces is None else faces.slip),
            "normal_traction": along(None if faces is None else faces.traction[..., 0]),
            "shear_traction": along(None if faces is None else faces.traction[..., 1]),
            "state": along(None if faces is None else faces.state, np.zeros(len(rest), int)),
        },
        cell_data=lines.cell_data,
    )


def tips_grid(cycle: Cycle, motion: Motion, configuration: str) -> Grid:
    """Every crack tip as a point; at the start, before the first solution, with the zeros of rock at rest."""
    tips, solved_in = cycle.latest_tips, cycle.solved_in
    if cycle.number == 0 and not len(tips):
        tips = _tips_at_rest(cycle.cracks)
        solved_in = np.zeros(len(tips), int)
    moved = displacement(motion, tips["block"], tips["point"])
    c, s = np.cos(tips["angle"])[:, None], np.sin(tips["angle"])[:, None]
    growth = c * tips["direction"] + s * normal_of(tips["direction"])
    if configuration == "current":
        growth = carried(motion, tips["block"], growth)
    return _cloud(
        tips["point"] if configuration == "reference" else tips["point"] + moved,
        {
            "displacement": moved,
            "K_I": tips["k_i"],
            "K_II": tips["k_ii"],
            "K_eq": tips["k_eq"],
            "growth_angle": np.degrees(tips["angle"]),
            "growth_direction": growth,
            "grown": tips["grown"],
            "crack_id": tips["crack"],
            "end": tips["end"],
            "tip_id": tips["node"],
            "solved_cycle": solved_in,
            "block_id": tips["block"],
        },
    )


def contacts_grid(cycle: Cycle, configuration: str) -> Grid:
    """Every contact as a point: its vertex in the reference, its foot on the edge in the current configuration."""
    contacts = cycle.state.contacts
    along = normal_of(contacts["normal"])  # the edge's direction from its outward normal
    force = contacts["normal_force"][:, None] * contacts["normal"] + contacts["shear_force"][:, None] * along
    reference = cycle.blocks.vertices[contacts["vertex"]]
    return _cloud(
        reference if configuration == "reference" else contacts["point"],
        {
            "displacement": cycle.moved[contacts["vertex"]],
            "force": force,
            "normal_force": contacts["normal_force"],
            "shear_force": contacts["shear_force"],
            "gap": contacts["gap"],
            "slip": contacts["slip"],
            "wear": contacts["wear"],
            "lift": contacts["lift"],
            "state": contacts["state"],
            "length": contacts["length"],
            "joint": contacts["law"],
            "bonded": contacts["bonded"],
            "block_id": contacts["block"],
            "other_block_id": contacts["other"],
        },
    )


def six_components(stress: np.ndarray, material: np.ndarray, materials: Sequence[Material]) -> np.ndarray:
    """(n, 6) Pa in VTK's order from in-plane ``stress`` (n, 3), row i in ``materials[material[i]]``."""
    out = np.zeros((len(stress), 6))
    out[:, 0], out[:, 1], out[:, 3] = stress.T
    for k, kind in enumerate(materials):
        rows = material == k
        out[rows, 2] = kind.out_of_plane_stress(stress[rows])
    return out


def principal_stresses(stress: np.ndarray) -> np.ndarray:
    """(n, 3) Pa, S1 ≥ S2 ≥ S3, of six-component ``stress`` (n, 6) without YZ and XZ shear."""
    mean, half = 0.5 * (stress[:, 0] + stress[:, 1]), 0.5 * (stress[:, 0] - stress[:, 1])
    radius = np.hypot(half, stress[:, 3])
    return np.sort(np.stack([mean + radius, stress[:, 2], mean - radius], axis=1), axis=1)[:, ::-1]


def von_mises(principal: np.ndarray) -> np.ndarray:
    """(n,) Pa from ``principal`` stresses (n, 3)."""
    a, b, c = principal.T
    return np.sqrt(0.5 * ((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2))


def _cloud(points: np.ndarray, point_data: dict[str, np.ndarray]) -> Grid:
    n = np.arange(len(points))
    return Grid(points, n, n + 1, np.full(len(n), VERTEX), point_data)


def _tips_at_rest(cracks: Cracks) -> np.ndarray:
    """TIP rows of all tips of ``cracks``, with all factors zero."""
    place = {int(node): k for k, node in enumerate(cracks.segments.ravel())}
    at = np.array([place[int(node)] for node in cracks.tips], dtype=int)
    segment, end = at // 2, at % 2
    tips = np.zeros(len(at), TIP)
    tips["node"], tips["end"], tips["point"] = cracks.tips, end, cracks.nodes[cracks.tips]
    tips["crack"], tips["block"] = cracks.crack[segment], cracks.block[segment]
    out = tips["point"] - cracks.nodes[cracks.segments[segment, 1 - end]]
    tips["direction"] = out / np.hypot(*out.T)[:, None]
    return tips
