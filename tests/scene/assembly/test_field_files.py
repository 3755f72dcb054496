"""Scenes with traces of the field: every format gives the same blocks, world coordinates come and go, names must mean
something."""

import json

import numpy as np
import pytest

from geomech.model import DdaSettings, JointLaw
from geomech.output.block_model.block_system import write_block_system
from geomech.scene import SceneError, load_scene
from geomech.scene.keys import kind_of
from geomech.scene.tables import SceneTables
from geomech.scene.world import PLACES, moved

#: A slope on a base, two sets of joints and a crack, in a section 512 km east and 5403 km north.
EAST, NORTH = 512_300.0, 5_403_100.0
ROCK = [[0, 0], [40, 0], [40, 20], [10, 20]]
BASE = [[-5, -4], [45, -4], [45, 0], [-5, 0]]
JOINTS = {
    "J1": [[[0, 5], [45, 12]], [[0, 10], [22, 13.5], [45, 17]]],
    "J2": [[[15, 0], [20, 25]], [[25, 0], [30, 25]]],
}
CRACK = [[36, 2], [38, 4]]
REST = """
[materials.rock]
youngs_modulus_pa = 2e10
poissons_ratio = 0.25
density_kg_m3 = 2600
[zones.base]
fixed = true
[joints.default]
friction_angle_deg = 30
[loads]
gravity_m_s2 = [0.0, -9.81]
[growth]
enabled = false
[run]
end_time_s = 1.0
"""


def lines(x=0.0, y=0.0):
    """(layer, closed, points) of the section, moved by (x, y)."""

    def at(points):
        return [[a + x, b + y] for a, b in points]

    yield "zone-rock", True, at(ROCK)
    yield "zone-base", True, at(BASE)
    for name, own in JOINTS.items():
        for line in own:
            yield name, False, at(line)
    yield "crack-flaw", False, at(CRACK)


def csv_of(path, x, y):
    rows = ["id,set,x,y"]
    for k, (layer, closed, points) in enumerate(lines(x, y)):
        rows += [f"{k},{layer},{a!r},{b!r}" for a, b in [*points, *points[: int(closed)]]]
    path.write_text("\n".join(rows), encoding="utf-8")


def geojson_of(path, x, y):
    features = []
    for layer, closed, points in lines(x, y):
        shape = {"type": "Polygon", "coordinates": [[*points, points[0]]]} if closed else None
        shape = shape or {"type": "LineString", "coordinates": points}
        features.append({"type": "Feature", "properties": {"set": layer}, "geometry": shape})
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}), encoding="utf-8")


def dxf_of(path, x, y):
    ezdxf = pytest.importorskip("ezdxf")
    document = ezdxf.new()
    document.units = 6
    for layer, closed, points in lines(x, y):
        document.modelspace().add_lwpolyline(points, close=closed, dxfattribs={"layer": layer})
    document.saveas(path)


WRITERS = {"csv": csv_of, "geojson": geojson_of, "dxf": dxf_of}


def scene_of(folder, kind, x=0.0, y=0.0, keys="", rest=REST, entry=""):
    WRITERS[kind](folder / f"map.{kind}", x, y)
    path = folder / "scene.toml"
    path.write_text(f'[geometry]\n{keys}\n[[geometry.traces]]\nfile = "map.{kind}"\n{entry}\n{rest}', encoding="utf-8")
    return path


def drawn_here(folder):
    """The same in the scene's own words."""
    text = ["[geometry]"]
    text += [f'[[geometry.zones]]\nname = "{n}"\npolygon = {p}' for n, p in (("rock", ROCK), ("base", BASE))]
    text += [f'[[geometry.joints]]\nname = "{n}"\npoints = {line}' for n, own in JOINTS.items() for line in own]
    text += [f'[[geometry.cracks]]\nname = "flaw"\npoints = {CRACK}']
    path = folder / "here.toml"
    path.write_text("\n".join(text) + REST, encoding="utf-8")
    return load_scene(path)


