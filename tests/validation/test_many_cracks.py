"""Hundreds of cracks at once, by the compressed operator, against solutions that know nothing of it."""

import time

import numpy as np
import pytest

from geomech import ddm
from geomech.model import Cracks, DdmSettings, Material
from geomech.reference.cracks import crack_arrays

ROCK = Material("rock", youngs_modulus=10e9, poissons_ratio=0.25)


def solved(ends, stress, order=4, aperture=0.0, pressure=0.0):
    body = ddm.Body([], Cracks.from_polylines(ends, aperture=aperture), ROCK, DdmSettings(order, solver="compressed"))
    return body.solve(ddm.BodyLoad(remote_stress=stress, crack_pressure=pressure))


def test_a_long_row_becomes_the_periodic_one(verified):
    """The middle one of N cracks in a row, 9/10 of it cracked: as 1/N to Irwin's formula, within 5e-6 of it when
    extrapolated from 25 to 201 cracks, the last ones 17 000 unknowns (from 51 to 401: 4e-7)."""
    half, period = 0.45, 1.0
    exact = crack_arrays.collinear_array(1.0, half, period)
    sizes, found = np.array([25, 51, 101, 201]), []
    for n in sizes:
        ends = [np.array([[k - half, 0], [k + half, 0]]) * period for k in np.arange(n) - n // 2]
        found.append(solved(ends, [0.0, 1.0, 0.0], order=6).tips["k_i"][2 * (n // 2)] / exact)
    error = 1 - np.array(found)
    order = np.log(error[:-1] / error[1:]) / np.log(sizes[1:] / sizes[:-1])
    rest = np.linalg.solve(np.column_stack([sizes**0.0, 1 / sizes, np.log(sizes) / sizes**2, sizes**-2.0]), error)[0]
    print(f"row of {sizes}: {error}, order {order}, extrapolated {rest:.1e}")
    np.testing.assert_allclose(order, 1.0, atol=0.03)
    verified("row of up to 201 cracks, extrapolated: K", rest, "Irwin 1957")
    # After 1/N, log N/N² and 1/N² comes log²N/N³: 4e-6 in size here, and falling as such with more cracks.
    assert abs(rest) < 5e-6


def test_random_cracks_are_those_of_an_independent_method():
    """20 cracks, in K over σ√(πa): to 5e-5 at the default order and 1e-6 at order 8, as the dense solver."""
    ends = crack_arrays.random_cracks(20)
    stress = np.array([0.3, 1.0, 0.2])
    exact = crack_arrays.straight_cracks(ends, stress, n=49)
    scale = np.sqrt(np.pi)
    for order, tolerance in ((4, 5e-5), (8, 1e-6)):
        tips = solved(ends, stress, order, aperture=np.inf).tips
        assert np.abs(np.column_stack([tips["k_i"], tips["k_ii"]]) - exact).max() < tolerance * scale


def test_hundreds_of_closed_cracks_settle():
    """225 cracks, 9 000 unknowns, pressed together by some stresses and opened by others: no face passes through the
    other one and none pulls."""
    ends = crack_arrays.cracks_in_cells(15)
    sol = solved(ends, [4e5, -1e6, 2e5])
    faces, stress = sol.faces, 1e6
    nodes = slice(1, -1)
    closed = faces.state[:, nodes] != 0
    assert 0.5 < closed.mean() < 0.95
    assert faces.opening[:, nodes].min() > -1e-9 * faces.opening.max()
    assert faces.traction[:, nodes, 0].max() < 1e-9 * stress
    assert np.abs(faces.traction[:, nodes, 0][~closed]).max() < 1e-9 * stress
    assert sol.residual < 1e-9 and sol.solves < 20


@pytest.mark.slow
def test_twenty_thousand_unknowns():
    """529 cracks of lengths 1 : 6, 21 000 unknowns: seconds, a few percent of the dense matrix, K as with higher
    order."""
    ends = crack_arrays.cracks_in_cells(23)
    start = time.perf_counter()
    sol = solved(ends, [0.3, 1.0, 0.2], aperture=np.inf)
    body, seconds = sol.body, time.perf_counter() - start
    operator = body.crack_system.matrix.cracks
    part = operator.stored / (8 * body.faces.n_unknowns**2)
    print(
        f"{body.faces.n_unknowns} unknowns: {seconds:.1f} s, {body.crack_system.products} products, "
        f"{operator.stored / 1e6:.0f} MB, {part:.1%} of the matrix"
    )
    assert body.faces.n_unknowns > 20_000 and part < 0.1 and sol.residual < 1e-9
    assert body.crack_system.products < 60
    finer = solved(ends, [0.3, 1.0, 0.2], order=6, aperture=np.inf)
    scale = np.abs(finer.tips["k_i"]).max()
    # The mesh's own error at the default order, as of 20 random cracks.
    for name in ("k_i", "k_ii"):
        assert np.abs(sol.tips[name] - finer.tips[name]).max() < 2e-4 * scale
