"""Sensitivity of a run's results to choices that should not matter: the run is repeated with one of them changed at a
time.

noise       every coordinate of the outlines changed by up to 1e-12 of the model's extent, as by another processor,
            a shift or a rotation of the drawing
steps       time steps, load steps and the motion allowed per step half as large
increment   crack growth increments half as long
elements    twice as many boundary elements on cracks and sides; a ``target_error`` ten times smaller

The scatter of a quantity q of the run and q' of its repetition is |q' − q| / max(|q|, |q'|). It tells which digits of a
result the scene determines. Blocks in mutual frictional contact, and cracks at a bifurcation of their path, amplify
round-off, as a real slope amplifies details that no drawing contains: if the scatter is large, the result is one of
several that the scene allows.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from .model import REPEATS, Cycle, Problem
from .model.problem import Repeat

log = logging.getLogger(__name__)

#: Changes of coordinates over the extent of the blocks.
NOISE = 1e-12
#: Blocks that have moved by more than this part of their size √area count as moving.
MOVES = 1e-3
#: A larger scatter causes a warning.
LARGEST_SCATTER = 0.01
#: Quantities: their key in ``summary.json``, their words in messages, and their unit there.
QUANTITIES = {
    "moving_share": ("moving share of the rock", ""),
    "largest_displacement_m": ("largest displacement", " m"),
    "gravity_work_j_per_m": ("work of gravity", " J/m"),
    "crack_length_m": ("crack length", " m"),
    "blocks": ("number of blocks", ""),
    "coalescences": ("number of coalescences", ""),
    "peak_load_pa": ("peak load", " Pa"),
    "time_s": ("time at the end", " s"),
}


@dataclass
class Outcome:
    """Results of a run: counts over its cycles (`add`) and its ``last`` cycle."""

    peak: float = 0.0
    events: Counter[str] = field(default_factory=Counter)
    last: Cycle | None = None

    def add(self, cycle: Cycle) -> None:
        self.last = cycle
        self.peak = max(self.peak, cycle.load, key=abs)
        self.events.update(event.kind for event in cycle.events)

    def values(self, problem: Problem) -> dict[str, float]:
        """{key of `QUANTITIES`: value} at the end."""
        if self.last is None:
            return {}
        blocks, state = self.last.blocks, self.last.state
        area, free = np.abs(blocks.areas()), ~np.asarray(blocks.fixed, bool)
        density = np.array([material.density for material in problem.materials])[blocks.material]
        mass = np.where(free, density * area, 0.0)
        moved = np.hypot(*blocks.displacements(state.vertices).T)
        moving = moved > MOVES * np.sqrt(area)
        found = {
            "moving_share": float(mass[moving].sum() / mass.sum()) if mass.any() else 0.0,
            "largest_displacement_m": float(moved[free].max(initial=0.0)),
            "gravity_work_j_per_m": float(self.last.statistics.get("gravity_work", 0.0)),
            "blocks": float(blocks.n_blocks),
            "peak_load_pa": float(self.peak),
            "time_s": float(state.time),
        }
        if problem.cracks.n_cracks or self.last.cracks.n_cracks:
            found["crack_length_m"] = float(self.last.cracks.lengths.sum())
            found["coalescences"] = float(self.events["coalescence"])
        return found


class Repeats:
    """Observer that repeats a finished run as its ``run.repeat`` asks, and enters ``scatter`` into its summary.

    ``run`` yields the cycles of a problem. An interrupt or a failure of a repetition ends that repetition, not the run.
    """

    def __init__(self, run: Callable[[Problem], Iterable[Cycle]]) -> None:
        self.run = run

    def on_start(self, problem: Problem, folder: Path) -> None:
        self.problem, self.outcome = problem, Outcome()

    def memory(self) -> dict[str, Any]:
        return {"peak": self.outcome.peak, "events": dict(self.outcome.events)}

    def on_resume(self, problem: Problem, folder: Path, memory: dict[str, Any]) -> None:
        self.problem, self.outcome = problem, Outcome(memory["peak"], Counter(memory["events"]))

    def on_cycle(self, cycle: Cycle) -> None:
        self.outcome.add(cycle)

    def on_end(self, summary: dict[str, Any], error: BaseException | None = None) -> None:
        if error is not None or self.outcome.last is None:
            return
        base = self.outcome.values(self.problem)
        summary["scatter"] = scatters = {}
        for kind in self.problem.run.repeat:
            log.info("repeating the run: %s", REPEATS[kind])
            outcome, failure = Outcome(), None
            try:
                for cycle in self.run(changed(self.problem, kind)):
                    outcome.add(cycle)
            except KeyboardInterrupt:
                log.warning("interrupted while the run was repeated: its scatter is not complete")
                return
            except Exception as raised:
                failure = f"{type(raised).__name__}: {raised}"
            scatters[kind] = scatter = _scatter(base, outcome.values(self.problem))
            if failure is not None:
                scatters[kind] = {"failed": failure}
                log.warning("the run reached its end, but did not when repeated with %s: %s", REPEATS[kind], failure)
            elif scatter["largest"] > LARGEST_SCATTER:
                log.warning("repeated with %s, the run differs: %s", REPEATS[kind], _in_words(scatter["quantities"]))
            else:
                log.info("repeated with %s, the run differs by %.1g at most", REPEATS[kind], scatter["largest"])


def changed(problem: Problem, kind: Repeat) -> Problem:
    """``problem`` as it is repeated for a ``kind`` of `REPEATS`."""
    if kind == "noise":
        return with_noise(problem, NOISE, np.random.default_rng(0))
    dda, ddm, growth, run = problem.dda, problem.ddm, problem.growth, problem.run
    if kind == "steps":
        longest = None if run.longest_step is None else 0.5 * run.longest_step
        dda = replace(
            dda, time_step=0.5 * dda.time_step, max_displacement_ratio=0.5 * dda.max_displacement_ratio,
        )  # fmt: skip
        return replace(problem, dda=dda, run=replace(run, longest_step=longest))
    if kind == "increment":
        growth = replace(
            growth, increment=0.5 * growth.increment, min_increment=min(growth.min_increment, 0.5 * growth.increment)
        )
        return replace(problem, growth=growth)
    ddm = replace(
        ddm, elements_per_crack=2 * ddm.elements_per_crack, elements_per_side=2 * ddm.elements_per_side,
        target_error=None if ddm.target_error is None else 0.1 * ddm.target_error,
    )  # fmt: skip
    return replace(problem, ddm=ddm)


def with_noise(problem: Problem, size: float, rng: np.random.Generator) -> Problem:
    """``problem`` with each vertex of each block moved by up to ``size`` of the blocks' extent along x and y; where the
    outline of a block touches itself, or a crack ends at it, together."""
    vertices, cracks = problem.blocks.vertices, problem.cracks
    off = size * float(np.ptp(vertices, axis=0).max()) * rng.uniform(-1, 1, vertices.shape)
    _, first, which = np.unique(
        np.column_stack([problem.blocks.vertex_block, vertices]), axis=0, return_index=True, return_inverse=True
    )
    off = off[first[which.ravel()]]
    nodes = cracks.nodes.copy()
    corner = {
        (block, *at): by for block, at, by in zip(problem.blocks.vertex_block.tolist(), vertices.tolist(), off.tolist())
    }
    for ends, block in zip(cracks.segments.tolist(), np.asarray(cracks.block).tolist()):
        for node in ends:
            nodes[node] = cracks.nodes[node] + corner.get((block, *cracks.nodes[node].tolist()), (0.0, 0.0))
    return replace(problem, blocks=problem.blocks.with_vertices(vertices + off), cracks=replace(cracks, nodes=nodes))


def _scatter(base: dict[str, float], other: dict[str, float]) -> dict[str, Any]:
    """ "largest" scatter, and by quantity the value of the run, that of the repetition and their scatter."""
    rows = {
        key: {"run": base[key], "repeated": other[key], "scatter": _relative(base[key], other[key])}
        for key in base
        if key in other and (base[key] or other[key])
    }
    return {"largest": max((row["scatter"] for row in rows.values()), default=0.0), "quantities": rows}


def _relative(one: float, other: float) -> float:
    size = max(abs(one), abs(other))
    return abs(one - other) / size if size > 0 else 0.0


def _in_words(rows: dict[str, Any]) -> str:
    """Quantities that scatter by more than `LARGEST_SCATTER`, the largest scatter first: "peak load 5.1e+06 instead of 5e+06 Pa"."""
    worst = sorted(
        (key for key in rows if rows[key]["scatter"] > LARGEST_SCATTER), key=lambda key: -rows[key]["scatter"]
    )
    parts = []
    for key in worst:
        words, unit = QUANTITIES[key]
        parts.append(f"{words} {rows[key]['repeated']:.4g} instead of {rows[key]['run']:.4g}{unit}")
    return ", ".join(parts)
