"""One block of order p alone: its basis, exact beam solutions that are polynomials, and free vibrations of bar and
beam."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from scipy.linalg import eigh

from geomech import dda
from geomech.dda import EDGE_FORCE, POINT_FORCE
from geomech.dda.higher_order.deflected_blocks import DeflectedBlocks
from geomech.dda.higher_order.deflection_basis import DeflectionBasis, n_deflections
from geomech.dda.kinematics.polygon_quadrature import gauss_points, lobatto_points, polygon_points
from geomech.model import Blocks, Material

L_SHAPE = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3.0]])
TRIANGLE = np.array([[0, 0], [4, 1], [1, 2.0]])


def turned(polygon: np.ndarray, angle: float, shift=(0.0, 0.0)) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return polygon @ np.array([[c, s], [-s, c]]) + shift


def beam(length: float, depth: float) -> np.ndarray:
    return np.array([[0, 0], [length, 0], [length, depth], [0, depth]], float) - [0, 0.5 * depth]


def basis_of(*polygons, order) -> tuple[DeflectionBasis, Blocks]:
    blocks = Blocks.from_polygons(list(polygons))
    order = np.broadcast_to(order, len(polygons))
    return DeflectionBasis.of(blocks.vertices, blocks.next_vertex, blocks.vertex_start, order), blocks


def matrices(basis: DeflectionBasis, blocks: Blocks, rock: Material) -> tuple[np.ndarray, np.ndarray]:
    """Mass and stiffness (6 + m, 6 + m) of the only block."""
    m = n_deflections(int(basis.order[0]))
    moments = dda.block_moments(blocks.vertices, blocks.next_vertex, blocks.vertex_start)[0]
    mass, stiffness = np.zeros((6 + m, 6 + m)), np.zeros((6 + m, 6 + m))
    mass[:6, :6] = dda.mass_matrix(moments, rock.density)
    mass[3:6, 6:] = rock.density * basis.coupling[0][:, :m]
    mass[6:, 3:6] = mass[3:6, 6:].T
    mass[6:, 6:] = rock.density * basis.area[0] * np.eye(m)
    stiffness[3:6, 3:6] = moments[0] * rock.stiffness()
    stiffness[6:, 6:] = basis.stiffness(0, blocks.vertices, blocks.vertices[blocks.next_vertex], rock.stiffness())
    return mass, stiffness


@pytest.mark.parametrize("shape", [beam(10.0, 1.0), L_SHAPE, TRIANGLE], ids=["beam", "L", "triangle"])
@pytest.mark.parametrize("order", [2, 5, 8])
def test_deflections_are_orthonormal_and_carry_neither_momentum_nor_mean_strain(shape, order):
    basis, blocks = basis_of(turned(shape, 0.4, (50.0, -20.0)), order=order)
    start, end = blocks.vertices, blocks.vertices[blocks.next_vertex]
    # Quadrature about another point than the basis was made with: signed triangles that overlap.
    points, weights = polygon_points(start, end, start[0] + [0.3, -0.2], 2 * order)
    values, rigid = basis.displacement(points, 0), dda.displacement_matrix(points, basis.centroid[0])
    gram = np.einsum("k,kai,kaj->ij", weights, values, values) / basis.area[0]
    # Overlapping signed triangles cancel, and polynomials of order 8 are large outside the block.
    assert gram == pytest.approx(np.eye(len(gram)), abs=1e-8)
    assert np.abs(np.einsum("k,kai,kaj->ij", weights, rigid[..., :3], values)).max() < 1e-8 * basis.area[0] ** 1.5
    assert np.abs(np.einsum("k,kej->ej", weights, basis.strain(points, 0))).max() < 1e-7 * basis.area[0] ** 0.5


def test_strains_are_the_derivatives_of_displacements():
    basis, _ = basis_of(turned(L_SHAPE, 0.4), order=6)
    at, step = np.array([[0.3, 0.7], [1.2, 0.9]]), 1e-6
    slope = [
        (basis.displacement(at + way, 0) - basis.displacement(at - way, 0)) / (2 * step) for way in step * np.eye(2)
    ]
    found = np.stack([slope[0][:, 0], slope[1][:, 1], slope[1][:, 0] + slope[0][:, 1]], axis=1)
    assert basis.strain(at, 0) == pytest.approx(found, abs=1e-7 * np.abs(found).max())


@pytest.mark.parametrize("degree", [3, 8, 16])
def test_polygon_points_integrate_monomials_exactly(degree):
    # ∫ xᵃ yᵇ over a triangle (0,0), (1,0), (0,1) is a! b! / (a + b + 2)!; the square around it takes a hole out.
    triangle = np.array([[0, 0], [1, 0], [0, 1.0]])
    square = np.array([[-2, -2], [2, -2], [2, 2], [-2, 2.0]])
    blocks = Blocks.from_polygons([[square, triangle]])
    points, weights = polygon_points(blocks.vertices, blocks.vertices[blocks.next_vertex], np.zeros(2), degree)
    for a in range(0, degree + 1, 2):
        b = degree - a
        exact = (Fraction(2) ** (a + 1) * (1 - (-1) ** (a + 1)) / (a + 1)) * (
            Fraction(2) ** (b + 1) * (1 - (-1) ** (b + 1)) / (b + 1)
        )
        exact -= Fraction(math.factorial(a) * math.factorial(b), math.factorial(a + b + 2))
        assert weights @ (points[:, 0] ** a * points[:, 1] ** b) == pytest.approx(
            float(exact), rel=1e-12, abs=1e-12 * 4.0**degree
        )


@pytest.mark.parametrize("n", [2, 3, 5, 10])
def test_gauss_and_lobatto_points_are_exact_for_their_degrees(n):
    for (at, weight), degree in ((gauss_points(n), 2 * n - 1), (lobatto_points(n), 2 * n - 3)):
        assert weight @ at**degree == pytest.approx(1 / (degree + 1), rel=1e-13)
    assert lobatto_points(n)[0][[0, -1]].tolist() == [0.0, 1.0]


def test_an_order_that_does_not_exist_is_refused():
    with pytest.raises(ValueError, match="1 to 10"):
        basis_of(TRIANGLE, order=11)


@pytest.mark.parametrize("plane", ["stress", "strain"])
@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_a_cantilever_of_order_three_is_exact(plane, angle):
    """Beam under the end tractions of Timoshenko & Goodier (1970, art. 21), whose displacement is a cubic: the strain
    energy, which tip deflections follow from, is P² L³ / (6 E' I) (1 + 3 (1 + ν') D² / (5 L²)) for depth D."""
    length, depth, load = 8.0, 1.0, 1e6
    rock = Material("rock", 2e10, 0.2, 2500.0, plane=plane)
    basis, blocks = basis_of(turned(beam(length, depth), angle), order=3)
    _, stiffness = matrices(basis, blocks, rock)
    inertia = depth**3 / 12
    way, across = turned(np.eye(2), angle)
    force = np.zeros(len(stiffness))
    at, weight = gauss_points(4)
    for x, sign in ((0.0, -1.0), (length, 1.0)):
        y = depth * (at - 0.5)
        points = x * way + y[:, None] * across
        # σxx = −P (L − x) y / I and a parabolic shear stress, P upwards at x = L.
        shear = load / (2 * inertia) * (depth**2 / 4 - y**2)
        traction = sign * (-load * (length - x) * y / inertia)[:, None] * way + sign * shear[:, None] * across
        matrix = np.concatenate(
            [dda.displacement_matrix(points, basis.centroid[0]), basis.displacement(points, 0)], axis=2
        )
        force += np.einsum("k,kaj,ka->j", depth * weight, matrix, traction)
    # In equilibrium; the nearest motion of the singular system has the right strains.
    assert np.abs(force[:3]).max() < 1e-9 * load * length
    energy = 0.5 * force[3:] @ np.linalg.solve(stiffness[3:, 3:], force[3:])
    modulus, nu = rock.plane_modulus, rock.effective_poissons_ratio / (1 - rock.effective_poissons_ratio)
    exact = load**2 * length**3 / (6 * modulus * inertia) * (1 + 3 * (1 + nu) * depth**2 / (5 * length**2))
    assert energy == pytest.approx(exact, rel=1e-10)


def bent_ring(points: np.ndarray) -> np.ndarray:
    """(n, 2, 2) stress of a curved bar of radii 1 and 2 m about the origin under moments on its ends alone (Golovin 1881;
    Timoshenko & Goodier 1970, art. 29), Pa, for M = −1 MN m/m."""
    r = np.hypot(*points.T)
    a, b, log = 1.0, 2.0, math.log(2.0)
    n = (b * b - a * a) ** 2 - 4 * a * a * b * b * log**2
    first, outer, inner = a * a * b * b / r**2 * log, b * b * np.log(r / b), a * a * np.log(a / r)
    radial, hoop = 4e6 / n * (first + outer + inner), 4e6 / n * (-first + outer + inner + b * b - a * a)
    way = points / r[:, None]
    around = np.stack([-way[:, 1], way[:, 0]], axis=1)
    return (
        radial[:, None, None] * way[:, :, None] * way[:, None]
        + hoop[:, None, None] * around[:, :, None] * around[:, None]
    )


@pytest.mark.parametrize(("turn", "highest"), [(math.pi / 4, 1e-5), (math.pi / 2, 2e-3)])
def test_a_thick_ring_sector_of_one_block_converges(turn, highest):
    """An eighth and a quarter of a ring of radii 1 and 2 m as one block under the tractions of a moment: strain energy against that of
    the stress over the same polygon of 24 chords, which no polynomial contains."""
    rock = Material("rock", 2e10, 0.25, 2500.0, plane="stress")
    angle = np.linspace(0, turn, 25)
    arc = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    polygon = np.concatenate([arc[::-1], 2 * arc])
    at, weight = gauss_points(8)
    points, forces = [], []
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0)):
        side = a + at[:, None] * (b - a)
        normal = np.array([b[1] - a[1], a[0] - b[0]])
        points.append(side)
        forces.append(weight[:, None] * (bent_ring(side) @ normal))
    points, forces = np.concatenate(points), np.concatenate(forces)
    energy = 0.0
    for a, b, c, d in zip(arc[:-1], 2 * arc[:-1], 2 * arc[1:], arc[1:]):
        for p, q, r in ((a, b, c), (a, c, d)):
            s, t = (each.ravel() for each in np.meshgrid(at, at))
            inside = p + s[:, None] * (q - p) + (s * t)[:, None] * (r - q)
            share = np.abs((q - p)[0] * (r - q)[1] - (q - p)[1] * (r - q)[0]) * np.outer(weight, weight).ravel() * s
            stress = bent_ring(inside)
            trace = stress[:, 0, 0] + stress[:, 1, 1]
            energy += 0.5 / 2e10 * share @ (1.25 * (stress**2).sum(axis=(1, 2)) - 0.25 * trace**2)
    error = {}
    for order in (2, 3, 5, 7, 8):
        basis, blocks = basis_of(polygon, order=order)
        _, stiffness = matrices(basis, blocks, rock)
        matrix = np.concatenate(
            [dda.displacement_matrix(points, basis.centroid[0]), basis.displacement(points, 0)], axis=2
        )
        force = np.einsum("kaj,ka->j", matrix, forces)
        error[order] = 1 - 0.5 * force[3:] @ np.linalg.solve(stiffness[3:, 3:], force[3:]) / energy
    print("ring sector of one block, energy off by", {order: f"{each:.1e}" for order, each in error.items()})
    assert 0 < error[8] < highest
    assert error[2] > 2 * error[3] > 8 * error[5] > 40 * error[7]


def frequencies(polygon: np.ndarray, order: int, rock: Material) -> np.ndarray:
    """Circular frequencies of the free block beyond the three rigid motions, rad/s."""
    basis, blocks = basis_of(polygon, order=order)
    mass, stiffness = matrices(basis, blocks, rock)
    return np.sqrt(np.maximum(eigh(stiffness, mass, eigvals_only=True), 0.0))[3:]


def test_the_first_vibration_of_a_bar_converges_with_the_order():
    """ω = π c / L of a free bar without Poisson's ratio. The mode is odd, so that odd orders add to it: uniform strain
    is √12/π − 1 = 10 % too stiff, and each further odd order has about twice the digits."""
    rock = Material("rock", 1e10, 0.0, 2500.0, plane="stress")
    exact = np.pi / 10.0 * np.sqrt(rock.youngs_modulus / rock.density)
    # Bending is slower or faster: the bar's mode is the one at its frequency.
    error = {p: np.abs(frequencies(beam(10.0, 1.0), p, rock) / exact - 1).min() for p in (2, 3, 5, 7)}
    assert error[2] == pytest.approx(np.sqrt(12) / np.pi - 1, rel=1e-9)
    assert error[3] < 3e-4
    assert error[5] < 2e-7
    assert error[7] < 1e-9


def test_three_vibrations_of_a_bar():
    """ω = n π c / L, n = 1, 2, 3, of one block of order 8."""
    rock = Material("rock", 1e10, 0.0, 2500.0, plane="stress")
    exact = np.arange(1, 4) * np.pi / 10.0 * np.sqrt(rock.youngs_modulus / rock.density)
    found = frequencies(beam(10.0, 1.0), 8, rock)
    errors = np.abs(found[:, None] / exact - 1).min(axis=0)
    print("first three frequencies of a bar, order 8, off by", errors)
    assert errors[0] < 1e-9 and errors[1] < 1e-6 and errors[2] < 1e-3


def test_the_first_vibrations_of_a_beam_converge_with_the_order():
    """Free beam of slenderness 20. ω = 22.3733 √(E I / ρ A) / L² of Euler & Bernoulli (Timoshenko 1955), and 61.6728
    times that for the second, are lowered by shear and rotatory inertia, 1 % and 2.5 %; errors of lower orders are
    those against p = 8, of a mode that is even in x by even orders."""
    rock = Material("rock", 1e10, 0.25, 2500.0, plane="stress")
    length, depth = 20.0, 1.0
    slender = np.array([22.3733, 61.6728]) / length**2 * np.sqrt(rock.youngs_modulus / rock.density / 12)
    found = {p: frequencies(beam(length, depth), p, rock)[:2] for p in (2, 4, 6, 7, 8)}
    assert found[8] / slender == pytest.approx([0.991, 0.976], abs=1e-3)
    first = [found[p][0] / found[8][0] - 1 for p in (2, 4, 6)]
    assert 0.1 < first[0] < 0.25
    assert 0 < first[1] < 1e-2
    assert 0 < first[2] < 2e-5
    assert found[6][1] / found[7][1] - 1 == pytest.approx(0.03, abs=0.005)


def timoshenko_frequencies(length: float, depth: float, rock: Material) -> np.ndarray:
    """First three circular frequencies of Timoshenko's free beam (1921) of rectangular section, rad/s, with Cowper's (1966)
    shear factor, by Ritz's method with thirty polynomials for deflection and as many for rotation."""
    n, nu = 30, rock.poissons_ratio
    x, weights = np.polynomial.legendre.leggauss(80)
    each = np.eye(n)
    value = np.stack([np.polynomial.legendre.legval(x, one) for one in each])
    slope = (
        np.stack([np.polynomial.legendre.legval(x, np.polynomial.legendre.legder(one)) for one in each]) * 2 / length
    )
    weights = 0.5 * length * weights
    shear = 10 * (1 + nu) / (12 + 11 * nu) * rock.youngs_modulus / (2 * (1 + nu)) * depth
    inertia = depth**3 / 12
    mass, turned_mass = (
        rock.density * depth * (value * weights) @ value.T,
        rock.density * inertia * (value * weights) @ value.T,
    )
    coupled = -shear * (slope * weights) @ value.T
    bending = rock.youngs_modulus * inertia * (slope * weights) @ slope.T
    stiffness = np.block(
        [[shear * (slope * weights) @ slope.T, coupled], [coupled.T, shear * (value * weights) @ value.T + bending]]
    )
    nothing = np.zeros((n, n))
    found = eigh(stiffness, np.block([[mass, nothing], [nothing, turned_mass]]), eigvals_only=True)
    return np.sqrt(np.maximum(found, 0.0))[2:5]


