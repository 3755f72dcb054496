"""Wing cracks during growth, compared with closed forms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from geomech.ddm.fracture.criteria import maximum_tangential_stress
from geomech.model import Cycle
from geomech.reference.specimens import single_flaw as published
from geomech.report.study_part import Part

MPA = 1e6
#: Wing lengths that the report lists, in half-lengths of the flaw.
LISTED = (0.2, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)

#: Remarks on the comparison.
LIMITS = (
    """The closed forms are for flaws with sliding faces in an infinite plane; this flaw is an open slot over a third of the
    width. The decrease of K_I with length (stable growth) is the same, its magnitude is not. Once the distance of the wings
    from the ends is less than the specimen's width, K_I rises again, unlike in the closed forms.""",
    """The load at which wings run to the ends is that for ends under uniform stress: a block of uniform strain has no
    resistance to bending at its ends, unlike one between stiff platens. At this load the wings grow through to the ends:
    the load of daylighting is that of the last stable increment.""",
    "Published pictures (wings that turn into the direction of the load) agree qualitatively; no numbers are printed.",
)


@dataclass
class Wings:
    """Observer of the wing from the flaw's right end: a row for every cycle in which it grew.

    load       (n,) Pa, axial stress
    wing       (n,) m, its length before it grew
    tip        (n, 2) m
    k          (n, 2) K_I and K_II there, Pa √m
    k_eq       (n,) of the criterion
    direction  (n,) degrees from the load's axis, along the segment it then grew
    """

    rows: list[tuple] = field(default_factory=list)
    curve: list[tuple[float, float]] = field(default_factory=list)  # strain, load
    events: tuple = ()
    height: float = np.nan
    end: str = ""
    last: Cycle | None = None
    _open: tuple | None = None

    def on_start(self, problem, folder) -> None:
        self.height = float(np.ptp(problem.blocks.loops(int(problem.cracks.block[0]))[0][:, 1]))

    def on_cycle(self, cycle: Cycle) -> None:
        if cycle.cracks.n_segments:  # what is cut through is an edge of blocks from then on
            self.last = cycle
        self.curve.append((cycle.strain, cycle.load))
        self.events += cycle.events
        tips = cycle.tips[cycle.tips["end"] == 1]
        if self._open is not None:
            # The direction of the last step is known only after it; a wing that has reached the surface has no tip.
            step = tips["point"][0] - self._open[2] if len(tips) else (np.nan, np.nan)
            self.rows.append((*self._open, float(np.degrees(np.arctan2(step[0], step[1])))))
            self._open = None
        if len(tips) and tips["grown"][0] > 0:
            tip = tips[0]
            cracks = cycle.cracks
            # Both wings belong to the flaw's own crack; the right one's segments lie after those that were drawn.
            drawn = np.flatnonzero(cracks.birth_cycle == 0)[-1]
            wing = cracks.lengths[drawn + 1 :].sum()
            self._open = cycle.load, wing, tip["point"].copy(), (tip["k_i"], tip["k_ii"]), float(tip["k_eq"])

    def on_end(self, summary, error=None) -> None:
        self.end = summary["end"]
        load, wing, tip, k, k_eq, direction = zip(*self.rows) if self.rows else [[]] * 6
        self.load, self.wing, self.k_eq, self.direction = (
            np.array(x, dtype=float) for x in (load, wing, k_eq, direction)
        )
        self.tip, self.k = np.array(tip).reshape(-1, 2), np.array(k).reshape(-1, 2)

    @property
    def stable(self) -> np.ndarray:
        """Rows, in order of wing length, at which the load had to exceed all earlier loads for the wing to grow."""
        return np.flatnonzero(self.load > np.r_[-np.inf, np.maximum.accumulate(self.load)[:-1]])

    @property
    def arrested(self) -> float:
        """Length of the wing after the first unstable growth, m; nan if the wing never arrested."""
        return float(self.wing[self.stable[1]]) if len(self.stable) > 1 else np.nan

    @property
    def run_off(self) -> int:
        """Row of the load with the longest unstable growth of the wing: the last stable row before it, if it ends near
        the specimen's end."""
        long_enough = self.stable[self.wing[self.stable] > 0.25 * self.height] if len(self.stable) else self.stable
        if not len(long_enough):
            return len(self.load) - 1
        bursts = np.diff(np.r_[long_enough, len(self.load)])
        return int(long_enough[np.argmax(bursts)])

    def factor(self, wing: float) -> float:
        """K_I/σ, √m, at a wing length of ``wing`` m, linear between rows; nan outside them."""
        return float(np.interp(wing, self.wing, self.k[:, 0] / self.load, left=np.nan, right=np.nan))

    def tangent_modulus(self) -> float:
        """Axial stress over strain before the first growth, Pa."""
        strain, load = np.array(self.curve).T
        before = load < self.load[0] if len(self.load) else np.ones(len(load), bool)
        before &= load > 0
        return float(np.polyfit(strain[before], load[before], 1)[0])


