"""Slopes at their limit: plane failure, two-block wedge, Goodman & Bray's toppling slope."""

from __future__ import annotations

import numpy as np
import pytest
from block_problems import GRAVITY, WEIGHT, march, moved, rectangle, settled, system_of, turned

from geomech import dda
from geomech.model import OPEN, History, JointLaw, Loads, Material, State, WaterTable
from geomech.reference.slopes import rock_slopes, toppling_slope


def limit(stands, low: float, high: float, steps: int = 14) -> float:
    """Where ``stands`` turns from False (at ``low``) to True (at ``high``), by bisection."""
    assert not stands(low)
    assert stands(high)
    for _ in range(steps):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if stands(middle) else (middle, high)
    return 0.5 * (low + high)


def stays(strong: dda.BlockSystem, weak: dda.BlockSystem, loads: Loads = WEIGHT, **kwargs) -> bool:
    """Whether blocks that came to rest with strong joints stay when the joints are as weak: in 0.3 s an imbalance of
    1e-4 g moves them by 40 µm; the elastic give is a few."""
    state = settled(strong, loads, **kwargs)
    end = march(weak, state, loads, 0.3, 0.02)
    return float(np.abs(moved(weak, end) - moved(weak, state)).max()) < 2e-5


DIP = np.radians(35)


def slab(law: JointLaw) -> dda.BlockSystem:
    """A slab 4 m along a plane that dips 35°, 2 m high; its sides are upright, so that its weight passes the middle of
    its base and presses both ends alike."""
    along, up = np.array([np.cos(DIP), np.sin(DIP)]), np.array([0.0, 2.0])
    block = np.array([0 * along, 4 * along, 4 * along + up, up])
    return system_of(
        [turned(rectangle(-3, -2, 8, 0), DIP), block], [law],
        rock=Material("rock", 50e9, 0.0, density=2600.0),
    )  # fmt: skip


@pytest.mark.parametrize("cohesion", [0.0, 5e3, 15e3])
def test_plane_failure_by_strength_reduction(verified, cohesion):
    """Cohesion and tan φ divided by F until the slab goes: FoS = (c A + W cos α tan φ)/(W sin α).

    The formula holds where all of the joint fails at once, as a bonded face does however unevenly its ends are loaded.
    """
    weight = 2600 * GRAVITY * 2 * 4 * np.cos(DIP)
    expected = rock_slopes.plane_failure_factor(weight, DIP, 4.0, cohesion, np.radians(40))

    def stiff(friction, c):
        return JointLaw("plane", np.arctan(friction), c)

    def stands(reduction):
        return stays(
            slab(stiff(np.tan(np.radians(60)), 1e6)),
            slab(stiff(np.tan(np.radians(40)) / reduction, cohesion / reduction)),
        )

    factor = limit(lambda f: not stands(f), 0.5, 3.0)
    print(f"c = {cohesion / 1e3:g} kPa: factor of safety {factor:.4f}, should be {expected:.4f}")
    # Bisection and threshold.
    verified(
        f"plane failure in motion, c = {cohesion / 1e3:g} kPa: factor of safety",
        None,
        "limit equilibrium",
        found=factor,
        exact=expected,
    )
    assert factor == pytest.approx(expected, rel=3e-4)


@pytest.mark.parametrize("depth", [0.6, 1.2, 1.8])
def test_plane_failure_with_water_in_the_plane_and_behind(verified, depth):
    """Water stands ``depth`` deep in a tension crack behind the slab and drains along the plane to the toe, where it
    comes out: V = ½ γw z², U = ½ γw z A (Hoek & Bray 1981). The piezometric line is straight from the crack to the
    toe."""
    weight = 2600 * GRAVITY * 2 * 4 * np.cos(DIP)
    toe, heel = np.zeros(2), 4 * np.array([np.cos(DIP), np.sin(DIP)])
    water = WaterTable(np.array([toe, heel + [0.0, depth]]), unit_weight=9810.0)
    loads = Loads(gravity=WEIGHT.gravity, water=water)
    uplift, thrust = 0.5 * 9810 * depth * 4, 0.5 * 9810 * depth**2
    expected = np.degrees(
        np.arctan(
            (weight * np.sin(DIP) + thrust * np.cos(DIP)) / (weight * np.cos(DIP) - uplift - thrust * np.sin(DIP))
        )
    )
    factor = rock_slopes.plane_failure_factor(weight, DIP, 4.0, 0.0, np.radians(expected), uplift, thrust)
    assert factor == pytest.approx(1.0)

    def stands(friction_deg):
        return stays(slab(JointLaw("strong", np.radians(75))), slab(JointLaw("plane", np.radians(friction_deg))), loads)

    found = limit(stands, 30, 70)
    print(
        f"z = {depth} m, U = {uplift / 1e3:.1f}, V = {thrust / 1e3:.1f} kN: {found:.4f}° needed, should be "
        f"{expected:.4f}°"
    )
    verified(
        f"plane failure, water {depth:g} m deep in the tension crack: friction needed",
        None,
        "Hoek & Bray 1981",
        found=found,
        exact=expected,
        unit="°",
    )
    assert found == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize(("steep_deg", "flat_deg", "interface_deg"), [(50, 15, None), (55, 20, None), (50, 15, 0.0)])