def assert_same(a, b, within=0.0):
    assert a.blocks.names == b.blocks.names and a.blocks.edge_names == b.blocks.edge_names
    assert np.array_equal(a.blocks.edge_name, b.blocks.edge_name) and a.cracks.names == b.cracks.names
    for one, other in ((a.blocks.vertices, b.blocks.vertices), (a.cracks.nodes, b.cracks.nodes)):
        assert one.shape == other.shape and np.abs(one - other).max() <= within


@pytest.mark.parametrize("kind", WRITERS)
def test_every_format_gives_the_arrays_of_the_scene_itself(tmp_path, kind):
    scene = load_scene(scene_of(tmp_path, kind))
    assert scene.warnings == () and scene.origin == (0.0, 0.0)
    assert_same(scene, drawn_here(tmp_path))


@pytest.mark.parametrize("kind", WRITERS)
def test_world_coordinates_are_moved_to_a_local_origin(tmp_path, kind):
    rest = REST + f'[[monitors]]\nname = "crest"\nat = [{EAST + 12.0}, {NORTH + 19.0}]\n'
    rest = rest.replace("[growth]", f"[loads.water]\npoints = [[{EAST}, {NORTH + 2}]]\n[growth]")
    far = load_scene(scene_of(tmp_path, kind, EAST, NORTH, f"origin = [{EAST}, {NORTH}]", rest))
    # A coordinate of 5e6 m is a multiple of 1e-9 m; crossings move with the lines that make them.
    assert_same(far, drawn_here(tmp_path), 2e-8)
    problem = far.problem()
    assert problem.origin == (EAST, NORTH) and problem.monitors["crest"][1] == (12.0, 19.0)
    assert problem.loads.water.points.tolist() == [[0.0, 2.0]]
    # Chosen by itself, it is a round place below the rock, and what is written says so.
    chosen = load_scene(scene_of(tmp_path, kind, EAST, NORTH, "", rest))
    assert chosen.origin == (EAST - 10, NORTH - 10)
    told = write_block_system(chosen, tmp_path / "build")
    assert told["world_origin_m"] == [EAST - 10, NORTH - 10] and "origin" in told["lines"][0]
    import pyvista

    mesh = pyvista.read(tmp_path / "build" / "block_system.vtu")
    back = mesh.points[:, :2] + [mesh.field_data["WORLD_X"][0], mesh.field_data["WORLD_Y"][0]]
    assert back.min(axis=0) == pytest.approx([EAST - 5, NORTH - 4], abs=1e-8)


def test_rock_drawn_far_away_moves_as_it_does_here(tmp_path):
    """With its own origin, 10 km off, it keeps all but the digits that its coordinates lack; with [0, 0] it does not."""
    from geomech import dda
    from geomech.model import Joints

    def last(x, origin=""):
        at = lambda points: [[a + x, b + x] for a, b in points]  # noqa: E731
        file = tmp_path / "scene.toml"
        joints = "".join(
            f'[[geometry.joints]]\nname = "{name}"\npoints = {at(line)}\n'
            for name, own in JOINTS.items()
            for line in own
        )
        zones = "".join(
            f'[[geometry.zones]]\nname = "{name}"\npolygon = {at(of)}\n'
            for name, of in (("rock", ROCK), ("base", BASE))
        )
        file.write_text(f"[geometry]\n{origin}\n{zones}{joints}{REST}", encoding="utf-8")
        scene = load_scene(file)
        problem = scene.problem()
        settings = DdaSettings(time_step=3e-3, dynamic_factor=1.0)
        *_, state = dda.run(
            problem.blocks, problem.materials, Joints([JointLaw("smooth")], lambda a, b: 0), problem.loads, settings, 0.009
        )  # fmt: skip
        return scene.origin, state.vertices - problem.blocks.vertices

    _, here = last(0.0)
    origin, far = last(1e4)
    assert origin == (9990.0, 9990.0)
    off = np.abs(far - here).max()
    assert off < 1e-9 * np.abs(here).max()
    origin, as_drawn = last(1e4, "origin = [0, 0]")
    assert origin == (0.0, 0.0) and np.abs(as_drawn - here).max() > 30 * off


