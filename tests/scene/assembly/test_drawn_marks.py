"""Bolts, water tables, monitors, forces and supports by the names of what is drawn: the same as given by numbers."""

import numpy as np
import pytest

from geomech.scene import SceneError, load_scene
from geomech.shapes.gmsh_models.session import gmsh_session

#: Two courses of rock on a base, a bolt in two pieces and a pair of others, a water table in two lines, three points.
MODEL = """
Point(1)={0,0,0,1};Point(2)={6,0,0,1};Point(3)={6,2,0,1};Point(4)={0,2,0,1};
Line(1)={1,2};Line(2)={2,3};Line(3)={3,4};Line(4)={4,1};Curve Loop(1)={1,2,3,4};Plane Surface(1)={1};
Point(11)={0,1,0,1};Point(12)={6,1,0,1};Line(11)={11,12};
Point(13)={3,0,0,1};Point(14)={3,2,0,1};Line(13)={13,14};
Point(21)={1,1.9,0,1};Point(22)={1,1,0,1};Point(23)={1,0.1,0,1};Line(21)={21,22};Line(22)={22,23};
Point(24)={4,1.8,0,1};Point(25)={4.5,0.2,0,1};Line(23)={24,25};
Point(26)={5,1.8,0,1};Point(27)={5.5,0.2,0,1};Line(24)={26,27};
Point(31)={0,0.5,0,1};Point(32)={3,0.7,0,1};Point(33)={6,1.5,0,1};Line(31)={32,31};Line(32)={32,33};
Point(41)={2,1.9,0,1};Point(42)={5.9,1.9,0,1};Point(43)={2.5,1.9,0,1};
Physical Surface("rock")={1};
Physical Curve("fixed")={1};
Physical Curve("guided:y")={2};
Physical Curve("load:top")={3};
Physical Curve("joint:bed")={11};
Physical Curve("joint:cross")={13};
Physical Curve("bolt:crown")={21,22};
Physical Curve("bolt:row")={23,24};
Physical Curve("water:high")={31,32};
Physical Point("monitor:crest")={41};
Physical Point("probe:back")={42};
Physical Point("load:crane")={43};
"""
COMMON = """
[materials.rock]
youngs_modulus_pa = 1e10
poissons_ratio = 0.2
density_kg_m3 = 2600
[joints.default]
friction_angle_deg = 30
[loads]
gravity_m_s2 = [0.0, -9.81]
[[loads.tractions]]
edge = "load:top"
value_pa = [0.0, -1e4]
[growth]
enabled = false
[run]
end_time_s = 1.0
"""
DRAWN = (
    '[geometry]\nmodel = "model.geo"\n'
    + COMMON
    + """
[loads.water]
line = "water:high"
[[loads.forces]]
point = "load:crane"
value_n_per_m = [0.0, -1e5]
[[loads.bolts]]
lines = ["bolt:cro*"]
stiffness_n_per_m = 1e8
[[loads.bolts]]
lines = ["bolt:row"]
axial_stiffness_n = 1e8
active_length_m = 0.4
"""
)
NUMBERS = """
[loads.water]
points = [[0.0, 0.5], [3.0, 0.7], [6.0, 1.5]]
[[loads.forces]]
at = [2.5, 1.9]
value_n_per_m = [0.0, -1e5]
[[loads.bolts]]
name = "crown"
start = [1.0, 1.9]
end = [1.0, 0.1]
stiffness_n_per_m = 1e8
[[loads.bolts]]
name = "row 1"
start = [4.0, 1.8]
end = [4.5, 0.2]
axial_stiffness_n = 1e8
active_length_m = 0.4
[[loads.bolts]]
name = "row 2"
start = [5.0, 1.8]
end = [5.5, 0.2]
axial_stiffness_n = 1e8
active_length_m = 0.4
[[monitors]]
name = "crest"
at = [2.0, 1.9]
[[monitors]]
name = "back"
at = [5.9, 1.9]
"""
#: The same drawing as a table of traces.
TABLE = """id,set,x,y
a,outline,0,0
a,outline,6,0
a,outline,6,2
a,outline,0,2
a,outline,0,0
b,fixed,0,0
b,fixed,6,0
c,guided:y,6,0
c,guided:y,6,2
d,load:top,6,2
d,load:top,0,2
e,bed,0,1
e,bed,6,1
f,cross,3,0
f,cross,3,2
g,bolt:crown,1,1.9
g,bolt:crown,1,1
h,bolt:crown,1,1
h,bolt:crown,1,0.1
i,bolt_row,4,1.8
i,bolt_row,4.5,0.2
j,bolt_row,5,1.8
j,bolt_row,5.5,0.2
k,water:high,3,0.7
k,water:high,0,0.5
l,water:high,3,0.7
l,water:high,6,1.5
crest,monitor,2,1.9
back,probe,5.9,1.9
m,load:crane,2.5,1.9
"""


