"""Springs inside joint faces, at positions where they give the normal force and moment of the face's linear gap.

The faces of uniformly strained blocks separate along a straight line, with the gap g(s). A joint of stiffness kₙ (Pa/m)
without tension carries the pressure −kₙ g where g < 0, on the part c of the face length ℓ:

    N = −kₙ ∫ g ds,    M = −kₙ ∫ g s ds    over that part; c = ℓ or c = 3 (ℓ/2 − e), e = M/N (a triangle of pressure).

Two springs kₙ c/2 at the Gauss points of the part give both exactly; at the ends of the face they would resist rotation
with kₙ ℓ³/4 instead of kₙ ℓ³/12. The end of the part follows from the gap at the end of the step: a step whose faces
end elsewhere than assumed is repeated (Newton's method; the pressure vanishes there, so that N changes with the square
of the error).

Bonds without a joint stiffness, which carry tension to their extreme fibre, consist of the solver's penalty springs. At
the corners of a face these would prevent every rotation; but a first-order block cannot bend, so the face must rotate
as the block would bend under the moment on it. A beam of the block's depth, with the second moment I about the centroid
across the face and the distance h from it to the face, rotates by

    θ = M h / (E' I / 2h)        (rectangle: M h / (E' ℓ³/12); Kawai 1978 gives rigid blocks this compliance
    throughout),

and the two springs are placed inside the corners at the distance that gives this rotation. Tangentially both act at the
centre of the face: the faces of a bending block are strained by an amount that varies across the block, and likewise
its neighbours', and tangential springs at two places would prevent that. Bricks in courses, bricks in bond and bonded
cells of any shape then bend like a beam, the more accurately the more of them there are. Otherwise they lock:
displacements that agree at the corners and are linear in every block allow no bending. (Triangles, with three springs,
do not lock.) The springs have the part ℓ/w of the penalty stiffness, with the width w = √(12 I / A) of the block along
the face: under uniform stress all faces of a block then deform equally. If short faces were as stiff as long ones, they
would carry many times the stress of the rock and fail at a fraction of the strength.

CONTACT rows hold forces at the corners, where contacts are found: the pair of corner forces with the same resultant and
moment, which causes the same stress. (The shear force carried over to the next step is that of the springs.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...compiled import kept
from ...model import OPEN
from ..joint_laws.bonds import WITHOUT_GAPS, BondedFaces, on_lines
from ..joint_laws.penalty_springs import Springs
from ..kinematics.tolerances import NOTABLE

#: Distance between the two Gauss points of an interval, relative to its length.
_GAUSS = 1 / np.sqrt(3.0)
#: Springs at this relative distance from each other are at the corners of the face.
_AT_CORNERS = 0.99


class FaceForces(NamedTuple):
    """Last forces of contacts (n,): ``normal`` (N), the part ``bare`` of the face, from the corner on, without contact,
    and whether a bond ``holds`` that may carry tension."""

    normal: np.ndarray
    bare: np.ndarray
    holds: np.ndarray


@dataclass(frozen=True, eq=False)
class FacePoints:
    """Faces (m,) with a contact at either end and springs inside, with the parts that are assumed in contact.

    ends      (m, 2)  rows of the step's `ContactSet`
    corners   (n, 7)  geometry of all its rows, at the corners
    length    (m,)    m
    part      (m, 2)  start and end of the part in contact, relative to the face, from its first end
    tensile   (m,)    bonds may carry tension: the part is the whole face
    shortest  (m,)    least length of a part: below it, the springs are those of a corner (`contact_springs.least_face`)
    apart     (m,)    distance between the two springs, relative to the part
    bends     (m,)    bonds that deform as their blocks would bend: tangentially both springs act at the face's centre
    share     (m,)    share of the stiffness at the corners that its springs have
    last_change  (m, 2)  change of the part's ends in the last iteration of the step
    relaxation   (m,)    relaxation factor of the change of the ends: halved at every reversal
    """

    ends: np.ndarray
    corners: np.ndarray
    length: np.ndarray
    part: np.ndarray
    tensile: np.ndarray
    shortest: np.ndarray
    apart: np.ndarray
    bends: np.ndarray
    share: np.ndarray
    last_change: np.ndarray
    relaxation: np.ndarray

    @classmethod
    def of(
        cls,
        block: np.ndarray,
        other: np.ndarray,
        geometry: np.ndarray,
        stiff: np.ndarray,
        last: FaceForces,
        least: np.ndarray,
        softened: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]],
    ) -> FacePoints | None:
        """Faces among contacts (n,); None without any.

        ``stiff``: 1 where the law has a stiffness, 2 where a bond represents the bending of its blocks, 0 for neither;
        ``last``: their last forces; ``least`` (m): the stiffness is at least that of this length of face;
        ``softened(ends, length)`` gives ``apart`` and ``share`` of bonds.
        """
        holds = last.holds
        some = np.flatnonzero((stiff > 0) & (geometry[:, 4] > 0))
        if len(some) < 2:
            return None
        some, start, along = on_lines(block, other, geometry, some)
        two = np.flatnonzero(np.diff(start) == 2)
        ends, places = some[start[two, None] + [0, 1]], along[start[two, None] + [0, 1]]
        length = np.abs(places[:, 1] - places[:, 0])
        whole = np.abs(geometry[ends, 4].sum(axis=1) - length) <= WITHOUT_GAPS * length
        # A bond at one end only (the other end is where a crack has cut the face) stays at its corner: on a part that
        # changes with the pressure it would be another spring in every step, and create energy.
        whole &= (stiff[ends[:, 0]] == stiff[ends[:, 1]]) & (holds[ends[:, 0]] == holds[ends[:, 1]])
        if not whole.any():
            return None
        ends, length = ends[whole], length[whole]
        tensile, shortest = holds[ends].all(axis=1), np.minimum(2 * least[ends].max(axis=1) / length, 1.0)
        apart, share, glued = np.full(len(ends), _GAUSS), np.ones(len(ends)), stiff[ends[:, 0]] == 2
        if glued.any():
            shortest[glued] = 1.0
            apart[glued], share[glued] = softened(ends[glued], length[glued])
            inside = (apart < _AT_CORNERS) | (share < _AT_CORNERS)
            ends, length, tensile, shortest, apart, share, glued = (
                each[inside] for each in (ends, length, tensile, shortest, apart, share, glued)
            )
        part = _left(last.bare[ends], _pressed(last.normal[ends], tensile, shortest), tensile, shortest)
        still, full = np.zeros_like(part), np.ones(len(part))
        return cls(ends, geometry, length, part, tensile, shortest, apart, glued, share, still, full)

    def pressed_by(self, normal: np.ndarray) -> FacePoints:
        """The same faces, in contact on the parts that carry the corner forces ``normal`` (n,) N."""
        return replace(self, part=_pressed(normal[self.ends], self.tensile, self.shortest))

    def before(self, bare: np.ndarray, stiff_in_shear: np.ndarray) -> FacePoints:
        """The same faces on the parts that the last step has left in contact, ``bare`` (n,) as in `ContactSet`: those
        whose shear stiffness is proportional to their length (``stiff_in_shear``); the others unchanged."""
        first, second = bare[self.ends].T
        known = (first >= 0) & (second >= 0) & (first + second < 1) & stiff_in_shear[self.ends[:, 0]]
        return replace(self, part=np.where(known[:, None], np.stack([first, 1 - second], axis=1), self.part))

    def passed_on(self, shear: np.ndarray, was: FacePoints) -> np.ndarray:
        """(n,) initial shear force of these springs, N, from the ``shear`` (n,) of the springs of the faces ``was``.

        That shear is taken as a linear stress along the old part. It continues where old and new parts overlap, with
        the resultant and moment of the overlap, and without an increase of stored energy.
        """
        out = shear.copy()
        if (was.part == self.part).all():
            return out
        low, high = was.part.T
        midpoint, half = 0.5 * (low + high), 0.5 * (high - low)
        on_first, on_second = shear[self.ends].T
        mean, tilt = 0.5 * (on_first + on_second), 0.5 * (on_second - on_first) / self.apart
        a, b = np.clip((self.part.T - midpoint) / half, -1.0, 1.0)
        total = mean * (b - a) + tilt * (b**2 - a**2) / 2
        moment = mean * (b**2 - a**2) / 2 + tilt * (b**3 - a**3) / 3
        first, second = (self.place.T - midpoint) / half
        on_low = (second * total - moment) / (second - first)
        # A line fitted to a stress that vanishes within the part changes sign beyond.
        one_way = on_first * on_second >= 0
        on_low = np.where(one_way, np.clip(on_low, np.minimum(total, 0.0), np.maximum(total, 0.0)), on_low)
        moved = (was.part != self.part).any(axis=1)
        out[self.ends[moved]] = np.stack([on_low, total - on_low], axis=1)[moved]
        return out

    def but(self, others: FacePoints) -> FacePoints | None:
        """These faces without those whose part differs in ``others`` (the same faces); None if none remains."""
        kept = (self.part == others.part).all(axis=1)
        if not kept.any():
            return None
        own = {name: getattr(self, name)[kept] for name in self.__dataclass_fields__ if name != "corners"}
        return replace(self, **own)

    @property
    def place(self) -> np.ndarray:
        """(m, 2) positions of the springs along the face, from 0 to 1."""
        low, high = self.part[:, :1], self.part[:, 1:]
        return low + (high - low) * (0.5 + np.multiply.outer(self.apart, [-0.5, 0.5]))

    def geometry(self) -> np.ndarray:
        """(n, 7) geometry of the contacts, moved to their springs."""
        out = self.corners.copy()
        near, far = self.ends, self.ends[:, ::-1]
        vertex, across = self.corners[near, 5:7], self.corners[near, 1:3]
        # The far end of the face: the far vertex, or its projection on the face where that vertex belongs to the other
        # block.
        beyond = self.corners[far, 3]
        along = vertex[:, 1] - vertex[:, 0]
        same = np.einsum("mi,mi->m", across[:, 0], across[:, 1]) > 0
        foot = np.where(same, 0.0, 1.0)[:, None, None] * beyond[..., None] * across[:, ::-1]
        share = np.abs(self.place - [0.0, 1.0])
        sense = np.array([1.0, -1.0])[None, :, None]
        out[near, 5:7] = vertex + share[..., None] * (sense * along[:, None] - foot)
        out[:, 3] = self.between_corners(self.corners[:, 3])
        out[near, 4] = (0.5 * (self.part[:, 1] - self.part[:, 0]) * self.length)[:, None]
        return out

    def share_shear(self, vectors: np.ndarray, block: np.ndarray) -> None:
        """Give both springs of bending faces the tangential motion at the centre of the face, in place.

        ``vectors`` (n, 2, 12) as `contact_vectors`; ``block`` (n,) that of the vertex.
        """
        if not self.bends.any():
            return
        one, two = self.ends[self.bends].T
        # Seen from the other block, whose edge runs the other way, the sides are exchanged and the motion is the same.
        swapped = (block[one] != block[two])[:, None]
        along, other = vectors[one, 1], vectors[two, 1]
        mean = 0.5 * (along + np.where(swapped, np.roll(other, 6, axis=1), other))
        vectors[one, 1], vectors[two, 1] = mean, np.where(swapped, np.roll(mean, 6, axis=1), mean)

    def along_faces(self, value: np.ndarray) -> np.ndarray:
        """(n,) tangential motion at the springs, from ``value`` (n,) at the corners."""
        out = self.between_corners(value)
        ends = self.ends[self.bends]
        out[ends] = out[ends].mean(axis=1, keepdims=True)
        return out

    def springs(self, lumped: Springs, stiff_in_shear: np.ndarray) -> Springs:
        """Springs with the lengths of their parts, from the springs ``lumped`` at the corners.

        ``stiff_in_shear`` (n,) bool: contacts whose law has a shear stiffness."""
        ratio = np.ones(len(self.corners))
        lengths = 0.5 * (self.part[:, 1] - self.part[:, 0]) * self.length
        ratio[self.ends] = lengths[:, None] / self.corners[self.ends, 4]
        share = np.ones(len(self.corners))
        share[self.ends] = self.share[:, None]
        return lumped._replace(
            normal=lumped.normal * ratio * share,
            shear=np.where(stiff_in_shear, lumped.shear * ratio, lumped.shear * share),
            cohesion=lumped.cohesion * ratio,
            tension=lumped.tension * ratio,
            crushing=lumped.crushing * ratio,
        )

    def on_bonded(self, faces: BondedFaces) -> BondedFaces:
        """Bonded ``faces`` found at the corners, with the lever arms of their springs."""
        arm = np.full(len(self.corners), np.nan)
        arm[faces.rows] = faces.arm
        first, second = arm[self.ends].T
        arm[self.ends] = first[:, None] + self.place * (second - first)[:, None]
        return faces._replace(arm=arm[faces.rows])

    def at_points(self, force: np.ndarray) -> np.ndarray:
        """(n,) normal forces of the springs, N, from the ``force`` (n,) of CONTACT rows at the corners."""
        out, (first, second) = force.copy(), self.place.T
        at_first, at_second = force[self.ends].T
        out[self.ends[:, 0]] = (second * (at_first + at_second) - at_second) / (second - first)
        out[self.ends[:, 1]] = (at_second - first * (at_first + at_second)) / (second - first)
        return out

    def at_corners(self, force: np.ndarray) -> np.ndarray:
        """(n,) corner forces, N, with the resultant and moment of the springs' ``force`` (n,), normal or shear.

        For shear forces, whose lever arms (the gaps) are also linear along the face, they strain the blocks equally.
        """
        out, (first, second) = force.copy(), self.place.T
        on_first, on_second = force[self.ends].T
        out[self.ends[:, 0]] = on_first * (1 - first) + on_second * (1 - second)
        out[self.ends[:, 1]] = on_first * first + on_second * second
        return out

    def between_corners(self, value: np.ndarray) -> np.ndarray:
        """(n,) linear interpolation of ``value`` (n,) from the corners to the springs."""
        out, place = value.copy(), self.place
        at_first, at_second = value[self.ends].T
        out[self.ends] = at_first[:, None] + place * (at_second - at_first)[:, None]
        return out

    def gap_at_corners(self, gap: np.ndarray) -> np.ndarray:
        """(n,) gaps at the corners, m: linear extrapolation of the ``gap`` (n,) at the springs."""
        out, (first, second) = gap.copy(), self.place.T
        at_first, at_second = gap[self.ends].T
        slope = (at_second - at_first) / (second - first)
        out[self.ends] = np.stack([at_first - first * slope, at_first + (1 - first) * slope], axis=1)
        return out

    def better(self, gap: np.ndarray, state: np.ndarray, holds: np.ndarray) -> FacePoints | None:
        """The faces with the parts that are in contact at the end of a step; None where these are the assumed parts.

        ``gap`` (n,) m and ``state`` (n,) are those of the springs; ``holds`` (n,) bool: bonds that may carry tension.

        A part with one open spring carries no moment, and its gaps do not determine its length: the resultant acts
        beyond the other spring, so that the part grows to that side, or is halved where the face ends there. A part
        grows by at most its length at either end, because on a part that is too short the block rotates too far. (A
        spring may be open without a positive gap: its dashpot releases it earlier.)
        """
        tensile = holds[self.ends].all(axis=1)
        part = _touching(self.gap_at_corners(gap)[self.ends], tensile, self.shortest, self.part)
        low, high = self.part.T
        length = high - low
        part = np.clip(part, (low - length)[:, None], (high + length)[:, None])
        # A part that has moved to the other side is searched for on both.
        over = (part[:, 0] >= high) | (part[:, 1] <= low)
        part[over] = np.stack([np.minimum(part[:, 0], low), np.maximum(part[:, 1], high)], axis=1)[over]
        first, second = ((state[self.ends] != OPEN) | (gap[self.ends] <= 0)).T
        one_open = (first != second) & ~tensile & (length > self.shortest)
        half = np.maximum(0.5 * length, self.shortest)
        to_low = np.where(low > 0, [np.maximum(low - length, 0.0), high], [low, low + half])
        to_high = np.where(high < 1, [low, np.minimum(high + length, 1.0)], [high - half, high])
        part[one_open] = np.where(first, to_low, to_high).T[one_open]
        # Faces that rotate the same block may alternate indefinitely: the step is halved at every reversal.
        way = part - self.part
        relaxation = np.where((way * self.last_change).sum(axis=1) < 0, 0.5 * self.relaxation, self.relaxation)
        way *= relaxation[:, None]
        # Forces are accurate to the square of this. The next step begins from the geometry, so that statics converge.
        off = np.abs(way).max(axis=1) > NOTABLE * (part[:, 1] - part[:, 0])
        if not off.any():
            return None
        way[~off] = 0.0
        return replace(
            self, part=self.part + way, last_change=np.where(off[:, None], way, self.last_change), relaxation=relaxation
        )


@kept(fastmath=False, error_model="numpy", nogil=True)
def give_by_bending(owner, across, point, vertices, following, start, modulus, bends):
    """(m, 2): compliance h / (E' I / 2h), rad/(N m), of the block ``owner`` (m,) behind a face, and its width √(12 I /
    A), m.

    The face has the normal ``across`` (m, 2) through ``point`` (m, 2); I is the block's second moment along the face, h
    the distance of its centroid. Both are 0 for blocks that do not bend. ``vertices`` (n, 2), ``following`` (n,) the
    next vertex of each, ``start`` the first of each block, ``modulus`` in Pa. (A face shorter than the block is wide
    rotates the whole width.)
    """
    out = np.zeros((owner.shape[0], 2))
    for f in range(owner.shape[0]):
        b = owner[f]
        if not bends[b]:
            continue
        nx, ny = across[f, 0], across[f, 1]
        area = first = second = far = 0.0
        for v in range(start[b], start[b + 1]):
            w = following[v]
            # Components along the face and normal to it.
            s = (vertices[v, 1] - point[f, 1]) * nx - (vertices[v, 0] - point[f, 0]) * ny
            d = (vertices[v, 0] - point[f, 0]) * nx + (vertices[v, 1] - point[f, 1]) * ny
            r = (vertices[w, 1] - point[f, 1]) * nx - (vertices[w, 0] - point[f, 0]) * ny
            e = (vertices[w, 0] - point[f, 0]) * nx + (vertices[w, 1] - point[f, 1]) * ny
            cross = d * r - s * e
            area += cross / 2
            far += cross * (d + e) / 6
            first += cross * (s + r) / 6
            second += cross * (s * s + s * r + r * r) / 12
        height, inertia = far / area, second - first * first / area
        out[f, 0] = 2.0 * height * height / (modulus[b] * inertia)
        out[f, 1] = np.sqrt(12.0 * inertia / area)
    return out


def _touching(gap: np.ndarray, tensile: np.ndarray, shortest: np.ndarray, before: np.ndarray) -> np.ndarray:
    """(m, 2) part of each face in contact, from the ``gap`` (m, 2), m, at its ends; open faces keep the part
    ``before``."""
    first, second = gap.T
    with np.errstate(divide="ignore", invalid="ignore"):
        zero = first / (first - second)
    low = np.where((first > 0) & (second < 0), np.minimum(zero, 1 - shortest), 0.0)
    high = np.where((first < 0) & (second > 0), np.maximum(zero, shortest), 1.0)
    low, high = np.where(tensile, 0.0, low), np.where(tensile, 1.0, high)
    out = ((first > 0) & (second > 0) & ~tensile)[:, None]
    return np.where(out, before, np.stack([low, high], axis=1))


def _left(bare: np.ndarray, pressed: np.ndarray, tensile: np.ndarray, shortest: np.ndarray) -> np.ndarray:
    """(m, 2) the part of each face without what is ``bare`` (m, 2) at its ends, where something is; elsewhere the part
    ``pressed`` (m, 2)."""
    first, second = bare.T
    some = (
        (first >= 0) & (second >= 0) & (first + second > 0) & (1 - first - second >= shortest * (1 - 1e-9)) & ~tensile
    )
    return np.where(some[:, None], np.stack([first, 1 - second], axis=1), pressed)


def _pressed(normal: np.ndarray, tensile: np.ndarray, shortest: np.ndarray) -> np.ndarray:
    """(m, 2) the part of each face on which the forces ``normal`` (m, 2) at its ends press: c/ℓ = 3 (1/2 − e/ℓ), at
    most 1."""
    total = normal.sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where((total > 0) & ~tensile, np.clip(normal[:, 1] / total, 0.0, 1.0), 0.5)
    length = np.clip(3 * np.minimum(share, 1 - share), shortest, 1.0)
    return np.stack([np.where(share > 0.5, 1 - length, 0.0), np.where(share > 0.5, 1.0, length)], axis=1)
