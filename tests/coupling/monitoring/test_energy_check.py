"""A run whose energy is not accounted for says so, with the time."""

from __future__ import annotations

import logging
import re
from dataclasses import replace
from itertools import islice, pairwise, takewhile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import geomech
from geomech.bench.slopes.drawn_slopes import drawn, problem_of
from geomech.bench.slopes.random_slopes import scene_text
from geomech.coupling import cycles
from geomech.coupling.cycle import Coupling
from geomech.coupling.monitoring import pass_agreement
from geomech.coupling.monitoring.energy_check import (
    UNPAID,
    BendingWatch,
    BudgetWatch,
    GrowthWatch,
    check_dissipation,
    check_supplied,
    warn_of_onset,
)
from geomech.coupling.monitoring.pass_agreement import DISAGREES, AgreementWatch
from geomech.dda.energy_balance import GAIN, EnergyBudget, StepEnergy
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
    Problem,
    RunSettings,
)
from geomech.output.tables.motion_state import energy_summary

PIPELINES = Path(__file__).parents[3] / "pipelines"


def test_a_share_beyond_the_bound_is_told_and_again_when_it_has_doubled(caplog):
    watch = BudgetWatch()
    with caplog.at_level(logging.WARNING):
        for time, share in ((1.0, 0.9 * GAIN), (2.0, float("nan")), (3.0, -1.5 * GAIN), (4.0, 2.9 * GAIN), (5.0, 20.0)):
            watch.check(share, time)
    first, second = [record.getMessage() for record in caplog.records]
    assert first.startswith("t = 3 s: -0.015 of all converted energy") and "reduce the time step" in first
    assert second.startswith("t = 5 s: 20 of all converted energy")


@pytest.mark.parametrize(
    ("kinetic", "broken", "told"), [(10.0, 0.0, "still move"), (0.0, 1.0, "have grown"), (0.0, 0.0, "")]
)
def test_what_the_time_scheme_takes_matters_to_motion_and_to_cracks_that_grew_in_it(caplog, kinetic, broken, told):
    budget = SimpleNamespace(last=SimpleNamespace(kinetic=kinetic), turnover=100.0, scheme=20.0, breaking=0.0)
    with caplog.at_level(logging.WARNING):
        check_dissipation(budget, 1.0, False, broken)
        assert ("dda.newmark" in caplog.text) == bool(told)
        caplog.clear()
        check_dissipation(budget, 1.0, False, broken, (0.25, 0.5))
        assert "dda.newmark" not in caplog.text
    assert told in caplog.text and ("taken 0.2 of all" in caplog.text) == bool(told)


def test_passes_that_do_not_agree_are_told_of_and_again_when_it_has_doubled(caplog):
    watch = AgreementWatch()
    with caplog.at_level(logging.WARNING):
        for time, mismatch in ((1.0, []), (2.0, [0.0, 0.9 * DISAGREES]), (3.0, [0.01, 0.05]), (4.0, [0.09, 0.0])):
            watch.check(["foot", "head"][: len(mismatch)], np.array(mismatch), time)
        watch.check(["foot", "head"], np.array([0.2, 0.0]), 5.0)
    first, second = [record.getMessage() for record in caplog.records]
    assert first.startswith("t = 3 s: head and its cracks agree only to 0.05 of their strain")
    assert second.startswith("t = 5 s: foot and its cracks agree only to 0.2 ")


def test_a_random_slope_says_how_far_blocks_and_cracks_agree(caplog, monkeypatch):
    """The figure of the warning is that of the table, here with a threshold below what passes usually leave."""
    monkeypatch.setattr(pass_agreement, "DISAGREES", 1e-9)
    with caplog.at_level(logging.WARNING):
        first = islice(cycles(problem_of(drawn(scene_text(4)))), 3)
        mismatch = [cycle.statistics.get("compliance_mismatch", 0.0) for cycle in first]
    lines = [record.getMessage() for record in caplog.records]
    told = [re.search(r"cracks agree only to (\S+) of their strain", line) for line in lines]
    shares = [float(each[1]) for each in told if each]
    assert max(shares) == pytest.approx(max(mismatch), rel=0.05) and max(mismatch) > 1e-9


