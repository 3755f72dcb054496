"""What changes while a scene runs, and the record that every coupling cycle leaves."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from .blocks.block_arrays import Blocks
from .blocks.block_motion import Motion
from .cracks.crack_arrays import Cracks
from .joints.bolt import BOLT

#: Contact and crack-face states.
OPEN, STICK, SLIP = 0, 1, 2

#: One row a contact. Forces are those on the block that owns ``vertex``; see ``geomech.conventions``.
CONTACT = np.dtype(
    [
        ("vertex", np.int64),  # the touching vertex
        ("edge", np.int64),  # the edge it touches (index of the vertex the edge leaves)
        ("block", np.int64),  # owner of the vertex
        ("other", np.int64),  # owner of the edge
        ("state", np.int64),  # OPEN, STICK or SLIP
        ("position", np.float64),  # along the edge, 0 at its start and 1 at its end
        ("point", np.float64, 2),  # where, current coordinates, m
        ("normal", np.float64, 2),  # outward normal of the edge (of a rounded corner, see ``tilt``): the way it pushes
        # the vertex's block
        ("normal_force", np.float64),  # N/m, positive in compression
        ("shear_force", np.float64),  # N/m, along the edge's direction
        ("gap", np.float64),  # m, from where the faces meet (beyond ``lift``), negative when penetrating
        ("slip", np.float64),  # m, accumulated sliding along the edge's direction
        ("length", np.float64),  # tributary length, m
        ("law", np.int64),  # index of the joint law
        (
            "bonded",
            np.int64,
        ),  # 1 while cohesion and tensile strength hold, 0 once they are lost, 2 after slip that wears cohesion, 3
        # cracked from the edge of its face: cohesion holds while it is pressed
        ("wear", np.float64),  # m, length of the way it has slid, to and fro
        ("lift", np.float64),  # m, faces forced apart by sliding; negative: a gap that the geometry has not
        ("inset", np.bool_),  # a bond whose springs stand inside its face, as the bending of its blocks wants them
        ("bare", np.float64),  # part of its face, from this corner on, that does not touch; −1 where that is not known
        ("stretch", np.float64),  # m, motion along the edge while sticking that a multiplier has still to take back
        ("tilt", np.float64),  # rad, of the normal against that of the edge, where two rounded corners meet; else 0
        ("stiffness", np.float64),  # N/m, of the normal spring that bears the force; 0 where that is not known
    ]
)

#: One row a crack tip.
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
        ("k_eq", np.float64),  # of the growth criterion
        ("angle", np.float64),  # growth angle from ``direction``, rad, counter-clockwise
        ("grown", np.float64),  # m grown in this cycle, 0 when the tip stood
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
    crack_strain  (n_blocks, 3)     mean strain that the block's cracks carry, current axes
    contacts      CONTACT rows      open ones that are near included
    acceleration  (n_blocks, 6)     of the unknowns, as a time scheme that needs it has left it; None: begin anew
    bolts         BOLT rows         one a bolt of the loads, empty before there are any
    imposed       (k,)              what motion the loads have imposed so far: of the base, of blocks, of points; empty
                  before
    removed       (n_blocks,)       True: excavated; None before anything is
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

    def refuse_misfit(self, blocks: Blocks) -> None:
        """Raises ValueError for arrays that are not those of ``blocks``, or not finite."""
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


@dataclass(frozen=True)
class Event:
    """Something that happened: ``kind`` is initiation, coalescence, daylighting, split, arrest, failure …, or one of
    `CHANGES` (of `model.problem`)."""

    kind: str
    cycle: int
    time: float
    load: float
    point: tuple[float, float]
    detail: str = ""


@dataclass(frozen=True, eq=False)
class CrackFaces:
    """Opening and slip along every crack, sampled element by element (they jump between elements).

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
    """Steps that were shortened: ``why``, the names of the ``blocks`` that were the reason (none, one or two), how often
    (``count``), and what to set."""

    why: str
    blocks: tuple[str, ...]
    count: int
    way_out: str


class Skip(NamedTuple):
    """Work that was asked for ``kept`` times more than it was ``done``, since what it had given before still held;
    ``seconds``: what it took where it was done (0: not known)."""

    kept: int
    done: int = 0
    seconds: float = 0.0

    @property
    def saved(self) -> float | None:
        """About so many seconds, by the mean of what was done; None where nothing was."""
        return self.kept * self.seconds / self.done if self.done > 0 else None


@dataclass(frozen=True, eq=False)
class Cycle:
    """One coupling cycle, complete: what observers (writers, progress, pictures) see.

    number      0, 1, 2 …, one a cycle
    load_step   the load step it belongs to; ``growth_pass`` counts the passes at that step's load
    load        the scene's leading load at ``state.time``: for a specimen the axial stress, Pa, positive in
                compression
    strain      axial strain that goes with it, positive when shortening; nan where the scene names no axis
    tips        TIP rows of all blocks
    faces       the crack faces, or None when no block holds a crack
    bodies      block index → solved elastic body with ``fields(points)``: stress (n, 3) and displacement (n, 2)
                in reference coordinates, for interior fields; ``residual``, ``condition``, ``tips`` and ``tip_errors``
    monitors    name → displacement (2,) of the monitor point, m
    statistics  numbers of the step: open_close_iterations, dt, kinetic_energy, elastic_energy, worst_penetration …
    work        what the crack solver has done so far: assemblies, factorisations, back-substitutions, contact solves
    skips       what was not done so far since nothing had changed, by name
    shortened   blocks that have shortened most steps so far
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
    events: tuple[Event, ...] = ()
    monitors: dict[str, np.ndarray] = field(default_factory=dict)
    statistics: dict[str, float] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    work: dict[str, int] = field(default_factory=dict)
    skips: dict[str, Skip] = field(default_factory=dict)
    shortened: tuple[Shortened, ...] = ()

    @cached_property
    def motion(self) -> Motion:
        """Of all blocks, from their reference positions to `state`."""
        return Motion.of(self.blocks, self.state.vertices)
