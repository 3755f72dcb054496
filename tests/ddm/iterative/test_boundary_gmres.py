"""Bodies whose boundary is iterated on against the same bodies factored."""

import numpy as np
import pytest

from geomech import ddm
from geomech.conventions import traction
from geomech.ddm.iterative import boundary_gmres, crack_gmres
from geomech.ddm.iterative.gmres import NotSolved
from geomech.model import Cracks, DdmSettings, JointLaw, Material
from geomech.reference.cracks.crack_arrays import cracks_in_cells

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
    monkeypatch.setattr(boundary_gmres, "CROSSOVER", 100)


def factors(solution) -> np.ndarray:
    return np.stack([solution.tips["k_i"], solution.tips["k_ii"]], axis=1)


@pytest.mark.first_by_default(2)
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
    grown = ddm.Body([OUTLINE], after, ROCK, reuse=ddm.Reuse(first))
    assert grown.counts["boundary_factorisations"] == 0
    alone = ddm.Body([OUTLINE], after, ROCK, DdmSettings(solver="dense")).solve(load)
    size = np.abs(factors(alone)).max()
    np.testing.assert_allclose(factors(grown.solve(load)), factors(alone), rtol=0, atol=1e-9 * size)


def test_graded_boundaries_are_iterated_on_to_the_end(few, caplog):
    """Corners graded to 1e-8 of the longest element: round-off in the shortest elements' equations is not what stops
    the iteration, nor are neighbourhoods as large as the whole; both once ended in factoring after all, for four times
    its cost."""
    caplog.set_level("INFO")
    load, graded = ddm.BodyLoad(remote_stress=[0.0, 1e6, 2e5]), {"grading_ratio": 0.15, "grading_layers": 8}
    crack = Cracks.from_polylines([np.array([[2.0, 2.0], [2.8, 2.4]])], aperture=np.inf)
    dense, other = (
        ddm.Body([BLOCK], crack, ROCK, DdmSettings(2, solver=solver, **graded), holes=[HOLE]).solve(load)
        for solver in ("dense", "auto")
    )
    outside = other.body._outside
    lengths = outside.elements.length
    assert outside.iterated and lengths.min() < 1e-8 * lengths.max()
    parts = np.array([len(elements) for elements, _ in outside.factor._patches._patches])
    assert parts.sum() < 2.2 * outside.elements.n
    np.testing.assert_allclose(factors(other), factors(dense), rtol=0, atol=1e-9 * np.abs(factors(dense)).max())
    sizes = f"{outside.factor.n} on the boundary, {other.body.faces.n_unknowns} on cracks"
    assert [r.message for r in caplog.records] == [f"solved iteratively instead of by factorization: {sizes}"]


def test_what_the_iteration_does_not_solve_is_factored(few, monkeypatch):
    load = pressed([0.0, 1e6, 2e5])
    dense = ddm.Body([OUTLINE], network(1), ROCK, DdmSettings(solver="dense")).solve(load)

    def stuck(*arguments, **options):
        raise NotSolved("stuck")

    for module in (boundary_gmres, crack_gmres):
        monkeypatch.setattr(module, "gmres", stuck)
    body = ddm.Body([OUTLINE], network(1), ROCK)
    assert body._outside.iterated
    np.testing.assert_allclose(factors(body.solve(load)), factors(dense), rtol=1e-12)
    assert not body._outside.iterated
    # Its compliance alone, as of a body whose ligament is nearly cut.
    other = ddm.Body([OUTLINE], network(1), ROCK)
    np.testing.assert_allclose(other.compliance(), dense.body.compliance(), rtol=1e-12)


BLOCK = np.array([[-1.0, -1.0], [6.0, -1.0], [6.5, 6.0], [-1.0, 6.0]])
PULLED_UP = ddm.BodyLoad(sides={2: (2e5, 1e6)}, body_force=[0.0, -3e4])
HELD = {
    "pinned": (ddm.Support(0),),
    "rollers": (ddm.Support(0, "normal"), ddm.Support(3, "x")),
    "slanted": (ddm.Support(((0.0, -1.0), (4.0, -1.0)), (0.3, 1.0)), ddm.Support(1, "tangent")),
    "free to slide": (ddm.Support(0, "y"), ddm.Support(2, "normal")),
}


@pytest.mark.first_by_default(2)
@pytest.mark.parametrize("supports", HELD.values(), ids=HELD)
def test_held_boundaries_are_solved_as_factored_ones(few, supports):
    """Pinned, on rollers, in slanted directions, free to slide; sides that move, a hole that nothing holds: the
    residuals of 1e-11 leave 1e-10 in K, displacement, reactions and the functionals."""
    points = np.array([[0.1, 0.2], [4.6, 4.1]])
    moved = [(0.0, 1e-4)] + [None] * (len(supports) - 1)
    slides = supports == HELD["free to slide"]
    load = ddm.BodyLoad(displacements=moved) if slides else ddm.BodyLoad(**{**vars(PULLED_UP), "displacements": moved})
    answers = []
    for solver in ("dense", "auto"):
        settings = DdmSettings(2, solver=solver)
        body = ddm.Body([BLOCK], network(2), ROCK, settings, holes=[HOLE], supports=supports)
        answers.append(body.solve(load))
    dense, other = answers
    assert other.body._outside.iterated and not dense.body._outside.iterated
    size = np.abs(factors(dense)).max()
    np.testing.assert_allclose(factors(other), factors(dense), rtol=0, atol=1e-10 * size)
    u = dense.displacement(points)
    np.testing.assert_allclose(other.displacement(points), u, rtol=0, atol=1e-10 * np.abs(u).max())
    force = dense.reactions.force
    np.testing.assert_allclose(other.reactions.force, force, rtol=0, atol=1e-10 * np.abs(force).max())
    np.testing.assert_allclose(other.body.k_functionals(other)(load), factors(dense), rtol=0, atol=1e-9 * size)


def test_held_holes_and_small_boundaries_are_factored(few, monkeypatch):
    supports = (ddm.Support(0), ddm.Support(len(OUTLINE)))
    prescribed = ddm.Body([OUTLINE], network(1), ROCK, holes=[HOLE], supports=supports)
    assert not prescribed._outside.iterated
    assert not boundary_gmres.is_iterated("auto", 99)
    monkeypatch.setattr(boundary_gmres, "MOST_REACTIONS", 100)
    many = ddm.Body([OUTLINE], network(1), ROCK, supports=supports[:1])
    assert not many._outside.iterated
