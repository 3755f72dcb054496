"""Cracks in the infinite plane against closed forms of linear elastic fracture mechanics."""

import math

import numpy as np
import pytest

from geomech import ddm
from geomech.model import Cracks, DdmSettings, Material
from geomech.reference.cracks import fracture

ROCK = Material("rock", youngs_modulus=17e9, poissons_ratio=0.21)
OPEN = math.inf


def straight(a, angle=0.0, **kwargs):
    u = a * np.array([math.cos(angle), math.sin(angle)])
    return Cracks.from_polylines([np.array([-u, u])], **kwargs)


# Measured with independent code for 4 elements, relative error of K_I (a factor 1.3 left for round-off of the table).
TABLE = {
    ("equal", 2): 8.2e-4, ("equal", 3): 5e-4, ("equal", 4): 3e-5, ("equal", 6): 1.3e-6, ("equal", 8): 6e-8,
    ("gauss", 2): 4e-4, ("gauss", 3): 1.3e-4, ("gauss", 4): 6e-6, ("gauss", 6): 1.3e-7, ("gauss", 8): 3e-9,
    ("chebyshev", 2): 1.1e-4, ("chebyshev", 3): 4.4e-5, ("chebyshev", 4): 2e-6, ("chebyshev", 6): 3e-8,
    ("chebyshev", 8): 6e-10,
}  # fmt: skip


@pytest.mark.parametrize(("nodes", "order"), TABLE)
def test_griffith(nodes, order):
    body = ddm.Body([], straight(2.0, aperture=OPEN), ROCK, DdmSettings(order=order, nodes=nodes))
    sol = body.solve(ddm.BodyLoad(remote_stress=[0, 3e6, 0]))
    error = sol.tips["k_i"] / fracture.griffith(3e6, 2.0) - 1
    print(f"Griffith, {nodes} nodes, order {order}: K_I {np.abs(error).max():.1e}")
    assert np.abs(error).max() < 1.3 * TABLE[nodes, order]
    assert np.allclose(sol.tips["k_ii"], 0, atol=1e-9 * fracture.griffith(3e6, 2.0))


@pytest.mark.parametrize("order", [11, 12])
def test_the_highest_orders_are_right_to_eleven_digits(order):
    """Twice what was measured, 5e-12 and 1.3e-12: there round-off takes over from the order."""
    sol = ddm.Body([], straight(2.0, aperture=OPEN), ROCK, DdmSettings(order=order)).solve(
        ddm.BodyLoad(remote_stress=[0, 3e6, 0])
    )
    assert np.abs(sol.tips["k_i"] / fracture.griffith(3e6, 2.0) - 1).max() < (1e-11 if order == 11 else 3e-12)


def test_one_element_with_two_tips_is_exact():
    """The exact opening is the weight itself: round-off (1e-12) remains."""
    body = ddm.Body([], straight(0.5, aperture=OPEN), ROCK, DdmSettings(elements_per_crack=1))
    sol = body.solve(ddm.BodyLoad(remote_stress=[0, 1e6, 0]))
    assert np.allclose(sol.tips["k_i"], fracture.griffith(1e6, 0.5), rtol=1e-12)
    x = sol.faces.points[0, :, 0]
    exact = fracture.griffith_opening(1e6, 0.5, x, ROCK.plane_modulus)
    assert np.allclose(sol.faces.opening[0], exact, atol=1e-12 * exact.max())


def test_pressure_inside_is_tension_outside():
    body = ddm.Body([], straight(1.0, aperture=OPEN), ROCK)
    sol = body.solve(ddm.BodyLoad(crack_pressure=2e6))
    # 2e-6: the discretisation error of p = 4 (table above); what is compared is the load, to the same digits.
    assert np.allclose(sol.tips["k_i"], fracture.griffith(2e6, 1.0), rtol=2e-6)
    assert np.allclose(sol.faces.traction[..., 0], -2e6, rtol=1e-9)


