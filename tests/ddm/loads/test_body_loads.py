"""Loads on a body: sides, functions, point loads, fluid pressure, sums and histories, refusals."""

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.kernels.point_forces import KelvinLoad, WedgeLoad
from geomech.model import Cracks, DdmSettings, History, Material

ROCK = Material("rock", youngs_modulus=10e9, poissons_ratio=0.25)
SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
OUT = np.array([[0, -1], [1, 0], [0, 1], [-1, 0]], dtype=float)
NONE = Cracks.from_polylines([])
SLANTED = Cracks.from_polylines([np.array([[-0.3, 0.1], [0.2, 0]])])
POINTS = np.array([[0.3, 0.2], [-0.7, 0.9], [0.0, -0.97]])


def carried(stress, k):
    """The traction of a uniform stress on side ``k``."""
    return np.array([stress[0] * OUT[k, 0] + stress[2] * OUT[k, 1], stress[2] * OUT[k, 0] + stress[1] * OUT[k, 1]])


def test_sides_by_number_by_piece_and_as_functions_are_one():
    """A uniform stress, its tractions given in all ways; 2e-9 is the quadrature where pieces meet inside an element."""
    stress = np.array([1e6, -2e6, 0.7e6])
    sides = [
        (0, carried(stress, 0)),
        (1, lambda x: np.tile(carried(stress, 1), (len(x), 1))),
        (2, [carried(stress, 2)] * 2),
        (((-1, -1), (-1, 0.13)), carried(stress, 3)),
        (((-1, 0.13), (-1, 1)), lambda x: np.tile(carried(stress, 3), (len(x), 1))),
    ]
    sol = ddm.Body([SQUARE], NONE, ROCK).solve(ddm.BodyLoad(sides=sides))
    assert np.abs(sol.stress(POINTS) - stress).max() < 2e-9 * 2e6


def test_a_function_of_position():
    """σ_xx = −2y³ + 3x²y·2 … of the Airy function x²y³ − y⁵/5: quartic tractions, inside the elements' span."""

    def stress(x):
        x, y = x.T
        return np.column_stack([6 * x**2 * y - 4 * y**3, 2 * y**3, -6 * x * y**2])

    def on(k):
        return lambda x: np.column_stack(
            [
                stress(x)[:, 0] * OUT[k, 0] + stress(x)[:, 2] * OUT[k, 1],
                stress(x)[:, 2] * OUT[k, 0] + stress(x)[:, 1] * OUT[k, 1],
            ]
        )

    sol = ddm.Body([SQUARE], NONE, ROCK).solve(ddm.BodyLoad(sides={k: on(k) for k in range(4)}))
    # The displacement is a quartic, so what is left is round-off and the approximation's 1e-9.
    assert np.abs(sol.stress(POINTS) - stress(POINTS)).max() < 1e-8


def test_a_jump_in_a_function_keeps_the_resultant():
    """A pressure on half a side as a function with a jump, against the segment that it is."""
    half = ddm.BodyLoad(
        sides=[(0, [0, 1e6]), (2, lambda x: np.column_stack([0 * x[:, 0], -2e6 * (x[:, 0] > 0.07)])), (3, [0, 0])]
    )
    body = ddm.Body([SQUARE], SLANTED, ROCK, supports=(ddm.Support(0),))
    exact = body.solve(ddm.BodyLoad(sides=[(0, [0, 1e6]), (((0.07, 1), (1, 1)), [0, -2e6])]))
    got = body.solve(half)
    assert np.allclose(got.reactions.force, exact.reactions.force, rtol=0, atol=2e-6 * 2e6)
    assert np.allclose(got.tips["k_ii"], exact.tips["k_ii"], rtol=3e-5)


@pytest.mark.parametrize(
    "field",
    [
        KelvinLoad(np.array([0.1, 0.2]), np.array([2e6, -1e6]), ROCK),
        WedgeLoad(np.array([0.1, 0.2]), np.array([2e6, -1e6]), np.array([np.cos(0.7), np.sin(0.7)]), 1.1, ROCK),
    ],
)
def test_fields_of_point_loads(field):
    """Displacement and stress belong together (differences of 1e-5: 1e-8), and a circle about the load carries it."""
    angle = 0.7 + np.array([-1.0, -0.3, 0.2, 1.0])
    points = field.point + 0.5 * np.column_stack([np.cos(angle), np.sin(angle)])
    h = 1e-5
    dx, dy = ((field.displacement(points + d) - field.displacement(points - d)) / (2 * h) for d in h * np.eye(2))
    strain = np.column_stack([dx[:, 0], dy[:, 1], dy[:, 0] + dx[:, 1]])
    stress = np.linalg.solve(ROCK.compliance(), strain.T).T
    assert np.allclose(field.stress(points), stress, rtol=0, atol=1e-8 * np.abs(stress).max())
    x, w = np.polynomial.legendre.leggauss(40)
    half = getattr(field, "half", np.pi)
    n = np.column_stack([np.cos(0.7 + half * x), np.sin(0.7 + half * x)])
    s = field.stress(field.point + n)
    force = half * w @ np.column_stack([s[:, 0] * n[:, 0] + s[:, 2] * n[:, 1], s[:, 2] * n[:, 0] + s[:, 1] * n[:, 1]])
    assert np.allclose(force, -field.force, rtol=1e-12)


