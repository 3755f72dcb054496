"""Blocks whose cracks answer to the mean stress alone: all of them in motion, in statics those that hang by thin
ligaments.

The block solver's blocks strain evenly. The strain that the forces on a block open its cracks by is that of their mean
stress σ and what bending and uneven pressure add; what they add has no counterpart: forces that bend cracks open do no
work on an even strain, as by reciprocity they would on that of the cracked block. In motion that takes energy from
nowhere, or leaves it there: round a cycle σ gives ∮ A σ : dε_c, with ε_c not a function of σ (a cantilever cracked
through half of its depth, under its weight, gained and lost more than all of the weight's work). In a block that is
nearly cut through forces and strain chase each other besides, with a gain of up to hundreds, and there are states that
no passes find. So these cracks bring the strain ε_c = ∂W/∂σ, with W(σ) the complementary energy, per area, that they
add to the body under a uniform stress, faces closing or not. W is convex: blocks and cracks agree in a few passes, in
one while no face opens or closes, and no energy is gained. What drives the tips is solved under the actual forces as
ever, once there is an answer. (What is lost is the mean strain of cracks that are bent open; that bent blocks also turn
one half against the other, blocks of one strain never had.)

In statics no motion can take energy from anywhere, and passes that agree are an equilibrium of the forces that act:
there a block takes its mean stress only where its passes do not agree, and all soft ones only in a step in which that
is not enough. (A specimen sheared between the halves of a box has no shear on its sides, which its mean stress would
put there: as it came to hang it bore 4 % less at once, and its cracks then ran through.)
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from .added_compliance import stress_rotation

if TYPE_CHECKING:
    from ...ddm import Body, FaceMemory, Solution
    from ...ddm.loads.uniform_stress_response import EvenSolution

#: At rest a block hangs from where its cracks, were they all open, make it so many times softer than its rock in some
#: direction. (An edge crack through half of a square adds 4.)
SOFT = 4.0

#: No block is taken for more than so many times softer in any direction (`ByMeanStress.limit`). What hangs by less (an
#: edge crack through three quarters of a square) is two blocks already: neighbours hold them in place, not the
#: ligament, and the strain of the two as one would run into the neighbours.
SOFTEST = 30.0


@dataclass(eq=False)
class ByMeanStress:
    """The blocks that do, and the solutions of their bodies under the mean stress of the last pass (block →)."""

    solutions: dict[int, Solution | EvenSolution] = field(default_factory=dict)
    #: What crack faces with friction remember of these solutions at the end of the last step.
    _memory: dict[int, FaceMemory] = field(default_factory=dict)
    #: The mean stress of the last pass, in the block's own axes, Pa, and its `limit` then.
    stress: dict[int, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    #: Crack system, softness, limit.
    _softness: dict[int, tuple[object, float, np.ndarray]] = field(default_factory=dict)
    _blocks: set[int] = field(default_factory=set)

    def __contains__(self, block: int) -> bool:
        return block in self._blocks

    def add(self, block: int) -> None:
        """``block`` does from now on, however soft it is, as long as it is whole."""
        self._blocks.add(block)

    def take_all(self, bodies: dict[int, Body]) -> None:
        """Every one of the ``bodies`` (block →) answers to its mean stress."""
        self._blocks.update(bodies)

    def find(self, bodies: dict[int, Body], elastic: np.ndarray, contacts: np.ndarray) -> None:
        """Add those of the ``bodies`` (block →) that are soft beside their ``elastic`` compliance (n_blocks, 3, 3) and
        that CONTACT rows press: forces that go with a block's strain are those of contacts."""
        pressed = contacts[(contacts["normal_force"] != 0) | (contacts["shear_force"] != 0)]
        for block in np.unique([pressed["block"], pressed["other"]]).tolist():
            if block not in bodies or block in self._blocks:
                continue
            if self.soft(block, bodies[block], elastic[block]):
                self._blocks.add(block)

    def limit(self, block: int, body: Body, elastic: np.ndarray) -> np.ndarray:
        """P (3, 3) of ``block``, whose cracks answer as W(P σ): the strain Pᵀ ε_c(P σ), which has a potential as before.
        With s and v softness and direction of open cracks, S v = s C v and vᵀ C v = 1 (C is the ``elastic`` compliance
        (3, 3)), P = Σ √min(1, `SOFTEST`/s) v vᵀ C: open cracks are as soft as they are, or `SOFTEST` times the rock, in
        each direction by itself. (Were it one factor for all of them, cracks that grow would stiffen others.)"""
        return self._known(block, body, elastic)[2]

    def answer(
        self,
        block: int,
        body: Body,
        stress: np.ndarray,
        rotation: float,
        elastic: np.ndarray,
        began: FaceMemory | None = None,
        skip: bool = True,
    ) -> Solution | EvenSolution:
        """The solution of ``body``, which has turned by ``rotation`` rad, under what its `limit` leaves of its mean
        ``stress`` (3,), Pa, current axes; scaled from unit ones where that is enough and nothing is to be worked out
        anew (``skip``). Faces begin with what they remember of such solutions, or with ``began`` where there is none.
        Raises `ddm.NotConverged`."""
        from ... import ddm
        from ...ddm.loads.uniform_stress_response import scaled

        own = stress_rotation(-rotation) @ stress
        limit = self.limit(block, body, elastic)
        before, even = self.solutions.get(block), limit @ own
        known = scaled(body, even, before) if skip else None
        if known is None:
            load = ddm.BodyLoad(remote_stress=even)
            known = body.solve(load, warm=before, history=self._memory.get(block, began), meet_target=False)
        self.solutions[block], self.stress[block] = known, (own, limit)
        return known

    def limits(self, block: int) -> bool:
        """Whether ``block`` was taken for no softer than so much in the last pass."""
        return not np.array_equal(self.stress[block][1], np.eye(3))

    def strained(self, block: int, solution: Solution | EvenSolution) -> tuple[np.ndarray, np.ndarray]:
        """The mean stress of the last pass (3,), Pa, and the strain (3,) that the cracks of ``solution``, under what the
        limit leaves of it, bring; in the block's own axes."""
        stress, limit = self.stress[block]
        return stress, limit.T @ solution.crack_strain

    def take_step(self) -> None:
        """Go on from the end of a step."""
        self._memory = {b: known.memory for b, known in self.solutions.items() if known.memory is not None}

    def inherited(self, parent: np.ndarray, whole: np.ndarray) -> ByMeanStress:
        """That of new blocks: of those that are their ``parent`` (n_blocks,), ``whole`` (k,) numbers, what is known
        stays."""
        solutions, memory, stress, softness = (
            {child: known[parent[child]] for child in whole.tolist() if parent[child] in known}
            for known in (self.solutions, self._memory, self.stress, self._softness)
        )
        own = {b for b in whole.tolist() if parent[b] in self._blocks}
        return ByMeanStress(solutions, memory, stress, softness, own)

    def soft(self, block: int, body: Body, elastic: np.ndarray) -> bool:
        """Whether open cracks make ``block`` more than `SOFT` times as soft as its rock in some direction."""
        return self._soft(block, body, elastic) > SOFT

    def _soft(self, block: int, body: Body, elastic: np.ndarray) -> float:
        """How many times the ``elastic`` compliance (3, 3) open cracks add, in the direction in which they add most."""
        return self._known(block, body, elastic)[1]

    def _known(self, block: int, body: Body, elastic: np.ndarray) -> tuple[object, float, np.ndarray]:
        known = self._softness.get(block)
        if known is None or known[0] is not body.crack_system:
            # By C = L Lᵀ: L⁻¹ S L⁻ᵀ w = s w, v = L⁻ᵀ w.
            back = np.linalg.inv(np.linalg.cholesky(elastic))
            times, ways = np.linalg.eigh(back @ body.compliance() @ back.T)
            ways = back.T @ ways
            part = np.sqrt(SOFTEST / np.maximum(times, SOFTEST))
            limit = (ways * part) @ ways.T @ elastic if part[0] < 1 or part[-1] < 1 else np.eye(3)
            known = self._softness[block] = body.crack_system, float(times[-1]), limit
        return known
