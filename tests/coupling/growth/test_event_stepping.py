"""Steps to the very load at which tips reach their toughness, held against the crack solver alone, fixed steps, closed
forms."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from geomech import ddm
from geomech.coupling import cycle as cycle_module
from geomech.coupling import cycles
from geomech.coupling.coupled_state import CrackedBlocks
from geomech.coupling.cycle_record import leading_load
from geomech.coupling.growth import event_stepping
from geomech.ddm.fracture.criteria import maximum_tangential_stress
from geomech.model import (
    WEIGHT,
    Blocks,
    Cracks,
    DdaSettings,
    EdgeTraction,
    GrowthSettings,
    History,
    Loads,
    Material,
    Problem,
    RunSettings,
)

W, H, HALF = 0.03, 0.06, 0.005
ROCK = Material("rock", 17e9, 0.21, 2200.0, 1e6)
ENDS = np.array([[[W, H], [-W, H]], [[-W, -H], [W, -H]]])
PULL = np.array([[[0.0, 1.0]] * 2, [[0.0, -1.0]] * 2])
RATE = 0.05e6
SLANTED = np.array([[-HALF, -0.6 * HALF], [HALF, 0.6 * HALF]])


def plate(lines=(SLANTED,), rate=RATE, stop_at=("initiation",), growth=None, **run):
    """A plate with open slots under rising tension on its ends; a load of ``rate`` Pa more a second."""
    polygon = np.array([[-W, -H], [W, -H], [W, H], [-W, H]])
    ends = (("load:top", rate), ("load:bottom", -rate))
    return Problem(
        title="plate",
        blocks=Blocks.from_polygons([polygon], edge_names=[[["load:bottom", "", "load:top", ""]]]),
        cracks=Cracks.from_polylines(list(lines), aperture=np.inf),
        materials=(ROCK,),
        joints=(),
        loads=Loads(edge_tractions=tuple(EdgeTraction(name, History.ramp([0.0, r])) for name, r in ends)),
        dda=DdaSettings(time_step=1.0),
        growth=growth or GrowthSettings(increment=1e-3),
        run=RunSettings(**{"end_time": 4000.0, "stop_at": stop_at, "stepping": "events"} | run),
        load_edge="load:top",
    )


def first_growth(problem):
    return next(cycle for cycle in cycles(problem) if cycle.tips["grown"].any())


def toughness_factor(problem):
    """Load on the ends, Pa, at which the crack solver alone has K_eq = K_Ic: it is proportional to the load."""
    body = ddm.Body(problem.blocks.loops(0), problem.cracks, ROCK, problem.ddm)
    tips = body.solve(ddm.BodyLoad(segments=ENDS, tractions=PULL)).tips
    return ROCK.k_ic / maximum_tangential_stress(tips["k_i"], tips["k_ii"])[1].max()


def test_growth_starts_at_the_load_of_the_crack_solver_alone():
    """K_eq = K_Ic to 1e-6, and the load to 2e-6 of that of small strain: the steps before have strained the plate by
    7e-4, and a load on the block's own ends feels nothing of it but through its rotation."""
    problem = plate()
    found = first_growth(problem)
    assert found.tips["k_eq"].max() == pytest.approx(ROCK.k_ic, rel=1e-6)
    assert -found.load == pytest.approx(toughness_factor(problem), rel=2e-6)


def test_growth_under_a_load_that_acts_at_once_is_at_its_beginning():
    """Within a millionth of a thousandth of a time step, and not at the smallest number after as many solutions as a
    search may take."""
    problem = plate()
    critical = -first_growth(problem).load
    ends = (("load:top", 1.5 * critical), ("load:bottom", -1.5 * critical))
    loads = Loads(edge_tractions=tuple(EdgeTraction(name, History.constant([0.0, value])) for name, value in ends))
    cycle = first_growth(replace(problem, loads=loads))
    assert 1e-13 < cycle.state.time <= 1e-9 * problem.dda.time_step


def test_weight_that_leads_is_that_of_a_column():
    """ρ g(t) h of what moves, in place of the traction on an edge."""
    problem = plate()
    loads = Loads(gravity=History.ramp([0.0, -RATE]))
    problem = replace(problem, loads=loads, load_edge=WEIGHT)
    assert leading_load(problem, problem.blocks, 3.0, {}) == pytest.approx(2200.0 * 2 * H * 3.0 * RATE, rel=1e-12)
    assert leading_load(replace(problem, load_edge=""), problem.blocks, 3.0, {}) == 0.0


def test_growth_starts_at_the_same_load_whatever_the_steps():
    """Loads rising slowly or fast, steps kept short or not: 1e-6, the drive's own tolerance; fixed steps end up to one
    load step above."""
    expected = -first_growth(plate()).load
    for problem in (
        plate(rate=7 * RATE),
        plate(longest_step=20.0),
        replace(plate(), dda=DdaSettings(time_step=30.0)),
        replace(plate(), dda=DdaSettings(time_step=0.01, max_displacement_ratio=1e-4)),
    ):
        assert -first_growth(problem).load == pytest.approx(expected, rel=2e-6)
    for dt in (16.0, 4.0):
        fixed = replace(plate(stepping="fixed"), dda=DdaSettings(time_step=dt))
        assert 0 <= -first_growth(fixed).load - expected <= dt * RATE


