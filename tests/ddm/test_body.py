"""Bodies: reuse of an earlier body's work, face contact, equilibrium, refusals, fields at awkward points."""

import math

import numpy as np
import pytest
import shapely

from geomech import ddm
from geomech.ddm.system.displacement_jumps import strain_weights
from geomech.model import SLIP, Cracks, DdmSettings, Material

ROCK = Material("rock", youngs_modulus=10e9, poissons_ratio=0.25)
SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
NONE = Cracks.from_polylines([])


def pressed(ends=-1.0, sides=0.0):
    return ddm.BodyLoad(
        segments=np.stack([SQUARE, np.roll(SQUARE, -1, axis=0)], axis=1),
        tractions=[[[0, -ends]] * 2, [[sides, 0]] * 2, [[0, ends]] * 2, [[-sides, 0]] * 2],
    )


def grown(n, mouth=False, aperture=0.0):
    """A slanted crack with ``n`` wing increments at its upper end, the last one a mouth on the top if asked."""
    points = [np.array([-0.2, -0.15]), np.array([0.2, 0.15])]
    for k in range(n):
        points.append(points[-1] + 0.1 * np.array([math.sin(0.3 / (k + 1)), math.cos(0.3 / (k + 1))]))
    if mouth:
        points.append(np.array([points[-1][0] + 0.02, 1.0]))
    n_segments = len(points) - 1
    return Cracks(
        nodes=np.array(points),
        segments=np.column_stack([np.arange(n_segments), np.arange(1, n_segments + 1)]),
        crack=np.zeros(n_segments, int),
        block=np.zeros(n_segments, int),
        birth_cycle=np.arange(n_segments),
        aperture=np.full(n_segments, aperture),
        surface=np.r_[np.zeros(n_segments, bool), mouth],
        names=("wing",),
    )


def test_reuse_agrees_with_a_fresh_body():
    """1e-12 of the largest K over growth, a mouth that splits the boundary, and loads kept from body to body."""
    load = pressed(-1.0)
    body = None
    for n, mouth in ((0, False), (1, False), (2, False), (3, False), (4, False), (5, False), (5, True)):
        cracks = grown(n, mouth, aperture=math.inf)
        body = ddm.Body([SQUARE], cracks, ROCK, reuse=ddm.Reuse(body))
        kept = body.solve(load)
        fresh = ddm.Body([SQUARE], cracks, ROCK).solve(load)
        for name in ("k_i", "k_ii"):
            scale = np.abs(np.concatenate([fresh.tips["k_i"], fresh.tips["k_ii"]])).max()
            assert np.abs(kept.tips[name] - fresh.tips[name]).max() < 1e-12 * scale
        if n > 0 and not mouth:
            assert body.counts["elements_new"] < 20
        if n in (1, 2, 3) or mouth:
            p = np.array([[0.5, 0.4], [-0.8, 0.1]])
            assert np.allclose(kept.stress(p), fresh.stress(p), rtol=1e-10)


def test_loads_that_come_again_are_answered_as_new_ones():
    """Tractions and body forces of changing size on the same segments, one against the boundary's direction, and after
    growth: 1e-12 of the largest K, stress and displacement to the round-off of their sums."""
    rng = np.random.default_rng(7)
    segments = np.stack([SQUARE, np.roll(SQUARE, -1, axis=0)], axis=1)
    segments[1] = segments[1, ::-1]
    points = np.array([[0.5, 0.4], [-0.8, 0.1]])
    body = None
    for n in (0, 1, 2):
        body = ddm.Body([SQUARE], grown(n, aperture=math.inf), ROCK, reuse=ddm.Reuse(body))
        for _ in range(4):
            # A uniform pressure, and tractions that hold a uniform body force.
            b = rng.normal(size=2)
            push = rng.normal() * 5
            tractions = np.array([[[0, push]] * 2, [[0, 0]] * 2, [[0, -push]] * 2, [[0, 0]] * 2])
            tractions[2] += -4 * b / 2
            tractions[1] += [[0.0, -b[0]], [0.0, -b[0]]]
            tractions[3] += [[0.0, b[0]], [0.0, b[0]]]
            load = ddm.BodyLoad(segments=segments, tractions=tractions, body_force=b, about=np.zeros(2))
            again = body.solve(load)
            fresh = ddm.Body([SQUARE], body.cracks, ROCK).solve(load)
            scale = np.abs(np.concatenate([fresh.tips["k_i"], fresh.tips["k_ii"]])).max()
            for name in ("k_i", "k_ii"):
                assert np.abs(again.tips[name] - fresh.tips[name]).max() < 1e-12 * scale
            for got, want in zip(again.fields(points), fresh.fields(points)):
                assert np.allclose(got, want, rtol=0, atol=1e-11 * np.abs(want).max())
            assert abs(again.residual - fresh.residual) < 1e-11


