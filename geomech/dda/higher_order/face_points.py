"""Contact along faces of blocks of higher order, at integration points with a contact state each.

Where two straight sides touch, their contact stress is integrated with the Gauss–Lobatto rule,

    ∫ f ds ≈ ℓ Σ wᵢ f(sᵢ),   exact for polynomials of degree 2n − 3 with n = p + 2 points, p the higher order of both,

so that stress of degree up to p + 1 loads every deflection as its exact integral does (patch test). Faces of penalty springs
between two blocks of first order keep the two points, and springs, that they have without any block of higher order. Faces that
crush (`crushing`) have more points, `_CRUSHING_POINTS`, at any order, and penalties proportional to wᵢ alone. Joints with a
stiffness kₙ (Pa/m) have springs kₙ ℓ wᵢ. Penalty springs are proportional to wᵢ and, at both ends of a face, as stiff
as those of a corner (`penalty_springs`): the points over which a block tips yield no more than corners do, and a corner
that stays in contact when its face opens keeps its spring and its force. Each point opens, sticks and slides by itself.

The gap at a point is that of the strained blocks, linear between the ends of the face, plus n · (u_a − u_b) of their
deflections. CONTACT rows, one at each end of a face, hold the resultant and the moment of its points; the history of
the points is in the FACE_POINT rows of the state.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...model import CONTACT, FACE_POINT, OPEN, SLIP, STICK, State
from ..contact_detection.contact_records import ContactShape, Pairing, SlipBefore, StepEnd, fill
from ..contact_detection.face_quadrature import FacePoints
from ..contact_detection.inherited_contacts import InheritedContacts
from ..joint_laws.bonds import WITHOUT_GAPS, on_lines
from ..joint_laws.penalty_springs import Springs
from ..kinematics.polygon_quadrature import lobatto_points
from ..open_close.contact_set import ContactSet
from ..open_close.settled_states import Settled
from .deflected_blocks import DeflectedBlocks

#: History of a `ContactSet`, by the names of FACE_POINT rows.
_MEMORY = {"state": "state", "bonded": "bonded", "normal": "normal_force", "shear": "shear_force", "slip": "slip",
           "wear": "wear", "lift": "lift"}  # fmt: skip

#: Positions of points along faces are distinguished to this part of the face.
_NAMED = 1_000_000
#: Points of faces that crush. Between two points the plateau of stress ends where its resultant is not exact: arches of
#: twelve voussoirs with N = 0.1 of the strength times the thickness stand at 1.005 of the thickness of limit analysis, with
#: 10 points at 1.015.
_CRUSHING_POINTS = 16


@dataclass(frozen=True, eq=False)
class Faces:
    """Faces (m,) among the contacts at corners, and their points among all contacts.

    ends     (m, 2)  rows of the corners
    length   (m,)    m, between the ends
    inner    (k,)    rows of corners between the ends, at vertices within a straight side: they carry no force themselves
    inner_at (k,)    the point nearest to each of these, among all contacts
    lone     (k,)    rows of the corners that belong to no face; they come first among all contacts
    first    (m,)    first point of each face among all contacts
    count    (m,)    number of points of each face
    place    (n,)    coordinate of all contacts along the face from 0 to 1; 0 for lone corners
    face     (n,)    face of all contacts; −1 for lone corners
    share    (n,)    weight of each contact in its face
    stiffer  (n,)    ratio of the stiffness of penalty springs to that of two corners' shares, which makes those at the
                     ends of a face as stiff as a corner's
    swapped  (m,)    the vertex at the second end belongs to the block whose edge is touched at the first
    corners  (n_corners, 7)   geometry of the corners
    """

    ends: np.ndarray
    length: np.ndarray
    inner: np.ndarray
    inner_at: np.ndarray
    lone: np.ndarray
    first: np.ndarray
    count: np.ndarray
    place: np.ndarray
    face: np.ndarray
    share: np.ndarray
    stiffer: np.ndarray
    swapped: np.ndarray
    corners: np.ndarray

    @classmethod
    def of(cls, found: ContactSet, order: np.ndarray, by_length: np.ndarray | None = None) -> Faces:
        """Faces of the contacts ``found`` at corners; ``order`` (n_blocks,) is 1 for blocks that do not bend. ``by_length``
        (n_corners,): corners whose normal stiffness is proportional to face length; None: all."""
        geometry = found.geometry
        some = np.flatnonzero((geometry[:, 4] > 0) & (found.corner < 0))
        ends, length, inner = np.zeros((0, 2), np.int64), np.zeros(0), np.zeros((0, 3))
        if len(some) > 1:
            ends, length, inner = _whole_sides(found, *on_lines(found.block, found.other, geometry, some))
        lone = np.setdiff1d(np.arange(len(found)), np.concatenate([ends.ravel(), inner[:, 0].astype(np.int64)]))
        highest = np.maximum(order[found.block], order[found.other]) + 2
        if by_length is not None:
            highest = np.where((highest == 3) & ~by_length, 2, highest)
        highest = np.where(np.isfinite(found.springs.crushing), _CRUSHING_POINTS, highest)
        count = highest[ends[:, 0]]
        rules = {n: lobatto_points(n) for n in np.unique(highest).tolist()}
        first = len(lone) + np.cumsum(count) - count
        of_inner = inner[:, 1].astype(np.int64)
        nearest = [
            int(np.abs(rules[n][0] - place).argmin())
            for n, place in zip(count[of_inner].tolist(), inner[:, 2].tolist(), strict=True)
        ]
        return cls(
            ends=ends,
            length=length,
            inner=inner[:, 0].astype(np.int64),
            inner_at=first[of_inner] + np.array(nearest, np.int64),
            lone=lone,
            first=first,
            count=count,
            place=np.concatenate([np.zeros(len(lone)), *(rules[n][0] for n in count.tolist())]),
            face=np.concatenate([np.full(len(lone), -1), np.repeat(np.arange(len(ends)), count)]),
            share=np.concatenate(
                [
                    np.array([2.0 * rules[n][1][0] for n in highest[lone].tolist()]),
                    *(rules[n][1] for n in count.tolist()),
                ]
            ),
            stiffer=0.5
            / np.concatenate(
                [
                    np.array([rules[n][1][0] for n in highest[lone].tolist()]),
                    *(np.full(n, rules[n][1][0]) for n in count.tolist()),
                ]
            ),
            swapped=found.block[ends[:, 0]] != found.block[ends[:, 1]],
            corners=geometry,
        )

    @cached_property
    def inside(self) -> np.ndarray:
        """(k,) the contacts that are points of faces."""
        return np.flatnonzero(self.face >= 0)

    def _both(self, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """``value`` (n_corners, …) at both ends of the face of each point."""
        at = self.ends[self.face[self.inside]]
        return value[at[:, 0]], value[at[:, 1]]

    def far_ends(self, corners: ContactSet) -> np.ndarray:
        """(n, 2) vertex and edge at the far end of the face of each contact; −1 for lone corners."""
        out = np.full((len(self.face), 2), -1)
        ends = self.ends[self.face[self.inside], 1]
        out[self.inside] = np.stack([corners.vertex[ends], corners.edge[ends]], axis=1)
        return out

    def corner_of(self, contact: int) -> int:
        """The row of a corner of the face of ``contact``."""
        face = int(self.face[contact])
        return int(self.lone[contact]) if face < 0 else int(self.ends[face, 0])

    def between(self, value: np.ndarray) -> np.ndarray:
        """(n,) linear interpolation of the corners' ``value`` (n_corners,) to all contacts."""
        at_first, at_second = self._both(value)
        place = self.place[self.inside]
        return np.concatenate([value[self.lone], at_first + place * (at_second - at_first)])

    def spread(self, force: np.ndarray) -> np.ndarray:
        """(n,) forces of all contacts: in faces, the linear stress with the resultant and moment of ``force``
        (n_corners,)."""
        first, second = self._both(force)
        place = self.place[self.inside]
        linear = (4.0 * first - 2.0 * second) * (1.0 - place) + (4.0 * second - 2.0 * first) * place
        return np.concatenate([force[self.lone], self.share[self.inside] * linear])

    def at_corners(self, force: np.ndarray) -> np.ndarray:
        """(n_corners,) forces with the resultant and the moment of the ``force`` (n,) of all contacts."""
        out = np.zeros(len(self.corners))
        out[self.lone] = force[: len(self.lone)]
        some, place = force[self.inside], self.place[self.inside]
        at = self.ends[self.face[self.inside]]
        np.add.at(out, at[:, 0], (1.0 - place) * some)
        np.add.at(out, at[:, 1], place * some)
        return out

    def of_corners(self, value: np.ndarray) -> np.ndarray:
        """(n_corners,) the ``value`` (n,) at the points that lie on the corners."""
        out = np.empty(len(self.corners), np.asarray(value).dtype)
        out[self.lone] = value[: len(self.lone)]
        out[self.ends[:, 0]] = value[self.first]
        out[self.ends[:, 1]] = value[self.first + self.count - 1]
        out[self.inner] = value[self.inner_at]
        return out

    def least(self, value: np.ndarray) -> np.ndarray:
        """(n_corners,) the least ``value`` (n,) of each corner's face."""
        out = self.of_corners(value)
        lowest = np.full(len(self.ends), np.inf)
        np.minimum.at(lowest, self.face[self.inside], value[self.inside])
        out[self.ends] = lowest[:, None]
        out[self.inner] = lowest[self.face[self.inner_at]]
        return out

    def geometry(self) -> np.ndarray:
        """(n, 7) geometry of all contacts; points of faces have that of the edge at the first end, with their own
        position along it."""
        out = np.empty((len(self.face), 7))
        out[: len(self.lone)] = self.corners[self.lone]
        first, second = self._both(self.corners)
        place, swapped = self.place[self.inside, None], self.swapped[self.face[self.inside], None]
        gap = first[:, 3:4] + place * (second[:, 3:4] - first[:, 3:4])
        # Where the vertex at the far end belongs to the edge's block, the other block's point is its projection.
        far = np.where(swapped, second[:, 5:7] - second[:, 3:4] * second[:, 1:3], second[:, 5:7])
        inside = out[len(self.lone) :]
        inside[:, 0] = first[:, 0]
        inside[:, 1:3], inside[:, 3:4] = first[:, 1:3], gap
        inside[:, 5:7] = first[:, 5:7] + place * (far - first[:, 5:7])
        inside[:, 4] = self.share[self.inside] * self.length[self.face[self.inside]]
        return out

    def springs(self, corner: Springs, by_length: tuple[np.ndarray, np.ndarray]) -> Springs:
        """Springs of all contacts from those of the corners.

        ``by_length`` (n_corners,) twice: corners whose normal, and whose shear stiffness is proportional to face
        length.
        """
        first, second = self._both(self.corners[:, 4])
        # Corners within a side have a part of its length, but add no penalty springs.
        whole = np.concatenate([np.ones(len(self.lone)), self.length[self.face[self.inside]] / (first + second)])

        def shared(value: np.ndarray, which: np.ndarray) -> np.ndarray:
            first, second = self._both(value)
            sums = np.concatenate([value[self.lone], first + second]) * self.share
            return np.where(same(which), whole, self.stiffer) * sums

        def same(value: np.ndarray) -> np.ndarray:
            return np.concatenate([value[self.lone], self._both(value)[0]])

        own = {name: same(value) for name, value in corner._asdict().items()}
        for name, which in zip(("normal", "shear"), by_length, strict=True):
            own[name] = shared(getattr(corner, name), which)
        strength, always = np.where(self.face < 0, 1.0 / self.share, 1.0), np.ones(len(self.corners), bool)
        for name in ("sliding", "hold", "cohesion", "tension", "crushing"):
            own[name] = shared(getattr(corner, name), always) * strength
        return Springs(**own)

    def share_shear(self, vectors: np.ndarray, block: np.ndarray) -> None:
        """Unlike springs in first-order faces, points of faces slide where they are."""


