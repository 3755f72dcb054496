"""Where the energy goes that blocks spend on their cracks: it is stored around them, rubbed off between their faces, released
at their tips as they grow, and set free where blocks part.

The block solver knows the work of its mean stress on the strain of its cracks, A σ : dε_c. By Clapeyron's theorem a body with
jumps [u] whose faces bear t where the same loads would bring t₀ without them stores ½ ∫ (t₀ − t)·[u] more; what a tip
releases over an increment is ∫ G da, G = (K_I² + K_II²)/E' (Irwin 1957), by the trapezoidal rule of G before, of K_eq, for the
way it turns, and after. So four quantities found apart from each other have to add up; what is left over is told.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ..model import Blocks, Material, State

if TYPE_CHECKING:
    from ..ddm import Solution
    from .hanging import Hanging


@dataclass(eq=False)
class CrackEnergy:
    """Sums since the beginning of a run, J/m.

    work       of the blocks' mean stress (that of the middle of each step) on the strain of their cracks
    stored     around cracks, now
    friction   rubbed off between crack faces
    fracture   released at tips that grew
    parting    released as tips met something and blocks parted: the last ligaments, and what the cracks stored that are walls now; and
               as tips grew in blocks that hang (`hanging`), which spend less on it than ∫ G da under held forces
    residual   work − stored − friction − fracture − parting: of increments and steps, and since blocks feel their cracks' mean
               strain only
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
    _growing: dict[tuple[int, int], tuple[float, float]] = field(default_factory=dict)

    def passed(self, tips: np.ndarray, blocks: Blocks, materials: tuple[Material, ...], hanging: Hanging) -> None:
        """A pass of the present step has ended with ``tips``, of which some are about to grow, or none; some are in blocks ``hanging``."""
        if not len(tips) or not (self._growing or (tips["grown"] > 0).any()):
            return
        hangs = np.array([block in hanging for block in tips["block"].tolist()])
        if (hangs & (tips["grown"] > 0)).any():
            self._parted = True
        tips = tips[~hangs]
        modulus = np.array([m.plane_modulus for m in materials])[blocks.material[tips["block"]]]
        release = (tips["k_i"] ** 2 + tips["k_ii"] ** 2) / modulus
        keys = list(zip(tips["crack"].tolist(), tips["end"].tolist()))
        now = dict(zip(keys, release.tolist()))
        for key, (grown, before) in self._growing.items():
            if key in now:
                self._released += 0.5 * grown * (before + now[key])
            else:
                # A tip that has met something: G rises without bound as the last ligament goes, its integral by no rule.
                self._parted = True
        turned = (tips["k_eq"] ** 2 / modulus).tolist()
        self._growing = {
            key: (grown, before) for key, grown, before in zip(keys, tips["grown"].tolist(), turned) if grown > 0
        }

    def parts(self) -> None:
        """Blocks part in the present step."""
        self._parted = True

    def after(
        self, before: State, state: State, blocks: Blocks, felt: dict[int, tuple[float, Solution]], hanging: Hanging
    ) -> None:
        """The step from ``before`` to ``state`` has been taken; ``felt`` at its end is block → (share, `ddm.Solution`), what blocks are strained by;
        ``hanging`` are those that feel no more than their mean stress."""
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

    def statistics(self) -> dict[str, float]:
        """Columns of a history, J/m."""
        return {
            "crack_elastic": self.stored,
            "crack_friction": self.friction,
            "fracture_energy": self.fracture,
            "parting_energy": self.parting,
            "crack_residual": self.residual,
        }
