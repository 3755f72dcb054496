"""The rule for chords, on a model of what a crack asks for at the end of a step."""

import numpy as np
import pytest

from geomech.ddm.growth.path_correction import TOLERANCE, TRIALS, Chords, Remembered
from geomech.model import TIP, Cracks


def chosen(ask, start_deg: float, memory=None) -> tuple[float, int]:
    """The chord's angle, degrees, when the criterion asks ``start_deg`` at the start of the step and ``ask(θ)`` at the
    end of one along θ, and how many looks ahead that took; ``memory`` is of the last step."""
    tips = np.zeros(1, TIP)
    tips["angle"] = np.radians(start_deg)
    return stepped(tips, ask, memory)[:2]


def stepped(tips, ask, memory) -> tuple[float, int, Remembered]:
    """`chosen`, and what the step has told for the next one."""
    chords = Chords(tips, None if memory is None else {(0.0, 0.0): memory})
    tips["angle"] = chords.first
    look = 0
    while look < TRIALS:
        look += 1
        angle = float(tips["angle"][0])
        ends = np.array([[-1.0, 0.0], [0.0, 0.0], [np.cos(angle), np.sin(angle)]])
        grown = Cracks(
            nodes=ends,
            segments=np.array([[0, 1], [1, 2]]),
            crack=np.zeros(2, int),
            block=np.zeros(2, int),
            birth_cycle=np.array([0, 7]),
            aperture=np.zeros(2),
            surface=np.zeros(3, bool),
        )
        ahead = np.zeros(1, TIP)
        ahead["node"], ahead["angle"] = 2, np.radians(ask(np.degrees(angle)))
        if chords.bend(tips, np.ones(1), ahead, grown, 7):
            break
    told = Remembered(
        *(float(a[0]) for a in (chords.kappa, tips["angle"], chords.last_angle, chords.last_turns, chords.start))
    )
    return float(np.degrees(tips["angle"][0])), look, told


def test_chord_of_an_arc_has_half_its_turn():
    """An arc that turns by 8 degrees a step: whichever way the step went, its end asks for the arc's own direction."""
    # Under way: the last chord pointed half a turn before the tip.
    angle, looks = chosen(lambda theta: 12.0 - theta, 4.0)
    assert angle == pytest.approx(8.0, abs=1e-12)
    assert looks == 1
    # Out of a straight line, a turn from nothing may be that of a stiff path: a second look tells.
    angle, looks = chosen(lambda theta: 8.0 - theta, 0.0)
    assert angle == pytest.approx(4.0, abs=1e-12)
    assert looks == 2


def test_chord_out_of_a_kink_has_two_thirds_of_the_rest():
    """y ∝ x^(3/2): slope at the end 3/2 of the chord's (Amestoy & Leblond 1992)."""
    angle, looks = chosen(lambda theta: 76.0 - theta, 70.0)
    assert angle == pytest.approx(74.0, abs=1e-12)
    assert looks == 1


@pytest.mark.parametrize("stiffness", [0.5, 2.0, 5.0, 20.0])
@pytest.mark.parametrize("start", [3.0, -10.0, 40.0])
def test_compression_along_the_crack_does_not_throw_the_path_about(start, stiffness):
    """A straight path along a strong compression, left by a disturbance: the end of a step along θ asks for
    start − (1 + κ) θ. The condition s (θ − start + a) = θ − start then has the solution start/(1 + s κ), and what is
    asked for next shrinks for every κ, where a single correction lets it stand for κ = 2 and grow above; from κ = 2 on,
    with s = 1 − 1/κ of the turn, to 1/κ of it at most. One look is enough where it finds less than the tolerance."""
    angle, looks = chosen(lambda theta: start - (1 + stiffness) * theta, start)
    share = max(2 / 3 if abs(start) > 20 else 1 / 2, 1 - 1 / stiffness)
    solution = start / (1 + stiffness * share)
    assert abs(angle - solution) < np.degrees(TOLERANCE) / (1 + stiffness * share) + 1e-9 or looks == 1
    after = start - (1 + stiffness) * angle
    assert abs(after) < abs(start) * (1 if stiffness <= 2 else 1 / stiffness + 1e-9) or looks == 1


def test_an_arc_goes_on_as_it_went():
    """Of an arc that turned by 8 degrees from chord to chord the first trial is the next chord itself."""
    angle, looks = chosen(lambda theta: 12.0 - theta, 4.0, Remembered(0.0, *np.radians([8.0, 8.0, 4.0, 4.0])))
    assert angle == pytest.approx(8.0, abs=1e-12)
    assert looks == 1


