"""Stress, displacement and tractions of single elements against mpmath, and their independence of company.

The reference has the same moments as `test_kernels` checks by quadrature, but by the upward recurrence in 400 digits,
where it loses nothing that counts, and the fields of Crouch & Starfield (1983, §5.3 and ch. 4) as they are printed
there.
"""

import itertools

import mpmath as mp
import numpy as np
import pytest

from geomech.ddm.kernels import shape_functions
from geomech.ddm.kernels.full_plane import Elements, Kernel
from geomech.ddm.system import influence_matrix as matrices
from geomech.ddm.system.influence_matrix import ElementSet, add_fields, influence, line_influence

NU = 0.23
MIDDLE = (0.3125, 0.0)


def first(kind, z):
    if kind == shape_functions.ORDINARY:
        return mp.log((z + 1) / (z - 1))
    if kind == shape_functions.TIP_BOTH:
        return mp.pi * (z - mp.sqrt(z - 1) * mp.sqrt(z + 1))
    if kind == shape_functions.TIP_END:
        return -first(shape_functions.TIP_START, -z)
    v = mp.sqrt((1 + z) / 2)
    return v * mp.log((v + 1) / (v - 1)) - 2


def moment(kind, j):
    even = 1 if j % 2 == 0 else 0
    if kind == shape_functions.ORDINARY:
        return mp.mpf(2 * even) / (j + 1)
    if kind == shape_functions.TIP_BOTH:
        return even * mp.beta(mp.mpf(j + 1) / 2, mp.mpf(3) / 2)
    sign = (-1) ** j if kind == shape_functions.TIP_END else 1
    # ∫ (2s − 1)^j √s 2 ds
    return sign * sum(mp.binomial(j, i) * 2**i * (-1) ** (j - i) * 2 / (i + mp.mpf(3) / 2) for i in range(j + 1))


def cauchy(kind, order, z):
    """G', G'', G''' for t^0 … t^order of an element from −1 to 1, and G of an ordinary one."""
    h = mp.mpf(10) ** -130 * min(abs(z - 1), abs(z + 1))
    low, here, high = (first(kind, z + dz) for dz in (-h, 0, h))
    a, b, d = [here], [(high - low) / (2 * h)], [(high - 2 * here + low) / h**2]
    for k in range(order + 1):
        d.append(2 * b[k] + z * d[k])
        b.append(a[k] + z * b[k])
        a.append(z * a[k] - moment(kind, k))
    at_end, at_start = mp.log(z - 1), mp.log(z + 1)
    g = [(at_end - (-1) ** (k + 1) * at_start + a[k + 1]) / (k + 1) for k in range(order + 1)]
    return g, a, b, d


def printed(kind, order, x, y, force):
    """(order+1, 2, 5): σxx, σyy, σxy, 2μ u_x, 2μ u_y of unit jumps times 2μ, u⁺ − u⁻ (or of unit line forces) along and
    across an element from −1 to 1."""
    out = np.empty((order + 1, 2, 5))
    nu, q = mp.mpf(NU), -1 / (4 * mp.pi * (1 - mp.mpf(NU)))
    sums = cauchy(kind, order, mp.mpc(x, y))
    for k in range(order + 1):
        g, g1, g2, g3 = (s[k] for s in sums)
        f, fx, fy = q * g.real, q * g1.real, -q * g1.imag
        fxx, fxy, fyy, fxyy, fyyy = q * g2.real, -q * g2.imag, -q * g2.real, -q * g3.real, q * g3.imag
        if force:
            out[k, 0] = [
                (3 - 2 * nu) * fx + y * fxy, -(1 - 2 * nu) * fx - y * fxy, 2 * (1 - nu) * fy + y * fyy,
                (3 - 4 * nu) * f + y * fy, -y * fx,
            ]  # fmt: skip
            out[k, 1] = [
                2 * nu * fy + y * fyy, 2 * (1 - nu) * fy - y * fyy, (1 - 2 * nu) * fx - y * fxy,
                -y * fx, (3 - 4 * nu) * f - y * fy,
            ]  # fmt: skip
        else:
            # Crouch's D is u⁻ − u⁺.
            out[k, 0] = [
                -2 * fxy - y * fxyy, y * fxyy, -fyy - y * fyyy,
                -2 * (1 - nu) * fy + y * fxx, -(1 - 2 * nu) * fx + y * fxy,
            ]  # fmt: skip
            out[k, 1] = [
                -fyy - y * fyyy, -fyy + y * fyyy, y * fxyy,
                (1 - 2 * nu) * fx + y * fxy, -2 * (1 - nu) * fy + y * fyy,
            ]  # fmt: skip
    return out


