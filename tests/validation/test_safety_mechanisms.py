"""Factors of safety where blocks would move to find their equilibrium, toes stick in corners, bonds break one after the
other and anchors have to be stretched: against limit equilibrium, mirrored and turned."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from block_problems import GRAVITY, WEIGHT, rectangle, turned

from geomech import dda
from geomech.model import (
    GROUND,
    BlockMotion,
    Blocks,
    Bolt,
    DdaSettings,
    EdgeTraction,
    History,
    JointLaw,
    Loads,
    Material,
    State,
)
from geomech.reference.slopes import rock_slopes

ROCK = Material("rock", 20e9, 0.25, density=2600.0)
GEOMETRY = Path(__file__).parents[2] / "geometry"


def drawn(polygons, turn: float = 0.0, mirror: bool = False) -> tuple[Blocks, Loads]:
    """The first of the ``polygons`` fixed, all of them turned (rad) with the weight, or mirrored."""
    c, s = math.cos(turn), math.sin(turn)
    moved = []
    for polygon in polygons:
        points = np.asarray(polygon, float)
        points = points[::-1] * [-1.0, 1.0] if mirror else points
        moved.append(points @ np.array([[c, s], [-s, c]]))
    blocks = Blocks.from_polygons(moved, fixed=[True] + [False] * (len(polygons) - 1))
    return blocks, Loads(gravity=History.constant([s * GRAVITY, -c * GRAVITY]))


# One plane at 35° that daylights ``drop`` above a floor.
DIP = math.radians(35)


def above_a_floor(drop: float, **way) -> tuple[Blocks, Loads]:
    crest, floor = 50.0 / math.tan(DIP), [(0.0, -drop)] if drop else []
    base = [(-30, -drop), (-30, -15 - drop), (90, -15 - drop), (90, 50), (crest, 50), (0, 0), *floor]
    return drawn([base, [(0, 0), (crest, 50), (36.87, 50), (22.43, 25), (14.43, 25)]], **way)


@pytest.mark.parametrize(
    ("drop", "way"),
    [
        (0.0, {}),
        (0.0, {"mirror": True}),
        (0.01, {"turn": 0.3}),
        (0.1, {}),
        (0.5, {}),
        (0.7, {"mirror": True}),
        (3.0, {}),
    ],
)
def test_a_floor_below_the_plane_holds_nothing(verified, drop, way):
    blocks, loads = above_a_floor(drop, **way)
    found = dda.factor_of_safety(blocks, [ROCK], [JointLaw("plane", math.radians(30))], loads)
    expected = math.tan(math.radians(30)) / math.tan(DIP)
    print(f"drop {drop} m: {found.factor:.5f}, should be {expected:.5f}; {found.warnings}")
    verified(
        f"plane {drop:g} m above a floor; as drawn, mirrored, turned", found.factor / expected - 1, "tan φ / tan α"
    )
    assert found.factor == pytest.approx(expected, rel=1e-6)
    # Its toe touches the floor where it is drawn so: rounded, it holds nothing, and what its tip would hold is told.
    assert len(found.toes) == (drop == 0.0) and not found.toes_hold
    if not drop:
        assert found.other_factor > 2.0 and "toe of 'block 1'" in found.warnings[0]


def test_sharp_toes_hold_where_corners_are_not_rounded_and_are_named():
    blocks, loads = above_a_floor(0.0)
    law, settings = JointLaw("plane", math.radians(30)), DdaSettings(corner_rounding=0.0)
    found = dda.factor_of_safety(blocks, [ROCK], [law], loads, settings)
    assert found.toes_hold and found.factor > 2.0
    assert found.other_factor == pytest.approx(math.tan(math.radians(30)) / math.tan(DIP), rel=1e-6)
    assert "x = 0, y = 0 m and holds" in found.warnings[0] and "without it the factor is 0.8245" in found.warnings[0]
    assert found.as_dict(blocks)["factor_without_toes"] == found.other_factor


@pytest.mark.parametrize("dynamic", [False, True])
def test_runs_name_sharp_toes_that_hold(caplog, dynamic):
    """tan 30°/tan 35°: the block should slide. Its tip in the corner of plane and floor holds it; a floor lower down does not."""
    settings = DdaSettings(time_step=0.01, dynamic_factor=float(dynamic))

    def warned(drop, end):
        blocks, loads = above_a_floor(drop)
        caplog.clear()
        law = JointLaw("plane", math.radians(30))
        *_, last = dda.run(blocks, [ROCK], [law], loads, settings, end)
        moved = np.hypot(*(last.vertices - blocks.vertices).T).max()
        return moved, [text for text in caplog.messages if "as sharp as drawn" in text]

    moved, (line,) = warned(0.0, 0.3)
    assert moved < 1e-3 and "the toe of 'block 1' touches 'block 0' at x = 0, y = 0 m" in line
    moved, lines = warned(0.5, 0.3)
    assert moved > 1e-3 and not lines


@pytest.mark.first_by_default(2)
@pytest.mark.parametrize(("drop", "friction_deg"), [(0.5, 30), (0.5, 40), (60.0, 30), (0.0, 30)])
def test_how_far_a_failed_block_goes_is_reported(drop, friction_deg):
    """Down a plane at 35° to a floor: drop/sin 35° with a sharp tip; farther by its rounding, by which the toe stands off;
    on, with no floor within the block's size."""
    blocks, loads = above_a_floor(drop)
    law = JointLaw("plane", math.radians(friction_deg))
    found = dda.factor_of_safety(blocks, [ROCK], [law], loads)
    # At its strength if it does not stand with that, else at 5 % less than it needs.
    assert found.travels_at == pytest.approx(max(1.0, 1.05 * found.upper))
    way, size = found.travel, math.sqrt(blocks.areas()[1])
    print(found.travel_text())
    if drop > 1.0:
        assert not way.rests and size < way.moved[1] < 1.5 * size and "they go on" in found.table()
        return
    # The toe of 25° is rounded over a hundredth of the block's size; its bisector is 47.5° from the floor's normal.
    half, off = math.radians(12.5), 0.01 * size
    off *= math.cos(math.radians(90 - 47.5)) / math.cos(half) - math.tan(half)
    assert way.rests and way.moved[1] == pytest.approx((drop + off) / math.sin(DIP), rel=5e-3) and way.moved[0] < 1e-9
    assert "on a rounded corner" in found.travel_text()
    if drop:
        assert found.sharp_travel == pytest.approx(drop / math.sin(DIP), rel=5e-3)
    told = found.as_dict(blocks)
    assert told["travel"]["comes_to_rest"] and told["moving"]["block 1"]["travel_m"] == way.moved[1]
    assert dda.factor_of_safety(blocks, [ROCK], [law], loads, search=dda.FactorSearch(follow=False)).travel is None


