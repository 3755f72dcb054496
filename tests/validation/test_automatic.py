"""Meshes made for a target error: they reach it, and what solutions say of their own error is so.

A battery of problems with weak and strong singularities, near tips and surfaces. References: closed forms where there
are any, else a mesh of order 10 and elements graded for 1e-9 (1e-7 of K where no kink is sharp; checked below by the
closed forms and published values that some of the problems have).
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.adaptivity import for_target
from geomech.ddm.fracture.tip_factors import factors, largest
from geomech.ddm.iterative.gmres import NotSolved
from geomech.model import Cracks, DdmSettings, Material
from geomech.reference.cracks import fracture
from geomech.reference.specimens import two_cracks

ROCK = Material("rock", youngs_modulus=17e9, poissons_ratio=0.21)
MIXED = ddm.BodyLoad(remote_stress=[0.3, 1.0, 0.4])


def rectangle(w, h):
    return np.array([[-w, -h], [w, -h], [w, h], [-w, h]], dtype=float)


def pull(w, h):
    return ddm.BodyLoad(segments=[[[-w, -h], [w, -h]], [[w, h], [-w, h]]], tractions=[[[0, -1.0]] * 2, [[0, 1.0]] * 2])


def lines(*polylines, **kwargs):
    return Cracks.from_polylines([np.array(p, dtype=float) for p in polylines], aperture=math.inf, **kwargs)


def kinked(degrees, length):
    """The kink at the origin, where the shortest elements lose no digits."""
    t = math.radians(degrees)
    return lines([[-2, 0], [0, 0], [length * math.cos(t), length * math.sin(t)]])


def star(n, turn=0.3):
    arms = [[math.cos(a), math.sin(a)] for a in 2 * np.pi * np.arange(n) / n + turn]
    return joined(np.array([[0, 0], *arms]), np.array([[0, k + 1] for k in range(n)]), np.arange(n))


def joined(nodes, segments, crack):
    n = len(segments)
    return Cracks(
        nodes=np.asarray(nodes, dtype=float),
        segments=segments,
        crack=crack,
        block=np.zeros(n, int),
        birth_cycle=np.zeros(n, int),
        aperture=np.full(n, math.inf),
        surface=np.zeros(len(nodes), bool),
        names=tuple(f"crack {k}" for k in range(crack.max() + 1)),
    )


L_SHAPE = np.array([[-1, -1], [1, -1], [1, 0], [0, 0], [0, 1], [-1, 1]], dtype=float)
L_PULL = ddm.BodyLoad(segments=[[[-1, -1], [0, -1]], [[0, 1], [-1, 1]]], tractions=[[[0, -1]] * 2, [[0, 1]] * 2])
MOUTH = {"surface": [(True, False)]}

BATTERY = {
    "collinear": ([], lines([[-1, 0], [-0.02, 0]], [[0.02, 0], [1, 0]]), MIXED),
    "parallel": ([], lines([[-1, 0], [1, 0]], [[-0.7, 0.1], [1.3, 0.1]]), MIXED),
    "star of three": ([], star(3), MIXED),
    "T of 90": (
        [],
        joined([[-1, 0], [0, 0], [1, 0], [0, 1]], np.array([[0, 1], [1, 2], [1, 3]]), np.array([0, 0, 1])),
        MIXED,
    ),
    "kink of 30": ([], kinked(30, 0.3), MIXED),
    "short kink of 45": ([], kinked(45, 0.01), MIXED),
    "kink of 110": ([], kinked(110, 0.3), MIXED),
    "centre crack": ([rectangle(1, 3)], lines([[-0.5, 0], [0.5, 0]]), pull(1, 3)),
    "long centre crack": ([rectangle(1, 3)], lines([[-0.9, 0], [0.9, 0]]), pull(1, 3)),
    "edge crack": ([rectangle(0.5, 1.5)], lines([[-0.5, 0], [0, 0]], **MOUTH), pull(0.5, 1.5)),
    "slanted mouth": ([rectangle(0.5, 1)], lines([[-0.5, -0.2], [-0.1, 0.25]], **MOUTH), pull(0.5, 1)),
    "mouth on a corner": ([rectangle(0.5, 0.5)], lines([[-0.5, -0.5], [0, 0.1]], **MOUTH), pull(0.5, 0.5)),
    "re-entrant corner": ([L_SHAPE], lines([[-0.1, -0.1], [-0.5, -0.4]]), L_PULL),
    "near a surface": ([rectangle(1, 1)], lines([[-0.4, 0.95], [0.4, 0.95]]), pull(1, 1)),
    "two slots": ([rectangle(0.03, 0.06)], lines(*two_cracks.crack_ends(0)), pull(0.03, 0.06)),
}  # fmt: skip
#: Grading ends at 1e-7 of the extent for round-off's sake; at sharp corners and kinks that is what is left of the
#: error.
HARDEST = {"kink of 110": 2e-5, "short kink of 45": 1e-5, "re-entrant corner": 1e-4}


@pytest.fixture(scope="module")
def exact():
    found = {}
    for name, (loops, cracks, load) in BATTERY.items():
        best = replace(for_target(DdmSettings(target_error=1e-9)), order=10)
        found[name] = factors(ddm.Body(loops, cracks, ROCK, best).solve(load))
    return found


def off(solution, reference):
    return np.abs(factors(solution) - reference).max() / largest(reference)


def said(solution):
    return solution.tip_errors.max() / largest(factors(solution))


def test_references_agree_with_closed_forms_and_tables(exact):
    """To the digits that tables have, and 1e-8."""
    inner, outer = fracture.collinear_pair(1.0, 0.02, 1.0)
    np.testing.assert_allclose(exact["collinear"][:, 0], [outer, inner, inner, outer], rtol=1e-8)
    centre = exact["centre crack"][:, 0] / fracture.griffith(1, 0.5)
    np.testing.assert_allclose(centre, fracture.CENTRE_CRACK_HALF[3.0], rtol=5e-7)
    edge = exact["edge crack"][0, 0] / fracture.griffith(1, 0.5)
    assert edge == pytest.approx(fracture.EDGE_CRACK[0.5], rel=5e-5)
    np.testing.assert_allclose(-exact["two slots"][:, 0] * 1e6, np.array(two_cracks.OPEN_SLOT_K_I[0]) * 1e6, rtol=2e-5)


@pytest.mark.parametrize("target", [1e-3, 1e-5])
def test_target_is_reached(exact, target):
    """The error stays below the target and below what `tip_errors` says, but for the last digits of the references; or
    the target is refused, with a solution that says how good it is."""
    for name, (loops, cracks, load) in BATTERY.items():
        try:
            solution = ddm.solve_to(loops, cracks, ROCK, load, target)
        except ddm.TargetMissed as missed:
            assert name in HARDEST and missed.reached == said(missed.solution) > target
            solution = missed.solution
        error = off(solution, exact[name])
        assert error < max(target, HARDEST.get(name, 0)), name
        assert error < said(solution) + 1e-7, name


def test_estimates_of_any_solution(exact):
    """With default settings (order 4, two layers) the estimate is 0.6 to 3.5 times the error, which is 1e-7 to 5e-3. (3.3
    where the error of 6e-5 comes from a load that ends within an element: its sign differs on the finer mesh.)"""
    index = {}
    for name, (loops, cracks, load) in BATTERY.items():
        solution = ddm.Body(loops, cracks, ROCK).solve(load)
        index[name] = said(solution) / off(solution, exact[name])
    assert min(index.values()) > 0.6 and max(index.values()) < 3.5, index


def test_meshes_for_a_target_without_a_second_one(exact):
    """The first mesh of `DdmSettings(target_error=…)`: the median error is a tenth of the target, the worst ten times
    it."""
    for target in (1e-2, 1e-4, 1e-6):
        settings = DdmSettings(target_error=target)
        bodies = {n: ddm.Body(*BATTERY[n][:2], ROCK, settings) for n in BATTERY}
        errors = [off(bodies[n].solve(BATTERY[n][2], meet_target=False), exact[n]) for n in BATTERY]
        assert np.median(errors) < 0.5 * target and max(errors) < max(10 * target, 2e-5), errors


#: Eight cracks at random that cross and nearly meet (ends, in pairs): at 1e-2 the first mesh is 2 % off.
NETWORK = [
    ([0.2141, 0.2939], [0.8623, 0.3926]),
    ([0.1608, 0.2156], [0.5773, 0.5334]),
    ([1.1051, 0.5728], [0.8698, 0.6928]),
    ([0.5986, -0.0218], [0.7501, 0.6818]),
    ([0.7352, -0.0077], [0.6246, 0.2536]),
    ([-0.1633, 0.7633], [0.2667, 0.9371]),
    ([-0.2212, 0.8262], [0.2390, 1.1313]),
    ([0.8253, 0.5895], [0.8287, 0.9809]),
]


def network():
    return crossing(NETWORK)


def crossing(ends):
    """Cracks between pairs of ``ends``, with nodes where they cross."""
    cracks = []
    for a, d in ((np.array(p), np.array(q) - np.array(p)) for p, q in ends):
        at = {0.0, 1.0}
        for b, e in ((np.array(p), np.array(q) - np.array(p)) for p, q in ends):
            across = d[0] * e[1] - d[1] * e[0]
            if across:
                s, t = (((b - a)[0] * v[1] - (b - a)[1] * v[0]) / across for v in (e, d))
                at |= {s} if 0 < s < 1 and 0 < t < 1 else set()
        cracks.append([a + s * d for s in sorted(at)])
    return lines(*cracks, join=True)


def at_random(seed):
    """Ten cracks, 0.2 to 0.8 long, with their centres in a square of side 1."""
    rng, ends = np.random.default_rng(seed), []
    for _ in range(10):
        centre, angle, length = rng.uniform(0, 1, 2), rng.uniform(0, math.pi), rng.uniform(0.2, 0.8)
        half = 0.5 * length * np.array([math.cos(angle), math.sin(angle)])
        ends.append((centre - half, centre + half))
    return crossing(ends)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2, 5, 6, 7, 9, 11, 13, 16, 17, 36])
def test_random_networks_meet_a_target_and_tell_their_error(seed):
    """Of those that enclose nothing. (By default they are 2e-5 to 2e-3 off; ends come to 3e-4 of a crack that they cross.
    Where such an end leaves it at 3 or 14 degrees, seeds 3 and 12, 1e-6 is refused.)"""
    cracks = at_random(seed)
    best = ddm.solve_to([], cracks, ROCK, MIXED, 1e-6)
    plain = ddm.Body([], cracks, ROCK).solve(MIXED)
    assert off(plain, factors(best)) < said(plain) + 1e-6
    asked = ddm.Body([], cracks, ROCK, DdmSettings(target_error=1e-3)).solve(MIXED)
    assert off(asked, factors(best)) < said(asked) + 1e-6 <= 1e-3 + 1e-6


OPEN = [((0, 90), math.inf), ((0, 45), math.inf), ((0, 30), math.inf), ((0, 15, 30), math.inf), ((0, 45, 90), math.inf)]


@pytest.mark.parametrize(("angles", "aperture"), [*OPEN, ((0, 90), 0.0), ((0, 45), 0.0), ((0, 30), 0.0)])
def test_nodes_that_cracks_share(angles, aperture):
    """Arms from one point, cracks of their own, of which the last is short: at default settings right to 3e-4 (two
    layers whatever the angle: 8e-4 to 7e-3), and as one line would be."""
    arms = [np.array([[0, 0], [math.cos(math.radians(a)), math.sin(math.radians(a))]]) for a in angles]
    arms[-1] = 0.2 * arms[-1]
    cracks = Cracks.from_polylines(arms, aperture=aperture, join=True)
    load = ddm.BodyLoad(remote_stress=[0.6, 1.0, 0.3])
    fine = replace(for_target(DdmSettings(target_error=1e-6)), order=8)
    best = factors(ddm.Body([], cracks, ROCK, fine).solve(load, meet_target=False))
    tolerance = 3e-4 if aperture else 2e-3
    assert off(ddm.Body([], cracks, ROCK).solve(load), best) < tolerance
    if len(arms) == 2:
        line = Cracks.from_polylines([np.array([arms[0][1], arms[0][0], arms[1][1]])], aperture=aperture)
        assert off(ddm.Body([], line, ROCK).solve(load), best) < tolerance


def test_a_target_that_settings_ask_for_is_met():
    """By a finer mesh where the first one misses it."""
    best = ddm.solve_to([], network(), ROCK, MIXED, 1e-5)
    for target in (1e-2, 1e-4):
        body = ddm.Body([], network(), ROCK, DdmSettings(target_error=target))
        assert target < 1e-3 or off(body.solve(MIXED, meet_target=False), factors(best)) > target
        solution = body.solve(MIXED)
        assert off(solution, factors(best)) < said(solution) + 1e-5 and said(solution) <= target
        # The next body begins with the mesh that was needed.
        assert ddm.Body([], network(), ROCK, body.requested, solution.body).settings == solution.body.settings


def test_a_target_that_no_mesh_meets_is_refused():
    """Closed faces that part somewhere on an element: K gains a digit an order, not more."""
    cracks = Cracks.from_polylines([np.array([[-1, 0], [0, 0.1], [1, 0]])])
    bending = ddm.BodyLoad(remote_stress=[1.0, 0.1, -0.4])
    with pytest.raises(
        ddm.TargetMissed, match=r"not to the target_error of 1.0e-11; the largest error is at the tip at"
    ) as one:
        ddm.Body([], cracks, ROCK, DdmSettings(target_error=1e-11)).solve(bending)
    with pytest.raises(ddm.TargetMissed) as other:
        ddm.solve_to([], cracks, ROCK, bending, 1e-11)
    for missed in (one.value, other.value):
        assert 1e-11 < missed.reached == said(missed.solution)


def test_a_mesh_that_cannot_be_solved_misses_the_target(monkeypatch):
    """Too many unknowns to factor, and round-off beyond what the iteration needs: the coarser solution is reported with
    its difference to a coarser one, as where no finer mesh is left."""
    angle = np.linspace(0.25, 0.75, 8) * math.pi
    arc = Cracks.from_polylines([np.column_stack([np.cos(angle), np.sin(angle)])], aperture=math.inf)

    def stopped(*_, **__):
        raise NotSolved("round-off")

    monkeypatch.setattr("geomech.ddm.body.FACTORABLE", 100)
    body = ddm.Body([], arc, ROCK, DdmSettings(target_error=1e-6))
    monkeypatch.setattr("geomech.ddm.body.is_compressed", lambda _, n, *__: n > body.faces.n_unknowns)
    monkeypatch.setattr("geomech.ddm.iterative.crack_gmres.gmres", stopped)
    with pytest.raises(ddm.TargetMissed) as missed:
        body.solve(MIXED)
    assert missed.value.solution.body is body
    assert missed.value.reached == said(missed.value.solution) > 1e-6


@pytest.mark.parametrize("nodes", ["chebyshev", "gauss", "equal"])
@pytest.mark.parametrize("order", [0, 1, 2, 5, 10])
def test_a_crack_of_one_element_is_exact(order, nodes):
    """√(1−t²) times a constant is Griffith's crack: round-off at any order, and K_II of the slanted one."""
    settings = DdmSettings(order=order, nodes=nodes, elements_per_crack=1)
    crack = lines([[-0.8, -0.6], [0.8, 0.6]])
    body = ddm.Body([], crack, ROCK, settings)
    assert body.faces.n == 1
    stress = [0.3, 1.0, 0.4]
    expected = fracture.slanted(np.array(stress), math.atan2(0.6, 0.8), 1.0)
    np.testing.assert_allclose(factors(body.solve(ddm.BodyLoad(remote_stress=stress))), [expected] * 2, rtol=1e-9)


