"""Motion, water, bolts, excavations and stress in a scene: what they become, and what is refused with its place."""

import numpy as np
import pytest

from geomech.coupling import cycles
from geomech.scene import SceneError, load_scene

SCENE = """\
title = "A block on a base"

[[geometry.zones]]
name = "base"
rectangle = [-2.0, -1.0, 3.0, 0.0]

[[geometry.zones]]
name = "block"
rectangle = [0.0, 0.0, 1.0, 1.0]

[[geometry.zones]]
name = "top"
rectangle = [0.0, 1.0, 1.0, 2.0]

[[geometry.edges]]
name = "right"
line = [[1.0, 0.0], [1.0, 1.0]]

[materials.rock]
youngs_modulus_pa = 10e9
poissons_ratio = 0.25
density_kg_m3 = 2600

[zones.base]
fixed = true

[joints.default]
friction_angle_deg = 40

[dda]
time_step_s = 0.5
max_displacement_ratio = 0.1

[run]
end_time_s = 2.0
"""
GRAVITY = "\n[loads]\ngravity_m_s2 = [0.0, -9.81]\n"
ALL = (
    GRAVITY
    + """
[[loads.tractions]]
edge = "right"
value_pa = [-1e4, 0.0]
frequency_hz = 0.25
phase_deg = 90
follower = true
profile = {start = [1.0, 0.0], end = [1.0, 1.0], factors = [1.0, 0.0]}

[[loads.forces]]
at = [0.5, 2.0]
file = "push.csv"
direction = [0.0, -1.0]

[loads.water]
points = [[-1.0, 0.5], [2.0, 0.2]]
level_times_s = [0.0, 2.0]
levels_m = [0.0, 0.1]
dry_edges = ["right"]

[loads.base]
frame = "base"
acceleration_m_s2 = [0.5, 0.0]

[[loads.motions]]
zone = "base"
velocity_m_per_s = [0.0, 1e-6]

[[loads.point_motions]]
at = [1.0, 2.0]
zone = "top"
axes = "x"
velocity_m_per_s = [1e-6, 0.0]
stiffness_n_per_m = 1e8

[[loads.bolts]]
name = "tie"
start = [0.5, 0.5]
end = [0.6, 1.5]
stiffness_n_per_m = 1e8
pretension_n_per_m = 1e4

[[loads.bolts]]
name = "bar"
start = [0.2, 1.8]
end = [0.2, -0.5]
axial_stiffness_n = 1e7
active_length_m = 0.3

[[loads.bolts]]
name = "anchor"
start = [0.9, 0.2]
end = [2.0, -0.5]
end_in_ground = true
stiffness_n_per_m = 1e7
start_s = 0.75

[[loads.excavations]]
time_s = 1.5
zones = ["top"]

[loads.in_situ]
surface_m = 2.0
unit_weight_n_per_m3 = 25506
k0 = 0.0
"""
)