@pytest.mark.parametrize("angle", [-1.1, 0.4, 0.9, 2.5])
def test_slanted(verified, angle):
    stress = np.array([0.3e6, 2e6, -0.7e6])
    sol = ddm.Body([], straight(1.0, angle, aperture=OPEN), ROCK).solve(ddm.BodyLoad(remote_stress=stress))
    k_i, k_ii = fracture.slanted(stress, angle, 1.0)
    found = np.abs([sol.tips["k_i"] - k_i, sol.tips["k_ii"] - k_ii]).max() / 2e6
    print(f"slanted crack, {math.degrees(angle):.0f}°: {found:.1e}")
    verified("slanted crack, four angles: K", found, "closed form")
    # 2e-6 of the size: the discretisation error of p = 4.
    assert np.allclose(sol.tips["k_i"], k_i, atol=4e-6 * 2e6)
    assert np.allclose(sol.tips["k_ii"], k_ii, atol=4e-6 * 2e6)


def test_collinear_pair(verified):
    cracks = Cracks.from_polylines([np.array([[-1, 0], [-0.2, 0]]), np.array([[0.2, 0], [1, 0.0]])], aperture=OPEN)
    sol = ddm.Body([], cracks, ROCK, DdmSettings(order=8)).solve(ddm.BodyLoad(remote_stress=[0, 1, 0]))
    inner, outer = fracture.collinear_pair(1.0, 0.2, 1.0)
    # The published values are K/σ.
    assert (inner, outer) == pytest.approx((1.24707706, 1.17893319), rel=1e-8)
    print(f"collinear pair, order 8: {np.abs(sol.tips['k_i'] / [outer, inner, inner, outer] - 1).max():.1e}")
    verified(
        "two collinear cracks, order 8: K_I",
        np.abs(sol.tips["k_i"] / [outer, inner, inner, outer] - 1).max(),
        "Willmore 1949",
    )
    # Order 8 leaves 1e-9 on a single crack; 1e-7 here, as the neighbour's field varies along the elements.
    assert np.allclose(sol.tips["k_i"], [outer, inner, inner, outer], rtol=1e-7)


def star():
    arms = np.array([[math.cos(q), math.sin(q)] for q in (math.pi / 2, math.pi * 7 / 6, math.pi * 11 / 6)])
    return Cracks(
        nodes=np.vstack([[[0.0, 0.0]], arms]),
        segments=np.array([[0, 1], [0, 2], [0, 3]]),
        crack=np.arange(3),
        block=np.zeros(3, int),
        birth_cycle=np.zeros(3, int),
        aperture=np.full(3, OPEN),
        surface=np.zeros(4, bool),
        names=("a", "b", "c"),
    )


def test_three_armed_star(verified):
    """Junction with two graded layers; 3e-5 is what the junction's singularity leaves then, four layers leave 5e-6."""
    for layers, tolerance in ((2, 3e-5), (4, 5e-6)):
        body = ddm.Body([], star(), ROCK, DdmSettings(order=6, grading_layers=layers))
        sol = body.solve(ddm.BodyLoad(crack_pressure=1.0))
        error = sol.tips["k_i"] / math.sqrt(math.pi) / fracture.THREE_ARMED_STAR - 1
        print(f"three-armed star, {layers} layers: {np.abs(error).max():.1e}")
        verified(f"three-armed star, {layers} layers of grading", np.abs(error).max(), "published value")
        assert np.allclose(sol.tips["k_i"] / math.sqrt(math.pi), fracture.THREE_ARMED_STAR, rtol=tolerance)


def test_arc_converges_with_first_order(verified):
    """A polyline through the arc has the wrong tip direction by O(1/n): halving with each doubling is the order there
    is."""
    exact = fracture.circular_arc(1.0, 1.0, math.pi / 4)
    errors = []
    for n in (10, 20, 40):
        q = np.linspace(math.pi / 4, 3 * math.pi / 4, n + 1)
        cracks = Cracks.from_polylines([np.column_stack([np.cos(q), np.sin(q)])], aperture=OPEN)
        sol = ddm.Body([], cracks, ROCK, DdmSettings(elements_per_crack=n)).solve(ddm.BodyLoad(remote_stress=[1, 1, 0]))
        k = np.array([np.abs(sol.tips["k_i"]), np.abs(sol.tips["k_ii"])]).mean(axis=1)
        errors.append(np.abs(k - exact).max())
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    print(f"arc of 10, 20, 40 chords: {np.array(errors)}, order {order.round(2)}")
    verified("arc drawn as chords: K", errors, "closed form", over=("chords", (10, 20, 40)))
    assert np.all(order > 0.85) and errors[-1] < 0.02


