"""The half-plane: cracks at, near and up to a free surface that has no elements, holes, weight and point loads below
it."""

import math
from itertools import pairwise

import numpy as np
import pytest

from geomech import ddm
from geomech.model import Cracks, DdmSettings, GrowthSettings, JointLaw, Material
from geomech.reference.cracks import crack_arrays, dislocations, fracture
from geomech.reference.cracks.dislocations import Arm
from geomech.reference.openings import holes, shallow_tunnel

ROCK = Material("rock", youngs_modulus=40e9, poissons_ratio=0.25, k_ic=1e6)
SURFACE = ddm.HalfPlane()
#: A surface that dips by 36.9° somewhere else.
SLOPE = ddm.HalfPlane((30.0, -7.0), (0.6, 0.8))


def slot(start, end, mouth=False):
    return Cracks.from_polylines([np.array([start, end], dtype=float)], aperture=math.inf, surface=[(mouth, False)])


def body(cracks, order=8, half_plane=SURFACE, **options):
    settings = {name: options.pop(name) for name in ("elements_per_crack", "grading_layers") if name in options}
    return ddm.Body(half_plane, cracks, ROCK, DdmSettings(order=order, **settings), **options)


def factors(sol):
    return np.column_stack([sol.tips["k_i"], sol.tips["k_ii"]])


def along(half_plane, stress=1.0):
    """A uniform stress parallel to the surface, as `BodyLoad` has it."""
    t = half_plane.turn[0]
    return stress * np.array([t[0] ** 2, t[1] ** 2, t[0] * t[1]])


def test_edge_crack(verified):
    """Koiter's edge crack: every two orders, with a layer more at the mouth, are a factor of ten or more."""
    exact = crack_arrays.EDGE_CRACK_HALF_PLANE
    errors = {}
    for order, layers in ((2, 2), (4, 2), (6, 2), (8, 3), (10, 4)):
        crack = slot((0, 0), (0, -1), mouth=True)
        sol = body(crack, order, elements_per_crack=1, grading_layers=layers).solve(
            ddm.BodyLoad(remote_stress=[1, 0, 0])
        )
        errors[order] = abs(sol.tips["k_i"][0] / math.sqrt(math.pi) / exact - 1)
    print("edge crack in a half-plane:", {p: f"{e:.1e}" for p, e in errors.items()})
    verified("edge crack in a half-plane: K_I", list(errors.values()), "Koiter 1965", over=("order p", list(errors)))
    assert errors[4] < 1e-6 and errors[6] < 5e-8
    assert errors[8] < 3e-9 and errors[10] < 3e-10


@pytest.mark.parametrize("target", [1e-4, 1e-6])
def test_target_error(target):
    """What is asked for is reached, and the estimate bounds the error."""
    crack, load = slot((0, 0), (0, -2), mouth=True), ddm.BodyLoad(remote_stress=[3, 0, 0])
    sol = ddm.solve_to(SURFACE, crack, ROCK, load, target)
    exact = crack_arrays.EDGE_CRACK_HALF_PLANE * 3 * math.sqrt(2 * math.pi)
    error = abs(sol.tips["k_i"][0] - exact)
    assert error <= sol.tip_errors[0, 0] <= target * exact


@pytest.mark.parametrize("angle_deg", [30.0, 60.0, 120.0])
def test_slanted_edge_crack(verified, angle_deg):
    """Against distributed dislocations, which share nothing with displacement discontinuities. Mouths that are not
    upright are singular; 1e-6 is asked for."""
    a = math.radians(-angle_deg)
    tip = np.array([math.cos(a), math.sin(a)])
    arms = [Arm(0j, complex(*tip), start_is_tip=False, open=True)]
    exact = dislocations.stress_intensity(arms, lambda p: np.tile([1.0, 0, 0], (len(p), 1)), "half-plane", 257)
    sol = ddm.solve_to(SURFACE, slot((0, 0), tip, True), ROCK, ddm.BodyLoad(remote_stress=[1, 0, 0]), 1e-6)
    off = np.abs(factors(sol) - exact).max() / np.abs(exact).max()
    verified(f"edge crack at {angle_deg:g}° to a half-plane: K", off, "distributed dislocations")
    print(f"edge crack at {angle_deg:g}°: {off:.1e}")
    assert off < 3e-6


