"""Wing cracks as they grew, beside what closed forms say of them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from geomech.ddm.criteria import maximum_tangential_stress
from geomech.model import Cycle
from geomech.reference import single_flaw as published

MPA = 1e6
#: Wing lengths that the report lists, in half-lengths of the flaw.
LISTED = (0.2, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)

#: What the report says of itself.
LIMITS = """\
What this does and does not say
  - The closed forms are for flaws whose faces slide, in an infinite plane; this flaw is an open slot over a
    third of the width. They share the fall of K_I with length (stable growth), not its size; from where the
    wings are as far from the ends as the specimen is wide, K_I rises again and they part from them.
  - The load at which wings run to the ends belongs to ends under uniform stress: a block with one strain gives
    its ends no resistance to bending open, as stiff platens would. LEFM then leaves a last ligament of the
    order of an increment standing up to higher loads, so the load of daylighting depends on the increment.
  - Published pictures (wings that turn into the load's direction) agree in kind only: no numbers are printed."""


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
    _open: tuple | None = None

    def on_start(self, problem, folder) -> None:
        self.height = float(np.ptp(problem.blocks.loops(int(problem.cracks.block[0]))[0][:, 1]))

    def on_cycle(self, cycle: Cycle) -> None:
        self.curve.append((cycle.strain, cycle.load))
        self.events += cycle.events
        tips = cycle.tips[cycle.tips["end"] == 1]
        if self._open is not None:
            # Where the last step went is known once it has been made; a wing that reached the surface has no tip.
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
        """Rows, in order of wing length, at which the load had to rise further than ever for the wing to grow."""
        return np.flatnonzero(self.load > np.r_[-np.inf, np.maximum.accumulate(self.load)[:-1]])

    @property
    def arrested(self) -> float:
        """Length of the wing that the first burst left, m; nan when the wing never stopped."""
        return float(self.wing[self.stable[1]]) if len(self.stable) > 1 else np.nan

    @property
    def run_off(self) -> int:
        """The row of the load under which the wing then ran furthest: the last stable one before the longest burst
        that ends near the specimen's end."""
        long_enough = self.stable[self.wing[self.stable] > 0.25 * self.height] if len(self.stable) else self.stable
        if not len(long_enough):
            return len(self.load) - 1
        bursts = np.diff(np.r_[long_enough, len(self.load)])
        return int(long_enough[np.argmax(bursts)])

    def factor(self, wing: float) -> float:
        """K_I/σ, √m, when the wing was ``wing`` m long, between rows linearly; nan beyond them."""
        return float(np.interp(wing, self.wing, self.k[:, 0] / self.load, left=np.nan, right=np.nan))

    def tangent_modulus(self) -> float:
        """Axial stress over strain before the first growth, Pa."""
        strain, load = np.array(self.curve).T
        before = load < self.load[0] if len(self.load) else np.ones(len(load), bool)
        before &= load > 0
        return float(np.polyfit(strain[before], load[before], 1)[0])


def report(wings: Wings) -> str:
    """The comparison as text."""
    if not len(wings.load):
        return f"No tip grew ({wings.end}); modulus {wings.tangent_modulus() / 1e9:.2f} GPa."
    return "\n\n".join([_first_step(wings), _growth(wings), _lengths(wings), _stiffness(wings), LIMITS])


def _first_step(wings: Wings) -> str:
    k = np.abs(wings.k[0]) / wings.load[0]
    angle, k_eq = maximum_tangential_stress(wings.k[:1, 0], wings.k[:1, 1])
    plane, factor = published.open_slot_in_plane(), published.secant_correction()
    plane_angle, _ = maximum_tangential_stress(np.array([-plane[0]]), np.array([plane[1]]))
    plane_kink = np.degrees(abs(plane_angle[0]))
    predicted = published.K_IC * wings.load[0] / k_eq[0]
    return "\n".join(
        [
            "Initiation (open slot: K_I < 0, the faces approach)",
            "                 computed    this plate, order 8    infinite plane    the same × √sec(πa cos β/W)",
            *(
                f"  |{name}|/σ √m{' ' * (5 - len(name))} {ours:8.5f}    {theirs:19.5f}    {p:14.5f}    {p * factor:10.5f}"
                for name, ours, theirs, p in zip(("K_I", "K_II"), k, published.OPEN_SLOT, plane)
            ),
            f"  kink, degrees  {np.degrees(abs(angle[0])):8.2f}    {published.KINK_DEG:19.2f}    {plane_kink:14.2f}",
            f"  load {wings.load[0] / MPA:.2f} MPa; K_eq reaches K_Ic at {predicted / MPA:.2f} MPa",
        ]
    )


def _growth(wings: Wings) -> str:
    last = wings.run_off
    risen = wings.load[wings.stable]
    to_end = wings.height / 2 - wings.tip[last, 1]
    load, mm = wings.load[[0, last]] / MPA, np.array([wings.arrested, wings.wing[last], to_end]) * 1e3
    shear = np.abs(wings.k[1:, 1] / wings.k[1:, 0]).max() if len(wings.k) > 1 else np.nan
    lines = [
        "Growth",
        f"  the first burst, at {load[0]:.1f} MPa, leaves wings of {mm[0]:.0f} mm",
        f"  then each increment needs a higher load, {len(risen) - 1} times over",
        f"  at {load[1]:.1f} MPa, {mm[1]:.0f} mm long and {mm[2]:.0f} mm from the specimen's ends, they run on at that load",
        f"  direction there {wings.direction[last]:.2f} degrees from the load; |K_II|/K_I at most {shear:.3f} after the kink",
        f"  how the run ended: {wings.end}",
    ]
    return "\n".join(lines)


def _lengths(wings: Wings) -> str:
    lines = [
        "K_I/σ of the wings, √m, beside those of closed, frictionless flaws in an infinite plane",
        "  l/a    computed    Horii & Nemat-Nasser    ratio    Ashby & Hallam    ratio",
    ]
    a = published.HALF_LENGTH
    for ratio in LISTED:
        ours = wings.factor(ratio * a)
        if np.isnan(ours):
            continue
        h, s = float(published.wing_horii_nemat_nasser(ratio * a)), float(published.wing_ashby_hallam(ratio * a))
        lines.append(f"  {ratio:<4.1f} {ours:10.4f}    {h:20.4f}    {ours / h:5.2f}    {s:14.4f}    {ours / s:5.2f}")
    return "\n".join(lines)


def _stiffness(wings: Wings) -> str:
    return (
        f"Stiffness before growth {wings.tangent_modulus() / 1e9:.2f} GPa; plane strain with one small open slot "
        f"{published.tangent_modulus() / 1e9:.2f} GPa"
    )
