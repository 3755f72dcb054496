"""The residual is relative to what acts, whatever that is: it knows no unit of load, and sees equations not met."""

import numpy as np
import pytest

from geomech import ddm
from geomech.model import Cracks, JointLaw, Material

ROCK = Material("rock", 17e9, 0.21, density=2600.0)
SQUARE = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
HOLE = np.array([[-0.6, -0.6], [-0.3, -0.6], [-0.3, -0.3], [-0.6, -0.3]])
CRACK = Cracks.from_polylines([np.array([[-0.2, 0.1], [0.4, 0.5]])], aperture=np.inf)
SHUT = Cracks.from_polylines([np.array([[-0.2, 0.1], [0.4, 0.5]])])
EDGE = Cracks.from_polylines([np.array([[-1.0, 0.1], [0.1, 0.2]])], surface=[(True, False)])
PLATE, HOLED, STANDING = (
    ([SQUARE], {}),
    ([SQUARE], {"holes": [HOLE]}),
    ([SQUARE], {"supports": [ddm.Support(0, "both")]}),
)
CLAMPED = ([SQUARE], {"supports": [ddm.Support(0, "both"), ddm.Support(2, "both")]})
GROUND = (ddm.HalfPlane((0, 1), (0, 1)), {})
PULL = {0: (0.0, -1.0), 2: (0.0, 1.0)}

#: What the body is, its cracks, its load per Pa.
CASES = {
    "sides": (PLATE, CRACK, ddm.BodyLoad(sides=PULL)),
    "functions": (PLATE, CRACK, ddm.BodyLoad(sides={0: lambda p: np.c_[0 * p[:, 0], -np.cos(p[:, 0])],
                                                    2: lambda p: np.c_[0 * p[:, 0], np.cos(p[:, 0])]})),
    "remote stress": (([], {}), CRACK, ddm.BodyLoad(remote_stress=[0.3, 1.0, 0.2])),
    "point loads": (PLATE, CRACK, ddm.BodyLoad(points=[(0, 1), (0, -1)], forces=[(0, -1), (0, 1)])),
    "inside": (PLATE, CRACK, ddm.BodyLoad(points=[(-0.5, 0.3), (-0.5, -0.5)], forces=[(0, 1), (0, -1)])),
    "fluid in a crack": (PLATE, CRACK, ddm.BodyLoad(crack_pressure=1.0)),
    "fluid in a mouth": (PLATE, EDGE, ddm.BodyLoad(crack_pressure=1.0)),
    "fluid by place": (PLATE, CRACK, ddm.BodyLoad(crack_pressure=lambda p: 1.0 + p[:, 0])),
    "fluid in the plane": (([], {}), CRACK, ddm.BodyLoad(crack_pressure=1.0)),
    "fluid in ground": (GROUND, CRACK, ddm.BodyLoad(crack_pressure=1.0)),
    "fluid in a hole": (HOLED, CRACK, ddm.BodyLoad(hole_pressure=1.0)),
    "weight": (STANDING, CRACK, ddm.BodyLoad(body_force=[0, -1.0])),
    "weight of ground": (GROUND, CRACK, ddm.BodyLoad(body_force=[0, -1.0], k0=0.5)),
    "moved supports": (CLAMPED, CRACK, ddm.BodyLoad(displacements=[None, (0, 1e-10)])),
    "moved as a whole": (CLAMPED, CRACK, ddm.BodyLoad(displacements=[(1e-10, 0), (1e-10, 0)])),
    "closed crack": (PLATE, SHUT, ddm.BodyLoad(sides={0: (0.0, 1.0), 2: (0.0, -1.0)})),
}  # fmt: skip


@pytest.fixture(scope="module")
def made():
    """name → body and load, made once."""
    bodies = {}

    def of(name):
        (loops, options), cracks, load = CASES[name]
        if name not in bodies:
            bodies[name] = ddm.Body(loops, cracks, ROCK, **options)
        return bodies[name], load

    return of


@pytest.mark.parametrize("name", CASES)
def test_it_does_not_change_with_the_size_of_the_load(name, made, caplog):
    body, load = made(name)
    small, one, large = (body.solve(load.scaled(size)).residual for size in (1e-3, 1.0, 1e9))
    # What is left of loads that the discretisation meets exactly is round-off.
    assert small == pytest.approx(one, rel=1e-3, abs=1e-9) and large == pytest.approx(one, rel=1e-3, abs=1e-9)
    assert one < 1e-3 and not caplog.records


@pytest.mark.parametrize("name", [name for name in CASES if name != "moved as a whole"])
def test_it_sees_equations_that_are_not_met(name, made, caplog):
    """A crack that moves by a twentieth too much leaves a twentieth of the traction that it relieves."""
    body, load = made(name)
    solution = body.solve(load.scaled(1e6))
    solution.jumps = 1.05 * solution.jumps
    assert 2e-3 < solution.residual < 0.1 and "residual" in caplog.text


def test_what_faces_keep_when_the_load_is_gone_acts_too():
    """Faces that have slipped hold on by their cohesion when the load is all but taken away: next to nothing is
    applied then, and the rock is under the tractions of its faces."""
    body = ddm.Body([], SHUT, ROCK, face_laws=[JointLaw("rough", friction_angle=0.3, cohesion=1e5)])
    first = body.solve(ddm.BodyLoad(remote_stress=[-1e6, -6e6, 0.0]))
    last = body.solve(ddm.BodyLoad(remote_stress=[-1e-6, -1e-6, 0.0]), history=first)
    assert np.abs(last.faces.traction).max() > 0.9e5 and last.residual < 1e-12
