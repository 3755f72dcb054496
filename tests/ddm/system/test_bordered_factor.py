"""Factors of a growing matrix against those of the whole matrix."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm import Body, BodyLoad, Reuse
from geomech.ddm.counters import Work
from geomech.ddm.system.boundary_system import OFTEN
from geomech.ddm.system.row_store import KeptRows
from geomech.model import Cracks, DdmSettings, GrowthSettings, Material

ROCK = Material("rock", 10e9, 0.25)
PLATE = np.array([[-4.0, -3.0], [4.0, -3.0], [4.0, 3.0], [-4.0, 3.0]])
LOAD = BodyLoad(sides={0: (0.0, -1e6), 2: (0.0, 1e6)})
SEGMENT_ARRAYS = ("crack", "block", "birth_cycle", "aperture", "law")
SETTINGS = DdmSettings(elements_per_crack=8)


def network(steps: int, turn: float = 0.0) -> Cracks:
    """Two slanted cracks, one of them grown by ``steps`` at its right tip, the last of which is bent by ``turn``."""
    at, line = np.array([-1.0, -0.4]), []
    for k in range(steps):
        heading = 0.9 + 0.05 * k + (turn if k == steps - 1 else 0.0)
        at = at + 0.15 * np.array([math.cos(heading), math.sin(heading)])
        line.append(at)
    first = np.array([[-2.5, -1.0], [-1.0, -0.4], *line])
    lines = [first, np.array([[1.5, 0.2], [3.5, -0.6]])]
    birth = np.r_[0, np.arange(1, steps + 1), 0]
    cracks = Cracks.from_polylines(lines, aperture=math.inf)
    return replace(cracks, birth_cycle=birth)


def factors(body: Body) -> np.ndarray:
    tips = body.solve(LOAD).tips
    return np.stack([tips["k_i"], tips["k_ii"]])


def test_factors_solve_both_ways_and_multiply():
    """Every step is tried, bent, and taken again, as growth does: elements come and go. Round-off alone is allowed."""
    rng = np.random.default_rng(3)
    body = Body([PLATE], network(0), ROCK, SETTINGS)
    factors(body)
    for steps in range(1, 7):
        for turn in (0.0, 0.3, 0.1, 0.0):
            body = Body([PLATE], network(steps, turn), ROCK, SETTINGS, reuse=Reuse(body))
        alone = Body([PLATE], network(steps), ROCK, SETTINGS)
        whole = alone.crack_system.matrix.dense
        matrix = body.crack_system.matrix
        assert not matrix.is_whole
        np.testing.assert_allclose(matrix.dense, whole, rtol=0, atol=1e-13 * np.abs(whole).max())
        for shape in ((len(whole),), (len(whole), 3)):
            right = rng.normal(size=shape)
            np.testing.assert_allclose(matrix @ right, whole @ right, rtol=0, atol=1e-12 * np.abs(whole @ right).max())
            for transposed in (False, True):
                expected = np.linalg.solve(whole.T if transposed else whole, right)
                found = body.crack_system.open_factor.solve(right, transposed)
                np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
        k = factors(alone)
        assert np.abs(factors(body) - k).max() < 1e-12 * np.abs(k).max()


def test_a_long_run_is_factored_anew_now_and_then_only():
    body = Body([PLATE], network(0), ROCK, SETTINGS)
    factors(body)
    for steps in range(1, 21):
        body = Body([PLATE], network(steps), ROCK, SETTINGS, reuse=Reuse(body, body.work))
        k = factors(body)
    alone = factors(Body([PLATE], network(20), ROCK, SETTINGS))
    assert np.abs(k - alone).max() < 1e-11 * np.abs(alone).max()
    assert body.work.crack_factorisations <= 3
    assert body.work.crack_borderings >= 18


def test_bodies_that_grow_apart_keep_their_own():
    """From one body three ways on, the second of which bends the step that the first had settled: each has its own
    matrix and factors, whoever came before."""
    first = Body([PLATE], network(3), ROCK, SETTINGS, reuse=Reuse(Body([PLATE], network(0), ROCK, SETTINGS)))
    factors(first)
    ways = [network(5), network(4, 0.3), network(4)]
    for _ in range(2):
        bodies = [Body([PLATE], way, ROCK, SETTINGS, reuse=Reuse(first)) for way in ways]
        second = Body([PLATE], network(6), ROCK, SETTINGS, reuse=Reuse(bodies[1]))
        for body, way in zip([*bodies, second, first], [*ways, network(6), network(3)]):
            again = pickle.loads(pickle.dumps(body))
            alone = factors(Body([PLATE], way, ROCK, SETTINGS))
            assert not body.crack_system.matrix.is_whole
            k = factors(body)
            assert np.abs(k - alone).max() < 1e-12 * np.abs(alone).max()
            assert np.array_equal(factors(again), k)


@pytest.mark.parametrize("order", ["C", "F"])
def test_rows_that_are_stored_multiply_bit_for_bit(order):
    """Row- or column-major, whole and with more behind them, and what grows from both: layout decides last bits."""
    rng = np.random.default_rng(1)
    before, after = (Body([], network(n), ROCK, SETTINGS).faces for n in (0, 2))
    kept = KeptRows.whole(np.array(rng.normal(size=(before.n_unknowns, 150)), order=order), before)
    was, more = after.found_in(before), rng.normal(size=(after.n_unknowns, 150))
    assert (was < 0).any() and (was >= 0).any()

    def grown(rows: KeptRows) -> KeptRows:
        return rows.grown(after, was, lambda k: more[after.unknowns(k)])

    right, left = rng.normal(size=(150, 3)), {e.n: rng.normal(size=(e.n_unknowns, 3)) for e in (before, after)}
    again = pickle.loads(pickle.dumps(kept))
    for one, other in [
        (kept, again),
        (grown(kept), pickle.loads(pickle.dumps(grown(kept)))),
        (grown(kept), grown(again)),
    ]:
        x = left[len(one.at)]
        for k in (0, slice(None)):
            assert np.array_equal(one @ right[:, k], other @ right[:, k])
            assert np.array_equal(one.T @ x[:, k], other.T @ x[:, k])
        assert one.dense.strides == other.dense.strides


def test_what_does_not_pivot_well_is_factored_anew(monkeypatch):
    from geomech.ddm.system import schur_complement

    monkeypatch.setattr(schur_complement, "LOSS", 0.0)
    body = Body([PLATE], network(0), ROCK, SETTINGS)
    factors(body)
    body = Body([PLATE], network(1), ROCK, SETTINGS, reuse=Reuse(body))
    assert not body.crack_system.matrix.is_whole
    k, alone = factors(body), factors(Body([PLATE], network(1), ROCK, SETTINGS))
    assert body.crack_system.matrix.is_whole
    assert np.abs(k - alone).max() < 1e-12 * np.abs(alone).max()


def test_cracks_that_grow_together_round_a_piece_are_seen():
    """What comes off makes the border's part singular, not the base."""
    u = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    open_ = Cracks.from_polylines([u], aperture=math.inf)
    body = Body([PLATE], open_, ROCK, SETTINGS)
    factors(body)
    of_segments = {name: np.repeat(getattr(open_, name)[:1], 4) for name in SEGMENT_ARRAYS}
    of_segments["birth_cycle"][3] = 1
    closed = replace(open_, segments=np.array([[0, 1], [1, 2], [2, 3], [3, 0]]), **of_segments)
    loose = Body([PLATE], closed, ROCK, SETTINGS, reuse=Reuse(body))
    assert not loose.crack_system.matrix.is_whole
    with pytest.raises(np.linalg.LinAlgError, match="separate a part"):
        loose.solve(LOAD)


