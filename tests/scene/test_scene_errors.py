"""Bad scenes are refused with place, message and way out: each kind of fault, alone and all together."""

import re

import pytest
from scene_texts import GOOD

from geomech.scene import SceneError, load_scene


def line_of(text, fragment):
    return next(n for n, line in enumerate(text.splitlines(), 1) if fragment in line)


TUFF = """\
[materials.tuff]
youngs_modulus_pa = 1e9
poissons_ratio = 0.2
density_kg_m3 = 1800
tensile_strength_pa = 1e6
"""
QUIET_BASE = """\
[[geometry.zones]]
name = "base"
rectangle = [-1.0, -1.0, 2.0, 0.0]
[[geometry.edges]]
name = "quiet"
line = [[-1.0, -1.0], [2.0, -1.0]]
[zones.base]
fixed = true
"""
SPOILT = [
    # old, new, place, message, way out
    (
        "youngs_modulus_pa = 20e9",
        "youngs_modulus = 20e9",
        "materials.rock.youngs_modulus",
        "unknown key",
        "youngs_modulus_pa",
    ),
    (
        "youngs_modulus_pa = 20e9",
        'youngs_modulus_pa = "20e9"',
        "materials.rock.youngs_modulus_pa",
        '"20e9" given',
        "quotes",
    ),
    (
        "youngs_modulus_pa = 20e9",
        "youngs_modulus_pa = -1.0",
        "materials.rock.youngs_modulus_pa",
        "greater than 0",
        "Pa",
    ),
    ("poissons_ratio = 0.25", "poissons_ratio = 0.5", "materials.rock.poissons_ratio", "less than 0.5", "Poisson"),
    ("poissons_ratio = 0.25", "poissons_ratio = nan", "materials.rock.poissons_ratio", "", "Poisson"),
    ("density_kg_m3 = 2500", "density_kg_m3 = 0", "materials.rock.density_kg_m3", "no density", "give the density"),
    ("density_kg_m3 = 2500", "density_kg_m3 = inf", "materials.rock.density_kg_m3", "not a finite number", "density"),
    ("density_kg_m3 = 2500", "density_kg_m3 = true", "materials.rock.density_kg_m3", "true given", "density"),
    ("k_ic_pa_sqrt_m = 1e6", "", "materials.rock", "no fracture toughness", "growth.enabled = false"),
    ("[run]", '[growth]\ninitiation = "surface"\n[run]', "growth.initiation", "no material has", "tensile_strength_pa"),
    (
        "[run]",
        '[zones.rock]\nmaterial = "rock"\n[growth]\ninitiation = "surface"\n' + TUFF + "[run]",
        "materials.tuff",
        "'tuff' has no fracture toughness, and cracks that initiate in it",
        "k_ic_pa_sqrt_m",
    ),
    (
        "[run]",
        '[[loads.viscous_boundaries]]\nedge = "load:tip"\n[dda]\ndynamic_factor = 1\n[run]',
        "loads.viscous_boundaries[0].edge",
        "no edge 'load:tip'",
        "did you mean 'load:top'?",
    ),
    (
        "[run]",
        '[[loads.viscous_boundaries]]\nedge = "quiet"\n[dda]\ndynamic_factor = 1\n' + QUIET_BASE + "[run]",
        "loads.viscous_boundaries[0].edge",
        "the edges 'quiet' belong to fixed blocks",
        "let the zone move",
    ),
    (
        "[run]",
        '[[loads.viscous_boundaries]]\nedge = "load:top"\ntimes_s = [0, 1]\n[run]',
        "loads.viscous_boundaries[0]",
        "together",
        "",
    ),
    (
        "[run]",
        '[dda]\ndynamic_factor = 1\nequilibrium = "loads"\n[run]',
        "dda.equilibrium",
        "is for static runs",
        'equilibrium = "start"',
    ),
    (
        "[run]",
        '[dda]\ndynamic_factor = 1\n[run]\nstepping = "events"',
        "run.stepping",
        "for static runs, and dda.dynamic_factor",
        "set dda.dynamic_factor = 0",
    ),
    ("[run]", '[run]\ncontrol = "toughness"', "run.control", 'requires stepping "events"', "run.stepping"),
    ("[run]", '[run]\nstop_at = ["sliding"]', "run.stop_at", "fixed steps report these", "run.events = "),
    (
        "[run]",
        '[run]\nstepping = "events"\nevents = ["tips"]\nstop_at = ["parting"]',
        "run.stop_at",
        "run.events names neither",
        'add "contacts"',
    ),
    ("[run]", "[run]\nlongest_step_s = 3", "run.longest_step_s", 'requires stepping "events"', "run.stepping"),
    ("density_kg_m3 = 2500", "density_kg_m3 = 2500\nrigid = true", "materials.rock.rigid", "contains a crack", "rigid"),
    ("[run]", "[dda]\nnewmark = [0.2, 0.5]\n[run]", "dda.newmark", "not unconditionally stable", "trapezoidal"),
    ("[run]", "[dda]\nnewmark = [0.5, 0.5]\n[run]", "dda.newmark", "blocks that bounce gain energy", "trapezoidal"),
    (
        "[run]",
        "[dda]\nrayleigh_fractions = [0.02, 0.02]\n[run]",
        "dda",
        "takes `rayleigh_fractions` and `rayleigh_frequencies_hz` together",
        "",
    ),
    (
        "[run]",
        "[dda]\nrayleigh_fractions = [0.01, 0.5]\nrayleigh_frequencies_hz = [10, 1]\n[run]",
        "dda",
        "negative coefficient",
        "",
    ),
    ("end_time_s = 100.0", "", "run.end_time_s", "missing", "add `end_time_s = …`"),
    ("end_time_s = 100.0", "end_time_s = 0.5", "run.end_time_s", "longer than the whole run", "run.end_time_s"),
    ("end_time_s = 100.0", 'end_time_s = 9\nstop_at = ["spilt"]', "run.stop_at[0]", '"spilt" is not one of', "event"),
    (
        "end_time_s = 100.0",
        "end_time_s = 9\nend_tme_s = 9",
        "run.end_tme_s",
        "unknown key",
        "did you mean 'end_time_s'?",
    ),
    ("[materials.rock]", "[material.rock]", "material", "unknown key", "did you mean 'materials'?"),
    (
        'edge = "load:top"',
        'edge = "load:tip"',
        "loads.tractions[0].edge",
        "no edge 'load:tip'",
        "did you mean 'load:top'?",
    ),
    ("rate_pa_per_s = [0.0, -1e5]", "", "loads.tractions[0]", "exactly one of", ""),
    (
        "rate_pa_per_s = [0.0, -1e5]",
        "rate_pa_per_s = [0.0]",
        "loads.tractions[0].rate_pa_per_s",
        "number of entries",
        "Pa/s",
    ),
    (
        "rate_pa_per_s = [0.0, -1e5]",
        "rate_pa_per_s = -1e5",
        "loads.tractions[0].rate_pa_per_s",
        "expected [x, y]",
        "Pa/s",
    ),
    ("rate_pa_per_s = [0.0, -1e5]", "rate_pa_per_s = [0.0, -2e5]", "loads", "do not balance", "balance the tractions"),
    ("rate_pa_per_s = [0.0, -1e5]", "rate_pa_per_s = [1e5, -1e5]", "loads", "do not balance", "balance the tractions"),
    (
        "rate_pa_per_s = [0.0, -1e5]",
        "times_s = [0, 0]\nvalues_pa = [[0, 0], [0, 1]]",
        "loads.tractions[0]",
        "must increase",
        "",
    ),
    ("rate_pa_per_s = [0.0, -1e5]", "times_s = [0, 1]\nvalues_pa = [[0, 0]]", "loads.tractions[0]", "same number", ""),
    ("rectangle = [0.0, 0.0, 1.0, 2.0]", "", "geometry.zones[0]", "either `rectangle` or `polygon`", ""),
    (
        "rectangle = [0.0, 0.0, 1.0, 2.0]",
        "rectangle = [0.0, 0.0, 1.0]",
        "geometry.zones[0].rectangle",
        "entries",
        "corners",
    ),
    (
        "rectangle = [0.0, 0.0, 1.0, 2.0]",
        "polygon = [[0, 0], [1, 2], [1, 0], [0, 2]]",
        "geometry.zones[0]",
        "crosses or touches itself at (0.5, 1)",
        "in order along the outline",
    ),
    ("rectangle = [0.0, 0.0, 1.0, 2.0]", "polygon = [[0, 0], [1, 2]]", "geometry.zones[0]", "2 corners", "three"),
    ("centre = [0.5, 1.0]", "centre = [5.0, 1.0]", "geometry.cracks[0]", "lies outside the rock", "into a zone"),
    (
        "centre = [0.5, 1.0]",
        "centre = [0.95, 1.0]",
        "geometry.cracks[0]",
        "crosses the outline of zone 'rock'",
        "end it",
    ),
    (
        "length_m = 0.2\nangle_deg = 30",
        "length_m = 1.0\nangle_deg = 0",
        "geometry.cracks[0]",
        "cuts a piece off",
        "zones",
    ),
    ("centre = [0.5, 1.0]", "", "geometry.cracks[0]", "a crack needs `points`", ""),
    ("length_m = 0.2", "length_m = 0.0", "geometry.cracks[0].length_m", "greater than 0", "length"),
    (
        "line = [[0.0, 2.0], [1.0, 2.0]]",
        "line = [[0.0, 2.1], [1.0, 2.1]]",
        "geometry.edges[0]",
        "no block edge",
        "outline",
    ),
    (
        "line = [[0.0, 0.0], [1.0, 0.0]]",
        "line = [[0.0, 2.0], [1.0, 2.0]]",
        "geometry.edges[1]",
        "already called 'load:top'",
        "one name",
    ),
]


