"""Scenes become problems: values, defaults, overrides, variants, the resolved form, warnings."""

import math
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from scene_texts import GOOD
from small_scenes import block

from geomech.model import rayleigh_coefficients
from geomech.scene import SceneError, describe_keys, load_scene
from geomech.scene.keys import keys_of
from geomech.scene.tables import SceneTables

PIPELINES = Path(__file__).parents[2] / "pipelines"


def test_a_short_scene_has_sensible_defaults(scene_file):
    scene = load_scene(scene_file())
    problem = scene.problem()
    assert problem.title == "A plate between two loads" and scene.warnings == ()
    assert problem.blocks.n_blocks == 1 and problem.blocks.areas()[0] == pytest.approx(2.0, abs=1e-15)
    assert problem.materials[0].k_ic == 1e6 and problem.materials[0].plane == "strain"
    assert problem.cracks.aperture.tolist() == [0.0]
    assert problem.load_edge == "load:top"
    assert [law.name for law in problem.joints] == ["default"] and problem.joint_of == {}
    # A tenth of the median crack, of two the shorter one, and a tenth of that.
    assert problem.growth.increment == pytest.approx(0.02, rel=1e-9)
    assert problem.growth.min_increment == pytest.approx(0.002, rel=1e-9)
    assert problem.run.end_time == 100.0 and problem.gauge is None and problem.monitors == {}
    assert problem.loads.edge_tractions[0].history.at(10.0).tolist() == [0.0, -1e6]


@pytest.mark.parametrize("lengths, increment", [((0.1,), 0.01), ((0.01, 0.3), 0.02), ((0.01, 0.15, 0.3), 0.015)])
def test_the_default_increment_follows_the_median_crack(scene_file, lengths, increment):
    """Beside a crack of 0.2 m. The shortest of many traces, a remnant, does not set the advance of all; of two cracks the
    shorter one does."""
    more = "".join(
        f'[[geometry.cracks]]\nname = "more {k}"\npoints = [[0.1, {0.2 + 0.1 * k}], [{0.1 + length}, {0.2 + 0.1 * k}]]\n'
        for k, length in enumerate(lengths)
    )
    growth = load_scene(scene_file(GOOD + more)).problem().growth
    assert growth.increment == pytest.approx(increment, rel=1e-9)
    assert growth.min_increment == pytest.approx(0.1 * increment, rel=1e-9)


def test_defaults_are_those_of_the_model(scene_file):
    from geomech.model import DdaSettings, DdmSettings, GrowthSettings, RunSettings

    problem = load_scene(scene_file()).problem()
    assert problem.dda == DdaSettings() and problem.ddm == DdmSettings()
    assert problem.run == RunSettings(end_time=100.0)
    for name in ("criterion", "join_distance", "max_passes"):
        assert getattr(problem.growth, name) == getattr(GrowthSettings(), name)


