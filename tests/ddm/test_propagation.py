"""Growth in one body without blocks, against closed forms of a straight crack that lengthens."""

import math
from itertools import islice

import numpy as np
import pytest

from geomech import ddm
from geomech.model import Cracks, DdmSettings, GrowthSettings, JointLaw, Material

ROCK = Material("rock", 17e9, 0.21, k_ic=1e6)
HALF = 10e-3
#: A straight crack of ordinary elements between two tip elements of one increment: K to 2e-4 (three increments on).
STRAIGHT = 3e-4


def straight(aperture=math.inf):
    return Cracks.from_polylines([[[-HALF, 0.0], [HALF, 0.0]]], aperture=aperture)


def half_length(step):
    return float(step.cracks.lengths.sum()) / 2


def test_controlled_load_follows_griffith():
    """σ√(πa) = K_Ic at every length; the load that is found drives the tips to 1e-9 of K_Ic."""
    load = ddm.BodyLoad(remote_stress=[0.0, 1e6, 0.0])
    growth = GrowthSettings(increment=2e-3)
    steps = list(ddm.propagate([], straight(), ROCK, load, growth, control="toughness", max_steps=8))
    assert [s.number for s in steps] == list(range(8))
    for k, step in enumerate(steps):
        assert half_length(step) == pytest.approx(HALF + k * 2e-3, rel=1e-12)
        assert step.tips["k_eq"] == pytest.approx(ROCK.k_ic, rel=1e-7)
        assert step.load_factor == pytest.approx(1.0 / math.sqrt(math.pi * half_length(step)), rel=STRAIGHT)
    assert [e.kind for e in steps[0].events] == ["initiation", "initiation"]
    assert not any(s.events for s in steps[1:])


def test_a_load_that_wedges_the_crack_open_arrests_it():
    """Pressure on the first length only: K = 2p √(a/π) arcsin(a₀/a) falls with a (Tada, Paris & Irwin 1973), so that
    under a dead load the crack runs to where that is K_Ic, and stops there within an increment."""
    pressure = 12e6

    def wedged(factor, cracks):
        return ddm.BodyLoad(crack_pressure=factor * pressure * (cracks.birth_cycle == 0))

    increment = 1e-3
    steps = list(ddm.propagate([], straight(), ROCK, wedged, GrowthSettings(increment=increment), max_steps=150))
    assert [e.kind for e in steps[-1].events] == ["arrest"] and steps[-1].growth is None

    def toughness(a):
        return 2 * pressure * math.sqrt(a / math.pi) * math.asin(HALF / a)

    a = half_length(steps[-1])
    assert len(steps) > 5
    assert toughness(a) < ROCK.k_ic < toughness(a - increment)
    for step in steps[3::5]:
        assert step.tips["k_i"] == pytest.approx(toughness(half_length(step)), rel=5e-4)
    # Driven on, it needs more and more.
    driven = list(ddm.propagate([], straight(), ROCK, wedged, GrowthSettings(), control="toughness", max_steps=6))
    factors = [s.load_factor for s in driven]
    assert factors[1:] == sorted(factors[1:])


def test_part_of_the_load_can_stand():
    """A closed crack under compression that fluid opens: p = σ + K_Ic/√(πa)."""

    def pumped(factor, cracks):
        return ddm.BodyLoad(remote_stress=[-20e6, -10e6, 0.0], crack_pressure=factor * 1e6)

    for step in ddm.propagate([], straight(0.0), ROCK, pumped, GrowthSettings(), control="toughness", max_steps=5):
        excess = ROCK.k_ic / math.sqrt(math.pi * half_length(step))
        assert step.load_factor * 1e6 - 10e6 == pytest.approx(excess, rel=STRAIGHT)


def test_what_stands_may_be_enough():
    def pulled(factor, cracks):
        return ddm.BodyLoad(remote_stress=[0.0, (10 + factor) * 1e6, 0.0])

    step = next(ddm.propagate([], straight(), ROCK, pulled, control="toughness"))
    assert step.load_factor == 0.0 and step.tips["k_eq"][0] > ROCK.k_ic and step.growth is not None


