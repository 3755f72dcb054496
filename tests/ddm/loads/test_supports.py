"""Held sides: exact fields, rigid motions, reactions, reciprocity, reuse, refusals."""

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm import Support
from geomech.model import Cracks, DdmSettings, Material

ROCK = Material("rock", youngs_modulus=10e9, poissons_ratio=0.25)
SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
NONE = Cracks.from_polylines([])
POINTS = np.array([[0.3, 0.2], [-0.7, 0.9], [0.0, -0.97], [0.95, -0.95]])
WEIGHT = 26.5e3
TOP = [[[1, 1], [-1, 1]]]


def turned(points, angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(points) @ np.array([[c, s], [-s, c]])


@pytest.mark.parametrize("sides", [(Support(0, "normal"), Support(3, "normal")), (Support(0, "y"), Support(3, "x"))])
def test_a_block_between_rollers_is_strained_uniformly(sides):
    """Displacement is absolute; 1e-10 is round-off (the fields are linear, so in the elements' span)."""
    sol = ddm.Body([SQUARE], NONE, ROCK, supports=sides).solve(ddm.BodyLoad(TOP, [[[0, -1e6]] * 2]))
    assert np.allclose(sol.stress(POINTS), [0, -1e6, 0], rtol=0, atol=1e-10 * 1e6)
    strain = ROCK.compliance() @ [0, -1e6, 0]
    assert np.allclose(sol.displacement(POINTS), strain[:2] * (POINTS + 1), rtol=0, atol=1e-10 * abs(strain[1]))
    assert np.allclose(sol.reactions.force, [[0, 2e6], [0, 0]], atol=1e-10 * 2e6)


def test_gravity_between_rollers():
    """Uniaxial strain: σ_yy = −w(h − y), σ_xx = ν/(1−ν) σ_yy, to round-off; the base carries the weight."""
    sides = (Support(0, "normal"), Support(1, "normal"), Support(3, "normal"))
    sol = ddm.Body([SQUARE], NONE, ROCK, supports=sides).solve(ddm.BodyLoad(body_force=[0, -WEIGHT]))
    down = -WEIGHT * (1 - POINTS[:, 1])
    assert np.allclose(sol.stress(POINTS), np.column_stack([down / 3, down, 0 * down]), rtol=0, atol=1e-10 * WEIGHT)
    assert np.allclose(sol.reactions.force[0], [0, 4 * WEIGHT], atol=1e-10 * WEIGHT)
    assert np.allclose(sol.reactions.force[1:].sum(axis=0), 0, atol=1e-10 * WEIGHT)


def test_linear_displacement_on_the_whole_outline():
    """A patch test on an irregular pentagon with a hole that follows: only the outline is held."""
    outline = np.array([[0, 0], [2, 0.2], [2.3, 1.1], [0.9, 1.9], [-0.2, 1.0]])
    gradient = np.array([[1e-4, 3e-4], [-2e-4, 5e-5]])
    held = tuple(Support(k) for k in range(5))
    sol = ddm.Body([outline], NONE, ROCK, supports=held).solve(
        ddm.BodyLoad(displacements=[lambda x: x @ gradient.T] * 5)
    )
    points = np.array([[0.5, 0.5], [1.9, 0.9], [1.0, 1.6]])
    strain = np.array([gradient[0, 0], gradient[1, 1], gradient[0, 1] + gradient[1, 0]])
    stress = np.linalg.solve(ROCK.compliance(), strain)
    assert np.allclose(sol.stress(points), stress, rtol=1e-9)
    assert np.allclose(sol.displacement(points), points @ gradient.T, rtol=1e-9)
    assert np.abs(sol.reactions.force.sum(axis=0)).max() < 1e-9 * np.abs(sol.reactions.force).max()
    assert abs(sol.reactions.moment.sum()) < 1e-9 * np.abs(sol.reactions.moment).max()


def test_an_imposed_rotation_leaves_no_stress():
    ends = [
        [turn, np.roll(SQUARE, -1, axis=0)[k] @ [[0, 1e-3], [-1e-3, 0]]]
        for k, turn in enumerate(SQUARE @ [[0, 1e-3], [-1e-3, 0]])
    ]
    body = ddm.Body([SQUARE], NONE, ROCK, supports=tuple(Support(k) for k in range(4)))
    assert np.abs(body.solve(ddm.BodyLoad(displacements=ends)).stress(POINTS)).max() < 1e-12 * 1e-3 * 10e9


@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_rollers_at_any_angle_to_their_side(angle):
    """The uniform field u = (a x, b y) turned by ``angle``: a roller that holds "x" or a slanted direction on a slanted
    side, the traction along its free direction given."""
    corners = np.array([[0, 0], [2, 0], [2, 1], [1, 2.0]])
    outline = turned(corners, angle)
    strain = np.array([2e-4, -1e-4, 0.0])
    stress = np.linalg.solve(ROCK.compliance(), strain)
    ways = {1: (1.0, 0.0), 2: (0.6, 0.8), 3: (1.0, 0.0)}
    held = (Support(0, "normal"), *(Support(k, tuple(turned(way, angle))) for k, way in ways.items()))
    motion = [lambda x: turned(turned(x, -angle) * strain[:2], angle)] * 4
    tractions = []
    for k in range(4):
        d = np.roll(corners, -1, axis=0)[k] - corners[k]
        n = np.array([d[1], -d[0]]) / np.hypot(*d)
        full = stress[:2] * n
        way = np.array(ways.get(k, (0.0, 1.0)))
        tractions.append([turned(full - way * (full @ way), angle)] * 2)
    segments = np.stack([outline, np.roll(outline, -1, axis=0)], axis=1)
    sol = ddm.Body([outline], NONE, ROCK, supports=held).solve(
        ddm.BodyLoad(segments, np.array(tractions), displacements=motion)
    )
    points = np.array([[0.5, 0.3], [1.5, 1.1]])
    expected = turned(points * strain[:2], angle)
    assert np.allclose(sol.displacement(turned(points, angle)), expected, rtol=0, atol=1e-10 * 2e-4)


def test_what_is_held_decides_which_loads_are_refused():
    """A roller under the block takes the weight and no side force; its own reaction is in equilibrium with the load."""
    body = ddm.Body([SQUARE], NONE, ROCK, supports=(Support(0, "normal"),))
    sol = body.solve(ddm.BodyLoad(body_force=[0, -WEIGHT]))
    assert np.allclose(sol.reactions.force, [[0, 4 * WEIGHT]], atol=1e-8 * WEIGHT)
    # Free to slide, the block stays where it is on the mean.
    mean = sol.displacement(np.array([[-0.4, 0.3], [0.4, 0.3]]))[:, 0].sum()
    assert abs(mean) < 1e-12
    with pytest.raises(ddm.OutOfEquilibrium, match=r"force .40000, 0. N/m"):
        body.solve(ddm.BodyLoad(body_force=[1e4, -WEIGHT]))
    pinned = ddm.Body([SQUARE], NONE, ROCK, supports=(Support(0),))
    # What the graded mesh leaves of the singular corners of a pinned side.
    force = pinned.solve(ddm.BodyLoad(body_force=[1e4, -WEIGHT])).reactions.force
    assert np.allclose(force, [[-4e4, 4 * WEIGHT]], rtol=0, atol=2e-5 * 4 * WEIGHT)


def test_reciprocity_of_two_loads_on_a_mixed_body():
    """Betti: the work of load A on displacement B is that of B on A, which moves only its reactions on
    imposed displacements: W(push, move) + W(reaction, move) = 0. The tolerance is the discretisation error at the ends
    of the pinned piece."""
    held = (Support(((-0.5, -1), (0.6, -1))), Support(((1, -0.2), (1, 0.7)), "normal"))
    body = ddm.Body([SQUARE], NONE, ROCK, supports=held)
    push = ddm.BodyLoad(TOP, [[[0, -1e6], [0, -3e6]]])
    move = ddm.BodyLoad(displacements=[[1e-4, 2e-4], [[-1e-4, 0], [3e-4, 0]]])
    a, b = body.solve(push), body.solve(move)
    x, w = np.polynomial.legendre.leggauss(60)
    # Twenty pieces: the displacement has kinks in its higher derivatives between elements.
    at = np.concatenate([(k + 0.5 + 0.5 * x) / 20 for k in range(20)])
    q = np.tile(w, 20) / 20
    line = np.column_stack([1 - 2 * at, np.ones(len(at))])
    tractions = (1 - at)[:, None] * push.tractions[0, 0] + at[:, None] * push.tractions[0, 1]
    outer = q @ np.sum(tractions * b.displacement(line), axis=1)
    r = a.reactions
    quadrature = body.boundary.quadrature[body._outside.holds.elements]
    s = ((r.points - [1, -0.2]) @ [0, 0.9] / 0.81)[..., None]
    given = np.where((r.support == 0)[:, None, None], [1e-4, 2e-4], (1 - s) * [-1e-4, 0] + s * [3e-4, 0])
    inner = np.einsum("en,enc,enc->", quadrature, r.traction, given)
    assert outer == pytest.approx(-inner, rel=5e-5)


def test_half_a_model_on_a_roller_is_the_whole():
    """Centre crack under tension: K_I of the half model with a mouth on its roller against the whole plate, 1e-5 (the
    meshes differ)."""
    whole_plate = np.array([[-1, -1.5], [1, -1.5], [1, 1.5], [-1, 1.5]])
    half_plate = np.array([[0, -1.5], [1, -1.5], [1, 1.5], [0, 1.5]])

    def pulled(plate):
        ends = [[plate[0], plate[1]], [plate[2], plate[3]]]
        return ddm.BodyLoad(np.array(ends), [[[0, -1e6]] * 2, [[0, 1e6]] * 2])

    whole = ddm.Body([whole_plate], Cracks.from_polylines([np.array([[-0.5, 0], [0.5, 0]])]), ROCK)
    cracks = Cracks.from_polylines([np.array([[0.0, 0], [0.5, 0]])], surface=[(True, False)])
    half = ddm.Body([half_plate], cracks, ROCK, supports=(Support(3, "normal"),))
    k = half.solve(pulled(half_plate)).tips["k_i"]
    assert k == pytest.approx(whole.solve(pulled(whole_plate)).tips["k_i"][1], rel=1e-5)


def test_growth_reuses_a_held_boundary():
    held = (Support(0), Support(3, "normal"))
    load = ddm.BodyLoad(TOP, [[[1e6, 2e6]] * 2], body_force=[0, -WEIGHT], displacements=[[0, 1e-5], None])
    lines = [[-0.3, 0.0], [0.2, 0.1], [0.35, 0.3], [0.4, 1.0]]
    body, solutions = None, []
    for n, mouth in ((2, False), (3, False), (4, True)):
        cracks = Cracks.from_polylines([np.array(lines[:n])], surface=[(False, mouth)])
        body = ddm.Body([SQUARE], cracks, ROCK, reuse=ddm.Reuse(body), supports=held)
        body.solve(load)
        again = body.solve(load)
        fresh = ddm.Body([SQUARE], cracks, ROCK, supports=held).solve(load)
        for name in ("k_i", "k_ii"):
            assert np.allclose(again.tips[name], fresh.tips[name], rtol=0, atol=1e-10 * np.abs(fresh.tips["k_i"]).max())
        assert np.allclose(again.reactions.force, fresh.reactions.force, rtol=1e-9)
        solutions.append(again)
    assert solutions[1].body.counts["boundary_factorisations"] == 0
    assert solutions[1].residual < 1e-9


@pytest.mark.parametrize("hold", ["both", "x", (0.6, 0.8)])
def test_a_held_hole_holds_the_body(hold):
    """The hole moves as a linear displacement, the outline carries the uniform stress that goes with it: displacement
    is absolute, to round-off. What the hole's support leaves free keeps the outline's mean at zero."""
    hole = np.array([[-0.2, -0.1], [0.3, -0.2], [0.4, 0.35], [-0.15, 0.4]])
    body = ddm.Body([SQUARE], NONE, ROCK, holes=[hole], supports=tuple(Support(k, hold) for k in range(4, 8)))
    gradient = np.array([[1e-4, 3e-4], [-2e-4, 5e-5]])
    xx, yy, xy = np.linalg.solve(ROCK.compliance(), [gradient[0, 0], gradient[1, 1], gradient[0, 1] + gradient[1, 0]])
    along = body.mesh.edges[:, 1] - body.mesh.edges[:, 0]
    out = np.column_stack([along[:, 1], -along[:, 0]]) / np.hypot(*along.T)[:, None]
    carried = out @ np.array([[xx, xy], [xy, yy]])
    if hold != "both":
        way = np.array((1.0, 0.0) if hold == "x" else hold)
        carried[4:] -= np.outer(carried[4:] @ way, way)
    sides = dict(enumerate(carried if hold != "both" else carried[:4]))
    sol = body.solve(ddm.BodyLoad(sides=sides, displacements=[lambda x: x @ gradient.T] * 4))
    points = np.array([[0.7, 0.2], [-0.7, 0.8]])
    assert np.allclose(sol.displacement(points), points @ gradient.T, rtol=0, atol=1e-11 * 3e-4)
    assert np.allclose(sol.stress(points), [xx, yy, xy], rtol=1e-10)


def test_a_block_hangs_on_a_bolt():
    """A pinned hole takes weight, tractions and point loads in whatever form they come, with a crack that grows beside
    it; against order 7, and from body to body."""
    bolt = tuple(Support(k) for k in range(4, 8))
    lines = np.array([[-0.8, 0.5], [-0.5, 0.7], [-0.4, 0.75]])
    loads = (
        (ddm.BodyLoad(body_force=[1e4, -2e4]), [3.64e4, -7.28e4]),
        (ddm.BodyLoad(points=[[1, 0.3], [-0.6, -0.6]], forces=[[1e4, 0], [0, 2e4]]), [1e4, 2e4]),
        (ddm.BodyLoad(sides={2: [1e4, -2e4], 1: lambda x: 1e4 * x}), [4e4, -4e4]),
    )
    first = ddm.Body(
        [SQUARE], Cracks.from_polylines([lines[:2]], aperture=np.inf), ROCK, holes=[0.3 * SQUARE], supports=bolt
    )
    for load, _ in loads:
        first.solve(load)
        first.solve(load)
    grown = Cracks.from_polylines([lines], aperture=np.inf)
    body = ddm.Body([SQUARE], grown, ROCK, holes=[0.3 * SQUARE], supports=bolt, reuse=ddm.Reuse(first))
    fine = ddm.Body([SQUARE], grown, ROCK, DdmSettings(order=7), holes=[0.3 * SQUARE], supports=bolt)
    for load, force in loads:
        sol = body.solve(load)
        size = np.abs(force).max()
        # What four singular corners of the bolt leave.
        assert np.allclose(sol.reactions.force.sum(axis=0), -np.array(force), rtol=0, atol=1e-4 * size)
        other = fine.solve(load).tips
        scale = np.hypot(other["k_i"], other["k_ii"]).max()
        assert np.allclose(sol.tips["k_i"], other["k_i"], rtol=0, atol=3e-4 * scale)
        assert sol.residual < 1e-9


@pytest.mark.parametrize(
    ("supports", "message"),
    [
        ((Support(8, name="base"),), "support 'base': there is no edge 8, the body has 8"),
        ((Support(((-1, -1.1), (1, -1.1))),), "support 0 lies .* off the boundary"),
        ((Support(((0.5, -1), (0.5, -1))),), "support 0 has no length"),
        ((Support(0), Support(((0.5, -1), (0.8, -1)), name="b")), "support 0 and support 'b' overlap"),
        ((Support(5), Support(((0.3, 0.3), (0.3, -0.3)), "x")), "support 0 and support 1 overlap"),
    ],
)
def test_refusals_name_the_support(supports, message):
    with pytest.raises(ValueError, match=message):
        ddm.Body([SQUARE], NONE, ROCK, holes=[0.3 * SQUARE], supports=supports)


def test_supports_and_displacements_are_checked():
    with pytest.raises(ValueError, match="'a': not finite"):
        Support(((0, 0), (np.nan, 1)), name="a")
    with pytest.raises(ValueError, match="hold must be one of"):
        Support(0, "sideways")
    with pytest.raises(ValueError, match="direction"):
        Support(0, (0.0, 0.0))
    body = ddm.Body([SQUARE], NONE, ROCK, supports=(Support(0),))
    with pytest.raises(ValueError, match="1 supports but 2"):
        body.solve(ddm.BodyLoad(displacements=[None, None]))
    with pytest.raises(ValueError, match="support 0: not finite"):
        body.solve(ddm.BodyLoad(displacements=[[0, np.inf]]))
    with pytest.raises(ValueError, match="support 0: expected"):
        body.solve(ddm.BodyLoad(displacements=[[0, 1, 2]]))
    with pytest.raises(ValueError, match="without supports"):
        body.compliance()
    with pytest.raises(TypeError, match="support 0: expected a Support"):
        ddm.Body([SQUARE], NONE, ROCK, supports=("base",))
    with pytest.raises(ValueError, match="outline"):
        ddm.Body([], NONE, ROCK, supports=(Support(0),))


def test_holes_are_checked():
    hole = 0.3 * SQUARE
    for holes, message in (
        ([hole, 0.5 * hole], "hole 2: inside hole 1"),
        ([hole, hole + 0.2], "hole 1 and hole 2 cross"),
        ([hole[:2]], "hole 1: expected at least three vertices"),
        ([hole * np.nan], "hole 1: vertex 0 is not finite"),
        ([np.array([[0, 0], [1, 0], [2, 0]])], "hole 1: encloses no area"),
    ):
        with pytest.raises(ValueError, match=message):
            ddm.Body([], NONE, ROCK, holes=holes)
    with pytest.raises(ValueError, match="the outline and hole 1 cross"):
        ddm.Body([SQUARE], NONE, ROCK, holes=[hole + 0.9])
    with pytest.raises(ValueError, match="lies outside the rock"):
        ddm.Body([], Cracks.from_polylines([np.array([[0, 0], [0.1, 0]])]), ROCK, holes=[hole])