@pytest.mark.parametrize("depth", [0.02, 0.2, 0.5, 2.0, 100.0])
def test_pressurised_crack_parallel_to_the_surface(depth):
    """Against distributed dislocations, which converge to ten digits (the least depth takes them more points)."""
    ends = np.array([[-1.0, -depth], [1.0, -depth]])
    exact = crack_arrays.near_surface(ends, 1.0, 513 if depth < 0.1 else 129)
    off = []
    for order in (4, 6, 8, 10):
        sol = body(slot(*ends), order).solve(ddm.BodyLoad(crack_pressure=1.0))
        off.append(np.abs(factors(sol) - exact).max() / np.abs(exact).max())
    print(f"pressurised crack at depth {depth}: {[f'{e:.1e}' for e in off]} with {sol.body.faces.n} elements")
    # Four elements 2.5 times as long as the cover is thick (0.2) converge more slowly than others.
    assert off[0] < 1e-3 and off[2] < 2e-6 and off[3] < 1e-6
    assert off[3] < 0.01 * off[0]


def test_thin_cover_is_a_beam():
    """The cover of a pressurised crack is a clamped beam with the edge moment M = p L²/12, which gives K = √6 M
    d^(−3/2) and K_I/K_II = tan 52.07° (Hutchinson & Suo 1992, § IV), up to terms of d/L (2.5 % at 0.01), which are
    extrapolated away."""
    ratio, size = [], []
    for depth in (0.02, 0.01):
        k_i, k_ii = np.abs(
            factors(body(slot((-0.5, -depth), (0.5, -depth)), 4).solve(ddm.BodyLoad(crack_pressure=1.0)))[0]
        )
        ratio.append(k_i / k_ii)
        size.append(math.hypot(k_i, k_ii) / (math.sqrt(6) / 12 * depth**-1.5))
    assert 2 * ratio[1] - ratio[0] == pytest.approx(math.tan(math.radians(52.07)), rel=5e-3)
    assert 2 * size[1] - size[0] == pytest.approx(1, rel=5e-3)


def test_any_surface_is_as_good():
    """A slope, far from the origin: the same to the round-off of coordinates."""
    load = ddm.BodyLoad(crack_pressure=1.0, remote_stress=along(SURFACE))
    flat = body(slot((0, -0.3), (0.8, -1.1))).solve(load)
    a, b = (np.array(p) @ SLOPE.turn + np.asarray(SLOPE.point) for p in ((0, -0.3), (0.8, -1.1)))
    load = ddm.BodyLoad(crack_pressure=1.0, remote_stress=along(SLOPE))
    slanted = body(slot(a, b), half_plane=SLOPE).solve(load)
    assert np.allclose(factors(slanted), factors(flat), rtol=1e-11)
    points = np.array([[0.2, -0.1], [0.5, 0.0], [-3.0, -2.0]])
    stress = flat.stress(points)
    moved = points @ SLOPE.turn + np.asarray(SLOPE.point)
    assert np.allclose(slanted.stress(moved), SLOPE.stress_of(stress), atol=1e-11)
    shift = flat.displacement(points) - flat.displacement(points[:1])
    turned = slanted.displacement(moved) - slanted.displacement(moved[:1])
    assert np.allclose(turned, shift @ SLOPE.turn, atol=1e-11 * np.abs(shift).max())


