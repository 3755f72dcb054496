"""Errors of a sweep are reported before anything runs, with their place and remedy."""

from __future__ import annotations

import pytest

from geomech.scene import SceneError, load_scene
from geomech.sweep.plan import plan_of, read_plan, seeds_of

FRICTION, COHESION = "joints.default.friction_angle_deg", "joints.default.cohesion_pa"


def refused(scene, given, **how) -> str:
    with pytest.raises(SceneError) as error:
        plan_of(scene, given, source="--", **how)
    return str(error.value)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"vary": {"joints.beds.friction_angle_deg": "20:40:5"}}, "the scene has no 'joints.beds'"),
        ({"vary": {"joints.default.friction_angel_deg": "20:40:5"}}, "did you mean 'friction_angle_deg'?"),
        ({"vary": {"geometry.zones.blok.polygon.1.0": "9,10"}}, "did you mean 'block'?"),
        ({"vary": {"geometry.zones.7.polygon.1.0": "9,10"}}, "has 2 items"),
        ({"vary": {FRICTION: "40:20:5"}}, f"--vary {FRICTION}\n    the range 40:20:5 is empty"),
        ({"vary": {FRICTION: "80:100:5"}}, "100 is out of range"),
        ({"vary": {FRICTION: "steep, flat"}}, '"steep" given, expected number'),
        ({"vary": {COHESION: "normal(1e5, 5e4)"}, "runs": 9},
         "outside 0 to inf, the permitted range of the key, with probability 0.023"),
        ({"vary": {COHESION: "uniform(-1, 1)"}, "runs": 9}, "set its bounds within"),
        ({"vary": {FRICTION: "normal(35, 5)"}}, "random variables without a number of samples"),
        ({"vary": {FRICTION: "normal(35, 5)"}, "runs": 20_000}, "--limit 20000"),
        ({"vary": {FRICTION: "20:40:5"}, "runs": 4}, "nothing random varies"),
        ({"vary": {"geometry.seed": "normal(3, 1)"}, "runs": 4}, "whole numbers"),
        ({"vary": {"dda.contact": ["penalty", "augmentd"]}}, "augmentd"),
        ({"vary": {"x": "normal(0, 1)"}, "runs": 4}, "'x' sets nothing"),
        ({"vary": {"x": "1,2"}, "derive": {COHESION: "y * 2"}}, "there is no variable 'y'"),
        ({"vary": {"x": "1,2"}, "derive": {COHESION: "open('f')"}}, "calls open"),
        ({"vary": {FRICTION: "20,30"}, "derive": {FRICTION: "3"}}, "is both varied and derived"),
        ({"seeds": "0-9"}, "the scene has no joint sets"),
        ({"vary": {FRICTION: "normal(35, 5)"}, "runs": 9, "correlated": [{"between": [FRICTION, COHESION],
         "coefficient": 0.5}]},
         "is not a random variable"),
        ({"vary": {FRICTION: "normal(35, 5)"}, "runs": 2, "sampling": "saltelli"}, "needs groups of 3 runs"),
        ({"vary": {FRICTION: "30,35"}, "rare": "subset"}, "random variables only"),
        ({"vary": {FRICTION: "normal(35, 5)"}, "runs": 9, "rare": "subset", "fails": "mechanism == 'x'"},
         "not a comparison"),
        ({"fails": "factor <"}, "is not a valid expression"),
        ({"columns": {"x": "a.b()"}}, "calls a.b"),
        ({"runs": "many"}, "--runs"),
        ({"nonsense": 1}, "unknown key 'nonsense'"),
        ({"vary": {FRICTION: "30,35"}, "measure": "stability"}, "--measure"),
    ],
)  # fmt: skip
def test_refused(plane, given, said):
    assert said in refused(plane, given)


def test_all_that_is_wrong_is_said_at_once(plane):
    said = refused(plane, {"vary": {FRICTION: "40:20:5", "joints.defalt.cohesion_pa": "1,2"}})
    assert "is empty" in said and "joints.defalt" in said


def test_seeds_without_networks_of_their_own_number_are_refused(plane):
    text = plane.read_text(encoding="utf-8")
    sets = '[[geometry.joint_sets]]\nname = "x"\nangle_deg = 60\nspacing_m = 3\nzones = ["block"]\n'
    plane.write_text(text.replace("[materials.rock]", f"{sets}[materials.rock]"), encoding="utf-8")
    assert len(plan_of(plane, {"seeds": "0-3"}).table) == 4
    assert "5 samples for 4 seeds" in refused(plane, {"seeds": "0-3", "runs": 5, "vary": {FRICTION: "normal(35, 5)"}})
    assert "ascending" in refused(plane, {"seeds": "4-1"})


def test_a_scene_that_cannot_be_drawn_with_any_value_is_refused_as_it_would_be_alone(plane):
    # Blocks that overlap.
    with pytest.raises(SceneError) as error:
        plan_of(plane, {"vary": {"geometry.zones.block.polygon.3.1": "-2,-2.5"}})
    with pytest.raises(SceneError) as alone:
        load_scene(plane, ["geometry.zones.1.polygon.3.1=-2"])
    assert str(error.value) == str(alone.value)


def test_where_settings_stand(plane):
    """The command line before sweep.toml before the scene, name by name of what varies; places are told."""
    text = plane.read_text(encoding="utf-8")
    plane.write_text(f'{text}\n[sweep]\nseed = 1\nruns = 3\nvary.{FRICTION} = "uniform(20, 30)"\n', encoding="utf-8")
    assert plan_of(plane).settings["seed"] == 1
    beside = plane.with_name("sweep.toml")
    beside.write_text(f'seed = 2\n[vary]\n"{COHESION}" = "uniform(0, 1e4)"\n', encoding="utf-8")
    found = plan_of(plane, {"runs": 5})
    assert (found.settings["seed"], len(found.table)) == (2, 5)
    assert [each.name for each in found.variables] == [FRICTION, COHESION]
    beside.write_text(f'seed = 2\n[vary]\n{COHESION} = "uniform(3, 1)"\n', encoding="utf-8")
    assert f"sweep.toml:3: vary.{COHESION}" in refused(plane, {})
    beside.write_text("seed = [", encoding="utf-8")
    assert "cannot be read" in refused(plane, {})


def test_the_scene_of_a_run_is_the_one_of_its_changes(plane):
    found = plan_of(
        plane, {"vary": {"tangent": "normal(0.6, 0.05)"}, "runs": 3, "derive": {FRICTION: "degrees(atan(tangent))"}},
        overrides=["materials.rock.density_kg_m3=2000"],
    )  # fmt: skip
    row = found.table[1]
    law = next(law for law in load_scene(plane, found.changes(row)).problem().joints if law.name == "default")
    assert law.friction == pytest.approx(row["tangent"], rel=1e-14)
    assert found.how_to_repeat(row).startswith(
        f"geomech safety {plane} --set materials.rock.density_kg_m3=2000 --set {FRICTION}="
    )
    assert read_plan(found.as_dict()).table == found.table


def test_a_sweep_is_no_part_of_a_run(plane):
    text = plane.read_text(encoding="utf-8")
    plane.write_text(f"{text}\n[sweep]\nruns = 3\n", encoding="utf-8")
    assert "sweep" not in load_scene(plane).resolved()


def test_seeds():
    assert seeds_of("0-2, 7") == (0, 1, 2, 7) and seeds_of([4, 3]) == (4, 3) and seeds_of(None) == ()
    for wrong in ("", "a", "3-1", "1,1", [-1], []):
        with pytest.raises(ValueError):
            seeds_of(wrong)