@dataclass(frozen=True, eq=False)
class FaceContacts(ContactSet):
    """Contacts with integration points along faces (``points``), and the corners in ``lumped``.

    ``deflected`` (n,) m is the contribution of the blocks' deflections to the gaps at the start of the step.
    """

    deflected: np.ndarray | float = 0.0

    @classmethod
    def along_faces(
        cls, corners: ContactSet, order: np.ndarray, memory: np.ndarray | None, by_length: tuple[np.ndarray, np.ndarray]
    ) -> FaceContacts:
        """Contacts at ``corners``, with points along whole faces, and their history from the FACE_POINT rows
        ``memory``.

        ``by_length`` as in `Faces.springs`.
        """
        faces = Faces.of(corners, order, by_length[0])
        own: dict[str, Any] = {}
        for field in fields(ContactSet):
            value = getattr(corners, field.name)
            if isinstance(value, np.ndarray) and field.name not in ("geometry", "cohesive"):
                own[field.name] = np.concatenate([value[faces.lone], faces._both(value)[0]])
            else:
                own[field.name] = value
        own |= {
            "geometry": faces.geometry(), "springs": faces.springs(corners.springs, by_length), "points": faces,
            "lumped": corners, "faces": None, "whole": None, "tried": None,
            "lift": faces.between(corners.lift), "arc": 0.0, "swing": 0.0,
            "inset": np.zeros(len(faces.face), bool),
        }  # fmt: skip
        out = cls(**own)._states_of_ends()._with_history(memory)
        return out if corners.tried is None else out._trying_ends(corners.tried)

    def _trying_ends(self, tried: tuple[np.ndarray, ...]) -> FaceContacts:
        """The search begins from the states, directions of sliding and bonds ``tried`` (n_corners,), at each point from those
        of the nearer end of its face."""
        faces, near = self.on_faces, self.on_faces.place[self.on_faces.inside] < 0.5
        at_points = [
            np.concatenate([value[faces.lone], np.where(near, *faces._both(value))]) for value in (tried[0], tried[1])
        ]
        return replace(self, tried=(at_points[0], at_points[1], self.bonded))

    @property
    def on_faces(self) -> Faces:
        """The faces and their points."""
        assert isinstance(self.points, Faces)
        return self.points

    def _states_of_ends(self) -> FaceContacts:
        """Initial state of points without history: closed or bonded where both ends of their face are, with the linear
        stress of the ends' forces."""
        faces, corners, inside = self.on_faces, self.on_corners, self.on_faces.inside
        state, bonded = self.state.copy(), self.bonded.copy()
        first, second = faces._both(corners.state)
        both = (first != OPEN) & (second != OPEN)
        state[inside] = np.where(both, np.where((first == SLIP) & (second == SLIP), SLIP, STICK), OPEN)
        one, two = faces._both(corners.bonded)
        bonded[inside] = np.where((one > 0) & (two > 0), one, 0)
        normal, shear = faces.spread(corners.normal), faces.spread(corners.shear)
        return replace(
            self, state=state, bonded=bonded, normal=normal, shear=shear, slip=faces.between(corners.slip),
            wear=faces.between(corners.wear), stretch=np.zeros(len(state)),
            direction=np.where(state == SLIP, np.sign(shear), 0.0),
        )._with_friction_states()  # fmt: skip

    def _with_history(self, memory: np.ndarray | None) -> FaceContacts:
        """With the history of the FACE_POINT rows ``memory`` for the same places of the same two blocks."""
        if memory is None or not len(memory):
            return self
        own = {name: getattr(self, name).copy() for name in _MEMORY}
        length = self.geometry[:, 4]
        at = _matching(self, memory)
        known = np.flatnonzero(at >= 0)
        rows = memory[at[known]]
        for name, column in _MEMORY.items():
            own[name][known] = rows[column]
        # Points of another part of the face carry the stress that was there.
        inside = self.on_faces.face[known] >= 0
        ratio = np.where(inside & (rows["length"] > 0), length[known] / np.maximum(rows["length"], 1e-300), 1.0)
        for name in ("normal", "shear"):
            own[name][known] *= ratio
        own["bonded"] = np.where((self.springs.cohesion == 0) & (self.springs.tension == 0), 0, own["bonded"])
        own["direction"] = np.where(own["state"] == SLIP, np.sign(own["shear"]), 0.0)
        return replace(self, **own)._with_friction_states()

    def _with_friction_states(self) -> FaceContacts:
        rough = (self.springs.peak > 0) | (self.bonded > 0)
        state = self.state.copy()
        state[(state == SLIP) & rough & (self.direction == 0)] = STICK
        state[(state == STICK) & ~rough] = SLIP
        return replace(self, state=state)

    @cached_property
    def gap_before(self) -> np.ndarray:
        return self.geometry[:, 3] + self.deflected - self.lift

    def placed(self, points: FacePoints | None) -> FaceContacts:
        raise TypeError("points of faces do not move along their face")

    def along(self, arc: np.ndarray, swing: np.ndarray) -> FaceContacts:
        faces = self.on_faces
        corners = replace(self.on_corners, arc=arc, swing=swing)
        return replace(self, lumped=corners, arc=faces.between(arc), swing=faces.between(swing))

    def misplaced(self, settled: Settled) -> None:
        return None

    def sharing_cohesion(self, state: np.ndarray, bonded: np.ndarray) -> FaceContacts:
        return self

    def like(self, rows: np.ndarray) -> FaceContacts:
        return self

    def trying(self, rows: np.ndarray, without_lost: bool = False) -> FaceContacts:
        return self

    def of_rows(self, value: np.ndarray) -> np.ndarray:
        return self.on_faces.least(value)

    def shear_of_rows(self, shear: np.ndarray) -> np.ndarray:
        return self.on_faces.at_corners(shear)

    def rows(self, settled: Settled, acting: np.ndarray | None = None) -> np.ndarray:
        """CONTACT rows at the corners, with the resultant and moment of the points of their faces."""
        faces, corners = self.on_faces, self.on_corners
        closed = settled.state != OPEN
        state = np.where(closed, np.where(settled.state == SLIP, 1.0, 0.0), 2.0)
        kind = np.array([STICK, SLIP, OPEN])[faces.least(state).astype(int)]
        rows = np.empty(len(corners), CONTACT)
        bonded = np.where(settled.bonded > 0, settled.bonded, 9).astype(float)
        lowest = faces.least(bonded)
        pairing = Pairing(corners.vertex, corners.edge, corners.block, corners.other, corners.law, corners.inset)
        end = StepEnd(
            kind, np.where(lowest > 8, 0, lowest).astype(np.int64), faces.of_corners(settled.gap),
            faces.at_corners(settled.normal_force), faces.at_corners(settled.shear_force),
            faces.of_corners(settled.slip), np.zeros(len(corners)),
        )  # fmt: skip
        lift = faces.of_corners(self._lift_after(settled))
        before = SlipBefore(faces.of_corners(self.slip), faces.of_corners(self.wear), lift)
        shape = ContactShape(
            corners.geometry if acting is None else acting, np.ascontiguousarray(corners.geometry[:, 4]), corners.tilt,
            corners.springs.normal,
        )  # fmt: skip
        fill(rows, tuple(pairing), tuple(end), tuple(before), tuple(shape))
        return rows

    def _lift_after(self, settled: Settled) -> np.ndarray:
        """(n,) m: lift at the end of the step. Faces that crush meet ever closer; others that do not fit stay so."""
        lift = self.lift + settled.lifted
        return np.where(np.isfinite(self.springs.crushing), lift, np.maximum(lift, np.minimum(self.lift, 0.0)))

    def memory(self, settled: Settled, shear: np.ndarray, points: np.ndarray) -> np.ndarray:
        """FACE_POINT rows at the end of the step with the ``settled`` contacts.

        ``shear`` (n,) N is the shear force and ``points`` (n, 2) m the position of the contacts at that time.
        """
        rows = np.zeros(len(self), FACE_POINT)
        faces = self.on_faces
        rows["block"], rows["other"] = self.block, self.other
        rows["vertex"], rows["edge"] = self.vertex, self.edge
        rows["far_vertex"], rows["far_edge"] = faces.far_ends(self.on_corners).T
        rows["place"], rows["length"], rows["point"] = faces.place, self.geometry[:, 4], points
        rows["state"], rows["bonded"] = settled.state, settled.bonded
        rows["normal_force"], rows["shear_force"], rows["gap"] = settled.normal_force, shear, settled.gap
        rows["slip"], rows["wear"] = self.slip + settled.slip, self.wear + np.abs(settled.slip)
        rows["lift"] = self._lift_after(settled)
        return rows


