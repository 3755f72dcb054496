"""One cycle of a run as a block of arrays: blocks, joints, cracks, tips and the field inside cracked rock.

Positions are those of the reference configuration, m from the centre of the model, together with displacements, so that
the page can magnify the motion. Data that are constant over several cycles (outlines, triangles) are stored separately
as a *mesh*.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..output.reading import Run
from .block_outlines import free_edges, joint_faces, outlines
from .packing import Block

if TYPE_CHECKING:
    import pyvista as pv

#: In-plane and out-of-plane stress components, by their position in VTK's order.
_STRESS = {"xx": 0, "yy": 1, "xy": 3, "zz": 2}


@dataclass
class Frames:
    """Reads cycles of ``run``. ``meshes``: records of the meshes met so far; ``origin`` (2,) m: origin of positions."""

    run: Run
    origin: np.ndarray
    meshes: list[dict[str, Any]] = field(default_factory=list)
    _known: dict[bytes, int] = field(default_factory=dict)

    def frame(self, cycle: int) -> dict[str, Any]:
        """The record of ``cycle``: its number, its meshes and its arrays; ``field_cycle`` is the cycle of the field
        inside the rock, if that is an earlier one."""
        from ..render.pictures.field import agreeing

        made = Block()
        record: dict[str, Any] = {"cycle": cycle}
        blocks = self._grid("blocks", cycle)
        if blocks is not None and blocks.n_cells:
            record["blocks"] = self._blocks(made, blocks)
        interior = self._interior(cycle)
        if interior is not None:
            record["interior"] = self._rock(made, interior)
            if not agreeing(self.run, [cycle]):
                record["field_cycle"] = max(number for number in self.run.grids("interior") if number <= cycle)
        contacts = self._grid("contacts", cycle)
        if contacts is not None and contacts.n_points and blocks is not None:
            self._contacts(made, contacts, blocks)
        self._cracks(made, cycle, interior)
        self._tips(made, cycle)
        self._water(made, cycle)
        return record | made.record()

    def _grid(self, series: str, cycle: int) -> pv.UnstructuredGrid | None:
        """The ``series`` at ``cycle`` in the reference configuration; None if there is none."""
        try:
            grid = self.run.grid(series, cycle)
        except KeyError:
            return None
        return in_reference(grid)

    def _interior(self, cycle: int) -> pv.UnstructuredGrid | None:
        from ..render.pictures.field import interior_grid

        grid = interior_grid(self.run, cycle)
        return None if grid is None else in_reference(grid)

    def _places(self, points: np.ndarray) -> np.ndarray:
        return np.asarray(points)[:, :2] - self.origin

    # -- blocks --------------------------------------------------------------------------------------------------

    def _blocks(self, made: Block, grid: pv.UnstructuredGrid) -> int:
        triangles = grid.cells.reshape(-1, 4)[:, 1:]
        owner = np.asarray(grid["block_id"])
        blocks, first = np.unique(owner, return_index=True)
        mesh = self._mesh(grid, ("block_id", "material", "fixed"), self._block_mesh)
        made.fraction("ux", grid["displacement"][:, 0])
        made.fraction("uy", grid["displacement"][:, 1])
        velocity = np.asarray(grid["velocity"])
        if np.any(velocity):
            made.fraction("vx", velocity[:, 0])
            made.fraction("vy", velocity[:, 1])
        stress = np.asarray(grid["stress"])[first]
        for name, k in _STRESS.items():
            made.half(f"s{name}", stress[:, k])
        made.whole("removed", np.asarray(grid["removed"])[first] != 0)
        made.whole("key", np.asarray(grid["key_block"])[first] + 2)
        assert len(triangles) == len(owner) and len(blocks) == len(first)
        return mesh

    def _block_mesh(self, grid: pv.UnstructuredGrid) -> Block:
        made = Block()
        triangles, owner = grid.cells.reshape(-1, 4)[:, 1:], np.asarray(grid["block_id"])
        blocks, first, index = np.unique(owner, return_index=True, return_inverse=True)
        corners, starts = outlines(triangles)
        of_point = np.zeros(grid.n_points, np.int64)
        of_point[triangles.ravel()] = np.repeat(index, 3)
        places = self._places(grid.points)
        made.single("x", places[:, 0])
        made.single("y", places[:, 1])
        made.whole("triangles", triangles)
        made.whole("owner", index)
        made.whole("corners", corners)
        made.whole("starts", starts)
        made.whole("loop_block", of_point[corners[starts[:-1]]])
        made.whole("block", blocks)
        made.whole("material", np.asarray(grid["material"])[first])
        made.whole("fixed", np.asarray(grid["fixed"])[first] != 0)
        return made

    def _rock(self, made: Block, grid: pv.UnstructuredGrid) -> int:
        mesh = self._mesh(grid, ("block_id",), self._rock_mesh)
        made.fraction("iux", grid["displacement"][:, 0])
        made.fraction("iuy", grid["displacement"][:, 1])
        stress = np.asarray(grid["stress"])
        for name, k in _STRESS.items():
            made.half(f"is{name}", stress[:, k])
        return mesh

    def _rock_mesh(self, grid: pv.UnstructuredGrid) -> Block:
        made = Block()
        triangles = grid.cells.reshape(-1, 4)[:, 1:]
        places = self._places(grid.points)
        made.single("x", places[:, 0])
        made.single("y", places[:, 1])
        made.whole("triangles", triangles)
        made.whole("owner", grid["block_id"])
        made.whole("edges", free_edges(triangles))
        return made

    def _mesh(self, grid: pv.UnstructuredGrid, names: tuple[str, ...], make: Any) -> int:
        """Index in ``meshes`` of the triangles of ``grid``, added if they are new. Reference positions computed from
        files of current coordinates have round-off, which single precision nearly always removes."""
        parts = [np.asarray(grid.points, np.float32), grid.cells, *(np.asarray(grid[name]) for name in names)]
        key = b"|".join(part.tobytes() for part in parts)
        if key not in self._known:
            self._known[key] = len(self.meshes)
            self.meshes.append(make(grid).record())
        return self._known[key]

    # -- joints --------------------------------------------------------------------------------------------------

    def _contacts(self, made: Block, grid: pv.UnstructuredGrid, blocks: pv.UnstructuredGrid) -> None:
        owner, other = np.asarray(grid["block_id"]), np.asarray(grid["other_block_id"])
        names = np.unique(np.asarray(blocks["block_id"]))
        vertex = _vertices_of(blocks, np.asarray(grid.points), owner)
        known = vertex >= 0
        if not known.any():
            return
        rows = np.flatnonzero(known)
        made.whole("c_vertex", vertex[rows])
        made.whole("c_other", np.searchsorted(names, other[rows]))
        made.whole("c_owner", np.searchsorted(names, owner[rows]))
        force = np.asarray(grid["force"])[rows]
        made.half("c_fx", force[:, 0])
        made.half("c_fy", force[:, 1])
        for name, series in (("c_n", "normal_force"), ("c_s", "shear_force"), ("c_gap", "gap"), ("c_slip", "slip"),
                             ("c_length", "length")):  # fmt: skip
            made.half(name, np.asarray(grid[series])[rows])
        made.whole("c_state", np.asarray(grid["state"])[rows])
        made.whole("c_bonded", np.asarray(grid["bonded"])[rows])
        made.whole("faces", joint_faces(np.asarray(grid.points)[rows, :2], owner[rows], other[rows]))

    # -- cracks --------------------------------------------------------------------------------------------------

    def _cracks(self, made: Block, cycle: int, interior: pv.UnstructuredGrid | None) -> None:
        grid = self._grid("cracks", cycle)
        if grid is None or not grid.n_cells:
            return
        upper, lower = faces_of(grid, interior)
        places = self._places(grid.points)
        made.single("k_x", places[:, 0])
        made.single("k_y", places[:, 1])
        for name, face in (("k_u", upper), ("k_l", lower)):
            made.fraction(f"{name}x", face[:, 0])
            made.fraction(f"{name}y", face[:, 1])
        for name, series in (("k_open", "opening"), ("k_slip", "slip"), ("k_n", "normal_traction"),
                             ("k_s", "shear_traction")):  # fmt: skip
            made.half(name, grid[series])
        made.whole("k_state", grid["state"])
        made.whole("k_lines", grid.cells.reshape(-1, 3)[:, 1:])
        made.whole("k_crack", grid["crack_id"])
        made.whole("k_birth", grid["birth_cycle"])

    def _tips(self, made: Block, cycle: int) -> None:
        grid = self._grid("tips", cycle)
        if grid is None or not grid.n_points or "K_I" not in grid.point_data:
            return
        places = self._places(grid.points)
        made.single("t_x", places[:, 0])
        made.single("t_y", places[:, 1])
        made.single("t_ux", grid["displacement"][:, 0])
        made.single("t_uy", grid["displacement"][:, 1])
        for name, series in (("t_k1", "K_I"), ("t_k2", "K_II"), ("t_keq", "K_eq"), ("t_grown", "grown")):
            made.single(name, grid[series])
        crack = np.asarray(grid["crack_id"])
        made.whole("t_crack", crack)
        made.whole("t_end", self._ends(cycle, crack))

    def _water(self, made: Block, cycle: int) -> None:
        grid = self._grid("water", cycle)
        if grid is None or not grid.n_cells:
            return
        places = self._places(grid.points)
        for axis in range(2):
            made.single(f"w_{'xy'[axis]}", places[:, axis])
            made.single(f"w_u{'xy'[axis]}", grid["displacement"][:, axis])
        made.whole("w_lines", grid.cells.reshape(-1, 3)[:, 1:])

    def _ends(self, cycle: int, crack: np.ndarray) -> np.ndarray:
        """0 for tips that grew from the start of their crack, 1 for those from its end; in the order of ``tips.csv``."""
        rows = self.run.tips[self.run.tips["cycle"] == cycle]
        if len(rows) == len(crack) and np.array_equal(rows["crack"], crack):
            return rows["end"].astype(np.int64)
        seen: dict[int, int] = {}
        ends = []
        for k in crack.tolist():
            ends.append(min(seen.get(k, 0), 1))
            seen[k] = seen.get(k, 0) + 1
        return np.array(ends, np.int64)


def in_reference(grid: pv.UnstructuredGrid) -> pv.UnstructuredGrid:
    """``grid`` with its points in the reference configuration; a run may have written current coordinates."""
    if "displacement" in grid.point_data and not int(grid.field_data["REFERENCE"][0]):
        grid.points = np.asarray(grid.points, float) - np.asarray(grid["displacement"], float)
    return grid


def faces_of(cracks: pv.UnstructuredGrid, interior: pv.UnstructuredGrid | None) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2) displacement of the upper and of the lower face at the points of ``cracks``: that of the rock's mesh,
    which is split along them; without a mesh, that of the block, plus opening and slip."""
    moved = np.asarray(cracks["displacement"], float)[:, :2]
    points, lines = np.asarray(cracks.points)[:, :2], cracks.cells.reshape(-1, 3)[:, 1:]
    tangent = np.zeros_like(points)
    for k in range(2):
        tangent[lines[:, k]] = points[lines[:, 1]] - points[lines[:, 0]]
    tangent /= np.maximum(np.hypot(*tangent.T), 1e-300)[:, None]
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    opening, slip = (np.nan_to_num(np.asarray(cracks[name], float))[:, None] for name in ("opening", "slip"))
    jump = 0.5 * (opening * normal + slip * tangent)
    upper, lower = moved + jump, moved - jump
    if interior is not None:
        from ..render.pictures.field import face_displacements

        found = [face[:, :2] for face in face_displacements(interior, cracks)]
        known = np.isfinite(found[0]).all(axis=1) & np.isfinite(found[1]).all(axis=1)
        upper, lower = (np.where(known[:, None], a, b) for a, b in zip(found, (upper, lower), strict=True))
    return upper, lower


def _vertices_of(blocks: pv.UnstructuredGrid, points: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """(n,) the corner of block ``owner`` at each of ``points``, -1 if there is none within 1e-6 of the model's size."""
    from scipy.spatial import cKDTree

    triangles = blocks.cells.reshape(-1, 4)[:, 1:]
    of_point = np.full(blocks.n_points, -1)
    of_point[triangles.ravel()] = np.repeat(np.asarray(blocks["block_id"]), 3)
    corners = np.asarray(blocks.points)[:, :2]
    size = float(np.ptp(corners, axis=0).max())
    # Blocks are separated in the third direction, so that the nearest corner belongs to the same block.
    tree = cKDTree(np.column_stack([corners, size * of_point]))
    distance, vertex = tree.query(np.column_stack([points[:, :2], size * owner]), distance_upper_bound=1e-6 * size)
    return np.where(np.isfinite(distance), vertex, -1)