def points():
    """(n, 2) from 1e-12 to 1e6 element lengths from the middle and from an end, all about; none on the element's line
    within it. (n,) the distance from the nearest end."""
    out, steps = (
        [],
        [1e-12, 1e-6, 1e-2, 0.3, 0.9, 1.4, 1.55, 2.1, 2.3, 3.0, 5.0, 8.0, 14.0, 25.0, 80.0, 500.0, 1e4, 2e6],
    )
    for i, r in enumerate(steps):
        for start in ((0.0, 0.0), MIDDLE):
            # Directions that repeat nowhere.
            angle = 0.7 + 2.4 * i + 1.1 * (start == MIDDLE)
            x, y = start[0] + 1.0 + r * np.cos(angle), r * np.sin(angle)
            out.append((x, y) if start == MIDDLE else (r * np.cos(angle), y))
    return np.array(out)


@pytest.mark.parametrize(("kind", "force"), [*((kind, False) for kind in range(4)), (shape_functions.ORDINARY, True)])
@pytest.mark.parametrize("order", [0, 4, 5, 10])
def test_fields_of_one_element(kind, order, force):
    """1e-10 of stress and displacement, each as a whole, from every monomial, from 1e-12 to 1e6 lengths away (worst
    seen: 2e-11). The element lies from 0 to 2 so that points at its start keep
    their digits."""
    where = points()
    got = np.empty((len(where), order + 1, 2, 5))
    for k, component in itertools.product(range(order + 1), range(2)):
        density = np.zeros((1, 2, order + 1))
        density[0, component, k] = 1.0
        stress, shift = np.zeros((len(where), 3)), np.zeros((len(where), 2))
        ends = np.array([[0.0, 0.0]]), np.array([[2.0, 0.0]])
        elements = Elements(*ends, np.array([kind]))
        add_fields(where, elements, density, Kernel(NU, 0.0, 1.0, force), stress, shift)
        got[:, k, component] = np.hstack([stress, shift])
    with mp.workdps(400):
        ref = np.array([printed(kind, order, mp.mpf(x) - 1, mp.mpf(y), force) for x, y in where])
    for part in (slice(0, 3), slice(3, 5)):
        error = np.abs(got - ref)[..., part].max(axis=-1) / np.abs(ref)[..., part].max(axis=-1)
        worst = np.unravel_index(error.argmax(), error.shape)
        assert error.max() < 1e-10, (where[worst[0]], worst[1:], error.max())


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("kind", range(4))
def test_fields_on_either_face(kind, side):
    """On the element itself, between its ends and close to them, the limit from the side that is stated: the reference
    stands 1e-60 off. 1e-12: nothing is lost on the element."""
    t = np.array([-1 + 1e-9, -0.9, -0.2, 0.4, 1 - 2e-9])
    where = np.column_stack([t, np.zeros(5)])
    ends = np.array([[-1.0, 0.0]]), np.array([[1.0, 0.0]])
    with mp.workdps(400):
        ref = np.array([printed(kind, 4, mp.mpf(x), side * mp.mpf(10) ** -60, False) for x in t])
    for k, component in itertools.product(range(5), range(2)):
        density = np.zeros((1, 2, 5))
        density[0, component, k] = 1.0
        stress, shift = np.zeros((5, 3)), np.zeros((5, 2))
        elements = Elements(*ends, np.array([kind]))
        add_fields(where, elements, density, Kernel(NU, 1e-12, side, False), stress, shift)
        for got, part in ((stress, slice(0, 3)), (shift, slice(3, 5))):
            expected = ref[:, k, component, part]
            scale = np.abs(expected).max(axis=1, keepdims=True)
            assert (np.abs(got - expected) <= 1e-12 * scale + 1e-15).all(), (k, component, got, expected)


