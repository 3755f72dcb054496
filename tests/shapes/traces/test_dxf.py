"""DXF drawings: entities, bulges, blocks, units, hidden layers; held against circles, splines and ezdxf's own
arithmetic."""

import math
import sys

import numpy as np
import pytest

from geomech.shapes import read_field_file
from geomech.shapes.traces.field_lines import FieldFileError

ezdxf = pytest.importorskip("ezdxf")


@pytest.fixture
def drawing(tmp_path):
    """A document, its model space, and a function that saves and reads it."""
    document = ezdxf.new(setup=True)
    document.units = 6  # metres

    def read(unit=None, chord=None, version=None):
        if version is not None:
            document.dxfversion = version
        path = tmp_path / "drawing.dxf"
        document.saveas(path)
        return read_field_file(path, unit, chord)

    return document, document.modelspace(), read


def spans(line):
    return np.ptp(line.points, axis=0)


@pytest.mark.parametrize(
    ("code", "metres"), [(1, 0.0254), (2, 0.3048), (4, 1e-3), (5, 1e-2), (6, 1.0), (7, 1e3), (10, 0.9144), (14, 0.1)]
)
def test_the_units_of_the_drawing_are_kept(drawing, code, metres):
    document, space, read = drawing
    document.units = code
    space.add_line((0, 0), (10, 20))
    file = read()
    assert file.warnings == () and spans(file.lines[0]) == pytest.approx([10 * metres, 20 * metres], rel=1e-15)
    # What the scene says of the unit goes before what the drawing does.
    assert spans(read(unit="cm").lines[0]) == pytest.approx([0.1, 0.2], rel=1e-15)


def test_a_drawing_without_units_is_in_metres_and_that_is_said(drawing):
    document, space, read = drawing
    document.units = 0
    space.add_line((0, 0), (10, 20))
    file = read()
    assert "names no unit" in file.warnings[0][0] and spans(file.lines[0]).tolist() == [10, 20]
    assert read(unit="m").warnings == ()


@pytest.mark.parametrize("chord", [1e-1, 1e-3, 1e-6])
def test_curves_become_chords_within_the_tolerance(drawing, chord):
    _, space, read = drawing
    space.add_arc((1, 2), 3, 20, 300)
    space.add_circle((1, 2), 3, dxfattribs={"extrusion": (0, 0, -1)})
    space.add_lwpolyline([(4, 2, 1), (-2, 2, 1)], format="xyb", close=True)
    space.add_polyline2d([(4, 2, -0.3), (1, 5, 0)], format="xyb")
    arc, circle, bulged, bent = read(chord=chord).lines
    for line, centre in ((arc, (1, 2)), (circle, (-1, 2)), (bulged, (1, 2))):
        assert np.hypot(*(line.points - centre).T) == pytest.approx(3, rel=1e-14)
        middles = 0.5 * (line.points[1:] + line.points[:-1])
        off = 3 - np.hypot(*(middles - centre).T)
        # No farther than asked for, and no finer than needed (an arc is at least a chord for each quarter turn).
        assert 0 < off.max() <= chord and off.max() > 0.4 * min(chord, 3 * (1 - math.cos(math.pi / 4)))
    assert circle.shape == bulged.shape == "closed" and arc.shape == "line"
    ends = arc.points[[0, -1]] - (1, 2)
    assert np.degrees(np.arctan2(ends[:, 1], ends[:, 0])) % 360 == pytest.approx([20, 300], abs=1e-12)
    # ezdxf's own centre and radius of a bulge (Lee Mac's formulas).
    centre, _, _, radius = ezdxf.math.bulge_to_arc((4, 2), (1, 5), -0.3)
    assert np.hypot(*(bent.points - tuple(centre)).T) == pytest.approx(radius, rel=1e-13)
    assert bent.points[[0, -1]].tolist() == [[4, 2], [1, 5]]


def test_a_circle_of_two_bulges_has_its_area(drawing):
    """The polygon of n chords has the area n/2 r² sin(2π/n)."""
    _, space, read = drawing
    space.add_lwpolyline([(3, 0, 1), (-3, 0, 1)], format="xyb", close=True)
    (line,) = read(chord=1e-4).lines
    x, y = line.points.T
    n = len(x)
    area = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    assert area == pytest.approx(n / 2 * 9 * math.sin(2 * math.pi / n), rel=1e-13)
    assert math.pi * 9 - area < 2 * math.pi * 3 * 1e-4


