"""Contacts of a time step: detection on the current geometry, joint laws, springs, and history from the last step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from ...model import OPEN, SLIP, STICK, Blocks, DdaSettings, JointLaw, State, corner_lengths
from ..counters import Work
from ..joint_laws.bonds import BondedFaces
from ..joint_laws.crushing import CrushingFaces
from ..joint_laws.nonlinear_laws import CurvedJoints, NonlinearLaws
from ..joint_laws.penalty_springs import JointTable, Springs, contact_springs, least_face, penalties, resolved
from ..joint_laws.whole_faces import WholeFaces
from ..kinematics.tolerances import SAME
from ..open_close.contact_set import ContactSet
from ..statics.sharp_toes import SHARP, ToeCorners, stand_off
from ..step_control.relative_motion import Approach, Windows, widths
from . import contact_records
from .bonded_corners import find_bonded_corners
from .entrance_edges import (
    FACE,
    SMOOTHED,
    Corners,
    Known,
    Outlines,
    convex_corners,
    describe_contacts,
    find_contacts,
)
from .face_quadrature import FaceForces, FacePoints, give_by_bending
from .inherited_contacts import ALIGNED, misfit_of_new, pressed_before
from .neighbour_search import NearPairs
from .t_junctions import nodes_in_faces
from .thin_walls import from_outside

#: At time zero, faces nearer than this many times the domain's size touch and are bonded by cohesion and tension.
_TOUCH = 1e-7
#: Faces as drawn that are nearer than this many times the domain's size touch without force: rounding of coordinates leaves
#: some 1e-12, which stiff springs would turn into 1e-5 of the forces in a slope (`geomech bench slopes --seeds 56`).
_DRAWN = 1e-10
_UNKNOWN = -2
_NEVER = -1
#: The gaps of rotating blocks are followed to this part of the smaller block's size (√area).
_PRECISION = 1e-5
#: A vertex behind a line by less than this part of the smaller block's size (√area) at first touch was brought there by
#: deformation of neighbours, or by the rounding of arcs.
_TOUCHING_DEPTH = 1e-4
#: Blocks carry the initial loads after this many transits of sound through the model, and this many steps. (The weight
#: of a slope of 1 000 blocks, suddenly applied, sinks into softened springs by 6 % of the work of its first 0.3 s;
#: after this time by 0.1 %.)
_TRANSITS, _STEPS = 4.0, 20
#: Contacts are searched for within this many times the deepest penetration of the last step, whatever the window.
_DEEPER = 2.0


class _Met(NamedTuple):
    """Vertices and edges that meet.

    table      rows of `find_contacts`
    geometry, parent   as in `describe_contacts`
    law        (n,) joint law
    """

    table: np.ndarray
    geometry: np.ndarray
    parent: np.ndarray
    law: np.ndarray


class ContactFinder:
    """Finds the contacts of ``blocks`` and gives each its law and springs.

    ``joint_index`` as in `BlockSystem`; ``modulus`` (n_blocks,) Pa: E' of each block, which determines penalties;
    ``rigid`` (n_blocks,) blocks without strain; ``mass`` (n_blocks,) kg/m; ``work`` counts searches.
    """

    def __init__(
        self,
        blocks: Blocks,
        joints: Sequence[JointLaw],
        joint_index: Callable[[str, str], int | None],
        settings: DdaSettings,
        modulus: np.ndarray,
        rigid: np.ndarray,
        mass: np.ndarray,
        work: Work | None = None,
    ) -> None:
        self._work = work
        self.names = blocks.names
        self._edge_names = blocks.edge_names
        self._n_joints = len(joints)
        self._joint_index = joint_index
        self._settings = settings
        self._modulus, self._area = modulus, blocks.areas()
        self._table = JointTable.of(joints)
        self._rebounds = bool(np.isfinite(self._table.restitution).any())
        self._crushes = bool(np.isfinite(self._table.crushing).any())
        self._stiff = ~np.isnan(self._table.normal_stiffness)
        # Waves cross bonded faces as they cross rock.
        self._yields = ~self._stiff & (self._table.tension == 0.0) & (self._table.cohesion == 0.0)
        self._mass = np.where(blocks.fixed, np.inf, mass)
        #: s, time from which springs are softened to a stiffness that the steps resolve.
        self._softened_from = np.inf
        self._softens = settings.springs == "resolved" and bool(self._yields.any())
        if self._softens and settings.dynamic_factor > 0.0:
            self._softened_from = max(
                _TRANSITS * _sound_transit_time(blocks, modulus * self._area, mass), _STEPS * settings.time_step
            )
        self._stiff_along = ~np.isnan(self._table.shear_stiffness)
        self._by_length = self._stiff & self._stiff_along
        self.has_face_nodes = bool(self._by_length.any())
        self._law_of = np.full((len(blocks.edge_names),) * 2, _UNKNOWN, np.int64)
        self._edge_name = np.ascontiguousarray(blocks.edge_name, np.int64)
        self._next = np.ascontiguousarray(blocks.next_vertex, np.int64)
        self._previous = np.ascontiguousarray(blocks.previous_vertex, np.int64)
        self._start = np.ascontiguousarray(blocks.vertex_start, np.int64)
        self._owner = np.ascontiguousarray(blocks.vertex_block, np.int64)
        self._flat = blocks.in_side
        self._rigid = rigid
        # Triangles follow the bending of a rock mass; multipliers replace springs.
        self._bends = (np.diff(self._start) > 3) & ~rigid & ~blocks.fixed & (settings.contact == "penalty")
        if blocks.order is not None:
            # Blocks of higher order bend by themselves.
            self._bends &= np.asarray(blocks.order) <= 1
        #: Whether contacts are found at the corners of faces only; points along faces then follow from them.
        self.at_corners = False
        #: (n_blocks,) m: largest distance of a point of a deflected block from its place in the first-order block.
        self.deflection = np.zeros(blocks.n_blocks)
        #: (n_blocks,) m: largest distance of a block's deflected sides from the straight lines between their corners.
        self.sag = np.zeros(blocks.n_blocks)
        self._rounding, self._longest = corner_lengths(blocks, settings.corner_rounding)
        #: (n_vertices,) m: rounding lengths of corners.
        self.rounding = np.minimum(self._rounding, self._longest)
        #: Treatment of toes: `SHARP`, `ROUNDED` or `FREE` (`toe_contacts`).
        self.toes = SHARP
        #: Whether bonds may fail; otherwise the loads of bonded faces are not checked.
        self.bonds_fail = True
        #: Whether faces keep their full cohesion as long as they touch anywhere (`whole_faces`).
        self.whole_faces = False
        self._corners = ToeCorners(
            self._next, self._previous, self._owner, self.rounding, np.sqrt(self._area)[self._owner], blocks.vertices
        )
        #: Pairs of cells that meet, as numbers a · n_blocks + b.
        self.joined = _meeting_cells(blocks)
        #: Pairs of cells that have separated: they may touch, and no bond joins them.
        self.parted = np.zeros(0, np.int64)
        #: Numbers (k,) of the corner contacts to keep; None keeps all.
        self.kept_corners: Callable[[ContactSet], np.ndarray] | None = None
        self._always_fixed = np.ascontiguousarray(blocks.fixed, dtype=np.bool_)
        self.widths = widths(blocks.vertices, self._next, self._start, self._area)
        self.take_out(None)
        self._size = float(np.ptp(blocks.vertices, axis=0).max())
        self._drawn = _DRAWN * self._size

    def take_out(self, removed: np.ndarray | None) -> None:
        """Exclude the blocks ``removed`` (n_blocks,) from detection."""
        self._removed = removed
        self._fixed = self._always_fixed if removed is None else self._always_fixed | removed
        self._near = NearPairs(self._start, self._fixed, self._work)
        self.approach = Approach(self._next, self._start, self.widths, self._near)

    def find(
        self,
        state: State,
        vertices: np.ndarray,
        window: float | Windows,
        glue_holds: bool = True,
        lumped: bool = False,
        broken: np.ndarray | None = None,
        motion: np.ndarray | None = None,
        margin: float = np.inf,
    ) -> ContactSet:
        """All contacts within ``window``, with the history that ``state.contacts`` holds for them.

        window   m, search distance, one for all pairs of blocks or one for each
        glue_holds   True leaves out corner pairs that the bonds around them join
        lumped   True places the springs of faces with a joint stiffness at their corners
        broken   bonds (vertex·n_vertices + edge) whose springs are at the corners as well
        motion   (n_vertices, 2) m, expected motion of the vertices in the step, which decides on which sides corners meet
        margin   m; corners that stay apart by more than this are left out
        """
        old = np.ascontiguousarray(state.contacts)
        met = self._meeting(old, vertices, window, motion, margin)
        parent, geometry, law = met.parent, met.geometry, met.law
        vertex, edge, corner = (column.copy() for column in met.table[:, :3].T)
        nodes = None
        if self._by_length.any():
            nodes = nodes_in_faces(vertex, edge, self._owner, self._flat, geometry, law, self._by_length[law])
        if nodes is not None:
            geometry[:, 4] = nodes.left(geometry[:, 4].copy())
            parent = nodes.continued(met.parent, np.ascontiguousarray(old["state"]))
        block, other = self._owner[vertex], self._owner[edge]
        springs = self._springs(block, other, law, geometry[:, 4], state.time >= self._softened_from)
        remembered = self._remembered(old, parent, state.time, geometry, springs, self._stiff[law])
        if len(self.parted):
            pair = np.minimum(block, other) * len(self._area) + np.maximum(block, other)
            remembered["bonded"][np.isin(pair, self.parted)] = 0
        softened = 0.0
        if self._softens and len(old):
            softened = self._keep_forces(old, parent, geometry, springs, remembered, law)
        if self._table.curved.any():
            self._pass_on_wear(old, block, other, geometry, remembered)
        sunk = (parent < 0) & self._stiff[law] & (geometry[:, 3] < -_TOUCH * self._size)
        if sunk.any() and len(old):
            remembered["state"][pressed_before(old, sunk, block, other, geometry)] = STICK
        remembered["lift"] = self._lifts(old, parent, met, vertices, remembered)
        keep = np.ones(len(vertex), bool)
        if nodes is not None:
            for name in ("normal", "shear") if len(old) else ():
                former_force = np.where(met.parent >= 0, old[name + "_force"][met.parent], 0.0)
                remembered[name] = nodes.left(former_force)
            keep[nodes.node] = False
        glued = self._bonded_corners(vertices, vertex, edge, geometry, remembered["bonded"]) if glue_holds else None
        if glued is not None:
            keep &= ~glued
        if not keep.all():
            vertex, edge, block, other, law = vertex[keep], edge[keep], block[keep], other[keep], law[keep]
            corner, geometry = corner[keep], geometry[keep]
            springs = springs.of(keep)
            remembered = {name: value[keep] for name, value in remembered.items()}
        bonded = remembered["bonded"]
        found = ContactSet(
            vertex=vertex, edge=edge, block=block, other=other, law=law, corner=corner,
            tilt=self._tilt(vertices, edge, corner, geometry),
            precision=_PRECISION * np.sqrt(np.minimum(self._area[block], self._area[other])),
            geometry=np.ascontiguousarray(geometry),
            springs=springs,
            relies_on_glue=glued is not None,
            faces=BondedFaces.of(block, other, geometry, bonded) if self.bonds_fail and bonded.any() else None,
            released=softened,
            **remembered,
        )  # fmt: skip
        if self.whole_faces:
            found = self._on_whole_faces(found)
        if self.at_corners:
            return found if self.kept_corners is None else found.part(self.kept_corners(found))
        return found if lumped else self._with_springs_in_faces(found, vertices, broken)

    def _on_whole_faces(self, found: ContactSet) -> ContactSet:
        """The contacts ``found`` with cohesion on the whole of faces that touch anywhere."""
        cohesion = np.where(found.bonded > 0, self._table.cohesion[found.law], 0.0)
        whole = WholeFaces.of(found.block, found.other, found.geometry, found.law, cohesion)
        return replace(found, whole=whole).sharing_cohesion(found.state, found.bonded)

    def _bonded_corners(self, vertices, vertex, edge, geometry, bonded) -> np.ndarray | None:
        """(n,) bool: corner contacts that the bonds around them join (`find_bonded_corners`); None without any."""
        if not bonded.any():
            return None
        along = vertices[self._next[edge]] - vertices[edge]
        share = geometry[:, 4] / np.hypot(along[:, 0], along[:, 1])
        return find_bonded_corners(vertex, edge, self._next, geometry[:, 0], share, bonded == 1)

    def _meeting(
        self, old: np.ndarray, vertices: np.ndarray, window: float | Windows, motion: np.ndarray | None, margin: float
    ) -> _Met:
        """Vertices and edges that meet; arguments as of `find`, ``old`` the CONTACT rows of the last step.

        Vertices that cannot have reached their edge from outside, and pairs of edges without a joint law, are left out.
        """
        names = contact_records.names(old, len(vertices))
        near = self._widened_windows(window, vertices, old, names.lift, names.gap)
        rank = np.argsort(names.keys, kind="stable")
        corners = Corners(
            convex_corners(vertices, self._next, self._previous), self._rounding, self._longest, self._area,
            self._pressed(old),
            np.zeros_like(vertices) if motion is None else motion, float(margin) + names.lift,
        )  # fmt: skip
        outlines = self._outlines(np.ascontiguousarray(vertices))
        table, met = find_contacts(outlines, near.pairs, near.reach, names.keys[rank], corners)
        at = near.of_contacts(self._owner[table[:, 0]], self._owner[table[:, 1]], len(self._area))
        before = Known(names.vertex, names.edge, names.normal, rank)
        geometry, mate, parent = describe_contacts(table, met, outlines, near.reach[at], before)
        known = np.append((old["state"] != OPEN) | (old["lift"] < 0.0), False)[parent]
        keep = self._from_outside(table, vertices, known, corners.pressed)
        if not keep.all():
            table, geometry, mate, parent = table[keep], geometry[keep], mate[keep], parent[keep]
        law = self._laws(table[:, 1], mate)
        law[self._one_rock(table[:, 0], table[:, 1])] = _NEVER
        if self._removed is not None:
            law[self._removed[self._owner[table[:, :2]]].any(axis=1)] = _NEVER
        if (law == _NEVER).any():
            keep = law != _NEVER
            table, geometry, parent, law = table[keep], geometry[keep], parent[keep], law[keep]
        return _Met(table, geometry, parent, law)

    def _lifts(
        self, old: np.ndarray, parent: np.ndarray, met: _Met, vertices: np.ndarray, remembered: dict[str, np.ndarray]
    ) -> np.ndarray:
        """(n,) m: lifts of the contacts ``met``, chosen so that no contact begins with a force that no work has
        produced.

        ``parent`` (n,) are the rows of ``old`` that they continue, ``remembered`` their history.
        """
        table, geometry, lift, state = met.table, met.geometry, remembered["lift"], remembered["state"]
        block, other = self._owner[table[:, 0]], self._owner[table[:, 1]]
        lift = lift + misfit_of_new(old, (parent < 0) & (table[:, 2] < 0), block, other, geometry, self._drawn)
        # A step that rounding smooths away does not count, and a vertex that is slightly behind a line that it has not
        # touched brings no energy: contacts begin without force there.
        touching_depth = _TOUCHING_DEPTH * np.sqrt(np.minimum(self._area[block], self._area[other]))
        smoothed = (table[:, 3] == SMOOTHED) | ((geometry[:, 3] > -touching_depth) & (len(old) > 0))
        smoothed &= (state == OPEN) & (remembered["bonded"] == 0) & (geometry[:, 3] < lift)
        lift = np.where(smoothed, geometry[:, 3], lift)
        # A vertex that has climbed a ramp continues from there with its penetration.
        up = np.flatnonzero((table[:, 3] == SMOOTHED) & (state != OPEN) & (parent >= 0))
        up = up[old["tilt"][parent[up]] != 0.0] if len(up) else up
        lift[up] = np.minimum(0.0, geometry[up, 3] - old["gap"][parent[up]])
        if self.toes != SHARP:
            vertex, edge, corner = (column.copy() for column in table[:, :3].T)
            off = stand_off(vertex, edge, corner, geometry, vertices, self._corners, self.toes)
            lift = np.where(off >= 0.0, -off, lift)
        return lift

    def _with_springs_in_faces(self, found: ContactSet, vertices: np.ndarray, broken: np.ndarray | None) -> ContactSet:
        """The contacts ``found``, with the springs of whole faces inside the faces; those of the bonds ``broken`` at
        the corners."""
        if not (self._stiff.any() or found.inset.any()):
            return found
        inside = found.inset & (found.bonded == 1)
        if broken is not None:
            inside = inside & ~np.isin(found.vertex * len(vertices) + found.edge, broken)
        points = self._face_points(found, vertices, inside)
        if inside.any() or found.inset.any():
            kept = np.zeros(len(found), bool)
            if points is not None:
                kept[points.ends] = True
            out = found.inset & ~kept
            inside_springs = self._face_points(found, vertices, found.inset) if out.any() else None
            found = _at_their_corners(found, inside_springs, out, inside & kept)
        return replace(found, by_length=self._stiff_along[found.law]).placed(points)

    def _face_points(self, found: ContactSet, vertices: np.ndarray, inside: np.ndarray) -> FacePoints | None:
        """Locations of springs in the faces of the contacts ``found``; bonds have theirs inside the face where
        ``inside`` (n,)."""
        forces = FaceForces(found.normal, found.bare, (found.bonded == 1) & (found.springs.tension > 0))
        return FacePoints.of(
            found.block, found.other, found.geometry, np.where(inside, 2, self._stiff[found.law]), forces,
            least_face(found.block, found.other, self._area, self._fixed), partial(self._softened, found, vertices),
        )  # fmt: skip

    def _softened(
        self, found: ContactSet, vertices: np.ndarray, ends: np.ndarray, length: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Distance between the springs of a face, relative to its ``length`` (m,), and the share of stiffness that they
        have.

        ``ends`` (m, 2) are the face's contacts among ``found``. The face's rotation stands for the bending of its
        blocks.
        """
        first = ends[:, 0]
        across, point = found.geometry[first, 1:3], found.geometry[first, 5:7]
        behind = [
            give_by_bending(owner[first], across, point, vertices, self._next, self._start, self._modulus, self._bends)
            for owner in (found.block, found.other)
        ]
        share = np.minimum(1.0, length / np.maximum(length, np.maximum(behind[0][:, 1], behind[1][:, 1])))
        give = behind[0][:, 0] + behind[1][:, 0]
        # A block between two rigid ones bends in an S, if at all, by a third of what either half alone would: the rigid
        # ones hold it.
        give[self._rigid[found.block[first]] | self._rigid[found.other[first]]] = 0.0
        own = 2.0 / (share * found.springs.normal[first] * length**2)
        return np.sqrt(own / np.maximum(own, give)), share

    def _widened_windows(
        self, window: float | Windows, vertices: np.ndarray, old: np.ndarray, lift: float, gap: float
    ) -> Windows:
        """``window`` of each pair, widened where the contacts ``old`` act at a distance or penetrate deeply.

        Faces with mismatch after sliding press at a distance, up to the largest ``lift``; faces that do not fit pass
        each other by as much, down to the lowest ``gap``; and contacts of soft springs that are deeper than the window
        still touch.
        """
        if not isinstance(window, Windows):
            pairs = self._near.of(vertices, max(window + lift, -_DEEPER * gap))
            window = Windows(pairs, np.full(len(pairs), window))
        if not len(window.pairs) or (lift <= self._drawn and -_DEEPER * gap <= window.reach.min()):
            return window
        reach = window.reach.copy()
        at = window.of_contacts(old["block"], old["other"], len(self._area))
        known, wide = at >= 0, np.zeros(len(reach))
        np.maximum.at(wide, at[known], np.abs(old["lift"][known]))
        reach += wide
        deep = known & (old["state"] != OPEN)
        np.maximum.at(reach, at[deep], -_DEEPER * old["gap"][deep])
        return Windows(window.pairs, reach)

    def _outlines(self, vertices: np.ndarray) -> Outlines:
        return Outlines(vertices, self._next, self._previous, self._start)

    def _from_outside(self, table: np.ndarray, vertices: np.ndarray, known: np.ndarray, pressed: np.ndarray):
        """(n,) whether vertices of the rows of `find_contacts` may have reached their edges from outside.

        Rows that are ``known`` (n,), because they continue contacts that press or that begin behind the line, and
        corners that meet corners, have. ``pressed`` (n_blocks,) m is the penetration of each block's faces.
        """
        vertex, edge = np.ascontiguousarray(table[:, :2].T)
        block, other = self._owner[vertex], self._owner[edge]
        shallow = _TOUCHING_DEPTH * np.sqrt(np.minimum(self._area[block], self._area[other]))
        shallow += _DEEPER * np.maximum(pressed[block], pressed[other])
        keep = from_outside(
            vertex, edge, self._off_lines(vertices, vertex, edge), self._outlines(vertices), self._owner, known,
            np.where(table[:, 3] == FACE, -1.0, shallow),
        )  # fmt: skip
        return keep | (table[:, 2] >= 0)

    def _springs(
        self, block: np.ndarray, other: np.ndarray, law: np.ndarray, length: np.ndarray, softened: bool
    ) -> Springs:
        """Springs of contacts (n,); ``softened`` softens them to what the time steps of a run resolve."""
        kn, ks = self._settings.normal_penalty, self._settings.shear_penalty
        if kn is None:
            normal = penalties(block, other, length, self._modulus, self._area, self._fixed, self._rigid)
            if softened:
                softened_to = resolved(normal, block, other, self._mass, self._settings.time_step)
                normal = np.where(self._yields[law], softened_to, normal)
        else:
            normal = np.full(len(block), float(kn))
        return contact_springs(
            self._table,
            law,
            length,
            least_face(block, other, self._area, self._fixed),
            normal,
            normal if ks is None else np.full(len(block), float(ks)),
        )

    def _remembered(self, old, parent, time, geometry, springs, stiff):
        """History that contacts keep from their rows ``parent`` (−1: new) of ``old``, by the field names of
        `ContactSet`."""
        known = parent >= 0

        (contact_state, bonded), (normal, shear, slip, wear, lift, stretch, bare), inset = contact_records.inherited(
            old, parent
        )
        if not known.all():
            # New contacts that already touch are tried as closed first.
            fresh = ~known & (geometry[:, 3] <= _TOUCH * self._size) & (geometry[:, 3] > -_TOUCH * self._size)
            if len(old) == 0 and time == 0.0:
                bonded[fresh & (geometry[:, 4] > 0)] = 1
            contact_state[fresh] = STICK
            if len(old) == 0:
                lift = np.where(fresh & (np.abs(geometry[:, 3]) <= self._drawn), geometry[:, 3], lift)
        bonded[(springs.cohesion == 0) & (springs.tension == 0)] = 0
        # Where the normal force is tensile by round-off, friction reverses: taken as the sense of sliding, this would
        # reverse it in every step, and change the matrix of blocks at rest.
        pulls = springs.friction * normal + springs.sliding < 0.0
        direction = np.where(contact_state == SLIP, np.sign(shear), 0.0) * np.where(pulls, -1.0, 1.0)
        # Bonds between bending blocks exist from the start, or not at all.
        if len(old) == 0 and time == 0.0 and self._bends.any():
            inset = (bonded == 1) & (springs.tension > 0) & ~stiff
        rough = (springs.peak > 0) | (bonded > 0)
        contact_state[(contact_state == SLIP) & rough & (direction == 0)] = STICK
        contact_state[(contact_state == STICK) & ~rough] = SLIP
        return {
            "state": contact_state, "direction": direction, "bonded": bonded, "normal": normal, "shear": shear,
            "slip": slip, "wear": wear, "lift": lift, "stretch": stretch, "inset": inset, "bare": bare,
        }  # fmt: skip

    def _keep_forces(self, old, parent, geometry, springs, remembered, law) -> float:
        """Keep the force, not the gap, of closed contacts whose spring stiffness has changed.

        What stiff springs carry does not sink in when they are softened. Returns the energy, J/m, by which the old
        springs' exceeded that of the new ones.
        """
        known = np.flatnonzero((parent >= 0) & (remembered["state"] != OPEN) & self._yields[law])
        before, now = old["stiffness"][parent[known]], springs.normal[known]
        ratio = np.where(before > 0.0, before / now, 1.0)
        gap, lift = geometry[known, 3], remembered["lift"][known]
        pressed = np.minimum(gap - lift, 0.0)
        remembered["lift"][known] = np.where(pressed < 0.0, gap - ratio * pressed, lift)
        # Penalty springs have equal normal and shear stiffness.
        along = np.where(
            self._stiff_along[law[known]], 0.0, remembered["shear"][known] ** 2 / (ratio * springs.shear[known])
        )
        return 0.5 * float(((1.0 - ratio) * (before * pressed**2 + along)).sum())

    def _pressed(self, old: np.ndarray) -> np.ndarray:
        """(n_blocks,) m: deepest penetration of each block's faces in the last step."""
        deepest = np.zeros(len(self._area))
        deep = np.where(old["state"] != OPEN, -old["gap"], 0.0)
        contact_records.largest_of_blocks(
            deep, np.ascontiguousarray(old["block"]), np.ascontiguousarray(old["other"]), deepest
        )
        return deepest + self.deflection

    def _tilt(self, vertices, edge, corner, geometry) -> np.ndarray:
        """(n,) rad, as in `ContactSet`."""
        tilt, rounded = np.zeros(len(edge)), np.flatnonzero(corner >= 0)
        along = vertices[self._next[edge[rounded]]] - vertices[edge[rounded]]
        normal = geometry[rounded, 1:3]
        tilt[rounded] = np.arctan2(
            along[:, 1] * normal[:, 1] + along[:, 0] * normal[:, 0],
            along[:, 1] * normal[:, 0] - along[:, 0] * normal[:, 1],
        )
        return tilt

    def _pass_on_wear(self, old, block, other, geometry, remembered) -> None:
        """Give contacts that have not touched the wear and lift of the nearest sliding contact on the same line.

        Between two given blocks all contacts along one direction have moved by the same amount.
        """
        touched = old[(old["wear"] > 0) & (old["state"] != OPEN)]
        if not len(touched):
            return
        pair = np.stack(
            [np.minimum(touched["block"], touched["other"]), np.maximum(touched["block"], touched["other"])]
        )
        for c in np.flatnonzero((remembered["state"] == OPEN) & (remembered["lift"] >= 0)):
            same = (pair[0] == min(block[c], other[c])) & (pair[1] == max(block[c], other[c]))
            same &= np.abs(touched["normal"] @ geometry[c, 1:3]) > ALIGNED
            same &= touched["wear"] > remembered["wear"][c]
            if same.any():
                at = np.flatnonzero(same)
                row = touched[at[np.argmin(np.linalg.norm(touched["point"][at] - geometry[c, 5:7], axis=1))]]
                for name in ("slip", "wear", "lift"):
                    remembered[name][c] = row[name]

    @property
    def stiff_laws(self) -> np.ndarray:
        """(n_laws,) bool: laws with a normal joint stiffness, and those that crush: springs at points of their faces are
        proportional to the length that each has."""
        return self._stiff | np.isfinite(self._table.crushing)

    @property
    def stiff_along_laws(self) -> np.ndarray:
        """(n_laws,) bool: laws with a shear joint stiffness, and those that crush."""
        return self._stiff_along | np.isfinite(self._table.crushing)

    @property
    def closure(self) -> np.ndarray:
        """(n_laws,) m: maximum closure of each law; infinite for a linear spring."""
        return self._table.closure

    def on_penalty(self, found: ContactSet) -> tuple[np.ndarray, np.ndarray]:
        """Two (n,) bool arrays: contacts whose normal, and whose shear spring is the solver's penalty, not a joint
        stiffness."""
        t, lone = self._table, found.geometry[:, 4] <= 0
        by_peak = t.stiff_by_peak[found.law] & ~lone
        return (
            np.isnan(t.normal_stiffness[found.law]),
            np.isnan(t.shear_stiffness[found.law]) & ~by_peak,
        )

    def curved(self, found: ContactSet) -> NonlinearLaws | None:
        """The contacts of ``found`` with nonlinear laws; None where there are none."""
        if self._crushes and np.isfinite(found.springs.crushing).any():
            # (In a system with such faces no law is curved: `higher_order.unsupported`.)
            return CrushingFaces(found)
        if not (self._table.curved.any() and self._table.curved[found.law].any()):
            return None
        return CurvedJoints(self._table, found)

    def restitution(self, found: ContactSet) -> np.ndarray | None:
        """(n,) coefficients of restitution e of the contacts of ``found``, nan where their law has none; None where no
        law has."""
        return self._table.restitution[found.law] if self._rebounds else None

    def _laws(self, edge: np.ndarray, mate: np.ndarray) -> np.ndarray:
        a, b = self._edge_name[edge], self._edge_name[mate]
        law = self._law_of[a, b]
        if (law == _UNKNOWN).any():
            names, met = self._edge_names, np.zeros(self._law_of.shape, bool)
            met[a, b] = True
            for i, j in np.argwhere(met & (self._law_of == _UNKNOWN)).tolist():
                index = self._joint_index(names[i], names[j])
                if index is not None and not 0 <= index < self._n_joints:
                    raise ValueError(
                        f"edges {names[i]!r} and {names[j]!r} have joint law {index}, but there are {self._n_joints}"
                    )
                self._law_of[i, j] = _NEVER if index is None else index
            law = self._law_of[a, b]
        return law

    def part(self, blocks: Blocks, parted: np.ndarray) -> None:
        """Let cells touch from now on whose bonded faces have ``parted`` (m,)."""
        edges = np.asarray(blocks.glued)[parted]
        pair = np.sort(blocks.vertex_block[edges], axis=1)
        self.parted = np.unique(pair[:, 0] * blocks.n_blocks + pair[:, 1])
        self.joined = _meeting_cells(replace(blocks, glued=np.asarray(blocks.glued)[~parted]))

    def laws_of(self, edge: np.ndarray, mate: np.ndarray) -> np.ndarray:
        """(n,) joint laws between the edges ``edge`` and ``mate`` (n,); −1 where they do not touch."""
        return self._laws(edge, mate)

    def _one_rock(self, vertex: np.ndarray, edge: np.ndarray) -> np.ndarray:
        """(n,) bool: the blocks of ``vertex`` and ``edge`` (n,) are cells bonded to each other in a face or a
        corner."""
        one, two = self._owner[vertex], self._owner[edge]
        if not len(self.joined):
            return np.zeros(len(vertex), bool)
        return np.isin(np.minimum(one, two) * len(self._area) + np.maximum(one, two), self.joined)

    def near_boxes(self, box: np.ndarray) -> np.ndarray:
        """(k, 2) all pairs of blocks whose boxes ``box`` (n_blocks, 4) intersect, and some others."""
        return self._near.of_boxes(box, 0.1 * self.widths)

    def may_touch(self, vertex: np.ndarray, edge: np.ndarray) -> np.ndarray:
        """(n,) bool: False for a ``vertex`` neither of whose edges may touch the ``edge``, and for removed blocks."""
        law = np.maximum(self._laws(edge, vertex), self._laws(edge, self._previous[vertex]))
        out = (law != _NEVER) & ~self._one_rock(vertex, edge)
        if self._removed is not None:
            out &= ~(self._removed[self._owner[vertex]] | self._removed[self._owner[edge]])
        return out

    def past_midpoint(self, vertices: np.ndarray, vertex: np.ndarray, edge: np.ndarray) -> np.ndarray:
        """(n,) bool: a ``vertex`` lies behind its ``edge`` by more than half the block's thickness there."""
        return ~from_outside(
            vertex, edge, self._off_lines(vertices, vertex, edge), self._outlines(vertices), self._owner,
            np.zeros(len(vertex), np.bool_), np.full(len(vertex), -1.0),
        )  # fmt: skip

    def gaps(self, vertices: np.ndarray, before: np.ndarray, found: ContactSet) -> np.ndarray:
        """(n,) m: gaps, at their corners, of the contacts ``found`` on the geometry ``before`` with the blocks moved to
        ``vertices``."""
        gap = self._off_lines(vertices, found.vertex, found.edge)
        rounded = np.flatnonzero(found.corner >= 0)
        if len(rounded):
            v, w = found.vertex[rounded], found.corner[rounded]
            moved = vertices[v] - vertices[w] - (before[v] - before[w])
            normal = found.geometry[rounded, 1:3]
            gap[rounded] = found.geometry[rounded, 3] + np.einsum("na,na->n", moved, normal)
        return gap

    def _off_lines(self, vertices: np.ndarray, vertex: np.ndarray, edge: np.ndarray) -> np.ndarray:
        """(n,) m: distance of ``vertex`` (n,) from the line of ``edge`` (n,), positive outside, for the geometry
        ``vertices``."""
        start = vertices[edge]
        along, out = vertices[self._next[edge]] - start, vertices[vertex] - start
        return (out[:, 0] * along[:, 1] - out[:, 1] * along[:, 0]) / np.hypot(along[:, 0], along[:, 1])

    def toes_among(self, found: ContactSet, vertices: np.ndarray) -> np.ndarray:
        """(n,) m: gaps of the toes among the contacts ``found``; negative for other contacts."""
        parts = found.vertex, found.edge, found.corner, found.geometry
        return stand_off(*parts, vertices, self._corners, self.toes)

    def carried(self, vertices: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """CONTACT ``rows`` moved to the geometry ``vertices`` (gap and forces unchanged)."""
        return contact_records.carried(rows, vertices, self._next)

    def where(self, found: ContactSet, contact: int) -> str:
        """Location of contact number ``contact`` of ``found`` in messages; empty for −1."""
        if contact < 0:
            return ""
        x, y = found.geometry[contact, 5:7]
        a, b = self.names[found.block[contact]], self.names[found.other[contact]]
        return f" (a corner of {a!r} on {b!r} at x = {x:.6g}, y = {y:.6g} m)"


def _meeting_cells(blocks: Blocks) -> np.ndarray:
    """(k,) a · n_blocks + b, a < b, of all cells a and b that share a corner of bonded faces, and no face that is not
    bonded."""
    if blocks.glued is None:
        return np.zeros(0, np.int64)
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    n, (edge, mate) = len(blocks.vertices), np.asarray(blocks.glued, np.int64).T
    one, two = np.concatenate([edge, blocks.next_vertex[edge]]), np.concatenate([blocks.next_vertex[mate], mate])
    corner = connected_components(csr_array((np.ones(len(one)), (one, two)), (n, n)), directed=False)[1]
    order = np.argsort(corner, kind="stable")
    pairs = set()
    for some in np.split(blocks.vertex_block[order], np.flatnonzero(np.diff(corner[order])) + 1):
        cells = np.unique(some).tolist()
        pairs |= {a * blocks.n_blocks + b for k, a in enumerate(cells) for b in cells[k + 1 :]}
    return np.setdiff1d(np.array(sorted(pairs), np.int64), _apart_in_a_face(blocks))


def _apart_in_a_face(blocks: Blocks) -> np.ndarray:
    """(k,) a · n_blocks + b, a < b, of all blocks a and b that have an edge in common that is not bonded."""
    vertices, (edge, mate) = blocks.vertices, np.asarray(blocks.glued, np.int64).T
    grid = np.round((vertices - vertices.min(axis=0)) / (SAME * float(np.ptp(vertices, axis=0).max())))
    point = np.unique(grid, axis=0, return_inverse=True)[1].ravel()
    start, end = point, point[blocks.next_vertex]
    n = int(point.max()) + 1
    free = np.ones(len(vertices), bool)
    free[edge] = free[mate] = False
    edges = np.flatnonzero(free)
    _, one, two = np.intersect1d(start[edges] * n + end[edges], end[edges] * n + start[edges], return_indices=True)
    pair = np.sort(blocks.vertex_block[np.stack([edges[one], edges[two]], axis=1)], axis=1)
    return np.unique(pair[:, 0] * blocks.n_blocks + pair[:, 1])


def _sound_transit_time(blocks: Blocks, stiffness: np.ndarray, mass: np.ndarray) -> float:
    """Time, s, in which sound crosses ``blocks`` of stiffness E' A and ``mass`` (n_blocks,), along the slowest path."""
    heavy = mass > 0.0
    slowest = float(np.sqrt(np.min(stiffness[heavy] / mass[heavy], initial=np.inf)))
    return float(np.hypot(*np.ptp(blocks.vertices, axis=0))) / slowest


def _at_their_corners(
    found: ContactSet, inside_springs: FacePoints | None, out: np.ndarray, inset: np.ndarray
) -> ContactSet:
    """The contacts ``found``, with springs of those that come ``out`` (n,) of their faces moved from ``inset`` to the
    corners.

    The forces that they had are kept: from the corners, faces that no longer match begin to press and to pull. Only
    spring forces count: what dashpots carried in the last step would remain as energy without a source.
    """
    if inside_springs is None:
        return replace(found, inset=inset)
    gap, full = found.geometry[:, 3], found.springs
    soft, before = (
        inside_springs.springs(full, np.zeros(len(gap), bool)),
        inside_springs.between_corners(found.gap_before),
    )
    spring = inside_springs.at_corners(-soft.normal * before) / full.normal
    closed = (found.state != OPEN) | (found.bonded > 0)
    gap_kept = np.where(closed, gap + spring, np.minimum(gap, 0.0))
    # Blocks that were bent by the moments on their faces while the springs were inside are no longer bent.
    bent = 0.5 * (soft.normal * before**2 - full.normal * spring**2)
    bent += 0.5 * found.shear**2 * (1.0 / soft.shear - 1.0 / full.shear)
    return replace(
        found, lift=np.where(out, gap_kept, found.lift), inset=inset, unbent=float(bent[out & closed].sum())
    )  # fmt: skip
