"""Block theory in two dimensions on blocks whose answer is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geomech import dda
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material, State
from geomech.model.blocks.key_blocks import FALLS, FIXED, FRICTION, HELD, SAFE, SLIDES, key_blocks

ROCK = Material("rock", 10e9, 0.25, density=2600.0)
DOWN = np.array([0.0, -9.81])


def polygon(*points) -> np.ndarray:
    return np.array(points, dtype=float)


def found(polygons, law: JointLaw, gravity=DOWN, fixed=None) -> np.ndarray:
    """KEY_BLOCK rows of blocks that touch as drawn (a static step of no load finds the contacts)."""
    blocks = Blocks.from_polygons(polygons, fixed=fixed or [True] + [False] * (len(polygons) - 1))
    system = dda.BlockSystem(blocks, [ROCK], [law], settings=DdaSettings(max_displacement_ratio=0.1))
    state = system.step(State.at_rest(blocks), Loads(gravity=History.constant([0.0, 0.0])), 1e-3).state
    return key_blocks(blocks, [ROCK], [law], state, gravity)


def roof(half_top: float, half_bottom: float) -> list[np.ndarray]:
    """Two abutments, and between them a block of those half-widths at its top and bottom, 1 m high."""
    left = polygon([-3, 0], [-half_bottom, 0], [-half_top, 1], [-3, 1])
    right = polygon([half_bottom, 0], [3, 0], [3, 1], [half_top, 1])
    middle = polygon([-half_bottom, 0], [half_bottom, 0], [half_top, 1], [-half_top, 1])
    return [left, right, middle]


@pytest.mark.parametrize(("friction_deg", "kind"), [(30, SLIDES), (50, FRICTION)])
def test_a_block_on_an_incline_slides_or_is_held(friction_deg, kind):
    law = JointLaw("joint", np.radians(friction_deg))
    rows = found([polygon([0, 0], [4, 0], [4, 4]), polygon([1, 1], [2, 2], [2, 3], [1, 2])], law)
    assert rows["kind"].tolist() == [FIXED, kind]
    assert np.degrees(rows["direction"][1]) == pytest.approx(-135, abs=0.01)
    assert rows["factor"][1] == pytest.approx(np.tan(np.radians(friction_deg)), rel=1e-4)


@pytest.mark.parametrize(("friction_deg", "kind"), [(30, SLIDES), (50, FRICTION)])
@pytest.mark.parametrize("mirrored", [1.0, -1.0])
def test_a_block_between_parallel_faces_slides_on_the_lower_one(friction_deg, kind, mirrored):
    law = JointLaw("joint", np.radians(friction_deg))
    below, between = polygon([0, 0], [4, 0], [4, 4]), polygon([1, 1], [2, 2], [1.5, 2.5], [0.5, 1.5])
    above = polygon([-0.5, 0.5], [3.5, 4.5], [-0.5, 4.5])
    rows = found([p * [mirrored, 1.0] for p in (below, between, above)], law, fixed=[True, False, True])
    assert rows["kind"].tolist() == [FIXED, kind, FIXED]
    assert np.degrees(rows["direction"][1]) == pytest.approx(-90 - mirrored * 45, abs=0.01)
    assert rows["factor"][1] == pytest.approx(np.tan(np.radians(friction_deg)), rel=1e-4)


def test_cohesion_counts_while_it_holds():
    law = JointLaw("joint", np.radians(30), cohesion=10e3)
    rows = found([polygon([0, 0], [4, 0], [4, 4]), polygon([1, 1], [2, 2], [2, 3], [1, 2])], law)
    weight = 2600 * 9.81
    expected = np.tan(np.radians(30)) + 10e3 * np.sqrt(2) / (weight * np.sin(np.pi / 4))
    assert rows["factor"][1] == pytest.approx(expected, rel=1e-3)
    assert rows["kind"][1] == FRICTION


def test_roof_blocks_are_told_by_their_taper():
    law = JointLaw("joint", 0.5)
    fixed = [True, True, False]
    # Wider below: falls out of the roof. Wider above: nothing lets it down, it can only be lifted out.
    assert found(roof(0.5, 1.0), law, fixed=fixed)["kind"].tolist() == [FIXED, FIXED, FALLS]
    assert found(roof(1.0, 0.5), law, fixed=fixed)["kind"].tolist() == [FIXED, FIXED, SAFE]
    # Upside down it is the other way round.
    assert found(roof(0.5, 1.0), law, -DOWN, fixed)["kind"][2] == SAFE


def test_a_block_with_neighbours_all_round_is_held_and_a_loose_one_falls():
    square = polygon([0, 0], [1, 0], [1, 1], [0, 1])
    ring = [square + [dx, dy] for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1))]
    rows = found([*ring, square, square + [5.0, 5.0]], JointLaw("joint", 0.5), fixed=[True] * 4 + [False] * 2)
    assert rows["kind"].tolist() == [FIXED] * 4 + [HELD, FALLS]


def test_without_gravity_only_removability_is_reported():
    rows = found(roof(0.5, 1.0), JointLaw("joint", 0.5), np.zeros(2), [True, True, False])
    assert rows["kind"][2] == SAFE
    assert np.degrees(rows["direction"][2]) == pytest.approx(-90, abs=0.01)


def test_blocks_are_ranked_by_how_far_they_have_moved():
    blocks = Blocks.from_polygons([polygon([k, 0], [k + 0.5, 0], [k, 1]) for k in range(4)], fixed=[1, 0, 0, 0])
    state = State.at_rest(blocks)
    state.vertices[3:6] += [0.1, 0.0]
    state.vertices[9:12] += [0.0, -0.3]
    state.velocity[2, :2] = [3.0, 4.0]
    rows = key_blocks(blocks, [ROCK], [JointLaw("j")], state, DOWN)
    assert rows["rank"].tolist() == [3, 1, 2, 0]
    assert rows["displacement"] == pytest.approx([0, 0.1, 0, 0.3])
    assert rows["speed"][2] == 5.0
    # What is dug out is out of the ranking.
    gone = replace(state, removed=np.array([False, False, False, True]))
    rows = key_blocks(blocks, [ROCK], [JointLaw("j")], gone, DOWN)
    assert rows["kind"].tolist() == [FIXED, FALLS, FALLS, FIXED] and rows["rank"][1] == 0


def test_blocks_on_a_shaken_base_move_against_it():
    """Everything has gone half a metre with the base, one block a centimetre farther."""
    blocks = Blocks.from_polygons(
        [polygon([0, -1], [9, -1], [9, 0], [0, 0]), polygon([1, 0], [2, 0], [2, 1], [1, 1]),
         polygon([4, 0], [5, 0], [5, 1], [4, 1])],
        fixed=[True, False, False],
    )  # fmt: skip
    rest = State.at_rest(blocks)
    moved = rest.vertices + np.array([0.5, 0.0])
    moved[blocks.vertex_block == 2] += [0.01, 0.0]
    velocity = rest.velocity.copy()
    velocity[:, 0] = [1.0, 1.0, 1.2]
    rows = key_blocks(blocks, [ROCK], [], replace(rest, vertices=moved, velocity=velocity), DOWN)
    assert rows["displacement"] == pytest.approx([0.0, 0.0, 0.01], abs=1e-12)
    assert rows["speed"] == pytest.approx([0.0, 0.0, 0.2], abs=1e-12) and rows["rank"][2] == 0


def test_a_key_block_that_stands_is_told_to(tmp_path):
    """A block on a smooth incline, held by a bolt: by its own weight it slides, and it does not."""
    from types import SimpleNamespace

    from geomech.output.tables.motion_state import key_block_summary

    c, s = np.cos(0.6), np.sin(0.6)
    turn = np.array([[c, s], [-s, c]])
    blocks = Blocks.from_polygons(
        [polygon([-1, -1], [6, -1], [6, 0], [-1, 0]) @ turn, polygon([1, 0], [2, 0], [2, 1], [1, 1]) @ turn],
        fixed=[True, False], names=("base", "block"),
    )  # fmt: skip
    law = JointLaw("joint", 0.2)
    system = dda.BlockSystem(blocks, [ROCK], [law], settings=DdaSettings(max_displacement_ratio=0.1))
    state = system.step(State.at_rest(blocks), Loads(gravity=History.constant([0.0, 0.0])), 1e-3).state
    problem = SimpleNamespace(materials=[ROCK], joints=[law], loads=Loads(gravity=History.constant(DOWN)))
    for shift, told in (
        (3e-4, "stands (by its own weight and friction a key block, slides)"),
        (0.3, "key block, slides"),
    ):
        moved = state.vertices + shift * np.array([c, s]) * (blocks.vertex_block == 1)[:, None]
        cycle = SimpleNamespace(blocks=blocks, state=replace(state, vertices=moved))
        (entry,) = key_block_summary(cycle, problem)
        assert entry["class"] == told and entry["factor_of_safety"] < 0.4
