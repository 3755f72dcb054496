"""Finite cracked bodies against published and independently computed stress intensity factors, and closed fields."""

import math

import numpy as np
import pytest

from geomech import ddm
from geomech.model import Cracks, DdmSettings, Material
from geomech.reference.cracks import fracture
from geomech.reference.specimens import two_cracks

ROCK = Material("rock", youngs_modulus=17e9, poissons_ratio=0.21, density=2600.0)
OPEN = math.inf


def rectangle(w, h):
    return np.array([[-w, -h], [w, -h], [w, h], [-w, h]], dtype=float)


def pull(w, h, stress=1.0):
    """Tension on the two ends."""
    return ddm.BodyLoad(
        segments=[[[-w, -h], [w, -h]], [[w, h], [-w, h]]], tractions=[[[0, -stress]] * 2, [[0, stress]] * 2]
    )


def line(*points, **kwargs):
    return Cracks.from_polylines([np.array(points, dtype=float)], **kwargs)


@pytest.mark.parametrize("height", fracture.CENTRE_CRACK_HALF)
def test_centre_crack(verified, height):
    """2e-5 at order 6 (order 4 leaves 2e-5 of its own); the reference has six digits."""
    body = ddm.Body([rectangle(1, height)], line([-0.5, 0], [0.5, 0], aperture=OPEN), ROCK, DdmSettings(order=6))
    k = body.solve(pull(1, height)).tips["k_i"] / fracture.griffith(1, 0.5)
    print(f"centre crack, a/W 0.5, H/W {height}: {np.abs(k / fracture.CENTRE_CRACK_HALF[height] - 1).max():.1e}")
    verified(
        f"centre crack, a/W = 0.5, H/W = {height:g}, order 6",
        np.abs(k / fracture.CENTRE_CRACK_HALF[height] - 1).max(),
        "boundary collocation",
    )
    assert np.allclose(k, fracture.CENTRE_CRACK_HALF[height], atol=1.2e-5)


@pytest.mark.parametrize("depth", fracture.EDGE_CRACK)
def test_edge_crack(verified, depth):
    """Strip of H/W = 3 for the infinite one. 2e-4: half a digit of the table and the discretisation of p = 4."""
    crack = line([-0.5, 0], [depth - 0.5, 0], aperture=OPEN, surface=[(True, False)])
    k = ddm.Body([rectangle(0.5, 1.5)], crack, ROCK).solve(pull(0.5, 1.5)).tips["k_i"]
    print(f"edge crack, a/W {depth}: {k[0] / fracture.griffith(1, depth) / fracture.EDGE_CRACK[depth] - 1:.1e}")
    verified(
        f"edge crack, a/W = {depth:g}",
        k[0] / fracture.griffith(1, depth) / fracture.EDGE_CRACK[depth] - 1,
        "Kaya & Erdogan 1987",
    )
    assert k[0] / fracture.griffith(1, depth) == pytest.approx(fracture.EDGE_CRACK[depth], rel=2e-4)


@pytest.mark.parametrize("phi", two_cracks.OPEN_SLOT_K_I)
def test_two_slot_specimen(verified, phi):
    """1e-5 of the largest: the digits of the reference. Default settings."""
    cracks = Cracks.from_polylines(two_cracks.crack_ends(phi), aperture=OPEN)
    tips = ddm.Body([rectangle(0.03, 0.06)], cracks, ROCK).solve(pull(0.03, 0.06, -1.0)).tips
    largest = np.abs(two_cracks.OPEN_SLOT_K_I[phi]).max()
    for name, table in (("k_i", two_cracks.OPEN_SLOT_K_I), ("k_ii", two_cracks.OPEN_SLOT_K_II)):
        error = np.abs(tips[name] - table[phi]).max() / largest
        print(f"two slots, {phi}°, {name}: {error:.1e}")
        verified(
            f"two slots in the specimen, φ = {phi}°: {name}".replace("k_ii", "K_II").replace("k_i", "K_I"),
            error,
            "computed independently",
        )
        assert error < 1e-5


