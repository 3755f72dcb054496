"""State of a run (motion, stress, contacts, crack tips) and the record of one coupling cycle."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from .blocks.block_arrays import Blocks
from .blocks.block_motion import Motion
from .cracks.crack_arrays import Cracks
from .joints.bolt import BOLT

#: Contact and crack-face states.
OPEN, STICK, SLIP = 0, 1, 2

#: A static run ends at rest if the displacement that is left is below this part of the largest.
RESTS = 1e-2

#: One row per contact. Forces act on the block that owns ``vertex``; signs: ``geomech.conventions``.
CONTACT = np.dtype(
    [
        ("vertex", np.int64),  # the touching vertex
        ("edge", np.int64),  # the edge it touches (index of the vertex the edge leaves)
        ("block", np.int64),  # owner of the vertex
        ("other", np.int64),  # owner of the edge
        ("state", np.int64),  # OPEN, STICK or SLIP
        ("position", np.float64),  # along the edge, 0 at its start and 1 at its end
        ("point", np.float64, 2),  # position, current coordinates, m
        ("normal", np.float64, 2),  # outward normal of the edge (of a rounded corner: ``tilt``), in which it pushes
        # the vertex's block
        ("normal_force", np.float64),  # N/m, positive in compression
        ("shear_force", np.float64),  # N/m, along the edge's direction
        ("gap", np.float64),  # m, beyond ``lift``; negative when penetrating
        ("slip", np.float64),  # m, accumulated sliding along the edge's direction
        ("length", np.float64),  # tributary length, m
        ("law", np.int64),  # index of the joint law
        (
            "bonded",
            np.int64,
        ),  # 1 while cohesion and tensile strength hold, 0 once they are lost, 2 after slip that wears cohesion, 3
        # cracked from the edge of its face: cohesion holds while it is pressed
        ("wear", np.float64),  # m, accumulated sliding distance, both directions added
        ("lift", np.float64),  # m, dilation by sliding; negative: a misfit gap that the geometry does not show
        ("inset", np.bool_),  # bonded face whose springs stand inside the face, to give as its blocks would bend
        ("bare", np.float64),  # share of the face, from this corner, that is out of contact; −1: not known
        ("stretch", np.float64),  # m, tangential motion while sticking that the multiplier has yet to remove
        ("tilt", np.float64),  # rad, from the edge's normal to this one, where two rounded corners meet; else 0
        ("stiffness", np.float64),  # N/m, stiffness of the normal spring that carries the force; 0: not known
    ]
)

#: One row per integration point of the faces of blocks of higher order (and per lone corner): its face by the vertices and
#: edges of both ends (−1: a lone corner), its ``place`` between them, and what it remembers, as in CONTACT rows.
FACE_POINT = np.dtype(
    [
        ("vertex", np.int64),
        ("edge", np.int64),
        ("far_vertex", np.int64),
        ("far_edge", np.int64),
        ("block", np.int64),
        ("other", np.int64),
        ("place", np.float64),  # along the face, 0 at the first end and 1 at the far one
        ("point", np.float64, 2),  # current coordinates, m
        ("length", np.float64),  # m of the face that it stands for
        ("state", np.int64),
        ("bonded", np.int64),
        ("normal_force", np.float64),  # N/m
        ("shear_force", np.float64),  # N/m
        ("gap", np.float64),  # m
        ("slip", np.float64),  # m
        ("wear", np.float64),  # m
        ("lift", np.float64),  # m
    ]
)

#: One row per crack tip.
TIP = np.dtype(
    [
        ("node", np.int64),  # node of the crack network
        ("crack", np.int64),
        ("end", np.int64),  # 0: grew from the start of its crack, 1: from its end
        ("block", np.int64),
        ("point", np.float64, 2),  # reference coordinates, m
        ("direction", np.float64, 2),  # unit vector out of the crack
        ("k_i", np.float64),  # Pa √m
        ("k_ii", np.float64),
        ("k_eq", np.float64),  # equivalent factor of the growth criterion
        ("angle", np.float64),  # growth angle from ``direction``, rad, counter-clockwise
        ("grown", np.float64),  # m, advance in this cycle; 0 when the tip did not grow
    ]
)


@dataclass(frozen=True, eq=False)
class State:
    """Motion and stress of the blocks at one time.

    time          s
    vertices      (n_vertices, 2)   current coordinates, m
    velocity      (n_blocks, 6)     rates of (u0, v0, r0, εx, εy, γxy) about the current centroid
    stress        (n_blocks, 3)     Pa, current axes
    rotation      (n_blocks,)       accumulated rotation, rad
    crack_strain  (n_blocks, 3)     mean strain due to opening and slip of the block's cracks, current axes
    contacts      CONTACT rows      nearby open ones included
    acceleration  (n_blocks, 6)     of the unknowns, where the time scheme keeps one; None: none is known
    bolts         BOLT rows         one per bolt of the loads; empty before the first step
    imposed       (k,)              prescribed displacement of base, blocks and points; empty before step 1
    removed       (n_blocks,)       True: excavated; None: no block is
    deflection    (k, 2)            m and m/s, of blocks of higher order (`Blocks.order`): the unknowns of deflection and
                                    their rates, block by block; None: no block has any. ``vertices`` are without it
    deflection_origin (k, 2)        m, as in-situ stress leaves it: the deflection at which blocks of higher order bear
                                    their mean stress alone, and that from which displacements count; None: zero
    crack_deflection (k,)           m, part of the deflection that is due to opening and slip of the block's cracks; None:
                                    no such block has cracks
    face_points   FACE_POINT rows   what points of the faces of such blocks remember
    parted        (n_faces,)        True: the glue of that face of `Blocks.glued` has parted; None: all holds
    order         (n_blocks,)       order that each block has come to, where orders are found as the run goes; None: they
                                    are given, or the run begins
    """

    time: float
    vertices: np.ndarray
    velocity: np.ndarray
    stress: np.ndarray
    rotation: np.ndarray
    crack_strain: np.ndarray
    contacts: np.ndarray
    acceleration: np.ndarray | None = None
    bolts: np.ndarray = field(default_factory=lambda: np.empty(0, BOLT))
    imposed: np.ndarray = field(default_factory=lambda: np.empty(0))
    removed: np.ndarray | None = None
    deflection: np.ndarray | None = None
    face_points: np.ndarray | None = None
    order: np.ndarray | None = None
    parted: np.ndarray | None = None
    deflection_origin: np.ndarray | None = None
    crack_deflection: np.ndarray | None = None

    @classmethod
    def at_rest(cls, blocks: Blocks) -> State:
        n = blocks.n_blocks
        return cls(
            time=0.0,
            vertices=blocks.vertices.copy(),
            velocity=np.zeros((n, 6)),
            stress=np.zeros((n, 3)),
            rotation=np.zeros(n),
            crack_strain=np.zeros((n, 3)),
            contacts=np.empty(0, CONTACT),
        )

    def read_only(self) -> State:
        """The same with arrays that cannot be written to: views of these, no copies."""
        views: dict[str, Any] = {name: _view(value) for name, value in self._arrays()}
        return replace(self, **views)

    def writable(self) -> State:
        """The same with arrays that can be written to: these, copies of those that cannot."""
        copies: dict[str, Any] = {name: value.copy() for name, value in self._arrays() if not value.flags.writeable}
        return replace(self, **copies) if copies else self

    def _arrays(self) -> list[tuple[str, np.ndarray]]:
        return [(name, value) for name, value in vars(self).items() if isinstance(value, np.ndarray)]

    def refuse_misfit(self, blocks: Blocks) -> None:
        """Raise ValueError for arrays that do not fit ``blocks`` in shape, or are not finite."""
        n = blocks.n_blocks
        wanted = {"vertices": (blocks.n_vertices, 2), "velocity": (n, 6), "stress": (n, 3), "rotation": (n,),
                  "crack_strain": (n, 3)}  # fmt: skip
        for name, shape in wanted.items():
            value = getattr(self, name)
            if np.shape(value) != shape:
                raise ValueError(
                    f"the state's {name} has the shape {np.shape(value)}, but {n} blocks with {blocks.n_vertices} "
                    f"vertices have {shape}"
                )
            if not np.isfinite(value).all():
                raise ValueError(f"the state's {name} is not finite")


def _view(array: np.ndarray) -> np.ndarray:
    out = array.view()
    out.flags.writeable = False
    return out


@dataclass(frozen=True)
class Event:
    """An event of a run: ``kind`` is initiation, coalescence, daylighting, split, arrest, failure, …, or one of
    `CHANGES` (`model.problem`)."""

    kind: str
    cycle: int
    time: float
    load: float
    point: tuple[float, float]
    detail: str = ""


@dataclass(frozen=True, eq=False)
class CrackFaces:
    """Opening, slip and tractions along all cracks, sampled element by element (values jump between elements).

    segment   (n_elements,)             row in the crack network
    points    (n_elements, n, 2)        sampling points, reference coordinates, from start to end
    opening   (n_elements, n)           n·(u⁺ − u⁻), m
    slip      (n_elements, n)           t·(u⁺ − u⁻), m
    traction  (n_elements, n, 2)        (normal, shear) on the faces, Pa, normal negative when they press
    state     (n_elements, n)           OPEN, STICK or SLIP
    """

    segment: np.ndarray
    points: np.ndarray
    opening: np.ndarray
    slip: np.ndarray
    traction: np.ndarray
    state: np.ndarray


class Shortened(NamedTuple):
    """Time steps that were shortened for one reason.

    ``why``; the names of the ``blocks`` that caused it (up to two); how often (``count``); the setting to change."""

    why: str
    blocks: tuple[str, ...]
    count: int  # type: ignore[assignment]  # tuple.count is of no use here
    way_out: str


class Skip(NamedTuple):
    """Work avoided by reusing results that were still valid: ``done`` times computed, ``kept`` times reused.

    ``seconds``: time spent on what was computed (0: not known)."""

    kept: int
    done: int = 0
    seconds: float = 0.0

    @property
    def saved(self) -> float | None:
        """Estimated seconds saved, from the mean time of what was computed; None where nothing was."""
        return self.kept * self.seconds / self.done if self.done > 0 else None


@dataclass(frozen=True, eq=False)
class Cycle:
    """Complete record of one coupling cycle, as observers (writers, progress, pictures) receive it.

    number      0, 1, 2, …
    load_step   the load step it belongs to; ``growth_pass`` counts the passes at that step's load
    load        the scene's leading load at ``state.time``: for a specimen the axial stress, Pa, positive in
                compression
    strain      axial strain between the gauge points, positive in shortening; nan without a gauge
    tips        TIP rows of all blocks
    latest_tips, latest_faces   as tips and faces, but where the cycle is `sparing` those of each block's last solution, in
                cycle `solved_in`: blocks whose cracks cannot grow are then solved now and then
    bent        block → body of a block of higher order, with ``fields(points)`` as ``bodies`` have, and
                ``deflection(points)`` (n, 2): by how much points lie off where the block's vertices say
    faces       the crack faces, or None when no block holds a crack
    bodies      block index → solved elastic body with ``fields(points)``: stress (n, 3) and displacement (n, 2)
                in reference coordinates, for interior fields; ``residual``, ``condition``, ``tips`` and ``tip_errors``
    monitors    name → displacement (2,) of the monitor point, m
    statistics  numbers of the step: open_close_iterations, dt, kinetic_energy, elastic_energy, worst_penetration …
    work        counts of the crack solver so far: assemblies, factorisations, back-substitutions, contact solves
    skips       work avoided so far because nothing had changed, by name
    sparing     whether so many cracked blocks move that not all results are output in every cycle
    shortened   blocks that have caused most shortened steps so far
    seconds     wall time spent so far in each phase of the solvers (not reproducible, so not in any series)
    """

    number: int
    load_step: int
    growth_pass: int
    load: float
    strain: float
    blocks: Blocks
    state: State
    cracks: Cracks
    tips: np.ndarray
    faces: CrackFaces | None = None
    bodies: dict[int, Any] = field(default_factory=dict)
    bent: dict[int, Any] = field(default_factory=dict)
    events: tuple[Event, ...] = ()
    monitors: dict[str, np.ndarray] = field(default_factory=dict)
    statistics: dict[str, float] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    work: dict[str, int] = field(default_factory=dict)
    skips: dict[str, Skip] = field(default_factory=dict)
    shortened: tuple[Shortened, ...] = ()
    sparing: bool = False

    @property
    def latest_tips(self) -> np.ndarray:
        """TIP rows of all blocks, each by its last solution."""
        return self.tips

    @property
    def solved_in(self) -> np.ndarray:
        """(n_tips,) number of the cycle in which each of `latest_tips` was solved for."""
        return np.full(len(self.latest_tips), self.number)

    @property
    def latest_faces(self) -> CrackFaces | None:
        """The crack faces of all blocks, each by its last solution."""
        return self.faces

    @property
    def inside(self) -> dict[int, Any]:
        """block → stress and displacement inside it, for cracked blocks and those of higher order."""
        return {**self.bent, **self.bodies} if self.bent else self.bodies

    @property
    def has_fields(self) -> bool:
        """Whether any block is `inside`; solves nothing."""
        return bool(self.bent or self.bodies)

    @cached_property
    def moved(self) -> np.ndarray:
        """(n_vertices, 2) m: displacement of the vertices of all blocks, their deflection included."""
        out = self.state.vertices - self.blocks.vertices
        for block, body in self.bent.items():
            some = slice(self.blocks.vertex_start[block], self.blocks.vertex_start[block + 1])
            out[some] += body.deflection(self.blocks.vertices[some])
        return out

    @property
    def placed(self) -> np.ndarray:
        """(n_vertices, 2) m: current coordinates of the vertices of all blocks, their deflection included."""
        return self.blocks.vertices + self.moved if self.bent else self.state.vertices

    @cached_property
    def motion(self) -> Motion:
        """Motion of all blocks from their reference positions to `state`."""
        return Motion.of(self.blocks, self.state.vertices)