def test_loads_need_no_factors_of_the_boundary():
    """From no crack on, past bodies that are not solved and back to fewer elements, also when the load changes. K as of
    fresh bodies, 1e-12 of the largest."""
    body, solved = ddm.Body([SQUARE], NONE, ROCK), []
    body.solve(pressed(-1.0))
    for n, load in ((0, -1.0), (1, -1.0), (2, None), (3, -1.0), (2, -1.0), (3, -2.0), (4, -2.0)):
        body = ddm.Body([SQUARE], grown(n, aperture=math.inf), ROCK, reuse=ddm.Reuse(body))
        if load is None:
            continue
        before = body.work.back_substitutions
        got = body.solve(pressed(load))
        solved.append(body.work.back_substitutions - before)
        want = ddm.Body([SQUARE], body.cracks, ROCK).solve(pressed(load))
        both = [np.concatenate([x.tips["k_i"], x.tips["k_ii"]]) for x in (got, want)]
        assert np.abs(both[0] - both[1]).max() < 1e-12 * np.abs(both[1]).max()
    # One right-hand side of the cracks each time; none of the boundary, for which loads of new size took one besides.
    assert solved == [1, 1, 1, 1, 1, 1]


def test_boundary_is_not_touched_by_growth_inside():
    first = ddm.Body([SQUARE], grown(0), ROCK)
    second = ddm.Body([SQUARE], grown(1), ROCK, reuse=ddm.Reuse(first))
    assert first.counts["boundary_factorisations"] == 1 and second.counts["boundary_factorisations"] == 0
    assert second.boundary is first.boundary
    same = ddm.Body([SQUARE], grown(1), ROCK, reuse=ddm.Reuse(second))
    assert same.counts["elements_new"] == 0
    other = ddm.Body([SQUARE], grown(1), Material("soft", 10e9, 0.3), reuse=ddm.Reuse(second))
    assert other.counts["elements_new"] == other.counts["elements"]


def test_faces_in_contact_satisfy_their_conditions():
    """A wing crack that closes in part: complementarity to 1e-9 of the load at every node, and warm starts agree."""
    body = ddm.Body([SQUARE], grown(4), ROCK)
    sol = body.solve(pressed(-1e6, -0.3e6))
    closed = sol.states == SLIP
    assert closed.any() and not closed.all()
    opening, traction = sol.faces.opening[:, 1:-1], sol.faces.traction[:, 1:-1]
    scale = sol.faces.opening.max()
    assert opening.min() > -1e-9 * scale and np.abs(opening[closed]).max() < 1e-9 * scale
    assert traction[..., 0].max() < 1e-9 * 1e6 and np.abs(traction[~closed]).max() < 1e-9 * 1e6
    assert np.abs(traction[..., 1]).max() < 1e-9 * 1e6
    again = body.solve(pressed(-1.1e6, -0.33e6), warm=sol)
    assert again.solves == 1 and np.allclose(again.tips["k_ii"], 1.1 * sol.tips["k_ii"], rtol=1e-9)
    larger = ddm.Body([SQUARE], grown(5), ROCK, reuse=ddm.Reuse(body)).solve(pressed(-1e6, -0.3e6), warm=sol)
    cold = ddm.Body([SQUARE], grown(5), ROCK).solve(pressed(-1e6, -0.3e6))
    assert (larger.states == cold.states).all()


