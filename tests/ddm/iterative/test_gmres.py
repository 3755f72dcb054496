"""Bodies with compressed matrices against the same bodies factored."""

import numpy as np
import pytest

from geomech import ddm
from geomech.conventions import traction
from geomech.ddm.iterative import crack_gmres
from geomech.ddm.iterative.crack_gmres import CROSSOVER
from geomech.ddm.iterative.gmres import NotSolved, gmres
from geomech.model import Cracks, DdmSettings, JointLaw, Material
from geomech.reference.cracks.crack_arrays import cracks_in_cells

ROCK = Material("rock", youngs_modulus=10e9, poissons_ratio=0.25)


def network(n: int) -> Cracks:
    return Cracks.from_polylines(cracks_in_cells(n))


def both(loops, cracks, load):
    """The solution of the two solvers."""
    bodies = (ddm.Body(loops, cracks, ROCK, DdmSettings(solver=solver)) for solver in ("dense", "compressed"))
    return [body.solve(load) for body in bodies]


def agree(dense, other, tolerance=1e-10):
    """K to a hundredth of what a mesh of order 4 is good for; measured 1e-13 to 1e-12."""
    size = max(np.abs(dense.tips["k_i"]).max(), np.abs(dense.tips["k_ii"]).max())
    for name in ("k_i", "k_ii"):
        np.testing.assert_allclose(other.tips[name], dense.tips[name], rtol=0, atol=tolerance * size)
    assert (other.closed == dense.closed).all()


PLANE: list[np.ndarray] = []
SQUARE = [np.array([[-0.1, -0.1], [5.1, -0.1], [5.1, 5.1], [-0.1, 5.1]])]


def pressed(stress) -> ddm.BodyLoad:
    """Uniform ``stress`` carried by tractions on the outline of SQUARE."""
    corner = SQUARE[0]
    segments = np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)
    normals = np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
    t = traction(np.broadcast_to(stress, (4, 3)), normals)
    return ddm.BodyLoad(segments=segments, tractions=np.repeat(t[:, None], 2, axis=1))


@pytest.mark.first_by_default(2)
@pytest.mark.parametrize("stress", [[0.0, 1e6, 3e5], [2e5, -1e6, 1e5]], ids=["tension", "compression"])
@pytest.mark.parametrize("loops", [PLANE, SQUARE], ids=["plane", "square"])
def test_compressed_bodies_solve_as_dense_ones(loops, stress):
    cracks = network(5)
    load = pressed(stress) if loops else ddm.BodyLoad(remote_stress=stress)
    dense, other = both(loops, cracks, load)
    assert other.body.compressed and not dense.body.compressed and other.body.faces.n_unknowns > 1000
    agree(dense, other)
    # What is left at the boundary's own nodes is the discretisation's, and the same.
    assert other.residual < max(1e-10, 1.01 * dense.residual)
    points = np.random.default_rng(1).uniform(0, 5, (20, 2))
    for one, two in zip(dense.fields(points), other.fields(points)):
        np.testing.assert_allclose(two, one, rtol=0, atol=1e-10 * np.abs(one).max())
    if loops:
        np.testing.assert_allclose(other.body.compliance(other), dense.body.compliance(dense), rtol=1e-9, atol=1e-22)


@pytest.mark.parametrize(
    "law",
    [
        JointLaw("rough", friction_angle=np.arctan(0.6), cohesion=1e5),
        JointLaw("filled", friction_angle=np.arctan(0.4), normal_stiffness=1e10, shear_stiffness=3e9),
    ],
    ids=lambda law: law.name,
)
def test_faces_under_a_law_do_as_with_dense_equations(law):
    """Loading and half unloading: states, slip that is kept, work of friction."""
    answers = []
    for solver in ("dense", "compressed"):
        body = ddm.Body(PLANE, network(4), ROCK, DdmSettings(solver=solver), face_laws=(law,))
        loaded = body.solve(ddm.BodyLoad(remote_stress=[-3e6, -2e7, 6e6]))
        answers.append((loaded, body.solve(ddm.BodyLoad(remote_stress=[-3e6, -1e7, -1e6]), history=loaded)))
    for dense, other in zip(*answers):
        agree(dense, other)
        assert (other.states == dense.states).all()
        assert other.frictional_work == pytest.approx(dense.frictional_work, rel=1e-9)
        assert other.residual < 1e-10