def test_all_of_it_arrives_and_runs(scene_file, tmp_path):
    (tmp_path / "push.csv").write_text("time [s], force [kN/m]\n0, 0\n1, 2\n2, 2\n")
    scene = load_scene(scene_file(SCENE + ALL))
    loads = scene.problem().loads
    (traction,) = loads.edge_tractions
    assert traction.follower and traction.profile.factors == (1.0, 0.0)
    assert traction.history.at(0.0) == pytest.approx([-1e4, 0.0]) and traction.history.at(1.0)[0] == pytest.approx(
        0, abs=1e-9
    )
    assert loads.point_loads[0].history.at(0.5).tolist() == [0.0, -1000.0]
    assert loads.water.level.at(1.0).tolist() == [0.05] and loads.water.dry == ("right",)
    assert loads.base.frame == "base" and loads.block_motions[0].unknowns == ("u0", "v0", "r0")
    assert loads.point_motions[0].direction == (1.0, 0.0)
    assert [b.name for b in loads.bolts] == ["tie", "bar/1", "bar/2", "anchor"]
    assert [(b.block, b.other) for b in loads.bolts] == [(1, 2), (2, 1), (1, 0), (1, -1)]
    assert loads.excavations[0].blocks == (2,)
    assert any("bolts: 3" in line for line in scene.overview())
    records = list(cycles(scene.problem()))
    last = records[-1]
    assert last.state.time == pytest.approx(2.0) and last.state.removed.tolist() == [False, False, True]
    assert last.state.bolts["broken"].tolist() == [True, True, False, False]
    assert records[1].statistics["bolt:tie"] == pytest.approx(1e4, rel=0.2)
    assert [event.kind for record in records for event in record.events] == ["excavation"]
    # The fixed base goes up as it is told to; the bolts at rest in it come along.
    assert (last.state.vertices - last.blocks.vertices)[0, 1] == pytest.approx(2e-6, rel=1e-9)
    assert (
        np.abs(records[0].state.vertices - records[0].blocks.vertices).max() == 0.0
    )  # at rest under its in-situ stress
    # A resolved scene gives the same problem from anywhere.
    import tomli_w

    again = tmp_path / "elsewhere"
    again.mkdir()
    (again / "scene.toml").write_text(tomli_w.dumps(scene.resolved()))
    assert load_scene(again).problem().loads.point_loads[0].history.at(0.5).tolist() == [0.0, -1000.0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[[loads.forces]]\nat = [0.5, 2.0]\nfile = "none.csv"', "the record cannot be read.*none.csv"),
        ('[[loads.forces]]\nat = [0.5, 2.0]\nfile = "bad.csv"', "bad.csv:2: 'x' is not a finite number"),
        ('[[loads.forces]]\nat = [0.5, 2.0]\nfile = "one.csv"', "1 column.*expected 2"),
        ("[[loads.forces]]\nat = [0.5, 2.0]\nrate_n_per_m_s = [1, 0]\nfrequency_hz = 1.0", "`frequency_hz` belongs to"),
        ('[[loads.motions]]\nzone = "tip"\nvelocity_m_per_s = [0, 1]', "the geometry has no zone 'tip'"),
        ("[[loads.point_motions]]\nat = [-1.5, -0.5]\nvelocity_m_per_s = [0, 1]", "lies in the fixed zone 'base'"),
        ("[[loads.point_motions]]\nat = [9, 9]\nvelocity_m_per_s = [0, 1]", "is outside all blocks"),
        (
            "[[loads.bolts]]\nstart = [0.5, 0.5]\nend = [9, 9]\nstiffness_n_per_m = 1e8",
            "the bolt's other end .9, 9. is outside",
        ),
        (
            "[[loads.bolts]]\nstart = [0.5, 0.5]\nend = [0.6, 0.6]\nstiffness_n_per_m = 1e8",
            "both ends are in the same block",
        ),
        (
            "[[loads.bolts]]\nstart = [-1.5, -0.5]\nend = [5, 5]\nend_in_ground = true\nstiffness_n_per_m = 1e8",
            "has no effect",
        ),
        (
            "[[loads.bolts]]\nstart = [0.5, 0.5]\nend = [0.5, 0.6]\naxial_stiffness_n = 1e8\nactive_length_m = 0.1",
            "crosses no joint",
        ),
        ("[[loads.bolts]]\nstart = [0.5, 0.5]\nend = [0.5, 0.6]", "give `stiffness_n_per_m`, or `axial_stiffness_n`"),
        ('[[loads.excavations]]\ntime_s = 1.0\nzones = ["tap"]', "the geometry has no zone 'tap'"),
        (
            "[[loads.excavations]]\ntime_s = 1.0\npolygon = [[7, 7], [8, 7], [8, 8]]",
            "no block's centroid lies in the polygon",
        ),
        ('[loads.water]\npoints = [[0, 1]]\ndry_edges = ["left"]', "no edge is called 'left'"),
        ("[loads.water]\npoints = [[1, 1], [0, 1]]", "increasing x"),
        ('[loads.base]\nacceleration_m_s2 = [1, 0]\nbaseline = "linear"', "`baseline` belongs to a record"),
        ("[loads.in_situ]\nk0 = 0.5", "give `surface_m`, `unit_weight_n_per_m3` and `k0`, or `stress_pa`"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(scene_file, tmp_path, text, message):
    (tmp_path / "bad.csv").write_text("0, 1, 2\n1, x, 2\n")
    (tmp_path / "one.csv").write_text("0, 1\n1, 2\n")
    with pytest.raises(SceneError, match=message) as caught:
        load_scene(scene_file(SCENE + GRAVITY + "\n" + text + "\n"))
    fault = caught.value.errors[0]
    assert "scene.toml:" in fault.place and "loads" in fault.place and fault.way_out