def test_what_lands_on_a_floor_is_no_equilibrium():
    blocks, loads = above_a_floor(0.5)
    system = dda.BlockSystem(blocks, [ROCK], [JointLaw("plane", math.radians(30))])
    found = dda.equilibrium(system, State.at_rest(blocks), loads)
    assert found.collapsed and not found.converged and found.moving == (1,)
    assert found.moved[1] == pytest.approx(0.5 / math.sin(DIP), abs=1e-3)
    assert "come to rest 0.872 m farther" in found.reason and "'block 1'" in found.reason
    # A block that is drawn above what it comes to lie on first falls: that is no sliding.
    held = dda.BlockSystem(blocks, [ROCK], [JointLaw("plane", math.radians(40))])
    assert dda.equilibrium(held, State.at_rest(blocks), loads).converged


def test_soft_rock_may_settle_by_what_elasticity_explains():
    # Thirty metres of rock of 20 MPa: the upper face sinks by ρ g H²/2E', a thousandth of H and more.
    soft = Material("soft", 20e6, 0.0, density=2600.0)
    blocks = Blocks.from_polygons([rectangle(-20, -5, 20, 0), rectangle(-5, 0, 5, 30)], fixed=[True, False])
    found = dda.equilibrium(dda.BlockSystem(blocks, [soft], [JointLaw("joint", 0.5)]), State.at_rest(blocks), WEIGHT)
    assert found.converged and found.moved[1] > 0.01 * 30