def test_tips_that_are_images_of_one_another_grow_together():
    """Half a turn maps the plate on itself: both tips start in one cycle, and their paths stay images to 1e-9 of its
    size."""
    problem = plate(stop_at=("daylighting",), growth=GrowthSettings(increment=4e-3))
    seen = [cycle for cycle in cycles(problem) if cycle.tips["grown"].any()]
    assert len({cycle.load for cycle in seen}) == 1  # it runs away at one load
    for cycle in seen[:-1]:
        first, second = cycle.tips
        assert np.abs(first["point"] + second["point"]).max() < 1e-9 * H
        assert first["grown"] == pytest.approx(second["grown"], abs=1e-9 * H)


@pytest.mark.parametrize("stepping", ["fixed", "events"])
def test_no_pass_is_made_twice(stepping):
    """Short cracks under compression along them grow and stop: steps with growth are followed by others."""
    problem = plate(rate=-RATE, lines=(SLANTED @ [[0, 1], [1, 0]],), stop_at=(), stepping=stepping, end_time=1300.0)
    problem = replace(problem, dda=DdaSettings(time_step=100.0), growth=GrowthSettings(increment=3e-3))
    passes = [(cycle.load_step, cycle.growth_pass) for cycle in cycles(problem)]
    assert len(set(passes)) == len(passes) and passes[-1][0] > min(step for step, number in passes if number) > 0


def test_steps_do_not_pass_the_corners_of_a_history():
    """Tension that comes and goes, too weak to grow anything, twice: every turn of it is a step's end."""
    path = History.table([0.0, 3.0, 5.5, 11.0, 12.0], np.outer([0.0, 1e5, 0.0, 2e5, 0.0], [0.0, 1.0]))
    back = History(path.times, -path.values)
    problem = replace(
        plate(end_time=20.0),
        loads=Loads(edge_tractions=(EdgeTraction("load:top", path), EdgeTraction("load:bottom", back))),
    )
    times = [cycle.state.time for cycle in cycles(problem)]
    assert {3.0, 5.5, 11.0, 12.0, 20.0} <= set(times) and len(times) < 12


def test_a_jump_of_the_drive_is_an_event(monkeypatch):
    """Faces that begin to slip may throw load on a tip at once: the step ends just after the jump, and not where it
    would have passed the toughness but for it."""
    jump = 41.7
    monkeypatch.setattr(
        event_stepping,
        "drive",
        lambda now, found: (0.01 if found.result.state.time < jump else 0.05) * found.result.state.time,
    )
    problem = plate()
    now, steps = CrackedBlocks(problem), event_stepping.EventSteps(problem)
    for _ in range(20):
        found = steps.first_pass(now, problem.run.end_time)
        if steps.reached:
            break
        now.state = found.result.state
        steps.after(now, found)
    assert steps.reached and 0 <= found.result.state.time - jump < 1e-6 * jump


def test_births_are_events_too():
    """No crack is there: the load at which two are born at a hole is that of the crack solver alone, to 1e-5 (stress at
    a point on a surface, after a strain of 2e-4)."""
    rock = replace(ROCK, k_ic=0.3e6, tensile_strength=3e6)
    angle = 2 * np.pi * (np.arange(16) + 0.5) / 16
    hole = 0.006 * np.column_stack([np.cos(angle), -np.sin(angle)])
    polygon = np.array([[-W, -H], [W, -H], [W, H], [-W, H]])
    growth = GrowthSettings(increment=2e-3, initiation="surface", initiation_spacing=6e-3)
    names = [[["load:bottom", "", "load:top", ""], [""] * 16]]
    problem = replace(
        plate(lines=(), stop_at=("birth",), growth=growth),
        blocks=Blocks.from_polygons([[polygon, hole]], edge_names=names),
        materials=(rock,),
    )
    born = [event for cycle in cycles(problem) for event in cycle.events]
    load = ddm.BodyLoad(segments=ENDS, tractions=PULL)
    alone = next(ddm.propagate([polygon, hole], problem.cracks, rock, load, growth, control="toughness"))
    assert [event.kind for event in born] == ["birth", "birth"]
    assert -born[0].load == pytest.approx(alone.load_factor, rel=1e-5)


def test_dynamic_runs_and_relaxed_ones_are_refused():
    for dda in (DdaSettings(dynamic_factor=1.0), DdaSettings(equilibrium="loads")):
        with pytest.raises(ValueError, match="static runs"):
            next(cycles(replace(plate(), dda=dda)))
    with pytest.raises(ValueError, match='needs stepping "events"'):
        next(cycles(plate(stepping="fixed", control="toughness")))