@pytest.mark.parametrize(("order", "tolerance"), [(0, 0.1), (1, 0.04), (2, 3e-3), (3, 2e-4)])
def test_low_orders_on_bodies(order, tolerance):
    """Centre and edge crack, six elements a side: the error of constant, linear, … elements (boundary linear at
    least)."""
    settings = DdmSettings(order=order)
    centre = ddm.Body([rectangle(1, 3)], lines([[-0.5, 0], [0.5, 0]]), ROCK, settings).solve(pull(1, 3))
    expected = fracture.CENTRE_CRACK_HALF[3.0] * fracture.griffith(1, 0.5)
    np.testing.assert_allclose(centre.tips["k_i"], expected, rtol=tolerance)
    edge = ddm.Body([rectangle(0.5, 1.5)], lines([[-0.5, 0], [0, 0]], **MOUTH), ROCK, settings).solve(pull(0.5, 1.5))
    assert edge.tips["k_i"][0] == pytest.approx(fracture.EDGE_CRACK[0.5] * fracture.griffith(1, 0.5), rel=tolerance)


def test_target_must_be_a_small_number():
    with pytest.raises(ValueError, match="target_error must lie between 0 and 1"):
        ddm.Body([], kinked(30, 1), ROCK, DdmSettings(target_error=0.0))
    with pytest.raises(ValueError, match="target_error"):
        ddm.solve_to([], kinked(30, 1), ROCK, MIXED, 2.0)


def test_a_body_without_cracks_has_no_errors():
    assert ddm.solve_to([rectangle(1, 1)], Cracks.from_polylines([]), ROCK, pull(1, 1)).tip_errors.shape == (0, 2)