def test_the_planar_slope_of_the_gallery_agrees_with_its_comment():
    pytest.importorskip("gmsh")
    from geomech import factor_of_safety

    found = factor_of_safety(GEOMETRY / "planar_slope.toml")
    assert found.factor == pytest.approx(math.tan(math.radians(37)) / math.tan(DIP), rel=1e-3)
    assert any("toe of 'rock 1' touches 'base'" in line for line in found.warnings)


@pytest.mark.parametrize("way", [{}, {"mirror": True}, {"turn": 0.4}])
@pytest.mark.parametrize(("steep_deg", "flat_deg", "cohesion"), [(57, 24, 0.0), (50, 10, 10e3)])
def test_sharp_toes_in_the_corner_of_a_bilinear_plane(verified, steep_deg, flat_deg, cohesion, way):
    """Jaeger's active and passive block with sharp toes: within 1e-3 of limit equilibrium, 1.2 times as much with tips
    that hold."""
    steep, flat = math.radians(steep_deg), math.radians(flat_deg)
    kink = np.array([16.0, 16.0 * math.tan(flat)])
    top = kink[1] + 13.0
    back = np.array([kink[0] + 13.0 / math.tan(steep), top])
    base = [(-30, -18), (60, -18), (60, top), back, kink, (0, 0), (0, -8), (-30, -8)]
    passive, active = [(0, 0), kink, (kink[0], top), (5.5, top)], [kink, back, (kink[0], top)]
    blocks, loads = drawn([base, passive, active], **way)
    friction = math.radians(31)
    found = dda.factor_of_safety(blocks, [ROCK], [JointLaw("joint", friction, cohesion)], loads)
    weight = 2600.0 * GRAVITY * blocks.areas()[1:]
    lengths = np.hypot(*kink), np.hypot(*(back - kink)), 13.0

    def driving(factor: float) -> float:
        """N by which the active block's push is more than the passive one's hold (sign of the factor's excess)."""
        tangent, c = math.tan(friction) / factor, cohesion / factor
        # Unknown: forces normal to the steep plane, to the flat one, and between the blocks.
        s, f = (math.sin(steep), math.cos(steep)), (math.sin(flat), math.cos(flat))
        rows = np.array([
            [-s[0] + tangent * s[1], 0.0, 1.0],
            [s[1] + tangent * s[0], 0.0, tangent],
            [0.0, f[1] + tangent * f[0], -tangent],
        ])  # fmt: skip
        right = np.array([
            -c * lengths[1] * s[1],
            weight[1] - c * lengths[1] * s[0] - c * lengths[2],
            weight[0] - c * lengths[0] * f[0] + c * lengths[2],
        ])  # fmt: skip
        _, n_flat, push = np.linalg.solve(rows, right)
        return push - n_flat * (-f[0] + tangent * f[1]) - c * lengths[0] * f[1]

    low, high = 0.5, 5.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if driving(middle) < 0 else (low, middle)
    print(f"{found.factor:.5f}, limit equilibrium {low:.5f}, with sharp tips {found.other_factor}")
    verified(
        f"two blocks with sharp toes, planes of {steep_deg}° and {flat_deg}°, c = {cohesion / 1e3:g} kPa; as drawn, mirrored, turned",
        found.factor / low - 1,
        "limit equilibrium",
    )
    assert found.factor == pytest.approx(low, rel=2e-3)
    if not cohesion:
        assert low == pytest.approx(
            math.tan(friction) / math.tan(rock_slopes.two_block_friction((weight[1], steep), (weight[0], flat))),
            rel=1e-6,
        )
        assert found.other_factor > 1.1 * low
    assert {toe.block for toe in found.toes} == {2}