@pytest.mark.parametrize("length", [20.0, 10.0])
def test_three_vibrations_of_a_beam(verified, length):
    """Free beam of slenderness 20 and 10, one block: each mode needs two orders more than the last."""
    rock = Material("rock", 1e10, 0.25, 2500.0, plane="stress")
    exact = timoshenko_frequencies(length, 1.0, rock)
    errors = {p: frequencies(beam(length, 1.0), p, rock)[:4][:, None] / exact - 1 for p in (4, 6, 8)}
    nearest = {p: np.abs(error).min(axis=0) for p, error in errors.items()}
    print(
        f"slenderness {length:g}: first three frequencies off by", {p: e.round(6).tolist() for p, e in nearest.items()}
    )
    for mode in range(3):
        verified(
            f"free beam of slenderness {length:g}, mode {mode + 1}, order 8", nearest[8][mode], "Timoshenko's beam"
        )
    assert nearest[4][0] < 1e-2 and nearest[6][0] < 3e-4 and nearest[6][1] < 0.032
    assert (nearest[8] < [3e-4, 1.2e-3, 4e-3]).all()


def test_vibrations_do_not_depend_on_how_the_block_lies():
    rock = Material("rock", 1e10, 0.25, 2500.0)
    drawn = frequencies(L_SHAPE, 5, rock)
    assert frequencies(turned(L_SHAPE, 1.1, (40.0, 7.0)), 5, rock)[:10] == pytest.approx(drawn[:10], rel=1e-9)
    assert frequencies(turned(L_SHAPE * [-1, 1], 0.2)[::-1], 5, rock)[:10] == pytest.approx(drawn[:10], rel=1e-9)


