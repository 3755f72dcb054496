"""Random jointed, cracked slopes from scene file to end, what must hold of any scene held against every cycle."""

import dataclasses
import sys

import numba
import numpy as np
import pytest

from geomech import dda, ddm
from geomech.bench.slopes import fuzzed_slopes, limited_runs, seed_rows
from geomech.bench.slopes.fuzzed_slopes import (
    LONG,
    REFUSED,
    REPORTED,
    RIGHT,
    VERDICTS,
    WRONG,
    Watched,
    outcome,
    watched,
)
from geomech.bench.slopes.random_slopes import scene_text
from geomech.bench.slopes.refusals import REASONS, reason_of
from geomech.bench.slopes.slope_invariants import INVARIANTS
from geomech.coupling import Coupling
from geomech.ddm.growth.tip_advance import advance
from geomech.model import TIP, Blocks, Cracks, GrowthSettings, Material, Motion
from geomech.scene import load_scene

ROCK = Material("rock", 17e9, 0.21)
SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)


@pytest.mark.parametrize("seed", [3, 5, 12, 16, 34])
def test_slopes_run_to_their_end(seed):
    found = watched(seed, seconds=60.0)
    assert found.verdict == RIGHT and not found.faults and not found.reason
    assert all(found.worst[name] <= invariant.bound for name, invariant in INVARIANTS.items())
    assert found.worst["balance"] < 1e-5 and found.worst["energy"] < 1e-3