def test_surface_of_a_cracked_half_plane_is_free():
    """Fields at the surface and far below: no traction to 1e-12, and the remote stress."""
    sol = body(slot((0, 0), (0.3, -1.0), True)).solve(ddm.BodyLoad(remote_stress=[1, 0, 0]))
    x = np.array([-7.0, -0.4, -1e-3, 1e-3, 0.9, 50.0])
    stress = sol.stress(np.column_stack([x, np.zeros(6)]))
    assert np.abs(stress[:, 1:]).max() < 1e-11
    assert np.allclose(sol.stress([[1e5, -1e5]]), [[1, 0, 0]], atol=1e-9)
    # Nothing is told of what is not there.
    assert np.isnan(sol.stress([[0.0, 1.0]])).all() and np.isnan(sol.displacement([[0.0, 1.0]])).all()


def circle(n, centre, radius=1.0):
    """A polygon of the circle's area."""
    q = 2 * math.pi * (np.arange(n) + 0.5) / n
    size = radius * math.sqrt(math.pi / (n / 2 * math.sin(2 * math.pi / n)))
    return np.asarray(centre) + size * np.column_stack([np.cos(q), np.sin(q)])


def test_shallow_tunnel_by_series():
    """The reference itself: Jeffery's (1920) closed forms of a pressurised hole, on the surface and on the wall, to
    round-off; under weight a wall without traction and terms enough; Kirsch's hole in the deep."""
    x, angle = np.linspace(-3, 3, 7), np.linspace(0.1, 3.0, 6)
    for depth in (1.25, 2.0, 5.0):
        found = shallow_tunnel.stress(np.column_stack([x, 0 * x]), depth, pressure=1.0)
        assert np.allclose(found[:, 0], shallow_tunnel.surface_stress(x, depth), atol=1e-13)
        out = np.column_stack([np.sin(angle), np.cos(angle)])
        found = shallow_tunnel.stress(out - [0, depth], depth, pressure=1.0)
        assert np.allclose(found[:, 0] + found[:, 1] + 1, shallow_tunnel.wall_stress(angle, depth), atol=1e-13)
        s = shallow_tunnel.stress(out - [0, depth], depth, weight=1.0, k0=0.5)
        pull = np.column_stack([s[:, 0] * out[:, 0] + s[:, 2] * out[:, 1], s[:, 2] * out[:, 0] + s[:, 1] * out[:, 1]])
        assert np.abs(pull).max() < 1e-12
        fewer = shallow_tunnel.stress(out - [0, depth], depth, weight=1.0, k0=0.5, terms=40)
        assert np.allclose(s, fewer, atol=1e-9)
    deep = shallow_tunnel.stress(np.array([[1.6, -1000.0], [0.4, -998.5]]), 1000.0, along=1.0)
    exact = holes.kirsch_stress(np.array([[1.6, 0.0], [0.4, 1.5]]), np.array([1.0, 0, 0]))
    assert np.allclose(deep, exact, atol=1e-5)


@pytest.mark.parametrize("loads", ["pressure", "tension", "weight"])
def test_tunnel_near_the_surface(loads):
    """A hole a quarter of its radius, and one radius, below the surface: the stress on the surface and about it against
    the series (Mindlin 1940; Jeffery 1920). Excavating takes the weight of what was in it, so that Poisson's ratio
    counts. The polygon's error is second order or better."""
    rock = Material("rock", youngs_modulus=40e9, poissons_ratio=0.4)
    load, known = {
        "pressure": (ddm.BodyLoad(hole_pressure=1.0), {"pressure": 1.0}),
        "tension": (ddm.BodyLoad(remote_stress=[1.0, 0, 0]), {"along": 1.0}),
        "weight": (ddm.BodyLoad(body_force=[0, -1.0], k0=0.5), {"weight": 1.0, "k0": 0.5}),
    }[loads]
    none = Cracks.from_polylines([])
    for depth in (1.25, 2.0):
        points = np.array([[0.0, 0.0], [0.5, 0.0], [-2.0, 0.0], [1.8, -depth], [-1.2, -0.3], [0.3, -depth - 1.6]])
        exact = shallow_tunnel.stress(points, depth, poissons_ratio=0.4, **known)
        off = []
        for n in (32, 64):
            tunnel = ddm.Body(SURFACE, none, rock, DdmSettings(order=4), holes=[circle(n, (0, -depth))])
            off.append(np.abs(tunnel.solve(load).stress(points) - exact).max() / np.abs(exact).max())
        print(f"hole at depth {depth}, {loads}: {[f'{e:.1e}' for e in off]}")
        assert off[1] < 4e-4 and off[1] < 0.3 * off[0]


