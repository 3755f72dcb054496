"""State of a coupled run: blocks, cracks, and what both solvers keep from step to step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import dda
from ..ddm.counters import Work
from ..model import Blocks, Cracks, Motion, Problem, State
from ..model.blocks.polygon import winding_number
from .crack_compliance.block_stress_field import BlockStressField
from .crack_compliance.growth_screening import GrowthScreening
from .crack_compliance.load_extrapolation import LoadExtrapolation
from .crack_compliance.mean_stress_response import ByMeanStress
from .crack_compliance.quasi_newton import QuasiNewton
from .load_transfer.boundary_tractions import BoundaryLoad
from .load_transfer.elastic_bodies import MANY, elastic_bodies, inherited, solve_bodies
from .monitoring.crack_energy import CrackEnergy
from .splitting.load_inheritance import on_children, on_moved
from .timing import Phases

if TYPE_CHECKING:
    from ..ddm.growth.path_correction import Memory
    from .splitting.block_splitting import Split


class CrackedBlocks:
    """Blocks and cracks at the start of a load step, and the quantities that its passes update.

    ``state`` is the state at the start of the step; ``problem`` has the loads on the present blocks. ``number`` and
    ``load_step`` count cycles and load steps. Of the last pass: ``bodies`` (block → elastic body), ``nodes_of`` (block
    → its nodes in the whole crack network), ``solutions``, ``loads`` and ``compliances``; ``earlier``: the last solutions
    of bodies that were left out; ``response``: the crack response that the blocks assume; ``by_mean_stress``: blocks whose cracks respond to the mean stress alone;
    ``acted``: statistics of the last step, with the work and forces of prescribed motion.
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
        self.bodies: dict[int, Any] = {}
        self.solutions: dict[int, Any] = {}
        self.earlier: dict[int, Any] = {}
        self.loads: dict[int, BoundaryLoad] = {}
        self.compliances: dict[int, tuple] = {}
        self.by_mean_stress = ByMeanStress()
        self.growth_screening = GrowthScreening()
        self.quasi_newton, self.extrapolation = QuasiNewton(), LoadExtrapolation()
        #: Curvature of each tip's path in its last increments.
        self.chords: Memory = {}
        # Slip and damage of frictional crack faces at the start of the load step, where all its passes begin.
        self.history: dict[int, Any] = {}
        self.solved_from: dict[int, Any] = {}
        self.budget, self.crack_energy = dda.EnergyBudget(), CrackEnergy(problem.dda.dynamic_factor == 0.0)
        self.acted: dict[str, float] = {}
        self.removed: np.ndarray | None = None
        self._motion: tuple[State, Motion] | None = None
        #: Of blocks with automatic order (block →): stress fields of higher orders, and softness of their cracks there.
        self.fields_above: dict[int, BlockStressField] = {}
        self.softness_above: dict[int, tuple] = {}
        #: Crack nodes and orders of the last estimate of orders.
        self.estimated: tuple[np.ndarray, np.ndarray] | None = None
        self.response: dda.CrackResponse
        self._take_blocks()
        #: Result of the search for in-situ equilibrium where that ended in a collapse.
        self.collapsed: dda.Equilibrium | None = None
        if problem.in_situ is not None:
            self._settle_in_situ()

    def motion(self, state: State) -> Motion:
        """Motion of the blocks in ``state``, kept for the record of a step and the loads of the next one."""
        if self._motion is None or self._motion[0] is not state:
            self._motion = state, Motion.of(self.blocks, state.vertices)
        return self._motion[1]

    def limits(self, block: int) -> list[np.ndarray]:
        """Loops that bound the rock in which cracks of ``block`` may grow; in unbounded rock the loops around
        openings."""
        return self.blocks.loops(block) if self.problem.endless is None else self.bodies[block].limits

    # -- the elastic bodies --------------------------------------------------------------------------------------------

    def take_cracks(self, cracks: Cracks) -> None:
        """Replace the cracks; the blocks stay."""
        self.cracks = cracks
        self._take_bodies()

    def _take_bodies(self) -> None:
        """Make the elastic bodies of the present cracks; bodies that have not changed are kept."""
        self.bodies, self.nodes_of = self.bodies_of(self.cracks, self.bodies)
        self._take_fields()

    def _take_fields(self) -> None:
        """The stress fields of the cracked blocks of higher order."""
        deflected = self.system.deflected
        if deflected is not None:
            fields, compliance = self.by_mean_stress.fields, self.system.compliance
            bend = [b for b in self.bodies if deflected.order[b] > 1]
            known = {b: fields[b] for b in bend if b in fields and fields[b].blocks is deflected}
            more = {b: BlockStressField.of(deflected, b, compliance[b]) for b in bend if b not in known}
            self.by_mean_stress.take_fields(known | more)

    @property
    def bonds(self) -> np.ndarray:
        """(m, 2) edges along which cells of one rock are still bonded to each other."""
        glued, parted = self.blocks.glued, self.state.parted
        whole = np.zeros((0, 2), int) if glued is None else np.asarray(glued)
        return whole if parted is None else whole[~np.asarray(parted)]

    @property
    def glued_cells(self) -> set[int]:
        """The cells that are bonded to others of their rock."""
        glued = self.blocks.glued
        return set() if glued is None else set(self.blocks.vertex_block[np.asarray(glued).ravel()].tolist())

    def take_orders(self, order: np.ndarray, begun: dda.CrackResponse, state: State | None) -> set[int]:
        """Raise blocks to these ``order`` (n_blocks,); returns which are raised. ``begun``: crack response of before, which
        is kept with room for more components; ``state`` with the new orders, None: the present one, with zero for what is
        new."""
        before = self.system.order_of(self.state)
        self.state = self.system.with_orders(self.state, order) if state is None else state
        self.system.follow(self.state)
        raised, w = set(np.flatnonzero(order > before).tolist()), begun.offset.shape[1]
        for block in raised:
            for known in (self.compliances, self.softness_above):
                known.pop(block, None)
        self.by_mean_stress.forget(raised)
        self.response = dda.CrackResponse.none(len(order), max(w, self._width()))
        self.response.compliance[:, :w, :w], self.response.offset[:, :w] = begun.compliance, begun.offset
        self.quasi_newton, self.extrapolation = QuasiNewton(), LoadExtrapolation()
        self._take_fields()
        return raised

    def _width(self) -> int:
        """Number of components of the strain that cracks give a block: 3, and in blocks of higher order those of
        deflection."""
        deflected = self.system.deflected
        cracked = self.cracks.n_segments or self.problem.growth.initiation
        return 3 if deflected is None or not cracked else 3 + deflected.basis.coupling.shape[2]

    def elastic(self, block: int) -> np.ndarray:
        """(3, 3) or (3 + m, 3 + m) compliance of the rock of a cracked ``block`` (`ByMeanStress.elastic`)."""
        return self.by_mean_stress.elastic(block, self.system.compliance[block])

    def elastic_of(self, blocks: np.ndarray) -> np.ndarray:
        """(n, w, w) of the cracked ``blocks`` (n,), padded with zeros."""
        out = self._padded(self.system.compliance[blocks])
        for k, known in self._fields_among(blocks):
            out[k, : known.width, : known.width] = known.rock
        return out

    def stress_of(self, state: State, blocks: np.ndarray) -> np.ndarray:
        """(n, w) Pa, stress of the cracked ``blocks`` (n,) in ``state``, on current axes: the mean, and that of their
        deflection; padded with zeros."""
        out = self._padded(state.stress[blocks])
        for k, known in self._fields_among(blocks):
            out[k, : known.width] = known.stress_of(state)
        return out

    def crack_strain_of(self, state: State, blocks: np.ndarray) -> np.ndarray:
        """(n, w) as `stress_of`: the strain of their cracks."""
        out = self._padded(state.crack_strain[blocks])
        for k, known in self._fields_among(blocks):
            out[k, : known.width] = known.crack_strain_of(state)
        return out

    def _padded(self, values: np.ndarray) -> np.ndarray:
        """``values`` (n, 3, …) of mean strain with room for deflection."""
        w = self.response.offset.shape[1]
        return values if w == 3 else np.pad(values, [(0, 0)] + [(0, w - 3)] * (values.ndim - 1))

    def _fields_among(self, blocks: np.ndarray) -> list[tuple[int, BlockStressField]]:
        fields = self.by_mean_stress.fields
        return [(k, fields[b]) for k, b in enumerate(blocks.tolist()) if b in fields] if fields else []

    def bodies_of(self, cracks: Cracks, kept: dict) -> tuple[dict, dict[int, np.ndarray]]:
        """Elastic bodies of the present blocks with these ``cracks``, and their nodes (see `elastic_bodies`)."""
        with self.timed("ddm assembly"):
            return elastic_bodies(self.problem, self.blocks, cracks, kept, self.works, self.removed)

    def solve(self, bodies: dict, loads: dict[int, BoundaryLoad], warm: dict) -> dict:
        """Solutions (block →) of ``bodies`` under ``loads``, with the face memory of the start of the step."""
        # In motion most of many bodies are left out in the next steps.
        forgets = not self.system.scheme.static and len(bodies) >= MANY
        with self.timed("ddm solve"):
            return solve_bodies(
                bodies, loads, warm, self.history, self.blocks.names, self.solved_from, self.problem.run.skip, forgets
            )

    def strain_solutions(self) -> dict:
        """block → the solution from which the crack strain of the last pass was taken."""
        own = self.by_mean_stress
        hang = {block: own.solutions[block] for block in self.bodies if block in own and block in own.solutions}
        return {
            block: hang[block] if block in hang else self.solutions[block]
            for block in self.bodies
            if block in hang or block in self.solutions
        }

    # -- changes of the blocks -----------------------------------------------------------------------------------------

    def _take_blocks(self, parent: np.ndarray | None = None) -> None:
        """Set up a block system for new blocks. ``parent`` (n_blocks,): previous number of each; of blocks that have
        not split, all crack data are kept under the new number."""
        problem = self.problem
        self.system = dda.BlockSystem(
            self.blocks, problem.materials, problem.joints, joint_index=problem.joint_index, settings=problem.dda,
            work=self.block_work,
        )  # fmt: skip
        # With cracks they are raised here, after passes (`order_raising`).
        self.system.raises_orders = False
        if self.system.order_choice is not None:
            self.system.follow(self.state)
        self.fields_above, self.softness_above = {}, {}
        n = self.blocks.n_blocks
        self.nodes_of = {}
        response = dda.CrackResponse.none(n, self._width())
        whole, before = np.zeros(0, int), np.zeros(0, int)
        if parent is not None:
            whole, before = np.flatnonzero(np.bincount(parent)[parent] == 1), parent
        if len(whole):
            old = self.response
            w = min(old.offset.shape[1], response.offset.shape[1])
            response.compliance[whole, :w, :w] = old.compliance[before[whole], :w, :w]
            response.offset[whole, :w] = old.offset[before[whole], :w]
        self.response = response
        self.bodies, self.solutions, self.earlier, self.compliances, self.solved_from = (
            {child: known[before[child]] for child in whole.tolist() if before[child] in known}
            for known in (self.bodies, self.solutions, self.earlier, self.compliances, self.solved_from)
        )
        self.by_mean_stress = self.by_mean_stress.inherited(before, whole) if len(whole) else ByMeanStress()
        self.growth_screening.renumber(parent, whole)
        self.quasi_newton, self.extrapolation = QuasiNewton(), LoadExtrapolation()
        self._take_bodies()

    def take_step(self, state: State, budget: dda.EnergyBudget) -> None:
        """Accept ``state``, and the memory of its crack faces, as the start of the next step."""
        self.state, self.budget = state, budget
        # Bodies left out of the step keep the memory of their last solution.
        after = {b: self.solutions[b].memory if b in self.solutions else self.history.get(b) for b in self.bodies}
        self.history = {b: memory for b, memory in after.items() if memory is not None}
        self.by_mean_stress.take_step()

    def take_split(self, split: Split) -> None:
        """Take blocks, state and cracks of the `Split`; gauges and monitors go to the part that contains their
        point."""

        def child(block: int, point: Sequence[float]) -> int:
            parts = np.flatnonzero(split.parent == block).tolist()
            if len(parts) == 1:
                return parts[0]
            inside = [winding_number(split.blocks.loops(p), np.asarray(point, dtype=float)) for p in parts]
            return parts[int(np.argmax(np.abs(inside)))]

        if self.gauge is not None:
            (a, p), (b, q) = self.gauge
            self.gauge = (child(a, p), p), (child(b, q), q)
        self.monitors = {name: (child(b, p), p) for name, (b, p) in self.monitors.items()}
        self.problem = replace(self.problem, loads=on_children(self.problem.loads, split.parent, child))
        if self.removed is not None:
            self.removed = self.removed[split.parent]
        self.history = inherited(self.history, split.parent, split.cracks)
        self.blocks, self.state, self.cracks = split.blocks, split.state, split.cracks
        self.budget = self.budget.cut()
        self.crack_energy.parts(split.parent)
        self._take_blocks(split.parent)

    def set_free(self, budget: dda.EnergyBudget, state: State) -> float:
        """Energy, J/m, that blocks split since the last step stored beyond that of their parts and new contacts, by the
        ``budget`` after a step to ``state``."""
        if not self.budget.is_cut:
            return 0.0
        set_free = self.budget.split - budget.split
        if state.removed is None:
            return set_free
        # Rock that is excavated in the same step takes its energy along; splitting has not released that.
        gone = state.removed if self.state.removed is None else state.removed & ~self.state.removed
        stress = np.where(gone[:, None], self.state.stress, 0.0)
        stored = 0.5 * np.einsum("bi,bij,bj->b", stress, self.system.compliance, stress)
        return set_free - float(self.blocks.areas(self.state.vertices) @ stored)

    def take_out(self) -> list[int]:
        """Remove the elastic bodies of blocks excavated at the present time; returns these blocks."""
        removed = self.system.removed(self.problem.loads, self.state.time)
        if removed is self.removed:
            return []
        before, self.removed = self.removed, removed
        self._take_bodies()
        if removed is None:  # loads that follow the cracks go back to before the excavation
            return []
        return np.flatnonzero(removed if before is None else removed & ~before).tolist()

    def _settle_in_situ(self) -> None:
        """Start from equilibrium under the in-situ stress, which becomes the reference configuration. Cracks are cut
        into the stressed rock: they open and slide from the first step on. Where blocks are unsupported the run starts
        collapsed; raises `dda.NoInSituEquilibrium` where equilibrium is not found for another reason."""
        assert self.problem.in_situ is not None
        with self.timed("dda"):
            try:
                found = dda.in_situ_state(self.system, self.problem.in_situ, self.problem.loads)
            except dda.NoInSituEquilibrium as nothing:
                if nothing.found is None or not nothing.found.collapsed:
                    raise
                self.collapsed, self.state = nothing.found, nothing.found.state
                return
        motion = Motion.of(self.blocks, found.state.vertices)

        def moved(block: int, point: Sequence[float]) -> tuple[float, float]:
            x, y = motion.current(block, np.asarray(point, dtype=float)).tolist()
            return x, y

        # Crack ends on both sides of a joint may share a node; their blocks move it to two different places.
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
            (a, p), (b, q) = self.gauge
            self.gauge = (a, moved(a, p)), (b, moved(b, q))
        self.monitors = {name: (b, moved(b, p)) for name, (b, p) in self.monitors.items()}
        self.blocks, self.state = found.blocks, found.state
        self._take_blocks()