def test_point_loads_inside_and_on_the_boundary_reach_the_support():
    """Inside, on a side, on a corner: force and moment of the reaction. 3e-5 is what the pinned side's corners
    leave."""
    points, forces = np.array([[0.2, 0.1], [1, 0.3], [-1, 1]]), np.array([[1e6, 2e6], [3e5, -1e5], [0, -2e5]])
    sol = ddm.Body([SQUARE], NONE, ROCK, supports=(ddm.Support(0),)).solve(ddm.BodyLoad(points=points, forces=forces))
    moment = np.sum(points[:, 0] * forces[:, 1] - points[:, 1] * forces[:, 0])
    assert np.allclose(sol.reactions.force, -forces.sum(axis=0), rtol=0, atol=3e-5 * 2e6)
    assert sol.reactions.moment[0] == pytest.approx(-moment, abs=5e-5 * 2e6)


def test_a_point_load_is_the_limit_of_a_short_one():
    """On a side, K of a crack below: a load on 2w approaches the point load with w² (until the load is shorter than the
    elements: then the point load is the better one), and twice the elements change nothing beyond 1e-5."""
    held = (ddm.Support(0),)
    body = ddm.Body([SQUARE], SLANTED, ROCK, supports=held)
    load = ddm.BodyLoad(points=[[0.3, 1.0]], forces=[[2e5, 1e6]])
    point = body.solve(load).tips["k_i"]
    error = []
    for w in (0.32, 0.16):
        short = ddm.BodyLoad(sides={((0.3 - w, 1), (0.3 + w, 1)): [2e5 / (2 * w), 1e6 / (2 * w)]})
        error.append(np.abs(body.solve(short).tips["k_i"] / point - 1).max())
    assert error[1] < 0.012 and error[0] / error[1] == pytest.approx(4, abs=0.3)
    fine = ddm.Body([SQUARE], SLANTED, ROCK, DdmSettings(order=6, elements_per_side=12), supports=held)
    assert fine.solve(load).tips["k_i"] == pytest.approx(point, rel=1e-5)


def test_a_point_load_on_a_hole_is_spread():
    hole = 0.3 * SQUARE
    body = ddm.Body([SQUARE], NONE, ROCK, holes=[hole], supports=(ddm.Support(0),))
    for point in ([0.1, 0.3], [0.3, 0.3]):
        sol = body.solve(ddm.BodyLoad(points=[point], forces=[[0, 1e6]]))
        assert np.allclose(sol.reactions.force, [[0, -1e6]], rtol=0, atol=1e-5 * 1e6)
        assert sol.reactions.moment[0] == pytest.approx(-point[0] * 1e6, abs=1e-4 * 1e6)


def test_pressure_in_cracks_by_place():
    """Hydrostatic, as a function and per segment; a linear pressure p₁x/a on a Griffith crack gives K = ±p₁√(πa)/2
    (Tada, Paris & Irwin 2000, 5.11), to the 2e-6 of four elements of order 4."""
    crack = Cracks.from_polylines([np.array([[-1.0, 0], [1, 0]])], aperture=np.inf)
    body = ddm.Body([], crack, ROCK)
    k = body.solve(ddm.BodyLoad(crack_pressure=ddm.Pressure(3e6, (1e6, 0)))).tips["k_i"]
    assert k == pytest.approx(np.sqrt(np.pi) * np.array([2.5e6, 3.5e6]), rel=3e-6)
    same = body.solve(ddm.BodyLoad(crack_pressure=lambda x: 3e6 + 1e6 * x[:, 0])).tips["k_i"]
    assert same == pytest.approx(k, rel=1e-12)
    assert body.solve(ddm.BodyLoad(crack_pressure=np.array([2e6]))).tips["k_i"] == pytest.approx(
        2e6 * np.sqrt(np.pi), rel=3e-6
    )