def test_a_crack_pulled_open_or_pressed_shut():
    body = ddm.Body([SQUARE], Cracks.from_polylines([np.array([[-0.3, 0], [0.3, 0]])]), ROCK)
    assert (body.solve(pressed(1.0)).states == 0).all()
    shut = body.solve(pressed(-1.0))
    # Shut, the crack is not there: uniform stress to 1e-9.
    assert np.allclose(shut.stress([[0.1, 0.2], [0.0, 0.4]]), [0, -1, 0], atol=1e-9)
    assert (shut.tips["k_i"] == 0).all() and np.abs(shut.tips["k_ii"]).max() < 1e-9


def test_out_of_equilibrium_is_refused_with_its_size():
    load = ddm.BodyLoad(segments=[[[-1, -1], [1, -1]]], tractions=[[[0, 5.0]] * 2])
    with pytest.raises(ddm.OutOfEquilibrium, match=r"force .0, 10. N/m") as caught:
        ddm.Body([SQUARE], NONE, ROCK).solve(load)
    assert caught.value.relative == pytest.approx(1.0) and caught.value.moment == pytest.approx(0.0)
    shear = ddm.BodyLoad(segments=[[[-1, -1], [1, -1]], [[1, 1], [-1, 1]]], tractions=[[[-1.0, 0]] * 2, [[1.0, 0]] * 2])
    with pytest.raises(ddm.OutOfEquilibrium) as caught:
        ddm.Body([SQUARE], NONE, ROCK).solve(shear)
    # Two forces of 2 N/m, two metres apart.
    assert caught.value.moment == pytest.approx(-4.0)
    ddm.Body([SQUARE], NONE, ROCK).solve(shear, equilibrium_tolerance=1.0)


def test_loads_may_run_against_the_edge_and_stand_a_little_off():
    body = ddm.Body([SQUARE], Cracks.from_polylines([np.array([[-0.3, 0.1], [0.2, 0]])], aperture=math.inf), ROCK)
    a = body.solve(pressed(1.0)).tips["k_i"]
    load = pressed(1.0)
    turned = ddm.BodyLoad(load.segments[:, ::-1] * (1 + 1e-8), load.tractions[:, ::-1])
    assert np.allclose(body.solve(turned).tips["k_i"], a, rtol=1e-7)
    with pytest.raises(ValueError, match=r"load segment 0 lies .* off the boundary"):
        body.solve(ddm.BodyLoad(load.segments * 0.9, load.tractions))


@pytest.mark.parametrize(
    ("loops", "lines", "message"),
    [
        ([SQUARE[::-1]], [], "counter-clockwise"),
        ([SQUARE[[0, 2, 1, 3]] + [[0, 0], [0, 0], [0, 0], [0.1, 0]]], [], "counter-clockwise|crosses itself"),
        ([np.array([[0, 0], [2, 0], [2, 2], [1, -1], [0, 2.0]])], [], "crosses itself"),
        ([SQUARE * np.nan], [], "not finite"),
        ([np.vstack([SQUARE, SQUARE[-1:]])], [], "coincide"),
        ([SQUARE, 0.2 * SQUARE], [], "clockwise"),
        ([SQUARE, 0.2 * SQUARE[::-1] + 2], [], "not inside"),
        ([SQUARE], [[[0.5, 0], [1.5, 0]]], "outside the rock|crosses the outline"),
        ([SQUARE], [[[0.5, 0], [1.0, 0]]], "not marked as a mouth"),
        ([SQUARE, 0.2 * SQUARE[::-1]], [[[0.5, 0], [0.1, 0]]], "outside the rock"),
        ([SQUARE], [[[-0.5, 0], [0.5, 0]], [[0, -0.5], [0, 0.5]]], "'crack 0' and 'crack 1' cross"),
        ([SQUARE], [[[-0.5, 0], [0.5, 0]], [[0, 0], [0.7, 0]]], "'crack 0' and 'crack 1' coincide"),
        ([], [[[-0.5, 0], [0.5, 0]], [[-0.5, 0], [0.5, 0]]], "coincide"),
    ],
)
def test_refusals_name_the_item(loops, lines, message):
    with pytest.raises(ValueError, match=message):
        ddm.Body(loops, Cracks.from_polylines([np.array(line, float) for line in lines]), ROCK)


