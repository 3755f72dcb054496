"""Factors of safety by strength reduction against limit equilibrium."""

from __future__ import annotations

import numpy as np
import pytest
from block_problems import GRAVITY, WEIGHT, rectangle, turned

from geomech import dda
from geomech.dda.joint_laws.reduced_strength import reduced
from geomech.model import (
    GROUND,
    BaseMotion,
    Blocks,
    Bolt,
    DdaSettings,
    Excavation,
    History,
    JointLaw,
    Loads,
    Material,
    Roughness,
)
from geomech.reference.slopes import rock_slopes, toppling_slope

DIP = np.radians(35)
ROCK = Material("rock", 50e9, 0.0, density=2600.0)


def slab(law: JointLaw, penalty: float | None = None, loads: Loads = WEIGHT, **kwargs) -> dda.FactorOfSafety:
    """4 m along a plane that dips 35°, 2 m high, with upright sides."""
    along, up = np.array([np.cos(DIP), np.sin(DIP)]), np.array([0.0, 2.0])
    polygons = [turned(rectangle(-3, -2, 8, 0), DIP), np.array([0 * along, 4 * along, 4 * along + up, up])]
    blocks = Blocks.from_polygons(polygons, fixed=[True, False])
    return dda.factor_of_safety(blocks, [ROCK], [law], loads, DdaSettings(normal_penalty=penalty), **kwargs)


SLAB = 2600 * GRAVITY * 2 * 4 * np.cos(DIP)


@pytest.mark.parametrize("friction_deg", [20, 40, 60])
@pytest.mark.parametrize(("penalty", "time_step"), [(None, None), (5e10, 0.3), (5e13, 0.01)])
def test_plane_failure_with_friction_to_round_off(verified, friction_deg, penalty, time_step):
    """tan φ / tan α, whatever the penalty and the step: what is out of balance is A − B/F exactly, and two trials give
    it."""
    found = slab(JointLaw("plane", np.radians(friction_deg)), penalty, search=dda.FactorSearch(time_step=time_step))
    expected = rock_slopes.plane_failure_factor(SLAB, DIP, 4.0, 0.0, np.radians(friction_deg))
    print(f"φ = {friction_deg}°: {found.factor:.10f}, should be {expected:.10f}")
    verified(
        f"plane failure, friction {friction_deg}°, three penalties and steps",
        found.factor / expected - 1,
        "tan φ / tan α",
    )
    assert found.factor == pytest.approx(expected, rel=1e-9)
    assert found.lower < expected < found.upper <= found.lower * 1.002 + 1e-12
    assert found.moving == (1,) and found.mechanism[0].endswith("towards -145°")


@pytest.mark.parametrize(("friction_deg", "cohesion"), [(40, 5e3), (40, 15e3), (20, 15e3)])
def test_plane_failure_with_cohesion(verified, friction_deg, cohesion):
    # The trials bracket the factor to 0.2 %.
    law = JointLaw("plane", np.radians(friction_deg), cohesion)
    expected = rock_slopes.plane_failure_factor(SLAB, DIP, 4.0, cohesion, np.radians(friction_deg))
    found = slab(law)
    print(f"φ = {friction_deg}°, c = {cohesion / 1e3:g} kPa: {found.factor:.4f}, should be {expected:.4f}")
    verified(
        f"plane failure, friction {friction_deg}°, c = {cohesion / 1e3:g} kPa",
        None,
        "limit equilibrium",
        found=found.factor,
        exact=expected,
    )
    assert found.factor == pytest.approx(expected, rel=2e-3)


def test_plane_failure_in_an_earthquake():
    """Pseudo-static: seen from the base its acceleration is a body force; a ground that moves is none, and refused."""
    law, a = JointLaw("plane", np.radians(50)), 2.0
    record = History.constant([a, 0.0])
    found = slab(law, loads=Loads(WEIGHT.gravity, base=BaseMotion(record, "base")))
    c, s = np.cos(DIP), np.sin(DIP)
    expected = np.tan(law.friction_angle) * (GRAVITY * c - a * s) / (GRAVITY * s + a * c)
    assert found.factor == pytest.approx(expected, rel=1e-9)
    with pytest.raises(ValueError, match='frame "base"'):
        slab(law, loads=Loads(WEIGHT.gravity, base=BaseMotion(record)))


