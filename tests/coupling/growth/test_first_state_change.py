"""Contacts and crack faces that change their state: at which load, held against closed forms of statics and
friction."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from geomech.coupling import cycles
from geomech.coupling.growth import first_state_change
from geomech.coupling.growth.event_stepping import EventSteps
from geomech.coupling.growth.first_state_change import FirstChange
from geomech.coupling.monitoring.state_changes import Change, Watched
from geomech.dda import NotConverged
from geomech.dda.contact_detection import neighbour_search
from geomech.model import (
    Blocks,
    Cracks,
    DdaSettings,
    EdgeTraction,
    GrowthSettings,
    History,
    JointLaw,
    Loads,
    Material,
    PointLoad,
    Problem,
    RunSettings,
)

ROCK = Material("rock", 5e9, 0.25, 2600.0)
G = 10.0


def standing(angle_deg, pushes, friction_deg=35.0, sizes=None, height=1.0, at=0.5, **run):
    """Blocks in a row on a plane that dips by ``angle_deg`` to the right, each pushed along it by a force that grows by
    one of ``pushes`` N/s; ``sizes`` are their widths, m, and ``at`` the part of their height at which they are
    pushed."""
    sizes = np.ones(len(pushes)) if sizes is None else np.asarray(sizes)
    a = np.radians(-angle_deg)
    turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    left = 1.0 + np.cumsum(sizes + 1.0) - sizes
    length = left[-1] + sizes[-1] + 2.0
    base = np.array([[0.0, -1.0], [length, -1.0], [length, 0.0], [0.0, 0.0]])
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    polygons = [base] + [square * [w, height] + [x, 0.0] for x, w in zip(left, sizes)]
    loads = tuple(
        PointLoad(k + 1, tuple(turn @ [x, at * height]), History.ramp((turn @ [push, 0.0]).tolist()))
        for k, (x, push) in enumerate(zip(left, pushes))
    )
    return Problem(
        title="standing",
        blocks=Blocks.from_polygons(
            [p @ turn.T for p in polygons], fixed=[True] + [False] * len(pushes),
            names=["base", *(f"block {k + 1}" for k in range(len(pushes)))],
        ),
        cracks=Cracks.from_polylines([]),
        materials=(ROCK,),
        joints=(JointLaw("joint", friction_angle=np.radians(friction_deg)),),
        loads=Loads(gravity=History.constant([0.0, -G]), point_loads=loads),
        dda=DdaSettings(time_step=1.0),
        run=RunSettings(**{"end_time": 100.0, "stepping": "events", "stop_at": ("sliding", "opening")} | run),
    )  # fmt: skip


def told(problem, most=1000):
    """(kind, time, detail) of every event, and the number of cycles."""
    events, number = [], 0
    for cycle in cycles(problem):
        number += 1
        events += [(event.kind, event.time, event.detail) for event in cycle.events]
        if number == most:
            break
    return events, number


@pytest.mark.parametrize("angle", [0.0, 20.0])
def test_a_pushed_block_starts_to_slip_at_its_friction(angle):
    """P = W (cos α tan φ − sin α); the corner that the push lifts slips before."""
    events, number = told(standing(angle, [1000.0], at=0.02))
    a, weight = np.radians(angle), ROCK.density * G
    _, time, detail = events[-1]
    assert [each[0] for each in events] == ["slip", "sliding"] and detail == "block 1 on base slides" and number < 30
    assert 1000.0 * time == pytest.approx(weight * (np.cos(a) * np.tan(np.radians(35.0)) - np.sin(a)), rel=1e-5)


def test_a_pushed_block_lifts_its_heel_where_it_would_topple():
    """Push at the top, P h = W w/2; friction holds. The other corner bears all of it from there on."""
    problem = standing(0.0, [500.0], friction_deg=60.0, height=2.0, at=1.0)
    kind, time, detail = told(problem)[0][-1]
    assert (kind, detail) == ("opening", "block 1 on base opens")
    assert 500.0 * time * 2.0 == pytest.approx(ROCK.density * G * 2.0 * 0.5, rel=2e-5)


def test_a_block_that_is_lifted_parts_at_its_weight():
    problem = standing(0.0, [0.0], stop_at=("parting",))
    x, y = problem.loads.point_loads[0].at
    lifted = PointLoad(1, (x + 0.5, y), History.ramp([0.0, 1000.0]))
    events = told(replace(problem, loads=replace(problem.loads, point_loads=(lifted,))))[0]
    assert [kind for kind, _, _ in events] == ["parting", "opening"]
    # Times of changes are known to 1e-6, and the block is looked at just beyond.
    assert events[-1][1] == pytest.approx(ROCK.density * G / 1000.0, rel=2e-6)


def cracked_plate(**run):
    """A plate under a pressure from the sides and a growing one on its ends, with a closed, rough crack at 45°
    inside."""
    polygon = np.array([[-0.03, -0.06], [0.03, -0.06], [0.03, 0.06], [-0.03, 0.06]])
    names = ("load:bottom", "load:right", "load:top", "load:left")
    side = History.table([0.0, 1.0], [[1e6, 0.0], [1e6, 0.0]])
    presses = (
        EdgeTraction("load:top", History.ramp([0.0, -0.1e6])), EdgeTraction("load:bottom", History.ramp([0.0, 0.1e6])),
        EdgeTraction("load:right", History(side.times, -side.values)), EdgeTraction("load:left", side),
    )  # fmt: skip
    return Problem(
        title="cracked",
        blocks=Blocks.from_polygons([polygon], edge_names=[[list(names)]], names=["plate"]),
        cracks=Cracks.from_polylines([np.array([[-0.005, -0.005], [0.005, 0.005]])], names=["crack"]),
        materials=(Material("rock", 17e9, 0.21, 2200.0, np.inf),),
        joints=(),
        face_laws=(JointLaw("rough", friction_angle=np.radians(30.0), cohesion=0.4e6),),
        loads=Loads(edge_tractions=presses),
        growth=GrowthSettings(increment=1e-3),
        run=RunSettings(**{"end_time": 100.0, "stepping": "events", "stop_at": ("slip",)} | run),
        load_edge="load:top",
    )


@pytest.mark.parametrize("longest", [None, 7.0])
def test_a_crack_slips_at_the_load_of_mohr_and_coulomb(longest):
    """(σ₁ − σ₃)/2 = c + tan φ (σ₁ + σ₃)/2 at 45°, all along at once: till then the plate is strained as one without a
    crack. 1e-5 is what the strain before makes of a load that stays where it is."""
    friction, cohesion, side = np.tan(np.radians(30.0)), 0.4e6, 1e6
    load = (2 * cohesion + side * (1 + friction)) / (1 - friction)
    problem = cracked_plate(longest_step=longest)
    events = [event for cycle in cycles(problem) for event in cycle.events]
    assert [(event.kind, event.detail) for event in events] == [
        ("slip", "crack begins to slip"), ("sliding", "crack slides")
    ]  # fmt: skip
    assert events[0].load == pytest.approx(load, rel=1e-5)


@pytest.mark.parametrize("failing", [1, 3])
def test_a_look_without_an_answer_ends_no_run(monkeypatch, failing):
    """Blocks that find no states at a load on the way: the slip is told where they do, at the end of the step or at its
    load."""
    solves, solve = [], EventSteps._solve

    def sometimes(self, now, time, free=False):
        if not free:
            solves.append(time)
        if not free and len(solves) == failing:
            raise NotConverged("made up")
        return solve(self, now, time, free)

    monkeypatch.setattr(EventSteps, "_solve", sometimes)
    exact = 5.624871e6
    events = [event for cycle in cycles(cracked_plate(longest_step=7.0)) for event in cycle.events]
    assert [event.kind for event in events] == ["slip", "sliding"]
    assert exact * (1 - 1e-6) < events[0].load < exact + 7.0 * 0.1e6 and len(solves) > failing


def test_one_body_needs_no_search_for_contacts(monkeypatch):
    def fails(*_):
        raise AssertionError("contacts are searched for")

    monkeypatch.setattr(neighbour_search, "near_pairs", fails)
    assert len(list(cycles(cracked_plate()))) > 2


def test_a_rush_of_changes_is_taken_together():
    """Forty blocks alike but for their widths slip at a first corner one soon after the other, at loads in proportion
    to their widths. The first fifteen are told at their own, the others in groups, and all of them cost few steps more
    than there are."""
    sizes = 1.0 + 0.003 * np.arange(40)
    alone = told(standing(0.0, [1000.0], at=0.02, stop_at=("slip",)))[0][0][1]
    events, number = told(standing(0.0, [1000.0] * 40, sizes=sizes, at=0.02, stop_at=(), end_time=1.13 * alone))
    times = np.array([time for kind, time, _ in events if kind == "slip"])
    # (A block's own shape changes the share that its corners bear.)
    assert len(times) == 40 and (np.diff(times) >= 0).all()
    assert np.ptp(np.diff(times[:15])) < 2e-3 * np.diff(times[:15]).mean()
    assert times[0] == pytest.approx(alone, rel=1e-6) and len(set(times.tolist())) < 40 and number < 40


@dataclass(frozen=True)
class Sticks:
    """States of a pass in which, from ``since`` s on, a face sticks: of which nothing is to be seen before."""

    time: float
    since: float
    key = numbering = ()

    def changes(self, now, before):
        sticks = self.time >= self.since > before.time
        return [Change("stick", False, np.zeros(0, int), False, (0.0, 0.0), "sticks")] if sticks else []

    def same_faces(self, other):
        return True


def test_in_a_rush_none_is_looked_for_nearer_than_changes_are_taken_together(monkeypatch, caplog):
    """A change without a forecast is enclosed by halves; soon after others, no nearer to the last of them than they are
    taken together."""
    changes = FirstChange(("faces",))
    monkeypatch.setattr(Watched, "of", lambda now, found, kinds: found)
    now = SimpleNamespace(state=SimpleNamespace(time=1.0))
    looked = []

    def solve(time):
        looked.append(time)
        return Sticks(time, 1.0 + 1e-7)

    def found_when(near):
        looked.clear()
        changes._seen, changes._last, changes._near = Sticks(1.0, 1.0 + 1e-7), 1.0, near
        return changes.first(now, Sticks(2.0, 1.0 + 1e-7), solve, lambda time: time, 10.0).time

    assert found_when(0.0) < 1.01 and not caplog.records
    assert found_when(0.3) == pytest.approx(1.3) and min(looked) == pytest.approx(1.3)
    # That is 0.23 of the time until then, and said once.
    (line,) = [record.getMessage() for record in caplog.records]
    assert line.startswith("t = 1.3 s: ") and "since t = 1 s, 0.23 of the time" in line
    assert found_when(3.0) == 2.0 and not looked


def test_loads_of_tips_do_not_depend_on_what_else_is_watched():
    """A plate whose crack slips long before it grows: the load at which it grows is the same to 1e-6, with fewer
    steps."""
    rock = Material("rock", 17e9, 0.21, 2200.0, 1e6)
    problem = replace(cracked_plate(stop_at=("initiation",), end_time=1000.0), materials=(rock,))
    loads, numbers = [], []
    for events in (("tips", "contacts", "faces"), ("tips",)):
        seen = list(cycles(replace(problem, run=replace(problem.run, events=events))))
        numbers.append(len(seen))
        loads.append(seen[-1].load)
        kinds = [event.kind for cycle in seen for event in cycle.events]
        assert kinds[:3] == (["slip", "sliding", "initiation"] if "faces" in events else ["initiation"] * 2 + kinds[2:])
    assert loads[0] == pytest.approx(loads[1], rel=1e-6) and numbers[1] < numbers[0]


def test_fixed_steps_tell_what_happens_in_them_where_it_is_asked_for():
    """The pushed block of above in steps of a second: the same events in the same order, at the end of the step in which
    the exact one lies; none without asking. A run ends with one that it is to stop at."""
    exact, _ = told(standing(0.0, [1000.0], stop_at=("sliding",)))
    end = exact[-1][1] + 3.0
    events, number = told(standing(0.0, [1000.0], stepping="fixed", events=("contacts",), stop_at=(), end_time=end))
    events = [each for each in events if each[0] != "mechanism"]
    assert [(kind, detail) for kind, _, detail in events] == [(kind, detail) for kind, _, detail in exact]
    late = np.array([time for _, time, _ in events]) - [time for _, time, _ in exact]
    assert (late > -1e-9).all() and (late < 1.0).all()
    without, same = told(standing(0.0, [1000.0], stepping="fixed", stop_at=(), end_time=end))
    assert same == number and not {kind for kind, *_ in without} - {"mechanism"}
    stopped, _ = told(standing(0.0, [1000.0], stepping="fixed", events=("contacts",), stop_at=("sliding",)))
    assert stopped == events


def test_a_block_that_falls_tells_when_it_comes_down():
    """From 1 mm above its base: √(2 h/g), to a step of 0.2 ms; both its corners at once."""
    height, dt = 1e-3, 2e-4
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    problem = standing(0.0, [0.0])
    blocks = Blocks.from_polygons([3 * square - [1.0, 3.0], square + [0.0, height]], fixed=[True, False])
    fall = replace(
        problem, blocks=blocks, loads=Loads(gravity=History.constant([0.0, -G])),
        dda=DdaSettings(time_step=dt, dynamic_factor=1.0),
        run=RunSettings(end_time=0.05, events=("contacts",), stop_at=("closure",)),
    )  # fmt: skip
    ((kind, time, _),) = told(fall)[0]
    assert kind == "closure" and 0 <= time - np.sqrt(2 * height / G) < 2 * dt


@dataclass(frozen=True)
class Breaks(Sticks):
    """States of a pass in which bonds of a joint (or, of another ``kind``, contacts) change from ``since`` s on."""

    kind: str = "debonding"

    def changes(self, now, before):
        changed = self.time >= self.since > before.time
        return [Change(self.kind, True, np.zeros(0, int), False, (0.0, 0.0), "")] if changed else []


@pytest.mark.parametrize(("kind", "at"), [("debonding", 1.42), ("slip", 2.27)])
def test_bonds_that_break_before_they_are_expected_to_are_found_halfway(monkeypatch, kind, at):
    """A contact is expected to change at 2.27 s, and a pass there confirms it. Bonds that break together have broken
    before: they are looked for halfway, then enclosed; other changes are where they were expected."""
    changes = FirstChange(("contacts",))
    monkeypatch.setattr(Watched, "of", lambda now, found, kinds: found)
    monkeypatch.setattr(first_state_change, "_first_of", lambda changes, low, high: 2.27 if high.time > 2.0 else None)
    now = SimpleNamespace(state=SimpleNamespace(time=1.0))
    changes._seen = Breaks(1.0, 1.42, kind)
    found = changes.first(now, Breaks(4.0, 1.42, kind), lambda time: Breaks(time, 1.42, kind), lambda time: time, 10.0)
    assert found.time == pytest.approx(at, abs=2e-3)
