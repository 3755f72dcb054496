"""Examples that travel with the package, scenes to begin with, and the schema of scenes."""

import math
import tomllib
from pathlib import Path

import jsonschema
import pytest

import geomech
from geomech import examples
from geomech.cli import BAD_INPUT, DONE, main
from geomech.scene import load_scene
from geomech.scene.keys import schema

ROOT = Path(__file__).parents[1]


def test_every_study_and_scene_is_listed_with_a_line(capsys):
    assert main(["examples"]) == DONE
    told = capsys.readouterr().out
    studies = {path.parent.name for path in (ROOT / "pipelines").glob("*/run.py")}
    scenes = {path.stem for path in (ROOT / "geometry").glob("*.toml")}
    found = {example.name: example for example in examples.examples()}
    assert set(found) == studies | scenes and all(example.line for example in found.values())
    assert all(f"{name} " in told for name in found)
    assert found["two_cracks"].picture.is_file()


@pytest.mark.parametrize("name", ["two_cracks", "tunnel", "traced_slope", "brazilian_disc", "masonry_arch"])
def test_a_copied_example_needs_nothing_else(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["examples", "copy", name]) == DONE
    place = tmp_path / name
    scene = next((path for path in (place / "scene.toml", place / f"{name}.toml") if path.exists()), None)
    if scene is None:  # a study that draws its scenes by a script
        assert (place / "run.py").is_file()
    else:
        assert load_scene(scene).problem().blocks.n_blocks > 0
    assert main(["examples", "copy", name]) == BAD_INPUT


def test_examples_are_checked_by_their_name_where_no_such_file_is(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["check", "planar_slope"]) == DONE
    assert capsys.readouterr().out.startswith("A sliding plane with one rock bridge")
    assert main(["check", "no_such_example"]) == BAD_INPUT


@pytest.mark.parametrize("kind", examples.kinds())
def test_a_scene_begun_anew_has_no_errors(kind, tmp_path):
    assert main(["new", kind, str(tmp_path / "mine")]) == DONE
    assert load_scene(tmp_path / "mine").problem().blocks.n_blocks > 1
    assert main(["new", kind, str(tmp_path / "mine")]) == BAD_INPUT
    # Nothing to wonder at, but slivers that are merged as the scene asks for.
    faults = load_scene(tmp_path / "mine").warnings
    assert all("sliver" in fault.message for fault in faults), [fault.message for fault in faults]


def test_the_slope_begun_anew_slides_on_its_beds(tmp_path):
    """One slab on beds at 35°: F = tan φ / tan 35°, within the bracket of the search (0.2 %)."""
    examples.new("slope", tmp_path / "mine")
    found = geomech.factor_of_safety(load_scene(tmp_path / "mine"))
    assert found.factor == pytest.approx(math.tan(math.radians(30)) / math.tan(math.radians(35)), rel=2e-3)


@pytest.mark.parametrize("words", [["examples", "copy"], ["examples", "copy", "none"], ["new", "house", "x"]])
def test_what_is_not_there_is_refused_by_name(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(words) == BAD_INPUT
    assert "two_cracks" in (said := capsys.readouterr().err) or "examples" in said or "slope" in said


TABLES = sorted([*ROOT.glob("pipelines/*/*.toml"), *ROOT.glob("geometry/*.toml"), *examples.TEMPLATES.glob("*.toml")])
#: Tables of sweeps are no scenes.
SCENES = [
    path
    for path in TABLES
    if "\n[geometry]" in path.read_text(encoding="utf-8") or "[[geometry." in path.read_text(encoding="utf-8")
]


@pytest.fixture(scope="module")
def keeps_to_the_schema():
    told = schema()
    jsonschema.Draft202012Validator.check_schema(told)
    return jsonschema.Draft202012Validator(told)


@pytest.mark.first_by_default(8)
@pytest.mark.parametrize("path", SCENES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_every_scene_keeps_to_the_schema(path, keeps_to_the_schema):
    keeps_to_the_schema.validate(tomllib.loads(path.read_text(encoding="utf-8")))


def test_the_schema_refuses_what_a_scene_may_not_say():
    scene = tomllib.loads((ROOT / "geometry" / "tunnel.toml").read_text(encoding="utf-8"))
    scene["run"]["end_times"] = 1.0
    with pytest.raises(jsonschema.ValidationError, match="end_times"):
        jsonschema.validate(scene, schema())
    del scene["run"]["end_times"]
    scene["dda"]["time_step_s"] = -1.0
    with pytest.raises(jsonschema.ValidationError, match="minimum"):
        jsonschema.validate(scene, schema())