@pytest.mark.parametrize("way", [{}, {"mirror": True}, {"turn": -0.3}])
def test_a_plane_keeps_its_cohesion_when_the_tension_crack_lets_go(verified, way):
    """c ℓ of all of the plane, although its law is that of the crack, which opens and shares a corner with it."""
    foot, friction, cohesion = np.array([19.45, 15.28]), math.radians(36.4), 24.6e3
    base = [(-30, -23), (50, -23), (50, 21.3), (foot[0], 21.3), foot, (0, 0), (0, -13), (-30, -13)]
    blocks, loads = drawn([base, [(0, 0), foot, (foot[0], 21.3), (8.41, 21.3)]], **way)
    law = JointLaw("joint", friction, cohesion)
    expected = rock_slopes.plane_failure_factor(
        2600.0 * GRAVITY * blocks.areas()[1], math.atan2(foot[1], foot[0]), float(np.hypot(*foot)), cohesion, friction
    )
    found = dda.factor_of_safety(blocks, [ROCK], [law], loads)
    print(f"{found.factor:.5f}, limit equilibrium {expected:.5f}")
    verified(
        "plane with cohesion that shares a corner with a tension crack; as drawn, mirrored, turned",
        found.factor / expected - 1,
        "limit equilibrium",
    )
    assert found.factor == pytest.approx(expected, rel=1e-3)


def shear_box(
    step: float, tension: float, turns: bool, modulus: float, steps: int, nodes=(), height: float = 0.5
) -> list[float]:
    """Pa on a face of 1 m, with flat ``nodes`` on it, that is pressed by 1 MPa and pushed ``step`` m a time; its cohesion
    is kept as it slips. The push acts at half the ``height`` of the upper block."""
    law = JointLaw("joint", math.radians(35), 200e3, tension, residual_cohesion=200e3)
    blocks = Blocks.from_polygons(
        [
            np.array([[-1, -0.5], [2, -0.5], [2, 0], [-1, 0]]),
            np.array([[0, 0], *[[x, 0] for x in nodes], [1, 0], [1, height], [0, height]]),
        ],
        fixed=[True, False], edge_names=[[[""] * 4], [[""] * (2 + len(nodes)) + ["top", ""]]],
    )  # fmt: skip
    system = dda.BlockSystem(
        blocks, [Material("rock", modulus, 0.25, density=1.0)], [law], settings=DdaSettings(max_displacement_ratio=0.5)
    )
    press = Loads(edge_tractions=(EdgeTraction("top", History.constant([0.0, -1e6])),))
    held = ("u0",) if turns else ("u0", "r0")
    rate = [step / 1e3, 0.0][: len(held)]
    pushed = replace(press, block_motions=(BlockMotion(1, History.ramp(rate), held),))
    state, out = system.step(State.at_rest(blocks), press, 1e3).state, []
    for k in range(steps):
        result = system.step(replace(state, time=1e3 * k), pushed, 1e3)
        state = result.state
        out.append(abs(float(result.contacts["shear_force"].sum())))
    return out


@pytest.mark.parametrize(
    ("step", "tension", "turns", "modulus", "steps"),
    [
        (2e-7, 0.0, True, 20e9, 120), (1e-6, 0.0, False, 20e9, 40), (1e-5, 100e3, True, 20e9, 12),
        (2e-4, 0.0, True, 20e9, 4), (2e-4, 0.0, False, 20e9, 4), (1e-3, 100e3, True, 20e9, 4), (1e-3, 0.0, True, 1e9, 4),
    ],
)  # fmt: skip
def test_a_shear_box_ends_at_its_strength_whatever_the_step(verified, step, tension, turns, modulus, steps):
    expected = 200e3 + 1e6 * math.tan(math.radians(35))
    found = shear_box(step, tension, turns, modulus, steps)
    print(f"{step:g} m a step: {found[-1] / 1e3:.2f} kPa, should be {expected / 1e3:.2f}")
    verified(
        "shear box with c = 200 kPa, seven of steps, stiffnesses and bonds", found[-1] / expected - 1, "c + σ tan φ"
    )
    assert found[-1] == pytest.approx(expected, rel=1e-3) and max(found) <= expected * 1.001


