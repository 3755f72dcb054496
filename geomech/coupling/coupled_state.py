"""Blocks and cracks as a coupled run has them at present, with what the solvers keep of them from step to step."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .. import dda
from ..ddm.counters import Work
from ..model import Blocks, Cracks, Motion, Problem, State
from ..model.blocks.polygon import winding_number
from .crack_compliance.growth_screening import GrowthScreening
from .crack_compliance.load_extrapolation import LoadExtrapolation
from .crack_compliance.mean_stress_response import ByMeanStress
from .crack_compliance.quasi_newton import Settling
from .load_transfer.boundary_tractions import BoundaryLoad
from .load_transfer.elastic_bodies import elastic_bodies, inherited, solve_bodies
from .monitoring.crack_energy import CrackEnergy
from .splitting.load_inheritance import on_children, on_moved
from .timing import Phases

if TYPE_CHECKING:
    from ..ddm.growth.path_correction import Memory


class CrackedBlocks:
    """What a load step begins with, and what its passes change.

    ``state`` is that at the start of the step; ``problem`` has the loads as they are on the present blocks. ``number``
    and ``load_step`` count cycles and load steps. ``bodies`` (block → elastic body), ``nodes_of`` (block → its nodes in
    the whole network), ``solutions``, ``loads`` and ``compliances`` are of the last pass; ``response`` is what the
    blocks are to assume of their cracks, ``by_mean_stress`` which of them feel only their mean stress, ``acted`` the
    statistics of the last step, with what it takes to move blocks.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.blocks: Blocks = problem.blocks
        self.cracks: Cracks = problem.cracks
        self.state = State.at_rest(problem.blocks)
        self.gauge = problem.gauge
        self.monitors = dict(problem.monitors)
        self.number = 0
        self.load_step = 0
        self.load_time = 0.0  # of the last pass of rock without an end, s
        self.timed, self.each = Phases(), Phases()
        self.block_work = dda.Work()
        self.works: list[Work] = []
        self.bodies: dict[int, object] = {}
        self.solutions: dict[int, object] = {}
        self.loads: dict[int, BoundaryLoad] = {}
        self.compliances: dict[int, tuple] = {}
        self.by_mean_stress = ByMeanStress()
        self.growth_screening = GrowthScreening()
        self.settling, self.extrapolation = Settling(), LoadExtrapolation()
        #: What the last steps of the tips have told of their paths.
        self.chords: Memory = {}
        # What crack faces with friction remember of the load step before: its passes all begin there.
        self.history: dict[int, object] = {}
        self.solved_from: dict[int, object] = {}
        self.budget, self.crack_energy = dda.EnergyBudget(), CrackEnergy(problem.dda.dynamic_factor == 0.0)
        self.acted: dict[str, float] = {}
        self.removed: np.ndarray | None = None
        self._motion: tuple[State, Motion] | None = None
        self._take_blocks()
        #: Where the search for rest under the in-situ stress ended in a collapse.
        self.collapsed: dda.Equilibrium | None = None
        if problem.in_situ is not None:
            self._settle_in_situ()

    def motion(self, state: State) -> Motion:
        """The blocks' motion in ``state``; the record of one step and the loads of the next ask for the same one."""
        if self._motion is None or self._motion[0] is not state:
            self._motion = state, Motion.of(self.blocks, state.vertices)
        return self._motion[1]

    def limits(self, block: int) -> list[np.ndarray]:
        """Loops about the rock that cracks of ``block`` may grow in; of rock without an end those about what is not
        rock."""
        return self.blocks.loops(block) if self.problem.endless is None else self.bodies[block].limits

    # -- the elastic bodies --------------------------------------------------------------------------------------------

    def take_cracks(self, cracks: Cracks) -> None:
        """Go on with ``cracks`` in the same blocks."""
        self.cracks = cracks
        self._take_bodies()

    def _take_bodies(self) -> None:
        """The elastic bodies of the present cracks, keeping what has not changed."""
        self.bodies, self.nodes_of = self.bodies_of(self.cracks, self.bodies)

    def bodies_of(self, cracks: Cracks, kept: dict) -> tuple[dict, dict[int, np.ndarray]]:
        """The elastic bodies that ``cracks`` would make of the present blocks, and their nodes; see
        `elastic_bodies`."""
        with self.timed("ddm assembly"):
            return elastic_bodies(self.problem, self.blocks, cracks, kept, self.works, self.removed)

    def solve(self, bodies: dict, loads: dict[int, BoundaryLoad], warm: dict) -> dict:
        """block → solution of its body under its load, with the memory of crack faces at the start of the step."""
        with self.timed("ddm solve"):
            return solve_bodies(
                bodies, loads, warm, self.history, self.solved_from, self.problem.run.skip, self.blocks.names
            )

    def strain_solutions(self) -> dict:
        """block → the solution that the strain of its cracks is from, in the last pass."""
        own = self.by_mean_stress
        hang = {block: own.solutions[block] for block in self.bodies if block in own and block in own.solutions}
        return {
            block: hang[block] if block in hang else self.solutions[block]
            for block in self.bodies
            if block in hang or block in self.solutions
        }

    # -- changes of the blocks -----------------------------------------------------------------------------------------

    def _take_blocks(self, parent: np.ndarray | None = None) -> None:
        """New blocks: a new block system. Of blocks that are their ``parent`` (n_blocks,), whole, under another number
        what is known of their cracks is kept."""
        problem = self.problem
        self.system = dda.BlockSystem(
            self.blocks, problem.materials, problem.joints, joint_index=problem.joint_index, settings=problem.dda,
            work=self.block_work,
        )  # fmt: skip
        n = self.blocks.n_blocks
        self.nodes_of = {}
        response = dda.CrackResponse(np.zeros((n, 3, 3)), np.zeros((n, 3)))
        whole = np.zeros(0, int) if parent is None else np.flatnonzero(np.bincount(parent)[parent] == 1)
        if len(whole):
            response.compliance[whole] = self.response.compliance[parent[whole]]
            response.offset[whole] = self.response.offset[parent[whole]]
        self.response = response
        self.bodies, self.solutions, self.compliances, self.solved_from = (
            {child: known[parent[child]] for child in whole.tolist() if parent[child] in known}
            for known in (self.bodies, self.solutions, self.compliances, self.solved_from)
        )
        self.by_mean_stress = self.by_mean_stress.inherited(parent, whole) if len(whole) else ByMeanStress()
        self.growth_screening.renumber(parent, whole)
        self.settling, self.extrapolation = Settling(), LoadExtrapolation()
        self._take_bodies()

    def take_step(self, state: State, budget: dda.EnergyBudget) -> None:
        """Go on from ``state``, where the last pass has left the blocks, with what the faces of its cracks remember."""
        self.state, self.budget = state, budget
        self.history = {b: s.memory for b, s in self.solutions.items() if s.memory is not None}
        self.by_mean_stress.take_step()

    def take_split(self, split) -> None:
        """Blocks, state and cracks of the `Split`; gauges and monitors go to the child that holds their point."""

        def child(block: int, point) -> int:
            parts = np.flatnonzero(split.parent == block)
            if len(parts) == 1:
                return int(parts[0])
            inside = [winding_number(split.blocks.loops(p), np.asarray(point, dtype=float)) for p in parts]
            return int(parts[int(np.argmax(np.abs(inside)))])

        if self.gauge is not None:
            self.gauge = tuple((child(b, p), p) for b, p in self.gauge)
        self.monitors = {name: (child(b, p), p) for name, (b, p) in self.monitors.items()}
        self.problem = replace(self.problem, loads=on_children(self.problem.loads, split.parent, child))
        if self.removed is not None:
            self.removed = self.removed[split.parent]
        self.history = inherited(self.history, split.parent, split.cracks)
        self.blocks, self.state, self.cracks = split.blocks, split.state, split.cracks
        self.budget = self.budget.cut()
        self.crack_energy.parts(split.parent)
        self._take_blocks(split.parent)

    def take_out(self) -> list[int]:
        """Leave out the elastic bodies of blocks that are taken out at the present time, and return these blocks."""
        removed = self.system.removed(self.problem.loads, self.state.time)
        if removed is self.removed:
            return []
        new = removed if self.removed is None else removed & ~self.removed
        self.removed = removed
        self._take_bodies()
        return np.flatnonzero(new).tolist()

    def _settle_in_situ(self) -> None:
        """Begin with the blocks at rest under the in-situ stress; where they are then is the reference. Cracks are as
        if cut into them then: they open and slide from the first step on. Blocks that nothing holds have collapsed; raises
        `dda.NoInSituEquilibrium` where no rest is found for another reason."""
        with self.timed("dda"):
            try:
                found = dda.in_situ_state(self.system, self.problem.in_situ, self.problem.loads)
            except dda.NoInSituEquilibrium as nothing:
                if nothing.found is None or not nothing.found.collapsed:
                    raise
                self.collapsed, self.state = nothing.found, nothing.found.state
                return
        motion = Motion.of(self.blocks, found.state.vertices)

        def moved(block: int, point) -> tuple[float, float]:
            return tuple(motion.current(block, np.asarray(point, dtype=float)).tolist())

        # Cracks that end from both sides at one point of a joint may share its node: their blocks take it to two
        # places.
        ends = np.column_stack([self.cracks.segments.ravel(), np.repeat(self.cracks.block, 2)])
        kept, numbers = np.unique(ends, axis=0, return_inverse=True)
        node, owner = kept.T
        nodes = self.cracks.nodes[node]
        for block in np.unique(owner).tolist():
            own = owner == block
            nodes[own] = motion.current(block, nodes[own])
        self.cracks = replace(
            self.cracks, nodes=nodes, segments=numbers.reshape(-1, 2), surface=self.cracks.surface[node]
        )
        self.problem = replace(self.problem, loads=on_moved(self.problem.loads, moved))
        if self.gauge is not None:
            self.gauge = tuple((b, moved(b, p)) for b, p in self.gauge)
        self.monitors = {name: (b, moved(b, p)) for name, (b, p) in self.monitors.items()}
        self.blocks, self.state = found.blocks, found.state
        self._take_blocks()
