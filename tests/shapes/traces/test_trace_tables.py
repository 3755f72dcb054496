"""Traces of the field from tables and GeoJSON: what is read, what names mean, what is refused with its line."""

import json

import numpy as np
import pytest

from geomech.shapes import assemble, cut, read_field_file
from geomech.shapes.traces.field_lines import (
    FieldFile,
    FieldFileError,
    FieldLine,
    drawing_of_lines,
    named_lines,
    role_of,
)

#: Three traces of two sets: ends in a row, and vertices in rows.
ENDS = "set,x1,y1,x2,y2\nJ1,0,1,4,2\nJ1,0,2,4,3\nJ2,1.5,0,2.5,4\n"
VERTICES = "id,set,x,y\na,J1,0,1\na,J1,4,2\nb,J1,0,2\nc,J2,1.5,0\nb,J1,4,3\nc,J2,2.5,4\n"
FEATURES = {
    "type": "FeatureCollection",
    "features": [
        {
            "type": "Feature",
            "properties": {"set": "J1"},
            "geometry": {"type": "MultiLineString", "coordinates": [[[0, 1], [4, 2]], [[0, 2], [4, 3]]]},
        },
        {
            "type": "Feature",
            "properties": {"set": "J2", "dip": 76},
            "geometry": {"type": "LineString", "coordinates": [[1.5, 0, 7.0], [2.5, 4, 7.0]]},
        },
    ],
}


def written(folder, text, name="traces.csv"):
    path = folder / name
    path.write_text(text if isinstance(text, str) else json.dumps(text), encoding="utf-8")
    return path


def read(folder, text, name="traces.csv", **options):
    return read_field_file(written(folder, text, name), **options)


def drawn(file, layers=None, name=None, kind="joint"):
    return drawing_of_lines(named_lines(file, layers, name, kind)[0])


def lines_of(joints):
    return {joint.name: [line.tolist() for line in joint.lines] for joint in joints}


@pytest.mark.parametrize(
    ("text", "name"),
    [
        (ENDS, "a.csv"),
        ("# mapped in May\n\n" + ENDS.replace(",", ";").replace("1.5", "1,5"), "semicolons.csv"),
        (ENDS.replace(",", "\t").replace("J1\t0\t1", "J1\t0\t1,0").replace("\t4\t3", "\t4\t3 # clean"), "tabs.txt"),
        ("\ufeff" + ENDS.replace("set,x1", "Layer, X1").replace("\n", "\r\n"), "excel.csv"),
        ("dip,set,x1,y1,x2,y2\n14,J1,0,1,4,2\n14,J1,0,2,4,3\n,J2,1.5,0,2.5,4\n", "more_columns.csv"),
        (VERTICES, "vertices.csv"),
        (FEATURES, "a.geojson"),
    ],
)
def test_all_ways_to_write_traces_give_the_same(tmp_path, text, name):
    file = read(tmp_path, text, name)
    assert file.warnings == ()
    assert lines_of(drawn(file).joints) == {
        "joint:J1": [[[0, 1], [4, 2]], [[0, 2], [4, 3]]],
        "joint:J2": [[[1.5, 0], [2.5, 4]]],
    }


def test_units_scale_and_metres_are_left_as_they_are(tmp_path):
    file = read(tmp_path, ENDS, unit="mm")
    assert file.lines[2].points.tolist() == [[1.5e-3, 0], [2.5e-3, 4e-3]]
    assert read(tmp_path, ENDS).lines[2].points.tolist() == [[1.5, 0], [2.5, 4]]


