"""Blocks on a shaken base: Newmark's sliding block, Housner's rocking block; `geomech.reference.blocks.base_shaking`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from block_problems import GRAVITY, WEIGHT, march, moved, rectangle, settled, system_of, turned

from geomech.model import BaseMotion, History, Loads, Material, State
from geomech.reference.blocks import base_shaking as exact


def shaken(times: np.ndarray, base: np.ndarray, frame: str = "base") -> Loads:
    """Weight and the ground's horizontal acceleration ``base`` (n,): seen from the base, or with a base that moves."""
    record = History(times, np.column_stack([base, np.zeros(len(times))]))
    return Loads(gravity=WEIGHT.gravity, base=BaseMotion(record, frame))


def el_centro(scale: float) -> tuple[np.ndarray, np.ndarray]:
    record = np.loadtxt(Path(__file__).parent / "el_centro_1940_ns.txt").ravel()
    return 0.02 * np.arange(len(record) + 1), scale * 9.80665 * np.append(0.0, record)


def sine(amplitude: float, frequency: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    times = np.linspace(0.0, end, round(end * 2000) + 1)
    return times, amplitude * np.sin(2 * np.pi * frequency * times)


def slid(
    incline_deg: float,
    friction_deg: float,
    times: np.ndarray,
    base: np.ndarray,
    dt: float,
    frame: str,
    **settings,
) -> np.ndarray:
    """(n, 2) time and displacement down the plane of a block that rests there when the shaking begins."""
    slope = np.radians(incline_deg)
    polygons = [turned(p, slope) for p in (rectangle(-6, -1, 6, 0), rectangle(0, 0, 1, 0.5))]
    system = system_of(
        polygons, np.radians(friction_deg), rock=Material("rock", 20e9, 0.0, density=2600.0),
        max_displacement_ratio=0.5, **settings,
    )  # fmt: skip
    state = settled(system)
    down = -np.array([np.cos(slope), np.sin(slope)])

    def place(at: State) -> float:
        base, block = moved(system, at)
        return float((block - base) @ down)

    rows = [(0.0, 0.0)]
    march(
        system, state, shaken(times, base, frame), float(times[-1]), dt,
        lambda r: rows.append((r.state.time, place(r.state) - place(state))),
    )  # fmt: skip
    return np.array(rows)


def sliding_case(name: str) -> tuple[float, float, np.ndarray, np.ndarray]:
    """Incline, friction (degrees), times and base acceleration."""
    return {
        "sine on the level": (0.0, 15.0, *sine(3.5, 2.0, 1.5)),
        "sine on an incline": (20.0, 30.0, *sine(4.0, 2.5, 1.5)),
        "El Centro on the level": (0.0, 6.0, *el_centro(1.0)),
        "El Centro on an incline": (15.0, 22.0, *el_centro(1.0)),
    }[name]


@pytest.mark.parametrize(
    ("case", "frame", "contact"),
    [
        ("sine on the level", "base", "penalty"),
        ("sine on an incline", "ground", "penalty"),
        pytest.param("sine on the level", "ground", "augmented", marks=pytest.mark.slow),
        pytest.param("sine on an incline", "ground", "augmented", marks=pytest.mark.slow),
        pytest.param("El Centro on the level", "ground", "penalty", marks=pytest.mark.slow),
        pytest.param("El Centro on an incline", "ground", "penalty", marks=pytest.mark.slow),
        pytest.param("El Centro on an incline", "ground", "augmented", marks=pytest.mark.slow),
        pytest.param("El Centro on an incline", "base", "penalty", marks=pytest.mark.slow),
    ],
)
def test_block_slides_on_a_shaken_base_as_newmark_says(verified, case, frame, contact):
    incline, friction, times, base = sliding_case(case)
    # Exact at every quarter of a millisecond: straight lines between the record's own times, 20 ms apart, are off by 0.2 %.
    fine = np.linspace(0.0, times[-1], round(times[-1] / 0.25e-3) + 1)
    expected = exact.sliding_block(fine, np.interp(fine, times, base), np.radians(incline), np.radians(friction))
    most = np.abs(expected).max()
    errors = []
    steps = (0.01, 0.0025) if "Centro" in case else (0.008, 0.002)
    for dt in steps:
        rows = slid(incline, friction, times, base, dt, frame, contact=contact)
        errors.append(np.abs(rows[:, 1] - np.interp(rows[:, 0], fine, expected)).max() / most)
    order = np.log(errors[0] / errors[1]) / np.log(steps[0] / steps[1])
    print(
        f"{case}, {frame} frame, {contact}: slips {1e3 * most:.2f} mm at most, error at dt = "
        f"{', '.join(f'{1e3 * dt:g}' for dt in steps)} ms: "
        + ", ".join(f"{e:.1e}" for e in errors)
        + f", order {order:.1f}"
    )
    verified(
        f"{case}, in the frame of the {frame}, {contact} contacts",
        errors,
        "Newmark's sliding block",
        over=("time step, ms", [1e3 * dt for dt in steps]),
    )
    # Within a step in which it stops or turns about, the block's way is off by a dt² / 8 (1e-3 at dt = 2 ms where it
    # turns about six times). On the level the record does that again and again after a few millimetres.
    assert errors[1] < {"El Centro on the level": 0.02, "El Centro on an incline": 0.002}.get(case, 1e-3)
    # There what is left at 10 ms is no more than at 2.5 ms, of turns within one step of the record: 1 % at both.
    assert order > 0.5 or (case == "El Centro on the level" and errors[0] < 0.015)


def test_the_alpha_scheme_follows_a_base_that_shakes(verified):
    incline, friction, times, base = sliding_case("sine on an incline")
    expected = exact.sliding_block(times, base, np.radians(incline), np.radians(friction))
    errors = []
    for dt in (8e-3, 2e-3):
        rows = slid(incline, friction, times, base, dt, "base", spectral_radius=0.6)
        errors.append(np.abs(rows[:, 1] - np.interp(rows[:, 0], times, expected)).max() / np.abs(expected).max())
    print(f"ϱ = 0.6: error at dt = 8, 2 ms: {errors[0]:.1e}, {errors[1]:.1e}")
    verified(
        "sine on an incline, spectral radius 0.6", errors, "Newmark's sliding block", over=("time step, ms", (8, 2))
    )
    # Second order while it slides, a dt²/8 where it stops.
    assert errors[1] < 1e-3
    assert np.log(errors[0] / errors[1]) / np.log(4) > 1.5


def rocking_block(slenderness: float, half_diagonal: float, tilt: float = 0.0):
    """A block whose lower left corner is at the origin, tilted about it; 60° of friction."""
    width, height = 2 * half_diagonal * np.sin(slenderness), 2 * half_diagonal * np.cos(slenderness)
    return system_of(
        [rectangle(-3, -1, 3, 0), turned(rectangle(0, 0, width, height), tilt)], np.radians(60),
        rock=Material("rock", 10e9, 0.0, density=2500.0),
    )  # fmt: skip


def rocked(system, state, loads, end, dt, tilt: float = 0.0) -> np.ndarray:
    """(n, 2) time and tilt."""
    rows = [(0.0, tilt)]
    march(system, state, loads, end, dt, lambda r: rows.append((r.state.time, tilt + r.state.rotation[1])))
    return np.array(rows)


def crossings(rows: np.ndarray) -> np.ndarray:
    k = np.flatnonzero(rows[:-1, 1] * rows[1:, 1] < 0)
    t, x = rows[:, 0], rows[:, 1]
    return t[k] - x[k] * (t[k + 1] - t[k]) / (x[k + 1] - x[k])


def test_rocking_references_agree():
    alpha, radius = np.radians(4), 1.5
    times = np.linspace(0, 3, 6001)
    rows = np.column_stack([times, exact.rocking(times, 0 * times, alpha, radius, start=0.6 * alpha, restitution=1.0)])
    period = exact.rocking_period(0.6 * alpha, alpha, radius)
    # Two crossings are half a period apart; Housner's period is that of small angles, 1e-3 off at 4°.
    assert 2 * np.diff(crossings(rows)) == pytest.approx(period, rel=1e-6)
    assert exact.housner_period(0.6 * alpha, alpha, radius) == pytest.approx(period, rel=2e-3)


def test_free_rocking_falls_in_a_quarter_period(verified):
    alpha, radius = np.radians(15), 1.0
    rows, errors = [], []
    for share in (0.3, 0.5, 0.8):
        tilt = share * alpha
        expected = exact.rocking_period(tilt, alpha, radius) / 4
        system = rocking_block(alpha, radius, tilt)
        first = crossings(rocked(system, State.at_rest(system.blocks), WEIGHT, 1.1 * expected + 0.02, 2e-3, tilt))[0]
        errors.append(first / expected - 1)
        rows.append(f"θ₀ = {share} α: {first:.4f} s ({expected:.4f} s)")
    print("falls back after", "; ".join(rows))
    verified(
        "free rocking from 0.3, 0.5 and 0.8 of the critical tilt: quarter period", np.abs(errors).max(), "Housner 1963"
    )
    # The step in which it lands is not cut at the landing: half of 2 ms.
    assert np.abs(errors).max() < 2e-3


def test_rocking_loses_at_impacts_what_housner_says(verified):
    """θ(t) through two impacts: each keeps 1 − 1.5 sin²α of the angular velocity; nothing is tuned."""
    alpha, radius = np.radians(15), 1.0
    tilt = 0.5 * alpha
    times = np.linspace(0, 1.5, 1501)
    expected = exact.rocking(times, 0 * times, alpha, radius, start=tilt)
    errors = []
    for dt in (8e-3, 2e-3):
        system = rocking_block(alpha, radius, tilt)
        rows = rocked(system, State.at_rest(system.blocks), WEIGHT, 1.5, dt, tilt)
        errors.append(np.abs(rows[:, 1] - np.interp(rows[:, 0], times, expected)).max() / tilt)
    order = np.log(errors[0] / errors[1]) / np.log(4)
    print(
        f"rocking through two impacts, error of θ/θ₀ at dt = 8, 2 ms: {errors[0]:.3f} {errors[1]:.3f}, order {order:.1f}"
    )
    verified("rocking through two impacts: tilt", errors, "Housner 1963", over=("time step, ms", (8, 2)))
    # A landing takes a step, and its contact gives: first order in dt, and what the elastic block keeps of the shock.
    assert errors[1] < 0.06
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.parametrize("slenderness_deg", [8, 15, 25])
def test_a_corner_lifts_at_g_tan_alpha(verified, slenderness_deg):
    alpha = np.radians(slenderness_deg)
    system = rocking_block(alpha, 1.0)
    start = settled(system)

    def stays(acceleration):
        loads = Loads(gravity=History.constant([-acceleration, -GRAVITY]))
        return abs(march(system, start, loads, 0.2, 0.02).rotation[1] - start.rotation[1]) < 2e-5

    low, high = 0.5 * GRAVITY * np.tan(alpha), 1.5 * GRAVITY * np.tan(alpha)
    assert stays(low)
    assert not stays(high)
    for _ in range(12):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stays(middle) else (low, middle)
    print(f"α = {slenderness_deg}°: rocks from {low / GRAVITY:.5f} g, tan α = {np.tan(alpha):.5f}")
    verified(
        "three slendernesses: acceleration at which a corner lifts", low / GRAVITY - np.tan(alpha), "g tan α", unit="g"
    )
    # 2e-5 rad in 0.2 s are 1.3e-4 g; what the shock of a suddenly applied load adds is as small.
    assert low == pytest.approx(exact.uplift_acceleration(alpha), abs=4e-4 * GRAVITY)


@pytest.mark.parametrize("duration", [pytest.param(0.25, marks=pytest.mark.slow), 0.5])
def test_a_pulse_overturns_as_housner_says(verified, duration):
    """A constant base acceleration that lasts for ``duration``: the least that overturns."""
    alpha, radius = np.radians(12), 1.0

    def tops(acceleration, block):
        times = np.array([0.0, duration, duration + 1e-9, 10.0])
        base = np.array([acceleration, acceleration, 0.0, 0.0])
        if block:
            system = rocking_block(alpha, radius)
            rows = rocked(system, settled(system), shaken(times, base), 3.0, 5e-3)
            return np.abs(rows[:, 1]).max() > 1.2 * alpha
        fine = np.unique(np.concatenate([np.linspace(0, 3.0, 1501), times[1:3]]))
        return np.abs(exact.rocking(fine, np.interp(fine, times, base), alpha, radius)).max() > 1.2 * alpha

    low, high = GRAVITY * np.tan(alpha), 10 * GRAVITY * alpha
    for _ in range(14):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if tops(middle, block=False) else (middle, high)
    housner = exact.overturning_pulse(duration, alpha, radius)
    print(f"pulse of {duration} s: overturns from {high / GRAVITY:.4f} g, slender block {housner / GRAVITY:.4f} g")
    verified(
        f"pulse of {duration:g} s that just overturns the rigid block, within 2 % of which the block stands and falls",
        high / housner - 1,
        "slender block, Housner 1963",
    )
    assert high == pytest.approx(housner, rel=0.05)
    # dt = 5 ms: the pulse ends with a step.
    assert not tops(0.98 * high, block=True)
    assert tops(1.02 * high, block=True)
