"""Displacement of the slope, compared with Newmark's sliding block under the same record, and computing time by phase."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from geomech.model import Cycle, Problem
from geomech.model.joints.joint_sums import joint_sums
from geomech.reference.blocks.base_shaking import sliding_block

#: Dip of the plane, and the friction angle on it, as the scene has them.
DIP, PLANE = np.radians(22.0), "plane"
#: Time at which shaking begins, s; until then the weight is applied.
SHAKEN = 0.5
#: Admissible relative difference of the slip on the plane from that of a rigid block. Found: 11 % more with a thousand
#: blocks (the rock as a whole moves 40 % farther); in the variant "short" 5 % less with intact blocks, 1 % less if
#: bridges break.
SIMILAR = 0.3
#: Until the base first exceeds the yield acceleration, friction prevents sliding: the slip on the plane is at most this
#: fraction of the final one (1 % found). The rock above moves on its joints by several times as much.
STANDS = 0.02
#: Cracks and blocks have not converged if their strains differ by more than this fraction.
AGREED = 0.1
INK, SOFT, COMPUTED, NEWMARK, GROWN = "#2f3136", "#8a8f98", "#1f6f8b", "#d9a441", "#c8553d"

LIMITS = """\
Limits of the comparison
  - Newmark's block is rigid and slides on the plane only. It is compared with the slip on the plane, with which an elastic
    mass of blocks that rotate and rest on each other agrees to a quarter. In the slope joints also deform and slide, columns
    at the face separate, and rock bridges break: the rock as a whole moves farther (mean, lowest and highest tenth).
  - The base is rigid: no wave leaves through it, so that the shaking of the slope is an upper bound.
  - The record contains the first seconds of the earthquake; later pulses would increase the slip."""


@dataclass
class Slide:
    """Observer: a row a load step of how far the rock has moved down the plane.

    times     (n,) s
    moved     (n,) m, mean of the rock by area, down the plane, from where it is when the shaking begins
    spread    (n, 2) m, of the slowest and the fastest tenth of the blocks
    slipped   (n,) m on the plane, mean over its length
    grown     (n,) m of new crack
    """

    rows: list[tuple] = field(default_factory=list)
    events: Counter = field(default_factory=Counter)
    settled: list[float] = field(default_factory=list)  # relative strain by which cracks and blocks disagree, a cycle
    problem: Problem | None = None
    last: Cycle | None = None
    _known: tuple | None = None

    def on_start(self, problem: Problem, folder: Path) -> None:
        self.problem = problem

    def on_cycle(self, cycle: Cycle) -> None:
        self.events.update(event.kind for event in cycle.events)
        if "compliance_mismatch" in cycle.statistics:
            self.settled.append(cycle.statistics["compliance_mismatch"])
        blocks = cycle.blocks
        if self._known is None or self._known[0] is not blocks:
            free = np.flatnonzero(~np.asarray(blocks.fixed))
            self._known = blocks, free, np.array([blocks.area_moments(int(b))[0] for b in free])
        _, free, area = self._known
        moved = np.add.reduceat(cycle.state.vertices - blocks.vertices, blocks.vertex_start[:-1], axis=0)
        moved = (moved / np.diff(blocks.vertex_start)[:, None])[free] @ (-np.cos(DIP), -np.sin(DIP))
        row = (
            float(cycle.state.time), float(moved @ area / area.sum()), *np.quantile(moved, (0.1, 0.9)).tolist(),
            float(cycle.cracks.lengths[cycle.cracks.birth_cycle > 0].sum()), self._slip(cycle),
        )  # fmt: skip
        if self.rows and self.rows[-1][0] == row[0]:
            self.rows.pop()  # a further pass of the same step
        self.rows.append(row)
        self.last = cycle

    def _slip(self, cycle: Cycle) -> float:
        """Slip on the plane, m."""
        sums = joint_sums(cycle.blocks, cycle.state.contacts, self.problem.joints)
        return float(sums[f"joint:{PLANE}"]["mean_slip"]) if f"joint:{PLANE}" in sums else 0.0

    def on_end(self, summary, error=None) -> None:
        pass

    @property
    def table(self) -> np.ndarray:
        """(n, 6) times, mean, slowest and fastest tenth, new crack, slip on the plane; displacements and slip from the
        start of the shaking."""
        rows, moving = np.array(self.rows), [1, 2, 3, 5]
        begin = np.searchsorted(rows[:, 0], SHAKEN * (1 - 1e-9)).clip(max=len(rows) - 1)
        rows[:, moving] -= rows[begin, moving]
        return rows

    def newmark(self, times: np.ndarray) -> np.ndarray:
        """(n,) m, slip of a rigid block on the plane under the record, at ``times``."""
        law = next(law for law in self.problem.joints if law.name == PLANE)
        record = self.problem.loads.base.acceleration
        fine = np.union1d(np.arange(0.0, times[-1] + 1e-12, 2e-3), times)
        shaking = np.interp(fine, record.times, record.values[:, 0])
        return np.interp(times, fine, sliding_block(fine, shaking, DIP, law.friction_angle))


def check(slide: Slide) -> None:
    """AssertionError if the rock slides before limit equilibrium permits it, or if its sliding differs from that of
    Newmark's block."""
    table, expected = slide.table, slide.newmark(slide.table[:, 0])
    if expected[-1] == 0.0:
        return
    stands = (table[:, 0] >= SHAKEN) & (expected == 0.0)
    assert np.abs(table[stands, 5]).max(initial=0.0) < STANDS * expected[-1], (
        "the slope slides before limit equilibrium permits it"
    )
    assert abs(table[-1, 5] / expected[-1] - 1) < SIMILAR, "the slope does not slide like Newmark's block"


