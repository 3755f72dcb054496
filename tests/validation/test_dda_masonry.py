"""Masonry that stands by its shape: arches at their limit thickness, voussoir beams; `geomech.reference.blocks.masonry`."""

from __future__ import annotations

import numpy as np
import pytest
from block_problems import GRAVITY, WEIGHT, moved, rectangle, system_of

from geomech import dda
from geomech.dda.joint_laws.penalty_springs import PENALTY_RATIO
from geomech.model import History, JointLaw, Loads, Material, State
from geomech.reference.blocks import masonry

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


def test_limit_of_many_voussoirs_is_milankovitchs(verified):
    ratios = [masonry.thinnest_arch(n) for n in (25, 50, 100)]
    print("thinnest arch of 25, 50, 100 voussoirs, t/R:", " ".join(f"{r:.5f}" for r in ratios))
    verified(
        "thinnest semicircular arch of 100 voussoirs, limit analysis: t/R",
        None,
        "Milankovitch 1907",
        found=ratios[-1],
        exact=masonry.MILANKOVITCH_RATIO,
    )
    assert ratios[-1] == pytest.approx(masonry.MILANKOVITCH_RATIO, abs=1e-4)
    assert ratios == sorted(ratios)


@pytest.mark.slow
@pytest.mark.parametrize("n", [6, 9, 12, 15, 25, 50, 100])
def test_arch_limit_by_bisection(verified, n):
    thinnest = masonry.thinnest_arch(n)
    low, high = 0.09, 0.12
    for _ in range(11):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if stands(n, middle) else (middle, high)
    print(f"{n} voussoirs: falls below t/R = {high:.5f}, limit analysis {thinnest:.5f}, Milankovitch 0.1075")
    verified(f"thinnest arch of {n} voussoirs that stands: t/R", None, "limit analysis", found=high, exact=thinnest)
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
def test_beam_of_two_blocks(verified, youngs_modulus):
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
    spring = PENALTY_RATIO * stone.plane_modulus
    thrust, sag = masonry.two_block_beam(span, thickness, weight, stone.compliance(), spring)
    got = state.contacts["normal_force"][np.isin(state.contacts["other"], (0, 1))].max()
    crown = -(state.vertices - system.blocks.vertices)[10, 1]
    rigid = masonry.three_hinge_thrust(span, thickness, weight)
    print(
        f"E = {youngs_modulus:.0e}: thrust {got / rigid:.6f} of the rigid one ({thrust / rigid:.6f}), sag {crown:.4e} "
        f"m ({sag:.4e})"
    )
    verified(f"beam of two blocks, E = {youngs_modulus / 1e9:g} GPa: thrust", got / thrust - 1, "three-hinge statics")
    # Strains enter to second order, W/E' squared, and the friction spring under the corner as W/penalty.
    strain = thrust / (thickness * youngs_modulus)
    assert got / rigid == pytest.approx(thrust / rigid, abs=60 * strain**2 + 1e-8)
    assert crown == pytest.approx(sag, rel=0.01)


def voussoir_beam(span: float, columns: int, courses: int, youngs_modulus: float) -> dda.BlockSystem:
    """A beam 1 m thick of two halves between abutments, each of ``columns`` × ``courses`` bricks glued together."""
    xs, ys = np.linspace(0, span, 2 * columns + 1), np.linspace(0, 1, courses + 1)
    polygons = [rectangle(-1, -2, 0, 3), rectangle(span, -2, span + 1, 3)]
    names = [[["abutment"] * 4]] * 2
    for i in range(2 * columns):
        for j in range(courses):
            polygons.append(rectangle(xs[i], ys[j], xs[i + 1], ys[j + 1]))
            names.append([["left" if i < columns else "right"] * 4])
    laws = [JointLaw("joint", np.radians(60)), JointLaw("glue", np.radians(60), 1e12, 1e12)]
    return system_of(
        polygons, laws, fixed=2, rock=Material("stone", youngs_modulus, 0.0, density=2500.0), names=names,
        joint_index=lambda a, b: int(a == b), dynamic_factor=0.0, max_displacement_ratio=0.02,
    )  # fmt: skip


