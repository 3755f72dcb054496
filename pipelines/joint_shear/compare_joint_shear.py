"""Shear force against shear displacement, compared with friction, the fracture load of a bridge, and its tensile
strength."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from geomech.ddm.fracture.criteria import maximum_tangential_stress
from geomech.model import Cycle
from geomech.reference.slopes import rock_bridges as published
from geomech.report.study_part import Part

MPA = 1e6

#: Forces between the halves are those of contact springs, whose compliance is the remaining difference from friction.
RESIDUAL_TOLERANCE = 1e-5
#: Tolerance with which events locate the load of K_IIc; both ends are mirror images.
TOUGHNESS_TOLERANCE, MIRROR_TOLERANCE = 2e-6, 1e-6
#: Error of the kink angle under pure shear, degrees.
KINK_TOLERANCE_DEG = 0.01
#: The strength of rocks is 6.88 K_Ic with a scatter of tens of per cent; the force falls by two thirds of the peak or
#: more when the wings have grown.
LAJTAI_TOLERANCE, FALLEN = 0.2, 0.7


@dataclass
class Sheared:
    """Observer of one test.

    rows        way of the box, m; shear force, N/m; length of the cracks, m; whether one grew: a row a cycle
    start       force at which the bridge starts to break, N/m; ``k`` (2,) K_I and K_II of its ends there (the larger of
                both)
    unlike      largest difference of K between the two ends up to then, over K
    kink_deg    the turn that the criterion of tension takes there
    pieces      blocks of rock at the end
    """

    rows: list[tuple] = field(default_factory=list)
    start: float = np.nan
    k: np.ndarray | None = None
    unlike: float = np.nan
    kink_deg: float = np.nan
    pieces: int = 1
    end: str = ""

    def on_start(self, problem, folder) -> None:
        rock = problem.blocks.names.index("rock")
        self.width = float(np.ptp(problem.blocks.loops(rock)[0][:, 0]))
        self.bridge = 2 * float(np.abs(problem.cracks.nodes[:, 0]).min())
        self.length = float(problem.cracks.lengths.sum())
        self.law = next(law for law in problem.joints if law.name == "default")
        material = problem.materials[problem.blocks.material[rock]]
        self.tears = problem.growth.criterion == "mts"
        self.k_ic = material.k_ic
        self.toughness = published.SHEAR_TO_KINK * material.k_ic if self.tears else material.k_iic

    def on_cycle(self, cycle: Cycle) -> None:
        self.normal = cycle.load
        force = cycle.statistics.get("reaction_x:box_top", 0.0)
        way = max(cycle.state.time - 1.0, 0.0) * 1e-6
        grows = bool(np.any(cycle.tips["grown"] > 0))
        self.rows.append((way, force, cycle.cracks.lengths.sum(), grows))
        if grows and self.k is None:
            k = np.column_stack([cycle.tips["k_i"], cycle.tips["k_ii"]])
            self.start, self.k = force, k[np.abs(k[:, 1]).argmax()]
            self.unlike = float(np.ptp(k, axis=0).max() / np.abs(k).max())
            angle, _ = maximum_tangential_stress(self.k[:1], self.k[1:])
            self.kink_deg = float(np.degrees(abs(angle[0])))
        self.pieces = sum(name.startswith("rock") for name in cycle.blocks.names)

    def on_end(self, summary, error=None) -> None:
        self.end = summary["end"]

    @property
    def curve(self) -> np.ndarray:
        """(n, 2) displacement, m, and force, N/m."""
        return np.array([row[:2] for row in self.rows])

    @property
    def peak(self) -> float:
        return float(self.curve[:, 1].max())

    @property
    def friction(self) -> float:
        """N tan φ, N/m."""
        return self.normal * self.width * np.tan(self.law.friction_angle)

    @property
    def residual(self) -> float:
        """Force at the end, N/m; nan if the bridge is intact."""
        return float(self.curve[-1, 1]) if self.pieces > 1 else np.nan

    @property
    def expected(self) -> float:
        """Force at the start of growth by the fracture load of a bridge between half-planes, N/m."""
        return published.direct_shear_strength(
            self.normal * self.width, self.law.friction_angle, self.bridge, self.toughness
        )

    @property
    def factor(self) -> float:
        """The bridge's share of the force relative to that of a bridge between half-planes."""
        return (self.start - self.friction) / (self.expected - self.friction)

    @property
    def tearing(self) -> float:
        """Force by Lajtai's tensile strength, for a bridge with the strength typical of rock of its toughness, N/m."""
        strength = published.STRENGTH_OVER_TOUGHNESS * self.k_ic
        bridge = published.tearing_bridge(self.normal, strength) * self.bridge
        return bridge + self.friction * (1 - self.bridge / self.width)

    def force_at(self, grown: float) -> float:
        """Largest force with cracks ``grown`` m or longer, linear between rows, N/m."""
        length, force = np.array([row[2:0:-1] for row in self.rows if row[3]]).T
        return float(np.interp(grown, (length - self.length) / 2, force))