@pytest.mark.parametrize("loops", [PLANE, SQUARE], ids=["plane", "square"])
@pytest.mark.parametrize("law", [JointLaw("smooth"), JointLaw("rough", friction_angle=0.5, cohesion=1e5)])
def test_functionals_of_the_tips_are_the_iterated_solution(loops, law):
    """Transposed equations, faces that slide included: K as the solution has it, to the iteration's tolerance."""
    body = ddm.Body(loops, network(2), ROCK, DdmSettings(3, solver="compressed"), face_laws=(law,))
    for stress in ([2e5, 1e6, 1e5], [-1e6, -2e7, 7e6]):
        load = pressed(stress) if loops else ddm.BodyLoad(remote_stress=stress)
        solution = body.solve(load)
        expected = np.stack([solution.tips["k_i"], solution.tips["k_ii"]], axis=1)
        found = body.k_functionals(solution)(load)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_coarse_elements_are_transposed_with_the_rest():
    """A crack long enough for them, cut by several patches: the products the transposed equations take are few too."""
    x = np.array([-10.0, 10.0])
    cracks = Cracks.from_polylines([np.column_stack([x, 0.1 * x])], aperture=np.inf)
    body = ddm.Body(PLANE, cracks, ROCK, DdmSettings(1, solver="compressed", elements_per_crack=300))
    load = ddm.BodyLoad(remote_stress=[0.2e6, 1e6, 0.3e6])
    solution, before = body.solve(load), body.crack_system.products
    assert body.crack_system._coarse.n
    found = body.k_functionals()(load)
    np.testing.assert_allclose(found[:, 0], solution.tips["k_i"], rtol=1e-8)
    # Four functionals, each as many products as a load or nearly so.
    assert body.crack_system.products - before < 6 * before


def test_held_holes_hold_cracks_that_are_iterated_on():
    """A body that hangs on a hole in its middle, under its own weight."""
    cracks = Cracks.from_polylines([line + [0.6, 0.6] for line in cracks_in_cells(2)], aperture=np.inf)
    hole = np.array([[3.0, 3.0], [4.0, 3.1], [3.9, 4.2], [3.1, 4.0]])
    supports = tuple(ddm.Support(k) for k in range(4, 8))
    answers = []
    for solver in ("dense", "compressed"):
        settings = DdmSettings(solver=solver)
        body = ddm.Body(SQUARE, cracks, ROCK, settings, holes=[hole], supports=supports)
        answers.append(body.solve(ddm.BodyLoad(body_force=[1e4, -2e4])))
    agree(*answers)
    dense, other = (answer.reactions.force for answer in answers)
    np.testing.assert_allclose(other, dense, rtol=0, atol=1e-9 * np.abs(dense).max())


def test_growth_may_cross_from_dense_to_compressed():
    """Bodies of either kind follow one another."""
    cracks = network(4)
    load = pressed([0.0, 1e6, 0.0])
    dense = ddm.Body(SQUARE, cracks, ROCK, DdmSettings(solver="dense"))
    for settings in (DdmSettings(solver="compressed"), DdmSettings(solver="dense")):
        body = ddm.Body(SQUARE, cracks, ROCK, settings, reuse=ddm.Reuse(dense))
        agree(dense.solve(load), body.solve(load))
        again = ddm.Body(SQUARE, cracks, ROCK, settings, reuse=ddm.Reuse(body))
        agree(dense.solve(load), again.solve(load, warm=body.solve(load)))


def test_a_load_that_comes_again_costs_no_iterations():
    body = ddm.Body(PLANE, network(5), ROCK, DdmSettings(order=2, solver="compressed"))
    body.solve(ddm.BodyLoad(remote_stress=[0.0, 1e6, 0.0], crack_pressure=2e6))
    before = body.crack_system.products
    body.solve(ddm.BodyLoad(remote_stress=[0.0, 2e6, 0.0], crack_pressure=4e6))
    assert body.crack_system.products - before <= 2