def report(slide: Slide, summary: dict) -> str:
    table = slide.table
    expected = slide.newmark(table[:, 0])
    law = next(law for law in slide.problem.joints if law.name == PLANE)
    first = slide.problem
    seconds = sorted(slide.last.seconds.items(), key=lambda item: -item[1])
    rows = [
        (
            f"{int((~first.blocks.fixed).sum())} blocks, {first.cracks.n_cracks} cracks before rock bridges; "
            f"yield acceleration tan(φ − α) = {np.tan(law.friction_angle - DIP):.3f} g"
        ),
        (
            f"to {table[-1, 0]:g} s: the rock moved {1e3 * table[-1, 1]:.1f} mm down the plane, tenths of its blocks "
            f"{1e3 * table[-1, 2]:.1f} mm or less and {1e3 * table[-1, 3]:.1f} mm or more"
        ),
        f"it slipped {1e3 * table[-1, 5]:.1f} mm on the plane; Newmark's sliding block: {1e3 * expected[-1]:.1f} mm",
        "",
        "   time   rock  plane  Newmark",
        "      s     mm     mm       mm",
    ]
    for time in np.arange(SHAKEN + 0.5, table[-1, 0] + 1e-9, 0.5):
        k = int(np.argmin(np.abs(table[:, 0] - time)))
        rows.append(f"{time:7.1f}{1e3 * table[k, 1]:7.1f}{1e3 * table[k, 5]:7.1f}{1e3 * expected[k]:9.1f}")
    counts = ", ".join(f"{count} × {kind}" for kind, count in sorted(slide.events.items())) or "none"
    rows += [
        "",
        f"events: {counts}; {slide.last.cracks.n_cracks} cracks in {slide.last.blocks.n_blocks - 1} blocks at the end",
    ]
    if slide.settled:
        rows.append(
            f"cracks and blocks agree to {np.median(slide.settled):.1e} of the strain (median of the cycles), "
            f"to 1e-2 in {100 * np.mean(np.array(slide.settled) < 1e-2):.0f} % of them"
        )
        if max(slide.settled) > AGREED:
            rows.append(
                f"in {np.sum(np.array(slide.settled) > AGREED)} cycles they differ by more than {AGREED:g} of it: "
                "such steps can create energy, and the effect of the cracks on the slip is not to be trusted"
            )
    rows += [
        "",
        f"run time {summary['wall_s']:.0f} s, {slide.last.load_step} steps, {slide.last.number} cycles; by phase:",
    ]
    rows += [f"  {name:<16}{spent:8.1f} s" for name, spent in seconds]
    return "\n".join([*rows, "", LIMITS])