def check(tests: Mapping[str, Sheared]) -> None:
    """AssertionError if a test misses its closed form by more than can be explained."""
    for name, test in tests.items():
        assert test.k is not None, f"{name}: the bridge has not begun to break"
        assert test.k[0] == 0, f"{name}: faces in contact have K_I = 0"
        assert test.unlike < MIRROR_TOLERANCE, f"{name}: the bridge's ends differ"
        if test.tears:
            assert abs(test.kink_deg - np.degrees(published.KINK)) < KINK_TOLERANCE_DEG, (
                f"{name}: the wings do not kink as in pure shear"
            )
            assert abs(test.peak / test.tearing - 1) < LAJTAI_TOLERANCE, f"{name}: the peak is off Lajtai's strength"
            assert test.pieces == 1, f"{name}: a bridge that fails in tension has parted"
            assert test.curve[-1, 1] < FALLEN * test.peak, f"{name}: the force does not fall as the wings grow"
        else:
            assert abs(test.k[1] / test.toughness - 1) < TOUGHNESS_TOLERANCE, (
                f"{name}: it does not fail in shear at K_IIc"
            )
            # The box keeps the specimen's ends parallel, unlike half-planes.
            assert test.expected < test.start == test.peak, (
                f"{name}: the bridge does not fail at one load, above theirs"
            )
            assert test.pieces == 2, f"{name}: the bridge has not parted"
            assert abs(test.residual / test.friction - 1) < RESIDUAL_TOLERANCE, (
                f"{name}: the residual force is not friction"
            )


def report(tests: Mapping[str, Sheared]) -> str:
    """The comparison as text."""
    known = {name: test for name, test in tests.items() if test.k is not None}
    start = Part(
        "The bridge starts to break",
        [
            "run",
            "bridge, mm",
            "σ_n, MPa",
            "force, kN/m",
            "half-planes",
            "bridge's part over theirs",
            "Lajtai",
            "kink, °",
        ],
        [
            [
                name,
                f"{1e3 * t.bridge:.1f}",
                f"{t.normal / MPA:.1f}",
                *(f"{x / 1e3:.1f}" for x in (t.start, t.expected)),
                f"{t.factor:.3f}",
                f"{t.tearing / 1e3:.1f}" if t.tears else None,
                f"{t.kink_deg:.1f}" if t.tears else "along the plane",
            ]
            for name, t in known.items()
        ],
        after=[
            (
                "Half-planes: N tan φ + K √(πb) (Tada, Paris & Irwin 2000), which the specimen tends to as its bridge "
                "gets short."
            ),
            "Lajtai (1969): the bridge's mean stress reaches its tensile strength, taken as 6.88 K_Ic (Zhang 2002).",
        ],
    )
    after = Part(
        "Then",
        ["run", "peak, kN/m", "pieces", "residual, kN/m", "N tan φ, kN/m", "end"],
        [
            [
                name,
                f"{t.peak / 1e3:.1f}",
                str(t.pieces),
                None if np.isnan(t.residual) else f"{t.residual / 1e3:.3f}",
                f"{t.friction / 1e3:.3f}",
                t.end,
            ]
            for name, t in known.items()
        ],
    )
    return "\n\n".join(part.text() for part in (start, after))