def test_cracks_that_blocks_did_not_pay_for_are_told_of_once(caplog):
    watch = BendingWatch()
    with caplog.at_level(logging.WARNING):
        for time, toughness, spent in ((1.0, 0.0, 0.0), (2.0, 4.0, 0.0), (3.0, 8.0, 4.0), (4.0, 8.0, 7.9 - UNPAID),
                                       (5.0, 8.0, 2.0), (6.0, 9.0, 0.0)):  # fmt: skip
            watch.check(toughness, spent, time)
        bent = BendingWatch()
        for time, toughness in ((1.0, 4.0), (2.0, 4.0)):
            bent.check(toughness, 0.0, time, bend=True)
    line, other = [record.getMessage() for record in caplog.records]
    assert line.startswith("t = 5 s: of the 8 J/m of fracture energy") and "blocks supplied 2 " in line
    assert "store no bending" in line and "store no bending" not in other and "dda.time_step_s" in other


def notched_beam(height: float, speed: float) -> Problem:
    """A beam with a notch below its middle, that comes down on two supports near its ends."""
    beam = np.array([[-1.0, height], [1.0, height], [1.0, height + 0.4], [-1.0, height + 0.4]])
    supports = [np.array([[x, -0.2], [x + 0.1, -0.2], [x + 0.1, 0.0], [x, 0.0]]) for x in (-0.85, 0.75)]
    return Problem(
        title="a dropped beam",
        blocks=Blocks.from_polygons([beam, *supports], fixed=[False, True, True]),
        cracks=Cracks.from_polylines(
            [np.array([[0.0, height], [0.0, height + 0.1]])], block=[0], surface=[(True, False)]
        ),
        materials=(Material("rock", 20e9, 0.2, density=2400.0, k_ic=1e6),),
        joints=(JointLaw("joint", friction_angle=0.5),),
        loads=Loads(gravity=History.constant([0.0, -speed])),
        dda=DdaSettings(time_step=1e-4, dynamic_factor=1.0),
        growth=GrowthSettings(increment=0.02, min_increment=2e-3),
        run=RunSettings(end_time=2e-3, stop_at=()),
    )


def test_a_crack_that_bending_opens_in_motion_is_told_of(caplog):
    """A weight that comes at once, forty times the earth's: the block does not bend and gives its crack nothing."""
    with caplog.at_level(logging.WARNING):
        last = list(cycles(notched_beam(0.0, 400.0)))[-1]
    assert last.statistics["toughness_energy"] > 0
    assert last.statistics["fracture_energy"] < 0.1 * last.statistics["toughness_energy"]
    assert sum("store no bending energy" in record.getMessage() for record in caplog.records) == 1
    assert energy_summary(last)["unpaid_toughness"] > 0.9 * last.statistics["toughness_energy"]


def test_a_beam_that_turns_far_in_a_static_step_is_told_of(caplog):
    """A soft beam on a glued end turns by some degrees at once: static steps keep its forces where they began."""
    beam = np.array([[0.0, 0.0], [8.0, 0.0], [8.0, 1.0], [0.0, 1.0]])
    wall = np.array([[-2.0, -1.0], [0.0, -1.0], [0.0, 2.0], [-2.0, 2.0]])
    problem = Problem(
        title="a soft beam",
        blocks=Blocks.from_polygons([wall, beam], fixed=[True, False]),
        cracks=Cracks.from_polylines([]),
        materials=(Material("rock", 1e8, 0.2, density=2500.0),),
        joints=(JointLaw("glue", 0.6, 1e12, 1e12),),
        loads=Loads(gravity=History.ramp([0.0, -9.81])),
        dda=DdaSettings(time_step=0.25, dynamic_factor=0.0, max_displacement_ratio=0.2),
        run=RunSettings(end_time=1.0),
    )
    with caplog.at_level(logging.WARNING):
        shares = {c.state.time: c.statistics["budget_residual"] for c in cycles(problem) if c.number}
    over = [time for time, share in shares.items() if abs(share) > GAIN]
    lines = [record.getMessage() for record in caplog.records if "not accounted for" in record.getMessage()]
    # It is told where it begins, and wherever it has doubled since.
    told = [float(re.search(r"s: (\S+) of all", line)[1]) for line in lines]
    assert over and all(abs(later) > 1.9 * abs(first) for first, later in pairwise(told))
    assert abs(told[-1]) > 0.45 * max(abs(share) for share in shares.values())
    # Six digits of the time are told.
    assert float(re.match(r"t = (\S+) s", lines[0])[1]) == pytest.approx(over[0], rel=1e-5)


def test_what_unstable_growth_sets_free_is_booked_and_told_once(caplog):
    """A flaw at the foot of a column runs through it at one load: every pass sets more free than the one before, and
    there is no time step to shorten."""
    with caplog.at_level(logging.WARNING):
        *_, last = geomech.cycles(PIPELINES / "flexural_toppling")
    lines = [record.getMessage() for record in caplog.records]
    assert not any("without work" in line for line in lines)
    (line,) = [line for line in lines if "grow unstably" in line]
    assert last.statistics["growth_release"] >= float(re.search(r"released (\S+) J/m", line)[1]) * 0.99 > 1.0
    assert abs(last.statistics["budget_residual"]) < 1e-6