def test_small_bodies_stay_dense_and_unknown_solvers_are_refused():
    cracks = network(2)
    body = ddm.Body(PLANE, cracks, ROCK)
    assert body.faces.n_unknowns < CROSSOVER and not body.compressed
    with pytest.raises(ValueError, match="solver"):
        ddm.Body(PLANE, cracks, ROCK, DdmSettings(solver="sparse"))


def test_a_part_cut_off_is_refused():
    ring = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    segments = np.column_stack([np.arange(4), np.roll(np.arange(4), -1)])
    four = np.zeros(4, int)
    ring = Cracks(ring, segments, four, four, four, np.full(4, np.inf), np.zeros(4, bool), ("ring",))
    body = ddm.Body(PLANE, ring, ROCK, DdmSettings(order=2, solver="compressed"))
    with pytest.raises(np.linalg.LinAlgError, match="separate a part"):
        body.solve(ddm.BodyLoad(remote_stress=[0.0, 1e6, 2e5]))


def test_gmres_solves_and_says_when_it_does_not():
    rng = np.random.default_rng(0)
    matrix = np.eye(80) + 0.05 * rng.standard_normal((80, 80))
    right = rng.standard_normal(80)
    x, products = gmres(matrix.__matmul__, right, np.copy, restart=15)
    np.testing.assert_allclose(matrix @ x, right, atol=1e-11)
    assert products < 80
    assert gmres(matrix.__matmul__, right, np.copy, first=x)[1] == 1
    singular = np.diag(np.r_[0.0, np.ones(79)])
    with pytest.raises(NotSolved):
        gmres(singular.__matmul__, right, np.copy)


def test_what_the_iteration_does_not_solve_is_factored_after_all(monkeypatch):
    """Picked by the number of unknowns, as it stops at elements that are very unlike; asked for by name, it says so."""
    cracks, load = network(4), ddm.BodyLoad(remote_stress=np.array([0.0, 1e6, 3e5]))
    dense = ddm.Body(PLANE, cracks, ROCK).solve(load)
    monkeypatch.setattr(crack_gmres, "CROSSOVER", 1)

    def stuck(*arguments, **options):
        raise NotSolved("stuck")

    monkeypatch.setattr(crack_gmres, "gmres", stuck)
    body = ddm.Body(PLANE, cracks, ROCK)
    assert body.compressed
    agree(dense, body.solve(load), 1e-13)
    assert not body.compressed and not ddm.Body(PLANE, cracks, ROCK, reuse=ddm.Reuse(body)).compressed
    with pytest.raises(NotSolved):
        ddm.Body(PLANE, cracks, ROCK, DdmSettings(solver="compressed")).solve(load)


def test_long_cracks_talk_from_end_to_end(monkeypatch):
    """Two parallel cracks of 300 elements, cut by sixteen patches: coarse elements save half of the products (51 →
    25), and do not change the answer (residuals of 1e-11). A crack that winds has none, and is solved as before."""
    from geomech.ddm.iterative import coarse_space

    x = np.array([-10.0, 10.0])
    lines = [np.column_stack([x, 0.3 * x + 1.5 * k]) for k in range(2)]
    cracks, load = Cracks.from_polylines(lines, aperture=np.inf), ddm.BodyLoad(remote_stress=[0.2e6, 1e6, 0.3e6])
    products, k = {}, {}
    for longest in (coarse_space.LONG, 10**9):
        with monkeypatch.context() as patch:
            patch.setattr(coarse_space, "LONG", longest)
            body = ddm.Body([], cracks, ROCK, DdmSettings(order=2, solver="compressed", elements_per_crack=300))
            solution = body.solve(load)
        k[longest] = np.stack([solution.tips["k_i"], solution.tips["k_ii"]])
        products[longest] = body.crack_system.products
    with_them, without = products.values()
    assert with_them < 0.7 * without
    one, other = k.values()
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-8 * np.abs(other).max())
    x = np.linspace(-10, 10, 201)
    winding = Cracks.from_polylines([np.column_stack([x, np.sin(2 * x)])], aperture=np.inf)
    body = ddm.Body([], winding, ROCK, DdmSettings(order=2, solver="compressed"))
    assert body.crack_system._coarse.n == 0 and body.faces.n >= coarse_space.LONG
