"""The equations of a step in given contact states: the motion, and the states that it requires."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ...model import OPEN, SLIP
from ..equation_records import BlockEquations, ContactMotion, ContactStiffness, SpringsInStates
from ..joint_laws.bonds import BondedFaces, ForcesBefore, check_faces, first_to_break
from ..joint_laws.coulomb_return import ContactStates, check_states, contact_forces
from ..joint_laws.nonlinear_laws import NonlinearLaws
from ..joint_laws.penalty_springs import Springs
from ..kinematics.tolerances import NOTHING
from ..linear_solver import assembly
from ..linear_solver.block_solver import RESIDUAL
from .contact_set import ContactSet
from .settled_states import Settled

#: Residual, relative to the forces, that suffices to recognise inconsistent states.
_ROUGHLY = 1e-8


class Unsettled(Exception):
    """The open–close iterations found no consistent states; ``contact`` is the row that still disagrees (or −1)."""

    def __init__(self, reason: str, contact: int = -1) -> None:
        super().__init__(reason)
        self.contact = contact


def plastic_slip(forces: np.ndarray, state: np.ndarray, shear_force: np.ndarray, springs: Springs) -> np.ndarray:
    """(n,) m: slip in the step, the motion of sliding contacts minus the elastic motion of their shear springs."""
    return np.where(state == SLIP, forces[:, 3] - (shear_force - forces[:, 1]) / springs.shear, 0.0)


@dataclass(frozen=True, eq=False)
class Answer:
    """Solution in trial states: motion (6 n,) and forces (n, 4), the states these require, the violation of each
    contact (N), whether linearised and nonlinear laws agree, and the linearised laws."""

    unknowns: np.ndarray
    forces: np.ndarray
    called: ContactStates
    violation: np.ndarray
    missed: np.ndarray | None
    slip: np.ndarray
    springs: Springs
    gap: np.ndarray


@dataclass
class GivingSprings:
    """Which springs of contacts gave, (2, n) normal and shear, in the last solution of a step by `plastic_splitting`; None before
    there is any."""

    which: np.ndarray | None = None


class ForceLimits(Protocol):
    """Springs in the blocks' equations whose forces have limits."""

    def beyond(self, unknowns: np.ndarray, order: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows of blocks (k,), −1 for those without unknowns, and the forces (k, 6) that they have to lose, since springs
        exceed their limits after the motion ``unknowns`` (6 n_free,)."""
        ...


@dataclass(eq=False)
class Equations:
    """The equations of a step without contact states; arguments as for `settle`. ``earlier``: (6 n,) the motion found by
    an earlier attempt at the same static step, if any, and ``earlier_forces`` (n, 2) its normal and shear forces;
    ``reach``: (n_blocks,) m beyond which blocks are given up if operator splitting is to solve a static step;
    ``plastic``: it does so from the start, with cohesion, joint stiffness or bolts (`plastic_splitting`), whose ``limits``
    it takes into account."""

    pattern: assembly.Pattern
    matrix: np.ndarray
    right: np.ndarray
    found: ContactSet
    vectors: np.ndarray
    springs: Springs
    gap: np.ndarray
    slack: np.ndarray
    curved: NonlinearLaws | None
    statics: bool
    expected: np.ndarray | None = None
    earlier: np.ndarray | None = None
    earlier_forces: np.ndarray | None = None
    reach: np.ndarray | None = None
    plastic: bool = False
    limits: ForceLimits | None = None
    giving: GivingSprings = field(default_factory=GivingSprings)
    #: Whether patches and the central path can be used, which are for six unknowns per block.
    first_order = True

    def __post_init__(self) -> None:
        self._data = np.empty(self.pattern.size)
        self._side = np.empty(6 * self.pattern.n)
        self._held: ContactStiffness | None = None
        self._near: np.ndarray | None = None
        self._force = float(np.abs(self.right).max(initial=0.0))
        self.sides = assembly.sides_of(self.pattern.n, self.pattern.order, self.found.block, self.found.other)

    def room(self) -> np.ndarray:
        """The flat matrix, as work space until the next answer (200 MB for 100 000 blocks)."""
        self._held = None
        return self._data

    def answer(self, states: ContactStates, normal_force: np.ndarray, slip: np.ndarray) -> Answer:
        """Solve with ``states``. Nonlinear laws are linearised at ``normal_force`` and ``slip`` (n,). Raises
        `Unsettled`."""
        pattern, found, springs, gap = self.pattern, self.found, self.springs, self.gap
        state, direction, bonded = states.state, states.direction, states.bonded
        if self.curved is not None:
            plastic = np.where(state == SLIP, slip, 0.0)
            springs, gap = self.curved.lines(
                self.springs, self.gap, found, state, direction, bonded, normal_force, plastic
            )
        symmetric, held = self._assembled(state, direction, springs, gap)
        # Dense matrices are overwritten by their factors, links added to all.
        self._held = held if pattern.solver is not None and pattern.links is None else None
        if self._held is not None:
            answer = self._answered(states, springs, gap, slip, symmetric, _ROUGHLY)
            forces = max(self._force, float(np.abs(self._side).max(initial=0.0)))
            if (answer.violation > 0).any() or pattern.solver is None or pattern.solver.left <= RESIDUAL * forces:
                return answer
        return self._answered(states, springs, gap, slip, symmetric, RESIDUAL)

    def _assembled(self, state: np.ndarray, direction: np.ndarray, springs: Springs, gap: np.ndarray):
        """Fill the matrix and the right side with contacts in this ``state``, as `assemble_contacts`."""
        return assembly.assemble_contacts(
            self.pattern, BlockEquations(self.matrix, self.right), self._contacts,
            self._in_states(state, direction, springs, gap), self._data, self._side, self.sides,
        )  # fmt: skip

    @property
    def _contacts(self) -> ContactMotion:
        return ContactMotion(self.found.block, self.found.other, self.pattern.order, self.vectors)

    def _in_states(
        self, state: np.ndarray, direction: np.ndarray, springs: Springs, gap: np.ndarray
    ) -> SpringsInStates:
        return SpringsInStates(
            state, direction, gap, springs.normal, springs.shear, springs.friction, springs.sliding, springs.lift,
            self.found.shear,
        )  # fmt: skip

    def _forces(
        self, unknowns: np.ndarray, state: np.ndarray, direction: np.ndarray, springs: Springs, gap: np.ndarray
    ) -> np.ndarray:
        """(n, 4) as `contact_forces`."""
        in_states = self._in_states(state, direction, springs, gap)
        return contact_forces(unknowns, tuple(self._contacts), tuple(in_states))

    def _answered(
        self, states: ContactStates, springs: Springs, gap: np.ndarray, slip: np.ndarray, symmetric: bool, within: float
    ) -> Answer:
        """The solution of the assembled system, with linearised ``springs`` and ``gap``, to a relative residual of
        ``within``."""
        pattern, state, direction = self.pattern, states.state, states.direction
        try:
            unknowns = assembly.solve(
                pattern, self._data, self._side, symmetric, self._force, near=(self._near, self._rest_of_near(within)),
                within=within, product=self._product,
            )  # fmt: skip
        except np.linalg.LinAlgError as error:
            raise Unsettled(str(error)) from error
        if not np.isfinite(unknowns).all():
            raise Unsettled("the step's matrix is singular")
        self._near = unknowns
        forces = self._forces(unknowns, state, direction, springs, gap)
        return self.checked(states, unknowns, forces, springs, gap, slip)

    def checked(
        self, states: ContactStates, unknowns: np.ndarray, forces: np.ndarray, springs: Springs, gap: np.ndarray,
        slip: np.ndarray,
    ) -> Answer:  # fmt: skip
        """The solution ``unknowns`` (6 n,) with contact ``forces`` (n, 4), and the states that it requires."""
        found, (state, direction, bonded) = self.found, (states.state, states.direction, states.bonded)
        known, missed = springs, None
        if self.curved is not None:
            slip = plastic_slip(forces, state, found.shear, springs)
            known, known_gap = self.curved.lines(
                self.springs, self.gap, found, state, direction, bonded, forces[:, 0], slip
            )
            missed = self.curved.misfit(springs, gap, known, known_gap, state, forces, self.slack)
        tried, strengths = (state, direction, bonded), tuple(known)
        *called, violation = check_states(forces, tried, strengths, found.shear, self.slack)
        if found.faces is not None:
            faces, before = tuple(found.faces), (found.normal, found.shear)
            check_faces(faces, forces, before, tried, strengths, self.slack, tuple(called), violation)
        return Answer(unknowns, forces, ContactStates(*called), violation, missed, slip, springs, gap)

    @property
    def _product(self) -> Callable[[np.ndarray], np.ndarray] | None:
        """A function that multiplies with the matrix faster than its entries do."""
        return None

    def _rest_of_near(self, within: float) -> np.ndarray | None:
        """(6 n,) residual of the last solution in the present equations, if it is known accurately enough for a solution
        to ``within``."""
        return None

    def first_bonds(self, states: ContactStates, answer: Answer, which: np.ndarray) -> np.ndarray:
        """(n,) bool: those of the bonds ``which`` (n,) bool that break first on the faces of their blocks under a load
        that grows linearly during the step."""
        found, springs = self.found, answer.springs
        faces = BondedFaces.none() if found.faces is None else found.faces
        when = first_to_break(
            faces, answer.forces, ForcesBefore(found.normal, found.shear),
            states, answer.called.bonded, springs,
        )  # fmt: skip
        when[~which] = np.inf
        first = np.full(len(self.pattern.order), np.inf)
        for blocks in (found.block, found.other):
            np.minimum.at(first, blocks, when)
        first[self.pattern.order < 0] = np.inf
        least = np.minimum(first[found.block], first[found.other])
        return which & (when <= least + NOTHING * np.abs(least))

    def settled(self, states: ContactStates, answer: Answer, iterations: int) -> Settled:
        """The result for consistent ``states``. Bonds without tensile strength are lost where they are open by more
        than the accuracy of gaps. (A face that opens by a micrometre only because of how springs share its load, and
        closes as the load grows, stays bonded.)"""
        forces, springs = answer.forces, answer.springs
        known = np.maximum(self.slack, self.found.precision)
        open_bonds = (states.bonded > 0) & (states.state == OPEN) & (forces[:, 2] > known)
        if self.found.whole is not None:
            open_bonds &= ~self.found.whole.touch(states.state)
        lifted = np.zeros(len(forces))
        slip = plastic_slip(forces, states.state, self.found.shear, springs)
        if self.curved is not None:
            lifted = self.curved.lifted(springs, answer.gap, self.found, states.direction, slip, forces)
        return Settled(
            unknowns=answer.unknowns.reshape(-1, 6),
            state=states.state,
            direction=states.direction,
            bonded=np.where(open_bonds, 0, states.bonded),
            normal_force=np.ascontiguousarray(forces[:, 0]),
            shear_force=np.ascontiguousarray(forces[:, 1]),
            gap=forces[:, 2] + springs.lift * forces[:, 3] - lifted - (answer.gap - self.found.gap),
            slip=slip,
            lifted=lifted,
            springs=springs,
            iterations=iterations,
        )
