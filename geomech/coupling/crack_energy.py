"""Where the energy goes that blocks spend on their cracks: it is stored around them, rubbed off between their faces,
released at their tips as they grow, and set free where blocks part.

The block solver knows the work of its mean stress on the strain of its cracks, A σ : dε_c. By Clapeyron's theorem a
body with jumps [u] whose faces bear t where the same loads would bring t₀ without them stores ½ ∫ (t₀ − t)·[u] more;
what a tip releases over an increment is ∫ G da, G = (K_I² + K_II²)/E' (Irwin 1957), by the trapezoidal rule of G
before, of K_eq, for the way it turns, and after, each K once at the load of the step's end and once at that of its
begin. So four quantities found apart from each other have to add up; what is left over is told. Over the steps of a run
that leaves what uneven forces do: they open cracks, and blocks of one strain do not feel it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ..model import Blocks, Material, State

if TYPE_CHECKING:
    from ..ddm import Solution
    from .hanging import Hanging

_Key = tuple[int, int]


def _keys(tips: np.ndarray) -> list[_Key]:
    return list(zip(tips["crack"].tolist(), tips["end"].tolist()))


@dataclass(eq=False)
class CrackEnergy:
    """Sums since the beginning of a run, J/m.

    work       of the blocks' mean stress (that of the middle of each step) on the strain of their cracks
    stored     around cracks, now
    friction   rubbed off between crack faces
    fracture   released at tips that grew
    parting    released as tips met something and blocks parted: the last ligaments, and what the cracks stored that are
               walls now; and as tips grew in blocks that hang (`hanging`), which spend less on it than ∫ G da under
               held forces
    residual   work − stored − friction − fracture − parting: of increments and steps, and since blocks feel their
               cracks' mean strain only
    """

    work: float = 0.0
    stored: float = 0.0
    friction: float = 0.0
    fracture: float = 0.0
    parting: float = 0.0
    residual: float = 0.0
    _released: float = 0.0
    _parted: bool = False
    _hanging: frozenset[int] = frozenset()
    #: (crack, end) → way, G before it, J/m², and what part of G there was over the step, of its end's.
    _growing: dict[_Key, tuple[float, float, float]] = field(default_factory=dict)
    #: Tips as the present step began, and in its first pass.
    _began: np.ndarray | None = None
    _first: np.ndarray | None = None
    _last: np.ndarray | None = None

    def passed(self, tips: np.ndarray, blocks: Blocks, materials: tuple[Material, ...], hanging: Hanging) -> None:
        """A pass of the present step has ended with ``tips``, of which some are about to grow, or none; some are in
        blocks ``hanging``."""
        self._first = tips if self._first is None else self._first
        self._last = tips
        if not len(tips) or not (self._growing or (tips["grown"] > 0).any()):
            return
        hangs = np.array([block in hanging for block in tips["block"].tolist()])
        if (hangs & (tips["grown"] > 0)).any():
            self._parted = True
        tips = tips[~hangs]
        modulus = np.array([m.plane_modulus for m in materials])[blocks.material[tips["block"]]]
        release = (tips["k_i"] ** 2 + tips["k_ii"] ** 2) / modulus
        keys = _keys(tips)
        now = dict(zip(keys, release.tolist()))
        for key, (grown, before, share) in self._growing.items():
            if key in now:
                self._released += 0.5 * grown * share * (before + now[key])
            else:
                # A tip that has met something: G rises without bound as the last ligament goes, its integral by no
                # rule.
                self._parted = True
        turned = (tips["k_eq"] ** 2 / modulus).tolist()
        shares = self._shares()
        self._growing = {
            key: (grown, before, shares.get(key, 1.0))
            for key, grown, before in zip(keys, tips["grown"].tolist(), turned)
            if grown > 0
        }

    def _shares(self) -> dict[_Key, float]:
        """What part of a tip's G there is over the present step, in which its load has changed: K·K₀/K² with K₀ as the
        step began. Passes grow tips by the load of the step's end, but they grow all the time; forces that rise by a
        part of themselves would release that part too much."""
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

    def parts(self) -> None:
        """Blocks part in the present step."""
        self._parted = True

    def after(
        self, before: State, state: State, blocks: Blocks, felt: dict[int, tuple[float, Solution]], hanging: Hanging
    ) -> None:
        """The step from ``before`` to ``state`` has been taken; ``felt`` at its end is block → (share, `ddm.Solution`),
        what blocks are strained by; ``hanging`` are those that feel no more than their mean stress."""
        strain = state.crack_strain - before.crack_strain
        mean = 0.5 * (before.stress + state.stress)
        work = float(blocks.areas(before.vertices) @ np.sum(mean * strain, axis=1))
        stored = sum(share * solution.crack_energy for share, solution in felt.values())
        friction = sum(share * solution.frictional_work for share, solution in felt.values())
        now_hang = frozenset(block for block in felt if block in hanging)
        # What a block stored that begins to hang, or is whole no more, was of another kind.
        self._parted |= now_hang != self._hanging
        self._hanging = now_hang
        rest = work - (stored - self.stored) - (friction - self.friction) - self._released
        self.work += work
        self.fracture += self._released
        if self._parted:
            self.parting += rest
        else:
            self.residual += rest
        self.stored, self.friction = stored, friction
        self._released, self._parted = 0.0, False
        self._began, self._first = self._last, None
        # What grows now does so as the next step begins.
        self._growing = {key: (grown, g, 1.0) for key, (grown, g, _) in self._growing.items()}

    def statistics(self) -> dict[str, float]:
        """Columns of a history, J/m."""
        return {
            "crack_elastic": self.stored,
            "crack_friction": self.friction,
            "fracture_energy": self.fracture,
            "parting_energy": self.parting,
            "crack_residual": self.residual,
        }