@pytest.mark.parametrize(("old", "new", "place", "message", "way_out"), SPOILT, ids=[f"{s[2]}: {s[3]}" for s in SPOILT])
def test_one_fault_one_message(errors_of, old, new, place, message, way_out):
    found = [
        e
        for e in errors_of((old, new))
        if e.place.endswith(f": {place}") or re.search(rf": {re.escape(place)}\b", e.place)
    ]
    assert any(message in e.message and way_out in e.way_out for e in found), errors_of((old, new))
    assert re.search(r"scene\.toml:\d+: ", found[0].place)


@pytest.mark.parametrize(
    "case", [s for s in SPOILT if s[1] and s[1] != "youngs_modulus = 20e9" and s[0] != "[materials.rock]"]
)
def test_a_spoilt_value_gives_no_second_error(errors_of, case):
    expected = 2 if "edges" in case[2] else 1  # an edge that is not named leaves its load without an edge
    assert len(errors_of(case[:2])) <= expected


ADDED = [
    ("[zones.rok]\n", "zones.rok", "no zone 'rok'", "did you mean 'rock'?"),
    ('[zones.rock]\nmaterial = "stone"\n', "zones.rock.material", "no material 'stone'", "rock"),
    ("[cracks.flow]\n", "cracks.flow", "no crack 'flow'", "did you mean 'flaw'?"),
    (
        '[joints.rough]\nedges = ["*"]\n[cracks.flaw]\njoint = "tough"\n',
        "cracks.flaw.joint",
        "no joint 'tough'",
        "'rough'",
    ),
    (
        '[joints.glue]\ntensile_strength_pa = 1e6\n[cracks.flaw]\naperture = "slot"\njoint = "glue"\n',
        "cracks.flaw.joint", "cannot have the tensile strength", "closed",
    ),
    ('[cracks.flaw]\naperture = "open"\n', "cracks.flaw.aperture", '"closed", "slot"', "m"),
    ("[cracks.flaw]\naperture = -1.0\n", "cracks.flaw.aperture", '"closed", "slot"', "m"),
    ('[joints.bed]\nedges = ["joint:*"]\n', "joints.bed.edges[0]", "no edge is called 'joint:*'", "load:top"),
    ("[joints.bed]\n", "joints.bed", "names no edges", "default"),
    ('[joints.default]\nedges = ["load:top"]\n', "joints.default", "names edges", "no other joint"),
    ('[joints.a]\nedges = ["load:*"]\n[joints.b]\nedges = ["load:top"]\n', "joints.b.edges[0]", "both claim", "one"),
    ("[joints.default]\nfriction_angle_deg = 90\n", "joints.default.friction_angle_deg", "less than 90", "degrees"),
    ('[[monitors]]\nname = "p"\nat = [3.0, 0.0]\n', "monitors[0].at", "outside all blocks", "x from 0 to 1 m"),
    ('[[monitors]]\nname = "p"\nat = [0.1, 0.1]\n' * 2, "monitors[1].name", "two monitors", "name of its own"),
    ("[gauge]\nfrom = [0.5, -1.0]\nto = [0.5, 1.0]\n", "gauge.from", "outside all blocks", "span"),
    ("[gauge]\nfrom = [0.5, 1.0]\nto = [0.5, 1.0]\n", "gauge.to", "same point", "different"),
    ('[gauge]\nfrom = [0.5, 0.0]\nto = [0.5, 1.0]\nzone = "rok"\n', "gauge.zone", "no zone 'rok'", "rock"),
    ("[growth]\nincrement_m = 1e-3\nmin_increment_m = 1e-2\n", "growth.min_increment_m", "longer than the", "at most"),
    ("[growth]\ntrial_kink_m = 1e-3\n", "growth.trial_kink_m", "used by the criterion", "leave it out"),
    ('[growth]\ncriterion = "sif"\n', "growth.criterion", '"sif" is not one of', '"mts"'),
    ("[dda]\ntime_step_s = 1000.0\n", "dda.time_step_s", "longer than the whole run", "shorten"),
    ("[dda]\ntime_step_s = 5e-324\n", "dda.time_step_s", "1e-12", "time step"),
    ('[dda]\ncontact = "lagrange"\n', "dda.contact", "is not one of", "augmented"),
    ("[dda]\npenetration_tolerance = 0.0\n", "dda.penetration_tolerance", "greater than 0", "size"),
    ("[dda]\ndynamic_factor = 2\n", "dda.dynamic_factor", "at most 1", "dynamic"),
    ("[ddm]\norder = 2.5\n", "ddm.order", "whole number", "order"),
    ("[ddm]\norder = 99\n", "ddm.order", "at most 12", "order"),
    ("[output]\ninterior = 1\n", "output.interior", "true or false", "interior"),
    ('[render]\ncomponent = "zx"\n', "render.component", '"zx" is not one of', "component"),
    ("[variants.a]\n\"ddm.ordr\" = 2\n", "variants.a → ddm.ordr", "unknown key", "did you mean 'order'?"),
    ('[variants.a]\n"geometry.cracks.7.angle_deg" = 2\n', 'variants.a."geometry.cracks.7.angle_deg"', "no item", "0"),
    ('variants = 3\n', "run.variants", "unknown key", ""),
]  # fmt: skip


