"""What `geomech bench ddm` compares with must itself be right: constant elements and finite elements on known
problems."""

import numpy as np
import pytest

from geomech.bench.accuracy import (
    crack_accuracy,
    crack_problems,
    growth_paths,
    precision_table,
    work_precision,
)
from geomech.bench.accuracy.precision_table import Point, extrapolated, own_time, time_to
from geomech.bench.cost import growth_cost
from geomech.bench.peers import constant_elements, finite_elements
from geomech.model import DdmSettings
from geomech.render.benchmarks.work_precision import draw

without_scikit_fem = pytest.mark.skipif(not finite_elements.available(), reason="scikit-fem is not installed")


def test_the_table_of_accuracy_is_as_right_as_it_says():
    """Default settings: 6e-4 at a kink, whose corner has two layers of grading; 1e-4 everywhere else."""
    for case, found, exact, _ in crack_accuracy.rows():
        error = abs(found / exact - 1) if exact else abs(found)
        assert error < (1e-3 if "kink" in case or "the same: K_II" in case else 1.2e-4), case


def test_constant_elements_are_of_first_order():
    """Calibrated by √(2/π) the tip element gives K with an error of 1/8N: exactly first order (Griffith crack)."""
    problem, sizes = crack_problems.griffith(), np.array([16, 64, 256])
    errors = [problem.error(constant_elements.stress_intensity(problem, n, 0)[1]) for n in sizes]
    orders = -np.diff(np.log(errors)) / np.log(4)
    print("constant elements, calibrated:", errors, "observed orders", orders)
    assert np.allclose(orders, 1, atol=0.02) and errors[-1] == pytest.approx(1 / (8 * 256), rel=0.02)


def test_constant_elements_in_a_body():
    """The specimen by constant elements on its outline too: 2 % with 32 elements a crack, all signs right."""
    problem = crack_problems.with_reference(crack_problems.specimen())
    fitted, calibrated, _ = constant_elements.stress_intensity(problem, 32, 64)
    assert problem.error(calibrated) < 0.02 and problem.error(fitted) < 0.3


def test_an_arc_of_tangents_is_followed_with_second_order_or_better():
    sizes, errors = np.array([8, 16, 32]), []
    for n in sizes:
        problem = crack_problems.arc_of_tangents(n)
        solution = problem.solve(DdmSettings(elements_per_crack=1))
        errors.append(problem.error(crack_problems.factors(solution)))
    orders = -np.diff(np.log(errors)) / np.log(2)
    print("arc of tangents:", errors, "observed orders", orders)
    assert orders.min() > 1.9 and errors[-1] < 1e-4


@without_scikit_fem
@pytest.mark.parametrize(
    ("make", "errors"),
    [
        (crack_problems.griffith, (1e-3, 1e-4)),
        (None, (2e-3, 6e-4)),
        (crack_problems.edge_crack, (8e-3, 1e-3)),
        (crack_problems.specimen, (6e-4, 1e-4)),
    ],
)
def test_finite_elements_agree(make, errors):
    """A method that shares nothing with ours comes near both K of every tip, and nearer when it is refined: Griffith
    and the arc against their closed forms, bodies against this solver."""
    problem = crack_problems.with_reference(make()) if make else None
    exact = problem or crack_problems.arc_of_chords(1)
    run = finite_elements.solver(problem)
    found = [exact.error(run(refinement)[0]) for refinement in (1, 3)]
    print("finite elements:", exact.name, found)
    assert found[0] < errors[0] and found[1] < errors[1]


@without_scikit_fem
def test_interaction_integrals_do_not_depend_on_their_disc():
    """As conservation has it; of the arc too, whose curved faces have a share: 6e-3 of K_II is theirs."""
    radii = (0.15, 0.3, 0.5)
    found = np.array([finite_elements._arc(4, disc=radius)[0] for radius in radii])
    assert np.ptp(found, axis=0).max() < 2e-4 * np.abs(found).max()


def test_growth_by_increments_gives_what_fresh_bodies_give():
    """1e-12: the matrices are the same, what differs is how they were put together."""
    found = growth_cost.measure(12)
    assert found["difference"] < 1e-12


@pytest.mark.slow
def test_corrected_steps_come_to_the_path_of_uncorrected_ones_much_sooner():
    """Hooking edge cracks: the reference is what steps along the tangent, a method of first order, tend to. Corrected
    ones are nearer with 10 increments than those with 40, and with 40 (where what a chord may be off by counts) by a
    factor of ten."""
    reference = growth_paths.reference(40, 2)
    settings = DdmSettings(order=2)
    straight = [max(growth_paths.of_this_solver(n, settings, False).errors(reference)) for n in (10, 40)]
    bent = [max(growth_paths.of_this_solver(n, settings).errors(reference)) for n in (10, 40)]
    print("growth run of 10 and 40 increments:", straight, bent)
    assert np.log(straight[0] / straight[1]) / np.log(4) == pytest.approx(1, abs=0.1)
    assert bent[0] < straight[1] / 2 and bent[1] < straight[1] / 10