def test_a_small_kink_is_not_gone_on_with():
    """A path leaves a straight crack at 6.5 degrees and goes on straight; nothing has told κ yet. What the second step
    leaves is within the tolerance (a trial with the kink's turn, judged as one along the tangent, left three times
    as much)."""
    memory = Remembered(np.nan, *np.radians([-6.4, -6.5, 0.2, -6.5]))
    angle, looks = chosen(lambda theta: 0.1 - 1.1 * theta, 0.1, memory)
    assert abs(0.1 - 1.1 * angle) < np.degrees(TOLERANCE) and looks == 1


@pytest.mark.parametrize(("began", "last", "start"), [(2.0, 4.0, 2.0), (-1.0, 2.0, 1.5), (4.0, -2.0, 1.0)])
def test_the_first_trial_turns_as_the_last_step_did(began, last, start):
    """The last chord left the tangent at its start, at ``began``, by ``last`` - began, and the tangent at its end turned
    on by ``start``; half of that again. A trial that a look would correct by less than a quarter of a degree is the
    step, as it was tried."""
    memory = Remembered(5.0, *np.radians([last, last, 0.0, began]))
    tried, turn = [], start - began + last
    off = 0.2  # by which the condition holds beside the trial

    def ask(theta):
        tried.append(theta)
        share = 1 - 1 / 5.0
        best = start + turn / 2 + off
        return (best - start) * (1 - share) / share - 6.0 * (theta - best)

    angle, looks = chosen(ask, start, memory)
    assert tried == [pytest.approx(start + turn / 2)] and looks == 1
    assert angle == tried[0]
    off = 0.3
    angle, looks = chosen(ask, start, memory)
    assert looks == 1 and angle == pytest.approx(start + turn / 2 + off)


@pytest.mark.parametrize("stiffness", [0.5, 2.0, 5.0, 20.0])
@pytest.mark.parametrize("curve", [0.0, 3.0])
def test_a_remembered_slope_spares_looks(stiffness, curve):
    """A step along θ ends with start + curve − (1 + κ) θ asked for, and κ is off by a tenth since the last step: by
    what the last chord ended with, or by what was found then, one look leaves less than the tolerance."""
    start, before = 2.0, 1.1 * stiffness

    def ask(theta):
        return start + curve - (1 + stiffness) * theta

    share = max(1 / 2, 1 - 1 / before)
    solution = (start + share * curve) / (1 + share * stiffness)
    last = solution + 1.0 / (1 + stiffness)
    trial, began = last - 1.0, 3 * start - last  # so that the first trial is as the last chord
    told = Remembered(0.0, *np.radians([last, trial, start + (1 + before) * (last - trial), began]))
    found = Remembered(before, *np.radians([last, last, start, began]))
    for memory in (told, found):
        angle, looks = chosen(ask, start, memory)
        assert looks == 1
        assert stiffness < 5 or chosen(ask, start)[1] > 1
        assert abs(angle - solution) < np.degrees(TOLERANCE) / (1 + share * stiffness)


def test_what_has_changed_is_looked_at_again():
    """Faces close: the last step's slope would leave several degrees."""
    memory = Remembered(1.0, *np.radians([1.0, 1.0, 2.0, 4.0]))
    angle, looks = chosen(lambda theta: -40.0 - 6.0 * theta, 2.0, memory)
    assert looks > 1
    assert chosen(lambda theta: -40.0 - 6.0 * theta, 2.0)[0] == pytest.approx(angle, abs=0.3)


@pytest.mark.parametrize("turn", [0.1, 0.4, 3.0])
def test_chords_of_an_arc_do_not_lag_however_little_it_turns(turn):
    """An arc of so many degrees a step, in whose direction the criterion always asks for: chords lie half a turn before
    the tangents at their ends. Steps so fine that no trial is worth a correction must not stay along the tangents."""
    memory, heading, lags = None, 0.0, []
    for n in range(8):
        start = n * turn - heading

        def ask(theta, n=n, heading=heading):
            return (n + 1) * turn - heading - theta

        tips = np.zeros(1, TIP)
        tips["angle"] = np.radians(start)
        angle, _, memory = stepped(tips, ask, memory)
        heading += angle
        lags.append(heading - (n + 0.5) * turn)
    assert np.abs(lags[3:]).max() < 0.1 * turn