def _whole_sides(
    found: ContactSet, some: np.ndarray, start: np.ndarray, along: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sides that touch along their whole length among the contacts ``some`` (k,), which are sorted by face.

    ``start`` (m + 1,) is the first contact of each face, ``along`` (k,) m the coordinate. Returns rows of the sides'
    ends (m, 2), lengths (m,), and rows, faces and coordinates (0 to 1) of corners between the ends (n, 3).
    """
    ends: list[tuple[int, int]] = []
    length: list[float] = []
    inner: list[tuple[int, int, float]] = []
    for first, last in zip(start[:-1].tolist(), start[1:].tolist(), strict=True):
        if last - first < 2:
            continue
        rows, at = some[first:last], along[first:last]
        if last - first > 2:
            order = np.argsort(at, kind="stable")
            rows, at = rows[order], at[order]
        extent = abs(float(at[-1] - at[0]))
        sums = float(found.geometry[rows, 4].sum())
        if abs(sums - extent) > WITHOUT_GAPS * extent or (found.law[rows] != found.law[rows[0]]).any():
            continue
        share = (at - at[0]) / (at[-1] - at[0])
        inner += [(row, len(ends), place) for row, place in zip(rows[1:-1].tolist(), share[1:-1].tolist(), strict=True)]
        ends.append((rows[0], rows[-1]))
        length.append(extent)
    return (
        np.array(ends, np.int64).reshape(-1, 2), np.array(length), np.array(inner, float).reshape(-1, 3),
    )  # fmt: skip


def _matching(found: FaceContacts, memory: np.ndarray) -> np.ndarray:
    """(n,) row of ``memory`` for each contact of ``found``, −1 for none: the same point, a corner that was the end of a
    face, or the nearest point between the same two sides."""
    faces, n = found.on_faces, len(found)
    far = faces.far_ends(found.on_corners)
    # Coordinates along a face, in millionths, identify points.
    names_now = np.column_stack([found.vertex, found.edge, far, np.round(faces.place * _NAMED)]).astype(np.int64)
    names = [memory[name] for name in ("vertex", "edge", "far_vertex", "far_edge")]
    names_before = np.column_stack([*names, np.round(memory["place"] * _NAMED)]).astype(np.int64)
    if names_now.shape == names_before.shape and np.array_equal(names_now, names_before):
        return np.arange(n)
    number = np.unique(np.concatenate([names_now, names_before]), axis=0, return_inverse=True)[1].ravel()
    row = np.full(int(number.max()) + 1, -1)
    row[number[n:]] = np.arange(len(memory))
    out = row[number[:n]]
    unknown = np.flatnonzero(out < 0)
    if len(unknown):
        out[unknown] = _nearest(found, memory, names_now, names_before, unknown)
    return out


def _nearest(
    found: FaceContacts, memory: np.ndarray, names_now: np.ndarray, names_before: np.ndarray, unknown: np.ndarray
) -> np.ndarray:
    """(k,) as `_matching`, for the contacts ``unknown`` (k,) that are not in ``memory``.

    ``names_now`` (n, 5) and ``names_before`` identify contacts: corners by their vertex and edge, other points by their position.
    """
    alone, place = names_before[:, 2] < 0, names_before[:, 4]
    corner: dict[tuple[int, ...], int] = {}
    for rows, ends in ((alone | (place == 0), names_before[:, :2]), (~alone & (place == _NAMED), names_before[:, 2:4])):
        corner |= dict(zip(map(tuple, ends[rows].tolist()), np.flatnonzero(rows).tolist(), strict=True))
    low, high = np.minimum(memory["block"], memory["other"]), np.maximum(memory["block"], memory["other"])
    out = np.full(len(unknown), -1)
    for k, c in enumerate(unknown.tolist()):
        v, e, w, f, at = names_now[c].tolist()
        known = corner.get((v, e), -1) if w < 0 or at == 0 else -1
        if known < 0 and at == _NAMED:
            known = corner.get((w, f), -1)
        if known < 0 and w >= 0:
            one, two = sorted((int(found.block[c]), int(found.other[c])))
            near = np.flatnonzero((low == one) & (high == two) & ~alone)
            if len(near):
                apart = np.hypot(*(memory["point"][near] - found.geometry[c, 5:7]).T)
                best = int(np.argmin(apart))
                if apart[best] <= memory["length"][near[best]] + found.geometry[c, 4]:
                    known = int(near[best])
        out[k] = known
    return out


def without_remembered(forces: InheritedContacts, found: ContactSet, memory: np.ndarray | None) -> InheritedContacts:
    """``forces`` without those on contacts of ``found`` in faces whose points have a ``memory``, FACE_POINT rows: they
    continue with that."""
    if memory is None or not len(memory):
        return forces
    left = ~_remembered(found, memory)[forces.which]
    return replace(forces, **{field.name: getattr(forces, field.name)[left] for field in fields(forces)})


def _remembered(found: ContactSet, memory: np.ndarray | None) -> np.ndarray:
    """(n,) bool: contacts of ``found`` that are ends of faces in ``memory``, FACE_POINT rows."""
    if memory is None or not len(memory) or not len(found):
        return np.zeros(len(found), bool)
    vertex, edge = (np.concatenate([memory[name], memory[f"far_{name}"]]) for name in ("vertex", "edge"))
    far = int(max(edge.max(), found.edge.max())) + 1
    return np.isin(found.vertex * far + found.edge, vertex * far + edge)


def at_their_points(
    rows: np.ndarray, found: ContactSet, which: np.ndarray, blocks: DeflectedBlocks, state: State,
    by_length: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """CONTACT ``rows`` of ``found`` with the gaps that inherited contacts, those in ``which``, have where blocks are
    deflected as in ``state``; and FACE_POINT rows of faces that they close, whose points carry the resultant and moment of
    their ends. ``by_length`` as in `Faces.springs`."""
    vertices, out = np.ascontiguousarray(state.vertices), rows.copy()
    closed = rows["state"] != OPEN
    # (Open contacts that keep the gap that was found keep its lift.)
    moved = which[closed[which] | (rows["gap"][which] != found.gap[which])]
    out["lift"][moved] = found.geometry[moved, 3] + blocks.gaps(found, vertices, state)[moved] - rows["gap"][moved]
    own: dict[str, Any] = {name: np.array(rows[name]) for name in ("state", "bonded", "slip", "wear")}
    corners = replace(found, **own, normal=rows["normal_force"], shear=rows["shear_force"], lift=out["lift"])
    every = FaceContacts.along_faces(corners, blocks.order, None, by_length)
    faces, inherited = every.on_faces, np.zeros(len(rows), bool)
    inherited[which] = closed[which]
    # Where only one end is inherited, the other keeps its gap. Faces that are new as such continue with what their
    # corners bear.
    memory = state.face_points
    new = ~_remembered(found, None if memory is None else memory[memory["far_vertex"] >= 0])
    pressed = inherited[faces.ends].all(axis=1) | (closed & new)[faces.ends].all(axis=1)
    apart = every.geometry[:, 3] + blocks.gaps(every, vertices, state)
    # Parts may overlap by the square of the deflection, or by what a part of first order has lost of it.
    overlaps = (every.state == OPEN) & (apart - every.lift < 0.0)
    alone = np.flatnonzero(overlaps[: len(faces.lone)])
    out["lift"][faces.lone[alone]] = apart[alone]
    overlapping = np.zeros(len(pressed), bool)
    overlapping[faces.face[overlaps & (faces.face >= 0)]] = True
    some = np.flatnonzero(pressed | overlapping)
    push, drag = every.normal.copy(), every.shear.copy()
    for face in np.flatnonzero(pressed).tolist():
        own_points = slice(int(faces.first[face]), int(faces.first[face] + faces.count[face]))
        if push[own_points].min() < 0.0 and not (every.bonded[own_points] > 0).all():
            # The linear stress would pull: the ends carry their forces alone.
            for values, name in ((push, "normal_force"), (drag, "shear_force")):
                values[own_points] = 0.0
                values[[own_points.start, own_points.stop - 1]] = rows[name][faces.ends[face]]
    points = np.flatnonzero(np.isin(faces.face, some))
    stiff = np.maximum(every.springs.normal[points], np.finfo(float).tiny)
    point_rows = np.zeros(len(points), FACE_POINT)
    point_rows["vertex"], point_rows["edge"] = every.vertex[points], every.edge[points]
    point_rows["block"], point_rows["other"] = every.block[points], every.other[points]
    point_rows["far_vertex"], point_rows["far_edge"] = faces.far_ends(corners)[points].T
    point_rows["place"], point_rows["point"] = faces.place[points], every.geometry[points, 5:7]
    point_rows["length"], point_rows["bonded"] = every.geometry[points, 4], every.bonded[points]
    point_rows["state"] = np.where((push[points] > 0.0) | (every.bonded[points] > 0), every.state[points], OPEN)
    point_rows["normal_force"], point_rows["shear_force"] = push[points], drag[points]
    point_rows["slip"], point_rows["wear"] = every.slip[points], every.wear[points]
    gap = np.where(overlaps[points], 0.0, apart[points] - every.lift[points])
    point_rows["gap"] = np.where(pressed[faces.face[points]], -push[points] / stiff, gap)
    point_rows["lift"] = apart[points] - point_rows["gap"]
    for name in ("gap", "lift"):
        by_point = np.zeros(len(apart))
        by_point[points] = point_rows[name]
        out[name][faces.ends[some, 0]] = by_point[faces.first[some]]
        out[name][faces.ends[some, 1]] = by_point[(faces.first + faces.count - 1)[some]]
    return out, point_rows
