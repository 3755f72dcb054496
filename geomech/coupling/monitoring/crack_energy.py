"""Where the energy goes that blocks spend on their cracks: it is stored around them, rubbed off between their faces,
released by cement that breaks and at tips as they grow, and set free where blocks part.

The block solver knows the work of its mean stress on the strain of its cracks, A σ : dε_c. By Clapeyron's theorem a
body with jumps [u] whose faces bear t where the same loads would bring t₀ without them stores ½ ∫ (t₀ − t)·[u] more;
what a tip releases over an increment is ∫ G da, G = (K_I² + K_II²)/E' (Irwin 1957), by the trapezoidal rule of G
before, of K_eq, for the way it turns, and after (where it falls, as an exponential does), each K once at the load of the
step's end and once at that of its begin. So four quantities found apart from each other have to add up; what is left
over is told. K is that of the forces whose strain the blocks feel: where that is their mean stress alone
(`by_mean_stress`), that stress brings it; where they are taken for no softer than so much and answer in proportion, what
they release is what lies between the lines on which they are loaded.

At rest forces have to be passed on as they are spread, and open cracks by more than their mean stress does. There the
work of all of them counts (`work_on_cracks`), also where faces hold until these have come to their strength (`Released`);
what it is beyond A σ : dε_c has a column of its own, for the blocks have not counted it. Where G is above what rock takes, at rest the surplus is lost (in motion it moves the rock).

Cracks that run through at rest do so under forces that are held up until the block parts: G and the work of the forces
grow without bound as the last ligament goes, though no such work is ever done. So what is counted of a step in which a
block parts is what it must have spent: K_Ic²/E' for the way of its tips, from what its cracks had stored; what there is
more of that is lost, what is missing the forces have done.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from ...model import Blocks, Material, State
from ..crack_compliance.crack_opening_work import first_work_on_cracks, work_on_cracks
from ..growth.energy_release import FeltTips, Loaded, kink_release, mean_release

if TYPE_CHECKING:
    from ...ddm import Solution
    from ..crack_compliance.mean_stress_response import ByMeanStress

_Key = tuple[int, int]


def _keys(tips: np.ndarray) -> list[_Key]:
    return list(zip(tips["crack"].tolist(), tips["end"].tolist()))


def _add(sums: dict[int, float], block: int, energy: float) -> None:
    sums[block] = sums.get(block, 0.0) + energy


@dataclass(frozen=True)
class _Growing:
    """A tip in ``block`` that grows by ``way``, m; what it released before, and what rock takes (``cost``), J/m²; what
    part there was of what it releases after, over the step."""

    way: float
    before: float
    block: int
    cost: float
    share: float = 1.0


@dataclass(eq=False)
class CrackEnergy:
    """Sums since the beginning of a run, J/m.

    work       of the blocks' mean stress (that of the middle of each step) on the strain of their cracks
    uneven     at rest: of the forces on them, beyond that of their mean stress
    stored     around cracks and in what fills them, now
    friction   rubbed off between crack faces
    bond       released by the cement of their faces as it breaks
    fracture   released at tips that grew, of what the blocks spend: of those that feel no more than their mean stress
               (`by_mean_stress`) by the K of that stress; at rest no more than rock takes
    runaway    released there at rest beyond what rock takes: lost
    toughness  K_Ic²/E' times the way of all tips: what rock takes as it breaks. Of the bending that breaks it a block
               of one strain stores nothing, and spends nothing: there fracture is less
    parting    released as tips met something and blocks parted: the last ligaments, what the cracks stored that are
               walls now, and what the blocks stored less their parts (and the contacts between them); and where cracks are cut into
               stressed rock
    set_free   by the blocks themselves as they parted
    residual   work + uneven + set_free − stored − friction − bond − fracture − runaway − parting: of increments and
               steps
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
    residual: float = 0.0
    #: block → released in the present step, and of it beyond what rock takes, J/m.
    _released: dict[int, float] = field(default_factory=dict)
    _lost: dict[int, float] = field(default_factory=dict)
    _asked: float = 0.0
    _parted: bool = False
    #: block → whether it feels its mean stress only.
    _hangs: dict[int, bool] = field(default_factory=dict)
    _growing: dict[_Key, _Growing] = field(default_factory=dict)
    #: block with tips that grow → its mean stress, Pa, its limit, the strain of its cracks then, and the share as of a
    #: tip.
    _limited: dict[int, tuple[np.ndarray, np.ndarray, np.ndarray, float]] = field(default_factory=dict)
    #: Blocks taken for no softer than so much (`ByMeanStress.limit`) in which tips have grown in the present step.
    _grown: set[int] = field(default_factory=set)
    #: block that feels its mean stress → how it was loaded as the present step began.
    _hung: dict[int, Loaded] = field(default_factory=dict)
    #: At rest: block → its solution as the present step began, and what rock has taken in it since then, J/m.
    _rested: dict[int, Solution] = field(default_factory=dict)
    _taken: dict[int, float] = field(default_factory=dict)
    #: Tips with K as it is felt, as the present step began, in its first pass and in its last one.
    _began: FeltTips | None = None
    _first: FeltTips | None = None
    _last: FeltTips | None = None
    #: … and the crack strains of blocks that feel their mean stress.
    _strain_began: dict[int, np.ndarray] = field(default_factory=dict)
    _strain_first: dict[int, np.ndarray] = field(default_factory=dict)
    _strain_last: dict[int, np.ndarray] = field(default_factory=dict)

    def passed(
        self,
        tips: np.ndarray,
        blocks: Blocks,
        materials: tuple[Material, ...],
        solutions: dict[int, Solution],
        by_mean_stress: ByMeanStress,
        stressed: bool = True,
    ) -> None:
        """A pass of the present step, which blocks began ``stressed`` or not, has ended with ``tips``, of which some are
        about to grow, or none; ``solutions`` is block → the `ddm.Solution` that it is strained by, those ``by_mean_stress``
        by no more than their mean stress."""
        hang = {block: of for block, of in solutions.items() if block in by_mean_stress}
        self._strain_last = {block: of.crack_strain for block, of in hang.items()}
        self._last = FeltTips(tips, hang)
        if self._first is None:
            self._first, self._strain_first = self._last, self._strain_last
        if not len(tips):
            self._parted |= bool(self._growing)
            self._growing, self._limited = {}, {}
            return
        if not (self._growing or (tips["grown"] > 0).any()):
            return
        tips = self._last.rows
        rock = blocks.material[tips["block"]]
        modulus = np.array([m.plane_modulus for m in materials])[rock]
        hangs = np.array([block in by_mean_stress for block in tips["block"].tolist()])
        keys = _keys(tips)
        release = (tips["k_i"] ** 2 + tips["k_ii"] ** 2) / modulus
        now = dict(zip(keys, release.tolist()))
        for key, of in self._growing.items():
            taken = of.way * of.cost
            _add(self._taken, of.block, taken)
            if of.block in by_mean_stress and by_mean_stress.limits(of.block):
                self._grown.add(of.block)
            if key in now:
                released = of.way * of.share * mean_release(of.before, now[key])
                _add(self._released, of.block, released)
                _add(self._lost, of.block, max(0.0, released - taken) if self.static else 0.0)
            else:
                # A tip that has met something: G rises without bound as the last ligament goes, its integral by no
                # rule.
                self._parted = True
        for block, (stress, limit, strain, share) in self._limited.items():
            # What is taken for no softer than so much (`ByMeanStress.limit`) spends less on growth as its limit falls.
            if block in solutions:
                now_stress, now_limit = by_mean_stress.stress[block]
                less, known = now_limit - limit, solutions[block]
                both = float(strain @ less @ stress + known.crack_strain @ less @ now_stress)
                _add(self._released, block, 0.5 * known.body.area * share * both)
        turned = np.where(hangs, kink_release(tips), tips["k_eq"] ** 2) / modulus
        shares = self._shares(stressed)
        grows = np.flatnonzero(tips["grown"] > 0)
        cost = np.array([m.k_ic for m in materials])[rock] ** 2 / modulus
        self._growing = {
            keys[row]: _Growing(
                float(tips["grown"][row]),
                float(turned[row]),
                int(tips["block"][row]),
                float(cost[row]),
                shares.get(keys[row], 1.0),
            )
            for row in grows.tolist()
        }
        self._limited = {
            block: (*by_mean_stress.stress[block], solutions[block].crack_strain, self._share_of(block, stressed))
            for block in np.unique(tips["block"][grows]).tolist()
            if block in by_mean_stress
        }
        self._asked += float(tips["grown"][grows] @ cost[grows])

    def _shares(self, stressed: bool) -> dict[_Key, float]:
        """What part of a tip's G there is over the present step, in which its load has changed: K·K₀/K² with K₀ as the
        step began, 0 where it has turned about. Passes grow tips by the load of the step's end, but they grow all the
        time; forces that rise by a part of themselves would release that part too much."""
        if self._began is None and self._first is not None and not stressed:
            return dict.fromkeys(_keys(self._first.rows), 0.0)
        if self._began is None or self._first is None:
            return {}
        began, first = self._began.rows, self._first.rows
        before = {key: (row["k_i"], row["k_ii"]) for key, row in zip(_keys(began), began)}
        shares = {}
        for key, row in zip(_keys(first), first):
            size = row["k_i"] ** 2 + row["k_ii"] ** 2
            if key in before and size > 0:
                k_i, k_ii = before[key]
                shares[key] = max(0.0, float((k_i * row["k_i"] + k_ii * row["k_ii"]) / size))
        return shares

    def _share_of(self, block: int, stressed: bool) -> float:
        """The same of what goes with the square of the ``block``'s load, from the strain of its cracks."""
        if self._began is None and not stressed:
            return 0.0
        before, first = self._strain_began.get(block), self._strain_first.get(block)
        if before is None or first is None or not first.any():
            return 1.0
        return max(0.0, float(before @ first) / float(first @ first))

    def parts(self, parent: np.ndarray) -> None:
        """Blocks part in the present step; from then on they are those of which ``parent`` (n_blocks,) were whole."""
        self._parted = True
        self._hangs, self._limited, self._strain_last = {}, {}, {}
        whole = np.bincount(parent)[parent] == 1
        now = {int(parent[child]): child for child in np.flatnonzero(whole).tolist()}
        self._grown = {now[block] for block in self._grown if block in now}
        self._hung = {now[block]: of for block, of in self._hung.items() if block in now}
        if not self.static:
            return
        for block in [block for block in self._rested if block not in now]:
            self._runs_through(block)
        self._rested = {now[block]: of for block, of in self._rested.items()}
        self._taken, self._released, self._lost = (
            {now[block]: energy for block, energy in sums.items() if block in now}
            for sums in (self._taken, self._released, self._lost)
        )
        self._growing = {key: replace(of, block=now[of.block]) for key, of in self._growing.items() if of.block in now}

    def _runs_through(self, block: int, rubbed: float = 0.0, bond: float = 0.0) -> None:
        """At rest ``block`` is cut by tips that have grown in the present step or are about to; ``rubbed`` J/m
        have been rubbed off in it and ``bond`` released by cement since the step began. What was released in it until then was
        not paid for."""
        own = [key for key, of in self._growing.items() if of.block == block]
        taken = self._taken.pop(block, 0.0) + sum(of.way * of.cost for of in map(self._growing.pop, own))
        for sums in (self._released, self._lost):
            sums.pop(block, None)
        rested = self._rested.pop(block, None)
        stored = 0.0 if rested is None else rested.crack_energy + rested.filling_energy
        self.stored -= stored
        self.friction += rubbed
        self.bond += bond
        self.fracture += taken
        spent = taken + rubbed + bond
        self.uneven += max(0.0, spent - stored)
        self.runaway += max(0.0, stored - spent)

    @property
    def grows(self) -> bool:
        """Whether tips have grown of which the release is still to be counted."""
        return bool(self._growing)

    @property
    def under_way(self) -> bool:
        """Whether there is something to go on with, also where no crack is left."""
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
        """The step from ``before`` to ``state`` has been taken; ``solutions`` at its end is block → the `ddm.Solution` that
        it is strained by; ``by_mean_stress`` are those that feel no more than their mean stress. Blocks that have
        parted since the last step stored ``set_free`` J/m more before than their parts and new contacts did; those that
        are ``cut`` part here, by what now grows."""
        strain = state.crack_strain - before.crack_strain
        mean = 0.5 * (before.stress + state.stress)
        each = blocks.areas(before.vertices) * np.sum(mean * strain, axis=1)
        work = float(each.sum())
        if self.static:
            gone = {block: solutions[block] for block in cut if block in solutions}
            solutions = {block: of for block, of in solutions.items() if block not in gone}
            for block, of in gone.items():
                rubbed, of_cement = of.given_way
                self._runs_through(block, rubbed, of_cement.bond)
                each[block] = 0.0
        hangs = {block: block in by_mean_stress for block in solutions}
        done = sum(self._work_at_rest(before, solutions, hangs, each)) if self.static else work
        stored = sum(solution.crack_energy + solution.filling_energy for solution in solutions.values())
        rubbed, released_there = zip(*(of.given_way for of in solutions.values())) if solutions else ((), ())
        friction, bond = sum(rubbed), sum(of.bond for of in released_there)
        if self.static:
            done += sum(of.slip_onset + of.break_onset for of in released_there)
        else:
            # Blocks in motion have spent on their cracks what they have.
            bond -= sum(of.break_onset for of in released_there)
        # What a block stored that begins to hang, or is whole no more, was of another kind.
        self._parted |= any(hangs.get(block) != hung for block, hung in self._hangs.items() if block not in cut)
        # Cracks that are cut into stressed rock open against less than bears them: what is left over is set free.
        new = [block for block, of in solutions.items() if block not in self._hangs and of.jumps.size]
        self._parted |= bool(np.any(before.stress[new]))
        self._hangs = hangs
        self._release_of_limited(solutions, by_mean_stress)
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
        self._began, self._first, self._strain_began = self._last, None, self._strain_last
        # What grows now does so as the next step begins.
        self._growing = {key: replace(of, share=1.0) for key, of in self._growing.items()}
        self._limited = {block: (*of[:3], 1.0) for block, of in self._limited.items()}
        self._grown = set()
        self._hung = {block: Loaded.of(block, of, by_mean_stress) for block, of in solutions.items() if hangs[block]}
        self._rested = dict(solutions) if self.static else {}

    def _release_of_limited(self, solutions: dict[int, Solution], by_mean_stress: ByMeanStress) -> None:
        """What is taken for no softer than so much releases, where it answers in proportion to its load, what lies between
        the lines on which it is loaded before and after, ½ A (σ₀·ε₁ − σ₁·ε₀), from where the present step began: K falls
        by much in an increment, and the limit with it."""
        for block in self._grown:
            if block not in solutions or block not in by_mean_stress:
                continue
            now = Loaded.of(block, solutions[block], by_mean_stress)
            before = self._hung.get(block, Loaded(np.zeros(3), np.zeros(3), True))
            if now.in_proportion and before.in_proportion:
                between = float(before.stress @ now.strain - now.stress @ before.strain)
                self._released[block] = released = 0.5 * solutions[block].body.area * between
                self._lost[block] = max(0.0, released - self._taken.get(block, 0.0)) if self.static else 0.0

    def _work_at_rest(
        self, before: State, solutions: dict[int, Solution], hangs: dict[int, bool], by_mean: np.ndarray
    ) -> Iterator[float]:
        """J/m that forces at rest have done in opening the cracks, block by block; ``by_mean`` (n_blocks,) that of the
        mean stress, which is all of it where a block ``hangs`` and where there are no forces on cracks."""
        for block, of in solutions.items():
            began = self._rested.get(block)
            if hangs[block] or self._hangs.get(block, False):
                yield float(by_mean[block])
            elif began is not None:
                yield work_on_cracks(began, of)
            else:
                yield first_work_on_cracks(before.stress[block], float(before.rotation[block]), of)
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
            **at_rest,
            "crack_residual": self.residual,
        }