def test_deep_hole_is_that_of_the_plane():
    """At a depth of two hundred radii the surface adds (r/d)² of the stress."""
    points = np.array([[1.6, -200.0], [0.4, -198.5]])
    hole = circle(48, (0, -200.0))
    load = ddm.BodyLoad(remote_stress=[1.0, 0, 0])
    sol = body(slot((40, -240), (41, -241)), 4, holes=[hole]).solve(load)
    exact = holes.kirsch_stress(points + [0, 200.0], np.array([1.0, 0, 0]))
    alone = ddm.Body([], slot((40, -240), (41, -241)), ROCK, DdmSettings(order=4), holes=[hole]).solve(load)
    assert np.allclose(sol.stress(points), alone.stress(points), atol=1e-4)
    assert np.allclose(sol.stress(points), exact, atol=5e-3)


@pytest.mark.parametrize("half_plane", [SURFACE, SLOPE])
def test_slot_with_water_in_heavy_ground(half_plane):
    """A vertical slot from the surface with water in it, in ground with K0: the load is linear in depth, K_I that of
    distributed dislocations. On the slope the same, turned."""
    weight, water, k0 = 2.2e4, 1e4, 0.3
    arms = [Arm(0j, -3j, start_is_tip=False, open=True)]

    def field(points):
        y = points[:, 1]
        return np.column_stack([(k0 * weight - water) * y, 0 * y, 0 * y])

    exact = dislocations.stress_intensity(arms, field, "half-plane", 257)
    mouth = np.asarray(half_plane.point) + 4 * half_plane.turn[0]
    down = -np.asarray(half_plane.outward)
    pressure = ddm.Pressure(0.0, tuple(water * down), half_plane.point)
    load = ddm.BodyLoad(body_force=weight * down, k0=k0, crack_pressure=pressure)
    sol = body(slot(mouth, mouth + 3 * down, True), half_plane=half_plane).solve(load)
    assert factors(sol)[0, 0] == pytest.approx(exact[0, 0], rel=1e-6)
    # Balance: the field's divergence is minus the weight, by central differences.
    at, h = mouth + 2.0 * down + 3.0 * half_plane.turn[0], 1e-3
    s = sol.stress(np.array([at + [h, 0], at - [h, 0], at + [0, h], at - [0, h]]))
    div = (s[0, [0, 2]] - s[1, [0, 2]] + s[2, [2, 1]] - s[3, [2, 1]]) / (2 * h)
    assert np.allclose(div, -weight * down, rtol=1e-5, atol=1e-5 * weight)