@pytest.fixture
def scene(tmp_path):
    (tmp_path / "model.geo").write_text(MODEL, encoding="utf-8")
    (tmp_path / "map.csv").write_text(TABLE, encoding="utf-8")

    def load(text=DRAWN, name="scene.toml", model=None):
        if model is not None:
            (tmp_path / "model.geo").write_text(model, encoding="utf-8")
        (tmp_path / name).write_text(text, encoding="utf-8")
        return load_scene(tmp_path / name)

    return load


def errors(load, *changes, **options):
    text = DRAWN
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    with pytest.raises(SceneError) as caught:
        load(text, **options)
    return caught.value.errors


def told(problem):
    """What the loads and points of a problem are, in numbers."""
    loads = problem.loads
    bolts = [(b.name, b.block, b.other, *map(tuple, (b.start, b.end))) for b in loads.bolts]
    points = {name: (block, tuple(at)) for name, (block, at) in problem.monitors.items()}
    forces = [(f.block, tuple(f.at)) for f in loads.point_loads]
    return (
        bolts,
        loads.water.points.tolist(),
        points,
        forces,
        problem.blocks.fixed.tolist(),
        problem.blocks.constrained.tolist(),
    )


def test_what_is_drawn_is_what_numbers_say(scene, tmp_path):
    found = scene()
    plain = MODEL.split('Physical Curve("bolt:crown")')[0]
    given = scene('[geometry]\nmodel = "model.geo"\n' + COMMON + NUMBERS, "numbers.toml", plain)
    assert found.warnings == () and told(found.problem()) == told(given.problem())
    blocks = found.problem().blocks
    below = [k for k in range(4) if blocks.loops(k)[0][:, 1].min() == 0.0]
    assert np.flatnonzero(blocks.fixed).tolist() == below and len(below) == 2
    assert blocks.constrained[:, 0].sum() == 2 and not blocks.constrained[:, 1].any()
    assert any("2 blocks by edges" in line or "3 blocks by edges" in line for line in found.overview())


def test_traces_carry_the_same_marks(scene):
    found = scene()
    table = scene(DRAWN.replace('model = "model.geo"', '[[geometry.traces]]\nfile = "map.csv"'), "table.toml")
    assert table.warnings == () and told(table.problem()) == told(found.problem())


def test_a_mesh_carries_what_it_has_lines_and_nodes_for(scene, tmp_path):
    with gmsh_session() as gmsh:
        gmsh.merge(str(tmp_path / "model.geo"))
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.3)
        gmsh.model.mesh.generate(2)
        gmsh.write(str(tmp_path / "model.msh"))
    text = (
        '[geometry]\nmodel = "model.msh"\n'
        + COMMON
        + '[[loads.bolts]]\nlines = ["bolt:crown"]\nstiffness_n_per_m = 1e8\n'
    )
    problem = scene(text, "mesh.toml").problem()
    (bolt,) = problem.loads.bolts
    assert sorted([tuple(bolt.start), tuple(bolt.end)]) == [(1.0, 0.1), (1.0, 1.9)]
    assert {name: tuple(at) for name, (_, at) in problem.monitors.items()} == {"crest": (2.0, 1.9), "back": (5.9, 1.9)}


def test_the_resolved_scene_keeps_its_names(scene, tmp_path):
    import tomli_w

    first = scene()
    again = scene(tomli_w.dumps(first.resolved()), "resolved.toml")
    assert told(first.problem()) == told(again.problem()) and again.warnings == ()


