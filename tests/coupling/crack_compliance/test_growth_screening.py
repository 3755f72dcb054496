"""Blocks whose cracks cannot grow are left out: runs with and without are the same, and so is what is asked for later."""

from dataclasses import fields, replace

import numpy as np
import pytest

from geomech.bench.cost.block_scenes import cracked_wall
from geomech.coupling import cycle_record, cycles
from geomech.coupling.cycle import Coupling
from geomech.coupling.load_transfer import elastic_bodies
from geomech.model import CrackFaces, History, JointLaw
from geomech.output.checkpoints import checkpoint_file

STEPS = 14
#: Some sixty times K of the tips that are shaken, Pa √m.
TOUGH = 1e6


def problem(k_ic=1e12, skip=True, aperture=np.inf):
    of = cracked_wall(12, 4)
    of = replace(of, cracks=replace(of.cracks, aperture=np.full(of.cracks.n_segments, aperture)))
    run = replace(of.run, end_time=(STEPS - 0.5) * 0.01, skip=skip)
    return replace(
        of, run=run, materials=(replace(of.materials[0], k_ic=k_ic),), growth=replace(of.growth, increment=0.02)
    )


@pytest.fixture(scope="module")
def tough():
    """The same wall, in which nothing grows: nothing left out, and left out."""
    return [*cycles(problem(skip=False))], [*cycles(problem())]


def same_states(run, other, tolerance):
    assert len(run) == len(other)
    for a, b in zip(run, other):
        for name in ("vertices", "velocity", "stress", "crack_strain"):
            mine, others = getattr(a.state, name), getattr(b.state, name)
            assert mine == pytest.approx(others, rel=0, abs=tolerance * np.abs(others).max(initial=1e-30)), name


def test_a_wall_moves_as_if_all_of_it_were_solved(tough):
    """States and all statistics, among them the energy at cracks, agree to what scaling solutions costs in digits."""
    whole, lean = tough
    same_states(whole, lean, 1e-10)
    for a, b in zip(whole, lean):
        assert list(a.statistics) == list(b.statistics)
        for name in ("crack_elastic", "traction_imbalance", "kinetic_energy", "fastest_tip"):
            if name in a.statistics:
                assert a.statistics[name] == pytest.approx(b.statistics[name], rel=1e-8, abs=1e-9)


def test_what_was_left_out_is_there_when_it_is_asked_for(tough):
    """Tips, faces and bodies, long after the run has gone on, in the order of always."""
    whole, lean = tough
    told = lean[-1].skips["left-out solutions"]
    assert told.kept == 4 * (STEPS - 5) and told.saved > 0 and "left-out solutions" not in whole[-1].skips
    for a, b in zip(whole, lean):
        assert [*a.bodies] == [*b.bodies]
        for name in a.tips.dtype.names:
            size = np.abs(a.tips[name]).max(initial=0.0)
            np.testing.assert_allclose(b.tips[name], a.tips[name], rtol=0, atol=1e-9 * size, err_msg=name)
        if a.faces is not None:
            for of in fields(CrackFaces):
                mine, others = getattr(b.faces, of.name), getattr(a.faces, of.name)
                np.testing.assert_allclose(mine, others, rtol=0, atol=1e-9 * np.abs(others).max(initial=0.0))


def test_cracks_whose_faces_close_are_left_out_too():
    """Closed cracks, which open and close as the wall is shaken: states, and tips that are asked for at the end, are those
    of a wall that is solved in every step."""
    times = np.linspace(0.0, STEPS * 0.01, 8)
    shaken = History(times, 9.81 * np.column_stack([3 * np.sin(60 * times), 2 * np.cos(45 * times) - 3]))
    runs = []
    for skip in (False, True):
        of = problem(skip=skip, aperture=0.0)
        runs.append([*cycles(replace(of, loads=replace(of.loads, gravity=shaken)))])
    whole, lean = runs
    assert lean[-1].skips["left-out solutions"].kept == 4 * (STEPS - 5)
    assert len({solution.closed.tobytes() for cycle in whole[1:] for solution in cycle.bodies.values()}) > 4
    # (What scaling costs in digits grows from impact to impact.)
    same_states(whole, lean, 1e-7)
    for name in ("k_i", "k_ii", "k_eq"):
        size = np.abs(whole[-1].tips[name]).max()
        np.testing.assert_allclose(lean[-1].tips[name], whole[-1].tips[name], rtol=0, atol=1e-6 * size, err_msg=name)


def rubbing(monkeypatch, skip=True):
    """Many cracked blocks, shaken as above, whose faces slip and stick."""
    for module in (cycle_record, elastic_bodies):
        monkeypatch.setattr(module, "MANY", 4)
    times = np.linspace(0.0, STEPS * 0.01, 8)
    shaken = History(times, 9.81 * np.column_stack([3 * np.sin(60 * times), 2 * np.cos(45 * times) - 3]))
    of = problem(k_ic=TOUGH, skip=skip, aperture=0.0)
    return replace(
        of, face_laws=(JointLaw("rough", friction_angle=0.3),), loads=replace(of.loads, gravity=shaken)
    )  # fmt: skip