def test_point_loads():
    """Flamant's load on the surface and Melan's in the rock open an edge crack as dislocations in their fields do; the
    field of the one is linear elasticity's limit of the other."""
    arms = [Arm(0j, -1j, start_is_tip=False, open=True)]
    crack = slot((0, 0), (0, -1), True)
    on, inside = np.array([0.7, 0.0]), np.array([0.8, -0.6])
    force = np.array([3.0, 2.0])

    def flamant(points):
        rel = points - on
        r2 = np.sum(rel**2, axis=1)
        return (-2 / math.pi * (rel @ force) / r2**2)[:, None] * np.stack(
            [rel[:, 0] ** 2, rel[:, 1] ** 2, rel[:, 0] * rel[:, 1]], 1
        )

    sol = body(crack).solve(ddm.BodyLoad(points=[on], forces=[force]))
    exact = dislocations.stress_intensity(arms, flamant, "half-plane", 257)
    assert np.allclose(factors(sol), exact, rtol=1e-6)
    deep = body(crack).solve(ddm.BodyLoad(points=[inside], forces=[force]))
    x = np.column_stack([np.array([-2.0, 0.3, 5.0]), np.zeros(3)])
    assert np.abs(deep.stress(x)[:, 1:]).max() < 1e-10
    # A load that comes up to the surface is Flamant's.
    near = body(crack).solve(ddm.BodyLoad(points=[on - [0, 1e-4]], forces=[force]))
    assert np.allclose(factors(near), exact, rtol=1e-3)
    # The resultant through a circle about the force, and its displacement's strain.
    q = 2 * math.pi * np.arange(64) / 64
    n = np.column_stack([np.cos(q), np.sin(q)])
    s = deep.stress(inside + 0.3 * n)
    pull = np.column_stack([s[:, 0] * n[:, 0] + s[:, 2] * n[:, 1], s[:, 2] * n[:, 0] + s[:, 1] * n[:, 1]])
    assert np.allclose(pull.mean(axis=0) * 2 * math.pi * 0.3, -force, rtol=1e-9)
    at, h = np.array([2.0, -1.5]), 1e-5
    u = deep.displacement(np.array([at + [h, 0], at - [h, 0], at + [0, h], at - [0, h]]))
    slope = np.array([(u[0] - u[1]) / (2 * h), (u[2] - u[3]) / (2 * h)])
    strain = [slope[0, 0], slope[1, 1], slope[0, 1] + slope[1, 0]]
    assert np.allclose(strain, ROCK.compliance() @ deep.stress([at])[0], rtol=1e-6)


def strip(points, half=1.0):
    """Stress below a unit pressure on |x| < ``half`` of the surface (Michell 1902; Timoshenko & Goodier 1951, §37)."""
    x, y = points.T
    one, two = np.arctan2(x + half, -y), np.arctan2(x - half, -y)
    angle, sine, turn = one - two, np.sin(one - two), one + two
    return np.column_stack([angle - sine * np.cos(turn), angle + sine * np.cos(turn), -sine * np.sin(turn)]) / -math.pi


@pytest.mark.parametrize("half_plane", [SURFACE, SLOPE])
def test_pressure_on_the_surface(half_plane):
    """A footing, as a segment, as a side and as a function: stress below and beside it, and K of an edge crack against
    dislocations in its field."""

    def place(points):
        return np.asarray(points) @ half_plane.turn + np.asarray(half_plane.point)

    ends, down = place([[-1.0, 0.0], [1.0, 0.0]]), -np.asarray(half_plane.outward)
    name = tuple(map(tuple, ends))
    loads = [
        ddm.BodyLoad(segments=[ends[::-1]], tractions=[[down, down]]),
        ddm.BodyLoad(sides=[(name, down)]),
        ddm.BodyLoad(sides=[(name, lambda points: np.tile(down, (len(points), 1)))]),
    ]
    points = np.array([[0.3, 0.0], [-2.0, 0.0], [0.5, -0.7], [3.0, -1e-3], [0.0, -30.0]])
    closed = Cracks.from_polylines([place([[0.0, -400.0], [1.0, -400.0]])])
    for load in loads:
        sol = body(closed, half_plane=half_plane).solve(load)
        assert np.allclose(sol.stress(place(points)), half_plane.stress_of(strip(points)), atol=1e-10)
    arms = [Arm(1.5 + 0j, 1.5 - 1j, start_is_tip=False, open=True)]
    exact = dislocations.stress_intensity(arms, strip, "half-plane", 257)
    for load in loads:
        found = factors(body(slot(*place([[1.5, 0.0], [1.5, -1.0]]), True), half_plane=half_plane).solve(load))
        assert np.allclose(found, exact, atol=1e-6 * np.abs(exact).max())