@pytest.mark.parametrize(
    ("step", "tension", "turns", "modulus", "steps"),
    [
        (2e-7, 0.0, True, 20e9, 120),
        (2e-4, 0.0, True, 20e9, 4),
        (1e-3, 100e3, True, 20e9, 4),
        (1e-3, 0.0, False, 1e9, 4),
    ],
)
def test_flat_vertices_on_the_face_of_a_shear_box_take_no_strength(step, tension, turns, modulus, steps):
    """A flat push keeps the whole face closed: c ℓ + N tan φ. A push at half of 0.5 m bears beyond the kern
    (e = 0.22 ℓ): one end parts, and its cohesion is not there, the same at any step; between no-tension bedding,
    c 3(ℓ/2 − e) + N tan φ, and the closed face."""
    nodes, whole = np.arange(1, 10) / 10, 200e3 + 1e6 * math.tan(math.radians(35))
    found = shear_box(step, tension, turns, modulus, steps, nodes, 0.05)
    assert found[-1] == pytest.approx(whole, rel=1e-3) and max(found) <= whole * 1.001
    parted = shear_box(step, tension, turns, modulus, steps, nodes)
    bedded = 200e3 * 3 * (0.5 - 0.22) + 1e6 * math.tan(math.radians(35))
    assert bedded < parted[-1] < whole and parted[-1] == pytest.approx(890.2e3, rel=1e-3)


@pytest.mark.parametrize("stiffness", [1e5, 3e5, 1e8])
def test_a_soft_anchor_counts_with_its_yield_force_and_its_displacement_is_reported(verified, stiffness):
    """F = N tan φ / T of a block on a plane at 40° with the anchor at its yield force, within 1 %."""
    slope, friction, force = math.radians(40), math.radians(30), 15e3
    blocks = Blocks.from_polygons(
        [turned(rectangle(-6, -3, 8, 0), slope), turned(rectangle(0, 0, 2, 1), slope)], fixed=[True, False]
    )
    start = np.array([0.4447, 1.0258])
    end = np.array([3.967, 0.7177])
    bolt = Bolt(1, tuple(start), GROUND, tuple(end), stiffness, pretension=10e3, yield_force=force)
    weight = 2600.0 * GRAVITY * 2.0
    pull = force * (end - start) / np.hypot(*(end - start)) + [0.0, -weight]
    along, out = np.array([math.cos(slope), math.sin(slope)]), np.array([-math.sin(slope), math.cos(slope)])
    expected = (pull @ out) * math.tan(friction) / (pull @ along)
    found = dda.factor_of_safety(
        blocks, [ROCK], [JointLaw("plane", friction)], Loads(gravity=WEIGHT.gravity, bolts=(bolt,))
    )
    anchor = found.anchors[0]
    print(f"{stiffness:g} N/m: {found.factor:.4f}, should be {expected:.4f}; {anchor}, {found.warnings}")
    verified(
        f"block held by an anchor of {stiffness:g} N/m", None, "limit equilibrium", found=found.factor, exact=expected
    )
    assert found.factor == pytest.approx(expected, rel=1e-2)
    assert anchor.stretch == pytest.approx(5e3 / stiffness, rel=2e-2) and anchor.moved > anchor.stretch
    assert bool(found.warnings) == (stiffness < 1e8)
    assert f"stretched by {1e3 * anchor.stretch:.3g} mm" in found.table()


def test_an_anchor_that_never_yields_counts_with_what_it_takes_while_blocks_stay():
    slope = math.radians(40)
    blocks = Blocks.from_polygons(
        [turned(rectangle(-6, -3, 8, 0), slope), turned(rectangle(0, 0, 2, 1), slope)], fixed=[True, False]
    )
    bolt = Bolt(1, (0.4447, 1.0258), GROUND, (3.967, 0.7177), 1e6, pretension=10e3, yield_force=math.inf)
    found = dda.factor_of_safety(
        blocks, [ROCK], [JointLaw("plane", math.radians(30))], Loads(gravity=WEIGHT.gravity, bolts=(bolt,))
    )
    # Of √2 m a two-thousandth, at 45° to the bolt.
    assert found.anchors[0].force == pytest.approx(10e3 + 1e6 * 0.7e-3 * math.cos(math.radians(45)), rel=1e-2)
    assert "no yield force" in found.warnings[0]