def test_two_blocks_on_a_bilinear_plane(verified, steep_deg, flat_deg, interface_deg):
    """An active block pushes a passive one across an upright joint; the friction at which both go, by bisection."""
    steep, flat = np.radians(steep_deg), np.radians(flat_deg)
    width, height = 4.0, 6.0
    rear, toe = width * np.tan(steep), -width * np.tan(flat)
    # Motion to the left: toe of the passive block at x = −width, kink at the origin, back of the active one at +width.
    # The active block's corner is cut off, or the flat plane would stop it as it goes down the steep one.
    cut = 0.5
    active = np.array(
        [[cut, cut * np.tan(steep)], [width, rear], [width, rear + 1.0], [0, height], [0, 2 * cut * np.tan(steep)]]
    )
    passive = np.array([[-width, toe], [0, 0], [0, height], [-width, toe + 1.0]])
    base = np.array(
        [[-3 * width, 3 * toe], [-3 * width, 3 * toe - 3], [2 * width, 3 * toe - 3], [2 * width, 2 * rear], [0, 0]]
    )
    names = [[["base"] * 5], [[""] * 5], [[""] * 4]]
    rock = Material("rock", 50e9, 0.0, density=2600.0)

    def system(friction_deg):
        between = friction_deg if interface_deg is None else interface_deg
        laws = [JointLaw("planes", np.radians(friction_deg)), JointLaw("between", np.radians(between))]
        return system_of(
            [base, active, passive], laws, names=names, rock=rock,
            joint_index=lambda a, b: 0 if "base" in (a, b) else 1,
        )  # fmt: skip

    weights = 2600 * GRAVITY * system(30).blocks.areas()[1:]
    interface = None if interface_deg is None else np.radians(interface_deg)
    expected = np.degrees(rock_slopes.two_block_friction((weights[0], steep), (weights[1], flat), interface))
    strong = system(steep_deg + 10)
    found = limit(
        lambda f: stays(strong, system(f), joint_index=lambda a, b: 0 if "base" in (a, b) else 1), flat_deg, steep_deg
    )
    print(f"planes of {steep_deg}° and {flat_deg}°: limit friction {found:.4f}°, should be {expected:.4f}°")
    verified(
        f"two blocks on planes of {steep_deg}° and {flat_deg}°, {'rough' if interface_deg is None else 'smooth'} interface: limit friction",
        None,
        "Jaeger 1971",
        found=found,
        exact=expected,
        unit="°",
    )
    assert found == pytest.approx(expected, abs=0.05)


TOPPLING_WEIGHT = Loads(gravity=History.constant([0.0, -10.0]))  # 25 kN/m³ are 2500 kg/m³


def toppling(friction: float, youngs_modulus: float = 1e11) -> dda.BlockSystem:
    return system_of(
        toppling_slope.polygons(), np.arctan(friction), rock=Material("rock", youngs_modulus, 0.25, density=2500.0),
        max_displacement_ratio=0.01,
    )  # fmt: skip


def creep(system: dda.BlockSystem, state: State, dt: float = 0.02) -> float:
    """Largest displacement (m) of a block between 2 and 2.5 s."""
    at = march(system, state, TOPPLING_WEIGHT, 2.0, dt)
    return float(np.abs(moved(system, march(system, at, TOPPLING_WEIGHT, 2.5, dt)) - moved(system, at)).max())


def test_toppling_slope_by_limit_equilibrium_is_as_published():
    # The printed table rounds to 0.1 kN and its row 14, 1 by a kN more.
    own = toppling_slope.limit_equilibrium(toppling_slope.LIMIT_FRICTION)
    assert own.thrust[1:] == pytest.approx(toppling_slope.PUBLISHED_P[:-1], abs=0.1)
    assert own.normal == pytest.approx(toppling_slope.PUBLISHED_R, abs=1.5)
    assert own.shear == pytest.approx(toppling_slope.PUBLISHED_S, abs=1.5)
    assert toppling_slope.limit_friction() == pytest.approx(toppling_slope.LIMIT_FRICTION, abs=1e-4)


def test_toppling_slope_stands_and_falls_at_the_published_friction():
    """0.5 % of tan φ on either side; `test_toppling_slope_limit_friction` closes in on it."""
    start = settled(toppling(1.0), TOPPLING_WEIGHT, 3)
    above, below = (creep(toppling(part * toppling_slope.LIMIT_FRICTION), start) for part in (1.005, 0.99))
    print(f"toppling slope: moves {above:.1e} m 0.5 % above the published tan φ, {below:.1e} m 1 % below")
    assert above < 1e-4
    assert below > 5e-3


