"""Joints drawn in Gmsh, and the same model from every kind of file that Gmsh writes."""

import math

import numpy as np
import pytest

from geomech.scene import SceneError, load_scene
from geomech.shapes import cut, read_gmsh_model
from geomech.shapes.gmsh_models.session import gmsh_session

#: A rock of 4 × 3 m with a square hole, a joint from rim to rim, one that ends in rock, and a crack.
MODEL = """
Point(1)={0,0,0,0.7};Point(2)={4,0,0,0.7};Point(3)={4,3,0,0.7};Point(4)={0,3,0,0.7};
Line(1)={1,2};Line(2)={2,3};Line(3)={3,4};Line(4)={4,1};Curve Loop(1)={1,2,3,4};
Point(5)={3,1,0,0.3};Point(6)={3.5,1,0,0.3};Point(7)={3.5,1.5,0,0.3};Point(8)={3,1.5,0,0.3};
Line(5)={5,6};Line(6)={6,7};Line(7)={7,8};Line(8)={8,5};Curve Loop(2)={5,6,7,8};
Plane Surface(1)={1,2};
Point(11)={1,0,0,0.5};Point(12)={1,3,0,0.5};Line(11)={11,12};
Point(13)={1,2,0,0.5};Point(14)={2,2.5,0,0.5};Line(12)={13,14};
Point(15)={1.5,0.5,0,0.2};Point(16)={1.8,0.9,0,0.2};Line(13)={15,16};
Line{13} In Surface{1};
Physical Surface("rock")={1};
Physical Curve("load:top")={3};
Physical Curve("fixed")={1};
Physical Curve("joint:fault")={11};
Physical Curve("joint:splay")={12};
Physical Curve("crack:flaw")={13};
"""
#: The same with nothing that a mesh cannot carry: joints are conforming, inside the surface.
CONFORMING = (
    MODEL.replace("Point(13)={1,2,0,0.5}", "Point(13)={1.2,2,0,0.5}")
    .replace("Point(11)={1,0,0,0.5};Point(12)={1,3,0,0.5}", "Point(11)={1,0.4,0,0.5};Point(12)={1,2.6,0,0.5}")
    .replace("Line{13}", "Line{11, 12, 13}")
)


def cutting_of(path, **options):
    drawing = read_gmsh_model(path, **options)
    return drawing, cut(drawing.zones, drawing.joints)


def test_a_joint_parts_the_rock_and_one_that_ends_in_it_is_a_crack(tmp_path):
    path = tmp_path / "model.geo"
    path.write_text(MODEL)
    drawing, cutting = cutting_of(path)
    assert drawing.warnings == () and [t.name for t in drawing.traces] == ["flaw"]
    assert sorted(cutting.blocks.areas()) == pytest.approx([3.0, 9.0 - 0.25], rel=1e-14)
    assert len(cutting.blocks.edges_named("joint:fault")) == 2
    assert cutting.cracks.names == ("splay 1",)
    assert cutting.cracks.lengths.sum() == pytest.approx(math.sqrt(1.25), rel=1e-12)


def test_an_interface_of_two_surfaces_that_is_called_a_joint_is_one(tmp_path):
    path = tmp_path / "two.geo"
    path.write_text(
        'SetFactory("OpenCASCADE");Rectangle(1)={0,0,0,4,3};Point(100)={1,0,0};Point(101)={2,3,0};Line(100)={100,101};'
        "v()=BooleanFragments{Surface{1};Delete;}{Curve{100};Delete;};"
        's()=Surface{:};Physical Surface("rock")={s()};c()=Curve In BoundingBox{0.9,-0.1,-1,2.1,3.1,1};'
        'Physical Curve("joint:fault")={c()};\n'
    )
    drawing, cutting = cutting_of(path)
    assert len(drawing.zones) == 2 and drawing.joints == ()
    assert sorted(cutting.blocks.areas()) == pytest.approx([4.5, 7.5], rel=1e-12)
    assert len(cutting.blocks.edges_named("joint:fault")) == 2


@pytest.mark.first_by_default(2)
@pytest.mark.parametrize(
    ("name", "version", "binary"),
    [
        ("m.msh", 2.2, 0),
        ("m.msh", 2.2, 1),
        ("m.msh", 4.1, 0),
        ("m.msh", 4.1, 1),
        ("m.geo_unrolled", 0, 0),
    ],
)
def test_every_file_gives_the_drawing_of_the_model(tmp_path, name, version, binary):
    """Outlines, names, joints and cracks come back as drawn; the mesh's nodes leave no trace. Sixteen digits are in
    every file, so that the difference is round-off."""
    source, copy = tmp_path / "model.geo", tmp_path / name
    source.write_text(CONFORMING)
    with gmsh_session() as gmsh:
        gmsh.merge(str(source))
        if version:
            gmsh.model.mesh.generate(2)
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.write(str(copy))
    first, second = read_gmsh_model(source), read_gmsh_model(copy)
    assert second.warnings == ()
    (a,), (b,) = first.zones, second.zones
    for one, other, names, others in zip(a.loops, b.loops, a.edge_names, b.edge_names, strict=True):
        assert corners(one, names) == corners(other, others)
    for one, other in ((first.traces, second.traces), (first.joints, second.joints)):
        assert [part.name for part in one] == [part.name for part in other]
        for left, right in zip(one, other):
            assert [sorted(np.round(line, 12).tolist()) for line in left.lines] == [
                sorted(np.round(line, 12).tolist()) for line in right.lines
            ]