@without_scikit_fem
def test_finite_elements_grow_along_the_same_path():
    """The same steps along the tangent with K from either method: 5 increments, the tips 6 µm apart at most, of 20 mm
    grown, and loads within 0.3 %."""
    path, load = growth_paths.of_finite_elements(5).errors(growth_paths.of_this_solver(5, DdmSettings(), False))
    print("growth run, finite elements against this solver:", path, load)
    assert path < 3e-4 and load < 3e-3


def test_quadratic_elements_grow_along_the_same_path():
    """The same ten steps along the tangent: within half a hundredth."""
    exact = growth_paths.of_this_solver(10, DdmSettings(), False)
    assert max(growth_paths.of_quadratic_elements(10).errors(exact)) < 5e-3


@pytest.mark.slow
def test_constant_elements_grow_along_the_same_path_roughly():
    """K of coarse constant elements in a body is off by a tenth, their directions by less; both get nearer."""
    found = []
    for n in (20, 40):
        exact = growth_paths.of_this_solver(n, DdmSettings(), False)
        found.append(growth_paths.of_constant_elements(n).errors(exact))
    (path, load), (finer_path, finer_load) = found
    assert path < 0.01 and load < 0.05 and finer_path < path and finer_load < 0.7 * load


def test_time_to_an_error_is_interpolated_and_not_guessed():
    points = [Point("a", "m", n, n, 1.0 / n, 1e-3 * n) for n in (1, 10, 100)]
    assert time_to(points, "a", "m", 1.0 / 31.6227766) == pytest.approx(31.6227766e-3)
    assert time_to(points, "a", "m", 1e-3) is None
    assert time_to(points, "a", "other", 1e-3) is None


def test_what_is_not_reached_is_extrapolated_in_the_other_method_s_favour():
    """First order in the unknowns, time with their cube: time is taken to go on with the unknowns alone."""
    points = [Point("a", "m", n, n, 1.0 / n, 1e-9 * n**3) for n in (100, 200)]
    assert extrapolated(points, "a", "m", 1e-4) == pytest.approx(points[-1].seconds * 50)
    points += [Point("a", "m", 400, 400, 1.0 / 201, 1.0)]
    assert extrapolated(points, "a", "m", 1e-4) is None
    own = [Point("a", precision_table.OURS, p, 1, 10.0**-p, 1e-3 * p) for p in (3, 5)]
    own += [Point("a", precision_table.ASKED, d, 1, 1e-5, 2e-3) for d in (4, 5)]
    assert own_time(own, "a", 1e-4) == pytest.approx(2e-3) and own_time(own, "a", 1e-9) is None


def test_table_and_picture(tmp_path):
    """From made-up curves: a method that gets there has a ratio, one that does not the time it was given."""
    growth = dict.fromkeys(("increments", "elements_at_the_end", "factorisations"), 1)
    growth |= dict.fromkeys(("incremental_s", "fresh_s", "all_incremental_s", "all_fresh_s", "difference"), 1.0)
    points = []
    for name in work_precision.PROBLEMS:
        points += [Point(name, precision_table.OURS, p, 10 * p, 10.0 ** (-p), 1e-3) for p in range(2, 11)]
        points += [Point(name, precision_table.ASKED, p, 10 * p, 10.0 ** (-p), 1e-3) for p in range(2, 9)]
        points += [Point(name, precision_table.CALIBRATED, n, 2 * n, 0.1 / n, 1e-3 * n) for n in (10, 1000, 10000)]
        points += [Point(name, precision_table.QUADRATIC, n, 2 * n, 1e-3, 1e-3 * n) for n in (10, 500)]
    for order in (2, 4):
        for n in (10, 40):
            told = {"curve": f"p = {order}", "parts": (0.01 / n, 0.02 / n)}
            points.append(
                Point(growth_paths.PROBLEM, precision_table.OURS, n, 90 * n, 0.02 / n, 1e-3 * n * order, **told)
            )
    points += [Point(growth_paths.PROBLEM, precision_table.FEM, n, 900 * n, 0.06 / n, 1e-2 * n) for n in (10, 40)]
    goals = precision_table.goals_of(points)
    rows = {row["method"]: row for row in goals["time at one error over this solver's"]}
    assert rows[precision_table.CALIBRATED]["reached"] and rows[precision_table.CALIBRATED]["ratio"] == pytest.approx(
        1000
    )
    assert not rows[precision_table.QUADRATIC]["reached"] and rows[precision_table.QUADRATIC]["ratio"] == pytest.approx(
        500
    )
    text = precision_table.table(points, growth, goals)
    assert "500  with an error of 1e-03; its error does not decrease" in text
    # Growth is compared at an error of its own, with the quickest of this solver's curves.
    grown = [row for row in goals["time at one error over this solver's"] if row["problem"] == growth_paths.PROBLEM]
    assert [row["method"] for row in grown] == [precision_table.FEM] and grown[0]["reached"]
    assert grown[0]["ratio"] == pytest.approx(0.2 / 0.02, rel=1e-9)
    assert "this solver, p = 4 " in text and "(path 2.5e-04, load 5.0e-04)" in text
    assert points[-3].name == f"{growth_paths.PROBLEM}, this solver, p = 4: 40"
    path = draw(points, precision_table.METHODS, tmp_path / "picture.png")
    assert path.read_bytes().startswith(b"\x89PNG")