def test_a_load_that_drives_nothing_ends_the_run():
    press = ddm.BodyLoad(remote_stress=[0.0, -1e6, 0.0])
    (only,) = ddm.propagate([], straight(0.0), ROCK, press, control="toughness")
    assert only.growth is None and [e.kind for e in only.events] == ["arrest"]
    pull = ddm.BodyLoad(remote_stress=[0.0, 1e6, 0.0])
    (only,) = ddm.propagate([], straight(), ROCK, pull, control="toughness", max_factor=2.0)
    assert only.load_factor == 2.0 and only.growth is None


def test_a_strip_is_torn_in_two():
    strip = np.array([[-0.03, -0.06], [0.03, -0.06], [0.03, 0.06], [-0.03, 0.06]])
    load = ddm.BodyLoad(remote_stress=[0.0, 1e6, 0.0])
    *_, before, last = ddm.propagate(
        [strip], straight(), ROCK, load, GrowthSettings(increment=4e-3), control="toughness"
    )
    assert [e.kind for e in before.events] == ["daylighting", "daylighting"]
    assert last.solution is None and [e.kind for e in last.events] == ["split"]
    assert last.cracks.surface.sum() == 2 and last.cracks.lengths.sum() == pytest.approx(0.06, rel=1e-12)


def test_a_closed_crack_that_rubs_starts_late():
    """K_II = (|τ| − μ|σ_n|)√(πa) and K_eq = 2/√3 K_II (Erdogan & Sih 1963) at 45° to a pressure; its wings then open,
    and need more and more. The slip goes on from step to step."""
    end = HALF * math.sqrt(0.5) * np.ones(2)
    rough = (JointLaw("rough", friction_angle=math.atan(0.3)),)
    load = ddm.BodyLoad(remote_stress=[0.0, -1e6, 0.0])
    crack = Cracks.from_polylines([np.array([-end, end])])
    growth = GrowthSettings(increment=1e-3, correct=False)
    run = list(ddm.propagate([], crack, ROCK, load, growth, control="toughness", max_steps=4, face_laws=rough))
    shear = 0.5e6 * (1 - 0.3) * math.sqrt(math.pi * HALF)
    assert run[0].load_factor == pytest.approx(ROCK.k_ic / (2 / math.sqrt(3) * shear), rel=1e-5)
    assert np.degrees(run[0].tips["angle"]) == pytest.approx(70.5288, abs=1e-3)
    factors = [step.load_factor for step in run[1:]]
    assert factors == sorted(factors)


def test_bad_wishes_are_refused():
    load = ddm.BodyLoad(remote_stress=[0.0, 1e6, 0.0])
    with pytest.raises(ValueError, match="control"):
        next(ddm.propagate([], straight(), ROCK, load, control="displacement"))
    with pytest.raises(ValueError, match="no growth criterion 'x'; there are mts"):
        next(ddm.propagate([], straight(), ROCK, load, GrowthSettings(criterion="x")))


def test_a_load_is_multiplied_but_not_where_it_acts():
    edge = np.array([[[0.0, 0.0], [1.0, 0.0]]])
    load = ddm.BodyLoad(segments=edge, tractions=edge + 1, body_force=[0, 2.0], about=[3.0, 4.0], crack_pressure=5.0)
    twice = load.scaled(2.0)
    np.testing.assert_array_equal(twice.segments, edge)
    np.testing.assert_array_equal(twice.about, [3, 4])
    np.testing.assert_array_equal(twice.tractions, 2 * (edge + 1))
    np.testing.assert_array_equal(twice.body_force, [0, 4])
    assert twice.crack_pressure == 10.0 and twice.remote_stress is None


def test_steps_can_be_taken_one_at_a_time():
    load = ddm.BodyLoad(remote_stress=[0.0, 8e6, 0.0])
    first, second = islice(ddm.propagate([], straight(), ROCK, load, GrowthSettings(), settings=None), 2)
    assert second.cracks is first.growth.cracks
    assert second.solution.body.counts["elements_new"] < second.solution.body.counts["elements"]