def test_sizes_offsets_and_poissons_ratios():
    """From 1 mm to 10 km, at 1e7 m from the origin (where coordinates end at 2e-9 m) and nearly incompressible: K/√size
    stays, to round-off or what coordinates leave."""
    exact = None
    for scale, shift, poisson, tolerance in (
        (1, 0, 0.25, 0), (1e-3, 0, 0.25, 1e-12), (1e4, 0, 0.25, 1e-12), (1, 1e7, 0.25, 1e-5), (1, 0, 0.499, 1e-12)
    ):  # fmt: skip
        rock = Material("rock", youngs_modulus=40e9, poissons_ratio=poisson)
        lines = [np.array([[0.0, 0.0], [0.3, -1.0]]), np.array([[0.5, -0.2], [1.2, -0.25]])]
        cracks = Cracks.from_polylines(
            [scale * line + shift for line in lines], aperture=math.inf, surface=[(True, False), (False, False)]
        )
        half_plane = ddm.HalfPlane((0.0, shift))
        sol = ddm.Body(half_plane, cracks, rock).solve(ddm.BodyLoad(remote_stress=[1, 0, 0]))
        found = factors(sol) / math.sqrt(scale)
        exact = found if exact is None else exact
        assert np.abs(found - exact).max() <= tolerance * np.abs(exact).max(), (scale, shift, poisson)
        assert sol.residual < 1e-9


@pytest.mark.parametrize("gap", [1e-2, 1e-4, 1e-6])
def test_a_tip_that_nearly_reaches_the_surface(gap):
    """Default settings against a mesh for 1e-5; what is left to break grows by much, the far tip is as that of an edge
    crack."""
    ends, load = ((0, -gap), (0, -1 - gap)), ddm.BodyLoad(remote_stress=[1, 0, 0])
    k = factors(body(slot(*ends), 4).solve(load))[:, 0]
    fine = factors(ddm.solve_to(SURFACE, slot(*ends), ROCK, load, 1e-5))[:, 0]
    assert np.allclose(k, fine, rtol=1e-4)
    # The ligament pulls like 1/log: the far tip's factor is still a few per cent short at 1e-6.
    assert 1.0 < k[1] / math.sqrt(math.pi / 2) < crack_arrays.EDGE_CRACK_HALF_PLANE * math.sqrt(2)


def test_closed_faces_below_the_surface():
    """A joint that dips 60° slips in ground with K0 = 0.2: faces shut and rub, K_I is zero, and the traction on them
    obeys Coulomb. So deep that the surface is far, K_II is that of the plane in the local stress, with its gradient."""
    weight, k0, depth = 2.5e4, 0.2, 400.0
    law = JointLaw("faces", friction_angle=math.radians(25))
    way = np.array([math.cos(math.radians(60)), -math.sin(math.radians(60))])
    joint = Cracks.from_polylines([np.array([[0, -depth] - way, [0, -depth] + way])])
    load = ddm.BodyLoad(body_force=[0, -weight], k0=k0)
    sol = ddm.Body(SURFACE, joint, ROCK, DdmSettings(order=6), face_laws=[law]).solve(load)
    stress = -weight * depth * np.array([k0, 1.0, 0.0])
    _, exact = fracture.closed(stress, math.radians(-60), 1.0, math.tan(law.friction_angle))
    k = factors(sol)
    assert np.abs(k[:, 0]).max() == 0
    # The two tips differ by the gradient; their mean is the middle's.
    assert k[:, 1].mean() == pytest.approx(exact, rel=1e-4)
    rub, press = sol.faces.traction[..., 1], sol.faces.traction[..., 0]
    assert np.all(np.abs(rub) <= math.tan(law.friction_angle) * np.abs(press) * (1 + 1e-9))


