"""Stress intensity factors, initiation, paths and loads of Brazilian discs, compared with published results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from geomech.ddm.fracture.criteria import maximum_tangential_stress
from geomech.model import Cracks, Cycle, whole_network
from geomech.reference.specimens import brazilian_disc as published
from geomech.report.study_part import Part


@dataclass
class Pressed:
    """Observer of one disc.

    angle_deg    between the crack and the load, at the start
    factors      (2,) |N_I|, |N_II| with the sign of N_I, before growth: K √(π R³)/(P √(a/R)) with P the force
    initiation   N/m, force at which the crack starts; ``kink_deg`` the angle at which it is driven there
    expected     N/m, the same by the published factors and the maximum tangential stress; ``expected_kink_deg``
    forces       (n,) N/m, force in every cycle in which the crack grew; ``peak`` the largest
    ends         (m, 2) m, where the crack came to the surface
    blocks       pieces of the disc at the end
    cracks       at the end, those too along which the disc was split; ``outline`` (n, 2) m of the disc
    """

    forces: list[float] = field(default_factory=list)
    ends: list[np.ndarray] = field(default_factory=list)
    factors: np.ndarray | None = None
    initiation: float = np.nan
    kink_deg: float = np.nan
    blocks: int = 1
    cracks: Cracks | None = None
    end: str = ""

    def on_start(self, problem, folder) -> None:
        blocks, cracks = problem.blocks, problem.cracks
        disc, platen = (blocks.loops(blocks.names.index(name))[0] for name in ("disc", "platen_top"))
        self.radius, self.width = float(np.hypot(*disc.T).max()), float(np.ptp(platen[:, 0]))
        along = cracks.nodes[cracks.segments[0, 1]] - cracks.nodes[cracks.segments[0, 0]]
        self.ratio = round(float(np.hypot(*along)) / 2 / self.radius, 6)
        self.angle_deg = float(np.degrees(np.arctan2(abs(along[0]), abs(along[1]))))
        self.outline, self.cracks = disc, cracks
        self.flat = float(np.ptp(disc[disc[:, 1] == disc[:, 1].max(), 0]))
        self.k_ic = problem.materials[blocks.material[blocks.names.index("disc")]].k_ic

    def on_cycle(self, cycle: Cycle) -> None:
        force = cycle.load * self.width
        if self.factors is None and force > 0:
            k = cycle.tips[["k_i", "k_ii"]].tolist()
            self.factors = np.mean(np.abs(k), axis=0) * [np.sign(k[0][0]), 1.0] / self.unit_of_k(force)
        if np.any(cycle.tips["grown"] > 0):
            if not self.forces:
                self.initiation = force
                angle, _ = maximum_tangential_stress(cycle.tips["k_i"], cycle.tips["k_ii"])
                self.kink_deg = float(np.degrees(np.abs(angle).mean()))
            self.forces.append(force)
        self.ends += [event.point for event in cycle.events if event.kind == "daylighting"]
        self.cracks = whole_network(cycle, self.cracks)
        self.blocks = sum(name.startswith("disc") for name in cycle.blocks.names)

    def on_end(self, summary, error=None) -> None:
        self.end = summary["end"]

    def unit_of_k(self, force: float) -> float:
        """K of factors 1 under ``force`` N/m, Pa √m."""
        return force * np.sqrt(self.ratio / (np.pi * self.radius))

    @property
    def reference(self) -> np.ndarray:
        """(2,) N_I and |N_II| of the crack between point loads, computed with dislocations."""
        return np.abs(k := published.normalised(published.central_crack(self.ratio, self._angle), self.ratio)) * [
            np.sign(k[0]),
            1.0,
        ]

    @property
    def series(self) -> np.ndarray:
        """(2,) the same by the series of Atkinson, Smelser & Sanchez (1982)."""
        return np.array(published.atkinson(self.ratio, self._angle))

    @property
    def expected(self) -> float:
        return self.k_ic / (self._tangential[1] * self.unit_of_k(1.0))

    @property
    def expected_kink_deg(self) -> float:
        return self._tangential[0]

    @property
    def peak(self) -> float:
        return max(self.forces, default=np.nan)

    @property
    def _angle(self) -> float:
        return np.radians(self.angle_deg)

    @property
    def _tangential(self) -> tuple[float, float]:
        n_i, n_ii = self.reference
        angle, k_eq = maximum_tangential_stress(np.array([n_i]), np.array([n_ii]))
        return float(np.degrees(abs(angle[0]))), float(k_eq[0])


def report(discs: Mapping[str, Pressed]) -> str:
    """The comparison as text."""
    known = [[name, disc.angle_deg, disc] for name, disc in discs.items() if disc.factors is not None]
    factors = Part(
        "Factors N = K √(π R³)/(P √(a/R)) before growth",
        ["run", "crack to load, °", "N_I", "series", "point loads", "N_II", "series ", "point loads ", "off, %"],
        [
            [
                name,
                f"{angle:.1f}",
                *(f"{x:.4f}" for i in (0, 1) for x in (d.factors[i], d.series[i], d.reference[i])),
                f"{100 * np.abs(d.factors - d.reference).max() / np.abs(d.reference).max():.2f}",
            ]
            for name, angle, d in known
        ],
        after=[
            (
                "Series: Atkinson, Smelser & Sanchez (1982); point loads: dislocations in the disc. Off: the larger "
                "difference of the two factors from those of point loads, over the larger factor."
            )
        ],
    )
    grown = [[name, disc] for name, disc in discs.items() if disc.forces]
    start = Part(
        "Initiation and peak",
        [
            "run",
            "P at initiation, kN/m",
            "expected",
            "off, %",
            "kink, °",
            "expected ",
            "peak P, kN/m",
            "over initiation",
        ],
        [
            [
                name,
                *(f"{x / 1e3:.1f}" for x in (d.initiation, d.expected)),
                f"{100 * (d.initiation / d.expected - 1):+.2f}",
                *(f"{x:.1f}" for x in (d.kink_deg, d.expected_kink_deg)),
                f"{d.peak / 1e3:.1f}",
                f"{d.peak / d.initiation:.3f}",
            ]
            for name, d in grown
        ],
        after=["Expected: the published factors and the maximum tangential stress (Erdogan & Sih 1963)."],
    )
    through = Part(
        "Where it came out",
        ["run", "end", "pieces", "mm from the load's diameter", "half a flat, mm"],
        [
            [name, d.end, str(d.blocks), ", ".join(f"{1e3 * p[0]:.2f}" for p in d.ends), f"{500 * d.flat:.2f}"]
            for name, d in grown
        ],
    )
    return "\n\n".join(part.text() for part in (factors, start, through))
