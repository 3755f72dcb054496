"""Where the energy goes that blocks spend on their cracks: it is stored around them, rubbed off between their faces,
released at their tips as they grow, and set free where blocks part.

The block solver knows the work of its mean stress on the strain of its cracks, A σ : dε_c. By Clapeyron's theorem a
body with jumps [u] whose faces bear t where the same loads would bring t₀ without them stores ½ ∫ (t₀ − t)·[u] more;
what a tip releases over an increment is ∫ G da, G = (K_I² + K_II²)/E' (Irwin 1957), by the trapezoidal rule of G
before, of K_eq, for the way it turns, and after, each K once at the load of the step's end and once at that of its
begin. So four quantities found apart from each other have to add up; what is left over is told. K is that of the forces
whose strain the blocks feel: where that is their mean stress alone (`by_mean_stress`), that stress brings it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from ..model import Blocks, Material, State

if TYPE_CHECKING:
    from ..ddm import Solution
    from .by_mean_stress import ByMeanStress

_Key = tuple[int, int]

#: rad; the series of kinks is good for no larger ones.
_LARGEST_KINK = 2.2


def _keys(tips: np.ndarray) -> list[_Key]:
    return list(zip(tips["crack"].tolist(), tips["end"].tolist()))


def _felt_tips(tips: np.ndarray, felt: dict[int, Solution], by_mean_stress: ByMeanStress) -> np.ndarray:
    """``tips`` with the K that the mean stress brings in blocks that feel no more."""
    blocks = [block for block in np.unique(tips["block"]).tolist() if block in by_mean_stress]
    if not blocks:
        return tips
    out = tips.copy()
    for block in blocks:
        own = tips["block"] == block
        for name in ("k_i", "k_ii"):
            out[name][own] = felt[block].tips[name]
    return out


def _kink_release(tips: np.ndarray) -> np.ndarray:
    """(n,) k₁² + k₂² at the tips of kinks of no length by the growth angles of ``tips`` (Amestoy & Leblond 1992), of
    those that close k₂² alone."""
    from ..ddm.criteria import kink_factors

    angle = np.clip(tips["angle"], -_LARGEST_KINK, _LARGEST_KINK)
    k = (kink_factors(angle) @ np.stack([tips["k_i"], tips["k_ii"]], axis=-1)[..., None])[..., 0]
    return np.maximum(k[:, 0], 0.0) ** 2 + k[:, 1] ** 2


@dataclass(frozen=True)
class _Growing:
    """A tip that grows by ``way``, m; what it released before, J/m², and what part there was of what it releases after,
    over the step."""

    way: float
    before: float
    share: float = 1.0


@dataclass(eq=False)
class CrackEnergy:
    """Sums since the beginning of a run, J/m.

    work       of the blocks' mean stress (that of the middle of each step) on the strain of their cracks
    stored     around cracks, now
    friction   rubbed off between crack faces
    fracture   released at tips that grew, of what the blocks spend: of those that feel no more than their mean stress
               (`by_mean_stress`) by the K of that stress
    toughness  K_Ic²/E' times the way of all tips: what rock takes as it breaks. Of the bending that breaks it a block
               of one strain stores nothing, and spends nothing: there fracture is less
    parting    released as tips met something and blocks parted: the last ligaments, what the cracks stored that are
               walls now, and what the blocks stored less their parts (and the contacts between them)
    set_free   by the blocks themselves as they parted
    residual   work + set_free − stored − friction − fracture − parting: of increments and steps
    """

    work: float = 0.0
    stored: float = 0.0
    friction: float = 0.0
    fracture: float = 0.0
    toughness: float = 0.0
    parting: float = 0.0
    set_free: float = 0.0
    residual: float = 0.0
    _released: float = 0.0
    _asked: float = 0.0
    _parted: bool = False
    #: block → whether it feels its mean stress only.
    _hangs: dict[int, bool] = field(default_factory=dict)
    _growing: dict[_Key, _Growing] = field(default_factory=dict)
    #: block with tips that grow → its mean stress, Pa, its limit, the strain of its cracks then, and the share as of a
    #: tip.
    _limited: dict[int, tuple[np.ndarray, np.ndarray, np.ndarray, float]] = field(default_factory=dict)
    #: Tips with K as it is felt, as the present step began, in its first pass and in its last one.
    _began: np.ndarray | None = None
    _first: np.ndarray | None = None
    _last: np.ndarray | None = None
    #: … and the crack strains of blocks that feel their mean stress.
    _strain_began: dict[int, np.ndarray] = field(default_factory=dict)
    _strain_first: dict[int, np.ndarray] = field(default_factory=dict)
    _strain_last: dict[int, np.ndarray] = field(default_factory=dict)

    def passed(
        self,
        tips: np.ndarray,
        blocks: Blocks,
        materials: tuple[Material, ...],
        felt: dict[int, Solution],
        by_mean_stress: ByMeanStress,
    ) -> None:
        """A pass of the present step has ended with ``tips``, of which some are about to grow, or none; ``felt`` is
        block → the `ddm.Solution` that it is strained by, those ``by_mean_stress`` by no more than their mean
        stress."""
        tips = _felt_tips(tips, felt, by_mean_stress)
        self._strain_last = {block: of.crack_strain for block, of in felt.items() if block in by_mean_stress}
        if self._first is None:
            self._first, self._strain_first = tips, self._strain_last
        self._last = tips
        if not len(tips):
            self._parted |= bool(self._growing)
            self._growing, self._limited = {}, {}
            return
        if not (self._growing or (tips["grown"] > 0).any()):
            return
        rock = blocks.material[tips["block"]]
        modulus = np.array([m.plane_modulus for m in materials])[rock]
        hangs = np.array([block in by_mean_stress for block in tips["block"].tolist()])
        keys = _keys(tips)
        release = (tips["k_i"] ** 2 + tips["k_ii"] ** 2) / modulus
        now = dict(zip(keys, release.tolist()))
        for key, of in self._growing.items():
            if key in now:
                self._released += 0.5 * of.way * of.share * (of.before + now[key])
            else:
                # A tip that has met something: G rises without bound as the last ligament goes, its integral by no
                # rule.
                self._parted = True
        for block, (stress, limit, strain, share) in self._limited.items():
            # What is taken for no softer than so much (`ByMeanStress.limit`) spends less on growth as its limit falls.
            if block in felt:
                now_stress, now_limit = by_mean_stress.stress[block]
                less, known = now_limit - limit, felt[block]
                both = float(strain @ less @ stress + known.crack_strain @ less @ now_stress)
                self._released += 0.5 * known.body.area * share * both
        turned = np.where(hangs, _kink_release(tips), tips["k_eq"] ** 2) / modulus
        shares = self._shares()
        grows = np.flatnonzero(tips["grown"] > 0)
        self._growing = {
            keys[row]: _Growing(float(tips["grown"][row]), float(turned[row]), shares.get(keys[row], 1.0))
            for row in grows.tolist()
        }
        self._limited = {
            block: (*by_mean_stress.stress[block], felt[block].crack_strain, self._share_of(block))
            for block in np.unique(tips["block"][grows]).tolist()
            if block in by_mean_stress
        }
        toughness = np.array([m.k_ic for m in materials])[rock]
        self._asked += float(tips["grown"][grows] @ (toughness[grows] ** 2 / modulus[grows]))

    def _shares(self) -> dict[_Key, float]:
        """What part of a tip's G there is over the present step, in which its load has changed: K·K₀/K² with K₀ as the
        step began, 0 where it has turned about. Passes grow tips by the load of the step's end, but they grow all the
        time; forces that rise by a part of themselves would release that part too much."""
        if self._began is None or self._first is None:
            return {}
        before = {key: (row["k_i"], row["k_ii"]) for key, row in zip(_keys(self._began), self._began)}
        shares = {}
        for key, row in zip(_keys(self._first), self._first):
            size = row["k_i"] ** 2 + row["k_ii"] ** 2
            if key in before and size > 0:
                k_i, k_ii = before[key]
                shares[key] = max(0.0, float((k_i * row["k_i"] + k_ii * row["k_ii"]) / size))
        return shares

    def _share_of(self, block: int) -> float:
        """The same of what goes with the square of the ``block``'s load, from the strain of its cracks."""
        before, first = self._strain_began.get(block), self._strain_first.get(block)
        if before is None or first is None or not first.any():
            return 1.0
        return max(0.0, float(before @ first) / float(first @ first))

    def parts(self) -> None:
        """Blocks part in the present step, and have other numbers from then on."""
        self._parted = True
        self._hangs, self._limited, self._strain_last = {}, {}, {}

    @property
    def under_way(self) -> bool:
        """Whether there is something to go on with, also where no crack is left."""
        return self.work != 0.0 or self.stored != 0.0

    def after(
        self,
        before: State,
        state: State,
        blocks: Blocks,
        felt: dict[int, Solution],
        by_mean_stress: ByMeanStress,
        set_free: float = 0.0,
    ) -> None:
        """The step from ``before`` to ``state`` has been taken; ``felt`` at its end is block → the `ddm.Solution` that
        it is strained by; ``by_mean_stress`` are those that feel no more than their mean stress. Blocks that have
        parted since the last step stored ``set_free`` J/m more before than their parts and new contacts did."""
        strain = state.crack_strain - before.crack_strain
        mean = 0.5 * (before.stress + state.stress)
        work = float(blocks.areas(before.vertices) @ np.sum(mean * strain, axis=1))
        stored = sum(solution.crack_energy for solution in felt.values())
        friction = sum(solution.frictional_work for solution in felt.values())
        hangs = {block: block in by_mean_stress for block in felt}
        # What a block stored that begins to hang, or is whole no more, was of another kind.
        self._parted |= any(hangs.get(block) != hung for block, hung in self._hangs.items())
        self._hangs = hangs
        rest = work + set_free - (stored - self.stored) - (friction - self.friction) - self._released
        self.work += work
        self.set_free += set_free
        self.fracture += self._released
        self.toughness += self._asked
        if self._parted:
            self.parting += rest
        else:
            self.residual += rest
        self.stored, self.friction = stored, friction
        self._released, self._asked, self._parted = 0.0, 0.0, False
        self._began, self._first, self._strain_began = self._last, None, self._strain_last
        # What grows now does so as the next step begins.
        self._growing = {key: replace(of, share=1.0) for key, of in self._growing.items()}
        self._limited = {block: (*of[:3], 1.0) for block, of in self._limited.items()}

    def statistics(self) -> dict[str, float]:
        """Columns of a history, J/m."""
        return {
            "crack_elastic": self.stored,
            "crack_friction": self.friction,
            "fracture_energy": self.fracture,
            "toughness_energy": self.toughness,
            "parting_energy": self.parting,
            "crack_residual": self.residual,
        }