def test_splines_and_ellipses_are_flattened(drawing):
    from scipy.interpolate import BSpline

    _, space, read = drawing
    control = np.array([[0.0, 0], [1, 2], [4, 1], [6, 3], [9, 0]])
    space.add_open_spline([(*p, 0) for p in control], degree=3)
    space.add_ellipse((0, 0), (4, 0), 0.5)
    spline, ellipse = read(chord=1e-3).lines
    fine = BSpline([0, 0, 0, 0, 1, 2, 2, 2, 2], control, 3)(np.linspace(0, 2, 20001))
    middles = np.concatenate([spline.points, 0.5 * (spline.points[1:] + spline.points[:-1])])
    # 20 000 points of the curve stand 5e-4 m apart: half of that, along the curve, does not count.
    off = np.min(np.hypot(*(middles[:, None] - fine[None]).transpose(2, 0, 1)), axis=1)
    assert off.max() <= 1e-3 + 2.5e-4 and spline.points[[0, -1]] == pytest.approx(control[[0, -1]], abs=1e-12)
    assert ellipse.shape == "closed"
    assert (ellipse.points[:, 0] / 4) ** 2 + (ellipse.points[:, 1] / 2) ** 2 == pytest.approx(1, rel=1e-12)


def test_blocks_are_exploded_turned_mirrored_and_nested(drawing):
    document, space, read = drawing
    mark = document.blocks.new("mark")
    mark.add_line((0, 0), (2, 1))
    mark.add_line((0, 0), (1, 0), dxfattribs={"layer": "own"})
    group = document.blocks.new("group")
    group.add_blockref("mark", (10, 0), dxfattribs={"xscale": -1})
    space.add_blockref("mark", (1, 1), dxfattribs={"layer": "J1", "rotation": 90, "xscale": 2, "yscale": 2})
    space.add_blockref("group", (0, 0), dxfattribs={"layer": "J2"})
    space.add_blockref("mark", (0, 0), dxfattribs={"layer": "J3", "column_count": 3, "column_spacing": 5})
    lines = read().lines
    assert [line.layer for line in lines] == ["J1", "own", "J2", "own", "J3", "own", "J3", "own", "J3", "own"]
    assert lines[0].points == pytest.approx(np.array([[1, 1], [-1, 5]]), abs=1e-12)
    assert lines[2].points == pytest.approx(np.array([[10, 0], [8, 1]]), abs=1e-12)
    assert [line.points[0, 0] for line in lines[4::2]] == pytest.approx([0, 5, 10])


def test_hidden_layers_and_what_is_no_trace_are_reported(drawing):
    document, space, read = drawing
    for name, hide in (("off", "off"), ("frozen", "freeze")):
        getattr(document.layers.add(name), hide)()
        space.add_line((0, 0), (1, 1), dxfattribs={"layer": name})
    space.add_line((0, 0), (1, 1), dxfattribs={"layer": "J1"})
    space.add_line((3, 3), (3, 3), dxfattribs={"layer": "J1"})
    space.add_text("section A", dxfattribs={"layer": "J1"})
    space.add_line((0, 0, 5), (1, 0, 5), dxfattribs={"layer": "J1"})
    document.layout("Layout1").add_line((0, 0), (100, 100))
    file = read()
    assert len(file.lines) == 2
    told = " | ".join(message for message, _ in file.warnings)
    assert "hidden layers are left out: 'frozen' (1), 'off' (1)" in told
    assert "1 LINE without length, 1 TEXT" in told and "1 entities have z ≠ 0 (up to 5 m)" in told


@pytest.mark.parametrize("version", ["R12", "R2000", "R2018"])
def test_versions_of_the_format_read_alike(drawing, version):
    _, space, read = drawing
    space.add_line((0, 0), (3, 1), dxfattribs={"layer": "J1"})
    space.add_polyline3d([(0, 0, 0), (1, 1, 0), (2, 0, 0)], dxfattribs={"layer": "J2"})
    file = read(unit="m", version=version)
    assert [(line.layer, len(line.points)) for line in file.lines] == [("J1", 2), ("J2", 3)]


def test_files_that_are_no_dxf_are_refused(tmp_path, monkeypatch):
    path = tmp_path / "a.dxf"
    path.write_text("no drawing\nat all\n")
    with pytest.raises(FieldFileError, match="cannot be read as DXF"):
        read_field_file(path)
    path.write_bytes(bytes(range(256)))
    with pytest.raises(FieldFileError, match="cannot be read as DXF"):
        read_field_file(path)
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    with pytest.raises(FieldFileError, match="pip install ezdxf"):
        read_field_file(path)