def test_a_resolved_scene_gives_the_same_again(tmp_path):
    import tomli_w

    scene = load_scene(scene_of(tmp_path, "csv", EAST, NORTH, 'unit = "m"'))
    (tmp_path / "elsewhere").mkdir()
    again = tmp_path / "elsewhere" / "scene.toml"
    again.write_text(tomli_w.dumps(scene.resolved()), encoding="utf-8")
    assert_same(scene, load_scene(again))
    assert load_scene(again).origin == scene.origin


def test_what_is_built_goes_back_to_the_world(tmp_path):
    scene = load_scene(scene_of(tmp_path, "csv", EAST, NORTH, f"origin = [{EAST}, {NORTH}]"))
    write_block_system(scene, tmp_path)
    path = tmp_path / "again.toml"
    text = f'[geometry]\norigin = [{EAST}, {NORTH}]\n[[geometry.traces]]\nfile = "block_system.geojson"\n'
    path.write_text(text + REST, encoding="utf-8")
    again = load_scene(path)
    assert again.drawing.zones == scene.drawing.zones and again.cracks.names == scene.cracks.names
    assert again.blocks.areas() == pytest.approx(scene.blocks.areas(), rel=1e-8)
    nodes = [np.array(sorted(found.cracks.nodes.tolist())) for found in (again, scene)]
    assert np.abs(nodes[0] - nodes[1]).max() < 1e-8


def test_places_are_all_moved():
    """Every pair of metres among the keys is a place, but for those that are no positions."""
    vectors = {
        "gravity_m_s2", "newmark", "direction", "factors", "value_pa", "rate_pa_per_s", "values_pa", "value_n_per_m",
        "rate_n_per_m_s", "values_n_per_m", "incoming_m_per_s", "displacement_m", "velocity_m_per_s", "displacements_m",
        "acceleration_m_s2", "jerk_m_s3", "accelerations_m_s2", "origin", "velocity_m_s",
    }  # fmt: skip
    left = []

    def visit(table, places, path):
        for name, field in table.model_fields.items():
            kind, what = kind_of(field.annotation)
            inner_kind, inner = kind_of(what) if kind in ("map", "list") else (kind, what)
            own = places.get(name, {}) if isinstance(places, dict) else {}
            if inner_kind == "table":
                visit(inner, own, f"{path}{name}.")
            elif (
                ("[x, y]" in field.description or "[x0, y0" in field.description)
                and name not in vectors
                and own != "xy"
            ):
                left.append(path + name)

    visit(SceneTables, PLACES, "")
    assert left == []


def test_nested_places_and_levels_are_moved(tmp_path):
    scene = load_scene(scene_of(tmp_path, "csv", rest=REST + '[[monitors]]\nname = "a"\nat = [12.0, 19.0]\n'))
    assert moved(scene.tables, (2.0, 3.0)).monitors[0].at == (10.0, 16.0)


@pytest.mark.parametrize(
    ("keys", "entry", "message", "way_out"),
    [
        ("", 'layers = { "zone*" = "" , "K9" = "" }', "has no layer 'K9'", "there is"),
        ("", 'layers = { "J1" = "" }', "no rock: none of the layers is a zone", '"zone:rock"'),
        ("", 'layers = { "zone*" = "", "J1" = "crack" }', "'crack' needs a name after it", "crack:NAME"),
        ('unit = "parsec"', "", "is not one of", "unit"),
        ("", 'kind = "fault"', "is not one of", ""),
    ],
)
def test_what_means_nothing_is_refused(tmp_path, keys, entry, message, way_out):
    with pytest.raises(SceneError) as caught:
        load_scene(scene_of(tmp_path, "csv", keys=keys, entry=entry))
    (fault, *_) = caught.value.errors
    assert message in fault.message and way_out in fault.way_out and "scene.toml:" in fault.place


