"""Water tables that rise in front of a slope: ponded, or following the ground."""

import numpy as np
import pytest

from geomech.dda.loads.load_vectors import LoadMap
from geomech.model import Blocks, History, Loads, WaterTable
from geomech.model.loads.ground import below_ground, lowest_over, ponds
from geomech.scene import load_scene
from geomech.shapes.block_cutting.rock_outline import ground_of

GAMMA = 9810.0
#: A wedge on a plane that falls to the right, from a vertical crack at x = 10 to a face that it leaves at (50, 10).
BASE = np.array([[0, 0], [70, 0], [70, 10], [50, 10], [10, 25], [10, 30], [0, 30.0]])
WEDGE = np.array([[10, 25], [50, 10], [35, 30], [10, 30.0]])


def slope() -> Blocks:
    return Blocks.from_polygons([BASE, WEDGE], fixed=[True, False])


def force(blocks: Blocks, water: WaterTable, time: float = 0.0) -> np.ndarray:
    rows = LoadMap(blocks).rows(Loads(water=water), time, blocks.vertices, np.zeros(blocks.n_blocks))[1]
    return rows["force"][rows["block"] == 1].sum(axis=0)


@pytest.mark.parametrize("level", [10.0, 16.0, 22.0, 27.0, 40.0])
def test_a_table_that_follows_the_ground_presses_on_the_joint_alone(level):
    """Uplift and thrust against the pressure γ (min(level, ground) − y), integrated by the midpoint rule."""
    blocks = slope()
    water = WaterTable(np.array([[0.0, 10.0]]), level=History.ramp([level - 10.0]), ground=ground_of(blocks))
    x = 10 + 40 * (np.arange(200_000) + 0.5) / 200_000
    plane, ground = 25 - 0.375 * (x - 10), np.where(x < 35, 30.0, 30 - 4 / 3 * (x - 35))
    pressure = GAMMA * np.maximum(np.minimum(level, ground) - plane, 0.0)
    up = pressure.sum() * 40 / 200_000
    # On the plane (0.375, 1) per metre of x; on the crack above it, level.
    head = min(max(level - 25.0, 0.0), 5.0)
    expected = [0.375 * up + 0.5 * GAMMA * head**2, up]
    assert force(blocks, water, 1.0) == pytest.approx(expected, rel=1e-6, abs=1e-3)


def test_ponded_water_lifts_the_whole_wedge_by_what_it_displaces():
    """Archimedes, under a level table above it; the same table along the ground lifts it by less."""
    blocks = slope()
    high = WaterTable(np.array([[0.0, 40.0]]))
    area = blocks.areas()[1]
    assert force(blocks, high) == pytest.approx([0.0, GAMMA * area], abs=1e-6 * GAMMA * area)
    (pond,) = ponds(high.line_at(0.0), lowest_over(ground_of(blocks)))
    assert pond == pytest.approx((0.0, 70.0, 30.0))


def test_nothing_presses_on_a_vertical_face_or_under_an_overhang():
    """A bench with a vertical face, and one that leans out; the table behind them stands 4 m above their toes, and the
    faces move by a millimetre either way."""
    for lean in (0.0, 1.0):
        base = np.array([[0, -2], [20, -2], [20, 0], [0, 0.0]])
        bench = np.array([[0, 0], [10, 0], [10 + lean, 6], [0, 6.0]])
        blocks = Blocks.from_polygons([base, bench], fixed=[True, False])
        ground = ground_of(blocks)
        assert ground == pytest.approx(np.array([[0, 6], [10 + lean, 6], [10, 0], [20, 0.0]]), abs=1e-7)
        water = WaterTable(np.array([[0.0, 4.0]]), ground=ground)
        for shift in (0.0, 1e-3, -1e-3):
            moved = blocks.vertices + np.array([shift, 0.0])
            rows = LoadMap(blocks).rows(Loads(water=water), 0.0, moved, np.zeros(2))[1]
            own = rows[rows["block"] == 1]
            # The left side is the model's own rim, and carries the water of the rock beyond it.
            assert set(own["edge"].tolist()) == {4, 7}
            total = own["force"].sum(axis=0)
            assert total[0] == pytest.approx(0.5 * GAMMA * 16, rel=1e-6)
            assert total[1] == pytest.approx(GAMMA * 4 * 10, rel=1e-3)


