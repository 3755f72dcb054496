"""Kernels of the half-plane against Muskhelishvili's continuation of point sources, summed up in 40 digits."""

import mpmath as mp
import numpy as np
import pytest

from geomech.ddm.kernels import shape_functions
from geomech.ddm.kernels.full_plane import Elements, Kernel
from geomech.ddm.loads.unit_load_cache import on_elements
from geomech.ddm.mesh.half_plane import HalfPlane
from geomech.ddm.system.influence_matrix import ElementSet, add_fields, influence, line_influence

NU = 0.3
WEIGHTS = {
    shape_functions.ORDINARY: lambda t: mp.mpf(1),
    shape_functions.TIP_START: lambda t: mp.sqrt((1 + t) / 2),
    shape_functions.TIP_END: lambda t: mp.sqrt((1 - t) / 2),
    shape_functions.TIP_BOTH: lambda t: mp.sqrt((1 - t) * (1 + t)),
}


def point_source(z, t, e, b, force):
    """Stress and 2μ times displacement at z that the surface adds to a jump b across the direction e (times a length),
    or to a force b, at t: the potentials of the module, with nothing simplified."""
    f, kappa, cj = 1 / (4 * mp.pi * (1 - mp.mpf(NU))), 3 - 4 * mp.mpf(NU), mp.conj
    w, s = cj(z) - t, cj(t)
    if force:
        q = f / 2 * b
        # Arguments of the logarithm from 0 to π: images are above the rock.
        log = mp.log(w / 1j) + 0.5j * mp.pi
        phi, d_phi, dd_phi, ddd_phi = -q * log, -q / w, q / w**2, -2 * q / w**3
        psi, d_psi = kappa * cj(q) * log + q * s / w, kappa * cj(q) / w - q * s / w**2
        dd_psi = -kappa * cj(q) / w**2 + 2 * q * s / w**3
    else:
        g = mp.mpc(0, 0.5) * b * f
        k, m = cj(g) * e + g * cj(e), g * e
        phi, d_phi, dd_phi, ddd_phi = m / w, -m / w**2, 2 * m / w**3, -6 * m / w**4
        psi, d_psi = k / w + m * s / w**2, -k / w**2 - 2 * m * s / w**3
        dd_psi = 2 * k / w**3 + 6 * m * s / w**4
    one = -z * cj(d_phi) - cj(psi)
    d_one = -cj(d_phi) - z * cj(dd_phi) - cj(d_psi)
    dd_one = -2 * cj(dd_phi) - z * cj(ddd_phi) - cj(dd_psi)
    two, d_two = -cj(phi) - z * d_one, -cj(d_phi) - d_one - z * dd_one
    deviator, half = cj(z) * dd_one + d_two, 2 * mp.re(d_one)
    moved = kappa * one - z * cj(d_one) - cj(two)
    return [half - mp.re(deviator), half + mp.re(deviator), mp.im(deviator), mp.re(moved), mp.im(moved)]


def exact(kind, start, end, density, point, force):
    with mp.workdps(40):
        a, b, z = (mp.mpc(*map(float, x)) for x in (start, end, point))
        c, e, middle = abs(b - a) / 2, (b - a) / abs(b - a), (a + b) / 2
        total = mp.matrix(5, 1)
        # t = sin³ crowds into the ends and takes square roots off them; Gauss's 24 points on four pieces.
        x, q = np.polynomial.legendre.leggauss(24)
        for lo in np.linspace(-1, 1, 5)[:-1]:
            for u, weight in zip(lo + (x + 1) / 4, q / 4):
                angle = mp.pi / 2 * mp.mpf(u)
                t = mp.sin(angle)
                ds = mp.pi / 2 * mp.cos(angle) * mp.mpf(weight) * c
                value = sum(mp.mpc(*density[:, k]) * t**k for k in range(density.shape[1])) * WEIGHTS[kind](t) * e
                total += ds * mp.matrix(point_source(z, middle + c * t * e, e, value, force))
        return np.array([float(v) for v in total])


def fields(kind, start, end, density, point, force, rock):
    stress, shift = np.zeros((1, 3)), np.zeros((1, 2))
    ends = np.array([start]), np.array([end]), np.array([kind])
    kernel = Kernel(NU, 1e-15, 1.0, force)
    add_fields(np.array([point]), Elements(*ends), density[None], kernel, stress, shift, rock)
    return np.concatenate([stress[0], shift[0]])


