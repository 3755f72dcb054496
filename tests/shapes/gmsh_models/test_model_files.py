"""Gmsh models: parameters, names, loops with holes and arcs, and what is said when they are wrong."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from geomech.shapes import GmshModelError, GmshUnavailable, assemble, read_gmsh_model
from geomech.shapes.gmsh_models import session

GEOMETRY = Path(__file__).parents[3] / "geometry"


def written(tmp_path, text):
    path = tmp_path / "model.geo"
    path.write_text(text + "\n")
    return path


def error_of(*args):
    with pytest.raises(GmshModelError) as caught:
        read_gmsh_model(*args)
    return caught.value


def two_cracks(**parameters):
    drawing = read_gmsh_model(GEOMETRY / "two_cracks.geo", parameters)
    return assemble(drawing.zones, drawing.traces)


@pytest.mark.parametrize("phi", [0, 30, 60, 90])
def test_the_second_crack_stands_at_phi_from_the_first(phi):
    """Against the closed form of its ends, at the twelve digits that a drawing keeps."""
    _, cracks = two_cracks(phi_deg=phi)
    angle = np.radians(45 + phi)
    half = 0.005 * np.array([np.cos(angle), np.sin(angle)])
    expected = [[0, -0.01] - half, [0, -0.01] + half]
    assert np.abs(cracks.nodes[cracks.segments[1]] - expected).max() < 1e-13
    assert np.allclose(cracks.nodes[cracks.segments[0]].mean(axis=0), [0, 0.01], atol=1e-15)


def test_the_other_reading_counts_phi_from_the_horizontal():
    for choice in ("horizontal", 1):
        _, cracks = two_cracks(phi_deg=30, phi_from=choice)
        run = np.diff(cracks.nodes[cracks.segments[1]], axis=0)[0]
        assert np.degrees(np.arctan2(run[1], run[0])) == pytest.approx(30, abs=1e-8)


def test_slopes_from_tip_to_tip():
    """Haeri et al. 2014 geometry: from crack 1's lower tip to crack 2's nearer tip, in degrees, by hand."""
    for phi, slope in ((0, -61.3), (30, -67.4), (60, -79.1)):
        _, cracks = two_cracks(phi_deg=phi)
        lower = cracks.nodes[cracks.segments[0, 0]]
        others = cracks.nodes[cracks.segments[1]]
        run = others[np.argmin(np.hypot(*(others - lower).T))] - lower
        # printed with one decimal
        assert np.degrees(np.arctan(run[1] / run[0])) == pytest.approx(slope, abs=0.06)


def test_platens_own_their_points_and_the_load_is_as_wide_as_the_specimen():
    blocks, _ = two_cracks()
    assert blocks.names == ("rock", "platen_bottom", "platen_top")
    assert blocks.areas() == pytest.approx([0.06 * 0.12, 0.07 * 0.01, 0.07 * 0.01], rel=1e-14)
    (top,) = blocks.edges_named("load:top")
    assert np.ptp(blocks.vertices[[top, blocks.next_vertex[top]], 0]) == pytest.approx(0.06, abs=1e-15)
    assert blocks.vertex_block[blocks.edges_named("contact:top")].tolist() == [0, 2]
    assert blocks.vertex_block[blocks.edges_named("contact:bottom")].tolist() == [0, 1]


def test_without_platens_the_specimen_has_its_own_loaded_ends():
    blocks, _ = two_cracks(platens="none")
    assert blocks.names == ("rock",)
    assert len(blocks.edges_named("load:top")) == len(blocks.edges_named("load:bottom")) == 1


def test_with_a_platen_below_alone_the_load_stands_on_the_specimen():
    blocks, _ = two_cracks(platens="bottom")
    assert blocks.names == ("rock", "platen_bottom")
    assert blocks.vertex_block[blocks.edges_named("load:top")].tolist() == [0]


def test_without_overhang_the_platen_is_a_rectangle():
    blocks, _ = two_cracks(platen_overhang_m=0)
    assert blocks.n_vertices == 12 and len(blocks.edges_named("load:top")) == 1


def test_single_flaw_parameters():
    drawing = read_gmsh_model(
        GEOMETRY / "single_flaw.geo", {"angle_deg": 90, "half_length_m": 0.02, "centre_x_m": 0.01}
    )
    _, cracks = assemble(drawing.zones, drawing.traces)
    assert np.allclose(cracks.nodes, [[0.01, -0.02], [0.01, 0.02]], atol=1e-14)
    assert drawing.parameters["angle_deg"].value == 90


def test_parameters_do_not_leak_into_the_next_reading():
    two_cracks(phi_deg=90)
    assert read_gmsh_model(GEOMETRY / "two_cracks.geo").parameters["phi_deg"].value == 0


@pytest.mark.parametrize(
    ("parameters", "message", "way_out"),
    [
        ({"phi": 30}, "no parameter 'phi'", "did you mean 'phi_deg'?"),
        ({"phi_deg": 500}, "500 is outside its range [-180, 180]", "inside"),
        ({"phi_deg": "thirty"}, "'thirty' is not a number", "give a number"),
        ({"phi_from": "vertical"}, "'vertical' is not a number", '"crack1", "horizontal"'),
        ({"phi_from": 7}, "7 is not among its choices", "crack1"),
    ],
)
def test_bad_parameters(parameters, message, way_out):
    error = error_of(GEOMETRY / "two_cracks.geo", parameters)
    assert message in error.message and way_out in error.way_out
    assert error.parameter == next(iter(parameters))


def test_unknown_parameters_are_told_with_all_known_ones():
    way_out = error_of(GEOMETRY / "two_cracks.geo", {"qqq": 1}).way_out
    assert all(name in way_out for name in ("width_m", "alpha_deg", "phi_from", "platens"))


def test_a_parameter_that_another_one_brings_up(tmp_path):
    path = written(
        tmp_path,
        'DefineConstant[ more = {0, Name "Parameters/more"} ];\n'
        'If (more)\n DefineConstant[ w = {2, Name "Parameters/w"} ];\nElse\n w = 1;\nEndIf\n'
        "Point(1) = {0,0,0}; Point(2) = {w,0,0}; Point(3) = {w,1,0};"
        "Line(1) = {1,2}; Line(2) = {2,3}; Line(3) = {3,1};\n"
        'Curve Loop(1) = {1,2,3}; Plane Surface(1) = {1}; Physical Surface("rock") = {1};',
    )
    drawing = read_gmsh_model(path, {"w": 5, "more": 1})
    assert drawing.zones[0].loops[0][:, 0].max() == 5


def test_missing_files_and_faulty_models(tmp_path):
    assert "two_cracks.geo" in error_of(GEOMETRY / "two_crack.geo").way_out
    assert "line 2: syntax error" in error_of(written(tmp_path, "x = 1;\nPoint(1) = {0, 0;\n")).message
    assert "Unknown" in error_of(written(tmp_path, "Point(1) = {0, 0, 0};\nLine(1) = {1, 2};\n")).message
    assert "no physical surface" in error_of(written(tmp_path, "Point(1) = {0, 0, 0};\n")).message


TUNNEL = """
SetFactory("OpenCASCADE");
Rectangle(1) = {-2, -2, 0, 4, 4};
Disk(2) = {0, 0, 0, 0.5};
BooleanDifference(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
Physical Surface("rock") = {3};
"""


def test_holes_and_arcs_become_polygons_within_the_chord_tolerance(tmp_path):
    drawing = read_gmsh_model(written(tmp_path, TUNNEL), chord_tolerance=1e-4)
    blocks, _ = assemble(drawing.zones)
    outline, hole = blocks.loops(0)
    assert len(outline) == 4
    radius = np.hypot(*hole.T)
    assert radius == pytest.approx(np.full(len(hole), 0.5), abs=1e-10)
    # The sagitta of a chord of half-angle π/n is r(1 − cos π/n).
    assert 0.5 * (1 - np.cos(np.pi / len(hole))) < 1e-4
    assert len(hole) < 400


def test_a_crack_of_several_curves_is_one_polyline(tmp_path):
    corners = "Point(1)={0,0,0};Point(2)={1,0,0};Point(3)={1,1,0};Point(4)={0,1,0};"
    path = written(
        tmp_path,
        corners
        + "Line(1)={1,2};Line(2)={2,3};Line(3)={3,4};Line(4)={4,1};Curve Loop(1)={1,2,3,4};Plane Surface(1)={1};"
        "Point(5)={0.2,0.5,0};Point(6)={0.4,0.6,0};Point(7)={0.6,0.5,0};Line(5)={5,6};Line(6)={7,6};"
        'Physical Surface("rock")={1};Physical Curve("crack:bent")={5,6};',
    )
    (trace,) = read_gmsh_model(path).traces
    assert trace.name == "bent"
    assert np.allclose(trace.lines[0], [[0.2, 0.5], [0.4, 0.6], [0.6, 0.5]])


def test_warnings_for_what_is_left_out(tmp_path):
    base = (
        "Point(1)={0,0,0};Point(2)={1,0,0};Point(3)={1,1,0};Line(1)={1,2};Line(2)={2,3};Line(3)={3,1};"
        "Curve Loop(1)={1,2,3};Plane Surface(1)={1};"
        "Point(5)={2,0,0};Point(6)={3,0,0};Point(7)={3,1,0};Line(5)={5,6};Line(6)={6,7};Line(7)={7,5};"
        'Curve Loop(2)={5,6,7};Plane Surface(2)={2};Physical Surface("rock")={1};Physical Curve("flaw")={5};'
    )
    messages = [message for message, _ in read_gmsh_model(written(tmp_path, base)).warnings]
    assert any("surface 2 has no physical name" in m for m in messages)
    assert any("'flaw' bounds no named surface" in m for m in messages)


SQUARE = (
    "Point(1)={0,0,0};Point(2)={1,0,0};Point(3)={1,1,0};Point(4)={0,1,0};"
    "Line(1)={1,2};Line(2)={2,3};Line(3)={3,4};Line(4)={4,1};Curve Loop(1)={1,2,3,4};Plane Surface(1)={1};"
    'Physical Surface("rock")={1};'
)
CURVES = "Point(5)={0.2,0.5,0};Point(6)={0.4,0.6,0};Point(7)={0.6,0.5,0};Line(5)={5,6};Line(6)={7,6};"


@pytest.mark.parametrize("embedded", ["Line{5, 6} In Surface{1};", ""])
def test_curves_inside_a_surface_that_are_no_cracks_are_reported(tmp_path, embedded):
    (warning,) = read_gmsh_model(written(tmp_path, SQUARE + CURVES + embedded)).warnings
    assert "curves 5, 6 lie inside zone 'rock'" in warning[0] and 'Physical Curve("crack:NAME")' in warning[1]
    (warning,) = read_gmsh_model(
        written(tmp_path, SQUARE + CURVES + embedded + 'Physical Curve("crack:a")={6};')
    ).warnings
    assert "curve 5 lies inside" in warning[0]
    assert not read_gmsh_model(
        written(tmp_path, SQUARE + CURVES + embedded + 'Physical Curve("crack:a")={5, 6};')
    ).warnings


def test_a_curve_that_a_boolean_operation_put_into_the_rock_is_reported(tmp_path):
    model = (
        'SetFactory("OpenCASCADE");Rectangle(1)={-2,-2,0,4,4};Disk(2)={0,0,0,0.5};'
        "BooleanDifference(3)={Surface{1};Delete;}{Surface{2};Delete;};"
        "Point(100)={-1.5,0,0};Point(101)={-1,0,0};Line(100)={100,101};"
        'BooleanFragments{Surface{3};Delete;}{Curve{100};Delete;}Physical Surface("rock")={3};'
    )
    (warning,) = read_gmsh_model(written(tmp_path, model)).warnings
    assert "lies inside zone 'rock'" in warning[0]


def test_curves_outside_the_rock_and_in_its_holes_are_left_alone(tmp_path):
    hole = (
        "Point(11)={0.2,0.2,0};Point(12)={0.8,0.2,0};Point(13)={0.8,0.8,0};Point(14)={0.2,0.8,0};"
        "Line(11)={11,12};Line(12)={12,13};Line(13)={13,14};Line(14)={14,11};Curve Loop(2)={11,12,13,14};"
    )
    model = SQUARE.replace("Plane Surface(1)={1};", hole + "Plane Surface(1)={1,2};") + CURVES
    assert not read_gmsh_model(written(tmp_path, model)).warnings
    assert not read_gmsh_model(written(tmp_path, SQUARE + CURVES.replace("={0.", "={5."))).warnings


@pytest.mark.parametrize("model", ["two_cracks", "single_flaw"])
@pytest.mark.parametrize("platens", ["none", "bottom", "both"])
def test_models_of_this_folder_lose_nothing(model, platens):
    assert read_gmsh_model(GEOMETRY / f"{model}.geo", {"platens": platens}).warnings == ()


def test_points_off_the_plane_are_reported(tmp_path):
    (warning,) = read_gmsh_model(written(tmp_path, SQUARE.replace("Point(2)={1,0,0}", "Point(2)={1,0,0.1}"))).warnings
    assert "point 2 has z ≠ 0 (up to 0.1 m)" in warning[0]


def test_a_missing_system_library_points_to_the_doctor(monkeypatch):
    class Broken:
        def find_spec(self, name, path=None, target=None):
            if name == "gmsh":
                raise OSError("libGLU.so.1: cannot open shared object file: No such file or directory")

    monkeypatch.delitem(sys.modules, "gmsh", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Broken(), *sys.meta_path])
    with pytest.raises(GmshUnavailable, match=r"libGLU.so.1.*geomech doctor"):
        session.load_gmsh()


def test_gmsh_is_closed_after_an_error_and_a_users_session_is_kept(tmp_path):
    import gmsh

    error_of(written(tmp_path, "Point(1) = {0, 0;\n"))
    assert not gmsh.isInitialized()
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("mine")
        two_cracks()
        assert gmsh.isInitialized() and gmsh.model.getCurrent() == "mine"
    finally:
        gmsh.finalize()


def test_reading_works_in_a_thread():
    script = (
        "import threading, sys\nfrom geomech.shapes import read_gmsh_model\nfound = []\n"
        f"t = threading.Thread(target=lambda: found.append(read_gmsh_model({str(GEOMETRY / 'two_cracks.geo')!r})))\n"
        "t.start(); t.join()\nsys.exit(0 if len(found[0].zones) == 3 else 1)"
    )
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


def test_a_faulty_model_leaves_nothing_for_the_next(tmp_path):
    bad, good = tmp_path / "bad.geo", tmp_path / "good.geo"
    bad.write_text("a = 1;\nb = 0 / 0 + 4 * (7 - Cos(3)) * a;\nc = 2;\n")
    good.write_text('SetFactory("OpenCASCADE");Rectangle(1)={0,0,0,2,1};Physical Surface("rock")={1};\n')
    for _ in range(2):
        with pytest.raises(GmshModelError, match="line 2: Division by zero"):
            read_gmsh_model(bad)
        assert read_gmsh_model(good).zones[0].name == "rock"


def test_a_curve_across_the_rock_is_told_wherever_its_middle_lies(tmp_path):
    """One through the rock to far outside it, and one whose middle is in a hole."""
    far = "Point(5)={0.2,0.5,0};Point(6)={9,0.6,0};Line(5)={5,6};"
    (warning,) = read_gmsh_model(written(tmp_path, SQUARE + far)).warnings
    assert "curve 5 lies inside zone 'rock'" in warning[0]
    beyond = "Point(5)={-0.2,1.5,0};Point(6)={9,0.6,0};Line(5)={5,6};"
    assert not read_gmsh_model(written(tmp_path, SQUARE + beyond)).warnings