@pytest.mark.slow
@pytest.mark.parametrize("youngs_modulus", [1e10, 1e11, 1e12])
def test_toppling_slope_limit_friction(verified, youngs_modulus):
    """By bisection on tan φ: 0.790, 0.7865, 0.7855 with the rock's stiffness, 0.7855 for rigid blocks."""
    start = settled(toppling(1.0, youngs_modulus), TOPPLING_WEIGHT, 3)
    found = limit(lambda f: creep(toppling(f, youngs_modulus), start) < 2e-4, 0.72, 0.9, 9)
    print(f"E = {youngs_modulus:.0e} Pa: limit tan φ = {found:.4f}, published {toppling_slope.LIMIT_FRICTION}")
    # Columns tilt by their elastic give, W/E', and their thrusts grow with it: first order in 1/E.
    verified(
        f"toppling slope of 16 blocks, E = {youngs_modulus / 1e9:g} GPa: limit tan φ",
        None,
        "Goodman & Bray 1976",
        found=found,
        exact=toppling_slope.LIMIT_FRICTION,
    )
    assert found == pytest.approx(toppling_slope.LIMIT_FRICTION, abs=1.2e-3 + 5e7 / youngs_modulus)


@pytest.mark.parametrize("friction", [0.77, 0.78])
def test_toppling_slope_just_below_its_limit_is_told_to_go(friction):
    # Its columns lean, meet and lean on for metres, in ever shorter steps, before one of them has gone a tenth of the
    # slope.
    system = toppling(friction)
    found = dda.equilibrium(system, State.at_rest(system.blocks), TOPPLING_WEIGHT)
    print(f"tan φ = {friction}: {found.reason}; {len(found.history)} steps")
    assert found.collapsed and not found.converged
    assert len(found.history) <= 80
    # The toe of three sliding blocks goes, with what topples behind it (blocks count from the base on).
    gone = np.hypot(*moved(system, found.state).T) > 0.1 * np.sqrt(system.blocks.areas())
    assert gone[1:14].all() and len(found.moving) > 3


def test_toppling_slope_carries_the_published_forces(verified):
    """R_n, S_n and the thrusts of all sixteen blocks just above the limit: the biggest, 4837 kN, to a per cent."""
    friction = 1.0015 * toppling_slope.LIMIT_FRICTION
    system = toppling(friction)
    state = march(system, settled(toppling(1.0), TOPPLING_WEIGHT, 3), TOPPLING_WEIGHT, 2.0, 0.02)
    rows = system.step(state, TOPPLING_WEIGHT, 0.02).contacts
    rows = rows[rows["state"] != OPEN]
    normal = rows["normal"]
    force = rows["normal_force"][:, None] * normal
    force += rows["shear_force"][:, None] * np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    dip = np.radians(toppling_slope.BASE_DIP_DEG)
    uphill, up = np.array([np.cos(dip), np.sin(dip)]), np.array([-np.sin(dip), np.cos(dip)])
    base, thrust = np.zeros((17, 2)), np.zeros(18)
    for block, other, f in zip(rows["block"], rows["other"], force, strict=True):
        low, high = sorted((block, other))
        f = f if block == high else -f  # on the block of the higher number
        if low == 0:
            base[high] += f @ up, f @ uphill
        else:
            thrust[high] += f @ uphill
    print("block   R, kN (published)   S, kN (published)   thrust of the block above, kN (published)")
    for n in range(1, 17):
        print(
            f"{n:5d} {base[n, 0] / 1e3:8.1f} {toppling_slope.PUBLISHED_R[n - 1]:8.1f} {base[n, 1] / 1e3:10.1f}"
            f" {toppling_slope.PUBLISHED_S[n - 1]:8.1f} {thrust[n + 1] / 1e3:12.1f} "
            f"{toppling_slope.PUBLISHED_P[n - 1]:8.1f}"
        )
    # 0.15 % of friction above the limit and 0.1 % of elastic tilt move the thrusts by 40 kN of 4837.
    published = np.column_stack([toppling_slope.PUBLISHED_R, toppling_slope.PUBLISHED_S])
    verified(
        "toppling slope: forces of up to 7662 kN under its blocks",
        np.abs(base[1:] / 1e3 - published).max(),
        "Goodman & Bray 1976",
        unit="kN",
    )
    assert base[1:, 0] / 1e3 == pytest.approx(toppling_slope.PUBLISHED_R, abs=25)
    assert base[1:, 1] / 1e3 == pytest.approx(toppling_slope.PUBLISHED_S, abs=25)
    assert thrust[2:] / 1e3 == pytest.approx(toppling_slope.PUBLISHED_P, abs=60)
