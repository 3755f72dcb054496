"""Energy balance of cracks: the work of blocks on their cracks is stored around them, dissipated by friction, released
by breaking cement and at growing tips, or released where blocks split.

- DDA gives the work of the mean stress on the crack strain, A σ : dε_c.
- Stored: a body with jumps [u] whose faces carry t, where the same loads would cause t₀ on closed faces, stores
  ½ ∫ (t₀ − t)·[u] more (Clapeyron).
- Released over an increment a of growth: ∫ G da with G = (K_I² + K_II²)/E' (Irwin 1957), from G before it, at the kink,
  and after it, with K linear in between, or along a kink in √s (`mean_release`).

These are computed independently and must add up; the residual is reported. K is taken under the forces that strain the
block: under its mean stress if it responds to that alone (`mean_stress_response`).

The passes of a step follow each other at different loads, from increment to increment, whereas work and friction are
computed on the straight line from the start to the end of the step. The release on both paths is computed from the
loads on the cracks, without K (`release_between`), and with it the integral of G is converted from the passes to the
straight line (`_on_the_line`). (With one factor on G for the whole step, found in its first pass, three of 300 random
slopes missed 3 to 14 % of their energy.)

In statics all forces count, since they open cracks by more than their mean stress does (`crack_opening_work`), also
where faces hold until the forces reach their strength (`Released`). The work beyond A σ : dε_c has its own column,
because the blocks do not account for it. If G exceeds the toughness, the surplus is lost in statics; in dynamics it
stays in the balance.

Cracks that cut through a block in statics do so under forces that are kept until the block splits. G and the work of
the forces then grow without bound as the last ligament breaks, although no such work is done. For a step in which a
block splits, the least possible release is therefore assumed: K_Ic²/E' times the growth of its tips, taken from the
energy that its cracks had stored. A surplus is lost, and a deficit is work of the forces.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from ...model import Blocks, Material, State
from ..crack_compliance.crack_opening_work import (
    Loaded,
    first_work_on_cracks,
    release_between,
    release_of_mean_stress,
    work_on_cracks,
)
from ..growth.energy_release import kink_release, mean_release, straining_tips

if TYPE_CHECKING:
    from ...ddm import Solution
    from ..crack_compliance.block_stress_field import BlockStressField
    from ..crack_compliance.mean_stress_response import ByMeanStress

_Key = tuple[int, int]


def _keys(tips: np.ndarray) -> list[_Key]:
    return list(zip(tips["crack"].tolist(), tips["end"].tolist()))


def _stored_and_lost(before: Solution, after: Solution) -> float:
    """J/m taken up by cracks that have not grown: stored, dissipated by friction and released by cement, without the
    onsets of slip and breaking, which `CrackEnergy.after` adds."""
    frictional, released = after.dissipated_in_step
    stored = after.crack_energy + after.filling_energy - before.crack_energy - before.filling_energy
    return stored + frictional + released.bond - released.slip_onset - released.break_onset


def _add(sums: dict[int, float], block: int, energy: float) -> None:
    sums[block] = sums.get(block, 0.0) + energy


@dataclass(frozen=True)
class _Growing:
    """A tip in ``block`` that grows by ``way``, m, at the angle ``kink``, rad, from G = ``before``; ``cost``: fracture
    energy, J/m²."""

    way: float
    before: float
    block: int
    cost: float
    kink: float


@dataclass(eq=False)
class CrackEnergy:
    """Sums since the beginning of a run, J/m.

    work       of the mean stress of the blocks (at the midpoint of each step) on the strain of their cracks
    uneven     in statics: work of the forces beyond that of their mean stress
    stored     now, around cracks and in their filling
    friction   dissipated between crack faces
    bond       released by breaking cement of crack faces
    fracture   released at growing tips, as far as the blocks supply it: by K of the mean stress in blocks with the
               mean-stress response (`by_mean_stress`); in statics no more than the fracture energy
    runaway    in statics: released at tips beyond the fracture energy; lost
    toughness  K_Ic²/E' times the growth of all tips: the fracture energy. A block of uniform strain stores no bending
               energy and spends none; where bending opens cracks, fracture is less
    parting    released as tips join something and blocks split: the last ligaments, the energy of cracks that are block
               edges now, the energy of blocks minus that of their parts (and new contacts); and where cracks are cut
               into stressed rock
    set_free   by the blocks themselves as they split
    excavated  stored around the cracks of excavated blocks, which take it along
    residual   work + uneven + set_free − stored − friction − bond − fracture − runaway − parting − excavated: the error
               of increments and steps
    """

    static: bool = False
    work: float = 0.0
    uneven: float = 0.0
    stored: float = 0.0
    friction: float = 0.0
    bond: float = 0.0
    fracture: float = 0.0
    runaway: float = 0.0
    toughness: float = 0.0
    parting: float = 0.0
    set_free: float = 0.0
    excavated: float = 0.0
    residual: float = 0.0
    #: block → released in the present step, and the part of it beyond the fracture energy, J/m.
    _released: dict[int, float] = field(default_factory=dict)
    _lost: dict[int, float] = field(default_factory=dict)
    _asked: float = 0.0
    #: State before the blocks came to equilibrium for the present step, and what splitting set free before, not entered
    #: yet.
    _begun: State | None = None
    _set_free_at_rest: float = 0.0
    _parted: bool = False
    #: block → whether it responds to its mean stress alone.
    _by_mean_response: dict[int, bool] = field(default_factory=dict)
    _growing: dict[_Key, _Growing] = field(default_factory=dict)
    #: block → its cracks at the beginning of the present step, and in its last pass.
    _rested: dict[int, Loaded] = field(default_factory=dict)
    _last: dict[int, Loaded] = field(default_factory=dict)
    #: block → since then: release along the passes, from the loads, and fracture energy, J/m.
    _along: dict[int, float] = field(default_factory=dict)
    _taken: dict[int, float] = field(default_factory=dict)

    def begin(self, solutions: dict[int, Solution], by_mean_stress: ByMeanStress) -> None:
        """The run begins with the cracks of ``solutions`` (block → `ddm.Solution`) at rest under load. What opening them
        took belongs to the state from which the sums are counted."""
        self.stored = sum(solution.crack_energy + solution.filling_energy for solution in solutions.values())
        self._by_mean_response = {block: block in by_mean_stress for block in solutions}
        self._rested = {block: Loaded.of(block, of, by_mean_stress) for block, of in solutions.items()}
        self._last = dict(self._rested)

    def passed(
        self,
        tips: np.ndarray,
        blocks: Blocks,
        materials: tuple[Material, ...],
        solutions: dict[int, Solution],
        by_mean_stress: ByMeanStress,
    ) -> None:
        """A pass of the present step has ended with ``tips``, of which some may be about to grow. ``solutions``: block
        → the `ddm.Solution` that gives its crack strain; ``by_mean_stress``: blocks that respond to their mean stress
        alone."""
        self._follow(solutions, by_mean_stress)
        if not len(tips):
            self._parted |= bool(self._growing)
            self._growing = {}
            return
        if not (self._growing or (tips["grown"] > 0).any()):
            return
        grow = {of.block for of in self._growing.values()} | set(tips["block"][tips["grown"] > 0].tolist())
        strained = {block: of for block, of in solutions.items() if block in grow and block in by_mean_stress}
        tips = straining_tips(tips, strained)
        rock = blocks.material[tips["block"]]
        modulus = np.array([m.plane_modulus for m in materials])[rock]
        keys = _keys(tips)
        release = (tips["k_i"] ** 2 + tips["k_ii"] ** 2) / modulus
        now = dict(zip(keys, release.tolist()))
        for key, of in self._growing.items():
            taken = of.way * of.cost
            _add(self._taken, of.block, taken)
            if key in now:
                released = of.way * mean_release(of.before, now[key], of.kink)
                _add(self._released, of.block, released)
                _add(self._lost, of.block, max(0.0, released - taken) if self.static else 0.0)
            else:
                # A tip has joined something: G is unbounded as the last ligament breaks, and no quadrature rule
                # applies.
                self._parted = True
        by_mean_response = np.array([block in by_mean_stress for block in tips["block"].tolist()])
        turned = np.where(by_mean_response, kink_release(tips), tips["k_eq"] ** 2) / modulus
        grows = np.flatnonzero(tips["grown"] > 0)
        cost = np.array([m.k_ic for m in materials])[rock] ** 2 / modulus
        self._growing = {
            keys[row]: _Growing(
                float(tips["grown"][row]),
                float(turned[row]),
                int(tips["block"][row]),
                float(cost[row]),
                float(tips["angle"][row]),
            )
            for row in grows.tolist()
        }
        self._asked += float(tips["grown"][grows] @ cost[grows])

    def _follow(self, solutions: dict[int, Solution], by_mean_stress: ByMeanStress) -> None:
        """Add the energy that cracks have released since the last pass, computed from the loads on them."""
        for block, of in solutions.items():
            now, last = Loaded.of(block, of, by_mean_stress), self._last.get(block)
            if last is not None and now.responds_as(last) and not now.same_geometry(last):
                _add(self._along, block, release_between(last, now))
            self._last[block] = now

    def joined(self) -> None:
        """A tip has been joined to something in the present step, by which its cracks released what is not known."""
        self._parted = True

    def parts(self, parent: np.ndarray) -> None:
        """Blocks split in the present step; ``parent`` (n_blocks,): number of each block before."""
        self._parted = True
        self._by_mean_response = {}
        whole = np.bincount(parent)[parent] == 1
        now = {int(parent[child]): child for child in np.flatnonzero(whole).tolist()}
        if self.static:
            for block in [block for block in self._rested if block not in now]:
                self._runs_through(block)
        self._rested, self._last = (
            {now[block]: of for block, of in each.items() if block in now} for each in (self._rested, self._last)
        )
        self._along = {now[block]: energy for block, energy in self._along.items() if block in now}
        if not self.static:
            return
        self._taken, self._released, self._lost = (
            {now[block]: energy for block, energy in sums.items() if block in now}
            for sums in (self._taken, self._released, self._lost)
        )
        self._growing = {key: replace(of, block=now[of.block]) for key, of in self._growing.items() if of.block in now}

    def at_start(self, block: int) -> Solution | None:
        """The solution of the cracks of ``block`` at the beginning of the present step, if it had any."""
        rested = self._rested.get(block)
        return None if rested is None else rested.solution

    def raised(self, block: int, below: BlockStressField | None, field: BlockStressField) -> None:
        """The order of ``block`` has been raised: it responds to the components of ``field`` from now on, and did
        to those of ``below`` (None: to its mean stress)."""
        for known in (self._rested, self._last):
            loaded = known.get(block)
            if loaded is not None and loaded.mean is not None:
                stress, _ = loaded.mean
                of = loaded.solution
                known[block] = Loaded(
                    of, (field.widened(stress, below), np.eye(field.width)), field.crack_strain(of.body, of.jumps)
                )

    def take_out(self, blocks: Collection[int]) -> None:
        """The ``blocks`` are excavated at the end of the last step: they take along what their cracks store. Their tips no
        longer grow."""
        for block in blocks:
            for sums in (self._released, self._lost, self._taken, self._along, self._last, self._by_mean_response):
                sums.pop(block, None)
            rested = self._rested.pop(block, None)
            if rested is not None:
                gone = rested.solution.crack_energy + rested.solution.filling_energy
                self.stored -= gone
                self.excavated += gone
        self._growing = {key: of for key, of in self._growing.items() if of.block not in blocks}

    def _runs_through(self, block: int, frictional: float = 0.0, bond: float = 0.0) -> None:
        """In statics ``block`` is cut by tips that have grown in the present step or are about to grow. Since the start
        of the step, ``frictional`` J/m were dissipated by friction in it and ``bond`` released by cement. Its release has
        not been entered yet."""
        own = [key for key, of in self._growing.items() if of.block == block]
        taken = self._taken.pop(block, 0.0) + sum(of.way * of.cost for of in map(self._growing.pop, own))
        for sums in (self._released, self._lost, self._along):
            sums.pop(block, None)
        rested = self._rested.pop(block, None)
        stored = 0.0 if rested is None else rested.solution.crack_energy + rested.solution.filling_energy
        self.stored -= stored
        self.friction += frictional
        self.bond += bond
        self.fracture += taken
        spent = taken + frictional + bond
        self.uneven += max(0.0, spent - stored)
        self.runaway += max(0.0, stored - spent)

    def worked_on(self, begun: State, work: float, set_free: float) -> None:
        """Blocks have come from the state ``begun`` to equilibrium, by which they did ``work`` J/m on their cracks, and
        had ``set_free`` some energy by splitting before. The step that follows finds the state of the cracks."""
        self.work += work
        self.uneven -= work
        self._begun, self._set_free_at_rest = begun, set_free

    @property
    def under_way(self) -> bool:
        """Whether the balance has entries, even if there are no cracks any more."""
        return self.work != 0.0 or self.stored != 0.0

    def after(
        self,
        before: State,
        state: State,
        blocks: Blocks,
        solutions: dict[int, Solution],
        by_mean_stress: ByMeanStress,
        set_free: float = 0.0,
        cut: Collection[int] = (),
    ) -> None:
        """The step from ``before`` to ``state`` has been accepted. ``solutions`` (block → `ddm.Solution`) give the
        crack strains at its end; ``by_mean_stress``: blocks that respond to their mean stress alone. Blocks that have
        split since the last step stored ``set_free`` J/m more than their parts and new contacts; those in ``cut`` split
        now."""
        each = self._by_mean_stress_work(before, state, blocks, by_mean_stress)
        work = float(each.sum())
        if self._begun is not None:
            # The cracks go all the way in this step.
            before, self._begun = self._begun, None
            each = self._by_mean_stress_work(before, state, blocks, by_mean_stress)
            set_free, self._set_free_at_rest = set_free + self._set_free_at_rest, 0.0
        if self.static:
            gone = {block: solutions[block] for block in cut if block in solutions}
            solutions = {block: of for block, of in solutions.items() if block not in gone}
            for block, of in gone.items():
                frictional, of_cement = of.dissipated_in_step
                self._runs_through(block, frictional, of_cement.bond)
                each[block] = 0.0
        by_mean_response = {block: block in by_mean_stress for block in solutions}
        done = sum(self._work_at_rest(before, solutions, by_mean_response, each)) if self.static else work
        stored = sum(solution.crack_energy + solution.filling_energy for solution in solutions.values())
        frictional, released_there = (
            zip(*(of.dissipated_in_step for of in solutions.values())) if solutions else ((), ())
        )
        friction, bond = sum(frictional), sum(of.bond for of in released_there)
        if self.static:
            done += sum(of.slip_onset + of.break_onset for of in released_there)
        else:
            # Moving blocks have already spent this on their cracks.
            bond -= sum(of.break_onset for of in released_there)
        # A block that starts to respond to its mean stress as its cracks grow, or has been split, stored energy in
        # another way.
        self._parted |= any(
            by_mean_response.get(block) != was
            for block, was in self._by_mean_response.items()
            if block not in cut and not self._still(block, solutions)
        )
        # Cracks cut into stressed rock open against less than the stress they replace: the difference is released.
        new = [block for block, of in solutions.items() if block not in self._by_mean_response and of.jumps.size]
        self._parted |= bool(np.any(before.stress[new]))
        self._by_mean_response = by_mean_response
        self._on_the_line(before, by_mean_response)
        released, lost = sum(self._released.values()), sum(self._lost.values())
        rest = done + set_free - (stored - self.stored) - friction - bond - released
        self.work += work
        self.uneven += done - work
        self.set_free += set_free
        self.fracture += released - lost
        self.runaway += lost
        self.toughness += self._asked
        if self._parted:
            self.parting += rest
        else:
            self.residual += rest
        self.stored, self.friction, self.bond = stored, self.friction + friction, self.bond + bond
        self._released, self._lost, self._taken = {}, {}, {}
        self._asked, self._parted = 0.0, False
        # The present growth takes place at the beginning of the next step.
        self._rested = {block: Loaded.of(block, of, by_mean_stress) for block, of in solutions.items()}
        self._last, self._along = dict(self._rested), {}

    def _on_the_line(self, before: State, by_mean_response: dict[int, bool]) -> None:
        """Convert the release of the present step, integrated over G from pass to pass, to the straight line from the
        start of the step, ``before``, to its end.

        From the loads, the passes release ``along`` J/m and the straight line ``straight`` J/m. The difference between
        K and the loads, ∫ G da − ``along``, remains as the error of the increments: reduced in proportion if the line
        releases less, as under a load that starts from zero, and unchanged if it releases more. Blocks of limited
        softness (`ByMeanStress.limit`) release the energy between their loading lines, since K under limited stress
        drives no growth.
        """
        for block, along in self._along.items():
            began, now = self._rested.get(block), self._last[block]
            if began is None:
                straight = shown = along if before.stress[block].any() else 0.0
            elif not began.responds_as(now):
                continue
            elif by_mean_response.get(block, False):
                straight, shown = release_between(began, now), release_of_mean_stress(began, now)
            else:
                straight = shown = release_between(began, now)
            share = min(1.0, max(0.0, straight / along)) if along > 0.0 else 1.0
            if now.limited:
                share = 0.0
            released = shown + share * (self._released.get(block, 0.0) - along)
            self._released[block] = released
            self._lost[block] = max(0.0, released - self._taken.get(block, 0.0)) if self.static else 0.0

    @staticmethod
    def _by_mean_stress_work(before: State, state: State, blocks: Blocks, by_mean_stress: ByMeanStress) -> np.ndarray:
        """(n_blocks,) J/m, work of the mean stress between two states on the cracks of each block."""
        strain = state.crack_strain - before.crack_strain
        mean = 0.5 * (before.stress + state.stress)
        each = blocks.areas(before.vertices) * np.sum(mean * strain, axis=1)
        for block, known in by_mean_stress.fields.items():
            each[block] += known.work_on_cracks(before, state)
        if state.removed is not None:
            each[state.removed] = 0.0
        return each

    def _still(self, block: int, solutions: dict[int, Solution]) -> bool:
        """Whether, in statics, no crack of the ``block`` has grown in the present step."""
        began, of = self._rested.get(block), solutions.get(block)
        if not self.static or began is None or of is None:
            return False
        return of.body.crack_system is began.solution.body.crack_system

    def _work_at_rest(
        self, before: State, solutions: dict[int, Solution], by_mean_response: dict[int, bool], by_mean: np.ndarray
    ) -> Iterator[float]:
        """J/m that static forces have done in opening cracks, block by block. ``by_mean`` (n_blocks,): work of the mean
        stress, which is all of it where a block ``by_mean_response`` and where no forces act on its cracks."""
        for block, of in solutions.items():
            began = self._rested.get(block)
            was, now = self._by_mean_response.get(block, False), by_mean_response[block]
            if began is not None and self._still(block, solutions) and not (was and now):
                # The loads do what cracks store and lose, also where faces close or open on the way: these move under no
                # traction, whereas the mean of both loads has half of that of the closed faces. From the step on in
                # which a block responds to its mean stress alone, the uneven work is that of this stress.
                yield _stored_and_lost(began.solution, of)
            elif was or now:
                yield float(by_mean[block])
            elif began is None:
                yield first_work_on_cracks(before.stress[block], float(before.rotation[block]), of)
            else:
                yield work_on_cracks(began.solution, of)
        yield float(sum(by_mean[block] for block in range(len(by_mean)) if block not in solutions))

    def statistics(self) -> dict[str, float]:
        """Columns of a history, J/m."""
        at_rest = {"uneven_work": self.uneven, "runaway_loss": self.runaway} if self.static else {}
        return {
            "crack_elastic": self.stored,
            "crack_friction": self.friction,
            "crack_bond_loss": self.bond,
            "fracture_energy": self.fracture,
            "toughness_energy": self.toughness,
            "parting_energy": self.parting,
            "set_free_energy": self.set_free,
            "excavated_crack_energy": self.excavated,
            **at_rest,
            "crack_residual": self.residual,
        }