@pytest.mark.parametrize(("drive", "told"), [(1.05, ""), (1.66, "from 1.66 times their toughness")])
def test_unstable_growth_says_if_load_steps_pass_the_load_at_which_it_begins(caplog, drive, told):
    watch, budget = GrowthWatch(), EnergyBudget(turnover=50.0, released=1.0)
    for each in (drive, 1.01):
        watch.begins(each)
    watch.check(budget, 2.0)
    watch.check(budget, 3.0)
    (line,) = [record.getMessage() for record in caplog.records]
    assert "t = 2 s" in line and told in line and ("load steps" in line) == bool(told)


@pytest.mark.parametrize(("steps", "told"), [(2, True), (24, False)])
def test_coarse_load_steps_in_which_a_crack_runs_are_told_of(caplog, steps, told):
    """Slope 26: its weight in two steps passes the load at which cracks begin to run by two thirds (in three by a tenth)."""
    problem = problem_of(drawn(scene_text(26)))
    problem = replace(problem, dda=replace(problem.dda, time_step=3.0 / steps))
    run = Coupling(problem)
    for _ in takewhile(lambda cycle: not cycle.growth_pass, run.cycles()):
        pass
    run.unstable.check(EnergyBudget(turnover=1.0, released=1.0), 1.0)
    assert ("depends on the load steps" in caplog.text) == told


@pytest.mark.parametrize(
    ("drive", "step", "told"), [(7.0, 0.01, "is 0.11 of the time left"), (1.05, 0.01, ""), (7.0, 0.004, "")]
)
def test_growth_in_motion_that_begins_within_a_long_step_is_told_of(caplog, drive, step, told):
    """The step, over the time from its start, 0.09 s before the run ends after 0.1 s."""
    warn_of_onset(drive, step, 0.01 + step, 0.1)
    assert (told in caplog.text) and bool(caplog.records) == bool(told)


@pytest.mark.parametrize(("division", "told"), [(1, True), (4, False)])
def test_a_coarse_step_in_which_cracks_begin_to_grow_in_motion_is_told_of(caplog, division, told):
    """Slope 73, whose work of gravity is 21 % off in steps of dt, and 3 % in a quarter of them."""
    problem = problem_of(drawn(scene_text(73)))
    dt = problem.dda.time_step / division
    run = Coupling(replace(problem, dda=replace(problem.dda, time_step=dt)))
    for _ in takewhile(lambda cycle: cycle.state.time < 1.5 * dt, run.cycles()):
        pass
    assert ("known to one step only" in caplog.text) == told


def test_a_scheme_that_gives_without_growth_is_told_of(caplog):
    step = dict.fromkeys(StepEnergy._fields, 0.0) | {"load_work": 1.0, "scheme": -0.5}
    with caplog.at_level(logging.WARNING):
        grown = EnergyBudget().after(StepEnergy(**step), 1.0, growing=True)
        assert grown.released == 0.5 and not caplog.records
        EnergyBudget().after(StepEnergy(**step), 1.0)
    assert "without work" in caplog.records[0].getMessage()


def test_what_no_block_supplied_to_cracks_and_cuts_is_told_of(caplog):
    """The share of all converted energy, beyond the bound."""
    budget = EnergyBudget(turnover=50.0)
    for supplied in (1.0, 0.0, -0.99 * GAIN * 50.0):
        check_supplied(supplied, budget, 2.0)
    assert not caplog.records
    check_supplied(-6.0, budget, 2.0)
    assert "t = 2 s" in caplog.text and "released 6 J/m, 0.12 of all converted energy" in caplog.text
    assert "Give the zone an order" in caplog.text
    check_supplied(-6.0, budget, 2.0, bend=True)
    assert caplog.records[-1].getMessage().endswith("Shorten dda.time_step_s")


@pytest.mark.slow
def test_a_random_slope_says_what_no_block_supplied(caplog):
    """Slope 36, whose work of gravity is 18 % off in half the step."""
    problem = problem_of(drawn(scene_text(36)))
    with caplog.at_level(logging.WARNING):
        *_, last = cycles(replace(problem, dda=replace(problem.dda, time_step=0.5 * problem.dda.time_step)))
    told = [
        re.search(r"released (\S+) J/m, .* which no block supplied", record.getMessage()) for record in caplog.records
    ]
    given = last.statistics["fracture_energy"] + last.statistics["parting_energy"]
    assert [float(each[1]) for each in told if each] == [pytest.approx(-given, rel=1e-2)]