FULL = """
[zones.left]
material = "soft"
guided = "x"
[zones.right]
material = "hard"
fixed = true
[joints.default]
friction_angle_deg = 30
cohesion_pa = 1e3
[joints.bedding]
edges = ["joint:*", "crack:*"]
normal_stiffness_pa_per_m = 1e10
[joints.pair]
between = [["load:top", "joint:1"]]
tensile_strength_pa = 5e4
[cracks.default]
aperture = "slot"
[cracks.thin]
aperture = 1e-4
joint = "bedding"
[gauge]
from = [0.5, 0.0]
to = [0.5, 1.0]
[[monitors]]
name = "corner"
at = [1.0, 1.0]
zone = "left"
"""
TWO = """
[[geometry.zones]]
name = "left"
polygon = [[0, 0], [1, 0], [1, 1], [0, 1]]
[[geometry.zones]]
name = "right"
rectangle = [1.0, 0.0, 2.0, 1.0]
holes = [[[1.4, 0.4], [1.6, 0.4], [1.6, 0.6]]]
[[geometry.cracks]]
name = "wide"
points = [[0.2, 0.2], [0.3, 0.3], [0.4, 0.3]]
[[geometry.cracks]]
name = "thin"
points = [[0.2, 0.7], [0.4, 0.7]]
[[geometry.edges]]
name = "joint:1"
line = [[1.0, 0.0], [1.0, 1.0]]
[[geometry.edges]]
name = "load:top"
line = [[0.0, 1.0], [1.0, 1.0]]
[materials.hard]
youngs_modulus_pa = 50e9
poissons_ratio = 0.2
density_kg_m3 = 2700
[materials.soft]
youngs_modulus_pa = 5e9
poissons_ratio = 0.3
density_kg_m3 = 2000
k_ic_pa_sqrt_m = 5e5
k_iic_pa_sqrt_m = 8e5
tensile_strength_pa = 4e6
cohesion_pa = 2e7
internal_friction_angle_deg = 45
plane = "stress"
[loads]
gravity_m_s2 = [0.0, -9.81]
gravity_ramp_s = 2.0
[[loads.tractions]]
edge = "load:top"
times_s = [0.0, 1.0, 3.0]
values_pa = [[0, 0], [0, -1e5], [1e4, -1e5]]
[[loads.forces]]
at = [0.5, 0.9]
rate_n_per_m_s = [0.0, -10.0]
start_s = 4.0
[[loads.viscous_boundaries]]
edge = "load:top"
times_s = [0, 1]
incoming_m_per_s = [[0, 0], [0, -0.1]]
[dda]
time_step_s = 0.01
automatic_time_step = true
dynamic_factor = 0.9
damping = 0.1
newmark = [0.25, 0.5]
spectral_radius = 0.7
equilibrium = "start"
unbalanced_tolerance = 1e-5
rayleigh_fractions = [0.02, 0.03]
rayleigh_frequencies_hz = [1, 4]
max_displacement_ratio = 0.002
normal_penalty_pa = 1e12
shear_penalty_pa = 5e11
contact = "augmented"
penetration_tolerance = 1e-6
corner_rounding = 0.02
order_target = 0.03
springs = "resolved"
max_open_close_iterations = 9
max_step_cuts = 5
[ddm]
order = 3
nodes = "gauss"
elements_per_crack = 5
elements_per_side = 7
grading_ratio = 0.4
grading_layers = 1
solver = "compressed"
[growth]
criterion = "g"
increment_m = 0.02
min_increment_m = 0.001
join_distance = 0.7
max_passes = 11
initiation = "surface"
initiation_distance_m = 0.003
initiation_spacing_m = 0.05
[run]
end_time_s = 5
stop_at = ["initiation"]
"""


def test_every_setting_arrives(scene_file):
    p = load_scene(scene_file(TWO + FULL)).problem()
    assert [m.name for m in p.materials] == ["hard", "soft"]
    assert p.blocks.material.tolist() == [1, 0] and p.blocks.fixed.tolist() == [False, True]
    assert p.blocks.areas() == pytest.approx([1.0, 0.98], abs=1e-14)
    # Guided along x: v0, r0 and γxy are held, u0 and the strains along the axes are not.
    assert p.blocks.constrained.tolist() == [[False, True, True, False, False, True], [False] * 6]
    assert p.materials[1].plane == "stress" and p.materials[0].k_ic == math.inf
    assert p.cracks.aperture.tolist() == [math.inf, math.inf, 1e-4]
    assert p.cracks.law.tolist() == [0, 0, 1] and [law.name for law in p.face_laws] == ["frictionless", "bedding"]
    names = [law.name for law in p.joints]
    assert names == ["default", "bedding", "pair"]
    assert p.joints[0].friction_angle == pytest.approx(math.pi / 6) and p.joints[0].cohesion == 1e3
    assert p.joints[1].normal_stiffness == 1e10 and p.joints[2].tensile_strength == 5e4
    assert p.joint_index("joint:1", "joint:1") == 1
    assert p.joint_index("crack:wide", "crack:wide") == 1
    assert p.joint_index("joint:1", "load:top") == 2
    assert p.joint_index("", "load:top") == 0
    gravity = p.loads.gravity
    assert gravity.at(1.0).tolist() == [0.0, -4.905] and gravity.at(9.0).tolist() == [0.0, -9.81]
    assert p.loads.edge_tractions[0].history.at(2.0).tolist() == [5e3, -1e5]
    force = p.loads.point_loads[0]
    assert force.block == 0 and force.at == (0.5, 0.9) and force.history.at(5.0).tolist() == [0.0, -10.0]
    (quiet,) = p.loads.viscous_boundaries
    assert quiet.edge_name == "load:top" and quiet.incoming.at(0.5).tolist() == [0.0, -0.05]
    mass, stiffness = rayleigh_coefficients((0.02, 0.03), (1.0, 4.0))
    assert vars(p.dda) | {"contact_solver": None} == {
        "contact_solver": None,
        "time_step": 0.01,
        "automatic_time_step": True,
        "dynamic_factor": 0.9,
        "damping": 0.1,
        "newmark": (0.25, 0.5),
        "spectral_radius": 0.7,
        "equilibrium": "start",
        "unbalanced_tolerance": 1e-5,
        "rayleigh_mass": mass,
        "rayleigh_stiffness": stiffness,
        "max_displacement_ratio": 0.002,
        "normal_penalty": 1e12,
        "shear_penalty": 5e11,
        "contact": "augmented",
        "penetration_tolerance": 1e-6,
        "corner_rounding": 0.02,
        "order_target": 0.03,
        "springs": "resolved",
        "max_open_close_iterations": 9,
        "max_step_cuts": 5,
    }
    assert vars(p.ddm) == {
        "order": 3,
        "nodes": "gauss",
        "elements_per_crack": 5,
        "elements_per_side": 7,
        "grading_ratio": 0.4,
        "grading_layers": 1,
        "solver": "compressed",
        "target_error": None,
        "grading_error": None,
    }
    assert (p.growth.criterion, p.growth.increment, p.growth.min_increment) == ("g", 0.02, 0.001)
    assert (p.growth.join_distance, p.growth.max_passes) == (0.7, 11)
    assert (p.growth.initiation, p.growth.initiation_distance, p.growth.initiation_spacing) == ("surface", 0.003, 0.05)
    whole = next(m for m in p.materials if math.isfinite(m.cohesion))
    assert (whole.k_iic, whole.tensile_strength, whole.cohesion) == (8e5, 4e6, 2e7)
    assert whole.friction_angle == pytest.approx(math.pi / 4)
    assert p.run.end_time == 5 and p.run.stop_at == ("initiation",)
    assert p.gauge == ((0, (0.5, 0.0)), (0, (0.5, 1.0)))
    assert p.monitors == {"corner": (0, (1.0, 1.0))}


