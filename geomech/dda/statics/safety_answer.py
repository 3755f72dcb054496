"""Result of a search for a factor of safety: bracket, mechanism, and the resistances counted."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...model import Blocks, State
from .pseudo_time_equilibrium import Travel
from .sharp_toes import Toe
from .stability_trial import Trial

#: Part by which strength falls short while failed blocks are followed. Directly at the factor, where least is missing,
#: millimetres of an anchor would stop them.
_SHORT = 0.05
#: Number of blocks of a mechanism that are described, and rotation (rad) per displacement of one block size above which
#: a block is said to turn.
_LISTED, _TURNS = 8, 0.05


@dataclass(frozen=True)
class Anchor:
    """A bolt at the factor: its ``force`` N/m, elongation since installation (``stretch`` m), displacement of its block
    (``moved`` m), and whether it ``yields``."""

    name: str
    force: float
    stretch: float
    moved: float
    yields: bool


@dataclass(frozen=True, eq=False)
class FactorOfSafety:
    """``factor`` lies between ``lower``, the largest F with an equilibrium, and ``upper``, the smallest without one
    (inf: none up to 64). ``trials``: in the order made; ``mechanism``: text, one line per block that moves just above
    the factor; ``moving``: these blocks, the fastest first; ``state``: the equilibrium at ``lower``; ``moved``
    (n_blocks,) m: displacements in it, including the initial settlement; ``anchors``: bolt forces in it.

    ``toes``: obstacles to the mechanism. If they are rounded and carry nothing, ``other_factor`` is the factor with
    sharp tips; if they carry load (``toes_hold``), it is the factor without them; None if unknown.
    ``factor_if_parted``: factor if open ends of faces lose their cohesion, if that differs; ``factor_if_rigid``: factor
    of rigid blocks, if faces of elastic blocks carry less; it is the ``factor`` if faces would carry nothing because uniform
    strain opens them by less than the precision of positions, and ``factor_if_strained`` is then that of elastic blocks.
    ``travel``: how far the
    blocks go at the factor ``travels_at`` (None: not followed), and ``sharp_travel``:
    displacement of the farthest if the corner that stops it had a sharp tip (None: no corner does). ``admissible``: largest
    factor with admissible contact forces (`admissible_forces`), if it exceeds the factor by more than one per cent,
    otherwise None. ``warnings``: texts."""

    factor: float
    lower: float
    upper: float
    trials: tuple[Trial, ...]
    moving: tuple[int, ...]
    mechanism: tuple[str, ...]
    state: State
    moved: np.ndarray
    anchors: tuple[Anchor, ...] = ()
    toes: tuple[Toe, ...] = ()
    toes_hold: bool = False
    other_factor: float | None = None
    factor_if_parted: float | None = None
    factor_if_rigid: float | None = None
    factor_if_strained: float | None = None
    travel: Travel | None = None
    sharp_travel: float | None = None
    admissible: float | None = None
    warnings: tuple[str, ...] = ()

    @property
    def failed(self) -> Trial | None:
        """The trial at ``upper``; None if there is none."""
        return next((t for t in reversed(self.trials) if t.factor == self.upper), None)

    @property
    def travels_at(self) -> float:
        """The factor at which failed blocks are followed: where their strength falls short by `_SHORT`, or with the
        strength that they have, if that falls short by more."""
        return max(self.upper * (1.0 + _SHORT), 1.0)

    def travel_text(self) -> str:
        """How far the blocks go, in words; empty if they were not followed."""
        if self.travel is None:
            return ""
        far = f"{float(self.travel.moved.max()):.3g} m"
        at = f"at F = {self.travels_at:.4g}, without inertia: "
        if self.travel.reason:
            return f"{at}followed for {far}, where the search ends"
        if not self.travel.rests:
            return f"{at}followed for {far}, and they go on"
        on = ""
        if self.sharp_travel is not None:
            on = f" on a rounded corner ({self.sharp_travel:.3g} m on its sharp tip)"
        elif self.toes and not self.toes_hold:
            on = " on a rounded corner"
        return f"{at}they come to rest {far} farther{on}"

    def table(self, title: str = "factor of safety") -> str:
        """Text: the trials by F, the factor with the ``title``, and the mechanism."""
        lines = ["       F  equilibrium  steps  unbalanced  drift m/s²"]
        for t in sorted(self.trials, key=lambda t: t.factor):
            answer = "yes" if t.stable else "no"
            lines.append(
                f"{t.factor:8.4f}  {answer:<11}  {t.steps:5d}  {t.unbalanced:10.2e}  {t.drift:10.2e}  {t.reason}"
            )
        found = f"{self.factor:.4f}" if math.isfinite(self.upper) else f"above {self.lower:g}"
        lines.append(f"{title} {found}" + ("; blocks that move at failure:" if self.mechanism else ""))
        lines += [f"  {line}" for line in self.mechanism]
        lines += [f"  {self.travel_text()}"] if self.travel is not None else []
        for a in self.anchors:
            state = "at its yield force" if a.yields else "not at its yield force"
            lines.append(
                f"  bolt {a.name}: {a.force / 1e3:.4g} kN/m, {state}, stretched by {1e3 * a.stretch:.3g} mm, its block "
                f"has moved {1e3 * a.moved:.3g} mm"
            )
        return "\n".join([*lines, *(f"  warning: {line}" for line in self.warnings)])

    def as_dict(self, blocks: Blocks) -> dict[str, object]:
        """Plain data for a file: the answer, its trials, and the motion of ``blocks`` at failure, scaled to a largest
        displacement of 1."""
        failed = min((t for t in self.trials if not t.stable), key=lambda t: t.factor, default=None)
        moving = {}
        if failed is not None and self.moving:
            far = float(np.hypot(*failed.displacement[self.moving[0]]))
            for b in self.moving:
                way, turn = (failed.displacement[b] / far).tolist(), float(failed.rotation[b] / far)
                moving[blocks.names[b]] = {"displacement": way, "rotation_per_m": turn}
                if self.travel is not None:
                    moving[blocks.names[b]]["travel_m"] = float(self.travel.moved[b])
        plain = ("factor", "stable", "steps", "unbalanced", "drift", "reason")
        return {
            "factor_of_safety": self.factor,
            "lower": self.lower,
            "upper": self.upper if math.isfinite(self.upper) else None,
            "moving": moving,
            "travel": self._travel_as_dict(),
            "moved_m": dict(zip(blocks.names, self.moved.tolist(), strict=True)),
            "anchors": [vars(a) for a in self.anchors],
            "toes": [
                {
                    "block": blocks.names[t.block],
                    "other": blocks.names[t.other],
                    "at": list(t.at),
                    "stands_off_m": t.stands_off,
                    "force": t.force,
                }
                for t in self.toes
            ],
            "toes_hold": self.toes_hold,
            "factor_without_toes" if self.toes_hold else "factor_with_sharp_toes": self.other_factor,
            "factor_if_parted_faces_lose_cohesion": self.factor_if_parted,
            "factor_of_rigid_blocks": self.factor_if_rigid,
            "factor_of_strained_blocks": self.factor_if_strained,
            "largest_factor_with_admissible_forces": self.admissible,
            "warnings": list(self.warnings),
            "trials": [{name: getattr(t, name) for name in plain} for t in self.trials],
        }

    def _travel_as_dict(self) -> dict[str, object] | None:
        if self.travel is None:
            return None
        return {
            "factor": self.travels_at, "comes_to_rest": self.travel.rests,
            "farthest_m": float(self.travel.moved.max()), "farthest_with_sharp_corners_m": self.sharp_travel,
            "reason": self.travel.reason,
        }  # fmt: skip


def moving_in(trial: Trial) -> tuple[int, ...]:
    """The blocks that move by more than a tenth of the farthest, the fastest first."""
    far = np.hypot(*trial.displacement.T)
    order = np.argsort(-far, kind="stable")
    return tuple(order[far[order] > 0.1 * far.max()].tolist()) if far.max() > 0 else ()


def mechanism_of(blocks: Blocks, trial: Trial, moving: tuple[int, ...]) -> tuple[str, ...]:
    """A line for each of the fastest blocks."""
    fastest = float(np.hypot(*trial.displacement[list(moving[:1])].T).max()) if moving else 1.0
    lines = []
    for block in moving[:_LISTED]:
        (x, y), turn = trial.displacement[block], trial.rotation[block]
        far = math.hypot(x, y)
        name = blocks.names[block]
        # Adding zero turns −0 into 0.
        text = f"{name}: {far / fastest:.2f} of the fastest, towards {round(math.degrees(math.atan2(y, x))) + 0}°"
        size = math.sqrt(abs(float(blocks.areas()[block])))
        if abs(turn) * size > _TURNS * far:
            turned = f"{math.degrees(abs(turn)) * size / far:.0f}° while it moves by its own size (√area)"
            text += f", turning {'left' if turn > 0 else 'right'} by {turned}"
        lines.append(text)
    if len(moving) > _LISTED:
        lines.append(f"and {len(moving) - _LISTED} more of {blocks.n_blocks} blocks")
    return tuple(lines)