def test_a_faulty_line_of_a_file_is_told_with_both_places(tmp_path):
    path = scene_of(tmp_path, "csv")
    table = tmp_path / "map.csv"
    table.write_text(table.read_text() + "\n77,J1,0,here\n")
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    (fault,) = caught.value.errors
    assert fault.place.endswith("scene.toml:4: geometry.traces[0].file")
    assert "map.csv:" in fault.message and "'here', not a number" in fault.message
    # What the drawing says of a zone names the line that draws it.
    table.write_text(
        table.read_text().replace("77,J1,0,here", "78,zone-rock,1,1\n78,zone-rock,99,1\n78,zone-rock,99,9")
    )
    table.write_text(table.read_text() + "\n78,zone-rock,1,1\n")
    with pytest.raises(SceneError, match=r"map\.csv:\d+: .*overlap"):
        load_scene(path)


def test_traces_in_another_unit_cut_nothing_and_that_is_said(tmp_path):
    extra = tmp_path / "more.csv"
    extra.write_text("set,x1,y1,x2,y2\nK1,900000,100,900001,200\n")
    path = scene_of(tmp_path, "csv", keys="origin = [0.0, 0.0]", entry='[[geometry.traces]]\nfile = "more.csv"')
    (warning, *_) = [w for w in load_scene(path).warnings if "cuts nothing" in w.message]
    assert "more.csv:2" in warning.message and "geometry.traces[1].file" in warning.place


def test_a_mapped_crack_that_just_misses_is_told_with_its_file(tmp_path):
    extra = tmp_path / "more.csv"
    extra.write_text("set,x1,y1,x2,y2\ncrack:near,38,1,39.999,1\n")
    scene = load_scene(scene_of(tmp_path, "csv", entry='[[geometry.traces]]\nfile = "more.csv"'))
    (warning,) = scene.warnings
    assert "crack 'near' ends at (39.999, 1)" in warning.message and "geometry.traces[1].file" in warning.place


def test_traces_may_cut_some_zones_only(tmp_path):
    extra = tmp_path / "more.csv"
    extra.write_text("x1,y1,x2,y2\n5,-10,5,50\n")
    entry = '[[geometry.traces]]\nfile = "more.csv"\nzones = ["base"]'
    scene = load_scene(scene_of(tmp_path, "csv", entry=entry))
    assert sum(zone == "base" for zone in scene.drawing.zones) == 2
    edges = scene.blocks.edges_named("joint:more")
    assert scene.blocks.vertices[edges][:, 1].max() <= 0.0 and len(edges) == 2
    with pytest.raises(SceneError, match="there is no zone 'bse'"):
        load_scene(scene_of(tmp_path, "csv", entry=entry.replace("base", "bse")))


def test_traces_cut_a_gmsh_model_too(tmp_path):
    (tmp_path / "block.geo").write_text(
        'SetFactory("OpenCASCADE");Rectangle(1)={0,0,0,4,4};Physical Surface("rock")={1};\n', encoding="utf-8"
    )
    (tmp_path / "t.csv").write_text("x1,y1,x2,y2\n-1,2,5,2\n2,2,2,4\n", encoding="utf-8")
    path = tmp_path / "scene.toml"
    text = '[geometry]\nmodel = "block.geo"\n[[geometry.traces]]\nfile = "t.csv"\nname = "bedding"\n'
    rest = REST.replace("[zones.base]\nfixed = true", "").replace("gravity_m_s2 = [0.0, -9.81]", "")
    path.write_text(text + rest, encoding="utf-8")
    scene = load_scene(path)
    assert sorted(scene.blocks.areas()) == [4.0, 4.0, 8.0] and scene.drawing.joints == ("joint:bedding",)
