"""The energy balance of a tunnel driven in two stages through jointed rock with cracks, bolted in between: what is
excavated takes along what it and its cracks store, and nothing is left over."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest

import geomech
from geomech.scene import load_scene

TUNNEL = """
[geometry]
seed = 3
dead_ends = "trim"
smallest_block_m2 = 0.3

[[geometry.zones]]
name = "rock"
polygon = [[0, 0], [20, 0], [20, 16], [0, 16]]
holes = [[[7.5, 5], [12.5, 5], [12.5, 10], [7.5, 10]]]
[[geometry.zones]]
name = "heading"
polygon = [[7.5, 7.5], [12.5, 7.5], [12.5, 10], [7.5, 10]]
[[geometry.zones]]
name = "bench"
polygon = [[7.5, 5], [12.5, 5], [12.5, 7.5], [7.5, 7.5]]
[[geometry.zones]]
name = "frame"
polygon = [[-1, -1], [21, -1], [21, 16], [20, 16], [20, 0], [0, 0], [0, 16], [-1, 16]]

[[geometry.joint_sets]]
name = "left"
angle_deg = 65
spacing_m = 3.1
zones = ["rock"]
[[geometry.joint_sets]]
name = "flat"
angle_deg = 4
spacing_m = 2.7
zones = ["rock"]

[[geometry.cracks]]
name = "crown"
points = [[8.6, 11.0], [10.4, 11.4]]
[[geometry.cracks]]
name = "wall"
points = [[6.2, 6.4], [6.9, 8.0]]
[[geometry.cracks]]
name = "right"
points = [[13.2, 6.2], [13.9, 8.2]]
[[geometry.cracks]]
name = "inside"             # of rock that is excavated
points = [[9.0, 8.4], [11.0, 9.0]]

FACES
[materials.rock]
youngs_modulus_pa = 10e9
poissons_ratio = 0.25
density_kg_m3 = 2600
k_ic_pa_sqrt_m = 0.5e6

[zones.frame]
fixed = true

[joints.default]
friction_angle_deg = 35

[loads]
gravity_m_s2 = [0, -9.81]
[[loads.excavations]]
time_s = 0.006
zones = ["heading"]
[[loads.excavations]]
time_s = 0.02
zones = ["bench"]
[[loads.bolts]]
name = "roof 1"
start = [9, 9.9]
end = [8.5, 13.5]
axial_stiffness_n = 65e6
active_length_m = 0.5
pretension_n_per_m = 50e3
start_s = 0.014
[[loads.bolts]]
name = "roof 2"
start = [11, 9.9]
end = [11.5, 13.5]
axial_stiffness_n = 65e6
active_length_m = 0.5
pretension_n_per_m = 50e3
start_s = 0.014
IN_SITU
[dda]
dynamic_factor = FACTOR
time_step_s = 0.002
equilibrium = "START"

[growth]
enabled = GROWTH
increment_m = 0.1