def corners(loop, names):
    """Corners and the names of the edges that they bound, whatever the sense and the start of the loop."""
    edges = zip(np.round(loop, 12).tolist(), np.round(np.roll(loop, -1, axis=0), 12).tolist(), names)
    return sorted((sorted((a, b)), name) for a, b, name in edges)


@pytest.mark.parametrize("suffix", ["brep", "step"])
def test_files_of_shapes_give_a_zone_a_surface(tmp_path, suffix):
    path = tmp_path / f"shape.{suffix}"
    with gmsh_session() as gmsh:
        rock = gmsh.model.occ.addRectangle(0, 0, 0, 4, 3)
        tunnel = gmsh.model.occ.addDisk(2, 1.5, 0, 0.5, 0.5)
        gmsh.model.occ.cut([(2, rock)], [(2, tunnel)])
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    # Gmsh says mm in every STEP file; a .brep says nothing.
    drawing, cutting = cutting_of(path, chord_tolerance=1e-5, unit="m")
    # Chords stand inside the circle: the hole is too small, by less than its rim times the tolerance.
    assert 0 < cutting.blocks.areas()[0] - (12 - math.pi / 4) < math.pi * 1e-5
    assert drawing.zones[0].name


@pytest.mark.first_by_default(4)
@pytest.mark.parametrize(
    ("suffix", "says", "unit", "metres"),
    [
        ("step", "MILLI", None, 1e-3),
        ("step", "$", None, 1.0),
        ("step", "CENTI", None, 1e-2),
        ("step", "MILLI", "m", 1.0),
        ("step", "$", "mm", 1e-3),
        ("brep", "", None, 1.0),
        ("brep", "", "mm", 1e-3),
        ("geo", "", "ft", 0.3048),
    ],
)
def test_lengths_arrive_in_metres(tmp_path, suffix, says, unit, metres):
    path = tmp_path / f"shape.{suffix}"
    if suffix == "geo":
        path.write_text('SetFactory("OpenCASCADE");Rectangle(1)={0,0,0,60,120};Physical Surface("rock")={1};\n')
    else:
        with gmsh_session() as gmsh:
            gmsh.model.occ.addRectangle(0, 0, 0, 60, 120)
            gmsh.model.occ.synchronize()
            gmsh.write(str(path))
    if says:
        # What the file says is known: ISO 10303-41 puts it into SI_UNIT.
        text, said = path.read_text(), says if says == "$" else f".{says}."
        assert text.count("SI_UNIT(.MILLI.,.METRE.)") == 1
        path.write_text(text.replace("SI_UNIT(.MILLI.,.METRE.)", f"SI_UNIT({said},.METRE.)"))
    drawing, cutting = cutting_of(path, unit=unit)
    assert np.ptp(drawing.zones[0].loops[0], axis=0) == pytest.approx([60 * metres, 120 * metres], rel=1e-12)
    assert cutting.blocks.areas() == pytest.approx([7200 * metres**2], rel=1e-12)


SCENE = """
title = "drawn joints"
[geometry]
model = "model.geo"
[[geometry.joint_sets]]
name = "beds"
angle_deg = 0
spacing_m = 1.3
[materials.rock]
youngs_modulus_pa = 1e10
poissons_ratio = 0.2
density_kg_m3 = 2600
k_ic_pa_sqrt_m = 1e6
[joints.default]
friction_angle_deg = 30
[joints.fault]
edges = ["joint:fault"]
friction_angle_deg = 20
[run]
end_time_s = 1
"""


def test_a_last_line_that_gmsh_does_not_read_is_reported(tmp_path):
    path = tmp_path / "model.geo"
    path.write_text(MODEL.strip())
    (warning,) = read_gmsh_model(path).warnings
    assert "last line has no line end" in warning[0]


def test_a_scene_joins_a_models_joints_with_sets(tmp_path):
    (tmp_path / "model.geo").write_text(MODEL)
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    problem = load_scene(path).problem()
    assert {"joint:fault", "joint:beds", "load:top", "fixed"} <= set(problem.blocks.edge_names)
    assert problem.blocks.areas().sum() == pytest.approx(12 - 0.25, rel=1e-12)
    # A bed crosses the flaw: there is one in each of its blocks.
    flaws = [k for k, name in enumerate(problem.cracks.names) if name.startswith("flaw")]
    assert len(flaws) == 2
    assert problem.cracks.lengths[np.isin(problem.cracks.crack, flaws)].sum() == pytest.approx(0.5, rel=1e-9)
    # A mistake of a set is told at the set, one of the model with its entity.
    path.write_text(SCENE.replace("angle_deg = 0\n", 'angle_deg = 0\nends_on = ["fold"]\n'))
    with pytest.raises(SceneError, match=r"(?s)joint_sets\[0\].*'fold'.*'fault', 'splay'"):
        load_scene(path)
    (tmp_path / "model.geo").write_text(MODEL.replace("Point(16)={1.8,0.9,0", "Point(16)={9,9,0"))
    path.write_text(SCENE)
    with pytest.raises(SceneError, match=r"(?s)model.geo: curve 13: crack 'flaw'"):
        load_scene(path)