def test_trials_and_bends_of_a_run_keep_factors():
    """Eighteen steps under compression, tried and some of them bent: few of the bodies are factored as wholes, and
    factors that have grown with so many others agree with fresh ones."""
    press = ddm.BodyLoad(sides={0: (0.0, 1e6), 2: (0.0, -1e6)})
    rock, work = replace(ROCK, k_ic=1e6), Work()
    growth = GrowthSettings(increment=0.05, min_increment=0.05)
    options = {"control": "toughness", "max_steps": 18, "reuse": Reuse(work=work)}
    *_, last = ddm.propagate([PLATE], network(0), rock, press, growth, settings=SETTINGS, **options)
    alone = Body([PLATE], last.cracks, rock, SETTINGS).solve(press.scaled(last.load_factor))
    k, k_alone = (np.stack([s.tips["k_i"], s.tips["k_ii"]]) for s in (last.solution, alone))
    assert np.abs(k - k_alone).max() < 1e-10 * np.abs(k_alone).max()
    assert last.number == 17 and work.bodies >= 20
    # Measured: 1 of 21.
    assert work.crack_factorisations < 0.2 * work.bodies


def test_long_growth_goes_by_the_inverse_of_the_boundary():
    """From the ninth body in a row on, new columns are multiplied, not solved for: K is that of a fresh body to
    round-off, and a body that was stored and read goes on bit for bit."""
    body = Body([PLATE], network(0), ROCK, SETTINGS)
    for steps in range(1, 13):
        assert ("inverse" in vars(body._outside.factor)) == (steps > OFTEN + 1)
        body = Body([PLATE], network(steps), ROCK, SETTINGS, reuse=Reuse(body))
        factors(body)
    k = factors(Body([PLATE], network(12), ROCK, SETTINGS))
    assert np.abs(factors(body) - k).max() < 1e-12 * np.abs(k).max()
    read = pickle.loads(pickle.dumps(body))
    grown = [Body([PLATE], network(13), ROCK, SETTINGS, reuse=Reuse(before)).solve(LOAD) for before in (read, body)]
    np.testing.assert_array_equal(grown[0].jumps, grown[1].jumps)