def test_plane_failure_of_a_rough_joint(verified):
    # σ tan(JRC log(JCS/σ) + φr) at the slab's mean pressure; the contacts at both ends press alike.
    law = JointLaw("rough", np.radians(28), roughness=Roughness(8.0, 40e6))
    pressure = SLAB * np.cos(DIP) / 4.0
    angle = np.radians(28 + 8.0 * np.log10(40e6 / pressure))
    found = slab(law)
    expected = np.tan(angle) / np.tan(DIP)
    print(f"rough joint: {found.factor:.5f}, should be {expected:.5f}")
    verified("plane failure of a rough joint", None, "Barton & Bandis", found=found.factor, exact=expected)
    assert found.factor == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(("steep_deg", "flat_deg", "smooth"), [(50, 15, False), (55, 20, False), (50, 15, True)])
def test_two_blocks_on_a_bilinear_plane(verified, steep_deg, flat_deg, smooth):
    """Jaeger's active and passive block (1971): all joints reduced, or the planes alone beside a smooth interface."""
    steep, flat = np.radians(steep_deg), np.radians(flat_deg)
    width, height, cut = 4.0, 6.0, 0.5
    rear, toe = width * np.tan(steep), -width * np.tan(flat)
    active = np.array(
        [[cut, cut * np.tan(steep)], [width, rear], [width, rear + 1.0], [0, height], [0, 2 * cut * np.tan(steep)]]
    )
    passive = np.array([[-width, toe], [0, 0], [0, height], [-width, toe + 1.0]])
    base = np.array(
        [[-3 * width, 3 * toe], [-3 * width, 3 * toe - 3], [2 * width, 3 * toe - 3], [2 * width, 2 * rear], [0, 0]]
    )
    blocks = Blocks.from_polygons(
        [base, active, passive], fixed=[True, False, False], edge_names=[[["base"] * 5], [[""] * 5], [[""] * 4]]
    )
    friction = np.radians(40)
    laws = [JointLaw("planes", friction), JointLaw("between", 0.0 if smooth else friction)]
    found = dda.factor_of_safety(
        blocks, [ROCK], laws, WEIGHT, joint_index=lambda a, b: 0 if "base" in (a, b) else 1,
        search=dda.FactorSearch(reduce=["planes"] if smooth else None),
    )  # fmt: skip
    weights = 2600 * GRAVITY * blocks.areas()[1:]
    limit = rock_slopes.two_block_friction((weights[0], steep), (weights[1], flat), 0.0 if smooth else None)
    expected = np.tan(friction) / np.tan(limit)
    print(f"{steep_deg}° and {flat_deg}°: {found.factor:.6f}, should be {expected:.6f}")
    # The blocks' own strain turns the interface by 1e-6.
    verified(
        f"two blocks on planes of {steep_deg}° and {flat_deg}°, {'smooth' if smooth else 'rough'} interface",
        None,
        "Jaeger 1971",
        found=found.factor,
        exact=expected,
    )
    assert found.factor == pytest.approx(expected, rel=1e-5)
    assert found.moving == (1, 2)


def test_a_column_glued_to_an_incline_topples(verified):
    # Held by the tensile strength σt at the upper edge of its base (Navier), where its weight pulls by
    # W (3 h sin α / b − cos α)/b: F = σt b / [W (3 h sin α / b − cos α)]. Brittle: no drift points at it, bisection
    # does.
    dip, width, height, strength = np.radians(25), 1.0, 4.0, 200e3
    polygons = [turned(rectangle(-3, -2, 8, 0), dip), turned(rectangle(2, 0, 2 + width, height), dip)]
    blocks = Blocks.from_polygons(polygons, fixed=[True, False])
    found = dda.factor_of_safety(blocks, [ROCK], [JointLaw("glue", np.radians(50), 1e6, strength)], WEIGHT)
    weight = 2600 * GRAVITY * width * height
    expected = strength * width / (weight * (3 * height * np.sin(dip) / width - np.cos(dip)))
    verified("column glued to an incline", None, "Navier", found=found.factor, exact=expected)
    assert found.factor == pytest.approx(expected, rel=1e-3)
    assert "turning left" in found.mechanism[0]


def test_toppling_slope_of_goodman_and_bray(verified):
    # Their limit friction is 0.7855. Coulomb friction leaves the way to it open: weakened step by step the slope goes
    # at 0.788, with its weight put on at once at 0.783.
    blocks = Blocks.from_polygons(toppling_slope.polygons(), fixed=[True] + [False] * 16)
    found = dda.factor_of_safety(
        blocks, [Material("rock", 1e12, 0.25, density=2500.0)], [JointLaw("joint", np.arctan(1.0))],
        Loads(gravity=History.constant([0.0, -10.0])),
    )  # fmt: skip
    print(f"limit tan φ = {1 / found.factor:.4f}, published {toppling_slope.LIMIT_FRICTION}")
    verified(
        "toppling slope of 16 blocks: limit tan φ",
        None,
        "Goodman & Bray 1976",
        found=1 / found.factor,
        exact=toppling_slope.LIMIT_FRICTION,
    )
    assert 1 / found.factor == pytest.approx(toppling_slope.LIMIT_FRICTION, rel=5e-3)
    # All blocks move: those at the toe slide, those behind turn.
    assert set(found.moving) >= set(range(1, 12))
    assert sum("turning left" in line for line in found.mechanism) >= 6


