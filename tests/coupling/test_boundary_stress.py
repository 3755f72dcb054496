"""The routes that contact forces take to the cracks: spread over faces, at the springs, by Kelvin's solution."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from geomech import ddm
from geomech.bench.accuracy import boundary_stress
from geomech.coupling import cycles
from geomech.coupling.load_transfer.boundary_tractions import BoundaryForces, boundary_load
from geomech.dda import EDGE_FORCE, POINT_FORCE
from geomech.ddm.kernels.point_forces import KelvinLoad
from geomech.model import CONTACT, SLIP, Blocks, Motion

CORNERS = np.array([[0.03, 0.06], [-0.03, 0.06], [-0.03, -0.06], [0.03, -0.06]])


@pytest.fixture(scope="module")
def problem():
    found = pytest.MonkeyPatch()
    found.setattr(boundary_stress, "SPECIMEN", Path(__file__).parents[2] / boundary_stress.SPECIMEN)
    yield boundary_stress.specimen(0)
    found.undo()


def coupled(problem, route):
    """K at the end of a run by ``route``, and the load of the specimen's body then."""
    last = list(cycles(replace(problem, run=replace(problem.run, boundary_stress=route))))[-1]
    (body,) = last.bodies.values()
    return boundary_stress.factors(last.tips), body.load


def alone(problem, points, forces, **options):
    block = int(problem.cracks.block[0])
    body = ddm.Body(problem.blocks.loops(block), problem.cracks, rock_of(problem), problem.ddm)
    load = ddm.BodyLoad(points=points, forces=forces, **options)
    return boundary_stress.factors(body.solve(load, equilibrium_tolerance=1.0).tips)


def rock_of(problem):
    return problem.materials[problem.blocks.material[int(problem.cracks.block[0])]]


@pytest.mark.parametrize("route", ["springs", "kelvin-springs"])
@pytest.mark.parametrize("block", [0, 1])
def test_springs_keep_force_and_moment(route, block):
    """One square presses on another with two corners: its forces are the contacts' own, where these are."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    blocks = Blocks.from_polygons([square, square + [0.25, 1.0]])
    rows = np.zeros(2, CONTACT)
    rows["block"], rows["other"], rows["state"] = [1, 0], [0, 1], SLIP
    # The upper one's lower left corner on the lower one's top, the lower one's upper right corner on the upper one's
    # base.
    rows["vertex"], rows["edge"] = [4, 2], [2, 4]
    rows["point"], rows["normal"] = [[0.25, 1.0], [1.0, 1.0]], [[0.0, 1.0], [0.0, -1.0]]
    rows["normal_force"], rows["shear_force"] = [2.0, 3.0], [0.5, 0.25]
    none = np.empty(0, EDGE_FORCE), np.empty(0, POINT_FORCE)
    forces = BoundaryForces(blocks.vertices, Motion.of(blocks, blocks.vertices), rows, *none, route=route)
    load = boundary_load(block, blocks, forces)
    assert load.kelvin == (route == "kelvin-springs") and not len(load.segments)
    sense = 1.0 if block == 1 else -1.0
    found = dict(zip(map(tuple, load.points.tolist()), load.forces.tolist()))
    assert found[0.25, 1.0] == pytest.approx([-0.5 * sense, 2.0 * sense], abs=1e-14)
    assert found[1.0, 1.0] == pytest.approx([-0.25 * sense, 3.0 * sense], abs=1e-14)


def test_springs_are_point_loads_at_the_corners(problem):
    """K of the coupled run at 0.2 MPa is that of the crack solver under four point forces σ W/2 (Michell 1902 at
    corners); 1e-6: strains are 1e-5, and lengths are a little different."""
    k, load = coupled(problem, "springs")
    half = 0.2e6 * 0.03
    forces = np.array([[0.0, -half], [0.0, -half], [0.0, half], [0.0, half]])
    reference = alone(problem, CORNERS, forces)
    assert np.abs(k - reference).max() < 1e-6 * np.abs(reference).max()
    assert np.abs(load.forces).sum() == pytest.approx(4 * half, rel=1e-6)


def test_kelvin_leaves_most_of_a_corner_force_outside(problem):
    """In the infinite plane the quarter that is rock takes this much of a force at its corner: the traction of Kelvin's
    field on an arc about it. K_I under point loads of that size is what the route comes to, within 3 %: of what else
    happens at the corner, each element's displacement there being its own, little is seen from afar."""
    k, load = coupled(problem, "kelvin-springs")
    rock = rock_of(problem)
    spots, weights = np.polynomial.legendre.leggauss(20)
    kept = []
    for point, force in zip(load.points, load.forces):
        into = -np.sign(point)
        turn = np.pi / 4 * (spots + 1)
        out = np.column_stack([into[0] * np.cos(turn), into[1] * np.sin(turn)])
        stress = KelvinLoad(point, force, rock).stress(point + 1e-3 * out)
        pull = np.einsum("nij,nj->ni", stress[:, [0, 2, 2, 1]].reshape(-1, 2, 2), out)
        kept.append(-np.pi / 4 * 1e-3 * weights @ pull)
    assert np.array(kept)[:, 1] == pytest.approx(0.25 * load.forces[:, 1], rel=1e-6)
    reference = alone(problem, load.points, np.array(kept))
    assert np.abs(k[0] - reference[0]).max() < 0.03 * np.abs(reference[0]).max()
    exact = boundary_stress.exact(problem, 0.2e6)
    assert np.abs(k[0]).max() < 0.35 * np.abs(exact[0]).max()


def test_contacts_are_the_exact_tractions(problem):
    """1e-6, as for the coupled specimen: at 0.2 MPa strains are 1e-5, and shear of the sizes of the cracks' own."""
    k, _ = coupled(problem, "contacts")
    reference = boundary_stress.exact(problem, 0.2e6)
    assert np.abs(k - reference).max() < 1e-6 * np.abs(reference).max()