def test_a_bolt_too_soft_to_reach_its_yield_force_is_named():
    """At 1e4 N/m and 15 kN the block of √2 m would have to go 0.7 m; a tenth of its size is allowed."""
    slope = math.radians(40)
    blocks = Blocks.from_polygons(
        [turned(rectangle(-6, -3, 8, 0), slope), turned(rectangle(0, 0, 2, 1), slope)], fixed=[True, False]
    )
    bolt = Bolt(1, (0.4447, 1.0258), GROUND, (3.967, 0.7177), 1e4, pretension=10e3, yield_force=15e3)
    found = dda.factor_of_safety(
        blocks, [ROCK], [JointLaw("plane", math.radians(30))], Loads(gravity=WEIGHT.gravity, bolts=(bolt,))
    )
    assert found.anchors[0].moved == pytest.approx(0.1 * math.sqrt(2), rel=2e-2)
    assert "does not reach its yield force of 15 kN/m" in found.warnings[0]


def test_what_holds_blocks_that_no_strength_moves_is_named_and_blocks_that_none_holds():
    """A key that widens upwards is borne by its sides, W/2 sin 11.3° each; one that widens downwards falls."""
    slant = np.array([[-1.2, 0], [1.2, 0], [1.5, 1.5], [-1.5, 1.5]], float)
    for key in (slant, slant * [1, -1] + [0, 1.5]):
        (a, b), (c, d) = sorted(key[key[:, 1] == 0, 0]), sorted(key[key[:, 1] == 1.5, 0])
        roof = [(-8, 0), (a, 0), (c, 1.5), (d, 1.5), (b, 0), (8, 0), (8, 8), (-8, 8)]
        polygons = [np.array(roof), key if key is slant else key[::-1]]
        blocks = Blocks.from_polygons(polygons, fixed=[True, False])
        if key is slant:
            found = dda.factor_of_safety(blocks, [ROCK], [JointLaw("joint", 0.5)], WEIGHT)
            side = 0.5 * 2600.0 * GRAVITY * blocks.areas()[1] / math.sin(math.atan(0.2))
            assert math.isinf(found.upper) and found.travel is None
            forces = [1e3 * float(text) for text in re.findall(r"([\d.]+) kN/m at x = -?1\.", found.warnings[0])]
            assert forces == pytest.approx([side, side], rel=0.05)
        else:
            with pytest.raises(dda.NotConverged, match="'block 1': keeps moving"):
                dda.factor_of_safety(blocks, [ROCK], [JointLaw("joint", 0.5)], WEIGHT)


