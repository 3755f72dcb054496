"""Laws of crack faces: states, inequalities at the nodes, memory, what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.crack_contact import frictional_contact
from geomech.ddm.crack_contact.face_equations import FaceProblem
from geomech.ddm.crack_contact.face_laws import FaceStates
from geomech.ddm.crack_contact.state_responses import StateResponses
from geomech.model import OPEN, SLIP, STICK, Cracks, DdmSettings, JointLaw, Material
from geomech.reference.cracks import fracture

ROCK = Material("rock", 50e9, 0.25)
ROUGH = JointLaw("rough", friction_angle=math.atan(0.6), cohesion=1e5)
LINE = np.array([[-0.8, -0.6], [0.8, 0.6]])


def plane(lines, joint, order=4, elements=4, **options):
    """Cracks in the infinite plane, all under one law."""
    settings = DdmSettings(order=order, elements_per_crack=elements)
    return ddm.Body([], Cracks.from_polylines(lines, **options), ROCK, settings, face_laws=(joint,))


def under(*stress):
    return ddm.BodyLoad(remote_stress=np.array(stress, dtype=float))


def apart(n, seed, spacing):
    """``n`` cracks of half-length 1 whose middles are ``spacing`` apart and more, so that none meet."""
    rng = np.random.default_rng(seed)
    side = math.ceil(math.sqrt(n))
    at = np.array([(i, j) for i in range(side) for j in range(side)], dtype=float)[:n] * spacing
    angle = rng.uniform(0, math.pi, n)
    d = np.column_stack([np.cos(angle), np.sin(angle)])
    return list(np.stack([at - d, at + d], axis=1))


def violation(sol, largest=None):
    """How far the worst node is from its law, in units of the ``largest`` stress, by default that on the faces (and the
    opening that goes with it)."""
    laws, w, t = sol.body.laws, sol.jumps, sol.face_traction
    largest = largest or np.abs(t).max()
    length = sol.body.faces.length.max()
    gap = (w[laws.across] + laws.aperture) / (largest * length)
    pressure, shear = -t[laws.across] / largest, t[laws.along] / largest
    state = sol.states.ravel()
    closed = state != OPEN
    limit = laws.friction * pressure + laws.cohesion / largest
    slipping = laws.rough & (state == SLIP)
    way = sol.memory.states.way
    return max(
        np.max(-gap[laws.closes]),
        np.abs(gap[closed]).max(initial=0.0),
        np.max(-pressure[closed], initial=0.0),
        np.abs(t[np.r_[laws.across[~closed], laws.along[~closed]]]).max(initial=0.0) / largest,
        np.max((np.abs(shear) - limit)[closed & laws.rough], initial=0.0),
        np.abs(shear - way * limit)[slipping].max(initial=0.0),
    )


@pytest.mark.parametrize("stress", [(-5e6, -20e6, 0), (-1e6, -20e6, 3e6), (2e6, -20e6, 0), (1e6, 3e6, 8e6)])
def test_nodes_obey_their_laws_after_convergence(stress):
    sol = plane(apart(9, 1, 2.2), ROUGH).solve(under(*stress))
    assert violation(sol) < 1e-9 and sol.residual < 1e-11
    assert len(np.unique(sol.states)) >= 2 and sol.solves < 12


def test_two_hundred_closed_cracks_settle_in_a_few_solves():
    body = plane(apart(200, 2, 2.4), ROUGH, order=2, elements=2)
    sol = body.solve(under(-3e6, -20e6, 0))
    assert violation(sol) < 1e-9
    # Measured: 4; the number does not grow with that of cracks.
    assert sol.solves <= 8 and (sol.states == STICK).sum() > 100 and (sol.states == SLIP).sum() > 500


@pytest.mark.parametrize("stress", [(2e6, -20e6, 0), (1e6, 3e6, 8e6), (-1e6, -20e6, 3e6)])
def test_the_confinement_path_leads_to_the_same_faces(monkeypatch, stress):
    body = plane(apart(9, 1, 2.2), ROUGH)
    straight = body.solve(under(*stress))
    monkeypatch.setattr(frictional_contact, "_PATIENCE", 0)
    around = body.solve(under(*stress))
    assert around.solves > straight.solves and violation(around) < 1e-9
    np.testing.assert_allclose(around.jumps, straight.jumps, atol=1e-9 * np.abs(straight.jumps).max())


#: Friction angle, mouth on the top side, tip, and the stress (xx, xy, yy) of the block, with which Newton's method
#: cycles: cracks that leave a blade of rock.
BLADES = {
    "9°": (42.68, -0.28, (-2.62, 3.62), (243018.0, -956690.0, 749265.0)),
    "9°, little friction": (25.55, -1.98, (-3.64, 3.73), (-488513.0, 511178.0, 864848.0)),
    "15°": (40.47, 1.8, (-2.0, 3.27), (-376337.0, -153347.0, 655405.0)),
}


@pytest.mark.parametrize("case", BLADES)
def test_rough_faces_of_a_blade_obey_their_laws(case, monkeypatch):
    """Within 2.5 % of order 6, whose contact states Newton's method finds. By Tresca friction with updated limits, K
    of the first two was 13 to 16 % too low, with a few nodes in violation."""
    angle, mouth, tip, (xx, xy, yy) = BLADES[case]
    cracks = Cracks.from_polylines([np.array([[mouth, 4.0], tip])], aperture=0.0)
    cracks = replace(cracks, surface=np.array([True, False]))
    rock = np.array([[-5.0, -4.0], [5.0, -4.0], [5.0, 4.0], [-5.0, 4.0]])
    law = JointLaw("rough", friction_angle=math.radians(angle))
    load = ddm.BodyLoad(sides={0: (-xy, -yy), 1: (xx, xy), 2: (xy, yy), 3: (-xx, -xy)})
    followed = []
    path = frictional_contact.confinement_path
    monkeypatch.setattr(frictional_contact, "confinement_path", lambda *of: followed.append(of) or path(*of))
    coarse, fine = (
        ddm.Body([rock], cracks, ROCK, DdmSettings(order=order, elements_per_crack=2, elements_per_side=2),
                 face_laws=(law,)).solve(load)
        for order in (3, 6)
    )  # fmt: skip
    assert len(followed) == 1 and violation(coarse, 1e6) < 1e-9
    for mode in ("k_i", "k_ii"):
        assert coarse.tips[mode][0] == pytest.approx(fine.tips[mode][0], rel=0.025)


def test_no_law_is_smooth():
    lines = apart(4, 3, 2.2)
    smooth = plane(lines, JointLaw("smooth")).solve(under(-1e6, -20e6, 0))
    settings = DdmSettings(order=4, elements_per_crack=4)
    plain = ddm.Body([], Cracks.from_polylines(lines), ROCK, settings).solve(under(-1e6, -20e6, 0))
    np.testing.assert_array_equal(smooth.jumps, plain.jumps)
    # The general equations, without friction, give the same.
    hardly = plane(lines, JointLaw("hardly", friction_angle=1e-13)).solve(under(-1e6, -20e6, 0))
    np.testing.assert_allclose(hardly.jumps, plain.jumps, atol=1e-9 * np.abs(plain.jumps).max())


def test_history_goes_on_where_faces_are_divided():
    """A tip that advances makes its old element an ordinary one: the slip stays, and without more load nothing slips
    but the new piece and what it relieves."""
    body = plane([LINE], ROUGH)
    loaded = body.solve(under(0, -20e6, 0))
    d = LINE[1] / np.hypot(*LINE[1])
    old = body.cracks
    cracks = Cracks(
        nodes=np.concatenate([old.nodes, [LINE[1] + 0.1 * d]]),
        segments=np.concatenate([old.segments, [[1, 2]]]),
        crack=np.zeros(2, int),
        block=np.zeros(2, int),
        birth_cycle=np.array([0, 1]),
        aperture=np.zeros(2),
        surface=np.zeros(3, bool),
        names=old.names,
    )
    longer = ddm.Body([], cracks, ROCK, body.settings, reuse=ddm.Reuse(body), face_laws=body.face_laws)
    grown = longer.solve(under(0, -20e6, 0), history=loaded)
    fresh = longer.solve(under(0, -20e6, 0))
    # One way slip under one load: where it began does not matter.
    np.testing.assert_allclose(grown.jumps, fresh.jumps, atol=1e-9 * np.abs(fresh.jumps).max())
    # Unloaded, the faces hold what slip they have; a body that forgot would have none.
    back = longer.solve(under(0, -1e6, 0), history=grown)
    assert back.frictional_work > grown.frictional_work > loaded.frictional_work > 0
    assert abs(back.tips["k_ii"]).max() > 1e6 > 0.3 * abs(longer.solve(under(0, -1e6, 0)).tips["k_ii"]).max()


def test_error_estimate_of_rough_faces_is_that_of_the_closed_form():
    """The finer solution that the estimate is made with has other nodes; K_II = −(|τ| − μ|σ_n| − c) √(πa) in all."""
    sol = plane([LINE], ROUGH, elements=2).solve(under(0, -20e6, 0))
    exact = fracture.closed(np.array([0, -20e6, 0]), math.atan2(0.6, 0.8), 1.0, 0.6, 1e5)[1]
    error = np.abs(sol.tips["k_ii"] - exact)
    assert (sol.tip_errors[:, 0] == 0).all()
    assert (error <= sol.tip_errors[:, 1]).all()
    assert (sol.tip_errors[:, 1] <= 10 * error).all()


def test_cement_holds_until_its_strength_and_is_lost_for_good():
    law = JointLaw("cemented", friction_angle=0.5, cohesion=5e6, tensile_strength=2e6)
    body = plane([LINE], law)
    across = np.array([-0.6, 0.8])

    def pull(size):
        return under(size * across[0] ** 2, size * across[1] ** 2, size * across[0] * across[1])

    held = body.solve(pull(1.9e6))
    assert (held.states == STICK).all() and not held.jumps.any()
    torn = body.solve(pull(2.1e6), history=held)
    assert (torn.states == OPEN).all() and torn.memory.broken.all()
    np.testing.assert_allclose(torn.tips["k_i"], 2.1e6 * math.sqrt(math.pi), rtol=1e-5)
    again = body.solve(pull(1e6), history=torn)
    np.testing.assert_allclose(again.tips["k_i"], 1e6 * math.sqrt(math.pi), rtol=1e-5)


def test_bad_laws_are_refused_by_name():
    with pytest.raises(ValueError, match=r"'a'.*law 1.*there are 1"):
        plane([LINE], ROUGH, law=1, names=["a"])
    with pytest.raises(ValueError, match=r"'a'.*aperture.*'glue'"):
        plane([LINE], JointLaw("glue", tensile_strength=1e6), aperture=1e-3, names=["a"])


BLOCK = np.array([[-2, -3], [2, -3], [2, 3], [-2, 3.0]])


def pressed(sideways, down, tilt=0.0):
    """Linear tractions on all sides of `BLOCK`, in equilibrium: the stress field of a bent column."""
    sides = np.stack([BLOCK, np.roll(BLOCK, -1, axis=0)], axis=1)
    t = np.zeros((4, 2, 2))
    for k, normal in enumerate(([0, -1], [1, 0], [0, 1], [-1, 0])):
        for e in range(2):
            t[k, e] = np.array([sideways, down + tilt * sides[k, e, 0]]) * normal
    return ddm.BodyLoad(segments=sides, tractions=t)


@pytest.mark.parametrize("law", [JointLaw("smooth"), ROUGH, JointLaw("filled", 0.3, 2e5, 0.0, 4e10, 1e10)])
def test_functionals_of_the_tips_are_the_solution(law):
    """With the states of one load, factors under another come from a dot product: the solve's, where states are the
    same, to round-off."""
    cracks = Cracks.from_polylines([LINE, LINE * [1, -1] + [0.3, 1.9]])
    body = ddm.Body([BLOCK], cracks, ROCK, DdmSettings(order=4), face_laws=(law,))
    for one, other in (((-1e6, -20e6), (-1.1e6, -22e6)), ((2e6, 3e6, 1e5), (2e6, 3.1e6, 0.0))):
        sol = body.solve(pressed(*one))
        again = body.solve(pressed(*other))
        np.testing.assert_array_equal(sol.face_states.key, again.face_states.key)
        k = body.k_functionals(sol)
        assert body.k_functionals(again) is k
        for load, solved in ((one, sol), (other, again)):
            expected = np.stack([solved.tips["k_i"], solved.tips["k_ii"]], axis=1)
            np.testing.assert_allclose(k(pressed(*load)), expected, atol=1e-12 * np.abs(expected).max())
            assert (k.bound(pressed(*load)) >= np.abs(expected) * (1 - 1e-12)).all()
    # The bound holds for every distribution of tractions that is no larger.
    rng = np.random.default_rng(0)
    load = pressed(-1e6, -1e6)
    signs = ddm.BodyLoad(segments=load.segments, tractions=rng.uniform(-1e6, 1e6, (4, 2, 2)))
    assert (np.abs(body.k_functionals()(signs)) <= body.k_functionals().bound(load)).all()


def test_work_is_counted_from_body_to_body():
    body = ddm.Body([BLOCK], Cracks.from_polylines([LINE]), ROCK)
    first = body.solve(pressed(-1e6, -20e6))
    assert (body.work.boundary_factorisations, body.work.solutions) == (1, 1)
    assert body.work.contact_solves == first.solves and body.work.crack_factorisations >= 1
    before = vars(body.work).copy()
    longer = Cracks.from_polylines([LINE, LINE + [0.2, 1.0]])
    again = ddm.Body([BLOCK], longer, ROCK, reuse=ddm.Reuse(body, body.work))
    again.solve(pressed(-1e6, -20e6), warm=first)
    assert again.work.bodies == 2 and again.work.boundary_assemblies == before["boundary_assemblies"] == 1
    assert again.work.elements_assembled - before["elements_assembled"] == again.counts["elements_new"]


def test_what_grows_from_a_cemented_crack_is_not_cemented():
    """Pulled along a wing that grew from a cemented flaw, the wing opens; drawn with the flaw it would hold."""
    law = JointLaw("cemented", friction_angle=0.5, cohesion=5e6, tensile_strength=50e6, normal_stiffness=1e12)

    def winged(birth):
        cracks = Cracks.from_polylines([np.array([[0.0, 0.0], [1.0, 0.0], [1.3, 0.0]])])
        cracks = replace(cracks, birth_cycle=np.array([0, birth]))
        return ddm.Body([], cracks, ROCK, face_laws=(law,)).solve(under(0, 1e6, 0))

    assert (winged(0).states == STICK).all()
    grown = winged(1)
    on_wing = grown.body.faces.source == 1
    assert (grown.states[on_wing] == OPEN).all() and (grown.states[~on_wing] == STICK).all()
    assert grown.tips["k_i"].max() > 0


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("stress", [0.0, 1e-305])
def test_strong_faces_without_load_stay_as_they_are(stress):
    """Nothing to measure a strength by: it is not divided until it overflows."""
    strong = JointLaw("strong", friction_angle=0.5, cohesion=1e6, tensile_strength=1e5)
    solution = plane([LINE], strong).solve(under(0.0, -stress, stress))
    assert np.abs(solution.jumps).max() <= stress and (solution.states == STICK).all()


@pytest.mark.parametrize("cohesion", [0.0, 2e6])
def test_solutions_along_a_path_are_those_of_their_states(cohesion):
    """Responses in the first states give any others, to round-off of the equations solved anew in each."""
    law = JointLaw("rough", friction_angle=math.radians(30), cohesion=cohesion)
    body = plane(apart(9, 1, 2.2), law)
    first = body.solve(under(1e6, 3e6, 8e6))
    problem = FaceProblem(body.face_equations, -body.solve(under(2e6, -20e6, 0)).face_load, first.memory)
    both = np.stack([problem.right, 0.5 * problem.right], axis=1)
    more = np.stack([np.zeros(len(problem.laws.along)), np.full(len(problem.laws.along), 1e5)], axis=1)
    path, random, states = StateResponses(problem, both, more), np.random.default_rng(0), first.face_states
    for node in random.integers(len(states.closed), size=30).tolist():
        closed, way = states.closed.copy(), states.way.copy()
        closed[node] = random.random() < 0.7
        way[node] = random.integers(-1, 2) if closed[node] else 0
        states = FaceStates(closed, way, states.pulled)
        expected = body.face_equations.solve(both, states, first.memory, more)
        for found, value in zip(path.solve(states), expected):
            np.testing.assert_allclose(found, value, atol=1e-10 * np.abs(value).max())