CASES = [
    # A slanted element at a depth of its length, one that lies deep, one that stands at the surface.
    ((0.2, -1.0), (1.1, -0.6)),
    ((0.0, -9.0), (-0.3, -8.4)),
    ((0.3, 0.0), (0.1, -0.7)),
]
POINTS = [(0.5, -0.45), (0.9, 0.0), (-2.0, -3.0), (40.0, -9.0), (2e3, -1e3), (-3e6, -1e6)]


@pytest.mark.first_by_default(2)
@pytest.mark.parametrize(("kind", "force"), [*[(kind, False) for kind in WEIGHTS], (shape_functions.ORDINARY, True)])
def test_image_holds_ten_digits(kind, force):
    """1e-10 of what the element alone does at the point, the accuracy of the kernels of the plane."""
    random = np.random.default_rng(kind)
    rock = HalfPlane()
    for start, end in CASES:
        density = random.normal(size=(2, 4))
        for point in POINTS[kind % 2 :: 2]:
            alone = fields(kind, start, end, density, point, force, None)
            added = fields(kind, start, end, density, point, force, rock) - alone
            ref = exact(kind, start, end, density, point, force)
            for part in (slice(3), slice(3, 5)):
                size = max(np.abs(alone[part]).max(), np.abs(ref[part]).max())
                assert np.abs(added[part] - ref[part]).max() <= 1e-10 * size, (start, point)


@pytest.mark.parametrize("force", [False, True])
def test_surface_bears_nothing(force):
    """At the surface, from touching an element's end to a million lengths away, to round-off of the element's own
    stress."""
    random = np.random.default_rng(3)
    rock = HalfPlane((3.0, -2.0), (-0.6, 0.8))
    along, out = rock.turn
    for x in (1e-9, 1e-3, 0.3, 2.0, 80.0, 1e6):
        start, end = np.array([(0.0, 0.0), (0.4, -1.0)]) @ rock.turn + np.asarray(rock.point)
        point = np.asarray(rock.point) + x * along
        density = random.normal(size=(2, 5))
        alone = fields(shape_functions.ORDINARY, start, end, density, point, force, None)
        whole = fields(shape_functions.ORDINARY, start, end, density, point, force, rock)
        pulled = [whole[0] * out[0] + whole[2] * out[1], whole[2] * out[0] + whole[1] * out[1]]
        # Coordinates of a slanted surface are round-off of those given.
        assert np.abs(pulled).max() <= 1e-10 * np.abs(alone[:3]).max() + 1e-14 * np.abs(alone[:3]).max() / min(x, 1.0)


@pytest.mark.parametrize("order", [0, 4, 12])
def test_matrices_are_the_fields(order):
    """Tractions of matrices and of fields: two kernels, to round-off."""
    random = np.random.default_rng(order)
    rock = HalfPlane((1.0, 2.0), (0.28, 0.96))
    depth = -0.1 - random.random((7, 1))
    start = np.hstack([random.normal(size=(7, 1)), depth])
    end = np.hstack([start[:, :1] + 0.3 * random.normal(size=(7, 1)), depth * random.uniform(0.2, 2.0, (7, 1))])
    start, end = (x @ rock.turn + np.asarray(rock.point) for x in (start, end))
    for force in (False, True):
        kind = np.zeros(7, int) if force else np.arange(7) % 4
        elements = ElementSet(start, end, kind, np.arange(7), order, "chebyshev", rock)
        matrix = (
            line_influence(elements, elements, NU, 1e-15, 1.0) if force else influence(elements, elements, NU, 1e-15)
        )
        values = random.normal(size=elements.n_unknowns)
        stress, shift = np.zeros((7 * (order + 1), 3)), np.zeros((7 * (order + 1), 2))
        points = elements.nodes.reshape(-1, 2)
        density = elements.densities(values)
        kernel = Kernel(NU, 1e-15, 1.0, force)
        add_fields(points, Elements(start, end, kind), density, kernel, stress, shift, rock)
        assert np.allclose(matrix @ values, on_elements(elements, stress), rtol=0, atol=3e-11 * np.abs(stress).max())
