"""Warnings of a scene: one line a cause, with counts, at the key that is at fault."""

import pytest

from geomech.scene import load_scene
from geomech.scene.errors import Fault, one_a_cause

REST = """
[materials.rock]
youngs_modulus_pa = 20e9
poissons_ratio = 0.25
density_kg_m3 = 2600
k_ic_pa_sqrt_m = 1e6
[joints.default]
friction_angle_deg = 35
[loads]
gravity_m_s2 = [0, -9.81]
gravity_ramp_s = 1
[run]
end_time_s = 1
"""


@pytest.fixture
def warnings(tmp_path):
    def of(text: str) -> list[Fault]:
        path = tmp_path / "scene.toml"
        path.write_text(f'title = "warnings"\n{text}{REST}')
        return list(load_scene(path).warnings)

    return of


def test_warnings_that_differ_in_names_and_numbers_are_one_line():
    same = [
        Fault("a:1", f"bolt '{name}' crosses no joint at {x:g}", "mend it")
        for name, x in (("p", 1), ("q", -2e3), ("r", 4))
    ]
    other = [Fault("a:2", "bolt 's' crosses no joint at 5", "mend it"), Fault("a:1", "something else", "mend it")]
    merged = one_a_cause([*same, *other, same[0]])
    assert [fault.message for fault in merged] == [
        "bolt 'p' crosses no joint at 1 (and 2 more like it: 'q', 'r')", "bolt 's' crosses no joint at 5", "something else",
    ]  # fmt: skip


def test_cracks_in_blocks_that_edges_fix_are_told_once_and_not_at_a_key_that_is_not_there(warnings):
    """Dead ends of a set in rock whose block an edge called "fixed" holds."""
    found = warnings(
        """
[[geometry.zones]]
name = "rock"
rectangle = [0, 0, 40, 20]
[[geometry.zones]]
name = "block"
rectangle = [10, 20, 14, 22]
[[geometry.edges]]
name = "fixed"
line = [[0, 0], [40, 0]]
[[geometry.joint_sets]]
name = "flaws"
kind = "poisson"
angle_deg = 20
length_m = 1
p20_per_m2 = 0.04
zones = ["rock"]
"""
    )
    (fault,) = [fault for fault in found if "which does not strain" in fault.message]
    assert "more like it" in fault.message and "zones.rock.fixed" not in fault.place
    assert 'edges called "fixed"' in fault.way_out and "trim" in fault.way_out


SLOPE = """
[[geometry.zones]]
name = "rock"
polygon = [[0, 0], [60, 0], [60, 10], [40, 10], [28, 30], [0, 30]]
[[geometry.zones]]
name = "base"
polygon = {base}
[[geometry.joint_sets]]
name = "beds"
angle_deg = -20
spacing_m = 5
[[geometry.joint_sets]]
name = "cross"
angle_deg = 75
spacing_m = 6
[zones.base]
fixed = true
"""
OPEN = "[[0, -2], [60, -2], [60, 0], [0, 0]]"
HELD = "[[-2, -2], [60, -2], [60, 0], [0, 0], [0, 30], [-2, 30]]"


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_slope_with_a_free_back_is_reported(warnings, mirrored):
    def turned(text: str) -> str:
        from re import sub

        text = sub(r"\[(-?\d+), (-?\d+)\]", lambda m: f"[{-int(m[1])}, {m[2]}]", text)
        return text.replace("angle_deg = -20", "angle_deg = 20").replace("angle_deg = 75", "angle_deg = 105")

    for base, told in ((OPEN, True), (HELD, False)):
        text = SLOPE.format(base=base)
        found = [
            fault for fault in warnings(turned(text) if mirrored else text) if "back of the slope" in fault.message
        ]
        assert len(found) == told
        for fault in found:
            assert "over 30 m" in fault.message and "fixed" in fault.way_out
    # A wall is free on both sides, and level: it has no back.
    wall = SLOPE.replace("[60, 10], [40, 10], [28, 30]", "[60, 30]").format(base=OPEN)
    assert not [fault for fault in warnings(wall) if "back of the slope" in fault.message]