def weighed_column(dt: float, end: float, **settings) -> Problem:
    """A column of rock on the ground, to which the weight comes at once."""
    column, ground = (
        np.array([[-w, y], [w, y], [w, y + h], [-w, y + h]]) for w, y, h in ((1.0, 0.0, 10.0), (2, -1, 1))
    )
    return Problem(
        title="a column under sudden weight",
        blocks=Blocks.from_polygons([column, ground], fixed=[False, True]),
        cracks=Cracks.from_polylines([]),
        materials=(Material("rock", 1e9, 0.2, 2500.0),),
        joints=(JointLaw("joint", friction_angle=0.5),),
        loads=Loads(gravity=History.constant([0.0, -9.81])),
        dda=DdaSettings(time_step=dt, dynamic_factor=1.0, **settings),
        run=RunSettings(end_time=end),
    )


def of_dissipation(problem: Problem, caplog) -> tuple[float, float | None]:
    """The work of gravity in a run of ``problem``, and the part of the energy that a warning says was dissipated."""
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        *_, last = cycles(problem)
    told = [re.search(r"integration has taken (\S+) of all", record.getMessage()) for record in caplog.records]
    shares = [float(each[1]) for each in told if each]
    return last.statistics["gravity_work"], shares[0] if shares else None


def test_vibrations_that_the_step_does_not_resolve_are_told_of(caplog):
    """The lowest vibration of the column lasts 0.06 s: after a third of it, coarse steps are off by about what they
    say; no step says so once the column rests, or begins in equilibrium, or if the scheme dissipates nothing."""
    end = 0.02
    fine, quiet = of_dissipation(weighed_column(end / 256, end), caplog)
    assert quiet is None
    for steps in (4, 8):
        work, told = of_dissipation(weighed_column(end / steps, end), caplog)
        assert told is not None and 0.2 * told < abs(work / fine - 1.0) < 2.0 * told
    for rests in (
        weighed_column(0.01, 3.0),
        weighed_column(end / 4, end, equilibrium="start"),
        weighed_column(end / 4, end, newmark=(0.25, 0.5)),
    ):
        assert of_dissipation(rests, caplog)[1] is None


def test_bonds_that_break_within_coarse_steps_are_told_of(caplog):
    """A random slope under sudden weight and shaking, whose bonds break. The error of the work of gravity, compared with
    steps a sixteenth as long, is that of the warning or a few times as much, and shrinks with it."""
    problem = problem_of(drawn(scene_text(29)))
    found = {}
    for division in (1, 4, 16):
        caplog.clear()
        refined = replace(problem, dda=replace(problem.dda, time_step=problem.dda.time_step / division))
        with caplog.at_level(logging.WARNING):
            *_, last = cycles(refined)
        told = [re.search(r"forces would have done (\S+) of all", record.getMessage()) for record in caplog.records]
        found[division] = last.statistics["gravity_work"], [float(each[1]) for each in told if each]
    fine, quiet = found[16]
    assert not quiet
    shares = [found[division][1][0] for division in (1, 4)]
    errors = [abs(found[division][0] / fine - 1.0) for division in (1, 4)]
    assert shares[1] < 0.3 * shares[0] and errors[1] < 0.6 * errors[0]
    assert all(0.3 * share < error < 5.0 * share for share, error in zip(shares, errors))


@pytest.mark.parametrize("together", [True, False])
def test_static_steps_that_move_what_nothing_holds_are_told_of(together, caplog):
    """A tank that water lifts by half its weight, before the weight is there or as it comes: it floats off, and settles."""
    weight = 2500.0 * 9.81 * 20.0
    lift = [0.0, 0.5 * weight]
    problem = weighed_column(1.0, 4.0)
    problem = replace(
        problem,
        dda=replace(problem.dda, dynamic_factor=0.0),
        loads=Loads(
            gravity=History(np.array([0.0, 3.0]), np.array([[0.0, 0.0], [0.0, -9.81]])),
            edge_tractions=(EdgeTraction("top", History.ramp([0.0, lift[1] / 2.0 / 3.0])),)
            if together
            else (EdgeTraction("top", History.constant([0.0, lift[1] / 2.0])),),
        ),
        blocks=replace(problem.blocks, edge_name=np.array([0, 0, 1, 0, 0, 0, 0, 0]), edge_names=("", "top")),
    )
    with caplog.at_level(logging.WARNING):
        *_, _last = cycles(problem)
    assert any("moved without support" in record.getMessage() for record in caplog.records) is not together