def test_bolts_and_excavations_count_at_their_time():
    # A slab that a block at its toe holds, and a bolt along the plane: F = W cos α tan φ / (W sin α − T).
    along, up = np.array([np.cos(DIP), np.sin(DIP)]), np.array([-np.sin(DIP), np.cos(DIP)])
    slab_at = np.array([2 * along, 4 * along, 4 * along + up, 2 * along + up])
    toe = np.array([0.5 * along, 2 * along, 2 * along + up, 0.5 * along + up])
    blocks = Blocks.from_polygons([turned(rectangle(-3, -2, 8, 0), DIP), toe, slab_at], fixed=[True, True, False])
    law, weight = JointLaw("plane", np.radians(30)), 2600 * GRAVITY * 2.0
    middle, far = 3 * along + 0.5 * up, 12 * along + 0.5 * up
    pull = 4e3
    bolt = Bolt(2, tuple(middle), GROUND, tuple(far), 1e4, pretension=pull, installation=1.0)
    dug = Excavation(2.0, (1,))
    expected = {0.5: np.inf, 3.0: np.cos(DIP) * np.tan(np.radians(30)) / (np.sin(DIP) - pull / weight)}
    for time, factor in expected.items():
        loads = Loads(gravity=WEIGHT.gravity, bolts=(bolt,), excavations=(dug,))
        found = dda.factor_of_safety(blocks, [ROCK], [law], loads, load_time=time)
        print(f"at {time:g} s: {found.factor:.5f}, should be {factor:.5f}")
        # The bolt is soft, 10 kN/m: on the 0.1 mm that the slab moves it gains 1 N.
        assert found.upper == factor if np.isinf(factor) else found.factor == pytest.approx(factor, rel=1e-3)


def test_what_cannot_fail_or_stand_is_reported():
    blocks = Blocks.from_polygons([rectangle(-5, -1, 5, 0), rectangle(0, 0, 1, 1)], fixed=[True, False])
    law = JointLaw("joint", 0.5)
    level = dda.factor_of_safety(blocks, [ROCK], [law], WEIGHT)
    assert level.upper == np.inf and "above 64" in level.table()
    with pytest.raises(ValueError, match="no friction, cohesion"):
        dda.factor_of_safety(blocks, [ROCK], [JointLaw("smooth")], WEIGHT)
    with pytest.raises(ValueError, match=r"no joint 'bed'.*'joint'"):
        dda.factor_of_safety(blocks, [ROCK], [law], WEIGHT, search=dda.FactorSearch(reduce=["bed"]))
    with pytest.raises(ValueError, match="all blocks are fixed"):
        dda.factor_of_safety(Blocks.from_polygons([rectangle(0, 0, 1, 1)], fixed=[True]), [ROCK], [law], WEIGHT)
    with pytest.raises(ValueError, match="tolerance"):
        dda.FactorSearch(tolerance=0.0)
    # A column that stands on less than its weight needs topples, whatever its friction.
    leaning = [turned(rectangle(-3, -2, 8, 0), np.radians(25)), turned(rectangle(2, 0, 3, 4), np.radians(25))]
    with pytest.raises(dda.NotConverged, match="64 times as strong"):
        dda.factor_of_safety(Blocks.from_polygons(leaning, fixed=[True, False]), [ROCK], [law], WEIGHT)


def test_reduced_laws_divide_all_that_is_strength():
    law = JointLaw("j", 0.6, 1e5, 2e4, residual_friction_angle=0.4, residual_cohesion=1e3, dilation_angle=0.2)
    half = reduced(law, 2.0)
    assert np.tan(half.friction_angle) == pytest.approx(0.5 * np.tan(0.6))
    assert np.tan(half.residual_friction_angle) == pytest.approx(0.5 * np.tan(0.4))
    assert (half.cohesion, half.tensile_strength, half.residual_cohesion) == (5e4, 1e4, 500.0)
    assert half.dilation_angle == 0.2
    assert reduced(law, 8.0).dilation_angle == pytest.approx(np.arctan(np.tan(0.6) / 8))
