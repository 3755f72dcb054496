"""Masonry that stands by its shape: arches at their limit thickness, voussoir beams; `geomech.reference.masonry`."""

from __future__ import annotations

import numpy as np
import pytest
from block_problems import GRAVITY, WEIGHT, moved, rectangle, system_of

from geomech import dda
from geomech.model import Material, State
from geomech.reference import masonry

STONE = Material("stone", 1e11, 0.2, density=2500.0)
RADIUS = 10.0


def arch(n: int, ratio: float) -> dda.BlockSystem:
    """``n`` voussoirs between two fixed springings; friction of 60°, so that only hinges can form."""
    inner, outer = RADIUS * (1 - 0.5 * ratio), RADIUS * (1 + 0.5 * ratio)
    springings = [rectangle(inner, -1, outer, 0), rectangle(-outer, -1, -inner, 0)]
    return system_of(
        springings + masonry.voussoirs(n, ratio, RADIUS), np.radians(60), fixed=2, rock=STONE, dynamic_factor=0.0,
        max_displacement_ratio=0.01,
    )  # fmt: skip


def settle(system: dda.BlockSystem, steps: int) -> tuple[State, float]:
    """State after static steps of 1 s, and what still moves in the last of them: ½ a t² for blocks out of balance."""
    state = State.at_rest(system.blocks)
    for _ in range(steps):
        before = moved(system, state)
        state = system.step(state, WEIGHT, 1.0).state
    return state, float(np.abs(moved(system, state) - before).max())


def stands(n: int, ratio: float) -> bool:
    # 0.1 mm a step: 2e-5 g. Elastic shortening is over with the first step.
    return settle(arch(n, ratio), 3)[1] < 1e-4


@pytest.mark.parametrize("n", [6, 9, 12, 25, 50])
def test_arch_stands_and_falls_at_the_thickness_of_limit_analysis(n):
    thinnest = masonry.thinnest_arch(n)
    # W R/(E' t) of elastic shortening, 1e-5, lowers the line of thrust by a part 1e-4 of the thickness.
    assert stands(n, 1.002 * thinnest)
    assert not stands(n, 0.998 * thinnest)


def test_limit_of_many_voussoirs_is_milankovitchs():
    ratios = [masonry.thinnest_arch(n) for n in (25, 50, 100)]
    print("thinnest arch of 25, 50, 100 voussoirs, t/R:", " ".join(f"{r:.5f}" for r in ratios))
    assert ratios[-1] == pytest.approx(masonry.MILANKOVITCH_RATIO, abs=1e-4)
    assert ratios == sorted(ratios)


@pytest.mark.slow
@pytest.mark.parametrize("n", [6, 9, 12, 15, 25, 50, 100])
def test_arch_limit_by_bisection(n):
    thinnest = masonry.thinnest_arch(n)
    low, high = 0.09, 0.12
    for _ in range(11):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if stands(n, middle) else (middle, high)
    print(f"{n} voussoirs: falls below t/R = {high:.5f}, limit analysis {thinnest:.5f}, Milankovitch 0.1075")
    assert high == pytest.approx(thinnest, rel=2e-3)


def test_arch_falls_by_hinges_at_crown_haunches_and_springings():
    n = 50
    system = arch(n, 0.98 * masonry.MILANKOVITCH_RATIO)
    rotation = settle(system, 6)[0].rotation
    # Relative rotation at the joints; block 0 is the right springing, block 1 the left one.
    order = [0, *range(2, n + 2), 1]
    hinge = np.diff(rotation[order])
    from_crown = np.abs(90.0 - np.linspace(0, 180, n + 1))
    at = from_crown[np.abs(hinge) > 0.2 * np.abs(hinge).max()]
    print("hinges at", " ".join(f"{a:.1f}°" for a in sorted(at)), "from the crown")
    # Joints stand every 3.6°.
    haunch = at[(at > 30) & (at < 80)]
    assert len(haunch) == 2
    assert haunch == pytest.approx([masonry.MILANKOVITCH_HINGE_DEG] * 2, abs=3.6)
    assert at.min() < 3.6
    assert at.max() == 90.0


@pytest.mark.parametrize("youngs_modulus", [1e9, 1e10, 1e11])
def test_beam_of_two_blocks(youngs_modulus):
    """Thrust and sag: three-hinge statics on halves that strain; w S²/(8 T) when they are rigid."""
    span, thickness = 10.0, 1.0
    stone = Material("stone", youngs_modulus, 0.2, density=2500.0)
    halves = [rectangle(0, 0, span / 2, thickness), rectangle(span / 2, 0, span, thickness)]
    abutments = [rectangle(-1, -2, 0, 3), rectangle(span, -2, span + 1, 3)]
    system = system_of(
        abutments + halves, np.radians(60), fixed=2, rock=stone, dynamic_factor=0.0, max_displacement_ratio=0.05
    )
    state, _ = settle(system, 15)
    weight = 2500 * GRAVITY
    spring = dda.contact_springs.PENALTY_RATIO * stone.plane_modulus
    thrust, sag = masonry.two_block_beam(span, thickness, weight, stone.compliance(), spring)
    got = state.contacts["normal_force"][np.isin(state.contacts["other"], (0, 1))].max()
    crown = -(state.vertices - system.blocks.vertices)[10, 1]
    rigid = masonry.three_hinge_thrust(span, thickness, weight)
    print(
        f"E = {youngs_modulus:.0e}: thrust {got / rigid:.6f} of the rigid one ({thrust / rigid:.6f}), sag {crown:.4e} m ({sag:.4e})"
    )
    # Strains enter to second order, W/E' squared, and the friction spring under the corner as W/penalty.
    strain = thrust / (thickness * youngs_modulus)
    assert got / rigid == pytest.approx(thrust / rigid, abs=60 * strain**2 + 1e-8)
    assert crown == pytest.approx(sag, rel=0.01)
