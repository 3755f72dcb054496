"""Fluids in named cracks and in what is connected with them, held against the crack solver alone."""

import numpy as np
import pytest

import geomech
from geomech import ddm
from geomech.model import Cracks, EndlessRock, Fluid, History, Material
from geomech.scene import SceneError, load_scene

SCENE = """title = "a fracture beside a fault"
[[geometry.zones]]
name = "rock"
polygon = [[-5, -5], [5, -5], [5, 5], [-5, 5]]
holes = [[[-3.5, -0.5], [-2.5, -0.5], [-2.5, 0.5], [-3.5, 0.5]]]
[[geometry.cracks]]
name = "fracture"
points = [[-1, 0], [1, 0]]
[[geometry.cracks]]
name = "fault"
points = [[1.6, -1], [1.6, 1]]
[[geometry.cracks]]
name = "notch"
points = [[-3, 0.5], [-3, 1.5]]
[zones.rock]
body = "plane"
[materials.rock]
youngs_modulus_pa = 20e9
poissons_ratio = 0.25
density_kg_m3 = 2600
k_ic_pa_sqrt_m = 1e6
[cracks.default]
aperture = "slot"
[[loads.fluids]]
rate_pa_per_s = 1e5
[growth]
increment_m = 0.2
[run]
end_time_s = 40
stepping = "events"
control = "toughness"
stop_at = ["coalescence"]
"""


@pytest.fixture
def scene(tmp_path):
    def load(fluid: str = "", *overrides: str):
        path = tmp_path / "fluids.toml"
        path.write_text(SCENE.replace("rate_pa_per_s = 1e5", f"rate_pa_per_s = 1e5\n{fluid}"))
        return load_scene(path, overrides)

    return load


def test_a_fluid_in_one_crack_leaves_the_others_alone(scene):
    loaded = scene('cracks = ["frac*"]')
    assert not any("unconnected cracks" in fault.message for fault in loaded.warnings)
    first = next(cycle for cycle in geomech.cycles(loaded) if len(cycle.tips) and cycle.tips["k_eq"].max() > 0)
    pressure = 1e5 * first.state.time
    cracks = first.cracks
    outline = [np.array([[-3.5, -0.5], [-2.5, -0.5], [-2.5, 0.5], [-3.5, 0.5]])[::-1]]
    body = ddm.Body(loops=[], cracks=cracks, material=Material("rock", 20e9, 0.25, 2600), holes=outline)
    alone = body.solve(ddm.BodyLoad(crack_pressure=pressure * np.array([1.0, 0.0, 0.0])))
    for tip in alone.tips:
        (same,) = first.tips[(first.tips["node"] == tip["node"])]
        assert [same["k_i"], same["k_ii"]] == pytest.approx([tip["k_i"], tip["k_ii"]], abs=2e-3 * 1e6)
    # The fracture opens as one alone in the plane would, but for its neighbours; the fault is only sheared and bent.
    own = first.tips[first.tips["crack"] == 0]
    assert own["k_i"] == pytest.approx(pressure * np.sqrt(np.pi), rel=0.25)
    assert first.load == pytest.approx(pressure)


def test_the_fluid_goes_on_into_the_fault_that_the_fracture_meets(scene):
    *_, last = geomech.cycles(scene('cracks = ["fracture"]'))
    assert any(event.kind == "coalescence" for event in last.events)
    fluid = Fluid(History.constant([1.0]), names=("fracture",), connected=True)
    rock, dry = EndlessRock(fluids=(fluid,)), EndlessRock(fluids=(Fluid(History.constant([1.0]), names=("fracture",)),))
    name = np.array(last.cracks.names, dtype=object)[last.cracks.crack]
    pressure = rock.crack_pressure_at(0.0, last.cracks, [])
    assert (pressure == (name != "notch")).all()
    assert (dry.crack_pressure_at(0.0, last.cracks, []) == (name == "fracture")).all()


def test_fluids_add_up_and_come_out_of_holes():
    hole = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]])
    cracks = Cracks.from_polylines(
        [np.array([[1.0, 0], [2, 0]]), np.array([[3.0, 0], [4, 0]]), np.array([[2.0, 0], [2, 1]])],
        surface=[(True, False), (False, False), (False, False)], names=("a", "b", "c"), join=True,
    )  # fmt: skip
    one = History.constant([1.0])
    for fluids, expected, holes in (
        ([Fluid(one)], 1.0, 0.0),
        ([Fluid(one, False, True)], 0.0, 1.0),
        ([Fluid(one, False, True, connected=True)], [1.0, 0.0, 1.0], 1.0),
        ([Fluid(one, names=("b",))], [0.0, 1.0, 0.0], 0.0),
        ([Fluid(one, names=("c",), connected=True), Fluid(one)], [2.0, 1.0, 2.0], 0.0),
    ):
        rock = EndlessRock(fluids=tuple(fluids))
        found = rock.crack_pressure_at(0.0, cracks, [hole])
        assert np.broadcast_to(found, 3).tolist() == np.broadcast_to(expected, 3).tolist()
        assert rock.hole_pressure_at(0.0) == holes


def test_cracks_that_nothing_connects_are_told_and_strangers_refused(scene):
    (warning,) = [fault for fault in scene().warnings if "unconnected cracks" in fault.message]
    assert "3 unconnected cracks" in warning.message and "'fracture', 'fault', 'notch'" in warning.message
    with pytest.raises(SceneError, match="there is no crack 'fracure'"):
        scene('cracks = ["fracure"]')
    with pytest.raises(SceneError, match='`fills` has to hold "cracks"'):
        scene('cracks = ["fracture"]\nfills = ["holes"]')
