"""Crack strain from the mean stress alone: for all blocks in motion, and in statics for blocks on thin ligaments.

The strain of a DDA block is uniform. The contact forces open its cracks by their mean stress σ and by bending and
uneven pressure. The latter part has no counterpart in the block: bending forces do no work on a uniform strain,
although by reciprocity they do on the cracked body. If it were handed to the block, a closed cycle of σ would do the
work ∮ A σ : dε_c with ε_c not a function of σ, and so create or destroy energy (a cantilever cracked through half its
depth gained and lost more than the whole work of its weight). Moreover, in a nearly divided block the iteration between
forces and crack strain can have a gain of hundreds, and some states are never found.

These cracks therefore get the strain

    ε_c = ∂W/∂σ,   W(σ): complementary energy per area that the cracks add under uniform stress, with face contact.

W is convex, so blocks and cracks agree after a few iterations (after one, while no face opens or closes), and no energy
is gained. The tips are still loaded by the actual forces, solved once the iteration has converged. Lost is only the
mean strain of cracks that bending opens.

In statics energy cannot accumulate, and converged passes are in equilibrium with the actual forces. There a block takes
the mean-stress response only if its passes do not converge, and all soft blocks only if that does not suffice. (The
mean stress of a specimen in a shear box would put shear on its free sides: with this response it bore 4 % less.)
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from .added_compliance import passive, stress_rotation

if TYPE_CHECKING:
    from ...ddm import Body, FaceMemory, Solution
    from ...ddm.loads.uniform_stress_response import UniformStressSolution
    from .block_stress_field import BlockStressField

#: Softness from which a block counts as soft in statics: compliance that its cracks, all open, add in some direction,
#: over that of its rock. (An edge crack through half of a square adds 4.)
SOFT = 4.0

#: Largest softness taken into account, in any direction (`ByMeanStress.limit`). A block with a thinner ligament (an
#: edge crack through three quarters of a square) acts as two blocks, held in place by their neighbours and not by the
#: ligament; the strain of both as one block would make it overlap its neighbours.
SOFTEST = 30.0


#: Relative change of the softness or of the limit below which they have not changed.
_SAME = 1e-6


@dataclass(eq=False)
class _Softness:
    """Softness of a block with this ``crack_system``: with all cracks ``open`` (None: not asked for since the cracks have
    grown); the present ``limit``; the face ``states`` last looked at (None: not solved since then)."""

    crack_system: object
    open: float | None
    limit: np.ndarray
    states: object = None

    @property
    def is_settled(self) -> bool:
        """Whether the limit is that of states under which the block has been solved, or no states need one."""
        return self.states is not None or (self.open is not None and self.open <= SOFTEST)


@dataclass(eq=False)
class ByMeanStress:
    """The blocks with this response, and the solutions under their mean stress in the last pass (block →)."""

    solutions: dict[int, Solution | UniformStressSolution] = field(default_factory=dict)
    #: Memory of frictional crack faces in these solutions at the end of the last step.
    memory: dict[int, FaceMemory] = field(default_factory=dict)
    #: Mean stress of the last pass in the block's own axes, Pa, and `limit` at that time.
    stress: dict[int, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    #: Of blocks of higher order, which respond to their whole stress: mean stress and what their deflection adds.
    fields: dict[int, BlockStressField] = field(default_factory=dict)
    _softness: dict[int, _Softness] = field(default_factory=dict)
    _blocks: set[int] = field(default_factory=set)
    #: Blocks of higher order whose softness is limited.
    _limited: set[int] = field(default_factory=set)
    #: Whether all bodies have this response in every pass, so that much is worth keeping for it.
    _moves: bool = False

    def __contains__(self, block: int) -> bool:
        return block in self._blocks

    def add(self, block: int) -> None:
        """Give ``block`` this response from now on, however soft it is, until it is split."""
        self._blocks.add(block)

    def give_way(self, block: int) -> None:
        """As `add`, in statics, where passes do not converge without it: the softness of a block of higher order is limited
        from now on as well."""
        self._blocks.add(block)
        if block in self.fields and block not in self._limited:
            self._limited.add(block)
            self._softness.pop(block, None)

    def take_all(self, bodies: dict[int, Body]) -> None:
        """Give all ``bodies`` (block →) this response, in motion."""
        self._blocks.update(bodies)
        self._moves = True

    def take_fields(self, fields: dict[int, BlockStressField]) -> None:
        """Give blocks of higher order (block → its stress field) this response, to all of their stress."""
        self.fields = fields
        self._blocks.update(fields)

    def forget(self, blocks: Collection[int]) -> None:
        """Forget what was found for ``blocks`` that have more components of stress now; the memory of their faces is
        kept."""
        for block in blocks:
            for known in (self.solutions, self.stress, self._softness):
                known.pop(block, None)

    def elastic(self, block: int, compliance: np.ndarray) -> np.ndarray:
        """(3, 3) or (3 + m, 3 + m) compliance of the rock of ``block``, whose mean strain has this ``compliance``
        (3, 3), 1/Pa."""
        known = self.fields.get(block)
        return compliance if known is None else known.rock

    def crack_strain(self, block: int, solution: Solution | UniformStressSolution) -> np.ndarray:
        """(3,) crack strain of ``block`` in its own axes, or (3 + m,) that of a block of higher order."""
        known = self.fields.get(block)
        return solution.crack_strain if known is None else known.crack_strain(solution.body, solution.jumps)

    def compliance(
        self, block: int, body: Body, solution: Solution | UniformStressSolution | None = None
    ) -> np.ndarray:
        """(3, 3) or (3 + m, 3 + m) S of ``block``, as in `crack_strain`, with the face states of ``solution``."""
        known = self.fields.get(block)
        return body.compliance(solution) if known is None else known.compliance_of(body, solution)

    def find(self, bodies: dict[int, Body], elastic: np.ndarray, contacts: np.ndarray) -> None:
        """Add those ``bodies`` (block →) that are soft compared with their ``elastic`` compliance (n_blocks, 3, 3) and
        loaded by contacts (CONTACT rows): only contact forces depend on the strain of a block."""
        pressed = contacts[(contacts["normal_force"] != 0) | (contacts["shear_force"] != 0)]
        for block in np.unique([pressed["block"], pressed["other"]]).tolist():
            if block not in bodies or block in self._blocks:
                continue
            if self.soft(block, bodies[block], elastic[block]):
                self._blocks.add(block)
        for block in sorted(set(self.fields) - self._limited):
            if block in bodies and self._soft(block, bodies[block], self.fields[block].rock) > SOFTEST:
                self.give_way(block)

    def limit(self, block: int, body: Body, elastic: np.ndarray) -> np.ndarray:
        """P (3, 3) of ``block``, which limits its softness: its cracks respond as W(P σ), with the strain Pᵀ ε_c(P σ),
        which still has a potential.

        With S v = s C v and vᵀ C v = 1, s and v the softness and direction of the cracks and C the ``elastic``
        compliance (3, 3), P = Σ √min(1, `SOFTEST`/s) v vᵀ C limits each direction by itself. (One factor for all
        directions would make growing cracks stiffen others.) S is that of the softest face states under which the
        block has been solved since its cracks last grew; all cracks are open before it is solved. (With S of open
        cracks, a block whose cracks are closed in part would stiffen as a tip nears the surface: to a fifth.)"""
        return self._known(block, body, elastic).limit

    def answer(
        self,
        block: int,
        body: Body,
        stress: np.ndarray,
        rotation: float,
        elastic: np.ndarray,
        began: FaceMemory | None = None,
        skip: bool = True,
    ) -> Solution | UniformStressSolution:
        """Solution of ``body``, rotated by ``rotation`` rad, under its mean ``stress`` (3,), or its whole one (3 + m,)
        (`fields`), Pa, current axes, times its `limit`. With ``skip``, scaled from solutions under unit stresses where that is exact. Faces start with
        their memory of such solutions, or with ``began`` where there is none. Raises `ddm.NotConverged`."""
        own = stress_rotation(-rotation, len(stress)) @ stress
        limit = self.limit(block, body, elastic)
        known = self._solved(block, body, limit @ own, began, skip)
        if self._changes_limit(block, body, elastic, known):
            limit = self.limit(block, body, elastic)
            known = self._solved(block, body, limit @ own, began, skip)
        self.solutions[block], self.stress[block] = known, (own, limit)
        return known

    def _solved(
        self, block: int, body: Body, stress: np.ndarray, began: FaceMemory | None, skip: bool
    ) -> Solution | UniformStressSolution:
        """Solution of ``body`` under ``stress`` (3,), Pa, as in `answer`."""
        from ...ddm import BodyLoad
        from ...ddm.crack_contact.uniform_friction import solved_in_states
        from ...ddm.loads.uniform_stress_response import scaled

        before, whole, memory = self.solutions.get(block), self.fields.get(block), self.memory.get(block, began)
        known: Solution | UniformStressSolution | None = None
        if skip and whole is None:
            start = body.initial_memory if memory is None else memory
            known = solved_in_states(body, stress, before, start) if body.rough else scaled(body, stress, before)
        if known is not None:
            return known
        if whole is None and skip and self._moves:
            body.uniform_solutions += 1
            condensed = body.condensed_contact(None if before is None else before.closed)
            known = None if condensed is None else condensed.solve(stress)
            if known is not None:
                return known
        load = body.mean_stress_load(stress) if whole is None else BodyLoad(intact=whole.under(stress))
        found = body.solve(load, warm=before, history=memory, meet_target=False)
        if self._moves:
            body.forget_states()
        return found

    def _changes_limit(
        self, block: int, body: Body, elastic: np.ndarray, solution: Solution | UniformStressSolution
    ) -> bool:
        """Whether the limit of ``block`` changes with the face states of ``solution``: because they are the first since its
        cracks have grown, or softer than `SOFTEST` under the present limit."""
        known = self._known(block, body, elastic)
        small = known.open is not None and known.open <= SOFTEST
        if small or (block in self.fields and block not in self._limited):
            return False
        states = solution.closed.tobytes() if solution.memory is None else solution.face_states.key
        if states == known.states:
            return False
        first, known.states = known.states is None, states
        compliance = passive(self.compliance(block, body, solution), elastic)
        present_softness, _ = _limited(elastic, known.limit.T @ compliance @ known.limit)
        if not first and present_softness <= SOFTEST * (1.0 + _SAME):
            return False
        before, (_, known.limit) = known.limit, _limited(elastic, compliance)
        return not np.allclose(before, known.limit, rtol=0.0, atol=_SAME)

    def limits(self, block: int) -> bool:
        """Whether the softness of ``block`` was limited in the last pass."""
        limit = self.stress[block][1]
        return not np.array_equal(limit, np.eye(len(limit)))

    def strained(self, block: int, solution: Solution | UniformStressSolution) -> tuple[np.ndarray, np.ndarray]:
        """Stress of the last pass, Pa, and the crack strain that ``solution`` gives the block; in its own axes, as in
        `crack_strain`."""
        stress, limit = self.stress[block]
        return stress, limit.T @ self.crack_strain(block, solution)

    def take_step(self) -> None:
        """Accept the step."""
        self.memory = {b: known.memory for b, known in self.solutions.items() if known.memory is not None}

    def inherited(self, parent: np.ndarray, whole: np.ndarray) -> ByMeanStress:
        """The response of new blocks: of ``whole`` (k,) new numbers, the data of their ``parent`` (n_blocks,) are
        kept."""

        def kept(known: dict[int, Any]) -> dict[int, Any]:
            return {child: known[parent[child]] for child in whole.tolist() if parent[child] in known}

        own = {b for b in whole.tolist() if parent[b] in self._blocks}
        return ByMeanStress(
            kept(self.solutions), kept(self.memory), kept(self.stress), _softness=kept(self._softness), _blocks=own,
            _limited={b for b in whole.tolist() if parent[b] in self._limited},
        )  # fmt: skip

    def soft(self, block: int, body: Body, elastic: np.ndarray) -> bool:
        """Whether open cracks make ``block`` more than `SOFT` times as soft as its rock in some direction."""
        return self._soft(block, body, elastic) > SOFT

    def _soft(self, block: int, body: Body, elastic: np.ndarray) -> float:
        """Largest ratio, over all directions, of the compliance of open cracks to the ``elastic`` one (3, 3)."""
        known = self._known(block, body, elastic)
        if known.open is None:
            known.open = _limited(elastic, self.compliance(block, body))[0]
        return known.open

    def _known(self, block: int, body: Body, elastic: np.ndarray) -> _Softness:
        known = self._softness.get(block)
        if known is None or known.crack_system is not body.crack_system:
            if self._moves and known is not None and known.is_settled and block not in self.fields:
                # In motion the limit follows from the face states that are found: the equations of open cracks, of which
                # most may be closed, are not needed.
                known = self._softness[block] = _Softness(body.crack_system, None, known.limit)
                return known
            before = None if known is None or known.states is None else known.limit
            softness, limit = _limited(elastic, self.compliance(block, body))
            if block in self.fields and block not in self._limited:
                # Two parts on a thin ligament turn against each other by deflection.
                limit = np.eye(len(elastic))
            # Cracks that have grown begin with the limit of before: most of their faces stay as they are.
            known = _Softness(body.crack_system, softness, limit if before is None or softness <= SOFTEST else before)
            self._softness[block] = known
        return known


def _limited(elastic: np.ndarray, compliance: np.ndarray) -> tuple[float, np.ndarray]:
    """Largest softness of cracks of this ``compliance`` (w, w) in rock of the ``elastic`` one (w, w), and the `limit` P."""
    # C = L Lᵀ, L⁻¹ S L⁻ᵀ w = s w, v = L⁻ᵀ w.
    back = np.linalg.inv(np.linalg.cholesky(elastic))
    times, ways = np.linalg.eigh(back @ compliance @ back.T)
    ways = back.T @ ways
    part = np.sqrt(SOFTEST / np.maximum(times, SOFTEST))
    limit = (ways * part) @ ways.T @ elastic if part[0] < 1 or part[-1] < 1 else np.eye(len(elastic))
    return float(times[-1]), limit
