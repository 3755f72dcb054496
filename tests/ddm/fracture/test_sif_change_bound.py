"""How far stress intensity factors can change between two loads while crack faces open and close, against solutions
under random loads in equilibrium."""

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.fracture.sif_change_bound import ESTIMATED, MARGIN, ChangeBound, _raised, changes_are_bounded
from geomech.ddm.loads.body_loads import resultants
from geomech.model import Cracks, DdmSettings, JointLaw, Material

ROCK = Material("rock", 10e9, 0.25, k_ic=1e6)
OUTLINE = np.array([[0.0, 0.0], [2.0, 0.0], [2.3, 1.1], [1.2, 1.6], [0.0, 1.5]])
LINES = [np.array([[0.9, 0.5], [1.3, 0.8], [1.6, 0.8]]), np.array([[0.0, 1.1], [0.5, 1.2]])]


def body_with(aperture=0.0, **others):
    cracks = Cracks.from_polylines(LINES, block=0, aperture=aperture, surface=[(False, False), (True, False)])
    return ddm.Body([OUTLINE], cracks, ROCK, DdmSettings(), **others)


def random_load(body, rng):
    """Tractions on random pieces of the outline, with the body force that balances them, and at times more."""
    edge = rng.integers(0, 5, int(rng.integers(1, 6)))
    a, b = OUTLINE[edge], OUTLINE[(edge + 1) % 5]
    low = rng.uniform(0, 0.9, len(edge))
    high = np.minimum(low + 10.0 ** rng.uniform(-2, 0, len(edge)), 1.0)
    segments = np.stack([a + low[:, None] * (b - a), a + high[:, None] * (b - a)], axis=1)
    tractions = rng.normal(size=segments.shape) * 1e6
    force, moment, _ = resultants(segments, tractions, body.centroid)
    sym = rng.choice([0.0, 1e5]) * np.array([[1.0, 0.3], [0.3, -0.5]])
    moment += (body._second @ sym)[0, 1] - (body._second @ sym)[1, 0]
    turn = moment / np.trace(body._second)
    about = np.array([0.3, -0.2])
    gradient = sym + np.array([[0.0, turn], [-turn, 0.0]])
    return ddm.BodyLoad(
        segments=segments, tractions=tractions, body_force=-force / body.area + gradient @ (about - body.centroid),
        body_force_gradient=gradient, about=about, remote_stress=rng.normal(size=3) * rng.choice([0.0, 1e5]),
    )  # fmt: skip


def norm(body, load):
    """Norm of the traction of ``load`` on closed faces, with the raised matrix but from the load itself."""
    c = body.faces
    share = np.broadcast_to(c.quadrature[:, None], (c.n, 2, c.per)).ravel()
    factor, scale = _raised(body.crack_system.matrix.dense, share)
    return float(np.linalg.norm(np.linalg.solve(np.tril(factor), scale * share * body.closed_traction(load))))


@pytest.mark.parametrize("aperture", [0.0, 2e-5, np.inf], ids=["closed", "narrow", "slots"])
def test_no_load_changes_more(aperture):
    """From each of 60 loads to the next, and from rest, no tip's K changes by more than its bound."""
    body, rng = body_with(aperture), np.random.default_rng(3)
    bound, before = ChangeBound(body), np.zeros((len(body.cracks.tips), 2))
    closed, nearest = set(), 0.0
    for _ in range(60):
        load = random_load(body, rng)
        most = bound.at_most(load)
        solution = body.solve(load, equilibrium_tolerance=1e-9)
        tips = solution.tips
        k = np.stack([tips["k_i"], tips["k_ii"]], axis=1)
        size, change = np.hypot(*before.T), np.hypot(*(k - before).T)
        assert (change <= most - size + 1e-6 * most).all()
        nearest = max(nearest, (change / (most - size)).max())
        closed.add(solution.closed.tobytes())
        bound.refer(load, solution)
        assert bound.at_most(load) == pytest.approx(np.hypot(*k.T), rel=1e-6, abs=1e-3 * size.max(initial=1e5))
        before = k
    assert (len(closed) > 5) == (aperture == 0.0) or aperture == 2e-5
    assert nearest > 0.1 / (MARGIN * ESTIMATED)


def test_the_norm_of_a_load_is_estimated_within_its_factor():
    """Products with random directions against the norm itself; it is linear in the load."""
    body, rng = body_with(), np.random.default_rng(8)
    bound = ChangeBound(body)
    ratios = []
    for _ in range(40):
        load = random_load(body, rng)
        ratios.append(np.linalg.norm(bound.measured(load)) / norm(body, load))
    assert min(ratios) > 1 / ESTIMATED and max(ratios) < ESTIMATED
    twice = ddm.BodyLoad(
        segments=load.segments, tractions=2 * load.tractions, body_force=2 * load.body_force, about=load.about,
        body_force_gradient=2 * load.body_force_gradient, remote_stress=2 * np.asarray(load.remote_stress),
    )  # fmt: skip
    assert bound.measured(twice) == pytest.approx(2 * bound.measured(load), rel=1e-12)


def test_loads_beside_the_outline_have_no_bound():
    body = body_with()
    off = OUTLINE[None, :2] + [0.0, 0.1]
    load = ddm.BodyLoad(segments=off, tractions=np.ones((1, 2, 2)), body_force_gradient=np.zeros((2, 2)))
    assert np.isinf(ChangeBound(body).at_most(load)).all()


@pytest.mark.parametrize("angle", [0.2, 0.6])
def test_friction_is_bounded_by_the_path_of_the_load(angle):
    """Along the ways between random loads, in steps that each begin with the slip of the last, no tip's K changes by more
    than the bound since the first; nor does it where the whole way is one step."""
    body, rng = body_with(face_laws=(JointLaw("rough", friction_angle=angle),)), np.random.default_rng(3)
    assert changes_are_bounded(body)
    bound, first, nearest = ChangeBound(body), None, 0.0
    last = random_load(body, rng)
    for _ in range(12):
        to, history = random_load(body, rng), first
        if first is not None:
            bound.refer(last, first)
            before = np.stack([first.tips["k_i"], first.tips["k_ii"]], axis=1)
        for part in np.linspace(0, 1, 6)[1:]:
            load = between(last, to, part)
            history = body.solve(load, history=history, equilibrium_tolerance=1e-9)
            if first is None:
                continue
            most = bound.change(load)
            for found in (history, body.solve(load, history=first, equilibrium_tolerance=1e-9)):
                change = np.hypot(*(np.stack([found.tips["k_i"], found.tips["k_ii"]], axis=1) - before).T)
                assert (change <= most).all()
                nearest = max(nearest, (change / most).max())
        last, first = to, history
    assert nearest > 0.01


def between(a, b, part):
    """The load that is ``part`` of the way from ``a`` to ``b``."""
    shares = np.concatenate([(1 - part) * a.tractions, part * b.tractions])
    force, gradient = ((1 - part) * getattr(a, n) + part * getattr(b, n) for n in ("body_force", "body_force_gradient"))
    return ddm.BodyLoad(
        segments=np.concatenate([a.segments, b.segments]), tractions=shares, body_force=force,
        body_force_gradient=gradient, about=a.about, remote_stress=(1 - part) * a.remote_stress + part * b.remote_stress,
    )  # fmt: skip


def test_cement_is_not_bounded():
    """Bonds that break let go at once."""
    assert changes_are_bounded(body_with())
    cement = JointLaw("cement", friction_angle=0.5, cohesion=1e6, tensile_strength=1e6)
    assert not changes_are_bounded(body_with(face_laws=(cement,)))