def test_a_body_cut_in_two_is_refused():
    cracks = Cracks.from_polylines([np.array([[-1, 0.1], [1, 0.2]])], aperture=math.inf, surface=[(True, True)])
    with pytest.raises(np.linalg.LinAlgError, match="separate a part"):
        ddm.Body([SQUARE], cracks, ROCK).solve(pressed(1.0))


def test_load_arrays_are_checked():
    with pytest.raises(ValueError, match="segments"):
        ddm.BodyLoad(segments=np.zeros((3, 2)))
    with pytest.raises(ValueError, match="1 load segments but 2 tractions"):
        ddm.BodyLoad(segments=np.zeros((1, 2, 2)), tractions=np.zeros((2, 2, 2)))
    with pytest.raises(ValueError, match="not finite"):
        ddm.BodyLoad(remote_stress=[np.nan, 0, 0])
    with pytest.raises(ValueError, match="outline"):
        ddm.Body([], grown(0), ROCK).solve(ddm.BodyLoad(body_force=[0, -1]))


def test_fields_are_finite_everywhere():
    """Corners, element ends, crack nodes and tips included; near a corner of a pressed square the stress stays −1."""
    body = ddm.Body([SQUARE], grown(2, aperture=math.inf), ROCK)
    sol = body.solve(pressed(-1.0))
    ends = np.concatenate([SQUARE, body.boundary.start, body.faces.start, body.faces.end, body.cracks.nodes])
    assert np.isfinite(sol.stress(ends)).all() and np.isfinite(sol.displacement(ends)).all()
    stress, displacement = sol.fields(ends)
    assert np.array_equal(stress, sol.stress(ends)) and np.array_equal(displacement, sol.displacement(ends))
    whole = ddm.Body([SQUARE], NONE, ROCK).solve(pressed(-1.0))
    assert np.allclose(whole.stress(np.vstack([SQUARE, whole.body.boundary.start])), [0, -1, 0], atol=1e-6)


@pytest.mark.parametrize("bounded", [True, False])
def test_there_is_no_stress_where_there_is_no_rock(bounded):
    """Random points against Shapely's polygons; a hair's breadth beyond a side it is still that of the side."""
    turn = np.linspace(0, 2 * np.pi, 9)[:-1]
    hole = 0.3 * np.column_stack([np.cos(turn), np.sin(turn)]) * (1 + 0.3 * (np.arange(8) % 2))[:, None] + [0.3, -0.5]
    load = pressed(-1.0) if bounded else ddm.BodyLoad(remote_stress=[0, -1, 0])
    body = ddm.Body([SQUARE] if bounded else [], grown(0), ROCK, holes=[hole])
    sol = body.solve(load)
    points = np.random.default_rng(1).uniform(-1.3, 1.3, (3000, 2))
    sheet = shapely.Polygon(SQUARE if bounded else 9 * SQUARE, [hole])
    rock = shapely.contains_xy(sheet, *points.T)
    assert 100 < rock.sum() < 2900
    for field in (*sol.fields(points), sol.principal_stress(points)[0]):
        assert np.array_equal(np.isfinite(field).all(axis=1), rock)
        assert np.array_equal(np.isnan(field).all(axis=1), ~rock)
    at = 0.3 * hole[2] + 0.7 * hole[3]
    out = 1e-7 * (hole.mean(axis=0) - at)
    assert np.allclose(sol.stress([at + out]), sol.stress([at]), atol=1e-5)
    assert np.isnan(sol.stress([at + 1e3 * out])).all()