def uniform_load(loops, stress):
    segments = np.concatenate([np.stack([p, np.roll(p, -1, axis=0)], axis=1) for p in loops])
    d = segments[:, 1] - segments[:, 0]
    n = np.column_stack([d[:, 1], -d[:, 0]]) / np.hypot(*d.T)[:, None]
    t = np.column_stack([stress[0] * n[:, 0] + stress[2] * n[:, 1], stress[2] * n[:, 0] + stress[1] * n[:, 1]])
    return ddm.BodyLoad(segments=segments, tractions=np.repeat(t[:, None], 2, axis=1))


def test_uniform_stress_in_a_body_with_a_hole():
    """Whole L-shaped rock whose hole carries its tractions: the field is uniform, to round-off times the condition."""
    outline = np.array([[0, 0], [3, 0], [3, 1], [1.2, 1], [1.2, 2.5], [0, 2.5]], dtype=float)
    hole = np.array([[0.4, 0.4], [0.4, 0.8], [0.9, 0.6]])
    stress = np.array([1e6, -2e6, 0.7e6])
    body = ddm.Body([outline, hole], Cracks.from_polylines([]), ROCK)
    sol = body.solve(uniform_load([outline, hole], stress))
    points = np.array([[2.5, 0.5], [0.6, 2.0], [1.05, 0.9], [0.45, 0.9], [0.2, 0.55], [1.6, 0.999], [0.7, 0.0]])
    assert np.allclose(sol.stress(points), stress, atol=1e-8 * 2e6)
    strain = ROCK.compliance() @ stress
    u = sol.displacement(points)
    exact = np.column_stack(
        [
            strain[0] * points[:, 0] + strain[2] / 2 * points[:, 1],
            strain[1] * points[:, 1] + strain[2] / 2 * points[:, 0],
        ]
    )
    # Equal but for a rigid motion: three of the numbers are free.
    gap = u - exact
    rigid = np.zeros((len(points), 2, 3))
    rigid[:, 0, 0] = rigid[:, 1, 1] = 1
    rigid[:, 0, 2], rigid[:, 1, 2] = -points[:, 1], points[:, 0]
    fit = np.linalg.lstsq(rigid.reshape(-1, 3), gap.ravel(), rcond=None)[0]
    assert np.abs(gap.ravel() - rigid.reshape(-1, 3) @ fit).max() < 1e-8 * np.abs(exact).max()


def test_remote_stress_on_a_body_is_tractions_on_its_boundary():
    cracks = line([-0.3, -0.1], [0.2, 0.3], aperture=OPEN)
    body = ddm.Body([rectangle(1, 1)], cracks, ROCK)
    stress = np.array([1.0, 2.0, 0.5])
    by_traction = body.solve(uniform_load([rectangle(1, 1)], stress))
    by_field = body.solve(ddm.BodyLoad(remote_stress=stress))
    # Both discretise the same field; the difference is the boundary's own discretisation error.
    assert np.allclose(by_field.tips["k_i"], by_traction.tips["k_i"], rtol=1e-9)
    p = np.array([[0.5, 0.5], [-0.7, 0.2]])
    assert np.allclose(by_field.displacement(p), by_traction.displacement(p), atol=1e-9 / ROCK.youngs_modulus)


def test_remote_stress_leaves_holes_free():
    """As in the infinite plane: it is the tractions on the outline, and K of a crack beside the hole is theirs. The
    crack is added afterwards as well, as growth does."""
    hole = 0.3 * np.array([[1.0, 0.0], [0.0, -1.0], [-1.0, 0.0], [0.0, 1.0]])
    stress, cracks = np.array([1.0, 2.0, 0.5]), line([0.45, -0.1], [0.7, 0.2], aperture=OPEN)
    load = ddm.BodyLoad(remote_stress=stress)
    before = ddm.Body([rectangle(1, 1), hole], Cracks.from_polylines([]), ROCK)
    for _ in range(3):
        before.solve(load)
    by_traction = ddm.Body([rectangle(1, 1), hole], cracks, ROCK).solve(uniform_load([rectangle(1, 1)], stress))
    for previous in (None, before):
        by_field = ddm.Body([rectangle(1, 1), hole], cracks, ROCK, reuse=ddm.Reuse(previous)).solve(load)
        for name in ("k_i", "k_ii"):
            np.testing.assert_allclose(by_field.tips[name], by_traction.tips[name], rtol=1e-8)
        at = np.array([[0.5, 0.5], [-0.7, 0.2]])
        np.testing.assert_allclose(by_field.stress(at), by_traction.stress(at), rtol=1e-7)
        wall = by_field.stress(np.array([[0.15, 0.15]]))[0]
        across = np.array([wall[0] + wall[2], wall[1] + wall[2]])  # σ n √2 there
        assert np.abs(across).max() < 1e-2  # near the middle of a side between two corners