@pytest.mark.parametrize(("text", "place", "message", "way_out"), ADDED, ids=[f"{a[1]}: {a[2]}" for a in ADDED])
def test_faults_in_further_sections(errors_of, text, place, message, way_out):
    (error,) = errors_of(add=text)
    # The line is that of the key's last part in the text added (or of the table where it has none).
    assert place in error.place and message in error.message and way_out in error.way_out
    number = int(re.search(r"scene\.toml:(\d+):", error.place).group(1))
    assert number > line_of(GOOD, "end_time_s")


def test_lines_point_at_the_key(scene_file):
    text = GOOD.replace("poissons_ratio = 0.25", "poissons_ratio = 0.7").replace("length_m = 0.2", "length_m = -1")
    with pytest.raises(SceneError) as caught:
        load_scene(scene_file(text))
    places = [e.place for e in caught.value.errors]
    assert f"scene.toml:{line_of(text, 'length_m')}: geometry.cracks[0].length_m" in places[0]
    assert f"scene.toml:{line_of(text, 'poissons_ratio')}: materials.rock.poissons_ratio" in places[1]


def test_all_faults_at_once_in_file_order(errors_of):
    found = errors_of(
        ("centre = [0.5, 1.0]", "centre = [5.0, 1.0]"),
        ('edge = "load:top"', 'edge = "load:tip"'),
        ("poissons_ratio = 0.25", "poisson_ratio = 0.25"),
        add='[growth]\ncriterion = "sif"\n[zones.rok]\nfixed = 1\n[colour]\n',
    )
    numbers = [int(re.search(r":(\d+):", e.place).group(1)) for e in found]
    assert numbers == sorted(numbers) and len(found) >= 6
    assert all(e.message for e in found)
    text = str(SceneError(found))
    assert all(e.place in text and e.message in text for e in found)


