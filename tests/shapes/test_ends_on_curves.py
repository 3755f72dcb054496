"""Joints and cracks that are drawn up to a curve end on the chords that stand for it: models, DXF and scenes, turned and
moved at random."""

import math

import numpy as np
import pytest

from geomech.scene import load_scene
from geomech.shapes import cut, read_field_file, read_gmsh_model
from geomech.shapes.curves import Chords, ended_on
from geomech.shapes.parts import Joint, Zone
from geomech.shapes.traces.field_lines import drawing_of_lines, named_lines

#: Directions of joints about a tunnel, rad: none of them meets a corner of its chords.
WAYS = (0.35, 0.9, 1.45, 2.0, 2.55)


def turned(points, seed: int) -> np.ndarray:
    """``points`` (n, 2) turned and moved at random; as drawn for the seed 0."""
    rng = np.random.default_rng(seed)
    angle, shift = (rng.uniform(0, 2 * math.pi), rng.uniform(-30, 30, 2)) if seed else (0.0, np.zeros(2))
    c, s = math.cos(angle), math.sin(angle)
    return np.asarray(points, dtype=float) @ np.array([[c, s], [-s, c]]) + shift


def tunnel(seed: int, joints: bool = True) -> str:
    """A square of 24 m about a circular hole of 3 m radius, five radial joints from its wall to the rim."""
    radial = [(r * math.cos(a), r * math.sin(a)) for a in WAYS for r in (3.0, 40.0)]
    points = turned(
        [(0, 0), (3, 0), (0, 3), (-3, 0), (0, -3), (-12, -12), (12, -12), (12, 12), (-12, 12), *radial], seed
    )
    text = [f"Point({k})={{{x!r},{y!r},0}};" for k, (x, y) in enumerate(points.tolist(), 1)]
    text += ["Circle(1)={2,1,3};Circle(2)={3,1,4};Circle(3)={4,1,5};Circle(4)={5,1,2};"]
    text += ["Line(5)={6,7};Line(6)={7,8};Line(7)={8,9};Line(8)={9,6};"]
    text += ["Curve Loop(1)={5,6,7,8};Curve Loop(2)={1,2,3,4};Plane Surface(1)={1,2};"]
    text += ['Physical Surface("rock")={1};Physical Curve("tunnel:wall")={1,2,3,4};']
    if joints:
        text += [f"Line({20 + k})={{{10 + 2 * k},{11 + 2 * k}}};" for k in range(len(WAYS))]
        text += [f'Physical Curve("joint:radial")={{{",".join(str(20 + k) for k in range(len(WAYS)))}}};']
    return "\n".join([*text, ""])


def cut_alone(drawing, dead_ends="trim"):
    return cut(drawing.zones, drawing.joints, dead_ends=dead_ends)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("dead_ends", ["trim", "cracks"])
def test_radial_joints_part_the_rock_about_a_tunnel(tmp_path, seed, dead_ends):
    path = tmp_path / "tunnel.geo"
    path.write_text(tunnel(seed))
    drawing = read_gmsh_model(path)
    cutting = cut_alone(drawing, dead_ends)
    assert cutting.blocks.n_blocks == 5 and cutting.cracks.n_cracks == 0
    assert cutting.partings[0][:3] == ("joint:radial", 5, 5)
    assert cutting.repairs == ()
    # The blocks tile the zone: the tunnel's chords are 28 sides or more, which the joints leave in place.
    area = sum(abs(_area(loop)) * sign for loop, sign in zip(drawing.zones[0].loops, (1, -1)))
    assert cutting.blocks.areas().sum() == pytest.approx(area, rel=1e-10)  # coordinates carry twelve digits
    assert set(cutting.blocks.edge_names) == {"", "joint:radial", "tunnel:wall"}


def _area(loop):
    x, y = loop.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


@pytest.mark.parametrize("seed", range(2))
def test_joints_of_the_scene_end_on_a_curve_of_the_model(tmp_path, seed):
    """With three digits: within the chord tolerance of 2.4 mm, not on the circle itself."""
    (tmp_path / "tunnel.geo").write_text(tunnel(seed, joints=False))
    lines = [np.round(turned([(r * math.cos(a), r * math.sin(a)) for r in (3, 20)], seed), 3) for a in WAYS]
    joints = "\n".join(f'[[geometry.joints]]\nname = "radial"\npoints = {line.tolist()}\n' for line in lines)
    scene = tmp_path / "scene.toml"
    scene.write_text(
        f"""title = "tunnel"
[geometry]
model = "tunnel.geo"
dead_ends = "trim"
{joints}
[materials.rock]
youngs_modulus_pa = 1e10
poissons_ratio = 0.25
density_kg_m3 = 2600
[zones.rock]
fixed = true
[dda]
time_step_s = 1e-3
[run]
end_time_s = 0.1
"""
    )
    assert load_scene(scene).drawing.blocks.n_blocks == 5


