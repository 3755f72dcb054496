"""Laws of crack faces, node by node: their parameters, contact states and memory.

A law is a `JointLaw`. Faces are closed when the opening has used up the aperture (gap w_n + a = 0), rigidly or through
a filling of stiffness k_n: λ = −k_n (w_n + a)/2μ. Closed faces carry shear up to c + λ tan φ and stick below that,
rigidly or through k_s. Faces with tensile strength are cemented: they have no aperture and stay together until the
normal traction exceeds the strength at a node, where cement and cohesion are then lost for good. Cohesion is not
reduced by slip, and open faces have no stiffness. Faces of new growth have the friction of their crack's law, but no
cohesion, cement or filling.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...model import Cracks, JointLaw
from ..kernels import shape_functions

if TYPE_CHECKING:
    from ..system.influence_matrix import ElementSet

#: Default law of crack faces.
SMOOTH = (JointLaw("frictionless"),)
#: A node belongs to a former element if it is closer to it than this fraction of the element's length.
_ON = 1e-7


@dataclass(frozen=True, eq=False)
class FaceStates:
    """Contact states of nodes (n,): ``closed``; ``way`` 0 where closed faces stick, ±1 where they slip along or against
    the tangent; ``pulled``: cement in tension. Closed frictionless faces have ``way`` 0."""

    closed: np.ndarray
    way: np.ndarray
    pulled: np.ndarray

    @classmethod
    def open(cls, n: int) -> FaceStates:
        return cls(np.zeros(n, bool), np.zeros(n, np.int8), np.zeros(n, bool))

    @cached_property
    def key(self) -> bytes:
        return self.closed.tobytes() + self.way.tobytes() + self.pulled.tobytes()


class Released(NamedTuple):
    """Energy since the beginning, J/m. ``bond``: released by breaking cement, the mean of its strength and of the
    traction after it, times the opening. Faces yield only once their traction has reached the strength, while the mean
    load of a step starts with its beginning: the loads do more work by ``slip_onset`` where faces began to slip, and by
    ``break_onset`` where they parted."""

    bond: float = 0.0
    slip_onset: float = 0.0
    break_onset: float = 0.0


@dataclass(frozen=True, eq=False)
class FaceMemory:
    """State of the crack ``elements`` carried from load to load. ``rest`` (n,): slip (times 2μ) at zero shear;
    ``broken`` (n,) bool: lost cement; ``work``: J/m of friction since the beginning; ``states``; ``pressure`` and
    ``shear`` (n,) Pa; ``released``; ``breaking`` (n,) bool: cement that breaks under the next load, whatever it is."""

    elements: ElementSet
    rest: np.ndarray
    broken: np.ndarray
    work: float
    states: FaceStates
    pressure: np.ndarray
    shear: np.ndarray
    released: Released = field(default_factory=Released)
    breaking: np.ndarray | None = None

    @property
    def lost(self) -> np.ndarray:
        """(n,) bool: cement that is broken, or breaks under any next load."""
        return self.broken if self.breaking is None else self.broken | self.breaking

    @classmethod
    def none(cls, elements: ElementSet) -> FaceMemory:
        n = elements.n * elements.per
        return cls(elements, np.zeros(n), np.zeros(n, bool), 0.0, FaceStates.open(n), np.zeros(n), np.zeros(n))


def breaking_as(memory: FaceMemory | None, after: FaceMemory) -> FaceMemory | None:
    """``memory`` (None: of faces never loaded), on the elements of ``after``, whose cement breaks under the next load
    where it is broken ``after``; None where that breaks nothing more."""
    before = FaceMemory.none(after.elements) if memory is None else carried_over(memory, after.elements)
    known = before.lost
    more = after.broken & ~known
    return replace(before, breaking=known | more) if more.any() else None


def all_smooth(laws: Sequence[JointLaw]) -> bool:
    """Whether faces under these laws only open and close. Raises ValueError for laws that crack faces do not
    support."""
    for one in laws:
        if not one.straight:
            raise ValueError(
                f"joint {one.name!r}: crack faces support neither residual friction, softening, dilation, roughness "
                "nor hyperbolic closure; give the crack a joint without them"
            )
    return not any(one.friction or one.cohesion or one.tensile_strength or one.normal_stiffness for one in laws)


def check_laws(laws: Sequence[JointLaw], cracks: Cracks) -> None:
    """Raise ValueError, naming the crack, for a law number that does not exist, or an aperture with cement."""
    law = cracks.law
    if not len(law) or (len(laws) == 1 and not law.any() and not laws[0].tensile_strength):
        return
    for s in np.flatnonzero((law < 0) | (law >= len(laws))).tolist():
        raise ValueError(f"{_called(cracks, s)}: its faces have law {int(law[s])}, but there are {len(laws)}")
    cemented = np.array([one.tensile_strength > 0 for one in laws])[law]
    for s in np.flatnonzero(cemented & (cracks.aperture > 0)).tolist():
        raise ValueError(
            f"{_called(cracks, s)}: faces with an aperture cannot have the tensile strength of {laws[law[s]].name!r}"
        )


def _called(cracks: Cracks, segment: int) -> str:
    k = int(cracks.crack[segment])
    return repr(cracks.names[k]) if k < len(cracks.names) else f"crack {k}"


class FaceLaws:
    """Laws at the nodes of crack ``elements``, arrays (n_nodes,) in the order element, node.

    closes     whether faces can touch; ``aperture`` (times 2μ): their initial distance
    rough      whether they resist slip; ``friction`` tan φ, ``cohesion`` Pa
    strength   tensile strength of the cement, Pa
    normal, shear   stiffness of the filling over 2μ, Pa/m; inf: rigid
    """

    def __init__(self, laws: Sequence[JointLaw], elements: ElementSet, cracks: Cracks, twice_mu: float):
        self.elements, self.twice_mu = elements, twice_mu

        def at_nodes(values: np.ndarray) -> np.ndarray:
            return np.repeat(values[elements.source], elements.per)

        def of_law(value, fresh: float) -> np.ndarray:
            of_segment = np.array([value(one) for one in laws], dtype=float)[law]
            return at_nodes(np.where(cracks.birth_cycle > 0, fresh, of_segment))

        law, apart = cracks.law, at_nodes(cracks.aperture)
        self.closes = np.isfinite(apart)
        self.aperture = np.where(self.closes, twice_mu * np.where(self.closes, apart, 0.0), 0.0)
        self.friction = at_nodes(np.array([one.friction for one in laws])[law])
        self.cohesion = of_law(lambda one: one.cohesion, 0.0)
        self.strength = of_law(lambda one: one.tensile_strength, 0.0)
        rigid = np.inf
        self.normal = of_law(lambda one: one.normal_stiffness or rigid, rigid) / twice_mu
        self.shear = of_law(lambda one: one.shear_stiffness or rigid, rigid) / twice_mu
        self.rough = self.closes & ((self.friction > 0) | (self.cohesion > 0))
        node = np.arange(elements.n * elements.per)
        along = node // elements.per * 2 * elements.per + node % elements.per
        self.along, self.across = along, along + elements.per

    def cemented(self, broken: np.ndarray) -> np.ndarray:
        return (self.strength > 0) & ~broken

    def limit(self, pressure: np.ndarray, broken: np.ndarray) -> np.ndarray:
        """Shear strength of the nodes under ``pressure``, Pa."""
        return self.friction * np.maximum(pressure, 0.0) + self.cohesive_strength(broken)

    def cohesive_strength(self, broken: np.ndarray) -> np.ndarray:
        return np.where(broken, 0.0, self.cohesion)


class _Places(NamedTuple):
    """Where nodes of elements lie on former ones, (n_elements, p+1) each: number of the former ``element`` (−1: none),
    its ``nearest`` node, and the position on it (``along``, −1 to 1). ``kept`` (n_elements,): whether an element is a
    former one, unchanged."""

    kept: np.ndarray
    element: np.ndarray
    nearest: np.ndarray
    along: np.ndarray


def _places(was: ElementSet, now: ElementSet) -> _Places:
    """Where the nodes of the elements ``now`` lie on the elements ``was``."""
    nodes = shape_functions.nodes(was.family, was.order)
    same = now.found_in(was)
    element, nearest = np.full((now.n, now.per), -1), np.zeros((now.n, now.per), int)
    place = np.zeros((now.n, now.per))
    kept = same >= 0
    if kept.any():  # none if the order has changed, and with it the number of nodes
        element[kept], nearest[kept], place[kept] = same[kept, None], np.arange(now.per), nodes
    for e in np.flatnonzero(~kept):
        rel = now.nodes[e][:, None] - was.start
        along = np.einsum("jec,ec->je", rel, was.tangent) / was.length
        off = np.abs(np.einsum("jec,ec->je", rel, was.normal)) / was.length
        inside = (off < _ON) & (along > -_ON) & (along < 1 + _ON)
        for j in np.flatnonzero(inside.any(axis=1)):
            k = int(inside[j].argmax())
            t = 2 * along[j, k] - 1
            element[e, j], nearest[e, j], place[e, j] = k, np.abs(nodes - t).argmin(), np.clip(t, -1, 1)
    return _Places(kept, element, nearest, place)


def carried_over(memory: FaceMemory, now: ElementSet) -> FaceMemory:
    """``memory`` on the elements ``now``: unchanged where an element is unchanged; slip interpolated, and states taken
    from the nearest node, where elements were divided or joined; none on new faces."""
    was = memory.elements
    if now is was:
        return memory
    at = _places(was, now)
    rest = np.zeros((now.n, now.per))
    old = memory.rest.reshape(was.n, was.per)
    known = at.element >= 0
    if at.kept.any():
        rest[at.kept] = old[at.element[at.kept, 0]]
    for e, j in np.argwhere(known & ~at.kept[:, None]).tolist():
        k, t = int(at.element[e, j]), at.along[e, j]
        sign = np.sign(was.tangent[k] @ now.tangent[e])
        shape = shape_functions.at(was.family, was.order, int(was.kind[k]), np.array([t]))[0]
        rest[e, j] = sign * (shape @ old[k])

    def taken(values: np.ndarray) -> np.ndarray:
        rows = values.reshape(was.n, was.per)
        out = np.zeros((now.n, now.per), values.dtype)
        out[known] = rows[at.element[known], at.nearest[known]]
        return out.ravel()

    states = memory.states
    moved = FaceStates(taken(states.closed), taken(states.way), taken(states.pulled))
    pressure, shear = taken(memory.pressure), taken(memory.shear)
    breaking = None if memory.breaking is None else taken(memory.breaking)
    return FaceMemory(
        now, rest.ravel(), taken(memory.broken), memory.work, moved, pressure, shear, memory.released, breaking
    )


def traction_carried_over(traction: np.ndarray, was: ElementSet, now: ElementSet) -> np.ndarray:
    """(n_unknowns,) ``traction`` on faces of the elements ``was``, Pa, on the elements ``now``, from the nearest node;
    none on new faces."""
    if now is was:
        return traction
    at = _places(was, now)
    known = at.element >= 0
    out = np.zeros((now.n, 2, now.per))
    rows = traction.reshape(was.n, 2, was.per)
    for part in range(2):
        out[:, part][known] = rows[:, part][at.element[known], at.nearest[known]]
    return out.ravel()
