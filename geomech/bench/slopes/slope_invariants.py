"""Invariants of any scene, checked in every cycle of a run, and the values closest to their bounds."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ... import dda
from ...dda.contact_detection.initial_overlap import REFUSED, deepest_overlap
from ...dda.energy_balance import GAIN
from ...dda.step_control.continuous_collision import ROUNDED_OVERLAP
from ...ddm.mesh.point_location import inside
from ...model import OPEN, Cycle, Problem


@dataclass(frozen=True)
class Invariant:
    """``bound`` of a quantity relative to the scale given in ``meaning``.

    A run beyond it is wrong, unless a warning with one of the words ``reported`` says so: in this step or the one
    before, or (``lasting``) in any earlier one.
    """

    meaning: str
    bound: float
    reported: tuple[str, ...] = ()
    lasting: bool = True


#: A block and cracks that disagree have too much strain, overlap their neighbours, and are out of balance by their
#: strain.
_HANGS, _STRAINED = "to a common strain", "beyond the elastic range"
#: Faces in a blade of rock, for which the crack solver reports place, length and violation of their laws.
_UNSETTLED = "the remaining violation"

INVARIANTS = {
    "area": Invariant("area of all blocks, as drawn or parted, off what it was", 1e-9),
    "strain": Invariant("strain of a block: rock in the elastic range has less", 1e-2, (_STRAINED,)),
    "overlap": Invariant(
        "depth of a block in another, over the smaller one's size (rounded corners: 3e-3 more)",
        REFUSED,
        (_HANGS, _STRAINED),
    ),
    "motion": Invariant("equations of motion of all blocks, over the largest force", 1e-6),
    # In excess of the strain, see `Invariants._balance`.
    "balance": Invariant(
        "loads of a cracked block out of balance, over their size", 1e-5, (_HANGS, _STRAINED, "out of balance")
    ),
    "agreement": Invariant(
        "strain of a block's cracks found and assumed, over the block's", 1e-1, (_HANGS,), lasting=False
    ),
    "energy": Invariant(
        "energy not accounted for, relative to all energy converted (steps of a hundredth of the height leave up to 1e-2)",
        GAIN,
        ("without work", _STRAINED),
    ),
    "budget": Invariant(
        "the same of blocks and cracks together", GAIN, ("not accounted for", "without work", _STRAINED)
    ),
    "toughness": Invariant(
        "K_eq over K_Ic, less 1, of tips that stand in statics (event steps: to 1e-6)",
        1e-5,
        ("tips still grow",),
        lasting=False,
    ),
    "faces": Invariant("overlap of crack faces, over the largest opening or slip", 1e-6, (_UNSETTLED,), lasting=False),
    "pull": Invariant(
        "pull between closed crack faces beyond their bond, over the pressure", 1e-6, (_UNSETTLED,), lasting=False
    ),
}


class Invariants:
    """The cycles so far: ``worst`` of every quantity, ``faults`` beyond a bound without a warning, and those
    ``reported`` by one. ``warnings`` gives the warnings so far."""

    def __init__(self, problem: Problem, warnings: Callable[[], list[str]]) -> None:
        self.warnings = warnings
        self.worst = dict.fromkeys(INVARIANTS, 0.0)
        self.faults: list[str] = []
        self.reported: list[str] = []
        self._static = problem.dda.dynamic_factor == 0.0
        # Corners that pass each other within their rounding length overlap by a part of it.
        self._rounded = ROUNDED_OVERLAP * problem.dda.corner_rounding
        self._tough = np.array([material.k_ic for material in problem.materials])
        self._bond = max(law.tensile_strength for law in problem.face_laws)
        self._stop_at = problem.run.stop_at
        self._time = self._area = 0.0
        self._strain = 0.0
        self._standing: tuple[int, float, str] | None = None
        # Number of warnings at the last cycle, and at the one before.
        self._warnings_before = (0, 0)

    def check(self, cycle: Cycle) -> None:
        broken = [*_not_finite(cycle), *_tips_outside_rock(cycle)]
        if not cycle.state.time >= self._time:
            broken.append(f"time goes back from {self._time:g} to {cycle.state.time:g} s")
        self._time = cycle.state.time
        self.faults += [f"cycle {cycle.number}: {what}" for what in broken]
        if broken:
            return
        for of in (self._blocks, self._balance, self._growth, self._crack_faces):
            for name, value, where in of(cycle):
                self._take(name, value, f"cycle {cycle.number}: {where}")
        self._warnings_before = (self._warnings_before[1], len(self.warnings()))

    def end(self) -> None:
        """After the last cycle of a run that reached its end: its tips are at rest."""
        for name, value, where in self._excess_at_rest():
            self._take(name, value, f"at the end: {where}")

    def _take(self, name: str, value: float, where: str) -> None:
        self.worst[name] = max(self.worst[name], value)
        invariant = INVARIANTS[name]
        bound = invariant.bound + {"balance": self._strain, "overlap": self._rounded}.get(name, 0.0)
        if value > bound:
            lines = self.warnings()[0 if invariant.lasting else self._warnings_before[0] :]
            is_reported = any(words in line for words in invariant.reported for line in lines)
            (self.reported if is_reported else self.faults).append(f"{where}: {name} {value:.2g}")

    def _blocks(self, cycle: Cycle) -> Iterator[tuple[str, float, str]]:
        blocks, vertices = cycle.blocks, cycle.state.vertices
        area = blocks.areas().sum()
        self._area = self._area or area
        yield "area", abs(area / self._area - 1), "all blocks"
        gradient = cycle.motion.gradient
        stretch = 0.5 * np.abs(gradient.transpose(0, 2, 1) @ gradient - np.eye(2)).max(axis=(1, 2))
        b = int(np.argmax(stretch))
        self._strain = max(self._strain, float(stretch[b]))
        yield "strain", float(stretch[b]), blocks.names[b]
        moments = dda.block_moments(np.ascontiguousarray(vertices), blocks.next_vertex, blocks.vertex_start)
        a, b, _, share = deepest_overlap(blocks, vertices, moments)
        yield "overlap", share, f"{blocks.names[a]} and {blocks.names[b]}"

    def _balance(self, cycle: Cycle) -> Iterator[tuple[str, float, str]]:
        reported = cycle.statistics
        yield "motion", reported.get("unbalanced", 0.0), "the blocks"
        # Contacts with penetration or mismatch act off the outlines by that distance; those of strained blocks, by
        # their corners' angles. (Found: up to 0.5 of the strain at the start of the step.)
        yield "balance", reported.get("traction_imbalance", 0.0), "cracked blocks"
        yield "agreement", reported.get("compliance_mismatch", 0.0), "cracked blocks"
        # As in the budget: relative to works, or to stored energy where hardly anything moves.
        works, stores = ("gravity_work", "load_work", "crack_work", "friction_loss"), ("kinetic", "elastic", "contact")
        turned = sum(abs(reported.get(name, 0.0)) for name in works)
        turned = max(turned, sum(reported.get(f"{name}_energy", 0.0) for name in stores))
        if turned > 0:
            yield "energy", abs(reported.get("energy_residual", 0.0)) / turned, "the blocks"
        yield "budget", abs(reported.get("budget_residual", 0.0)), "blocks and cracks"

    def _growth(self, cycle: Cycle) -> Iterator[tuple[str, float, str]]:
        # Whether the tips of a cycle are at rest is known when the next one belongs to another load.
        if self._standing is not None and cycle.growth_pass == 0:
            yield from self._excess_at_rest()
        self._standing = None
        if not (self._static and len(cycle.tips)) or any(event.kind in self._stop_at for event in cycle.events):
            return
        over = cycle.tips["k_eq"] / self._tough[cycle.blocks.material[cycle.tips["block"]]] - 1
        worst = int(np.argmax(over))
        self._standing = max(0.0, float(over[worst])), f"tip of crack {int(cycle.tips['crack'][worst])}"

    def _excess_at_rest(self) -> Iterator[tuple[str, float, str]]:
        if self._standing is not None:
            yield "toughness", *self._standing

    def _crack_faces(self, cycle: Cycle) -> Iterator[tuple[str, float, str]]:
        faces = cycle.faces
        shut = np.zeros(0, bool) if faces is None else np.isfinite(cycle.cracks.aperture[faces.segment])
        if not shut.any():
            return
        # The collocation nodes: between them polynomials may dip.
        opening, normal, state = faces.opening[shut, 1:-1], faces.traction[shut, 1:-1, 0], faces.state[shut, 1:-1]
        aperture = cycle.cracks.aperture[faces.segment[shut]][:, None]
        scale = max(float(np.abs(faces.opening).max()), float(np.abs(faces.slip).max()), 1e-12)
        yield "faces", max(0.0, -float((opening + aperture).min())) / scale, "crack faces"
        pressed = float(np.abs(normal).max())
        if (state != OPEN).any() and pressed > 0:
            yield "pull", max(0.0, float(normal[state != OPEN].max()) - self._bond) / pressed, "closed crack faces"


def _not_finite(cycle: Cycle) -> Iterator[str]:
    state, faces = cycle.state, cycle.faces
    if not all(np.isfinite(values).all() for values in (state.vertices, state.velocity, state.stress)):
        yield "a block is nowhere"
    names = ("k_i", "k_ii", "k_eq", "angle")
    if len(cycle.tips) and not all(np.isfinite(cycle.tips[name]).all() for name in names):
        yield "a stress intensity factor is not finite"
    if faces is not None and not (np.isfinite(faces.opening).all() and np.isfinite(faces.traction).all()):
        yield "a crack face is nowhere"


def _tips_outside_rock(cycle: Cycle) -> Iterator[str]:
    for tip in cycle.tips:
        if not inside(cycle.blocks.loops(int(tip["block"])), tip["point"][None]).all():
            yield f"a tip of crack {tip['crack']} at {tip['point']} lies outside {cycle.blocks.names[tip['block']]}"
