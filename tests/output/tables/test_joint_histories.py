"""Joint and support tables of a run, and the words for its state of motion."""

from __future__ import annotations

import csv
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import synthetic_run as made

from geomech.output import JointHistories, standard_observers
from geomech.output.fields import JOINTS, REACTIONS
from geomech.output.tables.motion_state import closing, condition, state_text


def rows_of(path) -> list[dict]:
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_every_cycle_leaves_a_row_a_joint_and_a_support(tmp_path):
    made.write(tmp_path, [JointHistories()])
    joints, supports = rows_of(tmp_path / "joints.csv"), rows_of(tmp_path / "reactions.csv")
    assert list(joints[0]) == list(JOINTS) and list(supports[0]) == list(REACTIONS)
    cycles = made.cycles()
    assert {int(row["cycle"]) for row in joints} == {c.number for c in cycles}
    last = cycles[-1].state.contacts
    of_last = [row for row in joints if int(row["cycle"]) == cycles[-1].number]
    assert sum(float(row["normal_force"]) for row in of_last) == pytest.approx(last["normal_force"].sum(), rel=1e-12)


def test_condition_is_read_from_the_unbalanced_force_and_the_contacts():
    cycle = made.cycle(1, 1, 0, 0)
    cycle = replace(cycle, blocks=replace(cycle.blocks, fixed=np.array([True, False, True])))
    assert condition(cycle) == "" and state_text(cycle) == "starting"

    def at(ratio: float):
        return replace(cycle, statistics={"unbalanced_ratio": ratio, "kinetic_energy": 12.0, "step_cuts": 3})

    # Balanced, but with more energy in motion than in springs: it slides steadily.
    assert condition(at(1e-6)) == "sliding"
    stored = replace(cycle, statistics={"unbalanced_ratio": 1e-6, "kinetic_energy": 1e-9, "elastic_energy": 1.0})
    assert condition(stored) == "at rest"
    assert condition(at(0.2)) == "sliding"
    assert (
        state_text(at(0.2)) == "sliding, unbalanced 2.0e-01, kinetic energy 12 J/m, 1 contacts slide, step cut 3 times"
    )
    contacts = cycle.state.contacts.copy()
    contacts["state"] = 0
    flying = replace(at(1.0), state=replace(cycle.state, contacts=contacts))
    assert condition(flying) == "moving"


def test_closing_lines_name_what_moved():
    summary = {
        "motion": {"condition": "sliding", "unbalanced_ratio": 0.1, "kinetic_energy": 5.0},
        "key_blocks": [
            {
                "block": "wedge",
                "displacement_m": 0.2,
                "class": "key block, slides",
                "direction_deg": -40.0,
                "factor_of_safety": 0.9,
            }
        ],
    }  # fmt: skip
    lines = closing(summary)
    assert lines[0].startswith("  sliding: unbalanced force 1.0e-01")
    assert lines[1] == "  wedge         moved 0.2 m, key block, slides towards -40°, factor 0.90"
    assert closing({}) == []


@pytest.mark.parametrize(
    ("joints", "cracks", "written"), [(None, 0, True), (None, 1, False), (True, 1, True), (False, 0, False)]
)
def test_scenes_with_cracks_write_joints_when_asked(joints, cracks, written):
    scene = SimpleNamespace(
        output=SimpleNamespace(joints=joints), cracks=SimpleNamespace(n_cracks=cracks), resolved=dict
    )
    watchers = standard_observers(scene, quiet=True)
    assert any(isinstance(watcher, JointHistories) for watcher in watchers) == written