def arch(seed: int) -> tuple[list, list]:
    """An arch of 4 and 5 m radius on six radial joints: (outline points with its two arcs, ends of joints)."""
    ways = np.linspace(0, math.pi, 9)[1:-1]
    joints = [turned([(r * math.cos(a), r * math.sin(a)) for r in (4.0, 5.0)], seed) for a in ways]
    return turned([(4, 0), (5, 0), (-5, 0), (-4, 0), (0, 0)], seed), joints


@pytest.mark.first_by_default(4)
@pytest.mark.parametrize("kind", [".geo", ".step", ".brep"])
@pytest.mark.parametrize("seed", range(2))
def test_an_arch_falls_apart_into_its_voussoirs(tmp_path, seed, kind):
    from geomech.shapes.gmsh_models.session import gmsh_session

    corners, joints = arch(seed)
    if kind == ".geo":
        points = [*corners, *(end for line in joints for end in line)]
        text = [f"Point({k})={{{x!r},{y!r},0}};" for k, (x, y) in enumerate(np.array(points).tolist(), 1)]
        crown = turned([(0, 4), (0, 5)], seed).tolist()
        text += [f"Point({50 + k})={{{x!r},{y!r},0}};" for k, (x, y) in enumerate(crown)]
        text += ["Line(1)={1,2};Circle(2)={2,5,51};Circle(3)={51,5,3};Line(4)={3,4};Circle(5)={4,5,50};"]
        text += ["Circle(6)={50,5,1};Curve Loop(1)={1,2,3,4,5,6};Plane Surface(1)={1};"]
        text += [f"Line({20 + k})={{{6 + 2 * k},{7 + 2 * k}}};" for k in range(7)]
        text += ['Physical Surface("arch")={1};Physical Curve("joint:bed")={20,21,22,23,24,25,26};\n']
        path = tmp_path / "arch.geo"
        path.write_text("\n".join(text))
    else:
        path = tmp_path / f"arch{kind}"
        with gmsh_session() as gmsh:
            occ = gmsh.model.occ
            tags = [occ.addPoint(x, y, 0) for x, y in corners.tolist()]
            crown = [occ.addPoint(x, y, 0) for x, y in turned([(0, 4), (0, 5)], seed).tolist()]
            loop = [
                occ.addLine(tags[0], tags[1]),
                occ.addCircleArc(tags[1], tags[4], crown[1]),
                occ.addCircleArc(crown[1], tags[4], tags[2]),
                occ.addLine(tags[2], tags[3]),
                occ.addCircleArc(tags[3], tags[4], crown[0]),
                occ.addCircleArc(crown[0], tags[4], tags[0]),
            ]
            surface = occ.addPlaneSurface([occ.addCurveLoop(loop)])
            occ.synchronize()
            gmsh.model.setEntityName(2, surface, "arch")
            for line in joints:
                curve = occ.addLine(*(occ.addPoint(x, y, 0) for x, y in line.tolist()))
                occ.synchronize()
                gmsh.model.setEntityName(1, curve, "joint:bed")
            gmsh.write(str(path))
    drawing = read_gmsh_model(path, unit="m")
    drawing_joints = drawing.joints
    if not drawing_joints:
        # A shape file that lost the names of its curves: the joints come from the scene.
        drawing_joints = ended_on([Joint("joint:bed", tuple(joints))], drawing.chords)
    cutting = cut(drawing.zones, drawing_joints, dead_ends="trim")
    assert cutting.blocks.n_blocks == 8
    assert np.ptp(cutting.blocks.areas()) < 2e-3


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("shape", ["circle", "bulged", "ellipse", "spline", "arcs"])
def test_dxf_curves_are_met_by_what_ends_on_them(tmp_path, seed, shape):
    ezdxf = pytest.importorskip("ezdxf")
    document = ezdxf.new(setup=True)
    document.units = 6
    space = document.modelspace()
    (centre,) = turned([(0, 0)], seed)
    space.add_lwpolyline(
        turned([(-12, -12), (12, -12), (12, 12), (-12, 12)], seed), close=True, dxfattribs={"layer": "zone-rock"}
    )
    hole = {"layer": "hole"}
    if shape == "circle":
        space.add_circle(centre, 3, dxfattribs=hole)
    elif shape == "bulged":
        (a, b) = turned([(3, 0), (-3, 0)], seed)
        space.add_lwpolyline([(*a, 1.0), (*b, 1.0)], format="xyb", close=True, dxfattribs=hole)
    elif shape == "ellipse":
        space.add_ellipse(centre, major_axis=(3, 0), ratio=1.0, dxfattribs=hole)
    elif shape == "arcs":
        space.add_arc(centre, 3, 10, 130, dxfattribs=hole)
        space.add_arc(centre, 3, 130, 10, dxfattribs=hole)
    else:
        around = turned([(3 * math.cos(a), 3 * math.sin(a)) for a in np.linspace(0, 2 * math.pi, 100)[:-1]], seed)
        space.add_spline_control_frame([*around, around[0]], dxfattribs=hole)
    for a in WAYS:
        line = turned([(r * math.cos(a), r * math.sin(a)) for r in (3, 20)], seed)
        space.add_line(*line, dxfattribs={"layer": "joint-radial"})
    path = tmp_path / "tunnel.dxf"
    document.saveas(path)
    named, _, _ = named_lines(read_field_file(path))
    drawing = drawing_of_lines(named)
    assert cut_alone(drawing).blocks.n_blocks == 5