@pytest.mark.parametrize("mirror", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_toppling_row_does_not_remember_the_friction_that_it_began_with(verified, mirror):
    slope, heights = math.radians(20), (0.8, 2.0, 3.5, 4.2, 4.0, 3.0)
    n = len(heights)
    columns = [turned(rectangle(k, 0, k + 1, h), slope) for k, h in enumerate(heights)]
    foot = [(n + 6, 0), *((k, 0) for k in range(n, -1, -1)), (-3, 0), (-3, -10), (n + 6, -10)][::-1]
    blocks, loads = drawn([turned(np.array(foot, float)[::-1], slope), *columns], mirror=mirror)
    limits = []
    for tangent in (0.45, 0.6, 1.2, 2.5):
        found = dda.factor_of_safety(blocks, [ROCK], [JointLaw("joint", math.atan(tangent))], loads)
        limits.append(tangent / found.factor)
    print("limit tan φ", limits)
    verified(
        "toppling row from four strengths, as drawn and mirrored: spread of the limit friction",
        max(limits) / min(limits) - 1,
        "each other",
    )
    assert max(limits) < 1.005 * min(limits)


STEPPED = {
    # Corners of the block from the toe on (m), friction angle (degrees) and cohesion (Pa).
    "one plane parts at an end": (
        [(0, 0), (8.262589, 6.3428), (8.164088, 7.270935),
         (13.00272, 10.985325), (13.00272, 16.494298), (7.967869, 16.494298)],
        46.176, 23.4e3,
    ),
    "one plane parts all along": (
        [(0, 0), (4.208661, 3.673296), (4.883509, 5.790067),
         (10.056331, 10.304878), (10.056331, 14.753437), (8.045065, 14.753437)],
        40.692, 12.1e3,
    ),
}  # fmt: skip


@pytest.mark.parametrize("way", [{}, {"mirror": True}])
@pytest.mark.parametrize("which", STEPPED)
def test_stepped_planes_keep_their_cohesion_under_a_block_that_strains_evenly(verified, which, way):
    """F = (c Σℓ + W cos β tan φ)/(W sin β) of a block on two parallel planes with an open riser (limit equilibrium).
    The block, which strains evenly, parts by a thousandth of a millimetre at an end of a plane: c ℓ counts all the
    same, and what it were without is told. Where it parts all along a plane, the factor is that of rigid blocks, and that
    of blocks that strain evenly, 5 % lower or more, is told."""
    corners, friction, cohesion = STEPPED[which]
    low = corners[0][1] - 5.0
    base = [
        (-30, low - 10),
        (70, low - 10),
        (70, corners[-1][1]),
        *corners[4:1:-1],
        corners[1],
        (0, 0),
        (0, low),
        (-30, low),
    ]
    polygons = [np.asarray(base, float), np.asarray(corners, float)]
    edges = [[""] * len(base), ["plane", "riser", "plane", "riser", "", ""]]
    if way:
        polygons = [points[::-1] * [-1.0, 1.0] for points in polygons]
        edges = [[*names[::-1][1:], names[-1]] for names in edges]
    blocks = Blocks.from_polygons(polygons, fixed=[True, False], edge_names=[[names] for names in edges])
    laws = [JointLaw("plane", math.radians(friction), cohesion), JointLaw("riser")]
    found = dda.factor_of_safety(
        blocks, [ROCK], laws, WEIGHT, joint_index=lambda a, b: 0 if "plane" in (a, b) else 1
    )  # fmt: skip
    a, b, c, d = (np.array(at) for at in corners[:4])
    dip, weight = math.atan2(*(b - a)[::-1]), 2600.0 * GRAVITY * blocks.areas()[1]
    length = np.hypot(*(b - a)) + np.hypot(*(d - c))
    expected = (cohesion * length / weight + math.cos(dip) * math.tan(math.radians(friction))) / math.sin(dip)
    print(f"{found.factor:.5f}, limit equilibrium {expected:.5f}; {found.warnings}")
    verified(
        f"stepped planes with cohesion, {which}",
        found.factor / expected - 1,
        "limit equilibrium",
    )
    if which == "one plane parts at an end":
        assert found.factor == pytest.approx(expected, rel=1e-3)
        assert found.factor_if_parted < 0.97 * expected and "touches at one end only" in found.warnings[-1]
    else:
        assert found.factor == found.factor_if_rigid == pytest.approx(expected, rel=1e-3)
        assert found.factor_if_strained < 0.95 * expected and "that of rigid blocks" in found.warnings[-1]


@pytest.mark.parametrize(("gap", "stands"), [(2e-4, True), (2e-3, False)])
def test_what_stops_a_block_within_its_reach_is_waited_for(gap, stands):
    """A block of 2 m² on a plane steeper than its friction angle, before a wall: within a two-thousandth of √2 m it
    comes to rest, beyond it has failed."""
    slope = math.radians(35)
    polygons = [rectangle(-8, -3, 8, 0), rectangle(-3 - gap, 0, -gap, 1), rectangle(0, 0, 2, 1)]
    blocks = Blocks.from_polygons([turned(points, slope) for points in polygons], fixed=[True, True, False])
    found = dda.factor_of_safety(blocks, [ROCK], [JointLaw("joint", math.radians(30))], WEIGHT)
    print(found.table())
    if stands:
        assert math.isinf(found.upper) and found.moved[2] == pytest.approx(gap, rel=0.1)
    else:
        assert found.factor == pytest.approx(math.tan(math.radians(30)) / math.tan(slope), rel=1e-4)