@pytest.mark.parametrize(
    ("changes", "key", "message", "way_out"),
    [
        ([('"bolt:cro*"', '"bolt:crwn"')], "loads.bolts[0].lines[0]", "called 'bolt:crwn'", "'bolt:crown'"),
        ([('"bolt:cro*"', '"bolt:*"')], "loads.bolts[1].lines[0]", "have two tables", "one of the two"),
        ([('"water:high"', '"water:hi"')], "loads.water.line", "no water table 'water:hi'", "'water:high'"),
        ([('line = "water:high"', "")], "loads.water", "no water table 'water'", "did you mean"),
        ([('"load:crane"', '"load:cran"')], "loads.forces[0].point", "no point 'load:cran'", "'load:crane'"),
        ([('"load:crane"', '"bolt:row"')], "loads.forces[0].point", "no point 'bolt:row'", "there is load:crane"),
        ([('lines = ["bolt:row"]', "")], "loads.bolts[1]", "`start` and `end`, or", ""),
        (
            [("[growth]", '[[monitors]]\nname = "crst"\n[growth]')],
            "monitors[0]",
            "no point called 'monitor:crst'",
            "'crest'",
        ),
    ],
)
def test_tables_that_mean_nothing_drawn_are_refused(scene, changes, key, message, way_out):
    found = errors(scene, *changes)
    fault = next(fault for fault in found if message in fault.message)
    assert key in fault.place and "scene.toml:" in fault.place and way_out in fault.way_out


def test_drawn_things_that_no_table_means_are_reported(scene):
    text = '[geometry]\nmodel = "model.geo"\n' + COMMON
    model = MODEL + 'Physical Point("corner")={3};Physical Curve("water")={32};\n'
    messages = [warning.message for warning in scene(text, model=model).warnings]
    for part in (
        "'bolt:crown'",
        "'bolt:row'",
        "'water:high' is drawn and not used",
        "'load:crane'",
        "'corner' has no effect",
    ):
        assert any(part in message for message in messages), part
    assert all(message.startswith("model.geo: ") for message in messages)


def test_faults_of_drawn_bolts_stand_where_their_name_does(scene):
    # One end in the air above the rock.
    found = errors(scene, model=MODEL.replace("Point(21)={1,1.9,0,1}", "Point(21)={1,2.5,0,1}"))
    assert "loads.bolts[0].lines" in found[0].place and "(1, 2.5) is outside all blocks" in found[0].message
    found = errors(scene, model=MODEL.replace("Point(41)={2,1.9,0,1}", "Point(41)={2,5,0,1}"))
    assert "geometry.model" in found[0].place and "monitor 'crest'" in found[0].message
    found = errors(scene, model=MODEL.replace("Point(33)={6,1.5,0,1}", "Point(33)={2,1.5,0,1}"))
    assert "turns back at" in found[0].message and "geometry.model" in found[0].place
    found = errors(scene, model=MODEL.replace("guided:y", "guided:z"))
    assert "without the axis" in found[0].message
    # Two pieces that do not go on are two bolts, and both end on the joint.
    found = errors(scene, model=MODEL.replace("Point(22)={1,1,0,1}", "Point(22)={1.3,1,0,1}"))
    assert len(found) == 2 and all("(1.3, 1) lies where blocks" in fault.message for fault in found)


def test_a_monitor_table_may_place_a_drawn_point(scene):
    on_a_joint = MODEL.replace("Point(41)={2,1.9,0,1}", "Point(41)={2,1,0,1}")
    (fault,) = errors(scene, model=on_a_joint)
    assert "lies where blocks" in fault.message
    text = DRAWN + '[[monitors]]\nname = "crest"\nat = [2.0, 1.5]\n'
    assert scene(text, model=on_a_joint).problem().monitors["crest"][1] == (2.0, 1.5)


def test_a_drawn_bar_that_misses_all_joints_is_left_out(scene):
    short = MODEL.replace("Point(27)={5.5,0.2,0,1}", "Point(27)={5.1,1.5,0,1}")
    found = scene(model=short)
    assert [bolt.name for bolt in found.problem().loads.bolts] == ["crown", "row 1/1"]
    (warning,) = found.warnings
    assert "bolt 'row 2' crosses no joint" in warning.message and "loads.bolts[1].lines" in warning.place