def test_crack_grows_up_to_the_surface():
    """A pressurised crack below the surface turns up and daylights; what is unchanged is reused to the bit of a fresh
    body."""
    crack = Cracks.from_polylines([np.array([[-1.0, -0.8], [1.0, -0.8]])])
    growth = GrowthSettings(increment=0.15, min_increment=0.15)
    steps = list(
        ddm.propagate(
            SURFACE, crack, ROCK, ddm.BodyLoad(crack_pressure=1e6), growth, settings=DdmSettings(order=4),
            control="toughness", max_steps=30,
        )
    )  # fmt: skip
    events = [event.kind for step in steps for event in step.events]
    assert events.count("daylighting") == 2 and events[-1] == "split"
    # Steadily less pressure: the cover gets easier to lift.
    factor = [step.load_factor for step in steps[:5]]
    assert all(b < a for a, b in pairwise(factor))
    # Mirror symmetry of what was not asked to be symmetric.
    tips = steps[3].tips
    assert tips["k_i"][0] == pytest.approx(tips["k_i"][1], rel=1e-6)
    grown = steps[4]
    fresh = body(grown.cracks, 4).solve(ddm.BodyLoad(crack_pressure=grown.load_factor * 1e6))
    assert np.allclose(factors(fresh), factors(grown.solution), rtol=1e-9, atol=1e-6 * fresh.tips["k_i"].max())


def test_all_loads_together():
    """Weight, remote stress, fluid in cracks and hole, a footing, point loads: the surface and the hole's wall bear
    what they are to bear, and K is the same as a functional of the loads."""
    hole = circle(24, (0.0, -2.0), 0.7)
    cracks = Cracks.from_polylines(
        [np.array([[1.5, 0.0], [1.2, -0.8]]), np.array([[-1.5, -1.0], [-2.0, -2.0]])],
        aperture=math.inf, surface=[(True, False), (False, False)],
    )  # fmt: skip
    heavy = body(cracks, 6, holes=[hole])
    load = ddm.BodyLoad(
        body_force=[0, -1.0], k0=0.4, remote_stress=[2.0, 0, 0], hole_pressure=0.7, crack_pressure=0.2,
        sides=[(((-3, 0), (-1, 0)), np.array([0, -3.0]))], points=[[0.3, -1.0], [2.5, 0.0]],
        forces=[[1.0, 2.0], [0.5, -1.0]],
    )  # fmt: skip
    sol = heavy.solve(load)
    k = factors(sol)
    assert np.abs(heavy.k_functionals(sol)(load) - k).max() < 1e-12 * np.abs(k).max()
    x = np.array([-5.0, -3.5, -0.5, 0.4, 1.0, 6.0])
    assert np.abs(sol.stress(np.column_stack([x, 0 * x]))[:, 1:]).max() < 1e-12
    wall = 0.5 * (hole + np.roll(hole, -1, axis=0))
    n = (wall - [0.0, -2.0]) / np.hypot(*(wall - [0.0, -2.0]).T)[:, None]
    s = sol.stress(wall)
    pull = np.column_stack([s[:, 0] * n[:, 0] + s[:, 2] * n[:, 1], s[:, 2] * n[:, 0] + s[:, 1] * n[:, 1]])
    # Order 6 on sides between corners; 2e-3 is found.
    assert np.abs(pull + 0.7 * n).max() < 1e-2
    assert sol.residual < 1e-4


def test_energy_release_rate():
    """G = dU/da of Clapeyron's energy, by central differences, against (K_I² + K_II²)/E' of a slanted edge crack."""

    def solved(a):
        return body(slot((0, 0), (0.3 * a, -a), True)).solve(ddm.BodyLoad(remote_stress=[1e6, 0, 0]))

    h = 1e-3
    rate = (solved(1 + h).crack_energy - solved(1 - h).crack_energy) / (2 * h * math.hypot(1, 0.3))
    assert rate == pytest.approx(np.sum(factors(solved(1.0)) ** 2) / ROCK.plane_modulus, rel=1e-6)