@pytest.mark.parametrize("angle", [0.0, 0.6])
def test_pressure_and_point_loads_work_on_deflection(angle):
    """A uniform pressure all around does no work on deflection, whose mean strain is zero; one that grows with depth, as
    that of water, works −∫ p div P dA (Gauss), and a force F at a point F · R P."""
    shape = turned(L_SHAPE, 0.3)
    blocks = Blocks.from_polygons([shape], order=[4])
    elastic = Material("rock", 2e10, 0.2, 2500.0).stiffness()[None]
    deflected = DeflectedBlocks(blocks, np.array([False]), elastic)
    moved = turned(shape, angle, (3.0, 5.0))
    following = blocks.next_vertex
    edges = np.zeros(len(shape), EDGE_FORCE)
    edges["edge"], edges["start"], edges["end"] = np.arange(len(shape)), moved, moved[following]
    along = moved[following] - moved
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.hypot(*along.T)[:, None]
    none, turn = np.empty(0, POINT_FORCE), np.array([angle])
    edges["traction"] = -1e6 * normal[:, None]
    assert np.abs(deflected.loads(none, edges, moved, turn)).max() < 1e-7 * 1e6
    pressure = 1e4 * (9.0 - np.stack([moved[:, 1], moved[following, 1]], axis=1))
    edges["traction"] = -pressure[..., None] * normal[:, None]
    points, weights = polygon_points(shape, shape[following], shape[0], 8)
    height = (points @ turned(np.eye(2), angle))[:, 1] + 5.0
    divergence = deflected.basis.strain(points, 0)[:, :2].sum(axis=1)
    expected = -np.einsum("k,k,kj->j", weights, 1e4 * (9.0 - height), divergence)
    assert deflected.loads(none, edges, moved, turn)[0] == pytest.approx(expected, abs=1e-8 * 1e5)
    force = np.zeros(1, POINT_FORCE)
    force["at"], force["force"] = shape[2], (3e3, -4e3)
    given = turned(np.array([[3e3, -4e3]]), -angle)[0] @ deflected.basis.displacement(shape[2], 0)[0]
    assert deflected.loads(force, edges[:0], moved, turn)[0] == pytest.approx(given, rel=1e-12)