[run]
end_time_s = 0.032
stop_at = []
"""
ROUGH = """
[cracks.default]
joint = "faces"
[joints.faces]
friction_angle_deg = 30
"""
#: 200 m below the surface: the rock stores 170 kJ/m, gravity and bolts do less than 1 kJ/m.
DEEP = """
[loads.in_situ]
surface_m = 216
unit_weight_n_per_m3 = 25506
k0 = 0.8
"""


class Step(NamedTuple):
    """What is looked at of a cycle: its statistics and events, and of the cracked block `heading` the energy of its
    cracks (None: it has no body) and their mean strain."""

    statistics: dict
    events: set
    energy: float | None
    strain: np.ndarray


def steps(tmp_path, *, factor=0.0, deep=True, faces="", growth=False, equilibrium="") -> list[Step]:
    text = TUNNEL.replace("FACTOR", str(factor)).replace("IN_SITU", DEEP if deep else "").replace("FACES", faces)
    text = text.replace("START", equilibrium or ("" if deep else "start")).replace(
        "GROWTH", "true" if growth else "false"
    )
    (tmp_path / "tunnel.toml").write_text(text)
    out = []
    for cycle in geomech.cycles(load_scene(tmp_path / "tunnel.toml")):
        if not cycle.statistics:
            continue
        heading = cycle.blocks.names.index("heading")
        body = cycle.inside.get(heading)
        kinds = {event.kind for event in cycle.events}
        energy = None if body is None else body.crack_energy
        out.append(Step(dict(cycle.statistics), kinds, energy, cycle.state.crack_strain[heading].copy()))
    return out


def excavations(found: list[Step]) -> list[tuple[Step, Step]]:
    """(the step before, the first one without the rock) of both stages."""
    return [(before, after) for before, after in pairwise(found) if "excavation" in after.events]


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize(
    ("factor", "deep", "faces", "within"),
    [
        (0.0, True, "", 5e-5),
        pytest.param(1.0, True, "", 1e-4, marks=pytest.mark.slow),
        (1.0, True, ROUGH, 4e-4),
        pytest.param(0.0, False, "", 2e-6, marks=pytest.mark.slow),
        pytest.param(0.0, False, ROUGH, 2e-6, marks=pytest.mark.slow),
    ],
)
def test_the_balance_closes_in_every_step(tmp_path, factor, deep, faces, within):
    """Relative to all energy converted. In the step of an excavation 1e-4 was left, of a stress that the crack of the
    heading kept, and with rough faces up to 3e-3; and what other cracks took up there counted as parting of blocks (2 %
    of all energy). In motion there remains the work of the mean stress in steps in which faces open, close or begin to
    slip: 3e-4, 9e-5 and 8e-5 with rough faces in steps of dt, dt/2 and dt/4."""
    found = steps(tmp_path, factor=factor, deep=deep, faces=faces)
    stages = excavations(found)
    assert len(stages) == 2
    assert max(abs(step.statistics["budget_residual"]) for step in found) < within
    for before, after in stages:
        one, other = before.statistics, after.statistics
        # What was stored has gone with the rock, cracks and contacts, and is no residual.
        assert other["split_energy"] < one["split_energy"] - (1e3 if deep else 1.0)
        assert abs(other["budget_residual"] - one["budget_residual"]) < 1e-6
        # Nothing has been cut: no other account takes up what is left.
        assert other["parting_energy"] == one["parting_energy"]
        assert other["set_free_energy"] == one["set_free_energy"] == 0.0
    assert abs(found[-1].statistics["load_work"]) > 0.0


@pytest.mark.parametrize("deep", [pytest.param(True, marks=pytest.mark.slow), False])
def test_the_balance_has_the_work_of_the_steps_to_equilibrium(tmp_path, deep):
    """Where every load finds its equilibrium: these steps do all the work. (Of a slope with cracks 84 % of all energy
    was not accounted for, and of one without, the work was zero.)"""
    found = steps(tmp_path, deep=deep, faces=ROUGH, equilibrium="loads")
    assert len(excavations(found)) == 2
    assert max(abs(step.statistics["budget_residual"]) for step in found) < 5e-5
    last = found[-1].statistics
    assert abs(last["gravity_work"]) > 10.0 and last["friction_loss"] > 0.1 and last["split_energy"] < 0.0
    assert last["parting_energy"] == found[0].statistics["parting_energy"] and last["set_free_energy"] == 0.0


def test_cracks_of_excavated_rock_take_along_what_they_store(tmp_path):
    """As much as the block's own solution says in the last step before the excavation; none is left afterwards."""
    (before, after), (_, last) = excavations(steps(tmp_path, deep=False))
    gone = after.statistics["excavated_crack_energy"]
    assert before.statistics["excavated_crack_energy"] == 0.0 and before.energy is not None
    assert gone == pytest.approx(before.energy, rel=1e-9) and gone > 0.0
    assert last.statistics["excavated_crack_energy"] == gone
    assert after.energy is None and np.any(before.strain) and not np.any(after.strain)


def test_the_balance_closes_where_cracks_grow_and_blocks_split(tmp_path):
    """In motion: growth, splits and both excavations. (4e-5 at half the step.)"""
    found = steps(tmp_path, factor=1.0, deep=False, growth=True)
    assert set().union(*(step.events for step in found)) >= {"excavation", "initiation", "split"}
    assert max(abs(step.statistics["budget_residual"]) for step in found) < 3e-4