def test_steps_to_events(scene_file):
    overrides = ['run.stepping="events"', "run.longest_step_s=20", 'run.control="toughness"']
    run = load_scene(scene_file(GOOD), overrides).problem().run
    assert (run.stepping, run.longest_step, run.control) == ("events", 20.0, "toughness")


def test_growth_switched_off_needs_no_toughness(scene_file):
    text = GOOD.replace("k_ic_pa_sqrt_m = 1e6\n", "") + "[growth]\nenabled = false\n"
    assert load_scene(scene_file(text)).problem().materials[0].k_ic == math.inf
    with_toughness = load_scene(scene_file(GOOD), ["growth.enabled=false"])
    assert with_toughness.problem().materials[0].k_ic == math.inf


def test_overrides(scene_file):
    overrides = [
        "dda.time_step_s=0.5",
        "title = soft rock",
        "growth.criterion=g",
        'run.stop_at=["split"]',
        "geometry.cracks[0].angle_deg=90",
        "loads.tractions.1.rate_pa_per_s=[0.0, 2e5]",
        "loads.tractions.0.rate_pa_per_s=[0.0, -2e5]",
        "ddm.order=2",
    ]
    problem = load_scene(scene_file(), overrides).problem()
    assert problem.dda.time_step == 0.5 and problem.title == "soft rock" and problem.growth.criterion == "g"
    assert problem.run.stop_at == ("split",) and problem.ddm.order == 2
    assert problem.cracks.nodes[:, 0] == pytest.approx([0.5, 0.5], abs=1e-12)
    assert problem.loads.edge_tractions[1].history.rate.tolist() == [0.0, 2e5]


VARIANTS = """
[variants.coarse]
"ddm.order" = 2
"geometry.cracks.0.angle_deg" = 45
[variants.fast]
dda.time_step_s = 2.0
[variants.fast.run]
end_time_s = 50.0
"""


def test_variants_and_overrides_on_top(scene_file):
    path = scene_file(GOOD + VARIANTS)
    assert load_scene(path).variants == ("coarse", "fast")
    assert load_scene(path).problem().ddm.order == 4
    assert load_scene(path, variant="coarse").problem().ddm.order == 2
    fast = load_scene(path, ["run.end_time_s=60.0"], variant="fast")
    assert fast.variant == "fast" and fast.problem().dda.time_step == 2.0 and fast.problem().run.end_time == 60.0


def equal(a, b):
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b)
    if hasattr(a, "__dataclass_fields__"):
        return all(equal(getattr(a, name), getattr(b, name)) for name in a.__dataclass_fields__)
    if isinstance(a, (tuple, list)):
        return len(a) == len(b) and all(equal(x, y) for x, y in zip(a, b, strict=True))
    return a == b