def test_hole_in_tension(verified):
    """Kirsch (1898): 3σ beside a circular hole and σ(1 + 1/8 + 3/32) one radius away. The middle of a facet of an n-gon
    sees O(1/n) less, so n = 48 and 96 are extrapolated; 1 % for the plate, which is only twenty radii wide."""
    beside = []
    for n in (48, 96):
        q = -2 * np.pi * (np.arange(n) + 0.5) / n
        hole = np.column_stack([np.cos(q), np.sin(q)])
        sol = ddm.Body([rectangle(20, 20), hole], Cracks.from_polylines([]), ROCK).solve(pull(20, 20))
        apothem = math.cos(math.pi / n)
        s = sol.stress([[apothem, 0.0], [0.0, apothem], [2.0, 0.0]])
        beside.append((s[0, 1], s[1, 0]))
    print(f"hole of 48, 96 sides: {np.array(beside)[:, 0] - 3} of 3 σ, {np.array(beside)[:, 1] + 1} of −σ")
    verified(
        "beside a circular hole, 48 and 96 sides extrapolated: stress",
        (2 * beside[1][0] - beside[0][0]) / 3 - 1,
        "Kirsch 1898",
    )
    assert 2 * beside[1][0] - beside[0][0] == pytest.approx(3.0, rel=0.01)
    assert 2 * beside[1][1] - beside[0][1] == pytest.approx(-1.0, abs=0.03)
    assert s[2, 1] == pytest.approx(1 + 0.5 / 4 + 1.5 / 16, rel=0.01)


def test_block_under_its_own_weight_on_a_base_pressure():
    """σ_yy = −ρg(h − y) and nothing else; 1e-8: the field is in the elements' span."""
    g = np.array([0.0, -2600 * 9.81])
    w, h = 0.5, 1.0
    load = ddm.BodyLoad(segments=[[[-w, -h], [w, -h]]], tractions=[[[0, 2 * h * 2600 * 9.81]] * 2], body_force=g)
    sol = ddm.Body([rectangle(w, h)], Cracks.from_polylines([]), ROCK).solve(load)
    p = np.array([[0.1, 0.3], [-0.4, -0.9], [0.0, 0.8], [0.5, 0.1]])
    expected = np.column_stack([0 * p[:, 1], g[1] * (h - p[:, 1]), 0 * p[:, 1]])
    assert np.allclose(sol.stress(p), expected, atol=1e-8 * 2600 * 9.81)


def test_crack_in_a_heavy_block_feels_the_local_stress(verified):
    """A short vertical stress gradient over a small horizontal slot: K_I = σ_yy √(πa) at its depth, 1e-3 for a/W =
    0.02."""
    weight = 2600 * 9.81
    load = ddm.BodyLoad(segments=[[[-1, -1], [1, -1]]], tractions=[[[0, 2 * weight]] * 2], body_force=[0, -weight])
    sol = ddm.Body([rectangle(1, 1)], line([-0.02, 0.2], [0.02, 0.2], aperture=OPEN), ROCK).solve(load)
    exact = fracture.griffith(-0.8 * weight, 0.02)
    print(f"crack in a heavy block: {np.abs(sol.tips['k_i'] / exact - 1).max():.1e}")
    verified("small crack in a heavy block: K_I", np.abs(sol.tips["k_i"] / exact - 1).max(), "closed form")
    assert np.allclose(sol.tips["k_i"], exact, rtol=1e-3)