#: What once went wrong: a wing that left a face at less than 3°, a water table that ends where an edge does; bonds that
#: break within a step, beside others that pull (the step was cut to a thousandth); a tip drawn back to the crack that
#: it had come past, along it; a load that went back for tips which growth had not brought to rest; forces put beside
#: where moments were taken from; parts that closed by more than they were apart; moments weighed against the inertia of
#: unstrained blocks; a dynamic step cut shorter once its cracks had grown; shears of a bond against each other, told of
#: at the corners of their face; a ring of cracks that closed through the mouth they share; slabs that lean in statics,
#: whose corners went straight on; a change sought from a pass that lay beyond it, backwards; faces in a blade of rock that
#: no state of contact fits; a tip that passed into the part it was cut from, their crack having been open; cement that broke
#: in stiff blocks and held in soft ones.
MENDED = {
    0: "less than 3°", 1: "has no length", 10: "did not settle", 14: "less than 3°", 66: "dt = inf", 74: "balance",
    105: "energy", 124: "time goes back", 145: "not inside the outline", 149: "energy", 189: "energy", 219: "overlap",
    231: "balance", 268: "balance", 291: "energy",
    426: "time goes back", 64: "to a common strain", 46: "created energy", 56: "did not settle", 203: "did not settle", 213: "overlap",
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("seed", MENDED)
def test_what_once_went_wrong(seed):
    found = watched(seed, seconds=60.0)
    assert found.verdict in (RIGHT, REPORTED, LONG) and not found.faults
    assert MENDED[seed] not in found.message
    assert not any(MENDED[seed] in what for what in found.reported)


def test_faces_in_a_blade_that_elements_do_not_resolve_find_their_states():
    """A crack that ends 1 mm before a side. Single changes of state left nodes there in violation of their laws."""
    found = watched(226, seconds=60.0)
    assert found.verdict == RIGHT and not found.faults
    assert not any("the remaining violation" in line for line in found.warnings)


@pytest.mark.parametrize(
    ("seed", "ends"), [(159, {"debonding"}), pytest.param(64, {"debonding", "split"}, marks=pytest.mark.slow)]
)
def test_bonds_and_cement_that_hold_in_no_state_break(seed, ends):
    """In every state with these bonds another contact was inconsistent; cement broke while its block was stiff, and held
    once it had given way. (159 split as well, while its contacts still began without the forces of the in-situ stress.)"""
    found = watched(seed, seconds=60.0)
    assert found.verdict == RIGHT and not found.faults
    assert ends <= set(found.events)


def test_what_does_not_hold_is_wrong_unless_a_warning_says_so(monkeypatch):
    """The same slope with a bound that it cannot keep: wrong in silence, reported with a warning of that kind."""
    tight = dataclasses.replace(INVARIANTS["strain"], bound=1e-12)
    monkeypatch.setitem(INVARIANTS, "strain", tight)
    found = watched(34)
    assert found.verdict == WRONG and "strain" in found.faults[0] and "cycle 1:" in found.faults[0]
    monkeypatch.setattr(
        limited_runs.CollectedWarnings, "messages", [f"t = 0 s: rock and cracks {tight.reported[0]}"], raising=False
    )
    monkeypatch.setattr(limited_runs.CollectedWarnings, "__init__", lambda self: super(type(self), self).__init__())
    found = watched(34)
    assert found.verdict == REPORTED and not found.faults and "strain" in found.reported[0]


def test_time_that_is_up_in_a_compiled_function_is_no_error(monkeypatch):
    def compiled(problem):
        yield from ()
        raise SystemError("returned a result with an exception set") from limited_runs.TimeUp("dda.solve")

    monkeypatch.setattr("geomech.coupling.cycles", compiled)
    found = watched(34)
    assert found.verdict == LONG and found.message == "dda.solve" and not found.reason


def test_only_named_reasons_refuse(monkeypatch):
    """An error of ours with another message than those of the list, or of another kind, is wrong."""
    assert reason_of(dda.NotConverged("the block step at t = 0.1 s failed after 12 cuts (dt = 1e-3 s): …")) == (
        "contact states not found"
    )
    assert reason_of(ddm.NotConverged("rock 3: crack faces did not settle in 40 solves")) == "crack faces not found"
    assert reason_of(ValueError("crack faces did not settle in 40 solves")) is None
    sharp = ValueError("'set2 2': leaves the boundary at (4.18, 1.80) at less than 3°")
    assert reason_of(sharp, begun=False) == "sharp corner drawn" and reason_of(sharp) is None
    assert reason_of(dda.NotConverged("a message of another kind")) is None
    assert len({reason.name for reason in REASONS}) == len(REASONS)

    def breaks(problem):
        yield from ()
        raise ValueError("something")

    monkeypatch.setattr("geomech.coupling.cycles", breaks)
    found = watched(34)
    assert found.verdict == WRONG and found.why == "ValueError: something"


def test_a_slope_that_takes_long_is_cut_off_within_a_cycle():
    watched(16)  # compiles what the next run calls: no run is broken off in a compilation
    found = watched(16, seconds=0.3)
    assert found.verdict == LONG and found.seconds < 2.0 and ">" in found.message


def test_no_run_is_broken_off_where_its_callers_would_not_hear_of_it():
    """In a compilation, whose callbacks LLVM does not ask for errors, and where a compiled function makes a named tuple."""
    seen = {}

    def probe():
        pass

    @numba.extending.overload(probe)
    def typed():
        seen["compiled"] = limited_runs.breakable(sys._getframe())
        return lambda: 1

    assert numba.njit(lambda: probe())() == 1
    exec(compile("frame = sys._getframe()", "<string>", "exec"), {"sys": sys}, seen)
    assert not seen["compiled"] and not limited_runs.breakable(seen["frame"])
    assert limited_runs.breakable(sys._getframe())


def test_the_outcome_counts_every_slope_and_reason():
    many = [
        Watched(k, verdict, REASONS[k % 2].name if verdict == REFUSED else "") for k, verdict in enumerate(VERDICTS)
    ]
    text = "\n".join(outcome(many))
    assert all(f"1 {verdict}" in text for verdict in VERDICTS) and REASONS[0].meaning in text
    assert all(name in text for name in INVARIANTS)


@pytest.mark.slow
def test_many_slopes_are_run_once(tmp_path, monkeypatch):
    """Rows are kept: the second time nothing is run, and the picture is drawn anew."""
    first = fuzzed_slopes.measure_many(range(16, 18), folder=tmp_path, workers=1)
    assert "2 slopes" in first.text and (tmp_path / "slopes.png").exists()
    monkeypatch.setattr(seed_rows, "ProcessPoolExecutor", None)
    (tmp_path / "slopes.png").unlink()
    with (tmp_path / "slopes.jsonl").open("a") as rows:
        rows.write('{"seed": 1')  # a run that was broken off as it wrote
    assert fuzzed_slopes.measure_many(range(16, 18), folder=tmp_path).text == first.text
    assert (tmp_path / "slopes.png").exists()


def test_cracks_of_two_blocks_that_share_a_node_settle_each_with_its_own(tmp_path):
    """Seed 80: joints end from both sides at one point of another one; with in-situ stress mouths came to lie off their
    blocks, by what the other block had moved."""
    path = tmp_path / "slope.toml"
    path.write_text(scene_text(80), encoding="utf-8")
    problem = load_scene(path).problem()
    drawn = problem.cracks
    ends = np.unique(np.column_stack([drawn.segments.ravel(), np.repeat(drawn.block, 2)]), axis=0)
    assert len(ends) > len(drawn.nodes)
    settled = Coupling(problem).now.cracks  # makes every body: mouths are checked there
    assert len(settled.nodes) == len(ends) and settled.n_segments == drawn.n_segments


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 140))
def test_many_slopes_are_right_or_say_why_not(seed):
    found = watched(seed, seconds=10.0)
    assert found.verdict != WRONG, (found.message, found.faults)