@pytest.mark.parametrize(
    "run", [{"stepping": "fixed"}, {}, {"control": "toughness"}], ids=["fixed", "events", "toughness"]
)
def test_events_of_growth_between_passes_are_reported_once(run, monkeypatch):
    """Two slots coalesce and cut the plate through. What `take_growth` returns between two passes (coalescence,
    daylighting, split) is in the next recorded cycle, each event once and in order, also within one load step."""
    returned, take = [], cycle_module.take_growth

    def taken(*arguments):
        events = take(*arguments)
        returned.extend(events)
        return events

    monkeypatch.setattr(cycle_module, "take_growth", taken)
    lines = [np.array([[-0.02, 0.0], [-0.007, 0.0]]), np.array([[0.004, 0.0], [0.018, 0.0]])]
    settings = GrowthSettings(increment=4e-3, max_passes=200)
    seen = list(cycles(plate(lines, growth=settings, stop_at=("split",), rate=1e6, end_time=60.0, **run)))
    kinds = {event.kind for event in returned}
    reported = [event for cycle in seen for event in cycle.events if event.kind in kinds]
    assert kinds == {"coalescence", "daylighting", "split"}
    assert [(e.kind, e.detail) for e in reported] == [(e.kind, e.detail) for e in returned]
    if not run.get("control"):
        assert any(event.kind == "coalescence" for cycle in seen if cycle.growth_pass for event in cycle.events)


def test_events_of_growth_are_kept_when_a_run_is_stored_between_passes():
    """The events of growth that a load step in progress has not yet reported belong to its stored state."""
    lines = [np.array([[-0.02, 0.0], [-0.007, 0.0]]), np.array([[0.004, 0.0], [0.018, 0.0]])]
    settings = GrowthSettings(increment=8e-3, max_passes=200)
    coupling = cycle_module.Coupling(
        plate(lines, growth=settings, stop_at=("split",), rate=1e6, end_time=60.0, stepping="fixed")
    )
    stored = []

    def store():
        if coupling.under_way is not None and coupling.under_way.pending and not stored:
            stored.append((coupling.now.number, copy.deepcopy(coupling)))

    coupling.between = store
    events = {cycle.number: cycle.events for cycle in coupling.cycles()}
    number, resumed = stored[0]
    assert any(event.kind == "coalescence" for event in events[number + 1])
    assert {cycle.number: cycle.events for cycle in resumed.load_steps()} == {
        later: found for later, found in events.items() if later > number
    }


@pytest.mark.parametrize("stepping", ["fixed", "events"])
def test_a_static_load_waits_for_tips_that_run(stepping, caplog):
    """Growth under a dead load runs through the plate at the load at which it begins, however few passes a step is to
    have, in about as many passes as with all of them in one step; nothing is said of tips that still grow."""
    ended = []
    for passes in (2, 200):
        growth = GrowthSettings(increment=4e-3, max_passes=passes)
        seen = list(cycles(plate(stop_at=("split",), growth=growth, rate=1e6, end_time=40.0, stepping=stepping)))
        grown = [cycle for cycle in seen if cycle.tips["grown"].any()]
        assert seen[-1].events[-1].kind == "split" and len({cycle.state.time for cycle in grown}) == 1
        ended.append((grown[0].state.time, len(grown)))
    assert ended[0][0] == ended[1][0] and ended[0][1] > 4 and abs(ended[0][1] - ended[1][1]) <= 1
    assert "still grow" not in caplog.text


def test_the_load_does_not_go_back_for_tips_that_still_grow(monkeypatch):
    """Growth that runs away and is stopped after a pass leaves tips driven beyond their toughness: the zero of the
    drive lies behind, but a load that only rises goes on by whole steps."""
    monkeypatch.setattr(cycle_module, "MOST_PASSES", 1)
    growth = GrowthSettings(increment=1e-3, max_passes=1, correct=False)
    times, found = [], cycles(plate(stop_at=(), growth=growth, rate=RATE))
    for cycle in found:
        times.append(cycle.state.time)
        if len(times) == 7:
            break
    assert (np.diff(times) == 0).sum() >= 2 and (np.diff(times) >= 0).all()


def test_the_step_that_is_told_is_the_time_gone_by():
    """In load steps that end at events, in those that go back with the load, and in all passes at one load."""
    seen = []
    for cycle in cycles(plate(stop_at=(), control="toughness", end_time=4000.0)):
        seen.append(cycle)
        if cycle.load_step == 6:
            break
    ends = {cycle.load_step: cycle.state.time for cycle in seen}
    gone_by = [cycle.state.time - ends[cycle.load_step - 1] for cycle in seen[1:]]
    assert min(gone_by) < 0 < max(gone_by)
    assert [cycle.statistics["dt"] for cycle in seen[1:]] == pytest.approx(gone_by, rel=1e-9)