def test_spinning_disc_and_square(verified):
    """Disc: a 96-gon of the same area, 2e-3. Square: mean stress ρω²w²/12 by Gauss points over the area, 1e-5."""
    rate, rho = 10.0, ROCK.density
    q = 2 * np.pi * np.arange(96) / 96
    radius = math.sqrt(math.pi / (48 * math.sin(2 * math.pi / 96)))
    spin = ddm.BodyLoad(body_force_gradient=rho * rate**2 * np.eye(2), about=[0, 0])
    disc = ddm.Body([radius * np.column_stack([np.cos(q), np.sin(q)])], Cracks.from_polylines([]), ROCK).solve(spin)
    centre = disc.stress([[0.01, 0.02]])[0]
    exact = fracture.spinning_disc_centre(rho, rate, 1.0, ROCK.poissons_ratio)
    print(f"spinning disc: {np.abs(centre[:2] / exact - 1).max():.1e}")
    verified("spinning disc of 96 sides: stress in the middle", np.abs(centre[:2] / exact - 1).max(), "closed form")
    assert np.allclose(centre[:2], exact, rtol=2e-3) and abs(centre[2]) < 2e-3 * exact
    square = ddm.Body([rectangle(0.5, 0.5)], Cracks.from_polylines([]), ROCK).solve(spin)
    x, w = np.polynomial.legendre.leggauss(16)
    grid = np.stack(np.meshgrid(x / 2, x / 2), axis=-1).reshape(-1, 2)
    mean = (np.outer(w, w).ravel() / 4) @ square.stress(grid)
    assert np.allclose(mean, [rho * rate**2 / 12, rho * rate**2 / 12, 0], atol=1e-5 * rho * rate**2)


def test_body_force_about_another_point_is_the_same_field():
    rho = 2600.0
    g = np.array([[1.0, 0.8], [0.2, -0.5]]) * rho
    centre = ddm.Body([rectangle(1, 0.5)], line([-0.2, 0.1], [0.3, -0.1], aperture=OPEN), ROCK)
    one = centre.solve(ddm.BodyLoad(body_force_gradient=g, about=[0, 0]))
    other = centre.solve(ddm.BodyLoad(body_force=g @ [2.0, -1.0], body_force_gradient=g, about=[2.0, -1.0]))
    assert np.allclose(one.tips["k_i"], other.tips["k_i"], rtol=1e-10)


def test_partly_loaded_sides_transmit_their_resultant():
    """Strips that end inside elements press on a block: force and moment across a cut are those of the strip.
    2e-3: a jump of the traction inside an element of order 4 acts like a small self-equilibrated error there."""
    outline = rectangle(1, 1)
    segments = [[[0.45, 1], [-0.13, 1]], [[-0.13, -1], [0.45, -1]]]
    tractions = [[[0, -2.0], [0, -1.0]], [[0, 1.0], [0, 2.0]]]
    sol = ddm.Body([outline], Cracks.from_polylines([]), ROCK).solve(ddm.BodyLoad(segments, tractions))
    x, w = np.polynomial.legendre.leggauss(40)
    across = sol.stress(np.column_stack([x, 0 * x]))
    force = 0.58 * 1.5
    assert w @ across[:, 1] == pytest.approx(-force, rel=2e-3)
    # Trapezoid: first moment of the pressure about x = 0.
    moment = 0.58 / 6 * (0.45 * (2 * 2 + 1) + -0.13 * (2 + 2 * 1))
    assert (w * x) @ across[:, 1] == pytest.approx(-moment, rel=2e-3, abs=2e-3 * force)
    assert abs(w @ across[:, 2]) < 2e-3 * force


@pytest.mark.parametrize(("order", "tolerance"), [(4, 1e-4), (8, 1e-5)])
@pytest.mark.parametrize("half", [0.01, 0.1, 0.3])
def test_a_short_load_between_nodes_of_a_side_transmits_its_force(half, order, tolerance):
    """Beside it the elements are as long as its own: mirror images, of which what is singular at the load's ends
    cancels. Measured 4e-5 and 4e-6 at most; beside longer neighbours it was 3e-3 and 1e-3."""
    outline = np.array([[-2, -1], [2, -1], [2, 1], [half, 1], [-half, 1], [-2, 1]], dtype=float)
    load = ddm.BodyLoad(sides={3: (0.0, -1.0), 0: (0.0, half / 2)})
    sol = ddm.Body([outline], Cracks.from_polylines([]), ROCK, DdmSettings(order=order)).solve(load)
    x, w = np.polynomial.legendre.leggauss(60)
    assert 2 * w @ sol.stress(np.column_stack([2 * x, 0 * x]))[:, 1] == pytest.approx(-2 * half, rel=tolerance)


