"""The line search between crack strain and stress of a block, on laws for which Newton's method alone runs in a circle."""

from __future__ import annotations

import numpy as np
import pytest

from geomech.coupling.crack_compliance.line_search import Linearised, LineSearch

#: Compliance of the rest of the block.
REST = np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.2], [0.0, 0.2, 1.5]])


def cracks(stress: np.ndarray, soft: float, stiff: float, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Strain and compliance of three independent cracks, ``soft`` until they close at ±``reach``, ``stiff`` beyond."""
    inside = np.abs(stress) < reach
    strain = np.where(
        inside, soft * stress, np.sign(stress) * soft * reach + stiff * (stress - np.sign(stress) * reach)
    )
    return strain, np.diag(np.where(inside, soft, stiff))


def iterate(
    load: np.ndarray, law: tuple, start: np.ndarray, search: LineSearch | None
) -> tuple[np.ndarray, list[float]]:
    """Solve REST σ + ε_c(σ) = ``load`` as a pass does; the stress, and the strain left over in each iteration."""
    strain, compliance = cracks(start, *law)
    at = Linearised(start, strain, compliance, np.zeros(3))
    left = []
    for _ in range(20):
        stress = np.linalg.solve(REST + at.compliance, load - at.strain + at.compliance @ at.stress)
        assumed = at.strain + at.compliance @ (stress - at.stress)
        strain, compliance = cracks(stress, *law)
        at = Linearised(stress, strain, compliance, strain - assumed)
        left.append(float(np.abs(at.left).max()))
        if left[-1] < 1e-12:
            break
        if search is not None:
            at = search.next(7, at, assumed, lambda stress: cracks(stress, *law))
    return stress, left


@pytest.mark.parametrize("seed", range(6))
def test_it_ends_where_newton_alone_runs_in_a_circle(seed):
    """The solution is that of the equation, and it is found in a dozen iterations from any start."""
    rng = np.random.default_rng(seed)
    law, load, start = (200.0, 0.01, 0.1), rng.normal(0, 1.0, 3), rng.normal(0, 5.0, 3)
    stress, left = iterate(load, law, start, LineSearch())
    assert left[-1] < 1e-12 and len(left) <= 12
    assert REST @ stress + cracks(stress, *law)[0] == pytest.approx(load, abs=1e-10)


def test_newton_alone_runs_in_a_circle_on_these():
    """What the test above holds the search against: of six starts, some never end without it."""
    ends = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        law, load, start = (200.0, 0.01, 0.1), rng.normal(0, 1.0, 3), rng.normal(0, 5.0, 3)
        ends.append(iterate(load, law, start, None)[1][-1])
    assert sum(end > 0.1 for end in ends) >= 2


def test_a_full_step_that_is_right_is_left_alone():
    """No other stress is asked for on a law that is linear."""

    def never(stress):
        raise AssertionError("solved again")

    search, compliance = LineSearch(), np.diag([3.0, 2.0, 1.0])
    first = Linearised(np.zeros(3), np.zeros(3), compliance, np.array([-1.0, 0.0, 0.0]))
    assert search.next(0, first, np.array([1.0, 0.0, 0.0]), never) is first
    stress = np.array([0.2, 0.0, 0.0])
    reached = Linearised(stress, compliance @ stress, compliance, np.zeros(3))
    assert search.next(0, reached, compliance @ stress, never) is reached
