"""Scenes of the infinite plane and of a half-plane, held against closed forms, dislocations and the crack solver alone."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import geomech
from geomech import ddm
from geomech.model import Cracks, GrowthSettings
from geomech.output import SceneCopy
from geomech.reference.cracks.crack_arrays import near_surface
from geomech.reference.cracks.fracture import slanted
from geomech.scene import SceneError, load_scene

ROCK = """
[materials.rock]
youngs_modulus_pa = 20e9
poissons_ratio = 0.25
density_kg_m3 = 2600
k_ic_pa_sqrt_m = 1e6
"""
PLANE = """
[[geometry.zones]]
name = "rock"
rectangle = [-5.0, -5.0, 5.0, 5.0]

[[geometry.cracks]]
name = "crack"
centre = [0.0, 0.0]
length_m = 2.0
angle_deg = 30

[zones.rock]
body = "plane"

[cracks.default]
aperture = "slot"

[[loads.remote]]
value_pa = [-2e5, 0.0, 0.0]
[[loads.remote]]
rate_pa_per_s = [0.0, 1e4, 3e3]

[growth]
increment_m = 0.1

[run]
end_time_s = 200
stepping = "events"
control = "toughness"
stop_at = []
""" + ROCK  # fmt: skip
BELOW_SURFACE = """
[[geometry.zones]]
name = "rock"
rectangle = [-5.0, -5.0, 5.0, 0.0]

[[geometry.edges]]
name = "top"
line = [[-5.0, 0.0], [5.0, 0.0]]

[[geometry.cracks]]
name = "crack"
points = [[-1.0, -0.5], [1.0, -0.5]]

[zones.rock]
body = "half-plane"
surface = "top"

[cracks.default]
aperture = "slot"

[[loads.fluids]]
rate_pa_per_s = 1e5

[growth]
increment_m = 0.25

[run]
end_time_s = 10
""" + ROCK  # fmt: skip


@pytest.fixture
def scene(tmp_path):
    def load(text: str, *overrides: str):
        path = tmp_path / "endless.toml"
        path.write_text(text, encoding="utf-8")
        return load_scene(path, overrides)

    return load


@pytest.fixture
def faults(scene):
    def collect(text: str, *changes: tuple[str, str]) -> list[tuple[str, str]]:
        for old, new in changes:
            assert text.count(old) == 1, old
            text = text.replace(old, new)
        with pytest.raises(SceneError) as caught:
            scene(text)
        return [(fault.place.rpartition("endless.toml:")[2], fault.message) for fault in caught.value.errors]

    return collect


def test_the_first_load_in_the_plane_is_the_closed_forms(scene):
    """K of a straight crack in the plane is exact with one element; the load at which it starts is the criterion's."""
    cycles = geomech.cycles(scene(PLANE, "ddm.elements_per_crack=1", "growth.correct=false"))
    first = next(cycle for cycle in cycles if any(event.kind == "initiation" for event in cycle.events))
    time = first.state.time
    stress = np.array([-2e5, 1e4 * time, 3e3 * time])
    k = slanted(stress, math.radians(30), 1.0)
    for tip in first.tips:
        np.testing.assert_allclose([tip["k_i"], tip["k_ii"]], k, rtol=1e-9)
    assert first.tips["k_eq"] == pytest.approx(1e6, rel=1e-6)
    # Erdogan & Sih (1963): K_I sin θ + K_II (3 cos θ − 1) = 0, K_eq = cos²(θ/2) (K_I cos(θ/2) − 3 K_II sin(θ/2)).
    angle = first.tips["angle"][0]
    assert k[0] * math.sin(angle) + k[1] * (3 * math.cos(angle) - 1) == pytest.approx(0, abs=1e-6 * k[0])
    half = 0.5 * angle
    assert math.cos(half) ** 2 * (k[0] * math.cos(half) - 3 * k[1] * math.sin(half)) == pytest.approx(1e6, rel=1e-6)
    # What leads is what rises; the window is strained as the rock far away.
    assert first.load == pytest.approx(-(5e3 * time + math.hypot(5e3 * time, 3e3 * time)))
    np.testing.assert_allclose(first.state.stress[0], stress)


def test_paths_and_loads_are_those_of_the_crack_solver_alone(scene):
    problem = scene(PLANE).problem()
    found = [cycle for cycle, _ in zip(geomech.cycles(scene(PLANE)), range(8))][-1]

    def load(time: float, cracks: Cracks) -> ddm.BodyLoad:
        return ddm.BodyLoad(remote_stress=np.array([-2e5, 1e4 * time, 3e3 * time]))

    growth = GrowthSettings(increment=0.1, min_increment=0.01)
    alone = ddm.propagate([], problem.cracks, problem.materials[0], load, growth, control="toughness", max_steps=20)
    step = next(step for step in alone if step.cracks.n_segments == found.cracks.n_segments)
    assert found.cracks.n_segments > 6
    np.testing.assert_allclose(found.cracks.nodes, step.cracks.nodes, atol=1e-6)
    assert found.state.time == pytest.approx(step.load_factor, rel=1e-5)


def test_a_crack_below_a_free_surface(scene):
    """K by dislocations in the half-plane, and the way up to the surface, where the run ends: both tips cut a slab off."""
    cycles = list(geomech.cycles(scene(BELOW_SURFACE)))
    tip = cycles[1].tips[1]
    k = near_surface(np.array([[-1.0, -0.5], [1.0, -0.5]]), 1.0, 65)[1]
    np.testing.assert_allclose([tip["k_i"], tip["k_ii"]], 1e5 * k, rtol=1e-4)
    assert cycles[1].load == 1e5
    kinds = [event.kind for cycle in cycles for event in cycle.events]
    assert kinds.count("daylighting") == 2
    assert kinds[-1] == "split" and len(cycles[-1].tips) == 0
    mouths = cycles[-1].cracks.nodes[cycles[-1].cracks.surface]
    np.testing.assert_allclose(mouths[:, 1], 0.0, atol=1e-12)
    np.testing.assert_allclose(mouths[0, 0], -mouths[1, 0], rtol=1e-6)


