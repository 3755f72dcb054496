"""The table of `geomech build` for joints that come as outlines, as lines and in the scene; CRS, zones, scenes without
[run]."""

import json
import math

import numpy as np
import pytest

from geomech.cli import main

REST = """
[materials.rock]
youngs_modulus_pa = 20e9
poissons_ratio = 0.25
density_kg_m3 = 2600
k_ic_pa_sqrt_m = 1e6
[joints.default]
friction_angle_deg = 30
"""


def built(path, folder):
    assert main(["build", str(path), "--out", str(folder)]) == 0
    return json.loads((folder / "block_system.json").read_text())


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("angle", [0.0, 0.4, 2.0])
def test_joints_that_fragments_turned_into_outlines_are_counted_as_those_that_cut(tmp_path, angle):
    """Three joints in a square, two across it that cross, one that ends on the first: as lines, and as what
    BooleanFragments makes of them."""
    c, s = math.cos(angle), math.sin(angle)
    points = np.array(
        [[0, 0], [10, 0], [10, 8], [0, 8], [0, 3], [10, 5], [3, 0], [4, 8], [7, 4.4], [8, 8]], dtype=float
    )
    x, y = (points @ np.array([[c, s], [-s, c]])).T
    text = 'SetFactory("OpenCASCADE");' + "".join(
        f"Point({k})={{{a!r},{b!r},0}};" for k, (a, b) in enumerate(zip(x.tolist(), y.tolist()), 1)
    )
    text += "Line(1)={1,2};Line(2)={2,3};Line(3)={3,4};Line(4)={4,1};Curve Loop(1)={1,2,3,4};Plane Surface(1)={1};"
    text += "Line(5)={5,6};Line(6)={7,8};Line(7)={9,10};"
    (tmp_path / "lines.geo").write_text(text + 'Physical Surface("rock")={1};Physical Curve("joint:j")={5,6,7};\n')
    (tmp_path / "fragments.geo").write_text(
        text + "v()=BooleanFragments{Surface{1};Delete;}{Curve{5,6,7};Delete;};s()=Surface{:};"
        'Physical Surface("rock")={s()};all()=Abs(Boundary{Surface{s()};});rim()=Abs(CombinedBoundary{Surface{s()};});'
        'all()-=rim();Physical Curve("joint:j")={all()};\n'
    )
    told = {}
    for kind in ("lines", "fragments"):
        path = tmp_path / f"{kind}.toml"
        path.write_text(f'title = "map"\n[geometry]\nmodel = "{kind}.geo"\n{REST}')
        told[kind] = built(path, tmp_path / kind)
    (lines,), (fragments,) = told["lines"]["sets"], told["fragments"]["sets"]
    assert told["lines"]["nodes"] == told["fragments"]["nodes"] == {"I": 0, "Y": 1, "X": 1}
    assert fragments["traces"] == lines["traces"] == 3 and fragments["cutting_traces"] == 3
    for key in ("p10_per_m", "p20_per_m2", "p21_per_m", "mean_length_m", "cut_length_m", "angle_deviation_deg"):
        assert fragments[key] == pytest.approx(lines[key], rel=1e-4), key


def test_a_drawn_joint_may_cut_some_zones_alone(tmp_path):
    path = tmp_path / "zones.toml"
    path.write_text(
        'title = "zones"\n[[geometry.zones]]\nname = "lower"\nrectangle = [0, 0, 10, 4]\n[[geometry.zones]]\n'
        'name = "upper"\nrectangle = [0, 4, 10, 8]\n[[geometry.joints]]\nname = "j"\npoints = [[5, -1], [6, 9]]\n'
        f'zones = ["upper"]\n{REST}'
    )
    told = built(path, tmp_path / "out")
    assert {zone["name"]: zone["blocks"] for zone in told["blocks"]["zones"]} == {"lower": 1, "upper": 2}
    path.write_text(path.read_text().replace('["upper"]', '["uper"]'))
    assert main(["build", str(path), "--out", str(tmp_path / "out")]) == 2


def test_the_map_in_world_coordinates_says_their_reference_system(tmp_path):
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3067"}}
    area = {"type": "Polygon", "coordinates": [[[0, 0], [10, 0], [10, 8], [0, 8], [0, 0]]]}
    line = {"type": "LineString", "coordinates": [[0, 3], [10, 5]]}

    def feature(shape, name):
        return {"type": "Feature", "properties": {"set": name}, "geometry": shape}

    body = {"type": "FeatureCollection", "crs": crs, "features": [feature(area, "zone"), feature(line, "j")]}
    (tmp_path / "map.geojson").write_text(json.dumps(body))
    path = tmp_path / "map.toml"
    path.write_text(f'title = "map"\n[[geometry.traces]]\nfile = "map.geojson"\n{REST}')
    built(path, tmp_path / "out")
    assert json.loads((tmp_path / "out" / "block_system.geojson").read_text())["crs"] == crs


def test_a_scene_without_a_run_is_built_and_not_run(tmp_path, capsys):
    path = tmp_path / "plain.toml"
    path.write_text(
        f'title = "plain"\n[[geometry.zones]]\nname = "rock"\nrectangle = [0, 0, 10, 8]\n{REST}\n[dda]\ntime_step_s = 5\n[variants.stiff]\n'
        "materials.rock.youngs_modulus_pa = 4e10\n"
    )
    assert main(["build", str(path), "--out", str(tmp_path / "out"), "--variant", "stiff"]) == 0
    assert main(["run", str(path), "--out", str(tmp_path / "run")]) == 2
    assert "run" in capsys.readouterr().err