def test_overrides_say_where_they_come_from(errors_of):
    found = errors_of(
        overrides=["ddm.ordr=3", "geometry.cracks.4.angle_deg=3", "nonsense", "title.x=1", "ddm.nodes=best"]
    )
    places = [e.place for e in found]
    assert "--set ddm.ordr=3" in places and "--set geometry.cracks.4.angle_deg=3" in places
    assert "--set nonsense" in places and "--set title.x=1" in places and "--set ddm.nodes=best" in places
    assert len(found) == 5


def test_unknown_variants(errors_of):
    (error,) = errors_of(add='[variants.fast]\n"dda.time_step_s" = 2.0\n', variant="fats")
    assert "no variant 'fats'" in error.message and "did you mean 'fast'?" in error.way_out


def test_the_chosen_variant_is_named_with_its_line(errors_of):
    (error,) = errors_of(add='[variants.fast]\n"dda.time_step_s" = 2000.0\n', variant="fast")
    line = line_of(GOOD + '[variants.fast]\n"dda.time_step_s" = 2000.0\n', '"dda.time_step_s"')
    assert f"scene.toml:{line}: variants.fast → dda.time_step_s" in error.place


@pytest.mark.parametrize(
    ("line", "way_out"),
    [
        ("poissons_ratio = 0,21", "numbers have a decimal point: 0.21"),
        ("poissons_ratio = -1,5e3  # so", "numbers have a decimal point: -1.5e3"),
        ("enabled = False", "write false in lower case"),
        ("title = unquoted", "double quotes"),
    ],
)
def test_toml_that_is_written_as_elsewhere(scene_file, line, way_out):
    with pytest.raises(SceneError) as caught:
        load_scene(scene_file(line + "\n"))
    assert way_out in caught.value.errors[0].way_out