def test_outline_neither_moves_nor_turns_on_average():
    """Mean displacement and rotation of the outline vanish by Gauss points on it. 1e-6 of the largest: the field's
    limit at the boundary and the boundary's own unknowns agree to the discretisation error."""
    sol = ddm.Body([SQUARE], grown(2, aperture=math.inf), ROCK).solve(pressed(-1e6, -2e5))
    b = sol.body.boundary
    x, w = np.polynomial.legendre.leggauss(12)
    points, ds = b.at(x), 0.5 * b.length[:, None] * w
    u = sol.displacement(points.reshape(-1, 2)).reshape(points.shape)
    size = np.abs(u).max() * ds.sum()
    assert np.abs(np.einsum("ej,ejc->c", ds, u)).max() < 1e-6 * size
    turn = np.einsum("ej,ej->", ds, points[..., 0] * u[..., 1] - points[..., 1] * u[..., 0])
    assert abs(turn) < 1e-6 * size


def test_mirrored_body_mirrors_its_answer():
    lines = [np.array([[-0.5, -0.2], [-0.1, 0.2]])]
    a = ddm.Body([SQUARE], Cracks.from_polylines(lines, aperture=math.inf), ROCK).solve(pressed(1.0))
    mirrored = [line * [-1, 1] for line in lines]
    b = ddm.Body([SQUARE], Cracks.from_polylines(mirrored, aperture=math.inf), ROCK).solve(pressed(1.0))
    assert np.allclose(a.tips["k_i"], b.tips["k_i"], rtol=1e-11) and np.allclose(
        a.tips["k_ii"], -b.tips["k_ii"], rtol=1e-10
    )


def test_answer_does_not_depend_on_place_or_size():
    """Scaled by 1e-3 and moved 30 sizes away, K scales with √size; 1e-9: digits lost to the place."""
    lines = [np.array([[-0.5, -0.2], [-0.1, 0.2]])]
    a = ddm.Body([SQUARE], Cracks.from_polylines(lines, aperture=math.inf), ROCK).solve(pressed(1.0))

    def move(x):
        return 1e-3 * (np.asarray(x) + [30.0, -20.0])

    load = pressed(1.0)
    b = ddm.Body([move(SQUARE)], Cracks.from_polylines([move(lines[0])], aperture=math.inf), ROCK).solve(
        ddm.BodyLoad(move(load.segments), load.tractions)
    )
    assert np.allclose(b.tips["k_i"], a.tips["k_i"] * math.sqrt(1e-3), rtol=1e-9)


def outline_strain(sol: ddm.Solution, area: float) -> np.ndarray:
    """(3,) mean strain over the outline around ``area``."""
    outside = np.flatnonzero(sol.body.mesh.edge_loop[sol.body.boundary.source] == 0)
    b = sol.body.boundary.take(outside)
    x, w = np.polynomial.legendre.leggauss(12)
    u = sol.displacement(b.at(x).reshape(-1, 2)).reshape(b.n, 12, 2)
    du = np.einsum("e,j,ejc->ec", 0.5 * b.length, w, u)
    out = -b.normal
    sums = du[:, 0] * out[:, 0], du[:, 1] * out[:, 1], du[:, 0] * out[:, 1] + du[:, 1] * out[:, 0]
    return np.sum(sums, axis=1) / area