def test_closed_crack_carries_shear_only(verified):
    stress = np.array([-1e6, -6e6, 0.5e6])
    for angle in (0.3, 1.0, -0.8):
        sol = ddm.Body([], straight(0.7, angle), ROCK).solve(ddm.BodyLoad(remote_stress=stress))
        _, k_ii = fracture.closed(stress, angle, 0.7)
        print(f"closed crack, {math.degrees(angle):.0f}°: K_II {np.abs(sol.tips['k_ii'] / k_ii - 1).max():.1e}")
        verified(
            f"closed crack at {math.degrees(angle):.0f}°: K_II",
            np.abs(sol.tips["k_ii"] / k_ii - 1).max(),
            "closed form",
        )
        assert (sol.tips["k_i"] == 0).all() and (sol.states != 0).all()
        assert np.allclose(sol.tips["k_ii"], k_ii, rtol=2e-6)
        assert np.abs(sol.faces.opening).max() == 0
        normal = fracture.slanted(stress, angle, 0.7)[0] / math.sqrt(math.pi * 0.7)
        assert np.allclose(sol.faces.traction[..., 0], normal, rtol=1e-9)


def test_slot_keeps_negative_k_i_and_an_aperture_closes_late():
    stress = np.array([0.0, -5e6, 0.0])
    slot = ddm.Body([], straight(1.0, aperture=OPEN), ROCK).solve(ddm.BodyLoad(remote_stress=stress))
    assert np.allclose(slot.tips["k_i"], fracture.griffith(-5e6, 1.0), rtol=2e-6)
    # The middle of the crack closes by 4σa/E': an aperture of half that is used up, twice that is not.
    reach = 4 * 5e6 / ROCK.plane_modulus
    wide = ddm.Body([], straight(1.0, aperture=2 * reach), ROCK).solve(ddm.BodyLoad(remote_stress=stress))
    narrow = ddm.Body([], straight(1.0, aperture=0.5 * reach), ROCK).solve(ddm.BodyLoad(remote_stress=stress))
    assert (wide.states == 0).all() and (narrow.states != 0).any()
    at_nodes = narrow.faces.opening[:, 1:-1]
    assert at_nodes.min() > -0.5 * reach * (1 + 1e-9)


def test_near_and_far_field_of_a_crack():
    """σ_yy ahead of a crack in tension is σ x/√(x²−a²) (Westergaard 1939). 2e-6: the K error of p = 4."""
    sol = ddm.Body([], straight(1.0, aperture=OPEN), ROCK).solve(ddm.BodyLoad(remote_stress=[0, 1e6, 0]))
    x = np.array([1 + 1e-4, 1.01, 1.5, 3.0, 1e3])
    stress = sol.stress(np.column_stack([x, 0 * x]))
    assert np.allclose(stress[2:, 1], 1e6 * x[2:] / np.sqrt(x[2:] ** 2 - 1), rtol=3e-6)
    # Faces without traction: exactly so at the nodes (1e-9), to 1e-3 between them, the discretisation error of p = 4.
    for t, tolerance in ((sol.body.faces.nodes.reshape(-1, 2), 1e-9), (np.array([[-0.3, 0.0], [0.2, 0.0]]), 1e-3)):
        assert np.abs(sol.stress(t)[:, 1:]).max() < tolerance * 1e6


def test_displacement_is_consistent_with_stress():
    """Hooke's law on central differences of the displacement, 1e-6 for h = 1e-4."""
    sol = ddm.Body([], straight(1.0, 0.6, aperture=OPEN), ROCK).solve(ddm.BodyLoad(remote_stress=[1e6, -2e6, 0.4e6]))
    p, h = np.array([[0.4, 1.1], [-2.0, 0.3], [0.1, -0.6]]), 1e-4
    ux = (sol.displacement(p + [h, 0]) - sol.displacement(p - [h, 0])) / (2 * h)
    uy = (sol.displacement(p + [0, h]) - sol.displacement(p - [0, h])) / (2 * h)
    strain = np.column_stack([ux[:, 0], uy[:, 1], ux[:, 1] + uy[:, 0]])
    assert np.allclose(strain @ ROCK.stiffness().T, sol.stress(p), atol=2e-6 * 2e6)