@pytest.mark.parametrize(
    ("override", "way_out"),
    [
        ("materials.rock.poissons_ratio=0,21", "write a decimal point, 0.21: "),
        ('materials.rock.poissons_ratio="0.21"', "remove the quotes: "),
        ("materials.rock.poissons_ratio=low", "Poisson"),
        ('growth.enabled="False"', "write false, in lower case and without quotes: "),
        ('growth.enabled="false"', "remove the quotes: "),
    ],
)
def test_texts_in_the_place_of_values(errors_of, override, way_out):
    (error,) = errors_of(overrides=[override])
    assert error.way_out.startswith(way_out)


def test_python_writes_true_and_false_too(scene_file):
    assert not load_scene(scene_file(), ["growth.enabled=False"]).tables.growth.enabled


@pytest.mark.parametrize(
    ("text", "place", "message"),
    [
        ("a = 1\nb = [1,\nc = 2\n", ":3", "not valid TOML"),
        ("a = 1\na = 2\n", ":2", "not valid TOML"),
        ("[run\n", ":1", "not valid TOML"),
        ('title = "open\n', ":1", "not valid TOML"),
        ("x = [1, 2", ":1", "not valid TOML"),
    ],
)
def test_toml_syntax(scene_file, text, place, message):
    with pytest.raises(SceneError) as caught:
        load_scene(scene_file(text))
    (error,) = caught.value.errors
    assert f"scene.toml{place}" in error.place and message in error.message