def test_a_crack_is_born_at_the_surface():
    """Above a pressurised crack the cover bends up: it tears from the surface, in the middle, at the load at which the
    stress there is the strength, and straight down."""
    rock = Material("rock", youngs_modulus=40e9, poissons_ratio=0.25, k_ic=1e9, tensile_strength=2e6)
    crack = Cracks.from_polylines([np.array([[-1.0, -0.5], [1.0, -0.5]])])
    growth = GrowthSettings(increment=0.05, min_increment=0.05, initiation="surface")
    load = ddm.BodyLoad(crack_pressure=1e6)
    step = next(ddm.propagate(SURFACE, crack, rock, load, growth, settings=DdmSettings(order=6), control="toughness"))
    born = [event for event in step.events if event.kind == "birth"]
    assert len(born) == 1 and born[0].point == pytest.approx((0.0, 0.0), abs=1e-9)
    top = step.solution.stress([[0.0, 0.0]])[0]
    assert top[0] == pytest.approx(2e6, rel=1e-6)
    nodes = step.growth.cracks.nodes[-2:]
    assert np.allclose(nodes[1] - nodes[0], [0, -0.05], atol=1e-9)


def test_many_cracks_are_iterated_on():
    """A hundred cracks that shield and feel each other and the surface: the compressed operator against the dense
    matrix."""
    lines = [line - [0.0, 21.0] for line in crack_arrays.random_cracks(100, spacing=2.0)]
    cracks = Cracks.from_polylines(lines, aperture=math.inf)
    load = ddm.BodyLoad(remote_stress=[1, 0, 0])
    found = []
    for solver in ("dense", "compressed"):
        settings = DdmSettings(order=3, elements_per_crack=2, solver=solver)
        found.append(factors(ddm.Body(SURFACE, cracks, ROCK, settings).solve(load)))
    assert np.abs(found[1] - found[0]).max() < 1e-9 * np.abs(found[0]).max()
    assert np.abs(found[0][:, 0]).max() > 0.5


def test_what_a_half_plane_refuses():
    crack = slot((0, -1), (1, -1))
    with pytest.raises(ValueError, match="surface of the half-plane is free of traction"):
        body(crack).solve(ddm.BodyLoad(remote_stress=[0, 1.0, 0]))
    with pytest.raises(ValueError, match="above the surface"):
        body(slot((0, -1), (0, 0.5)))
    with pytest.raises(ValueError, match="not marked as a mouth"):
        body(slot((0, -1), (0, 0)))
    with pytest.raises(ValueError, match="off the boundary"):
        body(slot((0, -0.1), (0, -1), mouth=True))
    with pytest.raises(ValueError, match=r"along the boundary|less than 3°"):
        body(slot((0, 0), (1, -0.01), mouth=True))
    with pytest.raises(
        ValueError, match=r"too thin a piece of rock between them, about .* m: the mesh would need more than"
    ):
        body(slot((-0.5, -1e-4), (0.5, -1e-4)))
    with pytest.raises(ValueError, match="hole 1: reaches the free surface"):
        body(crack, holes=[circle(16, (0, -5.0), 5.5)])
    with pytest.raises(ValueError, match="has an outline"):
        ddm.Body([np.array([[-5, -5], [5, -5], [5, 0], [-5, 0]])], crack, ROCK, half_plane=SURFACE)
    with pytest.raises(ValueError, match="direction out of the rock"):
        ddm.HalfPlane((0, 0), (0, 0))
    with pytest.raises(ValueError, match="k0"):
        ddm.Body([], crack, ROCK).solve(ddm.BodyLoad(k0=0.5, crack_pressure=1.0))
    with pytest.raises(ValueError, match="body_force_gradient"):
        body(crack).solve(ddm.BodyLoad(body_force_gradient=np.eye(2)))
    with pytest.raises(ValueError, match="not on the body"):
        body(crack).solve(ddm.BodyLoad(points=[[0, 1.0]], forces=[[0, 1.0]]))