def scattered(n, order, seed, spread):
    """Elements of all kinds near and far from each other."""
    rng = np.random.default_rng(seed)
    middle, angle = spread * rng.random((n, 2)), 2 * np.pi * rng.random(n)
    half = 0.5 * rng.uniform(0.1, 1.0, n)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return ElementSet(middle - half, middle + half, rng.integers(0, 4, n), np.arange(n), order, "chebyshev")


@pytest.mark.parametrize("order", [0, 2, 4, 7])
@pytest.mark.parametrize("force", [False, True])
def test_matrices_are_the_stress_of_the_fields(order, force):
    """Tractions on nodes from unit nodal values equal σ·n of the field with those values: two codes of the same."""
    targets, sources = scattered(9, order, 1, 6.0), scattered(13, order, 2, 6.0)
    if force:
        sources = ElementSet(
            sources.start, sources.end, np.zeros(13, int), sources.source, sources.order, sources.family
        )
    values = np.random.default_rng(3).standard_normal(sources.n_unknowns)
    nodes = targets.nodes.reshape(-1, 2)
    stress, shift = np.zeros((len(nodes), 3)), np.zeros((len(nodes), 2))
    density = sources.densities(values)
    elements = Elements(sources.start, sources.end, sources.kind)
    add_fields(nodes, elements, density, Kernel(NU, 1e-9, 1.0, force), stress, shift)
    xx, yy, xy = stress.reshape(targets.n, targets.per, 3).transpose(2, 0, 1)
    t, n = targets.tangent[:, None], targets.normal[:, None]
    pull = np.stack([xx * n[..., 0] + xy * n[..., 1], xy * n[..., 0] + yy * n[..., 1]], axis=-1)
    expected = np.stack([(pull * t).sum(axis=-1), (pull * n).sum(axis=-1)], axis=1).ravel()
    matrix = line_influence(targets, sources, NU, 1e-9, 1.0) if force else influence(targets, sources, NU, 1e-9)
    scale = np.abs(matrix) @ np.abs(values)
    # Monomials of order 7 lose two digits on the way from nodal values.
    assert (np.abs(matrix @ values - expected) <= 1e-12 * scale).all()


def test_an_entry_depends_on_its_two_elements_alone(monkeypatch):
    """To the bit, whatever else is asked for in the same call, in which order and on how many threads: growth keeps
    entries and adds others to them."""
    targets, sources = scattered(71, 4, 4, 8.0), scattered(43, 4, 5, 8.0)
    whole = influence(targets, sources, NU, 1e-9)
    rng = np.random.default_rng(6)
    for _ in range(5):
        r, k = rng.permutation(71)[: rng.integers(1, 71)], rng.permutation(43)[: rng.integers(1, 43)]
        part = influence(targets.take(r), sources.take(k), NU, 1e-9)
        assert np.array_equal(part, whole[np.ix_(targets.unknowns(r), sources.unknowns(k))])
    monkeypatch.setattr(matrices, "PAIRS_PER_THREAD", 100)
    for threads in (1, 2, 3, 7):
        monkeypatch.setattr(matrices, "THREADS", threads)
        assert np.array_equal(influence(targets, sources, NU, 1e-9), whole)


def test_a_field_at_a_point_does_not_depend_on_other_points(monkeypatch):
    sources = scattered(40, 4, 7, 8.0)
    where = 10 * np.random.default_rng(8).random((700, 2))
    density = sources.densities(np.random.default_rng(9).standard_normal(sources.n_unknowns))

    def at(chosen):
        stress, shift = np.zeros((len(chosen), 3)), np.zeros((len(chosen), 2))
        elements = Elements(sources.start, sources.end, sources.kind)
        add_fields(where[chosen], elements, density, Kernel(NU, 1e-9, 1.0, False), stress, shift)
        return np.hstack([stress, shift])

    whole = at(np.arange(700))
    rng = np.random.default_rng(10)
    for n in (1, 5, 8, 300):
        chosen = rng.permutation(700)[:n]
        assert np.array_equal(at(chosen), whole[chosen])
    monkeypatch.setattr(matrices, "PAIRS_PER_THREAD", 100)
    monkeypatch.setattr(matrices, "THREADS", 3)
    assert np.array_equal(at(np.arange(700)), whole)
