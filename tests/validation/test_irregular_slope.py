"""A slope cut by two irregular joint sets, from its scene: the slab on the steeper bedding decides, as in limit
equilibrium."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from small_scenes import two_set_slope

from geomech import dda
from geomech.model import State
from geomech.scene import load_scene

SCENE = (
    two_set_slope("angle_deg = -25\nspacing_m = 4", "spacing_m = 5\nlength_m = 12\ngap_m = 3")
    + """
[loads]
gravity_m_s2 = [0, -9.81]
[run]
end_time_s = 1
"""
)


@pytest.fixture
def slope(tmp_path):
    (tmp_path / "slope.toml").write_text(SCENE)
    return load_scene(tmp_path / "slope.toml").problem()


def test_sudden_weight_on_irregular_blocks_settles_without_cutting_the_step(slope):
    """77 blocks and some 480 contacts, many of them corners that meet corners; friction 40° lets none of the slabs
    go."""
    rough = [replace(joint, friction_angle=math.radians(40)) for joint in slope.joints]
    system = dda.BlockSystem(
        slope.blocks, slope.materials, rough, slope.joint_index, replace(slope.dda, dynamic_factor=0.0, time_step=0.01)
    )
    state, iterations = State.at_rest(slope.blocks), []
    for _ in range(5):
        result = system.step(state, slope.loads, 0.01)
        state = result.state
        assert result.statistics["step_cuts"] == 0
        iterations.append(result.statistics["open_close_iterations"])
    assert iterations[-1] <= 10


@pytest.mark.slow
def test_its_factor_of_safety_is_that_of_the_slab(slope):
    """tan 20° / tan 25°: the slab lies on its bed with its whole weight, and the cross joints open behind it."""
    found = dda.factor_of_safety(
        slope.blocks, slope.materials, slope.joints, slope.loads, joint_index=slope.joint_index
    )
    assert found.factor == pytest.approx(math.tan(math.radians(20)) / math.tan(math.radians(25)), rel=2e-3)
