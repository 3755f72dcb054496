"""What a run says that it has not done: counted against what it did, and absent where nothing was left out."""

from __future__ import annotations

import pytest

from geomech import run
from geomech.output import standard_observers
from geomech.scene import load_scene

ROCK = """
[materials.rock]
youngs_modulus_pa = 10e9
poissons_ratio = 0.2
density_kg_m3 = 2600
k_ic_pa_sqrt_m = 1e9
[joints.default]
friction_angle_deg = 40.0
"""
#: Two bricks on a fixed base, which come to rest at once.
PILE = (
    """
title = "A pile"
[geometry]
zones = [
    { name = "base", rectangle = [-1.0, -1.0, 3.0, 0.0] },
    { name = "one", rectangle = [0.0, 0.0, 2.0, 1.0] },
    { name = "two", rectangle = [0.0, 1.0, 2.0, 2.0] },
]
[zones.base]
fixed = true
[loads]
gravity_m_s2 = [0.0, -9.81]
[dda]
time_step_s = 0.01
[run]
end_time_s = 0.095
"""
    + ROCK
)
#: A plate with a crack, in tension.
PLATE = (
    """
title = "A plate"
[geometry]
zones = [{ name = "rock", rectangle = [-0.1, -0.1, 0.1, 0.1] }]
cracks = [{ name = "flaw", centre = [0.0, 0.0], length_m = 0.02, angle_deg = 0.0 }]
edges = [
    { name = "load:top", line = [[-0.1, 0.1], [0.1, 0.1]] },
    { name = "load:bottom", line = [[-0.1, -0.1], [0.1, -0.1]] },
]
[loads]
[[loads.tractions]]
edge = "load:top"
rate_pa_per_s = [0.0, 1e5]
[[loads.tractions]]
edge = "load:bottom"
rate_pa_per_s = [0.0, -1e5]
[dda]
time_step_s = 1.0
[run]
end_time_s = 5.5
"""
    + ROCK
)


def ran(tmp_path, text: str, *wishes: str) -> dict:
    """The summary of a run of the scene ``text``."""
    path = tmp_path / "scene.toml"
    path.write_text(text)
    scene = load_scene(path, wishes)
    return run(scene, tmp_path / "run", standard_observers(scene, quiet=True))


def test_blocks_alone_tell_of_the_crack_solver_and_of_pairs_not_sought(tmp_path):
    summary = ran(tmp_path, PILE)
    skipped = summary["skipped"]
    assert skipped["crack solver"]["count"] == summary["cycles"] > 5
    # Every step looks for contacts at least once, and nothing has moved by more than some micrometres.
    assert skipped["pair searches"]["count"] >= summary["load_steps"] - 1
    assert not {"bodies", "solutions", "compliances", "interior fields", "contact searches"} & set(skipped)
    # What else the process has loaded is no matter of the run.
    assert "modules" not in skipped


def test_a_single_cracked_block_tells_of_its_contacts_compliances_and_fields(tmp_path):
    summary = ran(tmp_path, PLATE, "output.interior=false")
    skipped, work = summary["skipped"], summary["crack_solver"]
    assert {"crack solver", "pair searches"}.isdisjoint(skipped)
    assert skipped["contact searches"]["count"] >= summary["load_steps"]
    assert "saved_s" not in skipped["contact searches"]  # none was ever made: what it takes is not known
    assert skipped["compliances"]["count"] == work["compliances_kept"] >= summary["load_steps"] - 1
    assert skipped["interior fields"]["count"] == summary["load_steps"]
    assert all(entry["what"] and entry["count"] > 0 for entry in skipped.values())


def test_a_run_that_does_everything_anew_has_left_nothing_out(tmp_path):
    skipped = ran(tmp_path, PLATE, "run.skip=false", "output.interior=false")["skipped"]
    assert not {"bodies", "solutions", "compliances"} & set(skipped)


def test_what_was_saved_is_the_mean_of_what_was_done_times_what_was_not(tmp_path):
    from geomech.model import Skip
    from geomech.output.tables.skipped_work import skip_summary

    assert skip_summary("bodies", Skip(6, 3, 1.5)) == {**skip_summary("bodies", Skip(6)), "saved_s": pytest.approx(3.0)}
    written = ran(tmp_path, PLATE, "output.interior_every=2", "output.every=2")["skipped"]
    assert written["series"]["count"] == 3 and written["series"]["saved_s"] > 0  # of cycles 0 to 6: 1, 3, 5