def test_cracks_with_friction_are_left_out_too(monkeypatch):
    """Blocks move as if all were solved, to the digits, and tips that are asked for at the end have K within half a per
    cent of the toughness."""
    whole, lean = ([*cycles(rubbing(monkeypatch, skip))] for skip in (False, True))
    assert lean[-1].skips["left-out solutions"].kept > STEPS - 5
    assert min(solution.frictional_work for solution in whole[-1].bodies.values()) > 0.0
    same_states(whole, lean, 1e-7)
    for name in ("k_i", "k_ii", "k_eq"):
        np.testing.assert_allclose(lean[-1].tips[name], whole[-1].tips[name], rtol=0, atol=0.005 * TOUGH, err_msg=name)


def test_a_stored_run_with_friction_leaves_out_the_same(monkeypatch, tmp_path):
    """To the bit: what faces remember of the solutions before, and the loads since then, are stored."""
    coupling, stored = Coupling(rubbing(monkeypatch)), []

    def store():
        if coupling.now.number in (STEPS // 2, STEPS - 3):
            stored.append(checkpoint_file.write(tmp_path, {"cycle": coupling.now.number}, coupling))

    def told(cycle):
        return (
            cycle.number,
            cycle.work["solutions_left_out"],
            cycle.latest_tips.tobytes(),
            cycle.state.crack_strain.tobytes(),
        )

    coupling.between = store
    run = [told(cycle) for cycle in coupling.cycles()]
    for path in stored:
        resumed = [told(cycle) for cycle in checkpoint_file.read(path).load_steps()]
        assert len(resumed) > 2 and run[-len(resumed) :] == resumed


def test_asking_makes_no_difference_to_what_moves():
    """To the bit; and where all that is left out is asked for at once, nothing is left out any more."""
    asked, quiet = [], [*cycles(problem())]
    for cycle in cycles(problem()):
        asked.append((cycle, float(cycle.tips["k_eq"].sum())))
    for (a, _), b in zip(asked, quiet, strict=True):
        assert a.state.vertices.tobytes() == b.state.vertices.tobytes()
        assert a.state.crack_strain.tobytes() == b.state.crack_strain.tobytes()
    assert (
        "left-out solutions" not in asked[-1][0].skips and asked[-1][0].work["solutions"] > quiet[-1].work["solutions"]
    )


def test_tables_of_many_blocks_have_the_last_solution_of_each(monkeypatch):
    """Where many cracked blocks move, tables ask for the last solutions: these are those of the cycle they name, at most
    `RENEWED` cycles old, and blocks stay left out. What is asked for itself is of its own cycle."""
    monkeypatch.setattr(cycle_record, "MANY", 4)
    monkeypatch.setattr(cycle_record, "RENEWED", 6)
    whole = {cycle.number: cycle.tips for cycle in cycles(problem(skip=False))}
    ages, last = [], None
    for last in cycles(problem()):
        assert last.sparing == (last.number > 0) or not len(last.latest_tips)
        for tip, number in zip(last.latest_tips, last.solved_in):
            (own,) = whole[number][(whole[number]["crack"] == tip["crack"]) & (whole[number]["end"] == tip["end"])]
            for name in ("node", "point", "block", "k_i", "k_ii", "k_eq", "angle"):
                np.testing.assert_allclose(
                    tip[name], own[name], rtol=1e-7, atol=1e-9 * np.abs(whole[number][name]).max()
                )
            ages.append(last.number - number)
        size = last.latest_faces.opening.size if last.number else 0
        assert size == (last.faces.opening.size if last.number == STEPS else size)
    assert set(ages) == {0, 1, 2, 3, 4, 5}
    assert last.skips["left-out solutions"].kept >= 4 * (STEPS - 5) * 5 // 6
    np.testing.assert_allclose(last.tips["k_eq"], whole[last.number]["k_eq"], rtol=1e-7)


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("aperture", [np.inf, 0.0], ids=["slots", "closed"])
def test_cracks_grow_when_they_would(aperture):
    """A weight that grows until cracks do: events, ways of tips and energy are the same with blocks left out before."""
    runs = []
    for skip in (False, True):
        of = problem(k_ic=5e3, skip=skip, aperture=aperture)
        gravity = replace(
            of.loads.gravity,
            times=np.array([0.0, 0.08, 0.14]),
            values=np.outer([0.01, 0.01, 1.0], of.loads.gravity.values[0]),
        )
        runs.append([*cycles(replace(of, loads=replace(of.loads, gravity=gravity)))])
    whole, lean = runs
    assert lean[-1].skips["left-out solutions"].kept >= 4
    grown = [sum(float(c.tips["grown"].sum()) for c in run) for run in runs]
    assert grown[0] > 0 and grown[1] == pytest.approx(grown[0], rel=1e-9)
    assert [(e.kind, e.cycle) for c in lean for e in c.events] == [(e.kind, e.cycle) for c in whole for e in c.events]
    same_states(whole, lean, 1e-7)
    for name in ("fracture_energy", "toughness_energy", "crack_elastic", "crack_residual"):
        scale = lean[-1].statistics["toughness_energy"]
        assert lean[-1].statistics[name] == pytest.approx(whole[-1].statistics[name], rel=1e-6, abs=1e-9 * scale)
