"""Every model under geometry/ builds, with its own parameters and others, and its scene starts to run."""

import math
from pathlib import Path

import numpy as np
import pytest

import geomech
from geomech.reference.blocks import masonry
from geomech.reference.slopes import toppling_slope
from geomech.scene import load_scene
from geomech.shapes import cut, read_gmsh_model

GEOMETRY = Path(__file__).parents[2] / "geometry"
MODELS = sorted(path.stem for path in GEOMETRY.glob("*.geo"))
#: Coordinates are kept to twelve digits; a block's area is the difference of larger ones.
ROUNDOFF = 1e-10
#: What a default run has time for; the others run as studies.
QUICK = ("brazilian_disc", "masonry_arch", "planar_slope", "toppling_slope")
SCENES = sorted(path.stem for path in GEOMETRY.glob("*.toml"))


def built(model, **parameters):
    drawing = read_gmsh_model(GEOMETRY / f"{model}.geo", parameters)
    return drawing, cut(drawing.zones, drawing.joints)


def drawn_area(drawing):
    def area(loop):
        x, y = loop.T
        return abs(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))

    return sum(area(zone.loops[0]) - sum(area(hole) for hole in zone.loops[1:]) for zone in drawing.zones)


@pytest.mark.first_by_default(8)
@pytest.mark.parametrize("model", MODELS)
def test_a_model_builds_and_loses_no_rock(model):
    drawing, cutting = built(model)
    assert drawing.warnings == () and cutting.blocks.areas().sum() == pytest.approx(drawn_area(drawing), rel=ROUNDOFF)
    # All its parameters stand in the side panel, each with a label and a place of its own.
    assert len(drawing.parameters) >= 5 and all(p.path.count("/") == 2 for p in drawing.parameters.values())


@pytest.mark.first_by_default(7)
@pytest.mark.parametrize(
    ("model", "parameters"),
    [
        ("benched_slope", {"benches": 1, "fault": "none"}),
        ("benched_slope", {"benches": 6, "face_angle_deg": 85, "fault_dip_deg": 60}),
        ("two_set_slope", {"dip_a_deg": 45, "angle_b_deg": 90, "height_m": 35}),
        ("two_set_slope", {"bridge_a_m": 0, "bridge_b_m": 0}),
        ("planar_slope", {"tension_crack": "none", "toe_height_m": 4}),
        ("planar_slope", {"tension_crack": "none", "plane_dip_deg": 10}),
        ("toppling_slope", {"columns": 4, "crest_column": 2}),
        ("tunnel", {"shape": "circle", "fault_angle_deg": 90}),
        ("tunnel", {"fault": "none"}),
        ("tunnel", {"bolts": 1, "bolt_m": 6}),
        ("benched_slope", {"benches": 2, "water": "none"}),
        ("masonry_arch", {"half_angle_deg": 60, "voussoirs": 31}),
        ("brick_wall", {"courses": 1, "bricks": 1}),
        ("brazilian_disc", {"crack_ratio": 0, "flat_angle_deg": 30}),
    ],
)
def test_parameters_may_be_others(model, parameters):
    drawing, cutting = built(model, **parameters)
    assert drawing.warnings == () and cutting.blocks.areas().sum() == pytest.approx(drawn_area(drawing), rel=ROUNDOFF)