def test_water_in_a_hole_of_a_block_needs_a_hold():
    hole = 0.3 * SQUARE
    water = ddm.BodyLoad(hole_pressure=ddm.Pressure(0, (0, -1e4), (0, 0.3)))
    with pytest.raises(ddm.OutOfEquilibrium, match=r"force .0, -3600. N/m"):
        ddm.Body([SQUARE, hole[::-1]], NONE, ROCK).solve(water)
    sol = ddm.Body([SQUARE, hole[::-1]], NONE, ROCK, supports=(ddm.Support(0, "normal"),)).solve(water)
    assert np.allclose(sol.reactions.force, [[0, 3600]], atol=1e-4 * 3600)


def test_sums_and_histories():
    """Linear: the solution under a sum is the sum of the solutions, 1e-10."""
    body = ddm.Body([SQUARE], SLANTED, ROCK, supports=(ddm.Support(0),))
    a = ddm.BodyLoad(
        sides={2: [0, 1e6]}, points=[[0.5, 0.5]], forces=[[0, 1e6]], displacements=[[1e-5, 0]],
        crack_pressure=ddm.Pressure(2e6, (1e5, 0)), remote_stress=[0, 1e5, 0],
    )  # fmt: skip
    b = ddm.BodyLoad(
        [[[1, -1], [1, 1]]], [[[1e6, 0]] * 2], body_force=[0, -1e4], crack_pressure=lambda x: 4e6 + 0 * x[:, 0],
        displacements=[lambda x: 1e-5 * x],
    )  # fmt: skip
    times = ddm.LoadHistory([(a, History.ramp(0.5)), (b, lambda t: t**2), (ddm.BodyLoad(crack_pressure=1.0), 1e6)])
    both = body.solve(times.at(2.0))
    one, two = body.solve(a), body.solve(b)
    last = body.solve(ddm.BodyLoad(crack_pressure=1e6))
    expected = one.tips["k_i"] + 4 * two.tips["k_i"] + last.tips["k_i"]
    assert np.allclose(both.tips["k_i"], expected, rtol=1e-10)
    assert np.allclose(
        both.displacement(POINTS),
        sum(f * s.displacement(POINTS) for f, s in ((1, one), (4, two), (1, last))),
        rtol=1e-9,
    )
    holes = ddm.BodyLoad(hole_pressure=[1.0, ddm.Pressure(1.0, (0, 2.0))]).with_added(ddm.BodyLoad(hole_pressure=3.0))
    assert holes.hole_pressures(2)[1].at(np.array([0.0, 1.0])) == pytest.approx(6.0)


@pytest.mark.parametrize(
    ("load", "message"),
    [
        ({"sides": {7: [0, 1]}}, "side 7: there is no such edge"),
        ({"sides": {((0, 0), (1, 0)): [0, 1]}}, "side load 0 lies .* off the boundary"),
        ({"sides": {0: lambda x: x[:, 0]}}, "side 0: the function returned shape"),
        ({"sides": {0: lambda x: np.nan * x}}, "side 0: the function is not finite"),
        ({"points": [[3, 0]], "forces": [[1, 0]]}, "point load 0 at .3, 0. is not on the body"),
        ({"hole_pressure": [1.0]}, "0 holes but 1 pressures"),
        ({"hole_pressure": 1.0}, "a pressure in holes is given, but the body has none"),
        ({"crack_pressure": lambda x: np.nan * x[:, 0]}, "crack_pressure"),
        ({"crack_pressure": [1.0, 2.0]}, "1 crack segments but shape"),
    ],
)
def test_loads_that_do_not_fit_the_body(load, message):
    body = ddm.Body([SQUARE], SLANTED, ROCK, supports=(ddm.Support(0),))
    with pytest.raises(ValueError, match=message):
        body.solve(ddm.BodyLoad(**load))


@pytest.mark.parametrize(
    ("load", "message"),
    [
        ({"sides": {0: [0, 1, 2]}}, "side 0: expected a traction"),
        ({"sides": {0: [0, np.nan]}}, "side 0: its traction is not finite"),
        ({"sides": {((0, 0), (np.nan, 0)): [0, 1]}}, "expected an edge's number or the two ends"),
        ({"points": [[0, 0]], "forces": [[np.inf, 0]]}, "forces: not finite"),
        ({"points": [[0, 0]]}, "1 loaded points but 0 forces"),
        ({"hole_pressure": [np.nan]}, "hole_pressure: not finite"),
    ],
)
def test_loads_are_checked(load, message):
    with pytest.raises(ValueError, match=message):
        ddm.BodyLoad(**load)
    with pytest.raises(ValueError, match="not finite"):
        ddm.Pressure(1.0, (np.nan, 0))
