"""What stress intensity factors cannot exceed, against solutions under random loads in equilibrium."""

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.fracture.sif_bound import MARGIN, TipBound, is_bounded, largest_k_eq_per_k
from geomech.ddm.loads.body_loads import resultants
from geomech.model import Cracks, DdmSettings, Material

ROCK = Material("rock", 10e9, 0.25, k_ic=1e6)
OUTLINE = np.array([[0.0, 0.0], [2.0, 0.0], [2.3, 1.1], [1.2, 1.6], [0.0, 1.5]])
LINES = [np.array([[0.9, 0.5], [1.3, 0.8], [1.6, 0.8]]), np.array([[0.0, 1.1], [0.5, 1.2]])]


@pytest.fixture(scope="module")
def body():
    cracks = Cracks.from_polylines(LINES, block=0, aperture=np.inf, surface=[(False, False), (True, False)])
    return ddm.Body([OUTLINE], cracks, ROCK, DdmSettings())


def balanced(body, segments, tractions, gradient=0.0, remote=None):
    """The load with the body force that keeps it in equilibrium, besides a symmetric ``gradient``."""
    force, moment, _ = resultants(segments, tractions, body.centroid)
    second = body._second
    sym = gradient * np.array([[1.0, 0.3], [0.3, -0.5]])
    moment += (second @ sym)[0, 1] - (second @ sym)[1, 0]
    turn = moment / np.trace(second)
    return ddm.BodyLoad(
        segments=segments, tractions=tractions, body_force=-force / body.area,
        body_force_gradient=sym + np.array([[0.0, turn], [-turn, 0.0]]), about=body.centroid, remote_stress=remote,
    )  # fmt: skip


def pieces(rng, many):
    """Short and long pieces of the outline, some at its corners and beside the crack's mouth."""
    edge = rng.integers(0, 5, many)
    a, b = OUTLINE[edge], OUTLINE[(edge + 1) % 5]
    low = rng.choice([0.0, 0.26, 0.3], many) * rng.integers(0, 2, many) + rng.uniform(0, 0.4, many) * rng.integers(
        0, 2, many
    )
    high = np.minimum(low + 10.0 ** rng.uniform(-3, 0, many), 1.0)
    return np.stack([a + low[:, None] * (b - a), a + high[:, None] * (b - a)], axis=1)


def test_no_load_brings_more(body):
    """Of 300 loads none exceeds the bound, of a few pieces or many, bent or even; one force at the worst place comes as
    near to it as the margin lets it."""
    rng, bound, nearest = np.random.default_rng(5), TipBound(body), 0.0
    for _ in range(300):
        segments = pieces(rng, int(rng.integers(1, 5)))
        tractions = rng.normal(size=segments.shape) * 1e6
        remote = rng.normal(size=3) * 1e5 if rng.uniform() < 0.3 else None
        load = balanced(body, segments, tractions, rng.choice([0.0, 1e5]), remote)
        tips = body.solve(load, equilibrium_tolerance=1e-9).tips
        k, most = np.hypot(tips["k_i"], tips["k_ii"]), bound.at_most(load)
        assert (k <= most).all()
        if remote is None and not load.body_force_gradient.trace():
            nearest = max(nearest, (k / most).max())
    assert 0.5 / MARGIN < nearest < 1.02 / MARGIN


def test_even_stress_and_inertia_are_exact(body):
    """Without tractions the bound is K itself: of an even stress, and of a centrifugal force with the even stress that
    balances it at the outline in the mean."""
    bound, none = TipBound(body), np.zeros((0, 2, 2))
    load = ddm.BodyLoad(
        segments=none, tractions=none, body_force_gradient=np.zeros((2, 2)), remote_stress=[1e6, -3e5, 2e5]
    )
    tips = body.solve(load).tips
    assert bound.at_most(load) == pytest.approx(np.hypot(tips["k_i"], tips["k_ii"]), rel=1e-9)
    spin = ddm.BodyLoad(segments=none, tractions=none, body_force_gradient=1e4 * np.eye(2), about=body.centroid)
    tips = body.solve(spin).tips
    assert bound.at_most(spin) == pytest.approx(np.hypot(tips["k_i"], tips["k_ii"]), rel=1e-9)


def test_what_meets_is_not_bounded():
    closed = Cracks.from_polylines(LINES, block=0, aperture=0.0, surface=[(False, False), (True, False)])
    assert not is_bounded(ddm.Body([OUTLINE], closed, ROCK, DdmSettings()))


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("criterion", sorted(ddm.criteria.CRITERIA))
def test_no_mixture_drives_harder(criterion):
    """K_eq of any mixture of modes is no more than the bound times its size."""
    rng = np.random.default_rng(1)
    k_i, k_ii = rng.normal(size=(2, 2000)) * 1e6
    material = Material("rock", 10e9, 0.25, k_ic=1e6, k_iic=6e5)
    _, k_eq = ddm.criteria.CRITERIA[criterion](k_i, k_ii, material)
    part = k_eq / (largest_k_eq_per_k(criterion, material) * np.hypot(k_i, k_ii))
    assert 0.95 < part.max() <= 1.0