@pytest.mark.parametrize("text", [GOOD + VARIANTS, TWO + FULL])
def test_the_resolved_scene_gives_the_same_problem(scene_file, tmp_path, text):
    first = load_scene(scene_file(text), ["dda.max_step_cuts=3"])
    again = tmp_path / "elsewhere" / "scene.toml"
    again.parent.mkdir()
    again.write_text(tomli_w.dumps(first.resolved()))
    assert equal(first.problem(), load_scene(again).problem())
    assert load_scene(again).variants == ()


def test_the_resolved_scene_of_a_model_has_its_path_and_all_parameters(tmp_path):
    first = load_scene(PIPELINES / "two_cracks", ["geometry.parameters.phi_from=horizontal"], "phi_30")
    resolved = tomllib.loads(tomli_w.dumps(first.resolved()))
    assert Path(resolved["geometry"]["model"]).is_absolute()
    assert resolved["geometry"]["parameters"]["width_m"] == 0.06
    again = tmp_path / "copy.toml"
    again.write_text(tomli_w.dumps(resolved))
    assert equal(first.problem(), load_scene(again).problem())


def test_names_of_scenes(scene_file, tmp_path):
    assert load_scene(scene_file(name="plate.toml")).name == "plate"
    scene_file()
    assert load_scene(tmp_path).name == tmp_path.name


def test_an_untitled_scene_is_called_by_its_name(scene_file):
    scene = load_scene(scene_file(GOOD.replace('title = "A plate between two loads"', ""), "plate.toml"))
    assert scene.title == scene.problem().title == scene.resolved()["title"] == "plate"


def test_warnings_do_not_stop_a_scene(scene_file):
    text = TWO + FULL.replace("[joints.default]\nfriction_angle_deg = 30\ncohesion_pa = 1e3\n", "")
    (warning,) = load_scene(scene_file(text)).warnings
    assert "no default joint" in warning.message and "[joints.default]" in warning.way_out


def test_every_key_is_described_once():
    text = describe_keys()
    for name, field in SceneTables.model_fields.items():
        assert field.description, name
    for key in ("youngs_modulus_pa", "friction_angle_deg", "spacing_m", "max_displacement_ratio", "from", "stop_at"):
        assert text.count(f"\n  {key} = ") == 1, key
    assert '"mts" | "g" | "s"' in text and "(required)" in text
    assert set(keys_of(SceneTables)) >= {"geometry", "materials", "variants"}


def test_checking_a_scene_loads_no_solver_and_no_gmsh_for_toml():
    script = (
        "import sys\nfrom geomech.scene import load_scene\n"
        f"load_scene({str(PIPELINES / 'two_cracks' / 'toml.toml')!r}).problem()\n"
        "found = [m for m in ('gmsh', 'numba', 'vtk', 'scipy', 'pyvista', 'matplotlib') if m in sys.modules]\n"
        "sys.exit(', '.join(found) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_missing_files(tmp_path, scene_file):
    scene_file(name="plate.toml")
    with pytest.raises(SceneError, match="no such scene") as caught:
        load_scene(tmp_path / "plat.toml")
    assert "plate.toml" in caught.value.errors[0].way_out
    with pytest.raises(SceneError, match=r"holds no scene.toml"):
        load_scene(tmp_path)


@pytest.mark.parametrize(
    ("shaken", "asked", "scheme", "radius"),
    [
        (True, "", (0.25, 0.5), None),
        (False, "", (0.5, 1.0), None),
        (True, "newmark = [0.5, 1.0]\n", (0.5, 1.0), None),
        (True, "spectral_radius = 0.8\n", (0.25, 0.5), 0.8),
    ],
)
def test_where_the_ground_moves_waves_are_kept(scene_file, tmp_path, shaken, asked, scheme, radius):
    (tmp_path / "quake.csv").write_text("0, 0\n1, 1\n2, 0\n")
    base = '[loads.base]\nfile = "quake.csv"\ndirection = [1.0, 0.0]\n' if shaken else ""
    text = block(moving=True).replace("dynamic_factor", asked + "dynamic_factor").replace("[dda]", base + "[dda]")
    scene = load_scene(scene_file(text))
    assert (scene.problem().dda.newmark, scene.problem().dda.spectral_radius) == (scheme, radius)
    # As it is written out in a run folder, it is the same run.
    (tmp_path / "again.toml").write_text(tomli_w.dumps(scene.resolved()))
    assert load_scene(tmp_path / "again.toml").problem().dda == scene.problem().dda
