"""Open–close iteration: contact states that are consistent with the motion they produce.

Given contact states make the step linear. Its solution is checked against them (`coulomb_return`), every inconsistent
contact is switched, and the step is solved again: a semismooth Newton method, which converges in two or three
iterations where few contacts change. Bonds, whose loss is final, break only when everything else is consistent.

If the number of inconsistent contacts does not decrease and few are left, their states are found on the surrounding
blocks alone (`block_patches`); if many are left in a dynamic step, operator splitting (`operator_splitting`) proposes
states once. If neither helps, the interior-point method (`CentralPath`) proposes states from which Newton's method
continues. If that fails, the step is cut. Nonlinear joint laws are linearised within an iteration, which continues
until the laws agree with their linearisation. All parameters are in `ContactSolver`.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

import numpy as np

from ...model import OPEN, SLIP, STICK, ContactSolver
from ..contact_detection.contact_finder import ContactSet
from ..contact_detection.contact_records import largest_of_blocks
from ..joint_laws.coulomb_return import ContactStates
from ..kinematics.tolerances import NOTHING
from .block_patches import settled_in_patch
from .equations import Answer, Equations, Unsettled
from .interior_point.central_path import SLIPPED, CentralPath
from .operator_splitting import can_split, split
from .plastic_splitting import split_plastic
from .settled_states import Settled
from .static_splitting import Converged, can_split_statics, split_statics

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Effort:
    """Limits of the search for states: ``max_iterations`` of Newton's method and the methods of ``solver``.
    ``in_order``: bonds break one by one under a growing load, otherwise several at once; ``within_patch``: the search
    is itself on a patch; ``bonds_give``: overloaded bonds break where other contacts find no states with them;
    ``opens_first``: contacts of higher order stick and slide only once none opens or closes."""

    max_iterations: int
    solver: ContactSolver
    in_order: bool
    within_patch: bool = False
    bonds_give: bool = False
    opens_first: bool = False


def is_large(n_free: int, statics: bool, solver: ContactSolver) -> bool:
    """Whether a dynamic step of ``n_free`` blocks is cut as soon as contacts stop its central path: half the step takes
    less time than continuing the path (`ContactSolver.large_system`)."""
    return not statics and n_free >= solver.large_system


def settle(equations: Equations, max_iterations: int, solver: ContactSolver, bonds_give: bool = False) -> Settled:
    """Iterate from the states of the contacts of ``equations`` to consistent ones. Each solution of the step's
    equations counts as an iteration, also along the central path.

    Bonds break when everything else is consistent, in the order in which a load growing from the start of the step
    breaks them. With many contacts this takes too long: then contacts that open lose their bonds at once, all bonds
    overloaded by at least half as much as the worst break together, and contacts that are closed in the end get their
    bonds back. With ``bonds_give`` overloaded bonds break also where the other contacts find no states with them.

    Raises `Unsettled` if no consistent states are found within ``max_iterations`` of Newton's method.
    """
    in_order = len(equations.found) <= solver.bonds_in_order
    effort = Effort(max_iterations, solver, in_order, bonds_give=bonds_give)
    if equations.plastic:
        return _Search(equations, effort).settled_by_plastic_splitting()
    settled = _Search(equations, effort).settled()
    if equations.statics and not equations.first_order and _falls(equations, settled):
        settled = _borne_if_possible(equations, effort, settled)
    return settled if in_order else _with_bonds_restored(equations, effort, settled)


def _falls(equations: Equations, settled: Settled) -> bool:
    """Whether a loaded block that touched others at the start has no force on any of its contacts in ``settled``."""
    found, order = equations.found, equations.pattern.order
    push, touched = np.zeros(len(order)), np.zeros(len(order), bool)
    for blocks in (found.block, found.other):
        np.maximum.at(push, blocks, np.hypot(settled.normal_force, settled.shear_force))
        touched[blocks[found.state != OPEN]] = True
    free = np.flatnonzero(touched & (order >= 0))
    return bool((push[free] < NOTHING * np.abs(equations.right[order[free], :2]).max(axis=1)).any())


def _borne_if_possible(equations: Equations, effort: Effort, settled: Settled) -> Settled:
    """The result ``settled``, in which blocks fall, or another in which contacts bear them.

    A block between two others that bears by friction may also fall without any force on its faces: where contacts slide in
    the same iteration as others open, Newton's method may find either. (The halves of a voussoir beam of order 3 and 5 fell
    by 25 mm in the first static step, and were borne in the next one.)
    """
    try:
        other = _Search(equations, replace(effort, opens_first=True)).settled()
    except Unsettled:
        return settled
    iterations = settled.iterations + other.iterations
    return replace(settled if _falls(equations, other) else other, iterations=iterations)


def _with_bonds_restored(equations: Equations, effort: Effort, settled: Settled) -> Settled:
    """The result ``settled`` with restored bonds of contacts that lost them but are closed in the end; unchanged if
    that does not converge soon."""
    found = equations.found
    began = found.bonded if found.tried is None else found.tried[2]
    effort = replace(effort, max_iterations=effort.max_iterations // 2, in_order=True)
    iterations = settled.iterations
    restored = np.zeros(len(found), bool)
    while True:
        lost = (began > 0) & (settled.bonded == 0) & (settled.state != OPEN) & ~restored
        if not lost.any():
            return replace(settled, iterations=iterations)
        restored |= lost
        tried = (
            np.where(lost, STICK, settled.state), np.where(lost, 0.0, settled.direction),
            np.where(lost, began, settled.bonded),
        )  # fmt: skip
        try:
            settled = _Search(replace(equations, found=replace(found, tried=tried)), effort).settled()
        except Unsettled as failure:
            log.debug("%d bonds lost during the iteration are not restored: %s", lost.sum(), failure)
            return replace(settled, iterations=iterations + effort.max_iterations)
        iterations += settled.iterations


class _Search:
    """The search for the contact states of one step's ``equations``.

    ``newton``: number of iterations of Newton's method; ``spent``: cost of splitting, the central path and patches in
    iterations. ``may_split``: operator splitting has not been tried yet.
    """

    def __init__(self, equations: Equations, effort: Effort) -> None:
        self.equations, self.effort, self.solver = equations, effort, effort.solver
        found = self.found = equations.found
        n = len(found)
        self.states = ContactStates(
            *((found.state, found.direction, found.bonded) if found.tried is None else found.tried)
        )
        self.normal_force, self.slip = found.normal, np.zeros(n)
        self.newton, self.spent, self.most = 0, 0.0, effort.max_iterations
        self.large = is_large(equations.pattern.n, equations.statics, self.solver)
        self.path: CentralPath | None = None
        self.seen: set[bytes] = set()
        self.offered: set[bytes] = set()
        self.patched = self.pivots = 0
        self.may_split = self.solver.splitting and not effort.within_patch and can_split(self.equations)
        # A contact that sticks when closed, is opened by its own shear and closes again must slide.
        self.closed, self.sheared = np.zeros(n, np.int64), np.zeros(n)
        self.continuing = False
        self._restart()

    def _continued(self) -> bool:
        """Whether the search begins again with laws that lead to the actual ones (`NonlinearLaws.continued`)."""
        curved, found = self.equations.curved, self.found
        if curved is None or not curved.continued():
            return False
        self.states = ContactStates(
            found.state, found.direction, found.bonded if found.tried is None else found.tried[2]
        )
        self.normal_force, self.slip, self.continuing = found.normal, np.zeros(len(found)), True
        self._begin_again()
        return True

    def _proceeded(self) -> bool:
        """Whether the search continues, from the states found, with the next of these laws."""
        curved = self.equations.curved
        self.continuing = curved is not None and curved.proceeded()
        if self.continuing:
            self._begin_again()
        return self.continuing

    def _begin_again(self) -> None:
        """Restart the counts and limits of the search."""
        self.seen.clear()
        self.pivots, self.closed = 0, np.zeros(len(self.found), np.int64)
        self.most = self.newton + self.effort.max_iterations
        self._restart()

    def _restart(self, proposed: bool = False) -> None:
        """Restart the counts with other states, which may be ``proposed`` by the central path."""
        self.fewest, self.tries, self.proposed, self.falls = np.inf, 0, proposed, True
        self.best: tuple[ContactStates, Answer, np.ndarray] | None = None

    def settled(self) -> Settled:
        """The consistent states. Raises `Unsettled`."""
        while True:
            answer = self._answer()
            wrong = answer.violation > 0
            agrees = answer.missed is None or not answer.missed.any()
            if not wrong.any() and agrees:
                if self._proceeded():
                    continue
                return self._found(answer)
            if self.newton >= self.most:
                if not self._continued():
                    self._break_or_fail(answer)
                continue
            if not wrong.any():
                continue
            if not self.effort.in_order:
                answer = replace(answer, called=answer.called.without_open_bonds())
            number = int(wrong.sum())
            bonds = wrong & (self.states.bonded != answer.called.bonded)
            if bonds.sum() == number:
                self._break_bonds(answer, bonds)
                continue
            wrong &= ~bonds
            called = self._called(answer, wrong)
            returned = self.states.key in self.seen
            self.seen.add(self.states.key)
            if returned and agrees and not self.continuing and _negligible(answer, self.found, number, self.solver):
                return self._found(answer)
            self._count(number, answer, wrong)
            if self._by_patch(answer, wrong, number):
                continue
            if not self.equations.first_order:
                self._pivot(answer, wrong, called, returned)
            elif returned or self._overshoots(answer) or self.tries > self._most_tries(number):
                result = self._by_static_splitting()
                if result is not None:
                    return result
                if not self._by_splitting():
                    self._by_path(answer)
            else:
                self.states = self.states.switched(wrong, called)

    def _answer(self) -> Answer:
        """The solution in the present states."""
        self.newton += 1
        answer = self.equations.answer(self.states, self.normal_force, self.slip)
        self.normal_force, self.slip = answer.forces[:, 0], answer.slip
        self.sheared = np.where(self.states.state == STICK, answer.forces[:, 1], self.sheared)
        return answer

    def _found(self, answer: Answer) -> Settled:
        return self.equations.settled(self.states, answer, self.newton + round(self.spent))

    def _break_bonds(self, answer: Answer, bonds: np.ndarray) -> None:
        """Break the first of the overloaded ``bonds`` (n,) bool, once everything else is consistent, and restart the
        search, whose limits start again: the number of bonds decreases each time."""
        found = self.found
        if self.effort.in_order:
            first = self.equations.first_bonds(self.states, answer, bonds)
        else:
            order = self.equations.pattern.order
            first = bonds & _at_least_half_of_the_worst(answer.violation, found.block, found.other, order)
        self.states = self.states.switched(first, answer.called)
        self.most = max(self.most, self.newton + self.effort.max_iterations)
        self._restart()

    def _break_or_fail(self, answer: Answer) -> None:
        """Break overloaded bonds although other contacts are inconsistent, where bonds give. Raises `Unsettled` if none
        is overloaded."""
        bonds = (answer.violation > 0) & (self.states.bonded != answer.called.bonded)
        if not self.effort.bonds_give or not bonds.any():
            raise self._unsettled(answer)
        self.seen.clear()
        self._break_bonds(answer, bonds)

    def _called(self, answer: Answer, wrong: np.ndarray) -> ContactStates:
        """The states that the ``answer`` requires."""
        closing = wrong & (self.states.state == OPEN) & (answer.called.state == STICK)
        called = answer.called.sliding(closing & (self.closed > 0), self.sheared)
        self.closed += closing
        return called

    def _count(self, number: int, answer: Answer, wrong: np.ndarray) -> None:
        """Record the ``number`` of inconsistent contacts, and whether it is a new minimum."""
        self.tries = 0 if number <= self.solver.newton_reduction * self.fewest else self.tries + 1
        self.falls = number < self.fewest
        if self.falls:
            self.fewest, self.best = number, (self.states, answer, wrong)

    def _overshoots(self, answer: Answer) -> bool:
        """Whether operator splitting, if not tried yet, is faster than Newton's method because the forces of
        inconsistent contacts are large."""
        forces = float(np.abs(answer.forces[:, 0]).sum())
        return self.may_split and float(answer.violation.sum()) > self.solver.splitting_violation * forces

    def _most_tries(self, number: int) -> int:
        """Number of iterations allowed without a new minimum: none for a large system, whose factors are expensive, or
        if operator splitting is cheaper for so many inconsistent contacts."""
        few = number <= self.solver.few_wrong * len(self.found)
        solver = self.equations.pattern.solver
        if few and (solver is None or solver.in_parts):
            return self.solver.newton_tries_if_few
        return -1 if self.large else 0 if self.may_split else self.solver.newton_tries

    def _by_patch(self, answer: Answer, wrong: np.ndarray, number: int) -> bool:
        """Whether the few inconsistent contacts could be solved on the blocks around them alone, from the best states
        so far: where their number does not decrease any more, or Newton's method overshoots."""
        solver, effort = self.solver, self.effort
        if (
            not solver.patches
            or not self.equations.first_order
            or effort.within_patch
            or self.equations.pattern.solver is None
            or (self.may_split and self.fewest > solver.splitting_wrong * len(self.found))
            or self.patched >= solver.patch_tries
        ):
            return False
        assert self.best is not None
        goes_on = self.falls and not self.proposed and not self._overshoots(self.best[1])
        if goes_on or self.fewest > solver.patch_wrong * len(self.found):
            return False
        states, of, which = self.best
        within = replace(effort, within_patch=True, in_order=True)
        proposal, spent = settled_in_patch(
            self.equations, which | wrong, states, of, lambda equations: _Search(equations, within).settled(), solver
        )
        self.patched, self.spent = self.patched + 1, self.spent + spent
        if proposal is None or proposal.key in self.seen:
            self.proposed = False
            return False
        self.states = proposal
        self._restart()
        return True

    def _by_static_splitting(self) -> Settled | None:
        """The result of operator splitting continued until forces balance; None if it does not apply. Raises
        `Unsettled`."""
        equations, bonded = self.equations, self._bonds_on_path()
        if self.effort.within_patch or not can_split_statics(equations, bonded, self.solver):
            return None
        solved = split_statics(equations, bonded, self.solver)
        return self._split(solved, self._bonds_after_path(solved.state, bonded))

    def settled_by_plastic_splitting(self) -> Settled:
        """The result of operator splitting with cohesion, joint stiffness or bolts. Raises `Unsettled`."""
        return self._split(*split_plastic(self.equations, self.solver))

    def _split(self, solved: Converged, bonded: np.ndarray) -> Settled:
        """The result of operator splitting, ``solved``, with bonds ``bonded`` (n,)."""
        equations = self.equations
        log.debug("operator splitting: %d iterations", solved.iterations)
        self.spent += solved.spent
        self.states = ContactStates(solved.state, solved.direction, bonded)
        slip = np.zeros(len(self.found))
        return self._found(
            equations.checked(self.states, solved.unknowns, solved.forces, equations.springs, equations.gap, slip)
        )

    def _by_splitting(self) -> bool:
        """Whether operator splitting proposes states; it is used only once. Raises `Unsettled`."""
        if not self.may_split:
            return False
        self.may_split = False
        try:
            proposal = split(self.equations, self._bonds_on_path(), self.solver)
        except np.linalg.LinAlgError as error:
            raise Unsettled(str(error)) from error
        self.spent += proposal.spent
        if proposal.states.key in self.seen:
            return False
        self.states, self.most = proposal.states, max(self.most, self.newton + self.solver.newton_to_finish)
        self._restart()
        return True

    def _pivot(self, answer: Answer, wrong: np.ndarray, called: ContactStates, returned: bool) -> None:
        """Switch all ``wrong`` contacts to the required states ``called``; or, once states have ``returned`` or the
        number does not decrease, only the worst of each block until there is a new minimum: block principal pivoting
        (Júdice & Pires 1994). Raises `Unsettled`."""
        if not returned and self.tries <= self.solver.newton_tries:
            opens = wrong & ((called.state == OPEN) != (self.states.state == OPEN))
            some = opens if self.effort.opens_first and opens.any() else wrong
            self.states = self.states.switched(some, called)
            return
        if self._continued():
            return
        self.pivots += 1
        if self.pivots > self.effort.max_iterations:
            raise self._unsettled(answer)
        self.most = max(self.most, self.newton + self.effort.max_iterations)
        found, violation = self.found, np.where(wrong, answer.violation, 0.0)
        if self.pivots <= self.effort.max_iterations // 2:
            some = wrong & _at_least_half_of_the_worst(
                violation, found.block, found.other, self.equations.pattern.order
            )
        else:
            # Switching several worst contacts may cycle; switching one at a time does not (Murty 1974).
            some = np.arange(len(wrong)) == (violation.argmax() if self.pivots % 2 else wrong.argmax())
        self.states = self.states.switched(some, called)

    def _by_path(self, answer: Answer) -> None:
        """Continue with states proposed by the central path, or with fewer bonds if it has none. Raises `Unsettled`."""
        equations, bonded = self.equations, self._bonds_on_path()
        if self.path is None or not np.array_equal(self.path.bonded, bonded):
            laws = answer.springs, answer.gap
            self.path = CentralPath(equations, laws, bonded, self.normal_force, self.solver)
        proposal = self._proposed(self.path) if self.solver.central_path else None
        if proposal is None:
            self._break_or_fail(answer)
            return
        self.seen.clear()
        self.states, self.most = proposal, max(self.most, self.newton + self.solver.newton_to_finish)
        self._restart(proposed=True)

    def _bonds_on_path(self) -> np.ndarray:
        """(n,) bonds on the central path. Open contacts lose theirs, except on whole faces (`whole_faces`), which keep
        their cohesion if one end is open. Such a face without tensile strength can open, and slide under its
        cohesion."""
        states, found = self.states, self.found
        bonded = states.without_open_bonds().bonded
        if found.whole is None:
            return bonded
        bonded = np.where(found.whole.face >= 0, states.bonded, bonded)
        return np.where(self._without_pull(bonded), SLIPPED, bonded)

    def _without_pull(self, bonded: np.ndarray) -> np.ndarray:
        """(n,) bool: ``bonded`` contacts (n,) of whole faces without tensile strength that keep their cohesion when
        they slide."""
        springs, whole = self.equations.springs, self.found.whole
        assert whole is not None
        return (whole.face >= 0) & (bonded > 0) & (springs.tension <= 0.0) & (springs.keeps > 0)

    def _bonds_after_path(self, state: np.ndarray, bonded: np.ndarray) -> np.ndarray:
        """(n,) bonds for the iterations after the path has proposed ``state`` (n,) with ``bonded`` (n,): faces that
        stick over their whole length have not slipped."""
        whole = self.found.whole
        if whole is None:
            return bonded
        known = whole.face >= 0
        slides = np.zeros(int(whole.face.max()) + 1, bool)
        slides[whole.face[known & (state == SLIP)]] = True
        return np.where(known & ~slides[whole.face] & (bonded == SLIPPED), self.states.bonded, bonded)

    def _proposed(self, path: CentralPath) -> ContactStates | None:
        """New states proposed by the ``path`` once nearly all contacts are decided; None if it ends,
        exceeds its limit or, in a large system, is stopped by contacts. Raises `Unsettled`."""
        solver, n = self.solver, len(self.found)
        while path.taken < solver.path_iterations:
            try:
                undecided = path.advance()
            except np.linalg.LinAlgError as error:
                raise Unsettled(str(error)) from error
            self.spent += 1
            if not path.arrived and (path.ended or (self.large and path.stopped)):
                return None
            # Contacts that carry no load in so short a step are neither closed nor open; round-off decides.
            few = max(2, min(solver.path_undecided, solver.path_undecided_share * n))
            decided = path.arrived or undecided <= few
            if decided and path.missed < solver.path_balance and path.epsilon < 1.0:
                state, direction = path.states()
                states = ContactStates(state, direction, self._bonds_after_path(state, path.bonded))
                if states.key not in self.offered:
                    self.offered.add(states.key)
                    return states
            if path.ended:
                return None
        return None

    def _unsettled(self, answer: Answer) -> Unsettled:
        wrong = answer.violation if answer.missed is None or answer.violation.any() else answer.missed
        worst = int(wrong.argmax())
        name = ("open", "sticking", "sliding")[self.states.state[worst]]
        return Unsettled(
            f"contact states did not settle in {self.newton + round(self.spent)} open-close iterations; a contact that "
            f"was {name} is still inconsistent with its motion",
            worst,
        )


def _negligible(answer: Answer, found: ContactSet, number: int, solver: ContactSolver) -> bool:
    """Whether the violations of all ``number`` inconsistent contacts are negligible compared with the forces on their
    blocks. For a sliver between loaded blocks there may be no consistent states."""
    if number > solver.sliver_contacts:
        return False
    largest = np.zeros(int(max(found.block.max(), found.other.max())) + 1)
    largest_of_blocks(np.abs(answer.forces[:, 0]), found.block, found.other, largest)
    wrong = np.flatnonzero(answer.violation > 0)
    carried = np.maximum(largest[found.block[wrong]], largest[found.other[wrong]])
    return bool((answer.violation[wrong] <= solver.sliver_force * carried).all())


def _at_least_half_of_the_worst(
    violation: np.ndarray, block: np.ndarray, other: np.ndarray, order: np.ndarray
) -> np.ndarray:
    """(n,) True for contacts at least half as violated as any other contact of either of their free blocks."""
    worst = np.zeros(len(order))
    largest_of_blocks(violation, block, other, worst)
    worst[order < 0] = 0.0
    return violation >= 0.5 * np.maximum(worst[block], worst[other])