@pytest.mark.parametrize("seed", range(2))
def test_joints_end_on_a_curved_joint_from_either_side(tmp_path, seed):
    """Beyond the chord of an arc, what ends on the arc would leave a stub as long as the chord's height."""
    path = tmp_path / "fold.geo"
    ways = np.array([0.5, 0.9, 1.3, 1.8, 2.2, 2.6])
    inner = [(r * math.cos(a), r * math.sin(a)) for a in ways[::2] for r in (0.5, 6.0)]
    outer = [(r * math.cos(a), r * math.sin(a)) for a in ways[1::2] for r in (6.0, 14.0)]
    points = turned(
        [(-8, -1), (8, -1), (8, 9), (-8, 9), (0, 0), (8, 0), (-8, 0), (6, 0), (-6, 0), *inner, *outer], seed
    )
    text = [f"Point({k})={{{x!r},{y!r},0}};" for k, (x, y) in enumerate(points.tolist(), 1)]
    (crown,) = turned([(0, 6)], seed).tolist()
    text += [f"Point(90)={{{crown[0]!r},{crown[1]!r},0}};Circle(9)={{8,5,90}};Circle(10)={{90,5,9}};"]
    text += ["Line(1)={1,2};Line(2)={2,3};Line(3)={3,4};Line(4)={4,1};Curve Loop(1)={1,2,3,4};Plane Surface(1)={1};"]
    text += ["Line(5)={8,6};Line(6)={7,9};"]
    text += [f"Line({20 + k})={{{10 + 2 * k},{11 + 2 * k}}};" for k in range(6)]
    text += ['Physical Surface("rock")={1};Physical Curve("joint:arc")={5,9,10,6};']
    text += ['Physical Curve("joint:in")={20,21,22};Physical Curve("joint:out")={23,24,25};\n']
    path.write_text("\n".join(text))
    cutting = cut_alone(read_gmsh_model(path), "cracks")
    # Two halves, the outer one in four; the inner joints end in rock near the centre.
    assert cutting.blocks.n_blocks == 2 + 3
    assert sorted(cutting.cracks.names) == ["in 1", "in 2", "in 3"]
    assert cutting.cracks.surface.sum() == 3 and cutting.cracks.lengths.min() > 5


@pytest.mark.parametrize("seed", range(2))
def test_a_crack_from_a_round_hole_opens_into_it(tmp_path, seed):
    from geomech.shapes import assemble

    path = tmp_path / "tunnel.geo"
    a = 0.35
    start, end = turned([(r * math.cos(a), r * math.sin(a)) for r in (3, 5)], seed).tolist()
    text = tunnel(seed, joints=False) + f"Point(80)={{{start[0]!r},{start[1]!r},0}};"
    text += f"Point(81)={{{end[0]!r},{end[1]!r},0}};Line(80)={{80,81}};" + 'Physical Curve("crack:one")={80};\n'
    path.write_text(text)
    drawing = read_gmsh_model(path)
    _, cracks = assemble(drawing.zones, drawing.traces)
    assert cracks.surface.sum() == 1 and len(cracks.tips) == 1


def test_traces_that_are_trimmed_away_whole_are_reported():
    square = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    joint = Joint("joint:a", (np.array([[2.0, 1.0], [2.0, 4.0]]), np.array([[0.0, 5.0], [10.0, 5.0]]),
                              np.array([[6.0, 5.0], [6.0, 7.0]]), np.array([[20.0, 5.0], [20.0, 7.0]])))  # fmt: skip
    cutting = cut([Zone("rock", (square,))], [joint], dead_ends="trim")
    gone = [repair for repair in cutting.repairs if repair.kind == "trimmed away"]
    assert [(repair.x, repair.y, repair.size) for repair in gone] == [(2.0, 2.5, 3.0), (6.0, 6.0, 2.0)]
    assert cutting.partings == (("joint:a", 3, 1, 10.0),)
    assert cut([Zone("rock", (square,))], [joint]).repairs == ()


def test_a_line_is_not_drawn_to_its_own_chords():
    """A spiral that nearly closes keeps its ends apart; another line's end comes to the chord."""
    angle = np.linspace(0, 2 * math.pi - 0.01, 40)
    spiral = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    chords = Chords.of([spiral], [0.05])
    (own,) = ended_on([Joint("joint:spiral", (spiral,))], chords)
    assert (own.lines[0] == spiral).all()
    (other,) = ended_on([Joint("joint:other", (np.array([[1.02, 0.1], [3.0, 0.3]]),))], chords)
    assert np.hypot(*other.lines[0][0]) <= 1.0 and (other.lines[0][1] == [3.0, 0.3]).all()
