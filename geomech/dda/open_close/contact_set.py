"""The contacts at the start of a step: geometry, history and springs."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Protocol, Self

import numpy as np

from ...model import CONTACT, SLIP
from ..contact_detection.contact_records import ContactShape, Pairing, SlipBefore, StepEnd, fill
from ..contact_detection.face_quadrature import FacePoints
from ..joint_laws.bonds import BondedFaces
from ..joint_laws.penalty_springs import Springs
from ..joint_laws.whole_faces import WholeFaces
from .settled_states import Settled


class SpringPoints(Protocol):
    """Points of faces at which springs act; ``corners`` (n_corners, 7) is the geometry of the contacts at corners."""

    @property
    def corners(self) -> np.ndarray: ...

    def at_corners(self, force: np.ndarray) -> np.ndarray: ...

    def share_shear(self, vectors: np.ndarray, block: np.ndarray) -> None: ...


@dataclass(frozen=True, eq=False)
class ContactSet:
    """Contacts (n,) at the start of a step.

    vertex, edge, block, other, law   as in CONTACT rows
    corner      (n,)     corner of the edge's block that the vertex meets if both are rounded (`rounded_corners`), −1 if
                         it meets the edge's line
    tilt        (n,)     rad, from the edge's normal to the contact normal of rounded corners; 0 on a line
    precision   (n,)     m, accuracy of the gaps of rotating blocks
    geometry    (n, 7)   position along the edge, outward normal (2), gap, tributary length, vertex (2); for the faces
                         in ``points``, those of their springs
    springs              stiffness and strengths
    state, direction, bonded   carried over: state and direction of sliding to try first, bond
    normal, shear, slip        forces N and sliding m
    wear, lift                 m: accumulated sliding distance, and dilation (negative: faces meet only closer than in
                               the geometry)
    stretch                    m: motion along the edge that is not yet in the force of a sticking contact: a remainder
                               of multipliers, or a prescribed motion in the step
    inset       (n,)     bool: the springs of a bond are inside its face, so that its blocks can bend
    bare        (n,)     fraction of the face, from its corner, that was open at the end of the last step; −1: unknown
    released             J/m stored in shear where faces open and in springs before they were softened, and not in the
                         new springs
    unbent               J/m that springs inside faces store beyond springs at the corners, for bonds that break in this
                         step
    relies_on_glue             corners have been left out that are held as long as all bonds hold
    faces                      those with bonds at both ends; or None
    by_length   (n,)           contacts whose shear stiffness is that of a joint law
    points, lumped             faces with springs inside them, and the contacts with springs at the corners; or None
    arc         (n,)     m, contribution of the rotation of blocks (an arc) to the gap at the end of the step, in
                         addition to the linear motion
    swing       (n,)     m, the same for the motion along the edge
    cohesive    (n,)     m of its face whose cohesion the contact carries; None: its tributary length
    whole                      faces that keep their cohesion while any part is closed (`whole_faces`); or None
    tried                      state, direction and bond with which open–close iterations start, if they differ
    """

    vertex: np.ndarray
    edge: np.ndarray
    block: np.ndarray
    other: np.ndarray
    law: np.ndarray
    corner: np.ndarray
    tilt: np.ndarray
    precision: np.ndarray
    geometry: np.ndarray
    springs: Springs
    state: np.ndarray
    direction: np.ndarray
    bonded: np.ndarray
    normal: np.ndarray
    shear: np.ndarray
    slip: np.ndarray
    wear: np.ndarray
    lift: np.ndarray
    stretch: np.ndarray
    inset: np.ndarray
    bare: np.ndarray
    released: float = 0.0
    unbent: float = 0.0
    relies_on_glue: bool = False
    faces: BondedFaces | None = None
    by_length: np.ndarray | None = None
    points: SpringPoints | None = None
    lumped: ContactSet | None = None
    cohesive: np.ndarray | None = None
    whole: WholeFaces | None = None
    arc: np.ndarray | float = 0.0
    swing: np.ndarray | float = 0.0
    tried: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None

    def trying(self, rows: np.ndarray, without_lost: bool = False) -> ContactSet:
        """The same contacts, with open–close iterations starting from the states of CONTACT ``rows`` (the end of
        another attempt at the step), if these are rows of the same contacts. ``without_lost``: bonds lost in that
        attempt are restored."""
        if len(rows) != len(self) or not all(
            np.array_equal(rows[name], getattr(self, name)) for name in ("vertex", "edge")
        ):
            return self
        way = np.where(rows["state"] == SLIP, np.sign(rows["shear_force"]), 0.0)
        # A bond lost in the other attempt may hold in this one, and the direction of sliding without force is unknown.
        known = (self.bonded == 0) | (rows["bonded"] == self.bonded) | without_lost
        known &= (rows["state"] != SLIP) | (way != 0) | (self.springs.friction == 0)
        bonded = rows["bonded"].copy() if without_lost else self.bonded
        return replace(
            self, tried=(np.where(known, rows["state"], self.state), np.where(known, way, self.direction), bonded)
        )

    def part(self, rows: np.ndarray) -> ContactSet:
        """Only the contacts ``rows`` (k,), without data of whole faces."""
        n = len(self)

        def of(value):
            if isinstance(value, np.ndarray) and len(value) == n:
                return value[rows]
            return value.of(rows) if isinstance(value, Springs) else value

        own = {field.name: of(getattr(self, field.name)) for field in fields(self)}
        tried = None if self.tried is None else tuple(each[rows] for each in self.tried)
        return ContactSet(**own | {"faces": None, "whole": None, "points": None, "lumped": None, "tried": tried})

    def expecting(self, state: np.ndarray, direction: np.ndarray) -> ContactSet:
        """The same contacts, with open–close iterations starting from this ``state`` and ``direction`` (n,)."""
        if np.array_equal(state, self.state):
            return self
        return replace(self, tried=(state, direction, self.bonded))

    def trying_again(self, settled: Settled) -> Self:
        """The same contacts, with open–close iterations starting from the states ``settled`` with springs at other
        positions. (The direction of sliding is that of each spring; forces at the corners of a face may have
        another.)"""
        # A bond lost there may hold here.
        bonded = self.bonded if self.tried is None else self.tried[2]
        known = (bonded == 0) | (settled.bonded == bonded)
        tried = np.where(known, settled.state, self.state), np.where(known, settled.direction, self.direction), bonded
        return replace(self, tried=tried)

    def like(self, rows: np.ndarray) -> ContactSet:
        """The same contacts `trying` the states of ``rows``, with the springs of faces on the parts closed in these."""
        again, points = self.trying(rows), self.points
        if again is self or not isinstance(points, FacePoints):
            return again
        return replace(self.on_corners.placed(points.pressed_by(rows["normal_force"])), tried=again.tried)

    def placed(self, points: FacePoints | None) -> ContactSet:
        """These contacts, found at the corners, with the springs of faces at ``points``. Where a face opens, its shear
        stress is released; where it closes, there is none yet."""
        if points is None:
            return self
        assert self.by_length is not None  # `ContactFinder.find` sets it before faces have points
        was, springs = points.before(self.bare, self.by_length), points.springs(self.springs, self.by_length)
        if self.whole is not None:
            springs = springs._replace(cohesion=self.springs.cohesion)
        shear = points.passed_on(self.shear, was)
        stored = self.shear**2 / was.springs(self.springs, self.by_length).shear - shear**2 / springs.shear
        return replace(
            self,
            geometry=points.geometry(),
            springs=springs,
            shear=shear,
            released=self.released + 0.5 * float(stored[points.ends].sum()),
            normal=points.at_points(self.normal),
            lift=points.between_corners(self.lift),
            faces=None if self.faces is None else points.on_bonded(self.faces),
            points=points,
            lumped=self,
            arc=points.between_corners(self.arc) if isinstance(self.arc, np.ndarray) else self.arc,
            swing=points.along_faces(self.swing) if isinstance(self.swing, np.ndarray) else self.swing,
        )

    def misplaced(self, settled: Settled) -> ContactSet | None:
        """The contacts with the springs of faces on the parts that are closed in the result ``settled``; None if they
        are there already."""
        if not isinstance(self.points, FacePoints):
            return None
        better = self.points.better(settled.gap, settled.state, (settled.bonded == 1) & (self.springs.tension > 0))
        return None if better is None else self.on_corners.placed(better)

    def sharing_cohesion(self, state: np.ndarray, bonded: np.ndarray) -> ContactSet:
        """The contacts, with the cohesion of whole faces assigned to those closed in ``state`` with ``bonded`` (n,);
        unchanged if it is already."""
        if self.whole is None:
            return self
        cohesive = self.whole.cohesive(state, bonded)
        if self.cohesive is not None and np.array_equal(cohesive, self.cohesive):
            return self
        found = self.on_corners
        springs = found.springs._replace(cohesion=self.whole.cohesion * cohesive)
        return replace(found, cohesive=cohesive, springs=springs).placed(self._on_parts())

    def along(self, arc: np.ndarray, swing: np.ndarray) -> ContactSet:
        """The contacts with the contributions ``arc`` to gaps and ``swing`` to motion along the edges, (n,) m at their
        corners."""
        if self.points is None:
            return replace(self, arc=arc, swing=swing)
        return replace(self.on_corners, arc=arc, swing=swing).placed(self._on_parts())

    @property
    def on_corners(self) -> ContactSet:
        """The contacts as they were found, with all springs at corners."""
        return self if self.lumped is None else self.lumped

    def _on_parts(self) -> FacePoints | None:
        """The springs on parts of faces in contact; None without."""
        assert self.points is None or isinstance(self.points, FacePoints)
        return self.points

    @property
    def arcs(self) -> tuple[np.ndarray, np.ndarray]:
        """(n,) m each: the arc and the swing of the contacts at their corners."""
        found = self.on_corners
        return found.arc + np.zeros(len(found)), found.swing + np.zeros(len(found))

    def cornered(self, better: ContactSet) -> ContactSet:
        """The contacts, with springs at the corners of those faces whose springs `misplaced` has moved in
        ``better``."""
        here, there = self._on_parts(), better._on_parts()
        assert here is not None and there is not None  # `misplaced`
        return self.on_corners.placed(here.but(there))

    @cached_property
    def gap_before(self) -> np.ndarray:
        """(n,) m: gap at the start of the step, including dilation; negative in penetration."""
        return self.geometry[:, 3] - self.lift

    @cached_property
    def gap(self) -> np.ndarray:
        """(n,) m: the gap to which the linear motion of the step is added to give the gap at its end."""
        return self.gap_before + self.arc

    def blocks_of(self, contact: int) -> tuple[int, ...]:
        """The two blocks of a ``contact``; () for −1."""
        return () if contact < 0 else (int(self.block[contact]), int(self.other[contact]))

    def of_rows(self, value: np.ndarray) -> np.ndarray:
        """(n_rows,) the ``value`` (n,) of contacts for their CONTACT rows."""
        return value

    def shear_of_rows(self, shear: np.ndarray) -> np.ndarray:
        """(n_rows,) N of CONTACT rows from the ``shear`` (n,) of the contacts."""
        return shear

    def __len__(self) -> int:
        return len(self.vertex)

    def rows(self, settled: Settled, acting: np.ndarray | None = None) -> np.ndarray:
        """CONTACT rows of the finished step, in the geometry in which the forces acted: ``acting`` (n, 7) at the
        corners, None for that at the start of the step."""
        geometry, lift, points = self.geometry, self.lift, self._on_parts()
        gap, normal, shear = settled.gap, settled.normal_force, settled.shear_force
        if points is not None:
            geometry, lift = points.corners, self.on_corners.lift
            normal, shear = points.at_corners(normal), points.at_corners(shear)
            gap = points.gap_at_corners(gap)
        rows = np.empty(len(self), CONTACT)
        pairing = Pairing(self.vertex, self.edge, self.block, self.other, self.law, self.inset)
        end = StepEnd(settled.state, settled.bonded, gap, normal, shear, settled.slip, settled.lifted)
        stiffness = self.on_corners.springs.normal
        shape = ContactShape(
            geometry if acting is None else acting, np.ascontiguousarray(geometry[:, 4]), self.tilt, stiffness
        )  # fmt: skip
        fill(rows, tuple(pairing), tuple(end), tuple(SlipBefore(self.slip, self.wear, lift)), tuple(shape))
        if points is not None:
            rows["bare"][points.ends] = np.abs(points.part - [0.0, 1.0])
        if np.any(settled.stretch):
            rows["stretch"] = settled.stretch
        return rows