def test_a_file_that_is_not_text(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(SceneError, match="not UTF-8"):
        load_scene(path)


def test_an_empty_scene_names_what_it_needs(scene_file):
    with pytest.raises(SceneError) as caught:
        load_scene(scene_file(""))
    messages = " ".join(e.message for e in caught.value.errors)
    assert all(f"'{name}' is missing" in messages for name in ("geometry", "materials", "run"))
    ways = {e.message.split("'")[1]: e.way_out for e in caught.value.errors}
    assert ways["materials"].startswith("add [materials.NAME]: ")
    assert ways["geometry"].startswith("add [geometry]: ") and ways["run"].startswith("add [run]: ")


def test_model_and_drawing_exclude_one_another(errors_of):
    (error,) = errors_of(("[[geometry.zones]]", '[geometry]\nmodel = "x.geo"\n[[geometry.zones]]'))
    assert "not both" in error.message


def test_models_that_are_missing_or_set_wrongly(scene_file):
    base = GOOD[GOOD.index("[materials.rock]") :]
    with pytest.raises(SceneError) as caught:
        load_scene(scene_file('[geometry]\nmodel = "none.geo"\n' + base))
    assert any("there is no file" in e.message and ":2: geometry.model" in e.place for e in caught.value.errors)


def test_all_faulty_parameters_of_a_model_are_named(scene_file):
    from pathlib import Path

    model = Path(__file__).parents[2] / "geometry" / "two_cracks.geo"
    head = f'[geometry]\nmodel = "{model}"\nparameters = {{ phi = 3, alpha_deg = 1e9, platens = 0 }}\n'
    with pytest.raises(SceneError) as caught:
        load_scene(scene_file(head + GOOD[GOOD.index("[materials.rock]") :]))
    found = {e.place.rsplit(":3: ", 1)[1]: e.message for e in caught.value.errors}
    assert "no parameter 'phi'" in found["geometry.parameters.phi"]
    assert "1e+09 is outside its range" in found["geometry.parameters.alpha_deg"]
    assert len(found) == 2


TWO_ZONES = GOOD.replace(
    "[[geometry.cracks]]",
    '[[geometry.zones]]\nname = "side"\nrectangle = [1.0, 0.0, 2.0, 2.0]\n\n[[geometry.cracks]]',
    1,
)


def faults(scene_file, text, **kwargs):
    with pytest.raises(SceneError) as caught:
        load_scene(scene_file(text), **kwargs)
    return caught.value.errors


def test_zones_without_a_material_where_there_are_two(scene_file):
    steel = "[materials.steel]\nyoungs_modulus_pa = 2e11\npoissons_ratio = 0.3\ndensity_kg_m3 = 7850\n"
    found = faults(scene_file, TWO_ZONES + steel + '[zones.side]\nmaterial = "steel"\n')
    assert len(found) == 1 and "zone 'rock' has no material" in found[0].message and "[zones.rock]" in found[0].way_out


def test_points_between_two_blocks_need_a_zone(scene_file):
    monitor = '[[monitors]]\nname = "m"\nat = [1.0, 1.0]\n'
    (error,) = faults(scene_file, TWO_ZONES + monitor)
    assert "touch" in error.message and "zone" in error.way_out
    assert load_scene(scene_file(TWO_ZONES + monitor + 'zone = "side"\n')).problem().monitors["m"][0] == 1


def test_gravity_needs_something_fixed_unless_blocks_may_fall(scene_file):
    text = GOOD + "[loads]\n"
    text = GOOD.replace("[[loads.tractions]]", "[loads]\ngravity_m_s2 = [0.0, -9.81]\n\n[[loads.tractions]]", 1)
    (error,) = faults(scene_file, text)
    assert "would fall" in error.message and "place it on a fixed zone of its own" in error.way_out
    load_scene(scene_file(text), ["dda.dynamic_factor=1"])
    (error,) = faults(scene_file, text, overrides=["zones.rock.fixed=true"])
    assert "every load acts on fixed blocks (rock)" in error.message
    load_scene(scene_file(text + "[zones.base]\nfixed = true\n"), ["geometry.zones=" + RESTING])


RESTING = '[{ name = "rock", rectangle = [0.0, 0.0, 1.0, 2.0] }, { name = "base", rectangle = [-1.0, -1.0, 2.0, 0.0] }]'


def test_fixing_the_loaded_specimen_is_refused_and_not_advised(scene_file):
    """Loads on edges of different length: the advice is their ratio, by hand 0.5 m to 1 m."""
    text = GOOD.replace("[[0.0, 0.0], [1.0, 0.0]]", "[[0.25, 0.0], [0.75, 0.0]]")
    (error,) = faults(scene_file, text)
    assert "(0, -5e+06) N/m" in error.message
    assert error.way_out.startswith("balance the tractions")
    assert "'load:bottom' (0.5 m) carries (0, 5e+06) N/m" in error.way_out and "zones.NAME" not in error.way_out
    load_scene(scene_file(text), ["loads.tractions.1.rate_pa_per_s=[0.0, 2e5]"])
    (error,) = faults(scene_file, text, overrides=["zones.rock.fixed=true"])
    assert "every load acts on fixed blocks (rock)" in error.message and "zones.rock.fixed" in error.place


def test_a_load_on_a_fixed_block_beside_a_loaded_one_is_reported(scene_file):
    scene = load_scene(scene_file(GOOD + "[zones.base]\nfixed = true\n"), [
        "geometry.zones=" + RESTING,
        "geometry.edges.1.line=[[-1.0, -1.0], [2.0, -1.0]]",
    ])  # fmt: skip
    assert ["'load:bottom' belong to fixed blocks" in w.message for w in scene.warnings].count(True) == 1


def test_loads_that_cancel_on_one_edge_are_reported(scene_file):
    scene = load_scene(scene_file(GOOD.replace('edge = "load:bottom"', 'edge = "load:top"')))
    assert "the tractions on 'load:top' cancel each other" in scene.warnings[0].message


def test_no_hint_leads_to_an_edge_that_is_loaded_already(errors_of):
    (error,) = errors_of(('name = "load:bottom"', 'name = "contact:bottom"'))
    assert "no edge 'load:bottom'" in error.message and "did you mean" not in error.way_out
    assert "edges are 'contact:bottom', 'load:top' (loaded already)" in error.way_out


def test_names_that_have_their_table_are_not_suggested(errors_of):
    (error,) = errors_of(add="[cracks.flaw]\n[cracks.flow]\n")
    assert "no crack 'flow'" in error.message and "did you mean" not in error.way_out and "flaw" in error.way_out


MODEL = """
[geometry]
model = "{model}"
parameters = {{ platens = "both" }}
[materials.rock]
youngs_modulus_pa = 20e9
poissons_ratio = 0.25
density_kg_m3 = 2500
k_ic_pa_sqrt_m = 1e6
[zones.platen_bottom]
fixed = true
[joints.default]
[[loads.tractions]]
edge = "load:top"
rate_pa_per_s = [0.0, -1e5]
[run]
end_time_s = 100.0
"""


@pytest.fixture
def specimen():
    from pathlib import Path

    return MODEL.format(model=Path(__file__).parents[2] / "geometry" / "single_flaw.geo")


def test_the_choice_that_brings_an_edge_is_named(scene_file, specimen):
    text = specimen.replace("[run]", '[[loads.tractions]]\nedge = "load:bottom"\nvalue_pa = [0.0, 1.0]\n[run]')
    (error,) = faults(scene_file, text)
    assert error.way_out.startswith('the model has it with geometry.parameters.platens = "none"; now its edges are')
    assert "did you mean 'load:top'" not in error.way_out and "'contact:bottom'" in error.way_out
    (error,) = faults(scene_file, text.replace('edge = "load:bottom"', 'edge = "left"'))
    assert "edge names may depend on the model's parameters" in error.way_out


def test_physical_curves_that_nothing_uses_are_reported(scene_file, specimen):
    (warning,) = load_scene(scene_file(specimen)).warnings
    assert "names the edges 'contact:bottom', 'contact:top'" in warning.message and "crack:NAME" in warning.way_out
    used = specimen.replace("[joints.default]", '[joints.default]\n[joints.platens]\nedges = ["contact:*"]')
    assert load_scene(scene_file(used)).warnings == ()


def test_a_moment_is_unbalanced_too(scene_file):
    # Equal and opposite shear on both ends: no force, but a moment.
    text = GOOD.replace("[0.0, -1e5]", "[1e5, 0.0]").replace("[0.0, 1e5]", "[-1e5, 0.0]")
    (error,) = faults(scene_file, text)
    assert "a force of (0, 0) N/m and a moment of" in error.message


def test_leading_edge_must_be_loaded(scene_file):
    text = GOOD.replace("[[loads.tractions]]", '[loads]\nleading_edge = "load:bttom"\n\n[[loads.tractions]]', 1)
    (error,) = faults(scene_file, text)
    assert "no traction acts on" in error.message and "did you mean 'load:bottom'?" in error.way_out


def test_weight_can_lead_only_where_it_acts(scene_file):
    text = GOOD.replace("[[loads.tractions]]", '[loads]\nleading_edge = "gravity"\n\n[[loads.tractions]]', 1)
    (error,) = faults(scene_file, text)
    assert "no gravity to be the leading load" in error.message and "gravity_ramp_s" in error.way_out


def test_two_cracks_of_one_name(scene_file):
    again = '[[geometry.cracks]]\nname = "flaw"\npoints = [[0.2, 0.2], [0.3, 0.3]]\n\n[[geometry.edges]]'
    (error,) = faults(scene_file, GOOD.replace("[[geometry.edges]]", again, 1))
    assert "two cracks called 'flaw'" in error.message


def test_coincident_cracks_are_named(scene_file):
    again = (
        '[[geometry.cracks]]\nname = "twin"\ncentre = [0.5, 1.0]\nlength_m = 0.1\nangle_deg = 30\n\n[[geometry.edges]]'
    )
    (error,) = faults(scene_file, GOOD.replace("[[geometry.edges]]", again, 1))
    assert "'flaw' and 'twin' coincide" in error.message and "geometry.cracks[1]" in error.place


def test_a_drawing_is_not_a_scene(tmp_path):
    drawing = tmp_path / "slope.geo"
    drawing.write_text("Point(1) = {0, 0, 0};\n")
    with pytest.raises(SceneError, match=r'drawing, not a scene[^\n]*\n?[^\n]*model = "slope\.geo"'):
        load_scene(drawing)


def test_a_key_of_another_table_is_named_with_it(errors_of):
    found = errors_of(
        overrides=["end_time_s=1", "dda.k_ic_pa_sqrt_m=1", "dynamicfactor=1", "quite_other=1", "output.monitors=1"]
    )
    meant = [error.way_out.partition("? ")[0] for error in found]
    assert meant[0] == "did you mean 'run.end_time_s'"
    assert meant[1] == "did you mean 'materials.NAME.k_ic_pa_sqrt_m'"
    assert meant[2] == "did you mean 'dda.dynamic_factor'"
    assert meant[3].startswith("keys here are")
    # A table of the scene itself: "monitors", the key that was written, would say nothing.
    assert meant[4] == "did you mean '[[monitors]]'"


def test_null_characters_are_refused_with_their_place(scene_file):
    """The system's functions for files raise errors without a place."""
    record = '[loads.base]\nfile = "quake\\u0000.csv"\n[variants.a]\ntitle = "b\\u0000"\n'
    first, second = faults(scene_file, GOOD + record)
    assert "loads.base.file" in first.place and "null character" in first.message
    assert "variants.a.title" in second.place and "null character" in second.message


def test_dead_ends_that_may_grow_say_where_toughness_belongs(errors_of):
    joints = '[[geometry.joint_sets]]\nname = "cross"\nangle_deg = 70\nspacing_m = 0.3\nlength_m = 0.4\ngap_m = 0.1\n'
    found = errors_of(("k_ic_pa_sqrt_m = 1e6", ""), add=joints)
    (error,) = [error for error in found if "fracture toughness" in error.message]
    assert "[materials.rock]" in error.way_out


def test_a_value_where_a_table_belongs_is_told_what_it_needs(errors_of):
    found = errors_of(overrides=["monitors=3", "run.stop_at=split"])
    assert any("{ name = …, … }" in error.message for error in found)
    assert any('write an array, ["split"]' in error.way_out for error in found)
    (error,) = errors_of(overrides=['zones.rok.material="rock"'])
    assert "did you mean" in error.way_out


def test_a_mechanism_is_for_static_runs(errors_of):
    (error,) = errors_of(overrides=['run.stop_at=["mechanism"]', "dda.dynamic_factor=1"])
    assert "run.stop_at" in error.place and "static runs only" in error.message
