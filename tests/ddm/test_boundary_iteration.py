"""Bodies whose boundary is iterated on against the same bodies factored."""

import numpy as np
import pytest

from geomech import ddm
from geomech.conventions import traction
from geomech.ddm import boundary_iteration, iterative
from geomech.ddm.iterative import NotSolved
from geomech.model import Cracks, DdmSettings, JointLaw, Material
from geomech.reference.crack_arrays import cracks_in_cells

ROCK = Material("rock", youngs_modulus=10e9, poissons_ratio=0.25)
AROUND = np.linspace(0, 2 * np.pi, 16, endpoint=False)
OUTLINE = np.column_stack([2.5 + 4 * np.cos(AROUND), 2.5 + 3.5 * np.sin(AROUND)])
#: Small enough to lie in one neighbourhood whole, whose rigid motions must be lifted there too.
HOLE = np.array([[5.0, 3.0], [5.4, 3.0], [5.2, 3.4]])


def network(n: int) -> Cracks:
    return Cracks.from_polylines(cracks_in_cells(n), aperture=0.0)


def pressed(stress) -> ddm.BodyLoad:
    segments = np.stack([OUTLINE, np.roll(OUTLINE, -1, axis=0)], axis=1)
    along = segments[:, 1] - segments[:, 0]
    normals = np.column_stack([along[:, 1], -along[:, 0]]) / np.hypot(*along.T)[:, None]
    t = traction(np.broadcast_to(stress, (len(normals), 3)), normals)
    return ddm.BodyLoad(segments=segments, tractions=np.repeat(t[:, None], 2, axis=1))


@pytest.fixture
def few(monkeypatch):
    """Iterates on boundaries of some hundred unknowns."""
    monkeypatch.setattr(boundary_iteration, "CROSSOVER", 100)


def factors(solution) -> np.ndarray:
    return np.stack([solution.tips["k_i"], solution.tips["k_ii"]], axis=1)


@pytest.mark.parametrize("law", [JointLaw("smooth"), JointLaw("rough", friction_angle=0.5, cohesion=1e5)])
@pytest.mark.parametrize("stress", [[2e5, 1e6, 1e5], [-1e6, -2e7, 7e6]], ids=["open", "closed"])
def test_iterated_boundaries_solve_as_factored_ones(few, law, stress):
    """Tension and sliding faces, with a hole: K, displacement and the functionals; residuals of 1e-11 leave K about as
    much (measured 1e-13 to 1e-11)."""
    load, points = pressed(stress), np.array([[0.1, 0.2], [4.6, 4.1]])
    answers = []
    for solver in ("dense", "auto"):
        body = ddm.Body([OUTLINE], network(2), ROCK, DdmSettings(2, solver=solver), holes=[HOLE], face_laws=(law,))
        answers.append(body.solve(load))
    dense, other = answers
    assert other.body._outside.iterated and other.body.compressed and not dense.body._outside.iterated
    size = np.abs(factors(dense)).max()
    np.testing.assert_allclose(factors(other), factors(dense), rtol=0, atol=1e-9 * size)
    assert (other.states == dense.states).all()
    u = dense.displacement(points)
    np.testing.assert_allclose(other.displacement(points), u, rtol=0, atol=1e-9 * np.abs(u).max())
    assert other.residual < max(1e-9, 1.01 * dense.residual)
    np.testing.assert_allclose(body.k_functionals(other)(load), factors(dense), rtol=0, atol=1e-8 * size)


def test_bodies_without_cracks_and_bodies_that_grow(few):
    """Under tension; and a body made from another one."""
    none = Cracks.from_polylines([])
    pulled = pressed([0.0, 1e6, 0.0])
    points = np.array([[0.1, 0.2], [4.0, 4.1]])
    one, other = (
        ddm.Body([OUTLINE], none, ROCK, DdmSettings(solver=solver), holes=[HOLE]).solve(pulled).stress(points)
        for solver in ("dense", "auto")
    )
    np.testing.assert_allclose(other, one, rtol=0, atol=1e-9 * np.abs(one).max())
    load = pressed([0.0, 1e6, 2e5])
    line = np.array([[2.0, 2.0], [2.8, 2.4], [3.0, 2.6]])
    before, after = (Cracks.from_polylines([line[:n]], aperture=np.inf) for n in (2, 3))
    first = ddm.Body([OUTLINE], before, ROCK)
    first.solve(load)
    grown = ddm.Body([OUTLINE], after, ROCK, previous=first)
    assert grown.counts["boundary_factorisations"] == 0
    alone = ddm.Body([OUTLINE], after, ROCK, DdmSettings(solver="dense")).solve(load)
    size = np.abs(factors(alone)).max()
    np.testing.assert_allclose(factors(grown.solve(load)), factors(alone), rtol=0, atol=1e-9 * size)


def test_what_the_iteration_does_not_solve_is_factored(few, monkeypatch):
    load = pressed([0.0, 1e6, 2e5])
    dense = ddm.Body([OUTLINE], network(1), ROCK, DdmSettings(solver="dense")).solve(load)

    def stuck(*arguments, **options):
        raise NotSolved("stuck")

    for module in (boundary_iteration, iterative):
        monkeypatch.setattr(module, "gmres", stuck)
    body = ddm.Body([OUTLINE], network(1), ROCK)
    assert body._outside.iterated
    np.testing.assert_allclose(factors(body.solve(load)), factors(dense), rtol=1e-12)
    assert not body._outside.iterated


def test_supports_and_small_boundaries_are_factored(few):
    held = ddm.Body([OUTLINE], network(1), ROCK, supports=(ddm.Support(0), ddm.Support(8)))
    assert not held._outside.iterated
    assert not boundary_iteration.is_iterated("auto", 99, False)