def test_crack_strain_is_the_mean_strain_that_the_rock_lacks():
    """Mean strain over the outline = that of the whole rock under the mean stress + the cracks' (reciprocity): 1e-6."""
    body = ddm.Body([SQUARE], Cracks.from_polylines([np.array([[-0.4, -0.2], [0.5, 0.3]])], aperture=math.inf), ROCK)
    sol = body.solve(pressed(2e6))
    expected = ROCK.compliance() @ [0, 2e6, 0] + sol.crack_strain
    mean = outline_strain(sol, body.area)
    assert np.allclose(mean, expected, atol=1e-6 * np.abs(expected).max())
    assert np.allclose(body.compliance(sol) @ [0, 2e6, 0], sol.crack_strain, rtol=1e-5)


def test_crack_strain_beside_a_hole_is_that_of_the_outline():
    """A hole gives way to the crack beside it. Strain that the crack adds on the outline, energy that it stores (half of
    the mean stress times that strain), compliance: all one, to 1e-3. (Of the faces
    alone it would be more than half off.)"""
    hole = 0.4 * SQUARE[::-1] + [0.3, 0.2]
    line = Cracks.from_polylines([np.array([[-0.8, -0.5], [0.4, -0.35]])], aperture=math.inf)
    body, whole = ddm.Body([SQUARE, hole], line, ROCK), ddm.Body([SQUARE, hole], NONE, ROCK)
    stress = np.array([0.5e6, 2e6, 0.3e6])
    sol, intact = (of.solve(of.mean_stress_load(stress)) for of in (body, whole))
    outline = 4.0
    added = outline_strain(sol, outline) - outline_strain(intact, outline)
    scale = np.abs(added).max()
    assert np.allclose(sol.crack_strain, added, atol=1e-3 * scale)
    assert 0.5 * body.area * stress @ sol.crack_strain == pytest.approx(sol.crack_energy, rel=1e-6)
    assert np.allclose(body.compliance(sol) @ stress, sol.crack_strain, atol=1e-3 * scale)
    faces = strain_weights(body.faces) @ sol.jumps / (body.area * 2 * ROCK.shear_modulus)
    assert np.abs(faces - added).max() > 0.5 * scale


def test_kink_is_graded_and_forgotten():
    """A kinked crack's K with default grading is within 0.3 % of that with four layers more; three increments on, the
    layers (three at this turn) are gone."""

    def body(n, layers):
        return ddm.Body([], grown(n, aperture=math.inf), ROCK, DdmSettings(grading_layers=layers))

    load = ddm.BodyLoad(remote_stress=[0, 1.0, 0])
    two, six = (body(1, layers).solve(load).tips for layers in (2, 6))
    assert np.allclose(two["k_i"], six["k_i"], rtol=3e-3) and np.allclose(two["k_ii"], six["k_ii"], atol=3e-3)
    on_first = [np.sum(body(n, 2).faces.source == 0) for n in (1, 2, 3, 4)]
    assert on_first[0] == on_first[1] == 7 and on_first[2] == on_first[3] == 4


def test_principal_stresses_are_those_of_the_tensor():
    """σ₁ ≥ σ₂ with their direction: of simple compression σ₂ = −1 along y, elsewhere the eigenvalues of the tensor
    (round-off)."""
    points = np.array([[0.5, 0.4], [-0.8, 0.1], [0.05, -0.3]])
    whole, angle = ddm.Body([SQUARE], NONE, ROCK).solve(pressed(-1.0)).principal_stress(points)
    np.testing.assert_allclose(whole, [[0.0, -1.0]] * 3, atol=1e-9)
    np.testing.assert_allclose(angle, 0.0, atol=1e-9)
    cracked = ddm.Body([SQUARE], grown(0, aperture=math.inf), ROCK).solve(pressed(-1.0))
    principal, angle = cracked.principal_stress(points)
    for (xx, yy, xy), pair, a in zip(cracked.stress(points), principal, angle):
        tensor, along = np.array([[xx, xy], [xy, yy]]), np.array([math.cos(a), math.sin(a)])
        np.testing.assert_allclose(np.linalg.eigvalsh(tensor)[::-1], pair, atol=1e-13)
        np.testing.assert_allclose(tensor @ along, pair[0] * along, atol=1e-13)