def thrust_and_sag(system: dda.BlockSystem, span: float, gravity: float = GRAVITY) -> tuple[float, float] | None:
    """N and m, the latter of the crown's middle; None where the beam does not stand."""
    weight = Loads(gravity=History.constant([0.0, -gravity]))
    found = dda.equilibrium(system, State.at_rest(system.blocks), weight)
    crown = np.abs(system.blocks.vertices[:, 0] - span / 2) < 1e-9
    sag = -float((found.state.vertices - system.blocks.vertices)[crown, 1].mean())
    if not found.converged or sag > 0.9:
        return None
    rows = found.state.contacts
    return float(rows["normal_force"][(rows["block"] == 0) | (rows["other"] == 0)].sum()), sag


def against_sofianos(span: float, ladder: list[int]) -> list[float]:
    """Error of the thrust for halves of so many courses of square bricks."""
    errors = []
    for courses in ladder:
        thrust, sag = thrust_and_sag(voussoir_beam(span, round(span / 2 * courses), courses, 20e9), span)
        errors.append(thrust / masonry.voussoir_thrust(span, 1.0, 2500 * GRAVITY, sag) - 1)
        print(f"S/T = {span:g}, {courses} courses: thrust off by {errors[-1]:+.4f}, sag {1e3 * sag:.3f} mm")
    return errors


@pytest.mark.parametrize("span", [5.0, 10.0])
def test_thrust_of_voussoirs_that_bend_is_sofianos(verified, span):
    coarse, fine = against_sofianos(span, [2, 8])
    verified(
        f"voussoir beam, span/depth {span:g}, of 2 and 8 courses: thrust",
        [coarse, fine],
        "Sofianos 1996",
        over=("courses", (2, 8)),
    )
    # Two courses bear at their outermost corners, as if rigid: w S²/(8 T). His fit is good to some hundredths.
    assert coarse < -0.08 and abs(fine) < 0.025


@pytest.mark.slow
def test_thrust_of_voussoirs_converges_with_their_bricks():
    errors = against_sofianos(10.0, [2, 4, 6, 8, 10, 12])
    assert max(np.abs(errors[-2:])) < 0.01 and abs(errors[-1]) < abs(errors[0]) / 10


@pytest.mark.slow
def test_a_voussoir_beam_snaps_through_where_its_arch_is_too_flat():
    """Load and sag at which the arch snaps. In theory thrust grows with w ∝ z (z₀² − z²) of a fixed arm z₀; here bearing
    areas shrink as the halves rotate, and z₀, arm plus sag, grows from 0.87 to 0.96 m. The load is higher for that: by
    13 % with 8 courses, 12 % with 12 (20 % with 4, whose bricks of 0.25 m are larger than the bearing area). The sag is
    read at 99 % of the load: up to the limit, where the curve is vertical, it grows by another tenth and more."""
    span = 10.0
    system = voussoir_beam(span, 40, 8, 1e9)
    arm = 1 - 2 / 3 * masonry.voussoir_contact(span, 1.0)

    def load(z: float) -> float:
        return z * (arm**2 - z**2)

    first = thrust_and_sag(system, span)
    theory = load(arm / np.sqrt(3)) / load(arm - first[1])
    stands, falls = 0.9 * theory, 1.5 * theory
    while falls / stands > 1.005:
        trial = 0.5 * (stands + falls)
        stands, falls = (trial, falls) if thrust_and_sag(system, span, trial * GRAVITY) else (stands, trial)
    sag = thrust_and_sag(system, span, 0.99 * stands * GRAVITY)[1] / arm
    print(
        f"snaps through at {stands:.3f} of its weight, {theory:.3f} in theory; having sagged {sag:.3f} of its arm at 99 % of "
        f"that, {masonry.SNAP_THROUGH_SAG:.3f} in theory"
    )
    assert 1.05 * theory < stands < 1.2 * theory
    assert sag == pytest.approx(masonry.SNAP_THROUGH_SAG, rel=0.15)