def test_the_lower_one_of_two_lines():
    ground = np.array([[0, 6], [5, 6], [5, 2], [9, 2], [8, 4], [12, 4.0]])
    x, y = lowest_over(ground)
    assert (np.diff(x) > 0).all()
    at = np.array([1.0, 4.999, 5.0, 6.0, 8.5, 9.0, 9.001, 11.0])
    assert np.interp(at, x, y) == pytest.approx([6, 6, 2, 2, 2, 2, 4, 4])
    line = np.array([0.0, 12.0]), np.array([5.0, 1.0])
    low = below_ground(line, (x, y))
    at = np.linspace(0, 12, 1001)
    assert np.interp(at, *low) == pytest.approx(np.minimum(np.interp(at, *line), np.interp(at, x, y)), abs=1e-6)
    assert len(low[0]) <= 6
    (pond,) = ponds(line, (x, y))
    assert pond == pytest.approx((5.0, 9.0, 5 - 5 / 3 - 2), abs=1e-6)


SCENE = """title = "slope"
[geometry]
[[geometry.zones]]
name = "base"
polygon = [[0, 0], [70, 0], [70, 10], [50, 10], [10, 25], [10, 30], [0, 30]]
[[geometry.zones]]
name = "rock"
polygon = [[10, 25], [50, 10], [35, 30], [10, 30]]
[materials.rock]
youngs_modulus_pa = 2e10
poissons_ratio = 0.25
density_kg_m3 = 2600
[zones.base]
fixed = true
[joints.default]
friction_angle_deg = 35
[loads]
gravity_m_s2 = [0, -9.81]
[loads.water]
points = [[0, 10]]
level_times_s = [0, 1]
levels_m = [0, 12]
[dda]
time_step_s = 1e-3
[run]
end_time_s = 1
"""


def test_a_scene_says_where_water_is_ponded_and_follows_the_ground_where_asked(tmp_path):
    from geomech.output.block_model.block_system import write_block_system
    from geomech.render.pictures.block_map import draw_block_map

    path = tmp_path / "slope.toml"
    path.write_text(SCENE)
    scene = load_scene(path)
    assert any("ponded up to 12 m deep from x = 41 to 70 m (1 s)" in line for line in scene.overview())
    told = write_block_system(scene, tmp_path / "build")
    assert told["ponded_water"] == pytest.approx({"start": 41.0, "end": 70.0, "depth": 12.0, "time_s": 1.0})
    assert "water ponded up to 12 m deep" in told["summary"]
    assert draw_block_map(scene, told, tmp_path / "blocks.png").stat().st_size > 10_000
    path.write_text(SCENE.replace("levels_m", "follows_ground = true\nlevels_m"))
    scene = load_scene(path)
    assert any("following the ground" in line for line in scene.overview())
    assert write_block_system(scene, tmp_path / "build")["ponded_water"] is None
    water = scene.problem().loads.water
    assert np.interp([5, 38, 44, 60], *water.line_at(1.0)) == pytest.approx([22, 22, 18, 10])


def test_water_becomes_heavier_with_growing_gravity(tmp_path):
    """γw = ρw g, so that buoyancy is the same part of the weight at any time (uplift of the wedge alone, without levels)."""
    path = tmp_path / "slope.toml"
    path.write_text(SCENE.replace("[run]", "[run]\nstop_at = []"))
    full = load_scene(path).problem()
    ramped = load_scene(path, overrides=["loads.gravity_ramp_s=4"]).problem()
    assert full.loads.water.unit_weight_at(0.0) == full.loads.water.unit_weight_at(9.0) == GAMMA
    assert [ramped.loads.water.unit_weight_at(time) for time in (0.0, 1.0, 4.0, 9.0)] == pytest.approx(
        [0.0, GAMMA / 4, GAMMA, GAMMA]
    )
    whole, part = (force(problem.blocks, problem.loads.water, 1.0) for problem in (full, ramped))
    assert part == pytest.approx(whole / 4, rel=1e-12) and whole[1] > 1e5
    with pytest.raises(ValueError, match="the share of the weight of water"):
        WaterTable(np.array([[0.0, 10.0]]), share=History.constant([0.5, 0.5]))
