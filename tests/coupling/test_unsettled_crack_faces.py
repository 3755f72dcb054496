"""Runs go on where the contact of crack faces finds no states in one attempt at a step."""

import logging

import pytest
from small_scenes import block

from geomech import ddm
from geomech.coupling import cycles
from geomech.dda import NotConverged
from geomech.ddm.body import Body
from geomech.scene import load_scene


def crossed_by_a_crack(folder, moving: bool, points="[[1.3, 0.4], [1.7, 0.6]]", growth="enabled = false"):
    text = block(moving=moving).replace(
        "[materials.rock]",
        f'cracks = [{{ name = "flaw", points = {points} }}]\n[materials.rock]\nk_ic_pa_sqrt_m = 1e8',
    )
    path = folder / "block.toml"
    path.write_text(text + f"stop_at = []\n[growth]\n{growth}\n", encoding="utf-8")
    return load_scene(path).problem()


def run(problem, monkeypatch, missed: range):
    """The last cycle, with no states in those solutions whose numbers are ``missed``, and the number of solutions."""
    solve, number = Body.solve, 0

    def often(self, *given, **named):
        nonlocal number
        number += 1
        if number - 1 in missed:
            raise ddm.NotConverged("the faces have no states")
        return solve(self, *given, **named)

    with monkeypatch.context() as patch:
        patch.setattr(Body, "solve", often)
        last = list(cycles(problem))[-1]
    return last, number


@pytest.mark.parametrize("moving", [False, True])
def test_the_step_is_repeated_and_told_of_once(tmp_path, monkeypatch, caplog, moving):
    problem = crossed_by_a_crack(tmp_path, moving)
    expected, solved = run(problem, monkeypatch, range(0))
    assert solved >= 4
    with caplog.at_level(logging.WARNING, "geomech"):
        # In statics all three ways of the full load step fail, and then half of the step is taken.
        found, again = run(problem, monkeypatch, range(1 if moving else 3))
        assert again > solved
        run(problem, monkeypatch, range(1))
    told = [line.getMessage() for line in caplog.records if "have states" in line.getMessage()]
    assert len(told) == 2 and all("the faces have no states. The step is repeated" in line for line in told)
    assert found.state.time == pytest.approx(0.03)
    # A static block rests under its weight whatever the steps; in motion half a step is more accurate.
    sinks = expected.state.vertices[-4:, 1] - expected.blocks.vertices[-4:, 1]
    assert found.state.vertices[-4:, 1] - found.blocks.vertices[-4:, 1] == pytest.approx(
        sinks, rel=0.2 if moving else 1e-4
    )


@pytest.mark.parametrize("moving", [False, True])
def test_faces_without_states_in_any_step_end_the_run(tmp_path, monkeypatch, moving):
    with pytest.raises(NotConverged, match="the faces have no states"):
        run(crossed_by_a_crack(tmp_path, moving), monkeypatch, range(10_000))


#: A crack that leaves 6 cm of rock to the side of the block, and one through the block up to there.
WITHIN, THROUGH = "[[1.4, 0.5], [1.94, 0.6]]", "[[1.0, 0.4], [1.94, 0.5]]"


@pytest.mark.parametrize(("moving", "points", "parts"), [(False, WITHIN, 1), (True, WITHIN, 1), (True, THROUGH, 2)])
def test_the_last_ligament_is_cut_where_no_step_has_states(tmp_path, monkeypatch, caplog, moving, points, parts):
    """By an event and a warning; then the run goes on. Blocks that are cut in two become two."""
    problem = crossed_by_a_crack(tmp_path, moving, points, "increment_m = 0.1")
    solve = Body.solve

    def unless_joined(self, *given, **named):
        if (self.cracks.nodes[self.cracks.tips][:, 0] == 1.94).any():
            raise ddm.NotConverged("the faces have no states")
        return solve(self, *given, **named)

    monkeypatch.setattr(Body, "solve", unless_joined)
    with caplog.at_level(logging.WARNING, "geomech"):
        every = list(cycles(problem))
    assert every[-1].state.time == pytest.approx(0.03) and every[-1].blocks.n_blocks == 1 + parts
    events = [event for cycle in every for event in cycle.events]
    assert [event.kind for event in events][:1] == ["daylighting"]
    assert "the last 0.06 m cut through as its faces found no contact states" in events[0].detail
    assert sum("0.06 m of rock ahead of the tip of flaw" in line.getMessage() for line in caplog.records) == 1
    if parts == 1:
        assert every[-1].cracks.nodes[:, 0].max() == pytest.approx(2.0)


def test_a_ligament_longer_than_an_increment_is_not_cut(tmp_path, monkeypatch):
    with pytest.raises(NotConverged, match="the faces have no states"):
        run(crossed_by_a_crack(tmp_path, False, WITHIN, "increment_m = 0.05"), monkeypatch, range(10_000))