def parts(wings: Wings) -> list[Part]:
    """The comparison in parts."""
    if not len(wings.load):
        return [Part(f"No tip grew ({wings.end}); modulus {wings.tangent_modulus() / 1e9:.2f} GPa")]
    limits = Part("Limits of the comparison", before=[" ".join(words.split()) for words in LIMITS])
    return [_first_step(wings), _growth(wings), _lengths(wings), _stiffness(wings), limits]


def report(wings: Wings) -> str:
    """The comparison as text."""
    return "\n\n".join(part.text() for part in parts(wings))


def _first_step(wings: Wings) -> Part:
    k = np.abs(wings.k[0]) / wings.load[0]
    angle, k_eq = maximum_tangential_stress(wings.k[:1, 0], wings.k[:1, 1])
    plane, factor = published.open_slot_in_plane(), published.secant_correction()
    plane_angle, _ = maximum_tangential_stress(np.array([-plane[0]]), np.array([plane[1]]))
    rows = [
        [f"|{name}|/σ, √m", *(f"{value:.5f}" for value in (computed, reference, p, p * factor))]
        for name, computed, reference, p in zip(("K_I", "K_II"), k, published.OPEN_SLOT, plane)
    ]
    kinks = [np.degrees(abs(angle[0])), published.KINK_DEG, np.degrees(abs(plane_angle[0]))]
    rows.append(["kink, degrees", *(f"{kink:.2f}" for kink in kinks), None])
    predicted = published.K_IC * wings.load[0] / k_eq[0]
    return Part(
        "Initiation",
        ["", "computed", "this plate, order 8", "infinite plane", "the same × √sec(πa cos β/W)"],
        rows,
        ["An open slot: K_I < 0, the faces approach."],
        [f"Load {wings.load[0] / MPA:.2f} MPa; K_eq reaches K_Ic at {predicted / MPA:.2f} MPa."],
    )


def _growth(wings: Wings) -> Part:
    last = wings.run_off
    to_end = wings.height / 2 - wings.tip[last, 1]
    load, mm = wings.load[[0, last]] / MPA, np.array([wings.arrested, wings.wing[last], to_end]) * 1e3
    opened = wings.k[1:][wings.k[1:, 0] > 0]
    shear = np.abs(opened[:, 1] / opened[:, 0]).max() if len(opened) else np.nan
    words = (
        f"The first unstable growth, at {load[0]:.1f} MPa, leaves wings of {mm[0]:.0f} mm; then each increment needs a higher "
        f"load, {len(wings.stable) - 1} times over. At {load[1]:.1f} MPa, {mm[1]:.0f} mm long and {mm[2]:.0f} mm from "
        f"the specimen's ends, they run on at that load, {wings.direction[last]:.2f} degrees from the load's "
        f"direction; |K_II|/K_I is at most {shear:.3f} after the kink. The run ended: {wings.end}."
    )
    return Part("Growth", before=[words])


def _lengths(wings: Wings) -> Part:
    a, rows = published.HALF_LENGTH, []
    for ratio in LISTED:
        computed = wings.factor(ratio * a)
        if np.isnan(computed):
            continue
        h, s = float(published.wing_horii_nemat_nasser(ratio * a)), float(published.wing_ashby_hallam(ratio * a))
        rows.append(
            [f"{ratio:.1f}", f"{computed:.4f}", f"{h:.4f}", f"{computed / h:.2f}", f"{s:.4f}", f"{computed / s:.2f}"]
        )
    return Part(
        "K_I/σ of the wings, √m",
        ["l/a", "computed", "Horii & Nemat-Nasser", "ratio", "Ashby & Hallam", "ratio "],
        rows,
        ["Compared with those of closed, frictionless flaws in an infinite plane."],
    )


def _stiffness(wings: Wings) -> Part:
    return Part(
        "Stiffness before growth",
        before=[
            (
                f"{wings.tangent_modulus() / 1e9:.2f} GPa; plane strain with one small open slot "
                f"{published.tangent_modulus() / 1e9:.2f} GPa."
            )
        ],
    )


def settings(runs: Mapping[str, Wings]) -> Part:
    """Several runs side by side: the effect of settings."""
    rows = [
        [
            name,
            f"{wings.load[0] / MPA:.2f}",
            f"{1e3 * wings.arrested:.1f}",
            *(f"{wings.factor(ratio * published.HALF_LENGTH):.4f}" for ratio in (1.0, 3.0)),
            f"{wings.load[wings.run_off] / MPA:.2f}",
            wings.end,
        ]
        for name, wings in runs.items()
        if len(wings.load)
    ]
    headers = [
        "run",
        "initiation, MPa",
        "first burst, mm",
        "K_I/σ, l = a, √m",
        "l = 3a",
        "runs to the ends, MPa",
        "end",
    ]
    return Part("Settings: increments, faces, the paper's", headers, rows)