def test_what_the_models_draw_is_what_their_sources_say():
    # Goodman & Bray (1976): heights of the columns rise to 40 m at the crest, the tenth, and fall to 4 m behind it.
    drawing, _ = built("toppling_slope")
    columns = [zone.loops[0] for zone in drawing.zones if zone.name == "columns"]
    tall = [float(np.hypot(*(loop[2] - loop[1]))) for loop in columns]
    # The paper rounds the steps of the tops and feet to whole and tenth metres; six steps behind the crest add up.
    assert tall == pytest.approx(toppling_slope.HEIGHTS, abs=0.7)
    assert tall[:10] == pytest.approx(toppling_slope.HEIGHTS[:10], abs=0.1)
    # The arch of the limit analysis, voussoir for voussoir.
    drawing, _ = built("masonry_arch", voussoirs=9, radius_m=2.0)
    arch = [zone.loops[0] for zone in drawing.zones if zone.name == "voussoirs"]
    for loop, outline in zip(arch, masonry.voussoirs(9, 0.15, 2.0), strict=True):
        assert np.abs(np.sort(loop, axis=0) - np.sort(outline, axis=0)).max() < 1e-12
    # A wall of two courses of three and four bricks.
    _, cutting = built("brick_wall", courses=2, bricks=3)
    assert cutting.blocks.n_blocks == 3 + 4 + 1
    # The block between the face, the plane and the tension crack: the strip under the crest less the triangle under the
    # plane.
    _, cutting = built("planar_slope")
    brink, far = 30 / math.tan(math.radians(60)), 30 / math.tan(math.radians(60)) + 6
    wedge = 0.5 * brink * 30 + 6 * 30 - 0.5 * far**2 * math.tan(math.radians(35))
    assert np.abs(cutting.blocks.areas() - wedge).min() < 1e-9 * wedge


def test_bolts_water_and_monitors_are_drawn():
    tunnel = load_scene(GEOMETRY / "tunnel.toml", ["geometry.parameters.bolts=5"])
    bars = np.array([(bolt.start, bolt.end) for bolt in tunnel.tables.loads.bolts])
    # Radial bars of 4 m over 150° of a roof of 3 m.
    assert np.hypot(*bars[:, 0].T) == pytest.approx(3) and np.hypot(*bars[:, 1].T) == pytest.approx(7)
    angles = np.degrees(np.arctan2(bars[:, 1, 1], bars[:, 1, 0]))
    assert angles == pytest.approx([15, 52.5, 90, 127.5, 165])
    slope = load_scene(GEOMETRY / "benched_slope.toml")
    assert list(slope.problem().monitors) == ["bench 1", "bench 2", "bench 3"]
    water = np.array(slope.tables.loads.water.points)
    # It rises with the square root to 0.35 of 30 m.
    assert water[1:, 1] == pytest.approx(0.35 * 30 * np.sqrt(water[1:, 0] / water[-1, 0]))


def test_the_traced_slope_is_cut_as_it_is_drawn():
    pytest.importorskip("ezdxf")
    scene = load_scene(GEOMETRY / "traced_slope.toml")
    assert scene.origin == (512330.0, 0.0)
    # Corners of the outline as they stand in the drawing.
    rock = np.array([(0, 0), (45, 0), (45, 31.2), (36.5, 30.1), (28.2, 29), (19.6, 26.8), (10.6, 24.1), (9.3, 20.4),
                     (8.4, 16.6), (7.1, 12.35), (4.2, 12), (3.1, 8.7), (1.3, 4.1)])  # fmt: skip
    x, y = rock.T
    area = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    zones = np.array(scene.drawing.zones)
    assert scene.blocks.areas()[zones == "rock"].sum() == pytest.approx(area, rel=ROUNDOFF)
    assert (zones == "base").sum() == 1 and set(scene.drawing.joints) == {
        "joint:bedding",
        "joint:cross",
        "joint:fault",
    }
    problem = scene.problem()
    assert list(problem.monitors) == ["crest", "berm"] and len(scene.tables.loads.bolts) == 3
    start, end = (np.array(point) for point in (scene.tables.loads.bolts[0].start, scene.tables.loads.bolts[0].end))
    # The block of the drawing holds a bar of 13.5 m; it is put there turned by -14°.
    assert end - start == pytest.approx(13.5 * np.array([np.cos(np.radians(14)), -np.sin(np.radians(14))]))
    assert "hidden layers are left out: 'TITLE'" in scene.warnings[-1].message


@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in SCENES])
def test_its_scene_starts_to_run(name):
    scene = load_scene(GEOMETRY / f"{name}.toml", ["run.end_time_s=1e9"])
    problem = scene.problem()
    # Unbounded rock is one block.
    assert problem.blocks.n_blocks > 2 or problem.endless is not None
    runs = iter(geomech.cycles(scene))
    cycle = [next(runs) for _ in range(3)][-1]
    assert np.isfinite(cycle.state.vertices).all()
