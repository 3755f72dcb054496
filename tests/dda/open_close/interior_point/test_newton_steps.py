"""Newton's steps of the central path against the equations that they are to solve, written down anew."""

from dataclasses import replace

import numpy as np
import pytest

from geomech import dda
from geomech.bench.cost import block_scenes
from geomech.dda import time_step
from geomech.dda.linear_solver import task_pool
from geomech.dda.open_close.interior_point import newton_steps
from geomech.dda.open_close.interior_point.central_path import CentralPath
from geomech.dda.open_close.iteration import settle
from geomech.model import State


@pytest.fixture(scope="module")
def given():
    """What `CentralPath` is asked with for a wall whose weight is put on suddenly."""
    asked, blocks, patch = [], block_scenes.wall(100), pytest.MonkeyPatch()
    with patch.context() as patched:
        patched.setattr(time_step, "settle", lambda *given, **named: asked.append(given) or settle(*given, **named))
        system = dda.BlockSystem(
            blocks, [block_scenes.ROCK], [block_scenes.JOINT], settings=block_scenes.settings(0.01)
        )
        system.step(State.at_rest(blocks), block_scenes.WEIGHT)
    of = replace(asked[0][0], expected=None)
    return of, (of.springs, of.gap), of.found.bonded, of.found.normal


def test_steps_solve_the_linearised_equations(given):
    path = CentralPath(*given)
    for _ in range(3):
        path.advance()
    normal, width, shear, (back, ahead) = (a.copy() for a in (path._normal, path._width, path._shear, path._slip))
    gap, along = path._g.copy(), path._s.copy()
    steps, solutions = path._steps, []
    made, steps._made = steps._made, lambda *task: (made(*task) and solutions.append(
        (steps.tried.unknowns, steps.tried.changed.copy(), steps.tried.sheared.copy(), steps.tried.goals.copy(),
         steps.tried.motion.copy(), steps.residual.copy(), steps.tried.far)
    )) or steps.tried.far  # fmt: skip
    path.advance()
    mine, theirs, vectors, lift = steps._fixed
    kn, ks, mu, base, rough = path._kn, path._ks, path._mu, path._base, path._rough
    strength = mu * normal + base
    assert rough.all() and not lift.any() and len(solutions) >= 2
    for unknowns, changed, sheared, goals, motion, residual, far in solutions:
        rows = np.vstack([unknowns.reshape(-1, 6), np.zeros(6)])
        both = np.concatenate([rows[mine], rows[theirs]], axis=1)
        assert motion == pytest.approx(np.einsum("ckj,cj->ck", vectors, both), rel=1e-9, abs=1e-15)
        d_normal, d_width, d_back, d_ahead, d_above, d_below = changed.T
        # w = g + N/kₙ and Δs + (S − S₀)/kₛ = β − α hold at the step's end, strengths and their products to first order.
        assert width + d_width == pytest.approx(gap + motion[:, 0] + (normal + d_normal) / kn, rel=1e-7, abs=1e-14)
        moved = along + motion[:, 1] + (shear + sheared) / ks
        assert moved == pytest.approx(ahead + d_ahead - back - d_back, rel=1e-7, abs=1e-14)
        assert d_above == pytest.approx(mu * d_normal - sheared, rel=1e-9, abs=1e-6)
        assert d_below == pytest.approx(mu * d_normal + sheared, rel=1e-9, abs=1e-6)
        pairs = (normal, width, d_normal, d_width), (back, strength - shear, d_back, d_above)
        for goal, (one, two, d_one, d_two) in zip(
            goals.T, (*pairs, (ahead, strength + shear, d_ahead, d_below)), strict=True
        ):
            product = one * two + one * d_two + two * d_one
            assert np.abs(product - goal).max() <= 1e-6 * np.abs(one * two).max()
        # Blocks are in balance with the forces that follow, as nearly as steps are solved.
        forces = np.einsum("ckj,ck->cj", vectors, np.stack([d_normal, sheared], axis=1)).reshape(-1, 2, 6)
        added = np.zeros_like(rows)
        np.add.at(added, mine, forces[:, 0])
        np.add.at(added, theirs, forces[:, 1])
        left = residual + added[:-1].ravel() - given[0].pattern.without_contacts(given[0].matrix, unknowns).ravel()
        assert np.abs(left).max() <= 1e-4 * (np.abs(residual).max() + np.abs(added).max())
        numbers = np.stack([normal, width, back, ahead, strength - shear, strength + shear], axis=1)
        assert (numbers + 1.0001 * far * changed > 0).all()
    # The last one that was accepted was taken.
    assert any(np.allclose(path._normal, normal + f * changed[:, 0]) for _, changed, *_, f in solutions)


def test_steps_do_not_depend_on_threads(given, monkeypatch):
    monkeypatch.setattr(newton_steps, "_CONTACTS", 50)
    monkeypatch.setattr(newton_steps, "SHARE", 10)
    found = []
    for helpers in (0, 1, 5):
        monkeypatch.setattr(newton_steps, "THREADED", 0 if helpers else 10**9)
        team = task_pool.ThreadTeam(helpers)
        monkeypatch.setattr(newton_steps, "thread_team", lambda team=team: team)
        path = CentralPath(*given)
        while not path.ended:
            # On a busy machine it would go on alone.
            team._alone.clear()
            path.advance()
        found.append((path.unknowns.copy(), path._normal.copy(), path._shear.copy()))
    for other in found[1:]:
        assert all(np.array_equal(one, two) for one, two in zip(found[0], other, strict=True))


def test_products_are_those_where_the_step_ends(given):
    """N w, and (strength ∓ S) times the slips, each over its contact's unit."""
    path = CentralPath(*given)
    for _ in range(2):
        path.advance()
    steps = path._steps
    ends = steps.numbers + steps.step.far * steps.step.changed
    normal, width, back, ahead, above, below = ends.T
    own = normal * width + np.where(path._rough, back * above + ahead * below, 0.0)
    assert not np.array_equal(path._rough, path._base > 0)
    assert steps.products() == pytest.approx(float((own / path._unit).sum()), rel=1e-12)