@pytest.mark.parametrize(
    ("text", "name", "message"),
    [
        ("set,x,y\nJ1,0,1\n", "a.csv", r"a\.csv:1: the columns are set, x, y"),
        ("# nothing\n", "a.csv", "has no rows"),
        (ENDS + "J1,1,2,3\n", "a.csv", r"a\.csv:5: 4 values under 5 columns"),
        (ENDS + "J1,1,2,3,four\n", "a.csv", r"a\.csv:5: y2 is 'four', not a number"),
        (ENDS + "J1,1,2,3,inf\n", "a.csv", r"a\.csv:5: y2 is inf"),
        ("x1,y1,x2,y2,x1\n", "a.csv", r"a\.csv:1: there are two columns 'x1'"),
        (VERTICES + "a,J2,9,9\n", "a.csv", r"a\.csv:8: trace 'a' is in set 'J2' and, at line 2, in set 'J1'"),
        (b"\xff\xfe\x00", "a.csv", "not UTF-8"),
        ('{"type": "FeatureCollection",\n "features": [}', "a.geojson", r"a\.geojson:2: not valid JSON"),
        ("[1, 2]", "a.geojson", "is not a GeoJSON feature collection"),
        ({"type": "Topology"}, "a.geojson", "is not a GeoJSON feature collection"),
        (
            FEATURES | {"crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}},
            "a.geojson",
            "its coordinates are degrees",
        ),
        (
            {"type": "Feature", "geometry": {"type": "LineString", "coordinates": [[0, 1], ["a", 2]]}},
            "a.geojson",
            "feature 1: its coordinates cannot be read",
        ),
        (ENDS, "a.shp", "is not a .dxf, .csv or .geojson file"),
        (ENDS, "a.dwg", "save the drawing as DXF"),
    ],
)
def test_what_cannot_be_read_is_refused_with_its_line(tmp_path, text, name, message):
    if isinstance(text, bytes):
        (tmp_path / name).write_bytes(text)
        with pytest.raises(FieldFileError, match=message):
            read_field_file(tmp_path / name)
        return
    with pytest.raises(FieldFileError, match=message):
        read(tmp_path, text, name)


def test_a_missing_file_is_reported(tmp_path):
    with pytest.raises(FieldFileError, match="there is no file"):
        read_field_file(tmp_path / "none.csv")


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("J1", None),
        ("Jointed limestone", None),
        ("joint", None),
        ("joint:bedding", ("joint", "joint:bedding")),
        ("JOINT-A 3", ("joint", "joint:A 3")),
        ("crack_flaw", ("crack", "crack:flaw")),
        ("Outline", ("zone", "zone:rock")),
        ("zone", ("zone", "zone:rock")),
        ("Zone_marl", ("zone", "zone:marl")),
        ("hole", ("hole", "hole")),
        ("bolt-roof", ("mark", "bolt:roof")),
        ("WATER", ("mark", "water")),
        ("water-high", ("mark", "water:high")),
        ("probe:crest", ("mark", "monitor:crest")),
        ("edge:toe", ("edge", "toe")),
        ("load_top", ("edge", "load:top")),
        ("fixed", ("edge", "fixed")),
        ("guided-x", ("edge", "guided:x")),
    ],
)
def test_names_of_layers_say_what_they_are(name, role):
    assert role_of(name) == role


def test_a_table_of_layers_renames_and_leaves_out(tmp_path):
    file = read(tmp_path, ENDS)
    named, idle, left = named_lines(file, {"j1": "bedding"})
    assert {item.name for item in named} == {"joint:bedding"} and idle == [] and left == {"J2": 1}
    named, idle, left = named_lines(file, {"J2": "crack:flaw", "J*": "", "K*": "joint:x"}, name="mapped")
    assert [item.name for item in named] == ["joint:mapped", "joint:mapped", "crack:flaw"]
    assert idle == ["K*"] and left == {}
    cracks = drawn(file, kind="crack").traces
    assert [crack.name for crack in cracks] == ["J1 1", "J1 2", "J2"]


def of(layer, points, shape="line", label=""):
    return FieldLine(layer, np.array(points, dtype=float), f"test: {layer}", shape, label)


SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
LENS = [[1, 1], [2, 1], [2, 3], [1, 3]]
VOID = [[3, 1], [3.5, 1], [3.5, 2], [3, 2]]


def area(drawing, name):
    blocks, _ = assemble(drawing.zones)
    return sum(a for a, zone in zip(blocks.areas(), drawing.zones) if zone.name == name)


