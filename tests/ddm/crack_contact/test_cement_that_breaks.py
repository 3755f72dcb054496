"""Cement of crack faces that is to break under the next load, whatever it is (`FaceMemory.breaking`)."""

from dataclasses import replace

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.crack_contact.face_laws import FaceMemory, breaking_as, carried_over
from geomech.model import Cracks, DdmSettings, JointLaw, Material

ROCK = Material("rock", 17e9, 0.21)
CEMENT = JointLaw("cement", friction_angle=0.5, cohesion=1e5, tensile_strength=1e5)
HOLDS, PARTS = (ddm.BodyLoad(remote_stress=[0.0, pull, 0.0]) for pull in (5e4, 2e5))


def body(elements=2):
    crack = Cracks.from_polylines([np.array([[-1.0, 0.0], [1.0, 0.0]])])
    return ddm.Body([], crack, ROCK, DdmSettings(order=2, elements_per_crack=elements), face_laws=[CEMENT])


def test_it_breaks_under_a_load_that_it_would_bear():
    cracked = body()
    holds, parts = cracked.solve(HOLDS), cracked.solve(PARTS)
    assert not holds.memory.broken.any() and parts.memory.broken.all()
    told = breaking_as(None, parts.memory)
    assert told.breaking.all() and not told.broken.any()
    gives = cracked.solve(HOLDS, history=told)
    broken = cracked.solve(HOLDS, history=replace(FaceMemory.none(cracked.faces), broken=parts.memory.broken))
    assert gives.memory.broken.all() and gives.memory.breaking is None
    assert gives.jumps == pytest.approx(broken.jumps, abs=1e-9 * np.abs(broken.jumps).max())
    # It breaks in this step, and what that sets free counts there; what was broken before has been counted.
    assert gives.dissipated_in_step[1].bond > 0.0 == broken.dissipated_in_step[1].bond


def test_nothing_more_breaks_where_all_is_broken():
    cracked = body()
    parts = cracked.solve(PARTS).memory
    told = breaking_as(None, parts)
    assert breaking_as(parts, parts) is None and breaking_as(told, parts) is None
    holds = cracked.solve(HOLDS).memory
    assert breaking_as(parts, holds) is None and breaking_as(holds, holds) is None


def test_it_is_kept_on_other_elements():
    fine, coarse = body(4), body(2)
    told = breaking_as(None, coarse.solve(PARTS).memory)
    moved = carried_over(told, fine.faces)
    assert moved.breaking.all() and not moved.broken.any()
    assert fine.solve(HOLDS, history=told).memory.broken.all()
