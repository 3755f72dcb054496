"""Faces with friction under uniform stress, as long as none changes its state, against solutions of the body."""

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.crack_contact.uniform_friction import RoughSolution, solved_in_states
from geomech.model import Cracks, JointLaw, Material

ROCK = Material("rock", 10e9, 0.25, k_ic=2e6)
SQUARE = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])


def body_with(angle: float, cohesion: float = 0.0) -> ddm.Body:
    """Four bent closed cracks in a square."""
    rng = np.random.default_rng(2)
    lines = []
    for k in range(4):
        middle, turn = np.array([2.5 + 5 * (k % 2), 2.5 + 5 * (k // 2)]), rng.uniform(0, np.pi)
        along = 1.2 * np.array([np.cos(turn), np.sin(turn)])
        lines.append(np.array([middle - along, middle + rng.uniform(-0.2, 0.2, 2), middle + along]))
    cracks = Cracks.from_polylines(lines, aperture=0.0)
    return ddm.Body([SQUARE], cracks, ROCK, face_laws=(JointLaw("rough", friction_angle=angle, cohesion=cohesion),))


def stresses(n: int) -> list[np.ndarray]:
    """Loads that open, close and shear cracks to and fro, Pa."""
    return [
        np.array([-1e6 - 8e5 * np.sin(0.3 * k), -2e6 + 2.2e6 * np.cos(0.21 * k), 1.5e6 * np.sin(0.4 * k)])
        for k in range(n)
    ]


def close(mine: np.ndarray, other: np.ndarray, tolerance: float) -> None:
    np.testing.assert_allclose(mine, other, rtol=0, atol=tolerance * np.abs(other).max(initial=1e-30))


def test_faces_that_keep_their_states_follow_the_stress():
    """The same jumps, tractions, memory, energy and K as solutions of the body, as long as states stay; None where they
    do not, and where sticking faces have slipped in between."""
    body, fresh = body_with(0.5), body_with(0.5)
    loads = [s * (1 + 0.01 * k) for s in stresses(8) for k in range(4)]
    before, history, kept, last = None, None, 0, None
    for stress in loads:
        direct = fresh.solve(ddm.BodyLoad(remote_stress=stress), warm=last, history=last)
        found = solved_in_states(body, stress, before, history)
        if found is None:
            found = body.solve(ddm.BodyLoad(remote_stress=stress), warm=before, history=history)
            assert before is None or before.face_states.key != direct.face_states.key or not np.array_equal(
                before.memory.rest, before.began.rest
            )  # fmt: skip
        else:
            assert isinstance(found, RoughSolution)
            kept += 1
        assert found.face_states.key == direct.face_states.key
        for name in ("jumps", "face_traction", "crack_strain"):
            close(getattr(found, name), getattr(direct, name), 1e-9)
        close(found.memory.rest, direct.memory.rest, 1e-9)
        for name in ("crack_energy", "frictional_work"):
            assert getattr(found, name) == pytest.approx(getattr(direct, name), rel=1e-8, abs=1e-9), name
        size = np.abs(direct.tips["k_ii"]).max()
        for name in ("k_i", "k_ii"):
            np.testing.assert_allclose(found.tips[name], direct.tips[name], rtol=0, atol=1e-8 * size)
        before = found
        history = found.memory
        last = direct
    assert kept > len(loads) // 3