@pytest.mark.parametrize("off", [1e-7, 1e-3, 0.02, 0.05, 0.1, 0.2, 0.33, 0.4])
def test_k_does_not_depend_on_where_a_load_ends_on_an_element(off):
    """Default mesh against order 8 and four times the elements, the load ending anywhere on them: 5e-4 (2e-6 at an
    end)."""
    square, crack = rectangle(1, 1), line([-0.3, 0], [0.3, 0.1], aperture=OPEN)
    y = 1 - off
    load = ddm.BodyLoad([[[-y, -1], [y, -1]], [[y, 1], [-y, 1]]], [[[0, -1.0]] * 2, [[0, 1.0]] * 2])
    fine = DdmSettings(order=8, elements_per_side=24, grading_layers=4)
    k, exact = (ddm.Body([square], crack, ROCK, s).solve(load).tips["k_i"] for s in (DdmSettings(), fine))
    print(f"load that ends {off} before a corner: {np.abs(k / exact - 1).max():.1e}")
    assert np.allclose(k, exact, rtol=1e-5 if off == 1e-7 else 5e-4)


def test_crack_across_a_bending_stress_closes_by_a_third(verified):
    """Frictionless contact with an unknown edge: closure point and K_I in closed form. The plate is 40 crack lengths
    wide; the closure point is known to a node's spacing, K_I to 1 %."""
    w = 20.0
    load = ddm.BodyLoad(
        segments=[[[-w, -w], [w, -w]], [[w, w], [-w, w]]],
        tractions=[[[0, w], [0, -w]], [[0, w], [0, -w]]],
    )
    body = ddm.Body([rectangle(w, w)], line([-0.5, 0], [0.5, 0]), ROCK, DdmSettings(elements_per_crack=24))
    sol = body.solve(load)
    shut, k = fracture.crack_in_bending(1.0, 0.5)
    x = body.faces.nodes[..., 0]
    edge = x[sol.states != 0].max()
    print(f"crack in bending: closes {edge - shut:.1e} off, K_I {sol.tips['k_i'][1] / k - 1:.1e}")
    verified("crack across a bending stress that closes in part: K_I", sol.tips["k_i"][1] / k - 1, "closed form")
    assert abs(edge - shut) < 1.0 / 24
    assert sol.tips["k_i"][0] == 0 and sol.tips["k_i"][1] == pytest.approx(k, rel=0.01)
    assert sol.faces.opening[:, 1:-1].min() >= -1e-9 * sol.faces.opening.max()
    assert sol.faces.traction[..., 0].max() <= 1e-9


def test_compliance_of_a_small_crack_is_dilute(verified):
    """2e-3: finite-size correction of order (a/W)² for a/W = 0.02; a closed crack keeps the shear part only."""
    a = 0.02
    cracks = line([-a, 0], [a, 0])
    body = ddm.Body([rectangle(1, 1)], cracks, ROCK)
    exact = fracture.dilute_compliance(a, 4.0, ROCK.plane_modulus)
    got = body.compliance()
    print(f"dilute compliance: {np.abs(got - exact).max() / exact[1, 1]:.1e}")
    verified("compliance of a small crack", np.abs(got - exact).max() / exact[1, 1], "dilute limit")
    assert np.allclose(got, exact, atol=2e-3 * exact[1, 1])
    pressed = body.solve(ddm.BodyLoad(remote_stress=[0, -1e6, 0.2e6]))
    closed = body.compliance(pressed)
    assert np.allclose(closed, np.diag([0, 0, exact[2, 2]]), atol=2e-3 * exact[1, 1])
    assert np.allclose(pressed.crack_strain, closed @ [0, -1e6, 0.2e6], rtol=1e-9, atol=1e-18)