def test_a_pressurised_hole(scene):
    """Lamé's stress about a circle, for which a polygon of 64 sides stands; without a crack."""
    angle = 2 * math.pi * (np.arange(64) + 0.5) / 64
    hole = (0.5 / math.sqrt(math.cos(math.pi / 64)) * np.column_stack([np.cos(angle), np.sin(angle)])).tolist()
    text = PLANE.replace("[[geometry.cracks]]", f"holes = [{hole}]\n[[geometry.cracks]]")
    text = text.replace("centre = [0.0, 0.0]", "centre = [4.0, 4.0]").replace("length_m = 2.0", "length_m = 1e-3")
    text = text.replace("value_pa = [-2e5, 0.0, 0.0]", "value_pa = [0.0, 0.0, 0.0]")
    text = text.replace(
        "[[loads.remote]]\nrate_pa_per_s = [0.0, 1e4, 3e3]", '[[loads.fluids]]\nvalue_pa = 1e5\nfills = ["holes"]'
    )
    text = text.replace('stepping = "events"\ncontrol = "toughness"\n', "")
    cycle = [cycle for cycle, _ in zip(geomech.cycles(scene(text)), range(2))][-1]
    stress = cycle.bodies[0].stress(np.array([[1.0, 0.0], [0.0, 2.0]]))
    lame = 1e5 * np.array([[-0.25, 0.25, 0], [0.0625, -0.0625, 0]])
    np.testing.assert_allclose(stress, lame, atol=1e-3 * 1e5)


def test_a_crack_that_leaves_the_window_ends_the_run(scene, tmp_path):
    given = scene(PLANE, "geometry.zones.0.rectangle=[-1.2, -1.2, 1.2, 1.2]")
    summary = geomech.run(given, tmp_path / "run", [SceneCopy(given.resolved())])
    assert summary["end"] == "out of sight"
    again = load_scene(tmp_path / "run" / "scene.toml").problem().endless
    np.testing.assert_array_equal(again.stress_at(3.0), [-2e5, 3e4, 9e3])


def test_what_blocks_bear_is_refused_with_its_place(faults):
    shown = faults(PLANE, ("[growth]", "[loads]\ngravity_m_s2 = [0.0, -9.81]\n[dda]\ndynamic_factor = 1\n[growth]"),
                   ("[[loads.remote]]\nvalue_pa = [-2e5, 0.0, 0.0]\n", ""), ("[[loads.remote]]\nrate_pa_per_s = [0.0, 1e4, 3e3]\n", ""),
                   ('stepping = "events"\ncontrol = "toughness"\n', ""))  # fmt: skip
    places = [place.split(": ")[1] for place, _ in shown]
    assert places == ["loads.gravity_m_s2", "dda.dynamic_factor"]
    block = faults(PLANE, ('body = "plane"', ""))
    assert [place.split(": ")[1] for place, _ in block] == ["loads.remote[0]"]


@pytest.mark.parametrize(
    ("change", "place", "said"),
    [
        (('surface = "top"', ""), "zones.rock", "needs `surface`"),
        (('surface = "top"', 'surface = "tops"'), "zones.rock.surface", "no edge 'tops'"),
        (("line = [[-5.0, 0.0], [5.0, 0.0]]", "line = [[-5.0, -5.0], [-5.0, 0.0]]"), None, ""),
        (("[growth]", "[[loads.remote]]\nvalue_pa = [1e5, 2e5, 0.0]\n[growth]"), "loads.remote[0].value_pa", "(0, 200000) Pa"),
        (("[-1.0, -0.5]", "[-5.0, -0.5]"), "geometry.cracks[0]", "on the outline of zone 'rock'"),
        (("rate_pa_per_s = 1e5", "rate_pa_per_s = 1e5\nvalue_pa = 1e5"), "loads.fluids[0]", "exactly one of"),
    ],
)  # fmt: skip
def test_errors_of_a_half_plane_name_their_place(scene, faults, change, place, said):
    if place is None:
        # A wall is a free surface like any other.
        assert scene(BELOW_SURFACE.replace(*change)).problem().endless.surface == ((-5.0, 0.0), (-1.0, 0.0))
        return
    ((where, message),) = faults(BELOW_SURFACE, change)
    assert f" {place}" in f" {where}" and said in message, (where, message)


@pytest.mark.parametrize(("name", "surface"), [("inclined_crack", None), ("crack_below_surface", (0.0, 1.0))])
def test_examples_have_nothing_to_be_warned_of(name, surface):
    loaded = load_scene(Path(__file__).parents[2] / "geometry" / f"{name}.toml")
    endless = loaded.problem().endless
    assert not loaded.warnings and (endless.surface and endless.surface[1]) == surface
    # What leads is what rises.
    assert endless.load_at(0.0) == 0.0 and endless.load_at(2.0) == pytest.approx(2 * endless.load_at(1.0))


def test_an_edge_that_is_no_surface(faults):
    notched = BELOW_SURFACE.replace(
        "rectangle = [-5.0, -5.0, 5.0, 0.0]", "polygon = [[-5, -5], [5, -5], [5, 1], [4, 0], [-5, 0]]"
    ).replace("line = [[-5.0, 0.0], [5.0, 0.0]]", "line = [[-5.0, 0.0], [4.0, 0.0]]")
    ((place, message),) = faults(notched)
    assert "zones.rock.surface" in place and "do not form a straight line" in message