def test_what_is_drawn_inside_a_zone_is_cut_out_of_it():
    lines = [of("zone-ore", LENS, "closed"), of("zone-rock", SQUARE, "closed"), of("hole", VOID, "closed")]
    drawing = drawn(FieldFile(tuple(lines)))
    assert area(drawing, "rock") == pytest.approx(16 - 2 - 0.5, rel=1e-14)
    assert area(drawing, "ore") == pytest.approx(2, rel=1e-14)
    # A last point that repeats the first closes a line too.
    again = drawn(FieldFile((of("zone-rock", [*SQUARE, SQUARE[0]]), of("zone-ore", LENS, "closed"))))
    assert area(again, "rock") == pytest.approx(14, rel=1e-14)


def test_outlines_may_be_drawn_in_pieces():
    # Two layers of ground from lines that meet, one end off by less than a millionth of the drawing.
    pieces = [
        [[0, 0], [4, 0]],
        [[4, 0], [4, 2], [4, 4 - 1e-6]],
        [[4, 4], [0, 4]],
        [[0, 4], [0, 2], [0, 0]],
        [[0, 2], [4, 2]],
    ]
    drawing = drawn(FieldFile(tuple(of("outline", piece) for piece in pieces)))
    assert len(drawing.zones) == 2 and area(drawing, "rock") == pytest.approx(16, rel=1e-6)
    with pytest.raises(FieldFileError, match=r"outline of zone 'rock' does not close: a line ends at \(5, 2\)"):
        drawn(FieldFile((*(of("outline", piece) for piece in pieces), of("outline", [[4, 2], [5, 2]]))))
    with pytest.raises(FieldFileError, match="does not close"):
        drawn(FieldFile((of("zone-a", [[0, 0], [1, 0], [1, 1]]),)))


def test_polygons_are_zones_with_holes_and_points_monitors(tmp_path):
    ring = [*SQUARE, SQUARE[0]]
    data = {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "properties": {"unit": "marl"},
                "geometry": {"type": "Polygon", "coordinates": [ring, [*LENS, LENS[0]]]},
            },
            {
                "type": "Feature",
                "properties": {"unit": "monitor", "name": "crest"},
                "geometry": {"type": "Point", "coordinates": [3, 4]},
            },
            {"type": "Feature", "properties": {"unit": "note"}, "geometry": {"type": "Point", "coordinates": [9, 9]}},
            {"type": "Feature", "properties": None, "geometry": None},
        ],
    }
    file = read(tmp_path, data, "map.geojson", set_property="unit")
    assert "no geometry" in file.warnings[0][0]
    drawing = drawn(file)
    assert [zone.name for zone in drawing.zones] == ["marl"] and area(drawing, "marl") == pytest.approx(14)
    assert [(m.name, m.lines[0].tolist()) for m in drawing.marks] == [("monitor:crest", [[3, 4]])]
    assert "'joint:note', left out" in drawing.warnings[0][0]


def test_closed_joints_bolts_water_and_edges():
    lines = [
        of("J1", LENS, "closed"),
        of("bolt-roof", [[0, 0], [1, 1]]),
        of("water", [[0, 1], [4, 2]], label="17"),
        of("load-top", [[0, 4], [2, 4], [4, 4]]),
    ]
    drawing = drawn(FieldFile(tuple(lines)))
    assert drawing.joints[0].lines[0].tolist() == [*LENS, LENS[0]]
    assert [mark.name for mark in drawing.marks] == ["bolt:roof", "water"]
    assert [(e.name, e.start, e.end) for e in drawing.edges] == [
        ("load:top", (0, 4), (2, 4)),
        ("load:top", (2, 4), (4, 4)),
    ]
    assert drawing.places["marks", 1] == "test: water" and drawing.places["edges", 1] == "test: load-top"


def test_many_traces_are_read_and_cut(tmp_path):
    rng = np.random.default_rng(3)
    rows = [f"J{k % 3},{a!r},0,{b!r},50" for k, (a, b) in enumerate(rng.uniform(0, 100, (60, 2)).tolist())]
    file = read(tmp_path, "set,x1,y1,x2,y2\n" + "\n".join(rows))
    rock = FieldLine("zone", np.array([[0.0, 0], [100, 0], [100, 50], [0, 50]]), "rock", "area")
    drawing = drawn(FieldFile((*file.lines, rock)))
    cutting = cut(drawing.zones, drawing.joints)
    assert cutting.blocks.areas().sum() == pytest.approx(5000, rel=1e-12) and cutting.blocks.n_blocks > 300
