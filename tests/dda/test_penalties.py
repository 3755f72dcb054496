"""The penalty that is picked where none is given: what it costs in closure, iterations and digits."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from block_problems import rectangle

from geomech import dda
from geomech.model import Blocks, DdaSettings, EdgeTraction, History, JointLaw, Loads, Material, State

GRAVITY = Loads(gravity=History.constant([0.0, -9.81]))


def column(moduli: list[float], width: float = 1.0, strain: float = 1e-4):
    """Blocks of 1 m height on a fixed base, pressed: (shortening over that of the blocks alone) − 1, the step's
    result."""
    n = len(moduli)
    polygons = [rectangle(-width, -1, 2 * width, 0)] + [rectangle(0, k, width, k + 1) for k in range(n)]
    names = [[[""] * 4] for _ in range(n)] + [[["", "", "top", ""]]]
    blocks = Blocks.from_polygons(polygons, fixed=[True] + [False] * n, edge_names=names, material=[0, *range(n)])
    system = dda.BlockSystem(
        blocks,
        [Material(f"rock {e:g}", e, 0.0, density=2600.0) for e in moduli],
        settings=DdaSettings(max_displacement_ratio=0.02),
    )
    pressure = strain * min(moduli)
    loads = Loads(edge_tractions=(EdgeTraction("top", History.constant([0.0, -pressure])),))
    result = system.step(State.at_rest(blocks), loads, 1e4)
    expected = sum(pressure / e for e in moduli)
    assert result.state.stress[1:, 1] == pytest.approx(np.full(n, -pressure), rel=1e-8)
    return (n - result.state.vertices[-2:, 1].mean()) / expected - 1, result


def wall(rows: int, bricks: int, width: float = 1.0) -> Blocks:
    """A wall in running bond of bricks ``width`` × 0.5 m on a fixed base."""
    polygons = [rectangle(-width, -2, (bricks + 1) * width, 0)]
    for row in range(rows):
        joints = [0, *np.arange(0.5, bricks), bricks] if row % 2 else range(bricks + 1)
        polygons += [rectangle(a * width, 0.5 * row, b * width, 0.5 * row + 0.5) for a, b in itertools.pairwise(joints)]
    return Blocks.from_polygons(polygons, fixed=[True] + [False] * (len(polygons) - 1))


def iterations(blocks: Blocks, contrast: float, dynamic: float, dt: float, steps: int, penalty=None):
    """Open–close iterations a step under sudden gravity, and steps cut; every other block is ``contrast`` times
    softer."""
    import dataclasses

    blocks = dataclasses.replace(blocks, material=np.arange(blocks.n_blocks) % 2)
    rocks = [Material("hard", 1e10, 0.25, density=2600.0), Material("soft", 1e10 / contrast, 0.25, density=2600.0)]
    settings = DdaSettings(dynamic_factor=dynamic, max_displacement_ratio=0.01, normal_penalty=penalty)
    system = dda.BlockSystem(blocks, rocks, [JointLaw("joint", friction_angle=np.radians(35))], settings=settings)
    state, taken, cuts = State.at_rest(blocks), [], 0
    for _ in range(steps):
        result = system.step(state, GRAVITY, dt)
        state = result.state
        taken.append(result.statistics["open_close_iterations"])
        cuts += result.statistics["step_cuts"]
    return float(np.mean(taken)), cuts


@pytest.mark.parametrize("aspect", [1.0, 10.0, 1000.0])
def test_springs_give_way_by_a_hundredth_of_slabs_however_flat(aspect):
    # Two springs a face, 1/(2 · 40): the same for squares and slabs; the base, which is fixed, gives way by nothing
    # else.
    error, _ = column([1e10] * 4, width=aspect)
    assert error == pytest.approx(1 / 80, rel=1e-6)


def test_slender_blocks_have_the_springs_of_squares():
    error, _ = column([1e10] * 4, width=0.1)
    assert error == pytest.approx(0.1 / 80, rel=1e-6)


@pytest.mark.parametrize("contrast", [1.0, 12.0, 1e3, 1e6])
def test_springs_between_unlike_blocks(contrast):
    # Two springs a joint: the base's of 40 E' (it is fixed), and between the blocks of their geometric mean, or of 32
    # times the softer. The hard block's strain is as small as the contrast, and its digits are what is left of sixteen.
    for moduli in ([1e10, 1e10 / contrast], [1e10 / contrast, 1e10]):
        error, result = column(moduli)
        soft = min(moduli)
        given = 1 / moduli[0] + 1 / min((moduli[0] * moduli[1]) ** 0.5, 32 * soft)
        assert error == pytest.approx(given / 80 / (1 / moduli[0] + 1 / moduli[1]), abs=1e-7)
        assert result.statistics["unbalanced_ratio"] < 1e-14 * max(contrast, 100.0)


def test_a_platen_has_the_same_springs_fixed_or_rigid_and_moved():
    found = []
    for fixed, rigid in ((True, False), (False, True)):
        blocks = Blocks.from_polygons(
            [rectangle(-5, -1, 6, 0), rectangle(0, 0, 1, 1)], fixed=[fixed, False], material=[0, 1]
        )
        steel, rock = (
            Material("steel", 200e9, 0.3, density=7800.0, rigid=rigid),
            Material("rock", 10e9, 0.2, density=2600.0),
        )
        system = dda.BlockSystem(blocks, [steel, rock])
        found.append(system.contacts_near(State.at_rest(blocks)).springs.normal)
    assert len(found[0]) == 2 and found[0] == pytest.approx(40 * rock.plane_modulus, rel=1e-12)
    assert found[1] == pytest.approx(found[0], rel=1e-12)


@pytest.mark.parametrize(("dynamic", "dt"), [(1.0, 1e-2), (1.0, 1e-3), (0.0, 10.0)])
def test_walls_of_two_rocks_settle(dynamic, dt):
    # By the stiffer block's E' alone most of these are cut again and again, and the static one fails.
    taken, cuts = iterations(wall(5, 5), 1e3, dynamic, dt, 6 if dynamic else 2)
    print(f"1 : 1000, dynamic {dynamic:g}, dt {dt:g} s: {taken:.1f} iterations a step, {cuts} cuts")
    assert cuts == 0 and taken < 40


@pytest.mark.slow
def test_iterations_by_penalty():
    # What the rule is picked by; loose, as the figures are told and not required.
    print("\n  penalty/E' iterations a step at dt = 10 ms, 1 ms (wall of 100 bricks, sudden gravity, 25 steps)")
    taken = {}
    for ratio in (1, 4, 10, 40, 160, 1000):
        taken[ratio] = [iterations(wall(10, 10), 1.0, 1.0, dt, 25, ratio * 1e10)[0] for dt in (1e-2, 1e-3)]
        print(f"  {ratio:10d} {taken[ratio][0]:6.2f} {taken[ratio][1]:6.2f}")
    assert sum(taken[40]) < 0.8 * sum(taken[1000])
