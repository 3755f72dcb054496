"""Functions of time: values, exact integrals, records from files and what is wrong with them."""

import numpy as np
import pytest

from geomech.model import History, baseline_corrected, read_record


def quadrature(f, end, n=20_000):
    """∫ and ∬ from 0 by the trapezoidal rule."""
    t = np.linspace(0.0, end, n + 1)
    v = np.array([f(x)[0] for x in t])
    once = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))])
    return once[-1], float(np.sum(0.5 * (once[1:] + once[:-1]) * np.diff(t)))


@pytest.mark.parametrize(
    "history",
    [
        History.constant([2.0]),
        History.ramp([3.0], start=0.7),
        History.table([-1.0, 0.5, 1.25, 3.0], [1.0, -2.0, 4.0, 0.5]),
        History.table([0.5, 1.0], [1.0, 2.0]),
        History.sinusoid([1.5], 0.8, phase=0.4, start=0.3, end=1.6, mean=[0.2]),
    ],
    ids=["constant", "ramp", "table", "late table", "sinusoid"],
)
@pytest.mark.parametrize("end", [0.4, 1.1, 2.4])
def test_integrals_are_those_of_the_function(history, end):
    once, twice = quadrature(history.at, end)
    # Trapezoids of 1e-4 s: second order, and first at a jump of the sinusoid's ends.
    assert history.integral(end)[0] == pytest.approx(once, abs=2e-4)
    assert history.double_integral(end)[0] == pytest.approx(twice, abs=2e-4)
    assert history.integral(0.0)[0] == history.double_integral(0.0)[0] == 0.0


def test_a_ramp_and_a_constant_have_their_closed_integrals():
    assert History.constant([2.0]).double_integral(3.0)[0] == pytest.approx(9.0, rel=1e-15)
    assert History.ramp([6.0], start=1.0).double_integral(3.0)[0] == pytest.approx(8.0, rel=1e-15)
    once = History.sinusoid([2.0], 0.5).integral(1.0)[0]
    assert once == pytest.approx(2 * 2 / np.pi, rel=1e-15)  # half a period of 2 sin(πt)


def test_scaling_reaches_every_part():
    history = History(
        np.array([0.0, 1.0]), np.array([[1.0], [2.0]]), np.array([0.5]), History.sinusoid([3.0], 1.0).wave
    )
    for time in (0.3, 2.2):
        assert history.scaled(-2.0).at(time) == pytest.approx(-2 * history.at(time))


def test_a_record_is_read_in_its_units(tmp_path):
    path = tmp_path / "quake.csv"
    path.write_text("# a record\ntime (ms), acceleration [g]\n0, 0\n\n500, 0.1  # peak\n1000, 0\n")
    times, values = read_record(path)
    assert times.tolist() == [0.0, 0.5, 1.0]
    assert values[:, 0] == pytest.approx([0.0, 0.980665, 0.0])
    plain = tmp_path / "plain.txt"
    plain.write_text("0 1.0 2.0\n1 3.0 4.0\n")
    assert History.from_file(plain, 2).at(0.5).tolist() == [2.0, 3.0]
    assert History.from_file(path, 1, scale=(1.0, -0.5)).at(0.5) == pytest.approx([0.980665, -0.4903325])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time [s], a [furlong]\n0, 1\n", r"quake.csv:1: column 2 is in 'furlong'"),
        ("time [m], a [g]\n0, 1\n", r"quake.csv:1: column 1 is in 'm'.*times are s, ms"),
        ("0, 1\n1, 2, 3\n", r"quake.csv:2: 3 column\(s\), expected 2"),
        ("0\n", r"quake.csv:1: 1 column\(s\), expected 2"),
        ("0, 1\n\n1, x\n", r"quake.csv:3: 'x' is not a finite number"),
        ("0, 1\n1, nan\n", r"quake.csv:2: 'nan' is not a finite number"),
        ("0, 1\n0.5, 1\n0.5, 2\n", r"quake.csv:3: time 0.5 is not later than 0.5 in line 2"),
        ("# nothing\n", r"quake.csv: no line has numbers"),
        ("time, a, b\n0, 1\n", r"quake.csv:2: 2 column\(s\), expected 3"),
    ],
)
def test_a_faulty_record_is_refused_by_its_line(tmp_path, text, message):
    path = tmp_path / "quake.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        read_record(path)


def test_the_wrong_number_of_components_is_refused(tmp_path):
    path = tmp_path / "quake.csv"
    path.write_text("0, 1\n1, 2\n")
    with pytest.raises(ValueError, match=r"1 column.*expected 2"):
        History.from_file(path, 2)
    with pytest.raises(ValueError, match="increase: 0 s follows 1 s"):
        History.table([1.0, 0.0], [0.0, 0.0])
    with pytest.raises(ValueError, match="positive frequency"):
        History.sinusoid([1.0], 0.0)


@pytest.mark.parametrize("degree", [0, 1, 2])
def test_a_baseline_that_is_a_polynomial_is_taken_off_whole(degree):
    times = np.linspace(0.0, 10.0, 401)
    quake = np.sin(2 * np.pi * times) * np.sin(np.pi * times / 10) ** 2
    drift = sum((0.1 + 0.05 * k) * (times / 10) ** k for k in range(degree + 1))
    clean, drifting = History.table(times, quake), History.table(times, quake + drift)
    found = baseline_corrected(drifting, degree)
    again = baseline_corrected(clean, degree)
    # Chords of the quadratic's velocity are a second-order approximation, 401 times.
    assert found.values == pytest.approx(again.values, abs=1e-12 if degree < 2 else 1e-5)
    assert abs(found.integral(10.0)[0]) < 0.01 * abs(drifting.integral(10.0)[0])


def test_what_changes_within_an_interval_is_not_steady():
    table = History.table([0.0, 1.0, 2.0, 3.0], [0.0, 5.0, 5.0, 0.0])
    begun_and_ended = [(-2.0, 0.0, True), (0.0, 0.5, False), (1.0, 2.0, True), (0.5, 2.5, False), (3.0, 9.0, True)]
    for begin, end, steady in begun_and_ended:
        assert table.is_steady(begin, end) is steady
    assert History.ramp([1.0], start=2.0).is_steady(0.0, 2.0) and not History.ramp([1.0], start=2.0).is_steady(0.0, 2.1)
    wave = History.sinusoid([1.0], 2.0, start=1.0, end=2.0)
    # Equal at both ends and half-way, and not steady.
    assert wave.is_steady(0.0, 1.0) and wave.is_steady(2.0, 3.0) and not wave.is_steady(1.0, 2.0)