def draw(slide: Slide, path: Path) -> None:
    """The slope at its end, with blocks coloured by displacement, and its slip against time with that of Newmark's
    block."""
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure

    table, blocks, state, cracks = slide.table, slide.last.blocks, slide.last.state, slide.last.cracks
    figure = Figure(figsize=(11, 8.6), layout="constrained")
    grid = figure.add_gridspec(3, 1, height_ratios=[2.6, 1, 0.62])
    slope = figure.add_subplot(grid[0])
    outlines = [blocks.loops(b, state.vertices)[0] for b in range(blocks.n_blocks)]
    start = blocks.vertex_start
    moved = np.add.reduceat(state.vertices - blocks.vertices, start[:-1], axis=0) / np.diff(start)[:, None]
    fixed = np.asarray(blocks.fixed)
    slope.add_collection(
        PolyCollection([o for o, f in zip(outlines, fixed) if f], facecolors="#e6e3dc", edgecolors="none")
    )
    shown = 1e3 * np.hypot(*moved[~fixed].T)
    rock = PolyCollection([o for o, f in zip(outlines, fixed) if not f], edgecolors=INK, linewidths=0.3, cmap="YlGnBu")
    rock.set_array(shown)
    rock.set_clim(0, float(np.quantile(shown, 0.98)))
    slope.add_collection(rock)
    figure.colorbar(rock, ax=slope, label="moved, mm", shrink=0.7, pad=0.01, extend="max")
    ends = np.empty((cracks.n_segments, 2, 2))
    for k, (segment, block) in enumerate(zip(cracks.segments, cracks.block.tolist())):
        ends[k] = slide.last.motion.current(block, cracks.nodes[segment])
    new = cracks.birth_cycle > 0
    for which, colour, label in ((~new, INK, "cracks before rock bridges"), (new, GROWN, "grown")):
        if which.any():
            slope.add_collection(LineCollection(ends[which], colors=colour, linewidths=1.6, label=label))
    slope.set(xlim=(-8, 76), ylim=(-4, 42), aspect="equal", ylabel="m")
    if cracks.n_segments:
        slope.legend(frameon=False, fontsize=9, loc="upper left")
    slope.spines[["top", "right"]].set_visible(False)
    slope.set_title(f"{slide.problem.title}, {table[-1, 0]:g} s", fontsize=11, loc="left")
    slip = figure.add_subplot(grid[1])
    slip.fill_between(
        table[:, 0],
        1e3 * table[:, 2],
        1e3 * table[:, 3],
        color=COMPUTED,
        alpha=0.2,
        lw=0,
        label="10 to 90 % of the blocks",
    )
    slip.plot(table[:, 0], 1e3 * table[:, 1], color=COMPUTED, lw=2, label="mean of the rock")
    slip.plot(table[:, 0], 1e3 * table[:, 5], color=INK, lw=1.6, label="on the plane")
    slip.plot(
        table[:, 0], 1e3 * slide.newmark(table[:, 0]), color=NEWMARK, lw=2, ls="--", label="Newmark (1965), rigid block"
    )
    slip.set(ylabel="slip, mm", xlim=(0, table[-1, 0]))
    slip.legend(frameon=False, fontsize=9, loc="upper left")
    record = slide.problem.loads.base.acceleration
    base = figure.add_subplot(grid[2], sharex=slip)
    base.plot(record.times, record.values[:, 0] / 9.80665, color=SOFT, lw=1)
    law = next(law for law in slide.problem.joints if law.name == PLANE)
    base.axhline(np.tan(law.friction_angle - DIP), color=NEWMARK, lw=1, ls="--")
    base.set(ylabel="base, g", xlabel="s")
    for axes in (slip, base):
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=130)