def test_a_solution_is_scaled_instead_of_solved_again():
    """Where faces touch unloaded or never close, so many times the load brings so many times everything; where they
    have a gap to close it does not."""
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    lines = [np.array([[-0.4, -0.1], [0.2, 0.2]]), np.array([[0.0, -0.5], [0.3, -0.4], [0.5, -0.5]])]
    load = ddm.BodyLoad(sides={0: (-2e5, 1e6), 1: (-1e6, 2e5), 2: (2e5, -1e6), 3: (1e6, -2e5)}, crack_pressure=4e5)
    for aperture, scales in (((0.0, np.inf), True), ((0.0, 1e-5), False)):
        body = ddm.Body([square], Cracks.from_polylines(lines, aperture=aperture), ROCK)
        one, other = body.solve(load), body.solve(load.scaled(2.5))
        assert one.scales is scales
        if not scales:
            continue
        assert one.closed.any() and not one.closed.all()
        scaled = one.scaled(load.scaled(2.5), 2.5)
        points = np.array([[0.6, 0.1], [-0.3, 0.7]])
        for name in ("k_i", "k_ii"):
            np.testing.assert_allclose(
                scaled.tips[name], other.tips[name], atol=1e-12 * np.abs(other.tips["k_ii"]).max()
            )
        for mine, solved in zip(scaled.fields(points), other.fields(points)):
            np.testing.assert_allclose(mine, solved, rtol=1e-11)
        assert scaled.residual == pytest.approx(other.residual, rel=1e-3, abs=1e-12)
        np.testing.assert_array_equal(scaled.states, other.states)


def test_a_step_of_a_smooth_path_takes_little_more_than_one_body(monkeypatch):
    """In tension, along a curved path, most trials are the step: 15 steps after the kink take fewer than 23 bodies. And
    a load that only changes in size is not solved for again."""
    made, solved = [], []
    make, solve = ddm.Body.__init__, ddm.Body.solve
    monkeypatch.setattr(ddm.Body, "__init__", lambda self, *a, **k: made.append(0) or make(self, *a, **k))
    monkeypatch.setattr(ddm.Body, "solve", lambda self, *a, **k: solved.append(0) or solve(self, *a, **k))
    plate = np.array([[-0.05, -0.05], [0.05, -0.05], [0.05, 0.05], [-0.05, 0.05]])
    lines = [np.array([[-0.01, -0.006], [0.0, 0.0]]), np.array([[0.012, 0.006], [0.025, 0.008]])]
    load = ddm.BodyLoad(sides={0: (0.0, -1e6), 2: (0.0, 1e6)})
    growth = GrowthSettings(increment=5e-4, min_increment=1.25e-4)
    cracks = Cracks.from_polylines(lines, aperture=np.inf)
    steps = list(ddm.propagate([plate], cracks, ROCK, load, growth, control="toughness", max_steps=16))
    assert len(steps) == 16 and all((step.tips["k_ii"][step.tips["grown"] > 0] != 0).all() for step in steps)
    assert len(made) <= 23
    assert len(solved) == len(made)


@pytest.mark.parametrize("law", [None, JointLaw("rough", friction_angle=0.4)])
def test_every_step_meets_a_target_error(law):
    """Open slots and a rough crack: meshes of other orders on the way, whose faces begin without or with their memory."""
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
    lines = [np.array([[-0.1, -0.1], [0.1, 0.1]]), np.array([[0.2, -0.05], [0.4, 0.1]])]
    cracks = Cracks.from_polylines(lines[:1] if law else lines)
    load = ddm.BodyLoad(remote_stress=[-1e4, -1e6, 0] if law else [0, 1e6, 0])
    growth = GrowthSettings(increment=0.02)
    more = {} if law is None else {"face_laws": [law]}
    steps = ddm.propagate(
        [square], cracks, Material("rock", 17e9, 0.21, k_ic=1e6), load, growth, settings=DdmSettings(target_error=1e-3),
        control="toughness", max_steps=2, **more,
    )  # fmt: skip
    for step in steps:
        k = np.hypot(step.solution.tips["k_i"], step.solution.tips["k_ii"]).max()
        assert step.solution.tip_errors.max() <= 1e-3 * k and step.growth is not None
