"""Blocks that a scene sets in motion before the first step."""

import numpy as np
import pytest

import geomech
from geomech.scene import SceneError, load_scene

SCENE = """title = "throw"
[[geometry.zones]]
name = "ball"
rectangle = [0, 20, 1, 21]
[[geometry.zones]]
name = "ground"
rectangle = [-5, 0, 40, 1]
[materials.rock]
youngs_modulus_pa = 1e9
poissons_ratio = 0.25
density_kg_m3 = 2600
[zones.ground]
fixed = true
[zones.ball]
velocity_m_s = [8, 3]
[joints.default]
friction_angle_deg = 30
[loads]
gravity_m_s2 = [0, -9.81]
[dda]
time_step_s = 1e-3
dynamic_factor = 1
[[monitors]]
name = "middle"
at = [0.5, 20.5]
[run]
end_time_s = 0.25
"""


@pytest.fixture
def written(tmp_path):
    def write(*changes):
        text = SCENE
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "throw.toml"
        path.write_text(text)
        return path

    return write


def test_a_block_that_is_thrown_flies_its_parabola(written):
    path = written()
    cycles = list(geomech.cycles(path))
    first, last = cycles[0].state, cycles[-1].state
    ball = int(np.argmax(first.velocity[:, 0]))
    assert first.velocity[ball, :2].tolist() == [8.0, 3.0] and not first.velocity[1 - ball].any()
    t = last.time
    blocks = cycles[-1].blocks
    moved = blocks.mean_vertices(last.vertices)[ball] - blocks.mean_vertices(blocks.vertices)[ball]
    # First order in the step of 1 ms at the worst.
    assert moved == pytest.approx([8 * t, 3 * t - 0.5 * 9.81 * t**2], abs=9.81 * t * 1e-3)
    assert any("(8, 3) m/s" in line for line in load_scene(path).overview())


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("dynamic_factor = 1", "dynamic_factor = 0", "static run"),
        ("fixed = true", "fixed = true\nvelocity_m_s = [1, 0]", "`fixed`"),
        ("velocity_m_s = [8, 3]", 'guided = "x"\nvelocity_m_s = [8, 3]', "across it"),
        ("velocity_m_s = [8, 3]", "velocity_m_s = [8, inf]", "finite"),
    ],
)
def test_velocities_that_cannot_be_are_refused(written, old, new, said):
    with pytest.raises(SceneError, match=said):
        load_scene(written((old, new)))