def test_a_block_strained_beyond_elasticity_is_told_of_and_ends_the_run(caplog):
    """A warning as the strain passes a hundredth and whenever it has doubled, an error at a quarter; fixed blocks do
    not count."""
    blocks = Blocks.from_polygons([SQUARE - [0, 3], SQUARE], fixed=[True, False], names=["base", "rock"])
    watch = dda.ElasticRange()

    def strained(share):
        vertices = blocks.vertices.copy()
        vertices[4:, 0] *= 1 + share
        vertices[:4, 0] *= 2
        watch.check(Motion.of(blocks, vertices), blocks, 1.5)
        return len(caplog.records)

    # (Green's strain of a stretch e is e + e²/2.)
    assert [strained(share) for share in (1e-3, 9e-3, 1.1e-2, 1.5e-2, 3e-2, 3e-2, 2e-2)] == [0, 0, 1, 1, 2, 2, 2]
    assert "t = 1.5 s: rock is strained by 1.11 %" in caplog.text
    with pytest.raises(
        dda.NotConverged, match=r"rock is strained by 34.5 % at t = 1.5 s: beyond linear elasticity"
    ) as refused:
        strained(0.3)
    assert reason_of(refused.value) == "strained beyond elasticity"


def test_a_seed_is_a_scene():
    assert scene_text(11) == scene_text(11) != scene_text(12)


@pytest.mark.parametrize("degrees", [0.5, 2.0, 4.0])
def test_a_way_along_a_surface_goes_straight_across_to_it(degrees):
    """A tip just below a face, driven along it: the rock between would be too thin a wedge for any body (below 3°)."""
    increment = 0.2
    depth = increment * np.sin(np.radians(degrees))
    cracks = Cracks.from_polylines([np.array([[-0.3, 0.0], [0.0, 1 - 0.9 * depth]])], aperture=np.inf)
    tips = np.zeros(1, TIP)
    tips["node"], tips["k_eq"], tips["point"] = 1, 1.0, cracks.nodes[1]
    way = cracks.nodes[1] - cracks.nodes[0]
    tips["direction"] = way / np.hypot(*way)
    tips["angle"] = np.radians(degrees) - np.arctan2(way[1], way[0])
    grown = advance(
        cracks,
        lambda block: [SQUARE],
        tips,
        GrowthSettings(increment=increment, min_increment=increment),
        np.ones(1),
        1,
    )
    assert [join.kind for join in grown.joins] == ["daylighting"]
    mouth = grown.cracks.nodes[grown.cracks.surface]
    assert mouth[0] == pytest.approx([0.0, 1.0], abs=1e-12)
    ddm.Body([SQUARE], grown.cracks, ROCK)


def test_the_end_of_the_time_is_found_below_the_errors_that_followed_upon_it():
    try:
        try:
            try:
                raise limited_runs.TimeUp("here")
            except BaseException as up:
                raise SystemError("returned a result with an exception set") from up
        except SystemError:
            raise ValueError("another") from None
    except ValueError as error:
        assert str(limited_runs.time_up(error)) == "here"
    assert limited_runs.time_up(ValueError("none")) is None
