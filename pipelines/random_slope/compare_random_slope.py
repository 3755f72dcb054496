"""Results of the sweeps of random slopes, compared with exact and published probabilities of failure."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from geomech.reference.slopes.random_strengths import (
    HOEK_DEVIATION,
    HOEK_MEAN,
    HOEK_PROBABILITY,
    LOW_BETA,
    LOW_PROBABILITY,
    PlanarSlope,
)  # fmt: skip
from geomech.report.study_part import Part
from geomech.sweep.measures import moved_cells
from geomech.sweep.statistics import distribution, share_text, wilson

STUDIES = ("normal_strengths", "rare", "sau_mau_ping", "two_sets")
#: Strengths of the first two: (mean, standard deviation) of cohesion, Pa, and of tan φ, and their correlation.
COHESION, TANGENT, RARE_TANGENT, CORRELATION = (60e3, 9e3), (0.53, 0.05), (0.65, 0.05), -0.3
#: Tolerance of the factor of every run relative to limit equilibrium: half the requested bracket.
FACTOR_TOLERANCE = 1.5e-3

LIMITS = (
    "Friction, cohesion, crack, water and shaking are sampled from distributions that are assumed to be known; their "
    "uncertainty is not included.",
    "Two random joint sets have no exact solution: the result is the fraction of the networks that fail, with its interval.",
)


def exact(name: str) -> float:
    """The exact probability of failure of a study with normal strengths."""
    return PlanarSlope().probability(COHESION, RARE_TANGENT if name == "rare" else TANGENT, CORRELATION)


def limit_equilibrium(name: str, row: Mapping[str, Any]) -> float:
    """The factor of safety of a run of a planar study."""
    cohesion = row["joints.default.cohesion_pa"]
    if name == "sau_mau_ping":
        slope = PlanarSlope(crack=row["z"], water=row["filled"] * row["z"], shaking=row["shaking"])
        return slope.factor(cohesion, math.radians(row["joints.default.friction_angle_deg"]))
    return PlanarSlope().factor(cohesion, math.atan(row["tangent"]))


def factors_off(name: str, found: Any) -> np.ndarray:
    """(n,) relative differences of the factors of all runs from limit equilibrium."""
    done = [row for row in found.rows if row["status"] == "done"]
    return np.array([row["factor_of_safety"] / limit_equilibrium(name, row) - 1.0 for row in done])


def exact_of_samples(found: Any) -> float:
    """Fraction of the samples of the Sau Mau Ping slope that fail by limit equilibrium."""
    return float(np.mean([limit_equilibrium("sau_mau_ping", row) < 1.0 for row in found.rows]))


def check(found: Mapping[str, Any]) -> None:
    """AssertionError if a study is not as expected."""
    for name, each in found.items():
        done = [row for row in each.rows if row["status"] == "done"]
        assert len(done) >= 0.98 * len(each.rows), f"{name}: {len(each.rows) - len(done)} runs have no result"
        if name != "two_sets":
            off = np.abs(factors_off(name, each))
            assert off.max() < FACTOR_TOLERANCE, f"{name}: a factor is {off.max():.2g} off limit equilibrium"
    if "normal_strengths" in found:
        # 99.9 %: a fixed seed draws the same samples every time.
        estimate = found["normal_strengths"].probability
        low, high = wilson(estimate.failures, estimate.answered, 3.29)
        assert low < exact("normal_strengths") < high, f"{estimate}, exactly {exact('normal_strengths'):.4g}"
    if "rare" in found:
        rare = found["rare"].rare
        off = abs(rare.value / exact("rare") - 1.0)
        assert off < 3.29 * rare.variation, f"{rare}, exactly {exact('rare'):.3g}"
    if "sau_mau_ping" in found:
        estimate = found["sau_mau_ping"].probability
        low, high = wilson(estimate.failures, estimate.answered, 3.29)
        assert low < HOEK_PROBABILITY < high, f"{estimate}; published {HOEK_PROBABILITY:.3g}"
        factors = found["sau_mau_ping"].column("factor_of_safety")
        error = HOEK_DEVIATION / math.sqrt(len(factors))
        # Published to two digits.
        assert abs(np.nanmean(factors) - HOEK_MEAN) < 0.005 + 3.29 * error
        assert abs(np.nanstd(factors) - HOEK_DEVIATION) < 0.005 + 3.29 * error / math.sqrt(2.0)
    if "two_sets" in found:
        kinds = {row.get("mechanism") for row in found["two_sets"].rows}
        assert "sliding" in kinds, f"mechanisms {kinds}"


def report(found: Mapping[str, Any]) -> str:
    """The comparison as text."""
    rows = []
    for name, each in found.items():
        estimate = each.probability
        value = f"{each.rare.value:.3g}" if each.rare else share_text(estimate.value)
        low, high = each.rare.interval if each.rare else (estimate.low, estimate.high)
        interval = f"{low:.2g} to {high:.2g}" if each.rare else f"{share_text(low)} to {share_text(high)}"
        against = {
            "sau_mau_ping": f"{share_text(HOEK_PROBABILITY)} (Hoek 2007), {share_text(LOW_PROBABILITY)} (Low "
            f"2007, β = {LOW_BETA})"
        }
        exactly = (
            f"{exact(name):.3g} (exact)"
            if name == "rare"
            else f"{share_text(exact(name))} (exact)"
            if name == "normal_strengths"
            else ""
        )
        off = "" if name == "two_sets" else f"{np.abs(factors_off(name, each)).max():.1e}"
        rows.append((name, len(each.rows), value, interval, against.get(name, exactly), off))
    headers = ("study", "runs", "fails", "95 %", "against", "factors off")
    after = list(LIMITS)
    if "sau_mau_ping" in found:
        factors = found["sau_mau_ping"].column("factor_of_safety")
        after.insert(0, (
            f"Sau Mau Ping: factor of safety {np.nanmean(factors):.3f} ± {np.nanstd(factors):.3f}, published "
            f"{HOEK_MEAN} ± "
            f"{HOEK_DEVIATION}; of the same samples limit equilibrium has "
            f"{share_text(exact_of_samples(found['sau_mau_ping']))} fail."
        ))  # fmt: skip
    if "two_sets" in found:
        kinds = Counter(row.get("mechanism") or row["status"] for row in found["two_sets"].rows)
        after.insert(
            0, "Two joint sets: " + ", ".join(f"{number} {kind}" for kind, number in kinds.most_common()) + "."
        )
    return Part("Probability of failure", headers, rows, (), after).text()


def draw(found: Mapping[str, Any], file: Path) -> None:
    """Factors of the Sau Mau Ping slope, the probability of failure with normal strengths against the number of runs,
    and the places where slopes with two random sets move."""
    from matplotlib.figure import Figure

    ink, accent, band, fails = "#2f3136", "#1f6f8b", "#cfe0e6", "#c8553d"
    shown = [name for name in ("sau_mau_ping", "normal_strengths", "two_sets") if name in found]
    if not shown:
        return
    figure = Figure(figsize=(0.6 + 3.9 * len(shown), 3.9), dpi=120, layout="constrained")
    panels = dict(zip(shown, figure.subplots(1, len(shown), squeeze=False)[0], strict=True))
    left, middle, right = (panels.get(name) for name in ("sau_mau_ping", "normal_strengths", "two_sets"))
    if "sau_mau_ping" in found:
        values, shares, half = distribution(found["sau_mau_ping"].column("factor_of_safety"))
        left.fill_between(
            values, np.clip(shares - half, 0, 1), np.clip(shares + half, 0, 1), color=band, lw=0, label="95 % band"
        )
        left.plot(values, shares, color=accent, lw=1.6, label="computed")
        exactly = np.sort([limit_equilibrium("sau_mau_ping", row) for row in found["sau_mau_ping"].rows])
        left.plot(
            exactly, (np.arange(len(exactly)) + 0.5) / len(exactly), color=ink, lw=1, ls=":", label="limit equilibrium"
        )
        left.plot([1.0], [HOEK_PROBABILITY], "D", ms=7, mfc="white", mec=fails, mew=1.6, label="Hoek (2007)")
        left.axvline(1.0, color=fails, lw=1, ls="--")
        left.set(xlabel="factor of safety", ylabel="share of runs below", xlim=(0.6, 2.1), ylim=(0, 1))
        left.legend(frameon=False, fontsize=8, loc="lower right")
        left.set_title("Sau Mau Ping slope", fontsize=10)
    if "normal_strengths" in found:
        from geomech.sweep.statistics import convergence

        table = convergence(found["normal_strengths"].rows)
        middle.fill_between(table[:, 0], 100 * table[:, 2], 100 * table[:, 3], color=band, lw=0, label="95 % (Wilson)")
        middle.plot(table[:, 0], 100 * table[:, 1], color=accent, lw=1.6, label="computed")
        middle.axhline(100 * exact("normal_strengths"), color=ink, lw=1.2, ls=":", label="exact")
        middle.set(xlabel="runs", ylabel="probability of failure, %", ylim=(0, 400 * exact("normal_strengths")))
        middle.legend(frameon=False, fontsize=8)
        middle.set_title("Normal strengths", fontsize=10)
    if "two_sets" in found:
        each = found["two_sets"]
        rows = [row for row in each.rows if row.get("_places")]
        shares = np.mean([moved_cells(row["_places"], each.plan.cells) for row in rows], axis=0)
        x0, y0, x1, y1 = each.plan.box
        # Matplotlib draws images below areas: the rock must be lower still.
        right.fill([0, 60, 60, 42, 30, 0], [0, 0, 20, 20, 40, 40], color="#efe6d5", zorder=-1)
        image = right.imshow(
            np.ma.masked_where(shares <= 0, 100 * shares),
            extent=(x0, x1, y0, y1),
            origin="lower",
            cmap="YlOrRd",
            vmin=0,
        )
        right.plot([0, 60, 60, 42, 30, 0, 0], [0, 0, 20, 20, 40, 40, 0], color=ink, lw=1)
        right.set(xlim=(-2, 62), ylim=(-2, 42), aspect="equal", xlabel="m")
        figure.colorbar(image, ax=right, shrink=0.7, label="% of networks in which it moves")
        right.set_title("Two random joint sets", fontsize=10)
    for axes in panels.values():
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=8)
    figure.savefig(file, facecolor="white")
